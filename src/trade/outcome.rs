//! What a search found, out of the files in its folder and nothing else: a whole one and the joined parts of one are the same.

use super::candidate::{Candidate, Origin, Space, knobs, label};
use super::evaluate::{average, rungs, verdict};
use super::halving::{self, Fate};
use super::pareto::{Estimate, front};
use super::store::{Run, Search, Store};
use super::timing::{self, Timing};
use crate::scene::motion::Motion;
use crate::settings::Settings;
use crate::settings::knob::KNOBS;
use crate::{Error, Result};
use serde::Serialize;
use std::collections::BTreeMap;

/// The result of a search.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    /// Version of this form; 1.
    pub schema: u32,
    /// What was searched.
    pub search: Search,
    /// The knobs, as far as their table tells.
    pub knobs: Vec<KnobReport>,
    /// How many candidates were tried on each rung.
    pub tried: Vec<usize>,
    /// What came to the end, by time.
    pub entries: Vec<Entry>,
    /// How far every candidate came.
    pub fates: Vec<Fate>,
    /// Every measurement.
    pub runs: Vec<Run>,
}

/// A knob in a report.
#[derive(Debug, Clone, Serialize)]
pub struct KnobReport {
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub about: &'static str,
    /// Unit of its values.
    pub unit: &'static str,
    /// Its range in words.
    pub range: String,
    /// What it trades.
    pub trades: &'static str,
}

/// A candidate that came to the end.
#[derive(Debug, Clone, Serialize)]
pub struct Entry {
    /// Its identity.
    pub candidate: String,
    /// What is not at the method's defaults, in words.
    pub label: String,
    /// Why it was tried.
    pub origin: Origin,
    /// The knobs in use.
    pub knobs: BTreeMap<String, serde_json::Value>,
    /// Its settings, as a file.
    pub settings: String,
    /// Whether no other is better in time, FLIP, flicker error and sharpness at once, with time differences below the noise
    /// taken for none.
    pub on_front: bool,
    /// What it takes.
    pub timing: Timing,
    /// Mean camera and shadow rays a frame.
    pub rays: f64,
    /// Device memory in bytes, without the scene.
    pub memory_bytes: u64,
    /// Mean FLIP, over motions.
    pub flip: Estimate,
    /// Relative mean squared error, over motions.
    pub relative_mse: Estimate,
    /// Flicker error, over motions.
    pub flicker_error: Estimate,
    /// Excess flicker, over motions.
    pub excess_flicker: f64,
    /// CPBD sharpness, over motions.
    pub cpbd: Option<f64>,
    /// That of the reference.
    pub cpbd_reference: Option<f64>,
    /// Energy ratio, over motions.
    pub energy_ratio: f64,
    /// The full runs, one a motion.
    pub runs: Vec<Run>,
}

/// The candidates of a search.
pub fn candidates(search: &Search, space: &Space) -> Vec<Candidate> {
    space.candidates(search.candidates, search.seed)
}

/// Collects a search's files.
///
/// # Errors
/// [`Error::Search`] if measurements are missing: the search has not come to its end, or shards are missing. And those of
/// files.
pub fn collect(store: &Store, search: &Search, space: &Space) -> Result<Outcome> {
    let candidates = candidates(search, space);
    let fates = (0..search.brackets)
        .map(|b| replay(store, search, &halving::bracket(&candidates, b, search.brackets)))
        .collect::<Result<Vec<_>>>()?
        .concat();
    let rounds = store.rounds()?;
    let timings = timing::summaries(&rounds);
    let runs = store.runs()?;
    let last = 2;
    let survivors = candidates.iter().filter(|c| fates.iter().any(|f| f.candidate == c.id && f.given_up.is_none()));
    let mut entries: Vec<Entry> = survivors
        .map(|c| entry(c, runs.iter().filter(|r| r.rung == last && r.candidate == c.id).cloned().collect(), &timings))
        .collect();
    entries.sort_by(|a, b| a.timing.ms.total_cmp(&b.timing.ms).then(a.candidate.cmp(&b.candidate)));
    mark_front(&mut entries);
    let tried = (0..=last).map(|rung| fates.iter().filter(|f| f.rungs > rung).count()).collect();
    Ok(Outcome { schema: 1, search: search.clone(), knobs: knob_reports(), tried, entries, fates, runs })
}

/// The motions of a search.
///
/// # Errors
/// [`Error::Setting`] for a name that is none.
pub fn motions(search: &Search) -> Result<Vec<Motion>> {
    search.motions.iter().map(|name| name.parse()).collect()
}

/// A bracket's decisions from what was measured.
fn replay(store: &Store, search: &Search, bracket: &[Candidate]) -> Result<Vec<Fate>> {
    let rungs = rungs(search.size, search.frames, &motions(search)?);
    halving::run(bracket, rungs.len(), |candidate, index, _| {
        let runs = rungs[index].motions.iter().map(|motion| {
            store.run(index, &candidate.id, motion.name())?.ok_or_else(|| Error::Search {
                path: store.folder().to_owned(),
                message: format!(
                    "candidate {} has not been tried on rung {index}: let the search end, or join all its shards",
                    candidate.id
                ),
            })
        });
        Ok(verdict(&candidate.settings, &runs.collect::<Result<Vec<_>>>()?))
    })
}

fn entry(candidate: &Candidate, runs: Vec<Run>, timings: &BTreeMap<String, Timing>) -> Entry {
    let over = |of: fn(&Run) -> Estimate| average(&runs.iter().map(of).collect::<Vec<_>>());
    let plain = |of: fn(&Run) -> f64| over_motions(&runs, |r| Some(of(r))).unwrap_or_default();
    Entry {
        candidate: candidate.id.clone(),
        label: label(&candidate.settings),
        origin: candidate.origin,
        knobs: knobs(&candidate.settings),
        settings: crate::settings::file::text(&candidate.settings),
        on_front: false,
        timing: timings.get(&candidate.id).cloned().unwrap_or_default(),
        rays: plain(|r| r.rays + r.shadow_rays),
        memory_bytes: runs.first().map_or(0, |r| r.memory_bytes),
        flip: over(|r| r.quality.flip),
        relative_mse: over(|r| r.quality.relative_mse),
        flicker_error: over(|r| r.quality.flicker_error),
        excess_flicker: plain(|r| r.quality.excess_flicker),
        cpbd: over_motions(&runs, |r| r.quality.cpbd),
        cpbd_reference: over_motions(&runs, |r| r.quality.cpbd_reference),
        energy_ratio: plain(|r| r.quality.energy_ratio),
        runs,
    }
}

fn over_motions(runs: &[Run], of: impl Fn(&Run) -> Option<f64>) -> Option<f64> {
    let values: Vec<f64> = runs.iter().filter_map(of).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// How far the sharpness is from the reference's, over motions.
fn sharpness_error(entry: &Entry) -> f64 {
    over_motions(&entry.runs, |r| r.quality.sharpness_error()).unwrap_or_default()
}

/// Of two that differ in time by less than the noise, the one that is better in all other respects wins.
fn mark_front(entries: &mut [Entry]) {
    let point =
        |e: &Entry| vec![Estimate::exact(e.timing.ms), e.flip, e.flicker_error, Estimate::exact(sharpness_error(e))];
    let points: Vec<Vec<Estimate>> = entries.iter().map(point).collect();
    let best = front(&points);
    let beaten_within_noise = |i: usize| {
        entries.iter().any(|other| {
            let own = &entries[i];
            timing::ratio(&other.timing, &own.timing).is_none_or(|r| r < 1.0)
                && other.flip.mean < own.flip.mean
                && other.flicker_error.mean < own.flicker_error.mean
                && sharpness_error(other) <= sharpness_error(own)
        })
    };
    let on_front: Vec<bool> = (0..entries.len()).map(|i| best.contains(&i) && !beaten_within_noise(i)).collect();
    entries.iter_mut().zip(on_front).for_each(|(entry, on)| entry.on_front = on);
}

fn knob_reports() -> Vec<KnobReport> {
    let report = |k: &crate::settings::knob::Knob| KnobReport {
        name: k.name,
        about: k.about,
        unit: k.unit,
        range: k.range(),
        trades: k.trades,
    };
    KNOBS.iter().map(report).collect()
}

/// The space that a search's folder says was searched.
///
/// # Errors
/// [`Error::Setting`] or [`Error::UnknownKnob`] if a knob that is held is none any more.
pub fn space(search: &Search) -> Result<Space> {
    let mut base = Settings { size: search.size, seed: search.seed, ..Settings::default() };
    let words: Vec<String> = search.held.iter().map(|(name, value)| format!("{name}={value}")).collect();
    crate::settings::file::assign_all(&words, &mut base)?;
    Ok(Space { base, held: search.held.keys().cloned().collect(), scene: search.traits })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::trade::store::tests::{run, search};

    pub fn entry(id: &str, ms: [f64; 2], flip: [f64; 2], flicker: [f64; 2]) -> Entry {
        let motions = ["orbit", "pan"];
        let runs: Vec<Run> = (0..2)
            .map(|i| {
                let mut run = run(id, 2, motions[i], flip[i]);
                run.quality.flicker_error = Estimate::exact(flicker[i]);
                run
            })
            .collect();
        let by_motion = motions.iter().zip(ms).map(|(m, ms)| ((*m).to_owned(), ms)).collect();
        let timing = Timing { ms: ms[0].midpoint(ms[1]), noise_ms: 0.01, by_motion, phases: Vec::new() };
        let candidate = Candidate { id: id.to_owned(), ..Candidate::new(Settings::default(), Origin::Random) };
        let timings = BTreeMap::from([(id.to_owned(), timing)]);
        Entry { label: id.to_owned(), ..super::entry(&candidate, runs, &timings) }
    }

    pub fn outcome(entries: Vec<Entry>) -> Outcome {
        Outcome {
            schema: 1,
            search: search(),
            knobs: knob_reports(),
            tried: vec![entries.len()],
            entries,
            fates: Vec::new(),
            runs: Vec::new(),
        }
    }

    #[test]
    fn the_front_takes_no_advantage_of_noise() {
        let mut entries = vec![
            entry("cheap", [1.0, 1.0], [0.3, 0.3], [0.03, 0.03]),
            entry("lucky", [1.995, 1.995], [0.25, 0.25], [0.025, 0.025]),
            entry("better", [2.0, 2.0], [0.2, 0.2], [0.02, 0.02]),
            entry("worse", [3.0, 3.0], [0.3, 0.3], [0.03, 0.03]),
        ];
        mark_front(&mut entries);
        assert_eq!(entries.iter().map(|e| e.on_front).collect::<Vec<_>>(), [true, false, true, false]);
    }
}
