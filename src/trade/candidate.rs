//! What a search tries: settings out of the knobs' ladders.

use super::random::Random;
use crate::scene::fingerprint::hex;
use crate::scene::requirements::Traits;
use crate::settings::knob::{KNOBS, Knob, Value, used};
use crate::settings::{Method, Settings};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};

/// Settings to be tried.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Twelve hexadecimal digits, a hash of the knobs in use: the same settings have the same one everywhere.
    pub id: String,
    /// Why it is tried.
    pub origin: Origin,
    /// The settings.
    pub settings: Settings,
}

/// Why a candidate is tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// The defaults of a method: what everything is compared with. Never given up.
    Default,
    /// One knob off the defaults of a method.
    Single,
    /// Knobs at random.
    Random,
}

/// Which settings are searched.
#[derive(Debug, Clone)]
pub struct Space {
    /// Size, seed, and the knobs that are held.
    pub base: Settings,
    /// Names of the knobs that are held at the base's values.
    pub held: BTreeSet<String>,
    /// What the scene is like: values that make no difference in it are not tried.
    pub scene: Traits,
}

impl Candidate {
    /// From settings.
    pub fn new(settings: Settings, origin: Origin) -> Self {
        Self { id: id(&settings), origin, settings }
    }
}

/// The identity of settings: of the knobs that their method uses, and nothing else.
pub fn id(settings: &Settings) -> String {
    let words: Vec<String> = used(settings).iter().map(|(name, value)| format!("{name}={value}")).collect();
    hex(&Sha256::digest(words.join(" ")))[..12].to_owned()
}

/// The knobs in use that are not at their method's defaults, in words: `stable density=2`.
pub fn label(settings: &Settings) -> String {
    let knobs = KNOBS.iter().filter(|k| k.name != "method" && (k.applies)(settings.method));
    let turned = knobs.filter(|k| k.get(settings) != k.default_of(settings.method));
    let words = turned.map(|k| format!(" {}={}", k.name, k.get(settings)));
    settings.method.name().to_owned() + &words.collect::<String>()
}

impl Space {
    /// Up to `count` different candidates, the same for the same seed: the defaults of every method, every departure from
    /// them by a single knob, then random ones.
    pub fn candidates(&self, count: usize, seed: u32) -> Vec<Candidate> {
        let mut list = List { found: Vec::new(), known: BTreeSet::new(), count };
        for method in self.methods() {
            list.push(self.default_of(method), Origin::Default);
        }
        for single in self.singles() {
            list.push(single, Origin::Single);
        }
        let mut random = Random::new(seed);
        // A small space may hold fewer than are asked for: a hundred misses in a row are taken for its end.
        let mut misses = 0;
        while list.found.len() < count && misses < 100 {
            misses = if list.push(self.draw(&mut random), Origin::Random) { 0 } else { misses + 1 };
        }
        list.found
    }

    fn methods(&self) -> Vec<Method> {
        let all = Method::ALL.iter().copied().filter(|m| !m.accumulates());
        all.filter(|m| !self.held.contains("method") || *m == self.base.method).collect()
    }

    /// A method's defaults with what is held.
    fn default_of(&self, method: Method) -> Settings {
        let mut settings = Settings { size: self.base.size, seed: self.base.seed, ..Settings::of(method) };
        for knob in KNOBS.iter().filter(|k| self.held.contains(k.name) && k.name != "method") {
            // What is held is in range: the base was checked.
            let _ = knob.set(&mut settings, knob.get(&self.base));
        }
        settings
    }

    /// The knobs that can be turned for a method.
    fn free(&self, method: Method) -> impl Iterator<Item = &'static Knob> {
        let free = move |k: &&Knob| k.name != "method" && (k.applies)(method) && !self.held.contains(k.name);
        KNOBS.iter().filter(free)
    }

    /// The values of a knob that make a difference.
    fn values(&self, knob: &'static Knob) -> Vec<Value> {
        knob.ladder.iter().copied().filter(|value| (knob.distinct)(&self.scene, *value)).collect()
    }

    /// In turns over the methods, so that a short list is fair to all of them.
    fn singles(&self) -> Vec<Settings> {
        let of = |method: Method| -> Vec<Settings> {
            let turned = |(knob, value): (&Knob, Value)| with(&self.default_of(method), knob, value);
            self.free(method).flat_map(|k| self.values(k).into_iter().map(move |v| (k, v))).filter_map(turned).collect()
        };
        let lists: Vec<Vec<Settings>> = self.methods().into_iter().map(of).collect();
        let longest = lists.iter().map(Vec::len).max().unwrap_or(0);
        (0..longest).flat_map(|i| lists.iter().filter_map(move |list| list.get(i).cloned())).collect()
    }

    /// A method at random, the number of samples at random, and every other knob at its default or, half the time, anywhere
    /// on its ladder.
    fn draw(&self, random: &mut Random) -> Settings {
        let methods = self.methods();
        let mut settings = self.default_of(methods[random.below(methods.len())]);
        for knob in self.free(settings.method) {
            let samples = matches!(knob.name, "density" | "spp");
            if samples || random.below(2) == 0 {
                let values = self.values(knob);
                let value = values[random.below(values.len())];
                settings = with(&settings, knob, value).unwrap_or(settings);
            }
        }
        settings
    }
}

/// Settings with a knob turned, if they are valid.
fn with(settings: &Settings, knob: &Knob, value: Value) -> Option<Settings> {
    let mut turned = settings.clone();
    knob.set(&mut turned, value).ok()?;
    turned.validate().is_ok().then_some(turned)
}

struct List {
    found: Vec<Candidate>,
    known: BTreeSet<String>,
    count: usize,
}

impl List {
    /// Whether it was new, and there was room.
    fn push(&mut self, settings: Settings, origin: Origin) -> bool {
        let candidate = Candidate::new(settings, origin);
        let new = self.found.len() < self.count && self.known.insert(candidate.id.clone());
        if new {
            self.found.push(candidate);
        }
        new
    }
}

/// The knobs in use, as JSON has them.
pub fn knobs(settings: &Settings) -> BTreeMap<String, serde_json::Value> {
    let json = |value: Value| serde_json::to_value(value).unwrap_or_default();
    used(settings).into_iter().map(|(name, value)| (name.to_owned(), json(value))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn space(held: &[&str]) -> Space {
        let held = held.iter().map(|s| (*s).to_owned()).collect();
        Space { base: Settings::default(), held, scene: Traits::default() }
    }

    #[test]
    fn candidates_are_different_valid_and_the_same_again() {
        let found = space(&[]).candidates(200, 1);
        let ids: BTreeSet<_> = found.iter().map(|c| &c.id).collect();
        assert_eq!(ids.len(), found.len());
        assert!(found.len() > 60, "{}", found.len());
        assert!(found.iter().all(|c| c.settings.validate().is_ok() && !c.settings.method.accumulates()));
        assert_eq!(found, space(&[]).candidates(200, 1));
        assert_ne!(found, space(&[]).candidates(200, 2));
        // A longer list begins with the shorter one.
        assert_eq!(space(&[]).candidates(50, 1), found[..50]);
    }

    #[test]
    fn defaults_come_first_and_every_value_of_every_knob_is_tried() {
        let found = space(&[]).candidates(400, 1);
        let methods: Vec<Method> = Method::ALL.iter().copied().filter(|m| !m.accumulates()).collect();
        for (candidate, method) in found.iter().zip(&methods) {
            assert_eq!((candidate.settings.method, candidate.origin), (*method, Origin::Default));
        }
        for knob in KNOBS.iter().filter(|k| k.name != "method") {
            for value in knob.ladder.iter().filter(|v| (knob.distinct)(&Traits::default(), **v)) {
                assert!(found.iter().any(|c| knob.get(&c.settings) == *value), "{} {value}", knob.name);
            }
        }
    }

    #[test]
    fn what_makes_no_difference_in_the_scene_is_not_tried() {
        let plain = Space {
            scene: Traits { lights: 1, textures: false, distributed: false, transmits: false, medium: false },
            ..space(&[])
        };
        let values = |space: &Space, name: &str| {
            let found = space.candidates(400, 1);
            let words = found.iter().map(|c| Knob::find(name).unwrap().get(&c.settings).to_string());
            words.collect::<BTreeSet<_>>().len()
        };
        assert_eq!([values(&plain, "texture.filter"), values(&plain, "shadow.rays")], [1, 2]);
        assert_eq!([values(&space(&[]), "texture.filter"), values(&space(&[]), "shadow.rays")], [2, 5]);
        assert_eq!(
            values(
                &Space { scene: Traits { lights: 3, textures: true, ..Traits::default() }, ..space(&[]) },
                "shadow.rays"
            ),
            4
        );
        // The defaults are always there.
        for knob in KNOBS {
            let default = knob.default_of(Method::Stable);
            assert!(!knob.ladder.contains(&default) || (knob.distinct)(&plain.scene, default), "{}", knob.name);
        }
    }

    #[test]
    fn what_is_held_stays() {
        let mut space = space(&["density", "method"]);
        space.base.density = 0.7;
        let found = space.candidates(200, 1);
        assert!(found.len() > 3);
        assert!(found.iter().all(|c| c.settings.density == 0.7 && c.settings.method == Method::Stable));
    }

    #[test]
    fn identity_ignores_knobs_that_are_not_used() {
        let stable = Settings::default();
        assert_eq!(id(&stable), id(&Settings { spp: 7, ..stable.clone() }));
        assert_ne!(id(&stable), id(&Settings { density: 2.0, ..stable.clone() }));
        assert_eq!(label(&Settings { density: 2.0, spp: 7, ..stable }), "stable density=2");
    }
}
