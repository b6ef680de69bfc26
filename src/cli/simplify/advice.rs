//! Why a target was missed, or nothing done, and what helps.

use super::{Args, MethodName};
use crate::cli::common::thousands;
use progmesh::pipeline::Summary;
use progmesh::simplify::Stop;

impl Args {
    /// What most likely stands in the way of the target, and what helps.
    pub(super) fn advice(&self, s: &Summary, target: usize) -> String {
        if self.method == MethodName::Cluster {
            return match self.locks() {
                _ if target == 0 => "A mesh is never left empty: ask for 1 or more".into(),
                true => "Locked vertices are not merged: lock less, or try --method quadric".into(),
                false => "Try --method quadric, which meets a target by single faces".into(),
            };
        }
        let usual = self.usual_advice(s);
        if s.least_triangles <= target {
            return usual;
        }
        let least = format!(
            "A closed surface has at least 4 faces a component, with handles more, an open one 1: here {} together",
            thousands(s.least_triangles)
        );
        // Far from that something else stands in the way.
        match s.triangles_out > 2 * s.least_triangles {
            true => format!("{least}. {usual}"),
            false => format!(
                "{least}. Ask for more, or try --weld or --prune, or --method cluster, which does not keep topology"
            ),
        }
    }

    fn usual_advice(&self, s: &Summary) -> String {
        let last = s.levels.last().map(|l| l.refused).unwrap_or_default();
        let reasons = [
            (last.normal, "normals would turn too far: try a larger --epsilon"),
            (
                last.link,
                "topology would change: try --weld or --prune, or --method cluster, which does not keep it",
            ),
            (
                last.border,
                match self.method {
                    MethodName::Quadric => "borders, seams or material borders would change: try --weld",
                    _ => "borders, seams or material borders would change: try --weld, or --method quadric",
                },
            ),
            (last.flip, "faces would flip or degenerate: try --placement endpoint or another --method"),
            (last.valence, "vertices would get too many edges: try --method cluster"),
            (
                last.locked,
                match self.locks() {
                    true => "vertices are locked: lock less",
                    false => {
                        "vertices stay where borders, seams or pieces of the surface meet: try --weld, or --method cluster"
                    }
                },
            ),
        ];
        match reasons.iter().max_by_key(|r| r.0).filter(|r| r.0 > 0) {
            Some((_, advice)) => format!("Mostly {advice}"),
            // A batch need not look at what is locked at all.
            None if self.locks() => "What is left is locked: lock less".into(),
            None => "Try --weld, --prune or --method cluster".into(),
        }
    }

    /// What to say where a bound on the cells of a grid kept all vertices apart.
    pub(super) fn nothing_merged(&self, s: &Summary) -> Option<String> {
        let nothing = self.method == MethodName::Cluster
            && self.max_error.is_some()
            && s.stop == Stop::Error
            && s.triangles_in > 0
            && s.triangles_out == s.triangles_in;
        nothing.then(|| {
            "nothing was merged: for --method cluster --max-error is the diagonal of a cell, and no two vertices of a face lie in one; \
             allow more, or try --method quadric"
                .into()
        })
    }
}
