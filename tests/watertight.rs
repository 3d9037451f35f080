//! No cracks: rays from inside closed meshes, aimed at shared edges and vertices, all hit something.

mod accel_support;

use accel_support::rays::{aimed, closed_meshes, placements};
use accel_support::{Built, Rng};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use stillray::oracle::traverse::{Query, Ray, World, any, closest, transform_direction, transform_point};
use stillray::scene::Mesh;

/// Rays of each mesh; ten meshes make a million.
const RAYS: u64 = 100_000;

fn leaks(meshes: &[(&str, Mesh)], check: impl Fn(&str, &Built, &Query) -> bool + Sync) -> u64 {
    let mut leaks = 0;
    for (name, mesh) in meshes {
        for m in placements() {
            let built = Built::new(vec![mesh.clone()], &[(0, m)], DVec3::ZERO);
            let ray = |i| aimed(&mut Rng::new(i), mesh, &m);
            leaks += (0..RAYS).into_par_iter().filter(|&i| !check(name, &built, &ray(i))).count() as u64;
        }
    }
    leaks
}

#[test]
fn a_million_rays_at_edges_and_vertices_leak_none() {
    let hit = |name: &str, built: &Built, query: &Query| {
        let world = built.world();
        let found = closest(&world, query);
        if found.is_none() || !any(&world, query) {
            println!("{name}: {query:?} leaks");
        }
        found.is_some() && any(&world, query)
    };
    assert_eq!(leaks(&closed_meshes(), hit), 0);
}

/// Negative control: without the tie rule (an edge function of exactly zero counts as outside), and with Möller and
/// Trumbore's test, the same rays leak. So they do run along the edges, and it is the test that closes them.
#[test]
fn other_tests_leak() {
    let brute = |world: &World, query: &Query, test: &dyn Fn(&Ray, [Vec3; 3]) -> bool| {
        let instance = &world.instances[0];
        let origin = transform_point(&instance.to_object, query.origin);
        let ray = Ray::new(origin, transform_direction(&instance.to_object, query.direction));
        (0..world.geometry.triangles.len() as u32).any(|slot| test(&ray, world.geometry.corners(slot)))
    };
    let small = &closed_meshes()[..2];
    let strict = leaks(small, |_, built, query| brute(&built.world(), query, &strict_edges));
    let moeller = leaks(small, |_, built, query| brute(&built.world(), query, &moeller_trumbore));
    println!("of 400000 rays, {strict} leak with strict edges, {moeller} with Möller-Trumbore");
    assert!(strict > 1000 && moeller > 100);
}

/// The watertight test with zero counted as outside.
fn strict_edges(ray: &Ray, corners: [Vec3; 3]) -> bool {
    let last = |p: Vec3| match ray.axis {
        2 => p,
        1 => Vec3::new(p.z, p.x, p.y),
        _ => Vec3::new(p.y, p.z, p.x),
    };
    let [a, b, c] = corners.map(|p| last(p - ray.origin)).map(|p| (p.x - ray.shear.x * p.z, p.y - ray.shear.y * p.z));
    let edge = |p: (f32, f32), q: (f32, f32)| p.0 * q.1 - p.1 * q.0;
    let (u, v, w) = (edge(c, b), edge(a, c), edge(b, a));
    (u > 0.0 && v > 0.0 && w > 0.0) || (u < 0.0 && v < 0.0 && w < 0.0)
}

fn moeller_trumbore(ray: &Ray, [a, b, c]: [Vec3; 3]) -> bool {
    let (e1, e2) = (b - a, c - a);
    let p = ray.direction.cross(e2);
    let inverse = 1.0 / e1.dot(p);
    let s = ray.origin - a;
    let q = s.cross(e1);
    let (u, v) = (s.dot(p) * inverse, ray.direction.dot(q) * inverse);
    u > 0.0 && v > 0.0 && u + v < 1.0 && e2.dot(q) * inverse > 0.0
}
