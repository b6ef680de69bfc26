//! From a scene's mesh to glTF primitives: one for each group and material, each (vertex, wedge) pair once.

use super::semantic;
use super::writer::Writer;
use crate::aif::{Encoding, NONE, Positions, Semantic, Wedges, triangulate_polygon};
use crate::io::EncodeError;
use crate::scene::SceneMesh;
use rustc_hash::FxHashMap;
use serde_json::{Map, Value, json};
use std::hash::{Hash, Hasher};

/// What the indices of a primitive make.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Points,
    Lines,
    Triangles,
}

/// A primitive whose data are written.
pub(super) struct Written {
    /// The primitive of the document that its faces came from.
    pub(super) group: Option<u32>,
    pub(super) shape: Shape,
    material: u32,
    attributes: Map<String, Value>,
    indices: Option<usize>,
    targets: Vec<Value>,
}

impl Written {
    /// The primitive as JSON; `body` is the rest of it. A material that the document does not have is left out.
    pub(super) fn into_json(self, mut body: Map<String, Value>, materials: usize) -> Value {
        let mut out = Map::new();
        out.insert("attributes".into(), Value::Object(self.attributes));
        if let Some(i) = self.indices {
            out.insert("indices".into(), json!(i));
        }
        match self.shape {
            Shape::Points => drop(out.insert("mode".into(), json!(0))),
            Shape::Lines => drop(out.insert("mode".into(), json!(1))),
            Shape::Triangles => drop(out.insert("mode".into(), json!(4))),
        }
        if !self.targets.is_empty() {
            out.insert("targets".into(), Value::Array(self.targets));
        }
        body.shift_remove("material");
        if (self.material as usize) < materials {
            out.insert("material".into(), json!(self.material));
        }
        out.extend(body);
        Value::Object(out)
    }
}

/// Writes the faces and wires of a mesh. `targets`: morph targets that every primitive must have at least. `points`: a
/// mesh of vertices only is written as points.
///
/// Errors: a position that is not finite as f32.
pub(super) fn primitives(
    mesh: &SceneMesh,
    targets: usize,
    points: bool,
    writer: &mut Writer,
) -> Result<Vec<Written>, EncodeError> {
    let g = &mesh.geometry;
    let of_channels = |w: &Wedges| {
        let target = |c: &crate::aif::Channel| semantic::name(&c.semantic).1.map(|t| t as usize + 1);
        w.channels().iter().filter_map(target).max().unwrap_or(0)
    };
    let targets = targets.max(g.wedges.as_ref().map_or(0, of_channels));
    let mut parts: Vec<Part> = Vec::new();
    let mut part_of: FxHashMap<(u32, u32), usize> = FxHashMap::default();
    let mut start = 0;
    let mut triangles = Vec::new();
    let mut polygon = Vec::new();
    let mut isolated = vec![true; g.positions.len()];
    let mut key = (NONE - 1, NONE - 1);
    let mut current = 0;
    for f in 0..g.face_count() {
        let n = g.face_sizes.as_ref().map_or(3, |s| s[f] as usize);
        let corners = start..start + n;
        start += n;
        let group = g.face_group.get(f).and_then(|&i| mesh.groups.get(i as usize)).and_then(|x| x.primitive);
        let material = g.face_material.get(f).copied().unwrap_or(NONE);
        let this = (group.unwrap_or(NONE), material);
        if this != key {
            key = this;
            current = *part_of.entry(this).or_insert_with(|| {
                parts.push(Part { group, material, ..Default::default() });
                parts.len() - 1
            });
        }
        triangles.clear();
        if n == 3 {
            triangles.push([0, 1, 2]);
        } else {
            polygon.clear();
            polygon.extend(g.corners[corners.clone()].iter().map(|&v| g.positions.get(v as usize)));
            triangulate_polygon(&polygon, &mut triangles);
        }
        for t in &triangles {
            for &k in t {
                let c = corners.start + k as usize;
                let wedge = g.wedges.as_ref().map_or(NONE, |w| w.corner[c]);
                isolated[g.corners[c] as usize] = false;
                parts[current].add(g.corners[c], wedge, g.wedges.as_ref());
            }
        }
    }
    parts.sort_by_key(|p| p.group.unwrap_or(NONE));
    let mut out = Vec::new();
    for part in parts.iter_mut() {
        out.push(part.write(Shape::Triangles, &g.positions, g.wedges.as_ref(), targets, writer)?);
    }
    if !g.wires.is_empty() {
        let mut part = Part { material: NONE, ..Default::default() };
        for &v in g.wires.as_flattened() {
            isolated[v as usize] = false;
            part.add(v, NONE, None);
        }
        out.push(part.write(Shape::Lines, &g.positions, None, targets, writer)?);
    }
    let loose = isolated.iter().filter(|&&i| i).count();
    if out.is_empty() && loose > 0 && points {
        let mut part = Part { material: NONE, ..Default::default() };
        (0..g.positions.len() as u32).for_each(|v| part.add(v, NONE, None));
        out.push(part.write(Shape::Points, &g.positions, None, targets, writer)?);
    } else if loose > 0 && points {
        writer.warn("glTF has no place for vertices without a face beside faces: they were left out".into());
    }
    Ok(out)
}

/// A triangle without area that has the attributes named, for a mesh that has lost all its faces.
pub(super) fn hollow(attributes: &[String], targets: usize, writer: &mut Writer) -> Written {
    let mut part = Part { material: NONE, group: Some(0), ..Default::default() };
    part.vertices.push((0, NONE));
    part.indices = vec![0; 3];
    let semantics: Vec<(Semantic, usize)> = attributes
        .iter()
        .map(|a| semantic::parse(a))
        .filter(|s| matches!(s, Semantic::Joints(_) | Semantic::Weights(_)))
        .map(|s| (s, 4))
        .collect();
    let mut map = Map::new();
    map.insert("POSITION".into(), json!(position_accessor(&[[0.0; 3]], writer)));
    for (s, width) in semantics {
        let mut values = vec![0.0; width];
        if s == Semantic::Weights(0) {
            values[0] = 1.0;
        }
        let encoding = if matches!(s, Semantic::Joints(_)) { Encoding::U8 } else { Encoding::F32 };
        map.insert(semantic::name(&s).0, json!(column_accessor(&values, width, encoding, writer)));
    }
    let targets = (0..targets).map(|_| json!({"POSITION": zero_position(1, writer)})).collect();
    let indices = Some(writer.indices(&part.indices, 1));
    Written { group: Some(0), shape: Shape::Triangles, material: NONE, attributes: map, indices, targets }
}

/// The corners of one primitive in the making.
#[derive(Default)]
struct Part {
    group: Option<u32>,
    material: u32,
    vertices: Vec<(u32, u32)>,
    indices: Vec<u32>,
    by_id: FxHashMap<(u32, u32), u32>,
    by_value: FxHashMap<(u32, u64), u32>,
}

impl Part {
    /// Adds a corner. Wedges of a vertex with the same values are one glTF vertex.
    fn add(&mut self, vertex: u32, wedge: u32, wedges: Option<&Wedges>) {
        let next = self.vertices.len() as u32;
        let index = *self.by_id.entry((vertex, wedge)).or_insert(next);
        if index != next {
            return self.indices.push(index);
        }
        let mut index = next;
        if let Some(w) = wedges.filter(|_| wedge != NONE) {
            let mut hasher = rustc_hash::FxHasher::default();
            w.present(wedge).hash(&mut hasher);
            w.row(wedge).iter().for_each(|x| (x + 0.0).to_bits().hash(&mut hasher));
            let same = *self.by_value.entry((vertex, hasher.finish())).or_insert(next);
            // Another wedge of the same hash, not of the same values, is merely not shared.
            if same != next && w.same(self.vertices[same as usize].1, wedge) {
                index = same;
                self.by_id.insert((vertex, wedge), same);
            }
        }
        if index == next {
            self.vertices.push((vertex, wedge));
        }
        self.indices.push(index);
    }

    fn write(
        &mut self,
        shape: Shape,
        positions: &Positions,
        wedges: Option<&Wedges>,
        targets: usize,
        writer: &mut Writer,
    ) -> Result<Written, EncodeError> {
        self.by_id = FxHashMap::default();
        self.by_value = FxHashMap::default();
        let mut points = Vec::with_capacity(self.vertices.len());
        for &(v, _) in &self.vertices {
            let p = positions.get(v as usize).to_array().map(|x| x as f32);
            if !p.iter().all(|x| x.is_finite()) {
                return Err(writer.cannot_hold(&format!("vertex {v} at {}", positions.get(v as usize))));
            }
            points.push(p);
        }
        let mut columns = wedges.map_or(Vec::new(), |w| super::columns::of(&self.vertices, w));
        super::columns::repair(&mut columns, &points, &self.indices);
        let mut attributes = Map::new();
        attributes.insert("POSITION".into(), json!(position_accessor(&points, writer)));
        let mut target_maps = vec![Map::new(); targets];
        for c in &columns {
            let (name, target) = semantic::name(&c.semantic);
            let is_position = matches!(c.semantic, Semantic::MorphPosition(_));
            let accessor = if is_position {
                position_accessor(c.values.as_chunks::<3>().0, writer)
            } else if type_name(c.width).is_some() {
                column_accessor(&c.values, c.width, c.encoding, writer)
            } else {
                writer.warn(format!("glTF cannot hold attribute {name} of {} numbers: left out", c.width));
                continue;
            };
            match target {
                None => drop(attributes.insert(name, json!(accessor))),
                Some(t) => drop(target_maps[t as usize].insert(name, json!(accessor))),
            }
        }
        let targets = target_maps
            .into_iter()
            .map(|mut t| {
                if t.is_empty() {
                    t.insert("POSITION".into(), json!(zero_position(points.len(), writer)));
                }
                Value::Object(t)
            })
            .collect();
        let indices = (shape != Shape::Points).then(|| writer.indices(&self.indices, points.len()));
        Ok(Written { group: self.group, shape, material: self.material, attributes, indices, targets })
    }
}

fn type_name(width: usize) -> Option<&'static str> {
    Some(match width {
        1 => "SCALAR",
        2 => "VEC2",
        3 => "VEC3",
        4 => "VEC4",
        9 => "MAT3",
        16 => "MAT4",
        _ => return None,
    })
}

/// Positions with their exact bounds.
fn position_accessor(points: &[[f32; 3]], writer: &mut Writer) -> usize {
    let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for p in points {
        for k in 0..3 {
            min[k] = min[k].min(p[k]);
            max[k] = max[k].max(p[k]);
        }
    }
    let bytes: Vec<u8> = points.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    // f64 prints the f32 values exactly.
    let (min, max) = (min.map(f64::from), max.map(f64::from));
    let accessor =
        json!({"componentType": 5126, "count": points.len(), "type": "VEC3", "min": min, "max": max});
    writer.attribute(&bytes, 12, accessor)
}

/// Zeros for a morph target without displacements. The format has accessors without bytes for that; not every reader does.
fn zero_position(count: usize, writer: &mut Writer) -> usize {
    position_accessor(&vec![[0.0; 3]; count], writer)
}

/// An accessor of a column of values, in the encoding; each vertex takes a multiple of 4 bytes.
fn column_accessor(values: &[f32], width: usize, encoding: Encoding, writer: &mut Writer) -> usize {
    let (code, size, normalized) = match encoding {
        Encoding::I8 => (5120, 1, false),
        Encoding::I8Norm => (5120, 1, true),
        Encoding::U8 => (5121, 1, false),
        Encoding::U8Norm => (5121, 1, true),
        Encoding::I16 => (5122, 2, false),
        Encoding::I16Norm => (5122, 2, true),
        Encoding::U16 => (5123, 2, false),
        Encoding::U16Norm => (5123, 2, true),
        Encoding::F32 | Encoding::F64 | Encoding::U32 | Encoding::I32 => (5126, 4, false),
    };
    let put = |out: &mut Vec<u8>, x: f32| {
        let r = x.round();
        // `as` saturates: what is out of range goes to the nearest value.
        match encoding {
            Encoding::I8 => out.push(r as i8 as u8),
            Encoding::I8Norm => out.push((x * 127.0).round() as i8 as u8),
            Encoding::U8 => out.push(r as u8),
            Encoding::U8Norm => out.push((x * 255.0).round() as u8),
            Encoding::I16 => out.extend((r as i16).to_le_bytes()),
            Encoding::I16Norm => out.extend(((x * 32767.0).round() as i16).to_le_bytes()),
            Encoding::U16 => out.extend((r as u16).to_le_bytes()),
            Encoding::U16Norm => out.extend(((x * 65535.0).round() as u16).to_le_bytes()),
            _ => out.extend(x.to_le_bytes()),
        }
    };
    // The columns of a 3 x 3 matrix are padded to 4 bytes.
    let rows = match width {
        9 => 3,
        16 => 4,
        w => w,
    };
    let stride = ((rows * size).next_multiple_of(4)) * (width / rows);
    let mut bytes = Vec::with_capacity(values.len() / width * stride);
    for column in values.chunks_exact(rows) {
        column.iter().for_each(|&x| put(&mut bytes, x));
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    }
    let count = values.len() / width;
    let mut accessor =
        json!({"componentType": code, "count": count, "type": type_name(width).unwrap_or("SCALAR")});
    if normalized {
        accessor["normalized"] = json!(true);
    }
    writer.attribute(&bytes, stride, accessor)
}
