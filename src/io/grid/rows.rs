//! Plain samples, row after row: raw files, and HGT, which is raw with a known type and a place in its name. A crate for either would
//! be longer to call than this is.

use super::source::{ReadAt, said};
use super::{ByteOrder, SampleType};
use crate::io::DecodeError;
use crate::terrain::{
    Affine, Crs, CrsKind, Georeference, Raster, RasterError, SampleAt, Window, check_window,
};
use std::sync::Arc;

/// Samples of one type from an offset on.
pub(super) struct Rows {
    pub(super) source: Arc<dyn ReadAt>,
    pub(super) columns: usize,
    pub(super) rows: usize,
    pub(super) sample: SampleType,
    pub(super) order: ByteOrder,
}

impl Raster for Rows {
    fn columns(&self) -> usize {
        self.columns
    }

    fn rows(&self) -> usize {
        self.rows
    }

    fn read(&self, window: Window, out: &mut [f64]) -> Result<(), RasterError> {
        check_window(self.columns, self.rows, window, Some(out.len()))?;
        if out.is_empty() {
            return Ok(());
        }
        let size = self.sample.bytes();
        let mut bytes = vec![0; window.columns * size];
        for (line, row) in out.chunks_exact_mut(window.columns).zip(window.row..) {
            let offset = (row as u64 * self.columns as u64 + window.column as u64) * size as u64;
            self.source
                .read_at(offset, &mut bytes)
                .map_err(|e| RasterError::Source { place: format!("row {row}"), what: said(&e) })?;
            self.sample.decode(&bytes, self.order, 1, line);
        }
        Ok(())
    }
}

/// Fails unless the file has exactly the bytes of that many samples.
pub(super) fn check_size(
    columns: usize,
    rows: usize,
    sample: SampleType,
    length: u64,
) -> Result<(), DecodeError> {
    let needed = (columns as u64).checked_mul(rows as u64).and_then(|n| n.checked_mul(sample.bytes() as u64));
    if columns > 0 && rows > 0 && needed == Some(length) {
        return Ok(());
    }
    let needed = needed.map_or("more than any file has".into(), |n| format!("{n} bytes"));
    Err(DecodeError::Element {
        element: "size".into(),
        what: format!(
            "{columns} x {rows} samples of type {} are {needed}, and the file has {length}",
            sample.name()
        ),
    })
}

/// The side of a square HGT tile of this many bytes: 1201, 3601, or any other from 2 on.
pub(super) fn hgt_side(length: u64) -> Result<usize, DecodeError> {
    let side = (length / 2).isqrt();
    if side >= 2 && side.checked_mul(side).and_then(|n| n.checked_mul(2)) == Some(length) {
        return Ok(side as usize);
    }
    Err(DecodeError::Element {
        element: "size".into(),
        what: format!(
            "an HGT file holds a square of 16-bit samples (1201 x 1201 are 2884802 bytes, 3601 x 3601 are 25934402), and this has \
             {length} bytes; is it cut off? Of another shape, say its size"
        ),
    })
}

/// Where an HGT tile lies, from its name: `N57E011.hgt` is the degree north and east of 57 N, 11 E, its outermost samples on the border.
pub(super) fn hgt_georeference(name: &str, columns: usize, rows: usize) -> Option<Georeference> {
    let stem = name.rsplit(['/', '\\']).next()?.split('.').next()?;
    let (north, east) = hgt_corner(stem)?;
    let spacing = [columns, rows].map(|n| 1.0 / (n.max(2) - 1) as f64);
    Some(Georeference {
        transform: Some(Affine::north_up([east, north + 1.0], spacing)),
        sample_at: SampleAt::Point,
        crs: Some(Crs {
            kind: CrsKind::Geographic,
            name: Some("WGS 84".into()),
            epsg: Some(4326),
            ..Default::default()
        }),
    })
}

/// `N57E011` as (57, 11).
fn hgt_corner(stem: &str) -> Option<(f64, f64)> {
    let letters = stem.as_bytes();
    if letters.len() != 7 || !stem.is_ascii() {
        return None;
    }
    let part = |from: usize, to: usize, positive: u8, negative: u8, most: f64| {
        let digits = stem[from + 1..to].bytes().all(|b| b.is_ascii_digit()).then(|| &stem[from + 1..to])?;
        let value: f64 = digits.parse().ok().filter(|v| *v <= most)?;
        match letters[from].to_ascii_uppercase() {
            l if l == positive => Some(value),
            l if l == negative => Some(-value),
            _ => None,
        }
    };
    Some((part(0, 3, b'N', b'S', 90.0)?, part(3, 7, b'E', b'W', 180.0)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_is_read_by_offset() {
        let bytes: Vec<u8> = (0..12u16).flat_map(u16::to_be_bytes).collect();
        let rows = Rows {
            source: Arc::new(bytes),
            columns: 4,
            rows: 3,
            sample: SampleType::U16,
            order: ByteOrder::Big,
        };
        assert_eq!(rows.window(Window::new(1, 1, 2, 2)).unwrap().heights(), [5.0, 6.0, 9.0, 10.0]);
    }

    #[test]
    fn sizes_must_be_those_of_the_file() {
        assert!(check_size(4, 3, SampleType::I16, 24).is_ok());
        let e = check_size(4, 4, SampleType::I16, 24).unwrap_err().to_string();
        assert_eq!(e, "size: 4 x 4 samples of type i16 are 32 bytes, and the file has 24");
        assert!(check_size(usize::MAX, usize::MAX, SampleType::F64, 24).is_err());
        assert!(check_size(0, 4, SampleType::I16, 0).is_err());
        assert_eq!(hgt_side(2_884_802), Ok(1201));
        assert!(hgt_side(2_884_800).is_err() && hgt_side(0).is_err() && hgt_side(2).is_err());
    }

    #[test]
    fn a_tile_lies_where_its_name_says() {
        let corner = |name: &str| {
            let t = hgt_georeference(name, 1201, 1201)?.transform?;
            Some((t.apply([0.0, 1200.0]), t.apply([1200.0, 0.0])))
        };
        let near = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9;
        let (low, high) = corner("/a/N57E011.SRTMGL1.hgt").unwrap();
        assert!(near(low, [11.0, 57.0]) && near(high, [12.0, 58.0]));
        let (low, high) = corner("s01w080.hgt").unwrap();
        assert!(near(low, [-80.0, -1.0]) && near(high, [-79.0, 0.0]));
        for none in ["N5E0011.hgt", "tile.hgt", "X57E011.hgt", "N57E01é.hgt", "", "N+7E011"] {
            assert_eq!(corner(none), None, "{none}");
        }
    }
}
