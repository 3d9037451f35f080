//! A ray that leaves a surface does not hit the triangle that it leaves, wherever that is and however it is placed.

mod accel_support;

use accel_support::{Built, Rng, icosphere, mesh, random_soup};
use glam::{DAffine3, DVec3, Vec3};
use stillray::oracle::traverse::{
    Query, Ray, closest, hit_triangle, offset_origin, surface_point, transform_direction, transform_point,
};
use stillray::scene::Mesh;

/// Two triangles in a plane at a height.
fn plane(height: f32, size: f32) -> Mesh {
    let corner = |x: f32, z: f32| Vec3::new(x * size, height, z * size);
    mesh(vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)], vec![[0, 2, 1], [0, 3, 2]])
}

fn cases() -> Vec<(&'static str, Built)> {
    let rng = &mut Rng::new(21);
    let at = |x: f64, y: f64, z: f64| DAffine3::from_translation(DVec3::new(x, y, z));
    let turned = |rng: &mut Rng, at: DVec3| DAffine3::from_scale_rotation_translation(DVec3::ONE, rng.rotation(), at);
    vec![
        ("sphere", Built::one(icosphere(3))),
        ("plane with coordinates of 10^6", Built::one(plane(1e6, 10.0))),
        ("plane 10^6 away", Built::new(vec![plane(0.0, 10.0)], &[(0, at(3e5, 1e6, -2e5))], DVec3::ZERO)),
        ("turned plane 10^5 away", {
            let m = turned(rng, DVec3::new(1e5, -3e4, 7e4));
            Built::new(vec![plane(0.3, 5.0)], &[(0, m)], DVec3::ZERO)
        }),
        ("tiny sphere far off", {
            let m = DAffine3::from_scale_rotation_translation(DVec3::splat(1e-3), rng.rotation(), rng.cube() * 100.0);
            Built::new(vec![icosphere(2)], &[(0, m)], DVec3::ZERO)
        }),
        (
            "microscopic sphere",
            Built::one({
                let mut sphere = icosphere(2);
                sphere.positions.iter_mut().for_each(|p| *p *= 1e-9);
                sphere
            }),
        ),
        (
            "sheared, mirrored soup",
            Built::new(vec![random_soup(rng, 50, 0.5)], &[(0, rng.transform(10.0))], DVec3::ZERO),
        ),
    ]
}

/// How often a ray from a point of a triangle finds that triangle again. `scale` of the clearance is used.
fn own_hits(built: &Built, seed: u64, scale: f32) -> (usize, usize) {
    let rng = &mut Rng::new(seed);
    let world = built.world();
    let instance = &built.instances[0];
    let (mut own, mut walked) = (0, 0);
    for _ in 0..20_000 {
        let slot = rng.below(built.geometry.triangles.len()) as u32;
        let corners = built.geometry.corners(slot);
        let (mut u, mut v) = (rng.unit() as f32, rng.unit() as f32);
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        // One in eight on an edge, where neighbours meet.
        if rng.below(8) == 0 {
            u = 0.0;
        }
        let mut point = surface_point(&instance.to_relative, &instance.to_object, corners, u, v);
        point.clearance *= scale;
        // Towards all angles, grazing ones evenly in the logarithm.
        let across = rng.direction().cross(point.normal.as_dvec3()).normalize();
        let lift = rng.magnitude(1e-6, 10.0) * rng.signed().signum();
        let direction = (across + point.normal.as_dvec3() * lift).normalize().as_vec3();
        let origin = offset_origin(&point, direction);
        let ray =
            Ray::new(transform_point(&instance.to_object, origin), transform_direction(&instance.to_object, direction));
        own += usize::from(hit_triangle(&ray, corners).is_some_and(|hit| hit.t > 0.0));
        let found = closest(&world, &Query { origin, direction, tmax: f32::INFINITY });
        walked += usize::from(found.is_some_and(|hit| hit.primitive == slot));
    }
    (own, walked)
}

#[test]
fn no_ray_hits_the_triangle_that_it_leaves() {
    for (name, built) in cases() {
        assert_eq!(own_hits(&built, 1, 1.0), (0, 0), "{name}");
    }
}

/// A convex surface is left for good; a plane too: its other triangle is not hit either, across the shared edge.
#[test]
fn a_convex_surface_is_not_hit_from_outside() {
    for (name, built) in cases().iter().filter(|(name, _)| name.contains("plane")) {
        let rng = &mut Rng::new(2);
        let instance = &built.instances[0];
        for _ in 0..20_000 {
            let slot = rng.below(2) as u32;
            let (u, v) = (rng.unit() as f32 * 0.5, rng.unit() as f32 * 0.5);
            let on_edge = rng.below(2) == 0;
            let (u, v) = if on_edge { (u, 0.0) } else { (u, v) };
            let corners = built.geometry.corners(slot);
            let point = surface_point(&instance.to_relative, &instance.to_object, corners, u, v);
            let direction = (rng.direction() + point.normal.as_dvec3()).normalize().as_vec3();
            let origin = offset_origin(&point, direction);
            let found = closest(&built.world(), &Query { origin, direction, tmax: f32::INFINITY });
            assert!(found.is_none(), "{name}: {found:?}");
        }
    }
}

/// Negative control: without the clearance, rays do hit what they leave.
#[test]
fn without_clearance_they_do() {
    let hits: usize = cases().iter().map(|(_, built)| own_hits(built, 1, 0.0).0).sum();
    println!("{hits} own hits without clearance");
    assert!(hits > 1000);
}

/// The clearance is of the order of the rounding: it does not show.
#[test]
fn the_clearance_is_small() {
    for (name, built) in cases() {
        let instance = &built.instances[0];
        for slot in 0..built.geometry.triangles.len() as u32 {
            let point =
                surface_point(&instance.to_relative, &instance.to_object, built.geometry.corners(slot), 0.3, 0.3);
            // 30 u of the distance for others, and less than 100 u for oneself where triangles are no slivers.
            let reach = point.position.abs().max_element() + point.object.abs().max_element() + 10.0;
            assert!(name.contains("soup") || point.clearance < 400.0 * 6e-8 * reach, "{name}: {point:?}");
            assert!((point.normal.length() - 1.0).abs() < 1e-6);
            assert!(point.error <= point.clearance, "{name}");
        }
    }
}
