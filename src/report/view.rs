//! Where a picture is taken from.

use super::surface::Surface;
use crate::refine::view::Camera;
use glam::{DVec2, DVec3};

/// How depth changes size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// It does not.
    Orthographic,
    /// As a pinhole camera sees it.
    Perspective {
        /// Distance of the eye from the view's centre, in units of the largest half side of the box the view was fitted to.
        distance: f64,
    },
}

/// A camera and the size of its picture in pixels.
///
/// Lengths are kept in units of the box it was fitted to, so that a mesh of 1e-25 or 1e12 units across, or far from the origin,
/// is drawn like any other.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    centre: DVec3,
    radius: f64,
    right: DVec3,
    up: DVec3,
    look: DVec3,
    /// Half sides of the box, in radii.
    half: DVec3,
    projection: Projection,
    /// Pixels for one radius at the centre (orthographic), or at depth one radius (perspective).
    scale: f64,
    width: u32,
    height: u32,
}

/// The part of the picture that the box may fill.
const FILL: f64 = 0.92;
/// The largest side of a picture, pixels.
const LARGEST: u32 = 16384;
/// What is nearer to the eye than this, in radii, is cut off.
const NEAR: f64 = 1e-3;

/// A point as a view sees it, homogeneous: the pixel is the middle of the picture plus `xy / w`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) w: f64,
    /// Distance along the direction of view, for [`View::nearness`].
    pub(super) z: f64,
}

impl View {
    /// An orthographic view in direction `look` with `up` upwards, in which the box `bounds` fills the picture but for a margin.
    ///
    /// `None` (an empty scene) is taken as the unit box. Directions need not be of unit length or square to each other; useless ones
    /// are replaced. Sides are limited to 1 to 16384 pixels.
    pub fn fit(bounds: Option<(DVec3, DVec3)>, look: DVec3, up: DVec3, width: u32, height: u32) -> View {
        let (lo, hi) = bounds.unwrap_or((DVec3::splat(-0.5), DVec3::splat(0.5)));
        // Halved first: the sum of two large coordinates may overflow.
        let (centre, half) = (0.5 * lo + 0.5 * hi, 0.5 * hi - 0.5 * lo);
        let radius = Some(half.max_element()).filter(|r| *r > 0.0 && r.is_finite()).unwrap_or(1.0);
        let look = look.try_normalize().unwrap_or(DVec3::NEG_Z);
        let right = look
            .cross(up)
            .try_normalize()
            .unwrap_or_else(|| look.any_orthonormal_vector())
            .normalize_or(DVec3::X);
        let mut view = View {
            centre,
            radius,
            right,
            up: right.cross(look),
            look,
            half: half / radius,
            projection: Projection::Orthographic,
            scale: 1.0,
            width: width.clamp(1, LARGEST),
            height: height.clamp(1, LARGEST),
        };
        view.scale = view.fitting_scale();
        view
    }

    /// What a camera sees, but for the plane that cuts off what is far.
    pub fn of_camera(camera: &Camera) -> View {
        // Depth in radii is what `w` comes to with the centre one radius before the eye.
        let (radius, projection) = match camera.is_perspective() {
            true => (camera.near() / NEAR, Projection::Perspective { distance: 1.0 }),
            false => (1.0, Projection::Orthographic),
        };
        let scale = if camera.is_perspective() { 1.0 } else { radius };
        View {
            centre: camera.eye() + if camera.is_perspective() { radius * camera.look() } else { DVec3::ZERO },
            radius,
            right: camera.right(),
            up: camera.up(),
            look: camera.look(),
            half: DVec3::ZERO,
            projection,
            scale: camera.pixel_scale() * scale,
            width: camera.width().clamp(1, LARGEST),
            height: camera.height().clamp(1, LARGEST),
        }
    }

    /// Half from the front, from the right and from above, with y upwards.
    pub fn three_quarter(bounds: Option<(DVec3, DVec3)>, width: u32, height: u32) -> View {
        View::fit(bounds, DVec3::new(-0.6, -0.5, -1.0), DVec3::Y, width, height)
    }

    /// The six views along the axes, square: from +x, -x, +y, -y, +z, -z.
    pub fn axes(bounds: Option<(DVec3, DVec3)>, side: u32) -> [View; 6] {
        [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z].map(|from| {
            let up = if from.y == 0.0 { DVec3::Y } else { DVec3::Z };
            View::fit(bounds, -from, up, side, side)
        })
    }

    /// The same, moved and scaled so that the surface itself, not its box, fills the picture. For orthographic views; others stay.
    pub fn tightened(self, surface: &Surface) -> View {
        self.tightened_to(&[surface])
    }

    /// The same for several surfaces: all of them fit.
    pub fn tightened_to(mut self, surfaces: &[&Surface]) -> View {
        if self.projection != Projection::Orthographic {
            return self;
        }
        let (mut lo, mut hi) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for surface in surfaces {
            let corners = surface.triangles.iter().flat_map(|t| t.corners);
            for s in corners.filter_map(|v| self.see(surface.points[v as usize])) {
                (lo, hi) = (lo.min(DVec2::new(s.x, s.y)), hi.max(DVec2::new(s.x, s.y)));
            }
        }
        let sides = DVec2::new(self.width as f64, self.height as f64);
        let factor = (FILL * sides / (hi - lo)).min_element();
        if factor.is_finite() && factor > 0.0 {
            let middle = 0.5 * (lo + hi) / self.scale;
            self.centre += (self.right * middle.x - self.up * middle.y) * self.radius;
            self.scale *= factor;
        }
        self
    }

    /// The same with this projection. An eye inside the box is moved out of it.
    pub fn with_projection(mut self, projection: Projection) -> View {
        self.projection = match projection {
            Projection::Perspective { distance } => {
                let nearest = self.depth_of_box() + 0.1;
                Projection::Perspective {
                    distance: if distance > nearest { distance.min(1e6) } else { nearest },
                }
            }
            p => p,
        };
        self.scale = self.fitting_scale();
        self
    }

    /// The same in a picture of so many pixels across, 1 to 16384, and as many down as keep its shape.
    pub fn resized(mut self, width: u32) -> View {
        let width = width.clamp(1, LARGEST);
        let factor = f64::from(width) / f64::from(self.width);
        self.height = ((f64::from(self.height) * factor).round() as u32).clamp(1, LARGEST);
        self.width = width;
        self.scale *= factor;
        self
    }

    /// Where a point falls in the picture, pixels from the left and from the top, not limited to it; `None` at the eye and behind it, and too far away for numbers.
    pub fn pixel(&self, p: DVec3) -> Option<[f64; 2]> {
        let s = self.see(p).filter(|s| s.w > 0.0)?;
        Some([0.5 * f64::from(self.width) + s.x / s.w, 0.5 * f64::from(self.height) + s.y / s.w])
    }

    /// The same with a picture of `factor` times the sides.
    pub(super) fn enlarged(&self, factor: u32) -> View {
        let factor = factor.clamp(1, LARGEST / self.width.max(self.height));
        let mut view = self.clone();
        (view.width, view.height) = (self.width * factor, self.height * factor);
        view.scale *= factor as f64;
        view
    }

    /// Pixels across.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Pixels from top to bottom.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// A point of the world as this view sees it; `None` for one too far away for numbers.
    pub(super) fn see(&self, p: DVec3) -> Option<Seen> {
        let q = (p - self.centre) / self.radius;
        let z = q.dot(self.look);
        let w = match self.projection {
            Projection::Orthographic => 1.0,
            Projection::Perspective { distance } => z + distance,
        };
        let seen = Seen { x: self.scale * q.dot(self.right), y: -self.scale * q.dot(self.up), w, z };
        (seen.x.is_finite() && seen.y.is_finite() && z.is_finite()).then_some(seen)
    }

    /// Larger is nearer; linear over the picture.
    pub(super) fn nearness(&self, w: f64, z: f64) -> f64 {
        match self.projection {
            Projection::Orthographic => -z,
            Projection::Perspective { .. } => 1.0 / w,
        }
    }

    /// The least `w` that is shown.
    pub(super) fn near(&self) -> f64 {
        NEAR
    }

    /// A direction of the world in the view's axes: to the right, up, towards the eye.
    pub(super) fn direction(&self, d: DVec3) -> DVec3 {
        DVec3::new(d.dot(self.right), d.dot(self.up), -d.dot(self.look))
    }

    /// The area of a pixel in world units squared; for an orthographic view.
    #[cfg(test)]
    pub(super) fn pixel_area(&self) -> f64 {
        (self.radius / self.scale).powi(2)
    }

    fn depth_of_box(&self) -> f64 {
        self.look.abs().dot(self.half)
    }

    fn fitting_scale(&self) -> f64 {
        let (x, y) = (self.right.abs().dot(self.half), self.up.abs().dot(self.half));
        let pixels = |side: u32, half: f64| match half > 0.0 {
            true => 0.5 * FILL * side as f64 / half,
            false => f64::INFINITY,
        };
        let at_centre = pixels(self.width, x).min(pixels(self.height, y));
        // A point, or a line in the direction of view.
        let at_centre =
            if at_centre.is_finite() { at_centre } else { 0.5 * self.width.min(self.height) as f64 };
        match self.projection {
            Projection::Orthographic => at_centre,
            // The box's nearest corners fit.
            Projection::Perspective { distance } => at_centre * (distance - self.depth_of_box()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fitted_box_fills_the_picture_and_no_more() {
        let (lo, hi) = (DVec3::new(1e6, -2.0, 3.0), DVec3::new(1e6 + 4.0, 0.0, 4.0));
        let bounds = Some((lo, hi));
        for view in View::axes(bounds, 100).into_iter().chain([View::three_quarter(bounds, 200, 100)]) {
            for view in [view.clone(), view.with_projection(Projection::Perspective { distance: 5.0 })] {
                let mut reach: f64 = 0.0;
                for k in 0..8 {
                    let pick = |b: u32, lo, hi| if k >> b & 1 == 0 { lo } else { hi };
                    let p = DVec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z));
                    let s = view.see(p).unwrap();
                    let (x, y) = (s.x / s.w / view.width as f64, s.y / s.w / view.height as f64);
                    reach = reach.max(x.abs()).max(y.abs());
                }
                assert!(reach <= 0.5 * FILL + 1e-9 && reach > 0.3, "{reach}");
            }
        }
    }

    #[test]
    fn a_camera_sees_points_where_it_projects_them() {
        use crate::refine::view::{CameraParameters, Projection as Kind};
        for projection in [Kind::Perspective { fov_y_deg: 50.0 }, Kind::Orthographic { ortho_height: 7.0 }] {
            let camera = Camera::new(&CameraParameters {
                eye: DVec3::new(1.0, 2.0, 30.0),
                target: DVec3::new(0.5, 0.0, 0.0),
                up: DVec3::new(0.1, 1.0, 0.0),
                projection,
                width: 300,
                height: 200,
                near: 0.5,
                far: 100.0,
            })
            .unwrap();
            let view = View::of_camera(&camera);
            for p in [DVec3::ZERO, DVec3::new(2.0, -1.0, 3.0), DVec3::new(-1.0, 3.0, -8.0)] {
                let (pixel, _) = camera.project(p).unwrap();
                let s = view.see(p).unwrap();
                let seen = DVec2::new(150.0 + s.x / s.w, 100.0 + s.y / s.w);
                assert!(seen.distance(pixel) < 1e-9, "{seen} {pixel}");
                assert!(DVec2::from(view.pixel(p).unwrap()).distance(pixel) < 1e-9);
                let half = view.clone().resized(150);
                assert_eq!((half.width(), half.height()), (150, 100));
                assert!(DVec2::from(half.pixel(p).unwrap()).distance(0.5 * pixel) < 1e-9);
            }
        }
    }

    #[test]
    fn useless_arguments_still_make_a_view() {
        for bounds in
            [None, Some((DVec3::ONE, DVec3::ONE)), Some((DVec3::splat(-1e308), DVec3::splat(1e308)))]
        {
            let view = View::fit(bounds, DVec3::ZERO, DVec3::ZERO, 0, 4_000_000_000);
            assert_eq!((view.width(), view.height()), (1, LARGEST));
            let s = view.see(bounds.map_or(DVec3::ZERO, |b| b.1)).unwrap();
            assert!(s.x.is_finite() && s.w == 1.0);
        }
        assert!(View::fit(None, DVec3::Z, DVec3::Y, 8, 8).see(DVec3::splat(1e300)).is_some());
        let tiny = Some((DVec3::ZERO, DVec3::splat(1e-300)));
        assert!(View::fit(tiny, DVec3::Z, DVec3::Y, 8, 8).see(DVec3::splat(1e300)).is_none());
    }
}
