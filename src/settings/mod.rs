//! How to render: what a renderer is made with.
//!
//! Every setting that trades something for something else is a knob: an entry of the one table in [`knob`], from which
//! come its range check, its place in the settings file ([`file`]), `--set` on the command line and the axes of a search.

pub mod file;
pub mod knob;
mod table;

use crate::sampler::{Strategy, Tiling};
use crate::{Error, Result};
use ash::vk;

/// How to render. See [`Settings::default`] for the defaults.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// How samples are chosen.
    pub method: Method,
    /// Width and height in pixels, each at least 1.
    pub size: [u32; 2],
    /// `stable`, `stable+ti`: samples a pixel to aim at, 0.0625 to 16.
    pub density: f32,
    /// `stable`, `stable+ti`: deviation from `density` that is tolerated before samples are added or evicted, 0.0625 to 16.
    pub tolerance: f32,
    /// `supersample`, `taa` and `reference`: stratified samples a pixel and frame, 1 to 16.
    pub spp: u32,
    /// `supersample`: new sample positions each frame, instead of the same ones.
    pub jitter: bool,
    /// `taa` and `stable+ti`: how the frames before are integrated.
    pub history: History,
    /// All but `taa`, `stable+ti` and `reference`: frames that are averaged, this one included, 1 to 3 (paper 3).
    pub box_frames: u32,
    /// Standard deviation in pixels of the reconstruction filter, a Gaussian over 3 × 3 pixels, 0.25 to 1.
    pub filter_width: f32,
    /// `stable` and `supersample`: what a sample counts for in reconstruction.
    pub filter_weights: Weights,
    /// `stable`: what becomes of strata that a movement has left empty.
    pub filter_fill: Fill,
    /// Seeds all random choices.
    pub seed: u32,
    /// `stable`: what decides about samples where surfaces move against each other.
    pub edges: Edges,
    /// `stable`: subpixels of a pixel across and down, 2 or 4 (M of paper 1, section 4.1). Each holds a sample at most.
    pub subpixels: u32,
    /// How textures are read.
    pub texture_filter: Filter,
    /// Lights at most, 0 to 32, that are chosen for each sample to send a shadow ray to; 0: no shadows.
    pub shadow_rays: u32,
    /// Where samples lie on lenses and lights.
    pub sampler: Strategy,
    /// Which pixel has which of the sampler's patterns.
    pub tiling: Tiling,
    /// What the places of samples on lenses and lights belong to.
    pub hold: Hold,
    /// Points of triangles that shine which are drawn a sample, of which one gets a shadow ray, 0 to 32; 0: they light up nothing.
    pub emitters: u32,
    /// Secondary rays of a path at most, 0 to 8.
    pub path_depth: u32,
    /// Surfaces of at most this perceptual roughness send reflection rays, 0 to 1; 0: only those do that transmit or have Phong's lobe.
    pub gloss: f32,
    /// Part of the paths that are reflected where light passes through too, 0 to 0.95 (P of paper 2, section 3.5); 0: as large a
    /// part as of the light is, from 0.05 to 0.95.
    pub path_part: f32,
    /// Light that comes from surfaces.
    pub indirect: Indirect,
    /// Which secondary rays are traced together.
    pub path_grouping: Grouping,
    /// Steps of a march through fog or mist, 1 to 256.
    pub medium_steps: u32,
    /// What is modelled.
    pub modelling: Modelling,
    /// Whether what rays cost is counted ([`crate::stats::RayCosts`]): the pictures are the same, the times are not.
    pub count: bool,
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
            history: History::default(),
            box_frames: 1,
            edges: Edges::Balanced,
            subpixels: 4,
            texture_filter: Filter::Linear,
            shadow_rays: 32,
            filter_width: 0.5,
            filter_weights: Weights::Voronoi,
            filter_fill: Fill::Edge,
            seed: 0,
            sampler: Strategy::Sobol,
            tiling: Tiling::Sudoku,
            hold: Hold::Sample,
            emitters: 0,
            path_depth: 3,
            gloss: 0.0,
            path_part: 0.25,
            indirect: Indirect::default(),
            path_grouping: Grouping::Kind,
            medium_steps: 32,
            modelling: Modelling::Required,
            count: false,
            float_output: false,
            aovs: Vec::new(),
        }
    }
}

impl Settings {
    /// The defaults of a method: those of all, but for what the method's own paper or purpose says otherwise.
    pub fn of(method: Method) -> Self {
        let spp = if method.accumulates() { 16 } else { 1 };
        // Paper 1, section 6: stable samples need less integration.
        let alpha = if method == Method::StableTi { 0.25 } else { 0.1 };
        // Paper 3, section 2.
        let box_frames = if method == Method::PointTracking { 3 } else { 1 };
        Self { method, spp, box_frames, history: History { alpha, ..History::default() }, ..Self::default() }
    }

    /// What is made of the frames before, if anything.
    pub fn temporal(&self) -> Temporal {
        match self.method.temporal() {
            Temporal::Box if self.box_frames < 2 => Temporal::None,
            other => other,
        }
    }

    /// Changes the method. Knobs that are at the old method's defaults go to those of the new one.
    pub fn switch(&mut self, method: Method) {
        let (old, new) = (Self::of(self.method), Self::of(method));
        self.method = method;
        knob::KNOBS.iter().for_each(|knob| knob.follow(self, &old, &new));
    }

    /// The weights that its method's frames are reconstructed with.
    pub fn weights(&self) -> Weights {
        if self.method.accumulates() { Weights::Equal } else { self.filter_weights }
    }

    /// Whether its method's frames have a fill.
    pub fn fills(&self) -> bool {
        self.method.keeps_samples() && self.filter_fill == Fill::Edge
    }

    /// Whether every value is in its range.
    ///
    /// # Errors
    /// [`Error::Setting`] with the name, the value and the range.
    pub fn validate(&self) -> Result<()> {
        let [w, h] = self.size;
        if !((1..=16384).contains(&w) && (1..=16384).contains(&h)) {
            let expected = "from 1x1 to 16384x16384".to_owned();
            return Err(Error::Setting { name: "size", value: format!("{w}x{h}"), expected });
        }
        knob::KNOBS.iter().try_for_each(|knob| knob.check(&knob.get(self)))?;
        let most = (self.subpixels * self.subpixels) as f32;
        if self.method.keeps_samples() && self.density > most {
            let expected = format!("at most {most} with subpixels = {}", self.subpixels);
            return Err(Error::Setting { name: "density", value: self.density.to_string(), expected });
        }
        Ok(())
    }
}

/// What is rendered with: where samples come from, and what is made of the frames before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Reprojected samples, paper 1.
    Stable,
    /// `spp` stratified samples a pixel, traced anew each frame.
    Supersample,
    /// As `Supersample`, jittered in each frame and integrated over time: temporal antialiasing (paper 1, section 6).
    Taa,
    /// As `Stable`, integrated over time (paper 1, sections 4.4 and 6).
    #[serde(rename = "stable+ti")]
    StableTi,
    /// As `Supersample`, jittered and accumulated over all frames since the last reset.
    Reference,
    /// One sample a pixel, traced towards a hit point of the last frame where one is projected onto the pixel: paper 3.
    PointTracking,
}

/// What is made of the frames before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Temporal {
    /// Nothing.
    None,
    /// The last picture is followed along the motion, clamped to what the new one shows around a pixel, and blended with it
    /// ([`History`]).
    Integrate,
    /// The last [`Settings::box_frames`] frames are averaged, each pixel for itself (paper 3).
    Box,
}

/// Temporal integration: Karis (2014), clamped as by Patney et al. (2016).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct History {
    /// 0.01 to 1: weight of the new frame; 1 keeps nothing of those before.
    pub alpha: f32,
    /// 0 to 16 standard deviations: how far the history may be from the mean of the 3 × 3 pixels around; 16 does not clamp.
    pub clamp: f32,
    /// How the history is read between its pixels.
    pub filter: HistoryFilter,
    /// What the history is stored in.
    pub precision: Precision,
}

impl Default for History {
    fn default() -> Self {
        Self { alpha: 0.1, clamp: 1.0, filter: HistoryFilter::CatmullRom, precision: Precision::Half }
    }
}

/// Indirect light by diffuse paths, one a sample and frame, whose mean stays with the sample (paper 1, section 6.1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Indirect {
    /// Rays of a path, 0 to 4; 0: no indirect light but what is uniform.
    pub depth: u32,
    /// 0.01 to 1: least weight of the newest path in its sample's mean while anything but the camera moves.
    pub alpha: f32,
    /// 0 to 1e6: radiance at most, in any channel, that one path brings; 0: no limit.
    pub clamp: f32,
}

impl Default for Indirect {
    fn default() -> Self {
        Self { depth: 0, alpha: 0.1, clamp: 0.0 }
    }
}

/// How an image is read between its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HistoryFilter {
    /// 2 × 2 pixels.
    Bilinear,
    /// 4 × 4 pixels, which blurs less; never beyond their range.
    CatmullRom,
}

impl HistoryFilter {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Bilinear, Self::CatmullRom];

    /// As the settings file spells it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bilinear => "bilinear",
            Self::CatmullRom => "catmull-rom",
        }
    }
}

/// What colours are stored in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 16-bit floats: 11 bits, at most 65504.
    Half,
    /// 32-bit floats.
    Float,
}

impl Precision {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Half, Self::Float];

    /// As the settings file spells it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Half => "half",
            Self::Float => "float",
        }
    }
}

/// What decides about samples next to hidden ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Edges {
    /// Each pixel fills its own strata, from density 1 on (see `glsl/include/analysis.glsl`).
    Balanced,
    /// The density of the window, as everywhere: paper 1, Equation 1.
    Paper,
}

impl Edges {
    /// All of them with their names.
    pub const ALL: [(Self, &str); 2] = [(Self::Balanced, "balanced"), (Self::Paper, "paper")];
}

/// How textures are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    /// As the scene has it: bilinear unless a texture asks for its nearest texel.
    Linear,
    /// The nearest texel of every texture.
    Nearest,
}

impl Filter {
    /// All of them with their names.
    pub const ALL: [(Self, &str); 2] = [(Self::Linear, "linear"), (Self::Nearest, "nearest")];
}

/// What a sample counts for in reconstruction, besides its distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Weights {
    /// All the same (paper 1, section 4.4).
    Equal,
    /// The area that is nearer to it than to others, on the 4 × 4 subpixels of each pixel.
    Voronoi,
}

impl Weights {
    /// All of them.
    pub const ALL: &[Self] = &[Self::Equal, Self::Voronoi];

    /// As the command line and the settings file spell it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Equal => "equal",
            Self::Voronoi => "voronoi",
        }
    }
}

/// What becomes of strata that a movement has left empty.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fill {
    /// They are filled in the next frame: the analysis decides before visibility is known (paper 1, figure 2).
    None,
    /// Beside edges they are filled in the same frame: the analysis decides after verification.
    Edge,
}

impl Fill {
    /// All of them.
    pub const ALL: &[Self] = &[Self::None, Self::Edge];

    /// As the command line and the settings file spell it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Edge => "edge",
        }
    }
}

/// What a sample's places on lenses and lights belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// The sample: they are drawn when it is made and travel with it, so that its noise stays on the surface.
    Sample,
    /// The frame: they are drawn anew in each.
    Frame,
}

impl Hold {
    /// All of them with their names.
    pub const ALL: [(Self, &str); 2] = [(Self::Sample, "sample"), (Self::Frame, "frame")];
}

/// Which secondary rays are traced together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grouping {
    /// Those of a kind: a list of reflected rays, and behind it one of refracted ones (paper 2, section 3).
    Kind,
    /// Those of neighbouring samples: one list of both kinds.
    Mixed,
    /// No list: in every step every sample has a thread, whether it has a ray or not.
    None,
}

impl Grouping {
    /// All of them with their names.
    pub const ALL: [(Self, &str); 3] = [(Self::Kind, "kind"), (Self::Mixed, "mixed"), (Self::None, "none")];
}

/// What is modelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Modelling {
    /// What the scene and the settings require ([`crate::method::model`]).
    Required,
    /// Everything that a scene may require. The pictures are the same.
    All,
}

impl Modelling {
    /// All of them with their names.
    pub const ALL: [(Self, &str); 2] = [(Self::Required, "required"), (Self::All, "all")];
}

/// Where the samples of a frame come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampling {
    /// Those of the last frame, reprojected, and new ones where they are too few (paper 1).
    Reprojected,
    /// `spp` new ones a pixel.
    Fresh,
    /// One new one a pixel, directed by those of the last frame (paper 3).
    Tracked,
}

impl Method {
    /// All of them.
    pub const ALL: &[Self] =
        &[Self::Stable, Self::Supersample, Self::Taa, Self::StableTi, Self::PointTracking, Self::Reference];

    /// As the command line and the settings file spell it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Stable => "stable",
            Self::Supersample => "supersample",
            Self::Taa => "taa",
            Self::StableTi => "stable+ti",
            Self::Reference => "reference",
            Self::PointTracking => "point-tracking",
        }
    }

    /// Where its samples come from.
    pub const fn sampling(self) -> Sampling {
        match self {
            Self::Stable | Self::StableTi => Sampling::Reprojected,
            Self::Supersample | Self::Taa | Self::Reference => Sampling::Fresh,
            Self::PointTracking => Sampling::Tracked,
        }
    }

    /// What it makes of the frames before.
    pub const fn temporal(self) -> Temporal {
        match self {
            Self::Taa | Self::StableTi => Temporal::Integrate,
            Self::Stable | Self::Supersample | Self::PointTracking => Temporal::Box,
            Self::Reference => Temporal::None,
        }
    }

    /// Whether samples live on from frame to frame.
    pub const fn keeps_samples(self) -> bool {
        matches!(self.sampling(), Sampling::Reprojected)
    }

    /// Whether what the last frame saw is projected into this one, which takes two caches that swap roles.
    pub const fn reprojects(self) -> bool {
        matches!(self.sampling(), Sampling::Reprojected | Sampling::Tracked)
    }

    /// Whether all frames since the last reset are averaged.
    pub const fn accumulates(self) -> bool {
        matches!(self, Self::Reference)
    }
}

/// Images besides colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Aov {
    /// Distance from the camera in metres of the pixel's nearest sample; infinity for the sky. R32_SFLOAT.
    Depth,
    /// Pixels moved since the last frame (x right, y down), by the sample that moved most. R32G32_SFLOAT.
    Motion,
    /// Red: samples evicted, green: added, blue: kept (paper 1, figure 4); alpha 1. R32G32B32A32_SFLOAT.
    Density,
    /// Frames that the pixel's oldest sample has lived. R32_SFLOAT.
    Age,
    /// Samples that are not as they were in the last frame. Red: new; green: evicted by the analysis; blue: hidden now and
    /// not before or the reverse, lost, or replaced; alpha: seen in both frames, but another set of lights reaches them.
    /// Samples of methods other than `stable` have no identity from frame to frame: all are new. R32G32B32A32_SFLOAT.
    Changes,
}

impl Aov {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Depth, Self::Motion, Self::Density, Self::Age, Self::Changes];

    /// As the command line spells it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Motion => "motion",
            Self::Density => "density",
            Self::Age => "age",
            Self::Changes => "changes",
        }
    }

    /// Floats a pixel.
    pub fn channels(self) -> usize {
        match self {
            Self::Depth | Self::Age => 1,
            Self::Motion => 2,
            Self::Density | Self::Changes => 4,
        }
    }

    pub(crate) fn format(self) -> vk::Format {
        match self.channels() {
            1 => vk::Format::R32_SFLOAT,
            2 => vk::Format::R32G32_SFLOAT,
            _ => vk::Format::R32G32B32A32_SFLOAT,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_have_one_name_everywhere() {
        for method in Method::ALL {
            assert_eq!(serde_json::to_value(method).unwrap(), method.name());
        }
    }

    #[test]
    fn one_frame_is_not_averaged_and_what_is_integrated_is_not_either() {
        let temporal = |method, box_frames| Settings { box_frames, ..Settings::of(method) }.temporal();
        assert_eq!((temporal(Method::Stable, 1), temporal(Method::Stable, 2)), (Temporal::None, Temporal::Box));
        assert_eq!((temporal(Method::Taa, 1), temporal(Method::Taa, 3)), (Temporal::Integrate, Temporal::Integrate));
        assert_eq!(temporal(Method::Reference, 3), Temporal::None);
    }
}
