//! The embedding surface.

use crate::scene::{Pose, View};

/// How to render. See [`Settings::default`] for the defaults.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// How samples are chosen.
    pub method: Method,
    /// Width and height in pixels, each at least 1.
    pub size: [u32; 2],
    /// `stable`: samples a pixel to aim at, 0.0625 to 16.
    pub density: f32,
    /// `stable`: deviation from `density` that is tolerated before samples are added or evicted, 0.0625 to 16.
    pub tolerance: f32,
    /// `supersample` and `reference`: stratified samples a pixel and frame, 1 to 16.
    pub spp: u32,
    /// `supersample`: new sample positions each frame, instead of the same ones.
    pub jitter: bool,
    /// Seeds all random choices.
    pub seed: u32,
    /// 32-bit float output instead of 16-bit.
    pub float_output: bool,
    /// Which images besides colour are written.
    pub aovs: Vec<Aov>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: Method::Stable,
            size: [640, 480],
            density: 1.0,
            tolerance: 1.0,
            spp: 1,
            jitter: false,
            seed: 0,
            float_output: false,
            aovs: Vec::new(),
        }
    }
}

/// How samples are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Reprojected samples, paper 1.
    Stable,
    /// `spp` stratified samples a pixel, traced anew each frame.
    Supersample,
    /// As `Supersample`, jittered and accumulated over all frames since the last reset.
    Reference,
}

/// Images besides colour. All are one 32-bit float a pixel, but motion, which is two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Aov {
    /// Distance from the camera in metres of the nearest sample of the pixel; infinity for the sky.
    Depth,
    /// Pixels moved since the last frame (x right, y down), the longest of the pixel's samples.
    Motion,
    /// Red: samples evicted, green: samples added, blue: samples kept (paper 1, figure 4). Three floats.
    Density,
    /// Frames that the pixel's oldest sample has lived.
    Age,
}

/// What changes from frame to frame.
#[derive(Debug, Clone, Copy)]
pub struct FrameInputs<'a> {
    /// Where the frame is seen from.
    pub view: View,
    /// Where everything is.
    pub pose: &'a Pose,
    /// A camera cut: forget all samples.
    pub reset: bool,
}

/// Counts of one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct FrameStats {
    /// Camera rays traced: kept and new samples.
    pub rays: u32,
    /// Shadow rays traced.
    pub shadow_rays: u32,
    /// Samples that were reprojected onto the screen and kept.
    pub reused: u32,
    /// Samples added.
    pub added: u32,
    /// Samples evicted by the analysis.
    pub evicted: u32,
    /// Kept samples found occluded.
    pub occluded: u32,
    /// Samples shaded.
    pub shaded: u32,
    /// Pixels with 0, 1, 2, … 16 reprojected unoccluded samples, before samples are added or evicted.
    pub histogram: [u32; 17],
}

/// Time of one phase of a frame.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct PhaseTime {
    /// The phase's label.
    pub label: &'static str,
    /// Milliseconds on the device.
    pub ms: f64,
}
