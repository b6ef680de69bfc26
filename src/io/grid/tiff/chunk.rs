//! Chunks: packed bytes to heights.

use super::super::{ByteOrder, SampleType};
use super::layout::{Compression, Layout, Predictor};
use std::io::Read;

/// Unpacks exactly `size` bytes; more that follow are left alone.
pub(super) fn unpack(compression: Compression, packed: &[u8], size: usize) -> Result<Vec<u8>, String> {
    let early = |n: usize| format!("ends after {n} of {size} bytes");
    let mut out = Vec::new();
    match compression {
        Compression::None => out.extend_from_slice(&packed[..size.min(packed.len())]),
        Compression::Deflate => {
            // Grows with what there is, not with what is announced.
            let mut from = flate2::read::ZlibDecoder::new(packed).take(size as u64);
            from.read_to_end(&mut out).map_err(|e| format!("damaged: {e}"))?;
        }
        Compression::Lzw => {
            let mut decoder = weezl::decode::Decoder::with_tiff_size_switch(weezl::BitOrder::Msb, 8);
            lzw(&mut decoder, packed, size, &mut out)?;
        }
        Compression::PackBits => pack_bits(packed, size, &mut out),
    }
    if out.len() < size {
        return Err(early(out.len()));
    }
    Ok(out)
}

fn lzw(
    decoder: &mut weezl::decode::Decoder,
    mut packed: &[u8],
    size: usize,
    out: &mut Vec<u8>,
) -> Result<(), String> {
    let mut buffer = vec![0; (1 << 15).min(size)];
    while out.len() < size {
        let room = buffer.len().min(size - out.len());
        let step = decoder.decode_bytes(packed, &mut buffer[..room]);
        packed = &packed[step.consumed_in..];
        out.extend_from_slice(&buffer[..step.consumed_out]);
        match step.status {
            Err(e) => return Err(format!("damaged: {e}")),
            Ok(weezl::LzwStatus::Done) => break,
            Ok(_) if step.consumed_in == 0 && step.consumed_out == 0 => break,
            Ok(_) => {}
        }
    }
    Ok(())
}

fn pack_bits(packed: &[u8], size: usize, out: &mut Vec<u8>) {
    let mut at = 0;
    while let Some(&head) = packed.get(at).filter(|_| out.len() < size) {
        match head as i8 {
            n @ 0.. => {
                let end = (at + 2 + n as usize).min(packed.len());
                out.extend_from_slice(&packed[at + 1..end]);
                at = end;
            }
            -128 => at += 1,
            n => {
                let Some(&byte) = packed.get(at + 1) else { break };
                out.resize(out.len() + 1 + usize::from(n.unsigned_abs()), byte);
                at += 2;
            }
        }
    }
    out.truncate(size);
}

/// Undoes the predictor and reads the first band.
pub(super) fn samples(layout: &Layout, mut bytes: Vec<u8>) -> Result<Vec<f64>, String> {
    let row_bytes = layout.row_bytes();
    let rows = bytes.len() / row_bytes;
    let mut out = vec![f64::NAN; layout.block[0] * layout.block[1]];
    let mut order = layout.order;
    match layout.predictor {
        Predictor::None => {}
        Predictor::Horizontal => {
            let (size, step) = (layout.sample.bytes(), layout.interleaved);
            bytes.chunks_exact_mut(row_bytes).for_each(|row| add_up(row, size, step, layout.order));
        }
        Predictor::FloatingPoint => {
            let mut spare = vec![0; row_bytes];
            for row in bytes.chunks_exact_mut(row_bytes) {
                planes_to_numbers(row, &mut spare, layout.sample, layout.interleaved);
            }
            order = ByteOrder::Big;
        }
    }
    for (row, line) in bytes.chunks_exact(row_bytes).zip(out.chunks_exact_mut(layout.block[0])).take(rows) {
        layout.sample.decode(row, order, layout.interleaved, line);
    }
    Ok(out)
}

/// Differences to samples: each is added to the sample of its band before it, as whole numbers of its size.
fn add_up(row: &mut [u8], size: usize, bands: usize, order: ByteOrder) {
    macro_rules! add {
        ($type:ty, $size:literal) => {{
            for at in bands..row.len() / $size {
                let number = |row: &[u8], at: usize| {
                    let mut n = [0; $size];
                    n.copy_from_slice(&row[at * $size..(at + 1) * $size]);
                    match order {
                        ByteOrder::Little => <$type>::from_le_bytes(n),
                        ByteOrder::Big => <$type>::from_be_bytes(n),
                    }
                };
                let sum = number(row, at).wrapping_add(number(row, at - bands));
                row[at * $size..(at + 1) * $size].copy_from_slice(&match order {
                    ByteOrder::Little => sum.to_le_bytes(),
                    ByteOrder::Big => sum.to_be_bytes(),
                });
            }
        }};
    }
    match size {
        1 => add!(u8, 1),
        2 => add!(u16, 2),
        4 => add!(u32, 4),
        _ => add!(u64, 8),
    }
}

/// TIFF Technical Note 3: differences of bytes, then the planes of bytes from the most significant on, become big-endian numbers.
fn planes_to_numbers(row: &mut [u8], spare: &mut [u8], sample: SampleType, bands: usize) {
    for at in bands..row.len() {
        row[at] = row[at].wrapping_add(row[at - bands]);
    }
    let size = sample.bytes();
    let count = row.len() / size;
    for (plane, bytes) in row.chunks_exact(count).enumerate() {
        for (i, &byte) in bytes.iter().enumerate() {
            spare[i * size + plane] = byte;
        }
    }
    row.copy_from_slice(spare);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_unpacked_as_apple_specified() {
        // The example of Apple's technical note 1023.
        let packed =
            [0xFE, 0xAA, 0x02, 0x80, 0x00, 0x2A, 0xFD, 0xAA, 0x03, 0x80, 0x00, 0x2A, 0x22, 0xF7, 0xAA];
        let whole = unpack(Compression::PackBits, &packed, 24).unwrap();
        let mut want =
            vec![0xAA, 0xAA, 0xAA, 0x80, 0x00, 0x2A, 0xAA, 0xAA, 0xAA, 0xAA, 0x80, 0x00, 0x2A, 0x22];
        want.extend([0xAA; 10]);
        assert_eq!(whole, want);
        for n in 0..packed.len() {
            assert!(unpack(Compression::PackBits, &packed[..n], 24).is_err());
        }
    }

    #[test]
    fn differences_wrap_as_they_were_made() {
        let mut row = [250u8, 0, 10, 0, 0xff, 0xff];
        add_up(&mut row, 2, 1, ByteOrder::Little);
        assert_eq!(row, [250, 0, 4, 1, 3, 1]);
        let mut row = [200u8, 1, 100, 1];
        add_up(&mut row, 1, 2, ByteOrder::Big);
        assert_eq!(row, [200, 1, 44, 2]);
    }
}
