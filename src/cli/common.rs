//! What subcommands share: formats, reading and writing with messages, threads, numbers for people.

use super::Failure;
use super::control::Interrupt;
use clap::ValueEnum;
use progmesh::aif::Weld;
use progmesh::io::files::{self, Loaded, ReadError, WriteError};
use progmesh::io::{Format, encode};
use progmesh::normals::{DEFAULT_CREASE, Normals};
use progmesh::report::{Picture, Style, Surface, SurfaceError, View, render};
use progmesh::scene::Scene;
use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A format, as flags name it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatName {
    Obj,
    Gltf,
    Glb,
    Ply,
    Stl,
    Off,
}

impl From<FormatName> for Format {
    fn from(f: FormatName) -> Self {
        match f {
            FormatName::Obj => Format::Obj,
            FormatName::Gltf => Format::Gltf,
            FormatName::Glb => Format::Glb,
            FormatName::Ply => Format::Ply,
            FormatName::Stl => Format::Stl,
            FormatName::Off => Format::Off,
        }
    }
}

/// `--weld`, `--normals`, `--crease`: what may be done to a mesh on the way.
#[derive(clap::Args, Debug)]
pub(crate) struct Shape {
    /// Make one vertex of those at the same place, or within EPS model units of each other
    ///
    /// STL is welded anyway, and glTF where positions are equal to the bit: these formats cut a mesh at every face, or every seam.
    #[arg(long, value_name = "EPS", num_args = 0..=1, require_equals = true, default_missing_value = "0",
          value_parser = not_negative)]
    weld: Option<f64>,

    /// Keep the normals of the input, compute them anew, or write none
    #[arg(long, value_enum, default_value_t = NormalsName::Keep)]
    normals: NormalsName,

    /// With `--normals recompute`: faces that meet at more than this many degrees do not share a normal [default: 60]
    #[arg(long, value_name = "DEG", value_parser = degrees)]
    crease: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum NormalsName {
    Keep,
    Recompute,
    None,
}

impl Shape {
    pub(crate) fn weld(&self) -> Weld {
        weld_rule(self.weld)
    }

    pub(crate) fn normals(&self) -> Result<Normals, Failure> {
        if self.crease.is_some() && self.normals != NormalsName::Recompute {
            return Err(Failure::Usage("--crease is for --normals recompute".into()));
        }
        Ok(match self.normals {
            NormalsName::Keep => Normals::Keep,
            NormalsName::Recompute => Normals::Recompute { crease: self.crease.unwrap_or(DEFAULT_CREASE) },
            NormalsName::None => Normals::Remove,
        })
    }
}

/// `--png`, `--wireframe`: a picture.
#[derive(clap::Args, Debug)]
pub(crate) struct PictureArgs {
    /// Draw a picture to this PNG file (with simplify: input and result side by side, from the same camera)
    ///
    /// Material base colours and the mesh's normals; no textures.
    #[arg(long, value_name = "FILE.png", help_heading = "Picture")]
    png: Option<PathBuf>,
    /// With --png: draw the edges of the faces too
    #[arg(long, requires = "png", help_heading = "Picture")]
    wireframe: bool,
}

/// Sides of each picture, pixels.
const PICTURE: (u32, u32) = (480, 400);
const WHITE: [u8; 3] = [255; 3];

/// Pictures under way: all from the camera of the first.
pub(crate) struct Drawing {
    path: PathBuf,
    style: Style,
    view: Option<View>,
    pictures: Vec<Picture>,
}

impl PictureArgs {
    /// A drawing if one is asked for.
    pub(crate) fn drawing(&self) -> Result<Option<Drawing>, Failure> {
        let Some(path) = self.png.clone() else { return Ok(None) };
        if files::is_dash(&path) {
            return Err(Failure::Usage("--png: write the picture to a path, not to standard output".into()));
        }
        let mut style = Style::default();
        style.wireframe = self.wireframe;
        Ok(Some(Drawing { path, style, view: None, pictures: vec![] }))
    }
}

impl Drawing {
    /// Draws a scene, to the right of those before.
    pub(crate) fn add(&mut self, scene: &Scene) -> Result<(), SurfaceError> {
        let surface = Surface::of(scene)?;
        let (width, height) = PICTURE;
        let first = || View::three_quarter(surface.bounds(), width, height).tightened(&surface);
        let view = self.view.get_or_insert_with(first);
        let mut picture = render(&surface, view, &self.style);
        let n = surface.triangle_count();
        picture.caption(&format!("{} triangle{}", thousands(n), if n == 1 { "" } else { "s" }), [64; 3]);
        self.pictures.push(picture);
        Ok(())
    }

    /// Writes the file, all or nothing.
    pub(crate) fn write(&self) -> Result<(), Failure> {
        let failed = |why: String| Failure::Output(format!("{}: {why}", self.path.display()));
        let bytes = Picture::beside(&self.pictures, WHITE).png();
        let bytes = bytes.ok_or_else(|| failed("the picture could not be encoded".into()))?;
        files::write_file(&self.path, &bytes).map_err(|e| failed(e.to_string()))
    }
}

/// What `--weld`, `--weld=0` and `--weld=EPS` mean.
pub(crate) fn weld_rule(flag: Option<f64>) -> Weld {
    match flag {
        None => Weld::No,
        Some(0.0) => Weld::BitEqual,
        Some(distance) => Weld::Within(distance),
    }
}

/// A finite number, 0 or more.
pub(crate) fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x >= 0.0 && x.is_finite() => Ok(x),
        _ => Err("must be a number, 0 or more".into()),
    }
}

/// 0 to 1.
pub(crate) fn fraction(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (0.0..=1.0).contains(&x) => Ok(x),
        _ => Err("must be a number from 0 to 1".into()),
    }
}

/// 0 to 180.
pub(crate) fn degrees(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (0.0..=180.0).contains(&x) => Ok(x),
        _ => Err("must be a number of degrees from 0 to 180".into()),
    }
}

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
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

pub(crate) fn print_error(message: &str) {
    note(&format!("progmesh: {message}"));
}

/// Prints to standard output.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|e| match e.kind() {
        std::io::ErrorKind::BrokenPipe => Failure::BrokenPipe,
        _ => Failure::Output(format!("standard output: {e}")),
    })
}

/// A file's name for messages.
pub(crate) fn name(path: &Path, dash: &str) -> String {
    if files::is_dash(path) { dash.to_string() } else { path.display().to_string() }
}

/// Reads the input.
pub(crate) fn read(
    path: &Path,
    from: Option<FormatName>,
    warnings: &mut Warnings,
) -> Result<Loaded, Failure> {
    let file = name(path, "standard input");
    let mut loaded = files::read(path, from.map(Format::from)).map_err(|e| match e {
        ReadError::UnknownFormat => {
            Failure::Usage(format!("{file}: say its format with --from obj|gltf|glb|ply|stl|off"))
        }
        e => Failure::Input(format!("{file}: {e}")),
    })?;
    warnings.say(std::mem::take(&mut loaded.decoded.warnings).into_iter().map(|w| format!("{file}: {w}")));
    Ok(loaded)
}

/// The format to write.
pub(crate) fn output_format(path: &Path, to: Option<FormatName>) -> Result<Format, Failure> {
    to.map(Format::from).or_else(|| Format::from_name(&path.to_string_lossy())).ok_or_else(|| {
        let file = name(path, "standard output");
        Failure::Usage(format!("{file}: say its format with --to obj|gltf|glb|ply|stl|off"))
    })
}

/// Encodes and writes the output.
pub(crate) fn write(
    path: &Path,
    format: Format,
    text: bool,
    scene: &Scene,
    interrupt: &Interrupt,
    warnings: &mut Warnings,
) -> Result<(), Failure> {
    let file = name(path, "standard output");
    let encoded = encode(format, scene, &files::encode_options(path, text))
        .map_err(|e| Failure::Output(format!("{file}: {e}")))?;
    warnings.say(encoded.warnings.iter().map(|w| format!("{file}: {w}")));
    let said = files::write(path, format, &encoded, &|| interrupt.is_set()).map_err(|e| match e {
        WriteError::Cancelled => Failure::Interrupted,
        e if e.is_broken_pipe() => Failure::BrokenPipe,
        // It names the file already.
        e @ WriteError::Io { .. } => Failure::Output(e.to_string()),
        e => Failure::Output(format!("{file}: {e}")),
    })?;
    warnings.say(said.into_iter().map(|w| format!("{file}: {w}")));
    Ok(())
}

/// Runs `work` in a pool of its own of `threads` threads, or where it is.
pub(crate) fn in_pool<R: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<R, Failure> + Send,
) -> Result<R, Failure> {
    let Some(n) = threads else { return work() };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(n)
        .build()
        .map_err(|e| Failure::Usage(format!("--threads {n}: {e}")))?;
    pool.install(work)
}

/// 1234567 as `1,234,567`.
pub(crate) fn thousands(n: usize) -> String {
    let digits = n.to_string();
    let mut out = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, d) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(d);
    }
    out
}

/// A length or the like, in four digits.
pub(crate) fn short(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        a if (1e-3..1e5).contains(&a) => {
            let digits = (3 - a.log10().floor() as i32).max(0) as usize;
            let text = format!("{x:.digits$}");
            if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
        }
        _ => format!("{x:.3e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped_and_short() {
        assert_eq!([0, 999, 1000, 1234567].map(thousands), ["0", "999", "1,000", "1,234,567"]);
        assert_eq!([0.0, 1.0, 0.12345, 1234.56, 1e-9].map(short), ["0", "1", "0.1235", "1235", "1.000e-9"]);
    }

    #[test]
    fn a_warning_is_said_once() {
        let mut w = Warnings::new(true);
        w.say(["a".to_string(), "b".to_string(), "a".to_string()]);
        w.say(["b".to_string()]);
        assert_eq!(w.all, ["a", "b"]);
    }

    #[test]
    fn values_out_of_range_are_refused() {
        assert!(fraction("1.01").is_err() && fraction("nan").is_err() && fraction("0.5") == Ok(0.5));
        assert!(not_negative("-1").is_err() && not_negative("inf").is_err());
        assert!(degrees("181").is_err() && degrees("12") == Ok(12.0));
    }
}
