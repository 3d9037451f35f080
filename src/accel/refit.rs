//! Meshes that deform: their trees follow the triangles, in the place that they have.

use std::ops::Range;

use obvhs::BvhBuildParams;
use obvhs::cwbvh::node::CwBvhNode;
use rayon::prelude::*;

use super::nodes::{Extent, encode_planes};
use super::{Bounds, Geometry, MESH_DEPTH, MeshRecord, bvh, encode_normal, encode_tangent, in_bounds, pack, unpack};
use crate::scene::deform::Deformed;
use crate::{Error, Result};
use glam::Vec3;

/// Triangles or vertices that one thread takes at a time.
const CHUNK: usize = 1024;

/// What of a [`Geometry`] changed when a mesh was deformed: contiguous ranges, to be uploaded before the mesh is traced.
#[derive(Debug, Clone, PartialEq)]
pub struct RefitOutcome {
    /// Of [`Geometry::nodes`], 80 bytes each; on the GPU [`Geometry::tlas_capacity`] nodes come before them.
    pub nodes: Range<u32>,
    /// Of [`Geometry::triangle_corners`] and [`Geometry::triangle_rest`], 32 and 4 bytes each. After a rebuild of
    /// [`Geometry::triangles`] and [`Geometry::source_triangles`], too: triangles have other slots then.
    pub triangles: Range<u32>,
    /// Of [`Geometry::vertices`], 32 bytes each of which the first 8, normal and tangent, changed.
    pub vertices: Range<u32>,
    /// Object-space bounds, as in the mesh's record now; the top level has to be rebuilt with them.
    pub bounds: Bounds,
    /// What tracing the tree costs by the surface-area heuristic, relative to the tree as it was built: 1 for the shape that it
    /// was built for, more the worse it fits. At about 2 a rebuild pays.
    pub cost: f64,
    /// Whether the tree was built anew.
    pub rebuilt: bool,
}

/// Nodes that a mesh that deforms gets beyond those of its first tree, lest one that is built anew finds no place: a quarter
/// more, because trees over the same triangles differ by a few hundredths in their size.
pub(super) fn spare_nodes(count: usize) -> usize {
    if count == 0 { 0 } else { count / 4 + 2 }
}

impl Geometry {
    /// Moves the triangles of a mesh to where a deformation puts them, with their normals and tangents, and fits the boxes
    /// of its tree to them. The tree's topology stays: boxes of triangles that have come apart overlap, which is never wrong,
    /// but slower to trace ([`RefitOutcome::cost`]).
    ///
    /// Takes some 0.1 ms for a thousand triangles on one core. More than half of that are the boxes, which one thread does; the
    /// rest is shared among the threads of rayon. The result depends on nothing but `shape`.
    ///
    /// # Errors
    /// [`Error::Scene`] if there is no such mesh, `shape` is not one of it, or a position is beyond
    /// [`super::MAX_COORDINATE`] or not finite (none of [`crate::scene::deform::deform`] is). Nothing is changed then.
    pub fn refit(&mut self, mesh: usize, shape: &Deformed) -> Result<RefitOutcome> {
        self.refit_between(mesh, shape, None)
    }

    /// As [`Geometry::refit`], with boxes that bound the triangles on all of their way, along straight lines, from where their
    /// vertices were `before`: what a shutter sees that is open for a while.
    ///
    /// # Errors
    /// As [`Geometry::refit`]; for `before` too.
    pub fn refit_between(&mut self, mesh: usize, shape: &Deformed, before: Option<&[Vec3]>) -> Result<RefitOutcome> {
        let record = self.checked(mesh, shape)?;
        let fits = |p: &[Vec3]| p.len() == record.vertex_count as usize && p.iter().all(|p| in_bounds(*p));
        if !before.is_none_or(fits) {
            let message = "was deformed out of range, or is another mesh: begin anew".to_owned();
            return Err(Error::Scene { path: format!("mesh {mesh}").into(), message });
        }
        Ok(self.fit(mesh, &record, (shape, before), false))
    }

    /// As [`Geometry::refit`], with a tree that is built anew over the deformed triangles, which takes about fifteen times as
    /// long. `None`, and nothing is changed, if the new tree has more nodes than the mesh has room for.
    ///
    /// # Errors
    /// As [`Geometry::refit`].
    pub fn rebuild(&mut self, mesh: usize, shape: &Deformed, params: &BvhBuildParams) -> Result<Option<RefitOutcome>> {
        let record = self.checked(mesh, shape)?;
        let (slots, nodes) = (range(record.first_triangle, record.triangle_count), nodes_of(&record));
        let mut by_source: Vec<_> =
            self.source_triangles[slots.clone()].iter().zip(&self.triangles[slots.clone()]).collect();
        by_source.par_sort_unstable_by_key(|(source, _)| **source);
        let boxes: Vec<Bounds> = by_source
            .par_iter()
            .map(|(_, t)| {
                Bounds::of(
                    [t.vertex0, t.vertex1, t.vertex2].map(|v| shape.positions[(v - record.first_vertex) as usize]),
                )
            })
            .collect();
        let tree = bvh::build(&boxes, params, MESH_DEPTH, |_| ());
        if tree.nodes.len() > nodes.len() {
            return Ok(None);
        }
        let triangles: Vec<_> = tree.order.iter().map(|&source| *by_source[source as usize].1).collect();
        self.triangles[slots.clone()].copy_from_slice(&triangles);
        self.source_triangles[slots].copy_from_slice(&tree.order);
        let (used, spare) = self.nodes[nodes].split_at_mut(tree.nodes.len());
        used.copy_from_slice(bytemuck::cast_slice(&tree.nodes));
        spare.fill([0; 20]);
        Ok(Some(self.fit(mesh, &record, (shape, None), true)))
    }

    fn checked(&self, mesh: usize, shape: &Deformed) -> Result<MeshRecord> {
        let fail = |message: String| Err(Error::Scene { path: format!("mesh {mesh}").into(), message });
        let Some(record) = self.meshes.get(mesh) else { return fail(format!("there are only {}", self.meshes.len())) };
        let count = record.vertex_count as usize;
        let fits = shape.positions.len() == count && shape.normals.len() == count;
        if !fits || !(shape.tangents.is_empty() || shape.tangents.len() == count) {
            return fail(format!("has {count} vertices, its deformed shape has not: deform the same mesh"));
        }
        match shape.positions.iter().position(|p| !in_bounds(*p)) {
            None => Ok(*record),
            Some(vertex) => fail(format!("is deformed out of range at vertex {vertex}: {}", shape.positions[vertex])),
        }
    }

    fn fit(
        &mut self,
        mesh: usize,
        record: &MeshRecord,
        (shape, before): (&Deformed, Option<&[Vec3]>),
        rebuilt: bool,
    ) -> RefitOutcome {
        self.move_triangles(record, shape);
        self.turn_vertices(record, shape);
        let extent = self.fit_boxes(record, before);
        let bounds = extent.map_or(Bounds::EMPTY, |e| e.bounds);
        let cost = extent.map_or(1.0, |e| e.cost());
        self.meshes[mesh].bounds = bounds;
        if rebuilt {
            self.meshes[mesh].depth = extent.map_or(0, |e| e.depth);
            self.built_costs[mesh] = cost;
        }
        RefitOutcome {
            nodes: record.first_node..record.first_node + record.node_count,
            triangles: record.first_triangle..record.first_triangle + record.triangle_count,
            vertices: record.first_vertex..record.first_vertex + record.vertex_count,
            bounds,
            cost: cost / self.built_costs[mesh],
            rebuilt,
        }
    }

    fn move_triangles(&mut self, record: &MeshRecord, shape: &Deformed) {
        let slots = range(record.first_triangle, record.triangle_count);
        let packed = self.triangle_corners[slots.clone()].par_iter_mut().zip(&mut self.triangle_rest[slots.clone()]);
        let moved = packed.zip(&self.triangles[slots]).with_min_len(CHUNK);
        moved.for_each(|((corners, rest), triangle)| {
            let vertices = [triangle.vertex0, triangle.vertex1, triangle.vertex2];
            (*corners, *rest) = pack(vertices.map(|v| shape.positions[(v - record.first_vertex) as usize]));
        });
    }

    fn turn_vertices(&mut self, record: &MeshRecord, shape: &Deformed) {
        let vertices = &mut self.vertices[range(record.first_vertex, record.vertex_count)];
        let turned = vertices.par_iter_mut().zip(&shape.normals).enumerate().with_min_len(CHUNK);
        turned.for_each(|(i, (vertex, normal))| {
            vertex.normal = encode_normal(*normal);
            if let Some(tangent) = shape.tangents.get(i) {
                vertex.tangent = encode_tangent(*tangent);
            }
        });
    }

    fn fit_boxes(&mut self, record: &MeshRecord, before: Option<&[Vec3]>) -> Option<Extent> {
        let slots = range(record.first_triangle, record.triangle_count);
        let (corners, rest) = (&self.triangle_corners[slots.clone()], &self.triangle_rest[slots]);
        let nodes: &mut [CwBvhNode] = bytemuck::cast_slice_mut(&mut self.nodes[nodes_of(record)]);
        let triangles = &self.triangles[range(record.first_triangle, record.triangle_count)];
        encode_planes(nodes, &|slot| {
            let bounds = Bounds::of(unpack(corners[slot as usize], rest[slot as usize]));
            let Some(before) = before else { return bounds };
            let t = triangles[slot as usize];
            let corners = [t.vertex0, t.vertex1, t.vertex2].map(|v| before[(v - record.first_vertex) as usize]);
            swept(bounds, Bounds::of(corners))
        })
    }
}

/// A box around all that lies between two: a shader's blend is off by 3 u of both (motion.glsl), and this sum by as much.
fn swept(now: Bounds, before: Bounds) -> Bounds {
    let most = |b: Bounds| b.min.abs().max(b.max.abs());
    let off = (most(now) + most(before)) * (8.0 / 16_777_216.0);
    let all = now.union(before);
    Bounds { min: all.min - off, max: all.max + off }
}

fn nodes_of(record: &MeshRecord) -> Range<usize> {
    range(record.first_node, record.node_count)
}

fn range(first: u32, count: u32) -> Range<usize> {
    first as usize..first as usize + count as usize
}
