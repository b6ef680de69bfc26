//! Attribute values of a primitive's vertices, made fit for the format: unit normals, weights of sum 1, no set without the one below.

use crate::aif::{Encoding, Semantic, Wedges};
use glam::{DVec3, Vec3};

/// One attribute of all vertices of a primitive.
pub(super) struct Column {
    pub(super) semantic: Semantic,
    pub(super) width: usize,
    pub(super) encoding: Encoding,
    pub(super) values: Vec<f32>,
    /// Which vertices have a value of their own.
    present: Vec<bool>,
}

/// The channels that at least one of the vertices has.
pub(super) fn of(vertices: &[(u32, u32)], wedges: &Wedges) -> Vec<Column> {
    let mut out = Vec::new();
    for (k, channel) in wedges.channels().iter().enumerate() {
        if super::semantic::widths(&channel.semantic).is_some_and(|w| !w.contains(&channel.width)) {
            continue;
        }
        if !vertices.iter().any(|&(_, w)| wedges.get(w, k).is_some()) {
            continue;
        }
        let mut values = Vec::with_capacity(vertices.len() * channel.width);
        let mut present = Vec::with_capacity(vertices.len());
        for &(_, w) in vertices {
            let own = wedges.get(w, k).filter(|v| v.iter().all(|x| x.is_finite()));
            present.push(own.is_some());
            match own {
                Some(v) => values.extend_from_slice(v),
                None => values.extend((0..channel.width).map(|i| missing(&channel.semantic, i))),
            }
        }
        let encoding = encoding(&channel.semantic, channel.encoding, &values);
        out.push(Column {
            semantic: channel.semantic.clone(),
            width: channel.width,
            encoding,
            values,
            present,
        });
    }
    out
}

/// What a vertex without a value gets.
fn missing(semantic: &Semantic, component: usize) -> f32 {
    match semantic {
        Semantic::Color(_) => 1.0,
        _ => (matches!(semantic, Semantic::Weights(0)) && component == 0) as u8 as f32,
    }
}

/// The encoding to write: the input's where the format allows it and the attribute bears it.
fn encoding(semantic: &Semantic, input: Encoding, values: &[f32]) -> Encoding {
    let within = |lo: f32, hi: f32| values.iter().all(|&x| x >= lo && x <= hi);
    match semantic {
        Semantic::Joints(_) if within(0.0, 255.0) => Encoding::U8,
        Semantic::Joints(_) => Encoding::U16,
        Semantic::Color(_) => match input {
            Encoding::U8Norm | Encoding::U16Norm if within(0.0, 1.0) => input,
            _ => Encoding::F32,
        },
        Semantic::Custom(_) => match input {
            Encoding::U32 | Encoding::I32 | Encoding::F64 => Encoding::F32,
            e => e,
        },
        // Interpolated coordinates, normals and weights would lose in fewer bits.
        _ => Encoding::F32,
    }
}

/// Makes the columns fit for the format.
pub(super) fn repair(columns: &mut Vec<Column>, points: &[[f32; 3]], triangles: &[u32]) {
    fill_sets(columns, points.len());
    if let Some(n) = columns.iter().position(|c| c.semantic == Semantic::Normal && c.width == 3) {
        normals(&mut columns[n], points, triangles);
    } else {
        // The format has no tangents without normals.
        columns.retain(|c| c.semantic != Semantic::Tangent);
    }
    tangents(columns);
    for c in columns.iter_mut().filter(|c| matches!(c.semantic, Semantic::Color(_))) {
        // Linear light above 1 has no place in a vertex colour.
        c.values.iter_mut().for_each(|x| *x = x.clamp(0.0, 1.0));
    }
    weights(columns);
}

/// Numbered attributes must begin at 0 and have no gap; joints and weights must go together.
fn fill_sets(columns: &mut Vec<Column>, count: usize) {
    let sets = |columns: &[Column], of: fn(&Semantic) -> Option<u8>| -> Vec<u8> {
        columns.iter().filter_map(|c| of(&c.semantic)).collect()
    };
    let joints = sets(columns, |s| if let Semantic::Joints(k) = s { Some(*k) } else { None });
    let weights = sets(columns, |s| if let Semantic::Weights(k) = s { Some(*k) } else { None });
    // Sets after the first gap, and those of which the other half is missing, mean nothing.
    let whole = (0..=u8::MAX).take_while(|k| joints.contains(k) && weights.contains(k)).count();
    columns.retain(|c| match c.semantic {
        Semantic::Joints(k) | Semantic::Weights(k) => (k as usize) < whole,
        _ => true,
    });
    for (make, width, of) in [
        (
            Semantic::TexCoord as fn(u8) -> Semantic,
            2,
            (|s| if let Semantic::TexCoord(k) = s { Some(*k) } else { None }) as fn(&Semantic) -> Option<u8>,
        ),
        (Semantic::Color, 4, |s| if let Semantic::Color(k) = s { Some(*k) } else { None }),
    ] {
        let have = sets(columns, of);
        for k in 0..have.iter().copied().max().unwrap_or(0) {
            if !have.contains(&k) {
                let semantic = make(k);
                let values = (0..count * width).map(|i| missing(&semantic, i % width)).collect();
                let present = vec![false; count];
                columns.push(Column { semantic, width, encoding: Encoding::F32, values, present });
            }
        }
    }
    columns.sort_by(|a, b| a.semantic.cmp(&b.semantic));
}

/// How far a length may be from 1 and pass for it: what normals of signed bytes have at worst (half of sqrt(3) / 127), which is also as far as the Khronos validator goes. Nearer
/// ones stay as they are, bit for bit: what was read is what is written.
const ROUNDING: f64 = 0.0067;

/// The direction of `v`; itself, if it is of unit length but for rounding.
fn unit(v: Vec3) -> Option<Vec3> {
    let wide = v.as_dvec3();
    if (wide.length() - 1.0).abs() <= ROUNDING { Some(v) } else { wide.try_normalize().map(|n| n.as_vec3()) }
}

/// Unit length; the faces' normal where there is none.
fn normals(column: &mut Column, points: &[[f32; 3]], triangles: &[u32]) {
    let given = |v: &[f32; 3]| unit(Vec3::from_array(*v));
    let lacks: Vec<bool> = column
        .values
        .as_chunks::<3>()
        .0
        .iter()
        .zip(&column.present)
        .map(|(v, p)| !p || given(v).is_none())
        .collect();
    let mut faces = vec![DVec3::ZERO; if lacks.contains(&true) { points.len() } else { 0 }];
    if !faces.is_empty() {
        for t in triangles.as_chunks::<3>().0 {
            let [a, b, c] = t.map(|v| Vec3::from_array(points[v as usize]).as_dvec3());
            let n = (b - a).cross(c - a);
            t.iter().for_each(|&v| faces[v as usize] += n);
        }
    }
    for (i, v) in column.values.as_chunks_mut::<3>().0.iter_mut().enumerate() {
        let n = if lacks[i] { faces[i].try_normalize().map(|n| n.as_vec3()) } else { given(v) };
        *v = n.unwrap_or(Vec3::Z).to_array();
    }
}

/// Unit length, handedness +1 or -1; some direction across the normal where there is none.
fn tangents(columns: &mut [Column]) {
    let Some(n) = columns.iter().position(|c| c.semantic == Semantic::Normal) else { return };
    let Some(t) = columns.iter().position(|c| c.semantic == Semantic::Tangent) else { return };
    let normals = columns[n].values.clone();
    for (i, v) in columns[t].values.as_chunks_mut::<4>().0.iter_mut().enumerate() {
        let normal = normals.get(3 * i..3 * i + 3).map_or(Vec3::Z, Vec3::from_slice);
        let across = || normal.as_dvec3().any_orthogonal_vector();
        let d = unit(Vec3::from_slice(&v[..3]));
        let d = d.unwrap_or_else(|| across().normalize_or(DVec3::X).as_vec3());
        *v = [d.x, d.y, d.z, if v[3] < 0.0 { -1.0 } else { 1.0 }];
    }
}

/// Weights not negative, of sum 1 over all sets; a joint once a vertex, and joint 0 where the weight is 0.
fn weights(columns: &mut [Column]) {
    let pairs: Vec<(usize, usize)> = (0..=u8::MAX)
        .map_while(|k| {
            let at = |s: Semantic| columns.iter().position(|c| c.semantic == s && c.width == 4);
            Some((at(Semantic::Joints(k))?, at(Semantic::Weights(k))?))
        })
        .collect();
    let count = pairs.first().map_or(0, |&(j, _)| columns[j].values.len() / 4);
    let mut slots: Vec<(f32, f64)> = Vec::new();
    for i in 0..count {
        slots.clear();
        for &(j, w) in &pairs {
            for c in 4 * i..4 * i + 4 {
                slots.push((
                    columns[j].values[c].round().clamp(0.0, 65535.0),
                    columns[w].values[c].max(0.0) as f64,
                ));
            }
        }
        for a in 1..slots.len() {
            if let Some(b) = (0..a).find(|&b| slots[b].0 == slots[a].0 && slots[b].1 > 0.0) {
                slots[b].1 += std::mem::take(&mut slots[a].1);
            }
        }
        let sum: f64 = slots.iter().map(|s| s.1).sum();
        let used = slots.iter().filter(|s| s.1 > 0.0).count();
        if (sum - 1.0).abs() <= used as f64 * 1e-7 {
            // Rounding; the validator allows twice that.
        } else if sum > 0.0 && sum.is_finite() {
            slots.iter_mut().for_each(|s| s.1 /= sum);
        } else {
            slots.iter_mut().for_each(|s| s.1 = 0.0);
            slots[0].1 = 1.0;
        }
        for (p, &(j, w)) in pairs.iter().enumerate() {
            for k in 0..4 {
                let (joint, weight) = slots[4 * p + k];
                let weight = weight as f32;
                columns[w].values[4 * i + k] = weight;
                columns[j].values[4 * i + k] = if weight > 0.0 { joint } else { 0.0 };
            }
        }
    }
}
