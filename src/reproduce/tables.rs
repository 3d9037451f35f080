//! What the papers say beside what is measured here, in Markdown.

use super::contest::Score;
use crate::report::statistics::{mean, ratio};
use crate::trade::store::Run;
use std::collections::BTreeSet;
use std::fmt::Write;

/// Paper 1, Figure 5: techniques on the hairball, and their CPBD sharpness.
pub const FIGURE_5: [(&str, f64); 5] =
    [("supersample:4", 0.8142), ("taa:4", 0.6610), ("stable:2", 0.8056), ("stable+ti:2", 0.7783), (REFERENCE, 0.8054)];

/// What the paper calls its reference; here it is the converged frames.
pub const REFERENCE: &str = "supersample:32, the reference";

/// Paper 3, Table 1: percent of pixels with 0 to 4 reprojected points.
pub const POINTS: [(&str, [f64; 5]); 3] = [
    ("Hogum (terrain)", [21.9, 58.2, 18.2, 1.6, 0.0]),
    ("Range-400 (terrain)", [19.6, 64.7, 14.2, 1.3, 0.1]),
    ("Spheres", [20.6, 60.6, 17.1, 1.6, 0.0]),
];

/// Means over scenes and motions, a row a contestant in the order of their appearance.
pub fn overview(scores: &[Score]) -> String {
    let mut text = String::from(
        "| settings | flicker error | excess flicker | FLIP | CPBD − reference | energy | rays a pixel | ms a frame |\n\
         | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for name in names(scores, |s| &s.contestant) {
        let own: Vec<&Score> = scores.iter().filter(|s| s.contestant == name).collect();
        let of = |value: fn(&Run) -> f64| mean(own.iter().map(|s| value(&s.run)));
        let _ = writeln!(
            text,
            "| {name} | {:.4} | {:+.4} | {:.4} | {:+.3} | {:.4} | {:.2} | {:.1} |",
            of(flicker),
            of(excess),
            of(flip),
            of(sharpness),
            of(|r| r.quality.energy_ratio),
            of(rays_a_pixel),
            mean(own.iter().map(|s| s.ms)),
        );
    }
    text
}

/// Every score, a row a scene, motion and contestant.
pub fn details(scores: &[Score]) -> String {
    let mut text = String::from(
        "| scene | motion | settings | flicker error | excess flicker | FLIP | CPBD | reference | energy | rays a pixel | ms |\n\
         | --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for score in scores {
        let run = &score.run;
        let optional = |x: Option<f64>| x.map_or_else(|| "–".to_owned(), |x| format!("{x:.3}"));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {:.4} | {:+.4} | {:.4} | {} | {} | {:.4} | {:.2} | {:.1} |",
            score.scene,
            run.motion,
            score.contestant,
            flicker(run),
            excess(run),
            flip(run),
            optional(run.quality.cpbd),
            optional(run.quality.cpbd_reference),
            run.quality.energy_ratio,
            rays_a_pixel(run),
            score.ms,
        );
    }
    text
}

/// A claim about two contestants: the ratio (or difference) of a measure, over all scenes and motions, and in how many of them
/// it holds.
struct Claim {
    words: &'static str,
    value: f64,
    wanted: String,
    holds: bool,
    cases: String,
}

/// What was aimed at, and the papers' claims that are put in words, each with its number.
pub fn claims(scores: &[Score]) -> String {
    let all = [
        ratio_claim(scores, "excess flicker of stable:2 to supersample:2", excess, ["stable:2", "supersample:2"], 0.35),
        ratio_claim(scores, "flicker error of stable:2 to supersample:2", flicker, ["stable:2", "supersample:2"], 0.35),
        ratio_claim(
            scores,
            "excess flicker of stable:2 to point-tracking",
            excess,
            ["stable:2", "point-tracking"],
            0.6,
        ),
        ratio_claim(
            scores,
            "flicker error of stable:2 to point-tracking",
            flicker,
            ["stable:2", "point-tracking"],
            0.6,
        ),
        ratio_claim(scores, "excess flicker of stable:2 to taa:2", excess, ["stable:2", "taa:2"], 1.1),
        ratio_claim(scores, "flicker error of stable:2 to taa:2", flicker, ["stable:2", "taa:2"], 1.1),
        ratio_claim(scores, "flicker error of stable+ti:2 to taa:2", flicker, ["stable+ti:2", "taa:2"], 1.1),
        ratio_claim(scores, "FLIP of stable:2 to supersample:2", flip, ["stable:2", "supersample:2"], 1.0),
        difference_claim(scores, "stable:2 is sharper than taa:2", ["taa:2", "stable:2"]),
        difference_claim(scores, "stable+ti:2 is sharper than taa:2", ["taa:2", "stable+ti:2"]),
        difference_claim(scores, "supersample:2 is sharper than taa:2", ["taa:2", "supersample:2"]),
    ];
    let mut text = String::from(
        "| claim | measured | wanted | holds | in so many scenes and motions |\n| --- | ---: | ---: | --- | ---: |\n",
    );
    for claim in all.iter().flatten() {
        let holds = if claim.holds { "yes" } else { "**no**" };
        let value = if claim.value.is_nan() { "–".to_owned() } else { format!("{:.3}", claim.value) };
        let _ = writeln!(text, "| {} | {value} | {} | {holds} | {} |", claim.words, claim.wanted, claim.cases);
    }
    text
}

/// Paper 3's Table 1 beside the contestant `point-tracking`.
pub fn points(scores: &[Score]) -> String {
    let mut text = String::from(
        "| pixels with so many points | 0 | 1 | 2 | 3 | 4+ |\n| --- | ---: | ---: | ---: | ---: | ---: |\n",
    );
    let mut row = |name: &str, shares: [f64; 5]| {
        let [a, b, c, d, e] = shares;
        let _ = writeln!(text, "| {name} | {a:.1} % | {b:.1} % | {c:.1} % | {d:.1} % | {e:.1} % |");
    };
    POINTS.iter().for_each(|(name, shares)| row(&format!("paper 3: {name}"), *shares));
    let wanted =
        |s: &&Score| s.contestant == "point-tracking" && ["terrain", "spheres"].iter().any(|n| s.scene.ends_with(n));
    for score in scores.iter().filter(wanted) {
        row(&format!("{}, {}", score.scene, score.run.motion), score.run.reprojected.map(|share| 100.0 * share));
    }
    text
}

/// Paper 1's sharpness beside that of the same techniques on our hairball.
pub fn figure_5(scores: &[Score]) -> String {
    let mut text = String::from("| technique | paper 1 | here |\n| --- | ---: | ---: |\n");
    for (name, paper) in FIGURE_5 {
        let own = scores.iter().find(|s| s.contestant == name).and_then(|s| s.run.quality.cpbd);
        let reference = scores.first().and_then(|s| s.run.quality.cpbd_reference).filter(|_| name == REFERENCE);
        let here = own.or(reference).map_or_else(|| "–".to_owned(), |x| format!("{x:.4}"));
        let _ = writeln!(text, "| {name} | {paper:.4} | {here} |");
    }
    text
}

fn flicker(run: &Run) -> f64 {
    run.quality.flicker_error.mean
}

fn excess(run: &Run) -> f64 {
    run.quality.excess_flicker
}

fn flip(run: &Run) -> f64 {
    run.quality.flip.mean
}

fn sharpness(run: &Run) -> f64 {
    run.quality.cpbd.unwrap_or_default() - run.quality.cpbd_reference.unwrap_or_default()
}

fn rays_a_pixel(run: &Run) -> f64 {
    ratio(run.rays, f64::from(run.size[0]) * f64::from(run.size[1]))
}

/// Names in the order of their appearance.
fn names<'a>(scores: &'a [Score], of: impl Fn(&'a Score) -> &'a str) -> Vec<&'a str> {
    let mut seen = BTreeSet::new();
    scores.iter().map(of).filter(|name| seen.insert(*name)).collect()
}

/// A measure of two contestants in every scene and motion that has both.
fn pairs(scores: &[Score], of: fn(&Run) -> f64, [a, b]: [&str; 2]) -> Vec<[f64; 2]> {
    let first = scores.iter().filter(|s| s.contestant == a);
    let partner = |s: &Score| {
        let same = |t: &&Score| t.contestant == b && t.scene == s.scene && t.run.motion == s.run.motion;
        Some([of(&s.run), of(&scores.iter().find(same)?.run)])
    };
    first.filter_map(partner).collect()
}

/// The mean of the first is at most so many times that of the second.
fn ratio_claim(
    scores: &[Score],
    words: &'static str,
    of: fn(&Run) -> f64,
    names: [&str; 2],
    most: f64,
) -> Option<Claim> {
    let pairs = pairs(scores, of, names);
    let sum = |i: usize| pairs.iter().map(|p| p[i]).sum::<f64>();
    let (first, second) = (sum(0), sum(1));
    // Excess flicker can be negative: there is no ratio to that, but it can still be told which is less.
    let value = if second > 0.0 { first / second } else { f64::NAN };
    let held = pairs.iter().filter(|[a, b]| *a <= most * b).count();
    let cases = format!("{held} of {}", pairs.len());
    (!pairs.is_empty()).then(|| Claim {
        words,
        value,
        wanted: format!("≤ {most}"),
        holds: first <= most * second,
        cases,
    })
}

/// The first loses more sharpness than the second.
fn difference_claim(scores: &[Score], words: &'static str, names: [&str; 2]) -> Option<Claim> {
    let pairs = pairs(scores, sharpness, names);
    let value = mean(pairs.iter().map(|[a, b]| b - a));
    let held = pairs.iter().filter(|[a, b]| a < b).count();
    let cases = format!("{held} of {}", pairs.len());
    (!pairs.is_empty()).then(|| Claim { words, value, wanted: "> 0".to_owned(), holds: value > 0.0, cases })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trade::pareto::Estimate;
    use crate::trade::store::tests::run;

    fn score(contestant: &str, motion: &str, flicker: f64, cpbd: f64) -> Score {
        let mut run = run(contestant, 0, motion, 0.2);
        run.quality.flicker_error = Estimate::exact(flicker);
        run.quality.excess_flicker = flicker / 2.0;
        run.quality.cpbd = Some(cpbd);
        Score { scene: "builtin:hairball".into(), contestant: contestant.into(), run, ms: 2.0 }
    }

    #[test]
    fn claims_hold_or_do_not() {
        let mut scores = vec![score("stable:2", "pan", 0.01, 0.8), score("supersample:2", "pan", 0.05, 0.85)];
        let line = |scores: &[Score], words: &str| {
            claims(scores).lines().find(|l| l.contains(words)).unwrap_or_default().to_owned()
        };
        let words = "flicker error of stable:2 to supersample:2";
        assert_eq!(line(&scores, words), format!("| {words} | 0.200 | ≤ 0.35 | yes | 1 of 1 |"));
        scores.extend([score("stable:2", "orbit", 0.05, 0.8), score("supersample:2", "orbit", 0.05, 0.85)]);
        assert_eq!(line(&scores, words), format!("| {words} | 0.600 | ≤ 0.35 | **no** | 1 of 2 |"));
        // To what is steadier than the reference there is no ratio.
        let (words, mut steady) = ("excess flicker of stable:2 to taa:2", scores.clone());
        steady.push(score("taa:2", "pan", -0.01, 0.6));
        assert_eq!(line(&steady, words), format!("| {words} | – | ≤ 1.1 | **no** | 0 of 1 |"));
        // Of contestants that did not take part nothing is said.
        assert_eq!(line(&scores, "taa"), "");
        scores.push(score("taa:2", "pan", 0.01, 0.6));
        assert!(line(&scores, "stable:2 is sharper than taa:2").contains("| 0.200 | > 0 | yes | 1 of 1 |"));
    }

    #[test]
    fn tables_have_a_row_each() {
        let scores = [score("stable:2", "pan", 0.01, 0.8), score("taa:4", "pan", 0.05, 0.85)];
        assert_eq!(overview(&scores).lines().count(), 2 + 2);
        assert_eq!(details(&scores).lines().count(), 2 + 2);
        let figure = figure_5(&scores);
        assert!(figure.contains("| taa:4 | 0.6610 | 0.8500 |") && figure.contains("| stable:2 | 0.8056 | 0.8000 |"));
        assert!(figure.contains("| supersample:4 | 0.8142 | – |") && figure.contains("reference | 0.8054 | 0.8000 |"));
        let mut tracked = score("point-tracking", "pan", 0.01, 0.8);
        tracked.scene = "builtin:terrain".into();
        assert!(points(&[tracked]).contains("| builtin:terrain, pan | 20.0 % | 60.0 % | 20.0 % | 0.0 % | 0.0 % |"));
    }
}
