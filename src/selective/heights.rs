//! Measures a terrain that is shown against its samples, without the code that decides what to show: how far heights look off, and whether there are cracks.

use super::samples::Validity;
use super::terrain::Ground;
use crate::blocks::each;
use crate::refine::view::{Camera, Frustum, Planes};
use crate::terrain::{RasterError, Window};
use glam::DVec3;
use rustc_hash::FxHashMap;
use std::ops::Range;

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
    /// The same as `max_pixels` of those samples alone whose difference of height is more than the floor.
    pub beyond_pixels: f64,
    /// How far the floor reaches in the picture at most: the largest distance between a sample inside the frustum and the place as far above or below it.
    pub floor_pixels: f64,
    /// The largest difference of height among these, in the grid's units.
    pub max_height: f64,
    /// Samples of the valid region inside the frustum that no triangle covers.
    pub uncovered: usize,
    /// See [`Seams`].
    pub seams: Seams,
}

/// What [`Ground::seams`] found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seams {
    /// Edges with one face that are not on the outline of the valid region: cracks.
    pub cracks: usize,
    /// Edges of more than two faces, and triangles that look down or are flat from above.
    pub folds: usize,
}

/// How far from a sample a corner may be and still be at it, steps: what rounding in the world may do.
const AT_SAMPLE: f64 = 1e-4;

/// What a difference of height may be more than the floor, as a part of the height: rounding on the way from the world.
const ROUNDING: f64 = 1e-9;

/// What was found in a tile.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    of: GroundJudgement,
    /// Of all samples' distances in the picture.
    sum: f64,
}

impl Part {
    fn join(&mut self, other: &Part) {
        let (a, b) = (&mut self.of, &other.of);
        a.samples += b.samples;
        a.uncovered += b.uncovered;
        a.max_pixels = a.max_pixels.max(b.max_pixels);
        a.beyond_pixels = a.beyond_pixels.max(b.beyond_pixels);
        a.floor_pixels = a.floor_pixels.max(b.floor_pixels);
        a.max_height = a.max_height.max(b.max_height);
        self.sum += other.sum;
    }
}

impl Ground<'_> {
    /// Measures what is shown, as triangles in the world, seen by `camera`. Every sample inside the frustum is looked at; those on a side shared by triangles against each. At full detail
    /// the mesh may be `floor` off, in the grid's units.
    ///
    /// Heights are read tile by tile, of those tiles alone of which something may be inside the frustum. O(samples in these + area of the triangles' boxes over them); memory O(triangles), and a tile for
    /// each thread.
    ///
    /// # Errors
    /// Those of reading heights.
    pub fn judge(
        &self,
        triangles: &[[DVec3; 3]],
        camera: &Camera,
        floor: f64,
    ) -> Result<GroundJudgement, RasterError> {
        let own: Vec<[DVec3; 3]> =
            triangles.iter().map(|t| t.map(|p| self.to_grid.transform_point3(p))).collect();
        let frustum = camera.frustum();
        let near = frustum.in_space_of(&self.to_world);
        let sees = |k: usize| self.may_see(near.as_ref(), k);
        // Of every tile that may be seen, the triangles over it.
        let mut over: Vec<Option<Vec<u32>>> = (0..self.tiles.len()).map(|k| sees(k).then(Vec::new)).collect();
        let size = [self.raster.columns(), self.raster.rows()];
        for (t, n) in own.iter().zip(0u32..) {
            for k in self.tiles.over(range(t.map(|p| p.x), 0..size[0]), range(t.map(|p| p.y), 0..size[1])) {
                if let Some(list) = &mut over[k] {
                    list.push(n);
                }
            }
        }
        let work: Vec<(usize, Vec<u32>)> =
            over.into_iter().enumerate().filter_map(|(k, list)| Some((k, list?))).collect();
        let one =
            |(k, list): &(usize, Vec<u32>)| self.judge_tile(*k, (&own, list), (camera, &frustum), floor);
        let mut all = Part::default();
        for part in each(&work, one)? {
            all.join(&part);
        }
        all.of.mean_pixels = all.sum / all.of.samples.max(1) as f64;
        drop(own);
        all.of.seams = self.seams(triangles)?;
        Ok(all.of)
    }

    /// Whether the box about the samples of a tile reaches into the frustum, which is given in the grid's coordinates if that is possible.
    fn may_see(&self, frustum: Option<&Frustum>, k: usize) -> bool {
        let (w, [low, high]) = (self.tiles.window(k), self.tiles.tile(k).range);
        if low > high {
            return false;
        }
        let last = |first: usize, n: usize| (first + n - 1) as f64;
        // A little more than the box, for rounding of planes.
        let slack = DVec3::new(1.0, 1.0, 1e-6 * (1.0 + low.abs().max(high.abs())));
        let lo = DVec3::new(w.column as f64, w.row as f64, low) - slack;
        let hi = DVec3::new(last(w.column, w.columns), last(w.row, w.rows), high) + slack;
        frustum.is_none_or(|f| f.aabb(lo, hi, Planes::ALL).is_some())
    }

    /// The samples of a tile, with the triangles over it.
    fn judge_tile(
        &self,
        k: usize,
        (own, list): (&[[DVec3; 3]], &[u32]),
        (camera, frustum): (&Camera, &Frustum),
        floor: f64,
    ) -> Result<Part, RasterError> {
        let w = self.tiles.window(k);
        // With the samples around it, which say what is valid at its border.
        let before = |a: usize| a.saturating_sub(1);
        let after = |a: usize, n: usize, size: usize| (a + n + 1).min(size);
        let [columns, rows] = [self.raster.columns(), self.raster.rows()];
        let (x0, y0) = (before(w.column), before(w.row));
        let (x1, y1) = (after(w.column, w.columns, columns), after(w.row, w.rows, rows));
        let grid = self.raster.window(Window::new(x0, y0, x1 - x0, y1 - y0))?;
        let height = |x: usize, y: usize| grid.height(x - x0, y - y0);
        let world =
            |x: usize, y: usize, h: f64| self.to_world.transform_point3(DVec3::new(x as f64, y as f64, h));
        let mut seen = vec![false; w.columns * w.rows];
        let index = |x: usize, y: usize| (y - w.row) * w.columns + x - w.column;
        for y in w.row..w.row + w.rows {
            for x in w.column..w.column + w.columns {
                seen[index(x, y)] = height(x, y).is_some_and(|h| frustum.contains(world(x, y, h)));
            }
        }
        let mut covered = vec![false; seen.len()];
        let mut part = Part::default();
        for t in list.iter().map(|&t| &own[t as usize]) {
            let plane = Face::new(t);
            for y in range(t.map(|p| p.y), w.row..w.row + w.rows) {
                for x in range(t.map(|p| p.x), w.column..w.column + w.columns) {
                    let at = index(x, y);
                    if !seen[at] {
                        continue;
                    }
                    let Some(h) = height(x, y) else { continue };
                    let Some(shown) = plane.height(x as f64, y as f64) else { continue };
                    let p = world(x, y, h);
                    let seen_at = camera.project(p).map(|s| s.0);
                    let pixels = |other: f64| {
                        let q = world(x, y, other);
                        match (seen_at, camera.project(q)) {
                            (Some(a), Some((b, _))) => a.distance(b),
                            _ => camera.pixels(p.distance(q), camera.near()),
                        }
                    };
                    let (off, far) = ((shown - h).abs(), pixels(shown));
                    let found = &mut part.of;
                    found.max_pixels = found.max_pixels.max(far);
                    found.max_height = found.max_height.max(off);
                    if off > floor + if floor > 0.0 { ROUNDING * (h.abs() + floor) } else { 0.0 } {
                        found.beyond_pixels = found.beyond_pixels.max(far);
                    }
                    if !std::mem::replace(&mut covered[at], true) {
                        found.samples += 1;
                        part.sum += far;
                        if floor > 0.0 {
                            let reach = pixels(h + floor).max(pixels(h - floor));
                            found.floor_pixels = found.floor_pixels.max(reach);
                        }
                    }
                }
            }
        }
        let mut valid = |x: i64, y: i64| match (usize::try_from(x), usize::try_from(y)) {
            (Ok(x), Ok(y)) => x >= x0 && y >= y0 && height(x, y).is_some(),
            _ => false,
        };
        for (i, _) in
            covered.iter().zip(&seen).enumerate().filter(|(_, (covered, seen))| **seen && !**covered)
        {
            let (x, y) = (w.column + i % w.columns, w.row + i / w.columns);
            part.of.uncovered += usize::from(in_region(&mut valid, x, y));
        }
        Ok(part)
    }

    /// Looks for cracks and folds alone, everywhere: edges that are cracks, edges and triangles that are folds. Corners are the same where their places in the world are, bit for bit. O(n log n) for
    /// n triangles, and the length of the outline.
    ///
    /// # Errors
    /// Those of reading heights: around void samples.
    pub fn seams(&self, world: &[[DVec3; 3]]) -> Result<Seams, RasterError> {
        // Edges as pairs of the corners' numbers, sorted: a tenth of the memory of a table of edges.
        let mut numbers: FxHashMap<[u64; 3], u32> = FxHashMap::default();
        let mut places: Vec<DVec3> = vec![];
        let mut edges: Vec<[u32; 2]> = Vec::with_capacity(3 * world.len());
        let mut folds = 0;
        for t in world {
            folds += usize::from((t[1] - t[0]).cross(t[2] - t[0]).dot(self.up()) <= 0.0);
            let corners = t.map(|p| {
                let next = places.len() as u32;
                let number = *numbers.entry(p.to_array().map(|x| (x + 0.0).to_bits())).or_insert(next);
                if number == next {
                    places.push(p);
                }
                number
            });
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                edges.push([a.min(b), a.max(b)]);
            }
        }
        drop(numbers);
        edges.sort_unstable();
        let mut validity = Validity::new(self.raster, &self.tiles);
        let mut valid = |x: i64, y: i64| validity.of(x, y);
        let mut cracks = 0;
        for same in edges.chunk_by(|a, b| a == b) {
            folds += usize::from(same.len() > 2);
            if let [edge] = same {
                let ends = edge.map(|v| self.to_grid.transform_point3(places[v as usize]));
                cracks += usize::from(!on_outline(&mut valid, ends));
            }
        }
        validity.done()?;
        Ok(Seams { cracks, folds })
    }
}

/// The samples of a range that a triangle with these coordinates may reach.
fn range(v: [f64; 3], samples: Range<usize>) -> Range<usize> {
    let (lo, hi) = (v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2]));
    // Empty where the triangle lies beside, or between samples; a cast takes what is below 0 for 0.
    let from = ((lo - AT_SAMPLE).ceil() as usize).max(samples.start);
    let to = ((hi + AT_SAMPLE + 1.0).floor() as usize).min(samples.end);
    from..to.max(from)
}

/// Twice the area from above.
fn area(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)
}

/// A triangle as seen from above.
struct Face<'a> {
    corners: &'a [DVec3; 3],
    /// Twice its area.
    area: f64,
    /// The least weight of a corner that a place in it has: what rounding of corners in the world does to a side. Infinite for one that is flat from above.
    least: f64,
}

impl Face<'_> {
    fn new(corners: &[DVec3; 3]) -> Face<'_> {
        let [a, b, c] = corners;
        let area = area(*a, *b, *c);
        let longest = (*a - *b)
            .truncate()
            .length()
            .max((*b - *c).truncate().length())
            .max((*c - *a).truncate().length());
        // Corners of one line in the grid are next to one in the world: what such a triangle has for an area is rounding, and so would its heights be. Its sides are those of others.
        let flat = area.abs() <= 1e-9 * longest * longest;
        let least = if flat { f64::INFINITY } else { -1e-9 * longest * longest / area.abs() };
        Face { corners, area, least }
    }

    /// Its height at a place; `None` if it does not reach there from above, or is flat from above.
    fn height(&self, x: f64, y: f64) -> Option<f64> {
        let p = DVec3::new(x, y, 0.0);
        let [a, b, c] = *self.corners;
        let parts = [area(p, b, c), area(a, p, c), area(a, b, p)].map(|w| w / self.area);
        parts.iter().all(|&w| w >= self.least).then(|| parts[0] * a.z + parts[1] * b.z + parts[2] * c.z)
    }
}

/// The triangle of a cell below its diagonal (`false`) or above it has three valid samples.
fn whole(valid: &mut impl FnMut(i64, i64) -> bool, x: i64, y: i64, above: bool) -> bool {
    valid(x, y) && valid(x + 1, y + 1) && if above { valid(x, y + 1) } else { valid(x + 1, y) }
}

/// A sample is a corner of a valid triangle of the grid.
fn in_region(valid: &mut impl FnMut(i64, i64) -> bool, x: usize, y: usize) -> bool {
    let (x, y) = (x as i64, y as i64);
    let around = [
        (x, y, false),
        (x, y, true),
        (x - 1, y - 1, false),
        (x - 1, y - 1, true),
        (x - 1, y, false),
        (x, y - 1, true),
    ];
    around.iter().any(|&(x, y, above)| whole(valid, x, y, above))
}

/// The edge runs along sides of the grid's triangles that have a valid triangle on one side only.
fn on_outline(valid: &mut impl FnMut(i64, i64) -> bool, [a, b]: [DVec3; 2]) -> bool {
    // Along a row, a column or a diagonal of the cells; not along the other diagonal. Ends may lie between samples: vertices on their way (geomorphs) do.
    let same = |s: f64, t: f64| {
        let k = s.round();
        ((s - k).abs() <= AT_SAMPLE && (t - k).abs() <= AT_SAMPLE && k.abs() < 1e9).then_some(k as i64)
    };
    let cells = |s: f64, t: f64| {
        let (from, to) = ((s.min(t) + AT_SAMPLE).floor(), (s.max(t) - AT_SAMPLE).ceil());
        (s != t && from.abs() < 1e9 && to.abs() < 1e9).then_some(from as i64..to.max(from + 1.0) as i64)
    };
    let (steps, x0, y0, dx, dy) = match (same(a.y, b.y), same(a.x, b.x), same(a.x - a.y, b.x - b.y)) {
        (Some(y), _, _) => (cells(a.x, b.x), 0, y, 1, 0),
        (_, Some(x), _) => (cells(a.y, b.y), x, 0, 0, 1),
        (_, _, Some(x)) => (cells(a.y, b.y), x, 0, 1, 1),
        _ => return false,
    };
    let Some(mut steps) = steps else { return false };
    steps.all(|k| {
        let (x, y) = (x0 + k * dx, y0 + k * dy);
        let sides = match (dx != 0, dy != 0) {
            (true, false) => [whole(valid, x, y, false), whole(valid, x, y - 1, true)],
            (false, true) => [whole(valid, x, y, true), whole(valid, x - 1, y, false)],
            _ => [whole(valid, x, y, false), whole(valid, x, y, true)],
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
    use crate::terrain::{Grid, tin};

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
    fn slowly(grid: &Grid, g: &Ground<'_>, triangles: &[[DVec3; 3]], camera: &Camera) -> (usize, f64) {
        let frustum = camera.frustum();
        let (mut samples, mut most) = (0, 0.0f64);
        for (i, &h) in grid.heights().iter().enumerate().filter(|(_, h)| !h.is_nan()) {
            let at = DVec3::new((i % grid.columns()) as f64, (i / grid.columns()) as f64, h);
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
                        let judged = ground.judge(&shown, &camera, 0.0).unwrap();
                        let (samples, most) = slowly(&grid, &ground, &shown, &camera);
                        assert_eq!(judged.samples, samples);
                        assert!(
                            (judged.max_pixels - most).abs() <= 1e-6 * most.max(1.0),
                            "{judged:?} {most}"
                        );
                        assert!(judged.mean_pixels <= judged.max_pixels);
                        if tau == 0.0 {
                            // The network's own error, and nothing left out.
                            assert!(judged.max_height < 0.21 && judged.seams.folds == 0);
                        }
                        // The border is kept.
                        assert_eq!((judged.seams.cracks, judged.uncovered), (0, 0));
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
        assert_eq!(ground.seams(&whole).unwrap().cracks, 0);
        // An inner triangle is missing: three sides.
        let middle = ground.to_world.transform_point3(DVec3::new(24.0, 20.0, 0.0));
        let far = |t: &[DVec3; 3]| t.iter().map(|p| p.distance(middle)).fold(0.0, f64::max);
        let inner = (0..whole.len()).min_by(|&a, &b| far(&whole[a]).total_cmp(&far(&whole[b]))).unwrap();
        let mut hole = whole.clone();
        hole.remove(inner);
        assert_eq!(ground.seams(&hole).unwrap().cracks, 3);
        // One corner of it is a little higher: both sides of two edges are open.
        let mut apart = whole.clone();
        apart[inner][0] += 0.01 * ground.up();
        assert_eq!(ground.seams(&apart).unwrap().cracks, 4);
        // Turned over, and twice.
        let mut turned = whole.clone();
        turned[inner].swap(0, 1);
        assert_eq!(ground.seams(&turned).unwrap().folds, 1);
        let mut twice = whole.clone();
        twice.push(whole[inner]);
        assert_eq!(ground.seams(&twice).unwrap().folds, 3);
        // A corner of the whole is missing: the sides that are open are no outline.
        let at_corner = (0..whole.len())
            .find(|&t| whole[t].iter().filter(|p| on_border(&ground, **p)).count() == 3)
            .map(|t| {
                let mut rest = whole.clone();
                rest.remove(t);
                ground.seams(&rest).unwrap().cracks
            });
        assert!(at_corner.is_none_or(|n| n > 0));
    }

    #[test]
    fn sides_of_the_outline_may_end_between_samples() {
        // Nine samples without the one at the upper right.
        let mut valid = |x: i64, y: i64| (0..3).contains(&x) && (0..3).contains(&y) && (x, y) != (2, 0);
        let mut on = |a: [f64; 2], b: [f64; 2]| {
            let [a, b] = [a, b].map(|[x, y]| DVec3::new(x, y, 7.0));
            let is = on_outline(&mut valid, [a, b]);
            assert_eq!(is, on_outline(&mut valid, [b, a]));
            is
        };
        assert!(on([0.0, 0.0], [0.0, 2.0]) && on([0.0, 0.3], [0.0, 1.6]) && on([0.25, 2.0], [2.0, 2.0]));
        assert!(on([0.0, 0.0], [1.0, 0.0]) && on([1.0, 0.0], [2.0, 1.0]) && on([1.25, 0.25], [1.5, 0.5]));
        assert!(!on([0.0, 0.0], [1.5, 0.0]) && !on([1.0, 0.0], [1.0, 1.0]) && !on([0.5, 0.5], [1.5, 1.5]));
        assert!(!on([0.0, 0.1], [1.0, 0.1]) && !on([0.0, 1.0], [1.0, 0.0]) && !on([0.0, 0.5], [0.0, 0.5]));
        assert!(
            !on([0.0, 2.0], [0.0, 2.5])
                && !on([f64::NAN, 0.0], [0.0, f64::NAN])
                && !on([1e300, 0.0], [0.0, 0.0])
        );
    }

    fn valid_in(grid: &Grid, x: i64, y: i64) -> bool {
        x >= 0 && y >= 0 && grid.height(x as usize, y as usize).is_some()
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
            on_outline(&mut |x, y| valid_in(&grid, x, y), [p(a), p(b)])
        };
        assert!(edge([0, 0], [4, 0]) && edge([4, 4], [4, 1]) && edge([1, 1], [2, 1]) && edge([1, 2], [1, 1]));
        assert!(edge([1, 2], [2, 3]) && edge([3, 2], [2, 1]));
        assert!(
            !edge([0, 0], [1, 1]) && !edge([1, 1], [3, 1]) && !edge([0, 1], [4, 1]) && !edge([2, 1], [1, 2])
        );
        assert!(!edge([0, 0], [0, 0]) && !edge([0, 0], [9, 0]));
    }
}
