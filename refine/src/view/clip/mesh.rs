//! Clipping whole meshes.
//!
//! Plane by plane. Every vertex has one side, decided exactly, every edge one crossing, shared by its faces: what was connected stays so, and the cut
//! of a closed mesh is closed loops, whatever rounding does to places.

use super::cap::{self, Side};
use super::exact::{fraction, side};
use super::gather::{Gathered, cap_wedge, mix_wedges};
use super::join::{Chain, End, Node, Whole, chains, follow, next};
use crate::aif::{BuildError, MeshInput, NONE, TooManyChannels, Wedges, triangulate_polygon};
use glam::{DVec3, DVec4};
use rustc_hash::FxHashMap;

/// A mesh after [`clip_mesh`].
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct MeshClip {
    /// What is left. Vertices and wedges that nothing uses any more are gone, the others in their order.
    pub mesh: MeshInput,
    /// Faces that were cut, of the input and of caps.
    pub cut: usize,
    /// Faces of which nothing is left.
    pub dropped: usize,
    /// Triangles of caps.
    pub capped: usize,
    /// Loops of the cuts that caps close.
    pub loops: usize,
    /// Edges of the cuts that are on no loop, because the mesh is open there: no cap closes them.
    pub open_edges: usize,
}

/// Why a mesh could not be clipped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshClipError {
    /// A mesh that [`crate::aif::Mesh::build`] would refuse.
    #[error(transparent)]
    Mesh(#[from] BuildError),
    /// A plane with numbers that are not finite.
    #[error("plane {0} is not finite")]
    Plane(usize),
    /// More vertices or corners than ids.
    #[error("the clipped mesh has more than 2^32 - 2 vertices or corners")]
    TooLarge,
    /// More attributes than a wedge can have.
    #[error(transparent)]
    Attributes(#[from] TooManyChannels),
}

/// The part of a mesh where all planes `[a, b, c, d]` have ax + by + cz + d >= 0, in the mesh's coordinates.
///
/// Faces keep their order, orientation, material and group; of a mesh of triangles alone, what is left is triangles, of another, polygons, and a face
/// that is not convex may become several. New vertices lie on the cut edges
/// (once an edge, for all its faces) and are rounded to the mesh's precision, in which planes square to an axis are met exactly; a vertex that a cut
/// rounds to counts as on the plane. Attributes are interpolated,
/// normals and tangents of unit length; joint indices are taken from the end nearer by. Edges without a face are cut too; vertices of
/// nothing stay if they are inside.
///
/// Faces that lie in a plane stay. With `cap`, where the mesh is the surface of a solid, those stay only that turn their back to the plane, and the cut is closed
/// with triangles between its loops, holes left open: a closed mesh stays closed, every cut edge with two faces. Caps take material and group of
/// the faces along them, attributes of their corners, and the plane's normal. Where the mesh is open at the cut there is no loop to close
/// ([`MeshClip::open_edges`]); planes are then taken in the order that leaves the fewest such edges, first come first. If it intersects itself there, caps may overlap; they still close it.
///
/// Deterministic. O(planes * faces) and, for caps of n corners, O(n log n) to O(n^2).
pub fn clip_mesh(input: &MeshInput, planes: &[DVec4], cap: bool) -> Result<MeshClip, MeshClipError> {
    input.validate()?;
    if let Some(k) = planes.iter().position(|p| !p.is_finite()) {
        return Err(MeshClipError::Plane(k));
    }
    let mut work = Work::new(input);
    let mut left = planes.to_vec();
    while !left.is_empty() {
        if !cap || left.len() == 1 {
            work.cut_by(left.remove(0), cap)?;
            continue;
        }
        // Where the mesh has holes, one plane may cut them off before another runs into them.
        let mut best: Option<(usize, Work<'_>)> = None;
        for (k, &plane) in left.iter().enumerate() {
            let mut trial = work.clone();
            trial.cut_by(plane, true)?;
            let good = trial.done.open_edges == work.done.open_edges;
            if good || best.as_ref().is_none_or(|b| trial.done.open_edges < b.1.done.open_edges) {
                best = Some((k, trial));
            }
            if good {
                break;
            }
        }
        let Some((k, after)) = best else { break };
        work = after;
        left.remove(k);
    }
    work.finish(input)
}

/// Faces of a mesh on their way through the planes: flat, in order.
#[derive(Clone, Default)]
pub(super) struct Faces {
    pub(super) sizes: Vec<u32>,
    pub(super) corners: Vec<u32>,
    /// Wedges of the corners; empty without any.
    pub(super) wedges: Vec<u32>,
    /// The face of the input that each comes from, or takes material and group of.
    pub(super) origin: Vec<u32>,
    pub(super) is_cap: Vec<bool>,
}

impl Faces {
    fn clear(&mut self) {
        self.sizes.clear();
        self.corners.clear();
        self.wedges.clear();
        self.origin.clear();
        self.is_cap.clear();
    }

    fn put(
        &mut self,
        corners: impl Iterator<Item = (u32, u32)>,
        with_wedges: bool,
        origin: u32,
        is_cap: bool,
    ) {
        let before = self.corners.len();
        for (v, w) in corners {
            self.corners.push(v);
            if with_wedges {
                self.wedges.push(w);
            }
        }
        self.sizes.push((self.corners.len() - before) as u32);
        self.origin.push(origin);
        self.is_cap.push(is_cap);
    }
}

#[derive(Clone)]
struct Work<'a> {
    points: Vec<DVec3>,
    single: bool,
    wedges: Option<Wedges>,
    faces: Faces,
    next: Faces,
    wires: Vec<[u32; 2]>,
    /// Material and group of the input's faces.
    labels: [&'a [u32]; 2],
    /// Vertices that nothing uses in the input, while they are inside.
    lonely: Vec<u32>,
    sides: Vec<f64>,
    /// Edge -> vertex where the plane cuts it.
    crossings: FxHashMap<[u32; 2], u32>,
    /// (End of a cut edge, place of the cut) -> vertex there: cuts around a vertex that round to one place are one.
    near: FxHashMap<(u32, [u64; 3]), u32>,
    /// (Vertex there, wedges of the ends) -> wedge there.
    mixed: FxHashMap<[u32; 3], u32>,
    done: MeshClip,
}

impl<'a> Work<'a> {
    fn new(input: &'a MeshInput) -> Work<'a> {
        let n = input.positions.len();
        let mut used = vec![false; n];
        input.corners.iter().chain(input.wires.as_flattened()).for_each(|&v| used[v as usize] = true);
        let count = input.face_count();
        Work {
            points: input.positions.iter().collect(),
            single: !input.positions.is_f64(),
            wedges: input.wedges.clone(),
            faces: Faces {
                sizes: input.face_sizes.clone().unwrap_or_else(|| vec![3; count]),
                corners: input.corners.clone(),
                wedges: input.wedges.as_ref().map_or(vec![], |w| w.corner.clone()),
                origin: (0..count as u32).collect(),
                is_cap: vec![false; count],
            },
            next: Faces::default(),
            wires: input.wires.clone(),
            labels: [&input.face_material, &input.face_group],
            lonely: (0..n as u32).filter(|&v| !used[v as usize]).collect(),
            sides: vec![],
            crossings: FxHashMap::default(),
            near: FxHashMap::default(),
            mixed: FxHashMap::default(),
            done: MeshClip::default(),
        }
    }

    fn cut_by(&mut self, plane: DVec4, cap: bool) -> Result<(), MeshClipError> {
        self.sides.clear();
        self.sides.extend(self.points.iter().map(|p| side(plane, p.extend(1.0))));
        if self.sides.iter().all(|&s| s >= 0.0) {
            return Ok(());
        }
        self.crossings.clear();
        self.near.clear();
        self.mixed.clear();
        self.next.clear();
        let faces = std::mem::take(&mut self.faces);
        self.snap(&faces, plane);
        let (mut start, mut pieces) = (0, Pieces::default());
        for f in 0..faces.sizes.len() {
            let slots = start..start + faces.sizes[f] as usize;
            start = slots.end;
            let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
            for &v in &faces.corners[slots.clone()] {
                let s = self.sides[v as usize];
                (least, most) = (least.min(s), most.max(s));
            }
            let stays = match (least < 0.0, most > 0.0) {
                (false, true) => true,
                // In the plane. Of a solid, the side that is kept lies behind the face.
                (false, false) => {
                    !cap || self.normal(&faces.corners[slots.clone()]).dot(plane.truncate()) < 0.0
                }
                (true, false) => false,
                (true, true) => {
                    self.cut_face(&faces, f, slots, plane, &mut pieces)?;
                    self.done.cut += 1;
                    continue;
                }
            };
            if stays {
                let wedge = |c: usize| faces.wedges.get(c).copied().unwrap_or(NONE);
                let corners = slots.map(|c| (faces.corners[c], wedge(c)));
                self.next.put(corners, self.wedges.is_some(), faces.origin[f], faces.is_cap[f]);
            } else {
                self.done.dropped += 1;
            }
        }
        self.faces = std::mem::replace(&mut self.next, faces);
        self.cut_wires(plane)?;
        let sides = &self.sides;
        self.lonely.retain(|&v| sides[v as usize] >= 0.0);
        if cap { self.cap(plane) } else { Ok(()) }
    }

    /// Twice the area vector of a face.
    fn normal(&self, corners: &[u32]) -> DVec3 {
        let at = |i: usize| self.points[corners[i] as usize] - self.points[corners[0] as usize];
        (1..corners.len() - 1).map(|i| at(i).cross(at(i + 1))).sum()
    }

    /// Where the plane cuts an edge, in the mesh's precision.
    fn place(&self, a: u32, b: u32, plane: DVec4) -> DVec3 {
        let at = |v: u32| (self.points[v as usize], self.sides[v as usize]);
        let ((p, sp), (q, sq)) = (at(a), at(b));
        let (from, to, t) = fraction(p, sp, q, sq);
        let mut place = from + (to - from) * t;
        // Square to an axis: all of the cut has the same coordinate.
        for k in 0..3 {
            if plane.truncate().abs() == DVec3::AXES[k] * plane[k].abs() {
                place[k] = -plane.w / plane[k];
            }
        }
        if self.single { place.as_vec3().as_dvec3() } else { place }
    }

    /// Puts vertices on the plane that a cut beside them would round to.
    fn snap(&mut self, faces: &Faces, plane: DVec4) {
        let mut start = 0;
        for &n in &faces.sizes {
            let (from, to) = (start, start + n);
            start = to;
            for c in from..to {
                let (a, b) = (faces.corners[c as usize], faces.corners[next(c, from, to) as usize]);
                let (sa, sb) = (self.sides[a as usize], self.sides[b as usize]);
                if sa.min(sb) < 0.0 && sa.max(sb) > 0.0 {
                    let place = self.place(a, b, plane);
                    for v in [a, b] {
                        if self.points[v as usize] == place {
                            self.sides[v as usize] = 0.0;
                        }
                    }
                }
            }
        }
    }

    /// The vertex where the plane cuts an edge.
    fn crossing(&mut self, a: u32, b: u32, plane: DVec4) -> Result<u32, MeshClipError> {
        let key = [a.min(b), a.max(b)];
        if let Some(&v) = self.crossings.get(&key) {
            return Ok(v);
        }
        let place = self.place(a, b, plane);
        // -0 and 0 are one place.
        let bits = (place + 0.0).to_array().map(f64::to_bits);
        let v = match [a, b].iter().find_map(|&end| self.near.get(&(end, bits))) {
            Some(&v) => v,
            None if self.points.len() >= NONE as usize - 1 => return Err(MeshClipError::TooLarge),
            None => {
                self.points.push(place);
                self.points.len() as u32 - 1
            }
        };
        for end in [a, b] {
            self.near.entry((end, bits)).or_insert(v);
        }
        self.crossings.insert(key, v);
        Ok(v)
    }

    /// The wedge at crossing `v` of the edge from vertex a (with wedge wa) to b (wb).
    fn mixed(&mut self, v: u32, a: (u32, u32), b: (u32, u32)) -> u32 {
        let Some(wedges) = &mut self.wedges else { return NONE };
        if a.1 == NONE || b.1 == NONE {
            return NONE;
        }
        let (low, high) = if a.0 < b.0 { (a, b) } else { (b, a) };
        *self.mixed.entry([v, low.1, high.1]).or_insert_with(|| {
            let s = |v: u32| self.sides[v as usize];
            let (from, to, t) = fraction(a.1, s(a.0), b.1, s(b.0));
            mix_wedges(wedges, from, to, t)
        })
    }

    /// Puts what is left of a face that the plane cuts.
    fn cut_face(
        &mut self,
        faces: &Faces,
        f: usize,
        slots: std::ops::Range<usize>,
        plane: DVec4,
        pieces: &mut Pieces,
    ) -> Result<(), MeshClipError> {
        let corners = &faces.corners[slots.clone()];
        let n = corners.len() as u32;
        pieces.sides.clear();
        pieces.sides.extend(corners.iter().map(|&v| self.sides[v as usize]));
        pieces.chains.clear();
        if chains(0, n, &pieces.sides, &mut pieces.chains) != Whole::Cut {
            return Ok(());
        }
        let following = if pieces.chains.len() == 1 {
            vec![0]
        } else {
            self.order_chains(corners, &pieces.chains, &pieces.sides, plane)
        };
        let wedge = |i: u32| faces.wedges.get(slots.start + i as usize).copied().unwrap_or(NONE);
        pieces.done.clear();
        pieces.done.resize(pieces.chains.len(), false);
        for first in 0..pieces.chains.len() {
            pieces.cycle.clear();
            let mut c = first;
            while !std::mem::replace(&mut pieces.done[c], true) {
                let chain = pieces.chains[c];
                let node = |me: &mut Self, node: Node| -> Result<(u32, u32), MeshClipError> {
                    Ok(match node {
                        Node::Vertex(i) => (corners[i as usize], wedge(i)),
                        Node::Edge(i) => {
                            let j = next(i, 0, n);
                            let (a, b) = ((corners[i as usize], wedge(i)), (corners[j as usize], wedge(j)));
                            let v = me.crossing(a.0, b.0, plane)?;
                            (v, me.mixed(v, a, b))
                        }
                    })
                };
                let start = node(self, chain.start)?;
                pieces.put(start);
                let mut i = chain.first;
                loop {
                    pieces.put((corners[i as usize], wedge(i)));
                    if i == chain.last {
                        break;
                    }
                    i = next(i, 0, n);
                }
                pieces.put(node(self, chain.end)?);
                c = following[c] as usize;
            }
            // The boundary may end where it began.
            let vertex = |c: Option<&(u32, u32)>| c.map(|c| c.0);
            while pieces.cycle.len() > 1 && vertex(pieces.cycle.first()) == vertex(pieces.cycle.last()) {
                pieces.cycle.pop();
            }
            if pieces.cycle.len() >= 3 {
                let corners = pieces.cycle.iter().copied();
                self.next.put(corners, self.wedges.is_some(), faces.origin[f], faces.is_cap[f]);
            }
        }
        Ok(())
    }

    /// Which chain follows which, of a face that is not convex: by their places along the cut.
    fn order_chains(&self, corners: &[u32], chains: &[Chain], sides: &[f64], plane: DVec4) -> Vec<u32> {
        let n = corners.len() as u32;
        let along = plane.truncate().cross(self.normal(corners));
        let at = |i: u32| {
            (self.points[corners[i as usize] as usize] - self.points[corners[0] as usize]).dot(along)
        };
        let place = |node: Node| match node {
            Node::Vertex(i) => at(i),
            Node::Edge(i) => {
                let j = next(i, 0, n);
                let (from, to, t) = fraction(at(i), sides[i as usize], at(j), sides[j as usize]);
                from + (to - from) * t
            }
        };
        // Where the end is, and the cotangent of the angle of the edge there.
        let key = |e: &End| {
            let chain = &chains[e.chain as usize];
            let (node, inner) = if e.start { (chain.start, chain.first) } else { (chain.end, chain.last) };
            let place = place(node);
            (place, (at(inner) - place) / sides[inner as usize])
        };
        follow(chains, |a, b| {
            let (a, b) = (key(a), key(b));
            a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
        })
    }

    fn cut_wires(&mut self, plane: DVec4) -> Result<(), MeshClipError> {
        let mut kept = Vec::with_capacity(self.wires.len());
        for [a, b] in std::mem::take(&mut self.wires) {
            let (sa, sb) = (self.sides[a as usize], self.sides[b as usize]);
            match (sa >= 0.0, sb >= 0.0) {
                (true, true) => kept.push([a, b]),
                (true, false) if sa > 0.0 => kept.push([a, self.crossing(a, b, plane)?]),
                (false, true) if sb > 0.0 => kept.push([self.crossing(a, b, plane)?, b]),
                _ => {}
            }
        }
        self.wires = kept;
        Ok(())
    }

    /// Closes the cut that was just made.
    fn cap(&mut self, plane: DVec4) -> Result<(), MeshClipError> {
        // New vertices have no side; they are on the plane.
        let on = |v: u32| self.sides.get(v as usize).is_none_or(|&s| s == 0.0);
        let mut border: Vec<Side> = Vec::new();
        let mut start = 0;
        for f in 0..self.faces.sizes.len() {
            let (from, to) = (start, start + self.faces.sizes[f]);
            start = to;
            for c in from..to {
                let d = next(c, from, to);
                let (a, b) = (self.faces.corners[c as usize], self.faces.corners[d as usize]);
                if on(a) && on(b) {
                    let wedge = |c: u32| self.faces.wedges.get(c as usize).copied().unwrap_or(NONE);
                    border.push(Side {
                        ends: [a, b],
                        wedges: [wedge(c), wedge(d)],
                        face: self.faces.origin[f],
                    });
                }
            }
        }
        let normal = -plane.truncate();
        let labels = &self.labels;
        let label = |f: u32| labels.map(|l| l.get(f as usize).copied().unwrap_or(NONE));
        let caps = cap::caps(&self.points, normal, border, &label);
        self.done.loops += caps.loops;
        self.done.open_edges += caps.open_edges;
        let mut own: FxHashMap<u32, u32> = FxHashMap::default();
        let unit = normal.normalize_or_zero().as_vec3().to_array();
        for cap in caps.triangles {
            let corners = cap.corners.map(|(v, w)| {
                let Some(wedges) = self.wedges.as_mut().filter(|_| w != NONE) else { return (v, NONE) };
                (v, *own.entry(w).or_insert_with(|| cap_wedge(wedges, w, unit)))
            });
            self.faces.put(corners.into_iter(), self.wedges.is_some(), cap.face, true);
            self.done.capped += 1;
        }
        if self.faces.corners.len() >= NONE as usize { Err(MeshClipError::TooLarge) } else { Ok(()) }
    }

    /// Cuts the polygons that cutting triangles left into triangles.
    fn cut_into_triangles(&mut self) {
        let faces = std::mem::take(&mut self.faces);
        let (mut points, mut triangles, mut start) = (Vec::new(), Vec::new(), 0);
        for (f, &n) in faces.sizes.iter().enumerate() {
            let corner = |i: u32| {
                let c = start + i as usize;
                (faces.corners[c], faces.wedges.get(c).copied().unwrap_or(NONE))
            };
            triangles.clear();
            if n > 3 {
                points.clear();
                points.extend((0..n).map(|i| self.points[corner(i).0 as usize]));
                triangulate_polygon(&points, &mut triangles);
            } else {
                triangles.push([0, 1, 2]);
            }
            for t in &triangles {
                let corners = t.iter().map(|&i| corner(i));
                self.faces.put(corners, self.wedges.is_some(), faces.origin[f], faces.is_cap[f]);
            }
            start += n as usize;
        }
    }

    fn finish(mut self, input: &MeshInput) -> Result<MeshClip, MeshClipError> {
        if input.face_sizes.is_none() {
            self.cut_into_triangles();
        }
        // Caps that were cut again are counted as they are now.
        self.done.capped = self.faces.is_cap.iter().filter(|&&c| c).count();
        let gathered = Gathered {
            points: &self.points,
            single: self.single,
            wedges: self.wedges.as_ref(),
            faces: &self.faces,
            wires: &self.wires,
            lonely: &self.lonely,
        };
        self.done.mesh = gathered.mesh(input)?;
        Ok(self.done)
    }
}

/// Scratch for cutting one face.
#[derive(Default)]
struct Pieces {
    sides: Vec<f64>,
    chains: Vec<Chain>,
    done: Vec<bool>,
    cycle: Vec<(u32, u32)>,
}

impl Pieces {
    /// A corner of the cycle, unless it is at the vertex before it: cuts may have rounded to one.
    fn put(&mut self, corner: (u32, u32)) {
        if self.cycle.last().is_none_or(|last| last.0 != corner.0) {
            self.cycle.push(corner);
        }
    }
}

/// The faces of a mesh that `keep` names (ascending), with what they use; edges without a face stay, vertices of nothing too.
///
/// Errors: a mesh that [`crate::aif::Mesh::build`] would refuse; a face out of range counts as one.
pub fn gather_faces(input: &MeshInput, keep: &[u32]) -> Result<MeshInput, MeshClipError> {
    input.validate()?;
    let mut work = Work::new(input);
    let all = std::mem::take(&mut work.faces);
    let mut starts = vec![0usize];
    starts.extend(all.sizes.iter().scan(0, |sum, &n| {
        *sum += n as usize;
        Some(*sum)
    }));
    for f in keep.iter().map(|&f| f as usize).filter(|&f| f < all.sizes.len()) {
        let wedge = |c: usize| all.wedges.get(c).copied().unwrap_or(NONE);
        let corners = (starts[f]..starts[f + 1]).map(|c| (all.corners[c], wedge(c)));
        work.faces.put(corners, work.wedges.is_some(), f as u32, false);
    }
    work.finish(input).map(|done| done.mesh)
}
