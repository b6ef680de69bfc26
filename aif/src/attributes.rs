//! Attributes of corners: channels of values, shared through wedges.
//!
//! A corner is a (face, vertex) pair. Corners of a vertex with the same attribute values share a *wedge*
//! (Hoppe 1996); a vertex on a uv seam or a sharp crease has several. Every wedge holds a row of f32 values, laid out by
//! the channels, and a bit for each channel that says whether the input gave it a value at all.

use crate::ids::NONE;

/// What a channel means.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Semantic {
    /// Unit normal, width 3.
    Normal,
    /// Unit tangent and handedness, width 4.
    Tangent,
    /// Texture coordinates, set k, width 2.
    TexCoord(u8),
    /// Colour, set k, linear values as stored, width 3 or 4.
    Color(u8),
    /// Joint indices, set k, width 4; they go with the weights of the same set.
    Joints(u8),
    /// Joint weights, set k, width 4.
    Weights(u8),
    /// Displacement of the position by morph target k, width 3.
    MorphPosition(u16),
    /// Displacement of the normal by morph target k, width 3.
    MorphNormal(u16),
    /// Displacement of the tangent by morph target k, width 3.
    MorphTangent(u16),
    /// Anything else, by name; of any width.
    Custom(String),
}

/// How the input stored a channel: a hint for writers, the values are always f32.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Encoding {
    /// 32-bit float.
    #[default]
    F32,
    /// 64-bit float; values were narrowed to f32.
    F64,
    /// Unsigned byte, value as it is.
    U8,
    /// Unsigned byte, 255 = 1.0.
    U8Norm,
    /// Signed byte, value as it is.
    I8,
    /// Signed byte, 127 = 1.0.
    I8Norm,
    /// Unsigned 16-bit, value as it is.
    U16,
    /// Unsigned 16-bit, 65535 = 1.0.
    U16Norm,
    /// Signed 16-bit, value as it is.
    I16,
    /// Signed 16-bit, 32767 = 1.0.
    I16Norm,
    /// Unsigned 32-bit, value as it is (exact up to 2^24).
    U32,
    /// Signed 32-bit, value as it is (exact up to 2^24).
    I32,
}

impl Encoding {
    /// All of them, in the order that `.pm` files number them in: new ones come last.
    pub const ALL: [Encoding; 12] = [
        Encoding::F32,
        Encoding::F64,
        Encoding::U8,
        Encoding::U8Norm,
        Encoding::I8,
        Encoding::I8Norm,
        Encoding::U16,
        Encoding::U16Norm,
        Encoding::I16,
        Encoding::I16Norm,
        Encoding::U32,
        Encoding::I32,
    ];
}

/// One attribute: its meaning, how many numbers it takes, how it was stored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// What it means.
    pub semantic: Semantic,
    /// Numbers per wedge, at least 1.
    pub width: usize,
    /// How the input stored it.
    pub encoding: Encoding,
}

impl Channel {
    /// A channel stored as f32.
    pub fn new(semantic: Semantic, width: usize) -> Self {
        Channel { semantic, width, encoding: Encoding::F32 }
    }

    /// True if values may be averaged (all but joint indices).
    pub fn interpolates(&self) -> bool {
        !matches!(self.semantic, Semantic::Joints(_))
    }
}

/// Attribute values of the corners of a mesh.
///
/// `corner[c]` is the wedge of corner slot `c`, or [`NONE`] for a corner without attributes.
/// At most 64 channels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wedges {
    channels: Vec<Channel>,
    offsets: Vec<usize>,
    stride: usize,
    values: Vec<f32>,
    present: Vec<u64>,
    /// The wedge of every corner slot.
    pub corner: Vec<u32>,
}

/// More channels than the 64 a wedge has presence bits for.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0} attribute channels: at most 64 are supported; remove some (morph targets take one each)")]
pub struct TooManyChannels(pub usize);

impl Wedges {
    /// No wedge yet, with these channels. Errors with more than 64 channels.
    pub fn new(channels: Vec<Channel>) -> Result<Self, TooManyChannels> {
        if channels.len() > 64 {
            return Err(TooManyChannels(channels.len()));
        }
        let mut offsets = Vec::with_capacity(channels.len());
        let mut stride = 0;
        for c in &channels {
            offsets.push(stride);
            stride += c.width;
        }
        Ok(Wedges { channels, offsets, stride, ..Default::default() })
    }

    /// The channels, in order.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Index of the channel with this meaning.
    pub fn channel(&self, semantic: &Semantic) -> Option<usize> {
        self.channels.iter().position(|c| c.semantic == *semantic)
    }

    /// Numbers in a wedge's row.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Where channel `k` begins in a row.
    pub fn offset(&self, k: usize) -> usize {
        self.offsets[k]
    }

    /// Number of wedges.
    pub fn len(&self) -> usize {
        self.present.len()
    }

    /// True if there is no wedge.
    pub fn is_empty(&self) -> bool {
        self.present.is_empty()
    }

    /// Adds a wedge: its row (`stride` numbers) and the channels it has (bit k for channel k). Returns its id.
    pub fn push(&mut self, row: &[f32], present: u64) -> u32 {
        assert_eq!(row.len(), self.stride, "a wedge's row has stride() numbers");
        self.values.extend_from_slice(row);
        self.present.push(present);
        (self.present.len() - 1) as u32
    }

    /// The row of wedge `w`: the values of all channels.
    #[inline]
    pub fn row(&self, w: u32) -> &[f32] {
        let w = w as usize;
        &self.values[w * self.stride..(w + 1) * self.stride]
    }

    /// The rows of all wedges, one after the other.
    pub fn rows(&self) -> &[f32] {
        &self.values
    }

    /// The row of wedge `w`, to change.
    #[inline]
    pub fn row_mut(&mut self, w: u32) -> &mut [f32] {
        let w = w as usize;
        &mut self.values[w * self.stride..(w + 1) * self.stride]
    }

    /// Which channels wedge `w` has, bit k for channel k.
    #[inline]
    pub fn present(&self, w: u32) -> u64 {
        self.present[w as usize]
    }

    /// Sets which channels wedge `w` has.
    #[inline]
    pub fn set_present(&mut self, w: u32, bits: u64) {
        self.present[w as usize] = bits;
    }

    /// Channel `k` of wedge `w`; `None` if that wedge has no value for it.
    pub fn get(&self, w: u32, k: usize) -> Option<&[f32]> {
        if w == NONE || self.present(w) >> k & 1 == 0 {
            return None;
        }
        let (o, n) = (self.offsets[k], self.channels[k].width);
        Some(&self.row(w)[o..o + n])
    }

    /// True if wedges `a` and `b` (either may be [`NONE`]) hold the same values, bit for bit (-0 = +0).
    pub fn same(&self, a: u32, b: u32) -> bool {
        if a == b {
            return true;
        }
        if a == NONE || b == NONE {
            return false;
        }
        self.present(a) == self.present(b)
            && self.row(a).iter().zip(self.row(b)).all(|(x, y)| (x + 0.0).to_bits() == (y + 0.0).to_bits())
    }

    /// Drops channel `k` from every wedge.
    pub fn remove_channel(&mut self, k: usize) {
        let (o, n, old) = (self.offsets[k], self.channels[k].width, self.stride);
        let values = self
            .values
            .chunks_exact(old.max(1))
            .flat_map(|r| r[..o].iter().chain(&r[o + n..]).copied())
            .collect();
        self.values = values;
        let low = (1u64 << k) - 1;
        for p in &mut self.present {
            *p = (*p & low) | (*p >> 1 & !low);
        }
        self.channels.remove(k);
        self.offsets.clear();
        self.stride = 0;
        for c in &self.channels {
            self.offsets.push(self.stride);
            self.stride += c.width;
        }
    }

    /// The wedges `old[i]`, in that order, with these corners.
    pub(crate) fn gather(&self, old: &[u32], corner: Vec<u32>) -> Self {
        let mut values = Vec::with_capacity(old.len() * self.stride);
        for &w in old {
            values.extend_from_slice(self.row(w));
        }
        Wedges {
            channels: self.channels.clone(),
            offsets: self.offsets.clone(),
            stride: self.stride,
            values,
            present: old.iter().map(|&w| self.present(w)).collect(),
            corner,
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        4 * (self.values.len() + self.corner.len()) + 8 * self.present.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_channels() -> Wedges {
        let mut w =
            Wedges::new(vec![Channel::new(Semantic::Normal, 3), Channel::new(Semantic::TexCoord(0), 2)])
                .unwrap();
        w.push(&[0.0, 0.0, 1.0, 0.25, 0.5], 0b11);
        w.push(&[-0.0, 0.0, 1.0, 0.25, 0.5], 0b11);
        w.push(&[0.0, 0.0, 1.0, 0.0, 0.0], 0b01);
        w
    }

    #[test]
    fn a_channel_that_a_wedge_lacks_reads_as_none() {
        let w = two_channels();
        assert_eq!(w.get(0, 1), Some(&[0.25, 0.5][..]));
        assert_eq!(w.get(2, 1), None);
        assert_eq!(w.get(NONE, 0), None);
    }

    #[test]
    fn sameness_is_by_bits_but_for_the_sign_of_zero() {
        let w = two_channels();
        assert!(w.same(0, 1));
        assert!(!w.same(0, 2));
        assert!(!w.same(0, NONE));
    }

    #[test]
    fn removing_a_channel_keeps_the_others() {
        let mut w = two_channels();
        w.remove_channel(0);
        assert_eq!(w.get(0, 0), Some(&[0.25, 0.5][..]));
        assert_eq!(w.get(2, 0), None);
        assert_eq!(w.stride(), 2);
    }

    #[test]
    fn sixty_five_channels_are_refused() {
        let c = vec![Channel::new(Semantic::Custom("x".into()), 1); 65];
        assert_eq!(Wedges::new(c), Err(TooManyChannels(65)));
    }
}
