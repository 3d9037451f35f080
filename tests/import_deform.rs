//! Skins and morph targets out of hand-made glTF files: what arrives, and what is wrong with those that are refused.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

#[path = "support/gltf.rs"]
mod gltf;

use glam::{DAffine3, DVec3, Vec3};
use gltf::{File, push};
use serde_json::{Value, json};
use stillray::scene::deform::{Deformed, deform};
use stillray::scene::{Interpolation, Scene};

/// The vertices of a deformer at a time, in the world.
fn world(scene: &Scene, deformer: usize, time: f64) -> Vec<DVec3> {
    let pose = scene.pose(time);
    let (deformation, mut out) = (&pose.deformations[deformer], Deformed::default());
    let instance = deformation.instance;
    deform(&scene.meshes[scene.instances[instance].mesh], deformation, &mut out);
    out.positions.iter().map(|p| pose.instances[instance].transform_point3(p.as_dvec3())).collect()
}

/// What is done to a good file.
type Damage = fn(&mut Value);

/// A triangle with one target, which moves the third vertex up by 2.
fn morphing() -> File {
    let mut file = File::triangle();
    file.target(&[[0.0; 3], [0.0; 3], [0.0, 2.0, 0.0]]);
    file
}

// Skins

#[test]
fn a_skin_arrives() {
    let scene = File::skinned().scene();
    let skin = &scene.skins[0];
    assert_eq!((skin.name.as_str(), skin.joints.len(), scene.deformers.len()), ("the skin", 2, 1));
    assert_eq!(skin.joints.iter().map(|&joint| scene.nodes[joint].name.as_str()).collect::<Vec<_>>(), ["root", "tip"]);
    assert_eq!(skin.inverse_bind, [DAffine3::IDENTITY, DAffine3::from_translation(DVec3::NEG_Y)]);
    assert_eq!((scene.deformers[0].instance, scene.deformers[0].skin), (0, Some(0)));
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.joints[0], [[0; 4], [0; 4], [1, 0, 0, 0]], "joints without a weight do not count");
    assert_eq!(mesh.weights[0], [[1.0, 0.0, 0.0, 0.0]; 3], "made to add up to 1");
    assert!(mesh.flat.iter().eq([&(0..3)]) && mesh.joints[1].is_empty());
    assert_eq!(world(&scene, 0, 0.0), [DVec3::ZERO, DVec3::X, DVec3::Y]);
}

#[test]
fn joints_move_the_mesh_and_its_own_node_does_not() {
    let mut file = File::skinned();
    file.json["nodes"][0]["translation"] = json!([100, 0, 0]);
    file.json["nodes"][1]["translation"] = json!([0, 0, 5]);
    file.json["nodes"][2]["translation"] = json!([0, 4, 0]);
    let scene = file.scene();
    assert_eq!(world(&scene, 0, 0.0), [DVec3::Z * 5.0, DVec3::new(1.0, 0.0, 5.0), DVec3::new(0.0, 4.0, 5.0)]);
    assert_eq!(scene.bounds(&scene.pose(0.0)), Some((DVec3::Z * 5.0, DVec3::new(1.0, 4.0, 5.0))));
}

#[test]
fn absent_inverse_bind_matrices_are_identities() {
    let mut file = File::skinned();
    file.json["skins"][0].as_object_mut().unwrap().remove("inverseBindMatrices");
    assert_eq!(world(&file.scene(), 0, 0.0)[2], DVec3::Y * 2.0);
}

#[test]
fn a_skin_far_from_the_origin_keeps_its_shape() {
    let mut file = File::skinned();
    file.json["nodes"][1]["translation"] = json!([1e7, -3e7, 2e7]);
    let scene = file.scene();
    let far = DVec3::new(1e7, -3e7, 2e7);
    // f32 would round the world's coordinates to 2 m.
    assert_eq!(world(&scene, 0, 0.0), [far, far + DVec3::X, far + DVec3::Y]);
    assert_eq!(scene.pose(0.0).instances[0].translation, far);
}

#[test]
fn further_sets_count_and_the_eight_heaviest_stay() {
    let mut file = File::skinned();
    file.json["skins"][0] = json!({ "joints": [1, 2] });
    file.joints(0, &[[0, 0, 0, 0]; 3], &[[1.0; 4]; 3]);
    file.joints(1, &[[1, 1, 1, 1]; 3], &[[3.0; 4]; 3]);
    let scene = file.scene();
    assert_eq!(scene.meshes[0].weights[1], [[0.0625; 4]; 3], "the lightest come last");
    assert_eq!(world(&scene, 0, 0.0)[0], DVec3::Y * 0.75);
    assert!(scene.notices.is_empty(), "{:?}", scene.notices);
    file.joints(2, &[[1, 0, 0, 0]; 3], &[[1.0, 0.0, 0.0, 0.0]; 3]);
    let notice = "mesh 'the mesh', primitive 0: 3 vertices follow more than eight joints: \
                  the eight with the largest weights move them";
    assert_eq!(file.scene().notices, [notice]);
}

#[test]
fn weights_may_be_normalised_integers_and_joints_16_bits() {
    let mut file = File::skinned();
    let joints: Vec<u8> = [[1u16, 0, 0, 0]; 3].iter().flatten().flat_map(|j| j.to_le_bytes()).collect();
    let attributes = [("JOINTS_0", gltf::U16, joints), ("WEIGHTS_0", gltf::U8, [[255, 0, 255, 0]; 3].concat())];
    for (name, component, bytes) in attributes {
        let accessor = file.accessor(component, "VEC4", 3, &bytes);
        file.json["accessors"][accessor]["normalized"] = json!(name == "WEIGHTS_0");
        file.json["meshes"][0]["primitives"][0]["attributes"][name] = json!(accessor);
    }
    assert_eq!(file.scene().meshes[0].weights[0][0], [0.5, 0.5, 0.0, 0.0]);
    assert_eq!(file.scene().meshes[0].joints[0][0], [1, 0, 0, 0]);
}

#[test]
fn weights_of_nothing_are_replaced_aloud() {
    let mut file = File::skinned();
    file.joints(0, &[[1, 0, 0, 0]; 3], &[[0.0; 4], [-1.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]);
    let scene = file.scene();
    assert_eq!(scene.meshes[0].joints[0], [[1, 0, 0, 0], [0; 4], [1, 0, 0, 0]]);
    assert_eq!(scene.notices.len(), 2, "{:?}", scene.notices);
    assert!(scene.notices[0].contains("1 vertices follow joints with a negative weight"), "{:?}", scene.notices);
    assert!(scene.notices[1].contains("1 vertices follow no joint"), "{:?}", scene.notices);
}

#[test]
fn each_deforming_instance_has_a_mesh_of_its_own() {
    let mut file = File::skinned();
    push(&mut file.json["nodes"], json!({ "mesh": 0, "skin": 0 }));
    push(&mut file.json["nodes"], json!({ "mesh": 0 }));
    push(&mut file.json["nodes"], json!({ "mesh": 0 }));
    file.json["scenes"][0]["nodes"] = json!([0, 1, 3, 4, 5]);
    let scene = file.scene();
    assert_eq!(scene.instances.iter().map(|i| i.mesh).collect::<Vec<_>>(), [0, 1, 2, 2]);
    assert_eq!(scene.deformers.iter().map(|d| (d.instance, d.skin)).collect::<Vec<_>>(), [(0, Some(0)), (1, Some(0))]);
    assert!(!scene.meshes[2].deforms(), "without a skin its joints are nothing");
    assert_eq!((scene.skins.len(), scene.meshes[0].joints == scene.meshes[1].joints), (1, true));
}

#[test]
fn a_rigid_scene_has_none_of_it() {
    let mut file = File::triangle();
    file.json["skins"] = json!([{ "joints": [0] }]);
    push(&mut file.json["meshes"], json!({ "primitives": [{ "attributes": { "POSITION": 0 }, "targets": [{}] }] }));
    let scene = file.scene();
    assert!(scene.skins.is_empty() && scene.deformers.is_empty() && scene.meshes[0].flat.is_empty());
    assert_eq!(scene.pose(1.0).deformations, []);
}

#[test]
fn bad_skins_are_refused_by_name() {
    let matrix = "skin 'the skin' has an inverse bind matrix of joint 1 that is no affine transform";
    let cases: [(Damage, &str); 13] = [
        (|j| j["nodes"][0]["skin"] = json!(1), "node 'the node' (mesh 'the mesh') uses skin 1, which does not exist"),
        (|j| j["skins"][0]["joints"] = json!([]), "skin 'the skin' has no joints"),
        (|j| j["skins"][0]["joints"] = json!([1, 9]), "skin 'the skin' has the joint node 9, which does not exist"),
        (|j| j["scenes"][0]["nodes"] = json!([0]), "the joint node 'root', which is not in the scene"),
        (|j| j["skins"][0]["joints"] = json!([1]), "follows joint 1, but skin 'the skin' has 1 joints"),
        (|j| j["skins"][0]["joints"] = json!([1, 2, 1]), "has 2 inverse bind matrices for 3 joints"),
        (|j| j["skins"][0]["inverseBindMatrices"] = json!(0), "has 3 components of F32"),
        (|j| drop(attributes(j).remove("JOINTS_0")), "has WEIGHTS_0, but no JOINTS_0"),
        (|j| drop(attributes(j).remove("WEIGHTS_0")), "primitive 0 has JOINTS_0, but no WEIGHTS_0"),
        (|j| attributes(j).retain(|name, _| name == "POSITION"), "has no JOINTS_0 and no WEIGHTS_0"),
        (|j| j["accessors"][1]["count"] = json!(2), "JOINTS_0 (accessor 1) has 2 elements for 3 positions"),
        (|j| j["accessors"][1]["componentType"] = json!(gltf::I8), "are not vectors of four 8- or 16-bit integers"),
        (|j| j["accessors"][2]["count"] = json!(4), "WEIGHTS_0 (accessor 2) has 4 elements for 3 positions"),
    ];
    for (damage, reason) in cases {
        let mut file = File::skinned();
        damage(&mut file.json);
        assert!(file.message().contains(reason), "{reason}: {}", file.message());
    }
    for (at, value, reason) in [(64, f32::NAN, "is not finite"), (64 + 12, 1.0, matrix), (64 + 60, 0.0, matrix)] {
        let mut file = File::skinned();
        let start = file.data.len() - 128 + at;
        file.data[start..start + 4].copy_from_slice(&value.to_le_bytes());
        assert!(file.message().contains(reason), "{reason}: {}", file.message());
    }
}

fn attributes(json: &mut Value) -> &mut serde_json::Map<String, Value> {
    json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap()
}

#[test]
fn a_skin_that_overflows_is_refused_by_its_joint() {
    let mut file = File::skinned();
    file.json["nodes"][1]["scale"] = json!([1e30, 1, 1]);
    file.json["nodes"][2]["scale"] = json!([1e9, 1, 1]);
    assert!(file.message().contains("what node 'tip' places overflows"), "{}", file.message());
    file.json["nodes"][2]["scale"] = json!([1, 1, 1]);
    file.scene();
}

// Morph targets

#[test]
fn a_target_arrives_and_its_weights_come_from_the_node_or_else_the_mesh() {
    let third = |file: &File| world(&file.scene(), 0, 0.0)[2].y;
    let mut file = morphing();
    assert_eq!((file.scene().deformers[0].weights.as_slice(), third(&file)), (&[0.0][..], 1.0));
    file.json["meshes"][0]["weights"] = json!([0.5]);
    assert_eq!(third(&file), 2.0);
    file.json["nodes"][0]["weights"] = json!([-0.25]);
    assert_eq!(third(&file), 0.5);
    let scene = file.scene();
    assert_eq!(scene.bounds(&scene.pose(0.0)).unwrap().1, DVec3::new(1.0, 0.5, 0.0));
}

#[test]
fn targets_may_be_sparse_without_a_view() {
    let mut file = morphing();
    let (indices, values) = (file.view(&[2]), file.view(&[0.0f32, 2.0, 0.0].map(f32::to_le_bytes).concat()));
    let accessor = file.json["accessors"].as_array().unwrap().len() - 1;
    file.json["accessors"][accessor] = json!({ "componentType": gltf::F32, "type": "VEC3", "count": 3, "sparse": {
        "count": 1,
        "indices": { "bufferView": indices, "componentType": gltf::U8 },
        "values": { "bufferView": values },
    } });
    assert_eq!(file.scene().meshes[0].morph_targets[0].positions, [Vec3::ZERO, Vec3::ZERO, Vec3::Y * 2.0]);
    file.json["accessors"][accessor]["sparse"]["indices"]["bufferView"] = json!(0);
    assert!(file.scene().meshes[0].morph_targets[0].positions[2] == Vec3::ZERO, "the comparison sees the index");
}

#[test]
fn targets_follow_split_and_dropped_vertices() {
    let mut file = File::textured(json!({ "normalTexture": { "index": 0 } }));
    file.attribute("POSITION", &[[9.0; 3], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]);
    file.attribute("TEXCOORD_0", &[[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.0, 0.0], [-1.0, 0.0]]); // the last one mirrors
    file.attribute("NORMAL", &[[0.0, 0.0, 1.0]; 5]);
    file.indices(&[1, 2, 3, 3, 2, 4]);
    file.target(&[[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3], [4.0; 3]]);
    let scene = file.scene();
    let (mesh, name) = (&scene.meshes[0], |p: &Vec3| if p.x == 0.0 { 1.0 + 2.0 * p.y } else { 2.0 + 2.0 * p.y });
    assert_eq!(mesh.positions.len(), 6, "a seam splits two of the four that are used");
    for (position, delta) in mesh.positions.iter().zip(&mesh.morph_targets[0].positions) {
        assert_eq!(delta.x, name(position), "{position}");
    }
    assert!(mesh.morph_targets[0].tangents.is_empty() && mesh.flat.is_empty());
}

#[test]
fn normals_and_tangents_of_targets_need_some_to_be_added_to() {
    let mut file = morphing();
    let delta = file.floats(&[[0.0, 1.0, 0.0]; 3]);
    file.json["meshes"][0]["primitives"][0]["targets"][0] =
        json!({ "NORMAL": delta, "TANGENT": delta, "COLOR_0": delta, "_MINE": delta });
    let scene = file.scene();
    let target = &scene.meshes[0].morph_targets[0];
    assert!(target.positions.is_empty() && target.normals.is_empty() && target.tangents.is_empty());
    let notice = "mesh 'the mesh', primitive 0 has morph targets of COLOR_0, which are ignored";
    assert_eq!(scene.notices, [notice]);
    file.attribute("NORMAL", &[[0.0, 0.0, 1.0]; 3]);
    let scene = file.scene();
    assert_eq!(scene.meshes[0].morph_targets[0].normals, [Vec3::Y; 3]);
    assert!(scene.meshes[0].morph_targets[0].tangents.is_empty() && scene.meshes[0].flat.is_empty());
}

#[test]
fn bad_targets_are_refused_by_name() {
    let cases: [(Damage, &str); 6] = [
        (|j| j["accessors"][1]["count"] = json!(2), "POSITION of morph target 0 (accessor 1) has 2 elements for 3"),
        (|j| j["accessors"][1]["type"] = json!("VEC2"), "POSITION of morph target 0 (accessor 1) has 2 components"),
        (|j| j["nodes"][0]["weights"] = json!([1, 2]), "node 'the node' (mesh 'the mesh') has 2 weights for 1 morph"),
        (|j| j["meshes"][0]["weights"] = json!([]), "has 0 weights for 1 morph targets"),
        (|j| j["meshes"][0]["weights"] = json!([1e39]), "has a weight of a morph target that is not finite"),
        (
            |j| j["meshes"][0]["primitives"].as_array_mut().unwrap().push(json!({ "attributes": { "POSITION": 0 } })),
            "primitive 1 has 0 morph targets, but an earlier primitive 1",
        ),
    ];
    for (damage, reason) in cases {
        let mut file = morphing();
        damage(&mut file.json);
        assert!(file.message().contains(reason), "{reason}: {}", file.message());
    }
    let mut file = morphing();
    file.target(&[[f32::INFINITY; 3]; 3]);
    assert!(file.message().contains("POSITION of morph target 1 (accessor 2), element 0, is not finite"));
    let mut file = morphing();
    file.target(&[[3e38; 3]; 3]);
    file.scene();
    file.json["nodes"][0]["weights"] = json!([0, 1]);
    assert!(file.message().contains("what node 'the node' places overflows"), "a target may not leave the range");
}

// Animated weights

#[test]
fn all_three_interpolations_of_weights_arrive() {
    // (mode, values of two targets at 0 s and 2 s, weights at 1 s)
    let line: &[[f32; 1]] = &[[0.0], [4.0], [1.0], [0.0]];
    // For each key: in-tangents, values, out-tangents. Flat tangents at the first target; slopes of 1 and -1 a second at
    // the second: 1/8 of the difference of slopes times 2 s more than the mean.
    let spline: &[[f32; 1]] = &[[9.0], [9.0], [0.0], [4.0], [0.0], [1.0], [0.0], [-1.0], [1.0], [0.0], [9.0], [9.0]];
    for (mode, values, expected) in
        [("STEP", line, [0.0, 4.0]), ("LINEAR", line, [0.5, 2.0]), ("CUBICSPLINE", spline, [0.5, 2.5])]
    {
        let mut file = morphing();
        file.target(&[[1.0, 0.0, 0.0]; 3]);
        file.animate("weights", mode, &[0.0, 2.0], values);
        let scene = file.scene();
        assert_eq!(scene.pose(1.0).deformations[0].weights, expected, "{mode}");
        assert_eq!((scene.pose(-9.0).deformations[0].instance, scene.duration()), (0, 2.0));
        let modes = [Interpolation::Step, Interpolation::Linear, Interpolation::CubicSpline];
        assert!(modes.contains(&scene.animations[0].channels[0].interpolation));
    }
}

#[test]
fn weights_that_do_not_fit_the_targets_are_refused() {
    let mut file = morphing();
    file.animate("weights", "LINEAR", &[0.0, 1.0], &[[0.0]; 4]);
    let message = "animation 0, channel of node 'the node' has 2 keys and 4 values, 1 a key are needed";
    assert!(file.message().contains(message), "{}", file.message());
    file.target(&[[0.0; 3]; 3]);
    file.scene();
    file.json["animations"][0]["samplers"][0]["interpolation"] = json!("CUBICSPLINE");
    assert!(file.message().contains("2 keys and 4 values, 6 a key are needed"), "{}", file.message());
}

#[test]
fn weights_of_nothing_are_ignored_and_a_matrix_does_not_stop_them() {
    let mut file = File::triangle();
    file.animate("weights", "LINEAR", &[0.0, 1.0], &[[0.0], [1.0]]);
    let scene = file.scene();
    assert!(
        scene.animations.is_empty() && scene.notices[0].contains("no mesh with morph targets"),
        "{:?}",
        scene.notices
    );
    let mut file = morphing();
    file.animate("weights", "LINEAR", &[0.0, 1.0], &[[0.0], [1.0]]);
    file.json["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 0, 0, 1]);
    assert_eq!(world(&file.scene(), 0, 0.5)[2], DVec3::new(7.0, 2.0, 0.0));
}

#[test]
fn weights_that_overflow_are_refused() {
    let mut file = morphing();
    file.animate("weights", "LINEAR", &[0.0, 1.0], &[[0.0], [2e38]]);
    assert!(file.message().contains("what node 'the node' places overflows"), "{}", file.message());
}
