//! Reads any bytes as a progressive mesh: what comes out can be refined and coarsened, and written again. Mostly with the checksums set right, which
//! lets changes through to the streams. What the bytes are decides which way they are read, so that a run is short and every way has its turn.
#![no_main]

use glam::{DMat4, DVec3};
use libfuzzer_sys::fuzz_target;
use progmesh_refine::ProgressiveMesh;
use progmesh_refine::format::{EncodeOptions, PmReader, RangeReader, decode_prefix, encode};
use progmesh_refine::paged::{PagedLimits, PagedView};
use progmesh_refine::selective::Cull;
use progmesh_refine::view::{Camera, CameraParameters, Projection};
use std::sync::Arc;

/// Meshes of more splits are not written again.
const WRITTEN: usize = 64;

fuzz_target!(|bytes: &[u8]| {
    let turn = crc32fast::hash(bytes);
    match signed(bytes) {
        Some(signed) if turn & 7 != 0 => read(&signed, turn >> 3),
        _ => read(bytes, turn >> 3),
    }
});

fn read(bytes: &[u8], turn: u32) {
    match turn & 7 {
        0 | 1 => in_a_stream(bytes),
        2 => alone(bytes),
        3 => paged(bytes),
        _ => whole(bytes, turn >> 3),
    }
}

fn whole(bytes: &[u8], turn: u32) {
    let Ok(decoded) = decode_prefix(bytes) else { return };
    for pm in &decoded.meshes {
        let Ok(mut cursor) = pm.cursor() else { continue };
        let whole = cursor.seek(usize::MAX).is_ok();
        let _ = cursor.to_ordered_input();
        let _ = cursor.seek(0);
        if whole && pm.splits.len() <= WRITTEN {
            write(pm, turn);
        }
    }
}

fn write(pm: &ProgressiveMesh, turn: u32) {
    let options = match turn & 3 {
        0 => EncodeOptions::default(),
        1 => EncodeOptions::default().with_chunk(Some(5)),
        2 => EncodeOptions::default().with_sequential(true).with_any_order(true),
        _ => EncodeOptions::default().with_quantize(Some(6)),
    };
    let Ok(bytes) = encode(std::slice::from_ref(pm), &[], &[], &options) else { return };
    let read = decode_prefix(&bytes).expect("what was written can be read");
    assert!(read.report.damage.is_none());
}

fn in_a_stream(bytes: &[u8]) {
    let Ok(mut reader) = PmReader::new(bytes) else { return };
    while let Ok(Some(_)) = reader.advance() {}
    for pm in &reader.finish().meshes {
        let _ = pm.cursor().map(|mut c| c.seek(usize::MAX).is_ok());
    }
}

/// Chunks by themselves, the last first.
fn alone(bytes: &[u8]) {
    let Ok(reader) = RangeReader::new(bytes) else { return };
    let directory = reader.directory();
    let heads: Vec<_> = (0..directory.meshes.min(8)).map(|m| reader.base(m).ok().map(|b| b.0)).collect();
    for chunk in directory.chunks.iter().rev() {
        let head = heads.get(chunk.mesh as usize).and_then(Option::as_ref);
        let _ = reader.read(chunk.index, head);
    }
}

/// Out of core: to full detail, half of it and back, with what changes shown over two frames.
fn paged(bytes: &[u8]) {
    let Ok(reader) = RangeReader::new(bytes) else { return };
    let Ok(mut view) = PagedView::new(Arc::new(reader), 0, 64 << 20) else { return };
    let (centre, diagonal) = view.extent();
    let size = diagonal.clamp(1e-9, 1e9);
    let camera = Camera::new(&CameraParameters {
        eye: centre + DVec3::new(0.1, 0.2, 1.0) * size,
        target: centre,
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: 45.0 },
        width: 640,
        height: 480,
        near: 1e-3 * size,
        far: 1e3 * size,
    });
    let Ok(camera) = camera else { return };
    for tau in [2.0, 0.0, 8.0, f64::INFINITY] {
        let Ok(lens) = view.lens(&camera, &DMat4::IDENTITY, tau, Cull::None) else { return };
        let adapted = view.adapt(&[lens], &PagedLimits::default()).is_ok();
        if view.set_timed(Some(2)).is_err() || view.follow(&[lens]).is_err() || !adapted {
            return;
        }
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
