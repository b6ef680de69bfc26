//! What is compared: our methods and the peers.

use std::path::{Path, PathBuf};
use std::process::Command;

/// How a tool is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Host {
    /// This program, in a process of its own.
    Rust,
    /// `peers/simplify.py`.
    Python,
    /// `peers/cgal.cpp`.
    Cgal,
}

/// A method of ours, or a peer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tool {
    pub(crate) id: &'static str,
    /// For people.
    pub(crate) name: &'static str,
    pub(crate) ours: bool,
    pub(crate) host: Host,
    /// True if the number of threads makes a difference. The others are run once, free to use all cores.
    pub(crate) threads: bool,
    /// The package whose version is reported.
    package: &'static str,
}

const fn ours(id: &'static str, name: &'static str, threads: bool) -> Tool {
    Tool { id, name, ours: true, host: Host::Rust, threads, package: "progmesh" }
}

const fn peer(id: &'static str, name: &'static str, host: Host, package: &'static str) -> Tool {
    Tool { id, name, ours: false, host, threads: false, package }
}

/// All of them: ours first, the default method before the others.
pub(crate) const TOOLS: [Tool; 12] = [
    ours("quadric", "progmesh quadric", true),
    ours("quadric-exact", "progmesh quadric, exact schedule", true),
    ours("quadric-endpoint", "progmesh quadric, endpoint placement", true),
    ours("nsa", "progmesh nsa", false),
    ours("cluster", "progmesh cluster", false),
    peer("meshopt", "meshoptimizer", Host::Rust, "meshopt"),
    peer("meshopt-update", "meshoptimizer, moving vertices", Host::Rust, "meshopt"),
    peer("fast-simplification", "fast-simplification", Host::Python, "fast-simplification"),
    peer("pyfqmr", "pyfqmr", Host::Python, "pyfqmr"),
    peer("meshlab", "MeshLab quadric", Host::Python, "pymeshlab"),
    peer("cgal-lt", "CGAL Lindstrom-Turk", Host::Cgal, "CGAL"),
    peer("cgal-gh", "CGAL Garland-Heckbert", Host::Cgal, "CGAL"),
];

/// The tool of this id.
pub(crate) fn find(id: &str) -> Option<&'static Tool> {
    TOOLS.iter().find(|t| t.id == id)
}

/// Where the peers are, as `bench/run` installs them.
#[derive(Clone, Debug)]
pub(crate) struct Places {
    /// `bench/.env`.
    pub(crate) env: PathBuf,
    /// `bench/`.
    pub(crate) bench: PathBuf,
}

impl Places {
    pub(crate) fn python(&self) -> PathBuf {
        self.env.join("venv/bin/python")
    }

    pub(crate) fn cgal(&self) -> PathBuf {
        self.env.join("peer-cgal")
    }

    /// The version of a tool, or why it cannot be run.
    pub(crate) fn version(&self, tool: &Tool) -> Result<String, String> {
        // What bench/run could not install left a word here.
        let why = |thing: &str, default: &str| {
            let note = std::fs::read_to_string(self.env.join(format!("missing-{thing}.txt")));
            note.map_or(default.to_string(), |n| n.trim().to_string())
        };
        match tool.host {
            Host::Rust if tool.ours => Ok(env!("CARGO_PKG_VERSION").to_string()),
            Host::Rust => {
                let lock = std::fs::read_to_string(self.bench.join("../Cargo.lock")).unwrap_or_default();
                locked(&lock, tool.package).ok_or_else(|| "not in Cargo.lock".to_string())
            }
            Host::Python => {
                let code = "import sys, importlib.metadata as m; print(m.version(sys.argv[1]))";
                output(&self.python(), &["-c", code, tool.package])
                    .ok_or_else(|| why(tool.package, "pip could not install it"))
            }
            Host::Cgal => output(&self.cgal(), &["--version"])
                .ok_or_else(|| why("cgal", "bench/peers/cgal.cpp was not compiled")),
        }
    }
}

/// What a program says, without white space at its ends; `None` if it fails.
pub(crate) fn output(program: &Path, arguments: &[&str]) -> Option<String> {
    let out = Command::new(program).args(arguments).output().ok()?;
    out.status.success().then(|| String::from_utf8_lossy(&out.stdout).trim().to_string())
}

/// The version of a package in a lock file of Cargo.
fn locked(lock: &str, package: &str) -> Option<String> {
    let mut lines = lock.lines().skip_while(|l| *l != format!("name = \"{package}\""));
    let line = lines.nth(1)?;
    Some(line.strip_prefix("version = \"")?.strip_suffix('"')?.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_unique_and_found() {
        for t in &TOOLS {
            assert_eq!(find(t.id).map(|f| f.name), Some(t.name));
            assert_eq!(TOOLS.iter().filter(|o| o.id == t.id).count(), 1, "{}", t.id);
        }
        assert!(find("no such tool").is_none());
    }

    #[test]
    fn the_version_is_that_of_the_lock_file() {
        let places = Places { env: "/nowhere".into(), bench: env!("CARGO_MANIFEST_DIR").into() };
        assert!(places.version(find("meshopt").unwrap()).unwrap().starts_with("0."));
        let lock =
            "[[package]]\nname = \"a\"\nversion = \"1.2.3\"\n\n[[package]]\nname = \"ab\"\nversion = \"4\"\n";
        assert_eq!(locked(lock, "a").as_deref(), Some("1.2.3"));
        assert_eq!(locked(lock, "b"), None);
    }

    #[test]
    fn a_peer_that_is_not_there_says_so() {
        let env = tempfile::tempdir().unwrap();
        let places = Places { env: env.path().into(), bench: env.path().into() };
        assert!(places.version(find("cgal-lt").unwrap()).unwrap_err().contains("not compiled"));
        std::fs::write(env.path().join("missing-cgal.txt"), "no root\n").unwrap();
        assert_eq!(places.version(find("cgal-lt").unwrap()).unwrap_err(), "no root");
        assert!(places.version(find("meshlab").unwrap()).is_err());
    }
}
