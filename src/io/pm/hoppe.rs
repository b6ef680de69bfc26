//! Hoppe's `.pm` files: told from ours.

use super::DecodedProgressive;
use crate::io::DecodeError;

/// True if the bytes begin as Hoppe's files do: comment lines, then `PM`.
pub fn looks_like(bytes: &[u8]) -> bool {
    let mut rest = bytes;
    while rest.first() == Some(&b'#') {
        match rest.iter().position(|&b| b == b'\n') {
            Some(end) => rest = &rest[end + 1..],
            None => return false,
        }
    }
    rest.starts_with(b"PM\n") || rest.starts_with(b"PM\r\n")
}

/// Reads a file.
///
/// Errors: damage. Never panics, whatever the bytes.
pub fn decode(_bytes: &[u8]) -> Result<DecodedProgressive, DecodeError> {
    Err(DecodeError::Unsupported { what: "Hoppe's format of progressive meshes".into() })
}
