//! What the tests of this crate share: sample meshes, comparison bit for bit; random numbers, cameras and what a view needs by the book.
#![allow(dead_code, unreachable_pub, reason = "each test file uses its part")]

use glam::DVec3;
use progmesh_meshes::{GenerateOptions, Sample, generate};
use progmesh_refine::ProgressiveMesh;
use progmesh_refine::aif::*;
use progmesh_refine::format::Chunk;
use progmesh_refine::hierarchy::Hierarchy;
use progmesh_refine::progressive::{build, same_positions};
use progmesh_refine::selective::Lens;
use progmesh_refine::simplify::{Method, Options, Placement, Quiet};
use progmesh_refine::view::{Camera, CameraParameters, Projection};

/// The well-formed samples.
pub const NAMES: [&str; 8] =
    ["sphere", "torus", "scan", "terrain", "polygons", "quad-sphere", "cad", "nonmanifold"];

/// The sample with normals and uvs as wedges, one for each pair of values: shared across seams, so that NSA must part them.
pub fn input_of(s: &Sample) -> MeshInput {
    let mut input = MeshInput {
        positions: Positions::from_f64(s.positions.clone()),
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
    input
}

pub fn mesh_of(s: &Sample) -> Mesh {
    Mesh::build(input_of(s), &BuildOptions::default()).unwrap().0
}

pub fn sample(name: &str, faces: usize, seed: u64) -> Mesh {
    mesh_of(&generate(name, &GenerateOptions::default().with_faces(faces).with_seed(seed)).unwrap())
}

/// A grid of heights whose normals differ from one side to the other of a seam that begins and ends inside.
pub fn with_a_slit(seed: u64) -> Mesh {
    const N: u32 = 12;
    let height = |x: u32, y: u32| ((x * 7 + y * 13 + seed as u32 * 5) % 11) as f32 * 0.05;
    let at = |x: u32, y: u32| y * (N + 1) + x;
    let places = (0..=N).flat_map(|y| (0..=N).map(move |x| [x as f32, y as f32, height(x, y)]));
    let mut input = MeshInput::triangles(places.collect::<Vec<[f32; 3]>>(), &[]);
    let mut w = Wedges::new(vec![Channel::new(Semantic::Normal, 3)]).unwrap();
    for k in 0..2 * (N + 1) * (N + 1) {
        w.push(&[k as f32 * 0.01, (k % 7) as f32, 1.0], 1);
    }
    for (x, y) in (0..N).flat_map(|y| (0..N).map(move |x| (x, y))) {
        for face in [[(x, y), (x + 1, y), (x + 1, y + 1)], [(x, y), (x + 1, y + 1), (x, y + 1)]] {
            for (i, j) in face {
                input.corners.push(at(i, j));
                // Above the line the vertices inside of the slit have wedges of their own.
                let other = y == 6 && j == 6 && (3..9).contains(&i);
                w.corner.push(at(i, j) + if other { (N + 1) * (N + 1) } else { 0 });
            }
        }
    }
    input.wedges = Some(w);
    Mesh::build(input, &BuildOptions::default()).unwrap().0
}

pub fn options(method: Method, placement: Option<Placement>) -> Options {
    let mut o = Options::default();
    (o.method, o.placement) = (method, placement);
    o
}

/// Every array, bit for bit.
pub fn assert_same(a: &MeshInput, b: &MeshInput) {
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

/// A sample with all its collapses recorded.
pub fn progressive(
    name: &str,
    faces: usize,
    method: Method,
    placement: Option<Placement>,
) -> ProgressiveMesh {
    build(sample(name, faces, 5), &options(method, placement), &Quiet).unwrap().mesh
}

pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize) % n.max(1)
    }

    pub fn unit(&mut self) -> f64 {
        self.below(1 << 30) as f64 / (1u64 << 30) as f64
    }

    /// A vector that is neither long nor short.
    fn ball(&mut self) -> DVec3 {
        loop {
            let p = DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0;
            if p.length() < 1.0 && p.length() > 0.1 {
                return p;
            }
        }
    }
}

/// At so many diagonals from the middle, looking at the mesh.
pub fn any_camera(h: &Hierarchy, random: &mut Random, distance: f64, projection: Projection) -> Camera {
    let (centre, size) = h.extent();
    Camera::new(&CameraParameters {
        eye: centre + random.ball().normalize() * size * distance,
        target: centre + random.ball() * 0.3 * size,
        up: random.ball(),
        projection,
        width: 640,
        height: 480,
        near: 0.01 * size,
        far: 10.0 * size,
    })
    .unwrap()
}

/// For every split whether it is in the least closed set: needed, wherever its vertex is, or one that such a split depends on.
pub fn least_closed<D: Iterator<Item = usize>>(
    h: &Hierarchy,
    lens: &Lens,
    dependencies: impl Fn(usize) -> D,
) -> Vec<bool> {
    let mut want = vec![false; h.splits()];
    for i in (0..h.splits()).rev() {
        want[i] |= lens.needs(h, i);
        if want[i] {
            dependencies(i).for_each(|d| want[d] = true);
        }
    }
    want
}

/// Sets the checksums of a chunk, and of head and directory, right.
pub fn sign(bytes: &mut [u8], c: &Chunk) {
    let sum = crc32fast::hash(&bytes[c.range().start as usize..c.range().end as usize]);
    let entry = 48 + 64 * c.index as usize;
    bytes[entry + 36..entry + 40].copy_from_slice(&sum.to_le_bytes());
    sign_directory(bytes);
}

/// The same of head and directory.
pub fn sign_directory(bytes: &mut [u8]) {
    let end = 48 + 64 * u32::from_le_bytes(bytes[24..28].try_into().unwrap()) as usize;
    let mut h = crc32fast::Hasher::new();
    h.update(&bytes[..44]);
    h.update(&bytes[48..end]);
    bytes[44..48].copy_from_slice(&h.finalize().to_le_bytes());
}
