//! Attributes under quadric collapse: charts, creases, material borders, skins.

mod common;

use common::distance::{Surface, closest};
use common::{sample, topology_of};
use glam::DVec3;
use progmesh_aif::*;
use progmesh_simplify::*;
use std::collections::{BTreeMap, HashMap, HashSet};

const WAYS: [(Schedule, Placement); 4] = [
    (Schedule::Exact, Placement::Optimal),
    (Schedule::Bulk, Placement::Optimal),
    (Schedule::Exact, Placement::Midpoint),
    (Schedule::Bulk, Placement::Endpoint),
];

fn run(m: &mut Mesh, way: (Schedule, Placement), set: impl FnOnce(&mut Options)) -> Outcome {
    let mut o = Options::default();
    // Where vertices may move at all, they are refitted too.
    (o.schedule, o.placement, o.refit) = (Some(way.0), Some(way.1), Some(2));
    set(&mut o);
    let out = simplify(m, &o, &Quiet).unwrap();
    assert_eq!(m.check(), Ok(()));
    out
}

/// Vertex and wedge of every corner of every face.
fn corners(m: &Mesh) -> Vec<[(VertexId, u32); 3]> {
    let (t, w) = (m.topology(), m.wedges().unwrap());
    t.faces()
        .map(|f| {
            let r = t.corner_range(f);
            assert_eq!(r.len(), 3);
            let v = t.triangle(f);
            [0, 1, 2].map(|i| (v[i], w.corner[r.start + i]))
        })
        .collect()
}

fn get<const N: usize>(m: &Mesh, wedge: u32, semantic: &Semantic) -> [f64; N] {
    let w = m.wedges().unwrap();
    let values = w.get(wedge, w.channel(semantic).unwrap()).unwrap();
    std::array::from_fn(|i| values[i] as f64)
}

/// The mesh with rows of attributes, one for each vertex.
fn with_rows(m: &Mesh, channels: &[Channel], row: impl Fn(usize, DVec3) -> Vec<f32>) -> Mesh {
    let mut input = m.to_input();
    let mut w = Wedges::new(channels.to_vec()).unwrap();
    for (v, p) in input.positions.iter().enumerate() {
        w.push(&row(v, p), (1 << channels.len()) - 1);
    }
    w.corner = input.corners.clone();
    input.wedges = Some(w);
    Mesh::build(input, &BuildOptions::default()).unwrap().0
}

/// Triangles of a chart, and their uvs.
type Chart = (Vec<[u32; 3]>, Vec<[[f64; 2]; 3]>);

fn chart([u, v]: [f64; 2]) -> (i32, i32) {
    ((u * 3.0).floor() as i32, (v * 2.0).floor() as i32)
}

#[test]
fn charts_stay_whole_and_normals_continuous() {
    let input = sample("quad-sphere", 18_000, 0).triangulate().unwrap().mesh;
    let uv = Semantic::TexCoord(0);
    // The surface of every chart, with the uvs of its triangles.
    let mut charts: BTreeMap<(i32, i32), Chart> = BTreeMap::new();
    for c in corners(&input) {
        let uvs = c.map(|(_, w)| get::<2>(&input, w, &uv));
        let entry = charts.entry(chart(uvs[0])).or_default();
        entry.0.push(c.map(|(v, _)| v.0));
        entry.1.push(uvs);
    }
    assert_eq!(charts.len(), 6);
    let charts: BTreeMap<_, _> = charts
        .into_iter()
        .map(|(k, (triangles, uvs))| {
            let m = Mesh::build(
                MeshInput::triangles(input.positions().clone(), &triangles),
                &BuildOptions::default(),
            );
            let m = m.unwrap().0;
            (k, (Surface::new(&m), m, uvs))
        })
        .collect();
    for way in WAYS {
        let mut m = input.clone();
        let out = run(&mut m, way, |o| o.triangles = Some(1500));
        assert_eq!((out.stop, topology_of(&m)), (Stop::Target, topology_of(&input)), "{way:?}");
        let mut normals: HashMap<VertexId, [f64; 3]> = HashMap::new();
        let (mut sum, mut n, mut worst) = (0.0, 0.0, 0.0f64);
        for c in corners(&m) {
            let uvs = c.map(|(_, w)| get::<2>(&m, w, &uv));
            let k = chart(uvs[0]);
            assert!(uvs.iter().all(|&x| chart(x) == k), "a triangle spans charts: {uvs:?}, {way:?}");
            let (surface, chart, chart_uvs) = &charts[&k];
            for ((v, w), got) in c.into_iter().zip(uvs) {
                let normal = get::<3>(&m, w, &Semantic::Normal);
                let unit = DVec3::from_array(normal);
                assert!((unit.length() - 1.0).abs() < 1e-5, "{unit}");
                assert!(unit.dot(m.position(v).normalize()) > 0.995, "{unit} at {}", m.position(v));
                // The seams are of uvs alone: both sides keep one normal, bit for bit.
                assert_eq!(*normals.entry(v).or_insert(normal), normal, "{way:?}");
                // The uv is that of the nearest point of the chart.
                let p = m.position(v);
                let (t, _) = surface.nearest(p);
                let [a, b, d] = chart.triangles()[t].map(|i| chart.positions().get(i as usize));
                let q = closest(p, &[a, b, d]);
                let whole = (b - a).cross(d - a).length();
                let weights = [(b - q).cross(d - q), (d - q).cross(a - q), (a - q).cross(b - q)]
                    .map(|x| x.length() / whole);
                let want: [f64; 2] = [0, 1].map(|i| (0..3).map(|j| weights[j] * chart_uvs[t][j][i]).sum());
                // In parts of a chart's side.
                let off = ((want[0] - got[0]) * 3.0).abs().max(((want[1] - got[1]) * 2.0).abs());
                worst = worst.max(off);
                (sum, n) = (sum + off, n + 1.0);
            }
        }
        println!("{way:?}: uv off by {} on average, {worst} at most", sum / n);
        assert!(sum / n < 0.004 && worst < 0.05, "{way:?}: {} {worst}", sum / n);
        // Every seam vertex still has a wedge for each chart it lies in: the cube's twelve edges are all there.
        let mut sides: HashMap<VertexId, HashSet<(i32, i32)>> = HashMap::new();
        for (v, w) in corners(&m).into_iter().flatten() {
            sides.entry(v).or_default().insert(chart(get::<2>(&m, w, &uv)));
        }
        assert_eq!(sides.values().filter(|s| s.len() == 3).count(), 8, "the corners of the cube");
        assert!(sides.values().filter(|s| s.len() == 2).count() >= 12 * 3, "{way:?}");
    }
}

#[test]
fn what_is_linear_on_a_plane_stays_linear() {
    let n = 40u32;
    let shake = |i: u32, k: u32| ((i * 7919 + k * 104_729) % 97) as f32 / 97.0 * 0.6 - 0.3;
    let point = |i: u32| {
        let (x, y) = (i % (n + 1), i / (n + 1));
        let inside = |a: u32, k| if a > 0 && a < n { shake(i, k) } else { 0.0 };
        [x as f32 + inside(x, 0), y as f32 + inside(y, 1), 0.0]
    };
    let quad = |x: u32, y: u32| [[0, 1, n + 2], [0, n + 2, n + 1]].map(|t| t.map(|k| y * (n + 1) + x + k));
    let triangles: Vec<_> = (0..n).flat_map(|y| (0..n).flat_map(move |x| quad(x, y))).collect();
    let plane =
        Mesh::from_triangles((0..(n + 1) * (n + 1)).map(point).collect::<Vec<_>>(), &triangles).unwrap();
    let linear = |p: DVec3| [0.25 + p.x / 64.0, 0.75 - p.y / 128.0];
    let channels = [Channel::new(Semantic::TexCoord(1), 2)];
    let input = with_rows(&plane, &channels, |_, p| linear(p).map(|x| x as f32).to_vec());
    for way in WAYS {
        for target in [1600, 300, 20] {
            let mut m = input.clone();
            run(&mut m, way, |o| o.triangles = Some(target));
            for (v, w) in corners(&m).into_iter().flatten() {
                let (got, want) = (get::<2>(&m, w, &channels[0].semantic), linear(m.position(v)));
                let off = (got[0] - want[0]).abs().max((got[1] - want[1]).abs());
                assert!(off < 2e-5, "{way:?} to {target}: {got:?}, not {want:?}");
            }
        }
    }
}

#[test]
fn colours_stay_in_range_and_skins_keep_their_sum() {
    let semantics = [Semantic::Color(0), Semantic::Joints(0), Semantic::Weights(0)];
    let channels = semantics.clone().map(|s| Channel::new(s, 4));
    let color = |p: DVec3| [0, 1, 2].map(|i| (p[i] * 0.4 + 0.5) as f32);
    let skin = |v: usize| {
        let first = (v % 5) as f32;
        let w = [0.4 + 0.01 * (v % 7) as f32, 0.3, 0.2];
        ([first, first + 3.0, first + 10.0, 0.0], [w[0], w[1], w[2], 1.0 - w[0] - w[1] - w[2]])
    };
    let input = with_rows(&sample("sphere", 4000, 0), &channels, |v, p| {
        let (joints, weights) = skin(v);
        color(p).into_iter().chain([1.0]).chain(joints).chain(weights).collect()
    });
    for way in WAYS {
        let mut m = input.clone();
        run(&mut m, way, |o| o.triangles = Some(400));
        for (v, w) in corners(&m).into_iter().flatten() {
            let c = get::<4>(&m, w, &semantics[0]);
            let want = color(m.position(v));
            assert!(
                c.iter().take(3).all(|x| (0.0999..=0.9001).contains(x)) && (c[3] - 1.0).abs() < 1e-6,
                "{c:?}"
            );
            assert!((0..3).all(|i| (c[i] - want[i] as f64).abs() < 0.05), "{way:?}: {c:?}, not {want:?}");
            let (joints, weights) = (get::<4>(&m, w, &semantics[1]), get::<4>(&m, w, &semantics[2]));
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-4, "{weights:?}");
            assert!(weights.iter().all(|x| (0.0..=1.0).contains(x)));
            assert!(joints.iter().all(|j| j.fract() == 0.0 && (0.0..=14.0).contains(j)), "{joints:?}");
            let used: Vec<_> = (0..4).filter(|&i| weights[i] > 0.0).map(|i| joints[i] as u32).collect();
            assert_eq!(
                used.iter().collect::<HashSet<_>>().len(),
                used.len(),
                "a joint counts once: {joints:?}"
            );
        }
    }
}

/// Number of connected parts of the edges that `keep` names.
fn parts(m: &Mesh, keep: impl Fn(EdgeId) -> bool) -> usize {
    let t = m.topology();
    let edges: Vec<EdgeId> = t.edges().filter(|&e| keep(e)).collect();
    let mut part: HashMap<VertexId, VertexId> = HashMap::new();
    fn root(part: &mut HashMap<VertexId, VertexId>, v: VertexId) -> VertexId {
        let up = *part.entry(v).or_insert(v);
        if up == v { v } else { root(part, up) }
    }
    for &e in &edges {
        let [a, b] = t.edge_vertices(e).map(|v| root(&mut part, v));
        part.insert(a, b);
    }
    let vertices: Vec<_> = part.keys().copied().collect();
    vertices.into_iter().map(|v| root(&mut part, v)).collect::<HashSet<_>>().len()
}

#[test]
fn borders_between_materials_and_groups_are_not_torn() {
    let ball = sample("sphere", 40_000, 0);
    let t = ball.topology();
    let octant = |p: DVec3| (p.x > 0.1) as u32 + 2 * (p.y > -0.05) as u32 + 4 * (p.z > 0.2) as u32;
    let regions: Vec<u32> = t
        .faces()
        .map(|f| octant(t.face_vertices(f).map(|v| ball.position(v)).sum::<DVec3>() / 3.0))
        .collect();
    for by_group in [false, true] {
        let mut input = ball.to_input();
        *(if by_group { &mut input.face_group } else { &mut input.face_material }) = regions.clone();
        let input = Mesh::build(input, &BuildOptions::default()).unwrap().0;
        let of = |m: &Mesh, f: FaceId| if by_group { m.group(f) } else { m.material(f) }.unwrap();
        let is_border =
            |m: &Mesh, e: EdgeId| matches!(m.topology().edge_faces(e), &[f, g] if of(m, f) != of(m, g));
        let areas = |m: &Mesh| {
            let mut a = [0.0; 8];
            m.topology().faces().for_each(|f| a[of(m, f) as usize] += 0.5 * m.face_normal(f).length());
            a
        };
        let euler_of_borders = |m: &Mesh| {
            let t = m.topology();
            let edges: Vec<_> = t.edges().filter(|&e| is_border(m, e)).collect();
            let ends: HashSet<_> = edges.iter().flat_map(|&e| t.edge_vertices(e)).collect();
            ends.len() as i64 - edges.len() as i64
        };
        for way in WAYS {
            let mut m = input.clone();
            let out = run(&mut m, way, |o| o.triangles = Some(800));
            assert_eq!(out.stop, Stop::Target);
            for (k, (now, was)) in areas(&m).iter().zip(areas(&input)).enumerate() {
                assert!((now / was - 1.0).abs() < 0.05, "{way:?}: region {k} has {now} of {was}");
            }
            assert_eq!(parts(&m, |e| is_border(&m, e)), parts(&input, |e| is_border(&input, e)), "{way:?}");
            assert_eq!(euler_of_borders(&m), euler_of_borders(&input), "{way:?}");
            // As far as collapses go, every region stays a region.
            let mut least = input.clone();
            run(&mut least, way, |o| o.triangles = Some(0));
            assert!(areas(&least).iter().all(|&a| a > 0.0), "{way:?}");
            assert_eq!(euler_of_borders(&least), euler_of_borders(&input), "{way:?}");
        }
    }
}

#[test]
fn corners_without_attributes_stay_without() {
    // Half of the corners have no wedge, some wedges lack a channel: nothing is made up.
    let channels = [Channel::new(Semantic::TexCoord(0), 2), Channel::new(Semantic::Custom("t".into()), 20)];
    let full = with_rows(&sample("sphere", 2000, 0), &channels, |v, _| vec![1.0 + (v % 3) as f32; 22]);
    let mut input = full.to_input();
    let at = |v: u32| full.positions().get(v as usize);
    let w = input.wedges.as_mut().unwrap();
    for c in w.corner.iter_mut().filter(|c| at(**c).z > 0.3) {
        *c = NONE;
    }
    for v in (0..full.vertex_count() as u32).filter(|&v| at(v).x > 0.0) {
        w.set_present(v, 0b10);
        w.row_mut(v)[..2].fill(0.0);
    }
    let input = Mesh::build(input, &BuildOptions::default()).unwrap().0;
    for way in WAYS {
        let mut m = input.clone();
        run(&mut m, way, |o| o.triangles = Some(300));
        let w = m.wedges().unwrap();
        let (mut without, mut with) = (0, 0);
        for (_, c) in corners(&m).into_iter().flatten() {
            if c == NONE {
                without += 1;
                continue;
            }
            with += 1;
            if let Some(uv) = w.get(c, 0) {
                assert!(
                    uv.iter().all(|x| (1.0..=3.0).contains(x)),
                    "an absent value was averaged in: {uv:?}"
                );
            }
            assert!(w.get(c, 1).unwrap().iter().all(|x| (0.9999..=3.0001).contains(x)));
        }
        assert!(without > 50 && with > 50, "{without} {with}");
    }
}
