//! What the kernels that trace and shade read of a scene in one frame, and the questions that they all ask of it. Twin of
//! `glsl/include/alpha_hit.glsl`.

use std::cell::Cell;

use glam::{DVec3, Vec3};

use super::emitter::Shining;
use super::environment::Afar;
use super::motion::{Placement, frame_at, placement_at};
use super::shade::alpha::{alpha_passes, alpha_threshold};
use super::shade::material::{Spot, base_color_at, transmission_at};
use super::shade::texture::Textures;
use super::traverse::{Intersection, SurfacePoint, World, surface_point_at, transform_point};
use super::triangle::triangle_point;
use crate::shaders::{
    Frame, Instance, MATERIAL_BLEND, MATERIAL_DOUBLE_SIDED, MATERIAL_MASK, MATERIAL_TRANSMITS, Material,
};

/// Roundoff of f32.
pub const U: f64 = 1.0 / 16_777_216.0;

/// A scene in one frame, as the kernels see it.
#[derive(Debug, Clone, Copy)]
pub struct Stage<'a> {
    /// Constants of the frame.
    pub frame: &'a Frame,
    /// Geometry and instances.
    pub world: World<'a>,
    /// The scene's materials.
    pub materials: &'a [Material],
    /// The scene's images.
    pub textures: &'a Textures,
    /// Whether the kernels are those that look at alpha.
    pub alpha: bool,
    /// The sample's point of the lens, metres along the axes across and up; 0 for a pinhole.
    pub lens: [f32; 2],
    /// Light from all around, and where the sample lies in it; none where that is not modelled.
    pub afar: Option<Afar<'a>>,
    /// What shines, and where the sample lies on it; none where that is not modelled.
    pub shining: Option<Shining<'a>>,
}

impl<'a> Stage<'a> {
    /// Where the sample's camera ray starts, relative to the middle of the lens, metres.
    pub fn eye(&self) -> Vec3 {
        let axis = |a: [f32; 4]| Vec3::new(a[0], a[1], a[2]);
        let seen = self.seen();
        axis(seen.right) * self.lens[0] + axis(seen.up) * self.lens[1]
    }

    /// The frame with the camera's axes at the sample's time.
    pub fn seen(&self) -> Frame {
        frame_at(self.frame, self.world.time)
    }

    /// The material of a triangle slot.
    pub fn material(&self, primitive: u32) -> &'a Material {
        &self.materials[self.world.geometry.triangles[primitive as usize].material as usize]
    }

    /// Whether a triangle slot is not seen from behind.
    pub fn is_one_sided(&self, primitive: u32) -> bool {
        self.material(primitive).flags & MATERIAL_DOUBLE_SIDED == 0
    }

    /// The instance of an index that a ray has found, where it is at the sample's time.
    pub fn instance(&self, index: u32) -> Instance {
        let Placement { to_relative, to_object, flags, .. } = self.placement(index);
        Instance { to_relative, to_object, flags, ..self.world.instances[index as usize] }
    }

    fn placement(&self, index: u32) -> Placement {
        placement_at(&self.world.instances[index as usize], self.world.time)
    }

    /// The point of a triangle slot of an instance with these weights of its second and third vertex.
    pub fn surface(&self, instance: u32, primitive: u32, u: f32, v: f32) -> SurfacePoint {
        surface_point_at(&self.placement(instance), self.world.geometry.corners(primitive), u, v)
    }

    /// A triangle slot's vertices with a place between them.
    pub fn spot(&self, primitive: u32, u: f32, v: f32) -> Spot<'a> {
        let t = self.world.geometry.triangles[primitive as usize];
        let vertices = [t.vertex0, t.vertex1, t.vertex2].map(|i| &self.world.geometry.vertices[i as usize]);
        Spot { vertices, u, v }
    }

    /// Whether the surface is there that a ray has met. Sets `doubtful` where another device's rounding may decide
    /// otherwise.
    pub fn alpha_hit(&self, hit: &Intersection, doubtful: &Cell<bool>) -> bool {
        let material = self.material(hit.primitive);
        if !self.alpha || material.flags & (MATERIAL_MASK | MATERIAL_BLEND) == 0 {
            return true;
        }
        let (object, cell, seed) = self.threshold(hit);
        let attributes = self.spot(hit.primitive, hit.u, hit.v).attributes();
        let alpha = base_color_at(material, &attributes, self.textures).w;
        let passes = |alpha: f64, cell: f64| alpha_passes(material, alpha as f32, object, cell as f32, seed);
        decided(alpha, cell, doubtful, passes)
    }

    /// The same for a shadow ray, which passes straight through what transmits.
    pub fn shadow_hit(&self, hit: &Intersection, doubtful: &Cell<bool>) -> bool {
        let material = self.material(hit.primitive);
        if self.alpha && material.flags & MATERIAL_TRANSMITS != 0 {
            let (object, cell, seed) = self.threshold(hit);
            let attributes = self.spot(hit.primitive, hit.u, hit.v).attributes();
            let part = transmission_at(material, &attributes, self.textures);
            let stops = |part: f64, cell: f64| part as f32 <= alpha_threshold(object, cell as f32, !seed);
            if !decided(part, cell, doubtful, stops) {
                return false;
            }
        }
        self.alpha_hit(hit, doubtful)
    }

    /// What the threshold of a point's alpha is a hash of: object space, size of a pixel there, seed.
    fn threshold(&self, hit: &Intersection) -> ([f32; 3], f64, u32) {
        let corners = self.world.geometry.corners(hit.primitive).map(|p| p.to_array());
        let object = triangle_point(corners, hit.u, hit.v);
        let cell = footprint(self.frame, &self.world.instances[hit.instance as usize], object.into());
        (object, cell, super::random::hash_combine(self.frame.alpha_seed, hit.instance))
    }
}

/// Whether something is there, by its alpha and the size of its cell. Alpha is off by up to 40 U (a vertex colour, a texture,
/// products; tests/shading_twin.rs), a footprint by two lengths of 12 U each and two products.
fn decided(alpha: f64, cell: f64, doubtful: &Cell<bool>, passes: impl Fn(f64, f64) -> bool) -> bool {
    let decided = passes(alpha, cell);
    let varied = [passes(alpha - 40.0 * U, cell), passes(alpha + 40.0 * U, cell)];
    let rescaled = [passes(alpha, cell * (1.0 - 32.0 * U)), passes(alpha, cell * (1.0 + 32.0 * U))];
    if varied.into_iter().chain(rescaled).any(|v| v != decided) {
        doubtful.set(true);
    }
    decided
}

/// A pixel's footprint at a point of an instance, in object space.
fn footprint(frame: &Frame, instance: &Instance, object: Vec3) -> f64 {
    let relative = transform_point(&instance.to_relative, object).as_dvec3();
    let row = |r: [f32; 4]| DVec3::new(r[0].into(), r[1].into(), r[2].into()).length();
    let scale = instance.to_object.map(row).into_iter().fold(0.0, f64::max);
    relative.length() * f64::from(frame.forward[3]) * scale
}

/// What another device's unit normal of this surface point may differ by, at most in any direction. The shader leaves the
/// compiler free to fuse its operations: each product of the cross product is off by 3 U with its edges, their transform by
/// 4 U, scaling and normalising by 24 U.
pub fn normal_error(stage: &Stage<'_>, instance: u32, primitive: u32) -> f64 {
    let [v0, v1, v2] = stage.world.geometry.corners(primitive).map(glam::Vec3::as_dvec3);
    let (e1, e2) = (v1 - v0, v2 - v0);
    let sizes = |p: DVec3, q: DVec3| {
        let (p, q) = (p.abs(), q.abs());
        DVec3::new(p.y * q.z + p.z * q.y, p.z * q.x + p.x * q.z, p.x * q.y + p.y * q.x)
    };
    let rows = stage.instance(instance).to_object.map(|r| DVec3::new(r[0].into(), r[1].into(), r[2].into()));
    let across = |n: DVec3| rows[0] * n.x + rows[1] * n.y + rows[2] * n.z;
    let most = sizes(e1, e2);
    let length = across(e1.cross(e2)).length();
    let lost = (rows[0].abs() * most.x + rows[1].abs() * most.y + rows[2].abs() * most.z).length();
    if length > 0.0 { (7.0 * lost / length + 24.0) * U } else { f64::INFINITY }
}
