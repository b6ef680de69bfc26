//! Simplifies any triangles over few vertices by any method and option: a finite mesh must come out, of the same Euler
//! characteristic if by collapses.
#![no_main]

use libfuzzer_sys::fuzz_target;
use progmesh::aif::{Mesh, Positions};
use progmesh::simplify::{MaxError, Method, Options, Placement, Quiet, Schedule, simplify};

fuzz_target!(|bytes: &[u8]| {
    let Some((&[way, target, bound, locks, vertices], rest)) = bytes.split_first_chunk::<5>() else { return };
    let n = 3 + vertices as usize % 61;
    if rest.len() < 3 * n {
        return;
    }
    let (places, faces) = rest.split_at(3 * n);
    let points = places.as_chunks::<3>().0.iter().map(|p| p.map(|x| x as f32 - 128.0)).collect();
    let corner = |x: &u8| *x as u32 % n as u32;
    let triangles: Vec<[u32; 3]> =
        faces.as_chunks::<3>().0.iter().map(|f| f.each_ref().map(corner)).collect();
    let Ok(mut mesh) = Mesh::from_triangles(Positions::F32(points), &triangles) else { return };
    let before = mesh.triangle_count();
    let euler = euler_characteristic(&mesh);

    let mut o = Options::default();
    o.method = [Method::Quadric, Method::Nsa, Method::Cluster][way as usize % 3];
    o.placement = [None, Some(Placement::Endpoint), Some(Placement::Midpoint), Some(Placement::Optimal)]
        [way as usize / 3 % 4];
    o.schedule = Some([Schedule::Exact, Schedule::Bulk][way as usize / 12 % 2]);
    (o.lock_border, o.keep_vertices) = (way / 24 % 2 == 1, way / 48 % 2 == 1);
    o.triangles = Some(target as usize);
    o.max_error = (bound > 0).then(|| MaxError { value: bound as f64 / 512.0, relative: true });
    (0..8).filter(|k| locks >> k & 1 == 1).for_each(|k| o.locked_vertices.set(k));
    let Ok(outcome) = simplify(&mut mesh, &o, &Quiet) else { return };
    assert_eq!(mesh.check(), Ok(()));
    assert!(mesh.triangle_count() <= before && outcome.triangles_out == mesh.triangle_count());
    assert!(mesh.positions().iter().all(|p| p.is_finite()) && outcome.estimate.is_finite());
    if o.method != Method::Cluster {
        assert_eq!(euler_characteristic(&mesh), euler);
    }
});

/// Without isolated vertices: those are left out, or, where all vertices stay, come to be.
fn euler_characteristic(mesh: &Mesh) -> i64 {
    let t = mesh.topology();
    t.vertices().filter(|&v| !t.star(v).is_empty()).count() as i64 - t.edge_count() as i64
        + t.face_count() as i64
}
