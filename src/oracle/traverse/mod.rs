//! The walk through the acceleration structure on the CPU: the twin of `glsl/include/{ray,intersect,traverse}.glsl`, operation
//! for operation in f32, so that hits agree to the last bit; and, in [`mod@reference`], the known answers in f64.
//!
//! Why each step is done as it is, and the error bounds, is told in the GLSL; it is not repeated here.

mod intersect;
mod ray;
pub mod reference;

pub use intersect::{TriangleHit, hit_children, hit_triangle};
pub use ray::{
    Ray, SurfacePoint, in_range, offset_origin, surface_point, surface_point_at, transform_direction, transform_point,
};

use glam::Vec3;

use crate::accel::{Geometry, Node, Tlas};
use crate::shaders;

/// Everything a ray of one frame meets.
#[derive(Debug, Clone, Copy)]
pub struct World<'a> {
    /// The meshes.
    pub geometry: &'a Geometry,
    /// The frame's top level.
    pub tlas: &'a Tlas,
    /// The frame's instances, with the leaf order that [`Tlas::rebuild`] wrote.
    pub instances: &'a [shaders::Instance],
    /// When the rays are, part of the way from the last frame, 0, to this one, 1: what moves is met where it is then.
    pub time: f32,
}

/// What a ray found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intersection {
    /// Instance of the scene.
    pub instance: u32,
    /// Global triangle slot.
    pub primitive: u32,
    /// Barycentric weight of vertex 1, 0..=1.
    pub u: f32,
    /// Barycentric weight of vertex 2, 0..=1.
    pub v: f32,
    /// Distance in lengths of the ray's direction, positive.
    pub t: f32,
}

/// Camera-relative rays in metres, with hits looked for at 0 < t < tmax.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Query {
    /// Where the ray starts.
    pub origin: Vec3,
    /// Of any length within 2^-46..2^46; t counts in it.
    pub direction: Vec3,
    /// Exclusive end; may be infinite.
    pub tmax: f32,
}

/// The closest hit; of equally close ones that of the lowest instance, then of the lowest primitive.
pub fn closest(world: &World, query: &Query) -> Option<Intersection> {
    closest_with_alpha(world, query, &|_| true)
}

/// The closest hit for which `exists` (asked for instances with `INSTANCE_ALPHA` only) says that the surface is there.
pub fn closest_with_alpha(
    world: &World,
    query: &Query,
    exists: &dyn Fn(&Intersection) -> bool,
) -> Option<Intersection> {
    Walk::new(world, query).run(query, false, &Surfaces { exists, is_one_sided: &|_| false })
}

/// As [`closest_with_alpha`], passing through the backs of triangles that are one-sided (`CULL_BACK` in the shader).
pub fn closest_seen(world: &World, query: &Query, surfaces: &Surfaces<'_>) -> Option<Intersection> {
    Walk::new(world, query).run(query, false, surfaces)
}

/// Whether anything is hit.
pub fn any(world: &World, query: &Query) -> bool {
    any_with_alpha(world, query, &|_| true)
}

/// Whether anything is hit for which `exists` (as for [`closest_with_alpha`]) says that the surface is there.
pub fn any_with_alpha(world: &World, query: &Query, exists: &dyn Fn(&Intersection) -> bool) -> bool {
    Walk::new(world, query).run(query, true, &Surfaces { exists, is_one_sided: &|_| false }).is_some()
}

/// What a ray costs that ends at the first hit it finds (`first`), or at the closest.
pub fn cost(world: &World, query: &Query, first: bool, surfaces: &Surfaces<'_>) -> Cost {
    let mut walk = Walk { log: Some(Cost::default()), ..Walk::new(world, query) };
    walk.go(query, first, surfaces);
    walk.log.unwrap_or_default()
}

/// What a ray costs.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Cost {
    /// Nodes that it visits.
    pub nodes: u32,
    /// Instance and slot of each triangle that it is tested against, in order.
    pub tested: Vec<(u32, u32)>,
}

/// What a walk asks about the surfaces that it meets.
#[derive(Clone, Copy)]
pub struct Surfaces<'a> {
    /// Whether the surface is there; asked for instances with `INSTANCE_ALPHA` only.
    pub exists: &'a dyn Fn(&Intersection) -> bool,
    /// Whether a triangle slot is not met from behind.
    pub is_one_sided: &'a dyn Fn(u32) -> bool,
}

impl std::fmt::Debug for Surfaces<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Surfaces").finish_non_exhaustive()
    }
}

/// Children, or primitives, that are put off: a base index and bits, as in traverse.glsl.
#[derive(Clone, Copy, Default)]
struct Group {
    base: u32,
    bits: u32,
}

impl Group {
    const ROOT: Self = Self { base: 0, bits: 0x8000_0000 };

    fn has_nodes(self) -> bool {
        self.bits > 0x00ff_ffff
    }

    /// Takes the highest bit.
    fn take(&mut self) -> u32 {
        let bit = 31 - self.bits.leading_zeros();
        self.bits &= !(1 << bit);
        bit
    }
}

/// A mesh's tree that a walk is in, with the entries on the stack when it was entered.
#[derive(Clone, Copy)]
struct Entered {
    instance: u32,
    stacked: usize,
    node_base: u32,
    triangle_base: u32,
}

struct Walk<'a> {
    world: &'a World<'a>,
    stack: [Group; shaders::TRAVERSAL_STACK as usize],
    stacked: usize,
    entered: Option<Entered>,
    best: Intersection,
    found: bool,
    group: Group,
    ray: Ray,
    log: Option<Cost>,
}

impl<'a> Walk<'a> {
    fn new(world: &'a World<'a>, query: &Query) -> Self {
        let usable = in_range(query.origin, query.direction);
        Self {
            world,
            stack: [Group::default(); shaders::TRAVERSAL_STACK as usize],
            stacked: 0,
            entered: None,
            best: Intersection { instance: 0, primitive: 0, u: 0.0, v: 0.0, t: query.tmax },
            found: false,
            group: if usable { Group::ROOT } else { Group::default() },
            ray: Ray::new(query.origin, if usable { query.direction } else { Vec3::ONE }),
            log: None,
        }
    }

    fn run(mut self, query: &Query, first: bool, surfaces: &Surfaces<'_>) -> Option<Intersection> {
        self.go(query, first, surfaces);
        self.found.then_some(self.best)
    }

    fn go(&mut self, query: &Query, first: bool, surfaces: &Surfaces<'_>) {
        for _ in 0..shaders::TRAVERSAL_STEPS {
            let mut primitives = self.group;
            if self.group.has_nodes() {
                primitives = self.visit();
            } else {
                self.group = Group::default();
            }
            let entering = self.leaf(&mut primitives, first, surfaces);
            if first && self.found {
                break;
            }
            if let Some(instance) = entering {
                self.enter(instance, primitives, query);
            }
            if !self.group.has_nodes() && !self.pop(query) {
                break;
            }
        }
    }

    /// Visits the next child of the group, which becomes the child's own; returns the child's primitives.
    fn visit(&mut self) -> Group {
        let inner = self.group.bits;
        let bit = self.group.take();
        let child = (bit - 24) ^ (self.ray.octant & 7);
        let node_base = self.entered.map_or(0, |e| e.node_base);
        let index = node_base + self.group.base + (inner & ((1 << child) - 1)).count_ones();
        if self.group.has_nodes() {
            self.push(self.group);
        }
        if let Some(log) = &mut self.log {
            log.nodes += 1;
        }
        let node = self.node(index);
        let hits = hit_children(node, &self.ray, self.best.t);
        self.group = Group { base: node[4], bits: (hits & 0xff00_0000) | (node[3] >> 24) };
        Group { base: node[5], bits: hits & 0x00ff_ffff }
    }

    fn node(&self, index: u32) -> &'a Node {
        match index.checked_sub(self.world.geometry.tlas_capacity) {
            Some(below) => &self.world.geometry.nodes[below as usize],
            None => &self.world.tlas.nodes[index as usize],
        }
    }

    fn push(&mut self, group: Group) {
        if let Some(entry) = self.stack.get_mut(self.stacked) {
            *entry = group;
            self.stacked += 1;
        }
    }

    /// Tests the primitives of a mesh's leaf; in the top level returns the instance to enter.
    fn leaf(&mut self, primitives: &mut Group, first: bool, surfaces: &Surfaces<'_>) -> Option<u32> {
        while primitives.bits != 0 {
            let slot = primitives.base + primitives.take();
            let Some(entered) = self.entered else {
                return Some(self.world.instances[slot as usize].leaf);
            };
            self.test(entered.instance, entered.triangle_base + slot, surfaces);
            if first && self.found {
                break;
            }
        }
        None
    }

    fn test(&mut self, instance: u32, primitive: u32, surfaces: &Surfaces<'_>) {
        if let Some(log) = &mut self.log {
            log.tested.push((instance, primitive));
        }
        let Some(hit) = hit_triangle(&self.ray, self.world.geometry.corners(primitive)) else { return };
        let back = hit.back;
        let hit = Intersection { instance, primitive, u: hit.u, v: hit.v, t: hit.t };
        let lower = (instance, primitive) < (self.best.instance, self.best.primitive);
        if !(hit.t > 0.0 && (hit.t < self.best.t || (hit.t == self.best.t && lower))) {
            return;
        }
        if back && (surfaces.is_one_sided)(primitive) {
            return;
        }
        let masked = self.world.instances[instance as usize].flags & shaders::INSTANCE_ALPHA != 0;
        if !masked || (surfaces.exists)(&hit) {
            self.best = hit;
            self.found = true;
        }
    }

    fn enter(&mut self, index: u32, primitives: Group, query: &Query) {
        if primitives.bits != 0 {
            self.push(primitives);
        }
        if self.group.has_nodes() {
            self.push(self.group);
        }
        let instance = &self.world.instances[index as usize];
        self.entered = Some(Entered {
            instance: index,
            stacked: self.stacked,
            node_base: instance.node_base,
            triangle_base: instance.triangle_base,
        });
        let ray = super::motion::ray_in(instance, self.world.time, query.origin, query.direction);
        let (origin, direction) = ray.unwrap_or((query.origin, Vec3::ONE));
        self.ray = Ray::new(origin, direction);
        self.group = if ray.is_some() { Group::ROOT } else { Group::default() };
    }

    /// Goes on with what was put off last; false if nothing is left.
    fn pop(&mut self, query: &Query) -> bool {
        if self.entered.is_some_and(|e| e.stacked == self.stacked) {
            self.entered = None;
            self.ray = Ray::new(query.origin, query.direction);
        }
        if self.stacked == 0 {
            return false;
        }
        self.stacked -= 1;
        self.group = self.stack[self.stacked];
        true
    }
}
