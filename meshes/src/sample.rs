//! What a generator returns: plain arrays, as a file would hold them.

/// A generated mesh.
///
/// A hostile sample may break what is said here (an index out of range, a coordinate that is not finite); that is its point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sample {
    /// Position of every vertex. Every coordinate is exactly an f32, but in samples whose name ends in `-f64`.
    pub positions: Vec<[f64; 3]>,
    /// Number of corners of every face; `None` when all are triangles.
    pub face_sizes: Option<Vec<u32>>,
    /// The vertices of all faces, one after the other, counter-clockwise seen from outside.
    pub corners: Vec<u32>,
    /// Edges of no face: two vertices each.
    pub wires: Vec<[u32; 2]>,
    /// Unit normals of the corners.
    pub normals: Option<CornerValues<3>>,
    /// Texture coordinates of the corners, v upwards.
    pub uvs: Option<CornerValues<2>>,
    /// Material of every face, an index of `materials`; empty when there are none.
    pub face_material: Vec<u32>,
    /// The materials.
    pub materials: Vec<Material>,
    /// The images that materials refer to.
    pub textures: Vec<Texture>,
}

/// Values of the corners, each through an index of its own: a vertex on a seam has several.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CornerValues<const N: usize> {
    /// The values.
    pub values: Vec<[f32; N]>,
    /// Index of the value of every corner, parallel to [`Sample::corners`].
    pub corner: Vec<u32>,
}

/// A surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Material {
    /// Its name.
    pub name: String,
    /// Linear RGB.
    pub base_color: [f32; 3],
    /// Index of [`Sample::textures`].
    pub texture: Option<usize>,
}

/// An image: rows from the top, three bytes (sRGB) a pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Texture {
    /// Its name, fit for a file's stem.
    pub name: String,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `3 * width * height` bytes.
    pub rgb: Vec<u8>,
}

impl Sample {
    /// Number of faces.
    pub fn face_count(&self) -> usize {
        self.face_sizes.as_ref().map_or(self.corners.len() / 3, Vec::len)
    }

    /// Number of triangles the faces make: a polygon of n corners counts n - 2.
    pub fn triangle_count(&self) -> usize {
        match &self.face_sizes {
            None => self.corners.len() / 3,
            Some(s) => s.iter().map(|&n| n.saturating_sub(2) as usize).sum(),
        }
    }

    /// The corners of every face, in order.
    pub fn faces(&self) -> impl Iterator<Item = &[u32]> + '_ {
        let mut rest = self.corners.as_slice();
        (0..self.face_count()).map(move |f| {
            let n = self.face_sizes.as_ref().map_or(3, |s| s[f] as usize);
            let (face, after) = rest.split_at(n);
            rest = after;
            face
        })
    }

    /// Positions rounded to f32; exact, but for samples whose name ends in `-f64`.
    pub fn positions_f32(&self) -> Vec<[f32; 3]> {
        self.positions.iter().map(|p| p.map(|x| x as f32)).collect()
    }

    /// Least and greatest coordinates of the finite positions; `None` if there is none.
    pub fn bounds(&self) -> Option<([f64; 3], [f64; 3])> {
        let mut all = self.positions.iter().filter(|p| p.iter().all(|x| x.is_finite()));
        let first = *all.next()?;
        Some(all.fold((first, first), |(lo, hi), p| {
            (std::array::from_fn(|k| lo[k].min(p[k])), std::array::from_fn(|k| hi[k].max(p[k])))
        }))
    }

    /// Length of the diagonal of the bounds; 0 when empty.
    pub fn diagonal(&self) -> f64 {
        self.bounds()
            .map_or(0.0, |(lo, hi)| (0..3).map(|k| (hi[k] - lo[k]) * (hi[k] - lo[k])).sum::<f64>().sqrt())
    }

    /// Rounds every coordinate to f32.
    pub(crate) fn round_to_f32(&mut self) {
        for x in self.positions.as_flattened_mut() {
            *x = *x as f32 as f64;
        }
    }
}

/// A triangle mesh of these points, rounded to f32.
pub(crate) fn triangle_mesh(points: impl IntoIterator<Item = glam::DVec3>, triangles: &[[u32; 3]]) -> Sample {
    let positions = points.into_iter().map(|p| p.to_array()).collect();
    let mut sample = Sample { positions, corners: triangles.as_flattened().to_vec(), ..Default::default() };
    sample.round_to_f32();
    sample
}
