//! What splits need by the ring rule beside what their cuts need, of a mesh in any order that carries settled bounds: what files hold of it for views that have no rings.

use super::rings::Needs;
use super::{Bounds, Guarantee, Rule, by_turns, finest};
use crate::aif::NONE;
use crate::progressive::{Damage, ProgressiveMesh};

/// For every split those that it needs by the ring rule, directly, beside those of [`ProgressiveMesh::dependencies`]: with these all that it needs follows.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Further {
    /// Where those of each begin, and the end of the last; empty by other rules.
    starts: Vec<u32>,
    on: Vec<u32>,
}

impl Further {
    /// Of a mesh in whatever order its splits are. O(n log n).
    ///
    /// Errors: damage; bounds that are not settled, or not for it.
    pub(crate) fn new(mesh: &ProgressiveMesh, bounds: &Bounds) -> Result<Further, Damage> {
        let n = mesh.splits.len();
        if bounds.guarantee() != Guarantee::Settled || bounds.turns.len() != n {
            return Err(Damage::Length { what: "turns", len: bounds.turns.len(), want: n });
        }
        let order = by_turns(&bounds.turns);
        let settled = mesh.reordered(&order).map_err(|e| Damage::Bounds(e.0 as usize))?;
        let (forest, _, turns) = finest(&settled, Rule::Rings)?;
        let turns = turns.ok_or(Damage::Bounds(0))?;
        if let Some(k) = turns.iter().zip(&order).position(|(&t, &i)| t != bounds.turns[i as usize]) {
            return Err(Damage::Bounds(order[k] as usize));
        }
        let mut place = vec![0; n];
        order.iter().zip(0..).for_each(|(&i, k)| place[i as usize] = k);
        let mut out = Further { starts: Vec::with_capacity(n + 1), on: Vec::new() };
        out.starts.push(0);
        let mut paths = Paths { needs: &forest.needs, ahead: Vec::new(), seen: Vec::new() };
        let mut all = Vec::new();
        for (cuts, &k) in mesh.dependencies().iter().zip(&place) {
            all.clear();
            all.extend(cuts.iter().filter(|&&d| d != NONE).map(|&d| place[d as usize]));
            let own = all.len();
            for d in forest.needs.of(k).iter() {
                if !all[..own].contains(&d) {
                    all.push(d);
                }
            }
            for j in own..all.len() {
                if !paths.lead_to(all[j], &all) {
                    out.on.push(order[all[j] as usize]);
                }
            }
            out.starts.push(out.on.len() as u32);
        }
        Ok(out)
    }

    /// Those of split `i`.
    pub(crate) fn of(&self, i: u32) -> &[u32] {
        let at = |k: usize| self.starts.get(k).copied().unwrap_or(0) as usize;
        self.on.get(at(i as usize)..at(i as usize + 1)).unwrap_or_default()
    }

    /// Those of the same mesh with split `order[k]` as the `k`-th.
    pub(crate) fn reordered(&self, order: &[u32]) -> Further {
        let mut place = vec![0; order.len()];
        order.iter().zip(0..).for_each(|(&i, k)| place[i as usize] = k);
        let mut out = Further { starts: vec![0], on: Vec::with_capacity(self.on.len()) };
        for &i in order {
            out.on.extend(self.of(i).iter().map(|&d| place[d as usize]));
            out.starts.push(out.on.len() as u32);
        }
        out
    }
}

/// Ways from split to split along what they need.
struct Paths<'a> {
    needs: &'a Needs,
    ahead: Vec<u32>,
    seen: Vec<u32>,
}

/// Splits that are looked at for one way, at most: most of those that there are take about five.
const MOST: usize = 64;

impl Paths<'_> {
    /// One of `from` that is not `to` needs `to` through others, as far as is looked. Splits are in an order in which what is needed comes before.
    fn lead_to(&mut self, to: u32, from: &[u32]) -> bool {
        self.ahead.clear();
        self.seen.clear();
        self.ahead.extend(from.iter().filter(|&&i| i > to));
        while let Some(i) = self.ahead.pop() {
            if self.seen.contains(&i) {
                continue;
            }
            if self.seen.len() == MOST {
                return false;
            }
            self.seen.push(i);
            for d in self.needs.of(i).iter() {
                if d == to {
                    return true;
                }
                if d > to {
                    self.ahead.push(d);
                }
            }
        }
        false
    }
}
