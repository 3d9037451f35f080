//! `stillray trade`: which settings are worth their time, on this scene and motion.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use clap::{ArgAction, Args, Subcommand};
use stillray::Error;
use stillray::headless::{Device, LoadedScene};
use stillray::progress::Progress;
use stillray::report::{file, json, trade as report};
use stillray::scene::fingerprint::fingerprint;
use stillray::scene::motion::Motion;
use stillray::scene::requirements::Traits;
use stillray::scene::shot::Shot;
use stillray::settings::{Settings, file as settings_file};
use stillray::trade::candidate::Space;
use stillray::trade::choose::{Choice, Limits, choose};
use stillray::trade::outcome::{self, Outcome as Found};
use stillray::trade::promise::{self, Trial};
use stillray::trade::reference::shaders_digest;
use stillray::trade::search::{Job, Shard};
use stillray::trade::store::{MOST_BRACKETS, MOST_CANDIDATES, MOST_FRAMES, Search, Store};
use stillray::trade::studio::Studio;

use super::arguments::{self, Source, counted, motion, ranged};
use super::{Failure, Outcome, console, interrupt, progress, scenes};

/// Find the settings that are worth their time, on a scene and its motion
///
/// Tries many settings on small short frames, the better ones on more, and times what is left in turns. Measurements are
/// kept as files: what was interrupted goes on where it stopped.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Trade {
    #[command(subcommand)]
    action: Option<Action>,
    #[command(flatten)]
    hunt: Hunt,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Join the shards of a search
    Merge(Merge),
    /// Pick settings from a search that has ended
    Pick(Pick),
    /// Check whether what is picked keeps its limits under motions that the search has not seen
    Check(Check),
}

#[derive(Debug, Args)]
struct Hunt {
    #[command(flatten)]
    source: Source,
    /// Camera motions to judge under
    #[arg(long, value_name = "NAMES", default_value = "rotate,orbit", value_delimiter = ',', action = ArgAction::Set, value_parser = motion())]
    motions: Vec<Motion>,
    /// Frames measured of each motion, from 4 to 10000
    #[arg(long, value_name = "N", default_value = "12", value_parser = counted(4, MOST_FRAMES))]
    frames: u32,
    /// Settings to try, from 1 to 100000
    #[arg(long, value_name = "N", default_value = "216", value_parser = counted(1, MOST_CANDIDATES))]
    candidates: u32,
    /// Groups that are searched independently, from 1 to 1000; as many shards are possible
    #[arg(long, value_name = "N", default_value = "6", value_parser = counted(1, MOST_BRACKETS))]
    brackets: u32,
    /// Samples a pixel of the frames to compare with, from 16 to 65536
    #[arg(long, value_name = "N", default_value = "64", value_parser = counted(16, 65_536))]
    reference_spp: u32,
    /// Hold a knob at a value instead of searching it, as in method=stable, however often
    #[arg(long = "hold", value_name = "NAME=VALUE")]
    held: Vec<String>,
    /// Do a part of the search, numbered from 1, as in 2/4; `stillray trade merge` joins the parts
    #[arg(long, value_name = "I/N", default_value = "1/1", value_parser = shard)]
    shard: Shard,
    /// Folder of the search
    #[arg(long, value_name = "DIR", default_value = "trade")]
    out: PathBuf,
    #[command(flatten)]
    limits: Limited,
}

#[derive(Debug, Args)]
struct Merge {
    /// Folders of shards
    #[arg(value_name = "DIR", required = true)]
    parts: Vec<PathBuf>,
    /// Folder for the whole
    #[arg(long, value_name = "DIR", default_value = "trade")]
    out: PathBuf,
    /// No summary
    #[arg(long)]
    quiet: bool,
    #[command(flatten)]
    limits: Limited,
}

#[derive(Debug, Args)]
struct Pick {
    /// Folder of the search
    #[arg(value_name = "DIR", default_value = "trade")]
    folder: PathBuf,
    /// No summary
    #[arg(long)]
    quiet: bool,
    #[command(flatten)]
    limits: Limited,
}

#[derive(Debug, Args)]
struct Check {
    /// Folder of the search
    #[arg(value_name = "DIR", default_value = "trade")]
    folder: PathBuf,
    /// Camera motions that the search has not seen
    #[arg(long, value_name = "NAMES", default_value = "pan,zoom,dolly", value_delimiter = ',', action = ArgAction::Set, value_parser = motion())]
    motions: Vec<Motion>,
    /// Limits of each kind under which settings are picked, from 1 to 1000
    #[arg(long, value_name = "N", default_value = "8", value_parser = counted(1, 1000))]
    limits: u32,
    /// Write every trial to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// No progress and no summary
    #[arg(long)]
    quiet: bool,
}

/// Limits under which settings are picked.
#[derive(Debug, Args)]
struct Limited {
    /// Pick the best settings that take at most so many milliseconds a frame
    #[arg(long, value_name = "MS", value_parser = ranged(1e-6, 1e9))]
    budget_ms: Option<f64>,
    /// Pick the best settings with at most this flicker error, from 0 to 1
    #[arg(long, value_name = "X", value_parser = ranged(0.0, 1.0))]
    max_flicker: Option<f64>,
    /// Pick the best settings with at most this FLIP, from 0 to 1
    #[arg(long, value_name = "Y", value_parser = ranged(0.0, 1.0))]
    max_error: Option<f64>,
    /// File for the settings that are picked
    #[arg(long, value_name = "FILE", default_value = "picked.toml")]
    pick: PathBuf,
}

/// `I/N`, from 1.
fn shard(text: &str) -> Result<Shard, String> {
    let parsed = text.split_once('/').and_then(|(i, n)| Some((i.parse::<usize>().ok()?, n.parse::<usize>().ok()?)));
    match parsed {
        Some((index, count)) if (1..=count).contains(&index) => Ok(Shard { index: index - 1, count }),
        _ => Err("expected a part and how many there are, such as 1/4".to_owned()),
    }
}

impl Trade {
    /// Searches, joins or picks.
    pub fn run(self) -> Outcome {
        match self.action {
            Some(Action::Merge(merge)) => merge.run(),
            Some(Action::Pick(pick)) => pick.run(),
            Some(Action::Check(check)) => check.run(),
            None => self.hunt.run(),
        }
    }
}

impl Hunt {
    fn run(self) -> Outcome {
        self.check()?;
        interrupt::listen();
        let (scene, shot) = scenes::looked_at(&self.source, Motion::Static)?;
        console::notes(&scene.notices);
        let device = Device::open(self.source.device.as_deref())?;
        let space = self.space(&scene)?;
        let search = self.search(&scene, &shot, &device, &space);
        let store = Store::open(&self.out, &search)?;
        let listener = progress::for_user(self.source.quiet);
        let loaded = LoadedScene::new(&device, &scene, &*listener)?;
        let studio = Studio { device: &device, loaded: &loaded, scene: &scene, shot: &shot, fps: self.source.fps };
        interrupt::begin_rendering();
        let done = self.hunt(&search, &space, &store, studio, &*listener)?;
        if !done {
            let folder = self.out.display();
            return Err(Failure::Interrupted(format!(
                "what was measured is in {folder}; the same command goes on from there"
            )));
        }
        if self.shard.count > 1 {
            let text = format!(
                "shard {} of {} is done; `stillray trade merge` joins all of them\n",
                self.shard.index + 1,
                self.shard.count
            );
            return if self.source.quiet { Ok(()) } else { console::print(&text) };
        }
        conclude(&store, &search, &self.limits, self.source.quiet)
    }

    fn check(&self) -> Outcome {
        check_motions(&self.motions)?;
        let optics = &self.source.optics;
        if optics.aperture.is_some() || optics.focus.is_some() || optics.blades.is_some() || optics.shutter.is_some() {
            // What is found is looked at again later, from the scene's name alone.
            let message = "a search takes the lens and the shutter of the scene's camera: leave out --aperture, --focus, --blades and --shutter";
            return Err(Failure::Usage(message.to_owned()));
        }
        if self.source.surroundings.is_given() || self.source.fog.is_some() {
            let message = "a search takes the scene as it is: leave out --environment, --sky and --fog";
            return Err(Failure::Usage(message.to_owned()));
        }
        if self.shard.count > self.brackets as usize {
            let (n, brackets) = (self.shard.count, self.brackets);
            return Err(Failure::Usage(format!(
                "--shard I/{n}: there are {brackets} brackets to share out; raise --brackets"
            )));
        }
        self.limits.check()
    }

    fn hunt(
        &self,
        search: &Search,
        space: &Space,
        store: &Store,
        studio: Studio<'_>,
        progress: &dyn Progress,
    ) -> Outcome<bool> {
        let job = Job { search, space, store, studio, progress, stop: &interrupt::requested };
        Ok(job.run(self.shard)?)
    }

    fn space(&self, scene: &stillray::Scene) -> Outcome<Space> {
        let mut base = Settings { size: self.source.size, seed: self.source.seed, ..Settings::default() };
        let held = settings_file::assign_all(&self.held, &mut base)?.into_iter().map(|k| k.name.to_owned()).collect();
        base.validate()?;
        Ok(Space { base, held, scene: Traits::of(scene) })
    }

    fn search(&self, scene: &stillray::Scene, shot: &Shot, device: &Device, space: &Space) -> Search {
        let value = |name: &String| {
            let knob = stillray::settings::knob::Knob::find(name).ok()?;
            Some((name.clone(), knob.get(&space.base).to_string()))
        };
        Search {
            schema: 1,
            scene: self.source.scene.to_string_lossy().into_owned(),
            fingerprint: fingerprint(scene),
            camera: shot.camera().to_owned(),
            motions: self.motions.iter().map(|m| m.name().to_owned()).collect(),
            device: device.report().name.clone(),
            driver: device.report().driver.clone(),
            shaders: shaders_digest(),
            size: self.source.size,
            fps: self.source.fps,
            frames: self.frames,
            seed: self.source.seed,
            reference_spp: self.reference_spp.next_multiple_of(16),
            candidates: self.candidates as usize,
            brackets: self.brackets as usize,
            held: space.held.iter().filter_map(value).collect::<BTreeMap<_, _>>(),
            traits: space.scene,
        }
    }
}

impl Merge {
    fn run(self) -> Outcome {
        self.limits.check()?;
        let first = self.parts.first().map_or(Path::new("."), PathBuf::as_path);
        let (_, search) = Store::existing(first)?;
        let store = Store::open(&self.out, &search)?;
        store.absorb(&self.parts)?;
        conclude(&store, &search, &self.limits, self.quiet)
    }
}

impl Pick {
    fn run(self) -> Outcome {
        self.limits.check()?;
        if !self.limits.asked() {
            return Err(Failure::Usage("give --budget-ms, --max-flicker or --max-error".to_owned()));
        }
        let (store, search) = Store::existing(&self.folder)?;
        let found = outcome::collect(&store, &search, &outcome::space(&search)?)?;
        let text = self.limits.pick(&found)?;
        if self.quiet { Ok(()) } else { console::print(&text) }
    }
}

impl Check {
    fn run(self) -> Outcome {
        check_motions(&self.motions)?;
        interrupt::listen();
        self.json.as_deref().map_or(Ok(()), file::check_target)?;
        let (store, search) = Store::existing(&self.folder)?;
        let found = outcome::collect(&store, &search, &outcome::space(&search)?)?;
        let scene = scenes::load(search.scene.as_ref(), search.seed)?;
        let device = Device::open(Some(&search.device))?;
        self.same("scene", &search.fingerprint, &fingerprint(&scene))?;
        self.same("driver", &search.driver, &device.report().driver)?;
        self.same("shaders", &search.shaders, &shaders_digest())?;
        let shot = Shot::new(&scene, Some(&search.camera), Motion::Static)?;
        let listener = progress::for_user(self.quiet);
        let loaded = LoadedScene::new(&device, &scene, &*listener)?;
        let studio = Studio { device: &device, loaded: &loaded, scene: &scene, shot: &shot, fps: search.fps };
        interrupt::begin_rendering();
        let references = store.folder().join("reference");
        let check = promise::Check {
            studio,
            search: &search,
            outcome: &found,
            references: &references,
            progress: &*listener,
            stop: &interrupt::requested,
        };
        let trials = check.run(self.limits as usize, &self.motions)?;
        let trials =
            trials.ok_or_else(|| Failure::Interrupted("converged frames that are done are kept".to_owned()))?;
        if let Some(path) = &self.json {
            interrupt::uninterrupted(|| json::write(path, &trials))?;
        }
        self.conclude(&trials)
    }

    /// The clock and the pictures of something else say nothing about the search.
    fn same(&self, what: &str, then: &str, now: &str) -> Outcome {
        let message = format!("was made with another {what} ({then} then, {now} now): search again");
        if then == now { Ok(()) } else { Err(Error::Search { path: self.folder.clone(), message }.into()) }
    }

    fn conclude(&self, trials: &[Trial]) -> Outcome {
        if !self.quiet {
            console::print(&report::promises(trials))?;
        }
        let (kept, all) = (trials.iter().filter(|t| t.kept).count(), trials.len());
        let few = 10 * kept < 9 * all;
        let message = format!("{kept} of {all} limits were kept, fewer than nine in ten");
        if few { Err(Failure::Failed(message)) } else { Ok(()) }
    }
}

fn check_motions(motions: &[Motion]) -> Outcome {
    let twice = motions.iter().collect::<BTreeSet<_>>().len() < motions.len();
    if twice { Err(Failure::Usage("--motions has a motion twice".to_owned())) } else { Ok(()) }
}

/// Writes what a search found, and says it.
fn conclude(store: &Store, search: &Search, limits: &Limited, quiet: bool) -> Outcome {
    let found = outcome::collect(store, search, &outcome::space(search)?)?;
    let folder = store.folder();
    interrupt::uninterrupted(|| -> Outcome {
        report::write_json(folder, &found, &arguments::build())?;
        report::write_csv(folder, &found)?;
        report::write_html(folder, &found, &arguments::build())?;
        Ok(())
    })?;
    let [w, h] = search.size;
    let tried: Vec<String> = found.tried.iter().map(ToString::to_string).collect();
    let mut text = format!("{}, {w}x{h}, motions {}, {}\n", search.scene, search.motions.join(" and "), search.device);
    text += &format!(
        "settings tried: {}\n\n{}\n{}",
        tried.join(", of which "),
        report::table(&found),
        report::differences(&found)
    );
    text += &format!("\neverything is in {}: report.html to look at, trade.json, trade.csv\n", folder.display());
    if limits.asked() {
        text += &limits.pick(&found)?;
    }
    if quiet { Ok(()) } else { console::print(&text) }
}

impl Limited {
    fn asked(&self) -> bool {
        self.budget_ms.is_some() || self.max_flicker.is_some() || self.max_error.is_some()
    }

    fn check(&self) -> Outcome {
        if self.asked() { Ok(file::check_target(&self.pick)?) } else { Ok(()) }
    }

    /// Writes the settings file, and tells of it.
    fn pick(&self, found: &Found) -> Outcome<String> {
        let limits = Limits { budget_ms: self.budget_ms, max_flicker: self.max_flicker, max_error: self.max_error };
        let Choice { candidate, expected: [ms, flicker, flip], .. } = choose(found, &limits)?;
        let entry = found.entries.iter().find(|e| e.candidate == candidate);
        let Some(entry) = entry else { return Ok(String::new()) };
        file::write_text(&self.pick, &entry.settings)?;
        Ok(format!(
            "picked {}, written to {}: on motions not seen, in nineteen of twenty, up to {ms:.3} ms, flicker error {flicker:.4}, FLIP {flip:.4}\n",
            entry.label,
            self.pick.display()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_count_from_one() {
        assert_eq!(shard("1/1"), Ok(Shard { index: 0, count: 1 }));
        assert_eq!(shard("3/4"), Ok(Shard { index: 2, count: 4 }));
        for wrong in ["0/4", "5/4", "1", "a/b", "1/0", "-1/2", ""] {
            assert!(shard(wrong).is_err(), "{wrong}");
        }
    }
}
