//! The table of knobs: what each is, its range, what it trades, whom it concerns, and what a search tries of it.

use super::knob::{
    Domain, Knob,
    Value::{self, Choice, Count, Number, Switch},
};
use super::{
    Edges, Fill, Filter, Grouping, HistoryFilter, Hold, Method, Modelling, Precision, Sampling, Temporal, Weights,
};
use crate::sampler::{Strategy, Tiling};
use crate::scene::requirements::Traits;

fn any(_: Method) -> bool {
    true
}

fn everywhere(_: &Traits, _: Value) -> bool {
    true
}

/// What is read by a filter has textures.
fn textured(scene: &Traits, value: Value) -> bool {
    scene.textures || value == Choice(Filter::ALL[0].1)
}

/// As many shadow rays as there are lights, and more, are the same; and so are none where there is no light.
fn unlike_all_lights(scene: &Traits, value: Value) -> bool {
    matches!(value, Count(rays) if rays >= MOST_LIGHTS || rays < scene.lights)
}

/// What is sampled besides the picture.
fn sampled(scene: &Traits, value: Value) -> bool {
    let defaults = [Strategy::Sobol.name(), Tiling::Sudoku.name(), Hold::ALL[0].1];
    scene.distributed || matches!(value, Choice(name) if defaults.contains(&name))
}

/// A march needs something to go through.
fn misty(scene: &Traits, value: Value) -> bool {
    scene.medium || value == Count(32)
}

fn analysed(method: Method) -> bool {
    method.keeps_samples()
}

fn fresh(method: Method) -> bool {
    method.sampling() == Sampling::Fresh
}

fn integrated(method: Method) -> bool {
    method.temporal() == Temporal::Integrate
}

fn averaged(method: Method) -> bool {
    method.temporal() == Temporal::Box
}

/// Lights of a scene at most.
const MOST_LIGHTS: u32 = 32;

/// All knobs, in the order of the settings file.
pub static KNOBS: &[Knob] = &[
    Knob {
        name: "method",
        about: "what is rendered with",
        unit: "",
        trades: "stable: steadier frames for the time of reprojection; supersample: nothing is kept from frame to frame; \
                 taa, stable+ti: the same, integrated over time, which is steadier and blurs; point-tracking: one sample a \
                 pixel, less flicker than one of supersample at little cost; reference: converges, for any time",
        domain: Domain::Choice {
            names: || Method::ALL.iter().map(|m| m.name()).collect(),
            get: |s| Method::ALL.iter().position(|m| *m == s.method).unwrap_or_default(),
            set: |s, i| s.switch(Method::ALL.get(i).copied().unwrap_or(s.method)),
        },
        applies: any,
        rays: true,
        distinct: everywhere,
        ladder: &[
            Choice("stable"),
            Choice("stable+ti"),
            Choice("taa"),
            Choice("supersample"),
            Choice("point-tracking"),
        ],
    },
    Knob {
        name: "density",
        about: "samples a pixel to aim at",
        unit: "samples/pixel",
        trades: "more: less error, aliasing and flicker, for time and memory in proportion",
        domain: Domain::Number { min: 0.0625, max: 16.0, at: |s| &mut s.density },
        applies: analysed,
        rays: true,
        distinct: everywhere,
        ladder: &[Number(0.25), Number(0.5), Number(1.0), Number(1.5), Number(2.0), Number(3.0), Number(4.0)],
    },
    Knob {
        name: "tolerance",
        about: "deviation from the density that is tolerated before samples are added or evicted",
        unit: "samples/pixel",
        trades: "more: samples live longer, which flickers less and is cheaper; less: samples are spread more evenly, with \
                 less bias at edges",
        domain: Domain::Number { min: 0.0625, max: 16.0, at: |s| &mut s.tolerance },
        applies: analysed,
        rays: true,
        distinct: everywhere,
        ladder: &[Number(0.25), Number(0.5), Number(1.0), Number(2.0)],
    },
    Knob {
        name: "spp",
        about: "stratified samples a pixel and frame",
        unit: "samples/pixel",
        trades: "more: less error, aliasing and flicker, for time and memory in proportion",
        domain: Domain::Count { min: 1, max: 16, at: |s| &mut s.spp },
        applies: fresh,
        rays: true,
        distinct: everywhere,
        ladder: &[Count(1), Count(2), Count(3), Count(4), Count(6), Count(8)],
    },
    Knob {
        name: "jitter",
        about: "new sample positions in each frame, instead of the same ones",
        unit: "",
        trades: "on: aliasing turns into noise that flickers",
        domain: Domain::Switch { at: |s| &mut s.jitter },
        applies: |method| method == Method::Supersample,
        rays: false,
        distinct: everywhere,
        ladder: &[Switch(false), Switch(true)],
    },
    Knob {
        name: "history.alpha",
        about: "weight of the new frame in temporal integration",
        unit: "1",
        trades: "less: steadier, but blurred, and slower to follow what changes; 1: no integration",
        domain: Domain::Number { min: 0.01, max: 1.0, at: |s| &mut s.history.alpha },
        applies: integrated,
        rays: false,
        distinct: everywhere,
        ladder: &[Number(0.05), Number(0.1), Number(0.15), Number(0.25), Number(0.4)],
    },
    Knob {
        name: "history.clamp",
        about: "how far the history may be from the mean of the 3 x 3 pixels around; 16 does not clamp",
        unit: "standard deviations",
        trades: "more: steadier and sharper, with ghosts of what was there before",
        domain: Domain::Number { min: 0.0, max: 16.0, at: |s| &mut s.history.clamp },
        applies: integrated,
        rays: false,
        distinct: everywhere,
        ladder: &[Number(0.75), Number(1.0), Number(1.5), Number(2.0), Number(16.0)],
    },
    Knob {
        name: "history.filter",
        about: "how the history is read between its pixels",
        unit: "",
        trades: "catmull-rom: less blur for 16 reads a pixel instead of 4",
        domain: Domain::Choice {
            names: || HistoryFilter::ALL.map(HistoryFilter::name).to_vec(),
            get: |s| HistoryFilter::ALL.iter().position(|f| *f == s.history.filter).unwrap_or_default(),
            set: |s, i| s.history.filter = HistoryFilter::ALL.get(i).copied().unwrap_or(s.history.filter),
        },
        applies: integrated,
        rays: false,
        distinct: everywhere,
        ladder: &[Choice("bilinear"), Choice("catmull-rom")],
    },
    Knob {
        name: "history.precision",
        about: "what the history is stored in: 16-bit or 32-bit floats",
        unit: "",
        trades: "float: a still picture comes nearer to the mean of its frames than 2^-11 / alpha of itself, for 16 bytes a pixel more",
        domain: Domain::Choice {
            names: || Precision::ALL.map(Precision::name).to_vec(),
            get: |s| Precision::ALL.iter().position(|p| *p == s.history.precision).unwrap_or_default(),
            set: |s, i| s.history.precision = Precision::ALL.get(i).copied().unwrap_or(s.history.precision),
        },
        applies: integrated,
        rays: false,
        distinct: everywhere,
        ladder: &[Choice("half"), Choice("float")],
    },
    Knob {
        name: "box_frames",
        about: "frames that are averaged, this one included, each pixel for itself",
        unit: "frames",
        trades: "more: steadier, but what moves is blurred along its motion",
        domain: Domain::Count { min: 1, max: 3, at: |s| &mut s.box_frames },
        applies: averaged,
        rays: false,
        distinct: everywhere,
        ladder: &[Count(1), Count(2), Count(3)],
    },
    Knob {
        name: "subpixels",
        about: "subpixels of a pixel across and down, each with one sample at most (M in paper 1)",
        unit: "subpixels",
        trades: "4: up to 16 samples a pixel are told apart; 2: up to 4 are, for a quarter of the memory of claims",
        domain: Domain::OneOf { of: &[2, 4], at: |s| &mut s.subpixels },
        applies: analysed,
        rays: true,
        distinct: everywhere,
        ladder: &[Count(2), Count(4)],
    },
    Knob {
        name: "edges",
        about: "what decides about samples where surfaces move against each other",
        unit: "",
        trades: "balanced: from density 1 on each pixel fills its own strata there, so that edges in front do not weigh too \
                 much; paper: the density of the window (Equation 1), with more reuse and less flicker",
        domain: Domain::Choice {
            names: || Edges::ALL.map(|e| e.1).to_vec(),
            get: |s| Edges::ALL.iter().position(|e| e.0 == s.edges).unwrap_or_default(),
            set: |s, i| s.edges = Edges::ALL.get(i).map_or(s.edges, |e| e.0),
        },
        applies: analysed,
        rays: true,
        distinct: everywhere,
        ladder: &[Choice("balanced"), Choice("paper")],
    },
    Knob {
        name: "texture.filter",
        about: "how textures are read",
        unit: "",
        trades: "linear: a blend of four texels; nearest: one texel, cheaper, with more aliasing",
        domain: Domain::Choice {
            names: || Filter::ALL.map(|f| f.1).to_vec(),
            get: |s| Filter::ALL.iter().position(|f| f.0 == s.texture_filter).unwrap_or_default(),
            set: |s, i| s.texture_filter = Filter::ALL.get(i).map_or(s.texture_filter, |f| f.0),
        },
        applies: any,
        rays: false,
        distinct: textured,
        ladder: &[Choice("linear"), Choice("nearest")],
    },
    Knob {
        name: "shadow.rays",
        about: "lights at most that are chosen for a sample and get a shadow ray; a map of light from all around gets one more",
        unit: "rays/sample",
        trades: "fewer than there are lights: less time for noise, which sticks to the samples that live on; 0: no shadows at \
                 all",
        domain: Domain::Count { min: 0, max: MOST_LIGHTS, at: |s| &mut s.shadow_rays },
        applies: any,
        rays: true,
        distinct: unlike_all_lights,
        ladder: &[Count(0), Count(1), Count(2), Count(4), Count(MOST_LIGHTS)],
    },
    Knob {
        name: "filter.width",
        about: "standard deviation of the reconstruction filter, a Gaussian over 3 x 3 pixels",
        unit: "pixels",
        trades: "more: less noise, aliasing and flicker, for blur",
        domain: Domain::Number { min: 0.25, max: 1.0, at: |s| &mut s.filter_width },
        applies: any,
        rays: false,
        distinct: everywhere,
        ladder: &[Number(0.35), Number(0.5), Number(0.7)],
    },
    Knob {
        name: "filter.weights",
        about: "what a sample counts for in reconstruction: the same as every other, or the area nearest to it",
        unit: "",
        trades: "voronoi: less noise and flicker at few samples a pixel, for time and some blur",
        domain: Domain::Choice {
            names: || Weights::ALL.iter().map(|w| w.name()).collect(),
            get: |s| Weights::ALL.iter().position(|w| *w == s.filter_weights).unwrap_or_default(),
            set: |s, i| s.filter_weights = Weights::ALL.get(i).copied().unwrap_or(s.filter_weights),
        },
        applies: |method| !method.accumulates(),
        rays: false,
        distinct: everywhere,
        ladder: &[Choice("equal"), Choice("voronoi")],
    },
    Knob {
        name: "filter.fill",
        about: "whether samples that a movement has covered are replaced in the same frame, beside edges",
        unit: "",
        trades: "edge: thin things keep their width in motion, for a second, small round of rays",
        domain: Domain::Choice {
            names: || Fill::ALL.iter().map(|f| f.name()).collect(),
            get: |s| Fill::ALL.iter().position(|f| *f == s.filter_fill).unwrap_or_default(),
            set: |s, i| s.filter_fill = Fill::ALL.get(i).copied().unwrap_or(s.filter_fill),
        },
        applies: analysed,
        rays: true,
        distinct: everywhere,
        ladder: &[Choice("none"), Choice("edge")],
    },
    Knob {
        name: "sampler.strategy",
        about: "where samples lie on lenses and lights (paper 2, section 4)",
        unit: "",
        trades: "sobol: least error beyond two dimensions; hammersley, sudoku, sudoku-latin, sudoku-independent, jittered and \
                 hammersley-uncooperative: paper 2's, cheaper to look up; random: independent, to compare with",
        domain: Domain::Choice {
            names: || Strategy::ALL.map(Strategy::name).to_vec(),
            get: |s| Strategy::ALL.iter().position(|t| *t == s.sampler).unwrap_or_default(),
            set: |s, i| s.sampler = Strategy::ALL.get(i).copied().unwrap_or(s.sampler),
        },
        applies: any,
        rays: false,
        distinct: sampled,
        ladder: &[Choice("sobol"), Choice("hammersley"), Choice("sudoku-latin")],
    },
    Knob {
        name: "sampler.tiling",
        about: "which pixel has which of the sixteen patterns of the sampler, if it has patterns",
        unit: "",
        trades: "sudoku16: no pattern that repeats every 4 pixels; 4x4: neighbours share out one even pattern",
        domain: Domain::Choice {
            names: || Tiling::ALL.map(Tiling::name).to_vec(),
            get: |s| Tiling::ALL.iter().position(|t| *t == s.tiling).unwrap_or_default(),
            set: |s, i| s.tiling = Tiling::ALL.get(i).copied().unwrap_or(s.tiling),
        },
        applies: any,
        rays: false,
        distinct: sampled,
        ladder: &[Choice("sudoku16"), Choice("4x4")],
    },
    Knob {
        name: "sampler.hold",
        about: "what a sample's places on lenses and lights belong to",
        unit: "",
        trades: "sample: they are drawn once and travel with it, so that noise stays on surfaces; frame: they are drawn anew in \
                 each frame, which averages out over time and flickers",
        domain: Domain::Choice {
            names: || Hold::ALL.map(|h| h.1).to_vec(),
            get: |s| Hold::ALL.iter().position(|h| h.0 == s.hold).unwrap_or_default(),
            set: |s, i| s.hold = Hold::ALL.get(i).map_or(s.hold, |h| h.0),
        },
        applies: any,
        rays: false,
        distinct: sampled,
        ladder: &[Choice("sample"), Choice("frame")],
    },
    Knob {
        name: "emitters",
        about: "points of triangles that shine which are drawn a sample, of which one gets a shadow ray; 0: they are only seen, and \
                light up nothing",
        unit: "points",
        trades: "above 0: light from lamps that are meshes, for a ray a sample; more: less noise, for a look at each point",
        domain: Domain::Count { min: 0, max: 32, at: |s| &mut s.emitters },
        applies: any,
        rays: true,
        // What gives light is for the user to say: a search would leave it out.
        distinct: |_, value| value == Count(0),
        ladder: &[Count(0), Count(1), Count(8)],
    },
    Knob {
        name: "gloss",
        about: "roughness up to which surfaces send reflection rays; 0: only those do that transmit or have Phong's lobe",
        unit: "perceptual roughness",
        trades: "more: reflections of what is around instead of uniform light alone, for a ray a sample and step, and noise",
        domain: Domain::Number { min: 0.0, max: 1.0, at: |s| &mut s.gloss },
        applies: any,
        rays: true,
        // What is reflected is for the user to say: a search would leave it out.
        distinct: |_, value| value == Number(0.0),
        ladder: &[Number(0.0), Number(0.25), Number(1.0)],
    },
    Knob {
        name: "path.depth",
        about: "secondary rays of a path at most; where it ends, light from all around is looked up (paper 2, section 3.5)",
        unit: "rays",
        trades: "more: more of what is seen through glass and in mirrors that see each other, for time",
        domain: Domain::Count { min: 0, max: 8, at: |s| &mut s.path_depth },
        applies: any,
        rays: true,
        distinct: |scene, value| scene.transmits || value == Count(3),
        ladder: &[Count(1), Count(2), Count(3), Count(4), Count(6)],
    },
    Knob {
        name: "path.reflected",
        about: "part of the paths that are reflected where light passes through too (P of paper 2, section 3.5); 0: as large a part as of \
                the light is, from 0.05 to 0.95",
        unit: "1",
        trades: "more: less noise of reflections on glass, and more of what is seen through it; 0: least noise where light comes alike from both \
                 sides",
        domain: Domain::Number { min: 0.0, max: 0.95, at: |s| &mut s.path_part },
        applies: any,
        rays: false,
        distinct: |scene, value| scene.transmits || value == Number(0.25),
        ladder: &[Number(0.0), Number(0.1), Number(0.25), Number(0.5)],
    },
    Knob {
        name: "indirect.depth",
        about: "rays of the diffuse path that each sample sends in each frame; 0: no light from other surfaces (paper 1, section 6.1)",
        unit: "rays",
        trades: "more: light that has come by more surfaces, for a ray with its shadow rays each; noise fades while samples live on",
        domain: Domain::Count { min: 0, max: 4, at: |s| &mut s.indirect.depth },
        applies: any,
        rays: true,
        // Another picture, as with `gloss`.
        distinct: |_, value| value == Count(0),
        ladder: &[Count(0), Count(1), Count(2), Count(3)],
    },
    Knob {
        name: "indirect.alpha",
        about: "least weight of the newest path in what a sample has gathered, while anything but the camera moves",
        unit: "1",
        trades: "less: less noise, and slower to follow light that changes",
        domain: Domain::Number { min: 0.01, max: 1.0, at: |s| &mut s.indirect.alpha },
        applies: analysed,
        rays: false,
        distinct: |_, value| value == Number(f64::from(0.1_f32)) || value == Number(0.1),
        ladder: &[Number(0.05), Number(0.1), Number(0.25)],
    },
    Knob {
        name: "indirect.clamp",
        about: "radiance at most that a diffuse path brings; 0: no limit",
        unit: "radiance",
        trades: "less: fewer bright specks, and less light where they come from",
        domain: Domain::Number { min: 0.0, max: 1e6, at: |s| &mut s.indirect.clamp },
        applies: any,
        rays: false,
        distinct: |_, value| value == Number(0.0),
        ladder: &[Number(0.0), Number(1.0), Number(10.0)],
    },
    Knob {
        name: "path.grouping",
        about: "which secondary rays are traced together: those of a kind, those of neighbouring samples, or those of whichever \
                samples have one",
        unit: "",
        trades: "kind, mixed: dense lists; none: no list, and threads that wait; the pictures are the same",
        domain: Domain::Choice {
            names: || Grouping::ALL.map(|g| g.1).to_vec(),
            get: |s| Grouping::ALL.iter().position(|g| g.0 == s.path_grouping).unwrap_or_default(),
            set: |s, i| s.path_grouping = Grouping::ALL.get(i).map_or(s.path_grouping, |g| g.0),
        },
        applies: any,
        rays: false,
        distinct: |scene, value| scene.transmits || value == Choice(Grouping::ALL[0].1),
        ladder: &[Choice("kind"), Choice("mixed"), Choice("none")],
    },
    Knob {
        name: "medium.steps",
        about: "steps of each pixel's march through fog or mist",
        unit: "steps/pixel",
        trades: "more: shafts and the shapes of mist are finer and less noisy, for a shadow ray a step",
        domain: Domain::Count { min: 1, max: 256, at: |s| &mut s.medium_steps },
        applies: any,
        rays: true,
        distinct: misty,
        ladder: &[Count(8), Count(16), Count(32), Count(64)],
    },
    Knob {
        name: "model",
        about: "what is modelled: what the scene requires, or everything that a scene may require",
        unit: "",
        trades: "required: what a scene does not use costs nothing; all: the same picture, to compare with",
        domain: Domain::Choice {
            names: || Modelling::ALL.map(|m| m.1).to_vec(),
            get: |s| Modelling::ALL.iter().position(|m| m.0 == s.modelling).unwrap_or_default(),
            set: |s, i| s.modelling = Modelling::ALL.get(i).map_or(s.modelling, |m| m.0),
        },
        applies: any,
        rays: false,
        distinct: |_, value| value == Choice(Modelling::ALL[0].1),
        ladder: &[Choice("required"), Choice("all")],
    },
    Knob {
        name: "float_output",
        about: "32-bit floats in the colour image, instead of 16-bit ones",
        unit: "",
        trades: "on: no rounding to 11 bits and a range beyond 65504, for 8 bytes a pixel",
        domain: Domain::Switch { at: |s| &mut s.float_output },
        applies: any,
        rays: false,
        distinct: everywhere,
        ladder: &[Switch(false), Switch(true)],
    },
];
