//! Replays the seed corpus of the fuzz targets: every file, and every truncation of it, decodes or is refused, and what decodes
//! builds or is refused, and can be written again; nothing panics.

use progmesh::aif::Mesh;
use progmesh::io::grid::{self, ByteOrder, GridFormat, GridOptions, SampleType};
use progmesh::io::{self, EncodeOptions, Format, NoSide};
use std::path::Path;
use std::sync::Arc;

fn try_one(format: Format, bytes: &[u8]) -> bool {
    let Ok(decoded) = io::decode(format, bytes, &NoSide) else { return false };
    let _ = io::encode(format, &decoded.scene, &EncodeOptions::default());
    for mesh in decoded.scene.meshes {
        if let Ok((mesh, _)) = Mesh::build(mesh.geometry, &Default::default()) {
            assert!(mesh.check().is_ok());
        }
    }
    true
}

#[test]
fn every_file_and_every_truncation_is_survived() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus");
    let (mut files, mut decoded) = (0, 0);
    for folder in std::fs::read_dir(corpus).unwrap() {
        if folder.as_ref().unwrap().file_name() == "grid" {
            continue;
        }
        for file in std::fs::read_dir(folder.unwrap().path()).unwrap() {
            let path = file.unwrap().path();
            let format =
                Format::from_name(&path.to_string_lossy()).expect("a corpus file has a known extension");
            let bytes = std::fs::read(&path).unwrap();
            files += 1;
            decoded += try_one(format, &bytes) as usize;
            for n in 0..bytes.len() {
                try_one(format, &bytes[..n]);
            }
        }
    }
    assert!(files >= 8 && decoded >= 5, "{files} files, {decoded} decoded: is the corpus there?");
}

/// Reads any bytes as a grid of each format; true if its own can be read whole.
fn try_grid(bytes: &[u8], name: &str) -> bool {
    let mut good = false;
    for format in [None, Some(GridFormat::Hgt), Some(GridFormat::Ascii), Some(GridFormat::Raw)] {
        let mut options = GridOptions::default().with_cache(4096);
        options.format = format;
        if format == Some(GridFormat::Raw) {
            (options.size, options.sample) =
                (Some([bytes.len().max(1), 1]), Some((SampleType::U8, ByteOrder::Big)));
        }
        if let Ok(file) = grid::open(Arc::new(bytes.to_vec()), name, &options) {
            let whole = file.raster.whole(1 << 16).is_ok();
            good |= format.is_none() && whole;
        }
    }
    good
}

#[test]
fn every_grid_and_every_truncation_is_survived() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus/grid");
    let mut files = 0;
    for file in std::fs::read_dir(corpus).unwrap() {
        let path = file.unwrap().path();
        let name = path.to_string_lossy().into_owned();
        let bytes = std::fs::read(&path).unwrap();
        files += 1;
        assert_eq!(try_grid(&bytes, &name), !name.contains("bad"), "{name}");
        for n in 0..bytes.len() {
            try_grid(&bytes[..n], &name);
        }
    }
    assert!(files >= 9, "{files} files: is the corpus there?");
}
