//! Which lattices the positions of a mesh lie on, and putting them on one.

use super::places::Lattice;
use crate::aif::Positions;
use crate::progressive::{Places, ProgressiveMesh};
use glam::DVec3;

/// Places looked at to find lattices.
const SAMPLES: usize = 2000;

/// A cell for [`crate::simplify::Options::grid`] with which places that a method chooses cost few bytes in a file: a power of two, some hundredth of
/// the edges that a surface of so many vertices has, and not below what f32 resolves at the largest coordinate. `None` for a mesh without extent.
pub fn suggested_grid(positions: &Positions) -> Option<f64> {
    let (low, high) = positions.bounds()?;
    let diagonal = (high - low).length();
    let largest = low.abs().max(high.abs()).max_element();
    if !(diagonal > 0.0 && diagonal.is_finite() && largest.is_finite()) {
        return None;
    }
    // 2^-16 of the diagonal on bunny and horse, 2^-17 on dragon: below any error that one sees.
    let fine = (8.5 + 0.5 * (positions.len() as f64).log2()).floor().clamp(15.0, 20.0);
    let wanted = diagonal.log2().floor() - fine;
    let resolved = largest.log2().floor() - 23.0;
    Some(wanted.max(resolved).exp2()).filter(|c| *c > 0.0 && c.is_finite())
}

/// The lattices of a mesh's places: of those that splits move vertices to, if they are multiples of a power of two, and of decimal input.
pub(super) fn find(pm: &ProgressiveMesh) -> Vec<Lattice> {
    let mut found = Vec::new();
    found.extend(find_binary(pm));
    found.extend(find_decimal(&pm.new_positions));
    found
}

fn sample(p: &Places) -> impl Iterator<Item = [f64; 3]> + '_ {
    let step = p.len().div_ceil(SAMPLES).max(1);
    (0..p.len()).step_by(step).map(|i| p.get(i).to_array())
}

/// Places that are multiples of a cell in every coordinate, where other places may be anywhere: the cell that spares most bits.
fn find_binary(pm: &ProgressiveMesh) -> Option<Lattice> {
    // The exponent of the lowest bit that is set.
    let lowest = |x: f64| -> i32 {
        if x == 0.0 || !x.is_finite() {
            return 2000;
        }
        let bits = x.to_bits();
        let exponent = (bits >> 52 & 0x7FF) as i32 - 1075;
        exponent + (bits | 1 << 52).trailing_zeros() as i32
    };
    let places = || sample(&pm.moved_positions);
    let mut low: Vec<i32> = places().map(|x| x.map(lowest).into_iter().min().unwrap_or(2000)).collect();
    if low.len() < 16 {
        return None;
    }
    low.sort_unstable();
    let largest = places().flatten().map(f64::abs).fold(0.0, f64::max);
    // Finer than this, floats are as good.
    let least = largest.log2().ceil() as i32 - 22;
    let saved = |&(k, &e): &(usize, &i32)| (low.len() - k) as i64 * (e - least).clamp(0, 64) as i64;
    let (k, &e) = low.iter().enumerate().max_by_key(saved)?;
    // A tenth of the places is worth the flag.
    let worth = e > least && 10 * (low.len() - k) >= low.len();
    worth.then(|| Lattice { origin: [0.0; 3], step: (e.clamp(-1000, 1000) as f64).exp2(), parts: 1.0 })
}

/// Most coordinates have few decimals.
fn find_decimal(p: &Places) -> Option<Lattice> {
    let largest = sample(p).flatten().map(f64::abs).fold(0.0, f64::max);
    let round = |x: f64| if p.is_f64() { x } else { x as f32 as f64 };
    let share = |l: &Lattice| {
        let (mut hits, mut all) = (0, 0);
        for x in sample(p) {
            let hit = (0..3).all(|k| round(l.at(k, l.nearest(k, x[k]))).to_bits() == x[k].to_bits());
            (hits, all) = (hits + hit as usize, all + 1);
        }
        (hits, all)
    };
    let limit = if p.is_f64() { 2f64.powi(48) } else { 2f64.powi(22) };
    let mut best: Option<(usize, Lattice)> = None;
    for digits in 1..=15 {
        let l = Lattice { origin: [0.0; 3], step: 1.0, parts: 10f64.powi(digits) };
        if largest * l.parts > limit {
            break;
        }
        let (hits, all) = share(&l);
        // A third of the places is worth the flag; a digit more must bring a tenth more.
        if 3 * hits >= all && all >= 16 && best.is_none_or(|(h, _)| 10 * hits > 11 * h) {
            best = Some((hits, l));
        }
    }
    best.map(|(_, l)| l)
}

/// Moves all places onto a grid of `2^bits` cells along the longest side of their box; returns the grid, and how far a place moved at most.
pub(super) fn quantise(pm: &mut ProgressiveMesh, bits: u32) -> Option<(Lattice, f64)> {
    let [new, moved] = [pm.new_positions.plain(), pm.moved_positions.plain()];
    let mut all = [&mut pm.base_positions, new, moved];
    let bounds = all.iter().filter_map(|p| p.bounds());
    let (low, high) = bounds.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
    let side = (high - low).max_element();
    let cells = (1u64 << bits) as f64;
    // A mesh without extent keeps its one place.
    let step = if side > 0.0 { side / cells } else { 1.0 };
    let grid = Some(Lattice { origin: low.to_array(), step, parts: 1.0 }).filter(Lattice::is_sound)?;
    let mut error = 0.0f64;
    for p in &mut all {
        for i in 0..p.len() {
            let x = p.get(i).to_array();
            let to = DVec3::from_array(std::array::from_fn(|k| grid.at(k, grid.nearest(k, x[k]))));
            p.set(i, to);
            error = error.max(p.get(i).distance(DVec3::from_array(x)));
        }
    }
    Some((grid, error))
}

/// Faces at full detail of which two corners are at one place.
pub(super) fn flat_faces(pm: &ProgressiveMesh) -> Option<u32> {
    let mut c = pm.cursor().ok()?;
    c.seek(usize::MAX).ok()?;
    let at = |w: u32| c.positions().bits(c.wedge_vertex(w) as usize);
    let flat = c.indices().iter().filter(|f| {
        let [a, b, d] = f.map(at);
        a == b || b == d || d == a
    });
    Some(flat.count() as u32)
}
