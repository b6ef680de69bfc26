//! Heat maps of a comparison: a coloured mesh, a picture, a page.

use super::{Flattened, distances_of};
use crate::aif::{Channel, Encoding, MeshInput, Positions, Semantic, TooManyChannels, Wedges};
use crate::normals::{self, DEFAULT_CREASE, Normals};
use crate::report::{self, Page, Picture, Scale, Table, Titles, View, heat_color, heat_panels};
use crate::scene::{Scene, SceneMesh};
use crate::simplify::measure::Surface;
use glam::DVec3;
use rustc_hash::FxHashMap;

/// The attribute of vertices that holds the distance. MeshLab shows a property of this name.
pub const DISTANCE: &str = "quality";

/// A as one mesh in the world, each vertex coloured by its distance from B and with the distance as the attribute `quality`.
///
/// Edges that are long, or along which the distance is not nearly linear, are cut, so that colours between vertices are those of the distance;
/// the surface stays the same. Other attributes and materials are left out. With `linear` colours are linear light, as glTF has them,
/// and normals are added; otherwise they are sRGB bytes, as PLY has them by custom.
pub fn heat_scene(a: &Flattened, b: &Surface, scale: &Scale, linear: bool) -> Result<Scene, TooManyChannels> {
    let (points, triangles) = refined(a, b, scale);
    let values = distances_of(&points, b);
    let mut color = Channel::new(Semantic::Color(0), 3);
    color.encoding = Encoding::U8Norm;
    let mut wedges = Wedges::new(vec![color, Channel::new(Semantic::Custom(DISTANCE.into()), 1)])?;
    for &v in &values {
        let [r, g, b] = heat_color(scale.part(v)).map(|c| {
            let c = if linear { report::linear(c) } else { c };
            (c * 255.0).round() as f32 / 255.0
        });
        wedges.push(&[r, g, b, v as f32], 0b11);
    }
    wedges.corner = triangles.as_flattened().to_vec();
    let positions = match &a.positions {
        Positions::F32(_) => Positions::F32(points.iter().map(|p| p.to_array().map(|x| x as f32)).collect()),
        Positions::F64(_) => Positions::F64(points.iter().map(|p| p.to_array()).collect()),
    };
    let mut geometry = MeshInput::triangles(positions, &triangles);
    geometry.wedges = Some(wedges);
    if linear {
        normals::apply(&mut geometry, Normals::Recompute { crease: DEFAULT_CREASE })?;
    }
    Ok(Scene::from_mesh(SceneMesh { name: Some("distance".into()), geometry, ..Default::default() }))
}

/// Edges longer than this part of the diagonal are cut whatever the distance does, for it may do something between; shorter than `SHORT`, never.
const LONG: f64 = 1.0 / 48.0;
const SHORT: f64 = 1.0 / 250.0;
/// Of the scale: how far the distance in the middle of an edge may be from the mean of its ends.
const OFF: f64 = 0.05;
/// No cutting beyond so many vertices: a coloured mesh is to be looked at.
const MOST: usize = 2_000_000;
/// Each round halves edges: from any length below the diagonal to `SHORT`.
const ROUNDS: usize = 9;

/// The vertices and triangles of A, and more where colours need them.
fn refined(a: &Flattened, b: &Surface, scale: &Scale) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut points, mut triangles) = in_use(a);
    let diagonal = a.surface.diagonal();
    // Edges known to need no cut, and those cut in this round: their middle.
    let mut edges: FxHashMap<[u32; 2], Option<u32>> = FxHashMap::default();
    let mut values = distances_of(&points, b);
    for _ in 0..ROUNDS {
        let mut candidates = Vec::new();
        for t in &triangles {
            for k in 0..3 {
                let edge = sorted(t[k], t[(k + 1) % 3]);
                let length = points[edge[0] as usize].distance(points[edge[1] as usize]);
                if length > SHORT * diagonal && !edges.contains_key(&edge) {
                    edges.insert(edge, None);
                    candidates.push((edge, length > LONG * diagonal));
                }
            }
        }
        let middle = |[u, v]: [u32; 2]| 0.5 * points[u as usize] + 0.5 * points[v as usize];
        let middles: Vec<DVec3> = candidates.iter().map(|c| middle(c.0)).collect();
        let between = distances_of(&middles, b);
        let mut cut = false;
        for (((edge, long), p), d) in candidates.into_iter().zip(middles).zip(between) {
            let mean = 0.5 * (values[edge[0] as usize] + values[edge[1] as usize]);
            if points.len() < MOST && (long || (d - mean).abs() > OFF * scale.top) {
                edges.insert(edge, Some(points.len() as u32));
                points.push(p);
                values.push(d);
                cut = true;
            }
        }
        if !cut {
            break;
        }
        let mut next = Vec::with_capacity(triangles.len());
        for t in triangles {
            let middles = [0, 1, 2].map(|k| edges.get(&sorted(t[k], t[(k + 1) % 3])).copied().flatten());
            split(t, middles, &mut next);
        }
        triangles = next;
    }
    (points, triangles)
}

/// The vertices that triangles have, by first use.
fn in_use(a: &Flattened) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut number = vec![u32::MAX; a.positions.len()];
    let mut points = Vec::new();
    let mut renamed = |v: u32| {
        let n = &mut number[v as usize];
        if *n == u32::MAX {
            *n = points.len() as u32;
            points.push(a.positions.get(v as usize));
        }
        *n
    };
    let triangles = a.triangles.iter().map(|t| t.map(&mut renamed)).collect();
    (points, triangles)
}

fn sorted(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// The parts of a triangle whose edges (from corner k to the next) are cut at these vertices.
fn split(t: [u32; 3], middles: [Option<u32>; 3], out: &mut Vec<[u32; 3]>) {
    let cuts = middles.iter().flatten().count();
    // Turned so that the first edge is cut, and with two, the second too.
    let first = (0..3).find(|&k| match cuts {
        2 => middles[k].is_some() && middles[(k + 1) % 3].is_some(),
        _ => middles[k].is_some(),
    });
    let Some(k) = first else {
        out.push(t);
        return;
    };
    let [a, b, c] = [0, 1, 2].map(|i| t[(k + i) % 3]);
    match [0, 1, 2].map(|i| middles[(k + i) % 3]) {
        [Some(ab), Some(bc), Some(ca)] => {
            out.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        [Some(ab), Some(bc), None] => out.extend([[a, ab, bc], [ab, b, bc], [a, bc, c]]),
        [Some(ab), ..] => out.extend([[a, ab, c], [ab, b, c]]),
        _ => out.push(t),
    }
}

/// Two scenes and what is between them, to be drawn.
#[derive(Clone, Copy, Debug)]
pub struct Pair<'a> {
    /// A and B.
    pub drawn: [&'a report::Surface; 2],
    /// B, to measure to.
    pub b: &'a Surface,
    /// The names of A and B.
    pub names: [&'a str; 2],
    /// The colours.
    pub scale: &'a Scale,
}

/// Sides of a panel, pixels.
const PANEL: (u32, u32) = (480, 400);

impl Pair<'_> {
    fn panels(&self, view: &View) -> Picture {
        let titles = Titles { a: self.names[0], b: self.names[1], heat: "distance of A from B" };
        heat_panels(self.drawn, titles, view, self.scale, |points| {
            let mut query = self.b.query();
            points.iter().map(|&p| query.distance(p)).collect()
        })
    }

    fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let [a, b] = self.drawn.map(report::Surface::bounds);
        match (a, b) {
            (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
            (a, b) => a.or(b),
        }
    }
}

/// A, B and the heat map on A side by side, from the same camera, half from the front, the right and above (y is up).
pub fn heat_picture(pair: &Pair<'_>) -> Picture {
    pair.panels(&View::three_quarter(pair.bounds(), PANEL.0, PANEL.1).tightened_to(&pair.drawn))
}

/// A page of everything: tables, and pictures from seven sides.
pub fn heat_page(pair: &Pair<'_>, tables: &[Table]) -> Page {
    let mut page = Page::new(&format!("{} and {}", pair.names[0], pair.names[1]));
    page.paragraph(&format!(
        "A is {}, B is {}. Left A, in the middle B, right A in the colours of its distance from B, at every pixel.",
        pair.names[0], pair.names[1]
    ));
    page.picture(&heat_picture(pair), "half from the front, the right and above");
    page.heading("Measures");
    tables.iter().for_each(|t| page.table(t));
    page.heading("From six sides");
    let sides = ["right (+x)", "left (-x)", "above (+y)", "below (-y)", "the front (+z)", "behind (-z)"];
    let draw = |view: View| pair.panels(&view.tightened_to(&pair.drawn));
    let views = View::axes(pair.bounds(), PANEL.1);
    #[cfg(feature = "parallel")]
    let pictures: Vec<Picture> = {
        use rayon::prelude::*;
        views.into_par_iter().map(draw).collect()
    };
    #[cfg(not(feature = "parallel"))]
    let pictures: Vec<Picture> = views.into_iter().map(draw).collect();
    for (picture, side) in pictures.iter().zip(sides) {
        page.picture(picture, &format!("from {side}"));
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_triangle_cover_it_and_keep_its_orientation() {
        let points = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| points[v as usize]);
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        for bits in 0..8u32 {
            let middles = [0, 1, 2].map(|k| (bits >> k & 1 == 1).then_some(3 + k));
            let mut parts = vec![];
            split([0, 1, 2], middles, &mut parts);
            assert_eq!(parts.len(), 1 + bits.count_ones() as usize);
            let areas: Vec<f64> = parts.iter().map(area).collect();
            assert!(areas.iter().all(|&a| a > 0.0) && areas.iter().sum::<f64>() == 16.0, "{bits}: {areas:?}");
        }
    }
}
