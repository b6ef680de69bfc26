//! `progmesh completions SHELL`.

use super::{Cli, Failure, common};
use clap::CommandFactory;
use clap_complete::Shell;

/// Print a completion script for a shell.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example:\n  progmesh completions bash > /etc/bash_completion.d/progmesh")]
pub(crate) struct Args {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "progmesh", &mut script);
        common::print(&String::from_utf8_lossy(&script))
    }
}
