//! A scan-like mesh: a bumpy closed surface, noisy vertices, uneven triangles, and ragged holes that were never seen.

use crate::geodesic::{frequency, geodesic};
use crate::noise::{SplitMix64, fractal, noise};
use crate::sample::{Sample, triangle_mesh};
use glam::DVec3;

/// Faces of the scan when none are asked for.
pub(crate) const DEFAULT_FACES: usize = 20_000;
/// Holes in the surface, each bounded by one border loop.
const HOLES: usize = 6;
/// Faces for every hole: below 6 times as many there are fewer holes, which would eat the surface.
const FACES_PER_HOLE: usize = 60;
/// Part of the faces that the holes take, about: asked for so much more, the rest comes out as asked.
const HOLE_SHARE: f64 = 0.06;

/// A scan of about this many faces. The diagonal of its bounds is 1 to within f32 rounding (1e-7), its centre the origin.
pub(crate) fn scan(faces: usize, seed: u64) -> Sample {
    let n = frequency((faces as f64 * (1.0 + HOLE_SHARE)) as usize);
    let (mut directions, triangles) = geodesic(n);
    let mut random = SplitMix64::new(seed ^ 0x7363_616e);
    // Edges of the sphere are about 1.1 / n long; a fifth of that either way leaves no triangle turned over.
    let jitter = 0.2 * 1.1 / n as f64;
    for d in &mut directions {
        let step = DVec3::new(random.signed(), random.signed(), random.signed());
        *d = (*d + step * jitter).normalize();
    }
    let bumps: Vec<(DVec3, f64, f64)> = (0..14)
        .map(|_| (random.direction(), 0.15 + 0.35 * random.unit(), 0.06 + 0.12 * random.unit()))
        .collect();
    let points: Vec<DVec3> = directions
        .iter()
        .map(|&d| {
            let mut r = 1.0 + 0.16 * fractal(seed, d * 1.6, 4, 0.5);
            for &(at, width, height) in &bumps {
                let x = 1.0 - d.distance_squared(at) / (width * width);
                r += if x > 0.0 { height * x * x * x } else { 0.0 };
            }
            r += 0.08 * jitter * n as f64 / 4.0 * noise(seed ^ 1, d * 9.0) + 0.5 * jitter * random.signed();
            d * r * DVec3::new(1.0, 0.8, 0.65)
        })
        .collect();
    let kept = punch(&directions, triangles, &mut random, seed);
    let (points, kept) = drop_unused(&points, kept);
    triangle_mesh(normalized(points), &kept)
}

/// Moves the centre of the bounds to the origin and scales their diagonal to 1.
fn normalized(mut points: Vec<DVec3>) -> Vec<DVec3> {
    let lo = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let hi = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let (centre, scale) = ((lo + hi) / 2.0, 1.0 / (hi - lo).length());
    points.iter_mut().for_each(|p| *p = (*p - centre) * scale);
    points
}

/// Cuts the holes: each grows from a face over its neighbours as far as a ragged radius.
fn punch(points: &[DVec3], triangles: Vec<[u32; 3]>, random: &mut SplitMix64, seed: u64) -> Vec<[u32; 3]> {
    let neighbours = neighbours(&triangles);
    let centre = |f: usize| triangles[f].iter().map(|&v| points[v as usize]).sum::<DVec3>().normalize();
    let mut centres: Vec<DVec3> = Vec::with_capacity(HOLES);
    let mut gone = vec![false; triangles.len()];
    for hole in 0..HOLES.min(triangles.len() / FACES_PER_HOLE) {
        // Of several places, the one farthest from the other holes: they must not grow together.
        let distance = |d: &DVec3| centres.iter().map(|c| c.distance(*d)).fold(f64::INFINITY, f64::min);
        let at = (0..40).map(|_| random.direction()).fold(None, |best: Option<DVec3>, d| match best {
            Some(b) if distance(&b) >= distance(&d) => Some(b),
            _ => Some(d),
        });
        let Some(at) = at else { continue };
        centres.push(at);
        let radius = 0.12 + 0.14 * random.unit();
        let ragged = |d: DVec3| {
            let r = radius * (1.0 + 0.45 * fractal(seed ^ hole as u64, d * 11.0, 3, 0.6));
            d.distance(at) < r
        };
        let nearest = (0..triangles.len())
            .map(|f| (centre(f).distance_squared(at), f))
            .fold((f64::INFINITY, 0), |a, b| if b.0 < a.0 { b } else { a });
        let mut stack = vec![nearest.1];
        while let Some(f) = stack.pop() {
            if std::mem::replace(&mut gone[f], true) {
                continue;
            }
            stack
                .extend(neighbours[f].iter().map(|&g| g as usize).filter(|&g| !gone[g] && ragged(centre(g))));
        }
    }
    open_cut_vertices(&triangles, &neighbours, points.len(), &mut gone);
    keep_largest(&triangles, &neighbours, &gone)
}

/// Removes the faces around every vertex at which the holes left more than one fan, until there is none.
fn open_cut_vertices(triangles: &[[u32; 3]], neighbours: &[[u32; 3]], vertices: usize, gone: &mut [bool]) {
    loop {
        let mut border_edges = vec![0u8; vertices];
        for f in (0..triangles.len()).filter(|&f| !gone[f]) {
            for k in (0..3).filter(|&k| gone[neighbours[f][k] as usize]) {
                for v in [triangles[f][k], triangles[f][(k + 1) % 3]] {
                    border_edges[v as usize] = border_edges[v as usize].saturating_add(1);
                }
            }
        }
        let mut changed = false;
        for f in 0..triangles.len() {
            if !gone[f] && triangles[f].iter().any(|&v| border_edges[v as usize] > 2) {
                gone[f] = true;
                changed = true;
            }
        }
        if !changed {
            return;
        }
    }
}

/// The faces of the largest component that is left (islands inside a hole are dropped).
fn keep_largest(triangles: &[[u32; 3]], neighbours: &[[u32; 3]], gone: &[bool]) -> Vec<[u32; 3]> {
    let mut seen = gone.to_vec();
    let mut largest: Vec<usize> = Vec::new();
    for start in 0..triangles.len() {
        let (mut component, mut stack) = (Vec::new(), vec![start]);
        while let Some(f) = stack.pop() {
            if !std::mem::replace(&mut seen[f], true) {
                component.push(f);
                stack.extend(neighbours[f].iter().map(|&g| g as usize));
            }
        }
        if component.len() > largest.len() {
            largest = component;
        }
    }
    largest.sort_unstable();
    largest.into_iter().map(|f| triangles[f]).collect()
}

/// The face across each edge k -> k + 1 of every face of a closed mesh.
fn neighbours(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut sides: Vec<(u32, u32, u32, u8)> = Vec::with_capacity(3 * triangles.len());
    for (f, t) in triangles.iter().enumerate() {
        for k in 0..3u8 {
            let (a, b) = (t[k as usize], t[(k as usize + 1) % 3]);
            sides.push((a.min(b), a.max(b), f as u32, k));
        }
    }
    sides.sort_unstable();
    let mut across = vec![[0; 3]; triangles.len()];
    for pair in sides.chunks_exact(2) {
        let [(.., f, k), (.., g, l)] = [pair[0], pair[1]];
        across[f as usize][k as usize] = g;
        across[g as usize][l as usize] = f;
    }
    across
}

/// Leaves out the vertices of no face.
fn drop_unused(points: &[DVec3], mut triangles: Vec<[u32; 3]>) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut used = vec![false; points.len()];
    triangles.as_flattened().iter().for_each(|&v| used[v as usize] = true);
    let mut next = 0;
    let map: Vec<u32> = used
        .iter()
        .map(|&u| {
            next += u as u32;
            next.wrapping_sub(1)
        })
        .collect();
    triangles.as_flattened_mut().iter_mut().for_each(|v| *v = map[*v as usize]);
    (points.iter().zip(&used).filter(|p| *p.1).map(|p| *p.0).collect(), triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_leave_most_of_a_coarse_scan() {
        for faces in [1, 20, 30, 80, 180, 320, 500, 720] {
            for seed in (0..100).chain([864]) {
                let (left, whole) = (
                    scan(faces, seed).corners.len() / 3,
                    20 * frequency((faces as f64 * (1.0 + HOLE_SHARE)) as usize).pow(2) as usize,
                );
                assert!(2 * left > whole, "{faces} faces, seed {seed}: {left} of {whole} are left");
            }
        }
    }
}
