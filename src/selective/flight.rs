//! Paths that a camera takes.

use crate::io::camera::{self, CameraFileError};
use crate::refine::view::{Camera, CameraError, CameraParameters, Projection};
use glam::{DMat4, DVec3};
use std::f64::consts::TAU;

/// A camera for every frame.
pub type FlightPath = Vec<Camera>;

/// Why there is no path.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PathError {
    /// A camera of a JSON array.
    #[error("camera {at}: {source}")]
    Json {
        /// Its number, from 0.
        at: usize,
        /// What is wrong.
        source: CameraFileError,
    },
    /// No JSON.
    #[error("line {line}, column {column}: {what}")]
    Syntax {
        /// From 1.
        line: usize,
        /// From 1.
        column: usize,
        /// What the parser says.
        what: String,
    },
    /// A line of a `.frames` file.
    #[error("line {line}: {what}")]
    Line {
        /// From 1.
        line: usize,
        /// What is wrong.
        what: String,
    },
    /// The heights that a path keeps above could not be read.
    #[error(transparent)]
    Heights(#[from] crate::terrain::RasterError),
    /// There is no camera in it.
    #[error(
        "no frames: a path is a JSON array of cameras, or lines `F id front(3) left(3) up(3) eye(3) zoom`"
    )]
    Empty,
    /// The model has no extent that a path could be laid about.
    #[error("a path about a model without extent, or one too large for numbers: {0}")]
    Camera(#[from] CameraError),
}

/// Pictures of paths that do not say: pixels, and degrees.
const SIDES: [u32; 2] = [1920, 1080];
const FOV_Y: f64 = 45.0;

fn looking(eye: DVec3, target: DVec3, diagonal: f64) -> Result<Camera, CameraError> {
    Camera::new(&CameraParameters {
        eye,
        target,
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: FOV_Y },
        width: SIDES[0],
        height: SIDES[1],
        near: 1e-3 * diagonal,
        far: 10.0 * diagonal,
    })
}

/// Once about the middle of a box, level, at the distance of its diagonal, looking at the middle; y points up.
///
/// Errors: a box without extent.
pub fn circle((lo, hi): (DVec3, DVec3), frames: usize) -> Result<FlightPath, PathError> {
    let (centre, diagonal) = (0.5 * lo + 0.5 * hi, (hi - lo).length());
    let at = |k: usize| {
        let (sin, cos) = (TAU * k as f64 / frames as f64).sin_cos();
        looking(centre + diagonal * DVec3::new(sin, 0.0, cos), centre, diagonal)
    };
    Ok((0..frames).map(at).collect::<Result<_, _>>()?)
}

/// Bernoulli's lemniscate `r^2 = a^2 cos 2t` over the middle of a box, `a` its diagonal, at a quarter of that above its top, looking ahead and a little down; y
/// points up. The path crosses itself over the middle, where it is fastest.
///
/// Errors: a box without extent.
pub fn lemniscate((lo, hi): (DVec3, DVec3), frames: usize) -> Result<FlightPath, PathError> {
    let (centre, a) = (0.5 * lo + 0.5 * hi, (hi - lo).length());
    let height = hi.y + 0.25 * a;
    let at = |t: f64| {
        // The usual parameter, in which the curve has no ends.
        let (sin, cos) = t.sin_cos();
        let scale = a / (1.0 + sin * sin);
        DVec3::new(centre.x + scale * cos, height, centre.z + scale * sin * cos)
    };
    let frame = |k: usize| {
        let t = TAU * k as f64 / frames as f64;
        let (eye, ahead) = (at(t), (at(t + 1e-4) - at(t - 1e-4)).normalize_or_zero());
        looking(eye, eye + ahead - 0.4 * DVec3::Y, a)
    };
    Ok((0..frames).map(frame).collect::<Result<_, _>>()?)
}

/// What the coordinates of `F` lines mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameSpace {
    /// The eye's are multiplied by this.
    pub scale: f64,
    /// Then they are taken to the world, and directions with them. No scale in it.
    pub to_world: DMat4,
    /// Depths of the near and the far plane.
    pub depths: [f64; 2],
}

impl FrameSpace {
    /// Coordinates of the world, once multiplied by `scale`, about something so large: near and far are 0.001 and 10 times that.
    pub fn about(extent: f64, scale: f64) -> FrameSpace {
        FrameSpace { scale, to_world: DMat4::IDENTITY, depths: [1e-3 * extent, 10.0 * extent] }
    }
}

/// Reads a path: a JSON array of cameras as in `CAM.json`; or lines `F id front(3) left(3) up(3) eye(3) zoom`, zoom being the tangent of half the angle across the
/// shorter side of the picture, others ignored. Of those the picture is 1920 x 1080, and `space` says what their coordinates mean; a camera of the array has its own.
///
/// Errors: name the camera or the line.
pub fn recorded(bytes: &[u8], space: &FrameSpace) -> Result<FlightPath, PathError> {
    let text = String::from_utf8_lossy(bytes);
    let text = text.trim_start_matches('\u{feff}');
    let path = if text.trim_start().starts_with('[') { cameras(text)? } else { frames(text, space)? };
    if path.is_empty() { Err(PathError::Empty) } else { Ok(path) }
}

fn cameras(text: &str) -> Result<FlightPath, PathError> {
    let all: Vec<serde_json::Value> = serde_json::from_str(text).map_err(|e| PathError::Syntax {
        line: e.line(),
        column: e.column(),
        what: e.to_string().split(" at line").next().unwrap_or_default().into(),
    })?;
    let read = |(at, c): (usize, &serde_json::Value)| {
        camera::from_json(c.to_string().as_bytes()).map_err(|source| PathError::Json { at, source })
    };
    all.iter().enumerate().map(read).collect()
}

fn frames(text: &str, space: &FrameSpace) -> Result<FlightPath, PathError> {
    let mut path = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        if words.next() != Some("F") {
            continue;
        }
        let wrong = |what: String| PathError::Line { line: k + 1, what };
        // The number of the frame tells nothing.
        words.next();
        let numbers = words
            .map(|w| w.parse::<f64>().ok().filter(|x| x.is_finite()).ok_or(w))
            .collect::<Result<Vec<f64>, _>>()
            .map_err(|w| wrong(format!("{w}: must be a number")))?;
        let [fx, fy, fz, _, _, _, ux, uy, uz, ex, ey, ez, zoom] = numbers[..] else {
            return Err(wrong(format!("{} numbers after the frame's, 13 are needed", numbers.len())));
        };
        if [fx, fy, fz] == [0.0; 3] {
            return Err(wrong("front is 0, 0, 0: it must say which way the camera looks".into()));
        }
        if zoom <= 0.0 {
            return Err(wrong(format!(
                "zoom is {zoom}: the tangent of half an angle of view is more than 0"
            )));
        }
        let eye = space.to_world.transform_point3(space.scale * DVec3::new(ex, ey, ez));
        let [front, up] = [[fx, fy, fz], [ux, uy, uz]].map(|d| space.to_world.transform_vector3(d.into()));
        let [near, far] = space.depths;
        let wide = SIDES[0] as f64 / SIDES[1] as f64;
        let camera = Camera::new(&CameraParameters {
            eye,
            target: eye + far * front,
            up,
            projection: Projection::Perspective {
                fov_y_deg: 2.0 * (zoom / wide.min(1.0)).atan().to_degrees(),
            },
            width: SIDES[0],
            height: SIDES[1],
            near,
            far,
        });
        path.push(camera.map_err(|e| wrong(e.to_string()))?);
    }
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: (DVec3, DVec3) = (DVec3::new(-1.0, 0.0, -2.0), DVec3::new(3.0, 2.0, 2.0));

    #[test]
    fn a_circle_looks_at_the_middle_from_one_diagonal() {
        let path = circle(BOX, 8).unwrap();
        let (centre, diagonal) = (DVec3::new(1.0, 1.0, 0.0), 6.0);
        assert_eq!(path.len(), 8);
        for c in &path {
            assert!((c.eye().distance(centre) - diagonal).abs() < 1e-9);
            assert!((c.look() - (centre - c.eye()).normalize()).length() < 1e-9);
        }
        assert!(circle((DVec3::ONE, DVec3::ONE), 8).is_err());
    }

    #[test]
    fn a_lemniscate_crosses_itself_over_the_middle_and_looks_ahead() {
        let path = lemniscate(BOX, 400).unwrap();
        let centre = DVec3::new(1.0, 3.5, 0.0);
        assert!(path[100].eye().distance(centre) < 1e-9 && path[300].eye().distance(centre) < 1e-9);
        for (a, b) in path.iter().zip(&path[1..]) {
            let flat = |v: DVec3| DVec3::new(v.x, 0.0, v.z).normalize();
            assert!(flat(a.look()).dot(flat(b.eye() - a.eye())) > 0.99);
            // On the curve: (x^2 + z^2)^2 = a^2 (x^2 - z^2).
            let (x, z) = (a.eye().x - 1.0, a.eye().z);
            assert!(((x * x + z * z).powi(2) - 36.0 * (x * x - z * z)).abs() < 1e-6);
        }
    }

    #[test]
    fn recorded_paths_are_read_and_faults_are_named() {
        let line = "F 7  0.6 -0.8 0  0.8 0.6 0  0 0 1  -0.02 0.3 0.04  0.5\nf 0 0 0\n";
        let path = recorded(line.as_bytes(), &FrameSpace::about(2.0, 10.0)).unwrap();
        assert_eq!(path.len(), 1);
        let c = &path[0];
        assert!((c.eye() - DVec3::new(-0.2, 3.0, 0.4)).length() < 1e-12);
        assert!((c.look() - DVec3::new(0.6, -0.8, 0.0)).length() < 1e-12);
        // Half the height at depth 1 is the zoom: the height is the shorter side.
        assert!((540.0 / c.pixel_scale() - 0.5).abs() < 1e-12);
        let said =
            |text: &str| recorded(text.as_bytes(), &FrameSpace::about(1.0, 1.0)).unwrap_err().to_string();
        assert!(said("F 0 1 2 3\n").contains("line 1: 3 numbers"));
        assert!(said("x\nF 0 a\n").contains("line 2: a"));
        assert!(said(&line.replace("0.6 -0.8 0 ", "0 0 0")).contains("line 1: front is 0, 0, 0"));
        assert!(said(&line.replace("0.04  0.5", "0.04  0")).contains("line 1: zoom is 0"));
        assert!(said("nothing\n").contains("no frames"));
        assert!(said("[1, ").contains("line 1"));
        assert!(said("[{}]").contains("camera 0"));
        assert!(said(&line.replace("0 0 1", "0.6 -0.8 0")).contains("up"));
        let camera = r#"[{"eye": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 45,
            "width": 640, "height": 480, "near": 0.1, "far": 100}]"#;
        assert_eq!(recorded(camera.as_bytes(), &FrameSpace::about(1.0, 1.0)).unwrap()[0].width(), 640);
    }
}
