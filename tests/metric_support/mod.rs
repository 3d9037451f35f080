//! Frames for the tests of metrics.

#![allow(dead_code)] // each test takes what it needs
#![allow(clippy::unwrap_used, reason = "a panic in a test's helper is a failing test")]

pub mod pattern;

use stillray::metric::image::{Frame, planar};

/// A frame of interleaved RGB values, `display` for encoded ones, anything else for linear ones.
pub fn frame(space: &str, size: [u32; 2], values: &[f32]) -> Frame {
    match space {
        "display" => Frame::from_display(size, planar(3, values)).unwrap(),
        _ => Frame::from_linear(size, planar(3, values), 0.0).unwrap(),
    }
}
