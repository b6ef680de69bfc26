//! Drawing a surface: shaded pictures and silhouettes.

use super::clip::{Corner, clip};
use super::picture::Picture;
use super::raster::{Fragment, Spot, fill};
use super::surface::Surface;
use super::view::View;
use glam::DVec3;

/// Where normals come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shading {
    /// Each triangle has its own: shows the triangles.
    Flat,
    /// Those of the mesh's corners, interpolated; a corner without has its triangle's.
    #[default]
    Smooth,
}

/// How a picture is drawn. Start from `Style::default()` and set what differs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Style {
    /// Where normals come from.
    pub shading: Shading,
    /// Linear colour of what nothing covers, 0 to 1.
    pub background: [f32; 3],
    /// Draw the edges of the faces that are seen.
    pub wireframe: bool,
    /// Samples along each side of a pixel, 1 to 4: more make smoother outlines.
    pub samples: u32,
}

impl Default for Style {
    fn default() -> Self {
        Style { shading: Shading::Smooth, background: [1.0; 3], wireframe: false, samples: 2 }
    }
}

/// Light that comes from everywhere, and that of the lamp at the left above the eye.
const AMBIENT: f64 = 0.2;
const LAMP: f64 = 0.8;
/// The same where colours have a meaning.
const FLAT_AMBIENT: f64 = 0.55;
const FLAT_LAMP: f64 = 0.45;
/// Half the breadth of a wireframe's line, in samples. A line is drawn from both sides of an edge.
const HALF_LINE: f64 = 0.6;
/// What a wireframe's line leaves of the light.
const LINE_SHADE: f64 = 0.15;

/// Draws the surface: the nearest triangle at every sample, both sides lit alike.
///
/// A normal is turned to the eye before shading, so that orientation does not show. What is not finite after projection is left out.
/// Time grows with the triangles, and with the pixels each covers.
pub fn render(surface: &Surface, view: &View, style: &Style) -> Picture {
    let (large, samples) = enlarged(view, style);
    let mut light = vec![style.background; large.width() as usize * large.height() as usize];
    draw(surface, &large, style, |f, triangle, lit| {
        light[f.index] = lit.color(surface, triangle);
    });
    developed(&light, view, samples, style.background)
}

/// Draws the surface in colours that depend on the place: `paint` gets points of the surface in the world, and returns linear colours, 0 to
/// 1. It is asked once a pixel, in no order.
///
/// Shading is weaker than that of [`render`], so that colours can be told apart; otherwise the same.
pub fn render_painted(
    surface: &Surface,
    view: &View,
    style: &Style,
    paint: impl Fn(&[DVec3]) -> Vec<[f32; 3]> + Sync,
) -> Picture {
    let [_, painted] = render_both(surface, view, style, paint);
    painted
}

/// What [`render`] and [`render_painted`] draw, for less than both.
pub fn render_both(
    surface: &Surface,
    view: &View,
    style: &Style,
    paint: impl Fn(&[DVec3]) -> Vec<[f32; 3]> + Sync,
) -> [Picture; 2] {
    let (large, samples) = enlarged(view, style);
    let mut light = vec![style.background; large.width() as usize * large.height() as usize];
    // Of every sample: how light it is where colours have a meaning, and where.
    let mut seen: Vec<Option<(f32, DVec3)>> = vec![None; light.len()];
    draw(surface, &large, style, |f, triangle, lit| {
        light[f.index] = lit.color(surface, triangle);
        seen[f.index] = Some((lit.shade(FLAT_AMBIENT, FLAT_LAMP) as f32, f.point));
    });
    let plain = developed(&light, view, samples, style.background);

    let (across, n) = (large.width() as usize, samples as usize);
    // The first sample that is covered stands for the pixel.
    let mut points = Vec::new();
    let pixels =
        || (0..large.height() as usize).step_by(n).flat_map(|y| (0..across).step_by(n).map(move |x| (x, y)));
    let first = |(x, y): (usize, usize)| {
        (0..n).find_map(|dy| seen[(y + dy) * across + x..][..n].iter().find_map(|s| s.map(|s| s.1)))
    };
    points.extend(pixels().filter_map(first));
    let mut colors = in_chunks(&points, &paint).into_iter();
    for (x, y) in pixels() {
        if first((x, y)).is_none() {
            continue;
        }
        let Some(color) = colors.next() else { break };
        for row in (y..y + n).map(|y| y * across + x) {
            for (l, s) in light[row..row + n].iter_mut().zip(&seen[row..row + n]) {
                if let Some((shade, _)) = s {
                    *l = color.map(|c| c * shade);
                }
            }
        }
    }
    [plain, developed(&light, view, samples, style.background)]
}

/// Points that are painted at a time.
const CHUNK: usize = 2048;

/// The colours of all points, in order.
fn in_chunks(points: &[DVec3], paint: &(impl Fn(&[DVec3]) -> Vec<[f32; 3]> + Sync)) -> Vec<[f32; 3]> {
    #[cfg(feature = "parallel")]
    let chunks: Vec<_> = {
        use rayon::prelude::*;
        points.par_chunks(CHUNK).map(paint).collect()
    };
    #[cfg(not(feature = "parallel"))]
    let chunks: Vec<_> = points.chunks(CHUNK).map(paint).collect();
    chunks.concat()
}

/// The view that has a pixel for every sample, and samples along each side of a pixel.
fn enlarged(view: &View, style: &Style) -> (View, u32) {
    let large = view.enlarged(style.samples.clamp(1, 4));
    let samples = large.width() / view.width();
    (large, samples)
}

/// The light that a sample gets.
#[derive(Clone, Copy)]
struct Lit {
    /// From the lamp, 0 to 1.
    lamp: f64,
    /// What is left of all.
    left: f64,
}

impl Lit {
    fn shade(self, ambient: f64, lamp: f64) -> f64 {
        (ambient + lamp * self.lamp) * self.left
    }

    /// The colour of a triangle in this light.
    fn color(self, surface: &Surface, triangle: usize) -> [f32; 3] {
        let shade = self.shade(AMBIENT, LAMP);
        surface.palette[surface.triangles[triangle].color as usize].map(|c| (c as f64 * shade) as f32)
    }
}

/// Calls `set` for samples that are nearer than what was there: with the triangle, and its light.
fn draw(surface: &Surface, large: &View, style: &Style, mut set: impl FnMut(&Fragment, usize, Lit)) {
    let mut depth = vec![f32::NEG_INFINITY; large.width() as usize * large.height() as usize];
    let from = DVec3::new(-0.4, 0.7, 0.8).normalize();
    project(surface, large, style.shading == Shading::Smooth, |triangle, spots| {
        fill(spots, large.width(), large.height(), |f: Fragment| {
            // Of two at the same depth the first stays.
            if f.near <= depth[f.index] {
                return;
            }
            depth[f.index] = f.near;
            let n = f.normal.normalize_or(DVec3::Z);
            let n = if n.z < 0.0 { -n } else { n };
            let line = style.wireframe && f.to_edge < HALF_LINE;
            let lit = Lit { lamp: n.dot(from).max(0.0), left: if line { LINE_SHADE } else { 1.0 } };
            set(&f, triangle, lit);
        });
    });
}

/// The mean of every pixel's samples, from linear light to 8 bits. The square root is near the sRGB curve, and exact everywhere.
fn developed(light: &[[f32; 3]], view: &View, samples: u32, background: [f32; 3]) -> Picture {
    let (across, n) = ((view.width() * samples) as usize, samples as usize);
    let byte = |s: f64| ((s / (n * n) as f64).clamp(0.0, 1.0).sqrt() * 255.0).round() as u8;
    let empty = background.map(|c| byte((n * n) as f64 * c as f64));
    let mut picture = Picture::new(view.width(), view.height(), empty);
    for y in 0..view.height() {
        for x in 0..view.width() {
            let first = y as usize * n * across + x as usize * n;
            let mut rows = (0..n).map(|dy| &light[first + dy * across..][..n]);
            if rows.clone().all(|row| row.iter().all(|s| *s == background)) {
                continue;
            }
            let mut sum = [0.0f64; 3];
            for sample in rows.by_ref().flatten() {
                for (s, l) in sum.iter_mut().zip(sample) {
                    *s += *l as f64;
                }
            }
            picture.set(x, y, sum.map(byte));
        }
    }
    picture
}

/// Which pixels of a view a surface covers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    width: u32,
    height: u32,
    covered: Vec<bool>,
}

/// The pixels whose centre the surface covers.
pub fn silhouette(surface: &Surface, view: &View) -> Mask {
    let (width, height) = (view.width(), view.height());
    let mut covered = vec![false; width as usize * height as usize];
    project(surface, view, false, |_, spots| fill(spots, width, height, |f| covered[f.index] = true));
    Mask { width, height, covered }
}

impl Mask {
    /// How many pixels are covered.
    pub fn count(&self) -> usize {
        self.covered.iter().filter(|&&c| c).count()
    }

    /// True if the pixel is covered; false outside.
    pub fn get(&self, x: u32, y: u32) -> bool {
        x < self.width && y < self.height && self.covered[y as usize * self.width as usize + x as usize]
    }

    /// Intersection over union, 0 to 1: pixels covered by both over pixels covered by any. 1 if none is.
    ///
    /// `None` for masks of different sizes.
    pub fn iou(&self, other: &Mask) -> Option<f64> {
        if (self.width, self.height) != (other.width, other.height) {
            return None;
        }
        let pairs = || self.covered.iter().zip(&other.covered);
        let both = pairs().filter(|p| *p.0 && *p.1).count();
        let any = pairs().filter(|p| *p.0 || *p.1).count();
        Some(if any == 0 { 1.0 } else { both as f64 / any as f64 })
    }
}

/// Calls `draw` with every triangle's number and its spots in the picture; cut triangles come in pieces.
fn project(surface: &Surface, view: &View, smooth: bool, mut draw: impl FnMut(usize, [Spot; 3])) {
    let (mut polygon, mut scratch) = (Vec::new(), Vec::new());
    let middle = [0.5 * view.width() as f64, 0.5 * view.height() as f64];
    for (i, t) in surface.triangles.iter().enumerate() {
        let world = t.corners.map(|v| surface.points[v as usize]);
        let [Some(a), Some(b), Some(c)] = world.map(|p| view.see(p)) else { continue };
        let flat = face_normal(world, view);
        let own = surface.normals.get(i).filter(|_| smooth);
        polygon.clear();
        for (k, (s, point)) in [a, b, c].into_iter().zip(world).enumerate() {
            let normal = own.map(|n| n[k].as_dvec3()).and_then(DVec3::try_normalize);
            let normal = normal.map_or(flat, |n| view.direction(n));
            polygon.push(Corner {
                x: s.x,
                y: s.y,
                w: s.w,
                z: s.z,
                normal,
                point,
                edge: t.edges >> k & 1 == 1,
            });
        }
        clip(&mut polygon, &mut scratch, view);
        let spot = |c: &Corner, edge: bool| Spot {
            x: middle[0] + c.x / c.w,
            y: middle[1] + c.y / c.w,
            near: view.nearness(c.w, c.z),
            iw: 1.0 / c.w,
            normal: c.normal,
            point: c.point,
            edge,
        };
        let n = polygon.len();
        for k in 1..n.saturating_sub(1) {
            let [a, b, c] = [0, k, k + 1].map(|j| &polygon[j]);
            draw(i, [spot(a, a.edge && k == 1), spot(b, b.edge), spot(c, c.edge && k + 2 == n)]);
        }
    }
}

/// The unit normal in the view's axes, whatever the triangle's size; towards the eye for one without area.
fn face_normal([a, b, c]: [DVec3; 3], view: &View) -> DVec3 {
    let (u, v) = (b - a, c - a);
    let longest = u.abs().max_element().max(v.abs().max_element());
    let n = if longest > 0.0 { (u / longest).cross(v / longest) } else { DVec3::ZERO };
    n.try_normalize().map_or(DVec3::Z, |n| view.direction(n))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aif::{MeshInput, Positions};
    use crate::meshes::{GenerateOptions, generate};
    use crate::report::Projection;
    use crate::scene::{Material, Scene, SceneMesh};

    fn scene(geometry: MeshInput) -> Scene {
        Scene::from_mesh(SceneMesh { geometry, ..Default::default() })
    }

    fn sample(name: &str, faces: usize) -> Surface {
        let sample = generate(name, &GenerateOptions::default().with_faces(faces)).unwrap();
        Surface::of(&crate::samples::scene(sample, name)).unwrap()
    }

    /// The cube of these corners, of quadrilaterals.
    fn cube(lo: f64, hi: f64) -> MeshInput {
        let points: Vec<[f64; 3]> =
            (0..8).map(|k| [0, 1, 2].map(|b| if k >> b & 1 == 0 { lo } else { hi })).collect();
        let faces = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5];
        MeshInput::polygons(Positions::from_f64(points), &[4; 6], &faces)
    }

    /// Two squares in the plane of x and y, the first at z = 0, the second smaller, at this z, of other materials.
    fn squares(z: f32) -> Scene {
        let mut points: Vec<[f32; 3]> = vec![];
        for (half, z) in [(1.0f32, 0.0f32), (0.5, z)] {
            points.extend([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]]);
        }
        let mut geometry = MeshInput::polygons(points, &[4, 4], &[0, 1, 2, 3, 4, 5, 6, 7]);
        geometry.face_material = vec![0, 1];
        let mut scene = scene(geometry);
        for base_color in [[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]] {
            scene.materials.push(Material { base_color, ..Default::default() });
        }
        scene
    }

    #[test]
    fn a_cubes_silhouette_has_its_area() {
        let surface = Surface::of(&scene(cube(0.0, 1.0))).unwrap();
        for view in View::axes(surface.bounds(), 200) {
            let mask = silhouette(&surface, &view);
            let area = mask.count() as f64 * view.pixel_area();
            // A pixel's breadth along the outline at most.
            assert!((area - 1.0).abs() < 0.02, "{area}");
            assert!(mask.get(100, 100) && !mask.get(2, 100) && !mask.get(200, 100));
        }
        // Along the diagonal: a hexagon of area sqrt(3).
        let view = View::fit(surface.bounds(), DVec3::splat(-1.0), DVec3::Y, 400, 400);
        let area = silhouette(&surface, &view).count() as f64 * view.pixel_area();
        assert!((area - 3f64.sqrt()).abs() < 0.02, "{area}");
    }

    #[test]
    fn the_nearer_surface_is_seen() {
        let middle = |z: f32, look: DVec3, projection: Projection| {
            let surface = Surface::of(&squares(z)).unwrap();
            let view = View::fit(surface.bounds(), look, DVec3::Y, 64, 64).with_projection(projection);
            let [r, _, b] = render(&surface, &view, &Style::default()).pixel(32, 32).unwrap();
            (r > 0, b > 0)
        };
        for projection in [Projection::Orthographic, Projection::Perspective { distance: 4.0 }] {
            assert_eq!(middle(0.1, DVec3::NEG_Z, projection), (false, true));
            assert_eq!(middle(0.1, DVec3::Z, projection), (true, false));
            assert_eq!(middle(-0.1, DVec3::NEG_Z, projection), (true, false));
            // At the same depth the first stays.
            assert_eq!(middle(0.0, DVec3::NEG_Z, projection), (true, false));
        }
    }

    #[test]
    fn perspective_makes_what_is_far_smaller() {
        let count = |z: f32| {
            let surface = Surface::of(&squares(z)).unwrap();
            let bounds = Some((DVec3::splat(-1.0), DVec3::ONE));
            let view = View::fit(bounds, DVec3::NEG_Z, DVec3::Y, 200, 200)
                .with_projection(Projection::Perspective { distance: 4.0 });
            let picture = render(&surface, &view, &Style { samples: 1, ..Style::default() });
            (0..200 * 200)
                .filter(|i| picture.pixel(i % 200, i / 200).is_some_and(|p| p[2] > 0 && p[0] == 0))
                .count()
        };
        // The small square at depth 3 and at depth 3.5: sides as 3.5 to 3.
        let ratio = count(1.0) as f64 / count(0.5) as f64;
        assert!((ratio - (3.5f64 / 3.0).powi(2)).abs() < 0.05, "{ratio}");
    }

    #[test]
    fn the_same_bytes_twice_and_the_same_mask_as_itself() {
        let surface = sample("scan", 2000);
        let view = View::three_quarter(surface.bounds(), 160, 120);
        let style = Style { wireframe: true, ..Style::default() };
        let png = || render(&surface, &view, &style).png().unwrap();
        assert_eq!(png(), png());
        for view in View::axes(surface.bounds(), 256) {
            let mask = silhouette(&surface, &view);
            assert!(mask.count() > 1000);
            assert_eq!(mask.iou(&silhouette(&surface, &view)), Some(1.0));
        }
    }

    #[test]
    fn silhouettes_of_other_meshes_differ() {
        let (sphere, torus) = (sample("sphere", 2000), sample("torus", 2000));
        let view = View::fit(sphere.bounds(), DVec3::NEG_Z, DVec3::Y, 64, 64);
        let (a, b) = (silhouette(&sphere, &view), silhouette(&torus, &view));
        let iou = a.iou(&b).unwrap();
        assert!(iou > 0.0 && iou < 0.99, "{iou}");
        let other = View::fit(sphere.bounds(), DVec3::NEG_Z, DVec3::Y, 64, 63);
        assert_eq!(a.iou(&silhouette(&sphere, &other)), None);
        let nothing = silhouette(&Surface::default(), &view);
        assert_eq!((nothing.count(), nothing.iou(&nothing), a.iou(&nothing)), (0, Some(1.0), Some(0.0)));
    }

    #[test]
    fn a_tightened_view_reaches_the_margin_on_both_sides() {
        let surface = sample("torus", 2000);
        let view = View::three_quarter(surface.bounds(), 200, 100).tightened(&surface);
        let mask = silhouette(&surface, &view);
        let rows: Vec<u32> = (0..100).filter(|&y| (0..200).any(|x| mask.get(x, y))).collect();
        let (first, last) = (rows[0], rows[rows.len() - 1]);
        assert!((3..=5).contains(&first) && (94..=96).contains(&last), "{first} {last}");
        let nothing = Surface::default();
        assert_eq!(view.clone().tightened(&nothing), view);
    }

    #[test]
    fn a_closed_surface_has_no_holes_in_its_silhouette() {
        let surface = sample("sphere", 20_000);
        let view = View::three_quarter(surface.bounds(), 100, 100);
        let mask = silhouette(&surface, &view);
        for y in 0..100 {
            let row: Vec<u32> = (0..100).filter(|&x| mask.get(x, y)).collect();
            assert!(row.windows(2).all(|w| w[1] == w[0] + 1), "row {y}: {row:?}");
        }
    }

    #[test]
    fn scale_and_place_do_not_change_the_picture() {
        let picture = |lo: f64, hi: f64| {
            let surface = Surface::of(&scene(cube(lo, hi))).unwrap();
            render(&surface, &View::three_quarter(surface.bounds(), 80, 80), &Style::default())
        };
        let one = picture(-1.0, 1.0);
        for scale in [2f64.powi(-80), 2f64.powi(60), 2f64.powi(-1030), 2f64.powi(1020)] {
            assert_eq!(picture(-scale, scale), one, "{scale}");
        }
        assert_eq!(picture(1e6 - 1.0, 1e6 + 1.0), one);
    }

    #[test]
    fn normals_shade_and_wires_show() {
        let mut geometry = cube(-1.0, 1.0);
        let surface = |g: &MeshInput| Surface::of(&scene(g.clone())).unwrap();
        let view = View::fit(surface(&geometry).bounds(), DVec3::NEG_Z, DVec3::Y, 64, 64);
        let draw = |g: &MeshInput, style: Style| render(&surface(g), &view, &style);
        let plain = draw(&geometry, Style::default());
        // A square seen from the front: its sides are dark, its diagonal is not.
        let wires = draw(&geometry, Style { wireframe: true, ..Style::default() });
        assert_eq!(wires.pixel(30, 30), plain.pixel(30, 30));
        let row: Vec<bool> = (0..64).map(|x| wires.pixel(x, 40) != plain.pixel(x, 40)).collect();
        assert_eq!(row.iter().filter(|&&b| b).count(), 2);

        let mut wedges =
            crate::aif::Wedges::new(vec![crate::aif::Channel::new(crate::aif::Semantic::Normal, 3)]).unwrap();
        wedges.push(&[1.0, 0.0, 0.1], 1);
        wedges.corner = vec![0; geometry.corners.len()];
        geometry.wedges = Some(wedges);
        let flat = draw(&geometry, Style { shading: Shading::Flat, ..Style::default() });
        assert_eq!(flat, plain);
        assert!(draw(&geometry, Style::default()).pixel(32, 32) < plain.pixel(32, 32));
    }

    #[test]
    fn hostile_geometry_draws_something_or_nothing() {
        let names: Vec<&str> = crate::meshes::names().iter().map(|e| e.name).collect();
        for name in names {
            let sample = generate(name, &GenerateOptions::default().with_faces(200)).unwrap();
            let Ok(surface) = Surface::of(&crate::samples::scene(sample, name)) else { continue };
            for view in [
                View::three_quarter(surface.bounds(), 48, 48),
                View::fit(None, DVec3::X, DVec3::Y, 48, 48)
                    .with_projection(Projection::Perspective { distance: 2.0 }),
            ] {
                let picture = render(&surface, &view, &Style { wireframe: true, ..Style::default() });
                assert_eq!((picture.width(), picture.height()), (48, 48), "{name}");
            }
        }
    }
}
