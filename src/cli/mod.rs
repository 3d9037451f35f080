//! The command line: one file a subcommand that parses, calls the library and prints.

mod arguments;
mod bench;
mod compare;
mod console;
mod info;
mod interrupt;
mod progress;
mod render;
mod reproduce;
mod samplers;
mod scenes;
mod settings;
mod trade;

use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::process::ExitCode;

use clap::{Parser, Subcommand, error::ErrorKind};

/// Temporally stable ray tracing on plain Vulkan compute.
#[derive(Debug, Parser)]
#[command(name = "stillray", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Render(render::Render),
    Bench(bench::Bench),
    Compare(compare::Compare),
    Info(info::Info),
    Settings(settings::Settings),
    Trade(trade::Trade),
    Reproduce(reproduce::Reproduce),
    Samplers(samplers::Samplers),
}

/// Why the program ends without having done what was asked.
#[derive(Debug)]
enum Failure {
    /// What was asked for makes no sense: exit code 2.
    Usage(String),
    /// It could not be done: exit code 1.
    Failed(String),
    /// The user stopped it: exit code 130, as the shell has it for SIGINT.
    Interrupted(String),
}

impl From<stillray::Error> for Failure {
    fn from(error: stillray::Error) -> Self {
        use stillray::Error::{Setting, SettingsFile, UnknownKnob};
        match error {
            Setting { .. } | UnknownKnob { .. } | SettingsFile { .. } => Self::Usage(error.to_string()),
            other => Self::Failed(other.to_string()),
        }
    }
}

/// Short for what a subcommand returns.
type Outcome<T = ()> = Result<T, Failure>;

/// Runs the program with these arguments, the first of which is its name.
pub fn run(arguments: impl Iterator<Item = OsString>) -> ExitCode {
    std::panic::set_hook(Box::new(report_panic));
    // A panic is a bug of this program. The hook has said so in one line; what is left is the exit code.
    let outcome = catch_unwind(AssertUnwindSafe(|| parse(arguments).and_then(dispatch)));
    match outcome {
        Ok(Ok(())) => ExitCode::SUCCESS,
        Ok(Err(Failure::Usage(message))) => fail("error", &message, 2),
        Ok(Err(Failure::Failed(message))) => fail("error", &message, 1),
        Ok(Err(Failure::Interrupted(message))) => fail("interrupted", &message, 130),
        Err(_) => ExitCode::from(1),
    }
}

fn dispatch(command: Option<Command>) -> Outcome {
    match command {
        Some(Command::Render(render)) => render.run(),
        Some(Command::Bench(bench)) => bench.run(),
        Some(Command::Compare(compare)) => compare.run(),
        Some(Command::Info(info)) => info.run(),
        Some(Command::Settings(settings)) => settings.run(),
        Some(Command::Trade(trade)) => trade.run(),
        Some(Command::Reproduce(reproduce)) => reproduce.run(),
        Some(Command::Samplers(samplers)) => samplers.run(),
        None => Ok(()),
    }
}

/// The command to run, or none if clap has answered already (`--help`, `--version`).
fn parse(arguments: impl Iterator<Item = OsString>) -> Outcome<Option<Command>> {
    match Cli::try_parse_from(arguments) {
        Ok(cli) => Ok(Some(cli.command)),
        Err(e) if matches!(e.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            console::unless_unread(e.print())?;
            Ok(None)
        }
        Err(e) if e.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => Err(Failure::Usage(
            "no command given: render, bench, compare, trade, reproduce, samplers, info or settings (see --help)"
                .to_owned(),
        )),
        Err(e) => Err(Failure::Usage(first_paragraph(&e.to_string()))),
    }
}

/// Clap's message without its headline and without the usage below it.
fn first_paragraph(message: &str) -> String {
    let ends = |l: &&str| l.starts_with("Usage:") || l.starts_with("For more information");
    let lines = message.lines().map(str::trim).take_while(|l| !ends(l)).filter(|l| !l.is_empty());
    let text = lines.collect::<Vec<_>>().join(" ");
    format!("{} (see --help)", text.trim_start_matches("error: ").replace(" tip: ", "; "))
}

fn fail(kind: &str, message: &str, code: u8) -> ExitCode {
    console::say(&format!("{kind}: {message}"));
    ExitCode::from(code)
}

fn report_panic(info: &PanicHookInfo) {
    let payload = info.payload();
    let text = payload.downcast_ref::<String>().map(String::as_str);
    let message = text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no message");
    let place = info.location().map_or_else(String::new, |l| format!(" at {}:{}", l.file(), l.line()));
    console::say(&format!("error: internal error{place}: {message}; this is a bug in stillray, please report it"));
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn clap_messages_become_one_line() {
        let long =
            "error: invalid value 'x' for '--spp <N>': no\n\n  tip: try 1\n\nUsage: a\n\nFor more information, b";
        assert_eq!(first_paragraph(long), "invalid value 'x' for '--spp <N>': no; try 1 (see --help)");
    }

    #[test]
    fn settings_are_usage_and_the_rest_fails() {
        let setting = stillray::Error::Setting { name: "a", value: "b".into(), expected: "c".into() };
        assert!(matches!(Failure::from(setting), Failure::Usage(_)));
        let io = stillray::Error::Io { path: "a".into(), cause: std::io::ErrorKind::NotFound.into() };
        assert!(matches!(Failure::from(io), Failure::Failed(_)));
    }
}
