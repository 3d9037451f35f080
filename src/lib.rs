//! Temporally stable ray tracing on plain Vulkan compute: no ray-tracing hardware, no window, no engine needed.
//!
//! A frame is traced from the samples of the frame before it. They are reprojected, checked by a ray each, added to and
//! evicted from until every pixel has as many as it should, and shaded: samples stick to surfaces, so that pictures of a
//! moving camera do not flicker. The method is that of *Interactive Stable Ray Tracing* (Dal Corso et al. 2017), called
//! paper 1 all over these pages.
//!
//! # The rooms
//!
//! | module | what it knows |
//! | --- | --- |
//! | [`renderer`] | the embedding surface: create, record a frame, resize, read what it did |
//! | [`headless`] | rendering without a host: submits, waits, reads back |
//! | [`settings`], [`stats`] | what a renderer is made with, and what is known of a frame after it has run |
//! | [`gpu`] | raw Vulkan: context (own or adopted), memory, pipelines, passes with their barriers. Nothing of rays |
//! | [`scene`] | what is rendered, on the CPU: glTF, materials, lights, animation, built-in scenes. No Vulkan |
//! | [`accel`] | the two-level BVH, laid out for the device. No Vulkan |
//! | [`resident`] | a scene in device memory |
//! | [`phase`] | one file a phase: its shader, what it binds, how many threads it has |
//! | [`method`] | a method as an ordered list of phases, the memory it needs, the constants of a frame; what a frame models, and why |
//! | [`sampler`] | where samples lie on lenses and lights |
//! | [`shaders`] | what the build made of `glsl/`: SPIR-V with its interfaces, structs and constants shared with Rust |
//! | [`oracle`] | the same phases on the CPU: the known answers for tests |
//! | [`metric`] | error, sharpness and stability of image sequences. No Vulkan |
//! | [`report`] | pictures, tables, JSON |
//! | [`trade`] | the search for settings that are worth their time |
//! | [`reproduce`], [`samples`] | the papers' tables and figures; where the samples of a frame lie |
//! | [`progress`], [`error`] | how long work tells that it goes on; what went wrong and what to do about it |
//!
//! # The frame
//!
//! What the host says of a frame ([`FrameInputs`]: camera, placed instances, shapes, lights) goes through a mapped ring to the device,
//! then
//!
//! `reproject → list (scan, gather) → verify → analyze → fill → shadow → shade → medium → reconstruct → resolve → aov`
//!
//! with the paper's order (`reproject → analyze → list → verify → retain`) where `filter.fill` is `none`, `temporal` in place of `resolve` where frames are integrated or averaged, and the counters come back. [`phase`] has
//! the table of what each reads and writes, [`gpu::pass`] the policy by which barriers follow from that; `renderer.plan()` is
//! the frame as data. `supersample`, `taa` and `reference` have `generate` in place of the first three and keep no samples,
//! `point-tracking` has `track` and keeps points that direct its rays. Two caches swap roles from frame to frame, and two frames may be in flight.
//!
//! # A host of its own
//!
//! An engine lends its device, and stillray records into its command buffers. What the device must have can be asked
//! beforehand ([`gpu::fit`]).
//!
//! ```
//! use stillray::ash::{self, vk};
//! use stillray::gpu::fit;
//! use stillray::scene::{builtin, motion::Motion};
//! use stillray::{Context, FrameInputs, HostHandles, Renderer, Settings};
//!
//! fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     // SAFETY: handles are made in order, used while they live, and destroyed in reverse, once nothing uses them.
//!     unsafe {
//!         // The host's instance, and a device of it that fits.
//!         let entry = ash::Entry::load()?;
//!         let app = vk::ApplicationInfo::default().api_version(fit::API_VERSION);
//!         let instance = entry.create_instance(&vk::InstanceCreateInfo::default().application_info(&app), None)?;
//!         for need in fit::REQUIRED.iter().chain(fit::PREFERRED) {
//!             println!("{}: {}", need.name, need.why);
//!         }
//!         let seen: Vec<fit::Fit> =
//!             instance.enumerate_physical_devices()?.into_iter().map(|p| fit::examine(&instance, p)).collect();
//!         seen.iter().for_each(|f| println!("{} ({}): {:?}", f.name(), f.kind(), f.rejected));
//!         let best = seen.iter().filter(|f| f.rejected.is_empty()).min_by_key(|f| f.rank()).ok_or("no device fits")?;
//!         let (physical_device, queue_family) = (best.physical, best.queue_family.ok_or("no compute queue")?);
//!
//!         // The host's device, with the features that are required.
//!         let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
//!         let mut v13 = vk::PhysicalDeviceVulkan13Features::default().synchronization2(true);
//!         let features = vk::PhysicalDeviceFeatures::default().shader_storage_image_extended_formats(true);
//!         let info =
//!             vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_features(&features).push_next(&mut v13);
//!         let device = instance.create_device(physical_device, &info, None)?;
//!         let queue = device.get_device_queue(queue_family, 0);
//!         let pool_info = vk::CommandPoolCreateInfo::default().queue_family_index(queue_family);
//!         let pool = device.create_command_pool(&pool_info, None)?;
//!         let fence = device.create_fence(&vk::FenceCreateInfo::default(), None)?;
//!
//!         // Lent to stillray.
//!         let context = Context::adopt(&HostHandles {
//!             get_instance_proc_addr: entry.static_fn().get_instance_proc_addr,
//!             instance: instance.handle(),
//!             physical_device,
//!             device: device.handle(),
//!             queue,
//!             queue_family,
//!         })?;
//!         let scene = builtin::load("cornell", 0)?;
//!         let mut renderer = Renderer::new(&context, &scene, &Settings { size: [64, 48], ..Settings::default() })?;
//!
//!         // Two frames of a camera that pans, each recorded into a command buffer of the host's.
//!         let pose = scene.pose(0.0);
//!         let (low, high) = scene.bounds(&pose).ok_or("an empty scene")?;
//!         for index in 0..2 {
//!             let (middle, radius) = ((low + high) * 0.5, (high - low).length() * 0.5);
//!             let view = Motion::Pan.view(&pose.cameras[0], middle, radius, f64::from(index) / 60.0);
//!             let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
//!             let commands = device.allocate_command_buffers(&info)?;
//!             device.begin_command_buffer(commands[0], &vk::CommandBufferBeginInfo::default())?;
//!             let outputs = renderer.record(commands[0], &FrameInputs { view, pose: &pose, reset: false })?;
//!             // Here the host records its own use of `outputs.color`, behind a barrier (see `FrameOutputs`).
//!             device.end_command_buffer(commands[0])?;
//!             device.queue_submit(queue, &[vk::SubmitInfo::default().command_buffers(&commands)], fence)?;
//!             device.wait_for_fences(&[fence], true, u64::MAX)?;
//!             device.reset_fences(&[fence])?;
//!
//!             let stats = renderer.stats(outputs.ticket).ok_or("a frame that was waited for")?;
//!             println!("frame {index}: {} rays, {:.0} % reused", stats.rays, 100.0 * stats.reused_fraction());
//!             assert!(stats.rays > 0 && (index == 0 || stats.reused > 0));
//!         }
//!
//!         // What was lent is the host's to destroy, after all that was made from it.
//!         drop((renderer, context));
//!         device.destroy_fence(fence, None);
//!         device.destroy_command_pool(pool, None);
//!         device.destroy_device(None);
//!         instance.destroy_instance(None);
//!     }
//!     Ok(())
//! }
//! ```
//!
//! Without a host, [`headless::Session`] does the same in five lines; the program `stillray` is made of it.

pub mod accel;
mod deforming;
pub mod emitters;
pub mod error;
pub mod gpu;
pub mod headless;
pub mod method;
pub mod metric;
pub mod oracle;
pub mod phase;
pub mod progress;
pub mod renderer;
pub mod report;
pub mod reproduce;
pub mod resident;
pub mod sampler;
pub mod samples;
pub mod scene;
pub mod settings;
pub mod shaders;
pub mod stats;
pub mod trade;

/// The Vulkan bindings whose types the interface takes: a host uses the same version.
pub use ash;
pub use error::{Error, Result};
/// The vector types that scenes and views are made of.
pub use glam;
pub use gpu::{Context, ContextOptions, HostHandles};
pub use renderer::{Aov, FrameInputs, FrameOutputs, FrameStats, Method, PhaseTime, Renderer, Settings, Ticket};
pub use scene::{Pose, Scene, View};
