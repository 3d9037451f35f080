//! Lenses and lights with an extent, from what glTF leaves to applications: `extras.stillray`.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic is a failing test

#[path = "support/gltf.rs"]
mod gltf;

use gltf::{File, push};
use serde_json::{Value, json};
use stillray::scene::{Lens, LightShape};

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
        json!({ "aperture": 0.05, "focus": 4, "blades": 6 }),
        json!({ "shape": "rectangle", "width": 1.5, "height": 0.5 }),
        json!({ "shape": "disc", "width": 0.5 }),
    ]
}

#[test]
fn lenses_and_extents_arrive() {
    let [camera, lamp, sun] = good();
    let scene = file(camera, lamp, sun).scene();
    assert_eq!(scene.cameras[0].lens, Lens { aperture: 0.05, focus: 4.0, blades: 6 });
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
}

#[test]
fn what_is_wrong_is_told_with_key_value_and_range() {
    let wrong = [
        (0, json!({ "aperture": -0.1 }), ["cameras[0].extras.stillray.aperture", "-0.1", "at least 0"]),
        (0, json!({ "aperture": "wide" }), ["aperture", "\"wide\"", "at least 0"]),
        (0, json!({ "focus": 0 }), ["focus", "0", "above 0"]),
        (0, json!({ "blades": 2 }), ["blades", "2", "from 3 to 16"]),
        (0, json!({ "blades": 5.5 }), ["blades", "5.5", "from 3 to 16"]),
        (0, json!({ "fstop": 2 }), ["fstop", "2", "aperture, focus, blades"]),
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
