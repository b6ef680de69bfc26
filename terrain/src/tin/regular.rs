//! Regular subsampling: every k-th row and column.

use super::Control;
use super::delaunay::Triangulation;
use super::field::{Field, Tolerance};
use super::network::Network;
use super::parallel;
use super::region::Region;
use super::scan;

/// Where no step keeps the error, every sample is a vertex.
const EVERY: usize = 1;

/// Vertices at every `step`-th column and row, the last of each, and the outline of the valid region.
fn with_step(field: &Field, region: &Region, step: usize) -> Network {
    if step == EVERY {
        return Network::full(field, region);
    }
    let mut mesh = Triangulation::new(field.columns, field.rows);
    region.constrain(&mut mesh);
    let lines = |n: i32| {
        let steps = (0..n - 1).step_by(step);
        steps.chain([n - 1]).collect::<Vec<_>>()
    };
    let columns = lines(field.columns);
    for (i, y) in lines(field.rows).into_iter().enumerate() {
        let mut insert = |&x: &i32| {
            if region.uses(x, y) {
                mesh.insert((x, y));
            }
        };
        // There and back, so that the walk to the next is short.
        if i % 2 == 0 {
            columns.iter().for_each(&mut insert)
        } else {
            columns.iter().rev().for_each(&mut insert)
        }
    }
    Network::of(&mesh, field)
}

/// The network of the greatest step that keeps the tolerance and the count: the last good one of 2, 4, 8, ..., then halving the gap.
/// Errors need not grow with the step, so a greater one may exist. `None` when cancelled.
pub(super) fn regular(
    field: &Field,
    region: &Region,
    tolerance: Option<Tolerance>,
    surface: bool,
    triangles: Option<usize>,
    control: &dyn Control,
) -> Option<(Network, usize)> {
    let keeps = |network: &Network| {
        let within = |t: &[u32; 3]| {
            let corners = t.map(|v| network.vertices[v as usize]);
            tolerance.is_none_or(|tolerance| scan::keeps(field, tolerance, surface, corners))
        };
        parallel::map(network.triangles.chunks(4096).collect(), |c: &[[u32; 3]]| c.iter().all(within))
            .into_iter()
            .all(|kept| kept)
    };
    let few = |network: &Network| triangles.is_none_or(|most| network.triangles.len() <= most);
    let most = field.columns.max(field.rows) as usize - 1;
    let (mut good, mut bad) = (EVERY, most + 1);
    if tolerance.is_some() {
        // The greatest step whose error is kept.
        let mut step = 2;
        while step <= most {
            if control.cancelled() {
                return None;
            }
            if !keeps(&with_step(field, region, step)) {
                bad = step;
                break;
            }
            good = step;
            step *= 2;
        }
        while bad - good > 1 {
            if control.cancelled() {
                return None;
            }
            let middle = good.midpoint(bad);
            if keeps(&with_step(field, region, middle)) {
                good = middle;
            } else {
                bad = middle;
            }
        }
    }
    let mut network = with_step(field, region, good);
    if !few(&network) {
        // The least step with few enough triangles: counts fall as steps grow.
        let (mut many, mut ok) = (good, most.max(good));
        while ok - many > 1 {
            if control.cancelled() {
                return None;
            }
            let middle = many.midpoint(ok);
            if few(&with_step(field, region, middle)) {
                ok = middle;
            } else {
                many = middle;
            }
        }
        good = ok;
        network = with_step(field, region, good);
    }
    Some((network, good))
}
