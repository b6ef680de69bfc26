//! ESRI ASCII grids: a few lines of names and numbers, then heights as text.
//!
//! Opening reads the file once and keeps where each band of rows begins, so that a window is read without what lies before it. (The crates
//! there are read all of it into memory.)

use super::bands::Bands;
use super::source::{ReadAt, Stream, said};
use super::{DecodeError, Facts, SampleType};
use crate::terrain::{Affine, BlockCache, Georeference, Raster, RasterError, SampleAt, Window};
use std::io::{BufRead, Seek, SeekFrom};
use std::sync::Arc;

/// Samples of a band of rows that are read at once, about.
const BAND: usize = 1 << 16;
/// More bytes than any number has.
const LONGEST: usize = 64;

/// A text grid.
pub(super) struct Ascii {
    source: Arc<dyn ReadAt>,
    bands: Bands,
    /// Where each band begins: byte and line.
    starts: Vec<(u64, usize)>,
}

/// Words of a text, with their places.
struct Words {
    stream: Stream,
    /// The line of what comes next, from 1.
    line: usize,
    word: Vec<u8>,
}

fn at_line(line: usize, what: impl Into<String>) -> DecodeError {
    DecodeError::Line { line, what: what.into() }
}

impl Words {
    fn new(source: &Arc<dyn ReadAt>) -> Self {
        Words { stream: Stream::new(source.clone()), line: 1, word: vec![] }
    }

    /// Goes to the next word: its byte and line, and the word in `self.word`; `None` at the end.
    fn next(&mut self) -> Result<Option<(u64, usize)>, DecodeError> {
        self.word.clear();
        let mut start = None;
        loop {
            let place = self.stream.place();
            let bytes = self.stream.fill_buf().map_err(|e| at_line(self.line, said(&e)))?;
            if bytes.is_empty() {
                return Ok(start);
            }
            let mut used = 0;
            if start.is_none() {
                let space = bytes.iter().take_while(|b| b.is_ascii_whitespace()).count();
                self.line += bytes[..space].iter().filter(|&&b| b == b'\n').count();
                used = space;
                if used < bytes.len() {
                    start = Some((place + used as u64, self.line));
                }
            }
            let length = bytes[used..].iter().take_while(|b| !b.is_ascii_whitespace()).count();
            self.word.extend_from_slice(&bytes[used..used + length.min(LONGEST)]);
            used += length;
            let ended = start.is_some() && used < bytes.len();
            self.stream.consume(used);
            if self.word.len() >= LONGEST {
                return Err(at_line(self.line, "a word that is longer than any number"));
            }
            if ended {
                return Ok(start);
            }
        }
    }

    /// The word as a number.
    fn number(&self, line: usize) -> Result<f64, DecodeError> {
        let text = std::str::from_utf8(&self.word).ok();
        text.and_then(|t| t.parse().ok()).ok_or_else(|| {
            at_line(line, format!("{:?} where a number must be", String::from_utf8_lossy(&self.word)))
        })
    }
}

/// What stands before the heights.
#[derive(Default)]
struct Head {
    columns: Option<usize>,
    rows: Option<usize>,
    /// x and y of the lower left: of the corner of its cell, or of its middle.
    corner: [Option<f64>; 2],
    centre: [Option<f64>; 2],
    spacing: [Option<f64>; 2],
    nodata: Option<f64>,
}

impl Head {
    fn set(&mut self, name: &str, value: f64, line: usize) -> Result<(), DecodeError> {
        let count = || match value {
            v if v.fract() == 0.0 && (1.0..=f64::from(u32::MAX)).contains(&v) => Ok(Some(v as usize)),
            v => Err(at_line(line, format!("{name} is {v}; it must be a whole number, 1 or more"))),
        };
        match name {
            "ncols" => self.columns = count()?,
            "nrows" => self.rows = count()?,
            "xllcorner" => self.corner[0] = Some(value),
            "yllcorner" => self.corner[1] = Some(value),
            "xllcenter" | "xllcentre" => self.centre[0] = Some(value),
            "yllcenter" | "yllcentre" => self.centre[1] = Some(value),
            "cellsize" => self.spacing = [Some(value); 2],
            "dx" => self.spacing[0] = Some(value),
            "dy" => self.spacing[1] = Some(value),
            "nodata_value" => self.nodata = Some(value),
            _ => return Err(at_line(line, format!("{name:?} is no word of an ESRI ASCII grid's head"))),
        }
        Ok(())
    }

    fn georeference(&self, rows: usize) -> Georeference {
        let sample_at = match self.centre {
            [Some(_), Some(_)] => SampleAt::Point,
            _ => SampleAt::CellCentre,
        };
        let along = |i: usize| {
            let spacing = self.spacing[i]?;
            let low = self.centre[i].or(self.corner[i].map(|c| c + 0.5 * spacing))?;
            Some((low, spacing))
        };
        let transform = along(0)
            .zip(along(1))
            .map(|((x, dx), (y, dy))| Affine::north_up([x, y + (rows - 1) as f64 * dy], [dx, dy]));
        Georeference { transform: transform.filter(Affine::is_regular), sample_at, crs: None }
    }
}

/// Reads the head, and through all of the text once.
pub(super) fn open(
    source: Arc<dyn ReadAt>,
    cache: &Arc<BlockCache>,
) -> Result<(Ascii, Georeference, Facts), DecodeError> {
    let mut words = Words::new(&source);
    let mut head = Head::default();
    let first = loop {
        let Some(at) = words.next()? else {
            return Err(at_line(words.line, "the file ends before the heights"));
        };
        if !words.word[0].is_ascii_alphabetic() || words.word.eq_ignore_ascii_case(b"nan") {
            break at;
        }
        let name = String::from_utf8_lossy(&words.word).to_ascii_lowercase();
        let Some(_) = words.next()? else {
            return Err(at_line(at.1, format!("{name} has no value")));
        };
        let value = words.number(at.1)?;
        head.set(&name, value, at.1)?;
    };
    let missing = |name: &str| at_line(first.1, format!("heights begin, but {name} was not said"));
    let columns = head.columns.ok_or_else(|| missing("ncols"))?;
    let rows = head.rows.ok_or_else(|| missing("nrows"))?;
    let bands = Bands::new(columns, rows, BAND / columns, cache);
    // Both are below 2^32.
    let (needed, in_band) = (columns as u64 * rows as u64, columns as u64 * bands.height as u64);
    let mut starts = vec![];
    let mut next = Some(first);
    let mut count = 0;
    while let Some(at) = next {
        if count == needed {
            return Err(at_line(at.1, format!("more than the {needed} heights of {columns} x {rows}")));
        }
        if count % in_band == 0 {
            starts.push(at);
        }
        count += 1;
        next = words.next()?;
    }
    if count < needed {
        let what = format!("the file ends after {count} of {needed} heights ({columns} x {rows})");
        return Err(at_line(words.line, what));
    }
    // Without a word about it, the format's own value counts.
    let facts = Facts {
        sample: SampleType::F64,
        layout: "ESRI ASCII".into(),
        nodata: Some(head.nodata.unwrap_or(-9999.0)).filter(|v| !v.is_nan()),
        warnings: vec![],
    };
    let georeference = head.georeference(rows);
    Ok((Ascii { source, bands, starts }, georeference, facts))
}

impl Ascii {
    fn band_heights(&self, band: usize) -> Result<Vec<f64>, DecodeError> {
        let count = self.bands.rows_of(band).len() * self.bands.columns;
        let (offset, line) = self.starts[band];
        let mut words = Words { line, ..Words::new(&self.source) };
        words.stream.seek(SeekFrom::Start(offset)).map_err(|e| at_line(line, said(&e)))?;
        // As many as were counted when it was opened.
        let mut heights = Vec::with_capacity(count);
        while heights.len() < count {
            let at = words.next()?.ok_or_else(|| at_line(words.line, "the file has become shorter"))?;
            heights.push(words.number(at.1)?);
        }
        Ok(heights)
    }
}

impl Raster for Ascii {
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
        self.bands.read(window, out, |band| {
            self.band_heights(band).map_err(|e| match e {
                DecodeError::Line { line, what } => {
                    RasterError::Source { place: format!("line {line}"), what }
                }
                e => {
                    let place = format!("row {}", self.bands.rows_of(band).start);
                    RasterError::Source { place, what: e.to_string() }
                }
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<(Ascii, Georeference, Facts), DecodeError> {
        open(Arc::new(text.as_bytes().to_vec()), &Arc::new(BlockCache::new(1 << 20)))
    }

    const HEAD: &str = "ncols 3\nNROWS 2\nxllcorner 10\nyllcorner 20\ncellsize 2\n";

    #[test]
    fn heights_may_stand_in_lines_of_any_length() {
        let (grid, place, facts) = read(&format!("{HEAD}NODATA_value -1\n1 2\n3 4\r\n\n5 -1e3")).unwrap();
        assert_eq!(grid.whole(6).unwrap().heights(), [1.0, 2.0, 3.0, 4.0, 5.0, -1000.0]);
        assert_eq!(grid.window(Window::new(1, 1, 2, 1)).unwrap().heights(), [5.0, -1000.0]);
        assert_eq!(facts.nodata, Some(-1.0));
        assert_eq!(place.transform.unwrap().apply([0.0, 1.0]), [11.0, 21.0]);
        assert_eq!(place.transform.unwrap().apply([2.0, 0.0]), [15.0, 23.0]);
        let centred = HEAD.replace("corner", "center");
        let (_, place, facts) = read(&format!("{centred}1 2 3 4 5 6\n")).unwrap();
        assert_eq!(place.transform.unwrap().apply([0.0, 1.0]), [10.0, 20.0]);
        assert_eq!((place.sample_at, facts.nodata), (SampleAt::Point, Some(-9999.0)));
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let said = |text: &str| read(text).map(|_| ()).unwrap_err().to_string();
        assert_eq!(
            said(&format!("{HEAD}1 2 3\n4 5\n")),
            "line 8: the file ends after 5 of 6 heights (3 x 2)"
        );
        assert_eq!(said(&format!("{HEAD}1 2 3\n4 5 6\n7")), "line 8: more than the 6 heights of 3 x 2");
        assert_eq!(said("ncols 3\n1 2 3"), "line 2: heights begin, but nrows was not said");
        assert!(said("ncols 1.5\n").starts_with("line 1: ncols is 1.5"));
        assert!(said("ncols x\n").contains("\"x\" where a number"));
        assert!(said("width 3\n").contains("\"width\" is no word"));
        assert!(said("ncols").contains("no value") && said("").contains("ends before"));
        assert!(said(&"7".repeat(100)).contains("longer than any number"));
        // 65,536 x 65,536 announced: no more is kept than what is there.
        assert!(said("ncols 65536 nrows 65536 cellsize 1\n1 2 3").contains("after 3 of 4294967296"));
        let (grid, ..) = read(&format!("{HEAD}1 2 3\n4 x 6\n")).unwrap();
        assert_eq!(grid.whole(6).unwrap_err().to_string(), "line 7: \"x\" where a number must be");
    }

    #[test]
    fn words_across_the_ends_of_buffers_are_whole() {
        let heights: Vec<String> = (0..40_000).map(|i| format!("{i}.5")).collect();
        let (grid, ..) = read(&format!("ncols 200 nrows 200\n{}", heights.join(" \n"))).unwrap();
        let all = grid.whole(40_000).unwrap();
        assert!(all.heights().iter().enumerate().all(|(i, &h)| h == i as f64 + 0.5));
        assert_eq!(grid.window(Window::new(7, 150, 1, 1)).unwrap().heights(), [30_007.5]);
    }
}
