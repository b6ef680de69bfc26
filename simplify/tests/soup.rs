//! Whatever can be built can be simplified, by every method and option: no panic, and a mesh comes out.

mod common;

use progmesh_aif::*;
use progmesh_simplify::*;
use proptest::prelude::*;

#[derive(Clone, Debug)]
struct Soup {
    points: Vec<[i8; 3]>,
    scale: f32,
    faces: Vec<Vec<u32>>,
    wires: Vec<[u32; 2]>,
    /// For every face: material, group, and which wedges its corners take.
    tags: Vec<(u32, u32, u32)>,
    wedges: bool,
}

impl Soup {
    fn mesh(&self) -> Mesh {
        let sizes: Vec<u32> = self.faces.iter().map(|f| f.len() as u32).collect();
        let points: Vec<_> = self.points.iter().map(|p| p.map(|x| x as f32 * self.scale)).collect();
        let mut input = MeshInput::polygons(points, &sizes, &self.faces.concat());
        input.wires = self.wires.clone();
        let tag = |i: usize| self.tags[i % self.tags.len()];
        let none_is_9 = |x: u32| if x == 9 { NONE } else { x };
        input.face_material = (0..sizes.len()).map(|i| none_is_9(tag(i).0)).collect();
        input.face_group = (0..sizes.len()).map(|i| none_is_9(tag(i).1)).collect();
        if self.wedges {
            let semantics = [
                (Semantic::Normal, 3),
                (Semantic::Tangent, 4),
                (Semantic::TexCoord(0), 2),
                (Semantic::Joints(0), 4),
                (Semantic::Weights(0), 4),
            ];
            let channels = semantics.map(|(s, n)| Channel::new(s, n)).to_vec();
            let mut w = Wedges::new(channels).unwrap();
            for i in 0..6u32 {
                let row: Vec<f32> = (0..17).map(|k| ((i * 5 + k * 3) % 7) as f32 / 7.0).collect();
                w.push(&row, [31, 31, 31, 5, 0, 26][i as usize]);
            }
            for (i, f) in self.faces.iter().enumerate() {
                w.corner.extend(f.iter().map(|&v| match (v + tag(i).2) % 7 {
                    6 => NONE,
                    k => k,
                }));
            }
            input.wedges = Some(w);
        }
        Mesh::build(input, &BuildOptions::default()).unwrap().0
    }
}

fn tags() -> impl Strategy<Value = Vec<(u32, u32, u32)>> {
    let one = (
        prop_oneof![4 => Just(0u32), 1 => 1u32..3, 1 => Just(9)],
        prop_oneof![6 => Just(0u32), 1 => Just(9)],
        0u32..3,
    );
    prop::collection::vec(one, 1..8)
}

/// Any faces over few vertices: repeated, degenerate, with many faces at an edge.
fn wild() -> impl Strategy<Value = Soup> {
    (3u32..24).prop_flat_map(|n| {
        let points = prop::collection::vec([-3i8..4, -3i8..4, -3i8..4], n as usize);
        let faces = prop::collection::vec(
            prop_oneof![4 => prop::collection::vec(0..n, 3), 1 => prop::collection::vec(0..n, 0..7)],
            0..60,
        );
        let wires = prop::collection::vec([0..n, 0..n], 0..4);
        let scale = prop::sample::select(vec![1.0f32, 1e-30, 1e-44, 1e37]);
        (points, faces, wires, scale, tags(), any::<bool>()).prop_map(
            |(points, faces, wires, scale, tags, wedges)| Soup { points, scale, faces, wires, tags, wedges },
        )
    })
}

/// A closed or open surface that has been damaged: faces left out, turned, doubled, vertices joined, points moved together.
fn damaged() -> impl Strategy<Value = Soup> {
    let damage = prop::collection::vec((0u8..5, any::<u32>(), any::<u32>()), 0..12);
    (prop::sample::select(vec!["sphere", "torus", "terrain"]), 20usize..250, damage, tags(), any::<bool>())
        .prop_map(|(name, faces, damage, tags, wedges)| {
            let m = common::sample(name, faces, 1);
            let mut triangles: Vec<Vec<u32>> = m.triangles().iter().map(|t| t.to_vec()).collect();
            let mut points: Vec<_> = m
                .positions()
                .iter()
                .map(|p| {
                    (p * 100.0)
                        .clamp(-(glam::DVec3::splat(127.0)), glam::DVec3::splat(127.0))
                        .to_array()
                        .map(|x| x as i8)
                })
                .collect();
            for (what, a, b) in damage {
                let (f, v, u) =
                    (a as usize % triangles.len(), a as usize % points.len(), b as usize % points.len());
                match what {
                    0 if triangles.len() > 1 => drop(triangles.swap_remove(f)),
                    1 => triangles[f].reverse(),
                    2 => triangles.push(triangles[f].clone()),
                    3 => {
                        triangles.iter_mut().flatten().filter(|x| **x == v as u32).for_each(|x| *x = u as u32)
                    }
                    _ => points[v] = points[u],
                }
            }
            Soup { points, scale: 0.01, faces: triangles, wires: Vec::new(), tags, wedges }
        })
}

fn any_options() -> impl Strategy<Value = Options> {
    let methods = prop::sample::select(vec![Method::Nsa, Method::Quadric, Method::Quadric, Method::Cluster]);
    let placements = prop::sample::select(vec![
        None,
        Some(Placement::Endpoint),
        Some(Placement::Midpoint),
        Some(Placement::Optimal),
    ]);
    let schedules = prop::sample::select(vec![None, Some(Schedule::Exact), Some(Schedule::Bulk)]);
    let target = prop_oneof![
        Just((None, None)),
        (0usize..80).prop_map(|t| (Some(t), None)),
        (0.0f64..=1.0).prop_map(|r| (None, Some(r)))
    ];
    let bound = prop::option::weighted(0.3, (0.0f64..0.5, any::<bool>()));
    let flags = (
        any::<bool>(),
        any::<bool>(),
        prop::option::weighted(0.2, 0.0f64..0.6),
        prop::option::weighted(0.3, 1usize..4),
    );
    let locks = (
        prop::collection::vec(0usize..40, 0..4),
        prop::collection::vec(0u32..3, 0..2),
        prop::collection::vec(0u32..2, 0..2),
    );
    (methods, placements, schedules, target, bound, flags, locks).prop_map(
        |(
            method,
            placement,
            schedule,
            (triangles, ratio),
            bound,
            (border, keep, prune, passes),
            (vertices, materials, groups),
        )| {
            let mut o = Options::default();
            (o.method, o.placement, o.schedule) = (method, placement, schedule);
            (o.triangles, o.ratio) = (triangles, ratio);
            o.max_error = bound.map(|(value, relative)| MaxError { value, relative });
            (o.lock_border, o.keep_vertices, o.prune, o.passes) = (border, keep, prune, passes);
            vertices.iter().for_each(|&v| o.locked_vertices.set(v));
            (o.locked_materials, o.locked_groups) = (materials, groups);
            o.epsilon = Some(60.0);
            o
        },
    )
}

/// Euler characteristic without isolated vertices, border loops, components, genus, complex edges, dangling edges.
fn shape(m: &Mesh) -> (i64, usize, usize, Option<usize>, usize, usize) {
    let t = m.topology();
    let isolated = t.vertices().filter(|&v| t.star(v).is_empty()).count();
    let (euler, loops, components, genus) = common::topology_of(m);
    let with = |test: fn(usize) -> bool| t.edges().filter(|&e| test(t.edge_faces(e).len())).count();
    (euler - isolated as i64, loops, components, genus, with(|n| n > 2), with(|n| n == 0))
}

fn works(soup: &Soup, options: &Options, weigh: bool) -> Result<(), TestCaseError> {
    let input = soup.mesh();
    let mut o = options.clone();
    if weigh {
        o.vertex_weights =
            (0..input.topology().vertex_slots()).map(|v| [0.0, 1.0, 50.0, 1e30][v % 4]).collect();
    }
    let mut m = input.clone();
    let out = simplify(&mut m, &o, &Quiet).unwrap();
    prop_assert_eq!(m.check(), Ok(()));
    prop_assert_eq!(
        (out.faces_out, out.triangles_out, out.vertices_out),
        (m.face_count(), m.triangle_count(), m.vertex_count())
    );
    prop_assert_eq!(out.faces_in, input.face_count());
    prop_assert!(m.triangle_count() <= input.triangle_count());
    prop_assert!(m.positions().iter().all(|p| p.is_finite()));
    prop_assert!(
        m.wedges().is_none_or(|w| (0..w.len() as u32).all(|i| w.row(i).iter().all(|x| x.is_finite())))
    );
    if o.keep_vertices {
        prop_assert_eq!(m.positions(), input.positions());
    }
    if o.method != Method::Cluster && o.prune.is_none() {
        // Cutting a polygon may use an edge that is there already; collapses change nothing.
        let cut = if o.method == Method::Quadric {
            input.clone().triangulate().unwrap().mesh
        } else {
            input.clone()
        };
        prop_assert_eq!(shape(&m), shape(&cut));
    }
    // The count asked for decides: with a target, that is why it stops, or there is a reason not to go on.
    let goal = o.triangles.or(o.ratio.map(|r| (r * input.triangle_count() as f64).round() as usize));
    if out.stop == Stop::Target {
        prop_assert!(m.triangle_count() <= goal.unwrap_or(0));
    }
    // Nothing depends on chance.
    let mut again = input;
    simplify(&mut again, &o, &Quiet).unwrap();
    prop_assert_eq!(m.positions(), again.positions());
    prop_assert_eq!(m.to_input().corners, again.to_input().corners);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn any_soup_by_any_way(soup in wild(), options in any_options(), weigh in any::<bool>()) {
        works(&soup, &options, weigh)?;
    }

    #[test]
    fn any_damaged_surface_by_any_way(soup in damaged(), options in any_options(), weigh in any::<bool>()) {
        works(&soup, &options, weigh)?;
    }
}
