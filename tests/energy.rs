//! Stable frames carry the energy that they should: against converged references, and against analytic answers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test
mod support;

use stillray::renderer::{FrameInputs, Method, Settings};
use stillray::scene::motion::Motion;
use support::rig::{Rig, load, mean};

const FRAMES: u32 = 10;

/// Mean radiance of `stable` over ten frames, and of the reference over the same ten.
fn energies(rig: &Rig, motion: Motion, stable: &Settings, reference_frames: u32) -> (f64, f64) {
    let pose = rig.scene.pose(0.0);
    let mut session = rig.session(stable);
    let settings = Settings { method: Method::Reference, spp: 16, float_output: true, ..stable.clone() };
    let mut reference = rig.session(&settings);
    let (mut ours, mut theirs) = (0.0, 0.0);
    for i in 0..FRAMES {
        rig.frame(&mut session, motion, i);
        ours += mean(&session.color().unwrap());
        let view = rig.view(motion, f64::from(i) / 60.0);
        for j in 0..reference_frames {
            reference.frame(&FrameInputs { view, pose: &pose, reset: j == 0 }).unwrap();
        }
        theirs += mean(&reference.color().unwrap());
    }
    (ours / f64::from(FRAMES), theirs / f64::from(FRAMES))
}

#[test]
fn stable_at_density_four_is_within_one_percent_of_the_reference() {
    for name in ["hairball?strands=300", "spheres", "cornell"] {
        let rig = Rig::new(load(&format!("builtin:{name}")));
        for motion in [Motion::Rotate, Motion::Pan, Motion::Zoom, Motion::Orbit, Motion::Dolly] {
            let settings = Settings { size: [128, 96], density: 4.0, float_output: true, ..Settings::default() };
            let (stable, reference) = energies(&rig, motion, &settings, 2);
            let ratio = stable / reference;
            println!("{name:<22} {motion}: {stable:.6} / {reference:.6} = {ratio:.5}");
            assert!((ratio - 1.0).abs() < 0.01, "{name}, {motion}: {ratio}");
        }
        rig.assert_clean();
    }
}
