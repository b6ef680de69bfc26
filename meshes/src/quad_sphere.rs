//! A sphere of quads from a cube, with a chart of its own for every side: uv seams along the cube's edges.

use crate::noise::{SplitMix64, noise};
use crate::sample::{CornerValues, Material, Sample, Texture};
use glam::DVec3;

/// Pixels along a chart of the texture.
const CHART: u32 = 128;
/// Part of a chart that is left free on each side, so that filtering does not reach the next.
const MARGIN: f64 = 1.0 / 32.0;

/// A unit sphere of about this many quads (6 n²). The seed makes the texture's colours.
pub(crate) fn quad_sphere(faces: usize, seed: u64) -> Sample {
    let n = ((faces as f64 / 6.0).sqrt().round() as u32).max(1);
    let mut sample = Sample { positions: vec![[0.0; 3]; (6 * n * n + 2) as usize], ..Default::default() };
    let mut normals = vec![[0.0f32; 3]; sample.positions.len()];
    let mut uvs = CornerValues::default();
    for side in 0..6 {
        let first_uv = uvs.values.len() as u32;
        for j in 0..=n {
            for i in 0..=n {
                let v = vertex(n, lattice(side, i, j, n)) as usize;
                let p = on_sphere(lattice(side, i, j, n).map(|x| 2.0 * x as f64 / n as f64 - 1.0));
                normals[v] = p.to_array().map(|x| x as f32);
                sample.positions[v] = p.to_array();
                uvs.values.push(atlas(side, i as f64 / n as f64, j as f64 / n as f64));
            }
        }
        for j in 0..n {
            for i in 0..n {
                for (di, dj) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
                    sample.corners.push(vertex(n, lattice(side, i + di, j + dj, n)));
                    uvs.corner.push(first_uv + (j + dj) * (n + 1) + i + di);
                }
            }
        }
    }
    let quads = (6 * n * n) as usize;
    sample.round_to_f32();
    sample.face_sizes = Some(vec![4; quads]);
    sample.normals = Some(CornerValues { values: normals, corner: sample.corners.clone() });
    sample.uvs = Some(uvs);
    sample.face_material = vec![0; quads];
    sample.materials = vec![Material { name: "charts".into(), base_color: [1.0; 3], texture: Some(0) }];
    sample.textures = vec![texture(seed)];
    sample
}

/// The point (i, j) of a side of the cube `[0, n]³`; i, j and the outward direction are right-handed.
fn lattice(side: u32, i: u32, j: u32, n: u32) -> [u32; 3] {
    let axis = (side / 2) as usize;
    let mut p = [0; 3];
    let (u, v, w) = if side.is_multiple_of(2) { (i, j, n) } else { (j, i, 0) };
    p[axis] = w;
    p[(axis + 1) % 3] = u;
    p[(axis + 2) % 3] = v;
    p
}

/// The number of a lattice point of the cube's surface: the floor, then the ring of every storey, then the top.
fn vertex(n: u32, [x, y, z]: [u32; 3]) -> u32 {
    let plate = (n + 1) * (n + 1);
    match z {
        0 => y * (n + 1) + x,
        _ if z == n => plate + 4 * n * (n - 1) + y * (n + 1) + x,
        _ => {
            let ring = match (x, y) {
                (_, 0) if x < n => x,
                (_, _) if x == n && y < n => n + y,
                (_, _) if y == n && x > 0 => 2 * n + (n - x),
                _ => 3 * n + (n - y),
            };
            plate + (z - 1) * 4 * n + ring
        }
    }
}

/// Maps the surface of the cube `[-1, 1]³` to the unit sphere with nearly even spacing.
fn on_sphere([x, y, z]: [f64; 3]) -> DVec3 {
    let (a, b, c) = (x * x, y * y, z * z);
    let stretch = |s: f64, p: f64, q: f64| s * (1.0 - p / 2.0 - q / 2.0 + p * q / 3.0).max(0.0).sqrt();
    DVec3::new(stretch(x, b, c), stretch(y, c, a), stretch(z, a, b)).normalize()
}

/// Place in the atlas of three by two charts.
fn atlas(side: u32, s: f64, t: f64) -> [f32; 2] {
    let inside = |x: f64| MARGIN + x * (1.0 - 2.0 * MARGIN);
    let (column, row) = (side % 3, side / 3);
    [((column as f64 + inside(s)) / 3.0) as f32, ((row as f64 + inside(t)) / 2.0) as f32]
}

/// A colour for every chart, with a checker and some noise, so that any distortion shows.
fn texture(seed: u64) -> Texture {
    let mut random = SplitMix64::new(seed);
    let colors: [[f64; 3]; 6] =
        std::array::from_fn(|_| std::array::from_fn(|_| 90.0 + 140.0 * random.unit()));
    let (width, height) = (3 * CHART, 2 * CHART);
    let mut rgb = Vec::with_capacity((3 * width * height) as usize);
    for y in 0..height {
        for x in 0..width {
            // Rows run from the top, v from the bottom.
            let up = height - 1 - y;
            let chart = x / CHART + 3 * (up / CHART);
            let checker = (x % CHART / 16 + up % CHART / 16) % 2;
            let grain = noise(seed, DVec3::new(x as f64 / 9.0, up as f64 / 9.0, chart as f64 + 0.5));
            let light = 1.0 - 0.25 * checker as f64 + 0.08 * grain;
            rgb.extend(colors[chart as usize].map(|c| (c * light).clamp(0.0, 255.0) as u8));
        }
    }
    Texture { name: "charts".into(), width, height, rgb }
}
