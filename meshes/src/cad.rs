//! A block of 3 x 2 x 1 with a round bore: planes that are exact and tessellated far more than they need, sharp edges.

use crate::noise::SplitMix64;
use crate::sample::{CornerValues, Material, Sample, triangle_mesh};
use crate::trig::sin_cos_turns;
use glam::DVec3;

/// Half the lengths of the block's edges.
const HALF: DVec3 = DVec3::new(1.5, 1.0, 0.5);
/// Radius of the bore along z.
const RADIUS: f64 = 0.5;

/// A closed block of genus 1 of about this many triangles, with face normals (smooth in the bore) and a material of its own for the
/// bore. The seed moves points within the top and bottom planes.
pub(crate) fn cad(faces: usize, seed: u64) -> Sample {
    // Around the bore m segments; m / 12 rows on each of the four surfaces: 2 m (4 m / 12) triangles.
    let m = 4 * ((1.5 * faces as f64).sqrt() / 4.0).round().max(2.0) as u32;
    let rows = (m / 12).max(1);
    let mut block = Block { m, rows, points: Vec::new(), sides: Vec::new(), seed: SplitMix64::new(seed) };
    let bottom = block.plate(-HALF.z);
    let top = block.plate(HALF.z);
    let outer = block.wall(&bottom[rows as usize], &top[rows as usize]);
    let inner = block.wall(&bottom[0], &top[0]);
    let mut triangles = Vec::new();
    for r in 0..rows as usize {
        for i in 0..m as usize {
            block.quad(&mut triangles, [&top[r], &top[r + 1]], i, Surface::Top);
            block.quad(&mut triangles, [&bottom[r + 1], &bottom[r]], i, Surface::Bottom);
            block.quad(&mut triangles, [&outer[r + 1], &outer[r]], i, Surface::Side);
            block.quad(&mut triangles, [&inner[r], &inner[r + 1]], i, Surface::Bore);
        }
    }
    let mut sample = triangle_mesh(block.points.iter().copied(), &triangles);
    sample.normals = Some(normals(m, &block.sides));
    sample.face_material = block.sides.iter().map(|s| (s.0 == Surface::Bore) as u32).collect();
    sample.materials = vec![
        Material { name: "body".into(), base_color: [0.55, 0.58, 0.62], texture: None },
        Material { name: "bore".into(), base_color: [0.8, 0.45, 0.15], texture: None },
    ];
    sample
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Surface {
    Top,
    Bottom,
    Side,
    Bore,
}

struct Block {
    m: u32,
    rows: u32,
    points: Vec<DVec3>,
    /// Of every triangle its surface and the segments around the bore that its corners lie at.
    sides: Vec<(Surface, [u32; 3])>,
    seed: SplitMix64,
}

impl Block {
    fn add(&mut self, p: DVec3) -> u32 {
        self.points.push(p);
        (self.points.len() - 1) as u32
    }

    /// The rings of a plate from the bore to the rim; the points between are moved a little within the plane.
    fn plate(&mut self, z: f64) -> Vec<Vec<u32>> {
        let (m, rows) = (self.m, self.rows);
        (0..=rows)
            .map(|r| {
                (0..m)
                    .map(|i| {
                        let (bore, rim) = (on_bore(i, m), on_rim(i, m));
                        let mut p = bore.lerp(rim, r as f64 / rows as f64);
                        if r == rows {
                            p = rim;
                        } else if r > 0 {
                            let room = 0.2 * (RADIUS * 6.0 / m as f64).min(RADIUS / rows as f64);
                            p += DVec3::new(self.seed.signed(), self.seed.signed(), 0.0) * room;
                        }
                        self.add(p.with_z(z))
                    })
                    .collect()
            })
            .collect()
    }

    /// The rows of a wall that stands on one ring and carries another.
    fn wall(&mut self, foot: &[u32], head: &[u32]) -> Vec<Vec<u32>> {
        let mut rings = vec![foot.to_vec()];
        for r in 1..self.rows {
            let t = r as f64 / self.rows as f64;
            let ring = foot
                .iter()
                .map(|&v| {
                    let p = self.points[v as usize];
                    self.add(p.with_z(-HALF.z + t * 2.0 * HALF.z))
                })
                .collect();
            rings.push(ring);
        }
        rings.push(head.to_vec());
        rings
    }

    /// Two triangles between segment `i` of two rings.
    fn quad(&mut self, triangles: &mut Vec<[u32; 3]>, [near, far]: [&[u32]; 2], i: usize, surface: Surface) {
        let j = (i + 1) % near.len();
        let (s, t) = (i as u32, i as u32 + 1);
        triangles.push([near[i], far[i], far[j]]);
        self.sides.push((surface, [s, s, t]));
        triangles.push([near[i], far[j], near[j]]);
        self.sides.push((surface, [s, t, t]));
    }
}

/// Point `i` of `m` of the bore's circle, from the direction of the corner (-, -) counter-clockwise.
fn on_bore(i: u32, m: u32) -> DVec3 {
    let (s, c) = sin_cos_turns(0.625 + i as f64 / m as f64);
    DVec3::new(c, s, 0.0) * RADIUS
}

/// Point `i` of `m` of the block's outline, as many on each side, corners included exactly.
fn on_rim(i: u32, m: u32) -> DVec3 {
    let quarter = m / 4;
    let t = 2.0 * (i % quarter) as f64 / quarter as f64 - 1.0;
    match i / quarter {
        0 => DVec3::new(t * HALF.x, -HALF.y, 0.0),
        1 => DVec3::new(HALF.x, t * HALF.y, 0.0),
        2 => DVec3::new(-t * HALF.x, HALF.y, 0.0),
        _ => DVec3::new(-HALF.x, -t * HALF.y, 0.0),
    }
}

/// Of every corner the normal of its plane, or of the bore, which looks at the axis.
fn normals(m: u32, sides: &[(Surface, [u32; 3])]) -> CornerValues<3> {
    let mut values = vec![
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
        [0.0, -1.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [-1.0, 0.0, 0.0f32],
    ];
    values.extend((0..m).map(|i| (on_bore(i, m) / -RADIUS).with_z(0.0).to_array().map(|x| x as f32)));
    let corner = sides
        .iter()
        .flat_map(|&(surface, segments)| {
            segments.map(|s| match surface {
                Surface::Top => 0,
                Surface::Bottom => 1,
                Surface::Side => 2 + segments[0] / (m / 4),
                Surface::Bore => 6 + s % m,
            })
        })
        .collect();
    CornerValues { values, corner }
}
