//! `GRID` and the flags that say how to read it.

use crate::cli::Failure;
use crate::cli::common::{self, Warnings, short, thousands};
use clap::ValueEnum;
use progmesh::io::files::{self, OpenGridError};
use progmesh::io::grid::{
    self, ByteOrder, Encoding, GridError, GridFile, GridFormat, GridOptions, SampleType,
};
use progmesh::terrain::{Grid, RasterError};
use std::path::{Path, PathBuf};

/// `GRID` and how to read it.
#[derive(clap::Args, Debug)]
pub(crate) struct GridInput {
    /// The height grid to read, or several of one spacing that lie beside each other; - for standard input
    #[arg(value_name = "GRID", required = true, num_args = 1..)]
    grids: Vec<PathBuf>,
    /// Format of GRID, instead of what its first bytes or its name say
    #[arg(long, value_enum, value_name = "FORMAT", help_heading = "Grid")]
    from: Option<GridFormatName>,
    /// Columns and rows of raw samples (of HGT too, if it is no square)
    #[arg(long, value_name = "WxH", value_parser = size, help_heading = "Grid")]
    size: Option<[usize; 2]>,
    /// Type of raw samples: u8, i8, u16, i16, u32, i32, f32 or f64; big-endian with `be` behind it
    #[arg(long = "type", value_name = "TYPE", value_parser = sample_type, help_heading = "Grid")]
    sample: Option<(SampleType, ByteOrder)>,
    /// How the colours of a PNG stand for heights [default: terrain-rgb for colours, plain for grey]
    #[arg(long, value_enum, value_name = "CODE", help_heading = "Grid")]
    encoding: Option<EncodingName>,
    /// The height that means no data, instead of the file's own
    #[arg(long, value_name = "V", allow_negative_numbers = true, help_heading = "Grid")]
    nodata: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum GridFormatName {
    Tiff,
    Hgt,
    Ascii,
    Png,
    Raw,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum EncodingName {
    Plain,
    TerrainRgb,
    Terrarium,
}

/// `4320x2161`.
fn size(text: &str) -> Result<[usize; 2], String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("must be columns x rows, such as 4320x2161")?;
    let side = |t: &str| match t.parse::<usize>() {
        Ok(n) if (1..=u32::MAX as usize).contains(&n) => Ok(n),
        _ => Err("must be two whole numbers, 1 or more, such as 4320x2161".to_string()),
    };
    Ok([side(width)?, side(height)?])
}

/// `i16`, `f32be`.
fn sample_type(text: &str) -> Result<(SampleType, ByteOrder), String> {
    let (name, order) = match (text.strip_suffix("be"), text.strip_suffix("le")) {
        (Some(name), _) => (name, ByteOrder::Big),
        (_, name) => (name.unwrap_or(text), ByteOrder::Little),
    };
    let sample = SampleType::ALL.into_iter().find(|t| t.name() == name);
    sample.map(|s| (s, order)).ok_or_else(|| {
        "must be u8, i8, u16, i16, u32, i32, f32 or f64, with `be` behind it if big-endian".into()
    })
}

/// The most samples that are held at once: 8 GiB.
const MOST_SAMPLES: usize = 1 << 30;

impl GridInput {
    /// Its name, for messages.
    pub(crate) fn name(&self) -> String {
        let name = |p: &PathBuf| common::name(p, "standard input");
        match &self.grids[..] {
            [] => String::new(),
            [one] => name(one),
            [first, others @ ..] => format!("{} and {} more", name(first), others.len()),
        }
    }

    fn options(&self) -> GridOptions {
        let mut options = GridOptions::default();
        options.format = self.from.map(|f| match f {
            GridFormatName::Tiff => GridFormat::Tiff,
            GridFormatName::Hgt => GridFormat::Hgt,
            GridFormatName::Ascii => GridFormat::Ascii,
            GridFormatName::Png => GridFormat::Png,
            GridFormatName::Raw => GridFormat::Raw,
        });
        // A type makes sense for raw samples only, whatever the name says.
        if self.from.is_none() && self.sample.is_some() {
            options.format = Some(GridFormat::Raw);
        }
        options.encoding = self.encoding.map(|e| match e {
            EncodingName::Plain => Encoding::Plain,
            EncodingName::TerrainRgb => Encoding::TerrainRgb,
            EncodingName::Terrarium => Encoding::Terrarium,
        });
        (options.size, options.sample, options.nodata) = (self.size, self.sample, self.nodata);
        options
    }

    /// What tells it from another grid, or from itself after a change, as far as names, sizes and times do.
    pub(crate) fn identity(&self) -> Result<String, Failure> {
        let of = |p: &PathBuf| {
            let failed = |e| Failure::Input(format!("{}: {e}", common::name(p, "standard input")));
            files::identity(p).map_err(failed)
        };
        let files: Vec<String> = self.grids.iter().map(of).collect::<Result<_, _>>()?;
        let (size, sample, encoding, nodata) = (self.size, self.sample, self.encoding, self.nodata);
        Ok(format!("{files:?} {:?} {size:?} {sample:?} {encoding:?} {nodata:?}", self.from))
    }

    /// Opens it: what it says about itself is read, and its heights when asked for.
    pub(crate) fn open(&self, warnings: &mut Warnings) -> Result<GridFile, Failure> {
        // All files share the options' cache.
        let options = self.options();
        let mut files = vec![];
        for path in &self.grids {
            let file = common::name(path, "standard input");
            let grid = files::open_grid(path, &options).map_err(|e| unopened(&file, &e))?;
            files.push((file, grid));
        }
        if let [(file, grid)] = &mut files[..] {
            grid.warnings.iter_mut().for_each(|w| *w = format!("{file}: {w}"));
        }
        let grid = grid::mosaic(files).map_err(|e| Failure::Input(e.to_string()))?;
        warnings.say(grid.warnings.iter().cloned());
        Ok(grid)
    }
}

/// Opens one grid whose format its bytes or its name tell, with a cache of so many bytes if that is said.
pub(crate) fn open_plain(
    path: &Path,
    cache: Option<usize>,
    warnings: &mut Warnings,
) -> Result<GridFile, Failure> {
    let file = common::name(path, "standard input");
    let mut options = GridOptions::default();
    if let Some(bytes) = cache {
        options = options.with_cache(bytes);
    }
    let grid = files::open_grid(path, &options).map_err(|e| unopened(&file, &e))?;
    warnings.say(grid.warnings.iter().map(|w| format!("{file}: {w}")));
    Ok(grid)
}

/// Lengths of a step in metres, or in whatever unit the grid has.
pub(crate) fn known_spacing(source: &GridFile) -> Option<[f64; 2]> {
    let place = &source.georeference;
    place.spacing_metres(source.raster.columns(), source.raster.rows()).or_else(|| place.spacing())
}

fn unopened(file: &str, e: &OpenGridError) -> Failure {
    match e {
        OpenGridError::Grid(GridError::UnknownFormat) => Failure::Usage(format!(
            "{file}: neither its first bytes nor its name tell the format; say it with --from tiff|hgt|ascii|png|raw"
        )),
        OpenGridError::Grid(GridError::RawNeedsSize) => Failure::Usage(format!(
            "{file}: raw samples need --size and --type, such as --size 1024x1024 --type u16"
        )),
        e => Failure::Input(format!("{file}: {e}")),
    }
}

/// An error of reading heights; it names the file already.
pub(crate) fn unread(e: RasterError) -> Failure {
    Failure::Input(e.to_string())
}

/// Bytes that a sample takes at least while networks are made of a grid.
const SAMPLE_BYTES: u64 = 20;

/// Fails if a grid does not fit into memory with what is made of it.
fn check_memory(name: &str, [columns, rows]: [usize; 2], free: Option<u64>) -> Result<(), Failure> {
    let needed = (columns as u64).saturating_mul(rows as u64).saturating_mul(SAMPLE_BYTES);
    let Some(free) = free.filter(|&free| free < needed) else { return Ok(()) };
    let gigabytes = |bytes: u64| short(bytes as f64 / 1e9);
    Err(Failure::Input(format!(
        "{name}: one network of {} x {} samples takes {} GB of memory or more, and {} are free. `progmesh terrain build --floor E` reads a grid of any size window by window, and `progmesh decode` makes the \
         triangles of what it writes",
        thousands(columns),
        thousands(rows),
        gigabytes(needed),
        gigabytes(free)
    )))
}

/// All heights of a grid at once, to make networks of.
pub(crate) fn whole(name: &str, grid: &GridFile) -> Result<Grid, Failure> {
    check_memory(name, [grid.raster.columns(), grid.raster.rows()], files::free_bytes())?;
    grid.raster.whole(MOST_SAMPLES).map_err(|e| match e {
        RasterError::TooMany { columns, rows, limit } => Failure::Input(format!(
            "{name}: {} x {} samples are more than the {} that are held at once",
            thousands(columns),
            thousands(rows),
            thousands(limit)
        )),
        e => unread(e),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_that_memory_cannot_hold_is_refused_with_what_to_do() {
        let check = |size, free| {
            check_memory("a.tif", size, free).map_err(|e| e.message().unwrap_or_default().to_string())
        };
        assert_eq!(check([1000, 1000], Some(20_000_000)), Ok(()));
        assert_eq!(check([usize::MAX, 9], None), Ok(()), "where nobody knows");
        let said = check([20_000, 20_000], Some(2_000_000_000)).unwrap_err();
        assert!(said.starts_with("a.tif: one network of 20,000 x 20,000 samples takes 8 GB"), "{said}");
        assert!(said.contains("and 2 are free") && said.contains("terrain build --floor E"), "{said}");
    }

    #[test]
    fn sizes_and_types_are_read_as_written() {
        assert_eq!(size("4320x2161"), Ok([4320, 2161]));
        for bad in ["4320", "0x1", "1x-1", "1x1x1", "x", "1e3x5", "99999999999x1"] {
            assert!(size(bad).is_err(), "{bad}");
        }
        assert_eq!(sample_type("i16be"), Ok((SampleType::I16, ByteOrder::Big)));
        assert_eq!(sample_type("f32"), Ok((SampleType::F32, ByteOrder::Little)));
        assert_eq!(sample_type("u8le"), Ok((SampleType::U8, ByteOrder::Little)));
        assert!(sample_type("i24").is_err() && sample_type("be").is_err() && sample_type("").is_err());
    }
}
