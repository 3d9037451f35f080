//! Which instances move while the shutter is open, in camera-relative space. Their matrices are blended, and inverted, by the
//! shaders: glsl/include/motion.glsl.

use glam::{DMat3, DVec3};

use super::is_placed;
use crate::shaders;

/// Largest condition of a matrix that a shader inverts (`INVERSE_LIMIT` in motion.glsl).
pub(super) const INVERSE_LIMIT: f64 = 1024.0;

/// Largest entry and translation that leave room in the range of numbers (2^46).
const MOST: f32 = 70_368_744_177_664.0;

/// Marks an instance that is elsewhere at other times for which the shutter is open, a part of the frame's, 0..=1.
///
/// One that a shader cannot invert where it is in this frame, sheared or scaled by very different factors across its turn, is
/// not marked: it is seen sharp rather than not at all. So is one that comes from out of range.
pub fn mark_moving(instance: &mut shaders::Instance, shutter: f64) {
    let within = |row: &[f32; 4]| row.iter().all(|entry| entry.abs() <= MOST);
    let moves = shutter > 0.0 && is_placed(instance) && instance.previous != instance.to_relative;
    if moves && instance.previous.iter().all(within) && instance.to_relative.iter().all(within) && inverts(instance) {
        instance.flags |= shaders::INSTANCE_MOVES;
    }
}

/// Whether a shader inverts this frame's matrix: its condition, as there, is half of what is allowed at most.
fn inverts(instance: &shaders::Instance) -> bool {
    let row = |i: usize| DVec3::from_slice(&instance.to_relative[i].map(f64::from));
    let size = (0..3).map(|i| row(i).abs().max_element()).fold(0.0, f64::max);
    if !(size >= 2f64.powi(-39) && size <= f64::from(MOST)) {
        return false;
    }
    let [a, b, c] = [0, 1, 2].map(|i| row(i) / size);
    let sizes = |p: DVec3, q: DVec3| {
        let (p, q) = (p.abs(), q.abs());
        DVec3::new(p.y * q.z + p.z * q.y, p.z * q.x + p.x * q.z, p.x * q.y + p.y * q.x)
    };
    let volume = DMat3::from_cols(a, b, c).determinant().abs();
    if volume < 2f64.powi(-76) {
        return false;
    }
    let spread = a.abs().dot(sizes(b, c)) / volume;
    let sums = (sizes(b, c) + sizes(c, a) + sizes(a, b)) / volume;
    let largest = [a, b, c].map(|r| r.abs().dot(sums)).into_iter().fold(0.0, f64::max);
    spread * largest <= INVERSE_LIMIT / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::{Geometry, MeshRecord, place};
    use glam::{DAffine3, DQuat};

    fn moves(before: DAffine3, now: DAffine3, shutter: f64) -> bool {
        let geometry = Geometry::default();
        let mesh = MeshRecord {
            first_node: 0,
            node_count: 1,
            first_triangle: 0,
            triangle_count: 1,
            first_vertex: 0,
            vertex_count: 3,
            depth: 1,
            bounds: crate::accel::Bounds::EMPTY,
            has_alpha: false,
        };
        let mut instance = place(&geometry, &mesh, (&now, DVec3::ZERO), (&before, DVec3::ZERO));
        mark_moving(&mut instance, shutter);
        instance.flags & shaders::INSTANCE_MOVES != 0
    }

    #[test]
    fn what_moves_is_marked_while_the_shutter_is_open() {
        let at = |scale: DVec3, x: f64| {
            DAffine3::from_scale_rotation_translation(scale, DQuat::from_rotation_y(0.3 + x), DVec3::new(x, 0.0, 0.0))
        };
        for scale in [DVec3::ONE, DVec3::splat(1e-5), DVec3::splat(1e5), DVec3::new(1e-5, 1.0, 1e5)] {
            assert!(moves(at(scale, 0.0), at(scale, 1.0), 0.5), "{scale}");
            assert!(!moves(at(scale, 1.0), at(scale, 1.0), 0.5) && !moves(at(scale, 0.0), at(scale, 1.0), 0.0));
        }
        let mirrored = at(DVec3::new(-1.0, 1.0, 1.0), 0.0);
        assert!(moves(mirrored, at(DVec3::ONE, 0.0), 1.0), "what passes through a singular matrix");
        assert!(moves(at(DVec3::ZERO, 0.0), at(DVec3::ONE, 0.0), 1.0));
        assert!(!moves(at(DVec3::ONE, 0.0), at(DVec3::ZERO, 0.0), 1.0), "is not there");
        assert!(!moves(at(DVec3::splat(1e300), 0.0), at(DVec3::ONE, 0.0), 1.0), "was out of range");
        let sheared = DAffine3::from_scale(DVec3::new(1e4, 1.0, 1.0)) * at(DVec3::ONE, 0.4);
        assert!(!moves(at(DVec3::ONE, 0.0), sheared, 1.0), "has no inverse to rely on");
    }
}
