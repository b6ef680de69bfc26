//! `progmesh man DIR`.

use super::{Cli, Failure};
use clap::{Arg, ArgAction, CommandFactory};
use progmesh::io::files;
use std::path::{Path, PathBuf};

/// Write man pages, one a subcommand, into a directory.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example:\n  progmesh man ~/.local/share/man/man1")]
pub(crate) struct Args {
    /// The directory; made if need be
    #[arg(value_name = "DIR")]
    directory: PathBuf,
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        std::fs::create_dir_all(&self.directory)
            .map_err(|e| Failure::Output(format!("{}: {e}", self.directory.display())))?;
        let mut command = Cli::command();
        // Fills in the full names of subcommands (`progmesh simplify`).
        command.build();
        page(&self.directory, "progmesh", &command)?;
        for sub in command.get_subcommands().filter(|s| s.get_name() != "help") {
            page(&self.directory, &format!("progmesh-{}", sub.get_name()), sub)?;
        }
        Ok(())
    }
}

const SOURCE: &str = concat!("progmesh ", env!("CARGO_PKG_VERSION"));

fn page(directory: &Path, name: &str, command: &clap::Command) -> Result<(), Failure> {
    let path = directory.join(format!("{name}.1"));
    let failed = |e: std::io::Error| Failure::Output(format!("{}: {e}", path.display()));
    let mut text = Vec::new();
    let mut command = command.clone();
    if !command.has_subcommands() {
        let usage = synopsis(&command);
        command = command.override_usage(usage);
    }
    clap_mangen::Man::new(command).title(name).source(SOURCE).render(&mut text).map_err(failed)?;
    files::write_file(&path, &text).map_err(failed)
}

/// One line with all flags and their values: the crate's own synopsis leaves the values out.
fn synopsis(command: &clap::Command) -> String {
    let mut parts = vec![command.get_bin_name().unwrap_or(command.get_name()).to_string()];
    let shown = |a: &&Arg| !a.is_hide_set() && !matches!(a.get_id().as_str(), "help" | "version");
    for option in command.get_opts().filter(shown) {
        let Some(long) = option.get_long() else { continue };
        let value = value_of(option);
        let text = match (option.is_require_equals_set(), value.as_str()) {
            (_, "") => format!("--{long}"),
            (true, value) => format!("--{long}[={value}]"),
            (false, value) => format!("--{long} {value}"),
        };
        let more = if matches!(option.get_action(), ArgAction::Append) { "..." } else { "" };
        parts.push(if option.is_required_set() { text } else { format!("[{text}]{more}") });
    }
    for flag in command.get_arguments().filter(|a| !a.is_positional() && !takes_value(a)).filter(shown) {
        parts.extend(flag.get_long().map(|long| format!("[--{long}]")));
    }
    for place in command.get_positionals() {
        let value = value_of(place);
        parts.push(if place.is_required_set() { value } else { format!("[{value}]") });
    }
    parts.join(" ")
}

fn takes_value(argument: &Arg) -> bool {
    argument.get_action().takes_values()
}

/// The choices there are, or the value's name.
fn value_of(argument: &Arg) -> String {
    let choices: Vec<_> = argument.get_possible_values();
    let names: Vec<&str> = choices.iter().map(|v| v.get_name()).collect();
    match argument.get_value_names() {
        _ if !takes_value(argument) => String::new(),
        _ if !names.is_empty() => names.join("|"),
        Some(names) => names.iter().map(|n| n.as_str()).collect::<Vec<_>>().join(" "),
        None => argument.get_id().as_str().to_uppercase(),
    }
}
