//! Motion vectors are those of the camera, whatever the method, and over all frames of an accumulated picture.
#![allow(clippy::unwrap_used)] // a panic in a test's helper is a failing test

mod support;

use stillray::oracle::camera;
use stillray::renderer::{Aov, FrameInputs, Method, Settings};
use stillray::scene::View;
use stillray::scene::motion::Motion;
use support::rig::{Rig, load};

const SIZE: [u32; 2] = [64, 48];

/// Where a view that has only turned since `before` sees what is now in the middle of a pixel, in pixels.
fn seen_before(now: &View, before: &View, [x, y]: [u32; 2]) -> [f64; 2] {
    let tangent = (now.yfov * 0.5).tan();
    let [w, h] = SIZE.map(f64::from);
    let ndc = [(f64::from(x) + 0.5) / w * 2.0 - 1.0, 1.0 - (f64::from(y) + 0.5) / h * 2.0];
    let ray = glam::DVec3::new(ndc[0] * tangent * w / h, ndc[1] * tangent, -1.0);
    let p = before.rotation.inverse() * now.rotation * ray;
    [(p.x / -p.z / tangent * h / w * 0.5 + 0.5) * w, (0.5 - p.y / -p.z / tangent * 0.5) * h]
}

/// At 6 samples a pixel none is empty. The largest difference between the motion of the last frame and what the camera did, over pixels away from the border.
fn worst(method: Method, frames: u32, passes: u32) -> f64 {
    let rig = Rig::new(load("builtin:cornell"));
    let mut session =
        rig.session(&Settings { size: SIZE, aovs: vec![Aov::Motion], density: 6.0, ..Settings::of(method) });
    let (pose, view) = (rig.scene.pose(0.0), |f: u32| rig.view(Motion::Rotate, f64::from(f) / 60.0));
    for frame in 0..frames {
        for pass in 0..passes {
            let reset = pass == 0 && (frame == 0 || method.accumulates());
            session.frame(&FrameInputs { view: view(frame), pose: &pose, reset }).unwrap();
        }
    }
    let motion = session.aov(Aov::Motion).unwrap();
    let mut worst = 0.0_f64;
    for [x, y] in camera::pixels_in_order(SIZE).filter(|[x, y]| (8..56).contains(x) && (8..40).contains(y)) {
        let last = seen_before(&view(frames - 1), &view(frames.saturating_sub(2)), [x, y]);
        let expected = [f64::from(x) + 0.5 - last[0], f64::from(y) + 0.5 - last[1]];
        let at = ((y * SIZE[0] + x) * 2) as usize;
        let found = [motion.data[at], motion.data[at + 1]].map(f64::from);
        worst = worst.max((found[0] - expected[0]).hypot(found[1] - expected[1]));
    }
    rig.assert_clean();
    worst
}

#[test]
fn motion_is_the_cameras_and_survives_accumulation() {
    // A sample lies up to 0.71 pixels from the middle of its pixel, where a turn of half a degree a frame moves the image by
    // some 0.02 pixels more or less; halves round at 2^-11 of 1.3 pixels.
    for (method, passes) in
        [(Method::Stable, 1), (Method::Supersample, 1), (Method::Reference, 1), (Method::Reference, 3)]
    {
        let error = worst(method, 3, passes);
        assert!(error < 0.05, "{method:?} in {passes} passes: {error}");
        // Negative control: the first frame has no motion, and the camera does move.
        assert!(worst(method, 1, passes) < 1e-9);
    }
    let moved = seen_before(&load_view(2), &load_view(1), [32, 24]);
    assert!((moved[0] - 32.5).abs() > 0.2, "{moved:?}");
}

fn load_view(frame: u32) -> View {
    Rig::new(load("builtin:cornell")).view(Motion::Rotate, f64::from(frame) / 60.0)
}
