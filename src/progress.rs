//! How long work tells that it goes on. The library knows no terminal: it reports to whoever listens.

/// Receives the progress of one piece of work. Called from several threads.
pub trait Progress: Sync {
    /// A stage begins, with the number of its steps.
    fn begin(&self, stage: &str, steps: u64);
    /// Some steps of the current stage are done.
    fn advance(&self, steps: u64);
    /// The current stage is done.
    fn finish(&self);
}

/// Listens to nothing.
#[derive(Debug, Default, Clone, Copy)]
pub struct Quiet;

impl Progress for Quiet {
    fn begin(&self, _stage: &str, _steps: u64) {}
    fn advance(&self, _steps: u64) {}
    fn finish(&self) {}
}
