//! Lenses, lights with an extent and maps of light from all around, from what glTF leaves to applications: `extras.stillray`.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic is a failing test

#[path = "support/gltf.rs"]
mod gltf;

use gltf::{File, data_uri, push};
use serde_json::{Value, json};
use stillray::report::openexr::{Channel, Exr};
use stillray::scene::{Lens, LightShape, Scene};

/// A camera and two lights, with these extras.
fn file(camera: Value, lamp: Value, sun: Value) -> File {
    let mut file = File::triangle();
    file.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 0.5, "znear": 0.1 }, "extras": { "stillray": camera } }]);
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "point", "extras": { "stillray": lamp } },
        { "type": "directional", "extras": { "stillray": sun, "other": 1 } },
    ] } });
    file.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    push(&mut file.json["nodes"], json!({ "camera": 0 }));
    for light in 0..2 {
        push(&mut file.json["nodes"], json!({ "extensions": { "KHR_lights_punctual": { "light": light } } }));
    }
    file
}

fn good() -> [Value; 3] {
    [
        json!({ "aperture": 0.05, "focus": 4, "blades": 6, "shutter": 0.5 }),
        json!({ "shape": "rectangle", "width": 1.5, "height": 0.5 }),
        json!({ "shape": "disc", "width": 0.5 }),
    ]
}

#[test]
fn lenses_and_extents_arrive() {
    let [camera, lamp, sun] = good();
    let scene = file(camera, lamp, sun).scene();
    assert_eq!(scene.cameras[0].lens, Lens { aperture: 0.05, focus: 4.0, blades: 6 });
    assert_eq!((scene.cameras[0].shutter, scene.pose(0.0).cameras[0].shutter), (0.5, 0.5));
    assert_eq!(scene.lights[0].shape, LightShape::Rectangle([1.5, 0.5]));
    let half_degree = 0.5_f64.to_radians() as f32;
    assert_eq!(scene.lights[1].shape, LightShape::Disc([half_degree; 2]), "as high as wide if nothing else is said");
    assert_eq!(scene.pose(0.0).cameras[0].lens.blades, 6);
    // Nothing of it is there: a pinhole, and sharp lights.
    let scene = file(Value::Null, json!({ "shape": "disc", "width": 1 }), json!({ "shape": "disc", "width": 1 }));
    assert!(scene.message().contains("cameras[0].extras.stillray is null"));
    let mut plain = scene.json.clone();
    plain["cameras"][0].as_object_mut().unwrap().remove("extras");
    plain["extensions"]["KHR_lights_punctual"]["lights"][0]["extras"] = json!({ "other": 2 });
    let scene = File { json: plain, ..scene }.scene();
    assert_eq!((scene.cameras[0].lens, scene.lights[0].shape), (Lens::PINHOLE, LightShape::Sharp));
    assert_eq!(scene.cameras[0].shutter, 0.0);
}

#[test]
fn what_is_wrong_is_told_with_key_value_and_range() {
    let wrong = [
        (0, json!({ "aperture": -0.1 }), ["cameras[0].extras.stillray.aperture", "-0.1", "at least 0"]),
        (0, json!({ "aperture": "wide" }), ["aperture", "\"wide\"", "at least 0"]),
        (0, json!({ "focus": 0 }), ["focus", "0", "above 0"]),
        (0, json!({ "blades": 2 }), ["blades", "2", "from 3 to 16"]),
        (0, json!({ "shutter": -0.1 }), ["cameras[0].extras.stillray.shutter", "-0.1", "from 0 to 1"]),
        (0, json!({ "shutter": 1.5 }), ["shutter", "1.5", "from 0 to 1, in frames"]),
        (0, json!({ "shutter": null }), ["shutter", "null", "from 0 to 1"]),
        (0, json!({ "blades": 5.5 }), ["blades", "5.5", "from 3 to 16"]),
        (0, json!({ "fstop": 2 }), ["fstop", "2", "aperture, focus, blades, shutter"]),
        (0, json!(3), ["cameras[0].extras.stillray", "3", "an object"]),
        (1, json!({ "shape": "line" }), ["lights[0].extras.stillray.shape", "\"line\"", "\"rectangle\" or \"disc\""]),
        (1, json!({ "width": 1 }), ["shape", "missing", "\"rectangle\" or \"disc\""]),
        (1, json!({ "shape": "disc", "width": -1 }), ["width", "-1", "at least 0, in metres"]),
        (1, json!({ "shape": "disc", "width": 1e39 }), ["width", "1e+39", "at least 0, in metres"]),
        (2, json!({ "shape": "disc", "width": 91 }), ["lights[1].extras.stillray.width", "91", "from 0 to 90"]),
    ];
    for (place, value, words) in wrong {
        let mut extras = good();
        extras[place] = value;
        let [camera, lamp, sun] = extras;
        let message = file(camera, lamp, sun).message();
        assert!(words.iter().all(|word| message.contains(word)), "{words:?}: {message}");
    }
}

/// The bytes of a picture of 4 x 2 texels with these channels.
fn picture(channels: &[&str], first: f32) -> Vec<u8> {
    let data: Vec<f32> = (0..8).map(|i| if i == 0 { first } else { i as f32 }).collect();
    let channel = |name: &&str| Channel { name: (*name).to_owned(), half: false, data: data.clone() };
    let picture = Exr { width: 4, height: 2, fps: None, channels: channels.iter().map(channel).collect() };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky.exr");
    picture.write(&path).unwrap();
    std::fs::read(path).unwrap()
}

fn lit_by(environment: Value) -> File {
    let mut file = File::triangle();
    file.json["scenes"][0]["extras"] = json!({ "stillray": { "environment": environment } });
    file
}

fn exr(bytes: &[u8]) -> String {
    data_uri("image/x-exr", bytes)
}

#[test]
fn a_map_arrives() {
    let file = exr(&picture(&["R", "G", "B"], 0.5));
    let scene = lit_by(json!({ "file": file, "scale": 2, "turn": 90 })).scene();
    let map = scene.environment_map.unwrap();
    assert_eq!((map.width, map.height, map.scale, map.turn), (4, 2, 2.0, std::f64::consts::FRAC_PI_2));
    assert_eq!(map.texels[..3], [[0.5; 3], [1.0; 3], [2.0; 3]]);
    // Light of its own: none stands in.
    assert!(scene.lights.is_empty() && scene.environment.radiance == glam::Vec3::ZERO);
    let grey = lit_by(json!({ "file": exr(&picture(&["Y"], 3.0)) })).scene();
    assert_eq!(grey.environment_map.unwrap().texels[0], [3.0; 3]);
    assert_eq!(lit_by(json!({ "file": file })).scene().environment_map.unwrap().scale, 1.0);
    assert!(File::triangle().scene().environment_map.is_none());
}

#[test]
fn texels_that_are_no_light_are_cut_off_with_a_notice() {
    let told = |scene: &Scene| scene.notices.iter().any(|n| n.contains("1 of 8 texels"));
    for (value, becomes) in [(f32::NAN, 0.0), (-1.0, 0.0), (f32::INFINITY, 65504.0), (f32::NEG_INFINITY, 0.0)] {
        let scene = lit_by(json!({ "file": exr(&picture(&["R", "G", "B"], value)) })).scene();
        assert!(told(&scene), "{:?}", scene.notices);
        assert_eq!(scene.environment_map.unwrap().texels[0], [becomes; 3], "{value}");
    }
    assert!(!told(&lit_by(json!({ "file": exr(&picture(&["R", "G", "B"], 1e6)) })).scene()));
}

#[test]
fn a_map_that_cannot_be_read_is_refused_with_the_reason() {
    let good = picture(&["R", "G", "B"], 1.0);
    let mut vast = good.clone();
    let window = vast.windows(17).position(|w| w == b"dataWindow\0box2i\0").unwrap() + 17 + 4;
    vast[window + 8..window + 16].copy_from_slice(&[0xff, 0xff, 0, 0, 0xff, 0xff, 0, 0]);
    let wrong = [
        (json!(3), ["environment", "3", "an object"]),
        (json!({}), ["scenes[0].extras.stillray.environment.file", "missing", "OpenEXR"]),
        (json!({ "file": "absent.exr" }), ["environment.file", "'absent.exr'", "put the file beside"]),
        (json!({ "file": "/etc/passwd" }), ["environment.file", "absolute", "relative"]),
        (json!({ "file": exr(b"not a picture") }), ["environment.file", "OpenEXR", "equirectangular"]),
        (json!({ "file": exr(&picture(&["depth.Z"], 1.0)) }), ["environment.file", "depth.Z", "save it as RGB"]),
        (json!({ "file": exr(&vast) }), ["environment.file", "65536 x 65536", "scale it down"]),
        (json!({ "file": exr(&good), "scale": -1 }), ["environment.scale", "-1", "at least 0"]),
        (json!({ "file": exr(&good), "turn": 361 }), ["environment.turn", "361", "from -360 to 360"]),
        (json!({ "file": exr(&good), "rotation": 3 }), ["rotation", "3", "file, scale, turn"]),
    ];
    for (value, words) in wrong {
        let message = lit_by(value).message();
        assert!(words.iter().all(|word| message.contains(word)), "{words:?}: {message}");
    }
    // A file that ends too early, wherever that is, is refused and nothing else.
    for length in 0..good.len() {
        lit_by(json!({ "file": exr(&good[..length]) })).message();
    }
}

#[test]
fn a_medium_arrives_and_wrong_ones_are_refused() {
    use stillray::scene::medium::{Medium, Mist, Region};
    let of = |medium: Value| {
        let mut file = File::triangle();
        file.json["scenes"][0]["extras"] = json!({ "stillray": { "medium": medium } });
        file
    };
    let box_of = json!([[-1, 0, -1], [1, 2, 1]]);
    let noise = json!({ "amplitude": 0.5, "size": 6, "drift": [0.2, 0, 0] });
    let full =
        json!({ "scattering": [0.1, 0.2, 0.3], "absorption": 0.5, "anisotropy": -0.5, "box": box_of, "noise": noise });
    let mist = Mist {
        low: glam::DVec3::new(-1.0, 0.0, -1.0),
        high: glam::DVec3::new(1.0, 2.0, 1.0),
        amplitude: 0.5,
        size: 6.0,
        drift: glam::DVec3::X * 0.2,
    };
    let expected = Medium {
        scattering: glam::Vec3::new(0.1, 0.2, 0.3),
        absorption: glam::Vec3::splat(0.5),
        anisotropy: -0.5,
        region: Region::Mist(mist),
    };
    assert_eq!(of(full).scene().medium, Some(expected));
    assert_eq!(of(json!({ "scattering": 1 })).scene().medium.map(|m| m.region), Some(Region::Everywhere));
    assert_eq!(File::triangle().scene().medium, None);
    let wrong = [
        (json!(3), ["medium", "3", "an object"]),
        (json!({ "density": 1 }), ["medium.density", "1", "scattering, absorption"]),
        (json!({ "scattering": -1 }), ["medium.scattering", "-1", "from 0 to 1e9"]),
        (json!({ "scattering": [1, 2] }), ["medium.scattering", "[1,2]", "one number or three"]),
        (json!({ "absorption": [1, 2, -3] }), ["medium.absorption", "-3", "1/metre"]),
        (json!({ "anisotropy": 1 }), ["medium.anisotropy", "1", "above -1 and below 1"]),
        (json!({ "anisotropy": 0.999_999_999_9 }), ["medium.anisotropy", "0.9999999999", "below 1"]),
        (json!({ "box": [[1, 0, 0], [0, 1, 1]] }), ["medium.box", "[[1,0,0],[0,1,1]]", "the lowest"]),
        (json!({ "box": 3 }), ["medium.box", "3", "two corners"]),
        (json!({ "noise": {} }), ["medium.box", "missing", "a box"]),
        (json!({ "box": box_of, "noise": { "size": 0 } }), ["medium.noise.size", "0", "from 0.001"]),
        (json!({ "box": box_of, "noise": { "amplitude": -1 } }), ["medium.noise.amplitude", "-1", "in metres"]),
        (json!({ "box": box_of, "noise": { "drift": "x" } }), ["medium.noise.drift", "x", "metres a second"]),
        (json!({ "box": box_of, "noise": { "seed": 1 } }), ["medium.noise.seed", "1", "amplitude, size, drift"]),
    ];
    for (value, words) in wrong {
        let message = of(value).message();
        assert!(words.iter().all(|word| message.contains(word)), "{words:?}: {message}");
    }
}
