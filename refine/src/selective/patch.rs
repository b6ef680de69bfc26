//! What a split does to faces and wedges, wherever they are kept: in memory as a whole ([`super::Front`]) or by pages ([`crate::paged`]).

use crate::aif::NONE;
use crate::progressive::{Damage, Explicit, Fans, Half, Opening, SplitCode, SplitKind, seam_wedges};

/// What is to be known of a split to do it or undo it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Known {
    pub(crate) split: u32,
    /// The vertex that is split.
    pub(crate) vertex: u32,
    pub(crate) new_vertex: u32,
    pub(crate) code: SplitCode,
    /// Its first new wedge.
    pub(crate) wedge: u32,
    /// Its first row, as the sheet numbers them.
    pub(crate) row: u32,
}

/// Faces, and the wedges of their corners.
pub(crate) trait Sheet {
    fn fans(&self) -> &Fans;
    fn fans_mut(&mut self) -> &mut Fans;
    /// Wedges have rows and vertices; else a wedge is its vertex.
    fn has_rows(&self) -> bool;
    fn wedge_vertex(&self, w: u32) -> u32;
    fn set_wedge_vertex(&mut self, w: u32, vertex: u32);
    /// Gives a row of the split to a new wedge.
    fn give_row(&mut self, of: &Known, w: u32, row: u32);
    /// Gives a row of the split to a wedge that has another, which will be asked for.
    fn change_row(&mut self, of: &Known, w: u32, row: u32);
    /// Undoes that.
    fn restore_row(&mut self, of: &Known, w: u32, row: u32);
    /// Undoes [`Sheet::give_row`].
    fn drop_row(&mut self, w: u32);
    /// Two slots that are free; of a split that makes one face the second is not used.
    fn take_slots(&mut self, of: &Known) -> [u32; 2];
    /// Slots that [`Sheet::take_slots`] gave, emptied.
    fn leave_slots(&mut self, of: &Known, slots: [u32; 2]);
    /// The corners of a slot have changed.
    fn touch(&mut self, slot: u32);
    /// A wedge is new, or has other values.
    fn touch_wedge(&mut self, w: u32);
    /// The vertex that `h` is seen from has moved.
    fn touch_vertex(&mut self, vertex: u32, h: Half);
}

/// Applies a split, given the slots that its cuts lie in, as `slot * 4 + edge` ([`NONE`] for a right one that is not there), and what its entry of the explicit stream is if it has one. O(valence).
///
/// Errors: cuts that are none of the vertex; nothing has changed then.
#[inline]
pub(crate) fn split<S: Sheet>(
    s: &mut S,
    of: &Known,
    (left, right): (u32, u32),
    explicit: &Explicit,
) -> Result<[u32; 2], Damage> {
    let (code, at, w) = (of.code, of.split as usize, of.wedge);
    let gap = s.fans().find_gap(at, (left, right), code)?;
    let Some(seen_from) = gap.left.inner.or(gap.left.outer) else { return Err(Damage::Fan(at)) };
    let first = s.fans().wedge(seen_from);
    if s.wedge_vertex(first) != of.vertex {
        return Err(Damage::Fan(at));
    }
    let tips =
        [s.fans().tip(gap.left, code.left_tip_inner()), s.fans().tip(gap.right, code.right_tip_inner())];
    let (x, new, changed, mut corners): ([u32; 2], u32, &[u32], [[u32; 3]; 2]) = match code.kind() {
        SplitKind::Plain => ([first; 2], 1, &[first], [[first, w, NONE]; 2]),
        SplitKind::Seam => {
            let last = gap.right.inner.map_or(first, |h| s.fans().wedge(h));
            let outer = |o: Opening| o.outer.map(|h| s.fans().wedge(h));
            let (l, r) = seam_wedges(first, last, outer(gap.left), outer(gap.right));
            ([l, r], 2, &[l, r], [[l, w, NONE], [r, w + 1, NONE]])
        }
        SplitKind::Explicit => {
            let corner = |k: usize| explicit.corners.get(k).copied().unwrap_or_default();
            ([first; 2], explicit.new as u32, &explicit.changed, [corner(0), corner(1)])
        }
    };
    let changed = if code.changes_rows() { changed } else { &[] };
    if s.has_rows() {
        for j in 0..new {
            s.set_wedge_vertex(w + j, of.new_vertex);
            s.give_row(of, w + j, of.row + j);
        }
        for (row, &c) in (of.row + new..).zip(changed) {
            s.change_row(of, c, row);
        }
        if code.kind() == SplitKind::Explicit {
            explicit.pairs.iter().filter(|p| p.0 == p.1).for_each(|p| s.set_wedge_vertex(p.1, of.new_vertex));
            for (c, tip) in explicit.corners.iter().zip(tips) {
                if c[0] >= w {
                    s.set_wedge_vertex(c[0], of.vertex);
                }
                if c[2] >= w && c[2] != NONE && tip != NONE {
                    s.set_wedge_vertex(c[2], s.wedge_vertex(tip));
                }
            }
        }
    }
    (w..w + new).for_each(|w| s.touch_wedge(w));
    changed.iter().for_each(|&w| s.touch_wedge(w));
    if code.moves() {
        s.touch_vertex(of.vertex, seen_from);
    }
    match code.kind() {
        SplitKind::Plain => hand_over(s, gap.left.inner, gap.faces, |_| w),
        SplitKind::Seam => {
            hand_over(s, gap.left.inner, gap.faces, |c| if c == x[0] { w } else { w + 1 });
        }
        SplitKind::Explicit => {
            let map = |c: u32| explicit.pairs.iter().find(|p| p.0 == c).map_or(c, |p| p.1);
            hand_over(s, gap.left.inner, gap.faces, map);
        }
    }
    for (c, tip) in corners.iter_mut().zip(tips).filter(|(c, _)| c[2] == NONE) {
        c[2] = tip;
    }
    let slots = s.take_slots(of);
    let edge = s.fans_mut().insert_at(slots[0], code.left(), corners[0], gap.left);
    s.touch(slots[0]);
    if code.two_faces() {
        let other = s.fans_mut().insert_at(slots[1], code.right(), corners[1], gap.right);
        s.fans_mut().connect(edge, other);
        s.touch(slots[1]);
    }
    Ok(slots)
}

/// Undoes a split, given its slots (of one that made one face twice the same). Nothing applied depends on it. O(valence).
#[inline]
pub(crate) fn unsplit<S: Sheet>(s: &mut S, of: &Known, [fl, fr]: [u32; 2], explicit: &Explicit) {
    let (code, two) = (of.code, of.code.two_faces());
    let left = s.fans().opening_of(fl, code.left());
    let right = if two { s.fans().opening_of(fr, code.right()) } else { Opening::default() };
    let (x_l, y_l) = s.fans().ends_of(fl, code.left());
    let x_r = if two { s.fans().ends_of(fr, code.right()).0 } else { x_l };
    // The faces of the new vertex lie between the two that go.
    let (mut run, mut entry) = (0, left.inner);
    while let Some(h) = entry.filter(|h| h.face() != fl && h.face() != fr) {
        run += 1;
        entry = s.fans().across(h.turn());
    }
    let chosen = [x_l, x_r];
    let (new, changed): (u32, &[u32]) = match code.kind() {
        SplitKind::Plain => {
            hand_over(s, left.inner, run, |_| x_l);
            (1, &chosen[..1])
        }
        SplitKind::Seam => {
            hand_over(s, left.inner, run, |c| if c == y_l { x_l } else { x_r });
            (2, &chosen)
        }
        SplitKind::Explicit => {
            let map = |c: u32| explicit.pairs.iter().find(|p| p.1 == c).map_or(c, |p| p.0);
            hand_over(s, left.inner, run, map);
            (explicit.new as u32, &explicit.changed)
        }
    };
    s.fans_mut().close(left);
    s.fans_mut().close(right);
    for slot in [fl, fr] {
        s.fans_mut().corners[slot as usize] = [0; 3];
        s.fans_mut().links[slot as usize] = [NONE; 3];
        s.touch(slot);
    }
    s.leave_slots(of, [fl, fr]);
    let changed = if code.changes_rows() { changed } else { &[] };
    if s.has_rows() {
        explicit.pairs.iter().filter(|p| p.0 == p.1).for_each(|p| s.set_wedge_vertex(p.1, of.vertex));
        for (row, &c) in (of.row + new..).zip(changed) {
            s.restore_row(of, c, row);
        }
        (of.wedge..of.wedge + new).for_each(|w| s.drop_row(w));
    }
    changed.iter().for_each(|&w| s.touch_wedge(w));
    if code.moves()
        && let Some(h) = left.inner.or(left.outer)
    {
        s.touch_vertex(of.vertex, h);
    }
}

/// Gives the corners of so many faces at a vertex, from `first` on, the wedges that `map` says.
#[inline]
fn hand_over<S: Sheet>(s: &mut S, first: Option<Half>, count: usize, map: impl Fn(u32) -> u32) {
    let mut entry = first;
    for _ in 0..count {
        let Some(h) = entry else { return };
        let wedge = &mut s.fans_mut().corners[h.face() as usize][h.corner()];
        *wedge = map(*wedge);
        s.touch(h.face());
        entry = s.fans().across(h.turn());
    }
}
