//! Tries a candidate: renders it beside its reference and measures.

use super::candidate::Candidate;
use super::halving::Verdict;
use super::pareto::Estimate;
use super::reference::Still;
use super::store::{Quality, Run};
use super::studio::Studio;
use crate::Result;
use crate::metric::image::{Frame, Plane};
use crate::metric::sequence::{Metric, Options, Report, Sequence, Step};
use crate::renderer::FrameStats;
use crate::report::bench::reprojected_shares;
use crate::report::statistics::{Summary, mean};
use crate::scene::motion::Motion;
use crate::settings::Settings;
use crate::settings::knob::KNOBS;

/// Frames that are rendered before the first that is measured: a cache that begins empty has settled by then.
pub const WARM_UP: u32 = 4;

/// How much a candidate is tried on.
#[derive(Debug, Clone, PartialEq)]
pub struct Rung {
    /// Its number, from 0.
    pub index: usize,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Frames measured.
    pub frames: u32,
    /// The motions.
    pub motions: Vec<Motion>,
    /// Whether pictures are kept.
    pub full: bool,
}

/// What is seen of a candidate.
#[derive(Debug, Default)]
pub struct Pictures {
    /// Its frames.
    pub frames: Vec<Frame>,
    /// Mean FLIP error of each pixel, 0 to 1.
    pub flip: Option<Plane>,
    /// RMS over time of each pixel's flicker error, 0 to 1.
    pub flicker: Option<Plane>,
}

/// The rungs of a search: a quarter of the pixels and the first motion; all pixels and motions for a few frames; everything.
pub fn rungs(size: [u32; 2], frames: u32, motions: &[Motion]) -> Vec<Rung> {
    let half = size.map(|side| side.div_ceil(2).max(side.min(64)));
    let first = motions.iter().take(1).copied().collect();
    let short = (frames / 3).clamp(4.min(frames), frames);
    vec![
        Rung { index: 0, size: half, frames: short, motions: first, full: false },
        Rung { index: 1, size, frames: short, motions: motions.to_vec(), full: false },
        Rung { index: 2, size, frames, motions: motions.to_vec(), full: true },
    ]
}

/// Renders and measures a candidate under a motion; `reference` begins after the warm-up.
///
/// # Errors
/// Those of rendering, and [`crate::Error::Frames`] for a pixel that is not finite.
pub fn run(
    studio: &Studio<'_>,
    candidate: &Candidate,
    rung: &Rung,
    motion: Motion,
    reference: &[Still],
) -> Result<(Run, Pictures)> {
    let settings = Settings { size: rung.size, ..candidate.settings.clone() };
    let before = studio.allocated();
    let mut take = studio.take(&settings, motion)?;
    let memory_bytes = studio.allocated().saturating_sub(before);
    for _ in 0..WARM_UP {
        take.frame()?;
    }
    let mut sequence = Sequence::new(Options { metrics: METRICS.to_vec(), ..Options::default() })?;
    let mut seen = Pictures::default();
    let (mut stats, mut times): (Vec<FrameStats>, Vec<f64>) = (Vec::new(), Vec::new());
    for still in reference.iter().take(rung.frames as usize) {
        stats.push(take.frame()?);
        times.push(take.ms());
        let frame = take.picture()?;
        let name = stats.len().to_string();
        let geometry = Some(&still.geometry);
        let step = Step { name: &name, frame: &frame, reference: &still.frame, geometry, changes: None };
        let map = sequence.push(&step)?;
        if rung.full {
            add(&mut seen.flip, map);
            seen.frames.push(frame);
        }
    }
    scale(&mut seen.flip, stats.len());
    seen.flicker = sequence.flicker_map().map(|[rms, _]| rms);
    let average = |of: fn(&FrameStats) -> f64| mean(stats.iter().map(of));
    let shares: Vec<[f64; 5]> = stats.iter().map(reprojected_shares).collect();
    let run = Run {
        candidate: candidate.id.clone(),
        rung: rung.index,
        motion: motion.name().to_owned(),
        size: rung.size,
        frames: rung.frames,
        quality: quality(&sequence.finish()),
        rays: average(|s| f64::from(s.rays)),
        shadow_rays: average(|s| f64::from(s.shadow_rays)),
        reused_fraction: average(FrameStats::reused_fraction),
        reprojected: std::array::from_fn(|points| mean(shares.iter().map(|s| s[points]))),
        memory_bytes,
        ms_alone: Summary::of(&times).median,
    };
    Ok((run, seen))
}

/// What a rung's runs, one a motion, say to the search.
pub fn verdict(settings: &Settings, runs: &[Run]) -> Verdict {
    let mean_of = |of: fn(&Run) -> Estimate| average(&runs.iter().map(of).collect::<Vec<_>>());
    let uncounted = KNOBS.iter().filter(|k| !k.rays && (k.applies)(settings.method));
    // Frames may be too small for it, then those of all candidates of the rung.
    let blurred: Vec<f64> = runs.iter().filter_map(|r| r.quality.sharpness_error()).collect();
    let sharpness = (!blurred.is_empty()).then(|| Estimate::exact(mean(blurred.iter().copied())));
    let errors = [mean_of(|r| r.quality.flip), mean_of(|r| r.quality.flicker_error)];
    Verdict {
        // Rays are counted, and the same every time.
        cost: Estimate::exact(mean(runs.iter().map(|r| r.rays + r.shadow_rays))),
        objectives: errors.into_iter().chain(sharpness).collect(),
        uncounted: uncounted.map(|k| format!("{}={} ", k.name, k.get(settings))).collect(),
    }
}

/// Mean of independent estimates.
pub fn average(estimates: &[Estimate]) -> Estimate {
    let n = estimates.len().max(1) as f64;
    let squares: f64 = estimates.iter().map(|e| e.half_width * e.half_width).sum();
    Estimate { mean: estimates.iter().map(|e| e.mean).sum::<f64>() / n, half_width: squares.sqrt() / n }
}

const METRICS: [Metric; 6] =
    [Metric::Rmse, Metric::RelativeMse, Metric::Energy, Metric::Flip, Metric::Flicker, Metric::Cpbd];

fn quality(report: &Report) -> Quality {
    let rows = &report.per_frame;
    let over_frames = |values: Vec<f64>| Estimate::of(&values);
    let changes: Vec<f64> = rows.iter().filter_map(|r| r.flicker_error).collect();
    let flicker = report.flicker.as_ref();
    Quality {
        flip: over_frames(rows.iter().filter_map(|r| r.errors.flip).collect()),
        relative_mse: over_frames(rows.iter().filter_map(|r| r.errors.relative_mse).collect()),
        rmse: report.mean.rmse.unwrap_or_default(),
        flicker_error: over_frames(changes),
        excess_flicker: flicker.map_or(0.0, |f| f.excess_flicker),
        cpbd: report.mean.cpbd,
        cpbd_reference: report.mean.cpbd_reference,
        energy_ratio: report.mean.energy_ratio.unwrap_or(1.0),
    }
}

fn add(sum: &mut Option<Plane>, map: Option<Plane>) {
    match (sum.as_mut(), map) {
        (Some(sum), Some(map)) => sum.data.iter_mut().zip(&map.data).for_each(|(s, m)| *s += m),
        (None, map) => *sum = map,
        (Some(_), None) => {}
    }
}

fn scale(sum: &mut Option<Plane>, count: usize) {
    if let Some(sum) = sum {
        sum.data.iter_mut().for_each(|s| *s /= count.max(1) as f32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rungs_grow() {
        let motions = [Motion::Pan, Motion::Orbit];
        for (size, frames) in [([128, 96], 16), ([32, 32], 4), ([1000, 600], 60), ([1, 1], 1)] {
            let rungs = rungs(size, frames, &motions);
            let work = |r: &Rung| u64::from(r.size[0] * r.size[1] * r.frames) * r.motions.len() as u64;
            assert!(rungs.windows(2).all(|w| work(&w[0]) <= work(&w[1])), "{rungs:?}");
            assert_eq!(rungs[2].size, size);
            assert!(rungs.iter().all(|r| r.frames >= 1 && r.frames <= frames && r.size.iter().all(|s| *s >= 1)));
        }
        assert_eq!(rungs([128, 128], 16, &motions)[0].size, [64, 64]);
    }

    #[test]
    fn averages_of_estimates() {
        let of = average(&[Estimate { mean: 1.0, half_width: 0.3 }, Estimate { mean: 3.0, half_width: 0.4 }]);
        assert!((of.mean - 2.0).abs() < 1e-12 && (of.half_width - 0.25).abs() < 1e-12);
        assert_eq!(average(&[]), Estimate::default());
    }
}
