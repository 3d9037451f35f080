//! Knobs that change what is traced or read, in whole frames: they reach the picture, and keep what they promise of it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test
mod support;

use glam::DVec3;
use stillray::method::storage::Storage;
use stillray::renderer::{FrameStats, Method, Settings};
use stillray::scene::motion::Motion;
use stillray::scene::{LocalTransform, Node, Scene};
use stillray::settings::{Edges, Filter};
use support::rig::{Rig, bits, load, mean};

/// Frames of a camera that pans; the last one, and what it took.
fn pan(rig: &Rig, settings: &Settings) -> (Vec<u32>, FrameStats) {
    let mut session = rig.session(&Settings { size: [64, 48], ..settings.clone() });
    let stats = (0..4).map(|i| rig.frame(&mut session, Motion::Pan, i)).last().unwrap();
    (bits(&session.color().unwrap()), stats)
}

#[test]
fn edges_filter_and_shadow_rays_reach_the_picture() {
    let usual = Settings { density: 2.0, ..Settings::default() };
    let turned = [
        ("hairball?strands=200", Settings { edges: Edges::Paper, ..usual.clone() }),
        ("hairball?strands=200", Settings { subpixels: 2, ..usual.clone() }),
        ("text", Settings { texture_filter: Filter::Nearest, ..usual.clone() }),
        ("cornell", Settings { shadow_rays: 0, ..usual.clone() }),
    ];
    for (name, settings) in turned {
        let rig = Rig::new(load(&format!("builtin:{name}")));
        let (before, after) = (pan(&rig, &usual), pan(&rig, &settings));
        assert_ne!(before.0, after.0, "{name}");
        let traced = [before.1.shadow_rays > 0, after.1.shadow_rays > 0];
        assert_eq!(traced, [true, settings.shadow_rays > 0], "{name}");
        // The paper's rule adds and evicts less where surfaces move against each other.
        let changed = |stats: &FrameStats| stats.added + stats.evicted;
        assert!(
            settings.edges != Edges::Paper || changed(&after.1) < changed(&before.1),
            "{:?} {:?}",
            before.1,
            after.1
        );
        rig.assert_clean();
    }
}

#[test]
fn quarter_pixels_hold_four_samples_at_most_and_take_a_quarter_of_the_claims() {
    let rig = Rig::new(load("builtin:spheres"));
    let settings =
        |subpixels| Settings { size: [64, 48], density: 4.0, tolerance: 0.0625, subpixels, ..Settings::default() };
    let mut sessions = [2, 4].map(|subpixels| rig.session(&settings(subpixels)));
    let claims = [2, 4].map(|subpixels| Storage::new(&settings(subpixels), 0).claims);
    assert_eq!(4 * claims[0], claims[1]);
    for i in 0..6 {
        let [coarse, fine] = [0, 1].map(|k| rig.frame(&mut sessions[k], Motion::Orbit, i));
        assert!(coarse.rays <= 4 * 64 * 48 && coarse.histogram[5..].iter().all(|n| *n == 0), "{coarse:?}");
        // Where more than one sample lands on a subpixel, all but one are gone: that is what larger ones cost.
        assert!(i == 0 || fine.histogram[5..].iter().any(|n| *n > 0) && fine.reused > coarse.reused, "{fine:?}");
    }
    let [coarse, fine] = sessions.map(|mut session| mean(&session.color().unwrap()));
    println!("mean radiance {coarse:.5} with 2 x 2, {fine:.5} with 4 x 4");
    // Both are within a percent of the reference on such scenes (tests/energy.rs), so within two of each other.
    assert!((coarse / fine - 1.0).abs() < 0.02, "{coarse} {fine}");
    rig.assert_clean();
}

/// The box with five lamps of different colours, one of them hidden from most of it.
fn lamps() -> Scene {
    let mut scene = load("builtin:cornell");
    let lamp = scene.lights[0].clone();
    let places = [(-2.0, 1.0, 1.0), (2.2, 0.5, 1.5), (0.0, 4.8, -2.0), (-0.9, 0.4, -2.5)];
    for (i, (x, y, z)) in places.into_iter().enumerate() {
        let local = LocalTransform::Trs {
            translation: DVec3::new(x, y, z),
            rotation: glam::DQuat::IDENTITY,
            scale: DVec3::ONE,
        };
        scene.nodes.push(Node { name: "lamp".to_owned(), parent: None, local });
        let mut light = lamp.clone();
        light.node = scene.nodes.len() - 1;
        light.color[i % 3] *= 0.3;
        light.intensity *= 0.5;
        scene.lights.push(light);
    }
    scene
}

#[test]
fn few_shadow_rays_are_right_on_average() {
    const SEEDS: u32 = 8;
    let rig = Rig::new(lamps());
    let render = |shadow_rays: u32, seed: u32| {
        let base = Settings { size: [64, 48], spp: 16, float_output: true, ..Settings::of(Method::Supersample) };
        let mut session = rig.session(&Settings { shadow_rays, seed, ..base });
        let stats = rig.frame(&mut session, Motion::Static, 0);
        (mean(&session.color().unwrap()), stats.shadow_rays)
    };
    for rays in [1, 2] {
        // The same positions under the same seed: what differs is the choice of lights.
        let ratios: Vec<f64> = (0..SEEDS).map(|seed| render(rays, seed).0 / render(32, seed).0).collect();
        let count = f64::from(SEEDS);
        let average = ratios.iter().sum::<f64>() / count;
        let variance = ratios.iter().map(|r| (r - average).powi(2)).sum::<f64>() / (count - 1.0);
        let error = (variance / count).sqrt();
        println!("{rays} of 5 lights: {average:.5} +- {error:.5} of the light");
        // Student's t with 7 degrees of freedom is beyond 7.9 once in 10,000.
        assert!((average - 1.0).abs() < 7.9 * error, "{rays} rays: {average} +- {error}");
        // Negative control: a weight that is a twentieth off would be seen, and one that is left out most of all.
        assert!(7.9 * error < 0.05, "{error}");
        let (traced, all) = (f64::from(render(rays, 0).1), f64::from(render(32, 0).1));
        // As many of five; the deviation of a share of 5 x 49152 chances is 0.001 at most, and those of a pixel
        // are alike.
        assert!((traced / all - f64::from(rays) / 5.0).abs() < 0.02, "{traced} of {all} rays");
    }
    rig.assert_clean();
}
