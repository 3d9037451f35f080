//! Light from all around: draws against the map that they are drawn from, and pictures against closed forms.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

#[allow(dead_code)] // what other tests use of it
#[path = "support/random.rs"]
mod random;
mod scene_support;

use glam::{DQuat, DVec2, DVec3, Vec3};
use random::Random;
use scene_support::{Build, Stage, ahead, direction, look, material, mean_of, reds, trs};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use stillray::gpu::ContextOptions;
use stillray::headless::{Device, LoadedScene, Pixels};
use stillray::oracle::environment::{Afar, Drawn};
use stillray::oracle::shade::brdf::Reflector;
use stillray::progress::Quiet;
use stillray::renderer::{Method, Settings};
use stillray::sampler::Strategy;
use stillray::scene::{EnvironmentMap, LightKind, Scene, View, builtin};
use stillray::settings::{Hold, Modelling};

fn map_of(width: u32, height: u32, texel: impl Fn(u32, u32) -> f32) -> EnvironmentMap {
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let texels = places.map(|(x, y)| [texel(x, y); 3]).collect();
    EnvironmentMap { name: "made".to_owned(), width, height, texels, scale: 1.0, turn: 0.0 }
}

/// Half of it black, with a few bright texels, also at the poles.
fn noise(random: &mut Random) -> EnvironmentMap {
    let values: Vec<f32> = (0..12 * 7).map(|_| random.pick(&[0.0, 0.0, 0.3, 1.0, 1.0, 20.0])).collect();
    EnvironmentMap { turn: 2.2, ..map_of(12, 7, |x, y| values[(y * 12 + x) as usize]) }
}

/// Column and row of a direction, with what is behind the point, in f64 and by the definition.
fn place(map: &EnvironmentMap, d: DVec3) -> [f64; 2] {
    let turned = DQuat::from_rotation_y(-map.turn) * d;
    let longitude = turned.x.atan2(-turned.z) / TAU + 0.5;
    [longitude.rem_euclid(1.0) * f64::from(map.width), d.normalize().y.acos() / PI * f64::from(map.height)]
}

fn draws(table: &[u32], count: u32, random: &mut Random) -> Vec<Drawn> {
    (0..count).map(|_| Afar { table, at: [random.bits(), random.bits()] }.drawn().unwrap()).collect()
}

/// Chi-squared of counts against expected ones, in standard deviations above its mean. Cells of no chance must be empty.
fn excess(counts: &[f64], expected: &[f64]) -> f64 {
    let cells: Vec<(f64, f64)> = counts.iter().copied().zip(expected.iter().copied()).collect();
    if cells.iter().any(|(n, e)| *e == 0.0 && *n > 0.0) {
        return f64::INFINITY;
    }
    let live: Vec<&(f64, f64)> = cells.iter().filter(|(_, e)| *e > 0.0).collect();
    let freedom = live.len() as f64 - 1.0;
    let chi2: f64 = live.iter().map(|(n, e)| (n - e).powi(2) / e).sum();
    (chi2 - freedom) / (2.0 * freedom).sqrt()
}

#[test]
fn directions_are_drawn_by_how_bright_the_map_is_there() {
    const COUNT: u32 = 400_000;
    let random = &mut Random::new(1);
    let map = noise(random);
    let table = EnvironmentMap::table(Some(&map));
    let drawn = draws(&table, COUNT, random);
    let cells = (map.width * map.height) as usize;
    let mut counts = vec![0.0; cells];
    let mut quarters = vec![0.0; 4];
    for d in &drawn {
        let [x, y] = place(&map, d.direction.as_dvec3());
        assert!((d.direction.as_dvec3().length() - 1.0).abs() < 1e-6);
        // A direction at a texel's border may be on either side of it: by 2^-18 of a texel.
        let [column, row] = d.texel.map(f64::from);
        assert!((x - column - 0.5).abs() < 0.5 + 4e-6 && (y - row - 0.5).abs() < 0.5 + 4e-6, "{d:?} {x} {y}");
        counts[(d.texel[1] * map.width + d.texel[0]) as usize] += 1.0;
        // Halves of the texel of the same solid angle.
        let edge = |row: f64| (PI * row / f64::from(map.height)).cos();
        let lower = d.direction.y < ((edge(row) + edge(row + 1.0)) / 2.0) as f32;
        quarters[usize::from(x - column >= 0.5) + 2 * usize::from(lower)] += 1.0;
    }
    let weight = |i: usize| f64::from(map.texels[i][0]) * map.solid_angle(i as u32 / map.width);
    let total: f64 = (0..cells).map(weight).sum();
    let expected: Vec<f64> = (0..cells).map(|i| f64::from(COUNT) * weight(i) / total).collect();
    let found = excess(&counts, &expected);
    println!("chi-squared of the texels: {found:.2} standard deviations above its mean");
    assert!(found < 5.0, "{found}");
    assert!(excess(&quarters, &[f64::from(COUNT) / 4.0; 4]) < 5.0, "{quarters:?}");
    // Negative controls: the solid angle left out, and a twentieth more for one texel.
    let flat: f64 = map.texels.iter().map(|t| f64::from(t[0])).sum();
    let unweighted: Vec<f64> = (0..cells).map(|i| f64::from(COUNT) * f64::from(map.texels[i][0]) / flat).collect();
    assert!(excess(&counts, &unweighted) > 50.0);
    let brightest = (0..cells).max_by(|a, b| expected[*a].total_cmp(&expected[*b])).unwrap();
    let mut wrong = expected.clone();
    wrong[brightest] *= 1.05;
    assert!(excess(&counts, &wrong) > 5.0);
}

/// The density is that of the draws: their reciprocals are, on average, the solid angle of what is not black; weighted with the
/// radiance, all light that there is. The sum over all texels is one.
#[test]
fn the_density_adds_up_to_one() {
    const COUNT: u32 = 200_000;
    let random = &mut Random::new(2);
    let map = noise(random);
    let table = EnvironmentMap::table(Some(&map));
    let drawn = draws(&table, COUNT, random);
    let angle = |i: usize| map.solid_angle(i as u32 / map.width);
    let lit = |i: &usize| map.texels[*i][0] > 0.0;
    let expected: f64 = (0..map.texels.len()).filter(lit).map(angle).sum();
    let mean = |of: &dyn Fn(&Drawn) -> f64| drawn.iter().map(of).sum::<f64>() / f64::from(COUNT);
    let found = mean(&|d| 1.0 / d.density);
    let square = mean(&|d| d.density.powi(-2));
    let deviation = ((square - found * found) / f64::from(COUNT)).sqrt();
    assert!((found - expected).abs() < 5.0 * deviation, "{found} {expected} {deviation}");
    assert!(deviation < 0.01 * expected);
    // A grey map has all its light in every draw: what is drawn where it is bright is that much less.
    let light: f64 = (0..map.texels.len()).map(|i| f64::from(map.texels[i][0]) * angle(i)).sum();
    assert!(drawn.iter().all(|d| (d.irradiance.x / light - 1.0).abs() < 1e-5));
    let mut densities = vec![0.0; map.texels.len()];
    drawn.iter().for_each(|d| densities[(d.texel[1] * map.width + d.texel[0]) as usize] = d.density);
    assert!((0..map.texels.len()).filter(lit).all(|i| densities[i] > 0.0), "every lit texel was drawn");
    let whole: f64 = (0..map.texels.len()).map(|i| densities[i] * angle(i)).sum();
    assert!((whole - 1.0).abs() < 1e-6, "{whole}");
}

const FLOOR: f32 = 0.6;
const SIZE: [u32; 2] = [16, 12];

fn settings(method: Method) -> Settings {
    let base = Settings { size: SIZE, float_output: true, hold: Hold::Frame, ..Settings::of(method) };
    Settings { spp: 16, density: 16.0, jitter: true, ..base }
}

/// Mean and variance of radiance over density for directions drawn evenly from the part of the sphere that a test says.
fn reflected(reflector: &Reflector, view: DVec3, part: impl Fn(DVec3) -> bool) -> [f64; 2] {
    const SIDE: u32 = 700;
    let (mut sum, mut square, mut steps) = (0.0, 0.0, 0.0);
    for (i, j) in (0..SIDE).flat_map(|i| (0..2 * SIDE).map(move |j| (i, j))) {
        let y = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(SIDE);
        let longitude = TAU * (f64::from(j) + 0.5) / f64::from(2 * SIDE);
        let r = (1.0 - y * y).sqrt();
        let d = DVec3::new(r * longitude.cos(), y, r * longitude.sin());
        if part(d) {
            let f = reflector.reflect_light(DVec3::Y, view, d).x;
            sum += f;
            square += f * f;
            steps += 1.0;
        }
    }
    let (solid_angle, mean, mean2) = (4.0 * PI * steps / f64::from(2 * SIDE * SIDE), sum / steps, square / steps);
    [solid_angle * mean, solid_angle * solid_angle * (mean2 - mean * mean)]
}

/// Straight down, narrow, so that all pixels look along the same direction but for a degree.
fn down(tilt: f64) -> View {
    let rotation = DQuat::from_rotation_z(tilt) * DQuat::from_rotation_x(-FRAC_PI_2);
    View { position: rotation * DVec3::Z * 2.0, rotation, yfov: 0.02, ..ahead() }
}

fn floor(reflector: &Reflector, map: EnvironmentMap, tilt: f64) -> Scene {
    let m = material(reflector.base_color.as_vec3().extend(1.0), reflector.metallic as f32, reflector.roughness as f32);
    let face_up = DQuat::from_rotation_x(-FRAC_PI_2);
    let scene = Build::new(0.0).square(m, trs(DVec3::ZERO, face_up, 4.0)).camera(&down(tilt));
    Scene { environment_map: Some(map), ..scene }
}

fn mean_red(pixels: &Pixels) -> f64 {
    reds(pixels).map(|(_, red)| red).sum::<f64>() / f64::from(pixels.width * pixels.height)
}

/// A white furnace of a map. A lobe of single scattering loses what is scattered twice: uniform light, which puts that back,
/// reflects all of it; what is lost is told. Smoother surfaces only take longer.
#[test]
fn under_a_white_map_surfaces_reflect_what_their_lobe_does() {
    for (metallic, roughness) in [(0.0, 1.0), (0.0, 0.5), (1.0, 1.0), (1.0, 0.6)] {
        for tilt in [0.0, 0.9] {
            let reflector = Reflector { base_color: DVec3::ONE, metallic, roughness, ..Reflector::default() };
            let view = down(tilt).position.normalize();
            let [expected, variance] = reflected(&reflector, view, |_| true);
            let frames = 24;
            let samples = f64::from(SIZE[0] * SIZE[1] * 16 * frames);
            let scene = floor(&reflector, map_of(32, 16, |_, _| 1.0), tilt);
            let found = mean_red(&mean_of(scene, &settings(Method::Supersample), down(tilt), frames));
            let deviation = (variance / samples).sqrt();
            let lost = 1.0 - expected;
            println!(
                "metallic {metallic}, roughness {roughness}, {tilt} rad: {found:.4}, expected {expected:.4} +- {deviation:.4}; lost {lost:.3}"
            );
            // Samples are no worse than random ones; half a thousandth is for the degree that views differ by.
            let bound = 5.0 * deviation + 5e-4;
            assert!((found - expected).abs() < bound, "{found} {expected} {deviation}");
            assert!(bound < 0.05 * expected, "the test is sharp enough: {bound}");
            // Plastic keeps its energy, rough metal loses up to seven tenths to the second bounce.
            assert!(lost > -0.02 && (metallic == 1.0 || lost < 0.03), "{lost}");
        }
    }
}

/// Half the sky is white, in a quarter of which a wall stands.
#[test]
fn half_a_sky_lights_as_geometry_says() {
    let reflector =
        Reflector { base_color: DVec3::splat(f64::from(FLOOR)), metallic: 0.0, roughness: 1.0, ..Reflector::default() };
    // Columns from the middle of the map to its right edge are what is at positive x.
    let east = || EnvironmentMap { scale: 2.0, ..map_of(64, 32, |x, _| if x >= 32 { 0.5 } else { 0.0 }) };
    let tilt = 0.3;
    let view = down(tilt).position.normalize();
    let open = reflected(&reflector, view, |d| d.x > 0.0);
    for method in [Method::Supersample, Method::Stable] {
        for (turn, part) in [(0.0, [1.0, 0.0]), (PI, [0.0, 1.0])] {
            let map = EnvironmentMap { turn, ..east() };
            let frames = 12;
            let deviation = (open[1] / f64::from(SIZE[0] * SIZE[1] * 16 * frames)).sqrt();
            let west = reflected(&reflector, view, |d| d.x < 0.0);
            let expected = part[0] * open[0] + part[1] * west[0];
            let render = |scene: Scene, settings: &Settings| mean_red(&mean_of(scene, settings, down(tilt), frames));
            let found = render(floor(&reflector, map.clone(), tilt), &settings(method));
            println!("{} turned by {turn:.1}: {found:.4}, expected {expected:.4} +- {deviation:.4}", method.name());
            assert!((found - expected).abs() < 5.0 * deviation + 1e-3, "{found} {expected}");
            // A wall at x = 0.2 that is as good as endless hides the east.
            let mut walled = floor(&reflector, map, tilt);
            let wall = trs(DVec3::X * 0.2, DQuat::from_rotation_y(-FRAC_PI_2), 500.0);
            let white = material(Vec3::ONE.extend(1.0), 0.0, 1.0);
            let other = Build(walled.clone()).square(white.clone(), wall).0;
            walled = Scene { materials: walled.materials.into_iter().chain([white]).collect(), ..other };
            let shaded = render(walled.clone(), &settings(method));
            // It is seen from its dark side, past which the camera does not look.
            assert!((shaded - part[1] * west[0]).abs() < 5.0 * deviation + 4e-3, "{shaded} {part:?}");
            let untraced = render(walled, &Settings { shadow_rays: 0, ..settings(method) });
            assert!((untraced - expected).abs() < 5.0 * deviation + 1e-3, "without shadow rays: {untraced}");
        }
    }
}

/// One bright texel, a third of a degree wide, is a directional light of its radiance times its solid angle.
#[test]
fn a_bright_texel_is_a_sun() {
    let (column, row) = (700, 150);
    let radiance = 40_000.0;
    let map = map_of(1024, 512, |x, y| if (x, y) == (column, row) { radiance } else { 0.0 });
    let longitude = (f64::from(column) + 0.5) / 1024.0 * TAU - PI;
    let polar = (f64::from(row) + 0.5) / 512.0 * PI;
    let towards = DVec3::new(polar.sin() * longitude.sin(), polar.cos(), -polar.sin() * longitude.cos());
    let lux = f64::from(radiance) * map.solid_angle(row);
    let view = look(DVec3::new(1.0, 3.0, 6.0), DVec3::ZERO, 0.7);
    let base = || {
        Build::new(0.0)
            .square(
                material(Vec3::splat(FLOOR).extend(1.0), 0.0, 0.5),
                trs(DVec3::ZERO, DQuat::from_rotation_x(-FRAC_PI_2), 20.0),
            )
            .ball(material(Vec3::new(0.8, 0.3, 0.2).extend(1.0), 0.0, 0.4), trs(DVec3::Y, DQuat::IDENTITY, 1.0))
    };
    let settings = Settings { size: [64, 48], ..settings(Method::Supersample) };
    let mapped = Scene { environment_map: Some(map), ..base().camera(&view) };
    let sunny = base().light(LightKind::Directional, DVec3::ZERO, -towards, lux as f32).camera(&view);
    let [under_map, under_sun] = [mapped, sunny].map(|scene| mean_of(scene, &settings, view, 2));
    let differing =
        reds(&under_map).zip(reds(&under_sun)).filter(|((_, a), (_, b))| (a - b).abs() > 0.02 * b.max(0.05));
    let differing = differing.count();
    let ratio = mean_red(&under_map) / mean_red(&under_sun);
    println!("{differing} of {} pixels differ by 2 %; ratio of the means {ratio:.5}", 64 * 48);
    // The rim of shadows and the highlight, which the texel's extent widens.
    assert!(differing < 64 * 48 / 20 && (ratio - 1.0).abs() < 2e-3, "{differing} {ratio}");
    assert!(mean_red(&under_sun) > 0.05);
}

/// Where the camera looks there is what the definition says: in the middle of an unturned map, and a map that is turned
/// counterclockwise goes to the left.
#[test]
fn the_map_is_seen_where_it_is() {
    let random = &mut Random::new(3);
    let map = EnvironmentMap { turn: 0.7, ..noise(random) };
    let table = EnvironmentMap::table(Some(&map));
    let size = [32, 24];
    for rotation in [DQuat::IDENTITY, DQuat::from_rotation_x(1.4), DQuat::from_rotation_y(2.5)] {
        let view = View { rotation, yfov: 1.2, ..ahead() };
        let settings = Settings { size, float_output: true, spp: 1, ..Settings::of(Method::Supersample) };
        let scene = Scene { environment_map: Some(map.clone()), ..Build::new(0.25).camera(&view) };
        let pixels = mean_of(scene, &settings, view, 1);
        let mut most: f64 = 0.0;
        for ([x, y], red) in reds(&pixels) {
            // Samples lie somewhere in the pixel and its neighbours: the range of what is seen there, by 8 x 8 points.
            let steps = (0..64).map(|i| DVec2::new(f64::from(i % 8), f64::from(i / 8)) * (3.0 / 7.0) - 1.0);
            let at = DVec2::new(x.into(), y.into());
            let seen = |d: DVec3| {
                let [column, row] = place(&map, d).map(|c| c - 0.5);
                let texel = |dx: i64, dy: i64| {
                    let column = (column.floor() as i64 + dx).rem_euclid(12);
                    f64::from(map.texels[(((row.floor() as i64) + dy).clamp(0, 6) * 12 + column) as usize][0])
                };
                let (u, v) = (column - column.floor(), row - row.floor());
                let across = |dy| texel(0, dy) * (1.0 - u) + texel(1, dy) * u;
                0.25 + across(0) * (1.0 - v) + across(1) * v
            };
            let values: Vec<f64> = steps.map(|p| seen(direction(&view, size, at + p))).collect();
            let [low, high] =
                [f64::min as fn(f64, f64) -> f64, f64::max].map(|f| values.iter().copied().reduce(f).unwrap());
            let slack = 0.05 * (high - low) + 1e-3;
            assert!(red > low - slack && red < high + slack, "{x} {y}: {red} is not in {low}..{high}");
            most = most.max(high - 0.25);
        }
        assert!(most > 0.5, "something is seen");
    }
    // The twin has the same by another way.
    let twin = Afar { table: &table, at: [0; 2] };
    let d = DVec3::new(0.3, 0.2, -0.9);
    let [column, row] = place(&map, d);
    assert!(twin.radiance(d.as_vec3().to_array()).1.max_element() < 1e-3, "{column} {row}");
}

/// Where a path ends at once, a mirror shows the blurred map; where its ray is traced to the sky, the map itself: by all else they
/// are alike, so that the ratio is that of the maps, by their twin.
#[test]
fn what_is_beyond_a_path_is_looked_up_blurred() {
    let checks = map_of(64, 32, |x, y| if (x / 8 + y / 8) % 2 == 0 { 2.0 } else { 0.5 });
    let map = EnvironmentMap { turn: 0.3, ..checks };
    let table = EnvironmentMap::table(Some(&map));
    let twin = Afar { table: &table, at: [0; 2] };
    let view = down(0.6);
    let mirror = material(Vec3::ONE.extend(1.0), 1.0, 0.0);
    let flat = trs(DVec3::ZERO, DQuat::from_rotation_x(-FRAC_PI_2), 20.0);
    let scene =
        || Scene { environment_map: Some(map.clone()), ..Build::new(0.0).square(mirror.clone(), flat).camera(&view) };
    let base = Settings { size: [24, 16], float_output: true, spp: 1, ..Settings::of(Method::Supersample) };
    let shown = |path_depth: u32| {
        let settings = Settings { path_depth, gloss: 1.0, ..base.clone() };
        reds(&mean_of(scene(), &settings, view, 1)).map(|(_, red)| red).collect::<Vec<_>>()
    };
    let [blurred, sharp, deeper] = [shown(0), shown(1), shown(3)];
    assert!(sharp == deeper, "the sky is the sky");
    let [mut most, mut apart] = [0.0_f64; 2];
    for (i, (blurred, sharp)) in blurred.iter().zip(&sharp).enumerate() {
        let at = DVec2::new((i % 24) as f64, (i / 24) as f64);
        // Samples lie somewhere in the pixel and its neighbours: where the maps change over them, their ratio does too.
        let corners = (0..81).map(|k| DVec2::new(f64::from(k % 9), f64::from(k / 9)) * (3.0 / 8.0) - 1.0);
        let ratio = |p: DVec2| {
            let d = direction(&view, base.size, at + p) * DVec3::new(1.0, -1.0, 1.0);
            let d = d.as_vec3().to_array();
            twin.blurred(d).0.x / twin.radiance(d).0.x
        };
        let ratios: Vec<f64> = corners.map(ratio).collect();
        let [low, high] =
            [f64::min as fn(f64, f64) -> f64, f64::max].map(|f| ratios.iter().copied().reduce(f).unwrap());
        // Between the 9 x 9 points the ratio moves by an eighth of its range at most, where that is monotonic.
        let slack = (high - low) / 8.0 + 1e-3;
        let found = blurred / sharp;
        assert!(found > low - slack && found < high + slack, "{at}: {found} is not in {low}..{high}");
        most = most.max(high - low);
        apart = apart.max((found - 1.0).abs());
    }
    println!("ratios of up to {:.2} from 1, within {most:.2} of a pixel", apart);
    assert!(apart > 0.2, "the maps differ");
}

#[test]
fn a_map_takes_the_last_of_the_lights() {
    let device = Device::with_options(&ContextOptions { device: None, validation: false }).unwrap();
    let lamps = |count: usize| {
        let mut build = Build::new(0.0);
        for _ in 0..count {
            build = build.light(LightKind::Directional, DVec3::ZERO, DVec3::NEG_Y, 1.0);
        }
        build.square(material(Vec3::ONE.extend(1.0), 0.0, 1.0), trs(DVec3::ZERO, DQuat::IDENTITY, 1.0)).camera(&ahead())
    };
    let load = |scene: &Scene| LoadedScene::new(&device, scene, &Quiet).map(|_| ()).map_err(|e| e.to_string());
    let mapped = |count| Scene { environment_map: Some(map_of(2, 1, |_, _| 1.0)), ..lamps(count) };
    assert_eq!(load(&lamps(32)), Ok(()));
    assert_eq!(load(&mapped(31)), Ok(()));
    let message = load(&mapped(32)).unwrap_err();
    assert!(message.contains("31") && message.contains("environment map"), "{message}");
    let mut broken = mapped(1);
    broken.environment_map.as_mut().unwrap().texels.pop();
    assert!(load(&broken).unwrap_err().contains("2 x 1 with 1 texels"));
}

/// Scene, camera and coordinates stand still: so does the picture, to the bit; and what is modelled without need is not seen.
#[test]
fn nothing_scintillates_under_a_map() {
    let mut scene = builtin::load("cornell", 0).unwrap();
    scene.environment_map = Some(noise(&mut Random::new(4)));
    for sampler in [Strategy::Sobol, Strategy::Sudoku] {
        for method in [Method::Stable, Method::Supersample] {
            let frames = |hold: Hold, modelling: Modelling| {
                let settings = Settings { size: [48, 32], sampler, hold, modelling, ..Settings::of(method) };
                let mut stage = Stage::new(scene.clone(), &settings);
                let view = stage.scene.pose(0.0).cameras[0];
                (0..6).map(|_| stage.frame(view).data).collect::<Vec<_>>()
            };
            let held = frames(Hold::Sample, Modelling::Required);
            assert!(held[3] == held[4] && held[4] == held[5], "{} {}", method.name(), sampler.name());
            assert!(held == frames(Hold::Sample, Modelling::All));
            let drawn = frames(Hold::Frame, Modelling::Required);
            assert!(drawn[3] != drawn[4] && drawn[4] != drawn[5], "negative control");
        }
    }
}
