//! Where a grid lies on the Earth: a transform, what its coordinates mean, and what files said about that.

/// An affine map from (column, row) to model coordinates: `x = t[0] column + t[1] row + t[2]`, `y = t[3] column + t[4] row + t[5]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine(pub [f64; 6]);

impl Affine {
    /// Columns along x and rows against y from the first sample, as most grids are laid out.
    #[must_use]
    pub fn north_up(first: [f64; 2], spacing: [f64; 2]) -> Self {
        Affine([spacing[0], 0.0, first[0], 0.0, -spacing[1], first[1]])
    }

    /// Where a point between samples lies.
    #[must_use]
    pub fn apply(&self, [column, row]: [f64; 2]) -> [f64; 2] {
        let t = &self.0;
        [t[0] * column + t[1] * row + t[2], t[3] * column + t[4] * row + t[5]]
    }

    /// The map after a step of this many columns and rows.
    #[must_use]
    pub fn shifted(&self, by: [f64; 2]) -> Self {
        let [x, y] = self.apply(by);
        let t = self.0;
        Affine([t[0], t[1], x, t[3], t[4], y])
    }

    /// The column and row of a point; `None` where the map has no inverse.
    #[must_use]
    pub fn invert(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let t = &self.0;
        let area = t[0] * t[4] - t[1] * t[3];
        let (dx, dy) = (x - t[2], y - t[5]);
        let point = [(dx * t[4] - dy * t[1]) / area, (dy * t[0] - dx * t[3]) / area];
        (area != 0.0 && point.iter().all(|c| c.is_finite())).then_some(point)
    }

    /// The lengths of a step by a column and by a row, in model units.
    #[must_use]
    pub fn spacing(&self) -> [f64; 2] {
        let t = &self.0;
        [t[0].hypot(t[3]), t[1].hypot(t[4])]
    }

    /// True if every number is finite and the map has an inverse.
    #[must_use]
    pub fn is_regular(&self) -> bool {
        let t = &self.0;
        t.iter().all(|v| v.is_finite()) && t[0] * t[4] - t[1] * t[3] != 0.0
    }
}

/// What a file's own coordinates of a sample meant. Transforms here always lead to the sample itself; this is for writing the
/// same kind of file again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SampleAt {
    /// A sample stands for a cell, and the file's coordinates are those of the cell's corner (GeoTIFF's `PixelIsArea`).
    #[default]
    CellCentre,
    /// The file's coordinates are those of the sample (`PixelIsPoint`).
    Point,
}

/// What model coordinates are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum CrsKind {
    /// Degrees of longitude (x) and latitude (y).
    Geographic,
    /// A plane; this many metres are a unit.
    Projected {
        /// Metres of a unit.
        metres: f64,
    },
    /// Unknown.
    #[default]
    Unknown,
}

/// GeoTIFF's own description, passed on as it was.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GeoKeys {
    /// The directory (tag 34735).
    pub directory: Vec<u16>,
    /// Numbers it refers to (tag 34736).
    pub doubles: Vec<f64>,
    /// Text it refers to (tag 34737).
    pub ascii: String,
}

/// A coordinate reference system, as far as it is understood, and what the file said.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Crs {
    /// What coordinates are.
    pub kind: CrsKind,
    /// A name for people.
    pub name: Option<String>,
    /// The EPSG code of the projected, or else of the geographic system.
    pub epsg: Option<u16>,
    /// The keys of a GeoTIFF.
    pub keys: Option<GeoKeys>,
    /// Well-known text, of a `.prj` file.
    pub wkt: Option<String>,
}

/// Where a grid lies, as far as is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Georeference {
    /// From (column, row) of a sample to its model coordinates, the sample's own place whatever [`Georeference::sample_at`] says.
    pub transform: Option<Affine>,
    /// How the file meant its coordinates.
    pub sample_at: SampleAt,
    /// What model coordinates are.
    pub crs: Option<Crs>,
}

/// The axes of WGS 84: half of the larger in metres, and the square of the eccentricity.
const MAJOR: f64 = 6_378_137.0;
const ECCENTRICITY_2: f64 = 0.006_694_379_990_141_317;

/// Metres of a degree of longitude and of latitude at a latitude in degrees, on the ellipsoid of WGS 84.
#[must_use]
pub fn metres_per_degree(latitude: f64) -> [f64; 2] {
    let (sin, cos) = latitude.to_radians().sin_cos();
    let w = 1.0 - ECCENTRICITY_2 * sin * sin;
    let along = MAJOR * cos.max(0.0) / w.sqrt();
    let across = MAJOR * (1.0 - ECCENTRICITY_2) / (w * w.sqrt());
    [along.to_radians(), across.to_radians()]
}

impl Georeference {
    /// The lengths of a step by a column and by a row in model units; `None` without a transform.
    #[must_use]
    pub fn spacing(&self) -> Option<[f64; 2]> {
        self.transform.map(|t| t.spacing())
    }

    /// The same in metres, for a grid of this size: degrees count with their lengths at its middle. `None` where the unit is unknown.
    ///
    /// No guarantee about distortion: units of a projection are taken at their nominal length.
    #[must_use]
    pub fn spacing_metres(&self, columns: usize, rows: usize) -> Option<[f64; 2]> {
        let t = self.transform?;
        match self.crs.as_ref()?.kind {
            CrsKind::Projected { metres } => Some(t.spacing().map(|s| s * metres)),
            CrsKind::Geographic => {
                let middle = [columns, rows].map(|n| n.saturating_sub(1) as f64 / 2.0);
                let [along, across] = metres_per_degree(t.apply(middle)[1].clamp(-90.0, 90.0));
                let m = t.0;
                Some([(m[0] * along).hypot(m[3] * across), (m[1] * along).hypot(m[4] * across)])
            }
            CrsKind::Unknown => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transform_is_undone_by_its_inverse() {
        let t = Affine([2.0, 0.5, 100.0, -0.25, -3.0, 7.0]);
        let [x, y] = t.apply([3.0, 4.0]);
        let back = t.invert([x, y]).unwrap();
        assert!((back[0] - 3.0).abs() < 1e-12 && (back[1] - 4.0).abs() < 1e-12);
        assert_eq!(t.shifted([3.0, 4.0]).apply([0.0, 0.0]), [x, y]);
        assert_eq!(Affine([1.0, 1.0, 0.0, 1.0, 1.0, 0.0]).invert([1.0, 2.0]), None);
        assert!(!Affine([1.0, 0.0, f64::NAN, 0.0, 1.0, 0.0]).is_regular());
    }

    #[test]
    fn a_degree_has_its_length_on_the_ellipsoid() {
        // The length of a degree of latitude is 110,574 m at the equator and 111,694 m at the poles; of longitude 111,320 m at the equator.
        let [along, across] = metres_per_degree(0.0);
        assert!((along - 111_319.5).abs() < 1.0 && (across - 110_574.3).abs() < 1.0);
        let [along, across] = metres_per_degree(90.0);
        assert!(along.abs() < 1e-6 && (across - 111_693.9).abs() < 1.0);
    }

    #[test]
    fn spacing_in_metres_needs_a_unit() {
        let mut g = Georeference {
            transform: Some(Affine::north_up([11.0, 58.0], [1.0 / 1200.0; 2])),
            ..Default::default()
        };
        assert_eq!(g.spacing_metres(1201, 1201), None);
        g.crs = Some(Crs { kind: CrsKind::Geographic, ..Default::default() });
        let [x, y] = g.spacing_metres(1201, 1201).unwrap();
        assert!((x - 49.9).abs() < 0.1 && (y - 92.8).abs() < 0.1, "{x} {y}");
        g.crs = Some(Crs { kind: CrsKind::Projected { metres: 0.5 }, ..Default::default() });
        assert_eq!(g.spacing_metres(9, 9), g.spacing().map(|s| s.map(|v| 0.5 * v)));
    }
}
