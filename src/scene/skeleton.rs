//! Where a skin puts its mesh: the space that the instance's transform places, and the joints in it.

use glam::{DAffine3, DMat3, DVec3};

use super::Skin;

/// Largest product of the norms of a matrix and its inverse (1 for what turns and scales evenly, times 3 for the norm used)
/// at which a joint's transform still is a good space to round positions to f32 in: it can cost ten of the 24 bits.
const MAX_CONDITION: f64 = 3.0 * 1024.0;

/// Norms of a placing matrix beyond which its inverse leaves the range of the traversal's numbers.
const SCALES: std::ops::RangeInclusive<f64> = 1e-30..=1e30;

impl Skin {
    /// The object-to-world transform of a mesh that the skin bends, and what each joint does to the mesh in object space.
    ///
    /// By the specification joints take the mesh to the world, whatever its own node does. To round positions to f32 in
    /// the world would lose them far from its origin. So object space is where the joint nearest to the root takes the
    /// mesh's own space: coordinates are of the size of those in the file however far the skeleton has gone, they equal them
    /// in the pose in which the mesh was bound, and what follows that joint stands still. A joint whose transform is singular
    /// or nearly so is passed over; if none is left, object space is the world's, moved to the first joint's mesh origin.
    pub(super) fn place(&self, globals: &[DAffine3]) -> (DAffine3, Vec<DAffine3>) {
        let bound: Vec<Bound> =
            self.joints.iter().zip(&self.inverse_bind).map(|(&j, b)| Bound::new(&globals[j], b)).collect();
        let (object, origin) = self.object_space(&bound);
        let inverse = object.inverse();
        let relative = |joint: &Bound| {
            // The same to the last bit, so that what follows the joint of the object space does not tremble.
            if joint.linear == object && joint.offset == origin.offset && joint.at == origin.at {
                return DAffine3::IDENTITY;
            }
            // The difference first: it is exact where both are far from the world's origin.
            let translation = inverse * ((joint.offset - origin.offset) + (joint.at - origin.at));
            DAffine3 { matrix3: inverse * joint.linear, translation }
        };
        let joints = bound.iter().map(relative).collect();
        (DAffine3 { matrix3: object, translation: origin.offset + origin.at }, joints)
    }

    /// The linear part of object space, and what has its origin.
    fn object_space(&self, bound: &[Bound]) -> (DMat3, Bound) {
        let usable = (0..bound.len()).filter(|&joint| is_well_conditioned(&bound[joint].linear));
        // Parents come before their children: the least node is the nearest to the root.
        match usable.min_by_key(|&joint| self.joints[joint]) {
            Some(joint) => (bound[joint].linear, bound[joint]),
            None => (DMat3::IDENTITY, bound.first().copied().unwrap_or_default()),
        }
    }
}

/// Where a joint takes the space of the mesh: `linear * p + offset + at`, not added up, because only `at` is far from the
/// world's origin.
#[derive(Clone, Copy, Default)]
struct Bound {
    linear: DMat3,
    offset: DVec3,
    at: DVec3,
}

impl Bound {
    fn new(joint: &DAffine3, inverse_bind: &DAffine3) -> Self {
        let linear = joint.matrix3 * inverse_bind.matrix3;
        Self { linear, offset: joint.matrix3 * inverse_bind.translation, at: joint.translation }
    }
}

/// Written so that what is not a number fails.
fn is_well_conditioned(m: &DMat3) -> bool {
    let norm = |m: &DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    let size = norm(m);
    SCALES.contains(&size) && size * norm(&m.inverse()) <= MAX_CONDITION
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    fn skin(joints: usize) -> Skin {
        let inverse_bind = vec![DAffine3::IDENTITY; joints];
        Skin { name: String::new(), joints: (0..joints).collect(), inverse_bind }
    }

    #[test]
    fn a_skeleton_that_moves_as_one_leaves_the_mesh_as_it_is() {
        let m = DAffine3::from_scale_rotation_translation(
            DVec3::new(0.01, 0.02, -0.01),
            DQuat::from_rotation_x(1.0),
            DVec3::splat(1e7),
        );
        let (object, joints) = skin(3).place(&[m; 3]);
        assert_eq!((object, joints), (m, vec![DAffine3::IDENTITY; 3]));
    }

    #[test]
    fn object_space_is_exact_far_from_the_origin() {
        let far = DVec3::new(1e12, -3e11, 7e10);
        let place = |offset: DVec3| {
            let bent = DAffine3::from_rotation_translation(DQuat::from_rotation_z(0.3), DVec3::Y * 2.0 + offset);
            skin(2).place(&[DAffine3::from_translation(offset), bent])
        };
        let ((_, near), (object, away)) = (place(DVec3::ZERO), place(far));
        assert_eq!(object.translation, far);
        // 2 + 3e11 is exact in f64.
        assert_eq!(near, away);
    }

    #[test]
    fn a_collapsed_joint_is_passed_over() {
        let (flat, turned) = (DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)), DAffine3::from_rotation_y(1.0));
        let (object, joints) = skin(2).place(&[flat, turned]);
        assert_eq!(object, turned);
        assert!(joints.iter().all(DAffine3::is_finite));
        for bad in [0.0, 1e-200, 1e200] {
            let collapsed = DAffine3 { translation: DVec3::ONE, ..DAffine3::from_scale(DVec3::splat(bad)) };
            let (object, joints) = skin(2).place(&[collapsed; 2]);
            assert_eq!(object, DAffine3::from_translation(DVec3::ONE), "{bad}");
            assert_eq!(joints[1].matrix3, collapsed.matrix3);
        }
        assert_eq!(skin(0).place(&[]), (DAffine3::IDENTITY, Vec::new()));
    }
}
