//! Parallel locally-ordered clustering (Meister and Bittner 2018): a binary tree made from the leaves up by merging
//! neighbours along a space-filling curve that are each other's best partner.
//!
//! obvhs has this too, and is not used for it: where costs tie or grow along the curve (a row of equal fence posts, boxes
//! inside each other) every node there prefers its successor, one pair a pass agrees, and the time is quadratic: 20,000
//! triangles in a row take seconds. Here ties fall to the partner that differs in the lowest bits of its position, which is
//! mutual, and a pass in which too few agree pairs everyone with the next: the number of passes is logarithmic whatever the
//! boxes are.

use glam::DVec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, node::Bvh2Node};
use obvhs::ploc::PlocSearchDistance;
use obvhs::ploc::morton::morton_encode_u64_unorm;
use rayon::prelude::*;

use super::Bounds;

/// Nodes up to which one thread is faster than several.
const SEQUENTIAL: usize = 4096;

/// Of so many nodes at least one is merged away in each pass.
const PROGRESS: usize = 8;

/// A binary tree over the boxes, with one box a leaf. `distance` is how far along the curve partners are looked for, once
/// `near_passes` passes have looked at immediate neighbours alone.
pub(super) fn build(boxes: &[Bounds], distance: PlocSearchDistance, near_passes: usize) -> Bvh2 {
    let mut bvh = Bvh2::zeroed(boxes.len());
    bvh.primitive_indices = (0..boxes.len() as u32).collect();
    bvh.nodes.resize((2 * boxes.len()).saturating_sub(1), Bvh2Node::default());
    let mut current = leaves(boxes);
    let mut next = Vec::with_capacity(current.len() / 2);
    let mut best = vec![0; current.len()];
    // Children are stored from the end, so that they come after their parents.
    let mut free = bvh.nodes.len();
    let mut passes = 0;
    while current.len() > 1 {
        let reach = if passes < near_passes { 1 } else { reach_of(distance) };
        best.truncate(current.len());
        choose(&current, &mut best, reach);
        merge(&current, &best, &mut next, &mut bvh.nodes, &mut free);
        std::mem::swap(&mut current, &mut next);
        passes += 1;
    }
    if let (Some(root), Some(last)) = (bvh.nodes.first_mut(), current.first()) {
        *root = *last;
    }
    bvh.children_are_ordered_after_parents = true;
    bvh
}

fn reach_of(distance: PlocSearchDistance) -> usize {
    match distance {
        PlocSearchDistance::Minimum => 1,
        PlocSearchDistance::VeryLow => 2,
        PlocSearchDistance::Low => 6,
        PlocSearchDistance::Medium => 14,
        PlocSearchDistance::High => 24,
        PlocSearchDistance::VeryHigh => 32,
    }
}

/// The boxes as leaves, in Morton order of their centres.
fn leaves(boxes: &[Bounds]) -> Vec<Bvh2Node> {
    let all = boxes.iter().fold(Bounds::EMPTY, |all, &b| all.union(b));
    let (origin, extent) = (all.min.as_dvec3(), (all.max - all.min).as_dvec3());
    let scale = DVec3::select(extent.cmpgt(DVec3::ZERO), 1.0 / extent, DVec3::ZERO);
    let code = |b: &Bounds| morton_encode_u64_unorm(((b.min.as_dvec3() + b.max.as_dvec3()) * 0.5 - origin) * scale);
    let mut codes: Vec<(u64, u32)> = boxes.par_iter().zip(0..boxes.len() as u32).map(|(b, i)| (code(b), i)).collect();
    codes.par_sort_unstable();
    let leaf = |&(_, i): &(u64, u32)| {
        let b = boxes[i as usize];
        Bvh2Node::new(Aabb { min: b.min.into(), max: b.max.into() }, 1, i)
    };
    codes.par_iter().map(leaf).collect()
}

/// The best partner of each node.
fn choose(nodes: &[Bvh2Node], best: &mut [u32], reach: usize) {
    if nodes.len() < SEQUENTIAL {
        best.iter_mut().enumerate().for_each(|(i, b)| *b = partner(nodes, i, reach));
    } else {
        best.par_iter_mut().with_min_len(SEQUENTIAL / 4).enumerate().for_each(|(i, b)| *b = partner(nodes, i, reach));
    }
    let mutual = best.iter().enumerate().filter(|&(i, &b)| best[b as usize] as usize == i).count() / 2;
    if mutual * PROGRESS < nodes.len() {
        let last = nodes.len() as u32 - 1;
        best.iter_mut().zip(0u32..).for_each(|(b, i)| *b = if i ^ 1 > last { i } else { i ^ 1 });
    }
}

fn partner(nodes: &[Bvh2Node], i: usize, reach: usize) -> u32 {
    let own = nodes[i].aabb();
    let range = i.saturating_sub(reach)..(i + reach + 1).min(nodes.len());
    let mut best = (f32::INFINITY, usize::MAX);
    for j in range {
        if j == i {
            continue;
        }
        let cost = own.union(nodes[j].aabb()).half_area();
        if cost < best.0 || (cost == best.0 && i ^ j < best.1) {
            best = (cost, i ^ j);
        }
    }
    (i ^ best.1) as u32
}

/// Replaces mutual partners by their parent, which takes the place of the first; the others stay.
fn merge(current: &[Bvh2Node], best: &[u32], next: &mut Vec<Bvh2Node>, nodes: &mut [Bvh2Node], free: &mut usize) {
    next.clear();
    for (i, node) in current.iter().enumerate() {
        let j = best[i] as usize;
        if best[j] as usize != i || i == j {
            next.push(*node);
        } else if i < j {
            *free -= 2;
            nodes[*free] = *node;
            nodes[*free + 1] = current[j];
            next.push(Bvh2Node::new(node.aabb().union(current[j].aabb()), 0, *free as u32));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn depth(bvh: &Bvh2, node: usize) -> usize {
        let node = &bvh.nodes[node];
        if node.is_leaf() {
            return 1;
        }
        let first = node.first_index as usize;
        1 + depth(bvh, first).max(depth(bvh, first + 1))
    }

    /// Each pass leaves at most 7/8 of the nodes, rounded up, and adds a level at most: a tree deeper than the passes that
    /// this allows took more of them. One merge a pass would be thousands of levels deep.
    #[test]
    fn passes_are_logarithmic_where_costs_tie_or_nest() {
        let unit = |at: Vec3, size: f32| Bounds { min: at, max: at + size };
        let row: Vec<Bounds> = (0..5000).map(|i| unit(Vec3::X * i as f32, 1.0)).collect();
        let nested: Vec<Bounds> = (0..5000).map(|i| unit(Vec3::ZERO, i as f32)).collect();
        let same = vec![unit(Vec3::ONE, 1.0); 5000];
        for boxes in [row, nested, same] {
            for distance in [PlocSearchDistance::Minimum, PlocSearchDistance::Medium] {
                let bvh = build(&boxes, distance, 3);
                let passes = (5000_f64.ln() / (8.0_f64 / 7.0).ln()).ceil() as usize + 8;
                assert!(depth(&bvh, 0) <= passes + 1, "{}", depth(&bvh, 0));
            }
        }
    }

    #[test]
    fn every_box_becomes_a_leaf_within_its_ancestors() {
        let boxes: Vec<Bounds> = (0..999u32)
            .map(|i| {
                let p = Vec3::new((i * 37 % 101) as f32, (i * 53 % 89) as f32, (i * 71 % 97) as f32);
                Bounds { min: p, max: p + 1.0 + (i % 7) as f32 }
            })
            .collect();
        let bvh = build(&boxes, PlocSearchDistance::Low, 1);
        let mut seen = vec![false; boxes.len()];
        let mut stack = vec![0];
        while let Some(i) = stack.pop() {
            let node: &Bvh2Node = &bvh.nodes[i];
            let first = node.first_index as usize;
            if node.is_leaf() {
                assert!(!std::mem::replace(&mut seen[first], true));
                continue;
            }
            for child in [first, first + 1] {
                assert!(child > i || i == 0);
                assert_eq!(node.aabb().union(bvh.nodes[child].aabb()), *node.aabb());
                stack.push(child);
            }
        }
        assert!(seen.iter().all(|&s| s));
    }
}
