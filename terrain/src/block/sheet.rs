//! What is left of a block: its triangles, and as much of their past as bounds need.

use super::NONE;
use super::history::up;

/// A vertex: a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vertex {
    /// Column.
    pub x: i32,
    /// Row.
    pub y: i32,
    /// Height, as it is written.
    pub z: f32,
}

/// What came of a vertex, in the finest mesh: its own fan and those of all vertices that went onto it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Round {
    /// The radius of a sphere about the vertex that holds these faces, and all that was measured for bounds.
    pub reach: f32,
    /// The least cosine of the angle between one of their normals and up.
    pub upright: f32,
}

impl Round {
    fn join(self, other: Round) -> Round {
        Round { reach: self.reach.max(other.reach), upright: self.upright.min(other.upright) }
    }
}

/// The square of the distance between two vertices, heights included, in steps by a column.
pub(super) fn square(a: Vertex, b: Vertex, scale: [f64; 2]) -> f64 {
    let (x, y) = (f64::from(a.x - b.x), f64::from(a.y - b.y) * scale[0]);
    let z = (f64::from(a.z) - f64::from(b.z)) * scale[1];
    x * x + y * y + z * z
}

/// A vertex that a corner of a face had before a collapse took it to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Former {
    pub vertex: Vertex,
    /// The collapse.
    pub by: u32,
}

/// Two corners of a face that a collapse took away, the third being its tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gone {
    pub at: [Vertex; 2],
    /// How many former vertices each has.
    pub counts: [u32; 2],
}

/// The triangles of a block after its collapses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sheet {
    /// Its vertices.
    pub vertices: Vec<Vertex>,
    /// Its triangles.
    pub faces: Vec<[u32; 3]>,
    /// The collapse that joined the faces along each side; [`NONE`] where they always were neighbours.
    pub(super) joined: Vec<[u32; 3]>,
    /// The last collapse onto each vertex, or [`NONE`].
    pub(super) last: Vec<u32>,
    /// Of every vertex.
    pub(super) round: Vec<Round>,
    /// How many former vertices each corner has.
    pub(super) counts: Vec<[u32; 3]>,
    /// How many faces that went are remembered along each side, with their tip where it begins, and where it ends.
    pub(super) open: Vec<[[u32; 2]; 3]>,
    /// These, side by side.
    pub(super) gone: Vec<Gone>,
    /// Former vertices, the latest first: of all corners of all faces, then of those that went.
    pub(super) former: Vec<Former>,
    /// Of the collapses that the above name: bounds.
    pub(super) past: Vec<f32>,
}

impl Sheet {
    /// A sheet without a past: faces of the finest mesh.
    pub(super) fn new(vertices: Vec<Vertex>, faces: Vec<[u32; 3]>, scale: [f64; 2]) -> Self {
        // Squares of the reaches first.
        let mut round = vec![(0.0f64, 1.0f32); vertices.len()];
        for f in &faces {
            let [a, b, c] = f.map(|v| vertices[v as usize]);
            let from_a = |p: Vertex| {
                let z = (f64::from(p.z) - f64::from(a.z)) * scale[1];
                [f64::from(p.x - a.x), f64::from(p.y - a.y) * scale[0], z]
            };
            let (u, v) = (from_a(b), from_a(c));
            let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
            let (ab, ca) = (dot(u, u), dot(v, v));
            let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            // Rounded down, and well so.
            let upright = (normal[2] / dot(normal, normal).sqrt()) as f32 - 1e-6;
            let bc = square(b, c, scale);
            for (v, far) in f.iter().zip([ab.max(ca), ab.max(bc), bc.max(ca)]) {
                let own = &mut round[*v as usize];
                *own = (own.0.max(far), own.1.min(upright));
            }
        }
        let round: Vec<Round> =
            round.into_iter().map(|(far, upright)| Round { reach: up(far.sqrt()), upright }).collect();
        Sheet {
            round,
            joined: vec![[NONE; 3]; faces.len()],
            counts: vec![[0; 3]; faces.len()],
            open: vec![[[0; 2]; 3]; faces.len()],
            last: vec![NONE; vertices.len()],
            vertices,
            faces,
            ..Sheet::default()
        }
    }

    /// Appends another, its vertices numbered as `map` says: those beyond this sheet's come new, in order.
    pub(super) fn append(&mut self, other: Sheet, map: &[u32]) {
        let shift = self.past.len() as u32;
        let id = |i: u32| if i == NONE { NONE } else { i + shift };
        for (((v, last), round), &to) in other.vertices.into_iter().zip(other.last).zip(other.round).zip(map)
        {
            if to as usize == self.vertices.len() {
                self.vertices.push(v);
                self.last.push(id(last));
                self.round.push(round);
            } else if let Some(known) = self.round.get_mut(to as usize) {
                // Nothing was collapsed onto shared vertices.
                *known = known.join(round);
            }
        }
        let own: usize = self.counts.as_flattened().iter().map(|&c| c as usize).sum();
        let others: usize = other.counts.as_flattened().iter().map(|&c| c as usize).sum();
        let mut former = other.former.into_iter().map(|f| Former { by: id(f.by), ..f });
        let of_faces: Vec<Former> = former.by_ref().take(others).collect();
        self.former.splice(own..own, of_faces);
        self.former.extend(former);
        self.open.extend(other.open);
        self.gone.extend(other.gone);
        self.faces.extend(other.faces.iter().map(|f| f.map(|v| map[v as usize])));
        self.joined.extend(other.joined.iter().map(|j| j.map(id)));
        self.counts.extend(other.counts);
        self.past.extend(other.past);
    }
}
