//! All places where two surfaces are farther from each other than a bound.

use super::MeasureError;
use super::certify::{CertifyOptions, Pair, corners, progress, slack};
use super::cover::Cover;
use super::pieces::Piece;
use super::progress::Progress;
use super::query::{Best, Query};
use super::surface::Surface;
use crate::options::Control;
use crate::parallel;
use glam::DVec3;

/// A place that is farther from the other surface than a bound, or not proven not to be.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Place {
    /// A point of A if true, else of B.
    pub on_a: bool,
    /// The triangle it lies on, by its index in the input. There is one place a triangle at most.
    pub triangle: u32,
    /// The point.
    pub point: DVec3,
    /// How far it is: above the bound, or so close to it that no more is known.
    pub distance: f64,
    /// The triangle of the other surface that is closest.
    pub closest_triangle: u32,
}

/// What [`exceeding`] has found.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Exceeding {
    /// A proven bound of the two-sided distance, if that is at most what was asked.
    pub upper: Option<f64>,
    /// Where it is not: those on A, then those on B, by triangles in the order of the hierarchies. All there are, unless there are more
    /// than the limit.
    pub places: Vec<Place>,
    /// For every triangle of B, by its index in the input: the greatest distance of its corners, and of those vertices of A that it is the
    /// closest triangle to.
    pub by_triangle: Vec<f64>,
}

/// Pieces to a chunk of those that are cut at the same time.
const SHARE: usize = 16;
/// Cuts to a triangle of which nothing is proven by then.
const QUOTA: u32 = 1 << 12;
/// No piece is cut more often.
const DEPTH: u8 = 128;

/// Whether the Hausdorff distance of `a` and `b` is at most `bound`, as [`within`](super::within()), and if not, all places where not.
///
/// What is within the tolerance of the bound, and what takes thousands of cuts, counts as exceeding it. After more than `limit` places it looks for
/// no more; where the corners of triangles alone are that many, it cuts nothing.
///
/// Errors: the tolerance or the bound is negative or not finite; cancelled.
pub fn exceeding(
    a: &Surface,
    b: &Surface,
    bound: f64,
    limit: usize,
    options: &CertifyOptions,
    control: &dyn Control,
) -> Result<Exceeding, MeasureError> {
    options.check_with(bound)?;
    parallel::with_threads(options.threads, || {
        let progress = progress(a, b, control);
        let nearest = [corners(a, b, &progress)?, corners(b, a, &progress)?];
        let by_triangle = by_triangle(a, b, &nearest);
        let mut found = Exceeding { upper: Some(0.0), places: Vec::new(), by_triangle };
        for (on_a, from, to) in [(true, a, b), (false, b, a)] {
            let side = Side { from, to, bound, tolerance: options.tolerance };
            let (upper, places) = side.places(on_a, &nearest[usize::from(!on_a)], limit, &progress)?;
            found.places.extend(places);
            found.upper = found.upper.filter(|_| found.places.is_empty()).map(|u| u.max(upper));
            if found.places.len() > limit {
                break;
            }
        }
        // Rounding may have carried it past.
        found.upper = found.upper.filter(|&u| u <= bound);
        Ok(found)
    })
}

fn by_triangle(a: &Surface, b: &Surface, [of_a, of_b]: &[Vec<Best>; 2]) -> Vec<f64> {
    let mut found = vec![0f64; b.triangle_count()];
    for best in of_a {
        let at = &mut found[b.ids[best.triangle as usize] as usize];
        *at = at.max(best.foot.d2.sqrt() / b.frame.scale);
    }
    for (t, &id) in b.triangles.iter().zip(&b.ids) {
        for &v in t {
            let at = &mut found[id as usize];
            *at = at.max(of_b[v as usize].foot.d2.sqrt() / a.frame.scale);
        }
    }
    found
}

/// What is asked in one direction.
struct Side<'a> {
    from: &'a Surface,
    to: &'a Surface,
    bound: f64,
    tolerance: f64,
}

impl Side<'_> {
    /// A bound of what does not exceed, and what does.
    fn places(
        &self,
        on_a: bool,
        nearest: &[Best],
        limit: usize,
        progress: &Progress<'_>,
    ) -> Result<(f64, Vec<Place>), MeasureError> {
        let (a, b) = (self.from, self.to);
        let pair = Pair::new(a, b);
        let scale = b.frame.scale;
        let slack = slack(a, &pair.shift);
        let enough = self.bound * scale - 2.0 * slack;
        let near = enough - self.tolerance * scale;
        let place = |piece: &Piece| {
            let far = (0..3).fold(0, |far, k| if piece.d[k] > piece.d[far] { k } else { far });
            let whole = a.triangles[piece.triangle as usize].map(|v| pair.shift.apply(a.points[v as usize]));
            let [v, w] = Piece::weights(whole, piece.corners[far]);
            Place {
                on_a,
                triangle: a.ids[piece.triangle as usize],
                point: a.frame.world(a.point_on(piece.triangle, v, w)),
                distance: piece.d[far] / scale,
                closest_triangle: b.ids[piece.near[far] as usize],
            }
        };
        let (pieces, dropped) = pair.first_pieces(nearest, enough, enough, progress)?;
        let (beyond, open): (Vec<Piece>, Vec<Piece>) =
            pieces.into_iter().partition(|p| p.d.iter().any(|&d| d > enough));
        let mut places: Vec<Place> = beyond.iter().map(place).collect();
        if places.len() > limit {
            return Ok((f64::INFINITY, places));
        }
        type Share = Result<(f64, Vec<Box<Piece>>), MeasureError>;
        let shares: Vec<Share> = parallel::map_init_chunks(
            &open,
            SHARE,
            || (b.query(), Cover::new(b, &pair.same)),
            |(query, cover), _, chunk| {
                progress.check()?;
                let (mut dropped, mut found) = (0f64, Vec::new());
                for piece in chunk {
                    match prove(b, query, cover, piece, [near, enough]) {
                        Ok(bound) => dropped = dropped.max(bound),
                        Err(place) => found.push(place),
                    }
                }
                Ok((dropped, found))
            },
        );
        let mut upper = dropped;
        for share in shares {
            let (bound, found) = share?;
            upper = upper.max(bound);
            places.extend(found.iter().map(|piece| place(piece)));
        }
        Ok(((upper + slack) / scale, places))
    }
}

/// A bound of the piece's distance, if it is below `enough`; else a part of it with a corner farther than `near`, or one that resists.
fn prove(
    b: &Surface,
    query: &mut Query<'_>,
    cover: &mut Cover<'_>,
    piece: &Piece,
    [near, enough]: [f64; 2],
) -> Result<f64, Box<Piece>> {
    let (mut dropped, mut cuts) = (0f64, 0);
    let mut stack = vec![*piece];
    while let Some(piece) = stack.pop() {
        cuts += 1;
        if piece.depth >= DEPTH || cuts > QUOTA {
            return Err(Box::new(piece));
        }
        let mut far = None;
        piece.cut(b, query, |mut part| {
            if part.d.iter().any(|&d| d > near) {
                far = Some(part);
            }
            part.bound_by_points();
            if part.bound > enough {
                part.bound_by_triangles(b, cover, enough);
            }
            if part.bound > enough {
                stack.push(part);
            } else {
                dropped = dropped.max(part.bound);
            }
        });
        if let Some(far) = far {
            return Err(Box::new(far));
        }
    }
    Ok(dropped)
}
