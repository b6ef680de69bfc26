//! Rows of attributes, each expected to be like that of a wedge nearby.

use super::coder::{Bit, Coder, Number};
use super::places::{order32, unorder32};
use crate::aif::{Channel, NONE};
use rustc_hash::FxHashMap;

/// Codes the rows of one chunk.
pub(super) struct Rows {
    stride: usize,
    all: u64,
    same: Bit,
    full: Bit,
    mask: Number,
    /// By column; those far out share one.
    value: Vec<Number>,
    /// The last row.
    last: Vec<f32>,
    last_present: u64,
    /// The last row of a vertex.
    of_vertex: FxHashMap<u32, usize>,
    kept: Vec<f32>,
}

const COLUMNS: usize = 24;

impl Rows {
    pub(super) fn new(channels: &[Channel]) -> Self {
        let stride = channels.iter().map(|c| c.width).sum();
        Rows {
            stride,
            all: super::coder::low_mask(channels.len() as u32),
            same: Bit::default(),
            full: Bit::default(),
            mask: Number::default(),
            value: vec![Number::default(); stride.min(COLUMNS)],
            last: vec![0.0; stride],
            last_present: 0,
            of_vertex: FxHashMap::default(),
            kept: Vec::new(),
        }
    }

    /// The row coded last.
    pub(super) fn row(&self) -> &[f32] {
        &self.last
    }

    /// Codes a row (and the channels it has) at `vertex` ([`NONE`]: like the one before).
    pub(super) fn code<C: Coder>(&mut self, c: &mut C, vertex: u32, source: Option<(u64, &[f32])>) -> u64 {
        if let Some(&at) = self.of_vertex.get(&vertex) {
            self.last.copy_from_slice(&self.kept[at..at + self.stride]);
        }
        let (mut present, row) = source.unwrap_or((self.last_present, &[]));
        if !c.bit(&mut self.same, present == self.last_present) {
            present = if c.bit(&mut self.full, present == self.all) {
                self.all
            } else {
                c.number(&mut self.mask, present)
            };
        }
        self.last_present = present;
        for k in 0..self.stride {
            let guess = order32(self.last[k].to_bits());
            let want = row.get(k).map_or(guess, |x| order32(x.to_bits()));
            let model = &mut self.value[k.min(COLUMNS - 1)];
            let residual = c.signed(model, want.wrapping_sub(guess) as i32 as i64);
            self.last[k] = f32::from_bits(unorder32(guess.wrapping_add(residual as u32)));
        }
        if vertex != NONE {
            let at = *self.of_vertex.entry(vertex).or_insert(self.kept.len());
            if at == self.kept.len() {
                self.kept.extend_from_slice(&self.last);
            } else {
                self.kept[at..at + self.stride].copy_from_slice(&self.last);
            }
        }
        present
    }
}
