//! The planes of compressed nodes, encoded so that they are conservative, which obvhs's own are not always: it finds a
//! node's exponent by a rounded logarithm and clamps what then does not fit, which can leave a box short of its content by a
//! few units in the last place, and by more when exponents are large.

use obvhs::cwbvh::node::CwBvhNode;

use super::Bounds;

/// Biased exponent below which no plane distance goes (2^-60 m): the traversal's products stay out of the denormal range,
/// which GPUs flush to zero.
const LEAST_EXPONENT: i32 = 127 - 60;

/// What walking a tree tells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    /// Of everything below.
    pub bounds: Bounds,
    /// Levels of nodes, 1 for a lone root.
    pub depth: u32,
    /// Half the surface of the boxes below, those of leaves once a primitive, in square metres: what tracing costs, by the
    /// surface-area heuristic, once it is divided by half the surface of the whole.
    pub area: f64,
}

impl Extent {
    const EMPTY: Self = Self { bounds: Bounds::EMPTY, depth: 0, area: 0.0 };

    /// The boxes that a random ray through the whole meets, on average; 1 if nothing has an area.
    pub fn cost(&self) -> f64 {
        let whole = half_area(self.bounds);
        if whole > 0.0 { self.area / whole } else { 1.0 }
    }
}

fn half_area(bounds: Bounds) -> f64 {
    if bounds.is_empty() {
        return 0.0;
    }
    let size = bounds.max.as_dvec3() - bounds.min.as_dvec3();
    size.x * size.y + size.y * size.z + size.z * size.x
}

/// Encodes the planes of all nodes anew from the boxes of the leaf slots, from the leaves up: the children of a node come
/// after it. Returns the root's extent, or `None` without a node.
pub(super) fn encode_planes(nodes: &mut [CwBvhNode], slots: &impl Fn(u32) -> Bounds) -> Option<Extent> {
    let mut extents = vec![Extent::EMPTY; nodes.len()];
    for (i, node) in nodes.iter_mut().enumerate().rev() {
        let children = std::array::from_fn(|slot| child_extent(node, slot, &extents, slots));
        extents[i] = encode_node(node, &children);
    }
    extents.first().copied()
}

fn child_extent(node: &CwBvhNode, slot: usize, extents: &[Extent], slots: &impl Fn(u32) -> Bounds) -> Option<Extent> {
    if node.is_child_empty(slot) {
        return None;
    }
    if !node.is_leaf(slot) {
        return extents.get(node.child_node_index(slot) as usize).copied();
    }
    let (first, count) = node.child_primitives(slot);
    let bounds = (first..first + count).fold(Bounds::EMPTY, |all, slot| all.union(slots(slot)));
    Some(Extent { bounds, depth: 0, area: half_area(bounds) * f64::from(count) })
}

fn encode_node(node: &mut CwBvhNode, children: &[Option<Extent>; 8]) -> Extent {
    let present = children.iter().flatten();
    let bounds = present.clone().fold(Bounds::EMPTY, |all, c| all.union(c.bounds));
    let depth = 1 + present.clone().map(|c| c.depth).max().unwrap_or(0);
    let area = half_area(bounds) + present.map(|c| c.area).sum::<f64>();
    if bounds.is_empty() {
        return Extent { bounds, depth, area };
    }
    node.p = bounds.min;
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    for axis in 0..3 {
        let exponent = exponent_for(max[axis] - min[axis]);
        node.e[axis] = exponent as u8;
        // The reciprocal of a power of two is exact.
        let steps = 1.0 / f64::from(f32::from_bits((exponent as u32) << 23));
        let (lower, upper) = match axis {
            0 => (&mut node.child_min_x, &mut node.child_max_x),
            1 => (&mut node.child_min_y, &mut node.child_max_y),
            _ => (&mut node.child_min_z, &mut node.child_max_z),
        };
        for (slot, child) in children.iter().enumerate() {
            let Some(child) = child else { continue };
            // Differences of f32 in f64, scaled by a power of two: exact unless their exponents are 2^29 apart, and then
            // wrong by 2^-53, which the tolerance of the box test swallows a hundred million times.
            lower[slot] = ((f64::from(child.bounds.min[axis]) - min[axis]) * steps) as u8;
            upper[slot] = ceil((f64::from(child.bounds.max[axis]) - min[axis]) * steps);
        }
    }
    Extent { bounds, depth, area }
}

/// Rounds up what is in 0..=255. `f64::ceil` is a call on the least of the x86-64 processors that this is compiled for.
fn ceil(x: f64) -> u8 {
    let whole = x as u8;
    whole.saturating_add(u8::from(x > f64::from(whole)))
}

/// 2 to a power in -1022..=1023.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

/// The biased f32 exponent of the least power of two of which 255 cover `extent`.
fn exponent_for(extent: f64) -> i32 {
    let bits = (extent / 255.0).to_bits();
    // Rounding up to a power of two: the exponent alone if no bit of the fraction is set.
    let unbiased = (bits >> 52) as i32 - 1023 + i32::from(bits & ((1 << 52) - 1) != 0);
    // The quotient was rounded: when it fell on a power of two from above, 255 steps are short by 2^-53 of themselves.
    let short = 255.0 * power_of_two(unbiased.max(-200)) < extent;
    (unbiased + i32::from(short) + 127).clamp(LEAST_EXPONENT, 254)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_cover_and_are_least() {
        for k in [-50, -3, 0, 7, 40] {
            let step = f64::powi(2.0, k);
            assert_eq!(exponent_for(255.0 * step), 127 + k);
            assert_eq!(exponent_for(255.0 * step * (1.0 + 1e-15)), 128 + k);
            assert_eq!(exponent_for(127.6 * step), 127 + k);
        }
        assert_eq!(exponent_for(0.0), LEAST_EXPONENT);
        assert_eq!(exponent_for(1e-30), LEAST_EXPONENT);
    }

    #[test]
    fn rounding_up_and_powers_are_those_of_the_standard_library() {
        for x in [0.0, 1e-300, 0.5, 1.0, 1.0 + 1e-15, 2.0 - 1e-15, 253.000001, 254.5, 255.0, 256.0] {
            assert_eq!(ceil(x), x.ceil() as u8, "{x}");
        }
        assert!((-1022..=1023).all(|e| power_of_two(e) == f64::powi(2.0, e)));
    }
}
