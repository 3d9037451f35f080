//! Scenes whose picture is known in closed form, rendered whole: furnaces, lights over a plane, shadows, alpha, AOVs.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a panic is a failing test

mod scene_support;

use glam::{DQuat, DVec2, DVec3, Vec3, Vec4};
use scene_support::{Build, Stage, ahead, direction, look, material, reds, render, trs};
use stillray::headless::Pixels;
use stillray::method::constants;
use stillray::oracle::shade::{brdf::Reflector, light::light_at};
use stillray::renderer::{Aov, Method, Settings};
use stillray::scene::{AlphaMode, LightKind, Material, Scene, View};
use stillray::shaders;

/// What a stored half may be off by, relative to the value: a unit in the last place, because Vulkan leaves open in which
/// direction it is rounded. What precedes it is f32 arithmetic of some ten operations, 2^-20.
const HALF: f64 = 1.0 / 1024.0 + 1.0 / 1_048_576.0;

/// All methods, with 32-bit output.
fn methods(size: [u32; 2]) -> [Settings; 4] {
    let base = Settings { size, float_output: true, spp: 4, ..Settings::default() };
    [
        base.clone(),
        Settings { density: 4.0, ..base.clone() },
        Settings { method: Method::Supersample, ..base.clone() },
        Settings { method: Method::Reference, spp: 16, ..base },
    ]
}

/// Balls of every roughness, plastic above and metal below, in a furnace.
fn furnace(base_color: f32) -> Scene {
    let mut build = Build::new(1.0);
    let color = Vec3::splat(base_color).extend(1.0);
    for (i, roughness) in [0.0, 0.03, 0.3, 0.77, 1.0].into_iter().enumerate() {
        for (metallic, y) in [(0.0, 0.55), (1.0, -0.55)] {
            let place = DVec3::new(i as f64 - 2.0, y, 0.0);
            build = build.ball(material(color, metallic, roughness), trs(place, DQuat::IDENTITY, 0.48));
        }
    }
    build.camera(&furnace_view(0.0))
}

fn furnace_view(angle: f64) -> View {
    look(DQuat::from_rotation_y(angle) * DVec3::new(0.0, 0.4, 6.0), DVec3::ZERO, 0.5)
}

/// The lowest and highest radiance of any channel in frames of a camera that goes around the furnace.
fn furnace_range(base_color: f32, settings: &Settings) -> [f64; 2] {
    let mut stage = Stage::new(furnace(base_color), settings);
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for i in 0..6 {
        let pixels = stage.frame(furnace_view(0.03 * f64::from(i)));
        for rgb in pixels.data.chunks(4) {
            range = rgb[..3].iter().fold(range, |[low, high], c| [low.min((*c).into()), high.max((*c).into())]);
        }
    }
    range
}

#[test]
fn a_white_furnace_is_white_in_every_pixel() {
    for settings in methods([64, 32]) {
        let [low, high] = furnace_range(1.0, &settings);
        assert!(low >= 1.0 - HALF && high <= 1.0 + HALF, "{settings:?}: {low}..{high}");
    }
    // 16-bit output rounds once more.
    let [low, high] = furnace_range(1.0, &Settings { size: [64, 32], ..Settings::default() });
    assert!(low >= 1.0 - 2.0 * HALF && high <= 1.0 + 2.0 * HALF, "{low}..{high}");
}

#[test]
fn a_furnace_that_is_not_white_is_noticed() {
    for settings in methods([64, 32]) {
        let [low, high] = furnace_range(0.98, &settings);
        assert!(low < 1.0 - 4.0 * HALF && high <= 1.0 + HALF, "{settings:?}: {low}..{high}");
    }
}

const SIZE: [u32; 2] = [64, 48];

/// The floor y = 0, 12 metres wide, seen from above at an angle: it fills the frame.
fn floor_view() -> View {
    look(DVec3::new(0.3, 3.0, 3.5), DVec3::new(0.0, 0.0, -0.2), 0.6)
}

fn floor(m: Material) -> Build {
    let flat = DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    Build::new(0.0).square(m, trs(DVec3::ZERO, flat, 6.0))
}

fn floor_point(view: &View, at: DVec2) -> DVec3 {
    let d = direction(view, SIZE, at);
    view.position + d * (-view.position.y / d.y)
}

/// What the filter makes of a function over the frame at one pixel.
struct Filtered {
    /// Gaussian mean over the 3 x 3 block, which ends at the frame; the standard deviation is half a pixel.
    mean: f64,
    /// Standard deviation of the values in the block, weighted alike.
    deviation: f64,
    /// Least value in the block.
    low: f64,
    /// Largest value in the block.
    high: f64,
}

/// By the midpoint rule, on points an eighth of a pixel apart. For the range a ring of points around the block counts as
/// well, and it is widened by the largest step between neighbours: that bounds what lies between them.
fn filtered(pixel: [u32; 2], size: [u32; 2], f: impl Fn(DVec2) -> f64) -> Filtered {
    let centre = DVec2::new(f64::from(pixel[0]) + 0.5, f64::from(pixel[1]) + 0.5);
    let frame = DVec2::new(size[0].into(), size[1].into());
    let (mut sum, mut sum2, mut weights) = (0.0, 0.0, 0.0);
    let (mut low, mut high, mut step) = (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64);
    for i in -13..13 {
        let mut before: Option<f64> = None;
        for j in -13..13 {
            let away = DVec2::new(f64::from(i) + 0.5, f64::from(j) + 0.5) / 8.0;
            let value = f(centre + away);
            (low, high) = (low.min(value), high.max(value));
            step = step.max(before.map_or(0.0, |b| (value - b).abs()));
            before = Some(value);
            let at = centre + away;
            if away.abs().max_element() < 1.5 && at.min_element() > 0.0 && at.cmplt(frame).all() {
                let weight = (-away.length_squared() / 0.5).exp();
                (sum, sum2, weights) = (sum + weight * value, sum2 + weight * value * value, weights + weight);
            }
        }
    }
    let mean = sum / weights;
    Filtered { mean, deviation: (sum2 / weights - mean * mean).max(0.0).sqrt(), low: low - step, high: high + step }
}

/// Radiance of the floor under the only light of `scene`, in f64.
fn closed_form(scene: &Scene, view: &View, point: DVec3) -> f64 {
    let m = &scene.materials[0];
    let reflector = Reflector {
        base_color: m.base_color.truncate().as_dvec3(),
        metallic: m.metallic.into(),
        roughness: m.roughness.into(),
        ..Reflector::default()
    };
    let pose = scene.pose(0.0);
    let light: shaders::Light = constants::light(&scene.lights[0], &pose.lights[0], DVec3::ZERO, DVec3::ZERO);
    let incident = light_at(&light, point.as_vec3().to_array());
    let to_viewer = (view.position - point).normalize();
    reflector.reflect_light(DVec3::Y, to_viewer, incident.direction).x * incident.irradiance.x
}

/// Pixels outside what the closed form allows, and the relative difference of the mean over the frame from it.
///
/// A stable pixel (no `spp`) is a weighted mean of values in the filter's block, and so within their range. The reference's
/// is the filter's mean but for noise: of `spp` samples a pixel the Gaussian counts those of an area of 4 pi sigma^2 = pi
/// pixels, in a corner of the frame of a quarter of that, and their mean strays by eight standard deviations in no pixel.
/// The midpoint rule, and positions stored to 1/512 of a pixel, are together worth a 24th of the range.
fn outside(pixels: &Pixels, spp: Option<u32>, expected: &[Filtered], brighter: f64) -> (usize, f64) {
    let (mut wrong, mut sum, mut expected_sum) = (0, 0.0, 0.0);
    for ((_, value), expected) in reds(pixels).zip(expected) {
        // The negative controls expect more light, which changes everything by the same factor.
        let value = value / brighter;
        let round = HALF * expected.high;
        let [low, high] = spp.map_or([expected.low, expected.high], |spp| {
            let noise = 8.0 * expected.deviation / (f64::from(spp) * std::f64::consts::PI / 4.0).sqrt();
            let shift = (expected.high - expected.low) / 24.0;
            [expected.mean - noise - shift, expected.mean + noise + shift]
        });
        wrong += usize::from(!(value >= low - round && value <= high + round));
        (sum, expected_sum) = (sum + value, expected_sum + expected.mean);
    }
    (wrong, sum / expected_sum - 1.0)
}

fn lights() -> [(LightKind, DVec3, DVec3, f32); 3] {
    let position = DVec3::new(0.8, 1.6, -0.9);
    let spot = LightKind::Spot { inner: 0.3, outer: 0.7 };
    [
        (LightKind::Point, position, DVec3::NEG_Z, 9.0),
        (LightKind::Directional, DVec3::ZERO, DVec3::new(-0.4, -1.0, 0.3), 2.0),
        (spot, position, DVec3::new(-0.4, -1.0, 0.3), 9.0),
    ]
}

#[test]
fn a_plane_under_one_light_is_as_bright_as_the_closed_form() {
    let view = floor_view();
    for (kind, position, toward, intensity) in lights() {
        for (metallic, roughness) in [(0.0, 1.0), (1.0, 0.6)] {
            let scene = floor(material(Vec4::new(0.6, 0.6, 0.6, 1.0), metallic, roughness));
            let scene = scene.light(kind, position, toward, intensity).camera(&view);
            let truth = |at: DVec2| closed_form(&scene, &view, floor_point(&view, at));
            let places = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| [x, y]));
            let expected: Vec<Filtered> = places.map(|pixel| filtered(pixel, SIZE, truth)).collect();
            let base = Settings { size: SIZE, float_output: true, density: 4.0, ..Settings::default() };
            let what = format!("{kind:?}, roughness {roughness}");
            let stable = render(scene.clone(), &base, view, 2);
            assert_eq!(outside(&stable, None, &expected, 1.0).0, 0, "stable, {what}");
            assert!(outside(&stable, None, &expected, 2.0).0 > 100, "twice the light is noticed: {what}");
            let settings = Settings { method: Method::Reference, spp: 16, ..base };
            let reference = render(scene.clone(), &settings, view, 4);
            let (wrong, bias) = outside(&reference, Some(64), &expected, 1.0);
            assert_eq!(wrong, 0, "reference, {what}");
            // Noise averages out over 200,000 samples: radiance in a block varies by less than its mean, in a stratum by
            // less than a quarter of it, so that four standard deviations of the mean are below 1/450 / 4.
            assert!(bias.abs() < HALF + 1.0 / 1800.0, "reference, {what}: {bias}");
            let (_, control) = outside(&reference, Some(64), &expected, 1.01);
            assert!(control.abs() > 0.005, "one percent is noticed: {what}");
        }
    }
}

/// Where the floor is lit by a sun that a square of half-width 0.5 at height 1 shades.
const SUN: DVec3 = DVec3::new(1.4, -1.0, 0.2);

fn shaded_by_square(point: DVec3) -> bool {
    let crossing = point - SUN; // a metre up, against the light
    crossing.x.abs() < 0.5 && crossing.z.abs() < 0.5
}

/// What a pixel's surroundings show, within 1.75 pixels of its centre along either axis: the filter's block and the
/// spacing of the points that are tried.
#[derive(PartialEq, Debug)]
enum Seen {
    Lit,
    Shadow,
    Mixed,
}

fn seen(view: &View, pixel: [u32; 2]) -> Seen {
    let (mut dark, mut bright) = (0, 0);
    for i in -7..=7 {
        for j in -7..=7 {
            let at = DVec2::new(f64::from(pixel[0]) + 0.5, f64::from(pixel[1]) + 0.5);
            let at = at + DVec2::new(f64::from(i), f64::from(j)) * 0.25;
            let d = direction(view, SIZE, at);
            let through = view.position + d * ((1.0 - view.position.y) / d.y);
            if through.x.abs() < 0.5 && through.z.abs() < 0.5 {
                return Seen::Mixed; // the square itself
            }
            if shaded_by_square(floor_point(view, at)) { dark += 1 } else { bright += 1 }
        }
    }
    match (dark, bright) {
        (0, _) => Seen::Lit,
        (_, 0) => Seen::Shadow,
        _ => Seen::Mixed,
    }
}

/// Pixels in shadow that are not black, lit ones that are not as bright as they should be, and how many of each were seen.
fn shadow_errors(square_x: f64) -> [usize; 4] {
    let view = look(DVec3::new(0.9, 5.0, 3.0), DVec3::new(0.9, 0.0, 0.1), 0.6);
    let up = DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    let white = material(Vec4::ONE, 0.0, 1.0);
    let place = trs(DVec3::new(square_x, 1.0, 0.0), up, 0.5);
    let scene = floor(white.clone()).square(Material { double_sided: true, ..white }, place);
    let scene = scene.light(LightKind::Directional, DVec3::ZERO, SUN, 3.0).camera(&view);
    let settings = Settings { size: SIZE, float_output: true, density: 4.0, ..Settings::default() };
    let pixels = render(scene.clone(), &settings, view, 2);
    let mut counts = [0; 4];
    for (pixel, value) in reds(&pixels) {
        let expected = filtered(pixel, SIZE, |at| closed_form(&scene, &view, floor_point(&view, at)));
        let bright = value >= expected.low * (1.0 - HALF) && value <= expected.high * (1.0 + HALF);
        match seen(&view, pixel) {
            Seen::Shadow => counts = [counts[0] + usize::from(value != 0.0), counts[1], counts[2] + 1, counts[3]],
            Seen::Lit => counts = [counts[0], counts[1] + usize::from(!bright), counts[2], counts[3] + 1],
            Seen::Mixed => {}
        }
    }
    counts
}

#[test]
fn a_shadow_ends_where_geometry_says() {
    let [not_black, not_bright, dark, bright] = shadow_errors(0.0);
    assert!(dark > 50 && bright > 1000, "{dark} pixels in shadow, {bright} lit");
    assert_eq!((not_black, not_bright), (0, 0));
    // A square a tenth of a metre further shades other pixels.
    let [not_black, not_bright, ..] = shadow_errors(0.1);
    assert!(not_black > 0 && not_bright > 0, "the comparison can fail");
}

/// A square that fills the frame of [`ahead`] at 2 metres.
fn screen(m: Material, environment: f32) -> Build {
    Build::new(environment).square(m, trs(DVec3::new(0.0, 0.0, -2.0), DQuat::IDENTITY, 2.0))
}

/// The largest relative difference of any pixel of any method from a radiance.
fn largest_difference(scene: &Scene, radiance: Vec3) -> f64 {
    let mut largest = 0.0_f64;
    for settings in methods([32, 24]) {
        let pixels = render(scene.clone(), &settings, ahead(), 3);
        for p in pixels.data.chunks(4) {
            let difference = (Vec3::new(p[0], p[1], p[2]) / radiance - 1.0).abs().max_element();
            largest = largest.max(difference.into());
        }
    }
    largest
}

#[test]
fn what_emits_or_is_unlit_has_its_own_radiance() {
    // Values that a half holds. What is left is the f32 of the filter: sums of up to 144 terms twice, and a division.
    let filter = 300.0 / 16_777_216.0;
    let radiance = Vec3::new(0.25, 2.0, 96.0);
    let black = material(Vec4::new(0.0, 0.0, 0.0, 1.0), 0.0, 0.5);
    let glowing = screen(Material { emissive: radiance, ..black }, 0.0).camera(&ahead());
    assert!(largest_difference(&glowing, radiance) < filter);
    let paint = Vec4::new(0.5, 0.25, 1.0, 1.0);
    let flat = screen(Material { unlit: true, base_color: paint, ..Material::default() }, 3.0);
    let flat = flat.light(LightKind::Point, DVec3::new(0.3, 0.2, -1.0), DVec3::NEG_Z, 100.0).camera(&ahead());
    assert!(largest_difference(&flat, paint.truncate()) < filter);
    assert!(largest_difference(&flat, Vec3::new(0.5, 0.25, 0.999)) > filter, "the comparison can fail");
}

/// Mean of red over the frame, of an unlit white square with this alpha over black.
fn blended(alpha: f32, settings: &Settings) -> f64 {
    let base_color = Vec4::new(1.0, 1.0, 1.0, alpha);
    let m = Material { unlit: true, base_color, alpha: AlphaMode::Blend, ..Material::default() };
    let pixels = render(screen(m, 0.0).camera(&ahead()), settings, ahead(), 2);
    reds(&pixels).map(|(_, value)| value).sum::<f64>() / (f64::from(pixels.width) * f64::from(pixels.height))
}

#[test]
fn a_quarter_of_alpha_covers_a_quarter() {
    // Points share a threshold in cells of half to one pixel: at least as many trials as pixels. Their weights in the mean
    // go with the samples that they happen to get; at densities of 4 and more the squares of the weights add up to at most
    // twice those of equal ones (a Poisson number of samples with mean m has a mean square of m^2 + m), at density 1,
    // jittered, to no more either. Four standard deviations of that binomial.
    let size = [192, 144];
    let trials = f64::from(size[0] * size[1]);
    let bound = |p: f64| 4.0 * (2.0 * p * (1.0 - p) / trials).sqrt();
    for settings in methods(size) {
        for alpha in [0.25, 0.75] {
            let mean = blended(alpha, &settings);
            assert!((mean - f64::from(alpha)).abs() < bound(alpha.into()), "{settings:?}: {mean} for {alpha}");
        }
    }
    let settings = &methods(size)[1];
    assert!((blended(0.28, settings) - 0.25).abs() > bound(0.25), "the comparison can fail");
    assert_eq!([blended(0.0, settings), blended(1.0, settings)], [0.0, 1.0]);
}

/// Depth in metres and motion in pixels in the last of four frames of a camera that slides by `step` metres a frame along
/// x, `distance` metres before a wall: the largest relative error of each against a wall at 2 metres, a step of 0.02.
fn aov_errors(distance: f64, step: f64) -> [f64; 2] {
    let size = [48, 40];
    let wall = material(Vec4::ONE, 0.0, 1.0);
    let wall = Build::new(1.0).square(wall, trs(DVec3::new(0.0, 0.0, -distance), DQuat::IDENTITY, 4.0));
    let aovs = vec![Aov::Depth, Aov::Motion];
    let settings = Settings { size, density: 4.0, aovs, ..Settings::default() };
    let mut stage = Stage::new(wall.camera(&ahead()), &settings);
    for i in 0..4 {
        stage.frame(View { position: DVec3::X * (step * f64::from(i)), ..ahead() });
    }
    let [depth, motion] = [Aov::Depth, Aov::Motion].map(|aov| stage.session.aov(aov).unwrap());
    // The frame is 1/2 metre high a metre away.
    let moved = 0.02 / (0.5 * 2.0) * f64::from(size[1]);
    let mut errors = [0.0_f64; 2];
    let mut found = 0;
    for ((pixel, metres), shift) in reds(&depth).zip(motion.data.chunks(2)) {
        if metres.is_infinite() {
            continue; // no sample in this pixel
        }
        found += 1;
        if f64::from(pixel[0] + 1) + moved > f64::from(size[0]) {
            continue; // what comes into the frame here has moved from nowhere
        }
        // The nearest sample lies somewhere in the pixel: its distance is between those of the pixel's nearest and
        // furthest points, of which the corners and the middle of the frame are the candidates.
        let corners = [[0, 0], [1, 0], [0, 1], [1, 1]];
        let lengths = corners.map(|[x, y]| {
            let at = DVec2::new(f64::from(pixel[0] + x), f64::from(pixel[1] + y));
            2.0 * direction(&ahead(), size, at).length()
        });
        let [low, high] =
            [lengths.iter().copied().fold(f64::INFINITY, f64::min), lengths.iter().copied().fold(0.0, f64::max)];
        errors[0] = errors[0].max((low - metres).max(metres - high) / metres);
        let shift = DVec2::new(shift[0].into(), shift[1].into());
        errors[1] = errors[1].max(shift.distance(DVec2::new(-moved, 0.0)) / moved);
    }
    assert!(f64::from(found) > 0.95 * f64::from(size[0] * size[1]), "{found} pixels have a sample");
    errors
}

#[test]
fn depth_and_motion_are_those_of_a_wall() {
    // Depth: a dozen roundings of f32. Motion: a half, and a difference of pixel coordinates of up to 48, each of which is
    // good to a dozen roundings.
    let f32_error = 16.0 / 16_777_216.0;
    let [depth, motion] = aov_errors(2.0, 0.02);
    assert!(depth < f32_error, "{depth}");
    assert!(motion < HALF + 2.0 * 48.0 * f32_error / 0.8, "{motion}");
    assert!(aov_errors(2.01, 0.02)[0] > 1e-3, "another distance is noticed");
    assert!(aov_errors(2.0, 0.0201)[1] > 4e-3, "another speed is noticed");
}
