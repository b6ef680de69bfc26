//! Spheres and normal cones of all splits: proven, and nested.

use super::Finest;
use super::bounds::{Bounds, Packed, pack_up, unpack};
use super::cone::Cone;
use super::forest::Forest;
use crate::progressive::ProgressiveMesh;
use crate::view::NormalCone;
use glam::DVec3;

/// What a split bounds beyond the faces around the vertices that come of it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Extent {
    /// A distance from the vertex that it splits.
    radius: f64,
    cone: Option<NormalCone>,
}

impl Extent {
    pub(super) fn beyond(radius: f64, cone: NormalCone) -> Extent {
        Extent { radius, cone: Some(cone) }
    }

    #[inline]
    pub(super) fn reach(&mut self, distance: f64) {
        self.radius = self.radius.max(distance);
    }

    #[inline]
    pub(super) fn turn(&mut self, cone: &NormalCone) {
        self.cone = Some(self.cone.map_or(*cone, |c| c.join(cone)));
    }

    /// A face with this normal, of unit length; 0 for none.
    #[inline]
    pub(super) fn face(&mut self, normal: DVec3) {
        // Well within: most are.
        let inside = |c: &NormalCone| c.axis().dot(normal) > (c.half_angle() * (1.0 - 1e-6)).cos();
        if normal != DVec3::ZERO && !self.cone.as_ref().is_some_and(inside) {
            self.turn(&NormalCone::new(normal, 0.0));
        }
    }
}

/// For every vertex of the finest mesh the least cone of the normals around it.
pub(super) fn vertex_cones(finest: &Finest) -> Vec<Option<NormalCone>> {
    let Finest { positions, corners, .. } = finest;
    let mut cone: Vec<Option<NormalCone>> = vec![None; positions.len()];
    for f in corners {
        let p = f.map(|v| positions[v as usize]);
        let normal = (p[1] - p[0]).cross(p[2] - p[0]);
        // Faces without area show nothing.
        if normal.length_squared() > 0.0 {
            let own = NormalCone::new(normal, 0.0);
            for v in f {
                let c = &mut cone[*v as usize];
                *c = Some(c.map_or(own, |c| c.join(&own)));
            }
        }
    }
    cone
}

/// Bounds of all splits with errors of 0, of the faces around the vertices that come of each and of its extent, if any are given. O(n).
pub(super) fn around(pm: &ProgressiveMesh, forest: &Forest, finest: &Finest, extents: &[Extent]) -> Bounds {
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
    let mut cone = vertex_cones(finest);
    for f in corners {
        let p = f.map(|v| positions[v as usize]);
        for k in 0..3 {
            let r = &mut radius[f[k] as usize];
            *r = r.max(p[k].distance(p[(k + 1) % 3])).max(p[k].distance(p[(k + 2) % 3]));
        }
    }
    radius.iter_mut().for_each(|r| *r += slack);
    for i in (0..forest.len() as u32).rev() {
        let k = i as usize;
        let (vs, vu) = (pm.splits.vertex[k], forest.base_vertices + i);
        let place = |node: u32, v: u32| bounds.local(forest.position(pm, node, v)).as_dvec3();
        let centre = bounds.place_before(pm, forest, i).as_dvec3();
        let [old, new] = forest.nodes(i);
        let reach = |node: u32, v: u32| centre.distance(place(node, v)) + radius[v as usize];
        let extent = extents.get(k).copied().unwrap_or_default();
        let stored = pack_up(reach(old, vs).max(reach(new, vu)).max(extent.radius) + slack);
        let (vs, vu) = (vs as usize, vu as usize);
        radius[vs] = unpack(stored) as f64;
        let joined = [cone[vs], cone[vu], extent.cone].into_iter().flatten().reduce(|a, b| a.join(&b));
        let own = joined.map_or(Cone::ALL, |c| Cone::around(&c));
        cone[vs] = joined.map(|_| own.unpack());
        bounds.of[k] = Packed { error: 0, radius: stored, cone: own };
    }
    bounds
}
