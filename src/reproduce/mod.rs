//! What the papers print beside what is measured here.
//!
//! | module | what it does |
//! | --- | --- |
//! | [`contest`] | named methods side by side, over scenes and motions |
//! | [`tables`] | what they come to, the claims, paper 1's figure 5, paper 3's table 1 |
//! | [`phases`] | paper 1's table 1: what each phase takes |
//! | [`figures`] | paper 1's figures 6, 8 and 10, and paper 2's figure 16, rendered |
//! | [`coherence`] | paper 2's figures 17 to 20: what rays cost, counted |

pub mod coherence;
pub mod contest;
pub mod figures;
pub mod phases;
pub mod tables;
