//! The inner parts of the library on small meshes: for criterion, and for counting instructions.

use progmesh::aif::{BuildOptions, Mesh, MeshInput, Positions};
use progmesh::io::{EncodeOptions, Format, NoSide, decode, encode};
use progmesh::meshes::{GenerateOptions, generate};
use progmesh::refine::ProgressiveMesh;
use progmesh::refine::progressive;
use progmesh::samples;
use progmesh::simplify::measure::{DistanceOptions, Surface, distance};
use progmesh::simplify::{Options, Quiet, Schedule, simplify};

/// Something to run again and again on the same data.
pub(crate) struct Kernel {
    pub(crate) name: &'static str,
    /// How many elements a run handles, for rates.
    pub(crate) elements: usize,
    /// Makes what a run uses up; not to be timed.
    make: Box<dyn Fn() -> Work>,
}

/// One run, ready to go. It returns a count that depends on the result.
pub(crate) type Work = Box<dyn FnOnce() -> usize>;

impl Kernel {
    fn new(name: &'static str, elements: usize, make: impl Fn() -> Work + 'static) -> Kernel {
        Kernel { name, elements, make: Box::new(make) }
    }

    pub(crate) fn prepare(&self) -> Work {
        (self.make)()
    }
}

/// All kernels on a generated scan of about `faces` triangles.
pub(crate) fn all(faces: usize) -> Vec<Kernel> {
    // A sample of the catalogue, and no broken one: this cannot fail.
    let Ok(sample) = generate("scan", &GenerateOptions::default().with_faces(faces)) else { return vec![] };
    let scene = samples::scene(sample.clone(), "scan");
    let input = MeshInput {
        positions: Positions::from_f64(sample.positions),
        corners: sample.corners,
        ..Default::default()
    };
    let faces = input.face_count();
    let Ok((mesh, _)) = Mesh::build(input.clone(), &BuildOptions::default()) else { return vec![] };

    let mut kernels = vec![Kernel::new("build", faces, move || {
        let input = input.clone();
        Box::new(move || Mesh::build(input, &BuildOptions::default()).map_or(0, |m| m.0.face_count()))
    })];
    for (name, schedule) in [("collapse", Schedule::Bulk), ("collapse-exact", Schedule::Exact)] {
        let mesh = mesh.clone();
        kernels.push(Kernel::new(name, faces, move || {
            let mut mesh = mesh.clone();
            Box::new(move || simplify(&mut mesh, &tenth(schedule), &Quiet).map_or(0, |o| o.triangles_out))
        }));
    }
    if let Ok(built) = progressive::build(mesh.clone(), &tenth(Schedule::Bulk), &Quiet) {
        let (splits, pm) = (built.mesh.splits.len(), std::rc::Rc::new(built.mesh));
        kernels.push(Kernel::new("split", 2 * splits, move || {
            let pm = pm.clone();
            Box::new(move || there_and_back(&pm))
        }));
    }
    let mut small = mesh.clone();
    if simplify(&mut small, &tenth(Schedule::Bulk), &Quiet).is_ok()
        && let (Ok(a), Ok(b)) = (Surface::from_mesh(&mesh), Surface::from_mesh(&small))
    {
        let pair = std::rc::Rc::new((a, b));
        let mut options = DistanceOptions::default();
        options.samples = 10_000;
        kernels.push(Kernel::new("distance", 2 * options.samples, move || {
            let (pair, options) = (pair.clone(), options.clone());
            Box::new(move || {
                distance(&pair.0, &pair.1, &options, &Quiet)
                    .map_or(0, |d| d.a_to_b.samples + d.b_to_a.samples)
            })
        }));
    }
    for (name, format) in [("parse-obj", Format::Obj), ("parse-ply", Format::Ply)] {
        if let Ok(file) = encode(format, &scene, &EncodeOptions::default()) {
            let bytes = std::rc::Rc::new(file.bytes);
            kernels.push(Kernel::new(name, faces, move || {
                let bytes = bytes.clone();
                Box::new(move || decode(format, &bytes, &NoSide).map_or(0, |d| d.scene.meshes.len()))
            }));
        }
    }
    kernels
}

fn tenth(schedule: Schedule) -> Options {
    let mut options = Options::default();
    (options.ratio, options.schedule) = (Some(0.1), Some(schedule));
    options
}

/// From the base to full detail and back.
fn there_and_back(pm: &ProgressiveMesh) -> usize {
    let Ok(mut cursor) = pm.cursor() else { return 0 };
    while cursor.refine() == Ok(true) {}
    let most = cursor.face_count();
    while cursor.coarsen() {}
    most
}
