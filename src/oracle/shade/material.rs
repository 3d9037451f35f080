//! Twin of `glsl/include/material.glsl`: from a hit to what shading needs.

use super::brdf::Reflector;
use super::pack::{decode_color, decode_normal, decode_tangent};
use super::texture::Textures;
use crate::shaders::{
    INSTANCE_FLIPPED, Instance, MATERIAL_BLEND, MATERIAL_MASK, MATERIAL_UNLIT, Material, TextureSlot, Vertex,
};
use glam::{DVec3, DVec4, Vec3, Vec4};

/// A shading point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Base colour, metalness and roughness.
    pub reflector: Reflector,
    /// 0..=1; 1 for opaque materials.
    pub alpha: f64,
    /// Radiance.
    pub emissive: DVec3,
    /// 0..=1: the part of the uniform light that arrives.
    pub occlusion: f64,
    /// The base colour is the radiance.
    pub unlit: bool,
    /// Unit shading normal, world axes, on the viewer's side.
    pub normal: DVec3,
    /// Unit geometric normal, the same.
    pub geometric: DVec3,
}

/// Texture coordinates (as rounded by the shader) and colour at a point of a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attributes {
    /// First set.
    pub uv0: [f32; 2],
    /// Second set.
    pub uv1: [f32; 2],
    /// Linear RGBA.
    pub color: DVec4,
}

/// A triangle's vertices and the barycentric weights of the second and third at the hit.
#[derive(Debug, Clone, Copy)]
pub struct Spot<'a> {
    /// The corners.
    pub vertices: [&'a Vertex; 3],
    /// Weight of the second corner.
    pub u: f32,
    /// Weight of the third corner.
    pub v: f32,
}

impl Spot<'_> {
    /// Texture coordinates and colour.
    pub fn attributes(&self) -> Attributes {
        let [a, b, c] = self.vertices;
        let w = 1.0 - self.u - self.v;
        let uv = |f: fn(&Vertex) -> [f32; 2]| {
            let (a, b, c) = (f(a), f(b), f(c));
            [0, 1].map(|k| (a[k] * w + b[k] * self.u) + c[k] * self.v)
        };
        let colors = self.vertices.map(|x| decode_color(x.color_rg, x.color_ba));
        Attributes { uv0: uv(|x| x.uv0), uv1: uv(|x| x.uv1), color: self.blend(colors) }
    }

    fn blend<T: std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T>>(&self, [a, b, c]: [T; 3]) -> T {
        let (u, v) = (f64::from(self.u), f64::from(self.v));
        a * f64::from(1.0 - self.u - self.v) + b * u + c * v
    }
}

/// Base colour and alpha, 0..=1.
pub fn base_color_at(material: &Material, at: &Attributes, textures: &Textures) -> DVec4 {
    let color = Vec4::from(material.base_color).as_dvec4() * at.color;
    (color * sample(&material.base_color_texture, at, textures, true)).clamp(DVec4::ZERO, DVec4::ONE)
}

/// The texture of a slot, or what changes nothing.
fn sample(slot: &TextureSlot, at: &Attributes, textures: &Textures, is_srgb: bool) -> DVec4 {
    if slot.texel_size == 0 { DVec4::ONE } else { textures.sample(slot, at.uv0, at.uv1, is_srgb) }
}

/// Part of what enters that passes through, 0..=1.
pub fn transmission_at(material: &Material, at: &Attributes, textures: &Textures) -> f64 {
    let part = f64::from(material.transmission * (1.0 - material.metallic.clamp(0.0, 1.0)));
    part * sample(&material.transmission_texture, at, textures, false).x.clamp(0.0, 1.0)
}

fn unit_or(v: DVec3, otherwise: DVec3) -> DVec3 {
    let size = v.abs().max_element();
    // f32's range, since that is where the shader decides.
    if (f64::from(f32::MIN_POSITIVE)..=f64::from(f32::MAX)).contains(&size) {
        (v / size).normalize()
    } else {
        otherwise
    }
}

fn row(rows: &[[f32; 4]; 3], i: usize) -> DVec3 {
    Vec4::from(rows[i]).truncate().as_dvec3()
}

/// World-space direction of an object-space normal, of any length.
pub fn normal_to_world(instance: &Instance, n: DVec3) -> DVec3 {
    (0..3).map(|i| n[i] * row(&instance.to_object, i)).sum()
}

/// World-space image of an object-space direction.
pub fn direction_to_world(instance: &Instance, d: DVec3) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|i| row(&instance.to_relative, i).dot(d)))
}

fn mapped_normal(material: &Material, instance: &Instance, map: DVec4, normal: DVec3, tangent: DVec4) -> DVec3 {
    let t = unit_or(direction_to_world(instance, tangent.truncate()), DVec3::ZERO);
    let t = t - normal * normal.dot(t);
    if t.length_squared() < 1e-6 {
        return normal;
    }
    let t = t.normalize();
    let handedness = if instance.flags & INSTANCE_FLIPPED != 0 { -tangent.w } else { tangent.w };
    let b = normal.cross(t) * handedness;
    let m = map.truncate() * 2.0 - 1.0;
    let scale = f64::from(material.normal_scale);
    unit_or(t * (m.x * scale) + b * (m.y * scale) + normal * m.z, normal)
}

/// Emitted radiance.
pub fn emission_at(material: &Material, at: &Attributes, textures: &Textures) -> DVec3 {
    Vec3::from(material.emissive).as_dvec3() * sample(&material.emissive_texture, at, textures, true).truncate()
}

/// The shading point of a hit. `geometric` is the unit world-space normal of the triangle's counter-clockwise side, `view`
/// the unit vector to the viewer.
pub fn surface_at(
    material: &Material,
    instance: &Instance,
    spot: &Spot<'_>,
    geometric: DVec3,
    view: DVec3,
    textures: &Textures,
) -> Surface {
    let at = spot.attributes();
    let base = base_color_at(material, &at, textures);
    let mr = sample(&material.metallic_roughness_texture, &at, textures, false);
    let open = sample(&material.occlusion_texture, &at, textures, false).x;
    let n = spot.blend(spot.vertices.map(|x| decode_normal(x.normal)));
    let mut normal = unit_or(normal_to_world(instance, unit_or(n, DVec3::ZERO)), geometric);
    if material.normal_texture.texel_size != 0 {
        let tangents = spot.vertices.map(|x| decode_tangent(x.tangent));
        let tangent = spot.blend(tangents.map(DVec4::truncate)).extend(tangents[0].w);
        let map = sample(&material.normal_texture, &at, textures, false);
        normal = mapped_normal(material, instance, map, normal, tangent);
    }
    let side = if geometric.dot(view) < 0.0 { -1.0 } else { 1.0 };
    Surface {
        reflector: Reflector {
            base_color: base.truncate(),
            metallic: (f64::from(material.metallic) * mr.z).clamp(0.0, 1.0),
            roughness: (f64::from(material.roughness) * mr.y).clamp(0.0, 1.0),
            dielectric: f64::from(material.dielectric),
            opaque: 1.0 - transmission_at(material, &at, textures),
        },
        alpha: if material.flags & (MATERIAL_MASK | MATERIAL_BLEND) != 0 { base.w } else { 1.0 },
        emissive: emission_at(material, &at, textures),
        occlusion: (1.0 + f64::from(material.occlusion_strength) * (open - 1.0)).clamp(0.0, 1.0),
        unlit: material.flags & MATERIAL_UNLIT != 0,
        normal: normal * side,
        geometric: geometric * side,
    }
}
