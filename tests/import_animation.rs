//! Animated transforms of real and hand-made files against a second evaluation, written from the specification's
//! appendix C with nothing but arrays, which shares no code with the library.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

#[path = "support/gltf.rs"]
mod gltf;

use std::path::Path;

use glam::{DAffine3, DVec3};
use gltf::{File, push};
use serde_json::{Value, json};
use stillray::scene::import;

/// A `.glb` or `.gltf` file read in the plainest way: tightly packed floats only.
struct Plain {
    json: Value,
    data: Vec<u8>,
}

impl Plain {
    fn open(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap();
        if bytes.starts_with(b"glTF") {
            let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
            let json = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
            return Self { json, data: bytes[28 + length..].to_vec() };
        }
        let json: Value = serde_json::from_slice(&bytes).unwrap();
        let data = std::fs::read(path.with_file_name(json["buffers"][0]["uri"].as_str().unwrap())).unwrap();
        Self { json, data }
    }

    fn floats(&self, accessor: &Value) -> Vec<f64> {
        let accessor = &self.json["accessors"][index(accessor)];
        assert_eq!(accessor["componentType"], 5126);
        let view = &self.json["bufferViews"][index(&accessor["bufferView"])];
        let start = index(&view["byteOffset"]) + index(&accessor["byteOffset"]);
        let width = match accessor["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC3" => 3,
            "VEC4" => 4,
            other => panic!("{other}"),
        };
        assert!(matches!(view["byteStride"].as_u64(), None | Some(0)) || view["byteStride"] == 4 * width);
        let bytes = self.data[start..].chunks_exact(4).take(width * index(&accessor["count"]));
        bytes.map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap()))).collect()
    }

    /// The 4x4 matrix of a node at a time, times its ancestors': row by row.
    fn global(&self, node: usize, time: f64) -> [[f64; 4]; 4] {
        let local = self.local(node, time);
        let nodes = self.json["nodes"].as_array().unwrap();
        let is_parent = |n: &Value| n["children"].as_array().is_some_and(|c| c.contains(&json!(node)));
        match nodes.iter().position(is_parent) {
            Some(parent) => multiply(self.global(parent, time), local),
            None => local,
        }
    }

    fn local(&self, node: usize, time: f64) -> [[f64; 4]; 4] {
        let source = &self.json["nodes"][node];
        if let Some(matrix) = source["matrix"].as_array() {
            let at = |row: usize, column: usize| matrix[4 * column + row].as_f64().unwrap();
            return std::array::from_fn(|row| std::array::from_fn(|column| at(row, column)));
        }
        let property = |path: &str, rest: &[f64]| {
            let rest = source[path].as_array().map_or(rest.to_vec(), |a| a.iter().map(as_f32).collect());
            self.animated(node, path, time).unwrap_or(rest)
        };
        let (t, s) = (property("translation", &[0.0; 3]), property("scale", &[1.0; 3]));
        let r = normalized(&property("rotation", &[0.0, 0.0, 0.0, 1.0]));
        let (x, y, z, w) = (r[0], r[1], r[2], r[3]);
        let turn = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ];
        std::array::from_fn(|row| match row {
            3 => [0.0, 0.0, 0.0, 1.0],
            _ => [turn[row][0] * s[0], turn[row][1] * s[1], turn[row][2] * s[2], t[row]],
        })
    }

    /// The value of the first channel that drives a property.
    fn animated(&self, node: usize, path: &str, time: f64) -> Option<Vec<f64>> {
        for animation in self.json["animations"].as_array()? {
            let channels = animation["channels"].as_array().unwrap();
            let sampler = |channel: &Value| animation["samplers"][index(&channel["sampler"])].clone();
            let last = |channel: &Value| *self.floats(&sampler(channel)["input"]).last().unwrap();
            let duration = channels.iter().map(last).fold(0.0, f64::max);
            let drives = |c: &&Value| c["target"]["node"] == json!(node) && c["target"]["path"] == path;
            if let Some(channel) = channels.iter().find(drives) {
                let time = if duration > 0.0 { time - (time / duration).floor() * duration } else { time };
                let sampler = sampler(channel);
                let mode = sampler["interpolation"].as_str().unwrap_or("LINEAR");
                let (times, values) = (self.floats(&sampler["input"]), self.floats(&sampler["output"]));
                return Some(interpolate(mode, &times, &values, time, path == "rotation"));
            }
        }
        None
    }
}

fn index(value: &Value) -> usize {
    value.as_u64().unwrap_or(0) as usize
}

/// The library keeps the rest transform as the f32 that the file's decimals stand for.
fn as_f32(value: &Value) -> f64 {
    f64::from(value.as_f64().unwrap() as f32)
}

fn normalized(v: &[f64]) -> Vec<f64> {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.iter().map(|x| x / length).collect()
}

fn multiply(a: [[f64; 4]; 4], b: [[f64; 4]; 4]) -> [[f64; 4]; 4] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Appendix C, formula by formula.
fn interpolate(mode: &str, times: &[f64], values: &[f64], time: f64, rotation: bool) -> Vec<f64> {
    let per_key = values.len() / times.len();
    let width = if mode == "CUBICSPLINE" { per_key / 3 } else { per_key };
    let part = |key: usize, part: usize| values[key * per_key + part * width..][..width].to_vec();
    let value = |key: usize| part(key, if mode == "CUBICSPLINE" { 1 } else { 0 });
    let next = times.iter().position(|&t| t > time).unwrap_or(times.len());
    if next == 0 || next == times.len() {
        return value(next.max(1) - 1);
    }
    let (key, td) = (next - 1, times[next] - times[next - 1]);
    let t = (time - times[key]) / td;
    let mix = |weights: &[(f64, Vec<f64>)]| -> Vec<f64> {
        (0..width).map(|i| weights.iter().map(|(weight, v)| weight * v[i]).sum()).collect()
    };
    match mode {
        "STEP" => value(key),
        "CUBICSPLINE" => mix(&[
            (2.0 * t.powi(3) - 3.0 * t.powi(2) + 1.0, value(key)),
            (td * (t.powi(3) - 2.0 * t.powi(2) + t), part(key, 2)),
            (-2.0 * t.powi(3) + 3.0 * t.powi(2), value(next)),
            (td * (t.powi(3) - t.powi(2)), part(next, 0)),
        ]),
        _ if rotation => {
            let (from, to) = (normalized(&value(key)), normalized(&value(next)));
            let dot: f64 = from.iter().zip(&to).map(|(a, b)| a * b).sum();
            let a = dot.abs().min(1.0).acos();
            if a < 1e-6 {
                return mix(&[(1.0 - t, from), (t * dot.signum(), to)]);
            }
            mix(&[(((1.0 - t) * a).sin() / a.sin(), from), (dot.signum() * (t * a).sin() / a.sin(), to)])
        }
        _ => mix(&[(1.0 - t, value(key)), (t, value(next))]),
    }
}

/// The largest difference of a matrix element, relative to the largest element.
fn difference(a: &DAffine3, b: &[[f64; 4]; 4]) -> f64 {
    let columns = [a.x_axis, a.y_axis, a.z_axis, a.translation];
    let pairs = (0..3).flat_map(|row| (0..4).map(move |column| (row, column)));
    let largest = b.iter().flatten().fold(1.0f64, |most, x| most.max(x.abs()));
    pairs.map(|(row, column)| (columns[column][row] - b[row][column]).abs()).fold(0.0, f64::max) / largest
}

/// The largest difference over all instances of a file and many times, the second evaluation being late by `late`
/// seconds.
fn worst(path: &Path, late: f64) -> f64 {
    let (scene, plain) = (import::load(path).unwrap(), Plain::open(path));
    let nodes = plain.json["nodes"].as_array().unwrap();
    let node_of = |name: &str| {
        let named = nodes.iter().position(|n| n["name"] == name);
        named.unwrap_or_else(|| name.strip_prefix("node ").unwrap().parse().unwrap())
    };
    let mut worst = 0.0f64;
    for step in -3..100 {
        let time = f64::from(step) * 0.0437;
        let pose = scene.pose(time);
        for (instance, transform) in scene.instances.iter().zip(&pose.instances) {
            let expected = plain.global(node_of(&scene.nodes[instance.node].name), time + late);
            worst = worst.max(difference(transform, &expected));
        }
    }
    worst
}

#[test]
fn real_animations_agree_with_a_second_evaluation() {
    let Some(folder) = gltf::shared_scenes() else { return };
    for model in [
        "InterpolationTest/InterpolationTest.glb",
        "BoxAnimated/BoxAnimated.glb",
        "CesiumMilkTruck/CesiumMilkTruck.gltf",
    ] {
        let path = folder.join(model);
        // Around a hundred roundings of 2^-53, and an arc cosine near 1 that loses half of the digits: 1e-8 in angle,
        // of which the interpolated rotation keeps the square. 1e-12 leaves room for both.
        let error = worst(&path, 0.0);
        assert!(error < 1e-12, "{model}: {error:e}");
        assert!(worst(&path, 0.001) > 1e-6, "{model}: the comparison does not see a millisecond");
    }
}

#[test]
fn all_three_interpolations_of_all_three_properties_arrive() {
    let mut file = File::triangle();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    file.animate("translation", "STEP", &[0.0, 1.0, 2.0], &[[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]]);
    file.animate("rotation", "LINEAR", &[0.0, 2.0], &[[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, half, half]]);
    let (zero, one, three) = ([0.0; 3], [1.0; 3], [3.0; 3]);
    file.animate("scale", "CUBICSPLINE", &[0.0, 2.0], &[zero, one, zero, zero, three, zero]);
    let scene = file.scene();
    assert_eq!((scene.animations.len(), scene.duration()), (3, 2.0));
    let transform = scene.pose(1.0).instances[0];
    assert_eq!(transform.translation, DVec3::X * 2.0);
    // Half way with flat tangents the scale is the mean, 2; the rotation is an eighth of a turn. The file's quaternion
    // is one of f32, whose angle is off by some 1e-8.
    let eighth = std::f64::consts::FRAC_1_SQRT_2 * 2.0;
    assert!((transform.transform_vector3(DVec3::X) - DVec3::new(eighth, eighth, 0.0)).length() < 1e-7);
}

#[test]
fn each_animation_loops_on_its_own_and_the_first_wins() {
    let mut file = File::triangle();
    file.animate("translation", "LINEAR", &[0.0, 1.0], &[[0.0; 3], [1.0, 0.0, 0.0]]);
    file.animate("scale", "STEP", &[0.0, 3.0], &[[1.0; 3], [5.0; 3]]);
    file.animate("translation", "LINEAR", &[0.0, 9.0], &[[0.0; 3], [7.0; 3]]);
    let scene = file.scene();
    assert_eq!(scene.duration(), 3.0);
    assert_eq!(scene.pose(2.25).instances[0].translation, DVec3::X * 0.25);
    assert_eq!(scene.pose(2.25).instances[0].matrix3.x_axis, DVec3::X);
    assert!(scene.notices[0].contains("animation 2, channel of node 'the node' is ignored"), "{:?}", scene.notices);
}

#[test]
fn rotations_may_be_normalised_integers() {
    let mut file = File::triangle();
    file.animate("rotation", "LINEAR", &[0.0, 1.0], &[[0.0, 0.0, 0.0, 1.0]; 2]);
    let bytes = [[0, 0, 0, 127], [0, 0, 127, 0]].concat();
    let output = file.accessor(gltf::I8, "VEC4", 2, &bytes);
    file.json["animations"][0]["samplers"][0]["output"] = json!(output);
    assert!(file.message().contains("values"), "integers have to be normalised: {}", file.message());
    file.json["accessors"][output]["normalized"] = json!(true);
    let x = file.scene().pose(0.5).instances[0].transform_vector3(DVec3::X);
    assert!((x - DVec3::Y).length() < 1e-15);
}

#[test]
fn keys_that_coincide_are_merged_and_decreasing_ones_refused() {
    let mut file = File::triangle();
    let values = [[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]];
    file.animate("translation", "LINEAR", &[0.0, 1.0, 1.0, 2.0], &values);
    let scene = file.scene();
    assert!(scene.notices[0].contains("coincide"), "{:?}", scene.notices);
    assert_eq!([0.5, 1.0, 1.5].map(|t| scene.pose(t).instances[0].translation.x), [1.0, 2.0, 2.5]);
    for (times, reason) in [(&[0.0, 2.0, 1.0, 3.0][..], "decrease"), (&[0.0, 1.0, f32::NAN, 3.0], "not finite")] {
        let mut file = File::triangle();
        file.animate("translation", "LINEAR", times, &values);
        assert!(file.message().contains(reason), "{}", file.message());
    }
    let mut file = File::triangle();
    file.animate("translation", "CUBICSPLINE", &[0.0, 1.0], &values);
    assert!(file.message().contains("2 keys and 4 values, 3 a key are needed"), "{}", file.message());
    let mut file = File::triangle();
    file.animate("translation", "LINEAR", &[], &values[..0]);
    assert!(file.message().contains("0 keys"), "{}", file.message());
    let mut file = File::triangle();
    file.animate("rotation", "LINEAR", &[0.0], &[[0.0; 4]]);
    assert!(file.message().contains("rotation that is zero"), "{}", file.message());
}

#[test]
fn channels_that_move_nothing_are_ignored() {
    let mut file = File::triangle();
    file.animate("translation", "LINEAR", &[0.0, 1.0], &[[0.0; 3]; 2]);
    file.json["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    let scene = file.scene();
    assert!(scene.animations.is_empty() && scene.notices[0].contains("matrix"), "{:?}", scene.notices);
    let mut file = File::triangle();
    file.animate("translation", "LINEAR", &[0.0, 1.0], &[[0.0; 3]; 2]);
    push(&mut file.json["nodes"], json!({}));
    file.json["animations"][0]["channels"][0]["target"]["node"] = json!(1);
    assert!(file.scene().animations.is_empty(), "a node that is not in the scene");
    file.json["animations"][0]["channels"][0]["target"].as_object_mut().unwrap().remove("node");
    assert!(file.scene().animations.is_empty(), "no node at all");
    file.json["animations"][0]["channels"][0]["target"]["node"] = json!(2);
    assert!(file.message().contains("no such node"), "{}", file.message());
    file.json["animations"][0]["channels"][0] = json!({ "sampler": 3, "target": { "node": 0, "path": "scale" } });
    assert!(file.message().contains("sampler that does not exist"), "{}", file.message());
}

#[test]
fn animations_that_leave_the_range_of_floats_are_refused() {
    let mut file = File::triangle();
    file.animate("scale", "LINEAR", &[0.0, 1.0], &[[1.0; 3], [1e30; 3]]);
    assert!(file.scene().pose(0.9).instances[0].is_finite());
    let mut child = file.clone();
    child.json["nodes"] = json!([{ "children": [1] }, { "mesh": 0, "name": "child", "scale": [1e9, 1, 1] }]);
    assert!(child.message().contains("what node 'child' places overflows"), "{}", child.message());
    // Both keys are where the triangle is, but the tangents throw it far away in between.
    file.json["animations"] = json!([]);
    let far = [3e38, 0.0, 0.0];
    file.animate("translation", "CUBICSPLINE", &[0.0, 1e9], &[[0.0; 3], [0.0; 3], far, far, [0.0; 3], [0.0; 3]]);
    assert!(file.message().contains("overflows"), "{}", file.message());
}
