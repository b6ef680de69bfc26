//! In which order splits come, by the ring rule: by classes of their errors, and so that no face turns over.
//!
//! Splits that cost little are undone first, so that views which do not need them need nothing that hangs on them. But where the surface is flat, errors do not tell in which order faces stay on the right side: undone in another order than
//! they were recorded in, or with places rounded, splits turn faces over, and the mesh is *folded* there, three faces deep. No distance shows that; but what lies on the fold is carried along with it, until a later collapse takes the fold
//! out and it is left behind: so the error of that one is as large as the fold is deep. Therefore a split that would turn a face over waits: until the faces around it are such that nothing turns, or until splits are undone whose errors
//! are as large. (Fandisk: without that a few of the finest splits have errors of 0.7 % of the diagonal, and views need twice as many faces.)

use super::Finest;
use super::forest::Forest;
use crate::aif::NONE;
use crate::progressive::ProgressiveMesh;
use crate::selective::Front;
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Classes of errors for each factor of two. Within one, splits keep their order: between 1 and 100 little changes.
const CLASSES: f64 = 2.0;
/// Errors below this, of the diagonal, are of one class. On fandisk, where most are noise, an order by noise chains splits that have nothing to do with each other: nine times as many
/// faces are shown.
const FLOOR: f64 = 1.0 / 65536.0;
/// How often splits that wait are asked again in a class, at most: so that many of them do not take more than that, each time.
const PASSES: u32 = 64;
/// A star is flat if its area, as a vector, is at least this part of the sum of its faces' areas.
const FLAT: f64 = 0.9;

/// The splits by classes of their errors, the largest first, none before one whose faces it needs, and none that turns a face over, when those behind it are undone, by more than its class. `front` is at full
/// detail. O(n log n), and a look at the ring for each time one that waits is asked: [`PASSES`] in each class, at most.
pub(super) fn by_errors(
    mesh: &ProgressiveMesh,
    forest: &Forest,
    front: Front,
    finest: Finest,
    errors: &[f64],
) -> Vec<u32> {
    let Finest { mut positions, origin, diagonal, .. } = finest;
    let floor = FLOOR * diagonal;
    let class = |e: f64| (e.max(floor).log2() * CLASSES).floor() as i32;
    let needs = mesh.dependencies();
    // Splits that are to be undone before.
    let mut hang = vec![0u32; errors.len()];
    needs.iter().flatten().filter(|&&d| d != NONE).for_each(|&d| hang[d as usize] += 1);
    let mut heap: BinaryHeap<(Reverse<i32>, u32)> = BinaryHeap::new();
    let entry = |i: u32| (Reverse(class(errors[i as usize])), i);
    heap.extend((0..errors.len() as u32).filter(|&i| hang[i as usize] == 0).map(entry));
    let mut turned = Turned { front, star: Vec::new() };
    let mut order = Vec::with_capacity(errors.len());
    // Those that would turn faces over, and the class that they wait for.
    let mut waiting: Vec<(i32, u32)> = Vec::new();
    let (mut now, mut undone, mut passes) = (i32::MIN, 0, 0);
    loop {
        if heap.peek().is_none_or(|&(Reverse(c), _)| c > now) {
            // Before the next class: what is around those that wait may be other than it was.
            passes += 1;
            if order.len() == undone || passes > PASSES {
                passes = 0;
                let next = heap.peek().map(|&(Reverse(c), _)| c).into_iter();
                let Some(c) = next.chain(waiting.iter().map(|w| w.0)).min() else { break };
                now = c;
            }
            undone = order.len();
            heap.extend(waiting.drain(..).map(|(_, i)| (Reverse(now), i)));
        }
        let Some((_, i)) = heap.pop() else { continue };
        let vs = mesh.splits.vertex[i as usize];
        let own = forest.place_before(mesh, vs, i) - origin;
        let deep = turned.depth([vs, forest.base_vertices + i], mesh, i, own, &positions);
        if deep > floor && class(deep) > now {
            waiting.push((class(deep), i));
            continue;
        }
        turned.front.unsplit(mesh, forest, i);
        positions[vs as usize] = own;
        order.push(i);
        for &d in needs[i as usize].iter().filter(|&&d| d != NONE) {
            hang[d as usize] -= 1;
            if hang[d as usize] == 0 {
                heap.push(entry(d));
            }
        }
    }
    order.reverse();
    order
}

struct Turned {
    front: Front,
    star: Vec<u32>,
}

/// Twice the area of a triangle, as a vector.
fn area(p: [DVec3; 3]) -> DVec3 {
    (p[1] - p[0]).cross(p[2] - p[0])
}

/// The least height of a triangle.
fn height(p: [DVec3; 3]) -> f64 {
    let longest = (0..3).map(|k| p[k].distance(p[(k + 1) % 3])).fold(0.0, f64::max);
    if longest > 0.0 { area(p).length() / longest } else { 0.0 }
}

impl Turned {
    /// How deep the fold is that undoing split `i` makes or makes deeper, its vertices, `parts`, going to `own`; 0 if no face turns over. In a flat star a face is turned by how it lies to the others, else by how it lay before.
    fn depth(
        &mut self,
        parts: [u32; 2],
        mesh: &ProgressiveMesh,
        i: u32,
        own: DVec3,
        positions: &[DVec3],
    ) -> f64 {
        let Turned { front, star } = self;
        star.clear();
        for h in front.middle(mesh, i) {
            front.star(h, star);
        }
        let corners = |slot: u32| front.corners()[slot as usize].map(|w| front.wedge_vertex(w));
        let (mut sum, mut all) = (DVec3::ZERO, 0.0);
        for &slot in star.iter() {
            let a = area(corners(slot).map(|v| positions[v as usize]));
            (sum, all) = (sum + a, all + a.length());
        }
        let flat = sum.length() > FLAT * all;
        let mut deep = 0.0f64;
        for &slot in star.iter() {
            let f = corners(slot);
            // Those at both vertices go.
            if parts.iter().all(|v| f.contains(v)) {
                continue;
            }
            let before = f.map(|v| positions[v as usize]);
            let after = f.map(|v| if parts.contains(&v) { own } else { positions[v as usize] });
            let was = area(before);
            if area(after).dot(if flat { sum } else { was }) < 0.0 {
                let old = if flat && was.dot(sum) < 0.0 { height(before) } else { 0.0 };
                let new = height(after);
                if new > old {
                    deep = deep.max(new);
                }
            }
        }
        deep
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aif::{Mesh, NONE};
    use crate::hierarchy::{Rule, estimate, finest};
    use crate::progressive::build;
    use crate::simplify::{Options, Quiet};

    /// A square of n by n cells, a step in the middle, with vertices off the lines where it is flat.
    fn step(n: usize) -> Mesh {
        let at = |k: usize| {
            let (x, y) = (k % (n + 1), k / (n + 1));
            let off = |a: usize, b: usize| {
                let inside = a > 0 && a < n && a != n / 2 && b > 0 && b < n && b != n / 2;
                if inside { ((a * 7 + b * 5) % 11) as f32 / 11.0 - 0.5 } else { 0.0 }
            };
            let (u, v) = (x as f32 + 0.7 * off(x, y), y as f32 + 0.7 * off(y, x));
            [u, v, (u - n as f32 / 2.0).max(0.0)]
        };
        let quad = |k: usize| {
            let (x, y) = (k % n, k / n);
            let a = (y * (n + 1) + x) as u32;
            let b = a + n as u32 + 1;
            [[a, a + 1, b], [a + 1, b + 1, b]]
        };
        let positions: Vec<[f32; 3]> = (0..(n + 1) * (n + 1)).map(at).collect();
        Mesh::from_triangles(positions, &(0..n * n).flat_map(quad).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn needed_splits_come_first_and_flat_faces_do_not_turn_over() {
        // Places on a grid, as files have them: rounding turns slivers over.
        let mut options = Options::default();
        options.grid = Some(1.0 / 8.0);
        let pm = build(step(24), &options, &Quiet).unwrap().mesh;
        let (forest, front, _) = finest(&pm, Rule::Rings).unwrap();
        let full = Finest::new(&pm, &forest, &front);
        let errors = estimate::errors(&pm, &forest, front.clone(), &full);
        let order = by_errors(&pm, &forest, front, full, &errors);
        let mut place = vec![NONE; order.len()];
        order.iter().zip(0..).for_each(|(&i, k)| place[i as usize] = k);
        assert!(place.iter().all(|&k| k != NONE));
        for (i, on) in pm.dependencies().iter().enumerate() {
            assert!(on.iter().all(|&d| d == NONE || place[d as usize] < place[i]));
        }
        // Down by that order, as long as it is flat: no face lies with its back up.
        let pm = pm.reordered(&order).unwrap();
        let (forest, mut front, _) = finest(&pm, Rule::Rings).unwrap();
        let full = Finest::new(&pm, &forest, &front);
        let errors = estimate::errors(&pm, &forest, front.clone(), &full);
        let floor = FLOOR * full.diagonal;
        let mut positions = full.positions.clone();
        let mut seen = 0;
        for i in (0..order.len() as u32).rev() {
            if errors[i as usize] > floor {
                break;
            }
            let vs = pm.splits.vertex[i as usize];
            front.unsplit(&pm, &forest, i);
            positions[vs as usize] = forest.place_before(&pm, vs, i) - full.origin;
            seen += 1;
        }
        let faces: Vec<_> =
            front.corners().iter().map(|f| f.map(|w| positions[front.wedge_vertex(w) as usize])).collect();
        let over = faces.iter().filter(|&&f| area(f).z < 0.0 && height(f) > floor).count();
        assert!(seen > 300 && over == 0, "{seen} {over}");
    }
}
