//! The parsed file: JSON, buffers, and how to complain about them.

use std::cell::Cell;
use std::path::{Path, PathBuf};

use gltf::json;
use serde_json::Value;

use super::container::{self, Container, OrMessage};
use super::extensions;
use crate::{Error, Result};

/// The most vertices and triangles a file may hold in all. Beyond it no device that we know could hold the scene, and
/// a small hostile file that uses the same data again and again is stopped.
const MAX_ELEMENTS: u64 = 1 << 26;

/// A glTF file with its buffers in memory.
pub(super) struct Document {
    path: PathBuf,
    /// The file as the `gltf` crate sees it. Indices in it are not checked: use `get`.
    pub root: json::Root,
    /// The same as plain JSON, in which extensions can be searched.
    pub tree: Value,
    buffers: Vec<Option<Vec<u8>>>,
    spent: Cell<u64>,
}

impl Document {
    /// Parses the file, refuses required extensions that are not supported, and loads the buffers.
    pub fn open(bytes: &[u8], path: &Path) -> Result<Self> {
        let bad = |message: String| Error::Scene { path: path.to_owned(), message };
        let Container { json, binary } = container::split(bytes).map_err(bad)?;
        let tree: Value = serde_json::from_slice(json)
            .map_err(|error| bad(format!("not valid JSON ({error}): give a .gltf or .glb file of version 2")))?;
        extensions::check_required(&tree, path)?;
        check_version(&tree).map_err(bad)?;
        check_indices(&tree).map_err(bad)?;
        let root = parse(json, &tree).map_err(|error| bad(format!("not valid glTF ({error}): export it again")))?;
        let mut document = Self { path: path.to_owned(), root, tree, buffers: Vec::new(), spent: Cell::new(0) };
        document.buffers = document.load_buffers(binary)?;
        Ok(document)
    }

    /// An error about the content of the file.
    pub fn bad(&self, message: impl Into<String>) -> Error {
        Error::Scene { path: self.path.clone(), message: message.into() }
    }

    /// An error about a feature that is not supported.
    pub fn unsupported(&self, place: impl Into<String>, feature: impl Into<String>, advice: &str) -> Error {
        Error::Unsupported {
            path: self.path.clone(),
            place: place.into(),
            feature: feature.into(),
            advice: advice.to_owned(),
        }
    }

    /// Counts what is kept in memory against [`MAX_ELEMENTS`].
    pub fn spend(&self, elements: usize) -> Result<()> {
        self.spent.set(self.spent.get().saturating_add(elements as u64));
        if self.spent.get() <= MAX_ELEMENTS {
            return Ok(());
        }
        Err(self.bad(format!("more than {MAX_ELEMENTS} vertices and triangles in all: split the scene")))
    }

    /// The bytes that a URI of the file stands for; `place` names the object that has it.
    pub fn resolve(&self, uri: &str, place: &str) -> Result<Vec<u8>> {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        container::resolve(uri, folder).map_err(|message| self.bad(format!("{place}: {message}")))
    }

    /// The bytes of a buffer view and the stride it gives, if any; `place` names the object that uses it.
    pub fn view(&self, index: usize, place: &str) -> Result<(&[u8], Option<usize>)> {
        let missing = || self.bad(format!("{place} uses buffer view {index}, which does not exist: export it again"));
        let view = self.root.buffer_views.get(index).ok_or_else(missing)?;
        let buffer = view.buffer.value();
        let data = match self.buffers.get(buffer) {
            Some(Some(data)) => data,
            Some(None) => {
                return Err(self.bad(format!("{place} uses buffer {buffer}, which has no data: export it again")));
            }
            None => {
                return Err(self.bad(format!("{place} uses buffer {buffer}, which does not exist: export it again")));
            }
        };
        let start = view.byte_offset.unwrap_or_default().0;
        let range = start
            .checked_add(view.byte_length.0)
            .and_then(|end| Some(usize::try_from(start).ok()?..usize::try_from(end).ok()?));
        let bytes = range.and_then(|range| data.get(range)).ok_or_else(|| {
            self.bad(format!(
                "{place} uses buffer view {index} ({} bytes from {start}), but buffer {buffer} has {}: export it again",
                view.byte_length.0,
                data.len()
            ))
        })?;
        Ok((bytes, view.byte_stride.map(|stride| stride.0)))
    }

    /// A node by kind and name or number, for messages.
    pub fn node_label(&self, index: usize) -> String {
        label("node", index, self.root.nodes.get(index).and_then(|n| n.name.as_deref()))
    }

    /// A mesh by kind and name or number, for messages.
    pub fn mesh_label(&self, index: usize) -> String {
        label("mesh", index, self.root.meshes.get(index).and_then(|m| m.name.as_deref()))
    }

    fn load_buffers(&self, mut binary: Option<&[u8]>) -> Result<Vec<Option<Vec<u8>>>> {
        let mut buffers = Vec::with_capacity(self.root.buffers.len());
        for (index, buffer) in self.root.buffers.iter().enumerate() {
            let place = label("buffer", index, buffer.name.as_deref());
            let data = match &buffer.uri {
                Some(uri) => Some(self.resolve(uri, &place)?),
                None if index == 0 => binary.take().map(<[u8]>::to_vec),
                None => None, // such as the fallback of a compressed buffer: an error only if something uses it
            };
            if let Some(data) = &data
                && (data.len() as u64) < buffer.byte_length.0
            {
                let (needed, length) = (buffer.byte_length.0, data.len());
                return Err(self.bad(format!("{place} should have {needed} bytes, but has {length}: copy it again")));
            }
            buffers.push(data);
        }
        Ok(buffers)
    }
}

/// An object by kind and name or number.
pub(super) fn label(kind: &str, index: usize, name: Option<&str>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{kind} '{name}'"),
        _ => format!("{kind} {index}"),
    }
}

/// The object's own name, or one made up from its kind and number.
pub(super) fn name_or(kind: &str, index: usize, name: Option<&str>) -> String {
    match name {
        Some(name) if !name.is_empty() => name.to_owned(),
        _ => format!("{kind} {index}"),
    }
}

/// Parses into the crate's types. They demand two members that the specification makes optional, so what fails is
/// tried again with these filled in; the message is the first one's, because it has a line number.
fn parse(json: &[u8], tree: &Value) -> serde_json::Result<json::Root> {
    json::deserialize::from_slice(json).or_else(|error| {
        let mut tree = tree.clone();
        for scene in members(&mut tree, "scenes") {
            scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
        }
        for animation in members(&mut tree, "animations") {
            if let Some(Value::Array(channels)) = animation.get_mut("channels") {
                channels.retain(|channel| channel.pointer("/target/node").is_some()); // nothing to move without one
            }
        }
        json::deserialize::from_value(tree).map_err(|_| error)
    })
}

fn members<'a>(tree: &'a mut Value, key: &str) -> impl Iterator<Item = &'a mut serde_json::Map<String, Value>> {
    let array = tree.get_mut(key).and_then(Value::as_array_mut);
    array.into_iter().flatten().filter_map(Value::as_object_mut)
}

fn check_version(tree: &Value) -> OrMessage<()> {
    let text = |key| tree.pointer(key).and_then(Value::as_str);
    match (text("/asset/version"), text("/asset/minVersion")) {
        (_, Some(least)) if least != "2.0" => Err(format!("needs glTF {least}, but only 2.0 is known")),
        (Some(version), _) if version.starts_with("2.") => Ok(()),
        (Some(version), _) => Err(format!("is glTF {version}, but only 2.0 is known: convert it")),
        (None, _) => Err("has no asset.version: is it glTF 2.0?".to_owned()),
    }
}

/// Members that hold indices or enumerations, which the crate would silently truncate to 32 bits.
const INDEX_KEYS: [&str; 25] = [
    "buffer",
    "bufferView",
    "camera",
    "children",
    "componentType",
    "index",
    "indices",
    "input",
    "inverseBindMatrices",
    "joints",
    "light",
    "magFilter",
    "material",
    "mesh",
    "mode",
    "nodes",
    "node",
    "output",
    "sampler",
    "scene",
    "skeleton",
    "skin",
    "source",
    "attributes",
    "targets",
];

/// Refuses indices that do not fit 32 bits. The recursion is bounded by the JSON parser's own limit of 128 levels.
fn check_indices(tree: &Value) -> OrMessage<()> {
    let children: Vec<(&str, &Value)> = match tree {
        Value::Object(map) => map.iter().map(|(key, value)| (key.as_str(), value)).collect(),
        Value::Array(array) => array.iter().map(|value| ("", value)).collect(),
        _ => return Ok(()),
    };
    for (key, value) in children {
        if INDEX_KEYS.contains(&key) {
            check_index(key, value)?;
        }
        if key != "extras" {
            check_indices(value)?;
        }
    }
    Ok(())
}

fn check_index(key: &str, value: &Value) -> OrMessage<()> {
    match value {
        Value::Number(number) => match number.as_u64() {
            Some(index) if index <= u64::from(u32::MAX) => Ok(()),
            _ => Err(format!("'{key}' is {number}, which is no index: export it again")),
        },
        Value::Array(targets) if key == "targets" => targets.iter().try_for_each(|v| check_index("attributes", v)),
        Value::Array(array) => array.iter().filter(|v| v.is_number()).try_for_each(|v| check_index(key, v)),
        Value::Object(map) if key == "attributes" => map.values().try_for_each(|v| check_index(key, v)),
        _ => Ok(()),
    }
}
