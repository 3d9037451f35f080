//! What is known of a frame after it has run.

use crate::settings::Settings;
use crate::shaders::Counters;

/// Counts of one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct FrameStats {
    /// Camera rays traced: kept and new samples, those found occluded included; with a fill those that were then evicted too.
    pub rays: u32,
    /// Shadow rays traced.
    pub shadow_rays: u32,
    /// Secondary rays of what was reflected.
    pub reflection_rays: u32,
    /// Secondary rays of what passed through a surface.
    pub refraction_rays: u32,
    /// Secondary rays of diffuse paths.
    pub indirect_rays: u32,
    /// Samples that were reprojected onto the screen and kept; with a fill, those that were evicted then too; with point
    /// tracking, rays towards points of the last frame.
    pub reused: u32,
    /// Samples added; with point tracking, rays that no point directed.
    pub added: u32,
    /// Unoccluded samples evicted by the analysis.
    pub evicted: u32,
    /// Kept samples found occluded.
    pub occluded: u32,
    /// Kept samples that their own ray no longer found, and that are forgotten.
    pub lost: u32,
    /// Occluded samples that were a pixel's last and took their occluder's hit.
    pub replaced: u32,
    /// Samples given up because the cache was full.
    pub thinned: u32,
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

impl FrameStats {
    /// From the counters that the device kept.
    pub(crate) fn new(c: &Counters, settings: &Settings) -> Self {
        let reprojects = settings.method.reprojects();
        let added = if reprojects { c.added } else { c.samples };
        // With a fill everything that was reprojected is traced, whatever becomes of it.
        let fills = settings.fills();
        let reused = if fills { c.first } else { c.reused };
        let wanted = added + reused;
        let gone = if fills { c.evicted } else { 0 };
        // No pixel of a method that reprojects nothing has a reprojected sample.
        let mut histogram = [0; 17];
        histogram[0] = settings.size[0] * settings.size[1];
        Self {
            rays: c.samples,
            shadow_rays: c.shadow_rays,
            reflection_rays: c.reflection_rays,
            refraction_rays: c.refraction_rays,
            indirect_rays: c.indirect_rays,
            reused,
            added,
            evicted: c.evicted,
            occluded: c.occluded,
            lost: c.lost,
            replaced: c.replaced,
            thinned: wanted.saturating_sub(c.samples),
            shaded: (c.samples + c.replaced).saturating_sub(c.occluded + c.lost + gone),
            histogram: if reprojects { c.histogram } else { histogram },
        }
    }

    /// The part of the camera rays that went to samples of earlier frames, 0 to 1.
    pub fn reused_fraction(&self) -> f64 {
        f64::from(self.reused) / f64::from((self.reused + self.added).max(1))
    }
}
