//! Ear clipping on random polygons.

mod common;

use common::either;
use glam::DVec3;
use progmesh_aif::{BuildOptions, Mesh, triangulate_polygon};
use proptest::prelude::*;

fn cut(points: &[DVec3]) -> Vec<[u32; 3]> {
    let mut out = Vec::new();
    triangulate_polygon(points, &mut out);
    out
}

fn area(p: &[DVec3]) -> DVec3 {
    (1..p.len().saturating_sub(1)).map(|i| (p[i] - p[0]).cross(p[i + 1] - p[0])).sum()
}

/// Simple and planar: no triangle turned over, areas add up.
fn assert_tiles(p: &[DVec3]) -> Result<(), TestCaseError> {
    let triangles = cut(p);
    prop_assert_eq!(triangles.len(), p.len() - 2);
    let normal = area(p).normalize();
    let mut sum = 0.0;
    for t in &triangles {
        let a = area(&t.map(|i| p[i as usize])).dot(normal);
        prop_assert!(a >= -1e-9 * area(p).length(), "{:?} {}", t, a);
        sum += a;
    }
    prop_assert!((sum - area(p).length()).abs() <= 1e-9 * area(p).length());
    Ok(())
}

/// A star-shaped polygon in a plane of space, round any centre.
fn star_shaped() -> impl Strategy<Value = Vec<DVec3>> {
    let frame =
        ([-1.0f64..1.0, -1.0f64..1.0, -1.0f64..1.0], [-10.0f64..10.0, -10.0f64..10.0, -10.0f64..10.0]);
    (prop::collection::vec(0.05f64..1.0, 3..60), frame).prop_map(|(radii, (n, centre))| {
        let n = (DVec3::from_array(n) + DVec3::new(0.0, 0.0, 1e-3)).normalize();
        let u = n.any_orthonormal_vector();
        let v = n.cross(u);
        let step = std::f64::consts::TAU / radii.len() as f64;
        let at = |(i, r): (usize, f64)| {
            DVec3::from_array(centre) + (u * (i as f64 * step).cos() + v * (i as f64 * step).sin()) * r
        };
        radii.into_iter().enumerate().map(at).collect()
    })
}

/// A histogram: whole-number columns on a base line, with many points in line.
fn histogram() -> impl Strategy<Value = Vec<DVec3>> {
    prop::collection::vec(1i32..5, 1..20).prop_map(|heights| {
        let mut p = Vec::new();
        for x in 0..=heights.len() {
            p.push(DVec3::new(x as f64, 0.0, 0.0));
        }
        for (x, &h) in heights.iter().enumerate().rev() {
            p.push(DVec3::new(x as f64 + 1.0, h as f64, 0.0));
            p.push(DVec3::new(x as f64, h as f64, 0.0));
        }
        p.dedup();
        p
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn star_shaped_polygons_are_tiled(p in star_shaped()) {
        assert_tiles(&p)?;
    }

    #[test]
    fn histograms_are_tiled(p in histogram(), turn in 0usize..40) {
        let mut p = p;
        let n = p.len();
        p.rotate_left(turn % n);
        assert_tiles(&p)?;
    }

    #[test]
    fn any_points_give_a_disk(p in prop::collection::vec([-2i8..3, -2i8..3, -2i8..3], 3..40)) {
        let p: Vec<DVec3> = p.into_iter().map(|p| DVec3::from_array(p.map(|x| x as f64))).collect();
        let triangles = cut(&p);
        prop_assert_eq!(triangles.len(), p.len() - 2);
        prop_assert_eq!(&triangles, &cut(&p));
        // As a mesh of its own: a disk whose border is the polygon, run the same way.
        let disk = Mesh::from_triangles(vec![[0.0f32; 3]; p.len()], &triangles).unwrap();
        let t = disk.topology();
        prop_assert!(t.count_kinds().is_manifold());
        prop_assert_eq!((t.euler_characteristic(), t.misoriented_edges()), (1, 0));
        let border = t.border_loops();
        prop_assert_eq!(border.len(), 1);
        let mut ring: Vec<u32> = border[0].vertices.iter().map(|v| v.0).collect();
        let first = ring.iter().position(|&v| v == 0).unwrap();
        ring.rotate_left(first);
        prop_assert!(ring.into_iter().eq(0..p.len() as u32));
    }

    #[test]
    fn triangulating_a_mesh_keeps_the_rest(soup in either()) {
        let mesh = Mesh::build(soup.input(), &BuildOptions::default()).unwrap().0;
        let (count, groups, cuts) = (
            mesh.triangle_count(),
            mesh.face_groups().to_vec(),
            mesh.topology().faces().filter(|&f| mesh.topology().corner_range(f).len() > 3).count(),
        );
        let positions = mesh.positions().clone();
        let done = mesh.triangulate().unwrap();
        prop_assert_eq!(done.mesh.check(), Ok(()));
        prop_assert_eq!((done.mesh.face_count(), done.cut), (count, cuts));
        prop_assert!(done.mesh.topology().is_triangular());
        prop_assert_eq!(done.mesh.positions(), &positions);
        let same: Vec<u32> = (0..count as u32).collect();
        let map = done.face_map.unwrap_or(same);
        prop_assert!(map.is_sorted());
        prop_assert!(map.iter().map(|&f| groups[f as usize]).eq(done.mesh.face_groups().iter().copied()));
    }
}
