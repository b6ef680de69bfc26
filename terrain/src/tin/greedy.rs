//! Greedy insertion (Garland & Heckbert 1995): a Delaunay triangulation that gets the farthest sample as a vertex, again and again.

use super::Control;
use super::breaklines::Placed;
use super::delaunay::Triangulation;
use super::field::{Field, Tolerance};
use super::queue::Buckets;
use super::region::Region;
use super::scan::{Corner, Crossing, beyond, crossings};

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Goal {
    pub tolerance: Tolerance,
    /// Whether the tolerance holds between samples too.
    pub surface: bool,
    /// At most this many triangles, unless the outline needs more.
    pub triangles: usize,
}

/// No sample, and a triangle that is to be looked at.
const NONE: u32 = u32::MAX;
const LISTED: u32 = u32::MAX - 1;

/// Makes lines sides, and inserts samples until all lie within the tolerance. `None` when cancelled.
///
/// O(samples log vertices) in practice: each insertion looks at the samples of the triangles it changes, about six.
pub(super) fn greedy(
    field: &Field,
    region: &Region,
    goal: Goal,
    lines: &[[(i32, i32); 2]],
    control: &dyn Control,
) -> Option<(Triangulation, Placed)> {
    let mut mesh = Triangulation::new(field.columns, field.rows);
    region.constrain(&mut mesh);
    let placed = mesh.constrain_lines(lines);
    complete(field, &mut mesh, goal, control)?;
    Some((mesh, placed))
}

/// Inserts samples into a triangulation that is there until it keeps the tolerance, between samples too if that is asked for. `None` when cancelled.
pub(super) fn complete(
    field: &Field,
    mesh: &mut Triangulation,
    goal: Goal,
    control: &dyn Control,
) -> Option<()> {
    refine(field, mesh, goal, control)?;
    while goal.surface && mend(field, mesh, goal) {
        refine(field, mesh, goal, control)?;
    }
    Some(())
}

/// Inserts a sample beside where a side leaves the tolerance most, for every triangle that has such a side; false if none has.
///
/// It ends: sides of a unit between two vertices are always there, so whatever crosses one has an end that is no vertex yet; where a
/// cell of four vertices has the wrong diagonal, that is turned.
fn mend(field: &Field, mesh: &mut Triangulation, goal: Goal) -> bool {
    let mut is_vertex = vec![false; field.h.len()];
    for &(x, y) in &mesh.points {
        is_vertex[field.index(x, y)] = true;
    }
    let at = |sample: u32| {
        let columns = field.columns as usize;
        ((sample as usize % columns) as i32, (sample as usize / columns) as i32)
    };
    let (mut samples, mut diagonals) = (vec![], vec![]);
    let mut inside = 0;
    for t in (0..mesh.triangles() as u32).filter(|&t| !mesh.is_outside(t)) {
        inside += 1;
        let corners = mesh.corners(t).map(|v| {
            let (x, y) = mesh.points[v as usize];
            Corner { x, y, z: field.at(x, y) }
        });
        let mut worst: Option<Crossing> = None;
        for i in 0..3 {
            crossings(field, corners[i], corners[(i + 1) % 3], |c| {
                let beyond = c.miss.abs() > goal.tolerance.over(c.parts);
                let size = |c: &Crossing| i128::from(c.miss.abs());
                let worse = |w: Crossing| size(&c) * i128::from(w.parts) > size(&w) * i128::from(c.parts);
                if beyond && worst.is_none_or(worse) {
                    worst = Some(c);
                }
            });
        }
        let Some(crossing) = worst else { continue };
        match crossing.ends.into_iter().find(|&s| !is_vertex[s as usize]) {
            Some(sample) => samples.push(sample),
            None => diagonals.push(crossing.ends),
        }
    }
    samples.sort_unstable();
    samples.dedup();
    let room = goal.triangles.saturating_sub(inside) / 2;
    samples.truncate(room);
    let changes = !samples.is_empty() || !diagonals.is_empty() && room > 0;
    for sample in samples {
        mesh.insert(at(sample));
    }
    for [a, b] in diagonals {
        mesh.turn_diagonal(at(a), at(b));
    }
    changes
}

/// The same, of a triangulation that is there: what its `changed` lists is looked at first.
pub(super) fn refine(
    field: &Field,
    mesh: &mut Triangulation,
    goal: Goal,
    control: &dyn Control,
) -> Option<()> {
    let columns = field.columns as usize;
    // Vertices with their heights, so that a triangle needs no look at the grid but for its samples.
    let corner = |&(x, y): &(i32, i32)| Corner { x, y, z: field.at(x, y) };
    let mut corners: Vec<Corner> = mesh.points.iter().map(corner).collect();
    let mut candidate: Vec<u32> = vec![];
    let mut queue = Buckets::default();
    let mut inside = (0..mesh.triangles() as u32).filter(|&t| !mesh.is_outside(t)).count();
    let mut changed = std::mem::take(&mut mesh.changed);
    let mut steps = 0usize;
    loop {
        candidate.resize(mesh.triangles(), NONE);
        // Each once: a triangle is listed for every flip it took part in.
        for &t in &changed {
            candidate[t as usize] = LISTED;
        }
        for t in changed.drain(..) {
            if candidate[t as usize] != LISTED {
                continue;
            }
            candidate[t as usize] = NONE;
            if mesh.is_outside(t) {
                continue;
            }
            let [a, b, c] = mesh.corners(t);
            let triangle = [corners[a as usize], corners[b as usize], corners[c as usize]];
            if let Some(far) = beyond(field, goal.tolerance, triangle) {
                candidate[t as usize] = far.sample;
                queue.push(far.miss as f32 / far.area as f32, (t, far.sample));
            }
        }
        let next = loop {
            match queue.pop() {
                Some((t, sample)) if candidate[t as usize] == sample => break Some((t, sample)),
                Some(_) => {}
                None => break None,
            }
        };
        let Some((t, sample)) = next else { return Some(()) };
        if inside + 2 > goal.triangles {
            return Some(());
        }
        steps += 1;
        if steps.is_multiple_of(4096) {
            if control.cancelled() {
                return None;
            }
            control.progress(steps as f64 / (steps + queue.len()) as f64);
        }
        let p = ((sample as usize % columns) as i32, (sample as usize / columns) as i32);
        let before = mesh.triangles();
        mesh.insert_in(t, p);
        corners.push(Corner { x: p.0, y: p.1, z: field.h[sample as usize] });
        inside += (before..mesh.triangles()).filter(|&t| !mesh.is_outside(t as u32)).count();
        std::mem::swap(&mut changed, &mut mesh.changed);
    }
}
