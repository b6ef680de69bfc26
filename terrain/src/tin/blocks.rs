//! A network improved block by block: vertices that several blocks share stay, and the next pass has its blocks elsewhere.

use super::Control;
use super::field::Field;
use super::network::Network;
use super::parallel;
use super::patch::{NONE, Patch, Rules, Vertex};
use super::scan::{Corner, keeps};
use super::thin::Scratch;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Triangles of a block, on average. Smaller ones lock more vertices, larger ones leave the cache: 1,500 to 6,000 differ by 1 % in
/// time and 0.3 % in triangles (fuji, etopo5).
const TRIANGLES: usize = 3000;

/// What a pass does.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pass {
    /// How far the blocks are shifted, in parts of their size.
    pub shift: f64,
    pub rules: Rules,
    /// Where this pass begins and ends in the whole, for the progress.
    pub done: [f64; 2],
}

/// A block: its vertices, by number, and its triangles of these.
struct Block {
    vertices: Vec<u32>,
    triangles: Vec<[u32; 3]>,
}

/// What became of a block.
struct Improved {
    block: Block,
    /// The heights of its vertices.
    heights: Vec<i32>,
}

impl Network {
    /// Improves all blocks; `None` when cancelled. The same result for any number of threads.
    pub(super) fn improve(&mut self, field: &Field, pass: Pass, control: &dyn Control) -> Option<()> {
        let mut uses = vec![0u32; self.vertices.len()];
        for &v in self.triangles.as_flattened() {
            uses[v as usize] += 1;
        }
        let mut stays = vec![false; self.vertices.len()];
        for &v in self.kept.as_flattened() {
            stays[v as usize] = true;
        }
        let blocks = self.blocks(field, pass.shift);
        let (count, finished) = (blocks.len(), AtomicUsize::new(0));
        let improved = parallel::map(blocks, |block| {
            if control.cancelled() {
                return None;
            }
            let improved = self.improve_block(field, pass.rules, block, &uses, &stays);
            let part = (finished.fetch_add(1, Ordering::Relaxed) + 1) as f64 / count as f64;
            control.progress(pass.done[0] + part * (pass.done[1] - pass.done[0]));
            Some(improved)
        });
        self.triangles.clear();
        for improved in improved {
            let Improved { block, heights } = improved?;
            for (&v, z) in block.vertices.iter().zip(heights) {
                self.vertices[v as usize].z = z;
            }
            self.triangles.extend(block.triangles.iter().map(|t| t.map(|v| block.vertices[v as usize])));
        }
        self.compact();
        Some(())
    }

    /// Divides the triangles by where their centres lie.
    fn blocks(&self, field: &Field, shift: f64) -> Vec<Block> {
        let samples = f64::from(field.columns) * f64::from(field.rows);
        let size = (samples * TRIANGLES as f64 / self.triangles.len().max(1) as f64).sqrt();
        let size = (size.min(65_536.0) as i32).max(16);
        let offset = (f64::from(size) * shift) as i32;
        let across = (field.columns + offset) / size + 1;
        let cell = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| self.vertices[v as usize]);
            let (x, y) = ((a.x + b.x + c.x) / 3 + offset, (a.y + b.y + c.y) / 3 + offset);
            y / size * across + x / size
        };
        let mut order: Vec<(i32, u32)> =
            self.triangles.iter().enumerate().map(|(i, t)| (cell(t), i as u32)).collect();
        order.sort_unstable();
        let mut blocks = vec![];
        for members in order.chunk_by(|a, b| a.0 == b.0) {
            let mut triangles: Vec<[u32; 3]> = members.iter().map(|m| self.triangles[m.1 as usize]).collect();
            let mut vertices = triangles.as_flattened().to_vec();
            vertices.sort_unstable();
            vertices.dedup();
            for v in triangles.as_flattened_mut() {
                *v = vertices.partition_point(|u| u < v) as u32;
            }
            blocks.push(Block { vertices, triangles });
        }
        blocks
    }

    fn improve_block(
        &self,
        field: &Field,
        rules: Rules,
        block: Block,
        uses: &[u32],
        stays: &[bool],
    ) -> Improved {
        let mut inside = vec![0u32; block.vertices.len()];
        for &v in block.triangles.as_flattened() {
            inside[v as usize] += 1;
        }
        let on_border =
            |at: Corner| at.x == 0 || at.y == 0 || at.x == field.columns - 1 || at.y == field.rows - 1;
        let vertex = |(i, &v): (usize, &u32)| {
            let at = self.vertices[v as usize];
            let locked = inside[i] != uses[v as usize] || rules.border_stays && on_border(at);
            let spread = rules.spread.is_some_and(|s| s.has_column(at.x) && s.has_row(at.y));
            Vertex { at, triangle: NONE, locked, kept: stays[v as usize] || spread }
        };
        let vertices = block.vertices.iter().enumerate().map(vertex).collect();
        let mut patch = Patch::new(field, rules, vertices, block.triangles.clone());
        if !self.kept.is_empty() {
            let sides = block.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
            patch.kept = sides
                .map(|[a, b]| [a.min(b), a.max(b)])
                // Vertices of blocks are in order.
                .filter(|side| self.kept.binary_search(&side.map(|v| block.vertices[v as usize])).is_ok())
                .collect();
            patch.kept.sort_unstable();
        }
        patch.improve(&mut Scratch::default());
        let heights = patch.vertices.iter().map(|v| v.at.z).collect();
        patch.triangles.retain(|t| t[0] != NONE);
        // Steps are found in floating point, with a margin; this is the proof. A block that fails stays as it was.
        let corner = |v: u32| patch.vertices[v as usize].at;
        let keeps = |t: &[u32; 3]| keeps(field, rules.tolerance, rules.surface, t.map(corner));
        let proven = patch.triangles.iter().all(keeps);
        debug_assert!(proven);
        if proven {
            return Improved { block: Block { triangles: patch.triangles, ..block }, heights };
        }
        let heights = block.vertices.iter().map(|&v| self.vertices[v as usize].z).collect();
        Improved { block, heights }
    }
}
