//! One compressed eight-wide tree over boxes, whatever the boxes.

use obvhs::BvhBuildParams;
use obvhs::bvh2::{Bvh2, reinsertion::ReinsertionOptimizer};
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::cwbvh::node::CwBvhNode;

use super::nodes::{Extent, encode_planes};
use super::{Bounds, balanced, cluster};

/// A tree over primitives.
#[derive(Debug)]
pub(super) struct Bvh {
    /// Children come after their parents.
    pub nodes: Vec<CwBvhNode>,
    /// The primitive of each leaf slot.
    pub order: Vec<u32>,
    /// `None` without primitives.
    pub extent: Option<Extent>,
}

/// Levels of binary nodes up to which obvhs is trusted with a tree: its conversion recurses once a level.
const BINARY_DEPTH: usize = 256;

/// Builds a tree of at most `depth_limit` levels of nodes.
///
/// Clustering by surface area makes the fastest trees, and on degenerate input (everything in one place, sizes that grow
/// exponentially) arbitrarily deep ones. Those are replaced by a balanced tree, which has `log8` of the count of levels.
pub(super) fn build(boxes: &[Bounds], params: &BvhBuildParams, depth_limit: u32, done: impl Fn(f64)) -> Bvh {
    if boxes.is_empty() {
        return Bvh { nodes: Vec::new(), order: Vec::new(), extent: None };
    }
    let clustered = clustered(boxes, params, &done).map(|(nodes, order)| encode(nodes, order, boxes));
    let fitting = clustered.filter(|bvh| bvh.extent.is_some_and(|e| e.depth <= depth_limit));
    let bvh = fitting.unwrap_or_else(|| {
        let (nodes, order) = balanced::build(boxes);
        encode(nodes, order, boxes)
    });
    done(1.0);
    bvh
}

fn encode(mut nodes: Vec<CwBvhNode>, order: Vec<u32>, boxes: &[Bounds]) -> Bvh {
    let extent = encode_planes(&mut nodes, &|slot| boxes[order[slot as usize] as usize]);
    Bvh { nodes, order, extent }
}

/// A clustered tree, improved and widened by obvhs. `None` if it would be too deep.
fn clustered(boxes: &[Bounds], params: &BvhBuildParams, done: &impl Fn(f64)) -> Option<(Vec<CwBvhNode>, Vec<u32>)> {
    let mut bvh2 = cluster::build(boxes, params.ploc_search_distance, params.search_depth_threshold);
    done(0.4);
    // obvhs's reinsertion has a stack of twice this.
    if binary_depth(&bvh2) <= bvh2.max_depth {
        ReinsertionOptimizer::default().run(&mut bvh2, params.reinsertion_batch_ratio, None);
    }
    done(0.7);
    if binary_depth(&bvh2) > BINARY_DEPTH {
        return None;
    }
    let bvh8 = bvh2_to_cwbvh(&bvh2, params.max_prims_per_leaf.clamp(1, 3), true, false);
    Some((bvh8.nodes, bvh8.primitive_indices))
}

fn binary_depth(bvh: &Bvh2) -> usize {
    let mut deepest = 0;
    let mut stack = vec![(0, 1)];
    while let Some((node, depth)) = stack.pop() {
        deepest = deepest.max(depth);
        let node = &bvh.nodes[node];
        if !node.is_leaf() {
            let first = node.first_index as usize;
            stack.extend([(first, depth + 1), (first + 1, depth + 1)]);
        }
    }
    deepest
}
