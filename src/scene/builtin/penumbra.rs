//! Soft shadows: posts, a ball and a plate over a floor under one square luminaire. The shadow of a post is sharp at its foot
//! and blurs with the distance to what casts it. Shining balls may take the luminaire's place: lights that are meshes.

use super::Parameter;
use super::shapes::{cube, empty, push_quad, sphere};
use super::stage::Stage;
use crate::scene::{LightShape, LocalTransform, Material, Scene};
use glam::{DQuat, DVec3, Vec3, Vec4};

/// Side of the luminaire in centimetres, 0 casts sharp shadows; and how many balls shine in its place.
pub(super) const PARAMETERS: [Parameter; 2] = [
    Parameter { name: "light", min: 0, max: 800, default: 120 },
    Parameter { name: "lamps", min: 0, max: 3, default: 0 },
];

/// Where the balls that shine lie on the floor, their radii, and what they emit.
const LAMPS: [(DVec3, f64, Vec3); 3] = [
    (DVec3::new(-2.6, 0.3, 0.9), 0.3, Vec3::new(30.0, 13.0, 4.0)),
    (DVec3::new(2.7, 0.22, -1.6), 0.22, Vec3::new(6.0, 18.0, 40.0)),
    (DVec3::new(0.5, 0.16, 2.0), 0.16, Vec3::new(34.0, 8.0, 22.0)),
];

/// Of [`PARAMETERS`].
pub(super) fn build(parameters: &[u32]) -> Scene {
    let (light, lamps) = (parameters[0], parameters[1]);
    let mut stage = Stage::new("penumbra", Vec3::splat(if lamps == 0 { 0.1 } else { 0.02 }));
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

    for (i, (centre, radius, emissive)) in LAMPS.into_iter().enumerate().take(lamps as usize) {
        let name = format!("lamp {i}");
        let shines = stage.material(Material { emissive, ..matte(&name, Vec4::new(0.0, 0.0, 0.0, 1.0), 1.0) });
        let lamp = stage.mesh(sphere(&name, radius, 12, 24, shines));
        place(&mut stage, lamp, &name, centre, DVec3::ONE, 0.0);
    }
    if lamps == 0 {
        let side = light as f32 / 100.0;
        let shape = if light == 0 { LightShape::Sharp } else { LightShape::Rectangle([side, side]) };
        let above = DVec3::new(-2.0, 4.5, 2.5);
        stage.area_light(above, DVec3::new(0.3, 0.0, -0.2) - above, Vec3::new(1.0, 0.95, 0.88), 110.0, shape);
    }
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
