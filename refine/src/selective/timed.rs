//! Geomorphs by time: a view that follows another, its vertices moving for a number of frames (Hoppe 1997).

use super::cut::Cut;
use super::entry::Entry;
use super::motions::{Motions, Stage};
use super::timed_rows::RowMotions;
use super::{Followed, Lens, Split, View};
use crate::aif::{MeshInput, NONE};
use glam::DVec3;
use std::convert::Infallible;

/// What is drawn while a view (the *leader*) changes: every vertex moves to its new place in equal steps over a number of frames.
///
/// New vertices begin where their ancestors are drawn. What the leader has undone stays until its vertices have moved to where their ancestor stands in the
/// leader, and is undone then, when it cannot be seen. Changes that no lens sees are made at once. So with 1 frame, or [`TimedMorph::frames`] frames after
/// the leader came to rest, what is drawn is the leader's mesh, with its vertices in its places bit for bit. Attributes go the same way, by the rules of [`crate::Geomorph`], from those that stand for them in the one mesh to those in the other.
///
/// Guaranteed: what is drawn is a mesh without cracks in every frame, with at least the leader's faces. Not guaranteed: a tolerance while vertices
/// move. Memory: a second view, and 70 to 140 B for every vertex that moves; with attributes 100 to 200 B and their values for each of its wedges, and once for all morphs of a hierarchy 4 B a row.
#[derive(Clone, Debug)]
pub struct TimedMorph {
    drawn: View,
    motions: Motions,
    /// Attributes, if there are any.
    rows: Option<RowMotions>,
    /// The leader's splits when it was followed last.
    led: Vec<u64>,
}

/// The set bits, ascending.
fn bits(words: impl Iterator<Item = u64>) -> Vec<u32> {
    let mut all = Vec::new();
    for (k, mut word) in (0u32..).zip(words) {
        while word != 0 {
            all.push(64 * k + word.trailing_zeros());
            word &= word - 1;
        }
    }
    all
}

impl TimedMorph {
    /// Draws `leader` as it is. Later changes take `frames` frames, at least 1.
    pub fn new(leader: &View, frames: u32) -> TimedMorph {
        let led = leader.front.applied_bits().collect();
        let rows = RowMotions::new(&leader.hierarchy, frames.max(1));
        TimedMorph { drawn: leader.clone(), motions: Motions::new(frames), rows, led }
    }

    /// Frames that a change takes.
    pub fn frames(&self) -> u32 {
        self.motions.frames()
    }

    /// The mesh that is drawn: its faces and, but for vertices that are elsewhere, its places.
    pub fn view(&self) -> &View {
        &self.drawn
    }

    /// What changed in its buffers, as [`View::take_changes`]; vertices that only move are not in.
    pub fn take_changes(&mut self) -> super::Changes {
        self.drawn.take_changes()
    }

    /// Where vertex `v` is drawn; `None` if it is not. Panics if there is no such vertex.
    pub fn position(&self, v: u32) -> Option<DVec3> {
        self.motions.place(v).or_else(|| self.drawn.position(v))
    }

    /// The attribute values that wedge `w` is drawn with, and the channels it has; `None` if it is not drawn, or without attributes. Panics if there is no such wedge.
    pub fn row(&self, w: u32) -> Option<(Vec<f32>, u64)> {
        let row = Some(self.drawn.front.wedge_row(w)).filter(|&r| r != NONE)?;
        let own = || {
            let (values, has) = self.drawn.row(w);
            (values.into_owned(), has)
        };
        Some(self.rows.as_ref().and_then(|m| m.value(&self.drawn.hierarchy, row)).unwrap_or_else(own))
    }

    /// Every vertex is drawn where the mesh has it, and with its own attributes.
    pub fn is_at_rest(&self) -> bool {
        self.motions.len() == 0 && self.rows.as_ref().is_none_or(RowMotions::is_empty)
    }

    /// The mesh that is drawn as flat arrays: as [`View::to_input`], with vertices and attributes as they are on their way. O(n).
    pub fn to_input(&self) -> MeshInput {
        let places: Vec<_> = self.displaced().collect();
        let mut out = self.drawn.input(self.is_at_rest(), |w| {
            self.row(w).map_or_else(|| self.drawn.own_row(w), |(row, has)| (row.into(), has))
        });
        self.drawn.put(&mut out, &places);
        out
    }

    /// The vertices that are drawn elsewhere than the mesh has them, ascending, and where.
    pub fn displaced(&self) -> impl ExactSizeIterator<Item = (u32, DVec3)> + '_ {
        self.motions.all()
    }

    /// Takes a step towards `leader`, which must be a view of the same hierarchy and has been adapted to `lenses`. O(splits / 64 + changes + vertices that move).
    pub fn follow(&mut self, leader: &View, lenses: &[Lens]) -> Followed {
        let now: Vec<u64> = leader.front.applied_bits().collect();
        let before = std::mem::replace(&mut self.led, now);
        let mut both = Both { drawn: &mut self.drawn, rows: &mut self.rows, led: &self.led, before: &before };
        let Ok(done) = self.motions.follow(&mut both, lenses);
        self.rows.iter_mut().for_each(RowMotions::settle);
        self.drawn.front.settle();
        done
    }
}

/// What is drawn, and what was and is asked for, a bit a split.
struct Both<'a> {
    drawn: &'a mut View,
    rows: &'a mut Option<RowMotions>,
    led: &'a [u64],
    before: &'a [u64],
}

impl Cut for Both<'_> {
    fn is_applied(&self, i: u32) -> bool {
        Cut::is_applied(self.drawn, i)
    }

    fn node(&self, v: u32) -> u32 {
        self.drawn.node(v)
    }

    fn maker(&self, node: u32) -> u32 {
        self.drawn.maker(node)
    }

    fn parent(&self, i: u32) -> (u32, u32) {
        self.drawn.parent(i)
    }

    fn new_vertex(&self, i: u32) -> u32 {
        self.drawn.new_vertex(i)
    }

    fn below(&self, i: u32) -> [u32; 2] {
        Cut::below(self.drawn, i)
    }

    fn entry(&self, i: u32) -> Entry {
        self.drawn.entry(i)
    }

    fn place(&self, node: u32, v: u32) -> DVec3 {
        self.drawn.place(node, v)
    }
}

impl Stage for Both<'_> {
    type Error = Infallible;

    fn is_led(&self, i: u32) -> bool {
        self.led[i as usize / 64] >> (i % 64) & 1 != 0
    }

    fn changed(&self) -> Vec<u32> {
        bits(self.led.iter().zip(self.before).map(|(a, b)| a ^ b))
    }

    fn lingering(&self) -> Vec<u32> {
        bits(self.led.iter().zip(self.drawn.front.applied_bits()).map(|(a, b)| b & !a))
    }

    fn is_free(&self, i: u32) -> bool {
        self.drawn.is_free(i) && self.rows.as_ref().is_none_or(|r| r.is_at_rest(&self.drawn.hierarchy, i))
    }

    fn draw(&mut self, i: u32) -> Result<(), Infallible> {
        if let Some(rows) = &mut self.rows {
            rows.begin(&self.drawn.hierarchy, i);
        }
        self.drawn.apply(&Split::new(i));
        Ok(())
    }

    fn undraw(&mut self, i: u32) -> Result<(), Infallible> {
        self.drawn.undo(i, &mut Vec::new());
        if let Some(rows) = &mut self.rows {
            rows.end(&self.drawn.hierarchy, i);
        }
        Ok(())
    }

    fn send_more(&mut self, changed: &[u32], lenses: &[Lens]) {
        if changed.is_empty() {
            return;
        }
        let Some(mut rows) = self.rows.take() else { return };
        // What lingers may have to go farther up, or not so far.
        let mut splits = self.lingering();
        splits.extend(changed.iter().filter(|&&i| self.is_led(i)));
        rows.send(&self.drawn.hierarchy, &splits, self, lenses);
        *self.rows = Some(rows);
    }

    fn step_more(&mut self) {
        self.rows.iter_mut().for_each(RowMotions::step);
    }
}
