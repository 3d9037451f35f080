//! From the words on the command line to a scene that is looked at.

use std::ffi::OsStr;
use std::path::Path;

use stillray::Result;
use stillray::report::table::Table;
use stillray::scene::motion::Motion;
use stillray::scene::shot::Shot;
use stillray::scene::{Lens, Medium, Pose, Scene, View, builtin, import};

use super::arguments::Source;
use super::{Outcome, console};

/// A scene with a camera in it that moves.
pub struct Stage {
    /// What is rendered.
    pub scene: Scene,
    /// The scene as the user named it.
    pub name: String,
    shot: Shot,
}

impl Stage {
    /// Loads the scene and finds the camera. What the scene has to be told about is said.
    pub fn load(source: &Source, motion: Motion) -> Outcome<Self> {
        let (scene, shot) = looked_at(source, motion)?;
        console::notes(&scene.notices);
        Ok(Self { name: source.scene.to_string_lossy().into_owned(), shot, scene })
    }

    /// Where everything is and where it is seen from after `seconds`.
    pub fn at(&self, seconds: f64) -> (Pose, View) {
        self.shot.at(&self.scene, seconds)
    }

    /// Name of the camera.
    pub fn camera(&self) -> &str {
        self.shot.camera()
    }

    /// Name of the motion.
    pub fn motion(&self) -> &'static str {
        self.shot.motion().name()
    }
}

/// Loads what the user asks for, with the light around it, and the camera and the lens to look at it through.
pub fn looked_at(source: &Source, motion: Motion) -> Result<(Scene, Shot)> {
    let mut scene = load(&source.scene, source.seed)?;
    for camera in &mut scene.cameras {
        camera.lens = source.optics.of(camera.lens);
        camera.shutter = source.optics.shutter.unwrap_or(camera.shutter);
    }
    source.surroundings.apply(&mut scene)?;
    scene.medium = source.fog.map(Medium::fog).or(scene.medium);
    let shot = Shot::new(&scene, source.camera.as_deref(), motion)?;
    let shot = shot.with_lens(source.optics.of(Lens::PINHOLE)).with_shutter(source.optics.shutter.unwrap_or(0.0));
    Ok((scene, shot))
}

/// Loads a file or a built-in scene.
pub fn load(spec: &OsStr, seed: u32) -> Result<Scene> {
    match spec.to_str().and_then(|s| s.strip_prefix("builtin:")) {
        Some(name) => builtin::load(name, seed),
        None => import::load(Path::new(spec)),
    }
}

/// The built-in scenes, one a line.
pub fn list() -> Table {
    let mut table = Table::new(["built-in scene", "what it is"]).left();
    for (name, about) in builtin::NAMES {
        table.row([format!("builtin:{name}"), (*about).to_owned()]);
    }
    table
}
