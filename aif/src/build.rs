//! Building a mesh from positions and polygons.
//!
//! Every half-edge (u, v) goes to the bucket of its lower vertex; a bucket has about three edges on a closed triangle
//! mesh, so an edge is found by a short scan. Buckets that are long (the apex of a large fan) are sorted first,
//! which keeps the whole build O(n log n) on any input.

use crate::attributes::Wedges;
use crate::bits::Bits;
use crate::error::BuildError;
use crate::ids::{EdgeId, FaceId, NONE, VertexId};
use crate::mesh::Mesh;
use crate::positions::Positions;
use crate::topology::{COMPLEX, EdgeRecord, EdgeUse, NO_FACE, Span, Star, Topology};
use crate::weld::{Weld, weld};

/// What a mesh is built from: flat arrays, as a file gives them.
#[derive(Clone, Debug, Default)]
pub struct MeshInput {
    /// Position of every vertex.
    pub positions: Positions,
    /// Number of corners of every face; `None` when all are triangles.
    pub face_sizes: Option<Vec<u32>>,
    /// The vertices of all faces, one after the other.
    pub corners: Vec<u32>,
    /// Edges of no face (polylines): two vertices each.
    pub wires: Vec<[u32; 2]>,
    /// Attributes of the corners; `wedges.corner` runs parallel to `corners`.
    pub wedges: Option<Wedges>,
    /// Material of every face; empty for none, [`NONE`] for a face without.
    pub face_material: Vec<u32>,
    /// Group of every face; empty for none, [`NONE`] for a face without.
    pub face_group: Vec<u32>,
    /// Row of every face in a table of the caller's, of whatever else it knows about faces; empty for none, [`NONE`] for a face without. Carried along with faces; nothing depends on it.
    pub face_row: Vec<u32>,
}

impl MeshInput {
    /// Triangles without attributes.
    pub fn triangles(positions: impl Into<Positions>, triangles: &[[u32; 3]]) -> Self {
        MeshInput {
            positions: positions.into(),
            corners: triangles.as_flattened().to_vec(),
            ..Default::default()
        }
    }

    /// Polygons without attributes: the size of every face, and all corners.
    pub fn polygons(positions: impl Into<Positions>, sizes: &[u32], corners: &[u32]) -> Self {
        MeshInput {
            positions: positions.into(),
            face_sizes: Some(sizes.to_vec()),
            corners: corners.to_vec(),
            ..Default::default()
        }
    }

    /// Refuses what [`Mesh::build`] would refuse, naming the element; changes nothing. O(n).
    pub fn validate(&self) -> Result<(), BuildError> {
        validate(self)
    }

    /// Number of faces.
    pub fn face_count(&self) -> usize {
        self.face_sizes.as_ref().map_or(self.corners.len() / 3, Vec::len)
    }
}

/// How to build.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct BuildOptions {
    /// Which vertices are one.
    pub weld: Weld,
}

impl BuildOptions {
    /// The default (no welding), with this rule for welding.
    pub fn with_weld(weld: Weld) -> Self {
        BuildOptions { weld }
    }
}

/// What building changed in the input: nothing is dropped in silence.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct BuildReport {
    /// Faces left out because fewer than three distinct corners remained; input ids, ascending.
    pub dropped_faces: Vec<u32>,
    /// Faces with a vertex twice in a row, of which the repetition was left out; input ids.
    pub shortened_faces: Vec<u32>,
    /// Faces that visit a vertex twice and were split into simple cycles there, those of fewer than three vertices left
    /// out; input ids.
    pub split_faces: Vec<u32>,
    /// Wires left out because both ends are one vertex.
    pub dropped_wires: usize,
    /// Vertices that were welded to an earlier one.
    pub welded_vertices: usize,
    /// Input vertex -> vertex of the mesh; `None` when they are the same.
    pub vertex_map: Option<Vec<u32>>,
    /// Face of the mesh -> face of the input; `None` when they are the same.
    pub face_map: Option<Vec<u32>>,
}

impl Mesh {
    /// Builds a mesh from positions and triangles, without welding.
    ///
    /// Errors: an index out of range, a coordinate that is not finite, more elements than ids. O(n log n).
    pub fn from_triangles(
        positions: impl Into<Positions>,
        triangles: &[[u32; 3]],
    ) -> Result<Mesh, BuildError> {
        Mesh::build(MeshInput::triangles(positions, triangles), &BuildOptions::default()).map(|b| b.0)
    }

    /// Builds a mesh from positions and polygons (the size of every face, then all corners), without welding.
    pub fn from_polygons(
        positions: impl Into<Positions>,
        sizes: &[u32],
        corners: &[u32],
    ) -> Result<Mesh, BuildError> {
        Mesh::build(MeshInput::polygons(positions, sizes, corners), &BuildOptions::default()).map(|b| b.0)
    }

    /// Builds a mesh.
    ///
    /// Faces keep their order and their first corner. A face that is no simple cycle of three or more vertices is cleaned as the
    /// report says. Errors: an index out of range, a coordinate that is not finite, arrays of unequal length, more elements than
    /// ids (2^31 edges). O(n log n).
    pub fn build(mut input: MeshInput, options: &BuildOptions) -> Result<(Mesh, BuildReport), BuildError> {
        validate(&input)?;
        let mut report = BuildReport::default();
        if let Some(welded) = weld(&input.positions, options.weld) {
            report.welded_vertices = input.positions.len() - welded.kept.len();
            input.positions = input.positions.gather(&welded.kept);
            for v in input.corners.iter_mut().chain(input.wires.as_flattened_mut()) {
                *v = welded.map[*v as usize];
            }
            report.vertex_map = Some(welded.map);
        }
        clean_faces(&mut input, &mut report);
        let wires = input.wires.len();
        input.wires.retain(|w| w[0] != w[1]);
        report.dropped_wires = wires - input.wires.len();

        Ok((assemble(input)?, report))
    }
}

/// The mesh of an input that is valid and clean: indices in range, faces simple cycles, wires of two vertices.
pub(crate) fn assemble(input: MeshInput) -> Result<Mesh, BuildError> {
    let sizes = input.face_sizes.filter(|s| s.iter().any(|&n| n != 3));
    let topology = build_topology(input.positions.len(), sizes.as_deref(), &input.corners, &input.wires)?;
    Ok(Mesh {
        topology,
        positions: input.positions,
        wedges: input.wedges,
        face_material: input.face_material,
        face_group: input.face_group,
        face_row: input.face_row,
    })
}

/// Refuses what no mesh can be built from, naming the element.
fn validate(input: &MeshInput) -> Result<(), BuildError> {
    let vertices = input.positions.len();
    if vertices >= NONE as usize || input.corners.len() + input.wires.len() >= (NONE >> 1) as usize {
        return Err(BuildError::TooLarge { vertices, corners: input.corners.len() });
    }
    let bad = match &input.positions {
        Positions::F32(p) => p.iter().position(|p| !p.iter().all(|x| x.is_finite())),
        Positions::F64(p) => p.iter().position(|p| !p.iter().all(|x| x.is_finite())),
    };
    if let Some(vertex) = bad {
        let p = input.positions.get(vertex);
        let axis = (0..3).find(|&k| !p[k].is_finite()).unwrap_or(0);
        return Err(BuildError::NotFinite { vertex, axis: b"xyz"[axis] as char, value: p[axis] });
    }
    let faces = match &input.face_sizes {
        None if !input.corners.len().is_multiple_of(3) => {
            return Err(BuildError::NotTriangles { corners: input.corners.len() });
        }
        None => input.corners.len() / 3,
        Some(s) => {
            let sum: u64 = s.iter().map(|&n| n as u64).sum();
            if sum != input.corners.len() as u64 {
                return Err(BuildError::Sizes { sum, corners: input.corners.len() });
            }
            s.len()
        }
    };
    if input.corners.iter().any(|&v| v as usize >= vertices) {
        let mut c = 0;
        for face in 0..faces {
            let n = input.face_sizes.as_ref().map_or(3, |s| s[face] as usize);
            for corner in 0..n {
                let index = input.corners[c + corner];
                if index as usize >= vertices {
                    return Err(BuildError::IndexOutOfRange { face, corner, index, vertices });
                }
            }
            c += n;
        }
    }
    if let Some((wire, w)) =
        input.wires.iter().enumerate().find(|(_, w)| w.iter().any(|&v| v as usize >= vertices))
    {
        let index = w[0].max(w[1]);
        return Err(BuildError::WireOutOfRange { wire, index, vertices });
    }
    let parallel = [
        ("face_material", input.face_material.len(), faces),
        ("face_group", input.face_group.len(), faces),
        ("face_row", input.face_row.len(), faces),
        ("wedges.corner", input.wedges.as_ref().map_or(0, |w| w.corner.len()), input.corners.len()),
    ];
    for (name, len, want) in parallel {
        if len != 0 && len != want {
            return Err(BuildError::Length { name, len, want });
        }
    }
    if let Some(w) = &input.wedges {
        if w.corner.len() != input.corners.len() {
            return Err(BuildError::Length {
                name: "wedges.corner",
                len: w.corner.len(),
                want: input.corners.len(),
            });
        }
        if let Some(corner) = w.corner.iter().position(|&x| x != NONE && x as usize >= w.len()) {
            return Err(BuildError::WedgeOutOfRange { corner, index: w.corner[corner], wedges: w.len() });
        }
    }
    Ok(())
}

/// Makes every face a simple cycle of at least three vertices, reporting each that was not.
fn clean_faces(input: &mut MeshInput, report: &mut BuildReport) {
    let faces = input.face_count();
    let mut sorted = Vec::new();
    let clean = match &input.face_sizes {
        None => input.corners.as_chunks::<3>().0.iter().all(|t| is_simple(t, &mut sorted)),
        Some(s) => {
            let mut rest = &input.corners[..];
            s.iter().all(|&n| {
                let (face, after) = rest.split_at(n as usize);
                rest = after;
                is_simple(face, &mut sorted)
            })
        }
    };
    if clean {
        return;
    }
    let sizes = input.face_sizes.take();
    let old = std::mem::take(&mut input.corners);
    let old_wedge = input.wedges.as_mut().map(|w| std::mem::take(&mut w.corner));
    let mut new_sizes = Vec::with_capacity(faces);
    let mut wedge = Vec::new();
    let mut map = Vec::with_capacity(faces);
    let mut start = 0;
    let mut cycle: Vec<usize> = Vec::new();
    for face in 0..faces {
        let n = sizes.as_ref().map_or(3, |s| s[face] as usize);
        let slots = start..start + n;
        start += n;
        if is_simple(&old[slots.clone()], &mut sorted) {
            new_sizes.push(n as u32);
            map.push(face as u32);
            input.corners.extend_from_slice(&old[slots.clone()]);
            if let Some(w) = &old_wedge {
                wedge.extend_from_slice(&w[slots]);
            }
            continue;
        }
        // Drop what repeats the corner before it.
        let mut kept: Vec<usize> = Vec::with_capacity(n);
        for c in slots {
            if kept.last().is_none_or(|&l| old[l] != old[c]) {
                kept.push(c);
            }
        }
        while kept.len() > 1 && old[kept[0]] == old[*kept.last().unwrap_or(&0)] {
            kept.pop();
        }
        let shortened = kept.len() < n;
        // Cut a simple cycle off wherever a vertex comes again.
        let mut simple: Vec<Vec<usize>> = Vec::new();
        cycle.clear();
        // Where a vertex stands in `cycle`; a map, since a face may have a million corners.
        let mut at = std::collections::BTreeMap::new();
        for c in kept {
            if let Some(&first) = at.get(&old[c]) {
                let cut: Vec<usize> = cycle.drain(first..).collect();
                for &x in &cut {
                    at.remove(&old[x]);
                }
                simple.push(cut);
            }
            at.insert(old[c], cycle.len());
            cycle.push(c);
        }
        simple.push(std::mem::take(&mut cycle));
        let was_split = simple.len() > 1;
        simple.retain(|s| s.len() >= 3);
        match (simple.is_empty(), was_split, shortened) {
            (true, _, _) => report.dropped_faces.push(face as u32),
            (_, true, _) => report.split_faces.push(face as u32),
            (_, _, true) => report.shortened_faces.push(face as u32),
            _ => {}
        }
        for s in simple {
            new_sizes.push(s.len() as u32);
            map.push(face as u32);
            input.corners.extend(s.iter().map(|&c| old[c]));
            if let Some(w) = &old_wedge {
                wedge.extend(s.iter().map(|&c| w[c]));
            }
        }
    }
    if let Some(w) = &mut input.wedges {
        w.corner = wedge;
    }
    for per_face in [&mut input.face_material, &mut input.face_group, &mut input.face_row] {
        if !per_face.is_empty() {
            *per_face = map.iter().map(|&f| per_face[f as usize]).collect();
        }
    }
    input.face_sizes = Some(new_sizes);
    report.face_map = Some(map);
}

/// True if a face has at least three vertices, none of them twice. `sorted` is scratch.
fn is_simple(face: &[u32], sorted: &mut Vec<u32>) -> bool {
    match *face {
        [] | [_] | [_, _] => false,
        [x, y, z] => x != y && y != z && z != x,
        [x, y, z, w] => x != y && x != z && x != w && y != z && y != w && z != w,
        _ => {
            sorted.clear();
            sorted.extend_from_slice(face);
            sorted.sort_unstable();
            sorted.windows(2).all(|w| w[0] != w[1])
        }
    }
}

/// Buckets longer than this are sorted instead of scanned.
const LONG_BUCKET: usize = 48;

/// Builds the AIF relations of valid, simple faces.
fn build_topology(
    vertices: usize,
    sizes: Option<&[u32]>,
    corners: &[u32],
    wires: &[[u32; 2]],
) -> Result<Topology, BuildError> {
    let face_spans: Vec<Span> = sizes.map_or(Vec::new(), |s| {
        s.iter()
            .scan(0, |start, &len| {
                let span = Span { start: *start, len };
                *start += len;
                Some(span)
            })
            .collect()
    });
    let mut corner_face: Vec<u32> = Vec::new();
    if sizes.is_some() {
        corner_face.reserve_exact(corners.len());
        for (f, s) in face_spans.iter().enumerate() {
            corner_face.extend(std::iter::repeat_n(f as u32, s.len as usize));
        }
    }

    // Half-edges to the bucket of their lower vertex, as (upper vertex, corner); wires as corners past the end.
    let spans = sizes.map(|_| &face_spans[..]);
    let mut bucket_end = vec![0u32; vertices + 1];
    for_each_half_edge(spans, corners, |u, v, _| bucket_end[u.min(v) as usize] += 1);
    for w in wires {
        bucket_end[w[0].min(w[1]) as usize] += 1;
    }
    let mut sum = 0;
    for b in &mut bucket_end {
        let n = *b;
        *b = sum;
        sum += n;
    }
    let mut bucket = vec![0u64; sum as usize];
    {
        let mut put = |u: u32, v: u32, c: u32| {
            let at = &mut bucket_end[u.min(v) as usize];
            bucket[*at as usize] = (u.max(v) as u64) << 32 | c as u64;
            *at += 1;
        };
        for_each_half_edge(spans, corners, &mut put);
        for (i, w) in wires.iter().enumerate() {
            put(w[0], w[1], (corners.len() + i) as u32);
        }
    }

    // One pass over the buckets makes the edges, in the order of their lower vertex.
    let mut edges: Vec<EdgeRecord> = Vec::with_capacity(sum as usize / 2 + vertices / 4 + 16);
    let mut uses = vec![EdgeUse(0); corners.len()];
    let mut degree = vec![0u32; vertices];
    let mut extra: Vec<(u32, FaceId)> = Vec::new();
    let mut begin = 0usize;
    for lower in 0..vertices {
        let end = bucket_end[lower] as usize;
        let entries = &mut bucket[begin..end];
        begin = end;
        let first = edges.len();
        let long = entries.len() > LONG_BUCKET;
        if long {
            entries.sort_unstable();
        }
        for &mut entry in entries {
            let (upper, corner) = ((entry >> 32) as u32, entry as u32 as usize);
            let scan = if long { edges.len().saturating_sub(1).max(first) } else { first };
            let found = edges[scan..].iter().position(|e| e.vertices[1].0 == upper);
            let e = match found {
                Some(i) => scan + i,
                None => {
                    edges.push(EdgeRecord {
                        vertices: [VertexId(lower as u32), VertexId(upper)],
                        faces: [NO_FACE; 2],
                    });
                    degree[upper as usize] += 1;
                    edges.len() - 1
                }
            };
            if corner >= corners.len() {
                continue;
            }
            let face = FaceId(if sizes.is_some() { corner_face[corner] } else { corner as u32 / 3 });
            uses[corner] = EdgeUse::new(EdgeId(e as u32), corners[corner] == upper);
            let faces = &mut edges[e].faces;
            if faces[0] == NO_FACE {
                faces[0] = face;
            } else if faces[1] == NO_FACE {
                faces[1] = face;
            } else {
                extra.push((e as u32, face));
            }
        }
        degree[lower] += (edges.len() - first) as u32;
    }
    drop(bucket);
    if edges.len() >= (NONE >> 1) as usize {
        return Err(BuildError::TooLarge { vertices, corners: corners.len() });
    }

    // Stars: edges in ascending order at every vertex.
    let mut stars = Vec::with_capacity(vertices);
    let mut start = 0;
    for &n in &degree {
        stars.push(Star { span: Span { start, len: 0 }, capacity: n });
        start += n;
    }
    let mut star_pool = vec![EdgeId(0); start as usize];
    for (e, record) in edges.iter().enumerate() {
        for v in record.vertices {
            let s = &mut stars[v.index()].span;
            star_pool[(s.start + s.len) as usize] = EdgeId(e as u32);
            s.len += 1;
        }
    }

    let (mut complex, mut complex_pool) = (Vec::new(), Vec::new());
    extra.sort_by_key(|&(e, _)| e);
    for run in extra.chunk_by(|a, b| a.0 == b.0) {
        let record = &mut edges[run[0].0 as usize];
        let start = complex_pool.len() as u32;
        complex_pool.extend_from_slice(&record.faces);
        complex_pool.extend(run.iter().map(|r| r.1));
        record.faces = [FaceId(complex.len() as u32), COMPLEX];
        complex.push(Span { start, len: run.len() as u32 + 2 });
    }

    let faces = if sizes.is_some() { face_spans.len() } else { corners.len() / 3 };
    Ok(Topology {
        dead_vertices: Bits::new(vertices),
        dead_edges: Bits::new(edges.len()),
        dead_faces: Bits::new(faces),
        stars,
        star_pool,
        edges,
        corners: uses,
        face_spans,
        complex,
        complex_pool,
    })
}

/// Calls `emit` with both ends and the corner of every half-edge, in order. Compiled for each use: the triangles' loop is the hot one.
#[inline(always)]
fn for_each_half_edge(spans: Option<&[Span]>, corners: &[u32], mut emit: impl FnMut(u32, u32, u32)) {
    let Some(spans) = spans else {
        for (f, &[x, y, z]) in corners.as_chunks::<3>().0.iter().enumerate() {
            let c = 3 * f as u32;
            emit(x, y, c);
            emit(y, z, c + 1);
            emit(z, x, c + 2);
        }
        return;
    };
    for s in spans {
        let face = &corners[s.range()];
        for (i, pair) in face.windows(2).enumerate() {
            emit(pair[0], pair[1], s.start + i as u32);
        }
        if let [first, .., last] = *face {
            emit(last, first, s.start + s.len - 1);
        }
    }
}
