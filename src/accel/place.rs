//! Instances in a frame: transforms composed in f64 relative to the camera and rounded once.

use glam::{DAffine3, DVec3};

use super::{Geometry, MeshRecord};
use crate::shaders;

/// Largest entry of a matrix that the traversal's range of numbers leaves room for (2^46; `in_range` in ray.glsl).
const MAX_ENTRY: f64 = 70_368_744_177_664.0;

/// The frame's record of an instance of `mesh`, with object-to-world transforms and camera positions (metres, world space)
/// of this frame and of the last one.
///
/// A transform that cannot be inverted within range (a scale of zero, of 10^-14, or not finite) gives a record that
/// [`is_placed`] denies; [`super::Tlas::rebuild`] leaves it out and counts it.
pub fn place(
    geometry: &Geometry,
    mesh: &MeshRecord,
    (transform, camera): (&DAffine3, DVec3),
    (transform_before, camera_before): (&DAffine3, DVec3),
) -> shaders::Instance {
    let relative = relative_to(transform, camera);
    let inverse = relative.inverse();
    let determinant = relative.matrix3.determinant();
    let usable = in_range(&relative) && in_range(&inverse) && determinant != 0.0 && determinant.is_finite();
    let mut flags = 0;
    if determinant < 0.0 {
        flags |= shaders::INSTANCE_FLIPPED;
    }
    if mesh.has_alpha {
        flags |= shaders::INSTANCE_ALPHA;
    }
    shaders::Instance {
        to_relative: if usable { rows(&relative) } else { [[0.0; 4]; 3] },
        to_object: if usable { rows(&inverse) } else { [[0.0; 4]; 3] },
        previous: rows(&relative_to(transform_before, camera_before)),
        node_base: geometry.tlas_capacity + mesh.first_node,
        triangle_base: mesh.first_triangle,
        flags,
        leaf: 0,
    }
}

/// Whether a record has a usable transform: no invertible one is all zero.
pub fn is_placed(instance: &shaders::Instance) -> bool {
    instance.to_object != [[0.0; 4]; 3]
}

fn relative_to(transform: &DAffine3, camera: DVec3) -> DAffine3 {
    DAffine3 { matrix3: transform.matrix3, translation: transform.translation - camera }
}

fn in_range(m: &DAffine3) -> bool {
    // The inverse's translation is bounded with the ray, in the traversal: it may exceed the range where no ray meets it.
    m.matrix3.to_cols_array().iter().all(|x| x.abs() <= MAX_ENTRY) && m.translation.abs().max_element() <= 1e30
}

fn rows(m: &DAffine3) -> [[f32; 4]; 3] {
    let row = |i: usize| m.matrix3.row(i).extend(m.translation[i]).as_vec4().to_array();
    [row(0), row(1), row(2)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Bounds;
    use glam::{DMat3, DQuat};

    fn mesh() -> MeshRecord {
        MeshRecord {
            first_node: 5,
            node_count: 1,
            first_triangle: 7,
            triangle_count: 1,
            first_vertex: 0,
            vertex_count: 3,
            depth: 1,
            bounds: Bounds::EMPTY,
            has_alpha: true,
        }
    }

    fn placed(m: &DAffine3, camera: DVec3) -> shaders::Instance {
        let geometry = Geometry { tlas_capacity: 3, ..Geometry::default() };
        place(&geometry, &mesh(), (m, camera), (m, camera))
    }

    #[test]
    fn a_far_scene_is_placed_as_a_near_one() {
        let turn = DQuat::from_rotation_y(0.3);
        let near = DAffine3::from_scale_rotation_translation(DVec3::ONE, turn, DVec3::new(1.0, 2.0, 3.0));
        let offset = DVec3::new(1e7, -2e7, 3e7);
        let far = DAffine3 { translation: near.translation + offset, ..near };
        assert_eq!(placed(&near, DVec3::ZERO), placed(&far, offset));
        let shifted = placed(&far, offset + DVec3::X);
        assert_ne!(placed(&near, DVec3::ZERO), shifted);
        assert_eq!(shifted.to_relative[0][3], 0.0);
    }

    #[test]
    fn flags_and_bases() {
        let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let instance = placed(&mirror, DVec3::ZERO);
        assert_eq!(instance.flags, shaders::INSTANCE_FLIPPED | shaders::INSTANCE_ALPHA);
        assert_eq!((instance.node_base, instance.triangle_base), (8, 7));
        assert_eq!(placed(&DAffine3::IDENTITY, DVec3::ZERO).flags, shaders::INSTANCE_ALPHA);
    }

    #[test]
    fn singular_transforms_are_not_placed() {
        let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
        let sheared = DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::X, DVec3::Z));
        let tiny = DAffine3::from_scale(DVec3::splat(1e-15));
        let infinite = DAffine3::from_translation(DVec3::splat(f64::INFINITY));
        let no_number = DAffine3::from_scale(DVec3::splat(f64::NAN));
        for bad in [flat, sheared, tiny, infinite, no_number] {
            assert!(!is_placed(&placed(&bad, DVec3::ZERO)), "{bad:?}");
        }
        assert!(is_placed(&placed(&DAffine3::from_scale(DVec3::splat(1e-12)), DVec3::ZERO)));
    }
}
