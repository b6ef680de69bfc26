//! `--normals`, `--uv`, `--texture`: what vertices have beside their places.

use crate::cli::Failure;
use progmesh::ground::{Drape, Dress, Space};
use progmesh::io::files;
use progmesh::io::grid::GridFile;
use progmesh::scene::Image;
use std::path::PathBuf;

#[derive(clap::Args, Debug)]
pub(crate) struct DressArgs {
    /// Write the normals of the grid in grid space too; in world space they are always written
    #[arg(long, help_heading = "Surface")]
    normals: bool,
    /// Write texture coordinates for a picture laid over the whole grid
    ///
    /// It covers the cells about the samples, or, where the file places samples as points, the grid from its first to its last samples.
    #[arg(long, help_heading = "Surface")]
    uv: bool,
    /// The picture itself, PNG or JPEG: into GLB, beside OBJ, PLY and glTF
    #[arg(long, value_name = "IMAGE", help_heading = "Surface")]
    texture: Option<PathBuf>,
}

impl DressArgs {
    /// Whether a picture, or a place for one, was asked for.
    pub(crate) fn drapes(&self) -> bool {
        self.uv || self.texture.is_some()
    }

    /// Reads the picture.
    pub(crate) fn dress(&self, space: Space, source: &GridFile) -> Result<Dress, Failure> {
        let image = self.texture.as_ref().map(|path| {
            let failed = |what: String| Failure::Input(format!("{}: {what}", path.display()));
            let data = files::read_all(path).map_err(|e| failed(e.to_string()))?;
            let mime = match data[..] {
                [0x89, b'P', b'N', b'G', ..] => "image/png",
                [0xff, 0xd8, 0xff, ..] => "image/jpeg",
                _ => return Err(failed("a texture must be a PNG or a JPEG picture".into())),
            };
            let name = path.file_name().map(|n| n.to_string_lossy().into_owned());
            Ok(Image { name: None, uri: name, mime: Some(mime.into()), data: Some(data) })
        });
        let image = image.transpose()?;
        let covers = source.georeference.sample_at;
        let drape = (self.uv || image.is_some()).then_some(Drape { covers, image });
        Ok(Dress { normals: self.normals || space != Space::Grid, drape })
    }
}
