//! Progressive terrains as `.pm` files.

use super::write_shell;
use crate::blocks::{BuildError, Coded};
use crate::io::grid::ReadAt;
use crate::progressive::shell_of;
use crate::refine::format::{ChunkType, Piece, RangeReader};
use crate::scene::{Scene, SceneMesh};
use crate::selective::Ranges;
use glam::{DMat4, DVec3};
use serde_json::{Map, Value};
use std::io::Write;
use std::sync::Arc;

/// What a mesh is of a height grid: a `TERR` chunk. The mesh has x = column, and y = height and z = row in the length of a step by a column.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terrain {
    /// Samples in a row.
    pub columns: u32,
    /// Samples in a column.
    pub rows: u32,
    /// Lengths of a step by a column and by a row, in the unit of heights; 1 where nobody knows.
    pub spacing: [f64; 2],
    /// The greatest difference of height between a sample and full detail, in the unit of heights.
    pub error: f64,
    /// Steps along a side of the finest blocks.
    pub cells: u32,
    /// Levels of blocks.
    pub levels: u32,
}

/// Bytes of one.
const BYTES: usize = 40;

impl Terrain {
    /// As a `TERR` chunk has it.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(BYTES);
        for x in [self.columns, self.rows] {
            out.extend_from_slice(&x.to_le_bytes());
        }
        for x in [self.spacing[0], self.spacing[1], self.error] {
            out.extend_from_slice(&x.to_le_bytes());
        }
        for x in [self.cells, self.levels] {
            out.extend_from_slice(&x.to_le_bytes());
        }
        out
    }

    /// From what a `TERR` chunk has; more than this program knows is skipped. `None` if there is less, or numbers that cannot be.
    pub fn from_bytes(bytes: &[u8]) -> Option<Terrain> {
        let bytes: &[u8; BYTES] = bytes.first_chunk()?;
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let long = |at: usize| f64::from_bits(u64::from(word(at)) | u64::from(word(at + 4)) << 32);
        let t = Terrain {
            columns: word(0),
            rows: word(4),
            spacing: [long(8), long(16)],
            error: long(24),
            cells: word(32),
            levels: word(36),
        };
        let sound = |x: f64| x >= 0.0 && x.is_finite();
        (t.columns > 1 && t.rows > 1 && [t.spacing[0], t.spacing[1], t.error].into_iter().all(sound))
            .then_some(t)
    }
}

/// What a progressive mesh says of the grid that it was made of; `None` of one that is no terrain, or cannot be read, which its own decoder tells.
pub fn read_terrain(source: Arc<dyn ReadAt>) -> Option<Terrain> {
    let reader = RangeReader::new(Ranges(source)).ok()?;
    let chunk = reader.directory().chunks.iter().find(|c| c.kind == ChunkType::TERRAIN)?;
    match reader.read(chunk.index, None) {
        Ok(Piece::Other(bytes)) => Terrain::from_bytes(&bytes),
        _ => None,
    }
}

/// Writes a progressive terrain, in chunks that are read alone, level by level; returns how many bytes it has. In the scene it stands as [`crate::ground::Space::World`] says: the middle of the grid at
/// the origin. `facts` are those of the scene.
///
/// # Errors
/// Those of the store and of `out`.
pub fn write_terrain(
    coded: &Coded<'_>,
    terrain: &Terrain,
    facts: Map<String, Value>,
    out: &mut dyn Write,
) -> Result<u64, BuildError> {
    let mesh = SceneMesh { name: Some("terrain".into()), ..SceneMesh::default() };
    let mut scene = Scene::from_mesh(mesh);
    scene.facts = facts;
    let [x, z] = terrain.spacing;
    let middle = [terrain.columns, terrain.rows].map(|n| f64::from(n.saturating_sub(1)) / 2.0);
    let origin = DVec3::new(-middle[0] * x, 0.0, -middle[1] * z);
    for node in &mut scene.nodes {
        node.transform = DMat4::from_translation(origin) * DMat4::from_scale(DVec3::splat(x));
    }
    let shell = write_shell(&shell_of(scene), &[], &[Some(coded.extent())]);
    coded.write(&shell, &[(ChunkType::TERRAIN, terrain.to_bytes())], out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let t = Terrain { columns: 9, rows: 7, spacing: [30.0, 29.5], error: 0.5, cells: 256, levels: 1 };
        let mut bytes = t.to_bytes();
        assert_eq!(Terrain::from_bytes(&bytes), Some(t));
        assert!((0..bytes.len()).all(|n| Terrain::from_bytes(&bytes[..n]).is_none()));
        bytes.push(1);
        assert_eq!(Terrain::from_bytes(&bytes), Some(t));
        bytes[0] = 1;
        assert_eq!(Terrain::from_bytes(&bytes), None);
    }
}
