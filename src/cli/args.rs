//! Flags that several subcommands have, and the values they take.

use super::Failure;
use super::common::{self, Warnings};
use super::control::Interrupt;
use clap::ValueEnum;
use progmesh::aif::Weld;
use progmesh::io::files::{self, Loaded};
use progmesh::io::{EncodeOptions, Format};
use progmesh::normals::{DEFAULT_CREASE, Normals};
use progmesh::progressive::ProgressiveScene;
use progmesh::scene::Scene;
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
    Pm,
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
            FormatName::Pm => Format::Pm,
        }
    }
}

/// `IN` and `--from`.
#[derive(clap::Args, Debug)]
pub(crate) struct Input {
    /// The mesh to read; - for standard input, with --from
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// Format of IN, instead of what its name says
    #[arg(long, value_enum, value_name = "FORMAT")]
    from: Option<FormatName>,
}

impl Input {
    /// Its name, for messages.
    pub(crate) fn name(&self) -> String {
        common::name(&self.input, "standard input")
    }

    /// Its path, if it is to be read as a progressive mesh.
    pub(crate) fn progressive_path(&self) -> Option<&Path> {
        let named = || Format::from_name(&self.input.to_string_lossy());
        (self.from.map(Format::from).or_else(named) == Some(Format::Pm)).then_some(&*self.input)
    }

    pub(crate) fn read(&self, warnings: &mut Warnings) -> Result<Loaded, Failure> {
        common::read(&self.input, self.from, warnings)
    }

    /// Progressive meshes: those of a progressive mesh file, or of any other what `make` makes of its scene.
    pub(crate) fn read_or_make(
        &self,
        warnings: &mut Warnings,
        make: impl FnOnce(Scene, &mut Warnings) -> Result<ProgressiveScene, Failure>,
    ) -> Result<ProgressiveScene, Failure> {
        if let Some(path) = self.progressive_path() {
            return common::read_progressive(path, false, warnings);
        }
        make(self.read(warnings)?.decoded.scene, warnings)
    }
}

/// `IN.pm`.
#[derive(clap::Args, Debug)]
pub(crate) struct ProgressiveInput {
    /// The progressive mesh to read, ours or Hoppe's; - for standard input
    #[arg(value_name = "IN.pm")]
    input: PathBuf,
}

impl ProgressiveInput {
    /// Its name, for messages.
    pub(crate) fn name(&self) -> String {
        common::name(&self.input, "standard input")
    }

    /// Reads it; with `salvage`, of a damaged file all that is whole.
    pub(crate) fn read(&self, salvage: bool, warnings: &mut Warnings) -> Result<ProgressiveScene, Failure> {
        common::read_progressive(&self.input, salvage, warnings)
    }
}

/// `OUT`, `--to` and `--text`.
#[derive(clap::Args, Debug)]
pub(crate) struct Output {
    /// The file to write; - for standard output, with --to
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Format of OUT, instead of what its name says
    #[arg(long, value_enum, value_name = "FORMAT")]
    to: Option<FormatName>,
    /// Write text where the format has text and binary (PLY, STL)
    #[arg(long)]
    text: bool,
}

impl Output {
    pub(crate) fn new(output: PathBuf, to: Option<FormatName>, text: bool) -> Self {
        Output { output, to, text }
    }

    /// Its name, for messages.
    pub(crate) fn name(&self) -> String {
        common::name(&self.output, "standard output")
    }

    /// Standard output is for one of the two.
    pub(crate) fn leave_room_for(&self, json: bool) -> Result<(), Failure> {
        if json && files::is_dash(&self.output) {
            return Err(Failure::Usage(
                "--json and OUT both want standard output; write OUT to a path".into(),
            ));
        }
        Ok(())
    }

    /// The format to write. Fails, before any work is done, where nothing could be written.
    pub(crate) fn format(&self, warnings: &mut Warnings) -> Result<Format, Failure> {
        common::check_target(&self.output)?;
        let named = || Format::from_name(&self.output.to_string_lossy());
        let format = self.to.map(Format::from).or_else(named).ok_or_else(|| {
            Failure::Usage(format!(
                "{}: say its format with --to obj|gltf|glb|ply|stl|off{}",
                self.name(),
                common::or_by_name(&self.output)
            ))
        })?;
        if format == Format::Pm {
            return Err(Failure::Usage(format!(
                "{}: a progressive mesh is written by `progmesh encode`, from the mesh at full detail, and that of a height grid by `progmesh terrain build`",
                self.name()
            )));
        }
        let useless = match format {
            _ if !self.text => None,
            Format::Ply | Format::Stl => None,
            Format::Glb => Some("GLB is always binary; gltf is its text form"),
            Format::Pm => None,
            Format::Obj | Format::Gltf | Format::Off => Some("the format is always text"),
        };
        warnings.say(useless.map(|why| format!("{}: --text changes nothing: {why}", self.name())));
        Ok(format)
    }

    /// OUT as a directory to make. Fails, before any work is done, where none could be made.
    pub(crate) fn directory(&self) -> Result<PathBuf, Failure> {
        if self.to.is_some() || self.text || files::is_dash(&self.output) {
            return Err(Failure::Usage(
                "OUT is a directory here: it takes no --to, no --text and no -".into(),
            ));
        }
        if Format::from_name(&self.output.to_string_lossy()).is_some() {
            return Err(Failure::Usage(format!(
                "{}: OUT is a directory of many files here: leave out the ending of its name",
                self.name()
            )));
        }
        files::StagedDirectory::check(&self.output)
            .map_err(|e| Failure::Output(format!("{}: {e}", self.output.display())))?;
        Ok(self.output.clone())
    }

    /// Encodes and writes.
    pub(crate) fn write(
        &self,
        format: Format,
        scene: &Scene,
        interrupt: &Interrupt,
        warnings: &mut Warnings,
    ) -> Result<(), Failure> {
        self.write_with(format, scene, |_| {}, interrupt, warnings)
    }

    /// The same with options changed.
    pub(crate) fn write_with(
        &self,
        format: Format,
        scene: &Scene,
        change: impl FnOnce(&mut EncodeOptions),
        interrupt: &Interrupt,
        warnings: &mut Warnings,
    ) -> Result<(), Failure> {
        let mut options: EncodeOptions = files::encode_options(&self.output, self.text);
        change(&mut options);
        common::write(&self.output, format, &options, scene, interrupt, warnings)
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
    #[arg(long, value_name = "DEG", value_parser = degrees, allow_negative_numbers = true)]
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

/// A count: `250000`, `250_000`, `2.5e5`.
pub(crate) fn whole(text: &str) -> Result<usize, String> {
    whole_number(text).ok_or_else(|| "must be a whole number, 0 or more (1e6 and 1_000_000 will do)".into())
}

/// A count of at least one.
pub(crate) fn positive(text: &str) -> Result<usize, String> {
    whole_number(text)
        .filter(|&n| n > 0)
        .ok_or_else(|| "must be a whole number, 1 or more (1e6 and 1_000_000 will do)".into())
}

/// A number of threads: as many as a machine may have.
pub(crate) fn threads(text: &str) -> Result<usize, String> {
    const MOST: usize = 65_535;
    positive(text)
        .ok()
        .filter(|&n| n <= MOST)
        .ok_or_else(|| format!("must be a whole number from 1 to {MOST}"))
}

fn whole_number(text: &str) -> Option<usize> {
    // As in source code: between digits only.
    let bytes = text.as_bytes();
    let is_digit = |i: Option<usize>| i.and_then(|i| bytes.get(i)).is_some_and(u8::is_ascii_digit);
    let stray =
        |(i, &b): (usize, &u8)| b == b'_' && !(is_digit(i.checked_sub(1)) && is_digit(i.checked_add(1)));
    if bytes.iter().enumerate().any(stray) {
        return None;
    }
    let plain = text.replace('_', "");
    if let Ok(n) = plain.parse::<usize>() {
        return Some(n);
    }
    // Above 2^53 an f64 is no longer the number that was written.
    let x = plain.parse::<f64>().ok().filter(|x| (0.0..=9_007_199_254_740_992.0).contains(x))?;
    (x.fract() == 0.0).then_some(x as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused() {
        assert!(fraction("1.01").is_err() && fraction("nan").is_err() && fraction("0.5") == Ok(0.5));
        assert!(not_negative("-1").is_err() && not_negative("inf").is_err());
        assert!(degrees("181").is_err() && degrees("12") == Ok(12.0));
        assert!(positive("0").is_err() && positive("1") == Ok(1));
        assert!(threads("0").is_err() && threads("65536").is_err() && threads("8") == Ok(8));
    }

    #[test]
    fn counts_may_be_written_as_people_do() {
        for (text, n) in [
            ("0", 0),
            ("1000000", 1_000_000),
            ("1_000_000", 1_000_000),
            ("1e6", 1_000_000),
            ("2.5e5", 250_000),
            ("1E3", 1000),
            ("12.0", 12),
            ("+7", 7),
        ] {
            assert_eq!(whole(text), Ok(n), "{text}");
        }
        for text in
            ["", "-1", "1.5", "1e-1", "1e400", "nan", "inf", "_1", "1_", "1__0", "1_e6", "1,000", "ten"]
        {
            assert!(whole(text).is_err(), "{text}");
        }
    }
}
