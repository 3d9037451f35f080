//! glTF 2.0 files into a [`Scene`].
//!
//! The JSON goes through the `gltf` crate's data types; everything that follows an index, a count or an offset of the
//! file goes through our own checked readers, because a hostile file must end in an [`Error`](crate::Error), not in a
//! panic or in a gigantic allocation. What is not supported is refused by name, what is approximated is a notice.

mod accessor;
mod animation;
mod container;
mod defaults;
mod document;
mod extensions;
mod geometry;
mod images;
mod materials;
mod mesh;
mod nodes;
mod tangents;

use std::path::Path;

use glam::DVec3;

use self::document::Document;
use super::Scene;
use crate::Result;

/// Loads the default scene of a `.gltf` or `.glb` file, completed with a camera and a light if it has none
/// ([`Scene::complete`]).
///
/// # Errors
/// [`Error::Io`](crate::Error::Io) if the file cannot be read, [`Error::Scene`](crate::Error::Scene) if it is not
/// valid, [`Error::Unsupported`](crate::Error::Unsupported) if it needs what stillray does not have: skins and morph
/// targets of a node of the scene, a third set of texture coordinates, or a required extension other than
/// `KHR_lights_punctual`, `KHR_materials_unlit`, `KHR_materials_emissive_strength`, `KHR_texture_transform` and
/// `KHR_mesh_quantization`.
pub fn load(path: &Path) -> Result<Scene> {
    load_scene(path, None)
}

/// As [`load`], of the file's scene number `scene` (from 0), or of the default one.
///
/// # Errors
/// As [`load`], and [`Error::Scene`](crate::Error::Scene) if there is no such scene.
pub fn load_scene(path: &Path, scene: Option<usize>) -> Result<Scene> {
    load_slice(&container::read_regular_file(path)?, path, scene)
}

/// As [`load_scene`], from the bytes of a `.gltf` or `.glb` file. `path` names the file in messages, and relative
/// URIs are looked for in its folder.
///
/// # Errors
/// As [`load_scene`].
pub fn load_slice(bytes: &[u8], path: &Path, scene: Option<usize>) -> Result<Scene> {
    let document = Document::open(bytes, path)?;
    let mut out = Scene { name: stem(path), notices: extensions::notices(&document), ..Scene::default() };
    let placed = nodes::flatten(&document, scene, &mut out)?;
    let mut materials = materials::Table::new(&document);
    mesh::import(&document, &placed, &mut materials, &mut out)?;
    nodes::import_cameras(&document, &placed, &mut out)?;
    nodes::import_lights(&document, &placed, &mut out)?;
    animation::import(&document, &placed, &mut out)?;
    materials.finish(&mut out)?;
    check_extent(&document, &out)?;
    out.complete();
    Ok(out)
}

fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "scene".to_owned(), |s| s.to_string_lossy().into_owned())
}

/// The renderer rounds camera-relative positions to f32: a scene that does not fit is refused here, with a reason.
fn check_extent(document: &Document, scene: &Scene) -> Result<()> {
    if scene.instances.is_empty() {
        return Err(document.bad("there is no triangle in the scene: nothing to render"));
    }
    let pose = scene.pose(0.0);
    let largest = f64::from(f32::MAX) / 4.0;
    let inside = |v: DVec3| v.is_finite() && v.abs().max_element() < largest;
    for (instance, transform) in scene.instances.iter().zip(&pose.instances) {
        let columns = [transform.x_axis, transform.y_axis, transform.z_axis, transform.translation];
        if !columns.into_iter().all(inside) {
            let name = &scene.nodes[instance.node].name;
            return Err(document.bad(format!("the transform of node '{name}' overflows 32-bit floats: scale it down")));
        }
    }
    match scene.bounds(&pose) {
        Some((low, high)) if inside(low) && inside(high) => Ok(()),
        _ => Err(document.bad("the scene extends beyond the range of 32-bit floats: scale it down")),
    }
}
