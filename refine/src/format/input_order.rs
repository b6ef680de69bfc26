//! The chunk with the input's numbering: read after all splits of its mesh, and coded against them.

use super::coder::{Bit, Coder, Decoder, Encoder, Number};
use super::{places, plan};
use crate::aif::NONE;
use crate::progressive::{InputOrder, Polygons, ProgressiveMesh, SplitCode};

/// Numbers the vertices of the base along a curve through space, so that each is near the one before: what the numbering of a mesh whose order is not kept should be. With
/// attributes nothing is done: wedges are near each other by the numbers of vertices.
pub(super) fn sort_base(pm: &mut ProgressiveMesh) {
    if pm.wedges.is_some() {
        return;
    }
    let order = plan::base_order(pm);
    let mut number = vec![0; order.len()];
    let mut positions = places::empty(pm.base_positions.is_f64());
    for (&v, k) in order.iter().zip(0u32..) {
        number[v as usize] = k;
        places::push(&mut positions, places::point(&pm.base_positions, v as usize));
    }
    pm.base_positions = positions;
    let all = pm.base_faces.as_flattened_mut().iter_mut();
    for v in all.chain(pm.wires.as_flattened_mut()).chain(&mut pm.splits.vertex) {
        if let Some(&k) = number.get(*v as usize) {
            *v = k;
        }
    }
}

/// Where the tips of the faces that splits make are among their corners: 0..3 each, by face, base faces left out.
pub(super) fn tips(pm: &ProgressiveMesh) -> Vec<u8> {
    let mut tips = Vec::with_capacity(2 * pm.splits.len());
    for code in &pm.splits.code {
        tips.push(code.left().0 as u8);
        if code.two_faces() {
            tips.push(code.right().0 as u8);
        }
    }
    tips
}

/// Turns the corners of the faces that splits make by `tips`, forwards or back.
pub(super) fn turn(pm: &mut ProgressiveMesh, tips: &[u8], back: bool) {
    let base = pm.base_faces.len();
    let cut = |c: u32| {
        let tip =
            ((c >> 2) as usize).checked_sub(base).and_then(|f| tips.get(f)).copied().unwrap_or(0) as u32;
        let turned = ((c & 3) + if back { 3 - tip } else { tip }) % 3;
        if c == NONE { c } else { (c & !3) | turned }
    };
    pm.splits.left.iter_mut().for_each(|c| *c = cut(*c));
    pm.splits.right.iter_mut().for_each(|c| *c = cut(*c));
    let mut next = tips.iter().map(|&t| t as u16);
    for code in &mut pm.splits.code {
        let plain = super::splits::without_arrangement(*code);
        let mut tip = || if back { 0 } else { next.next().unwrap_or(0) };
        let left = tip();
        let right = if code.two_faces() { tip() } else { 0 };
        *code = SplitCode(plain.0 + left + (right << 3));
    }
}

#[derive(Default)]
struct Models {
    tip: [Bit; 4],
    vertex: Number,
    face: [Number; 2],
    wedge: Number,
    size: Number,
    corner: [Number; 3],
    list: [Number; 3],
}

/// What the order of a mesh takes in memory, and a bound on it while reading.
struct Budget(u64);

impl Budget {
    fn take(&mut self, bytes: u64) -> Option<()> {
        self.0 = self.0.checked_sub(bytes)?;
        Some(())
    }
}

/// Bytes in memory.
pub(super) fn raw_bytes(order: &InputOrder, tips: usize) -> u64 {
    (order.bytes() + tips) as u64
}

fn fits(x: i64) -> Option<u32> {
    u32::try_from(x).ok()
}

fn code<C: Coder>(
    c: &mut C,
    pm: &ProgressiveMesh,
    tips: &mut Vec<u8>,
    order: &mut InputOrder,
    raw: u64,
) -> Option<()> {
    let mut m = Models::default();
    let mut budget = Budget(raw);
    let (n0, m0) = (pm.base_vertices(), pm.base_faces.len());
    let faces = pm.faces();
    // Tips.
    budget.take((faces - m0) as u64)?;
    for i in 0..faces - m0 {
        let tip = if C::READS { 0 } else { tips[i] };
        let tip = c.symbol(&mut m.tip, 2, tip as u32);
        if tip > 2 {
            return None;
        }
        if C::READS {
            tips.push(tip as u8);
            if c.spent() {
                return None;
            }
        }
    }
    // Vertices: near the one that was split.
    budget.take(4 * pm.vertices() as u64)?;
    for i in 0..pm.vertices() {
        let near = match i.checked_sub(n0) {
            Some(split) => order.vertex.get(pm.splits.vertex[split] as usize).copied(),
            None => i.checked_sub(1).map(|k| order.vertex[k]),
        };
        let near = near.unwrap_or(0) as i64;
        let v = if C::READS { 0 } else { order.vertex[i] as i64 };
        let v = fits(c.signed(&mut m.vertex, v - near).wrapping_add(near))
            .filter(|&v| (v as usize) < pm.vertices())?;
        if C::READS {
            order.vertex.push(v);
            if c.spent() {
                return None;
            }
        }
    }
    // Faces: near the face that the cut names.
    budget.take(4 * faces as u64)?;
    let one = |c: &mut C, m: &mut Number, order: &mut InputOrder, near: u32, f: usize| {
        let near = order.face.get(near as usize).copied().unwrap_or(0) as i64;
        let x = if C::READS { 0 } else { order.face[f] as i64 };
        let x = fits(c.signed(m, x - near).wrapping_add(near)).filter(|&x| (x as usize) < faces)?;
        if C::READS {
            order.face.push(x);
        }
        Some(())
    };
    for f in 0..m0 {
        one(c, &mut m.face[0], order, (f as u32).wrapping_sub(1), f)?;
        if c.spent() {
            return None;
        }
    }
    let mut f = m0;
    for i in 0..pm.splits.len() {
        one(c, &mut m.face[0], order, pm.splits.left[i] >> 2, f)?;
        f += 1;
        if pm.splits.code[i].two_faces() {
            one(c, &mut m.face[1], order, pm.splits.right[i] >> 2, f)?;
            f += 1;
        }
        if c.spent() {
            return None;
        }
    }
    list(c, &mut m, order, &mut budget)?;
    Some(())
}

/// Polygons, wedges and exceptions.
fn list<C: Coder>(c: &mut C, m: &mut Models, order: &mut InputOrder, budget: &mut Budget) -> Option<()> {
    let count = c.number(&mut m.list[0], order.polygons.as_ref().map_or(0, |p| p.sizes.len() as u64 + 1));
    if count > 0 {
        let p = order.polygons.get_or_insert_default();
        let mut next = 0;
        for i in 0..count - 1 {
            let size = c.number(&mut m.size, if C::READS { 0 } else { p.sizes[i as usize] as u64 });
            budget.take(size.checked_mul(4)?.checked_add(4)?)?;
            if C::READS {
                p.sizes.push(u32::try_from(size).ok()?);
            }
            for k in 0..size {
                let at = next as usize;
                let last = at.checked_sub(1).map_or(-1, |l| p.corners.get(l).map_or(-1, |&l| l as i64));
                let x = if C::READS { 0 } else { p.corners[at] as i64 };
                let model = &mut m.corner[k.min(2) as usize];
                let x = fits(c.signed(model, x - last - 1).wrapping_add(last + 1))?;
                if C::READS {
                    p.corners.push(x);
                    if c.spent() {
                        return None;
                    }
                }
                next += 1;
            }
            if c.spent() {
                return None;
            }
        }
    }
    let count = c.number(&mut m.list[0], order.wedge.len() as u64);
    budget.take(count.checked_mul(4)?)?;
    let mut last = 0;
    for i in 0..count as usize {
        // NONE is 0.
        let x = if C::READS { 0 } else { order.wedge[i].wrapping_add(1) as i64 };
        last = fits(c.signed(&mut m.wedge, x - last as i64).wrapping_add(last as i64))?;
        if C::READS {
            order.wedge.push(last.wrapping_sub(1));
            if c.spent() {
                return None;
            }
        }
    }
    let count = c.number(&mut m.list[0], order.corner_wedges.len() as u64);
    budget.take(count.checked_mul(8)?)?;
    let mut last = (0, 0);
    for i in 0..count as usize {
        let (corner, wedge) = if C::READS { last } else { order.corner_wedges[i] };
        let corner = c.signed(&mut m.list[1], corner as i64 - last.0 as i64).wrapping_add(last.0 as i64);
        let old = last.1.wrapping_add(1) as i64;
        let wedge = c.signed(&mut m.list[2], wedge.wrapping_add(1) as i64 - old).wrapping_add(old);
        last = (fits(corner)?, fits(wedge)?.wrapping_sub(1));
        if C::READS {
            order.corner_wedges.push(last);
            if c.spent() {
                return None;
            }
        }
    }
    let count = c.number(&mut m.list[0], order.rows.len() as u64);
    budget.take(count.checked_mul(16)?)?;
    for i in 0..count as usize {
        let (wedge, present) = if C::READS { (0, 0) } else { order.rows[i] };
        let wedge = u32::try_from(c.number(&mut m.list[1], wedge as u64)).ok()?;
        let present = c.number(&mut m.list[2], present);
        if C::READS {
            order.rows.push((wedge, present));
            if c.spent() {
                return None;
            }
        }
    }
    let count = c.number(&mut m.list[0], order.values.len() as u64);
    budget.take(count.checked_mul(4)?)?;
    for i in 0..count as usize {
        let x = c.plain(32, if C::READS { 0 } else { order.values[i].to_bits() });
        if C::READS {
            order.values.push(f32::from_bits(x));
            if c.spent() {
                return None;
            }
        }
    }
    Some(())
}

/// The chunk's bytes. `None` if the arrays contradict each other.
pub(super) fn write(pm: &ProgressiveMesh, mut tips: Vec<u8>, order: &InputOrder) -> Option<Vec<u8>> {
    let sound = order.vertex.len() == pm.vertices()
        && order.face.len() == pm.faces()
        && order
            .polygons
            .as_ref()
            .is_none_or(|p| p.sizes.iter().map(|&s| s as usize).sum::<usize>() == p.corners.len());
    if !sound {
        return None;
    }
    let mut e = Encoder::default();
    let mut order = order.clone();
    let raw = raw_bytes(&order, tips.len());
    code(&mut e, pm, &mut tips, &mut order, raw)?;
    let mut out = Vec::new();
    e.finish(&mut out);
    Some(out)
}

/// The order of `pm`, which holds all its splits, and the tips of its faces. `None`: damage.
pub(super) fn read(pm: &ProgressiveMesh, bytes: &[u8], raw: u64) -> Option<(InputOrder, Vec<u8>)> {
    let mut order = InputOrder::default();
    let mut tips = Vec::new();
    let mut d = Decoder::new(bytes)?;
    code(&mut d, pm, &mut tips, &mut order, raw)?;
    let stride = pm.wedges.as_ref().map_or(0, |w| w.stride);
    let sound = !d.spent()
        && raw_bytes(&order, tips.len()) == raw
        && is_permutation(&order.vertex)
        && is_permutation(&order.face)
        && order.fits_mesh(pm, stride);
    Some((order, tips)).filter(|_| sound)
}

fn is_permutation(of: &[u32]) -> bool {
    let mut seen = vec![false; of.len()];
    of.iter().all(|&x| seen.get_mut(x as usize).is_some_and(|s| !std::mem::replace(s, true)))
}

impl InputOrder {
    /// What [`crate::progressive::Cursor::to_ordered_input`] reads is there.
    fn fits_mesh(&self, pm: &ProgressiveMesh, stride: usize) -> bool {
        let corners = 3 * pm.faces() as u64;
        let polygons = self.polygons.as_ref().is_none_or(|Polygons { sizes, corners: c }| {
            sizes.iter().all(|&s| s >= 3) && c.iter().all(|&c| (c as u64) < corners)
        });
        let have = self.polygons.as_ref().map_or(corners, |p| p.corners.len() as u64);
        // Wedges of the input are numbered by use, so there are no more than corners.
        let known = |w: u32| w == NONE || (w as u64) < have;
        polygons
            && self.wedge.len() == pm.wedges.as_ref().map_or(0, |_| pm.wedge_slots())
            && self.wedge.iter().all(|&w| known(w))
            && self.corner_wedges.iter().all(|&(c, w)| (c as u64) < have && known(w))
            && self.rows.iter().all(|&(w, _)| known(w))
            && self.values.len() == self.rows.len() * stride
    }
}
