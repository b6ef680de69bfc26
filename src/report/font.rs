//! Letters: ASCII on a grid of 5 x 9 dots, drawn as smooth strokes from dot to dot at any size.

use super::picture::Picture;

/// Dots of a letter across, without the gap to the next.
const WIDTH: usize = 5;
/// Dots from top to bottom; the base line is under the seventh.
const HEIGHT: usize = 9;
/// Half the breadth of a stroke, in dots.
const HALF_STROKE: f64 = 0.44;

/// From the top of a capital to the base line, in pixels, for dots of `size` pixels.
pub(super) fn cap_height(size: f64) -> f64 {
    7.0 * size
}

/// Pixels across that a text takes, the gap after it left out.
pub(super) fn width(text: &str, size: f64) -> f64 {
    let letters = text.chars().count() as f64;
    (letters * (WIDTH + 1) as f64 - 1.0).max(0.0) * size
}

/// Writes a text whose capitals have their upper left corner at (`x`, `y`). What has no letter becomes a question mark.
pub(super) fn write(picture: &mut Picture, x: f64, y: f64, size: f64, text: &str, color: [u8; 3]) {
    for (k, letter) in text.chars().enumerate() {
        let left = x + k as f64 * (WIDTH + 1) as f64 * size;
        if left > picture.width() as f64 {
            return;
        }
        draw(picture, left, y, size, rows(letter).unwrap_or(UNKNOWN), color);
    }
}

fn draw(picture: &mut Picture, x: f64, y: f64, size: f64, rows: [u8; HEIGHT], color: [u8; 3]) {
    let strokes = strokes(&rows);
    let (right, bottom) = (x + WIDTH as f64 * size, y + HEIGHT as f64 * size);
    // Never finer than a pixel, or strokes fade.
    let half = (HALF_STROKE * size).max(0.5);
    for row in (y - 1.0).max(0.0) as u32..=(bottom + 1.0).max(0.0) as u32 {
        for column in (x - 1.0).max(0.0) as u32..=(right + 1.0).max(0.0) as u32 {
            // In dots, whose middles are at whole numbers.
            let p = [(column as f64 + 0.5 - x) / size - 0.5, (row as f64 + 0.5 - y) / size - 0.5];
            let nearest = strokes.iter().map(|s| to_stroke(p, s)).fold(f64::INFINITY, f64::min);
            picture.blend(column, row, color, half + 0.5 - nearest.sqrt() * size);
        }
    }
}

/// The strokes of a letter: between dots side by side, and between those corner to corner that no third dot joins.
fn strokes(rows: &[u8; HEIGHT]) -> Vec<[[i32; 2]; 2]> {
    let dot = |x: i32, y: i32| {
        (0..WIDTH as i32).contains(&x)
            && (0..HEIGHT as i32).contains(&y)
            && rows[y as usize] >> (WIDTH as i32 - 1 - x) & 1 == 1
    };
    let mut out = Vec::new();
    for y in 0..HEIGHT as i32 {
        for x in (0..WIDTH as i32).filter(|&x| dot(x, y)) {
            out.push([[x, y]; 2]);
            for (dx, dy) in [(1, 0), (0, 1), (1, 1), (-1, 1)] {
                let straight = dx == 0 || dy == 0;
                if dot(x + dx, y + dy) && (straight || !dot(x + dx, y) && !dot(x, y + dy)) {
                    out.push([[x, y], [x + dx, y + dy]]);
                }
            }
        }
    }
    out
}

/// The squared distance of a point from a stroke.
fn to_stroke(p: [f64; 2], stroke: &[[i32; 2]; 2]) -> f64 {
    let [a, b] = stroke.map(|e| e.map(f64::from));
    let (along, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length = along[0] * along[0] + along[1] * along[1];
    let t = if length > 0.0 { ((to[0] * along[0] + to[1] * along[1]) / length).clamp(0.0, 1.0) } else { 0.0 };
    let off = [to[0] - t * along[0], to[1] - t * along[1]];
    off[0] * off[0] + off[1] * off[1]
}

/// What stands for a character that has no letter.
const UNKNOWN: [u8; HEIGHT] = [0b01110, 0b10001, 0b00001, 0b00110, 0b00100, 0, 0b00100, 0, 0];

/// The rows of dots of a letter, top to bottom; bit 4 is the leftmost dot. `None` for what there is no letter for.
#[rustfmt::skip]
fn rows(letter: char) -> Option<[u8; HEIGHT]> {
    Some(match letter {
        ' ' => [0; HEIGHT],
        '!' => [0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0, 0b00100, 0, 0],
        '"' => [0b01010, 0b01010, 0, 0, 0, 0, 0, 0, 0],
        '#' => [0b01010, 0b01010, 0b11111, 0b01010, 0b11111, 0b01010, 0b01010, 0, 0],
        '$' => [0b00100, 0b01111, 0b10100, 0b01110, 0b00101, 0b11110, 0b00100, 0, 0],
        '%' => [0b11000, 0b11001, 0b00010, 0b00100, 0b01000, 0b10011, 0b00011, 0, 0],
        '&' => [0b01100, 0b10010, 0b10100, 0b01000, 0b10101, 0b10010, 0b01101, 0, 0],
        '\'' => [0b00100, 0b00100, 0, 0, 0, 0, 0, 0, 0],
        '(' => [0b00010, 0b00100, 0b01000, 0b01000, 0b01000, 0b00100, 0b00010, 0, 0],
        ')' => [0b01000, 0b00100, 0b00010, 0b00010, 0b00010, 0b00100, 0b01000, 0, 0],
        '*' => [0, 0b00100, 0b10101, 0b01110, 0b10101, 0b00100, 0, 0, 0],
        '+' => [0, 0b00100, 0b00100, 0b11111, 0b00100, 0b00100, 0, 0, 0],
        ',' => [0, 0, 0, 0, 0, 0b00100, 0b00100, 0b01000, 0],
        '-' => [0, 0, 0, 0b01110, 0, 0, 0, 0, 0],
        '.' => [0, 0, 0, 0, 0, 0, 0b00100, 0, 0],
        '/' => [0b00001, 0b00001, 0b00010, 0b00100, 0b01000, 0b10000, 0b10000, 0, 0],
        '0' => [0b01110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110, 0, 0],
        '1' => [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110, 0, 0],
        '2' => [0b01110, 0b10001, 0b00001, 0b00010, 0b00100, 0b01000, 0b11111, 0, 0],
        '3' => [0b01110, 0b10001, 0b00001, 0b00110, 0b00001, 0b10001, 0b01110, 0, 0],
        '4' => [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010, 0, 0],
        '5' => [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110, 0, 0],
        '6' => [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110, 0, 0],
        '7' => [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000, 0, 0],
        '8' => [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110, 0, 0],
        '9' => [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100, 0, 0],
        ':' => [0, 0, 0b00100, 0, 0, 0, 0b00100, 0, 0],
        ';' => [0, 0, 0b00100, 0, 0, 0b00100, 0b00100, 0b01000, 0],
        '<' => [0b00010, 0b00100, 0b01000, 0b10000, 0b01000, 0b00100, 0b00010, 0, 0],
        '=' => [0, 0, 0b11111, 0, 0b11111, 0, 0, 0, 0],
        '>' => [0b01000, 0b00100, 0b00010, 0b00001, 0b00010, 0b00100, 0b01000, 0, 0],
        '?' => UNKNOWN,
        '@' => [0b01110, 0b10001, 0b10111, 0b10101, 0b10111, 0b10000, 0b01110, 0, 0],
        'A' => [0b00100, 0b01010, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0, 0],
        'B' => [0b11110, 0b10001, 0b10001, 0b11110, 0b10001, 0b10001, 0b11110, 0, 0],
        'C' => [0b01110, 0b10001, 0b10000, 0b10000, 0b10000, 0b10001, 0b01110, 0, 0],
        'D' => [0b11110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b11110, 0, 0],
        'E' => [0b11111, 0b10000, 0b10000, 0b11110, 0b10000, 0b10000, 0b11111, 0, 0],
        'F' => [0b11111, 0b10000, 0b10000, 0b11110, 0b10000, 0b10000, 0b10000, 0, 0],
        'G' => [0b01110, 0b10001, 0b10000, 0b10111, 0b10001, 0b10001, 0b01110, 0, 0],
        'H' => [0b10001, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001, 0, 0],
        'I' => [0b01110, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110, 0, 0],
        'J' => [0b00111, 0b00010, 0b00010, 0b00010, 0b00010, 0b10010, 0b01100, 0, 0],
        'K' => [0b10001, 0b10010, 0b10100, 0b11000, 0b10100, 0b10010, 0b10001, 0, 0],
        'L' => [0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b11111, 0, 0],
        'M' => [0b10001, 0b11011, 0b10101, 0b10101, 0b10001, 0b10001, 0b10001, 0, 0],
        'N' => [0b10001, 0b10001, 0b11001, 0b10101, 0b10011, 0b10001, 0b10001, 0, 0],
        'O' => [0b01110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110, 0, 0],
        'P' => [0b11110, 0b10001, 0b10001, 0b11110, 0b10000, 0b10000, 0b10000, 0, 0],
        'Q' => [0b01110, 0b10001, 0b10001, 0b10001, 0b10101, 0b10010, 0b01101, 0, 0],
        'R' => [0b11110, 0b10001, 0b10001, 0b11110, 0b10100, 0b10010, 0b10001, 0, 0],
        'S' => [0b01111, 0b10000, 0b10000, 0b01110, 0b00001, 0b00001, 0b11110, 0, 0],
        'T' => [0b11111, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0, 0],
        'U' => [0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110, 0, 0],
        'V' => [0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01010, 0b00100, 0, 0],
        'W' => [0b10001, 0b10001, 0b10001, 0b10101, 0b10101, 0b10101, 0b01010, 0, 0],
        'X' => [0b10001, 0b10001, 0b01010, 0b00100, 0b01010, 0b10001, 0b10001, 0, 0],
        'Y' => [0b10001, 0b10001, 0b01010, 0b00100, 0b00100, 0b00100, 0b00100, 0, 0],
        'Z' => [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b10000, 0b11111, 0, 0],
        '[' => [0b01110, 0b01000, 0b01000, 0b01000, 0b01000, 0b01000, 0b01110, 0, 0],
        '\\' => [0b10000, 0b10000, 0b01000, 0b00100, 0b00010, 0b00001, 0b00001, 0, 0],
        ']' => [0b01110, 0b00010, 0b00010, 0b00010, 0b00010, 0b00010, 0b01110, 0, 0],
        '^' => [0b00100, 0b01010, 0b10001, 0, 0, 0, 0, 0, 0],
        '_' => [0, 0, 0, 0, 0, 0, 0b11111, 0, 0],
        '`' => [0b01000, 0b00100, 0, 0, 0, 0, 0, 0, 0],
        'a' => [0, 0, 0b01110, 0b00001, 0b01111, 0b10001, 0b01111, 0, 0],
        'b' => [0b10000, 0b10000, 0b11110, 0b10001, 0b10001, 0b10001, 0b11110, 0, 0],
        'c' => [0, 0, 0b01110, 0b10001, 0b10000, 0b10001, 0b01110, 0, 0],
        'd' => [0b00001, 0b00001, 0b01111, 0b10001, 0b10001, 0b10001, 0b01111, 0, 0],
        'e' => [0, 0, 0b01110, 0b10001, 0b11111, 0b10000, 0b01110, 0, 0],
        'f' => [0b00110, 0b01000, 0b11110, 0b01000, 0b01000, 0b01000, 0b01000, 0, 0],
        'g' => [0, 0, 0b01111, 0b10001, 0b10001, 0b10001, 0b01111, 0b00001, 0b01110],
        'h' => [0b10000, 0b10000, 0b11110, 0b10001, 0b10001, 0b10001, 0b10001, 0, 0],
        'i' => [0b00100, 0, 0b01100, 0b00100, 0b00100, 0b00100, 0b01110, 0, 0],
        'j' => [0b00010, 0, 0b00110, 0b00010, 0b00010, 0b00010, 0b00010, 0b10010, 0b01100],
        'k' => [0b10000, 0b10000, 0b10010, 0b10100, 0b11000, 0b10100, 0b10010, 0, 0],
        'l' => [0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110, 0, 0],
        'm' => [0, 0, 0b11010, 0b10101, 0b10101, 0b10101, 0b10101, 0, 0],
        'n' => [0, 0, 0b11110, 0b10001, 0b10001, 0b10001, 0b10001, 0, 0],
        'o' => [0, 0, 0b01110, 0b10001, 0b10001, 0b10001, 0b01110, 0, 0],
        'p' => [0, 0, 0b11110, 0b10001, 0b10001, 0b10001, 0b11110, 0b10000, 0b10000],
        'q' => [0, 0, 0b01111, 0b10001, 0b10001, 0b10001, 0b01111, 0b00001, 0b00001],
        'r' => [0, 0, 0b10110, 0b11001, 0b10000, 0b10000, 0b10000, 0, 0],
        's' => [0, 0, 0b01111, 0b10000, 0b01110, 0b00001, 0b11110, 0, 0],
        't' => [0b01000, 0b01000, 0b11110, 0b01000, 0b01000, 0b01001, 0b00110, 0, 0],
        'u' => [0, 0, 0b10001, 0b10001, 0b10001, 0b10001, 0b01111, 0, 0],
        'v' => [0, 0, 0b10001, 0b10001, 0b10001, 0b01010, 0b00100, 0, 0],
        'w' => [0, 0, 0b10001, 0b10001, 0b10101, 0b10101, 0b01010, 0, 0],
        'x' => [0, 0, 0b10001, 0b01010, 0b00100, 0b01010, 0b10001, 0, 0],
        'y' => [0, 0, 0b10001, 0b10001, 0b10001, 0b10001, 0b01111, 0b00001, 0b01110],
        'z' => [0, 0, 0b11111, 0b00010, 0b00100, 0b01000, 0b11111, 0, 0],
        '{' => [0b00010, 0b00100, 0b00100, 0b01000, 0b00100, 0b00100, 0b00010, 0, 0],
        '|' => [0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0, 0],
        '}' => [0b01000, 0b00100, 0b00100, 0b00010, 0b00100, 0b00100, 0b01000, 0, 0],
        '~' => [0, 0, 0b01000, 0b10101, 0b00010, 0, 0, 0, 0],
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_printable_character_has_its_letter_and_no_other() {
        let all: Vec<_> = (' '..='~').map(|c| rows(c).unwrap_or_else(|| panic!("{c}"))).collect();
        assert_eq!(all.len(), 95);
        // O and 0 differ by their place in a text alone.
        assert_eq!(all.iter().collect::<HashSet<_>>().len(), 94);
        assert!(all.iter().flatten().all(|&row| row < 1 << WIDTH));
        assert_eq!(rows('\u{e9}'), None);
    }

    #[test]
    fn strokes_join_what_touches() {
        // A plus: five dots across, five down, one of them common; a backslash has its dots in one chain.
        let joins = |c| strokes(&rows(c).unwrap()).iter().filter(|s| s[0] != s[1]).count();
        assert_eq!((joins('+'), joins('\\'), joins('.')), (8, 6, 0));
    }

    #[test]
    fn letters_stay_in_their_box_at_every_size() {
        for size in [1.0, 1.5, 2.0, 3.0] {
            let mut p = Picture::new(100, 60, [255; 3]);
            write(&mut p, 10.0, 10.0, size, "Mg", [0; 3]);
            let inked: Vec<_> = (0..6000)
                .map(|i| (i % 100, i / 100))
                .filter(|&(x, y)| p.pixel(x, y) != Some([255; 3]))
                .collect();
            let (right, bottom) = (10.0 + width("Mg", size), 10.0 + 9.0 * size);
            assert!(inked.len() > 20);
            for (x, y) in inked {
                assert!(
                    x >= 9 && (x as f64) < right + 1.0 && y >= 9 && (y as f64) < bottom + 1.0,
                    "{size} {x} {y}"
                );
            }
        }
        assert_eq!((width("", 2.0), width("ab", 2.0), cap_height(2.0)), (0.0, 22.0, 14.0));
    }
}
