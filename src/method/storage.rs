//! How much memory a frame needs, as one pure function: sizes, and which buffers may share bytes.
//!
//! What is alive when (a column a phase, `=` alive):
//!
//! ```text
//!            reproject analyze list verify retain shadow shade reconstruct resolve next frame
//! samples A  =====================                                                  (in turn)
//! samples B                    =======================================================
//! claims     ====================
//! found                             ======================
//! lit                                              ========
//! shaded                                                 ===============
//! film                                                         ==============
//! motion                                                       ==============
//! history                                                                =============  (in turn)
//! ```
//!
//! So `found`, `lit` and `shaded` live where the claims were, and film and motion where `found` and `lit` were (but for
//! `reference`, whose film is carried from frame to frame). `temporal`, where there is one, is in the place of `resolve`.

use crate::Result;
use crate::gpu::buffer::within;
use crate::settings::{Aov, Precision, Sampling, Settings, Temporal};
use crate::shaders::{
    Found, Gathered, MODEL_AGE, MODEL_COUNT, MODEL_INDIRECT, MODEL_MEDIUM, MODEL_PATH, MODEL_SEED, MODEL_SOURCE,
    Medium, Sample, Shaded, Tracked, Traversals,
};

/// Sizes in bytes of everything that belongs to a renderer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Storage {
    /// Where samples come from.
    pub sampling: Sampling,
    /// Pixels of a frame.
    pub pixels: u64,
    /// Tiles of 8 × 8 pixels.
    pub tiles: u64,
    /// Samples that a cache holds.
    pub capacity: u64,
    /// Occluded samples that the analysis leaves in a pixel.
    pub occluded_limit: u32,
    /// One cache.
    pub samples: u64,
    /// Caches: two that alternate, or one.
    pub caches: u64,
    /// Ages of one cache, 0 if not asked for.
    pub ages: u64,
    /// Sources of the samples, 0 if not asked for.
    pub sources: u64,
    /// What reached each sample of one cache, 0 if not asked for.
    pub memory: u64,
    /// Seeds of one cache, 0 if samples have none.
    pub seeds: u64,
    /// Four words a sample, three times, and as much as two of these words for the lists; 0 if paths do not go on.
    pub paths: u64,
    /// What the samples of one cache have gathered from diffuse paths, and as much for what paths bring; 0 if there are none.
    pub gathered: u64,
    /// Constants of the medium, 0 if there is none.
    pub medium: u64,
    /// What rays have cost, 0 if it is not counted.
    pub traversals: u64,
    /// Claims, 0 if samples are not reprojected.
    pub claims: u64,
    /// Masks, and as much again for the plan; 0 if samples are not reprojected.
    pub masks: u64,
    /// Prefix sums over tiles.
    pub tile_sums: u64,
    /// First sample of each pixel.
    pub offsets: u64,
    /// Where the ray of each pixel goes, 0 if points are not tracked.
    pub aims: u64,
    /// The same of what the fill adds, 0 without one.
    pub extras: u64,
    /// What the rays found.
    pub found: u64,
    /// Lights that reach each sample.
    pub lit: u64,
    /// Shaded samples.
    pub shaded: u64,
    /// Weighted sums of the reconstruction.
    pub film: u64,
    /// Longest motion of each pixel, behind the film; 0 if frames are not integrated.
    pub motion: u64,
    /// One picture of the frames before, or for the box filter all of them; 0 if none is kept.
    pub history: u64,
    /// Pictures that are kept apart: two that alternate, or one.
    pub histories: u64,
    /// Where `shaded` begins in the shared memory.
    pub shaded_offset: u64,
    /// Bytes shared by claims, found, lit, shaded, film and motion.
    pub shared: u64,
    /// Whether the film has memory of its own.
    pub own_film: bool,
}

/// Ranges of one buffer start at multiples of this: the largest `minStorageBufferOffsetAlignment` that Vulkan allows.
pub const ALIGNMENT: u64 = 256;

impl Storage {
    /// For these settings, where these `MODEL_` bits are modelled.
    pub fn new(settings: &Settings, model: u32) -> Self {
        let pixels = u64::from(settings.size[0]) * u64::from(settings.size[1]);
        let tiles = u64::from(settings.size[0].div_ceil(8)) * u64::from(settings.size[1].div_ceil(8));
        let sampling = settings.method.sampling();
        let stable = sampling == Sampling::Reprojected;
        let (capacity, claims) = match sampling {
            Sampling::Reprojected => (stable_capacity(settings, pixels), pixels * subpixels(settings) * 4),
            Sampling::Tracked => (pixels, pixels * size_of::<Tracked>() as u64),
            Sampling::Fresh => (pixels * u64::from(settings.spp), 0),
        };
        let own_film = settings.method.accumulates();
        let found = (capacity * size_of::<Found>() as u64).next_multiple_of(ALIGNMENT);
        let lit = (capacity * 4).next_multiple_of(ALIGNMENT);
        let shaded = (capacity * size_of::<Shaded>() as u64).next_multiple_of(ALIGNMENT);
        let film = (pixels * 16).next_multiple_of(ALIGNMENT);
        let (motion, history, histories) = history(settings, pixels);
        let shaded_offset = (found + lit).max(if own_film { 0 } else { film + motion });
        Self {
            sampling,
            pixels,
            tiles,
            capacity,
            occluded_limit: occluded_limit(settings.density),
            samples: capacity * size_of::<Sample>() as u64,
            caches: if settings.method.reprojects() { 2 } else { 1 },
            ages: if model & MODEL_AGE != 0 { capacity * 4 } else { 0 },
            sources: if model & MODEL_SOURCE != 0 { capacity * 4 } else { 0 },
            memory: if stable && settings.aovs.contains(&Aov::Changes) { capacity * 4 } else { 0 },
            seeds: if model & MODEL_SEED != 0 { capacity * 4 } else { 0 },
            paths: if model & MODEL_PATH != 0 { capacity * 16 } else { 0 },
            gathered: if model & MODEL_INDIRECT != 0 { capacity * size_of::<Gathered>() as u64 } else { 0 },
            medium: if model & MODEL_MEDIUM != 0 { size_of::<Medium>() as u64 } else { 0 },
            traversals: if model & MODEL_COUNT != 0 { size_of::<Traversals>() as u64 } else { 0 },
            claims,
            masks: if stable { pixels * 4 } else { 0 },
            tile_sums: if stable { tiles * 4 } else { 0 },
            offsets: (pixels + 1) * 4,
            aims: if sampling == Sampling::Tracked { pixels * 8 } else { 0 },
            extras: if settings.fills() { (pixels + 1) * 4 } else { 0 },
            found,
            lit,
            shaded,
            film,
            motion,
            history,
            histories,
            shaded_offset,
            shared: claims.max(shaded_offset + shaded),
            own_film,
        }
    }
}

impl Storage {
    /// Whether a device that binds at most `limit` bytes at once (`maxStorageBufferRange`) can hold all of it.
    ///
    /// # Errors
    /// [`crate::Error::TooLarge`] for the first that it cannot, with the settings to lower.
    pub fn check(&self, limit: u64) -> Result<()> {
        let advice = match self.sampling {
            Sampling::Reprojected => "lower --size, --density or --tolerance",
            Sampling::Tracked => "lower --size",
            Sampling::Fresh => "lower --size or --spp",
        };
        let bound = [
            ("the sample cache", self.samples),
            ("the list of claims", self.claims),
            ("the rays' hits", self.found),
            ("the lights that reach each sample", self.lit),
            ("the shaded samples", self.shaded),
            ("the film", self.film),
            ("the sample ages", self.ages),
            ("the samples' seeds", self.seeds),
            ("the paths", self.paths),
            ("what the samples have gathered", self.gathered),
            ("the history", self.history),
            ("what is remembered of the samples", self.memory),
            ("the pixels' offsets", self.offsets),
            ("the pixels' masks", self.masks),
            ("the pixels' aims", self.aims),
        ];
        bound.into_iter().try_for_each(|(what, size)| within("maxStorageBufferRange", limit, what, size, advice))
    }
}

/// Bytes of the motions, bytes of a picture that is kept, and how many of those there are.
fn history(settings: &Settings, pixels: u64) -> (u64, u64, u64) {
    let texel = |float: bool| if float { 16 } else { 8 };
    match settings.temporal() {
        Temporal::None => (0, 0, 0),
        Temporal::Integrate => {
            let picture = pixels * texel(settings.history.precision == Precision::Float);
            ((pixels * 4).next_multiple_of(ALIGNMENT), picture, 2)
        }
        Temporal::Box => (0, pixels * texel(settings.float_output) * u64::from(settings.box_frames - 1), 1),
    }
}

/// Room for the density aimed at and a quarter more for occluded samples, and for the tolerated excess up to once the
/// density. Where a frame asks for more, every pixel gives up an equal part (`glsl/include/thin.glsl`).
fn stable_capacity(settings: &Settings, pixels: u64) -> u64 {
    let density = f64::from(settings.density);
    let subpixels = subpixels(settings);
    let most = (1.25 * density + f64::from(settings.tolerance).min(density)).min(subpixels as f64);
    // Small frames have few pixels to share what one of them needs.
    ((pixels as f64 * most).ceil() as u64).max(1024.min(pixels * subpixels))
}

/// Of a pixel, each of which has a claim and room for a sample.
fn subpixels(settings: &Settings) -> u64 {
    u64::from(settings.subpixels * settings.subpixels)
}

/// Occluded samples come back into view near silhouettes; one for each sample aimed at is plenty there.
fn occluded_limit(density: f32) -> u32 {
    (density.ceil() as u32).clamp(1, 8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Method;

    fn too_large(settings: &Settings, limit: u64) -> Option<String> {
        Storage::new(settings, 0).check(limit).err().map(|e| e.to_string())
    }

    #[test]
    fn what_a_device_cannot_bind_is_refused_with_what_to_lower() {
        let stable = Settings { size: [1920, 1080], ..Settings::default() };
        // 64 bytes of claims a pixel are the most that density 1 binds.
        let most = 64 * 1920 * 1080;
        assert_eq!(too_large(&stable, most), None);
        let error = too_large(&stable, most - 1).unwrap_or_default();
        let words =
            ["claims", "132710400 bytes", "132710399", "maxStorageBufferRange", "--size", "--density", "--tolerance"];
        assert!(words.iter().all(|w| error.contains(w)), "{error}");
        // Of quarter pixels the claims are as long as the found hits, the least of what binds 16 bytes a sample is longer.
        let coarse = Settings { subpixels: 2, ..stable.clone() };
        assert_eq!(Storage::new(&coarse, 0).claims, 16 * 1920 * 1080);
        let supersample = Settings { method: Method::Supersample, spp: 16, ..stable };
        let error = too_large(&supersample, 1 << 27).unwrap_or_default();
        assert!(error.contains("lower --size or --spp") && !error.contains("density"), "{error}");
        let tracked = Settings { method: Method::PointTracking, ..supersample };
        // One sample a pixel whatever `spp`, of which nothing takes more than 16 bytes.
        assert_eq!(too_large(&tracked, 16 * 1920 * 1080), None);
        let error = too_large(&tracked, 16 * 1920 * 1080 - 1).unwrap_or_default();
        assert!(error.ends_with("lower --size") && !error.contains("spp"), "{error}");
    }

    #[test]
    fn a_sample_index_leaves_room_for_the_occlusion_bit_within_every_limit_that_vulkan_has() {
        // Limits are 32 bits, a sample is 16 bytes: 2^28 samples at most.
        let largest = Settings { size: [16384, 16384], density: 16.0, ..Settings::default() };
        assert!(too_large(&largest, u64::from(u32::MAX)).is_some());
        assert!(u64::from(u32::MAX) / size_of::<Sample>() as u64 <= u64::from(crate::shaders::INSTANCE_MASK));
    }

    #[test]
    fn a_pixel_at_density_one_costs_less_than_200_bytes() {
        let s = Storage::new(&Settings { size: [1920, 1080], ..Settings::default() }, 0);
        let image = 8 * s.pixels; // half-float colour
        let total = 2 * s.samples + s.shared + 2 * s.masks + s.tile_sums + s.offsets + image;
        assert!(total < 200 * s.pixels, "{} bytes a pixel", total as f64 / s.pixels as f64);
    }
}
