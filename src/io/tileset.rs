//! The `tileset.json` of 3D Tiles 1.1: a tree of tiles, each a glTF file, coarser ones replaced by finer ones.

use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// A tile of a level.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// The file that holds it, relative to the tileset.
    pub uri: String,
    /// Least and greatest corner of its vertices, in the coordinates of the glTF file (y up).
    pub bounds: [[f64; 3]; 2],
    /// By how much it differs from the ground, in metres.
    pub error: f64,
}

/// Tiles by level, from the coarsest, and by column and row in their level; two by two are below one of the level before.
pub type Tiles = BTreeMap<(u32, [usize; 2]), Tile>;

/// The tileset, with z up as 3D Tiles has it. `transform` leads to the system of all tilesets, column after column; `extras` go to the root. Parents
/// contain their children and have at least their errors, whatever tiles say.
pub fn tileset(tiles: &Tiles, transform: Option<[f64; 16]>, extras: Map<String, Value>) -> Value {
    let roots: Vec<(u32, [usize; 2])> = tiles.keys().copied().take_while(|k| k.0 == 0).collect();
    let made: Vec<Made> = roots.into_iter().filter_map(|root| node(tiles, root)).collect();
    let error = made.iter().map(|m| m.error).fold(0.0, f64::max);
    let bounds = made.iter().map(|m| m.bounds).reduce(union).unwrap_or_default();
    let mut root = match made.len() {
        1 => made.into_iter().next().map(|m| m.json).unwrap_or_default(),
        _ => {
            let children: Vec<Value> = made.into_iter().map(|m| Value::Object(m.json)).collect();
            let mut root = Map::new();
            root.insert("boundingVolume".into(), volume(bounds));
            root.insert("geometricError".into(), json!(error));
            root.insert("children".into(), json!(children));
            root
        }
    };
    root.insert("refine".into(), json!("REPLACE"));
    if let Some(transform) = transform {
        root.insert("transform".into(), json!(transform));
    }
    if !extras.is_empty() {
        root.insert("extras".into(), Value::Object(extras));
    }
    let generator = concat!("progmesh ", env!("CARGO_PKG_VERSION"));
    // What is missing where no tile is shown is all of it. With an error like those of tiles, readers show nothing from where the first would do.
    let [low, high] = bounds;
    let size = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::hypot);
    json!({
        "asset": {"version": "1.1", "extras": {"generator": generator}},
        "geometricError": size.max(2.0 * error),
        "root": root,
    })
}

/// A tile with all below it.
struct Made {
    json: Map<String, Value>,
    bounds: [[f64; 3]; 2],
    error: f64,
}

fn node(tiles: &Tiles, key: (u32, [usize; 2])) -> Option<Made> {
    let tile = tiles.get(&key)?;
    let (level, [x, y]) = key;
    let below = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[i, j]| (level + 1, [2 * x + i, 2 * y + j]));
    let children: Vec<Made> = below.into_iter().filter_map(|key| node(tiles, key)).collect();
    let bounds = children.iter().map(|c| c.bounds).fold(tile.bounds, union);
    let error = children.iter().map(|c| c.error).fold(tile.error, f64::max);
    let mut json = Map::new();
    json.insert("boundingVolume".into(), volume(bounds));
    json.insert("geometricError".into(), json!(error));
    json.insert("content".into(), json!({"uri": tile.uri}));
    if !children.is_empty() {
        let children: Vec<Value> = children.into_iter().map(|c| Value::Object(c.json)).collect();
        json.insert("children".into(), json!(children));
    }
    Some(Made { json, bounds, error })
}

fn union(a: [[f64; 3]; 2], b: [[f64; 3]; 2]) -> [[f64; 3]; 2] {
    let with = |pick: fn(f64, f64) -> f64, i: usize| std::array::from_fn(|k| pick(a[i][k], b[i][k]));
    [with(f64::min, 0), with(f64::max, 1)]
}

/// A box, turned from y up to z up: (x, y, z) becomes (x, -z, y).
fn volume([low, high]: [[f64; 3]; 2]) -> Value {
    let middle: [f64; 3] = std::array::from_fn(|k| (low[k] + high[k]) / 2.0);
    // A box without a height is none to some readers.
    let half: [f64; 3] = std::array::from_fn(|k| ((high[k] - low[k]) / 2.0).max(1e-3));
    json!({"box": [
        middle[0], -middle[2], middle[1],
        half[0], 0.0, 0.0,
        0.0, half[2], 0.0,
        0.0, 0.0, half[1],
    ]})
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parents_hold_their_children() {
        let tile = |x: f64, error: f64| Tile {
            uri: format!("{x}.glb"),
            bounds: [[x, 0.0, 0.0], [x + 1.0, 2.0, 4.0]],
            error,
        };
        let mut tiles = Tiles::new();
        tiles.insert((0, [0, 0]), tile(0.0, 8.0));
        tiles.insert((1, [0, 0]), tile(0.0, 4.0));
        tiles.insert((1, [1, 1]), tile(5.0, 9.0));
        let made = tileset(&tiles, None, Map::new());
        let root = &made["root"];
        assert_eq!((&made["geometricError"], &root["geometricError"]), (&json!(18.0), &json!(9.0)));
        // Larger ones are as wrong as they are wide where none is shown.
        tiles.get_mut(&(1, [1, 1])).unwrap().bounds[1] = [300.0, 2.0, 400.0];
        assert_eq!(
            tileset(&tiles, None, Map::new())["geometricError"],
            json!(300f64.hypot(2.0).hypot(400.0))
        );
        tiles.get_mut(&(1, [1, 1])).unwrap().bounds[1] = [6.0, 2.0, 4.0];
        assert_eq!(root["boundingVolume"]["box"][0], json!(3.0));
        assert_eq!(root["boundingVolume"]["box"][1], json!(-2.0));
        assert_eq!(root["children"].as_array().map(Vec::len), Some(2));
        assert!(root.get("transform").is_none() && root["refine"] == "REPLACE");
        assert_eq!(tileset(&Tiles::new(), None, Map::new())["geometricError"], json!(0.0));
    }
}
