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
            missing_words: missing.iter().map(|word| word.trim().to_owned()).collect(),
            missing_numbers: Vec::new(),
        };
        numbers.missing_numbers =
            numbers.missing_words.iter().filter_map(|word| numbers.finite(word.as_bytes())).collect();
        numbers
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
        match self.finite(field) {
            Some(value) => Ok(self.without_missing(value)),
            None if self.is_missing(field) => Ok(f64::NAN),
            None => Err(self.refusal(field)),
        }
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
        value.filter(|value| value.is_finite())
    }

    /// Whether a field is infinite, or would be a number with the other decimal sign.
    pub(super) fn is_nearly(&self, field: &[u8]) -> bool {
        parsed(field).is_some() || parsed_with_comma(field).is_some()
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
                "{shown} has a decimal point, yet `decimal-comma` was given; correct it, or leave that option \
                 out"
            )
        } else if parsed_with_comma(field).is_some_and(f64::is_finite) {
            format!("{shown} is not a number; if it has a decimal comma, say `decimal-comma`")
        } else if field.split(u8::is_ascii_whitespace).filter_map(|part| self.finite(part)).nth(1).is_some() {
            format!(
                "{shown} is not one number; say `delimiter` ' ' if one blank separates two fields, and put one \
                 in place of several"
            )
        } else {
            format!("{shown} is not a number; correct it, or {missing}")
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
        assert!(numbers.read(b"1.234,5").is_err());
        assert!(numbers.read(b"1,2,3").is_err());
        assert!(read("1,5").is_err_and(|message| message.contains("`decimal-comma`")));
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
