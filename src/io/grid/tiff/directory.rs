//! The first directory of a TIFF or BigTIFF file: its tags, each value read when asked for.

use super::super::source::{ReadAt, bytes_at, said};
use super::super::{ByteOrder, DecodeError};

/// The tags of one image.
pub(super) struct Directory {
    pub(super) order: ByteOrder,
    pub(super) big: bool,
    entries: Vec<Entry>,
    /// Images after this one.
    pub(super) more: bool,
}

struct Entry {
    tag: u16,
    kind: u16,
    count: u64,
    /// Where its values lie in the file.
    at: u64,
}

/// More tags than any writer puts into one image.
const MOST_TAGS: u64 = 4096;

fn wrong(what: impl Into<String>) -> DecodeError {
    DecodeError::Element { element: "directory".into(), what: what.into() }
}

fn unread(e: &std::io::Error) -> DecodeError {
    wrong(said(e))
}

/// Bytes of a value of this type.
fn size_of(kind: u16) -> Option<u64> {
    Some(match kind {
        1 | 2 | 6 | 7 => 1,
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 | 16 | 17 | 18 => 8,
        _ => return None,
    })
}

fn unsigned(bytes: &[u8], order: ByteOrder) -> u64 {
    let push = |n: u64, b: &u8| n << 8 | u64::from(*b);
    match order {
        ByteOrder::Big => bytes.iter().fold(0, push),
        ByteOrder::Little => bytes.iter().rev().fold(0, push),
    }
}

impl Directory {
    /// Reads the first directory. Values stay in the file.
    pub(super) fn read(source: &dyn ReadAt) -> Result<Directory, DecodeError> {
        let head = bytes_at(source, 0, 8).map_err(|e| unread(&e))?;
        let order = match &head[..2] {
            b"II" => ByteOrder::Little,
            b"MM" => ByteOrder::Big,
            _ => return Err(wrong("a TIFF file begins with II or MM")),
        };
        let big = match unsigned(&head[2..4], order) {
            42 => false,
            43 if unsigned(&head[4..6], order) == 8 => true,
            n => return Err(wrong(format!("{n} in place of TIFF's mark 42 or 43"))),
        };
        let word = if big { 8 } else { 4 };
        let number = |offset: u64, bytes: u64| {
            bytes_at(source, offset, bytes).map(|b| unsigned(&b, order)).map_err(|e| unread(&e))
        };
        let start = if big { number(8, 8)? } else { number(4, 4)? };
        let count_bytes = if big { 8 } else { 2 };
        let count = number(start, count_bytes)?;
        if count == 0 || count > MOST_TAGS {
            return Err(wrong(format!("{count} tags; there must be 1 to {MOST_TAGS}")));
        }
        let entry_bytes = 4 + 2 * word;
        let first = start + count_bytes;
        let table = bytes_at(source, first, count * entry_bytes).map_err(|e| unread(&e))?;
        let mut entries = Vec::with_capacity(count as usize);
        for (raw, i) in table.chunks_exact(entry_bytes as usize).zip(0u64..) {
            let w = word as usize;
            let (tag, kind) = (unsigned(&raw[..2], order) as u16, unsigned(&raw[2..4], order) as u16);
            let count = unsigned(&raw[4..4 + w], order);
            // Of a type that does not exist: TIFF says to skip it.
            let Some(bytes) = size_of(kind).and_then(|s| s.checked_mul(count)) else { continue };
            let inside = first + i * entry_bytes + 4 + word;
            let at = if bytes <= word { inside } else { unsigned(&raw[4 + w..], order) };
            entries.push(Entry { tag, kind, count, at });
        }
        let after = number(first + count * entry_bytes, word).unwrap_or(0);
        Ok(Directory { order, big, entries, more: after != 0 })
    }

    fn find(&self, tag: u16) -> Option<&Entry> {
        self.entries.iter().find(|e| e.tag == tag)
    }

    /// True if the tag is there.
    pub(super) fn has(&self, tag: u16) -> bool {
        self.find(tag).is_some()
    }

    fn raw(&self, source: &dyn ReadAt, entry: &Entry) -> Result<Vec<u8>, DecodeError> {
        // The count times the size has been found to be a number before.
        let bytes = size_of(entry.kind).unwrap_or(1).saturating_mul(entry.count);
        bytes_at(source, entry.at, bytes).map_err(|e| wrong(format!("tag {}: {}", entry.tag, said(&e))))
    }

    /// Whole numbers without a sign. An absent tag has none. Memory: 8 bytes for each that is really there.
    pub(super) fn wholes(&self, source: &dyn ReadAt, tag: u16) -> Result<Vec<u64>, DecodeError> {
        let Some(entry) = self.find(tag) else { return Ok(vec![]) };
        let size = match entry.kind {
            1 | 3 | 4 | 13 | 16 | 18 => size_of(entry.kind).unwrap_or(1),
            kind => return Err(wrong(format!("tag {tag} has type {kind}; whole numbers are needed"))),
        };
        let raw = self.raw(source, entry)?;
        Ok(raw.chunks_exact(size as usize).map(|b| unsigned(b, self.order)).collect())
    }

    /// The first whole number of a tag, or what stands for an absent one.
    pub(super) fn whole(&self, source: &dyn ReadAt, tag: u16, absent: u64) -> Result<u64, DecodeError> {
        Ok(self.wholes(source, tag)?.first().copied().unwrap_or(absent))
    }

    /// Floating-point numbers. An absent tag has none.
    pub(super) fn floats(&self, source: &dyn ReadAt, tag: u16) -> Result<Vec<f64>, DecodeError> {
        let Some(entry) = self.find(tag) else { return Ok(vec![]) };
        let raw = self.raw(source, entry)?;
        Ok(match entry.kind {
            11 => raw
                .chunks_exact(4)
                .map(|b| f64::from(f32::from_bits(unsigned(b, self.order) as u32)))
                .collect(),
            12 => raw.chunks_exact(8).map(|b| f64::from_bits(unsigned(b, self.order))).collect(),
            kind => return Err(wrong(format!("tag {tag} has type {kind}; f64 is needed"))),
        })
    }

    /// Text, without what follows its end.
    pub(super) fn text(&self, source: &dyn ReadAt, tag: u16) -> Result<Option<String>, DecodeError> {
        let Some(entry) = self.find(tag) else { return Ok(None) };
        let raw = self.raw(source, entry)?;
        let end = raw.iter().position(|&b| b == 0).unwrap_or(raw.len());
        Ok(Some(String::from_utf8_lossy(&raw[..end]).into_owned()))
    }
}
