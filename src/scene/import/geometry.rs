//! Vertex arrays: gathering, merging, flat normals. Knows nothing of glTF.

use std::collections::HashMap;

use glam::{DVec3, Vec2, Vec3, Vec4};

use crate::scene::{Mesh, MorphTarget};

/// The mesh whose vertex `i` is vertex `source[i]` of `mesh`; triangles, materials and flat ranges are left out.
pub(super) fn gather(mesh: &Mesh, source: &[u32]) -> Mesh {
    fn pick<T: Copy>(values: &[T], source: &[u32]) -> Vec<T> {
        if values.is_empty() { Vec::new() } else { source.iter().map(|&i| values[i as usize]).collect() }
    }
    let target = |target: &MorphTarget| MorphTarget {
        positions: pick(&target.positions, source),
        normals: pick(&target.normals, source),
        tangents: pick(&target.tangents, source),
    };
    Mesh {
        name: mesh.name.clone(),
        positions: pick(&mesh.positions, source),
        normals: pick(&mesh.normals, source),
        tangents: pick(&mesh.tangents, source),
        uvs: [pick(&mesh.uvs[0], source), pick(&mesh.uvs[1], source)],
        colors: pick(&mesh.colors, source),
        morph_targets: mesh.morph_targets.iter().map(target).collect(),
        joints: [pick(&mesh.joints[0], source), pick(&mesh.joints[1], source)],
        weights: [pick(&mesh.weights[0], source), pick(&mesh.weights[1], source)],
        ..Mesh::default()
    }
}

/// Drops vertices that no triangle uses: files share one large array between many primitives.
pub(super) fn compact(mesh: Mesh) -> Mesh {
    let mut new_index = vec![u32::MAX; mesh.positions.len()];
    let mut source = Vec::new();
    for &vertex in mesh.triangles.iter().flatten() {
        let new = &mut new_index[vertex as usize];
        if *new == u32::MAX {
            *new = source.len() as u32;
            source.push(vertex);
        }
    }
    if source.len() == mesh.positions.len() {
        return mesh; // in its own order, which is probably a good one
    }
    let mut out = gather(&mesh, &source);
    out.triangles = mesh.triangles.iter().map(|t| t.map(|vertex| new_index[vertex as usize])).collect();
    out.triangle_materials = mesh.triangle_materials;
    out
}

/// Gives each triangle vertices of its own, with the triangle's normal (section 3.7.2.1 of the specification).
pub(super) fn with_flat_normals(mesh: Mesh) -> Mesh {
    let corners: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
    let mut out = gather(&mesh, &corners);
    out.normals = mesh.triangles.iter().flat_map(|t| [face_normal(&mesh.positions, *t); 3]).collect();
    out.triangles = (0..mesh.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    out.triangle_materials = mesh.triangle_materials;
    if out.deforms() {
        out.flat.push(0..corners.len() as u32);
    }
    out
}

/// Makes normals unit vectors; those without a direction get that of a triangle. Returns how many had none.
pub(super) fn normalize_normals(mesh: &mut Mesh) -> usize {
    let mut zero = Vec::new();
    for (index, normal) in mesh.normals.iter_mut().enumerate() {
        match unit(*normal) {
            Some(unit) => *normal = unit,
            None => zero.push(index as u32),
        }
    }
    if zero.is_empty() {
        return 0;
    }
    zero.iter().for_each(|&index| mesh.normals[index as usize] = Vec3::Z);
    for &triangle in mesh.triangles.iter().rev() {
        for vertex in triangle {
            if zero.binary_search(&vertex).is_ok() {
                mesh.normals[vertex as usize] = face_normal(&mesh.positions, triangle);
            }
        }
    }
    zero.len()
}

/// The unit normal of a triangle, counter-clockwise seen from its tip; +Z for a triangle without an area. In f64,
/// where the products of f32 neither overflow nor vanish.
pub(super) fn face_normal(positions: &[Vec3], triangle: [u32; 3]) -> Vec3 {
    let [a, b, c] = triangle.map(|vertex| positions[vertex as usize].as_dvec3());
    let cross = (b - a).cross(c - a);
    cross.try_normalize().map_or(Vec3::Z, DVec3::as_vec3)
}

/// `v` normalised in f64; none if it is zero.
pub(super) fn unit(v: Vec3) -> Option<Vec3> {
    Some(v.as_dvec3().try_normalize()?.as_vec3())
}

/// Splits vertices so that each triangle corner can have its own tangent. `corners` has three a triangle.
pub(super) fn with_corner_tangents(mesh: Mesh, corners: &[Vec4]) -> Mesh {
    let mut new_index = HashMap::<(u32, [u32; 4]), u32>::with_capacity(mesh.positions.len());
    let (mut source, mut tangents) = (Vec::new(), Vec::new());
    let mut triangles = mesh.triangles.clone();
    for (vertex, tangent) in triangles.iter_mut().flatten().zip(corners) {
        let key = (*vertex, tangent.to_array().map(f32::to_bits));
        *vertex = *new_index.entry(key).or_insert_with(|| {
            source.push(*vertex);
            tangents.push(*tangent);
            source.len() as u32 - 1
        });
    }
    let mut out = gather(&mesh, &source);
    out.tangents = tangents;
    out.triangles = triangles;
    out.triangle_materials = mesh.triangle_materials;
    out.flat = mesh.flat; // corners of their own are neither split nor put into another order
    out
}

/// Appends a part to a mesh. Arrays that only one of both has are filled up: white for colours, zero for texture
/// coordinates, and any perpendicular direction for tangents; no material of the other part reads them. Morph targets
/// that only one of both has do not move the other, nor do joints.
pub(super) fn append(mesh: &mut Mesh, part: Mesh) {
    let (before, added) = (mesh.positions.len(), part.positions.len());
    let base = before as u32;
    extend(&mut mesh.colors, part.colors, before, added, |_| Vec4::ONE);
    for (uvs, part) in mesh.uvs.iter_mut().zip(part.uvs) {
        extend(uvs, part, before, added, |_| Vec2::ZERO);
    }
    for (set, part) in mesh.joints.iter_mut().zip(part.joints) {
        extend(set, part, before, added, |_| [0; 4]);
    }
    for (set, part) in mesh.weights.iter_mut().zip(part.weights) {
        extend(set, part, before, added, |_| [0.0; 4]);
    }
    append_targets(&mut mesh.morph_targets, part.morph_targets, before, added);
    mesh.flat.extend(part.flat.into_iter().map(|range| range.start + base..range.end + base));
    mesh.positions.extend(part.positions);
    mesh.normals.extend(part.normals);
    let normals = &mesh.normals;
    extend(&mut mesh.tangents, part.tangents, before, added, |i| any_tangent(normals[i]));
    mesh.triangles.extend(part.triangles.into_iter().map(|t| t.map(|vertex| vertex + base)));
    mesh.triangle_materials.extend(part.triangle_materials);
}

fn append_targets(targets: &mut Vec<MorphTarget>, part: Vec<MorphTarget>, before: usize, added: usize) {
    targets.resize_with(targets.len().max(part.len()), MorphTarget::default);
    let part = part.into_iter().chain(std::iter::repeat_with(MorphTarget::default));
    for (target, part) in targets.iter_mut().zip(part) {
        extend(&mut target.positions, part.positions, before, added, |_| Vec3::ZERO);
        extend(&mut target.normals, part.normals, before, added, |_| Vec3::ZERO);
        extend(&mut target.tangents, part.tangents, before, added, |_| Vec3::ZERO);
    }
}

fn extend<T>(values: &mut Vec<T>, part: Vec<T>, before: usize, added: usize, filler: impl Fn(usize) -> T) {
    if values.is_empty() && part.is_empty() {
        return;
    }
    values.extend((values.len()..before).map(&filler));
    values.extend(part);
    values.extend((values.len()..before + added).map(&filler));
}

/// A right-handed tangent perpendicular to a unit normal.
pub(super) fn any_tangent(normal: Vec3) -> Vec4 {
    normal.any_orthonormal_vector().extend(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quad() -> Mesh {
        Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE, Vec3::splat(9.0)],
            triangles: vec![[0, 1, 2], [2, 1, 3]],
            triangle_materials: vec![0, 0],
            ..Mesh::default()
        }
    }

    #[test]
    fn unused_vertices_are_dropped() {
        let mesh = compact(quad());
        assert_eq!(mesh.positions.len(), 4);
        assert_eq!(mesh.positions[mesh.triangles[1][2] as usize], Vec3::ONE);
    }

    #[test]
    fn flat_normals_are_perpendicular_whatever_the_scale() {
        for scale in [1e-30f32, 1.0, 1e30] {
            let mut mesh = quad();
            mesh.positions.iter_mut().for_each(|p| *p *= scale);
            let flat = with_flat_normals(mesh);
            assert_eq!(flat.normals[0], Vec3::Z);
            // The cross product of (1,-1,0) and (1,0,1), (-1,-1,1), normalised: 1/√3 rounds to f32 once.
            assert_eq!(flat.normals[3], Vec3::new(-1.0, -1.0, 1.0) * (1.0f64 / 3.0f64.sqrt()) as f32, "{scale}");
        }
    }

    #[test]
    fn a_degenerate_triangle_has_a_finite_normal() {
        assert_eq!(face_normal(&[Vec3::ONE; 3], [0, 1, 2]), Vec3::Z);
    }

    #[test]
    fn zero_normals_take_that_of_their_triangle() {
        let mut mesh = compact(quad());
        mesh.normals = vec![Vec3::ZERO, Vec3::X * 1e-30, Vec3::Y * 1e30, Vec3::Z];
        assert_eq!(normalize_normals(&mut mesh), 1);
        assert_eq!(mesh.normals, [Vec3::Z, Vec3::X, Vec3::Y, Vec3::Z]);
    }

    #[test]
    fn parts_are_merged_and_filled_up() {
        let part = |colors: bool, tangents: bool| {
            let mut mesh = with_flat_normals(quad());
            let n = mesh.positions.len();
            mesh.colors = if colors { vec![Vec4::splat(0.5); n] } else { Vec::new() };
            mesh.tangents = if tangents { vec![Vec4::W; n] } else { Vec::new() };
            mesh
        };
        let mut mesh = Mesh::default();
        append(&mut mesh, part(false, true));
        append(&mut mesh, part(true, false));
        append(&mut mesh, part(false, false));
        assert_eq!((mesh.positions.len(), mesh.colors.len(), mesh.tangents.len()), (18, 18, 18));
        assert_eq!((mesh.colors[5], mesh.colors[6], mesh.colors[12]), (Vec4::ONE, Vec4::splat(0.5), Vec4::ONE));
        assert_eq!(mesh.tangents[5], Vec4::W);
        assert!(mesh.tangents[6].truncate().dot(mesh.normals[6]).abs() < 1e-6 && mesh.tangents[6].w == 1.0);
        assert_eq!(mesh.triangles[5], [15, 16, 17]);
        assert!(mesh.uvs[0].is_empty());
    }

    #[test]
    fn corners_with_equal_tangents_share_a_vertex() {
        let mesh = compact(quad());
        let (s, t) = (Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(0.0, 1.0, 0.0, 1.0));
        assert_eq!(with_corner_tangents(mesh.clone(), &[s; 6]).positions.len(), 4);
        let split = with_corner_tangents(mesh, &[s, s, s, t, t, t]);
        assert_eq!(split.positions.len(), 6);
        assert_eq!(split.tangents[split.triangles[1][0] as usize], t);
    }
    /// A quad whose vertex `i` is held by joint `i` and displaced to (i, 0, 0) by its only target.
    fn deforming() -> Mesh {
        let mut mesh = quad();
        let n = mesh.positions.len();
        mesh.joints[0] = (0..n as u16).map(|i| [i, 0, 0, 0]).collect();
        mesh.weights[0] = vec![[1.0, 0.0, 0.0, 0.0]; n];
        let positions = (0..n).map(|i| Vec3::X * i as f32).collect();
        mesh.morph_targets = vec![MorphTarget { positions, ..MorphTarget::default() }];
        mesh
    }

    #[test]
    fn joints_and_targets_follow_their_vertices() {
        let compacted = compact(deforming());
        let flat = with_flat_normals(compacted);
        assert_eq!((flat.flat.len(), flat.flat[0].clone()), (1, 0..6));
        let tangents: Vec<Vec4> = (0..6).map(|i| Vec4::X * (1 + i % 2) as f32).collect();
        let split = with_corner_tangents(flat, &tangents);
        let mut mesh = with_flat_normals(compact(quad()));
        append(&mut mesh, split);
        assert_eq!((mesh.flat[0].clone(), mesh.positions.len()), (6..12, 12));
        let original = deforming();
        for vertex in 6..12 {
            let source = original.positions.iter().position(|p| *p == mesh.positions[vertex]).unwrap();
            assert_eq!(mesh.joints[0][vertex], original.joints[0][source]);
            assert_eq!(mesh.weights[0][vertex], original.weights[0][source]);
            assert_eq!(mesh.morph_targets[0].positions[vertex], original.morph_targets[0].positions[source]);
        }
        assert_eq!(mesh.weights[0][..6], [[0.0; 4]; 6], "what has no joints stays");
        assert_eq!(mesh.morph_targets[0].positions[..6], [Vec3::ZERO; 6]);
        assert!(mesh.morph_targets[0].normals.is_empty() && mesh.joints[1].is_empty());
        assert!(with_flat_normals(compact(quad())).flat.is_empty(), "what is rigid needs no ranges");
    }
}
