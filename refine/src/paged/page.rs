//! Chunks of splits as they are held, and the base.

use super::sight::{self, Sight};
use super::visible::{self, Extent};
use crate::aif::{NONE, Positions};
use crate::format::pages::{self, BaseLinks, Links, Lists};
use crate::format::{Gaps, MeshHead, SplitBlock};
use crate::hierarchy::{Packed, SplitRows};
use crate::progressive::{ProgressiveMesh, SplitCode, SplitKind};
use crate::selective::Entry;
use glam::{DVec3, Vec3};

/// Where a row of attributes is: the page, or [`NONE`] for the base, and its number there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RowRef {
    pub(super) page: u32,
    pub(super) row: u32,
}

impl RowRef {
    pub(super) const NOTHING: RowRef = RowRef { page: NONE, row: NONE };
}

/// The base and what is applied at its vertices.
#[derive(Debug)]
pub(super) struct Base {
    pub(super) mesh: ProgressiveMesh,
    pub(super) links: BaseLinks,
    /// The node that each vertex is at.
    pub(super) node: Vec<u32>,
    pub(super) wedge_vertex: Vec<u32>,
    pub(super) wedge_row: Vec<RowRef>,
}

impl Base {
    /// The faces of `mesh` are those of a view: it has none here.
    pub(super) fn new(mut mesh: ProgressiveMesh, links: BaseLinks) -> Base {
        let n0 = mesh.base_vertices() as u32;
        let wedge_vertex = mesh.wedges.as_mut().map_or(Vec::new(), |w| std::mem::take(&mut w.base_vertex));
        let wedge_row = (0..wedge_vertex.len() as u32).map(|row| RowRef { page: NONE, row }).collect();
        Base { links, node: (0..n0).collect(), wedge_vertex, wedge_row, mesh }
    }

    pub(super) fn vertices(&self) -> usize {
        self.node.len()
    }

    pub(super) fn bytes(&self) -> usize {
        self.mesh.bytes()
            + 4 * (self.links.next.capacity() + self.node.capacity() + self.wedge_vertex.capacity())
            + size_of::<Packed>() * self.links.bounds.capacity()
            + size_of::<RowRef>() * self.wedge_row.capacity()
            + size_of::<Self>()
    }
}

/// What the file says of a split, one line of memory: what is asked of one is asked together, far from what was asked before.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Record {
    pub(super) vertex: u32,
    /// Its cuts: edges of faces that are numbered as if every split made two, so that who made them is told by the number.
    pub(super) left: u32,
    pub(super) right: u32,
    /// The node that it replaces.
    pub(super) parent: u32,
    /// The split that replaces each of both nodes that it makes, and its bounds; [`NONE`] for a leaf.
    pub(super) next: [u32; 2],
    pub(super) bounds: [Packed; 2],
    /// Where its new vertex stands, if places are single.
    place: [f32; 3],
    pub(super) code: SplitCode,
}

/// A chunk of splits, with what is applied of it.
#[derive(Debug)]
pub(super) struct Page {
    pub(super) first: u32,
    pub(super) first_face: u32,
    pub(super) first_wedge: u32,
    pub(super) of: Vec<Record>,
    /// The record in the pool of every split that is asked for or drawn; [`NONE`] of others.
    pub(super) hot: Vec<u32>,
    /// Splits of the closure that is being gathered, a bit each.
    marked: Vec<u64>,
    /// Of which splits the new vertices are in the mesh, a bit each: so that those are found without reading the others.
    pub(super) there: Vec<u64>,
    /// Where new vertices stand, if places are double.
    places: Vec<[f64; 3]>,
    /// About the new vertices of as many splits, and about them all.
    pub(super) boxes: Vec<Extent>,
    moved_positions: Positions,
    /// Moved vertices before every 64th split.
    moved_before: Vec<u32>,
    /// Some of the splits of later chunks that replace nodes made here, ascending, by which pages are known some frames before they are needed, and what they lead to.
    pub(super) known: Vec<Entry>,
    pub(super) sights: Vec<Sight>,
    /// By the ring rule what splits depend on beside what makes their vertex and their cuts, and their turns.
    pub(super) further: Lists,
    pub(super) rows: Vec<f32>,
    pub(super) present: Vec<u64>,
    pub(super) explicit: Vec<u32>,
    /// Where every split has its attributes, within this page; empty without.
    pub(super) split_rows: Vec<SplitRows>,
    pub(super) material: Vec<u32>,
    pub(super) group: Vec<u32>,
    // What is applied.
    pub(super) wedge_vertex: Vec<u32>,
    pub(super) wedge_row: Vec<RowRef>,
    /// Of a row that changes a wedge, the one before.
    pub(super) row_before: Vec<RowRef>,
    /// Splits that are drawn or asked for: as long as there are any, the page stays.
    pub(super) in_use: usize,
    /// Since the last step of a geomorph by time some have begun or ceased to be asked for.
    pub(super) turned: bool,
    /// Splits that lingered after it.
    pub(super) lingered: usize,
    /// When it was used last.
    pub(super) stamp: u64,
}

impl Page {
    /// `None`: damage.
    pub(super) fn new(
        head: &MeshHead,
        origin: DVec3,
        block: SplitBlock,
        own: Vec<Packed>,
        links: Links,
    ) -> Option<Page> {
        let (count, faces) = (block.splits.len(), block.faces());
        let n0 = head.base_vertices;
        let mut face = block.first_face;
        for k in 0..count {
            let i = block.first + k as u32;
            // All that a split refers to was made before it.
            let before = |cut: u32| cut == NONE || cut >> 2 < face;
            let (l, r) = (block.splits.left[k], block.splits.right[k]);
            if block.splits.vertex[k] >= n0 + i || l == NONE || !before(l) || !before(r) {
                return None;
            }
            face += 1 + block.splits.code[k].two_faces() as u32;
        }
        let with_rows = head.channels.is_some();
        let stride: usize = head.channels.iter().flatten().map(|c| c.width).sum();
        let split_rows = if with_rows { split_rows(&block, stride)? } else { Vec::new() };
        let mut moved_before = Vec::with_capacity(count.div_ceil(64));
        let mut moved = 0;
        for (k, code) in block.splits.code.iter().enumerate() {
            if k % 64 == 0 {
                moved_before.push(moved);
            }
            moved += code.moves() as u32;
        }
        if moved as usize != block.moved_positions.len() || block.new_positions.len() != count {
            return None;
        }
        let per_face = |values: &Vec<u32>, has: bool| values.len() == if has { faces } else { 0 };
        if !per_face(&block.face_material, head.materials) || !per_face(&block.face_group, head.groups) {
            return None;
        }
        let wedges = if with_rows { block.wedges as usize } else { 0 };
        let rows = block.present.len();
        let fit = |mut p: Positions| {
            match &mut p {
                Positions::F32(v) => v.shrink_to_fit(),
                Positions::F64(v) => v.shrink_to_fit(),
            }
            p
        };
        if [links.parent.len(), links.next.len(), own.len()] != [count; 3] {
            return None;
        }
        let mut gaps = Gaps::default();
        let mut by_maker = |cut: u32| match head.maker_near(cut >> 2, &mut gaps) {
            Some((i, second)) if cut != NONE => (head.base_faces + 2 * i + second as u32) << 2 | cut & 3,
            _ => cut,
        };
        // By the ring rule what is needed has an earlier turn, or is in another chunk.
        let turns = &links.further.turns;
        let earlier = |k: usize, needed: Option<u32>| match needed.and_then(|d| d.checked_sub(block.first)) {
            Some(j) => turns.get(j as usize).is_none_or(|&t| t < turns[k]),
            None => true,
        };
        let of_cut = |cut: u32| match head.maker(cut >> 2) {
            Some((i, _)) if cut != NONE => Some(i),
            _ => None,
        };
        let in_turn = |k: usize| {
            let parent = links.parent[k].checked_sub(n0).map(|p| p / 2);
            let s = &block.splits;
            [parent, of_cut(s.left[k]), of_cut(s.right[k])].into_iter().all(|needed| earlier(k, needed))
        };
        if turns.len() == count && !(0..count).all(in_turn) {
            return None;
        }
        let place = |k: usize| (block.new_positions.get(k) - origin).as_vec3();
        let vertex = |k: usize| {
            let maker = block.splits.vertex[k].checked_sub(n0)?.checked_sub(block.first)?;
            Some(maker as usize)
        };
        let known = sight::known(block.first, (&own, &links), place, vertex);
        // Of a later chunk's it says itself; what it does not say is none.
        let bounds_of = |next: u32| match next.checked_sub(block.first).and_then(|k| own.get(k as usize)) {
            _ if next == NONE => Some(Packed::default()),
            Some(&b) => Some(b),
            None => {
                let at = links.outside.binary_search_by_key(&next, |o| o.0).ok()?;
                Some(links.outside[at].1)
            }
        };
        let ahead = |next: u32| bounds_of(next).map_or((NONE, Packed::default()), |b| (next, b));
        let of = (0..count).map(|k| {
            let ((a, of_a), (b, of_b)) = (ahead(links.next[k][0]), ahead(links.next[k][1]));
            Record {
                vertex: block.splits.vertex[k],
                left: by_maker(block.splits.left[k]),
                right: by_maker(block.splits.right[k]),
                parent: links.parent[k],
                next: [a, b],
                bounds: [of_a, of_b],
                place: match &block.new_positions {
                    Positions::F32(p) => p[k],
                    Positions::F64(_) => [0.0; 3],
                },
                code: block.splits.code[k],
            }
        });
        let of = of.collect();
        let boxes = visible::boxes((0..count).map(|k| block.new_positions.get(k)));
        fn shrink<T>(mut v: Vec<T>) -> Vec<T> {
            v.shrink_to_fit();
            v
        }
        Some(Page {
            first: block.first,
            first_face: block.first_face,
            first_wedge: block.first_wedge,
            of,
            hot: vec![NONE; count],
            marked: vec![0; count.div_ceil(64)],
            there: vec![0; count.div_ceil(64)],
            places: match block.new_positions {
                Positions::F32(_) => Vec::new(),
                Positions::F64(p) => shrink(p),
            },
            boxes,
            moved_positions: fit(block.moved_positions),
            moved_before,
            known,
            sights: Vec::new(),
            further: links.further,
            rows: shrink(block.rows),
            present: shrink(block.present),
            explicit: shrink(block.explicit),
            split_rows,
            material: shrink(block.face_material),
            group: shrink(block.face_group),
            wedge_vertex: vec![NONE; wedges],
            wedge_row: vec![RowRef::NOTHING; wedges],
            row_before: vec![RowRef::NOTHING; rows],
            in_use: 0,
            turned: false,
            lingered: 0,
            stamp: 0,
        })
    }

    /// Marks split `k` of the page as gathered, or not.
    #[inline]
    pub(super) fn mark(&mut self, k: usize, on: bool) {
        set_bit(&mut self.marked, k, on);
    }

    #[inline]
    pub(super) fn is_marked(&self, k: usize) -> bool {
        self.marked[k / 64] >> (k % 64) & 1 != 0
    }

    /// The new vertex of split `k` of the page is in the mesh, or not.
    #[inline]
    pub(super) fn set_there(&mut self, k: usize, on: bool) {
        set_bit(&mut self.there, k, on);
    }

    /// The vertices made here that are in the mesh, by the splits that make them, ascending.
    pub(super) fn vertices(&self) -> impl Iterator<Item = u32> + '_ {
        let from = self.first;
        self.there.iter().zip((from..).step_by(64)).filter(|(w, _)| **w != 0).flat_map(|(&word, from)| {
            let mut left = word;
            std::iter::from_fn(move || {
                let bit = (left != 0).then(|| left.trailing_zeros())?;
                left &= left - 1;
                Some(from + bit)
            })
        })
    }

    /// Where the new vertex of split `k` of the page stands.
    #[inline]
    pub(super) fn place(&self, k: usize) -> DVec3 {
        match self.places.get(k) {
            Some(&p) => DVec3::from_array(p),
            None => Vec3::from_array(self.of[k].place).as_dvec3(),
        }
    }

    /// Where split `k` of the page puts the vertex that it splits, if it moves it.
    #[inline]
    pub(super) fn moved(&self, k: usize) -> Option<DVec3> {
        self.of[k].code.moves().then(|| {
            let from = k / 64 * 64;
            let before = self.of[from..k].iter().filter(|r| r.code.moves()).count();
            self.moved_positions.get(self.moved_before[k / 64] as usize + before)
        })
    }

    /// Bytes held: the sum of all capacities.
    pub(super) fn bytes(&self) -> usize {
        fn of<T>(v: &Vec<T>) -> usize {
            v.capacity() * size_of::<T>()
        }
        let points = |p: &Positions| match p {
            Positions::F32(v) => of(v),
            Positions::F64(v) => of(v),
        };
        of(&self.of)
            + of(&self.hot)
            + of(&self.marked)
            + of(&self.there)
            + of(&self.places)
            + of(&self.boxes)
            + points(&self.moved_positions)
            + of(&self.moved_before)
            + of(&self.known)
            + of(&self.sights)
            + of(&self.further.starts)
            + of(&self.further.on)
            + of(&self.further.turns)
            + of(&self.rows)
            + of(&self.present)
            + of(&self.explicit)
            + of(&self.split_rows)
            + of(&self.material)
            + of(&self.group)
            + of(&self.wedge_vertex)
            + of(&self.wedge_row)
            + of(&self.row_before)
            + size_of::<Self>()
    }

    /// The most that a page can take, told by the directory: what its chunks say of themselves (`raw`), and the counts; `point`: bytes of a place.
    pub(super) fn most_bytes(raw: u64, page_raw: u64, point: u64, count: u32, wedges: u32) -> usize {
        let (count, wedges) = (count as u64, wedges as u64);
        let outside = page_raw.saturating_sub(pages::SPLIT * count);
        // Moved places, rows and what names faces; rows are at least 8 bytes each, and need as many for what they were before.
        let others = raw.saturating_sub((18 + point) * count);
        let attributes = 12 * count * (wedges > 0) as u64 + 12 * wedges + others;
        let places = if point > 12 { point * count } else { 0 };
        let boxes = size_of::<Extent>() as u64 * (count.div_ceil(visible::EACH as u64) + 1);
        let records = (size_of::<Record>() as u64 + 4) * count + count.div_ceil(64) * (4 + 8 + 8) + boxes;
        let all = outside + sight::most_bytes(count) + others + attributes + places + records;
        usize::try_from(all).unwrap_or(usize::MAX / 4) + size_of::<Page>() + 64
    }
}

#[inline]
fn set_bit(of: &mut [u64], k: usize, on: bool) {
    let (word, bit) = (&mut of[k / 64], 1 << (k % 64));
    *word = if on { *word | bit } else { *word & !bit };
}

/// Where the attributes of each split of a block are. `None` if they are not all there.
fn split_rows(block: &SplitBlock, stride: usize) -> Option<Vec<SplitRows>> {
    let (mut wedge, mut row, mut at) = (block.first_wedge, 0u32, 0usize);
    let mut all = Vec::with_capacity(block.splits.len());
    for code in &block.splits.code {
        all.push(SplitRows { wedge, row, explicit: at as u32 });
        let twice = code.changes_rows() as u32;
        let (new, changed) = match code.kind() {
            SplitKind::Plain => (1, twice),
            SplitKind::Seam => (2, 2 * twice),
            SplitKind::Explicit => {
                let &[pairs, changed] = block.explicit.get(at..at + 2)? else { return None };
                let ids = 2 * pairs as usize + changed as usize + 3 + 3 * code.two_faces() as usize;
                let entry = block.explicit.get(at + 2..(at + 2).checked_add(ids)?)?;
                at += 2 + ids;
                let fresh = entry[..2 * pairs as usize].chunks_exact(2).filter(|p| p[1] >= wedge).count();
                (fresh as u32, changed)
            }
        };
        wedge = wedge.checked_add(new)?;
        row = row.checked_add(new)?.checked_add(changed)?;
    }
    let fits = row as usize == block.present.len()
        && block.rows.len() == row as usize * stride
        && wedge - block.first_wedge == block.wedges;
    fits.then_some(all)
}
