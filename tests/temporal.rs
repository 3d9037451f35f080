//! Methods that integrate or average frames, in whole: what they make of a still scene is known from its frames, what turns
//! moves as it must, a reset forgets, and a moving picture is steadier than what it is made of.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test
mod support;

use glam::{DQuat, DVec3};
use stillray::glam;
use stillray::headless::{Pixels, Session};
use stillray::renderer::{Aov, FrameInputs, Method, Settings};
use stillray::scene::View;
use stillray::scene::motion::Motion;
use stillray::settings::{History, Precision};
use support::rig::{Rig, bits, load};

const SIZE: [u32; 2] = [48, 40];

fn settings(method: Method) -> Settings {
    Settings { size: SIZE, float_output: true, ..Settings::of(method) }
}

/// New samples in each frame, of which nothing is kept.
fn jittered() -> Settings {
    Settings { jitter: true, ..settings(Method::Supersample) }
}

fn frames(rig: &Rig, settings: &Settings, motion: Motion, count: u32) -> Vec<Pixels> {
    let mut session = rig.session(settings);
    let frame = |i| {
        rig.frame(&mut session, motion, i);
        session.color().unwrap()
    };
    (0..count).map(frame).collect()
}

/// Largest difference, and the largest value.
fn farthest(a: &[f64], b: &Pixels) -> f64 {
    a.iter().zip(&b.data).map(|(a, b)| (a - f64::from(*b)).abs()).fold(0.0, f64::max)
}

/// Exponential averages.
fn integrated(frames: &[Pixels], alpha: f64) -> Vec<f64> {
    let wide = |p: &Pixels| p.data.iter().map(|x| f64::from(*x)).collect::<Vec<f64>>();
    let blend = |past: Vec<f64>, now: &Pixels| -> Vec<f64> {
        past.iter().zip(&now.data).map(|(p, n)| (1.0 - alpha) * p + alpha * f64::from(*n)).collect()
    };
    frames[1..].iter().fold(wide(&frames[0]), blend)
}

/// Where nothing moves and nothing is clamped, `taa` is the exponential average of the frames of jittered supersampling, in
/// scene-linear light: its mean is theirs.
#[test]
fn taa_of_a_still_scene_is_the_average_of_its_frames() {
    let rig = Rig::new(load("builtin:hairball?strands=200"));
    let truth = frames(&rig, &jittered(), Motion::Static, 24);
    assert_ne!(bits(&truth[0]), bits(&truth[1]), "the samples move");
    let brightest = truth.iter().flat_map(|f| &f.data).fold(0.0_f32, |a, b| a.max(*b));
    // Storing rounds to half a unit in the last place, arithmetic in f32 some ten times to one of its own; luma is at most
    // the brightest channel, of a colour come back from YCoCg three roundings. Of a frame's error 1 - alpha is left in each
    // that follows.
    for (precision, stored) in [(Precision::Half, 2f64.powi(-11)), (Precision::Float, 2f64.powi(-24))] {
        let history = History { alpha: 0.1, clamp: 16.0, precision, ..History::default() };
        let taa = Settings { history, ..settings(Method::Taa) };
        let last = frames(&rig, &taa, Motion::Static, 24).pop().unwrap();
        let bound = f64::from(brightest) * 3.0 * (stored + 10.0 * 2f64.powi(-24)) / 0.1;
        let found = farthest(&integrated(&truth, 0.1), &last);
        println!("{precision:?}: off by {found:.1e}, allowed {bound:.1e}");
        assert!(found <= bound, "{precision:?}: {found} {bound}");
        let wrong = farthest(&integrated(&truth, 0.2), &last);
        assert!(wrong > bound, "negative control: another weight, {wrong}");
    }
    rig.assert_clean();
}

#[test]
fn the_box_filter_averages_the_last_frames_of_any_method_that_has_it() {
    let rig = Rig::new(load("builtin:hairball?strands=200"));
    for (alone, motion) in [(jittered(), Motion::Static), (settings(Method::Stable), Motion::Rotate)] {
        let truth = frames(&rig, &alone, motion, 6);
        for count in [2, 3_usize] {
            let averaged = frames(&rig, &Settings { box_frames: count as u32, ..alone.clone() }, motion, 6);
            for (i, frame) in averaged.iter().enumerate() {
                let mean = |count: usize| {
                    let window = &truth[(i + 1).saturating_sub(count)..=i];
                    let sum = |at: usize| window.iter().map(|f| f64::from(f.data[at])).sum::<f64>();
                    (0..frame.data.len()).map(|at| sum(at) / window.len() as f64).collect::<Vec<f64>>()
                };
                // Sums of up to three floats and a division: 8 units of f32 are more than enough; radiance is below 4 here.
                assert!(farthest(&mean(count), frame) <= 4.0 * 8.0 * 2f64.powi(-24), "{count} frames, frame {i}");
                assert!(i == 0 || farthest(&mean(1), frame) > 0.01, "negative control");
            }
        }
    }
    rig.assert_clean();
}

/// A camera that only turns moves everything alike, however far away: the sky, too, moves with it.
#[test]
fn a_turning_camera_moves_sky_and_surfaces_alike() {
    let rig = Rig::new(load("builtin:spheres"));
    for method in [Method::StableTi, Method::Taa] {
        let turning = Settings { aovs: vec![Aov::Depth, Aov::Motion, Aov::Density], ..settings(method) };
        let mut session = rig.session(&turning);
        // The built-in view sees no sky: look up a little.
        let base = rig.scene.pose(0.0).cameras[0];
        let up = |turn: f64| {
            let rotation = (base.rotation * DQuat::from_rotation_x(0.3) * DQuat::from_rotation_y(turn)).normalize();
            View { rotation, ..base }
        };
        let views = [up(0.0), up(0.02)];
        views.iter().for_each(|view| show(&rig, &mut session, *view, false));
        let [depth, motion, density] = [Aov::Depth, Aov::Motion, Aov::Density].map(|aov| session.aov(aov).unwrap());
        let [mut sky, mut surfaces] = [0, 0];
        for (i, (metres, moved)) in depth.data.iter().zip(motion.data.chunks(2)).enumerate() {
            // A pixel without a sample has no motion. Nothing is occluded that was not before.
            if density.data[4 * i + 1] + density.data[4 * i + 2] == 0.0 {
                continue;
            }
            let corner = [i as u32 % SIZE[0], i as u32 / SIZE[0]].map(f64::from);
            // The sample is anywhere in the pixel, and the motion of all of it is between those of its corners: it changes
            // along straight lines but for a second order. A half of less than two pixels has steps of 2^-10.
            let ends = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]];
            let moves = ends.map(|[x, y]| turned(&views, [corner[0] + x, corner[1] + y]));
            for axis in 0..2 {
                let [low, high] = [f64::min, f64::max].map(|pick| moves.iter().map(|m| m[axis]).reduce(pick).unwrap());
                let slack = 2f64.powi(-10) + 1e-3;
                let inside = (low - slack..=high + slack).contains(&f64::from(moved[axis]));
                assert!(inside, "{corner:?}: {moved:?}, expected {moves:?}");
            }
            assert!(moved[0].abs() > 0.5);
            *(if metres.is_infinite() { &mut sky } else { &mut surfaces }) += 1;
        }
        println!("{method:?}: {sky} pixels of sky, {surfaces} of surfaces");
        assert!(sky > 100 && surfaces > 100 && 2 * (sky + surfaces) > SIZE[0] * SIZE[1]);
    }
    rig.assert_clean();
}

/// How far a point of the second view has moved since the first, in pixels, if the camera only turned.
fn turned(views: &[View; 2], at: [f64; 2]) -> [f64; 2] {
    let [width, height] = SIZE.map(f64::from);
    let tangent = (views[1].yfov * 0.5).tan();
    let [x, y] = [(at[0] / width * 2.0 - 1.0) * tangent * width / height, (1.0 - at[1] / height * 2.0) * tangent];
    let before = views[0].rotation.inverse() * (views[1].rotation * DVec3::new(x, y, -1.0));
    let [x, y] = [before.x / -before.z, before.y / -before.z].map(|v| v / tangent);
    [at[0] - (x * height / width * 0.5 + 0.5) * width, at[1] - (0.5 - y * 0.5) * height]
}

fn show(rig: &Rig, session: &mut Session, view: View, reset: bool) {
    session.frame(&FrameInputs { view, pose: &rig.scene.pose(0.0), reset }).unwrap();
}

#[test]
fn a_reset_forgets_the_history() {
    let rig = Rig::new(load("builtin:cornell"));
    let averaged = Settings { box_frames: 3, ..settings(Method::Stable) };
    for settings in [settings(Method::StableTi), settings(Method::Taa), averaged] {
        let shown = |session: &mut Session, index: u32, reset: bool| {
            show(&rig, session, rig.view(Motion::Orbit, f64::from(index) / 30.0), reset);
            bits(&session.color().unwrap())
        };
        let fresh = &mut rig.session(&settings);
        let expected = [9, 10, 11].map(|i| shown(fresh, i, false));
        let again = &mut rig.session(&settings);
        (0..4).for_each(|i| drop(shown(again, i, false)));
        let cut = [9, 10, 11].map(|i| shown(again, i, i == 9));
        assert!(cut == expected, "{:?}", settings.method);
        // Negative control.
        let kept = &mut rig.session(&settings);
        (6..9).for_each(|i| drop(shown(kept, i, false)));
        assert!(shown(kept, 9, false) != expected[0], "{:?}", settings.method);
    }
    rig.assert_clean();
}

/// Root mean square of the changes from frame to frame, and of the gradients: how a picture flickers and how sharp it is.
fn flicker_and_gradient(frames: &[Pixels]) -> [f64; 2] {
    let green = |p: &Pixels| p.data.iter().skip(1).step_by(4).map(|x| f64::from(*x)).collect::<Vec<f64>>();
    let frames: Vec<Vec<f64>> = frames[4..].iter().map(green).collect();
    let square = |(a, b): (&f64, &f64)| (a - b).powi(2);
    let changes: f64 = frames.windows(2).map(|w| w[0].iter().zip(&w[1]).map(square).sum::<f64>()).sum();
    let slopes: f64 = frames.iter().map(|f| f.iter().zip(&f[1..]).map(square).sum::<f64>()).sum();
    [changes.sqrt(), slopes.sqrt()]
}

/// Paper 1, section 6: integration makes frames steadier and blurs them, the more the less of a new frame it takes.
#[test]
fn integrated_frames_flicker_less_and_are_less_sharp() {
    let rig = Rig::new(load("builtin:hairball?strands=200"));
    let measured = |settings: &Settings| flicker_and_gradient(&frames(&rig, settings, Motion::Rotate, 14));
    let ti = settings(Method::StableTi);
    let pairs = [(jittered(), settings(Method::Taa)), (settings(Method::Stable), ti.clone())];
    for (alone, integrated) in pairs {
        let [before, after] = [measured(&alone), measured(&integrated)];
        println!("{:?}: {before:.2?}, {:?}: {after:.2?}", alone.method, integrated.method);
        assert!(after[0] < 0.8 * before[0] && after[1] < before[1], "{before:?} {after:?}");
    }
    let all_new = Settings { history: History { alpha: 1.0, ..ti.history }, ..ti };
    let [alone, all_new] = [measured(&settings(Method::Stable)), measured(&all_new)];
    // Negative control: an integration that takes nothing of the past changes nothing but roundings.
    assert!((0..2).all(|i| (all_new[i] / alone[i] - 1.0).abs() < 1e-5), "{alone:?} {all_new:?}");
    rig.assert_clean();
}
