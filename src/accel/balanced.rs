//! A balanced eight-wide tree: slower to trace than a clustered one, and never deeper than `log8(n)` levels.

use std::ops::Range;

use glam::Vec3;
use obvhs::cwbvh::node::CwBvhNode;

use super::Bounds;

/// Primitives that one leaf child may hold.
const LEAF: usize = 3;

/// Nodes without planes, and the primitive of each leaf slot.
pub(super) fn build(boxes: &[Bounds]) -> (Vec<CwBvhNode>, Vec<u32>) {
    let mut pool: Vec<u32> = (0..boxes.len() as u32).collect();
    let mut nodes = vec![CwBvhNode::default()];
    let mut order = Vec::with_capacity(boxes.len());
    // Ranges of the pool that the nodes cover: appended in step with the nodes, so that children follow their parents.
    let everything = 0..boxes.len();
    let mut ranges = vec![everything];
    let mut next = 0;
    while next < nodes.len() {
        let parts = eighths(&mut pool, ranges[next].clone(), boxes);
        let mut node = CwBvhNode {
            child_base_idx: nodes.len() as u32,
            primitive_base_idx: order.len() as u32,
            ..CwBvhNode::default()
        };
        let mut offset = 0;
        for (slot, part) in parts.into_iter().enumerate() {
            if part.len() <= LEAF {
                // The count in unary above the offset of the first.
                node.child_meta[slot] = [0, 0b0010_0000, 0b0110_0000, 0b1110_0000][part.len()] | offset;
                offset += part.len() as u8;
                order.extend_from_slice(&pool[part]);
            } else {
                node.child_meta[slot] = 0b0010_0000 | (24 + slot as u8);
                node.imask |= 1 << slot;
                nodes.push(CwBvhNode::default());
                ranges.push(part);
            }
        }
        nodes[next] = node;
        next += 1;
    }
    (nodes, order)
}

/// Splits a range at the median three times over, as far as leaves are not reached.
fn eighths(pool: &mut [u32], range: Range<usize>, boxes: &[Bounds]) -> Vec<Range<usize>> {
    let mut parts = vec![range];
    for _ in 0..3 {
        let halves = parts.into_iter().map(|part| halve(pool, part, boxes));
        parts = halves.flatten().filter(|part| !part.is_empty()).collect();
    }
    parts
}

fn halve(pool: &mut [u32], range: Range<usize>, boxes: &[Bounds]) -> [Range<usize>; 2] {
    if range.len() <= LEAF {
        return [range.clone(), range.end..range.end];
    }
    let center = |i: u32| -> Vec3 { boxes[i as usize].min * 0.5 + boxes[i as usize].max * 0.5 };
    let part = &mut pool[range.clone()];
    let spread = part.iter().fold(Bounds::EMPTY, |all, &i| all.union(Bounds { min: center(i), max: center(i) }));
    let axis = (spread.max - spread.min).max_position();
    let middle = part.len() / 2;
    part.select_nth_unstable_by(middle, |&a, &b| center(a)[axis].total_cmp(&center(b)[axis]).then(a.cmp(&b)));
    [range.start..range.start + middle, range.start + middle..range.end]
}
