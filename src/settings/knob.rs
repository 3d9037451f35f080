//! The knobs: every setting that trades something, one entry each in one table.
//!
//! A knob registers itself by being in [`KNOBS`]. Nothing else has to know of it: the range check, the settings file, the
//! command line, the reports and the search for good trades go through the table.

use super::{
    Edges, Fill, Filter, HistoryFilter, Hold, Method, Modelling, Precision, Sampling, Settings, Temporal, Weights,
};
use crate::sampler::{Strategy, Tiling};
use crate::scene::requirements::Traits;
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::fmt;

/// A setting that trades something.
#[derive(Debug)]
pub struct Knob {
    /// As the settings file and `--set` spell it.
    pub name: &'static str,
    /// What it is, in a line.
    pub about: &'static str,
    /// Unit of its values; empty for names and switches.
    pub unit: &'static str,
    /// What turning it trades: what a larger value (or each name) gives and costs.
    pub trades: &'static str,
    /// Which values are allowed, and where the settings keep it.
    pub domain: Domain,
    /// Whether it means something to a method.
    pub applies: fn(Method) -> bool,
    /// Whether it changes how many rays are traced: what it costs can then be counted.
    pub rays: bool,
    /// Whether a value of the ladder means something else in such a scene than the default, and so is worth trying.
    pub distinct: fn(&Traits, Value) -> bool,
    /// Values worth trying in a search, in order.
    pub ladder: &'static [Value],
}

/// Range of a knob, with access to its place in the settings.
#[derive(Debug)]
pub enum Domain {
    /// A number from `min` to `max`.
    Number {
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
        /// Its place.
        at: fn(&mut Settings) -> &mut f32,
    },
    /// A whole number from `min` to `max`.
    Count {
        /// Smallest value.
        min: u32,
        /// Largest value.
        max: u32,
        /// Its place.
        at: fn(&mut Settings) -> &mut u32,
    },
    /// One of these whole numbers.
    OneOf {
        /// The numbers, in order.
        of: &'static [u32],
        /// Its place.
        at: fn(&mut Settings) -> &mut u32,
    },
    /// One of these names.
    Choice {
        /// The names.
        names: fn() -> Vec<&'static str>,
        /// Which of the names is set.
        get: fn(&Settings) -> usize,
        /// Sets the name at a position that is in the list.
        set: fn(&mut Settings, usize),
    },
    /// On or off.
    Switch {
        /// Its place.
        at: fn(&mut Settings) -> &mut bool,
    },
}

/// A value of a knob.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[serde(untagged)]
pub enum Value {
    /// Of [`Domain::Number`].
    Number(f64),
    /// Of [`Domain::Count`] and [`Domain::OneOf`].
    Count(u32),
    /// Of [`Domain::Choice`].
    Choice(&'static str),
    /// Of [`Domain::Switch`].
    Switch(bool),
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(n) => n.fmt(f),
            Self::Count(n) => n.fmt(f),
            Self::Choice(name) => f.pad(name),
            Self::Switch(on) => on.fmt(f),
        }
    }
}

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

use Value::{Choice, Count, Number, Switch};

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

/// The knobs that mean something to the method of some settings, with their values.
pub fn used(settings: &Settings) -> BTreeMap<&'static str, Value> {
    let knobs = KNOBS.iter().filter(|knob| (knob.applies)(settings.method));
    knobs.map(|knob| (knob.name, knob.get(settings))).collect()
}

impl Knob {
    /// The knob of this name.
    ///
    /// # Errors
    /// [`Error::UnknownKnob`] with the nearest name.
    pub fn find(name: &str) -> Result<&'static Self> {
        let known = KNOBS.iter().find(|knob| knob.name == name);
        known.ok_or_else(|| {
            let likeness = |knob: &&Self| strsim::normalized_damerau_levenshtein(knob.name, name);
            let nearest = KNOBS.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
            Error::UnknownKnob { name: name.to_owned(), nearest: nearest.map_or("", |knob| knob.name) }
        })
    }

    /// Its value in some settings.
    pub fn get(&self, settings: &Settings) -> Value {
        match self.domain {
            Domain::Number { at, .. } => Value::Number(decimal(*at(&mut settings.clone()))),
            Domain::Count { at, .. } | Domain::OneOf { at, .. } => Value::Count(*at(&mut settings.clone())),
            Domain::Choice { names, get, .. } => Value::Choice(names().get(get(settings)).copied().unwrap_or_default()),
            Domain::Switch { at } => Value::Switch(*at(&mut settings.clone())),
        }
    }

    /// Sets it.
    ///
    /// # Errors
    /// [`Error::Setting`] with the range, if the value is not in it.
    pub fn set(&self, settings: &mut Settings, value: Value) -> Result<()> {
        self.check(&value)?;
        match (&self.domain, value) {
            (Domain::Number { at, .. }, Value::Number(n)) => *at(settings) = n as f32,
            (Domain::Count { at, .. } | Domain::OneOf { at, .. }, Value::Count(n)) => *at(settings) = n,
            (Domain::Choice { names, set, .. }, Value::Choice(name)) => {
                if let Some(index) = names().iter().position(|n| *n == name) {
                    set(settings, index);
                }
            }
            (Domain::Switch { at }, Value::Switch(on)) => *at(settings) = on,
            _ => return Err(self.refusal(&value.to_string())),
        }
        Ok(())
    }

    /// Its value by default, with a method.
    pub fn default_of(&self, method: Method) -> Value {
        self.get(&Settings::of(method))
    }

    /// Goes along from some defaults to others, if it is at the first and they differ.
    pub(super) fn follow(&self, settings: &mut Settings, from: &Settings, to: &Settings) {
        let is = |a: &Settings, b: &Settings| self.get(a) == self.get(b);
        // The method itself has been changed by now, so that it is not what it was.
        if is(from, to) || !is(settings, from) {
            return;
        }
        match (&self.domain, self.get(to)) {
            (Domain::Number { at, .. }, Value::Number(n)) => *at(settings) = n as f32,
            (Domain::Count { at, .. } | Domain::OneOf { at, .. }, Value::Count(n)) => *at(settings) = n,
            (Domain::Choice { get, set, .. }, _) => set(settings, get(to)),
            (Domain::Switch { at }, Value::Switch(on)) => *at(settings) = on,
            _ => {}
        }
    }

    /// A value from its words.
    ///
    /// # Errors
    /// [`Error::Setting`] with the range, if the words mean no value that is allowed.
    pub fn read(&self, words: &str) -> Result<Value> {
        let value = match self.domain {
            Domain::Number { .. } => words.parse().ok().map(Value::Number),
            Domain::Count { .. } | Domain::OneOf { .. } => words.parse().ok().map(Value::Count),
            Domain::Choice { names, .. } => names().into_iter().find(|n| *n == words).map(Value::Choice),
            Domain::Switch { .. } => words.parse().ok().map(Value::Switch),
        };
        value.filter(|v| self.contains(v)).ok_or_else(|| self.refusal(words))
    }

    /// Whether a value is allowed.
    ///
    /// # Errors
    /// [`Error::Setting`] with the range, if it is not.
    pub fn check(&self, value: &Value) -> Result<()> {
        if self.contains(value) { Ok(()) } else { Err(self.refusal(&value.to_string())) }
    }

    fn contains(&self, value: &Value) -> bool {
        match (&self.domain, value) {
            (Domain::Number { min, max, .. }, Value::Number(n)) => (*min..=*max).contains(n),
            (Domain::Count { min, max, .. }, Value::Count(n)) => (*min..=*max).contains(n),
            (Domain::OneOf { of, .. }, Value::Count(n)) => of.contains(n),
            (Domain::Choice { names, .. }, Value::Choice(name)) => names().contains(name),
            (Domain::Switch { .. }, Value::Switch(_)) => true,
            _ => false,
        }
    }

    fn refusal(&self, value: &str) -> Error {
        Error::Setting { name: self.name, value: value.to_owned(), expected: self.range() }
    }

    /// Its range in words.
    pub fn range(&self) -> String {
        match self.domain {
            Domain::Number { min, max, .. } => format!("from {min} to {max}"),
            Domain::Count { min, max, .. } => format!("a whole number from {min} to {max}"),
            Domain::OneOf { of, .. } => of.iter().map(u32::to_string).collect::<Vec<_>>().join(" or "),
            Domain::Choice { names, .. } => format!("one of {}", names().join(", ")),
            Domain::Switch { .. } => "true or false".to_owned(),
        }
    }
}

/// The shortest decimal number that is this `f32`: 0.1 is 0.1, not 0.10000000149.
fn decimal(x: f32) -> f64 {
    x.to_string().parse().unwrap_or_else(|_| f64::from(x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_everything_is_told() {
        for (i, knob) in KNOBS.iter().enumerate() {
            assert!(KNOBS[..i].iter().all(|other| other.name != knob.name), "{} is there twice", knob.name);
            let told = [knob.about, knob.trades];
            assert!(told.iter().all(|t| !t.is_empty() && !t.ends_with('.')), "{}", knob.name);
            let numeric = !matches!(knob.domain, Domain::Choice { .. } | Domain::Switch { .. });
            assert_eq!(numeric, !knob.unit.is_empty(), "{}", knob.name);
            assert!(Method::ALL.iter().any(|m| (knob.applies)(*m)), "{} is for no method", knob.name);
        }
    }

    #[test]
    fn defaults_are_in_range_and_ladders_can_be_set_and_read_back() {
        assert!(Settings::default().validate().is_ok());
        for knob in KNOBS {
            for value in knob.ladder {
                let mut settings = Settings::default();
                knob.set(&mut settings, *value).unwrap();
                assert_eq!(knob.get(&settings), *value, "{}", knob.name);
                assert_eq!(knob.read(&value.to_string()).unwrap(), *value, "{}", knob.name);
                // Nothing else has changed.
                let others = KNOBS.iter().filter(|other| other.name != knob.name);
                let usual = |other: &Knob| other.default_of(settings.method);
                others.for_each(|other| assert_eq!(other.get(&settings), usual(other), "{}", other.name));
            }
            assert!(knob.ladder.len() >= 2, "{} cannot be turned", knob.name);
        }
    }

    #[test]
    fn defaults_follow_the_method_and_what_was_set_stays() {
        let mut settings = Settings { density: 3.0, ..Settings::default() };
        settings.switch(Method::Reference);
        assert_eq!((settings.spp, settings.density), (16, 3.0));
        settings.switch(Method::Supersample);
        assert_eq!((settings.spp, settings.density), (1, 3.0));
        settings.spp = 5;
        settings.switch(Method::Reference);
        assert_eq!(settings.spp, 5);
        for method in Method::ALL {
            let mut settings = Settings::default();
            settings.switch(*method);
            assert_eq!(settings, Settings::of(*method));
        }
    }

    #[test]
    fn what_is_out_of_range_is_refused_with_the_range() {
        for knob in KNOBS {
            let beyond = match knob.domain {
                Domain::Number { min, max, .. } => {
                    vec![(min - 0.01).to_string(), (max + 0.01).to_string(), "nan".into()]
                }
                Domain::Count { max, .. } => vec!["-1".to_owned(), (u64::from(max) + 1).to_string(), "1.5".into()],
                Domain::OneOf { of, .. } => vec![(of[0] + 1).to_string(), "0".to_owned(), "2.0".into()],
                Domain::Choice { .. } => vec!["nothing".to_owned(), String::new()],
                Domain::Switch { .. } => vec!["yes".to_owned(), "1".to_owned()],
            };
            for words in beyond {
                let message = knob.read(&words).unwrap_err().to_string();
                assert!(message.contains(knob.name) && message.contains(&knob.range()), "{message}");
            }
        }
        let unset = Settings { density: f32::NAN, ..Settings::default() };
        assert!(unset.validate().unwrap_err().to_string().contains("density"));
        let crowded = |method, subpixels, density| Settings { density, subpixels, ..Settings::of(method) }.validate();
        assert!(crowded(Method::Stable, 2, 4.0).is_ok() && crowded(Method::Stable, 4, 16.0).is_ok());
        let message = crowded(Method::Stable, 2, 4.5).unwrap_err().to_string();
        assert!(message.contains("density") && message.contains("at most 4 with subpixels = 2"), "{message}");
        assert!(crowded(Method::Supersample, 2, 4.5).is_ok(), "which has no density");
    }

    #[test]
    fn the_nearest_name_is_offered() {
        for (wrong, right) in [("densty", "density"), ("Spp", "spp"), ("tolerence", "tolerance"), ("metod", "method")] {
            let message = Knob::find(wrong).unwrap_err().to_string();
            assert!(message.contains(wrong) && message.contains(&format!("'{right}'")), "{message}");
        }
    }
}
