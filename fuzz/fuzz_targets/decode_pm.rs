//! Reads any bytes as a progressive mesh: what comes out can be refined and coarsened, and written again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use progmesh_refine::format::{EncodeOptions, PmReader, decode_prefix, encode};

fuzz_target!(|bytes: &[u8]| {
    let Ok(decoded) = decode_prefix(bytes) else { return };
    for pm in &decoded.meshes {
        let Ok(mut cursor) = pm.cursor() else { continue };
        let whole = cursor.seek(usize::MAX).is_ok();
        let _ = cursor.to_ordered_input();
        let _ = cursor.seek(0);
        if whole {
            let _ = encode(std::slice::from_ref(pm), &[], &[], &EncodeOptions::default());
        }
    }
    let Ok(mut reader) = PmReader::new(bytes) else { return };
    while let Ok(Some(_)) = reader.advance() {}
    assert!(reader.finish().meshes.len() <= decoded.meshes.len());
});
