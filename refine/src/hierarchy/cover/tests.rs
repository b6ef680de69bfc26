use super::shapes::{area, convex_hull, join};
use super::*;
use crate::aif::{BuildOptions, Mesh, MeshInput, Positions};
use crate::hierarchy::{Rule, estimate, finest, order};
use crate::progressive::build;
use crate::simplify::{Options as Simplify, Quiet};
use progmesh_meshes::{GenerateOptions, generate};

const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]];

#[test]
fn the_hull_is_the_least_convex_polygon_in_turn() {
    let mut points = [&SQUARE[..], &[[0.25, 0.25], [0.25, 0.0], [0.5, 0.25]]].concat();
    convex_hull(&mut points);
    assert_eq!(points, SQUARE);
    assert_eq!(area(&points), 0.5);
    let mut line = vec![[0.0, 0.0], [0.5, 0.5], [0.25, 0.25]];
    convex_hull(&mut line);
    assert_eq!(area(&line), 0.0);
}

#[test]
fn shapes_that_are_convex_together_are_joined_and_no_others() {
    let shift = |x: f64, y: f64| SQUARE.map(|p| [p[0] + x, p[1] + y]).to_vec();
    let mut row = vec![shift(0.0, 0.0), shift(1.0, 0.0), shift(0.5, 0.0)];
    join(&mut row);
    assert_eq!(row, [vec![[0.0, 0.0], [1.5, 0.0], [1.5, 0.5], [0.0, 0.5]]]);
    let mut corner = vec![shift(0.0, 0.0), shift(0.5, 0.0), shift(0.0, 0.5)];
    join(&mut corner);
    assert_eq!(corner.len(), 2);
}

fn holds(polygon: &[[f64; 2]], p: [f64; 2]) -> bool {
    let turn = |k: usize| {
        let (a, b) = (polygon[k], polygon[(k + 1) % polygon.len()]);
        (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    };
    let turns = || (0..polygon.len()).map(turn);
    // One that is no larger than rounding lies on all sides of everything.
    area(polygon) > 1e-8 && (turns().all(|t| t > -1e-9) || turns().all(|t| t < 1e-9))
}

/// A polygon and the triangle that it is put on.
type Placed = (Vec<[f64; 2]>, [DVec3; 3]);

#[test]
fn every_place_lies_in_a_piece_that_is_as_near_to_its_face_as_was_said() {
    for name in ["scan", "cad", "torus"] {
        let s = generate(name, &GenerateOptions::default().with_faces(500)).unwrap();
        let input = MeshInput {
            positions: Positions::from_f64(s.positions),
            face_sizes: s.face_sizes,
            corners: s.corners,
            ..Default::default()
        };
        let mesh = Mesh::build(input, &BuildOptions::default()).unwrap().0;
        let mut pm = build(mesh, &Simplify::default(), &Quiet).unwrap().mesh;
        let (forest, front, _) = finest(&pm, Rule::Rings).unwrap();
        let full = Finest::new(&pm, &forest, &front);
        let diagonal = full.diagonal;
        let errors = estimate::errors(&pm, &forest, front.clone(), &full);
        pm = pm.reordered(&order::by_errors(&pm, &forest, front, full, &errors)).unwrap();
        let (forest, front, turns) = finest(&pm, Rule::Rings).unwrap();
        assert!(turns.is_some());
        let whole = Finest::new(&pm, &forest, &front);
        let mut walk = Walk::new(&pm, &forest, front, &whole);
        let mut worst = 0.0f64;
        for i in (0..forest.len() as u32).rev() {
            let error = walk.undo(i, 0.0, &mut Extent::default(), None);
            worst = worst.max(error);
            if i % 40 != 0 {
                continue;
            }
            // Of every face the polygons that it lies in, with the triangle that each is put on.
            let mut polygons: Vec<Vec<Placed>> = vec![Vec::new(); whole.corners.len()];
            for (slot, &[mut face, mut piece]) in walk.first.iter().enumerate() {
                let at = |w: u32| walk.positions[walk.front.wedge_vertex(w) as usize];
                while face != NONE {
                    let triangle = walk.front.corners()[slot].map(at);
                    polygons[face as usize].push((WHOLE.to_vec(), triangle));
                    face = walk.next[face as usize];
                }
                while piece != NONE {
                    let triangle = walk.front.corners()[slot].map(at);
                    let p = &walk.pieces[piece as usize];
                    polygons[p.face as usize].push((p.at[..p.len as usize].to_vec(), triangle));
                    piece = p.next;
                }
            }
            let full = |f: &usize| whole.corners[*f][0] != whole.corners[*f][1];
            for (face, polygons) in polygons.iter().enumerate().filter(|(f, _)| full(f)) {
                for k in 0..12u32 {
                    let (u, v) = ((0.37 * k as f64 + 0.11).fract(), (0.71 * k as f64 + 0.03).fract());
                    let p = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
                    let on: Vec<_> = polygons.iter().filter(|(polygon, _)| holds(polygon, p)).collect();
                    assert!(
                        !on.is_empty(),
                        "{name}: {p:?} of face {face} lies nowhere after {i}: {polygons:?}"
                    );
                    for (_, triangle) in on {
                        let d = closest_on_triangle(*triangle, whole.at(face as u32, p)).1.sqrt();
                        assert!(d <= worst + 1e-9 * diagonal, "{name}: {d} beyond {worst}");
                    }
                }
            }
        }
        assert!(worst > 1e-3 * diagonal || name == "cad");
    }
}
