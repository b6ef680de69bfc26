//! The header of a PLY file.

use crate::aif::Encoding;
use crate::io::DecodeError;
use crate::io::text::{Cursor, line_error, show};

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    /// By either of the two families of names.
    fn from_name(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Scalar::I8,
            b"uchar" | b"uint8" => Scalar::U8,
            b"short" | b"int16" => Scalar::I16,
            b"ushort" | b"uint16" => Scalar::U16,
            b"int" | b"int32" => Scalar::I32,
            b"uint" | b"uint32" => Scalar::U32,
            b"float" | b"float32" => Scalar::F32,
            b"double" | b"float64" => Scalar::F64,
            _ => return None,
        })
    }

    pub(super) fn name(self) -> &'static str {
        ["char", "uchar", "short", "ushort", "int", "uint", "float", "double"][self as usize]
    }

    /// Bytes it takes in a binary file.
    pub(super) fn size(self) -> usize {
        [1, 1, 2, 2, 4, 4, 4, 8][self as usize]
    }

    /// How a channel of such values is stored, values as they are.
    pub(super) fn encoding(self) -> Encoding {
        use Encoding::*;
        [I8, U8, I16, U16, I32, U32, F32, F64][self as usize]
    }

    /// How a colour of such values is stored, and what stands for 1.
    pub(super) fn color(self) -> (Encoding, f64) {
        match self {
            Scalar::U8 => (Encoding::U8Norm, 255.0),
            Scalar::U16 => (Encoding::U16Norm, 65535.0),
            other => (other.encoding(), 1.0),
        }
    }
}

/// A number, or a list of them after their count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    One(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// The first scalar property of this name.
    pub(super) fn scalar(&self, name: &str) -> Option<(usize, Scalar)> {
        self.properties.iter().enumerate().find(|(_, p)| p.name == name).and_then(|(i, p)| match p.kind {
            Kind::One(t) => Some((i, t)),
            Kind::List { .. } => None,
        })
    }

    /// The first list property of one of these names.
    pub(super) fn list(&self, names: &[&str]) -> Option<usize> {
        let is = |p: &Property| matches!(p.kind, Kind::List { .. }) && names.contains(&p.name.as_str());
        self.properties.iter().position(is)
    }

    /// The fewest bytes one such element takes.
    pub(super) fn least_bytes(&self, format: Format) -> usize {
        let of = |p: &Property| match (format, p.kind) {
            // A digit and a separator.
            (Format::Text, _) => 2,
            (_, Kind::One(t)) => t.size(),
            (_, Kind::List { count, .. }) => count.size(),
        };
        self.properties.iter().map(of).sum()
    }
}

/// How the data are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Text,
    Little,
    Big,
}

#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) format: Format,
    pub(super) elements: Vec<Element>,
    /// What `comment TextureFile` names.
    pub(super) textures: Vec<String>,
    /// Where the data begin: byte and line.
    pub(super) body: usize,
    pub(super) body_line: usize,
}

impl Header {
    pub(super) fn parse(bytes: &[u8]) -> Result<Header, DecodeError> {
        let mut cursor = Cursor::new(bytes);
        if cursor.token() != Some(b"ply") {
            return Err(line_error(1, "a PLY file begins with the line \"ply\""));
        }
        // A lone CR ends the header's lines only if it ends the first: else the data may begin with a LF.
        let lone_cr = bytes.get(3) == Some(&b'\r') && bytes.get(4) != Some(&b'\n');
        let mut format = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut textures = Vec::new();
        loop {
            if !cursor.next_line() {
                return Err(line_error(cursor.line(), "the header ends without end_header"));
            }
            let line = cursor.line();
            let Some(word) = cursor.token() else { continue };
            match word {
                b"comment" => {
                    if cursor.token().is_some_and(|t| t.eq_ignore_ascii_case(b"TextureFile")) {
                        textures.push(cursor.rest_of_line());
                    }
                }
                b"obj_info" => {}
                b"format" => {
                    format = Some(match cursor.token() {
                        Some(b"ascii") => Format::Text,
                        Some(b"binary_little_endian") => Format::Little,
                        Some(b"binary_big_endian") => Format::Big,
                        other => {
                            let what = format!(
                                "format {}; it must be ascii, binary_little_endian or binary_big_endian",
                                show(other.unwrap_or(b""))
                            );
                            return Err(line_error(line, what));
                        }
                    });
                }
                b"element" => {
                    let (name, count) = (cursor.token(), cursor.token());
                    let count = count.and_then(|c| std::str::from_utf8(c).ok()?.parse::<u64>().ok());
                    let (Some(name), Some(count)) = (name, count) else {
                        return Err(line_error(line, "an element needs a name and how many there are"));
                    };
                    let name = String::from_utf8_lossy(name).into_owned();
                    if elements.iter().any(|e| e.name == name) {
                        return Err(line_error(line, format!("element {name} comes twice")));
                    }
                    elements.push(Element { name, count, properties: Vec::new() });
                }
                b"property" => {
                    let property = property(&mut cursor, line)?;
                    match elements.last_mut() {
                        Some(element) => element.properties.push(property),
                        None => return Err(line_error(line, "a property before any element")),
                    }
                }
                b"end_header" => break,
                other => return Err(line_error(line, format!("{} is no word of a PLY header", show(other)))),
            }
        }
        let Some(format) = format else {
            return Err(line_error(cursor.line(), "the header has no format line"));
        };
        cursor.skip_comment();
        let line = cursor.line();
        let end = cursor.offset();
        let eol = match (bytes.get(end), bytes.get(end + 1)) {
            (Some(b'\r'), Some(b'\n')) if !lone_cr => 2,
            (Some(_), _) => 1,
            (None, _) => 0,
        };
        Ok(Header { format, elements, textures, body: end + eol, body_line: line + 1 })
    }
}

fn property(cursor: &mut Cursor<'_>, line: usize) -> Result<Property, DecodeError> {
    let mut scalar = || {
        let name = cursor.token().unwrap_or(b"");
        Scalar::from_name(name)
            .ok_or_else(|| line_error(line, format!("{} is no type of a property", show(name))))
            .or_else(|e| if name == b"list" { Ok(Scalar::U8) } else { Err(e) })
            .map(|t| (t, name == b"list"))
    };
    let kind = match scalar()? {
        (t, false) => Kind::One(t),
        (_, true) => {
            let ((count, a), (item, b)) = (scalar()?, scalar()?);
            if a || b || matches!(count, Scalar::F32 | Scalar::F64) {
                return Err(line_error(
                    line,
                    "a list needs a whole-number type for its count, and a type for its items",
                ));
            }
            Kind::List { count, item }
        }
    };
    let Some(name) = cursor.token() else {
        return Err(line_error(line, "a property needs a name"));
    };
    Ok(Property { name: String::from_utf8_lossy(name).into_owned(), kind })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_in_all_line_ends() {
        for eol in ["\n", "\r\n", "\r"] {
            let text = [
                "ply",
                "format binary_big_endian 1.0",
                "comment TextureFile my tex.png",
                "obj_info x",
                "element vertex 7",
                "property float32 x",
                "property list uchar int f",
                "end_header",
                "",
            ]
            .join(eol);
            let mut bytes = text.into_bytes();
            let body = bytes.len();
            bytes.extend_from_slice(b"\n\r\n");
            let h = Header::parse(&bytes).unwrap();
            assert_eq!((h.format, h.body, h.body_line), (Format::Big, body, 9));
            assert_eq!(h.textures, ["my tex.png"]);
            assert_eq!((h.elements[0].count, h.elements[0].scalar("x")), (7, Some((0, Scalar::F32))));
            assert_eq!(h.elements[0].properties[1].kind, Kind::List { count: Scalar::U8, item: Scalar::I32 });
        }
    }

    #[test]
    fn errors_name_the_line() {
        for (text, want) in [
            ("plx\n", "line 1: a PLY file begins with the line \"ply\""),
            ("", "line 1: a PLY file begins with the line \"ply\""),
            (
                "ply\nformat xml 1.0\n",
                "line 2: format \"xml\"; it must be ascii, binary_little_endian or binary_big_endian",
            ),
            ("ply\nelement vertex -3\n", "line 2: an element needs a name and how many there are"),
            ("ply\nproperty float x\n", "line 2: a property before any element"),
            ("ply\nelement v 1\nproperty quad x\n", "line 3: \"quad\" is no type of a property"),
            ("ply\nelement v 1\nproperty float\n", "line 3: a property needs a name"),
            ("ply\nelement v 1\nproperty list float int x\n", "line 3: a list needs a whole-number type"),
            ("ply\nelement v 1\nelement v 1\n", "line 3: element v comes twice"),
            ("ply\nwhat\n", "line 2: \"what\" is no word of a PLY header"),
            ("ply\nend_header\n", "line 2: the header has no format line"),
            ("ply\nformat ascii 1.0", "line 2: the header ends without end_header"),
        ] {
            let got = Header::parse(text.as_bytes()).unwrap_err().to_string();
            assert!(got.starts_with(want), "{text:?}: {got}");
        }
    }
}
