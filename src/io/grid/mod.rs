//! Height grids: GeoTIFF, HGT, ESRI ASCII, PNG, raw samples; read window by window from bytes at any place ([`ReadAt`]).
//!
//! [`open`] reads what a file says about itself; its heights come when asked for, as a [`Raster`]. Nothing is allocated by
//! an announced size. Errors of decoding name the tile, the row or the line, and begin with the file's name.

mod ascii;
mod bands;
mod checked;
mod png;
mod rows;
mod samples;
mod source;
mod tiff;
pub mod write;

pub use samples::{ByteOrder, SampleType};
pub use source::ReadAt;

use super::DecodeError;
use crate::terrain::{BlockCache, Georeference, Mosaic, MosaicError, Part, Raster};
use std::sync::Arc;

/// A format of grids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GridFormat {
    /// TIFF, BigTIFF, GeoTIFF.
    Tiff,
    /// SRTM's tiles: squares of big-endian 16-bit samples, placed by their names.
    Hgt,
    /// ESRI ASCII.
    Ascii,
    /// Grey heights, or colours that code heights.
    Png,
    /// Samples without a head.
    Raw,
}

impl GridFormat {
    /// The format of a file name, by its extension.
    pub fn from_name(name: &str) -> Option<Self> {
        let (_, extension) = name.rsplit_once('.')?;
        Some(match extension.to_ascii_lowercase().as_str() {
            "tif" | "tiff" => GridFormat::Tiff,
            "hgt" => GridFormat::Hgt,
            "asc" | "grd" => GridFormat::Ascii,
            "png" => GridFormat::Png,
            "raw" | "bin" | "r16" | "r32" | "flt" => GridFormat::Raw,
            _ => return None,
        })
    }

    /// The format that a file's first bytes tell of beyond doubt: that of TIFF, PNG and ESRI ASCII.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => Some(GridFormat::Tiff),
            [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1a, b'\n', ..] => Some(GridFormat::Png),
            [head @ .., _]
                if head.trim_ascii_start().get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"ncols")) =>
            {
                Some(GridFormat::Ascii)
            }
            _ => None,
        }
    }

    /// A short name.
    pub fn name(self) -> &'static str {
        match self {
            GridFormat::Tiff => "tiff",
            GridFormat::Hgt => "hgt",
            GridFormat::Ascii => "ascii",
            GridFormat::Png => "png",
            GridFormat::Raw => "raw",
        }
    }
}

/// How colours or grey stand for heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// The number is the height.
    Plain,
    /// Mapbox: -10000 + (65536 R + 256 G + B) / 10.
    TerrainRgb,
    /// 256 R + G + B / 256 - 32768.
    Terrarium,
}

impl Encoding {
    /// A short name.
    pub fn name(self) -> &'static str {
        match self {
            Encoding::Plain => "plain",
            Encoding::TerrainRgb => "terrain-rgb",
            Encoding::Terrarium => "terrarium",
        }
    }
}

/// What the file itself does not say, or says wrongly.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct GridOptions {
    /// The format, instead of what the name or the first bytes say.
    pub format: Option<GridFormat>,
    /// Columns and rows of a raw file, or of an HGT that is no square.
    pub size: Option<[usize; 2]>,
    /// Type and byte order of the samples of a raw file.
    pub sample: Option<(SampleType, ByteOrder)>,
    /// How the colours of a PNG stand for heights.
    pub encoding: Option<Encoding>,
    /// The value that means no data, instead of the file's own.
    pub nodata: Option<f64>,
    /// Where decoded blocks are kept: one cache for all grids that are opened with (clones of) these options.
    pub cache: Arc<BlockCache>,
}

impl Default for GridOptions {
    fn default() -> Self {
        // A row of tiles of 256 rows over 16,385 columns in f64, twice.
        let cache = Arc::new(BlockCache::new(64 << 20));
        GridOptions { format: None, size: None, sample: None, encoding: None, nodata: None, cache }
    }
}

impl GridOptions {
    /// The same with an empty cache of at most this many bytes.
    pub fn with_cache(mut self, bytes: usize) -> Self {
        self.cache = Arc::new(BlockCache::new(bytes));
        self
    }
}

/// Several files of one spacing as one grid: [`Mosaic`]. The first says what the whole is; warnings begin with the files' names.
///
/// # Errors
/// [`MosaicError`], naming the file that does not fit. A single file is given back as it is.
pub fn mosaic(files: Vec<(String, GridFile)>) -> Result<GridFile, MosaicError> {
    let mut files = files;
    if files.len() == 1
        && let Some((_, file)) = files.pop()
    {
        return Ok(file);
    }
    let first = &files.first().ok_or(MosaicError::Empty)?.1;
    let (format, sample, encoding, nodata) = (first.format, first.sample, first.encoding, first.nodata);
    let layout = format!("{} files; the first: {}", files.len(), first.layout);
    let mut warnings = vec![];
    let parts = files.into_iter().map(|(name, file)| {
        warnings.extend(file.warnings.iter().map(|w| format!("{name}: {w}")));
        Part { name, raster: file.raster, georeference: file.georeference }
    });
    let (mosaic, georeference) = Mosaic::new(parts.collect())?;
    Ok(GridFile {
        raster: Box::new(mosaic),
        georeference,
        format,
        sample,
        encoding,
        layout,
        nodata,
        warnings,
    })
}

/// What a decoder found, beside heights.
struct Facts {
    sample: SampleType,
    layout: String,
    nodata: Option<f64>,
    warnings: Vec<String>,
}

/// A grid whose heights can be read.
pub struct GridFile {
    /// Its heights. Void samples are NaN; errors begin with the file's name.
    pub raster: Box<dyn Raster>,
    /// Where it lies.
    pub georeference: Georeference,
    /// What it was read as.
    pub format: GridFormat,
    /// What a sample is in the file; of colours, each channel.
    pub sample: SampleType,
    /// How samples stand for heights.
    pub encoding: Encoding,
    /// How it is laid out, for people.
    pub layout: String,
    /// The value that means no data.
    pub nodata: Option<f64>,
    /// What was left out; each said once, without the file's name.
    pub warnings: Vec<String>,
}

impl std::fmt::Debug for GridFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GridFile")
            .field("size", &[self.raster.columns(), self.raster.rows()])
            .field("georeference", &self.georeference)
            .field("format", &self.format)
            .field("sample", &self.sample)
            .field("layout", &self.layout)
            .finish_non_exhaustive()
    }
}

/// Why a grid could not be opened.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GridError {
    /// Neither the name, nor the content, nor the caller says what it is.
    #[error("neither its name nor its first bytes tell the format; say it (tiff, hgt, ascii, png, raw)")]
    UnknownFormat,
    /// Raw samples need a size and a type.
    #[error("raw samples need a size and a type")]
    RawNeedsSize,
    /// There is nothing in it.
    #[error("the file is empty")]
    Empty,
    /// Its name says a format whose first bytes are always the same, and it begins otherwise.
    #[error("its name says {0}, and it does not begin like one; say what it is (tiff, hgt, ascii, png, raw)")]
    OtherThanNamed(&'static str),
    /// The content is wrong.
    #[error(transparent)]
    Decode(#[from] DecodeError),
}

/// Opens a grid: reads what the file says about itself, and no heights (of colours, the first rows).
///
/// `name` stands in errors, and tells the format where the first bytes do not, and where an HGT tile lies.
///
/// # Errors
/// [`GridError`] for what is no grid, or one of a kind that is not read.
pub fn open(source: Arc<dyn ReadAt>, name: &str, options: &GridOptions) -> Result<GridFile, GridError> {
    let head = source::bytes_at(&*source, 0, source.length().min(16)).unwrap_or_default();
    if head.is_empty() && options.size.is_none() {
        return Err(GridError::Empty);
    }
    let (inside, named) = (GridFormat::from_bytes(&head), GridFormat::from_name(name));
    if let (None, None, Some(format @ (GridFormat::Tiff | GridFormat::Png))) = (options.format, inside, named)
    {
        return Err(GridError::OtherThanNamed(if format == GridFormat::Tiff { "TIFF" } else { "PNG" }));
    }
    let format = options.format.or(inside).or(named).ok_or(GridError::UnknownFormat)?;
    let (mut georeference, mut encoding) = (Georeference::default(), Encoding::Plain);
    let (raw, facts): (Box<dyn Raster>, Facts) = match format {
        GridFormat::Tiff => {
            let (tiff, place, facts) = tiff::open(source, &options.cache)?;
            georeference = place;
            (Box::new(tiff), facts)
        }
        GridFormat::Ascii => {
            let (ascii, place, facts) = ascii::open(source, &options.cache)?;
            georeference = place;
            (Box::new(ascii), facts)
        }
        GridFormat::Png => {
            let (picture, facts) = png::open(source, options.encoding, &options.cache)?;
            encoding = picture.encoding;
            (Box::new(picture), facts)
        }
        GridFormat::Hgt => {
            let [columns, rows] = match options.size {
                Some(size) => size,
                None => [rows::hgt_side(source.length())?; 2],
            };
            rows::check_size(columns, rows, SampleType::I16, source.length())?;
            georeference = rows::hgt_georeference(name, columns, rows).unwrap_or_default();
            let sample = SampleType::I16;
            let order = ByteOrder::Big;
            let facts = Facts { sample, layout: "HGT".into(), nodata: Some(-32768.0), warnings: vec![] };
            (Box::new(rows::Rows { source, columns, rows, sample, order }), facts)
        }
        GridFormat::Raw => {
            let (Some([columns, rows]), Some((sample, order))) = (options.size, options.sample) else {
                return Err(GridError::RawNeedsSize);
            };
            rows::check_size(columns, rows, sample, source.length())?;
            let ends = match order {
                _ if sample.bytes() == 1 => "",
                ByteOrder::Little => ", little-endian",
                ByteOrder::Big => ", big-endian",
            };
            let facts = Facts { sample, layout: format!("raw{ends}"), nodata: None, warnings: vec![] };
            (Box::new(rows::Rows { source, columns, rows, sample, order }), facts)
        }
    };
    let nodata = options.nodata.or(facts.nodata).map(|v| facts.sample.rounded(v));
    Ok(GridFile {
        raster: Box::new(checked::Checked { raster: raw, nodata, name: name.into() }),
        georeference,
        format,
        sample: facts.sample,
        encoding,
        layout: facts.layout,
        nodata,
        warnings: facts.warnings,
    })
}
