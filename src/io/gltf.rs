//! (being written)
use super::{DecodeError, Decoded, EncodeError, EncodeOptions, Encoded, Format, Side};
use crate::scene::Scene;
#[derive(Clone, Debug)]
pub struct Source {}
pub fn decode(_: &[u8], _: &dyn Side) -> Result<Decoded, DecodeError> { Err(DecodeError::Unsupported { what: "gltf".into() }) }
pub fn encode(_: &Scene, _: Format, _: &EncodeOptions) -> Result<Encoded, EncodeError> { Ok(Encoded::default()) }
