//! What is known of a frame after it has run.

use crate::settings::Settings;
use crate::shaders::{self, Counters, RAY_KINDS, Traversals};

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
    /// What rays cost, if the settings ask for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub costs: Option<RayCosts>,
}

/// What the rays of a frame cost (paper 2, section 5).
///
/// A packet is 16 threads of a dispatch that follow each other: with 16 samples a pixel, a pixel's. All counts of rays, nodes and
/// triangles are the same in every run. Those of packets are, too, but for secondary rays, whose lists are in the order in which
/// workgroups come; `path.grouping = none` has no lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct RayCosts {
    /// Camera rays.
    pub camera: RayCost,
    /// Shadow rays from surfaces, those at the ends of secondary rays and diffuse paths included.
    pub shadow: RayCost,
    /// Secondary rays of what was reflected.
    pub reflection: RayCost,
    /// Secondary rays of what passed through a surface.
    pub refraction: RayCost,
    /// Shadow rays of marches through fog or mist.
    pub march: RayCost,
    /// Rays of diffuse paths.
    pub indirect: RayCost,
    /// Steps of these marches.
    pub march_steps: u64,
}

/// What the rays of one kind cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct RayCost {
    /// Rays traced.
    pub rays: u64,
    /// Nodes of the acceleration structure that they visited.
    pub nodes: u64,
    /// Triangles that they were tested against.
    pub triangles: u64,
    /// Nodes that the threads of their packets had time for, if the threads of a packet wait for each other: 16 times those of
    /// its slowest. Where a thread traces several rays, it goes from one to the next without waiting.
    pub held: u64,
    /// Packets, by the kind of their slowest ray.
    pub packets: u64,
    /// Different triangles that the rays of a packet were tested against, summed over packets. The rays of its threads to the same light are
    /// taken together. Estimated and rounded to a whole number, with a standard deviation of 2 % a packet where there are fewer
    /// than 2048; 15615 at most.
    pub packet_triangles: u64,
}

impl RayCosts {
    /// From what the device counted.
    pub fn of(traversals: &Traversals) -> Self {
        let of = |kind: u32| traversals.kinds.get(kind as usize).map(RayCost::of).unwrap_or_default();
        Self {
            camera: of(shaders::RAY_CAMERA),
            shadow: of(shaders::RAY_SHADOW),
            reflection: of(shaders::RAY_REFLECTED),
            refraction: of(shaders::RAY_REFRACTED),
            march: of(shaders::RAY_MARCH),
            indirect: of(shaders::RAY_INDIRECT),
            march_steps: wide(traversals.march_steps),
        }
    }

    /// Of each kind, with its name.
    pub fn kinds(&self) -> [(&'static str, RayCost); RAY_KINDS as usize] {
        [
            ("camera", self.camera),
            ("shadow", self.shadow),
            ("reflection", self.reflection),
            ("refraction", self.refraction),
            ("march", self.march),
            ("indirect", self.indirect),
        ]
    }

    /// Of two frames together.
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            camera: self.camera.plus(&other.camera),
            shadow: self.shadow.plus(&other.shadow),
            reflection: self.reflection.plus(&other.reflection),
            refraction: self.refraction.plus(&other.refraction),
            march: self.march.plus(&other.march),
            indirect: self.indirect.plus(&other.indirect),
            march_steps: self.march_steps.saturating_add(other.march_steps),
        }
    }
}

impl RayCost {
    fn of(costs: &shaders::RayCosts) -> Self {
        Self {
            rays: wide(costs.rays),
            nodes: wide(costs.nodes),
            triangles: wide(costs.triangles),
            held: wide(costs.held),
            packets: wide(costs.packets),
            packet_triangles: wide(costs.packet_triangles),
        }
    }

    /// Of two sets of rays together.
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            rays: self.rays.saturating_add(other.rays),
            nodes: self.nodes.saturating_add(other.nodes),
            triangles: self.triangles.saturating_add(other.triangles),
            held: self.held.saturating_add(other.held),
            packets: self.packets.saturating_add(other.packets),
            packet_triangles: self.packet_triangles.saturating_add(other.packet_triangles),
        }
    }

    /// Nodes a ray.
    pub fn nodes_per_ray(&self) -> f64 {
        self.nodes as f64 / self.rays.max(1) as f64
    }

    /// Triangles a ray.
    pub fn triangles_per_ray(&self) -> f64 {
        self.triangles as f64 / self.rays.max(1) as f64
    }

    /// Part of the time of its packets in which a thread visits nodes instead of waiting for the slowest, 0 to 1.
    pub fn utilisation(&self) -> f64 {
        self.nodes as f64 / self.held.max(1) as f64
    }

    /// Different triangles that a packet tests.
    pub fn triangles_per_packet(&self) -> f64 {
        self.packet_triangles as f64 / self.packets.max(1) as f64
    }
}

/// Of two words, the low one first.
fn wide([low, high]: [u32; 2]) -> u64 {
    u64::from(high) << 32 | u64::from(low)
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
            costs: None,
        }
    }

    /// The part of the camera rays that went to samples of earlier frames, 0 to 1.
    pub fn reused_fraction(&self) -> f64 {
        f64::from(self.reused) / f64::from((self.reused + self.added).max(1))
    }
}
