//! Progress as the user sees it: a bar on a terminal, a line now and then in a log, nothing if asked for quiet.

use std::io::{self, IsTerminal};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use stillray::progress::{Progress, Quiet};

use super::console;

/// Time between two lines in a log.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// What suits standard error.
pub fn for_user(quiet: bool) -> Box<dyn Progress> {
    if quiet {
        Box::new(Quiet)
    } else if io::stderr().is_terminal() {
        Box::new(Bar { bar: Mutex::new(ProgressBar::hidden()) })
    } else {
        Box::new(Lines { state: Mutex::new(State::new()) })
    }
}

/// A bar that is removed when its stage is done.
struct Bar {
    bar: Mutex<ProgressBar>,
}

impl Progress for Bar {
    fn begin(&self, stage: &str, steps: u64) {
        let bar = ProgressBar::with_draw_target(Some(steps), ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template("{msg:<36} {bar:30} {human_pos}/{human_len} {eta:>4} left");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(stage.to_owned());
        bar.tick();
        *locked(&self.bar) = bar;
    }

    fn advance(&self, steps: u64) {
        locked(&self.bar).inc(steps);
    }

    fn finish(&self) {
        locked(&self.bar).finish_and_clear();
    }
}

impl Drop for Bar {
    /// What ends in the middle of a stage has something to say, on a line of its own.
    fn drop(&mut self) {
        locked(&self.bar).finish_and_clear();
    }
}

/// Lines for those who read logs: none for what is quick.
struct Lines {
    state: Mutex<State>,
}

struct State {
    stage: String,
    done: u64,
    steps: u64,
    said: Instant,
}

impl State {
    fn new() -> Self {
        Self { stage: String::new(), done: 0, steps: 0, said: Instant::now() }
    }
}

impl Progress for Lines {
    fn begin(&self, stage: &str, steps: u64) {
        let mut state = locked(&self.state);
        *state = State { stage: stage.to_owned(), done: 0, steps, said: state.said };
    }

    fn advance(&self, steps: u64) {
        let mut state = locked(&self.state);
        state.done += steps;
        if state.said.elapsed() >= LINE_EVERY {
            state.said = Instant::now();
            console::say(&format!("{}: {} of {}", state.stage, state.done, state.steps));
        }
    }

    fn finish(&self) {}
}

/// A panicking thread leaves a count behind, not a broken one.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
