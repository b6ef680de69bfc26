//! How the samples of an image lie in its file.

use super::super::source::ReadAt;
use super::super::{ByteOrder, DecodeError, SampleType};
use super::directory::Directory;

/// How chunks are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Compression {
    None,
    Lzw,
    Deflate,
    PackBits,
}

/// What was done to a row before it was packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Predictor {
    None,
    /// Differences of samples, as whole numbers.
    Horizontal,
    /// Differences of the bytes of floating-point numbers, the most significant of all first.
    FloatingPoint,
}

/// One band of an image, in chunks (strips or tiles).
pub(super) struct Layout {
    pub(super) columns: usize,
    pub(super) rows: usize,
    pub(super) sample: SampleType,
    pub(super) order: ByteOrder,
    /// Bands of a sample.
    pub(super) bands: usize,
    /// Bands that lie between one another in a chunk: all, or 1 where each has its own chunks.
    pub(super) interleaved: usize,
    pub(super) compression: Compression,
    pub(super) predictor: Predictor,
    pub(super) tiled: bool,
    /// Columns and rows of a chunk.
    pub(super) chunk: [usize; 2],
    /// Columns and rows of what is decoded at once: a chunk, or some rows of a strip that is not packed.
    pub(super) block: [usize; 2],
    pub(super) offsets: Vec<u64>,
    pub(super) counts: Vec<u64>,
}

/// The most bytes, and samples, of what is decoded at once: half a gigabyte as f64.
const MOST_BYTES: usize = 512 << 20;
const MOST_SAMPLES: usize = MOST_BYTES / 8;
/// Samples of a large strip without packing that are read at once.
const STRIP_PART: usize = 1 << 18;
/// How many bytes one packed byte can become at most: LZW reaches 2560, Deflate 1032.
const MOST_FROM_ONE: u64 = 2600;

fn wrong(element: &str, what: impl Into<String>) -> DecodeError {
    DecodeError::Element { element: element.into(), what: what.into() }
}

impl Layout {
    /// Reads and checks the tags. Memory: 16 bytes for each chunk that the file has a table entry for.
    pub(super) fn of(directory: &Directory, source: &dyn ReadAt) -> Result<Layout, DecodeError> {
        let whole = |tag, absent| directory.whole(source, tag, absent);
        let (columns, rows) = (size("width", whole(256, 0)?)?, size("height", whole(257, 0)?)?);
        let bands = size("bands", whole(277, 1)?)?;
        if bands > 65_535 {
            return Err(wrong("bands", format!("{bands} announced")));
        }
        let sample = sample_type(whole(258, 1)?, whole(339, 1)?)?;
        let compression = compression(whole(259, 1)?)?;
        let predictor = predictor(whole(317, 1)?, sample)?;
        let interleaved = match whole(284, 1)? {
            1 => bands,
            2 => 1,
            n => return Err(wrong("planar configuration", format!("{n}; it must be 1 or 2"))),
        };
        let tiled = directory.has(322) || directory.has(324);
        let (chunk, tables) = match tiled {
            true => ([size("tile width", whole(322, 0)?)?, size("tile height", whole(323, 0)?)?], (324, 325)),
            // Many writers say 2^32 - 1 for "all rows".
            false => ([columns, size("rows of a strip", whole(278, rows as u64)?)?.min(rows)], (273, 279)),
        };
        let too_large =
            || wrong(if tiled { "tile size" } else { "strip size" }, "more bytes than can be held");
        let row = chunk[0].checked_mul(interleaved).and_then(|n| n.checked_mul(sample.bytes()));
        let bytes = row.and_then(|r| r.checked_mul(chunk[1])).ok_or_else(too_large)?;
        let chunks = columns.div_ceil(chunk[0]).checked_mul(rows.div_ceil(chunk[1])).ok_or_else(too_large)?;
        let offsets = directory.wholes(source, tables.0)?;
        let mut counts = directory.wholes(source, tables.1)?;
        if counts.is_empty() && compression == Compression::None {
            counts = vec![bytes as u64; offsets.len()];
        }
        if offsets.len() < chunks || counts.len() < chunks {
            let (what, n) = (if tiled { "tiles" } else { "strips" }, offsets.len().min(counts.len()));
            return Err(wrong(what, format!("{columns} x {rows} samples need {chunks}; the file lists {n}")));
        }
        let layout = Layout {
            columns,
            rows,
            sample,
            order: directory.order,
            bands,
            interleaved,
            compression,
            predictor,
            tiled,
            chunk,
            block: block(chunk, compression, tiled),
            offsets,
            counts,
        };
        layout.check_sizes(bytes)?;
        Ok(layout)
    }

    /// Fails where chunks announce more than they can hold, so that nothing large is allocated for little.
    fn check_sizes(&self, bytes: usize) -> Result<(), DecodeError> {
        let [columns, rows] = self.block;
        let samples = columns.saturating_mul(rows);
        if samples > MOST_SAMPLES
            || samples.saturating_mul(self.interleaved * self.sample.bytes()) > MOST_BYTES
        {
            return Err(self.too_large(bytes));
        }
        if self.compression == Compression::None {
            // What is read is held against the file's length, then and there.
            return Ok(());
        }
        let largest = self.counts.iter().copied().max().unwrap_or(0);
        if largest == 0 {
            return Ok(());
        }
        let possible = largest.saturating_mul(MOST_FROM_ONE);
        if bytes as u64 > possible {
            let what = format!("{bytes} bytes announced, in at most {largest} packed");
            return Err(wrong(if self.tiled { "tile size" } else { "strip size" }, what));
        }
        Ok(())
    }

    fn too_large(&self, bytes: usize) -> DecodeError {
        let (one, limit) = (if self.tiled { "tile" } else { "strip" }, MOST_BYTES >> 20);
        wrong(
            &format!("{one} size"),
            format!(
                "a {one} of {bytes} bytes; at most {limit} MiB as f64 are read at once: write it anew in small tiles"
            ),
        )
    }

    /// Blocks from left to right.
    pub(super) fn across(&self) -> usize {
        self.columns.div_ceil(self.block[0])
    }

    /// The chunk that holds a sample.
    pub(super) fn chunk_of(&self, column: usize, row: usize) -> usize {
        row / self.chunk[1] * self.columns.div_ceil(self.chunk[0]) + column / self.chunk[0]
    }

    /// Bytes of a row of a chunk.
    pub(super) fn row_bytes(&self) -> usize {
        self.chunk[0] * self.interleaved * self.sample.bytes()
    }

    /// One line for people.
    pub(super) fn about(&self, big: bool) -> String {
        let format = if big { "BigTIFF" } else { "TIFF" };
        let chunks = match (self.tiled, self.chunk) {
            (true, [w, h]) => format!("tiles of {w} x {h}"),
            (false, [_, 1]) => "strips of 1 row".into(),
            (false, [_, h]) => format!("strips of {h} rows"),
        };
        let packing = match self.compression {
            Compression::None => "not packed",
            Compression::Lzw => "LZW",
            Compression::Deflate => "deflate",
            Compression::PackBits => "PackBits",
        };
        let predictor = match self.predictor {
            Predictor::None => "",
            Predictor::Horizontal => ", predictor 2",
            Predictor::FloatingPoint => ", predictor 3",
        };
        format!("{format}, {chunks}, {packing}{predictor}")
    }
}

/// Some rows of a large strip that is not packed; otherwise a chunk.
fn block(chunk: [usize; 2], compression: Compression, tiled: bool) -> [usize; 2] {
    let [columns, rows] = chunk;
    if tiled || compression != Compression::None || columns.saturating_mul(rows) <= STRIP_PART {
        return chunk;
    }
    // A divisor of the strip's rows, so that no block reaches over its end.
    let most = (STRIP_PART / columns).max(1);
    let fit = (1..=most.min(rows)).rev().find(|n| rows.is_multiple_of(*n)).unwrap_or(1);
    [columns, fit]
}

/// A size that a raster can have: 1 to 2^32 - 1.
fn size(element: &str, n: u64) -> Result<usize, DecodeError> {
    match u32::try_from(n) {
        Ok(n) if n > 0 => Ok(n as usize),
        _ => Err(wrong(element, format!("{n}; it must be from 1 to 4294967295"))),
    }
}

fn sample_type(bits: u64, format: u64) -> Result<SampleType, DecodeError> {
    Ok(match (bits, format) {
        (8, 1 | 4) => SampleType::U8,
        (8, 2) => SampleType::I8,
        (16, 1 | 4) => SampleType::U16,
        (16, 2) => SampleType::I16,
        (32, 1 | 4) => SampleType::U32,
        (32, 2) => SampleType::I32,
        (32, 3) => SampleType::F32,
        (64, 3) => SampleType::F64,
        _ => {
            let kind = match format {
                1 | 4 => "unsigned whole numbers",
                2 => "whole numbers",
                3 => "floating-point numbers",
                5 | 6 => "complex numbers",
                _ => "samples of an unknown kind",
            };
            return Err(DecodeError::Unsupported { what: format!("{kind} of {bits} bits") });
        }
    })
}

fn compression(code: u64) -> Result<Compression, DecodeError> {
    let name = match code {
        1 => return Ok(Compression::None),
        5 => return Ok(Compression::Lzw),
        8 | 32946 => return Ok(Compression::Deflate),
        32773 => return Ok(Compression::PackBits),
        6 | 7 => "JPEG",
        34712 => "JPEG 2000",
        34887 => "LERC",
        34925 => "LZMA",
        50000 => "Zstandard",
        50001 => "WebP",
        50002 => "JPEG XL",
        n => return Err(DecodeError::Unsupported { what: format!("TIFF compression {n}") }),
    };
    let what = format!("{name} compression (write it anew with Deflate)");
    Err(DecodeError::Unsupported { what })
}

fn predictor(code: u64, sample: SampleType) -> Result<Predictor, DecodeError> {
    match (code, sample) {
        (1, _) => Ok(Predictor::None),
        (2, _) => Ok(Predictor::Horizontal),
        (3, SampleType::F32 | SampleType::F64) => Ok(Predictor::FloatingPoint),
        (3, _) => Err(wrong("predictor", "3 is for floating-point samples, and these are whole numbers")),
        (n, _) => Err(DecodeError::Unsupported { what: format!("TIFF predictor {n}") }),
    }
}
