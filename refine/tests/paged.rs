//! View-dependent refinement out of core: the same meshes as in memory, within a limit, from few bytes.

mod common;

use common::{NAMES, Random, assert_same, options, sample};
use glam::{DMat4, DVec3};
use progmesh_refine::aif::{BuildOptions, Mesh, MeshInput, NONE, Positions};
use progmesh_refine::format::{
    ByteRanges, ChunkType, EncodeError, EncodeOptions, FormatError, RangeReader, decode, encode,
};
use progmesh_refine::hierarchy::{self, Bounds, Guarantee, Hierarchy, Rule};
use progmesh_refine::paged::{PagedError, PagedLimits, PagedView};
use progmesh_refine::progressive::build;
use progmesh_refine::selective::{Cull, Done, Lens, Limits, TimedMorph, View};
use progmesh_refine::simplify::measure::Surface;
use progmesh_refine::simplify::{Method, Placement, Quiet};
use progmesh_refine::view::{Camera, CameraParameters, Projection};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Pixels, by frame: finest where a part is seen.
const TAU: [f64; 3] = [1.0, 6.0, 12.0];
const PLENTY: usize = 1 << 30;

/// A file with pages by the ring rule.
fn file(name: &str, faces: usize, placement: Option<Placement>) -> Vec<u8> {
    file_by(Rule::Rings, 512, name, faces, placement)
}

/// A file with pages by a rule; by that of cuts bounds are measured in little.
fn file_by(rule: Rule, chunk: u32, name: &str, faces: usize, placement: Option<Placement>) -> Vec<u8> {
    let mut pm = build(sample(name, faces, 5), &options(Method::Quadric, placement), &Quiet).unwrap().mesh;
    let o = match rule {
        Rule::Rings => hierarchy::Options::RINGS,
        _ => hierarchy::Options::CUTS.with_rounds(0),
    };
    pm.bounds = Some(Arc::new(Bounds::measure(&pm, &o).unwrap()));
    let o = EncodeOptions::default().with_any_order(true).with_pages(true).with_chunk(Some(chunk));
    encode(&[pm], &[], &[], &o).unwrap()
}

/// The file in memory: with the bounds it has.
fn in_memory(bytes: &[u8]) -> Arc<Hierarchy> {
    let mesh = Arc::new(decode(bytes).unwrap().meshes.remove(0));
    assert!(mesh.bounds.is_some());
    Arc::new(Hierarchy::new(mesh, &Default::default()).unwrap())
}

fn paged(bytes: &[u8], limit: usize) -> PagedView<&[u8]> {
    PagedView::new(Arc::new(RangeReader::new(bytes).unwrap()), 0, limit).unwrap()
}

fn camera(centre: DVec3, diagonal: f64, turn: f64, far: f64) -> Camera {
    Camera::new(&seen(centre, diagonal, turn, far)).unwrap()
}

fn seen(centre: DVec3, diagonal: f64, turn: f64, far: f64) -> CameraParameters {
    let eye = centre + far * diagonal * DVec3::new(turn.cos(), turn.sin(), 0.3);
    // From near by it sees a part.
    let fov_y_deg = if far < 0.7 { 12.0 } else { 45.0 };
    CameraParameters {
        eye,
        target: centre + 0.1 * diagonal * DVec3::new(turn.sin(), 0.2, turn.cos()),
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y_deg },
        width: 640,
        height: 480,
        near: 1e-3 * diagonal,
        far: 1e3 * diagonal,
    }
}

/// For every split of the file its number in memory, where the ring rule has them in another order: those of a vertex come in the same order everywhere.
fn numbers(bytes: &[u8], h: &Hierarchy) -> Vec<u32> {
    let file = decode(bytes).unwrap().meshes.remove(0);
    let n0 = file.base_vertices() as u32;
    let mut times = vec![0u32; file.vertices()];
    let next = |times: &mut Vec<u32>, v: u32| {
        times[v as usize] += 1;
        (v, times[v as usize])
    };
    let own: HashMap<_, u32> = h.mesh().splits.vertex.iter().map(|&v| next(&mut times, v)).zip(0..).collect();
    times.fill(0);
    let mut vertex: Vec<u32> = (0..n0).collect();
    let number = |&v: &u32| {
        let i = own[&next(&mut times, vertex[v as usize])];
        vertex.push(n0 + i);
        i
    };
    file.splits.vertex.iter().map(number).collect()
}

/// A corner: where it is, and its attributes.
type Corner = ([u64; 3], u64, Vec<u32>);

/// The faces of a mesh, however its elements are numbered: corners, the least first, material and group.
fn faces(m: &MeshInput) -> Vec<([Corner; 3], u32, u32)> {
    let corner = |k: usize| {
        let (wedges, w) = (m.wedges.as_ref(), m.wedges.as_ref().map_or(NONE, |w| w.corner[k]));
        let row = wedges.filter(|_| w != NONE).map(|all| (all.present(w), all.row(w)));
        let (present, row) = row.unwrap_or((0, &[]));
        (m.positions.bits(m.corners[k] as usize), present, row.iter().map(|x| x.to_bits()).collect())
    };
    let of = |all: &[u32], f: usize| all.get(f).copied().unwrap_or(NONE);
    let face = |f: usize| {
        let at = [0, 1, 2].map(|k| corner(3 * f + k));
        let turns = (0..3).map(|k| [0, 1, 2].map(|j| at[(j + k) % 3].clone()));
        (turns.min().unwrap(), of(&m.face_material, f), of(&m.face_group, f))
    };
    let mut all: Vec<_> = (0..m.corners.len() / 3).map(face).collect();
    all.sort();
    all
}

/// Both show the same splits and the same faces with the same attributes; by the rule of cuts in the same order.
fn same(view: &View, paged: &PagedView<&[u8]>, numbers: &[u32]) {
    let own: Vec<u32> = view.applied().map(|i| i as u32).collect();
    let mut theirs: Vec<u32> = paged.applied_splits().map(|i| numbers[i as usize]).collect();
    theirs.sort_unstable();
    assert_eq!(theirs, own);
    same_faces(paged.rule(), &view.to_input(), &paged.to_input());
    assert_eq!((view.face_count(), view.vertex_count()), (paged.face_count(), paged.vertex_count()));
}

fn same_faces(rule: Rule, a: &MeshInput, b: &MeshInput) {
    if rule == Rule::Cuts {
        return assert_same(a, b);
    }
    let places = |m: &MeshInput| {
        let mut all: Vec<_> = (0..m.positions.len()).map(|v| m.positions.bits(v)).collect();
        all.sort_unstable();
        all
    };
    assert_eq!((places(a), a.wires.len()), (places(b), b.wires.len()));
    assert!(faces(a) == faces(b));
}

/// On one flight both show the same meshes, frame by frame.
fn fly(bytes: &[u8], limit: usize, frames: usize) -> PagedView<&[u8]> {
    let h = in_memory(bytes);
    let numbers = numbers(bytes, &h);
    let (centre, diagonal) = h.extent();
    let mut view = View::new(h.clone());
    let mut out = paged(bytes, limit);
    assert_eq!((out.extent(), out.rule()), ((centre, diagonal), h.rule()));
    for k in 0..frames {
        let c = camera(centre, diagonal, 0.7 * k as f64, 0.6 + 0.5 * (k % 3) as f64);
        let tau = TAU[k % 3];
        let lens = Lens::new(&h, &c, &DMat4::IDENTITY, tau, Cull::All).unwrap();
        let done = view.adapt(&lens, &Limits::default());
        let lens = out.lens(&c, &DMat4::IDENTITY, tau, Cull::All).unwrap();
        let found = out.adapt(&[lens], &PagedLimits::default()).unwrap();
        let what = |d: Done| (d.splits, d.collapses, d.complete, d.refused);
        assert_eq!(what(found.done), what(done), "frame {k}");
        assert_eq!((found.no_room, found.postponed), (0, 0), "frame {k}");
        assert!(out.bytes() <= limit);
        same(&view, &out, &numbers);
    }
    out
}

#[test]
fn the_same_meshes_as_in_memory_frame_by_frame() {
    for rule in [Rule::Rings, Rule::Cuts] {
        for name in NAMES {
            let bytes = file_by(rule, 512, name, 3000, None);
            let out = fly(&bytes, PLENTY, 12);
            // It moves a vertex between sheets of faces, for which the ring rule is not.
            assert!(out.rule() == rule || name == "nonmanifold", "{name}");
        }
        fly(&file_by(rule, 512, "scan", 6000, Some(Placement::Endpoint)), PLENTY, 6);
    }
    // With places on a coarser grid, by passes of another method, and of a mesh in pieces with places in double precision.
    let o = EncodeOptions::default().with_pages(true).with_chunk(Some(300));
    fly(&written(sample("scan", 3000, 5), Method::Quadric, &o.clone().with_quantize(Some(11))), PLENTY, 6);
    fly(&written(sample("torus", 3000, 5), Method::Nsa, &o), PLENTY, 6);
    fly(&written(pieces(), Method::Quadric, &o), PLENTY, 6);
    // Many chunks, each of a few splits: what is needed is mostly in others.
    fly(&file_by(Rule::Rings, 24, "scan", 3000, None), PLENTY, 6);
}

/// A file with pages by the ring rule.
fn written(mesh: Mesh, method: Method, o: &EncodeOptions) -> Vec<u8> {
    let mut pm = build(mesh, &options(method, None), &Quiet).unwrap().mesh;
    pm.bounds = Some(Arc::new(Bounds::measure(&pm, &hierarchy::Options::RINGS).unwrap()));
    assert_eq!(pm.bounds.as_ref().unwrap().guarantee(), Guarantee::Settled);
    encode(&[pm], &[], &[], o).unwrap()
}

/// A sheet with a border, a closed surface and one with a handle, side by side.
fn pieces() -> Mesh {
    let mut all = MeshInput { positions: Positions::F64(Vec::new()), ..Default::default() };
    let Positions::F64(places) = &mut all.positions else { panic!("double") };
    for (k, name) in ["scan", "sphere", "torus"].into_iter().enumerate() {
        let m = sample(name, 1200, 7 + k as u64).to_input();
        let (low, high) = m.positions.bounds().unwrap();
        let (first, size) = (places.len() as u32, (high - low).max_element());
        let at = |p: DVec3| ((p - low) / size * 1.1 + DVec3::X * 1.3 * k as f64).to_array();
        places.extend(m.positions.iter().map(at));
        let triangles = m.corners.chunks_exact(3).flat_map(|t| [t[0], t[1], t[2]]);
        all.corners.extend(triangles.map(|v| first + v));
    }
    Mesh::build(all, &BuildOptions::default()).unwrap().0
}

/// The least limit.
fn needed(bytes: &[u8]) -> usize {
    match PagedView::new(Arc::new(RangeReader::new(bytes).unwrap()), 0, 1) {
        Err(PagedError::Memory { needed, .. }) => needed,
        other => panic!("{:?}", other.map(|v| v.bytes())),
    }
}

/// Chunks of few splits repeat many others: more than what is set aside is for. They are read all the same, and the limit is kept.
#[test]
fn chunks_that_take_much_on_the_way_are_read() {
    let bytes = file_by(Rule::Cuts, 6, "scan", 3000, None);
    fly(&bytes, PLENTY, 4);
    let needed = needed(&bytes);
    let mut short = 0;
    for more in [0, 20_000, 100_000] {
        let mut view = paged(&bytes, needed + more);
        let (centre, diagonal) = view.extent();
        let lens = view.lens(&camera(centre, diagonal, 0.2, 0.7), &DMat4::IDENTITY, 0.5, Cull::None).unwrap();
        let done = view.adapt(&[lens], &PagedLimits::default()).unwrap();
        assert!(view.bytes() <= needed + more);
        assert_closed(&view);
        short += usize::from(done.no_room > 0);
    }
    assert!(short > 0);
}

/// Vertices that a frustum holds are counted as one by one, wherever the mesh stands.
#[test]
fn visible_vertices_are_those_in_the_frustum() {
    let o = EncodeOptions::default().with_pages(true).with_chunk(Some(300));
    let files = [
        file("scan", 6000, Some(Placement::Endpoint)),
        file("torus", 3000, None),
        written(pieces(), Method::Quadric, &o),
    ];
    let mut some = 0;
    for bytes in &files {
        let mut view = paged(bytes, PLENTY);
        let (centre, diagonal) = view.extent();
        let beside = DMat4::from_translation(centre + 0.3 * diagonal * DVec3::X)
            * DMat4::from_axis_angle(DVec3::Z, 1.0)
            * DMat4::from_scale(DVec3::new(0.5, -1.5, 1.0));
        for k in 0..24 {
            let (turn, far) = (0.7 * k as f64, [0.1, 0.4, 0.65, 1.1][k % 4]);
            let c = camera(centre, diagonal, turn, far);
            let lens = view.lens(&c, &DMat4::IDENTITY, TAU[k % 3], Cull::None).unwrap();
            view.adapt(&[lens], &PagedLimits::default()).unwrap();
            let (frustum, places) = (c.frustum(), [DMat4::IDENTITY, beside]);
            let held = |v: u32| {
                let p = view.position(v).unwrap();
                places.iter().filter(|m| frustum.contains(m.transform_point3(p))).count()
            };
            let expected: usize = view.vertices().map(held).sum();
            assert_eq!(view.visible(&frustum, &places), expected, "frame {k}");
            assert_eq!(view.visible(&frustum, &[]), 0);
            some += usize::from(expected > 50 && expected < 2 * view.vertex_count() - 50);
        }
    }
    assert!(some > 30, "{some}");
    assert!(paged(&files[1], PLENTY).moves_vertices() && !paged(&files[0], PLENTY).moves_vertices());
}

/// Arrays that hold what is shown grow ahead while much is free, so that frames after the first rarely copy them; what they grew is given back when pages need it, or it is asked for.
#[test]
fn room_made_ahead_is_used_and_given_back() {
    let bytes = file_by(Rule::Rings, 160, "scan", 24_000, None);
    let adapt = |view: &mut PagedView<&[u8]>, turn: f64, tau: f64| {
        let (centre, diagonal) = view.extent();
        let lens = view.lens(&camera(centre, diagonal, turn, 1.1), &DMat4::IDENTITY, tau, Cull::All).unwrap();
        let done = view.adapt(&[lens], &PagedLimits::default()).unwrap();
        assert!(view.bytes() <= view.limit(), "{} of {}", view.bytes(), view.limit());
        done
    };
    let first = || {
        let mut view = paged(&bytes, PLENTY);
        assert!(adapt(&mut view, 0.2, 4.0).done.complete);
        view
    };
    // What is shown can become half as much again, and more, in the room of the first frame.
    let mut view = first();
    let (shown, room) = (view.vertex_count(), view.shown_bytes());
    assert!(adapt(&mut view, 0.2, 2.5).done.complete);
    let more = view.vertex_count();
    assert!(2 * more > 3 * shown && more < 2 * shown, "{more} after {shown}");
    assert_eq!(view.shown_bytes(), room);
    // Asked for, it is given back, but for an eighth, and for some sheets of calendars; the next frames are the same.
    let mut other = first();
    let (before, each) = (other.bytes(), room / (2 * shown));
    let freed = other.trim();
    assert_eq!(other.bytes(), before - freed);
    assert!(other.shown_bytes() < room * 9 / 16 + (1 << 15) && other.shown_bytes() > each * shown);
    assert!(adapt(&mut other, 0.2, 2.5).done.complete);
    assert_same(&other.to_input(), &view.to_input());
    // Where nothing is free pages take its place, if they must.
    let mut full = first();
    let on_the_way = needed(&bytes) - paged(&bytes, PLENTY).bytes();
    full.set_limit(full.bytes() + on_the_way);
    let done = adapt(&mut full, 0.2, 0.7);
    assert!(done.fetched > 0 && done.done.splits > 0 && full.shown_bytes() < room, "{done:?}");
    // No more than a quarter of what is free is grown ahead.
    let (least, held) = (needed(&bytes), other.bytes());
    let mut whole = 0;
    for part in 0..=8 {
        let mut view = paged(&bytes, least + held * part / 8);
        whole += usize::from(adapt(&mut view, 0.2, 4.0).done.complete);
        let before = view.shown_bytes();
        view.trim();
        assert!(before <= view.shown_bytes() + held * part / 8 / 4 + 4096);
    }
    assert!((1..9).contains(&whole), "{whole}");
}

/// Of a mesh of several chunks, read through little memory: what is not shown goes, and comes again.
#[test]
fn a_limit_is_kept_and_changes_no_mesh() {
    let bytes = file_by(Rule::Rings, 160, "scan", 24_000, None);
    let roomy = fly(&bytes, PLENTY, 12);
    let all = roomy.traffic();
    assert!(all.bytes_touched <= all.bytes_read && all.bytes_touched <= bytes.len() as u64);
    assert!(all.chunks_touched == all.chunks_decoded && all.evictions == 0, "{all:?}");
    assert!(all.chunks_touched > 4, "{all:?}");
    // The least with which every frame is whole: found by halving.
    let (mut low, mut high) = (0, 2 * roomy.bytes() + (16 << 20));
    let whole = |limit: usize| {
        let Ok(mut view) = PagedView::new(Arc::new(RangeReader::new(&bytes[..]).unwrap()), 0, limit) else {
            return None;
        };
        let (centre, diagonal) = view.extent();
        let mut all = true;
        for k in 0..12 {
            let c = camera(centre, diagonal, 0.7 * k as f64, 0.6 + 0.5 * (k % 3) as f64);
            let lens = view.lens(&c, &DMat4::IDENTITY, TAU[k % 3], Cull::All).unwrap();
            let done = view.adapt(&[lens], &PagedLimits::default()).unwrap();
            assert!(view.bytes() <= limit, "{} of {limit}", view.bytes());
            assert_eq!(done.done.complete, done.no_room == 0);
            assert_closed(&view);
            all &= done.done.complete;
        }
        Some(all)
    };
    assert_eq!(whole(high), Some(true));
    let mut short = 0;
    for _ in 0..14 {
        let middle = (low + high) / 2;
        match whole(middle) {
            Some(true) => high = middle,
            other => {
                short += usize::from(other.is_some());
                low = middle;
            }
        }
    }
    assert!(short > 0, "some limits are too small for the view, but not for the base");
    let tight = fly(&bytes, high, 12);
    assert!(tight.traffic().evictions > 0, "{:?}", tight.traffic());
    assert_eq!(tight.traffic().bytes_touched, all.bytes_touched);
}

/// What is applied is closed: all links are mutual, and every vertex of a face is shown.
fn assert_closed(view: &PagedView<&[u8]>) {
    for slot in (0..view.indices().len()).filter(|&s| view.face_in(s).is_some()) {
        let corners = view.indices()[slot].map(|w| view.wedge_vertex(w));
        assert!(corners.iter().all(|&v| view.position(v).is_some()));
        for (k, other) in view.neighbours(slot).into_iter().enumerate() {
            let Some(other) = other else { continue };
            assert!(view.face_in(other).is_some());
            let theirs = view.indices()[other].map(|w| view.wedge_vertex(w));
            assert!(theirs.contains(&corners[k]) && theirs.contains(&corners[(k + 1) % 3]));
        }
    }
}

/// What is drawn, and where, is what geomorphs draw in memory, frame by frame: by time and by error.
#[test]
fn geomorphs_are_those_in_memory_frame_by_frame() {
    let rings = [("scan", Some(Placement::Endpoint), 6000), ("cad", None, 3000), ("polygons", None, 3000)];
    let cuts = [("scan", None, 3000)];
    let all = rings.map(|f| (Rule::Rings, f)).into_iter().chain(cuts.map(|f| (Rule::Cuts, f)));
    for (rule, (name, placement, faces)) in all {
        let bytes = file_by(rule, 512, name, faces, placement);
        let h = in_memory(&bytes);
        let numbers = numbers(&bytes, &h);
        let n0 = h.mesh().base_vertices() as u32;
        let vertex = |v: u32| v.checked_sub(n0).map_or(v, |i| n0 + numbers[i as usize]);
        let (centre, diagonal) = h.extent();
        let (mut view, mut out) = (View::new(h.clone()), paged(&bytes, PLENTY));
        let mut timed: Option<TimedMorph> = None;
        let (mut moving, mut lingering, mut by_error) = (0, 0, 0);
        for k in 0..16 {
            // To and fro, so that motions are interrupted; it stands still at the end.
            let c = camera(centre, diagonal, 0.1 * k.min(9) as f64 % 0.5, 0.9);
            let tau = [1.5, 6.0, 2.0, 12.0][k.min(9) / 2 % 4];
            let lens = [Lens::new(&h, &c, &DMat4::IDENTITY, tau, Cull::All).unwrap()];
            view.adapt_to_all(&lens, &Limits::default());
            let found = out.adapt(&lens, &PagedLimits::default()).unwrap();
            assert!(found.done.complete && out.needed_faces() == view.face_count(), "{name} {k}");
            let Some(t) = &mut timed else {
                timed = Some(TimedMorph::new(&view, 5));
                out.set_timed(Some(5)).unwrap();
                same(&view, &out, &numbers);
                continue;
            };
            let (want, done) = (t.follow(&view, &lens), out.follow(&lens).unwrap());
            assert_eq!(done, want, "{name} {k}");
            same(t.view(), &out, &numbers);
            let places: Vec<(u32, DVec3)> = t.displaced().collect();
            let own: Vec<(u32, DVec3)> = out.displaced().collect();
            let mut theirs: Vec<_> = own.iter().map(|&(v, p)| (vertex(v), p)).collect();
            theirs.sort_unstable_by_key(|d| d.0);
            assert_eq!(theirs, places, "{name} {k}");
            same_faces(out.rule(), &t.view().to_input_with(&places), &out.to_input_with(&own));
            assert_closed(&out);
            moving += done.morphing;
            lingering += out.face_count() - out.needed_faces();
            if k % 5 == 0 {
                for v in out.vertices() {
                    let own = out.morphed_by_all(&lens, v, 2.0);
                    by_error += usize::from(own != out.position(v));
                    assert_eq!(own, t.view().morphed_by_all(&lens, vertex(v), 2.0));
                }
            }
        }
        assert!(moving > 100 && lingering > 100 && by_error > 20, "{name}: {moving} {lingering} {by_error}");
        // It has stood still for long enough.
        same(&view, &out, &numbers);
        assert_eq!((out.displaced().count(), out.needed_faces()), (0, out.face_count()));
        // Whatever is on the way is there at once when it is told to.
        for (tau, settle) in [(9.0, true), (1.0, false)] {
            let lens =
                [Lens::new(&h, &camera(centre, diagonal, 0.4, 0.9), &DMat4::IDENTITY, tau, Cull::All)
                    .unwrap()];
            view.adapt_to_all(&lens, &Limits::default());
            out.adapt(&lens, &PagedLimits::default()).unwrap();
            assert!(out.follow(&lens).unwrap().morphing > 0);
            if settle { out.settle().map(|_| ()) } else { out.set_timed(None) }.unwrap();
            same(&view, &out, &numbers);
            assert!(out.displaced().count() == 0);
        }
    }
}

/// A file that other threads may read as well; where it is needed it is slow.
struct Slow {
    bytes: Arc<Vec<u8>>,
    ahead: Arc<AtomicUsize>,
}

/// Its other end.
struct Quick(Arc<Vec<u8>>, Arc<AtomicUsize>);

impl ByteRanges for Slow {
    fn fetch(&self, range: Range<u64>) -> std::io::Result<Vec<u8>> {
        std::thread::sleep(std::time::Duration::from_millis(2));
        self.bytes.as_slice().fetch(range)
    }

    fn shared(&self) -> Option<Arc<dyn ByteRanges + Send + Sync>> {
        Some(Arc::new(Quick(self.bytes.clone(), self.ahead.clone())))
    }
}

impl ByteRanges for Quick {
    fn fetch(&self, range: Range<u64>) -> std::io::Result<Vec<u8>> {
        self.1.fetch_add(1, Ordering::Relaxed);
        self.0.as_slice().fetch(range)
    }
}

/// What other threads make ahead changes nothing that is shown, told or counted, whatever their number and the limit; damage neither.
#[test]
fn pages_made_ahead_change_nothing() {
    let bytes = file("scan", 24_000, None);
    let mut damaged = bytes.clone();
    let chunks = RangeReader::new(&bytes[..]).unwrap().directory().chunks.clone();
    let some = chunks.iter().filter(|c| c.kind == ChunkType::SPLITS).nth(3).unwrap();
    damaged[(some.offset + some.stored / 2) as usize] ^= 0x10;
    let fly = |bytes: &[u8], limit: usize, threads: usize| {
        let (bytes, ahead) = (Arc::new(bytes.to_vec()), Arc::new(AtomicUsize::new(0)));
        let source = Slow { bytes, ahead: ahead.clone() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let frames = pool.install(|| {
            let mut view = PagedView::new(Arc::new(RangeReader::new(source).unwrap()), 0, limit).unwrap();
            let (centre, diagonal) = view.extent();
            let mut frames = Vec::new();
            for k in 0..14 {
                // Nearer, and around it.
                let c = camera(centre, diagonal, 0.02 * k as f64, 1.1 - 0.05 * k as f64);
                let lens = view.lens(&c, &DMat4::IDENTITY, 2.0, Cull::Frustum).unwrap();
                let done = view.adapt(&[lens], &PagedLimits::default());
                assert!(view.bytes() <= limit, "{} of {limit}", view.bytes());
                frames.push((done, view.applied_splits().collect::<Vec<_>>(), view.traffic(), view.bytes()));
            }
            frames
        });
        (frames, ahead.load(Ordering::Relaxed))
    };
    let (roomy, none) = fly(&bytes, 64 << 20, 1);
    assert!(none == 0 && roomy.iter().all(|f| f.0.as_ref().is_ok_and(|d| d.done.complete)));
    assert!(roomy[0].3 < 64 << 20 && roomy.last().is_some_and(|f| f.2.chunks_decoded > 4));
    // Too little for all frames, and for anything to be made ahead.
    let tight = needed(&bytes) + (300 << 10);
    for (bytes, limit) in [(&bytes, 64 << 20), (&bytes, tight), (&damaged, 64 << 20)] {
        let (alone, none) = fly(bytes, limit, 1);
        assert_eq!(none, 0);
        // Whether the others come to do anything while this thread waits is up to the machine; once they do.
        let makes_ahead = cfg!(feature = "parallel") && limit != tight;
        let mut flights = (0..if makes_ahead { 50 } else { 1 }).map(|_| fly(bytes, limit, 3));
        let ahead = flights.by_ref().find_map(|(shared, ahead)| {
            assert!(alone == shared);
            (ahead > 0).then_some(ahead)
        });
        assert_eq!(ahead.is_some(), makes_ahead);
        let whole = alone.iter().all(|f| f.0.as_ref().is_ok_and(|d| d.done.complete));
        assert_eq!(whole, limit != tight && bytes != &damaged);
    }
}

/// Room that is set aside for pages made ahead, beyond the least, is there for what is shown once that runs short of it, on any number of threads.
#[test]
fn room_set_aside_is_given_to_what_is_shown() {
    let bytes = file_by(Rule::Rings, 256, "scan", 80_000, None);
    let fly = |limit: usize, shared: bool, threads: usize| -> Vec<(usize, usize)> {
        fn go<S: ByteRanges>(source: S, limit: usize) -> Vec<(usize, usize)> {
            let mut view = PagedView::new(Arc::new(RangeReader::new(source).unwrap()), 0, limit).unwrap();
            let (centre, diagonal) = view.extent();
            let lens = view.lens(&camera(centre, diagonal, 0.3, 0.8), &DMat4::IDENTITY, 0.0, Cull::None);
            let lens = [lens.unwrap()];
            let frame = |_| {
                let done = view.adapt(&lens, &PagedLimits::default()).unwrap();
                assert!(view.bytes() <= limit);
                (view.applied(), done.no_room)
            };
            (0..6).map(frame).collect()
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let source = Slow { bytes: Arc::new(bytes.clone()), ahead: Arc::default() };
        pool.install(|| if shared { go(source, limit) } else { go(&bytes[..], limit) })
    };
    let (base, mut given) = (needed(&bytes), 0);
    for more in (4000..16_000).step_by(2000) {
        let limit = base + (more << 10);
        let (with, without) = (fly(limit, true, 1), fly(limit, false, 1));
        assert_eq!(with, fly(limit, true, 3));
        if with[0].1 == 0 {
            continue;
        }
        // But for the eighth.
        assert!(10 * with[5].0 > 8 * without[5].0, "{limit}: {with:?} {without:?}");
        given += usize::from(10 * with[0].0 < 9 * with[5].0);
    }
    assert!(given > 0);
}

/// On a flight from frame to frame the meshes are those in memory, on one thread and on several: what is looked at, drawn and found by others is what one would find.
#[test]
fn on_a_flight_the_meshes_are_those_in_memory() {
    for (rule, placement) in [(Rule::Rings, None), (Rule::Cuts, Some(Placement::Endpoint))] {
        let bytes = file_by(rule, 512, "scan", 40_000, placement);
        let h = in_memory(&bytes);
        let numbers = numbers(&bytes, &h);
        let (centre, diagonal) = h.extent();
        let fly = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let (mut view, mut out) = (View::new(h.clone()), paged(&bytes, PLENTY));
                let (mut splits, mut collapses, mut indices) = (0, 0, Vec::new());
                for k in 0..24 {
                    // To it, and away.
                    let near = 12.0 - (k as f64 - 12.0).abs();
                    let c = camera(centre, diagonal, 0.03 * k as f64, 1.2 - 0.06 * near);
                    let lens = Lens::new(&h, &c, &DMat4::IDENTITY, 1.0, Cull::Frustum).unwrap();
                    let done = view.adapt(&lens, &Limits::default());
                    let lens = out.lens(&c, &DMat4::IDENTITY, 1.0, Cull::Frustum).unwrap();
                    let found = out.adapt(&[lens], &PagedLimits::default()).unwrap();
                    let what = |d: Done| (d.splits, d.collapses, d.complete, d.refused);
                    assert_eq!(what(found.done), what(done), "frame {k}");
                    same(&view, &out, &numbers);
                    assert_closed(&out);
                    if k > 0 {
                        (splits, collapses) = (splits + done.splits, collapses + done.collapses);
                    }
                    let (runs, wedges) = out.take_changes();
                    indices.push((out.indices().to_vec(), runs, wedges, out.bytes()));
                }
                // Handfuls of them.
                assert!(splits > 24 * 64 && collapses > 24 * 64, "{splits} {collapses}");
                indices
            })
        };
        // To the slot.
        let alone = fly(1);
        assert!([2, 3].iter().all(|&threads| fly(threads) == alone));
    }
}

/// Through little memory: it is kept, no frame is coarser than asked, and where there is no room for motions what changes jumps.
#[test]
fn geomorphs_keep_the_limit() {
    let bytes = file("scan", 12_000, None);
    let fly = |limit: usize| {
        let mut out = PagedView::new(Arc::new(RangeReader::new(&bytes[..]).unwrap()), 0, limit).ok()?;
        let (centre, diagonal) = out.extent();
        let (mut most, mut moving, mut whole) = (0, 0, 0);
        for k in 0..24 {
            let c = camera(centre, diagonal, 0.25 * k as f64, 0.6 + 0.5 * (k / 8) as f64);
            let lens = [out.lens(&c, &DMat4::IDENTITY, [1.0, 3.0][k / 4 % 2], Cull::All).unwrap()];
            let done = out.adapt(&lens, &PagedLimits::default()).unwrap();
            assert!(out.bytes() <= limit, "{} of {limit} in frame {k}", out.bytes());
            if k == 0 {
                out.set_timed(Some(6)).unwrap();
            }
            moving += out.follow(&lens).unwrap().morphing;
            assert!(out.bytes() <= limit, "{} of {limit} in frame {k}", out.bytes());
            assert_closed(&out);
            whole += usize::from(done.done.complete);
            most = most.max(out.bytes());
        }
        Some((most, moving, whole))
    };
    let (most, moving, whole) = fly(PLENTY).unwrap();
    assert_eq!(whole, 24);
    // What is set aside for decoding is not in what was held.
    let needed = needed(&bytes) - paged(&bytes, PLENTY).bytes();
    let (mut fewer, mut jumps) = (0, 0);
    for part in [1.0, 0.96, 0.92, 0.88, 0.84, 0.7] {
        let Some((_, less, complete)) = fly((most as f64 * part) as usize + needed) else { continue };
        fewer += usize::from(less < moving);
        jumps += usize::from(less < moving && complete >= 23);
    }
    assert!(fewer > 0 && jumps > 0, "{fewer} {jumps} of {moving}");
}

#[test]
fn a_few_fetches_a_frame_lead_to_the_same_mesh() {
    let bytes = file("scan", 24_000, None);
    let h = in_memory(&bytes);
    let numbers = numbers(&bytes, &h);
    let (centre, diagonal) = h.extent();
    let c = camera(centre, diagonal, 0.3, 0.7);
    let mut view = View::new(h.clone());
    view.adapt(&Lens::new(&h, &c, &DMat4::IDENTITY, 0.5, Cull::All).unwrap(), &Limits::default());
    let mut out = paged(&bytes, PLENTY);
    let lens = out.lens(&c, &DMat4::IDENTITY, 0.5, Cull::All).unwrap();
    let limits = PagedLimits { fetches: 1, ..PagedLimits::default() };
    let mut faces = Vec::new();
    for _ in 0..200 {
        let done = out.adapt(&[lens], &limits).unwrap();
        assert!(done.fetched <= 1 && done.done.complete == (done.postponed == 0));
        assert_closed(&out);
        faces.push(out.face_count());
        if done.done.complete {
            break;
        }
    }
    assert!(faces.len() > 3 && faces.is_sorted(), "{faces:?}");
    same(&view, &out, &numbers);
}

#[test]
fn it_shows_all_there_is_and_goes_back_to_the_base() {
    for (name, placement) in [("scan", Some(Placement::Endpoint)), ("cad", None), ("terrain", None)] {
        let bytes = file(name, 8000, placement);
        let h = in_memory(&bytes);
        let numbers = numbers(&bytes, &h);
        let (centre, diagonal) = h.extent();
        let c = camera(centre, diagonal, 1.0, 1.0);
        let (mut view, mut out) = (View::new(h.clone()), paged(&bytes, PLENTY));
        let base = out.to_input();
        for tau in [0.0, f64::INFINITY, 2.0, f64::INFINITY] {
            let lens = Lens::new(&h, &c, &DMat4::IDENTITY, tau, Cull::None).unwrap();
            view.adapt(&lens, &Limits::default());
            out.adapt(&[lens], &PagedLimits::default()).unwrap();
            same(&view, &out, &numbers);
            if tau == 0.0 {
                assert_eq!((out.applied(), out.face_count()), (out.splits(), out.full_faces()));
            }
        }
        assert_same(&base, &out.to_input());
        // Nothing is shown of any page: all can go, and what is left is what there was at first, but for room to grow.
        assert!(out.trim() > 0);
        assert_eq!(out.resident_pages(), 0);
    }
}

#[test]
fn limits_of_faces_and_operations_are_kept() {
    let bytes = file("scan", 12_000, None);
    let mut out = paged(&bytes, PLENTY);
    let (centre, diagonal) = out.extent();
    let lens = out.lens(&camera(centre, diagonal, 0.0, 0.8), &DMat4::IDENTITY, 0.5, Cull::All).unwrap();
    let most = out.face_count() + 1000;
    let faces = Limits { faces: most, ..Limits::default() };
    let done = out.adapt(&[lens], &PagedLimits { limits: faces, ..Default::default() }).unwrap();
    assert!(done.done.refused > 0 && out.face_count() <= most && out.face_count() > most - 300);
    let few = Limits { operations: 300, ..Limits::default() };
    let mut frames = 0;
    loop {
        let done = out.adapt(&[lens], &PagedLimits { limits: few, ..Default::default() }).unwrap();
        assert!(done.done.splits + done.done.collapses <= 300);
        frames += 1;
        assert!(frames < 1000);
        if done.done.complete {
            break;
        }
    }
    assert!(frames > 3);
    let mut whole = paged(&bytes, PLENTY);
    whole.adapt(&[lens], &PagedLimits::default()).unwrap();
    assert!(whole.applied_splits().eq(out.applied_splits()));
}

#[test]
fn a_near_view_reads_a_part_of_the_file() {
    let bytes = file_by(Rule::Cuts, 512, "terrain", 50_000, None);
    let mut out = paged(&bytes, PLENTY);
    let begun = out.traffic().bytes_read;
    assert!(begun < bytes.len() as u64 / 8, "{begun} of {}", bytes.len());
    let (centre, diagonal) = out.extent();
    let c = Camera::new(&CameraParameters {
        eye: centre + DVec3::new(0.3, 0.3, 0.1) * diagonal,
        target: centre + DVec3::new(0.2, 0.25, 0.0) * diagonal,
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y_deg: 30.0 },
        width: 320,
        height: 240,
        near: 1e-3 * diagonal,
        far: 10.0 * diagonal,
    })
    .unwrap();
    let lens = out.lens(&c, &DMat4::IDENTITY, 1.0, Cull::All).unwrap();
    let done = out.adapt(&[lens], &PagedLimits::default()).unwrap();
    let t = out.traffic();
    assert!(done.done.complete && done.fetched > 0 && done.done.splits > 100, "{done:?}");
    assert!(t.bytes_touched < bytes.len() as u64 / 2, "{} of {}", t.bytes_touched, bytes.len());
}

#[test]
fn what_cannot_be_paged_is_told() {
    let pm = build(sample("scan", 2000, 5), &options(Method::Quadric, None), &Quiet).unwrap().mesh;
    for o in [EncodeOptions::default(), EncodeOptions::default().with_alone(true)] {
        let bytes = encode(std::slice::from_ref(&pm), &[], &[], &o).unwrap();
        let reader = Arc::new(RangeReader::new(&bytes[..]).unwrap());
        assert_eq!(PagedView::new(reader, 0, PLENTY).unwrap_err(), PagedError::NoPages);
    }
    let pages = EncodeOptions::default().with_pages(true);
    let result = encode(std::slice::from_ref(&pm), &[], &[], &pages);
    assert_eq!(result.unwrap_err(), EncodeError::NoBounds(0));
    let bytes = file("scan", 3000, None);
    let reader = Arc::new(RangeReader::new(&bytes[..]).unwrap());
    assert!(matches!(PagedView::new(reader.clone(), 1, PLENTY), Err(PagedError::Format(_))));
    match PagedView::new(reader.clone(), 0, 1000) {
        Err(PagedError::Memory { limit: 1000, needed }) => {
            assert!(PagedView::new(reader, 0, needed).is_ok());
        }
        other => panic!("{:?}", other.map(|v| v.bytes())),
    }
}

/// Pixels that a place of the finest mesh is off at most, of those that the frustum holds, by code of its own.
fn measured(samples: &[DVec3], shown: &MeshInput, c: &CameraParameters) -> f64 {
    let faces: Vec<[u32; 3]> = shown.corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    let surface = Surface::new(&shown.positions, &faces).unwrap();
    let mut query = surface.query();
    let forward = (c.target - c.eye).normalize();
    let right = forward.cross(c.up).normalize();
    let up = right.cross(forward);
    let Projection::Perspective { fov_y_deg } = c.projection else { panic!("seen from a point") };
    let slope = (0.5 * fov_y_deg.to_radians()).tan();
    let (pixels, aspect) = (0.5 * f64::from(c.height) / slope, f64::from(c.width) / f64::from(c.height));
    let off = samples.iter().map(|&p| {
        let v = p - c.eye;
        let depth = v.dot(forward);
        let inside = depth > c.near
            && v.dot(up).abs() <= depth * slope
            && v.dot(right).abs() <= depth * slope * aspect;
        if inside { pixels * query.distance(p) / depth } else { 0.0 }
    });
    off.fold(0.0, f64::max)
}

/// Vertices and places on faces of full detail.
fn samples(bytes: &[u8]) -> Vec<DVec3> {
    let pm = decode(bytes).unwrap().meshes.remove(0);
    let mut full = pm.cursor().unwrap();
    full.seek(usize::MAX).unwrap();
    let mut random = Random(17);
    let mut out: Vec<DVec3> = (0..full.positions().len()).map(|v| full.positions().get(v)).collect();
    for t in full.indices() {
        let [a, b, c] = t.map(|w| full.positions().get(full.wedge_vertex(w) as usize));
        for _ in 0..3 {
            let (u, v) = (random.unit(), random.unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            out.push(a + (b - a) * u + (c - a) * v);
        }
    }
    out
}

/// From a file by the ring rule: nowhere farther off than the tolerance, and that not by showing too much.
#[test]
fn no_place_is_off_by_more_than_the_tolerance() {
    let mut ratios = Vec::new();
    for (name, faces) in [("scan", 4000), ("torus", 4000), ("quad-sphere", 3000), ("terrain", 4000)] {
        let bytes = file(name, faces, None);
        let samples = samples(&bytes);
        let mut out = paged(&bytes, PLENTY);
        assert_eq!(out.rule(), Rule::Rings);
        let (centre, diagonal) = out.extent();
        for k in 0..12 {
            let c = seen(centre, diagonal, 0.7 * k as f64, 0.4 + 0.4 * (k % 3) as f64);
            let tau = [0.5, 2.0, 4.0, 8.0][k % 4];
            let camera = Camera::new(&c).unwrap();
            let lens = out.lens(&camera, &DMat4::IDENTITY, tau, Cull::Frustum).unwrap();
            assert!(out.adapt(&[lens], &PagedLimits::default()).unwrap().done.complete);
            let ratio = measured(&samples, &out.to_input(), &c) / tau;
            assert!(ratio <= 1.0, "{name} in frame {k}: {ratio}");
            // Where all there is is shown nothing is off.
            if out.applied() < out.splits() {
                ratios.push(ratio);
            }
        }
    }
    ratios.sort_by(f64::total_cmp);
    assert!(ratios.len() > 30 && ratios[ratios.len() / 2] > 0.7, "{ratios:.2?}");
}

/// Contents of pages and bounds that lie under a right checksum: an error, or some closed mesh, and no panic.
#[test]
fn pages_that_lie_are_no_panic() {
    let (mut told, mut shown, mut contradict) = (0, 0, 0);
    for rule in [Rule::Rings, Rule::Cuts] {
        let bytes = file_by(rule, 60, "scan", 400, None);
        let chunks = RangeReader::new(&bytes[..]).unwrap().directory().chunks.clone();
        let lie = [ChunkType::SPLITS, ChunkType::PAGE, ChunkType::BOUNDS];
        for c in chunks.iter().filter(|c| lie.contains(&c.kind)) {
            for at in c.range().step_by(5) {
                let mut bad = bytes.clone();
                bad[at as usize] ^= [0x01, 0x80, 0xFF, 0x10][at as usize % 4];
                common::sign(&mut bad, c);
                let Ok(mut out) = PagedView::new(Arc::new(RangeReader::new(&bad[..]).unwrap()), 0, PLENTY)
                else {
                    told += 1;
                    continue;
                };
                let (centre, diagonal) = out.extent();
                let c = camera(centre, diagonal.clamp(1e-9, 1e9), 0.3, 0.9);
                for (k, tau) in [1.0, 0.0, 3.0, f64::INFINITY].into_iter().enumerate() {
                    let Ok(lens) = out.lens(&c, &DMat4::IDENTITY, tau, Cull::None) else { break };
                    let done = out.adapt(&[lens], &PagedLimits::default());
                    told += usize::from(done.is_err());
                    contradict += usize::from(matches!(done, Err(PagedError::Damage(_))));
                    if k == 0 {
                        _ = out.set_timed(Some(2));
                    }
                    shown += usize::from(out.follow(&[lens]).is_ok() && done.is_ok());
                    assert_closed(&out);
                }
            }
        }
    }
    assert!(told > 100 && shown > 100 && contradict > 10, "{told} {shown} {contradict}");
}

/// Every byte of a chunk turned over is an error that names it, or changes nothing: checksums stand before all else.
#[test]
fn damage_is_an_error() {
    for rule in [Rule::Rings, Rule::Cuts] {
        damaged(&file_by(rule, 512, "torus", 4000, None));
    }
}

fn damaged(bytes: &[u8]) {
    let reader = RangeReader::new(bytes).unwrap();
    let chunks = reader.directory().chunks.clone();
    for c in chunks.iter().filter(|c| c.stored > 0) {
        let mut bad = bytes.to_vec();
        bad[(c.offset + c.stored / 2) as usize] ^= 0x10;
        let reader = Arc::new(RangeReader::new(&bad[..]).unwrap());
        let result = PagedView::new(reader, 0, PLENTY).and_then(|mut view| {
            let (centre, diagonal) = view.extent();
            let lens = view.lens(&camera(centre, diagonal, 0.0, 1.0), &DMat4::IDENTITY, 0.0, Cull::None);
            let before = view.bytes();
            let result = view.adapt(&[lens.unwrap()], &PagedLimits::default());
            assert!(view.bytes() >= before);
            assert_closed(&view);
            result
        });
        assert!(
            matches!(&result, Err(PagedError::Format(FormatError::Chunk { index, .. })) if *index == c.index),
            "chunk {}: {result:?}",
            c.index
        );
    }
}

/// However little time there is in each frame, looking goes on where it was cut short.
#[test]
fn frames_with_little_time_come_to_an_end_of_what_is_too_fine() {
    let bytes = file_by(Rule::Cuts, 512, "scan", 60_000, None);
    let h = in_memory(&bytes);
    let (centre, diagonal) = h.extent();
    let c = camera(centre, diagonal, 0.3, 0.7);
    let lens = |tau: f64| [Lens::new(&h, &c, &DMat4::IDENTITY, tau, Cull::All).unwrap()];
    for tau in [0.402, 0.8] {
        let mut out = paged(&bytes, PLENTY);
        out.adapt(&lens(0.4), &PagedLimits::default()).unwrap();
        let mut undone = 0;
        for _ in 0..200 {
            let asked = std::cell::Cell::new(0);
            let expired = || asked.replace(asked.get() + 1) >= 1;
            let limits = Limits { expired: Some(&expired), ..Limits::default() };
            let done = out.adapt(&lens(tau), &PagedLimits { limits, ..Default::default() }).unwrap();
            undone += done.done.collapses;
        }
        assert!(undone > 0);
        assert_eq!(out.adapt(&lens(tau), &PagedLimits::default()).unwrap().done.collapses, 0);
    }
}

/// What is left out is counted once, whatever was applied before it.
#[test]
fn what_is_left_out_is_counted_once() {
    let bytes = file("scan", 24_000, None);
    let h = in_memory(&bytes);
    let (centre, diagonal) = h.extent();
    let c = camera(centre, diagonal, 0.3, 0.7);
    let mut out = paged(&bytes, PLENTY);
    let mut left_out = |tau: f64, fetches: usize| {
        let lens = Lens::new(&h, &c, &DMat4::IDENTITY, tau, Cull::All).unwrap();
        out.adapt(&[lens], &PagedLimits { fetches, ..Default::default() }).unwrap().postponed
    };
    for fetches in [0, 0, 2, 2, 2, 2] {
        left_out(1.0, fetches);
    }
    let found = left_out(1.0, 0);
    // With another tolerance all are looked at.
    assert!(found > 100 && found == left_out(1.0 + 1e-13, 0));
}
