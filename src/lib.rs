//! Temporally stable ray tracing on plain Vulkan compute.
pub mod accel;
pub mod error;
pub mod gpu;
pub mod headless;
pub mod oracle;
pub mod progress;
pub mod renderer;
pub mod report;
pub mod scene;
pub mod shaders;
pub use error::{Error, Result};
