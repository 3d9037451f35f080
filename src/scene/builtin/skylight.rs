//! A yard under daylight: blocks, posts and balls on level ground, lit by the sky all around and by the sun.

use super::Parameter;
use super::shapes::{cube, empty, push_quad, sphere};
use super::stage::Stage;
use crate::Result;
use crate::scene::sky::Sky;
use crate::scene::{LocalTransform, Material, Scene};
use glam::{DQuat, DVec3, Vec3, Vec4};

/// Haze in tenths, the sun's azimuth and elevation in degrees, and thousandths of a centimetre of nitrogen dioxide.
pub(super) const PARAMETERS: [Parameter; 4] = [
    Parameter { name: "turbidity", min: 17, max: 100, default: 30 },
    Parameter { name: "azimuth", min: 0, max: 359, default: 120 },
    Parameter { name: "elevation", min: 0, max: 90, default: 35 },
    Parameter { name: "pollution", min: 0, max: 100, default: 0 },
];
/// Of the ground, to the horizon.
const ALBEDO: f32 = 0.25;

pub(super) fn build(values: &[u32]) -> Result<Scene> {
    let mut stage = Stage::new("skylight", Vec3::ZERO);
    let paved = stage.material(matte("paved", Vec3::splat(ALBEDO), 0.9));
    let plaster = stage.material(matte("plaster", Vec3::new(0.78, 0.74, 0.66), 0.9));
    let brick = stage.material(matte("brick", Vec3::new(0.50, 0.20, 0.13), 0.8));
    let paint = stage.material(matte("paint", Vec3::new(0.12, 0.30, 0.20), 0.4));
    let glaze = stage.material(matte("glaze", Vec3::new(0.10, 0.26, 0.42), 0.3));

    let mut ground = empty("ground");
    push_quad(&mut ground, DVec3::new(-400.0, 0.0, 400.0), DVec3::X * 800.0, DVec3::Z * -800.0, paved);
    let ground = stage.mesh(ground);
    stage.place("ground", ground);
    let [house, wall, post] =
        [("house", plaster), ("wall", brick), ("post", paint)].map(|(n, m)| stage.mesh(cube(n, m)));
    place(&mut stage, house, "house", DVec3::new(-2.6, 1.3, -3.2), DVec3::new(2.8, 2.6, 2.2), 0.75);
    place(&mut stage, wall, "wall", DVec3::new(2.4, 0.6, -2.6), DVec3::new(3.4, 1.2, 0.25), -0.3);
    for i in 0..5 {
        let foot = DVec3::new(-0.2 + 0.7 * f64::from(i), 0.55, -0.6 - 0.1 * f64::from(i));
        place(&mut stage, post, &format!("post {i}"), foot, DVec3::new(0.1, 1.1, 0.1), 0.0);
    }
    let [plaster_ball, glazed_ball] =
        [plaster, glaze].map(|material| stage.mesh(sphere("ball", 0.5, 48, 96, material)));
    place(&mut stage, plaster_ball, "plaster ball", DVec3::new(-0.7, 0.5, 0.9), DVec3::ONE, 0.0);
    place(&mut stage, glazed_ball, "glazed ball", DVec3::new(0.7, 0.5, 1.1), DVec3::ONE, 0.0);
    stage.camera(DVec3::new(1.0, 1.6, 6.2), DVec3::new(-0.1, 1.15, 0.0), 0.85);

    let number = |i: usize| f64::from(values[i]);
    let sky = Sky {
        turbidity: number(0) / 10.0,
        azimuth: number(1).to_radians(),
        elevation: number(2).to_radians(),
        pollution: number(3) / 1000.0,
        ground: f64::from(ALBEDO),
    };
    let mut scene = stage.finish();
    sky.apply(&mut scene, 1.0)?;
    Ok(scene)
}

fn matte(name: &str, color: Vec3, roughness: f32) -> Material {
    let base_color: Vec4 = color.extend(1.0);
    Material { name: name.to_owned(), base_color, metallic: 0.0, roughness, ..Material::default() }
}

fn place(stage: &mut Stage, mesh: usize, name: &str, centre: DVec3, scale: DVec3, turn: f64) {
    let local = LocalTransform::Trs { translation: centre, rotation: DQuat::from_rotation_y(turn), scale };
    let node = stage.node(name, None, local);
    stage.instance(node, mesh);
}
