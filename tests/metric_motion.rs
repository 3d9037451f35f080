//! Flicker is measured along the motion that frames were rendered with: it has to lead to where surfaces were.
#![allow(clippy::unwrap_used)] // a panic in a test's helper is a failing test
mod support;

use stillray::metric::flicker::Flicker;
use stillray::metric::image::{Frame, Plane, planar};
use stillray::metric::sequence::{Metric, Options, Sequence, Step};
use stillray::metric::warp::Geometry;
use stillray::renderer::{Aov, FrameInputs, Method, Settings};
use stillray::scene::motion::Motion;
use support::rig::{Rig, load};

const SIZE: [u32; 2] = [64, 48];

/// Flicker of the frames against themselves, with motion that is scaled.
fn changes(rig: &Rig, motion: Motion, scale: f32) -> Flicker {
    let aovs = vec![Aov::Depth, Aov::Motion];
    let mut session = rig.session(&Settings { size: SIZE, spp: 16, aovs, ..Settings::of(Method::Supersample) });
    let pose = rig.scene.pose(0.0);
    let mut sequence = Sequence::new(Options { metrics: vec![Metric::Flicker], ..Options::default() }).unwrap();
    for index in 0..4 {
        let view = rig.view(motion, f64::from(index) / 15.0);
        session.frame(&FrameInputs { view, pose: &pose, reset: index == 0 }).unwrap();
        let vectors = session.aov(Aov::Motion).unwrap();
        let color = session.color().unwrap();
        let frame = Frame::from_linear(SIZE, planar(4, &color.data), 0.0).unwrap();
        let depth = Plane { width: 64, height: 48, data: session.aov(Aov::Depth).unwrap().data };
        let motion = vectors.data.chunks(2).map(|v| [v[0] * scale, v[1] * scale]).collect();
        let geometry = Geometry { motion, depth };
        let step = Step { name: "", frame: &frame, reference: &frame, geometry: Some(&geometry), changes: None };
        sequence.push(&step).unwrap();
    }
    sequence.finish().flicker.unwrap()
}

#[test]
fn along_its_motion_a_rendering_changes_less_than_along_any_other() {
    let rig = Rig::new(load("builtin:terrain"));
    for motion in [Motion::Pan, Motion::Orbit] {
        let right = changes(&rig, motion, 1.0);
        // Equal frames: what is measured is how far they change along the motion.
        assert_eq!((right.flicker_error, right.excess_flicker), (0.0, 0.0));
        assert!(right.valid > 0.9, "{motion:?}: {right:?}");
        for scale in [-1.0, 0.0, 2.0] {
            let wrong = changes(&rig, motion, scale);
            for (right, wrong) in right.lags.iter().zip(&wrong.lags) {
                // Bilinear reading changes the picture by itself, so that the right motion leaves something, too.
                assert!(wrong.reference > 1.2 * right.reference, "{motion:?} times {scale}: {right:?}, {wrong:?}");
            }
        }
    }
    rig.assert_clean();
}
