//! Progressive mesh files: our own `.pm` ([`crate::refine::format`], FORMAT.md) with the scene around the meshes, and Hoppe's, which has the same
//! ending and other first bytes.

mod chunk;
mod extras;
pub mod hoppe;
mod terrain;

pub use chunk::{Extent, Shelled, read_shell, write_shell};
pub use terrain::{Terrain, read_terrain, write_terrain};

use super::{DecodeError, Decoded};
use crate::aif::NONE;
use crate::pipeline::{count, thousands};
use crate::progressive::{Detail, Leftover, ProgressiveScene};
use crate::refine::format::{self, ChunkType, EncodeOptions, FormatError, MAGIC, Report};
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

/// Writes progressive meshes with the scene around them. Without the input's order faces that no mesh can hold, values of faces, and attributes of vertices without a face are left out.
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
    let mut options = options.clone();
    if !options.any_order {
        for (mesh, m) in scene.shell.meshes.iter().zip(0..).filter(|(m, _)| !m.extras.is_empty()) {
            options = options.with_other(ChunkType::EXTRAS, m, extras::write(&mesh.extras));
        }
    }
    format::encode(&scene.meshes, &scene.turns, &write_shell(&scene.shell, leftovers, &boxes), &options)
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

/// As [`decode_progressive`], but of a damaged or cut-off file all that is whole ([`format::decode_prefix`]), with warnings that say what is missing.
///
/// Errors: damage that leaves nothing: of the head, or of the bases of all meshes.
pub fn decode_what_is_there(bytes: &[u8]) -> Result<DecodedProgressive, DecodeError> {
    if hoppe::looks_like(bytes) {
        return hoppe::decode(bytes);
    }
    let mut decoded = format::decode_prefix(bytes)?;
    let lost = &decoded.report.lost;
    // (Of a base that is there twice the second is lost, but not the mesh.)
    let gone = |m: u32| decoded.meshes.get(m as usize).is_some_and(|mesh| mesh.base_vertices() == 0);
    let bases = lost.iter().filter(|c| c.kind == ChunkType::BASE && gone(c.mesh)).count();
    let warnings: Vec<String> = match &decoded.report.damage {
        Some(damage) if bases == decoded.meshes.len() => return Err(damage.clone().into()),
        Some(damage) => vec![what_is_used(damage, &decoded, bases)],
        None => vec![],
    };
    let without = |said: &str| format!("{said}: there are no nodes, materials and images");
    let scene_is_lost = lost.iter().any(|c| c.kind == ChunkType::SCENE);
    let fits = |bytes: &[u8]| check_count(&read_shell(bytes)?.scene, decoded.meshes.len());
    let scene = match decoded.scene.as_deref().map(fits) {
        Some(Err(e)) => Some(without(&e.to_string())),
        _ => scene_is_lost.then(|| without("the scene around the meshes is lost")),
    };
    if scene.is_some() {
        // What its materials and groups are nobody knows.
        decoded.scene = None;
        for mesh in &mut decoded.meshes {
            (mesh.face_material, mesh.face_group) = Default::default();
        }
    }
    finish(decoded, warnings.into_iter().chain(scene).collect())
}

/// What is left of a damaged file.
fn what_is_used(damage: &FormatError, decoded: &format::Decoded, bases: usize) -> String {
    let splits: usize = decoded.meshes.iter().map(|m| m.splits.len()).sum();
    let lost = decoded.report.lost.iter().filter(|c| c.kind.is_splits());
    let all = splits + lost.map(|c| c.count as usize).sum::<usize>();
    let mut said =
        format!("{damage}; what is whole is used: {} of {}", thousands(splits), count(all, "split"));
    if bases > 0 {
        said += &format!(", of {} nothing", count(bases, "mesh"));
    }
    if decoded.report.lost.iter().any(|c| c.kind == ChunkType::ORDER) && splits == all {
        said += ", not in the input's order";
    }
    said
}

/// The scene must be one of so many meshes.
fn check_count(shell: &Scene, meshes: usize) -> Result<(), DecodeError> {
    match shell.meshes.len() {
        n if n == meshes => Ok(()),
        n => Err(chunk::wrong("scene", format!("describes {n} meshes, the file has {meshes}"))),
    }
}

/// Puts the scene around the meshes, and checks that they go together.
fn finish(decoded: format::Decoded, mut warnings: Vec<String>) -> Result<DecodedProgressive, DecodeError> {
    let meshes = decoded.meshes;
    let (mut shell, leftovers) = match decoded.scene.as_deref() {
        Some(bytes) => {
            let Shelled { scene, leftovers, .. } = read_shell(bytes)?;
            (scene, leftovers)
        }
        None => (plain_shell(meshes.len()), vec![]),
    };
    check_count(&shell, meshes.len())?;
    for (m, bytes) in &decoded.extras {
        if let Some(mesh) = shell.meshes.get_mut(*m as usize) {
            mesh.extras = extras::read(bytes)?;
        }
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
    check_count(&shell.scene, meshes)?;
    Ok(shell)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::meshes::{GenerateOptions, generate};
    use crate::pipeline::{Job, build_progressive};
    use crate::refine::format::RangeReader;
    use crate::samples;
    use crate::scene::{Material, Node};
    use crate::simplify::Quiet;
    use glam::{DMat4, DVec3};

    /// Two meshes, each in a node of its own, faces with materials.
    fn two() -> Vec<u8> {
        let mut scene = Scene::default();
        for (i, name) in ["scan", "cad"].into_iter().enumerate() {
            let sample = generate(name, &GenerateOptions::default().with_faces(300)).unwrap();
            let mut mesh = samples::scene(sample, name).meshes.remove(0);
            mesh.geometry.face_material = vec![i as u32; mesh.geometry.face_count()];
            scene.meshes.push(mesh);
            scene.materials.push(Material { name: format!("m{i}"), ..Default::default() });
            let transform = DMat4::from_translation(DVec3::X * i as f64);
            scene.nodes.push(Node { name: None, transform, mesh: Some(i), children: vec![] });
            scene.roots.push(i);
        }
        let built = build_progressive(scene, &Job::default(), &Quiet).unwrap();
        encode_progressive(&built.scene, &EncodeOptions::default()).unwrap()
    }

    fn flipped(bytes: &[u8], kind: ChunkType, mesh: u32) -> Vec<u8> {
        let reader = RangeReader::new(bytes).unwrap();
        let chunk = reader.directory().chunks.iter().find(|c| c.kind == kind && c.mesh == mesh).unwrap();
        let mut bad = bytes.to_vec();
        bad[(chunk.offset + chunk.stored / 2) as usize] ^= 1;
        bad
    }

    #[test]
    fn without_the_scene_the_meshes_are_all_there() {
        let bytes = two();
        let whole = decode(&bytes).unwrap().scene;
        let bad = flipped(&bytes, ChunkType::SCENE, u32::MAX);
        assert!(decode(&bad).unwrap_err().to_string().contains("SCNE"));
        let saved = decode_what_is_there(&bad).unwrap();
        assert_eq!(saved.warnings.len(), 2, "{:?}", saved.warnings);
        assert!(saved.warnings[1].contains("no nodes, materials and images"), "{:?}", saved.warnings);
        let scene = saved.scene.at(&saved.scene.positions(Detail::Full)).unwrap();
        assert_eq!((scene.meshes.len(), scene.roots.len(), scene.materials.len()), (2, 2, 0));
        for (a, b) in scene.meshes.iter().zip(&whole.meshes) {
            assert_eq!(
                (&a.geometry.corners, &a.geometry.positions),
                (&b.geometry.corners, &b.geometry.positions)
            );
            assert!(a.geometry.face_material.is_empty());
        }
    }

    #[test]
    fn without_the_base_of_a_mesh_the_others_keep_their_places() {
        let bytes = two();
        let whole = decode(&bytes).unwrap().scene;
        let saved = decode_what_is_there(&flipped(&bytes, ChunkType::BASE, 0)).unwrap();
        assert!(saved.warnings[0].contains("of 1 mesh nothing"), "{:?}", saved.warnings);
        let scene = saved.scene.at(&saved.scene.positions(Detail::Full)).unwrap();
        assert_eq!(scene.meshes[0].geometry.face_count(), 0);
        assert_eq!(scene.meshes[1].geometry.corners, whole.meshes[1].geometry.corners);
        assert_eq!(scene.nodes[1].transform, whole.nodes[1].transform);
        for detail in [Detail::Base, Detail::Level(0), Detail::Triangles(50), Detail::MaxError(1e9)] {
            assert_eq!(saved.scene.at(&saved.scene.positions(detail)).unwrap().meshes.len(), 2);
        }
        let both = flipped(&flipped(&bytes, ChunkType::BASE, 0), ChunkType::BASE, 1);
        assert!(decode_what_is_there(&both).is_err());
    }

    #[test]
    fn every_beginning_that_holds_a_base_can_be_saved() {
        let bytes = two();
        let first = RangeReader::new(&bytes[..]).unwrap().directory().chunks[0].range().end as usize;
        for end in (0..bytes.len()).step_by(13).chain([first - 1, first]) {
            let saved = decode_what_is_there(&bytes[..end]);
            assert_eq!(saved.is_ok(), end >= first, "{end} of {}", bytes.len());
            if let Ok(saved) = saved {
                assert!(!saved.warnings.is_empty());
                saved.scene.at(&saved.scene.positions(Detail::Full)).unwrap();
            }
        }
    }
}
