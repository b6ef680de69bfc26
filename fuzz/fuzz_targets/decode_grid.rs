//! Opens any bytes as a height grid of the format that they (or their first byte) tell, and reads what opens: nothing may panic, hang or allocate out
//! of proportion.
#![no_main]

use libfuzzer_sys::fuzz_target;
use progmesh::io::grid::{self, ByteOrder, GridFormat, GridOptions, SampleType};
use progmesh::terrain::Window;
use std::sync::Arc;

fuzz_target!(|bytes: &[u8]| {
    let mut options = GridOptions::default().with_cache(1 << 16);
    if GridFormat::from_bytes(bytes).is_none() {
        options.format = Some(match bytes.first().map_or(0, |b| b % 3) {
            0 => GridFormat::Hgt,
            1 => GridFormat::Ascii,
            _ => GridFormat::Raw,
        });
        (options.size, options.sample) =
            (Some([bytes.len() / 2, 1]), Some((SampleType::I16, ByteOrder::Big)));
    }
    if let Ok(file) = grid::open(Arc::new(bytes.to_vec()), "N01E001", &options) {
        let (columns, rows) = (file.raster.columns(), file.raster.rows());
        let _ = file.georeference.spacing_metres(columns, rows);
        let _ = file.raster.whole(1 << 20);
        for (x, y) in [(0, 0), (columns - 1, rows - 1), (columns / 2, rows / 3)] {
            let _ = file.raster.window(Window::new(x, y, 1, 1));
        }
    }
});
