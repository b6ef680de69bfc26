//! What is wrong with a mesh, or will surprise: for `progmesh info`.

use progmesh::aif::{BuildReport, KindCounts, Mesh, VertexKind};
use progmesh::pipeline::count;
use std::collections::HashSet;

/// Below this twice-area over squared longest edge, a face has no area to speak of: its normal is rounding.
const NO_AREA: f64 = 1e-12;

/// The problems of a mesh, the worst first. `report` is of its building.
pub(crate) fn find(mesh: &Mesh, kinds: &KindCounts, report: &BuildReport) -> Vec<String> {
    let mut found = broken_faces(report);
    let mut say = |n: usize, what: &str, text: &str, first: Option<String>| {
        if n > 0 {
            let first = first.map_or(String::new(), |f| format!(" (the first: {f})"));
            found.push(format!("{} {text}{first}", count(n, what)));
        }
    };
    let t = mesh.topology();
    let flat: Vec<_> = t.faces().filter(|&f| has_no_area(mesh, f)).collect();
    say(flat.len(), "face", "of no area", flat.first().map(|f| format!("face {f}")));

    let mut seen = HashSet::new();
    let twice: Vec<_> = t
        .faces()
        .filter(|&f| {
            let mut v: Vec<u32> = t.face_vertices(f).map(|v| v.0).collect();
            v.sort_unstable();
            !seen.insert(v)
        })
        .collect();
    say(
        twice.len(),
        "face",
        "with the vertices of an earlier face",
        twice.first().map(|f| format!("face {f}")),
    );

    let complex = t.edges().find(|&e| t.edge_faces(e).len() > 2);
    let between = complex.map(|e| {
        let [a, b] = t.edge_vertices(e);
        format!("between vertices {a} and {b}")
    });
    say(kinds.complex_edges, "edge", "of three and more faces: non-manifold", between);
    let first_of = |kind: VertexKind, n: usize| match n {
        0 => None,
        _ => {
            let k = t.classify_vertices();
            t.vertices().find(|v| k[v.index()] == kind).map(|v| format!("vertex {v}"))
        }
    };
    let cut = first_of(VertexKind::Cut, kinds.cut_vertices);
    say(kinds.cut_vertices, "vertex", "where pieces of surface touch in a point: non-manifold", cut);
    let orientable =
        if t.is_orientable() { "turning faces over would mend it" } else { "the surface is one-sided" };
    let text = format!("between faces of opposite orientation; {orientable}");
    say(t.misoriented_edges(), "edge", &text, None);
    let isolated = first_of(VertexKind::Isolated, kinds.isolated_vertices);
    say(kinds.isolated_vertices, "vertex", "of no face and no edge", isolated);

    // Borders where other vertices lie at the same place: the mesh is open only because it is not welded.
    if kinds.border_edges > 0 {
        let mut places = HashSet::with_capacity(mesh.vertex_count());
        let copies = t.vertices().filter(|v| !places.insert(mesh.positions().bits(v.index()))).count();
        say(copies, "vertex", "at the place of an earlier vertex: --weld makes one of them", None);
    }
    found
}

/// Faces that are no simple cycle of three and more vertices: an invariant of the mesh that the file breaks.
pub(crate) fn broken_faces(report: &BuildReport) -> Vec<String> {
    let lists = [
        (&report.dropped_faces, "with fewer than three distinct vertices"),
        (&report.shortened_faces, "with a vertex twice in a row"),
        (&report.split_faces, "that visit a vertex twice"),
    ];
    let say = |(faces, what): &(&Vec<u32>, &str)| {
        faces.first().map(|f| format!("{} {what} (the first: face {f})", count(faces.len(), "face")))
    };
    let mut found: Vec<String> = lists.iter().filter_map(say).collect();
    if report.dropped_wires > 0 {
        found.push(format!("{} with both ends in one vertex", count(report.dropped_wires, "line segment")));
    }
    found
}

/// Of an area that rounding could make.
fn has_no_area(mesh: &Mesh, f: progmesh::aif::FaceId) -> bool {
    let t = mesh.topology();
    let points: Vec<_> = t.face_vertices(f).map(|v| mesh.position(v)).collect();
    let longest =
        (0..points.len()).map(|i| points[i].distance(points[(i + 1) % points.len()])).fold(0.0f64, f64::max);
    // Not squared: a mesh scaled by 1e-200 has faces too.
    longest == 0.0 || mesh.face_normal(f).length() / longest <= NO_AREA * longest
}
