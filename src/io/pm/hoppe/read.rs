//! The bytes of Hoppe's `.pm`: a text head, then big-endian records.

use crate::io::DecodeError;

/// A line of the head, or a record, with what is wrong.
pub(super) fn wrong(element: impl Into<String>, what: impl Into<String>) -> DecodeError {
    DecodeError::Element { element: element.into(), what: what.into() }
}

/// The head of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Head {
    pub(super) splits: usize,
    /// Vertices, wedges, faces at full detail.
    pub(super) full: [usize; 3],
    pub(super) has_rgb: bool,
    pub(super) has_uv: bool,
    pub(super) has_residuals: bool,
    pub(super) materials: Vec<String>,
    /// Vertices, wedges, faces of the base.
    pub(super) base: [usize; 3],
}

impl Head {
    /// Numbers of a wedge.
    pub(super) fn stride(&self) -> usize {
        3 + 3 * self.has_rgb as usize + 2 * self.has_uv as usize
    }
}

/// A place in the bytes.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Reader { bytes, at: 0 }
    }

    pub(super) fn rest(&self) -> usize {
        self.bytes.len() - self.at
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], DecodeError> {
        let bytes = self.bytes[self.at..].first_chunk::<N>().ok_or_else(|| self.early())?;
        self.at += N;
        Ok(*bytes)
    }

    pub(super) fn early(&self) -> DecodeError {
        DecodeError::Byte { offset: self.bytes.len(), what: "the file ends too early".into() }
    }

    pub(super) fn word(&mut self) -> Result<u32, DecodeError> {
        self.take().map(u32::from_be_bytes)
    }

    pub(super) fn short(&mut self) -> Result<u16, DecodeError> {
        self.take().map(u16::from_be_bytes)
    }

    pub(super) fn float(&mut self) -> Result<f32, DecodeError> {
        self.take().map(f32::from_be_bytes)
    }

    pub(super) fn point(&mut self) -> Result<[f32; 3], DecodeError> {
        Ok([self.float()?, self.float()?, self.float()?])
    }

    /// True if the end mark comes next.
    pub(super) fn at_end(&self) -> bool {
        self.bytes.get(self.at) == Some(&0xff)
    }

    fn line(&mut self) -> Result<&'a str, DecodeError> {
        // Lines of the head are short.
        let rest = &self.bytes[self.at..];
        let end = rest.iter().take(1 << 16).position(|&b| b == b'\n').ok_or_else(|| self.early())?;
        self.at += end + 1;
        std::str::from_utf8(&rest[..end])
            .map(|l| l.trim_end_matches('\r'))
            .map_err(|_| DecodeError::Byte { offset: self.at, what: "the head is no text".into() })
    }

    /// Reads the head, up to the first binary record.
    pub(super) fn head(&mut self) -> Result<Head, DecodeError> {
        let mut head = Head::default();
        while self.bytes.get(self.at) == Some(&b'#') {
            self.line()?;
        }
        if self.line()? != "PM" {
            return Err(wrong("head", "does not begin with PM"));
        }
        let mut version = 1;
        loop {
            let line = self.line()?;
            match line.split_once('=') {
                _ if line == "PM base mesh:" => break,
                _ if line.starts_with("bbox") => {}
                Some(("version", v)) => version = number(v, line)?,
                Some(("has_rgb", v)) => head.has_rgb = number(v, line)? != 0,
                Some(("has_uv", v)) => head.has_uv = number(v, line)? != 0,
                Some(("has_resid", v)) => head.has_residuals = number(v, line)? != 0,
                Some(("nvsplits", _)) => {
                    let [splits, vertices, wedges, faces] =
                        counts(line, ["nvsplits", "nvertices", "nwedges", "nfaces"])?;
                    (head.splits, head.full) = (splits, [vertices, wedges, faces]);
                }
                Some(("has_wad2", v)) if number(v, line)? == 0 => {}
                _ => return Err(wrong("head", format!("unknown line {line:?}"))),
            }
        }
        if version != 2 {
            return Err(DecodeError::Unsupported { what: format!("version {version} of Hoppe's format") });
        }
        let line = self.line()?;
        let [materials] = counts(line, ["nmaterials"])?;
        for _ in 0..materials {
            head.materials.push(self.line()?.to_string());
        }
        head.base = counts(self.line()?, ["nvertices", "nwedges", "nfaces"])?;
        // What is announced must be there.
        let [v, w, f] = head.base;
        let sizes = [(v, 12), (w, 4 + 4 * head.stride()), (f, 14), (head.splits, 8 + 24)];
        let need = sizes.iter().try_fold(0usize, |sum, &(n, size)| sum.checked_add(n.checked_mul(size)?));
        if need.is_none_or(|n| n > self.rest()) {
            return Err(self.early());
        }
        Ok(head)
    }
}

fn number(text: &str, line: &str) -> Result<usize, DecodeError> {
    text.trim().parse().map_err(|_| wrong("head", format!("no number in {line:?}")))
}

/// `name=number` for each name, separated by spaces.
fn counts<const N: usize>(line: &str, names: [&str; N]) -> Result<[usize; N], DecodeError> {
    let mut found = [0; N];
    let mut parts = line.split_whitespace();
    for (to, name) in found.iter_mut().zip(names) {
        let part = parts.next().and_then(|p| p.strip_prefix(name)?.strip_prefix('='));
        *to = number(part.ok_or_else(|| wrong("head", format!("{name}= is missing in {line:?}")))?, line)?;
    }
    Ok(found)
}

/// A split as it is written.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Record {
    pub(super) face: u32,
    /// 0: there is no face clockwise of the left cut; 1: no right cut; else one more than the faces between the cuts.
    pub(super) between: u16,
    pub(super) code: u16,
    pub(super) materials: [u16; 2],
    pub(super) large: [f32; 3],
    pub(super) small: [f32; 3],
    /// Wedge deltas, row after row.
    pub(super) wedges: Vec<f32>,
    pub(super) residual: Option<f32>,
}

impl Record {
    pub(super) fn corner(&self) -> usize {
        (self.code & 3) as usize
    }

    /// Which end of the edge the vertex was at: 0, 1 (the middle), 2.
    pub(super) fn ii(&self) -> u16 {
        self.code >> 2 & 3
    }

    /// At the old vertex (`s`) or the new: same as left, same as right, left and right the same.
    pub(super) fn same(&self, s: bool) -> [bool; 3] {
        let bits = self.code >> if s { 4 } else { 7 };
        [1, 2, 4].map(|b| bits & b != 0)
    }

    /// The tip on the left or the right: 0 that of the face above, 1 below, 2 new.
    pub(super) fn tip(&self, right: bool) -> u16 {
        let bits = self.code >> if right { 12 } else { 10 } & 3;
        if bits & 2 != 0 { 2 } else { bits }
    }

    /// The face on the left or the right has a material of its own.
    pub(super) fn own_material(&self, right: bool) -> bool {
        self.code >> if right { 15 } else { 14 } & 1 == 1
    }

    pub(super) fn two_faces(&self) -> bool {
        self.between > 1
    }

    /// How many wedge deltas there are.
    fn deltas(&self) -> usize {
        let ([t_l, t_r, t_c], [s_l, s_r, s_c]) = (self.same(false), self.same(true));
        let mut n = if !t_l && !s_l { 2 } else { 1 };
        if self.two_faces() {
            n += match self.ii() {
                _ if !t_r && !s_r => !t_c as usize + !s_c as usize,
                2 => !t_c as usize,
                0 => !s_c as usize,
                _ => (!t_c || !s_c) as usize,
            };
        }
        n + (self.tip(false) == 2) as usize + (self.two_faces() && self.tip(true) == 2) as usize
    }

    pub(super) fn read(from: &mut Reader<'_>, head: &Head) -> Result<Record, DecodeError> {
        let mut r =
            Record { face: from.word()?, between: from.short()?, code: from.short()?, ..Default::default() };
        if r.code >> 14 != 0 {
            r.materials = [from.short()?, from.short()?];
        }
        (r.large, r.small) = (from.point()?, from.point()?);
        for _ in 0..r.deltas() * head.stride() {
            r.wedges.push(from.float()?);
        }
        if head.has_residuals {
            r.residual = Some(from.float()?);
            from.float()?;
        }
        Ok(r)
    }
}
