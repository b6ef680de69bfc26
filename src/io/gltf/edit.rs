//! Changes to a document's meshes, in step with those of a scene.

use super::Source;
use super::json::array_mut;
use serde_json::{Value, json};

impl Source {
    /// Appends a copy of mesh `m`.
    pub(crate) fn copy_mesh(&mut self, m: usize) {
        let Some(document) = self.document.as_object_mut() else { return };
        let meshes = array_mut(document, "meshes");
        let copy = meshes.get(m).cloned().unwrap_or_else(|| json!({ "primitives": [] }));
        meshes.push(copy);
        self.surfaces.push(self.surfaces.get(m).cloned().unwrap_or_default());
    }

    /// Makes a node show a mesh, or nothing. What a mesh's node has beside it (skin, weights) goes with it.
    pub(crate) fn set_node_mesh(&mut self, node: usize, mesh: Option<usize>) {
        let nodes = self.document.get_mut("nodes").and_then(Value::as_array_mut);
        let Some(node) = nodes.and_then(|n| n.get_mut(node)).and_then(Value::as_object_mut) else { return };
        match mesh {
            Some(m) => {
                node.insert("mesh".into(), json!(m));
            }
            None => {
                for key in ["mesh", "skin", "weights"] {
                    node.shift_remove(key);
                }
            }
        }
    }

    /// Removes meshes and numbers the others anew. Those that a node still refers to stay; `gone` then says so.
    pub(crate) fn remove_meshes(&mut self, gone: &mut [bool]) {
        let Some(document) = self.document.as_object_mut() else { return };
        let of = |node: &Value| node.get("mesh").and_then(super::json::uint);
        let nodes = array_mut(document, "nodes");
        for m in nodes.iter().filter_map(of) {
            if let Some(g) = gone.get_mut(m) {
                *g = false;
            }
        }
        let new = |m: usize| m - gone.iter().take(m).filter(|&&g| g).count();
        for node in nodes.iter_mut() {
            if let (Some(m), Some(node)) = (of(node), node.as_object_mut()) {
                node.insert("mesh".into(), json!(new(m)));
            }
        }
        let mut m = 0;
        let mut stays = || {
            m += 1;
            !gone.get(m - 1).copied().unwrap_or(false)
        };
        array_mut(document, "meshes").retain(|_| stays());
        m = 0;
        let mut stays = || {
            m += 1;
            !gone.get(m - 1).copied().unwrap_or(false)
        };
        self.surfaces.retain(|_| stays());
        document.retain(|key, v| !matches!(key.as_str(), "meshes" | "nodes") || v != &json!([]));
    }
}
