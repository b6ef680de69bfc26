//! Types of samples, and bytes to heights.

/// What a sample is in a file. All are held exactly as f64.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleType {
    /// Unsigned, 8 bits.
    U8,
    /// Signed, 8 bits.
    I8,
    /// Unsigned, 16 bits.
    U16,
    /// Signed, 16 bits.
    I16,
    /// Unsigned, 32 bits.
    U32,
    /// Signed, 32 bits.
    I32,
    /// IEEE 754, 32 bits.
    F32,
    /// IEEE 754, 64 bits.
    F64,
}

/// The order of the bytes of a number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ByteOrder {
    /// The least significant first.
    #[default]
    Little,
    /// The most significant first.
    Big,
}

impl SampleType {
    /// All types.
    pub const ALL: [SampleType; 8] = [
        SampleType::U8,
        SampleType::I8,
        SampleType::U16,
        SampleType::I16,
        SampleType::U32,
        SampleType::I32,
        SampleType::F32,
        SampleType::F64,
    ];

    /// Bytes of a sample.
    pub fn bytes(self) -> usize {
        match self {
            SampleType::U8 | SampleType::I8 => 1,
            SampleType::U16 | SampleType::I16 => 2,
            SampleType::U32 | SampleType::I32 | SampleType::F32 => 4,
            SampleType::F64 => 8,
        }
    }

    /// A short name: `i16`.
    pub fn name(self) -> &'static str {
        match self {
            SampleType::U8 => "u8",
            SampleType::I8 => "i8",
            SampleType::U16 => "u16",
            SampleType::I16 => "i16",
            SampleType::U32 => "u32",
            SampleType::I32 => "i32",
            SampleType::F32 => "f32",
            SampleType::F64 => "f64",
        }
    }

    /// A value as a sample of this type would hold it, so that comparing with samples is exact. (Of integers, what lies outside stays
    /// what it is, and equals none.)
    pub fn rounded(self, value: f64) -> f64 {
        match self {
            SampleType::F32 => f64::from(value as f32),
            _ => value,
        }
    }

    /// Reads as many samples as `out` has room for, from the first of every `step` samples in `bytes`.
    pub(super) fn decode(self, bytes: &[u8], order: ByteOrder, step: usize, out: &mut [f64]) {
        let size = self.bytes();
        let samples = bytes.chunks_exact(size * step.max(1)).zip(out);
        macro_rules! read {
            ($type:ty, $size:literal) => {
                for (sample, out) in samples {
                    let mut number = [0; $size];
                    number.copy_from_slice(&sample[..$size]);
                    *out = match order {
                        ByteOrder::Little => <$type>::from_le_bytes(number),
                        ByteOrder::Big => <$type>::from_be_bytes(number),
                    } as f64;
                }
            };
        }
        match self {
            SampleType::U8 => read!(u8, 1),
            SampleType::I8 => read!(i8, 1),
            SampleType::U16 => read!(u16, 2),
            SampleType::I16 => read!(i16, 2),
            SampleType::U32 => read!(u32, 4),
            SampleType::I32 => read!(i32, 4),
            SampleType::F32 => read!(f32, 4),
            SampleType::F64 => read!(f64, 8),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extreme_samples_are_exact() {
        let read = |t: SampleType, order, bytes: &[u8]| {
            let mut out = [0.0];
            t.decode(bytes, order, 1, &mut out);
            out[0]
        };
        let (little, big) = (ByteOrder::Little, ByteOrder::Big);
        assert_eq!(read(SampleType::I16, big, &[0x80, 0]), -32768.0);
        assert_eq!(read(SampleType::I16, little, &[0, 0x80]), -32768.0);
        assert_eq!(read(SampleType::U32, little, &[255; 4]), 4_294_967_295.0);
        assert_eq!(read(SampleType::I32, big, &[0x80, 0, 0, 0]), -2_147_483_648.0);
        assert_eq!(read(SampleType::I8, big, &[0x80]), -128.0);
        assert_eq!(read(SampleType::F32, big, &1e30f32.to_be_bytes()), f64::from(1e30f32));
        assert_eq!(read(SampleType::F64, little, &0.1f64.to_le_bytes()), 0.1);
    }

    #[test]
    fn the_first_of_interleaved_samples_is_taken() {
        let mut out = [0.0; 2];
        SampleType::U8.decode(&[1, 9, 9, 2, 9, 9], ByteOrder::Little, 3, &mut out);
        assert_eq!(out, [1.0, 2.0]);
    }
}
