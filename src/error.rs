//! The one error type of the library: what went wrong, where, and what to do about it.

use std::path::PathBuf;

/// Everything that can go wrong in the library.
///
/// Every message is one line that names the thing concerned and ends with what the user can do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// No Vulkan loader could be opened on this machine.
    #[error("no Vulkan loader found ({cause}): install libvulkan1 and a driver such as mesa-vulkan-drivers")]
    NoLoader {
        /// What the dynamic linker said.
        cause: String,
    },
    /// A loader is there, but no device fits.
    #[error("no fitting Vulkan device{}: {}", selector_text(.selector), rejections_text(.rejected))]
    NoDevice {
        /// What the user asked for, if anything.
        selector: Option<String>,
        /// Every device seen, with the reason for which it was passed over.
        rejected: Vec<(String, String)>,
    },
    /// A Vulkan call failed.
    #[error("Vulkan call failed while {during}: {result}")]
    Vulkan {
        /// What was being done, as a phrase that follows "while".
        during: String,
        /// The code that Vulkan returned.
        result: ash::vk::Result,
    },
    /// The device cannot hold what was asked for.
    #[error("out of device memory: {bytes} bytes asked for {purpose}; {advice}")]
    OutOfMemory {
        /// Size of the request that failed, in bytes.
        bytes: u64,
        /// What the memory was for.
        purpose: String,
        /// What to lower.
        advice: String,
    },
    /// A buffer exceeds a limit of the device.
    #[error("{what} needs {needed} bytes, but this device binds at most {limit} ({limit_name}): {advice}")]
    TooLarge {
        /// The buffer concerned.
        what: String,
        /// Bytes needed.
        needed: u64,
        /// The device's limit in bytes.
        limit: u64,
        /// The limit's name in Vulkan.
        limit_name: &'static str,
        /// What to lower.
        advice: String,
    },
    /// The scene file could not be read or is not valid.
    #[error("{}: {message}", .path.display())]
    Scene {
        /// The file, or the name of the built-in scene.
        path: PathBuf,
        /// What is wrong, where in the file, and what to do.
        message: String,
    },
    /// The scene is valid but uses something that is not supported.
    #[error("{}: {place} uses {feature}, which stillray does not support yet: {advice}", .path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The node, mesh, material or texture that uses it, by kind and name or index.
        place: String,
        /// The extension or feature.
        feature: String,
        /// What to do instead.
        advice: String,
    },
    /// A setting is outside its range or contradicts another.
    #[error("{name} = {value} is not valid: {expected}")]
    Setting {
        /// The setting's name, as the user writes it.
        name: &'static str,
        /// The value given.
        value: String,
        /// What is allowed.
        expected: String,
    },
    /// No setting has this name.
    #[error("no setting is called '{name}'; did you mean '{nearest}'?")]
    UnknownKnob {
        /// The name given.
        name: String,
        /// The name that is most like it.
        nearest: &'static str,
    },
    /// A settings file says something that makes no sense.
    #[error("{}: {message}", .path.display())]
    SettingsFile {
        /// The file.
        path: PathBuf,
        /// What is wrong and what is allowed.
        message: String,
    },
    /// A search's folder, or what is asked of it, makes no sense.
    #[error("{}: {message}", .path.display())]
    Search {
        /// The folder or file.
        path: PathBuf,
        /// What is wrong and what to do.
        message: String,
    },
    /// A file could not be read or written.
    #[error("{}: {cause}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        cause: std::io::Error,
    },
    /// Frames cannot be measured against each other.
    #[error("{message}")]
    Frames {
        /// Which frame, and what is wrong with it.
        message: String,
    },
    /// An image could not be encoded or decoded.
    #[error("{}: {message}", .path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// What the codec said.
        message: String,
    },
}

/// Short for a result with [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

fn selector_text(selector: &Option<String>) -> String {
    selector.as_ref().map_or_else(String::new, |s| format!(" matches '{s}'"))
}

fn rejections_text(rejected: &[(String, String)]) -> String {
    if rejected.is_empty() {
        return "the loader lists none; install a driver such as mesa-vulkan-drivers".to_owned();
    }
    let all: Vec<String> = rejected.iter().map(|(name, why)| format!("{name}: {why}")).collect();
    all.join("; ")
}
