//! Rendering without a host: makes the command buffers, submits, waits and reads back.

use crate::gpu::submit::Submitter;
use crate::gpu::{Buffer, Context, ContextOptions, Image, Place, fit::Fit};
use crate::progress::Progress;
use crate::renderer::{Aov, FrameInputs, FrameStats, PhaseTime, Renderer, Settings, Ticket};
use crate::resident::ResidentScene;
use crate::samples::{self, SamplePoint};
use crate::scene::Scene;
use crate::shaders::{Frame, Instance, Sample};
use crate::{Error, Result};
use half::f16;
use std::sync::Arc;

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

impl DeviceReport {
    fn new(index: usize, fit: &Fit) -> Self {
        Self {
            index,
            name: fit.name(),
            kind: fit.kind(),
            driver: fit.driver.clone(),
            api: fit.api(),
            rejected: fit.rejected.clone(),
        }
    }
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
pub struct Device {
    context: Context,
    report: DeviceReport,
}

impl Device {
    /// Every device that the loader lists, fitting or not.
    ///
    /// # Errors
    /// [`Error::NoLoader`] without a Vulkan loader.
    pub fn list() -> Result<Vec<DeviceReport>> {
        Ok(Context::devices()?.iter().enumerate().map(|(i, fit)| DeviceReport::new(i, fit)).collect())
    }

    /// Opens the device that `selector` (an index, or part of a name) asks for, or else the best one.
    ///
    /// # Errors
    /// [`Error::NoLoader`], or [`Error::NoDevice`] with the reason against each device.
    pub fn open(selector: Option<&str>) -> Result<Self> {
        Self::with_options(&ContextOptions { device: selector.map(str::to_owned), validation: false })
    }

    /// As [`Device::open`], with more options.
    ///
    /// # Errors
    /// As for [`Device::open`].
    pub fn with_options(options: &ContextOptions) -> Result<Self> {
        let context = Context::new(options)?;
        let physical = context.fit().physical;
        let all = Context::devices()?;
        // Handles differ from instance to instance; name and version tell devices apart well enough for a report.
        let same = |f: &Fit| f.name() == context.fit().name() && f.driver == context.fit().driver;
        let index = all.iter().position(|f| f.physical == physical).or_else(|| all.iter().position(same));
        let report = DeviceReport::new(index.unwrap_or(0), context.fit());
        Ok(Self { context, report })
    }

    /// What was opened.
    pub fn report(&self) -> &DeviceReport {
        &self.report
    }

    /// The context.
    pub fn context(&self) -> &Context {
        &self.context
    }
}

/// A scene in device memory, shared by sessions.
#[derive(Debug, Clone)]
pub struct LoadedScene {
    resident: Arc<ResidentScene>,
}

impl LoadedScene {
    /// Builds acceleration structures and uploads everything.
    ///
    /// # Errors
    /// [`Error::TooLarge`] and [`Error::OutOfMemory`] with what to lower.
    pub fn new(device: &Device, scene: &Scene, progress: &dyn Progress) -> Result<Self> {
        Ok(Self { resident: Arc::new(ResidentScene::new(&device.context, scene, progress)?) })
    }
}

/// Renders frames of one scene with one method, each waited for.
#[derive(Debug)]
pub struct Session {
    context: Context,
    renderer: Renderer,
    submitter: Submitter,
    ticket: Option<Ticket>,
    failed: bool,
}

impl Session {
    /// Makes a renderer with its buffers.
    ///
    /// # Errors
    /// [`Error::Setting`] for a value out of range, [`Error::TooLarge`] and [`Error::OutOfMemory`] with what to lower.
    pub fn new(device: &Device, scene: &LoadedScene, settings: &Settings) -> Result<Self> {
        let context = device.context.clone();
        let renderer = Renderer::with_scene(&context, scene.resident.clone(), settings)?;
        let submitter = Submitter::new(&context)?;
        Ok(Self { context, renderer, submitter, ticket: None, failed: false })
    }

    /// Renders a frame and waits for it.
    ///
    /// # Errors
    /// [`Error::Setting`] for inputs that do not fit the scene, [`Error::Vulkan`] if the device is lost.
    pub fn frame(&mut self, inputs: &FrameInputs<'_>) -> Result<FrameStats> {
        let renderer = &mut self.renderer;
        // A frame that was recorded and then failed to run has left no samples.
        let inputs = FrameInputs { reset: inputs.reset || self.failed, ..*inputs };
        let mut recorded = None;
        // The submitter waits for every frame, and the session has one renderer and one queue.
        let ran =
            self.submitter.run("frame", |commands| recorded = Some(renderer.record_plan(commands, &inputs, None)));
        self.failed |= ran.is_err();
        ran?;
        let outputs = recorded.unwrap_or_else(|| Err(lost()))?;
        self.failed = false;
        self.ticket = Some(outputs.ticket);
        self.renderer.stats(outputs.ticket).ok_or_else(lost)
    }

    /// Time of each phase of the last frame, in order.
    pub fn phase_times(&self) -> Vec<PhaseTime> {
        self.ticket.map_or_else(Vec::new, |ticket| self.renderer.phase_times(ticket))
    }

    /// Scene-linear RGBA of the last frame (4 channels).
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] for the read-back buffer.
    pub fn color(&mut self) -> Result<Pixels> {
        let float = self.renderer.settings().float_output;
        let bytes = read(&self.context, &mut self.submitter, self.renderer.color(), if float { 16 } else { 8 })?;
        let data = if float {
            bytes.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect()
        } else {
            bytes.chunks_exact(2).map(|b| bytemuck::pod_read_unaligned::<f16>(b).to_f32()).collect()
        };
        Ok(self.pixels(4, data))
    }

    /// An AOV of the last frame, with [`Aov::channels`] channels.
    ///
    /// # Errors
    /// [`Error::Setting`] if the settings do not ask for it.
    pub fn aov(&mut self, aov: Aov) -> Result<Pixels> {
        let image = self.renderer.aov(aov).ok_or_else(|| Error::Setting {
            name: "aov",
            value: aov.name().to_owned(),
            expected: "one of those that the settings ask for".to_owned(),
        })?;
        let bytes = read(&self.context, &mut self.submitter, image, 4 * aov.channels() as u64)?;
        let data = bytes.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect();
        Ok(self.pixels(aov.channels(), data))
    }

    /// Where the samples of the last frame lie, in the order of its list: pixel by pixel in tiles of 8 x 8 pixels, and what a
    /// fill has added behind that. None before the first frame.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] for the read-back buffers.
    pub fn samples(&self) -> Result<Vec<SamplePoint>> {
        let Some(ticket) = self.ticket else { return Ok(Vec::new()) };
        let Some(stats) = self.renderer.stats(ticket) else { return Ok(Vec::new()) };
        let [frame, instances, samples] = self.renderer.sample_buffers(ticket);
        let (frame, instances) = (frame.download(&self.context)?, instances.download(&self.context)?);
        let bytes = samples.download(&self.context)?;
        let listed = stats.rays as usize * size_of::<Sample>();
        let mut samples: Vec<Sample> = bytemuck::pod_collect_to_vec(bytes.get(..listed).unwrap_or(&bytes));
        let whole = instances.len() / size_of::<Instance>() * size_of::<Instance>();
        let instances: Vec<Instance> = bytemuck::pod_collect_to_vec(&instances[..whole]);
        let frame: Frame = bytemuck::pod_read_unaligned(&frame[..size_of::<Frame>()]);
        samples::place(self.renderer.geometry(), &instances, &mut samples);
        Ok(samples::points(&frame, &instances, &samples))
    }

    /// What is allocated for what on this context, the scene included.
    pub fn memory(&self) -> Vec<MemoryRow> {
        let table = self.context.memory_table();
        table.into_iter().map(|(purpose, bytes)| MemoryRow { purpose, bytes }).collect()
    }

    /// The renderer.
    pub fn renderer(&self) -> &Renderer {
        &self.renderer
    }

    fn pixels(&self, channels: usize, data: Vec<f32>) -> Pixels {
        let [width, height] = self.renderer.settings().size;
        Pixels { width, height, channels, data }
    }
}

fn lost() -> Error {
    Error::Vulkan { during: "reading a frame's counters".to_owned(), result: ash::vk::Result::ERROR_UNKNOWN }
}

fn read(context: &Context, submitter: &mut Submitter, image: &Image, texel: u64) -> Result<Vec<u8>> {
    let [width, height] = image.desc().extent;
    let size = u64::from(width) * u64::from(height) * texel;
    let staging = Buffer::new(context, "staging", size, Place::Readback)?;
    submitter.run("read image", |commands| {
        // SAFETY: `run` hands over a command buffer that is recording and waits for it; the staging buffer is as large
        // as the image.
        unsafe { image.record_copy(commands, &staging) };
    })?;
    Ok(staging.bytes().get(..size as usize).unwrap_or_default().to_vec())
}
