//! The codec of `EXT_meshopt_compression` and `KHR_meshopt_compression`, decoding only, from the extensions' appendices.
//!
//! Our own because the C++ decoder would be the only unsafe code of the program to see untrusted bytes, and because the
//! pure-Rust port on the registry reads quaternions unsigned. The C++ one (crate `meshopt`) is the oracle of the tests.
//! Every stream is checked against its announced count to the last byte; memory grows with the bytes that were read.

use super::json::bad;
use crate::io::DecodeError;

/// What a compressed buffer view announces.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout<'a> {
    pub(super) mode: &'a str,
    pub(super) filter: &'a str,
    pub(super) count: usize,
    pub(super) stride: usize,
}

/// Decodes a compressed buffer view to `count * stride` bytes. `path` names the view in errors.
pub(super) fn decode(stream: &[u8], layout: Layout<'_>, path: &str) -> Result<Vec<u8>, DecodeError> {
    let Layout { mode, filter, count, stride } = layout;
    let fail = |what: &str| bad(path, format!("compressed {mode} stream: {what}"));
    let (valid, decoded) = match mode {
        "ATTRIBUTES" => {
            if stride == 0 || stride > 256 || stride % 4 != 0 {
                return Err(bad(
                    path,
                    format!("byteStride {stride}: must be 4, 8, ... 256 in mode ATTRIBUTES"),
                ));
            }
            let valid = match filter {
                "NONE" | "EXPONENTIAL" => true,
                "OCTAHEDRAL" | "COLOR" => stride == 4 || stride == 8,
                "QUATERNION" => stride == 8,
                _ => return Err(DecodeError::Unsupported { what: format!("meshopt filter {filter}") }),
            };
            (valid, attributes(stream, count, stride))
        }
        "TRIANGLES" | "INDICES" => {
            let valid =
                (stride == 2 || stride == 4) && filter == "NONE" && (mode == "INDICES" || count % 3 == 0);
            let indices =
                if mode == "INDICES" { sequence(stream, count) } else { triangles(stream, count / 3) };
            (valid, indices.map(|i| narrow(&i, stride)))
        }
        _ => return Err(DecodeError::Unsupported { what: format!("meshopt mode {mode}") }),
    };
    if !valid {
        return Err(bad(
            path,
            format!("filter {filter}, byteStride {stride}, count {count} do not go with mode {mode}"),
        ));
    }
    let mut bytes = decoded.map_err(fail)?;
    match (filter, stride) {
        ("OCTAHEDRAL", 4) => bytes.as_chunks_mut::<4>().0.iter_mut().for_each(octahedral_8),
        ("OCTAHEDRAL", _) => bytes.as_chunks_mut::<8>().0.iter_mut().for_each(octahedral_16),
        ("COLOR", 4) => bytes.as_chunks_mut::<4>().0.iter_mut().for_each(color_8),
        ("COLOR", _) => bytes.as_chunks_mut::<8>().0.iter_mut().for_each(color_16),
        ("QUATERNION", _) => bytes.as_chunks_mut::<8>().0.iter_mut().for_each(quaternion),
        ("EXPONENTIAL", _) => bytes.as_chunks_mut::<4>().0.iter_mut().for_each(exponential),
        _ => {}
    }
    Ok(bytes)
}

fn narrow(indices: &[u32], stride: usize) -> Vec<u8> {
    match stride {
        2 => indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect(),
        _ => indices.iter().flat_map(|&i| i.to_le_bytes()).collect(),
    }
}

type Stream<T> = Result<T, &'static str>;
const SHORT: &str = "ends too early";
const LONG: &str = "has bytes left over after its last element";

/// Bytes still to be read.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Stream<&'a [u8]> {
        let (head, tail) = self.0.split_at_checked(n).ok_or(SHORT)?;
        self.0 = tail;
        Ok(head)
    }

    fn byte(&mut self) -> Stream<u8> {
        Ok(self.take(1)?[0])
    }

    /// LEB128 of at most five bytes.
    fn varint(&mut self) -> Stream<u32> {
        let mut value = 0;
        for shift in [0, 7, 14, 21, 28] {
            let b = self.byte()?;
            value |= ((b & 0x7f) as u32) << shift;
            if b < 0x80 {
                return Ok(value);
            }
        }
        Err("has a number of more than five bytes")
    }
}

fn unzigzag(v: u32) -> u32 {
    (v >> 1) ^ (v & 1).wrapping_neg()
}

// --- mode ATTRIBUTES ---

/// Bit lengths of the delta groups by their two header bits, for control modes 0 and 1 of version 1, and for version 0.
const WIDTHS: [[u32; 4]; 3] = [[0, 1, 2, 4], [1, 2, 4, 8], [0, 2, 4, 8]];

fn attributes(stream: &[u8], count: usize, stride: usize) -> Stream<Vec<u8>> {
    let version = match stream.first() {
        Some(0xa0) => 0,
        Some(0xa1) => 1,
        Some(_) => return Err("does not begin with byte 0xa0 or 0xa1"),
        None => return Err(SHORT),
    };
    let channels = stride / 4;
    let tail = stride + if version == 1 { channels } else { 0 };
    let padded = tail.max(if version == 1 { 24 } else { 32 });
    let body = stream.len().checked_sub(1 + padded).ok_or(SHORT)?;
    let (mut data, tail) = (Reader(&stream[1..1 + body]), &stream[stream.len() - tail..]);
    let mut last = tail[..stride].to_vec();
    let modes = &tail[stride..];
    if modes.iter().any(|&m| m & 15 > 2 || (m & 15 < 2 && m >> 4 != 0)) {
        return Err("has a channel mode that is not defined");
    }

    let block_max = ((8192 / stride) & !15).min(256);
    // A stream is trusted for memory only as far as its bytes go: each block is paid for by the bytes read for it.
    let mut out = Vec::with_capacity((count * stride).min(64 * stream.len()));
    let mut planes = vec![0u8; block_max * stride];
    let mut done = 0;
    while done < count {
        let n = block_max.min(count - done);
        let control = if version == 1 { data.take(channels)? } else { &[][..] };
        for k in 0..stride {
            let plane = &mut planes[k * block_max..][..n];
            match control.get(k / 4).map(|c| c >> (2 * (k % 4)) & 3) {
                Some(2) => plane.fill(0),
                Some(3) => plane.copy_from_slice(data.take(n)?),
                Some(c) => deltas(&mut data, plane, &WIDTHS[c as usize])?,
                None => deltas(&mut data, plane, &WIDTHS[2])?,
            }
        }
        let start = out.len();
        out.resize(start + n * stride, 0);
        for channel in 0..channels {
            let mode = modes.get(channel).copied().unwrap_or(0);
            let mut value = [0u8; 4];
            value.copy_from_slice(&last[4 * channel..][..4]);
            for i in 0..n {
                let delta = std::array::from_fn(|b| planes[(4 * channel + b) * block_max + i]);
                value = apply(value, delta, mode);
                out[start + i * stride + 4 * channel..][..4].copy_from_slice(&value);
            }
            last[4 * channel..][..4].copy_from_slice(&value);
        }
        done += n;
    }
    if data.0.is_empty() { Ok(out) } else { Err(LONG) }
}

/// One byte of every element of a block: groups of 16 deltas, each with its own bit length.
fn deltas(data: &mut Reader<'_>, plane: &mut [u8], widths: &[u32; 4]) -> Stream<()> {
    let groups = plane.len().div_ceil(16);
    let header = data.take(groups.div_ceil(4))?;
    for (g, group) in plane.chunks_mut(16).enumerate() {
        let bits = widths[(header[g / 4] >> (2 * (g % 4)) & 3) as usize];
        let mut full = [0u8; 16];
        match bits {
            0 => {}
            8 => full.copy_from_slice(data.take(16)?),
            _ => {
                let packed = data.take(2 * bits as usize)?;
                let sentinel = (1u8 << bits) - 1;
                for (i, d) in full.iter_mut().enumerate() {
                    let at = i * bits as usize;
                    // One-bit deltas run from the low bit up, wider ones from the high bits down.
                    let shift = if bits == 1 { at % 8 } else { 8 - bits as usize - at % 8 };
                    *d = packed[at / 8] >> shift & sentinel;
                    if *d == sentinel {
                        *d = data.byte()?;
                    }
                }
            }
        }
        group.copy_from_slice(&full[..group.len()]);
    }
    Ok(())
}

/// The next value of a four-byte channel.
fn apply(value: [u8; 4], delta: [u8; 4], mode: u8) -> [u8; 4] {
    match mode & 15 {
        0 => std::array::from_fn(|b| value[b].wrapping_add(unzigzag(delta[b] as u32) as u8)),
        1 => {
            let half = |k: usize| {
                let d = unzigzag(u16::from_le_bytes([delta[k], delta[k + 1]]) as u32) as u16;
                u16::from_le_bytes([value[k], value[k + 1]]).wrapping_add(d).to_le_bytes()
            };
            let (low, high) = (half(0), half(2));
            [low[0], low[1], high[0], high[1]]
        }
        _ => {
            // The encoder rotates left.
            let d = u32::from_le_bytes(delta).rotate_right((mode >> 4) as u32);
            (u32::from_le_bytes(value) ^ d).to_le_bytes()
        }
    }
}

// --- modes TRIANGLES and INDICES ---

/// The last sixteen things pushed.
struct Fifo<T> {
    items: [T; 16],
    pushed: usize,
}

impl<T: Copy + Default> Fifo<T> {
    fn new() -> Self {
        Fifo { items: [T::default(); 16], pushed: 0 }
    }

    fn push(&mut self, item: T) {
        self.items[self.pushed % 16] = item;
        self.pushed += 1;
    }

    fn get(&self, back: usize) -> Stream<T> {
        match self.pushed.checked_sub(back + 1) {
            Some(at) => Ok(self.items[at % 16]),
            None => Err("refers to an edge or vertex before its first"),
        }
    }
}

fn triangles(stream: &[u8], count: usize) -> Stream<Vec<u32>> {
    match stream.first() {
        Some(0xe1) => {}
        Some(0xe0) => return Err("is of version 0, which the extension does not allow"),
        _ => return Err("does not begin with byte 0xe1"),
    }
    let (codes, rest) = stream[1..].split_at_checked(count).ok_or(SHORT)?;
    let (data, aux) = rest.split_at(rest.len().checked_sub(16).ok_or(SHORT)?);
    let mut data = Reader(data);
    let (mut edges, mut vertices) = (Fifo::<(u32, u32)>::new(), Fifo::<u32>::new());
    let (mut next, mut last) = (0u32, 0u32);
    let mut out = Vec::with_capacity(3 * count);
    let fresh = |next: &mut u32| std::mem::replace(next, next.wrapping_add(1));
    let explicit = |data: &mut Reader<'_>, last: &mut u32| {
        *last = last.wrapping_add(unzigzag(data.varint()?));
        Ok(*last)
    };
    for &code in codes {
        let (x, y) = (code >> 4, code & 15);
        let (a, b, c);
        if x < 15 {
            (a, b) = edges.get(x as usize)?;
            let push = match y {
                0 => {
                    c = fresh(&mut next);
                    true
                }
                1..13 => {
                    c = vertices.get(y as usize)?;
                    false
                }
                13 | 14 => {
                    last = if y == 13 { last.wrapping_sub(1) } else { last.wrapping_add(1) };
                    c = last;
                    true
                }
                _ => {
                    c = explicit(&mut data, &mut last)?;
                    true
                }
            };
            if push {
                vertices.push(c);
            }
        } else {
            let pair = if y < 14 { aux[y as usize] } else { data.byte()? };
            let (z, w) = (pair >> 4, pair & 15);
            if y < 14 && (z == 15 || w == 15) {
                return Err("has a lookup table with an entry that is not defined");
            }
            if y >= 14 && pair == 0 {
                next = 0;
            }
            a = if y == 15 { explicit(&mut data, &mut last)? } else { fresh(&mut next) };
            let mut other = |code: u8| match code {
                0 => Ok(fresh(&mut next)),
                15 => explicit(&mut data, &mut last),
                _ => vertices.get(code as usize - 1),
            };
            (b, c) = (other(z)?, other(w)?);
            vertices.push(a);
            for (code, v) in [(z, b), (w, c)] {
                if code == 0 || code == 15 {
                    vertices.push(v);
                }
            }
            edges.push((b, a));
        }
        edges.push((c, b));
        edges.push((a, c));
        out.extend([a, b, c]);
    }
    if data.0.is_empty() { Ok(out) } else { Err(LONG) }
}

fn sequence(stream: &[u8], count: usize) -> Stream<Vec<u32>> {
    if stream.first() != Some(&0xd1) {
        return Err("does not begin with byte 0xd1");
    }
    let mut data = Reader(&stream[1..stream.len().checked_sub(4).filter(|&n| n >= 1).ok_or(SHORT)?]);
    let mut last = [0u32; 2];
    if count > data.0.len() {
        return Err(SHORT);
    }
    let mut out = Vec::with_capacity(count);
    for _ in 0..count {
        let v = data.varint()?;
        let baseline = &mut last[(v & 1) as usize];
        *baseline = baseline.wrapping_add(unzigzag(v >> 1));
        out.push(*baseline);
    }
    if data.0.is_empty() { Ok(out) } else { Err(LONG) }
}

// --- filters; `as` saturates and takes NaN to 0, so that values outside the valid range stay harmless ---

fn octahedral(x: f32, y: f32, one: f32, max: f32) -> [f32; 3] {
    let (mut x, mut y) = (x / one, y / one);
    let z = 1.0 - x.abs() - y.abs();
    // The lower half of the octahedron is folded out.
    let t = z.min(0.0).abs();
    x += t.copysign(-x);
    y += t.copysign(-y);
    let len = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|v| (v / len * max).round())
}

fn octahedral_8(e: &mut [u8; 4]) {
    let r = octahedral(e[0] as i8 as f32, e[1] as i8 as f32, e[2] as i8 as f32, 127.0);
    for (byte, value) in e.iter_mut().zip(r) {
        *byte = value as i8 as u8;
    }
}

fn halves(e: &[u8; 8]) -> [i16; 4] {
    std::array::from_fn(|k| i16::from_le_bytes([e[2 * k], e[2 * k + 1]]))
}

fn put_half(e: &mut [u8; 8], k: usize, v: [u8; 2]) {
    e[2 * k..2 * k + 2].copy_from_slice(&v);
}

fn octahedral_16(e: &mut [u8; 8]) {
    let v = halves(e);
    let r = octahedral(v[0] as f32, v[1] as f32, v[2] as f32, 32767.0);
    for (k, value) in r.into_iter().enumerate() {
        put_half(e, k, (value as i16).to_le_bytes());
    }
}

fn quaternion(e: &mut [u8; 8]) {
    let v = halves(e);
    let one = (v[3] | 3) as f32;
    let [x, y, z] = [v[0], v[1], v[2]].map(|c| c as f32 / one * std::f32::consts::FRAC_1_SQRT_2);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let largest = (v[3] & 3) as usize;
    for (k, c) in [w, x, y, z].into_iter().enumerate() {
        put_half(e, (largest + k) % 4, ((c * 32767.0).round() as i16).to_le_bytes());
    }
}

fn exponential(e: &mut [u8; 4]) {
    let v = i32::from_le_bytes(*e);
    let mantissa = (v << 8 >> 8) as f64;
    // f64 holds every product exactly; one rounding to f32 at the end.
    *e = ((mantissa * 2f64.powi(v >> 24)) as f32).to_le_bytes();
}

/// YCoCg to RGB; `a` carries the scale in its highest set bit. Returns components 0..=1 of the range.
fn color(y: i32, co: i32, cg: i32, a: u32) -> [f32; 4] {
    let scale = (1i64 << (32 - a.leading_zeros())) - 1;
    let alpha = a as i64 & scale >> 1;
    let alpha = alpha << 1 | (alpha & 1);
    let full = scale.max(1) as f32;
    [(y + co - cg) as f32, (y + cg) as f32, (y - co - cg) as f32, alpha as f32].map(|c| c / full)
}

fn color_8(e: &mut [u8; 4]) {
    let c = color(e[0] as i32, e[1] as i8 as i32, e[2] as i8 as i32, e[3] as u32);
    *e = c.map(|c| (c * 255.0).round() as u8);
}

fn color_16(e: &mut [u8; 8]) {
    let v = halves(e);
    let c = color(v[0] as u16 as i32, v[1] as i32, v[2] as i32, v[3] as u16 as u32);
    for (k, c) in c.into_iter().enumerate() {
        put_half(e, k, ((c * 65535.0).round() as u16).to_le_bytes());
    }
}

#[cfg(test)]
#[path = "meshopt_tests.rs"]
mod tests;
