//! `clip` and `cull`.

use crate::common::Place;
use crate::present;
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Clip {
    command: String,
    from: String,
    to: String,
    planes: Vec<[f64; 4]>,
    instances: ClipInstances,
    vertices: [usize; 2],
    triangles: [usize; 2],
    cut_faces: usize,
    dropped_faces: usize,
    #[serde(deserialize_with = "present")]
    cap: Option<Cap>,
    seconds: ClipSeconds,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ClipInstances {
    inside: usize,
    cut: usize,
    outside: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Cap {
    loops: usize,
    triangles: usize,
    open_edges: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ClipSeconds {
    read: f64,
    clip: f64,
    draw: f64,
    write: f64,
    total: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Cull {
    command: String,
    from: String,
    to: String,
    instances: CullInstances,
    components: CullComponents,
    faces: CullFaces,
    triangles: [usize; 2],
    seconds: CullSeconds,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CullInstances {
    all: usize,
    outside: usize,
    dropped: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CullComponents {
    all: usize,
    outside: usize,
    solid: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CullFaces {
    all: usize,
    outside: usize,
    back: usize,
    back_by_cone: usize,
    kept: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CullSeconds {
    read: f64,
    cull: f64,
    draw: f64,
    write: f64,
    total: f64,
}

/// A camera before the unit sphere.
pub(crate) const CAMERA: &str = r#"{"eye": [0, 0, 4], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 60,
    "width": 400, "height": 300, "near": 0.5, "far": 20}"#;

#[test]
fn clip_and_cull_print_one_object_with_the_documented_fields() {
    let p = Place::new();
    p.generate("sphere", "in.ply", 320);
    p.write("cam.json", CAMERA);
    let c: Clip =
        serde_json::from_str(&p.done("clip in.ply out.obj --plane 0,1,0,0.1 --cap --json").stdout).unwrap();
    assert_eq!((c.command.as_str(), c.from.as_str(), c.to.as_str()), ("clip", "ply", "obj"));
    assert_eq!((c.planes, c.instances.cut, c.triangles[0]), (vec![[0.0, 1.0, 0.0, 0.1]], 1, 320));
    let cap = c.cap.unwrap();
    assert!((cap.loops, cap.open_edges) == (1, 0) && cap.triangles > 10 && c.cut_faces > 10);
    let c: Clip =
        serde_json::from_str(&p.done("clip in.ply out.obj --frustum cam.json --json").stdout).unwrap();
    assert!((c.planes.len(), c.instances.inside) == (6, 1) && c.cap.is_none());
    let c: Cull =
        serde_json::from_str(&p.done("cull in.ply out.obj --camera cam.json --json").stdout).unwrap();
    assert_eq!((c.command.as_str(), c.instances.all, c.components.solid, c.faces.all), ("cull", 1, 1, 320));
    assert_eq!(c.faces.kept + c.faces.back + c.faces.outside, 320);
    assert_eq!(c.triangles, [320, c.faces.kept]);
    assert!(c.seconds.read + c.seconds.cull + c.seconds.draw + c.seconds.write <= c.seconds.total + 1e-3);
}
