//! Meshes: all triangles of a glTF mesh become one [`Mesh`], with a material a triangle.

use std::collections::HashMap;

use glam::{Vec2, Vec3, Vec4};
use gltf::json;
use gltf::json::mesh::{Mode, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{self, Encoding};
use super::document::{Document, name_or};
use super::materials::Table;
use super::nodes::{self, Placed};
use super::skins::Skins;
use super::{geometry, morphs, tangents};
use crate::Result;
use crate::scene::{Deformer, Instance, Material, Mesh, Scene};

/// Takes over each mesh that a node of the scene uses, with an instance a node: once, but for meshes that deform, of which
/// each instance gets its own.
pub(super) fn import(document: &Document, placed: &[Placed], materials: &mut Table, scene: &mut Scene) -> Result<()> {
    let node_of = nodes::node_of(document, placed);
    let mut skins = Skins::new(document, &node_of);
    // Whether a mesh is shown with a skin belongs to the key: without one its joints do not count.
    let mut known = HashMap::<(usize, bool), Option<usize>>::new();
    for (node, source) in placed.iter().enumerate().map(|(node, placed)| (node, placed.source)) {
        let Some(user) = document.root.nodes.get(source) else { continue };
        let Some(index) = user.mesh.map(|mesh| mesh.value()) else { continue };
        let mesh = match known.get(&(index, user.skin.is_some())) {
            Some(&mesh) => mesh.map(|mesh| own(document, mesh, &mut scene.meshes)).transpose()?,
            None => {
                let mesh = import_mesh(document, index, user.skin.is_some(), materials, &mut scene.notices)?;
                let number = mesh.map(|mesh| {
                    scene.meshes.push(mesh);
                    scene.meshes.len() - 1
                });
                known.insert((index, user.skin.is_some()), number);
                number
            }
        };
        let Some(mesh) = mesh else { continue };
        scene.instances.push(Instance { node, mesh });
        let shape = &scene.meshes[mesh];
        if shape.deforms() {
            let place = format!("{} ({})", document.node_label(source), document.mesh_label(index));
            let skin = user.skin.map(|skin| skins.bind(skin.value(), &place, shape, &mut scene.skins)).transpose()?;
            let weights = morphs::rest_weights(document, source, index, shape.morph_targets.len(), &place)?;
            scene.deformers.push(Deformer { instance: scene.instances.len() - 1, skin, weights });
        }
    }
    Ok(())
}

/// The mesh for one more instance: a copy if the mesh deforms.
fn own(document: &Document, mesh: usize, meshes: &mut Vec<Mesh>) -> Result<usize> {
    let source = &meshes[mesh];
    if !source.deforms() {
        return Ok(mesh);
    }
    document.spend(source.positions.len() * (1 + source.morph_targets.len()) + source.triangles.len())?;
    meshes.push(source.clone());
    Ok(meshes.len() - 1)
}

/// The mesh, or none if it has no triangles.
fn import_mesh(
    document: &Document,
    index: usize,
    skinned: bool,
    materials: &mut Table,
    notices: &mut Vec<String>,
) -> Result<Option<Mesh>> {
    let missing = || document.bad(format!("mesh {index} does not exist: export the file again"));
    let source = document.root.meshes.get(index).ok_or_else(missing)?;
    let mut mesh = Mesh { name: name_or("mesh", index, source.name.as_deref()), ..Mesh::default() };
    for (number, primitive) in source.primitives.iter().enumerate() {
        let place = format!("{}, primitive {number}", document.mesh_label(index));
        let part = Part { document, primitive, place: &place, number: (index, number), skinned };
        if let Some(part) = part.import(materials, notices)? {
            document.spend(part.positions.len() + part.triangles.len())?;
            let (before, own) = (mesh.morph_targets.len(), part.morph_targets.len());
            if !mesh.triangles.is_empty() && before != own {
                let message = format!("{place} has {own} morph targets, but an earlier primitive {before}");
                return Err(document.bad(message + ": export it again"));
            }
            geometry::append(&mut mesh, part);
        }
    }
    Ok((!mesh.triangles.is_empty()).then_some(mesh))
}

/// One primitive.
pub(super) struct Part<'a> {
    pub document: &'a Document,
    pub primitive: &'a json::mesh::Primitive,
    /// The mesh and the primitive, for messages.
    pub place: &'a str,
    /// Numbers of the mesh and of the primitive.
    pub number: (usize, usize),
    /// Whether a skin bends it.
    skinned: bool,
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
        mesh.morph_targets = self.targets(&mesh, count, notices)?;
        if self.skinned {
            self.follow_joints(&mut mesh, count, notices)?;
        }
        self.complete(geometry::compact(mesh), materials.material(material), notices).map(Some)
    }

    pub fn attribute(&self, semantic: &Semantic) -> Option<usize> {
        self.primitive.attributes.get(&Checked::Valid(semantic.clone())).map(json::Index::value)
    }

    /// Reads an attribute if the primitive has it; it must have as many elements as there are positions.
    pub fn read<const N: usize>(&self, semantic: &Semantic, encoding: Encoding, count: u64) -> Result<Vec<[f32; N]>> {
        let Some(index) = self.attribute(semantic) else { return Ok(Vec::new()) };
        let place = format!("{}, {}", self.place, semantic.to_string());
        self.check_count(index, count, &place)?;
        accessor::read_floats(self.document, index, encoding, &place)
    }

    /// Refuses an array that has not as many elements as there are positions.
    pub fn check_count(&self, index: usize, count: u64, place: &str) -> Result<()> {
        let own = accessor::count(self.document, index, place)?;
        if own == count {
            return Ok(());
        }
        let message = format!("{place} (accessor {index}) has {own} elements for {count} positions: export it again");
        Err(self.document.bad(message))
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
