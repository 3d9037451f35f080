//! Distribution ray tracing (paper 2): lens and area lights against closed forms, and where their noise is.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod scene_support;

use glam::{DQuat, DVec2, DVec3, Vec3, Vec4};
use scene_support::{Build, Stage, ahead, direction, material, mean_of, reds, trs};
use std::f64::consts::FRAC_PI_2;
use stillray::headless::Pixels;
use stillray::oracle::shade::brdf::Reflector;
use stillray::renderer::{Method, Settings};
use stillray::sampler::{Strategy, Tiling};
use stillray::scene::{Lens, LightKind, LightShape, Scene, View, builtin};
use stillray::settings::{Hold, Modelling};

/// A luminaire of half width 1/2 at height 3, shining down, and half a plane at height 1 that hides it from the floor.
const LAMP: f64 = 3.0;
const SHELF: f64 = 1.0;
const CANDELA: f32 = 40.0;
const FLOOR: f32 = 0.6;

/// With lamps of this width; the shelf's edge is at x = 0, and ends nowhere else.
fn shelf(shape: LightShape) -> Scene {
    let floor = material(Vec3::splat(FLOOR).extend(1.0), 0.0, 1.0);
    let face_up = DQuat::from_rotation_x(-FRAC_PI_2);
    let mut build = Build::new(0.0)
        .square(floor.clone(), trs(DVec3::ZERO, face_up, 20.0))
        .square(floor, trs(DVec3::new(-50.0, SHELF, 0.0), face_up, 50.0))
        .light(LightKind::Point, DVec3::Y * LAMP, DVec3::NEG_Y, CANDELA);
    build.0.lights[0].shape = shape;
    build.camera(&below())
}

/// From between shelf and floor, straight down.
fn below() -> View {
    let rotation = DQuat::from_rotation_x(-FRAC_PI_2);
    View { position: DVec3::Y * 0.8, rotation, yfov: 2.0 * 0.1_f64.atan(), ..ahead() }
}

/// Radiance from a point of the floor to the camera: the integral over the light of what is seen of it, by the midpoint
/// rule with 256 x 256 points, whose error is that of an edge: below 1/256 of the light's width where it crosses.
fn penumbra(point: DVec3, [width, depth]: [f64; 2], round: bool) -> f64 {
    const SIDE: u32 = 256;
    let white = Vec3::splat(FLOOR).as_dvec3();
    let reflector = Reflector { base_color: white, metallic: 0.0, roughness: 1.0, ..Reflector::default() };
    let view = (below().position - point).normalize();
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(SIDE) * 2.0 - 1.0;
    let (mut sum, mut points) = (0.0, 0.0);
    for (x, z) in (0..SIDE * SIDE).map(|i| (at(i % SIDE), at(i / SIDE))) {
        if round && x * x + z * z > 1.0 {
            continue;
        }
        points += 1.0;
        let lamp = DVec3::new(0.5 * width * x, LAMP, 0.5 * depth * z);
        let to = lamp - point;
        // Where the ray passes the shelf's height.
        if point.x + to.x * (SHELF - point.y) / to.y < 0.0 {
            continue;
        }
        let incident = to.normalize();
        let reflected = reflector.reflect_light(DVec3::Y, view, incident).x;
        sum += reflected * f64::from(CANDELA) * incident.y / to.length_squared();
    }
    sum / points
}

/// Point of the floor that the middle of a pixel shows.
fn floor_at(size: [u32; 2], [x, y]: [u32; 2]) -> DVec3 {
    let view = below();
    let along = direction(&view, size, DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
    view.position + along * (view.position.y / -along.y)
}

const STRIP: [u32; 2] = [64, 8];

/// How far along the way from one picture to another a rendered one is: 0 if it is the first, 1 if the second; with the
/// standard deviation of that number for pixels that are each off by `noise`.
fn along(rendered: &[f64], first: &[f64], second: &[f64], noise: f64) -> [f64; 2] {
    let way = |i: usize| second[i] - first[i];
    let length: f64 = (0..first.len()).map(|i| way(i).powi(2)).sum();
    let done: f64 = (0..first.len()).map(|i| (rendered[i] - first[i]) * way(i)).sum();
    [done / length, noise / length.sqrt()]
}

fn profile(size: [f64; 2], round: bool) -> Vec<f64> {
    (0..STRIP[0] * STRIP[1]).map(|i| penumbra(floor_at(STRIP, [i % STRIP[0], i / STRIP[0]]), size, round)).collect()
}

/// Every method and sampler: the penumbra is that of this light and not of one that is an eighth wider, round instead of
/// rectangular, or sharp.
#[test]
fn a_penumbra_is_as_wide_and_as_dark_as_geometry_says() {
    let methods = [Method::Supersample, Method::Stable];
    let samplers = [Strategy::Sobol, Strategy::Sudoku, Strategy::Random];
    for (round, size) in [(false, [1.0_f32, 0.7]), (true, [1.2, 1.2])] {
        let wide = |scale: f32| size.map(|s| f64::from(s * scale));
        let shape = if round { LightShape::Disc(size) } else { LightShape::Rectangle(size) };
        let expected = profile(wide(1.0), round);
        let wider = profile(wide(1.125), round);
        let sharp = profile([1e-9; 2], round);
        let brightest = expected.iter().copied().fold(0.0, f64::max);
        for method in methods {
            for sampler in samplers {
                let base =
                    Settings { size: STRIP, float_output: true, sampler, hold: Hold::Frame, ..Settings::of(method) };
                let settings = Settings { spp: 16, density: 16.0, jitter: true, ..base };
                let frames = 16;
                let rendered: Vec<f64> =
                    reds(&mean_of(shelf(shape), &settings, below(), frames)).map(|(_, red)| red).collect();
                // A sample sees the light or not: at most half the brightest is its standard deviation, if samples are
                // independent; and they are no worse than that. The filter spreads a pixel over its neighbours, which
                // leaves the picture's noise no larger, and its profile all but the same: it is smooth over 3 pixels.
                let noise = 0.5 * brightest / f64::from(16 * frames).sqrt();
                let name = format!("{} {} {round}", method.name(), sampler.name());
                for (other, what) in [(&wider, "an eighth wider"), (&sharp, "sharp")] {
                    let [is, deviation] = along(&rendered, &expected, other, noise);
                    println!("{name}: {is:.3} +- {deviation:.3} of the way to one {what}");
                    assert!(5.0 * deviation < 0.5, "the test is sharp enough: {deviation}");
                    assert!(is.abs() < 5.0 * deviation, "{name}, {what}: {is} +- {deviation}");
                }
            }
        }
    }
}

/// Nothing of the built-in furnace shows, and of one that is not white everything does.
#[test]
fn the_built_in_furnace_is_white() {
    let darkest = |name: &str| {
        let settings = Settings { size: [80, 48], density: 2.0, ..Settings::default() };
        let scene = builtin::load(name, 0).unwrap();
        let view = scene.pose(0.0).cameras[0];
        let pixels = mean_of(scene, &settings, view, 1);
        let range = reds(&pixels).fold([f64::INFINITY, 0.0_f64], |[low, high], (_, x)| [low.min(x), high.max(x)]);
        // Where no sample is near, a pixel is black: at 2 samples a pixel none is.
        assert!(range[1] <= 1.001, "{name}: {range:?}");
        range[0]
    };
    // A half, f32 arithmetic, and the fits of the lobe's albedo, whose errors the diffuse layer and multiple scattering cancel.
    assert!(darkest("furnace") > 0.999);
    assert!(darkest("furnace?albedo=80") < 0.9);
}

/// An unlit speck before black.
fn speck(distance: f64, half: f64) -> Scene {
    let white = stillray::scene::Material { unlit: true, ..material(Vec4::ONE, 0.0, 1.0) };
    Build::new(0.0).square(white, trs(DVec3::NEG_Z * distance, DQuat::IDENTITY, half)).camera(&ahead())
}

/// Sum over the pixels, and the variance of where it is, along either axis, in pixels squared.
fn spread(pixels: &Pixels) -> [f64; 3] {
    let weigh = |f: &dyn Fn(DVec2) -> f64| -> f64 {
        reds(pixels).map(|([x, y], red)| red * f(DVec2::new(x.into(), y.into()))).sum()
    };
    let total = weigh(&|_| 1.0);
    let middle = DVec2::new(weigh(&|p| p.x), weigh(&|p| p.y)) / total;
    [total, weigh(&|p| (p.x - middle.x).powi(2)) / total, weigh(&|p| (p.y - middle.y).powi(2)) / total]
}

/// The circle of confusion of a point at depth z, focused at f, has the diameter a |z / f - 1| at its depth. The variance of
/// a disc is a sixteenth of its diameter squared, that of a regular n-gon (2 + cos 2 pi / n) / 48; variances of the speck and
/// of the filter add to it.
#[test]
fn a_point_out_of_focus_is_a_circle_of_confusion() {
    let size = [64, 64];
    // A metre away, 1/2 metre is 64 pixels.
    let pixels_of = |metres: f64, depth: f64| metres / depth * 2.0 * 64.0;
    for (method, frames) in [(Method::Supersample, 8), (Method::Stable, 1)] {
        for (depth, focus, aperture, blades) in [
            (4.0, 2.0, 0.3, 0),
            (2.0, 4.0, 0.5, 0),
            (3.0, f64::INFINITY, 0.2, 0),
            (4.0, 2.0, 0.35, 5),
            (4.0, 2.0, 0.3, 3),
        ] {
            let settings = Settings {
                size,
                float_output: true,
                spp: 16,
                density: 16.0,
                modelling: Modelling::All,
                jitter: true,
                ..Settings::of(method)
            };
            let half = 0.03 * depth;
            let seen = |lens: Lens| spread(&mean_of(speck(depth, half), &settings, View { lens, ..ahead() }, frames));
            let [sharp, x0, y0] = seen(Lens::PINHOLE);
            let [total, x, y] = seen(Lens { aperture, focus, blades });
            let diameter = pixels_of(aperture * (depth / focus - 1.0).abs(), depth);
            let part = if blades == 0 { 3.0 } else { 2.0 + (std::f64::consts::TAU / f64::from(blades)).cos() };
            let expected = diameter * diameter * part / 48.0;
            // Samples that meet the speck, 16 a pixel. The relative error of a variance from n of them is the root of
            // (kurtosis - 1) / n, and the kurtosis of a disc 2; that of a triangle is less than 3.
            let met = 16.0 * f64::from(frames) * (2.0 * pixels_of(half, depth)).powi(2);
            let bound = 5.0 * (2.0 / met).sqrt();
            for (axis, variance) in [("x", x - x0), ("y", y - y0)] {
                let ratio = variance / expected;
                println!(
                    "{} {depth} m, focus {focus} m, {blades} blades: {axis} {ratio:.3} +- {:.3}",
                    method.name(),
                    bound / 5.0
                );
                assert!((ratio - 1.0).abs() < bound, "{axis}: {variance} instead of {expected}");
            }
            // The light is spread, and none of it lost: as many samples meet the speck, give or take their root.
            assert!((total / sharp - 1.0).abs() < 5.0 * (2.0 / met).sqrt(), "{total} {sharp}");
            assert!(bound < 0.25, "a diameter that is an eighth off changes the variance by more");
        }
    }
}

/// Scene, camera and coordinates stand still: so does the picture, to the bit, with every strategy.
#[test]
fn nothing_scintillates() {
    let scene = || builtin::load("penumbra", 0).unwrap();
    let lens = Lens { aperture: 0.1, focus: 5.0, blades: 0 };
    for sampler in Strategy::ALL {
        for (method, tiling) in [(Method::Stable, Tiling::Sudoku), (Method::Supersample, Tiling::Regular)] {
            let base = Settings { size: [48, 32], sampler, tiling, modelling: Modelling::All, ..Settings::of(method) };
            let frames = |hold: Hold| {
                let mut stage = Stage::new(scene(), &Settings { hold, ..base.clone() });
                let view = View { lens, ..stage.scene.pose(0.0).cameras[0] };
                let all: Vec<Vec<f32>> = (0..6).map(|_| stage.frame(view).data).collect();
                all
            };
            let held = frames(Hold::Sample);
            assert!(held[3] == held[4] && held[4] == held[5], "{} {}", method.name(), sampler.name());
            let drawn = frames(Hold::Frame);
            assert!(drawn[3] != drawn[4] && drawn[4] != drawn[5], "negative control");
        }
    }
}

/// What the scene does not need changes nothing where it is modelled all the same.
#[test]
fn what_is_left_out_is_not_missed() {
    for (name, gloss) in [
        ("hairball?strands=200", 0.0),
        ("spheres", 0.0),
        ("spheres", 0.5),
        ("cornell", 0.0),
        ("penumbra", 0.0),
        ("penumbra?light=0", 1.0),
        ("ashtray", 0.0),
        ("billiards?rings=7", 0.0),
        ("billiards?rings=7", 0.3),
        ("skylight", 0.0),
        ("mist", 0.0),
        ("mist", 1.0),
        ("terrain", 0.0),
    ] {
        for method in Method::ALL {
            let scene = builtin::load(name, 0).unwrap();
            let frames = |modelling: Modelling| {
                let settings = Settings { size: [40, 30], modelling, gloss, ..Settings::of(*method) };
                let mut stage = Stage::new(scene.clone(), &settings);
                let view = stage.scene.pose(0.0).cameras[0];
                let moved = |i: u32| View { position: view.position + DVec3::X * 0.02 * f64::from(i), ..view };
                (0..3).map(|i| stage.frame_at(moved(i), f64::from(i) / 30.0).data).collect::<Vec<_>>()
            };
            assert!(frames(Modelling::Required) == frames(Modelling::All), "{name} {}", method.name());
        }
    }
}
