//! Meshes that deform: a bent bar against closed forms, morph targets, and the animated models of ../shared/scenes.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

#[path = "accel_support/mod.rs"]
mod accel_support;
#[path = "support/gltf.rs"]
mod gltf;

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use accel_support::{Rng, icosphere};
use glam::{DAffine3, DQuat, DVec3, Vec3, Vec4};
use stillray::scene::deform::{Deformed, deform};
use stillray::scene::{
    Deformation, Deformer, Instance, LocalTransform, Mesh, MorphTarget, Node, Pose, Scene, Skin, import,
};

/// Half a unit in the last place of f32 numbers from 2 to 4.
const HALF_ULP: f64 = 1.0 / (1 << 23) as f64;

fn shape(scene: &Scene, pose: &Pose, deformer: usize) -> Deformed {
    let (deformation, mut out) = (&pose.deformations[deformer], Deformed::default());
    deform(&scene.meshes[scene.instances[deformation.instance].mesh], deformation, &mut out);
    out
}

// A bar of two bones

const RINGS: usize = 9;

/// How much a ring follows the upper bone.
fn upper(ring: usize) -> f32 {
    ring as f32 / (RINGS - 1) as f32
}

/// A square bar of radius 1/4 from y = 0 to 2, with one bone from 0 to 1 and one from 1 to 2, far from the origin; the upper
/// bone is turned about z. What a ring follows goes evenly from one bone to the other.
fn bar(angle: f64, at: DVec3) -> Scene {
    let corner = |i: usize| Vec3::new([1.0, 0.0, -1.0, 0.0][i % 4], 0.0, [0.0, 1.0, 0.0, -1.0][i % 4]);
    let vertices = || (0..4 * RINGS).map(|i| (i / 4, corner(i)));
    let quad = |r: u32, s: u32| {
        [[4 * r + s, 4 * r + s + 4, 4 * r + (s + 1) % 4], [4 * r + (s + 1) % 4, 4 * r + s + 4, 4 * r + (s + 1) % 4 + 4]]
    };
    let triangles: Vec<[u32; 3]> = (0..RINGS as u32 - 1).flat_map(|r| (0..4).flat_map(move |s| quad(r, s))).collect();
    let mesh = Mesh {
        positions: vertices().map(|(ring, side)| side * 0.25 + Vec3::Y * 2.0 * upper(ring)).collect(),
        normals: vertices().map(|(_, side)| side).collect(),
        tangents: vec![Vec4::new(0.0, 1.0, 0.0, 1.0); 4 * RINGS],
        triangle_materials: vec![0; triangles.len()],
        triangles,
        joints: [vec![[0, 1, 0, 0]; 4 * RINGS], Vec::new()],
        weights: [vertices().map(|(ring, _)| [1.0 - upper(ring), upper(ring), 0.0, 0.0]).collect(), Vec::new()],
        ..Mesh::default()
    };
    let node = |parent, translation, rotation| Node {
        parent,
        local: LocalTransform::Trs { translation, rotation, scale: DVec3::ONE },
        ..Node::default()
    };
    let turn = DQuat::from_rotation_z(angle);
    Scene {
        meshes: vec![mesh],
        instances: vec![Instance { node: 0, mesh: 0 }],
        nodes: vec![Node::default(), node(None, at, DQuat::IDENTITY), node(Some(1), DVec3::Y, turn)],
        skins: vec![Skin {
            name: "bones".to_owned(),
            joints: vec![1, 2],
            inverse_bind: vec![DAffine3::IDENTITY, DAffine3::from_translation(DVec3::NEG_Y)],
        }],
        deformers: vec![Deformer { instance: 0, skin: Some(0), weights: Vec::new() }],
        ..Scene::default()
    }
}

/// The largest distance of a vertex from its closed form, and of a normal where the form has a simple one: half-way between
/// two bones the sum of both is a turn by half the angle and a scaling.
fn bar_error(angle: f64, told: f64, at: DVec3) -> [f64; 2] {
    let (scene, rest) = (bar(angle, at), bar(0.0, at));
    let pose = scene.pose(0.0);
    let out = shape(&scene, &pose, 0);
    let (mut position, mut normal) = (0.0f64, 0.0f64);
    for (i, p) in rest.meshes[0].positions.iter().map(|p| p.as_dvec3()).enumerate() {
        let w = f64::from(upper(i / 4));
        let turned = DQuat::from_rotation_z(told) * (p - DVec3::Y) + DVec3::Y;
        let found = pose.instances[0].transform_point3(out.positions[i].as_dvec3());
        position = position.max((found - (p * (1.0 - w) + turned * w + at)).length());
        if [0.0, 0.5, 1.0].contains(&w) {
            let expected = DQuat::from_rotation_z(told * w) * rest.meshes[0].normals[i].as_dvec3();
            normal = normal.max((out.normals[i].as_dvec3() - expected).length());
            let tangent = DQuat::from_rotation_z(told * w) * DVec3::Y;
            normal = normal.max((out.tangents[i].truncate().as_dvec3() - tangent).length());
            assert_eq!(out.tangents[i].w, 1.0);
        }
    }
    [position, normal]
}

#[test]
fn a_bar_bends_as_its_closed_form_says() {
    for angle in [0.0, FRAC_PI_4, FRAC_PI_2] {
        // Three coordinates up to 3, rounded once. Unit vectors have coordinates up to 1, a quarter of that.
        let [position, normal] = bar_error(angle, angle, DVec3::ZERO);
        assert!(position <= 3f64.sqrt() * HALF_ULP && normal <= 3f64.sqrt() * HALF_ULP / 4.0, "{position} {normal}");
        let [position, normal] = bar_error(angle, angle + 1e-3, DVec3::ZERO);
        assert!(position > 1e-4 && normal > 1e-4, "the comparison does not see a milliradian: {position} {normal}");
    }
}

#[test]
fn a_bar_far_away_bends_as_well() {
    let far = DVec3::new(1e7, -2e7, 3e7);
    let near = shape(&bar(0.7, DVec3::ZERO), &bar(0.7, DVec3::ZERO).pose(0.0), 0);
    let away = shape(&bar(0.7, far), &bar(0.7, far).pose(0.0), 0);
    // Adding 1 to 2e7 in f64 is exact: what the joints do to the mesh is the same to the last bit.
    assert!(near == away, "the shape depends on the place");
    let turned = shape(&bar(0.7 + 1e-6, far), &bar(0.7 + 1e-6, far).pose(0.0), 0);
    assert!(turned != away, "the comparison does not see a microradian");
    // In the closed form at 3e7 m f64 itself rounds by 2^-29 m.
    assert!(bar_error(0.7, 0.7, far)[0] < 3f64.sqrt() * HALF_ULP + 2f64.powi(-27));
}

#[test]
fn bounds_follow_the_shape() {
    let straight = bar(0.0, DVec3::ZERO);
    let (low, high) = straight.bounds(&straight.pose(0.0)).unwrap();
    assert_eq!((low, high), (DVec3::new(-0.25, 0.0, -0.25), DVec3::new(0.25, 2.0, 0.25)));
    let bent = bar(FRAC_PI_2, DVec3::ZERO);
    let (low, high) = bent.bounds(&bent.pose(0.0)).unwrap();
    // The upper end points to -x, a unit above the ground. The ring before it reaches highest: 1/8 of 1.75 and 7/8 of 1.25.
    // The cosine of a right angle is 6e-17.
    assert!((low.x + 1.0).abs() < 1e-15 && (high.y - 1.3125).abs() < 1e-15, "{low} {high}");
}

// Morph targets

fn random_vectors(rng: &mut Rng, count: usize) -> Vec<Vec3> {
    (0..count).map(|_| rng.cube().as_vec3()).collect()
}

#[test]
fn morphing_is_linear_in_the_weights() {
    let rng = &mut Rng::new(7);
    let mut mesh = icosphere(2);
    let count = mesh.positions.len();
    mesh.morph_targets =
        (0..3).map(|_| MorphTarget { positions: random_vectors(rng, count), ..MorphTarget::default() }).collect();
    let at = |weights: [f64; 3]| {
        let mut out = Deformed::default();
        deform(&mesh, &Deformation { instance: 0, joints: Vec::new(), weights: weights.to_vec() }, &mut out);
        out.positions
    };
    let rest = at([0.0; 3]);
    assert_eq!(rest, mesh.positions);
    let (mut worst, mut bent) = (0.0f64, 0.0f64);
    for _ in 0..20 {
        let (u, v) = (rng.cube() * 0.5, rng.cube() * 0.5);
        let [a, b, both] = [u, v, u + v].map(|weights| at(weights.to_array()));
        for i in 0..count {
            let sum = a[i].as_dvec3() + b[i].as_dvec3() - rest[i].as_dvec3();
            worst = worst.max((both[i].as_dvec3() - sum).abs().max_element());
            // Negative control: the product of the weights does not belong there.
            let extra = mesh.morph_targets[0].positions[i].as_dvec3() * u.x * v.x;
            bent = bent.max((both[i].as_dvec3() - sum - extra).abs().max_element());
        }
    }
    // Coordinates up to 4, of which three are rounded and one is not.
    assert!(worst <= 3.0 * HALF_ULP && bent > 100.0 * HALF_ULP, "{worst:e} {bent:e}");
}

// The models

const MODELS: [&str; 8] = [
    "SimpleSkin/SimpleSkin.gltf",
    "CesiumMan/CesiumMan.glb",
    "Fox/Fox.glb",
    "AnimatedMorphCube/AnimatedMorphCube.gltf",
    "compressed/AnimatedMorphCube-Quantized/AnimatedMorphCube.gltf",
    "SimpleMorph/SimpleMorph.gltf",
    "MorphPrimitivesTest/MorphPrimitivesTest.glb",
    "BoxAnimated/BoxAnimated.glb",
];

fn models() -> Vec<(&'static str, Scene)> {
    let Some(folder) = gltf::shared_scenes() else { return Vec::new() };
    MODELS.map(|model| (model, import::load(&folder.join(model)).unwrap())).into()
}

#[test]
fn animated_models_stay_whole() {
    for (model, scene) in models() {
        let size = |time: f64| {
            let (low, high) = scene.bounds(&scene.pose(time)).unwrap();
            assert!(low.is_finite() && high.is_finite(), "{model}");
            (high - low).length()
        };
        let (rest, mut moved) = (size(0.0), 0.0f64);
        let mut before = scene.pose(0.0);
        for step in 0..=60 {
            let time = scene.duration() * f64::from(step) / 60.0;
            let (size, pose) = (size(time), scene.pose(time));
            if model.contains("CesiumMan") {
                // He walks on the ground, his joints being turned from a space in which z is up.
                let (low, high) = scene.bounds(&pose).unwrap();
                assert!(low.y.abs() < 0.1 && (1.3..1.6).contains(&high.y), "{low} {high}");
            }
            // Limbs stretch out and bend; a joint that is applied twice, or not at all, would throw them farther.
            assert!((0.5..2.5).contains(&(size / rest)), "{model} at {time}: {size} of {rest}");
            for (deformer, deformation) in pose.deformations.iter().enumerate() {
                let shape = shape(&scene, &pose, deformer);
                assert_eq!(shape.out_of_range, 0, "{model}");
                assert!(shape.normals.iter().all(|n| (n.length() - 1.0).abs() < 4e-7), "{model}");
                // In object space a skin is as small as its mesh in the file.
                let most = |p: &[Vec3]| p.iter().fold(0.0f32, |most, p| most.max(p.abs().max_element()));
                let mesh = &scene.meshes[scene.instances[deformation.instance].mesh];
                assert!(most(&shape.positions) < 3.0 * most(&mesh.positions), "{model} at {time}");
            }
            moved = moved.max(f64::from(u8::from(pose.deformations != before.deformations)));
            before = pose;
        }
        let deforms =
            model.contains("Skin") || model.contains("Man") || model.contains("Fox") || model.contains("Morph");
        assert_eq!(scene.deformers.is_empty(), !deforms, "{model}");
        let animated = deforms && scene.duration() > 0.0;
        assert_eq!(moved > 0.0, animated, "{model}");
    }
}

fn largest(mesh: &Mesh) -> f32 {
    mesh.positions.iter().fold(0.0, |most, p| most.max(p.abs().max_element()))
}

/// How far a mesh is from where it was modelled once its joints are where they were when it was bound, in units of its
/// largest coordinate; `off` of these move each joint away from the one before.
fn unbound(scene: &Scene, off: f64) -> f64 {
    let mut scene = scene.clone();
    scene.animations.clear();
    let off = off * f64::from(largest(&scene.meshes[0]));
    for skin in &scene.skins {
        for (index, (&joint, bind)) in skin.joints.iter().zip(&skin.inverse_bind).enumerate() {
            let moved = DAffine3::from_translation(DVec3::X * off * index as f64);
            let local = LocalTransform::Matrix(moved * bind.inverse());
            scene.nodes[joint] = Node { parent: None, local, ..Node::default() };
        }
    }
    let pose = scene.pose(0.0);
    let errors = (0..scene.deformers.len()).map(|deformer| {
        let instance = scene.deformers[deformer].instance;
        let (mesh, out) = (&scene.meshes[scene.instances[instance].mesh], shape(&scene, &pose, deformer));
        let pairs = out.positions.iter().zip(&mesh.positions);
        pairs.fold(0.0f32, |most, (a, b)| most.max((*a - *b).abs().max_element())) / largest(mesh)
    });
    f64::from(errors.fold(0.0, f32::max))
}

#[test]
fn in_the_bind_pose_a_skin_leaves_its_mesh_where_it_was_modelled() {
    for (model, scene) in models().into_iter().filter(|(_, scene)| !scene.skins.is_empty()) {
        // Inverting a matrix twice in f64 changes nothing that an f32 would show, but for one rounding of the largest
        // coordinate to either side.
        let error = unbound(&scene, 0.0);
        assert!(error <= 2f64.powi(-23), "{model}: {error:e}");
        let error = unbound(&scene, 1e-5);
        assert!(error > 1e-6, "{model}: the comparison does not see joints that are off: {error:e}");
    }
}

#[test]
fn the_same_pose_twice_has_the_same_bits() {
    for (model, scene) in models() {
        let time = 0.37 * scene.duration();
        let poses = [scene.pose(time), scene.pose(time)];
        assert_eq!(poses[0], poses[1], "{model}");
        for deformer in 0..scene.deformers.len() {
            let [first, again] = [0, 1].map(|i| shape(&scene, &poses[i], deformer));
            // What an array held before must not matter either.
            let mut reused = shape(&scene, &scene.pose(0.0), deformer);
            let deformation = &poses[0].deformations[deformer];
            deform(&scene.meshes[scene.instances[deformation.instance].mesh], deformation, &mut reused);
            assert!(first == again && first == reused, "{model}");
            let later = shape(&scene, &scene.pose(time + 0.01), deformer);
            assert_eq!(
                first != later,
                scene.duration() > 0.0,
                "{model}: the comparison does not see a hundredth of a second"
            );
        }
    }
}
