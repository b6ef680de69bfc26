//! How far normals, texture coordinates and colours of two surfaces are from each other, at closest points.

use super::MeasureError;
use super::distance::{self, DistanceOptions, Distances, over_samples};
use super::progress::Progress;
use super::query::Best;
use super::sample::{Sample, Sampler};
use super::surface::Surface;
use crate::options::Control;
use crate::parallel;
use glam::DVec3;
use progmesh_aif::{Mesh, NONE, Semantic};

/// Values at the corners of the triangles of a surface.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct CornerValues {
    /// What they mean. Values of the same meaning are compared.
    pub semantic: Semantic,
    /// Numbers a corner has.
    pub width: usize,
    /// `3 * width` numbers a triangle, in the order of the surface's input; NaN where a corner has no value.
    pub values: Vec<f32>,
}

impl CornerValues {
    /// Values for the corners of triangles. Errors: `values` is not a whole number of triangles.
    pub fn new(semantic: Semantic, width: usize, values: Vec<f32>) -> Result<Self, MeasureError> {
        if width == 0 || !values.len().is_multiple_of(3 * width) {
            let range = "a multiple of 3 times the width, the width not 0";
            return Err(MeasureError::Range {
                option: "length of values",
                value: values.len() as f64,
                range,
            });
        }
        Ok(CornerValues { semantic, width, values })
    }

    /// Texture coordinates and colours of a mesh, for the triangles of [`Surface::from_mesh`]. Errors: as there.
    pub fn of_mesh(mesh: &Mesh) -> Result<Vec<Self>, MeasureError> {
        let cut = match mesh.topology().is_triangular() {
            true => None,
            false => Some(mesh.clone().triangulate()?.mesh),
        };
        let mesh = cut.as_ref().unwrap_or(mesh);
        let Some(wedges) = mesh.wedges() else { return Ok(Vec::new()) };
        let t = mesh.topology();
        let wanted = |s: &Semantic| matches!(s, Semantic::TexCoord(_) | Semantic::Color(_));
        let channels = wedges.channels().iter().enumerate().filter(|(_, c)| wanted(&c.semantic));
        let of = |(k, channel): (usize, &progmesh_aif::Channel)| {
            let mut values = Vec::with_capacity(3 * channel.width * mesh.face_count());
            for f in t.faces() {
                for c in t.corner_range(f) {
                    let wedge = wedges.corner.get(c).copied().unwrap_or(NONE);
                    match wedges.get(wedge, k) {
                        Some(row) => values.extend_from_slice(row),
                        None => values.extend(std::iter::repeat_n(f32::NAN, channel.width)),
                    }
                }
            }
            CornerValues { semantic: channel.semantic.clone(), width: channel.width, values }
        };
        Ok(channels.map(of).collect())
    }

    /// The value at a point of input triangle `t`.
    fn at(&self, t: u32, v: f64, w: f64, k: usize) -> f64 {
        let row = |c: usize| f64::from(self.values[(3 * t as usize + c) * self.width + k]);
        row(0) * (1.0 - v - w) + row(1) * v + row(2) * w
    }
}

/// A deviation: root of the mean square, and the greatest, over area samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Deviation {
    /// Root of the mean square over the samples that count.
    pub rms: f64,
    /// The greatest.
    pub max: f64,
    /// How many samples count: those with a value here and at the closest point.
    pub samples: usize,
}

impl Deviation {
    fn worse(self, other: Deviation) -> Deviation {
        Deviation {
            rms: self.rms.max(other.rms),
            max: self.max.max(other.max),
            samples: self.samples + other.samples,
        }
    }
}

/// A deviation in both directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct TwoSided {
    /// At samples of A.
    pub a_to_b: Deviation,
    /// At samples of B.
    pub b_to_a: Deviation,
    /// The worse of both in every number; `samples` is their sum.
    pub worse: Deviation,
}

/// What [`deviations`] has found.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Deviations {
    /// Angle between the normals of the triangles, degrees. Triangles without area do not count.
    pub normals: TwoSided,
    /// For the values that both surfaces have: the Euclidean distance between them, in their own units.
    pub values: Vec<(Semantic, TwoSided)>,
}

/// Measures how far normals and corner values of `a` and `b` are from each other: at area samples of each, against the closest point of the
/// other.
///
/// Where the closest point is on another chart of a texture, or across a crease, values differ by that jump: `max` says where seams and
/// creases have moved rather than how much values have. Of values of different width the leading numbers that both have are compared.
///
/// Errors: no sample asked for; values for another number of triangles than the surface has; cancelled. Time as for
/// [`distance`](super::distance()).
pub fn deviations(
    (a, of_a): (&Surface, &[CornerValues]),
    (b, of_b): (&Surface, &[CornerValues]),
    options: &DistanceOptions,
    control: &dyn Control,
) -> Result<Deviations, MeasureError> {
    options.check()?;
    let pairs = Pairs::new((a, of_a), (b, of_b))?;
    parallel::with_threads(options.threads, || {
        let progress = Progress::new(control, 2 * options.samples);
        let one_sided = |a: &Surface, b: &Surface, pairs: &[[&CornerValues; 2]]| {
            let sampler = Sampler::new(a, options.samples, options.seed);
            over_samples(a, b, &sampler, &progress, visit(a, b, pairs))
        };
        let to = one_sided(a, b, &pairs.ahead)?;
        let fro = one_sided(b, a, &pairs.back)?;
        Ok(pairs.deviations(to, fro))
    })
}

/// [`distance`](super::distance()) and [`deviations`] at once: their samples are the same, so the closest points are looked for only once.
///
/// Errors: as those.
pub fn distance_and_deviations(
    (a, of_a): (&Surface, &[CornerValues]),
    (b, of_b): (&Surface, &[CornerValues]),
    options: &DistanceOptions,
    control: &dyn Control,
) -> Result<(Distances, Deviations), MeasureError> {
    options.check()?;
    let pairs = Pairs::new((a, of_a), (b, of_b))?;
    parallel::with_threads(options.threads, || {
        let progress = Progress::new(control, 2 * options.samples + a.points.len() + b.points.len());
        let (a_to_b, to) = distance::one_sided(a, b, options, &progress, visit(a, b, &pairs.ahead))?;
        let (b_to_a, fro) = distance::one_sided(b, a, options, &progress, visit(b, a, &pairs.back))?;
        Ok((Distances::new(a_to_b, b_to_a, a.diagonal()), pairs.deviations(to, fro)))
    })
}

/// The values that both surfaces have: those of A first, then those of B first.
struct Pairs<'a> {
    ahead: Vec<[&'a CornerValues; 2]>,
    back: Vec<[&'a CornerValues; 2]>,
}

impl<'a> Pairs<'a> {
    fn new(
        (a, of_a): (&Surface, &'a [CornerValues]),
        (b, of_b): (&Surface, &'a [CornerValues]),
    ) -> Result<Self, MeasureError> {
        for (surface, values) in [(a, of_a), (b, of_b)] {
            for v in values {
                let want = 3 * v.width * surface.triangle_count();
                if v.width == 0 || v.values.len() != want {
                    let range = "3 times the width for every triangle";
                    let value = v.values.len() as f64;
                    return Err(MeasureError::Range { option: "length of values", value, range });
                }
            }
        }
        let other = |x: &CornerValues| of_b.iter().find(|y| y.semantic == x.semantic);
        let ahead: Vec<_> = of_a.iter().filter_map(|x| other(x).map(|y| [x, y])).collect();
        let back = ahead.iter().map(|&[x, y]| [y, x]).collect();
        Ok(Pairs { ahead, back })
    }

    fn deviations(&self, to: Vec<Vec<Sum>>, fro: Vec<Vec<Sum>>) -> Deviations {
        let n = self.ahead.len() + 1;
        let mut both = total(to, n).into_iter().zip(total(fro, n)).map(|(to, fro)| TwoSided {
            a_to_b: to,
            b_to_a: fro,
            worse: to.worse(fro),
        });
        let normals = both.next().unwrap_or_default();
        let semantics = self.ahead.iter().map(|p| p[0].semantic.clone());
        Deviations { normals, values: semantics.zip(both).collect() }
    }
}

/// Sums over samples.
#[derive(Clone, Copy, Default)]
struct Sum {
    squares: f64,
    max: f64,
    samples: usize,
}

impl Sum {
    fn add(&mut self, square: f64) {
        if !square.is_nan() {
            self.squares += square;
            self.max = self.max.max(square);
            self.samples += 1;
        }
    }
}

/// Adds up what the samples of `a` say: of the normals, then of all pairs of values.
fn visit<'a>(
    a: &'a Surface,
    b: &'a Surface,
    pairs: &'a [[&CornerValues; 2]],
) -> impl Fn(&mut Vec<Sum>, &Sample, &Best) + Sync + Send + 'a {
    move |sums, s, best| {
        sums.resize(pairs.len() + 1, Sum::default());
        let angle = angle(a.normal(s.triangle), b.normal(best.triangle)).to_degrees();
        sums[0].add(angle * angle);
        let (t, u) = (a.ids[s.triangle as usize], b.ids[best.triangle as usize]);
        for (sum, [x, y]) in sums[1..].iter_mut().zip(pairs) {
            let difference = |k| x.at(t, s.v, s.w, k) - y.at(u, best.foot.v, best.foot.w, k);
            sum.add((0..x.width.min(y.width)).map(|k| difference(k).powi(2)).sum());
        }
    }
}

/// All chunks together.
fn total(chunks: Vec<Vec<Sum>>, n: usize) -> Vec<Deviation> {
    let mut all = vec![Sum::default(); n];
    for chunk in chunks {
        for (sum, part) in all.iter_mut().zip(chunk) {
            sum.squares += part.squares;
            sum.max = sum.max.max(part.max);
            sum.samples += part.samples;
        }
    }
    let deviation = |s: Sum| Deviation {
        rms: (s.squares / s.samples.max(1) as f64).sqrt(),
        max: s.max.sqrt(),
        samples: s.samples,
    };
    all.into_iter().map(deviation).collect()
}

/// The angle between two vectors, exact for small ones too; NaN if one is zero.
fn angle(x: DVec3, y: DVec3) -> f64 {
    if x == DVec3::ZERO || y == DVec3::ZERO {
        return f64::NAN;
    }
    // Kahan: no cancellation at either end.
    let (p, q) = (x * y.length(), y * x.length());
    2.0 * (p - q).length().atan2((p + q).length())
}

/// Triangles of `b` that face the other way than the surface `a` where they lie, by their index in the input.
///
/// A triangle counts if four points of it (the centre, and halfway from there to each corner) are closest to triangles of `a` whose normals point
/// away from its own. On sheets thinner than the distance between the surfaces the closest triangle may be one of the other side, and be
/// counted. Errors: cancelled.
pub fn turned_triangles(a: &Surface, b: &Surface, control: &dyn Control) -> Result<Vec<u32>, MeasureError> {
    let progress = Progress::new(control, b.triangle_count());
    let shift = b.frame.to(&a.frame);
    let chunks: Vec<Result<Vec<u32>, MeasureError>> = parallel::map_init_chunks(
        &b.triangles,
        1024,
        || (),
        |_, first, chunk| {
            progress.check()?;
            let mut query = a.query();
            let mut turned = Vec::new();
            for t in first..first + chunk.len() {
                let (corners, normal) = (b.corners(t), b.normal(t as u32));
                let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
                let mut away = |p: DVec3| normal.dot(a.normal(query.nearest(shift.apply(p)).triangle)) < 0.0;
                if away(centre) && corners.iter().all(|&c| away((centre + c) * 0.5)) {
                    turned.push(b.ids[t]);
                }
            }
            progress.add(chunk.len());
            Ok(turned)
        },
    );
    let mut all = Vec::new();
    for chunk in chunks {
        all.extend(chunk?);
    }
    all.sort_unstable();
    Ok(all)
}
