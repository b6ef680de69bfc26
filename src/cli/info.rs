//! `progmesh info IN`.

use super::args::{Input, not_negative, weld_rule};
use super::common::{self, Warnings};
use super::picture::PictureArgs;
use super::{Failure, problems};
use progmesh::aif::attributes::{Encoding, Semantic};
use progmesh::aif::{BuildOptions, BuildReport, Mesh, NONE, Weld};
use progmesh::io::files::About;
use progmesh::pipeline::{label, world_bounds};
use progmesh::refine::format::Report;
use progmesh::scene::Scene;
use serde::Serialize;

mod text;

/// Say what a mesh file holds: counts, kinds of vertices and edges, borders, components, genus, attributes, materials, problems.
///
/// Counts are of the unique meshes; an instance counts once. glTF meshes are looked at with vertices of equal positions as one.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh info bunny.obj
  progmesh info scene.glb --json
  progmesh info scan.ply --check && echo valid
  progmesh info part.stl --weld=0.001
  progmesh info bunny.obj --png bunny.png --wireframe

--check ends with exit code 1 if a mesh breaks an invariant, and names the first. A file that holds no mesh at all (an index \
out of range, a coordinate that is not a number) is invalid input: exit code 3, with or without --check.")]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    /// Look at the mesh with vertices at the same place, or within EPS model units, as one
    #[arg(long, value_name = "EPS", num_args = 0..=1, require_equals = true, default_missing_value = "0",
          value_parser = not_negative)]
    weld: Option<f64>,
    /// Verify every invariant; exit code 1 and the first broken one if there is any
    #[arg(long)]
    check: bool,
    /// Print one JSON object (see docs/json.md)
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    picture: PictureArgs,
    /// Say no warnings
    #[arg(long, short)]
    quiet: bool,
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let mut drawing = self.picture.drawing()?;
        let mut warnings = Warnings::new(self.quiet);
        let loaded = self.input.read(&mut warnings)?;
        let file = self.input.name();
        let mut scene = loaded.decoded.scene;
        let options = BuildOptions::with_weld(weld_rule(self.weld));
        let (unique, instanced) = (scene.unique_triangles(), scene.instanced_triangles());
        let world = world_bounds(&scene).map(|(low, high)| [low.to_array(), high.to_array()]);
        // Before the meshes are taken; what is wrong with one is said below, with its name.
        let drawn = drawing.as_mut().map(|d| d.add(&scene));
        let (mut meshes, mut broken) = (Vec::new(), None);
        for i in 0..scene.meshes.len() {
            let label = label(&scene, i);
            let in_file = (scene.meshes[i].geometry.face_count(), scene.meshes[i].triangles());
            let input = std::mem::take(&mut scene.meshes[i].geometry);
            let raw = (self.check && options.weld != Weld::No).then(|| input.clone());
            let (mesh, report) =
                Mesh::build(input, &options).map_err(|e| Failure::Input(format!("{file}: {label}{e}")))?;
            if self.check && broken.is_none() {
                // A face that only welding makes degenerate is no broken invariant of the file.
                let raw = raw.map(|r| Mesh::build(r, &BuildOptions::default())).transpose();
                let raw = raw.map_err(|e| Failure::Input(format!("{file}: {label}{e}")))?;
                let own = raw.as_ref().map_or(&report, |r| &r.1);
                broken = first_broken(&mesh, own).map(|b| format!("{label}{b}"));
            }
            meshes.push(MeshInfo::of(&scene, i, in_file, &mesh, &report));
        }
        drawn.transpose()?;
        if let Some(d) = &mut drawing {
            d.write()?;
        }
        let info = Info {
            command: "info",
            file: file.clone(),
            format: loaded.format.extension(),
            bytes: loaded.bytes,
            nodes: scene.nodes.len(),
            triangles: Triangles { file: unique, built: meshes.iter().map(|m| m.triangles).sum(), instanced },
            bounds: world,
            instances: scene.nodes.iter().filter(|n| n.mesh.is_some()).count(),
            meshes,
            materials: scene.materials.iter().map(|m| m.name.clone()).collect(),
            images: images(&scene),
            progressive: loaded.progressive.as_ref().map(ProgressiveInfo::of),
            check: match (self.check, &broken) {
                (false, _) => None,
                (true, None) => Some("ok".into()),
                (true, Some(b)) => Some(b.clone()),
            },
            warnings: warnings.all,
        };
        if self.json {
            common::print_json(&info)?;
        } else {
            common::print(&common::harmless(&info.text()))?;
        }
        match broken {
            Some(b) => Err(Failure::Missed(format!("{file}: {b}"))),
            None => Ok(()),
        }
    }
}

/// The first invariant that the file's mesh breaks: those that building mends first, then all of [`Mesh::check`].
fn first_broken(mesh: &Mesh, report: &BuildReport) -> Option<String> {
    let faces = problems::broken_faces(report).into_iter().next();
    faces.or_else(|| mesh.check().err().map(|e| e.to_string()))
}

fn images(scene: &Scene) -> Vec<ImageInfo> {
    let image = |i: &progmesh::scene::Image| ImageInfo {
        name: i.name.clone().or_else(|| i.uri.clone()),
        mime: i.mime.clone(),
        bytes: i.data.as_ref().map(Vec::len),
    };
    scene.images.iter().map(image).collect()
}

/// The schema of `info --json`; docs/json.md says what each field means.
#[derive(Serialize)]
struct Info {
    command: &'static str,
    file: String,
    format: &'static str,
    bytes: usize,
    nodes: usize,
    instances: usize,
    triangles: Triangles,
    bounds: Option<[[f64; 3]; 2]>,
    meshes: Vec<MeshInfo>,
    materials: Vec<String>,
    images: Vec<ImageInfo>,
    progressive: Option<ProgressiveInfo>,
    check: Option<String>,
    warnings: Vec<String>,
}

/// What a progressive mesh file holds beside full detail.
#[derive(Serialize)]
struct ProgressiveInfo {
    base_triangles: usize,
    splits: usize,
    levels: usize,
    chunks: Option<u64>,
    quantization_error: Option<f64>,
    streams: Option<Streams>,
}

/// Bytes of the file by what they are for.
#[derive(Serialize)]
struct Streams {
    head: u64,
    base: u64,
    connectivity: u64,
    errors: u64,
    positions: u64,
    attributes: u64,
    faces: u64,
    order: u64,
    scene: u64,
    bounds: u64,
    other: u64,
}

impl ProgressiveInfo {
    fn of(about: &About) -> Self {
        let report = about.report.as_ref();
        let worst = |r: &Report| r.quantisation_errors.iter().copied().fold(0.0, f64::max);
        ProgressiveInfo {
            base_triangles: about.base_triangles,
            splits: about.splits,
            levels: about.levels,
            chunks: report.map(|r| r.streams.chunks),
            quantization_error: report.map(worst).filter(|&e| e > 0.0),
            streams: report.map(|r| Streams {
                head: r.streams.head,
                base: r.streams.base,
                connectivity: r.streams.connectivity,
                errors: r.streams.errors,
                positions: r.streams.places,
                attributes: r.streams.attributes,
                faces: r.streams.faces,
                order: r.streams.order,
                scene: r.streams.scene,
                bounds: r.streams.bounds,
                other: r.streams.other,
            }),
        }
    }
}

/// Triangles of the unique meshes, as the file has them and after building; those of all instances, as the file has them.
#[derive(Serialize)]
struct Triangles {
    file: usize,
    built: usize,
    instanced: usize,
}

#[derive(Serialize)]
struct MeshInfo {
    name: Option<String>,
    file_faces: usize,
    file_triangles: usize,
    vertices: usize,
    edges: usize,
    faces: usize,
    triangles: usize,
    face_sizes: FaceSizes,
    vertex_kinds: VertexKinds,
    edge_kinds: EdgeKinds,
    border_loops: usize,
    components: usize,
    euler: i64,
    genus: Option<usize>,
    manifold: bool,
    closed: bool,
    orientable: bool,
    bounds: Option<[[f64; 3]; 2]>,
    diagonal: f64,
    precision: &'static str,
    attributes: Vec<AttributeInfo>,
    materials: Vec<PartInfo>,
    groups: Vec<PartInfo>,
    aif_bytes: usize,
    problems: Vec<String>,
}

#[derive(Serialize)]
struct FaceSizes {
    triangles: usize,
    quads: usize,
    larger: usize,
}

#[derive(Serialize)]
struct VertexKinds {
    isolated: usize,
    cut: usize,
    dangling: usize,
    complex: usize,
    border: usize,
    interior: usize,
}

#[derive(Serialize)]
struct EdgeKinds {
    isolated: usize,
    dangling: usize,
    border: usize,
    regular: usize,
    complex: usize,
}

#[derive(Serialize)]
struct AttributeInfo {
    name: String,
    width: usize,
    encoding: &'static str,
}

/// A material or a group, and how many faces have it.
#[derive(Serialize)]
struct PartInfo {
    name: String,
    faces: usize,
}

#[derive(Serialize)]
struct ImageInfo {
    name: Option<String>,
    mime: Option<String>,
    bytes: Option<usize>,
}

impl MeshInfo {
    fn of(
        scene: &Scene,
        i: usize,
        (file_faces, file_triangles): (usize, usize),
        mesh: &Mesh,
        report: &BuildReport,
    ) -> Self {
        let source = &scene.meshes[i];
        let t = mesh.topology();
        let kinds = t.count_kinds();
        let sizes = t.faces().map(|f| t.corner_range(f).len());
        let mut face_sizes = FaceSizes { triangles: 0, quads: 0, larger: 0 };
        for n in sizes {
            match n {
                3 => face_sizes.triangles += 1,
                4 => face_sizes.quads += 1,
                _ => face_sizes.larger += 1,
            }
        }
        let bounds = mesh.bounds();
        let attributes = mesh.wedges().map_or(&[][..], |w| w.channels()).iter();
        MeshInfo {
            name: source.name.clone(),
            file_faces,
            file_triangles,
            vertices: mesh.vertex_count(),
            edges: t.edge_count(),
            faces: mesh.face_count(),
            triangles: mesh.triangle_count(),
            face_sizes,
            vertex_kinds: VertexKinds {
                isolated: kinds.isolated_vertices,
                cut: kinds.cut_vertices,
                dangling: kinds.dangling_vertices,
                complex: kinds.complex_vertices,
                border: kinds.border_vertices,
                interior: kinds.interior_vertices,
            },
            edge_kinds: EdgeKinds {
                isolated: kinds.isolated_edges,
                dangling: kinds.dangling_edges,
                border: kinds.border_edges,
                regular: kinds.regular_edges,
                complex: kinds.complex_edges,
            },
            border_loops: t.border_loops().len(),
            components: t.face_components().count,
            euler: t.euler_characteristic(),
            genus: t.genus(),
            manifold: kinds.is_manifold(),
            closed: kinds.is_closed(),
            orientable: t.is_orientable(),
            bounds: bounds.map(|(low, high)| [low.to_array(), high.to_array()]),
            diagonal: bounds.map_or(0.0, |(low, high)| low.distance(high)),
            precision: if mesh.positions().is_f64() { "f64" } else { "f32" },
            attributes: attributes
                .map(|c| AttributeInfo {
                    name: attribute_name(&c.semantic),
                    width: c.width,
                    encoding: encoding_name(c.encoding),
                })
                .collect(),
            materials: parts(mesh.face_materials(), |m| match scene.materials.get(m as usize) {
                Some(material) if !material.name.is_empty() => material.name.clone(),
                _ => format!("material {m}"),
            }),
            groups: parts(mesh.face_groups(), |g| {
                source.groups.get(g as usize).map_or_else(|| format!("group {g}"), |g| g.label())
            }),
            aif_bytes: t.relation_bytes(),
            problems: problems::find(mesh, &kinds, report),
        }
    }
}

/// How many faces have each material (or group), those of none left out; in the order of their numbers.
fn parts(of_face: &[u32], label: impl Fn(u32) -> String) -> Vec<PartInfo> {
    let mut counts = std::collections::BTreeMap::new();
    for &m in of_face.iter().filter(|&&m| m != NONE) {
        *counts.entry(m).or_insert(0usize) += 1;
    }
    counts.into_iter().map(|(m, faces)| PartInfo { name: label(m), faces }).collect()
}

fn attribute_name(s: &Semantic) -> String {
    match s {
        Semantic::Normal => "normal".into(),
        Semantic::Tangent => "tangent".into(),
        Semantic::TexCoord(k) => format!("uv {k}"),
        Semantic::Color(k) => format!("colour {k}"),
        Semantic::Joints(k) => format!("joints {k}"),
        Semantic::Weights(k) => format!("weights {k}"),
        Semantic::MorphPosition(k) => format!("morph target {k} position"),
        Semantic::MorphNormal(k) => format!("morph target {k} normal"),
        Semantic::MorphTangent(k) => format!("morph target {k} tangent"),
        Semantic::Custom(name) => name.clone(),
    }
}

fn encoding_name(e: Encoding) -> &'static str {
    match e {
        Encoding::F32 => "f32",
        Encoding::F64 => "f64",
        Encoding::U8 => "u8",
        Encoding::U8Norm => "u8 normalized",
        Encoding::I8 => "i8",
        Encoding::I8Norm => "i8 normalized",
        Encoding::U16 => "u16",
        Encoding::U16Norm => "u16 normalized",
        Encoding::I16 => "i16",
        Encoding::I16Norm => "i16 normalized",
        Encoding::U32 => "u32",
        Encoding::I32 => "i32",
    }
}
