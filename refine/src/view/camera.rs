//! Where a picture is taken from.

use super::frustum::{Frustum, FrustumError};
use glam::{DMat4, DVec2, DVec3, DVec4};

/// How depth changes size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// As a pinhole camera sees it.
    Perspective {
        /// The angle between the top and the bottom of the picture, degrees, more than 0 and less than 180.
        fov_y_deg: f64,
    },
    /// It does not.
    Orthographic {
        /// What the picture is high, world units.
        ortho_height: f64,
    },
}

/// What a camera is made of. Fields are named as in `CAM.json`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraParameters {
    /// Where it stands, world units.
    pub eye: DVec3,
    /// What it looks at: the middle of the picture. Not at the eye.
    pub target: DVec3,
    /// What points upwards in the picture; of any length, not along the direction of view.
    pub up: DVec3,
    /// Perspective or orthographic.
    pub projection: Projection,
    /// Pixels across.
    pub width: u32,
    /// Pixels from top to bottom. Pixels are square.
    pub height: u32,
    /// Nothing nearer is shown: a depth (distance along the direction of view), more than 0 if perspective.
    pub near: f64,
    /// Nothing farther is shown: a depth, more than `near`. May be infinite if perspective.
    pub far: f64,
}

/// Why there is no such camera.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// NaN or infinite.
    #[error("{0} is not finite")]
    NotFinite(&'static str),
    /// There is no direction of view.
    #[error("eye and target are the same point: target must lie in the direction of view")]
    TargetAtEye,
    /// There is no up in the picture.
    #[error("up is zero or along the direction of view: it must point to the side of it")]
    UpAlongView,
    /// No pixels.
    #[error("{0} is 0: a picture has at least one pixel each way")]
    NoPixels(&'static str),
    /// An angle that no pinhole has.
    #[error("fov_y_deg is {0}: it must be more than 0 and less than 180 degrees")]
    FieldOfView(f64),
    /// A picture of nothing.
    #[error("ortho_height is {0}: it must be more than 0")]
    OrthographicHeight(f64),
    /// The near plane is not before the eye.
    #[error("near is {0}: it must be more than 0")]
    Near(f64),
    /// Nothing between the near and the far plane.
    #[error("far is {far}: it must be more than near, {near}")]
    Far {
        /// The near plane's depth.
        near: f64,
        /// The far plane's.
        far: f64,
    },
    /// A transform that places no camera.
    #[error("the camera's transform is not finite, or flattens its axes")]
    Transform,
}

impl CameraError {
    /// The field at fault, as in [`CameraParameters`] and `CAM.json`; `transform` for [`CameraError::Transform`].
    pub fn field(&self) -> &'static str {
        match self {
            CameraError::NotFinite(field) | CameraError::NoPixels(field) => field,
            CameraError::TargetAtEye => "target",
            CameraError::UpAlongView => "up",
            CameraError::FieldOfView(_) => "fov_y_deg",
            CameraError::OrthographicHeight(_) => "ortho_height",
            CameraError::Near(_) => "near",
            CameraError::Far { .. } => "far",
            CameraError::Transform => "transform",
        }
    }
}

/// A camera and the size of its picture, checked: every query gives finite numbers for points that are not absurdly far away.
///
/// Camera space: x to the right, y up, the eye at the origin, looking along -z. Clip space is OpenGL's, and so glTF's: inside is
/// -w <= x, y, z <= w, near at z = -w. Pixels: (0, 0) is the upper left corner of the picture, y runs down.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    eye: DVec3,
    right: DVec3,
    up: DVec3,
    look: DVec3,
    projection: Projection,
    width: u32,
    height: u32,
    near: f64,
    far: f64,
    /// Half the picture's height: at depth 1 (perspective), or anywhere (orthographic).
    half_height: f64,
}

/// The least sine of the angle between `up` and the direction of view: below, where up is would be rounding.
const LEAST_SINE: f64 = 1e-9;

/// The direction of `v`, whatever its length; `None` for zero and what is not finite.
fn direction(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    (largest > 0.0 && largest.is_finite()).then(|| (v / largest).normalize())
}

#[cfg(test)]
impl Camera {
    /// For tests of what cameras on a flight decide.
    pub(crate) fn looking(eye: DVec3, look: DVec3) -> Camera {
        let of = CameraParameters {
            eye,
            target: eye + look,
            up: DVec3::Z,
            projection: Projection::Perspective { fov_y_deg: 50.0 },
            width: 800,
            height: 600,
            near: 1e-3,
            far: 20.0,
        };
        Camera::new(&of).unwrap()
    }
}

impl Camera {
    /// The camera of these parameters. Errors name the field.
    pub fn new(p: &CameraParameters) -> Result<Camera, CameraError> {
        for (name, v) in [("eye", p.eye), ("target", p.target), ("up", p.up)] {
            if !v.is_finite() {
                return Err(CameraError::NotFinite(name));
            }
        }
        // Halved first: the difference of two large coordinates may overflow.
        let look = direction(0.5 * p.target - 0.5 * p.eye).ok_or(CameraError::TargetAtEye)?;
        let up = direction(p.up).ok_or(CameraError::UpAlongView)?;
        let right = look.cross(up);
        if right.length() < LEAST_SINE {
            return Err(CameraError::UpAlongView);
        }
        let right = right.normalize();
        Camera { eye: p.eye, right, up: right.cross(look).normalize(), look, ..Camera::unplaced(p)? }
            .checked()
    }

    /// A camera placed by a transform, as glTF's are: it stands at the origin of `to_world`, looks along its -z, y is up. Scale is
    /// ignored, and axes that are not square to each other are made so, z first. `eye`, `target` and `up` of the parameters are not used.
    pub fn placed(to_world: &DMat4, p: &CameraParameters) -> Result<Camera, CameraError> {
        let axis = |c: DVec4| direction(c.truncate()).ok_or(CameraError::Transform);
        let (look, up) = (-axis(to_world.z_axis)?, axis(to_world.y_axis)?);
        let eye = to_world.w_axis.truncate();
        let right = look.cross(up);
        if !eye.is_finite() || to_world.w_axis.w != 1.0 || right.length() < LEAST_SINE {
            return Err(CameraError::Transform);
        }
        let right = right.normalize();
        Camera { eye, right, up: right.cross(look).normalize(), look, ..Camera::unplaced(p)? }.checked()
    }

    /// What does not depend on where it stands.
    fn unplaced(p: &CameraParameters) -> Result<Camera, CameraError> {
        for (name, n) in [("width", p.width), ("height", p.height)] {
            if n == 0 {
                return Err(CameraError::NoPixels(name));
            }
        }
        let half_height = match p.projection {
            Projection::Perspective { fov_y_deg } => {
                if fov_y_deg.is_nan() {
                    return Err(CameraError::NotFinite("fov_y_deg"));
                }
                let half = (0.5 * fov_y_deg.to_radians()).tan();
                if !(fov_y_deg > 0.0 && fov_y_deg < 180.0 && half > 0.0 && half < 1e12) {
                    return Err(CameraError::FieldOfView(fov_y_deg));
                }
                half
            }
            Projection::Orthographic { ortho_height } => {
                if !ortho_height.is_finite() {
                    return Err(CameraError::NotFinite("ortho_height"));
                }
                // Half of the least positive number is none.
                if 0.5 * ortho_height <= 0.0 {
                    return Err(CameraError::OrthographicHeight(ortho_height));
                }
                0.5 * ortho_height
            }
        };
        let perspective = matches!(p.projection, Projection::Perspective { .. });
        if !p.near.is_finite() {
            return Err(CameraError::NotFinite("near"));
        }
        if p.far.is_nan() || p.far.is_infinite() && !perspective {
            return Err(CameraError::NotFinite("far"));
        }
        if perspective && p.near <= 0.0 {
            return Err(CameraError::Near(p.near));
        }
        if p.far <= p.near {
            return Err(CameraError::Far { near: p.near, far: p.far });
        }
        Ok(Camera {
            eye: DVec3::ZERO,
            right: DVec3::X,
            up: DVec3::Y,
            look: DVec3::NEG_Z,
            projection: p.projection,
            width: p.width,
            height: p.height,
            near: p.near,
            far: p.far,
            half_height,
        })
    }

    /// Refuses numbers that are fine each, but not together: a matrix that is not finite, planes that cannot be told apart.
    fn checked(self) -> Result<Camera, CameraError> {
        match Frustum::from_matrix(&self.projection_matrix()) {
            Ok(_) => Ok(self),
            Err(FrustumError::NotFinite | FrustumError::Degenerate(_)) => {
                Err(CameraError::Far { near: self.near, far: self.far })
            }
        }
    }

    /// Where it stands.
    pub fn eye(&self) -> DVec3 {
        self.eye
    }

    /// The direction of view, of unit length.
    pub fn look(&self) -> DVec3 {
        self.look
    }

    /// To the right in the picture, of unit length.
    pub fn right(&self) -> DVec3 {
        self.right
    }

    /// Up in the picture, of unit length, square to the direction of view.
    pub fn up(&self) -> DVec3 {
        self.up
    }

    /// Perspective or orthographic.
    pub fn projection(&self) -> Projection {
        self.projection
    }

    /// True if things farther away look smaller.
    pub fn is_perspective(&self) -> bool {
        matches!(self.projection, Projection::Perspective { .. })
    }

    /// Pixels across.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Pixels from top to bottom.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Depth of the near plane.
    pub fn near(&self) -> f64 {
        self.near
    }

    /// Depth of the far plane; may be infinite.
    pub fn far(&self) -> f64 {
        self.far
    }

    /// Width of the picture over its height.
    pub fn aspect(&self) -> f64 {
        self.width as f64 / self.height as f64
    }

    /// Lambda: how many pixels a length of 1 across the view takes, at depth 1 (perspective) or at any depth (orthographic).
    ///
    /// Perspective: height / (2 tan(fov_y / 2)), which for square pixels is the same with the width and the horizontal angle.
    pub fn pixel_scale(&self) -> f64 {
        0.5 * self.height as f64 / self.half_height
    }

    /// Distance of a point from the eye along the direction of view; negative behind the eye.
    pub fn depth(&self, p: DVec3) -> f64 {
        (p - self.eye).dot(self.look)
    }

    /// How many pixels a length takes, at most, at a depth: lambda * length / depth, infinite at and behind the eye if perspective.
    ///
    /// What lies at the picture's side and points along the view may look longer than this by 1 / cos of its angle off the axis.
    pub fn pixels(&self, length: f64, depth: f64) -> f64 {
        match self.projection {
            Projection::Orthographic { .. } => self.pixel_scale() * length,
            Projection::Perspective { .. } if depth > 0.0 => self.pixel_scale() * length / depth,
            Projection::Perspective { .. } => f64::INFINITY,
        }
    }

    /// The pixel (with fraction) that a point falls on, not limited to the picture, and its depth. `None` at and behind the eye if perspective.
    pub fn project(&self, p: DVec3) -> Option<(DVec2, f64)> {
        let q = p - self.eye;
        let depth = q.dot(self.look);
        let w = if self.is_perspective() { depth } else { 1.0 };
        let middle = 0.5 * DVec2::new(self.width as f64, self.height as f64);
        let offset = DVec2::new(q.dot(self.right), -q.dot(self.up)) * (self.pixel_scale() / w);
        (w > 0.0).then_some((middle + offset, depth))
    }

    /// World to camera space. For a scene far from the origin rather move points to the eye first and use
    /// [`Camera::rotation`]: the translation of this matrix loses what `eye` has in its last places.
    pub fn view_matrix(&self) -> DMat4 {
        self.rotation() * DMat4::from_translation(-self.eye)
    }

    /// The view matrix without its translation.
    pub fn rotation(&self) -> DMat4 {
        DMat4::from_cols(self.right.extend(0.0), self.up.extend(0.0), (-self.look).extend(0.0), DVec4::W)
            .transpose()
    }

    /// Camera space to clip space, OpenGL's.
    pub fn projection_matrix(&self) -> DMat4 {
        let (y, n, f) = (1.0 / self.half_height, self.near, self.far);
        let x = y / self.aspect();
        let rows = match self.projection {
            Projection::Perspective { .. } => {
                // With n / f no product of the two can overflow, and an infinite f gives its limit.
                let k = n / f;
                let z = DVec4::new(0.0, 0.0, -(1.0 + k) / (1.0 - k), -2.0 * n / (1.0 - k));
                [z, DVec4::new(0.0, 0.0, -1.0, 0.0)]
            }
            Projection::Orthographic { .. } => {
                let middle = 0.5 * n + 0.5 * f;
                let half = 0.5 * f - 0.5 * n;
                [DVec4::new(0.0, 0.0, -1.0 / half, -middle / half), DVec4::W]
            }
        };
        DMat4::from_cols(DVec4::new(x, 0.0, 0.0, 0.0), DVec4::new(0.0, y, 0.0, 0.0), rows[0], rows[1])
            .transpose()
    }

    /// World to clip space: [`Camera::projection_matrix`] * [`Camera::view_matrix`].
    pub fn matrix(&self) -> DMat4 {
        self.projection_matrix() * self.view_matrix()
    }

    /// The six planes, in world space, about the eye.
    pub fn frustum(&self) -> Frustum {
        // It was found sound when the camera was made.
        Frustum::from_matrix(&(self.projection_matrix() * self.rotation()))
            .unwrap_or(Frustum::everything())
            .about(self.eye)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn parameters() -> CameraParameters {
        CameraParameters {
            eye: DVec3::new(1.0, 2.0, 5.0),
            target: DVec3::new(1.0, 2.0, 0.0),
            up: DVec3::Y,
            projection: Projection::Perspective { fov_y_deg: 90.0 },
            width: 200,
            height: 100,
            near: 0.5,
            far: 50.0,
        }
    }

    fn field(change: impl FnOnce(&mut CameraParameters)) -> &'static str {
        let mut p = parameters();
        change(&mut p);
        let e = Camera::new(&p).expect_err("no camera");
        assert!(e.to_string().contains(e.field()), "{e}");
        e.field()
    }

    #[test]
    fn wrong_cameras_are_refused_by_field() {
        assert!(Camera::new(&parameters()).is_ok());
        assert_eq!(field(|p| p.eye.x = f64::NAN), "eye");
        assert_eq!(field(|p| p.target.y = f64::INFINITY), "target");
        assert_eq!(field(|p| p.target = p.eye), "target");
        assert_eq!(field(|p| p.up = DVec3::ZERO), "up");
        assert_eq!(field(|p| p.up = DVec3::new(0.0, 0.0, -1e-200)), "up");
        assert_eq!(field(|p| p.up = DVec3::NAN), "up");
        assert_eq!(field(|p| p.width = 0), "width");
        assert_eq!(field(|p| p.height = 0), "height");
        for fov_y_deg in [0.0, -1.0, 180.0, 400.0, f64::NAN, f64::INFINITY] {
            assert_eq!(field(|p| p.projection = Projection::Perspective { fov_y_deg }), "fov_y_deg");
        }
        for ortho_height in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(field(|p| p.projection = Projection::Orthographic { ortho_height }), "ortho_height");
        }
        assert_eq!(field(|p| p.near = 0.0), "near");
        assert_eq!(field(|p| p.near = f64::NAN), "near");
        assert_eq!(field(|p| p.far = 0.5), "far");
        assert_eq!(field(|p| p.far = f64::NAN), "far");
        // Finite each, but 1 / (far - near) is not.
        assert_eq!(
            field(|p| {
                p.projection = Projection::Orthographic { ortho_height: 1.0 };
                (p.near, p.far) = (0.0, 1e-310);
            }),
            "far"
        );
        let flat = DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0));
        for to_world in [flat, DMat4::NAN, DMat4::ZERO] {
            assert_eq!(Camera::placed(&to_world, &parameters()), Err(CameraError::Transform));
        }
    }

    #[test]
    fn pixels_are_where_they_should_be() {
        let camera = Camera::new(&parameters()).unwrap();
        // tan 45 = 1: half of the height at depth 1.
        assert!((camera.pixel_scale() - 50.0).abs() < 1e-12);
        let (xy, depth) = camera.project(DVec3::new(3.0, 3.0, 3.0)).unwrap();
        assert!((xy - DVec2::new(150.0, 25.0)).length() < 1e-12 && depth == 2.0, "{xy}");
        assert!(camera.project(DVec3::new(0.0, 0.0, 5.0)).is_none());
        assert!((camera.pixels(0.1, 5.0) - 1.0).abs() < 1e-12 && camera.pixels(1.0, -1.0) == f64::INFINITY);
        let p =
            CameraParameters { projection: Projection::Orthographic { ortho_height: 4.0 }, ..parameters() };
        let camera = Camera::new(&p).unwrap();
        assert_eq!(camera.pixels(0.2, 1e9), 5.0);
        let (xy, _) = camera.project(DVec3::new(2.0, 1.0, 9.0)).unwrap();
        assert_eq!(xy, DVec2::new(125.0, 75.0));
    }

    #[test]
    fn matrices_say_what_project_does() {
        for projection in
            [Projection::Perspective { fov_y_deg: 40.0 }, Projection::Orthographic { ortho_height: 3.0 }]
        {
            let p = CameraParameters { projection, up: DVec3::new(0.3, 1.0, 0.2), ..parameters() };
            let camera = Camera::new(&CameraParameters { target: DVec3::new(-1.0, 0.5, 0.0), ..p }).unwrap();
            for q in [DVec3::new(0.0, 1.0, 0.5), DVec3::new(2.0, -3.0, 1.0)] {
                let clip = camera.matrix() * q.extend(1.0);
                let ndc = clip.truncate() / clip.w;
                let (xy, depth) = camera.project(q).unwrap();
                assert!(
                    (xy.x - 100.0 * (1.0 + ndc.x)).abs() < 1e-9 && (xy.y - 50.0 * (1.0 - ndc.y)).abs() < 1e-9
                );
                assert!(((camera.view_matrix() * q.extend(1.0)).z + depth).abs() < 1e-12);
                assert!((ndc.z > -1.0) == (depth > 0.5) && (ndc.z < 1.0) == (depth < 50.0));
            }
            let at = |depth: f64| {
                let c = camera.matrix() * (camera.eye() + camera.look() * depth).extend(1.0);
                c.z / c.w
            };
            assert!((at(0.5) + 1.0).abs() < 1e-12 && (at(50.0) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_transform_places_it_as_gltf_says() {
        let camera = Camera::new(&parameters()).unwrap();
        let to_world =
            DMat4::from_translation(parameters().eye) * DMat4::from_scale(DVec3::new(3.0, 2.0, 7.0));
        let placed = Camera::placed(&to_world, &parameters()).unwrap();
        assert_eq!(camera, placed);
    }
}
