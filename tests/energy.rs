//! Stable frames carry the energy that they should: against the reference, over ten frames of each motion.
//!
//! What has a closed form is in `analytic.rs`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test
mod support;

use stillray::gpu::ContextOptions;
use stillray::headless::{Device, LoadedScene};
use stillray::progress::Quiet;
use stillray::renderer::{Fill, FrameStats, Method, Settings};
use stillray::scene::motion::Motion;
use support::rig::{Rig, load, mean};

const FRAMES: u32 = 10;
const SIZE: [u32; 2] = [128, 96];

/// Without the validation layer, which takes most of the time; one test below has it on.
fn rig(name: &str) -> Rig {
    let scene = load(&format!("builtin:{name}"));
    let device = Device::with_options(&ContextOptions { device: None, validation: false }).unwrap();
    let loaded = LoadedScene::new(&device, &scene, &Quiet).unwrap();
    Rig { device, scene, loaded }
}

/// Mean radiance of each frame of the reference: 16 samples a pixel, with new positions in each frame, so that over ten
/// frames each pixel has 160. (`reference` itself is this, accumulated; a moving camera would have it start anew, with the
/// same positions, each time.)
fn reference(rig: &Rig, motion: Motion, frames: u32) -> Vec<f64> {
    let settings = Settings {
        method: Method::Supersample,
        jitter: true,
        spp: 16,
        float_output: true,
        size: SIZE,
        ..Settings::default()
    };
    render(rig, &settings, motion, frames).into_iter().map(|f| f.0).collect()
}

/// Mean radiance of each frame, and its counts.
fn render(rig: &Rig, settings: &Settings, motion: Motion, frames: u32) -> Vec<(f64, FrameStats)> {
    let mut session = rig.session(settings);
    let frame = |i: u32| {
        let stats = rig.frame(&mut session, motion, i);
        (mean(&session.color().unwrap()), stats)
    };
    (0..frames).map(frame).collect()
}

fn settings(density: f32, seed: u32) -> Settings {
    Settings { size: SIZE, density, seed, float_output: true, ..Settings::default() }
}

/// Energy over that of the reference, less one, over all frames.
fn bias(frames: &[(f64, FrameStats)], reference: &[f64]) -> f64 {
    frames.iter().map(|f| f.0).sum::<f64>() / reference.iter().sum::<f64>() - 1.0
}

#[test]
fn stable_at_density_four_is_within_one_percent_of_the_reference() {
    for name in ["hairball?strands=300", "cornell", "terrain"] {
        let rig = rig(name);
        for motion in [Motion::Rotate, Motion::Pan, Motion::Zoom, Motion::Orbit, Motion::Dolly] {
            let reference = reference(&rig, motion, FRAMES);
            let bias = bias(&render(&rig, &settings(4.0, 0), motion, FRAMES), &reference);
            println!("{name:<22} {motion:<7} {:+.3} %", 100.0 * bias);
            assert!(bias.abs() < 0.01, "{name}, {motion}: {bias}");
        }
    }
}

#[test]
fn the_comparison_notices_two_percent() {
    let rig = rig("cornell");
    let mut brighter = rig.scene.clone();
    brighter.lights.iter_mut().for_each(|light| light.intensity *= 1.025);
    let loaded = LoadedScene::new(&rig.device, &brighter, &Quiet).unwrap();
    let truth = reference(&rig, Motion::Pan, FRAMES);
    let other = Rig { scene: brighter, loaded, device: rig.device };
    let bias = bias(&render(&other, &settings(4.0, 0), Motion::Pan, FRAMES), &truth);
    assert!(bias > 0.01, "{bias}");
}

/// What the energy of frame 1 is over that of frame 0, both over the reference's, and what part of its samples is missing.
/// Frame 0 of the same settings has the same samples and so the same noise.
fn gain(rig: &Rig, truth: &[f64], settings: &Settings) -> (f64, f64) {
    let frames = render(rig, settings, Motion::Pan, 2);
    let missing = f64::from(frames[1].1.occluded) / f64::from(frames[1].1.rays);
    (frames[1].0 / truth[1] / (frames[0].0 / truth[0]), missing)
}

/// Known limitation. In the first frame of a movement, no hidden samples are there yet to come back where something moves
/// away. What is missing is added anywhere in its pixel, on what is in front as well, which then weighs too much. Without a
/// fill, what just got covered is counted as there on top of that, since verification comes after the analysis (paper 1,
/// figure 2), and nothing replaces it. If a part m of the frame's samples is missing, and radiance is not negative, the
/// mean is too large by a factor of 1 / (1 - m) at most.
#[test]
fn what_is_in_front_gains_weight_in_the_first_frame_of_a_movement() {
    let rig = rig("hairball?strands=300");
    let truth = reference(&rig, Motion::Pan, 2);
    let change = |filter_fill| {
        [4.0, 1.0].map(|density| {
            let mut change = 0.0;
            for seed in 0..2 {
                let (gained, missing) = gain(&rig, &truth, &Settings { filter_fill, ..settings(density, seed) });
                println!(
                    "{filter_fill:?}, {density}: {missing:.3} of the samples hidden, {gained:.4} times the energy"
                );
                assert!(missing > 0.05 && gained < 1.0 / (1.0 - missing), "{missing} {gained}");
                change += 0.5 * (gained - 1.0);
            }
            change
        })
    };
    let (none, edge) = (change(Fill::None), change(Fill::Edge));
    let mean = |change: [f64; 2]| change[0].midpoint(change[1]);
    let gone = "If they no longer do, this limitation is gone";
    assert!(none.iter().all(|change| *change > 0.005), "strands gain weight: {none:?}. {gone}");
    assert!(mean(edge) < 0.75 * mean(none), "a fill replaces a part of it: {edge:?} of {none:?}");
    assert!(mean(edge) > 0.003, "strands gain weight: {edge:?}. {gone}");
    // A camera that turns covers nothing, and the mean stays.
    let truth = reference(&rig, Motion::Rotate, 2);
    let frames = render(&rig, &settings(4.0, 0), Motion::Rotate, 2);
    assert!((frames[1].0 / truth[1] / (frames[0].0 / truth[0]) - 1.0).abs() < 0.005);
    assert_eq!(frames[1].1.occluded, 0);
}

/// One sample a pixel, and the nearest of several points wins: where surfaces meet in a pixel, those in front are favoured
/// (paper 3 speaks of "biased sampling"). Measured: cornell +0.4 %, terrain +0.1 %. It has to keep to what `stable` keeps to;
/// that the comparison would notice otherwise, the test above shows.
#[test]
fn point_tracking_is_within_one_percent_of_the_reference() {
    for name in ["cornell", "terrain"] {
        let rig = rig(name);
        let truth = reference(&rig, Motion::Orbit, FRAMES);
        let settings = Settings { size: SIZE, float_output: true, ..Settings::of(Method::PointTracking) };
        let bias = bias(&render(&rig, &settings, Motion::Orbit, FRAMES), &truth);
        println!("{name:<22} {:+.3} %", 100.0 * bias);
        assert!(bias.abs() < 0.01, "{name}: {bias}");
    }
}

#[test]
fn moving_frames_are_clean() {
    let rig = Rig::new(load("builtin:spheres"));
    let small = Settings { size: [48, 32], ..settings(4.0, 0) };
    assert!(render(&rig, &small, Motion::Orbit, 4).iter().all(|f| f.0.is_finite() && f.0 > 0.0));
    rig.assert_clean();
}
