//! What a scene gets that says nothing about it: a material, a camera, a light.

use std::f32::consts::PI;

use glam::{DMat3, DQuat, DVec3, Vec3};

use crate::scene::{
    Camera, Environment, Lens, Light, LightKind, LightShape, LocalTransform, Material, Node, Scene, View,
};

/// Vertical field of view of the framing camera, in radians.
const YFOV: f64 = std::f64::consts::FRAC_PI_4;
/// Where the framing camera is, seen from the scene: azimuth from +Z towards +X and elevation, in radians. It shows
/// the front (glTF's models face +Z), a side and the top.
const AZIMUTH: f64 = 35.0 * std::f64::consts::PI / 180.0;
const ELEVATION: f64 = 20.0 * std::f64::consts::PI / 180.0;
/// How much farther away the framing camera is than it has to be.
const MARGIN: f64 = 1.05;
/// Moments of an animation that the framing camera takes into account.
const MOMENTS: u32 = 16;
/// Where the default light shines, in the space of the first camera: from over its right shoulder.
const LIGHT: DVec3 = DVec3::new(-0.5, -0.8, -1.0);
/// Names of that light and of its node.
const DEFAULT: &str = "default";
const DEFAULT_NODE: &str = "default light";
/// Lux. A white Lambert surface that faces the light has a radiance of `intensity / π` = 1.
const INTENSITY: f32 = PI;
/// The soft grey from all around that goes with the default light.
const AMBIENT: f32 = 0.4;

impl Scene {
    /// Adds what the renderer needs and the scene lacks. Called at the end of loading; the built-in
    /// scenes may call it, too. Doing it twice changes nothing.
    ///
    /// - No material: the default one of glTF.
    /// - No camera: one named `framed`, with a vertical field of view of 45°, that sees the whole bounding box, of an
    ///   animated scene that of all moments, in any image at least as wide as high, from the front, 35° to the right and 20°
    ///   above.
    /// - No light of its own (neither a punctual light of positive intensity nor an environment; emissive surfaces do
    ///   not count, because what they light is not traced by all methods): a white directional light of π lux over
    ///   the first camera's right shoulder, under which a white diffuse surface that faces it has a radiance of 1,
    ///   and a grey environment of radiance 0.4. A scene with lights of its own keeps a black environment.
    pub fn complete(&mut self) {
        if self.materials.is_empty() {
            self.materials.push(Material::default());
        }
        if self.cameras.is_empty() {
            let view = self.framing_view();
            let node = self.add_root("framed", view.position, view.rotation);
            self.cameras.push(Camera {
                name: "framed".to_owned(),
                node,
                yfov: view.yfov,
                lens: view.lens,
                shutter: view.shutter,
            });
        }
        let shines = |light: &Light| light.intensity > 0.0 && light.color.max_element() > 0.0;
        let from_afar = self.environment.radiance != Vec3::ZERO || self.environment_map.is_some();
        if !self.lights.iter().any(shines) && !from_afar {
            self.add_default_light();
            self.environment = Environment { radiance: Vec3::splat(AMBIENT) };
        }
    }

    fn framing_view(&self) -> View {
        let (low, high) = self.bounds_over_time().unwrap_or((DVec3::NEG_ONE, DVec3::ONE));
        let (center, half) = (low.midpoint(high), (high - low) / 2.0);
        let (sin, cos) = ELEVATION.sin_cos();
        let back = DVec3::new(AZIMUTH.sin() * cos, sin, AZIMUTH.cos() * cos);
        let rotation = looking_along(-back);
        let slope = (YFOV / 2.0).tan();
        // The least distance from the center at which a corner is within the square picture.
        let distance = |signs: u32| {
            let sign = |axis: u32| if signs >> axis & 1 == 0 { 1.0 } else { -1.0 };
            let seen = rotation.inverse() * (half * DVec3::new(sign(0), sign(1), sign(2)));
            seen.x.abs().max(seen.y.abs()) / slope + seen.z
        };
        let distance = (0..8).map(distance).fold(0.0, f64::max) * MARGIN;
        let distance = if distance > 0.0 { distance } else { 1.0 }; // a single point is seen from some distance
        View { position: center + back * distance, rotation, yfov: YFOV, lens: Lens::PINHOLE, shutter: 0.0 }
    }

    /// Takes back the light that [`complete`](Self::complete) stood in, for who brings light of their own.
    pub fn drop_default_light(&mut self) {
        let nodes = &self.nodes;
        self.lights.retain(|light| light.name != DEFAULT || nodes[light.node].name != DEFAULT_NODE);
    }

    /// The box around all that some moments of the animations, if there are any, have in them.
    fn bounds_over_time(&self) -> Option<(DVec3, DVec3)> {
        let moments = if self.animations.is_empty() { 1 } else { MOMENTS };
        let times = (0..moments).map(|i| self.duration() * f64::from(i) / f64::from(moments));
        let boxes = times.filter_map(|time| self.bounds(&self.pose(time)));
        boxes.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    fn add_default_light(&mut self) {
        let view = self.pose(0.0).cameras[0];
        let rotation = looking_along(view.rotation * LIGHT.normalize());
        let node = self.add_root(DEFAULT_NODE, view.position, rotation);
        self.lights.push(Light {
            name: DEFAULT.to_owned(),
            node,
            kind: LightKind::Directional,
            color: Vec3::ONE,
            intensity: INTENSITY,
            range: None,
            shape: LightShape::Sharp,
        });
    }

    fn add_root(&mut self, name: &str, translation: DVec3, rotation: DQuat) -> usize {
        let local = LocalTransform::Trs { translation, rotation, scale: DVec3::ONE };
        self.nodes.push(Node { name: name.to_owned(), parent: None, local });
        self.nodes.len() - 1
    }
}

/// Turns -Z into a unit direction and keeps +Y up as far as that goes.
fn looking_along(direction: DVec3) -> DQuat {
    let right = direction.cross(DVec3::Y).try_normalize().unwrap_or(DVec3::X);
    DQuat::from_mat3(&DMat3::from_cols(right, right.cross(direction), -direction))
}
