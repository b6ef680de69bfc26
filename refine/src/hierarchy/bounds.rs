//! Bounds of splits, packed into eight bytes.

use super::cone::Cone;
use super::directions::{self, Body, Direction};
use super::spheres::Extent;
use crate::progressive::{Damage, ProgressiveMesh};
use crate::view::NormalCone;
use glam::{DVec3, Vec3};

/// What is known of all that lies below a split.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitBounds {
    /// The vertex before it is split, model units.
    pub centre: DVec3,
    /// A sphere about it holds the faces of the finest mesh around all vertices that come of it.
    pub radius: f64,
    /// Their normals lie in this cone.
    pub cone: NormalCone,
    /// The error of a mesh in which it is not applied, there; see the [module](super) for what it bounds.
    pub error: f64,
}

/// What errors are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Guarantee {
    /// Largest distances found while splits are undone in several orders, with a margin.
    #[default]
    Measured,
    /// Distances that no mesh of the hierarchy exceeds, by proof of whoever gave them.
    Proven,
    /// Differences of height over a plane, proven by whoever gave them; distances are no larger.
    Vertical,
    /// Distances of the whole surface, proven for meshes that keep the ring rule ([`super::Rule::Rings`]).
    Settled,
}

impl Guarantee {
    pub(crate) fn code(self) -> u8 {
        match self {
            Guarantee::Measured => 0,
            Guarantee::Proven => 1,
            Guarantee::Vertical => 2,
            Guarantee::Settled => 3,
        }
    }

    pub(crate) fn from_code(code: u8) -> Option<Guarantee> {
        let all = [Guarantee::Measured, Guarantee::Proven, Guarantee::Vertical, Guarantee::Settled];
        all.into_iter().find(|g| g.code() == code)
    }
}

/// Bounds of all splits of a progressive mesh, or of a run of them; 8 B a split, 10 with directions.
///
/// They belong to the splits, not to their order: [`ProgressiveMesh::reordered`] takes those that a mesh carries ([`ProgressiveMesh::bounds`]) along. Errors and radii are
/// rounded up, by at most 1 in 256, cones are widened by at most 0.3 degrees.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bounds {
    /// Centres are taken about this, and then rounded to f32; radii allow for that.
    pub(crate) origin: DVec3,
    pub(crate) diagonal: f64,
    pub(crate) guarantee: Guarantee,
    pub(crate) of: Vec<Packed>,
    /// Of settled bounds: splits with a lower turn come before those with a higher one, so that the order they were measured in comes back from any other. Empty for others, and
    /// in hierarchies.
    pub(crate) turns: Vec<u32>,
    /// Which way deviations lie; empty if that is not known.
    pub(crate) directions: Vec<Direction>,
}

/// The bounds of a split as they are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Packed {
    pub(crate) error: u16,
    pub(crate) radius: u16,
    pub(crate) cone: Cone,
}

/// The least stored number that is not below `x`: the 8 bits of an f32's exponent and the first 8 of its mantissa. Not negative.
#[inline]
pub(crate) fn pack_up(x: f64) -> u16 {
    if x.is_nan() || x >= 1.7e38 {
        return 0xfe00;
    }
    let mut f = x as f32;
    if (f as f64) < x {
        f = f.next_up();
    }
    (f.to_bits().div_ceil(1 << 15)) as u16
}

/// The number stored.
#[inline]
pub(crate) fn unpack(code: u16) -> f32 {
    f32::from_bits((code as u32) << 15)
}

/// What was unpacked.
#[inline]
pub(crate) fn repack(x: f32) -> u16 {
    (x.to_bits() >> 15) as u16
}

impl Bounds {
    /// Measures the bounds of a progressive mesh; see the [module](super) for what that gives. The same for every number of threads.
    ///
    /// Errors: a damaged progressive mesh.
    pub fn measure(mesh: &ProgressiveMesh, options: &super::Options) -> Result<Bounds, Damage> {
        if options.rule == super::Rule::Rings
            && let Some(settled) = super::Settled::measure(mesh, options)?
        {
            let mut back = vec![0; settled.order.len()];
            settled.order.iter().zip(0..).for_each(|(&i, k)| back[i as usize] = k);
            return Ok(settled.bounds.reordered(&back).unwrap_or_default());
        }
        let (forest, front, _) = super::finest(mesh, super::Rule::Cuts)?;
        Ok(super::deviation::measure(mesh, &forest, &front, options))
    }

    /// Bounds with errors that are known otherwise, such as those of terrain, model units: `errors[i]` is to be at least the deviation of every mesh without split `i`
    /// from the finest one, wherever the vertex that it splits answers for it. They are raised to be no less than those below them in the hierarchy, and rounded up; spheres and
    /// cones are found here. O(n).
    ///
    /// Errors: a damaged progressive mesh, or not one error for each split.
    pub fn with_errors(
        mesh: &ProgressiveMesh,
        errors: &[f64],
        guarantee: Guarantee,
    ) -> Result<Bounds, Damage> {
        Self::of_errors(mesh, errors, guarantee, &[])
    }

    fn of_errors(
        mesh: &ProgressiveMesh,
        errors: &[f64],
        guarantee: Guarantee,
        extents: &[Extent],
    ) -> Result<Bounds, Damage> {
        if errors.len() != mesh.splits.len() {
            return Err(Damage::Length { what: "bounds", len: errors.len(), want: mesh.splits.len() });
        }
        let (forest, front, _) = super::finest(mesh, super::Rule::Cuts)?;
        let finest = super::Finest::new(mesh, &forest, &front);
        let mut bounds = super::spheres::around(mesh, &forest, &finest, extents);
        bounds.guarantee = guarantee;
        // What is no number promises nothing.
        let known = |e: &f64| if e.is_nan() { f64::INFINITY } else { e.max(0.0) };
        bounds.set_errors(&forest, errors.iter().map(known).collect());
        Ok(bounds)
    }

    /// As [`Bounds::with_errors`], where an error holds farther away than the faces of the finest mesh around what comes of the vertex: `radii[i]` at least from where split `i` is, model
    /// units. Spheres are raised to hold that, and those below them. O(n).
    ///
    /// Errors: as [`Bounds::with_errors`], and not one radius for each split.
    pub fn with_errors_within(
        mesh: &ProgressiveMesh,
        errors: &[f64],
        radii: &[f64],
        guarantee: Guarantee,
    ) -> Result<Bounds, Damage> {
        if radii.len() != mesh.splits.len() {
            return Err(Damage::Length { what: "radii", len: radii.len(), want: mesh.splits.len() });
        }
        let mut bounds = Bounds::with_errors(mesh, errors, guarantee)?;
        let forest = super::Forest::new(mesh);
        let centre = |b: &Bounds, i: usize| b.place_before(mesh, &forest, i as u32).as_dvec3();
        // As of the spheres: rounding of centres never shows.
        let slack = bounds.diagonal * 1e-6;
        let mut least: Vec<f64> = radii.iter().map(|r| r.max(0.0) + slack).collect();
        let ups = forest.ups();
        for i in (0..least.len()).rev() {
            bounds.of[i].radius = bounds.of[i].radius.max(pack_up(least[i]));
            let up = ups[i] as usize;
            if let Some(above) = least.get_mut(up) {
                let reach = centre(&bounds, i).distance(centre(&bounds, up)) + bounds.radius(i) + slack;
                *above = above.max(reach);
            }
        }
        Ok(bounds)
    }

    /// Keeps errors, raised to nest.
    pub(crate) fn set_errors(&mut self, forest: &super::Forest, mut errors: Vec<f64>) {
        let ups = forest.ups();
        for i in (0..errors.len()).rev() {
            let e = errors[i];
            self.of[i].error = pack_up(e);
            if let Some(up) = errors.get_mut(ups[i] as usize) {
                *up = up.max(e);
            }
        }
    }

    /// Keeps which way deviations lie, raised to nest; errors are set.
    pub(super) fn set_directions(&mut self, forest: &super::Forest, bodies: Vec<Body>) {
        self.directions = directions::nested(forest, bodies, |i| unpack(self.of[i].error) as f64);
    }

    /// Which way deviations lie is known, so that views can take directional errors ([`crate::selective::Lens::directional`]).
    pub fn has_directions(&self) -> bool {
        !self.directions.is_empty() || self.of.is_empty()
    }

    /// The same, and there are some.
    pub(crate) fn is_directed(&self) -> bool {
        !self.directions.is_empty()
    }

    /// Splits.
    pub fn len(&self) -> usize {
        self.of.len()
    }

    /// True if there is none.
    pub fn is_empty(&self) -> bool {
        self.of.is_empty()
    }

    /// What the errors are.
    pub fn guarantee(&self) -> Guarantee {
        self.guarantee
    }

    /// The error of split `i`, model units. Panics if there is no such split.
    pub fn error(&self, i: usize) -> f64 {
        unpack(self.of[i].error) as f64
    }

    /// The radius of the sphere of split `i`, model units, about the vertex that it splits. Panics if there is no such split.
    pub fn radius(&self, i: usize) -> f64 {
        unpack(self.of[i].radius) as f64
    }

    /// The normal cone of split `i`. Panics if there is no such split.
    pub fn cone(&self, i: usize) -> NormalCone {
        self.of[i].cone.unpack()
    }

    /// The middle of the box around the finest mesh's vertices, about which centres are rounded to f32, and the length of its diagonal.
    pub fn extent(&self) -> (DVec3, f64) {
        (self.origin, self.diagonal)
    }

    /// Those of the splits in a range, which are numbered from 0 then. Panics if there are no such splits.
    pub fn slice(&self, range: std::ops::Range<usize>) -> Bounds {
        let turns = if self.turns.is_empty() { Vec::new() } else { self.turns[range.clone()].to_vec() };
        let known = !self.directions.is_empty();
        let directions = if known { self.directions[range.clone()].to_vec() } else { Vec::new() };
        Bounds { of: self.of[range].to_vec(), turns, directions, ..self.without_splits() }
    }

    /// Appends the bounds of the splits that follow; false (and nothing done) if they are of another mesh.
    pub fn append(&mut self, next: &Bounds) -> bool {
        let known = |b: &Bounds| b.directions.len() == b.of.len();
        let same = self.without_splits() == next.without_splits()
            && (self.is_empty() || next.is_empty() || known(self) == known(next));
        if same {
            self.directions.extend_from_slice(&next.directions);
            self.of.extend_from_slice(&next.of);
            self.turns.extend_from_slice(&next.turns);
        }
        same
    }

    fn without_splits(&self) -> Bounds {
        let (origin, diagonal, guarantee) = (self.origin, self.diagonal, self.guarantee);
        Bounds { origin, diagonal, guarantee, ..Bounds::default() }
    }

    /// Those of the same mesh with split `order[k]` as the `k`-th; `None` if there is no such split.
    pub fn reordered(&self, order: &[u32]) -> Option<Bounds> {
        let of = order.iter().map(|&i| self.of.get(i as usize).copied()).collect::<Option<_>>()?;
        let turns = order.iter().filter_map(|&i| self.turns.get(i as usize).copied()).collect();
        let directions = order.iter().filter_map(|&i| self.directions.get(i as usize).copied()).collect();
        Some(Bounds { of, turns, directions, ..self.without_splits() })
    }

    /// For a mesh of which every vertex has moved by at most `by`: errors grow by twice that, as both meshes have moved, and spheres and cones are found anew.
    ///
    /// Errors: a damaged progressive mesh, or one of another size.
    pub fn after_moving(&self, mesh: &ProgressiveMesh, by: f64) -> Result<Bounds, Damage> {
        let errors: Vec<f64> = (0..self.len()).map(|i| self.error(i) + 2.0 * by).collect();
        // Settled spheres are larger than those around what comes of a split; of cones nothing is known.
        let widened = |i: usize| Extent::beyond(self.radius(i) + 2.0 * by, NormalCone::ALL);
        let settled = self.guarantee == Guarantee::Settled;
        let extents = if settled { (0..self.len()).map(widened).collect() } else { Vec::new() };
        let mut moved = Bounds::of_errors(mesh, &errors, self.guarantee, &extents)?;
        moved.turns = self.turns.clone();
        if !self.directions.is_empty() {
            let body = |i: usize| Body::stored(self.error(i), self.directions[i]).grown(2.0 * by);
            moved.set_directions(&super::Forest::new(mesh), (0..self.len()).map(body).collect());
        }
        Ok(moved)
    }

    pub(crate) fn at(&self, i: usize, centre: DVec3) -> SplitBounds {
        SplitBounds { centre, radius: self.radius(i), cone: self.cone(i), error: self.error(i) }
    }

    /// Where a place is for all that is decided about it: about the origin, rounded.
    #[inline]
    pub(crate) fn local(&self, p: DVec3) -> Vec3 {
        (p - self.origin).as_vec3()
    }

    /// The same of the vertex of split `i` before it.
    pub(crate) fn place_before(&self, mesh: &ProgressiveMesh, forest: &super::Forest, i: u32) -> Vec3 {
        self.local(forest.place_before(mesh, mesh.splits.vertex[i as usize], i))
    }

    /// Every split's error and sphere hold those below; else a split of which they do not.
    pub(crate) fn check(&self, mesh: &ProgressiveMesh, forest: &super::Forest) -> Result<(), Damage> {
        if self.len() != forest.len() {
            return Err(Damage::Length { what: "bounds", len: self.len(), want: forest.len() });
        }
        if !self.directions.is_empty() && self.directions.len() != self.len() {
            return Err(Damage::Length { what: "directions", len: self.directions.len(), want: self.len() });
        }
        let centre = |i: usize| self.place_before(mesh, forest, i as u32).as_dvec3();
        let ups = forest.ups();
        for (i, up) in ups.iter().map(|&up| up as usize).enumerate() {
            if let Some(above) = self.of.get(up) {
                let reach = centre(i).distance(centre(up)) + self.radius(i);
                let turned = !self.directions.is_empty()
                    && !{
                        let body = |k: usize| Body::stored(self.error(k), self.directions[k]);
                        body(up).holds(&body(i))
                    };
                if self.of[i].error > above.error || reach > self.radius(up) || turned {
                    return Err(Damage::Bounds(i));
                }
            }
        }
        Ok(())
    }

    /// Bytes of those of all splits.
    pub fn bytes(&self) -> usize {
        size_of::<Packed>() * self.of.len() + 4 * self.turns.len() + 2 * self.directions.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_up_and_by_little() {
        for x in [0.0, 1.0, 1.0000001, 3.7e-12, 123456.7, 1e-39, 1e-300, 2.5e30] {
            let y = unpack(pack_up(x)) as f64;
            assert!(y >= x && y <= x * 1.004 + 1e-40, "{x} {y}");
        }
        assert!(unpack(pack_up(f64::INFINITY)).is_finite() && unpack(pack_up(f64::NAN)) > 1e38);
        assert!((0..2000).all(|k| pack_up(k as f64 * 0.37) <= pack_up((k + 1) as f64 * 0.37)));
    }

    #[test]
    fn a_split_takes_eight_bytes() {
        assert_eq!(size_of::<Packed>(), 8);
    }
}
