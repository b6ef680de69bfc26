//! Several rasters beside each other as one.

use crate::{Affine, Georeference, Raster, RasterError, Window, check_window};

/// One raster of a mosaic to be.
pub struct Part {
    /// Its name, for errors.
    pub name: String,
    /// Its heights.
    pub raster: Box<dyn Raster>,
    /// Where it lies.
    pub georeference: Georeference,
}

/// Why rasters are no mosaic.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MosaicError {
    /// There is none.
    #[error("a mosaic needs at least one grid")]
    Empty,
    /// One does not say where it lies.
    #[error("{name}: does not say where it lies, so it cannot be put beside others")]
    NoPlace {
        /// Its name.
        name: String,
    },
    /// Two have different coordinate systems.
    #[error("{name} has another coordinate system than {first}; bring them into one first")]
    System {
        /// The first.
        first: String,
        /// The other.
        name: String,
    },
    /// Two have different spacings or directions.
    #[error("{name} has a spacing of {} x {}, and {first} one of {} x {}; resample one of them first",
            spacing[0], spacing[1], first_spacing[0], first_spacing[1])]
    Spacing {
        /// The first.
        first: String,
        /// Its spacing.
        first_spacing: [f64; 2],
        /// The other.
        name: String,
        /// Its spacing.
        spacing: [f64; 2],
    },
    /// The samples of one lie between those of the other.
    #[error("the samples of {name} lie {:.3} columns and {:.3} rows beside those of {first}; resample one of them first", off[0], off[1])]
    Alignment {
        /// The first.
        first: String,
        /// The other.
        name: String,
        /// How far, in samples.
        off: [f64; 2],
    },
    /// They lie so far apart that the whole would have more columns or rows than can be counted.
    #[error("{name} lies {columns:.0} columns and {rows:.0} rows from {first}: too far for one grid")]
    Far {
        /// The first.
        first: String,
        /// The other.
        name: String,
        /// Columns between them.
        columns: f64,
        /// Rows between them.
        rows: f64,
    },
}

struct Placed {
    raster: Box<dyn Raster>,
    window: Window,
}

/// Rasters of one spacing, side by side. Where several lie over each other, the first that is valid counts; where none does, the sample is
/// void.
///
/// No guarantee that rasters agree where they overlap: nobody compares them.
pub struct Mosaic {
    parts: Vec<Placed>,
    columns: usize,
    rows: usize,
}

/// How far samples may lie beside each other, in samples.
const TOLERANCE: f64 = 0.01;
/// The most columns or rows.
const MOST: f64 = u32::MAX as f64;

/// The name and transform of the first part.
struct First<'a> {
    name: &'a str,
    transform: Affine,
}

impl First<'_> {
    /// The column and row of another part's first sample.
    fn offset_of(&self, part: &Part, transform: &Affine) -> Result<[i64; 2], MosaicError> {
        let (first, name) = (self.name.to_string(), part.name.clone());
        let size = part.raster.columns().max(part.raster.rows()) as f64;
        let steps = self.transform.spacing();
        // Over the whole part, the two lattices must not run apart.
        let apart = [0, 1, 3, 4]
            .into_iter()
            .any(|i| (transform.0[i] - self.transform.0[i]).abs() * size > TOLERANCE * steps[i % 3]);
        if apart {
            let (first_spacing, spacing) = (steps, transform.spacing());
            return Err(MosaicError::Spacing { first, first_spacing, name, spacing });
        }
        let no_place = || MosaicError::NoPlace { name: part.name.clone() };
        let [column, row] = self.transform.invert([transform.0[2], transform.0[5]]).ok_or_else(no_place)?;
        if column.abs() > MOST || row.abs() > MOST {
            return Err(MosaicError::Far { first, name, columns: column, rows: row });
        }
        let off = [column - column.round(), row - row.round()];
        if off.iter().any(|o| o.abs() > TOLERANCE) {
            return Err(MosaicError::Alignment { first, name, off });
        }
        Ok([column.round() as i64, row.round() as i64])
    }
}

impl Mosaic {
    /// Puts rasters beside each other, and says where the whole lies: the first's system, its samples as far as they reach.
    ///
    /// # Errors
    /// [`MosaicError`], naming the part that does not fit.
    pub fn new(parts: Vec<Part>) -> Result<(Mosaic, Georeference), MosaicError> {
        let mut georeference = parts.first().ok_or(MosaicError::Empty)?.georeference.clone();
        let place = |p: &Part| {
            let no_place = || MosaicError::NoPlace { name: p.name.clone() };
            p.georeference.transform.filter(Affine::is_regular).ok_or_else(no_place)
        };
        let first = First { name: &parts[0].name, transform: place(&parts[0])? };
        let mut offsets = vec![];
        for part in &parts {
            let same = match (&georeference.crs, &part.georeference.crs) {
                (Some(a), Some(b)) => {
                    a.kind == b.kind && a.epsg == b.epsg && a.keys == b.keys && a.wkt == b.wkt
                }
                _ => true,
            };
            if !same {
                return Err(MosaicError::System { first: first.name.into(), name: part.name.clone() });
            }
            offsets.push(first.offset_of(part, &place(part)?)?);
        }
        let sizes: Vec<[i64; 2]> =
            parts.iter().map(|p| [p.raster.columns() as i64, p.raster.rows() as i64]).collect();
        let ends = |i: usize| {
            let low = offsets.iter().map(|o| o[i]).min().unwrap_or(0);
            let high = offsets.iter().zip(&sizes).map(|(o, s)| o[i].saturating_add(s[i])).max().unwrap_or(0);
            (low, high.saturating_sub(low))
        };
        let ((left, columns), (top, rows)) = (ends(0), ends(1));
        if let Some(far) = [columns, rows].iter().position(|&n| n as f64 > MOST) {
            let last = offsets.iter().enumerate().max_by_key(|(_, o)| o[far].abs()).map_or(0, |(i, _)| i);
            let (columns, rows) = (offsets[last][0] as f64, offsets[last][1] as f64);
            let name = parts[last].name.clone();
            return Err(MosaicError::Far { first: first.name.into(), name, columns, rows });
        }
        georeference.transform = Some(first.transform.shifted([left as f64, top as f64]));
        let placed = parts.into_iter().zip(offsets).map(|(part, [column, row])| Placed {
            // Not negative: the least of all was taken away.
            window: Window::new(
                (column - left) as usize,
                (row - top) as usize,
                part.raster.columns(),
                part.raster.rows(),
            ),
            raster: part.raster,
        });
        let mosaic = Mosaic { parts: placed.collect(), columns: columns as usize, rows: rows as usize };
        Ok((mosaic, georeference))
    }

    /// How many rasters it has.
    #[must_use]
    pub fn parts(&self) -> usize {
        self.parts.len()
    }
}

impl Raster for Mosaic {
    fn columns(&self) -> usize {
        self.columns
    }

    fn rows(&self) -> usize {
        self.rows
    }

    fn block(&self) -> [usize; 2] {
        self.parts.first().map_or([1, 1], |p| p.raster.block())
    }

    fn read(&self, window: Window, out: &mut [f64]) -> Result<(), RasterError> {
        check_window(self.columns, self.rows, window, Some(out.len()))?;
        out.fill(f64::NAN);
        let mut heights = vec![];
        for part in &self.parts {
            let Some(common) = window.intersection(&part.window) else { continue };
            heights.resize(common.columns * common.rows, 0.0);
            let own = Window {
                column: common.column - part.window.column,
                row: common.row - part.window.row,
                ..common
            };
            part.raster.read(own, &mut heights)?;
            for (line, row) in heights.chunks_exact(common.columns).zip(common.row..) {
                let to = (row - window.row) * window.columns + common.column - window.column;
                for (out, &height) in out[to..to + common.columns].iter_mut().zip(line) {
                    if out.is_nan() {
                        *out = height;
                    }
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Crs, CrsKind, Grid};

    fn part(name: &str, at: [f64; 2], spacing: f64, heights: &[f64]) -> Part {
        let side = heights.len().isqrt();
        Part {
            name: name.into(),
            raster: Box::new(Grid::new(side, side, heights.to_vec()).unwrap()),
            georeference: Georeference {
                transform: Some(Affine::north_up(at, [spacing; 2])),
                ..Default::default()
            },
        }
    }

    fn error(parts: Vec<Part>) -> String {
        Mosaic::new(parts).err().unwrap().to_string()
    }

    #[test]
    fn parts_lie_where_they_say_the_first_on_top() {
        let nan = f64::NAN;
        // b begins one column right and one row below a, so they share a sample, which is void in a.
        let a = part("a", [10.0, 20.0], 5.0, &[1.0, 2.0, 3.0, nan]);
        let b = part("b", [15.0, 15.0], 5.0, &[5.0, 6.0, 7.0, 8.0]);
        let (mosaic, place) = Mosaic::new(vec![b, a]).unwrap();
        assert_eq!(place.transform.unwrap().0, [5.0, 0.0, 10.0, 0.0, -5.0, 20.0]);
        let all = mosaic.whole(100).unwrap();
        let want = [1.0, 2.0, nan, 3.0, 5.0, 6.0, nan, 7.0, 8.0];
        assert_eq!(all.heights().len(), 9);
        assert!(all.heights().iter().zip(want).all(|(&a, b)| a == b || a.is_nan() && b.is_nan()));
        let part = mosaic.window(Window::new(1, 1, 2, 1)).unwrap();
        assert_eq!((part.heights(), mosaic.parts()), ([5.0, 6.0].as_slice(), 2));
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let a = || part("a", [0.0, 0.0], 5.0, &[0.0; 4]);
        let spaced = error(vec![a(), part("b", [10.0, 0.0], 6.0, &[0.0; 4])]);
        assert_eq!(spaced, "b has a spacing of 6 x 6, and a one of 5 x 5; resample one of them first");
        let between = error(vec![a(), part("b", [12.0, 0.0], 5.0, &[0.0; 4])]);
        assert!(between.starts_with("the samples of b lie 0.400 columns"), "{between}");
        let far = error(vec![a(), part("b", [1e30, 0.0], 5.0, &[0.0; 4])]);
        assert!(far.contains("too far"), "{far}");
        let far =
            error(vec![a(), part("b", [2e10, 0.0], 5.0, &[0.0; 4]), part("c", [-2e10, 0.0], 5.0, &[0.0; 4])]);
        assert!(far.contains("too far"), "{far}");
        let mut nowhere = a();
        nowhere.georeference.transform = None;
        assert!(error(vec![a(), nowhere]).contains("does not say where"));
        let mut other = a();
        other.georeference.crs = Some(Crs { kind: CrsKind::Geographic, ..Default::default() });
        let mut first = a();
        first.georeference.crs = Some(Crs::default());
        assert!(error(vec![first, other]).contains("another coordinate system"));
        assert_eq!(error(vec![]), "a mosaic needs at least one grid");
    }
}

#[cfg(test)]
mod random {
    use super::*;
    use crate::Grid;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Windows of a mosaic against the parts painted, the last first, onto one sheet.
        #[test]
        fn windows_are_those_of_the_parts_painted(
            places in prop::collection::vec((-4i32..5, -4i32..5, 1usize..5, 1usize..5), 1..5),
            corner in (0.0..1.0f64, 0.0..1.0f64, 0.0..1.0f64, 0.0..1.0f64),
        ) {
            let height = |part: usize, i: usize| if i % 3 == 2 { f64::NAN } else { (100 * part + i) as f64 };
            let part = |(n, &(x, y, w, h)): (usize, &(i32, i32, usize, usize))| Part {
                name: format!("{n}"),
                raster: Box::new(Grid::new(w, h, (0..w * h).map(|i| height(n, i)).collect()).unwrap()),
                georeference: Georeference {
                    transform: Some(Affine::north_up([0.1 * f64::from(x), -0.1 * f64::from(y)], [0.1; 2])),
                    ..Default::default()
                },
            };
            let (mosaic, place) = Mosaic::new(places.iter().enumerate().map(part).collect()).unwrap();
            let left = places.iter().map(|p| p.0).min().unwrap();
            let top = places.iter().map(|p| p.1).min().unwrap();
            let (columns, rows) = (mosaic.columns(), mosaic.rows());
            let mut sheet = vec![f64::NAN; columns * rows];
            for (n, &(x, y, w, h)) in places.iter().enumerate().rev() {
                for i in (0..w * h).filter(|&i| !height(n, i).is_nan()) {
                    let (c, r) = ((x - left) as usize + i % w, (y - top) as usize + i / w);
                    sheet[r * columns + c] = height(n, i);
                }
            }
            let first = place.transform.unwrap().apply([0.0, 0.0]);
            prop_assert!((first[0] - 0.1 * f64::from(left)).abs() < 1e-9);
            let sheet = Grid::new(columns, rows, sheet).unwrap();
            let pick = |share: f64, n: usize| ((share * n as f64) as usize).min(n - 1);
            let (x, y) = (pick(corner.0, columns), pick(corner.1, rows));
            let window = Window::new(x, y, 1 + pick(corner.2, columns - x), 1 + pick(corner.3, rows - y));
            let (a, b) = (mosaic.window(window).unwrap(), sheet.window(window).unwrap());
            let same = a.heights().iter().zip(b.heights()).all(|(a, b)| a == b || a.is_nan() && b.is_nan());
            prop_assert!(same, "{window:?}: {:?} {:?}", a.heights(), b.heights());
        }
    }
}
