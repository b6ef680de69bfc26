//! Measures what is shown, without the code that decides what to show.

use super::judge_directional::Spheres;
use super::{Deviation, SelectiveScene};
use crate::progressive::ProgressiveScene;
use crate::refine::progressive::ProgressiveMesh;
use crate::refine::view::Camera;
use crate::simplify::measure::{MeasureError, Surface};
use glam::{DMat4, DVec3};

/// Samples of the finest surface, spread evenly over its area.
#[derive(Clone, Debug)]
pub struct Judge {
    /// Places and normals, world space.
    samples: Vec<[DVec3; 2]>,
    deviation: Deviation,
}

/// What a [`Judge`] found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Judgement {
    /// Samples inside the frustum that face the camera.
    pub visible: usize,
    /// The largest lambda * deviation / depth among them, pixels; 0 if none is visible. The deviation is the distance from what is shown, or what of it counts ([`Judge::of`]).
    pub max_pixels: f64,
    /// The mean.
    pub mean_pixels: f64,
}

/// Sorts faces, however they came and whichever corner first: so that samples of a mesh are the same in memory, where the rule of rings has the faces in an order of its own, and of its file.
fn in_order(faces: &mut [[DVec3; 3]]) {
    let places = |a: &DVec3, b: &DVec3| {
        a.x.total_cmp(&b.x).then_with(|| a.y.total_cmp(&b.y)).then_with(|| a.z.total_cmp(&b.z))
    };
    for t in faces.iter_mut() {
        let least = (1..3).fold(0, |least, k| if places(&t[k], &t[least]).is_lt() { k } else { least });
        t.rotate_left(least);
    }
    faces.sort_unstable_by(|a, b| {
        places(&a[0], &b[0]).then_with(|| places(&a[1], &b[1])).then_with(|| places(&a[2], &b[2]))
    });
}

impl Judge {
    /// `count` samples of the finest surface, the same every time: places of a sequence of low discrepancy, by area. Deviations count as the scene lets them ([`SelectiveScene::set_deviation`]).
    ///
    /// Errors: a damaged mesh.
    pub fn new(scene: &SelectiveScene, count: usize) -> Result<Judge, super::SelectiveError> {
        let meshes = scene.views.iter().map(|v| v.hierarchy().mesh());
        Ok(Judge { deviation: scene.deviation, ..Judge::of_meshes(meshes.zip(&scene.places), count)? })
    }

    /// The same of a scene that is refined in parts ([`super::PagedScene`]): its meshes, all in memory, from which the samples are taken.
    ///
    /// Errors: a damaged mesh.
    pub fn of_progressive(scene: &ProgressiveScene, count: usize) -> Result<Judge, super::SelectiveError> {
        let places = super::places_of(&scene.shell, scene.meshes.len());
        Judge::of_meshes(scene.meshes.iter().zip(&places), count)
    }

    /// Of meshes, and where they stand.
    fn of_meshes<'a>(
        meshes: impl Iterator<Item = (&'a ProgressiveMesh, &'a Vec<DMat4>)>,
        count: usize,
    ) -> Result<Judge, super::SelectiveError> {
        let mut faces: Vec<[DVec3; 3]> = Vec::new();
        for (mesh, (pm, places)) in meshes.enumerate() {
            let damage = |source| super::SelectiveError::Damage { mesh, source };
            let mut full = pm.cursor().map_err(damage)?;
            full.seek(usize::MAX).map_err(damage)?;
            for m in places {
                let at = |w: &u32| m.transform_point3(full.positions().get(full.wedge_vertex(*w) as usize));
                faces.extend(full.indices().iter().map(|[a, b, c]| [at(a), at(b), at(c)]));
            }
        }
        in_order(&mut faces);
        let normal = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]);
        let mut sum = 0.0;
        let areas: Vec<f64> = faces
            .iter()
            .map(|t| {
                sum += normal(t).length();
                sum
            })
            .collect();
        // R3 (Roberts): steps of powers of the root of x^4 = x + 1.
        let step = |k: i32| 1.220_744_084_605_759_5_f64.powi(-k);
        let sample = |i: usize| {
            let at = |k: i32| (0.5 + step(k) * (i + 1) as f64).fract();
            let t =
                faces.get(areas.partition_point(|&a| a <= at(1) * sum).min(faces.len().saturating_sub(1)))?;
            let (u, v) = (at(2).sqrt(), at(3));
            Some([t[0] * (1.0 - u) + t[1] * (u * (1.0 - v)) + t[2] * (u * v), normal(t)])
        };
        Ok(Judge { samples: (0..count).filter_map(sample).collect(), deviation: Deviation::Uniform })
    }

    /// The same judge of deviations that count so. Of directional ones: of a sample p the least of `sqrt(across^2 + (along / 4)^2)` over all places q of what is shown, across and along being the parts of q - p
    /// across and along the line of sight to p.
    pub fn of(self, deviation: Deviation) -> Judge {
        Judge { deviation, ..self }
    }

    /// Measures what `scene` shows, seen by `camera`. O(faces shown + samples log faces).
    ///
    /// Errors: nothing is shown, or positions that no distances can be computed of.
    pub fn measure(&self, scene: &SelectiveScene, camera: &Camera) -> Result<Judgement, MeasureError> {
        self.measure_triangles(&scene.triangles(), camera)
    }

    /// The same of triangles in the world that are shown.
    ///
    /// Errors: as [`Judge::measure`].
    pub fn measure_triangles(
        &self,
        triangles: &[[DVec3; 3]],
        camera: &Camera,
    ) -> Result<Judgement, MeasureError> {
        let frustum = camera.frustum();
        let mut out = Judgement::default();
        let mut judge = |deviation: &mut dyn FnMut(DVec3, DVec3) -> f64| {
            for &[p, normal] in &self.samples {
                let line = if camera.is_perspective() { p - camera.eye() } else { camera.look() };
                if line.dot(normal) < 0.0 && frustum.contains(p) {
                    let pixels = camera.pixels(deviation(p, line), camera.depth(p));
                    out.visible += 1;
                    out.max_pixels = out.max_pixels.max(pixels);
                    out.mean_pixels += pixels;
                }
            }
        };
        match self.deviation {
            Deviation::Uniform | Deviation::Upright(_) => {
                let points: Vec<[f64; 3]> = triangles.as_flattened().iter().map(|p| p.to_array()).collect();
                let corners = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
                let surface = Surface::new(&points[..], &corners.collect::<Vec<[u32; 3]>>())?;
                let mut query = surface.query();
                judge(&mut |p, _| query.distance(p));
            }
            Deviation::Directional => {
                let spheres = Spheres::new(triangles)?;
                judge(&mut |p, line| spheres.least(p, line));
            }
        }
        out.mean_pixels /= out.visible.max(1) as f64;
        Ok(out)
    }
}
