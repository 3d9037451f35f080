//! The knobs: every setting that trades something, one entry each in one table.
//!
//! A knob registers itself by being in [`KNOBS`]. Nothing else has to know of it: the range check, the settings file, the
//! command line, the reports and the search for good trades go through the table.

use super::{Method, Settings};
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

pub use super::table::KNOBS;

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
