//! `--rule`: when a split may be made.

use super::Failure;
use clap::ValueEnum;
use progmesh::progressive::ProgressiveScene;
use progmesh::refine::hierarchy::{Guarantee, Options, Rule};
use progmesh::refine::truly::Guarded;
use progmesh::selective::SelectiveScene;
use serde::Serialize;

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RuleName {
    /// When all that was split before it around its vertex is: errors are proven at samples
    Rings,
    /// When the faces on its cuts are there (the l/r rule): errors are measured
    Cuts,
    /// When its vertex is there and its cut vertices are two (truly selective, after Kim & Lee): fewest faces, errors may pass --tau
    Truly,
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
            Some(_) if memory => {
                wrong("--memory and --rule do not go together: what is read in parts has the rule of cuts")
            }
            Some(RuleName::Rings | RuleName::Cuts) if self.no_guard => {
                wrong("--no-guard is for --rule truly")
            }
            _ => Ok(()),
        }
    }

    pub(crate) fn is_truly(&self) -> bool {
        self.rule == Some(RuleName::Truly)
    }

    /// The flip guard is on.
    pub(crate) fn guard(&self) -> bool {
        !self.no_guard
    }

    /// How hierarchies are made. Bounds that meshes carry and that are for another rule than was asked for are dropped, so that they are measured.
    pub(crate) fn options(&self, scene: &mut ProgressiveScene) -> Options {
        let other = |g: Guarantee| match self.rule {
            Some(RuleName::Rings) => g != Guarantee::Settled,
            Some(RuleName::Cuts) => g == Guarantee::Settled,
            Some(RuleName::Truly) | None => false,
        };
        for mesh in &mut scene.meshes {
            if mesh.bounds.as_ref().is_some_and(|b| other(b.guarantee())) {
                mesh.bounds = None;
            }
        }
        if self.rule == Some(RuleName::Cuts) { Options::CUTS } else { Options::default() }
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
