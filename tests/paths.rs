//! What is seen in reflections and through what transmits, against closed forms.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod scene_support;

use glam::{DQuat, DVec3, Vec3};
use scene_support::{Build, ahead, material, mean_of, reds, trs};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use stillray::headless::Pixels;
use stillray::oracle::shade::brdf::Reflector;
use stillray::oracle::shade::lobe::{Scatterer, scatter};
use stillray::renderer::{Method, Settings};
use stillray::scene::{EnvironmentMap, LocalTransform, Material, Scene, View};
use stillray::settings::{Hold, Modelling};

const SIZE: [u32; 2] = [16, 12];

fn settings(method: Method) -> Settings {
    let base = Settings { size: SIZE, float_output: true, hold: Hold::Frame, ..Settings::of(method) };
    Settings { spp: 16, density: 16.0, jitter: true, ..base }
}

fn mean_red(pixels: &Pixels) -> f64 {
    reds(pixels).map(|(_, red)| red).sum::<f64>() / f64::from(pixels.width * pixels.height)
}

/// What shines evenly, and nothing else.
fn shining(radiance: f32) -> Material {
    Material { emissive: Vec3::splat(radiance), ..material(Vec3::ZERO.extend(1.0), 1.0, 1.0) }
}

fn glass(ior: f32, absorption: f32) -> Material {
    let clear = material(Vec3::ONE.extend(1.0), 0.0, 0.0);
    Material { ior, transmission: 1.0, volume: Some(Vec3::splat(absorption)), double_sided: true, ..clear }
}

/// Of a view through a narrow angle, in which all rays are as good as parallel.
fn narrow() -> View {
    View { yfov: 0.01, ..ahead() }
}

/// A slab of this thickness across the view, tilted about y, whose faces look away from it.
fn slab(build: Build, glass: &Material, thickness: f64, tilt: f64, distance: f64) -> Build {
    let turn = DQuat::from_rotation_y(tilt);
    let middle = DVec3::NEG_Z * distance;
    let face = |side: f64| {
        let away = if side < 0.0 { turn * DQuat::from_rotation_y(PI) } else { turn };
        trs(middle + turn * DVec3::Z * (side * thickness / 2.0), away, 20.0)
    };
    build.square(glass.clone(), face(1.0)).square(glass.clone(), face(-1.0))
}

/// A frame's mean over many passes, with its standard deviation as the spread of eight such means says.
fn measured(scene: &Scene, settings: &Settings, view: View, frames: u32) -> [f64; 2] {
    let run = |seed: u32| mean_red(&mean_of(scene.clone(), &Settings { seed, ..settings.clone() }, view, frames));
    let means: Vec<f64> = (0..8).map(run).collect();
    let mean = means.iter().sum::<f64>() / 8.0;
    let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / 7.0;
    [mean, (variance / 8.0).sqrt()]
}

/// Whether a mean is what it should be: within five standard deviations, which were estimated from eight means (so that five is the
/// 99.8th percentile of Student's t), and what the half floats of a shaded sample round.
fn agrees([found, deviation]: [f64; 2], expected: f64) -> bool {
    (found - expected).abs() < 5.0 * deviation + expected / 2048.0
}

#[test]
fn a_slab_absorbs_by_beers_law() {
    let shine = 2.0;
    for (absorption, thickness) in [(0.5, 1.0), (3.0, 0.25), (0.0, 2.0)] {
        let scene = |absorption: f32| {
            let wall = Build::new(0.0).square(shining(shine), trs(DVec3::NEG_Z * 9.0, DQuat::IDENTITY, 50.0));
            slab(wall, &glass(1.0, absorption), thickness, 0.0, 4.0).camera(&narrow())
        };
        let expected = f64::from(shine) * (-f64::from(absorption) * thickness).exp();
        for method in [Method::Supersample, Method::Stable] {
            let found = measured(&scene(absorption), &settings(method), narrow(), 4);
            println!("{}, {absorption} over {thickness}: {found:?}, expected {expected}", method.name());
            assert!(agrees(found, expected), "{found:?} {expected}");
            assert!(found[1] < 0.02 * expected, "the test is sharp enough");
        }
        let other = measured(&scene(absorption + 0.2), &settings(Method::Supersample), narrow(), 4);
        assert!(!agrees(other, expected), "a fifth more is seen: {other:?} {expected}");
    }
}

/// At normal incidence glass reflects r = ((n - 1) / (n + 1))^2 at each face. With k crossings of the slab, k odd, its faces pass
/// (1 - r)^2 r^(k - 1) a^k; with eight rays up to k = 7.
#[test]
fn a_slab_passes_what_fresnel_leaves() {
    let wall = || Build::new(0.0).square(shining(1.0), trs(DVec3::NEG_Z * 9.0, DQuat::IDENTITY, 50.0));
    for (ior, absorption) in [(1.5, 0.0), (2.4, 0.0), (2.4, 0.6)] {
        let r = ((f64::from(ior) - 1.0) / (f64::from(ior) + 1.0)).powi(2);
        let a = (-f64::from(absorption) * 0.5).exp();
        let expected: f64 = [1, 3, 5, 7].iter().map(|k| (1.0 - r).powi(2) * r.powi(k - 1) * a.powi(*k)).sum();
        let scene = slab(wall(), &glass(ior, absorption), 0.5, 0.0, 4.0).camera(&narrow());
        for part in [0.0, 0.25, 0.5] {
            let deep = Settings { path_depth: 8, path_part: part, ..settings(Method::Supersample) };
            let found = measured(&scene, &deep, narrow(), 8);
            println!("index {ior}, {absorption}/m, {part} reflected: {found:?}, expected {expected}");
            assert!(agrees(found, expected), "{found:?} {expected}");
        }
        let shallow = measured(&scene, &Settings { path_depth: 3, ..settings(Method::Supersample) }, narrow(), 8);
        if r > 0.1 {
            assert!(!agrees(shallow, expected), "what goes back and forth is seen: {shallow:?} {expected}");
        }
    }
}

/// A black plate of glass in front of a wall that shines: Schlick's approximation at each angle, 0.04 at normal incidence and
/// nearly everything at a grazing one.
#[test]
fn a_plate_reflects_what_fresnel_says() {
    let shine = 3.0;
    for degrees in [0.0_f64, 45.0, 70.0, 85.0, 89.0] {
        let angle = degrees.to_radians();
        let normal = DQuat::from_rotation_y(angle) * DVec3::Z;
        let turned = |q: DQuat| trs(DVec3::NEG_Z * 5.0, q, 1.0);
        let mirrored = 2.0 * normal.z * normal - DVec3::Z;
        let wall = trs(DVec3::NEG_Z * 5.0 + mirrored * 30.0, DQuat::from_rotation_arc(DVec3::Z, -mirrored), 8.0);
        let plate = material(Vec3::ZERO.extend(1.0), 0.0, 0.0);
        let view = View { yfov: 1e-4, ..ahead() };
        let scene = Build::new(0.0)
            .square(plate, turned(DQuat::from_rotation_y(angle)))
            .square(Material { double_sided: true, ..shining(shine) }, wall)
            .camera(&view);
        let expected = f64::from(shine) * (0.04 + 0.96 * (1.0 - angle.cos()).powi(5));
        let glossy = Settings { gloss: 0.01, ..settings(Method::Supersample) };
        // At normal incidence the camera would be in the way of nothing: it has no body.
        let found = mean_red(&mean_of(scene.clone(), &glossy, view, 1));
        println!("{degrees} degrees: {found:.5}, expected {expected:.5}");
        // A half has 11 bits; the view's angle differs by 1e-4, and Fresnel's slope is at most 5.
        let bound = expected / 2048.0 + f64::from(shine) * 5.0 * 1e-4;
        assert!((found - expected).abs() < bound, "{found} {expected}");
        let without = mean_red(&mean_of(scene, &settings(Method::Supersample), view, 1));
        assert_eq!(without, 0.0, "the reflection is the ray's");
    }
}

/// A wall that shines to the left of the view's axis, behind a tilted slab: its edge is seen at d sin(a) (1 - cos(a) / (n cos(b)))
/// beside where it is, with sin(a) = n sin(b) (Snell).
#[test]
fn a_tilted_slab_shifts_what_is_behind_it() {
    let (thickness, tilt, distance) = (0.5_f64, 0.7_f64, 10.0);
    let view = View { yfov: 2.0 * 0.05_f64.atan(), ..ahead() };
    // The frame is a metre wide where the wall is: 64 pixels of 1/64 m.
    let strip = Settings { size: [64, 64], ..settings(Method::Supersample) };
    for (ior, seen) in [(1.5_f64, true), (1.0, false)] {
        let half = trs(DVec3::new(-50.0, 0.0, -distance), DQuat::IDENTITY, 50.0);
        let wall = Build::new(0.0).square(shining(1.0), half);
        let scene = slab(wall, &glass(ior as f32, 0.0), thickness, tilt, 5.0).camera(&view);
        let behind = (tilt.sin() / ior).asin();
        let shift = thickness * tilt.sin() * (1.0 - tilt.cos() / (ior * behind.cos()));
        let frames = 16;
        let pixels = mean_of(scene, &Settings { path_depth: 3, ..strip.clone() }, view, frames);
        // The edge from the part of the light that is seen of what passes beside the axis: columns in the middle, over the mean of
        // those that see the whole of it.
        let column = |x: u32| reds(&pixels).filter(|(p, _)| p[0] == x).map(|(_, red)| red).sum::<f64>() / 64.0;
        let columns: Vec<f64> = (0..64).map(column).collect();
        let full = columns[2..12].iter().sum::<f64>() / 10.0;
        let edge = columns.iter().sum::<f64>() / full / 64.0 - 0.5;
        // In a slab whose normal is turned to +x rays bend to -x: what is behind is seen shifted to +x.
        let expected = if seen { shift } else { 0.0 };
        println!("index {ior}: edge at {edge:.4} m, expected {expected:.4} m");
        // Three quarters of three quarters of the 64 x 64 x 256 paths pass, and count 16/9: a relative deviation of 0.88 / 1024 in the sum,
        // which is half a metre, and of 0.88 / 405 in `full`, which the ten columns have; five of each. Away from the axis, where the edge
        // is not, rays are up to 0.05 from parallel.
        assert!((edge - expected).abs() < 0.012, "{edge} {expected}");
        assert!(!seen || shift > 0.05, "the shift is far more than the bound: {shift}");
    }
}

/// Nothing reflects more than it gets, in uniform light, and what is lost is known: what the gain holds back for the fit of the
/// albedo, twice 0.018 of the albedo, which is 0.307 at least for the roughest metal, and rays that leave below the surface's horizon.
#[test]
fn a_furnace_with_rays_gains_nothing() {
    let view = View { yfov: 0.1, ..ahead() };
    let ball = |m: Material| {
        let at = trs(DVec3::NEG_Z * 5.0, DQuat::IDENTITY, 1.0);
        Build::new(1.0).ball(m, at).camera(&view)
    };
    let white = Vec3::ONE.extend(1.0);
    let phong = |exponent| Material { exponent, ..material(white, 0.0, 0.0) };
    let cases = [
        ("glass", glass(1.5, 0.0), 0.0),
        ("thin glass", Material { volume: None, ..glass(1.5, 0.0) }, 0.0),
        ("mirror", material(white, 1.0, 0.0), 0.0),
        ("metal 0.3", material(white, 1.0, 0.3), 0.036 / 0.95),
        ("metal 1", material(white, 1.0, 1.0), 0.036 / 0.307),
        ("plastic 0.5", material(white, 0.0, 0.5), 0.036),
        ("phong 10^6", phong(1e6), 0.0),
    ];
    for (name, m, loss) in cases {
        let glossy = Settings { gloss: 1.0, ..settings(Method::Supersample) };
        let [found, deviation] = measured(&ball(m), &glossy, view, 2);
        println!("{name}: {found:.4} +- {deviation:.4}, loss {:+.4}", 1.0 - found);
        // A half has 11 bits.
        let slack = 5.0 * deviation + 1.0 / 2048.0;
        assert!(found < 1.0 + slack && found > 1.0 - loss - slack, "{name}: {found} {deviation}");
    }
    let grey = material(Vec3::splat(0.9).extend(1.0), 1.0, 0.3);
    let [found, _] = measured(&ball(grey), &Settings { gloss: 1.0, ..settings(Method::Supersample) }, view, 1);
    assert!(found < 0.95, "a grey ball is seen: {found}");
}

/// What the draws of a lobe bring on average of a sky that is white on one side, in f64.
fn drawn(s: &Scatterer, view: DVec3, of: impl Fn(DVec3) -> f64) -> f64 {
    const SIDE: u32 = 512;
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(SIDE);
    let bring = |i: u32| scatter(s, [DVec3::Y; 2], view, [at(i % SIDE), at(i / SIDE)], 0.5);
    let sum: f64 = (0..SIDE * SIDE).filter_map(bring).map(|b| b.weight.x * of(b.direction)).sum();
    sum / f64::from(SIDE * SIDE)
}

/// The same by the reflection of light, integrated over all directions.
fn integrated(of: impl Fn(DVec3) -> f64) -> f64 {
    const SIDE: u32 = 1024;
    let direction = |i: u32| {
        let y = (f64::from(i / (2 * SIDE)) + 0.5) / f64::from(SIDE);
        let longitude = TAU * (f64::from(i % (2 * SIDE)) + 0.5) / f64::from(2 * SIDE);
        let r = (1.0 - y * y).sqrt();
        DVec3::new(r * longitude.cos(), y, r * longitude.sin())
    };
    let sum: f64 = (0..2 * SIDE * SIDE).map(direction).map(of).sum();
    sum * TAU / f64::from(2 * SIDE * SIDE)
}

/// Rays and light see the same lobe: what is drawn brings on average what the reflection of light gives, of the whole sky and of parts
/// of it. Both are sums over a grid; an edge across it is off by one in its 512 lines, and less the smoother the lobe.
#[test]
fn draws_of_a_lobe_follow_its_reflection_of_light() {
    for (roughness, metallic, slope) in [(0.3, 1.0, 0.2_f64), (0.6, 1.0, 0.9), (1.0, 1.0, 1.3), (0.5, 0.0, 0.6)] {
        let reflector = Reflector { base_color: DVec3::splat(0.7), metallic, roughness, ..Reflector::default() };
        let s = Scatterer { reflector, exponent: 0.0, index: 0.0, part: 0.25 };
        let view = DVec3::new(slope.sin(), slope.cos(), 0.0);
        let parts: [fn(DVec3) -> f64; 3] = [|_| 1.0, |d| f64::from(u8::from(d.x > -0.3)), |d| (5.0 * d.z).sin() + 1.0];
        for (i, part) in parts.into_iter().enumerate() {
            let found = drawn(&s, view, part);
            let f0 = reflector.specular_color();
            let gain = stillray::oracle::shade::lobe::lobe_gain(f0, view.y, roughness).x;
            let expected = gain * integrated(|l| reflector.reflect_parts(DVec3::Y, view, l).specular.x * part(l));
            println!("roughness {roughness}, metallic {metallic}, part {i}: {found:.5} {expected:.5}");
            assert!((found - expected).abs() < 0.006 * expected, "{found} {expected}");
        }
        let blunt = Scatterer { reflector: Reflector { roughness: roughness * 0.9, ..reflector }, ..s };
        let found = drawn(&blunt, view, parts[1]);
        let expected = drawn(&s, view, parts[1]);
        assert!(
            (found - expected).abs() > 0.006 * expected || roughness < 0.4,
            "the comparison can fail: {found} {expected}"
        );
    }
}

/// Glass in glass of the same index is not there: the stack of what a ray is inside of.
#[test]
fn a_ball_of_the_glass_around_it_is_invisible() {
    let view = View { yfov: 0.05, ..ahead() };
    let wall = || Build::new(0.0).square(shining(1.0), trs(DVec3::NEG_Z * 9.0, DQuat::IDENTITY, 50.0));
    let inside = |ior: f32, absorption: f32| {
        let at: LocalTransform = trs(DVec3::NEG_Z * 4.0, DQuat::IDENTITY, 0.5);
        slab(wall().ball(glass(ior, absorption), at), &glass(1.4, 0.3), 2.0, 0.0, 4.0).camera(&view)
    };
    let alone = slab(wall(), &glass(1.4, 0.3), 2.0, 0.0, 4.0).camera(&view);
    let deep = Settings { path_depth: 8, ..settings(Method::Supersample) };
    let [expected, deviation] = measured(&alone, &deep, view, 8);
    let same = measured(&inside(1.4, 0.3), &deep, view, 8);
    println!("{expected} +- {deviation}, with a ball {same:?}");
    // What goes back and forth more than twice costs a ball's two rays more: r^2 of the light, 0.0008, and less.
    assert!((same[0] - expected).abs() < 5.0 * same[1].hypot(deviation) + 1e-3, "{same:?} {expected}");
    let darker = measured(&inside(1.4, 1.3), &deep, view, 8);
    let bending = measured(&inside(2.2, 0.3), &deep, view, 8);
    assert!(
        darker[0] < 0.8 * expected && bending[0] < 0.95 * expected,
        "another glass is seen: {darker:?} {bending:?}"
    );
}

/// Light from a lamp passes straight through what transmits, as far as it transmits.
#[test]
fn glass_casts_the_shadow_that_its_transmission_leaves() {
    let view = View {
        position: DVec3::new(0.0, 1.0, 0.0),
        rotation: DQuat::from_rotation_x(-FRAC_PI_2),
        yfov: 0.1,
        ..ahead()
    };
    let floor = || {
        let face_up = DQuat::from_rotation_x(-FRAC_PI_2);
        let floor = Build::new(0.0).square(material(Vec3::ONE.extend(1.0), 0.0, 1.0), trs(DVec3::ZERO, face_up, 20.0));
        floor.light(stillray::scene::LightKind::Directional, DVec3::ZERO, DVec3::NEG_Y, 2.0)
    };
    // The light is stopped or not by a hash in cells of a pixel's size, 16 x 12 of them or more in a frame, anew in each.
    let frames = 64;
    let jittered = settings(Method::Supersample);
    let under = |transmission: f32| {
        let pane = Material { transmission, ..glass(1.5, 0.0) };
        let at = trs(DVec3::Y * 3.0, DQuat::from_rotation_x(-FRAC_PI_2), 5.0);
        mean_red(&mean_of(floor().square(pane, at).camera(&view), &jittered, view, frames))
    };
    let open = mean_red(&mean_of(floor().camera(&view), &jittered, view, 1));
    for part in [0.0, 0.3, 1.0_f32] {
        let found = under(part);
        let part = f64::from(part);
        // Cells are as large as a pixel is at their distance from the camera, twice that of the floor, or half of it: 48 at least.
        let deviation = open * (part * (1.0 - part) / f64::from(48 * frames)).sqrt();
        println!("{part} transmitted: {found:.4}, expected {:.4} +- {deviation:.4}", open * part);
        assert!((found - open * part).abs() < 5.0 * deviation + open / 1024.0, "{found} {open}");
        assert!(5.0 * deviation < 0.05 * open, "the test is sharp enough");
    }
}

/// At their ends, materials and paths give numbers.
#[test]
fn the_ends_of_all_ranges_are_finite() {
    let view = View { yfov: 0.8, ..ahead() };
    for ior in [0.0, 1.0, 1.0 + f32::EPSILON, 4.0, 1e30] {
        for (roughness, exponent, absorption) in
            [(0.0, 0.0, 0.0), (1.0, 0.0, f32::MAX), (0.0, 1.0, 1e-30), (0.5, 1e6, 5.0)]
        {
            let m = Material { roughness, exponent, ..glass(ior, absorption) };
            let map = EnvironmentMap {
                name: "made".to_owned(),
                width: 4,
                height: 2,
                texels: vec![[1e30; 3]; 8],
                scale: 1.0,
                turn: 0.0,
            };
            let at = trs(DVec3::NEG_Z * 3.0, DQuat::IDENTITY, 1.0);
            let scene = Scene { environment_map: Some(map), ..Build::new(1e-30).ball(m, at).camera(&view) };
            for depth in [0, 8] {
                let deep = Settings { path_depth: depth, gloss: 1.0, ..settings(Method::Stable) };
                let pixels = mean_of(scene.clone(), &Settings { spp: 2, density: 2.0, ..deep }, view, 2);
                assert!(pixels.data.iter().all(|x| x.is_finite() && *x >= 0.0), "{ior} {roughness} {exponent}");
            }
        }
    }
}

/// Paths that are modelled without a surface that sends them on change nothing, and a frame that stands still is the same.
#[test]
fn still_frames_with_paths_are_the_same_to_the_bit() {
    let view = View { yfov: 0.6, ..ahead() };
    let at = trs(DVec3::NEG_Z * 4.0, DQuat::IDENTITY, 1.0);
    let wall = Build::new(0.4).square(shining(1.0), trs(DVec3::NEG_Z * 9.0, DQuat::IDENTITY, 1.0));
    let scene = wall.ball(Material { roughness: 0.3, ..glass(1.5, 0.3) }, at).camera(&view);
    for method in [Method::Stable, Method::Supersample, Method::PointTracking] {
        let base = Settings { jitter: false, hold: Hold::Sample, spp: 2, density: 2.0, ..settings(method) };
        let mut stage = scene_support::Stage::new(scene.clone(), &base);
        let frames: Vec<Pixels> = (0..8).map(|_| stage.frame(view)).collect();
        assert!(frames[5].data == frames[6].data && frames[6].data == frames[7].data, "{}", method.name());
        let all = Settings { modelling: Modelling::All, ..base };
        let mut other = scene_support::Stage::new(scene.clone(), &all);
        let same = frames.iter().all(|frame| other.frame(view).data == frame.data);
        assert!(same, "{}: what else is modelled changes nothing", method.name());
    }
}
