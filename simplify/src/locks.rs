//! What the caller locked.

use crate::options::Options;
use progmesh_aif::{Bits, Mesh};
use std::borrow::Cow;

impl Options {
    /// Those of mesh `i` of several: what is locked there is locked by number.
    pub(crate) fn of_mesh(&self, i: usize) -> Cow<'_, Options> {
        let Some(own) = self.locked_by_mesh.get(i).filter(|l| l.count() > 0) else {
            return Cow::Borrowed(self);
        };
        let mut options = Options { locked_by_mesh: Vec::new(), ..self.clone() };
        own.iter().for_each(|v| options.locked_vertices.set(v));
        Cow::Owned(options)
    }
}

/// The vertices that are locked by number, material or group. O(n) if faces are locked, else O(1) but for the copy.
pub(crate) fn locked_vertices(mesh: &Mesh, options: &Options) -> Bits {
    let mut locked = options.locked_vertices.clone();
    if !(options.locked_materials.is_empty() && options.locked_groups.is_empty()) {
        let t = mesh.topology();
        let of = |x: Option<u32>, list: &[u32]| x.is_some_and(|x| list.contains(&x));
        for f in t.faces() {
            if of(mesh.material(f), &options.locked_materials) || of(mesh.group(f), &options.locked_groups) {
                t.face_vertices(f).for_each(|v| locked.set(v.index()));
            }
        }
    }
    locked
}
