//! Which glTF extensions are supported, refused and ignored.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;

use super::document::{Document, label};
use crate::{Error, Result};

/// What a file may require.
const SUPPORTED: [&str; 8] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// What changes no picture: metadata, and the compressed twins of data that is there uncompressed as well.
const HARMLESS: [&str; 9] = [
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_meshopt_compression",
    "KHR_texture_basisu",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_packing_occlusionRoughnessMetallic",
    "MSFT_texture_dds",
];

/// What has to be done to a file to be rid of an extension.
fn advice(extension: &str) -> &'static str {
    match extension {
        "KHR_draco_mesh_compression" | "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "decompress the file, for instance with gltf-transform"
        }
        "KHR_texture_basisu" | "EXT_texture_webp" | "MSFT_texture_dds" | "EXT_texture_avif" => {
            "convert the textures to PNG or JPEG"
        }
        _ => "export the file without it",
    }
}

/// Refuses a file that requires an extension which is not supported, naming what uses it.
pub(super) fn check_required(tree: &Value, path: &Path) -> Result<()> {
    let required = tree.get("extensionsRequired").and_then(Value::as_array).into_iter().flatten();
    for name in required.filter_map(Value::as_str) {
        let metadata = name.starts_with("KHR_xmp");
        if SUPPORTED.contains(&name) || metadata {
            continue;
        }
        let place = uses(tree).get(name).and_then(|users| users.first().map(|user| owner(tree, user)));
        return Err(Error::Unsupported {
            path: path.to_owned(),
            place: place.unwrap_or_else(|| "the file".to_owned()),
            feature: name.to_owned(),
            advice: advice(name).to_owned(),
        });
    }
    Ok(())
}

/// One line for each extension that is used and ignored, with what it would change.
pub(super) fn notices(document: &Document) -> Vec<String> {
    let ignored = uses(&document.tree).into_iter();
    let ignored = ignored.filter(|(name, _)| ![&SUPPORTED[..], &HARMLESS[..]].concat().contains(&name.as_str()));
    ignored.map(|(name, users)| format!("{name} is ignored ({})", listing(&document.tree, &users))).collect()
}

/// An element of a top-level array: `("materials", 3)`.
type User = (String, usize);

/// What uses each extension, in the order of the file.
fn uses(tree: &Value) -> BTreeMap<String, Vec<User>> {
    let mut found = BTreeMap::<String, Vec<User>>::new();
    for (key, elements) in tree.as_object().into_iter().flatten() {
        for (index, element) in elements.as_array().into_iter().flatten().enumerate() {
            visit(element, &mut |name| {
                let users = found.entry(name.to_owned()).or_default();
                let user = (key.clone(), index);
                if users.last() != Some(&user) {
                    users.push(user);
                }
            });
        }
    }
    found
}

/// Calls back with the names of all extensions in a tree; the JSON parser bounds its depth.
fn visit(tree: &Value, found: &mut dyn FnMut(&str)) {
    match tree {
        Value::Object(map) => {
            for (key, value) in map {
                if key == "extensions" {
                    value.as_object().into_iter().flatten().for_each(|(name, _)| found(name));
                }
                if key != "extras" {
                    visit(value, found);
                }
            }
        }
        Value::Array(array) => array.iter().for_each(|value| visit(value, found)),
        _ => {}
    }
}

fn listing(tree: &Value, users: &[User]) -> String {
    const SHOWN: usize = 4;
    let mut text = users.iter().take(SHOWN).map(|user| user_label(tree, user)).collect::<Vec<_>>().join(", ");
    if users.len() > SHOWN {
        text += &format!(" and {} more", users.len() - SHOWN);
    }
    text
}

fn user_label(tree: &Value, (key, index): &User) -> String {
    let kind = match key.as_str() {
        "meshes" => "mesh",
        "bufferViews" => "buffer view",
        other => other.strip_suffix('s').unwrap_or(other),
    };
    let name = tree.get(key).and_then(|array| array.get(index)?.get("name")?.as_str());
    label(kind, *index, name)
}

/// What the author of a file knows the user by: the node of a mesh, the mesh of a buffer view, the material of a
/// texture.
fn owner(tree: &Value, user: &User) -> String {
    let (key, index) = (user.0.as_str(), user.1);
    let wanted = match key {
        "bufferViews" => find(tree, "accessors", |a| refers(a, "bufferView", index)),
        "accessors" => find(tree, "meshes", |m| primitive_refers(m, index)),
        "meshes" => find(tree, "nodes", |n| refers(n, "mesh", index)),
        "textures" => find(tree, "materials", |m| mentions(m, "index", index)),
        "images" => find(tree, "textures", |t| mentions(t, "source", index)),
        _ => None,
    };
    let own = user_label(tree, user);
    match wanted {
        Some(parent) if key == "bufferViews" || key == "accessors" => owner(tree, &parent),
        Some(parent) => format!("{} ({own})", owner(tree, &parent)),
        None => own,
    }
}

fn find(tree: &Value, key: &str, wanted: impl Fn(&Value) -> bool) -> Option<User> {
    let index = tree.get(key)?.as_array()?.iter().position(wanted)?;
    Some((key.to_owned(), index))
}

fn refers(object: &Value, key: &str, index: usize) -> bool {
    object.get(key).and_then(Value::as_u64) == Some(index as u64)
}

fn primitive_refers(mesh: &Value, accessor: usize) -> bool {
    mesh.get("primitives").and_then(Value::as_array).into_iter().flatten().any(|primitive| {
        let attributes = primitive.get("attributes").and_then(Value::as_object);
        refers(primitive, "indices", accessor)
            || attributes.into_iter().flatten().any(|(_, value)| value.as_u64() == Some(accessor as u64))
    })
}

fn mentions(tree: &Value, key: &str, index: usize) -> bool {
    match tree {
        Value::Object(map) => refers(tree, key, index) || map.values().any(|value| mentions(value, key, index)),
        Value::Array(array) => array.iter().any(|value| mentions(value, key, index)),
        _ => false,
    }
}
