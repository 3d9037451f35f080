//! The meshes of a renderer that deform: their shape in a frame, with trees fitted to it, and what the device needs of it.
//!
//! Every frame uploads all of it, whether it changed or not, as it does the top level: renderers that share a scene may look at
//! it at different times.

use crate::accel::Geometry;
use crate::gpu::Range;
use crate::phase::SceneResources;
use crate::resident::ResidentScene;
use crate::scene::deform::{Deformed, deform, positions};
use crate::scene::{Deformation, Mesh, Pose, Scene};
use crate::{Error, Result, shaders};
use glam::Vec3;

/// A mesh of a scene that deforms.
#[derive(Debug)]
pub(crate) struct Deformable {
    /// The one instance that it has.
    pub instance: usize,
    /// Its number in the scene.
    mesh: usize,
    /// As it was loaded.
    rest: Mesh,
    /// Its first triangle among those of all that deform.
    first: u32,
}

impl Deformable {
    /// Those of a scene.
    ///
    /// # Errors
    /// [`Error::Scene`] for a mesh whose triangles a sample cannot number.
    pub fn of(scene: &Scene) -> Result<Vec<Self>> {
        let mut first = 0;
        let mut all = Vec::new();
        for deformer in &scene.deformers {
            let instance = deformer.instance;
            let mesh = scene.instances[instance].mesh;
            let rest = scene.meshes[mesh].clone();
            let count = rest.triangles.len();
            if count > shaders::SHAPE_TRIANGLES as usize {
                let most = shaders::SHAPE_TRIANGLES;
                let message = format!("a mesh that deforms has {count} triangles, more than {most}: split it");
                return Err(Error::Scene { path: rest.name.into(), message });
            }
            all.push(Self { instance, mesh, rest, first });
            first += count as u32;
        }
        Ok(all)
    }
}

/// What a renderer keeps of the meshes that deform.
#[derive(Debug)]
pub(crate) struct Deforming {
    geometry: Geometry,
    shape: Deformed,
    /// Corners in the last frame, three a triangle, of all that deform.
    previous: Vec<Vec3>,
}

/// Of a mesh's part in the arrays of a geometry.
struct Part {
    nodes: std::ops::Range<usize>,
    triangles: std::ops::Range<usize>,
    vertices: std::ops::Range<usize>,
}

fn part(geometry: &Geometry, mesh: usize) -> Part {
    let record = &geometry.meshes[mesh];
    let range = |first: u32, count: u32| first as usize..(first + count) as usize;
    Part {
        nodes: range(record.first_node, record.node_count),
        triangles: range(record.first_triangle, record.triangle_count),
        vertices: range(record.first_vertex, record.vertex_count),
    }
}

impl Deforming {
    /// None if nothing of the scene deforms.
    pub fn new(scene: &ResidentScene) -> Option<Self> {
        let triangles: usize = scene.deformables.iter().map(|d| d.rest.triangles.len()).sum();
        (!scene.deformables.is_empty()).then(|| Self {
            geometry: scene.geometry.clone(),
            shape: Deformed::default(),
            previous: vec![Vec3::ZERO; 3 * triangles],
        })
    }

    /// The scene's geometry in the frame.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Takes on the shapes of a frame, and those that motion is told relative to; trees `swept` bound all between the two.
    ///
    /// # Errors
    /// [`Error::Scene`] for shapes beyond the range of coordinates.
    pub fn shape(&mut self, scene: &ResidentScene, now: &Pose, before: &Pose, swept: bool) -> Result<()> {
        for (i, deformable) in scene.deformables.iter().enumerate() {
            let (now, before) = (&now.deformations[i], &before.deformations[i]);
            deform(&deformable.rest, now, &mut self.shape);
            let then = (now != before).then(|| positions(&deformable.rest, before));
            self.geometry.refit_between(deformable.mesh, &self.shape, then.as_deref().filter(|_| swept))?;
            if let Some(then) = then {
                self.keep(deformable, &then);
            } else {
                let positions = std::mem::take(&mut self.shape.positions);
                self.keep(deformable, &positions);
                self.shape.positions = positions;
            }
        }
        Ok(())
    }

    /// Notes where the triangles were, in the order of their slots.
    fn keep(&mut self, deformable: &Deformable, positions: &[Vec3]) {
        let first_vertex = self.geometry.meshes[deformable.mesh].first_vertex;
        let slots = part(&self.geometry, deformable.mesh).triangles;
        let corners = &mut self.previous[3 * deformable.first as usize..];
        for (kept, triangle) in corners.chunks_exact_mut(3).zip(&self.geometry.triangles[slots]) {
            let vertices = [triangle.vertex0, triangle.vertex1, triangle.vertex2];
            kept.copy_from_slice(&vertices.map(|v| positions[(v - first_vertex) as usize]));
        }
    }

    /// What is uploaded in a frame, in the order of [`targets`].
    pub fn uploads<'a>(&'a self, scene: &'a ResidentScene) -> Vec<&'a [u8]> {
        let g = &self.geometry;
        let of_mesh = |d: &'a Deformable| -> [&'a [u8]; 4] {
            let part = part(g, d.mesh);
            [
                bytemuck::cast_slice(&g.nodes[part.nodes]),
                bytemuck::cast_slice(&g.triangle_corners[part.triangles.clone()]),
                bytemuck::cast_slice(&g.triangle_rest[part.triangles]),
                bytemuck::cast_slice(&g.vertices[part.vertices]),
            ]
        };
        let shapes = scene.deformables.iter().flat_map(of_mesh);
        shapes.chain([bytemuck::cast_slice(&self.previous)]).collect()
    }
}

/// Where the uploads of a frame go; nothing if nothing deforms.
pub(crate) fn targets(scene: &ResidentScene, s: &SceneResources, previous: Option<Range>) -> Vec<Range> {
    let g = &scene.geometry;
    let at = |range: Range, name, first: usize, count: usize, each: usize| Range {
        name,
        offset: range.offset + (first * each) as u64,
        size: (count * each) as u64,
        ..range
    };
    let of_mesh = |d: &Deformable| {
        let part = part(g, d.mesh);
        let (node, slot, vertex) =
            (g.tlas_capacity as usize + part.nodes.start, part.triangles.start, part.vertices.start);
        [
            at(s.nodes, "deformed nodes", node, part.nodes.len(), 80),
            at(s.corners, "deformed corners", slot, part.triangles.len(), 32),
            at(s.rest, "deformed corners", slot, part.triangles.len(), 4),
            at(s.vertices, "deformed vertices", vertex, part.vertices.len(), size_of::<shaders::Vertex>()),
        ]
    };
    let triangles = previous_triangles(scene);
    let previous = previous.map(|range| at(range, "previous corners", 0, triangles, 36));
    scene.deformables.iter().flat_map(of_mesh).chain(previous.filter(|_| triangles > 0)).collect()
}

/// Triangles of all meshes that deform.
pub(crate) fn previous_triangles(scene: &ResidentScene) -> usize {
    scene.deformables.iter().map(|d| d.rest.triangles.len()).sum()
}

/// Marks the instances whose meshes deform.
pub(crate) fn mark(scene: &ResidentScene, instances: &mut [shaders::Instance]) {
    for deformable in &scene.deformables {
        let flags = &mut instances[deformable.instance].flags;
        *flags |= shaders::INSTANCE_DEFORMS | deformable.first << shaders::INSTANCE_SHAPE_SHIFT;
    }
}

/// Whether deformations are those of a scene, and finite; else what is wrong.
pub(crate) fn check(scene: &ResidentScene, deformations: &[Deformation]) -> std::result::Result<(), String> {
    if deformations.len() != scene.deformables.len() {
        return Err(format!("{} deformations instead of {}", deformations.len(), scene.deformables.len()));
    }
    let is_finite =
        |d: &Deformation| d.joints.iter().all(glam::DAffine3::is_finite) && d.weights.iter().all(|w| w.is_finite());
    let matches = |(deformable, d): (&Deformable, &Deformation)| deformable.instance == d.instance && is_finite(d);
    let wrong = scene.deformables.iter().zip(deformations).position(|pair| !matches(pair));
    wrong.map_or(Ok(()), |i| Err(format!("deformation {i}")))
}
