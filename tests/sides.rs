//! One-sided surfaces (glTF 2.0, section 3.9.8): not seen from behind, in every method, but they keep the light out.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a panic is a failing test

mod support;

use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3, Vec4};
use std::f64::consts::{FRAC_PI_2, PI};
use stillray::renderer::{Method, Settings};
use stillray::scene::motion::Motion;
use stillray::scene::{
    Camera, Environment, Instance, Lens, Light, LightKind, LightShape, LocalTransform, Material, Mesh, Node, Scene,
};
use support::rig::Rig;

const SKY: Vec3 = Vec3::new(0.25, 0.5, 0.75);

/// A square of half size 1 in z = 0 that faces +z.
fn square(material: u32) -> Mesh {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(Vec2::from);
    Mesh {
        name: "square".to_owned(),
        positions: corners.map(|p| p.extend(0.0)).to_vec(),
        normals: vec![Vec3::Z; 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        triangle_materials: vec![material; 2],
        ..Mesh::default()
    }
}

/// One-sided glowing red, the same double-sided, and a floor.
fn materials() -> Vec<Material> {
    let red = Material { base_color: Vec4::new(1.0, 0.0, 0.0, 1.0), unlit: true, ..Material::default() };
    let floor = Material { metallic: 0.0, double_sided: true, ..Material::default() };
    vec![red.clone(), Material { double_sided: true, ..red }, floor]
}

fn node(transform: DAffine3) -> Node {
    Node { name: String::new(), parent: None, local: LocalTransform::Matrix(transform) }
}

/// The camera at the origin, looking along -z, and squares of these materials in these places.
fn scene(placed: &[(u32, DAffine3)]) -> Scene {
    let mut nodes = vec![Node::default()];
    nodes.extend(placed.iter().map(|p| node(p.1)));
    Scene {
        name: "sides".to_owned(),
        meshes: placed.iter().map(|p| square(p.0)).collect(),
        instances: (0..placed.len()).map(|i| Instance { node: i + 1, mesh: i }).collect(),
        nodes,
        materials: materials(),
        cameras: vec![Camera { name: String::new(), node: 0, yfov: 1.0, lens: Lens::PINHOLE, shutter: 0.0 }],
        environment: Environment { radiance: SKY },
        ..Scene::default()
    }
}

fn settings(method: Method) -> Settings {
    Settings { method, size: [48, 36], float_output: true, ..Settings::default() }
}

/// Pixels that are red, of the second of two frames.
fn red(scene: Scene, method: Method) -> usize {
    let rig = Rig::new(scene);
    let mut session = rig.session(&settings(method));
    rig.frame(&mut session, Motion::Static, 0);
    rig.frame(&mut session, Motion::Static, 1);
    let pixels = session.color().unwrap();
    rig.assert_clean();
    pixels.data.chunks(4).filter(|p| p[0] > 0.9 && p[1] < 0.1).count()
}

fn ahead(turn: f64, mirrored: bool) -> DAffine3 {
    let scale = DVec3::new(if mirrored { -1.0 } else { 1.0 }, 1.0, 1.0);
    DAffine3::from_scale_rotation_translation(scale, DQuat::from_rotation_y(turn), DVec3::new(0.0, 0.0, -4.0))
}

#[test]
fn one_sided_squares_are_seen_from_the_front_only() {
    for method in Method::ALL.iter().copied() {
        for mirrored in [false, true] {
            let seen = |material, turn| red(scene(&[(material, ahead(turn, mirrored))]), method);
            let front = seen(0, 0.0);
            // A square of 2 m at 4 m in a picture that is 2 tan(0.5) * 4 = 4.37 m high: 16.5 pixels across and down, less
            // what the filter blends over at its border.
            assert!((196..290).contains(&front), "{method:?}, mirrored {mirrored}: {front} pixels");
            assert_eq!(seen(0, PI), 0, "{method:?}, mirrored {mirrored}: from behind");
            assert_eq!((seen(1, 0.0), seen(1, PI)), (front, front), "{method:?}, mirrored {mirrored}: double-sided");
        }
    }
}

#[test]
fn what_is_behind_a_back_is_seen() {
    let far = DAffine3::from_scale_rotation_translation(DVec3::splat(3.0), DQuat::IDENTITY, DVec3::new(0.0, 0.0, -8.0));
    let mut both = scene(&[(2, ahead(PI, false)), (0, far)]);
    let hidden = red(both.clone(), Method::Stable);
    both.materials[2].double_sided = false;
    let whole = red(both, Method::Stable);
    // What the near square hides, as above.
    assert!(whole >= hidden + 196, "{whole} against {hidden}");
}

/// Radiance of the middle of a floor under a lamp, with a square (if any) between them; the camera looks in from the side.
fn floor_brightness(square: Option<(u32, f64)>) -> f32 {
    let turn = |angle, height: f64, size: f64| {
        let at = DVec3::new(0.0, height, -6.0);
        DAffine3::from_scale_rotation_translation(DVec3::splat(size), DQuat::from_rotation_x(angle), at)
    };
    let mut placed = vec![(2, turn(-FRAC_PI_2, -1.5, 2.0))];
    placed.extend(square.map(|(material, angle)| (material, turn(angle, 2.5, 2.0))));
    let mut scene = scene(&placed);
    scene.environment.radiance = Vec3::ZERO;
    scene.nodes.push(node(DAffine3::from_translation(DVec3::new(0.0, 6.0, -6.0))));
    let lamp = Light {
        name: String::new(),
        node: scene.nodes.len() - 1,
        kind: LightKind::Point,
        color: Vec3::ONE,
        intensity: 100.0,
        range: None,
        shape: LightShape::Sharp,
    };
    scene.lights = vec![lamp];
    let rig = Rig::new(scene);
    let mut session = rig.session(&settings(Method::Stable));
    rig.frame(&mut session, Motion::Static, 0);
    let pixels = session.color().unwrap();
    rig.assert_clean();
    // The middle of the floor: 1.5 m down at 6 m.
    let row = (36.0 * (0.5 + 1.5 / 6.0 / (2.0 * 0.5_f64.tan()))) as usize;
    let at = 4 * (row * 48 + 24);
    pixels.data[at + 2]
}

#[test]
fn a_one_sided_square_casts_its_shadow_whichever_way_it_faces() {
    let open = floor_brightness(None);
    assert!(open > 0.1, "{open}");
    for material in [0, 1] {
        for angle in [FRAC_PI_2, -FRAC_PI_2] {
            let shaded = floor_brightness(Some((material, angle)));
            assert_eq!(shaded, 0.0, "material {material} at {angle}");
        }
    }
}
