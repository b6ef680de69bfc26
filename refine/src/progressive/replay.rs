//! Attributes while splits are made of collapses: the wedges of the mesh of the moment, and what every split makes of them.

use super::input::InputOrder;
use super::links::next;
use super::{Presence, ProgressiveMesh, SplitCode, WedgeStreams, directions};
use crate::aif::{FaceId, NONE, Semantic, Topology, VertexId, Wedges};
use crate::simplify::{CollapseLog, LoggedWing};
use std::ops::Range;

/// Wedges on the way from the base to full detail, collapse by collapse, the last first.
pub(super) struct WedgeReplay<'a> {
    log: &'a CollapseLog,
    /// As they are now.
    wedges: Wedges,
    /// Wedge of the mesh -> slot; [`NONE`] until a split makes it.
    slot: Vec<u32>,
    count: u32,
    out: WedgeStreams,
    /// Rows of `out`.
    values: Vec<f32>,
    /// (coarse, fine) wedges of the split at hand.
    pairs: Vec<(u32, u32)>,
    /// Wedges of which the split at hand changes the values.
    changed: Vec<u32>,
    /// Wedges that the split at hand makes, if it lists them.
    fresh: Vec<u32>,
    between: Option<Between>,
    /// Where a seam ended two wedges became one: cursors, which tell corners by that alone, give all of them the first of the two.
    ambiguous: bool,
}

/// The corner of a face at the end of its edge (`half`) where the wedge is looked for: the split vertex, or the far end.
#[inline]
fn corner(half: u32, at_origin: bool) -> usize {
    let k = (half & 3) as usize;
    3 * (half >> 2) as usize + if at_origin { k } else { next(k) }
}

impl<'a> WedgeReplay<'a> {
    /// At the base, whose wedges are numbered by first use; `vertex` is the slot of a vertex. O(n).
    pub(super) fn new(
        wedges: Wedges,
        log: &'a CollapseLog,
        t: &Topology,
        vertex: impl Fn(VertexId) -> u32,
        coarse_normals: bool,
    ) -> Self {
        let stride = wedges.stride();
        // Every wedge is made once.
        let rows = wedges.len() + log.rows.len();
        let mut out = WedgeStreams { channels: wedges.channels().to_vec(), stride, ..Default::default() };
        let mut values = Vec::with_capacity(rows * stride);
        let (mut slot, mut count) = (vec![NONE; wedges.len()], 0);
        for f in t.faces() {
            for (&w, v) in wedges.corner[t.corner_range(f)].iter().zip(t.triangle(f)) {
                if slot[w as usize] == NONE {
                    slot[w as usize] = count;
                    count += 1;
                    out.base_vertex.push(0);
                    append(&mut values, wedges.row(w));
                    out.present.push(wedges.present(w));
                }
                out.base_vertex[slot[w as usize] as usize] = vertex(v);
            }
        }
        let (pairs, changed, fresh) = Default::default();
        let between = Between::new(&wedges, log).filter(|_| coarse_normals);
        WedgeReplay {
            log,
            wedges,
            slot,
            count,
            out,
            values,
            pairs,
            changed,
            fresh,
            between,
            ambiguous: false,
        }
    }

    /// The slots of the wedges of a triangle.
    pub(super) fn corners(&self, f: FaceId) -> [u32; 3] {
        let c = 3 * f.index();
        [c, c + 1, c + 2].map(|c| self.slot[self.wedges.corner[c] as usize])
    }

    /// What the splits make of the base's wedges; once.
    pub(super) fn streams(&mut self) -> WedgeStreams {
        let rows = std::mem::take(&mut self.values).into();
        WedgeStreams { rows, ..std::mem::take(&mut self.out) }
    }

    /// Writes down where the wedges at full detail are not the input's. `face` is the slot of every face of the mesh.
    pub(super) fn compare(&self, pm: &ProgressiveMesh, face: &[u32], order: &mut InputOrder, input: &Wedges) {
        match self.shown(pm, face) {
            Some(shown) => {
                let slot: Vec<u32> = (0..shown.len() as u32).collect();
                order.note_wedges(&shown, &slot, input);
            }
            None => order.note_wedges(&self.wedges, &self.slot, input),
        }
    }

    /// The wedges that a cursor shows at full detail, by corners of the mesh.
    fn shown(&self, pm: &ProgressiveMesh, face: &[u32]) -> Option<Wedges> {
        if !self.ambiguous {
            return None;
        }
        let mut cursor = pm.cursor().ok()?;
        cursor.seek(usize::MAX).ok()?;
        let mut shown = Wedges::new(self.wedges.channels().to_vec()).ok()?;
        for w in 0..cursor.wedge_count() as u32 {
            shown.push(cursor.row(w), cursor.present(w));
        }
        shown.corner = face.iter().flat_map(|&slot| cursor.indices()[slot as usize]).collect();
        Some(shown)
    }

    fn run_of(&self, i: usize) -> (Range<usize>, Range<usize>) {
        let ends = &self.log.ends;
        let (start, end) = (if i == 0 { (0, 0) } else { ends[i - 1] }, ends[i]);
        (start.0 as usize..end.0 as usize, start.1 as usize..end.1 as usize)
    }

    #[inline]
    fn at(&self, half: u32, at_origin: bool) -> u32 {
        self.wedges.corner[corner(half, at_origin)]
    }

    /// Undoes collapse `i`; returns the bits of its code. O(valence).
    #[inline]
    pub(super) fn split(&mut self, i: usize, l: &LoggedWing, r: &LoggedWing) -> u16 {
        let ends = [self.ends_of_run(l), self.ends_of_run(r)];
        let (corners, rows) = self.run_of(i);
        self.go_back(corners, rows);
        self.plain_split(l, r, ends).unwrap_or_else(|| self.any_split(l, r, ends))
    }

    /// Coarse wedges at an end of the run of faces that go to the new vertex: of its last face, and of that beyond.
    #[inline]
    fn ends_of_run(&self, wing: &LoggedWing) -> [Option<u32>; 2] {
        let inner = (wing.removed_half != NONE).then(|| self.at(wing.removed_half, wing.removed_half_starts));
        let outer = (wing.kept_half != NONE).then(|| self.at(wing.kept_half, wing.kept_half_starts));
        [inner, outer]
    }

    /// The wedges of a new face: at the old vertex, the new one, the tip.
    #[inline]
    fn of_wing(&self, wing: &LoggedWing) -> [u32; 3] {
        let c = 3 * wing.face as usize;
        let a = wing.slot as usize;
        let b = next(a);
        let at = |k: usize| self.wedges.corner[c + k];
        let (vt, vu) = if wing.kept_first { (at(a), at(b)) } else { (at(b), at(a)) };
        [vt, vu, at(next(b))]
    }

    /// The bits of a split that makes one wedge of another, as nearly all do; `None` if this is none.
    #[inline]
    fn plain_split(&mut self, l: &LoggedWing, r: &LoggedWing, ends: [[Option<u32>; 2]; 2]) -> Option<u16> {
        let &[(coarse, fine)] = &self.pairs[..] else { return None };
        let two = r.face != NONE;
        let first = ends[0][0].or(ends[0][1]).unwrap_or(0);
        let fl = self.of_wing(l);
        let one = first == coarse && fl[0] == coarse && fl[1] == fine && self.slot[fine as usize] == NONE;
        if !one || self.changed.iter().any(|&w| w != coarse) {
            return None;
        }
        let mut bits = if self.tip(l, fl[2])? { SplitCode::L_TIP_INNER } else { 0 };
        if two {
            let fr = self.of_wing(r);
            if ends[1][0].unwrap_or(coarse) != coarse || fr[0] != coarse || fr[1] != fine {
                return None;
            }
            bits |= if self.tip(r, fr[2])? { SplitCode::R_TIP_INNER } else { 0 };
        }
        self.slot[fine as usize] = self.count;
        self.count += 1;
        push_row((&mut self.out.present, &mut self.values), &self.wedges, &self.between, fine);
        if !self.changed.is_empty() {
            bits |= SplitCode::ROWS;
            push_row((&mut self.out.present, &mut self.values), &self.wedges, &self.between, coarse);
        }
        Some(bits)
    }

    /// The bits of any split.
    #[cold]
    #[inline(never)]
    fn any_split(&mut self, l: &LoggedWing, r: &LoggedWing, ends: [[Option<u32>; 2]; 2]) -> u16 {
        let two = r.face != NONE;
        let [[inner_l, outer_l], [inner_r, outer_r]] = ends;
        // A face has one across one of its sides at least.
        let plain_l = inner_l.or(outer_l).unwrap_or(0);
        let plain_r = inner_r.filter(|_| two).unwrap_or(plain_l);
        let (x_l, x_r) =
            if two { super::seam_wedges(plain_l, plain_r, outer_l, outer_r) } else { (plain_l, plain_r) };
        let fl = self.of_wing(l);
        let fr = if two { self.of_wing(r) } else { [plain_l, fl[1], NONE] };
        // New wedges that only the new faces have.
        for w in [(fl[0], fl[1]), (fr[0], fr[1])] {
            if self.slot[w.1 as usize] == NONE && self.pairs.iter().all(|p| p.1 != w.1) {
                self.pairs.push(w);
            }
        }
        let tip_l = self.tip(l, fl[2]);
        let tip_r = if two { self.tip(r, fr[2]) } else { Some(false) };
        let (pairs, changed) = (&self.pairs[..], &self.changed[..]);
        let fresh = |w: u32| self.slot[w as usize] == NONE;
        let within = |allowed: &[u32]| changed.iter().all(|w| allowed.contains(w));
        let plain = *pairs == [(plain_l, fl[1])]
            && plain_l == plain_r
            && fresh(fl[1])
            && fl[0] == plain_l
            && fr[..2] == [plain_l, fl[1]]
            && within(&[plain_l]);
        let seam = !plain
            && two
            && pairs.len() == 2
            && x_l != x_r
            && fl[1] != fr[1]
            && pairs.contains(&(x_l, fl[1]))
            && pairs.contains(&(x_r, fr[1]))
            && fresh(fl[1])
            && fresh(fr[1])
            && fl[0] == x_l
            && fr[0] == x_r
            && within(&[x_l, x_r]);
        let simple = tip_l.is_some() && tip_r.is_some() && (plain || seam);
        let mut bits = 0;
        bits |= if tip_l == Some(true) { SplitCode::L_TIP_INNER } else { 0 };
        bits |= if tip_r == Some(true) { SplitCode::R_TIP_INNER } else { 0 };
        let (made, listed) = ([fl[1], fr[1]], if plain { [plain_l; 2] } else { [x_l, x_r] });
        self.fresh.clear();
        let (new, rows) = if simple {
            bits |= (!plain as u16) << SplitCode::KIND;
            let count = 2 - plain as usize;
            (&made[..count], if changed.is_empty() { &[] } else { &listed[..count] })
        } else {
            bits |= 2 << SplitCode::KIND;
            let slot = &self.slot;
            self.fresh.extend(pairs.iter().map(|p| p.1).filter(|&w| slot[w as usize] == NONE));
            (&self.fresh[..], changed)
        };
        for &w in new {
            self.slot[w as usize] = self.count;
            self.count += 1;
            push_row((&mut self.out.present, &mut self.values), &self.wedges, &self.between, w);
        }
        if !rows.is_empty() {
            bits |= SplitCode::ROWS;
            rows.iter().for_each(|&w| {
                push_row((&mut self.out.present, &mut self.values), &self.wedges, &self.between, w)
            });
        }
        if !simple {
            let slot = |w: u32| self.slot[w as usize];
            let out = &mut self.out.explicit;
            out.extend([pairs.len() as u32, changed.len() as u32]);
            out.extend(pairs.iter().flat_map(|p| [slot(p.0), slot(p.1)]));
            out.extend(changed.iter().map(|&w| slot(w)));
            // Tips by their neighbours where that tells them: it holds in any order of the splits.
            let with_tip = |c: [u32; 3], rule: Option<bool>| {
                [slot(c[0]), slot(c[1]), if rule.is_some() { NONE } else { slot(c[2]) }]
            };
            out.extend(with_tip(fl, tip_l));
            if two {
                out.extend(with_tip(fr, tip_r));
            }
        }
        bits
    }

    /// Gives corners and rows what they had before a collapse; notes the pairs (coarse, fine) of corners, and what rows change.
    #[inline]
    fn go_back(&mut self, corners: Range<usize>, rows: Range<usize>) {
        let (log, w) = (self.log, &mut self.wedges);
        self.pairs.clear();
        for &(c, fine) in &log.corners[corners] {
            let pair = (std::mem::replace(&mut w.corner[c as usize], fine), fine);
            // Mostly the faces in a row are alike.
            if self.pairs.last() != Some(&pair) && !self.pairs.contains(&pair) {
                self.ambiguous |= self.pairs.iter().any(|p| p.0 == pair.0);
                self.pairs.push(pair);
            }
        }
        let stride = w.stride();
        self.changed.clear();
        for k in rows {
            let (id, present) = log.rows[k];
            w.set_present(id, present);
            w.row_mut(id).copy_from_slice(&log.values[k * stride..(k + 1) * stride]);
            self.changed.push(id);
            if let Some(b) = &mut self.between {
                b.left[id as usize] -= 1;
            }
        }
    }

    /// Whether the wedge at the tip of a new face is that of the neighbour at the new vertex (true) or at the old one; `None` if that does not tell.
    #[inline]
    fn tip(&self, wing: &LoggedWing, want: u32) -> Option<bool> {
        let outer = (wing.kept_half != NONE).then(|| self.at(wing.kept_half, !wing.kept_half_starts));
        let inner =
            || (wing.removed_half != NONE).then(|| self.at(wing.removed_half, !wing.removed_half_starts));
        if outer == Some(want) {
            return Some(false);
        }
        (inner() == Some(want)).then_some(outer.is_some())
    }
}

/// What makes normals between base and full detail coarser.
struct Between {
    /// For every wedge, how many changes of its values are still to be undone.
    left: Vec<u32>,
    /// Where in a row the normal is.
    at: usize,
}

impl Between {
    /// `None` without normals.
    fn new(wedges: &Wedges, log: &CollapseLog) -> Option<Between> {
        let channels = wedges.channels();
        let k = channels.iter().position(|c| c.semantic == Semantic::Normal && c.width == 3)?;
        let at = channels[..k].iter().map(|c| c.width).sum();
        let mut left = vec![0; wedges.len()];
        log.rows.iter().for_each(|r| left[r.0 as usize] += 1);
        Some(Between { left, at })
    }
}

/// Appends a row: those of three numbers, a normal as a rule, without a call.
#[inline]
fn append(values: &mut Vec<f32>, row: &[f32]) {
    match *row {
        [x, y, z] => values.extend_from_slice(&[x, y, z]),
        _ => values.extend_from_slice(row),
    }
}

/// Appends the row of wedge `w`.
#[inline(always)]
fn push_row(
    (present, values): (&mut Presence, &mut Vec<f32>),
    wedges: &Wedges,
    between: &Option<Between>,
    w: u32,
) {
    append(values, wedges.row(w));
    if let Some(b) = between.as_ref().filter(|b| b.left[w as usize] > 0) {
        let end = values.len() - wedges.stride() + b.at;
        if let [x, y, z, ..] = &mut values[end..] {
            [*x, *y, *z] = directions::snapped([*x, *y, *z]);
        }
    }
    present.push(wedges.present(w));
}
