//! Samples are reused: how many, how they fall on pixels, and that the counts add up.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test
mod support;

use stillray::gpu::ContextOptions;
use stillray::headless::{Device, LoadedScene, Session};
use stillray::progress::Quiet;
use stillray::renderer::{Fill, FrameInputs, FrameStats, Settings};
use stillray::scene::Scene;
use stillray::scene::motion::Motion;
use support::rig::{Rig, load, shared_scene};

const SIZE: [u32; 2] = [160, 120];
const PIXELS: u32 = SIZE[0] * SIZE[1];

/// Without the validation layer, which other tests have on and which takes most of the time.
fn rig(scene: Scene) -> Rig {
    let device = Device::with_options(&ContextOptions { device: None, validation: false }).unwrap();
    let loaded = LoadedScene::new(&device, &scene, &Quiet).unwrap();
    Rig { device, scene, loaded }
}

fn hairball() -> Rig {
    rig(load("builtin:hairball?strands=300"))
}

fn settings(density: f32, tolerance: f32) -> Settings {
    Settings { size: SIZE, density, tolerance, ..Settings::default() }
}

/// What holds in any frame.
fn assert_adds_up(stats: &FrameStats, fill: Fill) {
    assert_eq!(stats.histogram.iter().sum::<u32>(), PIXELS, "every pixel is in the histogram once: {stats:?}");
    assert_eq!(stats.reused + stats.added - stats.thinned, stats.rays, "{stats:?}");
    // With a fill, what is evicted has been traced.
    let forgotten = if fill == Fill::Edge { stats.evicted } else { 0 };
    assert_eq!(stats.shaded + forgotten + stats.occluded + stats.lost - stats.replaced, stats.rays, "{stats:?}");
    // Reprojected samples that were visible are kept or evicted; what is kept beside them was occluded.
    let visible: u32 = stats.histogram.iter().zip(0..).map(|(pixels, samples)| pixels * samples).sum();
    assert!(stats.evicted <= visible && visible <= stats.reused + stats.evicted, "{stats:?}");
    assert!(stats.occluded + stats.lost <= stats.reused && stats.replaced <= stats.occluded, "{stats:?}");
    assert!((0.0..=1.0).contains(&stats.reused_fraction()), "{stats:?}");
}

/// Frames `0..count` of a motion.
fn frames(rig: &Rig, session: &mut Session, motion: Motion, count: u32) -> Vec<FrameStats> {
    let stats: Vec<FrameStats> = (0..count).map(|i| rig.frame(session, motion, i)).collect();
    let fill = session.renderer().settings().filter_fill;
    stats.iter().for_each(|stats| assert_adds_up(stats, fill));
    stats
}

/// Percentages of pixels with 0, 1, 2 and 3 reprojected samples, over all but the first frame.
fn percentages(frames: &[FrameStats]) -> [f64; 4] {
    let pixels = f64::from(PIXELS) * (frames.len() - 1) as f64;
    [0, 1, 2, 3].map(|i| frames[1..].iter().map(|f| f64::from(f.histogram[i])).sum::<f64>() * 100.0 / pixels)
}

/// Paper 3, Table 1: "Percentage of pixels that have 0 to 4 intersection points reproject to them": 21.9, 58.2, 18.2, 1.6
/// and 0.0 for Hogum, 19.6, 64.7, 14.2, 1.3 and 0.1 for Range-400, 20.6, 60.6, 17.1, 1.6 and 0.0 for Spheres. That
/// method starts every frame with one sample in every pixel. This one lets them drift apart as far as the tolerance goes:
/// its first frame after a cut has the table's distribution, and later ones fewer pixels with exactly one. Were samples to
/// fall on pixels independently of each other, 36.8 % would have one and 36.8 % none (Poisson).
fn assert_like_table_1(rig: &Rig) {
    let stats = frames(rig, &mut rig.session(&settings(1.0, 1.0)), Motion::Rotate, 10);
    let [none, one, two, three] = percentages(&stats);
    println!("{}: {none:.1} {one:.1} {two:.1} {three:.1}", rig.scene.name);
    assert!((52.0..=68.0).contains(&one), "{one} % of the pixels have one sample");
    assert!((15.0..=30.0).contains(&none) && (12.0..=22.0).contains(&two) && three < 3.0, "{none} {two} {three}");
    // Nothing is disoccluded where the camera only turns: new samples are for the frame's border and for drift.
    for frame in &stats[1..] {
        assert!(frame.reused_fraction() > 0.95, "{frame:?}");
        assert!((0.9..=1.1).contains(&(f64::from(frame.rays) / f64::from(PIXELS))), "{frame:?}");
    }
}

#[test]
fn points_fall_on_pixels_as_in_the_table() {
    assert_like_table_1(&hairball());
    if let Some(path) = shared_scene("Sponza/Sponza.gltf") {
        assert_like_table_1(&rig(load(&path)));
    }
}

#[test]
fn other_densities_are_not_like_the_table() {
    let rig = hairball();
    let dense = frames(&rig, &mut rig.session(&settings(4.0, 1.0)), Motion::Rotate, 4);
    let [none, one, ..] = percentages(&dense);
    assert!(one < 10.0 && none < 5.0, "four samples a pixel leave few with one or none: {one}, {none}");
    let strict = frames(&rig, &mut rig.session(&settings(1.0, 0.0625)), Motion::Rotate, 4);
    let loose = frames(&rig, &mut rig.session(&settings(1.0, 1.0)), Motion::Rotate, 4);
    assert!(strict[3].reused_fraction() + 0.05 < loose[3].reused_fraction(), "a narrow tolerance costs reuse");
}

#[test]
fn every_motion_reuses_most_and_adds_up() {
    let rig = hairball();
    for (motion, filter_fill) in Motion::ALL.into_iter().flat_map(|m| Fill::ALL.iter().map(move |f| (m, *f))) {
        let settings = Settings { filter_fill, ..settings(4.0, 1.0) };
        let stats = frames(&rig, &mut rig.session(&settings), motion, 4);
        assert_eq!(stats[0].reused, 0);
        assert!(stats[3].reused_fraction() > 0.85, "{motion}: {:?}", stats[3]);
    }
    // Sixteen samples a pixel need one in every subpixel. Samples that move collide there: of n that fall on as many
    // subpixels independently of each other, 1 - 1/e = 0.63 n find one for themselves.
    let stats = frames(&rig, &mut rig.session(&settings(16.0, 0.0625)), Motion::Rotate, 2);
    assert!(stats[1].reused_fraction() > 0.6, "{:?}", stats[1]);
}

#[test]
fn a_camera_that_stands_still_reuses_everything() {
    let rig = hairball();
    for (density, tolerance) in [(1.0, 1.0), (4.0, 0.0625), (0.3, 0.1)] {
        let mut session = rig.session(&settings(density, tolerance));
        let moving = frames(&rig, &mut session, Motion::Orbit, 3);
        assert!(moving[2].added > 0, "a moving one does not");
        let still = frames(&rig, &mut session, Motion::Static, 5);
        for frame in &still[3..] {
            assert_eq!((frame.added, frame.evicted, frame.lost), (0, 0, 0), "{frame:?}");
            assert_eq!((frame.reused, frame.reused_fraction()), (frame.rays, 1.0), "{frame:?}");
        }
    }
}

#[test]
fn a_cut_forgets_everything() {
    let rig = hairball();
    let pose = rig.scene.pose(0.0);
    let mut session = rig.session(&settings(1.0, 1.0));
    frames(&rig, &mut session, Motion::Orbit, 3);
    let mut view = rig.view(Motion::Orbit, 3.0 / 60.0);
    let cut = session.frame(&FrameInputs { view, pose: &pose, reset: true }).unwrap();
    assert_adds_up(&cut, Fill::Edge);
    assert_eq!((cut.reused, cut.evicted, cut.histogram[0]), (0, 0, PIXELS));
    assert!(cut.added >= PIXELS, "the frame is filled at once: {cut:?}");
    // Without a reset, a view into another direction finds nothing that it could reuse either, and fills the frame as well.
    view.rotation *= glam::DQuat::from_rotation_y(2.0);
    let turned = session.frame(&FrameInputs { view, pose: &pose, reset: false }).unwrap();
    assert_adds_up(&turned, Fill::Edge);
    assert_eq!((turned.reused, turned.histogram[0]), (0, PIXELS));
    assert!(turned.added >= PIXELS);
    let after = session.frame(&FrameInputs { view, pose: &pose, reset: false }).unwrap();
    assert!(after.reused_fraction() > 0.99, "and goes on from there: {after:?}");
}
