//! `progmesh man DIR`.

use super::{Cli, Failure};
use clap::CommandFactory;
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

fn page(directory: &Path, name: &str, command: &clap::Command) -> Result<(), Failure> {
    let path = directory.join(format!("{name}.1"));
    let failed = |e: std::io::Error| Failure::Output(format!("{}: {e}", path.display()));
    let mut text = Vec::new();
    clap_mangen::Man::new(command.clone()).title(name).render(&mut text).map_err(failed)?;
    files::write_file(&path, &text).map_err(failed)
}
