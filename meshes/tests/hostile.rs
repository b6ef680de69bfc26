//! Every hostile sample has the defect it is named after, and is the scan otherwise.

mod topology;

use progmesh_meshes::{GenerateOptions, Sample, generate};
use std::collections::BTreeMap;
use topology::{Topology, area_vector};

fn make(name: &str) -> Sample {
    generate(name, &GenerateOptions::default().with_seed(11).with_faces(5000)).unwrap()
}

fn moved(by: f64, name: &str) -> (Sample, Sample) {
    let (scan, s) = (make("scan"), make(name));
    assert_eq!(scan.corners, s.corners);
    for (a, b) in scan.positions.as_flattened().iter().zip(s.positions.as_flattened()) {
        assert!((a + by - b).abs() <= by * f32::EPSILON as f64, "{a} {b}");
    }
    (scan, s)
}

#[test]
fn offsets_move_and_the_far_one_loses_detail_in_f32() {
    for (by, name) in [(1e4, "offset-1e4"), (1e6, "offset-1e6")] {
        let (scan, s) = moved(by, name);
        let (_, exact) = moved(by, &format!("{name}-f64"));
        for (a, b) in scan.positions.as_flattened().iter().zip(exact.positions.as_flattened()) {
            assert!((b - by - a).abs() < 2e-10);
        }
        let different = |s: &Sample| {
            let mut p: Vec<_> = s.positions.iter().map(|p| p.map(f64::to_bits)).collect();
            p.sort_unstable();
            p.dedup();
            p.len()
        };
        assert_eq!(different(&exact), scan.positions.len());
        assert_eq!(different(&s) < scan.positions.len() / 2, by == 1e6);
    }
}

#[test]
fn scales_and_squash_scale() {
    let scan = make("scan");
    let cases = [
        ("scale-1e-12", [1e-12; 3]),
        ("scale-1e12", [1e12; 3]),
        ("scale-1e-25", [1e-25; 3]),
        ("squashed", [1.0, 1.0, 1e-6]),
    ];
    for (name, by) in cases {
        let s = make(name);
        assert_eq!(scan.corners, s.corners);
        for (p, q) in scan.positions.iter().zip(&s.positions) {
            for k in 0..3 {
                assert!((p[k] * by[k] - q[k]).abs() <= 1e-7 * q[k].abs(), "{name}");
            }
        }
    }
}

#[test]
fn nan_and_inf_are_in_one_coordinate_of_a_used_vertex() {
    let scan = make("scan");
    for (name, is) in [("nan", f64::is_nan as fn(f64) -> bool), ("inf", |x| x == f64::INFINITY)] {
        let s = make(name);
        assert_eq!(scan.corners, s.corners);
        let (a, b) = (scan.positions.as_flattened(), s.positions.as_flattened());
        let other: Vec<usize> = (0..a.len()).filter(|&i| a[i].to_bits() != b[i].to_bits()).collect();
        assert_eq!(other.len(), 1, "{name}");
        assert!(is(b[other[0]]) && s.corners.contains(&(other[0] as u32 / 3)));
    }
}

#[test]
fn degenerate_faces_add_nothing_but_faces_without_area() {
    let (scan, s) = (make("scan"), make("degenerate-faces"));
    let distinct = |t: &[u32]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    let repeats = s.faces().filter(|t| !distinct(t)).count();
    let thin = s.faces().filter(|t| distinct(t) && area_vector(&s, t) == [0.0; 3]).count();
    assert!(repeats >= 50 && thin >= 50, "{repeats} {thin}");
    assert!(s.faces().any(|t| t[0] == t[1] && t[1] == t[2]));
    assert_eq!(s.face_count(), scan.face_count() + repeats + thin);
    // What has area is the scan's surface, face by face.
    let shape = |m: &Sample| -> Vec<[[u64; 3]; 3]> {
        m.faces()
            .filter(|t| area_vector(m, t) != [0.0; 3])
            .map(|t| [0, 1, 2].map(|k| m.positions[t[k] as usize].map(f64::to_bits)))
            .collect()
    };
    assert!(shape(&scan) == shape(&s));
    // Without the repeats it is a surface with the scan's borders.
    let mut clean = s.clone();
    clean.corners = s.faces().filter(|t| distinct(t)).flatten().copied().collect();
    let (t, u) = (Topology::of(&scan), Topology::of(&clean));
    assert!(u.is_oriented_surface());
    assert_eq!((t.euler(), t.border_loops()), (u.euler(), u.border_loops()));
}

#[test]
fn duplicate_faces_come_straight_turned_and_reversed() {
    let (scan, s) = (make("scan"), make("duplicate-faces"));
    assert_eq!(s.positions, scan.positions);
    assert_eq!(s.corners[..scan.corners.len()], scan.corners);
    let mut first: BTreeMap<Vec<u32>, &[u32]> = BTreeMap::new();
    let sorted = |t: &[u32]| {
        let mut k = t.to_vec();
        k.sort_unstable();
        k
    };
    scan.faces().for_each(|t| assert!(first.insert(sorted(t), t).is_none()));
    let (mut same, mut turned, mut reversed) = (0, 0, 0);
    for t in s.faces().skip(scan.face_count()) {
        let &[a, b, c] = first[&sorted(t)] else { unreachable!() };
        match t {
            _ if t == [a, b, c] => same += 1,
            _ if t == [b, c, a] => turned += 1,
            _ if t == [a, c, b] => reversed += 1,
            _ => panic!("{t:?}"),
        }
    }
    assert_eq!(same + turned + reversed, s.face_count() - scan.face_count());
    assert!(same >= 30 && turned >= 30 && reversed >= 30, "{same} {turned} {reversed}");
}

#[test]
fn one_index_is_out_of_range() {
    let (scan, s) = (make("scan"), make("index-out-of-range"));
    assert_eq!(scan.positions, s.positions);
    let wrong: Vec<u32> = scan.corners.iter().zip(&s.corners).filter(|(a, b)| a != b).map(|p| *p.1).collect();
    assert_eq!(wrong, [s.positions.len() as u32]);
}

#[test]
fn soup_shares_no_vertex_and_welds_to_the_scan() {
    let (scan, s) = (make("scan"), make("soup"));
    assert_eq!(s.positions.len(), s.corners.len());
    assert!(s.corners.iter().enumerate().all(|(i, &v)| v as usize == i));
    let places =
        |m: &Sample| -> Vec<[f64; 3]> { m.corners.iter().map(|&v| m.positions[v as usize]).collect() };
    assert_eq!(places(&scan), places(&s));
}

#[test]
fn half_of_the_faces_are_turned_over() {
    let (scan, s) = (make("scan"), make("flipped-half"));
    assert_eq!(scan.positions, s.positions);
    let mut flipped = 0;
    for (a, b) in scan.faces().zip(s.faces()) {
        flipped += (a != b) as usize;
        assert!(a == b || [a[0], a[2], a[1]] == b);
    }
    assert_eq!(flipped, scan.face_count() / 2);
}

#[test]
fn empty_and_single() {
    assert_eq!(make("empty"), Sample::default());
    let one = make("single-triangle");
    assert_eq!((one.positions.len(), one.corners.as_slice()), (3, &[0, 1, 2][..]));
    assert_eq!(area_vector(&one, &one.corners), [0.0, 0.0, 1.0]);
}
