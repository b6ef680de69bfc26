//! Writing OBJ.

use super::mtl;
use crate::aif::{MeshInput, NONE, Positions, Semantic, Wedges};
use crate::io::flatten::flatten;
use crate::io::text::{f64_mark, write_f32, write_f64, write_f64_long, write_place};
use crate::io::{EncodeError, EncodeOptions, Encoded};
use crate::scene::{Group, Scene};
use rustc_hash::FxHashMap;
use std::io::Write;

/// Encodes a scene as OBJ, its materials as `<stem>.mtl` beside it, its images beside that.
///
/// Vertices and faces keep their order; texture coordinates and normals are written once each, in the order in which faces use them.
/// Numbers read back bit for bit. Several meshes or nodes become objects (`o`) in world space. What OBJ cannot hold is a warning.
pub fn encode(scene: &Scene, options: &EncodeOptions) -> Result<Encoded, EncodeError> {
    let flat = flatten(scene, "OBJ");
    let mut encoded = Encoded { warnings: flat.warnings, ..Default::default() };
    let stem = if options.stem.is_empty() { "mesh" } else { &options.stem };
    let names = material_names(scene);
    let mut writer = Writer::new(&flat.geometry, &mut encoded.warnings);
    let lost = scene.gltf.as_ref().map(|s| s.other_material_properties()).filter(|l| !l.is_empty());
    if let Some(lost) = lost {
        let names: Vec<&str> = lost.into_iter().collect();
        encoded.warnings.push(format!("OBJ cannot hold these properties of materials: {}", names.join(", ")));
    }
    for comment in scene.comments() {
        let _ = writeln!(writer.out, "# {comment}");
    }
    if !scene.materials.is_empty() {
        let library = format!("{}.mtl", line_name(stem));
        let _ = writeln!(writer.out, "mtllib {library}");
        let images = mtl::image_names(&scene.images, stem);
        let text = mtl::write(&scene.materials, &names, &scene.images, &images);
        encoded.side.push((library, text.into_bytes()));
        for (image, name) in scene.images.iter().zip(images) {
            if let Some(data) = &image.data {
                encoded.side.push((name, data.clone()));
            }
        }
    }
    writer.vertices(options.all_digits);
    writer.faces(&flat.groups, flat.name, &names);
    encoded.bytes = writer.out;
    Ok(encoded)
}

/// A name as it may stand at the end of a line: no control characters, no backslash last, no blanks around.
fn line_name(name: &str) -> String {
    let mut clean: String = name.trim().chars().map(|c| if c.is_control() { '_' } else { c }).collect();
    if clean.ends_with('\\') {
        clean.pop();
        clean.push('_');
    }
    clean
}

/// A name as one word.
fn word_name(name: &str) -> String {
    line_name(name).replace(char::is_whitespace, "_")
}

/// Names under which the materials are written: none empty, none twice.
fn material_names(scene: &Scene) -> Vec<String> {
    let mut taken = std::collections::BTreeSet::new();
    let mut names = Vec::with_capacity(scene.materials.len());
    for (i, m) in scene.materials.iter().enumerate() {
        let stem = match line_name(&m.name) {
            name if name.is_empty() => format!("material_{i}"),
            name => name,
        };
        let mut name = stem.clone();
        let mut k = 1;
        while !taken.insert(name.clone()) {
            k += 1;
            name = format!("{stem}_{k}");
        }
        names.push(name);
    }
    names
}

/// What OBJ cannot hold of a channel, in words; `None` if it can.
fn lost(semantic: &Semantic) -> Option<String> {
    Some(match semantic {
        Semantic::Normal | Semantic::TexCoord(0) | Semantic::Color(0) => return None,
        Semantic::Tangent => "tangents".into(),
        Semantic::TexCoord(_) => "a second set of texture coordinates".into(),
        Semantic::Color(_) => "a second set of colours".into(),
        Semantic::Joints(_) | Semantic::Weights(_) => "joints and weights".into(),
        Semantic::MorphPosition(_) | Semantic::MorphNormal(_) | Semantic::MorphTangent(_) => {
            "morph targets".into()
        }
        Semantic::Custom(name) => format!("the attribute {name}"),
    })
}

struct Writer<'a> {
    input: &'a MeshInput,
    wedges: Option<&'a Wedges>,
    normal: Option<usize>,
    texture: Option<usize>,
    /// Colour of every vertex, where there are any.
    colors: Vec<Option<[f32; 3]>>,
    out: Vec<u8>,
}

impl<'a> Writer<'a> {
    fn new(input: &'a MeshInput, warnings: &mut Vec<String>) -> Self {
        let wedges = input.wedges.as_ref();
        let channel = |s: Semantic, width: usize| {
            wedges.and_then(|w| w.channel(&s).filter(|&k| w.channels()[k].width >= width))
        };
        let (normal, texture) = (channel(Semantic::Normal, 3), channel(Semantic::TexCoord(0), 2));
        for channel in wedges.map_or(&[][..], Wedges::channels) {
            if let Some(what) = lost(&channel.semantic) {
                let warning = format!("OBJ cannot hold {what}");
                if !warnings.contains(&warning) {
                    warnings.push(warning);
                }
            }
        }
        let mut writer = Writer { input, wedges, normal, texture, colors: Vec::new(), out: Vec::new() };
        if let (Some(w), Some(k)) = (wedges, channel(Semantic::Color(0), 3)) {
            writer.gather_colors(w, k, warnings);
        }
        writer
    }

    fn wedge(&self, corner: usize) -> u32 {
        match self.wedges {
            Some(w) => w.corner.get(corner).copied().filter(|&x| (x as usize) < w.len()).unwrap_or(NONE),
            None => NONE,
        }
    }

    /// Colours belong to vertices in OBJ: the first corner's holds.
    fn gather_colors(&mut self, wedges: &Wedges, channel: usize, warnings: &mut Vec<String>) {
        let mut colors = vec![None; self.input.positions.len()];
        let (mut differ, mut translucent) = (false, false);
        for (c, &v) in self.input.corners.iter().enumerate() {
            let Some(value) = wedges.get(self.wedge(c), channel) else { continue };
            translucent |= value.get(3).is_some_and(|&a| a != 1.0);
            let color = [value[0], value[1], value[2]];
            match colors.get_mut(v as usize) {
                Some(known @ None) => *known = Some(color),
                Some(Some(known)) => differ |= known.map(f32::to_bits) != color.map(f32::to_bits),
                None => {}
            }
        }
        if differ {
            warnings
                .push("OBJ has one colour a vertex: where corners differ the first one's is written".into());
        }
        if translucent {
            warnings.push("OBJ cannot hold the alpha of vertex colours".into());
        }
        self.colors = colors;
    }

    fn vertices(&mut self, all_digits: bool) {
        let mark = match &self.input.positions {
            Positions::F64(p) => f64_mark(p.as_flattened().iter().copied()),
            Positions::F32(_) => None,
        };
        for i in 0..self.input.positions.len() {
            self.out.push(b'v');
            for k in 0..3 {
                self.out.push(b' ');
                match &self.input.positions {
                    Positions::F32(p) => write_place(&mut self.out, p[i][k], all_digits),
                    Positions::F64(p) if mark == Some(3 * i + k) => write_f64_long(&mut self.out, p[i][k]),
                    Positions::F64(p) => write_f64(&mut self.out, p[i][k]),
                }
            }
            if let Some(Some(color)) = self.colors.get(i) {
                for &x in color {
                    self.out.push(b' ');
                    write_f32(&mut self.out, x);
                }
            }
            self.out.push(b'\n');
        }
    }

    /// Writes the values of `channel` that are new, and gives each wedge the number of its value, 0 for none.
    fn values<const N: usize>(&mut self, word: &str, channel: Option<usize>) -> Vec<u32> {
        let (Some(k), Some(wedges)) = (channel, self.wedges) else { return Vec::new() };
        let mut numbers = vec![0; wedges.len()];
        let mut seen: FxHashMap<[u32; N], u32> = FxHashMap::default();
        for c in 0..self.input.corners.len() {
            let w = self.wedge(c);
            if w == NONE || numbers[w as usize] != 0 {
                continue;
            }
            let Some(value) = wedges.get(w, k) else { continue };
            let bits: [u32; N] = std::array::from_fn(|i| value[i].to_bits());
            let next = seen.len() as u32 + 1;
            let number = *seen.entry(bits).or_insert(next);
            numbers[w as usize] = number;
            if number == next {
                self.out.extend_from_slice(word.as_bytes());
                for &x in &value[..N] {
                    self.out.push(b' ');
                    write_f32(&mut self.out, x);
                }
                self.out.push(b'\n');
            }
        }
        numbers
    }

    fn faces(&mut self, groups: &[Group], name: Option<&str>, materials: &[String]) {
        let texture = self.values::<2>("vt", self.texture);
        let normal = self.values::<3>("vn", self.normal);
        let plain = Group::default();
        let (mut object, mut names, mut smoothing, mut material) = (None, &plain.names, None, NONE);
        let mut at = 0;
        for f in 0..self.input.face_count() {
            let group = self.input.face_group.get(f).and_then(|&g| groups.get(g as usize)).unwrap_or(&plain);
            let of_face = group.object.as_deref().or(name);
            if of_face != object {
                object = of_face;
                self.statement("o", &line_name(object.unwrap_or("")));
            }
            if group.names != *names {
                names = &group.names;
                let words: Vec<String> = names.iter().map(|n| word_name(n)).collect();
                self.statement("g", &words.join(" "));
            }
            if group.smoothing.as_deref() != smoothing {
                smoothing = group.smoothing.as_deref();
                self.statement("s", &line_name(smoothing.unwrap_or("off")));
            }
            let of_face =
                self.input.face_material.get(f).copied().filter(|&m| (m as usize) < materials.len());
            if of_face.unwrap_or(NONE) != material {
                material = of_face.unwrap_or(NONE);
                let name = of_face.map_or("", |m| &materials[m as usize]);
                self.statement("usemtl", name);
            }
            let size = self.input.face_sizes.as_ref().map_or(3, |s| s[f] as usize);
            let end = (at + size).min(self.input.corners.len());
            self.out.push(b'f');
            for c in at..end {
                let w = self.wedge(c) as usize;
                let number = |list: &[u32]| list.get(w).copied().unwrap_or(0);
                let v = self.input.corners[c] as u64 + 1;
                // Writing to a Vec cannot fail.
                let _ = match (number(&texture), number(&normal)) {
                    (0, 0) => write!(self.out, " {v}"),
                    (t, 0) => write!(self.out, " {v}/{t}"),
                    (0, n) => write!(self.out, " {v}//{n}"),
                    (t, n) => write!(self.out, " {v}/{t}/{n}"),
                };
            }
            self.out.push(b'\n');
            at = end;
        }
        for w in &self.input.wires {
            let _ = writeln!(self.out, "l {} {}", w[0] as u64 + 1, w[1] as u64 + 1);
        }
    }

    fn statement(&mut self, word: &str, rest: &str) {
        let space = if rest.is_empty() { "" } else { " " };
        let _ = writeln!(self.out, "{word}{space}{rest}");
    }
}
