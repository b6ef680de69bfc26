//! Reading OFF: the header, and the text form.

use super::binary::decode_binary;
use super::build::{Announced, Color, Parts};
use crate::io::notes::Notes;
use crate::io::text::{Cursor, Number, PointsReader, line_error, show};
use crate::io::{DecodeError, Decoded};

/// Reads OFF. Never panics; allocates in proportion to `bytes`.
///
/// A vertex or a face begins on its own line; its numbers may run over several. Errors: fewer elements than announced, an index out
/// of range, a coordinate that is not finite, what is no number; each with its line.
pub fn decode(bytes: &[u8]) -> Result<Decoded, DecodeError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut reader = Reader { cursor: Cursor::new(bytes), notes: Notes::default() };
    let Some(first) = reader.token() else {
        return Err(line_error(1, "the file is empty; an OFF file begins with OFF"));
    };
    if let Some(announced) = header(first, &reader)? {
        let after_header = reader.cursor.clone();
        match reader.cursor.token() {
            Some(b"BINARY") => {
                // The numbers begin after the end of this line.
                let mut at = reader.cursor.offset();
                at += bytes[at..].iter().position(|&b| b == b'\n').map_or(bytes.len() - at, |p| p + 1);
                return decode_binary(bytes, at, announced);
            }
            _ => reader.cursor = after_header,
        }
        return reader.body(announced, None);
    }
    reader.body(Announced::default(), Some(first))
}

/// What the header announces; `None` if the file begins with the counts, which Geomview allows.
fn header(token: &[u8], reader: &Reader<'_>) -> Result<Option<Announced>, DecodeError> {
    let Some(prefix) = token.strip_suffix(b"OFF") else {
        return match Number::parse(token) {
            Some(_) => Ok(None),
            None => Err(reader.error(format!("{} where OFF should be", show(token)))),
        };
    };
    let mut announced = Announced::default();
    let mut rest = prefix;
    for (mark, flag) in
        [(&b"ST"[..], &mut announced.uvs), (b"C", &mut announced.colors), (b"N", &mut announced.normals)]
    {
        if let Some(after) = rest.strip_prefix(mark) {
            *flag = true;
            rest = after;
        }
    }
    match rest {
        b"" => Ok(Some(announced)),
        b"4" | b"n" | b"4n" => Err(DecodeError::Unsupported {
            what: format!("{} (points of other than three dimensions)", String::from_utf8_lossy(token)),
        }),
        _ => Err(reader.error(format!("{} where OFF should be", show(token)))),
    }
}

struct Reader<'a> {
    cursor: Cursor<'a>,
    notes: Notes,
}

impl<'a> Reader<'a> {
    fn error(&self, what: impl Into<String>) -> DecodeError {
        line_error(self.cursor.line(), what)
    }

    /// The next token, over lines and comments.
    fn token(&mut self) -> Option<&'a [u8]> {
        loop {
            let token = self.cursor.token_over_lines()?;
            if token[0] != b'#' {
                return Some(token);
            }
            self.skip_line();
        }
    }

    /// The next token of this line.
    fn token_here(&mut self) -> Option<&'a [u8]> {
        let token = self.cursor.token()?;
        if token[0] == b'#' {
            self.skip_line();
            return None;
        }
        Some(token)
    }

    fn skip_line(&mut self) {
        while self.cursor.token().is_some() {}
    }

    /// The next number; `what` and `i` name its element.
    fn number(&mut self, what: &str, i: usize) -> Result<Number, DecodeError> {
        let Some(token) = self.token() else {
            return Err(self.error(format!("the file ends in {what} {i} (from 0)")));
        };
        Number::parse(token).ok_or_else(|| self.error(format!("{what} {i}: {} is no number", show(token))))
    }

    /// A whole number from 0; `token` where it has been read.
    fn count(&mut self, token: Option<&[u8]>, what: &str, i: usize) -> Result<u32, DecodeError> {
        let n = match token {
            Some(t) => {
                Number::parse(t).ok_or_else(|| self.error(format!("{what}: {} is no number", show(t))))?
            }
            None => self.number(what, i)?,
        };
        match n.value {
            x if x >= 0.0 && x < u32::MAX as f64 && x.fract() == 0.0 => Ok(x as u32),
            x => Err(self.error(format!("{what} {i}: {x} is no whole number from 0"))),
        }
    }

    fn body(mut self, announced: Announced, first: Option<&[u8]>) -> Result<Decoded, DecodeError> {
        let vertices = self.count(first, "the number of vertices", 0)? as usize;
        let faces = self.count(None, "the number of faces", 0)? as usize;
        // The number of edges is not used, and some writers leave it out.
        self.skip_line();
        let (mut parts, mut points) = (Parts::default(), PointsReader::default());
        for v in 0..vertices {
            self.vertex(v, announced, &mut points, &mut parts)?;
        }
        for f in 0..faces {
            self.face(f, vertices, &mut parts)?;
        }
        if self.token().is_some() {
            self.notes.at(self.cursor.line(), "what stands after the announced faces is left out");
        }
        Ok(parts.finish(points.finish(), self.notes.into_warnings()))
    }

    fn vertex(
        &mut self,
        v: usize,
        announced: Announced,
        points: &mut PointsReader,
        parts: &mut Parts,
    ) -> Result<(), DecodeError> {
        let mut next = || self.number("vertex", v);
        let p = [next()?, next()?, next()?];
        if announced.normals {
            parts.normals.push([next()?, next()?, next()?].map(|x| x.value as f32));
        }
        points.push(p, self.cursor.line())?;
        let mut rest = Vec::new();
        while let Some(t) = self.token_here() {
            rest.push(t);
        }
        if announced.uvs {
            let Some(at) = rest.len().checked_sub(2) else {
                return Err(self.error(format!("vertex {v}: two texture coordinates should end the line")));
            };
            let uv = rest.split_off(at);
            let number = |t: &[u8]| {
                Number::parse(t)
                    .map(|n| n.value as f32)
                    .ok_or_else(|| self.error(format!("vertex {v}: {} is no number", show(t))))
            };
            parts.uvs.push([number(uv[0])?, number(uv[1])?]);
        }
        let color = match rest.len() {
            3 | 4 => Some(self.color(&rest, "vertex", v, parts)?),
            0 => None,
            _ => {
                self.notes.at(self.cursor.line(), "numbers after a vertex that are no colour are left out");
                None
            }
        };
        if color.is_some() && !announced.colors {
            self.notes.at(self.cursor.line(), "colours that the header does not announce (COFF) are read");
        }
        parts.vertex_color.push(color);
        Ok(())
    }

    fn face(&mut self, f: usize, vertices: usize, parts: &mut Parts) -> Result<(), DecodeError> {
        let n = self.count(None, "face", f)?;
        let start = parts.corners.len();
        for corner in 0..n {
            let v = self.count(None, "face", f)?;
            if v as usize >= vertices {
                let what = format!("face {f}, corner {corner}: vertex {v} of {vertices}; indices run from 0");
                return Err(self.error(what));
            }
            parts.corners.push(v);
        }
        let mut rest = Vec::new();
        while let Some(t) = self.token_here() {
            rest.push(t);
        }
        let color = match rest.len() {
            0 => None,
            1 => {
                self.notes.at(self.cursor.line(), "indices into a colour map are left out");
                None
            }
            3 | 4 => Some(self.color(&rest, "face", f, parts)?),
            _ => {
                self.notes.at(self.cursor.line(), "numbers after a face that are no colour are left out");
                None
            }
        };
        match parts.corners[start..] {
            [] | [_] => {
                parts.corners.truncate(start);
                self.notes.at(self.cursor.line(), "faces of fewer than two corners are left out");
            }
            [a, b] => {
                parts.corners.truncate(start);
                parts.wires.push([a, b]);
            }
            _ => {
                parts.sizes.push(n);
                parts.face_color.push(color);
            }
        }
        Ok(())
    }

    fn color(&self, tokens: &[&[u8]], what: &str, i: usize, parts: &mut Parts) -> Result<Color, DecodeError> {
        let mut color = Color { alpha: tokens.len() == 4, ..Default::default() };
        for (to, t) in color.rgba.iter_mut().zip(tokens) {
            let number = Number::parse(t).filter(|n| n.value.is_finite());
            let Some(number) = number else {
                return Err(self.error(format!("{what} {i}: {} is no colour", show(t))));
            };
            parts.float_colors |= t.iter().any(|b| matches!(b, b'.' | b'e' | b'E'));
            *to = number.value as f32;
        }
        Ok(color)
    }
}
