//! Scenes clipped and culled, against every face looked at alone.

use glam::{DMat4, DVec3, DVec4};
use progmesh::aif::MeshInput;
use progmesh::meshes::{GenerateOptions, SplitMix64, generate};
use progmesh::refine::view::{Camera, CameraParameters, Frustum, PlaneName, Projection};
use progmesh::scene::{Material, Node, Scene, SceneMesh};
use progmesh::views::{clip_scene, cull_scene};

fn vector(r: &mut SplitMix64) -> DVec3 {
    DVec3::new(r.signed(), r.signed(), r.signed())
}

/// Four instances of a closed mesh and of one with a border, two of them at one place.
fn scene(seed: u64) -> Scene {
    let mut r = SplitMix64::new(seed);
    let mesh = |name: &str| {
        let s = generate(name, &GenerateOptions::default().with_faces(150).with_seed(seed)).unwrap();
        let geometry = MeshInput {
            positions: progmesh::aif::Positions::from_f64(s.positions),
            face_sizes: s.face_sizes,
            corners: s.corners,
            ..Default::default()
        };
        SceneMesh { geometry, ..Default::default() }
    };
    let mut nodes = Vec::new();
    for k in 0..8 {
        let transform = if k == 5 {
            nodes.last().map_or(DMat4::IDENTITY, |n: &Node| n.transform)
        } else {
            // Mirrored now and then.
            let scale = DVec3::new(r.signed() + 1.5, 1.0, if k == 3 || k == 6 { -0.7 } else { 0.7 });
            DMat4::from_translation(3.0 * vector(&mut r))
                * DMat4::from_axis_angle(vector(&mut r).normalize_or(DVec3::X), r.unit() * 6.0)
                * DMat4::from_scale(scale)
        };
        nodes.push(Node { name: None, transform, mesh: Some((k >= 4) as usize), children: vec![] });
    }
    let roots = (0..nodes.len()).collect();
    let materials = vec![Material::default()];
    Scene { meshes: vec![mesh("terrain"), mesh("torus")], nodes, roots, materials, ..Default::default() }
}

fn camera(r: &mut SplitMix64) -> Camera {
    let projection = if r.unit() < 0.5 {
        Projection::Perspective { fov_y_deg: 20.0 + 60.0 * r.unit() }
    } else {
        Projection::Orthographic { ortho_height: 1.0 + 4.0 * r.unit() }
    };
    let (eye, target) = (6.0 * vector(r), 2.0 * vector(r));
    Camera::new(&CameraParameters {
        eye,
        target,
        up: DVec3::new(0.1, 1.0, 0.2),
        projection,
        width: 400,
        height: 300,
        near: 0.1 + 2.0 * r.unit(),
        far: 20.0,
    })
    .unwrap()
}

/// The faces of all instances, in the world, their front where the right-hand rule has it.
fn faces(scene: &Scene) -> Vec<Vec<DVec3>> {
    let mut all = Vec::new();
    for (node, world) in scene.nodes.iter().zip(scene.world_transforms()) {
        let Some(m) = node.mesh else { continue };
        let g = &scene.meshes[m].geometry;
        let mut corners = g.corners.iter().map(|&v| world.transform_point3(g.positions.get(v as usize)));
        for f in 0..g.face_count() {
            let n = g.face_sizes.as_ref().map_or(3, |s| s[f] as usize);
            let mut face: Vec<DVec3> = corners.by_ref().take(n).collect();
            if world.determinant() < 0.0 {
                face.reverse();
            }
            all.push(face);
        }
    }
    all
}

fn outside(frustum: &Frustum, face: &[DVec3], slack: f64) -> bool {
    PlaneName::ALL.iter().any(|&k| face.iter().all(|&p| frustum.distance(k, p) < slack))
}

#[test]
fn culling_keeps_what_may_be_seen_and_no_more_than_it_says() {
    let mut kinds = [0; 3];
    for seed in 0..24 {
        let mut r = SplitMix64::new(seed);
        let (before, camera) = (scene(seed), camera(&mut r));
        let mut after = before.clone();
        let report = cull_scene(&mut after, &camera).unwrap();
        assert_eq!((report.instances, report.faces_kept() <= report.faces), (7, true));
        let frustum = camera.frustum();
        let key = |f: &Vec<DVec3>| f.iter().flat_map(|p| p.to_array().map(f64::to_bits)).collect::<Vec<_>>();
        let kept: std::collections::HashSet<_> = faces(&after).iter().map(key).collect();
        // Only the torus is closed.
        let torus_from = faces(&Scene { nodes: before.nodes[..4].to_vec(), ..before.clone() }).len();
        for (i, face) in faces(&before).iter().enumerate() {
            let n = (face[1] - face[0]).cross(face[2] - face[0]);
            let facing =
                if camera.is_perspective() { n.dot(camera.eye() - face[0]) } else { -n.dot(camera.look()) };
            let (out, is_kept) = (outside(&frustum, face, 1e-9), kept.contains(&key(face)));
            assert!(is_kept || out || i >= torus_from && facing < 1e-9, "seed {seed}, face {i}");
            assert!(!is_kept || !outside(&frustum, face, -1e-9));
            kinds[if is_kept {
                0
            } else if out {
                1
            } else {
                2
            }] += 1;
        }
    }
    assert!(kinds.iter().all(|&n| n > 500), "{kinds:?}");
}

#[test]
fn clipping_cuts_every_instance_where_it_stands() {
    for seed in 0..12 {
        let mut r = SplitMix64::new(seed);
        let before = scene(seed);
        let n = vector(&mut r).normalize_or(DVec3::X);
        let plane = n.extend(0.5 * r.signed());
        let area = |s: &Scene| {
            let of = |f: &Vec<DVec3>| {
                let fan = (1..f.len() - 1).map(|i| (f[i] - f[0]).cross(f[i + 1] - f[0]));
                0.5 * fan.sum::<DVec3>().length()
            };
            faces(s).iter().map(of).sum::<f64>()
        };
        let side = |plane: DVec4| {
            let mut s = before.clone();
            let report = clip_scene(&mut s, &[plane], false).unwrap();
            assert_eq!(report.inside + report.cut + report.outside, 7);
            for p in faces(&s).concat() {
                assert!(plane.dot(p.extend(1.0)) > -1e-5);
            }
            (area(&s), s)
        };
        let ((a, first), (b, second)) = (side(plane), side(-plane));
        let whole = area(&before);
        assert!((a + b - whole).abs() < 1e-5 * whole, "{a} {b} {whole}");
        for s in [first, second] {
            // The two at one place still share a mesh.
            assert_eq!(s.nodes[4].mesh, s.nodes[5].mesh);
            assert!(s.meshes.len() <= 7 && s.nodes.len() == 8);
        }
    }
}
