//! What a file holds: meshes as flat arrays, the nodes that place them, materials and images.
//!
//! Readers make a [`Scene`], writers take one; neither builds topology. A mesh is a [`MeshInput`], ready for
//! [`crate::aif::Mesh::build`], and comes back from a mesh as one.

use crate::aif::{Encoding, MeshInput};
use glam::DMat4;

/// A file's content.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The unique meshes; nodes refer to them, so that instances stay instances.
    pub meshes: Vec<SceneMesh>,
    /// The nodes. A format without nodes has one for each mesh, with the identity.
    pub nodes: Vec<Node>,
    /// Indices of the nodes that have no parent, in order.
    pub roots: Vec<usize>,
    /// Materials; `MeshInput::face_material` indexes them.
    pub materials: Vec<Material>,
    /// Images that materials refer to.
    pub images: Vec<Image>,
    /// What is said of the whole, by name: comments in PLY and OBJ, extras of the (first) scene in glTF, kept in a `.pm`; other formats hold none.
    pub facts: serde_json::Map<String, serde_json::Value>,
    /// What a glTF file holds beside its meshes, carried through to a glTF output. Where it is there, texture coordinates are as glTF
    /// has them (v runs down); elsewhere v runs up. [`crate::io::encode`] turns them over as the output needs.
    pub gltf: Option<Box<crate::io::gltf::Source>>,
}

/// A mesh with its name and the names of its groups.
#[derive(Clone, Debug, Default)]
pub struct SceneMesh {
    /// Its name, where the file gives one.
    pub name: Option<String>,
    /// Positions, faces, attributes, material and group of every face.
    pub geometry: MeshInput,
    /// What `geometry.face_group` indexes.
    pub groups: Vec<Group>,
    /// What else the file says of faces and vertices. Nothing is decided by it.
    pub extras: Extras,
}

/// What a file says of elements of a mesh that no algorithm looks at, carried to where it can be written again.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extras {
    /// Values of faces; `geometry.face_row` says which of them a face has.
    pub of_faces: Vec<FaceValues>,
    /// Attributes of vertices that no face uses.
    pub loose: LooseRows,
}

/// A named number of every face.
#[derive(Clone, Debug, PartialEq)]
pub struct FaceValues {
    /// Its name in the file.
    pub name: String,
    /// How the file stored it.
    pub encoding: Encoding,
    /// The values, exactly as stored, row by row.
    pub values: Vec<f64>,
}

/// Rows of the layout of the mesh's wedges, for vertices that have no corner and so no wedge.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LooseRows {
    /// The vertices, ascending.
    pub vertices: Vec<u32>,
    /// Channels that each has.
    pub present: Vec<u64>,
    /// The values, row after row.
    pub rows: Vec<f32>,
}

impl Extras {
    /// True if there is nothing.
    pub fn is_empty(&self) -> bool {
        self.of_faces.is_empty() && self.loose.vertices.is_empty()
    }

    /// The values of faces with rows for the faces of `of` in turn; those of a face without are 0.
    pub(crate) fn by_face(mut self, of: &MeshInput) -> Self {
        if of.face_row.len() != of.face_count() {
            self.of_faces.clear();
        }
        for v in &mut self.of_faces {
            let at = |&r: &u32| v.values.get(r as usize).copied().unwrap_or(0.0);
            v.values = of.face_row.iter().map(at).collect();
        }
        self
    }

    /// Rows that all values of faces have.
    pub fn rows(&self) -> usize {
        self.of_faces.iter().map(|v| v.values.len()).min().unwrap_or(0)
    }
}

impl LooseRows {
    /// The place of each vertex's row, if they are rows of that width for so many vertices; else of none.
    pub(crate) fn places(&self, stride: usize, vertices: usize) -> std::collections::HashMap<u32, usize> {
        let n = self.vertices.len();
        let fits = self.present.len() == n && self.rows.len() == n * stride;
        let own = self.vertices.iter().copied().filter(|&v| fits && (v as usize) < vertices);
        own.zip(0..).collect()
    }
}

/// Faces that belong together: OBJ's `o`, `g` and `s`, or a glTF primitive.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Group {
    /// OBJ `o`.
    pub object: Option<String>,
    /// OBJ `g`: any number of names.
    pub names: Vec<String>,
    /// OBJ `s`, as written.
    pub smoothing: Option<String>,
    /// The glTF primitive of the mesh that the faces came from.
    pub primitive: Option<u32>,
}

impl Group {
    /// A name for people: the object and the group names, or the primitive's number.
    pub fn label(&self) -> String {
        let mut parts: Vec<&str> = self.object.iter().map(String::as_str).collect();
        parts.extend(self.names.iter().map(String::as_str));
        match (parts.is_empty(), self.primitive) {
            (true, Some(p)) => format!("primitive {p}"),
            _ => parts.join(" "),
        }
    }
}

/// Where a mesh stands.
#[derive(Clone, Debug)]
pub struct Node {
    /// Its name, where the file gives one.
    pub name: Option<String>,
    /// Transform to the parent's space.
    pub transform: DMat4,
    /// The mesh it shows, an index of [`Scene::meshes`].
    pub mesh: Option<usize>,
    /// Its children, indices of [`Scene::nodes`].
    pub children: Vec<usize>,
}

/// A surface: the part of physically based shading that the formats share.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Its name; may be empty.
    pub name: String,
    /// Linear RGBA.
    pub base_color: [f32; 4],
    /// Index of [`Scene::images`].
    pub base_color_image: Option<usize>,
    /// Tangent-space normal map, index of [`Scene::images`].
    pub normal_image: Option<usize>,
    /// 0 for a dielectric, 1 for a metal.
    pub metallic: f32,
    /// 0 smooth, 1 rough.
    pub roughness: f32,
    /// Linear RGB.
    pub emissive: [f32; 3],
    /// True if back faces are drawn.
    pub double_sided: bool,
    /// An MTL file's statements for this material, as written, for writing OBJ again without loss.
    pub mtl: Option<String>,
}

impl Default for Material {
    fn default() -> Self {
        Material {
            name: String::new(),
            base_color: [1.0; 4],
            base_color_image: None,
            normal_image: None,
            metallic: 0.0,
            roughness: 1.0,
            emissive: [0.0; 3],
            double_sided: false,
            mtl: None,
        }
    }
}

/// A texture image, encoded as its file is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Its name, where the file gives one.
    pub name: Option<String>,
    /// The path or URI that the file names it by.
    pub uri: Option<String>,
    /// `image/png`, `image/jpeg`, ..., where known.
    pub mime: Option<String>,
    /// Its bytes, when they could be found.
    pub data: Option<Vec<u8>>,
}

impl Scene {
    /// What is said of it, a line each.
    pub(crate) fn comments(&self) -> impl Iterator<Item = String> {
        let line = |text: String| text.replace(|c: char| c.is_control(), " ");
        self.facts.iter().map(move |(name, value)| line(format!("{name} {value}")))
    }

    /// A scene of one mesh in one node.
    pub fn from_mesh(mesh: SceneMesh) -> Self {
        let node =
            Node { name: mesh.name.clone(), transform: DMat4::IDENTITY, mesh: Some(0), children: vec![] };
        Scene { meshes: vec![mesh], nodes: vec![node], roots: vec![0], ..Default::default() }
    }

    /// The transform of every node to the world. Nodes in a cycle or out of range are left at the identity. O(nodes).
    pub fn world_transforms(&self) -> Vec<DMat4> {
        let mut world = vec![DMat4::IDENTITY; self.nodes.len()];
        let mut seen = vec![false; self.nodes.len()];
        let mut stack: Vec<(usize, DMat4)> = self.roots.iter().rev().map(|&r| (r, DMat4::IDENTITY)).collect();
        while let Some((n, parent)) = stack.pop() {
            if n >= self.nodes.len() || std::mem::replace(&mut seen[n], true) {
                continue;
            }
            world[n] = parent * self.nodes[n].transform;
            stack.extend(self.nodes[n].children.iter().rev().map(|&c| (c, world[n])));
        }
        world
    }

    /// How often each mesh is shown: by how many nodes below the roots. Once, where there are no nodes at all. O(nodes).
    pub fn instance_counts(&self) -> Vec<usize> {
        if self.nodes.is_empty() {
            return vec![1; self.meshes.len()];
        }
        let mut counts = vec![0; self.meshes.len()];
        let mut seen = vec![false; self.nodes.len()];
        let mut stack = self.roots.clone();
        while let Some(n) = stack.pop() {
            let Some(node) = self.nodes.get(n) else { continue };
            if std::mem::replace(&mut seen[n], true) {
                continue;
            }
            if let Some(count) = node.mesh.and_then(|m| counts.get_mut(m)) {
                *count += 1;
            }
            stack.extend(&node.children);
        }
        counts
    }

    /// Triangles of all instances: what is drawn.
    pub fn instanced_triangles(&self) -> usize {
        self.meshes.iter().zip(self.instance_counts()).map(|(m, n)| m.triangles().saturating_mul(n)).sum()
    }

    /// Triangles of all unique meshes: a polygon of n corners counts n - 2.
    pub fn unique_triangles(&self) -> usize {
        self.meshes.iter().map(|m| m.triangles()).sum()
    }
}

impl SceneMesh {
    /// Sets the geometry, and keeps of the extras what goes with it. Their values of faces are those of the input's faces in turn: `faces` are the numbers there of the geometry's faces, if they are
    /// known; `whole` says that it has the input's vertices.
    pub(crate) fn stand(&mut self, geometry: MeshInput, faces: Option<Vec<u32>>, whole: bool) {
        self.geometry = geometry;
        if !whole {
            self.extras.loose = LooseRows::default();
        }
        match faces {
            Some(faces) if !self.extras.of_faces.is_empty() => self.geometry.face_row = faces,
            _ => self.extras.of_faces.clear(),
        }
    }

    /// Number of triangles its faces make.
    pub fn triangles(&self) -> usize {
        match &self.geometry.face_sizes {
            None => self.geometry.corners.len() / 3,
            Some(s) => s.iter().map(|&n| n.saturating_sub(2) as usize).sum(),
        }
    }
}
