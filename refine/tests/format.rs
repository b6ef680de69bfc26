//! The `.pm` file: exact round trips, streaming, random access, damage.

use progmesh_meshes::{GenerateOptions, Sample, generate};
use progmesh_refine::ProgressiveMesh;
use progmesh_refine::aif::*;
use progmesh_refine::format::*;
use progmesh_refine::progressive::{build, build_all, same_positions};
use progmesh_refine::simplify::{Method, Options, Placement, Quiet};
use proptest::prelude::*;
use std::io::Read;

/// The sample with normals and uvs as wedges, and groups.
fn mesh_of(s: &Sample, double: bool) -> Mesh {
    let positions = if double {
        let shifted = s.positions.iter().map(|p| p.map(|x| x * 1.1 + 1e-9));
        Positions::F64(shifted.collect())
    } else {
        Positions::from_f64(s.positions.clone())
    };
    let mut input = MeshInput {
        positions,
        face_sizes: s.face_sizes.clone(),
        corners: s.corners.clone(),
        wires: s.wires.clone(),
        face_material: s.face_material.clone(),
        ..Default::default()
    };
    if let Some(n) = &s.normals {
        let mut channels = vec![Channel::new(Semantic::Normal, 3)];
        s.uvs.iter().for_each(|_| channels.push(Channel::new(Semantic::TexCoord(0), 2)));
        let all = (1 << channels.len()) - 1;
        let mut w = Wedges::new(channels).unwrap();
        let mut known = std::collections::HashMap::new();
        for c in 0..s.corners.len() {
            let uv = s.uvs.as_ref().map(|u| u.corner[c]);
            let id = *known.entry((n.corner[c], uv)).or_insert_with(|| {
                let mut row = n.values[n.corner[c] as usize].to_vec();
                s.uvs.iter().for_each(|u| row.extend(u.values[u.corner[c] as usize]));
                w.push(&row, all)
            });
            w.corner.push(id);
        }
        input.wedges = Some(w);
    }
    Mesh::build(input, &BuildOptions::default()).unwrap().0
}

fn sample(name: &str, faces: usize, seed: u64) -> Mesh {
    let s = generate(name, &GenerateOptions::default().with_faces(faces).with_seed(seed)).unwrap();
    mesh_of(&s, false)
}

const NAMES: [&str; 8] =
    ["sphere", "torus", "scan", "terrain", "polygons", "quad-sphere", "cad", "nonmanifold"];

fn runs() -> Vec<Options> {
    let one = |method, placement| {
        let mut o = Options::default();
        (o.method, o.placement) = (method, placement);
        o
    };
    let mut all = vec![
        one(Method::Quadric, Some(Placement::Endpoint)),
        one(Method::Quadric, None),
        one(Method::Quadric, Some(Placement::Midpoint)),
        one(Method::Nsa, None),
        one(Method::Nsa, Some(Placement::Endpoint)),
    ];
    all[1].grid = Some((-14f64).exp2());
    all
}

fn assert_same(a: &MeshInput, b: &MeshInput) {
    assert!(same_positions(&a.positions, &b.positions), "positions");
    assert_eq!(a.face_sizes, b.face_sizes);
    assert_eq!(a.corners, b.corners);
    assert_eq!(a.wires, b.wires);
    assert_eq!(a.face_material, b.face_material);
    assert_eq!(a.face_group, b.face_group);
    assert_eq!(a.wedges.is_some(), b.wedges.is_some());
    let bits = |w: &Wedges| -> Vec<(u64, Vec<u32>)> {
        (0..w.len() as u32).map(|i| (w.present(i), w.row(i).iter().map(|x| x.to_bits()).collect())).collect()
    };
    if let (Some(x), Some(y)) = (&a.wedges, &b.wedges) {
        assert_eq!(x.channels(), y.channels());
        assert_eq!(x.corner, y.corner);
        assert_eq!(bits(x), bits(y));
    }
}

/// The base of both is the same, bit for bit.
fn assert_same_base(a: &ProgressiveMesh, b: &ProgressiveMesh) {
    assert_eq!(a.base_faces, b.base_faces);
    assert!(same_positions(&a.base_positions, &b.base_positions));
    assert_eq!(a.wires, b.wires);
    assert_eq!(a.splits.len(), b.splits.len());
}

fn full(pm: &ProgressiveMesh) -> MeshInput {
    let mut c = pm.cursor().unwrap();
    c.seek(usize::MAX).unwrap();
    c.to_ordered_input()
}

fn one(pm: &ProgressiveMesh, options: &EncodeOptions) -> Vec<u8> {
    encode(std::slice::from_ref(pm), &[], &[], options).unwrap()
}

#[test]
fn a_file_returns_the_input_bit_for_bit_whatever_made_it() {
    for name in NAMES {
        for double in [false, true] {
            let s = generate(name, &GenerateOptions::default().with_faces(3000).with_seed(7)).unwrap();
            let mesh = mesh_of(&s, double);
            let input = mesh.to_input();
            for o in runs() {
                let pm = build(mesh.clone(), &o, &Quiet).unwrap().mesh;
                let bytes = one(&pm, &EncodeOptions::default());
                let decoded = decode(&bytes).unwrap();
                assert!(decoded.report.complete && decoded.report.damage.is_none());
                assert_eq!(decoded.report.streams.total(), bytes.len() as u64);
                assert_eq!(decoded.turns, vec![0; pm.splits.len()]);
                assert_eq!(decoded.scene, None);
                assert_same_base(&decoded.meshes[0], &pm);
                assert_same(&full(&decoded.meshes[0]), &input);
                // Written again, the same bytes but for the plan, which sees another order: still the same mesh.
                let again = decode(&one(&decoded.meshes[0], &EncodeOptions::default())).unwrap();
                assert_same(&full(&again.meshes[0]), &input);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, ..ProptestConfig::default() })]

    #[test]
    fn random_meshes_return(name in 0..NAMES.len(), faces in 100..1500usize, seed in 0..1000u64, run in 0..5usize) {
        let mesh = sample(NAMES[name], faces, seed);
        let input = mesh.to_input();
        let pm = build(mesh, &runs()[run], &Quiet).unwrap().mesh;
        let decoded = decode(&one(&pm, &EncodeOptions::default())).unwrap();
        assert_same(&full(&decoded.meshes[0]), &input);
    }
}

/// The splits of `pm` in the order of the file, made of what the file does not change.
fn several() -> (Vec<ProgressiveMesh>, Vec<u32>) {
    let meshes = vec![sample("scan", 1500, 1), sample("polygons", 800, 1), sample("cad", 900, 1)];
    let all = build_all(meshes, &[1.0, 0.5, 2.0], &Options::default(), &Quiet).unwrap();
    (all.meshes, all.turns)
}

#[test]
fn several_meshes_and_a_scene_share_a_file() {
    let (meshes, turns) = several();
    let scene = b"nodes".to_vec();
    let bytes = encode(&meshes, &turns, &scene, &EncodeOptions::default()).unwrap();
    let decoded = decode(&bytes).unwrap();
    assert_eq!(decoded.scene.as_deref(), Some(&scene[..]));
    for (m, (a, b)) in decoded.meshes.iter().zip(&meshes).enumerate() {
        assert_same(&full(a), &full(b));
        assert_eq!(decoded.turns.iter().filter(|&&t| t == m as u32).count(), b.splits.len());
    }
}

/// Delivers `step` bytes a call.
struct Trickle<'a>(&'a [u8], usize);

impl Read for Trickle<'_> {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        let n = self.1.min(to.len()).min(self.0.len());
        to[..n].copy_from_slice(&self.0[..n]);
        self.0 = &self.0[n..];
        Ok(n)
    }
}

#[test]
fn a_stream_in_single_bytes_brings_base_then_ever_finer_meshes() {
    let (meshes, turns) = several();
    let bytes = encode(&meshes, &turns, b"x", &EncodeOptions::default()).unwrap();
    let whole = decode(&bytes).unwrap();
    for step in [1, 7, 4096] {
        let mut r = PmReader::new(Trickle(&bytes, step)).unwrap();
        let mut splits = 0;
        while let Some(chunk) = r.advance().unwrap() {
            let Some(pm) = r.mesh(0) else { continue };
            let mut c = pm.cursor().unwrap();
            c.seek(usize::MAX).unwrap();
            if chunk.mesh == 0 && chunk.kind == ChunkType::SPLITS {
                assert!(pm.splits.len() > splits);
                splits = pm.splits.len();
            }
        }
        assert_eq!(r.scene(), Some(&b"x"[..]));
        let decoded = r.finish();
        assert_eq!(decoded, whole);
    }
}

#[test]
fn chunks_are_read_alone_and_in_any_order() {
    let (meshes, turns) = several();
    let bytes = encode(&meshes, &turns, &[], &EncodeOptions::default()).unwrap();
    let whole =
        decode(&encode(&meshes, &turns, &[], &EncodeOptions::default().with_any_order(true)).unwrap());
    let whole = whole.unwrap();
    let r = RangeReader::new(&bytes[..]).unwrap();
    let bases: Vec<_> = (0..3).map(|m| r.base(m).unwrap()).collect();
    for chunk in r.directory().chunks.iter().rev().filter(|c| c.kind == ChunkType::SPLITS) {
        let head = &bases[chunk.mesh as usize].0;
        let Piece::Splits(block) = r.read(chunk.index, Some(head)).unwrap() else { panic!("no splits") };
        let range = chunk.first as usize..(chunk.first + chunk.count) as usize;
        let s = &whole.meshes[chunk.mesh as usize].splits;
        assert_eq!(block.splits.vertex, s.vertex[range.clone()]);
        assert_eq!(block.splits.left, s.left[range.clone()]);
        assert_eq!(block.splits.right, s.right[range.clone()]);
        assert_eq!(block.splits.code, s.code[range.clone()]);
        assert_eq!(block.splits.error, s.error[range]);
        assert_eq!(block.bytes(), chunk.raw);
    }
}
