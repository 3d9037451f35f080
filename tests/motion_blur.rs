//! Motion blur (paper 2, section 3.4): what the shutter sees against closed forms and against means of sharp moments.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod scene_support;
mod support;

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3, Vec4};
use scene_support::{Build, Stage, ahead, material, reds, trs};
use stillray::Pose;
use stillray::gpu::ContextOptions;
use stillray::headless::{Device, LoadedScene, Session};
use stillray::oracle::random::{hash_uint, unit_float};
use stillray::progress::Quiet;
use stillray::renderer::{FrameInputs, Method, Settings};
use stillray::scene::{Animation, Channel, ChannelValues, Deformer, Interpolation, Material, MorphTarget, Scene, View};
use stillray::settings::{Hold, Modelling};

fn paint(level: f32) -> Material {
    Material { unlit: true, double_sided: true, ..material(Vec3::splat(level).extend(1.0), 0.0, 1.0) }
}

fn open(shutter: f64) -> View {
    View { shutter, ..ahead() }
}

/// At a distance of 4 metres the frame is 2 metres high.
const STRIP: [u32; 2] = [128, 64];
const METRES: f64 = 2.0 / 64.0;
/// Pixels a frame; frames that are looked at, after those in which samples gather.
const SPEED: u32 = 6;
const WARM: u32 = 3;
const FRAMES: u32 = 8;

/// A white square of 40 pixels that is taller than the strip, over black; its left edge starts at column 12.
fn runner() -> Scene {
    let (half, start) = (20.0 * METRES, (12.0 + 20.0 - 64.0) * METRES);
    let scale = |x: f64| stillray::scene::LocalTransform::Trs {
        translation: DVec3::new(x, 0.0, -4.0),
        rotation: DQuat::IDENTITY,
        scale: DVec3::new(half, 2.0, 1.0),
    };
    let mut scene = Build::new(0.0).square(paint(1.0), scale(start)).camera(&open(1.0));
    let end = start + 100.0 * f64::from(SPEED) * METRES;
    let values = ChannelValues::Translation([start, end].map(|x| DVec3::new(x, 0.0, -4.0)).to_vec());
    let channel = Channel { node: 0, times: vec![0.0, 100.0], interpolation: Interpolation::Linear, values };
    scene.animations.push(Animation { name: String::new(), channels: vec![channel] });
    scene
}

/// Mean of all lines and frames, each shifted by how far the square has come: column 0 is 12 pixels left of its left edge.
fn profile(settings: &Settings, shutter: f64) -> Vec<f64> {
    let mut stage = Stage::new(runner(), settings);
    let mut sums = vec![0.0; 64];
    for frame in 0..WARM + FRAMES {
        let pose = stage.scene.pose(f64::from(frame));
        // A method that accumulates renders a picture from each reset on.
        let parts = if settings.method.accumulates() { 4 } else { 1 };
        let picture = (0..parts).map(|part| {
            let reset = settings.method.accumulates() && part == 0;
            stage.session.frame(&FrameInputs { view: open(shutter), pose: &pose, reset }).unwrap();
            stage.session.color().unwrap()
        });
        let picture = picture.last().unwrap();
        for ([x, _], red) in reds(&picture).filter(|_| frame >= WARM) {
            if let Some(sum) = x.checked_sub(SPEED * frame).and_then(|x| sums.get_mut(x as usize)) {
                *sum += red / f64::from(STRIP[1] * FRAMES);
            }
        }
    }
    sums
}

/// Of an edge that goes by `way` pixels while the shutter is open, what of each column is covered: a ramp as long as the way,
/// and the square's other edge 40 pixels on. Reconstruction spreads it by a filter, here the one that the picture of an edge at
/// rest tells.
fn smeared(sharp: &[f64], way: f64) -> Vec<f64> {
    const STEPS: u32 = 64;
    let at = |x: f64| {
        let (i, part) = (x.floor(), x - x.floor());
        let of = |i: f64| sharp.get(i.max(0.0) as usize).copied().unwrap_or(0.0);
        of(i) * (1.0 - part) + of(i + 1.0) * part
    };
    let moment = |x: usize, step: u32| at(x as f64 + way * (f64::from(step) + 0.5) / f64::from(STEPS));
    (0..sharp.len()).map(|x| (0..STEPS).map(|step| moment(x, step)).sum::<f64>() / f64::from(STEPS)).collect()
}

fn worst(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The picture of the square at rest, by many samples.
fn at_rest() -> Vec<f64> {
    let base = Settings { size: STRIP, float_output: true, ..Settings::of(Method::Reference) };
    let mut stage = Stage::new(runner(), &Settings { spp: 16, ..base });
    let pose = stage.scene.pose(0.0);
    let frame = |stage: &mut Stage| {
        stage.session.frame(&FrameInputs { view: open(0.0), pose: &pose, reset: false }).unwrap();
    };
    (0..32).for_each(|_| frame(&mut stage));
    let picture = stage.session.color().unwrap();
    let mut sums = vec![0.0; 64];
    for ([x, _], red) in reds(&picture).filter(|([x, _], _)| *x < 64) {
        sums[x as usize] += red / f64::from(STRIP[1]);
    }
    sums
}

/// Five standard deviations of a column that is the mean of so many samples, each of which is covered or not: 1/2 at most.
/// Linear interpolation of a picture whose slope goes from 0 to 1/2 leaves 1/2 / 12 a pixel of way.
fn allowed(samples: u32, way: f64) -> f64 {
    5.0 * 0.5 / f64::from(samples).sqrt() + 0.5 / 12.0 / way
}

/// The smear of a moving edge is the ramp that it has to be, as long as the shutter is open: and neither that of half the time,
/// nor the edge itself.
#[test]
fn the_smear_of_an_edge_is_a_ramp() {
    let sharp = at_rest();
    // A whole pixel on either side of the edges is all black or all white, and the edge in the middle of a filter is a half.
    assert!(worst(&sharp[..10], &[0.0; 10]) < 1e-6 && worst(&sharp[15..48], &[1.0; 33]) < 1e-6);
    for method in [Method::Reference, Method::Supersample] {
        for shutter in [1.0, 0.5] {
            let base = Settings { size: STRIP, float_output: true, jitter: true, ..Settings::of(method) };
            let way = |shutter: f64| f64::from(SPEED) * shutter;
            let found = profile(&Settings { spp: 8, ..base }, shutter);
            let off = worst(&found, &smeared(&sharp, way(shutter)));
            let allowed = allowed(STRIP[1] * FRAMES * 8, way(shutter));
            let others = [worst(&found, &smeared(&sharp, way(0.5 * shutter))), worst(&found, &sharp)];
            println!("{} {shutter}: {off:.3} of {allowed:.3}, others {others:.3?}", method.name());
            assert!(off < allowed, "{} {shutter}: {off} {allowed}\n{found:.3?}", method.name());
            assert!(others.iter().all(|other| *other > 1.5 * allowed), "{others:?} of {allowed}");
        }
    }
}

/// Samples that are kept make the same ramp of the edge that goes ahead. Behind, where a background without samples is
/// uncovered for a part of the time, what is in front weighs too much, as beside all that is uncovered: the smear comes out
/// between the ramp and its whole length.
#[test]
fn the_smear_of_samples_that_are_kept_is_a_ramp_ahead() {
    const MIDDLE: usize = 30;
    let sharp = at_rest();
    for (what, hold) in [("held", Hold::Sample), ("drawn anew", Hold::Frame)] {
        for shutter in [1.0, 0.5] {
            let way = f64::from(SPEED) * shutter;
            let found = profile(
                &Settings { size: STRIP, float_output: true, density: 8.0, hold, ..Settings::default() },
                shutter,
            );
            let ramp = smeared(&sharp, way);
            // What is held is the same in all frames.
            let allowed = allowed(STRIP[1] * 8 * if hold == Hold::Frame { FRAMES } else { 1 }, way);
            let ahead = worst(&found[MIDDLE..], &ramp[MIDDLE..]);
            let sharp_ahead = worst(&found[MIDDLE..], &sharp[MIDDLE..]);
            let behind = found.iter().zip(&ramp).take(MIDDLE).map(|(found, ramp)| found - ramp);
            let wider: f64 = behind.clone().sum();
            println!(
                "{what} {shutter}: {ahead:.3} of {allowed:.3}, sharp {sharp_ahead:.3}; behind {wider:.2} pixels wider"
            );
            assert!(ahead < allowed && sharp_ahead > 1.5 * allowed, "{what} {shutter}: {ahead} {allowed}\n{found:.3?}");
            assert!(
                behind.fold(0.0, f64::min) > -allowed && wider < 0.5 * way,
                "{what} {shutter}: {wider}\n{found:.3?}"
            );
        }
    }
}

const SIZE: [u32; 2] = [48, 36];

/// Two squares, of which the front one hides a part of the other.
fn squares() -> Build {
    let at = |x: f64, y: f64, z: f64| trs(DVec3::new(x, y, z), DQuat::IDENTITY, 0.4);
    Build::new(0.1).square(paint(0.5), at(0.1, 0.1, -4.5)).square(paint(1.0), at(-0.1, 0.0, -4.0))
}

/// Its second square, placed at the origin of its node, takes on a shape.
fn bending() -> Scene {
    let mut scene = squares().camera(&open(1.0));
    let positions = vec![Vec3::new(0.6, 0.2, 0.0), Vec3::new(-0.5, 0.4, 0.3), Vec3::new(0.2, -0.7, 0.0), Vec3::ZERO];
    scene.meshes[1].morph_targets = vec![MorphTarget { positions, ..MorphTarget::default() }];
    scene.deformers = vec![Deformer { instance: 1, skin: None, weights: vec![0.0] }];
    scene
}

/// Where everything is at a part of the way from one frame to the next.
type Way<'a> = &'a dyn Fn(f64) -> (View, Pose);

/// Reds of pictures of one scene, each with samples of its own.
struct Studio(Stage);

impl Studio {
    fn new(scene: &Scene, gloss: f32) -> Self {
        let base = Settings { size: SIZE, spp: 8, gloss, float_output: true, jitter: true, ..Settings::default() };
        Self(Stage::new(scene.clone(), &Settings { method: Method::Supersample, ..base }))
    }

    fn picture(&mut self, (view, pose): &(View, Pose), shutter: f64) -> Vec<f64> {
        let view = View { shutter, ..*view };
        self.0.session.frame(&FrameInputs { view, pose, reset: false }).unwrap();
        reds(&self.0.session.color().unwrap()).map(|(_, red)| red).collect()
    }

    fn blurred(&mut self, at: Way<'_>, shutter: f64) -> Vec<f64> {
        let one = |_| {
            self.picture(&at(0.0), 0.0);
            self.picture(&at(1.0), shutter)
        };
        mean(&(0..4).map(one).collect::<Vec<_>>())
    }

    /// Without blur, a moment out of each sixteenth of the time that the shutter is open.
    fn moments(&mut self, at: Way<'_>, shutter: f64, h: &mut u32) -> Vec<f64> {
        let moments = (0..16).map(|moment| {
            *h = hash_uint(*h);
            let time = 1.0 - shutter * (f64::from(moment) + f64::from(unit_float(*h))) / 16.0;
            self.picture(&at(time), 0.0)
        });
        mean(&moments.collect::<Vec<_>>())
    }
}

fn mean(pictures: &[Vec<f64>]) -> Vec<f64> {
    let of = |i: usize| pictures.iter().map(|p| p[i]).sum::<f64>() / pictures.len() as f64;
    (0..pictures[0].len()).map(of).collect()
}

/// Variance of the mean of some pictures, in the mean of all pixels.
fn variance(pictures: &[Vec<f64>]) -> f64 {
    let mean = mean(pictures);
    let sum: f64 = pictures.iter().map(|p| difference(p, &mean).powi(2)).sum();
    sum / ((pictures.len() - 1) * pictures.len()) as f64
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
}

/// The blurred picture is the mean of sharp ones of moments along the way, as `at` has them; and not of those of half the time,
/// nor that of the end.
fn is_the_mean(name: &str, scene: &Scene, gloss: f32, at: Way<'_>) {
    const TRIALS: usize = 8;
    let (mut studio, mut h) = (Studio::new(scene, gloss), 7);
    for shutter in [1.0, 0.5] {
        let blurred: Vec<_> = (0..TRIALS).map(|_| studio.blurred(at, shutter)).collect();
        let moments: Vec<_> = (0..TRIALS).map(|_| studio.moments(at, shutter, &mut h)).collect();
        let half = studio.moments(at, 0.5 * shutter, &mut h);
        let end = studio.picture(&at(1.0), 0.0);
        let seen = mean(&blurred);
        // Both are unbiased, and their variances measured, with 7 degrees of freedom each. If all pixels were off together, the
        // square of the difference over its variance would have Fisher's distribution with 1 and 14: 17.1 at 99.9 %.
        let allowed = (17.1 * (variance(&blurred) + variance(&moments))).sqrt();
        let off = difference(&seen, &mean(&moments));
        let [half, end] = [difference(&seen, &half), difference(&seen, &end)];
        println!("{name}, {shutter}: {off:.4} of {allowed:.4}; of half the time {half:.4}, of its end {end:.4}");
        assert!(off < allowed, "{name} {shutter}: {off} {allowed}");
        assert!(end > 1.5 * allowed && (shutter < 1.0 || half > 1.5 * allowed), "{name}: {allowed} {half} {end}");
    }
}

#[test]
fn a_turning_mesh_is_the_mean_of_its_moments() {
    let scene = squares().camera(&open(1.0));
    let place = |angle: f64, x: f64| {
        let turn = DMat3::from_rotation_y(angle) * DMat3::from_rotation_z(2.0 * angle);
        DAffine3 { matrix3: turn * 0.5, translation: DVec3::new(x, 0.0, -4.0) }
    };
    let (before, now) = (place(0.0, -0.2), place(0.35, 0.15));
    let at = |time: f64| {
        let mut pose = scene.pose(0.0);
        // What the paper has: entries between those of both frames.
        pose.instances[1] = DAffine3 {
            matrix3: before.matrix3 * (1.0 - time) + now.matrix3 * time,
            translation: before.translation.lerp(now.translation, time),
        };
        (ahead(), pose)
    };
    is_the_mean("turning", &scene, 0.0, &at);
}

#[test]
fn a_shape_that_bends_is_the_mean_of_its_moments() {
    let scene = bending();
    let at = |time: f64| {
        let mut pose = scene.pose(0.0);
        pose.deformations[0].weights[0] = time;
        pose.instances[1].translation.x += 0.2 * time;
        (ahead(), pose)
    };
    is_the_mean("bending", &scene, 0.0, &at);
}

#[test]
fn a_moving_camera_sees_the_mean_of_its_moments() {
    let scene = squares().camera(&open(1.0));
    let pose = scene.pose(0.0);
    let slide = |time: f64| (View { position: DVec3::new(0.3, 0.1, -0.4) * time, ..ahead() }, pose.clone());
    is_the_mean("camera sliding", &scene, 0.0, &slide);
    // Seven degrees: linear in the axes is linear in the angle, but for its cube.
    let turn = |time: f64| DQuat::from_rotation_y(0.12 * time) * DQuat::from_rotation_x(-0.04 * time);
    is_the_mean("camera turning", &scene, 0.0, &|time| (View { rotation: turn(time), ..ahead() }, pose.clone()));
    let zoom = |time: f64| (View { yfov: 2.0 * (0.25 - 0.06 * time).atan(), ..ahead() }, pose.clone());
    is_the_mean("camera zooming", &scene, 0.0, &zoom);
}

/// A lamp that travels with the camera lights what it lit, and one that stays behind does not follow.
#[test]
fn shadows_stay_where_they_are_under_a_moving_camera() {
    let grey = material(Vec4::new(0.6, 0.6, 0.6, 1.0), 0.0, 1.0);
    let wall = trs(DVec3::new(0.0, 0.0, -5.0), DQuat::IDENTITY, 3.0);
    let blind = trs(DVec3::new(0.0, 0.0, -4.0), DQuat::IDENTITY, 0.3);
    let kind = stillray::scene::LightKind::Point;
    let scene = Build::new(0.0)
        .square(grey.clone(), wall)
        .square(grey, blind)
        .light(kind, DVec3::new(1.0, 1.0, -2.0), DVec3::NEG_Z, 8.0)
        .camera(&open(1.0));
    let pose = scene.pose(0.0);
    let at = |time: f64| (View { position: DVec3::new(0.4, 0.0, 0.0) * time, ..ahead() }, pose.clone());
    is_the_mean("shadows, camera sliding", &scene, 0.0, &at);
}

fn frames(scene: &Scene, settings: &Settings, shutter: f64, times: &[f64]) -> Vec<Vec<f32>> {
    let mut stage = Stage::new(scene.clone(), settings);
    let one = |time: &f64| {
        // A method that accumulates renders a picture from each reset on.
        let (pose, reset) = (stage.scene.pose(*time), settings.method.accumulates());
        stage.session.frame(&FrameInputs { view: open(shutter), pose: &pose, reset }).unwrap();
        stage.session.color().unwrap().data
    };
    times.iter().map(one).collect()
}

/// With the shutter closed what is modelled for it changes nothing, to the bit; where nothing moves, an open one does not either;
/// and what has come to rest stays as it is.
#[test]
fn a_shutter_without_motion_changes_nothing() {
    let times: Vec<f64> = (0..6).map(|i| f64::from(i) * 0.25).collect();
    for method in Method::ALL {
        let base = Settings { size: [96, 16], density: 2.0, spp: 2, ..Settings::of(*method) };
        let mut sharp = runner();
        sharp.cameras[0].shutter = 0.0;
        let plain = frames(&sharp, &base, 0.0, &times);
        let all = Settings { modelling: Modelling::All, ..base.clone() };
        assert!(plain == frames(&sharp, &all, 0.0, &times), "{}", method.name());
        assert!(plain == frames(&runner(), &base, 0.0, &times), "{}", method.name());
        assert!(plain != frames(&runner(), &base, 1.0, &times), "the comparison can fail: {}", method.name());
        let still = [0.5; 5];
        assert!(frames(&sharp, &base, 0.0, &still) == frames(&runner(), &base, 1.0, &still), "{}", method.name());
        if method.keeps_samples() && method.name() == "stable" {
            let stopping = frames(&runner(), &base, 1.0, &[0.0, 0.25, 0.5, 0.5, 0.5, 0.5, 0.5]);
            assert!(stopping[4] == stopping[5] && stopping[5] == stopping[6] && stopping[1] != stopping[2]);
        }
    }
}

/// A mirror shows what moves before it as it is seen itself, and light falls between where it is and was.
#[test]
fn what_moves_is_blurred_in_mirrors_and_in_its_shadow() {
    let mirror = Material { double_sided: true, ..material(Vec4::ONE, 1.0, 0.0) };
    let wall = trs(DVec3::new(0.0, 0.0, -5.0), DQuat::from_rotation_y(0.5), 1.2);
    let scene = Build::new(0.1)
        .square(mirror, wall)
        .square(paint(1.0), trs(DVec3::new(2.0, 0.0, -3.0), DQuat::from_rotation_y(1.0), 0.5))
        .camera(&open(1.0));
    let pose = scene.pose(0.0);
    let moved = |time: f64, from: DVec3| {
        let mut pose = pose.clone();
        pose.instances[1].translation += from * time;
        (ahead(), pose)
    };
    is_the_mean("mirrored", &scene, 1.0, &|time| moved(time, DVec3::new(0.0, 0.6, -0.4)));
    let grey = Material { double_sided: true, ..material(Vec4::new(0.6, 0.6, 0.6, 1.0), 0.0, 1.0) };
    let scene = Build::new(0.0)
        .square(grey.clone(), trs(DVec3::new(0.0, 0.0, -5.0), DQuat::IDENTITY, 3.0))
        .square(grey, trs(DVec3::new(1.2, 1.0, -3.0), DQuat::IDENTITY, 0.3))
        .light(stillray::scene::LightKind::Point, DVec3::new(2.0, 1.6, -1.0), DVec3::NEG_Z, 12.0)
        .camera(&open(1.0));
    let pose = scene.pose(0.0);
    let at = |time: f64| {
        let mut pose = pose.clone();
        pose.instances[1].translation.x -= 0.5 * time;
        pose.lights[0].position.y -= 0.2 * time;
        (ahead(), pose)
    };
    is_the_mean("its shadow", &scene, 0.0, &at);
}

/// Samples go on being used on what moves, as many as without blur.
#[test]
fn samples_stay_on_what_is_blurred() {
    let scene = stillray::scene::builtin::load("billiards?rings=12", 0).unwrap();
    let reused = |shutter: f64| {
        let settings = Settings { size: [96, 72], density: 2.0, ..Settings::default() };
        let mut stage = Stage::new(scene.clone(), &settings);
        let frame = |i: u32| {
            let pose = stage.scene.pose(0.1 + f64::from(i) / 60.0);
            let view = View { shutter, ..pose.cameras[0] };
            stage.session.frame(&FrameInputs { view, pose: &pose, reset: false }).unwrap().reused_fraction()
        };
        (0..6).map(frame).collect::<Vec<_>>()
    };
    let [blurred, sharp] = [0.5, 0.0].map(reused);
    println!("{blurred:.4?} {sharp:.4?}");
    assert!(blurred[0] == 0.0 && blurred[1..].iter().all(|x| *x > 0.97), "{blurred:?}");
    // Of some 14,000 rays a hundredth are new ones: a standard deviation of 0.0009, five times for each of two.
    assert!(blurred.iter().zip(&sharp).all(|(b, s)| (b - s).abs() < 0.01), "{blurred:?} {sharp:?}");
}

/// Scales from 1e-5 to 1e5, turns by half a turn, mirrors and what has no inverse half-way or before: finite, and clean.
#[test]
fn extreme_motion_is_finite() {
    let device = Device::with_options(&ContextOptions { device: None, validation: true }).unwrap();
    let scene = bending();
    let loaded = LoadedScene::new(&device, &scene, &Quiet).unwrap();
    let place = |scale: DVec3, turn: f64, at: DVec3| {
        DAffine3::from_scale_rotation_translation(scale, DQuat::from_rotation_y(turn), at)
    };
    let here = DVec3::new(0.0, 0.0, -4.0);
    let mut places = vec![
        place(DVec3::ONE, 0.0, here),
        place(DVec3::new(-1.0, 1.0, 1.0), 0.0, here),
        place(DVec3::NEG_ONE, 0.0, here),
        place(DVec3::ONE, std::f64::consts::PI, here),
        place(DVec3::ZERO, 0.0, here),
        place(DVec3::new(1.0, 0.0, 1.0), 0.3, here),
        place(DVec3::new(1e5, 1e-5, 1.0), 0.3, here),
        place(DVec3::ONE, 0.3, DVec3::new(1e30, 0.0, 0.0)),
        place(DVec3::splat(1e-30), 0.3, here),
        place(DVec3::splat(1e30), 0.3, here),
        place(DVec3::splat(1e300), 0.3, DVec3::splat(1e300)),
    ];
    for scale in [1e-5, 1e-3, 1e3, 1e5] {
        places.extend([place(DVec3::splat(scale), 1.0, here), place(DVec3::splat(-scale), 0.0, here * scale)]);
    }
    let turned = View { rotation: DQuat::from_rotation_y(std::f64::consts::PI), yfov: 3.0, ..open(1.0) };
    for method in [Method::Stable, Method::PointTracking, Method::Taa] {
        let settings = Settings { size: [33, 17], spp: 1, density: 2.0, ..Settings::of(method) };
        let mut session = Session::new(&device, &loaded, &settings).unwrap();
        for (i, place) in places.iter().enumerate() {
            for (j, other) in places.iter().enumerate() {
                let mut pose = scene.pose(0.0);
                pose.deformations[0].weights[0] = [0.0, 1.0, -1e5, 1e5][(i + j) % 4];
                (pose.instances[0], pose.instances[1]) = (*place, *other);
                let view = if (i + j) % 5 == 4 { turned } else { open(1.0) };
                session.frame(&FrameInputs { view, pose: &pose, reset: false }).unwrap();
                let picture = session.color().unwrap();
                assert!(picture.data.iter().all(|x| x.is_finite()), "{} from {i}, {j}", method.name());
            }
        }
    }
    support::assert_clean(device.context());
}

#[test]
fn a_shutter_that_is_none_is_refused() {
    let mut stage = Stage::new(runner(), &Settings { size: SIZE, ..Settings::default() });
    let pose = stage.scene.pose(0.0);
    for bad in [-0.1, 1.5, f64::NAN] {
        let inputs = FrameInputs { view: open(bad), pose: &pose, reset: false };
        let message = stage.session.frame(&inputs).unwrap_err().to_string();
        assert!(message.contains("view.shutter") && message.contains("from 0 to 1"), "{message}");
    }
    let mut sharp = runner();
    sharp.cameras[0].shutter = 0.0;
    let mut stage = Stage::new(sharp, &Settings { size: SIZE, ..Settings::default() });
    let inputs = FrameInputs { view: open(0.5), pose: &pose, reset: false };
    let message = stage.session.frame(&inputs).unwrap_err().to_string();
    assert!(message.contains("view.shutter") && message.contains("no camera of the scene"), "{message}");
}
