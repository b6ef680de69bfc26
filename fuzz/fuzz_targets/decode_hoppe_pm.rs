//! Decodes any bytes as one of Hoppe's progressive meshes, and walks what decodes: nothing may panic, hang or allocate out of proportion.
#![no_main]

use libfuzzer_sys::fuzz_target;
use progmesh::io::pm::hoppe;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(read) = hoppe::decode(bytes) {
        for mesh in &read.scene.meshes {
            let mut cursor = mesh.cursor().expect("what decodes has arrays that fit together");
            let n = mesh.splits.len();
            for to in [n, n / 2, n, 0] {
                assert!(cursor.seek(to).is_ok());
            }
        }
        assert!(read.scene.at(&[usize::MAX]).is_ok());
    }
});
