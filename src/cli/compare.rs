//! `stillray compare`: how far frames are from their reference, image by image and over time.

use std::fs;
use std::path::PathBuf;

use clap::{ArgAction, Args};
use stillray::Error;
use stillray::metric::flip::PIXELS_PER_DEGREE;
use stillray::metric::relative_mse::EPSILON;
use stillray::metric::sequence::{Metric, Options, Sequence, Step};
use stillray::metric::warp::Geometry;
use stillray::report::compare::{Comparison, FLICKER_WHITE, Motion, Settings, Source, write_map};
use stillray::report::folder::{self, Folder, Key, Kind, Loaded, Pair};
use stillray::report::{file, json};

use super::arguments::{self, metric, ranged};
use super::{Failure, Outcome, console, interrupt, progress};

/// Measure frames against a reference: error, sharpness, flicker
#[derive(Debug, Args)]
pub struct Compare {
    /// Folder of the frames to judge: EXR or PNG files of any program, known by the last number in their names
    #[arg(value_name = "DIR")]
    frames: PathBuf,
    /// Folder of what they should look like, with as many frames of the same kind, numbers and size
    #[arg(value_name = "REFERENCE_DIR")]
    reference: PathBuf,
    /// Write all that was measured into this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Folder for maps, as EXR and, from dark to bright, as PNG: FLIP of each frame (0 to 1), RMS flicker error of all (0 to
    /// 0.25); it is made if need be
    #[arg(long, value_name = "DIR")]
    maps: Option<PathBuf>,
    /// Take the picture as still, whatever the reference's layers say; PNG files always are taken so
    #[arg(long = "static")]
    still: bool,
    /// EXR: stops by which frames are brightened before display values are made of them, from -32 to 32 [default: 0]
    #[arg(long, value_name = "EV", value_parser = ranged(-32.0, 32.0), allow_negative_numbers = true)]
    exposure: Option<f64>,
    /// FLIP: pixels a degree of visual angle, from 1 to 1000
    #[arg(long, value_name = "N", default_value_t = PIXELS_PER_DEGREE, value_parser = ranged(1.0, 1000.0), allow_negative_numbers = true)]
    ppd: f64,
    /// What to measure [default: everything]
    #[arg(long, value_name = "METRICS", value_delimiter = ',', action = ArgAction::Set, value_parser = metric())]
    metrics: Option<Vec<Metric>>,
    /// No progress and no table; errors and notes are still told
    #[arg(long)]
    quiet: bool,
}

/// What is measured so far.
struct Job<'a> {
    compare: &'a Compare,
    kind: Kind,
    sequence: Sequence,
    motion: Motion,
    last: Option<Key>,
    frames: usize,
}

impl Compare {
    /// Measures, writes and prints.
    pub fn run(self) -> Outcome {
        interrupt::listen();
        let (frames, reference) = (Folder::open(&self.frames)?, Folder::open(&self.reference)?);
        let pairs = frames.paired(&reference)?;
        if frames.kind() == Kind::Png && self.exposure.is_some() {
            return Err(Failure::Usage("--exposure has a meaning for EXR files only".to_owned()));
        }
        self.prepare_targets()?;
        let mut job = self.start(frames.kind(), &pairs)?;
        let listener = progress::for_user(self.quiet);
        interrupt::begin_rendering();
        listener.begin("comparing", pairs.len() as u64);
        for pair in &pairs {
            if interrupt::requested() {
                return Err(Failure::Interrupted(format!("after {} of {} frames", job.frames, pairs.len())));
            }
            job.frame(pair)?;
            listener.advance(1);
        }
        listener.finish();
        job.finish()
    }

    /// Tries every place to be written to before any time is spent.
    fn prepare_targets(&self) -> Outcome {
        if let Some(path) = &self.json {
            file::check_target(path)?;
        }
        if let Some(folder) = &self.maps {
            fs::create_dir_all(folder).map_err(|cause| Error::Io { path: folder.clone(), cause })?;
            file::spool_beside(&folder.join("flicker.png"))?;
        }
        Ok(())
    }

    fn start(&self, kind: Kind, pairs: &[Pair]) -> Outcome<Job<'_>> {
        let source = match (kind, self.still) {
            (_, true) => Source::Static,
            (Kind::Png, false) => Source::Png,
            (Kind::Exr, false) if has_geometry(&pairs[0])? => Source::Layers,
            (Kind::Exr, false) => Source::None,
        };
        let asked = self.metrics.as_ref().is_some_and(|m| m.contains(&Metric::Flicker));
        if source == Source::None && asked {
            let advice = "render it with --aov motion,depth, or add --static if nothing moves";
            let folder = self.reference.display();
            return Err(Failure::Failed(format!(
                "{folder}: no layers motion and depth to measure flicker along: {advice}"
            )));
        }
        let options = Options { metrics: self.metrics(), pixels_per_degree: self.ppd };
        let sequence = Sequence::new(options)?;
        Ok(Job { compare: self, kind, sequence, motion: Motion::new(source), last: None, frames: 0 })
    }

    fn metrics(&self) -> Vec<Metric> {
        self.metrics.clone().unwrap_or_else(|| Metric::ALL.to_vec())
    }
}

fn has_geometry(pair: &Pair) -> Outcome<bool> {
    Ok(folder::read(&pair.reference, Kind::Exr, 0.0)?.geometry.is_some())
}

impl Job<'_> {
    fn frame(&mut self, pair: &Pair) -> Outcome {
        let exposure = self.compare.exposure.unwrap_or(0.0) as f32;
        let read = |path| folder::read(path, self.kind, exposure);
        let (frame, reference) = rayon::join(|| read(&pair.frame), || read(&pair.reference));
        let (frame, reference) = (frame?, reference?);
        self.check_sizes(pair, &frame, &reference)?;
        let geometry = self.geometry(pair, &reference)?;
        let name = pair.key.to_string();
        let (changes, geometry) = (frame.changes.as_ref(), geometry.as_ref());
        let step = Step { name: &name, frame: &frame.frame, reference: &reference.frame, geometry, changes };
        let flip = self.sequence.push(&step)?;
        if let Some((folder, map)) = self.compare.maps.as_ref().zip(flip) {
            let file = match &pair.key {
                Key::Number(number) => format!("flip_{number:04}"),
                Key::Name(name) => format!("flip_{name}"),
            };
            interrupt::uninterrupted(|| write_map(folder, &file, &map, 1.0, &[]))?;
        }
        self.frames += 1;
        self.last = Some(pair.key.clone());
        Ok(())
    }

    /// How surfaces move in this frame. Where frames are missing, vectors have nothing to lead to.
    fn geometry(&mut self, pair: &Pair, reference: &Loaded) -> Outcome<Option<Geometry>> {
        let [width, height] = reference.frame.size();
        match self.motion.source {
            Source::Static | Source::Png => return Ok(Some(Geometry::still(width, height))),
            Source::None => return Ok(None),
            Source::Layers => {}
        }
        let missing = || Error::Image {
            path: pair.reference.clone(),
            message: "has no layers motion and depth, but the frames before have".to_owned(),
        };
        let geometry = reference.geometry.as_ref().ok_or_else(missing)?;
        match (&self.last, &pair.key) {
            (None, _) => {}
            (Some(Key::Number(last)), Key::Number(now)) if *now == last + 1 => self.motion.add(geometry),
            _ => {
                self.motion.cuts += 1;
                self.sequence.cut();
            }
        }
        Ok(Some(geometry.clone()))
    }

    fn check_sizes(&self, pair: &Pair, frame: &Loaded, reference: &Loaded) -> Outcome {
        let wrong = |path: &PathBuf, [w, h]: [usize; 2], whose: &str, [x, y]: [usize; 2]| {
            let message = format!("{w}x{h} pixels, but {whose} {x}x{y}");
            Err(Failure::from(Error::Image { path: path.clone(), message }))
        };
        let (size, expected) = (frame.frame.size(), reference.frame.size());
        if size != expected {
            return wrong(&pair.frame, size, &format!("{} has", pair.reference.display()), expected);
        }
        match self.sequence.size().filter(|before| *before != size) {
            Some(before) => wrong(&pair.frame, size, "the frames before have", before),
            None => Ok(()),
        }
    }

    fn finish(self) -> Outcome {
        let compare = self.compare;
        if let Some((folder, [map, count])) = compare.maps.as_ref().zip(self.sequence.flicker_map()) {
            let layers = [("valid.V", &count)];
            interrupt::uninterrupted(|| write_map(folder, "flicker", &map, FLICKER_WHITE, &layers))?;
        }
        if self.motion.cuts > 0 {
            let note =
                format!("numbers of frames are missing {} times: flicker is not measured across", self.motion.cuts);
            console::notes(&[note]);
        }
        let comparison = Comparison {
            schema: 1,
            build: arguments::build(),
            frames_folder: compare.frames.display().to_string(),
            reference_folder: compare.reference.display().to_string(),
            kind: self.kind,
            settings: Settings {
                metrics: compare.metrics(),
                exposure: compare.exposure.unwrap_or(0.0),
                flip: if self.kind == Kind::Exr { "HDR" } else { "LDR" },
                flip_ppd: compare.ppd,
                relative_mse_epsilon: EPSILON,
            },
            motion: self.motion,
            report: self.sequence.finish(),
        };
        if let Some(path) = &compare.json {
            interrupt::uninterrupted(|| json::write(path, &comparison))?;
        }
        if compare.quiet { Ok(()) } else { console::print(&comparison.text()) }
    }
}
