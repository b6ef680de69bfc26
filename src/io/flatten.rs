//! Putting a scene into one mesh, for the formats that have no nodes.

use crate::aif::{Channel, MeshInput, NONE, Positions, Semantic, Wedges};
use crate::scene::{Extras, Group, Scene, SceneMesh};
use glam::{DMat3, DMat4, DVec3};
use std::borrow::Cow;
use std::collections::BTreeSet;

/// A scene as one mesh.
pub(crate) struct Flat<'a> {
    /// Everything the nodes show, in world space; the mesh itself where there is one, at the identity.
    pub(crate) geometry: Cow<'a, MeshInput>,
    /// What `geometry.face_group` indexes. With several instances every face has a group, whose object names the instance.
    pub(crate) groups: Cow<'a, [Group]>,
    /// What else is known of its faces and vertices; nothing with several instances.
    pub(crate) extras: Cow<'a, Extras>,
    /// The name of the only instance.
    pub(crate) name: Option<&'a str>,
    /// What was lost, for the format called by the name given.
    pub(crate) warnings: Vec<String>,
}

struct Instance<'a> {
    mesh: &'a SceneMesh,
    index: usize,
    name: Option<&'a str>,
    matrix: DMat4,
}

/// Turns all texture coordinates over, between an image origin at the upper left (glTF) and at the lower left (the other formats).
pub(crate) fn turn_v_over(w: &mut Wedges) {
    let is_uv = |c: &Channel| matches!(c.semantic, Semantic::TexCoord(_)) && c.width >= 2;
    let uv: Vec<usize> =
        (0..w.channels().len()).filter(|&k| is_uv(&w.channels()[k])).map(|k| w.offset(k) + 1).collect();
    for i in 0..w.len() as u32 {
        for &v in &uv {
            let row = w.row_mut(i);
            row[v] = 1.0 - row[v];
        }
    }
}

/// Applies the nodes of a scene: one mesh in world space. Mirrored instances are turned round; normals go by the inverse transpose.
/// A scene read from glTF has its texture coordinates turned over.
pub(crate) fn flatten<'a>(scene: &'a Scene, format: &str) -> Flat<'a> {
    let mut flat = place(scene, format);
    let is_uv = |c: &Channel| matches!(c.semantic, Semantic::TexCoord(_));
    if scene.gltf.is_some()
        && flat.geometry.wedges.as_ref().is_some_and(|w| w.channels().iter().any(is_uv))
        && let Some(w) = &mut flat.geometry.to_mut().wedges
    {
        turn_v_over(w);
    }
    flat
}

fn place<'a>(scene: &'a Scene, format: &str) -> Flat<'a> {
    let instances = instances(scene);
    let mut warnings = Vec::new();
    let mut shown = vec![0usize; scene.meshes.len()];
    instances.iter().for_each(|i| shown[i.index] += 1);
    let unseen = shown.iter().filter(|&&n| n == 0).count();
    if unseen > 0 {
        warnings.push(format!("{unseen} meshes that no node shows are left out"));
    }
    if shown.iter().any(|&n| n > 1) {
        warnings.push(format!("{format} has no instances: each is written as a mesh of its own"));
    }
    // Of a single node nothing is lost: where its mesh stands is kept.
    if scene.nodes.len() > 1 && instances.iter().any(|i| i.matrix != DMat4::IDENTITY) {
        warnings.push(format!("{format} has no nodes: their transforms are applied to the vertices"));
    }
    let beside = scene.gltf.as_ref().map_or_else(Vec::new, |s| s.beside_surfaces());
    if !beside.is_empty() {
        warnings.push(format!("{format} cannot hold {}: left out", beside.join(", ")));
    }
    if let [only] = &instances[..]
        && only.matrix == DMat4::IDENTITY
    {
        return Flat {
            geometry: Cow::Borrowed(&only.mesh.geometry),
            groups: Cow::Borrowed(&only.mesh.groups),
            extras: Cow::Borrowed(&only.mesh.extras),
            name: only.name,
            warnings,
        };
    }
    let name = if let [only] = &instances[..] { only.name } else { None };
    let (geometry, groups) = merge(&instances);
    let extras = Cow::Owned(one_extras(&instances));
    Flat { geometry: Cow::Owned(geometry), groups: Cow::Owned(groups), extras, name, warnings }
}

fn instances<'a>(scene: &'a Scene) -> Vec<Instance<'a>> {
    let mut list = Vec::new();
    if scene.nodes.is_empty() {
        let place = |(index, mesh): (usize, &'a SceneMesh)| Instance {
            mesh,
            index,
            name: mesh.name.as_deref(),
            matrix: DMat4::IDENTITY,
        };
        return scene.meshes.iter().enumerate().map(place).collect();
    }
    let world = scene.world_transforms();
    let mut seen = vec![false; scene.nodes.len()];
    let mut stack: Vec<usize> = scene.roots.iter().rev().copied().collect();
    while let Some(n) = stack.pop() {
        let Some(node) = scene.nodes.get(n) else { continue };
        if std::mem::replace(&mut seen[n], true) {
            continue;
        }
        if let Some(mesh) = node.mesh.and_then(|m| Some((m, scene.meshes.get(m)?))) {
            let name = node.name.as_deref().or(mesh.1.name.as_deref());
            list.push(Instance { mesh: mesh.1, index: mesh.0, name, matrix: world[n] });
        }
        stack.extend(node.children.iter().rev());
    }
    list
}

/// True if the faces that are in use are divided into groups that somebody named, or that a name other than the mesh's would be lost.
/// The primitives of a glTF mesh are no such groups: they are its materials.
pub(crate) fn has_named_groups(geometry: &MeshInput, groups: &[Group], name: Option<&str>) -> bool {
    let mut kinds = BTreeSet::new();
    let mut used = vec![false; groups.len()];
    for &g in &geometry.face_group {
        match used.get_mut(g as usize) {
            Some(seen) if *seen => continue,
            Some(seen) => *seen = true,
            None => {}
        }
        let none = (None, &[][..], None);
        kinds.insert(
            groups
                .get(g as usize)
                .map_or(none, |g| (g.object.as_deref(), &g.names[..], g.smoothing.as_deref())),
        );
        if kinds.len() > 1 {
            return true;
        }
    }
    kinds.iter().any(|&(object, names, smoothing)| {
        let of_object = object.is_none() || object == name;
        !(of_object
            && (names.is_empty() || names.len() == 1 && Some(names[0].as_str()) == name)
            && smoothing.is_none())
    })
}

/// How a transform acts on points and on normals.
struct Placement {
    matrix: DMat4,
    normal: DMat3,
    mirrored: bool,
    identity: bool,
}

impl Placement {
    fn new(matrix: DMat4) -> Self {
        let m = DMat3::from_mat4(matrix);
        let mirrored = m.determinant() < 0.0;
        // The cofactor matrix is the inverse transpose times the determinant, and exists for a singular one too.
        let cofactor =
            DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
        let normal = if mirrored { cofactor * -1.0 } else { cofactor };
        Placement { matrix, normal, mirrored, identity: matrix == DMat4::IDENTITY }
    }

    fn direction(matrix: &DMat3, v: &mut [f32]) {
        if let [x, y, z] = v {
            let d = (*matrix * DVec3::new(*x as f64, *y as f64, *z as f64)).normalize_or_zero();
            (*x, *y, *z) = (d.x as f32, d.y as f32, d.z as f32);
        }
    }
}

/// World points, and whether f32 still tells them apart as well as it did at home.
fn world_points(instance: &Instance<'_>, place: &Placement) -> (Vec<[f64; 3]>, bool) {
    let points: Vec<[f64; 3]> = instance
        .mesh
        .geometry
        .positions
        .iter()
        .map(|p| if place.identity { p } else { place.matrix.transform_point3(p) }.to_array())
        .collect();
    let single = !instance.mesh.geometry.positions.is_f64()
        && (place.identity
            || crate::aif::positions::bounds(points.iter().map(|&p| DVec3::from_array(p))).is_none_or(
                |(lo, hi)| {
                    let reach = lo.abs().max(hi.abs()).max_element();
                    // Far from the origin an f32 is coarse: within four times its own size an instance loses two bits at most.
                    reach <= 4.0 * (hi - lo).max_element() && reach < f32::MAX as f64
                },
            ));
    (points, single)
}

fn merge(instances: &[Instance<'_>]) -> (MeshInput, Vec<Group>) {
    let mut out = MeshInput::default();
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut single = true;
    let mut groups = Vec::new();
    let mut names = BTreeSet::new();
    let channels = union_of_channels(instances);
    let mut wedges = Wedges::new(channels).ok().filter(|w| w.stride() > 0);
    let polygons = instances.iter().any(|i| i.mesh.geometry.face_sizes.is_some());
    let mut sizes = Vec::new();
    let materials = instances.iter().any(|i| !i.mesh.geometry.face_material.is_empty());
    for instance in instances {
        let input = &instance.mesh.geometry;
        let place = Placement::new(instance.matrix);
        let base = points.len() as u32;
        let (world, fits) = world_points(instance, &place);
        points.extend(world);
        single &= fits;

        // Groups: those of the mesh, under the instance's name.
        let name = (instances.len() > 1).then(|| unique(instance, &mut names));
        let object = |g: &Group| match &name {
            Some(n) => Group { object: Some(n.clone()), ..g.clone() },
            None => g.clone(),
        };
        let first = groups.len() as u32;
        groups.extend(instance.mesh.groups.iter().map(object));
        let ungrouped = if name.is_some() { groups.len() as u32 } else { NONE };
        if name.is_some() {
            groups.push(object(&Group::default()));
        }
        let faces = input.face_count();
        for f in 0..faces {
            let g = input.face_group.get(f).copied().filter(|&g| g != NONE);
            out.face_group.push(g.map_or(ungrouped, |g| first + g));
        }
        if materials {
            out.face_material.extend((0..faces).map(|f| input.face_material.get(f).copied().unwrap_or(NONE)));
        }

        let wedge_base = wedges.as_ref().map_or(0, Wedges::len) as u32;
        if let Some(w) = &mut wedges {
            append_wedges(w, input.wedges.as_ref(), &place);
        }
        let mut at = 0usize;
        for f in 0..faces {
            let n = input.face_sizes.as_ref().map_or(3, |s| s[f] as usize);
            let range = at..(at + n).min(input.corners.len());
            at = range.end;
            if polygons {
                sizes.push(range.len() as u32);
            }
            for k in 0..range.len() {
                // A mirrored face runs the other way from the same first corner.
                let c = if place.mirrored && k > 0 { range.end - k } else { range.start + k };
                out.corners.push(base + input.corners[c]);
                if let Some(w) = &mut wedges {
                    let of_corner =
                        input.wedges.as_ref().and_then(|i| i.corner.get(c)).copied().filter(|&x| x != NONE);
                    w.corner.push(of_corner.map_or(NONE, |x| wedge_base + x));
                }
            }
        }
        out.wires.extend(input.wires.iter().map(|w| w.map(|v| base + v)));
    }
    out.face_sizes = polygons.then_some(sizes);
    if out.face_group.iter().all(|&g| g == NONE) {
        out.face_group.clear();
    }
    if let [only] = instances {
        out.face_row.clone_from(&only.mesh.geometry.face_row);
    }
    out.wedges = wedges;
    out.positions = if single {
        Positions::F32(points.iter().map(|p| p.map(|x| x as f32)).collect())
    } else {
        Positions::from_f64(points)
    };
    (out, groups)
}

/// The extras of the mesh that [`merge`] makes. (Normals of vertices without a face would have to be turned.)
fn one_extras(instances: &[Instance<'_>]) -> Extras {
    match instances {
        [only] => Extras { of_faces: only.mesh.extras.of_faces.clone(), ..Default::default() },
        _ => Extras::default(),
    }
}

/// Where the vertices of [`flatten`]'s mesh are from: each instance's, one after the other, as the mesh and the number of its vertices.
pub(crate) fn origins(scene: &Scene) -> Vec<(usize, usize)> {
    instances(scene).iter().map(|i| (i.index, i.mesh.geometry.positions.len())).collect()
}

/// A name for an instance that no other has.
fn unique(instance: &Instance<'_>, names: &mut BTreeSet<String>) -> String {
    let stem = instance
        .name
        .filter(|n| !n.is_empty())
        .map_or_else(|| format!("mesh{}", instance.index), str::to_string);
    let mut name = stem.clone();
    let mut k = 1;
    while !names.insert(name.clone()) {
        k += 1;
        name = format!("{stem}_{k}");
    }
    name
}

/// Every channel that any instance has; the widest where widths differ. At most 64: what comes later is left out.
fn union_of_channels(instances: &[Instance<'_>]) -> Vec<Channel> {
    let mut channels: Vec<Channel> = Vec::new();
    for c in instances.iter().filter_map(|i| i.mesh.geometry.wedges.as_ref()).flat_map(|w| w.channels()) {
        match channels.iter().position(|k| k.semantic == c.semantic) {
            Some(k) => channels[k].width = channels[k].width.max(c.width),
            None if channels.len() < 64 => channels.push(c.clone()),
            None => {}
        }
    }
    channels
}

fn append_wedges(to: &mut Wedges, from: Option<&Wedges>, place: &Placement) {
    let Some(from) = from else { return };
    let linear = DMat3::from_mat4(place.matrix);
    let mut row = vec![0.0; to.stride()];
    for w in 0..from.len() as u32 {
        row.fill(0.0);
        let mut present = 0;
        for (k, channel) in from.channels().iter().enumerate() {
            let (Some(values), Some(t)) = (from.get(w, k), to.channel(&channel.semantic)) else { continue };
            let slot = &mut row[to.offset(t)..to.offset(t) + to.channels()[t].width];
            if matches!(channel.semantic, Semantic::Color(_)) {
                // Opaque, where this mesh's colours have no alpha and another's have.
                slot.fill(1.0);
            }
            let n = values.len().min(slot.len());
            slot[..n].copy_from_slice(&values[..n]);
            if !place.identity {
                match channel.semantic {
                    Semantic::Normal => Placement::direction(&place.normal, slot),
                    Semantic::Tangent if n >= 4 => {
                        Placement::direction(&linear, &mut slot[..3]);
                        slot[3] *= if place.mirrored { -1.0 } else { 1.0 };
                    }
                    _ => {}
                }
            }
            present |= 1 << t;
        }
        to.push(&row, present);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Node;

    fn triangle() -> SceneMesh {
        let mut geometry =
            MeshInput::triangles(vec![[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]]);
        let mut wedges = Wedges::new(vec![Channel::new(Semantic::Normal, 3)]).unwrap();
        wedges.push(&[0.6, 0.0, 0.8], 1);
        wedges.corner = vec![0; 3];
        geometry.wedges = Some(wedges);
        SceneMesh { name: Some("t".into()), geometry, ..Default::default() }
    }

    fn node(transform: DMat4) -> Node {
        Node { name: None, transform, mesh: Some(0), children: vec![] }
    }

    #[test]
    fn one_mesh_at_the_identity_is_itself() {
        let scene = Scene::from_mesh(triangle());
        let flat = flatten(&scene, "X");
        assert!(matches!(flat.geometry, Cow::Borrowed(_)));
        assert_eq!((flat.name, flat.warnings.len()), (Some("t"), 0));
    }

    #[test]
    fn a_mirrored_instance_is_turned_round_and_its_normals_follow() {
        let mirror = DMat4::from_scale(DVec3::new(-2.0, 1.0, 1.0));
        let scene = Scene {
            meshes: vec![triangle()],
            nodes: vec![node(DMat4::IDENTITY), node(mirror)],
            roots: vec![0, 1],
            ..Default::default()
        };
        let flat = flatten(&scene, "X");
        assert_eq!(flat.geometry.corners, [0, 1, 2, 3, 5, 4]);
        assert_eq!(flat.geometry.positions.get(4), DVec3::new(-2.0, 0.0, 0.0));
        let objects: Vec<_> =
            flat.geometry.face_group.iter().map(|&g| flat.groups[g as usize].object.clone()).collect();
        assert_eq!(objects, [Some("t".into()), Some("t_2".into())]);
        assert_eq!(flat.warnings.len(), 2);
        // The surface that (0.6, 0, 0.8) is normal to holds (0.8, 0, -0.6), which is scaled to (-1.6, 0, -0.6).
        let w = flat.geometry.wedges.as_ref().unwrap();
        let n = w.get(w.corner[3], 0).unwrap();
        assert!((n[0] * -1.6 + n[2] * -0.6).abs() < 1e-6 && n[0] < 0.0 && n[2] > 0.0, "{n:?}");
    }

    #[test]
    fn far_instances_keep_their_detail() {
        let far = DMat4::from_translation(DVec3::splat(1e6));
        let scene =
            Scene { meshes: vec![triangle()], nodes: vec![node(far)], roots: vec![0], ..Default::default() };
        assert!(!flatten(&scene, "X").geometry.positions.is_f64(), "exact in f32 here");
        let far = DMat4::from_translation(DVec3::splat(1e6 + 0.01));
        let scene =
            Scene { meshes: vec![triangle()], nodes: vec![node(far)], roots: vec![0], ..Default::default() };
        assert!(flatten(&scene, "X").geometry.positions.is_f64());
    }
}

#[cfg(test)]
mod uv_tests {
    use crate::aif::attributes::Semantic;
    use crate::io::Format;
    use crate::io::{NoSide, decode, encode};
    use crate::meshes::{GenerateOptions, generate};
    use crate::scene::Scene;

    /// Position of a corner and its texture coordinates, for all corners, sorted.
    fn corners(scene: &Scene) -> Vec<[i64; 5]> {
        let m = &scene.meshes[0].geometry;
        let w = m.wedges.as_ref().unwrap();
        let k = w.channel(&Semantic::TexCoord(0)).unwrap();
        let round = |x: f64| (x * 98_765.0).round() as i64;
        let mut all: Vec<[i64; 5]> = m
            .corners
            .iter()
            .zip(&w.corner)
            .map(|(&v, &wedge)| {
                let (p, uv) = (m.positions.get(v as usize), w.get(wedge, k).unwrap());
                [p.x, p.y, p.z, uv[0] as f64, uv[1] as f64].map(round)
            })
            .collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    #[test]
    fn v_is_turned_over_once_on_the_way_to_gltf_and_once_back() {
        let sample = generate("quad-sphere", &GenerateOptions::default().with_faces(24)).unwrap();
        let scene = crate::samples::scene(sample, "s");
        let through = |format, scene: &Scene| {
            let bytes = encode(format, scene, &Default::default()).unwrap().bytes;
            decode(format, &bytes, &NoSide).unwrap().scene
        };
        let mut expected = corners(&scene);
        let glb = through(Format::Glb, &scene);
        assert_eq!(corners(&through(Format::Glb, &glb)), corners(&glb));
        assert_eq!(corners(&through(Format::Obj, &glb)), expected);
        for c in &mut expected {
            c[4] = 98_765 - c[4];
        }
        expected.sort_unstable();
        assert_eq!(corners(&glb), expected);
    }
}
