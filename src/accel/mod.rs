//! The two-level acceleration structure, laid out for the GPU.
//!
//! [`Geometry`] holds what keeps its shape: a compressed eight-wide tree (CwBvh: Ylitie, Karras and Laine 2017, built with
//! obvhs) a mesh, its triangles in leaf order, and vertex attributes, all meshes in one set of arrays. A mesh that deforms is
//! refitted in its place ([`Geometry::refit`]). [`Tlas`] is the tree over the instances, rebuilt each frame. Both levels
//! share one node buffer: the first [`Geometry::tlas_capacity`] nodes are the top level's. `glsl/include/traverse.glsl` walks
//! it; [`crate::oracle::traverse`] is the same walk on the CPU.
//!
//! A triangle takes 36 bytes of corners in two arrays, because the smallest limit of a buffer met in practice is 128 MiB and
//! the original hairball has 2.9 million triangles.

mod balanced;
mod bvh;
mod cluster;
pub(crate) mod encode;
mod moving;
mod nodes;
mod place;
mod refit;
mod tlas;

pub use encode::{color as encode_color, normal as encode_normal, tangent as encode_tangent, vertex as encode_vertex};
pub use moving::mark_moving;
pub use obvhs::BvhBuildParams;
pub use place::{is_placed, place};
pub use refit::RefitOutcome;
pub use tlas::Tlas;

use glam::{Vec2, Vec3, Vec4};
use obvhs::cwbvh::node::CwBvhNode;
use rayon::prelude::*;

use crate::progress::Progress;
use crate::scene::{AlphaMode, Material, Mesh, Scene};
use crate::{Error, Result, shaders};

/// A compressed node: the 80 bytes of obvhs's `CwBvhNode`, five `uvec4` for the GPU.
pub type Node = [u32; 20];

/// Object-space coordinates beyond this (2^44 m) are refused: the traversal's products would leave the range of f32.
pub const MAX_COORDINATE: f32 = 17_592_186_044_416.0;

/// Levels of nodes of a mesh's tree, and of the top level: what [`shaders::TRAVERSAL_STACK`] is shared among, with two
/// entries more for what an instance is entered from.
const MESH_DEPTH: u32 = 20;
const TOP_DEPTH: u32 = shaders::TRAVERSAL_STACK - MESH_DEPTH - 2;

/// An axis-aligned box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least corner, metres.
    pub min: Vec3,
    /// Greatest corner, metres.
    pub max: Vec3,
}

impl Bounds {
    /// Holds nothing.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The least box that holds both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The least box that holds some points.
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |all, p| all.union(Self { min: p, max: p }))
    }

    /// Whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.min.x > self.max.x
    }
}

/// Where a mesh is in the arrays of a [`Geometry`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshRecord {
    /// First of its nodes in [`Geometry::nodes`]; the GPU's index is larger by [`Geometry::tlas_capacity`].
    pub first_node: u32,
    /// Number of nodes, 0 for an empty mesh. A mesh that deforms has some to spare at the end, for a tree that is built anew.
    pub node_count: u32,
    /// First of its triangle slots.
    pub first_triangle: u32,
    /// Number of triangles.
    pub triangle_count: u32,
    /// First of its vertices.
    pub first_vertex: u32,
    /// Number of vertices.
    pub vertex_count: u32,
    /// Levels of nodes, 0 for an empty mesh.
    pub depth: u32,
    /// Object-space bounds, [`Bounds::EMPTY`] for an empty mesh.
    pub bounds: Bounds,
    /// Some triangle's material has an alpha mask or blends.
    pub has_alpha: bool,
}

/// Everything about a scene's meshes that the GPU reads; only [`Geometry::refit`] and [`Geometry::rebuild`] change it.
#[derive(Debug, Clone, Default)]
pub struct Geometry {
    /// Nodes of all meshes. Their child and primitive indices are relative to the mesh.
    pub nodes: Vec<Node>,
    /// Object-space corners of each triangle slot but the last coordinate: `(v0.xyz, v1.x, v1.yz, v2.xy)`.
    pub triangle_corners: Vec<[f32; 8]>,
    /// `v2.z` of each triangle slot.
    pub triangle_rest: Vec<f32>,
    /// Vertices and material of each triangle slot.
    pub triangles: Vec<shaders::Triangle>,
    /// Attributes of the vertices.
    pub vertices: Vec<shaders::Vertex>,
    /// Triangle index in its mesh of each triangle slot.
    pub source_triangles: Vec<u32>,
    /// One a mesh of the scene.
    pub meshes: Vec<MeshRecord>,
    /// The mesh of each instance of the scene.
    pub instance_meshes: Vec<u32>,
    /// Nodes reserved for the top level at the start of the GPU's node buffer, at least 1.
    pub tlas_capacity: u32,
    /// What tracing the tree of each mesh cost when it was built: see [`RefitOutcome::cost`].
    built_costs: Vec<f64>,
}

impl Geometry {
    /// Builds the trees of all meshes, in parallel. Progress counts triangles.
    ///
    /// `params.pre_split` is ignored: a triangle is in one leaf only. [`BvhBuildParams::medium_build`] is a good choice.
    ///
    /// # Errors
    /// A mesh whose arrays disagree or that has coordinates beyond [`MAX_COORDINATE`]; more triangles, vertices or nodes
    /// than 32-bit indices can name.
    pub fn build(scene: &Scene, params: &BvhBuildParams, progress: &dyn Progress) -> Result<Self> {
        scene.meshes.iter().try_for_each(|mesh| check_mesh(scene, mesh))?;
        let total: usize = scene.meshes.iter().map(|m| m.triangles.len()).sum();
        let vertices: usize = scene.meshes.iter().map(|m| m.positions.len()).sum();
        // A node has at least one triangle of its own or two children: there are fewer nodes than triangles, but for those
        // to spare.
        index(scene, total + scene.instances.len(), "triangles and instances")?;
        index(scene, total + total / 4 + 2 * scene.meshes.len() + scene.instances.len(), "nodes of the tree")?;
        index(scene, vertices, "vertices")?;
        progress.begin("building the acceleration structure", total as u64);
        let mut trees: Vec<bvh::Bvh> = scene.meshes.par_iter().map(|mesh| build_mesh(mesh, params, progress)).collect();
        progress.finish();
        for (tree, _) in trees.iter_mut().zip(&scene.meshes).filter(|(_, mesh)| mesh.deforms()) {
            tree.nodes.resize_with(tree.nodes.len() + refit::spare_nodes(tree.nodes.len()), CwBvhNode::default);
        }
        let mut geometry = Self {
            tlas_capacity: scene.instances.len().max(1) as u32,
            instance_meshes: scene.instances.iter().map(|i| i.mesh as u32).collect(),
            ..Self::default()
        };
        geometry.reserve(&trees, total, vertices);
        for (mesh, tree) in scene.meshes.iter().zip(trees) {
            geometry.append(scene, mesh, &tree);
        }
        Ok(geometry)
    }

    /// The object-space corners of a triangle slot.
    pub fn corners(&self, slot: u32) -> [Vec3; 3] {
        unpack(self.triangle_corners[slot as usize], self.triangle_rest[slot as usize])
    }

    fn reserve(&mut self, trees: &[bvh::Bvh], triangles: usize, vertices: usize) {
        self.nodes.reserve_exact(trees.iter().map(|t| t.nodes.len()).sum());
        self.triangle_corners.reserve_exact(triangles);
        self.triangle_rest.reserve_exact(triangles);
        self.triangles.reserve_exact(triangles);
        self.source_triangles.reserve_exact(triangles);
        self.vertices.reserve_exact(vertices);
    }

    fn append(&mut self, scene: &Scene, mesh: &Mesh, tree: &bvh::Bvh) {
        let first_vertex = self.vertices.len() as u32;
        self.meshes.push(MeshRecord {
            first_node: self.nodes.len() as u32,
            node_count: tree.nodes.len() as u32,
            first_triangle: self.triangles.len() as u32,
            triangle_count: mesh.triangles.len() as u32,
            first_vertex,
            vertex_count: mesh.positions.len() as u32,
            depth: tree.extent.map_or(0, |e| e.depth),
            bounds: tree.extent.map_or(Bounds::EMPTY, |e| e.bounds),
            has_alpha: has_alpha(scene, mesh),
        });
        self.built_costs.push(tree.extent.map_or(1.0, |e| e.cost()));
        self.nodes.extend_from_slice(bytemuck::cast_slice(&tree.nodes));
        self.source_triangles.extend_from_slice(&tree.order);
        for &source in &tree.order {
            let indices = mesh.triangles[source as usize];
            let (corners, rest) = pack(indices.map(|i| mesh.positions[i as usize]));
            self.triangle_corners.push(corners);
            self.triangle_rest.push(rest);
            let [vertex0, vertex1, vertex2] = indices.map(|i| first_vertex + i);
            let material = mesh.triangle_materials[source as usize];
            self.triangles.push(shaders::Triangle { vertex0, vertex1, vertex2, material });
        }
        self.vertices.extend((0..mesh.positions.len()).map(|i| vertex_of(mesh, i)));
    }
}

/// Corners as [`Geometry::triangle_corners`] and [`Geometry::triangle_rest`] have them.
fn pack([a, b, c]: [Vec3; 3]) -> ([f32; 8], f32) {
    ([a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y], c.z)
}

fn unpack([ax, ay, az, bx, by, bz, cx, cy]: [f32; 8], cz: f32) -> [Vec3; 3] {
    [Vec3::new(ax, ay, az), Vec3::new(bx, by, bz), Vec3::new(cx, cy, cz)]
}

fn vertex_of(mesh: &Mesh, i: usize) -> shaders::Vertex {
    let uv = |set: usize| mesh.uvs[set].get(i).copied().unwrap_or(Vec2::ZERO);
    let normal = mesh.normals.get(i).copied().unwrap_or(Vec3::Z);
    let tangent = mesh.tangents.get(i).copied().unwrap_or(Vec4::X);
    encode_vertex(normal, tangent, [uv(0), uv(1)], mesh.colors.get(i).copied().unwrap_or(Vec4::ONE))
}

fn has_alpha(scene: &Scene, mesh: &Mesh) -> bool {
    let is_opaque = |m: &Material| m.alpha == AlphaMode::Opaque && !m.transmits();
    let opaque = |&m: &u32| scene.materials.get(m as usize).is_none_or(is_opaque);
    !mesh.triangle_materials.iter().all(opaque)
}

fn build_mesh(mesh: &Mesh, params: &BvhBuildParams, progress: &dyn Progress) -> bvh::Bvh {
    let boxes: Vec<Bounds> =
        mesh.triangles.iter().map(|t| Bounds::of(t.iter().map(|&i| mesh.positions[i as usize]))).collect();
    let reported = std::sync::atomic::AtomicU64::new(0);
    bvh::build(&boxes, params, MESH_DEPTH, |share| {
        let now = (share * boxes.len() as f64) as u64;
        let before = reported.swap(now, std::sync::atomic::Ordering::Relaxed);
        progress.advance(now.saturating_sub(before));
    })
}

fn check_mesh(scene: &Scene, mesh: &Mesh) -> Result<()> {
    let fail = |message: String| {
        let message = format!("mesh '{}' {message}", mesh.name);
        Err(Error::Scene { path: scene.name.clone().into(), message })
    };
    let count = mesh.positions.len();
    if mesh.triangles.iter().flatten().any(|&i| i as usize >= count) {
        return fail(format!("has a triangle that names a vertex beyond its {count}: mend the mesh"));
    }
    if mesh.triangle_materials.len() != mesh.triangles.len() {
        return fail("has not one material a triangle: mend the mesh".to_owned());
    }
    if !mesh.positions.iter().all(|p| in_bounds(*p)) {
        return fail(format!("has a vertex that is not finite or beyond {MAX_COORDINATE:e} m: scale it down"));
    }
    Ok(())
}

/// Whether a position is one that a tree can be built over. Written so that NaN fails as well.
fn in_bounds(p: Vec3) -> bool {
    p.abs().max_element() <= MAX_COORDINATE && p.is_finite()
}

fn index(scene: &Scene, count: usize, what: &str) -> Result<()> {
    if count < shaders::FOUND_LOST as usize {
        return Ok(());
    }
    let message = format!("{count} {what} are more than 32-bit indices can name: reduce the scene");
    Err(Error::Scene { path: scene.name.clone().into(), message })
}
