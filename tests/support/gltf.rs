//! Small glTF files made by hand: JSON that a test can edit, and one buffer.

#![allow(dead_code)] // each test takes what it needs

use std::path::{Path, PathBuf};

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::{Value, json};
use stillray::Error;
use stillray::scene::{Scene, import};

pub const U8: u32 = 5121;
pub const I8: u32 = 5120;
pub const U16: u32 = 5123;
pub const I16: u32 = 5122;
pub const U32: u32 = 5125;
pub const F32: u32 = 5126;

/// A glTF file in the making.
#[derive(Clone)]
pub struct File {
    pub json: Value,
    pub data: Vec<u8>,
}

impl File {
    /// One node with one mesh of one triangle, (0,0,0), (1,0,0), (0,1,0), without indices or normals.
    pub fn triangle() -> Self {
        let mut file = Self {
            json: json!({
                "asset": { "version": "2.0" },
                "scene": 0,
                "scenes": [{ "nodes": [0] }],
                "nodes": [{ "mesh": 0, "name": "the node" }],
                "meshes": [{ "name": "the mesh", "primitives": [{ "attributes": {} }] }],
                "accessors": [],
                "bufferViews": [],
            }),
            data: Vec::new(),
        };
        file.attribute("POSITION", &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        file
    }

    /// Two triangles with the corners of a unit square, upright texture coordinates, and a material with the given
    /// members. Of its two textures the first is red and green, half transparent; the second one is 16 bits deep.
    pub fn textured(material: Value) -> Self {
        let mut file = Self::triangle();
        file.attribute("POSITION", &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]);
        file.attribute("TEXCOORD_0", &[[0.0, 1.0], [1.0, 1.0], [0.0, 0.0], [1.0, 0.0]]);
        file.indices(&[0, 1, 2, 2, 1, 3]);
        file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
        file.json["materials"] = json!([material]);
        file.json["textures"] = json!([{ "source": 0 }, { "source": 1 }]);
        let small = png(image::DynamicImage::ImageRgba8(
            image::RgbaImage::from_raw(2, 1, vec![255, 0, 0, 255, 0, 255, 0, 128]).unwrap(),
        ));
        let deep =
            png(image::DynamicImage::ImageRgb16(image::ImageBuffer::from_pixel(1, 1, image::Rgb([0xffff, 0, 0x8000]))));
        file.json["images"] =
            json!([{ "uri": data_uri("image/png", &small) }, { "uri": data_uri("image/png", &deep) }]);
        file
    }

    /// Adds bytes to the buffer as a view of their own.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.data.len();
        self.data.extend(bytes);
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        push(&mut self.json["bufferViews"], json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }))
    }

    /// Adds an accessor over a view of its own.
    pub fn accessor(&mut self, component: u32, kind: &str, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        let accessor = json!({ "bufferView": view, "componentType": component, "type": kind, "count": count });
        push(&mut self.json["accessors"], accessor)
    }

    /// Adds an accessor of floats.
    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(F32, ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1], values.len(), &bytes)
    }

    /// Sets an attribute of the first primitive to floats.
    pub fn attribute<const N: usize>(&mut self, name: &str, values: &[[f32; N]]) -> usize {
        let accessor = self.floats(values);
        self.json["meshes"][0]["primitives"][0]["attributes"][name] = json!(accessor);
        accessor
    }

    /// Adds a morph target to the first primitive.
    pub fn target(&mut self, positions: &[[f32; 3]]) -> usize {
        let accessor = self.floats(positions);
        push(&mut self.json["meshes"][0]["primitives"][0]["targets"], json!({ "POSITION": accessor }));
        accessor
    }

    /// Sets a set of joints of the first primitive, of 8 bits, with their weights.
    pub fn joints(&mut self, set: u32, joints: &[[u8; 4]], weights: &[[f32; 4]]) {
        let accessor = self.accessor(U8, "VEC4", joints.len(), &joints.concat());
        self.json["meshes"][0]["primitives"][0]["attributes"][format!("JOINTS_{set}")] = json!(accessor);
        self.attribute(&format!("WEIGHTS_{set}"), weights);
    }

    /// The triangle, bent by a skin of the nodes 1 `root` and 2 `tip`, which is (0, 1, 0) above. Both are bound where they
    /// are; the first two vertices follow the root, the third one the tip.
    pub fn skinned() -> Self {
        let mut file = Self::triangle();
        file.joints(0, &[[0, 1, 0, 0]; 3], &[[1.0, 0.0, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0]]);
        push(&mut file.json["nodes"], json!({ "name": "root", "children": [2] }));
        push(&mut file.json["nodes"], json!({ "name": "tip", "translation": [0, 1, 0] }));
        file.json["nodes"][0]["skin"] = json!(0);
        file.json["scenes"][0]["nodes"] = json!([0, 1]);
        let mut matrices = [[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0f32]; 2];
        matrices[1][13] = -1.0;
        let bytes: Vec<u8> = matrices.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let accessor = file.accessor(F32, "MAT4", 2, &bytes);
        file.json["skins"] = json!([{ "name": "the skin", "joints": [1, 2], "inverseBindMatrices": accessor }]);
        file
    }

    /// Sets the indices of the first primitive, of 16 bits.
    pub fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let accessor = self.accessor(U16, "SCALAR", indices.len(), &bytes);
        self.json["meshes"][0]["primitives"][0]["indices"] = json!(accessor);
        accessor
    }

    /// Adds an animation with one channel of node 0.
    pub fn animate<const N: usize>(&mut self, path: &str, interpolation: &str, times: &[f32], values: &[[f32; N]]) {
        let times: Vec<[f32; 1]> = times.iter().map(|&t| [t]).collect();
        let (input, output) = (self.floats(&times), self.floats(values));
        let animation = json!({
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": path } }],
            "samplers": [{ "input": input, "output": output, "interpolation": interpolation }],
        });
        push(&mut self.json["animations"], animation);
    }

    /// The file as `.gltf`, with the buffer in a data URI.
    pub fn gltf(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        if json.get("buffers").is_none() {
            let uri = data_uri("application/octet-stream", &self.data);
            json["buffers"] = json!([{ "byteLength": self.data.len(), "uri": uri }]);
        }
        serde_json::to_vec(&json).unwrap()
    }

    /// The file as `.glb`.
    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.data.len() }]);
        let mut text = serde_json::to_vec(&json).unwrap();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut out = b"glTF\x02\0\0\0".to_vec();
        out.extend(u32::try_from(12 + 8 + text.len() + 8 + self.data.len()).unwrap().to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.data)] {
            out.extend(u32::try_from(chunk.len()).unwrap().to_le_bytes());
            out.extend(kind);
            out.extend(chunk);
        }
        out
    }

    pub fn load(&self) -> Result<Scene, Error> {
        import::load_slice(&self.gltf(), Path::new("test.gltf"), None)
    }

    /// Loads, and fails the test with the reason if that does.
    pub fn scene(&self) -> Scene {
        self.load().unwrap_or_else(|error| panic!("{error}\n{:#}", self.json))
    }

    /// The message with which loading fails.
    pub fn message(&self) -> String {
        match self.load() {
            Ok(_) => panic!("loads, but should not:\n{:#}", self.json),
            Err(error) => error.to_string(),
        }
    }
}

/// Appends to a JSON array, which is made if it is not there, and returns the index.
pub fn push(array: &mut Value, value: Value) -> usize {
    if array.is_null() {
        *array = json!([]);
    }
    let array = array.as_array_mut().unwrap();
    array.push(value);
    array.len() - 1
}

pub fn data_uri(mime: &str, bytes: &[u8]) -> String {
    format!("data:{mime};base64,{}", BASE64_STANDARD.encode(bytes))
}

pub fn png(image: image::DynamicImage) -> Vec<u8> {
    let mut bytes = Vec::new();
    image.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
    bytes
}

/// The folder of real models, or none, which is said.
pub fn shared_scenes() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes");
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped, no ../shared/scenes");
    None
}

/// All `.gltf` and `.glb` files under a folder, in alphabetical order.
pub fn models(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.extension().and_then(|e| e.to_str()) {
                _ if path.is_dir() => folders.push(path),
                Some("gltf" | "glb") => found.push(path),
                _ => {}
            }
        }
    }
    found.sort();
    found
}
