//! Soft shadows: posts, a ball and a plate over a floor under one square luminaire. The shadow of a post is sharp at its foot
//! and blurs with the distance to what casts it.

use super::Parameter;
use super::shapes::{cube, empty, push_quad, sphere};
use super::stage::Stage;
use crate::scene::{LightShape, LocalTransform, Material, Scene};
use glam::{DQuat, DVec3, Vec3, Vec4};

/// Side of the luminaire in centimetres: 0 casts sharp shadows.
pub(super) const LIGHT: Parameter = Parameter { name: "light", min: 0, max: 800, default: 120 };

pub(super) fn build(light: u32) -> Scene {
    let mut stage = Stage::new("penumbra", Vec3::splat(0.1));
    let floor = stage.material(matte("floor", Vec4::new(0.75, 0.74, 0.72, 1.0), 0.9));
    let paint = stage.material(matte("paint", Vec4::new(0.62, 0.16, 0.10, 1.0), 0.5));
    let chalk = stage.material(matte("chalk", Vec4::new(0.80, 0.80, 0.78, 1.0), 0.8));
    let glaze = stage.material(matte("glaze", Vec4::new(0.12, 0.30, 0.45, 1.0), 0.25));

    let mut ground = empty("ground");
    push_quad(&mut ground, DVec3::new(-12.0, 0.0, 12.0), DVec3::X * 24.0, DVec3::Z * -24.0, floor);
    let ground = stage.mesh(ground);
    stage.place("ground", ground);
    let post = stage.mesh(cube("post", paint));
    for i in 0..5 {
        let height = 0.8 + 0.45 * f64::from(i);
        let foot = DVec3::new(-2.4 + 0.9 * f64::from(i), 0.5 * height, -1.2);
        place(&mut stage, post, &format!("post {i}"), foot, DVec3::new(0.12, height, 0.12), 0.0);
    }
    let plate = stage.mesh(cube("plate", chalk));
    place(&mut stage, plate, "plate", DVec3::new(1.5, 1.1, 0.7), DVec3::new(1.1, 0.04, 0.8), 0.4);
    let ball = stage.mesh(sphere("ball", 0.45, 48, 96, glaze));
    place(&mut stage, ball, "ball", DVec3::new(-0.9, 0.45, 0.7), DVec3::ONE, 0.0);

    let side = light as f32 / 100.0;
    let shape = if light == 0 { LightShape::Sharp } else { LightShape::Rectangle([side, side]) };
    let above = DVec3::new(-2.0, 4.5, 2.5);
    stage.area_light(above, DVec3::new(0.3, 0.0, -0.2) - above, Vec3::new(1.0, 0.95, 0.88), 110.0, shape);
    stage.camera(DVec3::new(0.6, 2.6, 5.6), DVec3::new(0.0, 0.55, 0.0), 0.75);
    stage.finish()
}

fn matte(name: &str, base_color: Vec4, roughness: f32) -> Material {
    Material { name: name.to_owned(), base_color, metallic: 0.0, roughness, ..Material::default() }
}

fn place(stage: &mut Stage, mesh: usize, name: &str, centre: DVec3, scale: DVec3, turn: f64) {
    let local = LocalTransform::Trs { translation: centre, rotation: DQuat::from_rotation_y(turn), scale };
    let node = stage.node(name, None, local);
    stage.instance(node, mesh);
}
