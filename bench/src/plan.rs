//! What is run: meshes, tools, ratios, threads, repetitions.

use crate::meshes::{self, Source};
use crate::tools::{TOOLS, Tool};
use anyhow::{Result, bail, ensure};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// All ratios, in the order of the tables.
pub(crate) const RATIOS: [f64; 6] = [0.9, 0.5, 0.2, 0.1, 0.05, 0.01];

/// A whole run.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) meshes: Vec<Source>,
    pub(crate) tools: Vec<&'static Tool>,
    pub(crate) ratios: Vec<f64>,
    /// Runs of each, of which the median counts.
    pub(crate) repeat: usize,
    /// Area samples on each side of the measurement.
    pub(crate) samples: usize,
    /// A run that takes longer than this has failed.
    pub(crate) limit: Duration,
}

/// What the command line asks for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Wanted {
    pub(crate) quick: bool,
    pub(crate) data: Option<PathBuf>,
    /// Names of meshes, ids of tools, ratios in per cent; nothing for all.
    pub(crate) only: Vec<String>,
    pub(crate) repeat: Option<usize>,
}

impl Plan {
    /// Errors: a folder without meshes, a word that names nothing.
    pub(crate) fn new(wanted: &Wanted, env: &Path) -> Result<Plan> {
        let meshes = match &wanted.data {
            Some(folder) => meshes::of_folder(folder)?,
            None if wanted.quick => meshes::quick(env),
            None => meshes::full(env),
        };
        let ratios = if wanted.quick { vec![0.5, 0.1, 0.01] } else { RATIOS.to_vec() };
        let repeat = wanted.repeat.unwrap_or(5);
        ensure!(repeat > 0, "--repeat 0 measures nothing");
        let limit = Duration::from_secs(if wanted.quick { 120 } else { 600 });
        let tools = TOOLS.iter().collect();
        let mut plan = Plan { meshes, tools, ratios, repeat, samples: 300_000, limit };
        plan.only(&wanted.only)?;
        Ok(plan)
    }

    /// Keeps what the words name; of a kind that no word names, all.
    fn only(&mut self, words: &[String]) -> Result<()> {
        let (mut meshes, mut tools, mut ratios) = (vec![], vec![], vec![]);
        for word in words {
            if word.ends_with('%') {
                ratios.push(ratio(word)?);
            } else if let Some(m) = self.meshes.iter().find(|m| m.name == *word) {
                meshes.push(m.clone());
            } else if word == "ours" || word == "peers" {
                tools.extend(self.tools.iter().filter(|t| t.ours == (word == "ours")));
            } else if let Some(&t) = self.tools.iter().find(|t| t.id == *word) {
                tools.push(t);
            } else {
                let meshes: Vec<&str> = self.meshes.iter().map(|m| m.name.as_str()).collect();
                let tools: Vec<&str> = TOOLS.iter().map(|t| t.id).collect();
                bail!(
                    "--only {word}: there is no such mesh or tool; meshes are {}; tools are {}, or all of \
                     ours or peers; ratios are written 10%",
                    meshes.join(", "),
                    tools.join(", ")
                );
            }
        }
        if !meshes.is_empty() {
            self.meshes = meshes;
        }
        if !tools.is_empty() {
            self.tools = tools;
        }
        if !ratios.is_empty() {
            self.ratios = ratios;
        }
        Ok(())
    }

    /// Each tool with each number of threads, in the order in which they take turns.
    pub(crate) fn entrants(&self, cores: usize) -> Vec<(&'static Tool, usize)> {
        let mut all = Vec::new();
        for &tool in &self.tools {
            if tool.ours {
                all.push((tool, 1));
            }
            if !tool.ours || (tool.threads && cores > 1) {
                all.push((tool, cores));
            }
        }
        all
    }
}

/// A ratio written as `10%`.
pub(crate) fn ratio(word: &str) -> Result<f64> {
    let number = word.strip_suffix('%').and_then(|w| w.trim().parse::<f64>().ok());
    match number {
        Some(n) if n > 0.0 && n <= 100.0 => Ok(n / 100.0),
        _ => bail!("{word}: a ratio is written 10%, above 0 and at most 100 %"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(quick: bool, only: &[&str]) -> Result<Plan> {
        let only = only.iter().map(|s| s.to_string()).collect();
        Plan::new(&Wanted { quick, only, ..Default::default() }, Path::new("/nowhere"))
    }

    #[test]
    fn words_keep_what_they_name() {
        let all = plan(false, &[]).unwrap();
        assert_eq!((all.ratios.len(), all.tools.len(), all.repeat), (6, TOOLS.len(), 5));
        let some = plan(true, &["cad", "meshopt", "quadric", "10%", "2.5%"]).unwrap();
        assert_eq!(some.meshes.len(), 1);
        assert_eq!(some.tools.iter().map(|t| t.id).collect::<Vec<_>>(), ["meshopt", "quadric"]);
        assert_eq!(some.ratios, [0.1, 0.025]);
        assert!(plan(true, &["peers"]).unwrap().tools.iter().all(|t| !t.ours));
        let text = plan(true, &["cow"]).unwrap_err().to_string();
        assert!(text.contains("cow") && text.contains("bunny") && text.contains("cgal-lt"), "{text}");
        assert!(plan(true, &["0%"]).is_err());
    }

    #[test]
    fn ours_run_with_one_and_with_all_threads_and_peers_once() {
        let plan = plan(true, &["quadric", "nsa", "meshopt"]).unwrap();
        let of = |cores| plan.entrants(cores).iter().map(|e| (e.0.id, e.1)).collect::<Vec<_>>();
        assert_eq!(of(4), [("quadric", 1), ("quadric", 4), ("nsa", 1), ("meshopt", 4)]);
        assert_eq!(of(1), [("quadric", 1), ("nsa", 1), ("meshopt", 1)]);
    }
}
