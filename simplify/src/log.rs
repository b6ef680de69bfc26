//! A simplification that remembers its collapses: what a progressive mesh (Hoppe 1996) is made of.

use crate::finish::target;
use crate::options::{Control, Level, Method, Options, SimplifyError, Stop};
use crate::{nsa, quadric_collapse};
use glam::DVec3;
use progmesh_aif::{CollapseRecord, EdgeId, EdgeUse, FaceId, Mesh, NONE, Topology, VertexId};

/// A triangle that a collapse removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoggedWing {
    /// The triangle; [`NONE`] where the collapsed edge had none.
    pub face: u32,
    /// The face across its side at the kept vertex, and which edge of it that is: `face * 4 + edge`. [`NONE`] where there is none, or where
    /// three and more faces meet at that side.
    pub kept_half: u32,
    /// The same across its side at the removed vertex.
    pub removed_half: u32,
    /// Which edge of the triangle was collapsed, 0..3.
    pub slot: u8,
    /// The triangle runs along that edge from the kept vertex to the removed one.
    pub kept_first: bool,
    /// The face of `kept_half` begins that edge at the kept vertex.
    pub kept_half_starts: bool,
    /// The face of `removed_half` begins that edge at the (then) removed vertex.
    pub removed_half_starts: bool,
}

impl LoggedWing {
    const NO: LoggedWing = LoggedWing {
        face: NONE,
        kept_half: NONE,
        removed_half: NONE,
        slot: 0,
        kept_first: false,
        kept_half_starts: false,
        removed_half_starts: false,
    };
}

/// A collapse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoggedCollapse {
    /// The vertex that stayed.
    pub kept: u32,
    /// The vertex that went.
    pub removed: u32,
    /// The triangles on the edge; the second has no face at a border.
    pub wings: [LoggedWing; 2],
    /// Where the kept vertex was, model units, not yet rounded to the stored precision.
    pub old_position: DVec3,
    /// The method's estimate of the error here, model units.
    pub error: f32,
    /// Triangles that were left over all meshes of the run before this collapse: orders the collapses of several meshes.
    pub left: u32,
}

/// The collapses of a mesh, in order.
///
/// A removed vertex keeps the position and the wedges it had when it went; with this log, every state before can be told.
#[derive(Clone, Debug, Default)]
pub struct CollapseLog {
    /// One entry a collapse.
    pub steps: Vec<LoggedCollapse>,
    /// Ends of every step's runs in `corners` and `rows`; empty without wedges.
    pub ends: Vec<(u32, u32)>,
    /// Corner slots of the removed vertex on the faces that stay, and the wedges they had. Those of the triangles that go keep theirs.
    pub corners: Vec<(u32, u32)>,
    /// Wedges of the kept vertex that got other values, and the channels they had.
    pub rows: Vec<(u32, u64)>,
    /// The values they had, row after row.
    pub values: Vec<f32>,
}

/// What [`record_all`] says of a mesh.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Recorded {
    /// Its collapses.
    pub log: CollapseLog,
    /// Estimated error, model units.
    pub estimate: f64,
    /// NSA: the passes that made collapses. Quadric: the whole run.
    pub levels: Vec<Level>,
}

/// As [`crate::simplify_all`], by edge collapse, with every collapse remembered. The meshes are not compacted: removed elements stay
/// in place as they were when they went, vertices without an edge stay.
///
/// Errors: an option out of its range, pruning, clustering (which is no sequence of collapses), a mesh with other faces than triangles (cut
/// them first: [`Mesh::triangulate`]). Nothing has happened to the meshes then. Panics if `scales` has another length than `meshes`.
pub fn record_all(
    meshes: &mut [Mesh],
    scales: &[f64],
    options: &Options,
    control: &dyn Control,
) -> Result<(Stop, Vec<Recorded>), SimplifyError> {
    assert_eq!(meshes.len(), scales.len(), "one scale for each mesh");
    crate::validate(options)?;
    meshes.iter().try_for_each(|m| crate::work::check_weights(m, options))?;
    if options.prune.is_some() {
        return Err(SimplifyError::NotRecorded("removing small components"));
    }
    if meshes.iter().any(|m| !m.topology().is_triangular()) {
        return Err(SimplifyError::NotRecorded("collapsing edges of polygons"));
    }
    match options.method {
        Method::Quadric => quadric_collapse::record_all(meshes, scales, options, control),
        Method::Nsa => {
            let goal = target(options, meshes.iter().map(Mesh::triangle_count).sum());
            nsa::record_all(meshes, scales, options, goal, control)
        }
        Method::Cluster => Err(SimplifyError::NotRecorded("vertex clustering")),
    }
}

impl CollapseLog {
    /// Room for the collapses of a mesh of so many vertices, at most.
    pub(crate) fn for_vertices(vertices: usize) -> CollapseLog {
        CollapseLog { steps: Vec::with_capacity(vertices), ..CollapseLog::default() }
    }

    /// Where merging wedges writes down what it overwrites; [`CollapseLog::end_run`] ends it.
    pub(crate) fn notes(&mut self) -> Notes<'_> {
        Notes { corners: &mut self.corners, rows: &mut self.rows, values: &mut self.values }
    }

    /// Ends the run of the collapse at hand.
    #[inline]
    pub(crate) fn end_run(&mut self) {
        self.ends.push((self.corners.len() as u32, self.rows.len() as u32));
    }

    /// Adds a collapse that has just been made of `t`.
    pub(crate) fn push(
        &mut self,
        t: &Topology,
        record: &CollapseRecord,
        old_position: DVec3,
        error: f32,
        left: usize,
    ) {
        let mut given = record.wings();
        let mut look = || match given.next() {
            Some(wing) => look_at_wing(t, wing, record.kept, record.edge),
            None => LoggedWing::NO,
        };
        let wings = [look(), look()];
        let (kept, removed) = (record.kept.0, record.removed.0);
        self.steps.push(LoggedCollapse { kept, removed, wings, old_position, error, left: left as u32 });
    }
}

/// The faces across the sides of a removed triangle, which share one edge now.
#[inline]
fn look_at_wing(t: &Topology, wing: &progmesh_aif::Wing, kept: VertexId, edge: EdgeId) -> LoggedWing {
    let [first, _] = t.edge_vertices(wing.kept_edge);
    let leaving = EdgeUse::new(wing.kept_edge, first != kept);
    let half = |g: FaceId| {
        // A triangle: only those are recorded.
        let [a, b, c] = *t.face_edges(g) else { return (NONE, false) };
        let (i, used) = match () {
            _ if a.edge() == wing.kept_edge => (0, a),
            _ if b.edge() == wing.kept_edge => (1, b),
            _ => (2, c),
        };
        (g.0 * 4 + i, used == leaving)
    };
    let nothing = (NONE, false);
    // What is gone keeps its relations: the merged edge still names the face it lost.
    let beyond = match *t.edge_faces(wing.removed_edge) {
        [f] if f == wing.face => None,
        [f, ..] if f != wing.face => Some(f),
        [_, ref rest @ ..] => rest.iter().copied().find(|&g| g != wing.face),
        [] => None,
    };
    let beside = match *t.edge_faces(wing.kept_edge) {
        [f] | [f, _] if Some(f) != beyond => half(f),
        [_, g] => half(g),
        _ => nothing,
    };
    let beyond = beyond.map_or(nothing, half);
    let slot = wing.slot as usize;
    let run = t.face_edges(wing.face)[slot];
    debug_assert_eq!(run.edge(), edge);
    LoggedWing {
        face: wing.face.0,
        kept_half: beside.0,
        removed_half: beyond.0,
        slot: slot as u8,
        kept_first: t.origin(run) == kept,
        kept_half_starts: beside.1,
        removed_half_starts: beyond.1,
    }
}

/// Where merging wedges writes down what it overwrites.
pub(crate) struct Notes<'a> {
    /// Corner slots, and the wedges they had; also those that keep theirs.
    pub(crate) corners: &'a mut Vec<(u32, u32)>,
    /// Wedges, and the channels they had.
    pub(crate) rows: &'a mut Vec<(u32, u64)>,
    /// The values they had, row after row.
    pub(crate) values: &'a mut Vec<f32>,
}
