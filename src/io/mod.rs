//! Reading and writing meshes: one file a format, all on bytes; only [`files`] touches the file system.
//!
//! A decoder takes the bytes of a file and a [`Side`] that finds the files it names (MTL, textures, buffers). An
//! encoder returns bytes. What a format cannot hold, or what was changed on the way in, is a warning, never silent.

pub mod camera;
#[cfg(feature = "files")]
pub mod files;
pub(crate) mod flatten;
pub mod geojson;
pub mod gltf;
pub mod grid;
pub(crate) mod notes;
pub mod obj;
pub mod off;
pub mod ply;
pub mod pm;
pub mod quantized_mesh;
pub mod stl;
pub(crate) mod text;
pub mod tileset;

use crate::scene::Scene;

/// A file format, by its usual extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// Wavefront OBJ, with MTL.
    Obj,
    /// glTF 2.0, JSON with buffers beside it or in data URIs.
    Gltf,
    /// glTF 2.0, binary.
    Glb,
    /// Stanford PLY.
    Ply,
    /// STL, binary when written.
    Stl,
    /// OFF.
    Off,
    /// Progressive meshes: our own, or (to read) Hoppe's. [`pm`] reads them at any detail, [`decode`] at full; [`encode`] does not write them,
    /// because a plain mesh has no splits: [`crate::pipeline::build_progressive`] makes some.
    Pm,
}

/// Finds files that a file names: MTL, textures, buffers.
pub trait Side {
    /// The bytes of the file that is called `name` in the file being read.
    fn load(&self, name: &str) -> std::io::Result<Vec<u8>>;
}

/// No side files: every request fails.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoSide;

impl Side for NoSide {
    fn load(&self, name: &str) -> std::io::Result<Vec<u8>> {
        Err(std::io::Error::new(std::io::ErrorKind::NotFound, format!("{name}: no files beside this input")))
    }
}

/// A file read.
#[derive(Clone, Debug, Default)]
pub struct Decoded {
    /// Its content.
    pub scene: Scene,
    /// What was changed, or left out, on the way in; each said once, whole sentences without a final stop.
    pub warnings: Vec<String>,
}

/// A file to write.
#[derive(Clone, Debug, Default)]
pub struct Encoded {
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// Files beside it (MTL, textures, buffers): name relative to it, and bytes.
    pub side: Vec<(String, Vec<u8>)>,
    /// What the format cannot hold; each said once.
    pub warnings: Vec<String>,
}

/// Options of all encoders.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct EncodeOptions {
    /// Text instead of binary, where the format has both (PLY, STL).
    pub text: bool,
    /// Stem of the output file, for the names of files beside it.
    pub stem: String,
    /// Text gives positions with all their digits, not only as many as f32 needs: read as f64 they are what they were, where shorter ones are a
    /// little beside it.
    pub all_digits: bool,
    /// Images are not part of the output: glTF refers to them by their URIs, which must lead to them from the output.
    pub link_images: bool,
}

/// Why a file could not be decoded. The file's name is added by whoever opened it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// A text file is wrong at a line. Lines count from 1.
    #[error("line {line}: {what}")]
    Line {
        /// The line, from 1.
        line: usize,
        /// What is wrong, and what would be right.
        what: String,
    },
    /// A binary file is wrong at a byte.
    #[error("byte {offset}: {what}")]
    Byte {
        /// Offset from the start of the file.
        offset: usize,
        /// What is wrong, and what would be right.
        what: String,
    },
    /// A named element is wrong (`meshes[2].primitives[0]`, `face 17`, `header`).
    #[error("{element}: {what}")]
    Element {
        /// The element.
        element: String,
        /// What is wrong, and what would be right.
        what: String,
    },
    /// The file needs something this reader does not have (a required glTF extension, a codec).
    #[error("needs {what}, which is not supported")]
    Unsupported {
        /// Its name.
        what: String,
    },
    /// A progressive mesh file is damaged, or not one.
    #[error(transparent)]
    Progressive(#[from] crate::refine::format::FormatError),
    /// A file beside it could not be read.
    #[error("{name}: {why}")]
    Side {
        /// The name in the file.
        name: String,
        /// What the system said.
        why: String,
    },
}

/// Why a scene could not be encoded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The format cannot hold this at all.
    #[error("{format:?} cannot hold {what}")]
    CannotHold {
        /// The format.
        format: Format,
        /// What.
        what: String,
    },
}

impl Format {
    /// The format of a file name, by its extension.
    pub fn from_name(name: &str) -> Option<Self> {
        let (_, extension) = name.rsplit_once('.')?;
        Some(match extension.to_ascii_lowercase().as_str() {
            "obj" => Format::Obj,
            "gltf" => Format::Gltf,
            "glb" => Format::Glb,
            "ply" => Format::Ply,
            "stl" => Format::Stl,
            "off" => Format::Off,
            "pm" => Format::Pm,
            _ => return None,
        })
    }

    /// The format that a file's first bytes tell of beyond doubt: that of GLB, PLY, OFF, glTF, PM. OBJ and STL have no mark.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        match text {
            [b'g', b'l', b'T', b'F', ..] => Some(Format::Glb),
            [b'p', b'l', b'y', b'\n' | b'\r', ..] => Some(Format::Ply),
            [b'O', b'F', b'F', b'\n' | b'\r' | b' ', ..] => Some(Format::Off),
            _ if pm::looks_like(bytes) => Some(Format::Pm),
            _ if text.trim_ascii_start().first() == Some(&b'{') => Some(Format::Gltf),
            _ => None,
        }
    }

    /// The usual extension, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Format::Obj => "obj",
            Format::Gltf => "gltf",
            Format::Glb => "glb",
            Format::Ply => "ply",
            Format::Stl => "stl",
            Format::Off => "off",
            Format::Pm => "pm",
        }
    }
}

/// Decodes a file's bytes.
///
/// Never panics, whatever the bytes; allocates in proportion to them.
pub fn decode(format: Format, bytes: &[u8], side: &dyn Side) -> Result<Decoded, DecodeError> {
    match format {
        Format::Obj => obj::decode(bytes, side),
        Format::Gltf | Format::Glb => gltf::decode(bytes, side),
        Format::Ply => ply::decode(bytes, side),
        Format::Stl => stl::decode(bytes),
        Format::Off => off::decode(bytes),
        Format::Pm => pm::decode(bytes),
    }
}

/// Encodes a scene. Texture coordinates are turned over where the format's run the other way than the scene's.
pub fn encode(format: Format, scene: &Scene, options: &EncodeOptions) -> Result<Encoded, EncodeError> {
    let mut encoded = match format {
        Format::Obj => obj::encode(scene, options),
        Format::Gltf | Format::Glb => gltf::encode(scene, format, options),
        Format::Ply => ply::encode(scene, options),
        Format::Stl => stl::encode(scene, options),
        Format::Off => off::encode(scene, options),
        Format::Pm => {
            let what = "a mesh without splits; make them first (`encode` does)".into();
            Err(EncodeError::CannotHold { format, what })
        }
    }?;
    let one = scene.instance_counts().iter().sum::<usize>() == 1;
    if format != Format::Ply || !one {
        encoded.warnings.extend(lost_extras(scene, format));
    }
    Ok(encoded)
}

/// What only a PLY file of one mesh holds, if the scene has such.
fn lost_extras(scene: &Scene, format: Format) -> Vec<String> {
    let used = |m: &&crate::scene::SceneMesh| !m.geometry.face_row.is_empty();
    let names: std::collections::BTreeSet<&str> = scene
        .meshes
        .iter()
        .filter(used)
        .flat_map(|m| m.extras.of_faces.iter().map(|v| v.name.as_str()))
        .collect();
    let loose: usize = scene.meshes.iter().map(|m| m.extras.loose.vertices.len()).sum();
    let mut said = Vec::new();
    if !names.is_empty() {
        let names: Vec<&str> = names.into_iter().collect();
        said.push(format!(
            "the values of faces {} are left out: {} cannot hold them",
            names.join(", "),
            format.extension()
        ));
    }
    said.extend(crate::pipeline::left_loose(loose));
    said
}
