//! The file through which meshes go to the tools and back: bytes that every language reads without a parser.
//!
//! Little-endian: the magic, the number of vertices and of triangles (u64), three f64 a vertex, three u32 a triangle.

use anyhow::{Context, Result, bail, ensure};
use std::path::Path;

const MAGIC: &[u8; 8] = b"PMRAW001";
const HEAD: usize = 24;

/// Triangles as plain arrays.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Raw {
    pub(crate) points: Vec<[f64; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Raw {
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(HEAD + 24 * self.points.len() + 12 * self.triangles.len());
        out.extend(MAGIC);
        out.extend((self.points.len() as u64).to_le_bytes());
        out.extend((self.triangles.len() as u64).to_le_bytes());
        self.points.as_flattened().iter().for_each(|x| out.extend(x.to_le_bytes()));
        self.triangles.as_flattened().iter().for_each(|i| out.extend(i.to_le_bytes()));
        out
    }

    /// Errors: not such a file, a wrong length, an index out of range.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<Raw> {
        ensure!(bytes.len() >= HEAD && bytes.starts_with(MAGIC), "this is no raw mesh");
        let count = |at: usize| -> usize {
            let mut b = [0; 8];
            b.copy_from_slice(&bytes[at..at + 8]);
            u64::from_le_bytes(b) as usize
        };
        let (points, triangles) = (count(8), count(16));
        let want = points.checked_mul(24).and_then(|p| p.checked_add(triangles.checked_mul(12)?));
        let Some(want) = want.filter(|w| *w == bytes.len() - HEAD) else {
            bail!("a raw mesh of {points} vertices and {triangles} triangles has another length");
        };
        let (p, t) = bytes[HEAD..HEAD + want].split_at(24 * points);
        let floats: Vec<f64> = p.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
        let ids: Vec<u32> = t.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
        if let Some(bad) = ids.iter().find(|&&i| i as usize >= points) {
            bail!("vertex {bad} of {points}");
        }
        Ok(Raw { points: floats.as_chunks().0.to_vec(), triangles: ids.as_chunks().0.to_vec() })
    }

    pub(crate) fn read(path: &Path) -> Result<Raw> {
        let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
        Raw::from_bytes(&bytes).with_context(|| path.display().to_string())
    }

    pub(crate) fn write(&self, path: &Path) -> Result<()> {
        std::fs::write(path, self.bytes()).with_context(|| path.display().to_string())
    }

    /// Without vertices of no triangle, which some tools keep; the others in order of their number.
    pub(crate) fn used(self) -> Raw {
        let mut map = vec![u32::MAX; self.points.len()];
        self.triangles.as_flattened().iter().for_each(|&v| map[v as usize] = 0);
        let mut points = Vec::new();
        for (to, p) in map.iter_mut().zip(&self.points).filter(|(to, _)| **to == 0) {
            *to = points.len() as u32;
            points.push(*p);
        }
        Raw { points, triangles: self.triangles.iter().map(|t| t.map(|v| map[v as usize])).collect() }
    }
}

/// Names what bytes hold: FNV-1a, 64 bits, in hexadecimal.
pub(crate) fn digest(bytes: &[u8]) -> String {
    let step = |h: u64, b: &u8| (h ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3);
    format!("{:016x}", bytes.iter().fold(0xcbf2_9ce4_8422_2325, step))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Raw {
        Raw {
            points: vec![[0.0, 0.0, 0.0], [9.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.5], [0.0, 1.0, 0.0]],
            triangles: vec![[0, 2, 3], [0, 3, 4]],
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let mesh = square();
        assert_eq!(Raw::from_bytes(&mesh.bytes()).unwrap(), mesh);
    }

    #[test]
    fn damaged_bytes_are_refused() {
        let bytes = square().bytes();
        for n in 0..bytes.len() {
            assert!(Raw::from_bytes(&bytes[..n]).is_err(), "{n}");
        }
        let mut many = bytes.clone();
        many[8..16].copy_from_slice(&u64::MAX.to_le_bytes());
        assert!(Raw::from_bytes(&many).is_err());
        let mut bad = square();
        bad.triangles[1][2] = 5;
        assert_eq!(Raw::from_bytes(&bad.bytes()).unwrap_err().to_string(), "vertex 5 of 5");
    }

    #[test]
    fn unused_vertices_go_and_the_surface_stays() {
        let (before, after) = (square(), square().used());
        assert_eq!(after.points.len(), 4);
        for (a, b) in before.triangles.iter().flatten().zip(after.triangles.iter().flatten()) {
            assert_eq!(before.points[*a as usize], after.points[*b as usize]);
        }
    }

    #[test]
    fn digests_tell_bytes_apart() {
        // The published test vectors of FNV-1a.
        assert_eq!(digest(b""), "cbf29ce484222325");
        assert_eq!(digest(b"foobar"), "85944171f73967e8");
    }
}
