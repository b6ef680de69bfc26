//! What a view needs: which splits may be seen, and how large their errors may look.

use super::entry::Entry;
use crate::hierarchy::{DEPTH, Hierarchy, SplitBounds};
use crate::view::{Camera, Frustum, Plane};
use glam::{DMat3, DMat4, DVec2, DVec3};

/// What counts as unseen, and is left coarse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Cull {
    /// Nothing.
    None,
    /// What is outside of the frustum.
    Frustum,
    /// What turns its back.
    Cone,
    /// Both.
    #[default]
    All,
}

/// Why there is no lens.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LensError {
    /// The mesh is placed by a matrix that flattens it, or is no placement.
    #[error("the mesh is placed by a matrix that is not affine, or flattens it")]
    Placement,
    /// No tolerance.
    #[error("the tolerance is {0} pixels: it must not be negative")]
    Tolerance(f64),
}

/// A camera, a tolerance and what to cull, seen from a mesh.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    /// Pixels.
    pub(super) tau: f64,
    pub(super) frustum: Option<Frustum>,
    /// Its planes.
    pub(super) sides: Sides,
    pub(super) back: bool,
    /// About the origin of the bounds.
    pub(super) eye: DVec3,
    pub(super) look: DVec3,
    /// Depth of a point is `gradient . (p - eye)`.
    pub(super) gradient: DVec3,
    pub(super) steep: f64,
    /// Pixels at depth 1 of a length of the mesh.
    pub(super) lambda: f64,
    pub(super) near: f64,
    /// A depth that nothing of the mesh is below, by the sphere around all of it; below 0 if the eye is in that.
    pub(super) floor: f64,
    /// Of what is in the picture, depth is at least this times the distance from the eye, lengths of the mesh.
    pub(super) slant: f64,
    pub(super) perspective: bool,
    /// Errors count by where they lie to the line of sight.
    pub(super) directional: bool,
    /// The mesh is placed without changing its angles.
    similar: bool,
    /// Depth that a length of the mesh may take away from what it belongs to, if its way is known.
    lift: f64,
}

/// Of a length seen along itself so much counts: scales must have a quotient.
const LEAST: f64 = 1e-6;
/// What rounding of places may add to the box.
const ROUND: f64 = 1e-6;

impl Lens {
    /// For a mesh that stands where `placed` puts it (the identity: where its coordinates say), seen by `camera`, with errors up to `tau` pixels.
    ///
    /// An error's size in pixels is lambda * error / depth, the depth that of the nearest place in its sphere, along the direction of view and never below the
    /// near plane's. Placements may scale unevenly; errors then count by the largest stretch.
    ///
    /// Errors: a tolerance that is negative or NaN (infinity is one); a placement that cannot be undone.
    pub fn new(
        hierarchy: &Hierarchy,
        camera: &Camera,
        placed: &DMat4,
        tau: f64,
        cull: Cull,
    ) -> Result<Lens, LensError> {
        let bounds = &hierarchy.bounds;
        Ok(Self::about(bounds.origin, camera, placed, tau, cull)?.within(bounds.diagonal))
    }

    /// The same for bounds about `origin`.
    pub(crate) fn about(
        origin: DVec3,
        camera: &Camera,
        placed: &DMat4,
        tau: f64,
        cull: Cull,
    ) -> Result<Lens, LensError> {
        if tau.is_nan() || tau < 0.0 {
            return Err(LensError::Tolerance(tau));
        }
        // About the origin of the bounds, so that nothing is lost far out.
        let placed = *placed * DMat4::from_translation(origin);
        let frustum = camera.frustum().in_space_of(&placed).ok_or(LensError::Placement)?;
        let linear = DMat3::from_mat4(placed);
        let (least, most) = stretch(&linear);
        if !(least > 0.0 && most.is_finite()) {
            return Err(LensError::Placement);
        }
        let back = placed.inverse();
        let gradient = linear.transpose() * camera.look();
        let (w, h) = (camera.width() as f64, camera.height() as f64);
        let corner = 0.5 * w.hypot(h) / camera.pixel_scale();
        Ok(Lens {
            tau,
            frustum: matches!(cull, Cull::Frustum | Cull::All).then_some(frustum),
            sides: Sides::of(&frustum),
            back: matches!(cull, Cull::Cone | Cull::All),
            eye: back.transform_point3(camera.eye()),
            // Normals of the mesh turn with its mirror image.
            look: (back.transform_vector3(camera.look())).normalize(),
            gradient,
            steep: gradient.length(),
            lambda: camera.pixel_scale() * most,
            near: camera.near().max(0.0),
            floor: f64::NEG_INFINITY,
            slant: least / (1.0 + corner * corner).sqrt(),
            perspective: camera.is_perspective(),
            directional: false,
            similar: most <= least * (1.0 + 1e-6),
            lift: 0.0,
        })
    }

    /// The same for errors that are differences along a known direction of the world, `up` (terrain: heights), as `camera` sees them: then the *distance in the picture* between a place of the finest mesh and that of what is shown above
    /// or below it is at most the tolerance, exactly, wherever in the picture it is. (lambda * error / depth is less than that towards the corners, where perspective stretches, if the camera looks up or down.)
    ///
    /// For a place p in the frustum at depth z, (a, b) = p / z in the picture, and q = p + e u, with u in the camera's axes: q / q_z - p / z = e ((u_x, u_y) - (a, b) u_z) / (z + e u_z). The numerator is convex in (a, b), so it is
    /// largest in a corner of the picture; with k its length there, the distance is at most tau if e (lambda k + tau |u_z|) <= tau z.
    pub fn upright(self, camera: &Camera, up: DVec3) -> Lens {
        let up = up.normalize_or_zero();
        let u = DVec3::new(camera.right().dot(up), camera.up().dot(up), camera.look().dot(up));
        if !self.perspective {
            return Lens { lambda: self.lambda * u.truncate().length().max(LEAST), ..self };
        }
        let corner = 0.5 * DVec2::new(camera.width() as f64, camera.height() as f64) / camera.pixel_scale();
        let corners = [corner, corner * DVec2::new(-1.0, 1.0)];
        let stretch = corners.iter().flat_map(|&c| [c, -c]).map(|c| (u.truncate() - c * u.z).length());
        // In steps of 1 %, upwards: every change makes decisions fall that would stand.
        let steps = 64.0;
        let most = ((stretch.fold(LEAST, f64::max).log2() * steps).ceil() / steps).exp2();
        let lift = self.lambda / camera.pixel_scale() * ((u.z.abs() * steps).ceil() / steps);
        Lens { lambda: self.lambda * most, lift, ..self }
    }

    /// For a mesh whose box has this diagonal. Spheres of splits may be large where the surface is flat: vertices go far there that matter little, and spheres hold those below them.
    pub(crate) fn within(self, diagonal: f64) -> Lens {
        Lens { floor: self.slant * (self.eye.length() - 0.5 * diagonal * (1.0 + ROUND)), ..self }
    }

    /// What an error of 1 takes up at depth 1, where `tau` is allowed.
    #[inline]
    pub(super) fn scale(&self, tau: f64) -> f64 {
        // An infinite tolerance times nothing is no number.
        if self.lift > 0.0 && tau.is_finite() { self.lambda + tau * self.lift } else { self.lambda }
    }

    /// The same with *directional* errors: what deviates along the line of sight counts a quarter, as it hardly shows. Where the finest mesh has a place p, what is shown has a place q near it such that lambda /
    /// depth times `sqrt(across^2 + (along / 4)^2)`, of the parts of q - p across and along the line of sight to p, is no more than the tolerance; so |q - p| is at most four times as much. Fewer faces, where the
    /// surface is seen from above; outlines stay as they are.
    ///
    /// It takes bounds that know directions ([`crate::hierarchy::Options::directions`]); by others errors count as they did. So they do where the mesh is placed by a matrix that changes angles.
    pub fn directional(self) -> Lens {
        Lens { directional: self.similar, ..self }
    }

    /// About where the lens is after so many steps like that from `before`: what is asked of it is not promised.
    pub(super) fn going_on(&self, before: &Lens, steps: f64) -> Lens {
        let on = |is: DVec3, was: DVec3| is + steps * (is - was);
        let turned = |is: DVec3, was: DVec3| on(is, was).normalize_or_zero() * is.length();
        let (mut sides, was) = (self.sides, &before.sides);
        sides.origin = on(sides.origin, was.origin);
        for k in 0..6 {
            let n = |s: &Sides| DVec3::new(s.x[k], s.y[k], s.z[k]);
            [sides.x[k], sides.y[k], sides.z[k]] = turned(n(&sides), n(was)).to_array();
        }
        let gradient = turned(self.gradient, before.gradient);
        Lens { eye: on(self.eye, before.eye), look: turned(self.look, before.look), gradient, sides, ..*self }
    }

    /// The tolerance, pixels.
    pub fn tau(&self) -> f64 {
        self.tau
    }

    /// The same with another tolerance. Errors: as [`Lens::new`].
    pub fn with_tau(mut self, tau: f64) -> Result<Lens, LensError> {
        if tau.is_nan() || tau < 0.0 {
            return Err(LensError::Tolerance(tau));
        }
        self.tau = tau;
        Ok(self)
    }

    /// How many pixels the error of a split may take up, at most, wherever in its sphere and whichever way it is; a bound that never grows from a split to those below.
    pub fn pixels(&self, hierarchy: &Hierarchy, b: &SplitBounds) -> f64 {
        let centre = b.centre - hierarchy.bounds.origin;
        self.scale(self.tau) * b.error / self.depth(centre, b.radius, f64::INFINITY)
    }

    /// True if the split is needed: it may be seen, and its error may take up the tolerance or more.
    pub fn needs(&self, hierarchy: &Hierarchy, i: usize) -> bool {
        self.wants(&Entry::of(hierarchy, i as u32), self.tau)
    }

    /// A depth that nothing in a sphere is below, or 1 where depth does not matter; if that is more than `enough`, any above that.
    #[inline]
    fn depth(&self, centre: DVec3, radius: f64, enough: f64) -> f64 {
        if !self.perspective {
            return 1.0;
        }
        let d = centre - self.eye;
        let along = self.gradient.dot(d) - self.steep * radius;
        let along = along.max(self.near).max(self.floor);
        if along > enough {
            return along;
        }
        // Beside the view and behind it, where depth falls to nothing, distance still counts.
        along.max(self.slant * (d.length() - radius))
    }

    /// [`Lens::needs`] at another tolerance.
    #[inline]
    pub(crate) fn wants(&self, e: &Entry, tau: f64) -> bool {
        let (centre, radius) = (e.centre.as_dvec3(), e.radius as f64);
        let size = self.scale(tau) * e.error as f64;
        // Depth beyond which it is fine enough; 0 / 0 is not.
        if tau > 0.0 {
            let fine = size / tau;
            let depth = self.depth(centre, radius, fine);
            if depth > fine || tau == f64::INFINITY {
                return false;
            }
            if self.directional
                && depth > DEPTH * fine
                && depth > fine * self.counts(e, centre - self.eye, radius)
            {
                return false;
            }
        }
        self.sees(e, centre, radius)
    }

    /// What part of the error counts, seen anywhere in the sphere; `line` leads to its middle.
    #[inline]
    pub(super) fn counts(&self, e: &Entry, line: DVec3, radius: f64) -> f64 {
        if !self.directional {
            return 1.0;
        }
        if !self.perspective {
            return e.direction.counts(self.look, (0.0, 1.0));
        }
        let wide = radius * radius / line.length_squared();
        // Not the comparison turned round: 0 / 0 is all ways.
        if wide < 1.0 { e.direction.counts(line, (wide.sqrt(), (1.0 - wide).sqrt())) } else { 1.0 }
    }

    /// How many tolerances the error may take up, at most; 0 if it is not seen.
    #[inline]
    pub(crate) fn urgency(&self, e: &Entry) -> f64 {
        let (centre, radius) = (e.centre.as_dvec3(), e.radius as f64);
        if self.sees(e, centre, radius) { self.urgency_seen(e) } else { 0.0 }
    }

    /// The same of what is seen.
    #[inline]
    pub(super) fn urgency_seen(&self, e: &Entry) -> f64 {
        let (centre, radius) = (e.centre.as_dvec3(), e.radius as f64);
        let size = self.scale(self.tau) * e.error as f64 * self.counts(e, centre - self.eye, radius);
        size / (self.depth(centre, radius, f64::INFINITY) * self.tau)
    }

    /// The split may be seen.
    pub(super) fn sees_entry(&self, e: &Entry) -> bool {
        self.sees(e, e.centre.as_dvec3(), e.radius as f64)
    }

    /// It may be seen.
    #[inline]
    pub(super) fn sees(&self, e: &Entry, centre: DVec3, radius: f64) -> bool {
        if self.frustum.is_some() && self.sides.least(centre) < -radius {
            return false;
        }
        if !self.back {
            return true;
        }
        let (line, reach) = if self.perspective { (centre - self.eye, radius) } else { (self.look, 0.0) };
        !faces_away(e, line, reach)
    }
}

/// The planes of a frustum side by side, so that a place is held against all at once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sides {
    origin: DVec3,
    x: [f64; 6],
    y: [f64; 6],
    z: [f64; 6],
    offset: [f64; 6],
}

impl Sides {
    fn of(f: &Frustum) -> Sides {
        let of = |part: fn(&Plane) -> f64| f.planes().each_ref().map(part);
        Sides {
            origin: f.origin(),
            x: of(|p| p.normal.x),
            y: of(|p| p.normal.y),
            z: of(|p| p.normal.z),
            offset: of(|p| p.offset),
        }
    }

    /// The distances from the planes, positive inside.
    #[inline]
    pub(super) fn distances(&self, p: DVec3) -> [f64; 6] {
        let p = p - self.origin;
        let mut d = [0.0; 6];
        for (k, d) in d.iter_mut().enumerate() {
            *d = self.x[k] * p.x + self.y[k] * p.y + self.z[k] * p.z + self.offset[k];
        }
        d
    }

    /// The least distance from a plane.
    #[inline]
    fn least(&self, p: DVec3) -> f64 {
        let [a, b, c, d, e, f] = self.distances(p);
        a.min(b).min(c.min(d)).min(e.min(f))
    }
}

/// As [`crate::view::NormalCone::faces_away_from`] and `faces_along`: how far the least dot product of the line with a direction of the cone is above `reach`; nothing if the cone tells
/// nothing, or looks the other way.
#[inline]
pub(super) fn turned(e: &Entry, line: DVec3, reach: f64) -> Option<f64> {
    let axis = e.cone.axis()?;
    let along = line.dot(axis);
    if along <= 0.0 {
        return None;
    }
    let along = along / axis.length();
    let (cos, sin) = e.cone.cos_sin();
    if cos <= 0.0 {
        return None;
    }
    let across = (line.length_squared() - along * along).max(0.0).sqrt();
    Some(along * cos - across * sin - reach)
}

/// Nothing of it shows its front.
#[inline]
fn faces_away(e: &Entry, line: DVec3, reach: f64) -> bool {
    // Most do not: told without a root where the line is too short, or the axis looks the other way.
    let Some(axis) = e.cone.axis() else { return false };
    let along = line.dot(axis);
    if along <= 0.0 || along * along < (1.0 - 1e-9) * (reach * reach * axis.length_squared()) {
        return false;
    }
    turned(e, line, reach).is_some_and(|above| above >= 0.0)
}

/// The least and the largest factor by which a matrix stretches, the least from below and the largest from above (by at most 1e-9 of each).
fn stretch(m: &DMat3) -> (f64, f64) {
    let largest = |m: &DMat3| {
        let a = m.transpose() * *m;
        // The largest eigenvalue of a symmetric matrix, in closed form.
        let mean = (a.x_axis.x + a.y_axis.y + a.z_axis.z) / 3.0;
        let b = a - DMat3::from_diagonal(DVec3::splat(mean));
        let p = ((b.x_axis.length_squared() + b.y_axis.length_squared() + b.z_axis.length_squared()) / 6.0)
            .sqrt();
        if p <= 1e-15 * mean {
            return mean.sqrt();
        }
        let half = (0.5 * (b * (1.0 / p)).determinant()).clamp(-1.0, 1.0);
        (mean + 2.0 * p * (half.acos() / 3.0).cos()).sqrt()
    };
    let (most, back) = (largest(m), largest(&m.inverse()));
    ((1.0 - 1e-9) / back, most * (1.0 + 1e-9))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{CameraParameters, Projection};

    #[test]
    fn a_matrix_stretches_by_its_singular_values() {
        let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.8);
        let m = turn * DMat3::from_diagonal(DVec3::new(3.0, -0.25, 1.5)) * turn.transpose() * turn;
        let (least, most) = stretch(&m);
        assert!((least - 0.25).abs() < 1e-6 && (most - 3.0).abs() < 1e-6, "{least} {most}");
        let (least, most) = stretch(&DMat3::from_diagonal(DVec3::splat(2.0)));
        assert!((least - 2.0).abs() < 1e-6 && (most - 2.0).abs() < 1e-6);
    }

    #[test]
    fn upright_errors_are_distances_in_the_picture() {
        let mut state = 11u64;
        let mut unit = move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as f64 / (1u64 << 31) as f64
        };
        let (mut tight, mut plain_fails) = (0.0f64, 0);
        for round in 0..400 {
            let mut vector = || DVec3::new(unit(), unit(), unit()) * 2.0 - 1.0;
            let (eye, target, up, roll) = (vector(), vector(), vector().normalize(), vector());
            let projection = match round % 4 {
                0 => Projection::Orthographic { ortho_height: 2.0 },
                _ => Projection::Perspective { fov_y_deg: 30.0 + 60.0 * unit() },
            };
            let of = CameraParameters {
                eye,
                target,
                up: roll,
                projection,
                width: 160,
                height: 90,
                near: 1e-3,
                far: 50.0,
            };
            let Ok(camera) = Camera::new(&of) else { continue };
            let tau = 0.2 + 4.0 * unit();
            let plain = Lens::about(DVec3::ZERO, &camera, &DMat4::IDENTITY, tau, Cull::All).unwrap();
            let lens = plain.upright(&camera, up);
            for _ in 0..50 {
                let z = 0.05 + 3.0 * unit();
                let at = |t: f64, side: u32| (2.0 * t - 1.0) * 0.5 * side as f64 / camera.pixel_scale();
                let depth = if camera.is_perspective() { z } else { 1.0 };
                let (a, b) = (at(unit(), 160), at(unit(), 90));
                let p = eye + camera.look() * z + (camera.right() * a + camera.up() * b) * depth;
                let picture = |e: f64| {
                    let there = |q: DVec3| camera.project(q).map(|(at, _)| at);
                    there(p).zip(there(p + up * e)).map_or(f64::INFINITY, |(a, b)| a.distance(b))
                };
                // The largest errors that are let through.
                for sign in [-1.0, 1.0] {
                    let e = sign * tau * depth / lens.scale(tau) * (1.0 - 1e-9);
                    assert!(picture(e) <= tau, "round {round}: {} above {tau}", picture(e));
                    tight = tight.max(picture(e) / tau);
                    plain_fails += usize::from(picture(sign * tau * depth / plain.scale(tau)) > tau);
                }
            }
        }
        assert!(tight > 0.98 && plain_fails > 100, "{tight} {plain_fails}");
    }
}
