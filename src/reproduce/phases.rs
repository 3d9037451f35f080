//! Paper 1, Table 1: what each phase takes, as ratios to supersampling at the same samples a pixel. Milliseconds of another
//! machine say nothing; ratios can be put side by side.

use crate::Result;
use crate::progress::Progress;
use crate::report::statistics::Summary;
use crate::scene::motion::Motion;
use crate::settings::{Method, Settings};
use crate::trade::candidate::{Candidate, Origin};
use crate::trade::store::Phase;
use crate::trade::studio::Studio;
use crate::trade::timing::take_turns;
use std::fmt::Write;

/// Samples a pixel that are compared.
const DENSITIES: [u16; 3] = [1, 2, 4];
/// Rounds of which the median is taken.
const ROUNDS: usize = 3;

/// Milliseconds a frame, in the paper's columns.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Times {
    /// Reprojection.
    pub reprojection: f64,
    /// Analysis.
    pub analysis: f64,
    /// Verification and shading, the paper's one phase: rays, shadow rays and colours.
    pub shading: f64,
    /// Reconstruction.
    pub reconstruction: f64,
}

/// The paper's milliseconds for stable ray tracing at 1, 2 and 4 samples a pixel.
pub const PAPER_STABLE: [Times; 3] = [
    Times { reprojection: 1.05, analysis: 0.28, shading: 18.91, reconstruction: 0.71 },
    Times { reprojection: 1.23, analysis: 0.38, shading: 28.88, reconstruction: 0.82 },
    Times { reprojection: 1.73, analysis: 0.62, shading: 47.48, reconstruction: 0.90 },
];

/// The paper's milliseconds for supersampling at 1, 2 and 4 samples a pixel.
pub const PAPER_SUPERSAMPLE: [Times; 3] = [
    Times { reprojection: 0.0, analysis: 0.0, shading: 13.35, reconstruction: 0.21 },
    Times { reprojection: 0.0, analysis: 0.0, shading: 20.94, reconstruction: 0.38 },
    Times { reprojection: 0.0, analysis: 0.0, shading: 35.86, reconstruction: 0.71 },
];

impl Times {
    /// All of it.
    pub fn total(&self) -> f64 {
        self.reprojection + self.analysis + self.shading + self.reconstruction
    }

    /// Our phases in the paper's columns. What uploads, generates and reads back is part of no column there: it is little, and
    /// counts as shading here, so that the sum is the frame.
    fn of(phases: &[Phase]) -> Self {
        let mut times = Self::default();
        for phase in phases {
            *match phase.label.as_str() {
                "reproject" => &mut times.reprojection,
                "analyze" | "list" => &mut times.analysis,
                "reconstruct" | "resolve" => &mut times.reconstruction,
                _ => &mut times.shading,
            } += phase.ms;
        }
        times
    }
}

/// Times `stable` and `supersample` at 1, 2 and 4 samples a pixel in turns, under a rotation. None if `stop` said so.
///
/// # Errors
/// Those of rendering.
pub fn measure(
    studio: &Studio<'_>,
    size: [u32; 2],
    progress: &dyn Progress,
    stop: &dyn Fn() -> bool,
) -> Result<Option<[[Times; 3]; 2]>> {
    let of = |method, samples: u16| {
        let settings = Settings { size, density: f32::from(samples), spp: u32::from(samples), ..Settings::of(method) };
        Candidate::new(settings, Origin::Default)
    };
    let both = [Method::Stable, Method::Supersample];
    let candidates: Vec<Candidate> = both.into_iter().flat_map(|m| DENSITIES.map(|samples| of(m, samples))).collect();
    let mut rounds = Vec::new();
    progress.begin("timing the phases", ROUNDS as u64);
    for _ in 0..ROUNDS {
        if stop() {
            return Ok(None);
        }
        let entries = take_turns(studio, &candidates, Motion::Rotate)?;
        rounds.push(entries.iter().map(|entry| Times::of(&entry.phases)).collect::<Vec<_>>());
        progress.advance(1);
    }
    progress.finish();
    let median = |of: fn(&Times) -> f64, i: usize| {
        Summary::of(&rounds.iter().filter_map(|round| round.get(i)).map(of).collect::<Vec<_>>()).median
    };
    let times = |i: usize| Times {
        reprojection: median(|t| t.reprojection, i),
        analysis: median(|t| t.analysis, i),
        shading: median(|t| t.shading, i),
        reconstruction: median(|t| t.reconstruction, i),
    };
    Ok(Some([[times(0), times(1), times(2)], [times(3), times(4), times(5)]]))
}

/// The table in Markdown: the paper's ratios, and ours.
pub fn table([stable, supersample]: &[[Times; 3]; 2]) -> String {
    let mut text = String::from(
        "| samples a pixel | | reprojection | analysis | verification and shading | reconstruction | total |\n\
         | ---: | --- | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for (i, density) in DENSITIES.iter().enumerate() {
        for (who, stable, other) in
            [("paper 1", PAPER_STABLE[i], PAPER_SUPERSAMPLE[i]), ("here", stable[i], supersample[i])]
        {
            let _ = writeln!(
                text,
                "| {density} | {who} | {:.3} | {:.3} | {:.2} | {:.2} | {:.2} |",
                stable.reprojection / other.total(),
                stable.analysis / other.total(),
                stable.shading / other.shading,
                stable.reconstruction / other.reconstruction,
                stable.total() / other.total(),
            );
        }
    }
    text.push_str(
        "\nStable ray tracing over supersampling at the same samples a pixel, which has no reprojection and no analysis: these two are \
         over its total.\n",
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_own_words_follow_from_its_table() {
        // "Stable ray tracing generally performs 1.4 to 1.5 times slower" (section 6).
        for (stable, supersample) in PAPER_STABLE.iter().zip(&PAPER_SUPERSAMPLE) {
            let ratio = stable.total() / supersample.total();
            assert!((1.35..1.55).contains(&ratio), "{ratio}");
        }
    }

    #[test]
    fn phases_go_into_columns_and_none_is_lost() {
        let names = ["upload", "reproject", "analyze", "list", "verify", "fill", "shade", "reconstruct", "resolve"];
        let phases: Vec<Phase> = names
            .iter()
            .enumerate()
            .map(|(i, label)| Phase { label: (*label).into(), ms: f64::from(1 << i) })
            .collect();
        let times = Times::of(&phases);
        let expected =
            Times { reprojection: 2.0, analysis: 12.0, shading: 1.0 + 16.0 + 32.0 + 64.0, reconstruction: 384.0 };
        assert_eq!(times, expected);
        assert!((times.total() - 511.0).abs() < 1e-12);
    }

    #[test]
    fn ratios_are_to_the_same_samples() {
        let one = Times { reprojection: 1.0, analysis: 0.5, shading: 8.0, reconstruction: 1.0 };
        let other = Times { reprojection: 0.0, analysis: 0.0, shading: 4.0, reconstruction: 1.0 };
        let text = table(&[[one; 3], [other; 3]]);
        assert!(text.contains("| 1 | here | 0.200 | 0.100 | 2.00 | 1.00 | 2.10 |"), "{text}");
        assert!(text.contains("| 1 | paper 1 | 0.077 | 0.021 | 1.42 | 3.38 | 1.54 |"), "{text}");
    }
}
