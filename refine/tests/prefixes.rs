//! The beginnings of a file are good coarse meshes: measured against the input beside the method's own mesh with as many splits.

mod common;

use common::{options, sample};
use progmesh_refine::ProgressiveMesh;
use progmesh_refine::aif::*;
use progmesh_refine::format::{EncodeOptions, decode_prefix, encode};
use progmesh_refine::progressive::build;
use progmesh_refine::simplify::measure::{DistanceOptions, Surface, distance};
use progmesh_refine::simplify::{Method, Placement, Quiet};

/// The mesh after so many splits.
fn surface(pm: &ProgressiveMesh, splits: usize) -> Surface {
    let mut cursor = pm.cursor().unwrap();
    cursor.seek(splits).unwrap();
    Surface::from_mesh(&Mesh::build(cursor.to_input(), &BuildOptions::default()).unwrap().0).unwrap()
}

fn rms(whole: &Surface, other: &Surface) -> f64 {
    let mut options = DistanceOptions::default();
    (options.samples, options.threads) = (20_000, Some(1));
    distance(whole, other, &options, &Quiet).unwrap().worse.rms
}

/// How many times as far from the input the first parts of the bytes are as the method's own mesh is.
fn times(pm: &ProgressiveMesh, options: &EncodeOptions) -> Vec<(f64, f64)> {
    let whole = surface(pm, usize::MAX);
    let bytes = encode(std::slice::from_ref(pm), &[], &[], options).unwrap();
    let one = |part: f64| {
        let there = decode_prefix(&bytes[..(part * bytes.len() as f64) as usize]).unwrap();
        let there = &there.meshes[0];
        let own = rms(&whole, &surface(pm, there.splits.len()));
        (there.splits.len() as f64 / pm.splits.len() as f64, rms(&whole, &surface(there, usize::MAX)) / own)
    };
    [0.1, 0.25, 0.5].map(one).to_vec()
}

/// With chunks as small, for the mesh, as those of large meshes are by default, and so large that a few make the mesh. (Tori and fractal terrain with 200 splits a chunk
/// reach 1.8 where half of the bytes end in the middle of a band.)
#[test]
fn the_first_bytes_are_nearly_as_good_as_what_the_method_makes_of_as_many_splits() {
    let mesh = sample("scan", 12_000, 3);
    for method in [options(Method::Quadric, Some(Placement::Endpoint)), options(Method::Nsa, None)] {
        let pm = build(mesh.clone(), &method, &Quiet).unwrap().mesh;
        for (chunk, any_order) in [(200, false), (200, true), (2000, false), (2000, true)] {
            let file = EncodeOptions::default().with_chunk(Some(chunk)).with_any_order(any_order);
            for (splits, times) in times(&pm, &file) {
                let at = format!("{:?}, {chunk}, {any_order}, {splits:.3} of the splits", method.method);
                assert!(times <= 1.5, "{at}: {times}");
            }
        }
    }
}
