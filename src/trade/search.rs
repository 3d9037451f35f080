//! The search itself: references, brackets over rungs, timing in turns.

use super::candidate::{Candidate, Space};
use super::evaluate::{self, Pictures, Rung, WARM_UP, rungs, verdict};
use super::halving::{self, Verdict};
use super::outcome;
use super::pictures;
use super::reference::{Footage, Still, footage};
use super::store::{Run, Search, Store};
use super::studio::Studio;
use super::timing;
use crate::progress::Progress;
use crate::scene::motion::Motion;
use crate::{Error, Result};
use std::collections::BTreeMap;

/// Which part of a search is done here: brackets whose number leaves `index` when divided by `count`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// From 0.
    pub index: usize,
    /// At least 1.
    pub count: usize,
}

/// Something to be done, with what it needs.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    /// What is searched.
    pub search: &'a Search,
    /// Among which settings.
    pub space: &'a Space,
    /// Where the files are.
    pub store: &'a Store,
    /// What renders.
    pub studio: Studio<'a>,
    /// Who is told how it goes.
    pub progress: &'a dyn Progress,
    /// Asked before every piece of work whether to stop.
    pub stop: &'a dyn Fn() -> bool,
}

/// Converged frames of every rung and motion.
type References = BTreeMap<(usize, Motion), Vec<Still>>;

/// What ends a bracket before its time.
enum Ended {
    Stopped,
    Failed(Error),
}

impl Job<'_> {
    /// Does what is not done yet of a shard. False if it was stopped: what has been measured is kept.
    ///
    /// # Errors
    /// Those of rendering, and of files.
    pub fn run(&self, shard: Shard) -> Result<bool> {
        let candidates = outcome::candidates(self.search, self.space);
        let motions = outcome::motions(self.search)?;
        let rungs = rungs(self.search.size, self.search.frames, &motions);
        let Some(references) = self.references(&rungs)? else { return Ok(false) };
        let mut survivors = Vec::new();
        for index in (shard.index..self.search.brackets).step_by(shard.count) {
            let bracket = halving::bracket(&candidates, index, self.search.brackets);
            match self.bracket(index, &bracket, &rungs, &references) {
                Ok(found) => survivors.extend(found),
                Err(Ended::Stopped) => return Ok(false),
                Err(Ended::Failed(error)) => return Err(error),
            }
        }
        let control = Candidate::new(timing::control(&self.space.base), super::candidate::Origin::Default);
        if survivors.iter().all(|c| c.id != control.id) {
            survivors.push(control);
        }
        let name = format!("{}of{}", shard.index, shard.count);
        timing::rounds(&self.studio, self.store, &name, &survivors, &motions, self.progress, self.stop)
    }

    /// Converged frames for every rung and motion.
    fn references(&self, rungs: &[Rung]) -> Result<Option<References>> {
        let mut all = BTreeMap::new();
        for rung in rungs {
            for &motion in &rung.motions {
                let wanted = Footage { motion, size: rung.size, frames: WARM_UP..WARM_UP + rung.frames };
                let folder = self.store.folder().join("reference");
                let found = footage(&self.studio, self.search, &folder, &wanted, self.progress, self.stop)?;
                let Some(found) = found else { return Ok(None) };
                all.insert((rung.index, motion), found);
            }
        }
        Ok(Some(all))
    }

    fn bracket(
        &self,
        index: usize,
        bracket: &[Candidate],
        rungs: &[Rung],
        references: &References,
    ) -> std::result::Result<Vec<Candidate>, Ended> {
        let mut stopped = false;
        let mut begun = None;
        let fates = halving::run(bracket, rungs.len(), |candidate, rung, count| {
            if begun != Some(rung) {
                if begun.replace(rung).is_some() {
                    self.progress.finish();
                }
                let (bracket, brackets) = (index + 1, self.search.brackets);
                self.progress.begin(&format!("bracket {bracket} of {brackets}, rung {}", rung + 1), count as u64);
            }
            stopped = stopped || (self.stop)();
            if stopped {
                return Err(Error::Search { path: self.store.folder().to_owned(), message: "stopped".to_owned() });
            }
            let judged = self.judge(candidate, &rungs[rung], references);
            self.progress.advance(1);
            judged
        });
        let fates = match fates {
            Err(_) if stopped => return Err(Ended::Stopped),
            other => other.map_err(Ended::Failed)?,
        };
        self.progress.finish();
        let survived = |c: &&Candidate| fates.iter().any(|f| f.candidate == c.id && f.given_up.is_none());
        Ok(bracket.iter().filter(survived).cloned().collect())
    }

    fn judge(&self, candidate: &Candidate, rung: &Rung, references: &References) -> Result<Verdict> {
        let mut runs = Vec::new();
        for (i, &motion) in rung.motions.iter().enumerate() {
            let reference = references.get(&(rung.index, motion)).map_or(&[][..], Vec::as_slice);
            runs.push(self.measured(candidate, rung, motion, reference, i == 0)?);
        }
        Ok(verdict(&candidate.settings, &runs))
    }

    fn measured(
        &self,
        candidate: &Candidate,
        rung: &Rung,
        motion: Motion,
        reference: &[Still],
        seen: bool,
    ) -> Result<Run> {
        if let Some(run) = self.store.run(rung.index, &candidate.id, motion.name())? {
            return Ok(run);
        }
        let (run, found) = evaluate::run(&self.studio, candidate, rung, motion, reference)?;
        if rung.full && seen {
            self.keep(candidate, &found, reference)?;
        }
        self.store.put_run(&run)?;
        Ok(run)
    }

    fn keep(&self, candidate: &Candidate, found: &Pictures, reference: &[Still]) -> Result<()> {
        let folder = self.store.pictures("reference");
        if !folder.join("frames.png").exists() {
            let frames = reference.iter().map(|still| still.frame.clone()).collect();
            pictures::write(&folder, &Pictures { frames, ..Pictures::default() }, self.search.fps)?;
        }
        pictures::write(&self.store.pictures(&candidate.id), found, self.search.fps)
    }
}
