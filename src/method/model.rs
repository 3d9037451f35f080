//! What a frame models: no more than its scene and its settings need.
//!
//! From it follow the variants of the shaders that run (`// models:` in `glsl/*.comp`), what samples carry besides their 16
//! bytes, and which buffers there are. What is left out costs nothing, and the pictures are the same to the bit: with
//! `model = all`, everything that a scene may need is modelled whether it does or not, to compare with.

use crate::scene::requirements::{Feature, Requirements};
use crate::settings::{Aov, Modelling, Settings};
use crate::shaders;

/// Something that is modelled or left out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// Its bit, one of the `MODEL_` constants of [`crate::shaders`].
    pub bit: u32,
    /// What it is.
    pub name: &'static str,
    /// What it costs where it is modelled.
    pub price: &'static str,
    /// What needs it; none if it is left out.
    pub cause: Option<String>,
}

/// What is modelled.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Model {
    /// Everything that could be, with its causes.
    pub parts: Vec<Part>,
}

impl Model {
    /// What a scene and settings need.
    pub fn of(scene: &Requirements, settings: &Settings) -> Self {
        let feature = |feature: Feature| scene.cause(feature).map(str::to_owned);
        let all = || (settings.modelling == Modelling::All).then(|| "model = all".to_owned());
        let keeps = settings.method.keeps_samples();
        let aov = |aov: Aov| (keeps && settings.aovs.contains(&aov)).then(|| format!("the AOV '{}'", aov.name()));
        let transmission = feature(Feature::Transmission);
        let holes = feature(Feature::AlphaMask).or_else(|| feature(Feature::AlphaBlend));
        let alpha = holes.or_else(|| transmission.clone()).or_else(all);
        let gloss = || (settings.gloss > 0.0).then(|| format!("gloss = {}", settings.gloss));
        let indirect = (settings.indirect.depth > 0).then(|| format!("indirect.depth = {}", settings.indirect.depth));
        let source = aov(Aov::Changes).or_else(|| indirect.clone().filter(|_| keeps));
        let path = transmission.or_else(|| feature(Feature::PhongLobe)).or_else(gloss).or_else(all);
        let lens = feature(Feature::Lens).or_else(all);
        let area = feature(Feature::AreaLights).or_else(all);
        let environment = feature(Feature::EnvironmentMap).or_else(all);
        let emitter = feature(Feature::EmissiveSurfaces).filter(|_| settings.emitters > 0).or_else(all);
        let deform = feature(Feature::SkinnedMeshes).or_else(|| feature(Feature::MorphedMeshes)).or_else(all);
        let medium = feature(Feature::Medium).or_else(all);
        let counts = settings.count.then(|| "rays are counted".to_owned());
        let motion = feature(Feature::MotionBlur).or_else(all);
        let seed = lens.clone().or_else(|| area.clone()).or_else(|| environment.clone());
        let part = |bit, name, price, cause| Part { bit, name, price, cause };
        let mut parts = vec![
            part(shaders::MODEL_ALPHA, "holes in surfaces", "a look at the material at every hit", alpha),
            part(shaders::MODEL_LENS, "an aperture", "a lens point a sample, in every phase that projects it", lens),
            part(shaders::MODEL_AREA, "lights with an extent", "a point on the light a sample", area),
            part(
                shaders::MODEL_ENVIRONMENT,
                "a map of light from all around",
                "a direction and a shadow ray a sample",
                environment,
            ),
            part(shaders::MODEL_EMITTER, "what shines as lights", "a point on it and a shadow ray a sample", emitter),
            part(
                shaders::MODEL_DEFORM,
                "meshes that deform",
                "their upload in each frame, twice their corners",
                deform,
            ),
            part(
                shaders::MODEL_MOTION,
                "an open shutter",
                "a time a sample, an inverse where rays enter what moves",
                motion,
            ),
            part(
                shaders::MODEL_PATH,
                "paths behind what is seen",
                "56 bytes a sample, and a ray with its shadow rays a step",
                path,
            ),
            part(shaders::MODEL_INDIRECT, "indirect light", "68 bytes a sample, and a diffuse path each", indirect),
            part(shaders::MODEL_MEDIUM, "fog and mist", "a march a pixel, with a shadow ray a step", medium),
            part(shaders::MODEL_SEED, "seeds of samples", "4 bytes a cached sample", seed),
            part(shaders::MODEL_AGE, "ages of samples", "4 bytes a cached sample", aov(Aov::Age)),
            part(shaders::MODEL_SOURCE, "what samples were", "4 bytes a cached sample, 8 more with the AOV", source),
            part(shaders::MODEL_COUNT, "what rays cost", "sums of every workgroup that traces", counts),
        ];
        bring(&mut parts);
        Self { parts }
    }

    /// The bits of all parts that are modelled.
    pub fn bits(&self) -> u32 {
        self.parts.iter().filter(|p| p.cause.is_some()).fold(0, |bits, part| bits | part.bit)
    }

    /// Whether a part is modelled.
    pub fn has(&self, bit: u32) -> bool {
        self.bits() & bit != 0
    }
}

/// Gives what comes with another part that part as its cause.
fn bring(parts: &mut [Part]) {
    let causes: Vec<(u32, &str)> = parts.iter().filter(|p| p.cause.is_some()).map(|p| (p.bit, p.name)).collect();
    for part in parts.iter_mut().filter(|p| p.cause.is_none()) {
        let bringer = causes.iter().find(|(bit, _)| shaders::with_brought(*bit) & part.bit != 0);
        part.cause = bringer.map(|(_, name)| format!("it comes with {name}"));
    }
}
