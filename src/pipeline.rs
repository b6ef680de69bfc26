//! Simplifying a whole scene: build every mesh, simplify them all to one target, write the arrays back.
//!
//! This is what `progmesh simplify` does between reading and writing; on a mesh of your own, use [`crate::simplify`] directly.

use crate::aif::{Bits, BuildError, BuildOptions, BuildReport, CheckError, Mesh, MeshInput, Weld};
use crate::compare::{CompareError, Flattened};
use crate::normals::{self, Normals};
use crate::scene::{Scene, SceneMesh};
use crate::simplify::measure::{DistanceOptions, MeasureError, distance};
use crate::simplify::{self, Control, Level, Options, Outcome, Refused, SimplifyError, Stop};
use std::collections::BTreeMap;
use std::time::Instant;

mod certified;
mod least;
mod locks;
mod progressive;
mod scale;

pub use progressive::{Refinable, build_progressive};
pub use scale::{world_bounds, world_scales};

/// What to do with a scene. Start from `Job::default()` and set what differs.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Job {
    /// Method, targets, locks. The numbers of locked materials are those of [`Scene::materials`]; locked groups and everything
    /// by vertex make sense for a scene of one mesh only, and are better given by the fields below.
    ///
    /// Errors are measured in world units (see [`world_scales`]); a relative one is relative to the diagonal of the scene.
    pub options: Options,
    /// Which vertices are one. The decoders of glTF and STL have welded what is equal to the bit already.
    pub weld: Weld,
    /// What becomes of the normals, afterwards.
    pub normals: Normals,
    /// Every mesh gets the target by itself: the ratio is each one's own, not the scene's.
    pub per_mesh: bool,
    /// Materials whose faces stay: by name, or by number.
    pub lock_materials: Vec<String>,
    /// Groups whose faces stay: by the name of the group, or of the object.
    pub lock_groups: Vec<String>,
    /// The attribute that holds the vertices' weights (positive, 1 = normal).
    pub weights_property: Option<String>,
    /// The attribute that locks a vertex where it is not 0.
    pub lock_property: Option<String>,
    /// Measure the distance of the result from the input afterwards, both as they stand in the world ([`Summary::measured`]).
    pub measure: bool,
    /// Make `options.max_error` a guarantee: the two-sided distance between the scene and the result, both as they stand in the world, is
    /// proven to be at most that, and [`Summary::certified`] says so. The method is run with several numbers of triangles until
    /// one is found that passes, and another not more than 5 % below that does not: several times the time of one run. Where a few
    /// places alone keep a result from passing, the vertices there stay as they are, so that far fewer triangles may pass than without; the search
    /// for those ends after some seconds. `per_mesh` is not looked at.
    pub certified: bool,
}

/// What came of it, over all meshes.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Summary {
    /// Faces before, polygons count one.
    pub faces_in: usize,
    /// Faces after.
    pub faces_out: usize,
    /// Triangles before: a polygon of n corners counts n - 2.
    pub triangles_in: usize,
    /// Triangles after.
    pub triangles_out: usize,
    /// The number of triangles asked for, if one was.
    pub target: Option<usize>,
    /// The fewest triangles that surfaces of the result's topology can have, 4 a closed component and more where it has handles;
    /// 0 unless the target was missed. A lower bound: there need not be such a mesh.
    pub least_triangles: usize,
    /// Vertices after.
    pub vertices_out: usize,
    /// Why it ended.
    pub stop: Stop,
    /// The largest estimated error of all meshes, in world units. Not a bound.
    pub estimate: f64,
    /// The passes; those of equal number in several meshes are one.
    pub levels: Vec<Level>,
    /// Bytes of the AIF relations of all meshes, at the start.
    pub aif_bytes: usize,
    /// Diagonal of the scene's bounding box, world units.
    pub diagonal: f64,
    /// Seconds from arrays to meshes.
    pub build_seconds: f64,
    /// Seconds from meshes to simplified arrays, normals included.
    pub simplify_seconds: f64,
    /// The distance between input and result, if asked for; both directions, the worse in each number. `None` also where one has no triangle.
    pub measured: Option<Measured>,
    /// The bound that was proven, if asked for.
    pub certified: Option<Proven>,
    /// Seconds that measuring and proving took.
    pub measure_seconds: f64,
    /// What was changed that was not asked for, each said once.
    pub warnings: Vec<String>,
}

/// A measured distance, world units: 300,000 samples and all vertices on each side, see [`crate::simplify::measure::distance`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The largest found.
    pub max: f64,
    /// Root of the mean square over the area.
    pub rms: f64,
    /// Mean over the area.
    pub mean: f64,
}

/// A proven bound, world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proven {
    /// What was asked for.
    pub bound: f64,
    /// The two-sided distance is at most this, which is at most the bound.
    pub upper: f64,
    /// How often the method was run.
    pub runs: usize,
}

impl Summary {
    /// True if triangles were asked for, and more are left because nothing else may be collapsed (or the caller cancelled).
    pub fn missed_target(&self) -> bool {
        self.target.is_some_and(|t| self.triangles_out > t)
            && matches!(self.stop, Stop::NoLegalCollapse | Stop::Cancelled)
    }
}

/// Why nothing was simplified.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// A mesh is no mesh. The input is wrong.
    #[error("{mesh}{source}")]
    Build {
        /// Which mesh, with a colon; empty when there is one only.
        mesh: String,
        /// What is wrong with it.
        source: BuildError,
    },
    /// An option is out of range.
    #[error(transparent)]
    Options(#[from] SimplifyError),
    /// What should be locked, or give weights, is not there.
    #[error("no {kind} `{name}`; {there}")]
    NotFound {
        /// `material`, `group` or `vertex property`.
        kind: &'static str,
        /// The name asked for.
        name: String,
        /// What there is instead.
        there: String,
    },
    /// Weights or locks by vertex, for several meshes at once. Use `per_mesh`.
    #[error(
        "weights and locks by vertex need a file of one mesh; this one has {meshes} (or treat each by itself)"
    )]
    SeveralMeshes {
        /// Their number.
        meshes: usize,
    },
    /// A weight is not positive.
    #[error("vertex {vertex}: weight {value}; weights must be positive")]
    Weight {
        /// The vertex, from 0, after welding.
        vertex: usize,
        /// Its weight.
        value: f32,
    },
    /// The scene cannot be measured.
    #[error(transparent)]
    Measure(#[from] crate::compare::CompareError),
    /// A guarantee needs an error to guarantee.
    #[error("a certified result needs max_error")]
    NoBound,
    /// Computed normals would be one attribute too many.
    #[error("{0}")]
    Channels(#[from] crate::aif::TooManyChannels),
    /// What was asked for is no sequence of edge collapses.
    #[error(transparent)]
    Progressive(#[from] crate::refine::progressive::EncodeError),
    /// The result breaks an invariant of the mesh: a fault of this program, not of the input.
    #[error("{mesh}the result is no valid mesh: {source}; please report this")]
    Broken {
        /// Which mesh, with a colon; empty when there is one only.
        mesh: String,
        /// What is broken.
        source: CheckError,
    },
}

/// Simplifies all meshes of `scene`. Nodes, materials and images stay as they are; instances stay instances.
///
/// The target counts the triangles of the unique meshes and is shared by world-space error, unless `per_mesh` is set. A cancelled job returns
/// what there is, with [`Stop::Cancelled`]. Never panics on any scene a decoder of this crate returns.
pub fn simplify_scene(scene: Scene, job: &Job, control: &dyn Control) -> Result<(Scene, Summary), JobError> {
    if !job.measure && !job.certified {
        return run(scene, job, control);
    }
    let has_triangles = |s: &Scene| s.unique_triangles() > 0;
    if !has_triangles(&scene) {
        let (scene, mut summary) = run(scene, job, control)?;
        summary.warnings.push("nothing was measured: there is no triangle".into());
        return Ok((scene, summary));
    }
    let start = Instant::now();
    let input = Flattened::of(&scene)?;
    let before = start.elapsed().as_secs_f64();
    let (scene, mut summary) = match job.certified {
        true => certified::simplify(scene, &input, job, control)?,
        false => run(scene, job, &Part::new(control, 0.0, 0.8))?,
    };
    let start = Instant::now();
    if job.measure && summary.stop != Stop::Cancelled {
        match has_triangles(&scene) {
            true => match measured(&input, &scene, job, &Part::new(control, 0.8, 0.2)) {
                Err(CompareError::Measure(MeasureError::Cancelled)) => summary.stop = Stop::Cancelled,
                found => summary.measured = Some(found?),
            },
            false => summary.warnings.push("the result was not measured: it has no triangle".into()),
        }
    }
    summary.measure_seconds += before + start.elapsed().as_secs_f64();
    Ok((scene, summary))
}

fn measured(
    input: &Flattened,
    result: &Scene,
    job: &Job,
    control: &dyn Control,
) -> Result<Measured, CompareError> {
    let result = Flattened::of(result)?;
    let mut options = DistanceOptions::default();
    options.threads = job.options.threads;
    let found = distance(&input.surface, &result.surface, &options, control)?;
    Ok(Measured { max: found.worse.max, rms: found.worse.rms, mean: found.worse.mean })
}

/// One run of the method, unmeasured.
fn run(scene: Scene, job: &Job, control: &dyn Control) -> Result<(Scene, Summary), JobError> {
    run_keeping(scene, job, &[], control)
}

/// The same, with vertices that stay where they are: of each mesh, as the scene numbers them. Not for `per_mesh`.
fn run_keeping(
    mut scene: Scene,
    job: &Job,
    kept: &[Bits],
    control: &dyn Control,
) -> Result<(Scene, Summary), JobError> {
    let mut options = job.options.clone();
    let mut warnings = Vec::new();
    let start = Instant::now();

    options.locked_materials.extend(locks::materials(&scene, &job.lock_materials)?);
    locks::make_groups_distinct(&mut scene);
    options.locked_groups.extend(locks::groups(&scene, &job.lock_groups)?);
    let diagonal = scale::world_diagonal(&scene);
    let scales = world_scales(&scene);

    // Targets count what the file has, faces that building leaves out included.
    let triangles: Vec<usize> = scene.meshes.iter().map(SceneMesh::triangles).collect();
    let faces_in = scene.meshes.iter().map(|m| m.geometry.face_count()).sum();
    let triangles_in: usize = triangles.iter().sum();
    let target = target(&options, &triangles, job.per_mesh);
    if !job.per_mesh {
        (options.triangles, options.ratio) = (target, None);
    }

    let mut meshes = Vec::with_capacity(scene.meshes.len());
    let mut changes = Changes::default();
    for i in 0..scene.meshes.len() {
        let label = label(&scene, i);
        let input = std::mem::take(&mut scene.meshes[i].geometry);
        let (mesh, report) = Mesh::build(input, &BuildOptions::with_weld(job.weld))
            .map_err(|source| JobError::Build { mesh: label.clone(), source })?;
        changes.add(&label, &report, job.weld != Weld::No);
        if let Some(kept) = kept.get(i) {
            let mut locked = Bits::default();
            let of = |v: usize| match &report.vertex_map {
                Some(map) => map.get(v).map(|&v| v as usize),
                None => Some(v),
            };
            kept.iter().filter_map(of).for_each(|v| locked.set(v));
            options.locked_by_mesh.push(locked);
        }
        meshes.push(mesh);
    }
    warnings.extend(changes.warnings());
    if triangles_in == 0 {
        warnings.push("the input has no faces".into());
    }
    let build_seconds = start.elapsed().as_secs_f64();

    let start = Instant::now();
    let by_vertex = job.weights_property.is_some() || job.lock_property.is_some();
    if by_vertex && meshes.len() > 1 && !job.per_mesh {
        return Err(JobError::SeveralMeshes { meshes: meshes.len() });
    }
    let mut outcomes = Vec::with_capacity(meshes.len());
    if job.per_mesh {
        // By the size of the whole scene, as if its meshes were simplified together.
        if triangles_in > simplify::REFIT_LIMIT {
            options.refit.get_or_insert(0);
        }
        let mut done = 0;
        for (i, mesh) in meshes.iter_mut().enumerate() {
            let mut own = options.clone();
            (own.triangles, own.ratio) = (self::target(&options, &triangles[i..=i], true), None);
            locks::by_vertex(mesh, job, &mut own)?;
            let part = Part {
                control,
                start: done as f64 / triangles_in.max(1) as f64,
                share: triangles[i] as f64 / triangles_in.max(1) as f64,
            };
            done += triangles[i];
            let one = simplify::simplify_all(std::slice::from_mut(mesh), &scales[i..=i], &own, &part)?;
            outcomes.extend(one);
        }
    } else {
        if let [mesh] = meshes.as_mut_slice() {
            locks::by_vertex(mesh, job, &mut options)?;
        }
        if let Some(e) = options.max_error.as_mut().filter(|e| e.relative && meshes.len() > 1) {
            (e.value, e.relative) = (e.value * diagonal, false);
        }
        outcomes = simplify::simplify_all(&mut meshes, &scales, &options, control)?;
    }
    let triangles_out: usize = outcomes.iter().map(|o| o.triangles_out).sum();
    let missed = target.is_some_and(|t| triangles_out > t);
    let least_triangles = if missed { meshes.iter().map(least::triangles).sum() } else { 0 };
    let mut loose = 0;
    for (i, mesh) in meshes.into_iter().enumerate() {
        if cfg!(debug_assertions) {
            mesh.check().map_err(|source| JobError::Broken { mesh: label(&scene, i), source })?;
        }
        let mut geometry = mesh.to_input();
        normals::apply(&mut geometry, job.normals)?;
        scene.meshes[i].geometry = geometry;
        // Vertices have other numbers now.
        loose += std::mem::take(&mut scene.meshes[i].extras.loose).vertices.len();
    }
    warnings.extend(left_loose(loose));
    locks::restore_groups(&mut scene);
    let simplify_seconds = start.elapsed().as_secs_f64();

    let triangulated: usize = outcomes.iter().map(|o| o.triangulated).sum();
    if triangulated > 0 {
        let what = count(triangulated, "polygon");
        warnings.push(format!("{what} cut into triangles, which this method needs"));
    }
    let isolated: usize = outcomes.iter().map(|o| o.isolated_removed).sum();
    if isolated > 0 {
        warnings.push(format!("{} without a face left out", count(isolated, "vertex")));
    }
    let summary = Summary {
        faces_in,
        faces_out: outcomes.iter().map(|o| o.faces_out).sum(),
        triangles_in,
        triangles_out,
        target,
        least_triangles,
        vertices_out: outcomes.iter().map(|o| o.vertices_out).sum(),
        stop: common_stop(&outcomes, target.is_some_and(|t| triangles_out <= t)),
        estimate: outcomes.iter().zip(&scales).map(|(o, s)| o.estimate * s).fold(0.0, f64::max),
        levels: common_levels(&outcomes),
        aif_bytes: outcomes.iter().map(|o| o.aif_bytes).sum(),
        diagonal,
        build_seconds,
        simplify_seconds,
        measured: None,
        certified: None,
        measure_seconds: 0.0,
        warnings,
    };
    Ok((scene, summary))
}

/// How messages name mesh `i`: empty when there is but one, else its number and name, with a colon.
pub fn label(scene: &Scene, i: usize) -> String {
    match scene.meshes.get(i).map(|m| &m.name) {
        _ if scene.meshes.len() <= 1 => String::new(),
        Some(Some(name)) => format!("mesh {i} ({name}): "),
        _ => format!("mesh {i}: "),
    }
}

/// What building changed, over all meshes: each kind is said once, with its first element.
#[derive(Default)]
struct Changes {
    /// Number of elements, number of meshes, the first element; by kind.
    kinds: BTreeMap<&'static str, (usize, usize, String)>,
}

impl Changes {
    const KINDS: [(&'static str, &'static str); 5] = [
        ("face", "with fewer than three distinct corners left out"),
        ("face", "with a corner repeated, now once"),
        ("face", "that visit a vertex twice, split there"),
        ("line segment", "of no length left out"),
        ("vertex", "welded to another"),
    ];

    /// Adds those of one mesh, which messages call `label`.
    fn add(&mut self, label: &str, report: &BuildReport, welding: bool) {
        let lists = [&report.dropped_faces, &report.shortened_faces, &report.split_faces];
        for ((_, text), faces) in Self::KINDS.iter().zip(lists) {
            let first = faces.first().map_or(String::new(), |f| format!("{label}face {f}"));
            self.count(text, faces.len(), first);
        }
        self.count(Self::KINDS[3].1, report.dropped_wires, String::new());
        if welding {
            self.count(Self::KINDS[4].1, report.welded_vertices, String::new());
        }
    }

    fn count(&mut self, text: &'static str, n: usize, first: String) {
        if n > 0 {
            let kind = self.kinds.entry(text).or_insert((0, 0, first));
            kind.0 += n;
            kind.1 += 1;
        }
    }

    fn warnings(&self) -> Vec<String> {
        let say = |&(what, text): &(&str, &str)| {
            let (n, meshes, first) = self.kinds.get(text)?;
            let meshes = if *meshes > 1 { format!(", in {meshes} meshes") } else { String::new() };
            let first = if first.is_empty() { String::new() } else { format!(" (the first: {first})") };
            Some(format!("{} {text}{meshes}{first}", count(*n, what)))
        };
        Self::KINDS.iter().filter_map(say).collect()
    }
}

/// `1 face`, `2,000 faces`.
pub fn count(n: usize, what: &str) -> String {
    let number = thousands(n);
    match (n, what) {
        (1, _) => format!("1 {what}"),
        (_, "vertex") => format!("{number} vertices"),
        (_, "mesh") => format!("{number} meshes"),
        _ => format!("{number} {what}s"),
    }
}

/// 1234567 as `1,234,567`.
pub fn thousands(n: usize) -> String {
    let digits = n.to_string();
    let mut out = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, d) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(d);
    }
    out
}

/// The triangles asked for: of the scene, or of each mesh and added up.
fn target(options: &Options, triangles: &[usize], per_mesh: bool) -> Option<usize> {
    let of = |total: usize| {
        let by_ratio = options.ratio.map(|r| (r * total as f64).round() as usize);
        // The first of two targets that is reached ends the work: the larger.
        options.triangles.into_iter().chain(by_ratio).max()
    };
    match per_mesh {
        false => of(triangles.iter().sum()),
        true => triangles.iter().map(|&t| of(t)).sum(),
    }
}

/// One reason for all meshes: the one that kept the whole from going on.
fn common_stop(outcomes: &[Outcome], target_met: bool) -> Stop {
    let any = |s: Stop| outcomes.iter().any(|o| o.stop == s);
    if any(Stop::Cancelled) {
        Stop::Cancelled
    } else if target_met || outcomes.iter().all(|o| o.stop == Stop::Target) {
        Stop::Target
    } else if any(Stop::Error) {
        Stop::Error
    } else if any(Stop::Passes) {
        Stop::Passes
    } else {
        Stop::NoLegalCollapse
    }
}

/// Level k of all meshes as one. A mesh that had fewer passes counts with the faces of its last.
fn common_levels(outcomes: &[Outcome]) -> Vec<Level> {
    let n = outcomes.iter().map(|o| o.levels.len()).max().unwrap_or(0);
    let level = |k: usize| {
        let mut sum = Level::default();
        sum.pass = k + 1;
        for o in outcomes {
            let Some(l) = o.levels.get(k) else {
                sum.faces += o.levels.last().map_or(o.faces_out, |l| l.faces);
                continue;
            };
            sum.pass = l.pass;
            sum.faces += l.faces;
            sum.seconds += l.seconds;
            sum.tried += l.tried;
            let (a, b) = (sum.refused, l.refused);
            sum.refused = Refused {
                link: a.link + b.link,
                normal: a.normal + b.normal,
                border: a.border + b.border,
                flip: a.flip + b.flip,
                valence: a.valence + b.valence,
                locked: a.locked + b.locked,
            };
        }
        sum
    };
    (0..n).map(level).collect()
}

/// A part of the work, whose progress is so much of the whole.
pub(crate) struct Part<'a> {
    control: &'a dyn Control,
    start: f64,
    share: f64,
}

impl<'a> Part<'a> {
    pub(crate) fn new(control: &'a dyn Control, start: f64, share: f64) -> Self {
        Part { control, start, share }
    }
}

impl Control for Part<'_> {
    fn progress(&self, done: f64) {
        self.control.progress(self.start + done * self.share);
    }

    fn cancelled(&self) -> bool {
        self.control.cancelled()
    }
}

/// What [`prepare`] does to meshes without simplifying them.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct Preparation {
    /// Which vertices become one.
    pub weld: Weld,
    /// Cut polygons into triangles.
    pub triangulate: bool,
    /// What becomes of the normals.
    pub normals: Normals,
}

/// Checks all meshes and does what is asked for, nothing else: unless vertices are welded or polygons cut, even degenerate
/// faces stay. Returns warnings.
pub fn prepare(scene: &mut Scene, how: &Preparation) -> Result<Vec<String>, JobError> {
    let mut changes = Changes::default();
    let mut loose = 0;
    for i in 0..scene.meshes.len() {
        let label = label(scene, i);
        let SceneMesh { geometry, extras, .. } = &mut scene.meshes[i];
        let failed = |source| JobError::Build { mesh: label.clone(), source };
        if how.weld == Weld::No && !how.triangulate {
            geometry.validate().map_err(failed)?;
        } else {
            let input: MeshInput = std::mem::take(geometry);
            let (mut mesh, report) =
                Mesh::build(input, &BuildOptions::with_weld(how.weld)).map_err(failed)?;
            changes.add(&label, &report, how.weld != Weld::No);
            if how.triangulate {
                mesh = mesh.triangulate().map_err(failed)?.mesh;
            }
            *geometry = mesh.to_input();
            loose += std::mem::take(&mut extras.loose).vertices.len();
        }
        normals::apply(geometry, how.normals)?;
    }
    Ok(changes.warnings().into_iter().chain(left_loose(loose)).collect())
}

/// What is said of vertices that lost their attributes.
pub(crate) fn left_loose(vertices: usize) -> Option<String> {
    let of = count(vertices, "vertex");
    (vertices > 0).then(|| format!("the attributes of {of} without a face are left out"))
}
