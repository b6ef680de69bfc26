//! Text: a cursor over lines and tokens, numbers in and out, and the choice between f32 and f64.
//!
//! **Which precision a text file has.** A decimal is hardly ever a binary fraction, so "is it exact in f32" would make a
//! double of every text file. What counts is the digits written: a file is single precision if every number in it is a
//! print of its nearest f32, that is, within half a unit of the last written digit of it ([`Number::fits_f32`]).
//! `0.1` and `-0.037830` are prints of an f32; `0.08156099999999999` and `500000.123456` are not, and one such number makes
//! the file double precision. [`PointsReader`] applies the rule; [`write_f32`] and [`write_f64`] write what it reads back bit for bit.

use super::DecodeError;
use crate::aif::Positions;
use std::io::Write;

/// A [`DecodeError`] at a line.
pub(crate) fn line_error(line: usize, what: impl Into<String>) -> DecodeError {
    DecodeError::Line { line, what: what.into() }
}

/// A token for a message: quoted, cut to 40 characters, with what is not UTF-8 replaced.
pub(crate) fn show(token: &[u8]) -> String {
    let text = String::from_utf8_lossy(&token[..token.len().min(160)]);
    match text.char_indices().nth(40) {
        Some((cut, _)) => format!("\"{}...\"", &text[..cut]),
        None => format!("\"{text}\""),
    }
}

/// True for the end of a line: LF, or CR (alone, or before LF).
#[inline]
fn is_eol(b: u8) -> bool {
    b == b'\n' || b == b'\r'
}

/// True for what separates tokens of a line.
#[inline]
fn is_blank(b: u8) -> bool {
    matches!(b, b' ' | b'\t' | 0x0b | 0x0c)
}

/// True for what ends a token.
#[inline]
fn ends_token(b: u8) -> bool {
    b <= b' ' && (is_blank(b) || is_eol(b))
}

/// Reads lines and tokens, and knows the line it is at.
///
/// Lines end with LF, CR LF or CR. With `continued`, a backslash at the end of a line joins the next one to it (OBJ).
#[derive(Clone, Debug)]
pub(crate) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
    continued: bool,
}

impl<'a> Cursor<'a> {
    /// At the start of `bytes`, line 1; lines are not continued.
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Cursor { bytes, at: 0, line: 1, continued: false }
    }

    /// At the start of `bytes`, line 1; a backslash continues a line.
    pub(crate) fn with_continuation(bytes: &'a [u8]) -> Self {
        Cursor { bytes, at: 0, line: 1, continued: true }
    }

    /// The line the cursor is at, from 1.
    #[inline]
    pub(crate) fn line(&self) -> usize {
        self.line
    }

    /// Bytes before the cursor.
    #[inline]
    pub(crate) fn offset(&self) -> usize {
        self.at
    }

    /// Bytes from the cursor on.
    pub(crate) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// True if nothing is left, not even the end of a line.
    #[inline]
    pub(crate) fn at_end(&self) -> bool {
        self.at >= self.bytes.len()
    }

    #[inline]
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    /// Steps over the end of a line, if the cursor stands at one.
    #[inline]
    fn step_over_eol(&mut self) -> bool {
        match self.peek() {
            Some(b'\n') => self.at += 1,
            Some(b'\r') => self.at += 1 + (self.bytes.get(self.at + 1) == Some(&b'\n')) as usize,
            _ => return false,
        }
        self.line += 1;
        true
    }

    /// True at a backslash that continues the line.
    #[inline]
    fn at_continuation(&self) -> bool {
        self.continued && self.peek() == Some(b'\\') && self.bytes.get(self.at + 1).is_none_or(|&b| is_eol(b))
    }

    /// Steps over blanks (and continuations): to a token or the end of the line.
    #[inline]
    pub(crate) fn skip_blanks(&mut self) {
        while let Some(b) = self.peek() {
            if is_blank(b) {
                self.at += 1;
            } else if b == b'\\' && self.at_continuation() {
                self.at += 1;
                self.step_over_eol();
            } else {
                break;
            }
        }
    }

    /// The next token of this line; `None` at the end of the line.
    #[inline]
    pub(crate) fn token(&mut self) -> Option<&'a [u8]> {
        self.skip_blanks();
        let start = self.at;
        while let Some(b) = self.peek() {
            if ends_token(b) || b == b'\\' && self.at_continuation() {
                break;
            }
            self.at += 1;
        }
        (self.at > start).then(|| &self.bytes[start..self.at])
    }

    /// The next token of this or a later line, over empty lines; `None` at the end of the text.
    #[allow(dead_code)] // The readers of free-form text (OFF, STL) use it.
    pub(crate) fn token_over_lines(&mut self) -> Option<&'a [u8]> {
        loop {
            if let Some(token) = self.token() {
                return Some(token);
            }
            if !self.next_line() {
                return None;
            }
        }
    }

    /// Goes to the start of the next line; false if there is none. Continued lines are one.
    #[inline]
    pub(crate) fn next_line(&mut self) -> bool {
        loop {
            match self.peek() {
                None => return false,
                Some(b) if is_eol(b) => {
                    self.step_over_eol();
                    return !self.at_end();
                }
                Some(b'\\') if self.at_continuation() => {
                    self.at += 1;
                    self.step_over_eol();
                }
                _ => self.at += 1,
            }
        }
    }

    /// Goes to the end of this line, whatever it holds: a backslash does not continue a comment.
    pub(crate) fn skip_comment(&mut self) {
        while self.peek().is_some_and(|b| !is_eol(b)) {
            self.at += 1;
        }
    }

    /// What is left of this line, without blanks around it, as text; continuations become spaces. The cursor goes to the line's end.
    pub(crate) fn rest_of_line(&mut self) -> String {
        self.skip_blanks();
        let mut rest = Vec::new();
        while let Some(b) = self.peek() {
            if is_eol(b) {
                break;
            }
            if b == b'\\' && self.at_continuation() {
                self.at += 1;
                self.step_over_eol();
                rest.push(b' ');
                continue;
            }
            rest.push(b);
            self.at += 1;
        }
        while rest.last().is_some_and(|&b| is_blank(b)) {
            rest.pop();
        }
        String::from_utf8_lossy(&rest).into_owned()
    }

    /// The next token of this line as a number; `None` at the end of the line, an error if it is no number. `what` names it
    /// in the message.
    #[inline]
    pub(crate) fn number(&mut self, what: &str) -> Result<Option<Number>, DecodeError> {
        self.skip_blanks();
        if let Some((number, len)) = scan_number(&self.bytes[self.at..]) {
            let end = self.at + len;
            let clean = match self.bytes.get(end) {
                None => true,
                Some(&b'\\') if self.continued => self.bytes.get(end + 1).is_none_or(|&b| is_eol(b)),
                Some(&b) => ends_token(b),
            };
            if clean {
                self.at = end;
                return Ok(Some(number));
            }
        }
        let line = self.line;
        match self.token() {
            None => Ok(None),
            Some(token) => match Number::parse(token) {
                Some(number) => Ok(Some(number)),
                None => Err(line_error(line, format!("{what}: {} is no number", show(token)))),
            },
        }
    }
}

/// A decimal number: its value, and how far its digits went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Number {
    /// The value, correctly rounded.
    pub(crate) value: f64,
    /// Power of ten of the last digit that counts.
    last: i32,
}

const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

impl Number {
    /// A number that was not written in digits: it fits f32 only if it is one.
    #[inline]
    pub(crate) fn exact(value: f64) -> Number {
        Number { value, last: -400 }
    }

    /// Parses a whole token: decimals, and the spellings of infinity and NaN that C libraries print.
    pub(crate) fn parse(token: &[u8]) -> Option<Number> {
        match scan_number(token) {
            Some((number, len)) if len == token.len() => return Some(number),
            _ => {}
        }
        let text = std::str::from_utf8(token).ok()?;
        if let Ok(value) = text.parse::<f64>() {
            return Some(Number { value, last: last_digit(token) });
        }
        // "-nan(ind)", "1.#QNAN", "-1.#INF"
        let lower = text.to_ascii_lowercase();
        let (negative, bare) = match lower.strip_prefix('-') {
            Some(b) => (true, b),
            None => (false, lower.strip_prefix('+').unwrap_or(&lower)),
        };
        let value = match bare.strip_prefix("1.#") {
            Some(special) if special.starts_with("inf") => f64::INFINITY,
            Some(special) if special.starts_with("ind") || special.contains("nan") => f64::NAN,
            None if bare.starts_with("nan(") && bare.ends_with(')') => f64::NAN,
            _ => return None,
        };
        Some(Number { value: if negative { -value } else { value }, last: 0 })
    }

    /// True if this is a print of its nearest f32: that is within half a unit of the last digit written (digits after the
    /// 17th do not count, a double has no more).
    #[inline]
    pub(crate) fn fits_f32(self) -> bool {
        let error = (self.value - self.value as f32 as f64).abs();
        if error == 0.0 || self.value.is_nan() {
            return true;
        }
        let e = self.last;
        let unit = match e {
            -22..=-1 => 1.0 / POWERS[-e as usize],
            0..=22 => POWERS[e as usize],
            _ => 10f64.powi(e),
        };
        // A little over half, since a print of an f32 may lie just half a unit off; and half the distance to the next double, by
        // which the value itself was rounded. The latter is less than the least error there is, so 17 digits always tell.
        let rounding = f64::from_bits(self.value.to_bits() & 0x7ff0_0000_0000_0000) * (0.5 * f64::EPSILON);
        error <= 0.500_001 * unit + rounding
    }
}

/// A plain decimal at the start of `s` and its length, where 19 digits and small powers of ten make that exact; `None` for
/// anything else, which [`Number::parse`] may still read.
#[inline]
fn scan_number(s: &[u8]) -> Option<(Number, usize)> {
    let mut i = 0;
    let negative = match s.first()? {
        b'-' => {
            i = 1;
            true
        }
        b'+' => {
            i = 1;
            false
        }
        _ => false,
    };
    let start = i;
    let mut mantissa = 0u64;
    while let Some(d) = s.get(i).map(|b| b.wrapping_sub(b'0')).filter(|&d| d < 10) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(d as u64);
        i += 1;
    }
    let mut digits = i - start;
    let mut last = 0i32;
    if s.get(i) == Some(&b'.') {
        i += 1;
        let point = i;
        while let Some(d) = s.get(i).map(|b| b.wrapping_sub(b'0')).filter(|&d| d < 10) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(d as u64);
            i += 1;
        }
        digits += i - point;
        last = -((i - point) as i32);
    }
    if digits == 0 || digits > 19 {
        return None;
    }
    if let Some(b'e' | b'E') = s.get(i) {
        let mut j = i + 1;
        let minus = s.get(j) == Some(&b'-');
        if let Some(b'-' | b'+') = s.get(j) {
            j += 1;
        }
        let from = j;
        let mut exponent = 0i32;
        while let Some(d) = s.get(j).map(|b| b.wrapping_sub(b'0')).filter(|&d| d < 10) {
            exponent = exponent * 10 + d as i32;
            j += 1;
            if j - from > 4 {
                return None;
            }
        }
        if j == from {
            return None;
        }
        last += if minus { -exponent } else { exponent };
        i = j;
    }
    // Both the digits and the power of ten are exact doubles here, so one operation rounds once.
    if mantissa > 1 << 53 || !(-22..=22).contains(&last) {
        return (mantissa == 0).then_some((Number { value: if negative { -0.0 } else { 0.0 }, last }, i));
    }
    let m = mantissa as f64;
    let v = if last < 0 { m / POWERS[-last as usize] } else { m * POWERS[last as usize] };
    Some((Number { value: if negative { -v } else { v }, last }, i))
}

/// The power of ten of the last digit that counts in a decimal.
fn last_digit(token: &[u8]) -> i32 {
    let cut = token.iter().position(|b| matches!(b, b'e' | b'E')).unwrap_or(token.len());
    let exponent: i32 = std::str::from_utf8(token.get(cut + 1..).unwrap_or(&[]))
        .ok()
        .and_then(|t| t.parse().ok())
        .unwrap_or(0)
        .clamp(-100_000, 100_000);
    let number = &token[..cut];
    let point = number.iter().position(|&b| b == b'.');
    let fraction = point.map_or(0, |p| number.len() - p - 1).min(100_000) as i32;
    let digits: Vec<u8> = number.iter().copied().filter(u8::is_ascii_digit).collect();
    let significant = digits.iter().skip_while(|&&d| d == b'0').count().min(100_000) as i32;
    let mut last = -fraction;
    if significant > 17 {
        // The zeros that fill up a large whole number say nothing.
        let fill = digits.iter().rev().take_while(|&&d| d == b'0').count().min(100_000) as i32;
        last += (significant - 17).max(if fraction == 0 { fill } else { 0 });
    }
    last + exponent
}

/// A whole number at the start of `s`, and its length: optional sign and digits; `None` if there is none or it does not fit.
#[inline]
pub(crate) fn scan_int(s: &[u8]) -> Option<(i64, usize)> {
    let signed = matches!(s.first(), Some(b'-' | b'+')) as usize;
    let mut i = signed;
    let mut value = 0i64;
    while let Some(d) = s.get(i).map(|b| b.wrapping_sub(b'0')).filter(|&d| d < 10) {
        if i - signed >= 18 {
            return None;
        }
        value = value * 10 + d as i64;
        i += 1;
    }
    (i > signed).then_some((if s.first() == Some(&b'-') { -value } else { value }, i))
}

/// Collects points of a text file and decides their precision by the rule of this module.
#[derive(Clone, Debug)]
pub(crate) struct PointsReader {
    points: Vec<[f64; 3]>,
    single: bool,
}

impl Default for PointsReader {
    fn default() -> Self {
        PointsReader { points: Vec::new(), single: true }
    }
}

impl PointsReader {
    /// Adds a point. Coordinates must be finite; the error names the line and the axis.
    #[inline]
    pub(crate) fn push(&mut self, p: [Number; 3], line: usize) -> Result<(), DecodeError> {
        let v = p.map(|x| x.value);
        if !(v[0].is_finite() && v[1].is_finite() && v[2].is_finite()) {
            let k = (0..3).find(|&k| !v[k].is_finite()).unwrap_or(0);
            let axis = b"xyz"[k] as char;
            return Err(line_error(line, format!("{axis} is {}; coordinates must be finite", v[k])));
        }
        self.push_finite(p);
        Ok(())
    }

    /// Adds a point that was found to be finite.
    #[inline]
    pub(crate) fn push_finite(&mut self, p: [Number; 3]) {
        self.single = self.single && p[0].fits_f32() && p[1].fits_f32() && p[2].fits_f32();
        self.points.push(p.map(|x| x.value));
    }

    /// Makes room for this many more points.
    pub(crate) fn reserve(&mut self, points: usize) {
        self.points.reserve(points);
    }

    /// Number of points so far.
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }

    /// The points: f32 if every number was a print of one, else f64.
    pub(crate) fn finish(self) -> Positions {
        if self.single {
            Positions::F32(self.points.iter().map(|p| p.map(|x| x as f32)).collect())
        } else {
            Positions::F64(self.points)
        }
    }
}

/// Writes the shortest decimal that reads back as `x` bit for bit, through f64 or not, and passes for single precision.
/// NaN and infinities are written as `nan`, `inf`, `-inf`.
pub(crate) fn write_f32(out: &mut Vec<u8>, x: f32) {
    let start = out.len();
    // Writing to a Vec cannot fail.
    if x.is_nan() {
        out.extend_from_slice(b"nan");
        return;
    }
    let plain = x == 0.0 || (1e-5..1e7).contains(&x.abs());
    let _ = if plain { write!(out, "{x}") } else { write!(out, "{x:e}") };
    // A decimal so near to the middle of two f32 that rounding to f64 first would go the wrong way: give it all digits.
    if x.is_finite() && !Number::parse(&out[start..]).is_some_and(|n| n.value as f32 == x && n.fits_f32()) {
        out.truncate(start);
        let _ = write!(out, "{:e}", x as f64);
    }
}

/// A position, with [`super::EncodeOptions::all_digits`] as the number that it is.
pub(crate) fn write_place(out: &mut Vec<u8>, x: f32, all_digits: bool) {
    if all_digits { write_f64(out, f64::from(x)) } else { write_f32(out, x) }
}

/// Writes the shortest decimal that reads back as `x` bit for bit as f64. See [`f64_mark`] for a file of short decimals.
/// NaN and infinities are written as `nan`, `inf`, `-inf`.
pub(crate) fn write_f64(out: &mut Vec<u8>, x: f64) {
    if x.is_nan() {
        out.extend_from_slice(b"nan");
        return;
    }
    let plain = x == 0.0 || (1e-5..1e16).contains(&x.abs());
    let _ = if plain { write!(out, "{x}") } else { write!(out, "{x:e}") };
}

/// Writes `x` with 17 digits, zeros included, so that a reader sees a double. Reads back bit for bit.
pub(crate) fn write_f64_long(out: &mut Vec<u8>, x: f64) {
    let _ = if x.is_finite() { write!(out, "{x:.16e}") } else { write!(out, "{x}") };
}

/// Which of the numbers of a double-precision file must be written by [`write_f64_long`], lest all look like prints of f32
/// (`0.1` alone does): the index of one that f32 cannot hold. `None` if the digits show it anyway, or f32 can hold all of them.
pub(crate) fn f64_mark(values: impl Iterator<Item = f64>) -> Option<usize> {
    let mut first = None;
    let mut digits = Vec::new();
    for (i, x) in values.enumerate() {
        if x as f32 as f64 == x || !x.is_finite() {
            continue;
        }
        digits.clear();
        write_f64(&mut digits, x);
        if !Number::parse(&digits).is_some_and(Number::fits_f32) {
            return None;
        }
        first = first.or(Some(i));
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn fits(s: &str) -> bool {
        Number::parse(s.as_bytes()).unwrap().fits_f32()
    }

    #[test]
    fn prints_of_f32_are_told_from_doubles() {
        for s in [
            "0.1",
            "-0.037830",
            "15.3644",
            "1e-06",
            "3.4028235e38",
            "0.10000000149011612",
            "1e-40",
            "0",
            "16777217.0e0",
        ] {
            assert_eq!(fits(s), s != "16777217.0e0", "{s}");
        }
        for s in
            ["0.08156099999999999", "500000.123456", "0.10000000000000000", "1e-50", "1e39", "123456.7861"]
        {
            assert!(!fits(s), "{s}");
        }
        // 16 digits, a double next to an f32; 17 digits of the same double.
        assert!(fits("0.05657500028610229") && !fits("0.056575000286102288"));
        assert!(fits("340282350000000000000000000000000000000"));
    }

    #[test]
    fn numbers_are_parsed_like_the_standard_library_does() {
        for s in [
            "1",
            "-1.",
            ".5",
            "+2.5e3",
            "1e22",
            "1e23",
            "9007199254740993",
            "123456789012345678901234567890",
            "4.9e-324",
            "-0",
            "0e999",
            "1e400",
        ] {
            assert_eq!(
                Number::parse(s.as_bytes()).unwrap().value.to_bits(),
                s.parse::<f64>().unwrap().to_bits(),
                "{s}"
            );
        }
        for s in ["", "-", ".", "1e", "e5", "1.2.3", "0x10", "1,5", "--1", "1e+", "nano"] {
            assert!(Number::parse(s.as_bytes()).is_none(), "{s}");
        }
        for s in ["nan", "-nan(ind)", "1.#QNAN", "-1.#IND", "NaN"] {
            assert!(Number::parse(s.as_bytes()).unwrap().value.is_nan(), "{s}");
        }
        assert_eq!(Number::parse(b"-1.#INF").unwrap().value, f64::NEG_INFINITY);
    }

    #[test]
    fn lines_end_in_three_ways_and_are_counted() {
        let mut c = Cursor::new(b"a b\r\nc\rd\n\n e");
        let mut seen = Vec::new();
        while let Some(t) = c.token_over_lines() {
            seen.push((String::from_utf8_lossy(t).into_owned(), c.line()));
        }
        let want = [("a", 1), ("b", 1), ("c", 2), ("d", 3), ("e", 5)].map(|(t, l)| (t.to_string(), l));
        assert_eq!(seen, want);
    }

    #[test]
    fn a_backslash_continues_a_line_only_at_its_end() {
        let mut c = Cursor::with_continuation(b"f 1 \\\n 2\\\r\n3 a\\b\nx \\");
        let mut n = Vec::new();
        while let Some(t) = c.token() {
            n.push(t);
        }
        assert_eq!(n, [&b"f"[..], b"1", b"2", b"3", b"a\\b"]);
        assert_eq!(c.line(), 3);
        assert!(c.next_line());
        assert_eq!((c.token(), c.token(), c.line()), (Some(&b"x"[..]), None, 4));
        let mut c = Cursor::with_continuation(b"1\\\n2.5 x");
        assert_eq!(c.number("n").unwrap().unwrap().value, 1.0);
        assert_eq!(c.number("n").unwrap().unwrap().value, 2.5);
        assert_eq!(c.number("n").unwrap_err().to_string(), "line 2: n: \"x\" is no number");
    }

    #[test]
    fn short_doubles_are_marked_once() {
        assert_eq!(f64_mark([0.5, 0.1, 0.2].into_iter()), Some(1));
        assert_eq!(f64_mark([0.5, 0.1, 1.0 / 3.0].into_iter()), None);
        assert_eq!(f64_mark([0.5, 0.25].into_iter()), None);
        let mut out = Vec::new();
        write_f64_long(&mut out, 0.1);
        let n = Number::parse(&out).unwrap();
        assert_eq!((n.value, n.fits_f32()), (0.1, false));
    }

    #[test]
    fn integers_stop_at_what_is_no_digit() {
        assert_eq!(scan_int(b"-12/3"), Some((-12, 3)));
        assert_eq!(scan_int(b"+7"), Some((7, 2)));
        assert_eq!((scan_int(b"-"), scan_int(b"")), (None, None));
        assert_eq!(scan_int(b"99999999999999999999"), None);
    }

    #[test]
    fn messages_show_tokens_cut_and_safe() {
        assert_eq!(show(b"a\xffb"), "\"a\u{fffd}b\"");
        assert!(show(&[b'x'; 5000]).len() < 60);
    }

    fn reads_back(bits: u32) -> Result<(), TestCaseError> {
        let mut out = Vec::new();
        write_f32(&mut out, f32::from_bits(bits));
        let n = Number::parse(&out).unwrap();
        prop_assert_eq!((n.value as f32).to_bits(), bits);
        prop_assert!(n.fits_f32(), "{}", String::from_utf8_lossy(&out));
        Ok(())
    }

    fn nine_digits_fit(bits: u32) -> Result<(), TestCaseError> {
        let digits = format!("{:.8e}", f32::from_bits(bits));
        prop_assert!(Number::parse(digits.as_bytes()).unwrap().fits_f32());
        Ok(())
    }

    #[test]
    fn a_single_of_ten_digits_is_told() {
        // 351751.6875
        reads_back(1219215606).unwrap();
        nine_digits_fit(1219215606).unwrap();
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn f32_reads_back_bit_for_bit(bits: u32) {
            prop_assume!(f32::from_bits(bits).is_finite());
            reads_back(bits)?;
        }

        #[test]
        fn f64_reads_back_bit_for_bit(bits: u64) {
            let x = f64::from_bits(bits);
            prop_assume!(x.is_finite());
            for write in [write_f64, write_f64_long] {
                let mut out = Vec::new();
                write(&mut out, x);
                let n = Number::parse(&out).unwrap();
                prop_assert_eq!(n.value.to_bits(), bits);
            }
            let mut out = Vec::new();
            write_f64_long(&mut out, x);
            prop_assert_eq!(Number::parse(&out).unwrap().fits_f32(), x as f32 as f64 == x);
        }

        #[test]
        fn doubles_next_to_an_f32_are_told_by_17_digits(bits: u32, up: bool) {
            let near = f32::from_bits(bits) as f64;
            prop_assume!(near.is_normal());
            let x = if up { near.next_up() } else { near.next_down() };
            let mut out = Vec::new();
            write_f64_long(&mut out, x);
            prop_assert!(!Number::parse(&out).unwrap().fits_f32());
        }

        #[test]
        fn any_decimal_is_parsed_as_the_standard_library_does(s in "[-+]?[0-9]{0,22}\\.?[0-9]{0,22}([eE][-+]?[0-9]{1,3})?") {
            let want = s.parse::<f64>().ok().map(f64::to_bits);
            prop_assert_eq!(Number::parse(s.as_bytes()).map(|n| n.value.to_bits()), want);
        }

        #[test]
        fn nine_digits_of_an_f32_pass_for_single(bits: u32) {
            prop_assume!(f32::from_bits(bits).is_normal());
            nine_digits_fit(bits)?;
        }
    }
}
