//! The f32 walk agrees with exhaustive search in f64, within derived bounds (`oracle::traverse::reference`).

mod accel_support;

use accel_support::{Built, Rng, crumpled, cube, icosphere, random_soup};
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;
use stillray::oracle::traverse::reference::{disagreement, intersect, is_sure};
use stillray::oracle::traverse::{Query, any, closest};

fn worlds() -> Vec<(&'static str, Built)> {
    let rng = &mut Rng::new(1);
    let one = |mesh| Built::one(mesh);
    let meshes = |rng: &mut Rng| vec![random_soup(rng, 30, 0.5), cube(), crumpled(rng, 1)];
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
fn random_query(rng: &mut Rng, built: &Built) -> Query {
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

#[test]
fn closest_hits_agree_with_exhaustive_search() {
    for (name, built) in worlds() {
        let world = built.world();
        let checked: Vec<(bool, bool)> = (0..4000u64)
            .into_par_iter()
            .map(|i| {
                let query = random_query(&mut Rng::new(i + 1), &built);
                let found = closest(&world, &query);
                if let Some(problem) = disagreement(&world, &query, found.as_ref()) {
                    panic!("{name}, ray {i} {query:?}: {problem}");
                }
                assert_eq!(any(&world, &query), found.is_some(), "{name}, ray {i}");
                let sure = found.is_some_and(|hit| {
                    let instance = &built.instances[hit.instance as usize];
                    is_sure(&intersect(instance, built.geometry.corners(hit.primitive), &query).unwrap())
                });
                (found.is_some(), sure)
            })
            .collect();
        let hits = checked.iter().filter(|c| c.0).count();
        let sure = checked.iter().filter(|c| c.1).count();
        println!("{name}: {hits} of {} rays hit, {sure} of them surely", checked.len());
        // The check must have something to check: bounds so wide that nothing is sure would pass everything.
        assert!(hits > 400 && sure * 10 > hits * 9, "{name}: {hits} hits, {sure} sure");
    }
}

/// Negative control: the check notices a hit that is missing, a nearer one that is passed over, and a t that is off by
/// a thousandth.
#[test]
fn the_check_notices_wrong_answers() {
    let built = Built::one(icosphere(2));
    let world = built.world();
    let query = Query { origin: Vec3::new(0.1, 0.2, 3.0), direction: Vec3::NEG_Z, tmax: f32::INFINITY };
    let hit = closest(&world, &query).unwrap();
    let back = closest(&world, &Query { origin: Vec3::new(0.1, 0.2, 0.0), ..query }).unwrap();
    let far = stillray::oracle::traverse::Intersection { t: back.t + 3.0, ..back };
    assert!(disagreement(&world, &query, Some(&hit)).is_none());
    assert!(disagreement(&world, &query, None).unwrap().contains("misses"));
    assert!(disagreement(&world, &query, Some(&far)).unwrap().contains("misses"));
    let off = stillray::oracle::traverse::Intersection { t: hit.t * 1.001, ..hit };
    assert!(disagreement(&world, &query, Some(&off)).unwrap().contains("against"));
}

/// Mirrored and stretched copies give the same hits, and equally near ones the lower instance, in whatever order they come.
#[test]
fn ties_go_to_the_lower_instance() {
    let rng = &mut Rng::new(5);
    let same = DAffine3::from_translation(DVec3::new(0.0, 0.0, -5.0));
    let others: Vec<(usize, DAffine3)> = (0..40).map(|_| (0, rng.transform(30.0))).collect();
    let mut placed = vec![(0, same); 3];
    placed.extend(others);
    let rotated: Vec<_> = placed[1..].iter().chain(&placed[..1]).copied().collect();
    let query = Query { origin: Vec3::ZERO, direction: Vec3::new(0.1, 0.05, -1.0), tmax: f32::INFINITY };
    let at = |placed: &[(usize, DAffine3)]| {
        let built = Built::new(vec![icosphere(1)], placed, DVec3::ZERO);
        closest(&built.world(), &query).unwrap()
    };
    let (first, second) = (at(&placed), at(&rotated));
    assert_eq!((first.t, first.primitive), (second.t, second.primitive));
    assert!(first.instance == 0 || first.instance > 2, "{first:?}");
    assert_eq!(second.instance, if first.instance == 0 { 0 } else { first.instance - 1 });
}
