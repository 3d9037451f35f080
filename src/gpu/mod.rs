//! Raw Vulkan, managed by hand. Knows nothing of rays.
//!
//! | file | what it owns |
//! | --- | --- |
//! | [`context`] | loader, instance, device and queue: our own, or adopted from a host |
//! | [`fit`] | what a device must have, and why one does not fit |
//! | [`memory`] | device memory, with a table of what is allocated for what |
//! | [`buffer`], [`image`] | buffers and images |
//! | [`pipeline`] | compute pipelines |
//! | `cache` | the pipeline cache on disk |
//! | [`pass`] | one step of a frame as data, with its reads and writes; barriers follow from those |
//! | [`recorder`] | turns passes into commands, with a timestamp at every label |
//! | [`submit`] | one-off submissions that wait: uploads, read-back, frames without a host |
//!
//! # Lifetime rules
//!
//! Every object holds the context alive and is destroyed by the type that made it. Dropping an object while the device
//! still uses it is the caller's error: whoever submits work waits for it before it drops what the work uses.

pub mod buffer;
mod cache;
pub mod context;
pub mod fit;
pub mod image;
pub mod kernel;
pub mod memory;
pub mod pass;
pub mod pipeline;
pub mod recorder;
pub mod submit;

pub use buffer::{Buffer, Place};
pub use context::{Context, ContextOptions, HostHandles};
pub use image::{Image, ImageDesc};
pub use pass::{Barrier, Binder, Pass, Range, Resource, Threads, Work};
pub use pipeline::Pipeline;
pub use recorder::Recorder;

use crate::Error;
use ash::vk;

/// Turns a Vulkan error code into an [`Error`] that says what was being done.
pub(crate) fn check<T>(result: std::result::Result<T, vk::Result>, during: &str) -> crate::Result<T> {
    result.map_err(|result| Error::Vulkan { during: during.to_owned(), result })
}
