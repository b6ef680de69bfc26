//! The blocks of a terrain as chunks of a `.pm`, block by block.

use super::number::{Assembly, Numbers};
use super::{Blocks, BuildError, children, damaged_by, in_rows, name};
use crate::refine::ProgressiveMesh;
use crate::refine::format::ChunkType;
use crate::refine::format::stream::{Next, Path, Tree, Written};
use crate::refine::hierarchy::Guarantee;
use crate::terrain::block::Vertex;
use glam::DVec3;
use std::cmp::Reverse;
use std::io::Write;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Levels from the root down whose blocks are done side by side: below, each goes on with the way from the root that it was given.
const WIDE: u32 = 3;

/// The chunks of a terrain, in its store, and the beginning of a file of them.
pub struct Coded<'a> {
    blocks: &'a Blocks<'a>,
    tree: Tree,
    /// The corners of the box of full detail.
    extent: (DVec3, DVec3),
    /// The base, with what comes next at its vertices.
    next: Vec<Next>,
    /// Of the blocks in the order of the file.
    written: Vec<([u32; 3], Written)>,
}

/// What the threads share.
struct Run<'a> {
    blocks: &'a Blocks<'a>,
    /// The first split of every block of every level.
    firsts: Vec<Vec<u32>>,
    done: AtomicUsize,
    written: Mutex<Vec<([u32; 3], Written)>>,
}

/// The place of a block along a curve that goes from quarter to quarter (Morton 1966), so that what lies below a block stays together.
fn curve([x, y]: [usize; 2]) -> u128 {
    (0..64).fold(0, |sum, k| sum | ((x >> k & 1) as u128) << (2 * k) | ((y >> k & 1) as u128) << (2 * k + 1))
}

fn contradiction() -> BuildError {
    damaged_by("the blocks in it contradict each other".into())
}

impl Blocks<'_> {
    /// Writes the splits of all blocks, as chunks that are read alone, into the store: each level after the one above it in the file, and its blocks quarter by quarter. The same bytes for any number of threads.
    ///
    /// O(splits log splits). Memory: for each thread what is above a block on the way to the root, some 80 B a split.
    ///
    /// # Errors
    /// [`BuildError`].
    pub fn code(&self) -> Result<Coded<'_>, BuildError> {
        let figures = self.figures();
        let layout = &self.work.layout;
        // Where the splits of each block begin: level by level.
        let mut firsts: Vec<Vec<u32>> = self.heads.iter().map(|of| vec![0; of.len()]).collect();
        let mut next = 0u32;
        for level in (0..figures.levels).rev() {
            let mut all: Vec<(u128, usize)> =
                in_rows(layout, level).into_iter().map(curve).zip(0..).collect();
            all.sort_unstable();
            for (_, k) in all {
                firsts[level as usize][k] = next;
                next += self.heads[level as usize][k].collapses;
            }
        }
        let (tree, extent) = self.tree()?;
        let run = Run { blocks: self, firsts, done: AtomicUsize::new(0), written: Mutex::default() };
        let mut path = Path::new(&tree);
        run.visit(&mut path, figures.levels - 1, [0, 0], &Numbers::of(&self.root))?;
        let next = (0..path.vertices()).map(|v| path.next(v)).collect();
        let mut written = run.written.into_inner().unwrap_or_else(PoisonError::into_inner);
        // In the order of the file.
        written.sort_unstable_by_key(|(at, _)| {
            let [level, x, y] = *at;
            (Reverse(level), curve([x as usize, y as usize]))
        });
        Ok(Coded { blocks: self, tree, extent, next, written })
    }

    /// What all parts have in common, and the corners of the box.
    fn tree(&self) -> Result<(Tree, (DVec3, DVec3)), BuildError> {
        // The corners of the box, and a sample of places.
        let levels = self.figures().levels;
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for h in self.heads[0].iter().filter(|h| h.columns[0] <= h.columns[1]) {
            let corner = |k: usize| Vertex { x: h.columns[k], y: h.rows[k], z: h.heights[k] };
            let places = self.frame.places(&[corner(0), corner(1)]);
            let [a, b] = [0, 1].map(|k| places.get(k).to_array());
            low = std::array::from_fn(|k| low[k].min(a[k]));
            high = std::array::from_fn(|k| high[k].max(b[k]));
        }
        let [low, high] = [low, high].map(DVec3::from_array);
        let like = self.frame.places(&self.work.block(levels - 1, [0, 0])?.vertices);
        let base: ProgressiveMesh = self.frame.base(&self.root);
        let splits = self.figures().splits as u32;
        let about = (0.5 * low + 0.5 * high, (high - low).length());
        let tree = Tree::new(base, &like, splits, about, Guarantee::Vertical).ok_or_else(contradiction)?;
        Ok((tree.with_steps(self.frame.steps()), (low, high)))
    }
}

impl Run<'_> {
    fn index(&self, level: u32, at: [usize; 2]) -> usize {
        at[1] * self.blocks.work.layout.blocks(level)[0] + at[0]
    }

    /// Codes a block of whose sheet the numbers on the path are given, and all below.
    fn visit(
        &self,
        path: &mut Path<'_>,
        level: u32,
        at: [usize; 2],
        numbers: &Numbers,
    ) -> Result<(), BuildError> {
        let (work, figures) = (&self.blocks.work, self.blocks.figures());
        if work.control.cancelled() {
            return Err(BuildError::Cancelled);
        }
        let block = work.block(level, at)?;
        let mut assembly = Assembly::new(self.blocks.frame, path.vertices(), path.faces());
        let mut of_children = assembly.add(&block, numbers)?;
        drop(block);
        let first = self.firsts[level as usize][self.index(level, at)];
        let new = path.push(&assembly.part(), first).ok_or_else(contradiction)?;
        for n in &mut of_children {
            n.vertices.iter_mut().for_each(|v| *v = new.vertex(*v));
            n.faces.iter_mut().for_each(|f| *f = new.face(*f));
        }
        drop(new);
        if level > 0 {
            let below: Vec<_> = children(&work.layout, level, at).into_iter().zip(of_children).collect();
            if level + WIDE >= figures.levels {
                let of = &*path;
                let one = |(at, numbers): &([usize; 2], Numbers)| {
                    let mut path = of.clone();
                    self.visit(&mut path, level - 1, *at, numbers)?;
                    Ok::<Vec<_>, BuildError>(numbers.vertices.iter().map(|&v| (v, path.next(v))).collect())
                };
                for (v, next) in super::each(&below, one)?.into_iter().flatten() {
                    path.set_next(v, next);
                }
            } else {
                for (at, numbers) in &below {
                    self.visit(path, level - 1, *at, numbers)?;
                }
            }
        }
        let mut written = path.pop().ok_or_else(contradiction)?;
        let bytes = std::mem::take(&mut written.bytes);
        work.store.put(&name(level, at, "chunks"), &bytes)?;
        let key = [level, at[0] as u32, at[1] as u32];
        self.written.lock().unwrap_or_else(PoisonError::into_inner).push((key, written));
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        work.control.progress(0.8 + 0.2 * done as f64 / figures.blocks as f64);
        Ok(())
    }
}

impl Coded<'_> {
    /// Least and greatest coordinates of the mesh at full detail.
    pub fn extent(&self) -> (DVec3, DVec3) {
        self.extent
    }

    /// Writes the file: a mesh in a `scene`, with chunks of other kinds beside. Returns how many bytes it has.
    ///
    /// # Errors
    /// [`BuildError`]; those of `out` as [`BuildError::Write`].
    pub fn write(
        &self,
        scene: &[u8],
        others: &[(ChunkType, Vec<u8>)],
        out: &mut dyn Write,
    ) -> Result<u64, BuildError> {
        let mut path = Path::new(&self.tree);
        self.next.iter().zip(0..).for_each(|(&next, v)| path.set_next(v, next));
        let single = self.written.iter().flat_map(|w| &w.1.single).copied().collect();
        let chunks = self.written.iter().flat_map(|w| &w.1.chunks).copied().collect();
        let begin = self.tree.begin(&path, single, chunks, scene, others).ok_or_else(contradiction)?;
        out.write_all(&begin).map_err(BuildError::Write)?;
        let mut all = begin.len() as u64;
        for &([level, x, y], _) in &self.written {
            let bytes = self.blocks.work.store.get(&name(level, [x as usize, y as usize], "chunks"))?;
            out.write_all(&bytes).map_err(BuildError::Write)?;
            all += bytes.len() as u64;
        }
        Ok(all)
    }
}
