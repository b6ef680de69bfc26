//! From names to the materials, groups and vertices that stay.

use super::{Job, JobError};
use crate::aif::{Mesh, NONE, Semantic};
use crate::scene::Scene;
use crate::simplify::Options;

/// The materials that `wanted` names, or numbers where no name fits.
pub(super) fn materials(scene: &Scene, wanted: &[String]) -> Result<Vec<u32>, JobError> {
    let mut found = Vec::new();
    for name in wanted {
        let before = found.len();
        found.extend((0..scene.materials.len()).filter(|&m| scene.materials[m].name == *name));
        if found.len() == before {
            let by_number = name.parse().ok().filter(|&m: &usize| m < scene.materials.len());
            found.push(by_number.ok_or_else(|| {
                not_found("material", name, scene.materials.iter().map(|m| m.name.clone()).collect())
            })?);
        }
    }
    Ok(found.into_iter().map(|m| m as u32).collect())
}

/// Numbers the groups of all meshes in one run, so that a group's number says its mesh too.
pub(super) fn make_groups_distinct(scene: &mut Scene) {
    shift_groups(scene, |group, base| group.checked_add(base).unwrap_or(NONE));
}

/// Undoes [`make_groups_distinct`].
pub(super) fn restore_groups(scene: &mut Scene) {
    shift_groups(scene, |group, base| group.checked_sub(base).unwrap_or(NONE));
}

fn shift_groups(scene: &mut Scene, shift: impl Fn(u32, u32) -> u32) {
    let mut base = 0u32;
    for m in &mut scene.meshes {
        for g in m.geometry.face_group.iter_mut().filter(|g| **g != NONE) {
            *g = shift(*g, base);
        }
        base = base.saturating_add(m.groups.len() as u32);
    }
}

/// The groups, numbered in one run over all meshes, that `wanted` names: by the group's name, the object's, or both together.
pub(super) fn groups(scene: &Scene, wanted: &[String]) -> Result<Vec<u32>, JobError> {
    let all: Vec<_> = scene.meshes.iter().flat_map(|m| &m.groups).collect();
    let mut found = Vec::new();
    for name in wanted {
        let before = found.len();
        found.extend((0..all.len()).filter(|&i| {
            let g = all[i];
            g.names.contains(name) || g.object.as_ref() == Some(name) || g.label() == *name
        }));
        if found.len() == before {
            return Err(not_found("group", name, all.iter().map(|g| g.label()).collect()));
        }
    }
    Ok(found.into_iter().map(|g| g as u32).collect())
}

/// Reads weights and locks of the vertices from their attributes into `options`.
///
/// A vertex with several values (the property came from corners) takes the largest: the safer side.
pub(super) fn by_vertex(mesh: &Mesh, job: &Job, options: &mut Options) -> Result<(), JobError> {
    if let Some(name) = &job.weights_property {
        let values = vertex_values(mesh, name)?;
        if let Some((vertex, &value)) = values.iter().enumerate().find(|(_, w)| **w <= 0.0 || w.is_infinite())
        {
            return Err(JobError::Weight { vertex, value });
        }
        options.vertex_weights = values.into_iter().map(|w| if w.is_nan() { 1.0 } else { w }).collect();
    }
    if let Some(name) = &job.lock_property {
        for (v, x) in vertex_values(mesh, name)?.into_iter().enumerate() {
            if !x.is_nan() && x != 0.0 {
                options.locked_vertices.set(v);
            }
        }
    }
    Ok(())
}

/// The first number of attribute `name` at every vertex slot; NaN where there is none.
fn vertex_values(mesh: &Mesh, name: &str) -> Result<Vec<f32>, JobError> {
    let t = mesh.topology();
    let mut values = vec![f32::NAN; t.vertex_slots()];
    let wedges = mesh.wedges();
    let channel = wedges.and_then(|w| w.channel(&Semantic::Custom(name.to_string())).map(|k| (w, k)));
    let Some((w, k)) = channel else {
        if t.face_count() == 0 {
            return Ok(values);
        }
        let custom = wedges.map_or(&[][..], |w| w.channels()).iter().filter_map(|c| match &c.semantic {
            Semantic::Custom(n) => Some(n.clone()),
            _ => None,
        });
        return Err(not_found("vertex property", name, custom.collect()));
    };
    for f in t.faces() {
        for (slot, v) in t.corner_range(f).zip(t.face_vertices(f)) {
            if let Some(&[x, ..]) = w.get(w.corner[slot], k) {
                // NaN loses against any number.
                values[v.index()] = values[v.index()].max(x);
            }
        }
    }
    Ok(values)
}

fn not_found(kind: &'static str, name: &str, mut there: Vec<String>) -> JobError {
    there.retain(|n| !n.is_empty());
    there.dedup();
    let more = there.len().saturating_sub(20);
    there.truncate(20);
    let there = match (there.is_empty(), more) {
        (true, _) => "the file has none with a name".to_string(),
        (_, 0) => format!("there are {}", there.join(", ")),
        _ => format!("there are {}, and {more} more", there.join(", ")),
    };
    JobError::NotFound { kind, name: name.to_string(), there }
}
