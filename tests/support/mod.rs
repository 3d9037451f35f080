//! What several integration tests share.
#![allow(dead_code)] // each test binary uses a part of it
#![allow(clippy::unwrap_used, clippy::expect_used)] // a panic in a test's helper is a failing test

pub mod host;
pub mod kernel;
pub mod masks;
pub mod probe;
pub mod random;
pub mod shaded;
pub mod view;

pub mod rig;

use stillray::gpu::{Context, ContextOptions};

/// A device with validation and synchronisation validation on. The tests run on whatever device is best here; without
/// any, or without the layer, they fail: a skipped test proves nothing.
pub fn validated_context() -> Context {
    Context::new(&ContextOptions { device: None, validation: true }).expect("a Vulkan 1.3 device and validation layers")
}

/// What the layer may say, and why it is none of our faults.
const ACCEPTED: [(&str, &str); 1] = [(
    "layout should be VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL instead of GENERAL",
    "images stay in GENERAL: gpu/pass.rs",
)];

/// Fails if the validation layer said anything since the context was made that is not accepted above.
pub fn assert_clean(context: &Context) {
    let accepted = |message: &String| ACCEPTED.iter().any(|(text, _)| message.contains(text));
    let messages: Vec<String> = context.validation_messages().into_iter().filter(|m| !accepted(m)).collect();
    assert!(messages.is_empty(), "validation messages:\n{}", messages.join("\n"));
}
