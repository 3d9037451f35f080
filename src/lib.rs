//! Temporally stable ray tracing on plain Vulkan compute.
pub mod accel;
pub mod error;
pub mod gpu;
pub mod headless;
pub mod method;
pub mod oracle;
pub mod phase;
pub mod progress;
pub mod renderer;
pub mod report;
pub mod resident;
pub mod scene;
pub mod settings;
pub mod shaders;
pub mod stats;
pub use error::{Error, Result};
