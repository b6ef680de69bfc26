//! What files say of the grid that they were made of: where it lies, and how far they differ from it.

use progmesh::ground::{self, Space};
use progmesh::io::grid::GridFile;
use serde_json::{Map, Value, json};

/// An error, by what it is called, and the transform and the coordinate system of the grid; in the world what leads back from there.
pub(super) fn facts(source: &GridFile, space: Space, error: (&str, f64)) -> Map<String, Value> {
    let mut facts = Map::new();
    let mut say = |name: &str, value: Value| drop(facts.insert(name.into(), value));
    say(error.0, json!(error.1));
    let (place, size) = (&source.georeference, [source.raster.columns(), source.raster.rows()]);
    if let Some(transform) = place.transform {
        say("terrain_transform", json!(transform.0));
    }
    match space {
        Space::Grid => {}
        Space::World { spacing, exaggeration } => {
            say("terrain_spacing", json!(spacing));
            say("terrain_exaggeration", json!(exaggeration));
            // The model coordinates, in the grid's own system, of the scene's origin.
            if let Some(transform) = place.transform {
                say("terrain_origin", json!(transform.apply(ground::middle_of(size))));
            }
        }
        Space::Globe(globe) => say("terrain_exaggeration", json!(globe.exaggeration())),
    }
    if let Some(crs) = &place.crs {
        let code = crs.epsg.map(|epsg| format!("EPSG:{epsg}"));
        if let Some(name) = code.or_else(|| crs.name.clone()) {
            say("terrain_crs", json!(name));
        }
    }
    facts
}
