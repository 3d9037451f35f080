//! Methods side by side: the same scenes, motions and references, and what each costs and gives.

use crate::Result;
use crate::progress::Progress;
use crate::scene::motion::Motion;
use crate::settings::Settings;
use crate::trade::candidate::{Candidate, Origin};
use crate::trade::evaluate::{self, Rung, WARM_UP};
use crate::trade::reference::{Footage, footage};
use crate::trade::store::{Run, Search};
use crate::trade::studio::Studio;
use crate::trade::timing::take_turns;
use serde::Serialize;
use std::path::Path;

/// Settings that take part, under a name.
#[derive(Debug, Clone, Serialize)]
pub struct Contestant {
    /// As tables call it.
    pub name: String,
    /// Its settings, but for the size.
    #[serde(skip)]
    pub settings: Settings,
}

/// What one contestant did in one scene under one motion.
#[derive(Debug, Clone, Serialize)]
pub struct Score {
    /// The scene as the user named it.
    pub scene: String,
    /// Name of the contestant.
    pub contestant: String,
    /// Quality, rays and memory.
    pub run: Run,
    /// Median milliseconds a frame on the device, taken in turns with the others.
    pub ms: f64,
}

/// Renders every contestant beside the reference of a motion, and times them in turns. None if `stop` said so.
///
/// # Errors
/// Those of rendering, and of files.
pub fn contest(
    studio: &Studio<'_>,
    search: &Search,
    references: &Path,
    contestants: &[Contestant],
    motion: Motion,
    progress: &dyn Progress,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Vec<Score>>> {
    let frames = WARM_UP..WARM_UP + search.frames;
    let wanted = Footage { motion, size: search.size, frames };
    let Some(stills) = footage(studio, search, references, &wanted, progress, stop)? else { return Ok(None) };
    let rung = Rung { index: 0, size: search.size, frames: search.frames, motions: vec![motion], full: true };
    let of = |c: &Contestant| Settings { size: search.size, seed: search.seed, ..c.settings.clone() };
    let candidates: Vec<Candidate> = contestants.iter().map(|c| Candidate::new(of(c), Origin::Default)).collect();
    progress.begin(&format!("{} {motion}: timing, then measuring", search.scene), 1 + candidates.len() as u64);
    let times = take_turns(studio, &candidates, motion)?.into_iter().map(|entry| entry.ms);
    progress.advance(1);
    let mut results = Vec::new();
    for ((contestant, candidate), ms) in contestants.iter().zip(&candidates).zip(times) {
        if stop() {
            return Ok(None);
        }
        let (run, _) = evaluate::run(studio, candidate, &rung, motion, &stills)?;
        results.push(Score { scene: search.scene.clone(), contestant: contestant.name.clone(), run, ms });
        progress.advance(1);
    }
    progress.finish();
    Ok(Some(results))
}
