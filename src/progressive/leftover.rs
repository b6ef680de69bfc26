//! Faces that no mesh can hold: fewer than three distinct corners, a corner twice. Building leaves them out or mends them; kept here, they come
//! back at full detail.

use crate::aif::{BuildReport, MeshInput, NONE, Wedges};
use std::collections::HashMap;

/// The faces of an input that building left out or mended, as they were.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Leftover {
    /// Their numbers in the input, ascending.
    pub faces: Vec<u32>,
    /// Corners of each.
    pub sizes: Vec<u32>,
    /// How many faces building made of each.
    pub mended: Vec<u32>,
    /// Vertices of their corners.
    pub corners: Vec<u32>,
    /// Wedges of their corners, [`NONE`] for none; those beyond the mesh's are in `rows`. Empty without attributes.
    pub wedges: Vec<u32>,
    /// Channels that each wedge of only these faces has.
    pub present: Vec<u64>,
    /// The values of those wedges, row after row.
    pub rows: Vec<f32>,
    /// Material of each, if faces have materials.
    pub materials: Vec<u32>,
    /// Group of each, if faces have groups.
    pub groups: Vec<u32>,
}

impl Leftover {
    /// What `input` has beside `built`, which building made of it as `report` says; empty if that is nothing, or cannot be told because vertices were
    /// welded.
    pub(crate) fn find(input: &MeshInput, built: &MeshInput, report: &BuildReport) -> Self {
        let mut faces: Vec<u32> = [&report.dropped_faces, &report.shortened_faces, &report.split_faces]
            .into_iter()
            .flatten()
            .copied()
            .collect();
        faces.sort_unstable();
        faces.dedup();
        if faces.is_empty() || report.vertex_map.is_some() {
            return Leftover::default();
        }
        let same: Vec<u32>;
        let map = match &report.face_map {
            Some(map) => map,
            None => {
                same = (0..built.face_count() as u32).collect();
                &same
            }
        };
        let ends = |m: &MeshInput| -> Vec<usize> {
            let mut end = 0;
            let sizes = m.face_sizes.as_deref();
            let size = |f: usize| sizes.map_or(3, |s| s[f] as usize);
            (0..m.face_count())
                .map(|f| {
                    end += size(f);
                    end
                })
                .collect()
        };
        let (old, new) = (ends(input), ends(built));
        let range = |ends: &[usize], f: usize| (if f == 0 { 0 } else { ends[f - 1] })..ends[f];
        let mut out = Leftover { faces, ..Default::default() };
        out.mended = vec![0; out.faces.len()];
        // Wedges of faces that are in both tell which is which.
        let mut wedge = HashMap::new();
        for (f, &from) in map.iter().enumerate() {
            match out.faces.binary_search(&from) {
                Ok(k) => out.mended[k] += 1,
                Err(_) => {
                    if let (Some(a), Some(b)) = (&input.wedges, &built.wedges) {
                        let pairs = range(&old, from as usize).zip(range(&new, f));
                        wedge.extend(pairs.map(|(x, y)| (a.corner[x], b.corner[y])));
                    }
                }
            }
        }
        let mut next = built.wedges.as_ref().map_or(0, |w| w.len() as u32);
        for &f in &out.faces {
            let corners = range(&old, f as usize);
            out.sizes.push(corners.len() as u32);
            out.corners.extend_from_slice(&input.corners[corners.clone()]);
            if let Some(w) = &input.wedges {
                for &x in &w.corner[corners] {
                    let id = match x {
                        NONE => NONE,
                        x => *wedge.entry(x).or_insert_with(|| {
                            out.present.push(w.present(x));
                            out.rows.extend_from_slice(w.row(x));
                            next += 1;
                            next - 1
                        }),
                    };
                    out.wedges.push(id);
                }
            }
            out.materials.extend(input.face_material.get(f as usize));
            out.groups.extend(input.face_group.get(f as usize));
        }
        out
    }

    /// The input's faces that those of these numbers, without the leftovers, were made of. O(n).
    pub(crate) fn numbers(&self, faces: Vec<u32>) -> Vec<u32> {
        let most = faces.iter().copied().max().map_or(0, |f| f as usize + 1);
        let (mut of, mut own) = (Vec::with_capacity(most), 0);
        for f in 0u32.. {
            if of.len() >= most {
                break;
            }
            let made = if self.faces.get(own) == Some(&f) {
                own += 1;
                self.mended.get(own - 1).copied().unwrap_or(0) as usize
            } else {
                1
            };
            of.extend(std::iter::repeat_n(f, made.min(most - of.len())));
        }
        faces.into_iter().map(|f| of[f as usize]).collect()
    }

    /// True if there is none.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// `built`, which stands at full detail in the order of the input, with these faces in their places; unchanged if they do not fit it, as those of
    /// a damaged file may not.
    pub(crate) fn put_back(&self, built: MeshInput) -> MeshInput {
        if self.is_empty() || !self.fits(&built) {
            return built;
        }
        let mut out = MeshInput { positions: built.positions, wires: built.wires, ..Default::default() };
        let mut sizes = Vec::new();
        let mut wedges = built.wedges.as_ref().map(|w| with_rows(w, &self.rows, &self.present));
        let (mut own, mut own_corner, mut face, mut corner) = (0, 0, 0, 0);
        let count = built.face_sizes.as_ref().map_or(built.corners.len() / 3, Vec::len);
        let size = |f: usize| built.face_sizes.as_ref().map_or(3, |s| s[f] as usize);
        for f in 0.. {
            if self.faces.get(own) == Some(&f) {
                let range = own_corner..own_corner + self.sizes[own] as usize;
                own_corner = range.end;
                sizes.push(self.sizes[own]);
                out.corners.extend_from_slice(&self.corners[range.clone()]);
                if let Some(w) = &mut wedges {
                    w.corner.extend_from_slice(&self.wedges[range]);
                }
                out.face_material.extend(self.materials.get(own));
                out.face_group.extend(self.groups.get(own));
                // What building made of it.
                for _ in 0..self.mended[own] {
                    corner += size(face);
                    face += 1;
                }
                own += 1;
            } else if face < count {
                let range = corner..corner + size(face);
                corner = range.end;
                sizes.push(range.len() as u32);
                out.corners.extend_from_slice(&built.corners[range.clone()]);
                if let (Some(w), Some(from)) = (&mut wedges, &built.wedges) {
                    w.corner.extend_from_slice(&from.corner[range]);
                }
                out.face_material.extend(built.face_material.get(face));
                out.face_group.extend(built.face_group.get(face));
                face += 1;
            } else {
                break;
            }
        }
        out.wedges = wedges;
        if sizes.iter().any(|&s| s != 3) {
            out.face_sizes = Some(sizes);
        }
        out
    }

    /// Its arrays go together and with `built`.
    fn fits(&self, built: &MeshInput) -> bool {
        let n = self.faces.len();
        let faces = built.face_sizes.as_ref().map_or(built.corners.len() / 3, Vec::len);
        let corners = self.sizes.iter().try_fold(0usize, |sum, &s| sum.checked_add(s as usize));
        let mended = self.mended.iter().try_fold(0usize, |sum, &s| sum.checked_add(s as usize));
        let of_faces = |own: &[u32], of: &[u32]| own.len() == if of.is_empty() { 0 } else { n };
        let attributes = match &built.wedges {
            Some(w) => {
                let end = w.len() + self.present.len();
                self.wedges.len() == self.corners.len()
                    && self.rows.len() == self.present.len() * w.stride()
                    && self.wedges.iter().all(|&x| x == NONE || (x as usize) < end)
            }
            None => self.wedges.is_empty(),
        };
        self.faces.is_sorted_by(|a, b| a < b)
            && self.faces.last().is_none_or(|&f| (f as usize) < faces + n)
            && self.sizes.len() == n
            && self.mended.len() == n
            && corners == Some(self.corners.len())
            && mended.is_some_and(|m| m <= faces)
            && self.mended_lie_where_they_should(faces)
            && self.corners.iter().all(|&v| (v as usize) < built.positions.len())
            && of_faces(&self.materials, &built.face_material)
            && of_faces(&self.groups, &built.face_group)
            && attributes
    }

    /// No face asks for more of the built faces than are left when its turn comes.
    fn mended_lie_where_they_should(&self, faces: usize) -> bool {
        let mut used = 0;
        self.faces.iter().zip(&self.mended).enumerate().all(|(k, (&f, &m))| {
            // Built faces before it: all input faces before that are not ours, and what was made of ours.
            let before = f as usize - k + used;
            used += m as usize;
            before + m as usize <= faces
        })
    }
}

/// The wedges with further rows, and no corners.
fn with_rows(w: &Wedges, rows: &[f32], present: &[u64]) -> Wedges {
    let mut out = w.clone();
    out.corner = Vec::new();
    let stride = w.stride();
    for (k, &p) in present.iter().enumerate() {
        out.push(&rows[k * stride..(k + 1) * stride], p);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aif::{BuildOptions, Channel, Mesh, Semantic};

    fn check(input: MeshInput) -> Leftover {
        let (mesh, report) = Mesh::build(input.clone(), &BuildOptions::default()).unwrap();
        let built = mesh.to_input();
        let left = Leftover::find(&input, &built, &report);
        let back = left.put_back(built);
        assert_eq!((&back.corners, &back.face_sizes), (&input.corners, &input.face_sizes));
        assert_eq!((&back.face_material, &back.face_group), (&input.face_material, &input.face_group));
        if let (Some(a), Some(b)) = (&back.wedges, &input.wedges) {
            for (&x, &y) in a.corner.iter().zip(&b.corner) {
                assert!(x == y || (a.row(x), a.present(x)) == (b.row(y), b.present(y)));
            }
        }
        left
    }

    fn points(n: usize) -> Vec<[f32; 3]> {
        (0..n).map(|i| [i as f32, (i * i) as f32, 0.5 * i as f32]).collect()
    }

    #[test]
    fn faces_without_area_come_back_where_they_were() {
        let mut w = Wedges::new(vec![Channel::new(Semantic::TexCoord(0), 2)]).unwrap();
        for i in 0..6 {
            w.push(&[i as f32, 0.0], 1);
        }
        w.corner = vec![0, 1, 5, 0, 1, 2, 3, 4, 4, 2, 1, 3, 5, 5, NONE];
        let left = check(MeshInput {
            positions: points(4).into(),
            corners: vec![0, 0, 1, 0, 1, 2, 3, 3, 3, 2, 1, 3, 1, 1, 1],
            face_material: vec![1, 2, 3, 4, 5],
            wedges: Some(w),
            ..Default::default()
        });
        assert_eq!((left.faces, left.present.len()), (vec![0, 2, 4], 2));
    }

    #[test]
    fn polygons_that_were_mended_come_back_as_they_were() {
        let left = check(MeshInput {
            positions: points(8).into(),
            face_sizes: Some(vec![4, 3, 6, 2, 4]),
            corners: vec![0, 1, 1, 2, 0, 2, 3, 3, 4, 5, 3, 6, 7, 0, 1, 4, 5, 6, 7],
            face_group: vec![0, 1, 0, 1, 0],
            ..Default::default()
        });
        assert_eq!((left.faces, left.mended), (vec![0, 2, 3], vec![1, 2, 0]));
    }

    #[test]
    fn what_does_not_fit_is_not_put_back() {
        let built = MeshInput { positions: points(3).into(), corners: vec![0, 1, 2], ..Default::default() };
        let good = Leftover {
            faces: vec![1],
            sizes: vec![3],
            mended: vec![0],
            corners: vec![0, 0, 1],
            ..Default::default()
        };
        assert_eq!(good.put_back(built.clone()).corners.len(), 6);
        for bad in [
            Leftover { faces: vec![7], ..good.clone() },
            Leftover { corners: vec![0, 0, 9], ..good.clone() },
            Leftover { sizes: vec![u32::MAX], ..good.clone() },
            Leftover { mended: vec![2], ..good.clone() },
            Leftover { mended: vec![1], ..good.clone() },
            Leftover { materials: vec![1], ..good.clone() },
            Leftover { wedges: vec![1, 1, 1], ..good.clone() },
        ] {
            assert_eq!(bad.put_back(built.clone()).corners.len(), 3, "{bad:?}");
        }
    }
}
