//! GeoTIFF's tags: where the image lies (OGC 19-008r4).

use super::super::DecodeError;
use super::super::source::ReadAt;
use super::directory::Directory;
use crate::terrain::{Affine, Crs, CrsKind, GeoKeys, Georeference, SampleAt};

pub(crate) const PIXEL_SCALE: u16 = 33550;
pub(crate) const TIEPOINT: u16 = 33922;
pub(crate) const TRANSFORMATION: u16 = 34264;
pub(crate) const KEYS: u16 = 34735;
pub(crate) const KEY_DOUBLES: u16 = 34736;
pub(crate) const KEY_ASCII: u16 = 34737;
pub(crate) const NODATA: u16 = 42113;

const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
const CITATION: u16 = 1026;
const GEODETIC_CRS: u16 = 2048;
const GEODETIC_CITATION: u16 = 2049;
const ANGULAR_UNITS: u16 = 2054;
const PROJECTED_CRS: u16 = 3072;
const PROJECTED_CITATION: u16 = 3073;
const LINEAR_UNITS: u16 = 3076;
const LINEAR_UNIT_SIZE: u16 = 3077;
/// "User-defined" and above are no codes.
const USER_DEFINED: u16 = 32767;

/// What the tags say; what they cannot say clearly is a warning.
pub(super) fn georeference(
    directory: &Directory,
    source: &dyn ReadAt,
    warnings: &mut Vec<String>,
) -> Result<Georeference, DecodeError> {
    let keys = read_keys(directory, source)?;
    let at = match keys.as_ref().and_then(|k| code(k, RASTER_TYPE)) {
        Some(2) => SampleAt::Point,
        _ => SampleAt::CellCentre,
    };
    let corner = transform(directory, source, warnings)?;
    // The tags place raster coordinates; where these are of cells, the first sample is half a cell inside.
    let to_sample = match at {
        SampleAt::Point => [0.0, 0.0],
        SampleAt::CellCentre => [0.5, 0.5],
    };
    let transform = corner.map(|t| t.shifted(to_sample)).filter(|t| {
        let good = t.is_regular();
        if !good {
            warnings.push("the transform has no inverse, or numbers that are none; it is left out".into());
        }
        good
    });
    Ok(Georeference { transform, sample_at: at, crs: keys.map(crs) })
}

fn transform(
    directory: &Directory,
    source: &dyn ReadAt,
    warnings: &mut Vec<String>,
) -> Result<Option<Affine>, DecodeError> {
    let matrix = directory.floats(source, TRANSFORMATION)?;
    if let [a, b, _, c, d, e, _, f, ..] = matrix[..] {
        return Ok(Some(Affine([a, b, c, d, e, f])));
    }
    let (scale, tie) = (directory.floats(source, PIXEL_SCALE)?, directory.floats(source, TIEPOINT)?);
    Ok(match (&scale[..], &tie[..]) {
        (&[sx, sy, ..], &[i, j, _, x, y, ..]) => Some(Affine([sx, 0.0, x - sx * i, 0.0, -sy, y + sy * j])),
        ([], [_, ..]) => {
            warnings.push("it is placed by control points alone, which are not used".into());
            None
        }
        _ => None,
    })
}

fn read_keys(directory: &Directory, source: &dyn ReadAt) -> Result<Option<GeoKeys>, DecodeError> {
    if !directory.has(KEYS) {
        return Ok(None);
    }
    // Of type SHORT, so that every number is a u16.
    let numbers = directory.wholes(source, KEYS)?.into_iter().map(|n| n as u16).collect();
    Ok(Some(GeoKeys {
        directory: numbers,
        doubles: directory.floats(source, KEY_DOUBLES)?,
        ascii: directory.text(source, KEY_ASCII)?.unwrap_or_default(),
    }))
}

/// Key, tag, count, value.
fn find(keys: &GeoKeys, key: u16) -> Option<[u16; 4]> {
    let entries = keys.directory.get(4..)?.chunks_exact(4);
    entries.map(|e| [e[0], e[1], e[2], e[3]]).find(|e| e[0] == key)
}

fn code(keys: &GeoKeys, key: u16) -> Option<u16> {
    find(keys, key).filter(|e| e[1] == 0).map(|e| e[3])
}

fn number(keys: &GeoKeys, key: u16) -> Option<f64> {
    let at = find(keys, key).filter(|e| e[1] == KEY_DOUBLES)?[3];
    keys.doubles.get(usize::from(at)).copied()
}

fn text(keys: &GeoKeys, key: u16) -> Option<String> {
    let [_, _, count, at] = find(keys, key).filter(|e| e[1] == KEY_ASCII)?;
    let text = keys.ascii.get(usize::from(at)..usize::from(at) + usize::from(count))?;
    Some(text.trim_end_matches(['|', '\0']).trim().to_string()).filter(|t| !t.is_empty())
}

/// Metres of a linear unit by its EPSG code.
fn metres_of(unit: u16) -> Option<f64> {
    Some(match unit {
        9001 => 1.0,
        9002 => 0.3048,
        9003 => 1200.0 / 3937.0,
        9036 => 1000.0,
        _ => return None,
    })
}

fn crs(keys: GeoKeys) -> Crs {
    let epsg = |key| code(&keys, key).filter(|&c| c > 0 && c < USER_DEFINED);
    let kind = match code(&keys, MODEL_TYPE) {
        Some(2) => match code(&keys, ANGULAR_UNITS) {
            None | Some(9102) => CrsKind::Geographic,
            // Radians and grads: no unit that grids come in.
            Some(_) => CrsKind::Unknown,
        },
        Some(1) => {
            let unit = code(&keys, LINEAR_UNITS);
            // The unit of an EPSG system is not said again; nearly all have metres.
            let metres = match unit {
                Some(USER_DEFINED) => number(&keys, LINEAR_UNIT_SIZE),
                Some(unit) => metres_of(unit),
                None => Some(1.0),
            };
            let known = |metres: f64| CrsKind::Projected { metres };
            metres.filter(|m| m.is_finite() && *m > 0.0).map_or(CrsKind::Unknown, known)
        }
        _ => CrsKind::Unknown,
    };
    let name = [PROJECTED_CITATION, CITATION, GEODETIC_CITATION].into_iter().find_map(|k| text(&keys, k));
    Crs { kind, name, epsg: epsg(PROJECTED_CRS).or_else(|| epsg(GEODETIC_CRS)), keys: Some(keys), wkt: None }
}

/// Keys for a system that came without any.
pub(crate) fn plain_keys(g: &Georeference) -> GeoKeys {
    let raster = match g.sample_at {
        SampleAt::CellCentre => 1,
        SampleAt::Point => 2,
    };
    let crs = g.crs.clone().unwrap_or_default();
    let mut entries = vec![[RASTER_TYPE, 0, 1, raster]];
    let mut ascii = String::new();
    if let Some(name) = crs.name.filter(|n| n.is_ascii() && n.len() < 1000) {
        entries.push([CITATION, KEY_ASCII, name.len() as u16 + 1, 0]);
        ascii = name + "|";
    }
    let code = crs.epsg.unwrap_or(USER_DEFINED);
    match crs.kind {
        CrsKind::Geographic => {
            entries.extend([[MODEL_TYPE, 0, 1, 2], [GEODETIC_CRS, 0, 1, code], [ANGULAR_UNITS, 0, 1, 9102]]);
        }
        CrsKind::Projected { metres } => {
            entries.extend([[MODEL_TYPE, 0, 1, 1], [PROJECTED_CRS, 0, 1, code]]);
            let unit = [9001, 9002, 9003].into_iter().find(|&u| metres_of(u) == Some(metres));
            entries.push([LINEAR_UNITS, 0, 1, unit.unwrap_or(USER_DEFINED)]);
            if unit.is_none() {
                entries.push([LINEAR_UNIT_SIZE, KEY_DOUBLES, 1, 0]);
                let count = entries.len() as u16;
                return keys_of(entries, count, vec![metres], ascii);
            }
        }
        CrsKind::Unknown => {}
    }
    let count = entries.len() as u16;
    keys_of(entries, count, vec![], ascii)
}

/// Sorted, behind their head.
fn keys_of(mut entries: Vec<[u16; 4]>, count: u16, doubles: Vec<f64>, ascii: String) -> GeoKeys {
    entries.sort_unstable();
    let directory = [[1, 1, 0, count]].into_iter().chain(entries).flatten().collect();
    GeoKeys { directory, doubles, ascii }
}
