//! What `progmesh compare --json` says beside distances.

use super::Quantiles;
use progmesh::compare::{Details, semantic_name};
use progmesh::simplify::measure;
use serde::Serialize;

#[derive(Serialize)]
pub(super) struct Report {
    normals: TwoSided,
    attributes: Vec<Attribute>,
    topology: Topologies,
    turned_triangles: usize,
    quality: Qualities,
    self_intersections: Intersections,
}

#[derive(Serialize)]
struct Attribute {
    name: String,
    #[serde(flatten)]
    deviation: TwoSided,
}

#[derive(Serialize)]
struct TwoSided {
    a_to_b: Deviation,
    b_to_a: Deviation,
    worse: Deviation,
}

#[derive(Serialize)]
struct Deviation {
    rms: f64,
    max: f64,
    samples: usize,
}

#[derive(Serialize)]
struct Topologies {
    a: Option<Topology>,
    b: Option<Topology>,
}

#[derive(Serialize)]
struct Topology {
    components: usize,
    border_loops: usize,
    genus: Option<usize>,
    euler: i64,
    non_manifold_edges: usize,
    cut_vertices: usize,
    misoriented_edges: usize,
}

#[derive(Serialize)]
struct Qualities {
    a: Quality,
    b: Quality,
}

#[derive(Serialize)]
struct Quality {
    mean: f64,
    max: f64,
    quantiles: Quantiles,
    degenerate: usize,
}

#[derive(Serialize)]
struct Intersections {
    pairs: u64,
    some: Vec<[u32; 2]>,
    degenerate: usize,
}

impl From<&Details> for Report {
    fn from(d: &Details) -> Self {
        let attribute = |(semantic, found): &(progmesh::aif::Semantic, measure::TwoSided)| Attribute {
            name: semantic_name(semantic),
            deviation: found.into(),
        };
        let [topology_a, topology_b] = d.topology.each_ref().map(|t| t.as_ref().map(Topology::from));
        let [quality_a, quality_b] = d.quality.each_ref().map(Quality::from);
        let s = &d.self_intersections;
        Report {
            normals: (&d.deviations.normals).into(),
            attributes: d.deviations.values.iter().map(attribute).collect(),
            topology: Topologies { a: topology_a, b: topology_b },
            turned_triangles: d.turned,
            quality: Qualities { a: quality_a, b: quality_b },
            self_intersections: Intersections {
                pairs: s.pairs,
                some: s.some.clone(),
                degenerate: s.degenerate,
            },
        }
    }
}

impl From<&measure::TwoSided> for TwoSided {
    fn from(t: &measure::TwoSided) -> Self {
        let one = |d: &measure::Deviation| Deviation { rms: d.rms, max: d.max, samples: d.samples };
        TwoSided { a_to_b: one(&t.a_to_b), b_to_a: one(&t.b_to_a), worse: one(&t.worse) }
    }
}

impl From<&measure::TopologySummary> for Topology {
    fn from(t: &measure::TopologySummary) -> Self {
        Topology {
            components: t.components,
            border_loops: t.border_loops,
            genus: t.genus,
            euler: t.euler,
            non_manifold_edges: t.non_manifold_edges,
            cut_vertices: t.cut_vertices,
            misoriented_edges: t.misoriented_edges,
        }
    }
}

impl From<&measure::TriangleQuality> for Quality {
    fn from(q: &measure::TriangleQuality) -> Self {
        Quality { mean: q.mean, max: q.max, quantiles: (&q.quantiles).into(), degenerate: q.degenerate }
    }
}
