//! Rendering without a host: makes the command buffers, submits, waits and reads back.

use crate::Result;
use crate::progress::Progress;
use crate::renderer::{Aov, FrameInputs, FrameStats, PhaseTime, Settings};
use crate::scene::Scene;

/// A device of this machine and whether it fits.
#[derive(Debug, Clone, serde::Serialize)]
pub struct DeviceReport {
    /// Position in the loader's list.
    pub index: usize,
    /// Name given by the driver.
    pub name: String,
    /// `discrete`, `integrated`, `virtual`, `cpu` or `other`.
    pub kind: &'static str,
    /// Driver name and version.
    pub driver: String,
    /// Vulkan version, `major.minor.patch`.
    pub api: String,
    /// Why it does not fit, one reason a line; empty if it fits.
    pub rejected: Vec<String>,
}

/// An image read back: `channels` floats a pixel, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Pixels {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Floats a pixel.
    pub channels: usize,
    /// `width * height * channels` floats.
    pub data: Vec<f32>,
}

/// A row of the memory table.
#[derive(Debug, Clone, serde::Serialize)]
pub struct MemoryRow {
    /// What the memory is for.
    pub purpose: String,
    /// Bytes.
    pub bytes: u64,
}

/// A device made for rendering without a window.
#[derive(Debug)]
pub struct Device {}

impl Device {
    /// Every device that the loader lists, fitting or not.
    pub fn list() -> Result<Vec<DeviceReport>> {
        unimplemented!()
    }
    /// Opens the device that `selector` (an index, or part of a name) asks for, or else the best one.
    pub fn open(_selector: Option<&str>) -> Result<Self> {
        unimplemented!()
    }
    /// What was opened.
    pub fn report(&self) -> &DeviceReport {
        unimplemented!()
    }
}

/// A scene in device memory, shared by sessions.
#[derive(Debug)]
pub struct LoadedScene {}

impl LoadedScene {
    /// Builds acceleration structures and uploads everything.
    pub fn new(_device: &Device, _scene: &Scene, _progress: &dyn Progress) -> Result<Self> {
        unimplemented!()
    }
}

/// Renders frames of one scene with one method.
#[derive(Debug)]
pub struct Session {}

impl Session {
    /// Makes a renderer with its buffers.
    pub fn new(_device: &Device, _scene: &LoadedScene, _settings: &Settings) -> Result<Self> {
        unimplemented!()
    }
    /// Renders a frame and waits for it.
    pub fn frame(&mut self, _inputs: &FrameInputs) -> Result<FrameStats> {
        unimplemented!()
    }
    /// Time of each phase of the last frame, in order.
    pub fn phase_times(&self) -> Vec<PhaseTime> {
        unimplemented!()
    }
    /// Scene-linear RGBA of the last frame (4 channels).
    pub fn color(&mut self) -> Result<Pixels> {
        unimplemented!()
    }
    /// An AOV of the last frame; it must be in the settings.
    pub fn aov(&mut self, _aov: Aov) -> Result<Pixels> {
        unimplemented!()
    }
    /// What this session has allocated for what.
    pub fn memory(&self) -> Vec<MemoryRow> {
        unimplemented!()
    }
}
