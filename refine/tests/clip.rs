//! Clipping against independent computations: areas by enumeration of corners, by cells, by signed fans; volumes by the divergence theorem.

use glam::{DMat3, DVec2, DVec3, DVec4};
use progmesh_meshes::{GenerateOptions, SplitMix64, generate};
use progmesh_refine::aif::{Channel, MeshInput, Positions, Semantic, Wedges};
use progmesh_refine::view::clip::*;
use progmesh_refine::view::{Camera, CameraParameters, Projection};
use proptest::prelude::*;
use std::collections::HashMap;

fn vector(r: &mut SplitMix64, size: f64) -> DVec3 {
    DVec3::new(r.signed(), r.signed(), r.signed()) * size
}

fn area(t: &[DVec3; 3]) -> DVec3 {
    0.5 * (t[1] - t[0]).cross(t[2] - t[0])
}

fn affine(p: DVec4) -> DVec3 {
    p.truncate() / p.w
}

/// The area of a triangle's part inside of all planes, by the corners that part can have, sorted by angle.
fn enumerated(t: &[DVec3; 3], planes: &[DVec4]) -> f64 {
    let n = area(t).normalize();
    let (e1, e2) = (n.any_orthonormal_vector(), n.cross(n.any_orthonormal_vector()));
    let flat = |p: DVec3| DVec2::new((p - t[0]).dot(e1), (p - t[0]).dot(e2));
    // Half planes: those of the triangle's sides, and the planes.
    let mut half: Vec<DVec3> = (0..3)
        .map(|k| {
            let (a, b) = (flat(t[k]), flat(t[(k + 1) % 3]));
            let d = (b - a).perp();
            DVec3::new(d.x, d.y, -d.dot(a))
        })
        .collect();
    half.extend(planes.iter().map(|p| {
        let n = p.truncate();
        DVec3::new(n.dot(e1), n.dot(e2), n.dot(t[0]) + p.w)
    }));
    let mut corners = Vec::new();
    for i in 0..half.len() {
        for j in 0..i {
            let p = half[i].cross(half[j]);
            if p.z.abs() < 1e-14 {
                continue;
            }
            let p = DVec3::new(p.x / p.z, p.y / p.z, 1.0);
            if half.iter().all(|h| h.dot(p) / h.truncate().length().max(1e-300) >= -1e-9) {
                corners.push(p.truncate());
            }
        }
    }
    if corners.len() < 3 {
        return 0.0;
    }
    let middle = corners.iter().sum::<DVec2>() / corners.len() as f64;
    corners.sort_by(|a, b| (a - middle).to_angle().total_cmp(&(b - middle).to_angle()));
    let n = corners.len();
    0.5 * (0..n).map(|i| (corners[i] - middle).perp_dot(corners[(i + 1) % n] - middle)).sum::<f64>()
}

/// Polygons along a grid, cut through its points, along its lines, or anyhow.
fn cells_keep_their_area(seed: u64) -> Result<(), TestCaseError> {
    let mut r = SplitMix64::new(seed);
    let cells: Vec<bool> = (0..36).map(|_| r.unit() < 0.55).collect();
    let polygon = of_cells(&cells);
    // Through lattice points, along grid lines, or anyhow.
    let point = |r: &mut SplitMix64| DVec3::new(r.below(7) as f64, r.below(7) as f64, 1.0);
    let line = match seed % 4 {
        0 => DVec3::new(r.signed(), r.signed(), 3.0 * r.signed()),
        _ => point(&mut r).cross(point(&mut r)),
    };
    prop_assume!(line.truncate() != DVec2::ZERO);
    let want = |line: DVec3| {
        let mut sum = 0.0;
        for i in (0..36).filter(|&i| cells[i]) {
            let at = DVec3::new((i % 6) as f64, (i / 6) as f64, 0.0);
            let (a, b, c, d) = (at, at + DVec3::X, at + DVec3::new(1.0, 1.0, 0.0), at + DVec3::Y);
            let sides = [a, b, c, d].map(|p| line.dot(p + DVec3::Z));
            let plane = [DVec4::new(line.x, line.y, 0.0, line.z)];
            sum += match (sides.iter().all(|&s| s >= 0.0), sides.iter().all(|&s| s <= 0.0)) {
                (_, true) => 0.0,
                (true, _) => 1.0,
                _ => enumerated(&[a, b, c], &plane) + enumerated(&[a, c, d], &plane),
            };
        }
        sum
    };
    for line in [line, -line] {
        let clipped = polygon.clip(line);
        let (got, want) = (polygon_area(&clipped), want(line));
        prop_assert!((got - want).abs() < 1e-8, "{got} {want} {line}");
        for p in clipped.cycles().flatten() {
            prop_assert!(p.z > 0.0 && line.dot(*p) / p.z >= -1e-9 * line.length(), "{p}");
        }
        // Again: nothing changes. (What lies on the line is on it but for rounding.)
        let again = polygon_area(&clipped.clip(line + DVec3::Z * 1e-9 * line.truncate().length()));
        prop_assert!((again - got).abs() < 1e-6, "{again} {got}");
    }
    // Seen through any projective map, also one that takes part of it past infinity, it is the same polygon.
    let m = DMat3::from_cols(vector(&mut r, 1.0), vector(&mut r, 1.0), vector(&mut r, 1.0));
    if seed.is_multiple_of(4) && m.determinant() > 0.05 {
        let seen = Polygon::new(polygon.cycles().map(|c| c.iter().map(|&p| m * p).collect::<Vec<_>>()));
        let back = m.inverse();
        let clipped = seen.clip(back.transpose() * line);
        let home = Polygon::new(clipped.cycles().map(|c| c.iter().map(|&p| back * p).collect::<Vec<_>>()));
        prop_assert!((polygon_area(&home) - want(line)).abs() < 1e-6);
    }
    Ok(())
}

#[test]
fn polygons_of_cells_that_failed_once() {
    cells_keep_their_area(14983940217205036343).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn a_triangle_in_a_box_is_at_most_seven_of_the_right_area(seed: u64) {
        let mut r = SplitMix64::new(seed);
        // On a coarse grid now and then, so that corners and edges lie on planes.
        let snap = seed % 3 == 0;
        let t = [0; 3].map(|_| {
            let p = vector(&mut r, 2.5);
            if snap { p.round() } else { p }
        });
        prop_assume!(area(&t).length() > 1e-3);
        let planes = box_planes(-DVec3::ONE, DVec3::ONE);
        // The position again as an attribute: it must come out as the position.
        let corners = t.map(|p| Vertex { point: p.extend(1.0), values: [p.x, p.y, p.z, 1.0] });
        let (mut clipper, mut out) = (ConvexClipper::default(), vec![]);
        let outcome = clipper.triangle(&corners, &planes, &mut out);
        prop_assert!(out.len() <= 7);
        prop_assert_eq!(outcome == Outcome::Dropped, out.is_empty());
        let mut sum = DVec3::ZERO;
        for piece in &out {
            for c in piece {
                let p = affine(c.point);
                prop_assert!(p.abs().max_element() <= 1.0 + 1e-9);
                prop_assert!((p - DVec3::new(c.values[0], c.values[1], c.values[2])).length() < 1e-9);
                prop_assert!((c.values[3] - 1.0).abs() < 1e-12);
            }
            let a = area(&piece.map(|c| affine(c.point)));
            prop_assert!(a.dot(area(&t)) >= -1e-12, "turned over");
            sum += a;
        }
        // In a face of the box the rule of the open side and the enumeration differ.
        let on_face = (0..3).any(|k| t.iter().all(|p| p[k] == 1.0) || t.iter().all(|p| p[k] == -1.0));
        if !on_face {
            let want = enumerated(&t, &planes);
            prop_assert!((sum.length() - want).abs() < 1e-7, "{} {want}", sum.length());
        }
        // The pipeline of filters has the same area, if in more pieces.
        let mut pieces = vec![corners];
        for plane in planes {
            let mut next = vec![];
            pieces.iter().for_each(|p| clip_triangle(p, plane, &mut next));
            pieces = next;
        }
        prop_assert!(pieces.len() <= 26);
        let piped: DVec3 = pieces.iter().map(|p| area(&p.map(|c| affine(c.point)))).sum();
        prop_assert!((piped - sum).length() < 1e-9);
    }

    #[test]
    fn two_sides_of_a_plane_make_the_whole(seed: u64) {
        let mut r = SplitMix64::new(seed);
        let t = [0; 3].map(|_| vector(&mut r, 1.0).extend(1.0));
        let plane = vector(&mut r, 1.0).extend(0.5 * r.signed());
        let mut out = vec![];
        clip_triangle(&t, plane, &mut out);
        let inside: DVec3 = out.iter().map(|p| area(&p.map(affine))).sum();
        out.clear();
        clip_triangle(&t, -plane, &mut out);
        let outside: DVec3 = out.iter().map(|p| area(&p.map(affine))).sum();
        let whole = area(&t.map(affine));
        prop_assert!((inside + outside - whole).length() < 1e-12);
        prop_assert!((inside.length() + outside.length() - whole.length()).abs() < 1e-12);
        // A segment: the same point from both ends, which its sides share.
        if let (Some([a, b]), Some([c, d])) =
            (clip_segment(&t[0], &t[1], plane), clip_segment(&t[1], &t[0], plane)) {
            prop_assert_eq!((a, b), (d, c));
        }
    }

    #[test]
    fn what_passes_behind_the_eye_is_cut_as_in_the_world(seed: u64) {
        let mut r = SplitMix64::new(seed);
        let camera = Camera::new(&CameraParameters {
            eye: vector(&mut r, 1.0),
            target: vector(&mut r, 1.0) + DVec3::new(0.0, 0.0, -4.0),
            up: DVec3::Y,
            projection: Projection::Perspective { fov_y_deg: 70.0 },
            width: 160,
            height: 90,
            near: 0.2,
            far: 6.0,
        }).unwrap();
        let t = [0; 3].map(|_| vector(&mut r, 5.0));
        let m = camera.matrix();
        let corners = t.map(|p| Vertex { point: m * p.extend(1.0), values: p.to_array() });
        let mut out = vec![];
        ConvexClipper::default().triangle(&corners, &CLIP_SPACE, &mut out);
        let frustum = camera.frustum();
        let planes = frustum.planes().map(|p| p.normal.extend(p.offset - p.normal.dot(frustum.origin())));
        let mut sum = 0.0;
        for piece in &out {
            for c in piece {
                prop_assert!(c.point.w > 0.0);
                let p = DVec3::from_array(c.values);
                prop_assert!(planes.iter().all(|q| q.dot(p.extend(1.0)) > -1e-6));
            }
            sum += area(&piece.map(|c| DVec3::from_array(c.values))).length();
        }
        prop_assert!((sum - enumerated(&t, &planes)).abs() < 1e-6);
        // A segment through the eye's plane.
        let s = [corners[0].point, corners[1].point];
        if let Some([a, b]) = clip_segment_in(&s[0], &s[1], &CLIP_SPACE) {
            prop_assert!(a.w > 0.0 && b.w > 0.0);
        }
    }

    #[test]
    fn polygons_of_cells_have_the_area_of_their_cells(seed: u64) {
        cells_keep_their_area(seed)?;
    }

    #[test]
    fn a_mesh_and_its_other_side_make_the_whole(seed: u64) {
        let mut r = SplitMix64::new(seed);
        let name = ["sphere", "torus", "cad", "polygons", "quad-sphere"][(seed % 5) as usize];
        let sample = generate(name, &GenerateOptions::default().with_faces(300).with_seed(seed)).unwrap();
        let mut input = MeshInput {
            positions: Positions::from_f64(sample.positions.clone()),
            face_sizes: sample.face_sizes.clone(),
            corners: sample.corners.clone(),
            ..Default::default()
        };
        if seed & 32 != 0 {
            input.positions = Positions::F64(sample.positions.clone());
        }
        prop_assume!(border(&input) == 0);
        let (lo, hi) = input.positions.bounds().unwrap();
        let centre = lo + (hi - lo) * DVec3::new(r.unit(), r.unit(), r.unit());
        // Through a vertex, along an axis, or anyhow.
        let normal = if seed & 8 == 0 { DVec3::AXES[r.below(3)] } else { vector(&mut r, 1.0) };
        let on = if seed & 16 == 0 { input.positions.get(r.below(input.positions.len())) } else { centre };
        let plane = normal.extend(-normal.dot(on));
        let parts = [plane, -plane].map(|p| clip_mesh(&input, &[p], true).unwrap());
        for part in &parts {
            prop_assert_eq!(part.mesh.face_sizes.is_some(), input.face_sizes.is_some());
            prop_assert_eq!((border(&part.mesh), part.open_edges), (0, 0));
        }
        let volumes = [&parts[0].mesh, &parts[1].mesh, &input].map(volume);
        let size = (hi - lo).length();
        // Faces of four corners and more are not flat, so cutting them changes the volume a little.
        let tolerance = if input.face_sizes.is_some() { 1e-3 } else { 1e-6 };
        prop_assert!((volumes[0] + volumes[1] - volumes[2]).abs() < tolerance * size.powi(3), "{volumes:?}");
        // Eight boxes about a point: their volumes add up as well.
        let mut sum = 0.0;
        for k in 0..8 {
            let pick = |k: usize, axis: usize, inner: f64, outer: f64| if k >> axis & 1 == 0 { outer } else { inner };
            let low = DVec3::from_array([0, 1, 2].map(|a| pick(k, a, on[a], lo[a] - size)));
            let high = DVec3::from_array([0, 1, 2].map(|a| pick(k, a, hi[a] + size, on[a])));
            let part = clip_mesh(&input, &box_planes(low, high), true).unwrap();
            prop_assert_eq!((border(&part.mesh), part.open_edges), (0, 0));
            sum += volume(&part.mesh);
        }
        prop_assert!((sum - volumes[2]).abs() < 4.0 * tolerance * size.powi(3), "{sum} {volumes:?}");
    }
}

/// The boundary of cells of a 6 by 6 grid, the inside on the left.
fn of_cells(cells: &[bool]) -> Polygon {
    let full = |x: i32, y: i32| (0..6).contains(&x) && (0..6).contains(&y) && cells[(y * 6 + x) as usize];
    let mut edges: HashMap<(i32, i32), Vec<(i32, i32)>> = HashMap::new();
    for y in 0..6 {
        for x in (0..6).filter(|&x| full(x, y)) {
            let ring = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)];
            for (k, (dx, dy)) in [(0, -1), (1, 0), (0, 1), (-1, 0)].into_iter().enumerate() {
                if !full(x + dx, y + dy) {
                    edges.entry(ring[k]).or_default().push(ring[(k + 1) % 4]);
                }
            }
        }
    }
    let mut starts: Vec<_> = edges.keys().copied().collect();
    starts.sort_unstable();
    let mut cycles = vec![];
    for start in starts {
        while !edges[&start].is_empty() {
            let (mut at, mut cycle, mut came) = (start, vec![], (0, 0));
            loop {
                let ways = edges.get_mut(&at).unwrap();
                // Turning left, so that pieces that touch in a corner stay apart.
                let left = |to: &(i32, i32)| came.0 * (to.1 - at.1) - came.1 * (to.0 - at.0) > 0;
                let k = ways.iter().position(left).unwrap_or(0);
                let to = ways.swap_remove(k);
                cycle.push(DVec3::new(at.0 as f64, at.1 as f64, 1.0));
                came = (to.0 - at.0, to.1 - at.1);
                at = to;
                if at == start {
                    break;
                }
            }
            cycles.push(cycle);
        }
    }
    Polygon::new(cycles)
}

fn polygon_area(p: &Polygon) -> f64 {
    let of = |c: &[DVec3]| {
        let at = |i: usize| c[i % c.len()].truncate() / c[i % c.len()].z;
        0.5 * (0..c.len()).map(|i| (at(i) - at(0)).perp_dot(at(i + 1) - at(0))).sum::<f64>()
    };
    p.cycles().map(of).sum()
}

/// Edges that are not run through once each way.
fn border(mesh: &MeshInput) -> usize {
    let mut count: HashMap<(u32, u32), i32> = HashMap::new();
    let mut start = 0;
    for f in 0..mesh.face_count() {
        let n = mesh.face_sizes.as_ref().map_or(3, |s| s[f] as usize);
        let c = &mesh.corners[start..start + n];
        for i in 0..n {
            let (a, b) = (c[i], c[(i + 1) % n]);
            *count.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
        }
        start += n;
    }
    count.values().filter(|&&n| n != 0).count()
}

fn volume(mesh: &MeshInput) -> f64 {
    let (mut start, mut sum) = (0, 0.0);
    let at = |c: usize| mesh.positions.get(mesh.corners[c] as usize);
    let middle = mesh.positions.bounds().map_or(DVec3::ZERO, |(lo, hi)| 0.5 * (lo + hi));
    for f in 0..mesh.face_count() {
        let n = mesh.face_sizes.as_ref().map_or(3, |s| s[f] as usize);
        for i in 1..n - 1 {
            let t = [at(start) - middle, at(start + i) - middle, at(start + i + 1) - middle];
            sum += t[0].dot(t[1].cross(t[2])) / 6.0;
        }
        start += n;
    }
    sum
}

#[test]
fn what_touches_a_plane_is_decided() {
    let x = DVec4::X;
    let at = |x: f64, y: f64| DVec4::new(x, y, 0.0, 1.0);
    // A segment on the plane, one that ends on it, one that only touches it.
    assert_eq!(clip_segment(&at(0.0, 0.0), &at(0.0, 1.0), x), None);
    assert_eq!(clip_segment(&at(0.0, 0.0), &at(1.0, 1.0), x), Some([at(0.0, 0.0), at(1.0, 1.0)]));
    assert_eq!(clip_segment(&at(0.0, 0.0), &at(-1.0, 1.0), x), None);
    let clip = |t: [DVec4; 3]| {
        let mut out = vec![];
        clip_triangle(&t, x, &mut out);
        let mut fan = vec![];
        ConvexClipper::default().triangle(&t, &[x], &mut fan);
        let sum = |v: &[[DVec4; 3]]| v.iter().map(|t| area(&t.map(affine)).z).sum::<f64>();
        assert_eq!((sum(&out), out.len()), (sum(&fan), fan.len()));
        out
    };
    // A corner on it, an edge on it, the whole on it; from either side.
    let t = [at(0.0, 0.0), at(2.0, 0.0), at(2.0, 2.0)];
    assert_eq!(clip(t), [t]);
    assert!(clip(t.map(|p| DVec4::new(-p.x, p.y, p.z, p.w))).is_empty());
    let t = [at(0.0, 0.0), at(2.0, 0.0), at(0.0, 2.0)];
    assert_eq!(clip(t), [t]);
    assert!(clip([at(0.0, 0.0), at(0.0, 2.0), at(-2.0, 0.0)]).is_empty());
    assert!(clip([at(0.0, 0.0), at(0.0, 1.0), at(0.0, 5.0)]).is_empty());
    // Through a corner and the middle of the side across: one triangle, with that corner as it was.
    let cut = clip([at(0.0, 0.0), at(2.0, 1.0), at(-2.0, 3.0)]);
    assert_eq!(cut.len(), 1);
    assert!(cut[0].contains(&at(0.0, 0.0)) && cut[0].contains(&at(0.0, 2.0)));
}

#[test]
fn the_eyes_plane_is_no_exception() {
    // In clip space the eye's plane is w = 0. An end on it, a segment in it, one through the eye itself.
    let near = DVec4::new(0.0, 0.0, 1.0, 1.0);
    let (front, plane, behind) =
        (DVec4::new(0.0, 0.0, 0.0, 1.0), DVec4::new(1.0, 0.0, -0.5, 0.0), DVec4::new(0.0, 0.0, -1.0, -1.0));
    let [a, b] = clip_segment(&front, &plane, near).unwrap();
    assert!(a == front && side(near, b).abs() < 1e-15 && b.w > 0.0);
    assert_eq!(clip_segment(&plane, &behind, near), None);
    let [_, b] = clip_segment(&behind, &front, near).unwrap();
    assert_eq!(b, front);
    // Two points behind the eye project as if they were before it; here they do not count.
    assert_eq!(clip_segment_in(&behind, &(2.0 * behind), &CLIP_SPACE), None);
}

#[test]
fn a_hole_alone_is_all_but_the_hole() {
    // Clockwise about the origin: everything else of the two-sided plane is inside, and so is a line that passes it.
    let hole =
        Polygon::new([[DVec3::new(0.0, 1.0, 1.0), DVec3::new(1.0, -1.0, 1.0), DVec3::new(-1.0, -1.0, 1.0)]]);
    let clipped = hole.clip(DVec3::new(0.0, 1.0, 5.0));
    assert_eq!(clipped.cycles().len(), 2);
    // The line, as a cycle with the positive side on its left.
    let around = clipped.cycles().find(|c| c.iter().all(|p| DVec3::new(0.0, 1.0, 5.0).dot(*p).abs() < 1e-12));
    let around = around.unwrap();
    assert!(around[0].cross(around[1]).dot(DVec3::new(0.0, 1.0, 5.0)) > 0.0);
    // The other side of it is the hemisphere without the hole.
    let other = hole.clip(DVec3::new(0.0, -1.0, -5.0));
    assert_eq!(other.cycles().len(), 1);
    // A hole that the line cuts: one cycle, by way of infinity.
    let cut = hole.clip(DVec3::Y);
    assert_eq!(cut.cycles().len(), 1);
    assert!(cut.cycles().next().unwrap().iter().any(|p| p.z <= 0.0));
    // Nothing is nothing, and a line beside a triangle is outside of it.
    assert!(Polygon::default().clip(DVec3::X).is_empty());
    let triangle =
        Polygon::new([[DVec3::new(0.0, 0.0, 1.0), DVec3::new(1.0, 0.0, 1.0), DVec3::new(0.0, 1.0, 1.0)]]);
    assert!(triangle.clip(DVec3::new(1.0, 0.0, -3.0)).is_empty());
    assert_eq!(triangle.clip(DVec3::new(-1.0, 0.0, 3.0)), triangle);
}

#[test]
fn what_a_line_only_touches_is_on_the_other_side() {
    for k in 0..60 {
        let y = 0.1 * k as f64;
        let strip = |low: f64, high: f64| {
            [[-1e3, low], [1e3, low], [1e3, high], [-1e3, high]].map(|[x, y]| DVec3::new(x, y, 1.0))
        };
        let turned = |mut cycle: [DVec3; 4]| {
            cycle.reverse();
            cycle
        };
        // Below is positive. An edge of what is above lies along the line, exactly.
        let (line, above, below) = (DVec3::new(0.0, -1.0, y), strip(y, y + 1.0), strip(y - 3.0, y - 2.0));
        assert!(Polygon::new([above]).clip(line).is_empty(), "{y}");
        assert_eq!(Polygon::new([above, below]).clip(line), Polygon::new([below]), "{y}");
        // As holes in everything: the line bounds what is left.
        let along = |c: &[DVec3]| c.iter().all(|p| line.dot(*p).abs() < 1e-12);
        for (holes, left) in [(vec![turned(above)], 1), (vec![turned(above), turned(below)], 2)] {
            let clipped = Polygon::new(holes).clip(line);
            assert_eq!(clipped.cycles().len(), left, "{y}");
            assert_eq!(clipped.cycles().filter(|c| along(c)).count(), 1, "{y}");
        }
    }
}

#[test]
fn a_polygon_is_cut_where_it_stands_in_space() {
    let ring = |r: f64, way: f64| {
        (0..4)
            .map(|k| (k as f64 * way * std::f64::consts::FRAC_PI_2).sin_cos())
            .map(|(s, c)| DVec3::new(r * c, r * s, 1.0))
            .collect::<Vec<_>>()
    };
    let polygon = Polygon::new([ring(2.0, 1.0), ring(1.0, -1.0)]);
    let map = PlaneMap { x: DVec4::Y, y: DVec4::Z, w: DVec4::new(3.0, 0.0, 0.0, 1.0) };
    assert_eq!(map.point(DVec3::new(1.0, 2.0, 1.0)), DVec4::new(3.0, 1.0, 2.0, 1.0));
    // 8 - 2 before; a quarter of it in the box y, z > 0; nothing on the other side of x = 3.
    let quarter = polygon.clip_in(&box_planes(DVec3::ZERO, DVec3::splat(9.0)), &map);
    assert!((polygon_area(&quarter) - 1.5).abs() < 1e-12);
    assert!(polygon.clip_in(&[DVec4::new(-1.0, 0.0, 0.0, 3.0)], &map).is_empty());
    assert!(polygon.clip_in(&[DVec4::new(-1.0, 0.0, 0.0, 2.0)], &map).is_empty());
    assert_eq!(polygon.clip_in(&[DVec4::new(-1.0, 0.0, 0.0, 4.0)], &map), polygon);
}

/// A cube of side 2 about the origin.
fn cube() -> MeshInput {
    let corner = |k: usize| [0, 1, 2].map(|a| if k >> a & 1 == 0 { -1.0f32 } else { 1.0 });
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    MeshInput::polygons((0..8).map(corner).collect::<Vec<_>>(), &[4; 6], quads.as_flattened())
}

#[test]
fn faces_in_a_plane_stay_and_caps_take_their_place() {
    let cube = cube();
    // By its own box, nothing changes.
    let same = clip_mesh(&cube, &box_planes(-DVec3::ONE, DVec3::ONE), true).unwrap();
    assert_eq!((same.cut, same.dropped, same.capped), (0, 0, 0));
    assert_eq!(same.mesh.corners, cube.corners);
    // What only touches the plane is a face of it; of a solid, nothing.
    let up = DVec4::new(0.0, 0.0, 1.0, -1.0);
    assert_eq!(clip_mesh(&cube, &[up], false).unwrap().mesh.face_count(), 1);
    assert_eq!(clip_mesh(&cube, &[up], true).unwrap().mesh.face_count(), 0);
    // Half of it, with a cap of the plane's coordinate.
    let half = clip_mesh(&cube, &[DVec4::new(0.0, 0.0, 3.0, -0.3)], true).unwrap();
    assert_eq!((half.cut, half.dropped, half.capped, half.loops), (4, 1, 2, 1));
    assert_eq!(border(&half.mesh), 0);
    assert!((volume(&half.mesh) - 3.6).abs() < 1e-6);
    let low = half.mesh.positions.iter().filter(|p| p.z < 0.5).count();
    assert_eq!(low, 4);
    assert!(half.mesh.positions.iter().filter(|p| p.z < 0.5).all(|p| p.z == 0.1f32 as f64));
}

#[test]
fn a_cap_has_holes_and_pieces() {
    // A cube with a cube-shaped cavity, and another cube beside it.
    let solid = cube();
    let (mut points, mut corners) = (vec![], vec![]);
    for (scale, shift, turned) in [(1.0, 0.0, false), (0.5, 0.0, true), (1.0, 3.0, false)] {
        let base = points.len() as u32;
        points.extend(
            solid
                .positions
                .iter()
                .map(|p| [(p.x * scale + shift) as f32, (p.y * scale) as f32, (p.z * scale) as f32]),
        );
        for quad in solid.corners.chunks(4) {
            let mut quad: Vec<u32> = quad.iter().map(|v| v + base).collect();
            if turned {
                quad.reverse();
            }
            corners.extend(quad);
        }
    }
    let input = MeshInput::polygons(points, &[4; 18], &corners);
    let plane = DVec4::new(0.1, 0.2, 1.0, 0.03);
    let half = clip_mesh(&input, &[plane], true).unwrap();
    assert_eq!((border(&half.mesh), half.loops, half.open_edges), (0, 3, 0));
    let other = clip_mesh(&input, &[-plane], true).unwrap();
    assert!((volume(&half.mesh) + volume(&other.mesh) - 15.0).abs() < 1e-5);
    // The caps themselves: the area of the cut, without the hole.
    let cap_area = |m: &MeshClip| {
        let at = |c: usize| m.mesh.positions.get(m.mesh.corners[c] as usize);
        let end = m.mesh.corners.len();
        (0..m.capped)
            .map(|k| end - 3 * (k + 1))
            .map(|c| area(&[at(c), at(c + 1), at(c + 2)]).length())
            .sum::<f64>()
    };
    let slope = plane.truncate().length();
    assert!((cap_area(&half) - (4.0 - 1.0 + 4.0) * slope).abs() < 1e-4, "{}", cap_area(&half));
    assert!((cap_area(&other) - cap_area(&half)).abs() < 1e-9);
}

#[test]
fn attributes_materials_and_wires_come_along() {
    let mut input = cube();
    let mut wedges =
        Wedges::new(vec![Channel::new(Semantic::Normal, 3), Channel::new(Semantic::TexCoord(0), 2)]).unwrap();
    for &v in &input.corners {
        let p = input.positions.get(v as usize);
        let row = [p.x as f32, p.y as f32, p.z as f32, p.z as f32, 1.0];
        let w = wedges.push(&row, 0b11);
        wedges.corner.push(w);
    }
    input.wedges = Some(wedges);
    input.face_material = vec![0, 1, 2, 3, 4, 5];
    input.face_group = vec![7; 6];
    input.wires = vec![[0, 7], [0, 1]];
    let done = clip_mesh(&input, &[DVec4::Z], true).unwrap();
    let (mesh, wedges) = (&done.mesh, done.mesh.wedges.as_ref().unwrap());
    assert_eq!(mesh.wires.len(), 1);
    assert_eq!(mesh.positions.get(mesh.wires[0][0] as usize), DVec3::ZERO);
    assert_eq!(mesh.face_group, vec![7; mesh.face_count()]);
    assert!(mesh.face_material.iter().all(|m| [0, 1, 2, 3, 5].contains(m)));
    let mut start = 0;
    for (f, &n) in mesh.face_sizes.as_ref().unwrap().iter().enumerate() {
        for c in start..start + n as usize {
            let (p, row) = (mesh.positions.get(mesh.corners[c] as usize), wedges.row(wedges.corner[c]));
            assert_eq!((row[3], row[4]), (p.z as f32, 1.0));
            let normal = DVec3::new(row[0] as f64, row[1] as f64, row[2] as f64);
            let cap = f >= mesh.face_count() - done.capped;
            if cap {
                assert_eq!(normal, DVec3::NEG_Z);
            } else if p.z == 0.0 {
                assert!((normal.length() - 1.0).abs() < 1e-6 && normal.z.abs() < 1e-6);
            }
        }
        start += n as usize;
    }
    mesh.validate().unwrap();
}

#[test]
fn an_open_mesh_has_no_cap_where_it_is_open() {
    let mut input = cube();
    // Without its side at x = 1: the cut is open.
    input.face_sizes = Some(vec![4; 5]);
    input.corners =
        input.corners.chunks(4).enumerate().filter(|(f, _)| *f != 1).flat_map(|(_, c)| c.to_vec()).collect();
    let done = clip_mesh(&input, &[DVec4::Z], true).unwrap();
    assert_eq!((done.loops, done.capped, done.open_edges), (0, 0, 3));
    // A box that leaves the open side out closes, though its first plane runs into the hole.
    let planes = [DVec4::Z, DVec4::new(-1.0, 0.0, 0.0, 0.5)];
    let done = clip_mesh(&input, &planes, true).unwrap();
    assert_eq!((done.loops, done.open_edges, border(&done.mesh)), (2, 0, 0));
    // Cut away from it, it closes.
    let done = clip_mesh(&input, &[DVec4::new(-1.0, 0.0, 0.0, 0.5)], true).unwrap();
    assert_eq!((done.loops, border(&done.mesh)), (1, 0));
}

#[test]
fn hostile_meshes_are_cut_without_harm() {
    for name in ["nonmanifold", "soup", "scan"] {
        let Ok(sample) = generate(name, &GenerateOptions::default().with_faces(200)) else { continue };
        let input = MeshInput {
            positions: Positions::from_f64(sample.positions.clone()),
            face_sizes: sample.face_sizes.clone(),
            corners: sample.corners.clone(),
            ..Default::default()
        };
        let (lo, hi) = input.positions.bounds().unwrap();
        let planes = box_planes(lo.lerp(hi, 0.3), lo.lerp(hi, 0.8));
        clip_mesh(&input, &planes, true).unwrap().mesh.validate().unwrap();
    }
    // A polygon that crosses itself, one of no area, one that visits a vertex twice.
    let points = vec![
        [0.0f32, -1.0, 0.0],
        [1.0, 1.0, 0.0],
        [2.0, -1.0, 0.0],
        [3.0, 1.0, 0.0],
        [4.0, -1.0, 0.0],
        [2.0, 2.0, 0.0],
    ];
    for polygon in [vec![0, 1, 4, 3, 2, 5], vec![0, 1, 0, 1], vec![1, 2, 3, 2, 5], vec![3, 4, 3]] {
        let input = MeshInput::polygons(points.clone(), &[polygon.len() as u32], &polygon);
        for plane in [DVec4::Y, -DVec4::Y, DVec4::new(1.0, 0.3, 0.0, -2.0)] {
            clip_mesh(&input, &[plane], true).unwrap().mesh.validate().unwrap();
        }
    }
    assert!(matches!(clip_mesh(&cube(), &[DVec4::NAN], false), Err(MeshClipError::Plane(0))));
    let mut bad = cube();
    bad.corners[3] = 99;
    assert!(matches!(clip_mesh(&bad, &[DVec4::X], false), Err(MeshClipError::Mesh(_))));
}

#[test]
fn cuts_that_round_to_one_place_are_one_vertex() {
    // A pyramid whose tip is cut where f32 has no room between the edges; and just above and below the tip.
    let points =
        vec![[-1.0f32, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [0.3, 0.2, 1.0]];
    let faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]];
    let input = MeshInput::triangles(points, &faces);
    for height in [1.0 - 1e-9, 1.0, 1.0 - 3e-8, 1.0 - 1e-7, 1.0 - 3e-7] {
        for way in [1.0, -1.0] {
            let done = clip_mesh(&input, &[DVec4::new(0.0, 0.0, way, -way * height)], true).unwrap();
            assert_eq!((border(&done.mesh), done.open_edges), (0, 0));
            let places: std::collections::HashSet<_> =
                (0..done.mesh.positions.len()).map(|v| done.mesh.positions.bits(v)).collect();
            assert_eq!(places.len(), done.mesh.positions.len(), "{height} {way}");
        }
    }
}

#[test]
fn faces_can_be_picked() {
    let input = cube();
    let two = gather_faces(&input, &[1, 4]).unwrap();
    assert_eq!((two.face_count(), two.positions.len()), (2, 6));
    let all: Vec<u32> = (0..6).collect();
    assert_eq!(gather_faces(&input, &all).unwrap().corners, input.corners);
}
