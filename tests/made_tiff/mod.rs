//! TIFF files for tests, in shapes that no encoder at hand writes: tiles, predictor 3, big-endian, several bands.
#![allow(unreachable_pub)]

use progmesh::io::grid::SampleType;
use std::io::Write;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packing {
    None,
    Lzw,
    Deflate,
}

impl Packing {
    pub fn pack(self, bytes: &[u8]) -> Vec<u8> {
        match self {
            Packing::None => bytes.to_vec(),
            Packing::Lzw => {
                weezl::encode::Encoder::with_tiff_size_switch(weezl::BitOrder::Msb, 8).encode(bytes).unwrap()
            }
            Packing::Deflate => {
                let mut e = flate2::write::ZlibEncoder::new(vec![], flate2::Compression::fast());
                e.write_all(bytes).unwrap();
                e.finish().unwrap()
            }
        }
    }

    fn code(self) -> u64 {
        match self {
            Packing::None => 1,
            Packing::Lzw => 5,
            Packing::Deflate => 8,
        }
    }
}

/// A file to be; the first band has the heights, others their number.
#[derive(Clone)]
pub struct Made<'a> {
    pub sample: SampleType,
    pub size: [usize; 2],
    pub heights: &'a [f64],
    pub announced: [usize; 2],
    pub bands: usize,
    pub planar: bool,
    pub tile: Option<usize>,
    pub rows_per_strip: u32,
    pub big_endian: bool,
    pub big_tiff: bool,
    pub packing: Packing,
    pub compression: Option<u64>,
    pub bits: Option<u64>,
    pub predictor: u64,
    pub nodata: Option<String>,
    pub keys: Vec<u16>,
    pub doubles: Vec<(u16, Vec<f64>)>,
    /// Tiles to leave out.
    pub missing: Vec<usize>,
}

impl<'a> Made<'a> {
    pub fn new(sample: SampleType, columns: usize, rows: usize, heights: &'a [f64]) -> Self {
        Made {
            sample,
            size: [columns, rows],
            heights,
            announced: [columns, rows],
            bands: 1,
            planar: false,
            tile: None,
            rows_per_strip: 4,
            big_endian: false,
            big_tiff: false,
            packing: Packing::None,
            compression: None,
            bits: None,
            predictor: 1,
            nodata: None,
            keys: vec![],
            doubles: vec![],
            missing: vec![],
        }
    }

    fn number(&self, value: f64) -> Vec<u8> {
        macro_rules! bytes {
            ($type:ty) => {
                if self.big_endian {
                    (value as $type).to_be_bytes().to_vec()
                } else {
                    (value as $type).to_le_bytes().to_vec()
                }
            };
        }
        match self.sample {
            SampleType::U8 => bytes!(u8),
            SampleType::I8 => bytes!(i8),
            SampleType::U16 => bytes!(u16),
            SampleType::I16 => bytes!(i16),
            SampleType::U32 => bytes!(u32),
            SampleType::I32 => bytes!(i32),
            SampleType::F32 => bytes!(f32),
            SampleType::F64 => bytes!(f64),
        }
    }

    fn whole(&self, value: u64, size: usize) -> Vec<u8> {
        if self.big_endian {
            value.to_be_bytes()[8 - size..].to_vec()
        } else {
            value.to_le_bytes()[..size].to_vec()
        }
    }

    /// A row of a chunk, its predictor applied. `band`: one of planes, or all interleaved.
    fn row(&self, column: usize, row: usize, columns: usize, band: Option<usize>) -> Vec<u8> {
        let value = |c: usize, band: usize| match band {
            0 if c < self.size[0] && row < self.size[1] => self.heights[row * self.size[0] + c],
            band => band as f64,
        };
        let bands = if band.is_some() { 1 } else { self.bands };
        let numbers: Vec<Vec<u8>> = (0..columns * bands)
            .map(|i| self.number(value(column + i / bands, band.unwrap_or(i % bands))))
            .collect();
        let size = self.sample.bytes();
        match self.predictor {
            2 => {
                let as_whole = |n: &[u8]| {
                    let bytes: Vec<u8> =
                        if self.big_endian { n.to_vec() } else { n.iter().rev().copied().collect() };
                    bytes.iter().fold(0u64, |n, &b| n << 8 | u64::from(b))
                };
                let difference = |i: usize| {
                    let before = if i < bands { 0 } else { as_whole(&numbers[i - bands]) };
                    self.whole(as_whole(&numbers[i]).wrapping_sub(before), size)
                };
                (0..numbers.len()).flat_map(difference).collect()
            }
            3 if matches!(self.sample, SampleType::F32 | SampleType::F64) => {
                let byte =
                    |n: &[u8], plane: usize| if self.big_endian { n[plane] } else { n[size - 1 - plane] };
                let planes: Vec<u8> =
                    (0..size).flat_map(|p| numbers.iter().map(move |n| byte(n, p))).collect();
                let before = |i: usize| if i < bands { 0 } else { planes[i - bands] };
                (0..planes.len()).map(|i| planes[i].wrapping_sub(before(i))).collect()
            }
            _ => numbers.concat(),
        }
    }

    fn chunks(&self) -> Vec<Vec<u8>> {
        let [columns, rows] = self.size;
        let planes = if self.planar { self.bands } else { 1 };
        let mut chunks = vec![];
        for plane in 0..planes {
            let band = self.planar.then_some(plane);
            let (w, h) = match self.tile {
                Some(t) => (t, t),
                None => (columns, (self.rows_per_strip as usize).min(rows)),
            };
            for top in (0..rows).step_by(h) {
                // Tiles at the edge are whole, strips are not.
                let here = if self.tile.is_some() { h } else { h.min(rows - top) };
                for left in (0..columns).step_by(w) {
                    let raw: Vec<u8> = (top..top + here).flat_map(|r| self.row(left, r, w, band)).collect();
                    chunks.push(if self.missing.contains(&chunks.len()) {
                        vec![]
                    } else {
                        self.packing.pack(&raw)
                    });
                }
            }
        }
        chunks
    }

    pub fn bytes(&self) -> Vec<u8> {
        let chunks = self.chunks();
        let (long, word) = if self.big_tiff { (16u16, 8) } else { (4, 4) };
        let shorts = |v: &[u64]| v.iter().flat_map(|&n| self.whole(n, 2)).collect::<Vec<u8>>();
        let longs = |v: &[u64]| v.iter().flat_map(|&n| self.whole(n, word)).collect::<Vec<u8>>();
        let format = match self.sample {
            SampleType::F32 | SampleType::F64 => 3,
            SampleType::I8 | SampleType::I16 | SampleType::I32 => 2,
            _ => 1,
        };
        let bits = self.bits.unwrap_or(8 * self.sample.bytes() as u64);
        let mut tags: Vec<(u16, u16, u64, Vec<u8>)> = vec![
            (256, 4, 1, self.whole(self.announced[0] as u64, 4)),
            (257, 4, 1, self.whole(self.announced[1] as u64, 4)),
            (258, 3, self.bands as u64, shorts(&vec![bits; self.bands])),
            (259, 3, 1, shorts(&[self.compression.unwrap_or(self.packing.code())])),
            (262, 3, 1, shorts(&[1])),
            (277, 3, 1, shorts(&[self.bands as u64])),
            (284, 3, 1, shorts(&[if self.planar { 2 } else { 1 }])),
            (317, 3, 1, shorts(&[self.predictor])),
            (339, 3, self.bands as u64, shorts(&vec![format; self.bands])),
        ];
        let n = chunks.len() as u64;
        let counts: Vec<u64> = chunks.iter().map(|c| c.len() as u64).collect();
        let tables = match self.tile {
            Some(t) => {
                tags.push((322, 4, 1, self.whole(t as u64, 4)));
                tags.push((323, 4, 1, self.whole(t as u64, 4)));
                (324, 325)
            }
            None => {
                tags.push((278, 4, 1, self.whole(u64::from(self.rows_per_strip), 4)));
                (273, 279)
            }
        };
        tags.push((tables.0, long, n, longs(&vec![0; chunks.len()])));
        tags.push((tables.1, long, n, longs(&counts)));
        for (tag, values) in &self.doubles {
            let bytes = values.iter().flat_map(|v| self.whole(v.to_bits(), 8)).collect();
            tags.push((*tag, 12, values.len() as u64, bytes));
        }
        if !self.keys.is_empty() {
            let keys: Vec<u64> = self.keys.iter().map(|&k| k.into()).collect();
            tags.push((34735, 3, keys.len() as u64, shorts(&keys)));
        }
        if let Some(text) = &self.nodata {
            let bytes = [text.as_bytes(), &[0]].concat();
            tags.push((42113, 2, bytes.len() as u64, bytes));
        }
        tags.sort_by_key(|t| t.0);
        let start = self.head(&tags, word).len() as u64;
        let mut at = start;
        let offsets: Vec<u64> = counts
            .iter()
            .map(|&c| {
                at += c;
                if c == 0 { 0 } else { at - c }
            })
            .collect();
        for tag in &mut tags {
            if tag.0 == tables.0 {
                tag.3 = longs(&offsets);
            }
        }
        [self.head(&tags, word), chunks.concat()].concat()
    }

    /// Everything before the chunks.
    fn head(&self, tags: &[(u16, u16, u64, Vec<u8>)], word: usize) -> Vec<u8> {
        let mut out = if self.big_endian { b"MM".to_vec() } else { b"II".to_vec() };
        if self.big_tiff {
            out.extend([self.whole(43, 2), self.whole(8, 2), self.whole(0, 2), self.whole(16, 8)].concat());
        } else {
            out.extend([self.whole(42, 2), self.whole(8, 4)].concat());
        }
        out.extend(self.whole(tags.len() as u64, if self.big_tiff { 8 } else { 2 }));
        let mut after = out.len() + tags.len() * (4 + 2 * word) + word;
        let mut values: Vec<u8> = vec![];
        for (tag, kind, count, bytes) in tags {
            out.extend([self.whole((*tag).into(), 2), self.whole((*kind).into(), 2)].concat());
            out.extend(self.whole(*count, word));
            if bytes.len() <= word {
                out.extend(bytes);
                out.resize(out.len() + word - bytes.len(), 0);
            } else {
                out.extend(self.whole(after as u64, word));
                after += bytes.len();
                values.extend(bytes);
            }
        }
        out.extend(self.whole(0, word));
        out.extend(values);
        out
    }
}
