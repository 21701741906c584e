//! One field as a number.

use memchr::memchr;

use super::decimal;
use super::error::{quoted, shortened};

/// What stands for a missing value without being declared, in lower case.
///
/// C prints the not-a-number of an invalid operation with a sign.
const MISSING: [&[u8]; 5] = [b"nan", b"-nan", b"na", b"n/a", b"null"];

/// What a NUL byte in a log means.
pub(super) const NUL_BYTE: &str =
    "a NUL byte: this is no text table; name a text file, or say `encoding` utf-16le if it is UTF-16";

/// How numbers are written in a log.
#[derive(Clone, Debug)]
pub(super) struct Numbers {
    decimal_comma: bool,
    /// Whether `1,234`, or with decimal commas `1.234`, is a number of four digits: others in the log show it.
    grouped: bool,
    /// Words that stand for numbers, as they were declared.
    values: Vec<(String, f64)>,
    /// The declared words for a missing value.
    missing_words: Vec<String>,
    /// Those of them that are numbers: `-999` is meant to cover `-999.0` too.
    missing_numbers: Vec<f64>,
}

impl Numbers {
    /// Numbers with a decimal point or comma, and the words that stand for a missing one.
    pub(super) fn new(decimal_comma: bool, missing: &[String]) -> Self {
        let mut numbers = Self {
            decimal_comma,
            grouped: false,
            values: Vec::new(),
            missing_words: missing.iter().map(|word| word.trim().to_owned()).collect(),
            missing_numbers: Vec::new(),
        };
        numbers.missing_numbers =
            numbers.missing_words.iter().filter_map(|word| numbers.finite(word.as_bytes())).collect();
        numbers
    }

    /// The same with groups of digits, and with words that stand for numbers.
    pub(super) fn with(self, grouped: bool, values: &[(String, f64)]) -> Self {
        let values = values.iter().map(|(word, value)| (word.trim().to_owned(), *value)).collect();
        Self { grouped, values, ..self }
    }

    /// Whether numbers have a decimal point and none of them stands for a missing value.
    pub(super) fn are_plain(&self) -> bool {
        !self.decimal_comma && self.missing_numbers.is_empty()
    }

    /// Reads the number at the front of a text and returns its length; nothing if that takes a closer look.
    pub(super) fn prefix(&self, text: &[u8]) -> Option<(f64, usize)> {
        if self.decimal_comma {
            return None;
        }
        let short =
            decimal::short(text).filter(|(_, length)| !matches!(text.get(*length), Some(b'e' | b'E')));
        let (value, length) = match short {
            Some(short) => short,
            None => fast_float2::parse_partial::<f64, _>(text).ok()?,
        };
        // It reads `inf` and `nan` too, and an overflow as infinity.
        value.is_finite().then(|| (self.without_missing(value), length))
    }

    /// Reads a whole field without blanks around it. A missing value is NaN; an error is a message.
    pub(super) fn read(&self, field: &[u8]) -> Result<f64, String> {
        self.value(field).ok_or_else(|| self.refusal(field))
    }

    /// The same without the message.
    pub(super) fn value(&self, field: &[u8]) -> Option<f64> {
        match self.finite(field) {
            Some(value) => Some(self.without_missing(value)),
            None if self.is_missing(field) => Some(f64::NAN),
            None => self.declared(field),
        }
    }

    /// What a word stands for that was declared.
    fn declared(&self, field: &[u8]) -> Option<f64> {
        let known = self.values.iter().find(|(word, _)| field.eq_ignore_ascii_case(word.as_bytes()));
        known.map(|(_, value)| *value)
    }

    /// Whether a field stands for a missing value.
    pub(super) fn is_missing(&self, field: &[u8]) -> bool {
        let declared = self.missing_words.iter().map(|word| word.as_bytes());
        field.is_empty()
            || MISSING.into_iter().chain(declared).any(|word| field.eq_ignore_ascii_case(word))
            || self.finite(field).is_some_and(|value| self.missing_numbers.contains(&value))
    }

    /// NaN in place of a number that was declared to stand for a missing value.
    fn without_missing(&self, value: f64) -> f64 {
        if self.missing_numbers.contains(&value) { f64::NAN } else { value }
    }

    /// A finite number that fills a field.
    fn finite(&self, field: &[u8]) -> Option<f64> {
        let value = if self.decimal_comma { parsed_with_comma(field) } else { parsed(field) };
        value.or_else(|| self.dressed(field)).filter(|value| value.is_finite())
    }

    /// A number with a percent sign after it, or with its digits in groups of three.
    fn dressed(&self, field: &[u8]) -> Option<f64> {
        if !matches!(field, [b'0'..=b'9' | b'-' | b'+' | b'.' | b',', _, ..]) {
            return None;
        }
        let bare = field.strip_suffix(b"%").map_or(field, <[u8]>::trim_ascii_end);
        let read = if self.decimal_comma { parsed_with_comma } else { parsed };
        if bare.len() < field.len()
            && let Some(value) = read(bare)
        {
            return Some(value);
        }
        let Digits { plain, groups, certain } = Digits::of(bare, self.decimal_comma)?;
        let trusted = groups > 0 && (certain || self.grouped);
        trusted.then(|| read(&plain)).flatten()
    }

    /// Whether a field is infinite, or would be a number if numbers were written in another way.
    pub(super) fn is_nearly(&self, field: &[u8]) -> bool {
        parsed(field).is_some() || parsed_with_comma(field).is_some() || Notation::of(field).is_some()
    }

    /// Says why a field is no number, and what to do.
    fn refusal(&self, field: &[u8]) -> String {
        let shown = quoted(field);
        let missing = missing_advice(field);
        if field.contains(&0) {
            format!("{shown} is not a number; there is {NUL_BYTE}")
        } else if std::str::from_utf8(field).is_err() {
            format!(
                "{shown} is neither a number nor UTF-8; correct it, or name the file's encoding, as in \
                 `encoding` windows-1252"
            )
        } else if field.starts_with(b"\"") {
            format!("{shown} is not a number; take away the blanks in front of the quote, or the quote")
        } else if parsed(field).is_some_and(f64::is_infinite) {
            format!("{shown} is infinite; correct it, or {missing}")
        } else if self.decimal_comma && parsed(field).is_some() {
            format!(
                "{shown} has a decimal point where others have a comma; correct it, or say `decimal-comma`=no"
            )
        } else if !self.decimal_comma && parsed_with_comma(field).is_some_and(f64::is_finite) {
            format!("{shown} is not a number; if it has a decimal comma, say `decimal-comma`")
        } else if field.split(u8::is_ascii_whitespace).filter_map(|part| self.finite(part)).nth(1).is_some() {
            format!("{shown} is not one number; say `delimiter` ' ' if blanks separate fields")
        } else {
            format!("{shown} is not a number; correct it, or {missing}")
        }
    }
}

/// A number without the signs that group its digits.
struct Digits {
    plain: Vec<u8>,
    /// How many groups of three digits follow such a sign.
    groups: usize,
    /// Whether nothing but groups can be meant: `1,234` may have decimals.
    certain: bool,
}

impl Digits {
    /// Digits in groups of three before the decimal sign; none if the groups are others.
    fn of(field: &[u8], decimal_comma: bool) -> Option<Self> {
        let (decimal, other) = if decimal_comma { (b',', b'.') } else { (b'.', b',') };
        let end = field.iter().position(|&byte| byte == decimal || byte == b'e' || byte == b'E');
        let (whole, rest) = field.split_at(end.unwrap_or(field.len()));
        let (mut plain, mut groups, mut since, mut separator) = (Vec::new(), 0, 0, None);
        let mut left = whole;
        while let Some((&byte, after)) = left.split_first() {
            // A no-break space, and a narrow one, in UTF-8.
            let wide: [&[u8]; 2] = [b"\xc2\xa0", b"\xe2\x80\xaf"];
            let length = wide.iter().find(|wide| left.starts_with(wide)).map_or(1, |wide| wide.len());
            if length > 1 || [other, b' ', b'\''].contains(&byte) {
                let first = groups == 0 && (1..=3).contains(&since);
                if !(first || groups > 0 && since == 3) || separator.is_some_and(|known| known != byte) {
                    return None;
                }
                (groups, since, separator) = (groups + 1, 0, Some(byte));
                left = &left[length..];
                continue;
            }
            since += usize::from(byte.is_ascii_digit());
            plain.push(byte);
            left = after;
        }
        if groups > 0 && since != 3 {
            return None;
        }
        plain.extend_from_slice(rest);
        let certain = groups > 1 || rest.first() == Some(&decimal) || separator != Some(other);
        Some(Self { plain, groups, certain })
    }
}

/// What a number shows of how numbers are written.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Notation {
    /// Nothing: it is a whole number.
    Either,
    /// It has a decimal point, or a comma, and perhaps groups of digits.
    Point {
        grouped: bool,
    },
    Comma {
        grouped: bool,
    },
    /// A comma, or a point, before three digits.
    OneComma,
    OnePoint,
}

impl Notation {
    /// What a field shows; none if it is no number in any notation.
    pub(super) fn of(field: &[u8]) -> Option<Self> {
        let bare = field.strip_suffix(b"%").map_or(field, <[u8]>::trim_ascii_end);
        if !matches!(bare.first()?, b'0'..=b'9' | b'-' | b'+' | b'.' | b',') {
            return None;
        }
        let groups = |decimal_comma| Digits::of(bare, decimal_comma).filter(|digits| digits.groups > 0);
        let reads = |digits: &Digits, read: fn(&[u8]) -> Option<f64>| read(&digits.plain).is_some();
        let (point, comma) = (groups(false), groups(true));
        let point = point.filter(|digits| reads(digits, parsed));
        let comma = comma.filter(|digits| reads(digits, parsed_with_comma));
        match (point, comma, parsed(bare), parsed_with_comma(bare)) {
            (Some(digits), None, None, None) if digits.certain => Some(Self::Point { grouped: true }),
            (None, Some(digits), None, None) if digits.certain => Some(Self::Comma { grouped: true }),
            // By blanks or apostrophes, without decimals.
            (Some(_), Some(_), None, None) => Some(Self::Either),
            (Some(_), _, None, Some(_)) => Some(Self::OneComma),
            (_, Some(_), Some(_), None) => Some(Self::OnePoint),
            (_, _, Some(_), Some(_)) => Some(Self::Either),
            (_, _, Some(_), None) => Some(Self::Point { grouped: false }),
            (_, _, None, Some(_)) => Some(Self::Comma { grouped: false }),
            _ => None,
        }
    }
}

/// Whether a field starts with a number: a unit does not.
pub(super) fn starts_with_number(field: &[u8]) -> bool {
    fast_float2::parse_partial::<f64, _>(field).is_ok()
}

/// A decimal number that fills a field, infinity included.
fn parsed(field: &[u8]) -> Option<f64> {
    fast_float2::parse::<f64, _>(field).ok().filter(|value| !value.is_nan())
}

/// A number with a decimal comma, or without any, that fills a field.
fn parsed_with_comma(field: &[u8]) -> Option<f64> {
    if field.contains(&b'.') {
        return None;
    }
    // A number is short: allocating memory for each would take longer than parsing them.
    let (mut short, mut long) = ([0; 64], Vec::new());
    let pointed = short.get_mut(..field.len()).unwrap_or_else(|| {
        long.resize(field.len(), 0);
        &mut long
    });
    pointed.copy_from_slice(field);
    if let Some(comma) = memchr(b',', field) {
        pointed[comma] = b'.';
    }
    parsed(pointed)
}

/// How to declare a word as missing, ready to be typed where that is possible.
fn missing_advice(field: &[u8]) -> String {
    let plain = |byte: &u8| byte.is_ascii_alphanumeric() || b"._+-/%".contains(byte);
    let word = String::from_utf8_lossy(field);
    if shortened(&word) != word || !field.iter().all(|byte| plain(byte) || *byte == b' ') {
        "declare it with `missing` if it stands for a missing value".to_owned()
    } else if field.iter().all(plain) && !field.starts_with(b"-") {
        format!("name it with `missing` {word} if it stands for a missing value")
    } else {
        format!("name it with `missing`='{word}' if it stands for a missing value")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(field: &str) -> Result<f64, String> {
        Numbers::new(false, &[]).read(field.as_bytes())
    }

    #[test]
    fn decimal_numbers_are_read() {
        for (field, value) in [
            ("1", 1.0),
            ("+1.5", 1.5),
            ("-.5", -0.5),
            ("5.", 5.0),
            ("1e-3", 1e-3),
            ("1E5", 1e5),
            ("00012", 12.0),
            ("1e-400", 0.0),
            ("1.797693134862315708e+308", f64::MAX),
            ("-5.000000000000000000e-324", -5e-324),
            ("0.1000000000000000055511151231257827021181583404541015625", 0.1),
        ] {
            assert_eq!(read(field), Ok(value), "{field}");
        }
    }

    #[test]
    fn nothing_else_is_a_number() {
        for field in [
            "abc", ".", "-", "+", "1e", "1e+", "e5", "1D5", "0x10", "1_000", "1,000", "1.2.3", "--1", "+-1",
            "1 2", "½", "1f", "true", "#N/A", "1.5\r2", " 1",
        ] {
            assert!(read(field).is_err_and(|message| message.contains("not")), "{field}");
        }
    }

    #[test]
    fn infinity_is_an_error_of_its_own() {
        for field in ["inf", "-Inf", "+INFINITY", "1e400", "-1e400", "1e99999999999999999999"] {
            assert!(read(field).is_err_and(|message| message.contains("infinite")), "{field}");
        }
    }

    #[test]
    fn missing_values_are_nan() {
        for field in ["", "NaN", "nan", "-nan", "NA", "n/a", "NULL"] {
            assert!(read(field).is_ok_and(f64::is_nan), "{field}");
        }
        let numbers = Numbers::new(false, &["-999".to_owned(), " Bad ".to_owned()]);
        for field in ["-999", "-999.00", "-9.99e2", "bad", "BAD"] {
            assert!(numbers.read(field.as_bytes()).is_ok_and(f64::is_nan), "{field}");
            assert!(numbers.is_missing(field.as_bytes()), "{field}");
        }
        assert!(numbers.prefix(b"-999,").is_some_and(|(value, length)| value.is_nan() && length == 4));
        assert_eq!(numbers.read(b"999"), Ok(999.0));
    }

    #[test]
    fn decimal_commas_are_asked_for() {
        let numbers = Numbers::new(true, &["-99,5".to_owned()]);
        assert_eq!(numbers.read(b"-1,5e3"), Ok(-1500.0));
        assert_eq!(numbers.read(b"15"), Ok(15.0));
        assert_eq!(numbers.read(format!("1,{}", "0".repeat(99)).as_bytes()), Ok(1.0));
        assert!(numbers.read(b"-99,50").is_ok_and(f64::is_nan));
        assert!(numbers.read(b"1.5").is_err_and(|message| message.contains("decimal point")));
        assert!(numbers.read(b"1,2,3").is_err());
        assert!(read("1,5").is_err_and(|message| message.contains("`decimal-comma`")));
    }

    #[test]
    fn digits_come_in_groups() {
        let read = |decimal_comma, grouped, field: &str| {
            Numbers::new(decimal_comma, &[]).with(grouped, &[]).read(field.as_bytes())
        };
        for field in
            ["1,234.5", "1 234.5", "1'234.5", "1\u{a0}234.5", "1\u{202f}234.5", "1234.5 %", "1,234.5%"]
        {
            assert_eq!(read(false, false, field), Ok(1234.5), "{field}");
        }
        assert_eq!(read(false, false, "-1,234,567"), Ok(-1_234_567.0));
        assert_eq!(read(true, false, "1.234,5"), Ok(1234.5));
        assert_eq!(read(true, false, "-12.345.678"), Ok(-12_345_678.0));
        assert_eq!(read(true, false, "12,5%"), Ok(12.5));
        // It may be either: others have to show it.
        assert!(read(false, false, "1,234").is_err_and(|message| message.contains("`decimal-comma`")));
        assert_eq!(read(false, true, "1,234"), Ok(1234.0));
        assert_eq!(read(true, true, "1.234"), Ok(1234.0));
        for field in
            ["1,23,456.0", "1,2345.0", "12345,678.5", ",123.5", "1,234 567.0", "%", "1,234.5,6", "1 23"]
        {
            assert!(read(false, true, field).is_err(), "{field}");
        }
    }

    #[test]
    fn a_number_shows_how_numbers_are_written() {
        use Notation::{Comma, Either, OneComma, OnePoint, Point};
        for (field, notation) in [
            ("15", Some(Either)),
            ("-1e5", Some(Either)),
            ("1 234", Some(Either)),
            ("1.5", Some(Point { grouped: false })),
            ("1,5", Some(Comma { grouped: false })),
            ("0,5 %", Some(Comma { grouped: false })),
            ("1,234.5", Some(Point { grouped: true })),
            ("1,234,567", Some(Point { grouped: true })),
            ("1.234,5", Some(Comma { grouped: true })),
            ("1.234.567", Some(Comma { grouped: true })),
            ("1,234", Some(OneComma)),
            ("1.234", Some(OnePoint)),
            ("12,2345", Some(Comma { grouped: false })),
            ("27.10.2024", None),
            ("abc", None),
            ("1,5,6", None),
            ("", None),
        ] {
            assert_eq!(Notation::of(field.as_bytes()), notation, "{field}");
        }
    }

    #[test]
    fn declared_words_are_numbers() {
        let numbers =
            Numbers::new(false, &[]).with(false, &[("manual".to_owned(), 0.0), (" auto ".to_owned(), 1.0)]);
        assert_eq!(numbers.read(b"Auto"), Ok(1.0));
        assert_eq!(numbers.read(b"manual"), Ok(0.0));
        assert!(numbers.read(b"off").is_err());
    }

    #[test]
    fn a_prefix_stops_where_the_number_does() {
        let numbers = Numbers::new(false, &[]);
        assert_eq!(numbers.prefix(b"1.5,2"), Some((1.5, 3)));
        assert_eq!(numbers.prefix(b"1e\n"), Some((1.0, 1)));
        for text in ["1e5,", "-1.5E5,", "1.2345678e5,"] {
            let expected = text[..text.len() - 1].parse::<f64>().map(|value| (value, text.len() - 1)).ok();
            assert_eq!(numbers.prefix(format!("{text}        ").as_bytes()), expected, "{text}");
        }
        for text in ["nan,", "inf,", "1e400,", ",", "", "abc", " 1"] {
            assert_eq!(numbers.prefix(text.as_bytes()), None, "{text}");
        }
        assert_eq!(Numbers::new(true, &[]).prefix(b"1,5;"), None);
    }

    #[test]
    fn a_refusal_says_what_to_do() {
        let ends = |field: &[u8], end: &str| {
            let message = Numbers::new(false, &[]).read(field).err().unwrap_or_default();
            assert!(message.contains(end), "{end}: {message}");
        };
        ends(b"abc", "name it with `missing` abc if");
        ends(b"-x", "name it with `missing`='-x' if");
        ends(b"no data", "name it with `missing`='no data' if");
        ends(b"it's", "declare it with `missing` if");
        ends(&[b'x'; 99], "declare it with `missing` if");
        ends(b"1.5  2.5", "`delimiter` ' '");
        ends(b"\xb0C", "`encoding` windows-1252");
        ends(b"1\x00", "NUL byte");
    }
}
