//! Hostile meshes: the scan with one thing wrong, and nothing else.

use crate::noise::SplitMix64;
use crate::sample::{Sample, triangle_mesh};
use crate::scan::scan;
use glam::DVec3;

/// Faces spoilt, of a hundred, where a defect is spread over the mesh.
const PERCENT: usize = 2;

/// The scan moved along the three axes. In f32 the place swallows the detail: at 1e6 only 16 steps a unit are left.
pub(crate) fn offset(faces: usize, seed: u64, by: f64, rounded: bool) -> Sample {
    let mut sample = scan(faces, seed);
    sample.positions.as_flattened_mut().iter_mut().for_each(|x| *x += by);
    if rounded {
        sample.round_to_f32();
    }
    sample
}

/// The scan scaled along each axis.
pub(crate) fn scale(faces: usize, seed: u64, by: [f64; 3]) -> Sample {
    let mut sample = scan(faces, seed);
    sample.positions.iter_mut().for_each(|p| (0..3).for_each(|k| p[k] *= by[k]));
    sample.round_to_f32();
    sample
}

/// The scan with one coordinate of one vertex set to this.
pub(crate) fn set_one(faces: usize, seed: u64, to: f64) -> Sample {
    let mut sample = scan(faces, seed);
    let mut random = SplitMix64::new(seed);
    let (vertex, axis) = (random.below(sample.positions.len()), random.below(3));
    sample.positions[vertex][axis] = to;
    sample
}

/// The scan with faces of no area put in: some name a vertex twice or thrice, some have three vertices of which two coincide. Without
/// them the surface is the scan's: those that coincide fill a slit of no width, so that the mesh stays connected.
pub(crate) fn degenerate_faces(faces: usize, seed: u64) -> Sample {
    let mut sample = scan(faces, seed);
    let mut random = SplitMix64::new(seed);
    let old = sample.corners.as_chunks::<3>().0.to_vec();
    let spoilt = random.choose(old.len(), (old.len() * PERCENT / 100).max(3));
    let mut corners = Vec::with_capacity(old.len() + 2 * spoilt.len());
    let mut spoil = spoilt.iter().enumerate().peekable();
    for (f, &[a, b, c]) in old.iter().enumerate() {
        let kind = spoil.next_if(|s| *s.1 == f).map(|s| s.0 % 3);
        match kind {
            None => corners.push([a, b, c]),
            Some(0) => corners.extend([[a, b, c], [b, c, b]]),
            Some(1) => corners.extend([[a, b, c], [c, c, c]]),
            Some(_) => {
                let twin = sample.positions.len() as u32;
                sample.positions.push(sample.positions[a as usize]);
                corners.extend([[twin, b, c], [a, twin, c], [a, b, twin]]);
            }
        }
    }
    sample.corners = corners.into_flattened();
    sample
}

/// The scan with some faces there twice: as they are, turned to another first corner, or reversed.
pub(crate) fn duplicate_faces(faces: usize, seed: u64) -> Sample {
    let mut sample = scan(faces, seed);
    let mut random = SplitMix64::new(seed);
    let old = sample.corners.as_chunks::<3>().0.to_vec();
    let doubled = random.choose(old.len(), (old.len() * PERCENT / 100).max(3));
    for (i, &f) in doubled.iter().enumerate() {
        let [a, b, c] = old[f];
        sample.corners.extend([[a, b, c], [b, c, a], [a, c, b]][i % 3]);
    }
    sample
}

/// The scan with one index one too high.
pub(crate) fn index_out_of_range(faces: usize, seed: u64) -> Sample {
    let mut sample = scan(faces, seed);
    let corner = SplitMix64::new(seed).below(sample.corners.len());
    sample.corners[corner] = sample.positions.len() as u32;
    sample
}

/// The scan without shared vertices.
pub(crate) fn soup(faces: usize, seed: u64) -> Sample {
    let mut sample = scan(faces, seed);
    sample.positions = sample.corners.iter().map(|&v| sample.positions[v as usize]).collect();
    sample.corners = (0..sample.corners.len() as u32).collect();
    sample
}

/// The scan with half of the faces (rounded down) wound the other way.
pub(crate) fn flipped_half(faces: usize, seed: u64) -> Sample {
    let mut sample = scan(faces, seed);
    let count = sample.face_count();
    for f in SplitMix64::new(seed).choose(count, count / 2) {
        sample.corners.swap(3 * f + 1, 3 * f + 2);
    }
    sample
}

/// One triangle.
pub(crate) fn single_triangle() -> Sample {
    triangle_mesh([DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]])
}
