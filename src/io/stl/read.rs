//! Reading STL.

use super::{FACET, HEADER};
use crate::aif::{MeshInput, Positions};
use crate::io::notes::Notes;
use crate::io::text::{Cursor, Number, PointsReader, line_error, show};
use crate::io::{DecodeError, Decoded};
use crate::scene::{Group, Scene, SceneMesh};
use rustc_hash::FxHashMap;

/// Reads binary or text STL. Never panics; allocates in proportion to `bytes`.
///
/// Errors: a file that ends before its facets do, a coordinate that is not finite (both name the facet), text that is no STL.
pub fn decode(bytes: &[u8]) -> Result<Decoded, DecodeError> {
    let announced = bytes.get(80..HEADER).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let exact = announced.is_some_and(|n| n.checked_mul(FACET).is_some_and(|b| b == bytes.len() - HEADER));
    if !exact && is_text(bytes) {
        return decode_text(bytes);
    }
    match announced {
        Some(facets) => decode_binary(bytes, facets),
        None => Err(DecodeError::Byte {
            offset: bytes.len(),
            what: "neither a text STL (\"solid ...\") nor the 84 bytes a binary one begins with".into(),
        }),
    }
}

/// True for what begins with the word `solid` and goes on as text.
fn is_text(bytes: &[u8]) -> bool {
    let start = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let head = &start[..start.len().min(512)];
    let word = head.get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid"));
    word && head.get(5).is_none_or(|b| b.is_ascii_whitespace()) && !head.contains(&0)
}

fn decode_binary(bytes: &[u8], facets: usize) -> Result<Decoded, DecodeError> {
    let (body, _) = bytes[HEADER..].as_chunks::<FACET>();
    if body.len() < facets {
        let what = format!("{facets} facets announced, but the file ends in facet {} (from 0)", body.len());
        return Err(DecodeError::Byte { offset: bytes.len(), what });
    }
    let body = &body[..facets];
    let mut points: Vec<[f32; 3]> = Vec::with_capacity(3 * body.len());
    let mut colored = 0;
    for (f, facet) in body.iter().enumerate() {
        for (corner, p) in facet[12..48].as_chunks::<12>().0.iter().enumerate() {
            let p: [f32; 3] = std::array::from_fn(|k| {
                f32::from_le_bytes([p[4 * k], p[4 * k + 1], p[4 * k + 2], p[4 * k + 3]])
            });
            check_finite(p.map(f64::from), corner)
                .map_err(|what| DecodeError::Element { element: format!("facet {f}"), what })?;
            points.push(p);
        }
        colored += (facet[48..50] != [0, 0]) as usize;
    }
    let mut warnings = Vec::new();
    if colored > 0 {
        warnings.push(format!("the attribute bytes (colours) of {colored} facets are left out"));
    } else if bytes[..80].windows(6).any(|w| w == b"COLOR=") {
        warnings.push("the colour in the header is left out".into());
    }
    let rest = bytes.len() - HEADER - FACET * facets;
    if rest > 0 {
        warnings.push(format!("{rest} bytes after the {facets} announced facets are left out"));
    }
    Ok(finish(Positions::F32(points), Vec::new(), Vec::new(), warnings))
}

/// Refuses a coordinate that is not finite, in words that go after the facet.
fn check_finite(p: [f64; 3], corner: usize) -> Result<(), String> {
    match p.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(k) => {
            Err(format!("{} of corner {corner} is {}; coordinates must be finite", b"xyz"[k] as char, p[k]))
        }
    }
}

/// A cursor that knows which facet it is in.
struct Text<'a> {
    cursor: Cursor<'a>,
    facet: usize,
}

impl<'a> Text<'a> {
    fn error(&self, what: &str) -> DecodeError {
        line_error(self.cursor.line(), format!("facet {}: {what}", self.facet))
    }

    fn token(&mut self, wanted: &str) -> Result<&'a [u8], DecodeError> {
        match self.cursor.token_over_lines() {
            Some(token) => Ok(token),
            None => Err(self.error(&format!("the file ends where {wanted} should be"))),
        }
    }

    fn expect(&mut self, word: &str) -> Result<(), DecodeError> {
        let token = self.token(word)?;
        if token.eq_ignore_ascii_case(word.as_bytes()) {
            return Ok(());
        }
        Err(self.error(&format!("{} where {word} should be", show(token))))
    }

    fn coordinate(&mut self) -> Result<Number, DecodeError> {
        let token = self.token("a coordinate")?;
        Number::parse(token).ok_or_else(|| self.error(&format!("coordinate {} is no number", show(token))))
    }

    /// What follows `facet`, its points into `points`.
    fn facet(&mut self, points: &mut PointsReader) -> Result<(), DecodeError> {
        self.expect("normal")?;
        // Often NaN for a facet without area; not used, so not looked at.
        for _ in 0..3 {
            self.token("a normal")?;
        }
        self.expect("outer")?;
        self.expect("loop")?;
        for corner in 0..3 {
            self.expect("vertex")?;
            let p = [self.coordinate()?, self.coordinate()?, self.coordinate()?];
            check_finite(p.map(|x| x.value), corner).map_err(|what| self.error(&what))?;
            points.push(p, self.cursor.line())?;
        }
        self.expect("endloop")?;
        self.expect("endfacet")
    }
}

fn decode_text(bytes: &[u8]) -> Result<Decoded, DecodeError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut text = Text { cursor: Cursor::new(bytes), facet: 0 };
    let mut points = PointsReader::default();
    let (mut groups, mut face_group) = (Vec::new(), Vec::new());
    let mut notes = Notes::default();
    while let Some(token) = text.cursor.token_over_lines() {
        if !token.eq_ignore_ascii_case(b"solid") {
            if groups.is_empty() {
                return Err(text.error(&format!("{} where solid should be", show(token))));
            }
            notes.at(text.cursor.line(), "what stands after the last solid is left out");
            break;
        }
        let name = text.cursor.rest_of_line();
        groups.push(Group { object: Some(name).filter(|n| !n.is_empty()), ..Default::default() });
        loop {
            let token = text.token("facet or endsolid")?;
            if token.eq_ignore_ascii_case(b"endsolid") {
                text.cursor.rest_of_line();
                break;
            }
            if !token.eq_ignore_ascii_case(b"facet") {
                return Err(text.error(&format!("{} where facet or endsolid should be", show(token))));
            }
            text.facet(&mut points)?;
            text.facet += 1;
            face_group.push(groups.len() as u32 - 1);
        }
    }
    Ok(finish(points.finish(), groups, face_group, notes.into_warnings()))
}

/// Welds, and makes the scene. A single group becomes the mesh's name.
fn finish(
    points: Positions,
    mut groups: Vec<Group>,
    mut face_group: Vec<u32>,
    mut warnings: Vec<String>,
) -> Decoded {
    let mut seen: FxHashMap<[u64; 3], u32> = FxHashMap::default();
    // A closed mesh has half as many vertices as facets.
    seen.reserve(points.len() / 6 + 1);
    let (mut kept, mut corners) = (Vec::new(), Vec::with_capacity(points.len()));
    for i in 0..points.len() {
        let next = kept.len() as u32;
        let v = *seen.entry(points.bits(i)).or_insert(next);
        if v == next {
            kept.push(i as u32);
        }
        corners.push(v);
    }
    if kept.len() < points.len() {
        let (n, m) = (points.len(), kept.len());
        warnings.push(format!("STL has no shared vertices: welded bit-equal positions, {n} -> {m}"));
    }
    let mut name = None;
    if groups.len() == 1 {
        name = groups.remove(0).object;
        face_group.clear();
    }
    let geometry = MeshInput { positions: points.gather(&kept), corners, face_group, ..Default::default() };
    Decoded { scene: Scene::from_mesh(SceneMesh { name, geometry, groups, ..Default::default() }), warnings }
}
