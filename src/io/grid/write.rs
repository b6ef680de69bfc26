//! Writing grids, row after row, so that no grid need lie in memory whole: GeoTIFF of f32, PNG of 16 bits, HGT, ESRI ASCII, raw f32.

use super::GridFormat;
use super::tiff::geo;
use crate::terrain::{Affine, Georeference, SampleAt};
use std::io::{self, Write};

/// What to write, beside heights.
#[derive(Clone, Debug)]
pub struct GridHead<'a> {
    /// Samples in a row.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
    /// Where it lies. PNG, HGT and raw samples do not hold it.
    pub georeference: &'a Georeference,
}

/// Writes the heights of a row, of this number, to a slice; what fails ends the writing.
pub type Row<'a> = dyn FnMut(usize, &mut [f64]) -> io::Result<()> + 'a;

/// Why a grid could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteGridError {
    /// The format cannot hold it.
    #[error("{0}")]
    CannotHold(String),
    /// The system refused.
    #[error("{0}")]
    Io(#[from] io::Error),
}

/// Sides of the tiles of a GeoTIFF.
const TILE: usize = 256;
/// What void samples are in f32.
const VOID: f32 = -9999.0;

/// Writes a grid whose rows `row` gives, from the first on. Void samples are -9999 in GeoTIFF and ASCII, -32768 in HGT, 0 in PNG, NaN in raw files.
///
/// PNG and HGT hold whole numbers: heights are rounded, and those outside 0 to 65,535 (-32,767 to 32,767) become the nearest of them.
///
/// # Errors
/// [`WriteGridError`] for a size that the format cannot hold, and what `row` and `out` give.
pub fn write(
    format: GridFormat,
    head: &GridHead<'_>,
    row: &mut Row<'_>,
    out: &mut dyn Write,
) -> Result<(), WriteGridError> {
    if head.columns == 0 || head.rows == 0 {
        return Err(WriteGridError::CannotHold("a grid without samples".into()));
    }
    match format {
        GridFormat::Tiff => tiff(head, row, out),
        GridFormat::Png => png(head, row, out),
        GridFormat::Hgt if head.columns != head.rows => {
            Err(WriteGridError::CannotHold("HGT holds squares only".into()))
        }
        GridFormat::Hgt => Ok(samples(head, row, out, |h| {
            if h.is_nan() { i16::MIN } else { h.round().clamp(-32767.0, 32767.0) as i16 }.to_be_bytes()
        })?),
        GridFormat::Raw => Ok(samples(head, row, out, |h| (h as f32).to_le_bytes())?),
        GridFormat::Ascii => ascii(head, row, out),
    }
}

fn samples<const N: usize>(
    head: &GridHead<'_>,
    row: &mut Row<'_>,
    out: &mut dyn Write,
    coded: impl Fn(f64) -> [u8; N],
) -> io::Result<()> {
    let (mut heights, mut bytes) = (vec![0.0; head.columns], vec![]);
    for r in 0..head.rows {
        row(r, &mut heights)?;
        bytes.clear();
        bytes.extend(heights.iter().flat_map(|&h| coded(h)));
        out.write_all(&bytes)?;
    }
    Ok(())
}

fn png(head: &GridHead<'_>, row: &mut Row<'_>, out: &mut dyn Write) -> Result<(), WriteGridError> {
    let side = |n: usize| u32::try_from(n).ok().filter(|&n| n <= i32::MAX as u32);
    let too_large = || WriteGridError::CannotHold("PNG has at most 2147483647 columns and rows".into());
    let (width, height) = side(head.columns).zip(side(head.rows)).ok_or_else(too_large)?;
    let mut encoder = ::png::Encoder::new(out, width, height);
    encoder.set_color(::png::ColorType::Grayscale);
    encoder.set_depth(::png::BitDepth::Sixteen);
    let failed = |e: ::png::EncodingError| match e {
        ::png::EncodingError::IoError(e) => WriteGridError::Io(e),
        e => WriteGridError::CannotHold(e.to_string()),
    };
    let mut writer = encoder.write_header().map_err(failed)?;
    let mut stream = writer.stream_writer().map_err(failed)?;
    samples(head, row, &mut stream, |h| (h.round().clamp(0.0, 65535.0) as u16).to_be_bytes())?;
    stream.finish().map_err(failed)
}

fn ascii(head: &GridHead<'_>, row: &mut Row<'_>, out: &mut dyn Write) -> Result<(), WriteGridError> {
    let t = head.georeference.transform.unwrap_or(Affine::north_up([0.0, (head.rows - 1) as f64], [1.0; 2]));
    let [a, b, _, c, d, _] = t.0;
    if b != 0.0 || c != 0.0 || a <= 0.0 || (a + d).abs() > 1e-9 * a {
        return Err(WriteGridError::CannotHold("ESRI ASCII holds equal spacings along the axes only".into()));
    }
    let [x, y] = t.apply([0.0, (head.rows - 1) as f64]);
    let (name, shift) = match head.georeference.sample_at {
        SampleAt::Point => ("center", 0.0),
        SampleAt::CellCentre => ("corner", 0.5 * a),
    };
    let (x, y) = (x - shift, y - shift);
    let (columns, rows) = (head.columns, head.rows);
    write!(
        out,
        "ncols {columns}\nnrows {rows}\nxll{name} {x}\nyll{name} {y}\ncellsize {a}\nNODATA_value {VOID}\n"
    )?;
    let (mut heights, mut line) = (vec![0.0; columns], String::new());
    for r in 0..rows {
        row(r, &mut heights)?;
        line.clear();
        for &h in &heights {
            // The shortest text that reads as the same f32, as GeoTIFF would hold it.
            let h = if h.is_nan() { VOID } else { h as f32 };
            line += &format!("{h} ");
        }
        line.pop();
        line.push('\n');
        out.write_all(line.as_bytes())?;
    }
    Ok(())
}

/// A value of a tag.
enum Value {
    Short(Vec<u16>),
    Long(Vec<u32>),
    Long8(Vec<u64>),
    Double(Vec<f64>),
    Ascii(String),
}

impl Value {
    /// Type, count and bytes.
    fn coded(&self) -> (u16, u64, Vec<u8>) {
        match self {
            Value::Short(v) => (3, v.len() as u64, v.iter().flat_map(|n| n.to_le_bytes()).collect()),
            Value::Long(v) => (4, v.len() as u64, v.iter().flat_map(|n| n.to_le_bytes()).collect()),
            Value::Long8(v) => (16, v.len() as u64, v.iter().flat_map(|n| n.to_le_bytes()).collect()),
            Value::Double(v) => (12, v.len() as u64, v.iter().flat_map(|n| n.to_le_bytes()).collect()),
            Value::Ascii(text) => {
                let mut bytes = text.clone().into_bytes();
                bytes.push(0);
                (2, bytes.len() as u64, bytes)
            }
        }
    }
}

/// The tags of an image but for those of its tiles' places.
fn tags(head: &GridHead<'_>) -> Vec<(u16, Value)> {
    let g = head.georeference;
    let mut tags = vec![
        (256, Value::Long(vec![head.columns as u32])),
        (257, Value::Long(vec![head.rows as u32])),
        (258, Value::Short(vec![32])),
        (259, Value::Short(vec![1])),
        (262, Value::Short(vec![1])),
        (277, Value::Short(vec![1])),
        (284, Value::Short(vec![1])),
        (322, Value::Long(vec![TILE as u32])),
        (323, Value::Long(vec![TILE as u32])),
        (339, Value::Short(vec![3])),
        (geo::NODATA, Value::Ascii(VOID.to_string())),
    ];
    if let Some(t) = g.transform {
        let corner = match g.sample_at {
            SampleAt::Point => t,
            SampleAt::CellCentre => t.shifted([-0.5, -0.5]),
        };
        let [a, b, x, c, d, y] = corner.0;
        if b == 0.0 && c == 0.0 && a > 0.0 && d < 0.0 {
            tags.push((geo::PIXEL_SCALE, Value::Double(vec![a, -d, 0.0])));
            tags.push((geo::TIEPOINT, Value::Double(vec![0.0, 0.0, 0.0, x, y, 0.0])));
        } else {
            let rows = [[a, b, 0.0, x], [c, d, 0.0, y], [0.0; 4], [0.0, 0.0, 0.0, 1.0]];
            tags.push((geo::TRANSFORMATION, Value::Double(rows.concat())));
        }
    }
    let keys = g.crs.as_ref().and_then(|c| c.keys.clone()).unwrap_or_else(|| geo::plain_keys(g));
    if !keys.directory.is_empty() {
        tags.push((geo::KEYS, Value::Short(keys.directory)));
    }
    if !keys.doubles.is_empty() {
        tags.push((geo::KEY_DOUBLES, Value::Double(keys.doubles)));
    }
    if !keys.ascii.is_empty() {
        tags.push((geo::KEY_ASCII, Value::Ascii(keys.ascii)));
    }
    tags
}

/// Tiles that are not packed, so that their places are known before the first is written; BigTIFF where 4 GiB do not suffice.
fn tiff(head: &GridHead<'_>, row: &mut Row<'_>, out: &mut dyn Write) -> Result<(), WriteGridError> {
    if head.columns > i32::MAX as usize || head.rows > i32::MAX as usize {
        return Err(WriteGridError::CannotHold("TIFF has at most 2147483647 columns and rows".into()));
    }
    let (across, down) = (head.columns.div_ceil(TILE), head.rows.div_ceil(TILE));
    let tile_bytes = (4 * TILE * TILE) as u64;
    let tiles = (across * down) as u64;
    // The head takes 16 bytes a tile, and far less than 64 KiB besides.
    let big = tiles * (tile_bytes + 16) + (1 << 16) > u64::from(u32::MAX);
    let mut tags = tags(head);
    let places = |start: u64| -> Value {
        let offsets = (0..tiles).map(|i| start + i * tile_bytes);
        match big {
            true => Value::Long8(offsets.collect()),
            false => Value::Long(offsets.map(|o| o as u32).collect()),
        }
    };
    tags.push((324, places(0)));
    tags.push((325, Value::Long(vec![tile_bytes as u32; tiles as usize])));
    tags.sort_by_key(|t| t.0);
    // Once to learn how long it is, and once with the places.
    let start = directory(&tags, big).len() as u64;
    if let Some(tag) = tags.iter_mut().find(|t| t.0 == 324) {
        tag.1 = places(start);
    }
    out.write_all(&directory(&tags, big))?;
    let (mut heights, mut band) = (vec![0.0; head.columns], vec![0f32; across * TILE * TILE]);
    let mut bytes = vec![];
    for top in (0..head.rows).step_by(TILE) {
        for r in 0..TILE.min(head.rows - top) {
            row(top + r, &mut heights)?;
            for (line, tile) in heights.chunks(TILE).zip(band.chunks_exact_mut(TILE * TILE)) {
                for (to, &h) in tile[r * TILE..].iter_mut().zip(line) {
                    *to = if h.is_nan() { VOID } else { h as f32 };
                }
            }
        }
        bytes.clear();
        bytes.extend(band.iter().flat_map(|h| h.to_le_bytes()));
        out.write_all(&bytes)?;
    }
    Ok(())
}

/// Everything before the tiles.
fn directory(tags: &[(u16, Value)], big: bool) -> Vec<u8> {
    let mut out: Vec<u8> = if big {
        [b"II".as_slice(), &43u16.to_le_bytes(), &8u16.to_le_bytes(), &[0; 2], &16u64.to_le_bytes()].concat()
    } else {
        [b"II".as_slice(), &42u16.to_le_bytes(), &8u32.to_le_bytes()].concat()
    };
    let word = |n: u64| if big { n.to_le_bytes().to_vec() } else { (n as u32).to_le_bytes().to_vec() };
    let (room, count) = if big { (8, 8) } else { (4, 2) };
    out.extend(&(tags.len() as u64).to_le_bytes()[..count]);
    let mut after = out.len() + tags.len() * (4 + 2 * room) + room;
    let mut values = vec![];
    for (tag, value) in tags {
        let (kind, n, mut bytes) = value.coded();
        out.extend(tag.to_le_bytes());
        out.extend(kind.to_le_bytes());
        out.extend(word(n));
        if bytes.len() <= room {
            bytes.resize(room, 0);
            out.extend(bytes);
        } else {
            out.extend(word(after as u64));
            // Values begin at even bytes.
            bytes.resize(bytes.len().next_multiple_of(8), 0);
            after += bytes.len();
            values.extend(bytes);
        }
    }
    out.extend(word(0));
    out.extend(values);
    out
}
