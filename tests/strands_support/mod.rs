//! Frames of `builtin:strands` against their exact coverage, filtered as the frames are.
#![allow(clippy::unwrap_used)] // a panic in a test's helper is a failing test

use crate::support::rig::{Rig, load};
use glam::{DVec2, DVec3};
use std::fmt;
use stillray::gpu::ContextOptions;
use stillray::headless::{Device, LoadedScene};
use stillray::progress::Quiet;
use stillray::renderer::Settings;
use stillray::scene::View;
use stillray::scene::builtin::strands_coverage;
use stillray::scene::motion::Motion;

/// Without the validation layer, which takes most of the time.
pub fn rig() -> Rig {
    let scene = load("builtin:strands");
    let device = Device::with_options(&ContextOptions { device: None, validation: false }).unwrap();
    let loaded = LoadedScene::new(&device, &scene, &Quiet).unwrap();
    Rig { device, scene, loaded }
}

/// Cells a pixel, across and down, on which coverage is exact.
const CELLS: u32 = 8;

/// The filter's standard deviation in pixels: the default.
const DEVIATION: f64 = 0.5;

/// What frames of a motion have to show, at 60 frames a second.
pub struct Truth {
    pub motion: Motion,
    pub size: [u32; 2],
    views: Vec<View>,
    images: Vec<Vec<f64>>,
}

impl Truth {
    pub fn new(rig: &Rig, motion: Motion, size: [u32; 2], frames: u32) -> Self {
        let views: Vec<View> = (0..frames).map(|i| rig.view(motion, f64::from(i) / 60.0)).collect();
        let image = |view: &View| filtered(&strands_coverage(&rig.scene, view, size.map(|n| n * CELLS)), size);
        let images = views.iter().map(image).collect();
        Self { motion, size, views, images }
    }

    /// The frame that a method's picture is compared with.
    pub fn image(&self, frame: usize) -> &[f64] {
        &self.images[frame]
    }
}

/// The weighted mean of cells around a pixel along one axis: the truncated Gaussian over three pixels, clipped to the frame.
fn filter_axis(weights: &[f64], pixel: u32, count: u32, cell: impl Fn(u32) -> f64) -> f64 {
    let first = i64::from(pixel) * i64::from(CELLS) - i64::from(CELLS);
    let (mut sum, mut total) = (0.0, 0.0);
    for (at, weight) in (first..).zip(weights) {
        if (0..i64::from(count)).contains(&at) {
            sum += weight * cell(at as u32);
            total += weight;
        }
    }
    sum / total
}

/// Coverage through the filter that frames are made with. The Gaussian is taken at the middles of cells, which widens it by
/// a cell's own variance, 1/12 of 1/64 of a pixel squared: by half a percent of its variance.
fn filtered(cells: &[f32], [width, height]: [u32; 2]) -> Vec<f64> {
    let weight = |i: u32| {
        let d = (f64::from(i) + 0.5) / f64::from(CELLS) - 1.5;
        (-d * d / (2.0 * DEVIATION * DEVIATION)).exp()
    };
    let weights: Vec<f64> = (0..3 * CELLS).map(weight).collect();
    let (across, down) = (width * CELLS, height * CELLS);
    let mut rows = Vec::with_capacity((width * down) as usize);
    for row in cells.chunks(across as usize) {
        let empty = row.iter().all(|c| *c == 0.0);
        let mean = |x| if empty { 0.0 } else { filter_axis(&weights, x, across, |i| f64::from(row[i as usize])) };
        rows.extend((0..width).map(mean));
    }
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    pixels.map(|(x, y)| filter_axis(&weights, y, down, |i| rows[(i * width + x) as usize])).collect()
}

/// What frames 1 and on are worth, against [`Truth`], over the pixels near strands.
#[derive(Debug, Clone, Copy, Default)]
pub struct Measured {
    /// Coverage that is shown over that which is there, less one.
    pub bias: f64,
    /// Root of the mean squared error.
    pub rmse: f64,
    /// Root mean square of the error's change from frame to frame, at the same pixel: what exact frames do not have.
    pub flicker: f64,
    /// The same where the strands have moved to.
    pub moved: f64,
    /// Camera rays a pixel.
    pub rays: f64,
    /// Milliseconds of the phase `reconstruct`, and of all.
    pub ms: [f64; 2],
}

impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [reconstruct, all] = self.ms;
        write!(
            f,
            "bias {:+6.1} %  rmse {:.3}  flicker {:.3}  moved {:.3}",
            100.0 * self.bias,
            self.rmse,
            self.flicker,
            self.moved
        )?;
        write!(f, "  rays {:.3}  reconstruct {reconstruct:.1} of {all:.1} ms", self.rays)
    }
}

/// Where a point of the plane z = 0 that is seen at a pixel of one view is seen in another.
fn carried(at: DVec2, from: &View, to: &View, size: [u32; 2]) -> Option<DVec2> {
    let centre = DVec2::new(f64::from(size[0]), f64::from(size[1])) * 0.5;
    let scale = |view: &View| f64::from(size[1]) * 0.5 / (view.yfov * 0.5).tan();
    let local = (at - centre) / scale(from);
    let direction = from.rotation * DVec3::new(local.x, -local.y, -1.0);
    let t = -from.position.z / direction.z;
    let point = from.position + direction * t;
    let seen = to.rotation.inverse() * (point - to.position);
    (t > 0.0 && seen.z < 0.0).then(|| centre + DVec2::new(seen.x, -seen.y) * (scale(to) / -seen.z))
}

fn bilinear(image: &[f64], [width, height]: [u32; 2], at: DVec2) -> Option<f64> {
    let p = at - 0.5;
    let (x, y) = (p.x.floor(), p.y.floor());
    let inside = x >= 0.0 && y >= 0.0 && x + 1.0 < f64::from(width) && y + 1.0 < f64::from(height);
    inside.then(|| {
        let (fx, fy) = (p.x - x, p.y - y);
        let get = |dx: u32, dy: u32| image[((y as u32 + dy) * width + x as u32 + dx) as usize];
        (get(0, 0) * (1.0 - fx) + get(1, 0) * fx) * (1.0 - fy) + (get(0, 1) * (1.0 - fx) + get(1, 1) * fx) * fy
    })
}

/// A mean of squares.
#[derive(Default)]
struct Squares {
    sum: f64,
    count: f64,
}

impl Squares {
    fn add(&mut self, value: f64) {
        self.sum += value * value;
        self.count += 1.0;
    }

    fn root(&self) -> f64 {
        (self.sum / self.count).sqrt()
    }
}

/// Renders all frames of a motion with these settings.
pub fn measure(rig: &Rig, truth: &Truth, settings: &Settings) -> Measured {
    let mut session = rig.session(settings);
    let mut m = Measured::default();
    let (mut excess, mut covered, mut rays) = (0.0, 0.0, 0.0);
    let (mut errors, mut steps, mut moved) = (Squares::default(), Squares::default(), Squares::default());
    let mut last: Option<Vec<f64>> = None;
    let frames = truth.images.len();
    for (i, exact) in truth.images.iter().enumerate() {
        let stats = rig.frame(&mut session, truth.motion, i as u32);
        let image = session.color().unwrap();
        let error: Vec<f64> = image.data.chunks(4).zip(exact).map(|(c, e)| f64::from(c[0]) - e).collect();
        if let Some(last) = &last {
            excess += error.iter().sum::<f64>();
            covered += exact.iter().sum::<f64>();
            rays += f64::from(stats.rays);
            let times = session.phase_times();
            m.ms[0] += times.iter().filter(|t| t.label == "reconstruct").map(|t| t.ms).sum::<f64>();
            m.ms[1] += times.iter().map(|t| t.ms).sum::<f64>();
            for p in (0..error.len()).filter(|p| exact[*p] > 0.0 || error[*p] != 0.0) {
                errors.add(error[p]);
                steps.add(error[p] - last[p]);
                let at = [p as u32 % truth.size[0], p as u32 / truth.size[0]].map(|c| f64::from(c) + 0.5);
                let before = carried(at.into(), &truth.views[i], &truth.views[i - 1], truth.size);
                if let Some(before) = before.and_then(|at| bilinear(last, truth.size, at)) {
                    moved.add(error[p] - before);
                }
            }
        }
        last = Some(error);
    }
    let count = (frames - 1) as f64;
    Measured {
        bias: excess / covered,
        rmse: errors.root(),
        flicker: steps.root(),
        moved: moved.root(),
        rays: rays / count / f64::from(truth.size[0] * truth.size[1]),
        ms: m.ms.map(|ms| ms / count),
    }
}
