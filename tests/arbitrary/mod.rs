//! Random meshes for round trips, and what two meshes must share to be equal.

use progmesh::aif::{Channel, Encoding, MeshInput, NONE, Positions, Semantic, Wedges};
use proptest::prelude::*;

/// Which attributes a mesh gets.
#[derive(Clone, Copy)]
pub(crate) struct Kinds {
    /// Normals and texture coordinates may differ between the corners of a vertex, or be absent.
    pub(crate) per_corner: bool,
    /// Custom channels, stored as these encodings.
    pub(crate) custom: &'static [Encoding],
}

fn finite_f32() -> impl Strategy<Value = f32> {
    prop_oneof![
        3 => any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |x| x.is_finite()),
        1 => prop_oneof![Just(0.0), Just(-0.0), Just(0.1), Just(1.0), Just(f32::MAX), Just(f32::MIN_POSITIVE)],
    ]
}

fn finite_f64() -> impl Strategy<Value = f64> {
    prop_oneof![
        2 => any::<u64>().prop_map(f64::from_bits).prop_filter("finite", |x| x.is_finite()),
        1 => finite_f32().prop_map(f64::from),
        1 => prop_oneof![Just(0.0), Just(-0.0), Just(0.1), Just(1e300), Just(123.25)],
    ]
}

fn positions(n: usize) -> impl Strategy<Value = Positions> {
    prop_oneof![
        prop::collection::vec(prop::array::uniform3(finite_f32()), n).prop_map(Positions::F32),
        prop::collection::vec(prop::array::uniform3(finite_f64()), n).prop_map(Positions::from_f64),
    ]
}

/// A value that the encoding holds exactly.
fn held(encoding: Encoding, x: u32) -> f32 {
    match encoding {
        Encoding::U8 => (x % 256) as f32,
        Encoding::U8Norm => ((x % 256) as f64 / 255.0) as f32,
        Encoding::U16Norm => ((x % 65536) as f64 / 65535.0) as f32,
        Encoding::I8 => (x % 256) as f32 - 128.0,
        Encoding::I16 => (x % 65536) as f32 - 32768.0,
        Encoding::U16 => (x % 65536) as f32,
        Encoding::I32 => (x % (1 << 24)) as f32 - 8_388_608.0,
        Encoding::U32 => (x % (1 << 24)) as f32,
        _ => Some(f32::from_bits(x)).filter(|x| x.is_finite()).unwrap_or(0.5),
    }
}

/// A cheap hash, to make values of a vertex that are the same at all its corners.
fn mix(a: u32, b: u32) -> u32 {
    let x = (a ^ b.rotate_left(16)).wrapping_mul(0x9e37_79b9);
    (x ^ x >> 15).wrapping_mul(0x85eb_ca6b) ^ x >> 13
}

/// Polygons of 3 to 6 corners on 3 to 12 vertices, with attributes and wires.
pub(crate) fn mesh(kinds: Kinds) -> impl Strategy<Value = MeshInput> {
    (3usize..12, any::<u32>(), any::<[bool; 3]>()).prop_flat_map(move |(n, seed, has)| {
        let faces = prop::collection::vec(prop::collection::vec(0..n as u32, 3..7), 0..10);
        let wires = prop::collection::vec(prop::array::uniform2(0..n as u32), 0..3);
        let corner_seed = prop::collection::vec(0u32..3, 60);
        (positions(n), faces, wires, corner_seed).prop_map(move |(positions, faces, wires, corner_seed)| {
            let sizes: Vec<u32> = faces.iter().map(|f| f.len() as u32).collect();
            let corners: Vec<u32> = faces.concat();
            let mut channels = Vec::new();
            if has[0] {
                channels.push(Channel::new(Semantic::Normal, 3));
            }
            if has[1] {
                channels.push(Channel::new(Semantic::TexCoord(0), 2));
            }
            if has[2] {
                let encoding = [Encoding::F32, Encoding::U8Norm][seed as usize % 2];
                channels.push(Channel { semantic: Semantic::Color(0), width: 3, encoding });
            }
            for (i, &encoding) in kinds.custom.iter().enumerate() {
                channels.push(Channel { semantic: Semantic::Custom(format!("c{i}")), width: 1, encoding });
            }
            let mut wedges = Wedges::new(channels.clone()).unwrap();
            let mut of_corner = Vec::new();
            for (c, &v) in corners.iter().enumerate() {
                let (mut row, mut present) = (Vec::new(), 0u64);
                for (k, channel) in channels.iter().enumerate() {
                    let own = kinds.per_corner
                        && matches!(channel.semantic, Semantic::Normal | Semantic::TexCoord(_));
                    let variant = if own { corner_seed[c % corner_seed.len()] } else { 0 };
                    let absent = own && variant == 2;
                    for i in 0..channel.width {
                        let x = held(
                            channel.encoding,
                            mix(mix(seed, v), 1000 * k as u32 + 10 * i as u32 + variant),
                        );
                        row.push(if absent { 0.0 } else { x });
                    }
                    present |= (!absent as u64) << k;
                }
                of_corner.push(if present == 0 { NONE } else { wedges.push(&row, present) });
            }
            wedges.corner = of_corner;
            MeshInput {
                positions,
                face_sizes: sizes.iter().any(|&s| s != 3).then_some(sizes),
                corners,
                wires,
                wedges: (wedges.stride() > 0 && !wedges.is_empty()).then_some(wedges),
                ..Default::default()
            }
        })
    })
}

/// The bits of channel `semantic` at a corner.
pub(crate) fn value(mesh: &MeshInput, corner: usize, semantic: &Semantic) -> Option<Vec<u32>> {
    let w = mesh.wedges.as_ref()?;
    w.get(w.corner[corner], w.channel(semantic)?).map(|v| v.iter().map(|x| x.to_bits()).collect())
}

/// Bits of the positions, with their width.
pub(crate) fn bits(positions: &Positions) -> Vec<u64> {
    match positions {
        Positions::F32(p) => p.iter().flatten().map(|x| x.to_bits() as u64).collect(),
        Positions::F64(p) => p.iter().flatten().map(|x| x.to_bits()).chain([64]).collect(),
    }
}

/// Asserts that two meshes hold the same faces and positions, and the same value of every channel of `a` at every corner.
pub(crate) fn assert_same(a: &MeshInput, b: &MeshInput) {
    assert_eq!(bits(&a.positions), bits(&b.positions));
    assert_eq!((&a.face_sizes, &a.corners, &a.wires), (&b.face_sizes, &b.corners, &b.wires));
    for channel in a.wedges.iter().flat_map(|w| w.channels()) {
        for c in 0..a.corners.len() {
            let name = &channel.semantic;
            assert_eq!(value(a, c, name), value(b, c, name), "{name:?} of corner {c}");
        }
    }
}

/// Decodes every truncation of a file, and the file with each of a number of bytes changed: nothing may panic.
pub(crate) fn mangle(format: progmesh::io::Format, bytes: &[u8]) {
    use progmesh::io::{NoSide, decode};
    for n in 0..bytes.len() {
        let _ = decode(format, &bytes[..n], &NoSide);
    }
    let mut state = 12345u32;
    for _ in 0..20_000 {
        let mut copy = bytes.to_vec();
        for _ in 0..1 + state % 3 {
            state = mix(state, 77);
            let at = state as usize % copy.len();
            state = mix(state, 78);
            copy[at] = if state & 1 == 0 { state as u8 } else { copy[at] ^ (1 << (state >> 8 & 7)) };
        }
        if let Ok(d) = decode(format, &copy, &NoSide) {
            for mesh in d.scene.meshes {
                let _ = progmesh::aif::Mesh::build(mesh.geometry, &Default::default());
            }
        }
    }
}
