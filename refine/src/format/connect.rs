//! Connectivity.

use super::base::MeshHead;
use super::coder::{Coder, Number};
use super::splits::Counts;
use crate::aif::NONE;
use crate::progressive::SplitCode;

/// A split's references and code.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Step {
    pub(super) vertex: u32,
    pub(super) left: u32,
    pub(super) right: u32,
    pub(super) code: SplitCode,
}

pub(super) struct Connect {
    pub(super) next_wedge: usize,
    vertices: usize,
    faces: usize,
    last: u32,
    last_face: u32,
    numbers: [Number; 5],
    place: [f64; 3],
}

impl Connect {
    pub(super) fn new(head: &MeshHead, first: Counts) -> Self {
        Connect {
            next_wedge: first.wedge,
            vertices: head.base_vertices as usize + first.split,
            faces: first.face,
            last: 0,
            last_face: 0,
            numbers: Default::default(),
            place: [0.0; 3],
        }
    }

    pub(super) fn begin<C: Coder>(&mut self, _: &mut C, _: &[u32]) -> Option<()> {
        Some(())
    }

    pub(super) fn code<C: Coder>(&mut self, c: &mut C, s: Step) -> Option<Step> {
        let code = SplitCode(u16::try_from(c.number(&mut self.numbers[0], s.code.0 as u64)).ok()?);
        let delta = |c: &mut C, m: &mut Number, x: u32, guess: u32, below: usize| {
            let x = c.signed(m, x as i64 - guess as i64).wrapping_add(guess as i64);
            u32::try_from(x).ok().filter(|&x| (x as usize) < below)
        };
        let vertex = delta(c, &mut self.numbers[1], s.vertex, self.last, self.vertices)?;
        self.last = vertex;
        let cut = |c: &mut C, m: &mut [Number], x: u32, guess: u32, faces: usize| {
            let (a, b) = m.split_at_mut(1);
            let f = delta(c, &mut a[0], x >> 2, guess, faces)?;
            Some(f << 2 | delta(c, &mut b[0], x & 3, 0, 3)?)
        };
        let (m, faces) = (&mut self.numbers, self.faces);
        let left = cut(c, &mut m[2..4], s.left, self.last_face, faces)?;
        let mut right = NONE;
        if code.two_faces() {
            right = cut(c, &mut m[3..5], s.right, left >> 2, faces)?;
        }
        self.last_face = left >> 2;
        self.vertices += 1;
        self.faces += 1 + code.two_faces() as usize;
        Some(Step { vertex, left, right, code })
    }

    pub(super) fn expected(&self) -> [f64; 3] {
        self.place
    }

    pub(super) fn placed(&mut self, at: [f64; 3], _: Option<[f64; 3]>) {
        self.place = at;
    }
}
