//! Buffer views and accessors: every component type, strides, normalized integers, sparse replacement, compressed views.
//!
//! Nothing is unpacked before it is asked for: an accessor reads its elements where they lie, so that accessors that share bytes,
//! or announce elements without any, cost nothing.

use super::container::Buffers;
use super::json::{At, bad};
use super::{MESHOPT, meshopt};
use crate::aif::Encoding;
use crate::io::DecodeError;
use std::cell::{Cell, RefCell};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// Bytes that decoding may make, beyond what a JSON document of few bytes could otherwise ask for by naming the same data over
/// and over.
pub(super) struct Budget(Cell<usize>);

impl Budget {
    pub(super) fn for_input(bytes: usize) -> Self {
        Budget(Cell::new(bytes.saturating_mul(256).saturating_add(16 << 20)))
    }

    pub(super) fn take(&self, bytes: usize, path: &str) -> Result<(), DecodeError> {
        match self.0.get().checked_sub(bytes) {
            Some(left) => self.0.set(left),
            None => return Err(bad(path, "announces far more data than the file has bytes")),
        }
        Ok(())
    }
}

/// Bytes of a buffer view.
#[derive(Clone, Debug)]
pub(super) struct Bytes {
    pub(super) data: Arc<Vec<u8>>,
    pub(super) range: Range<usize>,
    /// The buffer they are a part of; `None` when they were decompressed.
    pub(super) buffer: Option<usize>,
}

impl Bytes {
    pub(super) fn slice(&self) -> &[u8] {
        &self.data[self.range.clone()]
    }
}

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn from_code(code: usize) -> Option<Self> {
        Some(match code {
            5120 => Component::I8,
            5121 => Component::U8,
            5122 => Component::I16,
            5123 => Component::U16,
            5125 => Component::U32,
            5126 => Component::F32,
            _ => return None,
        })
    }

    pub(super) fn size(self) -> usize {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }

    /// The number at the start of `b`, which holds at least `size()` bytes.
    fn read(self, b: &[u8], normalized: bool) -> f32 {
        let scaled = |v: f32, max: f32| if normalized { (v / max).max(-1.0) } else { v };
        match self {
            Component::I8 => scaled(b[0] as i8 as f32, 127.0),
            Component::U8 => scaled(b[0] as f32, 255.0),
            Component::I16 => scaled(i16::from_le_bytes([b[0], b[1]]) as f32, 32767.0),
            Component::U16 => scaled(u16::from_le_bytes([b[0], b[1]]) as f32, 65535.0),
            Component::U32 => {
                let v = u32::from_le_bytes([b[0], b[1], b[2], b[3]]);
                if normalized { (v as f64 / u32::MAX as f64) as f32 } else { v as f32 }
            }
            Component::F32 => f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        }
    }

    /// The whole number at the start of `b`.
    fn read_index(self, b: &[u8]) -> u32 {
        match self {
            Component::I8 | Component::U8 => b[0] as u32,
            Component::I16 | Component::U16 => u16::from_le_bytes([b[0], b[1]]) as u32,
            Component::U32 | Component::F32 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        }
    }
}

/// Rows and columns of an accessor type.
fn shape(name: &str) -> Option<(usize, usize)> {
    Some(match name {
        "SCALAR" => (1, 1),
        "VEC2" => (2, 1),
        "VEC3" => (3, 1),
        "VEC4" => (4, 1),
        "MAT2" => (2, 2),
        "MAT3" => (3, 3),
        "MAT4" => (4, 4),
        _ => return None,
    })
}

/// An accessor, checked: every element it announces can be read.
#[derive(Clone, Debug)]
pub(super) struct Accessor {
    pub(super) count: usize,
    pub(super) component: Component,
    pub(super) normalized: bool,
    /// Numbers in an element.
    pub(super) width: usize,
    rows: usize,
    /// Bytes from one column of a matrix to the next: padded to 4.
    column: usize,
    base: Option<Bytes>,
    stride: usize,
    sparse: Option<Sparse>,
}

/// Elements that replace those of the base.
#[derive(Clone, Debug)]
struct Sparse {
    indices: Vec<u32>,
    values: Bytes,
}

impl Accessor {
    /// Bytes of an element.
    fn size(&self) -> usize {
        self.column * (self.width / self.rows)
    }

    fn element(&self, i: usize) -> Option<&[u8]> {
        if let Some(s) = &self.sparse
            && let Ok(at) = s.indices.binary_search(&(i as u32))
        {
            return s.values.slice().get(at * self.size()..(at + 1) * self.size());
        }
        let start = i.checked_mul(self.stride)?;
        self.base.as_ref()?.slice().get(start..start + self.size())
    }

    /// Reads element `i` to the front of `out`; zeros where the accessor has no bytes.
    pub(super) fn read(&self, i: usize, out: &mut [f32]) {
        let n = self.width.min(out.len());
        let Some(bytes) = self.element(i) else {
            out[..n].fill(0.0);
            return;
        };
        let size = self.component.size();
        for (k, o) in out[..n].iter_mut().enumerate() {
            let at = k / self.rows * self.column + k % self.rows * size;
            *o = self.component.read(&bytes[at..], self.normalized);
        }
    }

    /// Element `i` as an index.
    pub(super) fn index(&self, i: usize) -> u32 {
        self.element(i).map_or(0, |b| self.component.read_index(b))
    }

    /// How a channel that this accessor fills was stored.
    pub(super) fn encoding(&self) -> Encoding {
        match (self.component, self.normalized) {
            (Component::F32, _) => Encoding::F32,
            (Component::I8, true) => Encoding::I8Norm,
            (Component::I8, false) => Encoding::I8,
            (Component::U8, true) => Encoding::U8Norm,
            (Component::U8, false) => Encoding::U8,
            (Component::I16, true) => Encoding::I16Norm,
            (Component::I16, false) => Encoding::I16,
            (Component::U16, true) => Encoding::U16Norm,
            (Component::U16, false) => Encoding::U16,
            (Component::U32, true) => Encoding::F32,
            (Component::U32, false) => Encoding::U32,
        }
    }
}

/// The accessors and buffer views of a document, over its buffers.
pub(super) struct Store<'a> {
    pub(super) accessors: Vec<At<'a>>,
    pub(super) views: Vec<At<'a>>,
    buffers: &'a Buffers,
    decompressed: RefCell<HashMap<usize, Bytes>>,
    pub(super) budget: Budget,
}

impl<'a> Store<'a> {
    pub(super) fn new(root: &At<'a>, buffers: &'a Buffers, budget: Budget) -> Result<Self, DecodeError> {
        Ok(Store {
            accessors: root.list("accessors")?,
            views: root.list("bufferViews")?,
            buffers,
            decompressed: RefCell::default(),
            budget,
        })
    }

    /// The bytes that a view-like object (`buffer`, `byteOffset`, `byteLength`) names.
    fn range(&self, at: &At<'_>) -> Result<Bytes, DecodeError> {
        let index = at.need("buffer")?.as_index(self.buffers.len(), "buffers")?;
        let offset = at.uint_or("byteOffset", 0)?;
        let length = at.need("byteLength")?.uint()?;
        let data = self.buffers[index]
            .clone()
            .ok_or_else(|| at.bad(format!("lies in buffers[{index}], which has no data")))?;
        let end = offset.checked_add(length).filter(|&e| e <= data.len()).ok_or_else(|| {
            at.bad(format!(
                "byteOffset {offset} + byteLength {length} is beyond the {} bytes of buffers[{index}]",
                data.len()
            ))
        })?;
        Ok(Bytes { data, range: offset..end, buffer: Some(index) })
    }

    /// The bytes of view `i`, decompressed if need be.
    pub(super) fn view(&self, i: usize) -> Result<Bytes, DecodeError> {
        let view = &self.views[i];
        let Some(packed) = MESHOPT.iter().find_map(|name| view.extension(name)) else {
            return self.range(view);
        };
        if let Some(known) = self.decompressed.borrow().get(&i) {
            return Ok(known.clone());
        }
        let text = |key: &str, default: &'a str| packed.get(key).map_or(Ok(default), |v| v.string());
        let layout = meshopt::Layout {
            mode: text("mode", "")?,
            filter: text("filter", "NONE")?,
            count: packed.need("count")?.uint()?,
            stride: packed.need("byteStride")?.uint()?,
        };
        let length = view.need("byteLength")?.uint()?;
        if layout.count.checked_mul(layout.stride) != Some(length) {
            return Err(packed.bad(format!(
                "count {} x byteStride {} must be the view's byteLength, {length}",
                layout.count, layout.stride
            )));
        }
        let stream = self.range(&packed)?;
        // Three bytes of working memory for each byte of the result, at most (indices).
        self.budget.take(length.saturating_mul(3), &packed.path)?;
        let data = meshopt::decode(stream.slice(), layout, &packed.path)?;
        let bytes = Bytes { range: 0..data.len(), data: Arc::new(data), buffer: None };
        self.decompressed.borrow_mut().insert(i, bytes.clone());
        Ok(bytes)
    }

    /// Accessor `i`, checked to its last element.
    pub(super) fn accessor(&self, i: usize) -> Result<Accessor, DecodeError> {
        let at = &self.accessors[i];
        let component = component(&at.need("componentType")?)?;
        let kind = at.need("type")?;
        let (rows, columns) =
            shape(kind.string()?).ok_or_else(|| kind.bad("must be SCALAR, VEC2, ... MAT4"))?;
        let count = at.need("count")?.uint()?;
        if count == 0 || count >= u32::MAX as usize {
            return Err(at.bad(format!("count {count}: must be 1 to 2^32 - 2")));
        }
        let mut column = rows * component.size();
        if columns > 1 {
            column = column.next_multiple_of(4);
        }
        let size = column * columns;
        let mut accessor = Accessor {
            count,
            component,
            normalized: at.get("normalized").is_some_and(|v| v.value == &serde_json::Value::Bool(true)),
            width: rows * columns,
            rows,
            column,
            base: None,
            stride: size,
            sparse: None,
        };
        if let Some(v) = at.index("bufferView", self.views.len(), "buffer views")? {
            let stride = self.views[v].uint_or("byteStride", size)?;
            if stride < size {
                return Err(self.views[v]
                    .bad(format!("byteStride {stride} is less than the {size} bytes of {}", at.path)));
            }
            accessor.base = Some(self.slots(at, v, count, size, stride)?);
            accessor.stride = stride;
        }
        if let Some(s) = at.get("sparse") {
            let n = s.need("count")?.uint()?;
            if n == 0 || n > count {
                return Err(s.bad(format!("count {n}: must be 1 to {count}, the accessor's count")));
            }
            let (indices, values) = (s.need("indices")?, s.need("values")?);
            let kind = component_index(&indices.need("componentType")?)?;
            let view = |at: &At<'_>| at.need("bufferView")?.as_index(self.views.len(), "buffer views");
            let raw = self.slots(&indices, view(&indices)?, n, kind.size(), kind.size())?;
            self.budget.take(4 * n, &s.path)?;
            let list: Vec<u32> =
                raw.slice().chunks(kind.size()).take(n).map(|b| kind.read_index(b)).collect();
            if let Some(k) = (1..n).find(|&k| list[k - 1] >= list[k]) {
                return Err(indices.bad(format!("element {k} is not greater than the one before it")));
            }
            if let Some(&last) = list.last().filter(|&&l| l as usize >= count) {
                return Err(
                    indices.bad(format!("element {} is {last}: the accessor has {count} elements", n - 1))
                );
            }
            let values = self.slots(&values, view(&values)?, n, size, size)?;
            accessor.sparse = Some(Sparse { indices: list, values });
        }
        Ok(accessor)
    }

    /// The bytes from an accessor's first element on, checked to hold `count` of them.
    fn slots(
        &self,
        at: &At<'_>,
        view: usize,
        count: usize,
        size: usize,
        stride: usize,
    ) -> Result<Bytes, DecodeError> {
        let mut bytes = self.view(view)?;
        let offset = at.uint_or("byteOffset", 0)?;
        let need = stride.checked_mul(count - 1).and_then(|n| n.checked_add(size)?.checked_add(offset));
        if need.is_none_or(|n| n > bytes.range.len()) {
            return Err(at.bad(format!(
                "{count} elements of {size} bytes, {stride} apart, from byte {offset} on do not fit into the {} bytes of \
                 bufferViews[{view}]",
                bytes.range.len()
            )));
        }
        bytes.range.start += offset;
        Ok(bytes)
    }
}

fn component(at: &At<'_>) -> Result<Component, DecodeError> {
    let code = at.uint()?;
    Component::from_code(code)
        .ok_or_else(|| at.bad(format!("{code}: must be 5120, 5121, 5122, 5123, 5125 or 5126")))
}

/// The component type of indices.
pub(super) fn component_index(at: &At<'_>) -> Result<Component, DecodeError> {
    match component(at)? {
        c @ (Component::U8 | Component::U16 | Component::U32) => Ok(c),
        _ => Err(at.bad("indices must be of type 5121, 5123 or 5125")),
    }
}
