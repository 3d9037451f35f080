//! A pool table just after the break, in the spirit of figure 1 of "Interactive Distribution Ray Tracing": what rolls is
//! blurred by its motion, and so are stripes by their turning; shadows are soft, and far balls a little out of focus.

use super::Parameter;
use super::random::Random;
use super::shapes::{cube, empty, push_quad, sphere};
use super::stage::{Stage, at};
use crate::scene::{
    Animation, Channel, ChannelValues, Image, Interpolation, Lens, LightShape, LocalTransform, Material, Scene, Wrap,
};
use glam::{DQuat, DVec2, DVec3, Vec3, Vec4};
use std::f64::consts::{PI, TAU};

/// Rings of a ball, which has 2 (rings + 4) (rings - 1) triangles: at 21, sixteen of them have the paper's 16,000.
pub(super) const RINGS: Parameter = Parameter { name: "rings", min: 4, max: 256, default: 21 };

/// Metres, as the lengths below.
const RADIUS: f64 = 0.028_575;
/// Half the cloth's length and width between the cushions.
const BED: DVec2 = DVec2::new(0.86, 0.46);
/// Seconds after which everything is where it started, having rolled there and back: at 60 frames a second the cue ball goes two
/// thirds of its radius a frame, and turns by as many radians.
const PERIOD: f64 = 0.8;
/// Keys of a rotation from one end to the other: less than half a turn between two of them.
const KEYS: u32 = 12;

/// The paints of the balls from 1 to 8; 9 to 15 are striped with the first seven.
const PAINTS: [[u8; 3]; 8] = [
    [236, 178, 22],
    [20, 48, 140],
    [190, 24, 26],
    [74, 28, 104],
    [224, 92, 18],
    [14, 92, 52],
    [112, 20, 30],
    [16, 16, 18],
];

pub(super) fn build(rings: u32, seed: u32) -> Scene {
    let mut stage = Stage::new("billiards", Vec3::new(0.08, 0.085, 0.10));
    table(&mut stage, seed);
    let mut random = Random::new(seed, 1);
    let mut channels = Vec::new();
    for (number, place) in (1..=15).zip(places()) {
        let ball = ball(&mut stage, rings, number);
        let turn = random.rotation();
        channels.extend(put(&mut stage, (ball, &format!("ball {number}")), place, turn));
    }
    let cue = ball(&mut stage, rings, 0);
    let stroke = Place { from: DVec2::new(0.05, 0.105), way: DVec2::new(0.44, 0.10) };
    channels.extend(put(&mut stage, (cue, "cue ball"), stroke, DQuat::IDENTITY));
    stage.animation(Animation { name: "break".to_owned(), channels });
    let lamp = DVec3::new(-0.05, 1.05, 0.05);
    let shape = LightShape::Rectangle([0.9, 0.4]);
    stage.area_light(lamp, DVec3::new(0.0, -1.0, -0.02), Vec3::new(1.0, 0.93, 0.82), 4.6, shape);
    let (eye, target) = (DVec3::new(0.36, 0.40, 0.74), DVec3::new(-0.04, 0.0, 0.01));
    stage.camera(eye, target, 0.53);
    let mut scene = stage.finish();
    scene.cameras[0].lens = Lens { aperture: 0.012, focus: (target - eye).length(), blades: 0 };
    scene.cameras[0].shutter = 1.0;
    scene
}

/// Where a ball is on the cloth, and how far it rolls from there; not at all if that is zero.
#[derive(Clone, Copy)]
struct Place {
    from: DVec2,
    way: DVec2,
}

/// Of the balls from 1 to 15: what the rack has lost rolls, the rest lies in its last three rows.
fn places() -> impl Iterator<Item = Place> {
    let still = |x: f64, y: f64| Place { from: DVec2::new(x, y), way: DVec2::ZERO };
    let rows = (2..5).flat_map(|row| (0..=row).map(move |i| (f64::from(row), f64::from(i))));
    // A hair apart, so that none are in each other.
    let pitch = 2.004 * RADIUS;
    let rack = rows.map(move |(row, i)| still(-0.14 - row * pitch * 0.75_f64.sqrt(), (i - 0.5 * row) * pitch));
    let rolling = [
        Place { from: DVec2::new(-0.10, 0.085), way: DVec2::new(0.20, 0.22) },
        Place { from: DVec2::new(-0.05, -0.09), way: DVec2::new(0.36, -0.16) },
        Place { from: DVec2::new(-0.16, -0.16), way: DVec2::new(-0.10, -0.22) },
    ];
    let [first, second, third] = rolling;
    // The striped ones among them show that they turn.
    let mut order: Vec<Place> = rack.collect();
    order.insert(0, first);
    order.insert(8, second);
    order.insert(10, third);
    order.into_iter()
}

/// Puts a ball on the cloth, turned somehow; with what makes it roll without slipping.
fn put(stage: &mut Stage, (mesh, name): (usize, &str), place: Place, turn: DQuat) -> Vec<Channel> {
    let on_cloth = |p: DVec2| DVec3::new(p.x, RADIUS, p.y);
    let from = on_cloth(place.from);
    let local = LocalTransform::Trs { translation: from, rotation: turn, scale: DVec3::ONE };
    let node = stage.node(name, None, local);
    stage.instance(node, mesh);
    let length = place.way.length();
    if length == 0.0 {
        return Vec::new();
    }
    let axis = DVec3::Y.cross(DVec3::new(place.way.x, 0.0, place.way.y)).normalize();
    let parts: Vec<f64> = (0..=2 * KEYS).map(|key| 1.0 - (f64::from(key) / f64::from(KEYS) - 1.0).abs()).collect();
    let times: Vec<f64> = (0..=2 * KEYS).map(|key| f64::from(key) * PERIOD / f64::from(2 * KEYS)).collect();
    let places = parts.iter().map(|part| on_cloth(place.from + place.way * *part)).collect();
    let turns = parts.iter().map(|part| DQuat::from_axis_angle(axis, part * length / RADIUS) * turn).collect();
    let channel = |values| Channel { node, times: times.clone(), interpolation: Interpolation::Linear, values };
    vec![channel(ChannelValues::Translation(places)), channel(ChannelValues::Rotation(turns))]
}

/// Number 0 is the cue ball.
fn ball(stage: &mut Stage, rings: u32, number: u32) -> usize {
    let name = format!("ball {number}");
    let paint = stage.texture(paint(&name, number), Wrap::Repeat, false);
    let material = stage.material(Material {
        name: name.clone(),
        base_color_texture: Some(paint),
        metallic: 0.0,
        roughness: 0.12,
        ..Material::default()
    });
    stage.mesh(sphere(&name, RADIUS, rings, rings + 4, material))
}

/// Latitude down, longitude across: all painted, or a stripe about the equator; with two white spots.
fn paint(name: &str, number: u32) -> Image {
    let (width, height) = (128, 64);
    let ivory = [236, 228, 206];
    let color = number.checked_sub(1).map_or(ivory, |n| PAINTS[n as usize % 8]);
    let texel = |x: u32, y: u32| {
        let (longitude, latitude) =
            ((f64::from(x) + 0.5) / f64::from(width) * TAU, (0.5 - (f64::from(y) + 0.5) / f64::from(height)) * PI);
        // The angle from the nearer of two opposite points of the equator.
        let off = (latitude.cos() * longitude.cos()).abs().min(1.0).acos();
        let painted = number <= 8 || latitude.abs() < 0.48;
        match number {
            0 => ivory,
            _ if off < 0.16 => [24, 22, 20],
            _ if off < 0.36 => ivory,
            _ if painted => color,
            _ => ivory,
        }
    };
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let texels = texels.map(|(x, y)| texel(x, y)).map(|[r, g, b]| [r, g, b, 255]).collect();
    Image { name: name.to_owned(), width, height, texels }
}

fn table(stage: &mut Stage, seed: u32) {
    let matte = |name: &str, color: Vec4, roughness: f32| Material {
        name: name.to_owned(),
        base_color: color,
        metallic: 0.0,
        roughness,
        ..Material::default()
    };
    let cloth = stage.material(matte("cloth", Vec4::new(0.02, 0.19, 0.11, 1.0), 0.95));
    let rubber = stage.material(matte("cushion", Vec4::new(0.015, 0.15, 0.085, 1.0), 0.9));
    let carpet = stage.material(matte("carpet", Vec4::new(0.10, 0.05, 0.045, 1.0), 1.0));
    let grain = stage.texture(wood(seed), Wrap::Mirror, false);
    let wood = stage.material(Material { base_color_texture: Some(grain), ..matte("polished wood", Vec4::ONE, 0.18) });
    let mut flat = empty("cloth");
    let (x, z) = (BED.x + 0.04, BED.y + 0.04);
    push_quad(&mut flat, DVec3::new(-x, 0.0, z), DVec3::X * (2.0 * x), DVec3::Z * (-2.0 * z), cloth);
    push_quad(&mut flat, DVec3::new(-6.0, -0.8, 6.0), DVec3::X * 12.0, DVec3::Z * -12.0, carpet);
    let flat = stage.mesh(flat);
    stage.place("cloth", flat);
    let (cushion, rail) = (stage.mesh(cube("cushion", rubber)), stage.mesh(cube("rail", wood)));
    for side in [-1.0, 1.0] {
        // A cushion a side, and a rail behind it that is a little higher.
        let (nose, height) = (0.05, 0.036);
        long(
            stage,
            cushion,
            DVec3::new(0.0, 0.5 * height, side * (BED.y + 0.5 * nose)),
            [2.0 * BED.x, height, nose],
            0.0,
        );
        let across = [2.0 * BED.y + 2.0 * nose, height, nose];
        long(stage, cushion, DVec3::new(side * (BED.x + 0.5 * nose), 0.5 * height, 0.0), across, PI / 2.0);
        let (width, height, low) = (0.11, 0.16, -0.118);
        let (x, z) = (BED.x + nose + 0.5 * width, BED.y + nose + 0.5 * width);
        long(stage, rail, DVec3::new(0.0, low + 0.5 * height, side * z), [2.0 * x + width, height, width], 0.0);
        long(stage, rail, DVec3::new(side * x, low + 0.5 * height, 0.0), [2.0 * z - width, height, width], PI / 2.0);
    }
}

fn long(stage: &mut Stage, mesh: usize, centre: DVec3, [length, height, width]: [f64; 3], turn: f64) {
    let LocalTransform::Trs { translation, .. } = at(centre) else { return };
    let (rotation, scale) = (DQuat::from_rotation_y(turn), DVec3::new(length, height, width));
    let node = stage.node("rail", None, LocalTransform::Trs { translation, rotation, scale });
    stage.instance(node, mesh);
}

/// Fibres along a board: noise that is much longer than wide.
fn wood(seed: u32) -> Image {
    let (width, height) = (64_u32, 128_u32);
    let random = &mut Random::new(seed, 2);
    let fibres: Vec<[f64; 3]> =
        (0..height).map(|_| [random.range(0.0, 1.0), random.range(0.0, TAU), random.range(0.5, 2.0)]).collect();
    let texel = |x: u32, y: u32| {
        let near = |offset: u32| {
            let [level, phase, waves] = fibres[((y + offset) % height) as usize];
            level + 0.25 * (f64::from(x) / f64::from(width) * TAU * waves + phase).sin()
        };
        let level = (0.5 * near(0) + 0.3 * near(1) + 0.2 * near(2)).clamp(0.0, 1.0);
        let shade = |dark: f64, light: f64| (dark + (light - dark) * level) as u8;
        [shade(60.0, 122.0), shade(26.0, 62.0), shade(12.0, 30.0), 255]
    };
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
    Image { name: "grain".to_owned(), width, height, texels }
}
