//! The same phases on the CPU, in f64 where it matters: the known answers.
pub mod analyze;
pub mod aov;
pub mod bounded;
pub mod camera;
pub mod gather;
pub mod generate;
pub mod random;
pub mod reconstruct;
pub mod reproject;
pub mod retain;
pub mod scan;
pub mod shade;
pub mod shadow;
pub mod stage;
pub mod traverse;
pub mod triangle;
pub mod verify;
