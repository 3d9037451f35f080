//! What a search found, as files and as a table: `trade.json`, `trade.csv`, `report.html`.

use std::collections::BTreeMap;
use std::path::Path;

use base64::Engine;
use serde::Serialize;

use super::bench::Build;
use super::table::{Table, bytes, grouped};
use super::{file, json};
use crate::trade::candidate::Origin;
use crate::trade::outcome::{Entry, Outcome};
use crate::trade::promise::{self, Trial};
use crate::trade::timing;
use crate::{Error, Result};

/// The form of `trade.json`.
#[derive(Debug, Serialize)]
struct File<'a> {
    build: &'a Build,
    #[serde(flatten)]
    outcome: &'a Outcome,
}

/// Writes `trade.json`: all that was searched and measured.
///
/// # Errors
/// [`Error::Io`].
pub fn write_json(folder: &Path, outcome: &Outcome, build: &Build) -> Result<()> {
    json::write(&folder.join("trade.json"), &File { build, outcome })
}

/// Writes `report.html`: everything to be looked at, in one file that needs no other and no network.
///
/// # Errors
/// [`Error::Io`].
pub fn write_html(folder: &Path, outcome: &Outcome, build: &Build) -> Result<()> {
    let path = folder.join("report.html");
    let pictures = pictures(folder, outcome)?;
    let page = Page { file: File { build, outcome }, pictures };
    let data = serde_json::to_string(&page).map_err(|e| Error::Io { path: path.clone(), cause: e.into() })?;
    // Nothing in the data may end the element that it is in.
    file::write_text(&path, &include_str!("trade.html").replacen("/*DATA*/", &data.replace("</", "<\\/"), 1))
}

/// What the page reads.
#[derive(Debug, Serialize)]
struct Page<'a> {
    #[serde(flatten)]
    file: File<'a>,
    pictures: BTreeMap<String, BTreeMap<&'static str, String>>,
}

/// The pictures of the front, of the methods' defaults and of the reference, as data URLs.
fn pictures(folder: &Path, outcome: &Outcome) -> Result<BTreeMap<String, BTreeMap<&'static str, String>>> {
    let shown = outcome.entries.iter().filter(|e| e.on_front || e.origin == Origin::Default);
    let names = shown.map(|e| e.candidate.as_str()).chain(["reference"]);
    names.map(|name| Ok((name.to_owned(), pictures_of(&folder.join("pictures").join(name))?))).collect()
}

fn pictures_of(folder: &Path) -> Result<BTreeMap<&'static str, String>> {
    let mut found = BTreeMap::new();
    for name in ["frames", "flip", "flicker"] {
        let path = folder.join(format!("{name}.png"));
        if path.exists() {
            let bytes = std::fs::read(&path).map_err(|cause| Error::Io { path, cause })?;
            let text = base64::engine::general_purpose::STANDARD.encode(bytes);
            found.insert(name, format!("data:image/png;base64,{text}"));
        }
    }
    Ok(found)
}

/// Writes `trade.csv`: a row a candidate that came to the end.
///
/// # Errors
/// [`Error::Io`].
pub fn write_csv(folder: &Path, outcome: &Outcome) -> Result<()> {
    let path = folder.join("trade.csv");
    let failed = |e: csv::Error| Error::Io { path: path.clone(), cause: e.into() };
    let mut writer = csv::Writer::from_writer(Vec::new());
    let titles = [
        "candidate",
        "settings",
        "on_front",
        "ms",
        "aa_noise_ms",
        "rays",
        "memory_bytes",
        "flip",
        "relative_mse",
        "flicker_error",
        "excess_flicker",
        "cpbd",
        "cpbd_reference",
        "energy_ratio",
    ];
    writer.write_record(titles).map_err(failed)?;
    for entry in &outcome.entries {
        writer.write_record(record(entry)).map_err(failed)?;
    }
    let bytes = writer.into_inner().map_err(|e| Error::Io { path: path.clone(), cause: e.into_error() })?;
    file::write_bytes(&path, &bytes)
}

fn record(e: &Entry) -> Vec<String> {
    let optional = |x: Option<f64>| x.map_or_else(String::new, |x| x.to_string());
    vec![
        e.candidate.clone(),
        e.label.clone(),
        e.on_front.to_string(),
        e.timing.ms.to_string(),
        e.timing.noise_ms.to_string(),
        e.rays.to_string(),
        e.memory_bytes.to_string(),
        e.flip.mean.to_string(),
        e.relative_mse.mean.to_string(),
        e.flicker_error.mean.to_string(),
        e.excess_flicker.to_string(),
        optional(e.cpbd),
        optional(e.cpbd_reference),
        e.energy_ratio.to_string(),
    ]
}

/// The front, cheapest first, and the methods' defaults.
pub fn table(outcome: &Outcome) -> Table {
    let mut table = Table::new([
        "settings",
        "ms ± A/A",
        "rays",
        "memory",
        "FLIP ±",
        "flicker error ±",
        "excess flicker",
        "CPBD",
        "energy",
        "",
    ]);
    let default = |e: &&Entry| e.origin == Origin::Default;
    for entry in outcome.entries.iter().filter(|e| e.on_front || default(e)) {
        table.row(row(entry));
    }
    table
}

fn row(e: &Entry) -> [String; 10] {
    [
        e.label.clone(),
        format!("{:.1} ± {:.1}", e.timing.ms, e.timing.noise_ms),
        grouped(e.rays as u64),
        bytes(e.memory_bytes),
        format!("{:.4} ± {:.4}", e.flip.mean, e.flip.half_width),
        format!("{:.4} ± {:.4}", e.flicker_error.mean, e.flicker_error.half_width),
        format!("{:+.4}", e.excess_flicker),
        e.cpbd.map_or_else(|| "-".to_owned(), |c| format!("{c:.3}")),
        format!("{:.4}", e.energy_ratio),
        if e.on_front { "front" } else { "" }.to_owned(),
    ]
}

/// What the times of neighbours on the front say, in words: a difference below the A/A noise is none.
pub fn differences(outcome: &Outcome) -> String {
    let front: Vec<&Entry> = outcome.entries.iter().filter(|e| e.on_front).collect();
    let line = |pair: &[&Entry]| {
        let (a, b) = (pair[0], pair[1]);
        let time = match timing::ratio(&b.timing, &a.timing) {
            Some(ratio) => format!("{ratio:.2} x the time"),
            None => "no difference in time beyond the noise".to_owned(),
        };
        let change = |x: f64, y: f64| 100.0 * (y / x.max(1e-12) - 1.0);
        let flip = change(a.flip.mean, b.flip.mean);
        let flicker = change(a.flicker_error.mean, b.flicker_error.mean);
        format!("{} -> {}: {time}, FLIP {flip:+.0} %, flicker error {flicker:+.0} %\n", a.label, b.label)
    };
    front.windows(2).map(line).collect()
}

/// Every trial of picked settings, and how many kept their limits.
pub fn promises(trials: &[Trial]) -> String {
    let mut table = Table::new(["limit", "picked", "motion", "measured", "kept"]).left();
    let mut sorted: Vec<&Trial> = trials.iter().collect();
    sorted.sort_by(|a, b| a.axis.cmp(b.axis).then(a.limit.total_cmp(&b.limit)));
    for t in sorted {
        let kept = if t.kept { "yes" } else { "no" };
        table.row([
            format!("{} {:.4}", t.axis, t.limit),
            t.label.clone(),
            t.motion.clone(),
            format!("{:.4}", t.value),
            kept.to_owned(),
        ]);
    }
    let share = |kept: usize, all: usize| 100.0 * kept as f64 / all.max(1) as f64;
    let line = |(axis, kept, all): (&str, usize, usize)| {
        format!("{axis}: {kept} of {all} limits kept ({:.0} %)\n", share(kept, all))
    };
    let (kept, all) = (trials.iter().filter(|t| t.kept).count(), trials.len());
    let lines: String = promise::kept(trials).into_iter().map(line).collect();
    format!("{table}\n{lines}all: {kept} of {all} limits kept ({:.0} %)\n", share(kept, all))
}
