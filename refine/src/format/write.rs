//! Progressive meshes to a file.

use super::base::{self, MeshHead};
use super::bounds;
use super::codec::{self, Sequel, Sources, Start};
use super::container::{Chunk, ChunkType, Directory, EXPANSION};
use super::input_order;
use super::lattice;
use super::pages;
use super::plan::{Layout, Piece, Plan};
use super::splits::{self, Counts};
use crate::hierarchy::{Bounds, Further, Guarantee, Tree};
use crate::progressive::{Damage, ProgressiveMesh, RowsOf};
use std::sync::Arc;

/// How to write.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct EncodeOptions {
    /// Leave the input's numbering out: vertices and faces at full detail come in the order of the file, polygons as triangles.
    pub any_order: bool,
    /// Move all vertices onto a grid of `2^bits` cells along the longest side of each mesh's box; 2..=30. Smaller files, but lossy.
    pub quantize: Option<u32>,
    /// Chunks follow each other: none can be read before all that stand before it. Files are smaller.
    pub sequential: bool,
    /// Beside every chunk, what refining out of core takes ([`crate::paged`]): links of the vertex hierarchy. Only without [`EncodeOptions::sequential`], of meshes with bounds
    /// ([`ProgressiveMesh::bounds`]). Where those are by the ring rule, the splits come by their errors, and what that rule needs goes along.
    pub pages: bool,
    /// Splits of a chunk, at most but for those of a few single vertices and the few that others need; by default 16,384, and 8,192 of chunks that follow each other. With smaller ones less has to be fetched for a region,
    /// and more in all.
    pub chunk: Option<u32>,
    /// Chunks of other kinds, which readers may skip: what they are, of which mesh (`u32::MAX` for none), and what they hold. They stand before all splits; [`ChunkType::EXTRAS`] behind all else.
    pub others: Vec<(ChunkType, u32, Vec<u8>)>,
}

impl EncodeOptions {
    /// Sets [`EncodeOptions::any_order`].
    pub fn with_any_order(mut self, on: bool) -> Self {
        self.any_order = on;
        self
    }

    /// Every chunk can be read alone, which is the default: the opposite of [`EncodeOptions::sequential`].
    pub fn with_alone(mut self, on: bool) -> Self {
        self.sequential = !on;
        self
    }

    /// Sets [`EncodeOptions::sequential`].
    pub fn with_sequential(mut self, on: bool) -> Self {
        self.sequential = on;
        self
    }

    /// Sets [`EncodeOptions::pages`], and takes [`EncodeOptions::sequential`] back.
    pub fn with_pages(mut self, on: bool) -> Self {
        self.pages = on;
        self.sequential &= !on;
        self
    }

    /// Sets [`EncodeOptions::chunk`].
    pub fn with_chunk(mut self, splits: Option<u32>) -> Self {
        self.chunk = splits;
        self
    }

    /// Adds to [`EncodeOptions::others`].
    pub fn with_other(mut self, kind: ChunkType, mesh: u32, bytes: Vec<u8>) -> Self {
        self.others.push((kind, mesh, bytes));
        self
    }

    /// Sets [`EncodeOptions::quantize`].
    pub fn with_quantize(mut self, bits: Option<u32>) -> Self {
        self.quantize = bits;
        self
    }
}

/// Why nothing was written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The arrays of a mesh contradict each other.
    #[error("mesh {mesh}: {damage}")]
    Damage {
        /// Which.
        mesh: usize,
        /// How.
        damage: Damage,
    },
    /// A mesh's parts do not go together in a way that [`Damage`] has no word for.
    #[error("mesh {0}: its arrays contradict each other")]
    Inconsistent(usize),
    /// Pages are wanted of a mesh without bounds.
    #[error("mesh {0}: it has no bounds, which refining out of core takes; measure them first")]
    NoBounds(usize),
    /// Bounds of a mesh whose extent no number holds.
    #[error(
        "mesh {0}: it is larger than double precision can measure, so it has no bounds: scale it down, or leave the bounds out"
    )]
    Extent(usize),
    /// Quantisation by other than 2 to 30 bits.
    #[error("quantising to {0} bits: 2 to 30 are possible")]
    Bits(u32),
}

/// A chunk and its bytes.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) chunk: Chunk,
    pub(super) bytes: Vec<u8>,
    /// Where in the common order of all splits it belongs: the mean of its splits' places.
    turn: f64,
}

pub(super) fn part(kind: ChunkType, critical: bool, mesh: u32, raw: u64, mut bytes: Vec<u8>) -> Part {
    bytes.resize(bytes.len().max(raw.div_ceil(EXPANSION) as usize), 0);
    let chunk = Chunk {
        kind,
        index: 0,
        critical,
        mesh,
        first: 0,
        count: 0,
        first_face: 0,
        band: 0,
        subtree: 0,
        error: 0.0,
        offset: 0,
        stored: bytes.len() as u64,
        raw,
        checksum: crc32fast::hash(&bytes),
    };
    Part { chunk, bytes, turn: 0.0 }
}

/// Writes progressive meshes as a `.pm` file, which FORMAT.md specifies.
///
/// `turns` is the common order of the splits of all meshes, as in [`crate::progressive::BuiltAll::turns`] (empty: mesh after mesh); `scene` is kept as it is. The
/// bounds that meshes carry ([`ProgressiveMesh::bounds`]) are written, widened by what quantising moves. The
/// splits come in another order in the file than in `meshes`, and so have other numbers ([`ProgressiveMesh::reordered`]); errors are rounded up by
/// at most half; all else is kept. The bytes do not depend on the number of threads. O(n log n).
///
/// Errors: damaged meshes, bits out of range.
pub fn encode(
    meshes: &[ProgressiveMesh],
    turns: &[u32],
    scene: &[u8],
    options: &EncodeOptions,
) -> Result<Vec<u8>, EncodeError> {
    if let Some(bits) = options.quantize.filter(|b| !(2..=30).contains(b)) {
        return Err(EncodeError::Bits(bits));
    }
    let mut bases = Vec::with_capacity(meshes.len());
    let mut chunks: Vec<Vec<Part>> = Vec::with_capacity(meshes.len());
    let mut orders = Vec::new();
    for (m, pm) in meshes.iter().enumerate() {
        pm.cursor().map_err(|damage| EncodeError::Damage { mesh: m, damage })?;
        // Those of a hierarchy are left out.
        let (len, want) = (pm.splits.error.len(), pm.splits.len());
        if len != want {
            return Err(EncodeError::Damage {
                mesh: m,
                damage: Damage::Length { what: "errors", len, want },
            });
        }
        if pm.bounds.as_ref().is_some_and(|b| b.len() != pm.splits.len()) {
            return Err(EncodeError::Inconsistent(m));
        }
        if pm.bounds.as_ref().is_some_and(|b| !b.extent().1.is_finite()) {
            return Err(EncodeError::Extent(m));
        }
        if options.pages && !options.sequential && pm.bounds.is_none() {
            return Err(EncodeError::NoBounds(m));
        }
        let places: Vec<u32> =
            turns.iter().zip(0u32..).filter(|(t, _)| **t as usize == m).map(|(_, k)| k).collect();
        let parts = encode_mesh(m as u32, pm, &places, options).ok_or(EncodeError::Inconsistent(m))?;
        bases.push(parts.base);
        bases.extend(parts.page);
        chunks.push(parts.splits);
        orders.extend(parts.order);
    }
    let mut all = bases;
    if !scene.is_empty() {
        all.push(part(ChunkType::SCENE, false, u32::MAX, scene.len() as u64, scene.to_vec()));
    }
    let others = options
        .others
        .iter()
        .map(|(kind, m, bytes)| part(*kind, false, *m, bytes.len() as u64, bytes.clone()));
    let (extras, others): (Vec<Part>, Vec<Part>) = others.partition(|p| p.chunk.kind == ChunkType::EXTRAS);
    // They may tell what to do with the splits; extras are for the end.
    all.extend(others);
    all.extend(interleave(chunks));
    all.extend(orders);
    all.extend(extras);
    let mut directory =
        Directory { meshes: meshes.len() as u32, chunks: all.iter().map(|p| p.chunk).collect() };
    let mut out = directory.write();
    out.reserve_exact(all.iter().map(|p| p.bytes.len()).sum());
    all.iter().for_each(|p| out.extend_from_slice(&p.bytes));
    Ok(out)
}

/// The chunks of all meshes, each mesh's in its order, by where they belong in the common order.
fn interleave(meshes: Vec<Vec<Part>>) -> Vec<Part> {
    let mut keyed = Vec::new();
    for (m, parts) in meshes.into_iter().enumerate() {
        let mut latest = f64::NEG_INFINITY;
        for p in parts {
            latest = latest.max(p.turn);
            keyed.push((latest, m, p));
        }
    }
    keyed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    keyed.into_iter().map(|(_, _, p)| p).collect()
}

struct MeshParts {
    base: Part,
    /// What stands behind it.
    page: Option<Part>,
    splits: Vec<Part>,
    order: Option<Part>,
}

fn encode_mesh(
    m: u32,
    source: &ProgressiveMesh,
    turns: &[u32],
    options: &EncodeOptions,
) -> Option<MeshParts> {
    let (mut lattices, mut quantisation_error, mut flat_faces) = (Vec::new(), 0.0, 0);
    let mut quantised = None;
    if let Some(bits) = options.quantize.filter(|_| source.base_vertices() > 0) {
        let pm = quantised.insert(source.clone());
        let (grid, error) = lattice::quantise(pm, bits)?;
        lattices.push(grid);
        (quantisation_error, flat_faces) = (error, lattice::flat_faces(pm)?);
    }
    let source = quantised.as_ref().unwrap_or(source);
    let layout =
        if options.sequential { Layout::sequential(options.chunk) } else { Layout::alone(options.chunk) };
    let ordered = source.order.is_some() && !options.any_order;
    let settled = source.bounds.as_deref().filter(|b| options.pages && b.guarantee() == Guarantee::Settled);
    let further = match settled.filter(|_| !options.sequential) {
        Some(bounds) => Some(Further::new(source, bounds).ok()?),
        None => None,
    };
    let layout = if ordered { layout.before_order() } else { layout };
    let on = source.dependencies();
    let plan = Plan::new(source, &on, layout, further.as_ref())?;
    let further = further.map(|f| f.reordered(&plan.order));
    let mut pm = source.reordered_given(&plan.order, &on).ok()?;
    drop(on);
    if options.any_order {
        input_order::sort_base(&mut pm);
    }
    let tips = input_order::tips(&pm);
    input_order::turn(&mut pm, &tips, true);
    if lattices.is_empty() {
        lattices = lattice::find(&pm);
    }
    let head = MeshHead {
        splits: pm.splits.len() as u32,
        base_vertices: pm.base_vertices() as u32,
        base_faces: pm.base_faces.len() as u32,
        base_wedges: pm.wedges.as_ref().map_or(pm.base_vertices(), |w| w.base_vertex.len()) as u32,
        wires: pm.wires.len() as u32,
        double: pm.base_positions.is_f64(),
        channels: pm.wedges.as_ref().map(|w| w.channels.clone()),
        materials: !pm.face_material.is_empty(),
        groups: !pm.face_group.is_empty(),
        lattices,
        levels: plan.levels.clone(),
        single: pm.splits.code.iter().zip(0..).filter(|(c, _)| !c.two_faces()).map(|(_, i)| i).collect(),
        quantisation_error,
        flat_faces,
        start: Start::new(&pm)?,
    };
    let mut base = part(ChunkType::BASE, true, m, base::raw_bytes(&head), base::write(&head, &mut pm)?);
    base.chunk.count = head.base_vertices;
    let bounds = match &pm.bounds {
        Some(b) if quantisation_error > 0.0 => Some(Arc::new(b.after_moving(&pm, quantisation_error).ok()?)),
        b => b.clone(),
    };
    let starts = starts(&pm, &pm.rows_of_splits(), &plan.pieces);
    let pack = |piece: &Piece, ends: &[Counts], kind: ChunkType, bytes: Vec<u8>| {
        let (first, end) = (ends[0], ends[1]);
        let mut p = part(kind, true, m, raw_bytes(&head, first, end), bytes);
        let range = first.split..end.split;
        p.chunk.first = first.split as u32;
        p.chunk.count = piece.count as u32;
        p.chunk.first_face = first.face as u32;
        (p.chunk.band, p.chunk.subtree) = (piece.band, piece.subtree);
        p.chunk.error =
            pm.splits.error[range.clone()].iter().map(|&e| splits::rounded_error(e)).fold(0.0, f32::max);
        let sum: f64 =
            plan.order[range].iter().map(|&i| turns.get(i as usize).map_or(0.0, |&t| t as f64)).sum();
        p.turn = sum / piece.count.max(1) as f64;
        p
    };
    let jobs = plan.pieces.iter().zip(starts.windows(2));
    let mut streams = codec::Streams::default();
    let splits: Option<Vec<Part>> = if options.sequential {
        let mut state = Sequel::new(&head, head.start.take()?);
        let one = |(piece, ends): (&Piece, &[Counts])| {
            let bytes = codec::write(&head, &pm, &mut state, (ends[0], piece.count), None, &mut streams)?;
            Some(pack(piece, ends, ChunkType::SEQUEL, bytes))
        };
        jobs.map(one).collect()
    } else {
        let on = pm.dependencies();
        let firsts: Vec<u32> = starts.iter().map(|c| c.split as u32).collect();
        let last = last_places(&pm);
        let mut sources = Sources::new(&head, &on, &firsts, &last);
        let one = |(piece, ends): (&Piece, &[Counts])| {
            let mut state = Sequel::new(&head, head.start.take()?);
            sources.find(ends[0].split..ends[1].split);
            let at = (ends[0], piece.count);
            let bytes = codec::write(&head, &pm, &mut state, at, Some(&mut sources), &mut streams)?;
            head.start.give(state);
            Some(pack(piece, ends, ChunkType::SPLITS, bytes))
        };
        jobs.map(one).collect()
    };
    let order = match &pm.order {
        Some(order) if !options.any_order => {
            let raw = input_order::raw_bytes(order, tips.len());
            let bytes = input_order::write(&pm, tips, order)?;
            Some(part(ChunkType::ORDER, false, m, raw, bytes))
        }
        _ => None,
    };
    let paged = bounds.as_ref().filter(|_| options.pages && !options.sequential);
    let paged = paged.map(|b| (b, Tree::new(&pm)));
    let page = match &paged {
        Some((bounds, tree)) => {
            let links = pages::Whole { tree, bounds, further: further.as_ref() };
            let (bytes, raw) = pages::write_base(&head, bounds.extent(), further.is_some(), &links)?;
            let mut page = part(ChunkType::PAGE, false, m, raw, bytes);
            (page.chunk.count, page.chunk.first_face) = (head.base_vertices, head.base_wedges);
            Some(page)
        }
        None => None,
    };
    let mut all = Vec::with_capacity(3 * plan.pieces.len());
    for (p, at) in splits?.into_iter().zip(&starts) {
        let beside = match &bounds {
            Some(bounds) => Some(bounds_of(&p, bounds)?),
            None => None,
        };
        let page = match &paged {
            Some((bounds, tree)) => {
                let Chunk { first, count, band, subtree, error, .. } = p.chunk;
                let vertices = &pm.splits.vertex[at.split..at.split + count as usize];
                let own = pages::Own::within(bounds, at.split..at.split + count as usize)?;
                let links = pages::Whole { tree, bounds, further: further.as_ref() };
                let (bytes, raw) = pages::write(&head, first, vertices, own, &links)?;
                let mut page = part(ChunkType::PAGE, false, m, raw, bytes);
                page.chunk = Chunk { first, count, band, subtree, error, ..page.chunk };
                page.chunk.first_face = at.wedge as u32;
                page.turn = p.turn;
                Some(page)
            }
            None => None,
        };
        all.push(p);
        all.extend(beside);
        all.extend(page);
    }
    Some(MeshParts { base, page, splits: all, order })
}

/// The bounds of a chunk of splits, to stand behind it.
fn bounds_of(splits: &Part, bounds: &Bounds) -> Option<Part> {
    let (first, count) = (splits.chunk.first as usize, splits.chunk.count as usize);
    bounds_beside(splits, bounds, first..first + count)
}

/// The same of those in a range.
pub(super) fn bounds_beside(splits: &Part, bounds: &Bounds, range: std::ops::Range<usize>) -> Option<Part> {
    let bytes = bounds::write(bounds, range.clone())?;
    let mut p = part(
        ChunkType::BOUNDS,
        false,
        splits.chunk.mesh,
        bounds::raw_bytes(bounds.guarantee(), bounds.is_directed(), range.len()),
        bytes,
    );
    p.turn = splits.turn;
    let Chunk { first, count, band, subtree, .. } = splits.chunk;
    p.chunk = Chunk { first, count, band, subtree, ..p.chunk };
    p.chunk.error = range.map(|i| bounds.error(i) as f32).fold(0.0, f32::max);
    Some(p)
}

/// Where the vertices that splits make are at full detail.
fn last_places(pm: &ProgressiveMesh) -> Vec<[f64; 3]> {
    let mut places: Vec<_> = (0..pm.splits.len()).map(|i| pm.new_positions.get(i).to_array()).collect();
    let moving = pm.splits.code.iter().zip(&pm.splits.vertex).filter(|(c, _)| c.moves());
    for ((_, &v), k) in moving.zip(0..) {
        if let Some(p) = (v as usize).checked_sub(pm.base_vertices()).and_then(|i| places.get_mut(i)) {
            *p = pm.moved_positions.get(k).to_array();
        }
    }
    places
}

/// Where the arrays stand at the start of every piece, and at the end.
fn starts(pm: &ProgressiveMesh, rows: &[RowsOf], pieces: &[Piece]) -> Vec<Counts> {
    let base_wedges = pm.wedges.as_ref().map_or(pm.base_vertices(), |w| w.base_vertex.len());
    let mut at =
        Counts { face: pm.base_faces.len(), wedge: base_wedges, row: base_wedges, ..Default::default() };
    let mut all = vec![at];
    for p in pieces {
        let range = at.split..at.split + p.count;
        for (code, r) in pm.splits.code[range.clone()].iter().zip(&rows[range]) {
            at.face += 1 + code.two_faces() as usize;
            at.moved += code.moves() as usize;
            if pm.wedges.is_some() {
                at.wedge += r.new as usize;
                at.row += (r.new + r.changed) as usize;
                at.explicit = r.explicit.end;
            }
        }
        at.split += p.count;
        all.push(at);
    }
    all
}

/// What [`splits::SplitBlock::bytes`] says of these splits.
pub(super) fn raw_bytes(head: &MeshHead, a: Counts, b: Counts) -> u64 {
    let splits = (b.split - a.split) as u64;
    let point = if head.double { 24 } else { 12 };
    let rows = if head.channels.is_some() { (b.row - a.row) as u64 } else { 0 };
    splits * (18 + point)
        + (b.moved - a.moved) as u64 * point
        + rows * (8 + 4 * head.stride() as u64)
        + 4 * (b.explicit - a.explicit) as u64
        + 4 * (b.face - a.face) as u64 * (head.materials as u64 + head.groups as u64)
}
