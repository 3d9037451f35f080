//! `stillray render`: frames into files.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::time::Instant;

use clap::{ArgAction, Args};
use serde::Serialize;
use stillray::Error;
use stillray::headless::{Device, DeviceReport, LoadedScene, MemoryRow, Session};
use stillray::renderer::{Aov, FrameInputs, FrameStats, Method, PhaseTime, RayCosts, Settings};
use stillray::report::apng::Animation;
use stillray::report::bench::{Build, percent, reprojected_shares};
use stillray::report::openexr::Exr;
use stillray::report::png::Picture;
use stillray::report::statistics::{Summary, mean};
use stillray::report::table::grouped;
use stillray::report::{costs, file, json};
use stillray::scene::motion::Motion;
use stillray::settings::knob::{KNOBS, Knob, Value};

use super::arguments::{self, Source, Tuning, aov, counted, method, motion, named, ranged};
use super::scenes::Stage;
use super::{Failure, Outcome, console, interrupt, progress};

/// Render frames of a scene into files
#[derive(Debug, Args)]
pub struct Render {
    #[command(flatten)]
    source: Source,
    #[command(flatten)]
    tuning: Tuning,
    /// What is rendered with [default: stable]
    #[arg(long, value_name = "METHOD", value_parser = method())]
    method: Option<Method>,
    /// stable, stable+ti: samples a pixel to aim at, from 0.0625 to 16 [default: 1]
    #[arg(long, value_name = "D", value_parser = ranged(0.0625, 16.0), allow_negative_numbers = true)]
    density: Option<f64>,
    /// stable, stable+ti: deviation from the density that is tolerated, from 0.0625 to 16 [default: 1]
    #[arg(long, value_name = "T", value_parser = ranged(0.0625, 16.0), allow_negative_numbers = true)]
    tolerance: Option<f64>,
    /// supersample, taa, reference: samples a pixel, from 1 to 16 [default: 1, reference: 16]
    #[arg(long, value_name = "N", value_parser = counted(1, 16), allow_negative_numbers = true)]
    spp: Option<u32>,
    /// supersample: other sample positions in each frame
    #[arg(long)]
    jitter: bool,
    /// reference: how often each frame is rendered and averaged, from 1 to 65536 [default: 64]
    #[arg(long, value_name = "N", value_parser = counted(1, 65536), allow_negative_numbers = true)]
    passes: Option<u32>,
    /// Frames to render, from 1 to 1000000
    #[arg(long, value_name = "N", default_value = "1", value_parser = counted(1, 1_000_000), allow_negative_numbers = true)]
    frames: u32,
    /// How the camera moves
    #[arg(long, value_name = "NAME", default_value = "static", value_parser = motion())]
    motion: Motion,
    /// Folder for the frames; it is made if need be
    #[arg(long, value_name = "DIR", default_value = "frames")]
    out: PathBuf,
    /// Files to write a frame: exr (scene-linear floats), png (tone-mapped to 8-bit sRGB)
    #[arg(
        long,
        value_name = "FORMATS",
        default_value = "png",
        value_delimiter = ',',
        action = ArgAction::Set,
        value_parser = named([("exr", Format::Exr), ("png", Format::Png)]),
        hide_possible_values = true
    )]
    format: Vec<Format>,
    /// Layers to add to EXR files: distance in metres, motion in pixels, samples evicted, added and kept, age in frames,
    /// samples changed
    #[arg(long, value_name = "LAYERS", value_delimiter = ',', action = ArgAction::Set, value_parser = aov())]
    aov: Vec<Aov>,
    /// Count what rays cost: the frames are the same, and take longer
    #[arg(long)]
    count: bool,
    /// EXR colour in 32-bit floats instead of 16-bit ones
    #[arg(long)]
    float: bool,
    /// Stops by which pictures (not EXR files) are brightened, from -32 to 32
    #[arg(long, value_name = "EV", default_value = "0", value_parser = ranged(-32.0, 32.0), allow_negative_numbers = true)]
    exposure: f64,
    /// Write an animated PNG of all frames into this file
    #[arg(long, value_name = "FILE")]
    preview: Option<PathBuf>,
}

/// A kind of picture file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Exr,
    Png,
}

/// What `--json` holds.
#[derive(Debug, Serialize)]
struct Report<'a> {
    schema: u32,
    device: &'a DeviceReport,
    build: Build,
    scene: &'a str,
    settings: SettingsReport<'a>,
    memory: Vec<MemoryRow>,
    frames: &'a [FrameReport],
    totals: Totals,
}

#[derive(Debug, Serialize)]
struct SettingsReport<'a> {
    #[serde(flatten)]
    knobs: BTreeMap<&'static str, Value>,
    size: [u32; 2],
    passes: u32,
    seed: u32,
    motion: &'a str,
    camera: &'a str,
    fps: f64,
}

#[derive(Debug, Serialize)]
struct FrameReport {
    index: u32,
    seconds: f64,
    reused_fraction: f64,
    /// Share of pixels with 0, 1, 2, 3, and 4 or more reprojected samples.
    reprojected: [f64; 5],
    #[serde(flatten)]
    stats: FrameStats,
    ms: f64,
    phases: Vec<PhaseTime>,
}

#[derive(Debug, Serialize)]
struct Totals {
    frames: usize,
    wall_seconds: f64,
    ms: Summary,
    rays: u64,
    shadow_rays: u64,
    reused_fraction: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    costs: Option<RayCosts>,
    complete: bool,
}

impl Render {
    /// Renders and writes.
    pub fn run(self) -> Outcome {
        let settings = self.settings()?;
        interrupt::listen();
        let stage = Stage::load(&self.source, self.motion)?;
        let device = Device::open(self.source.device.as_deref())?;
        let preview = self.prepare_targets()?;
        let listener = progress::for_user(self.source.quiet);
        let scene = LoadedScene::new(&device, &stage.scene, &*listener)?;
        let session = Session::new(&device, &scene, &settings)?;
        let mut job = Job { render: &self, stage: &stage, settings, session, preview, frames: Vec::new() };
        let started = Instant::now();
        interrupt::begin_rendering();
        listener.begin("rendering", u64::from(self.frames));
        for index in 0..self.frames {
            if interrupt::requested() {
                break;
            }
            job.frame(index)?;
            listener.advance(1);
        }
        listener.finish();
        job.finish(&device, started.elapsed().as_secs_f64())
    }

    /// The renderer's settings, if the options fit together.
    fn settings(&self) -> Outcome<Settings> {
        let mut settings = self.tuning.base()?;
        settings.switch(self.method.unwrap_or(settings.method));
        settings.density = self.density.map_or(settings.density, |d| d as f32);
        settings.tolerance = self.tolerance.map_or(settings.tolerance, |t| t as f32);
        settings.jitter |= self.jitter;
        settings.float_output |= self.float;
        settings.spp = self.spp.unwrap_or(settings.spp);
        self.tuning.assign(&mut settings)?;
        self.refuse_idle(settings.method)?;
        if !self.format.contains(&Format::Exr) && (self.float || !self.aov.is_empty()) {
            let option = if self.float { "--float" } else { "--aov" };
            return Err(Failure::Usage(format!("{option} needs EXR files: add --format exr or --format exr,png")));
        }
        settings.aovs = self.aov.clone();
        settings.aovs.sort_by_key(|&a| a as u32);
        settings.aovs.dedup();
        Ok(Settings { size: self.source.size, seed: self.source.seed, count: self.count, ..settings })
    }

    /// An option that means nothing to the method is a mistake.
    fn refuse_idle(&self, method: Method) -> Outcome {
        let given = [
            (self.density.is_some(), "density"),
            (self.tolerance.is_some(), "tolerance"),
            (self.spp.is_some(), "spp"),
            (self.jitter, "jitter"),
        ];
        for (_, name) in given.into_iter().filter(|(given, _)| *given) {
            arguments::refuse_idle(Knob::find(name)?, method, &format!("--{name}"))?;
        }
        if self.passes.is_some() && !method.accumulates() {
            return Err(Failure::Usage("--passes has a meaning for --method reference only".to_owned()));
        }
        Ok(())
    }

    /// Makes the folder, and tries every place to be written to before any time is spent on rendering.
    fn prepare_targets(&self) -> Outcome<Option<Animation>> {
        fs::create_dir_all(&self.out).map_err(|cause| Error::Io { path: self.out.clone(), cause })?;
        file::spool_beside(&self.out.join("frame_0000"))?;
        if let Some(path) = &self.source.json {
            file::check_target(path)?;
        }
        let start = |path: &PathBuf| Animation::new(path, self.source.size, self.source.fps);
        Ok(self.preview.as_ref().map(start).transpose()?)
    }

    fn passes(&self, settings: &Settings) -> u32 {
        if settings.method.accumulates() { self.passes.unwrap_or(64) } else { 1 }
    }
}

/// The frames so far and where the next one goes.
struct Job<'a> {
    render: &'a Render,
    stage: &'a Stage,
    settings: Settings,
    session: Session,
    preview: Option<Animation>,
    frames: Vec<FrameReport>,
}

impl Job<'_> {
    fn frame(&mut self, index: u32) -> Outcome {
        let seconds = f64::from(index) / self.render.source.fps;
        let (pose, view) = self.stage.at(seconds);
        let accumulates = self.settings.method.accumulates();
        let mut measured = Measured::default();
        for pass in 0..self.render.passes(&self.settings) {
            // An accumulating method starts afresh with each frame, the others with the first one.
            let reset = pass == 0 && (index == 0 || accumulates);
            let stats = self.session.frame(&FrameInputs { view, pose: &pose, reset })?;
            measured.add(stats, self.session.phase_times());
        }
        self.frames.push(measured.report(index, seconds));
        interrupt::uninterrupted(|| self.write(index))
    }

    fn write(&mut self, index: u32) -> Outcome {
        let color = self.session.color()?;
        let target = |extension: &str| self.render.out.join(format!("frame_{index:04}.{extension}"));
        if self.render.format.contains(&Format::Exr) {
            let mut exr = Exr::new(&color, self.settings.float_output);
            exr.fps = Some(self.render.source.fps);
            for &aov in &self.settings.aovs {
                exr.push_aov(aov, &self.session.aov(aov)?);
            }
            exr.write(&target("exr"))?;
        }
        let wants_png = self.render.format.contains(&Format::Png);
        if wants_png || self.preview.is_some() {
            let picture = Picture::tone_mapped(&color, self.render.exposure as f32);
            if wants_png {
                picture.write(&target("png"))?;
            }
            if let Some(preview) = &mut self.preview {
                preview.push(&picture)?;
            }
        }
        Ok(())
    }

    /// Writes what belongs to the whole sequence, and says how it went.
    fn finish(self, device: &Device, wall_seconds: f64) -> Outcome {
        let complete = self.frames.len() == self.render.frames as usize;
        let totals = totals(&self.frames, wall_seconds, complete);
        let summary = self.summary(&totals, device);
        if let Some(path) = &self.render.source.json {
            let report = self.report(device, totals);
            interrupt::uninterrupted(|| json::write(path, &report))?;
        }
        if let Some(preview) = self.preview {
            interrupt::uninterrupted(|| preview.finish())?;
        }
        if !complete {
            let folder = self.render.out.display();
            return Err(Failure::Interrupted(format!("{} whole frames are in {folder}", self.frames.len())));
        }
        if self.render.source.quiet { Ok(()) } else { console::print(&summary) }
    }

    fn report<'a>(&'a self, device: &'a Device, totals: Totals) -> Report<'a> {
        let settings = &self.settings;
        Report {
            schema: 1,
            device: device.report(),
            build: arguments::build(),
            scene: &self.stage.name,
            settings: SettingsReport {
                knobs: KNOBS.iter().map(|knob| (knob.name, knob.get(settings))).collect(),
                size: settings.size,
                passes: self.render.passes(settings),
                seed: settings.seed,
                motion: self.stage.motion(),
                camera: self.stage.camera(),
                fps: self.render.source.fps,
            },
            memory: self.session.memory(),
            frames: &self.frames,
            totals,
        }
    }

    fn summary(&self, totals: &Totals, device: &Device) -> String {
        let [w, h] = self.settings.size;
        let kinds: Vec<&str> =
            self.render.format.iter().map(|f| if *f == Format::Exr { ".exr" } else { ".png" }).collect();
        let mut text = format!(
            "{} of {w}x{h} in {} (frame_0000{} ...)\n",
            plural(totals.frames, "frame"),
            self.render.out.display(),
            kinds.join(", ")
        );
        if let Some(path) = &self.render.preview {
            text += &format!("animation in {}\n", path.display());
        }
        let per_frame = grouped(totals.rays / totals.frames.max(1) as u64);
        text +=
            &format!("median {:.1} ms a frame on {}, {per_frame} camera rays", totals.ms.median, device.report().name);
        if self.settings.method.reprojects() && totals.frames > 1 {
            text += &format!(", {} of them reused", percent(totals.reused_fraction));
        }
        text += "\n";
        if let Some(costs) = totals.costs {
            text += &format!("\n{}", costs::table([("what rays cost".to_owned(), costs)], totals.frames as u64));
        }
        text
    }
}

/// Sums what a frame's passes did; there is one, but for the reference.
#[derive(Default)]
struct Measured {
    stats: Option<FrameStats>,
    phases: Vec<PhaseTime>,
}

impl Measured {
    fn add(&mut self, stats: FrameStats, times: Vec<PhaseTime>) {
        let sum = self.stats.get_or_insert(FrameStats { rays: 0, shadow_rays: 0, shaded: 0, costs: None, ..stats });
        sum.rays = sum.rays.saturating_add(stats.rays);
        sum.shadow_rays = sum.shadow_rays.saturating_add(stats.shadow_rays);
        sum.shaded = sum.shaded.saturating_add(stats.shaded);
        sum.costs = costs::sum([sum.costs, stats.costs]);
        for time in times {
            match self.phases.iter_mut().find(|p| p.label == time.label) {
                Some(phase) => phase.ms += time.ms,
                None => self.phases.push(time),
            }
        }
    }

    fn report(self, index: u32, seconds: f64) -> FrameReport {
        let stats = self.stats.unwrap_or_default();
        FrameReport {
            index,
            seconds,
            reused_fraction: stats.reused_fraction(),
            reprojected: reprojected_shares(&stats),
            stats,
            ms: self.phases.iter().map(|p| p.ms).sum(),
            phases: self.phases,
        }
    }
}

/// The first frame has nothing to reuse, and the driver compiles in it: it does not count in the shares and the times,
/// unless it is the only one.
fn totals(frames: &[FrameReport], wall_seconds: f64, complete: bool) -> Totals {
    let settled = &frames[usize::from(frames.len() > 1)..];
    Totals {
        frames: frames.len(),
        wall_seconds,
        ms: Summary::of(&settled.iter().map(|f| f.ms).collect::<Vec<_>>()),
        rays: frames.iter().map(|f| u64::from(f.stats.rays)).sum(),
        shadow_rays: frames.iter().map(|f| u64::from(f.stats.shadow_rays)).sum(),
        reused_fraction: mean(settled.iter().map(|f| f.reused_fraction)),
        costs: costs::sum(frames.iter().map(|f| f.stats.costs)),
        complete,
    }
}

fn plural(n: usize, what: &str) -> String {
    if n == 1 { format!("1 {what}") } else { format!("{n} {what}s") }
}
