//! From the mesh of the last frame to that of this one.

use super::clock::{Clock, Judges};
use super::entry::Entry;
use super::refine::Open;
use super::survey::{Asked, LOT};
use super::{Lens, Split, View};
use std::borrow::Cow;

/// How far a frame may go.
#[derive(Clone, Copy)]
pub struct Limits<'a> {
    /// The mesh gets no more faces than this by splits (what a split depends on counted in), unless it had more before.
    pub faces: usize,
    /// Splits and undone splits, together, at most.
    pub operations: usize,
    /// Asked before the first and then after every 64 operations or 512 looks at a split; true ends the frame.
    pub expired: Option<&'a dyn Fn() -> bool>,
    /// A split that is not needed stays until it is not needed at this times the tolerance either; 1 for none, 0.7 to 0.9 lets a view that
    /// moves to and fro keep what it has. Above 0, at most 1.
    pub hysteresis: f64,
}

impl Default for Limits<'_> {
    /// None.
    fn default() -> Self {
        Limits { faces: usize::MAX, operations: usize::MAX, expired: None, hysteresis: 1.0 }
    }
}

/// What [`View::adapt`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Done {
    /// Splits applied.
    pub splits: usize,
    /// Splits undone.
    pub collapses: usize,
    /// Of the splits, those that were not needed themselves.
    pub forced: usize,
    /// Nothing was left to do: the mesh is the one the lens asks for.
    pub complete: bool,
    /// Splits that were needed and would have led beyond the limit of faces, or were left when there was no more room.
    pub refused: usize,
}

impl Done {
    /// Nothing to do: what sums begin with.
    pub const NOTHING: Done = Done { splits: 0, collapses: 0, forced: 0, complete: true, refused: 0 };
}

/// Of several meshes: complete if all are.
impl std::ops::AddAssign for Done {
    fn add_assign(&mut self, other: Done) {
        self.splits += other.splits;
        self.collapses += other.collapses;
        self.forced += other.forced;
        self.complete &= other.complete;
        self.refused += other.refused;
    }
}

/// What stands of all that was decided before.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stands {
    /// What is not due.
    All,
    /// Of that, what is too fine as long as lenses keep their distance.
    TooFine,
    Nothing,
}

/// Operations between two questions for the time.
const BETWEEN: usize = 64;
/// Looks at splits that count as many operations: a look takes about a tenth of an operation's time.
const LOOKS: usize = 512;
/// Needed splits that are found too large for the faces left, before a frame gives up: each takes a walk over what it depends on. With 64 the limit of 20,000 faces is used but for 5 at most on dragon.
const REFUSALS: usize = 64;

/// What is left of the limits.
pub(crate) struct Meter<'a> {
    pub(crate) limits: Limits<'a>,
    pub(crate) done: Done,
    pub(crate) since: usize,
    pub(crate) looks: usize,
    pub(crate) over: bool,
}

impl<'a> Meter<'a> {
    pub(crate) fn new(limits: &Limits<'a>) -> Self {
        Meter { limits: *limits, done: Done::default(), since: BETWEEN, looks: 0, over: false }
    }

    /// False when it is time to end.
    #[inline]
    pub(crate) fn goes_on(&mut self) -> bool {
        if self.done.splits + self.done.collapses >= self.limits.operations {
            self.over = true;
        }
        if self.since >= BETWEEN || self.looks >= LOOKS {
            (self.since, self.looks) = (0, 0);
            self.over |= self.limits.expired.is_some_and(|f| f());
        }
        !self.over
    }

    /// Room for faces.
    pub(super) fn room(&self, faces: usize) -> usize {
        self.limits.faces.saturating_sub(faces)
    }

    /// There is no more room for faces, or enough was tried that it is too little for.
    pub(crate) fn is_full(&self, faces: usize) -> bool {
        self.room(faces) == 0 || self.done.refused >= REFUSALS
    }
}

impl View {
    /// Adapts the mesh to a lens, as far as the limits allow: first undoes what is not needed, then applies what is, the worst first.
    ///
    /// O(valence) for every split applied or undone, looks at those vertices shown of which something may have changed since they were looked at last, and 1 ns or less for each of the
    /// others. A frame that a limit cut short is taken up by the next.
    pub fn adapt(&mut self, lens: &Lens, limits: &Limits<'_>) -> Done {
        self.adapt_to_all(std::slice::from_ref(lens), limits)
    }

    /// As [`View::adapt`], to several lenses: what any of them needs is needed. For a mesh that stands in several places. Without lenses nothing is needed.
    pub fn adapt_to_all(&mut self, lenses: &[Lens], limits: &Limits<'_>) -> Done {
        let mut meter = Meter::new(limits);
        let judges = Judges::new(lenses, limits.hysteresis);
        let nearer = self.standoff.follow(lenses);
        let stands = match self.clock.go_on(&judges) {
            true => Stands::All,
            false if nearer => Stands::Nothing,
            false => Stands::TooFine,
        };
        if nearer {
            self.front.look_at_what_was_too_fine(self.clock.now());
        }
        // First what a limit cut short: else coarsening would undo what is only there for the rest of it, frame after frame.
        if let Some(i) = self.unfinished.take()
            && !self.front.is_applied(i)
            && judges.want(&Entry::of(&self.hierarchy, i))
        {
            self.apply_with_all(&Split::new(i), &mut meter, &mut Vec::new());
        }
        // With what has just come.
        let due = self.take_due(stands);
        self.resume = 0;
        let needed = self.coarsen(&judges, &mut meter, due);
        if !meter.over {
            self.refine(&judges, &mut meter, needed);
        }
        self.front.settle();
        meter.done.complete = !meter.over && meter.done.refused == 0;
        meter.done
    }

    /// The records that are due, from where the last frame was cut short. Until they have been looked at they stay due.
    fn take_due(&mut self, stands: Stands) -> Vec<u32> {
        let mut due = match stands {
            Stands::All => self.come(),
            Stands::TooFine => {
                self.front.relied = true;
                self.all_but(|too_fine| too_fine)
            }
            Stands::Nothing => self.all_but(|_| 0),
        };
        let from = due.partition_point(|&r| r < self.resume);
        due.rotate_left(from);
        due
    }

    /// The records whose times have come.
    fn come(&mut self) -> Vec<u32> {
        let (now, late) = (self.clock.now(), self.clock.late());
        let mut due = Vec::new();
        let mut first = 0;
        for block in self.front.records.chunks_mut(16) {
            // Most are not: asked without a branch for each.
            if block.iter().fold(false, |any, r| any | Clock::has_come(now, r.due)) {
                for (k, r) in (first..).zip(block.iter_mut()) {
                    if r.is_free() {
                        r.due = late;
                    } else if Clock::has_come(now, r.due) {
                        r.due = now;
                        due.push(k);
                    }
                }
            }
            first += 16;
        }
        due
    }

    /// All records, but for those of 64 whose bits `stay` gives, if their times have not come; times tell nothing of those any more, and are set as late as can be.
    fn all_but(&mut self, stay: impl Fn(u64) -> u64) -> Vec<u32> {
        let now = self.clock.now();
        let mut due = vec![0; self.front.records.len()];
        let (mut first, mut n) = (0, 0);
        for (block, &too_fine) in self.front.records.chunks_mut(64).zip(&self.front.too_fine) {
            let stay = stay(too_fine);
            for (k, r) in (0u32..).zip(block.iter_mut()) {
                // Written whether it is or not, as a branch could not be foreseen.
                due[n] = first + k;
                let rest = r.is_free() | (stay >> k & 1 != 0) & !Clock::has_come(now, r.due);
                n += usize::from(!rest);
                r.due = if rest { self.clock.at_last(first + k) } else { now };
            }
            first += 64;
        }
        due.truncate(n);
        due
    }

    /// Looks at what is due and undoes what is not needed, until nothing is left that could be; returns what is needed of the splits that come next. What a limit cuts short stays due.
    fn coarsen(&mut self, judges: &Judges<'_>, meter: &mut Meter<'_>, due: Vec<u32>) -> Vec<Open> {
        // All at once, unless time may be over before.
        let each = if meter.limits.expired.is_some() { LOOKS / 2 } else { due.len().max(1) };
        let mut needed = Vec::new();
        for part in due.chunks(each) {
            if !meter.goes_on() {
                self.resume = part.first().copied().unwrap_or_default();
                break;
            }
            // Of parts before it may have been undone.
            let there: Cow<'_, [u32]> = match part.len() == due.len() {
                true => part.into(),
                false => {
                    part.iter().copied().filter(|&r| !self.front.records[r as usize].is_free()).collect()
                }
            };
            let survey = self.survey(&there, judges);
            meter.looks += survey.looks;
            let found = survey.slack.iter().zip(&survey.too_fine);
            for (&r, (&slack, &too_fine)) in there.iter().zip(found).filter(|s| *s.1.0 >= 0.0) {
                self.front.records[r as usize].due = self.clock.due(f64::from(slack), r);
                self.front.set_too_fine(r, too_fine);
            }
            self.undo_all(survey.unneeded, judges, meter);
            if meter.over {
                self.resume = part.first().copied().unwrap_or_default();
                break;
            }
            needed.extend(survey.needed);
        }
        needed
    }

    /// Undoes splits that can be undone and are not needed, and what becomes free by that and is not needed either.
    fn undo_all(&mut self, mut unneeded: Vec<u32>, judges: &Judges<'_>, meter: &mut Meter<'_>) {
        if unneeded.is_empty() {
            return;
        }
        let last = judges.last(&self.clock);
        let hierarchy = self.hierarchy.clone();
        let (mut freed, mut asked) = (Vec::new(), Asked::new(&hierarchy));
        while !unneeded.is_empty() {
            for lot in unneeded.chunks(LOT) {
                self.fetch_made(lot);
                for &i in lot {
                    if !meter.goes_on() {
                        return;
                    }
                    self.undo(i, &mut freed);
                    meter.done.collapses += 1;
                    meter.since += 1;
                }
            }
            unneeded.clear();
            meter.looks += freed.len();
            asked.unneeded(&freed, &last, &mut unneeded);
            freed.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aif::{BuildOptions, Mesh, MeshInput, Positions};
    use crate::hierarchy::{Hierarchy, Options};
    use crate::progressive::build;
    use crate::selective::Cull;
    use crate::simplify::{Options as Simplify, Quiet};
    use crate::view::{Camera, CameraParameters, Projection};
    use glam::{DMat4, DVec3};
    use progmesh_meshes::{GenerateOptions, generate};
    use std::sync::Arc;

    #[test]
    fn after_a_jump_that_keeps_its_distance_most_is_not_looked_at() {
        let s = generate("scan", &GenerateOptions::default().with_faces(4000)).unwrap();
        let input = MeshInput {
            positions: Positions::from_f64(s.positions),
            face_sizes: s.face_sizes,
            corners: s.corners,
            ..Default::default()
        };
        let mesh = Mesh::build(input, &BuildOptions::default()).unwrap().0;
        let pm = build(mesh, &Simplify::default(), &Quiet).unwrap().mesh;
        let h = Arc::new(Hierarchy::new(Arc::new(pm), &Options::default()).unwrap());
        let (centre, size) = h.extent();
        let lens = |side: DVec3, distance: f64| {
            let camera = Camera::new(&CameraParameters {
                eye: centre + distance * size * side,
                target: centre,
                up: DVec3::Y,
                projection: Projection::Perspective { fov_y_deg: 45.0 },
                width: 1280,
                height: 720,
                near: 1e-3 * size,
                far: 10.0 * size,
            });
            Lens::new(&h, &camera.unwrap(), &DMat4::IDENTITY, 3.0, Cull::All).unwrap()
        };
        let mut view = View::new(h.clone());
        // Twice, as what a frame makes the next one looks at.
        for _ in 0..2 {
            assert!(view.adapt(&lens(DVec3::Z, 1.0), &Limits::default()).complete);
        }
        let due = |view: &View, lens: Lens| {
            let mut view = view.clone();
            let nearer = view.standoff.follow(&[lens]);
            assert!(!view.clock.go_on(&Judges::new(&[lens], 1.0)));
            view.take_due(if nearer { Stands::Nothing } else { Stands::TooFine }).len()
        };
        let shown = view.vertex_count();
        let (kept, nearer) = (due(&view, lens(DVec3::X, 1.0)), due(&view, lens(DVec3::X, 0.96)));
        assert!(
            shown > 300 && kept > 0 && 2 * kept < shown && nearer == shown,
            "{kept}, {nearer} of {shown}"
        );
        // Then nearer: those that were left are looked at, though it is no jump.
        for _ in 0..2 {
            assert!(view.adapt(&lens(DVec3::X, 1.0), &Limits::default()).complete && view.front.relied);
        }
        let near = lens(DVec3::X, 0.95);
        assert!(view.standoff.follow(&[near]) && view.clock.go_on(&Judges::new(&[near], 1.0)));
        let before = view.come().len();
        view.front.look_at_what_was_too_fine(view.clock.now());
        assert!(before + view.vertex_count() / 3 < view.come().len() && !view.front.relied, "{before}");
    }
}
