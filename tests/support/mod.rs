//! What several integration tests share.
#![allow(dead_code)] // each test binary uses a part of it

pub mod kernel;
pub mod random;
pub mod view;

use stillray::gpu::{Context, ContextOptions};

/// A device with validation and synchronisation validation on. The tests run on whatever device is best here; without
/// any, or without the layer, they fail: a skipped test proves nothing.
pub fn validated_context() -> Context {
    Context::new(&ContextOptions { device: None, validation: true }).expect("a Vulkan 1.3 device and validation layers")
}

/// Fails if the validation layer said anything since the context was made.
pub fn assert_clean(context: &Context) {
    let messages = context.validation_messages();
    assert!(messages.is_empty(), "validation messages:\n{}", messages.join("\n"));
}
