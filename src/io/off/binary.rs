//! Reading `OFF BINARY`: big-endian 32-bit integers and floats.

use super::build::{Announced, Color, Parts};
use crate::aif::Positions;
use crate::io::{DecodeError, Decoded};

struct Binary<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Binary<'_> {
    fn error(&self, what: String) -> DecodeError {
        DecodeError::Byte { offset: self.at, what }
    }

    fn word(&mut self, what: &str, i: usize) -> Result<[u8; 4], DecodeError> {
        match self.bytes.get(self.at..self.at + 4) {
            Some(&[a, b, c, d]) => {
                self.at += 4;
                Ok([a, b, c, d])
            }
            _ => Err(self.error(format!("the file ends in {what} {i} (from 0)"))),
        }
    }

    fn count(&mut self, what: &str, i: usize) -> Result<usize, DecodeError> {
        let n = i32::from_be_bytes(self.word(what, i)?);
        usize::try_from(n).map_err(|_| self.error(format!("{what} {i}: {n} is below 0")))
    }

    fn floats<const N: usize>(&mut self, what: &str, i: usize) -> Result<[f32; N], DecodeError> {
        let mut out = [0.0; N];
        for x in &mut out {
            *x = f32::from_be_bytes(self.word(what, i)?);
        }
        Ok(out)
    }
}

/// Reads what follows the header line, which ends before byte `at`.
pub(super) fn decode_binary(bytes: &[u8], at: usize, announced: Announced) -> Result<Decoded, DecodeError> {
    let mut b = Binary { bytes, at };
    let vertices = b.count("the number of vertices", 0)?;
    let faces = b.count("the number of faces", 0)?;
    b.count("the number of edges", 0)?;
    let (mut points, mut warnings) = (Vec::new(), Vec::new());
    let mut parts = Parts { float_colors: true, ..Default::default() };
    for v in 0..vertices {
        let p: [f32; 3] = b.floats("vertex", v)?;
        if let Some(k) = p.iter().position(|x| !x.is_finite()) {
            let axis = b"xyz"[k] as char;
            return Err(b.error(format!("vertex {v}: {axis} is {}; coordinates must be finite", p[k])));
        }
        points.push(p);
        if announced.normals {
            parts.normals.push(b.floats("vertex", v)?);
        }
        if announced.colors {
            parts.vertex_color.push(Some(Color { rgba: b.floats("vertex", v)?, alpha: true }));
        }
        if announced.uvs {
            parts.uvs.push(b.floats("vertex", v)?);
        }
    }
    let mut small = 0;
    for f in 0..faces {
        let n = b.count("face", f)?;
        let start = parts.corners.len();
        for corner in 0..n {
            let v = b.count("face", f)?;
            if v >= vertices {
                return Err(b.error(format!("face {f}, corner {corner}: vertex {v} of {vertices}")));
            }
            parts.corners.push(v as u32);
        }
        let numbers = b.count("face", f)?;
        let color = match numbers {
            0 => None,
            3 => {
                let [x, y, z] = b.floats("face", f)?;
                Some(Color { rgba: [x, y, z, 1.0], alpha: false })
            }
            4 => Some(Color { rgba: b.floats("face", f)?, alpha: true }),
            _ => {
                for _ in 0..numbers {
                    b.word("face", f)?;
                }
                None
            }
        };
        match parts.corners[start..] {
            [] | [_] => {
                parts.corners.truncate(start);
                small += 1;
            }
            [x, y] => {
                parts.corners.truncate(start);
                parts.wires.push([x, y]);
            }
            _ => {
                parts.sizes.push(n as u32);
                parts.face_color.push(color);
            }
        }
    }
    if small > 0 {
        warnings.push(format!("{small} faces of fewer than two corners are left out"));
    }
    if b.at < bytes.len() {
        warnings.push(format!("{} bytes after the announced faces are left out", bytes.len() - b.at));
    }
    Ok(parts.finish(Positions::F32(points), warnings))
}
