//! Bytes a vertex of the finest mesh that a progressive mesh and its view hierarchy take, by both placements: of the largest mesh of a file, with a normal a vertex (its own, or that of
//! the faces around).
//!
//! `cargo run --release -p progmesh-bench --example memory -- in.ply [plain]` (plain: without attributes)
use progmesh::aif::{BuildOptions, Mesh, Semantic, Wedges};
use progmesh::io::files::read_scene;
use progmesh::normals::{self, Normals};
use progmesh::refine::Hierarchy;
use progmesh::refine::format::suggested_grid;
use progmesh::refine::hierarchy::Options as HierarchyOptions;
use progmesh::refine::progressive::build;
use progmesh::simplify::{Options, Placement, Quiet};
use std::sync::Arc;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or("usage: memory IN [plain]")?;
    let plain = arguments.next().is_some_and(|a| a == "plain");
    let scene = read_scene(&file)?.scene;
    let largest = scene.meshes.into_iter().max_by_key(|m| m.geometry.face_count());
    let mut input = largest.ok_or("no mesh")?.geometry;
    let has = |w: &Wedges| w.channels().iter().any(|c| c.semantic == Semantic::Normal);
    if plain {
        input.wedges = None;
    } else if !input.wedges.as_ref().is_some_and(has) {
        // One a vertex: no edge is a crease.
        normals::apply(&mut input, Normals::Recompute { crease: 180.0 })?;
    }
    for placement in [Placement::Optimal, Placement::Endpoint] {
        let mut options = Options::default();
        options.placement = Some(placement);
        options.grid = suggested_grid(&input.positions).filter(|_| placement == Placement::Optimal);
        let mesh = Mesh::build(input.clone(), &BuildOptions::default())?.0;
        let pm = build(mesh, &options, &Quiet)?.mesh;
        let each = |bytes: usize| bytes as f64 / input.positions.len() as f64;
        let (cursor, order) = (each(pm.bytes()), pm.order.as_ref().map_or(0.0, |o| each(o.bytes())));
        let (new, moved) = (each(pm.new_positions.bytes()), each(pm.moved_positions.bytes()));
        let h = Hierarchy::new(Arc::new(pm), &HierarchyOptions::default())?;
        println!(
            "{placement:?}: progressive mesh {cursor:.2} B a vertex, hierarchy {:.2}; of these attributes {:.2}, places {:.2}, bounds {:.2}; on top the input's order {order:.2}",
            each(h.bytes()),
            each(h.attribute_bytes()),
            new + moved,
            each(h.all_bounds().bytes()),
        );
    }
    Ok(())
}
