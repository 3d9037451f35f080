//! Times what came to the end of a search: all in turns, frame by frame, so that what disturbs the machine disturbs all of
//! them; and each against itself, to know what a difference is worth.

use super::candidate::Candidate;
use super::pareto::Estimate;
use super::store::{Phase, Round, RoundEntry, Store};
use super::studio::{Studio, Take};
use crate::Result;
use crate::progress::Progress;
use crate::report::statistics::{Summary, mean};
use crate::scene::motion::Motion;
use crate::settings::Settings;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Frames of a round that are measured.
const FRAMES: u32 = 4;
/// Frames of a round before them.
const WARM_UP: u32 = 2;
/// Pairs of rounds a motion: the two of a pair render the same frames.
const PAIRS: usize = 1;

/// What a candidate's frames take.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Median over rounds of the median milliseconds a frame on the device.
    pub ms: f64,
    /// A/A noise in milliseconds: what two measurements of the same frames with the same settings differ by. A difference to
    /// another candidate that is smaller is none.
    pub noise_ms: f64,
    /// Median over the rounds of each motion.
    pub by_motion: BTreeMap<String, f64>,
    /// Median milliseconds of each phase, in order.
    pub phases: Vec<Phase>,
}

/// Times the candidates in rounds that are not there yet. False if `stop` said so before the end.
///
/// # Errors
/// Those of rendering, and of files.
pub fn rounds(
    studio: &Studio<'_>,
    store: &Store,
    shard: &str,
    candidates: &[Candidate],
    motions: &[Motion],
    progress: &dyn Progress,
    stop: &dyn Fn() -> bool,
) -> Result<bool> {
    let count = motions.len() * PAIRS * 2;
    let missing: Vec<usize> = (0..count).filter(|&round| !store.has_round(shard, round)).collect();
    if missing.is_empty() || candidates.is_empty() {
        return Ok(true);
    }
    progress.begin("timing in turns", missing.len() as u64);
    let first = motions.first().copied().unwrap_or_default();
    let mut takes: Vec<Take<'_>> = candidates.iter().map(|c| studio.take(&c.settings, first)).collect::<Result<_>>()?;
    for index in missing {
        if stop() {
            return Ok(false);
        }
        let motion = motions[index / 2 % motions.len()];
        let entries = round(&mut takes, candidates, motion)?;
        store.put_round(&Round { shard: shard.to_owned(), round: index, motion: motion.name().to_owned(), entries })?;
        progress.advance(1);
    }
    progress.finish();
    Ok(true)
}

/// Median milliseconds a frame of each candidate and of its phases, in turns.
///
/// # Errors
/// Those of rendering.
pub fn take_turns(studio: &Studio<'_>, candidates: &[Candidate], motion: Motion) -> Result<Vec<RoundEntry>> {
    let mut takes: Vec<Take<'_>> =
        candidates.iter().map(|c| studio.take(&c.settings, motion)).collect::<Result<_>>()?;
    round(&mut takes, candidates, motion)
}

fn round(takes: &mut [Take<'_>], candidates: &[Candidate], motion: Motion) -> Result<Vec<RoundEntry>> {
    let mut frames: Vec<Vec<Vec<Phase>>> = vec![Vec::new(); takes.len()];
    takes.iter_mut().for_each(|take| take.rewind(motion));
    for index in 0..WARM_UP + FRAMES {
        for (take, measured) in takes.iter_mut().zip(&mut frames) {
            take.frame()?;
            if index >= WARM_UP {
                measured.push(take.session().phase_times().iter().map(Phase::from).collect());
            }
        }
    }
    let entry = |(candidate, frames): (&Candidate, &Vec<Vec<Phase>>)| {
        let totals: Vec<f64> = frames.iter().map(|phases| phases.iter().map(|p| p.ms).sum()).collect();
        RoundEntry { candidate: candidate.id.clone(), ms: Summary::of(&totals).median, phases: median_phases(frames) }
    };
    Ok(candidates.iter().zip(&frames).map(entry).collect())
}

/// The median of each phase over lists of the same phases.
fn median_phases(lists: &[Vec<Phase>]) -> Vec<Phase> {
    let Some(first) = lists.first() else { return Vec::new() };
    let median =
        |i: usize| Summary::of(&lists.iter().filter_map(|l| l.get(i)).map(|p| p.ms).collect::<Vec<_>>()).median;
    first.iter().enumerate().map(|(i, phase)| Phase { label: phase.label.clone(), ms: median(i) }).collect()
}

/// What all rounds say of each candidate.
pub fn summaries(rounds: &[Round]) -> BTreeMap<String, Timing> {
    let mut entries: BTreeMap<&str, Vec<(&Round, &RoundEntry)>> = BTreeMap::new();
    for round in rounds {
        for entry in &round.entries {
            entries.entry(&entry.candidate).or_default().push((round, entry));
        }
    }
    // A candidate has few pairs, whose difference can be small by luck: it is at least what all of them have in common.
    let pooled: Vec<f64> = entries.values().flat_map(|e| aa_differences(e)).collect();
    let usual = Summary::of(&pooled).median;
    let of = |(id, entries): (&&str, &Vec<(&Round, &RoundEntry)>)| ((*id).to_owned(), summary(entries, usual));
    entries.iter().map(of).collect()
}

/// Differences between the two rounds of each pair, relative to their mean.
fn aa_differences(entries: &[(&Round, &RoundEntry)]) -> Vec<f64> {
    let mut pairs: BTreeMap<(&str, usize), Vec<f64>> = BTreeMap::new();
    for (round, entry) in entries {
        pairs.entry((&round.shard, round.round / 2)).or_default().push(entry.ms);
    }
    let relative = |pair: &Vec<f64>| match pair[..] {
        [a, b] if a + b > 0.0 => Some((a - b).abs() / ((a + b) / 2.0)),
        _ => None,
    };
    pairs.values().filter_map(relative).collect()
}

fn summary(entries: &[(&Round, &RoundEntry)], usual: f64) -> Timing {
    let median = |of: &dyn Fn(&Round) -> bool| {
        Summary::of(&entries.iter().filter(|(r, _)| of(r)).map(|(_, e)| e.ms).collect::<Vec<_>>()).median
    };
    let ms = median(&|_| true);
    let own = aa_differences(entries);
    let motions: Vec<&str> = entries.iter().map(|(r, _)| r.motion.as_str()).collect();
    Timing {
        ms,
        noise_ms: ms * mean(own.iter().copied()).max(usual),
        by_motion: motions.iter().map(|m| ((*m).to_owned(), median(&|r| r.motion == *m))).collect(),
        phases: median_phases(&entries.iter().map(|(_, e)| e.phases.clone()).collect::<Vec<_>>()),
    }
}

/// The time of `a` over that of `b`; none if the difference is within what either differs from itself.
pub fn ratio(a: &Timing, b: &Timing) -> Option<f64> {
    let noise = Estimate { mean: a.ms, half_width: a.noise_ms.hypot(b.noise_ms) };
    let different = b.ms < noise.low() || b.ms > noise.high();
    (different && b.ms > 0.0).then(|| a.ms / b.ms)
}

/// The candidate that every shard times, so that times of different machines can be compared: supersampling, one sample.
pub fn control(base: &Settings) -> Settings {
    Settings { size: base.size, seed: base.seed, ..Settings::of(crate::settings::Method::Supersample) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round(index: usize, motion: &str, ms: &[(&str, f64)]) -> Round {
        let entry = |(id, ms): &(&str, f64)| RoundEntry {
            candidate: (*id).to_owned(),
            ms: *ms,
            phases: vec![Phase { label: "verify".into(), ms: ms / 2.0 }],
        };
        Round { shard: "all".into(), round: index, motion: motion.into(), entries: ms.iter().map(entry).collect() }
    }

    #[test]
    fn medians_and_noise_of_known_rounds() {
        let rounds = [
            round(0, "pan", &[("a", 10.0), ("b", 10.3)]),
            round(1, "pan", &[("a", 11.0), ("b", 10.3)]),
            round(2, "orbit", &[("a", 20.0), ("b", 20.0)]),
            round(3, "orbit", &[("a", 22.0), ("b", 20.2)]),
        ];
        let all = summaries(&rounds);
        let (a, b) = (&all["a"], &all["b"]);
        assert_eq!((a.ms, a.by_motion["pan"], a.by_motion["orbit"]), (15.5, 10.5, 21.0));
        assert_eq!(a.phases, [Phase { label: "verify".into(), ms: 7.75 }]);
        // Both pairs of `a` differ by 2/21 of their mean.
        assert!((a.noise_ms - 15.5 * 2.0 / 21.0).abs() < 1e-9, "{a:?}");
        // Those of `b` by less than is usual, which is the median of 0, 0.01 and twice 0.095.
        let usual = (0.2 / 20.1 + 2.0 / 21.0) / 2.0;
        assert!((b.noise_ms - b.ms * usual).abs() < 1e-9, "{b:?}");
    }

    #[test]
    fn a_difference_within_the_noise_is_none() {
        let timing = |ms, noise_ms| Timing { ms, noise_ms, ..Timing::default() };
        assert_eq!(ratio(&timing(10.0, 1.0), &timing(11.0, 1.0)), None);
        assert_eq!(ratio(&timing(10.0, 1.0), &timing(20.0, 1.0)), Some(0.5));
        assert_eq!(ratio(&timing(10.0, 0.0), &timing(0.0, 0.0)), None);
    }
}
