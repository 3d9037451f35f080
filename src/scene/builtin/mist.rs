//! Trees in the way of a low sun, in a layer of mist that drifts: in the spirit of paper 2's Figure 10.

use super::Parameter;
use super::shapes::{cube, empty, push_quad, sphere};
use super::stage::Stage;
use crate::scene::medium::{Medium, Mist, Region};
use crate::scene::{LocalTransform, Material, Scene};
use glam::{DQuat, DVec3, Vec3, Vec4};

/// Tenths of the usual density: 0 is clear air.
pub(super) const DENSITY: Parameter = Parameter { name: "density", min: 0, max: 100, default: 10 };

pub(super) fn build(density: u32) -> Scene {
    let mut stage = Stage::new("mist", Vec3::new(0.035, 0.05, 0.08));
    let earth = stage.material(matte("earth", Vec4::new(0.13, 0.12, 0.08, 1.0), 0.95));
    let bark = stage.material(matte("bark", Vec4::new(0.20, 0.13, 0.08, 1.0), 0.9));
    let leaf = stage.material(matte("leaf", Vec4::new(0.10, 0.15, 0.05, 1.0), 0.9));
    let stone = stage.material(matte("stone", Vec4::new(0.50, 0.47, 0.42, 1.0), 0.9));

    let mut ground = empty("ground");
    push_quad(&mut ground, DVec3::new(-40.0, 0.0, 40.0), DVec3::X * 80.0, DVec3::Z * -80.0, earth);
    let ground = stage.mesh(ground);
    stage.place("ground", ground);
    let [trunk, boulder] = [stage.mesh(cube("trunk", bark)), stage.mesh(sphere("boulder", 0.5, 32, 64, stone))];
    let crown = stage.mesh(sphere("crown", 0.5, 16, 32, leaf));
    for i in 0..11 {
        let n = f64::from(i);
        let foot = DVec3::new(-8.0 + 1.7 * n, 2.0, -5.0 - 1.6 * f64::from(i * 5 % 4));
        let width = 0.24 + 0.06 * f64::from(i * 7 % 3);
        place(&mut stage, trunk, &format!("trunk {i}"), foot, DVec3::new(width, 4.0, width), 0.4 * n);
        let (top, size) = (foot + DVec3::Y * 2.6, 1.9 + 0.3 * f64::from(i * 3 % 4));
        place(&mut stage, crown, &format!("crown {i}"), top, DVec3::new(size, 1.3 * size, size), 0.0);
    }
    place(&mut stage, boulder, "boulder", DVec3::new(-1.6, 0.35, -0.6), DVec3::new(1.5, 1.0, 1.2), 0.3);
    place(&mut stage, boulder, "small boulder", DVec3::new(1.5, 0.2, 0.4), DVec3::new(0.8, 0.6, 0.7), 1.1);
    // From behind the trees and from the right.
    stage.sun(DVec3::new(-0.62, -0.8, 0.75), Vec3::new(1.0, 0.78, 0.5), 14.0);
    stage.camera(DVec3::new(0.2, 1.7, 6.5), DVec3::new(-0.3, 2.0, -2.0), 0.8);
    let mut scene = stage.finish();
    scene.medium = (density > 0).then(|| layer(density as f32 / 10.0));
    scene
}

fn layer(density: f32) -> Medium {
    let box_of = Mist {
        low: DVec3::new(-22.0, -6.0, -24.0),
        high: DVec3::new(22.0, 6.0, 12.0),
        amplitude: 1.5,
        size: 7.0,
        drift: DVec3::new(0.35, 0.0, 0.1),
    };
    let [scattering, absorption] = [0.055, 0.002].map(|part| Vec3::splat(part * density));
    Medium { scattering, absorption, anisotropy: 0.5, region: Region::Mist(box_of) }
}

fn matte(name: &str, base_color: Vec4, roughness: f32) -> Material {
    Material { name: name.to_owned(), base_color, metallic: 0.0, roughness, ..Material::default() }
}

fn place(stage: &mut Stage, mesh: usize, name: &str, centre: DVec3, scale: DVec3, turn: f64) {
    let local = LocalTransform::Trs { translation: centre, rotation: DQuat::from_rotation_y(turn), scale };
    let node = stage.node(name, None, local);
    stage.instance(node, mesh);
}
