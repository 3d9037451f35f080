//! A method is an ordered list of phases; the barriers between them follow from what each reads and writes.

pub mod constants;
pub mod plan;
pub mod storage;
