//! Writing PLY.

use crate::aif::{Encoding, MeshInput, NONE, Positions, Semantic, Wedges};
use crate::io::flatten::{flatten, has_named_groups};
use crate::io::obj::image_names;
use crate::io::text::{f64_mark, write_f32, write_f64, write_f64_long};
use crate::io::{EncodeError, EncodeOptions, Encoded};
use crate::scene::{Extras, Scene};
use std::io::Write;

/// Encodes a scene as PLY: binary little endian, or text with [`EncodeOptions::text`].
///
/// Vertices and faces keep their order and numbers read back bit for bit. No vertex is split: an attribute that differs between the corners of
/// a vertex becomes one of the faces where PLY has such (texture coordinates as `texcoord`, a colour that is the same all over each
/// face); else the first corner's value is written, with a warning. What PLY cannot hold is a warning.
pub fn encode(scene: &Scene, options: &EncodeOptions) -> Result<Encoded, EncodeError> {
    let flat = flatten(scene, "PLY");
    let mut encoded = Encoded { warnings: flat.warnings, ..Default::default() };
    let warnings = &mut encoded.warnings;
    let input: &MeshInput = &flat.geometry;
    if has_named_groups(input, &flat.groups, flat.name) {
        warnings.push("PLY cannot hold groups".into());
    }
    let stem = if options.stem.is_empty() { "mesh" } else { &options.stem };
    let textures = Textures::new(scene, input, &image_names(&scene.images, stem), warnings);
    for &(image, ref name) in &textures.files {
        if let Some(data) = scene.images.get(image).and_then(|i| i.data.clone()) {
            encoded.side.push((name.clone(), data));
        }
    }
    let plan = Plan::new(input, &flat.extras, &textures, warnings);
    let out = if options.text { Sink::Text(Vec::new()) } else { Sink::Binary(Vec::new()) };
    let comments = scene.comments().collect();
    encoded.bytes = write(input, &textures, &plan, comments, options.all_digits, out);
    Ok(encoded)
}

/// The textures of a scene's materials, as far as PLY has such.
struct Textures {
    /// Image and file name of each.
    files: Vec<(usize, String)>,
    /// The texture of every material; `None` for none.
    of_material: Vec<Option<u32>>,
    /// True if faces must say which they have.
    numbered: bool,
}

impl Textures {
    fn new(scene: &Scene, input: &MeshInput, names: &[String], warnings: &mut Vec<String>) -> Self {
        let mut files: Vec<(usize, String)> = Vec::new();
        let mut of_material = Vec::new();
        let mut lost = false;
        let mut used = vec![false; scene.materials.len()];
        let mut bare = input.face_material.is_empty() && input.face_count() > 0;
        for &m in &input.face_material {
            match used.get_mut(m as usize) {
                Some(u) => *u = true,
                None => bare = true,
            }
        }
        for (material, used) in scene.materials.iter().zip(used) {
            let image = material.base_color_image.filter(|&i| i < names.len());
            // A material that is nothing but a texture is what PLY can hold.
            lost |= used && (image.is_none() || material.mtl.is_some() || material.base_color != [1.0; 4]);
            let texture = image.filter(|_| used).map(|i| match files.iter().position(|f| f.0 == i) {
                Some(known) => known as u32,
                None => {
                    files.push((i, names[i].clone()));
                    files.len() as u32 - 1
                }
            });
            bare |= used && texture.is_none();
            of_material.push(texture);
        }
        if lost {
            warnings.push("PLY cannot hold materials, only the names of their textures".into());
        }
        let numbered = files.len() > 1 || files.len() == 1 && bare;
        Textures { files, of_material, numbered }
    }

    /// The number of a face's texture, -1 for none.
    fn of_face(&self, input: &MeshInput, f: usize) -> i32 {
        let material = input.face_material.get(f).copied().unwrap_or(NONE);
        self.of_material.get(material as usize).copied().flatten().map_or(-1, |t| t as i32)
    }
}

/// How a number is stored.
#[derive(Clone, Copy, PartialEq)]
enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Type {
    fn name(self) -> &'static str {
        ["char", "uchar", "short", "ushort", "int", "uint", "float", "double"][self as usize]
    }

    /// The type for a channel's encoding, and what stands for 1.
    fn of(encoding: Encoding) -> (Type, f64) {
        match encoding {
            Encoding::F32 => (Type::F32, 1.0),
            Encoding::F64 => (Type::F64, 1.0),
            Encoding::U8 => (Type::U8, 1.0),
            Encoding::U8Norm => (Type::U8, 255.0),
            Encoding::I8 => (Type::I8, 1.0),
            Encoding::I8Norm => (Type::I8, 127.0),
            Encoding::U16 => (Type::U16, 1.0),
            Encoding::U16Norm => (Type::U16, 65535.0),
            Encoding::I16 => (Type::I16, 1.0),
            Encoding::I16Norm => (Type::I16, 32767.0),
            Encoding::U32 => (Type::U32, 1.0),
            Encoding::I32 => (Type::I32, 1.0),
        }
    }
}

/// A channel as vertex or face properties.
struct Written {
    channel: usize,
    names: Vec<String>,
    stored: Type,
    one: f64,
}

/// What is written of the attributes.
struct Plan<'a> {
    wedges: Option<&'a Wedges>,
    /// A corner of every vertex that has one.
    corner: Vec<u32>,
    vertex: Vec<Written>,
    /// Written as a list a face.
    texcoord: Option<usize>,
    face_color: Option<Written>,
    /// Names, types and values of other numbers of faces.
    face_values: Vec<(String, Type, &'a [f64])>,
    extras: &'a Extras,
    /// The row of each vertex without a face.
    loose: std::collections::HashMap<u32, usize>,
}

impl<'a> Plan<'a> {
    fn new(
        input: &'a MeshInput,
        extras: &'a Extras,
        textures: &Textures,
        warnings: &mut Vec<String>,
    ) -> Self {
        let mut plan = Plan {
            wedges: input.wedges.as_ref(),
            corner: Vec::new(),
            vertex: Vec::new(),
            texcoord: None,
            face_color: None,
            face_values: Vec::new(),
            extras,
            loose: Default::default(),
        };
        plan.attributes(input, textures, warnings);
        plan.values_of_faces(input, textures, warnings);
        plan
    }

    /// Numbers of faces that mean nothing here.
    fn values_of_faces(&mut self, input: &MeshInput, textures: &Textures, warnings: &mut Vec<String>) {
        if input.face_row.len() != input.face_count() {
            return;
        }
        let mut taken: Vec<String> = self.face_color.iter().flat_map(|w| w.names.clone()).collect();
        taken.extend(["vertex_indices", "vertex_index", "texcoord"].map(String::from));
        if textures.numbered {
            taken.push("texnumber".into());
        }
        for of in &self.extras.of_faces {
            let name = word(&of.name);
            if taken.contains(&name) {
                warnings.push(format!("the values {name} of faces are left out: others have their name"));
                continue;
            }
            let missing = |r: &u32| *r as usize >= of.values.len();
            if input.face_row.iter().any(missing) {
                warnings.push(format!("faces without {name}: zeros are written"));
            }
            taken.push(name.clone());
            self.face_values.push((name, Type::of(of.encoding).0, &of.values));
        }
    }

    fn attributes(&mut self, input: &'a MeshInput, textures: &Textures, warnings: &mut Vec<String>) {
        let plan = self;
        let Some(w) = plan.wedges else { return };
        plan.loose = plan.extras.loose.places(w.stride(), input.positions.len());
        plan.corner = vec![NONE; input.positions.len()];
        for (c, &v) in input.corners.iter().enumerate().rev() {
            if let Some(slot) = plan.corner.get_mut(v as usize) {
                *slot = c as u32;
            }
        }
        let mut taken: std::collections::BTreeSet<String> = ["x", "y", "z"].map(String::from).into();
        for (k, channel) in w.channels().iter().enumerate() {
            let names: Vec<String> = match &channel.semantic {
                Semantic::Normal if channel.width == 3 => ["nx", "ny", "nz"].map(String::from).into(),
                Semantic::TexCoord(0) if channel.width == 2 => {
                    ["texture_u", "texture_v"].map(String::from).into()
                }
                Semantic::Color(0) if matches!(channel.width, 3 | 4) => {
                    ["red", "green", "blue", "alpha"][..channel.width].iter().map(|s| s.to_string()).collect()
                }
                Semantic::Custom(name) => {
                    let name = word(name);
                    match channel.width {
                        1 => vec![name],
                        n => (0..n).map(|i| format!("{name}_{i}")).collect(),
                    }
                }
                other => {
                    warnings.push(format!("PLY cannot hold the attribute {other:?}"));
                    continue;
                }
            };
            let what = names.join(", ");
            if names.iter().any(|n| !taken.insert(n.clone())) {
                warnings.push(format!("the attribute {what} is left out: another has its name"));
                continue;
            }
            let (stored, one) = plan.stored_as(k);
            let written = Written { channel: k, names, stored, one };
            let of_vertices = plan.is_of_vertices(input, k);
            match &channel.semantic {
                // MeshLab pairs textures with texture coordinates of corners.
                Semantic::TexCoord(0) if !of_vertices || textures.numbered => plan.texcoord = Some(k),
                Semantic::Color(0) if !of_vertices && plan.is_of_faces(input, k) => {
                    plan.face_color = Some(written)
                }
                _ => {
                    if !of_vertices {
                        warnings.push(format!(
                            "{what} differ between corners of a vertex: the first corner's are written"
                        ));
                    }
                    plan.vertex.push(written);
                }
            }
            let missing = |c: usize| plan.value(c, k).is_none();
            if (0..input.corners.len()).any(missing) && (0..input.corners.len()).any(|c| !missing(c)) {
                warnings.push(format!(
                    "corners without {what}: zeros are written where none of the vertex has any"
                ));
            }
        }
    }

    /// The value of a channel at a vertex that no face uses.
    fn of_loose(&self, v: usize, channel: usize) -> Option<&'a [f32]> {
        let w = self.wedges?;
        let row = *self.loose.get(&u32::try_from(v).ok()?)?;
        let at = row * w.stride() + w.offset(channel);
        let loose = &self.extras.loose;
        let present = loose.present[row] >> channel & 1 == 1;
        loose.rows.get(at..at + w.channels()[channel].width).filter(|_| present)
    }

    fn value(&self, corner: usize, channel: usize) -> Option<&'a [f32]> {
        let w = self.wedges?;
        let id = w.corner.get(corner).copied().filter(|&x| (x as usize) < w.len())?;
        w.get(id, channel)
    }

    /// The stored type: the input's where it holds the values, floats where it does not.
    fn stored_as(&self, channel: usize) -> (Type, f64) {
        let Some(w) = self.wedges else { return (Type::F32, 1.0) };
        let c = &w.channels()[channel];
        let values = || {
            let loose = self.loose.keys().filter_map(|&v| self.of_loose(v as usize, channel));
            (0..w.len() as u32).filter_map(|id| w.get(id, channel)).chain(loose).flatten().copied()
        };
        // Colours that are bytes in all but name are written as bytes, which every reader knows.
        let is_byte = |x: f32| (x * 255.0).round() / 255.0 == x && (0.0..=1.0).contains(&x);
        if matches!(c.semantic, Semantic::Color(_)) && c.encoding == Encoding::F32 && values().all(is_byte) {
            return Type::of(Encoding::U8Norm);
        }
        Type::of(c.encoding)
    }

    /// True if no vertex has two values of a channel.
    fn is_of_vertices(&self, input: &MeshInput, channel: usize) -> bool {
        let bits = |v: &[f32]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let mut of_vertex: Vec<Option<&[f32]>> = vec![None; input.positions.len()];
        for (c, &v) in input.corners.iter().enumerate() {
            let (Some(value), Some(known)) = (self.value(c, channel), of_vertex.get_mut(v as usize)) else {
                continue;
            };
            match known {
                None => *known = Some(value),
                Some(k) if std::ptr::eq(*k, value) || bits(k) == bits(value) => {}
                _ => return false,
            }
        }
        true
    }

    /// True if all corners of each face have the same value of a channel.
    fn is_of_faces(&self, input: &MeshInput, channel: usize) -> bool {
        faces(input).all(|face| {
            let first = self.value(face.start, channel);
            first.is_some() && face.clone().all(|c| self.value(c, channel) == first)
        })
    }

    /// The value of a channel at a vertex: that of the first of its corners that has one.
    fn of_vertex(
        &self,
        input: &MeshInput,
        lists: &VertexCorners,
        v: usize,
        channel: usize,
    ) -> Option<&'a [f32]> {
        let first = *self.corner.get(v)?;
        if first == NONE {
            return self.of_loose(v, channel);
        }
        self.value(first as usize, channel)
            .or_else(|| lists.get(input, v).find_map(|c| self.value(c, channel)))
    }
}

/// A name as one word.
fn word(name: &str) -> String {
    let name: String =
        name.chars().map(|c| if c.is_whitespace() || c.is_control() { '_' } else { c }).collect();
    if name.is_empty() { "attribute".to_string() } else { name }
}

/// All corners of a vertex; gathered only when a vertex's first corner lacks a value.
#[derive(Default)]
struct VertexCorners {
    list: std::cell::OnceCell<Vec<Vec<u32>>>,
}

impl VertexCorners {
    fn get<'l>(&'l self, input: &MeshInput, v: usize) -> impl Iterator<Item = usize> + 'l {
        let lists = self.list.get_or_init(|| {
            let mut lists = vec![Vec::new(); input.positions.len()];
            for (c, &v) in input.corners.iter().enumerate() {
                if let Some(l) = lists.get_mut(v as usize) {
                    l.push(c as u32);
                }
            }
            lists
        });
        lists.get(v).into_iter().flatten().map(|&c| c as usize)
    }
}

/// The corner slots of every face.
fn faces(input: &MeshInput) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
    let mut at = 0;
    (0..input.face_count()).map(move |f| {
        let start = at;
        at = (at + input.face_sizes.as_ref().map_or(3, |s| s[f] as usize)).min(input.corners.len());
        start..at
    })
}

/// Bytes, or text with a space between numbers.
enum Sink {
    Text(Vec<u8>),
    Binary(Vec<u8>),
}

impl Sink {
    fn space(out: &mut Vec<u8>) {
        if !matches!(out.last(), None | Some(b'\n')) {
            out.push(b' ');
        }
    }

    /// Writes a number; whole-number types round to nearest and stay in range.
    fn put(&mut self, t: Type, x: f64) {
        match self {
            Sink::Text(out) => {
                Self::space(out);
                // Writing to a Vec cannot fail.
                let _ = match t {
                    Type::F32 => return write_f32(out, x as f32),
                    Type::F64 => return write_f64(out, x),
                    Type::I8 => write!(out, "{}", x.round() as i8),
                    Type::U8 => write!(out, "{}", x.round() as u8),
                    Type::I16 => write!(out, "{}", x.round() as i16),
                    Type::U16 => write!(out, "{}", x.round() as u16),
                    Type::I32 => write!(out, "{}", x.round() as i32),
                    Type::U32 => write!(out, "{}", x.round() as u32),
                };
            }
            Sink::Binary(out) => match t {
                Type::I8 => out.extend((x.round() as i8).to_le_bytes()),
                Type::U8 => out.extend((x.round() as u8).to_le_bytes()),
                Type::I16 => out.extend((x.round() as i16).to_le_bytes()),
                Type::U16 => out.extend((x.round() as u16).to_le_bytes()),
                Type::I32 => out.extend((x.round() as i32).to_le_bytes()),
                Type::U32 => out.extend((x.round() as u32).to_le_bytes()),
                Type::F32 => out.extend((x as f32).to_le_bytes()),
                Type::F64 => out.extend(x.to_le_bytes()),
            },
        }
    }

    /// Writes a double so that a reader of text sees one.
    fn put_marked(&mut self, x: f64) {
        match self {
            Sink::Text(out) => {
                Self::space(out);
                write_f64_long(out, x);
            }
            Sink::Binary(_) => self.put(Type::F64, x),
        }
    }

    fn end_element(&mut self) {
        if let Sink::Text(out) = self {
            out.push(b'\n');
        }
    }
}

fn write(
    input: &MeshInput,
    textures: &Textures,
    plan: &Plan<'_>,
    comments: Vec<String>,
    all_digits: bool,
    mut sink: Sink,
) -> Vec<u8> {
    let longest = faces(input).map(|f| f.len()).max().unwrap_or(0);
    let count = |n: usize| if n <= 255 { Type::U8 } else { Type::U32 };
    let index = if input.positions.len() <= i32::MAX as usize { Type::I32 } else { Type::U32 };
    let coordinate = if input.positions.is_f64() { Type::F64 } else { Type::F32 };

    let mut header = String::from("ply\n");
    header.push_str(match sink {
        Sink::Text(_) => "format ascii 1.0\n",
        Sink::Binary(_) => "format binary_little_endian 1.0\n",
    });
    for comment in comments {
        header.push_str(&format!("comment {comment}\n"));
    }
    for (_, name) in &textures.files {
        header.push_str(&format!("comment TextureFile {name}\n"));
    }
    header.push_str(&format!("element vertex {}\n", input.positions.len()));
    for axis in ["x", "y", "z"] {
        header.push_str(&format!("property {} {axis}\n", coordinate.name()));
    }
    let properties = |header: &mut String, w: &Written| {
        w.names.iter().for_each(|name| header.push_str(&format!("property {} {name}\n", w.stored.name())));
    };
    plan.vertex.iter().for_each(|w| properties(&mut header, w));
    header.push_str(&format!("element face {}\n", input.face_count()));
    header.push_str(&format!("property list {} {} vertex_indices\n", count(longest).name(), index.name()));
    if plan.texcoord.is_some() {
        header.push_str(&format!("property list {} float texcoord\n", count(2 * longest).name()));
    }
    if textures.numbered {
        header.push_str("property int texnumber\n");
    }
    plan.face_color.iter().for_each(|w| properties(&mut header, w));
    for (name, stored, _) in &plan.face_values {
        header.push_str(&format!("property {} {name}\n", stored.name()));
    }
    if !input.wires.is_empty() {
        let (n, t) = (input.wires.len(), index.name());
        header.push_str(&format!("element edge {n}\nproperty {t} vertex1\nproperty {t} vertex2\n"));
    }
    header.push_str("end_header\n");
    let (Sink::Text(out) | Sink::Binary(out)) = &mut sink;
    out.extend_from_slice(header.as_bytes());

    write_vertices(input, plan, all_digits, &mut sink);
    for (f, face) in faces(input).enumerate() {
        sink.put(count(longest), face.len() as f64);
        face.clone().for_each(|c| sink.put(index, input.corners[c] as f64));
        if let Some(k) = plan.texcoord {
            sink.put(count(2 * longest), 2.0 * face.len() as f64);
            for c in face.clone() {
                let value = plan.value(c, k).unwrap_or(&[0.0, 0.0]);
                value.iter().for_each(|&x| sink.put(Type::F32, x as f64));
            }
        }
        if textures.numbered {
            sink.put(Type::I32, textures.of_face(input, f) as f64);
        }
        if let Some(w) = &plan.face_color {
            let value = plan.value(face.start, w.channel).unwrap_or(&[]);
            (0..w.names.len())
                .for_each(|i| sink.put(w.stored, value.get(i).map_or(0.0, |&x| x as f64 * w.one)));
        }
        for (_, stored, values) in &plan.face_values {
            let row = input.face_row.get(f).copied().unwrap_or(NONE);
            sink.put(*stored, values.get(row as usize).copied().unwrap_or(0.0));
        }
        sink.end_element();
    }
    for wire in &input.wires {
        wire.iter().for_each(|&v| sink.put(index, v as f64));
        sink.end_element();
    }
    let (Sink::Text(out) | Sink::Binary(out)) = sink;
    out
}

fn write_vertices(input: &MeshInput, plan: &Plan<'_>, all_digits: bool, sink: &mut Sink) {
    // Text of more digits is still text.
    let stored = if all_digits && matches!(sink, Sink::Text(_)) { Type::F64 } else { Type::F32 };
    let mark = match (&input.positions, &sink) {
        (Positions::F64(p), Sink::Text(_)) => f64_mark(p.as_flattened().iter().copied()),
        _ => None,
    };
    let lists = VertexCorners::default();
    for i in 0..input.positions.len() {
        match &input.positions {
            Positions::F32(p) => p[i].iter().for_each(|&x| sink.put(stored, x as f64)),
            Positions::F64(p) => {
                for (k, &x) in p[i].iter().enumerate() {
                    if mark == Some(3 * i + k) { sink.put_marked(x) } else { sink.put(Type::F64, x) }
                }
            }
        }
        for w in &plan.vertex {
            let value = plan.of_vertex(input, &lists, i, w.channel).unwrap_or(&[]);
            for k in 0..w.names.len() {
                sink.put(w.stored, value.get(k).map_or(0.0, |&x| x as f64 * w.one));
            }
        }
        sink.end_element();
    }
}
