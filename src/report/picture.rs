//! Pictures: rows of pixels, put side by side, written as PNG.

use super::font;

/// Colours of 8 bits a channel, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    width: u32,
    height: u32,
    /// Red, green, blue of every pixel.
    rgb: Vec<u8>,
}

/// Screen pixels that a pixel of a caption's letter takes.
const LETTER: u32 = 2;
/// Pixels from a caption to the picture's edge.
const MARGIN: u32 = 10;

impl Picture {
    /// A picture of one colour.
    pub fn new(width: u32, height: u32, color: [u8; 3]) -> Picture {
        Picture { width, height, rgb: color.repeat(width as usize * height as usize) }
    }

    /// Pixels across.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Pixels from top to bottom.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Red, green and blue of a pixel, from the left and from the top; `None` outside.
    pub fn pixel(&self, x: u32, y: u32) -> Option<[u8; 3]> {
        let at = self.offset(x, y)?;
        Some([self.rgb[at], self.rgb[at + 1], self.rgb[at + 2]])
    }

    /// Colours a pixel; nothing happens outside.
    pub fn set(&mut self, x: u32, y: u32, color: [u8; 3]) {
        if let Some(at) = self.offset(x, y) {
            self.rgb[at..at + 3].copy_from_slice(&color);
        }
    }

    fn offset(&self, x: u32, y: u32) -> Option<usize> {
        (x < self.width && y < self.height).then(|| 3 * (y as usize * self.width as usize + x as usize))
    }

    /// The pictures from left to right, their tops aligned; what is missing below one is `color`.
    pub fn beside(pictures: &[Picture], color: [u8; 3]) -> Picture {
        let width = pictures.iter().map(|p| p.width).sum();
        let height = pictures.iter().map(|p| p.height).max().unwrap_or(0);
        let mut out = Picture::new(width, height, color);
        let mut left = 0;
        for p in pictures {
            for y in 0..p.height as usize {
                let row = 3 * p.width as usize;
                let to = 3 * (y * width as usize + left as usize);
                out.rgb[to..to + row].copy_from_slice(&p.rgb[y * row..(y + 1) * row]);
            }
            left += p.width;
        }
        out
    }

    /// The picture with this many rows of one colour below it: a place for a caption.
    pub fn with_strip_below(mut self, rows: u32, color: [u8; 3]) -> Picture {
        self.rgb.extend(color.repeat(self.width as usize * rows as usize));
        self.height += rows;
        self
    }

    /// Writes digits, commas and the letters of "triangles shown instanced" at the lower left, in the last 28 rows; other characters leave
    /// a gap.
    pub fn caption(&mut self, text: &str, color: [u8; 3]) {
        let top = self.height.saturating_sub(MARGIN + font::HEIGHT * LETTER);
        for (k, letter) in text.chars().enumerate() {
            let left = MARGIN + k as u32 * (font::WIDTH + 1) * LETTER;
            for (row, bits) in (0u32..).zip(font::rows(letter)) {
                for column in (0..font::WIDTH).filter(|c| bits >> (font::WIDTH - 1 - c) & 1 == 1) {
                    for (dx, dy) in (0..LETTER * LETTER).map(|i| (i % LETTER, i / LETTER)) {
                        self.set(left + column * LETTER + dx, top + row * LETTER + dy, color);
                    }
                }
            }
        }
    }

    /// The picture as a PNG file; `None` if it has no pixels, which PNG cannot hold.
    pub fn png(&self) -> Option<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        let mut writer = encoder.write_header().ok()?;
        writer.write_image_data(&self.rgb).ok()?;
        writer.finish().ok()?;
        Some(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_side_by_side() {
        let p = Picture::beside(&[Picture::new(2, 3, [1; 3]), Picture::new(1, 1, [2; 3])], [9; 3]);
        assert_eq!((p.width(), p.height()), (3, 3));
        let colors = [(1, 2), (2, 0), (2, 1)].map(|(x, y)| p.pixel(x, y));
        assert_eq!(colors, [Some([1; 3]), Some([2; 3]), Some([9; 3])]);
        assert_eq!(p.pixel(3, 0), None);
    }

    #[test]
    fn a_png_holds_the_pixels_and_none_is_no_png() {
        let mut p = Picture::new(40, 40, [200, 100, 50]);
        p.caption("1", [0; 3]);
        let bytes = p.png().unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height, &pixels), (40, 40, &p.rgb));
        // The 1 has 10 pixels of 2 x 2.
        assert_eq!(p.rgb.chunks(3).filter(|c| c == &[0; 3]).count(), 40);
        assert_eq!(Picture::new(0, 4, [0; 3]).png(), None);
    }
}
