//! The f32 walk agrees with exhaustive search in f64, within derived bounds (`oracle::traverse::reference`).

mod accel_support;

use accel_support::rays::{random_query, worlds};
use accel_support::{Built, Rng, icosphere};
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;
use stillray::oracle::traverse::reference::{disagreement, intersect, is_sure};
use stillray::oracle::traverse::{Query, any, closest};

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
