//! From the chains that are left of a polygon's cycles on one side of a line to cycles again.

use std::cmp::Ordering;
use std::collections::VecDeque;

/// A place on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Node {
    /// A vertex that lies on it.
    Vertex(u32),
    /// Where the edge from this vertex to the next crosses it.
    Edge(u32),
}

/// A run of positive vertices, from the line to the line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chain {
    pub(super) start: Node,
    /// The first and the last of the positive vertices; they follow each other in their cycle.
    pub(super) first: u32,
    pub(super) last: u32,
    pub(super) end: Node,
}

/// What one cycle is, by the sides of its vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Whole {
    /// All positive.
    Inside,
    /// None positive.
    Outside,
    /// Chains were appended.
    Cut,
}

/// The vertex after `i` in the cycle of vertices `from..to`.
pub(super) fn next(i: u32, from: u32, to: u32) -> u32 {
    if i + 1 == to { from } else { i + 1 }
}

/// Appends the chains of the cycle of vertices `from..to`; `sides` are those of all vertices.
pub(super) fn chains(from: u32, to: u32, sides: &[f64], out: &mut Vec<Chain>) -> Whole {
    let s = |i: u32| sides[i as usize];
    let Some(outside) = (from..to).find(|&i| s(i) <= 0.0) else { return Whole::Inside };
    let before = out.len();
    let mut i = outside;
    loop {
        let after = next(i, from, to);
        if s(i) <= 0.0 && s(after) > 0.0 {
            let start = if s(i) < 0.0 { Node::Edge(i) } else { Node::Vertex(i) };
            out.push(Chain { start, first: after, last: after, end: start });
        } else if s(i) > 0.0
            && s(after) <= 0.0
            && let Some(chain) = out.last_mut()
        {
            chain.last = i;
            chain.end = if s(after) < 0.0 { Node::Edge(i) } else { Node::Vertex(after) };
        }
        i = after;
        if i == outside {
            break;
        }
    }
    if out.len() == before { Whole::Outside } else { Whole::Cut }
}

/// An end of a chain, for sorting.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    /// Its chain.
    pub(super) chain: u32,
    /// True if the chain begins here.
    pub(super) start: bool,
}

/// For every chain the one that follows it on the boundary of what is left.
///
/// `order` sorts ends along the line, the positive side on the left, and those at one place clockwise, by the chain's edge there. From where a chain
/// ends the boundary goes along the line to the next start, which may be at the same place. For polygons whose edges are disjoint, ends and starts
/// alternate; for others any result is as good, and every chain is used once.
pub(super) fn follow(chains: &[Chain], order: impl Fn(&End, &End) -> Ordering) -> Vec<u32> {
    if chains.len() == 1 {
        return vec![0];
    }
    let ends = |chain: u32| [End { chain, start: true }, End { chain, start: false }];
    let mut sorted: Vec<End> = (0..chains.len() as u32).flat_map(ends).collect();
    sorted.sort_by(|a, b| order(a, b).then((a.chain, a.start).cmp(&(b.chain, b.start))));
    let mut following = vec![0; chains.len()];
    let (mut led, mut taken) = (vec![false; chains.len()], vec![false; chains.len()]);
    let mut waiting = VecDeque::new();
    // Twice round: the line is closed.
    for end in sorted.iter().chain(&sorted) {
        let chain = end.chain as usize;
        if !end.start {
            if !std::mem::replace(&mut led[chain], true) {
                waiting.push_back(chain);
            }
        } else if !taken[chain]
            && let Some(before) = waiting.pop_front()
        {
            taken[chain] = true;
            following[before] = end.chain;
        }
    }
    following
}
