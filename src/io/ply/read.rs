//! Reading PLY.

use super::header::{Element, Format, Header, Kind, Scalar};
use super::{COLOR_NAMES, TEXTURE_NAMES};
use crate::aif::{Bits, Channel, Encoding, MeshInput, NONE, Semantic, Wedges};
use crate::io::obj::mime_of;
use crate::io::text::{Cursor, Number, PointsReader, line_error};
use crate::io::{DecodeError, Decoded, Side};
use crate::scene::{Extras, FaceValues, Image, LooseRows, Material, Scene, SceneMesh};
use rustc_hash::FxHashMap;

/// Decodes a PLY file into one mesh. Textures it names are asked of `side`; one that is missing is a warning.
///
/// Positions declared `float` are f32; `double` is kept as f64 where f32 would lose. Every vertex with attributes has one wedge, unless
/// faces have colours or texture coordinates of their own. Other numbers of faces, and attributes of vertices without a face, are kept beside the mesh ([`Extras`]). Faces of fewer than
/// three corners are left out with a warning, as are elements and lists that a mesh cannot hold. Errors name the element, and the line in a text file. Allocates in proportion
/// to the data that are there, whatever the header announces.
pub fn decode(bytes: &[u8], side: &dyn Side) -> Result<Decoded, DecodeError> {
    let header = Header::parse(bytes)?;
    let body = bytes.get(header.body..).unwrap_or(&[]);
    match header.format {
        Format::Text => {
            let source = Text { cursor: Cursor::new(body), before: header.body_line - 1 };
            Reader::new(source, &header)?.read(side)
        }
        Format::Little => Reader::new(Binary::<false> { bytes: body, at: 0 }, &header)?.read(side),
        Format::Big => Reader::new(Binary::<true> { bytes: body, at: 0 }, &header)?.read(side),
    }
}

/// Where numbers come from.
trait Source {
    /// The next number; `None` if the data end.
    fn next(&mut self, scalar: Scalar) -> Result<Option<Number>, DecodeError>;
    /// Bytes left.
    fn left(&self) -> usize;
    /// Steps over bytes of fixed length; false if that cannot be done here.
    fn skip(&mut self, bytes: usize) -> bool;
    /// The line of the number read last, in a text file.
    fn line(&self) -> Option<usize>;
}

struct Text<'a> {
    cursor: Cursor<'a>,
    /// Lines of the header.
    before: usize,
}

impl Source for Text<'_> {
    #[inline]
    fn next(&mut self, scalar: Scalar) -> Result<Option<Number>, DecodeError> {
        loop {
            let number = self.cursor.number(scalar.name()).map_err(|e| match e {
                DecodeError::Line { line, what } => line_error(line + self.before, what),
                other => other,
            })?;
            if let Some(n) = number {
                // What is declared single precision is, whatever the digits say.
                return Ok(Some(if scalar == Scalar::F32 {
                    Number::exact(n.value as f32 as f64)
                } else {
                    n
                }));
            }
            if !self.cursor.next_line() {
                return Ok(None);
            }
        }
    }

    fn left(&self) -> usize {
        self.cursor.left()
    }

    fn skip(&mut self, _: usize) -> bool {
        false
    }

    fn line(&self) -> Option<usize> {
        Some(self.before + self.cursor.line())
    }
}

struct Binary<'a, const BIG: bool> {
    bytes: &'a [u8],
    at: usize,
}

impl<const BIG: bool> Binary<'_, BIG> {
    #[inline]
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let mut array: [u8; N] = *self.bytes.get(self.at..)?.first_chunk::<N>()?;
        self.at += N;
        if BIG {
            array.reverse();
        }
        Some(array)
    }
}

impl<const BIG: bool> Source for Binary<'_, BIG> {
    #[inline]
    fn next(&mut self, scalar: Scalar) -> Result<Option<Number>, DecodeError> {
        let value = match scalar {
            Scalar::I8 => self.take::<1>().map(|b| i8::from_le_bytes(b) as f64),
            Scalar::U8 => self.take::<1>().map(|b| b[0] as f64),
            Scalar::I16 => self.take::<2>().map(|b| i16::from_le_bytes(b) as f64),
            Scalar::U16 => self.take::<2>().map(|b| u16::from_le_bytes(b) as f64),
            Scalar::I32 => self.take::<4>().map(|b| i32::from_le_bytes(b) as f64),
            Scalar::U32 => self.take::<4>().map(|b| u32::from_le_bytes(b) as f64),
            Scalar::F32 => self.take::<4>().map(|b| f32::from_le_bytes(b) as f64),
            Scalar::F64 => self.take::<8>().map(f64::from_le_bytes),
        };
        Ok(value.map(Number::exact))
    }

    fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    fn skip(&mut self, bytes: usize) -> bool {
        self.at = (self.at + bytes).min(self.bytes.len());
        true
    }

    fn line(&self) -> Option<usize> {
        None
    }
}

/// What a vertex property is for.
#[derive(Clone, Copy)]
enum Target {
    /// A coordinate.
    Position(usize),
    /// A value of the vertex's row: where, and what stands for 1.
    Row {
        at: usize,
        one: f64,
    },
    Nothing,
}

/// Attributes that faces have of their own.
#[derive(Default)]
struct FaceAttributes {
    /// `red green blue alpha` of the face, by property, and what stands for 1.
    color: Vec<(usize, f64)>,
    encoding: Encoding,
    /// The list of texture coordinates.
    texture: Option<usize>,
    /// Values of every corner: two texture coordinates, then the colour.
    rows: Vec<f32>,
}

impl FaceAttributes {
    fn stride(&self) -> usize {
        2 * self.texture.is_some() as usize + self.color.len()
    }
}

struct Reader<'h, S> {
    source: S,
    header: &'h Header,
    vertices: usize,
    points: PointsReader,
    channels: Vec<Channel>,
    rows: Vec<f32>,
    corners: Vec<u32>,
    /// Empty as long as all faces are triangles.
    sizes: Vec<u32>,
    faces: usize,
    wires: Vec<[u32; 2]>,
    face: FaceAttributes,
    texture_number: Vec<u32>,
    /// Other numbers of faces, and which of them each face has; empty as long as there are none.
    face_values: Vec<FaceValues>,
    face_row: Vec<u32>,
    loose: LooseRows,
    warnings: Vec<String>,
}

impl<'h, S: Source> Reader<'h, S> {
    fn new(source: S, header: &'h Header) -> Result<Self, DecodeError> {
        let Some(vertex) = header.elements.iter().find(|e| e.name == "vertex") else {
            return Err(header_error("no element vertex"));
        };
        if vertex.count >= NONE as u64 {
            return Err(header_error(format!("{} vertices; ids can name {}", vertex.count, NONE - 1)));
        }
        Ok(Reader {
            source,
            header,
            vertices: vertex.count as usize,
            points: PointsReader::default(),
            channels: Vec::new(),
            rows: Vec::new(),
            corners: Vec::new(),
            sizes: Vec::new(),
            faces: 0,
            wires: Vec::new(),
            face: FaceAttributes::default(),
            texture_number: Vec::new(),
            face_values: Vec::new(),
            face_row: Vec::new(),
            loose: LooseRows::default(),
            warnings: Vec::new(),
        })
    }

    fn read(mut self, side: &dyn Side) -> Result<Decoded, DecodeError> {
        for element in &self.header.elements {
            // Before anything is read or reserved: the data must be able to hold what is announced.
            let least = element.least_bytes(self.header.format) as u64;
            let left = self.source.left() as u64 + 1;
            if least > 0 && element.count.saturating_mul(least) > left {
                let what =
                    format!("{} are announced, but the data end early: {left} bytes are left", element.count);
                return Err(DecodeError::Element { element: format!("element {}", element.name), what });
            }
            match element.name.as_str() {
                "vertex" => self.vertex_element(element)?,
                "face" => self.face_element(element)?,
                "tristrips" => self.strips(element)?,
                "edge" => self.edges(element)?,
                _ => {
                    self.warnings.push(format!("element {} is left out", element.name));
                    self.skip_element(element)?;
                }
            }
        }
        self.finish(side)
    }

    /// An error at an element's `i`th.
    fn fail(&self, element: &Element, i: u64, what: impl std::fmt::Display) -> DecodeError {
        let name = format!("{} {i}", element.name);
        match self.source.line() {
            Some(line) => line_error(line, format!("{name}: {what}")),
            None => DecodeError::Element { element: name, what: what.to_string() },
        }
    }

    #[inline]
    fn number(&mut self, scalar: Scalar, element: &Element, i: u64) -> Result<Number, DecodeError> {
        match self.source.next(scalar)? {
            Some(n) => Ok(n),
            None => {
                Err(self.fail(element, i, format!("the data end early ({} are announced)", element.count)))
            }
        }
    }

    /// How many items a list has.
    #[inline]
    fn list_length(&mut self, count: Scalar, element: &Element, i: u64) -> Result<usize, DecodeError> {
        let n = self.number(count, element, i)?.value;
        if n < 0.0 || n.fract() != 0.0 || n > u32::MAX as f64 {
            return Err(self.fail(element, i, format!("a list of {n} items")));
        }
        Ok(n as usize)
    }

    fn skip_property(&mut self, kind: Kind, element: &Element, i: u64) -> Result<(), DecodeError> {
        match kind {
            Kind::One(t) => {
                self.number(t, element, i)?;
            }
            Kind::List { count, item } => {
                for _ in 0..self.list_length(count, element, i)? {
                    self.number(item, element, i)?;
                }
            }
        }
        Ok(())
    }

    fn skip_element(&mut self, element: &Element) -> Result<(), DecodeError> {
        if element.properties.is_empty() {
            return Ok(());
        }
        let fixed = element.properties.iter().all(|p| matches!(p.kind, Kind::One(_)));
        let bytes = element.count.saturating_mul(element.least_bytes(self.header.format) as u64);
        if fixed && self.header.format != Format::Text {
            if bytes > self.source.left() as u64 {
                return Err(self.fail(element, element.count.saturating_sub(1), "the data end early"));
            }
            self.source.skip(bytes as usize);
            return Ok(());
        }
        for i in 0..element.count {
            for p in &element.properties {
                self.skip_property(p.kind, element, i)?;
            }
        }
        Ok(())
    }

    fn vertex_element(&mut self, element: &Element) -> Result<(), DecodeError> {
        let targets = self.plan_vertices(element)?;
        let stride: usize = self.channels.iter().map(|c| c.width).sum();
        let kinds: Vec<(Kind, Target)> = element.properties.iter().map(|p| p.kind).zip(targets).collect();
        self.points.reserve(self.vertices);
        self.rows.reserve(stride * self.vertices);
        let mut point = [Number::exact(0.0); 3];
        let mut rounded = false;
        for i in 0..element.count {
            let base = self.rows.len();
            self.rows.resize(base + stride, 0.0);
            for &(kind, target) in &kinds {
                match (kind, target) {
                    (Kind::One(t), Target::Position(k)) => point[k] = self.number(t, element, i)?,
                    (Kind::One(t), Target::Row { at, one }) => {
                        let number = self.number(t, element, i)?;
                        if matches!(t, Scalar::I32 | Scalar::U32 | Scalar::F64) {
                            rounded |= !number.fits_f32();
                        }
                        self.rows[base + at] = (number.value / one) as f32;
                    }
                    (kind, _) => self.skip_property(kind, element, i)?,
                }
            }
            if let Some(k) = (0..3).find(|&k| !point[k].value.is_finite()) {
                let what =
                    format!("{} is {}; coordinates must be finite", ["x", "y", "z"][k], point[k].value);
                return Err(self.fail(element, i, what));
            }
            self.points.push_finite(point);
        }
        if rounded {
            self.warnings
                .push("vertex attributes of type int, uint or double are rounded to single precision".into());
        }
        Ok(())
    }

    /// Makes the channels, and says what each property is for.
    fn plan_vertices(&mut self, element: &Element) -> Result<Vec<Target>, DecodeError> {
        let mut targets = vec![Target::Nothing; element.properties.len()];
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            let Some((i, _)) = element.scalar(axis) else {
                return Err(header_error(format!("element vertex has no property {axis}")));
            };
            targets[i] = Target::Position(k);
        }
        let mut used: Vec<bool> = targets.iter().map(|t| matches!(t, Target::Position(_))).collect();
        let mut stride = 0;
        let find = |names: &[&str]| -> Option<Vec<(usize, Scalar)>> {
            names.iter().map(|n| element.scalar(n)).collect()
        };
        let texture = TEXTURE_NAMES.iter().find_map(|names| find(names));
        let color = color_properties(element);
        for (semantic, properties) in [
            (Semantic::Normal, find(&["nx", "ny", "nz"])),
            (Semantic::TexCoord(0), texture),
            (Semantic::Color(0), color),
        ] {
            let Some(properties) = properties else { continue };
            let is_color = matches!(semantic, Semantic::Color(_));
            let first = properties[0].1;
            let encoding = if is_color { first.color().0 } else { first.encoding() };
            for &(i, scalar) in &properties {
                let one = if is_color { scalar.color().1 } else { 1.0 };
                targets[i] = Target::Row { at: stride, one };
                used[i] = true;
                stride += 1;
            }
            self.channels.push(Channel { semantic, width: properties.len(), encoding });
        }
        let mut lists = Vec::new();
        let mut surplus = 0;
        let mut names = std::collections::BTreeSet::new();
        for (i, p) in element.properties.iter().enumerate().filter(|&(i, _)| !used[i]) {
            match p.kind {
                Kind::List { .. } => lists.push(p.name.as_str()),
                Kind::One(_) if self.channels.len() >= 64 || !names.insert(&p.name) => surplus += 1,
                Kind::One(t) => {
                    targets[i] = Target::Row { at: stride, one: 1.0 };
                    stride += 1;
                    let semantic = Semantic::Custom(p.name.clone());
                    self.channels.push(Channel { semantic, width: 1, encoding: t.encoding() });
                }
            }
        }
        if !lists.is_empty() {
            self.warnings.push(format!("list properties of vertices are left out: {}", some_of(&lists)));
        }
        if surplus > 0 {
            self.warnings.push(format!(
                "{surplus} vertex properties (of a name again, or beyond 64 attributes) are left out"
            ));
        }
        Ok(targets)
    }

    /// A vertex index, checked.
    #[inline]
    fn index(&self, value: f64, element: &Element, i: u64) -> Result<u32, DecodeError> {
        if value >= 0.0 && value < self.vertices as f64 && value.fract() == 0.0 {
            return Ok(value as u32);
        }
        let what = format!("vertex index {value} of {}; indices run from 0 to one less", self.vertices);
        Err(self.fail(element, i, what))
    }

    fn face_element(&mut self, element: &Element) -> Result<(), DecodeError> {
        let Some(indices) = element.list(&["vertex_indices", "vertex_index"]) else {
            self.warnings.push("element face has no list vertex_indices: it is left out".into());
            return self.skip_element(element);
        };
        self.face.texture = element.list(&["texcoord"]);
        let number = element.scalar("texnumber").map(|(i, _)| i);
        if let Some(list) = color_properties(element) {
            // Where vertices have colours, too, these are numbers like others.
            if !self.channels.iter().any(|c| c.semantic == Semantic::Color(0)) {
                self.face.encoding = list[0].1.color().0;
                self.face.color = list.iter().map(|&(i, t)| (i, t.color().1)).collect();
            }
        }
        let known = |i: usize| {
            i == indices
                || Some(i) == self.face.texture
                || Some(i) == number
                || self.face.color.iter().any(|c| c.0 == i)
        };
        // The column of each property that is a number like others.
        let mut column = vec![NONE; element.properties.len()];
        let mut others = Vec::new();
        let again = !self.face_values.is_empty();
        for (i, p) in element.properties.iter().enumerate().filter(|&(i, _)| !known(i)) {
            match p.kind {
                Kind::One(t) if !again && self.face_values.iter().all(|v| v.name != p.name) => {
                    column[i] = self.face_values.len() as u32;
                    let encoding = t.encoding();
                    self.face_values.push(FaceValues { name: p.name.clone(), encoding, values: vec![] });
                }
                _ => others.push(p.name.as_str()),
            }
        }
        if !others.is_empty() {
            self.warnings.push(format!(
                "lists of faces other than their vertices and texture coordinates, and properties of a name again, are left out: {}",
                some_of(&others)
            ));
        }
        let valued = !again && !self.face_values.is_empty();
        // Most files are triangles with a byte for the count.
        let room = (element.count as usize).saturating_mul(3).min(self.source.left());
        self.corners.reserve(room);

        // Corners and faces of elements before this one have nothing of their own.
        self.face.rows.resize(self.corners.len() * self.face.stride(), f32::NAN);
        self.texture_number.resize(if number.is_some() { self.faces } else { 0 }, 0);
        self.face_row.resize(if valued { self.faces } else { self.face_row.len() }, NONE);
        let mut row = vec![0.0; if valued { self.face_values.len() } else { 0 }];
        let (mut short, mut odd) = (0usize, 0usize);
        let mut texture: Vec<f32> = Vec::new();
        let mut color = [0.0f32; 4];
        for i in 0..element.count {
            let first = self.corners.len();
            let mut of_face = NONE;
            texture.clear();
            for (k, p) in element.properties.iter().enumerate() {
                match p.kind {
                    Kind::List { count, item } if k == indices => {
                        for _ in 0..self.list_length(count, element, i)? {
                            let value = self.number(item, element, i)?.value;
                            let v = self.index(value, element, i)?;
                            self.corners.push(v);
                        }
                    }
                    Kind::List { count, item } if Some(k) == self.face.texture => {
                        for _ in 0..self.list_length(count, element, i)? {
                            texture.push(self.number(item, element, i)?.value as f32);
                        }
                    }
                    Kind::One(t) if Some(k) == number => {
                        let value = self.number(t, element, i)?.value;
                        of_face = if value >= 0.0 && value < NONE as f64 { value as u32 } else { NONE };
                    }
                    Kind::One(t) => match self.face.color.iter().position(|c| c.0 == k) {
                        Some(c) => {
                            color[c] = (self.number(t, element, i)?.value / self.face.color[c].1) as f32
                        }
                        None => {
                            let value = self.number(t, element, i)?.value;
                            if let Some(to) = row.get_mut(column[k] as usize) {
                                *to = value;
                            }
                        }
                    },
                    kind => self.skip_property(kind, element, i)?,
                }
            }
            let n = self.corners.len() - first;
            if n < 3 {
                self.corners.truncate(first);
                short += 1;
                continue;
            }
            if self.face.stride() > 0 {
                if self.face.texture.is_some() && texture.len() != 2 * n {
                    odd += 1;
                    texture.clear();
                    texture.resize(2 * n, f32::NAN);
                }
                for c in 0..n {
                    self.face.rows.extend(texture.get(2 * c..2 * c + 2).unwrap_or(&[]));
                    self.face.rows.extend(&color[..self.face.color.len()]);
                }
            }
            if number.is_some() {
                self.texture_number.push(of_face);
            }
            if valued {
                self.face_row.push(self.face_values[0].values.len() as u32);
                self.face_values.iter_mut().zip(&row).for_each(|(of, &x)| of.values.push(x));
            }
            self.add_face(n);
        }
        if short > 0 {
            self.warnings.push(format!("{short} faces of fewer than three corners are left out"));
        }
        if odd > 0 {
            self.warnings
                .push(format!("{odd} faces have no two texture coordinates a corner: they have none"));
        }
        Ok(())
    }

    /// Counts a face whose `n` corners were pushed.
    #[inline]
    fn add_face(&mut self, n: usize) {
        if n != 3 && self.sizes.is_empty() {
            self.sizes.resize(self.faces, 3);
        }
        if n != 3 || !self.sizes.is_empty() {
            self.sizes.push(n as u32);
        }
        self.faces += 1;
    }

    fn strips(&mut self, element: &Element) -> Result<(), DecodeError> {
        let Some(indices) = element.list(&["vertex_indices", "vertex_index"]) else {
            self.warnings.push("element tristrips has no list vertex_indices: it is left out".into());
            return self.skip_element(element);
        };
        if element.properties.len() > 1 {
            self.warnings.push("properties of tristrips other than their vertices are left out".into());
        }
        for i in 0..element.count {
            for (k, p) in element.properties.iter().enumerate() {
                let Kind::List { count, item } = p.kind else {
                    self.skip_property(p.kind, element, i)?;
                    continue;
                };
                if k != indices {
                    self.skip_property(p.kind, element, i)?;
                    continue;
                }
                // The last two vertices, and how many the strip has so far.
                let (mut a, mut b, mut length) = (NONE, NONE, 0usize);
                for _ in 0..self.list_length(count, element, i)? {
                    let value = self.number(item, element, i)?.value;
                    if value == -1.0 {
                        length = 0;
                        continue;
                    }
                    let v = self.index(value, element, i)?;
                    length += 1;
                    // Every other triangle runs the other way; a vertex twice only serves to turn the strip.
                    if length >= 3 && a != b && b != v && v != a {
                        let triangle = if length % 2 == 1 { [a, b, v] } else { [b, a, v] };
                        self.corners.extend(triangle);
                        self.add_face(3);
                    }
                    (a, b) = (b, v);
                }
            }
        }
        Ok(())
    }

    fn edges(&mut self, element: &Element) -> Result<(), DecodeError> {
        let (Some((a, _)), Some((b, _))) = (element.scalar("vertex1"), element.scalar("vertex2")) else {
            self.warnings.push("element edge has no vertex1 and vertex2: it is left out".into());
            return self.skip_element(element);
        };
        if element.properties.len() > 2 {
            self.warnings.push("properties of edges other than their vertices are left out".into());
        }
        for i in 0..element.count {
            let mut wire = [0; 2];
            for (k, p) in element.properties.iter().enumerate() {
                match p.kind {
                    Kind::One(t) if k == a || k == b => {
                        let value = self.number(t, element, i)?.value;
                        wire[(k == b) as usize] = self.index(value, element, i)?;
                    }
                    kind => self.skip_property(kind, element, i)?,
                }
            }
            self.wires.push(wire);
        }
        Ok(())
    }

    fn finish(mut self, side: &dyn Side) -> Result<Decoded, DecodeError> {
        // Faces of several elements: only those of `face` have attributes of their own, and all come in file order.
        let wedges = self.wedges();
        if !self.face_row.is_empty() {
            self.face_row.resize(self.faces, NONE);
        }
        let mut scene = Scene::from_mesh(SceneMesh {
            name: None,
            geometry: MeshInput {
                positions: self.points.finish(),
                face_sizes: (!self.sizes.is_empty()).then_some(self.sizes),
                corners: self.corners,
                wires: self.wires,
                wedges,
                face_material: Vec::new(),
                face_group: Vec::new(),
                face_row: self.face_row,
            },
            groups: Vec::new(),
            extras: Extras { of_faces: self.face_values, loose: self.loose },
        });
        for name in &self.header.textures {
            let data = match side.load(name) {
                Ok(bytes) => Some(bytes),
                Err(why) => {
                    self.warnings.push(format!("texture {name} could not be read ({why})"));
                    None
                }
            };
            let image = Some(scene.images.len());
            let mime = mime_of(name, data.as_deref());
            scene.images.push(Image { uri: Some(name.clone()), mime, name: None, data });
            scene.materials.push(Material {
                name: name.clone(),
                base_color_image: image,
                ..Default::default()
            });
        }
        if !scene.materials.is_empty() {
            let textures = scene.materials.len() as u32;
            let mut of_face = self.texture_number;
            // Without numbers all faces have the first texture; so have those of strips.
            of_face.resize(self.faces, 0);
            of_face.iter_mut().filter(|t| **t >= textures).for_each(|t| *t = NONE);
            scene.meshes[0].geometry.face_material = of_face;
        }
        Ok(Decoded { scene, warnings: self.warnings })
    }

    /// The wedges: one for every used vertex, or for every distinct row where faces have attributes of their own.
    fn wedges(&mut self) -> Option<Wedges> {
        let own = self.channels.len();
        let stride: usize = self.channels.iter().map(|c| c.width).sum();
        let mut channels = std::mem::take(&mut self.channels);
        let face_stride = self.face.stride();
        if self.face.texture.is_some() {
            if let Some(c) = channels.iter_mut().find(|c| c.semantic == Semantic::TexCoord(0)) {
                // Those of the corners say more.
                c.semantic = Semantic::Custom("texture_of_vertex".into());
            }
            channels.push(Channel::new(Semantic::TexCoord(0), 2));
        }
        if !self.face.color.is_empty() {
            let width = self.face.color.len();
            channels.push(Channel { semantic: Semantic::Color(0), width, encoding: self.face.encoding });
        }
        let surplus = channels.len().saturating_sub(64);
        channels.drain(own - surplus.min(own)..own);
        if channels.is_empty() {
            return None;
        }
        let mut used = Bits::new(self.vertices);
        self.corners.iter().for_each(|&v| used.set(v as usize));
        let isolated = self.points.len().saturating_sub(used.count());
        if self.corners.is_empty() {
            if isolated > 0 && own > 0 {
                self.warnings
                    .push(format!("the attributes of {isolated} vertices without a face are left out"));
            }
            return None;
        }
        let widths: Vec<usize> = channels.iter().map(|c| c.width).collect();
        let mut wedges = Wedges::new(channels).ok()?;
        let mut lost = 0usize;
        let mut row = vec![0.0f32; wedges.stride()];
        let mut push = |wedges: &mut Wedges, vertex: &[f32], face: &[f32]| -> u32 {
            // (With more than 64 channels the last of the vertex's were dropped.)
            let of_vertex = row.len() - face_stride;
            row[..of_vertex].copy_from_slice(&vertex[..of_vertex]);
            if face.is_empty() {
                row[of_vertex..].fill(f32::NAN);
            } else {
                row[of_vertex..].copy_from_slice(face);
            }
            let (mut present, mut at) = (0u64, 0);
            for (k, &width) in widths.iter().enumerate() {
                let values = &mut row[at..at + width];
                if values.iter().all(|x| x.is_finite()) {
                    present |= 1 << k;
                } else {
                    lost += 1;
                    values.fill(0.0);
                }
                at += width;
            }
            wedges.push(&row, present)
        };
        let rows = &self.rows;
        let of_vertex = |v: u32| &rows[v as usize * stride..(v as usize + 1) * stride];
        let mut corner = Vec::with_capacity(self.corners.len());
        if face_stride == 0 {
            let mut ids = vec![NONE; self.vertices];
            for (v, id) in ids.iter_mut().enumerate().filter(|(v, _)| used.get(*v)) {
                *id = push(&mut wedges, of_vertex(v as u32), &[]);
            }
            corner.extend(self.corners.iter().map(|&v| ids[v as usize]));
        } else {
            let mut seen: FxHashMap<(u32, [u32; 6]), u32> = FxHashMap::default();
            for (c, &v) in self.corners.iter().enumerate() {
                let face = self.face.rows.get(c * face_stride..(c + 1) * face_stride).unwrap_or(&[]);
                let mut bits = [u32::MAX; 6];
                bits.iter_mut().zip(face).for_each(|(b, x)| *b = x.to_bits());
                let id = *seen.entry((v, bits)).or_insert_with(|| push(&mut wedges, of_vertex(v), face));
                corner.push(id);
            }
        }
        if isolated > 0 && own > 0 {
            let mut loose = Wedges::new(wedges.channels().to_vec()).ok()?;
            for v in (0..self.vertices as u32).filter(|&v| !used.get(v as usize)) {
                let id = push(&mut loose, of_vertex(v), &[]);
                self.loose.vertices.push(v);
                self.loose.present.push(loose.present(id));
                self.loose.rows.extend_from_slice(loose.row(id));
            }
        }
        if lost > 0 {
            self.warnings.push(format!("attribute values that are not finite are left out ({lost})"));
        }
        wedges.corner = corner;
        Some(wedges)
    }
}

/// Red, green, blue and perhaps alpha, by any of their names.
fn color_properties(element: &Element) -> Option<Vec<(usize, Scalar)>> {
    COLOR_NAMES.iter().find_map(|names| {
        let mut list: Vec<_> = names[..3].iter().map(|n| element.scalar(n)).collect::<Option<_>>()?;
        list.extend(element.scalar(names[3]));
        Some(list)
    })
}

fn header_error(what: impl Into<String>) -> DecodeError {
    DecodeError::Element { element: "header".into(), what: what.into() }
}

/// The first few of a list of names.
fn some_of(names: &[&str]) -> String {
    let more = if names.len() > 12 { ", ..." } else { "" };
    format!("{}{more}", names[..names.len().min(12)].join(", "))
}
