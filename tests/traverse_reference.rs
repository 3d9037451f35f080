//! The f32 walk agrees with exhaustive search in f64, within derived bounds (`oracle::traverse::reference`).

mod accel_support;

use accel_support::rays::{random_query, worlds};
use accel_support::{Built, Rng, icosphere};
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;
use stillray::oracle::traverse::reference::{disagreement, intersect, is_sure};
use stillray::oracle::traverse::{Intersection, Query, any, closest};

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
    let far = Intersection { t: back.t + 3.0, ..back };
    assert!(disagreement(&world, &query, Some(&hit)).is_none());
    assert!(disagreement(&world, &query, None).unwrap().contains("misses"));
    assert!(disagreement(&world, &query, Some(&far)).unwrap().contains("misses"));
    let off = Intersection { t: hit.t * 1.001, ..hit };
    assert!(disagreement(&world, &query, Some(&off)).unwrap().contains("against"));
}

/// Of three instances in one place the lowest is hit. Rays in opposite directions visit children in opposite orders, so
/// one of the two meets the highest first.
#[test]
fn ties_go_to_the_lower_instance() {
    let rng = &mut Rng::new(5);
    let same = DAffine3::from_translation(DVec3::new(0.0, 0.0, -5.0));
    let ahead = Query { origin: Vec3::ZERO, direction: Vec3::new(0.1, 0.05, -1.0), tmax: f32::INFINITY };
    let back = Query { origin: ahead.direction * 10.0, direction: -ahead.direction, ..ahead };
    let alone = Built::new(vec![icosphere(1)], &[(0, same)], DVec3::ZERO);
    for first in 0..20 {
        let mut placed: Vec<(usize, DAffine3)> =
            (0..60).map(|_| (0, DAffine3::from_translation(DVec3::Z * -1e3) * rng.transform(30.0))).collect();
        for i in [first, first + 7, first + 20] {
            placed[i] = (0, same);
        }
        let built = Built::new(vec![icosphere(1)], &placed, DVec3::ZERO);
        for query in [ahead, back] {
            let (expected, found) = (closest(&alone.world(), &query), closest(&built.world(), &query));
            let expected = expected.map(|hit| Intersection { instance: first as u32, ..hit });
            assert!(found.is_some());
            assert_eq!(found, expected);
        }
    }
}
