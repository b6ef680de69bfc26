//! Decodes any bytes as OFF, and builds what decodes: nothing may panic, hang or allocate out of proportion.
#![no_main]

use libfuzzer_sys::fuzz_target;
use progmesh::aif::Mesh;
use progmesh::io::{self, Format, NoSide};

fuzz_target!(|bytes: &[u8]| {
    if let Ok(decoded) = io::decode(Format::Off, bytes, &NoSide) {
        // What decodes can be written again.
        let _ = io::encode(Format::Off, &decoded.scene, &Default::default());
        for mesh in decoded.scene.meshes {
            if let Ok((mesh, _)) = Mesh::build(mesh.geometry, &Default::default()) {
                assert!(mesh.check().is_ok());
            }
        }
    }
});
