//! `--png`, `--wireframe`: pictures.

use super::{Failure, common};
use progmesh::io::files;
use progmesh::report::{Picture, Style, Surface, View, render};
use progmesh::scene::Scene;
use std::path::PathBuf;
use std::time::Instant;

/// `--png`, `--wireframe`: a picture.
#[derive(clap::Args, Debug)]
pub(crate) struct PictureArgs {
    /// Draw a picture to this PNG file (with simplify, clip and cull: input and result side by side, with lod all levels, from the same camera)
    ///
    /// Material base colours and the mesh's normals; no textures.
    #[arg(long, value_name = "FILE.png", value_parser = png_name, help_heading = "Picture")]
    png: Option<PathBuf>,
    /// With --png: draw the edges of the faces too
    #[arg(long, requires = "png", help_heading = "Picture")]
    wireframe: bool,
}

/// Sides of each picture, pixels.
const PICTURE: (u32, u32) = (480, 368);
/// Rows below it for the caption, where no mesh is drawn.
const CAPTION: u32 = 32;
const WHITE: [u8; 3] = [255; 3];

/// Pictures under way: all from the camera of the first.
pub(crate) struct Drawing {
    path: PathBuf,
    style: Style,
    view: Option<View>,
    pictures: Vec<Picture>,
    /// The time that drawing took so far.
    pub(crate) seconds: f64,
}

/// A name that does not promise another kind of picture.
pub(crate) fn png_name(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if files::is_dash(&path) {
        return Err("write the picture to a path, not to standard output".into());
    }
    match path.extension() {
        Some(e) if !e.eq_ignore_ascii_case("png") => {
            Err("pictures are PNG: the name must end in .png".into())
        }
        _ => Ok(path),
    }
}

impl PictureArgs {
    /// A drawing if one is asked for. Fails, before any work is done, where it could not be written.
    pub(crate) fn drawing(&self) -> Result<Option<Drawing>, Failure> {
        let Some(path) = self.png.clone() else { return Ok(None) };
        common::check_target(&path)?;
        let mut style = Style::default();
        style.wireframe = self.wireframe;
        Ok(Some(Drawing { path, style, view: None, pictures: vec![], seconds: 0.0 }))
    }
}

impl Drawing {
    /// Draws what follows as this view sees it.
    pub(crate) fn through(&mut self, view: View) {
        self.view = Some(view);
    }

    /// Draws a scene, to the right of those before. One that cannot be drawn is an output that failed, whatever command asked for it.
    pub(crate) fn add(&mut self, scene: &Scene) -> Result<(), Failure> {
        let start = Instant::now();
        let surface = Surface::of(scene).map_err(|e| self.failed(e))?;
        let (width, height) = PICTURE;
        let first = || View::three_quarter(surface.bounds(), width, height).tightened(&surface);
        let view = self.view.get_or_insert_with(first);
        let mut picture = render(&surface, view, &self.style).with_strip_below(CAPTION, WHITE);
        picture.caption(&caption(surface.triangle_count(), scene.unique_triangles()), [64; 3]);
        self.pictures.push(picture);
        self.seconds += start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Writes the file, all or nothing.
    pub(crate) fn write(&mut self) -> Result<(), Failure> {
        let start = Instant::now();
        let bytes = Picture::beside(&self.pictures, WHITE).png();
        let bytes = bytes.ok_or_else(|| self.failed("the picture could not be encoded"))?;
        common::write_bytes(&self.path, &bytes)?;
        self.seconds += start.elapsed().as_secs_f64();
        Ok(())
    }

    fn failed(&self, why: impl std::fmt::Display) -> Failure {
        Failure::Output(format!("{}: {why}", self.path.display()))
    }
}

/// Makes a directory for pictures, if it is not there.
pub(crate) fn make_directory(path: &std::path::Path) -> Result<(), Failure> {
    std::fs::create_dir_all(path).map_err(|e| Failure::Output(format!("{}: {e}", path.display())))
}

/// What is shown may be more than the file holds, for instances count each; or less, for a mesh may be shown by no node.
fn caption(shown: usize, unique: usize) -> String {
    let what = if shown == 1 { "triangle" } else { "triangles" };
    let how = match shown.cmp(&unique) {
        std::cmp::Ordering::Less => " shown",
        std::cmp::Ordering::Equal => "",
        std::cmp::Ordering::Greater => " instanced",
    };
    format!("{} {what}{how}", common::thousands(shown))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_caption_says_what_it_counts() {
        assert_eq!(caption(1, 1), "1 triangle");
        assert_eq!(caption(121_496, 75_730), "121,496 triangles instanced");
        assert_eq!(caption(2, 3), "2 triangles shown");
    }

    #[test]
    fn a_scene_that_cannot_be_drawn_is_an_output_that_failed() {
        let arguments = PictureArgs { png: Some("shot.png".into()), wireframe: false };
        let mut drawing = arguments.drawing().unwrap().unwrap();
        let mut mesh = progmesh::scene::SceneMesh::default();
        mesh.geometry.corners = vec![0, 1, 2];
        let failure = drawing.add(&Scene::from_mesh(mesh)).unwrap_err();
        assert_eq!(failure.code(), 4);
        assert!(failure.message().is_some_and(|m| m.starts_with("shot.png: mesh 0: ")));
    }

    #[test]
    fn names_of_other_kinds_are_refused() {
        assert!(png_name("a.jpg").is_err() && png_name("-").is_err());
        assert!(png_name("a.PNG").is_ok() && png_name("a").is_ok() && png_name("x.y/a").is_ok());
    }
}
