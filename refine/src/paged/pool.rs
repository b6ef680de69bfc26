//! What has become of splits that are asked for or drawn: few of those that pages hold, and what frames touch. So it lies close together, apart from what the file says of splits.

use crate::aif::NONE;
use crate::progressive::SplitCode;

/// It is applied to what is drawn.
pub(super) const APPLIED: u8 = 1;
/// It is asked for: needed, or one that is depends on it. With geomorphs by time others may be applied too.
pub(super) const LED: u8 = 2;
/// After the last step of a geomorph by time it was applied and not asked for.
pub(super) const LINGERED: u8 = 4;

/// Splits that one depends on that are named here; further ones by its page.
pub(super) const NEEDS: usize = 6;

/// A split that is asked for or drawn, one line of memory. In the mesh its two faces have the slots of its record, and its two nodes places in the list of what could come next.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Hot {
    /// Of a record that is free, the next one that is.
    pub(super) split: u32,
    /// The node that its new vertex is at; [`NONE`] if it is not in the mesh.
    pub(super) node: u32,
    /// The records of the splits that make its node and the faces of its cuts, and of further ones it depends on; [`NONE`] of the base, and of none. They stay as long as this does.
    pub(super) needs: [u32; NEEDS],
    /// Its vertex, and the record of the split that makes that; [`NONE`] of the base.
    pub(super) vertex: u32,
    pub(super) maker: u32,
    /// The node that it replaces.
    pub(super) parent: u32,
    /// Splits asked for that depend on it.
    pub(super) dependents: u16,
    /// With geomorphs by time: applied splits that do.
    pub(super) holders: u16,
    pub(super) code: SplitCode,
    pub(super) flags: u8,
    /// It depends on more than are named.
    pub(super) more: bool,
}

/// All of them, in places that do not change.
#[derive(Debug)]
pub(super) struct Pool {
    pub(super) of: Vec<Hot>,
    /// The first free record.
    free: u32,
    alive: usize,
}

impl Default for Pool {
    fn default() -> Self {
        Pool { of: Vec::new(), free: NONE, alive: 0 }
    }
}

impl Pool {
    /// Records in use.
    pub(super) fn alive(&self) -> usize {
        self.alive
    }

    #[inline]
    pub(super) fn get(&self, h: u32) -> Option<&Hot> {
        self.of.get(h as usize).filter(|r| r.flags != 0)
    }

    #[inline]
    pub(super) fn get_mut(&mut self, h: u32) -> Option<&mut Hot> {
        self.of.get_mut(h as usize).filter(|r| r.flags != 0)
    }

    /// A place for a split, which is to have flags; the second says if it is one more than there were.
    #[inline]
    pub(super) fn put(&mut self, hot: Hot) -> (u32, bool) {
        self.alive += 1;
        let h = self.free;
        match self.of.get_mut(h as usize) {
            Some(r) => {
                self.free = r.split;
                *r = hot;
                (h, false)
            }
            None => {
                self.of.push(hot);
                (self.of.len() as u32 - 1, true)
            }
        }
    }

    /// Of one that is in use: its place is free.
    #[inline]
    pub(super) fn take_out(&mut self, h: u32) {
        if let Some(r) = self.of.get_mut(h as usize) {
            (r.flags, r.node, r.split) = (0, NONE, self.free);
            self.free = h;
            self.alive -= 1;
        }
    }
}
