//! The order of the splits in a file, and how it is cut into chunks.

use crate::progressive::ProgressiveMesh;

/// Splits of a chunk, aimed at.
pub(super) const CHUNK: usize = 8192;

/// Consecutive splits of a plan that make a chunk.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) count: usize,
    pub(super) band: u32,
    pub(super) subtree: u32,
}

/// An order of the splits, and the chunks.
#[derive(Clone, Debug, Default)]
pub(super) struct Plan {
    pub(super) order: Vec<u32>,
    pub(super) pieces: Vec<Piece>,
    pub(super) levels: Vec<u32>,
}

impl Plan {
    pub(super) fn new(pm: &ProgressiveMesh) -> Plan {
        let n = pm.splits.len();
        let pieces = (0..n)
            .step_by(CHUNK)
            .map(|at| Piece { count: CHUNK.min(n - at), band: 0, subtree: (at / CHUNK) as u32 })
            .collect();
        Plan { order: (0..n as u32).collect(), pieces, levels: pm.levels.clone() }
    }
}
