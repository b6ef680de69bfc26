//! From a scene to a file: the document patched or made, the data of the meshes, the container.

use super::geometry::{self, Shape};
use super::json::array_mut;
use super::source::Surface;
use super::{container, document, images};
use crate::io::{EncodeError, EncodeOptions, Encoded, Format};
use crate::scene::{Scene, SceneMesh};
use glam::DVec3;
use serde_json::{Map, Value, json};

/// Encodes a scene as `.glb` ([`Format::Glb`]) or as `.gltf` with a `<stem>.bin` beside it.
///
/// With a [`super::Source`] the document stays as it was but for the surfaces of its meshes, which come from `scene.meshes`
/// (meshes beyond the document's are left out, with a warning). Written plain: no quantization, no compression, each
/// vertex once per primitive, indices of 16 bits when they fit. A primitive that has no faces left is left out; of a mesh that has none
/// left a triangle without area stays, so that what refers to the mesh stays valid.
///
/// Positions are f32 in the format: a scene's f64 positions are rounded, and said so; without a `Source`, meshes far from the
/// origin are moved to it and their nodes back.
///
/// Errors: a position that is not finite in f32; more than 4 GiB.
pub fn encode(scene: &Scene, format: Format, options: &EncodeOptions) -> Result<Encoded, EncodeError> {
    let mut writer = Writer::new(format);
    writer.link_images = options.link_images;
    let (mut document, _) = begin(scene, &mut writer)?;
    if let Some(Value::Object(first)) =
        document.pointer_mut("/scenes/0").filter(|_| !options.facts.is_empty())
    {
        let extras = first.entry("extras").or_insert_with(|| json!({}));
        if let Value::Object(extras) = extras {
            extras.extend(options.facts.iter().cloned());
        }
    }
    writer.finish(document, options)
}

/// Where a mesh of a scene is in the document.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    /// Its index there.
    pub(super) index: usize,
    /// By how much its vertices were moved.
    pub(super) offset: DVec3,
}

/// The document of a scene, and where its meshes are in it; what else belongs to the file is in `writer`.
pub(super) fn begin(scene: &Scene, writer: &mut Writer) -> Result<(Value, Vec<Option<Placed>>), EncodeError> {
    let Some(source) = &scene.gltf else { return document::build(scene, writer) };
    let mut document = patch(scene, source, writer)?;
    let mut placed = Vec::new();
    if let Value::Object(document) = &mut document {
        images::place(document, scene, writer);
        let there = document.get("meshes").and_then(Value::as_array).map_or(0, Vec::len);
        let place = |index| (index < there).then_some(Placed { index, offset: DVec3::ZERO });
        placed = (0..scene.meshes.len()).map(place).collect();
    }
    Ok((document, placed))
}

/// The JSON of mesh `m` of `scene` at another level of detail, `mesh`; `None` if nothing is left of it. `document` is what [`begin`] made of
/// `scene`.
pub(super) fn add_level(
    document: &Map<String, Value>,
    scene: &Scene,
    m: usize,
    mesh: &SceneMesh,
    place: &Placed,
    writer: &mut Writer,
) -> Result<Option<Map<String, Value>>, EncodeError> {
    let Some(source) = &scene.gltf else {
        return document::level(mesh, place.offset, scene.materials.len(), writer);
    };
    let materials = document.get("materials").and_then(Value::as_array).map_or(0, Vec::len);
    let original = source.document.get("meshes").and_then(|v| v.get(m)).and_then(Value::as_object);
    let Some(mut json) = original.cloned() else { return Ok(None) };
    let surfaces = source.surfaces.get(m).map_or(&[][..], Vec::as_slice);
    let old = std::mem::take(array_mut(&mut json, "primitives"));
    // Points and lines are no surface, and stay at every level.
    let done = replace_surfaces(old, surfaces, Some(mesh), materials, writer)?;
    let nothing = done.hollow || done.primitives.is_empty();
    *array_mut(&mut json, "primitives") = done.primitives;
    Ok((!nothing).then_some(json))
}

/// The source's document with the scene's meshes.
fn patch(scene: &Scene, source: &super::Source, writer: &mut Writer) -> Result<Value, EncodeError> {
    let mut document = source.document.clone();
    let Some(object) = document.as_object_mut() else {
        return Err(writer.cannot_hold("a document that is no JSON object"));
    };
    writer.binary = source.binary.clone();
    writer.base_view = object.get("bufferViews").and_then(Value::as_array).map_or(0, Vec::len);
    writer.base_accessor = object.get("accessors").and_then(Value::as_array).map_or(0, Vec::len);
    let materials = object.get("materials").and_then(Value::as_array).map_or(0, Vec::len);
    let meshes = array_mut(object, "meshes");
    if scene.meshes.len() > meshes.len() {
        let n = scene.meshes.len() - meshes.len();
        writer.warn(format!("{n} meshes that the document does not have were left out"));
    }
    let (mut lost, mut hollow) = (0, 0);
    for (m, json) in meshes.iter_mut().enumerate() {
        let Some(mesh) = json.as_object_mut() else { continue };
        let surfaces = source.surfaces.get(m).map_or(&[][..], Vec::as_slice);
        let old = std::mem::take(array_mut(mesh, "primitives"));
        let done = replace_surfaces(old, surfaces, scene.meshes.get(m), materials, writer)?;
        lost += done.lost;
        hollow += done.hollow as usize;
        *array_mut(mesh, "primitives") = done.primitives;
    }
    if lost > 0 {
        writer.warn(format!("{lost} primitives have no faces left and were left out; their materials stay"));
    }
    if hollow > 0 {
        writer.warn(format!("{hollow} meshes have no faces left; a triangle without area stands for each"));
    }
    if meshes.is_empty() {
        object.shift_remove("meshes");
    }
    Ok(document)
}

/// The primitives of a mesh with new surfaces.
struct Replaced {
    primitives: Vec<Value>,
    /// Primitives that have no faces left.
    lost: usize,
    /// Nothing was left: a triangle without area stands for all.
    hollow: bool,
}

/// Puts the surfaces of `mesh` in the place of those of a document's primitives.
fn replace_surfaces(
    old: Vec<Value>,
    surfaces: &[Option<Surface>],
    mesh: Option<&SceneMesh>,
    materials: usize,
    writer: &mut Writer,
) -> Result<Replaced, EncodeError> {
    let targets = surfaces.iter().flatten().map(|s| s.targets).max().unwrap_or(0);
    let mut written = match mesh {
        Some(mesh) => geometry::primitives(mesh, targets, false, writer)?,
        None => Vec::new(),
    };
    let mut out = Replaced { primitives: Vec::new(), lost: 0, hollow: false };
    let mut template = None;
    for (p, primitive) in old.into_iter().enumerate() {
        let Some(surface) = surfaces.get(p).and_then(Option::as_ref) else {
            out.primitives.push(primitive);
            continue;
        };
        let mut found = false;
        for part in written.extract_if(.., |w| w.group == Some(p as u32) && w.shape == Shape::Triangles) {
            out.primitives
                .push(part.into_json(primitive.as_object().cloned().unwrap_or_default(), materials));
            found = true;
        }
        out.lost += !found as usize;
        template.get_or_insert((primitive, surface));
    }
    // Faces of no primitive of the document, and wires.
    out.primitives.extend(written.into_iter().map(|w| w.into_json(Map::new(), materials)));
    if out.primitives.is_empty()
        && let Some((primitive, surface)) = template
    {
        out.hollow = true;
        let body = primitive.as_object().cloned().unwrap_or_default();
        out.primitives
            .push(geometry::hollow(&surface.attributes, surface.targets, writer).into_json(body, materials));
    }
    Ok(out)
}

/// Collects accessors, buffer views and bytes.
pub(super) struct Writer {
    pub(super) format: Format,
    pub(super) binary: Vec<u8>,
    pub(super) base_view: usize,
    pub(super) base_accessor: usize,
    /// Images are referred to, and not put into the file or beside it.
    pub(super) link_images: bool,
    pools: Vec<Pool>,
    accessors: Vec<Value>,
    side: Vec<(String, Vec<u8>)>,
    warnings: Vec<String>,
}

/// A buffer view in the making.
struct Pool {
    kind: PoolKind,
    bytes: Vec<u8>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum PoolKind {
    /// Indices of this many bytes.
    Indices(usize),
    /// Vertex attributes, this many bytes from one vertex to the next.
    Attributes(usize),
    /// An image.
    Image,
}

impl Writer {
    pub(super) fn new(format: Format) -> Self {
        Writer {
            format,
            binary: Vec::new(),
            base_view: 0,
            base_accessor: 0,
            link_images: false,
            pools: Vec::new(),
            accessors: Vec::new(),
            side: Vec::new(),
            warnings: Vec::new(),
        }
    }

    pub(super) fn warn(&mut self, warning: String) {
        if !self.warnings.contains(&warning) {
            self.warnings.push(warning);
        }
    }

    pub(super) fn cannot_hold(&self, what: &str) -> EncodeError {
        EncodeError::CannotHold { format: self.format, what: what.into() }
    }

    pub(super) fn is_binary(&self) -> bool {
        self.format != Format::Gltf
    }

    fn append(&mut self, kind: PoolKind, bytes: &[u8]) -> (usize, usize) {
        let known = self.pools.iter().position(|p| p.kind == kind && kind != PoolKind::Image);
        let at = known.unwrap_or_else(|| {
            self.pools.push(Pool { kind, bytes: Vec::new() });
            self.pools.len() - 1
        });
        let pool = &mut self.pools[at].bytes;
        pool.resize(pool.len().next_multiple_of(4), 0);
        let offset = pool.len();
        pool.extend_from_slice(bytes);
        (self.base_view + at, offset)
    }

    /// An accessor of vertex attributes, `stride` bytes each. `accessor` holds its other properties.
    pub(super) fn attribute(&mut self, bytes: &[u8], stride: usize, accessor: Value) -> usize {
        self.accessor(PoolKind::Attributes(stride), bytes, accessor)
    }

    /// An accessor of indices below `vertices`, of 16 bits when they fit.
    pub(super) fn indices(&mut self, indices: &[u32], vertices: usize) -> usize {
        // 65535 would be the index that restarts a primitive.
        let (size, code, bytes): (_, _, Vec<u8>) = if vertices <= u16::MAX as usize {
            (2, 5123, indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect())
        } else {
            (4, 5125, indices.iter().flat_map(|&i| i.to_le_bytes()).collect())
        };
        let accessor = json!({"componentType": code, "count": indices.len(), "type": "SCALAR"});
        self.accessor(PoolKind::Indices(size), &bytes, accessor)
    }

    fn accessor(&mut self, kind: PoolKind, bytes: &[u8], rest: Value) -> usize {
        let (view, offset) = self.append(kind, bytes);
        let mut accessor = Map::new();
        accessor.insert("bufferView".into(), json!(view));
        if offset > 0 {
            accessor.insert("byteOffset".into(), json!(offset));
        }
        accessor.extend(rest.as_object().cloned().unwrap_or_default());
        self.accessors.push(Value::Object(accessor));
        self.base_accessor + self.accessors.len() - 1
    }

    /// A buffer view of its own that holds an image; returns its index.
    pub(super) fn image_view(&mut self, bytes: &[u8]) -> usize {
        self.append(PoolKind::Image, bytes).0
    }

    /// A file beside the output.
    pub(super) fn side_file(&mut self, name: String, bytes: Vec<u8>) {
        self.side.push((name, bytes));
    }

    /// True if a file of this name is to be written already.
    pub(super) fn has_side_file(&self, name: &str) -> bool {
        self.side.iter().any(|(n, _)| n == name)
    }

    /// Puts views, accessors and the buffer into the document and wraps it up.
    pub(super) fn finish(
        mut self,
        mut document: Value,
        options: &EncodeOptions,
    ) -> Result<Encoded, EncodeError> {
        let Some(object) = document.as_object_mut() else {
            return Err(self.cannot_hold("a document that is no JSON object"));
        };
        let mut views = Vec::new();
        for pool in std::mem::take(&mut self.pools) {
            self.binary.resize(self.binary.len().next_multiple_of(4), 0);
            let mut view =
                json!({"buffer": 0, "byteOffset": self.binary.len(), "byteLength": pool.bytes.len()});
            match pool.kind {
                PoolKind::Attributes(stride) => {
                    view["byteStride"] = json!(stride);
                    view["target"] = json!(34962);
                }
                PoolKind::Indices(_) => view["target"] = json!(34963),
                PoolKind::Image => {}
            }
            self.binary.extend_from_slice(&pool.bytes);
            views.push(view);
        }
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        array_mut(object, "accessors").append(&mut self.accessors);
        array_mut(object, "bufferViews").append(&mut views);
        let mut buffer =
            object.shift_remove("buffers").and_then(|b| b.get(0)?.as_object().cloned()).unwrap_or_default();
        let mut side = self.side;
        if !self.binary.is_empty() {
            buffer.insert("byteLength".into(), json!(self.binary.len()));
            if self.format == Format::Gltf {
                let stem = if options.stem.is_empty() { "buffer" } else { &options.stem };
                let name = format!("{stem}.bin");
                buffer.insert("uri".into(), json!(percent_encode(&name)));
                side.insert(0, (name, std::mem::take(&mut self.binary)));
            }
            object.insert("buffers".into(), json!([buffer]));
        }
        object.retain(|key, v| !matches!(key.as_str(), "accessors" | "bufferViews") || v != &json!([]));
        let bytes = match self.format {
            Format::Gltf => serde_json::to_vec_pretty(&document).unwrap_or_default(),
            _ => container::glb(&document, &self.binary).map_err(|size| EncodeError::CannotHold {
                format: self.format,
                what: format!("{size} bytes (at most 2^32 - 1)"),
            })?,
        };
        Ok(Encoded { bytes, side, warnings: self.warnings })
    }
}

/// A file name as a URI.
pub(super) fn percent_encode(name: &str) -> String {
    let mut out = String::with_capacity(name.len());
    for b in name.bytes() {
        match b {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'~' | b'/' => out.push(b as char),
            _ => out.push_str(&format!("%{b:02X}")),
        }
    }
    out
}
