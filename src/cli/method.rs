//! Flags of the commands that collapse edges: `simplify`, and those that make progressive meshes.

use super::Failure;
use super::args::{self, Shape};
use clap::ValueEnum;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use progmesh::pipeline::Job;
use progmesh::simplify::{Method, Placement, Schedule};

/// How the mesh is simplified to its base.
#[derive(clap::Args, Debug)]
pub(crate) struct Making {
    /// How to simplify to the base
    #[arg(long, value_parser = recorded(), default_value = "quadric", help_heading = "Method")]
    method: MethodName,
    #[command(flatten)]
    pub(crate) collapsing: Collapsing,
}

/// How edges are collapsed.
#[derive(clap::Args, Debug)]
pub(crate) struct Collapsing {
    /// Where a vertex goes that replaces an edge (or a cluster) [default: midpoint for nsa, optimal otherwise]
    ///
    /// Progressive meshes are smallest with endpoint.
    #[arg(long, value_enum, help_heading = "Method")]
    pub(crate) placement: Option<PlacementName>,
    /// quadric: always the cheapest edge, or batches of cheap ones [default: bulk]
    #[arg(long, value_enum, help_heading = "Method")]
    schedule: Option<ScheduleName>,
    /// nsa: the most a face's normal may turn in one collapse, degrees [default: 12]
    #[arg(long, value_name = "DEG", value_parser = args::degrees, allow_negative_numbers = true,
          help_heading = "Method")]
    epsilon: Option<f64>,
    /// nsa: at most this many passes
    #[arg(long, value_name = "K", value_parser = args::positive, allow_negative_numbers = true,
          help_heading = "Method")]
    passes: Option<usize>,
    /// Vertices on a border neither move nor go
    #[arg(long, help_heading = "What stays")]
    pub(crate) lock_border: bool,
    #[command(flatten)]
    shape: Shape,
    /// Threads to use; the result does not depend on it [default: all]
    #[arg(long, value_name = "N", value_parser = args::threads, allow_negative_numbers = true)]
    pub(crate) threads: Option<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodName {
    /// Edge collapse while no face's normal turns by more than --epsilon (Silva & Gomes)
    Nsa,
    /// Quadric edge collapse (Garland & Heckbert)
    Quadric,
    /// Vertex clustering on a grid: fastest, coarsest, does not keep topology
    Cluster,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PlacementName {
    Endpoint,
    Midpoint,
    Optimal,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ScheduleName {
    Exact,
    Bulk,
}

/// The methods that are sequences of collapses, which a progressive mesh needs; the other one is told why it is none.
fn recorded() -> impl TypedValueParser<Value = MethodName> {
    let shown = |m: &MethodName| m.to_possible_value().map(|v| v.hide(*m == MethodName::Cluster));
    PossibleValuesParser::new(MethodName::value_variants().iter().filter_map(shown)).try_map(|name| {
        match MethodName::from_str(&name, false)? {
            MethodName::Cluster => Err(
                "clustering merges whole cells, which no vertex splits lead back from; use quadric or nsa \
                 here, or cluster with progmesh simplify"
                    .to_string(),
            ),
            method => Ok(method),
        }
    })
}

impl MethodName {
    /// As reports call it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            MethodName::Nsa => "nsa",
            MethodName::Quadric => "quadric",
            MethodName::Cluster => "cluster",
        }
    }

    /// Refuses a flag that was given and is for another method.
    pub(crate) fn allow(self, flag: &str, given: bool, of: MethodName) -> Result<(), Failure> {
        match given && self != of {
            true => Err(Failure::Usage(format!("{flag} is for --method {}", of.name()))),
            false => Ok(()),
        }
    }
}

impl Making {
    /// As the report calls it.
    pub(crate) fn method(&self) -> &'static str {
        self.method.name()
    }

    pub(crate) fn job(&self) -> Result<Job, Failure> {
        self.collapsing.job(self.method)
    }
}

impl Collapsing {
    /// A job by this method, without target.
    pub(crate) fn job(&self, method: MethodName) -> Result<Job, Failure> {
        method.allow("--epsilon", self.epsilon.is_some(), MethodName::Nsa)?;
        method.allow("--passes", self.passes.is_some(), MethodName::Nsa)?;
        method.allow("--schedule", self.schedule.is_some(), MethodName::Quadric)?;
        let mut job = Job::default();
        let o = &mut job.options;
        o.method = match method {
            MethodName::Nsa => Method::Nsa,
            MethodName::Quadric => Method::Quadric,
            MethodName::Cluster => Method::Cluster,
        };
        o.placement = self.placement.map(|p| match p {
            PlacementName::Endpoint => Placement::Endpoint,
            PlacementName::Midpoint => Placement::Midpoint,
            PlacementName::Optimal => Placement::Optimal,
        });
        o.schedule = self.schedule.map(|s| match s {
            ScheduleName::Exact => Schedule::Exact,
            ScheduleName::Bulk => Schedule::Bulk,
        });
        o.epsilon = self.epsilon;
        o.passes = self.passes;
        o.lock_border = self.lock_border;
        o.threads = self.threads;
        job.weld = self.shape.weld();
        job.normals = self.shape.normals()?;
        Ok(job)
    }
}
