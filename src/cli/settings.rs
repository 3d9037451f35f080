//! `stillray settings`: every knob, as a settings file.

use std::path::PathBuf;

use clap::Args;
use stillray::report::file;
use stillray::settings::file as settings_file;

use super::arguments::Tuning;
use super::{Outcome, console};

/// Print every knob with its meaning, range and value, in the form of a settings file
#[derive(Debug, Args)]
pub struct Settings {
    #[command(flatten)]
    tuning: Tuning,
    /// Write the file here instead of printing it
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

impl Settings {
    /// Prints or writes.
    pub fn run(self) -> Outcome {
        let mut settings = self.tuning.base()?;
        self.tuning.assign(&mut settings)?;
        let text = settings_file::text(&settings);
        match &self.out {
            Some(path) => Ok(file::write_text(path, &text)?),
            None => console::print(&text),
        }
    }
}
