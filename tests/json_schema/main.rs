//! The objects of `--json` have exactly the fields that docs/json.md documents.
#![allow(dead_code)] // the fields are there to be demanded

#[path = "../common/mod.rs"]
mod common;
mod compare;
mod convert;
mod progressive;
mod selective;
mod simplify;
mod terrain;
mod views;

use crate::terrain::{BUILD, TERRAIN, terrain};
use crate::views::CAMERA;
use common::Place;
use serde::Deserialize;

/// An optional value whose key must be there all the same.
pub(crate) fn present<'de, D: serde::Deserializer<'de>, T: Deserialize<'de>>(
    d: D,
) -> Result<Option<T>, D::Error> {
    Option::deserialize(d)
}

#[test]
fn every_field_is_documented() {
    let documentation = include_str!("../../docs/json.md");
    let p = Place::new();
    p.generate("quad-sphere", "in.obj", 96);
    p.generate("torus", "torus.obj", 96);
    terrain(&p);
    p.write("cam.json", CAMERA);
    let simplified = p.done("simplify torus.obj out.obj --max-error 0.1 --certified --measure --json").json();
    let others = [
        "info in.obj --json",
        "compare torus.obj out.obj --certify 1e-2 --threshold 1 --samples 100 --json",
        "encode in.obj in.pm --json",
        "info in.pm --json",
        "decode in.pm out.ply --json",
        "lod in.pm out.glb --levels 0.5 --json",
        "morph in.pm out.ply --from 50 --to 90 --at 0.5 --json",
        "levels in.obj --json --runs 1 --samples 100 --epsilon 60",
        "convert in.obj out.ply --json",
        "clip torus.obj out.ply --plane 0,1,0,0 --cap --json",
        "cull torus.obj out.ply --camera cam.json --json",
        "generate sphere s.ply --faces 20 --json",
        "generate terrain t.tif --size 9 --json",
        "terrain info t.tif --json",
        TERRAIN,
        BUILD,
    ];
    for object in others.map(|a| p.done(a).json()).into_iter().chain([simplified]) {
        let mut values = vec![&object];
        while let Some(v) = values.pop() {
            match v {
                serde_json::Value::Object(fields) => {
                    for (name, value) in fields {
                        assert!(documentation.contains(&format!("`{name}`")), "{name} is not documented");
                        values.push(value);
                    }
                }
                serde_json::Value::Array(all) => values.extend(all),
                _ => {}
            }
        }
    }
}
