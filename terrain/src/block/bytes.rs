//! Blocks as bytes, so that one may be put aside while others are made. Little-endian, not portable between versions: a cache, no file format.

use super::Collapse;
use super::join::{Block, BlockHead, Child};
use super::sheet::{Former, Gone, Round, Sheet, Vertex};

/// Bytes that are no block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the bytes are no block")]
pub struct Damaged;

/// A thing of a fixed number of words.
trait Words<const N: usize>: Sized {
    fn to(&self) -> [u32; N];
    fn of(w: [u32; N]) -> Self;
}

impl Words<1> for u32 {
    fn to(&self) -> [u32; 1] {
        [*self]
    }
    fn of([x]: [u32; 1]) -> Self {
        x
    }
}

impl Words<3> for Vertex {
    fn to(&self) -> [u32; 3] {
        [self.x as u32, self.y as u32, self.z.to_bits()]
    }
    fn of([x, y, z]: [u32; 3]) -> Self {
        Vertex { x: x as i32, y: y as i32, z: f32::from_bits(z) }
    }
}

impl Words<4> for Former {
    fn to(&self) -> [u32; 4] {
        let [x, y, z] = self.vertex.to();
        [x, y, z, self.by]
    }
    fn of([x, y, z, by]: [u32; 4]) -> Self {
        Former { vertex: Vertex::of([x, y, z]), by }
    }
}

impl Words<8> for Gone {
    fn to(&self) -> [u32; 8] {
        let [a, b] = self.at.map(|v| v.to());
        [a[0], a[1], a[2], b[0], b[1], b[2], self.counts[0], self.counts[1]]
    }
    fn of(w: [u32; 8]) -> Self {
        Gone { at: [Vertex::of([w[0], w[1], w[2]]), Vertex::of([w[3], w[4], w[5]])], counts: [w[6], w[7]] }
    }
}

impl Words<1> for f32 {
    fn to(&self) -> [u32; 1] {
        [self.to_bits()]
    }
    fn of([x]: [u32; 1]) -> Self {
        f32::from_bits(x)
    }
}

impl Words<2> for Round {
    fn to(&self) -> [u32; 2] {
        [self.reach, self.upright].map(f32::to_bits)
    }
    fn of(w: [u32; 2]) -> Self {
        let [reach, upright] = w.map(f32::from_bits);
        Round { reach, upright }
    }
}

impl Words<3> for [u32; 3] {
    fn to(&self) -> [u32; 3] {
        *self
    }
    fn of(w: [u32; 3]) -> Self {
        w
    }
}

impl Words<6> for [[u32; 2]; 3] {
    fn to(&self) -> [u32; 6] {
        let [[a, b], [c, d], [e, f]] = *self;
        [a, b, c, d, e, f]
    }
    fn of([a, b, c, d, e, f]: [u32; 6]) -> Self {
        [[a, b], [c, d], [e, f]]
    }
}

impl Words<11> for Collapse {
    fn to(&self) -> [u32; 11] {
        let [[a, b], [c, d]] = self.beside;
        let [l, r] = self.wings;
        let [bound, radius, upright] = [self.bound, self.radius, self.upright].map(f32::to_bits);
        [self.kept, self.removed, l, r, a, b, c, d, bound, radius, upright]
    }
    fn of([kept, removed, l, r, a, b, c, d, bound, radius, upright]: [u32; 11]) -> Self {
        Collapse {
            kept,
            removed,
            wings: [l, r],
            beside: [[a, b], [c, d]],
            bound: f32::from_bits(bound),
            radius: f32::from_bits(radius),
            upright: f32::from_bits(upright),
        }
    }
}

fn put<const N: usize, T: Words<N>>(out: &mut Vec<u8>, all: &[T]) {
    out.reserve(4 + 4 * N * all.len());
    out.extend_from_slice(&(all.len() as u32).to_le_bytes());
    all.iter().for_each(|x| out.extend_from_slice(x.to().map(u32::to_le_bytes).as_flattened()));
}

fn take_word(from: &mut &[u8]) -> Result<u32, Damaged> {
    let (word, rest) = from.split_first_chunk().ok_or(Damaged)?;
    *from = rest;
    Ok(u32::from_le_bytes(*word))
}

fn take<const N: usize, T: Words<N>>(from: &mut &[u8]) -> Result<Vec<T>, Damaged> {
    let count = take_word(from)? as usize;
    let bytes = count.checked_mul(4 * N).ok_or(Damaged)?;
    let (own, rest) = from.split_at_checked(bytes).ok_or(Damaged)?;
    *from = rest;
    let words = own.as_chunks::<4>().0.as_chunks::<N>().0;
    Ok(words.iter().map(|w| T::of(w.map(u32::from_le_bytes))).collect())
}

impl Sheet {
    /// As bytes.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = vec![];
        put(&mut out, &self.vertices);
        put(&mut out, &self.faces);
        put(&mut out, &self.joined);
        put(&mut out, &self.last);
        put(&mut out, &self.round);
        put(&mut out, &self.counts);
        put(&mut out, &self.open);
        put(&mut out, &self.gone);
        put(&mut out, &self.former);
        put(&mut out, &self.past);
        out
    }

    /// From bytes. What they say is taken as it is: they must come from [`Sheet::to_bytes`].
    ///
    /// # Errors
    /// Bytes that are too short or too long.
    pub fn from_bytes(mut bytes: &[u8]) -> Result<Sheet, Damaged> {
        let from = &mut bytes;
        let sheet = Sheet {
            vertices: take(from)?,
            faces: take(from)?,
            joined: take(from)?,
            last: take(from)?,
            round: take(from)?,
            counts: take(from)?,
            open: take(from)?,
            gone: take(from)?,
            former: take(from)?,
            past: take(from)?,
        };
        if from.is_empty() { Ok(sheet) } else { Err(Damaged) }
    }
}

impl BlockHead {
    /// How many bytes of a block it takes.
    pub const BYTES: usize = 44;

    fn to_bytes(self) -> [u8; Self::BYTES] {
        let mut out = [0; Self::BYTES];
        let error = self.error.to_bits();
        let [[x0, x1], [y0, y1]] = [self.columns, self.rows].map(|r| r.map(|x| x as u32));
        let [z0, z1] = self.heights.map(f32::to_bits);
        let counts = [self.collapses, self.faces, self.faces_left];
        let words = [error as u32, (error >> 32) as u32].into_iter().chain(counts);
        for (four, w) in out.as_chunks_mut().0.iter_mut().zip(words.chain([x0, x1, y0, y1, z0, z1])) {
            *four = w.to_le_bytes();
        }
        out
    }

    /// From the first bytes of a block.
    ///
    /// # Errors
    /// Fewer than [`BlockHead::BYTES`].
    pub fn from_bytes(bytes: &[u8]) -> Result<BlockHead, Damaged> {
        let bytes: &[u8; Self::BYTES] = bytes.first_chunk().ok_or(Damaged)?;
        let word = |k: usize| bytes.as_chunks::<4>().0.get(k).map_or(0, |b| u32::from_le_bytes(*b));
        Ok(BlockHead {
            error: f64::from_bits(u64::from(word(0)) | u64::from(word(1)) << 32),
            collapses: word(2),
            faces: word(3),
            faces_left: word(4),
            columns: [word(5) as i32, word(6) as i32],
            rows: [word(7) as i32, word(8) as i32],
            heights: [f32::from_bits(word(9)), f32::from_bits(word(10))],
        })
    }
}

impl Block {
    /// All but the sheet as bytes; they begin with its [head](Block::head).
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = self.head().to_bytes().to_vec();
        put(&mut out, &self.vertices);
        put(&mut out, &self.collapses);
        put(&mut out, &self.vertices_left);
        put(&mut out, &self.faces_left);
        put(&mut out, &[self.children.len() as u32]);
        for c in &self.children {
            put(&mut out, &[c.faces]);
            put(&mut out, &c.vertices);
        }
        out
    }

    /// From bytes; the sheet is empty. What they say is taken as it is: they must come from [`Block::to_bytes`].
    ///
    /// # Errors
    /// Bytes that are too short or too long.
    pub fn from_bytes(mut bytes: &[u8]) -> Result<Block, Damaged> {
        let from = &mut bytes;
        let head = BlockHead::from_bytes(from)?;
        *from = from.get(BlockHead::BYTES..).ok_or(Damaged)?;
        let one = |from: &mut &[u8]| take::<1, u32>(from)?.first().copied().ok_or(Damaged);
        let mut block = Block {
            error: head.error,
            faces: head.faces,
            vertices: take(from)?,
            collapses: take(from)?,
            vertices_left: take(from)?,
            faces_left: take(from)?,
            ..Block::default()
        };
        for _ in 0..one(from)? {
            block.children.push(Child { faces: one(from)?, vertices: take(from)? });
        }
        if from.is_empty() { Ok(block) } else { Err(Damaged) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Grid;
    use crate::block::{Layout, Relief, join, leaf};

    #[test]
    fn blocks_come_back() {
        let heights = (0..33 * 33).map(|i| f64::from(i * 7919 % 101)).collect();
        let grid = Grid::new(33, 33, heights).unwrap();
        let layout = Layout::new(33, 33, 16).unwrap();
        let four = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|at| leaf(&grid, &layout, at, 0.0).unwrap());
        for b in &four {
            assert!(!b.sheet.gone.is_empty());
            assert_eq!(Sheet::from_bytes(&b.sheet.to_bytes()).unwrap(), b.sheet);
            let bytes = b.to_bytes();
            let back = Block::from_bytes(&bytes).unwrap();
            assert_eq!(BlockHead::from_bytes(&bytes), Ok(b.head()));
            assert_eq!(Block { sheet: b.sheet.clone(), ..back }, *b);
            assert!((0..bytes.len()).step_by(101).all(|n| Block::from_bytes(&bytes[..n]).is_err()));
        }
        let relief = Relief::read(&grid, layout.window(1, [0, 0]), 10_000).unwrap();
        let root = join(four.map(|b| b.sheet).to_vec(), &relief, &layout.rules(1, [0, 0], 0)).unwrap();
        let back = Block::from_bytes(&root.to_bytes()).unwrap();
        assert_eq!((root.children.len(), back.children), (4, root.children.clone()));
    }
}
