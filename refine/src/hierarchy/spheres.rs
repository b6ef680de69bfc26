//! Spheres and normal cones of all splits: proven, and nested.

use super::Finest;
use super::bounds::{Bounds, Packed, pack_up, unpack};
use super::cone::Cone;
use super::forest::Forest;
use crate::progressive::ProgressiveMesh;
use crate::view::NormalCone;

/// Bounds of all splits with errors of 0. O(n).
pub(super) fn around(pm: &ProgressiveMesh, forest: &Forest, finest: &Finest) -> Bounds {
    let Finest { positions, corners, origin, diagonal } = finest;
    let mut bounds = Bounds {
        origin: *origin,
        diagonal: *diagonal,
        of: vec![Packed::default(); forest.len()],
        ..Bounds::default()
    };
    // Added to radii at every level: rounding of centres and of what is decided about them never shows.
    let slack = diagonal * 1e-6;
    let mut radius = vec![0.0f64; positions.len()];
    let mut cone: Vec<Option<NormalCone>> = vec![None; positions.len()];
    for f in corners {
        let p = f.map(|v| positions[v as usize]);
        let normal = (p[1] - p[0]).cross(p[2] - p[0]);
        for k in 0..3 {
            let r = &mut radius[f[k] as usize];
            *r = r.max(p[k].distance(p[(k + 1) % 3])).max(p[k].distance(p[(k + 2) % 3]));
            // Faces without area show nothing.
            if normal.length_squared() > 0.0 {
                let own = NormalCone::new(normal, 0.0);
                let c = &mut cone[f[k] as usize];
                *c = Some(c.map_or(own, |c| c.join(&own)));
            }
        }
    }
    radius.iter_mut().for_each(|r| *r += slack);
    for i in (0..forest.len() as u32).rev() {
        let k = i as usize;
        let (vs, vu) = (pm.splits.vertex[k], forest.base_vertices + i);
        let place = |node: u32, v: u32| bounds.place(pm, forest, node, v).as_dvec3();
        let centre = place(forest.parent[k], vs);
        let [old, new] = forest.nodes(i);
        let reach = |node: u32, v: u32| centre.distance(place(node, v)) + radius[v as usize];
        let stored = pack_up(reach(old, vs).max(reach(new, vu)) + slack);
        let (vs, vu) = (vs as usize, vu as usize);
        radius[vs] = unpack(stored) as f64;
        let joined = match (cone[vs], cone[vu]) {
            (Some(a), Some(b)) => Some(a.join(&b)),
            (a, b) => a.or(b),
        };
        let own = joined.map_or(Cone::ALL, |c| Cone::around(&c));
        cone[vs] = joined.map(|_| own.unpack());
        bounds.of[k] = Packed { error: 0, radius: stored, cone: own };
    }
    bounds
}
