//! `stillray bench`: what each method costs, phase by phase.

use std::time::Instant;

use clap::{ArgAction, Args};
use stillray::headless::{Device, LoadedScene, Session};
use stillray::renderer::{FrameInputs, Settings};
use stillray::report::bench::{self as report, Collector, MethodResult, ratios};
use stillray::report::{file, json};
use stillray::scene::motion::Motion;
use stillray::settings::file as settings_file;

use super::arguments::{self, Contender, Source, counted, motion};
use super::scenes::Stage;
use super::{Failure, Outcome, console, interrupt, progress};

/// Time methods against each other, phase by phase
#[derive(Debug, Args)]
pub struct Bench {
    #[command(flatten)]
    source: Source,
    /// What to compare: a method with its samples a pixel, such as stable:0.5, or a settings file, such as fast.toml
    #[arg(
        long,
        value_name = "METHODS",
        default_value = "stable:1,stable:2,supersample:1,supersample:2",
        value_delimiter = ',',
        action = ArgAction::Set
    )]
    methods: Vec<Contender>,
    /// Set a knob of all methods that have it, as in tolerance=0.5, however often; `stillray settings` lists them
    #[arg(long = "set", value_name = "NAME=VALUE")]
    assignments: Vec<String>,
    /// Frames to measure, from 1 to 100000
    #[arg(long, value_name = "N", default_value = "16", value_parser = counted(1, 100_000), allow_negative_numbers = true)]
    frames: u32,
    /// Frames to render before, from 0 to 100000, beside the first one
    #[arg(long, value_name = "N", default_value = "4", value_parser = counted(0, 100_000), allow_negative_numbers = true)]
    warmup: u32,
    /// Count what rays cost, in a second run of each frame that is not timed
    #[arg(long)]
    count: bool,
    /// How the camera moves
    #[arg(long, value_name = "NAME", default_value = "rotate", value_parser = motion())]
    motion: Motion,
}

/// A method at work.
struct Runner {
    contender: Contender,
    session: Session,
    /// Renders the same frames, and counts.
    counting: Option<Session>,
    /// Bytes that the session took.
    memory: u64,
    first_frame_ms: f64,
    collector: Collector,
}

impl Bench {
    /// Measures and prints.
    pub fn run(self) -> Outcome {
        self.refuse_duplicates()?;
        let contenders = self.contenders()?;
        interrupt::listen();
        let stage = Stage::load(&self.source, self.motion)?;
        if let Some(path) = &self.source.json {
            file::check_target(path)?;
        }
        let device = Device::open(self.source.device.as_deref())?;
        let listener = progress::for_user(self.source.quiet);
        let scene = LoadedScene::new(&device, &stage.scene, &*listener)?;
        let start = |contender: &Contender| self.start(contender, &device, &scene);
        let mut runners = contenders.iter().map(start).collect::<Outcome<Vec<_>>>()?;
        let frames = 1 + self.warmup + self.frames;
        listener.begin("measuring", u64::from(frames));
        for index in 0..frames {
            self.frame(index, &stage, &mut runners)?;
            listener.advance(1);
        }
        listener.finish();
        let report = self.report(&device, &stage, runners);
        if let Some(path) = &self.source.json {
            json::write(path, &report)?;
        }
        if self.source.quiet {
            return Ok(());
        }
        let [w, h] = self.source.size;
        let device = &report.device;
        let title = format!("{}, {w}x{h}, motion {}, {}\n\n", report.scene, stage.motion(), device.name);
        console::print(&(title + &report.text()))
    }

    fn refuse_duplicates(&self) -> Outcome {
        for (i, contender) in self.methods.iter().enumerate() {
            if self.methods[..i].contains(contender) {
                return Err(Failure::Usage(format!("--methods has {} twice", contender.name)));
            }
        }
        Ok(())
    }

    /// The methods with the knobs that are set for all of them. One that none of them has is a mistake.
    fn contenders(&self) -> Outcome<Vec<Contender>> {
        let mut contenders = self.methods.clone();
        for words in &self.assignments {
            let knob = settings_file::assign(words, &mut Settings::default())?;
            let users: Vec<_> = contenders.iter_mut().filter(|c| (knob.applies)(c.settings.method)).collect();
            if users.is_empty() {
                return Err(Failure::Usage(format!("--set {} has no meaning for any of the methods", knob.name)));
            }
            users.into_iter().try_for_each(|c| settings_file::assign(words, &mut c.settings).map(|_| ()))?;
        }
        Ok(contenders)
    }

    fn start(&self, contender: &Contender, device: &Device, scene: &LoadedScene) -> Outcome<Runner> {
        let settings = Settings { size: self.source.size, seed: self.source.seed, ..contender.settings.clone() };
        let before = allocated(device);
        let session = Session::new(device, scene, &settings)?;
        let memory = allocated(device).saturating_sub(before);
        let counted = Settings { count: true, ..settings.clone() };
        let counting = self.count.then(|| Session::new(device, scene, &counted)).transpose()?;
        Ok(Runner {
            contender: contender.clone(),
            session,
            counting,
            memory,
            first_frame_ms: 0.0,
            collector: Collector::default(),
        })
    }

    /// Renders a frame with each method in turn, so that whatever disturbs the machine disturbs all of them.
    fn frame(&self, index: u32, stage: &Stage, runners: &mut [Runner]) -> Outcome {
        let (pose, view) = stage.at(f64::from(index) / self.source.fps);
        let inputs = FrameInputs { view, pose: &pose, reset: index == 0 };
        for runner in runners {
            let started = Instant::now();
            let stats = runner.session.frame(&inputs)?;
            if index == 0 {
                runner.first_frame_ms = started.elapsed().as_secs_f64() * 1e3;
            } else if index > self.warmup {
                runner.collector.add(stats, &runner.session.phase_times());
            }
            if let Some(session) = &mut runner.counting {
                let stats = session.frame(&inputs)?;
                if index > self.warmup {
                    runner.collector.count(&stats);
                }
            }
        }
        Ok(())
    }

    fn report(&self, device: &Device, stage: &Stage, runners: Vec<Runner>) -> report::Bench {
        let methods: Vec<MethodResult> = runners.into_iter().map(|r| r.finish(self.source.size)).collect();
        report::Bench {
            schema: 1,
            device: device.report().clone(),
            build: arguments::build(),
            scene: stage.name.clone(),
            settings: report::Settings {
                motion: stage.motion().to_owned(),
                camera: stage.camera().to_owned(),
                frames: self.frames,
                warmup: self.warmup,
                fps: self.source.fps,
                seed: self.source.seed,
            },
            size: self.source.size,
            ratios: ratios(&methods),
            methods,
        }
    }
}

/// Bytes of device memory that are in use.
fn allocated(device: &Device) -> u64 {
    device.context().memory_table().values().sum()
}

impl Runner {
    fn finish(self, size: [u32; 2]) -> MethodResult {
        let Contender { name, settings } = &self.contender;
        self.collector.finish(name.clone(), settings, size, self.first_frame_ms, self.memory)
    }
}
