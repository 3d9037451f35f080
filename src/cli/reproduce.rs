//! `stillray reproduce`: the papers' figures beside measured ones.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::PathBuf;

use clap::{ArgAction, Args};
use stillray::headless::{Device, LoadedScene};
use stillray::progress::Progress;
use stillray::report::{file, json};
use stillray::reproduce::coherence::{self, coherence};
use stillray::reproduce::contest::{Contestant, Score, contest};
use stillray::reproduce::figures::{Figures, distributions, qualities, samplers, thickening};
use stillray::reproduce::phases;
use stillray::reproduce::tables::{FIGURE_5, REFERENCE, claims, details, figure_5, overview, points};
use stillray::scene::fingerprint::fingerprint;
use stillray::scene::motion::Motion;
use stillray::scene::requirements::Traits;
use stillray::scene::shot::Shot;
use stillray::trade::reference::shaders_digest;
use stillray::trade::store::Search;
use stillray::trade::studio::Studio;
use stillray::{Error, Scene};

use super::arguments::{Contender, counted, motion, size};
use super::{Failure, Outcome, console, interrupt, progress, scenes};

/// Measure methods side by side, and print the papers' figures beside it, as Markdown
#[derive(Debug, Args)]
pub struct Reproduce {
    /// Scenes to measure in
    #[arg(long, value_name = "SCENES", value_delimiter = ',', action = ArgAction::Set,
          default_value = "builtin:hairball,builtin:text,builtin:bump,builtin:terrain,builtin:spheres,builtin:cornell")]
    scenes: Vec<String>,
    /// Camera motions
    #[arg(long, value_name = "NAMES", default_value = "rotate,pan,orbit", value_delimiter = ',', action = ArgAction::Set, value_parser = motion())]
    motions: Vec<Motion>,
    /// What to compare: methods with their samples a pixel, or settings files
    #[arg(long, value_name = "METHODS", value_delimiter = ',', action = ArgAction::Set,
          default_value = "stable:2,stable+ti:2,supersample:2,taa:2,point-tracking,stable:1,supersample:1")]
    methods: Vec<Contender>,
    /// Width and height in pixels, each from 64 to 16384
    #[arg(long, value_name = "WxH", default_value = "128x128", value_parser = size)]
    size: [u32; 2],
    /// Frames measured of each motion, from 4 to 10000
    #[arg(long, value_name = "N", default_value = "12", value_parser = counted(4, 10_000))]
    frames: u32,
    /// Samples a pixel of the frames to compare with, from 16 to 65536
    #[arg(long, value_name = "N", default_value = "64", value_parser = counted(16, 65_536))]
    reference_spp: u32,
    /// The papers' size of 1080x1080
    #[arg(long)]
    full: bool,
    /// Only figures and tables that are rendered for themselves and whose titles contain this, such as `coherence`; no methods side by side
    #[arg(long, value_name = "WORDS")]
    only: Option<String>,
    /// Folder for reproduce.md and reproduce.json
    #[arg(long, value_name = "DIR", default_value = "reproduce")]
    out: PathBuf,
    /// The device to run on: its number or a part of its name [default: the best one]
    #[arg(long, value_name = "X")]
    device: Option<String>,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

impl Reproduce {
    /// Measures and writes.
    pub fn run(mut self) -> Outcome {
        if self.full {
            self.size = [1080, 1080];
        }
        interrupt::listen();
        fs::create_dir_all(&self.out).map_err(|cause| Error::Io { path: self.out.clone(), cause })?;
        file::check_target(&self.out.join("reproduce.md"))?;
        let device = Device::open(self.device.as_deref())?;
        interrupt::begin_rendering();
        let scores = if self.only.is_none() { self.contests(&device)? } else { Vec::new() };
        let figure = match self.only {
            None => self.scene("builtin:hairball", &device, &figure_5_contestants()?, &[Motion::Rotate])?,
            Some(_) => Vec::new(),
        };
        let pictures = self.figures(&device)?;
        if let (Some(words), true) = (&self.only, pictures.is_empty()) {
            let expected = "words of a figure's title, such as 'Table 1', 'Figure 6' or 'coherence'".to_owned();
            return Err(Error::Setting { name: "only", value: words.clone(), expected }.into());
        }
        let text = self.text(&device, &scores, &figure, &pictures);
        interrupt::uninterrupted(|| -> Outcome {
            if self.only.is_none() {
                json::write(&self.out.join("reproduce.json"), &scores)?;
            }
            Ok(file::write_text(&self.out.join("reproduce.md"), &text)?)
        })?;
        if self.quiet { Ok(()) } else { console::print(&format!("{text}\nwritten to {}\n", self.out.display())) }
    }

    /// All methods in all scenes.
    fn contests(&self, device: &Device) -> Outcome<Vec<Score>> {
        let contestants: Vec<Contestant> = self.methods.iter().map(contestant).collect();
        let scores = self.scenes.iter().map(|name| self.scene(name, device, &contestants, &self.motions));
        Ok(scores.collect::<Outcome<Vec<_>>>()?.concat())
    }

    /// Whether a figure of this title is asked for.
    fn wants(&self, title: &str) -> bool {
        self.only.as_ref().is_none_or(|words| title.to_lowercase().contains(&words.to_lowercase()))
    }

    fn scene(&self, name: &str, device: &Device, who: &[Contestant], motions: &[Motion]) -> Outcome<Vec<Score>> {
        self.with_studio(name, device, |studio, listener| {
            let search = self.search(name, studio.scene, studio.shot, device);
            let references = self.out.join("reference");
            let mut scores = Vec::new();
            for &motion in motions {
                let found = contest(studio, &search, &references, who, motion, listener, &interrupt::requested)?;
                scores.extend(found.ok_or_else(stopped)?);
            }
            Ok(scores)
        })
    }

    /// Loads a scene and does something in it.
    fn with_studio<T>(
        &self,
        name: &str,
        device: &Device,
        work: impl FnOnce(&Studio<'_>, &dyn Progress) -> Outcome<T>,
    ) -> Outcome<T> {
        let scene = scenes::load(name.as_ref(), 0)?;
        console::notes(&scene.notices);
        let listener = progress::for_user(self.quiet);
        let loaded = LoadedScene::new(device, &scene, &*listener)?;
        let shot = Shot::new(&scene, None, Motion::Static)?;
        work(&Studio { device, loaded: &loaded, scene: &scene, shot: &shot, fps: 60.0 }, &*listener)
    }

    /// What is rendered to be looked at, as titles and Markdown; and paper 1's table 1.
    fn figures(&self, device: &Device) -> Outcome<Vec<(String, String)>> {
        let folder = self.out.join("figures");
        fs::create_dir_all(&folder).map_err(|cause| Error::Io { path: folder.clone(), cause })?;
        let mut all = Vec::new();
        let title = "Paper 1, Table 1: time of the phases on the hairball";
        if self.wants(title) {
            let table = self.with_studio("builtin:hairball", device, |studio, progress| {
                phases::measure(studio, self.size, progress, &interrupt::requested)?.ok_or_else(stopped)
            })?;
            all.push((title.to_owned(), phases::table(&table)));
        }
        let mut figure = |scene: &str, title: &str, draw: fn(&Figures<'_>) -> stillray::Result<Option<String>>| {
            if !self.wants(title) {
                return Ok(());
            }
            self.with_studio(scene, device, |studio, progress| {
                let stop = &interrupt::requested;
                let figures = Figures { studio: *studio, scene, size: self.size, folder: &folder, progress, stop };
                all.push((format!("{title} ({scene})"), draw(&figures)?.ok_or_else(stopped)?));
                Ok(())
            })
        };
        figure("builtin:hairball", "Paper 1, Figure 6: sample distributions", distributions)?;
        for scene in ["builtin:hairball", "builtin:text", "builtin:bump"] {
            figure(scene, "Paper 1, Figure 8: supersampling and stable ray tracing", qualities)?;
        }
        figure("builtin:strands", "Paper 1, Figure 10: edge thickening, before and after", thickening)?;
        figure("builtin:penumbra", "Paper 2, Figure 16: strategies and tilings", samplers)?;
        figure(coherence::SCENE, "Paper 2, Figures 17 to 20: coherence", coherence)?;
        Ok(all)
    }

    fn search(&self, name: &str, scene: &Scene, shot: &Shot, device: &Device) -> Search {
        Search {
            schema: 1,
            scene: name.to_owned(),
            fingerprint: fingerprint(scene),
            camera: shot.camera().to_owned(),
            motions: self.motions.iter().map(|m| m.name().to_owned()).collect(),
            device: device.report().name.clone(),
            driver: device.report().driver.clone(),
            shaders: shaders_digest(),
            size: self.size,
            fps: 60.0,
            frames: self.frames,
            seed: 0,
            reference_spp: self.reference_spp.next_multiple_of(16),
            candidates: 0,
            brackets: 1,
            held: BTreeMap::new(),
            traits: Traits::of(scene),
        }
    }

    fn text(&self, device: &Device, scores: &[Score], figure: &[Score], pictures: &[(String, String)]) -> String {
        let [w, h] = self.size;
        let mut text = format!(
            "# What the papers say, and what is measured\n\n{w}×{h}, {} frames a motion at 60 frames a second, reference {} samples \
             a pixel, {} ({}).\n",
            self.frames,
            self.reference_spp,
            device.report().name,
            device.report().driver
        );
        let mut section = |title: &str, body: String| {
            let _ = write!(text, "\n## {title}\n\n{body}");
        };
        let whole = self.only.is_none();
        if whole {
            section("Methods, over all scenes and motions", overview(scores));
            section("What was aimed at, and what paper 1 claims", claims(scores));
            section("Paper 3, Table 1", points(scores));
            section("Paper 1, Figure 5: sharpness on the hairball (CPBD)", figure_5(figure));
        }
        pictures.iter().for_each(|(title, body)| section(title, body.clone()));
        if whole {
            section("Every scene and motion", details(scores));
        }
        text
    }
}

fn stopped() -> Failure {
    Failure::Interrupted("the references that are done are kept".to_owned())
}

fn contestant(contender: &Contender) -> Contestant {
    Contestant { name: contender.name.clone(), settings: contender.settings.clone() }
}

/// Those of the figure that are methods of ours: its last is a reference.
fn figure_5_contestants() -> Outcome<Vec<Contestant>> {
    let methods = FIGURE_5.iter().filter(|(name, _)| *name != REFERENCE);
    let parsed = methods.map(|(name, _)| name.parse::<Contender>().map_err(Failure::Failed));
    Ok(parsed.collect::<Outcome<Vec<_>>>()?.iter().map(contestant).collect())
}
