//! Blocks, and putting 2 x 2 of them together.

use super::NONE;
use super::collapse::{Collapse, Collapsed, Rules, collapse};
use super::leaf::BlockError;
use super::relief::Relief;
use super::sheet::{Sheet, Vertex};
use std::collections::HashMap;

/// What the sheet of a block became in the one it was joined to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Child {
    /// For each of its vertices, which of the joined block's it is.
    pub vertices: Vec<u32>,
    /// How many faces it had.
    pub faces: u32,
}

/// A block after its collapses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Block {
    /// The vertices it began with.
    pub vertices: Vec<Vertex>,
    /// The faces it began with: so many.
    pub faces: u32,
    /// Its collapses, in order.
    pub collapses: Vec<Collapse>,
    /// The vertices left, by their numbers at the beginning, ascending: those of `sheet`, in order.
    pub vertices_left: Vec<u32>,
    /// The same of faces.
    pub faces_left: Vec<u32>,
    /// What is left of it.
    pub sheet: Sheet,
    /// The blocks that it was joined of; their faces follow each other. Empty at level 0.
    pub children: Vec<Child>,
    /// The greatest error of the triangulation it began with, at level 0.
    pub error: f64,
}

/// What is known of a block without its parts: it stands before them in its bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockHead {
    /// How many collapses it has.
    pub collapses: u32,
    /// The faces it began with, and those left: so many.
    pub faces: u32,
    /// See [`BlockHead::faces`].
    pub faces_left: u32,
    /// As [`Block::error`].
    pub error: f64,
    /// The first and the last column of its vertices; the first is the larger if there is none.
    pub columns: [i32; 2],
    /// The same of rows.
    pub rows: [i32; 2],
    /// The same of heights.
    pub heights: [f32; 2],
}

impl Block {
    /// What is known without its parts.
    #[must_use]
    pub fn head(&self) -> BlockHead {
        let (x0, x1) = extent(self.vertices.iter().map(|v| v.x));
        let (y0, y1) = extent(self.vertices.iter().map(|v| v.y));
        let heights = self
            .vertices
            .iter()
            .fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], v| [low.min(v.z), high.max(v.z)]);
        BlockHead {
            collapses: self.collapses.len() as u32,
            faces: self.faces,
            faces_left: self.faces_left.len() as u32,
            error: self.error,
            columns: [x0, x1],
            rows: [y0, y1],
            heights,
        }
    }

    pub(super) fn new(vertices: Vec<Vertex>, made: Collapsed, children: Vec<Child>, error: f64) -> Self {
        let faces = made.faces.len()
            + made.collapses.iter().map(|c| c.wings.iter().filter(|&&w| w != NONE).count()).sum::<usize>();
        Block {
            vertices,
            faces: faces as u32,
            collapses: made.collapses,
            vertices_left: made.vertices,
            faces_left: made.faces,
            sheet: made.sheet,
            children,
            error,
        }
    }
}

/// Joins the sheets of neighbouring blocks, in rows, and collapses three vertices of four of what comes of it, or as many as go at the root. O(n log n).
///
/// # Errors
/// [`BlockError::NoNeighbours`] for sheets that make no surface together.
pub fn join(sheets: Vec<Sheet>, relief: &Relief, rules: &Rules) -> Result<Block, BlockError> {
    let mut known: HashMap<(i32, i32), u32> = HashMap::new();
    let mut all = Sheet::default();
    let mut children = vec![];
    for sheet in sheets {
        let (x0, x1) = extent(sheet.vertices.iter().map(|v| v.x));
        let (y0, y1) = extent(sheet.vertices.iter().map(|v| v.y));
        let mut next = all.vertices.len() as u32;
        let map: Vec<u32> = sheet
            .vertices
            .iter()
            .map(|v| {
                // Only on a border can it be another's too.
                let own = if v.x == x0 || v.x == x1 || v.y == y0 || v.y == y1 {
                    *known.entry((v.x, v.y)).or_insert(next)
                } else {
                    next
                };
                next += u32::from(own == next);
                own
            })
            .collect();
        let faces = sheet.faces.len() as u32;
        all.append(sheet, &map);
        children.push(Child { vertices: map, faces });
    }
    let vertices = all.vertices.clone();
    let rules = rules.for_part(vertices.len());
    let made = collapse(all, relief, &rules).ok_or(BlockError::NoNeighbours)?;
    Ok(Block::new(vertices, made, children, 0.0))
}

fn extent(all: impl Iterator<Item = i32>) -> (i32, i32) {
    all.fold((i32::MAX, i32::MIN), |(a, b), x| (a.min(x), b.max(x)))
}
