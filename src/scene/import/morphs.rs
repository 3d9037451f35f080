//! Morph targets and their weights.

use gltf::json;
use gltf::json::accessor::Accessor;
use serde_json::Value;

use super::accessor::Encoding;
use super::document::Document;
use super::mesh::Part;
use crate::Result;
use crate::scene::{Mesh, MorphTarget};

/// What of a target moves vertices; glTF has displacements of colours and texture coordinates as well.
const READ: [&str; 3] = ["POSITION", "NORMAL", "TANGENT"];

impl Part<'_> {
    /// The morph targets of a primitive with the attributes that the file gives its vertices.
    pub(super) fn targets(&self, mesh: &Mesh, count: u64, notices: &mut Vec<String>) -> Result<Vec<MorphTarget>> {
        let sources = self.primitive.targets.as_deref().unwrap_or_default();
        if let Some(ignored) = self.ignored() {
            notices.push(format!("{} has morph targets of {ignored}, which are ignored", self.place));
        }
        sources.iter().enumerate().map(|(number, source)| self.target(number, source, mesh, count)).collect()
    }

    fn target(&self, number: usize, source: &json::mesh::MorphTarget, mesh: &Mesh, count: u64) -> Result<MorphTarget> {
        let read = |index: Option<json::Index<Accessor>>, name: &str, encoding| {
            let Some(index) = index else { return Ok(Vec::new()) };
            let place = format!("{}, {name} of morph target {number}", self.place);
            self.check_count(index.value(), count, &place)?;
            self.document.spend(mesh.positions.len())?;
            let deltas = super::accessor::read_floats::<3>(self.document, index.value(), encoding, &place)?;
            Ok(deltas.into_iter().map(glam::Vec3::from).collect())
        };
        // What is found from the shape of the triangles, or from the texture's, has nothing to be added to.
        let normals = source.normals.filter(|_| !mesh.normals.is_empty());
        let tangents = source.tangents.filter(|_| !mesh.tangents.is_empty());
        Ok(MorphTarget {
            positions: read(source.positions, READ[0], Encoding::Quantized)?,
            normals: read(normals, READ[1], Encoding::Normalized)?,
            tangents: read(tangents, READ[2], Encoding::Normalized)?,
        })
    }

    /// The first attribute of a target that is not read.
    fn ignored(&self) -> Option<&str> {
        let (mesh, primitive) = self.number;
        let targets = self.document.tree.pointer(&format!("/meshes/{mesh}/primitives/{primitive}/targets"))?;
        let mut names = targets.as_array()?.iter().filter_map(Value::as_object).flat_map(|target| target.keys());
        names.find(|name| !READ.contains(&name.as_str()) && !name.starts_with('_')).map(String::as_str)
    }
}

/// The weights that a node's mesh has where no animation drives them: the node's own, or else the mesh's, or else none.
/// `place` names both.
pub(super) fn rest_weights(
    document: &Document,
    node: usize,
    mesh: usize,
    targets: usize,
    place: &str,
) -> Result<Vec<f64>> {
    let of_node = document.root.nodes.get(node).and_then(|node| node.weights.as_deref());
    let of_mesh = document.root.meshes.get(mesh).and_then(|mesh| mesh.weights.as_deref());
    document.spend(targets)?;
    let Some(weights) = of_node.or(of_mesh).filter(|_| targets > 0) else { return Ok(vec![0.0; targets]) };
    if weights.len() != targets {
        let count = weights.len();
        return Err(document.bad(format!("{place} has {count} weights for {targets} morph targets: export it again")));
    }
    if !weights.iter().all(|weight| weight.is_finite()) {
        return Err(document.bad(format!("{place} has a weight of a morph target that is not finite: repair it")));
    }
    Ok(weights.iter().copied().map(f64::from).collect())
}
