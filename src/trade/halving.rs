//! Successive halving (Jamieson and Talwalkar 2016, "Non-stochastic best arm identification and hyperparameter
//! optimization"), for several objectives: all candidates are tried on little, the better ones on more.
//!
//! Candidates are dealt into brackets that know nothing of each other, so that they can be searched on different machines;
//! what they find is the same wherever that is, since every decision rests on what is counted or computed, never on a clock:
//! the cost of a candidate is here its rays.

use super::candidate::{Candidate, Origin};
use super::pareto::{Estimate, ranking, surely_dominates};
use crate::Result;
use serde::{Deserialize, Serialize};

/// What a rung says of a candidate.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Rays a frame.
    pub cost: Estimate,
    /// What else should be small.
    pub objectives: Vec<Estimate>,
    /// The knobs whose cost the rays do not tell, in words.
    pub uncounted: String,
}

/// How far a candidate came.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fate {
    /// The candidate's identity.
    pub candidate: String,
    /// Rungs that it was tried on.
    pub rungs: usize,
    /// Why it was given up: none if it came to the end.
    pub given_up: Option<GivenUp>,
}

/// Why a candidate was given up.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GivenUp {
    /// This other candidate was better in everything, beyond all doubt of the intervals.
    DominatedBy(String),
    /// Others of its bracket were on a better front, or filled a larger gap.
    Outranked,
}

/// The part of the candidates that goes on to the next rung.
pub const KEPT: f64 = 1.0 / 4.0;

/// How much more a knob may cost that the rays do not tell: the dearest, Voronoi weights, makes a hairball's frame 1.19 times as
/// long on lavapipe (`stillray bench`, 256 x 256, density 1), so candidates that differ in such knobs are told apart by cost
/// only beyond that. (Where rays cost next to nothing, as on strands over nothing, it is more.)
const UNCOUNTED_MARGIN: f64 = 1.2;

/// Bracket number `index` of `brackets`: every candidate is in one.
pub fn bracket(candidates: &[Candidate], index: usize, brackets: usize) -> Vec<Candidate> {
    candidates.iter().skip(index).step_by(brackets.max(1)).cloned().collect()
}

/// Runs a bracket over `rungs` rungs. `judge` tries a candidate on a rung, from 0, on which there are so many.
///
/// # Errors
/// Those of `judge`.
pub fn run(
    candidates: &[Candidate],
    rungs: usize,
    mut judge: impl FnMut(&Candidate, usize, usize) -> Result<Verdict>,
) -> Result<Vec<Fate>> {
    let mut fates = Vec::new();
    let mut left: Vec<&Candidate> = candidates.iter().collect();
    for rung in 0..rungs {
        let verdicts = left.iter().map(|c| judge(c, rung, left.len())).collect::<Result<Vec<_>>>()?;
        if rung + 1 == rungs {
            break;
        }
        let decisions = decide(&left, &verdicts);
        let fate = |(c, why): (&&Candidate, &Option<GivenUp>)| {
            why.clone().map(|why| Fate { candidate: c.id.clone(), rungs: rung + 1, given_up: Some(why) })
        };
        fates.extend(left.iter().zip(&decisions).filter_map(fate));
        let kept = left.iter().zip(&decisions).filter(|(_, why)| why.is_none());
        left = kept.map(|(c, _)| *c).collect();
    }
    fates.extend(left.iter().map(|c| Fate { candidate: c.id.clone(), rungs, given_up: None }));
    Ok(fates)
}

/// Who is given up after a rung, and why.
fn decide(candidates: &[&Candidate], verdicts: &[Verdict]) -> Vec<Option<GivenUp>> {
    let mut decisions: Vec<Option<GivenUp>> = (0..candidates.len())
        .map(|i| dominator(i, verdicts).map(|d| GivenUp::DominatedBy(candidates[d].id.clone())))
        .collect();
    let room = (candidates.len() as f64 * KEPT).ceil() as usize;
    let open: Vec<usize> = (0..candidates.len()).filter(|&i| decisions[i].is_none()).collect();
    let points: Vec<Vec<Estimate>> = open.iter().map(|&i| point(&verdicts[i], 1.0)).collect();
    for &place in ranking(&points).iter().skip(room) {
        decisions[open[place]] = Some(GivenUp::Outranked);
    }
    // Rivals that everything is compared with stay, however bad.
    for (candidate, decision) in candidates.iter().zip(&mut decisions) {
        if candidate.origin == Origin::Default {
            *decision = None;
        }
    }
    decisions
}

fn dominator(i: usize, verdicts: &[Verdict]) -> Option<usize> {
    let own = point(&verdicts[i], 1.0);
    (0..verdicts.len()).find(|&other| {
        let alike = verdicts[other].uncounted == verdicts[i].uncounted;
        surely_dominates(&point(&verdicts[other], if alike { 1.0 } else { UNCOUNTED_MARGIN }), &own)
    })
}

fn point(verdict: &Verdict, scale: f64) -> Vec<Estimate> {
    let Estimate { mean, half_width } = verdict.cost;
    let cost = Estimate { mean: mean * scale, half_width: half_width * scale };
    std::iter::once(cost).chain(verdict.objectives.iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;

    fn candidates(n: usize) -> Vec<Candidate> {
        let of = |i: usize| {
            let settings = Settings { density: 0.1 + i as f32 * 0.1, ..Settings::default() };
            Candidate::new(settings, if i == 0 { Origin::Default } else { Origin::Random })
        };
        (0..n).map(of).collect()
    }

    /// Cost grows with density, error falls with it; the tolerance is pure loss.
    fn verdict(candidate: &Candidate, noise: f64) -> Verdict {
        let density = f64::from(candidate.settings.density);
        let error = 1.0 / density + f64::from(candidate.settings.tolerance) - 1.0;
        let objectives = vec![Estimate { mean: error, half_width: noise }];
        Verdict { cost: Estimate::exact(density), objectives, uncounted: String::new() }
    }

    #[test]
    fn the_front_survives_and_what_is_surely_worse_goes_first() {
        let mut all = candidates(24);
        for candidate in &mut all[1..13] {
            candidate.settings.tolerance = 40.0;
        }
        let fates = run(&all, 3, |c, _, _| Ok(verdict(c, 0.01))).unwrap();
        assert_eq!(fates.len(), all.len());
        let fate = |i: usize| fates.iter().find(|f| f.candidate == all[i].id).unwrap();
        assert_eq!(fate(0).given_up, None, "a default stays");
        assert!((1..13).all(|i| fate(i).rungs == 1), "{fates:?}");
        // Of twenty-four six go on, and of those two.
        assert_eq!(fates.iter().filter(|f| f.rungs >= 2).count(), 6);
        let last: Vec<_> = fates.iter().filter(|f| f.given_up.is_none()).collect();
        assert_eq!(last.len(), 2);
        assert!(last.iter().all(|f| f.rungs == 3));
    }

    #[test]
    fn doubt_keeps_a_candidate_from_being_dominated() {
        let mut all = candidates(3);
        all[1].settings.tolerance = 4.0;
        all[1].settings.density = all[2].settings.density + 0.2;
        let reason = |noise: f64| {
            let fates = run(&all, 2, |c, _, _| Ok(verdict(c, noise))).unwrap();
            fates.into_iter().find(|f| f.candidate == all[1].id).unwrap().given_up
        };
        assert_eq!(reason(0.001), Some(GivenUp::DominatedBy(all[2].id.clone())));
        assert_ne!(reason(2.0), Some(GivenUp::DominatedBy(all[2].id.clone())));
    }

    #[test]
    fn knobs_whose_cost_is_not_counted_have_a_margin() {
        let all = candidates(2);
        let judged = |other: &str, cheaper: f64| {
            let judge = |c: &Candidate, _, _| {
                let first = c.id == all[0].id;
                let cost = Estimate::exact(if first { 1.0 - cheaper } else { 1.0 });
                let objectives = vec![Estimate::exact(if first { 1.0 } else { 2.0 })];
                Ok(Verdict { cost, objectives, uncounted: if first { other.into() } else { String::new() } })
            };
            run(&all, 2, judge).unwrap().iter().any(|f| matches!(f.given_up, Some(GivenUp::DominatedBy(_))))
        };
        assert!(judged("", 0.05));
        assert!(!judged("nearest", 0.05));
        assert!(judged("nearest", 0.2));
    }

    #[test]
    fn brackets_share_out_everything_and_do_not_depend_on_each_other() {
        let all = candidates(20);
        let mut together: Vec<String> = (0..3).flat_map(|b| bracket(&all, b, 3)).map(|c| c.id).collect();
        together.sort();
        let mut ids: Vec<String> = all.iter().map(|c| c.id.clone()).collect();
        ids.sort();
        assert_eq!(together, ids);
    }
}
