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

/// Pixels of a dot of a caption's letters.
const LETTER: f64 = 2.0;
/// Pixels from a caption to the picture's edge.
const MARGIN: f64 = 10.0;

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

    /// Red, green and blue of every pixel, rows from the top.
    pub(super) fn rgb(&self) -> &[u8] {
        &self.rgb
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
            out.place(p, left, 0);
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

    /// Mixes `color` into a pixel: none of it at 0, nothing else at 1. Nothing happens outside.
    pub(super) fn blend(&mut self, x: u32, y: u32, color: [u8; 3], part: f64) {
        if let Some(at) = self.offset(x, y).filter(|_| part > 0.0) {
            for (old, new) in self.rgb[at..at + 3].iter_mut().zip(color.map(f64::from)) {
                *old = (*old as f64 + part.min(1.0) * (new - *old as f64)).round() as u8;
            }
        }
    }

    /// Puts a picture into this one, its upper left corner at (`left`, `top`); what reaches beyond is cut off.
    pub fn place(&mut self, other: &Picture, left: u32, top: u32) {
        let columns = other.width.min(self.width.saturating_sub(left)) as usize;
        for y in 0..other.height.min(self.height.saturating_sub(top)) {
            let to = 3 * ((top + y) as usize * self.width as usize + left as usize);
            let from = 3 * (y as usize * other.width as usize);
            self.rgb[to..to + 3 * columns].copy_from_slice(&other.rgb[from..from + 3 * columns]);
        }
    }

    /// Fills the rectangle from (`left`, `top`), as far as it lies inside.
    pub fn fill(&mut self, [left, top]: [u32; 2], [width, height]: [u32; 2], color: [u8; 3]) {
        for y in top..top.saturating_add(height).min(self.height) {
            for x in left..left.saturating_add(width).min(self.width) {
                self.set(x, y, color);
            }
        }
    }

    /// Writes a line of ASCII, capitals of seven `size` pixels with their upper left corner at (`x`, `y`); other characters become question marks.
    pub fn write(&mut self, x: f64, y: f64, size: f64, text: &str, color: [u8; 3]) {
        font::write(self, x, y, size, text, color);
    }

    /// Pixels across that [`Picture::write`] takes.
    pub fn text_width(text: &str, size: f64) -> f64 {
        font::width(text, size)
    }

    /// Writes a line of ASCII at the lower left.
    pub fn caption(&mut self, text: &str, color: [u8; 3]) {
        // Two dots below the base line are for g and the comma.
        let top = self.height as f64 - MARGIN - font::cap_height(LETTER) - 2.0 * LETTER;
        self.write(MARGIN, top.max(0.0), LETTER, text, color);
    }

    /// The picture as a PNG file; `None` if it has no pixels, which PNG cannot hold.
    pub fn png(&self) -> Option<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        // The best compression was a quarter of the time of a page of heat maps.
        encoder.set_compression(png::Compression::Balanced);
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
    fn what_is_placed_is_cut_at_the_edge() {
        let mut p = Picture::new(4, 4, [0; 3]);
        p.place(&Picture::new(3, 3, [7; 3]), 2, 3);
        p.place(&Picture::new(3, 3, [9; 3]), 9, 9);
        p.fill([0, 0], [1, 9], [5; 3]);
        let count = |c: u8| p.rgb.chunks(3).filter(|p| p[0] == c).count();
        assert_eq!((count(7), count(9), count(5)), (2, 0, 4));
        p.blend(3, 0, [100; 3], 0.25);
        assert_eq!(p.pixel(3, 0), Some([25; 3]));
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
        let inked = p.rgb.chunks(3).filter(|c| c[0] < 100).count();
        assert!((20..60).contains(&inked), "{inked}");
        assert_eq!(Picture::new(0, 4, [0; 3]).png(), None);
    }
}
