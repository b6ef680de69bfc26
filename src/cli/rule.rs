//! `--rule`: when a split may be made; `--error`: how errors count.

use super::Failure;
use clap::ValueEnum;
use progmesh::progressive::ProgressiveScene;
use progmesh::refine::hierarchy::{Guarantee, Options, Rule};
use progmesh::refine::selective::View;
use progmesh::refine::truly::Guarded;
use progmesh::selective::{Deviation, PagedScene, SelectiveScene};
use serde::Serialize;

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RuleName {
    /// When all that was split before it around its vertex is: errors are proven
    Rings,
    /// When the faces on its cuts are there (the l/r rule): errors are measured
    Cuts,
    /// When its vertex is there and its cut vertices are two (truly selective, after Kim & Lee): fewest faces, errors may pass --tau
    Truly,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ErrorName {
    /// By its length, whichever way it lies
    Uniform,
    /// What lies along the line of sight counts a quarter: fewer faces where a surface is seen from above
    Directional,
}

/// Flags about the rule.
#[derive(clap::Args, Debug)]
pub(crate) struct RuleArgs {
    /// When a split may be made [default: rings; of a .pm with bounds, the rule they are for]
    #[arg(long, value_enum, help_heading = "View")]
    rule: Option<RuleName>,
    /// With --rule truly: do not hold faces from turning over
    #[arg(long, requires = "rule", help_heading = "View")]
    no_guard: bool,
    /// How a deviation counts that is held against --tau
    #[arg(long, value_enum, value_name = "HOW", default_value_t = ErrorName::Uniform, help_heading = "View")]
    error: ErrorName,
}

/// What the flip guard did: a part of the schema of `--json`.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(crate) struct Guard {
    deferred: usize,
    through: usize,
    turned: usize,
}

impl RuleArgs {
    /// Fails where flags do not go together.
    pub(crate) fn check(&self, memory: bool) -> Result<(), Failure> {
        let wrong = |text: &str| Err(Failure::Usage(text.into()));
        match self.rule {
            Some(RuleName::Truly) if memory => wrong(
                "--memory and --rule truly do not go together: that rule looks at parts of the mesh that are not shown, which are not read then",
            ),
            Some(RuleName::Rings | RuleName::Cuts) if self.no_guard => {
                wrong("--no-guard is for --rule truly")
            }
            _ if !self.is_directional() => Ok(()),
            Some(RuleName::Cuts | RuleName::Truly) => wrong(
                "--error directional is for --rule rings: by the other rules it is not known which way deviations lie",
            ),
            _ if memory => wrong(
                "--memory and --error directional do not go together: what is read in parts does not know which way deviations lie",
            ),
            _ => Ok(()),
        }
    }

    /// None was asked for, nor that errors count otherwise than by their length.
    pub(crate) fn is_any(&self) -> bool {
        self.rule.is_none() && !self.is_directional()
    }

    pub(crate) fn is_truly(&self) -> bool {
        self.rule == Some(RuleName::Truly)
    }

    /// The flip guard is on.
    pub(crate) fn guard(&self) -> bool {
        !self.no_guard
    }

    fn is_directional(&self) -> bool {
        self.error == ErrorName::Directional
    }

    /// How deviations count, and are measured.
    pub(crate) fn deviation(&self) -> Deviation {
        if self.is_directional() { Deviation::Directional } else { Deviation::Uniform }
    }

    /// The same, as reports call it.
    pub(crate) fn error(&self) -> &'static str {
        if self.is_directional() { "directional" } else { "uniform" }
    }

    /// Lets errors of the scene count as asked for; says so where they cannot.
    pub(crate) fn apply(&self, scene: &mut SelectiveScene, file: &str) -> Option<String> {
        scene.set_deviation(self.deviation());
        let known = |v: &&View| v.hierarchy().all_bounds().has_directions();
        let without = scene.views().iter().filter(|v| !known(v)).count();
        (self.is_directional() && without > 0).then(|| {
            let meshes = progmesh::pipeline::count(without, "mesh");
            format!(
                "{file}: the ring rule does not hold for {meshes}: errors there count whichever way they lie"
            )
        })
    }

    /// How hierarchies are made. Bounds that meshes carry and that are for another rule than was asked for are dropped, so that they are measured.
    pub(crate) fn options(&self, scene: &mut ProgressiveScene) -> Options {
        let other = |g: Guarantee| match self.rule {
            Some(RuleName::Rings) => g != Guarantee::Settled,
            Some(RuleName::Cuts) => g == Guarantee::Settled,
            Some(RuleName::Truly) | None => false,
        };
        let directional = self.is_directional();
        for mesh in &mut scene.meshes {
            if mesh
                .bounds
                .as_ref()
                .is_some_and(|b| other(b.guarantee()) || directional && !b.has_directions())
            {
                mesh.bounds = None;
            }
        }
        let options = if self.rule == Some(RuleName::Cuts) { Options::CUTS } else { Options::default() };
        options.with_directions(directional)
    }

    /// The rule by which a file is refined that is read in parts, as reports call it: what its bounds are for.
    ///
    /// Fails if another was asked for.
    pub(crate) fn name_of_paged(&self, scene: &PagedScene, file: &str) -> Result<&'static str, Failure> {
        let name = if scene.rule() == Rule::Rings { "rings" } else { "cuts" };
        let other = match self.rule {
            Some(RuleName::Rings) => name != "rings",
            Some(RuleName::Cuts) => name != "cuts",
            _ => false,
        };
        match other {
            true => Err(Failure::Input(format!(
                "{file}: what it says for reading in parts is for the rule of {name}: leave --rule out, or --memory"
            ))),
            false => Ok(name),
        }
    }

    /// The rule by which `scene` is refined, as reports call it: of several meshes the weakest.
    pub(crate) fn name(&self, scene: &SelectiveScene) -> &'static str {
        let by_rings = || scene.views().iter().all(|v| v.hierarchy().rule() == Rule::Rings);
        match self.rule {
            Some(RuleName::Truly) => "truly",
            _ if by_rings() => "rings",
            _ => "cuts",
        }
    }
}

impl Guard {
    /// Of a frame.
    pub(crate) fn of(g: Guarded) -> Guard {
        Guard { deferred: g.deferred, through: g.through, turned: g.turned }
    }

    /// Of one frame after another: what was done is added up, what is deferred is so anew in every frame.
    pub(crate) fn note(&mut self, g: Guarded) {
        self.deferred = self.deferred.max(g.deferred);
        self.through += g.through;
        self.turned += g.turned;
    }

    /// For people.
    pub(crate) fn text(self) -> String {
        let Guard { deferred, through, turned } = self;
        format!(
            "flip guard: {deferred} collapses deferred, {through} splits made before others, {turned} turned a face"
        )
    }
}
