//! Trees that follow deformed meshes: conservative, the same whatever came before, and traced as exhaustive search says.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod accel_support;

use accel_support::rays::random_query;
use accel_support::{Built, Rng, crumpled, icosphere, mesh, random_soup};
use glam::{DAffine3, DVec3, Vec3, Vec4};
use rayon::prelude::*;
use stillray::accel::{BvhBuildParams, Geometry, MAX_COORDINATE, Node, RefitOutcome};
use stillray::oracle::traverse::closest;
use stillray::oracle::traverse::reference::disagreement;
use stillray::scene::deform::{Deformed, deform};
use stillray::scene::{Deformation, Mesh};

const JOINTS: usize = 6;
const RAYS: u64 = 3000;

/// Gives each vertex up to four random joints.
fn jointed(mut mesh: Mesh, rng: &mut Rng) -> Mesh {
    let count = mesh.positions.len();
    mesh.normals = mesh.positions.iter().map(|p| p.normalize_or(Vec3::Z)).collect();
    mesh.tangents = mesh.normals.iter().map(|n| n.any_orthonormal_vector().extend(1.0)).collect();
    mesh.joints[0] = (0..count).map(|_| std::array::from_fn(|_| rng.below(JOINTS) as u16)).collect();
    mesh.weights[0] = (0..count).map(|_| std::array::from_fn(|_| rng.unit() as f32)).collect();
    mesh
}

fn meshes(rng: &mut Rng) -> Vec<(&'static str, Mesh)> {
    let all = [("soup", random_soup(rng, 600, 0.2)), ("sphere", icosphere(3)), ("crumpled", crumpled(rng, 3, 1.5))];
    all.map(|(name, mesh)| (name, jointed(mesh, rng))).into()
}

fn random_shape(rng: &mut Rng, mesh: &Mesh, amount: f64) -> Deformed {
    let joint = |rng: &mut Rng| {
        let m = rng.transform(1.0);
        DAffine3 {
            matrix3: DAffine3::IDENTITY.matrix3 * (1.0 - amount) + m.matrix3 * amount,
            translation: m.translation * amount,
        }
    };
    let joints = (0..JOINTS).map(|_| joint(rng)).collect();
    let mut out = Deformed::default();
    deform(mesh, &Deformation { instance: 0, joints, weights: Vec::new() }, &mut out);
    out
}

fn rest(mesh: &Mesh) -> Deformed {
    let mut out = Deformed::default();
    deform(mesh, &Deformation::default(), &mut out);
    out
}

/// Two placed meshes, of which the second one will deform.
fn built(rng: &mut Rng, mesh: &Mesh) -> Built {
    let placed = [(0, DAffine3::from_translation(DVec3::X * 4.0)), (1, rng.transform(0.5))];
    Built::new(vec![icosphere(1), mesh.clone()], &placed, DVec3::ZERO)
}

fn refit(built: &mut Built, shape: &Deformed) -> RefitOutcome {
    let outcome = built.geometry.refit(1, shape).unwrap();
    built.tlas.rebuild(&built.geometry, &mut built.instances);
    outcome
}

/// Rays whose answer is wrong, and rays that hit.
fn wrong_answers(built: &Built, seed: u64) -> (usize, usize) {
    let world = built.world();
    let answers = (0..RAYS).into_par_iter().map(|i| {
        let query = random_query(&mut Rng::new(seed + i), built);
        let found = closest(&world, &query);
        (usize::from(disagreement(&world, &query, found.as_ref()).is_some()), usize::from(found.is_some()))
    });
    answers.reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1))
}

#[test]
fn rays_meet_what_deformed_as_exhaustive_search_says() {
    let rng = &mut Rng::new(11);
    for (name, mesh) in meshes(rng) {
        for (step, amount) in [0.05, 0.5, 1.0].into_iter().enumerate() {
            let mut built = built(rng, &mesh);
            let stale = built.geometry.nodes.clone();
            let outcome = refit(&mut built, &random_shape(rng, &mesh, amount));
            let (wrong, hits) = wrong_answers(&built, 1000 * step as u64);
            println!("{name}, {amount}: {hits} of {RAYS} rays hit, tracing costs {:.2} of before", outcome.cost);
            assert!(wrong == 0 && hits > 200, "{name}, {amount}: {wrong} of {hits}");
            // Negative control: triangles that moved, in boxes that did not.
            built.geometry.nodes = stale;
            let missed = wrong_answers(&built, 1000 * step as u64).0;
            assert!(missed > 20, "{name}, {amount}: stale boxes lose {missed} hits");
        }
    }
}

/// The planes of a child, in f64 exactly.
fn planes(node: &Node, child: usize) -> (DVec3, DVec3) {
    let byte = |word: usize| f64::from((node[word + child / 4] >> (8 * (child % 4))) & 0xff);
    let step = |axis: usize| f64::from(f32::from_bits(((node[3] >> (8 * axis)) & 0xff) << 23));
    let plane =
        |axis: usize, upper: usize| f64::from(f32::from_bits(node[axis])) + step(axis) * byte(8 + 4 * axis + 2 * upper);
    (DVec3::from_array([0, 1, 2].map(|axis| plane(axis, 0))), DVec3::from_array([0, 1, 2].map(|axis| plane(axis, 1))))
}

/// Counts the boxes of a mesh's tree that do not hold the triangles below them. Returns the slots below `index`.
fn leaks(geometry: &Geometry, mesh: usize, index: u32, leaking: &mut usize) -> Vec<u32> {
    let record = &geometry.meshes[mesh];
    let node = &geometry.nodes[(record.first_node + index) as usize];
    let (mut all, mut inner) = (Vec::new(), 0);
    for child in 0..8 {
        let meta = (node[6 + child / 4] >> (8 * (child % 4))) & 0xff;
        let slots = if node[3] >> (24 + child) & 1 == 1 {
            inner += 1;
            leaks(geometry, mesh, node[4] + inner - 1, leaking)
        } else {
            let first = record.first_triangle + node[5] + (meta & 0x1f);
            (first..first + (meta >> 5).count_ones()).collect()
        };
        let (low, high) = planes(node, child);
        let holds = |p: Vec3| p.as_dvec3().cmpge(low).all() && p.as_dvec3().cmple(high).all();
        *leaking += usize::from(!slots.iter().all(|&slot| geometry.corners(slot).into_iter().all(holds)));
        all.extend(slots);
    }
    all
}

fn leaking(geometry: &Geometry, mesh: usize) -> usize {
    let mut leaking = 0;
    let mut slots = leaks(geometry, mesh, 0, &mut leaking);
    slots.sort_unstable();
    let record = &geometry.meshes[mesh];
    assert!(slots.into_iter().eq(record.first_triangle..record.first_triangle + record.triangle_count));
    leaking
}

#[test]
fn every_box_holds_its_triangles() {
    let rng = &mut Rng::new(12);
    for (name, mesh) in meshes(rng) {
        let mut built = built(rng, &mesh);
        let shape = random_shape(rng, &mesh, 1.0);
        let stale = built.geometry.nodes.clone();
        let outcome = refit(&mut built, &shape);
        assert_eq!(leaking(&built.geometry, 1), 0, "{name}");
        let held = |p: &Vec3| p.cmpge(outcome.bounds.min).all() && p.cmple(outcome.bounds.max).all();
        assert!(shape.positions.iter().all(held) && built.geometry.meshes[1].bounds == outcome.bounds, "{name}");
        built.geometry.nodes = stale;
        assert!(leaking(&built.geometry, 1) > 20, "{name}: the count does not see stale boxes");
    }
}

/// Extreme shapes: points, lines, coordinates at the ends of the range.
#[test]
fn extreme_shapes_fit_as_well() {
    let rng = &mut Rng::new(13);
    let mesh = jointed(random_soup(rng, 300, 0.3), rng);
    let scales =
        [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1e-30, 1e10), Vec3::splat(1e-38), Vec3::splat(MAX_COORDINATE / 2.0)];
    for scale in scales {
        let mut built = built(rng, &mesh);
        let mut shape = rest(&mesh);
        shape.positions.iter_mut().for_each(|p| *p *= scale);
        let outcome = refit(&mut built, &shape);
        assert_eq!(leaking(&built.geometry, 1), 0, "{scale}");
        assert!(outcome.cost.is_finite() && outcome.cost > 0.0, "{scale}: {}", outcome.cost);
    }
}

#[test]
fn only_what_is_said_to_change_changes_and_only_the_shape_decides_how() {
    let rng = &mut Rng::new(14);
    let mesh = jointed(random_soup(rng, 500, 0.2), rng);
    let mut built = built(rng, &mesh);
    let [first, second] = [0.3, 1.0].map(|amount| random_shape(rng, &mesh, amount));
    let original = built.geometry.clone();
    let outcome = refit(&mut built, &first);
    let once = built.geometry.clone();
    refit(&mut built, &second);
    assert_ne!(built.geometry.nodes, once.nodes);
    assert_eq!(refit(&mut built, &first), outcome);
    assert!(same(&built.geometry, &once, true), "the shape before leaves no trace");
    // Everything outside of the ranges is as it was built.
    let range = |r: &std::ops::Range<u32>| r.start as usize..r.end as usize;
    let mut restored = once.clone();
    restored.nodes[range(&outcome.nodes)].copy_from_slice(&original.nodes[range(&outcome.nodes)]);
    let (triangles, vertices) = (range(&outcome.triangles), range(&outcome.vertices));
    restored.triangle_corners[triangles.clone()].copy_from_slice(&original.triangle_corners[triangles.clone()]);
    restored.triangle_rest[triangles.clone()].copy_from_slice(&original.triangle_rest[triangles]);
    restored.vertices[vertices.clone()].copy_from_slice(&original.vertices[vertices]);
    assert!(same(&restored, &original, true));
    // In the shape that it was built for the tree is what it was; normals are made unit vectors once more.
    let back = refit(&mut built, &rest(&mesh));
    assert!(back.cost == 1.0 && same(&built.geometry, &original, false), "{}", back.cost);
}

fn same(a: &Geometry, b: &Geometry, vertices: bool) -> bool {
    a.nodes == b.nodes
        && a.triangle_corners == b.triangle_corners
        && a.triangle_rest == b.triangle_rest
        && a.triangles == b.triangles
        && a.source_triangles == b.source_triangles
        && (!vertices || a.vertices == b.vertices)
}

#[test]
fn a_tree_built_anew_is_better_and_in_the_same_place() {
    let rng = &mut Rng::new(15);
    for (name, mesh) in meshes(rng) {
        let mut built = built(rng, &mesh);
        let shape = random_shape(rng, &mesh, 1.0);
        let fitted = refit(&mut built, &shape).cost;
        let anew = built.geometry.rebuild(1, &shape, &BvhBuildParams::medium_build()).unwrap().unwrap();
        built.tlas.rebuild(&built.geometry, &mut built.instances);
        println!("{name}: tracing costs {fitted:.2} of before after a refit");
        assert!(fitted > 1.2 && anew.cost == 1.0 && anew.rebuilt, "{name}: {fitted}, then {}", anew.cost);
        assert_eq!((leaking(&built.geometry, 1), wrong_answers(&built, 77).0), (0, 0), "{name}");
        let record = built.geometry.meshes[1];
        for slot in record.first_triangle..record.first_triangle + record.triangle_count {
            let triangle = built.geometry.triangles[slot as usize];
            let source = mesh.triangles[built.geometry.source_triangles[slot as usize] as usize];
            let vertices = [triangle.vertex0, triangle.vertex1, triangle.vertex2];
            assert_eq!(vertices, source.map(|v| v + record.first_vertex), "{name}");
            assert_eq!(built.geometry.corners(slot), source.map(|v| shape.positions[v as usize]), "{name}");
        }
        // A refit goes on from there.
        refit(&mut built, &rest(&mesh));
        assert_eq!((leaking(&built.geometry, 1), wrong_answers(&built, 78).0), (0, 0), "{name}");
    }
}

#[test]
fn a_tree_that_finds_no_place_is_refused_unchanged() {
    let rng = &mut Rng::new(16);
    // Without joints it has no nodes to spare; one triangle a leaf needs more of them than three.
    let mut mesh = random_soup(rng, 400, 0.2);
    mesh.normals = vec![Vec3::Z; mesh.positions.len()];
    let mut built = built(rng, &mesh);
    let before = built.geometry.clone();
    let wider = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
    assert_eq!(built.geometry.rebuild(1, &rest(&mesh), &wider).unwrap(), None);
    assert!(same(&built.geometry, &before, true));
}

#[test]
fn what_does_not_fit_is_an_error_that_changes_nothing() {
    let rng = &mut Rng::new(17);
    let mesh = jointed(icosphere(1), rng);
    let mut built = built(rng, &mesh);
    let before = built.geometry.clone();
    let good = rest(&mesh);
    let mut short = good.clone();
    short.normals.pop();
    let mut half = good.clone();
    half.tangents = vec![Vec4::X; 3];
    let mut bad = vec![(short, "deform the same mesh"), (half, "deform the same mesh")];
    for value in [f32::NAN, f32::INFINITY, MAX_COORDINATE * 1.01] {
        let mut shape = good.clone();
        shape.positions[5].y = value;
        bad.push((shape, "out of range at vertex 5"));
    }
    for (shape, reason) in &bad {
        let message = built.geometry.refit(1, shape).unwrap_err().to_string();
        assert!(message.contains("mesh 1") && message.contains(reason), "{message}");
        assert!(built.geometry.rebuild(1, shape, &BvhBuildParams::medium_build()).is_err());
    }
    assert!(built.geometry.refit(9, &good).unwrap_err().to_string().contains("mesh 9"));
    assert!(same(&built.geometry, &before, true));
    built.geometry.refit(1, &good).unwrap();
}

#[test]
fn an_empty_mesh_has_nothing_to_fit() {
    let mut built =
        Built::new(vec![icosphere(0), mesh(Vec::new(), Vec::new())], &[(0, DAffine3::IDENTITY)], DVec3::ZERO);
    let outcome = refit(&mut built, &Deformed::default());
    assert!(outcome.bounds.is_empty() && outcome.nodes.is_empty() && outcome.cost == 1.0);
    let anew = built.geometry.rebuild(1, &Deformed::default(), &BvhBuildParams::medium_build()).unwrap();
    assert!(anew.is_some_and(|outcome| outcome.nodes.is_empty()));
}
