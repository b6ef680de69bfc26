//! The containers of a glTF document: GLB chunks, data URIs, files beside it.

use super::json::{At, bad};
use crate::io::{DecodeError, Side};
use serde_json::Value;
use std::collections::HashMap;
use std::sync::Arc;

const GLB_MAGIC: &[u8; 4] = b"glTF";
const JSON_CHUNK: u32 = u32::from_le_bytes(*b"JSON");
const BIN_CHUNK: u32 = u32::from_le_bytes(*b"BIN\0");

/// A parsed document, and the binary chunk of a GLB.
#[derive(Debug)]
pub(super) struct Container {
    pub(super) document: Value,
    pub(super) binary: Option<Vec<u8>>,
    pub(super) warnings: Vec<String>,
}

/// Takes a `.gltf` or `.glb` apart; which one is seen from its first bytes.
pub(super) fn open(bytes: &[u8]) -> Result<Container, DecodeError> {
    if !bytes.starts_with(GLB_MAGIC) {
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        if !text.trim_ascii_start().starts_with(b"{") {
            let what = "neither a GLB (\"glTF\") nor a JSON object (\"{\") begins here".into();
            return Err(DecodeError::Byte { offset: 0, what });
        }
        let document = serde_json::from_slice(text)
            .map_err(|e| DecodeError::Line { line: e.line(), what: format!("JSON: {}", reason(&e)) })?;
        return Ok(Container { document, binary: None, warnings: Vec::new() });
    }
    let word = |offset: usize| match bytes.get(offset..offset.saturating_add(4)) {
        Some(w) => Ok(u32::from_le_bytes([w[0], w[1], w[2], w[3]])),
        None => Err(cut(offset, "a 4-byte number of the GLB header")),
    };
    match word(4)? {
        2 => {}
        v => return Err(DecodeError::Unsupported { what: format!("GLB version {v}") }),
    }
    let length = word(8)? as usize;
    if length > bytes.len() {
        return Err(cut(bytes.len(), &format!("the {length} bytes that its header announces")));
    }
    let mut warnings = Vec::new();
    if length < bytes.len() {
        warnings.push(format!("{} bytes after the end of the GLB were not read", bytes.len() - length));
    }
    let (mut document, mut binary, mut offset, mut chunks) = (None, None, 12, 0);
    while offset < length {
        let (size, kind) = (word(offset)? as usize, word(offset.saturating_add(4))?);
        let start = offset.saturating_add(8);
        let end = start.checked_add(size).filter(|&e| e <= length);
        let end = end.ok_or_else(|| DecodeError::Byte {
            offset,
            what: format!(
                "a chunk of {size} bytes begins here, and {} are left",
                length.saturating_sub(start)
            ),
        })?;
        let Some(chunk) = bytes.get(start..end) else { return Err(cut(start, "a chunk")) };
        match (chunks, kind) {
            (0, JSON_CHUNK) => {
                document = Some(serde_json::from_slice::<Value>(chunk).map_err(|e| {
                    let what = format!("line {} column {}: {}", e.line(), e.column(), reason(&e));
                    bad("JSON chunk", what)
                })?);
            }
            (0, _) => {
                return Err(DecodeError::Byte {
                    offset,
                    what: "the first chunk must be of type JSON".into(),
                });
            }
            (1, BIN_CHUNK) => binary = Some(chunk.to_vec()),
            // The specification: chunks of unknown type must be ignored.
            _ => {}
        }
        chunks += 1;
        // Chunks are padded to 4 bytes; an exporter that left the padding out of the length still reads.
        offset = end;
    }
    let document = document.ok_or_else(|| cut(12, "the JSON chunk"))?;
    Ok(Container { document, binary, warnings })
}

fn cut(offset: usize, what: &str) -> DecodeError {
    DecodeError::Byte { offset, what: format!("the file ends before {what}") }
}

/// The parser's words without its own line and column.
fn reason(e: &serde_json::Error) -> String {
    let text = e.to_string();
    text.rsplit_once(" at line ").map_or(text.clone(), |(what, _)| what.to_string())
}

/// Puts a GLB together. Bytes are padded as the format asks. Errors when it would pass 4 GiB, with the size.
pub(super) fn glb(document: &Value, binary: &[u8]) -> Result<Vec<u8>, usize> {
    let json = document.to_string();
    let json_len = json.len().next_multiple_of(4);
    let bin_len = binary.len().next_multiple_of(4);
    let total = 12 + 8 + json_len + if binary.is_empty() { 0 } else { 8 + bin_len };
    let total32 = u32::try_from(total).map_err(|_| total)?;
    let mut out = Vec::with_capacity(total);
    out.extend_from_slice(GLB_MAGIC);
    out.extend(2u32.to_le_bytes());
    out.extend(total32.to_le_bytes());
    out.extend((json_len as u32).to_le_bytes());
    out.extend(JSON_CHUNK.to_le_bytes());
    out.extend_from_slice(json.as_bytes());
    out.resize(20 + json_len, b' ');
    if !binary.is_empty() {
        out.extend((bin_len as u32).to_le_bytes());
        out.extend(BIN_CHUNK.to_le_bytes());
        out.extend_from_slice(binary);
        out.resize(total, 0);
    }
    Ok(out)
}

/// The bytes and media type of a data URI; `None` if `uri` is none.
pub(super) fn data_uri(uri: &str) -> Option<Result<(String, Vec<u8>), String>> {
    let rest = uri.get(..5).filter(|s| s.eq_ignore_ascii_case("data:")).map(|_| &uri[5..])?;
    let Some((head, body)) = rest.split_once(',') else {
        return Some(Err("data URI without a comma".into()));
    };
    let mime = head.split(';').next().unwrap_or_default().to_string();
    let bytes = if head.to_ascii_lowercase().ends_with(";base64") { base64(body) } else { Ok(percent(body)) };
    Some(bytes.map(|b| (mime, b)))
}

/// Standard or URL-safe base64, padded or not.
fn base64(text: &str) -> Result<Vec<u8>, String> {
    use ::base64::Engine;
    use ::base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
    let config = GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true);
    let plain: Vec<u8> = percent(text).into_iter().filter(|b| !b.is_ascii_whitespace()).collect();
    let alphabet = if plain.iter().any(|b| matches!(b, b'-' | b'_')) {
        ::base64::alphabet::URL_SAFE
    } else {
        ::base64::alphabet::STANDARD
    };
    GeneralPurpose::new(&alphabet, config).decode(plain).map_err(|e| format!("base64: {e}"))
}

/// Undoes percent-encoding.
pub(super) fn percent(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        let hex = |k: usize| bytes.get(i + k).and_then(|&b| (b as char).to_digit(16));
        match (bytes[i], hex(1), hex(2)) {
            (b'%', Some(h), Some(l)) => {
                out.push((h * 16 + l) as u8);
                i += 3;
            }
            (b, ..) => {
                out.push(b);
                i += 1;
            }
        }
    }
    out
}

/// True if `uri` names a place on a network or a scheme of its own, not a file beside the document.
pub(super) fn is_remote(uri: &str) -> bool {
    uri.split_once(':').is_some_and(|(scheme, _)| {
        scheme.len() > 1 && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    })
}

/// Loads a file that a URI names: by its decoded name first, then as written.
pub(super) fn load(side: &dyn Side, uri: &str) -> Result<Vec<u8>, DecodeError> {
    let error = |why: String| DecodeError::Side { name: uri.to_string(), why };
    if is_remote(uri) {
        return Err(error("is not a file beside the document".into()));
    }
    let decoded = String::from_utf8_lossy(&percent(uri)).into_owned();
    side.load(&decoded)
        .or_else(|e| if decoded == uri { Err(e) } else { side.load(uri).map_err(|_| e) })
        .map_err(|e| error(e.to_string()))
}

/// The bytes of every buffer; `None` for one without data (a fallback of a compressed view).
pub(super) type Buffers = Vec<Option<Arc<Vec<u8>>>>;

/// Finds the bytes of all buffers. The same file named twice is loaded once.
pub(super) fn buffers(
    document: &At<'_>,
    binary: Option<Vec<u8>>,
    side: &dyn Side,
) -> Result<Buffers, DecodeError> {
    let mut binary = binary.map(Arc::new);
    let mut loaded: HashMap<&str, Arc<Vec<u8>>> = HashMap::new();
    let mut out = Vec::new();
    for (i, buffer) in document.list("buffers")?.into_iter().enumerate() {
        let want = buffer.need("byteLength")?.uint()?;
        let fallback = super::MESHOPT.iter().any(|name| {
            buffer
                .extension(name)
                .and_then(|e| e.get("fallback"))
                .is_some_and(|f| f.value == &Value::Bool(true))
        });
        let data = match buffer.get("uri") {
            _ if fallback => None,
            Some(uri) => {
                let name = uri.string()?;
                Some(match (loaded.get(name), data_uri(name)) {
                    (Some(known), _) => known.clone(),
                    (None, Some(data)) => Arc::new(data.map_err(|why| uri.bad(why))?.1),
                    (None, None) => {
                        let data = Arc::new(load(side, name)?);
                        loaded.insert(name, data.clone());
                        data
                    }
                })
            }
            None if i == 0 => binary.take(),
            None => None,
        };
        if let Some(have) = data.as_ref().map(|d| d.len()).filter(|&have| have < want) {
            return Err(buffer.bad(format!("byteLength {want}: only {have} bytes are there")));
        }
        out.push(data);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_glb_comes_apart_as_it_was_put_together() {
        let document = json!({"asset": {"version": "2.0"}});
        let bytes = glb(&document, &[1, 2, 3]).unwrap();
        assert_eq!(bytes.len() % 4, 0);
        let back = open(&bytes).unwrap();
        assert_eq!((back.document, back.binary), (document, Some(vec![1, 2, 3, 0])));
    }

    #[test]
    fn a_chunk_longer_than_the_file_is_an_error_at_its_byte() {
        let mut bytes = glb(&json!({}), &[1, 2, 3, 4]).unwrap();
        let at = 20 + 4;
        bytes[at] = 200;
        let e = open(&bytes).unwrap_err().to_string();
        assert_eq!(e, "byte 24: a chunk of 200 bytes begins here, and 4 are left");
        for n in 0..bytes.len() {
            assert!(open(&bytes[..n]).is_err(), "{n}");
        }
    }

    #[test]
    fn bad_json_names_the_line() {
        let e = open(b"{\n\"asset\": }").unwrap_err().to_string();
        assert_eq!(e, "line 2: JSON: expected value");
        assert!(open(b"solid x").unwrap_err().to_string().starts_with("byte 0"));
    }

    #[test]
    fn data_uris_of_both_kinds_decode() {
        let of = |u: &str| data_uri(u).map(|r| r.map(|x| x.1));
        assert_eq!(of("data:application/octet-stream;base64,AQID"), Some(Ok(vec![1, 2, 3])));
        assert_eq!(of("data:;base64,AQI="), Some(Ok(vec![1, 2])));
        assert_eq!(of("data:text/plain,a%20b"), Some(Ok(b"a b".to_vec())));
        assert_eq!(of("mesh.bin"), None);
        assert!(matches!(of("data:;base64,A"), Some(Err(_))));
        assert!(matches!(of("data:nothing"), Some(Err(_))));
        assert_eq!(of("dataé"), None);
    }
}
