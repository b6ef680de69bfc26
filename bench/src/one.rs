//! One run of one of our methods, or of meshoptimizer, in this process.

use crate::raw::Raw;
use anyhow::{Result, bail, ensure};
use meshopt::{SimplifyOptions, VertexDataAdapter};
use progmesh::aif::{BuildOptions, Mesh, MeshInput, Positions};
use progmesh::simplify::{Method, Options, Placement, Quiet, Schedule, simplify};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// What a run says of itself, as one line of JSON on standard output.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Said {
    /// Seconds of the tool's own call. Ours: from arrays in memory to arrays in memory. Peers that work on a structure of their own (MeshLab,
    /// CGAL): without filling and emptying it.
    pub(crate) call_seconds: f64,
    /// Seconds from arrays in memory to arrays in memory.
    pub(crate) arrays_seconds: f64,
    pub(crate) triangles: usize,
    /// Most memory the process had, bytes.
    pub(crate) peak_bytes: Option<u64>,
    /// What was searched for so that the target is met: NSA's epsilon (degrees), CGAL's stop ratio.
    pub(crate) parameter: Option<f64>,
    /// Runs that the search took, this one included; `None`: it was not searched.
    #[serde(default)]
    pub(crate) rounds: Option<u32>,
}

/// Simplifies to `target` triangles. A `parameter` that an earlier run found is used as it is.
pub(crate) fn run(tool: &str, mesh: &Raw, target: usize, parameter: Option<f64>) -> Result<(Raw, Said)> {
    match tool {
        "quadric" => ours(mesh, options(target)),
        "quadric-exact" => {
            let mut o = options(target);
            o.schedule = Some(Schedule::Exact);
            ours(mesh, o)
        }
        "quadric-endpoint" => {
            let mut o = options(target);
            o.placement = Some(Placement::Endpoint);
            ours(mesh, o)
        }
        "cluster" => {
            let mut o = options(target);
            o.method = Method::Cluster;
            ours(mesh, o)
        }
        "nsa" => nsa(mesh, target, parameter),
        "meshopt" => meshopt_plain(mesh, target),
        "meshopt-update" => meshopt_update(mesh, target),
        other => bail!("{other} does not run in this process"),
    }
}

fn options(target: usize) -> Options {
    let mut options = Options::default();
    options.triangles = Some(target);
    options
}

/// Arrays in, arrays out.
fn ours(mesh: &Raw, options: Options) -> Result<(Raw, Said)> {
    // As a reader of files has them.
    let positions = Positions::from_f64(mesh.points.clone());
    let corners = mesh.triangles.as_flattened().to_vec();
    let start = Instant::now();
    let input = MeshInput { positions, corners, ..Default::default() };
    let (mut built, _) = Mesh::build(input, &BuildOptions::default())?;
    simplify(&mut built, &options, &Quiet)?;
    let triangles = built.triangles();
    let call_seconds = start.elapsed().as_secs_f64();
    let points = built.positions().iter().map(|p| p.to_array()).collect();
    let out = Raw { points, triangles };
    let said = Said {
        call_seconds,
        arrays_seconds: call_seconds,
        triangles: out.triangles.len(),
        ..Default::default()
    };
    Ok((out, said))
}

/// NSA goes as far as epsilon lets it: the least epsilon that meets the target, to 2 %, gives the best mesh of that count.
fn nsa(mesh: &Raw, target: usize, parameter: Option<f64>) -> Result<(Raw, Said)> {
    let with = |epsilon: f64| {
        let mut o = options(target);
        o.method = Method::Nsa;
        o.epsilon = Some(epsilon);
        ours(mesh, o)
    };
    let mut rounds = None;
    let epsilon = match parameter {
        Some(epsilon) => epsilon,
        None => least(|epsilon| {
            rounds = Some(rounds.unwrap_or(1) + 1);
            Ok(with(epsilon)?.1.triangles <= target)
        })?,
    };
    let (out, mut said) = with(epsilon)?;
    said.rounds = rounds;
    said.parameter = Some(epsilon);
    Ok((out, said))
}

/// The least angle of which `meets` is true, to 2 % above; 180 if none is.
fn least(mut meets: impl FnMut(f64) -> Result<bool>) -> Result<f64> {
    let (mut no, mut yes) = (0.25, 180.0);
    let mut next = 8.0;
    while yes > 1.02 * no {
        if meets(next)? {
            yes = next;
        } else {
            no = next;
        }
        next = (no * yes).sqrt();
    }
    Ok(yes)
}

fn meshopt_plain(mesh: &Raw, target: usize) -> Result<(Raw, Said)> {
    let (points, indices) = as_meshopt(mesh);
    let bytes: Vec<u8> = points.as_flattened().iter().flat_map(|x| x.to_ne_bytes()).collect();
    let vertices = VertexDataAdapter::new(&bytes, 12, 0)?;
    let start = Instant::now();
    // No bound on the error: only the count ends it.
    let left = meshopt::simplify(&indices, &vertices, 3 * target, f32::MAX, SimplifyOptions::None, None);
    finished(start, points, &left)
}

fn meshopt_update(mesh: &Raw, target: usize) -> Result<(Raw, Said)> {
    let (mut points, mut indices) = as_meshopt(mesh);
    let start = Instant::now();
    let left = meshopt::simplify_with_update(
        &mut indices,
        &mut points,
        &mut [],
        &[],
        0,
        None,
        3 * target,
        f32::MAX,
        SimplifyOptions::None,
        None,
    );
    ensure!(left <= indices.len(), "more indices than before");
    indices.truncate(left);
    finished(start, points, &indices)
}

fn as_meshopt(mesh: &Raw) -> (Vec<[f32; 3]>, Vec<u32>) {
    let points = mesh.points.iter().map(|p| p.map(|x| x as f32)).collect();
    (points, mesh.triangles.as_flattened().to_vec())
}

fn finished(start: Instant, points: Vec<[f32; 3]>, indices: &[u32]) -> Result<(Raw, Said)> {
    let seconds = start.elapsed().as_secs_f64();
    let points = points.iter().map(|p| p.map(f64::from)).collect();
    let out = Raw { points, triangles: indices.as_chunks().0.to_vec() };
    let triangles = out.triangles.len();
    Ok((out, Said { call_seconds: seconds, arrays_seconds: seconds, triangles, ..Default::default() }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tools::{Host, TOOLS};
    use progmesh::meshes::{GenerateOptions, generate};

    fn torus() -> Raw {
        let sample = generate("torus", &GenerateOptions::default().with_faces(2000)).unwrap();
        Raw { points: sample.positions, triangles: sample.corners.as_chunks().0.to_vec() }
    }

    #[test]
    fn every_tool_of_this_process_meets_the_target() {
        let mesh = torus();
        for tool in TOOLS.iter().filter(|t| t.host == Host::Rust) {
            let (out, said) = run(tool.id, &mesh, 400, None).unwrap();
            assert_eq!(said.triangles, out.triangles.len());
            // Clusters and meshoptimizer's passes are coarse.
            assert!((300..=400).contains(&said.triangles), "{}: {}", tool.id, said.triangles);
            assert!(said.call_seconds > 0.0 && said.arrays_seconds >= said.call_seconds, "{}", tool.id);
            assert!(out.used().points.len() < mesh.points.len() / 2, "{}", tool.id);
        }
        assert!(run("meshlab", &mesh, 400, None).is_err());
    }

    #[test]
    fn epsilon_is_the_least_that_meets_the_target() {
        let mesh = torus();
        let (first, said) = run("nsa", &mesh, 400, None).unwrap();
        let epsilon = said.parameter.unwrap();
        assert_eq!(run("nsa", &mesh, 400, Some(epsilon)).unwrap().0, first);
        assert!(run("nsa", &mesh, 400, Some(epsilon / 1.03)).unwrap().1.triangles > 400);
        assert_eq!(least(|_| Ok(false)).unwrap(), 180.0);
    }
}
