//! CAM.json is what docs/camera.md says, and glTF cameras stand where their nodes do.

use glam::{DVec3, Vec3Swizzles};
use progmesh::io::camera::{FIELDS, from_json, from_scene};
use progmesh::io::{NoSide, gltf};
use progmesh::refine::view::Projection;
use serde_json::{Value, json};

/// The examples of the documentation.
fn examples() -> Vec<Value> {
    let text = include_str!("../docs/camera.md");
    let blocks = text.split("```json\n").skip(1).filter_map(|b| b.split("```").next());
    blocks.map(|b| serde_json::from_str(b).unwrap()).collect()
}

fn fails(camera: &Value) -> String {
    from_json(camera.to_string().as_bytes()).expect_err("no camera").to_string()
}

#[test]
fn the_documentation_lists_the_fields_and_its_examples_are_cameras() {
    let text = include_str!("../docs/camera.md");
    let listed: Vec<&str> = text.lines().filter_map(|l| l.strip_prefix("| `")?.split('`').next()).collect();
    assert_eq!(listed, FIELDS);
    let cameras: Vec<_> = examples().iter().map(|e| from_json(e.to_string().as_bytes()).unwrap()).collect();
    assert_eq!(cameras.len(), 2);
    assert_eq!(cameras[0].projection(), Projection::Perspective { fov_y_deg: 45.0 });
    assert_eq!(cameras[1].projection(), Projection::Orthographic { ortho_height: 3.0 });
    for camera in cameras {
        assert_eq!((camera.width(), camera.height()), (1920, 1080));
        assert_eq!((camera.near(), camera.far(), camera.eye()), (0.01, 100.0, DVec3::new(0.0, 1.5, 4.0)));
    }
}

#[test]
fn what_is_missing_unknown_or_of_the_wrong_kind_is_named() {
    for example in examples() {
        for (field, _) in example.as_object().unwrap() {
            let mut without = example.clone();
            without.as_object_mut().unwrap().remove(field);
            let named = if field == "ortho_height" { "fov_y_deg" } else { field };
            assert!(fails(&without).starts_with(&format!("{named}: is missing")), "{}", fails(&without));
            for wrong in [json!("text"), json!(null), json!([1, 2]), json!([1, 2, "x"]), json!(-1.5)] {
                let mut with = example.clone();
                with[field] = wrong;
                if with[field] != json!(-1.5) || field != "near" || with.get("fov_y_deg").is_some() {
                    assert!(fails(&with).contains(field.as_str()), "{field}: {}", fails(&with));
                }
            }
            for text in ["NaN", "Infinity", "-Infinity", "1e999", "[0, NaN, 1]"] {
                let mut with = example.clone();
                with[field] = json!("here");
                let text = with.to_string().replace("\"here\"", text);
                let e = from_json(text.as_bytes()).expect_err("no camera").to_string();
                assert!(e.starts_with(&format!("{field}: ")), "{field}: {e}");
            }
        }
        let mut more = example.clone();
        more["fov"] = json!(3);
        assert!(fails(&more).starts_with("fov: no such field"));
        let mut both = example.clone();
        (both["fov_y_deg"], both["ortho_height"]) = (json!(45), json!(3));
        assert!(fails(&both).contains("not both"));
    }
    assert!(fails(&json!([1])).starts_with("document: "));
    assert!(
        from_json(b"").is_err() && from_json(b"{\"eye\": [\xff").is_err() && from_json(b"{\n\n:").is_err()
    );
}

#[test]
fn numbers_that_are_no_camera_are_named() {
    let [perspective, orthographic] = examples().try_into().unwrap();
    for (example, field, value) in [
        (&perspective, "target", perspective["eye"].clone()),
        (&perspective, "up", json!([0, 0.5, 4])),
        (&perspective, "up", json!([0, 0, 0])),
        (&perspective, "fov_y_deg", json!(0)),
        (&perspective, "fov_y_deg", json!(180)),
        (&perspective, "width", json!(0)),
        (&perspective, "height", json!(0)),
        (&perspective, "height", json!(1.5)),
        (&perspective, "near", json!(0)),
        (&perspective, "near", json!(100)),
        (&perspective, "far", json!(0.001)),
        (&orthographic, "ortho_height", json!(0)),
        (&orthographic, "width", json!(-3)),
    ] {
        let mut wrong = example.clone();
        wrong[field] = value;
        assert!(fails(&wrong).contains(field), "{field}: {}", fails(&wrong));
    }
}

fn scene(cameras: Value, nodes: Value) -> progmesh::scene::Scene {
    let document = json!({ "asset": {"version": "2.0"}, "cameras": cameras, "nodes": nodes });
    gltf::decode(document.to_string().as_bytes(), &NoSide).unwrap().scene
}

#[test]
fn a_gltf_camera_stands_where_its_node_does() {
    let scene = scene(
        json!([
            {"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1, "aspectRatio": 2.0}},
            {"type": "orthographic", "name": "plan",
             "orthographic": {"xmag": 3.0, "ymag": 1.5, "znear": 0.0, "zfar": 9.0}}
        ]),
        json!([
            {"children": [1, 2], "translation": [1, 2, 3], "scale": [2, 2, 2]},
            {"camera": 0, "name": "eye", "translation": [1, 0, 0]},
            {"camera": 1, "rotation": [-std::f64::consts::FRAC_1_SQRT_2, 0, 0, std::f64::consts::FRAC_1_SQRT_2]}
        ]),
    );
    for which in ["eye", "0"] {
        let camera = from_scene(&scene, Some(which)).unwrap();
        assert_eq!((camera.eye(), camera.look()), (DVec3::new(3.0, 2.0, 3.0), DVec3::NEG_Z));
        assert_eq!((camera.width(), camera.height(), camera.far()), (2160, 1080, f64::INFINITY));
        assert!((camera.pixel_scale() - 540.0 / 0.5_f64.tan()).abs() < 1e-9);
    }
    let plan = from_scene(&scene, Some("plan")).unwrap();
    assert!((plan.look() - DVec3::NEG_Y).length() < 1e-12 && plan.up().xy().length() < 1e-12);
    assert_eq!(plan.projection(), Projection::Orthographic { ortho_height: 3.0 });
    let e = from_scene(&scene, None).unwrap_err().to_string();
    assert!(e.contains("0 (eye), 1 (plan)"), "{e}");
    assert!(from_scene(&scene, Some("2")).unwrap_err().to_string().contains("no camera \"2\""));
}

#[test]
fn wrong_gltf_cameras_are_named() {
    let one = |camera: Value, node: Value| {
        from_scene(&scene(json!([camera]), json!([node])), None).expect_err("no camera").to_string()
    };
    let good = json!({"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}});
    let held = json!({"camera": 0});
    let mut wrong = good.clone();
    wrong["perspective"]["yfov"] = json!("x");
    assert_eq!(one(wrong, held.clone()), "cameras[0].perspective.yfov: must be a number");
    assert!(one(json!({"type": "fish"}), held.clone()).starts_with("cameras[0].type: "));
    let mut wrong = good.clone();
    wrong["perspective"]["znear"] = json!(0);
    assert!(one(wrong, held).starts_with("cameras[0]: near is 0"));
    assert!(one(good.clone(), json!({"camera": 0, "scale": [1, 0, 1]})).starts_with("nodes[0]: "));
    assert!(one(good.clone(), json!({})).contains("no node"));
    assert!(from_scene(&scene(json!([good]), json!([{"camera": 0}])), None).is_ok());
    let flat = progmesh::scene::Scene::default();
    assert!(from_scene(&flat, None).unwrap_err().to_string().contains("glTF"));
}
