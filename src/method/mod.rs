//! A method is an ordered list of phases; the barriers between them follow from what each reads and writes.

pub mod buffers;
pub mod constants;
pub mod model;
pub mod plan;
pub mod ring;
pub mod storage;

/// Frames in flight. It is also the number of plans of a method, since the two caches swap roles in step.
pub const SLOTS: usize = 2;
