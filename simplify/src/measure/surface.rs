//! A surface to measure: triangles of any kind, and a hierarchy over them.

use super::MeasureError;
use super::bvh::{self, Bvh};
use crate::parallel;
use glam::DVec3;
use progmesh_aif::{Mesh, Positions};
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Positions as a caller has them.
#[derive(Clone, Copy, Debug)]
pub enum Points<'a> {
    /// Single precision.
    F32(&'a [[f32; 3]]),
    /// Double precision.
    F64(&'a [[f64; 3]]),
}

impl Points<'_> {
    fn len(&self) -> usize {
        match self {
            Points::F32(p) => p.len(),
            Points::F64(p) => p.len(),
        }
    }

    #[inline]
    fn get(&self, i: u32) -> DVec3 {
        match self {
            Points::F32(p) => DVec3::from_array(p[i as usize].map(f64::from)),
            Points::F64(p) => DVec3::from_array(p[i as usize]),
        }
    }
}

impl<'a> From<&'a [[f32; 3]]> for Points<'a> {
    fn from(p: &'a [[f32; 3]]) -> Self {
        Points::F32(p)
    }
}

impl<'a> From<&'a [[f64; 3]]> for Points<'a> {
    fn from(p: &'a [[f64; 3]]) -> Self {
        Points::F64(p)
    }
}

impl<'a> From<&'a Positions> for Points<'a> {
    fn from(p: &'a Positions) -> Self {
        match p {
            Positions::F32(p) => Points::F32(p),
            Positions::F64(p) => Points::F64(p),
        }
    }
}

/// Where a surface computes: about its centre, scaled by a power of two to within [-1, 1].
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) origin: DVec3,
    pub(super) scale: f64,
}

impl Frame {
    fn around(lo: DVec3, hi: DVec3) -> Self {
        // Halves first: the sum may overflow.
        let half = (hi * 0.5 - lo * 0.5).max_element();
        let exponent = if half > 0.0 { (half.log2().ceil() as i32).clamp(-1000, 1000) } else { 0 };
        let centre = hi * 0.5 + lo * 0.5;
        // Of few digits, so that the differences between two such origins, and of them and f32 positions, are exact.
        let grid = 2f64.powi((exponent - 10).max(-1000));
        let origin = (centre / grid).round() * grid;
        Frame { origin: if origin.is_finite() { origin } else { centre }, scale: 2f64.powi(-exponent) }
    }

    /// A point of the world in this frame.
    #[inline]
    pub(super) fn local(&self, p: DVec3) -> DVec3 {
        (p - self.origin) * self.scale
    }

    /// A point of this frame in the world.
    #[inline]
    pub(super) fn world(&self, p: DVec3) -> DVec3 {
        p / self.scale + self.origin
    }

    /// Takes points of this frame to `other`, without the detour by the world, where far from its origin digits would be lost.
    pub(super) fn to(&self, other: &Frame) -> Shift {
        Shift { factor: other.scale / self.scale, by: (self.origin - other.origin) * other.scale }
    }
}

/// The way from one frame to another.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shift {
    factor: f64,
    by: DVec3,
}

impl Shift {
    #[inline]
    pub(super) fn apply(&self, p: DVec3) -> DVec3 {
        p * self.factor + self.by
    }
}

/// Triangles, ready for distance queries.
///
/// Any triangles will do: soups, overlapping and repeated ones, and degenerate ones, which count as the segment or point they are. Vertices
/// of no triangle are no part of the surface. Triangles and vertices are named by their index in the input. 60 B a triangle;
/// the same for every number of threads.
#[derive(Clone, Debug)]
pub struct Surface {
    pub(super) frame: Frame,
    /// The vertices of triangles, in local coordinates, by first use.
    pub(super) points: Vec<DVec3>,
    /// Triangles in the order of the hierarchy, as indices into `points`.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Triangle -> its index in the input.
    pub(super) ids: Vec<u32>,
    /// Vertex -> its index in the input.
    pub(super) vertex_ids: Vec<u32>,
    /// How many vertices the input had.
    pub(super) input_vertices: usize,
    pub(super) bvh: Bvh,
    lo: DVec3,
    hi: DVec3,
}

/// Triangles to a chunk of the loops here.
const CHUNK: usize = 1 << 13;
/// What a vertex of no triangle is numbered.
const UNUSED: u32 = u32::MAX;

impl Surface {
    /// A surface of triangles, given as indices into `points`. O(n log n).
    ///
    /// Errors: there is no triangle, or more than 2^31; an index without a point; a vertex of a triangle that is not finite.
    pub fn new<'a>(points: impl Into<Points<'a>>, triangles: &[[u32; 3]]) -> Result<Self, MeasureError> {
        Self::build(points.into(), triangles)
    }

    /// The surface of a mesh; polygons are cut into triangles, which then are numbered as [`Mesh::triangulate`] numbers them. O(n log n).
    ///
    /// Triangles are numbered in the order of the live faces, vertices by their slots.
    pub fn from_mesh(mesh: &Mesh) -> Result<Self, MeasureError> {
        if mesh.topology().is_triangular() {
            return Self::new(mesh.positions(), &mesh.triangles());
        }
        let cut = mesh.clone().triangulate()?.mesh;
        Self::new(cut.positions(), &cut.triangles())
    }

    fn build(input: Points<'_>, corners: &[[u32; 3]]) -> Result<Self, MeasureError> {
        if corners.is_empty() {
            return Err(MeasureError::NoTriangle);
        }
        if corners.len() > 1 << 31 {
            return Err(MeasureError::TooLarge { triangles: corners.len() });
        }
        let (lo, hi) = bounds(input, corners)?;
        let frame = Frame::around(lo, hi);
        let mut centres = vec![[0f32; 3]; corners.len()];
        parallel::for_chunks(&mut centres, CHUNK, |first, chunk| {
            for (centre, t) in chunk.iter_mut().zip(&corners[first..]) {
                let [a, b, c] = t.map(|v| input.get(v));
                let middle = a.min(b).min(c) * 0.5 + a.max(b).max(c) * 0.5;
                *centre = frame.local(middle).to_array().map(|x| x as f32);
            }
        });
        let ids = bvh::order(centres);
        let mut number = vec![UNUSED; input.len()];
        let mut vertex_ids = Vec::with_capacity(corners.len() / 2);
        let mut triangles = Vec::with_capacity(corners.len());
        for &id in &ids {
            triangles.push(corners[id as usize].map(|v| {
                let at = &mut number[v as usize];
                if *at == UNUSED {
                    *at = vertex_ids.len() as u32;
                    vertex_ids.push(v);
                }
                *at
            }));
        }
        let points: Vec<DVec3> = vertex_ids.iter().map(|&v| frame.local(input.get(v))).collect();
        let bvh = Bvh::new(triangles.len(), |t| bvh::bounds_of(triangles[t].map(|v| points[v as usize])));
        Ok(Surface { frame, points, triangles, ids, vertex_ids, input_vertices: input.len(), bvh, lo, hi })
    }

    /// Vertex -> the first vertex at the same place. O(n) in effect.
    pub(super) fn same_places(&self) -> Vec<u32> {
        let mut first: HashMap<[u64; 3], u32, BuildHasherDefault<Places>> = HashMap::default();
        first.reserve(self.points.len());
        let number = |(v, p): (usize, &DVec3)| {
            // One zero.
            let bits = p.to_array().map(|x| (x + 0.0).to_bits());
            *first.entry(bits).or_insert(v as u32)
        };
        self.points.iter().enumerate().map(number).collect()
    }

    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Number of vertices that triangles have.
    pub fn vertex_count(&self) -> usize {
        self.points.len()
    }

    /// Least and greatest coordinates.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        (self.lo, self.hi)
    }

    /// Length of the bounding box's diagonal; 0 if all is one point.
    pub fn diagonal(&self) -> f64 {
        (self.frame.local(self.hi) - self.frame.local(self.lo)).length() / self.frame.scale
    }

    /// Area of all triangles.
    pub fn area(&self) -> f64 {
        let double: f64 = (0..self.triangles.len()).map(|t| double_area(self.corners(t))).sum();
        double * 0.5 / self.frame.scale / self.frame.scale
    }

    /// The corners of triangle `t` of the hierarchy, local.
    #[inline]
    pub(super) fn corners(&self, t: usize) -> [DVec3; 3] {
        self.triangles[t].map(|v| self.points[v as usize])
    }

    /// The normal of triangle `t` of the hierarchy, of any length; zero if it has no area.
    #[inline]
    pub(super) fn normal(&self, t: u32) -> DVec3 {
        let [a, b, c] = self.corners(t as usize);
        (b - a).cross(c - a)
    }

    /// The point of triangle `t` of the hierarchy with these weights of the second and third corner, local.
    #[inline]
    pub(super) fn point_on(&self, t: u32, v: f64, w: f64) -> DVec3 {
        let [a, b, c] = self.corners(t as usize);
        a + (b - a) * v + (c - a) * w
    }
}

/// Mixes coordinates: their high bits tell them apart.
#[derive(Default)]
struct Places(u64);

impl Hasher for Places {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&b| self.write_u64(u64::from(b)));
    }

    fn write_u64(&mut self, x: u64) {
        let mixed = (self.0 ^ x).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ mixed >> 32;
    }

    fn write_usize(&mut self, _: usize) {
        // The length of an array, always the same.
    }

    fn finish(&self) -> u64 {
        self.0.wrapping_mul(0x9e37_79b9_7f4a_7c15)
    }
}

/// Twice the area.
#[inline]
pub(super) fn double_area([a, b, c]: [DVec3; 3]) -> f64 {
    (b - a).cross(c - a).length()
}

/// Least and greatest coordinates of all corners; refuses what is no surface.
fn bounds(input: Points<'_>, corners: &[[u32; 3]]) -> Result<(DVec3, DVec3), MeasureError> {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let parts = parallel::map_init_chunks(
        corners,
        CHUNK,
        || (),
        |_, first, chunk| {
            let (mut lo, mut hi) = none;
            for (i, t) in chunk.iter().enumerate() {
                for &vertex in t {
                    if vertex as usize >= input.len() {
                        return Err(MeasureError::OutOfRange {
                            triangle: first + i,
                            vertex,
                            vertices: input.len(),
                        });
                    }
                    let p = input.get(vertex);
                    if !p.is_finite() {
                        return Err(MeasureError::NotFinite { vertex, triangle: first + i });
                    }
                    (lo, hi) = (lo.min(p), hi.max(p));
                }
            }
            Ok((lo, hi))
        },
    );
    let mut all = none;
    for part in parts {
        let (lo, hi) = part?;
        all = (all.0.min(lo), all.1.max(hi));
    }
    Ok(all)
}
