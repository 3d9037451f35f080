//! Materials, textures and images of glTF arrive in the scene as the specification says.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

#[path = "support/gltf.rs"]
mod gltf;

use glam::{Affine2, Vec2, Vec3, Vec4};
use gltf::{File, data_uri, push};
use serde_json::{Value, json};
use stillray::scene::{AlphaMode, Material, Wrap};

fn material_of(members: Value) -> Material {
    File::textured(members).scene().materials.remove(0)
}

#[test]
fn all_members_of_a_material_arrive() {
    let material = material_of(json!({
        "name": "m",
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.1, 0.2, 0.3, 0.4],
            "baseColorTexture": { "index": 0 },
            "metallicFactor": 0.5,
            "roughnessFactor": 0.25,
            "metallicRoughnessTexture": { "index": 1 },
        },
        "normalTexture": { "index": 0, "scale": -2 },
        "occlusionTexture": { "index": 0, "strength": 0.75 },
        "emissiveTexture": { "index": 0 },
        "emissiveFactor": [0, 0.5, 1],
        "alphaMode": "MASK",
        "alphaCutoff": 0.3,
        "doubleSided": true,
        "extensions": { "KHR_materials_unlit": {}, "KHR_materials_emissive_strength": { "emissiveStrength": 8 } },
    }));
    assert_eq!(material.base_color, Vec4::new(0.1, 0.2, 0.3, 0.4));
    assert_eq!((material.metallic, material.roughness), (0.5, 0.25));
    assert_eq!((material.normal_scale, material.occlusion_strength), (-2.0, 0.75));
    assert_eq!(material.emissive, Vec3::new(0.0, 4.0, 8.0));
    assert_eq!(material.alpha, AlphaMode::Mask { cutoff: 0.3 });
    assert!(material.double_sided && material.unlit);
    let textures = [
        material.base_color_texture,
        material.metallic_roughness_texture,
        material.normal_texture,
        material.occlusion_texture,
        material.emissive_texture,
    ];
    assert_eq!(textures.map(|t| t.map(|t| t.texture)), [0, 1, 0, 0, 0].map(Some));
    let blend = material_of(json!({ "alphaMode": "BLEND" }));
    assert_eq!((blend.alpha, blend.double_sided, blend.unlit), (AlphaMode::Blend, false, false));
    assert_eq!(material_of(json!({ "alphaMode": "MASK" })).alpha, AlphaMode::Mask { cutoff: 0.5 });
}

#[test]
fn what_light_does_inside_arrives() {
    let material = material_of(json!({
        "extensions": {
            "KHR_materials_ior": { "ior": 1.33 },
            "KHR_materials_transmission": { "transmissionFactor": 0.75, "transmissionTexture": { "index": 1 } },
            "KHR_materials_volume":
                { "thicknessFactor": 2, "attenuationDistance": 0.5, "attenuationColor": [1, 0.25, 0.5] },
        },
        "extras": { "stillray": { "exponent": 2048 } },
    }));
    assert_eq!((material.ior, material.transmission, material.exponent), (1.33, 0.75, 2048.0));
    assert_eq!(material.transmission_texture.map(|t| t.texture), Some(0), "of the textures in use");
    let absorbs = material.volume.unwrap();
    let expected = Vec3::new(0.0, 4_f32.ln() / 0.5, 2_f32.ln() / 0.5);
    assert!(absorbs.abs_diff_eq(expected, 1e-6), "{absorbs}");
    // A wall without thickness, and what is said of nothing.
    let thin = material_of(json!({ "extensions": { "KHR_materials_volume": { "attenuationDistance": 0.5 } } }));
    assert_eq!((thin.volume, thin.ior, thin.transmission, thin.exponent), (None, 1.5, 0.0, 0.0));
    let whole = material_of(json!({ "extensions": { "KHR_materials_ior": { "ior": 0 } } }));
    assert_eq!(whole.ior, 0.0, "the extension's word for what reflects everything");
}

#[test]
fn what_light_cannot_do_inside_is_refused_with_key_value_and_range() {
    let inside = |name: &str, members: Value| json!({ "extensions": { name: members } });
    let volume = |members: Value| inside("KHR_materials_volume", members);
    let exponent = |value: Value| json!({ "extras": { "stillray": { "exponent": value } } });
    let wrong = [
        (inside("KHR_materials_ior", json!({ "ior": 0.9 })), ["KHR_materials_ior.ior", "0.9", "1 or more, or 0"]),
        (inside("KHR_materials_ior", json!({ "ior": -1.5 })), ["KHR_materials_ior.ior", "-1.5", "1 or more, or 0"]),
        (
            inside("KHR_materials_transmission", json!({ "transmissionFactor": 1.5 })),
            ["KHR_materials_transmission.transmissionFactor", "1.5", "0 to 1"],
        ),
        (volume(json!({ "thicknessFactor": -1 })), ["KHR_materials_volume.thicknessFactor", "-1", "0 or more"]),
        (volume(json!({ "attenuationDistance": 0 })), ["KHR_materials_volume.attenuationDistance", "0", "above 0"]),
        (volume(json!({ "attenuationColor": [1, 2, 1] })), ["KHR_materials_volume.attenuationColor", "2", "0 to 1"]),
        (exponent(json!(0)), ["materials[0].extras.stillray.exponent", "0", "from 1 to 1000000"]),
        (exponent(json!(1e7)), ["materials[0].extras.stillray.exponent", "10000000", "from 1 to 1000000"]),
        (exponent(json!("much")), ["materials[0].extras.stillray.exponent", "\"much\"", "from 1 to 1000000"]),
    ];
    for (members, words) in wrong {
        let message = File::textured(members).message();
        assert!(words.iter().all(|word| message.contains(word)), "{words:?}: {message}");
        assert!(message.contains("material"), "{message}");
    }
}

#[test]
fn factors_out_of_range_are_clamped_and_said() {
    let scene = File::textured(json!({ "name": "m", "pbrMetallicRoughness": { "roughnessFactor": 7 } })).scene();
    assert_eq!(scene.materials[0].roughness, 1.0);
    assert_eq!(scene.notices, ["material 'm' has factors outside their ranges, which are clamped"]);
    assert!(File::textured(json!({ "emissiveFactor": [1e39, 0, 0] })).message().contains("not finite"));
    assert!(File::textured(json!({ "alphaMode": "GLASS" })).message().contains("alpha mode"));
}

#[test]
fn only_materials_and_images_in_use_are_loaded() {
    let mut file = File::textured(json!({ "name": "used", "emissiveTexture": { "index": 0 } }));
    push(&mut file.json["materials"], json!({ "name": "not used", "normalTexture": { "index": 99 } }));
    push(&mut file.json["images"], json!({ "uri": "missing.png" }));
    let scene = file.scene();
    assert_eq!((scene.materials.len(), scene.textures.len(), scene.images.len()), (1, 1, 1));
    assert_eq!(scene.images[0].texels, [[255, 0, 0, 255], [0, 255, 0, 128]]);
}

#[test]
fn deep_images_are_reduced_and_that_is_said() {
    let scene = File::textured(json!({ "emissiveTexture": { "index": 1 } })).scene();
    // 0x8000 is 128.5 of 255ths.
    assert_eq!(scene.images[0].texels, [[255, 0, 128, 255]]);
    assert_eq!(scene.notices, ["image 1 is reduced from 16 to 8 bits a channel"]);
}

#[test]
fn images_come_from_buffers_too() {
    let mut file = File::textured(json!({ "emissiveTexture": { "index": 0 } }));
    let mut jpeg = Vec::new();
    let pixel = image::RgbImage::from_pixel(8, 8, image::Rgb([200, 200, 200]));
    pixel.write_to(&mut std::io::Cursor::new(&mut jpeg), image::ImageFormat::Jpeg).unwrap();
    let view = file.view(&jpeg);
    file.json["images"][0] = json!({ "bufferView": view, "mimeType": "image/jpeg", "name": "grey" });
    let image = &file.scene().images[0];
    assert_eq!((image.name.as_str(), image.width, image.height), ("grey", 8, 8));
    // A constant block survives JPEG but for the rounding of its mean and of the colour transform.
    assert!(image.texels.iter().all(|t| t[..3].iter().all(|&x| x.abs_diff(200) <= 2) && t[3] == 255));
}

#[test]
fn images_that_cannot_be_used_are_refused_by_name() {
    let refused = |image: Value| {
        let mut file = File::textured(json!({ "emissiveTexture": { "index": 0 } }));
        file.json["images"][0] = image;
        file.message()
    };
    let image = |bytes: &[u8]| json!({ "name": "pic", "uri": data_uri("image/png", bytes) });
    assert!(refused(image(b"\xabKTX 20\xbb\r\n\x1a\n")).contains("image 'pic' uses KTX2"));
    assert!(refused(image(b"RIFF....WEBPVP8 ")).contains("uses WebP"));
    assert!(refused(image(b"nothing")).contains("image 'pic' is neither PNG nor JPEG"));
    assert!(refused(image(b"\x89PNG\r\n\x1a\n")).contains("cannot be decoded"));
    assert!(refused(json!({ "name": "pic" })).contains("image 'pic' has neither"));
    assert!(refused(json!({ "bufferView": 99 })).contains("buffer view 99"));
    assert!(refused(json!({ "uri": "no.png" })).contains("image 'no.png': cannot read"));
    // A header that claims 4 gigatexels in 45 bytes.
    let mut huge = gltf::png(image::DynamicImage::new_luma8(1, 1));
    huge[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    let checksum = crc32(&huge[12..29]);
    huge[29..33].copy_from_slice(&checksum.to_be_bytes());
    assert!(refused(image(&huge)).contains("65536 x 65536"), "{}", refused(image(&huge)));
}

/// The checksum of PNG chunks (ISO 3309).
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    })
}

#[test]
fn samplers_arrive() {
    let mut file = File::textured(json!({ "emissiveTexture": { "index": 0 }, "occlusionTexture": { "index": 1 } }));
    file.json["textures"][0]["sampler"] = json!(0);
    file.json["samplers"] = json!([{ "wrapS": 33071, "wrapT": 33648, "magFilter": 9728 }]);
    let scene = file.scene();
    let emissive = scene.textures[scene.materials[0].emissive_texture.unwrap().texture];
    assert_eq!((emissive.wrap_u, emissive.wrap_v, emissive.nearest), (Wrap::Clamp, Wrap::Mirror, true));
    let occlusion = scene.textures[scene.materials[0].occlusion_texture.unwrap().texture];
    assert_eq!((occlusion.wrap_u, occlusion.wrap_v, occlusion.nearest), (Wrap::Repeat, Wrap::Repeat, false));
    file.json["samplers"][0]["wrapS"] = json!(1);
    assert!(file.message().contains("unknown wrap mode"));
    file.json["textures"][0]["sampler"] = json!(5);
    assert!(file.message().contains("sampler 5"));
}

#[test]
fn texture_transforms_follow_the_extension() {
    for slot in ["emissiveTexture", "normalTexture", "occlusionTexture"] {
        let transform = json!({ "offset": [0.25, 0.5], "rotation": std::f32::consts::FRAC_PI_2, "scale": [2, 3] });
        let material =
            material_of(json!({ slot: { "index": 0, "extensions": { "KHR_texture_transform": transform } } }));
        let used = [material.emissive_texture, material.normal_texture, material.occlusion_texture];
        let transform = used.into_iter().flatten().next().unwrap().transform;
        // Scaled to (2, 3), turned a quarter counter-clockwise as seen with v downwards: (u, v) to (v, -u).
        let expected = Vec2::new(3.0 + 0.25, -2.0 + 0.5);
        assert!((transform.transform_point2(Vec2::ONE) - expected).length() < 1e-6, "{transform}");
    }
    let plain = material_of(json!({ "emissiveTexture": { "index": 0 } }));
    assert_eq!(plain.emissive_texture.unwrap().transform, Affine2::IDENTITY);
    let bad = json!({ "offset": "far" });
    let material = json!({ "normalTexture": { "index": 0, "extensions": { "KHR_texture_transform": bad } } });
    assert!(File::textured(material).message().contains("KHR_texture_transform"));
}

#[test]
fn two_uv_sets_are_read_and_a_third_is_refused() {
    let transform = |set| json!({ "KHR_texture_transform": { "texCoord": set } });
    let mut file = File::textured(json!({
        "name": "m",
        "emissiveTexture": { "index": 0 },
        "occlusionTexture": { "index": 0, "texCoord": 0, "extensions": transform(1) },
    }));
    file.attribute("TEXCOORD_1", &[[0.5, 0.25]; 4]);
    let scene = file.scene();
    assert_eq!(scene.materials[0].occlusion_texture.unwrap().uv_set, 1, "the transform's set overrides");
    assert_eq!(scene.meshes[0].uvs[1][0], Vec2::new(0.5, 0.25));
    assert_eq!(scene.meshes[0].uvs[0].len(), scene.meshes[0].positions.len());
    file.json["materials"][0]["emissiveTexture"]["texCoord"] = json!(2);
    let message = file.message();
    assert!(message.contains("material 'm' uses TEXCOORD_2 (for its emissive texture)"), "{message}");
}

#[test]
fn textures_without_coordinates_are_left_out_and_said() {
    let mut file = File::textured(json!({ "name": "m", "normalTexture": { "index": 0 } }));
    let mut bare = file.json["meshes"][0]["primitives"][0].clone();
    bare["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
    push(&mut file.json["meshes"][0]["primitives"], bare.clone());
    push(&mut file.json["meshes"][0]["primitives"], bare);
    let scene = file.scene();
    assert_eq!(scene.meshes[0].triangle_materials, [0, 0, 1, 1, 1, 1]);
    assert!(scene.materials[0].normal_texture.is_some() && scene.materials[1].normal_texture.is_none());
    assert_eq!(
        scene.notices,
        ["mesh 'the mesh', primitive 1 has no TEXCOORD_0: the normal texture of material 'm' is ignored there"]
    );
}

#[test]
fn tangents_are_made_only_for_normal_maps() {
    assert!(File::textured(json!({})).scene().meshes[0].tangents.is_empty());
    let mut file = File::textured(json!({ "normalTexture": { "index": 0 } }));
    assert_eq!(file.scene().meshes[0].tangents, [Vec4::new(1.0, 0.0, 0.0, 1.0); 6]);
    file.attribute("TANGENT", &[[0.0, 2.0, 0.0, -1.0]; 4]);
    assert_eq!(file.scene().meshes[0].tangents[0].x, 1.0, "given tangents do not count without normals");
    file.attribute("NORMAL", &[[0.0, 0.0, 1.0]; 4]);
    assert_eq!(file.scene().meshes[0].tangents, [Vec4::new(0.0, 1.0, 0.0, -1.0); 4]);
}
