//! Pictures one after the other: animated PNG.

use super::picture::Picture;
use std::collections::BTreeSet;

/// The pictures as an animated PNG that begins again for ever, each shown for so many milliseconds. Readers that know no animation show the first.
///
/// Colours are rounded to multiples of 2, 4 or 8 of 255 where all pictures together then have at most 256, so that the file has a palette, which takes a third of the bytes; pictures of more
/// colours stay as they are. `None` without pictures, for pictures of several sizes or without pixels.
pub fn apng(pictures: &[Picture], milliseconds: u16) -> Option<Vec<u8>> {
    let first = pictures.first()?;
    if pictures.iter().any(|p| (p.width(), p.height()) != (first.width(), first.height())) {
        return None;
    }
    let palette = (0..=MOST_BITS).find_map(|bits| Some((bits, palette(pictures, bits)?)));
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, first.width(), first.height());
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    match &palette {
        Some((_, colors)) => {
            encoder.set_color(png::ColorType::Indexed);
            encoder.set_palette(colors.as_flattened().to_vec());
            encoder.set_filter(png::Filter::NoFilter);
        }
        None => encoder.set_color(png::ColorType::Rgb),
    }
    if pictures.len() > 1 {
        encoder.set_animated(u32::try_from(pictures.len()).ok()?, 0).ok()?;
        encoder.set_frame_delay(milliseconds, 1000).ok()?;
    }
    let mut writer = encoder.write_header().ok()?;
    for p in pictures {
        match &palette {
            Some((bits, colors)) => {
                let (pixels, _) = p.rgb().as_chunks::<3>();
                let index = |c: &[u8; 3]| colors.binary_search(&rounded(*c, *bits)).unwrap_or(0) as u8;
                writer.write_image_data(&pixels.iter().map(index).collect::<Vec<u8>>()).ok()?;
            }
            None => writer.write_image_data(p.rgb()).ok()?,
        }
    }
    writer.finish().ok()?;
    Some(bytes)
}

/// Bits that rounding may take from a channel: half a step of 8 is not seen in shaded surfaces.
const MOST_BITS: u32 = 3;

/// To the nearest multiple of so many bits; white stays white.
fn rounded(c: [u8; 3], bits: u32) -> [u8; 3] {
    let step = 1u32 << bits;
    c.map(|x| ((u32::from(x) + step / 2) / step * step).min(255) as u8)
}

/// All rounded colours, sorted, if one byte can count them.
fn palette(pictures: &[Picture], bits: u32) -> Option<Vec<[u8; 3]>> {
    let mut colors = BTreeSet::new();
    for p in pictures {
        let mut last = None;
        for c in p.rgb().as_chunks::<3>().0.iter().map(|c| rounded(*c, bits)) {
            if last != Some(c) && colors.insert(c) && colors.len() > 256 {
                return None;
            }
            last = Some(c);
        }
    }
    Some(colors.into_iter().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames as a decoder gives them, red, green and blue.
    fn frames(bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let count = reader.info().animation_control.map_or(1, |a| a.num_frames);
        let mut out = Vec::new();
        for _ in 0..count {
            let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut pixels).unwrap();
            out.push(pixels);
        }
        out
    }

    fn picture(k: u8, colors: u32, apart: u32) -> Picture {
        let mut p = Picture::new(30, 20, [8 * k; 3]);
        let at = |x: u32| (x * apart).min(255) as u8;
        (0..colors).for_each(|i| p.set(i % 30, i / 30, [8 * k, at(i % 25), at(i / 25)]));
        p
    }

    #[test]
    fn frames_come_out_as_they_went_in_with_few_colours_and_with_many() {
        // Differences: none with 40 colours, at most half a step of 4 with 500 that are near each other, none if they are far apart.
        for (colors, apart, most) in [(40, 1, 0), (500, 1, 2), (500, 8, 0)] {
            let all: Vec<Picture> = (0..4).map(|k| picture(k, colors, apart)).collect();
            let have = frames(&apng(&all, 40).unwrap());
            assert_eq!(have.len(), 4);
            let differences =
                have.iter().flatten().zip(all.iter().flat_map(|p| p.rgb())).map(|(a, b)| a.abs_diff(*b));
            assert_eq!(differences.max(), Some(most), "{colors} {apart}");
        }
        // One is a picture.
        assert_eq!(frames(&apng(&[picture(1, 3, 1)], 40).unwrap()).len(), 1);
    }

    #[test]
    fn what_is_no_animation() {
        assert_eq!(apng(&[], 40), None);
        assert_eq!(apng(&[Picture::new(2, 2, [0; 3]), Picture::new(2, 3, [0; 3])], 40), None);
        assert_eq!(apng(&[Picture::new(0, 2, [0; 3])], 40), None);
    }
}
