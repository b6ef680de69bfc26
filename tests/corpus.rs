//! Replays the seed corpus of the fuzz targets: every file, and every truncation of it, decodes or is refused, and what decodes
//! builds or is refused, and can be written again; nothing panics.

use progmesh::aif::Mesh;
use progmesh::io::{self, EncodeOptions, Format, NoSide};
use std::path::Path;

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
