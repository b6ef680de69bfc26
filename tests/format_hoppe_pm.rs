//! Hoppe's progressive meshes: at every split count what a plain interpreter of the records makes of them.

use progmesh::io::pm::{decode_progressive, hoppe};
use progmesh::io::{Format, decode};
use proptest::prelude::*;

/// Position and attributes of a corner, as bits.
type Corner = ([u32; 3], Vec<u32>);
/// A face as it is shown, with its material.
type Face = ([Corner; 3], u32);

/// Random numbers, the same everywhere.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize) % n
    }

    fn chance(&mut self, percent: usize) -> bool {
        self.below(100) < percent
    }

    fn float(&mut self) -> f32 {
        self.below(2001) as f32 / 1000.0 - 1.0
    }
}

/// A mesh as the format describes it. Neighbours are found by looking at all faces.
#[derive(Clone)]
struct Plain {
    positions: Vec<[f32; 3]>,
    wedges: Vec<(usize, Vec<f32>)>,
    faces: Vec<([usize; 3], u16)>,
}

impl Plain {
    fn vertex(&self, f: usize, k: usize) -> usize {
        self.wedges[self.faces[f].0[k % 3]].0
    }

    /// The face that runs along the edge from `b` to `a`, and its corner at `at`.
    fn along(&self, b: usize, a: usize, at: usize) -> Option<(usize, usize)> {
        let runs = |f: usize, k: usize| self.vertex(f, k) == b && self.vertex(f, k + 1) == a;
        let f = (0..self.faces.len()).find(|&f| (0..3).any(|k| runs(f, k)))?;
        Some((f, (0..3).find(|&k| self.vertex(f, k) == at)?))
    }

    /// Clockwise of the face about its corner: across the edge from the corner to the next.
    fn clockwise(&self, (f, k): (usize, usize)) -> Option<(usize, usize)> {
        let (v, next) = (self.vertex(f, k), self.vertex(f, k + 1));
        self.along(next, v, v)
    }

    fn counter_clockwise(&self, (f, k): (usize, usize)) -> Option<(usize, usize)> {
        let (v, last) = (self.vertex(f, k), self.vertex(f, k + 2));
        self.along(v, last, v)
    }

    fn wedge(&self, at: Option<(usize, usize)>, further: usize) -> Option<usize> {
        at.map(|(f, k)| self.faces[f].0[(k + further) % 3])
    }

    fn add(&mut self, v: usize, values: Vec<f32>) -> usize {
        self.wedges.push((v, values));
        self.wedges.len() - 1
    }

    /// What the faces show.
    fn shown(&self) -> Vec<Face> {
        let corner = |w: usize| {
            let (v, row) = &self.wedges[w];
            (self.positions[*v].map(f32::to_bits), row.iter().map(|x| x.to_bits()).collect())
        };
        self.faces.iter().map(|f| (f.0.map(corner), f.1 as u32)).collect()
    }
}

/// A file in the making, with the states on the way.
struct File {
    random: Random,
    mesh: Plain,
    stride: usize,
    materials: usize,
    records: Vec<u8>,
    states: Vec<Plain>,
    residuals: bool,
}

const S: [u16; 3] = [1 << 4, 1 << 5, 1 << 6];
const T: [u16; 3] = [1 << 7, 1 << 8, 1 << 9];

impl File {
    fn new(seed: u64, rgb: bool, uv: bool, residuals: bool) -> File {
        let mut random = Random(seed);
        // A tetrahedron; what is not among its vertices stays as it is.
        let positions: Vec<[f32; 3]> =
            (0..9).map(|_| [random.float(), random.float(), random.float()]).collect();
        let stride = 3 + 3 * rgb as usize + 2 * uv as usize;
        let mut wedges: Vec<(usize, Vec<f32>)> =
            (0..9).map(|v| (v, (0..stride).map(|_| random.float()).collect())).collect();
        wedges.push((0, (0..stride).map(|_| random.float()).collect()));
        let mut faces = vec![([5, 7, 6], 2), ([5, 6, 8], 2), ([6, 7, 8], 0), ([7, 5, 8], 1)];
        // Of every third file the base is open.
        faces.truncate(if seed % 3 == 2 { 3 } else { 4 });
        let mesh = Plain { positions, wedges, faces };
        let states = vec![mesh.clone()];
        File { random, mesh, stride, materials: 3, records: vec![], states, residuals }
    }

    fn row(&mut self) -> Vec<f32> {
        let row: Vec<f32> = (0..self.stride).map(|_| self.random.float()).collect();
        row.iter().for_each(|x| self.records.extend(x.to_be_bytes()));
        row
    }

    fn point(&mut self, scale: f32) -> [f32; 3] {
        let p = [0; 3].map(|_| self.random.float() * scale);
        p.iter().for_each(|x| self.records.extend(x.to_be_bytes()));
        p
    }

    /// Chooses a split, writes it, and does it.
    fn split(&mut self) {
        let r = &mut self.random;
        let face = r.below(self.mesh.faces.len());
        let k = r.below(3);
        let named = (face, k);
        let vs = self.mesh.vertex(face, k);
        // No left cut's inner face: only where the edge to the next corner is a border.
        let outside = self.mesh.clockwise(named).is_none() && r.chance(50);
        let l_clw = (!outside).then_some(named);
        let l_ccw = if outside { Some(named) } else { self.mesh.counter_clockwise(named) };
        let mut inner: Vec<(usize, usize)> = Vec::new();
        let mut closed = false;
        if let Some(first) = l_clw {
            inner.push(first);
            while let Some(next) = self.mesh.clockwise(*inner.last().unwrap()) {
                if Some(next) == l_ccw || next.0 == first.0 {
                    closed = true;
                    break;
                }
                inner.push(next);
                if inner.len() > self.mesh.faces.len() {
                    // A fan that comes back elsewhere: none to split.
                    return;
                }
            }
        }
        // Closed: two cuts. Open: to the border, or to a cut before it.
        let two = !outside && (closed || r.chance(60));
        if two {
            let n = 1 + r.below(inner.len());
            inner.truncate(n);
        }
        let r_ccw = two.then(|| *inner.last().unwrap());
        let r_clw = r_ccw.and_then(|at| self.mesh.clockwise(at));
        // A wedge has its corners in one run; if it is one across a cut, beside that cut.
        let at = |at: (usize, usize)| self.mesh.wedge(Some(at), 0).unwrap();
        let run: Vec<usize> = inner.iter().map(|&i| at(i)).collect();
        for (k, &w) in run.iter().enumerate() {
            let parted = run[k..].iter().skip_while(|&&x| x == w).any(|&x| x == w);
            let left = l_ccw.map(at) == Some(w) && run[..k].iter().any(|&x| x != w);
            let right = r_clw.map(at) == Some(w) && run[k..].iter().any(|&x| x != w);
            let across = (k == 0 || run[..k].iter().all(|&x| x == w)) && l_ccw.map(at) == Some(w)
                || run[k..].iter().all(|&x| x == w) && r_clw.map(at) == Some(w);
            let others = |f: usize| !inner.iter().any(|i| i.0 == f) && self.mesh.faces[f].0.contains(&w);
            let elsewhere = !across && (0..self.mesh.faces.len()).any(others);
            if parted || left || right || elsewhere {
                return;
            }
        }
        let between = if outside {
            0
        } else if two {
            inner.len() as u16 + 1
        } else {
            1
        };
        let ii = [0u16, 1, 2][r.below(3)];
        let old = self.mesh.clone();
        let m = &mut self.mesh;
        let vt = m.positions.len();
        let (outer_l, outer_r) = (old.wedge(l_ccw, 0), old.wedge(r_clw, 0));
        let mut code = k as u16 | ii << 2;

        // A wedge on both sides of a cut is parted: the run of inner faces beside the cut gets a copy.
        let parted_l = l_clw.is_some() && old.wedge(l_clw, 0) == outer_l;
        let mut copy_l = None;
        if parted_l {
            let x = outer_l.unwrap();
            let copy = m.add(vt, old.wedges[x].1.clone());
            copy_l = Some(copy);
            for &(f, c) in inner.iter().take_while(|&&at| old.wedge(Some(at), 0) == Some(x)) {
                m.faces[f].0[c] = copy;
            }
        }
        // What the first copy took is no longer the wedge of the right.
        let parted_r = two && m.wedge(r_ccw, 0) == outer_r;
        if parted_r {
            let x = outer_r.unwrap();
            let copy = match copy_l.filter(|_| outer_l == outer_r) {
                Some(c) => c,
                None => m.add(vt, old.wedges[x].1.clone()),
            };
            for &(f, c) in inner.iter().rev().take_while(|&&(f, c)| old.faces[f].0[c] == x) {
                if m.faces[f].0[c] == x {
                    m.faces[f].0[c] = copy;
                }
            }
        }
        let crosses_r = two && old.wedge(r_ccw, 0) == outer_r;
        let (in_l, in_r) = (m.wedge(l_clw, 0), m.wedge(r_ccw, 0));

        // Which wedges the new faces share with those beside, at the new vertex and the old.
        let mut pick = |m: &mut Plain,
                        r: &mut Random,
                        bits: [u16; 3],
                        l: Option<usize>,
                        rr: Option<usize>,
                        v: usize,
                        must: [bool; 2],
                        may_not: [bool; 2]| {
            let share =
                |r: &mut Random, k: usize, there: bool| must[k] || (there && !may_not[k] && r.chance(50));
            let on_l = share(r, 0, l.is_some());
            let on_r = if two { share(r, 1, rr.is_some()) } else { true };
            let mut same = two && r.chance(50);
            if two && on_l && on_r {
                same = l == rr;
            }
            for (bit, on) in bits.iter().zip([on_l, on_r, same]) {
                code |= if on { *bit } else { 0 };
            }
            let blank = || vec![0.0; old.wedges[0].1.len()];
            if !two {
                return (if on_l { l.unwrap() } else { m.add(v, blank()) }, None);
            }
            let a = match (on_l, on_r) {
                (true, _) => l.unwrap(),
                (false, true) if same => rr.unwrap(),
                _ => m.add(v, blank()),
            };
            let b = match (on_l, on_r) {
                (_, true) => rr.unwrap(),
                _ if same => a,
                _ => m.add(v, blank()),
            };
            (a, Some(b))
        };
        let crossing = [parted_l, crosses_r];
        let (t_l, t_r) = pick(m, r, T, in_l, in_r, vt, crossing, [false; 2]);
        // A seam at the cut: not both ends may go through.
        let t_shares = [code_has(&t_l, in_l), t_r.is_some() && t_r == in_r];
        let may_not = [t_shares[0] && !parted_l, t_shares[1] && !crosses_r];
        let (s_l, s_r) = pick(m, r, S, outer_l, outer_r, vs, crossing, may_not);
        let mut tip =
            |m: &mut Plain, r: &mut Random, shift: u16, above: Option<usize>, below: Option<usize>| {
                let there = above.or(below).unwrap();
                match r.below(4) {
                    0 if below.is_some() => {
                        code |= 1 << shift;
                        (below.unwrap(), false)
                    }
                    1 => {
                        code |= 2 << shift;
                        (m.add(old.wedges[there].0, old.wedges[there].1.clone()), true)
                    }
                    _ if above.is_some() => (above.unwrap(), false),
                    _ => {
                        code |= 1 << shift;
                        (below.unwrap(), false)
                    }
                }
            };
        let (tip_l, new_l) = tip(m, r, 10, old.wedge(l_clw, 2), old.wedge(l_ccw, 1));
        let right = two.then(|| tip(m, r, 12, old.wedge(r_ccw, 1), old.wedge(r_clw, 2)));
        // Materials.
        let predicted = |one: Option<(usize, usize)>, other: Option<(usize, usize)>| {
            let at = if ii == 0 { other.or(one) } else { one.or(other) };
            old.faces[at.unwrap().0].1
        };
        let own = [r.chance(20), two && r.chance(20)];
        let given = [r.below(self.materials) as u16, r.below(self.materials) as u16];
        code |= (own[0] as u16) << 14 | (own[1] as u16) << 15;
        let material_l = if own[0] { given[0] } else { predicted(l_clw, l_ccw) };
        let material_r = match two {
            true if own[1] => given[1],
            true => predicted(r_ccw, r_clw),
            false => 0,
        };
        for &(f, c) in &inner {
            let w = m.faces[f].0[c];
            m.wedges[w].0 = vt;
        }
        m.faces.push(([s_l, t_l, tip_l], material_l));
        if let (Some(s), Some(t), Some((tip, _))) = (s_r, t_r, right) {
            m.faces.push(([s, tip, t], material_r));
        }

        self.records.extend((face as u32).to_be_bytes());
        self.records.extend(between.to_be_bytes());
        self.records.extend(code.to_be_bytes());
        if own[0] || own[1] {
            given.iter().for_each(|g| self.records.extend(g.to_be_bytes()));
        }
        let still = self.random.chance(50);
        let large = self.point(0.2);
        let small = self.point(if still { 0.0 } else { 0.1 });
        let at = old.positions[vs];
        let plus = |a: [f32; 3], b: [f32; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        let (to_s, to_t) = match ii {
            2 => (plus(at, small), plus(at, large)),
            0 => (plus(at, large), plus(at, small)),
            _ => {
                let middle = plus(at, small);
                ([0, 1, 2].map(|k| middle[k] - large[k]), plus(middle, large))
            }
        };
        self.mesh.positions[vs] = to_s;
        self.mesh.positions.push(to_t);
        // Attributes, as the records' order has it.
        let before = [t_l, s_l].map(|w| self.mesh.wedges[w].1.clone());
        let before_r = t_r.zip(s_r).map(|(t, s)| [t, s].map(|w| self.mesh.wedges[w].1.clone()));
        let on = |bit: u16| code & bit != 0;
        let forward = |a: &[f32], d: &[f32]| -> Vec<f32> { a.iter().zip(d).map(|(a, d)| a + d).collect() };
        let mirrored = |a: &[f32], d: &[f32]| -> Vec<f32> {
            let dot = d[0] * a[0] + d[1] * a[1] + d[2] * a[2];
            let normal = (0..3).map(|k| -d[k] + (2.0 * dot + 1.0) * a[k]);
            normal.chain((3..a.len()).map(|k| a[k] - d[k])).collect()
        };
        let [t0, s0] = before;
        if !on(T[0]) && !on(S[0]) {
            self.mesh.wedges[t_l].1 = self.row();
            self.mesh.wedges[s_l].1 = self.row();
        } else {
            let d = self.row();
            // The end that was there already is what the delta is from.
            let base = match ii {
                0 if on(T[0]) => &t0,
                0 => &s0,
                _ if on(S[0]) => &s0,
                _ => &t0,
            };
            match ii {
                2 => {
                    self.mesh.wedges[t_l].1 = forward(base, &d);
                    if !on(S[0]) {
                        self.mesh.wedges[s_l].1 = t0.clone();
                    }
                }
                0 => {
                    self.mesh.wedges[s_l].1 = forward(base, &d);
                    if !on(T[0]) {
                        self.mesh.wedges[t_l].1 = s0.clone();
                    }
                }
                _ => {
                    self.mesh.wedges[t_l].1 = forward(base, &d);
                    self.mesh.wedges[s_l].1 = mirrored(base, &d);
                }
            }
        }
        if let (Some([t0, s0]), Some(t), Some(s)) = (before_r, t_r, s_r) {
            let (apart_t, apart_s) = (!on(T[2]), !on(S[2]));
            if !on(T[1]) && !on(S[1]) {
                if apart_t {
                    self.mesh.wedges[t].1 = self.row();
                }
                if apart_s {
                    self.mesh.wedges[s].1 = self.row();
                }
            } else {
                let needs = match ii {
                    2 => apart_t,
                    0 => apart_s,
                    _ => apart_t || apart_s,
                };
                let d = if needs { self.row() } else { vec![0.0; self.stride] };
                let base = match ii {
                    0 if on(T[1]) => &t0,
                    0 => &s0,
                    _ if on(S[1]) => &s0,
                    _ => &t0,
                };
                if ii == 2 && apart_s && !on(S[1]) {
                    self.mesh.wedges[s].1 = t0.clone();
                }
                if ii == 0 && apart_t && !on(T[1]) {
                    self.mesh.wedges[t].1 = s0.clone();
                }
                if apart_t && ii != 0 {
                    self.mesh.wedges[t].1 = forward(base, &d);
                }
                if apart_s && ii != 2 {
                    self.mesh.wedges[s].1 = if ii == 0 { forward(base, &d) } else { mirrored(base, &d) };
                }
            }
        }
        if new_l {
            self.mesh.wedges[tip_l].1 = self.row();
        }
        if let Some((w, true)) = right {
            self.mesh.wedges[w].1 = self.row();
        }
        if self.residuals {
            self.records.extend(0.5f32.to_be_bytes());
            self.records.extend(0.25f32.to_be_bytes());
        }
        self.states.push(self.mesh.clone());
    }

    fn bytes(&self, rgb: bool, uv: bool) -> Vec<u8> {
        let counts = |p: &Plain| {
            format!("nvertices={} nwedges={} nfaces={}", p.positions.len(), p.wedges.len(), p.faces.len())
        };
        let base = &self.states[0];
        let mut out = format!(
            "# a comment\nPM\nversion=2\nnvsplits={} {}\nbbox -1 -1 -1  1 1 1\nhas_rgb={}\nhas_uv={}\nhas_resid={}\nPM base \
             mesh:\nnmaterials=3\nmat=\"red one\" rgb=(1 0 0) matid=0\nmatid=1\nmatid=2\n{}\n",
            self.states.len() - 1,
            counts(&self.mesh),
            rgb as u8,
            uv as u8,
            self.residuals as u8,
            counts(base)
        )
        .into_bytes();
        base.positions.iter().flatten().for_each(|x| out.extend(x.to_be_bytes()));
        for (v, row) in &base.wedges {
            out.extend((*v as u32).to_be_bytes());
            row.iter().for_each(|x| out.extend(x.to_be_bytes()));
        }
        for (f, m) in &base.faces {
            f.iter().for_each(|&w| out.extend((w as u32).to_be_bytes()));
            out.extend(m.to_be_bytes());
        }
        out.extend(&self.records);
        out.extend(b"\xffEnd of PM\n");
        out
    }
}

fn code_has(picked: &usize, beside: Option<usize>) -> bool {
    Some(*picked) == beside
}

fn file(seed: u64, splits: usize, rgb: bool, uv: bool, residuals: bool) -> (Vec<u8>, Vec<Plain>) {
    let mut f = File::new(seed, rgb, uv, residuals);
    (0..splits).for_each(|_| f.split());
    (f.bytes(rgb, uv), f.states)
}

/// What a progressive mesh shows.
fn show(
    cursor: &progmesh::refine::Cursor<&progmesh::refine::ProgressiveMesh>,
    materials: &[u32],
) -> Vec<Face> {
    let corner = |w: u32| {
        let p = cursor.positions().get(cursor.wedge_vertex(w) as usize);
        (p.to_array().map(|x| (x as f32).to_bits()), cursor.row(w).iter().map(|x| x.to_bits()).collect())
    };
    cursor.indices().iter().zip(materials).map(|(f, &m)| (f.map(corner), m)).collect()
}

fn check(seed: u64, splits: usize, rgb: bool, uv: bool, residuals: bool) {
    let (bytes, states) = file(seed, splits, rgb, uv, residuals);
    let read = decode_progressive(&bytes).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
    assert!(read.warnings.is_empty() && read.report.is_none());
    let mesh = &read.scene.meshes[0];
    let mut cursor = mesh.cursor().unwrap();
    // Up and down again, wedge numbers and all.
    let order: Vec<usize> = (0..states.len()).chain((0..states.len()).rev()).collect();
    for at in order {
        cursor.seek(at).unwrap();
        let want = &states[at];
        assert_eq!(cursor.vertex_count(), want.positions.len(), "seed {seed} at {at}");
        assert_eq!(cursor.wedge_count(), want.wedges.len(), "seed {seed} at {at}");
        let numbers: Vec<[usize; 3]> = cursor.indices().iter().map(|f| f.map(|w| w as usize)).collect();
        assert_eq!(numbers, want.faces.iter().map(|f| f.0).collect::<Vec<_>>(), "seed {seed} at {at}");
        assert!(show(&cursor, &mesh.face_material) == want.shown(), "seed {seed} at {at}");
    }
}

#[test]
fn every_state_is_what_the_records_say() {
    for seed in 0..40 {
        check(seed, 60, seed % 2 == 0, seed % 3 == 0, seed % 5 == 0);
    }
}

#[test]
fn splits_at_a_border_lengthen_it_by_one_edge() {
    let mut at_border = 0;
    for seed in 0..12 {
        let (bytes, _) = file(seed, 60, false, false, false);
        let read = decode_progressive(&bytes).unwrap();
        let mesh = &read.scene.meshes[0];
        let mut cursor = mesh.cursor().unwrap();
        let border = |cursor: &progmesh::refine::Cursor<&progmesh::refine::ProgressiveMesh>| {
            let mut faces_of = std::collections::HashMap::new();
            for f in cursor.indices() {
                let v = f.map(|w| cursor.wedge_vertex(w));
                for k in 0..3 {
                    let (a, b) = (v[k], v[(k + 1) % 3]);
                    *faces_of.entry((a.min(b), a.max(b))).or_insert(0) += 1;
                }
            }
            faces_of.values().filter(|&&n| n == 1).count()
        };
        for code in &mesh.splits.code {
            let before = border(&cursor);
            cursor.refine().unwrap();
            assert_eq!(border(&cursor), before + usize::from(!code.two_faces()), "seed {seed}");
            at_border += usize::from(!code.two_faces());
        }
    }
    assert!(at_border > 20, "{at_border}");
}

#[test]
fn materials_and_the_mesh_come_as_a_scene() {
    let (bytes, states) = file(7, 30, true, true, true);
    let scene = decode(Format::Pm, &bytes, &progmesh::io::NoSide).unwrap().scene;
    assert_eq!(Format::from_bytes(&bytes), Some(Format::Pm));
    assert_eq!(scene.materials.len(), 3);
    assert_eq!(
        (scene.materials[0].name.as_str(), scene.materials[0].base_color),
        ("red one", [1.0, 0.0, 0.0, 1.0])
    );
    let g = &scene.meshes[0].geometry;
    assert_eq!(
        (g.positions.len(), g.face_count()),
        (states[states.len() - 1].positions.len(), states[states.len() - 1].faces.len())
    );
    assert_eq!(g.wedges.as_ref().unwrap().channels().len(), 3);
}

#[test]
fn damage_is_an_error_and_never_a_panic() {
    let (bytes, _) = file(11, 40, true, false, true);
    for cut in (0..bytes.len() - 11).step_by(7) {
        assert!(hoppe::decode(&bytes[..cut]).is_err(), "cut at {cut}");
    }
    let mut random = Random(5);
    for _ in 0..3000 {
        let mut damaged = bytes.clone();
        for _ in 0..1 + random.below(4) {
            let at = random.below(damaged.len());
            damaged[at] = random.below(256) as u8;
        }
        if let Ok(read) = hoppe::decode(&damaged) {
            let _ = read.scene.at(&[usize::MAX]);
        }
    }
    let text = String::from_utf8_lossy(&bytes[..60]).replace("nvsplits=", "nvsplits=40000000");
    let mut lying = text.into_bytes();
    lying.extend(&bytes[60..]);
    assert!(hoppe::decode(&lying).is_err());
}

/// A small file for the tests that need one on the disk, with splits that make wedges at their tips.
#[test]
#[ignore = "writes tests/corpus/hoppe_pm anew"]
fn the_corpus_is_written_anew() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus/hoppe_pm");
    std::fs::create_dir_all(&folder).unwrap();
    let (bytes, _) = file(1, 24, true, true, true);
    assert!(!decode_progressive(&bytes).unwrap().scene.meshes[0].is_reorderable());
    std::fs::write(folder.join("small.pm"), bytes).unwrap();
}

#[test]
fn files_that_were_read_wrongly_once() {
    check(8174623075895850993, 15, true, true, false);
    check(3894009739266338985, 17, true, false, false);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_file(seed: u64, splits in 0usize..50, rgb: bool, uv: bool, residuals: bool) {
        check(seed, splits, rgb, uv, residuals);
    }
}
