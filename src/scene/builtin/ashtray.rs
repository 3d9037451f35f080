//! An ashtray of thick glass on a checkered cloth, with bubbles of air and a marble of denser glass within its foot: dielectrics in a
//! dielectric (paper 2, section 3.5).

use super::Parameter;
use super::shapes::{empty, lathe, push_quad, sphere};
use super::stage::{Stage, at, look_along};
use crate::scene::{Image, LightShape, LocalTransform, Material, Scene, TextureRef, Wrap};
use glam::{Affine2, DQuat, DVec2, DVec3, Vec2, Vec3, Vec4};
use std::f64::consts::TAU;

/// Bubbles of air in the glass.
pub(super) const BUBBLES: Parameter = Parameter { name: "bubbles", min: 0, max: 64, default: 11 };

/// All lengths below are centimetres.
const CM: f64 = 0.01;

pub(super) fn build(bubbles: u32) -> Scene {
    let mut stage = Stage::new("ashtray", Vec3::new(0.30, 0.34, 0.40));
    cloth(&mut stage);
    let body = glass("glass", 1.5, Vec3::new(2.6, 1.0, 1.8));
    let body = stage.material(body);
    let tray = stage.mesh(lathe("ashtray", &outline(), 128, body));
    put(&mut stage, "ashtray", tray, DVec3::Y * 0.02);
    inside(&mut stage, bubbles);
    cigarette(&mut stage);
    lamps(&mut stage);
    stage.camera(DVec3::new(4.0, 17.0, 27.0) * CM, DVec3::new(0.3, 1.4, 0.0) * CM, 0.50);
    stage.finish()
}

/// From the middle of the bowl over the rim to the middle of the foot, and how round each corner is.
fn outline() -> [(DVec2, f64); 6] {
    [(0.0, 1.4, 0.0), (4.0, 1.4, 0.6), (4.6, 3.2, 0.35), (5.8, 3.2, 0.35), (6.2, 0.0, 0.25), (0.0, 0.0, 0.0)]
        .map(|(radius, height, round)| (DVec2::new(radius, height) * CM, round * CM))
}

/// What is smooth and absorbs so much in a metre.
fn glass(name: &str, ior: f32, absorption: Vec3) -> Material {
    Material {
        name: name.to_owned(),
        metallic: 0.0,
        roughness: 0.0,
        ior,
        transmission: 1.0,
        volume: Some(absorption),
        ..Material::default()
    }
}

/// A marble in the middle of the foot, and bubbles around it.
fn inside(stage: &mut Stage, bubbles: u32) {
    let dense = stage.material(glass("marble", 1.75, Vec3::new(10.0, 160.0, 220.0)));
    let air = stage.material(glass("air", 1.0, Vec3::ZERO));
    let marble = stage.mesh(sphere("marble", 0.5 * CM, 32, 64, dense));
    put(stage, "marble", marble, DVec3::Y * 0.72);
    for i in 0..bubbles {
        // Around a sunflower's spiral, which leaves them apart.
        let part = (f64::from(i) + 1.0) / (f64::from(bubbles) + 1.0);
        let (sin, cos) = (f64::from(i) * 0.381_966 * TAU).sin_cos();
        let radius = 0.8 + 3.4 * part.sqrt();
        let size = if bubbles > 16 { 0.10 } else { 0.13 + 0.07 * f64::from(i * 3 % 4) };
        let bubble = stage.mesh(sphere(&format!("bubble {i}"), size * CM, 16, 32, air));
        put(stage, &format!("bubble {i}"), bubble, DVec3::new(radius * cos, 0.72, -radius * sin));
    }
}

/// From the bowl over the rim.
fn cigarette(stage: &mut Stage) {
    let [paper, filter] = [("paper", [0.85, 0.84, 0.80]), ("filter", [0.72, 0.42, 0.16])]
        .map(|(name, [r, g, b])| stage.material(matte(name, Vec4::new(r, g, b, 1.0), 0.8)));
    let radius = 0.39;
    let roll = |length: f64| {
        [(0.0, length, 0.0), (radius, length, 0.04), (radius, 0.0, 0.04), (0.0, 0.0, 0.0)]
            .map(|(r, y, round)| (DVec2::new(r, y) * CM, round * CM))
    };
    // Its underside touches the bowl at its lower end, and the rim.
    let (foot, rim) = (DVec2::new(-2.6, 1.42), DVec2::new(4.75, 3.22));
    let along = (rim - foot).normalize();
    let axis = foot + along.perp() * radius;
    let turn = DQuat::from_rotation_y(0.5);
    for (name, material, from, length) in [("paper", paper, 0.0, 6.2), ("filter", filter, 6.2, 2.4)] {
        let mesh = stage.mesh(lathe(name, &roll(length), 48, material));
        let start = axis + along * from;
        let lean = DQuat::from_rotation_z(along.y.atan2(along.x) - 0.25 * TAU);
        let translation = turn * DVec3::new(start.x, start.y, 0.0) * CM;
        let node =
            stage.node(name, None, LocalTransform::Trs { translation, rotation: turn * lean, scale: DVec3::ONE });
        stage.instance(node, mesh);
    }
}

/// Checks of three centimetres.
fn cloth(stage: &mut Stage) {
    let (dark, light) = ([54, 84, 104, 255], [222, 216, 200, 255]);
    let image = Image { name: "checks".to_owned(), width: 2, height: 2, texels: vec![dark, light, light, dark] };
    let checks = stage.texture(image, Wrap::Repeat, true);
    let checks = TextureRef { transform: Affine2::from_scale(Vec2::splat(40.0)), ..checks };
    let mut material = matte("cloth", Vec4::ONE, 0.9);
    material.base_color_texture = Some(checks);
    let material = stage.material(material);
    let mut mesh = empty("cloth");
    push_quad(&mut mesh, DVec3::new(-120.0, 0.0, 120.0) * CM, DVec3::X * 2.4, DVec3::Z * -2.4, material);
    let mesh = stage.mesh(mesh);
    stage.place("cloth", mesh);
}

/// A luminaire, and a bright sheet beside it for the glass to reflect.
fn lamps(stage: &mut Stage) {
    let above = DVec3::new(-35.0, 60.0, -20.0) * CM;
    stage.area_light(above, -above, Vec3::new(1.0, 0.94, 0.84), 2.4, LightShape::Disc([0.12, 0.12]));
    let mut sheet = matte("sheet", Vec4::new(0.0, 0.0, 0.0, 1.0), 1.0);
    sheet.emissive = Vec3::splat(5.0);
    let sheet = stage.material(sheet);
    let mut mesh = empty("sheet");
    push_quad(&mut mesh, DVec3::new(-15.0, -10.0, 0.0) * CM, DVec3::X * 0.3, DVec3::Y * 0.2, sheet);
    let mesh = stage.mesh(mesh);
    let place = DVec3::new(12.0, 45.0, -45.0) * CM;
    // It looks along +Z where a camera looks along -Z.
    let rotation = look_along(place);
    let node = stage.node("sheet", None, LocalTransform::Trs { translation: place, rotation, scale: DVec3::ONE });
    stage.instance(node, mesh);
}

fn matte(name: &str, base_color: Vec4, roughness: f32) -> Material {
    Material { name: name.to_owned(), base_color, metallic: 0.0, roughness, ..Material::default() }
}

/// At a place in centimetres.
fn put(stage: &mut Stage, name: &str, mesh: usize, place: DVec3) {
    let node = stage.node(name, None, at(place * CM));
    stage.instance(node, mesh);
}
