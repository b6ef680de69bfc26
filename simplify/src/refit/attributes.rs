//! Attributes follow the vertices that a refit moved.

use super::net::{Net, corners_from};
use crate::collapser::Collapser;
use crate::measure::triangle::closest;
use crate::wedges::{Side, WedgeMerge};
use crate::work::{Kind, Work, wedge_at};
use glam::DVec3;
use progmesh_aif::{NONE, VertexId, Wedges};

/// Gives the wedges of every vertex of `net` that is no longer at `start` the values that the surface had there: on the nearest point of
/// the faces around it, as they were before the refit; of its seam, where it is on one, so that what is equal on both sides stays equal. All values
/// are read before one is written. To be called before the work's points follow. O(n).
pub(super) fn follow(c: &mut Collapser<'_>, net: &Net, start: &[DVec3]) {
    if !c.wedges.active() {
        return;
    }
    let Some(mut wedges) = c.work.mesh.wedges_mut().take() else { return };
    let mut sides = Vec::new();
    let (mut changed, mut rows) = (Vec::new(), Vec::new());
    for v in (0..net.points.len()).filter(|&v| net.points[v] != start[v]) {
        sides.clear();
        if net.kinds[v] == Kind::Seam {
            along_seam(&c.work, &wedges, net, start, v as u32, &mut sides);
        } else {
            sides.extend(on_face(&c.work, &wedges, net, start, v as u32));
        }
        for side in sides.iter().filter(|s| s.wedges[0] != NONE && s.weights[0] < 1.0) {
            changed.push(side.wedges[0]);
            rows.extend_from_slice(blended(&mut c.wedges, &wedges, side));
        }
    }
    for (i, &w) in changed.iter().enumerate() {
        let stride = wedges.stride();
        wedges.row_mut(w).copy_from_slice(&rows[i * stride..(i + 1) * stride]);
    }
    *c.work.mesh.wedges_mut() = Some(wedges);
}

/// The row at the new place; channels that the vertex has not stay as they are.
fn blended<'a>(merge: &'a mut WedgeMerge, wedges: &Wedges, side: &Side) -> &'a [f32] {
    let row = merge.blend(wedges, side);
    let own = side.wedges[0];
    for (k, channel) in wedges.channels().iter().enumerate() {
        if wedges.get(own, k).is_none() {
            let range = wedges.offset(k)..wedges.offset(k) + channel.width;
            row[range.clone()].copy_from_slice(&wedges.row(own)[range]);
        }
    }
    row
}

/// The place on the nearest face around `v`.
fn on_face(work: &Work<'_>, wedges: &Wedges, net: &Net, start: &[DVec3], v: u32) -> Option<Side> {
    let to = net.points[v as usize];
    let mut best = f64::INFINITY;
    let mut found = None;
    for &f in net.around.of(v) {
        let corners = corners_from(net.triangles[f as usize], v);
        let foot = closest(corners.map(|x| start[x as usize]), to);
        if foot.d2 < best {
            best = foot.d2;
            found = Some((f, corners, [1.0 - foot.v - foot.w, foot.v, foot.w]));
        }
    }
    let (f, corners, weights) = found?;
    Some(Side { wedges: corners.map(|x| at(work, wedges, net, f, x)), weights })
}

/// The place on the nearest seam edge at `v`, for the faces on both sides.
fn along_seam(work: &Work<'_>, wedges: &Wedges, net: &Net, start: &[DVec3], v: u32, sides: &mut Vec<Side>) {
    let (to, from) = (net.points[v as usize], start[v as usize]);
    let mut best = f64::INFINITY;
    let mut found = None;
    for &c in net.curves_at.of(v) {
        let ends = net.curves[c as usize].0;
        let other = if ends[0] == v { ends[1] } else { ends[0] };
        let side = start[other as usize] - from;
        let length = side.length_squared();
        let s = if length > 0.0 { ((to - from).dot(side) / length).clamp(0.0, 1.0) } else { 0.0 };
        let d2 = (from + side * s).distance_squared(to);
        if d2 < best {
            best = d2;
            found = Some((other, s));
        }
    }
    let Some((other, s)) = found else { return };
    for &f in net.around.of(v).iter().filter(|&&f| net.triangles[f as usize].contains(&other)) {
        let [own, theirs] = [v, other].map(|x| at(work, wedges, net, f, x));
        sides.push(Side { wedges: [own, theirs, own], weights: [1.0 - s, s, 0.0] });
    }
}

/// The wedge of face `f` at vertex `v`, numbers of the net.
fn at(work: &Work<'_>, wedges: &Wedges, net: &Net, f: u32, v: u32) -> u32 {
    let v: VertexId = net.vertices[v as usize];
    wedge_at(work.mesh, wedges, net.faces[f as usize], v)
}
