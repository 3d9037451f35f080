//! From the words on the command line to a scene that is looked at.

use std::ffi::OsStr;
use std::path::Path;

use glam::{DMat3, DQuat, DVec3};
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
    camera: Camera,
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
        let base = match &self.camera {
            Camera::OfScene(index) => pose.cameras[*index],
            Camera::Placed(_, view) => *view,
        };
        let view = self.motion.view(&base, self.focus, self.radius, seconds);
        (pose, view)
    }

    /// Name of the camera.
    pub fn camera(&self) -> &str {
        match &self.camera {
            Camera::OfScene(index) => &self.scene.cameras[*index].name,
            Camera::Placed(words, _) => words,
        }
    }

    /// Name of the motion.
    pub fn motion(&self) -> &'static str {
        self.motion.name()
    }
}

/// Where the scene is seen from before the camera moves.
enum Camera {
    /// One of the scene's.
    OfScene(usize),
    /// The user's, in their words.
    Placed(String, View),
}

/// Loads a file or a built-in scene.
pub fn load(spec: &OsStr, seed: u32) -> Result<Scene> {
    match spec.to_str().and_then(|s| s.strip_prefix("builtin:")) {
        Some(name) => builtin::load(name, seed),
        None => import::load(Path::new(spec)),
    }
}

/// The scene's by name, or else by number, or else one that is placed by two points; without a wish the scene's first.
fn find_camera(scene: &Scene, wanted: Option<&str>) -> Result<Camera> {
    let Some(wanted) = wanted else { return Ok(Camera::OfScene(0)) };
    let named = scene.cameras.iter().position(|c| c.name == wanted);
    let numbered = || wanted.parse().ok().filter(|&i: &usize| i < scene.cameras.len());
    if let Some(index) = named.or_else(numbered) {
        return Ok(Camera::OfScene(index));
    }
    let placed = place_camera(wanted).map(|view| Camera::Placed(wanted.to_owned(), view));
    placed.ok_or_else(|| {
        let names: Vec<String> = scene.cameras.iter().map(|c| format!("'{}'", c.name)).collect();
        let expected = format!("the scene has the cameras {}; or give two points, as in 8,2,0:0,3,0", names.join(", "));
        Error::Setting { name: "--camera", value: wanted.to_owned(), expected }
    })
}

/// From `x,y,z:x,y,z` a view from the first point to the second with 50 degrees from top to bottom.
fn place_camera(words: &str) -> Option<View> {
    let point = |words: &str| -> Option<DVec3> {
        let numbers: Vec<f64> = words.split(',').map(|n| n.trim().parse().ok()).collect::<Option<_>>()?;
        <[f64; 3]>::try_from(numbers).ok().map(DVec3::from).filter(|p| p.is_finite())
    };
    let (from, to) = words.split_once(':')?;
    let (from, to) = (point(from)?, point(to)?);
    let back = (from - to).try_normalize()?;
    // Straight up and down there is no horizon: the top of the picture is north.
    let right = DVec3::Y.cross(back).try_normalize().unwrap_or(DVec3::X);
    let axes = DMat3::from_cols(right, back.cross(right), back);
    Some(View { position: from, rotation: DQuat::from_mat3(&axes), yfov: 50f64.to_radians() })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_placed_camera_looks_from_the_first_point_to_the_second_with_up_above() {
        for words in ["8,2,0:0,3,0", "-1,-2,-3:4,5,6", "0,0,0:0,9,0", "0,5,0:0,-5,0", "1e7,0,0:1e7,0,1"] {
            let view = place_camera(words).unwrap();
            let points: Vec<f64> = words.split([',', ':']).map(|n| n.parse().unwrap()).collect();
            let (from, to) = (DVec3::from_slice(&points), DVec3::from_slice(&points[3..]));
            let ahead = view.rotation * DVec3::NEG_Z;
            // A quaternion from a matrix and a rotated vector: a few dozen roundings of numbers up to 1.
            assert!((ahead - (to - from).normalize()).length() < 32.0 * f64::EPSILON, "{words}: {ahead}");
            assert!((view.rotation * DVec3::Y).y >= -32.0 * f64::EPSILON, "{words} is upside down");
            assert_eq!(view.position, from);
        }
    }

    #[test]
    fn what_is_no_pair_of_points_places_nothing() {
        for words in ["", "main", "1,2,3", "1,2:3,4,5", "1,2,3:1,2,3", "1,2,nan:0,0,0", "1,2,3:4,5,6,7"] {
            assert!(place_camera(words).is_none(), "{words}");
        }
    }
}
