//! Reads any bytes as a progressive mesh: what comes out can be refined and coarsened, and written again. Once as they are, once with the checksums set right, which
//! lets changes through to the streams.
#![no_main]

use libfuzzer_sys::fuzz_target;
use progmesh_refine::format::{EncodeOptions, PmReader, RangeReader, decode_prefix, encode};

fuzz_target!(|bytes: &[u8]| {
    read(bytes);
    if let Some(signed) = signed(bytes) {
        read(&signed);
    }
});

fn read(bytes: &[u8]) {
    let Ok(decoded) = decode_prefix(bytes) else { return };
    for pm in &decoded.meshes {
        let Ok(mut cursor) = pm.cursor() else { continue };
        let whole = cursor.seek(usize::MAX).is_ok();
        let _ = cursor.to_ordered_input();
        let _ = cursor.seek(0);
        if whole {
            for options in [EncodeOptions::default(), EncodeOptions::default().with_chunk(Some(5))] {
                let _ = encode(std::slice::from_ref(pm), &[], &[], &options);
            }
        }
    }
    let Ok(mut reader) = PmReader::new(bytes) else { return };
    while let Ok(Some(_)) = reader.advance() {}
    assert!(reader.finish().meshes.len() <= decoded.meshes.len());
    // Chunks alone, the last first.
    let Ok(reader) = RangeReader::new(bytes) else { return };
    for chunk in reader.directory().chunks.iter().rev() {
        let head = reader.base(chunk.mesh).ok().map(|(head, _)| head);
        let _ = reader.read(chunk.index, head.as_ref());
    }
}

/// With the checksums of all chunks, and of the directory, as they should be.
fn signed(bytes: &[u8]) -> Option<Vec<u8>> {
    let number = |b: &[u8], at: usize| Some(u32::from_le_bytes(b.get(at..at + 4)?.try_into().ok()?));
    let mut out = bytes.to_vec();
    let chunks = number(bytes, 24)? as usize;
    let end = 48 + 64usize.checked_mul(chunks)?;
    out.get(48..end)?;
    for k in 0..chunks {
        let entry = 48 + 64 * k;
        let [at, stored] = [40, 48].map(|field| number(bytes, entry + field));
        let (at, stored) = (at? as usize, stored? as usize);
        if let Some(content) = out.get(at..at.checked_add(stored)?) {
            let sum = crc32fast::hash(content);
            out[entry + 36..entry + 40].copy_from_slice(&sum.to_le_bytes());
        }
    }
    let mut h = crc32fast::Hasher::new();
    h.update(&out[..44]);
    h.update(&out[48..end]);
    let sum = h.finalize();
    out[44..48].copy_from_slice(&sum.to_le_bytes());
    Some(out)
}
