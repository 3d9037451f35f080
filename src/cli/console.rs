//! Words on standard output and standard error.

use std::io::{self, ErrorKind, Write};

use super::{Failure, Outcome};

/// Prints results.
pub fn print(text: &str) -> Outcome {
    let mut out = io::stdout().lock();
    unless_unread(out.write_all(text.as_bytes()).and_then(|()| out.flush()))
}

/// What came of printing. A reader that has seen enough (`| head`) is no failure.
pub fn unless_unread(printed: io::Result<()>) -> Outcome {
    match printed {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Failure::Failed(format!("standard output: {e}"))),
        _ => Ok(()),
    }
}

/// Says one line on standard error, whatever line breaks are in it. Nobody is left to tell if that fails.
pub fn say(line: &str) {
    let line: Vec<&str> = line.lines().map(str::trim).filter(|l| !l.is_empty()).collect();
    writeln!(io::stderr().lock(), "{}", line.join(" ")).ok();
}

/// Says each of these once, as notes.
pub fn notes(notices: &[String]) {
    for notice in notices {
        say(&format!("note: {notice}"));
    }
}
