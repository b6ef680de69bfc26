//! `--memory`: a progressive mesh that is read where views need it.

use super::Failure;
use super::args::Input;
use super::common::thousands;
use super::rule::RuleArgs;
use progmesh::io::files;
use progmesh::io::pm::{self, hoppe};
use progmesh::selective::PagedScene;
use serde::Serialize;
use std::path::Path;

/// What was read, and held: a part of the schema of `--json`.
#[derive(Clone, Copy, Serialize)]
pub(crate) struct Paging {
    /// None if there is none.
    limit_bytes: Option<usize>,
    /// The most that was held, of what was noted.
    most_bytes: usize,
    file_bytes: u64,
    bytes_read: u64,
    bytes_touched: u64,
    requests: u64,
    chunks: usize,
    chunks_touched: u64,
    chunks_decoded: u64,
    evictions: u64,
}

/// What the program takes itself: measured over Grand Canyon and ETOPO5 it is 5 to 7 MiB.
const PROGRAM: usize = 8 << 20;

/// What a grid's cache takes of a limit of so many MiB, in bytes: a quarter, but no more than it would take without a limit.
pub(crate) fn grid_cache(mib: usize) -> usize {
    mib.saturating_mul(1 << 18).clamp(1 << 20, 64 << 20)
}

/// A terrain's file of so many bytes is read where it is needed though nothing was said of memory. Of 235 MB (4,097 x 4,097 samples) 100 frames of the fast lemniscate then take 0.7 s and 176 MB instead of 15 s and 2.3 GB, and less time each; the
/// 6 MB of Grand Canyon are there in a tenth of a second, and the frames of a flight that then finds all of it take less.
const LARGE: u64 = 64 << 20;
/// MiB that are no limit: what is read then stays.
const NO_LIMIT: usize = 1 << 24;

/// How many MiB an input is read with of which nothing was said, if it is one that is read where it is needed.
pub(crate) fn unasked(input: &Input, rule: &RuleArgs) -> Option<usize> {
    of_terrain(input.progressive_path().filter(|_| rule.is_any())?, LARGE)
}

/// The same of the file of a terrain of at least so many bytes.
fn of_terrain(path: &Path, large: u64) -> Option<usize> {
    // What can be read but once is left for what reads it; what cannot be read at all that tells.
    let is_large = |m: std::fs::Metadata| m.is_file() && m.len() >= large;
    if files::is_dash(path) || !std::fs::metadata(path).is_ok_and(is_large) {
        return None;
    }
    pm::read_terrain(files::open(path).ok()?).map(|_| NO_LIMIT)
}

/// So many MiB are a limit, and one that was given.
pub(crate) fn is_limit(mib: usize) -> bool {
    mib < NO_LIMIT
}

/// Opens the input, with a limit of so many MiB for the process, of which other things take `beside` bytes.
pub(crate) fn open(input: &Input, mib: usize, beside: usize) -> Result<PagedScene, Failure> {
    let file = input.name();
    let Some(path) = input.progressive_path() else {
        return Err(Failure::Usage(format!(
            "{file}: --memory is for .pm files: write one first (progmesh encode {file} out.pm --paged)"
        )));
    };
    let source = files::open(path).map_err(|e| Failure::Input(format!("{file}: {e}")))?;
    let mut first = vec![0; source.length().min(4096) as usize];
    if source.read_at(0, &mut first).is_ok() && hoppe::looks_like(&first) {
        return Err(Failure::Input(format!(
            "{file}: a progressive mesh of Hoppe's, which has no pages: write one of ours first (progmesh encode {file} out.pm --paged)"
        )));
    }
    let taken = PROGRAM + beside;
    let limit = mib.saturating_mul(1 << 20).saturating_sub(taken);
    PagedScene::new(source, limit).map_err(|e| {
        let of = format!("--memory {mib} is {mib} MiB, of which {} are for other things", taken >> 20);
        Failure::Input(format!("{file}: {e} ({of})"))
    })
}

impl Paging {
    pub(crate) fn of(scene: &PagedScene, mib: usize, most_bytes: usize) -> Paging {
        let t = scene.traffic();
        Paging {
            limit_bytes: is_limit(mib).then(|| mib.saturating_mul(1 << 20)),
            most_bytes,
            file_bytes: scene.file_bytes(),
            bytes_read: t.bytes_read,
            bytes_touched: t.bytes_touched,
            requests: t.requests,
            chunks: scene.chunks(),
            chunks_touched: t.chunks_touched,
            chunks_decoded: t.chunks_decoded,
            evictions: t.evictions,
        }
    }

    /// For people.
    pub(crate) fn text(&self) -> String {
        let mib = |b: usize| b as f64 / (1 << 20) as f64;
        format!(
            "{} of {} bytes read ({:.1} % of the file; {} with what was read again), {} of {} chunks; {} decoded, {} let go; {:.1}{} MiB held at most",
            thousands(self.bytes_touched as usize),
            thousands(self.file_bytes as usize),
            100.0 * self.bytes_touched as f64 / (self.file_bytes.max(1)) as f64,
            thousands(self.bytes_read as usize),
            thousands(self.chunks_touched as usize),
            thousands(self.chunks),
            thousands(self.chunks_decoded as usize),
            thousands(self.evictions as usize),
            mib(self.most_bytes),
            self.limit_bytes.map_or(String::new(), |limit| format!(" of {:.1}", mib(limit)))
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use progmesh::blocks::{InMemory, Options, blocks};
    use progmesh::io::pm::{Terrain, write_terrain};
    use progmesh::refine::ProgressiveMesh;
    use progmesh::refine::format::{EncodeOptions, encode};
    use progmesh::terrain::{Grid, tin::Quiet};

    #[test]
    fn large_terrain_has_a_limit_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let grid = Grid::new(20, 20, (0..400).map(|k| f64::from(k * k % 37)).collect()).unwrap();
        let (options, store) = (Options::default(), InMemory::default());
        let made = blocks(&grid, &options, &store, &Quiet).unwrap();
        let terrain = Terrain { columns: 20, rows: 20, spacing: [1.0; 2], error: 0.0, cells: 128, levels: 1 };
        let mut bytes = vec![];
        write_terrain(&made.code().unwrap(), &terrain, Default::default(), &mut bytes).unwrap();
        let length = bytes.len() as u64;
        let file = dir.path().join("terrain.pm");
        std::fs::write(&file, &bytes).unwrap();
        assert_eq!((of_terrain(&file, length), of_terrain(&file, length + 1)), (Some(NO_LIMIT), None));
        // No terrain, no mesh, nothing.
        let other = dir.path().join("other.pm");
        for bytes in [
            encode(&[ProgressiveMesh::default()], &[], &[], &EncodeOptions::default()),
            Ok(bytes[..99].to_vec()),
        ] {
            std::fs::write(&other, bytes.unwrap()).unwrap();
            assert_eq!(of_terrain(&other, 1), None);
        }
        // Nor standard input, whatever it is, nor a folder.
        for none in [dir.path().join("none.pm"), dir.path().into(), "-".into()] {
            assert_eq!(of_terrain(&none, 0), None);
        }
    }
}
