//! The Cornell box: the measured room of 1998 with its two blocks (one cube, placed twice with unequal scales) and a
//! point light in place of the luminaire. Nothing in it is random.

use super::shapes::{cube, empty, push_quad};
use super::stage::Stage;
use crate::scene::{LocalTransform, Material, Mesh, Scene};
use glam::{DQuat, DVec3, Vec3, Vec4};

/// Half the room's width, its height and half its depth, in metres at a scale of 1:100 millimetres.
const HALF_WIDTH: f64 = 2.764;
const HEIGHT: f64 = 5.488;
const HALF_DEPTH: f64 = 2.796;

pub(super) fn build() -> Scene {
    let mut stage = Stage::new("cornell", Vec3::splat(0.04));
    let white = stage.material(matte("white", Vec4::new(0.73, 0.73, 0.73, 1.0)));
    let red = stage.material(matte("red", Vec4::new(0.63, 0.065, 0.05, 1.0)));
    let green = stage.material(matte("green", Vec4::new(0.14, 0.45, 0.091, 1.0)));
    let lamp = Material { emissive: Vec3::new(4.0, 3.5, 2.7), ..matte("lamp", Vec4::new(0.78, 0.78, 0.78, 1.0)) };
    let lamp = stage.material(lamp);

    let room = stage.mesh(room([white, red, green, lamp]));
    stage.place("room", room);
    let block = stage.mesh(cube("block", white));
    place_block(&mut stage, block, "short block", DVec3::new(0.92, 0.825, 1.10), 1.65, -0.297);
    place_block(&mut stage, block, "tall block", DVec3::new(-0.905, 1.65, -0.71), 3.30, 0.297);

    stage.point_light(DVec3::new(0.0, HEIGHT - 0.9, 0.0), Vec3::new(1.0, 0.9, 0.75), 30.0);
    stage.camera(DVec3::new(0.0, 2.73, HALF_DEPTH + 8.0), DVec3::new(0.0, 2.73, 0.0), 0.686);
    stage.finish()
}

/// Double-sided, so that a camera that leaves the room sees the walls that its light meets.
fn matte(name: &str, base_color: Vec4) -> Material {
    let name = name.to_owned();
    Material { name, base_color, metallic: 0.0, roughness: 1.0, double_sided: true, ..Material::default() }
}

/// Floor, ceiling, three walls and the luminaire, normals to the inside.
fn room([white, red, green, lamp]: [u32; 4]) -> Mesh {
    let (w, h, d) = (HALF_WIDTH, HEIGHT, HALF_DEPTH);
    let (x, y, z) = (DVec3::X * 2.0 * w, DVec3::Y * h, DVec3::Z * 2.0 * d);
    let mut mesh = empty("room");
    push_quad(&mut mesh, DVec3::new(-w, 0.0, d), x, -z, white);
    push_quad(&mut mesh, DVec3::new(-w, h, -d), x, z, white);
    push_quad(&mut mesh, DVec3::new(-w, 0.0, -d), x, y, white);
    push_quad(&mut mesh, DVec3::new(-w, 0.0, d), -z, y, red);
    push_quad(&mut mesh, DVec3::new(w, 0.0, -d), z, y, green);
    push_quad(&mut mesh, DVec3::new(-0.65, h - 0.005, -0.525), DVec3::X * 1.3, DVec3::Z * 1.05, lamp);
    mesh
}

fn place_block(stage: &mut Stage, mesh: usize, name: &str, centre: DVec3, height: f64, turn: f64) {
    let scale = DVec3::new(1.65, height, 1.65);
    let local = LocalTransform::Trs { translation: centre, rotation: DQuat::from_rotation_y(turn), scale };
    let node = stage.node(name, None, local);
    stage.instance(node, mesh);
}
