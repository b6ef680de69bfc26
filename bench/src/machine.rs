//! What the figures were made on.

use crate::tools::output;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The machine and the compilers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Machine {
    pub(crate) cpu: String,
    /// Cores this program may use.
    pub(crate) cores: usize,
    pub(crate) memory_bytes: Option<u64>,
    pub(crate) system: String,
    pub(crate) rustc: String,
    pub(crate) cxx: String,
    pub(crate) python: String,
    /// Load over the last minute when the run began: above 0.5, others were using the cores.
    pub(crate) load: Option<f64>,
}

impl Machine {
    /// This one.
    pub(crate) fn here(python: &Path) -> Machine {
        let file = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
        let says = |program: &str| {
            let text = output(Path::new(program), &["--version"]).unwrap_or_default();
            text.lines().next().unwrap_or_default().to_string()
        };
        let system =
            field(&file("/etc/os-release"), "PRETTY_NAME", '=').unwrap_or(std::env::consts::OS.into());
        let kernel = file("/proc/sys/kernel/osrelease");
        let memory = field(&file("/proc/meminfo"), "MemTotal", ':');
        Machine {
            cpu: field(&file("/proc/cpuinfo"), "model name", ':').unwrap_or(std::env::consts::ARCH.into()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            memory_bytes: memory.and_then(|m| Some(1024 * m.split(' ').next()?.parse::<u64>().ok()?)),
            system: format!("{system}, {} {}", std::env::consts::OS, kernel.trim()).trim().to_string(),
            rustc: says("rustc"),
            cxx: says("c++"),
            python: output(python, &["--version"]).unwrap_or_default(),
            load: file("/proc/loadavg").split(' ').next().and_then(|l| l.parse().ok()),
        }
    }

    /// In words, one fact an entry.
    pub(crate) fn words(&self) -> Vec<(&'static str, String)> {
        let mut words = vec![("processor", self.cpu.clone()), ("cores", self.cores.to_string())];
        words.extend(
            self.memory_bytes.map(|m| ("memory", format!("{:.1} GiB", m as f64 / (1u64 << 30) as f64))),
        );
        words.extend([
            ("system", self.system.clone()),
            ("Rust", self.rustc.clone()),
            ("C++", self.cxx.clone()),
        ]);
        words.push(("Python", self.python.clone()));
        words.extend(self.load.map(|l| ("load before the run", format!("{l:.2}"))));
        words.retain(|w| !w.1.is_empty());
        words
    }
}

/// The value of the first line `key SEPARATOR value`, without quotation marks.
fn field(text: &str, key: &str, separator: char) -> Option<String> {
    let mut pairs = text.lines().filter_map(|l| l.split_once(separator));
    let value = pairs.find(|(k, _)| k.trim() == key)?.1;
    Some(value.trim().trim_matches('"').to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_found() {
        let text = "processor\t: 0\nmodel name\t: Some CPU @ 2: GHz\nmodel name\t: other\n";
        assert_eq!(field(text, "model name", ':').as_deref(), Some("Some CPU @ 2: GHz"));
        assert_eq!(field("A=1\nPRETTY_NAME=\"An OS 1\"", "PRETTY_NAME", '=').as_deref(), Some("An OS 1"));
        assert_eq!(field(text, "none", ':'), None);
    }

    #[test]
    fn this_machine_has_cores_and_words() {
        let here = Machine::here(Path::new("/nowhere/python"));
        assert!(here.cores >= 1 && here.words().iter().any(|w| w.0 == "processor"));
        assert!(here.words().iter().all(|w| w.0 != "Python"));
    }
}
