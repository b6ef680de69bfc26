//! What splits bring beside references and positions: wedges with their attributes, materials, groups.

use super::base::MeshHead;
use super::coder::{Bit, Coder, Number};
use super::rows::Rows;
use super::splits::{Source, SplitBlock};
use crate::aif::NONE;
use crate::progressive::{SplitCode, SplitKind};

/// Codes these of one chunk.
pub(super) struct Extras {
    per_face: [bool; 2],
    rows: Option<Rows>,
    next_wedge: usize,
    explicit: [Number; 6],
    none: [Bit; 3],
    face_same: [Bit; 2],
    face_value: [Number; 2],
    face_last: [u32; 2],
    /// Numbers of lists and rows that there can be (reader).
    most: u64,
}

impl Extras {
    pub(super) fn new(head: &MeshHead, first_wedge: usize) -> Self {
        Extras {
            per_face: [head.materials, head.groups],
            rows: head.channels.as_deref().map(Rows::new),
            next_wedge: first_wedge,
            explicit: Default::default(),
            none: Default::default(),
            face_same: Default::default(),
            face_value: Default::default(),
            face_last: [NONE; 2],
            most: u64::MAX,
        }
    }

    /// A reader's arrays are to take at most so many bytes: lists and rows that would take more are damage, and none of them is made.
    pub(super) fn limit(&mut self, raw: u64) {
        self.most = raw / 4;
    }

    /// Codes what belongs to the next split, and moves `source` behind it.
    pub(super) fn code<C: Coder>(
        &mut self,
        (attributes, faces): (&mut C, &mut C),
        (vertex, code): (u32, SplitCode),
        source: &mut Option<Source<'_>>,
        out: &mut SplitBlock,
    ) -> Option<()> {
        let (new, changed) = self.wedges(attributes, (vertex, code), source, out)?;
        let count = 1 + code.two_faces() as usize;
        if C::READS && self.rows.is_none() && self.per_face == [false; 2] {
            return Some(());
        }
        for k in 0..2 {
            if self.per_face[k] {
                for f in 0..count {
                    let value = source
                        .as_ref()
                        .map_or(0, |s| [&s.pm.face_material, &s.pm.face_group][k][s.at.face + f]);
                    let value = self.face(faces, k, value)?;
                    if C::READS {
                        [&mut out.face_material, &mut out.face_group][k].push(value);
                    }
                }
            }
        }
        if self.rows.is_some() {
            out.wedges = out.wedges.checked_add(u32::try_from(new).ok()?)?;
        }
        if let Some(s) = source {
            s.at.split += 1;
            s.at.face += count;
            s.at.wedge += new;
            s.at.moved += code.moves() as usize;
            if self.rows.is_some() {
                s.at.row += new + changed;
            }
        }
        Some(())
    }

    /// A material or group: mostly that of the face before.
    fn face<C: Coder>(&mut self, c: &mut C, k: usize, value: u32) -> Option<u32> {
        let last = self.face_last[k];
        if !c.bit(&mut self.face_same[k], value == last) {
            // NONE is 0.
            let x = c.number(&mut self.face_value[k], value.wrapping_add(1) as u64);
            self.face_last[k] = u32::try_from(x).ok()?.wrapping_sub(1);
        }
        Some(self.face_last[k])
    }

    /// Explicit wedges and rows; returns the numbers of new and of changed wedges.
    fn wedges<C: Coder>(
        &mut self,
        c: &mut C,
        (vertex, code): (u32, SplitCode),
        source: &mut Option<Source<'_>>,
        out: &mut SplitBlock,
    ) -> Option<(usize, usize)> {
        let Some(rows) = &mut self.rows else {
            return Some((1, 0)).filter(|_| code.kind() == SplitKind::Plain && !code.changes_rows());
        };
        let wedge = self.next_wedge;
        let (mut new, mut changed) = (1, code.changes_rows() as usize);
        match code.kind() {
            SplitKind::Plain => {}
            SplitKind::Seam => (new, changed) = (2, 2 * changed),
            SplitKind::Explicit => {
                let list =
                    source.as_ref().and_then(|s| s.pm.wedges.as_ref()).map_or(&[][..], |w| &w.explicit);
                let mut at = source.as_ref().map_or(0, |s| s.at.explicit);
                let mut next = || {
                    at += 1;
                    list.get(at - 1).copied().unwrap_or(0)
                };
                let pairs = c.number(&mut self.explicit[0], next() as u64);
                let listed = c.number(&mut self.explicit[1], next() as u64);
                let start = out.explicit.len();
                let tips = 3 + 3 * code.two_faces() as u64;
                let ids = pairs.checked_mul(2)?.checked_add(listed)?.checked_add(tips)?;
                if C::READS {
                    if ids > self.most.saturating_sub(start as u64) {
                        return None;
                    }
                    out.explicit.extend([u32::try_from(pairs).ok()?, u32::try_from(listed).ok()?]);
                }
                new = 0;
                for k in 0..ids {
                    let (m, flag) = match k {
                        _ if k >= 2 * pairs + listed => (4 + ((k - 2 * pairs - listed) % 3 == 2) as usize, 2),
                        _ if k >= 2 * pairs => (3, 1),
                        _ => (2, 0),
                    };
                    let value = next();
                    let id = if c.bit(&mut self.none[flag], value == NONE) {
                        NONE
                    } else {
                        let back = c.signed(&mut self.explicit[m], wedge as i64 - value as i64);
                        let x = (wedge as i64).wrapping_sub(back);
                        u32::try_from(x).ok()?
                    };
                    new += (k < 2 * pairs && k % 2 == 1 && id != NONE && id as usize >= wedge) as usize;
                    if C::READS {
                        out.explicit.push(id);
                        if c.spent() {
                            return None;
                        }
                    }
                }
                changed = listed as usize;
                if C::READS && out.explicit.len() - start < 5 {
                    return None;
                }
                if let Some(s) = source {
                    s.at.explicit = at;
                }
            }
        }
        let all = new.checked_add(changed)?;
        if C::READS {
            // Two for what is present, and the values.
            let each = 2 + rows.row().len() as u64;
            let there = out.rows.len() as u64 + 2 * out.present.len() as u64;
            if (all as u64).checked_mul(each)? > self.most.saturating_sub(there) {
                return None;
            }
        }
        for k in 0..all {
            let row = source.as_ref().and_then(|s| {
                let w = s.pm.wedges.as_ref()?;
                let r = s.at.row + k;
                Some((w.present[r], w.rows.row(r, w.stride)))
            });
            let present = rows.code(c, vertex, row.as_ref().map(|(present, row)| (*present, &**row)));
            if C::READS {
                out.rows.extend_from_slice(rows.row());
                out.present.push(present);
                if c.spent() {
                    return None;
                }
            }
        }
        self.next_wedge += new;
        Some((new, changed))
    }
}

#[cfg(test)]
mod tests {
    use super::super::coder::{Decoder, Encoder};
    use super::*;
    use crate::aif::{Channel, Encoding, Semantic};

    /// A few bytes can say that hundreds of thousands of numbers follow, as what is foreseen costs next to nothing: none are made beyond what the directory announced.
    #[test]
    fn lists_take_no_more_than_was_announced() {
        let head = MeshHead {
            channels: Some(vec![Channel { semantic: Semantic::Normal, width: 3, encoding: Encoding::F32 }]),
            ..MeshHead::default()
        };
        let (pairs, code) = (300_000u64, SplitCode(2 << SplitCode::KIND));
        assert_eq!(code.kind(), SplitKind::Explicit);
        let mut e = Encoder::default();
        let mut models = Extras::new(&head, 0);
        e.number(&mut models.explicit[0], pairs);
        e.number(&mut models.explicit[1], 0);
        for k in 0..2 * pairs + 3 {
            e.bit(&mut models.none[if k < 2 * pairs { 0 } else { 2 }], true);
        }
        let mut bytes = Vec::new();
        e.finish(&mut bytes);
        assert!(bytes.len() < 3000, "{}", bytes.len());
        for (raw, fits) in [(4 * (2 * pairs + 5), true), (1 << 16, false)] {
            let mut extras = Extras::new(&head, 0);
            extras.limit(raw);
            let mut out = SplitBlock::default();
            let mut d = [(); 2].map(|()| Decoder::new(&bytes).unwrap());
            let [a, b] = &mut d;
            let done = extras.code((a, b), (0, code), &mut None, &mut out);
            assert_eq!(done.is_some(), fits, "{raw}");
            assert!(4 * out.explicit.len() as u64 <= raw);
        }
    }
}
