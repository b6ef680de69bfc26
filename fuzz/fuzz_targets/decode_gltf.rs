//! Decodes any bytes as glTF, and builds what decodes: nothing may panic, hang or allocate out of proportion.
#![no_main]

use libfuzzer_sys::fuzz_target;
use progmesh::aif::Mesh;
use progmesh::io::{self, Format, NoSide};

fuzz_target!(|bytes: &[u8]| {
    if let Ok(decoded) = io::decode(Format::Glb, bytes, &NoSide) {
        // What decodes can be written again, and what is written reads.
        if let Ok(out) = io::encode(Format::Glb, &decoded.scene, &Default::default()) {
            assert!(io::decode(Format::Glb, &out.bytes, &NoSide).is_ok());
        }
        for mesh in decoded.scene.meshes {
            if let Ok((mesh, _)) = Mesh::build(mesh.geometry, &Default::default()) {
                assert!(mesh.check().is_ok());
            }
        }
    }
});
