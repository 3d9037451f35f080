//! The search for good trades: which settings are worth their time on a scene and its motion.
//!
//! | module | what it does |
//! | --- | --- |
//! | [`candidate`] | settings out of the knobs' ladders |
//! | [`halving`] | tries all on little and the better ones on more |
//! | [`pareto`] | dominance, fronts, estimates with intervals |
//! | [`studio`], [`reference`](mod@reference), [`evaluate`] | renders candidates beside converged frames, and measures |
//! | [`timing`] | times in turns what came to the end, and each against itself |
//! | [`store`] | the search's folder: measurements as files |
//! | [`search`] | all of it in order, to be stopped and gone on with, whole or in shards |
//! | [`outcome`] | what the files say, and the front |
//! | [`choose`] | settings under a limit |
//! | [`promise`] | whether they keep it under motions that the search has not seen |

pub mod candidate;
pub mod choose;
pub mod evaluate;
pub mod halving;
pub mod outcome;
pub mod pareto;
pub mod pictures;
pub mod promise;
mod random;
pub mod reference;
pub mod search;
pub mod store;
pub mod studio;
pub mod timing;
