//! Reads any bytes as lines of GeoJSON: nothing may panic, hang or allocate out of proportion, and every line has two points or more.
#![no_main]

use libfuzzer_sys::fuzz_target;
use progmesh::io::geojson::decode_lines;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(read) = decode_lines(bytes) {
        assert!(read.lines.iter().all(|l| l.len() > 1 && l.as_flattened().iter().all(|c| c.is_finite())));
    }
});
