//! What both readers of OFF collect, and the scene made of it.

use crate::aif::{Channel, Encoding, MeshInput, NONE, Positions, Semantic, Wedges};
use crate::io::Decoded;
use crate::scene::{Scene, SceneMesh};

/// What the header's prefixes announce for every vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Announced {
    pub(super) uvs: bool,
    pub(super) colors: bool,
    pub(super) normals: bool,
}

/// A colour as read: three or four numbers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Color {
    pub(super) rgba: [f32; 4],
    pub(super) alpha: bool,
}

/// Everything read; the vertex arrays are empty or parallel to the positions, `face_color` to the faces.
#[derive(Default)]
pub(super) struct Parts {
    pub(super) sizes: Vec<u32>,
    pub(super) corners: Vec<u32>,
    pub(super) wires: Vec<[u32; 2]>,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) uvs: Vec<[f32; 2]>,
    pub(super) vertex_color: Vec<Option<Color>>,
    pub(super) face_color: Vec<Option<Color>>,
    /// True once a colour was written as a float.
    pub(super) float_colors: bool,
}

impl Parts {
    pub(super) fn finish(mut self, positions: Positions, mut warnings: Vec<String>) -> Decoded {
        if self.vertex_color.iter().any(Option::is_some) && self.face_color.iter().any(Option::is_some) {
            warnings.push("face colours are left out, for the vertices have colours too".into());
            self.face_color.clear();
        }
        let wedges = self.wedges();
        let triangles = self.sizes.iter().all(|&n| n == 3);
        let geometry = MeshInput {
            positions,
            face_sizes: (!triangles).then_some(self.sizes),
            corners: self.corners,
            wires: self.wires,
            wedges,
            ..Default::default()
        };
        Decoded { scene: Scene::from_mesh(SceneMesh { geometry, ..Default::default() }), warnings }
    }

    fn wedges(&self) -> Option<Wedges> {
        let colors = || self.vertex_color.iter().chain(&self.face_color).flatten();
        let has_color = colors().next().is_some();
        let by_face = self.face_color.iter().any(Option::is_some);
        if self.normals.is_empty() && self.uvs.is_empty() && !has_color {
            return None;
        }
        let whole = !self.float_colors && colors().any(|c| c.rgba[..3].iter().any(|&x| x > 1.0));
        let width = 3 + colors().any(|c| c.alpha) as usize;
        let mut channels = Vec::new();
        if !self.normals.is_empty() {
            channels.push(Channel::new(Semantic::Normal, 3));
        }
        if !self.uvs.is_empty() {
            channels.push(Channel::new(Semantic::TexCoord(0), 2));
        }
        if has_color {
            let encoding = if whole { Encoding::U8Norm } else { Encoding::F32 };
            channels.push(Channel { semantic: Semantic::Color(0), width, encoding });
        }
        // At most three channels: cannot fail.
        let mut wedges = Wedges::new(channels).ok()?;
        let (scale, opaque) = if whole { (255.0, 255.0) } else { (1.0, 1.0) };
        let mut row = Vec::with_capacity(wedges.stride());
        let mut push = |wedges: &mut Wedges, vertex: usize, color: Option<Color>| {
            row.clear();
            let mut present = 0u64;
            let mut bit = 1;
            if let Some(n) = self.normals.get(vertex) {
                row.extend_from_slice(n);
                present |= bit;
                bit <<= 1;
            }
            if let Some(uv) = self.uvs.get(vertex) {
                row.extend_from_slice(uv);
                present |= bit;
                bit <<= 1;
            }
            if has_color {
                present |= if color.is_some() { bit } else { 0 };
                let mut c = color.unwrap_or_default();
                if !c.alpha {
                    c.rgba[3] = if color.is_some() { opaque } else { 0.0 };
                }
                row.extend(c.rgba[..width].iter().map(|x| x / scale));
            }
            if present == 0 { NONE } else { wedges.push(&row, present) }
        };
        if by_face {
            let mut corner = Vec::with_capacity(self.corners.len());
            let mut at = 0;
            for (f, &n) in self.sizes.iter().enumerate() {
                let color = self.face_color.get(f).copied().flatten();
                let vertices = &self.corners[at..at + n as usize];
                at += n as usize;
                if self.normals.is_empty() && self.uvs.is_empty() {
                    // The face's corners differ in nothing: one wedge.
                    let w = push(&mut wedges, usize::MAX, color);
                    corner.extend(vertices.iter().map(|_| w));
                } else {
                    corner.extend(vertices.iter().map(|&v| push(&mut wedges, v as usize, color)));
                }
            }
            wedges.corner = corner;
        } else {
            let vertices = self.normals.len().max(self.uvs.len()).max(self.vertex_color.len());
            let of_vertex: Vec<u32> = (0..vertices)
                .map(|v| push(&mut wedges, v, self.vertex_color.get(v).copied().flatten()))
                .collect();
            wedges.corner = self.corners.iter().map(|&v| of_vertex[v as usize]).collect();
        }
        Some(wedges)
    }
}
