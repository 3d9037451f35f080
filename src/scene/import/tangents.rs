//! Tangents by MikkTSpace, for what glTF files leave to the renderer.

use std::collections::HashMap;

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Affine2, DVec2, Vec2, Vec3, Vec4};

use super::geometry::{any_tangent, unit, with_corner_tangents};
use crate::scene::Mesh;

/// The generator recurses once, and compares all pairs, for the triangles around a vertex: beyond this many (the tip
/// of a hostile fan) each triangle takes the tangent of its own texture mapping instead.
const MAX_FAN: u32 = 1024;

/// Gives a mesh with normals tangents along `transform * uvs`, by MikkTSpace, splitting vertices where the mapping has
/// seams. `uvs` has one a vertex.
pub(super) fn generate(mesh: Mesh, uvs: &[Vec2], transform: Affine2) -> Mesh {
    let triangles = regular_triangles(&mesh);
    let mut corners: Vec<Vec4> = Vec::with_capacity(3 * mesh.triangles.len());
    let scaled = Scaled { mesh: &mesh, positions: near_one(&mesh.positions), uvs: transformed(uvs, transform) };
    for triangle in &mesh.triangles {
        corners.extend(triangle.map(|vertex| scaled.own_tangent(*triangle, mesh.normals[vertex as usize])));
    }
    let mut sink = Sink { scaled: &scaled, triangles: &triangles, corners: &mut corners };
    // It can only fail by having nothing to do; every corner has a tangent by then.
    let _ = generate_tangents(&mut sink);
    with_corner_tangents(mesh, &corners)
}

/// Makes given tangents unit vectors with a handedness of 1 or -1; those without a direction get any.
pub(super) fn normalize(mesh: &mut Mesh) {
    for (tangent, normal) in mesh.tangents.iter_mut().zip(&mesh.normals) {
        let sign = if tangent.w < 0.0 { -1.0 } else { 1.0 };
        *tangent = unit(tangent.truncate()).map_or_else(|| any_tangent(*normal), |t| t.extend(sign));
    }
}

/// The triangles for the generator: not those with coinciding corners, which cost it quadratic time and mean nothing,
/// and not those of enormous fans.
fn regular_triangles(mesh: &Mesh) -> Vec<usize> {
    let key = |vertex: u32| (mesh.positions[vertex as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut fans = HashMap::<[u32; 3], u32>::with_capacity(mesh.positions.len());
    for &vertex in mesh.triangles.iter().flatten() {
        *fans.entry(key(vertex)).or_default() += 1;
    }
    let regular = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(key);
        a != b && b != c && c != a && [a, b, c].iter().all(|corner| fans[corner] <= MAX_FAN)
    };
    (0..mesh.triangles.len()).filter(|&t| regular(&mesh.triangles[t])).collect()
}

/// Positions with a largest component between 1 and 2, by an exact power of two: directions do not depend on scale,
/// but the generator's products would overflow or vanish.
fn near_one(positions: &[Vec3]) -> Vec<Vec3> {
    let largest = positions.iter().fold(0.0f32, |most, p| most.max(p.abs().max_element()));
    let factor = power_of_two_near_inverse(f64::from(largest));
    positions.iter().map(|p| (p.as_dvec3() * factor).as_vec3()).collect()
}

/// Texture coordinates of a magnitude near one as well, with v upwards: glTF counts it downwards, but the bitangent
/// that it wants, `cross(normal, tangent) * w`, points up in the texture.
fn transformed(uvs: &[Vec2], transform: Affine2) -> Vec<Vec2> {
    let transform = transform.as_daffine2();
    let uvs: Vec<_> = uvs.iter().map(|uv| transform.transform_point2(uv.as_dvec2())).collect();
    let largest = uvs.iter().fold(0.0f64, |most, uv| most.max(uv.abs().max_element()));
    let factor = power_of_two_near_inverse(largest) * DVec2::new(1.0, -1.0);
    uvs.into_iter().map(|uv| (uv * factor).as_vec2()).collect()
}

/// 2 to the -floor(log2(x)), or 1 for zero and what is not finite.
fn power_of_two_near_inverse(x: f64) -> f64 {
    let log = x.log2();
    if log.is_finite() { (-log.floor()).exp2() } else { 1.0 }
}

struct Scaled<'a> {
    mesh: &'a Mesh,
    positions: Vec<Vec3>,
    uvs: Vec<Vec2>,
}

impl Scaled<'_> {
    /// The tangent of one triangle's texture mapping, made perpendicular to `normal`; any if it has none.
    fn own_tangent(&self, triangle: [u32; 3], normal: Vec3) -> Vec4 {
        let [a, b, c] = triangle.map(|vertex| self.positions[vertex as usize].as_dvec3());
        let [ta, tb, tc] = triangle.map(|vertex| self.uvs[vertex as usize].as_dvec2());
        let (d1, d2) = (tb - ta, tc - ta);
        let area = d1.perp_dot(d2);
        let along_u = ((b - a) * d2.y - (c - a) * d1.y) * area.signum();
        let n = normal.as_dvec3();
        match (along_u - n * n.dot(along_u)).try_normalize() {
            Some(tangent) if area != 0.0 => tangent.as_vec3().extend(area.signum() as f32),
            _ => any_tangent(normal),
        }
    }
}

struct Sink<'a> {
    scaled: &'a Scaled<'a>,
    triangles: &'a [usize],
    corners: &'a mut [Vec4],
}

impl Sink<'_> {
    fn vertex(&self, face: usize, vert: usize) -> usize {
        self.scaled.mesh.triangles[self.triangles[face]][vert] as usize
    }
}

impl Geometry for Sink<'_> {
    fn num_faces(&self) -> usize {
        self.triangles.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        self.scaled.positions[self.vertex(face, vert)].to_array()
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        self.scaled.mesh.normals[self.vertex(face, vert)].to_array()
    }

    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        self.scaled.uvs[self.vertex(face, vert)].to_array()
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, vert: usize) {
        let Some(space) = space else { return };
        let [x, y, z, sign] = space.tangent_encoded();
        let corner = 3 * self.triangles[face] + vert;
        if let Some(tangent) = unit(Vec3::new(x, y, z)).filter(|t| t.is_finite()) {
            self.corners[corner] = tangent.extend(sign);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit square seen from +Z, with the texture upright.
    fn square(scale: f32) -> (Mesh, Vec<Vec2>) {
        let corners = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE];
        let mesh = Mesh {
            positions: corners.iter().map(|c| (*c * scale).extend(0.0)).collect(),
            normals: vec![Vec3::Z; 4],
            triangles: vec![[0, 1, 2], [2, 1, 3]],
            triangle_materials: vec![0; 2],
            ..Mesh::default()
        };
        (mesh, corners.iter().map(|c| Vec2::new(c.x, 1.0 - c.y)).collect())
    }

    #[test]
    fn an_upright_texture_has_its_tangent_along_u_and_a_positive_sign() {
        for scale in [1e-35, 1.0, 1e35] {
            let (mesh, uvs) = square(scale);
            let out = generate(mesh, &uvs, Affine2::IDENTITY);
            assert_eq!(out.tangents, [Vec4::new(1.0, 0.0, 0.0, 1.0); 4], "{scale}");
        }
        let (mesh, uvs) = square(1.0);
        let upside_down: Vec<Vec2> = uvs.iter().map(|uv| Vec2::new(uv.x, 1.0 - uv.y)).collect();
        assert_eq!(generate(mesh, &upside_down, Affine2::IDENTITY).tangents[0].w, -1.0);
    }

    #[test]
    fn the_texture_transform_turns_the_tangent() {
        let (mesh, uvs) = square(1.0);
        // u' = v, v' = -u: moving up in the picture (towards smaller v) lowers u', so that the tangent points down.
        let turned = generate(mesh, &uvs, Affine2::from_cols_array(&[0.0, -1.0, 1.0, 0.0, 0.0, 0.0]));
        for tangent in turned.tangents {
            assert!((tangent - Vec4::new(0.0, -1.0, 0.0, 1.0)).length() < 1e-6, "{tangent}");
        }
    }

    #[test]
    fn a_seam_splits_vertices() {
        let (mesh, mut uvs) = square(1.0);
        uvs[3] = Vec2::new(-1.0, 0.0); // the second triangle is mirrored
        let out = generate(mesh, &uvs, Affine2::IDENTITY);
        assert_eq!(out.positions.len(), 6);
        let sign = |t: usize| out.triangles[t].map(|v| out.tangents[v as usize].w);
        assert_eq!((sign(0), sign(1)), ([1.0; 3], [-1.0; 3]));
    }

    #[test]
    fn a_mapping_without_area_still_gives_unit_tangents() {
        let (mesh, _) = square(1.0);
        let out = generate(mesh, &[Vec2::splat(0.5); 4], Affine2::IDENTITY);
        for (tangent, normal) in out.tangents.iter().zip(&out.normals) {
            let t = tangent.truncate();
            // Both vectors are unit ones rounded to f32: their dot product is off by a few 2^-24.
            assert!((t.length() - 1.0).abs() < 1e-6 && t.dot(*normal).abs() < 1e-6 && tangent.w.abs() == 1.0);
        }
    }

    /// `n` triangles around a point, their texture coordinates being their coordinates.
    fn fan(n: u32) -> (Mesh, Vec<Vec2>) {
        let rim = (0..=n).map(|i| Vec2::from_angle(i as f32 / (n + 1) as f32 * std::f32::consts::TAU));
        let uvs: Vec<Vec2> = std::iter::once(Vec2::ZERO).chain(rim).collect();
        let mesh = Mesh {
            positions: uvs.iter().map(|uv| Vec3::new(uv.x, -uv.y, 0.0)).collect(),
            normals: vec![Vec3::Z; uvs.len()],
            triangles: (1..=n).map(|i| [0, i + 1, i]).collect(),
            triangle_materials: vec![0; n as usize],
            ..Mesh::default()
        };
        (mesh, uvs)
    }

    #[test]
    fn an_enormous_fan_neither_overflows_the_stack_nor_takes_forever() {
        for n in [MAX_FAN, MAX_FAN + 1, 200_000] {
            let (mesh, uvs) = fan(n);
            let out = generate(mesh, &uvs, Affine2::IDENTITY);
            // u runs along x everywhere. The rim's edges are 3e-5 long, in coordinates of which each has an error of
            // 6e-8: the direction is known to about 1e-2.
            let along_x = |t: &Vec4| (*t - Vec4::new(1.0, 0.0, 0.0, 1.0)).length() < 2e-2;
            assert!(out.tangents.iter().all(along_x), "{n}");
        }
    }
}
