//! Vertex clustering on a uniform grid (Rossignac & Borrel 1993): all vertices in a cell become one.
//!
//! Fast and coarse: no queue, no topology. Faces with two corners in one cell vanish, thin parts close up, handles and gaps narrower
//! than a cell disappear, complex edges may arise. The result is a mesh in the sense of [`Mesh::check`].
//!
//! - The grid is of cubes, one size for all meshes in world units, from the low corner of each mesh's bounds; the resolution (cells along
//!   the longest side) is searched for the most triangles that do not exceed the target. The count is no monotone function of the
//!   resolution, so a better one may exist; a grid meets a target to within some percent, not exactly.
//! - A grid that leaves no triangle is never taken: where none leaves some without exceeding the target, it is the coarsest found that
//!   leaves any, and the target is missed. That one is also taken when there is neither target nor bound. If no grid leaves any (all
//!   faces are degenerate), the mesh stays as it is.
//! - [`Options::max_error`]: the diagonal of a cell is at most that, so that no vertex moves farther (up to the rounding of stored
//!   positions). Below the diagonal of the finest cells ([`MAX_RESOLUTION`] along a side) nothing is done.
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
    for (i, (mesh, &scale)) in meshes.iter_mut().zip(scales).enumerate() {
        sources.push(Source::new(mesh, &options.of_mesh(i), scale)?);
    }
    let cut: Vec<usize> = sources.iter().map(|s| s.cut).collect();
    let isolated: Vec<usize> = sources.iter().map(Source::isolated).collect();
    let extent = sources.iter().map(|s| s.extent).fold(0.0, f64::max);
    // The bound holds for every mesh in its own units: the smallest cell that any asks for.
    let cells = |b| sources.iter().map(|s| extent / s.cell_for(b)).fold(1.0, f64::max).ceil();
    let coarsest = options.max_error.map_or(1.0, cells);
    let mut found = None;
    let mut stop = Stop::Target;
    if total > target && coarsest > MAX_RESOLUTION as f64 {
        stop = Stop::Error;
    } else if total > target {
        let coarsest = coarsest as u32;
        let mut count = |n: u32| {
            let mut sum = 0;
            for s in &mut sources {
                sum += s.count(extent / n as f64, target.saturating_sub(sum));
            }
            sum
        };
        found = search(target, coarsest, &mut count, control);
        stop = match found {
            _ if control.cancelled() => Stop::Cancelled,
            Some(grid) if grid.left <= target => Stop::Target,
            Some(grid) if grid.resolution == coarsest && options.max_error.is_some() => Stop::Error,
            _ => Stop::NoLegalCollapse,
        };
    }
    let mut estimates = vec![0.0; sources.len()];
    let mut origins = vec![None; sources.len()];
    if let Some(Grid { resolution, .. }) = found.filter(|_| stop != Stop::Cancelled) {
        for (i, source) in sources.iter_mut().enumerate() {
            if control.cancelled() {
                stop = Stop::Cancelled;
                break;
            }
            control.progress(0.5 + 0.5 * i as f64 / before.len() as f64);
            let (estimate, origin) = source.replace(extent / resolution as f64, options);
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

/// A resolution, and how many triangles its grid leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Grid {
    resolution: u32,
    left: usize,
}

/// How many grids just coarser than one that leaves nothing are tried.
const COARSER: u32 = 16;

/// The finest grid found, of those no coarser than `coarsest`, that leaves some triangles and at most `target`; where there is none, the
/// one that leaves the fewest. `None` if no grid leaves any, or when cancelled.
///
/// Assumes that counts rise with the resolution as its square, on the whole; takes about ten counts.
fn search(
    target: usize,
    coarsest: u32,
    count: &mut dyn FnMut(u32) -> usize,
    control: &dyn Control,
) -> Option<Grid> {
    let (mut low, mut high) = (coarsest - 1, MAX_RESOLUTION + 1);
    let (mut within, mut beyond): (Option<Grid>, Option<Grid>) = (None, None);
    let mut next = ((target as f64 / 3.0).sqrt() as u32).clamp(coarsest, MAX_RESOLUTION);
    for step in 0.. {
        if high - low <= 1 {
            break;
        }
        if control.cancelled() {
            return None;
        }
        let left = count(next);
        let grid = Some(Grid { resolution: next, left });
        if left <= target {
            low = next;
            // Each is finer than the one before.
            within = if left > 0 { grid } else { within };
        } else {
            high = next;
            beyond = grid;
        }
        control.progress((0.5 * step as f64 / 40.0).min(0.5));
        let guess = next as f64 * (target as f64 / left.max(1) as f64).sqrt();
        let middle = if high > MAX_RESOLUTION { low.saturating_mul(2) } else { low + (high - low) / 2 };
        // Guesses and halvings in turn: fast as a rule, and never slow.
        next = if step % 2 == 0 { guess.round() as u32 } else { middle };
        next = next.clamp(low + 1, (high - 1).max(low + 1));
    }
    // Counts are not monotone: below a grid that leaves nothing there may be one that leaves something.
    let mut resolution = low;
    while within.is_none() && resolution > coarsest && resolution + COARSER > low {
        resolution -= 1;
        let left = count(resolution);
        let grid = Some(Grid { resolution, left }).filter(|g| g.left > 0);
        match grid {
            Some(g) if g.left <= target => within = grid,
            Some(g) if beyond.is_none_or(|b| g.left <= b.left) => beyond = grid,
            _ => {}
        }
    }
    within.or(beyond)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::Quiet;

    fn find(target: usize, coarsest: u32, mut count: impl FnMut(u32) -> usize) -> Option<(u32, usize)> {
        search(target, coarsest, &mut count, &Quiet).map(|g| (g.resolution, g.left))
    }

    #[test]
    fn the_finest_grid_below_the_target_is_found_in_few_counts() {
        for target in [2, 7, 100, 12_345, 3_000_000] {
            let mut counts = 0;
            let found = find(target, 1, |n| {
                counts += 1;
                2 * (n as usize).pow(2)
            });
            let n = ((target as f64 / 2.0).sqrt()) as usize;
            assert_eq!(found, Some((n as u32, 2 * n * n)), "{target}");
            assert!(counts <= 14, "{counts} counts for {target}");
        }
    }

    #[test]
    fn a_count_that_never_rises_ends_at_the_finest_grid() {
        assert_eq!(find(5, 1, |_| 3), Some((MAX_RESOLUTION, 3)));
        assert_eq!(find(5, 1, |_| 6), Some((1, 6)));
        assert_eq!(find(5, 9, |_| 6), Some((9, 6)));
    }

    #[test]
    fn a_grid_that_leaves_nothing_is_not_taken() {
        // Nothing, then at once more than the target.
        for k in [2, 3, 900] {
            assert_eq!(find(4, 1, |n| if n < k { 0 } else { 12 }), Some((k, 12)));
            assert_eq!(find(0, 1, |n| if n < k { 0 } else { 12 }), Some((k, 12)));
        }
        // Something in between, with nothing above it.
        assert_eq!(find(4, 1, |n| [0, 0, 0, 2, 0, 0, 12][(n as usize).min(6)]), Some((3, 2)));
        assert_eq!(find(4, 1, |n| [0, 0, 0, 8, 0, 0, 12][(n as usize).min(6)]), Some((3, 8)));
        assert_eq!(find(4, 1, |_| 0), None);
    }

    #[test]
    fn no_grid_is_coarser_than_the_coarsest() {
        assert_eq!(find(50, 20, |n| n as usize), Some((50, 50)));
        assert_eq!(find(50, 70, |n| n as usize), Some((70, 70)));
        assert_eq!(find(0, 70, |n| if n < 90 { 0 } else { 1 }), Some((90, 1)));
    }
}
