//! Progressive meshes: exact in both directions, from every method and on every sample mesh.

mod common;

use common::{NAMES, assert_same, input_of, options, sample, with_a_slit};
use progmesh_meshes::{GenerateOptions, generate};
use progmesh_refine::aif::*;
use progmesh_refine::format::{EncodeOptions, decode, encode};
use progmesh_refine::progressive::{Patch, build, build_all};
use progmesh_refine::simplify::{Method, Options, Placement, Quiet, Schedule, simplify};
use progmesh_refine::{Cursor, ProgressiveMesh};
use proptest::prelude::*;

/// What an index buffer and a vertex buffer hold, as bits.
type Buffers = (Vec<[u32; 3]>, Vec<Slot>);
/// Position, channels present, values.
type Slot = ([u64; 3], u64, Vec<u32>);

fn buffers(c: &Cursor<&ProgressiveMesh>) -> Buffers {
    let wedge = |w: u32| {
        let row = c.row(w).iter().map(|x| x.to_bits()).collect();
        (c.positions().get(c.wedge_vertex(w) as usize).to_array().map(f64::to_bits), c.present(w), row)
    };
    (c.indices().to_vec(), (0..c.wedge_count() as u32).map(wedge).collect())
}

/// The mesh at the cursor holds every invariant.
fn assert_valid(c: &Cursor<&ProgressiveMesh>) -> Mesh {
    let (mesh, report) = Mesh::build(c.to_input(), &BuildOptions::default()).unwrap();
    mesh.check().unwrap();
    assert!(report.dropped_faces.is_empty() && report.split_faces.is_empty());
    mesh
}

fn runs() -> Vec<Options> {
    let mut all = vec![
        options(Method::Quadric, None),
        options(Method::Quadric, Some(Placement::Endpoint)),
        options(Method::Quadric, Some(Placement::Midpoint)),
        options(Method::Nsa, None),
        options(Method::Nsa, Some(Placement::Endpoint)),
        options(Method::Nsa, Some(Placement::Optimal)),
    ];
    all[1].schedule = Some(Schedule::Exact);
    all[4].epsilon = Some(60.0);
    all
}

#[test]
fn full_detail_is_the_input_bit_for_bit_by_every_method() {
    for name in NAMES {
        let mesh = sample(name, 3000, 7);
        let input = mesh.to_input();
        for o in runs() {
            let pm = build(mesh.clone(), &o, &Quiet).unwrap().mesh;
            assert!(pm.splits.len() > 100, "{name}: {} splits", pm.splits.len());
            let mut c = pm.cursor().unwrap();
            let base = buffers(&c);
            assert_valid(&c);
            for _ in 0..2 {
                c.seek(usize::MAX).unwrap();
                assert_eq!(c.face_count(), pm.faces());
                assert_same(&c.to_ordered_input(), &input);
                c.seek(0).unwrap();
                assert_eq!(buffers(&c), base, "{name} {o:?}");
            }
        }
    }
}

#[test]
fn every_state_on_the_way_is_valid_and_has_the_topology_of_the_input() {
    for name in NAMES {
        let mesh = sample(name, 1200, 3);
        let topology = |m: &Mesh| {
            let t = m.topology();
            (t.euler_characteristic(), t.border_loops().len(), t.face_components().count)
        };
        let full = topology(&mesh);
        let pm = build(mesh, &options(Method::Quadric, None), &Quiet).unwrap().mesh;
        let mut c = pm.cursor().unwrap();
        for k in (0..=pm.splits.len()).step_by(37) {
            c.seek(k).unwrap();
            assert_eq!(topology(&assert_valid(&c)), full, "{name} at {k}");
        }
    }
}

#[test]
fn a_state_of_the_exact_schedule_is_what_simplify_returns_for_that_count() {
    for name in ["scan", "cad", "quad-sphere", "torus"] {
        let mesh = sample(name, 2000, 1);
        for placement in [Placement::Optimal, Placement::Endpoint] {
            let mut o = options(Method::Quadric, Some(placement));
            // What is recorded is not refitted.
            (o.schedule, o.refit) = (Some(Schedule::Exact), Some(0));
            let pm = build(mesh.clone(), &o, &Quiet).unwrap().mesh;
            let mut c = pm.cursor().unwrap();
            for faces in [1500, 700, 201] {
                let mut simplified = mesh.clone();
                o.triangles = Some(faces);
                simplify(&mut simplified, &o, &Quiet).unwrap();
                c.seek_faces(simplified.face_count()).unwrap();
                let mut have = c.to_ordered_input();
                let want = simplified.to_input();
                // Simplification leaves out vertices without a face.
                let (clean, _) = Mesh::build(have, &BuildOptions::default()).unwrap();
                have = clean.compact(CompactOptions::with_drop_isolated(true)).0.to_input();
                assert_same(&have, &want);
            }
        }
    }
}

#[test]
fn nsa_levels_are_its_passes() {
    let mesh = sample("scan", 4000, 2);
    let mut o = options(Method::Nsa, None);
    o.passes = Some(4);
    let mut simplified = mesh.clone();
    let outcome = simplify(&mut simplified, &o, &Quiet).unwrap();
    let pm = build(mesh.clone(), &o, &Quiet).unwrap().mesh;
    let mut counts: Vec<usize> = outcome.levels.iter().rev().map(|l| l.faces).collect();
    counts.push(mesh.face_count());
    let mut c = pm.cursor().unwrap();
    let levels: Vec<usize> = (0..pm.levels.len())
        .map(|k| {
            c.seek_level(k).unwrap();
            c.face_count()
        })
        .collect();
    assert_eq!(levels, counts);
}

#[test]
fn patches_turn_the_buffers_of_one_state_into_those_of_the_other() {
    for name in ["scan", "quad-sphere", "cad"] {
        let pm = build(sample(name, 1500, 5), &options(Method::Quadric, None), &Quiet).unwrap().mesh;
        let n = pm.splits.len();
        let mut c = pm.cursor().unwrap();
        let (mut indices, mut vertices) = buffers(&c);
        let mut patch = Patch::default();
        for to in [n / 3, n / 2, n / 5, n, n - 1, n / 2, 0, 3] {
            c.seek_with_patch(to, &mut patch).unwrap();
            let (now, wedges) = buffers(&c);
            indices.truncate(patch.faces_now);
            indices.extend_from_slice(&now[indices.len()..]);
            for &k in &patch.indices {
                indices[k as usize / 3][k as usize % 3] = now[k as usize / 3][k as usize % 3];
            }
            vertices.truncate(patch.wedges_now);
            vertices.extend_from_slice(&wedges[vertices.len()..]);
            patch.wedges.iter().for_each(|&w| vertices[w as usize] = wedges[w as usize].clone());
            assert!(patch.indices.is_sorted_by(|a, b| a < b) && patch.wedges.is_sorted_by(|a, b| a < b));
            assert_eq!(indices, now, "{name} to {to}");
            assert_eq!(vertices, wedges, "{name} to {to}");
        }
    }
}

#[test]
fn several_meshes_take_turns_as_their_collapses_did() {
    let meshes = vec![sample("scan", 1500, 1), sample("sphere", 800, 1), sample("cad", 900, 1)];
    let scales = [1.0, 0.5, 2.0];
    let mut o = options(Method::Quadric, None);
    o.schedule = Some(Schedule::Exact);
    let all = build_all(meshes.clone(), &scales, &o, &Quiet).unwrap();
    assert_eq!(all.turns.len(), all.meshes.iter().map(|m| m.splits.len()).sum::<usize>());
    // The coarsest states of all together are those of a run that stops there.
    let first = all.turns.len() / 4;
    let mut counts = [0; 3];
    all.turns[..first].iter().for_each(|&m| counts[m as usize] += 1);
    let faces: Vec<usize> = all
        .meshes
        .iter()
        .zip(counts)
        .map(|(pm, k)| {
            let mut c = pm.cursor().unwrap();
            c.seek(k).unwrap();
            c.face_count()
        })
        .collect();
    let mut simplified = meshes;
    o.triangles = Some(faces.iter().sum());
    progmesh_refine::simplify::simplify_all(&mut simplified, &scales, &o, &Quiet).unwrap();
    assert_eq!(simplified.iter().map(Mesh::face_count).collect::<Vec<_>>(), faces);
}

#[test]
fn errors_nest_and_seeking_by_error_finds_the_coarsest_state() {
    let pm = build(sample("scan", 3000, 4), &options(Method::Quadric, None), &Quiet).unwrap().mesh;
    let mut c = pm.cursor().unwrap();
    let mut last = usize::MAX;
    for k in [0.0, 1e-5, 1e-4, 1e-3, 1e-2, 1.0] {
        c.seek_error(k).unwrap();
        assert!(pm.splits.error[c.position()..].iter().all(|&e| e as f64 <= k));
        assert!(c.position() == 0 || pm.splits.error[c.position() - 1] as f64 > k);
        assert!(c.position() <= last);
        last = c.position();
    }
    assert_eq!(last, 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn wherever_a_cursor_wanders_it_finds_what_a_fresh_one_finds(
        name in 0..NAMES.len(),
        faces in 200..900usize,
        seed in 0..1000u64,
        run in 0..6usize,
        walk in prop::collection::vec(0.0..1.0f64, 1..8),
    ) {
        let mesh = sample(NAMES[name], faces, seed);
        let input = mesh.to_input();
        let pm = build(mesh, &runs()[run], &Quiet).unwrap().mesh;
        let mut c = pm.cursor().unwrap();
        for x in walk {
            let to = (x * (pm.splits.len() + 1) as f64) as usize;
            c.seek(to).unwrap();
            let mut fresh = pm.cursor().unwrap();
            fresh.seek(to).unwrap();
            prop_assert_eq!(buffers(&c), buffers(&fresh));
            assert_valid(&c);
        }
        c.seek(usize::MAX).unwrap();
        assert_same(&c.to_ordered_input(), &input);
    }
}

#[test]
fn new_places_lie_on_the_grid_that_was_asked_for() {
    let mut o = options(Method::Quadric, Some(Placement::Optimal));
    let cell = (-12f64).exp2();
    o.grid = Some(cell);
    for (mesh, double) in [(sample("scan", 2000, 9), false), (sample("torus", 2000, 9), true)] {
        let mut input = mesh.to_input();
        if double {
            input.positions = Positions::F64(mesh.positions().iter().map(|p| (p * 1.1).to_array()).collect());
        }
        let mesh = Mesh::build(input.clone(), &BuildOptions::default()).unwrap().0;
        let pm = build(mesh, &o, &Quiet).unwrap().mesh;
        assert!(pm.moved_positions.len() > 500);
        let mut c = pm.cursor().unwrap();
        let inner = pm.splits.code[0].moves() as usize + pm.base_vertices() / 2;
        let on_grid = |p: glam::DVec3| (p / cell).to_array().iter().all(|x| x.fract() == 0.0);
        assert!(c.positions().iter().filter(|&p| on_grid(p)).count() >= inner.min(c.vertex_count()) / 2);
        c.seek(usize::MAX).unwrap();
        assert_same(&c.to_ordered_input(), &input);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// The l/r rule: whatever order respects the dependencies refines to the same mesh.
    #[test]
    fn any_order_that_respects_the_dependencies_leads_to_the_input(
        name in 0..NAMES.len(),
        seed in 0..1000u64,
        run in 0..6usize,
        shuffle in 1..u64::MAX,
    ) {
        let mesh = sample(NAMES[name], 700, seed);
        let input = mesh.to_input();
        let pm = build(mesh, &runs()[run], &Quiet).unwrap().mesh;
        // Kahn's algorithm, the next split drawn at random.
        let on = pm.dependencies();
        let mut missing: Vec<usize> = on.iter().map(|d| d.iter().filter(|&&d| d != NONE).count()).collect();
        let mut dependents = vec![Vec::new(); on.len()];
        for (i, d) in on.iter().enumerate() {
            d.iter().filter(|&&d| d != NONE).for_each(|&d| dependents[d as usize].push(i));
        }
        let mut ready: Vec<usize> = (0..on.len()).filter(|&i| missing[i] == 0).collect();
        let (mut order, mut state) = (Vec::new(), shuffle);
        while !ready.is_empty() {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let i = ready.swap_remove((state >> 33) as usize % ready.len());
            order.push(i as u32);
            for &d in &dependents[i] {
                missing[d] -= 1;
                if missing[d] == 0 {
                    ready.push(d);
                }
            }
        }
        let other = pm.reordered(&order).unwrap();
        let mut c = other.cursor().unwrap();
        let base = buffers(&c);
        c.seek(other.splits.len() / 2).unwrap();
        assert_valid(&c);
        c.seek(usize::MAX).unwrap();
        assert_same(&c.to_ordered_input(), &input);
        c.seek(0).unwrap();
        prop_assert_eq!(buffers(&c), base);
        // Back again.
        let mut back = vec![0; order.len()];
        order.iter().enumerate().for_each(|(k, &i)| back[i as usize] = k as u32);
        let again = other.reordered(&back).unwrap();
        prop_assert_eq!(&again.splits, &pm.splits);
        prop_assert_eq!(&again.wedges, &pm.wedges);
        order.swap(0, pm.splits.len() - 1);
        prop_assert!(pm.reordered(&order).is_err() || on.len() < 3);
    }
}

#[test]
fn where_seams_end_full_detail_is_the_input_all_the_same() {
    for seed in 0..6 {
        let mesh = with_a_slit(seed);
        let input = mesh.to_input();
        for placement in [Placement::Endpoint, Placement::Midpoint, Placement::Optimal] {
            for method in [Method::Quadric, Method::Nsa] {
                let mut o = options(method, Some(placement));
                o.epsilon = (method == Method::Nsa).then_some(60.0);
                let pm = build(mesh.clone(), &o, &Quiet).unwrap().mesh;
                let mut c = pm.cursor().unwrap();
                c.seek(usize::MAX).unwrap();
                assert_same(&c.to_ordered_input(), &input);
                c.seek(0).unwrap();
                c.seek(usize::MAX).unwrap();
                assert_same(&c.to_ordered_input(), &input);
            }
        }
    }
}

/// Errors fall from split to split, within each level.
fn assert_falling(pm: &ProgressiveMesh) {
    for level in pm.levels.windows(2) {
        let errors = &pm.splits.error[level[0] as usize..level[1] as usize];
        assert!(errors.is_sorted_by(|a, b| a >= b), "{errors:?}");
    }
}

#[test]
fn what_a_file_holds_can_be_sorted_by_error_again() {
    for name in NAMES {
        for o in [&runs()[0], &runs()[3]] {
            let mesh = sample(name, 1500, 4);
            let input = mesh.to_input();
            let pm = build(mesh, o, &Quiet).unwrap().mesh;
            // Many chunks and bands.
            let how = EncodeOptions::default().with_chunk(Some(60));
            let read = decode(&encode(std::slice::from_ref(&pm), &[], &[], &how).unwrap()).unwrap();
            let read = &read.meshes[0];
            let sorted = read.sorted_by_error().unwrap();
            assert_falling(&sorted);
            assert_eq!(sorted.levels, pm.levels);
            let mut c = sorted.cursor().unwrap();
            c.seek(usize::MAX).unwrap();
            assert_same(&c.to_ordered_input(), &input);
            // At levels it is the mesh that it was; between them as valid.
            let mut was = read.cursor().unwrap();
            for &level in &pm.levels {
                c.seek(level as usize).unwrap();
                was.seek(level as usize).unwrap();
                assert_same(&c.to_ordered_input(), &was.to_ordered_input());
                c.seek(level as usize / 2).unwrap();
                assert_valid(&c);
            }
            if pm.levels.len() > 2 {
                continue;
            }
            // An error asked for takes no more splits than are larger, but for half an octave, to which files round.
            let mut built = pm.cursor().unwrap();
            for k in [0.9, 0.6, 0.3, 0.05] {
                let error = pm.splits.error[(pm.splits.len() as f64 * k) as usize] as f64;
                let larger = pm.splits.error.iter().filter(|&&e| 1.5 * e as f64 >= error).count();
                c.seek_error(error).unwrap();
                assert!(c.position() <= larger, "{name}: {} of {larger}", c.position());
                built.seek_error(error).unwrap();
                let exact = pm.splits.error.iter().filter(|&&e| e as f64 > error).count();
                assert!(c.position() >= exact, "{name}");
            }
        }
    }
}

#[test]
fn splits_of_equal_errors_come_evenly_and_after_those_they_need() {
    let mut pm = build(sample("scan", 3000, 3), &options(Method::Quadric, None), &Quiet).unwrap().mesh;
    pm.splits.error.fill(1.0);
    let order = pm.by_error();
    assert!(pm.reordered(&order).is_ok());
    // A half of them, whichever, is a half of each quarter.
    let n = order.len();
    let half = &order[..n / 2];
    for quarter in 0..4 {
        let range = n * quarter / 4..n * (quarter + 1) / 4;
        let there = half.iter().filter(|&&i| range.contains(&(i as usize))).count();
        // Those at the end need many of those before.
        assert!((n / 20..n / 4).contains(&there), "quarter {quarter}: {there} of {}", n / 4);
    }
    // Errors that rise along dependencies, as in a damaged mesh, and what is no number.
    for (i, e) in pm.splits.error.iter_mut().enumerate() {
        *e = if i % 7 == 0 { f32::NAN } else { i as f32 };
    }
    assert!(pm.reordered(&pm.by_error()).is_ok());
    // Damage is left alone.
    pm.splits.vertex[5] = u32::MAX;
    assert!(pm.sorted_by_error().is_none());
}

#[test]
fn with_a_normal_a_vertex_takes_less_than_64_bytes() {
    let s = generate("scan", &GenerateOptions::default().with_faces(4000)).unwrap();
    let mut input = input_of(&s);
    // Of each vertex one, and no two the same.
    let mut wedges = Wedges::new(vec![Channel::new(Semantic::Normal, 3)]).unwrap();
    for v in 0..input.positions.len() {
        let (y, x) = (v as f32 * 0.1).sin_cos();
        wedges.push(&[x, y, 0.0], 1);
    }
    wedges.corner.clone_from(&input.corners);
    input.wedges = Some(wedges);
    let mesh = Mesh::build(input, &BuildOptions::default()).unwrap().0;
    let bytes = |placement| {
        let pm = build(mesh.clone(), &options(Method::Quadric, Some(placement)), &Quiet).unwrap().mesh;
        assert_eq!(pm.splits.len() + pm.base_vertices(), mesh.vertex_count());
        pm.bytes() as f64 / pm.vertices() as f64
    };
    // References, code and error 18 B, place 12 B, normal of unit length 9 B; where collapses place vertices anew as much again for the one that is split. (On a grid it is less: `tests/compact.rs`.)
    let kept = bytes(Placement::Endpoint);
    assert!((39.0..40.0).contains(&kept), "{kept}");
    let moved = bytes(Placement::Optimal);
    assert!((58.0..62.0).contains(&moved), "{moved}");
}
