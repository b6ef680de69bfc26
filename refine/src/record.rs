//! A mesh with the record of its simplification: one mesh in memory, at any of its levels.

use crate::aif::{Collapse, EdgeId, LinkViolation, Marks, Mesh, VertexId, Wedges};
use crate::simplify::nsa::{self, Recorder, Step};
use crate::simplify::{Control, Level, Options, SimplifyError, Stop};
use glam::DVec3;

/// A level of detail.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct HistoryLevel {
    /// Collapses that lead here from full detail.
    pub steps: usize,
    /// Faces here.
    pub faces: usize,
    /// Seconds that making it took.
    pub seconds: f64,
}

/// A mesh, and every collapse that was made of it, in order.
///
/// The mesh stands after the first [`History::position`] of them; those before can be undone, those after redone. Ids are those of the
/// input all the time: removed elements stay in place. What a collapse overwrote (the kept vertex's position, wedges) is held in its
/// record while the mesh is coarse, and what the collapse wrote while it is fine: the two are exchanged.
#[derive(Clone, Debug)]
pub struct History {
    mesh: Mesh,
    steps: Vec<Collapse>,
    position: usize,
    levels: Vec<HistoryLevel>,
    attributes: Journal,
    /// The wedges at full detail, where they differ from those that the collapses work on.
    input_wedges: Option<Wedges>,
    stop: Stop,
}

/// What collapses overwrote in the wedges: flat, with an entry a step only if the mesh has wedges.
#[derive(Clone, Debug, Default)]
struct Journal {
    /// Ends of every step's runs in `corners` and `rows`.
    ends: Vec<(u32, u32)>,
    /// Corner slot and the other wedge it has.
    corners: Vec<(u32, u32)>,
    /// Wedge and the other channels it has.
    rows: Vec<(u32, u64)>,
    /// The other values of `rows`, row after row.
    values: Vec<f32>,
}

impl History {
    /// A mesh without a record: full detail is its only level.
    pub fn new(mesh: Mesh) -> Self {
        let full = HistoryLevel { steps: 0, faces: mesh.face_count(), seconds: 0.0 };
        History {
            mesh,
            steps: Vec::new(),
            position: 0,
            levels: vec![full],
            attributes: Journal::default(),
            input_wedges: None,
            stop: Stop::NoLegalCollapse,
        }
    }

    /// Simplifies by NSA ([`nsa::run`]) and records every pass as a level. The mesh is left at the coarsest.
    ///
    /// Errors: an option out of its range.
    pub fn nsa(mesh: Mesh, options: &Options, control: &dyn Control) -> Result<Self, SimplifyError> {
        let mut history = History::new(mesh);
        let mut mesh = std::mem::take(&mut history.mesh);
        history.input_wedges = mesh.wedges().cloned();
        let run = nsa::run(&mut mesh, options, &mut history, control)?;
        history.stop = run.stop;
        history.mesh = mesh;
        Ok(history)
    }

    /// The mesh, at the present step. Removed elements are skipped by its iterators; [`Mesh::to_input`] leaves them out.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The mesh at the present step; the record is lost.
    pub fn into_mesh(self) -> Mesh {
        self.mesh
    }

    /// Why the simplification that was recorded ended.
    pub fn stop(&self) -> Stop {
        self.stop
    }

    /// The levels, from full detail (always the first) to the coarsest.
    pub fn levels(&self) -> &[HistoryLevel] {
        &self.levels
    }

    /// All collapses there are.
    pub fn steps(&self) -> usize {
        self.steps.len()
    }

    /// Collapses the mesh stands after.
    pub fn position(&self) -> usize {
        self.position
    }

    /// The level the mesh stands at or is on the way to: the finest with no fewer steps than the present.
    pub fn level(&self) -> usize {
        self.levels.partition_point(|l| l.steps < self.position).min(self.levels.len() - 1)
    }

    /// One level coarser; false at the coarsest.
    pub fn coarsen(&mut self) -> bool {
        match self.levels.iter().find(|l| l.steps > self.position).map(|l| l.steps) {
            Some(to) => self.set_position(to),
            None => return false,
        }
        true
    }

    /// One level finer; false at full detail.
    pub fn refine(&mut self) -> bool {
        match self.levels.iter().rfind(|l| l.steps < self.position).map(|l| l.steps) {
            Some(to) => self.set_position(to),
            None => return false,
        }
        true
    }

    /// To this level; 0 is full detail, and the coarsest stands for all beyond it.
    pub fn set_level(&mut self, level: usize) {
        let level = level.min(self.levels.len() - 1);
        self.set_position(self.levels[level].steps);
    }

    /// To the state after this many collapses, or after all if there are fewer. O(valence) for each on the way.
    pub fn set_position(&mut self, position: usize) {
        let position = position.min(self.steps.len());
        while self.position > position {
            self.undo();
        }
        while self.position < position {
            self.redo();
        }
    }

    /// To the finest state of at most this many faces, or the coarsest there is.
    pub fn set_faces(&mut self, faces: usize) {
        // A collapse never adds a face, so the count falls with the steps.
        while self.position > 0 && self.mesh.face_count() <= faces {
            self.undo();
        }
        while self.mesh.face_count() > faces && self.position < self.steps.len() {
            self.redo();
        }
    }

    /// Collapses edge `e` onto its vertex `kept`, which moves to `to`, and records it; collapses that had been undone are forgotten. Wedges
    /// stay as they are. The state is no level until [`History::mark_level`] is called.
    ///
    /// Errors: what the link condition forbids; nothing has happened then.
    pub fn collapse(
        &mut self,
        e: EdgeId,
        kept: VertexId,
        to: DVec3,
        marks: &mut Marks,
    ) -> Result<(), LinkViolation> {
        let collapse = self.mesh.collapse_edge(e, kept, to, marks)?;
        self.forget_undone();
        self.push(&Step { collapse, corners: &[], rows: &[], values: &[] });
        Ok(())
    }

    /// Makes the present state a level, if it is none; collapses that had been undone are forgotten.
    pub fn mark_level(&mut self) {
        self.forget_undone();
        if self.levels.iter().all(|l| l.steps != self.position) {
            let faces = self.mesh.face_count();
            self.levels.push(HistoryLevel { steps: self.position, faces, seconds: 0.0 });
        }
    }

    /// Bytes of the record, the mesh left out.
    pub fn record_bytes(&self) -> usize {
        let j = &self.attributes;
        size_of::<Collapse>() * self.steps.len()
            + 8 * (j.ends.len() + j.corners.len())
            + size_of::<(u32, u64)>() * j.rows.len()
            + 4 * j.values.len()
            + self.input_wedges.as_ref().map_or(0, Wedges::bytes)
    }

    fn forget_undone(&mut self) {
        if self.position == 0 {
            self.input_wedges = None;
        }
        self.steps.truncate(self.position);
        self.levels.retain(|l| l.steps <= self.position);
        let stride = self.mesh.wedges().map_or(0, Wedges::stride);
        self.attributes.truncate(self.position, stride);
    }

    fn push(&mut self, step: &Step<'_>) {
        let j = &mut self.attributes;
        // Steps before the first with attributes have none.
        if !j.ends.is_empty() || !step.corners.is_empty() || !step.rows.is_empty() {
            j.ends.resize(self.steps.len(), (0, 0));
            j.corners.extend_from_slice(step.corners);
            j.rows.extend_from_slice(step.rows);
            j.values.extend_from_slice(step.values);
            j.ends.push((j.corners.len() as u32, j.rows.len() as u32));
        }
        self.steps.push(step.collapse);
        self.position = self.steps.len();
    }

    fn undo(&mut self) {
        self.position -= 1;
        let step = &mut self.steps[self.position];
        let coarse = self.mesh.position(step.record.kept);
        self.mesh.split_vertex(step);
        step.old_position = coarse;
        self.attributes.exchange(&mut self.mesh, self.position);
        if self.position == 0 {
            self.exchange_wedges();
        }
    }

    fn redo(&mut self) {
        if self.position == 0 {
            self.exchange_wedges();
        }
        self.attributes.exchange(&mut self.mesh, self.position);
        let step = &mut self.steps[self.position];
        let kept = step.record.kept;
        let fine = self.mesh.position(kept);
        self.mesh.collapse_unchecked(step.record.edge, kept);
        self.mesh.positions_mut().set(kept.index(), step.old_position);
        step.old_position = fine;
        self.position += 1;
    }

    /// At full detail the wedges are the input's, elsewhere those that collapses work on.
    fn exchange_wedges(&mut self) {
        if self.input_wedges.is_some() {
            std::mem::swap(self.mesh.wedges_mut(), &mut self.input_wedges);
        }
    }
}

impl Journal {
    /// The run of step `i` in `corners` and in `rows`.
    fn runs(&self, i: usize) -> Option<(std::ops::Range<usize>, std::ops::Range<usize>)> {
        let &(corners, rows) = self.ends.get(i)?;
        let start = if i == 0 { (0, 0) } else { self.ends[i - 1] };
        Some((start.0 as usize..corners as usize, start.1 as usize..rows as usize))
    }

    /// Exchanges what step `i` overwrote in the wedges with what is there.
    fn exchange(&mut self, mesh: &mut Mesh, i: usize) {
        let Some((corners, rows)) = self.runs(i) else { return };
        let Some(wedges) = mesh.wedges_mut() else { return };
        for (slot, wedge) in &mut self.corners[corners] {
            std::mem::swap(&mut wedges.corner[*slot as usize], wedge);
        }
        let stride = wedges.stride();
        for r in rows {
            let (wedge, present) = &mut self.rows[r];
            let now = wedges.present(*wedge);
            wedges.set_present(*wedge, *present);
            *present = now;
            wedges.row_mut(*wedge).swap_with_slice(&mut self.values[r * stride..(r + 1) * stride]);
        }
    }

    fn truncate(&mut self, steps: usize, stride: usize) {
        self.ends.truncate(steps);
        let (corners, rows) = self.ends.last().copied().unwrap_or((0, 0));
        self.corners.truncate(corners as usize);
        self.rows.truncate(rows as usize);
        self.values.truncate(rows as usize * stride);
    }
}

impl Recorder for History {
    fn begin(&mut self, mesh: &Mesh) {
        if self.input_wedges.as_ref() == mesh.wedges() {
            self.input_wedges = None;
        }
    }

    fn step(&mut self, step: &Step<'_>) {
        self.push(step);
    }

    fn level(&mut self, level: &Level) {
        self.levels.push(HistoryLevel {
            steps: self.steps.len(),
            faces: level.faces,
            seconds: level.seconds,
        });
    }
}
