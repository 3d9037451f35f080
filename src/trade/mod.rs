//! The search for good trades: which settings are worth their time on a scene and its motion.
//!
//! | module | what it does |
//! | --- | --- |
//! | [`candidate`] | settings out of the knobs' ladders |
//! | [`pareto`] | dominance, fronts, estimates with intervals |
//! | [`halving`] | tries all on little and the better ones on more |
//! | [`store`] | its folder: measurements as files |

pub mod candidate;
pub mod halving;
pub mod pareto;
mod random;
pub mod store;
