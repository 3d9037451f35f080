//! Worlds and rays on which traversal is tried.

use glam::{DAffine3, DVec3, Vec3};
use stillray::oracle::traverse::Query;
use stillray::scene::Mesh;

use super::{Built, Rng, crumpled, cube, icosphere, random_soup};

/// Meshes and instances of all kinds.
pub fn worlds() -> Vec<(&'static str, Built)> {
    let rng = &mut Rng::new(1);
    let one = |mesh| Built::one(mesh);
    let meshes = |rng: &mut Rng| vec![random_soup(rng, 30, 0.5), cube(), crumpled(rng, 1, 2.0)];
    let placed = |rng: &mut Rng, n: usize, spread: f64| -> Vec<(usize, DAffine3)> {
        (0..n).map(|i| (i % 3, rng.transform(spread))).collect()
    };
    let near = placed(rng, 12, 4.0);
    let offset = DVec3::new(3e6, -5e5, 1e7);
    let far =
        near.iter().map(|(m, t)| (*m, DAffine3 { translation: t.translation + offset, ..*t })).collect::<Vec<_>>();
    vec![
        ("soup of small triangles", one(random_soup(rng, 400, 0.1))),
        ("soup of large triangles", one(random_soup(rng, 150, 2.0))),
        ("sphere", one(icosphere(2))),
        ("instances", Built::new(meshes(rng), &near, DVec3::ZERO)),
        ("instances far from the world's origin", Built::new(meshes(rng), &far, offset)),
        ("instances far from the camera", Built::new(meshes(rng), &placed(rng, 12, 50.0), DVec3::splat(100.0))),
    ]
}

/// From around the origin or from far out, in all directions, towards the axes in particular, and towards triangles.
pub fn random_query(rng: &mut Rng, built: &Built) -> Query {
    let origin = rng.cube() * rng.magnitude(0.1, 100.0);
    let primitive = rng.below(built.geometry.triangles.len()) as u32;
    let aim = built.instances.iter().position(|i| i.triangle_base <= primitive).unwrap();
    let target = built.geometry.corners(primitive)[rng.below(3)];
    let m = built.instances[rng.below(built.instances.len()).max(aim)].to_relative;
    let target = DVec3::from_array(m.map(|r| (Vec3::new(r[0], r[1], r[2]).dot(target) + r[3]).into()));
    let direction = match rng.below(4) {
        0 => rng.direction(),
        1 => DVec3::AXES[rng.below(3)] * rng.signed().signum(),
        _ => (target + rng.cube() * 0.05 - origin).normalize_or(DVec3::X),
    };
    let tmax = if rng.below(4) == 0 { rng.magnitude(0.1, 100.0) as f32 } else { f32::INFINITY };
    Query { origin: origin.as_vec3(), direction: direction.as_vec3(), tmax }
}

/// Closed meshes, star-shaped around a ball of radius 0.2.
pub fn closed_meshes() -> Vec<(&'static str, Mesh)> {
    let rng = &mut Rng::new(3);
    vec![
        ("cube", cube()),
        ("icosahedron", icosphere(0)),
        ("sphere of 1280", icosphere(3)),
        ("crumpled 320", crumpled(rng, 2, 2.0)),
        ("crumpled 20480", crumpled(rng, 5, 1.03)),
    ]
}

/// A plain and a general placement.
pub fn placements() -> Vec<DAffine3> {
    let rng = &mut Rng::new(4);
    vec![DAffine3::IDENTITY, rng.transform(3.0)]
}

/// From near the centre to a vertex or a point of an edge, one
/// ray in four along an axis or aimed by a rounded vertex itself. `m` is object to camera-relative.
pub fn aimed(rng: &mut Rng, mesh: &Mesh, m: &DAffine3) -> Query {
    let triangle = mesh.triangles[rng.below(mesh.triangles.len())];
    let k = rng.below(3);
    let [a, b] = [triangle[k], triangle[(k + 1) % 3]].map(|i| mesh.positions[i as usize].as_dvec3());
    let along = [0.0, 0.5, rng.unit()][rng.below(3)];
    let target = a + (b - a) * along;
    let inside = if rng.below(4) == 0 { DVec3::ZERO } else { rng.direction() * rng.magnitude(1e-6, 0.15) };
    let origin = m.transform_point3(inside).as_vec3();
    let direction = m.transform_point3(target).as_vec3() - origin;
    Query { origin, direction, tmax: f32::INFINITY }
}
