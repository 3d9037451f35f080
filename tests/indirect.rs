//! Indirect light against closed forms, and over time: how it converges, follows light, and what is uncovered.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod scene_support;
mod support;

use glam::{DQuat, DVec3, Vec3};
use scene_support::{Build, Stage, ahead, look, material, mean_of, reds, render, trs};
use std::f64::consts::{FRAC_PI_2, PI};
use stillray::headless::Pixels;
use stillray::oracle::shade::brdf::Reflector;
use stillray::renderer::{FrameInputs, Method, Settings};
use stillray::scene::motion::Motion;
use stillray::scene::{EnvironmentMap, LightKind, Material, Pose, Scene, View, builtin};
use stillray::settings::{Indirect, Modelling};
use support::rig::{Rig, bits};

const SIZE: [u32; 2] = [16, 12];
/// What a half float rounds, relatively: the sample's colour is stored twice, before and after indirect light is added.
const HALF: f64 = 1.0 / 1024.0;

fn settings(method: Method, depth: u32) -> Settings {
    let indirect = Indirect { depth, ..Indirect::default() };
    Settings { size: SIZE, float_output: true, spp: 4, density: 4.0, indirect, ..Settings::of(method) }
}

fn clamped(settings: Settings, clamp: f32) -> Settings {
    Settings { indirect: Indirect { clamp, ..settings.indirect }, ..settings }
}

fn mean_red(pixels: &Pixels) -> f64 {
    reds(pixels).map(|(_, red)| red).sum::<f64>() / f64::from(pixels.width * pixels.height)
}

/// Of a channel.
fn channel(pixels: &Pixels, channel: usize) -> Vec<f64> {
    pixels.data.chunks(pixels.channels).map(|p| f64::from(p[channel])).collect()
}

fn matte(color: Vec3) -> Material {
    Material { double_sided: true, ..material(color.extend(1.0), 0.0, 1.0) }
}

fn shining(radiance: Vec3) -> Material {
    Material { emissive: radiance, ..matte(Vec3::ZERO) }
}

/// A mean over frames, with its standard deviation as the spread of eight seeds says.
fn measured(scene: &Scene, settings: &Settings, view: View, frames: u32) -> [f64; 2] {
    let run = |seed: u32| mean_red(&mean_of(scene.clone(), &Settings { seed, ..settings.clone() }, view, frames));
    let means: Vec<f64> = (0..8).map(run).collect();
    let mean = means.iter().sum::<f64>() / 8.0;
    let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / 7.0;
    [mean, (variance / 8.0).sqrt()]
}

/// Largest difference of two pictures.
fn apart(a: &Pixels, b: &Pixels) -> f64 {
    a.data.iter().zip(&b.data).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
}

fn even_map(radiance: f32) -> EnvironmentMap {
    let texels = vec![[radiance; 3]; 8];
    EnvironmentMap { name: "even".to_owned(), width: 4, height: 2, texels, scale: 1.0, turn: 0.0 }
}

/// Nothing is in the way of a path from a convex body: it brings the sky, exactly, and what a map of light from all around shows has
/// been counted before.
#[test]
fn under_an_even_sky_a_convex_body_is_as_it_was() {
    let view = View { yfov: 0.3, ..ahead() };
    let ball = |environment: f32, map: Option<EnvironmentMap>, floor: bool| {
        let mut build = Build::new(environment).ball(
            material(Vec3::new(0.8, 0.5, 0.3).extend(1.0), 0.1, 1.0),
            trs(DVec3::NEG_Z * 5.0, DQuat::IDENTITY, 1.0),
        );
        if floor {
            let flat = DQuat::from_rotation_x(-FRAC_PI_2);
            build = build.square(matte(Vec3::ZERO), trs(DVec3::new(0.0, -1.0, -5.0), flat, 50.0));
        }
        Scene { environment_map: map, ..build.camera(&view) }
    };
    for method in [Method::Stable, Method::Supersample, Method::PointTracking] {
        for (environment, map) in [(1.5, None), (0.0, Some(even_map(1.5))), (0.7, Some(even_map(1.5)))] {
            let picture =
                |depth, floor| render(ball(environment, map.clone(), floor), &settings(method, depth), view, 3);
            let before = picture(0, false);
            for depth in [1, 4] {
                let off = apart(&before, &picture(depth, false));
                println!("{}, {environment}, {}, depth {depth}: {off:.5}", method.name(), map.is_some());
                // A direction of the map counts 4 pi times its radiance of 1.5, and the ball reflects less than 0.8 / pi + 0.05 of that:
                // no sample is brighter than 6.5, and the filter's weights add up to 1.
                assert!(off < 6.5 * HALF, "{off}");
            }
            if environment > 0.0 {
                let shaded = apart(&picture(0, true), &picture(1, true));
                assert!(shaded > 0.05, "a black floor takes light away: {shaded}");
            }
        }
    }
}

/// What a ball of this colour, seen from within, scatters of even light: to a viewer that looks along its normal, on average over all
/// directions by their cosine, and by how much either may be wrong where normals are tilted by 0.13 (half of 15 degrees, as the facets
/// of the ball are).
fn albedos(color: f64) -> [f64; 4] {
    let reflector =
        Reflector { base_color: DVec3::splat(color), metallic: 0.0, roughness: 1.0, ..Reflector::default() };
    let of = |cosine: f64| {
        let c = cosine.clamp(0.0, 1.0);
        reflector.uniform_parts(DVec3::Z, DVec3::new((1.0 - c * c).sqrt(), 0.0, c)).diffuse.x
    };
    let steps = 4096;
    let cosines = (0..steps).map(|i| ((f64::from(i) + 0.5) / f64::from(steps)).sqrt());
    let mean = |f: &dyn Fn(f64) -> f64| cosines.clone().map(f).sum::<f64>() / f64::from(steps);
    let tilted = |c: f64| (of(c + 0.13) - of(c)).abs().max((of(c - 0.13) - of(c)).abs());
    [of(1.0), mean(&of), tilted(1.0), mean(&tilted)]
}

/// Inside of a ball that shines by e everywhere and scatters the part a: e (1 + a + a^2 + ... + a^depth).
#[test]
fn a_furnace_adds_up_the_series_of_its_albedo() {
    let view = View { yfov: 0.4, ..ahead() };
    for (method, color) in [(Method::Stable, 0.5_f32), (Method::Supersample, 0.9)] {
        let ball = Material { emissive: Vec3::ONE, ..matte(Vec3::splat(color)) };
        let scene = Build::new(0.0).ball(ball, trs(DVec3::ZERO, DQuat::IDENTITY, 2.0)).camera(&view);
        let [own, albedo, own_tilt, tilt] = albedos(f64::from(color));
        let sum = |depth: u32| 1.0 + own * (0..depth).map(|k| albedo.powi(k as i32)).sum::<f64>();
        for depth in 1..=4 {
            let [found, deviation] = measured(&scene, &settings(method, depth), view, 2);
            let expected = sum(depth);
            println!("{}, {color}, depth {depth}: {found:.5} +- {deviation:.5}, expected {expected:.5}", method.name());
            // By the derivatives of the sum.
            let series = |of: &dyn Fn(i32) -> f64| (0..depth as i32).map(of).sum::<f64>();
            let by_own = series(&|k| albedo.powi(k)) * own_tilt;
            let by_others = own * series(&|k| f64::from(k) * albedo.powi((k - 1).max(0))) * tilt;
            let bound = 5.0 * deviation + HALF * expected + by_own + by_others;
            assert!((found - expected).abs() < bound, "{found} {expected} {bound}");
            let sharp = (sum(depth - 1) - expected).abs().min((sum(depth + 1) - expected).abs());
            assert!(bound < sharp / 2.0, "a ray more or less is seen: {bound} {sharp}");
        }
    }
}

/// In a white room whose walls reflect all, light from all around is what it is after any number of rays.
#[test]
fn a_white_furnace_stays_white() {
    let view = View { yfov: 0.4, ..ahead() };
    for (color, depth) in [(1.0_f32, 1), (1.0, 2), (1.0, 4), (0.9, 4)] {
        let scene =
            Build::new(1.0).ball(matte(Vec3::splat(color)), trs(DVec3::ZERO, DQuat::IDENTITY, 2.0)).camera(&view);
        for method in [Method::Stable, Method::Supersample] {
            let off = render(scene.clone(), &settings(method, depth), view, 2).data;
            let most = off.chunks(4).map(|p| (f64::from(p[0]) - 1.0).abs()).fold(0.0, f64::max);
            println!("{}, {color}, depth {depth}: {most:.5}", method.name());
            assert!((most < 2.0 * HALF) == (color == 1.0), "{most}");
        }
    }
}

/// Part of a cosine-weighted hemisphere that a wall covers, from a point of the floor at a distance from it: of half width w and of
/// height h (a differential element perpendicular to a rectangle; Howell's catalogue, B-4, twice for either side).
fn covered(distance: f64, half_width: f64, height: f64) -> f64 {
    let (x, y) = (height / distance, half_width / distance);
    let far = (x * x + 1.0).sqrt();
    2.0 * (y.atan() - (y / far).atan() / far) / (2.0 * PI)
}

/// A floor beside a wall at x = 0, of 2 x 2 m, and a camera that looks straight down on it between 0.5 and 1.5 m from the wall.
fn beside(wall: Material) -> (Build, View) {
    let up = DQuat::from_rotation_x(-FRAC_PI_2);
    let build = Build::new(0.0)
        .square(matte(Vec3::ONE), trs(DVec3::new(20.0, 0.0, 0.0), up, 30.0))
        .square(wall, trs(DVec3::new(0.0, 0.0, 0.0), DQuat::from_rotation_y(FRAC_PI_2), 1.0));
    let view =
        View { position: DVec3::new(1.0, 30.0, 0.0), rotation: up, yfov: 2.0 * (0.5_f64 / 30.0).atan(), ..ahead() };
    (build, view)
}

/// What the floor scatters upwards.
fn floor_albedo() -> f64 {
    albedos(1.0)[0]
}

/// Mean radiance of the floor between two distances from the wall, as far as it is in the frame: by the midpoint rule, for a wall of
/// radiance 1. What the floor sees is bent by less than 1e-4 over a step.
fn floor_radiance(distances: [f64; 2]) -> f64 {
    let at = |x: f64, z: f64| (covered(x, 1.0 - z, 1.0) + covered(x, 1.0 + z, 1.0)) / 2.0;
    let step = |i: u32| (f64::from(i) + 0.5) / 64.0;
    let across = |i: u32| distances[0] + (distances[1] - distances[0]) * step(i);
    let sum: f64 = (0..64 * 64).map(|i| at(across(i / 64), step(i % 64) - 0.5)).sum();
    floor_albedo() * sum / 4096.0
}

#[test]
fn a_floor_beside_a_shining_wall_gets_what_it_sees_of_it() {
    let (build, view) = beside(shining(Vec3::splat(3.0)));
    let scene = build.camera(&view);
    for (method, frames) in [(Method::Stable, 64), (Method::Supersample, 32), (Method::Reference, 8)] {
        let base = Settings { size: [16, 16], jitter: true, ..settings(method, 1) };
        let last = |seed: u32| {
            let mut stage = Stage::new(scene.clone(), &Settings { seed, ..base.clone() });
            let pictures: Vec<Vec<f64>> = (0..frames).map(|_| channel(&stage.frame(view), 0)).collect();
            if method != Method::Supersample {
                return pictures[frames - 1].clone();
            }
            (0..256).map(|i| pictures.iter().map(|p| p[i]).sum::<f64>() / frames as f64).collect()
        };
        let runs: Vec<Vec<f64>> = (0..8).map(last).collect();
        for columns in [0..16_usize, 1..4, 6..9, 12..15] {
            let of = |run: &Vec<f64>| {
                let all = (0..16).flat_map(|y| columns.clone().map(move |x| 16 * y + x));
                all.map(|i| run[i]).sum::<f64>() / (16 * columns.len()) as f64
            };
            let means: Vec<f64> = runs.iter().map(of).collect();
            let mean = means.iter().sum::<f64>() / 8.0;
            let deviation = (means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / 56.0).sqrt();
            let distance = |x: usize| 0.5 + x as f64 / 16.0;
            let expected = 3.0 * floor_radiance([distance(columns.start), distance(columns.end)]);
            println!("{}, {columns:?}: {mean:.5} +- {deviation:.5}, expected {expected:.5}", method.name());
            // The filter brings in what is up to 1.5 pixels, 0.1 m, beside: of a slope that changes by half over that, a hundredth.
            assert!((mean - expected).abs() < 5.0 * deviation + 0.01 * expected, "{mean} {expected}");
            assert!(deviation < 0.025 * expected, "the test is sharp enough: {deviation}");
        }
    }
    let without = mean_red(&render(scene, &settings(Method::Stable, 0), view, 2));
    assert_eq!(without, 0.0, "the light is the paths'");
}

/// Light that a wall beside the floor scatters, from a directional light that shines along the floor; whether onto the wall's front.
fn lit(pose: &Pose, front: bool) -> Pose {
    let mut pose = pose.clone();
    pose.lights[0].direction = if front { DVec3::NEG_X } else { DVec3::X };
    pose
}

fn lit_wall() -> (Scene, View) {
    let (build, view) = beside(matte(Vec3::ONE));
    let scene = build.light(LightKind::Directional, DVec3::ZERO, DVec3::NEG_X, 3.0).camera(&view);
    (scene, view)
}

fn shoot(stage: &mut Stage, view: View, pose: &Pose) -> Pixels {
    stage.session.frame(&FrameInputs { view, pose, reset: false }).unwrap();
    stage.session.color().unwrap()
}

/// After a light has gone, (1 - alpha)^n of what it gave is left in frame n, in each pixel; when that is less than 2^-11, which a half
/// float cannot tell, means are those of all paths again.
#[test]
fn light_that_goes_fades_exponentially() {
    let (scene, view) = lit_wall();
    let pose = scene.pose(0.0);
    for alpha in [0.1_f32, 0.3, 1.0] {
        let base = settings(Method::Stable, 1);
        let mut stage = Stage::new(scene.clone(), &Settings { indirect: Indirect { alpha, ..base.indirect }, ..base });
        let mut before = shoot(&mut stage, view, &lit(&pose, true));
        for _ in 0..40 {
            before = shoot(&mut stage, view, &lit(&pose, true));
        }
        assert!(mean_red(&before) > 0.05);
        for n in 1..=30 {
            let now = shoot(&mut stage, view, &lit(&pose, false));
            let left = (1.0 - f64::from(alpha)).powi(n);
            let equal = 40.0 / (40.0 + f64::from(n));
            let apart = |expected: f64| {
                let off = before
                    .data
                    .chunks(4)
                    .zip(now.data.chunks(4))
                    .map(|(b, n)| (f64::from(n[0]) - f64::from(b[0]) * expected).abs() / f64::from(b[0]));
                off.fold(0.0, f64::max)
            };
            // Two roundings to halves, n in the mean; denormal halves, from 2^-14 down, have steps of 2^-24.
            let bound = 2.0 * HALF * left + 2f64.powi(-22) / mean_red(&before);
            if left < 2f64.powi(-11) * (1.0 - f64::from(alpha)) {
                assert!(apart(0.0) < 2f64.powi(-11) + bound, "forgotten: {}", apart(0.0));
                continue;
            }
            assert!(apart(left) <= bound, "alpha {alpha}, frame {n}: {} {bound}", apart(left));
            assert!(apart(equal) > bound, "a mean of all would be told apart");
        }
    }
}

/// A light that comes up: 1 - (1 - alpha)^n of what it gives, in the mean over the picture.
#[test]
fn light_that_comes_rises_exponentially() {
    let (scene, view) = lit_wall();
    let pose = scene.pose(0.0);
    let base = Settings { size: [32, 32], ..settings(Method::Stable, 1) };
    let run = |seed: u32, frames: &[u32]| -> Vec<f64> {
        let mut stage = Stage::new(scene.clone(), &Settings { seed, ..base.clone() });
        (0..40).for_each(|_| drop(shoot(&mut stage, view, &lit(&pose, false))));
        let last = *frames.last().unwrap();
        let means: Vec<f64> = (0..last).map(|_| mean_red(&shoot(&mut stage, view, &lit(&pose, true)))).collect();
        frames.iter().map(|n| means[*n as usize - 1]).collect()
    };
    let frames = [1, 2, 4, 8, 16, 32, 64];
    let runs: Vec<Vec<f64>> = (0..8).map(|seed| run(seed, &frames)).collect();
    let steady = measured(&scene, &Settings { size: [32, 32], ..settings(Method::Reference, 1) }, view, 16);
    for (i, n) in frames.iter().enumerate() {
        let mean = runs.iter().map(|r| r[i]).sum::<f64>() / 8.0;
        let deviation = (runs.iter().map(|r| (r[i] - mean).powi(2)).sum::<f64>() / 56.0).sqrt();
        let expected = steady[0] * (1.0 - 0.9_f64.powi(*n as i32));
        println!("frame {n}: {mean:.5} +- {deviation:.5}, expected {expected:.5}");
        assert!(
            (mean - expected).abs() < 5.0 * deviation.hypot(steady[1]) + 2.0 * HALF * expected,
            "{mean} {expected}"
        );
        let faster = steady[0] * (1.0 - 0.85_f64.powi(*n as i32));
        let told = (mean - faster).abs() > 5.0 * deviation.hypot(steady[1]) + 2.0 * HALF * expected;
        assert!(told || *n > 16, "another alpha is told apart");
    }
}

/// A light that turns by a degree a frame: the mean of what each frame's light gives, (1 - alpha)^k of it alpha times k frames ago. In
/// the mean over a picture, relative to the light before it turned. What the wall's diffuse layer scatters is a product of what
/// depends on the light and what depends on the viewer; its lobe, 0.03 of the light, is not, and changes by half over 60 degrees.
#[test]
fn a_light_that_moves_is_followed_with_its_lag() {
    let (scene, view) = lit_wall();
    let pose = scene.pose(0.0);
    let base = Settings { size: [32, 32], ..settings(Method::Stable, 1) };
    let run = |seed: u32| {
        let mut stage = Stage::new(scene.clone(), &Settings { seed, ..base.clone() });
        let mut at = |degrees: u32| {
            let angle = f64::from(degrees).to_radians();
            let mut pose = pose.clone();
            pose.lights[0].direction = DVec3::new(-angle.cos(), 0.0, -angle.sin());
            mean_red(&shoot(&mut stage, view, &pose))
        };
        let before = (0..60).map(|_| at(0)).last().unwrap();
        (1..=60).map(|degrees| at(degrees) / before).collect::<Vec<f64>>()
    };
    let runs: Vec<Vec<f64>> = (0..4).map(run).collect();
    let reflector = Reflector { roughness: 1.0, ..Reflector::default() };
    let given = |degrees: i32| {
        let angle = f64::from(degrees.max(0)).to_radians();
        reflector.reflect_parts(DVec3::Z, DVec3::Z, DVec3::new(angle.sin(), 0.0, angle.cos())).diffuse.x
    };
    for degrees in [10, 20, 30, 45, 60] {
        let mean = runs.iter().map(|r| r[degrees as usize - 1]).sum::<f64>() / 4.0;
        let lagging = (0..200).map(|k| 0.1 * 0.9_f64.powi(k) * given(degrees - k)).sum::<f64>() / given(0);
        println!("{degrees} degrees: {mean:.4}, expected {lagging:.4}, at once {:.4}", given(degrees) / given(0));
        // 19 paths a sample, of which one in ten finds the wall: 3 / sqrt(19 * 4 * 4 * 1024), and the same for the light before.
        let bound = (0.015 + 5.0 * 0.0076) * lagging;
        assert!((mean - lagging).abs() < bound, "{mean} {lagging}");
        assert!(degrees < 45 || (given(degrees) / given(0) - lagging).abs() > 2.0 * bound, "the lag is seen");
    }
}

/// The error of a mean falls as 1 / sqrt(n) or faster while nothing moves: half as many paths again are as good as independent ones at
/// least, and a scrambled sequence at best makes it n^-1.5. Against a mean of 2048, whose error adds to the differences.
#[test]
fn still_means_converge_and_moving_ones_level_off() {
    let scene = builtin::load("cornell", 0).unwrap();
    let view = scene.pose(0.0).cameras[0];
    let base = Settings {
        size: [32, 32],
        indirect: Indirect { depth: 1, ..Indirect::default() },
        density: 1.0,
        ..settings(Method::Stable, 1)
    };
    let at = [8_u32, 32, 128, 512];
    let run = |moving: bool| -> (Vec<Pixels>, Pixels) {
        // Something that moves far below.
        let mut other = scene.clone();
        other.nodes.push(stillray::scene::Node {
            name: String::new(),
            parent: None,
            local: trs(DVec3::NEG_Y * 1000.0, DQuat::IDENTITY, 1.0),
        });
        other.instances.push(stillray::scene::Instance { node: other.nodes.len() - 1, mesh: scene.instances[0].mesh });
        let pose = other.pose(0.0);
        let mut stage = Stage::new(other, &base);
        let mut frame = |n: u32| {
            let mut now = pose.clone();
            let last = now.instances.len() - 1;
            now.instances[last].translation.x += if moving { f64::from(n % 7) } else { 0.0 };
            shoot(&mut stage, view, &now)
        };
        let mut seen = Vec::new();
        for n in 1..=2048 {
            let picture = frame(n);
            if at.contains(&n) {
                seen.push(picture);
            } else if n == 2048 {
                return (seen, picture);
            }
        }
        unreachable!()
    };
    let (still, reference) = run(false);
    let (moving, _) = run(true);
    let errors = |pictures: &[Pixels]| -> Vec<f64> {
        let error = |p: &Pixels| {
            let square = p.data.iter().zip(&reference.data).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
            (square / p.data.len() as f64).sqrt()
        };
        pictures.iter().map(error).collect()
    };
    let (still, moving) = (errors(&still), errors(&moving));
    println!("frames {at:?}: RMSE still {still:.5?}, moving {moving:.5?}");
    // Slope by least squares over four points that are log 4 apart.
    let slope = |e: &[f64]| {
        let log = |i: usize| e[i].ln();
        (3.0 * (log(3) - log(0)) + (log(2) - log(1))) / (10.0 * 4_f64.ln())
    };
    // 3072 values with the spread of a few paths each: kurtosis 10 or so, an error of the RMSE of sqrt(10 / 3072) / 2, 3 %; of the slope
    // sqrt(20) times that over 10 log 4. What 2048 paths err on adds at 512 a quarter to the squares if they were independent, and
    // takes it off if they are the same.
    let doubt = 5.0 * 20_f64.sqrt() * 0.03 / (10.0 * 4_f64.ln()) + 3.0 * (1.25_f64.ln() / 2.0) / (10.0 * 4_f64.ln());
    println!("slopes {:.3} and {:.3}, +- {doubt:.3}", slope(&still), slope(&moving));
    assert!(slope(&still) < -0.5 + doubt && slope(&still) > -1.5 - doubt, "{}", slope(&still));
    // Control: the exponential mean's error stays what it is from 32 on, that of 19 paths.
    assert!(moving[3] > 0.8 * moving[1], "{moving:?}");
    assert!(moving[3] > 3.0 * still[3], "{moving:?} {still:?}");
}

/// What is uncovered begins anew: nothing of what hid it, nor of what it was itself, is left.
#[test]
fn what_is_uncovered_begins_anew() {
    let up = DQuat::from_rotation_x(-FRAC_PI_2);
    let (build, view) = beside(shining(Vec3::new(2.0, 0.0, 0.0)));
    // A panel that shines green, over the left half of what is seen, and close enough to the floor to light it around.
    let panel = Material { emissive: Vec3::new(0.0, 5.0, 0.0), ..matte(Vec3::ZERO) };
    let scene = build.square(panel, trs(DVec3::new(0.0, 0.3, 0.0), up, 1.0)).camera(&view);
    let pose = scene.pose(0.0);
    let mut away = pose.clone();
    let last = away.instances.len() - 1;
    away.instances[last].translation.y = -1e4;
    let base = Settings { size: [32, 32], ..settings(Method::Stable, 1) };
    let mut stage = Stage::new(scene, &base);
    let covered = (0..20).map(|_| shoot(&mut stage, view, &pose)).last().unwrap();
    let uncovered: Vec<Pixels> = (0..100).map(|_| shoot(&mut stage, view, &away)).collect();
    // Pixels deep within what was covered, and within what was not: the filter reaches over one and a half.
    let of = |p: &Pixels, c: usize, columns: std::ops::Range<usize>| -> Vec<f64> {
        let all = channel(p, c);
        (0..32).flat_map(|y| columns.clone().map(move |x| 32 * y + x)).map(|i| all[i]).collect()
    };
    let (hidden, open) = (0..13, 19..32);
    assert!(of(&covered, 1, hidden.clone()).iter().all(|g| *g > 4.0), "it was covered");
    let most = |v: Vec<f64>| v.into_iter().fold(0.0, f64::max);
    assert_eq!(most(of(&uncovered[0], 1, hidden.clone())), 0.0, "no ghost");
    // Control: where the floor was seen before, the panel's light fades.
    let fading = most(of(&uncovered[0], 1, open.clone()));
    println!("green left: {fading:.4} where the floor was seen before, 0 where it was not");
    assert!(fading > 0.01 && most(of(&uncovered[99], 1, open.clone())) < 2e-3 * fading);
    // One path a sample at first, the exponential mean's noise after: red against the mean over the columns' heights.
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let noise = |p: &Pixels, columns: &std::ops::Range<usize>| {
        let spread = columns.clone().map(|x| {
            let column = of(p, 0, x..x + 1);
            let m = mean(&column);
            column.iter().map(|v| (v - m).powi(2)).sum::<f64>() / (31.0 * m * m)
        });
        (spread.sum::<f64>() / columns.len() as f64).sqrt()
    };
    let noises: Vec<f64> = [0, 3, 15, 60].iter().map(|n| noise(&uncovered[*n], &hidden)).collect();
    println!("relative noise 1, 4, 16 and 61 frames after: {noises:.3?}");
    // At least as fast as independent paths, four to one; 13 x 32 pixels tell their spread to 3.5 %, and a half more for their tails.
    assert!(noises[1] < 0.5 * 1.3 * noises[0] && noises[2] < noises[1], "{noises:?}");
    let brightness = |p: &Pixels| mean(&of(p, 0, hidden.clone()));
    let (first, later) = (brightness(&uncovered[0]), brightness(&uncovered[99]));
    let bound = 5.0 * noises[0] / (13.0_f64 * 32.0).sqrt();
    assert!((first / later - 1.0).abs() < bound, "it is as bright at once as it stays: {first} {later}");
}

/// A path that finds a wall of radiance e brings e, or the limit: what the floor loses is 1 - limit / e exactly, on the same paths.
#[test]
fn a_limit_takes_what_it_says() {
    let (build, view) = beside(shining(Vec3::new(8.0, 4.0, 0.0)));
    let scene = build.camera(&view);
    let open = render(scene.clone(), &settings(Method::Stable, 1), view, 16);
    for (limit, left) in [(16.0_f32, 1.0), (8.0, 1.0), (2.0, 0.25), (0.01, 0.00125)] {
        let cut = render(scene.clone(), &clamped(settings(Method::Stable, 1), limit), view, 16);
        for c in 0..2 {
            for (a, b) in channel(&open, c).into_iter().zip(channel(&cut, c)) {
                // Halves, and their denormals.
                assert!((b - a * left).abs() <= 2.0 * HALF * a * left + 2f64.powi(-23), "{limit}: {a} {b}");
            }
        }
        assert!(mean_red(&open) > 0.5, "there is something to lose");
    }
}

/// Glass above a white floor under an even map: shadow rays pass straight through it, and paths bring the map by way of a reflection
/// only. With both counted the floor would be twice as bright; what glass reflects back, 0.09 of even light, is counted and not
/// taken from the shadow rays.
#[test]
fn a_map_is_counted_once_behind_glass() {
    let up = DQuat::from_rotation_x(-FRAC_PI_2);
    let view = View { position: DVec3::new(0.0, 1.0, 0.0), rotation: up, yfov: 0.5, ..ahead() };
    let clear = material(Vec3::ONE.extend(1.0), 0.0, 0.0);
    let pane = Material { transmission: 1.0, ior: 1.5, double_sided: true, ..clear };
    let build = Build::new(0.0)
        .square(matte(Vec3::ONE), trs(DVec3::ZERO, up, 100.0))
        .square(pane, trs(DVec3::Y * 2.0, up, 100.0));
    let scene = Scene { environment_map: Some(even_map(1.0)), ..build.camera(&view) };
    let direct = measured(&scene, &settings(Method::Supersample, 0), view, 4);
    for depth in [1, 2, 4] {
        let [found, deviation] = measured(&scene, &settings(Method::Supersample, depth), view, 4);
        println!("depth {depth}: {found:.4} +- {deviation:.4}, direct {direct:?}");
        let slack = 5.0 * deviation.hypot(direct[1]) + HALF;
        assert!(found > direct[0] - slack && found < direct[0] * 1.12 + slack, "{found} {direct:?}");
        assert!(slack < 0.2, "twice would be seen");
    }
}

#[test]
fn without_indirect_light_nothing_of_it_is_there() {
    let scene = builtin::load("cornell", 0).unwrap();
    let view = scene.pose(0.0).cameras[0];
    for method in [Method::Stable, Method::Supersample] {
        let off = settings(method, 0);
        let picture = |settings: &Settings| render(scene.clone(), settings, view, 3).data;
        let other = Settings { indirect: Indirect { depth: 0, alpha: 0.5, clamp: 1.0 }, ..off.clone() };
        assert!(picture(&off) == picture(&other), "its knobs do nothing");
        assert!(picture(&off) != picture(&settings(method, 1)), "it would be seen");
        let labels = |settings: &Settings| -> Vec<&str> {
            let stage = Stage::new(scene.clone(), settings);
            stage.session.renderer().plan().passes.iter().map(|p| p.label).collect()
        };
        let named = |labels: &[&str]| labels.iter().filter(|l| ["indirect", "accumulate"].contains(l)).count();
        assert_eq!(named(&labels(&off)), 0);
        assert!(named(&labels(&settings(method, 1))) > 4);
        let depth = settings(method, 2);
        let all = Settings { modelling: Modelling::All, ..depth.clone() };
        assert!(picture(&depth) == picture(&all), "what else is modelled changes nothing");
        let all = Settings { modelling: Modelling::All, ..off.clone() };
        assert!(picture(&off) == picture(&all), "without it neither");
    }
}

/// At the ends of all ranges there are numbers.
#[test]
fn the_ends_of_all_ranges_are_finite() {
    let view = View { yfov: 0.8, ..look(DVec3::new(2.0, 2.0, 5.0), DVec3::ZERO, 0.8) };
    let up = DQuat::from_rotation_x(-FRAC_PI_2);
    for strength in [1e-30_f32, 1.0, 1e30, f32::MAX] {
        for (alpha, clamp, depth) in [(0.01, 0.0, 4), (1.0, 1e6, 1), (0.1, 0.5, 2)] {
            let shine = shining(Vec3::splat(strength));
            let glass = Material {
                transmission: 0.5,
                ior: 1.5,
                double_sided: true,
                ..material(Vec3::ONE.extend(1.0), 0.0, 0.2)
            };
            let build = Build::new(strength)
                .square(matte(Vec3::ONE), trs(DVec3::ZERO, up, 4.0))
                .square(shine, trs(DVec3::NEG_X * 2.0, DQuat::from_rotation_y(FRAC_PI_2), 1.0))
                .ball(glass, trs(DVec3::Y, DQuat::IDENTITY, 1.0))
                .light(LightKind::Point, DVec3::Y * 4.0, DVec3::NEG_Y, strength);
            let scene = Scene { environment_map: Some(even_map(strength.min(1e30))), ..build.camera(&view) };
            for method in [Method::Stable, Method::Supersample] {
                let base = settings(method, depth);
                let ends = Settings { indirect: Indirect { depth, alpha, clamp }, ..base };
                let pixels = render(scene.clone(), &ends, view, 3);
                assert!(pixels.data.iter().all(|x| x.is_finite() && *x >= 0.0), "{strength} {alpha} {clamp} {depth}");
            }
        }
    }
}

/// Every method under a moving camera: the same bits run after run, and no message of the validation layer.
#[test]
fn frames_are_the_same_run_after_run() {
    let rig = Rig::new(builtin::load("cornell", 0).unwrap());
    for method in Method::ALL.iter().copied() {
        let base = Settings { size: [40, 30], ..settings(method, 2) };
        let run = |seed: u32| -> Vec<Vec<u32>> {
            let mut session = rig.session(&Settings { seed, ..base.clone() });
            let frame = |i: u32| {
                let stats = rig.frame(&mut session, Motion::Orbit, i / 2);
                assert!(stats.indirect_rays > 0, "{}", method.name());
                bits(&session.color().unwrap())
            };
            (0..6).map(frame).collect()
        };
        let first = run(1);
        assert!(first == run(1), "{}", method.name());
        assert!(first != run(2), "{}: another seed is seen", method.name());
    }
    // With all that a scene may require, too.
    let all = Settings { size: [40, 30], modelling: Modelling::All, ..settings(Method::StableTi, 2) };
    let mut session = rig.session(&all);
    for i in 0..4 {
        rig.frame(&mut session, Motion::Orbit, i);
    }
    rig.assert_clean();
}
