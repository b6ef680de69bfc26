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

/// What became of a block.
struct Improved {
    /// Its vertices, by number, ascending, and their heights.
    vertices: Vec<u32>,
    heights: Vec<i32>,
    /// Its triangles of these.
    triangles: Vec<[u32; 3]>,
}

/// What one thread needs, block after block.
struct Workplace {
    /// Numbers of vertices within the block; what is beyond the block's vertices, or leads to another, is of an earlier one.
    local: Vec<u32>,
    scratch: Scratch,
}

/// Vertices that more than one block has, and those that stay.
struct Shared {
    uses: Vec<u32>,
    stays: Vec<bool>,
}

impl Network {
    /// Improves all blocks; `None` when cancelled. The same result for any number of threads.
    pub(super) fn improve(&mut self, field: &Field, pass: Pass, control: &dyn Control) -> Option<()> {
        let mut shared =
            Shared { uses: vec![0; self.vertices.len()], stays: vec![false; self.vertices.len()] };
        for &v in self.triangles.as_flattened() {
            shared.uses[v as usize] += 1;
        }
        for &v in self.kept.as_flattened() {
            shared.stays[v as usize] = true;
        }
        let (order, starts) = self.blocks(field, pass.shift);
        let blocks: Vec<&[u32]> =
            starts.windows(2).map(|w| &order[w[0]..w[1]]).filter(|members| !members.is_empty()).collect();
        let (count, finished) = (blocks.len(), AtomicUsize::new(0));
        let place = || Workplace { local: vec![0; self.vertices.len()], scratch: Scratch::default() };
        let improved = parallel::map_with_place(blocks, place, |place, members| {
            if control.cancelled() {
                return None;
            }
            let improved = self.improve_block(field, pass.rules, members, &shared, place);
            let part = (finished.fetch_add(1, Ordering::Relaxed) + 1) as f64 / count as f64;
            control.progress(pass.done[0] + part * (pass.done[1] - pass.done[0]));
            Some(improved)
        });
        self.triangles.clear();
        for improved in improved {
            let Improved { vertices, heights, triangles } = improved?;
            for (&v, z) in vertices.iter().zip(heights) {
                self.vertices[v as usize].z = z;
            }
            let number = |v: u32| vertices[v as usize];
            self.triangles.extend(triangles.iter().map(|&[a, b, c]| [number(a), number(b), number(c)]));
        }
        self.compact();
        Some(())
    }

    /// Divides the triangles by where their centres lie: their numbers, block after block, and where each begins.
    fn blocks(&self, field: &Field, shift: f64) -> (Vec<u32>, Vec<usize>) {
        let samples = f64::from(field.columns) * f64::from(field.rows);
        let size = (samples * TRIANGLES as f64 / self.triangles.len().max(1) as f64).sqrt();
        let size = (size.min(65_536.0) as i32).max(16);
        let offset = (f64::from(size) * shift) as i32;
        let [across, down] = [field.columns, field.rows].map(|n| (n + offset) / size + 1);
        let cell = |&[a, b, c]: &[u32; 3]| {
            let (a, b, c) = (self.vertices[a as usize], self.vertices[b as usize], self.vertices[c as usize]);
            let (x, y) = ((a.x + b.x + c.x) / 3 + offset, (a.y + b.y + c.y) / 3 + offset);
            (y / size * across + x / size) as u32
        };
        let cells: Vec<u32> = self.triangles.iter().map(cell).collect();
        // Each cell's end becomes its start while its triangles are put in, the last first.
        let mut starts = vec![0usize; across as usize * down as usize + 1];
        for &c in &cells {
            starts[c as usize] += 1;
        }
        let mut end = 0;
        for s in &mut starts {
            end += *s;
            *s = end;
        }
        let mut order = vec![0u32; cells.len()];
        for (t, &c) in cells.iter().enumerate().rev() {
            starts[c as usize] -= 1;
            order[starts[c as usize]] = t as u32;
        }
        (order, starts)
    }

    fn improve_block(
        &self,
        field: &Field,
        rules: Rules,
        members: &[u32],
        shared: &Shared,
        place: &mut Workplace,
    ) -> Improved {
        let local = &mut place.local;
        let mut numbers: Vec<u32> = vec![];
        for &v in members.iter().flat_map(|&t| &self.triangles[t as usize]) {
            let known = local[v as usize] as usize;
            if numbers.get(known) != Some(&v) {
                local[v as usize] = numbers.len() as u32;
                numbers.push(v);
            }
        }
        // In the order of the network, so that sides that stay have the lower vertex first here too.
        numbers.sort_unstable();
        for (i, &v) in numbers.iter().enumerate() {
            local[v as usize] = i as u32;
        }
        let number = |v: u32| local[v as usize];
        let corners = members.iter().map(|&t| self.triangles[t as usize]);
        let triangles: Vec<[u32; 3]> = corners.map(|[a, b, c]| [number(a), number(b), number(c)]).collect();
        let mut inside = vec![0u32; numbers.len()];
        for &v in triangles.as_flattened() {
            inside[v as usize] += 1;
        }
        let on_border =
            |at: Corner| at.x == 0 || at.y == 0 || at.x == field.columns - 1 || at.y == field.rows - 1;
        let vertex = |(&v, &inside): (&u32, &u32)| {
            let at = self.vertices[v as usize];
            let locked = inside != shared.uses[v as usize] || rules.border_stays && on_border(at);
            let spread = rules.spread.is_some_and(|s| s.has_column(at.x) && s.has_row(at.y));
            Vertex { at, triangle: NONE, locked, kept: shared.stays[v as usize] || spread }
        };
        let vertices = numbers.iter().zip(&inside).map(vertex).collect();
        let mut patch = Patch::new(field, rules, vertices, triangles.clone());
        if !self.kept.is_empty() {
            let sides = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
            patch.kept = sides
                .map(|[a, b]| [a.min(b), a.max(b)])
                .filter(|side| self.kept.binary_search(&side.map(|v| numbers[v as usize])).is_ok())
                .collect();
            patch.kept.sort_unstable();
        }
        patch.improve(&mut place.scratch);
        let heights = patch.vertices.iter().map(|v| v.at.z).collect();
        patch.triangles.retain(|t| t[0] != NONE);
        // Steps are found in floating point, with a margin; this is the proof. A block that fails stays as it was.
        let corner = |v: u32| patch.vertices[v as usize].at;
        let keeps = |&[a, b, c]: &[u32; 3]| {
            keeps(field, rules.tolerance, rules.surface, [corner(a), corner(b), corner(c)])
        };
        let proven = patch.triangles.iter().all(keeps);
        debug_assert!(proven);
        if proven {
            return Improved { vertices: numbers, heights, triangles: patch.triangles };
        }
        let heights = numbers.iter().map(|&v| self.vertices[v as usize].z).collect();
        Improved { vertices: numbers, heights, triangles }
    }
}
