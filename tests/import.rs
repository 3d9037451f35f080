//! Containers, nodes, geometry, cameras and lights of glTF arrive in the scene as the specification says, and what is
//! not supported is refused by name.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

#[path = "support/gltf.rs"]
mod gltf;

use glam::{DVec3, Vec3, Vec4};
use gltf::{F32, File, I8, I16, U8, U16, U32, data_uri, push};
use serde_json::json;
use std::path::Path;
use stillray::scene::requirements::{self, Feature};
use stillray::scene::{LightKind, Material, Scene, import};

fn corner(scene: &Scene, triangle: usize, corner: usize) -> Vec3 {
    scene.meshes[0].positions[scene.meshes[0].triangles[triangle][corner] as usize]
}

// Containers

#[test]
fn a_minimal_file_loads_from_text_and_from_binary() {
    let file = File::triangle();
    let glb = import::load_slice(&file.glb(), Path::new("folder/name.glb"), None).unwrap();
    assert_eq!(glb.name, "name");
    for scene in [file.scene(), glb] {
        assert_eq!(scene.meshes[0].positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
        assert_eq!(scene.meshes[0].normals, [Vec3::Z; 3]);
        assert_eq!(scene.instances.len(), 1);
        assert_eq!(scene.materials, [Material::default()]);
        assert!(scene.notices.is_empty(), "{:?}", scene.notices);
    }
}

#[test]
fn external_files_may_have_spaces_and_umlauts() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = File::triangle();
    std::fs::write(folder.path().join("ein Dreieck ä.bin"), &file.data).unwrap();
    for uri in ["ein%20Dreieck%20%C3%A4.bin", "ein Dreieck ä.bin", "./ein Dreieck ä.bin"] {
        file.json["buffers"] = json!([{ "byteLength": file.data.len(), "uri": uri }]);
        let path = folder.path().join("scène.gltf");
        std::fs::write(&path, file.gltf()).unwrap();
        assert_eq!(import::load(&path).unwrap().name, "scène");
    }
    file.json["buffers"][0]["uri"] = json!("https://example.org/a.bin");
    assert!(file.message().contains("'https://example.org/a.bin' is not a relative path"), "{}", file.message());
    file.json["buffers"][0]["uri"] = json!("missing.bin");
    assert!(file.message().contains("buffer 0: cannot read 'missing.bin'"), "{}", file.message());
    let missing = import::load(Path::new("no such file.glb")).unwrap_err();
    assert!(missing.to_string().starts_with("no such file.glb: "), "{missing}");
    assert!(import::load(folder.path()).unwrap_err().to_string().contains("not a regular file"));
}

#[test]
fn a_buffer_shorter_than_it_says_is_refused() {
    let mut file = File::triangle();
    let short = &file.data[..20];
    file.json["buffers"] = json!([{ "byteLength": 36, "uri": data_uri("", short) }]);
    assert!(file.message().contains("buffer 0 should have 36 bytes, but has 20"), "{}", file.message());
}

#[test]
fn other_versions_and_other_files_are_refused() {
    let mut file = File::triangle();
    file.json["asset"]["version"] = json!("1.0");
    assert!(file.message().contains("glTF 1.0"));
    file.json["asset"] = json!({ "version": "2.1", "minVersion": "2.1" });
    assert!(file.message().contains("glTF 2.1"));
    file.json["asset"] = json!({ "version": "2.1" });
    file.scene();
    let refused = |bytes: &[u8]| import::load_slice(bytes, Path::new("x"), None).unwrap_err().to_string();
    assert!(refused(b"solid cube").contains("not valid JSON"));
    assert!(refused(b"").contains("not valid JSON"));
    assert!(refused(br#"{"asset":{"version":"2.0"},"meshes":3}"#).contains("line 1"));
}

#[test]
fn a_chosen_scene_is_loaded() {
    let mut file = File::triangle();
    push(&mut file.json["nodes"], json!({ "mesh": 0, "name": "other" }));
    file.json["scenes"] = json!([{ "nodes": [0] }, { "name": "second", "nodes": [1] }, {}]);
    file.json["scene"] = json!(1);
    let scene = file.scene();
    assert_eq!(scene.nodes[0].name, "other");
    assert_eq!(scene.notices, ["the file has 3 scenes; scene 'second' is shown"]);
    let load = |index| import::load_slice(&file.gltf(), Path::new("x"), Some(index));
    let first = load(0).unwrap();
    assert_eq!((first.nodes[0].name.as_str(), first.notices.len()), ("the node", 0));
    assert!(load(2).unwrap_err().to_string().contains("nothing to render"));
    assert!(load(3).unwrap_err().to_string().contains("scenes 0 to 2"));
}

// Nodes

#[test]
fn a_mesh_used_twice_is_stored_once() {
    let mut file = File::triangle();
    push(&mut file.json["nodes"], json!({ "mesh": 0, "translation": [1, 2, 3], "scale": [-1, 2, 1] }));
    file.json["nodes"][0]["children"] = json!([1]);
    file.json["nodes"][0]["matrix"] = json!([0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 10, 0, 0, 1]);
    let scene = file.scene();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 2));
    let transform = scene.pose(0.0).instances[1];
    // The parent turns a quarter around z and moves along x.
    assert_eq!(transform.transform_point3(DVec3::ZERO), DVec3::new(8.0, 1.0, 3.0));
    assert_eq!(transform.transform_vector3(DVec3::X), DVec3::new(0.0, -1.0, 0.0));
    assert_eq!(transform.matrix3.determinant(), -2.0);
    let required = requirements::inspect(&scene);
    assert_eq!(required.cause(Feature::MirroredInstances), Some("node 'node 1'"));
    assert_eq!(required.cause(Feature::NonUniformScale), Some("node 'node 1'"));
    assert_eq!(required.cause(Feature::Instancing), Some("node 'node 1'"));
    assert!(!requirements::inspect(&File::triangle().scene()).has(Feature::Instancing));
}

#[test]
fn hierarchies_that_are_no_trees_are_refused() {
    let mut file = File::triangle();
    file.json["nodes"] = json!([{ "mesh": 0, "children": [1] }, { "name": "b", "children": [0] }]);
    assert!(file.message().contains("node 0 has two parents or is its own ancestor"), "{}", file.message());
    file.json["nodes"] = json!([{ "mesh": 0, "children": [0] }]);
    assert!(file.message().contains("its own ancestor"));
    file.json["nodes"] = json!([{ "mesh": 0, "children": [1, 2] }, { "children": [2] }, { "name": "c" }]);
    assert!(file.message().contains("node 'c' has two parents"));
    file.json["nodes"] = json!([{ "mesh": 0, "children": [7] }]);
    assert!(file.message().contains("node 7 does not exist"));
    // A cycle that the scene does not reach harms nobody.
    file.json["nodes"] = json!([{ "mesh": 0 }, { "children": [2] }, { "children": [1] }]);
    file.scene();
}

#[test]
fn a_hierarchy_deeper_than_any_stack_loads() {
    let mut file = File::triangle();
    let n = 100_000;
    let chain = (0..n).map(|i| json!({ "children": [i + 1], "translation": [1, 0, 0] }));
    file.json["nodes"] = chain.chain([json!({ "mesh": 0 })]).collect();
    assert_eq!(file.scene().pose(0.0).instances[0].translation, DVec3::X * f64::from(n));
}

#[test]
fn transforms_that_are_none_are_refused() {
    for (member, value, reason) in [
        ("rotation", json!([0, 0, 0, 0]), "no unit quaternion"),
        ("translation", json!([1e39, 0, 0]), "not finite"),
        ("scale", json!([1, 1e300, 1]), "not finite"),
        ("matrix", json!([1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]), "affine"),
        ("matrix", json!([1e39, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]), "affine"),
        ("scale", json!([3e38, 3e38, 3e38]), "overflows"),
    ] {
        let mut file = File::triangle();
        file.json["nodes"][0][member] = value;
        let message = file.message();
        assert!(message.contains("node 'the node'") || message.contains("node 0"), "{message}");
        assert!(message.contains(reason), "{message}");
    }
    let mut file = File::triangle();
    file.json["nodes"][0]["rotation"] = json!([0, 0, 2, 0]); // normalised
    file.json["nodes"][0]["scale"] = json!([1, 0, 1]); // flat, but finite
    assert_eq!(file.scene().pose(0.0).instances[0].transform_vector3(DVec3::X), DVec3::NEG_X);
}

// Geometry

#[test]
fn interleaved_arrays_are_read() {
    let mut file = File::triangle();
    let mut bytes = vec![0xff; 4];
    for i in 0..3u8 {
        for x in [f32::from(i), f32::from(i * i), 2.0] {
            bytes.extend(x.to_le_bytes());
        }
        bytes.extend([128, 128, 128, i]);
    }
    let view = file.view(&bytes);
    file.json["bufferViews"][view]["byteStride"] = json!(16);
    let position = json!({ "bufferView": view, "byteOffset": 4, "componentType": F32, "type": "VEC3", "count": 3 });
    let color = json!({ "bufferView": view, "byteOffset": 16, "componentType": U8, "normalized": true, "type": "VEC4", "count": 3 });
    let (position, color) = (push(&mut file.json["accessors"], position), push(&mut file.json["accessors"], color));
    file.json["meshes"][0]["primitives"][0]["attributes"] = json!({ "POSITION": position, "COLOR_0": color });
    let scene = file.scene();
    assert_eq!(corner(&scene, 0, 2), Vec3::new(2.0, 4.0, 2.0));
    assert_eq!(scene.meshes[0].colors[2], Vec4::new(128.0, 128.0, 128.0, 2.0) / 255.0);
    file.json["accessors"][color]["byteOffset"] = json!(17); // the last element ends one byte too late
    assert!(file.message().contains("COLOR_0"), "{}", file.message());
    file.json["accessors"][color]["byteOffset"] = json!(16);
    file.json["bufferViews"][view]["byteStride"] = json!(8);
    assert!(file.message().contains("8 apart"), "{}", file.message());
}

#[test]
fn sparse_elements_replace_others() {
    let mut file = File::triangle();
    let indices = file.view(&[2]);
    let values = file.view(&[5f32, 6.0, 7.0].map(f32::to_le_bytes).concat());
    let sparse = json!({
        "count": 1,
        "indices": { "bufferView": indices, "componentType": U8 },
        "values": { "bufferView": values },
    });
    file.json["accessors"][0]["sparse"] = sparse.clone();
    assert_eq!(corner(&file.scene(), 0, 2), Vec3::new(5.0, 6.0, 7.0));
    assert_eq!(corner(&file.scene(), 0, 1), Vec3::X);
    // Without a buffer view, what is not replaced is zero.
    file.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert_eq!([1, 2].map(|i| corner(&file.scene(), 0, i)), [Vec3::ZERO, Vec3::new(5.0, 6.0, 7.0)]);
    file.json["accessors"][0]["count"] = json!(u32::MAX);
    assert!(file.message().contains("4294967295 zeros"), "{}", file.message());
    file.json["accessors"][0]["count"] = json!(2);
    assert!(file.message().contains("sparse index 2 is not below the count of 2"), "{}", file.message());
    file.json["accessors"][0].as_object_mut().unwrap().remove("sparse");
    assert!(file.message().contains("has no data"), "{}", file.message());
}

#[test]
fn quantised_meshes_are_read() {
    let mut file = File::triangle();
    file.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    file.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let positions = [[-3i16, 4, 32767], [0, 0, 0], [100, 0, 0]].concat();
    let bytes: Vec<u8> = positions.iter().flat_map(|x| x.to_le_bytes()).collect();
    let position = file.accessor(I16, "VEC3", 3, &bytes);
    let normal = file.accessor(I8, "VEC3", 3, &[0, 0, 127, 0, 127, 0, 0, 0, 0x81]);
    file.json["accessors"][normal]["normalized"] = json!(true);
    file.json["meshes"][0]["primitives"][0]["attributes"] = json!({ "POSITION": position, "NORMAL": normal });
    let scene = file.scene();
    assert_eq!(corner(&scene, 0, 0), Vec3::new(-3.0, 4.0, 32767.0));
    assert_eq!(scene.meshes[0].normals, [Vec3::Z, Vec3::Y, Vec3::NEG_Z]);
    file.json["accessors"][position]["normalized"] = json!(true);
    assert_eq!(corner(&file.scene(), 0, 0), Vec3::new(-3.0 / 32767.0, 4.0 / 32767.0, 1.0));
    file.json["accessors"][normal]["normalized"] = json!(false);
    assert!(file.message().contains("NORMAL"), "{}", file.message());
}

#[test]
fn indices_of_all_sizes_are_read() {
    for (component, bytes) in
        [(U8, vec![2, 0, 1]), (U16, vec![2, 0, 0, 0, 1, 0]), (U32, vec![2, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0])]
    {
        let mut file = File::triangle();
        let indices = file.accessor(component, "SCALAR", 3, &bytes);
        file.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
        assert_eq!(corner(&file.scene(), 0, 0), Vec3::Y);
        file.json["accessors"][indices]["componentType"] = json!(F32);
        file.message();
    }
    let mut file = File::triangle();
    file.indices(&[0, 1, 3]);
    assert!(file.message().contains("mesh 'the mesh', primitive 0 has index 3, but 3 vertices"), "{}", file.message());
    file.indices(&[0, 1, 2, 0]);
    assert!(file.scene().notices[0].contains("4 indices"));
}

#[test]
fn strips_and_fans_become_triangles() {
    let mut file = File::textured(json!({}));
    file.indices(&[0, 1, 2, 3]);
    file.json["meshes"][0]["primitives"][0]["mode"] = json!(5);
    let strip = file.scene();
    assert_eq!(strip.meshes[0].triangles.len(), 2);
    assert!(strip.meshes[0].normals.iter().all(|&n| n == Vec3::Z), "both triangles face the same way");
    file.json["meshes"][0]["primitives"][0]["mode"] = json!(6);
    file.indices(&[0, 1, 3, 2]);
    assert!(file.scene().meshes[0].normals.iter().all(|&n| n == Vec3::Z));
    file.json["meshes"][0]["primitives"][0]["mode"] = json!(7);
    assert!(file.message().contains("unknown mode"));
    file.json["meshes"][0]["primitives"][0]["mode"] = json!(1);
    assert!(file.message().contains("no triangle in the scene"));
}

#[test]
fn missing_normals_are_flat_and_split_vertices() {
    let mut file = File::textured(json!({}));
    file.attribute("POSITION", &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 1.0]]);
    let mesh = &file.scene().meshes[0];
    assert_eq!(mesh.positions.len(), 6);
    assert_eq!((mesh.normals[0], mesh.normals[3]), (Vec3::Z, -Vec3::new(1.0, 1.0, 0.0).normalize()));
    file.attribute("NORMAL", &[[0.0, 0.0, 3.0]; 4]);
    let mesh = &file.scene().meshes[0];
    assert_eq!((mesh.positions.len(), mesh.normals[3]), (4, Vec3::Z));
}

#[test]
fn values_that_are_not_finite_are_refused_by_name() {
    for bad in [f32::NAN, f32::INFINITY] {
        let mut file = File::triangle();
        let accessor = file.attribute("POSITION", &[[0.0; 3], [0.0, bad, 0.0], [0.0; 3]]);
        let expected =
            format!("mesh 'the mesh', primitive 0, POSITION (accessor {accessor}), element 1, is not finite");
        assert!(file.message().contains(&expected), "{}", file.message());
    }
    let mut file = File::triangle();
    file.attribute("NORMAL", &[[0.0, 0.0, 1.0], [f32::NAN, 0.0, 0.0], [0.0; 3]]);
    assert!(file.message().contains("NORMAL"));
}

#[test]
fn attributes_of_different_lengths_are_refused() {
    let mut file = File::triangle();
    file.attribute("NORMAL", &[[0.0, 0.0, 1.0]; 2]);
    assert!(file.message().contains("2 elements for 3 positions"), "{}", file.message());
}

#[test]
fn primitives_merge_into_one_mesh_with_a_material_a_triangle() {
    let mut file = File::textured(json!({ "name": "a" }));
    push(&mut file.json["materials"], json!({ "name": "b" }));
    let mut second = file.json["meshes"][0]["primitives"][0].clone();
    second["material"] = json!(1);
    push(&mut file.json["meshes"][0]["primitives"], second.clone());
    second.as_object_mut().unwrap().remove("material");
    push(&mut file.json["meshes"][0]["primitives"], second.clone());
    second["mode"] = json!(0);
    push(&mut file.json["meshes"][0]["primitives"], second);
    let scene = file.scene();
    assert_eq!(scene.meshes[0].triangle_materials, [0, 0, 1, 1, 2, 2]);
    let names: Vec<_> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["a", "b", "default"]);
    assert_eq!(scene.notices, ["mesh 'the mesh', primitive 3 has points or lines, which are skipped"]);
}

#[test]
fn colours_of_every_encoding_are_read() {
    let mut file = File::triangle();
    file.attribute("COLOR_0", &[[0.25, 0.5, 1.0]; 3]);
    assert_eq!(file.scene().meshes[0].colors[1], Vec4::new(0.25, 0.5, 1.0, 1.0));
    file.attribute("COLOR_0", &[[0.25, 0.5, 2.0, 0.5]; 3]);
    assert_eq!(file.scene().meshes[0].colors[1], Vec4::new(0.25, 0.5, 2.0, 0.5));
    let bytes = [[0xff, 0xff, 0, 0, 0, 0x80]; 3].concat();
    let accessor = file.accessor(U16, "VEC3", 3, &bytes);
    file.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(accessor);
    assert!(file.message().contains("COLOR_0"), "integers have to be normalised");
    file.json["accessors"][accessor]["normalized"] = json!(true);
    assert_eq!(file.scene().meshes[0].colors[0], Vec4::new(1.0, 0.0, 32768.0 / 65535.0, 1.0));
}

// Cameras and lights

#[test]
fn cameras_arrive_with_their_nodes() {
    let mut file = File::triangle();
    let perspective = json!({ "yfov": 0.5, "znear": 0.1 });
    file.json["cameras"] = json!([
        { "type": "perspective", "perspective": perspective },
        { "type": "orthographic", "orthographic": { "xmag": 1, "ymag": 1, "znear": 0, "zfar": 1 } },
    ]);
    push(
        &mut file.json["nodes"],
        json!({ "name": "eye", "camera": 0, "translation": [1, 2, 3], "rotation": [0, 1, 0, 0] }),
    );
    push(&mut file.json["nodes"], json!({ "name": "flat", "camera": 1 }));
    file.json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    let scene = file.scene();
    assert_eq!(scene.cameras.len(), 1);
    assert_eq!((scene.cameras[0].name.as_str(), scene.cameras[0].yfov), ("eye", 0.5));
    let view = scene.pose(0.0).cameras[0];
    assert_eq!(view.position, DVec3::new(1.0, 2.0, 3.0));
    assert!((view.rotation * DVec3::NEG_Z - DVec3::Z).length() < 1e-15);
    assert_eq!(scene.notices, ["node 'flat' has an orthographic camera, which is left out"]);
    for yfov in [0.0, -1.0, 3.2] {
        file.json["cameras"][0]["perspective"]["yfov"] = json!(yfov);
        assert!(file.message().contains("node 'eye'"), "{}", file.message());
    }
}

#[test]
fn lights_arrive_with_their_nodes() {
    let mut file = File::triangle();
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "point", "name": "bulb", "color": [1, 0.5, 0], "intensity": 20, "range": 5 },
        { "type": "spot", "spot": { "innerConeAngle": 0.25, "outerConeAngle": 0.5 } },
        { "type": "directional" },
    ] } });
    file.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    for light in 0..3 {
        let rotation = [0.0, std::f64::consts::FRAC_1_SQRT_2, 0.0, std::f64::consts::FRAC_1_SQRT_2];
        push(
            &mut file.json["nodes"],
            json!({ "rotation": rotation, "extensions": { "KHR_lights_punctual": { "light": light } } }),
        );
    }
    let scene = file.scene();
    assert_eq!(scene.lights.len(), 3);
    let bulb = &scene.lights[0];
    assert_eq!(
        (bulb.name.as_str(), bulb.kind, bulb.intensity, bulb.range),
        ("bulb", LightKind::Point, 20.0, Some(5.0))
    );
    assert_eq!(bulb.color, Vec3::new(1.0, 0.5, 0.0));
    assert_eq!(scene.lights[1].kind, LightKind::Spot { inner: 0.25, outer: 0.5 });
    assert_eq!((scene.lights[2].kind, scene.lights[2].intensity), (LightKind::Directional, 1.0));
    // Turned a quarter around y: -z to -x. The quaternion was rounded to f32.
    assert!((scene.pose(0.0).lights[2].direction - DVec3::NEG_X).length() < 1e-6);
    assert_eq!(scene.environment.radiance, Vec3::ZERO, "lit by its own lights alone");
    let lights = "/extensions/KHR_lights_punctual/lights";
    for (light, member, value) in [
        (0, "intensity", json!(-1)),
        (0, "range", json!(0)),
        (0, "type", json!("laser")),
        (0, "color", json!([1e39, 0, 0])),
        (1, "spot", json!({ "innerConeAngle": 0.5, "outerConeAngle": 0.5 })),
        (1, "spot", json!({ "outerConeAngle": 2 })),
    ] {
        let mut file = file.clone();
        file.json.pointer_mut(lights).unwrap()[light][member] = value;
        assert!(file.message().contains(&format!("the light of node {}", light + 1)), "{}", file.message());
    }
    file.json["nodes"][1]["extensions"]["KHR_lights_punctual"]["light"] = json!(9);
    assert!(file.message().contains("light 9"));
}

/// What an animation takes elsewhere is in the picture there too.
#[test]
fn a_scene_that_moves_is_framed_for_all_of_its_way() {
    let mut file = File::triangle();
    file.animate("translation", "LINEAR", &[0.0, 1.0], &[[0.0; 3], [9.0, 0.0, 0.0]]);
    let seen = |scene: &stillray::Scene, time: f64| {
        let (pose, view) = (scene.pose(time), scene.pose(0.0).cameras[0]);
        scene.meshes[0].positions.iter().all(|p| {
            let seen = view.rotation.inverse() * (pose.instances[0].transform_point3(p.as_dvec3()) - view.position);
            seen.z < 0.0 && seen.x.abs().max(seen.y.abs()) / -seen.z <= (view.yfov / 2.0).tan()
        })
    };
    let scene = file.scene();
    assert!((0..15).all(|i| seen(&scene, f64::from(i) / 16.0)));
    // Negative control: the camera of the same triangle standing still.
    let mut still = scene.clone();
    still.animations.clear();
    still.cameras.clear();
    still.complete();
    let view = still.pose(0.0).cameras[0];
    assert!(view.position.distance(scene.pose(0.0).cameras[0].position) > 5.0);
}

#[test]
fn a_scene_without_a_camera_is_framed_and_without_a_light_is_lit() {
    let mut file = File::triangle();
    file.json["nodes"][0]["translation"] = json!([1e6, 0, -5]);
    file.json["nodes"][0]["scale"] = json!([0.1, 20, 1]);
    let scene = file.scene();
    let pose = scene.pose(0.0);
    let view = pose.cameras[0];
    assert_eq!(scene.cameras[0].name, "framed");
    for &p in &scene.meshes[0].positions {
        let seen = view.rotation.inverse() * (pose.instances[0].transform_point3(p.as_dvec3()) - view.position);
        let slope = seen.x.abs().max(seen.y.abs()) / -seen.z;
        assert!(seen.z < 0.0 && slope <= (view.yfov / 2.0).tan(), "{p} is outside the picture");
    }
    let up = view.rotation * DVec3::Y;
    assert!(up.y > 0.9, "upright: {up}");
    // A surface that faces the light receives `intensity`, of which a white diffuse one returns 1/π in each direction.
    let light = &scene.lights[0];
    assert_eq!((light.kind, light.intensity / std::f32::consts::PI), (LightKind::Directional, 1.0));
    let (forward, direction) = (view.rotation * DVec3::NEG_Z, pose.lights[0].direction);
    assert!(direction.dot(forward) > 0.5 && direction.dot(forward) < 0.95 && direction.y < -0.3, "{direction}");
    assert!(scene.environment.radiance.min_element() > 0.0);
    let mut again = scene.clone();
    again.complete();
    assert_eq!((again.nodes.len(), again.lights.len()), (scene.nodes.len(), scene.lights.len()));
}

// What is refused, and what is ignored

#[test]
fn required_extensions_that_are_unknown_are_refused_with_their_user() {
    let mut file = File::textured(json!({ "name": "m" }));
    file.json["extensionsRequired"] = json!(["VENDOR_magic"]);
    assert!(file.message().contains("the file uses VENDOR_magic"), "{}", file.message());
    file.json["meshes"][0]["primitives"][0]["extensions"] = json!({ "VENDOR_magic": {} });
    assert!(file.message().contains("node 'the node' (mesh 'the mesh') uses VENDOR_magic"), "{}", file.message());
    file.json["extensionsRequired"] = json!(["KHR_materials_unlit", "KHR_texture_transform", "KHR_xmp_json_ld"]);
    assert_eq!(file.scene().notices, ["VENDOR_magic is ignored (mesh 'the mesh')"]);
}

#[test]
fn extensions_that_change_the_picture_are_ignored_aloud() {
    let clearcoat = json!({ "KHR_materials_clearcoat": { "clearcoatFactor": 1 } });
    let file = File::textured(json!({ "name": "m", "extensions": clearcoat, "extras": { "extensions": { "no": 1 } } }));
    assert_eq!(file.scene().notices, ["KHR_materials_clearcoat is ignored (material 'm')"]);
}

#[test]
fn indices_beyond_32_bits_are_not_truncated() {
    let big = 1u64 << 32;
    let mut file = File::triangle();
    file.json["skins"] = json!([{ "joints": [0, big] }]);
    assert!(file.message().contains("4294967296"), "{}", file.message());
    file.json["skins"] = json!([]);
    file.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": big }]);
    assert!(file.message().contains("4294967296"), "{}", file.message());
    for pointer in ["/nodes/0/mesh", "/scenes/0/nodes/0", "/meshes/0/primitives/0/attributes/POSITION", "/scene"] {
        let mut file = File::triangle();
        *file.json.pointer_mut(pointer).unwrap() = json!(big);
        assert!(file.message().contains("4294967296"), "{pointer}: {}", file.message());
    }
}
