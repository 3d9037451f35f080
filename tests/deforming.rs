//! Meshes that deform, on the device: a shape that moves as a body is drawn as the body, samples stay on it, motion is told.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod scene_support;
mod support;

use glam::{DQuat, DVec3, Vec3, Vec4};
use scene_support::{Build, Stage, ahead, material, reds, trs};
use std::sync::Arc;
use stillray::gpu::ContextOptions;
use stillray::headless::{Device, LoadedScene, Session};
use stillray::progress::Quiet;
use stillray::renderer::{Aov, Fill, FrameInputs, Method, Settings};
use stillray::scene::{
    Animation, Channel, ChannelValues, Deformer, Interpolation, LightKind, MorphTarget, Scene, View, import,
};
use stillray::settings::Modelling;
use support::rig::shared_scene;

const SIZE: [u32; 2] = [64, 48];
/// Metres a second.
const SPEED: DVec3 = DVec3::new(0.5, 0.125, -0.25);

/// A ball before a wall, seen from the front.
fn ball() -> Build {
    let grey = |level: f32| material(Vec3::splat(level).extend(1.0), 0.0, 0.6);
    Build::new(0.2)
        .square(grey(0.4), trs(DVec3::new(0.0, 0.0, -6.0), DQuat::IDENTITY, 3.0))
        .ball(grey(0.9), trs(DVec3::new(-0.25, 0.0, -4.0), DQuat::IDENTITY, 0.5))
        .light(LightKind::Point, DVec3::new(1.0, 2.0, 0.0), DVec3::NEG_Y, 20.0)
}

fn animate(scene: &mut Scene, node: usize, values: ChannelValues) {
    let channel = Channel { node, times: vec![0.0, 8.0], interpolation: Interpolation::Linear, values };
    scene.animations.push(Animation { name: String::new(), channels: vec![channel] });
}

/// Its node moves.
fn moved() -> Scene {
    let mut scene = ball().camera(&ahead());
    let start = DVec3::new(-0.25, 0.0, -4.0);
    animate(&mut scene, 1, ChannelValues::Translation(vec![start, start + 8.0 * SPEED]));
    scene
}

/// Its node stands still, and a morph target takes all its vertices along the same way. (Its node scales by a half.)
fn morphed() -> Scene {
    let mut scene = ball().camera(&ahead());
    let way = (2.0 * 8.0 * SPEED).as_vec3();
    let positions = vec![way; scene.meshes[1].positions.len()];
    scene.meshes[1].morph_targets = vec![MorphTarget { positions, ..MorphTarget::default() }];
    scene.deformers = vec![Deformer { instance: 1, skin: None, weights: vec![0.0] }];
    animate(&mut scene, 1, ChannelValues::Weights(vec![0.0, 1.0]));
    scene
}

fn frames(scene: Scene, settings: &Settings, count: u32) -> Vec<(Vec<f32>, f64)> {
    let mut stage = Stage::new(scene, settings);
    (0..count)
        .map(|i| {
            let pose = stage.scene.pose(f64::from(i) / 16.0);
            let stats = stage.session.frame(&FrameInputs { view: ahead(), pose: &pose, reset: false }).unwrap();
            (stage.session.color().unwrap().data, stats.reused_fraction())
        })
        .collect()
}

/// Of the pixels, how many differ by more than what rounding may do to a sample that is there in both: a percent.
fn different(a: &[f32], b: &[f32]) -> f64 {
    let differs = |(x, y): (&f32, &f32)| (x - y).abs() > 0.01 * x.abs().max(y.abs()).max(0.01);
    a.iter().zip(b).filter(|pair| differs(*pair)).count() as f64 / a.len() as f64
}

/// Every method, with all the ways to decide about samples: the morphing ball is the moving one but for samples at
/// silhouettes, which rounding puts on one side or the other: a handful of the 3,072 pixels.
#[test]
fn a_shape_that_moves_as_a_body_is_drawn_as_the_body() {
    for method in Method::ALL.iter().filter(|m| !m.accumulates()) {
        for filter_fill in if method.keeps_samples() { Fill::ALL } else { &Fill::ALL[..1] } {
            let settings =
                Settings { size: SIZE, density: 2.0, spp: 2, filter_fill: *filter_fill, ..Settings::of(*method) };
            let [body, shape] = [moved(), morphed()].map(|scene| frames(scene, &settings, 8));
            for (i, ((a, reused), (b, also_reused))) in body.iter().zip(&shape).enumerate() {
                let off = different(a, b);
                assert!(off < 0.01, "{} {filter_fill:?}, frame {i}: {off} of the pixels differ", method.name());
                assert!((reused - also_reused).abs() < 0.01, "{reused} {also_reused}");
            }
            // Negative control: a frame later it is elsewhere.
            assert!(different(&body[5].0, &shape[6].0) > 0.02, "{}", method.name());
            let kept = shape[7].1;
            assert!(!method.keeps_samples() || kept > 0.9, "{kept} of the samples stay");
        }
    }
}

#[test]
fn motion_is_that_of_the_shape() {
    let aovs = vec![Aov::Motion, Aov::Depth];
    for scene in [moved(), morphed()] {
        let mut stage =
            Stage::new(scene, &Settings { size: SIZE, density: 4.0, aovs: aovs.clone(), ..Settings::default() });
        for i in 0..3 {
            let pose = stage.scene.pose(f64::from(i) / 16.0);
            stage.session.frame(&FrameInputs { view: ahead(), pose: &pose, reset: false }).unwrap();
        }
        let [motion, depth] = [Aov::Motion, Aov::Depth].map(|aov| stage.session.aov(aov).unwrap());
        let mut on_ball = 0;
        for ((_, metres), moved) in reds(&depth).zip(motion.data.chunks(2)) {
            if metres > 4.2 {
                continue;
            }
            on_ball += 1;
            // A point at x and depth z that goes by dx and dz in a frame moves by 96 (dx - x dz / z) / z pixels, since a metre a
            // metre away is 96 pixels. The ball's z is from 3.4 to 4.2, which makes the first term 0.71 to 0.88, and the second
            // is up to 0.09 where x is largest, at the silhouette; together within a quarter of the first in the middle.
            let expected = SPEED.x / 16.0 / 3.9 * 2.0 * 48.0;
            assert!((f64::from(moved[0]) - expected).abs() < 0.25 * expected, "{moved:?} {expected}");
        }
        assert!(on_ball > 50, "{on_ball}");
    }
}

/// Renderers that share a scene may look at different times.
#[test]
fn two_renderers_of_one_scene_do_not_disturb_each_other() {
    let scene = morphed();
    let settings = Settings { size: SIZE, density: 2.0, ..Settings::default() };
    let alone: Vec<Vec<f32>> = frames(scene.clone(), &settings, 6).into_iter().map(|f| f.0).collect();
    let device = Device::with_options(&ContextOptions { device: None, validation: true }).unwrap();
    let loaded = Arc::new(LoadedScene::new(&device, &scene, &Quiet).unwrap());
    let [mut one, mut other] = [0; 2].map(|_| Session::new(&device, &loaded, &settings).unwrap());
    for (i, expected) in alone.iter().enumerate() {
        let [now, later] = [0.0, 5.0].map(|ahead| scene.pose(i as f64 / 16.0 + ahead));
        let frame = |session: &mut Session, pose| {
            session.frame(&FrameInputs { view: ahead(), pose, reset: false }).unwrap();
            session.color().unwrap().data
        };
        let found = frame(&mut one, &now);
        assert!(found == *expected, "frame {i}");
        assert!(frame(&mut other, &later) != found);
    }
    support::assert_clean(device.context());
}

/// Samples of a walking figure under a camera that stands still: of those on it, most are there in the next frame.
#[test]
fn samples_stay_on_a_walking_figure() {
    let Some(path) = shared_scene("CesiumMan/CesiumMan.glb") else {
        println!("skipped, no ../shared/scenes");
        return;
    };
    let scene = import::load(path.as_ref()).unwrap();
    let aovs = vec![Aov::Density, Aov::Depth];
    for (method, least, most) in [(Method::Stable, 0.7, 1.0), (Method::Supersample, 0.0, 0.0)] {
        let settings = Settings { size: [120, 120], density: 4.0, aovs: aovs.clone(), ..Settings::of(method) };
        let mut stage = Stage::new(scene.clone(), &settings);
        let mut counts = [0.0; 2];
        for i in 0..12 {
            let pose = stage.scene.pose(f64::from(i) / 30.0);
            let view: View = pose.cameras[0];
            stage.session.frame(&FrameInputs { view, pose: &pose, reset: false }).unwrap();
            let [density, depth] = [Aov::Density, Aov::Depth].map(|aov| stage.session.aov(aov).unwrap());
            let figure = reds(&depth).zip(density.data.chunks(4)).filter(|((_, metres), _)| metres.is_finite());
            for (_, samples) in figure.filter(|_| i > 0) {
                counts[0] += f64::from(samples[2]);
                counts[1] += f64::from(samples[1] + samples[2]);
            }
        }
        let share = counts[0] / counts[1];
        println!("{}: {share:.3} of {} samples on the figure are reused", method.name(), counts[1]);
        assert!((least..=most).contains(&share) && counts[1] > 10_000.0, "{share} of {}", counts[1]);
    }
}

#[test]
fn a_pose_that_does_not_fit_is_refused() {
    let scene = morphed();
    let mut stage = Stage::new(scene, &Settings { size: SIZE, modelling: Modelling::All, ..Settings::default() });
    let good = stage.scene.pose(0.0);
    let mut refused = |change: &dyn Fn(&mut stillray::Pose)| {
        let mut pose = good.clone();
        change(&mut pose);
        let inputs = FrameInputs { view: ahead(), pose: &pose, reset: false };
        stage.session.frame(&inputs).err().map(|e| e.to_string()).unwrap_or_default()
    };
    assert!(refused(&|pose| pose.deformations.clear()).contains("0 deformations instead of 1"));
    assert!(refused(&|pose| pose.deformations[0].weights[0] = f64::NAN).contains("deformation 0"));
    assert_eq!(refused(&|_| ()), "", "and a good one is rendered after that");
}

/// White on white: a deformed normal that is wrong would show.
#[test]
fn a_shape_in_a_furnace_is_white() {
    let mut scene = morphed();
    scene.lights.clear();
    scene.environment.radiance = Vec3::ONE;
    for material in &mut scene.materials {
        (material.base_color, material.metallic) = (Vec4::ONE, 0.0);
    }
    let settings = Settings { size: SIZE, density: 2.0, float_output: true, ..Settings::default() };
    for (picture, _) in frames(scene, &settings, 6) {
        let worst = picture.chunks(4).flat_map(|p| &p[..3]).map(|x| (x - 1.0).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-3, "{worst}");
    }
}
