//! What the end-to-end tests share: the binary, a directory, files in it.
#![allow(dead_code, unreachable_pub)] // every test file uses its own part

use assert_cmd::Command;
use std::path::{Path, PathBuf};
use std::process::Output;
use tempfile::TempDir;

/// A directory that goes away with the test, and the binary run in it.
pub struct Place {
    directory: TempDir,
}

/// What a run came to.
pub struct Run {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Place {
    pub fn new() -> Self {
        Place { directory: tempfile::tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, content).unwrap();
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn text(&self, name: &str) -> String {
        String::from_utf8(self.read(name)).unwrap()
    }

    pub fn exists(&self, name: &str) -> bool {
        self.path(name).exists()
    }

    /// Names of all files in the directory, sorted.
    pub fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(self.directory.path())
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    pub fn directory(&self) -> &Path {
        self.directory.path()
    }

    pub fn command(&self) -> Command {
        let mut c = Command::new(env!("CARGO_BIN_EXE_progmesh"));
        c.current_dir(self.directory.path());
        c
    }

    /// Runs `progmesh` with these arguments, separated by spaces.
    pub fn run(&self, arguments: &str) -> Run {
        let out = self.command().args(arguments.split_whitespace()).timeout(limit()).output().unwrap();
        Run::of(out)
    }

    /// The same, with this standard input.
    pub fn run_with(&self, arguments: &str, input: impl Into<Vec<u8>>) -> Run {
        let arguments = arguments.split_whitespace();
        Run::of(self.command().args(arguments).write_stdin(input).timeout(limit()).output().unwrap())
    }

    /// Runs, and demands exit code 0.
    pub fn done(&self, arguments: &str) -> Run {
        let run = self.run(arguments);
        assert_eq!(run.code, 0, "{arguments}: {}", run.stderr);
        run
    }

    /// Generates a sample mesh.
    pub fn generate(&self, name: &str, file: &str, faces: usize) {
        self.done(&format!("generate {name} {file} --faces {faces} -q"));
    }

    /// `info --json` of a file.
    pub fn info(&self, file: &str) -> serde_json::Value {
        self.done(&format!("info {file} --json -q")).json()
    }

    /// `simplify --json` with exit code 0.
    pub fn simplify(&self, arguments: &str) -> serde_json::Value {
        self.done(&format!("simplify {arguments} --json")).json()
    }
}

/// No run of these tests takes nearly as long, however busy the machine: what does, hangs.
fn limit() -> std::time::Duration {
    std::time::Duration::from_secs(600)
}

impl Run {
    fn of(out: Output) -> Self {
        Run {
            code: out.status.code().unwrap_or(-1),
            stdout: String::from_utf8_lossy(&out.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&out.stderr).into_owned(),
        }
    }

    /// Standard output, which must be exactly one JSON value.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|e| panic!("{e}: {}{}", self.stdout, self.stderr))
    }

    /// Demands this exit code and this text on standard error.
    pub fn failed(&self, code: i32, text: &str) {
        assert_eq!(self.code, code, "{}", self.stderr);
        assert!(self.stderr.contains(text), "no {text:?} in: {}", self.stderr);
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
    }
}
