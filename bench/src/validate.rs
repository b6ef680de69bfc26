//! `bench/run --validate`: makes every GLB that the documents mention and shows it to the glTF validator.
//!
//! The documents' own commands are run, in a folder of their own. Files they take as given (`scene.glb`, `bunny.obj`) are generated.

use crate::tools::Places;
use anyhow::{Context, Result, ensure};
use progmesh::io::Format;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

const DOCUMENTS: [&str; 4] = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md"];

/// True if all files are valid. `program`: progmesh.
pub(crate) fn validate(places: &Places, program: &Path, folder: &Path) -> Result<bool> {
    let root = places.bench.join("..").canonicalize()?;
    let mut text = String::new();
    let mut documents: Vec<PathBuf> = DOCUMENTS.iter().map(|d| root.join(d)).collect();
    for entry in std::fs::read_dir(root.join("docs"))? {
        documents.extend(Some(entry?.path()).filter(|p| p.extension().is_some_and(|e| e == "md")));
    }
    for path in &documents {
        text += &std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        text.push('\n');
    }
    if folder.exists() {
        std::fs::remove_dir_all(folder)?;
    }
    std::fs::create_dir_all(folder.join("docs"))?;
    for command in commands(&text) {
        println!("$ progmesh {}", command.join(" "));
        let words: Vec<String> = command.iter().map(|w| placed(w, &root)).collect();
        for word in inputs(&command).filter(|w| !root.join(w).exists() && !folder.join(w).exists()) {
            let done = Command::new(program)
                .current_dir(folder)
                .args(["generate", "quad-sphere", word, "--faces", "6000"])
                .output()?;
            ensure!(done.status.success(), "{word}: {}", String::from_utf8_lossy(&done.stderr));
        }
        let done = Command::new(program).current_dir(folder).args(&words).output()?;
        // 1: done, but short of a target.
        ensure!(
            matches!(done.status.code(), Some(0 | 1)),
            "progmesh {}: {}",
            command.join(" "),
            String::from_utf8_lossy(&done.stderr)
        );
    }
    let mut files: Vec<PathBuf> = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        files.extend(Some(entry?.path()).filter(|p| p.extension().is_some_and(|e| e == "glb")));
    }
    files.sort();
    ensure!(!files.is_empty(), "the documents make no GLB");
    for name in mentioned(&text) {
        if !files.iter().any(|f| f.file_name().is_some_and(|n| n.to_string_lossy() == name)) {
            println!("{name}: mentioned, and made by no command");
        }
    }
    let done = Command::new("node")
        .arg(places.bench.join("peers/validate.cjs"))
        .arg(places.env.join("node_modules"))
        .args(&files)
        .status()
        .context("node")?;
    Ok(done.success())
}

/// The words after `progmesh` of every command in the text that names a GLB.
fn commands(text: &str) -> Vec<Vec<String>> {
    let mut all: Vec<Vec<String>> = Vec::new();
    for line in text.lines() {
        let line = line.trim().trim_start_matches("$ ").trim_matches('`');
        let starts = ["cargo run --release -- ", "progmesh "];
        let Some(rest) = starts.iter().find_map(|s| line.strip_prefix(s)) else { continue };
        let rest = rest.split_once(" #").map_or(rest, |r| r.0);
        let words: Vec<String> =
            rest.split_whitespace().map(|w| w.trim_matches(['\'', '"']).to_string()).collect();
        let plain = !rest.contains(['|', '<', '>', '[', ']', '…']) && !rest.contains("...");
        if plain && words.iter().any(|w| w.ends_with(".glb")) && !all.contains(&words) {
            all.push(words);
        }
    }
    all
}

/// Files that a command reads: meshes before the last one, which it writes; all of them where it only looks.
fn inputs(words: &[String]) -> impl Iterator<Item = &str> {
    let meshes: Vec<&str> = words
        .iter()
        .map(String::as_str)
        .filter(|w| !w.starts_with('-') && Format::from_name(w).is_some())
        .collect();
    let read = match words.first().map(String::as_str) {
        Some("generate") => 0,
        Some("simplify" | "convert") => meshes.len().min(1),
        _ => meshes.len(),
    };
    meshes.into_iter().take(read)
}

/// A file of the repository by its place; everything else as it is.
fn placed(word: &str, root: &Path) -> String {
    let file = root.join(word);
    if word.contains('/') && !word.starts_with("docs/") && file.is_file() {
        return file.to_string_lossy().into_owned();
    }
    word.to_string()
}

/// Names of GLB files in a text.
fn mentioned(text: &str) -> BTreeSet<String> {
    let inside = |c: char| c.is_ascii_alphanumeric() || "-_./".contains(c);
    let words = text.split(|c| !inside(c)).filter(|w| w.ends_with(".glb") && w.len() > 4);
    words.filter_map(|w| w.rsplit('/').next()).map(str::to_string).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "Take `a/x.glb`.\n```sh\ncargo run --release -- simplify meshes/in.ply out.glb --ratio 0.1\n\
                        progmesh simplify in.glb out.obj\n$ progmesh info in.glb   # looks\nprogmesh generate torus t.ply\n\
                        progmesh generate scan - | progmesh convert - y.glb\n```\n";

    #[test]
    fn commands_with_glb_files_are_found() {
        let found = commands(TEXT);
        let words: Vec<String> = found.iter().map(|c| c.join(" ")).collect();
        assert_eq!(
            words,
            ["simplify meshes/in.ply out.glb --ratio 0.1", "simplify in.glb out.obj", "info in.glb"]
        );
        let read: Vec<Vec<&str>> = found.iter().map(|c| inputs(c).collect()).collect();
        assert_eq!(read, [["meshes/in.ply"], ["in.glb"], ["in.glb"]]);
        assert_eq!(mentioned(TEXT).into_iter().collect::<Vec<_>>(), ["in.glb", "out.glb", "x.glb", "y.glb"]);
    }

    #[test]
    fn the_readme_has_commands_that_make_glb_files() {
        let readme =
            std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../README.md")).unwrap();
        assert!(commands(&readme).len() >= 3);
    }
}
