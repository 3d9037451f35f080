//! One file a phase: its shader, what it binds, how many threads it has. What a phase reads and writes is reflected from
//! the shader; barriers follow from it ([`crate::gpu::pass`]).
//!
//! | phase | paper 1 | a thread | reads | writes |
//! | --- | --- | --- | --- | --- |
//! | [`reproject`] | 4.1 | sample of the last frame | samples, instances | claims, masks |
//! | [`analyze`] | 4.2 | pixel | masks | plan, tiles |
//! | [`list`]: `scan`, `gather` | 7 (left to future work) | tile; pixel | plan, claims, samples of the last frame | samples, offsets |
//! | [`generate`] | 6 (supersampling) | pixel | | samples, offsets |
//! | [`track`]: `nearest` (twice), `track` | paper 3, 2 | sample of the last frame; pixel | samples of the last frame, instances, aims | claims, aims, samples, offsets |
//! | [`verify`] | 4.3 | sample | samples, geometry | found, samples |
//! | [`retain`], without a fill | 4.3 | pixel | found | found, samples |
//! | [`fill`]: `survey`, `scan`, `append`, `verify` | | pixel; tile; pixel; sample | found, masks, plan | masks, samples, extras, found |
//! | [`shadow`] | 4.3 | sample | found, geometry, lights, environment map | lit |
//! | [`changes`] | | pixel | samples of both frames, lit, masks, plan | image |
//! | [`shade`] | 4.3 | sample | found, lit, materials, lights, environment map | shaded |
//! | [`bounce`]: `route`, `bounce`, `shadow`, `scatter`, a step each | paper 2, 3.3 and 3.5 | ray | paths, geometry, materials, lights | found, lit, shaded, paths |
//! | [`indirect`]: the same steps, of diffuse paths | 6.1 | sample; ray | found, samples of both frames, means of the last frame | brought, means, paths |
//! | [`accumulate`] | 6.1 | sample | brought, means of the last frame | means, shaded |
//! | [`medium`], with fog or mist | paper 2, 3.6 | pixel | shaded, offsets, geometry, lights, medium | shaded |
//! | [`reconstruct`] | 4.4 | pixel | shaded, offsets | film, motion |
//! | [`resolve`] | | pixel | film | colour image |
//! | [`temporal`], instead of `resolve` | 6 | pixel | film, motion, last picture | colour image, picture |
//! | [`aov`] | figure 4 | pixel | shaded, masks, plan | images |

pub mod accumulate;
pub mod analyze;
pub mod aov;
pub mod bounce;
pub mod changes;
pub mod fill;
pub mod generate;
pub mod indirect;
pub mod list;
pub mod medium;
pub mod reconstruct;
pub mod reproject;
pub mod resolve;
pub mod retain;
pub mod shade;
pub mod shadow;
pub mod temporal;
pub mod track;
pub mod verify;

use crate::gpu::{Binder, Context, Pass, Pipeline, Range, Resource, Threads};
use crate::shaders::Shader;
use crate::{Error, Result};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Makes the passes of a plan; a shader that several plans use is compiled once.
#[derive(Debug)]
pub struct Kit {
    context: Context,
    binder: Binder,
    pipelines: RefCell<BTreeMap<&'static str, Arc<Pipeline>>>,
    model: u32,
}

impl Kit {
    /// For plans of up to `passes` passes in all, of what a [`crate::method::model::Model`] has.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn new(context: &Context, passes: u32, model: u32) -> Result<Self> {
        let binder = Binder::new(context, passes, 24)?;
        Ok(Self { context: context.clone(), binder, pipelines: RefCell::default(), model })
    }

    /// The `MODEL_` bits of what is modelled.
    pub fn model(&self) -> u32 {
        self.model
    }

    /// A dispatch labelled `label`, with resources in the order of the shader's bindings.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the pipeline cannot be made.
    pub fn dispatch(
        &self,
        label: &'static str,
        shader: &'static Shader,
        resources: &[Resource],
        push: &[u8],
        threads: Threads,
    ) -> Result<Pass> {
        let known = self.pipelines.borrow().get(shader.name).cloned();
        let pipeline = match known {
            Some(pipeline) => pipeline,
            None => {
                let made = Arc::new(Pipeline::new(&self.context, shader)?);
                self.pipelines.borrow_mut().insert(shader.name, made.clone());
                made
            }
        };
        self.binder.dispatch(label, &pipeline, resources, push, threads)
    }
}

/// What the phases of a frame bind. Two of these alternate: `samples` of one is `previous` of the other.
#[derive(Debug, Clone, Copy)]
pub struct FrameResources {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// [`crate::shaders::Frame`].
    pub frame: Range,
    /// [`crate::shaders::Instance`] each.
    pub instances: Range,
    /// [`crate::shaders::Light`] each.
    pub lights: Range,
    /// [`crate::shaders::Counters`].
    pub counters: Range,
    /// The cache of the last frame: [`crate::shaders::Sample`] each.
    pub previous: Range,
    /// The cache of this frame.
    pub samples: Range,
    /// Frames that each sample of `previous` has lived, if asked for.
    pub previous_ages: Option<Range>,
    /// Frames that each sample of `samples` has lived.
    pub ages: Option<Range>,
    /// Which sample of `previous` each of `samples` is, a word each, if that is asked for by a method that keeps samples.
    pub sources: Option<Range>,
    /// What is remembered for [`changes`], if asked for by a method that keeps samples.
    pub memory: Option<Memory>,
    /// What lens, time and lights are sampled by, if anything is.
    pub seeds: Option<SeedResources>,
    /// Paths behind what the camera sees, if they go on.
    pub paths: Option<PathResources>,
    /// What diffuse paths bring to samples, if there are any.
    pub indirect: Option<IndirectResources>,
    /// Corners that triangles of deforming meshes had in the last frame, nine floats each, if there are any.
    pub previous_corners: Option<Range>,
    /// [`crate::shaders::Medium`], if that is modelled.
    pub medium: Option<Range>,
    /// [`crate::shaders::Traversals`], if rays are counted.
    pub traversals: Option<Range>,
    /// A word a subpixel; with point tracking a [`crate::shaders::Tracked`] a pixel.
    pub claims: Range,
    /// Two floats a pixel, with point tracking: where the ray of each pixel goes, in pixels.
    pub aims: Range,
    /// A word a pixel: occupancy, and which of it is unoccluded.
    pub masks: Range,
    /// A word a pixel: kept and new subpixels.
    pub plan: Range,
    /// Samples of each tile, then those before it.
    pub tiles: Range,
    /// First sample of each pixel, and the end.
    pub offsets: Range,
    /// The same of the samples that the fill adds; without one, whatever.
    pub extras: Range,
    /// [`crate::shaders::Found`] each.
    pub found: Range,
    /// A word a sample: a bit a light that reaches it.
    pub lit: Range,
    /// [`crate::shaders::Shaded`] each.
    pub shaded: Range,
    /// Four floats a pixel.
    pub film: Range,
    /// What is kept of the frames before, if anything.
    pub history: Option<HistoryResources>,
    /// The frame.
    pub color: Resource,
    /// Images of [`crate::renderer::Aov`], if any is asked for.
    pub aovs: Option<AovResources>,
}

/// What is kept of pictures from frame to frame.
#[derive(Debug, Clone, Copy)]
pub enum HistoryResources {
    /// For [`crate::settings::Temporal::Integrate`].
    Integrated {
        /// Two halves a pixel, pixels moved since the last frame; or [`crate::shaders::MOTION_UNKNOWN`].
        motion: Range,
        /// The last frame's picture in YCoCg: three halves and a gap a pixel, or floats.
        previous: Range,
        /// This frame's. The two swap roles.
        current: Range,
    },
    /// For [`crate::settings::Temporal::Box`]: the last frames of each pixel in RGB, the youngest first.
    Frames(Range),
}

/// What samples were in the last frame: a word a sample each.
#[derive(Debug, Clone, Copy)]
pub struct Memory {
    /// [`FrameResources::sources`].
    pub sources: Range,
    /// The lights that reached each sample of `previous`.
    pub previous_reached: Range,
    /// The lights that reach each sample of `samples`.
    pub reached: Range,
}

/// Where samples lie on what is sampled besides the picture.
#[derive(Debug, Clone, Copy)]
pub struct SeedResources {
    /// The seed of each sample of `previous`, a word.
    pub previous: Range,
    /// The seed of each sample of `samples`.
    pub now: Range,
    /// [`crate::sampler::Sampler::table`].
    pub table: Range,
}

/// Secondary rays: one a sample, of the step that is being traced.
#[derive(Debug, Clone, Copy)]
pub struct PathResources {
    /// Four words a sample: origin of its ray, camera-relative metres.
    pub origins: Range,
    /// Four words a sample: unit direction.
    pub directions: Range,
    /// Four words a sample: what the ray's radiance counts for, and what it is inside of.
    pub weights: Range,
    /// Samples with a ray, in this step and the next.
    pub list: Range,
    /// [`crate::shaders::PathCounters`] of each step.
    pub counters: Range,
    /// [`crate::shaders::Found`] each: what the rays of a step found.
    pub found: Range,
    /// A word a sample: a bit a light that reaches what was found.
    pub lit: Range,
}

/// What diffuse paths bring.
#[derive(Debug, Clone, Copy)]
pub struct IndirectResources {
    /// [`crate::shaders::Gathered`] of each sample of `previous`, if samples are kept.
    pub previous: Option<Range>,
    /// [`crate::shaders::Gathered`] of each sample of `samples`.
    pub gathered: Range,
    /// Four words a sample: what its path of this frame brings, and its number in `previous`.
    pub brought: Range,
}

/// One image an AOV.
#[derive(Debug, Clone, Copy)]
pub struct AovResources {
    /// R32_SFLOAT.
    pub depth: Resource,
    /// R32G32_SFLOAT.
    pub motion: Resource,
    /// R32G32B32A32_SFLOAT.
    pub density: Resource,
    /// R32_SFLOAT.
    pub age: Resource,
    /// R32G32B32A32_SFLOAT.
    pub changes: Resource,
}

impl FrameResources {
    /// A thread a pixel.
    pub fn pixels(&self) -> Threads {
        Threads::Exactly([self.size[0], self.size[1], 1])
    }

    /// A thread a sample of the dense list; before `scan` has run, of the last frame's list.
    pub fn dense(&self) -> Threads {
        Threads::Indirect(Range { name: "dispatch arguments", size: 12, ..self.counters })
    }
}

/// What the phases bind of a scene.
#[derive(Debug, Clone, Copy)]
pub struct SceneResources {
    /// Compressed nodes: the top level, then every mesh's.
    pub nodes: Range,
    /// Triangle corners, 32 of 36 bytes.
    pub corners: Range,
    /// The other 4.
    pub rest: Range,
    /// [`crate::shaders::Triangle`] each.
    pub triangles: Range,
    /// [`crate::shaders::Vertex`] each.
    pub vertices: Range,
    /// [`crate::shaders::Material`] each.
    pub materials: Range,
    /// All images.
    pub atlas: Resource,
    /// 256 floats: sRGB code to linear.
    pub srgb: Range,
    /// [`crate::scene::EnvironmentMap::table`].
    pub environment_map: Range,
    /// [`crate::scene::medium::noise`].
    pub medium_noise: Range,
}

/// What a model that is not whole gives.
fn missing(what: &str) -> Error {
    Error::Vulkan { during: format!("binding {what}"), result: ash::vk::Result::ERROR_UNKNOWN }
}

fn b(range: Range) -> Resource {
    Resource::Buffer(range)
}
