//! (being written)
use super::{Decoded, DecodeError, Encoded, EncodeError, EncodeOptions};
use crate::scene::Scene;
pub fn decode(_: &[u8]) -> Result<Decoded, DecodeError> { Err(DecodeError::Unsupported { what: "stl".into() }) }
pub fn encode(_: &Scene, _: &EncodeOptions) -> Result<Encoded, EncodeError> { Ok(Encoded::default()) }
