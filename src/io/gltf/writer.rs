//! Accessors, buffer views, bytes and files beside, gathered while a document is made or patched.

use super::container;
use super::json::array_mut;
use crate::io::{EncodeError, EncodeOptions, Encoded, Format};
use glam::DVec3;
use serde_json::{Map, Value, json};

/// Where a mesh of a scene is in the document.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    /// Its index there.
    pub(super) index: usize,
    /// By how much its vertices were moved.
    pub(super) offset: DVec3,
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
