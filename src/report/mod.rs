//! What is handed to the user, and read back: pictures, tables and JSON. No rendering knowledge.
//!
//! Every file is written under a temporary name in its own folder and renamed when it is whole: see [`mod@file`].

pub mod apng;
pub mod bench;
pub mod compare;
pub mod costs;
pub mod distribution;
pub mod file;
pub mod folder;
pub mod json;
pub mod openexr;
pub mod plot;
pub mod png;
pub mod statistics;
pub mod table;
pub mod tonemap;
pub mod trade;
