//! From the words on the command line to a scene that is looked at.

use std::ffi::OsStr;
use std::path::Path;

use glam::DVec3;
use stillray::report::table::Table;
use stillray::scene::motion::Motion;
use stillray::scene::{Pose, Scene, View, builtin, import};
use stillray::{Error, Result};

use super::arguments::Source;
use super::{Outcome, console};

/// A scene with a camera in it that moves.
pub struct Stage {
    /// What is rendered.
    pub scene: Scene,
    /// The scene as the user named it.
    pub name: String,
    camera: usize,
    motion: Motion,
    /// Centre of the scene in metres, about which orbits turn.
    focus: DVec3,
    /// Distance in metres from there that nothing exceeds.
    radius: f64,
}

impl Stage {
    /// Loads the scene and finds the camera. What the scene has to be told about is said.
    pub fn load(source: &Source, motion: Motion) -> Outcome<Self> {
        let scene = load(&source.scene, source.seed)?;
        console::notes(&scene.notices);
        let camera = find_camera(&scene, source.camera.as_deref())?;
        let (focus, radius) = sphere(&scene);
        Ok(Self { name: source.scene.to_string_lossy().into_owned(), camera, motion, focus, radius, scene })
    }

    /// Where everything is and where it is seen from after `seconds`.
    pub fn at(&self, seconds: f64) -> (Pose, View) {
        let pose = self.scene.pose(seconds);
        let view = self.motion.view(&pose.cameras[self.camera], self.focus, self.radius, seconds);
        (pose, view)
    }

    /// Name of the camera.
    pub fn camera(&self) -> &str {
        &self.scene.cameras[self.camera].name
    }

    /// Name of the motion.
    pub fn motion(&self) -> &'static str {
        self.motion.name()
    }
}

/// Loads a file or a built-in scene.
pub fn load(spec: &OsStr, seed: u32) -> Result<Scene> {
    match spec.to_str().and_then(|s| s.strip_prefix("builtin:")) {
        Some(name) => builtin::load(name, seed),
        None => import::load(Path::new(spec)),
    }
}

/// By name, or else by number, or else the first.
fn find_camera(scene: &Scene, wanted: Option<&str>) -> Result<usize> {
    let Some(wanted) = wanted else { return Ok(0) };
    let named = scene.cameras.iter().position(|c| c.name == wanted);
    let numbered = || wanted.parse().ok().filter(|&i: &usize| i < scene.cameras.len());
    named.or_else(numbered).ok_or_else(|| {
        let names: Vec<String> = scene.cameras.iter().map(|c| format!("'{}'", c.name)).collect();
        let expected = format!("the scene has the cameras {}", names.join(", "));
        Error::Setting { name: "--camera", value: wanted.to_owned(), expected }
    })
}

/// The built-in scenes, one a line.
pub fn list() -> Table {
    let mut table = Table::new(["built-in scene", "what it is"]).left();
    for (name, about) in builtin::NAMES {
        table.row([format!("builtin:{name}"), (*about).to_owned()]);
    }
    table
}

/// Centre and radius in metres of a sphere that holds everything in the scene, for a camera to move about.
fn sphere(scene: &Scene) -> (DVec3, f64) {
    match scene.bounds(&scene.pose(0.0)) {
        Some((low, high)) => (low.midpoint(high), low.distance(high) / 2.0),
        None => (DVec3::ZERO, 1.0),
    }
}
