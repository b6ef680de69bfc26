//! Paths: the only file that touches the file system.
//!
//! Reading takes a path or `-` for standard input. Writing is all or nothing: every file is first written whole to a temporary
//! file in its own directory, then all are renamed, those beside the main file first, the main file last. What fails before the
//! first rename changes nothing. No `fsync`: the guarantee is against errors and interrupts, not against power loss.

use super::grid::{self, GridError, GridFile, GridOptions, ReadAt};
use super::{
    DecodeError, Decoded, EncodeError, EncodeOptions, Encoded, Format, NoSide, Side, decode, encode, pm,
};
use crate::progressive::Detail;
use crate::refine::format::Report;
use crate::scene::Scene;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// A file that is read at any place, from any number of threads.
struct OpenFile {
    file: File,
    length: u64,
}

impl ReadAt for OpenFile {
    fn length(&self) -> u64 {
        self.length
    }

    #[cfg(unix)]
    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        std::os::unix::fs::FileExt::read_exact_at(&self.file, out, offset)
    }

    #[cfg(windows)]
    fn read_at(&self, mut offset: u64, mut out: &mut [u8]) -> io::Result<()> {
        while !out.is_empty() {
            match std::os::windows::fs::FileExt::seek_read(&self.file, out, offset)? {
                0 => return Err(ErrorKind::UnexpectedEof.into()),
                n => {
                    out = &mut out[n..];
                    offset += n as u64;
                }
            }
        }
        Ok(())
    }
}

/// Opens a file to be read at any place. Standard input is read whole; so is what is no regular file.
pub fn open(path: &Path) -> io::Result<Arc<dyn ReadAt>> {
    check_source(path)?;
    if is_dash(path) || !fs::metadata(path)?.is_file() {
        return Ok(Arc::new(read_bytes(path)?));
    }
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    Ok(Arc::new(OpenFile { file, length }))
}

/// Why a grid could not be opened. The caller knows its name.
#[derive(Debug, thiserror::Error)]
pub enum OpenGridError {
    /// The system refused.
    #[error("{0}")]
    Io(io::Error),
    /// The content is wrong, or its format unknown.
    #[error(transparent)]
    Grid(#[from] GridError),
}

/// Writes a file by what `write` puts out, all or nothing. Its directory must be there.
pub fn write_with<E: From<io::Error>>(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> Result<(), E>,
) -> Result<(), E> {
    if is_dash(path) {
        let mut out = io::BufWriter::new(io::stdout().lock());
        write(&mut out)?;
        return Ok(out.flush()?);
    }
    check_target(path)?;
    let mut failed = None;
    let staged = Staged::make(path, |file| {
        let mut out = io::BufWriter::with_capacity(1 << 20, file);
        if let Err(e) = write(&mut out) {
            failed = Some(e);
            return Ok(());
        }
        out.flush()
    });
    match failed {
        Some(e) => Err(e),
        None => Ok(staged?.publish()?),
    }
}

/// Opens a height grid: GeoTIFF, HGT, ESRI ASCII, PNG or raw, by its content or the name's extension. Its heights are read when asked for.
pub fn open_grid(path: &Path, options: &GridOptions) -> Result<GridFile, OpenGridError> {
    let source = open(path).map_err(OpenGridError::Io)?;
    let name = if is_dash(path) { "standard input".into() } else { path.display().to_string() };
    Ok(grid::open(source, &name, options)?)
}

/// Stands for standard input or output in place of a path.
pub const DASH: &str = "-";

/// A file that was read.
#[derive(Debug)]
#[non_exhaustive]
pub struct Loaded {
    /// Its content, and what was said about it.
    pub decoded: Decoded,
    /// The format it was read as.
    pub format: Format,
    /// Its size.
    pub bytes: usize,
    /// What it holds beside full detail, if it is a progressive mesh file.
    pub progressive: Option<About>,
}

/// A progressive mesh file in numbers.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct About {
    /// Triangles of the bases.
    pub base_triangles: usize,
    /// Splits of all meshes.
    pub splits: usize,
    /// Levels.
    pub levels: usize,
    /// Bytes by purpose, and losses; `None` for Hoppe's format.
    pub report: Option<Report>,
}

/// Why a file could not be read. The caller knows its name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// Neither the name nor the caller says what it is.
    #[error("the name does not tell the format; say it (obj, gltf, glb, ply, stl, off, pm)")]
    UnknownFormat,
    /// The system refused.
    #[error("{0}")]
    Io(io::Error),
    /// The content is wrong.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// The content is wrong for the format it was taken for, and begins like another.
    #[error("{error}; it begins like {}", like.extension().to_uppercase())]
    Mistaken {
        /// What is wrong with it.
        error: DecodeError,
        /// What it looks like.
        like: Format,
    },
}

/// Why a file could not be written. Nothing was changed, unless the variant says so.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// Neither the name nor the caller says what it is to be.
    #[error("the name does not tell the format; say it (obj, gltf, glb, ply, stl, off)")]
    UnknownFormat,
    /// The format cannot hold the scene.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// Files would have to stand beside standard output.
    #[error("needs files beside it ({0}), which standard output cannot give; write to a path, or as glb")]
    SideOfStdout(String),
    /// The encoder named a file that does not lie beside or below the output.
    #[error("{0}: a file beside the output must have a relative name without `..`")]
    SideName(String),
    /// The system refused. When it did so at the second or a later rename, the files renamed before are new.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The caller asked to stop before anything was changed.
    #[error("interrupted; nothing was written")]
    Cancelled,
}

impl WriteError {
    /// True if whoever read our output has gone away, which is no fault.
    pub fn is_broken_pipe(&self) -> bool {
        matches!(self, WriteError::Io { source, .. } if source.kind() == ErrorKind::BrokenPipe)
    }
}

/// Reads a mesh file, by the name's extension if `format` is `None`. `-` is standard input, and needs a format.
pub fn read(path: &Path, format: Option<Format>) -> Result<Loaded, ReadError> {
    // That there is no such file, or that it is a directory, matters more than its name.
    check_source(path).map_err(ReadError::Io)?;
    let format =
        format.or_else(|| Format::from_name(&path.to_string_lossy())).ok_or(ReadError::UnknownFormat)?;
    let bytes = read_bytes(path).map_err(ReadError::Io)?;
    let mut progressive = None;
    let decoded = match is_dash(path) {
        _ if format == Format::Pm => at_full_detail(&bytes, &mut progressive),
        true => decode(format, &bytes, &NoSide),
        false => decode(format, &bytes, &Beside::of(path)),
    };
    let decoded = decoded.map_err(|error| match Format::from_bytes(&bytes) {
        // A GLB is told from a glTF when reading.
        Some(like) if like != format && [like, format] != [Format::Glb, Format::Gltf] => {
            ReadError::Mistaken { error, like }
        }
        _ => ReadError::Decode(error),
    })?;
    Ok(Loaded { decoded, format, bytes: bytes.len(), progressive })
}

/// Decodes a progressive mesh file, and says what it holds.
fn at_full_detail(bytes: &[u8], about: &mut Option<About>) -> Result<Decoded, DecodeError> {
    let read = pm::decode_progressive(bytes)?;
    let scene = read.scene.at(&read.scene.positions(Detail::Full)).map_err(pm::damage_of)?;
    *about = Some(About {
        base_triangles: read.scene.base_triangles(),
        splits: read.scene.splits(),
        levels: read.scene.levels(),
        report: read.report,
    });
    Ok(Decoded { scene, warnings: read.warnings })
}

/// The bytes of a file, or of standard input for `-`.
pub fn read_all(path: &Path) -> io::Result<Vec<u8>> {
    check_source(path)?;
    read_bytes(path)
}

/// Reads a mesh file by its extension: its scene, and the warnings.
pub fn read_scene(path: impl AsRef<Path>) -> Result<Decoded, ReadError> {
    read(path.as_ref(), None).map(|l| l.decoded)
}

/// Writes a mesh file by its extension. Returns the warnings: what the format cannot hold.
pub fn write_scene(path: impl AsRef<Path>, scene: &Scene) -> Result<Vec<String>, WriteError> {
    let path = path.as_ref();
    let format = Format::from_name(&path.to_string_lossy()).ok_or(WriteError::UnknownFormat)?;
    let mut encoded = encode(format, scene, &encode_options(path, false))?;
    let mut warnings = std::mem::take(&mut encoded.warnings);
    warnings.extend(write(path, format, &encoded, &|| false)?);
    Ok(warnings)
}

/// Encoding options for this output: the stem of its name.
pub fn encode_options(path: &Path, text: bool) -> EncodeOptions {
    let stem = if is_dash(path) { None } else { path.file_stem() };
    let stem = stem.map_or_else(|| "mesh".into(), |s| s.to_string_lossy().into_owned());
    EncodeOptions { text, stem, ..Default::default() }
}

/// True for `-`.
pub fn is_dash(path: &Path) -> bool {
    path.as_os_str() == DASH
}

fn read_bytes(path: &Path) -> io::Result<Vec<u8>> {
    if is_dash(path) {
        let mut bytes = Vec::new();
        io::stdin().lock().read_to_end(&mut bytes)?;
        return Ok(bytes);
    }
    fs::read(path)
}

/// Fails where `path` cannot be a file to read.
fn check_source(path: &Path) -> io::Result<()> {
    if !is_dash(path) && fs::metadata(path)?.is_dir() {
        return Err(is_a_directory());
    }
    Ok(())
}

fn is_a_directory() -> io::Error {
    io::Error::new(ErrorKind::IsADirectory, "is a directory")
}

/// Fails where no file can be written at `path`: there is no directory for it, or a directory in its place. So that a long run need
/// not end with that.
///
/// No guarantee: permissions and space are found out when writing.
pub fn check_target(path: &Path) -> io::Result<()> {
    if is_dash(path) {
        return Ok(());
    }
    let directory = directory_of(path);
    if path.is_dir() {
        return Err(is_a_directory());
    }
    match fs::metadata(directory) {
        Ok(m) if m.is_dir() => Ok(()),
        Ok(_) => Err(io::Error::new(
            ErrorKind::NotADirectory,
            format!("{} is not a directory", directory.display()),
        )),
        Err(e) if e.kind() == ErrorKind::NotFound => {
            Err(io::Error::new(e.kind(), format!("there is no directory {}", directory.display())))
        }
        Err(e) => Err(e),
    }
}

/// Files in the directory of an input, and below it.
///
/// Absolute names, names with a scheme (`http:`), and `..` out of the directory are refused: a mesh file from elsewhere must not be
/// able to pull in whatever the user can read. Names are tried as written, then with `%20` and the like decoded.
#[derive(Clone, Debug)]
pub struct Beside {
    directory: PathBuf,
}

impl Beside {
    /// The files beside `path`.
    pub fn of(path: &Path) -> Self {
        Beside { directory: directory_of(path).to_path_buf() }
    }
}

impl Side for Beside {
    fn load(&self, name: &str) -> io::Result<Vec<u8>> {
        let refused = |why: &str| io::Error::new(ErrorKind::PermissionDenied, format!("not read: {why}"));
        let read = |name: &str| {
            let below = relative_below(name).map_err(refused)?;
            let path = self.directory.join(below);
            match fs::metadata(&path)?.is_file() {
                true => fs::read(path),
                false => Err(refused("is no regular file")),
            }
        };
        match (read(name), percent_decoded(name)) {
            (Err(e), Some(decoded)) if e.kind() == ErrorKind::NotFound => read(&decoded),
            (result, _) => result,
        }
    }
}

/// `name` as a path that stays in its directory, or why it does not.
fn relative_below(name: &str) -> Result<PathBuf, &'static str> {
    // Files made on Windows name their textures with backslashes.
    let name = name.replace('\\', "/");
    let drive = name.as_bytes().get(1) == Some(&b':');
    if name.starts_with('/') || drive {
        return Err("its name is absolute; only files beside the input and below are read");
    }
    if name.contains("://") {
        return Err("its name is a URL; nothing is fetched");
    }
    let mut path = PathBuf::new();
    for part in Path::new(&name).components() {
        match part {
            Component::Normal(p) => path.push(p),
            Component::CurDir => {}
            Component::ParentDir if path.pop() => {}
            _ => {
                return Err(
                    "`..` leads out of the input's directory; only files beside it and below are read",
                );
            }
        }
    }
    if path.as_os_str().is_empty() { Err("it has no name") } else { Ok(path) }
}

/// `name` with `%XX` decoded; `None` if there is none, or the result is no UTF-8.
fn percent_decoded(name: &str) -> Option<String> {
    if !name.contains('%') {
        return None;
    }
    let hex = |b: Option<&u8>| b.and_then(|&b| (b as char).to_digit(16)).map(|d| d as u8);
    let bytes = name.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        match (bytes[i], hex(bytes.get(i + 1)), hex(bytes.get(i + 2))) {
            (b'%', Some(high), Some(low)) => {
                out.push(high << 4 | low);
                i += 3;
            }
            (b, ..) => {
                out.push(b);
                i += 1;
            }
        }
    }
    String::from_utf8(out).ok().filter(|s| !s.contains('\0'))
}

/// Writes what was encoded, all or nothing. `-` is standard output. `cancelled` is asked once, before the first change.
///
/// Returns warnings: files beside the main one that standard output has no place for.
pub fn write(
    path: &Path,
    format: Format,
    encoded: &Encoded,
    cancelled: &dyn Fn() -> bool,
) -> Result<Vec<String>, WriteError> {
    let at = |path: &Path| {
        let path = path.to_path_buf();
        move |source| WriteError::Io { path, source }
    };
    if is_dash(path) {
        let names: Vec<&str> = encoded.side.iter().map(|s| s.0.as_str()).collect();
        if format == Format::Gltf && !names.is_empty() {
            return Err(WriteError::SideOfStdout(names.join(", ")));
        }
        if cancelled() {
            return Err(WriteError::Cancelled);
        }
        let mut out = io::stdout().lock();
        out.write_all(&encoded.bytes).and_then(|()| out.flush()).map_err(at(Path::new("standard output")))?;
        return Ok(match names.is_empty() {
            true => vec![],
            false => {
                vec![format!("{} not written: standard output has room for one file only", names.join(", "))]
            }
        });
    }
    check_target(path).map_err(at(path))?;
    let directory = directory_of(path);
    let mut staged = Vec::with_capacity(encoded.side.len() + 1);
    for (name, bytes) in &encoded.side {
        let below = relative_below(name).map_err(|_| WriteError::SideName(name.clone()))?;
        let target = directory.join(below);
        if let Some(parent) = target.parent() {
            fs::create_dir_all(parent).map_err(at(parent))?;
        }
        staged.push(Staged::write(&target, bytes).map_err(at(&target))?);
    }
    staged.push(Staged::write(path, &encoded.bytes).map_err(at(path))?);
    if cancelled() {
        return Err(WriteError::Cancelled);
    }
    for s in staged {
        let target = s.target.clone();
        s.publish().map_err(at(&target))?;
    }
    Ok(vec![])
}

/// Writes one file of text or bytes, all or nothing. Its directory must be there.
pub fn write_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    check_target(path)?;
    Staged::write(path, bytes)?.publish()
}

fn directory_of(path: &Path) -> &Path {
    match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    }
}

/// A file written under a temporary name; removed again unless published.
struct Staged {
    target: PathBuf,
    /// `None` when the target is no regular file (`/dev/null`, a pipe): it must not be replaced, and was written directly.
    temporary: Option<PathBuf>,
}

impl Staged {
    fn write(target: &Path, bytes: &[u8]) -> io::Result<Staged> {
        Staged::make(target, |file| file.write_all(bytes))
    }

    fn make(target: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<Staged> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        // Through a symbolic link, so that what it points at is replaced and not the link.
        let target = fs::canonicalize(target).unwrap_or_else(|_| target.to_path_buf());
        let existing = fs::metadata(&target).ok();
        if existing.as_ref().is_some_and(|m| m.is_dir()) {
            return Err(is_a_directory());
        }
        if existing.as_ref().is_some_and(|m| !m.is_file()) {
            write(&mut OpenOptions::new().write(true).open(&target)?)?;
            return Ok(Staged { target, temporary: None });
        }
        let (mut file, staged) = loop {
            let n = COUNT.fetch_add(1, Ordering::Relaxed);
            // Short whatever the target's name, which may be as long as the system allows.
            let name = format!(".progmesh-{}-{n}.tmp", std::process::id());
            let temporary = directory_of(&target).join(name);
            match File::create_new(&temporary) {
                Ok(file) => break (file, Staged { target, temporary: Some(temporary) }),
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
                Err(e) => return Err(e),
            }
        };
        write(&mut file)?;
        if let Some(m) = existing {
            // A file that is replaced keeps its mode. Where that is not allowed the default will do.
            let _ = file.set_permissions(m.permissions());
        }
        Ok(staged)
    }

    fn publish(mut self) -> io::Result<()> {
        if let Some(temporary) = &self.temporary {
            fs::rename(temporary, &self.target)?;
        }
        self.temporary = None;
        Ok(())
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        if let Some(t) = &self.temporary {
            let _ = fs::remove_file(t);
        }
    }
}

/// What tells a file from another of its name, or from itself after a change: name, size, and when it was changed last.
///
/// Errors: the system's.
pub fn identity(path: &Path) -> io::Result<String> {
    if is_dash(path) {
        return Ok("standard input".into());
    }
    let about = fs::metadata(path)?;
    let changed = about.modified()?.duration_since(std::time::UNIX_EPOCH).unwrap_or_default().as_nanos();
    Ok(format!("{} {} {changed}", path.display(), about.len()))
}

/// A folder for what is put aside during long work, so that a run that was interrupted can go on.
#[derive(Debug)]
pub struct WorkFolder {
    path: PathBuf,
}

/// The file of a [`WorkFolder`] that says what it belongs to.
const BELONGS: &str = "belongs-to";

impl WorkFolder {
    /// Opens the folder, or makes it. What it holds is kept if it belongs to the same work, as `belongs` says it, and removed otherwise.
    ///
    /// Errors: the system's; a folder that is not empty and was not made here.
    pub fn open(path: &Path, belongs: &str) -> io::Result<WorkFolder> {
        let folder = WorkFolder { path: path.to_path_buf() };
        match fs::read(path.join(BELONGS)) {
            Ok(known) if known == belongs.as_bytes() => return Ok(folder),
            Ok(_) => folder.clear()?,
            Err(e) if e.kind() == ErrorKind::NotFound => {
                fs::create_dir_all(path)?;
                // What a run that was killed at once may have left.
                folder.clear_temporary()?;
                if fs::read_dir(path)?.next().is_some() {
                    let what = "the folder for unfinished work is there, holds files, and was not made by this program";
                    return Err(io::Error::new(ErrorKind::AlreadyExists, what));
                }
            }
            Err(e) => return Err(e),
        }
        write_file(&path.join(BELONGS), belongs.as_bytes())?;
        Ok(folder)
    }

    /// Removes the folder with all that was put there.
    ///
    /// Errors: the system's; files that were not put there by this program stay, and the folder with them.
    pub fn remove(self) -> io::Result<()> {
        self.clear()?;
        fs::remove_dir(&self.path)
    }

    /// Removes all that was put there.
    ///
    /// Errors: the system's.
    pub fn clear(&self) -> io::Result<()> {
        self.clear_temporary()?;
        self.clear_by(|name| {
            [".block", ".sheet", ".chunks", ".heights"].iter().any(|end| name.ends_with(end))
        })?;
        self.clear_by(|name| name == BELONGS)
    }

    fn clear_temporary(&self) -> io::Result<()> {
        self.clear_by(|name| name.starts_with(".progmesh-") && name.ends_with(".tmp"))
    }

    fn clear_by(&self, which: impl Fn(&str) -> bool) -> io::Result<()> {
        for entry in fs::read_dir(&self.path)? {
            let entry = entry?;
            if entry.file_name().to_str().is_some_and(&which) {
                fs::remove_file(entry.path())?;
            }
        }
        Ok(())
    }
}

/// A folder without work is of no use to the next run: it goes.
impl Drop for WorkFolder {
    fn drop(&mut self) {
        let empty = fs::read_dir(&self.path)
            .is_ok_and(|all| all.into_iter().all(|e| e.is_ok_and(|e| e.file_name() == BELONGS)));
        if empty {
            // What cannot be removed stays.
            let _ = fs::remove_file(self.path.join(BELONGS));
            let _ = fs::remove_dir(&self.path);
        }
    }
}

impl crate::blocks::Store for WorkFolder {
    fn has(&self, name: &str) -> io::Result<bool> {
        fs::exists(self.path.join(name))
    }

    fn get(&self, name: &str) -> io::Result<Vec<u8>> {
        fs::read(self.path.join(name))
    }

    fn start(&self, name: &str, bytes: usize) -> io::Result<Vec<u8>> {
        let mut out = Vec::new();
        File::open(self.path.join(name))?.take(bytes as u64).read_to_end(&mut out)?;
        Ok(out)
    }

    fn put(&self, name: &str, bytes: &[u8]) -> io::Result<()> {
        write_file(&self.path.join(name), bytes)
    }

    fn remove(&self, name: &str) -> io::Result<()> {
        match fs::remove_file(self.path.join(name)) {
            Err(e) if e.kind() != ErrorKind::NotFound => Err(e),
            _ => Ok(()),
        }
    }
}

/// A directory in the making: written whole under a temporary name beside its own; removed again unless published.
#[derive(Debug)]
pub struct StagedDirectory {
    target: PathBuf,
    /// `None` once published.
    temporary: Option<PathBuf>,
}

impl StagedDirectory {
    /// Fails where there is no directory for it, or something in its place that is no empty directory: nothing is ever replaced.
    pub fn check(target: &Path) -> io::Result<()> {
        let taken = |what: &str| Err(io::Error::new(ErrorKind::AlreadyExists, what.to_string()));
        match fs::symlink_metadata(target) {
            Ok(m) if !m.is_dir() => return taken("is there already, and no directory"),
            Ok(_) if fs::read_dir(target)?.next().is_some() => {
                return taken("is there already, and not empty: remove it, or name another directory");
            }
            Ok(_) => {}
            Err(e) if e.kind() == ErrorKind::NotFound => {}
            Err(e) => return Err(e),
        }
        match target.file_name() {
            Some(_) => check_target(&directory_of(target).join(".progmesh")),
            None => taken("names no directory to make"),
        }
    }

    /// Begins one. See [`StagedDirectory::check`].
    pub fn new(target: &Path) -> io::Result<Self> {
        Self::check(target)?;
        static COUNT: AtomicU64 = AtomicU64::new(0);
        loop {
            let n = COUNT.fetch_add(1, Ordering::Relaxed);
            let name = format!(".progmesh-{}-{n}.tmp.d", std::process::id());
            let temporary = directory_of(target).join(name);
            match fs::create_dir(&temporary) {
                Ok(()) => {
                    return Ok(StagedDirectory { target: target.to_path_buf(), temporary: Some(temporary) });
                }
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
                Err(e) => return Err(e),
            }
        }
    }

    /// Writes a file in it, by a relative name without `..`. Threads may write at once.
    pub fn write(&self, name: &str, bytes: &[u8]) -> io::Result<()> {
        let below = relative_below(name).map_err(|why| io::Error::new(ErrorKind::InvalidInput, why))?;
        let Some(temporary) = &self.temporary else { return Err(ErrorKind::NotFound.into()) };
        let path = temporary.join(below);
        fs::create_dir_all(directory_of(&path))?;
        fs::write(path, bytes)
    }

    /// Gives it its own name.
    pub fn publish(mut self) -> io::Result<()> {
        if let Some(temporary) = &self.temporary {
            // An empty directory is replaced where the system allows that; elsewhere it is removed first.
            if fs::rename(temporary, &self.target).is_err() {
                if self.target.is_dir() {
                    fs::remove_dir(&self.target)?;
                }
                fs::rename(temporary, &self.target)?;
            }
        }
        self.temporary = None;
        Ok(())
    }
}

impl Drop for StagedDirectory {
    fn drop(&mut self) {
        if let Some(t) = &self.temporary {
            let _ = fs::remove_dir_all(t);
        }
    }
}

/// The most memory this process has held so far, in bytes; `None` where the system does not tell (all but Linux).
pub fn peak_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kb| 1024 * kb)
}

/// The memory that programs may still take without anything being swapped out, in bytes; `None` where the system does not tell (all but Linux).
pub fn free_bytes() -> Option<u64> {
    let about = fs::read_to_string("/proc/meminfo").ok()?;
    let line = about.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kb| 1024 * kb)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_leave_the_directory_are_refused() {
        for bad in ["/etc/passwd", "..", "../x", "a/../../x", "C:\\x", "\\x", "http://h/x", "", "."] {
            assert!(relative_below(bad).is_err(), "{bad}");
        }
        assert_eq!(relative_below("a\\b.png").unwrap(), Path::new("a/b.png"));
        assert_eq!(relative_below("./a/../b.png").unwrap(), Path::new("b.png"));
    }

    #[test]
    fn percent_signs_are_decoded_only_where_they_code() {
        assert_eq!(percent_decoded("a%20b%2Fc").as_deref(), Some("a b/c"));
        assert_eq!(percent_decoded("100%").as_deref(), Some("100%"));
        assert_eq!(percent_decoded("plain"), None);
        assert_eq!(percent_decoded("%ff"), None);
        assert_eq!(percent_decoded("%00"), None);
    }

    #[test]
    fn side_files_are_found_as_written_and_decoded_but_not_outside() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("in")).unwrap();
        fs::write(dir.path().join("in/a b.bin"), b"1").unwrap();
        fs::write(dir.path().join("in/50%25.bin"), b"2").unwrap();
        fs::write(dir.path().join("secret"), b"3").unwrap();
        let side = Beside::of(&dir.path().join("in/x.gltf"));
        assert_eq!(side.load("a%20b.bin").unwrap(), b"1");
        assert_eq!(side.load("50%25.bin").unwrap(), b"2");
        assert_eq!(side.load("../secret").unwrap_err().kind(), ErrorKind::PermissionDenied);
        assert_eq!(side.load("%2e%2e/secret").unwrap_err().kind(), ErrorKind::PermissionDenied);
        assert_eq!(side.load("none").unwrap_err().kind(), ErrorKind::NotFound);
    }

    #[test]
    fn a_failed_or_cancelled_write_leaves_the_old_files_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let (out, side) = (dir.path().join("o.obj"), dir.path().join("o.mtl"));
        fs::write(&out, b"old").unwrap();
        let encoded = Encoded {
            bytes: b"new".to_vec(),
            side: vec![("o.mtl".into(), b"mtl".to_vec())],
            ..Default::default()
        };
        assert!(matches!(write(&out, Format::Obj, &encoded, &|| true), Err(WriteError::Cancelled)));
        fs::create_dir(&side).unwrap();
        assert!(matches!(write(&out, Format::Obj, &encoded, &|| false), Err(WriteError::Io { .. })));
        fs::remove_dir(&side).unwrap();
        assert_eq!(fs::read(&out).unwrap(), b"old");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);

        write(&out, Format::Obj, &encoded, &|| false).unwrap();
        assert_eq!((fs::read(&out).unwrap(), fs::read(&side).unwrap()), (b"new".to_vec(), b"mtl".to_vec()));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 2);
    }

    #[test]
    fn a_directory_appears_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("tiles");
        let staged = StagedDirectory::new(&target).unwrap();
        staged.write("0/0/0.glb", b"tile").unwrap();
        assert!(staged.write("../x", b"").is_err() && !target.exists());
        drop(staged);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);

        fs::create_dir(&target).unwrap();
        let staged = StagedDirectory::new(&target).unwrap();
        staged.write("0/0/0.glb", b"tile").unwrap();
        staged.publish().unwrap();
        assert_eq!(fs::read(target.join("0/0/0.glb")).unwrap(), b"tile");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
        for taken in [&target, &target.join("0/0/0.glb"), &dir.path().join("none/tiles")] {
            assert!(StagedDirectory::new(taken).is_err(), "{}", taken.display());
        }
    }

    #[test]
    fn an_encoder_cannot_write_outside() {
        let dir = tempfile::tempdir().unwrap();
        let encoded = Encoded { side: vec![("../x".into(), vec![])], ..Default::default() };
        let r = write(&dir.path().join("o.obj"), Format::Obj, &encoded, &|| false);
        assert!(matches!(r, Err(WriteError::SideName(_))));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_written_through_and_a_device_not_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let (real, link) = (dir.path().join("real"), dir.path().join("link"));
        fs::write(&real, b"old").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        write_file(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&real).unwrap(), b"new");
        write_file(Path::new("/dev/null"), b"x").unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }
}
