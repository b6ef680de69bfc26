//! What is left of a block: its triangles, and as much of their past as bounds need.

use super::NONE;

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
    /// How many former vertices each corner has.
    pub(super) counts: Vec<[u32; 3]>,
    /// How many faces that went are remembered along each side, with their tip where it begins, and where it ends.
    pub(super) open: Vec<[[u32; 2]; 3]>,
    /// These, side by side.
    pub(super) gone: Vec<Gone>,
    /// Former vertices, the latest first: of all corners of all faces, then of those that went.
    pub(super) former: Vec<Former>,
    /// Of the collapses that the above name: bounds and radii.
    pub(super) past: Vec<[f32; 2]>,
}

impl Sheet {
    /// A sheet without a past.
    pub(super) fn new(vertices: Vec<Vertex>, faces: Vec<[u32; 3]>) -> Self {
        Sheet {
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
        for ((v, last), &to) in other.vertices.into_iter().zip(other.last).zip(map) {
            if to as usize == self.vertices.len() {
                self.vertices.push(v);
                self.last.push(id(last));
            } else if let Some(known) = self.last.get_mut(to as usize).filter(|known| **known == NONE) {
                // Of shared vertices neither has one: borders are not collapsed onto.
                *known = id(last);
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
