//! Every model of ../shared/scenes either loads or is refused for the reason that is written here.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

#[path = "support/gltf.rs"]
mod gltf;

use std::path::Path;

use stillray::Error;
use stillray::scene::requirements::{self, Feature};
use stillray::scene::{LightKind, Mesh, Scene, import};

/// What has to be refused: file, what the message names as the place, and the feature.
const REFUSED: [(&str, &str, &str); 4] = [
    ("BasisUQuad.gltf", "material 0 (texture 0)", "KHR_texture_basisu"),
    ("Box-Draco/Box.gltf", "node 1 (mesh 'Mesh')", "KHR_draco_mesh_compression"),
    ("CesiumMan-Draco/CesiumMan.gltf", "node 'Cesium_Man' (mesh 'Cesium_Man')", "KHR_draco_mesh_compression"),
    ("Fox-Meshopt.glb", "node 0 (mesh 0)", "EXT_meshopt_compression"),
];

fn load(model: &str) -> Option<Scene> {
    let path = gltf::shared_scenes()?.join(model);
    Some(import::load(&path).unwrap_or_else(|error| panic!("{error}")))
}

#[test]
fn every_model_loads_or_is_refused_with_the_right_reason() {
    let Some(folder) = gltf::shared_scenes() else { return };
    let (mut loaded, mut refused) = (0, 0);
    for path in gltf::models(&folder) {
        let text = path.strip_prefix(&folder).unwrap().to_string_lossy().into_owned();
        // The longest entry that fits: names repeat in the folder of compressed files.
        let expected = REFUSED.iter().filter(|(file, ..)| text.ends_with(file)).max_by_key(|(file, ..)| file.len());
        match (import::load(&path), expected) {
            (Ok(scene), None) => {
                check(&scene, &path);
                loaded += 1;
            }
            (Err(Error::Unsupported { place, feature, .. }), Some((_, by, what))) => {
                assert_eq!((place.as_str(), feature.as_str()), (*by, *what), "{text}");
                refused += 1;
            }
            (Ok(_), Some(_)) => panic!("{text} loads, but should be refused"),
            (Err(error), _) => panic!("{error}"),
        }
    }
    println!("{loaded} models loaded, {refused} refused");
    assert!(loaded >= 37 && refused >= 4);
}

/// The invariants that [`Scene`]'s documentation promises.
fn check(scene: &Scene, path: &Path) {
    let name = path.display();
    assert!(!scene.instances.is_empty() && !scene.materials.is_empty() && !scene.cameras.is_empty(), "{name}");
    assert!(scene.nodes.iter().enumerate().all(|(i, n)| n.parent.is_none_or(|parent| parent < i)), "{name}");
    for mesh in &scene.meshes {
        check_mesh(scene, mesh);
    }
    for image in &scene.images {
        assert_eq!(image.texels.len(), (image.width * image.height) as usize, "{name}");
    }
    for time in [0.0, 0.4, scene.duration()] {
        let pose = scene.pose(time);
        let (low, high) = scene.bounds(&pose).unwrap();
        assert!(low.is_finite() && high.is_finite() && low.cmple(high).all(), "{name}");
        assert!(pose.cameras.iter().all(|c| (c.rotation.length() - 1.0).abs() < 1e-12), "{name}");
        assert!(pose.lights.iter().all(|l| (l.direction.length() - 1.0).abs() < 1e-12), "{name}");
    }
}

fn check_mesh(scene: &Scene, mesh: &Mesh) {
    let (name, count) = (&mesh.name, mesh.positions.len());
    let full = |length: usize| length == 0 || length == count;
    assert!(full(mesh.tangents.len()) && full(mesh.colors.len()), "{name}");
    assert!(mesh.uvs.iter().all(|uvs| full(uvs.len())) && mesh.normals.len() == count, "{name}");
    assert_eq!(mesh.triangles.len(), mesh.triangle_materials.len(), "{name}");
    assert!(mesh.triangles.iter().flatten().all(|&v| (v as usize) < count), "{name}");
    let has_normal_map = |&m: &u32| scene.materials[m as usize].normal_texture.is_some();
    assert_eq!(mesh.tangents.is_empty(), !mesh.triangle_materials.iter().any(has_normal_map), "{name}");
    // Normalised in f64 and rounded: each component is off by at most 2^-25, the length by less than 2^-23.
    let is_unit = |length: f32| (length - 1.0).abs() < 1.2e-7 * 2.0;
    assert!(mesh.normals.iter().all(|n| is_unit(n.length())), "{name}");
    assert!(mesh.tangents.iter().all(|t| is_unit(t.truncate().length()) && t.w.abs() == 1.0), "{name}");
}

#[test]
fn what_the_models_are_known_for_is_found_in_them() {
    let has = |model: &str, feature| {
        let found = load(model).map(|scene| requirements::inspect(&scene).has(feature));
        assert_ne!(found, Some(false), "{model} should require {feature:?}");
    };
    has("AlphaBlendModeTest/AlphaBlendModeTest.gltf", Feature::AlphaMask);
    has("AlphaBlendModeTest/AlphaBlendModeTest.gltf", Feature::AlphaBlend);
    has("NegativeScaleTest/NegativeScaleTest.glb", Feature::MirroredInstances);
    has("MultiUVTest/MultiUVTest.glb", Feature::SecondUvSet);
    has("UnlitTest/UnlitTest.glb", Feature::UnlitSurfaces);
    has("VertexColorTest/VertexColorTest.glb", Feature::VertexColors);
    has("TextureTransformTest/TextureTransformTest.gltf", Feature::TextureTransform);
    has("TextureSettingsTest/TextureSettingsTest.gltf", Feature::MirrorWrap);
    has("TextureSettingsTest/TextureSettingsTest.gltf", Feature::ClampWrap);
    has("EmissiveStrengthTest/EmissiveStrengthTest.glb", Feature::EmissiveSurfaces);
    has("CesiumMilkTruck/CesiumMilkTruck.gltf", Feature::MovingInstances);
    has("CesiumMilkTruck/CesiumMilkTruck.gltf", Feature::Instancing);
    has("LightsPunctualLamp/LightsPunctualLamp.gltf", Feature::PointLights);
    has("Sponza/Sponza.gltf", Feature::NormalTexture);
    for model in ["SimpleSkin/SimpleSkin.gltf", "CesiumMan/CesiumMan.glb", "Fox/Fox.glb"] {
        has(model, Feature::SkinnedMeshes);
        has(model, Feature::MovingInstances);
    }
    let quantized = "compressed/AnimatedMorphCube-Quantized/AnimatedMorphCube.gltf";
    let morphed = ["AnimatedMorphCube/AnimatedMorphCube.gltf", "SimpleMorph/SimpleMorph.gltf", quantized];
    for model in morphed.into_iter().chain(["MorphPrimitivesTest/MorphPrimitivesTest.glb"]) {
        has(model, Feature::MorphedMeshes);
    }
    let Some(sponza) = load("Sponza/Sponza.gltf") else { return };
    let sponza = requirements::inspect(&sponza);
    assert_eq!(sponza.contents.triangles, 262_267);
    let still = [Feature::MovingInstances, Feature::SkinnedMeshes, Feature::MorphedMeshes];
    for absent in [Feature::AlphaBlend, Feature::SecondUvSet, Feature::VertexColors].into_iter().chain(still) {
        assert!(!sponza.has(absent), "{absent:?}: {:?}", sponza.cause(absent));
    }
}

#[test]
fn the_lamp_has_its_lights() {
    let Some(scene) = load("LightsPunctualLamp/LightsPunctualLamp.gltf") else { return };
    assert_eq!(scene.lights.len(), 5);
    assert!(scene.lights.iter().all(|light| light.kind == LightKind::Point && light.intensity > 0.0));
    assert_eq!(scene.environment.radiance, glam::Vec3::ZERO);
}

/// MikkTSpace's tangents against those that an artist's tool stored in the file, by the same algorithm.
#[test]
fn generated_tangents_agree_with_given_ones() {
    let Some(folder) = gltf::shared_scenes() else { return };
    for model in ["WaterBottle/WaterBottle.gltf", "FlightHelmet/FlightHelmet.gltf"] {
        let path = folder.join(model);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains("TANGENT"));
        let given = import::load(&path).unwrap();
        let generated = import::load_slice(text.replace("TANGENT", "_TANGENT").as_bytes(), &path, None).unwrap();
        let (mut agree, mut total) = (0, 0);
        for (given, generated) in given.meshes.iter().zip(&generated.meshes) {
            for (a, b) in given.triangles.iter().flatten().zip(generated.triangles.iter().flatten()) {
                let (a, b) = (given.tangents[*a as usize], generated.tangents[*b as usize]);
                total += 1;
                // Within ten degrees: tools differ in how they weigh the triangles around a vertex.
                agree += usize::from(a.w == b.w && a.truncate().dot(b.truncate()) > 0.985);
            }
        }
        println!("{model}: {agree} of {total} corners agree");
        assert!(agree * 100 > total * 95, "{model}: {agree} of {total}");
    }
}
