//! Hoppe's splits carried out, and written down as ours.

use super::read::{Head, Reader, Record, wrong};
use crate::aif::{Channel, NONE};
use crate::io::DecodeError;
use crate::refine::ProgressiveMesh;
use crate::refine::progressive::{Presence, SplitCode, SplitKind, SplitParts, WedgeStreams};
use std::collections::HashMap;

type Broken = &'static str;

/// The mesh as it is after the splits so far, and these as ours.
pub(super) struct Builder {
    materials: usize,
    stride: usize,
    has_residuals: bool,
    positions: Vec<[f32; 3]>,
    wedge_vertex: Vec<u32>,
    rows: Vec<f32>,
    faces: Vec<[u32; 3]>,
    /// The face across from every corner.
    across: Vec<[u32; 3]>,
    face_material: Vec<u32>,
    out: ProgressiveMesh,
    streams: WedgeStreams,
}

/// A face and its corner at the vertex that is split.
type At = Option<(u32, usize)>;

/// The faces and wedges around a split, named as in Hoppe's figure: left and right cut, each with the face counter-clockwise of it and that
/// clockwise of it.
struct Ring {
    vs: u32,
    l_ccw: At,
    l_clw: At,
    r_ccw: At,
    r_clw: At,
    /// The faces that go to the new vertex, clockwise.
    inner: Vec<(u32, usize)>,
}

impl Builder {
    /// Reads the base.
    pub(super) fn base(from: &mut Reader<'_>, head: &Head) -> Result<Self, DecodeError> {
        let [vertices, wedges, faces] = head.base;
        let stride = head.stride();
        let mut b = Builder {
            materials: head.materials.len(),
            stride,
            has_residuals: head.has_residuals,
            positions: Vec::with_capacity(vertices),
            wedge_vertex: Vec::with_capacity(wedges),
            rows: Vec::with_capacity(wedges * stride),
            faces: Vec::with_capacity(faces),
            across: Vec::new(),
            face_material: Vec::with_capacity(faces),
            out: ProgressiveMesh::default(),
            streams: WedgeStreams::default(),
        };
        for i in 0..vertices {
            let p = from.point()?;
            if !p.iter().all(|x| x.is_finite()) {
                return Err(wrong(format!("vertex {i}"), "is not finite"));
            }
            b.positions.push(p);
        }
        for i in 0..wedges {
            let v = from.word()?;
            if v as usize >= vertices {
                return Err(wrong(format!("wedge {i}"), format!("vertex {v} of {vertices}")));
            }
            b.wedge_vertex.push(v);
            for _ in 0..stride {
                b.rows.push(from.float()?);
            }
        }
        let mut edges: HashMap<(u32, u32), (u32, usize)> = HashMap::new();
        for i in 0..faces {
            let f = [from.word()?, from.word()?, from.word()?];
            let m = from.short()? as u32;
            if f.iter().any(|&w| w as usize >= wedges) || m as usize >= b.materials {
                return Err(wrong(format!("face {i}"), "has a wedge or a material that is not there"));
            }
            let v = f.map(|w| b.wedge_vertex[w as usize]);
            b.across.push([NONE; 3]);
            for k in 0..3 {
                let (from, to) = (v[k], v[(k + 1) % 3]);
                if from == to || edges.insert((from, to), (i as u32, k)).is_some() {
                    return Err(wrong(format!("face {i}"), "has an edge that another has, or of no length"));
                }
                if let Some(&(g, j)) = edges.get(&(to, from)) {
                    // Edge k is across from corner k + 2.
                    b.across[i][(k + 2) % 3] = g;
                    b.across[g as usize][(j + 2) % 3] = i as u32;
                }
            }
            b.faces.push(f);
            b.face_material.push(m);
        }
        b.out.base_faces = b.faces.clone();
        b.out.base_positions = b.positions.clone().into();
        b.streams = WedgeStreams {
            stride,
            base_vertex: b.wedge_vertex.clone(),
            rows: b.rows.clone().into(),
            present: Presence::all(b.all(), wedges),
            ..Default::default()
        };
        Ok(b)
    }

    /// Vertices, wedges, faces now.
    pub(super) fn counts(&self) -> [usize; 3] {
        [self.positions.len(), self.wedge_vertex.len(), self.faces.len()]
    }

    pub(super) fn finish(mut self, channels: Vec<Channel>) -> ProgressiveMesh {
        let all = (1u64 << channels.len()) - 1;
        self.streams.present = Presence::all(all, self.streams.present.len());
        self.streams.channels = channels;
        self.out.wedges = Some(self.streams);
        self.out.face_material = self.face_material;
        let n = self.out.splits.len() as u32;
        self.out.levels = if n > 0 { vec![0, n] } else { vec![0] };
        self.out
    }

    /// Channels that every wedge has; their number is set in [`Builder::finish`].
    fn all(&self) -> u64 {
        1
    }

    fn vertex(&self, w: u32) -> u32 {
        self.wedge_vertex[w as usize]
    }

    fn row(&self, w: u32) -> &[f32] {
        &self.rows[w as usize * self.stride..(w as usize + 1) * self.stride]
    }

    fn set_row(&mut self, w: u32, row: &[f32]) {
        let at = w as usize * self.stride;
        self.rows[at..at + self.stride].copy_from_slice(row);
    }

    fn corner_of(&self, face: u32, vertex: u32) -> Option<usize> {
        self.faces[face as usize].iter().position(|&w| self.vertex(w) == vertex)
    }

    fn wedge(&self, at: At) -> u32 {
        at.map_or(NONE, |(f, c)| self.faces[f as usize][c])
    }

    /// The wedge of the face so many corners further round than the split vertex.
    fn wedge_from(&self, at: At, further: usize) -> u32 {
        at.map_or(NONE, |(f, c)| self.faces[f as usize][(c + further) % 3])
    }

    /// A wedge with the values of another.
    fn add_wedge(&mut self, vertex: u32, like: u32) -> u32 {
        let row = match like {
            NONE => vec![0.0; self.stride],
            w => self.row(w).to_vec(),
        };
        self.wedge_vertex.push(vertex);
        self.rows.extend(row);
        self.wedge_vertex.len() as u32 - 1
    }

    /// The face across the edge that is clockwise of the vertex at a corner (`further` 2) or counter-clockwise (1).
    fn turn(&self, (face, corner): (u32, usize), further: usize, vs: u32) -> Result<At, Broken> {
        let next = self.across[face as usize][(corner + further) % 3];
        if next == NONE {
            return Ok(None);
        }
        let corner = self.corner_of(next, vs).ok_or("the faces around its vertex do not hang together")?;
        Ok(Some((next, corner)))
    }

    fn ring(&self, r: &Record) -> Result<Ring, Broken> {
        let corners = self.faces.get(r.face as usize).ok_or("names a face that is not there")?;
        let named = (r.face, r.corner());
        let vs = self.vertex(*corners.get(r.corner()).ok_or("names corner 3 of a triangle")?);
        let none = Ring { vs, l_ccw: None, l_clw: None, r_ccw: None, r_clw: None, inner: vec![] };
        if r.between == 0 {
            return Ok(Ring { l_ccw: Some(named), ..none });
        }
        let l_ccw = self.turn(named, 1, vs)?;
        let mut inner = vec![named];
        let mut last = named;
        while !r.two_faces() || inner.len() + 1 < r.between as usize {
            match self.turn(last, 2, vs)? {
                // More than all faces: a fan that runs in a circle beside its vertex.
                Some(next) if next.0 == r.face || Some(next) == l_ccw || inner.len() >= self.faces.len() => {
                    return Err("its cuts are not as far apart as it says");
                }
                Some(next) => {
                    inner.push(next);
                    last = next;
                }
                None if r.two_faces() => return Err("its cuts are not as far apart as it says"),
                None => break,
            }
        }
        if !r.two_faces() {
            return Ok(Ring { l_ccw, l_clw: Some(named), inner, ..none });
        }
        let r_clw = self.turn(last, 2, vs)?;
        Ok(Ring { l_ccw, l_clw: Some(named), r_ccw: Some(last), r_clw, inner, ..none })
    }

    /// Carries a split out and writes it down.
    pub(super) fn split(&mut self, r: &Record) -> Result<(), Broken> {
        let ring = self.ring(r)?;
        if r.ii() > 2 {
            return Err("has its vertex at no end and not in the middle");
        }
        let (vs, vt, two) = (ring.vs, self.positions.len() as u32, r.two_faces());
        let first_new = self.wedge_vertex.len() as u32;
        let inner_before: Vec<u32> = ring.inner.iter().map(|&at| self.wedge(Some(at))).collect();
        let [outer_l, outer_r] = [ring.l_ccw, ring.r_clw].map(|at| self.wedge(at));
        let some_wedge = inner_before.first().copied().unwrap_or(outer_l);

        // Wedges that reach across a cut are parted, from the left clockwise and from the right counter-clockwise.
        let (mut in_l, mut in_r) = (self.wedge(ring.l_clw), self.wedge(ring.r_ccw));
        let (mut low, mut high) = (0, inner_before.len());
        let mut part_l = NONE;
        if in_l != NONE && in_l == outer_l {
            part_l = self.add_wedge(vt, outer_l);
            while low < high && inner_before[low] == outer_l {
                low += 1;
            }
            if low == high {
                in_r = part_l;
            }
            in_l = part_l;
        }
        let mut part_r = NONE;
        if two && in_r != NONE && in_r == outer_r {
            let whole = outer_r == outer_l && part_l != NONE;
            part_r = if whole { part_l } else { self.add_wedge(vt, outer_r) };
            while high > low && inner_before[high - 1] == outer_r {
                high -= 1;
            }
            if high == 0 {
                in_l = part_r;
            }
            in_r = part_r;
        }
        let inner_after: Vec<u32> = (0..inner_before.len())
            .map(|k| match k {
                k if k < low => part_l,
                k if k >= high => part_r,
                k => inner_before[k],
            })
            .collect();

        // Wedges of the new faces at the new vertex, then at the old.
        let (t_l, t_r) = self.pick(r.same(false), two, in_l, in_r, vt);
        let (s_l, s_r) = self.pick(r.same(true), two, outer_l, outer_r, vs);
        let tip = |b: &mut Builder, right: bool, above: u32, below: u32| {
            let there = if above != NONE { above } else { below };
            let w = match r.tip(right) {
                0 => above,
                1 => below,
                _ if there == NONE => NONE,
                _ => b.add_wedge(b.vertex(there), there),
            };
            (w, there)
        };
        let (above, below) = (self.wedge_from(ring.l_clw, 2), self.wedge_from(ring.l_ccw, 1));
        let (tip_l, like_l) = tip(self, false, above, below);
        let (tip_r, like_r) = match two {
            true => {
                let (above, below) = (self.wedge_from(ring.r_ccw, 1), self.wedge_from(ring.r_clw, 2));
                tip(self, true, above, below)
            }
            false => (NONE, NONE),
        };
        let all = [t_l, s_l, tip_l, t_r, s_r, tip_r];
        if all[..if two { 6 } else { 3 }].contains(&NONE) {
            return Err("takes a wedge from a face that is not there");
        }

        // Pairs of wedges before and after; then what else is new, like a wedge that was there.
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        for (&before, &after) in inner_before.iter().zip(&inner_after) {
            if !pairs.contains(&(before, after)) {
                pairs.push((before, after));
            }
        }
        let stays = |w: u32| w == outer_l || w == outer_r;
        let mixed = pairs
            .iter()
            .enumerate()
            .any(|(k, p)| (p.0 == p.1 && stays(p.0)) || pairs[..k].iter().any(|q| q.0 == p.0 || q.1 == p.1));
        if mixed {
            return Err("has a wedge in two places around its vertex");
        }
        for w in first_new..self.wedge_vertex.len() as u32 {
            if !pairs.iter().any(|p| p.1 == w) {
                let like = if w == tip_l {
                    like_l
                } else if w == tip_r {
                    like_r
                } else {
                    some_wedge
                };
                pairs.push((like, w));
            }
        }
        pairs.sort_unstable_by_key(|p| p.1);

        // Faces.
        let materials = [
            self.material(r, false, ring.l_clw, ring.l_ccw)?,
            match two {
                true => self.material(r, true, ring.r_ccw, ring.r_clw)?,
                false => 0,
            },
        ];
        for (&(f, c), &w) in ring.inner.iter().zip(&inner_after) {
            self.faces[f as usize][c] = w;
            self.wedge_vertex[w as usize] = vt;
        }
        let fl = self.faces.len() as u32;
        let fr = if two { fl + 1 } else { NONE };
        let face = |at: At| at.map_or(NONE, |a| a.0);
        self.faces.push([s_l, t_l, tip_l]);
        self.across.push([face(ring.l_clw), face(ring.l_ccw), fr]);
        self.face_material.push(materials[0]);
        self.join(ring.l_ccw, 2, fl);
        self.join(ring.l_clw, 1, fl);
        if two {
            self.faces.push([s_r, tip_r, t_r]);
            self.across.push([face(ring.r_ccw), fl, face(ring.r_clw)]);
            self.face_material.push(materials[1]);
            self.join(ring.r_ccw, 2, fr);
            self.join(ring.r_clw, 1, fr);
        }

        let moved = self.place(r, vs)?;
        let before: Vec<(u32, Vec<f32>)> = {
            let mut old: Vec<u32> = [t_l, s_l, t_r, s_r].into_iter().filter(|&w| w < first_new).collect();
            old.sort_unstable();
            old.dedup();
            old.into_iter().map(|w| (w, self.row(w).to_vec())).collect()
        };
        self.attributes(r, [t_l, s_l, tip_l, t_r, s_r, tip_r]);
        let bits = |row: &[f32]| row.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let changed: Vec<u32> =
            before.iter().filter(|(w, old)| bits(old) != bits(self.row(*w))).map(|b| b.0).collect();
        self.write(
            r,
            &ring,
            Written { first_new, pairs, changed, moved, corners: [[s_l, t_l, tip_l], [s_r, t_r, tip_r]] },
        );
        Ok(())
    }

    /// The wedges of both new faces at a vertex: those of the faces beside, or new ones.
    fn pick(&mut self, same: [bool; 3], two: bool, left: u32, right: u32, vertex: u32) -> (u32, u32) {
        let [l, r, c] = same;
        if !two {
            return (if l { left } else { self.add_wedge(vertex, NONE) }, NONE);
        }
        match (l, r, c) {
            (true, true, _) => (left, right),
            (true, false, true) => (left, left),
            (false, true, true) => (right, right),
            (true, false, false) => (left, self.add_wedge(vertex, NONE)),
            (false, true, false) => (self.add_wedge(vertex, NONE), right),
            (false, false, true) => {
                let w = self.add_wedge(vertex, NONE);
                (w, w)
            }
            (false, false, false) => {
                let w = self.add_wedge(vertex, NONE);
                (w, self.add_wedge(vertex, NONE))
            }
        }
    }

    fn join(&mut self, at: At, further: usize, to: u32) {
        if let Some((f, c)) = at {
            self.across[f as usize][(c + further) % 3] = to;
        }
    }

    /// A new face's material: its own, or that of a face beside it.
    fn material(&self, r: &Record, right: bool, one: At, other: At) -> Result<u32, Broken> {
        let m = if r.own_material(right) {
            r.materials[right as usize] as u32
        } else {
            let beside = if r.ii() == 0 { other.or(one) } else { one.or(other) };
            self.face_material[beside.ok_or("lies between no faces")?.0 as usize]
        };
        if (m as usize) < self.materials { Ok(m) } else { Err("has a material that is not there") }
    }

    /// Moves the old vertex and adds the new one; true if the old one moved.
    fn place(&mut self, r: &Record, vs: u32) -> Result<bool, Broken> {
        let at = self.positions[vs as usize];
        let add = |p: [f32; 3], d: [f32; 3]| std::array::from_fn(|k| p[k] + d[k]);
        let (old, new): ([f32; 3], [f32; 3]) = match r.ii() {
            2 => (add(at, r.small), add(at, r.large)),
            0 => (add(at, r.large), add(at, r.small)),
            _ => {
                let middle: [f32; 3] = add(at, r.small);
                (std::array::from_fn(|k| middle[k] - r.large[k]), add(middle, r.large))
            }
        };
        if !old.iter().chain(&new).all(|x| x.is_finite()) {
            return Err("moves a vertex to where is no number");
        }
        self.positions[vs as usize] = old;
        self.positions.push(new);
        Ok(old.map(f32::to_bits) != at.map(f32::to_bits))
    }

    /// Adds the wedge deltas, in the order of the file.
    fn attributes(&mut self, r: &Record, [t_l, s_l, tip_l, t_r, s_r, tip_r]: [u32; 6]) {
        let mut next = 0;
        let mut delta = || {
            next += self.stride;
            r.wedges.get(next - self.stride..next).map_or_else(|| vec![0.0; self.stride], <[f32]>::to_vec)
        };
        let plus = |a: &[f32], d: &[f32]| a.iter().zip(d).map(|(a, d)| a + d).collect::<Vec<f32>>();
        // The normal is mirrored at that of `a`, everything else goes as far the other way.
        let minus = |a: &[f32], d: &[f32]| {
            let dot = d[0] * a[0] + d[1] * a[1] + d[2] * a[2];
            let other = |k: usize| if k < 3 { -d[k] + (2.0 * dot + 1.0) * a[k] } else { a[k] - d[k] };
            (0..a.len()).map(other).collect::<Vec<f32>>()
        };
        let two = r.two_faces();
        // The right side begins from the values before the left one is done.
        let before_r = two.then(|| [self.row(t_r).to_vec(), self.row(s_r).to_vec()]);
        let mut to: Vec<(u32, Vec<f32>)> = Vec::new();
        {
            let [t_same, ..] = r.same(false);
            let [s_same, ..] = r.same(true);
            let (t, s) = (self.row(t_l).to_vec(), self.row(s_l).to_vec());
            match r.ii() {
                _ if !t_same && !s_same => {
                    to.push((t_l, delta()));
                    to.push((s_l, delta()));
                }
                2 => {
                    if !s_same {
                        to.push((s_l, t.clone()));
                    }
                    to.push((t_l, plus(if s_same { &s } else { &t }, &delta())));
                }
                0 => {
                    if !t_same {
                        to.push((t_l, s.clone()));
                    }
                    to.push((s_l, plus(if t_same { &t } else { &s }, &delta())));
                }
                _ => {
                    let (base, d) = (if s_same { &s } else { &t }, delta());
                    to.push((t_l, plus(base, &d)));
                    to.push((s_l, minus(base, &d)));
                }
            }
        }
        if let Some([t, s]) = before_r {
            let [_, t_same, t_common] = r.same(false);
            let [_, s_same, s_common] = r.same(true);
            match r.ii() {
                _ if !t_same && !s_same => {
                    if !t_common {
                        to.push((t_r, delta()));
                    }
                    if !s_common {
                        to.push((s_r, delta()));
                    }
                }
                2 => {
                    if !s_common && !s_same {
                        to.push((s_r, t.clone()));
                    }
                    if !t_common {
                        to.push((t_r, plus(if s_same { &s } else { &t }, &delta())));
                    }
                }
                0 => {
                    if !t_common && !t_same {
                        to.push((t_r, s.clone()));
                    }
                    if !s_common {
                        to.push((s_r, plus(if t_same { &t } else { &s }, &delta())));
                    }
                }
                _ if !t_common || !s_common => {
                    let (base, d) = (if s_same { &s } else { &t }, delta());
                    if !t_common {
                        to.push((t_r, plus(base, &d)));
                    }
                    if !s_common {
                        to.push((s_r, minus(base, &d)));
                    }
                }
                _ => {}
            }
        }
        if r.tip(false) == 2 {
            to.push((tip_l, delta()));
        }
        if two && r.tip(true) == 2 {
            to.push((tip_r, delta()));
        }
        to.iter().for_each(|(w, row)| self.set_row(*w, row));
    }

    /// Writes the split down, after it was carried out.
    fn write(&mut self, r: &Record, ring: &Ring, s: Written) {
        let two = r.two_faces();
        // The later of the two faces at a cut names it: edge k of a face runs from corner k on.
        let cut = |inner: At, outer: At, inner_edge: usize, outer_edge: usize| {
            let name = |at: At, further: usize| at.map(|(f, c)| (f, f << 2 | ((c + further) % 3) as u32));
            let (i, o) = (name(inner, inner_edge), name(outer, outer_edge));
            let by_inner = match (i, o) {
                (Some(i), Some(o)) => i.0 > o.0,
                (i, _) => i.is_some(),
            };
            (by_inner, if by_inner { i } else { o }.map_or(NONE, |x| x.1))
        };
        let (left_inner, left) = cut(ring.l_clw, ring.l_ccw, 2, 0);
        let (right_inner, right) = if two { cut(ring.r_ccw, ring.r_clw, 0, 2) } else { (false, NONE) };
        let new = self.wedge_vertex.len() as u32 - s.first_new;
        let fresh = s.first_new;
        let (x, tips_told) =
            (s.pairs.first().map_or(NONE, |p| p.0), r.tip(false) != 2 && !(two && r.tip(true) == 2));
        let like = |c: [u32; 3]| c[0] == x && c[1] == fresh;
        let plain = new == 1
            && s.pairs == [(x, fresh)]
            && like(s.corners[0])
            && (!two || like(s.corners[1]))
            && tips_told
            && s.changed.iter().all(|&w| w == x);
        let code = SplitParts {
            left: (2, false),
            right: two.then_some((1, true)),
            left_inner,
            left_starts: !left_inner,
            right_inner,
            left_tip_inner: r.tip(false) == 0,
            right_tip_inner: two && r.tip(true) == 0,
            kind: if plain { SplitKind::Plain } else { SplitKind::Explicit },
            moves: s.moved,
            changes_rows: !s.changed.is_empty(),
        };
        let vt = self.positions.len() - 1;
        let splits = &mut self.out.splits;
        splits.vertex.push(ring.vs);
        splits.left.push(left);
        splits.right.push(right);
        splits.code.push(SplitCode::from(code));
        let length = |d: [f32; 3]| d.iter().map(|x| x * x).sum::<f32>().sqrt();
        let error = match r.residual.filter(|_| self.has_residuals) {
            Some(e) => e.abs(),
            None => length(r.large).max(length(r.small)),
        };
        splits.error.push(if error.is_finite() { error } else { 0.0 });
        push(self.out.new_positions.plain(), self.positions[vt]);
        if s.moved {
            push(self.out.moved_positions.plain(), self.positions[ring.vs as usize]);
        }
        let listed: Vec<u32> = (fresh..fresh + new).chain(s.changed.iter().copied()).collect();
        for w in listed {
            let at = w as usize * self.stride;
            self.streams.rows.plain().extend_from_slice(&self.rows[at..at + self.stride]);
            self.streams.present.push(1);
        }
        if !plain {
            let out = &mut self.streams.explicit;
            out.extend([s.pairs.len() as u32, s.changed.len() as u32]);
            out.extend(s.pairs.iter().flat_map(|p| [p.0, p.1]));
            out.extend(&s.changed);
            for (c, right) in s.corners.iter().zip([false, true]).take(1 + two as usize) {
                out.extend([c[0], c[1], if r.tip(right) == 2 { c[2] } else { NONE }]);
            }
        }
    }
}

/// What became of the wedges and the vertex.
struct Written {
    first_new: u32,
    pairs: Vec<(u32, u32)>,
    changed: Vec<u32>,
    moved: bool,
    /// Of each new face: the wedges at the old vertex, the new one, the tip.
    corners: [[u32; 3]; 2],
}

fn push(to: &mut crate::aif::Positions, p: [f32; 3]) {
    if let crate::aif::Positions::F32(list) = to {
        list.push(p);
    }
}
