//! Writing tiles of quantized-mesh 1.0, the terrain format of Cesium, and the `layer.json` that describes them.
//!
//! A vertex is three numbers from 0 to 32,767: how far east and north it lies in the tile, and how high between a least and a greatest
//! height. Tiles that are given the same two heights, and the same position along a shared border, share its vertices to the bit.

use crate::ground::earth_centred;
use glam::DVec3;
use serde_json::{Value, json};

/// The greatest number of a coordinate.
const MOST: f64 = 32_767.0;
/// Axes of WGS 84 in metres.
const AXES: DVec3 = DVec3::new(6_378_137.0, 6_378_137.0, 6_356_752.314_245_179);
/// The extension that holds normals.
const NORMALS: u8 = 1;

/// A vertex of a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vertex {
    /// 0 at the west border to 1 at the east.
    pub u: f64,
    /// 0 at the south border to 1 at the north.
    pub v: f64,
    /// Metres above the ellipsoid.
    pub height: f64,
    /// The unit normal, earth-centred.
    pub normal: [f32; 3],
}

/// A tile to write.
#[derive(Clone, Debug, Default)]
pub struct Tile {
    /// West, south, east and north border in degrees.
    pub bounds: [f64; 4],
    /// The least and the greatest height that the numbers stand for: those of all tiles of a level, so that borders are the same.
    pub heights: [f32; 2],
    /// Vertices.
    pub vertices: Vec<Vertex>,
    /// Triangles, to the left seen from above.
    pub triangles: Vec<[u32; 3]>,
}

/// What heights between these are rounded to: half of it is the greatest difference.
pub fn height_step([least, greatest]: [f32; 2]) -> f64 {
    (f64::from(greatest) - f64::from(least)) / MOST
}

/// The bytes of a tile. Triangles that have no area left when their corners are rounded are left out. O(vertices + triangles).
///
/// Not guaranteed: heights outside of `heights` are clamped, and so are `u` and `v` outside of 0 to 1.
pub fn encode(tile: &Tile) -> Vec<u8> {
    let [least, greatest] = tile.heights.map(f64::from);
    let range = if greatest > least { greatest - least } else { 1.0 };
    let whole = |x: f64| (x.clamp(0.0, 1.0) * MOST).round() as u16;
    let rounded: Vec<[u16; 3]> =
        tile.vertices.iter().map(|p| [whole(p.u), whole(p.v), whole((p.height - least) / range)]).collect();
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| rounded[v as usize].map(i64::from));
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    // Vertices in the order in which triangles use them, as the coding of the indices wants it.
    let mut number = vec![u32::MAX; rounded.len()];
    let (mut order, mut indices): (Vec<u32>, Vec<u32>) = (vec![], vec![]);
    for t in tile.triangles.iter().filter(|t| area(t) > 0) {
        for &v in t {
            if number[v as usize] == u32::MAX {
                number[v as usize] = order.len() as u32;
                order.push(v);
            }
            indices.push(number[v as usize]);
        }
    }
    let mut out = header(tile, order.iter().map(|&v| rounded[v as usize]));
    out.extend((order.len() as u32).to_le_bytes());
    for k in [0, 1, 2] {
        let mut last = 0i32;
        for &v in &order {
            let now = i32::from(rounded[v as usize][k]);
            let d = now - last;
            out.extend((((d << 1) ^ (d >> 31)) as u16).to_le_bytes());
            last = now;
        }
    }
    let wide = order.len() > 1 << 16;
    let put = |out: &mut Vec<u8>, index: u32| match wide {
        true => out.extend(index.to_le_bytes()),
        false => out.extend((index as u16).to_le_bytes()),
    };
    out.resize(out.len().next_multiple_of(if wide { 4 } else { 2 }), 0);
    out.extend((indices.len() as u32 / 3).to_le_bytes());
    // How far below the next new vertex.
    let mut new = 0;
    for &i in &indices {
        put(&mut out, new - i);
        new += u32::from(i == new);
    }
    // West, south, east, north: each along its border.
    for (k, border) in [(0, 0), (1, 0), (0, MOST as u16), (1, MOST as u16)] {
        let mut on: Vec<u32> =
            (0..order.len() as u32).filter(|&i| rounded[order[i as usize] as usize][k] == border).collect();
        on.sort_by_key(|&i| rounded[order[i as usize] as usize][1 - k]);
        out.extend((on.len() as u32).to_le_bytes());
        on.into_iter().for_each(|i| put(&mut out, i));
    }
    out.push(NORMALS);
    out.extend((2 * order.len() as u32).to_le_bytes());
    out.extend(order.iter().flat_map(|&v| octahedral(tile.vertices[v as usize].normal)));
    out
}

/// Centre, heights, bounding sphere and horizon of vertices as readers place them: 88 bytes.
fn header(tile: &Tile, rounded: impl Iterator<Item = [u16; 3]>) -> Vec<u8> {
    let [west, south, east, north] = tile.bounds;
    let [least, greatest] = tile.heights.map(f64::from);
    let places: Vec<DVec3> = rounded
        .map(|p| {
            let [u, v, h] = p.map(|c| f64::from(c) / MOST);
            let degrees = [west + u * (east - west), south + v * (north - south)];
            earth_centred(degrees, least + h * (greatest - least)).into()
        })
        .collect();
    let low = places.iter().copied().reduce(DVec3::min).unwrap_or_default();
    let high = places.iter().copied().reduce(DVec3::max).unwrap_or_default();
    let centre = (low + high) / 2.0;
    let radius = places.iter().map(|p| p.distance(centre)).fold(0.0, f64::max);
    let mut out = Vec::with_capacity(88);
    let mut put = |values: &[f64]| out.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    put(&centre.to_array());
    out.extend(tile.heights.iter().flat_map(|h| h.to_le_bytes()));
    let mut put = |values: &[f64]| out.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    put(&centre.to_array());
    put(&[radius]);
    put(&horizon(centre, &places).to_array());
    out
}

/// The point, in units of the ellipsoid's axes, above which the tile cannot be hidden by the Earth: on the line to the centre, above the
/// tangent through every vertex. Where a tile is too large for there to be one, a point far out.
fn horizon(centre: DVec3, places: &[DVec3]) -> DVec3 {
    const FAR: f64 = 1e3;
    let direction = (centre / AXES).normalize_or_zero();
    let above = |p: &DVec3| {
        let p = *p / AXES;
        let length = p.length().max(1.0);
        let towards = p.normalize_or_zero();
        let (cos, sin) = (towards.dot(direction), towards.cross(direction).length());
        let (cos_reach, sin_reach) = (1.0 / length, (length * length - 1.0).sqrt() / length);
        let below = cos * cos_reach - sin * sin_reach;
        if below > 1.0 / FAR { 1.0 / below } else { FAR }
    };
    direction * places.iter().map(above).fold(1.0, f64::max)
}

/// A unit vector in two bytes (Cigolle et al. 2014).
fn octahedral([x, y, z]: [f32; 3]) -> [u8; 2] {
    let sum = x.abs() + y.abs() + z.abs();
    let (mut u, mut v) = if sum > 0.0 { (x / sum, y / sum) } else { (0.0, 0.0) };
    if z < 0.0 {
        let sign = |c: f32| if c < 0.0 { -1.0 } else { 1.0 };
        (u, v) = ((1.0 - v.abs()) * sign(u), (1.0 - u.abs()) * sign(v));
    }
    [u, v].map(|c| ((c.clamp(-1.0, 1.0) * 0.5 + 0.5) * 255.0).round() as u8)
}

/// What `layer.json` says: the bounds in degrees, and for each level from 0 on the tiles that there are, numbered from the west and
/// from the south.
pub fn layer(name: &str, bounds: [f64; 4], levels: &[Vec<[usize; 2]>]) -> Value {
    let available: Vec<Value> = levels.iter().map(|tiles| ranges(tiles)).collect();
    json!({
        "tilejson": "2.1.0",
        "name": name,
        "version": "1.0.0",
        "format": "quantized-mesh-1.0",
        "scheme": "tms",
        "projection": "EPSG:4326",
        "tiles": ["{z}/{x}/{y}.terrain?v={version}"],
        "extensions": ["octvertexnormals"],
        "minzoom": 0,
        "maxzoom": levels.len().saturating_sub(1),
        "bounds": bounds,
        "available": available,
    })
}

/// Tiles as rectangles: runs of a row, and rows with the same run together.
fn ranges(tiles: &[[usize; 2]]) -> Value {
    let mut sorted: Vec<[usize; 2]> = tiles.iter().map(|&[x, y]| [y, x]).collect();
    sorted.sort_unstable();
    let runs = sorted.chunk_by(|a, b| a[0] == b[0] && a[1] + 1 == b[1]);
    let mut rectangles: Vec<[usize; 4]> = vec![];
    for run in runs {
        let ([y, from], to) = (run[0], run[run.len() - 1][1]);
        match rectangles.iter_mut().find(|r| r[0] == from && r[2] == to && r[3] + 1 == y) {
            Some(r) => r[3] = y,
            None => rectangles.push([from, y, to, y]),
        }
    }
    let object = |[x0, y0, x1, y1]: [usize; 4]| json!({"startX": x0, "startY": y0, "endX": x1, "endY": y1});
    rectangles.into_iter().map(object).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_every_tile_once() {
        assert_eq!(ranges(&[]), json!([]));
        let tiles = [[3, 1], [4, 1], [3, 2], [4, 2], [7, 2], [4, 3]];
        let expected = json!([
            {"startX": 3, "startY": 1, "endX": 4, "endY": 2},
            {"startX": 7, "startY": 2, "endX": 7, "endY": 2},
            {"startX": 4, "startY": 3, "endX": 4, "endY": 3},
        ]);
        assert_eq!(ranges(&tiles), expected);
    }

    #[test]
    fn normals_take_two_bytes() {
        assert_eq!(octahedral([0.0, 0.0, 1.0]), [128, 128]);
        assert_eq!(octahedral([1.0, 0.0, 0.0]), [255, 128]);
        assert_eq!(octahedral([0.0, -1.0, 0.0]), [128, 0]);
        let below = octahedral([0.0, 0.0, -1.0]);
        assert_eq!(below, [255, 255]);
    }

    #[test]
    fn the_sphere_holds_vertices_as_they_are_rounded() {
        // A tile of 180 degrees: a step of its numbers is 600 m.
        let at = |u: f64, v: f64, height: f64| Vertex { u, v, height, normal: [0.0, 0.0, 1.0] };
        let tile = Tile {
            bounds: [0.0, -90.0, 180.0, 90.0],
            heights: [0.0, 100.0],
            vertices: vec![at(0.10002, 0.70002, 3.0), at(0.10009, 0.70002, 90.0), at(0.10002, 0.70009, 50.0)],
            triangles: vec![[0, 1, 2]],
        };
        let bytes = encode(&tile);
        let number = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
        let (centre, radius) = (DVec3::from([32, 40, 48].map(number)), number(56));
        let mut farthest = 0.0f64;
        for p in &tile.vertices {
            let [u, v, h] = [p.u, p.v, p.height / 100.0].map(|c| (c * MOST).round() / MOST);
            let place = DVec3::from(earth_centred([180.0 * u, 180.0 * v - 90.0], 100.0 * h));
            farthest = farthest.max(place.distance(centre));
        }
        assert!((farthest - radius).abs() < 1e-6, "{farthest} {radius}");
    }

    #[test]
    fn the_horizon_lies_above_what_it_hides() {
        let places: Vec<DVec3> =
            [[10.0, 50.0], [10.1, 50.0], [10.0, 50.1]].map(|p| earth_centred(p, 500.0).into()).to_vec();
        let point = horizon(places[0], &places);
        assert!(point.length() > 1.0 && point.length() < 1.001);
        // A tile of half the globe has none.
        let wide: Vec<DVec3> =
            [[-90.0, 0.0], [90.0, 0.0], [0.0, 90.0]].map(|p| earth_centred(p, 0.0).into()).to_vec();
        assert!((horizon(DVec3::new(1.0, 0.0, 0.0), &wide).length() - 1e3).abs() < 1e-6);
    }
}
