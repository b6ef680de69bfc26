//! `--heatmap`: where one mesh is far from another.

use super::Failure;
use super::common::{self, Warnings};
use super::control::Interrupt;
use progmesh::compare::{Comparison, Flattened, Pair, heat_page, heat_picture, heat_scene};
use progmesh::io::{Format, files};
use progmesh::report::{Scale, Surface};
use progmesh::scene::Scene;
use serde_json::json;
use std::path::{Path, PathBuf};

/// What to write, by the ending of its name.
#[derive(Clone, Debug)]
pub(crate) enum Target {
    /// The mesh in colours.
    Mesh(PathBuf, Format),
    /// A picture.
    Png(PathBuf),
    /// A page.
    Html(PathBuf),
}

impl Target {
    /// A path whose name says one of the kinds there are.
    pub(crate) fn parse(text: &str) -> Result<Target, String> {
        let path = PathBuf::from(text);
        let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match ending.as_deref() {
            Some("ply") => Ok(Target::Mesh(path, Format::Ply)),
            Some("glb") => Ok(Target::Mesh(path, Format::Glb)),
            Some("png") => Ok(Target::Png(path)),
            Some("html" | "htm") => Ok(Target::Html(path)),
            _ => Err("the name must end in .ply or .glb (a mesh), .png (a picture) or .html (a page)".into()),
        }
    }

    pub(crate) fn path(&self) -> &Path {
        match self {
            Target::Mesh(p, _) | Target::Png(p) | Target::Html(p) => p,
        }
    }
}

/// Two meshes compared, to be shown.
pub(crate) struct Heat<'a> {
    pub(crate) scenes: [&'a Scene; 2],
    pub(crate) flattened: [&'a Flattened; 2],
    pub(crate) names: [&'a str; 2],
    pub(crate) found: &'a Comparison,
    /// The distance of the last colour, if not left to us.
    pub(crate) top: Option<f64>,
}

impl Heat<'_> {
    /// Writes all targets, each all or nothing.
    pub(crate) fn write(
        &self,
        targets: &[Target],
        interrupt: &Interrupt,
        warnings: &mut Warnings,
    ) -> Result<(), Failure> {
        let mut scale = self.found.heat_scale();
        scale.top = self.top.unwrap_or(scale.top);
        let mut drawn = None;
        for target in targets {
            let failed = |why: String| Failure::Output(format!("{}: {why}", target.path().display()));
            let bytes = match target {
                Target::Mesh(path, format) => {
                    self.write_mesh(path, *format, &scale, interrupt, warnings)?;
                    continue;
                }
                Target::Png(_) | Target::Html(_) => {
                    if drawn.is_none() {
                        drawn = Some([self.surface(0)?, self.surface(1)?]);
                    }
                    let Some([a, b]) = &drawn else { continue };
                    let names = self.names.map(file_name);
                    let pair = Pair { drawn: [a, b], b: &self.flattened[1].surface, names, scale: &scale };
                    match target {
                        Target::Html(_) => heat_page(&pair, &self.found.tables()).html().into_bytes(),
                        _ => heat_picture(&pair)
                            .png()
                            .ok_or_else(|| failed("the picture could not be encoded".into()))?,
                    }
                }
            };
            if interrupt.is_set() {
                return Err(Failure::Interrupted);
            }
            files::write_file(target.path(), &bytes).map_err(|e| failed(e.to_string()))?;
        }
        Ok(())
    }

    fn surface(&self, k: usize) -> Result<Surface, Failure> {
        Surface::of(self.scenes[k]).map_err(|e| Failure::Input(format!("{}: {e}", self.names[k])))
    }

    fn write_mesh(
        &self,
        path: &Path,
        format: Format,
        scale: &Scale,
        interrupt: &Interrupt,
        warnings: &mut Warnings,
    ) -> Result<(), Failure> {
        let [a, b] = self.flattened;
        let mut scene = heat_scene(a, &b.surface, scale, format == Format::Glb)
            .map_err(|e| Failure::Output(format!("{}: {e}", path.display())))?;
        let options = files::encode_options(path, false);
        let facts: [(String, serde_json::Value); 8] = [
            ("heatmap".into(), json!("distance of A from B, by vertex, as colour and as attribute quality")),
            ("a".into(), json!(self.names[0])),
            ("b".into(), json!(self.names[1])),
            ("first_color_at".into(), json!(0.0)),
            ("last_color_at".into(), json!(scale.top)),
            ("max_distance".into(), json!(scale.max)),
            ("unit".into(), json!("model units")),
            ("diagonal_of_a".into(), json!(self.found.distances.diagonal)),
        ];
        scene.facts.extend(facts);
        common::write(path, format, &options, &scene, interrupt, warnings)
    }
}

/// The last part of a path: pictures have no room for more.
fn file_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().filter(|n| !n.is_empty()).unwrap_or(path)
}
