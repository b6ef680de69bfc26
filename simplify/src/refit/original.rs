//! The surface before the collapses.

use crate::work::Work;

/// Which vertices the triangles and the curves of the original join. Its positions stay in the mesh until the work is written back.
pub(crate) struct Original {
    /// Corners of the triangles, by vertex slot.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Borders and seams.
    pub(super) curves: Vec<Curve>,
}

/// An edge on a border or seam.
#[derive(Clone, Copy, Debug)]
pub(super) struct Curve {
    /// Vertex slots.
    pub(super) ends: [u32; 2],
    /// True for a border, false for a seam.
    pub(super) border: bool,
}

impl Original {
    /// To be called before the first collapse, which it prepares `work` to follow. 12 bytes a triangle.
    pub(crate) fn of(work: &mut Work<'_>) -> Self {
        work.into = (0..work.points.len() as u32).collect();
        let t = work.mesh.topology();
        let triangles = t.faces().map(|f| t.triangle(f).map(|v| v.0)).collect();
        let curve = |e| {
            let border = t.edge_faces(e).len() == 1;
            let ends = t.edge_vertices(e).map(|v| v.0);
            (border || work.seams.get(e.index())).then_some(Curve { ends, border })
        };
        Original { triangles, curves: t.edges().filter_map(curve).collect() }
    }

    pub(super) fn triangle_count(&self) -> usize {
        self.triangles.len()
    }
}
