//! Bytes at any place: what rasters are read from.

use std::io::{self, BufRead, ErrorKind, Read, Seek, SeekFrom};
use std::sync::Arc;

/// Bytes that can be read at any place, from any number of threads.
pub trait ReadAt: Send + Sync {
    /// How many there are.
    fn length(&self) -> u64;

    /// Fills `out` with the bytes from `offset` on.
    ///
    /// # Errors
    /// Of the system; `UnexpectedEof` where there are not that many.
    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()>;
}

impl ReadAt for Vec<u8> {
    fn length(&self) -> u64 {
        self.len() as u64
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let from = usize::try_from(offset).ok().and_then(|start| self.get(start..)?.get(..out.len()));
        out.copy_from_slice(from.ok_or(ErrorKind::UnexpectedEof)?);
        Ok(())
    }
}

/// A buffer of this many bytes read from `offset`; fails, before anything is allocated, where there are not that many.
pub(super) fn bytes_at(source: &dyn ReadAt, offset: u64, count: u64) -> io::Result<Vec<u8>> {
    let end = offset.checked_add(count).filter(|&end| end <= source.length());
    let count = end.and(usize::try_from(count).ok()).ok_or(ErrorKind::UnexpectedEof)?;
    let mut bytes = vec![0; count];
    source.read_at(offset, &mut bytes)?;
    Ok(bytes)
}

/// What the system said, in words that fit behind a place.
pub(super) fn said(e: &io::Error) -> String {
    match e.kind() {
        ErrorKind::UnexpectedEof => "the file ends before".into(),
        _ => e.to_string(),
    }
}

/// A source as a stream, buffered.
pub(super) struct Stream {
    source: Arc<dyn ReadAt>,
    buffer: Vec<u8>,
    /// Where the buffer begins in the source.
    start: u64,
    /// The next byte, within the buffer.
    next: usize,
}

const BUFFER: u64 = 1 << 16;

impl Stream {
    pub(super) fn new(source: Arc<dyn ReadAt>) -> Self {
        Stream { source, buffer: vec![], start: 0, next: 0 }
    }

    /// Offset of the next byte.
    pub(super) fn place(&self) -> u64 {
        self.start + self.next as u64
    }
}

impl BufRead for Stream {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.next >= self.buffer.len() {
            let place = self.place();
            let count = self.source.length().saturating_sub(place).min(BUFFER);
            self.buffer.resize(count as usize, 0);
            (self.start, self.next) = (place, 0);
            self.source.read_at(place, &mut self.buffer)?;
        }
        Ok(&self.buffer[self.next..])
    }

    fn consume(&mut self, amount: usize) {
        self.next = (self.next + amount).min(self.buffer.len());
    }
}

impl Read for Stream {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let from = self.fill_buf()?;
        let n = from.len().min(out.len());
        out[..n].copy_from_slice(&from[..n]);
        self.consume(n);
        Ok(n)
    }
}

impl Seek for Stream {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let place = match to {
            SeekFrom::Start(n) => Some(n),
            SeekFrom::Current(n) => self.place().checked_add_signed(n),
            SeekFrom::End(n) => self.source.length().checked_add_signed(n),
        };
        self.start = place.ok_or(ErrorKind::InvalidInput)?;
        self.buffer.clear();
        self.next = 0;
        Ok(self.start)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_gives_the_bytes_from_any_place() {
        let bytes: Vec<u8> = (0..200_000u32).map(|i| (i % 251) as u8).collect();
        let mut stream = Stream::new(Arc::new(bytes.clone()));
        let mut all = vec![];
        stream.read_to_end(&mut all).unwrap();
        assert_eq!(all, bytes);
        stream.seek(SeekFrom::Start(70_000)).unwrap();
        let mut two = [0; 2];
        stream.read_exact(&mut two).unwrap();
        assert_eq!((two.as_slice(), stream.place()), (&bytes[70_000..70_002], 70_002));
        assert!(stream.seek(SeekFrom::End(-300_000)).is_err());
    }

    #[test]
    fn more_than_there_is_is_refused_before_it_is_allocated() {
        let source = vec![1u8, 2, 3];
        assert_eq!(bytes_at(&source, 1, 2).unwrap(), [2, 3]);
        for (offset, count) in [(2, 2), (4, 0), (u64::MAX, 2), (0, u64::MAX)] {
            assert!(bytes_at(&source, offset, count).is_err(), "{offset} {count}");
        }
    }
}
