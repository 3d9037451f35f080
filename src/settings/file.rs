//! Settings as data: a TOML file with a line a knob, and assignments in words.
//!
//! Names with a dot can be written as they are (`history.alpha = 0.1`) or as tables (`[history]`, `alpha = 0.1`). A file
//! may leave knobs out: they stay as they are, but for those that follow the method ([`Settings::switch`]).

use super::Settings;
use super::knob::{Domain, KNOBS, Knob, Value};
use crate::{Error, Result};
use std::path::Path;

/// The file of these settings: every knob with what it is, its range, its unit and what it trades.
pub fn text(settings: &Settings) -> String {
    let mut text = String::from("# Settings of stillray: stillray render SCENE --settings FILE\n");
    for knob in KNOBS {
        text += &format!("\n# {}; {}", knob.about, knob.range());
        if !knob.unit.is_empty() {
            text += &format!(", in {}", knob.unit);
        }
        let unused = if (knob.applies)(settings.method) { "" } else { " (not used by this method)" };
        text += &format!("; default {}{unused}\n# {}\n", knob.default_of(settings.method), knob.trades);
        text += &format!("{} = {}\n", knob.name, toml_value(knob.get(settings)));
    }
    text
}

/// Reads a file into settings.
///
/// # Errors
/// [`Error::Io`], or [`Error::SettingsFile`] with what is wrong in it: no TOML, a name that is no knob (with the nearest
/// one), a value out of range (with the range). The settings are unchanged then.
pub fn read(path: &Path, settings: &mut Settings) -> Result<()> {
    let text = std::fs::read_to_string(path).map_err(|cause| Error::Io { path: path.to_owned(), cause })?;
    parse(&text, settings).map_err(|message| Error::SettingsFile { path: path.to_owned(), message })
}

/// As [`read`], from the text; the error is a message without the file's name.
pub fn parse(text: &str, settings: &mut Settings) -> std::result::Result<(), String> {
    let table: toml::Table = text.parse().map_err(|e: toml::de::Error| one_line(text, &e))?;
    let mut changed = settings.clone();
    let mut entries = flatten("", &table);
    // Defaults follow the method, so it comes first.
    entries.sort_by_key(|(name, _)| name != "method");
    for (name, value) in entries {
        let knob = Knob::find(&name).map_err(|e| e.to_string())?;
        let value = knob_value(knob, value).map_err(|e| e.to_string())?;
        knob.set(&mut changed, value).map_err(|e| e.to_string())?;
    }
    *settings = changed;
    Ok(())
}

/// Sets knobs by words such as `density=2`, the method first; tells which were set.
///
/// # Errors
/// As for [`assign`].
pub fn assign_all(words: &[String], settings: &mut Settings) -> Result<Vec<&'static Knob>> {
    let mut ordered: Vec<&String> = words.iter().collect();
    ordered.sort_by_key(|words| !words.trim_start().starts_with("method"));
    ordered.into_iter().map(|words| assign(words, settings)).collect()
}

/// Sets a knob by words: `density=2`.
///
/// # Errors
/// [`Error::UnknownKnob`], or [`Error::Setting`] with the range.
pub fn assign(words: &str, settings: &mut Settings) -> Result<&'static Knob> {
    let Some((name, value)) = words.split_once('=') else {
        let expected = "NAME=VALUE, as in density=2".to_owned();
        return Err(Error::Setting { name: "--set", value: words.to_owned(), expected });
    };
    let knob = Knob::find(name.trim())?;
    let value = knob.read(value.trim())?;
    knob.set(settings, value)?;
    Ok(knob)
}

fn toml_value(value: Value) -> String {
    match value {
        Value::Choice(name) => format!("\"{name}\""),
        // TOML has floats and integers apart; ours are read from either.
        other => other.to_string(),
    }
}

/// Names with dots, and what is not a table.
fn flatten<'a>(prefix: &str, table: &'a toml::Table) -> Vec<(String, &'a toml::Value)> {
    let entries = table.iter().flat_map(|(key, value)| {
        let name = format!("{prefix}{key}");
        match value {
            toml::Value::Table(inner) => flatten(&format!("{name}."), inner),
            other => vec![(name, other)],
        }
    });
    entries.collect()
}

fn knob_value(knob: &Knob, value: &toml::Value) -> Result<Value> {
    let words = match value {
        toml::Value::String(words) => words.clone(),
        other => other.to_string(),
    };
    // A number in quotes is no number, and a name without them is no TOML.
    let quoted = value.is_str() == matches!(knob.domain, Domain::Choice { .. });
    knob.read(if quoted { &words } else { "" }).map_err(|_| Error::Setting {
        name: knob.name,
        value: value.to_string(),
        expected: knob.range(),
    })
}

fn one_line(text: &str, error: &toml::de::Error) -> String {
    let line = error.span().map_or(0, |span| text[..span.start.min(text.len())].matches('\n').count() + 1);
    format!("line {line}: {}", error.message().replace('\n', "; "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Method;

    fn parsed(text: &str) -> std::result::Result<Settings, String> {
        let mut settings = Settings::default();
        parse(text, &mut settings).map(|()| settings)
    }

    #[test]
    fn what_is_written_is_read_back() {
        // Every knob at the end of its ladder: none at its default by accident.
        let mut settings = Settings::default();
        for knob in KNOBS {
            knob.set(&mut settings, *knob.ladder.last().unwrap()).unwrap();
        }
        assert_eq!(parsed(&text(&settings)).unwrap(), settings);
        assert_eq!(parsed(&text(&Settings::default())).unwrap(), Settings::default());
        assert_eq!(parsed("").unwrap(), Settings::default());
    }

    #[test]
    fn numbers_are_whole_or_not_and_names_are_quoted() {
        let settings = parsed("density = 2\ntolerance = 0.5\nspp=3\njitter = true\nmethod = 'supersample'").unwrap();
        let expected = Settings {
            density: 2.0,
            tolerance: 0.5,
            spp: 3,
            jitter: true,
            method: Method::Supersample,
            ..Settings::default()
        };
        assert_eq!(settings, expected);
    }

    #[test]
    fn mistakes_are_named_and_change_nothing() {
        let cases = [
            ("densty = 2", "'density'"),
            ("density = 17", "from 0.0625 to 16"),
            ("density = '2'", "from 0.0625 to 16"),
            ("spp = 1.5", "a whole number"),
            ("method = 'stabel'", "one of stable"),
            ("density = [1]", "from 0.0625 to 16"),
            ("density = nan", "from 0.0625 to 16"),
            ("density = 1\ndensity = 2", "line 2"),
            ("density = ", "line 1"),
            ("[density]\nx = 1", "density.x"),
        ];
        for (text, expected) in cases {
            let message = parsed(text).unwrap_err();
            assert!(message.contains(expected) && !message.contains('\n'), "{text}: {message}");
        }
        let mut settings = Settings::default();
        assert!(parse("density = 3\nspp = 99", &mut settings).is_err());
        assert_eq!(settings, Settings::default());
    }

    #[test]
    fn assignments() {
        let mut settings = Settings::default();
        assert_eq!(assign("density = 0.5", &mut settings).unwrap().name, "density");
        assign("method=supersample", &mut settings).unwrap();
        assert_eq!((settings.density, settings.method), (0.5, Method::Supersample));
        for (wrong, expected) in [("density", "NAME=VALUE"), ("dens=1", "'density'"), ("spp=0", "from 1 to 16")] {
            let message = assign(wrong, &mut settings).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
