//! A proven interval of the Hausdorff distance, by branch and bound on triangles.
//!
//! From below, the distance is proven by a point: no triangle is nearer to the witness than the plane that separates the two. From
//! above, by a triangle `t` of the other surface for every piece of a triangle: the distance from `t` is convex, so no point of the piece is
//! farther from `t` than its farthest corner is (Tang, Lee & Kim 2009; Guthe, Borodin & Klein 2005); or by the triangles that cover
//! the piece together (`cover.rs`), which ends the matter for nearly all. Pieces whose bound is above the interval are cut: along a side of
//! `t`, which ends the matter at once where surfaces lie flat on each other, or in half.
//!
//! **Rounding.** All is computed in f64 in the frame of the other surface, where that has radius 1. With `M` the greatest coordinate there, 1 at
//! least: conversions move a point by less than 7 M 2^-53, each of at most 128 cuts moves a corner by less than 4 M 2^-53, a distance
//! between two points is off by less than 16 M 2^-53, and a height over a plane by less than 256 M 2^-53. The interval is widened on both sides by 1024 M 2^-53, which is more than all of
//! that.

use super::MeasureError;
use super::cover::Cover;
use super::distance::{Farthest, over_vertices};
use super::pieces::{Corner, Piece};
use super::progress::Progress;
use super::query::{Best, Query};
use super::surface::{Shift, Surface};
use crate::options::Control;
use crate::parallel;
use glam::DVec3;

/// A proven interval: `lower <= d <= upper`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Interval {
    /// The distance is at least this; the witness attains it.
    pub lower: f64,
    /// The distance is at most this.
    pub upper: f64,
    /// The point that is `lower` or more away, and what is closest to it. Its `distance` is that computed for it, above `lower` by
    /// the allowance for rounding.
    pub witness: Farthest,
}

/// The Hausdorff distance of two surfaces, proven.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Certified {
    /// The one-sided distance from A to B: the greatest distance of a point of A from B.
    pub a_to_b: Interval,
    /// From B to A.
    pub b_to_a: Interval,
    /// The two-sided distance is at least this.
    pub lower: f64,
    /// The two-sided distance is at most this.
    pub upper: f64,
    /// Where `lower` is attained.
    pub witness: Farthest,
    /// True if the witness is a point of A, false if it is one of B.
    pub witness_on_a: bool,
    /// Pieces of triangles that were cut.
    pub cuts: u64,
    /// Whether each interval is as narrow as asked. If not, cutting came to its limit; the intervals are proven all the same.
    pub converged: bool,
}

/// What [`within`] has found out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Within {
    /// Proven: no point of either surface is farther than the bound from the other.
    Yes {
        /// A bound of the two-sided distance, at most the one asked for.
        upper: f64,
    },
    /// Proven: there is a point farther than the bound.
    No {
        /// That point.
        witness: Farthest,
        /// True if it is a point of A, false if it is one of B.
        on_a: bool,
    },
    /// The distance is too close to the bound to tell with the tolerance given.
    Open {
        /// It is at least this.
        lower: f64,
        /// It is at most this.
        upper: f64,
    },
}

/// How [`certify`] and [`within`] go about it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct CertifyOptions {
    /// Width of the intervals in model units. Default: 0, which is taken for the least that makes sense, 1e-11 of the size of the surfaces.
    pub tolerance: f64,
    /// Pieces to cut at most in each direction. Default: 2^26, minutes.
    pub max_cuts: u64,
    /// Threads to use; `None` for all of the current rayon pool. The result does not depend on it.
    pub threads: Option<usize>,
}

impl Default for CertifyOptions {
    fn default() -> Self {
        CertifyOptions { tolerance: 0.0, max_cuts: 1 << 26, threads: None }
    }
}

impl CertifyOptions {
    /// The defaults with this tolerance.
    pub fn with_tolerance(tolerance: f64) -> Self {
        CertifyOptions { tolerance, ..Default::default() }
    }

    pub(super) fn check(&self) -> Result<(), MeasureError> {
        not_negative("tolerance", self.tolerance)
    }

    /// Checks the options and the bound that goes with them.
    pub(super) fn check_with(&self, bound: f64) -> Result<(), MeasureError> {
        self.check()?;
        not_negative("bound", bound)
    }
}

fn not_negative(option: &'static str, value: f64) -> Result<(), MeasureError> {
    match value.is_finite() && value >= 0.0 {
        true => Ok(()),
        false => Err(MeasureError::Range { option, value, range: "finite and not negative" }),
    }
}

/// Proves between which bounds the distances from `a` to `b`, from `b` to `a` and the Hausdorff distance, the greater of both, lie.
///
/// Intervals are no wider than the tolerance (see [`Certified::converged`]). The proof holds for the surfaces as given, with all rounding
/// accounted for. Time: that of a distance query for every vertex, and cuts for the few triangles whose distance may be the greatest; more
/// where large parts are equally far, as for surfaces at an offset.
///
/// Errors: the tolerance is negative or not finite; cancelled.
pub fn certify(
    a: &Surface,
    b: &Surface,
    options: &CertifyOptions,
    control: &dyn Control,
) -> Result<Certified, MeasureError> {
    options.check()?;
    parallel::with_threads(options.threads, || {
        let progress = progress(a, b, control);
        let any = Goal { enough: 0.0, too_much: f64::INFINITY };
        let to = one_sided(a, b, options, any, &progress)?;
        let fro = one_sided(b, a, options, any, &progress)?;
        let on_a = to.interval.lower >= fro.interval.lower;
        Ok(Certified {
            a_to_b: to.interval,
            b_to_a: fro.interval,
            lower: to.interval.lower.max(fro.interval.lower),
            upper: to.interval.upper.max(fro.interval.upper),
            witness: if on_a { to.interval.witness } else { fro.interval.witness },
            witness_on_a: on_a,
            cuts: to.cuts + fro.cuts,
            converged: to.converged && fro.converged,
        })
    })
}

/// Whether the Hausdorff distance of `a` and `b` is at most `bound`, proven either way.
///
/// Stops as soon as that is known: much sooner than [`certify`] where the distance is not close to the bound. The tolerance says how close to
/// the bound it may leave the matter open.
///
/// Errors: the tolerance or the bound is negative or not finite; cancelled.
pub fn within(
    a: &Surface,
    b: &Surface,
    bound: f64,
    options: &CertifyOptions,
    control: &dyn Control,
) -> Result<Within, MeasureError> {
    options.check_with(bound)?;
    parallel::with_threads(options.threads, || {
        let progress = progress(a, b, control);
        let goal = Goal { enough: bound, too_much: bound };
        let (mut lower, mut upper) = (0f64, 0f64);
        for (on_a, from, to) in [(true, a, b), (false, b, a)] {
            let found = one_sided(from, to, options, goal, &progress)?.interval;
            if found.lower > bound {
                return Ok(Within::No { witness: found.witness, on_a });
            }
            (lower, upper) = (lower.max(found.lower), upper.max(found.upper));
        }
        Ok(if upper <= bound { Within::Yes { upper } } else { Within::Open { lower, upper } })
    })
}

pub(super) fn progress<'a>(a: &Surface, b: &Surface, control: &'a dyn Control) -> Progress<'a> {
    let work = |s: &Surface| s.points.len() + s.triangles.len();
    Progress::new(control, work(a) + work(b))
}

/// What of the interval matters, in model units.
#[derive(Clone, Copy)]
struct Goal {
    /// Bounds below this need not be better.
    enough: f64,
    /// A lower bound above this ends the work.
    too_much: f64,
}

struct Found {
    interval: Interval,
    cuts: u64,
    converged: bool,
}

/// The most distant point so far, local, and what of the triangle it lies on.
#[derive(Clone, Copy)]
struct Witness {
    point: DVec3,
    triangle: u32,
    lower: f64,
}

/// Triangles to a chunk of the first pass.
const CHUNK: usize = 2048;
/// Pieces to a chunk of those that are cut at the same time, at most; where they are few, chunks are smaller.
const SHARE: usize = 16;
/// So many chunks are enough for all threads.
const CHUNKS: usize = 64;
/// Cuts to such a chunk.
const QUOTA: u64 = 1 << 13;
/// How far a level is above what is wanted, of the greatest bound there is.
const STEP: f64 = 0.25;
/// A level within this factor of what is wanted is the last.
const NEAR: f64 = 1.25;
/// No piece is cut more often: a hundred halvings exhaust f64.
const DEPTH: u8 = 128;

fn one_sided(
    a: &Surface,
    b: &Surface,
    options: &CertifyOptions,
    goal: Goal,
    progress: &Progress<'_>,
) -> Result<Found, MeasureError> {
    let shift = a.frame.to(&b.frame);
    let scale = b.frame.scale;
    let slack = slack(a, &shift);
    let tolerance = (options.tolerance * scale - 4.0 * slack).max(64.0 * slack);
    let (enough, too_much) = (goal.enough * scale - 2.0 * slack, goal.too_much * scale + slack);
    let corners = corners(a, b, progress)?;
    let pair = Pair::new(a, b);
    let mut witness = first_witness(a, b, &shift, &corners);
    // Above what bounds have to come down.
    let target = |w: &Witness| (w.lower + tolerance).max(enough);
    let mut upper = witness.lower;
    let mut cuts = 0;
    let mut pieces = Vec::new();
    if witness.lower <= too_much {
        let dropped;
        (pieces, dropped) = pair.first_pieces(&corners, witness.lower, target(&witness), progress)?;
        upper = upper.max(dropped);
    }
    // Bounds come down to a level, which comes down to what is wanted: what is above a level has to be cut whatever the final witness
    // is, as long as that is below the level.
    let mut level = f64::INFINITY;
    while !pieces.is_empty() && witness.lower <= too_much && cuts < options.max_cuts {
        let wanted = target(&witness);
        let top = pieces.iter().fold(0f64, |top, p| top.max(p.bound));
        level = level.min(wanted + (top - wanted) * STEP);
        if level <= wanted * NEAR {
            level = wanted;
        }
        let goal = Level { level, wanted, lower: witness.lower, tolerance };
        let (above, rest): (Vec<Piece>, Vec<Piece>) = pieces.drain(..).partition(|p| p.bound > level);
        let shares: Vec<Result<Share, MeasureError>> = parallel::map_init_chunks(
            &above,
            (above.len() / CHUNKS).clamp(1, SHARE),
            || (b.query(), Cover::new(b, &pair.same)),
            |(query, cover), _, chunk| {
                progress.check()?;
                Ok(goal.bring_down(b, query, cover, chunk))
            },
        );
        pieces = rest;
        for share in shares {
            let share = share?;
            cuts += share.cuts;
            upper = upper.max(share.dropped);
            pieces.extend(share.left);
            raise(b, &mut witness, &share.far);
        }
        let wanted = target(&witness);
        pieces.retain(|p| {
            let keep = p.bound > wanted;
            upper = if keep { upper } else { upper.max(p.bound) };
            keep
        });
    }
    upper = pieces.iter().fold(upper.max(witness.lower), |top, p| top.max(p.bound));
    let converged = upper <= target(&witness) || witness.lower > too_much;
    // Where the search ended early, nothing is known from above.
    if witness.lower > too_much {
        upper = f64::INFINITY;
    }
    let farthest = farthest(a, b, &shift, &witness);
    let lower = (witness.lower - slack).max(0.0) / scale;
    Ok(Found {
        interval: Interval { lower, upper: (upper + slack) / scale, witness: farthest },
        cuts,
        converged,
    })
}

/// The allowance for rounding in the frame of the other surface: see above.
pub(super) fn slack(a: &Surface, shift: &Shift) -> f64 {
    let (lo, hi) = a.bounds();
    let reach = [lo, hi].map(|p| shift.apply(a.frame.local(p)).abs().max_element());
    1024.0 * f64::EPSILON / 2.0 * reach[0].max(reach[1]).max(1.0)
}

/// What of `b` is nearest to the vertices of `a`.
pub(super) fn corners(a: &Surface, b: &Surface, progress: &Progress<'_>) -> Result<Vec<Best>, MeasureError> {
    let parts = over_vertices(a, b, progress, |found: &mut Vec<Best>, _, best| found.push(*best))?;
    Ok(parts.into_iter().flatten().collect())
}

/// The vertex that is farthest.
fn first_witness(a: &Surface, b: &Surface, shift: &Shift, corners: &[Best]) -> Witness {
    let (mut far, mut at) = (-1.0, 0);
    for (i, c) in corners.iter().enumerate() {
        if c.foot.d2 > far {
            (far, at) = (c.foot.d2, i);
        }
    }
    let point = shift.apply(a.points[at]);
    let triangle = a.triangles.iter().position(|t| t.contains(&(at as u32))).unwrap_or(0) as u32;
    Witness { point, triangle, lower: b.at_least(point, far.sqrt()) }
}

/// A point that is farther than the witness takes its place.
fn raise(b: &Surface, witness: &mut Witness, far: &Option<(f64, DVec3, u32)>) {
    if let &Some((d, point, triangle)) = far
        && d > witness.lower
    {
        let lower = b.at_least(point, d);
        if lower > witness.lower {
            *witness = Witness { point, triangle, lower };
        }
    }
}

/// How far to bring bounds down.
struct Level {
    level: f64,
    /// Pieces below this need no more.
    wanted: f64,
    /// The distance of the witness.
    lower: f64,
    /// How far above the witness bounds may stay.
    tolerance: f64,
}

/// What became of a share of the pieces.
#[derive(Default)]
struct Share {
    /// Those with bounds between what is wanted and the level, and what is left of those above when time is up.
    left: Vec<Piece>,
    /// The greatest bound of the others.
    dropped: f64,
    /// The farthest corner of all: distance, place, triangle.
    far: Option<(f64, DVec3, u32)>,
    cuts: u64,
}

impl Level {
    /// Cuts pieces until their bounds are below the level. A corner that is farther than the witness raises what is wanted at once.
    fn bring_down(
        &self,
        b: &Surface,
        query: &mut Query<'_>,
        cover: &mut Cover<'_>,
        pieces: &[Piece],
    ) -> Share {
        let mut share = Share::default();
        let mut farthest = self.lower;
        let (mut level, mut wanted) = (self.level, self.wanted);
        let mut stack: Vec<Piece> = Vec::new();
        for piece in pieces {
            stack.push(*piece);
            while let Some(piece) = stack.pop() {
                if piece.depth >= DEPTH {
                    share.dropped = share.dropped.max(piece.bound);
                    continue;
                }
                if piece.bound <= level {
                    if piece.bound > wanted {
                        share.left.push(piece);
                    } else {
                        share.dropped = share.dropped.max(piece.bound);
                    }
                    continue;
                }
                if share.cuts >= QUOTA {
                    share.left.push(piece);
                    continue;
                }
                share.cuts += 1;
                piece.cut(b, query, |mut part| {
                    for (&d, &at) in part.d.iter().zip(&part.corners) {
                        if d > farthest {
                            farthest = d;
                            share.far = Some((d, at, part.triangle));
                            wanted = wanted.max(b.at_least(at, d) + self.tolerance);
                            level = level.max(wanted);
                        }
                    }
                    part.bound_by_points();
                    if part.bound > wanted {
                        part.bound_by_triangles(b, cover, wanted);
                    }
                    if part.bound > level {
                        stack.push(part);
                    } else if part.bound > wanted {
                        share.left.push(part);
                    } else {
                        share.dropped = share.dropped.max(part.bound);
                    }
                });
            }
        }
        share
    }
}

/// From which surface to which.
pub(super) struct Pair<'a> {
    a: &'a Surface,
    b: &'a Surface,
    pub(super) shift: Shift,
    /// What [`Surface::same_places`] says of `b`.
    pub(super) same: Vec<u32>,
}

impl<'a> Pair<'a> {
    pub(super) fn new(a: &'a Surface, b: &'a Surface) -> Self {
        Pair { a, b, shift: a.frame.to(&b.frame), same: b.same_places() }
    }

    /// All triangles of `a` whose bound is above `enough`, as pieces; and the greatest bound of the others. Bounds below `lower` are of no
    /// interest.
    pub(super) fn first_pieces(
        &self,
        corners: &[Best],
        lower: f64,
        enough: f64,
        progress: &Progress<'_>,
    ) -> Result<(Vec<Piece>, f64), MeasureError> {
        let Pair { a, b, shift, same } = self;
        type Chunk = Result<(Vec<Piece>, f64), MeasureError>;
        let chunks: Vec<Chunk> = parallel::map_init_chunks(
            &a.triangles,
            CHUNK,
            || Cover::new(b, same),
            |cover, first, chunk| {
                progress.check()?;
                let (mut pieces, mut dropped) = (Vec::new(), 0f64);
                for (i, t) in chunk.iter().enumerate() {
                    let corner =
                        |v: u32| Corner::new(shift.apply(a.points[v as usize]), corners[v as usize], b);
                    let mut piece = Piece::whole(t.map(corner), (first + i) as u32);
                    piece.bound_by_points();
                    if piece.bound > lower {
                        piece.bound_by_triangles(b, cover, enough);
                    }
                    if piece.bound > enough {
                        pieces.push(piece);
                    } else {
                        dropped = dropped.max(piece.bound);
                    }
                }
                progress.add(chunk.len());
                Ok((pieces, dropped))
            },
        );
        let (mut pieces, mut dropped) = (Vec::new(), 0f64);
        for chunk in chunks {
            let (more, bound) = chunk?;
            pieces.extend(more);
            dropped = dropped.max(bound);
        }
        Ok((pieces, dropped))
    }
}

fn farthest(a: &Surface, b: &Surface, shift: &Shift, witness: &Witness) -> Farthest {
    let mut query: Query<'_> = b.query();
    let closest = b.closest_point(query.nearest(witness.point));
    // Back into the frame of `a`, by the triangle it lies on.
    let whole = a.triangles[witness.triangle as usize].map(|v| shift.apply(a.points[v as usize]));
    let [v, w] = Piece::weights(whole, witness.point);
    Farthest {
        point: a.frame.world(a.point_on(witness.triangle, v, w)),
        triangle: a.ids[witness.triangle as usize],
        closest: closest.point,
        closest_triangle: closest.triangle,
        distance: closest.distance,
    }
}
