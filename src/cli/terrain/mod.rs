//! `progmesh terrain`: height grids.

mod breaklines;
mod build;
mod dress;
mod facts;
mod info;
pub(crate) mod input;
mod tile_report;
mod tiles;
mod tin;
mod tin_report;

use super::Failure;

/// Height grids: say what they hold, make triangles or progressive terrains of them.
///
/// Grids are GeoTIFF, HGT, ESRI ASCII, PNG (grey, Terrain-RGB or Terrarium) or raw samples.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand, Debug)]
enum Command {
    Info(info::Args),
    Tin(Box<tin::Args>),
    Build(Box<build::Args>),
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        match self.command {
            Command::Info(args) => args.run(),
            Command::Tin(args) => args.run(),
            Command::Build(args) => args.run(),
        }
    }
}
