//! Nothing moves, nothing flickers: under a static camera and scene, frames are bit-identical from frame 2 on.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test
mod support;

use stillray::renderer::Settings;
use stillray::scene::motion::Motion;
use support::rig::{Rig, bits, load, shared_scene};

/// Frames 2 to 5 against each other, after `moving` frames of another motion.
fn assert_still(rig: &Rig, settings: &Settings, moving: u32) {
    let mut session = rig.session(settings);
    for i in 0..moving {
        rig.frame(&mut session, Motion::Orbit, i);
    }
    let mut settled: Option<Vec<u32>> = None;
    for i in 0..6 {
        rig.frame(&mut session, Motion::Static, i);
        let now = bits(&session.color().unwrap());
        assert!(now.iter().all(|b| f32::from_bits(*b).is_finite()));
        if i >= 2 {
            let before = settled.get_or_insert_with(|| now.clone());
            let changed = before.iter().zip(&now).filter(|(a, b)| a != b).count();
            assert_eq!(changed, 0, "{} at {settings:?}: {changed} values differ in frame {i}", rig.scene.name);
        }
    }
    rig.assert_clean();
}

#[test]
fn every_built_in_scene_stands_still() {
    for (name, _) in stillray::scene::builtin::NAMES {
        let rig = Rig::new(load(&format!("builtin:{name}{}", if *name == "hairball" { "?strands=200" } else { "" })));
        for (density, tolerance) in [(1.0, 1.0), (0.3, 0.0625), (2.5, 0.25), (4.0, 2.0)] {
            assert_still(&rig, &Settings { size: [64, 48], density, tolerance, ..Settings::default() }, 0);
        }
        assert_still(&rig, &Settings { size: [64, 48], ..Settings::default() }, 3);
    }
}

#[test]
fn sponza_stands_still() {
    let Some(path) = shared_scene("Sponza/Sponza.gltf") else { return };
    assert_still(&Rig::new(load(&path)), &Settings { size: [64, 48], ..Settings::default() }, 3);
}

#[test]
fn a_camera_that_moves_does_change_the_picture() {
    let rig = Rig::new(load("builtin:cornell"));
    let mut session = rig.session(&Settings { size: [64, 48], ..Settings::default() });
    let mut before = None;
    for i in 0..4 {
        rig.frame(&mut session, Motion::Rotate, i);
        let now = bits(&session.color().unwrap());
        assert_ne!(before.as_ref(), Some(&now), "frame {i}");
        before = Some(now);
    }
}
