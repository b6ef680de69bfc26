//! `bench/run --check`: what we publish of our own results, computed again by MeshLab.

use crate::lines::MeshLine;
use crate::meshes;
use crate::one;
use crate::plan::ratio;
use crate::raw::{Raw, digest};
use crate::results::{Results, name};
use crate::tools::{Places, find, output};
use anyhow::{Context, Result, bail, ensure};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;

/// MeshLab's samples on each side.
const SAMPLES: usize = 3_000_000;
/// How far our figures may be from MeshLab's, relative.
const MEAN: f64 = 0.01;
const RMS: f64 = 0.02;
/// Where two of MeshLab's own runs differ by more, it is no judge.
const NOISE: f64 = 0.005;

/// What was published of one of our results; lengths in diagonals of the original.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Published {
    pub(crate) mesh: String,
    /// Names the mesh's content.
    pub(crate) digest: String,
    pub(crate) ratio: f64,
    pub(crate) target: usize,
    pub(crate) tool: String,
    pub(crate) parameter: Option<f64>,
    pub(crate) mean: f64,
    pub(crate) rms: f64,
}

/// Mean and rms as MeshLab has them.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
struct Theirs {
    mean: f64,
    rms: f64,
}

/// What came of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Agrees,
    Differs,
    /// MeshLab's own runs differ.
    Listed,
}

/// Our rows that the README shows, each once.
pub(crate) fn published(all: &Results, ratios: &[f64], meshes: &[&MeshLine]) -> Vec<Published> {
    let mut out: Vec<Published> = Vec::new();
    for row in &all.rows {
        let ours = find(&row.tool).is_some_and(|t| t.ours);
        let shown = meshes.iter().any(|m| m.digest == row.digest) && ratios.contains(&row.ratio);
        let (true, true, Some(m)) = (ours, shown, &row.measures) else { continue };
        let p = Published {
            mesh: row.mesh.clone(),
            digest: row.digest.clone(),
            ratio: row.ratio,
            target: row.target,
            tool: row.tool.clone(),
            parameter: row.parameter,
            mean: m.worse.mean / m.diagonal,
            rms: m.worse.rms / m.diagonal,
        };
        if !out.contains(&p) {
            out.push(p);
        }
    }
    out
}

/// What of the published figures is to be checked.
#[derive(Clone, Debug, Default)]
pub(crate) struct Only {
    meshes: Vec<String>,
    tools: Vec<String>,
    ratios: Vec<f64>,
}

impl Only {
    /// Words name meshes, tools and ratios; of a kind that no word names, all. Errors: a word that names nothing that was published.
    pub(crate) fn new(words: &[String], all: &[Published]) -> Result<Only> {
        let mut only = Only::default();
        for word in words {
            if word.ends_with('%') {
                only.ratios.push(ratio(word)?);
            } else if all.iter().any(|p| p.mesh == *word) {
                only.meshes.push(word.clone());
            } else if all.iter().any(|p| p.tool == *word) {
                only.tools.push(word.clone());
            } else {
                let names = |of: fn(&Published) -> &str| {
                    let names: BTreeSet<&str> = all.iter().map(of).collect();
                    Vec::from_iter(names).join(", ")
                };
                bail!(
                    "--only {word}: no such mesh or tool was published; meshes are {}; tools are {}; ratios are written 10%",
                    names(|p| &p.mesh),
                    names(|p| &p.tool)
                );
            }
        }
        Ok(only)
    }

    fn holds_all(&self) -> bool {
        self.meshes.is_empty() && self.tools.is_empty() && self.ratios.is_empty()
    }

    fn holds(&self, p: &Published) -> bool {
        (self.meshes.is_empty() || self.meshes.contains(&p.mesh))
            && (self.tools.is_empty() || self.tools.contains(&p.tool))
            && (self.ratios.is_empty() || self.ratios.contains(&p.ratio))
    }
}

/// Lets MeshLab compute the published figures again; false if one differs. `quick`: only the meshes of a quick run.
pub(crate) fn check(
    places: &Places,
    all: &[Published],
    only: &Only,
    quick: bool,
    folder: &Path,
) -> Result<bool> {
    places
        .version(find("meshlab").context("no such tool")?)
        .map_err(|e| anyhow::anyhow!("no MeshLab: {e}"))?;
    std::fs::create_dir_all(folder)?;
    let few = meshes::quick(&places.env);
    let names: Vec<String> = few.iter().map(|s| s.name.clone()).collect();
    // What was published is of a full run, whose generated meshes have other sizes under the same names.
    let mut sources = [few, meshes::full(&places.env)].concat();
    sources.retain(|s| !quick || names.contains(&s.name));
    let mut loaded: Vec<(String, Raw)> = Vec::new();
    for s in sources {
        if let Ok(raw) = s.load() {
            loaded.push((digest(&raw.bytes()), raw));
        }
    }
    let (mut good, mut judged) = (true, 0);
    println!(
        "{:<12} {:>5}  {:<40} {:>20} {:>20}  verdict",
        "mesh", "kept", "method", "mean: off by", "rms: off by"
    );
    for p in wanted(all, only, quick.then_some(&names)) {
        let Some((_, original)) = loaded.iter().find(|l| l.0 == p.digest) else {
            println!("{:<12} is not here, or has changed", p.mesh);
            continue;
        };
        let (result, _) = one::run(&p.tool, original, p.target, p.parameter)?;
        let paths = [folder.join("check-original.raw"), folder.join("check-result.raw")];
        original.write(&paths[0])?;
        result.used().write(&paths[1])?;
        let runs = meshlab(places, &paths)?;
        let verdict = judge(p, &runs);
        let off = |f: fn(&Theirs) -> f64, ours: f64| {
            let theirs = runs.iter().map(f).sum::<f64>() / runs.len() as f64;
            format!("{ours:.4e} {:+.2} %", 100.0 * (ours / theirs - 1.0))
        };
        println!(
            "{:<12} {:>4}%  {:<40} {:>20} {:>20}  {}",
            p.mesh,
            100.0 * p.ratio,
            name(&p.tool),
            off(|t| t.mean, p.mean),
            off(|t| t.rms, p.rms),
            match verdict {
                Verdict::Agrees => "agrees",
                Verdict::Differs => "DIFFERS",
                Verdict::Listed => "not judged: MeshLab's own runs differ",
            }
        );
        good &= verdict != Verdict::Differs;
        judged += usize::from(verdict != Verdict::Listed);
    }
    ensure!(
        judged > 0,
        "nothing could be judged: of what was published, {} figures are of {}{}",
        wanted(all, only, quick.then_some(&names)).count(),
        if quick { "the meshes of a quick run" } else { "any mesh" },
        if only.holds_all() { "" } else { ", of those that --only names" }
    );
    Ok(good)
}

/// What is to be checked, of these meshes.
fn wanted<'a>(
    all: &'a [Published],
    only: &'a Only,
    meshes: Option<&'a Vec<String>>,
) -> impl Iterator<Item = &'a Published> {
    all.iter().filter(|p| only.holds(p)).filter(move |p| meshes.is_none_or(|m| m.contains(&p.mesh)))
}

fn meshlab(places: &Places, paths: &[std::path::PathBuf; 2]) -> Result<Vec<Theirs>> {
    let script = places.bench.join("peers/hausdorff.py");
    let samples = SAMPLES.to_string();
    let words = [script.to_string_lossy(), paths[0].to_string_lossy(), paths[1].to_string_lossy()];
    let [script, original, result] = &words;
    let said = output(&places.python(), &[script, original, result, &samples, "2"])
        .context("MeshLab could not measure the distance")?;
    let line = said.lines().last().unwrap_or_default();
    serde_json::from_str(line).context("MeshLab's answer")
}

/// Holds what was published against MeshLab's runs.
fn judge(p: &Published, runs: &[Theirs]) -> Verdict {
    let of = |f: fn(&Theirs) -> f64| {
        let values: Vec<f64> = runs.iter().map(f).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let (low, high) = values.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
        (mean, high - low > NOISE * mean)
    };
    let ((mean, noisy_mean), (rms, noisy_rms)) = (of(|t| t.mean), of(|t| t.rms));
    let near = |ours: f64, theirs: f64, within: f64| (ours - theirs).abs() <= within * theirs;
    match near(p.mean, mean, MEAN) && near(p.rms, rms, RMS) {
        _ if noisy_mean || noisy_rms => Verdict::Listed,
        true => Verdict::Agrees,
        false => Verdict::Differs,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::tests::results;

    #[test]
    fn what_is_published_is_ours_and_once() {
        let all = results();
        let mesh = MeshLine { digest: "d".into(), ..MeshLine::default() };
        let found = published(&all, &[0.1], &[&mesh]);
        let tools: Vec<&str> = found.iter().map(|p| p.tool.as_str()).collect();
        assert_eq!(tools, ["quadric", "quadric-exact"]);
        assert_eq!(found[0].rms, 4e-4);
        assert!(published(&all, &[0.3], &[&mesh]).is_empty());
    }

    #[test]
    fn a_quick_check_is_of_the_meshes_of_a_quick_run() {
        let p = |mesh: &str, ratio| Published {
            mesh: mesh.into(),
            digest: String::new(),
            ratio,
            target: 1,
            tool: "quadric".into(),
            parameter: None,
            mean: 1.0,
            rms: 1.0,
        };
        let all = [p("bunny", 0.1), p("dragon", 0.1), p("bunny", 0.5)];
        let few = vec!["bunny".to_string()];
        let count = |words: &[&str], meshes| {
            let words: Vec<String> = words.iter().map(|w| w.to_string()).collect();
            wanted(&all, &Only::new(&words, &all).unwrap(), meshes).count()
        };
        assert_eq!(count(&[], None), 3);
        assert_eq!(count(&[], Some(&few)), 2);
        assert_eq!(count(&["50%"], Some(&few)), 1);
        assert_eq!(count(&["dragon", "quadric"], None), 1);
        let text = Only::new(&["cow".to_string()], &all).unwrap_err().to_string();
        assert!(text.contains("cow") && text.contains("bunny, dragon") && text.contains("quadric"), "{text}");
        assert!(Only::new(&["0%".to_string()], &all).is_err());
    }

    #[test]
    fn figures_are_judged_where_meshlab_agrees_with_itself() {
        let p = Published {
            mesh: "m".into(),
            digest: "d".into(),
            ratio: 0.1,
            target: 1,
            tool: "quadric".into(),
            parameter: None,
            mean: 1.0,
            rms: 2.0,
        };
        let runs = |mean: f64, rms: f64, noise: f64| {
            [Theirs { mean, rms }, Theirs { mean: mean * (1.0 + noise), rms }]
        };
        assert_eq!(judge(&p, &runs(1.009, 2.03, 0.001)), Verdict::Agrees);
        assert_eq!(judge(&p, &runs(1.012, 2.0, 0.001)), Verdict::Differs);
        assert_eq!(judge(&p, &runs(1.0, 2.05, 0.001)), Verdict::Differs);
        assert_eq!(judge(&p, &runs(1.5, 2.0, 0.006)), Verdict::Listed);
    }
}
