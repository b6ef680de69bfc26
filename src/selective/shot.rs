//! Pictures of a flight: what the camera sees, and from above where it looks and how fine the mesh is.

use crate::refine::view::Camera;
use crate::report::{Picture, Shading, Style, Surface, SurfaceError, View, render};
use crate::scene::Scene;
use glam::DVec3;

/// How a picture of a frame is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ShotStyle {
    /// Pixels across; the height follows from the camera. `None`: as many as the camera has.
    pub width: Option<u32>,
    /// Draw the edges of the faces.
    pub wireframe: bool,
    /// Put a picture from above into the lower right corner: the faces with their edges, and what the camera sees.
    pub inset: bool,
    /// What is upwards.
    pub up: DVec3,
}

impl Default for ShotStyle {
    fn default() -> Self {
        ShotStyle { width: None, wireframe: false, inset: false, up: DVec3::Y }
    }
}

const EDGE: [u8; 3] = [96, 100, 108];
const SIGHT: [u8; 3] = [200, 60, 20];
/// The inset's sides, as a part of the picture's shorter side.
const INSET: f64 = 0.42;
/// The inset shows so many times the scene's sides.
const AROUND: f64 = 1.3;

/// Draws a scene as it is shown, seen by `camera`. `bounds` are what the inset shows: those of the flight, so that it stays the same.
///
/// Errors: a mesh that cannot be drawn. Time grows with the faces and the pixels.
pub fn shot(
    shown: &Scene,
    bounds: Option<(DVec3, DVec3)>,
    camera: &Camera,
    style: &ShotStyle,
) -> Result<Picture, SurfaceError> {
    let surface = Surface::of(shown)?;
    let view = View::of_camera(camera);
    let view = style.width.map_or(view.clone(), |w| view.resized(w));
    let how = Style { wireframe: style.wireframe, ..Style::default() };
    let mut picture = render(&surface, &view, &how);
    if style.inset {
        let side = (INSET * f64::from(picture.width().min(picture.height()))) as u32;
        let inset = from_above(&surface, bounds, camera, style.up, side.max(1));
        let at = [picture.width(), picture.height()].map(|n| n.saturating_sub(side + side / 20));
        picture.place(&inset, at[0], at[1]);
    }
    Ok(picture)
}

/// The surface from above with its edges, and the camera's frustum, as far as the scene reaches.
fn from_above(
    surface: &Surface,
    bounds: Option<(DVec3, DVec3)>,
    camera: &Camera,
    up: DVec3,
    side: u32,
) -> Picture {
    let around = bounds.map(|(lo, hi)| {
        let (middle, half) = (0.5 * lo + 0.5 * hi, AROUND * (0.5 * hi - 0.5 * lo));
        (middle - half, middle + half)
    });
    let north = if up.y.abs() > 0.5 { DVec3::NEG_Z } else { DVec3::Y };
    let view = View::fit(around, -up, north, side, side);
    let style = Style { wireframe: true, shading: Shading::Flat, ..Style::default() };
    let mut picture = render(surface, &view, &style);
    let reach = bounds.map_or(1.0, |(lo, hi)| {
        (0..8u32)
            .map(|k| {
                let pick = |axis: usize| if k >> axis & 1 == 1 { hi[axis] } else { lo[axis] };
                camera.depth(DVec3::new(pick(0), pick(1), pick(2)))
            })
            .fold(camera.near(), f64::max)
            .min(camera.far())
    });
    let corners = |depth: f64| {
        let half = if camera.is_perspective() { depth } else { 1.0 } / camera.pixel_scale();
        let (x, y) = (0.5 * half * f64::from(camera.width()), 0.5 * half * f64::from(camera.height()));
        [[-x, -y], [x, -y], [x, y], [-x, y]]
            .map(|[x, y]| camera.eye() + depth * camera.look() + x * camera.right() + y * camera.up())
    };
    let (near, far) = (corners(camera.near()), corners(reach));
    let mut stroke = |a: DVec3, b: DVec3| {
        if let (Some(a), Some(b)) = (view.pixel(a), view.pixel(b)) {
            picture.stroke(a, b, (f64::from(side) / 160.0).max(1.0), SIGHT);
        }
    };
    for k in 0..4 {
        stroke(near[k], far[k]);
        stroke(far[k], far[(k + 1) % 4]);
    }
    picture.outline(EDGE);
    picture
}
