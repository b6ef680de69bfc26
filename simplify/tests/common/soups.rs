//! Triangles of all kinds to measure.

use progmesh_simplify::measure::Surface;
use proptest::prelude::*;

/// Positions and triangles.
pub(crate) type Soup = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// A soup with what goes wrong: repeated corners, repeated triangles, points on a line, on a coarse grid within [-1, 1].
pub(crate) fn soup(largest: usize) -> impl Strategy<Value = Soup> {
    (3usize..20).prop_flat_map(move |n| {
        let points =
            prop::collection::vec(prop::array::uniform3((-4i32..5).prop_map(|x| x as f64 * 0.25)), n);
        let triangles = prop::collection::vec(prop::array::uniform3(0..n as u32), 1..largest);
        (points, triangles)
    })
}

pub(crate) fn surface(s: &Soup) -> Surface {
    Surface::new(&s.0[..], &s.1).unwrap()
}
