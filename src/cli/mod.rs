//! The command line: one definition of the flags (for parsing, help, completions and man pages), one file a subcommand.
//!
//! Messages go to standard error and name the file; standard output is for what was asked for. Exit codes: 0 done, 1 done but the
//! target was missed (or a check failed), 2 usage, 3 input unreadable or invalid, 4 output failed, 130 interrupted.

mod args;
mod camera;
mod clip;
mod common;
mod compare;
mod completions;
mod control;
mod convert;
mod cull;
mod decode;
mod encode;
mod ending;
mod extract;
mod fly;
mod generate;
mod heatmap;
mod info;
mod levels;
mod lod;
mod man;
mod method;
mod morph;
mod paging;
mod picture;
mod problems;
mod rule;
mod simplify;
mod terrain;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Simplify, inspect, compare, convert and generate polygon meshes: OBJ, glTF, PLY, STL, OFF.
#[derive(Parser)]
#[command(name = "progmesh", version, max_term_width = 100, after_help = EXIT_CODES, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const EXIT_CODES: &str = "\
Exit codes: 0 done; 1 done, but the target was missed or a check failed; 2 wrong usage; 3 input unreadable or invalid; \
4 output failed; 130 interrupted.";

#[derive(Subcommand)]
enum Command {
    Simplify(Box<simplify::Args>),
    Info(info::Args),
    Levels(levels::Args),
    Encode(Box<encode::Args>),
    Decode(decode::Args),
    Lod(Box<lod::Args>),
    Morph(morph::Args),
    Extract(Box<extract::Args>),
    Fly(Box<fly::Args>),
    Compare(compare::Args),
    Convert(convert::Args),
    Clip(Box<clip::Args>),
    Cull(cull::Args),
    Generate(generate::Args),
    Terrain(Box<terrain::Args>),
    Completions(completions::Args),
    Man(man::Args),
}

/// Why a command does not end with 0. The text is for people, with the file's name where it is about one.
#[derive(Debug)]
enum Failure {
    /// Done, but not all that was asked for.
    Missed(String),
    Usage(String),
    Input(String),
    Output(String),
    Interrupted,
    /// Whoever read our output has gone away: no failure.
    BrokenPipe,
}

impl Failure {
    fn code(&self) -> u8 {
        match self {
            Failure::BrokenPipe => 0,
            Failure::Missed(_) => 1,
            Failure::Usage(_) => 2,
            Failure::Input(_) => 3,
            Failure::Output(_) => 4,
            Failure::Interrupted => 130,
        }
    }

    fn message(&self) -> Option<&str> {
        match self {
            Failure::Missed(m) | Failure::Usage(m) | Failure::Input(m) | Failure::Output(m) => Some(m),
            Failure::Interrupted => Some("interrupted; nothing was written"),
            Failure::BrokenPipe => None,
        }
    }
}

/// `--weld 0.1` reads like a value, but means `--weld` and a stray `0.1`.
fn weld_tip(e: &clap::Error) {
    use clap::error::{ContextKind, ContextValue, ErrorKind};
    let Some(ContextValue::String(stray)) = e.get(ContextKind::InvalidArg) else { return };
    let arguments: Vec<_> = std::env::args_os().collect();
    let follows = arguments.windows(2).any(|w| w[0] == "--weld" && w[1] == stray.as_str());
    if e.kind() == ErrorKind::UnknownArgument && follows {
        common::note(&format!("\nA distance follows --weld after an equals sign: --weld={stray}"));
    }
}

/// Runs the command that the process was started with.
pub(crate) fn main() -> ExitCode {
    let command = match Cli::try_parse() {
        Ok(cli) => cli.command,
        Err(e) => {
            // Help and version too; a reader that has gone away is no fault.
            let _ = e.print();
            weld_tip(&e);
            return ExitCode::from(u8::try_from(e.exit_code()).unwrap_or(2));
        }
    };
    let result = match command {
        Command::Simplify(args) => args.run(),
        Command::Info(args) => args.run(),
        Command::Levels(args) => args.run(),
        Command::Encode(args) => args.run(),
        Command::Decode(args) => args.run(),
        Command::Lod(args) => args.run(),
        Command::Morph(args) => args.run(),
        Command::Extract(args) => args.run(),
        Command::Fly(args) => args.run(),
        Command::Compare(args) => args.run(),
        Command::Convert(args) => args.run(),
        Command::Clip(args) => args.run(),
        Command::Cull(args) => args.run(),
        Command::Generate(args) => args.run(),
        Command::Terrain(args) => args.run(),
        Command::Completions(args) => args.run(),
        Command::Man(args) => args.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if let Some(message) = failure.message() {
                common::print_error(message);
            }
            ExitCode::from(failure.code())
        }
    }
}
