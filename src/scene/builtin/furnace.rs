//! The white furnace: balls that reflect all light, in light of radiance 1 from everywhere. A renderer that neither makes light
//! nor loses any shows nothing at all: every pixel is 1, whatever the roughness. `?albedo=N` has balls of N per cent, which show.

use super::Parameter;
use super::shapes::sphere;
use super::stage::{Stage, at};
use crate::scene::{Material, Scene};
use glam::{DVec3, Vec3};

/// Base colour of the balls in per cent.
pub(super) const ALBEDO: Parameter = Parameter { name: "albedo", min: 0, max: 100, default: 100 };

const ROUGHNESS: [f32; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

pub(super) fn build(albedo: u32) -> Scene {
    let mut stage = Stage::new("furnace", Vec3::ONE);
    for (row, metallic) in [(0, 0.0), (1, 1.0)] {
        for (column, roughness) in ROUGHNESS.into_iter().enumerate() {
            let kind = if metallic > 0.0 { "metal" } else { "plastic" };
            let name = format!("{kind} of roughness {roughness}");
            let base_color = Vec3::splat(albedo as f32 / 100.0).extend(1.0);
            let material =
                stage.material(Material { name: name.clone(), base_color, metallic, roughness, ..Material::default() });
            let ball = stage.mesh(sphere(&name, 0.48, 32, 64, material));
            let node = stage.node(&name, None, at(DVec3::new(column as f64 - 2.0, 0.55 - 1.1 * f64::from(row), 0.0)));
            stage.instance(node, ball);
        }
    }
    stage.camera(DVec3::new(0.0, 0.4, 6.0), DVec3::ZERO, 0.5);
    stage.finish()
}
