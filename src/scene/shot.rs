//! A camera in a scene, and how it moves: what turns a time into a pose and a view.

use super::motion::Motion;
use super::{Lens, Pose, Scene, View};
use crate::{Error, Result};
use glam::{DMat3, DQuat, DVec3};

/// A camera in a scene that moves.
#[derive(Debug, Clone)]
pub struct Shot {
    camera: Camera,
    motion: Motion,
    /// Centre of the scene in metres, about which orbits turn.
    focus: DVec3,
    /// Distance in metres from there that nothing exceeds.
    radius: f64,
}

/// Where the scene is seen from before the camera moves.
#[derive(Debug, Clone)]
enum Camera {
    /// One of the scene's.
    OfScene(usize, String),
    /// The user's, in their words.
    Placed(String, View),
}

impl Shot {
    /// Looks through the scene's camera called `camera` (or of that number), or from one point to another in metres
    /// (`8,2,0:0,3,0`, 50 degrees from top to bottom); without a wish through the scene's first.
    ///
    /// # Errors
    /// [`Error::Setting`] with the scene's cameras.
    pub fn new(scene: &Scene, camera: Option<&str>, motion: Motion) -> Result<Self> {
        let (focus, radius) = sphere(scene);
        Ok(Self { camera: find_camera(scene, camera)?, motion, focus, radius })
    }

    /// The same camera, moving otherwise.
    pub fn with_motion(&self, motion: Motion) -> Self {
        Self { motion, ..self.clone() }
    }

    /// The same camera with another lens, if it is one that was placed by two points; those of the scene have their own.
    pub fn with_lens(self, lens: Lens) -> Self {
        let camera = match self.camera {
            Camera::Placed(words, view) => Camera::Placed(words, View { lens, ..view }),
            of_scene => of_scene,
        };
        Self { camera, ..self }
    }

    /// The same with another shutter, likewise.
    pub fn with_shutter(self, shutter: f64) -> Self {
        let camera = match self.camera {
            Camera::Placed(words, view) => Camera::Placed(words, View { shutter, ..view }),
            of_scene => of_scene,
        };
        Self { camera, ..self }
    }

    /// Where everything of the scene is and where it is seen from after `seconds`.
    pub fn at(&self, scene: &Scene, seconds: f64) -> (Pose, View) {
        let pose = scene.pose(seconds);
        let base = match &self.camera {
            Camera::OfScene(index, _) => pose.cameras[*index],
            Camera::Placed(_, view) => *view,
        };
        let view = self.motion.view(&base, self.focus, self.radius, seconds);
        (pose, view)
    }

    /// Name of the camera.
    pub fn camera(&self) -> &str {
        match &self.camera {
            Camera::OfScene(_, name) | Camera::Placed(name, _) => name,
        }
    }

    /// How the camera moves.
    pub fn motion(&self) -> Motion {
        self.motion
    }
}

/// The scene's by name, or else by number, or else one that is placed by two points; without a wish the scene's first.
fn find_camera(scene: &Scene, wanted: Option<&str>) -> Result<Camera> {
    let of_scene = |index: usize| scene.cameras.get(index).map(|c| Camera::OfScene(index, c.name.clone()));
    let placed = |words: &str| place_camera(words).map(|view| Camera::Placed(words.to_owned(), view));
    let found = match wanted {
        None => of_scene(0),
        Some(words) => {
            let named = scene.cameras.iter().position(|c| c.name == words);
            named.or_else(|| words.parse().ok()).and_then(of_scene).or_else(|| placed(words))
        }
    };
    found.ok_or_else(|| {
        let names: Vec<String> = scene.cameras.iter().map(|c| format!("'{}'", c.name)).collect();
        let expected = format!("the scene has the cameras {}; or give two points, as in 8,2,0:0,3,0", names.join(", "));
        Error::Setting { name: "--camera", value: wanted.unwrap_or_default().to_owned(), expected }
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
    Some(View {
        position: from,
        rotation: DQuat::from_mat3(&axes),
        yfov: 50f64.to_radians(),
        lens: Lens::PINHOLE,
        shutter: 0.0,
    })
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
