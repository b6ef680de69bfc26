//! Measures a terrain that is shown against its samples, without the code that decides what to show: how far heights look off, and whether there are cracks.

use super::terrain::Ground;
use crate::refine::view::Camera;
use crate::terrain::Grid;
use glam::DVec3;
use rustc_hash::FxHashMap;

/// What [`Ground::judge`] found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GroundJudgement {
    /// Samples inside the frustum that are shown.
    pub samples: usize,
    /// The largest distance in the picture between a sample and the place above or below it where the surface is, over the samples inside the frustum; pixels. A surface
    /// behind the eye counts as lambda * distance / near.
    pub max_pixels: f64,
    /// The mean.
    pub mean_pixels: f64,
    /// The largest difference of height among these, in the grid's units.
    pub max_height: f64,
    /// Samples of the valid region inside the frustum that no triangle covers.
    pub uncovered: usize,
    /// Edges with one face that are not on the outline of the valid region: cracks.
    pub cracks: usize,
    /// Edges of more than two faces, and triangles that look down or are flat from above.
    pub folds: usize,
}

/// How far from a sample a corner may be and still be at it, steps: what rounding in the world may do.
const AT_SAMPLE: f64 = 1e-4;

impl Ground<'_> {
    /// Measures what is shown, as triangles in the world, seen by `camera`. Every sample inside the frustum is looked at; those on a side shared by triangles against each.
    /// O(samples + area of the triangles' boxes).
    pub fn judge(&self, triangles: &[[DVec3; 3]], camera: &Camera) -> GroundJudgement {
        let own: Vec<[DVec3; 3]> =
            triangles.iter().map(|t| t.map(|p| self.to_grid.transform_point3(p))).collect();
        let (columns, rows) = (self.grid.columns(), self.grid.rows());
        let frustum = camera.frustum();
        let world =
            |x: usize, y: usize, h: f64| self.to_world.transform_point3(DVec3::new(x as f64, y as f64, h));
        let mut out = GroundJudgement::default();
        let mut covered = vec![false; columns * rows];
        let mut sum = 0.0;
        for t in &own {
            let range = |v: [f64; 3], n: usize| {
                let (lo, hi) = (v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2]));
                let last = n.saturating_sub(1) as f64;
                let from = (lo - AT_SAMPLE).ceil().clamp(0.0, last) as usize;
                let to = (hi + AT_SAMPLE).floor().clamp(-1.0, last);
                // Empty where the triangle lies beside the grid, or between samples.
                from..(to + 1.0) as usize
            };
            for y in range(t.map(|p| p.y), rows) {
                for x in range(t.map(|p| p.x), columns) {
                    let Some(height) = self.grid.height(x, y) else { continue };
                    let Some(shown) = height_at(t, x as f64, y as f64) else { continue };
                    let p = world(x, y, height);
                    if !frustum.contains(p) {
                        continue;
                    }
                    let pixels = match (camera.project(p), camera.project(world(x, y, shown))) {
                        (Some((a, _)), Some((b, _))) => a.distance(b),
                        _ => camera.pixels(p.distance(world(x, y, shown)), camera.near()),
                    };
                    out.max_pixels = out.max_pixels.max(pixels);
                    out.max_height = out.max_height.max((shown - height).abs());
                    if !std::mem::replace(&mut covered[y * columns + x], true) {
                        out.samples += 1;
                        sum += pixels;
                    }
                }
            }
        }
        out.mean_pixels = sum / out.samples.max(1) as f64;
        for (i, _) in covered.iter().enumerate().filter(|(_, c)| !**c) {
            let (x, y) = (i % columns, i / columns);
            let Some(h) = self.grid.height(x, y).filter(|_| in_region(self.grid, x, y)) else { continue };
            out.uncovered += usize::from(frustum.contains(world(x, y, h)));
        }
        (out.cracks, out.folds) = self.seams(triangles, &own);
        out
    }

    /// Edges that are cracks; edges and triangles that are folds. Corners are the same where their places in the world are, bit for bit.
    fn seams(&self, world: &[[DVec3; 3]], own: &[[DVec3; 3]]) -> (usize, usize) {
        let mut edges: FxHashMap<[[u64; 3]; 2], (u32, [DVec3; 2])> = FxHashMap::default();
        let mut folds = 0;
        for (t, g) in world.iter().zip(own) {
            folds += usize::from((t[1] - t[0]).cross(t[2] - t[0]).dot(self.up()) <= 0.0);
            let key = t.map(|p| p.to_array().map(|x| (x + 0.0).to_bits()));
            for k in 0..3 {
                let n = (k + 1) % 3;
                let e = edges.entry([key[k].min(key[n]), key[k].max(key[n])]).or_insert((0, [g[k], g[n]]));
                e.0 += 1;
            }
        }
        folds += edges.values().filter(|e| e.0 > 2).count();
        let open = edges.values().filter(|e| e.0 == 1 && !on_outline(self.grid, e.1));
        (open.count(), folds)
    }
}

/// Twice the area from above.
fn area(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)
}

/// The height of a triangle at a place; `None` if it does not reach there from above, or is flat from above.
fn height_at([a, b, c]: &[DVec3; 3], x: f64, y: f64) -> Option<f64> {
    let p = DVec3::new(x, y, 0.0);
    let all = area(*a, *b, *c);
    let parts = [area(p, *b, *c), area(*a, p, *c), area(*a, *b, p)].map(|w| w / all);
    // What rounding of corners in the world does to a side.
    let longest =
        (*a - *b).truncate().length().max((*b - *c).truncate().length()).max((*c - *a).truncate().length());
    let least = -1e-9 * longest * longest / all.abs();
    // Corners of one line in the grid are next to one in the world: what such a triangle has for an area is rounding, and so would its heights be. Its sides are those of others.
    let flat = all.abs() <= 1e-9 * longest * longest;
    (!flat && parts.iter().all(|&w| w >= least)).then(|| parts[0] * a.z + parts[1] * b.z + parts[2] * c.z)
}

/// The triangle of a cell below its diagonal (`false`) or above it has three valid samples.
fn valid(grid: &Grid, x: i64, y: i64, above: bool) -> bool {
    let at = |x: i64, y: i64| match (usize::try_from(x), usize::try_from(y)) {
        (Ok(x), Ok(y)) => grid.height(x, y).is_some(),
        _ => false,
    };
    at(x, y) && at(x + 1, y + 1) && if above { at(x, y + 1) } else { at(x + 1, y) }
}

/// A sample is a corner of a valid triangle of the grid.
fn in_region(grid: &Grid, x: usize, y: usize) -> bool {
    let (x, y) = (x as i64, y as i64);
    let around = [
        (x, y, false),
        (x, y, true),
        (x - 1, y - 1, false),
        (x - 1, y - 1, true),
        (x - 1, y, false),
        (x, y - 1, true),
    ];
    around.iter().any(|&(x, y, above)| valid(grid, x, y, above))
}

/// The edge runs along sides of the grid's triangles that have a valid triangle on one side only.
fn on_outline(grid: &Grid, [a, b]: [DVec3; 2]) -> bool {
    let sample = |p: DVec3| {
        let (x, y) = (p.x.round(), p.y.round());
        let near = (p.x - x).abs() <= AT_SAMPLE && (p.y - y).abs() <= AT_SAMPLE;
        (near && x.abs() < 1e9 && y.abs() < 1e9).then_some((x as i64, y as i64))
    };
    let (Some((x0, y0)), Some((x1, y1))) = (sample(a), sample(b)) else { return false };
    let steps = (x1 - x0).abs().max((y1 - y0).abs());
    let (dx, dy) = ((x1 - x0).signum(), (y1 - y0).signum());
    // Along a row, a column or a diagonal of the cells; not along the other diagonal.
    if steps == 0 || (x1 - x0, y1 - y0) != (dx * steps, dy * steps) || dx * dy < 0 {
        return false;
    }
    (0..steps).all(|k| {
        let (x, y) = (x0 + k * dx + dx.min(0), y0 + k * dy + dy.min(0));
        let sides = match (dx != 0, dy != 0) {
            (true, false) => [valid(grid, x, y, false), valid(grid, x, y - 1, true)],
            (false, true) => [valid(grid, x, y, true), valid(grid, x - 1, y, false)],
            _ => [valid(grid, x, y, false), valid(grid, x, y, true)],
        };
        sides[0] != sides[1]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::{self, Space};
    use crate::pipeline::{Job, build_progressive};
    use crate::refine::hierarchy::Options;
    use crate::refine::selective::{Cull, Limits};
    use crate::selective::{Lap, SelectiveScene};
    use crate::simplify::Placement;
    use crate::terrain::tin;

    const WORLD: Space = Space::World { spacing: [30.0, 25.0], exaggeration: 1.5 };

    fn hills(void: bool) -> Grid {
        let height = |i: usize| {
            let (x, y) = ((i % 49) as f64, (i / 49) as f64);
            let hole = void && ((x - 20.0).hypot(y - 30.0) < 6.0 || x + y < 9.0);
            if hole {
                f64::NAN
            } else {
                8.0 * (0.23 * x).sin() * (0.19 * y).cos() + 0.3 * (1.7 * x + 2.3 * y).sin()
            }
        };
        Grid::new(49, 41, (0..49 * 41).map(height).collect()).unwrap()
    }

    /// A network of the grid with this error, as a scene to refine: its vertices stay at samples.
    fn terrain(grid: &Grid, space: Space, error: f64) -> SelectiveScene {
        let mut options = tin::Options::default().with_on_samples(true);
        options.max_error = Some(error);
        let made = tin::triangulate(grid, &options, &tin::Quiet).unwrap();
        let mut job = Job::default();
        job.options.placement = Some(Placement::Endpoint);
        job.options.lock_border = true;
        let scene = ground::scene(&made.tin, grid, space, &ground::Dress::default(), "hills");
        let built = build_progressive(scene, &job, &crate::simplify::Quiet).unwrap();
        SelectiveScene::new(built.scene, &Options::default()).unwrap()
    }

    /// Every sample inside the frustum against every triangle, by the plane through its corners in the world.
    fn slowly(g: &Ground<'_>, triangles: &[[DVec3; 3]], camera: &Camera) -> (usize, f64) {
        let frustum = camera.frustum();
        let (mut samples, mut most) = (0, 0.0f64);
        for (i, &h) in g.grid.heights().iter().enumerate().filter(|(_, h)| !h.is_nan()) {
            let at = DVec3::new((i % g.grid.columns()) as f64, (i / g.grid.columns()) as f64, h);
            let p = g.to_world.transform_point3(at);
            if !frustum.contains(p) {
                continue;
            }
            let up = g.up();
            let mut found = None;
            for t in triangles {
                let n = (t[1] - t[0]).cross(t[2] - t[0]);
                let q = p + up * ((t[0] - p).dot(n) / up.dot(n));
                let inside = (0..3)
                    .all(|k| (t[(k + 1) % 3] - t[k]).cross(q - t[k]).dot(n) >= -1e-9 * n.length_squared());
                if inside {
                    let d = camera.project(p).unwrap().0.distance(camera.project(q).unwrap().0);
                    found = Some(found.map_or(d, |f: f64| f.max(d)));
                }
            }
            samples += usize::from(found.is_some());
            most = most.max(found.unwrap_or(0.0));
        }
        (samples, most)
    }

    #[test]
    fn heights_are_judged_as_by_looking_at_every_triangle_for_every_sample() {
        for (space, void) in [(Space::Grid, false), (WORLD, false), (WORLD, true)] {
            let grid = hills(void);
            let mut scene = terrain(&grid, space, 0.2);
            let ground = Ground::new(&grid, space).unwrap();
            for lap in [Lap::Circle, Lap::Lemniscate] {
                for camera in ground.lap(lap, 9.0, 4).unwrap() {
                    for tau in [0.0, 4.0, 60.0] {
                        // Outside of the view an ordinary mesh may fold; all of it is there at 0.
                        let cull = if tau == 0.0 { Cull::None } else { Cull::Frustum };
                        scene.adapt(&camera, tau, cull, &Limits::default()).unwrap();
                        let shown = scene.triangles();
                        let judged = ground.judge(&shown, &camera);
                        let (samples, most) = slowly(&ground, &shown, &camera);
                        assert_eq!(judged.samples, samples);
                        assert!(
                            (judged.max_pixels - most).abs() <= 1e-6 * most.max(1.0),
                            "{judged:?} {most}"
                        );
                        assert!(judged.mean_pixels <= judged.max_pixels);
                        if tau == 0.0 {
                            // The network's own error, and nothing left out.
                            assert!(judged.max_height < 0.21 && judged.folds == 0);
                        }
                        // The border is kept.
                        assert_eq!((judged.cracks, judged.uncovered), (0, 0));
                    }
                }
            }
        }
    }

    #[test]
    fn cracks_and_folds_are_found() {
        let grid = hills(false);
        let mut scene = terrain(&grid, WORLD, 0.5);
        let ground = Ground::new(&grid, WORLD).unwrap();
        let camera = &ground.lap(Lap::Circle, 1.0, 1).unwrap()[0];
        scene.adapt(camera, 8.0, Cull::All, &Limits::default()).unwrap();
        let whole = scene.triangles();
        assert_eq!(ground.judge(&whole, camera).cracks, 0);
        // An inner triangle is missing: three sides.
        let middle = ground.to_world.transform_point3(DVec3::new(24.0, 20.0, 0.0));
        let far = |t: &[DVec3; 3]| t.iter().map(|p| p.distance(middle)).fold(0.0, f64::max);
        let inner = (0..whole.len()).min_by(|&a, &b| far(&whole[a]).total_cmp(&far(&whole[b]))).unwrap();
        let mut hole = whole.clone();
        hole.remove(inner);
        assert_eq!(ground.judge(&hole, camera).cracks, 3);
        // One corner of it is a little higher: both sides of two edges are open.
        let mut apart = whole.clone();
        apart[inner][0] += 0.01 * ground.up();
        assert_eq!(ground.judge(&apart, camera).cracks, 4);
        // Turned over, and twice.
        let mut turned = whole.clone();
        turned[inner].swap(0, 1);
        assert_eq!(ground.judge(&turned, camera).folds, 1);
        let mut twice = whole.clone();
        twice.push(whole[inner]);
        assert_eq!(ground.judge(&twice, camera).folds, 3);
        // A corner of the whole is missing: the sides that are open are no outline.
        let at_corner = (0..whole.len())
            .find(|&t| whole[t].iter().filter(|p| on_border(&ground, **p)).count() == 3)
            .map(|t| {
                let mut rest = whole.clone();
                rest.remove(t);
                ground.judge(&rest, camera).cracks
            });
        assert!(at_corner.is_none_or(|n| n > 0));
    }

    fn on_border(g: &Ground<'_>, p: DVec3) -> bool {
        let p = g.to_grid.transform_point3(p);
        p.x < 1e-6 || p.y < 1e-6 || p.x > 47.999 || p.y > 39.999
    }

    #[test]
    fn outlines_follow_voids() {
        // The sample in the middle is void: its ring of six triangles is missing.
        let heights = (0..25).map(|i| if i == 12 { f64::NAN } else { 0.0 }).collect();
        let grid = Grid::new(5, 5, heights).unwrap();
        let edge = |a: [i32; 2], b: [i32; 2]| {
            let p = |[x, y]: [i32; 2]| DVec3::new(x.into(), y.into(), 0.0);
            on_outline(&grid, [p(a), p(b)])
        };
        assert!(edge([0, 0], [4, 0]) && edge([4, 4], [4, 1]) && edge([1, 1], [2, 1]) && edge([1, 2], [1, 1]));
        assert!(edge([1, 2], [2, 3]) && edge([3, 2], [2, 1]));
        assert!(
            !edge([0, 0], [1, 1]) && !edge([1, 1], [3, 1]) && !edge([0, 1], [4, 1]) && !edge([2, 1], [1, 2])
        );
        assert!(!edge([0, 0], [0, 0]) && !edge([0, 0], [9, 0]));
    }
}
