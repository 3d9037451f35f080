//! The embedding surface: create, record a frame, resize, destroy.
//!
//! The library only records. The host owns queue, submission and waiting; after creation no Vulkan object is made and no
//! device memory is allocated until [`Renderer::resize`].

use crate::accel::{self, Geometry, Tlas};
use crate::deforming::{self, Deforming};
use crate::gpu::{Buffer, Context, Image, Recorder};
use crate::method::SLOTS;
use crate::method::buffers::FrameBuffers;
use crate::method::constants::{self, Moment};
use crate::method::model::Model;
use crate::method::plan::{self, Plan};
use crate::method::ring::Ring;
use crate::method::storage::Storage;
use crate::phase::Kit;
use crate::resident::ResidentScene;
use crate::scene::{Pose, Scene, View};
use crate::shaders;
use crate::{Error, Result};
use ash::vk;
use std::sync::Arc;

pub use crate::settings::{Aov, Fill, Method, Settings, Weights};
pub use crate::stats::{FrameStats, PhaseTime, RayCosts};

/// What changes from frame to frame.
#[derive(Debug, Clone, Copy)]
pub struct FrameInputs<'a> {
    /// Where the frame is seen from.
    pub view: View,
    /// Where everything is: as many instances and lights as the scene has.
    pub pose: &'a Pose,
    /// A camera cut: forget all samples. For a method that accumulates, the begin of the next picture, whose motion is told
    /// relative to the picture before.
    pub reset: bool,
}

/// What a recorded frame writes. The images of AOVs are had from [`Renderer::aov`], under the same rules.
///
/// *Lifetime*: the handles stay the renderer's and are valid until it is resized or dropped; they are the same for every
/// frame in between, so that each frame overwrites the one before.
///
/// *Layout*: GENERAL before and after, of one level and layer; a host that transitions an image brings it back before the
/// next frame. The images can be storage images, sampled, and copied from and to.
///
/// *Stage*: the frame writes them in COMPUTE_SHADER with access SHADER_STORAGE_WRITE. A host that reads them records, behind
/// the frame, a barrier from there to its own use, such as COPY with TRANSFER_READ or FRAGMENT_SHADER with
/// SHADER_SAMPLED_READ.
///
/// *The next frame* waits for whatever came before it on the queue in the stages COMPUTE_SHADER, ALL_TRANSFER and
/// DRAW_INDIRECT, so that images read there need nothing more. A host that reads them in other stages, or on another queue,
/// sees to it that it has read them before the next frame runs: by an execution dependency to COMPUTE_SHADER, or a
/// semaphore.
#[derive(Debug, Clone, Copy)]
pub struct FrameOutputs {
    /// Scene-linear RGB (Rec. 709 primaries), alpha 1; R16G16B16A16_SFLOAT, or R32G32B32A32_SFLOAT with
    /// [`Settings::float_output`].
    pub color: vk::Image,
    /// A view of `color`.
    pub color_view: vk::ImageView,
    /// Width and height in pixels.
    pub extent: [u32; 2],
    /// Names the frame to [`Renderer::stats`] and [`Renderer::phase_times`].
    pub ticket: Ticket,
}

/// Names a recorded frame to the renderer that recorded it. Two frames can be in flight; the tickets of those before them,
/// and of all before a resize, are spent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ticket(u64);

/// Renders frames of one scene with one method.
///
/// Samples, and so pictures, carry over from frame to frame. Frames must be submitted in the order in which they were
/// recorded, to one queue, and at most two may be in flight: before a frame is recorded, the one before the last must have
/// been waited for. A host that does not submit what it recorded resets the next frame, whose samples would be missing.
///
/// Before a renderer is dropped or resized, all of its frames must have been waited for.
pub struct Renderer {
    context: Context,
    scene: Arc<ResidentScene>,
    settings: Settings,
    recorder: Recorder,
    tlas: Tlas,
    deforming: Option<Deforming>,
    frames: Frames,
    last: Option<Last>,
    recorded: u64,
    /// First frame since creation or the last resize: what is known of those before is gone.
    first: u64,
}

impl std::fmt::Debug for Renderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Renderer").field("settings", &self.settings).finish_non_exhaustive()
    }
}

/// What the last frame saw.
#[derive(Debug)]
struct Last {
    view: View,
    pose: Pose,
    /// What motion was told relative to.
    before: Option<(View, Pose)>,
    /// Frames since the last reset.
    frame: u32,
    /// Frames for which nothing has moved.
    still: u32,
    /// Frames for which light has fallen alike.
    lit_for: u32,
}

/// Everything whose size depends on the frame's.
struct Frames {
    model: Model,
    storage: Storage,
    plans: [Plan; SLOTS],
    buffers: FrameBuffers,
    ring: Ring,
    // Holds the descriptor sets that the plans bind.
    _kit: Kit,
}

impl Renderer {
    /// Uploads the scene and makes everything that frames need.
    ///
    /// # Errors
    /// [`Error::Setting`] for a value out of range, [`Error::TooLarge`] and [`Error::OutOfMemory`] with what to lower.
    pub fn new(context: &Context, scene: &Scene, settings: &Settings) -> Result<Self> {
        let resident = ResidentScene::new(context, scene, &crate::progress::Quiet)?;
        Self::with_scene(context, Arc::new(resident), settings)
    }

    /// As [`Renderer::new`], with a scene that is on the device already and may be shared.
    ///
    /// # Errors
    /// As for [`Renderer::new`].
    pub fn with_scene(context: &Context, scene: Arc<ResidentScene>, settings: &Settings) -> Result<Self> {
        settings.validate()?;
        let frames = Frames::new(context, &scene, settings)?;
        let most = frames.plans.iter().map(|p| p.passes.len()).max().unwrap_or(0);
        let deforming = Deforming::new(&scene);
        let recorder = Recorder::new(context, most as u32, SLOTS as u32)?;
        Ok(Self {
            context: context.clone(),
            scene,
            settings: settings.clone(),
            recorder,
            tlas: Tlas::default(),
            deforming,
            frames,
            last: None,
            recorded: 0,
            first: 0,
        })
    }

    /// Changes the frame's size. All samples are forgotten, all tickets are spent, all handles are made anew. Nothing
    /// recorded before may still be in flight. Memory of both sizes is held for a moment.
    ///
    /// # Errors
    /// As for [`Renderer::new`]; the renderer then goes on as if nothing had been asked of it.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<()> {
        let settings = Settings { size, ..self.settings.clone() };
        settings.validate()?;
        self.frames = Frames::new(&self.context, &self.scene, &settings)?;
        self.settings = settings;
        self.last = None;
        self.first = self.recorded;
        Ok(())
    }

    /// Records a frame: compute dispatches, fills, copies and global memory barriers. Nothing is submitted, nothing waited
    /// for, no Vulkan object made and no device memory allocated. Bound pipeline, descriptor set 0 and push constants of
    /// the compute bind point are left changed.
    ///
    /// The inputs are copied: nothing of them need outlive the call.
    ///
    /// # Safety
    /// - `commands` must be a primary command buffer in the recording state, outside a render pass, from a pool of the
    ///   family of the context's queue, and recorded to by no other thread meanwhile.
    /// - It must be submitted at most once, to one queue with all other frames of this renderer, in the order of recording.
    /// - The frame before the last must have been waited for: its upload memory, its counters and its timestamps are used
    ///   again.
    /// - The renderer must not be resized or dropped before the submission has been waited for.
    ///
    /// # Errors
    /// [`Error::Setting`] if the pose does not fit the scene, or something is not finite. Nothing is recorded then, and the
    /// renderer is as before.
    pub unsafe fn record(&mut self, commands: vk::CommandBuffer, inputs: &FrameInputs<'_>) -> Result<FrameOutputs> {
        self.record_plan(commands, inputs, None)
    }

    /// As [`Renderer::record`], leaving out the barrier before this pass, for the test that the validation layer notices.
    ///
    /// # Safety
    /// As for [`Renderer::record`]; and since the barrier is missing, it must not be submitted.
    ///
    /// # Errors
    /// As for [`Renderer::record`].
    #[doc(hidden)]
    pub unsafe fn record_without(
        &mut self,
        commands: vk::CommandBuffer,
        inputs: &FrameInputs<'_>,
        pass: usize,
    ) -> Result<FrameOutputs> {
        self.record_plan(commands, inputs, Some(pass))
    }

    /// What [`Renderer::record`] does, under its conditions.
    pub(crate) fn record_plan(
        &mut self,
        commands: vk::CommandBuffer,
        inputs: &FrameInputs<'_>,
        dropped: Option<usize>,
    ) -> Result<FrameOutputs> {
        // Whatever can fail comes before whatever changes.
        self.check_inputs(inputs)?;
        self.deform(inputs)?;
        let slot = (self.recorded % SLOTS as u64) as usize;
        let moment = self.advance(inputs);
        self.write_constants(slot, inputs, &moment);
        let plan = &self.frames.plans[slot];
        let mut barriers = plan.barriers.clone();
        if let Some(dropped) = dropped.and_then(|i| barriers.get_mut(i)) {
            *dropped = None;
        }
        // SAFETY: the caller vouches for the command buffer and has waited for the slot's last frame; the renderer, which
        // holds what the plan uses, outlives the submission (see `record`).
        unsafe {
            self.recorder.record(commands, &plan.passes, &barriers, slot as u32);
            self.recorder.barrier(commands, &plan.end);
        }
        self.recorded += 1;
        Ok(FrameOutputs {
            color: self.frames.buffers.color.raw(),
            color_view: self.frames.buffers.color.view(),
            extent: self.settings.size,
            ticket: Ticket(self.recorded - 1),
        })
    }

    /// Counts of a frame that has been waited for; `None` if its ticket is spent.
    pub fn stats(&self, ticket: Ticket) -> Option<FrameStats> {
        let slot = self.slot(ticket)?;
        let counters = self.frames.ring.counters(slot)?;
        let costs = self.frames.ring.traversals(slot).map(|t| RayCosts::of(&t));
        Some(FrameStats { costs, ..FrameStats::new(&counters, &self.settings) })
    }

    /// Time of each phase of a frame that has been waited for, in order; empty on a device without timestamps, or if the
    /// ticket is spent.
    pub fn phase_times(&self, ticket: Ticket) -> Vec<PhaseTime> {
        let Some(slot) = self.slot(ticket) else { return Vec::new() };
        let passes = &self.frames.plans[slot].passes;
        let mut phases: Vec<PhaseTime> = Vec::new();
        for (pass, ms) in passes.iter().zip(self.recorder.times(passes.len(), slot as u32)) {
            match phases.last_mut() {
                Some(last) if last.label == pass.label => last.ms += ms,
                _ => phases.push(PhaseTime { label: pass.label, ms }),
            }
        }
        phases
    }

    /// The image of an AOV that the settings ask for, in layout GENERAL.
    pub fn aov(&self, aov: Aov) -> Option<&Image> {
        let wanted = self.settings.aovs.contains(&aov);
        let index = Aov::ALL.iter().position(|a| *a == aov)?;
        self.frames.buffers.aovs.get(index).filter(|_| wanted)
    }

    /// The constants, the instances and the list of samples of the last frame.
    pub(crate) fn sample_buffers(&self, ticket: Ticket) -> [&Buffer; 3] {
        self.frames.buffers.sample_buffers((ticket.0 % SLOTS as u64) as usize)
    }

    /// The colour image.
    pub fn color(&self) -> &Image {
        &self.frames.buffers.color
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The passes and barriers of even frames, counted from creation.
    pub fn plan(&self) -> &Plan {
        &self.frames.plans[0]
    }

    /// The passes and barriers of even and of odd frames, which differ in which cache is which.
    pub fn plans(&self) -> &[Plan; SLOTS] {
        &self.frames.plans
    }

    /// What is modelled, and why.
    pub fn model(&self) -> &Model {
        &self.frames.model
    }

    /// Sizes of everything that depends on the frame's size.
    pub fn storage(&self) -> &Storage {
        &self.frames.storage
    }

    fn slot(&self, ticket: Ticket) -> Option<usize> {
        let oldest = self.first.max(self.recorded.saturating_sub(SLOTS as u64));
        let current = (oldest..self.recorded).contains(&ticket.0);
        current.then_some((ticket.0 % SLOTS as u64) as usize)
    }

    fn check_inputs(&self, inputs: &FrameInputs<'_>) -> Result<()> {
        let wrong = |name, value: String, expected: String| Err(Error::Setting { name, value, expected });
        let (instances, lights) = (self.scene.geometry.instance_meshes.len(), self.scene.lights.len());
        let pose = inputs.pose;
        if pose.instances.len() != instances || pose.lights.len() != lights {
            let found = format!("{} instances and {} lights", pose.instances.len(), pose.lights.len());
            return wrong("pose", found, format!("{instances} instances and {lights} lights, as the scene has"));
        }
        if let Err(what) = deforming::check(&self.scene, &pose.deformations) {
            return wrong("pose", what, "the scene's deformations, finite ones only".to_owned());
        }
        let unplaced = pose.instances.iter().position(|t| !t.is_finite());
        let unlit = pose.lights.iter().position(|l| !(l.position.is_finite() && l.direction.is_finite()));
        for (what, index) in [("instance", unplaced), ("light", unlit)] {
            if let Some(index) = index {
                return wrong("pose", format!("{what} {index}"), "finite transforms only".to_owned());
            }
        }
        if !pose.drift.is_finite() {
            return wrong("pose.drift", pose.drift.to_string(), "a finite number of metres along each axis".to_owned());
        }
        if inputs.view.lens.is_open() && !self.frames.model.has(shaders::MODEL_LENS) {
            let expected = "a pinhole, since no camera of the scene has an aperture; or model = all".to_owned();
            return wrong("view.lens", format!("{:?}", inputs.view.lens), expected);
        }
        if inputs.view.shutter > 0.0 && !self.frames.model.has(shaders::MODEL_MOTION) {
            let expected = "0, since no camera of the scene has a shutter; or model = all".to_owned();
            return wrong("view.shutter", inputs.view.shutter.to_string(), expected);
        }
        constants::check_view(&inputs.view, self.settings.size)
    }

    /// Takes on the shapes of what deforms.
    fn deform(&mut self, inputs: &FrameInputs<'_>) -> Result<()> {
        if self.deforming.is_none() {
            return Ok(());
        }
        let before = self.motion_origin(inputs, self.last.as_ref());
        let Some(deforming) = &mut self.deforming else { return Ok(()) };
        let before = before.as_ref().map_or(inputs.pose, |(_, pose)| pose);
        deforming.shape(&self.scene, inputs.pose, before, inputs.view.shutter > 0.0)
    }

    /// The scene's geometry, as it is in the last frame that was recorded.
    pub(crate) fn geometry(&self) -> &Geometry {
        self.deforming.as_ref().map_or(&self.scene.geometry, Deforming::geometry)
    }

    /// Compares with the last frame, and remembers this one.
    fn advance(&mut self, inputs: &FrameInputs<'_>) -> Moment {
        let taken = self.last.take();
        let before = self.motion_origin(inputs, taken.as_ref());
        let last = taken.filter(|_| !inputs.reset);
        let still = last.as_ref().map_or(0, |l| {
            if l.view == inputs.view && l.pose.stands_like(inputs.pose) { l.still.saturating_add(1) } else { 0 }
        });
        // After a reset there is nothing that was lit otherwise.
        let lit_for = last
            .as_ref()
            .map_or(u32::MAX, |l| if l.pose.is_lit_like(inputs.pose) { l.lit_for.saturating_add(1) } else { 0 });
        let frame = last.as_ref().map_or(0, |l| l.frame.wrapping_add(1));
        let moment = Moment {
            view: inputs.view,
            previous: before.as_ref().map_or(inputs.view, |(view, _)| *view),
            frame,
            reset: last.is_none(),
            // The first still frame repairs what the last movement left; from the second on the pattern stays.
            settled: still >= 2,
            lit_for,
            lights: self.scene.light_count(self.settings.emitters) as u32,
            instances: self.scene.geometry.instance_meshes.len() as u32,
        };
        self.write_instances(inputs, &moment, before.as_ref().map(|(_, pose)| pose));
        self.last = Some(Last { view: inputs.view, pose: inputs.pose.clone(), before, frame, still, lit_for });
        moment
    }

    /// Where everything was one picture ago. A method that accumulates renders a picture in many frames, from one reset to
    /// the next; elsewhere a reset is a cut, and nothing was before.
    fn motion_origin(&self, inputs: &FrameInputs<'_>, last: Option<&Last>) -> Option<(View, Pose)> {
        let last = last?;
        match (self.settings.method.accumulates(), inputs.reset) {
            (true, false) => last.before.clone(),
            (false, true) => None,
            _ => Some((last.view, last.pose.clone())),
        }
    }

    /// Places the instances relative to the camera and rebuilds the top level, into the ring.
    fn write_instances(&mut self, inputs: &FrameInputs<'_>, moment: &Moment, before: Option<&Pose>) {
        let geometry = self.deforming.as_ref().map_or(&self.scene.geometry, Deforming::geometry);
        let before = before.unwrap_or(inputs.pose);
        let mut instances: Vec<shaders::Instance> = geometry
            .instance_meshes
            .iter()
            .zip(inputs.pose.instances.iter().zip(&before.instances))
            .map(|(mesh, (now, then))| {
                let record = &geometry.meshes[*mesh as usize];
                accel::place(geometry, record, (now, moment.view.position), (then, moment.previous.position))
            })
            .collect();
        deforming::mark(&self.scene, &mut instances);
        let shutter = moment.view.shutter;
        instances.iter_mut().for_each(|instance| accel::mark_moving(instance, shutter));
        self.tlas.rebuild_over(geometry, &mut instances, shutter);
        let slot = (self.recorded % SLOTS as u64) as usize;
        self.frames.ring.write_instances(slot, &instances);
        self.frames.ring.write_top_level(slot, &self.tlas.nodes);
        if let Some(deforming) = &self.deforming {
            self.frames.ring.write_shapes(slot, &deforming.uploads(&self.scene));
        }
    }

    fn write_constants(&mut self, slot: usize, inputs: &FrameInputs<'_>, moment: &Moment) {
        let frame = constants::frame(&self.settings, &self.frames.storage, &self.scene.environment, moment);
        let before = self.last.as_ref().and_then(|last| last.before.as_ref());
        let before = before.map_or(&inputs.pose.lights, |(_, pose)| &pose.lights);
        let placed = self.scene.lights.iter().zip(inputs.pose.lights.iter().zip(before));
        let mut lights: Vec<shaders::Light> = placed
            .map(|(light, (now, then))| {
                constants::light(light, now, inputs.view.position, then.position - moment.previous.position)
            })
            .collect();
        // Where it is, and how bright, a draw says.
        let shines = shaders::Light { shape: shaders::LIGHT_MESH, ..Default::default() };
        lights.resize(moment.lights as usize, shines);
        self.frames.ring.write_frame(slot, &frame);
        self.frames.ring.write_lights(slot, &lights);
        let medium = self.scene.medium.map(|m| m.record(inputs.view.position, inputs.pose.drift, self.scene.ambient));
        let steps = self.settings.medium_steps;
        self.frames.ring.write_medium(slot, &shaders::Medium { steps, ..medium.unwrap_or_default() });
    }
}

impl Frames {
    fn new(context: &Context, scene: &ResidentScene, settings: &Settings) -> Result<Self> {
        let model = Model::of(&scene.requirements, settings);
        let storage = Storage::new(settings, model.bits());
        let deforming = model.has(shaders::MODEL_DEFORM).then(|| deforming::previous_triangles(scene));
        scene.check_emitters(settings.emitters)?;
        let (instances, lights) = (scene.instance_count(), scene.light_count(settings.emitters));
        let buffers = FrameBuffers::new(context, settings, &storage, instances, lights, deforming)?;
        let shapes = deforming::targets(scene, &scene.resources(), buffers.resources(0).previous_corners);
        let ring = Ring::new(context, scene, lights, &shapes, model.has(shaders::MODEL_COUNT))?;
        // Two plans of less than 32 passes each, and four for each step of paths and of diffuse ones.
        let steps = shaders::PATH_STEPS + settings.indirect.depth;
        let kit = Kit::new(context, 2 * (32 + 4 * steps), model.bits())?;
        let plan_of = |slot: usize| -> Result<Plan> {
            let resources = buffers.resources(slot);
            let transfers = ring.transfers(slot, &resources, scene, &shapes);
            plan::plan(&kit, settings, &resources, &scene.resources(), &transfers)
        };
        let plans = [plan_of(0)?, plan_of(1)?];
        Ok(Self { model, storage, buffers, _kit: kit, ring, plans })
    }
}
