//! Closing the cut of a mesh: loops, holes in them, triangles.

use super::exact::orient;
use crate::aif::triangulate_polygon;
use glam::{DVec2, DVec3};
use rustc_hash::FxHashMap;
use std::cmp::Reverse;

/// A side of a face that lies in the plane of the cut.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    /// Its vertices, as the face runs.
    pub(super) ends: [u32; 2],
    /// The face's wedges there.
    pub(super) wedges: [u32; 2],
    /// The face.
    pub(super) face: u32,
}

/// A triangle of a cap.
pub(super) struct CapTriangle {
    /// Vertices, and the wedges that their attributes come from.
    pub(super) corners: [(u32, u32); 3],
    /// The face whose material and group it takes.
    pub(super) face: u32,
}

#[derive(Default)]
pub(super) struct Caps {
    pub(super) triangles: Vec<CapTriangle>,
    pub(super) loops: usize,
    pub(super) open_edges: usize,
}

/// A loop of the cut, the way that its cap runs.
struct Loop {
    /// Vertices, wedges.
    corners: Vec<(u32, u32)>,
    places: Vec<DVec2>,
    /// A face along it, of the material and group that most of it has.
    face: u32,
    area: f64,
}

/// Caps with this normal for the sides that no other side runs against. `label` is what of a face its cap takes over.
pub(super) fn caps(
    points: &[DVec3],
    normal: DVec3,
    mut sides: Vec<Side>,
    label: &dyn Fn(u32) -> [u32; 2],
) -> Caps {
    let mut caps = Caps::default();
    unpaired(&mut sides);
    let size = normal.abs();
    // One coordinate is dropped, so that the others stay exact; seen with the normal towards the eye.
    let axis = (0..3).find(|&k| size[k] == size.max_element()).unwrap_or(2);
    let (mut x, mut y) = ((axis + 1) % 3, (axis + 2) % 3);
    if normal[axis] < 0.0 {
        std::mem::swap(&mut x, &mut y);
    }
    let place = |v: u32| DVec2::new(points[v as usize][x], points[v as usize][y]);
    let loops = trace(&sides, &place, label, &mut caps.open_edges);
    caps.loops = loops.len();
    for mut group in nest(loops) {
        let merged = bridge(&mut group);
        let flat: Vec<DVec3> = merged.places.iter().map(|p| p.extend(0.0)).collect();
        let mut cut = Vec::new();
        triangulate_polygon(&flat, &mut cut);
        caps.triangles.extend(
            cut.iter()
                .map(|t| CapTriangle { corners: t.map(|i| merged.corners[i as usize]), face: merged.face }),
        );
    }
    caps
}

/// Leaves the sides that are not one of a pair of opposite ones.
fn unpaired(sides: &mut Vec<Side>) {
    let mut balance: FxHashMap<[u32; 2], i32> = FxHashMap::default();
    for side in sides.iter() {
        let [a, b] = side.ends;
        *balance.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
    }
    sides.retain(|side| {
        let [a, b] = side.ends;
        let Some(n) = balance.get_mut(&[a.min(b), a.max(b)]) else { return false };
        let way = if a < b { 1 } else { -1 };
        let stays = *n * way > 0;
        if stays {
            *n -= way;
        }
        stays
    });
}

/// The loops that the sides make, backwards. Where several leave a vertex, that one is taken which leaves the cap's inside between: its pieces
/// touch there and do not cross.
fn trace(
    sides: &[Side],
    place: &impl Fn(u32) -> DVec2,
    label: &dyn Fn(u32) -> [u32; 2],
    open: &mut usize,
) -> Vec<Loop> {
    // A cap's side leaves where the face's arrives.
    let mut leaving: FxHashMap<u32, Vec<u32>> = FxHashMap::default();
    for (i, side) in sides.iter().enumerate() {
        leaving.entry(side.ends[1]).or_default().push(i as u32);
    }
    let mut used = vec![false; sides.len()];
    let mut loops = Vec::new();
    // Vertex -> where the path left it.
    let mut passed: FxHashMap<u32, usize> = FxHashMap::default();
    for first in 0..sides.len() {
        if used[first] {
            continue;
        }
        let mut path: Vec<u32> = vec![];
        passed.clear();
        let mut at = first as u32;
        loop {
            used[at as usize] = true;
            let [to, from] = sides[at as usize].ends;
            passed.insert(from, path.len());
            path.push(at);
            // The path may have come by here before: what lies between is a loop.
            if let Some(&k) = passed.get(&to) {
                let closed = path.split_off(k);
                closed.iter().for_each(|&s| {
                    passed.remove(&sides[s as usize].ends[1]);
                });
                loops.push(make_loop(sides, &closed, place, label));
            }
            let (p, q) = (place(from), place(to));
            let free = leaving.get(&to).into_iter().flatten().copied().filter(|&s| !used[s as usize]);
            // The angle from the way back to the way out, clockwise.
            let clockwise = |s: u32| {
                let (out, back) = (place(sides[s as usize].ends[0]) - q, p - q);
                let angle = back.perp_dot(out).atan2(back.dot(out));
                if angle < 0.0 { -angle } else { std::f64::consts::TAU - angle }
            };
            match free.min_by(|&a, &b| clockwise(a).total_cmp(&clockwise(b)).then(a.cmp(&b))) {
                Some(following) => at = following,
                None => break,
            }
        }
        *open += path.len();
    }
    loops
}

fn make_loop(
    sides: &[Side],
    path: &[u32],
    place: &impl Fn(u32) -> DVec2,
    label: &dyn Fn(u32) -> [u32; 2],
) -> Loop {
    let side = |&s: &u32| &sides[s as usize];
    let corners: Vec<_> = path.iter().map(|s| (side(s).ends[1], side(s).wedges[1])).collect();
    let places: Vec<_> = corners.iter().map(|&(v, _)| place(v)).collect();
    // Label -> how often, and its least face.
    let mut count: FxHashMap<[u32; 2], (usize, Reverse<u32>)> = FxHashMap::default();
    for face in path.iter().map(|s| side(s).face) {
        let entry = count.entry(label(face)).or_insert((0, Reverse(face)));
        *entry = (entry.0 + 1, entry.1.max(Reverse(face)));
    }
    let face = count.values().max().map_or(0, |most| most.1.0);
    let area = area(&places);
    Loop { corners, places, face, area }
}

/// Twice the area of a polygon, about its first corner.
fn area(p: &[DVec2]) -> f64 {
    p.windows(2).skip(1).map(|w| (w[0] - p[0]).perp_dot(w[1] - p[0])).sum()
}

/// Loops in groups: an outer one, and the holes right inside of it. A hole that is in none is a group of its own.
fn nest(loops: Vec<Loop>) -> Vec<Vec<Loop>> {
    let (outer, holes): (Vec<Loop>, Vec<Loop>) = loops.into_iter().partition(|l| l.area >= 0.0);
    let mut groups: Vec<Vec<Loop>> = outer.into_iter().map(|l| vec![l]).collect();
    let mut alone = Vec::new();
    for hole in holes {
        let inside = |g: &&mut Vec<Loop>| g[0].area > 0.0 && contains(&g[0], &hole);
        match groups.iter_mut().filter(inside).min_by(|a, b| a[0].area.total_cmp(&b[0].area)) {
            Some(group) => group.push(hole),
            None => alone.push(vec![hole]),
        }
    }
    groups.append(&mut alone);
    groups
}

/// True if the first corner of `inner` that is no corner of `outer` lies in it.
fn contains(outer: &Loop, inner: &Loop) -> bool {
    let own = |p: &&DVec2| !outer.places.contains(p);
    let Some(&p) = inner.places.iter().find(own) else { return false };
    let n = outer.places.len();
    let mut inside = false;
    for i in 0..n {
        let (a, b) = (outer.places[i], outer.places[(i + 1) % n]);
        if (a.y > p.y) != (b.y > p.y) {
            let left = orient(a, b, p) > 0.0;
            inside ^= left == (b.y > a.y);
        }
    }
    inside
}

/// Makes one cycle of a loop and its holes, by slits to corners that see each other.
fn bridge(group: &mut Vec<Loop>) -> Loop {
    let mut holes = group.split_off(1);
    let mut merged = group.swap_remove(0);
    let least = |l: &Loop| {
        let order = |i: &usize, j: &usize| {
            let (p, q) = (l.places[*i], l.places[*j]);
            p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y))
        };
        (0..l.places.len()).min_by(order).unwrap_or(0)
    };
    // From left to right: then nothing that is still to be joined lies between a hole's leftmost corner and what is to its left.
    holes.sort_by(|a, b| {
        let (p, q) = (a.places[least(a)], b.places[least(b)]);
        p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y))
    });
    for k in 0..holes.len() {
        let start = least(&holes[k]);
        let h = holes[k].places[start];
        let mut candidates: Vec<usize> = (0..merged.places.len()).collect();
        candidates.sort_by(|&i, &j| {
            let d = |i: usize| merged.places[i].distance_squared(h);
            d(i).total_cmp(&d(j)).then(i.cmp(&j))
        });
        let sees = |&i: &usize| {
            in_corner(&merged.places, i, h) && !blocked(&merged, &holes[k..], merged.places[i], h)
        };
        // In a cut that crosses itself there may be none; some slit closes it all the same.
        let to = candidates.iter().copied().find(sees).unwrap_or(candidates[0]);
        let hole = &holes[k];
        let n = hole.corners.len();
        let round = (0..=n).map(|i| (start + i) % n);
        let corners: Vec<_> = round.clone().map(|i| hole.corners[i]).chain([merged.corners[to]]).collect();
        let places: Vec<_> = round.map(|i| hole.places[i]).chain([merged.places[to]]).collect();
        merged.corners.splice(to + 1..to + 1, corners);
        merged.places.splice(to + 1..to + 1, places);
    }
    merged
}

/// True if the way from corner `i` to `h` begins inside the polygon.
fn in_corner(p: &[DVec2], i: usize, h: DVec2) -> bool {
    let n = p.len();
    let (before, at, after) = (p[(i + n - 1) % n], p[i], p[(i + 1) % n]);
    if orient(before, at, after) >= 0.0 {
        orient(at, h, before) > 0.0 && orient(h, at, after) > 0.0
    } else {
        !(orient(at, h, after) >= 0.0 && orient(h, at, before) >= 0.0)
    }
}

/// True if an edge lies across the way from p to h, or a corner on it.
fn blocked(merged: &Loop, holes: &[Loop], p: DVec2, h: DVec2) -> bool {
    std::iter::once(merged).chain(holes).any(|l| {
        let n = l.places.len();
        (0..n).any(|i| {
            let (a, b) = (l.places[i], l.places[(i + 1) % n]);
            if a == p || a == h {
                return false;
            }
            let on = |c: DVec2| orient(p, h, c);
            if on(a) == 0.0 {
                return (a - p).dot(h - p) > 0.0 && (a - h).dot(p - h) > 0.0;
            }
            if b == p || b == h {
                return false;
            }
            (on(a) > 0.0) != (on(b) > 0.0)
                && on(b) != 0.0
                && (orient(a, b, p) > 0.0) != (orient(a, b, h) > 0.0)
        })
    })
}
