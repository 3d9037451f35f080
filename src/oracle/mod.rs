//! The same phases on the CPU, in f64 where it matters: the known answers.
pub mod image;
pub mod random;
pub mod shade;
pub mod traverse;
