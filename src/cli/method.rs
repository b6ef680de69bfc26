//! Flags of the commands that make progressive meshes.

use super::Failure;
use super::args::{self, Shape};
use clap::ValueEnum;
use progmesh::pipeline::Job;
use progmesh::simplify::{Method, Placement, Schedule};

/// How the mesh is simplified to its base.
#[derive(clap::Args, Debug)]
pub(crate) struct Making {
    /// How to simplify to the base
    #[arg(long, value_enum, default_value_t = MethodName::Quadric, help_heading = "Method")]
    method: MethodName,
    /// Where a vertex goes that replaces an edge; endpoint gives the smallest files [default: midpoint for nsa, optimal otherwise]
    #[arg(long, value_enum, help_heading = "Method")]
    placement: Option<PlacementName>,
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
    #[arg(long, help_heading = "Method")]
    lock_border: bool,
    #[command(flatten)]
    shape: Shape,
    /// Threads to use; the result does not depend on it [default: all]
    #[arg(long, value_name = "N", value_parser = args::threads, allow_negative_numbers = true)]
    pub(crate) threads: Option<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MethodName {
    /// Edge collapse while no face's normal turns by more than --epsilon (Silva & Gomes)
    Nsa,
    /// Quadric edge collapse (Garland & Heckbert)
    Quadric,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PlacementName {
    Endpoint,
    Midpoint,
    Optimal,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ScheduleName {
    Exact,
    Bulk,
}

impl Making {
    /// As the report calls it.
    pub(crate) fn method(&self) -> &'static str {
        match self.method {
            MethodName::Nsa => "nsa",
            MethodName::Quadric => "quadric",
        }
    }

    pub(crate) fn job(&self) -> Result<Job, Failure> {
        let nsa = self.method == MethodName::Nsa;
        let misplaced = [
            ("--epsilon", self.epsilon.is_some() && !nsa, "nsa"),
            ("--passes", self.passes.is_some() && !nsa, "nsa"),
            ("--schedule", self.schedule.is_some() && nsa, "quadric"),
        ];
        if let Some((flag, _, of)) = misplaced.iter().find(|m| m.1) {
            return Err(Failure::Usage(format!("{flag} is for --method {of}")));
        }
        let mut job = Job::default();
        let o = &mut job.options;
        o.method = if nsa { Method::Nsa } else { Method::Quadric };
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
