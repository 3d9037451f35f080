//! Picks settings under a limit, with a margin for motions that have not been seen.

use super::outcome::{Entry, Outcome};
use crate::report::statistics::ratio;
use crate::{Error, Result};

/// What must not be exceeded; at least one of them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Limits {
    /// Milliseconds a frame on the device.
    pub budget_ms: Option<f64>,
    /// Flicker error, 0 to 1.
    pub max_flicker: Option<f64>,
    /// Mean FLIP, 0 to 1.
    pub max_error: Option<f64>,
}

/// Quantities that can be limited.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Axis {
    Time,
    Flicker,
    Error,
}

const AXES: [Axis; 3] = [Axis::Time, Axis::Flicker, Axis::Error];

/// What was picked.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// Which of the entries.
    pub candidate: String,
    /// What is expected of an unseen motion in milliseconds, flicker error and FLIP, at most, in nineteen of twenty.
    pub expected: [f64; 3],
    /// What the measured means were multiplied by for that.
    pub margins: [f64; 3],
}

/// The best entry that keeps all limits also under a motion that has not been seen.
///
/// How much an unseen motion differs is taken from the search itself: every motion is left out in turn, and its value is
/// divided by the mean of the others, over all entries; the 95th percentile of these ratios is the margin. For times the A/A
/// noise is added. With one motion there is nothing to leave out, and the margin is 1.
///
/// Best is what has least of that which is not limited: least time if only quality is limited, else the least geometric mean
/// of the free ones of FLIP and flicker error.
///
/// # Errors
/// [`Error::Setting`] if nothing is limited, or no entry keeps the limits, with the entry that comes nearest.
pub fn choose(outcome: &Outcome, limits: &Limits) -> Result<Choice> {
    let limited: Vec<(Axis, f64)> = AXES.iter().filter_map(|a| limit(limits, *a).map(|l| (*a, l))).collect();
    if limited.is_empty() {
        return Err(refusal("none", "--budget-ms, --max-flicker or --max-error"));
    }
    let margins = margins(outcome);
    let expected = |entry: &Entry| expected(entry, margins);
    // How far beyond its limits: at most 1 if it keeps them.
    let excess = |entry: &Entry| {
        let expected = expected(entry);
        limited.iter().map(|(axis, limit)| expected[*axis as usize] / limit).fold(0.0, f64::max)
    };
    let score = |entry: &Entry| merit(&expected(entry), &limited);
    let measured: Vec<&Entry> = outcome.entries.iter().filter(|e| e.timing.ms > 0.0).collect();
    let kept = measured.iter().filter(|e| excess(e) <= 1.0);
    match kept.min_by(|a, b| score(a).total_cmp(&score(b))) {
        Some(entry) => Ok(Choice { candidate: entry.candidate.clone(), expected: expected(entry), margins }),
        None => Err(nothing(measured.into_iter().min_by(|a, b| excess(a).total_cmp(&excess(b))), &expected)),
    }
}

/// What every entry of a search is expected to keep under a motion that has not been seen: milliseconds, flicker error and
/// FLIP, with the margins of [`choose`]. Those without a measured time are left out.
pub fn promised(outcome: &Outcome) -> Vec<(&Entry, [f64; 3])> {
    let margins = margins(outcome);
    outcome.entries.iter().filter(|e| e.timing.ms > 0.0).map(|e| (e, expected(e, margins))).collect()
}

fn margins(outcome: &Outcome) -> [f64; 3] {
    AXES.map(|axis| margin(&outcome.entries, axis))
}

fn expected(entry: &Entry, margins: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| worst(entry, AXES[i], margins[i]))
}

fn limit(limits: &Limits, axis: Axis) -> Option<f64> {
    match axis {
        Axis::Time => limits.budget_ms,
        Axis::Flicker => limits.max_flicker,
        Axis::Error => limits.max_error,
    }
}

fn merit(expected: &[f64; 3], limited: &[(Axis, f64)]) -> f64 {
    let free = |axis: Axis| limited.iter().all(|(l, _)| *l != axis);
    if free(Axis::Time) {
        return expected[0];
    }
    let qualities = [Axis::Flicker, Axis::Error].into_iter().filter(|a| free(*a));
    let product: f64 = qualities.map(|a| expected[a as usize].max(1e-12)).product();
    if free(Axis::Flicker) && free(Axis::Error) { product.sqrt() } else { product }
}

fn refusal(value: &str, expected: &str) -> Error {
    Error::Setting { name: "limits", value: value.to_owned(), expected: expected.to_owned() }
}

fn nothing(nearest: Option<&Entry>, expected: &dyn Fn(&Entry) -> [f64; 3]) -> Error {
    let Some(entry) = nearest else { return refusal("met by nothing", "a search with measured times") };
    let [ms, flicker, error] = expected(entry);
    let text = format!(
        "no settings keep these limits; nearest is {} with up to {ms:.3} ms, flicker error {flicker:.4}, FLIP {error:.4}",
        entry.label
    );
    refusal("met by nothing", &text)
}

/// Values of a quantity, one a motion.
fn values(entry: &Entry, axis: Axis) -> Vec<f64> {
    match axis {
        Axis::Time => entry.timing.by_motion.values().copied().collect(),
        Axis::Flicker => entry.runs.iter().map(|r| r.quality.flicker_error.mean).collect(),
        Axis::Error => entry.runs.iter().map(|r| r.quality.flip.mean).collect(),
    }
}

fn worst(entry: &Entry, axis: Axis, margin: f64) -> f64 {
    let values = values(entry, axis);
    let mean = ratio(values.iter().sum(), values.len() as f64);
    mean * margin + if axis == Axis::Time { entry.timing.noise_ms } else { 0.0 }
}

/// By how much a motion that is left out exceeds the others: the 95th percentile, nearest rank; at least 1.
fn margin(entries: &[Entry], axis: Axis) -> f64 {
    let mut ratios: Vec<f64> = entries.iter().flat_map(|entry| left_out(&values(entry, axis))).collect();
    ratios.sort_by(f64::total_cmp);
    let rank = (0.95 * ratios.len() as f64).ceil() as usize;
    ratios.get(rank.saturating_sub(1)).copied().unwrap_or(1.0).max(1.0)
}

fn left_out(values: &[f64]) -> Vec<f64> {
    let sum: f64 = values.iter().sum();
    let others = values.len().saturating_sub(1) as f64;
    values.iter().filter(|v| sum - **v > 0.0).map(|v| v * others / (sum - v)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trade::outcome::tests::{entry, outcome};

    fn pick(entries: Vec<Entry>, limits: Limits) -> Result<Choice> {
        choose(&outcome(entries), &limits)
    }

    /// Milliseconds, FLIP and flicker error of both motions.
    fn three() -> Vec<Entry> {
        vec![
            entry("fast", [1.0, 1.0], [0.3, 0.3], [0.03, 0.03]),
            entry("middle", [2.0, 2.0], [0.2, 0.2], [0.02, 0.02]),
            entry("good", [4.0, 4.0], [0.1, 0.1], [0.01, 0.01]),
        ]
    }

    #[test]
    fn a_budget_buys_the_best_and_a_quality_the_fastest() {
        let of = |limits| pick(three(), limits).unwrap().candidate;
        assert_eq!(of(Limits { budget_ms: Some(3.0), ..Limits::default() }), "middle");
        assert_eq!(of(Limits { budget_ms: Some(9.0), ..Limits::default() }), "good");
        assert_eq!(of(Limits { max_error: Some(0.25), ..Limits::default() }), "middle");
        assert_eq!(of(Limits { max_flicker: Some(0.03), ..Limits::default() }), "fast");
        assert_eq!(of(Limits { budget_ms: Some(9.0), max_error: Some(0.25), max_flicker: None }), "good");
    }

    #[test]
    fn what_varies_between_motions_needs_a_margin() {
        // A motion left out is up to 3/2 of the other.
        let mut entries = three();
        entries.push(entry("uneven", [2.0, 2.0], [0.1, 0.15], [0.02, 0.02]));
        let choice = pick(entries, Limits { max_error: Some(0.25), ..Limits::default() }).unwrap();
        assert!((choice.margins[2] - 1.5).abs() < 1e-9 && choice.margins[1] == 1.0);
        // The mean of 0.2 does not keep 0.25 with that margin.
        assert_eq!(choice.candidate, "uneven");
        assert!((choice.expected[2] - 0.125 * 1.5).abs() < 1e-9);
    }

    #[test]
    fn what_nothing_keeps_names_the_nearest() {
        let message = pick(three(), Limits { budget_ms: Some(0.5), ..Limits::default() }).unwrap_err().to_string();
        assert!(message.contains("nearest is fast"), "{message}");
        assert!(pick(three(), Limits::default()).unwrap_err().to_string().contains("--budget-ms"));
        assert!(pick(Vec::new(), Limits { budget_ms: Some(1.0), ..Limits::default() }).is_err());
    }
}
