//! Whether what is picked keeps its limit under motions that the search has not seen.
//!
//! Limits are set as tight as they can be: each is just what some settings of the search promise to keep. Under each of them
//! settings are picked, as a user would, and rendered under other motions beside converged frames of those.

use super::candidate::{Candidate, Origin};
use super::choose::{Limits, choose, promised};
use super::evaluate::{self, Rung, WARM_UP};
use super::outcome::{Entry, Outcome};
use super::reference::{Footage, Still, footage};
use super::store::{Run, Search};
use super::studio::Studio;
use super::timing::take_turns;
use crate::progress::Progress;
use crate::report::statistics::{Summary, ratio};
use crate::scene::motion::Motion;
use crate::settings::Settings;
use crate::settings::file;
use crate::{Error, Result};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A limit, what was picked under it, and how that did under a motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trial {
    /// What is limited: `ms`, `flicker` or `flip`.
    pub axis: &'static str,
    /// The limit.
    pub limit: f64,
    /// Identity of what was picked.
    pub candidate: String,
    /// The same in words.
    pub label: String,
    /// The motion, which the search has not seen.
    pub motion: String,
    /// What was measured.
    pub value: f64,
    /// Whether the limit was kept.
    pub kept: bool,
}

/// Names of what can be limited, in the order of [`promised`].
const AXES: [&str; 3] = ["ms", "flicker", "flip"];

/// Up to `count` limits of each kind, spread over what the settings of a search promise.
pub fn limits(outcome: &Outcome, count: usize) -> Vec<(usize, f64)> {
    let all: Vec<[f64; 3]> = promised(outcome).into_iter().map(|(_, values)| values).collect();
    let mut limits = Vec::new();
    for axis in 0..AXES.len() {
        let mut values: Vec<f64> = all.iter().map(|v| v[axis]).filter(|v| *v > 0.0).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        let count = count.min(values.len());
        // The middles of as many equal parts.
        limits.extend((0..count).map(|i| (axis, values[(2 * i + 1) * values.len() / (2 * count)])));
    }
    limits
}

fn limit_of(axis: usize, value: f64) -> Limits {
    let only = |wanted: usize| (axis == wanted).then_some(value);
    Limits { budget_ms: only(0), max_flicker: only(1), max_error: only(2) }
}

/// What a check is made with.
#[derive(Clone, Copy)]
pub struct Check<'a> {
    /// What renders.
    pub studio: Studio<'a>,
    /// What was searched.
    pub search: &'a Search,
    /// What was found.
    pub outcome: &'a Outcome,
    /// The folder of converged frames.
    pub references: &'a Path,
    /// Told how it goes.
    pub progress: &'a dyn Progress,
    /// Asked before every piece of work whether to stop.
    pub stop: &'a dyn Fn() -> bool,
}

impl Check<'_> {
    /// Picks under `count` limits of each kind, and tries what was picked under every one of `motions`. None if it was
    /// stopped.
    ///
    /// The clock of another day is another clock: a time is what the search measured, times the ratio of this motion to the
    /// search's own, both measured now, in turns.
    ///
    /// # Errors
    /// [`Error::Setting`] for a motion that the search has seen; those of rendering, and of files.
    pub fn run(&self, count: usize, motions: &[Motion]) -> Result<Option<Vec<Trial>>> {
        if let Some(seen) = motions.iter().find(|m| self.search.motions.iter().any(|name| name == m.name())) {
            let expected = format!("motions that the search has not seen: not {}", self.search.motions.join(", "));
            return Err(Error::Setting { name: "motions", value: seen.name().to_owned(), expected });
        }
        let mut picks = Vec::new();
        for (axis, limit) in limits(self.outcome, count) {
            let candidate = choose(self.outcome, &limit_of(axis, limit))?.candidate;
            picks.extend(self.entry(&candidate).map(|entry| (axis, limit, entry)));
        }
        let names: BTreeSet<&str> = picks.iter().map(|(_, _, entry)| entry.candidate.as_str()).collect();
        let chosen: Vec<&Entry> = names.into_iter().filter_map(|id| self.entry(id)).collect();
        let Some(slower) = self.times(&chosen, motions)? else { return Ok(None) };
        let Some(runs) = self.runs(&chosen, motions)? else { return Ok(None) };
        let mut trials = Vec::new();
        for &(axis, limit, entry) in &picks {
            for motion in motions {
                let key = (entry.candidate.clone(), *motion);
                let (Some(run), Some(factor)) = (runs.get(&key), slower.get(&key)) else { continue };
                let quality = &run.quality;
                let value = [entry.timing.ms * factor, quality.flicker_error.mean, quality.flip.mean][axis];
                trials.push(Trial {
                    axis: AXES[axis],
                    limit,
                    candidate: entry.candidate.clone(),
                    label: entry.label.clone(),
                    motion: motion.name().to_owned(),
                    value,
                    kept: value <= limit,
                });
            }
        }
        Ok(Some(trials))
    }

    fn entry(&self, id: &str) -> Option<&Entry> {
        self.outcome.entries.iter().find(|entry| entry.candidate == id)
    }

    fn settings(&self, entry: &Entry) -> Result<Settings> {
        let mut settings = Settings { size: self.search.size, seed: self.search.seed, ..Settings::default() };
        let wrong = |message| Error::Search { path: self.references.to_owned(), message };
        file::parse(&entry.settings, &mut settings).map_err(wrong)?;
        Ok(settings)
    }

    /// How many times as long every one of them takes under a motion as under those of the search.
    fn times(&self, chosen: &[&Entry], motions: &[Motion]) -> Result<Option<BTreeMap<(String, Motion), f64>>> {
        let settings = chosen.iter().map(|entry| self.settings(entry));
        let candidates: Vec<Candidate> =
            settings.map(|s| Ok(Candidate::new(s?, Origin::Default))).collect::<Result<_>>()?;
        let seen = super::outcome::motions(self.search)?;
        let mut ms: BTreeMap<Motion, Vec<f64>> = BTreeMap::new();
        self.progress.begin("timing in turns", (seen.len() + motions.len()) as u64);
        for motion in seen.iter().chain(motions) {
            if (self.stop)() {
                return Ok(None);
            }
            let entries = take_turns(&self.studio, &candidates, *motion)?;
            ms.insert(*motion, entries.iter().map(|entry| entry.ms).collect());
            self.progress.advance(1);
        }
        self.progress.finish();
        let of = |motion: &Motion, i: usize| ms.get(motion).and_then(|all| all.get(i)).copied().unwrap_or_default();
        let before = |i: usize| Summary::of(&seen.iter().map(|motion| of(motion, i)).collect::<Vec<_>>()).median;
        let factors = chosen
            .iter()
            .enumerate()
            .flat_map(|(i, entry)| motions.iter().map(move |m| ((entry.candidate.clone(), *m), i)).collect::<Vec<_>>());
        Ok(Some(factors.map(|(key, i)| (key.clone(), ratio(of(&key.1, i), before(i)))).collect()))
    }

    fn runs(&self, chosen: &[&Entry], motions: &[Motion]) -> Result<Option<BTreeMap<(String, Motion), Run>>> {
        let Search { size, frames, .. } = *self.search;
        let mut runs = BTreeMap::new();
        for &motion in motions {
            let wanted = Footage { motion, size, frames: WARM_UP..WARM_UP + frames };
            let found = footage(&self.studio, self.search, self.references, &wanted, self.progress, self.stop)?;
            let Some(stills) = found else { return Ok(None) };
            self.progress.begin(&format!("picked settings under {motion}"), chosen.len() as u64);
            for entry in chosen {
                if (self.stop)() {
                    return Ok(None);
                }
                runs.insert((entry.candidate.clone(), motion), self.tried(entry, motion, &stills)?);
                self.progress.advance(1);
            }
            self.progress.finish();
        }
        Ok(Some(runs))
    }

    fn tried(&self, entry: &Entry, motion: Motion, stills: &[Still]) -> Result<Run> {
        let Search { size, frames, .. } = *self.search;
        let rung = Rung { index: 0, size, frames, motions: vec![motion], full: false };
        let candidate = Candidate::new(self.settings(entry)?, Origin::Default);
        Ok(evaluate::run(&self.studio, &candidate, &rung, motion, stills)?.0)
    }
}

/// How many of the trials kept their limit, by what was limited, in the order of the trials.
pub fn kept(trials: &[Trial]) -> Vec<(&'static str, usize, usize)> {
    let of = |axis: &'static str| {
        let own: Vec<&Trial> = trials.iter().filter(|trial| trial.axis == axis).collect();
        (axis, own.iter().filter(|trial| trial.kept).count(), own.len())
    };
    AXES.into_iter().map(of).filter(|(_, _, all)| *all > 0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trade::outcome::tests::{entry, outcome};

    #[test]
    fn limits_are_what_settings_promise() {
        let entries: Vec<Entry> = (1..=6)
            .map(|i| {
                let x = f64::from(i);
                entry(&format!("e{i}"), [x, x], [0.1 * x, 0.1 * x], [0.01 * x, 0.01 * x])
            })
            .collect();
        let outcome = outcome(entries);
        let found = limits(&outcome, 3);
        assert_eq!(found.len(), 9);
        // Of six values the second, the fourth and the sixth; times have the noise added.
        let of = |axis: usize| found.iter().filter(|l| l.0 == axis).map(|l| l.1).collect::<Vec<_>>();
        let close = |a: &[f64], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(close(&of(2), [0.2, 0.4, 0.6]) && close(&of(1), [0.02, 0.04, 0.06]), "{found:?}");
        assert!(close(&of(0), [2.01, 4.01, 6.01]), "{found:?}");
        // Every one of them can be kept.
        assert!(found.iter().all(|(axis, limit)| choose(&outcome, &limit_of(*axis, *limit)).is_ok()));
        assert_eq!(limits(&outcome, 100).len(), 18);
    }

    #[test]
    fn what_was_kept_is_counted_by_axis() {
        let trial = |axis, kept| Trial {
            axis,
            limit: 1.0,
            candidate: "a".into(),
            label: "a".into(),
            motion: "pan".into(),
            value: if kept { 0.5 } else { 2.0 },
            kept,
        };
        let trials = [trial("ms", true), trial("flip", true), trial("ms", false), trial("flip", true)];
        assert_eq!(kept(&trials), [("ms", 1, 2), ("flip", 2, 2)]);
    }
}
