//! Reading the lines of GeoJSON (RFC 7946): LineString and MultiLineString, alone, in features, or in collections.

use super::DecodeError;
use serde_json::Value;

/// Lines of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lines {
    /// Each of two points or more, x and y as they are written.
    pub lines: Vec<Vec<[f64; 2]>>,
    /// Geometries that are no lines, and were left out.
    pub others: usize,
}

fn bad(element: &str, what: &str) -> DecodeError {
    DecodeError::Element { element: element.into(), what: what.into() }
}

/// Reads all lines.
///
/// # Errors
/// [`DecodeError`] for what is no JSON or no GeoJSON, naming the element.
pub fn decode_lines(bytes: &[u8]) -> Result<Lines, DecodeError> {
    let document: Value = serde_json::from_slice(bytes)
        .map_err(|e| DecodeError::Line { line: e.line(), what: format!("no JSON: {e}") })?;
    let mut out = Lines::default();
    geometry(&document, "file", &mut out)?;
    Ok(out)
}

fn list<'a>(at: &'a Value, key: &str, name: &str) -> Result<&'a Vec<Value>, DecodeError> {
    at.get(key).and_then(Value::as_array).ok_or_else(|| bad(name, &format!("needs a list `{key}`")))
}

/// JSON is nested at most 128 deep when it comes here.
fn geometry(at: &Value, name: &str, out: &mut Lines) -> Result<(), DecodeError> {
    let kind =
        at.get("type").and_then(Value::as_str).ok_or_else(|| bad(name, "needs a `type`: is it GeoJSON?"))?;
    match kind {
        "FeatureCollection" => {
            for (i, feature) in list(at, "features", name)?.iter().enumerate() {
                geometry(feature, &format!("features[{i}]"), out)?;
            }
        }
        // Without a place it has a geometry of null.
        "Feature" => match at.get("geometry") {
            None | Some(Value::Null) => {}
            Some(g) => geometry(g, name, out)?,
        },
        "GeometryCollection" => {
            for (i, g) in list(at, "geometries", name)?.iter().enumerate() {
                geometry(g, &format!("{name}.geometries[{i}]"), out)?;
            }
        }
        "LineString" => out.lines.push(line(list(at, "coordinates", name)?, name)?),
        "MultiLineString" => {
            for (i, points) in list(at, "coordinates", name)?.iter().enumerate() {
                let name = format!("{name}.coordinates[{i}]");
                let points = points.as_array().ok_or_else(|| bad(&name, "must be a list of points"))?;
                out.lines.push(line(points, &name)?);
            }
        }
        "Point" | "MultiPoint" | "Polygon" | "MultiPolygon" => out.others += 1,
        _ => return Err(bad(name, "has a type that GeoJSON does not know")),
    }
    Ok(())
}

fn line(points: &[Value], name: &str) -> Result<Vec<[f64; 2]>, DecodeError> {
    if points.len() < 2 {
        return Err(bad(name, "a line needs two points"));
    }
    let point = |(i, p): (usize, &Value)| {
        let number = |k: usize| p.get(k).and_then(Value::as_f64).filter(|c| c.is_finite());
        match (number(0), number(1)) {
            (Some(x), Some(y)) => Ok([x, y]),
            _ => Err(bad(&format!("{name}, point {i}"), "must be two numbers or more")),
        }
    };
    points.iter().enumerate().map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_found_wherever_they_are() {
        let text = r#"{"type": "FeatureCollection", "features": [
            {"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": [[1, 2, 9], [3, 4.5]]}},
            {"type": "Feature", "properties": {}, "geometry": null},
            {"type": "Feature", "geometry": {"type": "GeometryCollection", "geometries": [
                {"type": "Point", "coordinates": [0, 0]},
                {"type": "MultiLineString", "coordinates": [[[0, 0], [1, 0]], [[5, 5], [6, 6], [7, 5]]]}]}}]}"#;
        let lines = decode_lines(text.as_bytes()).unwrap();
        assert_eq!(lines.others, 1);
        assert_eq!(
            lines.lines,
            [
                vec![[1.0, 2.0], [3.0, 4.5]],
                vec![[0.0, 0.0], [1.0, 0.0]],
                vec![[5.0, 5.0], [6.0, 6.0], [7.0, 5.0]]
            ]
        );
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, part) in [
            ("{", "line 1: no JSON"),
            ("[]", "file: needs a `type`"),
            (r#"{"type": "Circle"}"#, "does not know"),
            (r#"{"type": "FeatureCollection"}"#, "a list `features`"),
            (r#"{"type": "LineString", "coordinates": [[1, 2]]}"#, "two points"),
            (r#"{"type": "LineString", "coordinates": [[1, 2], [1, "x"]]}"#, "point 1"),
            (r#"{"type": "MultiLineString", "coordinates": [7]}"#, "coordinates[0]"),
        ] {
            let error = decode_lines(text.as_bytes()).unwrap_err().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
        assert!(decode_lines("[".repeat(100_000).as_bytes()).is_err());
    }
}
