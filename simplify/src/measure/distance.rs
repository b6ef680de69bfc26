//! The distance between two surfaces, by samples (Metro; Cignoni, Rocchini & Scopigno 1998).
//!
//! `mean`, `rms` and quantiles are over area-weighted samples alone, so that a finer mesh of the same surface measures the same; `max` is over the
//! samples and all vertices of triangles.

use super::MeasureError;
use super::progress::Progress;
use super::query::{Best, Query};
use super::sample::{Sample, Sampler};
use super::surface::{Shift, Surface};
use crate::options::Control;
use crate::parallel;
use glam::DVec3;

/// How [`distance`] samples.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct DistanceOptions {
    /// Area samples on each side; at least 1. Default: 300,000, with which mean and rms of bunny and fandisk against their
    /// tenth repeat within 0.2 % from seed to seed.
    pub samples: usize,
    /// Another seed takes other samples. Default: 1.
    pub seed: u64,
    /// Threads to use; `None` for all of the current rayon pool. The result does not depend on it.
    pub threads: Option<usize>,
}

impl Default for DistanceOptions {
    fn default() -> Self {
        DistanceOptions { samples: 300_000, seed: 1, threads: None }
    }
}

impl DistanceOptions {
    pub(super) fn check(&self) -> Result<(), MeasureError> {
        if self.samples == 0 {
            return Err(MeasureError::Range { option: "samples", value: 0.0, range: "at least 1" });
        }
        Ok(())
    }
}

/// Quantiles of the distance: this share of the area is at most so far away.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quantiles {
    /// 50 %, the median.
    pub p50: f64,
    /// 90 %.
    pub p90: f64,
    /// 95 %.
    pub p95: f64,
    /// 99 %.
    pub p99: f64,
    /// 99.9 %.
    pub p999: f64,
}

/// A distribution of distances in a few numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// The largest distance of all samples and vertices: a lower bound of the true one.
    pub max: f64,
    /// Root of the mean square over the area samples.
    pub rms: f64,
    /// Mean over the area samples.
    pub mean: f64,
    /// Quantiles over the area samples.
    pub quantiles: Quantiles,
}

impl Summary {
    /// All numbers times `factor`; with one over the diagonal, relative distances.
    pub fn scaled(&self, factor: f64) -> Summary {
        let q = &self.quantiles;
        Summary {
            max: self.max * factor,
            rms: self.rms * factor,
            mean: self.mean * factor,
            quantiles: Quantiles {
                p50: q.p50 * factor,
                p90: q.p90 * factor,
                p95: q.p95 * factor,
                p99: q.p99 * factor,
                p999: q.p999 * factor,
            },
        }
    }

    /// The greater of both in every number.
    fn worse(&self, other: &Summary) -> Summary {
        let (q, r) = (&self.quantiles, &other.quantiles);
        Summary {
            max: self.max.max(other.max),
            rms: self.rms.max(other.rms),
            mean: self.mean.max(other.mean),
            quantiles: Quantiles {
                p50: q.p50.max(r.p50),
                p90: q.p90.max(r.p90),
                p95: q.p95.max(r.p95),
                p99: q.p99.max(r.p99),
                p999: q.p999.max(r.p999),
            },
        }
    }
}

/// A point of one surface, and the closest one of the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Farthest {
    /// The point.
    pub point: DVec3,
    /// A triangle it lies on, by its index in the input.
    pub triangle: u32,
    /// The closest point of the other surface.
    pub closest: DVec3,
    /// A triangle that one lies on, by its index in the input.
    pub closest_triangle: u32,
    /// The distance between the two.
    pub distance: f64,
}

/// The distance from one surface to the other.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct OneSided {
    /// The numbers, in model units.
    pub summary: Summary,
    /// Where the largest distance is.
    pub farthest: Farthest,
    /// Area samples taken.
    pub samples: usize,
    /// Vertices looked at.
    pub vertices: usize,
}

/// The distance between two surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Distances {
    /// From A to B.
    pub a_to_b: OneSided,
    /// From B to A.
    pub b_to_a: OneSided,
    /// The worse of both in every number, in model units.
    pub worse: Summary,
    /// Diagonal of A's bounding box.
    pub diagonal: f64,
}

impl Distances {
    pub(super) fn new(a_to_b: OneSided, b_to_a: OneSided, diagonal: f64) -> Self {
        Distances { a_to_b, b_to_a, worse: a_to_b.summary.worse(&b_to_a.summary), diagonal }
    }

    /// The worse of both, relative to A's diagonal; `None` if A is a single point.
    pub fn relative(&self) -> Option<Summary> {
        (self.diagonal > 0.0).then(|| self.worse.scaled(1.0 / self.diagonal))
    }
}

/// Points to a chunk: each begins a new search, so that results do not depend on the number of threads.
const CHUNK: usize = 1024;

/// Measures how far `a` and `b` are from each other, by samples, in both directions.
///
/// In O((samples + vertices) log n) for surfaces that are near each other. Errors: no sample asked for; cancelled.
pub fn distance(
    a: &Surface,
    b: &Surface,
    options: &DistanceOptions,
    control: &dyn Control,
) -> Result<Distances, MeasureError> {
    options.check()?;
    parallel::with_threads(options.threads, || {
        let progress = Progress::new(control, 2 * options.samples + a.points.len() + b.points.len());
        let (a_to_b, _) = one_sided(a, b, options, &progress, |_: &mut (), _, _| ())?;
        let (b_to_a, _) = one_sided(b, a, options, &progress, |_: &mut (), _, _| ())?;
        Ok(Distances::new(a_to_b, b_to_a, a.diagonal()))
    })
}

/// The distance of every vertex of `a` from `b`, by the vertex's index in the input; NaN for vertices of no triangle. Errors: cancelled.
pub fn vertex_distances(a: &Surface, b: &Surface, control: &dyn Control) -> Result<Vec<f64>, MeasureError> {
    let progress = Progress::new(control, a.points.len());
    let parts = over_vertices(a, b, &progress, |d2: &mut Vec<f64>, _, best| d2.push(best.foot.d2))?;
    let mut distances = vec![f64::NAN; a.input_vertices];
    for (&v, d2) in a.vertex_ids.iter().zip(parts.into_iter().flatten()) {
        distances[v as usize] = d2.sqrt() / b.frame.scale;
    }
    Ok(distances)
}

/// Calls `visit` for all vertices of `a` with what of `b` is closest; what became of each chunk, in order.
pub(super) fn over_vertices<T: Default + Send>(
    a: &Surface,
    b: &Surface,
    progress: &Progress<'_>,
    visit: impl Fn(&mut T, u32, &Best) + Sync + Send,
) -> Result<Vec<T>, MeasureError> {
    let shift = a.frame.to(&b.frame);
    over_chunks(a.points.len(), b, progress, |found, range, query| {
        for v in range {
            visit(found, v as u32, &query.nearest(shift.apply(a.points[v])));
        }
    })
}

/// Calls `visit` for all samples with what of `b` is closest; what became of each chunk, in order.
pub(super) fn over_samples<T: Default + Send>(
    a: &Surface,
    b: &Surface,
    sampler: &Sampler<'_>,
    progress: &Progress<'_>,
    visit: impl Fn(&mut T, &Sample, &Best) + Sync + Send,
) -> Result<Vec<T>, MeasureError> {
    let shift = a.frame.to(&b.frame);
    over_chunks(sampler.len(), b, progress, |found, range, query| {
        for sample in sampler.range(range) {
            visit(found, &sample, &query.nearest(at(a, &sample, &shift)));
        }
    })
}

/// A sample's place in the frame of the other surface.
#[inline]
fn at(a: &Surface, s: &Sample, shift: &Shift) -> DVec3 {
    shift.apply(a.point_on(s.triangle, s.v, s.w))
}

fn over_chunks<T: Default + Send>(
    n: usize,
    b: &Surface,
    progress: &Progress<'_>,
    each: impl Fn(&mut T, std::ops::Range<usize>, &mut Query<'_>) + Sync + Send,
) -> Result<Vec<T>, MeasureError> {
    let chunk = |_: &mut (), c: usize| {
        progress.check()?;
        let range = CHUNK * c..n.min(CHUNK * (c + 1));
        let (mut found, count) = (T::default(), range.len());
        each(&mut found, range, &mut b.query());
        progress.add(count);
        Ok(found)
    };
    parallel::map_init(n.div_ceil(CHUNK), || (), chunk).into_iter().collect()
}

/// The farthest so far: squared distance, sample, what is closest.
type Far = Option<(Sample, Best)>;

/// Keeps the first of the farthest.
#[inline]
fn farther(far: &mut Far, sample: &Sample, best: &Best) {
    if far.is_none_or(|f| best.foot.d2 > f.1.foot.d2) {
        *far = Some((*sample, *best));
    }
}

/// The distance from `a` to `b`; calls `also` for every sample, too: what became of each chunk, in order.
pub(super) fn one_sided<T: Default + Send>(
    a: &Surface,
    b: &Surface,
    options: &DistanceOptions,
    progress: &Progress<'_>,
    also: impl Fn(&mut T, &Sample, &Best) + Sync + Send,
) -> Result<(OneSided, Vec<T>), MeasureError> {
    #[derive(Default)]
    struct Chunk<T> {
        d: Vec<f64>,
        far: Far,
        more: T,
    }
    let sampler = Sampler::new(a, options.samples, options.seed);
    let chunks = over_samples(a, b, &sampler, progress, |c: &mut Chunk<T>, s, best| {
        c.d.push(best.foot.d2.sqrt());
        farther(&mut c.far, s, best);
        also(&mut c.more, s, best);
    })?;
    let mut more = Vec::with_capacity(chunks.len());
    let mut far = None;
    let mut all = Vec::with_capacity(options.samples);
    let (mut sum, mut squares) = (0.0, 0.0);
    for c in chunks {
        sum += c.d.iter().sum::<f64>();
        squares += c.d.iter().map(|d| d * d).sum::<f64>();
        all.extend(c.d);
        more.push(c.more);
        c.far.iter().for_each(|(s, best)| farther(&mut far, s, best));
    }
    // A vertex as a sample of a triangle that has it.
    let corner = |v: u32| {
        let t = a.triangles.iter().position(|t| t.contains(&v)).unwrap_or(0);
        let is = |k: usize| if a.triangles[t][k] == v { 1.0 } else { 0.0 };
        let (first, second) = (is(0), is(1));
        let v = if first > 0.0 { 0.0 } else { second };
        Sample { triangle: t as u32, v, w: if first + second > 0.0 { 0.0 } else { 1.0 } }
    };
    type Vertex = Option<(u32, Best)>;
    let vertices = over_vertices(a, b, progress, |far: &mut Vertex, v, best| {
        if far.is_none_or(|f| best.foot.d2 > f.1.foot.d2) {
            *far = Some((v, *best));
        }
    })?;
    let mut vertex: Vertex = None;
    for found in vertices.into_iter().flatten() {
        if vertex.is_none_or(|f| found.1.foot.d2 > f.1.foot.d2) {
            vertex = Some(found);
        }
    }
    if let Some((v, best)) = vertex
        && far.as_ref().is_none_or(|f: &(Sample, Best)| best.foot.d2 > f.1.foot.d2)
    {
        far = Some((corner(v), best));
    }
    let Some((sample, best)) = far else {
        return Err(MeasureError::NoTriangle);
    };
    let n = all.len() as f64;
    let per = 1.0 / b.frame.scale;
    let closest = b.closest_point(best);
    let summary = Summary {
        max: best.foot.d2.sqrt(),
        rms: (squares / n).sqrt(),
        mean: sum / n,
        quantiles: quantiles(&mut all),
    };
    let found = OneSided {
        summary: summary.scaled(per),
        farthest: Farthest {
            point: a.frame.world(a.point_on(sample.triangle, sample.v, sample.w)),
            triangle: a.ids[sample.triangle as usize],
            closest: closest.point,
            closest_triangle: closest.triangle,
            distance: closest.distance,
        },
        samples: options.samples,
        vertices: a.points.len(),
    };
    Ok((found, more))
}

/// By nearest rank. Leaves `d` in another order. O(n).
pub(super) fn quantiles(d: &mut [f64]) -> Quantiles {
    let n = d.len();
    let mut rest = d;
    // From above, each below what the last one left.
    let mut next = |share: f64| {
        let rank = ((share * n as f64).ceil() as usize).clamp(1, rest.len()) - 1;
        let (_, &mut value, _) = rest.select_nth_unstable_by(rank, f64::total_cmp);
        let whole = std::mem::take(&mut rest);
        rest = &mut whole[..=rank];
        value
    };
    let (p999, p99, p95, p90) = (next(0.999), next(0.99), next(0.95), next(0.9));
    Quantiles { p50: next(0.5), p90, p95, p99, p999 }
}
