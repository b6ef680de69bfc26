//! What a document holds that formats without it lose.

use super::Source;
use serde_json::Value;
use std::collections::BTreeSet;

/// Parts of a material that a [`crate::scene::Material`] has.
const KNOWN: [&str; 7] =
    ["name", "pbrMetallicRoughness", "normalTexture", "emissiveFactor", "alphaMode", "extensions", "extras"];
const KNOWN_BASE: [&str; 4] = ["baseColorFactor", "baseColorTexture", "metallicFactor", "roughnessFactor"];

impl Source {
    /// What there is beside surfaces, nodes and materials, in words.
    pub(crate) fn beside_surfaces(&self) -> Vec<&'static str> {
        let d = &self.document;
        let is_there = |key: &str| d.get(key).and_then(Value::as_array).is_some_and(|a| !a.is_empty());
        let nodes = d.get("nodes").and_then(Value::as_array);
        let of_node = |path: &str| nodes.is_some_and(|n| n.iter().any(|n| n.pointer(path).is_some()));
        let all = [
            ("animations", is_there("animations")),
            ("skins", is_there("skins")),
            ("cameras", is_there("cameras")),
            ("lights", d.pointer("/extensions/KHR_lights_punctual").is_some()),
            ("GPU instances", of_node("/extensions/EXT_mesh_gpu_instancing")),
            ("points and lines", self.surfaces.iter().flatten().any(Option::is_none)),
        ];
        all.into_iter().filter(|x| x.1).map(|x| x.0).collect()
    }

    /// Names of the properties of materials that a [`crate::scene::Material`] does not have, each once, in order.
    pub(crate) fn other_material_properties(&self) -> BTreeSet<&str> {
        let mut names = BTreeSet::new();
        let materials = self.document.get("materials").and_then(Value::as_array);
        for m in materials.into_iter().flatten().filter_map(Value::as_object) {
            let base = m.get("pbrMetallicRoughness").and_then(Value::as_object);
            let own = m.iter().filter(|(k, v)| !KNOWN.contains(&k.as_str()) && **v != Value::Bool(false));
            names.extend(own.map(|(k, _)| k.as_str()));
            let of_base = base.into_iter().flat_map(|b| b.keys()).map(String::as_str);
            names.extend(of_base.filter(|k| !KNOWN_BASE.contains(k)));
            let extensions = m.get("extensions").and_then(Value::as_object);
            let of_extensions = extensions.into_iter().flat_map(|e| e.keys()).map(String::as_str);
            names.extend(of_extensions.filter(|k| *k != "KHR_materials_emissive_strength"));
        }
        names
    }
}
