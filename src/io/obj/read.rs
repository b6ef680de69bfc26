//! Reading OBJ.

use super::mtl::Library;
use crate::aif::NONE;
use crate::aif::{Bits, Channel, MeshInput, Semantic, Wedges};
use crate::io::notes::Notes;
use crate::io::text::{Cursor, PointsReader, line_error, scan_int, show};
use crate::io::{DecodeError, Decoded, Side};
use crate::scene::{Group, Material, Scene, SceneMesh};
use rustc_hash::FxHashMap;

const LOST_ATTRIBUTES: &str = "a normal, texture coordinate or colour that is not finite is left out";

/// Decodes an OBJ file into one mesh. Files it names are asked of `side`; one that is missing is a warning.
///
/// Errors name the line: a number that is none or not finite, an index that is 0 or names nothing, a malformed corner. Faces of
/// fewer than three corners are left out with a warning. Faces, vertices (unused ones too) and groups keep their order. Corners of
/// a vertex with the same texture coordinate and normal index share a wedge.
pub fn decode(bytes: &[u8], side: &dyn Side) -> Result<Decoded, DecodeError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut reader = Reader::default();
    let mut cursor = Cursor::with_continuation(bytes);
    loop {
        reader.statement(&mut cursor, side)?;
        if !cursor.next_line() {
            break;
        }
    }
    reader.finish()
}

/// One of the three lists that a corner's indices name.
#[derive(Clone, Copy)]
enum List {
    Vertex,
    Texture,
    Normal,
}

impl List {
    fn name(self) -> &'static str {
        ["vertex", "texture coordinate", "normal"][self as usize]
    }

    fn plural(self) -> &'static str {
        ["vertices", "texture coordinates", "normals"][self as usize]
    }
}

/// A corner as written: indices from 0, `NONE` for what it does not have.
type Corner = [u32; 3];

/// A wedge to be: a vertex, and its texture coordinate and normal index.
struct Key {
    corner: Corner,
    /// The key made before this one for the same vertex.
    next: u32,
}

/// Keys of a vertex are chained up to this many, the others hashed: a chain is quickest for the usual one to four, and
/// a hostile vertex may have a million.
const CHAIN: usize = 16;

#[derive(Default)]
struct Reader {
    points: PointsReader,
    colors: Vec<Option<[f32; 3]>>,
    texture: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    corners: Vec<u32>,
    /// Empty as long as all faces are triangles.
    sizes: Vec<u32>,
    faces: usize,
    wires: Vec<[u32; 2]>,
    keys: Vec<Key>,
    /// The last key of a vertex.
    head: Vec<u32>,
    hashed: FxHashMap<Corner, u32>,
    /// The key of every corner; empty as long as no corner has more than a vertex.
    corner_key: Vec<u32>,
    /// For every list, the forward references that reach farther than those before, with their lines.
    forward: [Vec<(u32, usize)>; 3],
    state: Group,
    /// Id of `state`, if it was looked up since it changed.
    state_id: Option<u32>,
    groups: Vec<Group>,
    group_ids: FxHashMap<Group, u32>,
    face_group: Vec<u32>,
    material: u32,
    material_names: Vec<String>,
    material_ids: FxHashMap<String, u32>,
    face_material: Vec<u32>,
    library: Library,
    libraries: Vec<String>,
    notes: Notes,
    /// The corners of the statement being read.
    polygon: Vec<Corner>,
}

impl Reader {
    fn statement(&mut self, cursor: &mut Cursor<'_>, side: &dyn Side) -> Result<(), DecodeError> {
        let Some(word) = cursor.token() else { return Ok(()) };
        match word {
            b"v" => self.vertex(cursor),
            b"f" | b"fo" => self.face(cursor),
            b"vt" => self.texture_coordinate(cursor),
            b"vn" => self.normal(cursor),
            b"l" => self.polyline(cursor),
            b"p" => {
                self.elements(cursor)?;
                let line = cursor.line();
                self.notes.at(line, "points (p) are left out; their vertices are kept");
                Ok(())
            }
            b"o" | b"g" | b"s" => {
                let name = cursor.rest_of_line();
                match word {
                    b"o" => self.state.object = (!name.is_empty()).then_some(name),
                    b"g" => self.state.names = name.split_whitespace().map(str::to_string).collect(),
                    _ => self.state.smoothing = (!name.is_empty()).then_some(name),
                }
                self.state_id = None;
                Ok(())
            }
            b"usemtl" => {
                let name = cursor.rest_of_line();
                self.use_material(name);
                Ok(())
            }
            b"mtllib" => {
                let names = cursor.rest_of_line();
                if names.is_empty() {
                    self.notes.at(cursor.line(), "mtllib names no file");
                } else if !self.libraries.contains(&names) {
                    self.library.load(&names, side);
                    self.libraries.push(names);
                }
                Ok(())
            }
            _ if word[0] == b'#' => {
                cursor.skip_comment();
                Ok(())
            }
            _ if word.len() <= 32 && word.iter().all(|b| b.is_ascii_alphanumeric() || *b == b'_') => {
                let name = String::from_utf8_lossy(word);
                self.notes.at(cursor.line(), &format!("the statement {name} is not read"));
                Ok(())
            }
            _ => Err(line_error(cursor.line(), format!("{} is no OBJ statement", show(word)))),
        }
    }

    fn vertex(&mut self, cursor: &mut Cursor<'_>) -> Result<(), DecodeError> {
        let line = cursor.line();
        let (Some(x), Some(y), Some(z)) = (cursor.number("v")?, cursor.number("v")?, cursor.number("v")?)
        else {
            return Err(line_error(line, "v needs three numbers, x y z"));
        };
        self.points.push([x, y, z], line)?;
        let Some(fourth) = cursor.number("v")? else { return Ok(()) };
        let mut more = [fourth.value as f32, 0.0, 0.0, 0.0];
        let mut n = 1;
        while let Some(number) = cursor.number("v")? {
            if let Some(slot) = more.get_mut(n) {
                *slot = number.value as f32;
            }
            n += 1;
        }
        match n {
            1 if fourth.value == 1.0 => {}
            1 => self.notes.at(line, "a vertex weight other than 1 is left out"),
            3 | 4 => {
                let color = [more[0], more[1], more[2]];
                if color.iter().all(|c| c.is_finite()) {
                    self.colors.resize(self.points.len(), None);
                    self.colors[self.points.len() - 1] = Some(color);
                } else {
                    self.notes.at(line, LOST_ATTRIBUTES);
                }
                if n == 4 {
                    self.notes.at(line, "the fourth number of a vertex colour is left out");
                }
            }
            _ => {
                self.notes.at(line, "numbers after x y z that are neither a weight nor a colour are left out")
            }
        }
        Ok(())
    }

    fn texture_coordinate(&mut self, cursor: &mut Cursor<'_>) -> Result<(), DecodeError> {
        let line = cursor.line();
        let Some(u) = cursor.number("vt")? else {
            return Err(line_error(line, "vt needs at least one number"));
        };
        let v = cursor.number("vt")?.map_or(0.0, |n| n.value);
        if cursor.number("vt")?.is_some_and(|w| w.value != 0.0) {
            self.notes.at(line, "the third number of a texture coordinate is left out");
        }
        self.texture.push([u.value as f32, v as f32]);
        Ok(())
    }

    fn normal(&mut self, cursor: &mut Cursor<'_>) -> Result<(), DecodeError> {
        let line = cursor.line();
        match (cursor.number("vn")?, cursor.number("vn")?, cursor.number("vn")?) {
            (Some(x), Some(y), Some(z)) => self.normals.push([x, y, z].map(|n| n.value as f32)),
            _ => return Err(line_error(line, "vn needs three numbers, x y z")),
        }
        Ok(())
    }

    /// An index as written, from 0. Those that point past what is defined so far are checked at the end.
    #[inline]
    fn resolve(&mut self, list: List, index: i64, line: usize) -> Result<u32, DecodeError> {
        let count = match list {
            List::Vertex => self.points.len(),
            List::Texture => self.texture.len(),
            List::Normal => self.normals.len(),
        };
        if index > 0 && index as u64 <= count as u64 {
            return Ok((index - 1) as u32);
        }
        let name = list.name();
        if index == 0 {
            let what = format!("{name} index 0; indices count from 1, or back from -1");
            return Err(line_error(line, what));
        }
        if index < 0 {
            return match (count as i64).checked_add(index) {
                Some(i) if i >= 0 => Ok(i as u32),
                _ => {
                    Err(line_error(line, format!("{name} index {index}; {} so far: {count}", list.plural())))
                }
            };
        }
        if index >= NONE as i64 {
            return Err(line_error(
                line,
                format!("{name} index {index} is beyond the {} that ids can name", NONE - 1),
            ));
        }
        let forward = &mut self.forward[list as usize];
        if forward.last().is_none_or(|&(farthest, _)| index as u32 > farthest) {
            forward.push((index as u32, line));
        }
        Ok((index - 1) as u32)
    }

    /// Reads the corners of a statement (`v`, `v/vt`, `v//vn`, `v/vt/vn`) into `polygon`.
    fn elements(&mut self, cursor: &mut Cursor<'_>) -> Result<(), DecodeError> {
        self.polygon.clear();
        while let Some(token) = cursor.token() {
            let line = cursor.line();
            let mut corner = [NONE; 3];
            let mut at = 0;
            for (k, list) in [List::Vertex, List::Texture, List::Normal].into_iter().enumerate() {
                if let Some((index, len)) = scan_int(&token[at..]) {
                    corner[k] = self.resolve(list, index, line)?;
                    at += len;
                } else if k == 0 {
                    break;
                }
                if token.get(at) != Some(&b'/') {
                    break;
                }
                at += (k < 2) as usize;
            }
            if at < token.len() || corner[0] == NONE {
                let shown = show(token);
                if token[0] == b'#' {
                    cursor.skip_comment();
                    break;
                }
                return Err(line_error(
                    line,
                    format!("{shown} is no corner; it must look like 1, 1/2, 1//3 or 1/2/3"),
                ));
            }
            self.polygon.push(corner);
        }
        Ok(())
    }

    fn face(&mut self, cursor: &mut Cursor<'_>) -> Result<(), DecodeError> {
        let line = cursor.line();
        self.elements(cursor)?;
        let n = self.polygon.len();
        if n < 3 {
            self.notes.at(line, "a face of fewer than three corners is left out");
            return Ok(());
        }
        if n != 3 && self.sizes.is_empty() {
            self.sizes.resize(self.faces, 3);
        }
        if n != 3 || !self.sizes.is_empty() {
            self.sizes.push(n as u32);
        }
        for k in 0..n {
            let corner = self.polygon[k];
            let plain = corner[1] == NONE && corner[2] == NONE;
            if !plain || !self.corner_key.is_empty() {
                self.corner_key.resize(self.corners.len(), NONE);
                let key = if plain { NONE } else { self.key(corner) };
                self.corner_key.push(key);
            }
            self.corners.push(corner[0]);
        }
        self.group_face();
        if self.material != 0 || !self.face_material.is_empty() {
            self.face_material.resize(self.faces, NONE);
            self.face_material.push(self.material.wrapping_sub(1));
        }
        self.faces += 1;
        Ok(())
    }

    /// The key of a corner, made if it is new.
    #[inline]
    fn key(&mut self, corner: Corner) -> u32 {
        let v = corner[0] as usize;
        let id = self.keys.len() as u32;
        // Forward references may be any number: they are hashed, so that nothing grows with them.
        let mut chained = v < self.points.len();
        if chained {
            if self.head.len() <= v {
                self.head.resize(self.points.len(), NONE);
            }
            let (mut k, mut length) = (self.head[v], 0);
            while k != NONE {
                if self.keys[k as usize].corner == corner {
                    return k;
                }
                k = self.keys[k as usize].next;
                length += 1;
            }
            chained = length < CHAIN;
        }
        if (!chained || !self.hashed.is_empty())
            && let Some(&k) = self.hashed.get(&corner)
        {
            return k;
        }
        let mut next = NONE;
        if chained {
            next = std::mem::replace(&mut self.head[v], id);
        } else {
            self.hashed.insert(corner, id);
        }
        self.keys.push(Key { corner, next });
        id
    }

    /// Gives the face being read its group.
    fn group_face(&mut self) {
        let id = match self.state_id {
            Some(id) => id,
            None if self.state == Group::default() => NONE,
            None => match self.group_ids.get(&self.state) {
                Some(&id) => id,
                None => {
                    let id = self.groups.len() as u32;
                    self.groups.push(self.state.clone());
                    self.group_ids.insert(self.state.clone(), id);
                    id
                }
            },
        };
        self.state_id = Some(id);
        if id != NONE || !self.face_group.is_empty() {
            self.face_group.resize(self.faces, NONE);
            self.face_group.push(id);
        }
    }

    /// `material` is 0 for none, else one more than the index of its name.
    fn use_material(&mut self, name: String) {
        if name.is_empty() {
            self.material = 0;
            return;
        }
        let next = self.material_names.len() as u32 + 1;
        self.material = *self.material_ids.entry(name.clone()).or_insert(next);
        if self.material == next {
            self.material_names.push(name);
        }
    }

    fn polyline(&mut self, cursor: &mut Cursor<'_>) -> Result<(), DecodeError> {
        let line = cursor.line();
        self.elements(cursor)?;
        if self.polygon.len() < 2 {
            self.notes.at(line, "a line of fewer than two vertices is left out");
        }
        if self.polygon.iter().any(|c| c[1] != NONE) {
            self.notes.at(line, "texture coordinates of lines are left out");
        }
        self.wires.extend(self.polygon.windows(2).map(|w| [w[0][0], w[1][0]]));
        Ok(())
    }

    fn finish(mut self) -> Result<Decoded, DecodeError> {
        let counts = [self.points.len(), self.texture.len(), self.normals.len()];
        for (list, count) in [List::Vertex, List::Texture, List::Normal].into_iter().zip(counts) {
            // The first that reaches beyond all that came before is the first that is out of range.
            if let Some(&(index, line)) = self.forward[list as usize].iter().find(|f| f.0 as usize > count) {
                let what = format!("{} index {index}; {} in the file: {count}", list.name(), list.plural());
                return Err(line_error(line, what));
            }
        }
        let wedges = self.wedges()?;
        if !self.face_material.is_empty() {
            let map = self.materials();
            for m in &mut self.face_material {
                *m = map.get(*m as usize).copied().unwrap_or(NONE);
            }
        }
        let mut warnings = self.notes.into_warnings();
        warnings.append(&mut self.library.warnings);
        let geometry = MeshInput {
            positions: self.points.finish(),
            face_sizes: (!self.sizes.is_empty()).then_some(self.sizes),
            corners: self.corners,
            wires: self.wires,
            wedges,
            face_material: self.face_material,
            face_group: self.face_group,
            ..Default::default()
        };
        let object = self.groups.first().and_then(|g| g.object.clone());
        let name = object.filter(|o| self.groups.iter().all(|g| g.object.as_deref() == Some(o)));
        let mut scene =
            Scene::from_mesh(SceneMesh { name, geometry, groups: self.groups, ..Default::default() });
        scene.materials = self.library.materials;
        scene.images = self.library.images;
        Ok(Decoded { scene, warnings })
    }

    /// Index of every used name in the library, which gets a plain material for each it does not know.
    fn materials(&mut self) -> Vec<u32> {
        let library = &mut self.library;
        let known: FxHashMap<String, u32> =
            library.materials.iter().enumerate().map(|(i, m)| (m.name.clone(), i as u32)).collect();
        let mut missing: Vec<&str> = Vec::new();
        let mut map = Vec::with_capacity(self.material_names.len());
        for name in &self.material_names {
            map.push(known.get(name).copied().unwrap_or(library.materials.len() as u32));
            if !known.contains_key(name) {
                library.materials.push(Material { name: name.clone(), ..Default::default() });
                missing.push(name);
            }
        }
        if !missing.is_empty() {
            let more = if missing.len() > 8 { ", ..." } else { "" };
            let list = missing[..missing.len().min(8)].join(", ");
            library
                .warnings
                .push(format!("{} materials are in no MTL file and stay plain: {list}{more}", missing.len()));
        }
        map
    }

    /// Makes the wedges: a row for every key, and one for every coloured vertex of a corner without a key.
    fn wedges(&mut self) -> Result<Option<Wedges>, DecodeError> {
        let has_texture = self.keys.iter().any(|k| k.corner[1] != NONE);
        let has_normal = self.keys.iter().any(|k| k.corner[2] != NONE);
        let has_color = !self.colors.is_empty();
        for (unused, what) in [
            (!has_texture && !self.texture.is_empty(), "texture coordinates"),
            (!has_normal && !self.normals.is_empty(), "normals"),
        ] {
            if unused {
                self.library.warnings.push(format!("no face uses the {what}; they are left out"));
            }
        }
        self.colors.resize(if has_color { self.points.len() } else { 0 }, None);
        if has_color {
            let mut used = Bits::new(self.points.len());
            self.corners.iter().for_each(|&v| used.set(v as usize));
            let lost = (0..self.colors.len()).filter(|&v| self.colors[v].is_some() && !used.get(v)).count();
            if lost > 0 {
                self.library
                    .warnings
                    .push(format!("the colours of {lost} vertices without a face are left out"));
            }
        }
        let mut channels = Vec::new();
        if has_normal {
            channels.push(Channel::new(Semantic::Normal, 3));
        }
        if has_texture {
            channels.push(Channel::new(Semantic::TexCoord(0), 2));
        }
        if has_color {
            channels.push(Channel::new(Semantic::Color(0), 3));
        }
        if channels.is_empty() || self.corners.is_empty() {
            return Ok(None);
        }
        let mut wedges = Wedges::new(channels)
            .map_err(|e| DecodeError::Element { element: "vertices".into(), what: e.to_string() })?;
        let mut row = Vec::with_capacity(wedges.stride());
        let mut lost = 0usize;
        let (texture, normals, colors) = (&self.texture, &self.normals, &self.colors);
        let mut push = |wedges: &mut Wedges, corner: Corner| -> u32 {
            row.clear();
            let (mut present, mut bit) = (0u64, 1u64);
            let mut put = |value: Option<&[f32]>, width: usize| {
                match value {
                    Some(v) if v.iter().all(|x| x.is_finite()) => {
                        row.extend_from_slice(v);
                        present |= bit;
                    }
                    other => {
                        lost += other.is_some() as usize;
                        row.extend(std::iter::repeat_n(0.0, width));
                    }
                }
                bit <<= 1;
            };
            if has_normal {
                put(normals.get(corner[2] as usize).map(|n| &n[..]), 3);
            }
            if has_texture {
                put(texture.get(corner[1] as usize).map(|t| &t[..]), 2);
            }
            if has_color {
                put(colors.get(corner[0] as usize).and_then(|c| c.as_ref()).map(|c| &c[..]), 3);
            }
            if present == 0 { NONE } else { wedges.push(&row, present) }
        };
        let ids: Vec<u32> = self.keys.iter().map(|k| push(&mut wedges, k.corner)).collect();
        let mut of_vertex = if has_color { vec![NONE; self.points.len()] } else { Vec::new() };
        let mut corner = Vec::with_capacity(self.corners.len());
        for (c, &v) in self.corners.iter().enumerate() {
            let id = match self.corner_key.get(c).and_then(|&k| ids.get(k as usize)) {
                Some(&id) => id,
                None if has_color && colors[v as usize].is_some() => {
                    let id = &mut of_vertex[v as usize];
                    if *id == NONE {
                        *id = push(&mut wedges, [v, NONE, NONE]);
                    }
                    *id
                }
                None => NONE,
            };
            corner.push(id);
        }
        wedges.corner = corner;
        if lost > 0 {
            self.library.warnings.push(format!("{LOST_ATTRIBUTES} ({lost} wedges)"));
        }
        Ok(Some(wedges))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::NoSide;

    fn read(text: &str) -> Decoded {
        decode(text.as_bytes(), &NoSide).unwrap()
    }

    fn fails(text: &str) -> String {
        decode(text.as_bytes(), &NoSide).unwrap_err().to_string()
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn polygons_stay_polygons_and_triangles_need_no_sizes() {
        let m = &read(&format!("{SQUARE}f 1 2 3 4\nf 1 2 3\n")).scene.meshes[0].geometry;
        assert_eq!((m.face_sizes.clone(), &m.corners[..]), (Some(vec![4, 3]), &[0, 1, 2, 3, 0, 1, 2][..]));
        let m = &read(&format!("{SQUARE}f 1 2 3\nf 1 3 4\n")).scene.meshes[0].geometry;
        assert_eq!((m.face_sizes.clone(), m.wedges.is_none(), m.positions.is_f64()), (None, true, false));
        let m = &read(&format!("{SQUARE}f 1 2 3\nf 1 2 3 4\n")).scene.meshes[0].geometry;
        assert_eq!(m.face_sizes, Some(vec![3, 4]));
    }

    #[test]
    fn negative_and_forward_indices_name_the_same_vertices() {
        let d = read("f 3 2 1\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf -1 -2 -3\n");
        assert_eq!(d.scene.meshes[0].geometry.corners, [2, 1, 0, 2, 1, 0]);
    }

    #[test]
    fn seams_make_wedges_and_presence_is_per_corner() {
        let d = read(&format!(
            "{SQUARE}vt 0 0\nvt .5 1\nvn 0 0 1\nf 1/1/1 2/1 3//1\nf 1/1/1 3 4/-1/-1\nf 1/2/1 2/1 3//1\n"
        ));
        let w = d.scene.meshes[0].geometry.wedges.as_ref().unwrap();
        assert_eq!(w.corner, [0, 1, 2, 0, NONE, 3, 4, 1, 2]);
        let present: Vec<u64> = (0..w.len() as u32).map(|i| w.present(i)).collect();
        assert_eq!(present, [3, 2, 1, 3, 3]);
        assert_eq!((w.get(4, 1), w.get(0, 0)), (Some(&[0.5, 1.0][..]), Some(&[0.0, 0.0, 1.0][..])));
    }

    #[test]
    fn groups_of_one_file_share_vertices_and_keep_their_names() {
        let text = format!(
            "{SQUARE}o a\ng x y\ns 1\nusemtl m\nf 1 2 3\ng\ns off\nf 1 3 4\no b\ng x y\nusemtl\nf 1 2 4\n"
        );
        let d = read(&text);
        let m = &d.scene.meshes[0];
        assert_eq!(m.geometry.face_group, [0, 1, 2]);
        assert_eq!(m.groups[0].names, ["x", "y"]);
        assert_eq!((m.groups[1].names.len(), m.groups[1].smoothing.as_deref()), (0, Some("off")));
        assert_eq!(m.groups[2].object.as_deref(), Some("b"));
        assert_eq!(m.geometry.face_material, [0, 0, NONE]);
        assert_eq!(d.scene.materials[0].name, "m");
        assert!(d.warnings[0].contains("in no MTL file"), "{:?}", d.warnings);
    }

    #[test]
    fn colours_weights_lines_and_points() {
        let d = read("v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 2\nv 5 5 5 1 1 1\nf 1 2 3\nl 1 2 3\np 4\n");
        let g = &d.scene.meshes[0].geometry;
        let w = g.wedges.as_ref().unwrap();
        assert_eq!((w.get(w.corner[1], 0), w.corner[2]), (Some(&[0.0, 1.0, 0.0][..]), NONE));
        assert_eq!((g.wires.clone(), g.positions.len()), (vec![[0, 1], [1, 2]], 4));
        assert_eq!(d.warnings.len(), 3, "{:?}", d.warnings);
    }

    #[test]
    fn continued_lines_cr_lf_comments_and_odd_statements() {
        let d = read("# c \\\nv 0 0 \\\n 0\r\nv 1 0 0\rv 0 1 0\nf 1 \\\r\n2 3 # end\ncurv 1 2\n\tcurv 3\n");
        let g = &d.scene.meshes[0].geometry;
        assert_eq!((g.positions.len(), g.corners.len()), (3, 3));
        assert_eq!(d.warnings, ["line 8 and 1 more: the statement curv is not read"]);
    }

    #[test]
    fn errors_name_the_line() {
        for (text, want) in [
            ("v 0 0\n", "line 1: v needs three numbers, x y z"),
            ("v 0 0 nan\n", "line 1: z is NaN; coordinates must be finite"),
            ("v 0 -inf 0\n", "line 1: y is -inf; coordinates must be finite"),
            ("v 0 zero 0\n", "line 1: v: \"zero\" is no number"),
            ("v 0 0 0\n\nf 1 0 1\n", "line 3: vertex index 0; indices count from 1, or back from -1"),
            ("v 0 0 0\nf 1 1 -2\n", "line 2: vertex index -2; vertices so far: 1"),
            (
                "f 1 1 2\nf 1 9 2\nf 10 1 1\nv 0 0 0\nv 0 0 0\n",
                "line 2: vertex index 9; vertices in the file: 2",
            ),
            (
                "v 0 0 0\nf 1/1 1/1 1/1\n",
                "line 2: texture coordinate index 1; texture coordinates in the file: 0",
            ),
            ("v 0 0 0\nf 1//3 1 1\nvn 0 0 1\n", "line 2: normal index 3; normals in the file: 1"),
            ("v 0 0 0\nf 1 x 1\n", "line 2: \"x\" is no corner; it must look like 1, 1/2, 1//3 or 1/2/3"),
            ("v 0 0 0\nvt 0\nvn 0 0 1\nf 1 1/1/1/1 1\n", "line 4: \"1/1/1/1\" is no corner"),
            ("vn 0 0\n", "line 1: vn needs three numbers, x y z"),
            ("vt\n", "line 1: vt needs at least one number"),
            ("v 0 0 0\nf 1 1 99999999999\n", "line 2: vertex index 99999999999 is beyond"),
            ("v 0 0 0\n\u{1}\u{2}\n", "line 2: \"\u{1}\u{2}\" is no OBJ statement"),
        ] {
            let got = fails(text);
            assert!(got.starts_with(want), "{text:?}: {got}");
        }
    }

    #[test]
    fn short_faces_are_left_out_with_a_warning() {
        let d = read(&format!("{SQUARE}f 1 2\nf 1\nf\nf 1 2 3\nl 1\n"));
        assert_eq!(d.scene.meshes[0].geometry.corners.len(), 3);
        assert_eq!(d.warnings[0], "line 5 and 2 more: a face of fewer than three corners is left out");
    }

    #[test]
    fn one_long_number_makes_the_file_double() {
        let d = read("v 0.1 0 0\nv 0.0815609999 0 0\n");
        assert_eq!(d.scene.meshes[0].geometry.positions.get(1).x, 0.0815609999);
        let d = read("v 0.1 0 0\nv 0.081561 0 0\n");
        assert!(!d.scene.meshes[0].geometry.positions.is_f64());
    }

    #[test]
    fn a_vertex_of_many_wedges_takes_no_quadratic_time() {
        let n = 60_000;
        let mut text = String::from(SQUARE);
        for i in 0..n {
            text.push_str(&format!("vt {i} 0\nf 1/-1 2/-1 3/-1\n"));
        }
        let d = read(&text);
        assert_eq!(d.scene.meshes[0].geometry.wedges.as_ref().unwrap().len(), 3 * n);
    }

    #[test]
    fn normals_that_are_not_finite_are_absent() {
        let d = read(&format!("{SQUARE}vn nan 0 0\nvn 0 0 1\nf 1//1 2//2 3//2\n"));
        let w = d.scene.meshes[0].geometry.wedges.clone().unwrap();
        assert_eq!(w.corner[0], NONE);
        assert!(d.warnings[0].contains("not finite"));
    }

    #[test]
    fn a_huge_forward_index_allocates_nothing() {
        assert!(
            fails("vt 0 0\nf 4000000000/1 4000000001/1 4000000002/1\n").contains("vertices in the file: 0")
        );
    }
}
