//! What a simplified mesh looks like from six sides, beside the original.

use progmesh::io::{EncodeOptions, Format, NoSide, decode, encode};
use progmesh::meshes::{GenerateOptions, generate};
use progmesh::pipeline::{Job, simplify_scene};
use progmesh::report::{Surface, View, silhouette};
use progmesh::scene::Scene;
use progmesh::simplify::Quiet;

/// The least agreement (intersection over union) of the silhouettes from six axis views at 512 x 512.
fn least_agreement(before: &Scene, after: &Scene) -> f64 {
    let (before, after) = (Surface::of(before).unwrap(), Surface::of(after).unwrap());
    let agreement = |v: &View| silhouette(&before, v).iou(&silhouette(&after, v)).unwrap();
    View::axes(before.bounds(), 512).iter().map(agreement).fold(1.0, f64::min)
}

/// Simplifies to a fifth and sends the result through a GLB.
fn fifth_as_glb(scene: &Scene) -> Scene {
    let mut job = Job::default();
    job.options.ratio = Some(0.2);
    let (small, _) = simplify_scene(scene.clone(), &job, &Quiet).unwrap();
    let glb = encode(Format::Glb, &small, &EncodeOptions::default()).unwrap();
    decode(Format::Glb, &glb.bytes, &NoSide).unwrap().scene
}

#[test]
fn a_fifth_of_a_generated_mesh_has_the_silhouette_of_the_whole() {
    for name in ["quad-sphere", "torus", "cad", "scan"] {
        let sample = generate(name, &GenerateOptions::default().with_faces(8000)).unwrap();
        let scene = progmesh::samples::scene(sample, name);
        let least = least_agreement(&scene, &fifth_as_glb(&scene));
        assert!(least >= 0.98, "{name}: {least}");
    }
}

/// The real meshes of the developers' data folder; skipped where that is absent.
#[test]
#[cfg(feature = "files")]
fn a_fifth_of_the_real_meshes_has_the_silhouette_of_the_whole() {
    let data = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/meshes");
    if !data.is_dir() {
        println!("skipped: no ../shared/data");
        return;
    }
    for name in ["2CylinderEngine.glb", "bunny10k_textured.obj", "pirate.glb"] {
        let scene = progmesh::io::files::read_scene(data.join(name)).unwrap().scene;
        let least = least_agreement(&scene, &fifth_as_glb(&scene));
        println!("{name}: {least:.4}");
        assert!(least >= 0.98, "{name}: {least}");
    }
}
