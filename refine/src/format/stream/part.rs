//! A part on the path: its splits coded, and the links behind them.

use super::super::container::{Chunk, ChunkType};
use super::super::direct::{self, Rows};
use super::super::pages;
use super::super::places;
use super::super::splits::{error_level, rounded_error, without_arrangement};
use super::super::write::{Part, bounds_beside, part};
use super::order::Order;
use super::{NO_BOUNDS, Next, Path, Vertex};
use crate::aif::{NONE, Positions};
use crate::hierarchy::{Bounds, Cone, Packed, pack_up};
use crate::progressive::Splits;
use crate::view::NormalCone;
use rustc_hash::FxHashMap;

/// The splits of a part, in any order that they may have. Vertices and faces are numbered on from those of the path.
#[derive(Clone, Debug, Default)]
pub struct PathSplits {
    /// The splits. None moves its vertex, or has attributes.
    pub splits: Splits,
    /// Where the vertices stand that they make.
    pub positions: Positions,
    /// Their errors, model units, are in `splits`; here are the radius of each about its vertex, and a cone that holds the normals there. Errors and radii hold those of the splits below even when they
    /// are rounded up to 8 bits of mantissa, as they are stored.
    pub bounds: Vec<(f64, NormalCone)>,
}

/// What became of the numbers of a part's vertices and faces.
#[derive(Clone, Debug)]
pub struct Renumbered {
    vertices: (u32, Vec<u32>),
    faces: (u32, Vec<u32>),
}

impl Renumbered {
    /// The number on the path of a vertex of the part, or of the path before.
    pub fn vertex(&self, v: u32) -> u32 {
        let (known, of) = &self.vertices;
        v.checked_sub(*known).and_then(|k| of.get(k as usize).copied()).unwrap_or(v)
    }

    /// The same of a face.
    pub fn face(&self, f: u32) -> u32 {
        let (known, of) = &self.faces;
        f.checked_sub(*known).and_then(|k| of.get(k as usize).copied()).unwrap_or(f)
    }
}

/// What a part is in the file.
#[derive(Clone, Debug, Default)]
pub struct Written {
    /// Its chunks, for [`super::Tree::begin`].
    pub chunks: Vec<Chunk>,
    /// Their bytes.
    pub bytes: Vec<u8>,
    /// Those of its splits that make one face only, by their numbers in the file.
    pub single: Vec<u32>,
}

/// A part on the path.
#[derive(Clone, Debug, Default)]
pub(super) struct Open {
    /// Its first split in the file.
    file: u32,
    /// What there was before it.
    splits: usize,
    pub(super) vertices: usize,
    faces: usize,
    singles: usize,
    /// Vertices of before, as they were before each split of one.
    pub(super) undo: Vec<(u32, Vertex)>,
    /// In the order of the file: the nodes replaced, and bounds.
    pub(super) parent: Vec<u32>,
    packed: Vec<Packed>,
    /// Chunks of splits, and of their bounds.
    written: Vec<[Part; 2]>,
}

impl Path<'_> {
    /// Adds a part below the one on top, whose splits are those from `file` on, and codes them. `None` if its arrays contradict each other.
    ///
    /// O(n log n) for the part.
    pub fn push(&mut self, given: &PathSplits, file: u32) -> Option<Renumbered> {
        let s = &given.splits;
        let m = s.vertex.len();
        let lengths = [s.left.len(), s.right.len(), s.code.len(), s.error.len(), given.bounds.len()];
        if lengths.iter().any(|&n| n != m) || given.positions.len() != m {
            return None;
        }
        // The split and the tip of every face the part makes, and the first face of every split.
        let (mut owner, mut tips, mut first_face) = (vec![], vec![], Vec::with_capacity(m));
        for (code, t) in s.code.iter().zip(0..) {
            first_face.push(owner.len() as u32);
            owner.push(t);
            tips.push(code.left().0 as u8);
            if code.two_faces() {
                owner.push(t);
                tips.push(code.right().0 as u8);
            }
        }
        let mut open = Open {
            file,
            splits: self.splits() as usize,
            vertices: self.vertices.len(),
            faces: self.tips.len(),
            singles: self.head.single.len(),
            ..Open::default()
        };
        let (n0, m0) = (self.head.base_vertices, self.head.base_faces);
        let (known, known_faces) = (self.vertices.len() as u32, self.faces());
        let order = self.arrange(given, &owner, file, &mut open)?;
        // Final numbers of faces, by those given.
        let mut faces = vec![NONE; owner.len()];
        let mut next = known_faces;
        for &t in &order.order {
            let first = first_face[t as usize] as usize;
            for f in &mut faces[first..first + 1 + usize::from(s.code[t as usize].two_faces())] {
                *f = next;
                next += 1;
            }
        }
        let vertices: Vec<u32> = order.slot.iter().map(|&k| known + k).collect();
        let numbers = Renumbered { vertices: (known, vertices), faces: (known_faces, faces) };
        // Corners are turned so that the tip comes first.
        let tip = |f: u32| match (f.checked_sub(m0), f.checked_sub(known_faces)) {
            (None, _) => 0,
            (_, Some(k)) => tips.get(k as usize).copied().unwrap_or(0),
            (Some(k), None) => self.tips.get(k as usize).copied().unwrap_or(0),
        };
        let cut = |c: u32| {
            let f = c >> 2;
            if c == NONE { c } else { (numbers.face(f) << 2) | (((c & 3) + 3 - u32::from(tip(f))) % 3) }
        };
        let mut added = Vec::with_capacity(owner.len());
        for (&t, k) in order.order.iter().zip(open.splits as u32..) {
            let t = t as usize;
            let to = &mut self.mesh.splits;
            to.vertex.push(numbers.vertex(s.vertex[t]));
            to.left.push(cut(s.left[t]));
            to.right.push(cut(s.right[t]));
            to.code.push(without_arrangement(s.code[t]));
            to.error.push(s.error[t]);
            let place = places::point(&given.positions, t);
            places::push(self.mesh.new_positions.plain(), place);
            added.push(s.code[t].left().0 as u8);
            if s.code[t].two_faces() {
                added.push(s.code[t].right().0 as u8);
            } else {
                self.head.single.push(k);
            }
            let (radius, cone) = &given.bounds[t];
            open.packed.push(Packed {
                error: pack_up(f64::from(s.error[t])),
                radius: pack_up(*radius),
                cone: Cone::around(cone),
            });
        }
        self.tips.extend(added);
        self.head.splits = self.splits();
        self.names.push([open.splits as u32, file]);
        debug_assert_eq!(self.vertices.len(), (n0 + self.splits()) as usize);
        self.code(&mut open, &order)?;
        self.parts.push(open);
        Some(numbers)
    }

    /// The splits of a chunk as they are in the file.
    fn rows(&self, range: std::ops::Range<usize>, roots: &[u32]) -> Rows {
        let s = &self.mesh.splits;
        let cut = |c: u32| match self.head.maker(c >> 2) {
            Some((i, second)) if c != NONE => {
                (self.head.base_faces + 2 * self.name(i) + u32::from(second)) << 2 | c & 3
            }
            _ => c,
        };
        Rows {
            first: self.name(range.start as u32),
            roots: roots.iter().map(|&v| self.vertex_name(v)).collect(),
            vertex: s.vertex[range.clone()].iter().map(|&v| self.vertex_name(v)).collect(),
            cuts: range.clone().map(|k| [cut(s.left[k]), cut(s.right[k])]).collect(),
            code: s.code[range.clone()].to_vec(),
            level: s.error[range.clone()].iter().map(|&e| error_level(e) as u16).collect(),
            place: range.map(|k| self.mesh.new_positions.get(k).to_array()).collect(),
        }
    }

    /// Codes the chunks of the part that was just added.
    fn code(&mut self, open: &mut Open, order: &Order) -> Option<()> {
        let (mut streams, mut room) = Default::default();
        let point = if self.head.double { 24 } else { 12 };
        let mut at = open.splits;
        for (&count, roots) in order.counts.iter().zip(&order.roots) {
            let rows = self.rows(at..at + count, roots);
            let bytes = direct::write(&self.head, &rows, self.tree.steps, (&mut streams, &mut room))?;
            let mut splits = part(ChunkType::DIRECT, true, 0, (18 + point) * count as u64, bytes);
            let chunk = &mut splits.chunk;
            (chunk.first, chunk.count) = (rows.first, count as u32);
            chunk.band = self.parts.len() as u32;
            let errors = &self.mesh.splits.error[at..at + count];
            chunk.error = errors.iter().map(|&e| rounded_error(e)).fold(0.0, f32::max);
            let own = &open.packed[at - open.splits..at - open.splits + count];
            let bounds = Bounds {
                directions: Vec::new(),
                origin: self.tree.about.0,
                diagonal: self.tree.about.1,
                guarantee: self.tree.guarantee,
                of: own.to_vec(),
                turns: vec![],
            };
            let beside = bounds_beside(&splits, &bounds, 0..count)?;
            open.written.push([splits, beside]);
            at += count;
        }
        Some(())
    }

    /// Takes the part on top away; what is below it has been written, and [`Path::next`] says what comes next at its vertices. Afterwards it says so of those of the mesh before.
    /// `None` if there is no part.
    pub fn pop(&mut self) -> Option<Written> {
        let open = self.parts.pop()?;
        let n0 = self.head.base_vertices;
        let (start, m) = (open.splits, open.parent.len());
        let begin = n0 + 2 * open.file;
        // What replaces the two nodes that each split makes: a split of this part, or one below.
        let mut next = vec![[NONE; 2]; m];
        for (&p, k) in open.parent.iter().zip(open.file..) {
            if let Some(at) = p.checked_sub(begin) {
                next[at as usize / 2][at as usize % 2] = k;
            }
        }
        let mut below = FxHashMap::default();
        let touched = open.undo.iter().map(|u| u.0).chain(open.vertices as u32..self.vertices.len() as u32);
        for v in touched {
            let at = &self.vertices[v as usize];
            if let Some(k) = at.node.checked_sub(begin).filter(|_| at.next.split != NONE) {
                next[k as usize / 2][k as usize % 2] = at.next.split;
                below.insert(at.next.split, at.next.bounds);
            }
        }
        let links = OfPart { open: &open, next: &next, below: &below, begin };
        let single = &self.head.single[open.singles..];
        let mut out = Written {
            single: single.iter().map(|&k| open.file + (k - start as u32)).collect(),
            ..Written::default()
        };
        for [splits, beside] in &open.written {
            let Chunk { first, count, band, error, .. } = splits.chunk;
            let at = (first - open.file) as usize;
            let own = at..at + count as usize;
            let local = &self.mesh.splits.vertex[start + own.start..start + own.end];
            let vertices: Vec<u32> = local.iter().map(|&v| self.vertex_name(v)).collect();
            let own = pages::Own { bounds: &open.packed[own], turns: None };
            let (bytes, raw) = pages::write(&self.tree.head, first, &vertices, own, &links)?;
            let mut page = part(ChunkType::PAGE, false, 0, raw, bytes);
            page.chunk = Chunk { first, count, band, error, ..page.chunk };
            page.chunk.first_face = self.head.base_wedges;
            for p in [splits, beside, &page] {
                out.chunks.push(p.chunk);
                out.bytes.extend_from_slice(&p.bytes);
            }
        }
        // The mesh before.
        self.names.pop();
        let vertex = &self.mesh.splits.vertex;
        let firsts: Vec<(u32, Next)> = (0..m)
            .rev()
            .map(|k| (vertex[start + k], Next { split: open.file + k as u32, bounds: open.packed[k] }))
            .filter(|(v, _)| (*v as usize) < open.vertices)
            .collect();
        for &(v, was) in open.undo.iter().rev() {
            self.vertices[v as usize] = was;
        }
        // The first split of a vertex comes last here.
        firsts.into_iter().for_each(|(v, next)| self.vertices[v as usize].next = next);
        self.vertices.truncate(open.vertices);
        self.tips.truncate(open.faces);
        self.head.single.truncate(open.singles);
        self.head.splits = start as u32;
        let s = &mut self.mesh.splits;
        for column in [&mut s.vertex, &mut s.left, &mut s.right] {
            column.truncate(start);
        }
        s.code.truncate(start);
        s.error.truncate(start);
        match self.mesh.new_positions.plain() {
            Positions::F32(p) => p.truncate(start),
            Positions::F64(p) => p.truncate(start),
        }
        Some(out)
    }

    /// The number in the file of a vertex.
    fn vertex_name(&self, v: u32) -> u32 {
        let n0 = self.head.base_vertices;
        v.checked_sub(n0).map_or(v, |i| n0 + self.name(i))
    }

    /// The number in the file of a split.
    fn name(&self, i: u32) -> u32 {
        let run = self.names.partition_point(|n| n[0] <= i).checked_sub(1);
        run.map_or(i, |k| self.names[k][1] + (i - self.names[k][0]))
    }
}

/// Links of a part.
struct OfPart<'a> {
    open: &'a Open,
    next: &'a [[u32; 2]],
    below: &'a FxHashMap<u32, Packed>,
    /// Its first node.
    begin: u32,
}

impl pages::Source for OfPart<'_> {
    fn parent(&self, i: u32) -> u32 {
        self.open.parent[(i - self.open.file) as usize]
    }

    fn next(&self, node: u32) -> u32 {
        let k = (node - self.begin) as usize;
        self.next[k / 2][k % 2]
    }

    fn bounds(&self, i: u32) -> Packed {
        let own = i.checked_sub(self.open.file).and_then(|k| self.open.packed.get(k as usize));
        own.or_else(|| self.below.get(&i)).copied().unwrap_or(NO_BOUNDS)
    }
}
