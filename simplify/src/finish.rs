//! What a method leaves behind becomes the result: a compact mesh, and what there is to say about it.

use crate::options::{Level, Options, Outcome, Stop};
use progmesh_aif::{BuildOptions, CompactOptions, Mesh, NONE};

/// The triangles at which to stop, of `total`: the first target that is reached, so the larger; 0 without one.
pub(crate) fn target(options: &Options, total: usize) -> usize {
    let by_ratio = options.ratio.map(|r| (r * total as f64).round() as usize);
    options.triangles.into_iter().chain(by_ratio).max().unwrap_or(0)
}

/// What is to be known of a mesh before it is simplified.
pub(crate) struct Before {
    faces: usize,
    pub(crate) triangles: usize,
    aif_bytes: usize,
}

impl Before {
    pub(crate) fn of(mesh: &Mesh) -> Self {
        Before {
            faces: mesh.face_count(),
            triangles: mesh.triangle_count(),
            aif_bytes: mesh.topology().relation_bytes(),
        }
    }
}

/// Leaves out what is gone, and vertices without an edge; all vertices stay if they are to be kept.
pub(crate) fn finish(
    mesh: &mut Mesh,
    before: &Before,
    options: &Options,
    (stop, estimate, levels): (Stop, f64, Vec<Level>),
) -> Outcome {
    let mut outcome = Outcome {
        faces_in: before.faces,
        faces_out: 0,
        triangles_out: 0,
        vertices_out: 0,
        stop,
        estimate,
        levels,
        triangulated: 0,
        isolated_removed: 0,
        aif_bytes: before.aif_bytes,
        vertex_origin: Vec::new(),
    };
    let taken = std::mem::take(mesh);
    if options.keep_vertices {
        *mesh = with_all_vertices(taken);
    } else {
        let t = taken.topology();
        outcome.isolated_removed = t.vertices().filter(|&v| t.star(v).is_empty()).count();
        let (compact, maps) = taken.compact(CompactOptions::with_drop_isolated(true));
        if maps.vertex.contains(&NONE) {
            outcome.vertex_origin =
                (0..maps.vertex.len() as u32).filter(|&v| maps.vertex[v as usize] != NONE).collect();
        }
        *mesh = compact;
    }
    outcome.faces_out = mesh.face_count();
    outcome.triangles_out = mesh.triangle_count();
    outcome.vertices_out = mesh.vertex_count();
    outcome
}

/// The same faces and wires on all vertices there ever were, under their old ids.
fn with_all_vertices(mesh: Mesh) -> Mesh {
    let positions = mesh.positions().clone();
    let (mut input, map) = mesh.to_input_with_map();
    let mut old = vec![0; input.positions.len()];
    for (v, &new) in map.iter().enumerate().filter(|(_, new)| **new != NONE) {
        old[new as usize] = v as u32;
    }
    for v in input.corners.iter_mut().chain(input.wires.as_flattened_mut()) {
        *v = old[*v as usize];
    }
    input.positions = positions;
    // A part of a mesh builds, so this does; if it did not, the mesh as it is would be the next best.
    Mesh::build(input, &BuildOptions::default()).map_or(mesh, |b| b.0)
}
