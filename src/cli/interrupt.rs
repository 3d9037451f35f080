//! Ctrl-C: the frame being written is finished, and no half file is left.

use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::console;

/// Whether there are frames to be finished.
static RENDERING: AtomicBool = AtomicBool::new(false);
static REQUESTED: AtomicBool = AtomicBool::new(false);
/// Held while a file is being written.
static WRITING: Mutex<()> = Mutex::new(());

/// From here on the first Ctrl-C only asks to stop; a second one stops at once, but for a file being written.
pub fn begin_rendering() {
    RENDERING.store(true, Ordering::SeqCst);
}

/// Whether the user has asked to stop.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}

/// Runs `write`, which nothing but the end of the machine stops in its middle.
pub fn uninterrupted<T>(write: impl FnOnce() -> T) -> T {
    let _held = lock();
    write()
}

/// Listens to Ctrl-C, SIGTERM and SIGHUP. Where that is not possible, the system's default stays.
pub fn listen() {
    let heard = || {
        let again = REQUESTED.swap(true, Ordering::SeqCst);
        if RENDERING.load(Ordering::SeqCst) && !again {
            console::say("stopping after this frame (Ctrl-C again to stop at once)");
            return;
        }
        let _held = lock();
        console::say("interrupted");
        process::exit(130);
    };
    if let Err(e) = ctrlc::set_handler(heard) {
        console::say(&format!("note: Ctrl-C stops at once, and may leave a temporary file: {e}"));
    }
}

fn lock() -> MutexGuard<'static, ()> {
    WRITING.lock().unwrap_or_else(PoisonError::into_inner)
}
