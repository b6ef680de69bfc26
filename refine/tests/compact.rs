//! What progressive meshes and hierarchies take in memory, with places on a grid and normals in few bits; and that nothing is lost by it.

mod common;

use common::sample;
use progmesh_refine::aif::*;
use progmesh_refine::format::suggested_grid;
use progmesh_refine::hierarchy::{Hierarchy, Options as HierarchyOptions};
use progmesh_refine::progressive::{Places, Values, build, same_positions};
use progmesh_refine::selective::{Cull, Lens, Limits, View};
use progmesh_refine::simplify::{Options, Placement, Quiet};
use progmesh_refine::view::{Camera, CameraParameters, Projection};
use progmesh_refine::{Cursor, ProgressiveMesh};
use std::sync::Arc;

/// A sample with a normal a vertex, the sum of the normals of its faces: of unit length, or as long as it comes out.
fn with_normals(name: &str, faces: usize, unit: bool) -> MeshInput {
    let plain = sample(name, faces, 5).to_input();
    let n = plain.positions.len();
    let mut sums = vec![glam::DVec3::ZERO; n];
    for f in plain.corners.chunks_exact(3) {
        let [a, b, c] = [0, 1, 2].map(|k| plain.positions.get(f[k] as usize));
        let normal = (b - a).cross(c - a);
        f.iter().for_each(|&v| sums[v as usize] += 1e6 * normal);
    }
    let mut wedges = Wedges::new(vec![Channel::new(Semantic::Normal, 3)]).unwrap();
    for s in sums {
        let s = if unit { s.normalize_or(glam::DVec3::X) } else { s };
        wedges.push(&s.as_vec3().to_array(), 1);
    }
    wedges.corner = plain.corners.clone();
    let input = MeshInput {
        positions: plain.positions,
        corners: plain.corners,
        wedges: Some(wedges),
        ..Default::default()
    };
    // Numbered as meshes number them.
    Mesh::build(input, &BuildOptions::default()).unwrap().0.to_input()
}

fn recorded(input: &MeshInput, placement: Placement) -> ProgressiveMesh {
    let mesh = Mesh::build(input.clone(), &BuildOptions::default()).unwrap().0;
    let mut options = Options::default();
    options.placement = Some(placement);
    if placement == Placement::Optimal {
        options.grid = suggested_grid(&input.positions);
    }
    build(mesh, &options, &Quiet).unwrap().mesh
}

fn bits(w: &Wedges) -> (Vec<u32>, Vec<Vec<u32>>) {
    let row = |w: &Wedges, k: u32| w.row(k).iter().map(|x| x.to_bits()).collect();
    (w.corner.clone(), (0..w.len() as u32).map(|k| row(w, k)).collect())
}

fn assert_same(a: &MeshInput, b: &MeshInput) {
    assert!(same_positions(&a.positions, &b.positions) && a.corners == b.corners);
    assert!(a.wedges.as_ref().map(bits) == b.wedges.as_ref().map(bits));
}

/// The same with its arrays as they are without packing.
fn unpacked(pm: &ProgressiveMesh) -> ProgressiveMesh {
    let mut pm = pm.clone();
    pm.new_positions = Places::from(pm.new_positions.plain().clone());
    pm.moved_positions = Places::from(pm.moved_positions.plain().clone());
    if let Some(w) = &mut pm.wedges {
        w.rows = Values::from(w.rows.plain().clone());
    }
    pm
}

#[test]
fn a_vertex_with_its_normal_takes_at_most_64_bytes() {
    for (name, faces, unit) in [("torus", 4000, true), ("scan", 5000, true), ("torus", 4000, false)] {
        let input = with_normals(name, faces, unit);
        for (placement, least) in [(Placement::Optimal, 24.0), (Placement::Endpoint, 24.0)] {
            let pm = recorded(&input, placement);
            let n = pm.vertices() as f64;
            let normals = pm.attribute_bytes() as f64 / n;
            // Full detail alone is a place and a normal: 24 B, or 21 of unit length.
            assert!(normals >= if unit { 9.0 } else { 12.0 }, "{normals}");
            let flat = pm.bytes() as f64 / n;
            let order = pm.order.as_ref().unwrap().bytes();
            let h = Hierarchy::new(Arc::new(pm), &HierarchyOptions::RINGS).unwrap();
            let all = h.bytes() as f64 / n;
            assert!(flat >= least + 14.0 && flat <= 64.0, "{name} {unit} {placement:?}: {flat}");
            assert!(all >= least + 20.0 && all <= 64.0, "{name} {unit} {placement:?}: {all}");
            // Nothing is left out: what is there without the order is less than what the arrays sum up to.
            assert_eq!(h.mesh().order.as_ref().unwrap().bytes(), order);
            assert!(
                h.mesh().splits.error.is_empty() && h.bytes() > h.mesh().bytes() + h.all_bounds().bytes()
            );
        }
    }
}

#[test]
fn packed_arrays_say_what_plain_ones_say() {
    let input = with_normals("scan", 3000, true);
    let pm = recorded(&input, Placement::Optimal);
    let plain = unpacked(&pm);
    assert!(pm == plain && 10 * pm.bytes() < 9 * plain.bytes(), "{} {}", pm.bytes(), plain.bytes());
    let (mut a, mut b) = (pm.cursor().unwrap(), plain.cursor().unwrap());
    for to in [40, 900, 300, usize::MAX, 0, 1200, usize::MAX] {
        a.seek(to).unwrap();
        b.seek(to).unwrap();
        assert_same(&a.to_input(), &b.to_input());
    }
    assert_same(&a.to_ordered_input(), &input);
    a.seek(0).unwrap();
    assert_same(&a.to_input(), &pm.cursor().unwrap().to_input());
    // In any order, and packed again.
    let order = pm.by_error();
    let mut again = pm.reordered(&order).unwrap();
    assert_eq!(again, plain.reordered(&order).unwrap());
    again.pack();
    assert_eq!(again, plain.reordered(&order).unwrap());
}

/// The angle between the normals of a wedge and of its faces there is about what it was with normals as the method gave them.
#[test]
fn normals_between_base_and_full_detail_are_the_methods_but_for_a_quarter_of_a_degree() {
    let input = with_normals("torus", 4000, true);
    let mesh = || Mesh::build(input.clone(), &BuildOptions::default()).unwrap().0;
    let mut options = Options::default();
    options.grid = Some((-14f64).exp2());
    let coarse = build(mesh(), &options, &Quiet).unwrap().mesh;
    // A grid that changes nothing, and no coarser normals.
    options.grid = None;
    let fine = build(mesh(), &options, &Quiet).unwrap().mesh;
    let at = |pm: &ProgressiveMesh, splits: usize| -> Vec<(glam::DVec3, glam::DVec3)> {
        let mut c = Cursor::new(pm).unwrap();
        c.seek(splits).unwrap();
        let of = |w: u32| {
            let n = c.row(w);
            let place = c.positions().get(c.wedge_vertex(w) as usize);
            (place, glam::DVec3::new(n[0] as f64, n[1] as f64, n[2] as f64))
        };
        (0..c.wedge_count() as u32).map(of).collect()
    };
    // Torus of radii 1 and 0.4: its normals are known everywhere.
    let off = |pm: &ProgressiveMesh| {
        let mut all: Vec<f64> = at(pm, pm.splits.len() / 2)
            .iter()
            .map(|&(p, n)| {
                assert!((n.length() - 1.0).abs() < 1e-6);
                let ring = glam::DVec3::new(p.x, p.y, 0.0).normalize_or_zero();
                let other = glam::DVec3::new(p.x, 0.0, p.z).normalize_or_zero();
                let known = [ring, other].map(|r| (p - r).normalize_or_zero().angle_between(n));
                known[0].min(known[1]).to_degrees()
            })
            .collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    let (a, b) = (off(&coarse), off(&fine));
    assert!(a < b + 0.25, "{a} {b}");
    // Far fewer directions than normals.
    let bits = |pm: &ProgressiveMesh| pm.attribute_bytes();
    assert!(10 * bits(&coarse) < 8 * bits(&fine), "{} {}", bits(&coarse), bits(&fine));
}

#[test]
fn views_of_packed_and_plain_meshes_are_the_same() {
    let input = with_normals("scan", 3000, false);
    let pm = recorded(&input, Placement::Optimal);
    // One that others hold as well is not packed.
    let shared = Arc::new(unpacked(&pm));
    let plain = Arc::new(Hierarchy::new(shared.clone(), &HierarchyOptions::CUTS).unwrap());
    let packed = Arc::new(Hierarchy::new(Arc::new(pm), &HierarchyOptions::CUTS).unwrap());
    assert!(!plain.mesh().splits.error.is_empty() && packed.mesh().splits.error.is_empty());
    assert!(packed.bytes() < plain.bytes());
    let (centre, diagonal) = packed.extent();
    let eye = centre + glam::DVec3::new(0.2, 0.3, 1.0).normalize() * diagonal;
    let camera = Camera::new(&CameraParameters {
        eye,
        target: centre,
        up: glam::DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: 45.0 },
        width: 800,
        height: 600,
        near: 0.01 * diagonal,
        far: 10.0 * diagonal,
    })
    .unwrap();
    let views = [packed, plain].map(|h| {
        let lens = Lens::new(&h, &camera, &glam::DMat4::IDENTITY, 2.0, Cull::All).unwrap();
        let mut view = View::new(h);
        view.adapt(&lens, &Limits::default());
        view
    });
    assert!(views[0].face_count() > 100);
    assert_same(&views[0].to_input(), &views[1].to_input());
}
