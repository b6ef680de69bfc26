//! ARCHITECTURE.md's picture is what manifests and imports say, and the libraries keep to their rules.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

const LIBRARIES: [&str; 5] = ["aif", "simplify", "refine", "terrain", "meshes"];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn text(path: impl AsRef<Path>) -> String {
    let path = root().join(path);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// All Rust files below a folder.
fn sources(folder: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![root().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(path);
            }
        }
    }
    found.sort();
    assert!(!found.is_empty(), "{folder}");
    found
}

/// A file without lines that are comments.
fn code(path: &Path) -> String {
    let is_code = |line: &&str| !line.trim_start().starts_with("//");
    text(path).lines().filter(is_code).collect::<Vec<_>>().join("\n")
}

/// The packages of this workspace that a section of a manifest names.
fn named(manifest: &str, section: &str) -> BTreeSet<String> {
    let text = text(manifest);
    let inside = text.lines().skip_while(|l| l.trim() != section).skip(1);
    inside
        .take_while(|l| !l.starts_with('['))
        .filter(|l| l.starts_with("progmesh-") || l.starts_with("progmesh "))
        .map(|l| l.split(['.', ' ', '=']).next().unwrap_or_default().to_string())
        .collect()
}

fn manifest(package: &str) -> String {
    match package.strip_prefix("progmesh-") {
        Some(folder) => format!("{folder}/Cargo.toml"),
        None => "Cargo.toml".into(),
    }
}

/// The picture: package -> what it depends on.
fn picture() -> BTreeMap<String, BTreeSet<String>> {
    let text = text("ARCHITECTURE.md");
    let block = text.split("```text\n").nth(1).unwrap().split("```").next().unwrap();
    let row = |line: &str| {
        let (name, on) = line.split_once("->").unwrap();
        (name.trim().to_string(), on.split_whitespace().map(str::to_string).collect())
    };
    block.lines().map(row).collect()
}

#[test]
fn the_picture_is_what_the_manifests_say() {
    let picture = picture();
    let packages: BTreeSet<String> = LIBRARIES
        .iter()
        .chain(&["bench"])
        .map(|l| format!("progmesh-{l}"))
        .chain(["progmesh".into()])
        .collect();
    assert_eq!(picture.keys().cloned().collect::<BTreeSet<_>>(), packages);
    for (package, on) in &picture {
        assert_eq!(&named(&manifest(package), "[dependencies]"), on, "{package}");
    }
    let members: BTreeSet<String> = LIBRARIES.iter().chain(&["bench"]).map(|l| format!("\"{l}\"")).collect();
    let text = text("Cargo.toml");
    let line = text.lines().find_map(|l| l.strip_prefix("members = [")).unwrap();
    assert_eq!(line.trim_end_matches(']').split(", ").map(str::to_string).collect::<BTreeSet<_>>(), members);
}

#[test]
fn imports_are_what_the_manifests_say() {
    for (package, on) in picture() {
        let folder = package.strip_prefix("progmesh-").map_or("src".into(), |f| format!("{f}/src"));
        let mut imported = BTreeSet::new();
        for path in sources(&folder) {
            let code = code(&path);
            for part in code.split("progmesh_").skip(1) {
                let name: String = part.chars().take_while(char::is_ascii_alphanumeric).collect();
                imported.insert(format!("progmesh-{name}"));
            }
            if code.contains("use progmesh::") {
                imported.insert("progmesh".into());
            }
        }
        assert!(on.is_subset(&imported), "{package} declares {on:?}, and imports {imported:?}");
        // Unit tests may use what tests may.
        let mut allowed = named(&manifest(&package), "[dev-dependencies]");
        allowed.extend(on);
        allowed.insert(package.clone());
        assert!(imported.is_subset(&allowed), "{package} imports {imported:?} of {allowed:?}");
    }
}

#[test]
fn libraries_touch_no_files_print_nothing_and_have_no_globals() {
    let banned = [
        "std::fs",
        "std::net",
        "std::process",
        "std::env",
        "std::path",
        "stdin()",
        "stdout()",
        "stderr()",
        "println!",
        "print!",
        "eprint!",
        "static mut",
        "thread_local!",
        "LazyLock",
        "unsafe ",
    ];
    // A lock, cell or atomic of a value is its own; of the program it would be a global.
    let is_global = |line: &&str| {
        let item = line.trim_start().split("static ").collect::<Vec<_>>();
        let shared = ["Lock", "Cell", "Mutex", "Atomic"];
        item.len() > 1
            && (item[0].is_empty() || item[0].starts_with("pub"))
            && shared.iter().any(|w| line.contains(w))
    };
    for library in LIBRARIES {
        for path in sources(&format!("{library}/src")) {
            let code = code(&path);
            for word in banned {
                assert!(!code.contains(word), "{}: {word}", path.display());
            }
            assert_eq!(code.lines().find(is_global), None, "{}", path.display());
        }
    }
}

#[test]
fn only_one_module_of_the_root_library_opens_files_and_only_the_command_line_prints() {
    let cli = root().join("src/cli");
    let files = root().join("src/io/files.rs");
    for path in sources("src").iter().filter(|p| !p.starts_with(&cli)) {
        let code = code(path);
        assert_eq!(code.contains("std::fs"), *path == files, "{}: std::fs", path.display());
        for word in ["println!", "print!", "eprint!"] {
            assert!(!code.contains(word), "{}: {word}", path.display());
        }
        if *path != files {
            assert!(!code.contains("stdout()") && !code.contains("stdin()"), "{}", path.display());
        }
    }
}

#[test]
fn every_package_has_short_examples() {
    for folder in LIBRARIES.map(|l| format!("{l}/examples")).into_iter().chain(["examples".to_string()]) {
        for path in sources(&folder) {
            let lines = text(&path).lines().count();
            assert!((8..=20).contains(&lines), "{}: {lines} lines", path.display());
        }
    }
}
