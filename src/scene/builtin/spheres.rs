//! Metal and plastic balls over a checkered floor. A ring of small ones, all instances of one mesh, turns around them,
//! and one of the large ones bounces.

use super::Parameter;
use super::random::Random;
use super::shapes::{empty, push_quad, sphere};
use super::stage::{Stage, at};
use crate::scene::{
    Animation, Channel, ChannelValues, Image, Interpolation, LocalTransform, Material, Scene, TextureRef, Wrap,
};
use glam::{Affine2, DQuat, DVec3, Vec2, Vec3, Vec4};
use std::f64::consts::TAU;

/// Small balls in the ring.
pub(super) const BEADS: Parameter = Parameter { name: "beads", min: 0, max: 4_096, default: 36 };

const COLUMNS: u32 = 5;
const RADIUS: f64 = 0.45;
const BEAD_RADIUS: f64 = 0.12;
/// Seconds after which everything is where it started: one turn of the ring, 24 bounces.
const PERIOD: f64 = 24.0;

pub(super) fn build(beads: u32, seed: u32) -> Scene {
    let mut stage = Stage::new("spheres", Vec3::new(0.42, 0.50, 0.62));
    floor(&mut stage);
    let mut random = Random::new(seed, 0);
    let places = (0..2).flat_map(|row| (0..COLUMNS).map(move |column| (row, column)));
    let balls: Vec<usize> = places.map(|(row, column)| ball(&mut stage, &mut random, row, column)).collect();
    // The middle of the front row.
    let mut channels = Vec::from_iter(bounce(&stage, balls[7]));
    if beads > 0 {
        channels.push(ring(&mut stage, &mut random, beads));
    }
    stage.animation(Animation { name: "turn and bounce".to_owned(), channels });
    stage.point_light(DVec3::new(-3.5, 6.0, 4.0), Vec3::new(1.0, 0.95, 0.88), 240.0);
    stage.camera(DVec3::new(0.0, 4.4, 8.8), DVec3::new(0.0, 0.25, 0.0), 0.80);
    stage.finish()
}

/// 12 by 12 metres, checks of half a metre: one image of 2x2 texels, tiled.
fn floor(stage: &mut Stage) {
    let (dark, light) = ([70, 74, 82, 255], [205, 203, 196, 255]);
    let image = Image { name: "checks".to_owned(), width: 2, height: 2, texels: vec![dark, light, light, dark] };
    let checks = stage.texture(image, Wrap::Repeat, true);
    let checks = TextureRef { transform: Affine2::from_scale(Vec2::splat(12.0)), ..checks };
    let material = stage.material(Material {
        name: "floor".to_owned(),
        base_color_texture: Some(checks),
        metallic: 0.0,
        roughness: 0.6,
        double_sided: true,
        ..Material::default()
    });
    let mut mesh = empty("floor");
    push_quad(&mut mesh, DVec3::new(-6.0, 0.0, 6.0), DVec3::X * 12.0, DVec3::Z * -12.0, material);
    let mesh = stage.mesh(mesh);
    stage.place("floor", mesh);
}

/// Metals behind, plastics in front, rougher to the right. Returns the ball's node.
fn ball(stage: &mut Stage, random: &mut Random, row: u32, column: u32) -> usize {
    let metal = row == 0;
    let color = random.color(if metal { 0.55 } else { 0.08 }, if metal { 0.98 } else { 0.80 }).as_vec3();
    let name = format!("{} {column}", if metal { "metal" } else { "plastic" });
    let material = stage.material(Material {
        name: name.clone(),
        base_color: color.extend(1.0),
        metallic: if metal { 1.0 } else { 0.0 },
        roughness: 0.06 + 0.94 * column as f32 / (COLUMNS - 1) as f32,
        ..Material::default()
    });
    let mesh = stage.mesh(sphere(&name, RADIUS, 32, 64, material));
    let position = DVec3::new((f64::from(column) - 2.0) * 1.15, RADIUS, f64::from(row) * 1.8 - 0.9);
    let node = stage.node(&name, None, at(position));
    stage.instance(node, mesh);
    node
}

fn bounce(stage: &Stage, node: usize) -> Option<Channel> {
    let LocalTransform::Trs { translation: rest, .. } = stage.local(node) else { return None };
    // A parabola a half: no speed at the top, equal and opposite speeds at the floor.
    let (up, still, top) = (DVec3::Y * 4.8, DVec3::ZERO, rest + DVec3::Y * 1.2);
    let halves = 2 * PERIOD as usize;
    let times = (0..=halves).map(|i| i as f64 * 0.5).collect();
    let keys = (0..=halves).flat_map(|i| if i % 2 == 0 { [-up, rest, up] } else { [still, top, still] });
    let values = ChannelValues::Translation(keys.collect());
    Some(Channel { node, times, interpolation: Interpolation::CubicSpline, values })
}

/// The ring turns as a whole: its beads are children of one animated node.
fn ring(stage: &mut Stage, random: &mut Random, beads: u32) -> Channel {
    let material = stage.material(Material {
        name: "bead".to_owned(),
        base_color: Vec4::new(1.0, 0.72, 0.25, 1.0),
        metallic: 1.0,
        roughness: 0.25,
        ..Material::default()
    });
    let bead = stage.mesh(sphere("bead", BEAD_RADIUS, 16, 32, material));
    let hub = stage.node("ring", None, LocalTransform::default());
    for i in 0..beads {
        let angle = f64::from(i) / f64::from(beads) * TAU;
        let distance = 3.6 + random.range(-0.15, 0.15);
        let height = BEAD_RADIUS + 0.5 + 0.35 * (3.0 * angle).sin();
        let position = DVec3::new(distance * angle.cos(), height, distance * angle.sin());
        let node = stage.node(&format!("bead {i}"), Some(hub), at(position));
        stage.instance(node, bead);
    }
    let quarters = (0..=4).map(f64::from);
    let times = quarters.clone().map(|q| q * PERIOD / 4.0).collect();
    let values = ChannelValues::Rotation(quarters.map(|q| DQuat::from_rotation_y(q * TAU / 4.0)).collect());
    Channel { node: hub, times, interpolation: Interpolation::Linear, values }
}
