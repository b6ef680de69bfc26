//! A view that holds the whole mesh beside the uniform levels of the same progressive mesh: at equal measured error it takes at most twice their faces.

mod common;

use common::{Random, any_camera, progressive};
use glam::{DMat4, DVec3};
use progmesh_refine::aif::MeshInput;
use progmesh_refine::hierarchy::{Hierarchy, Options};
use progmesh_refine::selective::{Cull, Lens, Limits, View};
use progmesh_refine::simplify::Method;
use progmesh_refine::simplify::measure::Surface;
use progmesh_refine::view::Projection;
use std::sync::Arc;

/// Places on the finest mesh, by area.
fn samples(mesh: &MeshInput, count: usize) -> Vec<DVec3> {
    let corner = |v: &u32| mesh.positions.get(*v as usize);
    let faces: Vec<[DVec3; 3]> =
        mesh.corners.chunks_exact(3).map(|c| [corner(&c[0]), corner(&c[1]), corner(&c[2])]).collect();
    let mut sum = 0.0;
    let areas: Vec<f64> = faces
        .iter()
        .map(|t| {
            sum += (t[1] - t[0]).cross(t[2] - t[0]).length();
            sum
        })
        .collect();
    let mut random = Random(3);
    let each = |_| {
        let x = random.unit() * sum;
        let t = faces[areas.partition_point(|&a| a < x).min(faces.len() - 1)];
        let (u, v) = (random.unit().sqrt(), random.unit());
        t[0] * (1.0 - u) + t[1] * (u * (1.0 - v)) + t[2] * (u * v)
    };
    (0..count).map(each).collect()
}

/// The largest distance from the samples to a mesh.
fn error(mesh: &MeshInput, samples: &[DVec3]) -> f64 {
    let triangles: Vec<[u32; 3]> = mesh.corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    let surface = Surface::new(&mesh.positions, &triangles).unwrap();
    let mut query = surface.query();
    samples.iter().map(|&p| query.distance(p)).fold(0.0, f64::max)
}

#[test]
fn the_whole_mesh_in_view_takes_at_most_twice_the_faces_of_a_uniform_level() {
    for name in ["scan", "torus", "terrain"] {
        let pm = progressive(name, 4000, Method::Quadric, None);
        let h = Arc::new(Hierarchy::new(Arc::new(pm.clone()), &Options::RINGS).unwrap());
        let mut cursor = pm.cursor().unwrap();
        cursor.seek(usize::MAX).unwrap();
        let samples = samples(&cursor.to_input(), 5000);
        // 400 pixels to the diagonal; nothing is nearer than anything else.
        let height = 1.2 * h.extent().1;
        let camera = any_camera(&h, &mut Random(7), 2.0, Projection::Orthographic { ortho_height: height });
        let mut compared = 0;
        for tau in [1.5, 4.0] {
            let lens = Lens::new(&h, &camera, &DMat4::IDENTITY, tau, Cull::None).unwrap();
            let mut view = View::new(h.clone());
            view.adapt(&lens, &Limits::default());
            let shown = error(&view.to_input(), &samples);
            // The coarsest of the levels, 5 % apart, that is no farther off.
            let mut faces = pm.base_faces.len().max(8);
            let level = loop {
                cursor.seek_faces(faces).unwrap();
                if cursor.face_count() >= pm.faces() || error(&cursor.to_input(), &samples) <= shown {
                    break cursor.face_count();
                }
                faces = faces * 21 / 20 + 1;
            };
            assert!(view.face_count() <= 2 * level, "{name} at {tau}: {} and {level}", view.face_count());
            compared += (level < pm.faces()) as usize;
        }
        assert!(compared > 0, "{name}");
    }
}
