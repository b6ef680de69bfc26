//! The scene around progressive meshes, as bytes: what the `SCNE` chunk of a `.pm` holds (FORMAT.md, appendix).
//!
//! A u32 (little-endian) gives the length of a JSON object, which follows; then come the bytes that the object refers to by `[offset, length]`,
//! offsets counted from the end of the object. Geometry is not here: it is in the meshes' own chunks.

use crate::io::DecodeError;
use crate::io::gltf::{Source, SurfaceTable};
use crate::progressive::Leftover;
use crate::scene::{Group, Image, Material, Node, Scene, SceneMesh};
use glam::{DMat4, DVec3};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Where bytes are: offset and length.
type Span = (u64, u64);

#[derive(Serialize, Deserialize)]
struct Shell<'a> {
    meshes: Vec<MeshShell<'a>>,
    nodes: Vec<NodeShell<'a>>,
    roots: Vec<usize>,
    materials: Vec<MaterialShell<'a>>,
    images: Vec<ImageShell<'a>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    gltf: Option<GltfShell>,
    #[serde(default, skip_serializing_if = "serde_json::Map::is_empty")]
    facts: serde_json::Map<String, serde_json::Value>,
}

#[derive(Serialize, Deserialize)]
struct MeshShell<'a> {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    name: Option<Cow<'a, str>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    groups: Vec<GroupShell<'a>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    leftover: Option<LeftoverShell>,
    /// Six f64: least and greatest coordinates at full detail.
    #[serde(default, rename = "box", skip_serializing_if = "Option::is_none")]
    extent: Option<Span>,
}

/// Least and greatest coordinates of a mesh.
pub type Extent = (DVec3, DVec3);

/// Faces that no mesh can hold: where the arrays of [`Leftover`] are, little-endian.
#[derive(Serialize, Deserialize)]
struct LeftoverShell {
    faces: Span,
    sizes: Span,
    mended: Span,
    corners: Span,
    wedges: Span,
    present: Span,
    rows: Span,
    materials: Span,
    groups: Span,
}

#[derive(Serialize, Deserialize)]
struct GroupShell<'a> {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    object: Option<Cow<'a, str>>,
    #[serde(default, skip_serializing_if = "<[String]>::is_empty")]
    names: Cow<'a, [String]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    smoothing: Option<Cow<'a, str>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    primitive: Option<u32>,
}

#[derive(Serialize, Deserialize)]
struct NodeShell<'a> {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    name: Option<Cow<'a, str>>,
    /// Column after column; left out for the identity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    transform: Option<[f64; 16]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    mesh: Option<usize>,
    #[serde(default, skip_serializing_if = "<[usize]>::is_empty")]
    children: Cow<'a, [usize]>,
}

#[derive(Serialize, Deserialize)]
struct MaterialShell<'a> {
    name: Cow<'a, str>,
    base_color: [f32; 4],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    base_color_image: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    normal_image: Option<usize>,
    metallic: f32,
    roughness: f32,
    emissive: [f32; 3],
    double_sided: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    mtl: Option<Cow<'a, str>>,
}

#[derive(Serialize, Deserialize)]
struct ImageShell<'a> {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    name: Option<Cow<'a, str>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    uri: Option<Cow<'a, str>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    mime: Option<Cow<'a, str>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    data: Option<Span>,
}

/// The glTF document that the scene came from, without its surfaces.
#[derive(Serialize, Deserialize)]
struct GltfShell {
    /// JSON text.
    document: Span,
    /// The bytes of its buffer views.
    binary: Span,
    /// For every mesh and primitive what it held, if it is a surface: attribute names, number of morph targets.
    surfaces: SurfaceTable,
}

/// The error of a named part.
pub(super) fn wrong(element: &str, what: impl Into<String>) -> DecodeError {
    DecodeError::Element { element: element.into(), what: what.into() }
}

/// A scene without the geometry of its meshes as bytes, with the faces that their meshes cannot hold and, as far as they are given, the boxes of the meshes at full detail: who reads the file in parts cannot
/// know these.
pub fn write_shell(scene: &Scene, leftovers: &[Leftover], boxes: &[Option<Extent>]) -> Vec<u8> {
    let mut bytes: Vec<u8> = Vec::new();
    let mut keep = |data: &[u8]| -> Span {
        let at = bytes.len() as u64;
        bytes.extend_from_slice(data);
        (at, data.len() as u64)
    };
    // JSON has no NaN and no infinity.
    let finite = |x: f32| if x.is_finite() { x } else { 0.0 };
    let text = |s: &'_ Option<String>| s.clone().map(Cow::Owned);
    let shell = Shell {
        meshes: scene
            .meshes
            .iter()
            .enumerate()
            .map(|(i, m)| MeshShell {
                leftover: leftovers.get(i).filter(|l| !l.is_empty()).map(|l| {
                    let mut words = |a: &[u32]| keep(&bytes_of(a, |x| x.to_le_bytes()));
                    LeftoverShell {
                        faces: words(&l.faces),
                        sizes: words(&l.sizes),
                        mended: words(&l.mended),
                        corners: words(&l.corners),
                        wedges: words(&l.wedges),
                        materials: words(&l.materials),
                        groups: words(&l.groups),
                        present: keep(&bytes_of(&l.present, |x| x.to_le_bytes())),
                        rows: keep(&bytes_of(&l.rows, |x| x.to_le_bytes())),
                    }
                }),
                extent: boxes.get(i).copied().flatten().map(|(lo, hi)| {
                    let all: Vec<f64> = lo.to_array().into_iter().chain(hi.to_array()).collect();
                    keep(&bytes_of(&all, f64::to_le_bytes))
                }),
                name: text(&m.name),
                groups: m
                    .groups
                    .iter()
                    .map(|g| GroupShell {
                        object: text(&g.object),
                        names: Cow::Borrowed(&g.names),
                        smoothing: text(&g.smoothing),
                        primitive: g.primitive,
                    })
                    .collect(),
            })
            .collect(),
        nodes: scene
            .nodes
            .iter()
            .map(|n| NodeShell {
                name: text(&n.name),
                transform: Some(n.transform.to_cols_array())
                    .filter(|t| n.transform != DMat4::IDENTITY && t.iter().all(|x| x.is_finite())),
                mesh: n.mesh,
                children: Cow::Borrowed(&n.children),
            })
            .collect(),
        roots: scene.roots.clone(),
        materials: scene
            .materials
            .iter()
            .map(|m| MaterialShell {
                name: Cow::Borrowed(&m.name),
                base_color: m.base_color.map(finite),
                base_color_image: m.base_color_image,
                normal_image: m.normal_image,
                metallic: finite(m.metallic),
                roughness: finite(m.roughness),
                emissive: m.emissive.map(finite),
                double_sided: m.double_sided,
                mtl: text(&m.mtl),
            })
            .collect(),
        images: scene
            .images
            .iter()
            .map(|i| ImageShell {
                name: text(&i.name),
                uri: text(&i.uri),
                mime: text(&i.mime),
                data: i.data.as_deref().map(&mut keep),
            })
            .collect(),
        gltf: scene.gltf.as_ref().map(|source| GltfShell {
            // A document is JSON already: nothing in it can fail to be written.
            document: keep(&serde_json::to_vec(source.document()).unwrap_or_default()),
            binary: keep(source.binary()),
            surfaces: source.surface_table(),
        }),
        facts: scene.facts.clone(),
    };
    let json = serde_json::to_vec(&shell).unwrap_or_default();
    let mut out = (json.len() as u32).to_le_bytes().to_vec();
    out.extend_from_slice(&json);
    out.extend_from_slice(&bytes);
    out
}

fn bytes_of<T: Copy, const N: usize>(values: &[T], bytes: impl Fn(T) -> [u8; N]) -> Vec<u8> {
    values.iter().flat_map(|&x| bytes(x)).collect()
}

fn values_of<T, const N: usize>(bytes: &[u8], value: impl Fn([u8; N]) -> T) -> Vec<T> {
    bytes.as_chunks::<N>().0.iter().map(|&b| value(b)).collect()
}

/// What stands around meshes.
#[derive(Clone, Debug, Default)]
pub struct Shelled {
    /// The meshes have no geometry.
    pub scene: Scene,
    /// Faces that the meshes cannot hold; empty if there are none.
    pub leftovers: Vec<Leftover>,
    /// Boxes of the meshes at full detail, where they were written.
    pub boxes: Vec<Option<Extent>>,
}

/// What [`write_shell`] wrote: the scene, whose meshes have no geometry, the leftovers, and the boxes.
///
/// Errors: boxes that are none; what is not as [`write_shell`] writes it; indices of what is not there; nodes that are no forest.
pub fn read_shell(bytes: &[u8]) -> Result<Shelled, DecodeError> {
    let short = || wrong("scene", "ends too early");
    let (length, rest) = bytes.split_first_chunk::<4>().ok_or_else(short)?;
    let (json, data) = rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or_else(short)?;
    let shell: Shell<'_> = serde_json::from_slice(json).map_err(|e| wrong("scene", e.to_string()))?;
    let span = |(at, length): Span| -> Result<&[u8], DecodeError> {
        let end = at.checked_add(length).filter(|&e| e <= data.len() as u64).ok_or_else(short)?;
        Ok(&data[at as usize..end as usize])
    };
    let owned = |s: Option<Cow<'_, str>>| s.map(Cow::into_owned);
    let mut scene = Scene { roots: shell.roots, facts: shell.facts, ..Default::default() };
    let (mut leftovers, mut boxes) = (Vec::new(), Vec::new());
    for (i, m) in shell.meshes.into_iter().enumerate() {
        let extent = m.extent.map(|s| -> Result<Extent, DecodeError> {
            let none = || wrong(&format!("mesh {i}"), "its box is none");
            let all = values_of(span(s)?, f64::from_le_bytes);
            let [a, b, c, x, y, z] = all[..].try_into().map_err(|_| none())?;
            let (lo, hi) = (DVec3::new(a, b, c), DVec3::new(x, y, z));
            // Not the comparison turned round: NaN is none.
            if lo.is_finite() && hi.is_finite() && lo.cmple(hi).all() { Ok((lo, hi)) } else { Err(none()) }
        });
        boxes.push(extent.transpose()?);
        let left = m.leftover.map(|l| -> Result<Leftover, DecodeError> {
            let words = |s: Span| Ok::<_, DecodeError>(values_of(span(s)?, u32::from_le_bytes));
            Ok(Leftover {
                faces: words(l.faces)?,
                sizes: words(l.sizes)?,
                mended: words(l.mended)?,
                corners: words(l.corners)?,
                wedges: words(l.wedges)?,
                materials: words(l.materials)?,
                groups: words(l.groups)?,
                present: values_of(span(l.present)?, u64::from_le_bytes),
                rows: values_of(span(l.rows)?, f32::from_le_bytes),
            })
        });
        leftovers.push(left.transpose()?.unwrap_or_default());
        let groups = m.groups.into_iter().map(|g| Group {
            object: owned(g.object),
            names: g.names.into_owned(),
            smoothing: owned(g.smoothing),
            primitive: g.primitive,
        });
        scene.meshes.push(SceneMesh {
            name: owned(m.name),
            geometry: Default::default(),
            groups: groups.collect(),
            extras: Default::default(),
        });
    }
    for n in shell.nodes {
        scene.nodes.push(Node {
            name: owned(n.name),
            transform: n.transform.map_or(DMat4::IDENTITY, |t| DMat4::from_cols_array(&t)),
            mesh: n.mesh,
            children: n.children.into_owned(),
        });
    }
    for m in shell.materials {
        scene.materials.push(Material {
            name: m.name.into_owned(),
            base_color: m.base_color,
            base_color_image: m.base_color_image,
            normal_image: m.normal_image,
            metallic: m.metallic,
            roughness: m.roughness,
            emissive: m.emissive,
            double_sided: m.double_sided,
            mtl: owned(m.mtl),
        });
    }
    for i in shell.images {
        let data = i.data.map(span).transpose()?.map(<[u8]>::to_vec);
        scene.images.push(Image { name: owned(i.name), uri: owned(i.uri), mime: owned(i.mime), data });
    }
    if let Some(g) = shell.gltf {
        let document = serde_json::from_slice(span(g.document)?)
            .map_err(|e| wrong("scene", format!("its glTF document: {e}")))?;
        let source = Source::from_table(document, span(g.binary)?.to_vec(), g.surfaces);
        scene.gltf = Some(Box::new(source.ok_or_else(|| wrong("scene", "its glTF document is no object"))?));
    }
    check(&scene)?;
    if leftovers.iter().all(Leftover::is_empty) {
        leftovers.clear();
    }
    Ok(Shelled { scene, leftovers, boxes })
}

/// Indices lead somewhere, and the nodes are a forest of the roots.
fn check(scene: &Scene) -> Result<(), DecodeError> {
    let all = |found: Option<usize>, n: usize| found.is_none_or(|i| i < n);
    for (i, n) in scene.nodes.iter().enumerate() {
        if !all(n.mesh, scene.meshes.len()) {
            return Err(wrong(&format!("scene, node {i}"), "shows a mesh that is not there"));
        }
    }
    for (i, m) in scene.materials.iter().enumerate() {
        if !all(m.base_color_image, scene.images.len()) || !all(m.normal_image, scene.images.len()) {
            return Err(wrong(&format!("scene, material {i}"), "has an image that is not there"));
        }
    }
    let mut seen = vec![false; scene.nodes.len()];
    let mut stack = scene.roots.clone();
    while let Some(n) = stack.pop() {
        match seen.get_mut(n) {
            Some(s) if !*s => *s = true,
            _ => return Err(wrong("scene", format!("node {n} is not there, or has two parents"))),
        }
        stack.extend(&scene.nodes[n].children);
    }
    match seen.iter().position(|s| !s) {
        Some(n) => Err(wrong("scene", format!("node {n} belongs to no root"))),
        None => Ok(()),
    }
}
