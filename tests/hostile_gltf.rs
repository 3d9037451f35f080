//! Damaged and hostile glTF files end in an error or in a scene, never in a panic, and never take the machine's memory:
//! real files and one that uses everything, mutated by the thousand, from fixed seeds.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

#[path = "support/gltf.rs"]
mod gltf;
#[path = "support/mutation.rs"]
mod mutation;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use glam::DAffine3;
use gltf::{File, push};
use mutation::{Random, damage, mutations, number, peak_memory, pointers, remove, value};
use rayon::prelude::*;
use serde_json::{Value, json};
use stillray::scene::deform::{Deformed, deform};
use stillray::scene::{import, requirements};

/// How many mutations are tried of each kind.
const INPUTS: usize = 8000;
/// Real models with more than this in their folder would make the test slow.
const MAX_FOLDER: u64 = 150 << 10;

/// A file that loads, taken apart.
struct Original {
    path: PathBuf,
    bytes: Vec<u8>,
    json: Value,
    binary: Option<Vec<u8>>,
}

impl Original {
    fn new(path: &Path, bytes: Vec<u8>) -> Self {
        if !bytes.starts_with(b"glTF") {
            return Self { path: path.to_owned(), json: serde_json::from_slice(&bytes).unwrap(), bytes, binary: None };
        }
        let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        let json = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
        let binary = Some(bytes[28 + length..].to_vec());
        Self { path: path.to_owned(), bytes, json, binary }
    }

    fn assemble(&self, json: Value, binary: Option<Vec<u8>>) -> Vec<u8> {
        match binary {
            Some(data) => File { json, data }.glb_as_is(),
            None => serde_json::to_vec(&json).unwrap(),
        }
    }
}

impl File {
    /// As `glb`, but with the buffers that the JSON has.
    fn glb_as_is(&self) -> Vec<u8> {
        let mut text = serde_json::to_vec(&self.json).unwrap();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut out = b"glTF\x02\0\0\0".to_vec();
        out.extend(((28 + text.len() + self.data.len()) as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.data)] {
            out.extend((chunk.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(chunk);
        }
        out
    }
}

/// A file that uses whatever import knows.
fn everything() -> File {
    let transform =
        json!({ "KHR_texture_transform": { "offset": [0.5, 0], "rotation": 1, "scale": [2, 1], "texCoord": 1 } });
    let mut file = File::textured(json!({
        "pbrMetallicRoughness": {
            "baseColorFactor": [1, 1, 1, 0.5],
            "baseColorTexture": { "index": 0, "extensions": transform },
            "metallicRoughnessTexture": { "index": 1, "texCoord": 1 },
        },
        "normalTexture": { "index": 1, "extensions": transform },
        "occlusionTexture": { "index": 0, "strength": 0.5 },
        "emissiveTexture": { "index": 0 },
        "emissiveFactor": [1, 1, 1],
        "alphaMode": "MASK",
        "alphaCutoff": 0.5,
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 2 }, "KHR_materials_sheen": {} },
    }));
    file.attribute("TEXCOORD_1", &[[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0]]);
    file.attribute("COLOR_0", &[[1.0, 0.5, 0.25]; 4]);
    let mut strip = file.json["meshes"][0]["primitives"][0].clone();
    strip["mode"] = json!(5);
    strip.as_object_mut().unwrap().remove("indices");
    push(&mut file.json["meshes"][0]["primitives"], strip);
    file.attribute("NORMAL", &[[0.0, 0.0, 1.0]; 4]);
    file.attribute("TANGENT", &[[1.0, 0.0, 0.0, 1.0]; 4]);
    let (indices, values) = (file.view(&[1, 3]), file.view(&[[0; 12], [1; 12]].concat()));
    let position = file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize;
    file.json["accessors"][position]["sparse"] = json!({
        "count": 2,
        "indices": { "bufferView": indices, "componentType": gltf::U8, "byteOffset": 0 },
        "values": { "bufferView": values, "byteOffset": 0 },
    });
    file.json["samplers"] = json!([{ "magFilter": 9728, "wrapS": 33071, "wrapT": 33648 }]);
    file.json["textures"][0]["sampler"] = json!(0);
    file.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1, "znear": 0.1, "aspectRatio": 1 },
            "extras": { "stillray": { "aperture": 0.1, "focus": 3, "blades": 5 } } }]);
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "spot", "intensity": 9, "range": 3, "color": [1, 1, 0], "spot": { "innerConeAngle": 0.1, "outerConeAngle": 1 } },
        { "type": "directional", "extras": { "stillray": { "shape": "disc", "width": 0.5, "height": 2 } } },
    ] } });
    file.json["nodes"] = json!([
        { "mesh": 0, "children": [1, 2], "rotation": [0, 0, 0, 1], "scale": [1, 2, 3], "translation": [1, 1, 1] },
        { "camera": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1], "children": [3] },
        { "mesh": 0, "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        { "name": "leaf", "extensions": { "KHR_lights_punctual": { "light": 1 } } },
    ]);
    file.animate("rotation", "CUBICSPLINE", &[0.0, 1.0], &[[0.0, 0.0, 0.0, 1.0]; 6]);
    file.animate("scale", "LINEAR", &[0.0, 1.0], &[[1.0; 3]; 2]);
    file.json["scenes"] = json!([{ "nodes": [0] }, { "nodes": [3] }]);
    file.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    file.json["extensionsRequired"] = json!(["KHR_texture_transform"]);
    file
}

/// A file with a skin of two sets of joints, sparse morph targets, and animations of both.
fn deforming() -> File {
    let mut file = File::skinned();
    file.joints(1, &[[1, 0, 1, 0]; 3], &[[0.25, 0.0, 0.5, 0.0]; 3]);
    file.target(&[[0.0, 0.0, 1.0]; 3]);
    let sparse = file.target(&[[0.0, 1.0, 0.0]; 3]);
    let (indices, values) = (file.view(&[0, 2]), file.view(&[[0; 12], [1; 12]].concat()));
    file.json["accessors"][sparse] = json!({ "componentType": gltf::F32, "type": "VEC3", "count": 3, "sparse": {
        "count": 2,
        "indices": { "bufferView": indices, "componentType": gltf::U8, "byteOffset": 0 },
        "values": { "bufferView": values, "byteOffset": 0 },
    } });
    file.json["meshes"][0]["weights"] = json!([0.5, -0.5]);
    file.animate("weights", "CUBICSPLINE", &[0.0, 1.0], &[[0.5]; 12]);
    file.animate("rotation", "LINEAR", &[0.0, 1.0], &[[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]]);
    file.json["animations"][1]["channels"][0]["target"]["node"] = json!(2);
    file.json["nodes"][2]["scale"] = json!([1, 2, -1]);
    push(&mut file.json["nodes"], json!({ "mesh": 0, "skin": 0, "weights": [1, 1] }));
    push(&mut file.json["nodes"], json!({ "mesh": 0 }));
    file.json["scenes"][0]["nodes"] = json!([0, 1, 3, 4]);
    file
}

fn originals() -> Vec<Original> {
    let mut out = vec![
        Original::new(Path::new("deforming.gltf"), deforming().gltf()),
        Original::new(Path::new("deforming.glb"), deforming().glb()),
        Original::new(Path::new("everything.gltf"), everything().gltf()),
        Original::new(Path::new("everything.glb"), everything().glb()),
    ];
    let Some(folder) = gltf::shared_scenes() else { return out };
    for path in gltf::models(&folder) {
        let files = std::fs::read_dir(path.parent().unwrap()).unwrap();
        let size: u64 = files.map(|file| file.unwrap().metadata().unwrap().len()).sum();
        if size <= MAX_FOLDER {
            out.push(Original::new(&path, std::fs::read(&path).unwrap()));
        }
    }
    out
}

/// Changes values of the JSON, mostly numbers.
fn rewrite(json: &mut Value, random: &mut Random) {
    for _ in 0..1 + random.below(3) {
        let (mut numbers, mut others) = (Vec::new(), Vec::new());
        pointers(json, "", &mut numbers, &mut others);
        match random.below(8) {
            0 if !others.is_empty() => remove(json, random.pick::<String>(&others)),
            1 if !others.is_empty() => {
                let new = value(random);
                json.pointer_mut(random.pick::<String>(&others)).map(|old| *old = new).unwrap_or_default();
            }
            2 => {
                // A node becomes a child of another one, which may be its descendant.
                let (parent, child) = (random.below(6), random.below(6));
                if let Some(node) = json.pointer_mut(&format!("/nodes/{parent}")).filter(|node| node.is_object()) {
                    push_child(node, child);
                }
            }
            3 if numbers.len() > 1 => {
                let from = json.pointer(random.pick::<String>(&numbers)).cloned().unwrap_or_default();
                json.pointer_mut(random.pick::<String>(&numbers)).map(|old| *old = from).unwrap_or_default();
            }
            _ if !numbers.is_empty() => {
                let new = number(random);
                json.pointer_mut(random.pick::<String>(&numbers)).map(|old| *old = new).unwrap_or_default();
            }
            _ => {}
        }
    }
}

fn push_child(node: &mut Value, child: usize) {
    match &mut node["children"] {
        Value::Array(children) => children.push(json!(child)),
        other => *other = json!([child]),
    }
}

/// Puts numbers that are none, or too large, into the binary chunk.
fn poison(binary: &mut [u8], random: &mut Random) {
    for _ in 0..1 + random.below(4) {
        let words: [u32; 8] = [
            f32::NAN.to_bits(),
            f32::INFINITY.to_bits(),
            f32::MAX.to_bits(),
            1,
            u32::MAX,
            0,
            f32::MIN.to_bits(),
            0x8000_0000,
        ];
        let at = random.below(binary.len() / 4) * 4;
        if let Some(word) = binary.get_mut(at..at + 4) {
            word.copy_from_slice(&random.pick(&words).to_le_bytes());
        }
    }
}

/// The file that belongs to a seed.
fn mutate(original: &Original, random: &mut Random) -> Vec<u8> {
    let mut json = original.json.clone();
    match random.below(6) {
        0 | 1 => {
            let mut bytes = original.bytes.clone();
            damage(&mut bytes, random);
            bytes
        }
        2 if original.binary.is_some() => {
            let mut binary = original.binary.clone().unwrap_or_default();
            if random.below(2) == 0 {
                poison(&mut binary, random);
            } else {
                damage(&mut binary, random);
            }
            original.assemble(json, Some(binary))
        }
        _ => {
            rewrite(&mut json, random);
            original.assemble(json, original.binary.clone())
        }
    }
}

/// Loads and does with the scene what the program does; returns whether it loads.
fn try_out(bytes: &[u8], path: &Path) -> bool {
    let Ok(scene) = import::load_slice(bytes, path, None) else { return false };
    let pose = scene.pose(0.7);
    let bounds = scene.bounds(&scene.pose(0.0));
    assert!(bounds.is_some_and(|(low, high)| low.is_finite() && high.is_finite()), "bounds {bounds:?}");
    assert_eq!(pose.instances.len(), scene.instances.len());
    assert!(pose.instances.iter().all(DAffine3::is_finite) && pose.cameras.iter().all(|c| c.rotation.is_finite()));
    assert!(pose.lights.iter().all(|l| l.position.is_finite() && l.direction.is_finite()));
    assert_eq!(pose.deformations.len(), scene.deformers.len());
    let mut shaped = Deformed::default();
    for deformation in &pose.deformations {
        let mesh = &scene.meshes[scene.instances[deformation.instance].mesh];
        assert_eq!(deformation.weights.len(), mesh.morph_targets.len());
        assert!(mesh.joints.iter().flatten().flatten().all(|&joint| usize::from(joint) < deformation.joints.len()));
        deform(mesh, deformation, &mut shaped);
        assert_eq!(shaped.normals.len(), mesh.positions.len());
        assert!(shaped.positions.iter().all(|p| p.is_finite()) && shaped.tangents.iter().all(|t| t.is_finite()));
        assert!(shaped.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
    }
    for mesh in &scene.meshes {
        let count = mesh.positions.len();
        assert!(mesh.triangles.iter().flatten().all(|&vertex| (vertex as usize) < count));
        assert!(mesh.positions.iter().all(|p| p.is_finite()) && mesh.normals.iter().all(|n| n.is_finite()));
        assert!(mesh.tangents.iter().all(|t| t.is_finite()) && mesh.normals.len() == count);
        assert!(mesh.triangle_materials.iter().all(|&m| (m as usize) < scene.materials.len()));
    }
    assert!(!requirements::inspect(&scene).features.is_empty());
    true
}

#[test]
fn no_mutated_file_makes_the_importer_panic() {
    let originals = originals();
    let loadable = originals.iter().filter(|o| try_out(&o.bytes, &o.path)).count();
    assert!(loadable >= 2, "the originals load: else mutating them proves nothing");
    let accepted = AtomicUsize::new(0);
    let seeds = mutations(INPUTS);
    let inputs = (seeds.end - seeds.start) as usize;
    let failures: Vec<(u64, Duration, Option<String>)> = seeds
        .into_par_iter()
        .map(|seed| {
            let mut random = Random(seed);
            let original = &originals[random.below(originals.len())];
            let bytes = mutate(original, &mut random);
            let start = Instant::now();
            let result = catch_unwind(AssertUnwindSafe(|| try_out(&bytes, &original.path)));
            accepted.fetch_add(usize::from(matches!(result, Ok(true))), Ordering::Relaxed);
            let failure = result.err().map(|_| format!("seed {seed}, a mutation of {}", original.path.display()));
            (seed, start.elapsed(), failure)
        })
        .collect();
    let slowest = failures.iter().max_by_key(|(_, time, _)| *time).unwrap();
    let accepted = accepted.into_inner();
    println!("{inputs} mutations of {} files: {accepted} load, the rest is refused", originals.len());
    println!("slowest: {:?} (seed {}), peak memory: {:?} bytes", slowest.1, slowest.0, peak_memory());
    let panics: Vec<&String> = failures.iter().filter_map(|(_, _, failure)| failure.as_ref()).collect();
    assert!(panics.is_empty(), "{} inputs panic: {panics:#?}", panics.len());
    // Both ways out are taken, else the mutations are too tame or too wild to show anything.
    assert!(accepted * 20 > inputs, "only {accepted} mutations load");
    assert!((inputs - accepted) * 5 > inputs, "only {} mutations are refused", inputs - accepted);
    // The originals take a few megabytes; a count that is trusted would take gigabytes.
    assert!(peak_memory().is_none_or(|bytes| bytes < 2 << 30), "{:?} bytes", peak_memory());
}

#[test]
fn the_harness_notices_a_panic() {
    let result = catch_unwind(|| try_out(b"", Path::new("")) || std::hint::black_box(Vec::<u8>::new())[0] == 0);
    assert!(result.is_err());
}

/// Small files that multiply what they hold.
#[test]
fn amplification_is_stopped() {
    let mut file = File::triangle();
    let n = 1 << 16;
    let positions = vec![[1.0, 2.0, 3.0]; n];
    file.attribute("POSITION", &positions);
    let primitive = file.json["meshes"][0]["primitives"][0].clone();
    file.json["meshes"][0]["primitives"] = vec![primitive; 4096].into();
    let message = file.message();
    assert!(message.contains("split the scene"), "{message}");

    // Each instance of a mesh that deforms has its own.
    let mut file = File::triangle();
    file.attribute("POSITION", &positions);
    file.target(&positions);
    file.json["nodes"] = (0..4096).map(|_| json!({ "mesh": 0 })).collect();
    file.json["scenes"][0]["nodes"] = (0..4096).collect();
    let message = file.message();
    assert!(message.contains("split the scene"), "{message}");

    let mut file = File::skinned();
    file.json["skins"][0] = json!({ "joints": vec![1; 1 << 16] });
    for _ in 0..128 {
        let node = push(&mut file.json["nodes"], json!({ "mesh": 0, "skin": 0 }));
        push(&mut file.json["scenes"][0]["nodes"], json!(node));
    }
    let message = file.message();
    assert!(message.contains("split the scene"), "{message}");

    let mut file = File::textured(json!({ "emissiveTexture": { "index": 0 } }));
    let white = gltf::png(image::DynamicImage::new_luma8(8192, 8192));
    let uri = gltf::data_uri("image/png", &white);
    let count = 5;
    file.json["images"] = (0..count).map(|_| json!({ "uri": uri })).collect();
    file.json["textures"] = (0..count).map(|i| json!({ "source": i })).collect();
    file.json["materials"] = (0..count).map(|i| json!({ "emissiveTexture": { "index": i } })).collect();
    let primitive = file.json["meshes"][0]["primitives"][0].clone();
    for material in 1..count {
        let mut primitive = primitive.clone();
        primitive["material"] = json!(material);
        push(&mut file.json["meshes"][0]["primitives"], primitive);
    }
    let message = file.message();
    assert!(message.contains("texels in all images"), "{message}");
}

#[test]
fn deeply_nested_json_is_refused() {
    let nested = format!("{}{}", "[".repeat(1 << 20), "]".repeat(1 << 20));
    assert!(!try_out(nested.as_bytes(), Path::new("x")));
    let nested = format!(
        r#"{{"asset":{{"version":"2.0"}},"extras":{}1{}}}"#,
        r#"{"extensions":"#.repeat(1000),
        "}".repeat(1000)
    );
    assert!(!try_out(nested.as_bytes(), Path::new("x")));
}
