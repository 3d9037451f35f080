//! glTF 2.0 files into a [`Scene`].
//!
//! The JSON goes through the `gltf` crate's data types; everything that follows an index, a count or an offset of the
//! file goes through our own checked readers, because a hostile file must end in an [`Error`](crate::Error), not in a
//! panic or in a gigantic allocation. What is not supported is refused by name, what is approximated is a notice.

mod accessor;
mod animation;
mod container;
mod defaults;
mod dielectric;
mod document;
mod environment;
mod extensions;
mod extent;
mod extras;
mod geometry;
mod images;
mod materials;
mod mesh;
mod morphs;
mod nodes;
mod skins;
mod tangents;

use std::path::Path;

pub use self::environment::read as environment_map;

use self::document::Document;
use super::Scene;
use crate::Result;

/// Loads the default scene of a `.gltf` or `.glb` file, completed with a camera and a light if it has none
/// ([`Scene::complete`]).
///
/// # Errors
/// [`Error::Io`](crate::Error::Io) if the file cannot be read, [`Error::Scene`](crate::Error::Scene) if it is not
/// valid, [`Error::Unsupported`](crate::Error::Unsupported) if it needs what stillray does not have: a third set of
/// texture coordinates, or a required extension other than
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
    extras::environment(&document, scene, &mut out)?;
    animation::import(&document, &placed, &mut out)?;
    materials.finish(&mut out)?;
    extent::check(&document, &out)?;
    out.complete();
    Ok(out)
}

fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "scene".to_owned(), |s| s.to_string_lossy().into_owned())
}
