//! Renders frames of a scene under a camera motion, with the validation layer listening.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test

use stillray::gpu::ContextOptions;
use stillray::headless::{Device, LoadedScene, Pixels, Session};
use stillray::progress::Quiet;
use stillray::renderer::{FrameInputs, FrameStats, Settings};
use stillray::scene::motion::Motion;
use stillray::scene::{Scene, View, builtin, import};

/// A scene on a validated device.
pub struct Rig {
    pub device: Device,
    pub scene: Scene,
    pub loaded: LoadedScene,
}

/// `builtin:NAME`, or a path.
pub fn load(name: &str) -> Scene {
    match name.strip_prefix("builtin:") {
        Some(name) => builtin::load(name, 0).unwrap(),
        None => import::load(std::path::Path::new(name)).unwrap(),
    }
}

/// A file below ../shared/scenes, or `None` with a word to the reader where they are absent.
pub fn shared_scene(name: &str) -> Option<String> {
    let path = format!("{}/../shared/scenes/{name}", env!("CARGO_MANIFEST_DIR"));
    if std::path::Path::new(&path).exists() {
        return Some(path);
    }
    println!("skipped, no ../shared/scenes ({name})");
    None
}

impl Rig {
    pub fn new(scene: Scene) -> Self {
        let device = Device::with_options(&ContextOptions { device: None, validation: true }).unwrap();
        let loaded = LoadedScene::new(&device, &scene, &Quiet).unwrap();
        Self { device, scene, loaded }
    }

    pub fn session(&self, settings: &Settings) -> Session {
        Session::new(&self.device, &self.loaded, settings).unwrap()
    }

    /// The first camera, moved.
    pub fn view(&self, motion: Motion, time: f64) -> View {
        let pose = self.scene.pose(0.0);
        let (low, high) = self.scene.bounds(&pose).unwrap();
        motion.view(&pose.cameras[0], (low + high) * 0.5, (high - low).length() * 0.5, time)
    }

    /// Renders frame `index` at 60 frames a second; the scene's own animation stands still at time 0.
    pub fn frame(&self, session: &mut Session, motion: Motion, index: u32) -> FrameStats {
        let view = self.view(motion, f64::from(index) / 60.0);
        let pose = self.scene.pose(0.0);
        session.frame(&FrameInputs { view, pose: &pose, reset: false }).unwrap()
    }

    pub fn assert_clean(&self) {
        super::assert_clean(self.device.context());
    }
}

/// The bits of an image: what "identical" means.
pub fn bits(pixels: &Pixels) -> Vec<u32> {
    pixels.data.iter().map(|x| x.to_bits()).collect()
}

/// Mean of red, green and blue over a frame, in f64.
pub fn mean(pixels: &Pixels) -> f64 {
    let sum: f64 = pixels.data.chunks(4).map(|p| f64::from(p[0]) + f64::from(p[1]) + f64::from(p[2])).sum();
    sum / (3.0 * f64::from(pixels.width) * f64::from(pixels.height))
}
