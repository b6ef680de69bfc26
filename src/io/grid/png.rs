//! PNG: grey of 8 or 16 bits as heights, or colours that code heights. Rows are unpacked in order, in bands; going back begins anew.

use super::bands::Bands;
use super::source::{ReadAt, Stream};
use super::{DecodeError, Encoding, Facts, SampleType};
use crate::terrain::{BlockCache, Raster, RasterError, Window};
use png::{BitDepth, ColorType};
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

/// Samples of a band of rows that are unpacked at once, about.
const BAND: usize = 1 << 20;
/// The most bytes an interlaced picture may have, which can only be unpacked whole.
const MOST_INTERLACED: usize = 64 << 20;
/// The most columns: a row is the least that is unpacked.
const MOST_COLUMNS: usize = 1 << 22;

/// A picture of heights.
pub(super) struct Picture {
    source: Arc<dyn ReadAt>,
    bands: Bands,
    color: ColorType,
    wide: bool,
    pub(super) encoding: Encoding,
    interlaced: bool,
    /// Where unpacking has got to, for whoever goes on from there.
    open: Mutex<Option<Unpacking>>,
}

/// A decoder, and the row it gives next.
struct Unpacking {
    reader: png::Reader<Stream>,
    row: usize,
}

fn wrong(what: impl Into<String>) -> DecodeError {
    DecodeError::Element { element: "picture".into(), what: what.into() }
}

fn start(source: &Arc<dyn ReadAt>) -> Result<Unpacking, String> {
    let mut decoder = png::Decoder::new(Stream::new(source.clone()));
    decoder.set_transformations(png::Transformations::IDENTITY);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let reader = decoder.read_info().map_err(|e| e.to_string())?;
    Ok(Unpacking { reader, row: 0 })
}

/// Opens a picture. Without an encoding, grey is heights, and colours are Terrain-RGB if their first rows can be that.
pub(super) fn open(
    source: Arc<dyn ReadAt>,
    encoding: Option<Encoding>,
    cache: &Arc<BlockCache>,
) -> Result<(Picture, Facts), DecodeError> {
    let unpacking = start(&source).map_err(wrong)?;
    let info = unpacking.reader.info();
    let (columns, rows) = (info.width as usize, info.height as usize);
    let (color, depth, interlaced) = (info.color_type, info.bit_depth, info.interlaced);
    if columns > MOST_COLUMNS {
        return Err(wrong(format!("{columns} columns; at most {MOST_COLUMNS} are read")));
    }
    let colored = matches!(color, ColorType::Rgb | ColorType::Rgba);
    let wide = match depth {
        BitDepth::Eight => false,
        BitDepth::Sixteen => true,
        d => return Err(DecodeError::Unsupported { what: format!("PNG of {} bits a channel", d as u8) }),
    };
    if color == ColorType::Indexed {
        return Err(DecodeError::Unsupported { what: "PNG with a palette, which codes no heights".into() });
    }
    let explicit = encoding.is_some();
    let encoding = encoding.unwrap_or(if colored { Encoding::TerrainRgb } else { Encoding::Plain });
    match (encoding, colored) {
        (Encoding::Plain, true) => return Err(wrong("has colours; plain heights are grey")),
        (Encoding::Plain, false) => {}
        (_, false) => return Err(wrong(format!("is grey; {} needs colours", encoding.name()))),
        (_, true) if wide => return Err(wrong("has colours of 16 bits; coded heights have 8")),
        (_, true) => {}
    }
    if interlaced && unpacking.reader.output_buffer_size().is_none_or(|n| n > MOST_INTERLACED) {
        return Err(wrong(format!(
            "{columns} x {rows} interlaced, which cannot be read in parts; write it without interlacing"
        )));
    }
    let picture = Picture {
        source,
        bands: Bands::new(columns, rows, if interlaced { rows } else { BAND / columns }, cache),
        color,
        wide,
        encoding,
        interlaced,
        open: Mutex::new(Some(unpacking)),
    };
    if colored && !explicit {
        picture.check_colors()?;
    }
    let kind = match (colored, wide) {
        (true, _) => encoding.name(),
        (false, true) => "grey of 16 bits",
        (false, false) => "grey of 8 bits",
    };
    let facts = Facts {
        sample: if wide { SampleType::U16 } else { SampleType::U8 },
        layout: format!("PNG, {kind}"),
        nodata: None,
        warnings: vec![],
    };
    Ok((picture, facts))
}

impl Picture {
    /// Fails where the first rows are no heights of the Earth in Terrain-RGB: an ordinary picture was given by mistake, or another code.
    fn check_colors(&self) -> Result<(), DecodeError> {
        let window = Window::new(0, 0, self.bands.columns, self.bands.height.min(16));
        let heights = self.window(window).map_err(|e| wrong(e.to_string()))?;
        match heights.heights().iter().find(|h| !h.is_nan() && !(-12_000.0..=9_700.0).contains(*h)) {
            None => Ok(()),
            Some(h) => Err(wrong(format!(
                "its colours give a height of {h:.1} m as Terrain-RGB: an ordinary picture? If not, say the encoding"
            ))),
        }
    }

    fn channels(&self) -> usize {
        self.color.samples() * if self.wide { 2 } else { 1 }
    }

    fn heights(&self, row: &[u8], out: &mut [f64]) {
        let size = self.channels();
        for (pixel, out) in row.chunks_exact(size).zip(out) {
            let transparent = match (self.color, self.wide) {
                (ColorType::GrayscaleAlpha, false) => pixel[1] == 0,
                (ColorType::GrayscaleAlpha, true) => pixel[2] == 0 && pixel[3] == 0,
                (ColorType::Rgba, _) => pixel[3] == 0,
                _ => false,
            };
            *out = match self.encoding {
                _ if transparent => f64::NAN,
                Encoding::Plain if self.wide => f64::from(u16::from_be_bytes([pixel[0], pixel[1]])),
                Encoding::Plain => f64::from(pixel[0]),
                // In whole tenths first, so that it is the f64 next to the height meant.
                Encoding::TerrainRgb => (whole(pixel) - 100_000) as f64 / 10.0,
                Encoding::Terrarium => (whole(pixel) - (32_768 << 8)) as f64 / 256.0,
            };
        }
    }

    /// A band's heights.
    fn band_heights(&self, band: usize) -> Result<Vec<f64>, RasterError> {
        let columns = self.bands.columns;
        let Range { start: first, end } = self.bands.rows_of(band);
        let wrong = |row: usize, what: String| RasterError::Source { place: format!("row {row}"), what };
        // Taken out, so that another thread does not wait but begins anew.
        let kept = self.open.lock().unwrap_or_else(PoisonError::into_inner).take();
        let mut at = match kept.filter(|u| u.row <= first) {
            Some(u) => u,
            None => start(&self.source).map_err(|e| wrong(0, e))?,
        };
        // Grows with the rows that are there.
        let mut out = vec![];
        if self.interlaced {
            let size = at.reader.output_buffer_size().unwrap_or(0);
            let mut pixels = vec![0; size];
            at.reader.next_frame(&mut pixels).map_err(|e| wrong(0, e.to_string()))?;
            out.resize((end - first) * columns, f64::NAN);
            self.heights(&pixels, &mut out);
            return Ok(out);
        }
        while at.row < end {
            let row = at.reader.next_row().map_err(|e| wrong(at.row, e.to_string()))?;
            let Some(row) = row else { return Err(wrong(at.row, "the file ends before".into())) };
            if let Some(r) = at.row.checked_sub(first) {
                out.resize((r + 1) * columns, f64::NAN);
                self.heights(row.data(), &mut out[r * columns..]);
            }
            at.row += 1;
        }
        *self.open.lock().unwrap_or_else(PoisonError::into_inner) = Some(at);
        Ok(out)
    }
}

fn whole(pixel: &[u8]) -> i64 {
    i64::from(pixel[0]) << 16 | i64::from(pixel[1]) << 8 | i64::from(pixel[2])
}

impl Raster for Picture {
    fn columns(&self) -> usize {
        self.bands.columns
    }

    fn rows(&self) -> usize {
        self.bands.rows
    }

    fn block(&self) -> [usize; 2] {
        [self.bands.columns, self.bands.height]
    }

    fn read(&self, window: Window, out: &mut [f64]) -> Result<(), RasterError> {
        self.bands.read(window, out, |band| self.band_heights(band))
    }
}
