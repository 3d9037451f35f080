//! Nothing moves, nothing flickers: under a static camera and scene, frames are bit-identical from frame 2 on.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test
mod support;

use glam::{DQuat, DVec3};
use stillray::renderer::{Fill, Method, Settings, Weights};
use stillray::scene::motion::Motion;
use stillray::scene::{LocalTransform, Scene};
use support::rig::{Rig, bits, load, shared_scene};

/// Frames 2 to 5 against each other, after `moving` frames of another motion.
fn assert_still(rig: &Rig, settings: &Settings, moving: u32) {
    // An average of several frames rests once all of them do.
    assert_still_from(rig, settings, moving, 2 + settings.box_frames - 1);
}

/// Four frames from `rest` on against each other.
fn assert_still_from(rig: &Rig, settings: &Settings, moving: u32, rest: u32) {
    let mut session = rig.session(settings);
    for i in 0..moving {
        rig.frame(&mut session, Motion::Orbit, i);
    }
    let mut settled: Option<Vec<u32>> = None;
    for i in 0..rest + 4 {
        rig.frame(&mut session, Motion::Static, i);
        let now = bits(&session.color().unwrap());
        assert!(now.iter().all(|b| f32::from_bits(*b).is_finite()));
        if i >= rest {
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
        for (fill, weights) in
            [(Fill::Edge, Weights::Equal), (Fill::Edge, Weights::Voronoi), (Fill::None, Weights::Equal)]
        {
            let settings = Settings { filter_fill: fill, filter_weights: weights, ..Settings::default() };
            assert_still(&rig, &Settings { size: [64, 48], ..settings.clone() }, 3);
            assert_still(&rig, &Settings { size: [64, 48], density: 2.0, subpixels: 2, ..settings }, 3);
        }
        for moving in [0, 3] {
            assert_still(&rig, &Settings { size: [64, 48], ..Settings::of(Method::PointTracking) }, moving);
        }
    }
}

/// Frames after which a history in halves rests under frames that do not change.
///
/// Each channel moves in one direction (`glsl/include/temporal.glsl`), and a step that changes it at all is one of at least a
/// unit in the last place. Its distance from where it rests is 2^17 at first, the range of halves, and shrinks by 1 - alpha a
/// frame but for rounding, of a part of 2^-11 of the distance and half a unit u of the place of rest: after n frames it is
/// (1 - alpha + 2^-11)^n 2^17 + u / (2 alpha). Once the first term is below the least unit there is, 2^-24, at most
/// 1 + 1 / (2 alpha) steps of a unit are left.
fn frames_to_rest(alpha: f64) -> u32 {
    let shrinking = 41.0 * 2f64.ln() / -(1.0 - alpha + 2f64.powi(-11)).ln();
    (shrinking.ceil() + 1.0 + (0.5 / alpha).ceil()) as u32
}

#[test]
fn integrated_frames_come_to_rest() {
    let settings = Settings { size: [40, 32], ..Settings::of(Method::StableTi) };
    // From frame 2 on, what is integrated does not change.
    let rest = 2 + frames_to_rest(0.25);
    assert_eq!(rest, 105);
    for name in ["hairball?strands=200", "cornell", "spheres"] {
        assert_still_from(&Rig::new(load(&format!("builtin:{name}"))), &settings, 3, rest);
    }
    // Negative control: it takes some frames.
    let rig = Rig::new(load("builtin:hairball?strands=200"));
    let mut session = rig.session(&settings);
    for i in 0..3 {
        rig.frame(&mut session, Motion::Orbit, i);
    }
    let mut still = |i: u32| {
        rig.frame(&mut session, Motion::Static, i);
        bits(&session.color().unwrap())
    };
    let frames: Vec<Vec<u32>> = (0..8).map(&mut still).collect();
    assert!(frames[2..].windows(2).all(|w| w[0] != w[1]));
}

#[test]
fn averaged_frames_come_to_rest_when_all_of_them_are_alike() {
    let settings = Settings { size: [64, 48], box_frames: 3, ..Settings::default() };
    assert_still_from(&Rig::new(load("builtin:hairball?strands=200")), &settings, 3, 4);
}

#[test]
fn sponza_stands_still() {
    let Some(path) = shared_scene("Sponza/Sponza.gltf") else { return };
    assert_still(&Rig::new(load(&path)), &Settings { size: [64, 48], ..Settings::default() }, 3);
}

/// Each point is traced anew in each frame. Modelled ten thousand kilometres from its origin, a wall is known to a metre,
/// which is six pixels here: the rays would stray, were those of the last frame not kept.
#[test]
fn tracked_points_rest_even_where_hits_are_rounded_to_pixels() {
    let mut scene = load("builtin:cornell");
    let wanderers = |scene: Scene| {
        let rig = Rig::new(scene);
        let settings = Settings { size: [64, 48], ..Settings::of(Method::PointTracking) };
        assert_still(&rig, &settings, 0);
        let mut session = rig.session(&settings);
        let frames: Vec<u32> = (0..4).map(|i| rig.frame(&mut session, Motion::Static, i).histogram[0]).collect();
        frames[3]
    };
    assert_eq!(wanderers(scene.clone()), 0, "each point is projected to its own pixel");
    let far = DVec3::new(1e7, 0.0, 0.0);
    scene.meshes[0].positions.iter_mut().for_each(|p| *p += far.as_vec3());
    let room = scene.instances[0].node;
    scene.nodes[room].local = LocalTransform::Trs { translation: -far, rotation: DQuat::IDENTITY, scale: DVec3::ONE };
    let strayed = wanderers(scene);
    assert!(strayed > 64 * 48 / 20, "{strayed} pixels have lost their point: too few to show anything");
}

#[test]
fn a_camera_that_moves_does_change_the_picture() {
    let rig = Rig::new(load("builtin:cornell"));
    for method in [Method::Stable, Method::PointTracking] {
        let mut session = rig.session(&Settings { size: [64, 48], ..Settings::of(method) });
        let mut before = None;
        for i in 0..4 {
            rig.frame(&mut session, Motion::Rotate, i);
            let now = bits(&session.color().unwrap());
            assert_ne!(before.as_ref(), Some(&now), "{method:?}, frame {i}");
            before = Some(now);
        }
    }
}
