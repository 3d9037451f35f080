//! What a device cannot hold is refused with what to lower: no panic, no message of a layer, nothing left behind.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test
mod support;

use std::process::Command;
use stillray::Error;
use stillray::gpu::{Buffer, Place};
use stillray::headless::{LoadedScene, Session};
use stillray::progress::Quiet;
use stillray::renderer::{Method, Settings};
use stillray::resident::MAX_LIGHTS;
use stillray::scene::motion::Motion;
use support::rig::{Rig, load};

const HUGE: [u32; 2] = [16384, 16384];

#[test]
fn a_frame_too_large_to_bind_names_what_to_lower_and_takes_no_memory() {
    let rig = Rig::new(load("builtin:cornell"));
    let limits = rig.device.context().fit().properties.limits;
    let before = rig.device.context().memory_table();
    for method in Method::ALL {
        let settings = Settings { size: HUGE, ..Settings::of(*method) };
        let error = Session::new(&rig.device, &rig.loaded, &settings).unwrap_err();
        // 16 bytes a sample of 2^28 pixels are more than the 32 bits of `maxStorageBufferRange`, on any device.
        let told = match &error {
            Error::TooLarge { needed, limit, .. } => {
                *limit == u64::from(limits.max_storage_buffer_range) && needed > limit
            }
            Error::Setting { name, .. } => *name == "size" && limits.max_image_dimension2_d < HUGE[0],
            _ => false,
        };
        assert!(told && error.to_string().contains("size"), "{error}");
        assert_eq!(rig.device.context().memory_table(), before, "{method:?}");
    }
    // What fits still does.
    let mut session = rig.session(&Settings { size: [8, 8], ..Settings::default() });
    rig.frame(&mut session, Motion::Static, 0);
    rig.assert_clean();
}

#[test]
fn the_program_says_so_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillray"));
    command.current_dir(folder.path()).args(["render", "builtin:cornell", "--size", "16384x16384", "--quiet"]);
    let output = command.output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), said.lines().count()), (Some(1), 1), "{said}");
    assert!(said.contains("--size") || said.contains("size ="), "{said}");
}

#[test]
fn a_scene_buffer_too_large_to_bind_is_refused() {
    let context = support::validated_context();
    let limit = context.fit().properties.limits.max_storage_buffer_range;
    let beyond = vec![0; limit as usize + 1];
    let error = Buffer::with_data(&context, "triangle corners", &beyond, "use fewer triangles").unwrap_err();
    let text = error.to_string();
    assert!(matches!(error, Error::TooLarge { .. }) && text.contains("triangle corners"), "{text}");
    assert!(text.contains("use fewer triangles") && text.contains(&limit.to_string()), "{text}");
    assert!(context.memory_table().is_empty());
    support::assert_clean(&context);
}

#[test]
fn memory_that_the_device_does_not_have_is_refused_with_its_purpose() {
    let context = support::validated_context();
    let (most, largest) = (context.fit().max_allocation, context.fit().max_buffer);
    assert!(most > 1 << 20 && largest > 1 << 20, "a device has some memory");
    for (size, place) in
        [(most.saturating_add(4096), Place::Device), (u64::MAX, Place::Upload), (u64::MAX, Place::Device)]
    {
        let error = Buffer::new(&context, "sample caches", size, place).unwrap_err();
        let fits = matches!(error, Error::OutOfMemory { .. } | Error::TooLarge { limit_name: "maxBufferSize", .. });
        assert!(fits && error.to_string().contains("sample caches"), "{error}");
        assert!(error.to_string().contains("--size"), "{error}");
    }
    assert!(context.memory_table().is_empty());
    Buffer::new(&context, "a small one", 1 << 20, Place::Device).unwrap();
    support::assert_clean(&context);
}

#[test]
fn more_lights_than_a_sample_has_bits_are_refused() {
    let rig = Rig::new(load("builtin:cornell"));
    let mut scene = rig.scene.clone();
    scene.lights = vec![scene.lights[0].clone(); MAX_LIGHTS + 1];
    let error = LoadedScene::new(&rig.device, &scene, &Quiet).unwrap_err();
    assert!(matches!(error, Error::Setting { name: "lights", .. }) && error.to_string().contains("32"), "{error}");
    rig.assert_clean();
}
