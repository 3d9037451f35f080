//! The papers' figures: samples lie where the frame's counts say, and the pictures that the Markdown names are there.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a panic is a failing test
mod support;

use std::fs;
use std::path::Path;
use stillray::progress::Quiet;
use stillray::renderer::{Fill, Method, Settings};
use stillray::reproduce::coherence::{self, coherence};
use stillray::reproduce::figures::{Figures, distributions, samplers, thickening};
use stillray::reproduce::phases;
use stillray::samples::SampleKind;
use stillray::scene::motion::Motion;
use stillray::scene::shot::Shot;
use stillray::trade::studio::Studio;
use support::rig::{Rig, load};

const SIZE: [u32; 2] = [64, 64];

fn studio_of<'a>(rig: &'a Rig, shot: &'a Shot) -> Studio<'a> {
    Studio { device: &rig.device, loaded: &rig.loaded, scene: &rig.scene, shot, fps: 60.0 }
}

#[test]
fn samples_are_as_many_as_the_frame_counts() {
    let rig = Rig::new(load("builtin:strands"));
    let stable = Settings { size: SIZE, density: 2.0, ..Settings::default() };
    let supersample = Settings { spp: 2, ..Settings { size: SIZE, ..Settings::of(Method::Supersample) } };
    for settings in [Settings { filter_fill: Fill::None, ..stable.clone() }, stable, supersample] {
        let mut session = rig.session(&settings);
        assert_eq!(session.samples().unwrap(), [], "before the first frame");
        let frames = (0..4).map(|i| rig.frame(&mut session, Motion::Pan, i));
        let stats = frames.last().unwrap();
        let samples = session.samples().unwrap();
        let seen = samples.iter().filter(|s| s.kind != SampleKind::Occluded).count() as u32;
        let hidden = samples.len() as u32 - seen;
        // A visible one may lie past the frame's border by rounding, and hidden ones are kept as they were found.
        assert!(seen.abs_diff(stats.shaded) <= 2, "{seen} of {}", stats.shaded);
        if settings.method == Method::Stable {
            assert!(hidden > 0 && hidden <= stats.occluded, "{hidden} of {}", stats.occluded);
            assert!(samples.iter().any(|s| s.kind == SampleKind::Surface));
        } else {
            assert_eq!(hidden, 0);
        }
        assert!(samples.iter().all(|s| s.at.iter().zip(SIZE).all(|(at, side)| (0.0..=side as f32).contains(at))));
    }
    rig.assert_clean();
}

/// The files that Markdown names.
fn named(markdown: &str) -> Vec<&str> {
    markdown.split("](").skip(1).filter_map(|rest| rest.split(')').next()).collect()
}

fn figure(rig: &Rig, folder: &Path, draw: fn(&Figures<'_>) -> stillray::Result<Option<String>>) -> String {
    let shot = Shot::new(&rig.scene, None, Motion::Static).unwrap();
    let (studio, out) = (studio_of(rig, &shot), folder.join("figures"));
    fs::create_dir_all(&out).unwrap();
    let of = |stop: &dyn Fn() -> bool| {
        draw(&Figures { studio, scene: "builtin:thing", size: SIZE, folder: &out, progress: &Quiet, stop }).unwrap()
    };
    assert_eq!(of(&|| true), None, "who stops gets no figure");
    of(&|| false).unwrap()
}

#[test]
fn figures_are_drawn_and_named() {
    let rig = Rig::new(load("builtin:strands"));
    let dir = tempfile::tempdir().unwrap();
    let drawn = [figure(&rig, dir.path(), distributions), figure(&rig, dir.path(), thickening)];
    for (markdown, count) in drawn.iter().zip([4, 3]) {
        assert_eq!(named(markdown).len(), count, "{markdown}");
        for file in named(markdown) {
            let bytes = fs::read(dir.path().join(file)).unwrap();
            assert!(bytes.starts_with(if file.ends_with("svg") { b"<svg" } else { b"\x89PNG" }), "{file}");
        }
    }
    // Strands over nothing: both kinds of samples are there, and the drawing without samples has none.
    let text = |name: &str| fs::read_to_string(dir.path().join("figures").join(name)).unwrap();
    assert!(text("thing-10-before.svg").contains("#ffd21e") && text("thing-10-before.svg").contains("#2b6cff"));
    assert!(!text("thing-10-converged.svg").contains("<circle"));
    rig.assert_clean();
}

#[test]
fn every_strategy_is_drawn_with_both_tilings() {
    let rig = Rig::new(load("builtin:penumbra"));
    let dir = tempfile::tempdir().unwrap();
    let markdown = figure(&rig, dir.path(), samplers);
    assert_eq!(named(&markdown).len(), 16, "{markdown}");
    let error = |strategy: &str| -> f64 {
        let line = markdown.lines().find(|line| line.starts_with(&format!("| {strategy} "))).unwrap();
        line.split('|').nth(3).unwrap().trim().parse().unwrap()
    };
    let errors = ["sobol", "sudoku", "random"].map(error);
    assert!(errors.iter().all(|e| *e > 0.0) && errors[0] < errors[2], "{markdown}");
    rig.assert_clean();
}

#[test]
fn what_rays_cost_is_drawn_over_what_makes_them_incoherent() {
    let rig = Rig::new(load(coherence::SCENE));
    let dir = tempfile::tempdir().unwrap();
    let markdown = figure(&rig, dir.path(), coherence);
    assert_eq!(
        named(&markdown),
        ["figures/thing-17.svg", "figures/thing-18.svg", "figures/thing-19.svg", "figures/thing-20.svg"]
    );
    assert!(named(&markdown).iter().all(|file| fs::read(dir.path().join(file)).unwrap().starts_with(b"<svg")));
    // Larger luminaires change shadow rays and nothing else, at any size of picture.
    let claim = markdown.lines().find(|line| line.contains("larger luminaires only affect shadow rays")).unwrap();
    assert!(claim.ends_with("| the same | yes |"), "{claim}");
    rig.assert_clean();
}

#[test]
fn phases_are_timed_in_the_papers_columns() {
    let rig = Rig::new(load("builtin:strands"));
    let shot = Shot::new(&rig.scene, None, Motion::Static).unwrap();
    let [stable, supersample] = phases::measure(&studio_of(&rig, &shot), SIZE, &Quiet, &|| false).unwrap().unwrap();
    for (own, other) in stable.iter().zip(&supersample) {
        assert!(own.reprojection > 0.0 && own.analysis > 0.0 && own.shading > 0.0 && own.reconstruction > 0.0);
        assert!(other.reprojection == 0.0 && other.analysis == 0.0 && other.shading > 0.0 && other.total() > 0.0);
    }
    assert!(phases::measure(&studio_of(&rig, &shot), SIZE, &Quiet, &|| true).unwrap().is_none());
}
