//! The mesh of a view: faces, links and what is applied; a split and its undoing, in any order that dependencies allow.

use super::index::Index;
use super::patch::{self, Known, Sheet};
use crate::aif::NONE;
use crate::hierarchy::Forest;
use crate::packed::Run;
use crate::progressive::{Damage, Explicit, Fans, Half, NO_ENTRY, ProgressiveMesh, SplitKind, link_faces};

/// A set of applied splits that is closed under dependencies, and the mesh it makes.
///
/// Every vertex that is there has a *record*: those of the base come first, the others are of the splits that made them, used again when these are undone. A record of a
/// split has two slots of the index buffer for the faces that it makes; a slot that holds none has three equal corners.
///
/// Memory: 48 B of faces and links, 8 B of record and 4 to 5 B of index for a vertex there; for one of the finest mesh a quarter of a byte, and with attributes 8 B.
#[derive(Clone, Debug)]
pub(crate) struct Front {
    pub(super) fans: Fans,
    pub(super) base_vertices: u32,
    base_faces: u32,
    pub(super) records: Vec<Record>,
    /// A bit for each, and more: what comes next there is too fine as long as lenses keep their distance, and nothing else is to be decided. Of records that are due it means nothing.
    pub(super) too_fine: Vec<u64>,
    /// Times of such records were set by that alone.
    pub(super) relied: bool,
    /// The splits that are applied, and where they have their records.
    pub(super) index: Index,
    /// The first record that is free, without those of the base, which tells the next; [`LAST`] for none.
    pub(super) free: u32,
    wedge_vertex: Vec<u32>,
    /// The row of every wedge, among those in the mesh.
    wedge_row: Vec<u32>,
    pub(super) vertices: usize,
    faces: usize,
    /// Slots whose corners changed, a bit each.
    pub(super) touched: Vec<u64>,
    /// Wedges that are new, moved, or have other values, maybe repeated.
    pub(super) touched_wedges: Vec<u32>,
}

/// A vertex that is there.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Record {
    /// From below: the split that made it, [`LAST`] of the base's, or of one that is free the next of these; how many splits of its vertex are applied, [`SOME`] if they are not counted; and [`FREE`].
    word: u32,
    /// Applied splits that depend on that split.
    pub(super) dependents: u16,
    /// When to look at it again: see [`super::Clock`].
    pub(super) due: u16,
}

/// A record that holds no vertex.
const FREE: u32 = 1 << 31;
/// Where the number of applied splits begins.
const COUNT: u32 = 29;
/// So many splits of a vertex, or more.
const SOME: u32 = 3;
/// No split, and the end of the free records: as a face takes three bits of a link beside its number, splits are fewer.
pub(super) const LAST: u32 = (1 << COUNT) - 1;

impl Record {
    #[inline]
    pub(super) fn is_free(self) -> bool {
        self.word & FREE != 0
    }

    /// The split that made the vertex; of the base's more than any is.
    #[inline]
    pub(super) fn made(self) -> u32 {
        self.word & LAST
    }

    /// How many splits of the vertex are applied, if they are few. [`super::View`] counts them.
    #[inline]
    pub(super) fn turns(self) -> Option<u32> {
        Some(self.word >> COUNT & SOME).filter(|&n| n < SOME)
    }

    /// A split of the vertex has been applied.
    #[inline]
    pub(super) fn count(&mut self) {
        let more = self.turns().is_some();
        self.word += u32::from(more) << COUNT;
    }

    /// The last split of the vertex that was applied has been undone. `few` says if those that are left are fewer than are counted up to.
    #[inline]
    pub(super) fn count_back(&mut self, few: impl FnOnce() -> bool) {
        let less = self.turns().is_some() || few();
        self.word -= u32::from(less) << COUNT;
    }
}

/// Splits of a vertex that are looked at one by one, before a search.
const SHORT: usize = 4;

impl Front {
    /// The base. The arrays of `pm` have been checked by a cursor.
    pub(crate) fn new(pm: &ProgressiveMesh, forest: &Forest) -> Front {
        let (n0, n) = (pm.base_vertices(), pm.splits.len());
        let (wedge_vertex, wedge_row) = match &pm.wedges {
            None => (Vec::new(), Vec::new()),
            Some(w) => {
                let mut vertex = w.base_vertex.clone();
                vertex.resize(pm.wedge_slots(), NONE);
                let rows = (0..w.base_vertex.len() as u32).collect::<Vec<_>>();
                let mut row = rows;
                row.resize(vertex.len(), NONE);
                (vertex, row)
            }
        };
        let links = if pm.wedges.is_some() {
            let faces: Vec<_> = pm.base_faces.iter().map(|f| f.map(|w| wedge_vertex[w as usize])).collect();
            link_faces(&faces, n0)
        } else {
            link_faces(&pm.base_faces, n0)
        };
        let m0 = pm.base_faces.len();
        debug_assert_eq!(forest.len(), n);
        Front {
            fans: Fans { corners: pm.base_faces.clone(), links },
            base_vertices: n0 as u32,
            base_faces: m0 as u32,
            records: vec![Record { word: LAST, dependents: 0, due: 0 }; n0],
            too_fine: vec![0; n0.div_ceil(64)],
            relied: false,
            index: Index::new(n),
            free: LAST,
            wedge_vertex,
            wedge_row,
            vertices: n0,
            faces: m0,
            touched: vec![0; m0.div_ceil(64)],
            touched_wedges: Vec::new(),
        }
    }

    /// Faces now.
    pub(crate) fn face_count(&self) -> usize {
        self.faces
    }

    /// Vertices now.
    pub(crate) fn vertex_count(&self) -> usize {
        self.vertices
    }

    /// The index buffer, free slots included.
    pub(crate) fn corners(&self) -> &[[u32; 3]] {
        &self.fans.corners
    }

    /// The record of vertex `v`, which is in the mesh.
    #[inline]
    pub(super) fn record_of_vertex(&self, v: u32) -> u32 {
        v.checked_sub(self.base_vertices).map_or(v, |i| self.record(i))
    }

    /// The record of split `i`; [`NONE`] if it is not applied.
    #[inline]
    pub(super) fn record(&self, i: u32) -> u32 {
        self.index.find(i)
    }

    /// How many splits of a record's vertex are applied, given its chain, and which comes next; [`NONE`] if none does.
    #[inline(always)]
    pub(super) fn next_of_record(&self, record: Record, chain: Run<'_>) -> (usize, u32) {
        match record.turns() {
            Some(n) => (n as usize, chain.get(n as usize).unwrap_or(NONE)),
            None => self.next_of(chain),
        }
    }

    /// Split `i` of a vertex with this record has been undone, the last of its chain that was applied.
    #[inline]
    pub(super) fn count_back(&mut self, forest: &Forest, (v, i): (u32, u32), record: u32) {
        self.records[record as usize].count_back(|| forest.chain(v).get(SOME as usize - 1) == Some(i));
    }

    /// The vertex of a record that is not free.
    #[inline]
    pub(super) fn vertex_of_record(&self, r: u32) -> u32 {
        if r < self.base_vertices { r } else { self.base_vertices + self.records[r as usize].made() }
    }

    /// The first slot of a record of a split.
    #[inline]
    pub(super) fn first_slot(&self, r: u32) -> u32 {
        self.base_faces + 2 * (r - self.base_vertices)
    }

    /// The record of a slot that is none of the base's.
    #[inline]
    fn record_of_slot(&self, slot: u32) -> u32 {
        self.base_vertices + (slot - self.base_faces) / 2
    }

    /// The face in a slot; [`NONE`] for none.
    #[inline]
    pub(crate) fn face_in(&self, forest: &Forest, slot: u32) -> u32 {
        let Some(k) = slot.checked_sub(self.base_faces) else { return slot };
        let Some(record) = self.records.get((self.base_vertices + k / 2) as usize) else { return NONE };
        if record.is_free() || (k % 2 == 1 && !forest.two_faces(record.made())) {
            return NONE;
        }
        forest.first_face(record.made()) + k % 2
    }

    /// The slot of face `f`; [`NONE`] if it is not in the mesh.
    #[inline]
    pub(crate) fn slot_of(&self, forest: &Forest, f: u32) -> u32 {
        if f < self.base_faces {
            return f;
        }
        let Some((i, second)) = forest.maker_of_face(f) else { return NONE };
        match self.record(i) {
            NONE => NONE,
            record => self.first_slot(record) + second as u32,
        }
    }

    /// The face across edge `k` of the face in a slot.
    pub(crate) fn across(&self, slot: u32, k: usize) -> Option<u32> {
        Some(self.fans.links[slot as usize][k]).filter(|&l| l != NONE).map(|l| l >> 3)
    }

    /// Split `i` is applied.
    #[inline]
    pub(crate) fn is_applied(&self, i: u32) -> bool {
        self.index.has(i)
    }

    /// A bit for every split: it is applied.
    pub(crate) fn applied_bits(&self) -> impl Iterator<Item = u64> + '_ {
        self.index.words()
    }

    /// Vertex `v` is in the mesh.
    #[inline]
    pub(crate) fn has(&self, v: u32) -> bool {
        v.checked_sub(self.base_vertices).is_none_or(|i| self.is_applied(i))
    }

    /// How many splits of the chain of vertex `v` are applied: the first ones.
    #[inline]
    pub(crate) fn turns(&self, forest: &Forest, v: u32) -> usize {
        self.turns_of(forest.chain(v))
    }

    /// How many splits of a chain are applied.
    #[inline(always)]
    fn turns_of(&self, chain: Run<'_>) -> usize {
        self.next_of(chain).0
    }

    /// The same, and the split that comes next; [`NONE`] if there is none.
    #[inline(always)]
    pub(super) fn next_of(&self, chain: Run<'_>) -> (usize, u32) {
        // The first ones are: of the first few all are asked, as what a branch would wait for cannot be foreseen. Few chains have more.
        let head: [u32; SHORT] = std::array::from_fn(|k| chain.get(k).unwrap_or(NONE));
        let applied = head.iter().filter(|&&j| j != NONE && self.is_applied(j)).count();
        if let Some(&next) = head.get(applied) {
            return (applied, next);
        }
        let applied = chain.partition_point(|j| self.is_applied(j));
        (applied, chain.get(applied).unwrap_or(NONE))
    }

    /// The node that vertex `v` is at; [`NONE`] if it is not in the mesh.
    pub(crate) fn node(&self, forest: &Forest, v: u32) -> u32 {
        if self.has(v) { forest.node_after(v, self.turns(forest, v)) } else { NONE }
    }

    /// The vertex of wedge `w`, which is in the mesh.
    #[inline]
    pub(crate) fn wedge_vertex(&self, w: u32) -> u32 {
        if self.wedge_vertex.is_empty() { w } else { self.wedge_vertex[w as usize] }
    }

    /// The row of wedge `w`; [`NONE`] if it is not in the mesh, or without attributes.
    #[inline]
    pub(crate) fn wedge_row(&self, w: u32) -> u32 {
        self.wedge_row.get(w as usize).copied().unwrap_or(NONE)
    }

    /// Applies split `i`, whose dependencies are applied, and returns its record. `note` is told, for every row that changes a wedge, the row that it had before if that is not the
    /// one that the forest guesses. O(valence).
    ///
    /// Errors: damage; nothing has changed then. Of a hierarchy that was made whole there is none.
    pub(crate) fn split(
        &mut self,
        pm: &ProgressiveMesh,
        forest: &Forest,
        i: u32,
        note: Option<&mut Vec<[u32; 2]>>,
    ) -> Result<u32, Damage> {
        self.split_at(pm, forest, (i, [NONE; 2]), note)
    }

    /// Where the cuts of split `i` lie, as `slot * 4 + edge`; [`NONE`] where the face is not there, or there is no cut.
    #[inline]
    pub(super) fn cuts(&self, pm: &ProgressiveMesh, forest: &Forest, i: u32) -> [u32; 2] {
        let of = |cut: u32| match self.slot_of(forest, cut >> 2) {
            NONE => NONE,
            slot => slot << 2 | cut & 3,
        };
        [of(pm.splits.left[i as usize]), of(pm.splits.right[i as usize])]
    }

    /// Reads the faces of cuts and those across them.
    #[inline]
    pub(super) fn fetch(&self, cuts: [u32; 2]) -> u32 {
        let link = |slot: u32, k: u32| self.fans.links.get(slot as usize).map_or(NONE, |l| l[k as usize]);
        let corner = |slot: u32| self.fans.corners.get(slot as usize).map_or(0, |c| c[0]);
        let mut sum = 0;
        for cut in cuts {
            let across = if cut == NONE { NONE } else { link(cut >> 2, cut & 3) } >> 3;
            sum ^= corner(cut >> 2) ^ link(across, 0) ^ corner(across);
        }
        sum
    }

    /// Reads the first face of split `i`, which is applied, and those around it.
    #[inline]
    pub(super) fn fetch_made(&self, i: u32) -> u32 {
        let slot = self.first_slot(self.record(i)) as usize;
        let link = |slot: usize| self.fans.links.get(slot).copied().unwrap_or([NONE; 3]);
        let corner = |slot: usize| self.fans.corners.get(slot).map_or(0, |c| c[0]);
        let around = link(slot).map(|l| (l >> 3) as usize);
        around.iter().fold(corner(slot), |sum, &s| sum ^ link(s)[0] ^ corner(s))
    }

    /// As [`Front::split`], with what [`Front::cuts`] has found; what it has not is looked for again.
    #[inline]
    pub(super) fn split_at(
        &mut self,
        pm: &ProgressiveMesh,
        forest: &Forest,
        (i, found): (u32, [u32; 2]),
        note: Option<&mut Vec<[u32; 2]>>,
    ) -> Result<u32, Damage> {
        let k = i as usize;
        let (known, explicit) = known(pm, forest, i)?;
        let here = |cut: u32, found: u32| match found {
            NONE => match self.slot_of(forest, cut >> 2) {
                NONE => Err(Damage::Reference { what: "split", at: k, to: cut }),
                slot => Ok(slot << 2 | cut & 3),
            },
            found => Ok(found),
        };
        let two = known.code.two_faces();
        let left = here(pm.splits.left[k], found[0])?;
        let cuts = (left, if two { here(pm.splits.right[k], found[1])? } else { NONE });
        let [first, _] = patch::split(
            &mut Whole { front: self, pm, forest, note },
            &known,
            cuts,
            explicit.as_ref().unwrap_or(&NO_ENTRY),
        )?;
        self.faces += 1 + two as usize;
        self.vertices += 1;
        Ok(self.record_of_slot(first))
    }

    /// Undoes split `i`, which is applied, and on which nothing applied depends. O(valence).
    pub(crate) fn unsplit(&mut self, pm: &ProgressiveMesh, forest: &Forest, i: u32) {
        debug_assert!(self.is_applied(i));
        // It was read when it was applied.
        let Ok((known, explicit)) = known(pm, forest, i) else { return };
        let two = known.code.two_faces();
        let first = self.first_slot(self.record(i));
        let slots = [first, first + two as u32];
        patch::unsplit(
            &mut Whole { front: self, pm, forest, note: None },
            &known,
            slots,
            explicit.as_ref().unwrap_or(&NO_ENTRY),
        );
        self.faces -= 1 + two as usize;
        self.vertices -= 1;
    }

    /// The slots of the faces around the vertex that `start` is seen from, each once.
    pub(crate) fn star(&self, start: Half, out: &mut Vec<u32>) {
        out.push(start.face());
        let mut at = start.turn();
        // The fan is a cycle, or ends at a border: then the other side as well.
        for _ in 0..self.fans.corners.len() {
            let Some(h) = self.fans.across(at) else { break };
            if h.face() == start.face() {
                return;
            }
            out.push(h.face());
            at = h.turn();
        }
        at = start;
        for _ in 0..self.fans.corners.len() {
            let Some(h) = self.fans.across(at).filter(|h| h.face() != start.face()) else { break };
            out.push(h.face());
            at = h.turn();
        }
    }

    /// The slots of the faces around the vertex of split `i`, whose dependencies are applied: those of the fan that it opens. O(valence).
    ///
    /// Errors: its left cut is not there.
    pub(crate) fn ring(
        &self,
        pm: &ProgressiveMesh,
        forest: &Forest,
        i: u32,
        out: &mut Vec<u32>,
    ) -> Result<(), Damage> {
        let cut = pm.splits.left[i as usize];
        let slot = self.slot_of(forest, cut >> 2);
        if slot == NONE || cut & 3 == 3 {
            return Err(Damage::Reference { what: "split", at: i as usize, to: cut });
        }
        let starts = pm.splits.code[i as usize].left_starts();
        self.star(Half::new(slot, cut & 3, starts), out);
        Ok(())
    }

    /// The edge, seen from the old vertex and from the new one, between the faces that split `i` (applied) has made.
    pub(crate) fn middle(&self, pm: &ProgressiveMesh, i: u32) -> [Half; 2] {
        let fl = self.first_slot(self.record(i));
        let (a, vu_next) = pm.splits.code[i as usize].left();
        let edge = (a as u32 + 1) % 3;
        [Half::new(fl, edge, !vu_next), Half::new(fl, edge, vu_next)]
    }

    /// An edge at the old vertex of split `i` (applied) beside its left face, in a face that stays.
    pub(crate) fn beside(&self, pm: &ProgressiveMesh, i: u32) -> Option<Half> {
        let fl = self.first_slot(self.record(i));
        let at = self.fans.opening_of(fl, pm.splits.code[i as usize].left());
        at.inner.or(at.outer)
    }

    #[inline]
    pub(super) fn touch(&mut self, slot: u32) {
        self.touched[slot as usize / 64] |= 1 << (slot % 64);
    }

    /// A record for split `i`, with two slots.
    #[inline]
    fn take_record(&mut self, i: u32) -> u32 {
        let new = Record { word: i, dependents: 0, due: 0 };
        let r = if self.free == LAST {
            self.fans.corners.extend([[0; 3]; 2]);
            self.fans.links.extend([[NONE; 3]; 2]);
            let slots = self.fans.corners.len() as u32;
            self.touched.resize(slots.div_ceil(64) as usize, 0);
            (slots - 2..slots).for_each(|slot| self.touch(slot));
            self.records.push(new);
            self.too_fine.resize(self.records.len().div_ceil(64), 0);
            self.records.len() as u32 - 1
        } else {
            let r = self.base_vertices + self.free;
            self.free = self.records[r as usize].made();
            self.records[r as usize] = new;
            r
        };
        self.index.insert(i, r);
        r
    }

    #[inline]
    fn leave_record(&mut self, r: u32, i: u32) {
        self.index.remove(i);
        self.records[r as usize].word = FREE | self.free;
        self.free = r - self.base_vertices;
    }

    /// Notes of a record that has been looked at whether what comes next is too fine, and that is all.
    #[inline]
    pub(super) fn set_too_fine(&mut self, r: u32, is: bool) {
        let word = &mut self.too_fine[r as usize / 64];
        *word = *word & !(1 << (r % 64)) | u64::from(is) << (r % 64);
    }

    /// Lenses have come nearer: what was too fine need not be any more, and is due where its time was set by that.
    pub(super) fn look_at_what_was_too_fine(&mut self, now: u16) {
        if std::mem::take(&mut self.relied) {
            for (block, &bits) in self.records.chunks_mut(64).zip(&self.too_fine) {
                (0..).zip(block).filter(|(k, _)| bits >> k & 1 != 0).for_each(|(_, r)| r.due = now);
            }
        }
        self.too_fine.fill(0);
    }

    /// Bytes that grow with the mesh shown, and bytes that each view takes for the whole mesh.
    pub(crate) fn bytes(&self) -> (usize, usize) {
        let (index, blocks) = self.index.bytes();
        let shown = 12 * (self.fans.corners.capacity() + self.fans.links.capacity())
            + size_of::<Record>() * self.records.capacity()
            + 8 * self.too_fine.capacity()
            + index
            + 8 * self.touched.capacity()
            + 4 * self.touched_wedges.capacity();
        let tables = self.wedge_vertex.len() + self.wedge_row.len();
        (shown, 4 * tables + blocks)
    }
}

/// What is to be known of split `i`, and its entry of the explicit stream.
#[inline]
fn known(pm: &ProgressiveMesh, forest: &Forest, i: u32) -> Result<(Known, Option<Explicit>), Damage> {
    let k = i as usize;
    let (code, new_vertex) = (pm.splits.code[k], forest.base_vertices + i);
    let rows = forest.rows.as_ref().map(|r| r.of(pm, i));
    let known = Known {
        split: i,
        vertex: pm.splits.vertex[k],
        new_vertex,
        code,
        wedge: rows.map_or(new_vertex, |r| r.wedge),
        row: rows.map_or(0, |r| r.row),
    };
    let explicit = match (code.kind(), &pm.wedges, rows) {
        (SplitKind::Explicit, Some(s), Some(r)) => {
            let entry = Explicit::read(&s.explicit, r.explicit as usize, code.two_faces(), r.wedge);
            Some(entry.ok_or(Damage::Wedges(k))?)
        }
        (SplitKind::Explicit, ..) => return Err(Damage::Fan(k)),
        _ => None,
    };
    Ok((known, explicit))
}

/// A front with the mesh that it is of.
struct Whole<'a, 'n> {
    front: &'a mut Front,
    pm: &'a ProgressiveMesh,
    forest: &'a Forest,
    note: Option<&'n mut Vec<[u32; 2]>>,
}

impl Sheet for Whole<'_, '_> {
    #[inline]
    fn fans(&self) -> &Fans {
        &self.front.fans
    }

    #[inline]
    fn fans_mut(&mut self) -> &mut Fans {
        &mut self.front.fans
    }

    #[inline]
    fn has_rows(&self) -> bool {
        self.forest.rows.is_some()
    }

    #[inline]
    fn wedge_vertex(&self, w: u32) -> u32 {
        self.front.wedge_vertex(w)
    }

    #[inline]
    fn set_wedge_vertex(&mut self, w: u32, vertex: u32) {
        self.front.wedge_vertex[w as usize] = vertex;
    }

    #[inline]
    fn give_row(&mut self, _: &Known, w: u32, row: u32) {
        self.front.wedge_row[w as usize] = row;
    }

    #[inline]
    fn change_row(&mut self, of: &Known, w: u32, row: u32) {
        let before = std::mem::replace(&mut self.front.wedge_row[w as usize], row);
        if let (Some(note), Some(rows)) = (&mut self.note, &self.forest.rows)
            && rows.guess(self.pm, self.forest, of.split, w) != before
        {
            note.push([row, before]);
        }
    }

    #[inline]
    fn restore_row(&mut self, of: &Known, w: u32, row: u32) {
        let rows = self.forest.rows.as_ref();
        let before = rows.map_or(NONE, |r| r.before(self.pm, self.forest, (of.split, row), w));
        self.front.wedge_row[w as usize] = before;
    }

    #[inline]
    fn drop_row(&mut self, w: u32) {
        self.front.wedge_row[w as usize] = NONE;
    }

    #[inline]
    fn take_slots(&mut self, of: &Known) -> [u32; 2] {
        let record = self.front.take_record(of.split);
        let first = self.front.first_slot(record);
        [first, first + 1]
    }

    #[inline]
    fn leave_slots(&mut self, of: &Known, [first, _]: [u32; 2]) {
        let record = self.front.record_of_slot(first);
        self.front.leave_record(record, of.split);
    }

    #[inline]
    fn touch(&mut self, slot: u32) {
        self.front.touch(slot);
    }

    #[inline]
    fn touch_wedge(&mut self, w: u32) {
        self.front.touched_wedges.push(w);
    }

    #[inline]
    fn touch_vertex(&mut self, vertex: u32, h: Half) {
        if self.has_rows() {
            let Front { fans, touched_wedges, .. } = &mut *self.front;
            fans.each_wedge_around(h, |w| touched_wedges.push(w));
        } else {
            self.front.touched_wedges.push(vertex);
        }
    }
}
