//! What a quadric does not see: the ends of thin parts.
//!
//! A quadric measures distances to planes, and planes have no end. The tip of a finger may slide down to its root and stay on the planes
//! of the finger's sides all the way; only the small cap resists. Where the faces around an edge look all ways, the distance of the
//! two vertices to the faces that come instead is measured, and the collapse waits until its turn comes at that cost.
//!
//! Distances to the faces around the edge are bounds from above: another part of the surface may lie nearer.

use crate::measure::triangle::closest;
use crate::validity::RingFace;
use glam::DVec3;

/// A part is thin where the sum of the normals of its faces, as vectors, is shorter than this part of their sum as lengths: 1 for a plane, 0.58
/// for the corner of a cube, 0 for a closed tube. Between 0.6 and 0.8 bunny, horse and fandisk hardly differ; at 0.9 the silhouettes of
/// a game character begin to lose, below 0.6 its fingers are no longer found.
const CONE: f64 = 0.6;
/// The part of the squared distance of a vertex that stands for the mean over the faces merged into it, which lie between it
/// and the new faces. Decided on pirate (0.5 to 1 gain its silhouettes 0.2 %), bunny, horse and fandisk, whose rms at 10 and 1 % changes by
/// less than 0.3 % and whose largest errors fall by up to a third.
const MEAN: f64 = 0.7;

/// Area times squared distance that goes, or zero where the part is not thin: `ring` are the faces around both ends of an edge that are to get
/// the apex `to`, `ends` the ends with the areas merged into them. O(ring).
#[inline]
pub(crate) fn loss(ring: &[RingFace], to: DVec3, ends: [(DVec3, f64); 2]) -> f64 {
    let (mut sum, mut lengths) = (DVec3::ZERO, 0.0);
    for f in ring {
        let n = (f.x - f.apex).cross(f.y - f.apex);
        sum += n;
        lengths += n.length();
    }
    if sum.length_squared() >= (CONE * lengths).powi(2) {
        return 0.0;
    }
    ends.iter().map(|&(p, area)| MEAN * area * distance_squared(p, ring, to)).sum()
}

/// To the nearest of the faces with the apex `to`; zero if there are none.
fn distance_squared(p: DVec3, ring: &[RingFace], to: DVec3) -> f64 {
    let least = ring.iter().map(|f| closest([to, f.x, f.y], p).d2).fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collapser::{Attempt, Collapser, Turn};
    use crate::options::{Options, Placement};
    use crate::work::Work;
    use progmesh_aif::Mesh;

    /// The faces from `apex` to a ring of four at height `z`, half a unit from the axis.
    fn cap(apex: DVec3, z: f64) -> Vec<RingFace> {
        let corner = |i: usize| {
            let (x, y) = [(0.5, 0.0), (0.0, 0.5), (-0.5, 0.0), (0.0, -0.5)][i % 4];
            DVec3::new(x, y, z)
        };
        (0..4).map(|i| RingFace { apex, x: corner(i), y: corner(i + 1) }).collect()
    }

    #[test]
    fn a_flat_part_loses_nothing() {
        let apex = DVec3::new(0.0, 0.0, 0.2);
        assert_eq!(loss(&cap(apex, 0.0), DVec3::ZERO, [(apex, 1.0), (DVec3::ZERO, 1.0)]), 0.0);
    }

    #[test]
    fn a_tip_loses_its_height_over_the_new_faces() {
        let tip = DVec3::new(0.0, 0.0, 5.0);
        let to = DVec3::new(0.0, 0.0, 1.0);
        let found = loss(&cap(tip, 0.0), to, [(tip, 2.0), (to, 3.0)]);
        assert!((found - MEAN * 2.0 * 16.0).abs() < 1e-12, "{found}");
    }

    /// A flat double pyramid over an octagon.
    fn lens() -> Mesh {
        let rim = |i: u32| {
            let (sin, cos) = (i as f32 * std::f32::consts::FRAC_PI_4).sin_cos();
            [cos, sin, 0.0]
        };
        let points: Vec<_> = (0..8).map(rim).chain([[0.0, 0.0, 0.05], [0.0, 0.0, -0.05]]).collect();
        let triangles: Vec<_> = (0..8).flat_map(|i| [[i, (i + 1) % 8, 8], [(i + 1) % 8, i, 9]]).collect();
        Mesh::from_triangles(points, &triangles).unwrap()
    }

    #[test]
    fn a_collapse_that_cuts_a_thin_rim_waits_for_its_turn() {
        let options = Options { placement: Some(Placement::Endpoint), ..Options::default() };
        let mut waited = 0;
        for e in lens().topology().edges() {
            let mut mesh = lens();
            let mut m = Collapser::new(Work::new(&mut mesh, &options).unwrap(), &options, 1.0);
            let Some(c) = m.evaluate(e) else { continue };
            let turn = |ceiling| Turn { ceiling, factor: 1e3, left: 0 };
            let due = (c.cost * 1e3) as f32;
            if let Attempt::Dearer(cost) = m.attempt(e, &c, turn(due)) {
                assert!(cost > due, "{cost} {due}");
                assert_eq!(m.attempt(e, &c, turn(cost)), Attempt::Done);
                waited += 1;
            }
        }
        assert_eq!(waited, 8, "along the rim");
    }

    #[test]
    fn nothing_is_lost_where_nothing_is() {
        assert_eq!(loss(&[], DVec3::ONE, [(DVec3::ZERO, 1.0), (DVec3::ONE, 1.0)]), 0.0);
    }
}
