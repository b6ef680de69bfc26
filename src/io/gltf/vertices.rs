//! From the primitives of a mesh to one indexed mesh with wedges.

use super::accessor::{Accessor, Store};
use super::json::At;
use super::{is_surface, semantic};
use crate::aif::{Channel, Encoding, MeshInput, NONE, Semantic, Wedges};
use crate::io::DecodeError;
use crate::scene::{Group, SceneMesh};
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;

/// What was changed over all meshes, each said once.
#[derive(Default)]
pub(super) struct Notes {
    not_finite: usize,
    leftover: usize,
    morph_dropped: Option<String>,
    target_attributes: bool,
}

impl Notes {
    pub(super) fn sentences(self) -> Vec<String> {
        let mut out = Vec::new();
        if self.not_finite > 0 {
            let n = self.not_finite;
            out.push(format!("{n} attribute values that are not finite numbers were taken as missing"));
        }
        if self.leftover > 0 {
            let n = self.leftover;
            out.push(format!("{n} indices after the last whole triangle of a primitive were left out"));
        }
        if self.target_attributes {
            out.push("morph targets of texture coordinates or colours were left out".into());
        }
        out.extend(self.morph_dropped);
        out
    }
}

/// A surface primitive, its accessors checked.
struct Primitive<'a> {
    at: At<'a>,
    number: usize,
    mode: usize,
    material: u32,
    position: Accessor,
    indices: Option<Accessor>,
    attributes: Vec<(Semantic, Accessor)>,
    /// Position (`None`) and attributes with their accessors' numbers: primitives that share all of them share wedges.
    set: Vec<(Option<Semantic>, usize)>,
}

/// Reads mesh `at`.
pub(super) fn mesh(
    at: &At<'_>,
    store: &Store<'_>,
    materials: usize,
    notes: &mut Notes,
) -> Result<SceneMesh, DecodeError> {
    let list = at.list("primitives")?;
    if list.is_empty() {
        return Err(at.bad("has no primitives"));
    }
    let groups = (0..list.len()).map(|p| Group { primitive: Some(p as u32), ..Default::default() }).collect();
    let mut primitives = Vec::new();
    for (number, p) in list.iter().enumerate() {
        p.object()?;
        if is_surface(p.value) {
            primitives.push(primitive(p, number, store, materials, notes)?);
        }
    }
    let channels = channels(&mut primitives, notes).map_err(|n| DecodeError::Unsupported {
        what: format!("a mesh with {n} attributes ({}; at most 64)", at.path),
    })?;
    let geometry = Reader::new(channels, store, notes)?.read(&primitives)?;
    Ok(SceneMesh { name: at.name(), geometry, groups, ..Default::default() })
}

fn primitive<'a>(
    at: &At<'a>,
    number: usize,
    store: &Store<'_>,
    materials: usize,
    notes: &mut Notes,
) -> Result<Primitive<'a>, DecodeError> {
    let accessor = |v: &At<'_>| -> Result<(usize, Accessor), DecodeError> {
        let i = v.as_index(store.accessors.len(), "accessors")?;
        Ok((i, store.accessor(i)?))
    };
    let draco = at.extension("KHR_draco_mesh_compression").is_some();
    let mut position = None;
    let (mut attributes, mut set) = (Vec::new(), Vec::new());
    for (name, v) in at.entries("attributes")? {
        let (i, a) = accessor(&v)?;
        if draco && store.accessors[i].get("bufferView").is_none() {
            let what = format!("the glTF extension KHR_draco_mesh_compression ({})", at.path);
            return Err(DecodeError::Unsupported { what });
        }
        if name == "POSITION" {
            if a.width != 3 {
                return Err(v.bad("must be of type VEC3"));
            }
            set.push((None, i));
            position = Some((v, a));
            continue;
        }
        let s = semantic::parse(name);
        set.push((Some(s.clone()), i));
        attributes.push((v, s, a));
    }
    let (position_at, position) = position.ok_or_else(|| at.bad("has no POSITION"))?;
    for (t, target) in at.list("targets")?.into_iter().enumerate() {
        let t = u16::try_from(t).map_err(|_| target.bad("more than 65536 morph targets"))?;
        target.object()?;
        for (name, value) in target.value.as_object().into_iter().flatten() {
            let v = At { value, path: format!("{}.{name}", target.path) };
            let (i, a) = accessor(&v)?;
            match semantic::parse_target(name, t) {
                Some(s) => {
                    set.push((Some(s.clone()), i));
                    attributes.push((v, s, a));
                }
                None => notes.target_attributes = true,
            }
        }
    }
    for (v, s, a) in &attributes {
        if a.count != position.count {
            return Err(
                v.bad(format!("has {} elements, {} has {}", a.count, position_at.path, position.count))
            );
        }
        if semantic::widths(s).is_some_and(|w| !w.contains(&a.width)) {
            return Err(
                v.bad(format!("has {} numbers an element, which this attribute cannot have", a.width))
            );
        }
    }
    let indices = at.get("indices").map(|v| accessor(&v).map(|(i, a)| (v, i, a))).transpose()?;
    if let Some((v, i, a)) = &indices {
        super::accessor::component_index(&store.accessors[*i].need("componentType")?)?;
        if a.width != 1 {
            return Err(v.bad("must be of type SCALAR"));
        }
    }
    let material = at.index("material", materials, "materials")?;
    Ok(Primitive {
        number,
        mode: at.uint_or("mode", 4)?,
        material: material.map_or(NONE, |m| m as u32),
        position,
        indices: indices.map(|(_, _, a)| a),
        attributes: attributes.into_iter().map(|(_, s, a)| (s, a)).collect(),
        set,
        at: at.clone(),
    })
}

/// The channels that hold the attributes of all primitives. Where they differ: the greater width, and f32. A wedge has 64 channels;
/// morph tangents, then morph normals go first when there are more. Errors with the number that is left.
fn channels(primitives: &mut [Primitive<'_>], notes: &mut Notes) -> Result<Vec<Channel>, usize> {
    let mut found: BTreeMap<Semantic, (usize, Encoding)> = BTreeMap::new();
    for (s, a) in primitives.iter().flat_map(|p| &p.attributes) {
        let entry = found.entry(s.clone()).or_insert((a.width, a.encoding()));
        entry.0 = entry.0.max(a.width);
        if entry.1 != a.encoding() {
            entry.1 = Encoding::F32;
        }
    }
    type IsKind = fn(&Semantic) -> bool;
    let kinds: [(&str, IsKind); 2] = [
        ("tangents", |s| matches!(s, Semantic::MorphTangent(_))),
        ("normals", |s| matches!(s, Semantic::MorphNormal(_))),
    ];
    let mut dropped = Vec::new();
    for (name, is_kind) in kinds {
        if found.len() > 64 && found.keys().any(is_kind) {
            found.retain(|s, _| !is_kind(s));
            primitives.iter_mut().for_each(|p| p.attributes.retain(|(s, _)| !is_kind(s)));
            dropped.push(name);
        }
    }
    if !dropped.is_empty() {
        let what = dropped.join(" and ");
        notes.morph_dropped =
            Some(format!("{what} of morph targets were left out: a mesh holds 64 attributes"));
    }
    if found.len() > 64 {
        return Err(found.len());
    }
    let channel = |(semantic, (width, encoding))| Channel { semantic, width, encoding };
    Ok(found.into_iter().map(channel).collect())
}

/// Vertices of a primitive's accessors that have been read: index -> (vertex, wedge).
enum Known {
    Dense(Vec<[u32; 2]>),
    Sparse(FxHashMap<u32, [u32; 2]>),
}

impl Known {
    fn get(&self, i: u32) -> Option<[u32; 2]> {
        match self {
            Known::Dense(v) => Some(v[i as usize]).filter(|k| k[0] != NONE),
            Known::Sparse(m) => m.get(&i).copied(),
        }
    }

    fn set(&mut self, i: u32, to: [u32; 2]) {
        match self {
            Known::Dense(v) => v[i as usize] = to,
            Known::Sparse(m) => drop(m.insert(i, to)),
        }
    }
}

/// Collects the geometry of a mesh.
struct Reader<'a> {
    store: &'a Store<'a>,
    notes: &'a mut Notes,
    positions: Vec<[f32; 3]>,
    /// Position bits -> vertex.
    welded: FxHashMap<[u32; 3], u32>,
    wedges: Wedges,
    row: Vec<f32>,
}

impl<'a> Reader<'a> {
    fn new(channels: Vec<Channel>, store: &'a Store<'a>, notes: &'a mut Notes) -> Result<Self, DecodeError> {
        let wedges = Wedges::new(channels).map_err(|e| DecodeError::Unsupported { what: e.to_string() })?;
        let row = vec![0.0; wedges.stride()];
        Ok(Reader { store, notes, positions: Vec::new(), welded: FxHashMap::default(), wedges, row })
    }

    fn read(mut self, primitives: &[Primitive<'_>]) -> Result<MeshInput, DecodeError> {
        let mut known: FxHashMap<&[(Option<Semantic>, usize)], Known> = FxHashMap::default();
        let mut input = MeshInput::default();
        let mut slots: Vec<[u32; 2]> = Vec::new();
        for p in primitives {
            let n = p.indices.as_ref().map_or(p.position.count, |i| i.count);
            let used = if p.mode == 4 { n - n % 3 } else { n };
            self.notes.leftover += n - used;
            let triangles = if p.mode == 4 { used / 3 } else { n.saturating_sub(2) };
            // Corners, wedge ids, group and material of each face, and the indices on the way.
            self.store
                .budget
                .take(n.saturating_mul(8).saturating_add(triangles.saturating_mul(32)), &p.at.path)?;
            let known = known.entry(&p.set).or_insert_with(|| {
                if p.position.count <= 8 * used + 1024 {
                    Known::Dense(vec![[NONE; 2]; p.position.count])
                } else {
                    Known::Sparse(FxHashMap::default())
                }
            });
            slots.clear();
            slots.reserve(used);
            for k in 0..used {
                slots.push(self.corner(p, k, known)?);
            }
            let before = input.corners.len();
            let mut emit = |t: [[u32; 2]; 3]| {
                input.corners.extend(t.map(|c| c[0]));
                self.wedges.corner.extend(t.map(|c| c[1]));
            };
            match p.mode {
                4 => slots.as_chunks::<3>().0.iter().for_each(|&t| emit(t)),
                // Strips repeat a vertex to turn round or to jump: such triangles are no faces.
                _ => (0..triangles)
                    .map(|i| match p.mode {
                        5 => [slots[i], slots[i + 1 + i % 2], slots[i + 2 - i % 2]],
                        _ => [slots[i + 1], slots[i + 2], slots[0]],
                    })
                    .filter(|[a, b, c]| a[0] != b[0] && b[0] != c[0] && c[0] != a[0])
                    .for_each(emit),
            }
            let faces = input.face_group.len() + (input.corners.len() - before) / 3;
            input.face_group.resize(faces, p.number as u32);
            input.face_material.resize(faces, p.material);
        }
        input.positions = self.positions.into();
        if !self.wedges.channels().is_empty() {
            input.wedges = Some(self.wedges);
        }
        if input.face_material.iter().all(|&m| m == NONE) {
            input.face_material.clear();
        }
        Ok(input)
    }

    /// Vertex and wedge of corner `k` of a primitive.
    fn corner(&mut self, p: &Primitive<'_>, k: usize, known: &mut Known) -> Result<[u32; 2], DecodeError> {
        let i = p.indices.as_ref().map_or(k as u32, |a| a.index(k));
        if i as usize >= p.position.count {
            let what = format!("element {k} is {i}: POSITION has {} elements", p.position.count);
            return Err(super::json::bad(&format!("{}.indices", p.at.path), what));
        }
        if let Some(slot) = known.get(i) {
            return Ok(slot);
        }
        self.store.budget.take(48 + 4 * self.row.len(), &p.at.path)?;
        let slot = [self.vertex(p, i)?, self.wedge(p, i)];
        known.set(i, slot);
        Ok(slot)
    }

    fn vertex(&mut self, p: &Primitive<'_>, i: u32) -> Result<u32, DecodeError> {
        let mut position = [0f32; 3];
        p.position.read(i as usize, &mut position);
        if let Some(axis) = position.iter().position(|x| !x.is_finite()) {
            let what =
                format!("element {i} has {} = {}: must be finite", ["x", "y", "z"][axis], position[axis]);
            return Err(super::json::bad(&format!("{}.attributes.POSITION", p.at.path), what));
        }
        let next = self.positions.len() as u32;
        let vertex = *self.welded.entry(position.map(|x| (x + 0.0).to_bits())).or_insert(next);
        if vertex == next {
            self.positions.push(position);
        }
        Ok(vertex)
    }

    fn wedge(&mut self, p: &Primitive<'_>, i: u32) -> u32 {
        if p.attributes.is_empty() {
            return NONE;
        }
        self.row.fill(0.0);
        let mut present = 0u64;
        for (s, a) in &p.attributes {
            let Some(c) = self.wedges.channel(s) else { continue };
            let (start, width) = (self.wedges.offset(c), self.wedges.channels()[c].width);
            let values = &mut self.row[start..start + width];
            a.read(i as usize, values);
            if matches!(s, Semantic::Color(_)) && a.width == 3 && width == 4 {
                values[3] = 1.0;
            }
            if values.iter().all(|x| x.is_finite()) {
                present |= 1 << c;
            } else {
                values.fill(0.0);
                self.notes.not_finite += 1;
            }
        }
        self.wedges.push(&self.row, present)
    }
}
