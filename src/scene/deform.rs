//! Meshes that change their shape: morph targets added up, then joints blended.

use glam::{DAffine3, DMat3, DVec3, Vec3, Vec4};
use rayon::prelude::*;

use super::pose::unit;
use super::{Deformation, Mesh, MorphTarget};
use crate::accel::MAX_COORDINATE;

/// Vertices that one thread takes at a time.
const CHUNK: usize = 1024;

/// The vertices of a deformed mesh, in object space and in the mesh's order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Deformed {
    /// Metres; finite and within [`MAX_COORDINATE`].
    pub positions: Vec<Vec3>,
    /// Unit normals.
    pub normals: Vec<Vec3>,
    /// Unit tangents, perpendicular to the normals, with the handedness in w; empty if the mesh has none.
    pub tangents: Vec<Vec4>,
    /// Vertices that would be beyond [`MAX_COORDINATE`] or not finite, and were brought back into the range.
    pub out_of_range: usize,
}

/// Works out the vertices of a mesh in a deformation, into `out`, whose memory is used again.
///
/// Positions and vectors are computed in f64 and rounded once. A vertex is first displaced by the morph targets, in
/// proportion to their weights, and then moved by the sum of its joints' matrices in proportion to its weights (linear blend
/// skinning). Normals go with the inverse transpose of that sum, tangents with the sum itself; the normals of [`Mesh::flat`]
/// vertices are those of the deformed triangles. A vector that loses its direction keeps the one that it had. What the
/// deformation lacks (weights, matrices) does nothing.
///
/// Takes some 130 ns a vertex with four joints, shared among the threads of rayon. The result does not depend on their number:
/// equal deformations give the same bits, so that a mesh whose [`Deformation`] has not changed need not be deformed again.
pub fn deform(mesh: &Mesh, deformation: &Deformation, out: &mut Deformed) {
    let shaper = Shaper::new(mesh, deformation);
    let (count, has_tangents) = (mesh.positions.len(), mesh.tangents.len() == mesh.positions.len());
    out.positions.resize(count, Vec3::ZERO);
    out.normals.resize(count, Vec3::Z);
    out.tangents.resize(if has_tangents { count } else { 0 }, Vec4::X);
    let mut tangents = out.tangents.chunks_mut(CHUNK);
    let chunks = out.positions.chunks_mut(CHUNK).zip(out.normals.chunks_mut(CHUNK)).enumerate();
    let jobs: Vec<_> = chunks.map(|(i, (p, n))| (i * CHUNK, p, n, tangents.next().unwrap_or_default())).collect();
    let lost = jobs.into_par_iter().map(|(first, positions, normals, tangents)| {
        (0..positions.len()).filter(|&k| !shaper.vertex(first + k, k, positions, normals, tangents)).count()
    });
    out.out_of_range = lost.sum();
    flatten(mesh, out);
}

/// The positions alone.
pub fn positions(mesh: &Mesh, deformation: &Deformation) -> Vec<Vec3> {
    let shaper = Shaper::new(mesh, deformation);
    let all = (0..mesh.positions.len()).into_par_iter().with_min_len(CHUNK);
    all.map(|i| in_range(shaper.position(i, shaper.blend(i).as_ref())).0).collect()
}

/// A mesh in a deformation.
struct Shaper<'a> {
    mesh: &'a Mesh,
    /// Targets that have a weight.
    morphs: Vec<(f64, &'a MorphTarget)>,
    joints: &'a [DAffine3],
}

impl<'a> Shaper<'a> {
    fn new(mesh: &'a Mesh, deformation: &'a Deformation) -> Self {
        let weighed = deformation.weights.iter().copied().zip(&mesh.morph_targets);
        Self { mesh, morphs: weighed.filter(|(weight, _)| *weight != 0.0).collect(), joints: &deformation.joints }
    }

    /// Writes element `k` of the arrays; false if the position had to be brought into the range.
    fn vertex(&self, i: usize, k: usize, positions: &mut [Vec3], normals: &mut [Vec3], tangents: &mut [Vec4]) -> bool {
        let blend = self.blend(i);
        let (position, fits) = in_range(self.position(i, blend.as_ref()));
        let turn = blend.map(|m| Turn::new(m.matrix3));
        positions[k] = position;
        let normal = self.normal(i, turn.as_ref());
        normals[k] = normal.as_vec3();
        if let Some(tangent) = tangents.get_mut(k) {
            *tangent = self.tangent(i, turn.as_ref(), normal);
        }
        fits
    }

    /// The weighted mean of the matrices of the joints that a vertex follows; none if it follows none.
    fn blend(&self, i: usize) -> Option<DAffine3> {
        let mut sum = (0.0, DMat3::ZERO, DVec3::ZERO);
        for (joints, weights) in self.mesh.joints.iter().zip(&self.mesh.weights) {
            let (Some(joints), Some(weights)) = (joints.get(i), weights.get(i)) else { break };
            for (&joint, &weight) in joints.iter().zip(weights) {
                let weight = f64::from(weight);
                if let Some(m) = self.joints.get(usize::from(joint)).filter(|_| weight > 0.0) {
                    sum = (sum.0 + weight, sum.1 + m.matrix3 * weight, sum.2 + m.translation * weight);
                }
            }
        }
        let (weight, matrix3, translation) = sum;
        // The weights are rounded to f32: divided by their own sum they make a mean again.
        (weight > 0.0).then(|| DAffine3 { matrix3: matrix3 * (1.0 / weight), translation: translation / weight })
    }

    fn position(&self, i: usize, blend: Option<&DAffine3>) -> DVec3 {
        let p = self.morphed(self.mesh.positions[i], i, |target| &target.positions);
        blend.map_or(p, |m| m.transform_point3(p))
    }

    fn normal(&self, i: usize, turn: Option<&Turn>) -> DVec3 {
        let base = self.mesh.normals.get(i).copied().unwrap_or(Vec3::Z);
        let rest = unit(base.as_dvec3()).unwrap_or(DVec3::Z);
        let morphed = unit(self.morphed(base, i, |target| &target.normals)).unwrap_or(rest);
        let Some(turn) = turn else { return morphed };
        unit(turn.normal * morphed).or_else(|| unit(turn.matrix * morphed)).unwrap_or(morphed)
    }

    fn tangent(&self, i: usize, turn: Option<&Turn>, normal: DVec3) -> Vec4 {
        let base = self.mesh.tangents[i];
        let morphed = self.morphed(base.truncate(), i, |target| &target.tangents);
        let (moved, mirrored) = turn.map_or((morphed, false), |turn| (turn.matrix * morphed, turn.mirrors));
        let tangent = unit(moved).and_then(|t| perpendicular(t, normal));
        let sign = if (base.w < 0.0) != mirrored { -1.0 } else { 1.0 };
        tangent.unwrap_or_else(|| normal.any_orthonormal_vector()).as_vec3().extend(sign)
    }

    fn morphed(&self, base: Vec3, i: usize, deltas: impl Fn(&MorphTarget) -> &Vec<Vec3>) -> DVec3 {
        let displaced = self.morphs.iter().filter_map(|(weight, target)| Some((weight, deltas(target).get(i)?)));
        displaced.fold(base.as_dvec3(), |sum, (weight, delta)| sum + delta.as_dvec3() * *weight)
    }
}

/// What a blended matrix does to directions.
struct Turn {
    /// Scaled to entries of at most 1.
    matrix: DMat3,
    /// The inverse transpose times the size of the determinant, which a singular matrix has as well.
    normal: DMat3,
    mirrors: bool,
}

impl Turn {
    fn new(matrix: DMat3) -> Self {
        let largest = matrix.to_cols_array().into_iter().fold(0.0, |most, x| x.abs().max(most));
        let matrix = if largest > 0.0 { matrix * (1.0 / largest) } else { matrix };
        let (x, y, z) = (matrix.x_axis, matrix.y_axis, matrix.z_axis);
        let cofactor = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
        let mirrors = x.dot(cofactor.x_axis) < 0.0;
        Self { matrix, normal: if mirrors { -cofactor } else { cofactor }, mirrors }
    }
}

/// The part of a unit vector that is perpendicular to another, of unit length; none if hardly any is left.
fn perpendicular(v: DVec3, normal: DVec3) -> Option<DVec3> {
    let rest = v - normal * normal.dot(v);
    (rest.length() > 1e-6).then(|| rest.normalize())
}

/// The nearest position that the tree can hold, and whether that is the same.
fn in_range(p: DVec3) -> (Vec3, bool) {
    let most = DVec3::splat(f64::from(MAX_COORDINATE));
    // A comparison with what is not a number is false.
    let fits = p.abs().cmple(most).all();
    let number = DVec3::select(p.is_nan_mask(), DVec3::ZERO, p);
    (number.clamp(-most, most).as_vec3(), fits)
}

/// Gives vertices that are their triangle's alone its normal, where the triangle has an area.
fn flatten(mesh: &Mesh, out: &mut Deformed) {
    for range in &mesh.flat {
        let range = range.start as usize..range.end as usize;
        let Some((positions, normals)) = out.positions.get(range.clone()).zip(out.normals.get_mut(range.clone()))
        else {
            continue;
        };
        let triangles = positions.par_chunks_exact(3).zip(normals.par_chunks_exact_mut(3)).with_min_len(CHUNK);
        triangles.for_each(|(corners, normals)| {
            let [a, b, c] = [0, 1, 2].map(|k| corners[k].as_dvec3());
            if let Some(normal) = unit((b - a).cross(c - a)) {
                normals.fill(normal.as_vec3());
            }
        });
        let Some(tangents) = out.tangents.get_mut(range.clone()) else { continue };
        for (tangent, normal) in tangents.iter_mut().zip(&out.normals[range]) {
            let normal = normal.as_dvec3();
            let turned = perpendicular(tangent.truncate().as_dvec3(), normal);
            *tangent = turned.unwrap_or_else(|| normal.any_orthonormal_vector()).as_vec3().extend(tangent.w);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use glam::DQuat;

    use super::*;

    /// A right angle in the plane of x and y; a joint each holds two vertices, and the third is between both.
    fn two_joints() -> Mesh {
        Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![Vec3::Z; 3],
            tangents: vec![Vec4::new(1.0, 0.0, 0.0, -1.0); 3],
            triangles: vec![[0, 1, 2]],
            triangle_materials: vec![0],
            joints: [vec![[0, 1, 0, 0]; 3], Vec::new()],
            weights: [vec![[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]], Vec::new()],
            ..Mesh::default()
        }
    }

    fn shaped(mesh: &Mesh, joints: Vec<DAffine3>, weights: Vec<f64>) -> Deformed {
        let (mut out, deformation) = (Deformed::default(), Deformation { instance: 0, joints, weights });
        deform(mesh, &deformation, &mut out);
        assert_eq!(out.positions, positions(mesh, &deformation));
        out
    }

    fn bent(second: DAffine3) -> Deformed {
        shaped(&two_joints(), vec![DAffine3::IDENTITY, second], Vec::new())
    }

    #[test]
    fn nothing_changes_nothing() {
        let mesh = two_joints();
        let still = [Vec::new(), vec![DAffine3::IDENTITY; 2]].map(|joints| shaped(&mesh, joints, Vec::new()));
        for out in still {
            assert_eq!((&out.positions, &out.normals, &out.tangents), (&mesh.positions, &mesh.normals, &mesh.tangents));
            assert_eq!(out.out_of_range, 0);
        }
    }

    #[test]
    fn vertices_follow_their_joints_in_proportion() {
        let out = bent(DAffine3::from_rotation_translation(DQuat::from_rotation_x(FRAC_PI_2), DVec3::Z * 4.0));
        assert_eq!(out.positions[..2], [Vec3::ZERO, Vec3::new(1.0, 0.0, 4.0)]);
        // The mean of (0, 1, 0) and (0, 0, 5), but for a cosine of 6e-17 instead of zero.
        assert!((out.positions[2] - Vec3::new(0.0, 0.5, 2.5)).length() < 1e-7);
        assert!((out.normals[1] - Vec3::NEG_Y).length() < 1e-7, "{}", out.normals[1]);
        let between = Vec3::new(0.0, -1.0, 1.0).normalize();
        assert!((out.normals[2] - between).length() < 1e-6, "{}", out.normals[2]);
        assert_eq!(out.tangents, two_joints().tangents, "about its axis nothing turns");
    }

    #[test]
    fn normals_stay_perpendicular_where_a_joint_stretches() {
        let mut mesh = two_joints();
        let slope = Vec3::new(1.0, 0.0, 1.0).normalize();
        mesh.normals.fill(slope);
        mesh.tangents.fill(Vec4::new(slope.x, 0.0, -slope.z, 1.0));
        let out = shaped(&mesh, vec![DAffine3::from_scale(DVec3::new(3.0, 1.0, 1.0)); 2], Vec::new());
        let (normal, tangent) = (Vec3::new(1.0, 0.0, 3.0).normalize(), Vec3::new(3.0, 0.0, -1.0).normalize());
        // Unit vectors rounded to f32, before and after: each component is off by a few 2^-24.
        assert!(out.normals.iter().all(|n| (*n - normal).length() < 4e-7), "{:?}", out.normals);
        assert!(out.tangents.iter().all(|t| (t.truncate() - tangent).length() < 4e-7), "{:?}", out.tangents);
    }

    #[test]
    fn a_mirror_turns_normals_as_surfaces_and_swaps_hands() {
        let mut mesh = two_joints();
        mesh.normals.fill(Vec3::Y);
        let out = shaped(&mesh, vec![DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0)); 2], Vec::new());
        assert_eq!((out.normals[0], out.tangents[0]), (Vec3::NEG_Y, Vec4::new(1.0, 0.0, 0.0, 1.0)));
    }

    #[test]
    fn what_collapses_keeps_finite_unit_vectors() {
        let flat = DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0));
        let line = DAffine3::from_scale(DVec3::X);
        let turned = DAffine3::from_rotation_z(std::f64::consts::PI); // half-way to it nothing of x and y is left
        let nothing = DAffine3::ZERO;
        let infinite = DAffine3::from_scale(DVec3::splat(f64::INFINITY));
        let undefined = DAffine3::from_translation(DVec3::NAN);
        for joint in [flat, line, turned, nothing, infinite, undefined] {
            let out = bent(joint);
            assert!(out.positions.iter().all(|p| p.is_finite()), "{joint:?}: {out:?}");
            assert!(out.normals.iter().all(|n| (n.length() - 1.0).abs() < 4e-7), "{joint:?}: {out:?}");
            assert!(out.tangents.iter().all(|t| (t.truncate().length() - 1.0).abs() < 4e-7), "{joint:?}: {out:?}");
        }
        assert_eq!(bent(flat).normals[1], Vec3::Z);
    }

    #[test]
    fn what_leaves_the_range_is_brought_back_and_counted() {
        let out = bent(DAffine3::from_translation(DVec3::new(-1e300, 0.0, f64::NAN)));
        assert_eq!(out.positions[1], Vec3::new(-MAX_COORDINATE, 0.0, 0.0));
        assert_eq!(out.out_of_range, 2);
    }

    #[test]
    fn targets_add_up_before_joints_move() {
        let mut mesh = two_joints();
        let target = |delta: Vec3| MorphTarget { positions: vec![delta; 3], ..MorphTarget::default() };
        let turn = MorphTarget { normals: vec![Vec3::new(1.0, 0.0, -1.0); 3], ..MorphTarget::default() };
        mesh.morph_targets = vec![target(Vec3::Z), target(Vec3::X * 2.0), turn];
        let out = shaped(&mesh, vec![DAffine3::from_scale(DVec3::splat(2.0)); 2], vec![0.5, -1.0, 1.0]);
        assert_eq!(out.positions[1], Vec3::new(-2.0, 0.0, 1.0));
        assert_eq!((out.normals[0], out.tangents[0].truncate().dot(Vec3::X)), (Vec3::X, 0.0));
        assert_eq!(shaped(&mesh, Vec::new(), vec![0.0; 3]).positions, mesh.positions);
    }

    #[test]
    fn flat_normals_are_those_of_the_deformed_triangle() {
        let mut mesh = two_joints();
        mesh.flat.push(0..3);
        let up = DAffine3::from_translation(DVec3::Z);
        let out = shaped(&mesh, vec![DAffine3::IDENTITY, up], Vec::new());
        // (0,0,0), (1,0,1), (0,1,1/2)
        let normal = Vec3::new(-1.0, -0.5, 1.0).normalize();
        assert!(out.normals.iter().all(|n| (*n - normal).length() < 2e-7), "{:?}", out.normals);
        assert!(out.tangents.iter().all(|t| t.truncate().dot(normal).abs() < 2e-7 && t.w == -1.0));
        let point = shaped(&mesh, vec![DAffine3::ZERO; 2], Vec::new());
        assert_eq!(point.normals, [Vec3::Z; 3], "without an area they stay");
        mesh.flat[0].end = 900; // beyond the mesh
        assert_eq!(shaped(&mesh, Vec::new(), Vec::new()).normals, mesh.normals);
    }

    #[test]
    fn a_large_mesh_is_the_same_in_any_number_of_threads() {
        let mut mesh = two_joints();
        let count = 5 * CHUNK + 7;
        mesh.positions = (0..count).map(|i| Vec3::new(i as f32, 1.0 / (1 + i) as f32, -3.0)).collect();
        mesh.normals = vec![Vec3::Y; count];
        mesh.tangents = vec![Vec4::X; count];
        mesh.joints[0] = vec![[0, 1, 1, 0]; count];
        mesh.weights[0] = (0..count).map(|i| [0.25, 0.0, 0.75, i as f32]).collect();
        let joints = vec![DAffine3::IDENTITY, DAffine3::from_rotation_y(0.7)];
        let all = shaped(&mesh, joints.clone(), Vec::new());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(pool.install(|| shaped(&mesh, joints, Vec::new())), all);
        assert!(all.positions.iter().skip(1).all(|p| p.length() > 0.0), "every chunk is written");
    }
}
