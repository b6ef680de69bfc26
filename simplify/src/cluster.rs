//! Vertex clustering on a uniform grid (Rossignac & Borrel 1993): all vertices in a cell become one.
//!
//! Fast and coarse: no queue, no topology. Faces with two corners in one cell vanish, thin parts close up, handles and gaps narrower
//! than a cell disappear, complex edges may arise. The result is a mesh in the sense of [`Mesh::check`].
//!
//! - The grid is of cubes, one size for all meshes in world units, from the low corner of each mesh's bounds; the resolution (cells along
//!   the longest side) is searched for the most triangles that do not exceed the target. The count is no monotone function of the
//!   resolution, so a better one may exist; a grid meets a target to within some percent, not exactly.
//! - [`Options::max_error`]: the diagonal of a cell is at most that, so that no vertex moves farther (up to the rounding of stored
//!   positions). With neither target nor bound there is one cell, and nothing is left.
//! - Placement inside the cell: the centroid of its vertices (midpoint); the least of the planes of the faces at its vertices, clamped
//!   into the cell (optimal); the vertex nearest to that (endpoint).
//! - Of several triangles with the same corners in the same rotation the first stays; those that look the other way stay too.
//! - Attributes: corners in a cell whose faces hang together without crossing a seam get one wedge, the average of theirs; joints and
//!   their weights are those of the corner nearest to the new place.
//! - Locked vertices, and those of the border under [`Options::lock_border`], have a cell to themselves.
//! - Polygons are cut into triangles first. [`Options::vertex_weights`] weigh vertices and planes within a cell.

mod grid;
mod represent;

use crate::finish::{Before, finish, target};
use crate::options::{Control, Level, Options, Outcome, SimplifyError, Stop};
use grid::{MAX_RESOLUTION, Source};
use progmesh_aif::Mesh;
use std::time::Instant;

/// [`crate::simplify_all`] by this method.
pub(crate) fn simplify_all(
    meshes: &mut [Mesh],
    scales: &[f64],
    options: &Options,
    control: &dyn Control,
) -> Result<Vec<Outcome>, SimplifyError> {
    let start = Instant::now();
    let before: Vec<Before> = meshes.iter().map(Before::of).collect();
    let total: usize = before.iter().map(|b| b.triangles).sum();
    let target = target(options, total);
    let mut sources = Vec::with_capacity(meshes.len());
    for (mesh, &scale) in meshes.iter_mut().zip(scales) {
        sources.push(Source::new(mesh, options, scale)?);
    }
    let cut: Vec<usize> = sources.iter().map(|s| s.cut).collect();
    let isolated: Vec<usize> = sources.iter().map(Source::isolated).collect();
    let extent = sources.iter().map(|s| s.extent).fold(0.0, f64::max);
    let bounded = options.max_error.map(|b| {
        // The bound holds for every mesh in its own units: the smallest cell that any asks for.
        let cells = |s: &Source<'_>| extent / s.cell_for(b);
        (sources.iter().map(cells).fold(1.0, f64::max).min(MAX_RESOLUTION as f64).ceil() as u32).max(1)
    });
    let mut found = None;
    let has_target = options.triangles.is_some() || options.ratio.is_some();
    let mut stop = Stop::Target;
    if total > target {
        let mut count = |n: u32| {
            let mut sum = 0;
            for s in &mut sources {
                sum += s.count(extent / n as f64, target.saturating_sub(sum));
            }
            sum
        };
        let by_target =
            if has_target || bounded.is_none() { search(target, &mut count, control) } else { None };
        // The first of the two that is reached, coming from the fine side: the finer.
        let n = by_target.max(bounded).unwrap_or(1);
        stop = match () {
            _ if control.cancelled() => Stop::Cancelled,
            _ if by_target.is_none_or(|t| t < n) && bounded.is_some() => Stop::Error,
            _ if count(n) > target => Stop::NoLegalCollapse,
            _ if has_target => Stop::Target,
            _ => Stop::NoLegalCollapse,
        };
        found = (stop != Stop::Cancelled).then_some(n);
    }
    let mut estimates = vec![0.0; sources.len()];
    let mut origins = vec![None; sources.len()];
    if let Some(n) = found {
        for (i, source) in sources.iter_mut().enumerate() {
            if control.cancelled() {
                stop = Stop::Cancelled;
                break;
            }
            control.progress(0.5 + 0.5 * i as f64 / before.len() as f64);
            let (estimate, origin) = source.replace(extent / n as f64, options);
            estimates[i] = estimate;
            origins[i] = Some(origin);
        }
    }
    drop(sources);
    control.progress(1.0);
    let seconds = start.elapsed().as_secs_f64();
    let each = meshes.iter_mut().zip(&before).enumerate();
    Ok(each
        .map(|(i, (mesh, before))| {
            let level = Level { pass: 1, faces: mesh.face_count(), seconds, ..Level::default() };
            let mut outcome = finish(mesh, before, options, (stop, estimates[i], vec![level]));
            if let Some(origin) = origins[i].take() {
                outcome.vertex_origin = origin;
                outcome.triangulated = cut[i];
                outcome.isolated_removed = if options.keep_vertices { 0 } else { isolated[i] };
            }
            outcome
        })
        .collect())
}

/// The finest resolution found whose count does not exceed the target; `None` if not even one cell does, or when cancelled.
/// Assumes that counts rise with the resolution as its square, on the whole; takes about ten counts.
fn search(target: usize, count: &mut dyn FnMut(u32) -> usize, control: &dyn Control) -> Option<u32> {
    let (mut low, mut high) = (0u32, MAX_RESOLUTION + 1);
    let mut next = ((target as f64 / 3.0).sqrt() as u32).clamp(1, MAX_RESOLUTION);
    for step in 0.. {
        if high - low <= 1 || control.cancelled() {
            break;
        }
        let n = count(next);
        if n <= target {
            low = next
        } else {
            high = next
        }
        control.progress((0.5 * step as f64 / 40.0).min(0.5));
        let guess = next as f64 * (target as f64 / n.max(1) as f64).sqrt();
        let middle = if high > MAX_RESOLUTION { low.saturating_mul(2) } else { low + (high - low) / 2 };
        // Guesses and halvings in turn: fast as a rule, and never slow.
        next = if step % 2 == 0 { guess.round() as u32 } else { middle };
        next = next.clamp(low + 1, (high - 1).max(low + 1));
    }
    (low > 0).then_some(low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::Quiet;

    #[test]
    fn the_finest_grid_below_the_target_is_found_in_few_counts() {
        for target in [1, 2, 7, 100, 12_345, 3_000_000] {
            let mut counts = 0;
            let mut count = |n: u32| {
                counts += 1;
                2 * (n as usize).pow(2)
            };
            let n = search(target, &mut count, &Quiet);
            assert_eq!(n.unwrap_or(0) as usize, ((target as f64 / 2.0).sqrt() as usize), "{target}");
            assert!(counts <= 14, "{counts} counts for {target}");
        }
    }

    #[test]
    fn a_count_that_never_rises_ends_at_the_finest_grid() {
        assert_eq!(search(5, &mut |_| 3, &Quiet), Some(MAX_RESOLUTION));
        assert_eq!(search(5, &mut |_| 6, &Quiet), None);
    }
}
