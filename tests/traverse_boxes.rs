//! The box test is conservative: what an exact ray meets is never culled.

mod accel_support;

use accel_support::{Rng, geometry, random_soup, soup};
use glam::{DVec3, Vec3};
use proptest::prelude::*;
use stillray::accel::{Geometry, Node};
use stillray::oracle::traverse::{Ray, hit_children, in_range};

/// The planes of a child, in f64 exactly.
fn planes(node: &Node, child: usize) -> (DVec3, DVec3) {
    let byte = |word: usize, i: usize| f64::from((node[word] >> (8 * i)) & 0xff);
    let side = |upper: usize| {
        DVec3::from_array(std::array::from_fn(|axis| {
            let step = f64::from(f32::from_bits(((node[3] >> (8 * axis)) & 0xff) << 23));
            f64::from(f32::from_bits(node[axis])) + step * byte(8 + 4 * axis + 2 * upper + child / 4, child % 4)
        }))
    };
    (side(0), side(1))
}

fn meta(node: &Node, child: usize) -> u32 {
    (node[6 + child / 4] >> (8 * (child % 4))) & 0xff
}

/// Whether an f32 ray, taken exactly, meets a box at t in 0..=tmax. The quotients round by 2^-53, and so the box is taken
/// smaller by a millionth of a millionth: what is asked of the f32 test is asked surely.
fn meets(origin: DVec3, direction: DVec3, (min, max): (DVec3, DVec3), tmax: f64) -> bool {
    let (mut near, mut far) = (0.0_f64, tmax);
    for axis in 0..3 {
        if direction[axis] == 0.0 {
            if origin[axis] < min[axis] || origin[axis] > max[axis] {
                return false;
            }
            continue;
        }
        let (a, b) = ((min[axis] - origin[axis]) / direction[axis], (max[axis] - origin[axis]) / direction[axis]);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    near * (1.0 + 1e-12) <= far
}

/// The bits that the hit of a child sets.
fn bits(node: &Node, child: usize, ray: &Ray) -> u32 {
    let meta = meta(node, child);
    let inner = meta & 0x18 == 0x18;
    if inner { 1 << (24 + ((meta & 7) ^ (ray.octant & 7))) } else { (meta >> 5) << (meta & 0x1f) }
}

/// Rays on which rounding is worst: along axes, in planes of boxes, from corners, nearly parallel, from far away.
fn awkward_ray(rng: &mut Rng, node: &Node, size: f64) -> (Vec3, Vec3) {
    let pick = planes(node, rng.below(8));
    let corner = |rng: &mut Rng| {
        DVec3::from_array(std::array::from_fn(|axis| if rng.below(2) == 0 { pick.0[axis] } else { pick.1[axis] }))
    };
    let mut direction = rng.direction();
    for axis in 0..3 {
        match rng.below(6) {
            0 => direction[axis] = 0.0,
            1 => direction[axis] = -0.0,
            2 => direction[axis] *= rng.magnitude(1e-40, 1.0),
            _ => {}
        }
    }
    if direction == DVec3::ZERO {
        direction = DVec3::Y;
    }
    let mut origin = corner(rng) - direction * rng.magnitude(1e-3, 1e4) * size;
    for axis in 0..3 {
        if rng.below(4) == 0 {
            origin[axis] = corner(rng)[axis];
        }
    }
    if rng.below(3) == 0 {
        direction = corner(rng) - origin;
    }
    if direction.as_vec3() == Vec3::ZERO {
        direction = DVec3::X;
    }
    (origin.as_vec3(), direction.as_vec3())
}

fn culled(geometry: &Geometry, rng: &mut Rng, size: f64, shrink: f32) -> (usize, usize) {
    let (mut met, mut culled) = (0, 0);
    for node in geometry.nodes.iter().take(50) {
        for _ in 0..40 {
            let (origin, direction) = awkward_ray(rng, node, size);
            // The walk refuses such a ray before it meets a box: the bound does not speak of it.
            if !in_range(origin, direction) {
                continue;
            }
            let ray = Ray::new(origin, direction);
            let tmax = if rng.below(2) == 0 { f32::INFINITY } else { rng.magnitude(1e-3, 1e3) as f32 };
            for child in (0..8).filter(|&c| meta(node, c) != 0) {
                if meets(origin.as_dvec3(), direction.as_dvec3(), planes(node, child), f64::from(tmax)) {
                    met += 1;
                    let inverse = ray.inverse * Vec3::new(shrink, 1.0, 1.0);
                    let hit = hit_children(node, &Ray { inverse, ..ray }, tmax);
                    let own = bits(node, child, &ray);
                    culled += usize::from(hit & own != own);
                }
            }
        }
    }
    (met, culled)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn boxes_that_an_exact_ray_meets_are_hit(seed in any::<u64>(), scale in -12.0..5.0_f64, offset in 0.0..8.0_f64) {
        let rng = &mut Rng::new(seed);
        let size = 10f64.powf(scale);
        let away = rng.direction() * size * (10f64.powf(offset) - 1.0);
        let mut mesh = random_soup(rng, 150, 0.1);
        // Flat boxes among them.
        mesh.positions.iter_mut().take(60).for_each(|p| p.x = 0.25);
        mesh.positions.iter_mut().for_each(|p| *p = (p.as_dvec3() * size + away).as_vec3());
        let geometry = geometry(vec![mesh], &[0]);
        let (met, culled) = culled(&geometry, rng, size, 1.0);
        prop_assert!(met > 100, "only {met} boxes met: nothing was checked");
        prop_assert_eq!(culled, 0);
    }
}

/// Negative control: with a reciprocal a thousandth too small boxes are culled that must not be.
#[test]
fn a_wrong_reciprocal_culls() {
    let rng = &mut Rng::new(9);
    let geometry = geometry(vec![random_soup(rng, 150, 0.1)], &[0]);
    assert!(culled(&geometry, rng, 1.0, 0.999).1 > 0);
}

/// Children's planes hold all their triangles, and each triangle is in one leaf.
#[test]
fn planes_hold_their_triangles() {
    let rng = &mut Rng::new(11);
    for (scale, offset) in [(1.0, 0.0), (1e-9, 0.0), (1e9, 0.0), (1.0, 1e7), (255.0, 0.1), (1e-6, 1.0)] {
        let mut mesh = random_soup(rng, 500, 0.1);
        mesh.positions.iter_mut().for_each(|p| *p = *p * scale + Vec3::splat(offset));
        let geometry = geometry(vec![mesh], &[0]);
        let mut seen = vec![0; geometry.triangles.len()];
        check(&geometry, 0, (DVec3::NEG_INFINITY, DVec3::INFINITY), &mut seen);
        assert!(seen.iter().all(|&n| n == 1));
    }
}

fn check(geometry: &Geometry, index: usize, within: (DVec3, DVec3), seen: &mut [u32]) {
    let node = &geometry.nodes[index];
    let imask = node[3] >> 24;
    for child in (0..8).filter(|&c| meta(node, c) != 0) {
        let (min, max) = planes(node, child);
        // What has to be held is what the parent holds too: the planes of ancestors may be wider or narrower than these.
        let (min, max) = (min.max(within.0), max.min(within.1));
        let meta = meta(node, child);
        if imask >> child & 1 == 1 {
            let below = node[4] + (imask & ((1 << child) - 1)).count_ones();
            check(geometry, below as usize, (min, max), seen);
            continue;
        }
        let first = node[5] + (meta & 0x1f);
        for slot in first..first + (meta >> 5).count_ones() {
            seen[slot as usize] += 1;
            for corner in geometry.corners(slot).map(Vec3::as_dvec3) {
                assert!(min.cmple(corner).all() && corner.cmple(max).all(), "{corner} outside {min}..{max}");
            }
        }
    }
}

/// One triangle makes one node.
#[test]
fn a_lone_triangle_has_a_root() {
    let geometry = geometry(vec![soup([[Vec3::ZERO, Vec3::X, Vec3::Y]])], &[0]);
    assert_eq!((geometry.nodes.len(), geometry.meshes[0].depth), (1, 1));
}
