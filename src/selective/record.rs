//! A flight as a player needs it: places once, and of every frame what changed in the buffers.
//!
//! A recording is a list of blocks, each compressed by itself (zlib): a JSON header; for each tolerance a *track*; for each mesh its *places*, all places a vertex
//! was ever drawn at, three f32 about the mesh's origin, as twelve planes of bytes. A track is a run of frames, and a frame has for each mesh, as LEB128
//! numbers:
//!
//! - the slots of the index buffer;
//! - how many slots changed; of each how many unchanged ones come before it, and three corners, each as its zigzag difference from the corner before, from 0 on;
//! - how many vertices are at another place; of each its number less the one before, less one, and its place as a zigzag difference from the place before, from 0 on.
//!
//! A slot without a face has three equal corners. Vertices and places are numbered in the order in which they come up, over all tracks.

use super::Recordable;
#[cfg(doc)]
use super::{PagedScene, SelectiveScene};
use crate::refine::view::{Camera, Projection};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::DVec3;
use rustc_hash::FxHashMap;
use serde_json::{Value, json};
use std::io::Write;
use std::ops::Range;

/// Not yet numbered.
const NONE: u32 = u32::MAX;
/// Bytes that a place takes, about: its twelve hardly compress.
const PLACE: usize = 9;

/// Why there is no recording.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// It takes more than the limit.
    #[error(
        "the recording takes more than {limit} bytes: that is reached in frame {frame} at a tolerance of {tau} pixels"
    )]
    TooLarge {
        /// Bytes allowed.
        limit: usize,
        /// The frame, of those recorded.
        frame: usize,
        /// The tolerance of its track.
        tau: f64,
    },
    /// There is more than 32-bit numbers can count.
    #[error("the recording has more places than can be counted")]
    Count,
    /// Compressing failed.
    #[error("the recording could not be compressed")]
    Compress,
}

/// What is told about a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameCounts {
    /// Splits applied since the frame before.
    pub splits: usize,
    /// Splits undone.
    pub collapses: usize,
    /// The frame's tolerance, pixels.
    pub tau: f64,
}

/// A recording that is done: blocks of bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recording {
    pub(super) blocks: Vec<Vec<u8>>,
}

impl Recording {
    /// The number of blocks and the length of each (u32, little endian), then the blocks.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = (self.blocks.len() as u32).to_le_bytes().to_vec();
        self.blocks.iter().for_each(|b| out.extend((b.len() as u32).to_le_bytes()));
        self.blocks.iter().for_each(|b| out.extend(b));
        out
    }
}

/// Makes a [`Recording`]. For every tolerance: [`Recorder::begin`], then for every frame [`Recorder::note`], and [`Recorder::frame`] where it is to be recorded.
#[derive(Debug)]
pub struct Recorder {
    limit: usize,
    tables: Vec<Table>,
    header: Value,
    tracks: Vec<Value>,
    done: Vec<Vec<u8>>,
    track: Option<Track>,
}

/// The numbers of a mesh's vertices and places.
#[derive(Debug)]
struct Table {
    origin: DVec3,
    number: FxHashMap<u32, u32>,
    place: FxHashMap<[u32; 3], u32>,
    places: Vec<[f32; 3]>,
}

/// What a player has at the last frame recorded, and what has been noted since.
#[derive(Debug, Default)]
struct Shadow {
    corners: Vec<[u32; 3]>,
    at: Vec<u32>,
    slots: Vec<Range<usize>>,
    vertices: Vec<u32>,
    /// Any vertex may be elsewhere.
    any: bool,
    displaced: Vec<u32>,
}

#[derive(Debug)]
struct Track {
    tau: f64,
    asked: bool,
    encoder: ZlibEncoder<Vec<u8>>,
    shadows: Vec<Shadow>,
    counts: Vec<Value>,
    since: [usize; 2],
}

impl Table {
    fn vertex(&mut self, v: u32) -> u32 {
        let next = self.number.len() as u32;
        *self.number.entry(v).or_insert(next)
    }

    fn place(&mut self, p: DVec3) -> u32 {
        let p = (p - self.origin).as_vec3().to_array();
        let next = self.places.len() as u32;
        let places = &mut self.places;
        *self.place.entry(p.map(f32::to_bits)).or_insert_with(|| {
            places.push(p);
            next
        })
    }
}

impl Recorder {
    /// For a flight of `scene` along `path`, of which every `stride`-th frame will be recorded, in at most `limit` bytes. `name` is what the scene is called.
    pub fn new<R: Recordable>(
        scene: &R,
        path: &[Camera],
        stride: usize,
        limit: usize,
        name: &str,
    ) -> Recorder {
        let table = |m: usize| Table {
            origin: scene.origin(m),
            number: FxHashMap::default(),
            place: FxHashMap::default(),
            places: Vec::new(),
        };
        let cameras: Vec<Value> = path.iter().step_by(stride.max(1)).map(camera).collect();
        let (lo, hi) = scene.bounds().unwrap_or_default();
        let up = path.iter().map(Camera::up).sum::<DVec3>();
        Recorder {
            limit,
            tables: (0..scene.meshes()).map(table).collect(),
            header: json!({
                "name": name,
                "full_faces": scene.full_faces(),
                "bounds": [lo.to_array(), hi.to_array()],
                "up": upward(up).to_array(),
                "stride": stride.max(1),
                "cameras": cameras,
            }),
            tracks: Vec::new(),
            done: Vec::new(),
            track: None,
        }
    }

    /// The next track, flown at this tolerance; `asked`: the one to begin with. Ends the one before.
    pub fn begin(&mut self, tau: f64, asked: bool) -> Result<(), RecordError> {
        self.end()?;
        self.track = Some(Track {
            tau,
            asked,
            encoder: ZlibEncoder::new(Vec::new(), Compression::new(9)),
            shadows: self.tables.iter().map(|_| Shadow::default()).collect(),
            counts: Vec::new(),
            since: [0; 2],
        });
        Ok(())
    }

    /// Takes note of what changed in a frame ([`SelectiveScene::take_changes`], [`PagedScene::take_changes`]), recorded or not.
    pub fn note<R: Recordable>(&mut self, scene: &R, changes: &[R::Changes]) {
        let Some(track) = &mut self.track else { return };
        for (m, (shadow, changes)) in track.shadows.iter_mut().zip(changes).enumerate() {
            shadow.slots.extend(scene.changed_slots(changes).iter().cloned());
            match scene.changed_vertices(m, changes) {
                Some(vertices) => shadow.vertices.extend(vertices),
                None => shadow.any = true,
            }
            shadow.vertices.extend(scene.displaced(m).iter().map(|d| d.0));
        }
    }

    /// Records what `scene` shows. O(what changed since the last frame recorded).
    ///
    /// Errors: the limit is passed.
    pub fn frame<R: Recordable>(&mut self, scene: &R, counts: &FrameCounts) -> Result<(), RecordError> {
        let Some(track) = &mut self.track else { return Ok(()) };
        let mut bytes = Vec::new();
        for (m, (shadow, table)) in track.shadows.iter_mut().zip(&mut self.tables).enumerate() {
            shadow.write(scene, m, table, track.counts.is_empty(), &mut bytes);
        }
        track.encoder.write_all(&bytes).map_err(|_| RecordError::Compress)?;
        let [splits, collapses] = [track.since[0] + counts.splits, track.since[1] + counts.collapses];
        track.since = [0; 2];
        let tau = counts.tau.is_finite().then_some(counts.tau);
        track.counts.push(json!([
            scene.face_count(),
            scene.vertex_count(),
            splits,
            collapses,
            scene.morphing(),
            tau
        ]));
        if self.tables.iter().any(|t| t.places.len() > (NONE / 2) as usize) {
            return Err(RecordError::Count);
        }
        self.check()
    }

    /// A frame that is not recorded: its splits and collapses count with the next that is.
    pub fn skip(&mut self, counts: &FrameCounts) {
        if let Some(t) = &mut self.track {
            t.since = [t.since[0] + counts.splits, t.since[1] + counts.collapses];
        }
    }

    /// Bytes so far, about.
    fn bytes(&self) -> usize {
        let places: usize = self.tables.iter().map(|t| PLACE * t.places.len()).sum();
        let track = self.track.as_ref().map_or(0, |t| t.encoder.get_ref().len());
        places + track + self.done.iter().map(Vec::len).sum::<usize>()
    }

    fn check(&self) -> Result<(), RecordError> {
        let Some(t) = self.track.as_ref().filter(|_| self.bytes() > self.limit) else { return Ok(()) };
        Err(RecordError::TooLarge { limit: self.limit, frame: t.counts.len() - 1, tau: t.tau })
    }

    fn end(&mut self) -> Result<(), RecordError> {
        let Some(t) = self.track.take() else { return Ok(()) };
        self.tracks
            .push(json!({ "tau": t.tau.is_finite().then_some(t.tau), "asked": t.asked, "counts": t.counts }));
        self.done.push(t.encoder.finish().map_err(|_| RecordError::Compress)?);
        Ok(())
    }

    /// The recording.
    ///
    /// Errors: it passes the limit after all.
    pub fn finish<R: Recordable>(mut self, scene: &R) -> Result<Recording, RecordError> {
        let last = self.track.as_ref().map_or((0, 0.0), |t| (t.counts.len().saturating_sub(1), t.tau));
        self.end()?;
        let pack = |bytes: &[u8]| {
            let mut e = ZlibEncoder::new(Vec::new(), Compression::new(9));
            e.write_all(bytes).and_then(|()| e.finish()).map_err(|_| RecordError::Compress)
        };
        let meshes: Vec<Value> = self
            .tables
            .iter()
            .zip(scene.placements())
            .map(|(t, placed)| {
                let placed: Vec<_> = placed.iter().map(|m| m.to_cols_array()).collect();
                json!({
                    "vertices": t.number.len(),
                    "places": t.places.len(),
                    "origin": t.origin.to_array(),
                    "instances": placed,
                })
            })
            .collect();
        // The finest first, whichever was flown first.
        let mut tracks: Vec<(Value, Vec<u8>)> = self.tracks.into_iter().zip(self.done).collect();
        let tau = |t: &Value| t["tau"].as_f64().unwrap_or(f64::INFINITY);
        tracks.sort_by(|a, b| tau(&a.0).total_cmp(&tau(&b.0)));
        let (tracks, done): (Vec<Value>, Vec<Vec<u8>>) = tracks.into_iter().unzip();
        self.header["meshes"] = meshes.into();
        self.header["tracks"] = tracks.into();
        let mut blocks = vec![pack(self.header.to_string().as_bytes())?];
        blocks.extend(done);
        for t in &self.tables {
            let bytes: Vec<[u8; 4]> = t.places.as_flattened().iter().map(|x| x.to_le_bytes()).collect();
            let plane = |k: usize| bytes.iter().skip(k / 4).step_by(3).map(move |b| b[k % 4]);
            blocks.push(pack(&(0..12).flat_map(plane).collect::<Vec<u8>>())?);
        }
        let size: usize = blocks.iter().map(Vec::len).sum();
        if size > self.limit {
            return Err(RecordError::TooLarge { limit: self.limit, frame: last.0, tau: last.1 });
        }
        Ok(Recording { blocks })
    }
}

impl Shadow {
    fn write<R: Recordable>(
        &mut self,
        scene: &R,
        m: usize,
        table: &mut Table,
        first: bool,
        out: &mut Vec<u8>,
    ) {
        let slots = scene.slots(m);
        let mut changed = std::mem::take(&mut self.slots);
        if first {
            changed.clear();
            changed.push(0..slots);
        }
        changed.sort_unstable_by_key(|r| r.start);
        let mut vertices = std::mem::take(&mut self.vertices);
        // Those that are back in their own place.
        vertices.append(&mut self.displaced);
        self.displaced.extend(scene.displaced(m).iter().map(|d| d.0));
        vertices.extend_from_slice(&self.displaced);
        if std::mem::take(&mut self.any) {
            vertices.append(&mut scene.vertices(m));
        }

        number(out, slots as u64);
        self.corners.resize(slots, [0; 3]);
        let (mut faces, mut next, mut count, mut before) = (Vec::new(), 0, 0, 0);
        // The next slot to look at: runs of several frames overlap.
        let mut from = 0;
        for run in changed {
            for slot in run.start.max(from)..run.end.min(slots) {
                let corners = scene.corners(m, slot).unwrap_or([NONE; 3]);
                let own = corners.map(|v| if v == NONE { 0 } else { table.vertex(v) });
                if own == self.corners[slot] && !first {
                    continue;
                }
                vertices.extend(corners.iter().filter(|&&v| v != NONE));
                self.corners[slot] = own;
                number(&mut faces, (slot - next) as u64);
                for c in own {
                    zigzag(&mut faces, i64::from(c) - before);
                    before = i64::from(c);
                }
                (next, count) = (slot + 1, count + 1);
            }
            from = from.max(run.end);
        }
        number(out, count);
        out.append(&mut faces);

        vertices.sort_unstable();
        vertices.dedup();
        let mut moved: Vec<[u32; 2]> = Vec::new();
        for v in vertices {
            // Wedges that are gone again may have no vertex.
            let Some(p) = scene.place(m, v) else { continue };
            let (id, place) = (table.vertex(v), table.place(p));
            self.at.resize(table.number.len().max(self.at.len()), NONE);
            if self.at[id as usize] != place {
                self.at[id as usize] = place;
                moved.push([id, place]);
            }
        }
        moved.sort_unstable();
        number(out, moved.len() as u64);
        let (mut next, mut before) = (0, 0);
        for [id, place] in moved {
            number(out, u64::from(id - next));
            zigzag(out, i64::from(place) - before);
            (next, before) = (id + 1, i64::from(place));
        }
    }
}

/// LEB128.
fn number(out: &mut Vec<u8>, mut x: u64) {
    while x >= 128 {
        out.push(x as u8 | 128);
        x >>= 7;
    }
    out.push(x as u8);
}

fn zigzag(out: &mut Vec<u8>, x: i64) {
    number(out, ((x << 1) ^ (x >> 63)) as u64);
}

/// The axis that is nearest to a direction: of the sum of many cameras' `up`, what is upwards for most.
pub fn upward(sum: DVec3) -> DVec3 {
    let a = sum.abs();
    match sum {
        _ if a.y >= a.x && a.y >= a.z => DVec3::Y * sum.y.signum(),
        _ if a.z >= a.x => DVec3::Z * sum.z.signum(),
        _ => DVec3::X * sum.x.signum(),
    }
}

fn camera(c: &Camera) -> Value {
    let height = match c.projection() {
        // Half of it, at depth 1.
        Projection::Perspective { .. } => 0.5 * f64::from(c.height()) / c.pixel_scale(),
        Projection::Orthographic { ortho_height } => 0.5 * ortho_height,
    };
    json!({
        "eye": c.eye().to_array(),
        "right": c.right().to_array(),
        "up": c.up().to_array(),
        "look": c.look().to_array(),
        "half": height,
        "perspective": c.is_perspective(),
        "size": [c.width(), c.height()],
        "near": c.near(),
        "far": c.far().is_finite().then_some(c.far()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::grid::ReadAt;
    use crate::io::pm::encode_progressive;
    use crate::meshes::{GenerateOptions, generate};
    use crate::pipeline::{Job, build_progressive};
    use crate::progressive::ProgressiveScene;
    use crate::refine::format::EncodeOptions;
    use crate::refine::hierarchy::{Bounds, Options};
    use crate::refine::paged::PagedLimits;
    use crate::refine::selective::Changes;
    use crate::refine::selective::{Cull, Limits};
    use crate::selective::{FlightPath, Geomorph, circle};
    use crate::selective::{PagedChanges, PagedScene, SelectiveScene};
    use std::io::Read;
    use std::sync::Arc;

    fn built(name: &str, faces: usize) -> ProgressiveScene {
        let sample = generate(name, &GenerateOptions::default().with_faces(faces)).unwrap();
        let scene = crate::samples::scene(sample, name);
        build_progressive(scene, &Job::default(), &crate::simplify::Quiet).unwrap().scene
    }

    fn flown(name: &str, faces: usize) -> (SelectiveScene, FlightPath) {
        let scene = SelectiveScene::new(built(name, faces), &Options::default()).unwrap();
        let path = circle(scene.bounds().unwrap(), 14).unwrap();
        (scene, path)
    }

    /// A scene that can be flown through.
    trait Flyable: Recordable {
        fn again(&mut self);
        /// A frame: splits, collapses, changes.
        fn step(&mut self, camera: &Camera, tau: f64) -> (usize, usize, Vec<Self::Changes>);
    }

    impl Flyable for SelectiveScene {
        fn again(&mut self) {
            self.reset();
        }

        fn step(&mut self, camera: &Camera, tau: f64) -> (usize, usize, Vec<Changes>) {
            let done = self.adapt(camera, tau, Cull::All, &Limits::default()).unwrap();
            (done.splits, done.collapses, self.take_changes())
        }
    }

    impl Flyable for PagedScene {
        fn again(&mut self) {
            self.reset().unwrap();
        }

        fn step(&mut self, camera: &Camera, tau: f64) -> (usize, usize, Vec<PagedChanges>) {
            let done = self.adapt(camera, tau, Cull::All, &PagedLimits::default()).unwrap().done;
            (done.splits, done.collapses, self.take_changes())
        }
    }

    fn unpack(bytes: &[u8]) -> Vec<u8> {
        let mut out = Vec::new();
        flate2::read::ZlibDecoder::new(bytes).read_to_end(&mut out).unwrap();
        out
    }

    /// Reads as the head of this file says.
    struct Player<'a> {
        bytes: &'a [u8],
        meshes: Vec<(Vec<[u32; 3]>, Vec<u32>)>,
    }

    impl Player<'_> {
        fn number(&mut self) -> u64 {
            let mut x = 0;
            for shift in (0..).step_by(7) {
                let (&b, rest) = self.bytes.split_first().unwrap();
                self.bytes = rest;
                x |= u64::from(b & 127) << shift;
                if b < 128 {
                    break;
                }
            }
            x
        }

        fn difference(&mut self) -> i64 {
            let x = self.number();
            (x >> 1) as i64 ^ -((x & 1) as i64)
        }

        fn step(&mut self) {
            for m in 0..self.meshes.len() {
                let slots = self.number() as usize;
                self.meshes[m].0.resize(slots, [0; 3]);
                let (mut slot, mut corner) = (0, 0);
                for _ in 0..self.number() {
                    slot += self.number() as usize;
                    for k in 0..3 {
                        corner += self.difference();
                        self.meshes[m].0[slot][k] = corner as u32;
                    }
                    slot += 1;
                }
                let (mut vertex, mut place) = (0, 0);
                for _ in 0..self.number() {
                    vertex += self.number() as usize;
                    place += self.difference();
                    self.meshes[m].1[vertex] = place as u32;
                    vertex += 1;
                }
            }
        }
    }

    type Triangles = Vec<[[u32; 3]; 3]>;

    /// The triangles that a scene shows, places as a recording has them, the least corner first.
    fn shown(scene: &impl Recordable) -> Triangles {
        let mut out = Vec::new();
        for m in 0..scene.meshes() {
            let origin = scene.origin(m);
            let at = |v: u32| {
                let p = scene.place(m, v).unwrap() - origin;
                p.as_vec3().to_array().map(f32::to_bits)
            };
            let faces = (0..scene.slots(m)).filter_map(|s| scene.corners(m, s));
            out.extend(faces.map(|f| turned(f.map(at))));
        }
        out.sort_unstable();
        out
    }

    fn turned(mut t: [[u32; 3]; 3]) -> [[u32; 3]; 3] {
        let least = (0..3).min_by_key(|&k| t[k]).unwrap();
        t.rotate_left(least);
        t
    }

    fn record(
        scene: &mut impl Flyable,
        path: &[Camera],
        stride: usize,
        limit: usize,
    ) -> (Result<Recording, RecordError>, Vec<Vec<Triangles>>) {
        let mut recorder = Recorder::new(scene, path, stride, limit, "test");
        let mut all = Vec::new();
        for tau in [4.0, 1.0] {
            // Recorded in this order, kept in the other.
            scene.again();
            recorder.begin(tau, tau == 1.0).unwrap();
            let mut frames = Vec::new();
            for (k, c) in path.iter().enumerate() {
                let (splits, collapses, changes) = scene.step(c, tau);
                recorder.note(scene, &changes);
                let counts = FrameCounts { splits, collapses, tau };
                if k % stride != 0 {
                    recorder.skip(&counts);
                    continue;
                }
                if let Err(e) = recorder.frame(scene, &counts) {
                    return (Err(e), all);
                }
                frames.push(shown(scene));
            }
            all.push(frames);
        }
        (recorder.finish(scene), all)
    }

    #[test]
    fn what_is_played_is_what_was_shown() {
        let morphs = [None, Some(Geomorph::Time { frames: 3 }), Some(Geomorph::Error { band: 1.5 })];
        for (name, stride, geomorph) in [
            ("scan", 1, morphs[0]),
            ("polygons", 3, morphs[1]),
            ("terrain", 2, morphs[2]),
            ("cad", 1, morphs[1]),
        ] {
            let (mut scene, path) = flown(name, 1500);
            scene.set_geomorph(geomorph);
            plays(name, &mut scene, &path, stride, geomorph.is_none());
        }
    }

    #[test]
    fn what_is_shown_out_of_core_is_played_as_well() {
        for (name, geomorph) in [("scan", Some(Geomorph::Time { frames: 3 })), ("cad", None)] {
            let mut scene = built(name, 1500);
            let path = circle(
                SelectiveScene::new(scene.clone(), &Options::CUTS.with_rounds(0)).unwrap().bounds().unwrap(),
                14,
            )
            .unwrap();
            for m in &mut scene.meshes {
                m.bounds = Some(Bounds::measure(m, &Options::CUTS.with_rounds(0)).unwrap().into());
            }
            let options =
                EncodeOptions::default().with_any_order(true).with_pages(true).with_chunk(Some(128));
            let bytes: Arc<dyn ReadAt> = Arc::new(encode_progressive(&scene, &options).unwrap());
            let mut scene = PagedScene::new(bytes, 1 << 28).unwrap();
            scene.set_geomorph(geomorph).unwrap();
            plays(name, &mut scene, &path, 2, false);
        }
    }

    /// What is recorded of two flights is what was shown. `coherent`: and takes far less than all of it.
    fn plays(name: &str, scene: &mut impl Flyable, path: &[Camera], stride: usize, coherent: bool) {
        let (recording, frames) = record(scene, path, stride, 1 << 30);
        let blocks: Vec<Vec<u8>> = recording.unwrap().blocks.iter().map(|b| unpack(b)).collect();
        let header: Value = serde_json::from_slice(&blocks[0]).unwrap();
        assert_eq!(blocks.len(), 1 + 2 + scene.meshes());
        let n = |v: &Value| v.as_u64().unwrap() as usize;
        let places: Vec<Vec<[u32; 3]>> = header["meshes"]
            .as_array()
            .unwrap()
            .iter()
            .zip(&blocks[3..])
            .map(|(m, b)| {
                let count = n(&m["places"]);
                assert_eq!(b.len(), 12 * count);
                let part = |i: usize, axis: usize| {
                    u32::from_le_bytes([0, 1, 2, 3].map(|k| b[(4 * axis + k) * count + i]))
                };
                (0..count).map(|i| [0, 1, 2].map(|axis| part(i, axis))).collect()
            })
            .collect();
        let mut bytes = 0;
        for (t, want) in frames.iter().rev().enumerate() {
            assert_eq!(header["tracks"][t]["tau"], [1.0, 4.0][t]);
            let meshes = header["meshes"].as_array().unwrap();
            let mut player = Player {
                bytes: &blocks[1 + t],
                meshes: meshes.iter().map(|m| (vec![], vec![0; n(&m["vertices"])])).collect(),
            };
            assert_eq!(want.len(), path.len().div_ceil(stride));
            for (k, want) in want.iter().enumerate() {
                player.step();
                let mut have = Vec::new();
                for ((corners, at), places) in player.meshes.iter().zip(&places) {
                    let whole = corners.iter().filter(|c| c[0] != c[1]);
                    have.extend(whole.map(|c| turned(c.map(|v| places[at[v as usize] as usize]))));
                }
                have.sort_unstable();
                assert!(have == *want, "{name}: frame {k} of track {t}");
                assert_eq!(n(&header["tracks"][t]["counts"][k][0]), want.len());
            }
            assert!(player.bytes.is_empty());
            bytes += blocks[1 + t].len();
        }
        // Less than all indices of all frames by far.
        let all: usize = frames.iter().flatten().map(|f| 12 * f.len()).sum();
        assert!(!coherent || bytes * 3 < all, "{name}: {bytes} of {all}");
    }

    #[test]
    fn the_same_bytes_twice_and_a_limit_that_is_kept() {
        let (mut scene, path) = flown("scan", 1500);
        let (first, _) = record(&mut scene, &path, 1, 1 << 30);
        let first = first.unwrap();
        assert_eq!(record(&mut scene, &path, 1, 1 << 30).0.unwrap(), first);
        let size: usize = first.blocks.iter().map(Vec::len).sum();
        for limit in [size / 2, size - 1] {
            let error = record(&mut scene, &path, 1, limit).0.unwrap_err();
            assert!(error.to_string().contains(&format!("{limit} bytes")), "{error}");
        }
        assert_eq!(first.to_bytes().len(), 4 + 4 * first.blocks.len() + size);
    }

    #[test]
    fn numbers_of_all_sizes() {
        let mut out = Vec::new();
        number(&mut out, 300);
        zigzag(&mut out, -1);
        zigzag(&mut out, i64::from(u32::MAX));
        let mut p = Player { bytes: &out, meshes: vec![] };
        assert_eq!((p.number(), p.difference(), p.difference()), (300, -1, i64::from(u32::MAX)));
    }

    #[test]
    fn upwards_is_an_axis() {
        assert_eq!(upward(DVec3::new(0.1, -3.0, 2.0)), DVec3::NEG_Y);
        assert_eq!(upward(DVec3::new(0.1, 0.3, 2.0)), DVec3::Z);
        assert_eq!(upward(DVec3::ZERO), DVec3::Y);
    }
}
