//! Progressive mesh files: our own `.pm` ([`crate::refine::format`], FORMAT.md) with the scene around the meshes, and Hoppe's, which has the same
//! ending and other first bytes.

mod chunk;
pub mod hoppe;
mod terrain;

pub use chunk::{Extent, Shelled, read_shell, write_shell};
pub use terrain::{Terrain, write_terrain};

use super::{DecodeError, Decoded};
use crate::aif::NONE;
use crate::progressive::{Detail, Leftover, ProgressiveScene};
use crate::refine::format::{self, EncodeOptions, MAGIC, Report};
use crate::refine::progressive::Damage;
use crate::scene::{Scene, SceneMesh};

/// A progressive mesh file read.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct DecodedProgressive {
    /// The meshes and the scene around them.
    pub scene: ProgressiveScene,
    /// Sizes and losses; `None` for Hoppe's format.
    pub report: Option<Report>,
    /// What was changed, or left out, on the way in.
    pub warnings: Vec<String>,
}

/// Writes progressive meshes with the scene around them.
///
/// Errors: damaged meshes, bits out of range.
pub fn encode_progressive(
    scene: &ProgressiveScene,
    options: &EncodeOptions,
) -> Result<Vec<u8>, format::EncodeError> {
    // Their corners are in the input's numbering.
    let leftovers = if options.any_order { &[][..] } else { &scene.leftovers };
    let boxes: Vec<Option<Extent>> = match options.pages {
        true => scene.meshes.iter().map(|m| m.full_bounds()).collect(),
        false => Vec::new(),
    };
    format::encode(&scene.meshes, &scene.turns, &write_shell(&scene.shell, leftovers, &boxes), options)
}

/// Reads a progressive mesh file of either kind.
///
/// Errors: any damage. Never panics, whatever the bytes.
pub fn decode_progressive(bytes: &[u8]) -> Result<DecodedProgressive, DecodeError> {
    if hoppe::looks_like(bytes) {
        return hoppe::decode(bytes);
    }
    let decoded = format::decode(bytes)?;
    finish(decoded, vec![])
}

/// As [`decode_progressive`], but of a damaged or cut-off file as much as came before the damage, with a warning.
///
/// Errors: damage that leaves nothing: of the head, or of a mesh's base.
pub fn decode_what_is_there(bytes: &[u8]) -> Result<DecodedProgressive, DecodeError> {
    if hoppe::looks_like(bytes) {
        return hoppe::decode(bytes);
    }
    let decoded = format::decode_prefix(bytes)?;
    let said = decoded.report.damage.as_ref().map(|d| {
        let splits: usize = decoded.meshes.iter().map(|m| m.splits.len()).sum();
        format!("{d}; the {} before are used", crate::pipeline::count(splits, "split"))
    });
    match (&decoded.report.damage, decoded.meshes.is_empty()) {
        (Some(damage), true) => Err(damage.clone().into()),
        _ => finish(decoded, said.into_iter().collect()),
    }
}

/// Puts the scene around the meshes, and checks that they go together.
fn finish(decoded: format::Decoded, mut warnings: Vec<String>) -> Result<DecodedProgressive, DecodeError> {
    let meshes = decoded.meshes;
    let damaged = decoded.report.damage.is_some();
    let (shell, leftovers) = match decoded.scene.as_deref() {
        Some(bytes) => {
            let Shelled { scene, leftovers, .. } = read_shell(bytes)?;
            (scene, leftovers)
        }
        None => (plain_shell(meshes.len()), vec![]),
    };
    if shell.meshes.len() != meshes.len() && !(damaged && meshes.len() < shell.meshes.len()) {
        let what = format!("describes {} meshes, the file has {}", shell.meshes.len(), meshes.len());
        return Err(chunk::wrong("scene", what));
    }
    for (i, (mesh, around)) in meshes.iter().zip(&shell.meshes).enumerate() {
        let left = leftovers.get(i);
        let of_left = |f: fn(&Leftover) -> &[u32]| left.map_or(&[][..], f);
        check_faces(i, &mesh.face_material, &mesh.face_group, around, shell.materials.len())?;
        let (materials, groups) = (of_left(|l| &l.materials), of_left(|l| &l.groups));
        check_faces(i, materials, groups, around, shell.materials.len())?;
    }
    let worst = decoded.report.quantisation_errors.iter().copied().fold(0.0, f64::max);
    if worst > 0.0 {
        warnings.push(format!(
            "vertices were moved by up to {} when the file was written",
            crate::report::short(worst)
        ));
    }
    let scene = ProgressiveScene { meshes, turns: decoded.turns, shell, leftovers };
    Ok(DecodedProgressive { scene, report: Some(decoded.report), warnings })
}

/// Materials and groups of the faces must be there.
fn check_faces(
    i: usize,
    face_material: &[u32],
    face_group: &[u32],
    around: &SceneMesh,
    materials: usize,
) -> Result<(), DecodeError> {
    let beyond =
        |of_faces: &[u32], n: usize| of_faces.iter().copied().find(|&x| x != NONE && x as usize >= n);
    if let Some(m) = beyond(face_material, materials) {
        return Err(chunk::wrong(&format!("mesh {i}"), format!("material {m} of {materials}")));
    }
    // A file without a scene may number groups that nobody named.
    let groups = around.groups.len();
    match beyond(face_group, groups).filter(|_| groups > 0) {
        Some(g) => Err(chunk::wrong(&format!("mesh {i}"), format!("group {g} of {groups}"))),
        None => Ok(()),
    }
}

/// What stands around so many meshes, from the bytes that hold it, if there are any.
///
/// Errors: damage; a scene of another number of meshes.
pub(crate) fn shell(bytes: Option<&[u8]>, meshes: usize) -> Result<Shelled, DecodeError> {
    let Some(bytes) = bytes else {
        return Ok(Shelled { scene: plain_shell(meshes), ..Shelled::default() });
    };
    let shell = read_shell(bytes)?;
    match shell.scene.meshes.len() {
        n if n == meshes => Ok(shell),
        n => Err(chunk::wrong("scene", format!("describes {n} meshes, the file has {meshes}"))),
    }
}

/// A scene of so many meshes, one node each.
fn plain_shell(meshes: usize) -> Scene {
    let mut shell = Scene::default();
    for i in 0..meshes {
        let one = Scene::from_mesh(SceneMesh::default());
        shell.meshes.extend(one.meshes);
        shell.nodes.extend(one.nodes.into_iter().map(|mut n| {
            n.mesh = Some(i);
            n
        }));
        shell.roots.push(i);
    }
    shell
}

/// Reads a progressive mesh file at full detail.
pub fn decode(bytes: &[u8]) -> Result<Decoded, DecodeError> {
    let read = decode_progressive(bytes)?;
    let scene = read.scene.at(&read.scene.positions(Detail::Full)).map_err(damage_of)?;
    Ok(Decoded { scene, warnings: read.warnings })
}

/// Damage that a cursor found, as an error of reading.
pub fn damage_of((mesh, damage): (usize, Damage)) -> DecodeError {
    chunk::wrong(&format!("mesh {mesh}"), damage.to_string())
}

/// True if the bytes begin as one of the two formats does.
pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC) || hoppe::looks_like(bytes)
}
