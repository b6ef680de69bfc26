//! The chunk that begins a mesh: what is true of all of it, and the mesh before the first split.

use super::codec::Start;
use super::coder::{Coder, Decoder, Encoder, Number, put_varint, take_varint};
use super::places::{self, Lattice, MAX_LATTICES, Places};
use super::rows::Rows;
use crate::aif::{Channel, Encoding, NONE, Semantic};
use crate::progressive::{ProgressiveMesh, WedgeStreams};
use std::ops::Range;

/// What is true of a whole mesh; needed to read any chunk of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshHead {
    /// Splits at full detail.
    pub splits: u32,
    /// Vertices of the base.
    pub base_vertices: u32,
    /// Faces of the base.
    pub base_faces: u32,
    /// Wedges of the base; as many as vertices without attributes.
    pub base_wedges: u32,
    /// Edges without a face.
    pub wires: u32,
    /// Positions are f64.
    pub double: bool,
    /// Attributes.
    pub channels: Option<Vec<Channel>>,
    /// Faces have materials.
    pub materials: bool,
    /// Faces have groups.
    pub groups: bool,
    /// Lattices that positions may lie on, at most two.
    pub lattices: Vec<Lattice>,
    /// Split counts at which levels stand.
    pub levels: Vec<u32>,
    /// The splits that make one face, as at a border; all others make two. With this list every face tells the split that made it.
    pub single: Vec<u32>,
    /// What quantising moved a vertex by at most, model units; 0 without.
    pub quantisation_error: f64,
    /// Faces at full detail of which quantising put two corners at one place.
    pub flat_faces: u32,
    /// The base, for those who read chunks alone.
    pub(crate) start: Start,
}

const DOUBLE: u8 = 1;
const ATTRIBUTES: u8 = 2;
const MATERIALS: u8 = 4;
const GROUPS: u8 = 8;

/// Tells which splits make one face only, asked in ascending order.
pub(super) struct Singles<'a> {
    of: &'a [u32],
    so_far: usize,
}

impl<'a> Singles<'a> {
    pub(super) fn new(head: &'a MeshHead) -> Self {
        Singles { of: &head.single, so_far: 0 }
    }

    /// Split `i` does.
    #[inline]
    pub(super) fn is(&mut self, i: u32) -> bool {
        let rest = &self.of[self.so_far..];
        if rest.first().is_some_and(|&s| s < i) {
            self.so_far += rest.partition_point(|&s| s < i);
        }
        let is = self.of.get(self.so_far) == Some(&i);
        self.so_far += is as usize;
        is
    }

    /// How many do up to the last that was asked for.
    #[inline]
    pub(super) fn so_far(&self) -> u32 {
        self.so_far as u32
    }
}

/// Faces between two splits that make one only, and how many such splits are before: those asked for last.
#[derive(Debug)]
pub(crate) struct Gaps([(Range<u32>, u32); 2]);

impl Default for Gaps {
    fn default() -> Self {
        Gaps([(0..0, 0), (0..0, 0)])
    }
}

impl MeshHead {
    /// The first face that split `i` makes. O(log n).
    pub fn first_face(&self, i: u32) -> u32 {
        let single = self.single.partition_point(|&s| s < i) as u32;
        self.base_faces + 2 * i - single
    }

    /// Split `i` makes one face only. O(log n).
    pub fn is_single(&self, i: u32) -> bool {
        self.single.binary_search(&i).is_ok()
    }

    /// The split that makes face `f`, and whether `f` is its second; `None` for a face of the base. O(log n).
    pub fn maker(&self, f: u32) -> Option<(u32, bool)> {
        let k = f.checked_sub(self.base_faces)?;
        // Singles whose face comes before.
        let (mut low, mut high) = (0, self.single.len());
        while low < high {
            let mid = (low + high) / 2;
            if 2 * self.single[mid] - (mid as u32) < k { low = mid + 1 } else { high = mid }
        }
        let k = k + low as u32;
        Some((k / 2, k % 2 == 1))
    }

    /// As [`MeshHead::maker`], without searching where the last faces that were asked for were near: `gaps` remembers them.
    pub(crate) fn maker_near(&self, f: u32, gaps: &mut Gaps) -> Option<(u32, bool)> {
        let k = f.checked_sub(self.base_faces)?;
        let (faces, singles) = match gaps.0.iter().find(|g| g.0.contains(&k)) {
            Some(gap) => gap,
            None => {
                let end = |n: usize| self.single.get(n).map(|&i| 2 * i - n as u32);
                let n = self.maker(f).map_or(0, |(i, second)| 2 * i + u32::from(second) - k);
                let before = (n as usize).checked_sub(1).and_then(end);
                let from = before.map_or(0, |e| e + 1);
                let to = end(n as usize).map_or(u32::MAX, |e| e + 1);
                gaps.0.swap(0, 1);
                gaps.0[0] = (from..to, n);
                &gaps.0[0]
            }
        };
        debug_assert!(faces.contains(&k));
        let k = k + singles;
        Some((k / 2, k % 2 == 1))
    }

    /// Numbers in a row of attributes.
    pub(super) fn stride(&self) -> usize {
        self.channels.iter().flatten().map(|c| c.width).sum()
    }

    fn write(&self, out: &mut Vec<u8>) {
        let flag = |on: bool, bit: u8| if on { bit } else { 0 };
        out.push(
            flag(self.double, DOUBLE)
                | flag(self.channels.is_some(), ATTRIBUTES)
                | flag(self.materials, MATERIALS)
                | flag(self.groups, GROUPS),
        );
        for n in [self.splits, self.base_vertices, self.base_faces, self.base_wedges, self.wires] {
            put_varint(out, n as u64);
        }
        out.extend_from_slice(&self.quantisation_error.to_le_bytes());
        put_varint(out, self.flat_faces as u64);
        out.push(self.lattices.len() as u8);
        for l in &self.lattices {
            for x in l.origin.iter().chain([&l.step, &l.parts]) {
                out.extend_from_slice(&x.to_le_bytes());
            }
        }
        put_varint(out, self.levels.len() as u64);
        self.levels.iter().for_each(|&l| put_varint(out, l as u64));
        put_varint(out, self.single.len() as u64);
        let mut next = 0;
        for &i in &self.single {
            put_varint(out, (i - next) as u64);
            next = i + 1;
        }
        if let Some(channels) = &self.channels {
            out.push(channels.len() as u8);
            for c in channels {
                write_channel(c, out);
            }
        }
    }

    fn read(from: &mut &[u8]) -> Option<MeshHead> {
        let flags = take_byte(from)?;
        let mut h = MeshHead {
            double: flags & DOUBLE != 0,
            materials: flags & MATERIALS != 0,
            groups: flags & GROUPS != 0,
            ..Default::default()
        };
        for n in [&mut h.splits, &mut h.base_vertices, &mut h.base_faces, &mut h.base_wedges, &mut h.wires] {
            *n = u32::try_from(take_varint(from)?).ok()?;
        }
        h.quantisation_error = take_f64(from)?;
        h.flat_faces = u32::try_from(take_varint(from)?).ok()?;
        let lattices = take_byte(from)? as usize;
        if lattices > MAX_LATTICES {
            return None;
        }
        for _ in 0..lattices {
            let mut x = [0.0; 5];
            for x in &mut x {
                *x = take_f64(from)?;
            }
            let l = Lattice { origin: [x[0], x[1], x[2]], step: x[3], parts: x[4] };
            h.lattices.push(Some(l).filter(Lattice::is_sound)?);
        }
        let levels = take_varint(from)?;
        if levels > from.len() as u64 {
            return None;
        }
        for _ in 0..levels {
            let level = u32::try_from(take_varint(from)?).ok()?;
            if level > h.splits || h.levels.last().is_some_and(|&l| l >= level) {
                return None;
            }
            h.levels.push(level);
        }
        let single = take_varint(from)?;
        if single > from.len() as u64 {
            return None;
        }
        let mut next = 0u64;
        for _ in 0..single {
            let i = next.checked_add(take_varint(from)?).filter(|&i| i < h.splits as u64)?;
            h.single.push(i as u32);
            next = i + 1;
        }
        // Faces must fit their fields.
        let faces = h.base_faces as u64 + 2 * h.splits as u64 - single;
        if faces >= 1 << 29 || h.base_vertices as u64 + h.splits as u64 >= NONE as u64 {
            return None;
        }
        if flags & ATTRIBUTES != 0 {
            let count = take_byte(from)? as usize;
            if count > 64 {
                return None;
            }
            let channels: Option<Vec<_>> = (0..count).map(|_| read_channel(from)).collect();
            h.channels = Some(channels?);
        }
        Some(h)
    }
}

fn take_byte(from: &mut &[u8]) -> Option<u8> {
    let (&byte, rest) = from.split_first()?;
    *from = rest;
    Some(byte)
}

fn take_f64(from: &mut &[u8]) -> Option<f64> {
    let (bytes, rest) = from.split_first_chunk()?;
    *from = rest;
    Some(f64::from_le_bytes(*bytes))
}

/// Meanings by number; the number of the set or target follows, or the name.
fn write_channel(c: &Channel, out: &mut Vec<u8>) {
    let (kind, k) = match &c.semantic {
        Semantic::Normal => (0, 0),
        Semantic::Tangent => (1, 0),
        Semantic::TexCoord(k) => (2, *k as u64),
        Semantic::Color(k) => (3, *k as u64),
        Semantic::Joints(k) => (4, *k as u64),
        Semantic::Weights(k) => (5, *k as u64),
        Semantic::MorphPosition(k) => (6, *k as u64),
        Semantic::MorphNormal(k) => (7, *k as u64),
        Semantic::MorphTangent(k) => (8, *k as u64),
        Semantic::Custom(name) => (9, name.len() as u64),
    };
    out.push(kind);
    put_varint(out, k);
    if let Semantic::Custom(name) = &c.semantic {
        out.extend_from_slice(name.as_bytes());
    }
    put_varint(out, c.width as u64);
    let encoding = Encoding::ALL.iter().position(|&e| e == c.encoding).unwrap_or(0);
    out.push(encoding as u8);
}

/// The widest channel taken: a row of 64 of them still is small.
const WIDEST: u64 = 1 << 12;

fn read_channel(from: &mut &[u8]) -> Option<Channel> {
    let kind = take_byte(from)?;
    let k = take_varint(from)?;
    let (byte, short) = (u8::try_from(k).ok(), u16::try_from(k).ok());
    let semantic = match kind {
        0 => Semantic::Normal,
        1 => Semantic::Tangent,
        2 => Semantic::TexCoord(byte?),
        3 => Semantic::Color(byte?),
        4 => Semantic::Joints(byte?),
        5 => Semantic::Weights(byte?),
        6 => Semantic::MorphPosition(short?),
        7 => Semantic::MorphNormal(short?),
        8 => Semantic::MorphTangent(short?),
        9 => {
            let (name, rest) = from.split_at_checked(usize::try_from(k).ok()?)?;
            *from = rest;
            Semantic::Custom(std::str::from_utf8(name).ok()?.to_string())
        }
        _ => return None,
    };
    let width = take_varint(from)?;
    let &encoding = Encoding::ALL.get(take_byte(from)? as usize)?;
    Some(Channel { semantic, width: usize::try_from(width).ok().filter(|_| width <= WIDEST)?, encoding })
}

/// Codes faces, wires, positions, attributes and materials of the base.
struct BaseModels {
    corner: [Number; 3],
    wire: [Number; 2],
    wedge: Number,
    face: [Number; 2],
}

fn code_base<C: Coder>(c: &mut C, head: &MeshHead, pm: &mut ProgressiveMesh) -> Option<()> {
    let mut m = BaseModels {
        corner: Default::default(),
        wire: Default::default(),
        wedge: Default::default(),
        face: Default::default(),
    };
    let fits = |x: i64, below: u32| u32::try_from(x).ok().filter(|&x| x < below);
    // Places, each expected where the one before is.
    let mut coder = Places::new(head.double, &head.lattices);
    let mut last = [0.0; 3];
    for i in 0..head.base_vertices as usize {
        let x = if C::READS { last } else { places::point(&pm.base_positions, i) };
        last = coder.code(c, 0, last, x);
        if C::READS {
            places::push(&mut pm.base_positions, last);
            if c.spent() {
                return None;
            }
        }
    }
    // A corner by its difference from that of the face before.
    let mut before = [0u32; 3];
    for i in 0..head.base_faces as usize {
        let face = if C::READS { before } else { pm.base_faces[i] };
        let mut new = [0; 3];
        for k in 0..3 {
            let guess = i64::from(if k == 0 { before[0] } else { new[k - 1] });
            let x = guess.wrapping_add(c.signed(&mut m.corner[k], face[k] as i64 - guess));
            new[k] = fits(x, head.base_wedges)?;
        }
        before = new;
        if C::READS {
            pm.base_faces.push(new);
            if c.spent() {
                return None;
            }
        }
    }
    for i in 0..head.wires as usize {
        let wire = if C::READS { [0; 2] } else { pm.wires[i] };
        let mut new = [0; 2];
        for k in 0..2 {
            new[k] = fits(c.signed(&mut m.wire[k], wire[k] as i64), head.base_vertices)?;
        }
        if C::READS {
            pm.wires.push(new);
            if c.spent() {
                return None;
            }
        }
    }
    for (k, (on, values)) in
        [(head.materials, &mut pm.face_material), (head.groups, &mut pm.face_group)].into_iter().enumerate()
    {
        let mut last = 0;
        for i in 0..if on { head.base_faces as usize } else { 0 } {
            let value = if C::READS { last } else { values[i] };
            // NONE is 0.
            let x = c
                .signed(&mut m.face[k], value.wrapping_add(1) as i64 - last as i64)
                .wrapping_add(last as i64);
            last = u32::try_from(x).ok()?;
            if C::READS {
                values.push(last.wrapping_sub(1));
                if c.spent() {
                    return None;
                }
            }
        }
    }
    if let (Some(channels), Some(w)) = (&head.channels, &mut pm.wedges) {
        let mut rows = Rows::new(channels);
        let mut last = 0;
        for i in 0..head.base_wedges as usize {
            let v = if C::READS { 0 } else { w.base_vertex[i] };
            last = fits(
                c.signed(&mut m.wedge, v as i64 - last as i64).wrapping_add(last as i64),
                head.base_vertices,
            )?;
            let row = if C::READS { Default::default() } else { w.rows.row(i, w.stride) };
            let source = (!C::READS).then(|| (w.present[i], &*row));
            let present = rows.code(c, NONE, source);
            if C::READS {
                w.base_vertex.push(last);
                w.rows.plain().extend_from_slice(rows.row());
                w.present.push(present);
                if c.spent() {
                    return None;
                }
            }
        }
    }
    Some(())
}

/// The chunk's bytes.
pub(super) fn write(head: &MeshHead, pm: &mut ProgressiveMesh) -> Option<Vec<u8>> {
    let mut out = Vec::new();
    head.write(&mut out);
    let mut e = Encoder::default();
    code_base(&mut e, head, pm)?;
    e.finish(&mut out);
    Some(out)
}

/// Bytes that the arrays of the base take in memory.
pub(super) fn raw_bytes(h: &MeshHead) -> u64 {
    let wedge = if h.channels.is_some() { 12 + 4 * h.stride() as u64 } else { 0 };
    let face = 12 + 4 * (h.materials as u64 + h.groups as u64);
    h.base_vertices as u64 * if h.double { 24 } else { 12 }
        + h.base_faces as u64 * face
        + h.base_wedges as u64 * wedge
        + h.wires as u64 * 8
}

/// The mesh's head, and the mesh without splits.
///
/// `None`: damage, or arrays that take other than `raw` bytes.
pub(super) fn read(bytes: &[u8], raw: u64) -> Option<(MeshHead, ProgressiveMesh)> {
    let mut rest = bytes;
    let mut head = MeshHead::read(&mut rest).filter(|h| raw_bytes(h) == raw)?;
    let mut pm = ProgressiveMesh {
        base_positions: places::empty(head.double),
        new_positions: places::empty(head.double).into(),
        moved_positions: places::empty(head.double).into(),
        wedges: head.channels.as_ref().map(|channels| WedgeStreams {
            channels: channels.clone(),
            stride: head.stride(),
            ..Default::default()
        }),
        ..Default::default()
    };
    let mut d = Decoder::new(rest)?;
    code_base(&mut d, &head, &mut pm)?;
    head.start = Start::new(&pm)?;
    Some((head, pm)).filter(|_| !d.spent())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn makers_are_the_same_without_searching(
            (splits, base_faces) in (1u32..400, 0u32..20),
            single in prop::collection::vec(any::<prop::sample::Index>(), 0..60),
            faces in prop::collection::vec((any::<prop::sample::Index>(), 0u32..6), 1..80),
        ) {
            let mut single: Vec<u32> = single.iter().map(|i| i.index(splits as usize) as u32).collect();
            single.sort_unstable();
            single.dedup();
            let head = MeshHead { splits, base_faces, single, ..MeshHead::default() };
            // Who makes each face, one split after the other.
            let makers: Vec<(u32, bool)> = (0..splits)
                .flat_map(|i| [(i, false), (i, true)].into_iter().take(2 - usize::from(head.is_single(i))))
                .collect();
            let all = base_faces + makers.len() as u32;
            let mut gaps = Gaps::default();
            for (at, run) in faces {
                for f in (at.index(all as usize) as u32..all).take(run as usize + 1) {
                    let want = f.checked_sub(base_faces).map(|k| makers[k as usize]);
                    prop_assert_eq!(head.maker_near(f, &mut gaps), want);
                    prop_assert_eq!(head.maker(f), want);
                }
            }
        }
    }
}
