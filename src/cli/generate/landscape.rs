//! `progmesh generate terrain`: a landscape of any size, as a grid or a mesh.

use crate::cli::Failure;
use crate::cli::common::thousands;
use crate::cli::control::Interrupt;
use progmesh::io::files;
use progmesh::io::grid::GridFormat;
use progmesh::io::grid::write::{self, GridHead, WriteGridError};
use progmesh::meshes::{LANDSCAPE_SIDE, Landscape, MAX_FACES, Sample, sheet};
use progmesh::terrain::{Affine, Crs, CrsKind, Georeference, SampleAt};
use std::io::ErrorKind;
use std::path::Path;

/// Samples along the side of a grid, if none are asked for.
pub(super) const DEFAULT_SIZE: usize = 1025;
/// The most samples along a side: 4 GiSamples, 16 GiB as f32.
const MOST: usize = 65_537;

/// The grid format that a name promises.
pub(super) fn format(path: &Path) -> Option<GridFormat> {
    GridFormat::from_name(&path.to_string_lossy())
}

fn check(size: usize, most: usize) -> Result<(), Failure> {
    if (2..=most).contains(&size) {
        return Ok(());
    }
    Err(Failure::Usage(format!(
        "--size {}: a terrain has 2 to {} samples along a side here",
        thousands(size),
        thousands(most)
    )))
}

/// The landscape as a mesh: x and y in metres from the lower left sample, z the height; two triangles a cell.
pub(super) fn mesh(size: usize, seed: u64) -> Result<Sample, Failure> {
    check(size, (MAX_FACES / 2).isqrt() + 1)?;
    let step = LANDSCAPE_SIDE / (size - 1) as f64;
    Ok(sheet(size, step, &Landscape::new(size, seed).heights()))
}

/// Writes the landscape as a grid, row after row, and returns its range.
pub(super) fn write(path: &Path, format: GridFormat, size: usize, seed: u64) -> Result<[f64; 2], Failure> {
    check(size, MOST)?;
    let step = LANDSCAPE_SIDE / (size - 1) as f64;
    let georeference = Georeference {
        transform: Some(Affine::north_up([0.0, LANDSCAPE_SIDE], [step; 2])),
        sample_at: SampleAt::Point,
        crs: Some(Crs {
            kind: CrsKind::Projected { metres: 1.0 },
            name: Some("a plane of no place".into()),
            ..Default::default()
        }),
    };
    let interrupt = Interrupt::watch();
    interrupt.be_graceful();
    let mut landscape = Landscape::new(size, seed);
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    let head = GridHead { columns: size, rows: size, georeference: &georeference };
    let mut row = |r: usize, out: &mut [f64]| {
        if interrupt.is_set() {
            return Err(ErrorKind::Other.into());
        }
        landscape.row(r, out);
        let [least, greatest] = &mut range;
        (*least, *greatest) = out.iter().fold((*least, *greatest), |(l, g), &h| (l.min(h), g.max(h)));
        Ok(())
    };
    files::write_with(path, |out| write::write(format, &head, &mut row, out)).map_err(|e| match e {
        _ if interrupt.is_set() => Failure::Interrupted,
        WriteGridError::Io(e) if e.kind() == ErrorKind::BrokenPipe => Failure::BrokenPipe,
        e => Failure::Output(format!("{}: {e}", path.display())),
    })?;
    Ok(range)
}
