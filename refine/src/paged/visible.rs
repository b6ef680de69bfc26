//! Which of the vertices shown a frustum holds. Few are looked at: splits that follow each other are close together, so boxes about 64 of them, and about all of a page, tell of most.

use super::PagedView;
use super::page::Page;
use crate::aif::NONE;
use crate::format::ByteRanges;
use crate::view::{Frustum, PlaneName, Planes};
use glam::{DMat4, DVec3, Vec3};

/// Splits whose new vertices are in a box of their own.
pub(super) const EACH: usize = 64;

/// A box about places that holds them all, in f32; NaN if a place is not finite.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    low: Vec3,
    high: Vec3,
}

impl Extent {
    const NOTHING: Extent = Extent { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };
    const ANY: Extent = Extent { low: Vec3::NAN, high: Vec3::NAN };

    fn with(self, p: DVec3) -> Extent {
        let at = p.as_vec3();
        // A place of half the bits is as it is, others have been rounded.
        let (low, high) =
            if at.as_dvec3() == p { (at, at) } else { (at.map(f32::next_down), at.map(f32::next_up)) };
        self.and(if at.is_finite() { Extent { low, high } } else { Extent::ANY })
    }

    fn and(self, other: Extent) -> Extent {
        let nan = self.low.is_nan() || other.low.is_nan();
        let all = Extent { low: self.low.min(other.low), high: self.high.max(other.high) };
        if nan { Extent::ANY } else { all }
    }
}

/// The boxes about every [`EACH`] of places, the last about them all.
pub(super) fn boxes(places: impl ExactSizeIterator<Item = DVec3>) -> Vec<Extent> {
    let mut all = Vec::with_capacity(places.len().div_ceil(EACH) + 1);
    let (mut whole, mut own) = (Extent::NOTHING, Extent::NOTHING);
    let count = places.len();
    for (k, p) in places.enumerate() {
        own = own.with(p);
        if k % EACH == EACH - 1 || k + 1 == count {
            all.push(own);
            whole = whole.and(own);
            own = Extent::NOTHING;
        }
    }
    all.push(whole);
    all
}

/// A frustum in the space of a mesh that stands somewhere.
struct Seen<'a> {
    frustum: &'a Frustum,
    placed: &'a DMat4,
    /// Of every plane its direction there, how far the mesh's origin is inside, and what bounds the terms that either is a sum of: of the coordinates' factors, and of the rest.
    planes: [(DVec3, f64, DVec3, f64); 6],
}

/// Sums of a dozen products are off by less than this part of their terms' sum, with a margin of a hundred.
const ROUNDING: f64 = 1e-13;

impl<'a> Seen<'a> {
    fn new(frustum: &'a Frustum, placed: &'a DMat4) -> Self {
        let [x, y, z, t] = [placed.x_axis, placed.y_axis, placed.z_axis, placed.w_axis].map(|c| c.truncate());
        let o = frustum.origin();
        let planes = frustum.planes().map(|p| {
            let (n, a) = (p.normal, p.normal.abs());
            let turned = DVec3::new(n.dot(x), n.dot(y), n.dot(z));
            let terms = DVec3::new(a.dot(x.abs()), a.dot(y.abs()), a.dot(z.abs()));
            (turned, n.dot(t - o) + p.offset, terms, a.dot(t.abs() + o.abs()) + p.offset.abs())
        });
        Seen { frustum, placed, planes }
    }

    /// The vertex at `p` is not outside of any of these planes.
    #[inline]
    fn holds(&self, p: DVec3, planes: Planes) -> bool {
        let at = self.placed.transform_point3(p);
        PlaneName::ALL.iter().all(|&k| !planes.has(k) || self.frustum.distance(k, at) >= 0.0)
    }

    /// Places whose coordinates are no larger than these come to stand at finite ones.
    fn is_finite_at(&self, far: DVec3) -> bool {
        let [x, y, z, t] = [self.placed.x_axis, self.placed.y_axis, self.placed.z_axis, self.placed.w_axis]
            .map(|c| c.truncate().abs());
        (far.x * x + far.y * y + far.z * z + t + self.frustum.origin().abs()).is_finite()
    }

    /// Of these planes those that vertices in a box may be outside of; `None` if all are outside of one. However it is rounded, [`Seen::holds`] says so of each.
    fn cut_by(&self, e: &Extent, planes: Planes) -> Option<Planes> {
        let (low, high) = (e.low.as_dvec3(), e.high.as_dvec3());
        let (centre, half) = (0.5 * (low + high), 0.5 * (high - low));
        let far = low.abs().max(high.abs());
        let mut left = planes;
        for (k, (normal, offset, terms, rest)) in PlaneName::ALL.into_iter().zip(self.planes) {
            if !planes.has(k) {
                continue;
            }
            let (at, reach) = (normal.dot(centre) + offset, normal.abs().dot(half));
            let margin = ROUNDING * (terms.dot(far) + rest);
            if at + reach < -margin {
                return None;
            }
            // A plane at infinity has everything inside that is not there itself.
            let beyond = at == f64::INFINITY && normal == DVec3::ZERO;
            if at - reach > margin || (beyond && self.is_finite_at(far)) {
                left = left.without(k);
            }
        }
        Some(left)
    }
}

impl<S: ByteRanges> PagedView<S> {
    /// How many of the vertices shown a frustum holds ([`Frustum::contains`]) when the mesh stands in these places, those of each counted. O(splits of resident pages / 64, and
    /// vertices near the frustum's planes); O(vertices shown) where splits move vertices.
    pub fn visible(&self, frustum: &Frustum, places: &[DMat4]) -> usize {
        let seen: Vec<Seen<'_>> = places.iter().map(|m| Seen::new(frustum, m)).collect();
        let of_all = |p: DVec3| seen.iter().filter(|s| s.holds(p, Planes::ALL)).count();
        let n0 = self.shelf.head.base_vertices;
        let base = (0..n0).filter_map(|v| self.position(v)).map(of_all).sum::<usize>();
        let made = match self.shelf.moves {
            true => {
                let vertices = self.shelf.all().flat_map(|p| self.places_of(p));
                vertices.map(of_all).sum::<usize>()
            }
            false => {
                let of_page = |s, p: &Page| held(&p.there, &p.boxes, s, |k| p.place(k));
                seen.iter().map(|s| self.shelf.all().map(|p| of_page(s, p)).sum::<usize>()).sum()
            }
        };
        base + made
    }

    /// Where the vertices that a page makes stand, of those shown.
    fn places_of<'a>(&'a self, page: &'a Page) -> impl Iterator<Item = DVec3> + 'a {
        let shelf = &self.shelf;
        page.vertices().filter_map(move |i| {
            let k = (i - page.first) as usize;
            let node = shelf.pool.get(*page.hot.get(k)?).map_or(NONE, |h| h.node);
            match node {
                NONE => None,
                // As it was made.
                own if own == shelf.head.base_vertices + 2 * i + 1 => Some(page.place(k)),
                other => shelf.position(other).ok(),
            }
        })
    }
}

/// Of vertices, a bit each, those that are held and there, by their boxes and their places.
fn held(there: &[u64], boxes: &[Extent], seen: &Seen<'_>, place: impl Fn(usize) -> DVec3) -> usize {
    let Some((whole, boxes)) = boxes.split_last() else { return 0 };
    let Some(planes) = seen.cut_by(whole, Planes::ALL) else { return 0 };
    let mut sum = 0;
    for (k, (&there, own)) in there.iter().zip(boxes).enumerate().filter(|(_, (t, _))| **t != 0) {
        let planes = if planes.is_empty() { Some(planes) } else { seen.cut_by(own, planes) };
        sum += match planes {
            None => 0,
            Some(planes) if planes.is_empty() => there.count_ones() as usize,
            Some(planes) => {
                let held = |bit: usize| there >> bit & 1 != 0 && seen.holds(place(EACH * k + bit), planes);
                (0..EACH).filter(|&bit| held(bit)).count()
            }
        };
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Camera, CameraParameters, Projection};
    use proptest::prelude::*;

    /// One of some numbers, so that places and planes meet exactly, or any.
    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![
            4 => (-4i32..=4).prop_map(|k| 0.25 * f64::from(k)),
            2 => (-1.0..1.0f32).prop_map(f64::from),
            1 => prop_oneof![Just(1e-9), Just(-0.0), Just(1e30), Just(1e39), Just(f64::NAN), Just(f64::INFINITY)],
        ]
    }

    fn place() -> impl Strategy<Value = DVec3> {
        [number(), number(), number()].prop_map(DVec3::from)
    }

    fn few() -> impl Strategy<Value = DVec3> {
        [-1.0..1.0f64, -1.0..1.0, -1.0..1.0].prop_map(DVec3::from)
    }

    fn camera(eye: DVec3, look: DVec3, ortho: bool, far: f64) -> Option<Camera> {
        let projection = match ortho {
            true => Projection::Orthographic { ortho_height: 1.0 },
            false => Projection::Perspective { fov_y_deg: 50.0 },
        };
        let (up, width, height) =
            (if look.cross(DVec3::Y) == DVec3::ZERO { DVec3::X } else { DVec3::Y }, 2, 1);
        Camera::new(&CameraParameters {
            eye,
            target: eye + look,
            up,
            projection,
            width,
            height,
            near: 0.25,
            far,
        })
        .ok()
    }

    proptest! {
        // Few planes are met so that rounding decides.
        #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.max(10_000), ..Default::default() })]
        #[test]
        fn boxes_say_what_all_in_them_would(
            near in prop::collection::vec((place(), few(), 0usize..90), 1..5),
            eye in place(),
            look in prop_oneof![Just(DVec3::NEG_Z), Just(DVec3::X), few()],
            ortho: bool,
            far in prop_oneof![Just(1.0), Just(3.0), Just(f64::INFINITY)],
            placed in prop_oneof![
                Just(DMat4::IDENTITY),
                (few(), few(), -3i32..4).prop_map(|(t, axis, s)| {
                    DMat4::from_translation(t)
                        * DMat4::from_axis_angle(axis.try_normalize().unwrap_or(DVec3::X), t.x)
                        * DMat4::from_scale(DVec3::splat(10f64.powi(s)))
                }),
                Just(DMat4::from_scale(DVec3::splat(1e300))),
            ],
            there: u64,
            through in prop::option::of((0usize..6, few())),
        ) {
            let Some(centred) = camera(DVec3::ZERO, look, ortho, far) else { return Ok(()) };
            let eye = match through {
                // The first place is on this plane, but for how its eye is rounded.
                Some((k, away)) => {
                    let plane = centred.frustum().planes()[k];
                    placed.transform_point3(near[0].0) - away.reject_from(plane.normal.try_normalize().unwrap_or(look))
                        + plane.offset * plane.normal
                }
                None => eye,
            };
            let Some(camera) = camera(eye, look, ortho, far).filter(|_| eye.is_finite()) else { return Ok(()) };
            let frustum = camera.frustum();
            // Clusters, of which some are a place many times.
            let mut places: Vec<DVec3> = Vec::new();
            for (at, spread, n) in near {
                let spread = if n % 3 == 0 { DVec3::ZERO } else { 0.1 * spread };
                places.extend((0..n).map(|k| at + spread * (k as f64 * 0.61).fract()));
            }
            let boxes = boxes(places.iter().copied());
            prop_assert_eq!(boxes.len(), places.len().div_ceil(EACH) + 1);
            let seen = Seen::new(&frustum, &placed);
            let own = |p: DVec3| frustum.contains(placed.transform_point3(p));
            let groups = places.chunks(EACH).chain([&places[..]]);
            let single: Vec<Extent> = places.iter().map(|&p| Extent::NOTHING.with(p)).collect();
            for (group, e) in groups.zip(&boxes).chain(places.chunks(1).zip(&single)) {
                let all = group.iter().map(|&p| own(p));
                match seen.cut_by(e, Planes::ALL) {
                    None => prop_assert_eq!(all.filter(|&h| h).count(), 0),
                    Some(left) => for (&p, held) in group.iter().zip(all) {
                        prop_assert_eq!(seen.holds(p, left), held);
                        prop_assert!(held || !left.is_empty());
                    }
                }
            }
            // By all of it, of some places.
            let words: Vec<u64> = (0..places.len().div_ceil(EACH) as u32).map(|k| there.rotate_left(7 * k)).collect();
            let there = |k: usize| words[k / EACH] >> (k % EACH) & 1 != 0;
            let expected = (0..places.len()).filter(|&k| there(k) && own(places[k])).count();
            let words: Vec<u64> = words.iter().enumerate().map(|(w, bits)| {
                let left = places.len() - EACH * w;
                if left < EACH { bits & ((1 << left) - 1) } else { *bits }
            }).collect();
            prop_assert_eq!(held(&words, &boxes, &seen, |k| places[k]), expected);
        }
    }
}
