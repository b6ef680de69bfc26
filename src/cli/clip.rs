//! `progmesh clip IN OUT`.

use super::Failure;
use super::args::Input;
use super::camera;
use super::common::{Warnings, thousands};
use super::control::Interrupt;
use super::ending::Ending;
use glam::{DVec3, DVec4};
use progmesh::pipeline::count;
use progmesh::refine::view::clip::box_planes;
use progmesh::views::{ClipReport, clip_scene};
use serde::Serialize;
use std::time::Instant;

/// Cut a mesh to a box, to one side of a plane, or to what a camera's frustum holds.
///
/// Faces are cut exactly at the planes, with their attributes; materials, nodes and instances are kept where they can be. With several of --box, --plane and
/// --frustum, what is inside of all is kept. Lengths are world units, with the nodes of the file applied.
#[derive(clap::Args, Debug)]
#[command(group(clap::ArgGroup::new("region").required(true).multiple(true)), after_help = "\
Examples:
  progmesh clip scan.ply part.ply --box=-1,0,-1,1,2,1
  progmesh clip dragon.ply half.stl --plane 1,0,0,0 --cap
  progmesh clip city.glb view.glb --frustum cam.json --png view.png")]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    ending: Ending,
    /// Keep what is in this box
    #[arg(long = "box", value_name = "X0,Y0,Z0,X1,Y1,Z1", group = "region", value_parser = numbers::<6>, allow_hyphen_values = true)]
    corners: Option<[f64; 6]>,
    /// Keep the side where ax + by + cz + d >= 0; may be given several times
    #[arg(long, value_name = "A,B,C,D", group = "region", value_parser = plane, allow_hyphen_values = true)]
    plane: Vec<[f64; 4]>,
    /// Keep what is in the frustum of this camera: CAM.json (docs/camera.md), or scene.glb#NAME
    #[arg(long, value_name = "CAM", group = "region")]
    frustum: Option<String>,
    /// Close the cuts of closed meshes
    #[arg(long)]
    cap: bool,
}

fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let wrong = |what: String| format!("must be {N} numbers with commas between them: {what}");
    let number = |t: &str| match t.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        Ok(_) => Err(wrong(format!("{t:?} is not finite"))),
        Err(_) => Err(wrong(format!("{t:?} is none"))),
    };
    let list = text.split(',').map(number).collect::<Result<Vec<f64>, _>>()?;
    <[f64; N]>::try_from(list).map_err(|l| wrong(format!("these are {}", l.len())))
}

fn plane(text: &str) -> Result<[f64; 4], String> {
    let p @ [a, b, c, _] = numbers::<4>(text)?;
    if [a, b, c] == [0.0; 3] { Err("a, b and c must not all be 0".into()) } else { Ok(p) }
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let start = Instant::now();
        let mut results = self.ending.begin()?;
        let planes = self.planes(&mut results.warnings)?;
        let interrupt = Interrupt::watch();
        let loaded = self.input.read(&mut results.warnings)?;
        let (mut scene, read) = (loaded.decoded.scene, start.elapsed().as_secs_f64());
        interrupt.be_graceful();
        let file = self.input.name();
        let (before, vertices_in) = (scene.unique_triangles(), vertices(&scene));
        results.draw(&scene)?;
        let clipping = Instant::now();
        let done = clip_scene(&mut scene, &planes, self.cap);
        let done = done.map_err(|e| Failure::Input(format!("{file}: {e}")))?;
        let clip = clipping.elapsed().as_secs_f64();
        results
            .warnings
            .say(self.surprises(&done, scene.unique_triangles() == 0).map(|w| format!("{file}: {w}")));
        let spent = self.ending.finish(&mut results, &scene, &interrupt)?;
        self.ending.say(|| {
            let capped = match done.loops {
                0 => String::new(),
                n => format!(", {} closed with {}", count(n, "cut"), count(done.cap_triangles, "triangle")),
            };
            let (before, after) = (thousands(before), thousands(scene.unique_triangles()));
            format!("{file}: {before} -> {after} triangles; {} cut{capped}", count(done.cut_faces, "face"))
        });
        self.ending.print(&Report {
            command: "clip",
            from: loaded.format.extension(),
            to: results.format.extension(),
            planes: planes.iter().map(|p| p.to_array()).collect(),
            instances: Instances { inside: done.inside, cut: done.cut, outside: done.outside },
            vertices: [vertices_in, vertices(&scene)],
            triangles: [before, scene.unique_triangles()],
            cut_faces: done.cut_faces,
            dropped_faces: done.dropped_faces,
            cap: self.cap.then_some(Cap {
                loops: done.loops,
                triangles: done.cap_triangles,
                open_edges: done.open_edges,
            }),
            seconds: Seconds {
                read,
                clip,
                draw: spent.draw,
                write: spent.write,
                total: start.elapsed().as_secs_f64(),
            },
            warnings: results.warnings.all,
        })
    }

    fn planes(&self, warnings: &mut Warnings) -> Result<Vec<DVec4>, Failure> {
        let mut planes = Vec::new();
        if let Some([x0, y0, z0, x1, y1, z1]) = self.corners {
            if x0 > x1 || y0 > y1 || z0 > z1 {
                return Err(Failure::Usage(
                    "--box: the least corner comes first: x0 <= x1, y0 <= y1, z0 <= z1".into(),
                ));
            }
            planes.extend(box_planes(DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1)));
        }
        planes.extend(self.plane.iter().map(|&p| DVec4::from_array(p)));
        if let Some(source) = &self.frustum {
            let frustum = camera::read(source, warnings)?.frustum();
            let real = frustum.planes().iter().filter(|p| p.normal != DVec3::ZERO);
            planes.extend(real.map(|p| p.normal.extend(p.offset - p.normal.dot(frustum.origin()))));
        }
        Ok(planes)
    }

    fn surprises(&self, done: &ClipReport, nothing: bool) -> impl Iterator<Item = String> {
        let open = (done.open_edges > 0).then(|| {
            format!(
                "the surface is open where it was cut ({}): no cap there; one can be made where a surface is closed",
                count(done.open_edges, "edge")
            )
        });
        let skinned = (done.skinned > 0).then(|| {
            format!("{} with a skin: cut where it rests, not where it moves", count(done.skinned, "mesh"))
        });
        let nothing = nothing.then(|| "nothing is left".to_string());
        [open, skinned, nothing].into_iter().flatten()
    }
}

fn vertices(scene: &progmesh::scene::Scene) -> usize {
    scene.meshes.iter().map(|m| m.geometry.positions.len()).sum()
}

/// The schema of `--json`; docs/json.md says what each field means.
#[derive(Serialize)]
struct Report {
    command: &'static str,
    from: &'static str,
    to: &'static str,
    planes: Vec<[f64; 4]>,
    instances: Instances,
    vertices: [usize; 2],
    triangles: [usize; 2],
    cut_faces: usize,
    dropped_faces: usize,
    cap: Option<Cap>,
    seconds: Seconds,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Instances {
    inside: usize,
    cut: usize,
    outside: usize,
}

#[derive(Serialize)]
struct Cap {
    loops: usize,
    triangles: usize,
    open_edges: usize,
}

#[derive(Serialize)]
struct Seconds {
    read: f64,
    clip: f64,
    draw: f64,
    write: f64,
    total: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_and_boxes_are_read() {
        assert_eq!(numbers::<3>("1, -2,3e1"), Ok([1.0, -2.0, 30.0]));
        assert!(numbers::<3>("1,2").is_err() && numbers::<2>("1,x").is_err() && numbers::<1>("nan").is_err());
        assert_eq!(plane("0,0,-1,0.5"), Ok([0.0, 0.0, -1.0, 0.5]));
        assert!(plane("0,0,0,1").is_err());
    }
}
