//! What subcommands share: messages, reading and writing with them, threads, numbers for people.

use super::Failure;
use super::args::FormatName;
use super::control::Interrupt;
use progmesh::io::files::{self, Loaded, ReadError, WriteError};
use progmesh::io::{DecodeError, EncodeOptions, Encoded, Format, encode, pm};
pub(crate) use progmesh::pipeline::thousands;
use progmesh::progressive::ProgressiveScene;
use progmesh::refine::format::FormatError;
pub(crate) use progmesh::report::short;
use progmesh::scene::Scene;
use serde::Serialize;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io::Write;
use std::path::Path;

/// Warnings: each printed once, when it comes, and kept for `--json`.
#[derive(Debug, Default)]
pub(crate) struct Warnings {
    quiet: bool,
    said: BTreeSet<String>,
    pub(crate) all: Vec<String>,
}

impl Warnings {
    pub(crate) fn new(quiet: bool) -> Self {
        Warnings { quiet, ..Default::default() }
    }

    pub(crate) fn say(&mut self, warnings: impl IntoIterator<Item = String>) {
        for w in warnings {
            if self.said.insert(w.clone()) {
                if !self.quiet {
                    note(&format!("warning: {w}"));
                }
                self.all.push(w);
            }
        }
    }
}

/// One line on standard error. That nobody may be listening there is no failure.
pub(crate) fn note(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{}", harmless(line));
}

/// Text in which names from a file may stand, without characters that a terminal would obey.
pub(crate) fn harmless(text: &str) -> Cow<'_, str> {
    let obeyed = |c: char| c.is_control() && c != '\n';
    if text.contains(obeyed) { text.replace(obeyed, "\u{fffd}").into() } else { text.into() }
}

/// An error, in the form that clap gives its own.
pub(crate) fn print_error(message: &str) {
    // That nobody may be listening there is no failure.
    let _ = clap::Error::raw(clap::error::ErrorKind::Io, format!("{}\n", harmless(message))).print();
}

/// Prints to standard output.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|e| match e.kind() {
        std::io::ErrorKind::BrokenPipe => Failure::BrokenPipe,
        _ => Failure::Output(format!("standard output: {e}")),
    })
}

/// Prints one JSON object to standard output.
pub(crate) fn print_json(object: &impl Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(object).map_err(|e| Failure::Output(e.to_string()))?;
    print(&(text + "\n"))
}

/// A file's name for messages.
pub(crate) fn name(path: &Path, dash: &str) -> String {
    if files::is_dash(path) { dash.to_string() } else { path.display().to_string() }
}

/// A path could say its format, a stream cannot.
pub(crate) fn or_by_name(path: &Path) -> &'static str {
    if files::is_dash(path) { "" } else { ", or by the ending of its name" }
}

/// Reads the input.
pub(crate) fn read(
    path: &Path,
    from: Option<FormatName>,
    warnings: &mut Warnings,
) -> Result<Loaded, Failure> {
    let file = name(path, "standard input");
    let mut loaded = files::read(path, from.map(Format::from)).map_err(|e| match e {
        ReadError::UnknownFormat => Failure::Usage(format!(
            "{file}: say its format with --from obj|gltf|glb|ply|stl|off|pm{}",
            or_by_name(path)
        )),
        ReadError::Mistaken { like, .. } => {
            Failure::Input(format!("{file}: {e}: try --from {}", like.extension()))
        }
        e => Failure::Input(format!("{file}: {e}")),
    })?;
    warnings.say(std::mem::take(&mut loaded.decoded.warnings).into_iter().map(|w| format!("{file}: {w}")));
    Ok(loaded)
}

/// Reads a progressive mesh file; with `salvage`, of a damaged one all that is whole.
pub(crate) fn read_progressive(
    path: &Path,
    salvage: bool,
    warnings: &mut Warnings,
) -> Result<ProgressiveScene, Failure> {
    let file = name(path, "standard input");
    let bytes = files::read_all(path).map_err(|e| Failure::Input(format!("{file}: {e}")))?;
    let read = if salvage { pm::decode_what_is_there(&bytes) } else { pm::decode_progressive(&bytes) };
    let read = read.map_err(|e| {
        let advice = match &e {
            DecodeError::Progressive(FormatError::Chunk { .. }) if !salvage => {
                "; --salvage of `decode` uses all that is whole"
            }
            DecodeError::Progressive(FormatError::NotAProgressiveMesh) => {
                "; `progmesh encode` makes one of a mesh, `progmesh convert` writes a mesh in another format"
            }
            _ => "",
        };
        Failure::Input(format!("{file}: {e}{advice}"))
    })?;
    warnings.say(read.warnings.into_iter().map(|w| format!("{file}: {w}")));
    Ok(read.scene)
}

/// Writes bytes to a path, all or nothing, or to standard output.
pub(crate) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    if files::is_dash(path) {
        let mut out = std::io::stdout().lock();
        return out.write_all(bytes).and_then(|()| out.flush()).map_err(|e| match e.kind() {
            std::io::ErrorKind::BrokenPipe => Failure::BrokenPipe,
            _ => Failure::Output(format!("standard output: {e}")),
        });
    }
    files::write_file(path, bytes).map_err(|e| Failure::Output(format!("{}: {e}", path.display())))
}

/// Fails where a file of this name could not be written: no directory for it, or a directory in its place.
pub(crate) fn check_target(path: &Path) -> Result<(), Failure> {
    files::check_target(path).map_err(|e| Failure::Output(format!("{}: {e}", path.display())))
}

/// Encodes and writes the output.
pub(crate) fn write(
    path: &Path,
    format: Format,
    options: &EncodeOptions,
    scene: &Scene,
    interrupt: &Interrupt,
    warnings: &mut Warnings,
) -> Result<(), Failure> {
    let file = name(path, "standard output");
    let encoded = encode(format, scene, options).map_err(|e| Failure::Output(format!("{file}: {e}")))?;
    write_encoded(path, format, &encoded, interrupt, warnings)
}

/// Writes what was encoded.
pub(crate) fn write_encoded(
    path: &Path,
    format: Format,
    encoded: &Encoded,
    interrupt: &Interrupt,
    warnings: &mut Warnings,
) -> Result<(), Failure> {
    let file = name(path, "standard output");
    warnings.say(encoded.warnings.iter().map(|w| format!("{file}: {w}")));
    let said = files::write(path, format, encoded, &|| interrupt.is_set()).map_err(|e| match e {
        WriteError::Cancelled => Failure::Interrupted,
        e if e.is_broken_pipe() => Failure::BrokenPipe,
        // It names the file already.
        e @ WriteError::Io { .. } => Failure::Output(e.to_string()),
        e => Failure::Output(format!("{file}: {e}")),
    })?;
    warnings.say(said.into_iter().map(|w| format!("{file}: {w}")));
    Ok(())
}

/// Runs `work` in a pool of its own of `threads` threads, or in that of all: from outside of a pool every small task would wait for a thread to wake, and for its own to be woken. A flight's frames take two thirds of the time inside.
pub(crate) fn in_pool<R: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<R, Failure> + Send,
) -> Result<R, Failure> {
    let Some(n) = threads else { return rayon::scope(|_| work()) };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(n)
        .build()
        .map_err(|e| Failure::Usage(format!("--threads {n}: {e}")))?;
    pool.install(work)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_replaced() {
        assert_eq!(harmless("a\u{1b}[2Jb\nc\r"), "a\u{fffd}[2Jb\nc\u{fffd}");
        assert!(matches!(harmless("plain ü\n"), Cow::Borrowed(_)));
    }

    #[test]
    fn a_warning_is_said_once() {
        let mut w = Warnings::new(true);
        w.say(["a".to_string(), "b".to_string(), "a".to_string()]);
        w.say(["b".to_string()]);
        assert_eq!(w.all, ["a", "b"]);
    }
}
