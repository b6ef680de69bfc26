//! What every well-formed sample promises of its topology, geometry and attributes.

mod topology;

use progmesh_meshes::{GenerateOptions, Sample, generate, names};
use topology::{Topology, area_vector, volume6};

fn make(name: &str) -> Sample {
    generate(name, &GenerateOptions::default()).unwrap()
}

fn make_with(name: &str, faces: usize, seed: u64) -> Sample {
    generate(name, &GenerateOptions::default().with_faces(faces).with_seed(seed)).unwrap()
}

#[test]
fn sphere_is_closed_of_genus_0_and_round() {
    for faces in [0, 20, 500, 20_480] {
        let s = make_with("sphere", faces, 0);
        let t = Topology::of(&s);
        assert!(t.is_closed_and_oriented() && t.euler() == 2 && t.used_vertices == s.positions.len());
        assert!(volume6(&s) > 0.0);
        assert!(s.positions.iter().all(|p| (p.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 3e-7));
    }
}

#[test]
fn quad_sphere_has_quads_normals_seams_and_a_texture() {
    let s = make("quad-sphere");
    let t = Topology::of(&s);
    assert!(t.is_closed_and_oriented() && t.euler() == 2);
    assert!(s.face_sizes.as_ref().unwrap().iter().all(|&n| n == 4));
    let (normals, uvs) = (s.normals.as_ref().unwrap(), s.uvs.as_ref().unwrap());
    assert_eq!((normals.corner.len(), uvs.corner.len()), (s.corners.len(), s.corners.len()));
    for (c, &v) in s.corners.iter().enumerate() {
        let (p, n) = (s.positions[v as usize], normals.values[normals.corner[c] as usize]);
        assert!((0..3).all(|k| (p[k] - n[k] as f64).abs() < 1e-6));
    }
    // Seams: along the 12 edges of the cube, 32 segments each, a vertex has 2 or (at the 8 corners) 3 uvs.
    let more = uvs.values.len() - s.positions.len();
    assert_eq!(more, 12 * 31 + 8 * 2);
    assert!(uvs.values.as_flattened().iter().all(|x| (0.0..=1.0).contains(x)));
    let texture = &s.textures[s.materials[0].texture.unwrap()];
    assert_eq!(texture.rgb.len(), (3 * texture.width * texture.height) as usize);
    assert_eq!(s.face_material, vec![0; s.face_count()]);
}

#[test]
fn quad_sphere_charts_are_not_mirrored() {
    let s = make_with("quad-sphere", 54, 0);
    let uvs = s.uvs.as_ref().unwrap();
    for quad in uvs.corner.chunks(4) {
        let [a, b, c] = [0, 1, 2].map(|k| uvs.values[quad[k] as usize]);
        assert!((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0);
    }
}

#[test]
fn torus_is_closed_of_genus_1() {
    for faces in [0, 100, 16_384] {
        let s = make_with("torus", faces, 0);
        let t = Topology::of(&s);
        assert!(t.is_closed_and_oriented() && t.euler() == 0 && volume6(&s) > 0.0, "{faces}");
        assert_eq!(s.normals.as_ref().unwrap().corner.len(), s.corners.len());
    }
}

#[test]
fn terrain_is_a_disk_that_looks_up() {
    let s = make("terrain");
    let t = Topology::of(&s);
    assert!(t.is_oriented_surface() && t.euler() == 1);
    assert_eq!(t.border_loops(), Some(1));
    assert!(s.faces().all(|f| area_vector(&s, f)[2] > 0.0));
    let (lo, hi) = s.bounds().unwrap();
    assert!((hi[2] - lo[2]) > 0.05 && lo[2] >= 0.0 && hi[2] < 0.6, "{lo:?} {hi:?}");
}

#[test]
fn scan_has_six_holes_and_diagonal_1() {
    for seed in 0..4 {
        let s = make_with("scan", 20_000, seed);
        let t = Topology::of(&s);
        assert!(s.face_count().abs_diff(20_000) < 1_200, "{}", s.face_count());
        assert!(t.is_oriented_surface() && t.used_vertices == s.positions.len());
        assert_eq!(t.border_loops(), Some(6));
        assert_eq!(t.euler(), 2 - 6);
        assert!((s.diagonal() - 1.0).abs() < 1e-7, "{}", s.diagonal());
        assert!(volume6(&s) > 0.0);
        // Not even the smallest face has an area of nothing.
        assert!(s.faces().all(|f| area_vector(&s, f).iter().any(|x| x.abs() > 1e-8)));
    }
    for faces in [0, 1, 100, 1000] {
        let s = make_with("scan", faces, 7);
        assert!(s.face_count() > 0 && Topology::of(&s).border_loops().is_some());
    }
}

#[test]
fn cad_is_closed_of_genus_1_with_exact_planes() {
    for faces in [0, 500, 12_000] {
        let s = make_with("cad", faces, 3);
        let t = Topology::of(&s);
        assert!(t.is_closed_and_oriented() && t.euler() == 0 && volume6(&s) > 0.0, "{faces}");
        let normals = s.normals.as_ref().unwrap();
        for (f, face) in s.faces().enumerate() {
            let area = area_vector(&s, face);
            let n = normals.values[normals.corner[3 * f] as usize];
            let along: f64 = (0..3).map(|k| area[k] * n[k] as f64).sum();
            assert!(along > 0.0, "face {f} of {faces}");
            if s.face_material[f] == 0 {
                // On a plane the other two components vanish exactly.
                assert_eq!(area.iter().filter(|&&x| x == 0.0).count(), 2, "face {f}");
            }
        }
    }
}

#[test]
fn nonmanifold_has_what_it_names() {
    let s = make("nonmanifold");
    let t = Topology::of(&s);
    let rows = t.edges_of(3);
    assert_eq!(rows, 4);
    assert_eq!(t.edges.values().map(|u| u.0 + u.1).max(), Some(3));
    assert_eq!(s.wires.len(), 1);
    assert!(!t.edges.contains_key(&(s.wires[0][0], s.wires[0][1])));
    // One vertex hangs on the wire alone, one on nothing.
    assert_eq!(s.positions.len() - t.used_vertices, 2);
    // The apex of the cones: the vertex of most faces, in two fans of 16 without an edge between.
    let mut faces = vec![0; s.positions.len()];
    s.corners.iter().for_each(|&v| faces[v as usize] += 1);
    assert_eq!(faces.iter().max(), Some(&32));
}

#[test]
fn polygons_are_simple_from_above_and_some_concave() {
    for seed in 0..3 {
        let s = make_with("polygons", 2000, seed);
        let t = Topology::of(&s);
        assert!(t.is_oriented_surface() && t.euler() == 1 && t.border_loops() == Some(1));
        let mut sizes = std::collections::BTreeSet::new();
        let mut concave = 0;
        for face in s.faces() {
            sizes.insert(face.len());
            let turn = |i: usize| {
                let at = |k: usize| face[(i + k) % face.len()];
                area_vector(&s, &[at(0), at(1), at(2)])[2]
            };
            concave += (0..face.len()).any(|i| turn(i) < -0.1) as usize;
            let area: f64 =
                (1..face.len() - 1).map(|i| area_vector(&s, &[face[0], face[i], face[i + 1]])[2]).sum();
            assert!(area > 0.0);
        }
        assert_eq!(sizes.into_iter().collect::<Vec<_>>(), [3, 4, 6, 7, 8]);
        assert!(concave > 100, "{concave}");
    }
}

#[test]
fn the_seed_decides_all_that_is_random_and_nothing_else() {
    for e in names() {
        let faces = if e.default_faces == 0 { 0 } else { 600 };
        let bits = |seed| format!("{:?}", make_with(e.name, faces, seed));
        assert_eq!(bits(5), bits(5), "{}", e.name);
        assert_eq!(bits(5) != bits(6), e.seeded, "{}", e.name);
    }
}

/// Guards the promise of the same bits on every platform: it fails where arithmetic differs, or when a generator is changed
/// (then put the new values here).
#[test]
fn the_bits_are_those_of_every_platform() {
    let hash = |name: &str| {
        let s = make_with(name, 500, 1);
        let numbers = s.positions.as_flattened().iter().map(|x| x.to_bits());
        let all = numbers.chain(s.corners.iter().map(|&c| c as u64));
        all.fold(0xcbf2_9ce4_8422_2325u64, |h, x| (h ^ x).wrapping_mul(0x100_0000_01b3))
    };
    let found = ["sphere", "quad-sphere", "torus", "terrain", "scan", "cad", "polygons"].map(hash);
    let want: [u64; 7] = [
        0x74bd_9539_7e9f_879b,
        0x02fe_01fa_0202_981d,
        0x1764_055e_a2cd_7c8b,
        0x713c_f46e_57cd_8477,
        0x0344_5e06_486e_7d40,
        0x8afe_0231_e6a2_6e9d,
        0x5f0c_eaca_cf4c_5029,
    ];
    assert_eq!(found, want, "{found:#x?}");
}

#[test]
fn face_counts_are_near_those_asked_for() {
    for e in names().iter().filter(|e| e.default_faces > 0) {
        let s = generate(e.name, &GenerateOptions::default().with_faces(5000)).unwrap();
        let off = s.face_count().abs_diff(5000);
        assert!(off < 600, "{}: {}", e.name, s.face_count());
        let s = generate(e.name, &GenerateOptions::default()).unwrap();
        assert!(
            s.face_count().abs_diff(e.default_faces) < e.default_faces / 10,
            "{}: {}",
            e.name,
            s.face_count()
        );
    }
}

#[test]
fn coordinates_are_f32_but_in_the_f64_samples() {
    for e in names() {
        let faces = if e.default_faces == 0 { 0 } else { 600 };
        let s = make_with(e.name, faces, 2);
        let exact = |x: &f64| x.is_nan() || *x as f32 as f64 == *x;
        assert_eq!(s.positions.as_flattened().iter().all(exact), !e.name.ends_with("-f64"), "{}", e.name);
    }
}
