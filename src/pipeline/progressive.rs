//! A whole scene as progressive meshes.

use super::{Changes, Job, JobError, count, label, scale, world_scales};
use crate::aif::{BuildOptions, Mesh, MeshInput, Weld};
use crate::normals::{self, Normals};
use crate::progressive::{Leftover, ProgressiveScene, shell_of};
use crate::refine::format::suggested_grid;
use crate::refine::progressive::{EncodeError, build_all};
use crate::scene::{Extras, Scene};
use crate::simplify::{Control, Method, Placement, Stop};
use std::time::Instant;

/// What came of [`build_progressive`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Refinable {
    /// The progressive meshes, and the scene around them.
    pub scene: ProgressiveScene,
    /// Why the simplification to the bases ended.
    pub stop: Stop,
    /// The largest estimated error of a base, world units. Not a bound.
    pub estimate: f64,
    /// Seconds from arrays to meshes.
    pub build_seconds: f64,
    /// Seconds from meshes to splits.
    pub simplify_seconds: f64,
    /// What was changed that was not asked for, each said once.
    pub warnings: Vec<String>,
}

impl Job {
    /// With the places that collapses choose on a grid, the finest that one of the meshes suggests: far below any error that one sees. Files are a fifth smaller then, and in memory places between base and full detail take half as
    /// much. Only the quadric method chooses places, unless they are endpoints.
    pub fn on_grid(mut self, scene: &Scene) -> Job {
        let options = &mut self.options;
        if options.method == Method::Quadric && options.placement != Some(Placement::Endpoint) {
            let cells = scene.meshes.iter().filter_map(|m| suggested_grid(&m.geometry.positions));
            options.grid = options.grid.or(cells.min_by(f64::total_cmp));
        }
        self
    }
}

/// Makes progressive meshes of all meshes of `scene`, in one simplification with a shared order of splits.
///
/// Of the job it heeds the options, welding and normals. Without a target it goes as far as is legal. Everything comes back bit for bit at full
/// detail; faces without three distinct corners only there. Welding changes the input before; what it leaves out stays out.
///
/// Errors: as [`super::simplify_scene`]; methods that are no sequence of edge collapses.
pub fn build_progressive(scene: Scene, job: &Job, control: &dyn Control) -> Result<Refinable, JobError> {
    let mut options = job.options.clone();
    let diagonal = scale::world_diagonal(&scene);
    if let Some(e) = options.max_error.as_mut().filter(|e| e.relative) {
        (e.value, e.relative) = (e.value * diagonal, false);
    }
    let (scales, mut scene) = (world_scales(&scene), scene);
    let mut changes = Changes::default();
    let mut meshes = Vec::with_capacity(scene.meshes.len());
    let (mut leftovers, mut kept) = (Vec::new(), 0);
    let start = Instant::now();
    for i in 0..scene.meshes.len() {
        let label = label(&scene, i);
        let mut input = std::mem::take(&mut scene.meshes[i].geometry);
        let extras = std::mem::take(&mut scene.meshes[i].extras);
        scene.meshes[i].extras =
            if job.weld == Weld::No { extras.by_face(&input) } else { Extras::default() };
        let failed = |source| JobError::Build { mesh: label.clone(), source };
        if job.normals != Normals::Keep {
            input.validate().map_err(failed)?;
            normals::apply(&mut input, job.normals)?;
        }
        // A copy only where building will change something.
        let odd = job.weld == Weld::No && is_odd(&input);
        let original = odd.then(|| input.clone());
        let (mesh, report) = Mesh::build(input, &BuildOptions::with_weld(job.weld)).map_err(failed)?;
        let left = original.map(|o| Leftover::find(&o, &mesh.to_input(), &report)).unwrap_or_default();
        if left.is_empty() {
            changes.add(&label, &report, job.weld != Weld::No);
        }
        kept += left.faces.len();
        leftovers.push(left);
        meshes.push(mesh);
    }
    let mut warnings = changes.warnings();
    if kept > 0 {
        let faces = count(kept, "face");
        warnings.push(format!(
            "{faces} with fewer than three distinct corners, or one twice, are there at full detail only"
        ));
    }
    let build_seconds = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let built = build_all(meshes, &scales, &options, control).map_err(|e| match e {
        EncodeError::Simplify(e) => JobError::Options(e),
        e => JobError::Progressive(e),
    })?;
    let estimate = built.estimates.iter().zip(&scales).map(|(e, s)| e * s).fold(0.0, f64::max);
    Ok(Refinable {
        scene: ProgressiveScene {
            meshes: built.meshes,
            turns: built.turns,
            shell: shell_of(scene),
            leftovers,
        },
        stop: built.stop,
        estimate,
        build_seconds,
        simplify_seconds: start.elapsed().as_secs_f64(),
        warnings,
    })
}

/// A face visits a vertex twice, or has no three corners. O(n).
fn is_odd(input: &MeshInput) -> bool {
    let odd = |f: &[u32]| match f {
        [a, b, c] => a == b || b == c || c == a,
        _ => {
            let mut sorted = f.to_vec();
            sorted.sort_unstable();
            f.len() < 3 || sorted.windows(2).any(|w| w[0] == w[1])
        }
    };
    let Some(sizes) = &input.face_sizes else { return input.corners.chunks_exact(3).any(odd) };
    let mut rest = &input.corners[..];
    sizes.iter().any(|&n| {
        let (face, after) = rest.split_at((n as usize).min(rest.len()));
        rest = after;
        odd(face)
    })
}
