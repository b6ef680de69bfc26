//! What a mesh's faces and vertices have beside, as bytes: what the `XTRA` chunk of a `.pm` holds (docs/pm-scene.md).
//!
//! A u32 (little-endian) gives the length of a JSON object, which follows; then comes a zlib stream, of which the object names parts by `[offset, length]`. Numbers are
//! little-endian, and stand by bytes: first the first bytes of all, then the second ones. Zeros behind it keep what it inflates to within 64 times its size.

use super::chunk::wrong;
use crate::aif::Encoding;
use crate::io::DecodeError;
use crate::scene::{Extras, FaceValues, LooseRows};
use flate2::Compression;
use flate2::read::{ZlibDecoder, ZlibEncoder};
use serde::{Deserialize, Serialize};
use std::io::Read;

/// What inflates to more is refused: so the size of a file bounds what reading it takes.
const EXPANSION: u64 = 64;

type Span = (u64, u64);

#[derive(Serialize, Deserialize)]
struct Head {
    /// Rows of the values of faces: one for each face of the input, in its order.
    rows: u64,
    faces: Vec<Column>,
    vertices: Span,
    present: Span,
    values: Span,
}

#[derive(Serialize, Deserialize)]
struct Column {
    name: String,
    /// As FORMAT.md numbers encodings of sources.
    encoding: u8,
    /// A single number stands for all rows.
    values: Span,
}

/// Bytes of a number, and its bytes.
fn stored(encoding: Encoding, x: f64) -> (usize, [u8; 8]) {
    let mut out = [0; 8];
    let mut put = |bytes: &[u8]| {
        out[..bytes.len()].copy_from_slice(bytes);
        bytes.len()
    };
    let size = match encoding {
        Encoding::F32 => put(&(x as f32).to_le_bytes()),
        Encoding::F64 => put(&x.to_le_bytes()),
        Encoding::U8 | Encoding::U8Norm => put(&(x as u8).to_le_bytes()),
        Encoding::I8 | Encoding::I8Norm => put(&(x as i8).to_le_bytes()),
        Encoding::U16 | Encoding::U16Norm => put(&(x as u16).to_le_bytes()),
        Encoding::I16 | Encoding::I16Norm => put(&(x as i16).to_le_bytes()),
        Encoding::U32 => put(&(x as u32).to_le_bytes()),
        Encoding::I32 => put(&(x as i32).to_le_bytes()),
    };
    (size, out)
}

fn value(encoding: Encoding, b: [u8; 8]) -> f64 {
    let [b0, b1, b2, b3, ..] = b;
    let four = [b0, b1, b2, b3];
    match encoding {
        Encoding::F32 => f32::from_le_bytes(four) as f64,
        Encoding::F64 => f64::from_le_bytes(b),
        Encoding::U8 | Encoding::U8Norm => b0 as f64,
        Encoding::I8 | Encoding::I8Norm => b0 as i8 as f64,
        Encoding::U16 | Encoding::U16Norm => u16::from_le_bytes([b0, b1]) as f64,
        Encoding::I16 | Encoding::I16Norm => i16::from_le_bytes([b0, b1]) as f64,
        Encoding::U32 => u32::from_le_bytes(four) as f64,
        Encoding::I32 => i32::from_le_bytes(four) as f64,
    }
}

/// Numbers of `size` bytes by bytes, at the end of `data`.
fn put(data: &mut Vec<u8>, size: usize, numbers: &[[u8; 8]]) -> Span {
    let start = data.len() as u64;
    for k in 0..size {
        data.extend(numbers.iter().map(|n| n[k]));
    }
    (start, data.len() as u64 - start)
}

/// Extras as bytes. Values of faces are those of rows 0, 1, ... for the faces of the input in turn.
pub(super) fn write(extras: &Extras) -> Vec<u8> {
    let mut data = Vec::new();
    let rows = extras.rows();
    let faces = extras
        .of_faces
        .iter()
        .map(|of| {
            let (mut size, mut numbers) = (1, Vec::with_capacity(rows));
            for &x in &of.values[..rows] {
                let (n, bytes) = stored(of.encoding, x);
                size = n;
                numbers.push(bytes);
            }
            if numbers.windows(2).all(|w| w[0] == w[1]) {
                numbers.truncate(1);
            }
            let encoding = Encoding::ALL.iter().position(|&e| e == of.encoding).unwrap_or(0) as u8;
            Column { name: of.name.clone(), encoding, values: put(&mut data, size, &numbers) }
        })
        .collect();
    let wide = |b: &[u8]| {
        let mut out = [0; 8];
        out[..b.len()].copy_from_slice(b);
        out
    };
    let l = &extras.loose;
    let words = |x: &u32| wide(&x.to_le_bytes());
    let vertices = put(&mut data, 4, &l.vertices.iter().map(words).collect::<Vec<_>>());
    let present = put(&mut data, 8, &l.present.iter().map(|x| x.to_le_bytes()).collect::<Vec<_>>());
    let values = put(&mut data, 4, &l.rows.iter().map(|x| words(&x.to_bits())).collect::<Vec<_>>());
    let head = Head { rows: rows as u64, faces, vertices, present, values };
    let json = serde_json::to_vec(&head).unwrap_or_default();
    let mut out = (json.len() as u32).to_le_bytes().to_vec();
    out.extend_from_slice(&json);
    let start = out.len();
    // Reading from memory and writing to it cannot fail.
    let _ = ZlibEncoder::new(&data[..], Compression::new(9)).read_to_end(&mut out);
    out.resize(out.len().max(start + data.len().div_ceil(EXPANSION as usize)), 0);
    out
}

/// The extras that [`write`] wrote.
///
/// Errors: what is not as [`write`] writes it.
pub(super) fn read(bytes: &[u8]) -> Result<Extras, DecodeError> {
    let bad = |what: &str| wrong("extras", what);
    let (length, rest) = bytes.split_first_chunk::<4>().ok_or_else(|| bad("end too early"))?;
    let (json, packed) =
        rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or_else(|| bad("end too early"))?;
    let head: Head = serde_json::from_slice(json).map_err(|e| wrong("extras", e.to_string()))?;
    let most = EXPANSION * packed.len() as u64;
    let mut data = Vec::new();
    let inflated = ZlibDecoder::new(packed).take(most + 1).read_to_end(&mut data);
    inflated.map_err(|e| wrong("extras", e.to_string()))?;
    if data.len() as u64 > most {
        return Err(bad("are larger than the file allows for"));
    }
    let numbers = |(at, length): Span, size: usize| -> Result<Vec<[u8; 8]>, DecodeError> {
        let end = at.checked_add(length).filter(|&e| e <= data.len() as u64 && length % size as u64 == 0);
        let part = &data
            [at.min(data.len() as u64) as usize..end.ok_or_else(|| bad("name what is not there"))? as usize];
        let n = part.len() / size;
        let number = |i: usize| {
            let mut out = [0; 8];
            out[..size].iter_mut().enumerate().for_each(|(k, b)| *b = part[k * n + i]);
            out
        };
        Ok((0..n).map(number).collect())
    };
    let mut extras = Extras::default();
    // Rows that a single number stands for take memory, too.
    let rows = usize::try_from(head.rows)
        .ok()
        .filter(|&r| r as u64 <= 8 * most)
        .ok_or_else(|| bad("have too many rows"))?;
    if head.faces.len() as u64 * rows as u64 > 8 * most {
        return Err(bad("are larger than the file allows for"));
    }
    for c in head.faces {
        let encoding =
            *Encoding::ALL.get(c.encoding as usize).ok_or_else(|| bad("have numbers of an unknown kind"))?;
        let have = numbers(c.values, stored(encoding, 0.0).0)?;
        let mut values: Vec<f64> = have.into_iter().map(|b| value(encoding, b)).collect();
        match values[..] {
            [one] => values = vec![one; rows],
            _ if values.len() == rows => {}
            _ => return Err(bad("have columns of different lengths")),
        }
        extras.of_faces.push(FaceValues { name: c.name, encoding, values });
    }
    let word = |b: [u8; 8]| u64::from_le_bytes(b) as u32;
    extras.loose = LooseRows {
        vertices: numbers(head.vertices, 4)?.into_iter().map(word).collect(),
        present: numbers(head.present, 8)?.into_iter().map(u64::from_le_bytes).collect(),
        rows: numbers(head.values, 4)?.into_iter().map(|b| f32::from_bits(word(b))).collect(),
    };
    if extras.loose.present.len() != extras.loose.vertices.len() {
        return Err(bad("have columns of different lengths"));
    }
    Ok(extras)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(rows: usize) -> Extras {
        let column = |name: &str, encoding, f: fn(usize) -> f64| FaceValues {
            name: name.into(),
            encoding,
            values: (0..rows).map(f).collect(),
        };
        Extras {
            of_faces: vec![
                column("flags", Encoding::I32, |_| -7.0),
                column("quality", Encoding::F32, |i| (i as f32 * 0.37).sin() as f64),
                column("id", Encoding::U32, |i| 4e9 + i as f64),
                column("fine", Encoding::F64, |i| 1.0 / (i as f64 - 3.0)),
                column("small", Encoding::U8, |i| (i % 256) as f64),
                column("low", Encoding::I16, |i| -(i as f64)),
            ],
            loose: LooseRows { vertices: vec![3, 9], present: vec![1, 3], rows: vec![0.5, -0.0, 1e-30, 7.0] },
        }
    }

    #[test]
    fn what_was_written_is_read_bit_for_bit() {
        for rows in [0, 1, 2, 1000] {
            let extras = sample(rows);
            let back = read(&write(&extras)).unwrap();
            assert_eq!(back, extras);
            assert_eq!(back.loose.rows[1].to_bits(), extras.loose.rows[1].to_bits());
        }
        let constant = Extras { of_faces: sample(100_000).of_faces[..1].to_vec(), ..Default::default() };
        let bytes = write(&constant);
        assert!(bytes.len() < 400, "{}", bytes.len());
    }

    #[test]
    fn damage_is_an_error_or_something_else_but_never_more_than_the_file_allows_for() {
        let bytes = write(&sample(40));
        for end in 0..bytes.len() {
            let _ = read(&bytes[..end]);
        }
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut bad = bytes.clone();
                bad[at] ^= 1 << bit;
                if let Ok(e) = read(&bad) {
                    let numbers: usize = e.of_faces.iter().map(|v| v.values.len()).sum();
                    assert!(numbers <= 8 * 64 * bytes.len() && e.loose.rows.len() <= 64 * bytes.len());
                }
            }
        }
    }
}
