//! What `progmesh info` says to people.

use super::{EdgeKinds, Info, MeshInfo, PartInfo, ProgressiveInfo, VertexKinds};
use crate::cli::common::{short, thousands};
use progmesh::pipeline::count;
use std::fmt::Write;

impl ProgressiveInfo {
    fn text(&self) -> String {
        let mut s = format!(
            "progressive: base of {} triangles, {} splits, {} levels; what follows is full detail\n",
            thousands(self.base_triangles),
            thousands(self.splits),
            thousands(self.levels)
        );
        if let Some(b) = &self.streams {
            let all = [
                ("base", b.base),
                ("connectivity", b.connectivity),
                ("positions", b.positions),
                ("attributes", b.attributes),
                ("materials and groups", b.faces),
                ("errors", b.errors),
                ("bounds", b.bounds),
                ("order", b.order),
                ("scene", b.scene),
                ("directory", b.head),
                ("other", b.other),
            ];
            let each: Vec<String> = all
                .iter()
                .filter(|x| x.1 > 0)
                .map(|(what, n)| match *what {
                    "base" | "order" | "scene" | "directory" | "other" => {
                        format!("{what} {}", thousands(*n as usize))
                    }
                    _ => {
                        let bits = 8.0 * *n as f64 / self.splits.max(1) as f64;
                        format!("{what} {} ({bits:.1} bits a split)", thousands(*n as usize))
                    }
                })
                .collect();
            let chunks =
                self.chunks.map_or(String::new(), |n| format!("; splits in {}", count(n as usize, "chunk")));
            s += &format!("bytes: {}{chunks}\n", each.join(", "));
        }
        s
    }
}

impl Info {
    /// For people.
    pub(super) fn text(&self) -> String {
        // Writing to a String cannot fail.
        let mut s = String::new();
        let _ = writeln!(s, "{}: {}, {} bytes", self.file, self.format, thousands(self.bytes));
        if let Some(p) = &self.progressive {
            s += &p.text();
        }
        if self.nodes > 1 || self.meshes.len() != 1 {
            let _ = writeln!(
                s,
                "{}, {} triangles in the file; {}, {} of them showing a mesh: {} triangles instanced",
                count(self.meshes.len(), "mesh"),
                thousands(self.triangles.file),
                count(self.nodes, "node"),
                self.instances,
                thousands(self.triangles.instanced)
            );
            if self.triangles.built != self.triangles.file {
                let _ = writeln!(
                    s,
                    "{} triangles after building; what was left out is among each mesh's problems",
                    thousands(self.triangles.built)
                );
            }
        }
        let own = match self.meshes.as_slice() {
            [only] => only.bounds,
            _ => None,
        };
        if let Some([low, high]) = self.bounds.filter(|b| Some(*b) != own) {
            let _ =
                writeln!(s, "bounds in the world, as the nodes place the meshes: {}", bounds_text(low, high));
        }
        for (i, m) in self.meshes.iter().enumerate() {
            let _ = match &m.name {
                Some(n) => writeln!(s, "\nmesh {i}: {n}"),
                None => writeln!(s, "\nmesh {i}"),
            };
            m.write(&mut s);
            let materials: Vec<String> = m.materials.iter().map(|p| self.material_text(p)).collect();
            if !materials.is_empty() {
                let _ = writeln!(s, "  materials    {}", some_of(materials));
            }
        }
        if !self.materials.is_empty() {
            let named =
                |(i, m): (usize, &String)| if m.is_empty() { format!("material {i}") } else { m.clone() };
            let names = self.materials.iter().enumerate().map(named).collect();
            let _ = writeln!(s, "\nmaterials: {}", some_of(names));
        }
        for i in &self.images {
            let bytes = i.bytes.map_or("not found".into(), |b| format!("{} bytes", thousands(b)));
            let _ = writeln!(s, "image: {}, {bytes}", i.name.as_deref().unwrap_or("(no name)"));
        }
        if let Some(check) = &self.check {
            let _ = writeln!(s, "\ncheck: {check}");
        }
        s
    }

    fn material_text(&self, p: &PartInfo) -> String {
        format!("{} ({} faces)", p.name, thousands(p.faces))
    }
}

impl MeshInfo {
    fn write(&self, s: &mut String) {
        let n = thousands;
        let _ = writeln!(s, "  vertices     {}{}", n(self.vertices), self.vertex_kinds.text());
        let _ = writeln!(s, "  edges        {}{}", n(self.edges), self.edge_kinds.text());
        let f = &self.face_sizes;
        let sizes = [(f.triangles, "triangles"), (f.quads, "quads"), (f.larger, "larger")];
        let _ = writeln!(s, "  faces        {}{}", n(self.faces), listed(&sizes));
        if self.file_faces != self.faces {
            let change = match self.file_faces.checked_sub(self.faces) {
                Some(fewer) => format!("{} left out, see below", n(fewer)),
                None => "some were split, see below".into(),
            };
            let _ = writeln!(s, "  in the file  {} faces; {change}", n(self.file_faces));
        }
        let form = match (self.manifold, self.closed, self.orientable) {
            _ if self.faces == 0 => "no faces",
            (true, true, true) => "closed surface",
            (true, true, false) => "closed surface, one-sided",
            (true, false, true) => "surface with border",
            (true, false, false) => "surface with border, one-sided",
            (false, ..) => "non-manifold",
        };
        let genus = self.genus.map_or(String::new(), |g| format!(", genus {g}"));
        let _ = writeln!(
            s,
            "  form         {form}; components {}, border loops {}, Euler characteristic {}{genus}",
            n(self.components),
            n(self.border_loops),
            self.euler
        );
        if let Some([low, high]) = self.bounds {
            let _ = writeln!(s, "  bounds       {}, {}", bounds_text(low, high), self.precision);
        }
        if !self.attributes.is_empty() {
            let names = self.attributes.iter().map(|a| format!("{} ({} x {})", a.name, a.width, a.encoding));
            let _ = writeln!(s, "  attributes   {}", some_of(names.collect()));
        }
        if !self.groups.is_empty() {
            let names = self.groups.iter().map(|g| format!("{} ({} faces)", g.name, n(g.faces)));
            let _ = writeln!(s, "  groups       {}", some_of(names.collect()));
        }
        let _ = writeln!(s, "  AIF          {} bytes", n(self.aif_bytes));
        for p in &self.problems {
            let _ = writeln!(s, "  problem      {p}");
        }
    }
}

impl VertexKinds {
    fn text(&self) -> String {
        listed(&[
            (self.interior, "interior"),
            (self.border, "border"),
            (self.complex, "complex"),
            (self.dangling, "dangling"),
            (self.cut, "cut"),
            (self.isolated, "isolated"),
        ])
    }
}

impl EdgeKinds {
    fn text(&self) -> String {
        listed(&[
            (self.regular, "regular"),
            (self.border, "border"),
            (self.complex, "complex"),
            (self.dangling, "dangling"),
            (self.isolated, "isolated"),
        ])
    }
}

/// `: 3 of this, 4 of that`, those of none left out.
fn listed(counts: &[(usize, &str)]) -> String {
    let parts: Vec<String> =
        counts.iter().filter(|c| c.0 > 0).map(|c| format!("{} {}", thousands(c.0), c.1)).collect();
    if parts.is_empty() { String::new() } else { format!(": {}", parts.join(", ")) }
}

fn bounds_text(low: [f64; 3], high: [f64; 3]) -> String {
    let point = |p: [f64; 3]| p.map(short).join(" ");
    let diagonal = glam::DVec3::from_array(low).distance(glam::DVec3::from_array(high));
    format!("{} to {}, diagonal {}", point(low), point(high), short(diagonal))
}

/// The first dozen, and how many more there are.
fn some_of(mut names: Vec<String>) -> String {
    const SHOWN: usize = 12;
    let more = names.len().saturating_sub(SHOWN);
    names.truncate(SHOWN);
    let shown = names.join(", ");
    if more == 0 { shown } else { format!("{shown}, and {more} more") }
}
