//! The top level: every instance in one leaf, boxes that hold what rays can hit, and a rebuild that frames can afford.

mod accel_support;

use std::time::Instant;

use accel_support::{Built, Rng, icosphere, random_soup};
use glam::{DAffine3, DVec3, Vec3};
use stillray::accel::{Tlas, place};
use stillray::oracle::traverse::{Query, closest, closest_with_alpha};
use stillray::shaders;

/// Lone instances stay findable when others crowd around: hits agree with those in a world of the one instance alone.
#[test]
fn an_instance_is_hit_in_a_crowd_as_alone() {
    let rng = &mut Rng::new(31);
    let placed: Vec<(usize, DAffine3)> = (0..300).map(|i| (i % 2, rng.transform(12.0))).collect();
    let meshes = || vec![icosphere(1), random_soup(&mut Rng::new(32), 40, 0.4)];
    let crowd = Built::new(meshes(), &placed, DVec3::ZERO);
    let alone: Vec<Built> = placed.iter().map(|p| Built::new(meshes(), &[*p], DVec3::ZERO)).collect();
    let mut hits = 0;
    for _ in 0..2000 {
        let query =
            Query { origin: (rng.cube() * 15.0).as_vec3(), direction: rng.direction().as_vec3(), tmax: f32::INFINITY };
        let each = alone
            .iter()
            .enumerate()
            .filter_map(|(i, built)| closest(&built.world(), &query).map(|hit| (hit.t, i as u32, hit.primitive)));
        let nearest = each.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let found = closest(&crowd.world(), &query).map(|hit| (hit.t, hit.instance, hit.primitive));
        assert_eq!(found, nearest);
        hits += usize::from(found.is_some());
    }
    assert!(hits > 500);
}

/// Negative control: with the leaf order of another frame the hits are wrong.
#[test]
fn leaf_order_matters() {
    let rng = &mut Rng::new(33);
    let placed: Vec<(usize, DAffine3)> = (0..50).map(|_| (0, rng.transform(5.0))).collect();
    let mut built = Built::new(vec![icosphere(1)], &placed, DVec3::ZERO);
    let queries: Vec<Query> = (0..200)
        .map(|_| Query { origin: Vec3::ZERO, direction: rng.direction().as_vec3(), tmax: f32::INFINITY })
        .collect();
    let right: Vec<_> = queries.iter().map(|q| closest(&built.world(), q)).collect();
    let leaves: Vec<u32> = built.instances.iter().map(|i| i.leaf).rev().collect();
    built.instances.iter_mut().zip(leaves).for_each(|(i, leaf)| i.leaf = leaf);
    let wrong: Vec<_> = queries.iter().map(|q| closest(&built.world(), q)).collect();
    assert_ne!(right, wrong);
}

#[test]
fn each_instance_has_one_leaf_and_rebuilding_is_quick() {
    for (count, arrangement) in [(1, "one"), (10_000, "spread"), (10_000, "in a row"), (10_000, "in one place")] {
        let rng = &mut Rng::new(34);
        let placed: Vec<(usize, DAffine3)> = (0..count)
            .map(|i| match arrangement {
                "in a row" => (0, DAffine3::from_translation(DVec3::X * i as f64)),
                "in one place" => (0, DAffine3::IDENTITY),
                _ => (0, rng.transform(100.0)),
            })
            .collect();
        let mut built = Built::new(vec![icosphere(0)], &placed, DVec3::ZERO);
        let mut leaves: Vec<u32> = built.instances.iter().map(|i| i.leaf).collect();
        leaves.sort_unstable();
        assert!(leaves.iter().enumerate().all(|(i, &leaf)| i == leaf as usize), "{arrangement}");
        assert!(built.tlas.nodes.len() <= built.geometry.tlas_capacity as usize, "{arrangement}");
        assert!(built.tlas.depth + built.geometry.meshes[0].depth + 2 <= shaders::TRAVERSAL_STACK, "{arrangement}");
        let before = built.tlas.nodes.clone();
        let start = Instant::now();
        built.tlas.rebuild(&built.geometry, &mut built.instances);
        println!("{count} instances, {arrangement}: rebuilt in {:?}, {} nodes", start.elapsed(), before.len());
        assert_eq!(before, built.tlas.nodes);
    }
}

/// Alpha is asked for masked instances alone, and what is not there is looked through.
#[test]
fn masked_surfaces_are_looked_through() {
    let placed = [(0, DAffine3::from_translation(DVec3::Z * -3.0)), (0, DAffine3::from_translation(DVec3::Z * -9.0))];
    let mut built = Built::new(vec![icosphere(1)], &placed, DVec3::ZERO);
    let query = Query { origin: Vec3::ZERO, direction: Vec3::new(0.01, 0.02, -1.0), tmax: f32::INFINITY };
    let absent = |built: &Built| closest_with_alpha(&built.world(), &query, &|_| false);
    let opaque = closest(&built.world(), &query);
    assert_eq!(absent(&built), opaque);
    built.instances[0].flags |= shaders::INSTANCE_ALPHA;
    assert_eq!(absent(&built).map(|hit| hit.instance), Some(1));
    let back = closest_with_alpha(&built.world(), &query, &|hit| hit.t > 3.0);
    assert_eq!(back.map(|hit| (hit.instance, hit.t > 3.0)), Some((0, true)));
    assert_eq!(closest_with_alpha(&built.world(), &query, &|_| true), opaque);
}

/// A frame that moves everything and looks from elsewhere is the scene as placed there.
#[test]
fn rebuilding_follows_the_instances() {
    let rng = &mut Rng::new(35);
    let placed: Vec<(usize, DAffine3)> = (0..20).map(|_| (0, rng.transform(5.0))).collect();
    let mut built = Built::new(vec![icosphere(1)], &placed, DVec3::ZERO);
    let moved: Vec<(usize, DAffine3)> = (0..20).map(|_| (0, rng.transform(5.0))).collect();
    let camera = DVec3::new(1.0, 2.0, 3.0);
    built.instances = moved
        .iter()
        .zip(&placed)
        .map(|((_, now), (_, before))| {
            place(&built.geometry, &built.geometry.meshes[0], (now, camera), (before, DVec3::ZERO))
        })
        .collect();
    built.tlas.rebuild(&built.geometry, &mut built.instances);
    let fresh = Built::new(vec![icosphere(1)], &moved, camera);
    for _ in 0..500 {
        let query = Query { origin: Vec3::ZERO, direction: rng.direction().as_vec3(), tmax: f32::INFINITY };
        assert_eq!(closest(&built.world(), &query), closest(&fresh.world(), &query));
    }
    let mut empty = Tlas::default();
    empty.rebuild(&built.geometry, &mut []);
    assert_eq!(empty.nodes.len(), 1);
}
