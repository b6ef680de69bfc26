//! The faces that are drawn, and what changes them, apart from what is asked for: so another thread draws while splits are still found.
//!
//! Where neither attributes nor geomorphs by time are in the way, a split is drawn by its *stroke*: where its cuts lie, and who takes part. Strokes are drawn in the order in which they were made, by whoever gets to it, one
//! at a time; so faces are the same for any number of threads. A stroke that contradicts the faces changes nothing, and ends it: those behind it are not drawn, and the view takes back what was asked for by them.

use super::ready::{LOT, Reads};
use super::{begin, several};
use crate::aif::NONE;
use crate::progressive::{Damage, Fans, Half, NO_ENTRY, SplitCode};
use crate::selective::{Known, Sheet, split, unsplit};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

/// Faces, in slots of the index buffer, and which have changed.
#[derive(Debug, Default)]
pub(super) struct Canvas {
    pub(super) fans: Fans,
    /// Slots whose corners changed, a bit each.
    pub(super) touched: Vec<u64>,
    pub(super) touched_wedges: usize,
    /// The first slot of the split that is being applied.
    pub(super) slots: u32,
}

/// A split, or its undoing, as the faces see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke {
    pub(super) split: u32,
    pub(super) vertex: u32,
    pub(super) new_vertex: u32,
    /// Its first slot.
    pub(super) first: u32,
    /// Where its cuts lie, as `slot * 4 + edge`; [`NONE`] for a right one that is not there. Of one that is undone the slots of its faces, likewise.
    pub(super) cuts: [u32; 2],
    pub(super) code: SplitCode,
    /// Applied, not undone.
    pub(super) on: bool,
}

impl Canvas {
    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        24 * self.fans.corners.capacity() + 8 * self.touched.capacity()
    }

    /// There are so many slots at least; in new ones is no face.
    pub(super) fn extend_to(&mut self, slots: usize) {
        let from = self.fans.corners.len();
        if slots > from {
            self.fans.corners.resize(slots, [0; 3]);
            self.fans.links.resize(slots, [NONE; 3]);
            self.touched.resize(slots.div_ceil(64), 0);
            (from..slots).for_each(|slot| self.touched[slot / 64] |= 1 << (slot % 64));
        }
    }

    /// Draws strokes, and says how many splits were applied.
    ///
    /// Errors: that number as well, and why not the next.
    pub(super) fn draw(&mut self, strokes: &[Stroke]) -> (usize, Result<(), Damage>) {
        let mut applied = 0;
        for lot in strokes.chunks(LOT) {
            self.ready(lot);
            for s in lot {
                let of = Known {
                    split: s.split,
                    vertex: s.vertex,
                    new_vertex: s.new_vertex,
                    code: s.code,
                    wedge: s.new_vertex,
                    row: 0,
                };
                if !s.on {
                    unsplit(self, &of, [s.first, s.first + u32::from(s.code.two_faces())], &NO_ENTRY);
                    continue;
                }
                self.extend_to(s.first as usize + 2);
                self.slots = s.first;
                if let Err(e) = split(self, &of, (s.cuts[0], s.cuts[1]), &NO_ENTRY) {
                    return (applied, Err(e));
                }
                applied += 1;
            }
        }
        (applied, Ok(()))
    }

    /// Reads what a lot of strokes touches, together.
    fn ready(&self, lot: &[Stroke]) {
        let mut reads = Reads::new();
        for s in lot {
            self.ask_for_faces(s.cuts.iter().map(|c| c >> 2), &mut reads);
        }
        reads.wait();
        for s in lot {
            s.cuts.iter().for_each(|c| self.ask_for_faces(self.across(c >> 2), &mut reads));
        }
        reads.wait();
    }

    /// The slots of the faces across the edges of the one in a slot.
    #[inline]
    pub(super) fn across(&self, slot: u32) -> impl Iterator<Item = u32> + use<> {
        let links = self.fans.links.get(slot as usize).copied().unwrap_or([NONE; 3]);
        links.into_iter().map(|l| l >> 3)
    }

    #[inline]
    pub(super) fn ask_for_faces<'a>(&'a self, slots: impl Iterator<Item = u32>, reads: &mut Reads<'a>) {
        for slot in slots {
            if let Some(c) = self.fans.corners.get(slot as usize) {
                reads.ask(&c[0]);
                reads.ask(&self.fans.links[slot as usize][0]);
            }
        }
    }

    #[inline]
    pub(super) fn touch_slot(&mut self, slot: u32) {
        self.touched[slot as usize / 64] |= 1 << (slot % 64);
    }
}

/// Without attributes: a wedge is its vertex.
impl Sheet for Canvas {
    #[inline]
    fn fans(&self) -> &Fans {
        &self.fans
    }

    #[inline]
    fn fans_mut(&mut self) -> &mut Fans {
        &mut self.fans
    }

    #[inline]
    fn has_rows(&self) -> bool {
        false
    }

    #[inline]
    fn wedge_vertex(&self, w: u32) -> u32 {
        w
    }

    fn set_wedge_vertex(&mut self, _: u32, _: u32) {}

    fn give_row(&mut self, _: &Known, _: u32, _: u32) {}

    fn change_row(&mut self, _: &Known, _: u32, _: u32) {}

    fn restore_row(&mut self, _: &Known, _: u32, _: u32) {}

    fn drop_row(&mut self, _: u32) {}

    #[inline]
    fn take_slots(&mut self, _: &Known) -> [u32; 2] {
        [self.slots, self.slots + 1]
    }

    #[inline]
    fn leave_slots(&mut self, _: &Known, _: [u32; 2]) {}

    #[inline]
    fn touch(&mut self, slot: u32) {
        self.touch_slot(slot);
    }

    #[inline]
    fn touch_wedge(&mut self, _: u32) {
        self.touched_wedges += 1;
    }

    #[inline]
    fn touch_vertex(&mut self, _: u32, _: Half) {
        self.touched_wedges += 1;
    }
}

/// Strokes that are handed over at a time: a thread is woken for as many.
const HANDFUL: usize = 64;
/// Handfuls that may wait; then who made them draws, too.
const WAITING: usize = 16;
/// Splits that are applied until it is asked if all could be drawn.
const MOST: usize = 2048;
/// How often it is asked in vain for what another thread has before it is slept for: some tens of microseconds.
const PATIENCE: usize = 1000;

/// The faces while several threads may draw.
#[derive(Debug)]
struct Easel {
    canvas: Mutex<(Canvas, Outcome)>,
    strokes: Mutex<VecDeque<Vec<Stroke>>>,
}

/// What became of strokes.
#[derive(Debug, Default)]
struct Outcome {
    /// Splits that were applied.
    applied: usize,
    /// Why not the next.
    failed: Option<Damage>,
}

impl Outcome {
    fn draw(&mut self, canvas: &mut Canvas, strokes: &[Stroke]) {
        if self.failed.is_none() {
            let (applied, result) = canvas.draw(strokes);
            self.applied += applied;
            self.failed = result.err();
        }
    }
}

impl Easel {
    /// Draws what there is to draw.
    fn draw(&self) {
        self.draw_on(&mut self.canvas());
    }

    /// The same, unless somebody is at it.
    fn help(&self) {
        if let Ok(mut held) = self.canvas.try_lock() {
            self.draw_on(&mut held);
        }
    }

    fn draw_on(&self, (canvas, outcome): &mut (Canvas, Outcome)) {
        // They are taken while the faces are held: so nobody overtakes.
        while let Some(strokes) = self.take() {
            outcome.draw(canvas, &strokes);
        }
    }

    fn take(&self) -> Option<Vec<Stroke>> {
        self.strokes().pop_front()
    }

    fn strokes(&self) -> MutexGuard<'_, VecDeque<Vec<Stroke>>> {
        self.strokes.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn canvas(&self) -> MutexGuard<'_, (Canvas, Outcome)> {
        for _ in 0..PATIENCE {
            match self.canvas.try_lock() {
                Ok(held) => return held,
                Err(TryLockError::Poisoned(p)) => return p.into_inner(),
                Err(TryLockError::WouldBlock) => std::hint::spin_loop(),
            }
        }
        self.canvas.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The faces, and strokes that are not drawn yet.
#[derive(Debug)]
pub(super) struct Drawing {
    /// Between frames, and where they are drawn by the view itself, the faces are here.
    pub(super) canvas: Canvas,
    /// Where they are otherwise, and the bytes that they hold.
    away: Option<(Arc<Easel>, usize)>,
    strokes: Vec<Stroke>,
    /// Of strokes that the view has drawn itself since all was.
    outcome: Outcome,
    /// Records of the splits whose strokes were made since then.
    log: Vec<u32>,
    /// Handfuls that may wait.
    waiting: usize,
}

impl Drawing {
    /// With the faces of the base; `splits` can come.
    pub(super) fn new(fans: Fans, splits: usize) -> Drawing {
        let touched = vec![0; fans.corners.len().div_ceil(64)];
        let canvas = Canvas { fans, touched, touched_wedges: 0, slots: 0 };
        let (strokes, log) = (Vec::with_capacity(HANDFUL), Vec::with_capacity(MOST.min(splits)));
        let waiting = WAITING.min(splits / HANDFUL);
        Drawing { canvas, away: None, strokes, outcome: Outcome::default(), log, waiting }
    }

    /// Bytes held, strokes that may wait included.
    pub(super) fn bytes(&self) -> usize {
        let strokes = (self.waiting + 3) * HANDFUL * size_of::<Stroke>();
        let faces = self.away.as_ref().map_or_else(|| self.canvas.bytes(), |a| a.1);
        faces + strokes + 4 * self.log.capacity()
    }

    /// All strokes are drawn, and the faces are here.
    #[inline]
    pub(super) fn is_done(&self) -> bool {
        self.away.is_none() && self.strokes.is_empty() && self.log.is_empty()
    }

    /// It is time to ask if all can be drawn.
    #[inline]
    pub(super) fn is_full(&self) -> bool {
        self.log.len() >= MOST
    }

    /// Puts a stroke behind the others, of the split of record `h`.
    #[inline]
    pub(super) fn put(&mut self, h: u32, stroke: Stroke) {
        self.strokes.push(stroke);
        if stroke.on {
            self.log.push(h);
        }
        if self.strokes.len() >= HANDFUL {
            self.hand_over();
        }
    }

    /// Gives strokes to another thread, or draws them where there is none.
    fn hand_over(&mut self) {
        if !several() {
            self.outcome.draw(&mut self.canvas, &self.strokes);
            self.strokes.clear();
            return;
        }
        let easel = match &self.away {
            Some((easel, _)) => easel,
            None => {
                let bytes = self.canvas.bytes();
                let canvas =
                    Mutex::new((std::mem::take(&mut self.canvas), std::mem::take(&mut self.outcome)));
                let strokes = Mutex::new(VecDeque::with_capacity(self.waiting + 1));
                &self.away.insert((Arc::new(Easel { canvas, strokes }), bytes)).0
            }
        };
        let handful = std::mem::replace(&mut self.strokes, Vec::with_capacity(HANDFUL));
        let waiting = {
            let mut strokes = easel.strokes();
            strokes.push_back(handful);
            strokes.len()
        };
        if waiting > self.waiting {
            easel.draw();
        } else {
            let easel = easel.clone();
            begin(move || easel.help());
        }
    }

    /// Draws all that is not; the faces are here then.
    pub(super) fn gather(&mut self) {
        if let Some((easel, _)) = self.away.take() {
            let mut held = easel.canvas();
            easel.draw_on(&mut held);
            (self.canvas, self.outcome) = std::mem::take(&mut *held);
        }
        self.outcome.draw(&mut self.canvas, &self.strokes);
        self.strokes.clear();
    }

    /// The same, and says if all could be drawn.
    ///
    /// Errors: why a split could not, and the records of those that were not, the last first.
    pub(super) fn finish(&mut self) -> Result<(), (Damage, Vec<u32>)> {
        self.gather();
        let outcome = std::mem::take(&mut self.outcome);
        let result = match outcome.failed {
            None => Ok(()),
            Some(e) => Err((e, self.log.iter().skip(outcome.applied).rev().copied().collect())),
        };
        self.log.clear();
        result
    }
}
