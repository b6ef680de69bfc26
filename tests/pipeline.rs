//! Simplifying scenes of several meshes: shared and separate targets, locks by name and by vertex, cancelling.

use progmesh::aif::attributes::{Channel, Semantic, Wedges};
use progmesh::aif::{BuildOptions, Mesh};
use progmesh::meshes::{GenerateOptions, generate};
use progmesh::pipeline::{Job, JobError, simplify_scene, world_scales};
use progmesh::samples;
use progmesh::scene::{Group, Node, Scene};
use progmesh::simplify::{Control, Quiet, Stop};

fn sphere(faces: usize) -> Scene {
    samples::scene(generate("sphere", &GenerateOptions::default().with_faces(faces)).unwrap(), "sphere")
}

/// A mesh of 320 faces shown at scale 1, and the same again shown at `scale` and at half of that.
fn two_spheres(scale: f64) -> Scene {
    let mut scene = sphere(320);
    scene.meshes.push(scene.meshes[0].clone());
    for s in [scale, scale / 2.0] {
        let transform = glam::DMat4::from_scale(glam::DVec3::splat(s));
        scene.roots.push(scene.nodes.len());
        scene.nodes.push(Node { name: None, transform, mesh: Some(1), children: vec![] });
    }
    scene
}

fn ratio(r: f64) -> Job {
    let mut job = Job::default();
    job.options.ratio = Some(r);
    job
}

fn faces(scene: &Scene) -> Vec<usize> {
    scene.meshes.iter().map(|m| m.triangles()).collect()
}

/// A job done, with every mesh of the result checked.
fn done(scene: Scene, job: &Job) -> (Scene, progmesh::pipeline::Summary) {
    let (scene, summary) = simplify_scene(scene, job, &Quiet).unwrap();
    for m in &scene.meshes {
        let (mesh, report) = Mesh::build(m.geometry.clone(), &BuildOptions::default()).unwrap();
        mesh.check().unwrap();
        assert!(report.dropped_faces.is_empty());
    }
    (scene, summary)
}

#[test]
fn a_shared_target_gives_the_faces_to_the_larger_instance() {
    assert_eq!(world_scales(&two_spheres(10.0)), [1.0, 10.0]);
    let (scene, summary) = done(two_spheres(10.0), &ratio(0.5));
    let f = faces(&scene);
    assert!(f.iter().sum::<usize>().abs_diff(320) <= 2, "{f:?}");
    assert!(f[1] > 2 * f[0], "{f:?}");
    assert_eq!((summary.stop, summary.target), (Stop::Target, Some(320)));
    assert_eq!((scene.nodes.len(), scene.nodes[2].mesh), (3, Some(1)));
}

#[test]
fn per_mesh_gives_each_the_ratio() {
    let mut job = ratio(0.25);
    job.per_mesh = true;
    let (scene, summary) = done(two_spheres(10.0), &job);
    for f in faces(&scene) {
        assert!(f.abs_diff(80) <= 2, "{f}");
    }
    assert_eq!(summary.target, Some(160));
    // Passes of equal number are one level of both meshes.
    assert_eq!(summary.levels.last().map(|l| l.faces), Some(summary.faces_out));
}

#[test]
fn progress_of_several_meshes_never_falls() {
    struct Watch(std::sync::Mutex<Vec<f64>>);
    impl Control for Watch {
        fn progress(&self, done: f64) {
            self.0.lock().unwrap().push(done);
        }
    }
    let mut job = ratio(0.25);
    job.per_mesh = true;
    let watch = Watch(Default::default());
    simplify_scene(two_spheres(1.0), &job, &watch).unwrap();
    let seen = watch.0.into_inner().unwrap();
    assert!(seen.is_sorted() && seen.iter().all(|x| (0.0..=1.0).contains(x)), "{seen:?}");
}

#[test]
fn a_group_is_locked_in_its_own_mesh_only_and_groups_keep_their_numbers() {
    let mut scene = two_spheres(1.0);
    for (m, name) in scene.meshes.iter_mut().zip(["first", "second"]) {
        m.groups = vec![Group { names: vec![name.into()], ..Default::default() }];
        m.geometry.face_group = vec![0; m.geometry.face_count()];
    }
    let mut job = ratio(0.7);
    job.lock_groups = vec!["second".into()];
    let (scene, _) = done(scene, &job);
    let f = faces(&scene);
    assert!(f[1] == 320 && f[0].abs_diff(128) <= 2, "{f:?}");
    for m in &scene.meshes {
        assert!(!m.geometry.face_group.is_empty() && m.geometry.face_group.iter().all(|&g| g == 0));
    }
}

/// Gives every vertex `value(z)` as attribute `name`.
fn with_property(mut scene: Scene, name: &str, value: impl Fn(f64) -> f32) -> Scene {
    let g = &mut scene.meshes[0].geometry;
    let mut w = Wedges::new(vec![Channel::new(Semantic::Custom(name.into()), 1)]).unwrap();
    for p in g.positions.iter() {
        w.push(&[value(p.z)], 1);
    }
    w.corner = g.corners.clone();
    g.wedges = Some(w);
    scene
}

fn above(scene: &Scene) -> usize {
    scene.meshes[0].geometry.positions.iter().filter(|p| p.z > 0.0).count()
}

#[test]
fn weights_draw_vertices_and_locks_keep_them() {
    let scene = with_property(sphere(1280), "w", |z| if z > 0.0 { 100.0 } else { 1.0 });
    let before = above(&scene);
    let mut job = ratio(0.3);
    job.weights_property = Some("w".into());
    let (weighted, _) = done(scene.clone(), &job);
    let all = weighted.meshes[0].geometry.positions.len();
    assert!(above(&weighted) * 3 > all * 2, "{} of {all}", above(&weighted));

    let mut job = ratio(0.6);
    job.lock_property = Some("l".into());
    let (locked, _) = done(with_property(sphere(1280), "l", |z| (z > 0.0) as u8 as f32), &job);
    assert_eq!(above(&locked), before);
}

#[test]
fn bad_weights_and_names_are_refused() {
    let run = |scene: Scene, weights: &str| {
        let mut job = ratio(0.5);
        job.weights_property = Some(weights.into());
        simplify_scene(scene, &job, &Quiet).unwrap_err()
    };
    for value in [0.0, -1.0, f32::INFINITY] {
        let e = run(with_property(sphere(80), "w", |_| value), "w");
        assert_eq!(e, JobError::Weight { vertex: 0, value });
    }
    let e = run(with_property(sphere(80), "w", |_| 1.0), "x").to_string();
    assert_eq!(e, "no vertex property `x`; there are w");
    assert_eq!(run(two_spheres(1.0), "w"), JobError::SeveralMeshes { meshes: 2 });
}

#[test]
fn a_cancelled_job_says_so_and_leaves_valid_meshes() {
    struct Now;
    impl Control for Now {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let (scene, summary) = simplify_scene(two_spheres(1.0), &ratio(0.1), &Now).unwrap();
    assert_eq!(summary.stop, Stop::Cancelled);
    assert!(summary.missed_target());
    for m in scene.meshes {
        Mesh::build(m.geometry, &BuildOptions::default()).unwrap().0.check().unwrap();
    }
}

#[test]
fn what_building_changes_is_said_once_for_all_meshes() {
    let mut scene = two_spheres(1.0);
    for m in &mut scene.meshes {
        m.name = Some("ball".into());
        m.geometry.corners[4] = m.geometry.corners[3];
    }
    let (_, summary) = done(scene, &ratio(0.5));
    let want = "2 faces with fewer than three distinct corners left out, in 2 meshes (the first: mesh 0 (ball): face 1)";
    assert_eq!(summary.warnings, [want]);
}
