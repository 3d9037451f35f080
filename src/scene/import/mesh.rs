//! Meshes: all triangles of a glTF mesh become one [`Mesh`], with a material a triangle.

use std::collections::HashMap;

use glam::{Vec2, Vec3, Vec4};
use gltf::json;
use gltf::json::mesh::{Mode, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{self, Encoding};
use super::document::{Document, name_or};
use super::materials::Table;
use super::nodes::Placed;
use super::{geometry, tangents};
use crate::Result;
use crate::scene::{Instance, Material, Mesh, Scene};

/// Takes over each mesh that a node of the scene uses, once, with an instance a node.
pub(super) fn import(document: &Document, placed: &[Placed], materials: &mut Table, scene: &mut Scene) -> Result<()> {
    let mut known = HashMap::<usize, Option<usize>>::new();
    for (node, source) in placed.iter().enumerate().map(|(node, placed)| (node, placed.source)) {
        let Some(index) = document.root.nodes.get(source).and_then(|n| n.mesh.map(|mesh| mesh.value())) else {
            continue;
        };
        refuse_deformation(document, source, index)?;
        let mesh = match known.get(&index) {
            Some(&mesh) => mesh,
            None => {
                let mesh = import_mesh(document, index, materials, &mut scene.notices)?;
                let number = mesh.map(|mesh| {
                    scene.meshes.push(mesh);
                    scene.meshes.len() - 1
                });
                known.insert(index, number);
                number
            }
        };
        scene.instances.extend(mesh.map(|mesh| Instance { node, mesh }));
    }
    Ok(())
}

/// Skins and morph targets move vertices, which the renderer cannot yet: drawn without, they would be wrong.
fn refuse_deformation(document: &Document, node: usize, mesh: usize) -> Result<()> {
    let place = || format!("{} ({})", document.node_label(node), document.mesh_label(mesh));
    let advice = "export it without, or with the deformation baked in";
    if document.root.nodes.get(node).is_some_and(|n| n.skin.is_some()) {
        return Err(document.unsupported(place(), "a skin", advice));
    }
    let primitives = document.root.meshes.get(mesh).map_or(&[][..], |mesh| &mesh.primitives);
    if primitives.iter().any(|primitive| primitive.targets.as_ref().is_some_and(|targets| !targets.is_empty())) {
        return Err(document.unsupported(place(), "morph targets", advice));
    }
    Ok(())
}

/// The mesh, or none if it has no triangles.
fn import_mesh(
    document: &Document,
    index: usize,
    materials: &mut Table,
    notices: &mut Vec<String>,
) -> Result<Option<Mesh>> {
    let missing = || document.bad(format!("mesh {index} does not exist: export the file again"));
    let source = document.root.meshes.get(index).ok_or_else(missing)?;
    let mut mesh = Mesh { name: name_or("mesh", index, source.name.as_deref()), ..Mesh::default() };
    for (number, primitive) in source.primitives.iter().enumerate() {
        let place = format!("{}, primitive {number}", document.mesh_label(index));
        let part = Part { document, primitive, place: &place }.import(materials, notices)?;
        if let Some(part) = part {
            document.spend(part.positions.len() + part.triangles.len())?;
            geometry::append(&mut mesh, part);
        }
    }
    Ok((!mesh.triangles.is_empty()).then_some(mesh))
}

/// One primitive.
struct Part<'a> {
    document: &'a Document,
    primitive: &'a json::mesh::Primitive,
    place: &'a str,
}

impl Part<'_> {
    /// The triangles with all their attributes, or none if there are none.
    fn import(&self, materials: &mut Table, notices: &mut Vec<String>) -> Result<Option<Mesh>> {
        let (document, place) = (self.document, self.place);
        let Checked::Valid(mode) = self.primitive.mode else {
            return Err(document.bad(format!("{place} has an unknown mode: export it again")));
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            notices.push(format!("{place} has points or lines, which are skipped"));
            return Ok(None);
        }
        let Some(position) = self.attribute(&Semantic::Positions) else {
            notices.push(format!("{place} has no POSITION and is skipped"));
            return Ok(None);
        };
        let count = accessor::count(document, position, place)?;
        let positions = self.read(&Semantic::Positions, Encoding::Quantized, count)?;
        let triangles = self.triangles(mode, positions.len(), notices)?;
        if triangles.is_empty() {
            return Ok(None);
        }
        let has_uvs = [0, 1].map(|set| self.attribute(&Semantic::TexCoords(set)).is_some());
        let index = self.primitive.material.map(|material| material.value());
        let material = materials.get(index, has_uvs, place)?;
        let mut mesh = self.vertices(positions, count, materials.material(material))?;
        mesh.triangle_materials = vec![material; triangles.len()];
        mesh.triangles = triangles;
        self.complete(geometry::compact(mesh), materials.material(material), notices).map(Some)
    }

    fn attribute(&self, semantic: &Semantic) -> Option<usize> {
        self.primitive.attributes.get(&Checked::Valid(semantic.clone())).map(json::Index::value)
    }

    /// Reads an attribute if the primitive has it; it must have as many elements as there are positions.
    fn read<const N: usize>(&self, semantic: &Semantic, encoding: Encoding, count: u64) -> Result<Vec<[f32; N]>> {
        let Some(index) = self.attribute(semantic) else { return Ok(Vec::new()) };
        let place = format!("{}, {}", self.place, semantic.to_string());
        let own = accessor::count(self.document, index, &place)?;
        if own != count {
            let message =
                format!("{place} (accessor {index}) has {own} elements for {count} positions: export it again");
            return Err(self.document.bad(message));
        }
        accessor::read_floats(self.document, index, encoding, &place)
    }

    fn vertices(&self, positions: Vec<[f32; 3]>, count: u64, material: &Material) -> Result<Mesh> {
        let normals = self.read(&Semantic::Normals, Encoding::Normalized, count)?;
        let wants_tangents = material.normal_texture.is_some() && !normals.is_empty();
        let tangents = match wants_tangents {
            true => self.read(&Semantic::Tangents, Encoding::Normalized, count)?,
            false => Vec::new(), // section 3.7.2.1: without normals, given tangents are ignored
        };
        let mut uvs = [Vec::new(), Vec::new()];
        for (set, uvs) in uvs.iter_mut().enumerate() {
            if reads_uv_set(material, set as u32) {
                let uv = self.read(&Semantic::TexCoords(set as u32), Encoding::Quantized, count)?;
                *uvs = uv.into_iter().map(Vec2::from).collect();
            }
        }
        Ok(Mesh {
            positions: positions.into_iter().map(Vec3::from).collect(),
            normals: normals.into_iter().map(Vec3::from).collect(),
            tangents: tangents.into_iter().map(Vec4::from).collect(),
            uvs,
            colors: self.colors(count)?,
            ..Mesh::default()
        })
    }

    fn colors(&self, count: u64) -> Result<Vec<Vec4>> {
        let semantic = Semantic::Colors(0);
        let accessors = &self.document.root.accessors;
        let kind = self.attribute(&semantic).and_then(|index| accessors.get(index)).map(|accessor| accessor.type_);
        if let Some(Checked::Valid(json::accessor::Type::Vec3)) = kind {
            let colors = self.read::<3>(&semantic, Encoding::Normalized, count)?;
            return Ok(colors.into_iter().map(|rgb| Vec3::from(rgb).extend(1.0)).collect());
        }
        let colors = self.read::<4>(&semantic, Encoding::Normalized, count)?;
        Ok(colors.into_iter().map(Vec4::from).collect())
    }

    /// Normals and tangents that the file leaves to us.
    fn complete(&self, mut mesh: Mesh, material: &Material, notices: &mut Vec<String>) -> Result<Mesh> {
        if mesh.normals.is_empty() {
            self.document.spend(3 * mesh.triangles.len())?;
            mesh = geometry::with_flat_normals(mesh);
        } else {
            let replaced = geometry::normalize_normals(&mut mesh);
            if replaced > 0 {
                notices.push(format!("{}: {replaced} normals are zero; their triangles' are used", self.place));
            }
        }
        if let Some(texture) = &material.normal_texture {
            if mesh.tangents.is_empty() {
                let uvs = mesh.uvs[texture.uv_set as usize & 1].clone();
                mesh = tangents::generate(mesh, &uvs, texture.transform);
            } else {
                tangents::normalize(&mut mesh);
            }
        }
        Ok(mesh)
    }

    /// The primitive as a list of triangles (section 3.7.2.1), all indices below `count`.
    fn triangles(&self, mode: Mode, count: usize, notices: &mut Vec<String>) -> Result<Vec<[u32; 3]>> {
        let place = self.place;
        let Some(indices) = self.primitive.indices else {
            return Ok(assemble(mode, count, |corner| corner as u32));
        };
        let indices = accessor::read_indices(self.document, indices.value(), &format!("{place}, indices"))?;
        if let Some(&index) = indices.iter().find(|&&index| index as usize >= count) {
            let message = format!("{place} has index {index}, but {count} vertices: export it again");
            return Err(self.document.bad(message));
        }
        if mode == Mode::Triangles && indices.len() % 3 != 0 {
            notices.push(format!("{place} has {} indices; the last, incomplete triangle is skipped", indices.len()));
        }
        Ok(assemble(mode, indices.len(), |corner| indices[corner]))
    }
}

fn assemble(mode: Mode, corners: usize, index: impl Fn(usize) -> u32) -> Vec<[u32; 3]> {
    let triangle = |corners: [usize; 3]| corners.map(&index);
    match mode {
        Mode::TriangleStrip => {
            (2..corners).map(|i| i - 2).map(|i| triangle([i, i + 1 + i % 2, i + 2 - i % 2])).collect()
        }
        Mode::TriangleFan => (2..corners).map(|i| triangle([i - 1, i, 0])).collect(),
        _ => (0..corners / 3).map(|t| triangle([3 * t, 3 * t + 1, 3 * t + 2])).collect(),
    }
}

fn reads_uv_set(material: &Material, set: u32) -> bool {
    let used = [
        &material.base_color_texture,
        &material.metallic_roughness_texture,
        &material.normal_texture,
        &material.occlusion_texture,
        &material.emissive_texture,
    ];
    used.into_iter().flatten().any(|texture| texture.uv_set == set)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_the_winding() {
        let list = |mode, corners| assemble(mode, corners, |corner| corner as u32);
        assert_eq!(list(Mode::Triangles, 7), [[0, 1, 2], [3, 4, 5]]);
        assert_eq!(list(Mode::TriangleStrip, 5), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(list(Mode::TriangleFan, 5), [[1, 2, 0], [2, 3, 0], [3, 4, 0]]);
        for mode in [Mode::Triangles, Mode::TriangleStrip, Mode::TriangleFan] {
            assert!((0..3).all(|corners| list(mode, corners).is_empty()));
        }
    }
}
