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
        let given: Vec<&str> =
            inputs(&command).filter(|w| !root.join(w).exists() && !folder.join(w).exists()).collect();
        let mut missing = None;
        for word in given {
            if !make(program, folder, word)? {
                missing = Some(word);
            }
        }
        if let Some(word) = missing {
            println!("  not run: {word} cannot be generated");
            continue;
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

/// A camera that sees what is generated.
const CAMERA: &str = r#"{"eye": [0, 1, 4], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 45, "width": 640, "height": 480, "near": 0.1, "far": 100}"#;

/// Generates a file that a command takes as given; false if that is not known how.
fn make(program: &Path, folder: &Path, word: &str) -> Result<bool> {
    let run = |arguments: &[&str]| -> Result<()> {
        let done = Command::new(program).current_dir(folder).args(arguments).output()?;
        ensure!(done.status.success(), "{word}: {}", String::from_utf8_lossy(&done.stderr));
        Ok(())
    };
    let extension = Path::new(word).extension().and_then(|e| e.to_str()).unwrap_or_default();
    match extension {
        "pm" => {
            let mesh = format!("{word}.ply");
            run(&["generate", "scan", &mesh, "--faces", "6000"])?;
            run(&["encode", &mesh, word, "-q"])?;
        }
        "tif" | "tiff" => run(&["generate", "terrain", word, "--size", "65"])?,
        "json" => std::fs::write(folder.join(word), CAMERA)?,
        _ if Format::from_name(word).is_some() => {
            run(&["generate", "quad-sphere", word, "--faces", "6000"])?;
        }
        _ => return Ok(false),
    }
    Ok(true)
}

/// Files that a command reads: meshes before the last one, which it writes, or all of them where it only looks; a height grid; what flags name.
fn inputs(words: &[String]) -> impl Iterator<Item = &str> {
    const FILES: [&str; 5] = ["--camera", "--frustum", "--texture", "--breaklines", "--path"];
    let named = words.windows(2).filter(|w| FILES.contains(&w[0].as_str()) && w[1].contains('.'));
    let grid = words.iter().skip(2).take(usize::from(words.first().is_some_and(|w| w == "terrain")));
    let beside: Vec<&str> = named.map(|w| w[1].as_str()).chain(grid.map(String::as_str)).collect();
    let meshes: Vec<&str> = words
        .iter()
        .map(String::as_str)
        .filter(|w| !w.starts_with('-') && Format::from_name(w).is_some())
        .collect();
    let read = match words.first().map(String::as_str) {
        Some("generate" | "terrain") => 0,
        Some("compare" | "info" | "fly") => meshes.len(),
        _ => meshes.len().min(1),
    };
    meshes.into_iter().take(read).chain(beside)
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
