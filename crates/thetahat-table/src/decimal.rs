//! Short decimal numbers, eight digits at a time.

/// What the powers of ten up to here are: exactly, in both types.
const MOST_DECIMALS: usize = 15;

/// The powers of ten with an exponent of up to [`MOST_DECIMALS`].
const POWERS: [(u64, f64); MOST_DECIMALS + 1] = [
    (1, 1e0),
    (10, 1e1),
    (100, 1e2),
    (1_000, 1e3),
    (10_000, 1e4),
    (100_000, 1e5),
    (1_000_000, 1e6),
    (10_000_000, 1e7),
    (100_000_000, 1e8),
    (1_000_000_000, 1e9),
    (10_000_000_000, 1e10),
    (100_000_000_000, 1e11),
    (1_000_000_000_000, 1e12),
    (10_000_000_000_000, 1e13),
    (100_000_000_000_000, 1e14),
    (1_000_000_000_000_000, 1e15),
];

/// Below this number `f64` holds every whole one, with the number itself in its last bits if this is added.
const EXACT: u64 = 1 << 52;

/// A byte of this in each of eight.
const fn each(byte: u8) -> u64 {
    u64::from_ne_bytes([byte; 8])
}

/// Reads the number at the front of a text and returns its length, if it is a short one: up to seven digits, a point
/// and up to fifteen more. What follows, an exponent for example, is not looked at; None means only that someone else
/// has to look.
///
/// Its digits without the point, m, and the power of ten by which it divides them are exact in `f64`, so that their
/// quotient is the number that is nearest to what is written (Clinger, How to read floating point numbers accurately,
/// 1990, section 2).
#[inline(always)]
pub(super) fn short(text: &[u8]) -> Option<(f64, usize)> {
    let sign = usize::from(*text.first()? == b'-');
    let text = text.get(sign..)?;
    let (mut digits, mut end, mut decimals) = Word::of(text)?.head()?;
    // Eight more at a time: what is no longer exact is refused below.
    while end % 8 == 0 && text.get(end)?.is_ascii_digit() {
        let (more, count) = Word::of(text.get(end..)?)?.leading();
        digits = digits.checked_mul(POWERS.get(count)?.0)?.checked_add(more)?;
        (end, decimals) = (end + count, decimals + count);
    }
    if digits >= EXACT {
        return None;
    }
    // As `digits as f64`, which on x86 waits for the number before: its instruction keeps half of the register.
    let whole = f64::from_bits((EXACT as f64).to_bits() | digits) - EXACT as f64;
    let value = whole / POWERS.get(decimals)?.1;
    // No processor foresees the sign of a signal: no branch on it.
    Some((f64::from_bits(value.to_bits() | (sign as u64) << 63), sign + end))
}

/// Eight bytes of a text, handled together (Lamport, Multiple byte processing with full-word instructions, 1975).
struct Word {
    /// Each byte, a digit as its value.
    values: u64,
    /// The highest bit of each byte up to the first that is no digit, and up to the second if that one is a point.
    others: u64,
}

impl Word {
    /// The first bytes of a text. None if it is shorter than that.
    fn of(text: &[u8]) -> Option<Self> {
        let word = u64::from_le_bytes(*text.first_chunk()?);
        let values = word ^ each(b'0');
        // Of any byte but a digit the sum, or it itself, has the highest bit; a digit or a point carries nothing into
        // the bytes after it.
        let others = (values.wrapping_add(each(0x76)) | values) & each(0x80);
        Some(Self { values, others })
    }

    /// The number that the first digits are, one at least, and how many these are.
    fn leading(&self) -> (u64, usize) {
        let bits = self.others.trailing_zeros() & !7;
        (number(self.values, bits), bits as usize / 8)
    }

    /// The number that the first digits are, one at least and all before something else, without a point among them;
    /// the length of all that, and how many of the digits are after the point.
    fn head(&self) -> Option<(u64, usize, usize)> {
        const POINT: u64 = (b'.' ^ b'0') as u64;
        let whole = self.others.trailing_zeros() & !7;
        if whole == 0 || whole == 64 {
            return None;
        }
        if self.values >> whole & 0xff != POINT {
            return Some((number(self.values, whole), whole as usize / 8, 0));
        }
        let all = (self.others & (self.others - 1)).trailing_zeros() & !7;
        let before = (1 << whole) - 1;
        let digits = self.values & before | self.values >> 8 & !before;
        Some((number(digits, all - 8), all as usize / 8, (all - whole) as usize / 8 - 1))
    }
}

/// The number that the digits in the lowest bits of a word are, one digit at least.
fn number(values: u64, bits: u32) -> u64 {
    // Zeros go before the digits, over whatever is after them.
    let values = values.wrapping_shl(64 - bits);
    let pairs = values.wrapping_mul(10).wrapping_add(values >> 8) & 0x00ff_00ff_00ff_00ff;
    let fours = pairs.wrapping_mul(100).wrapping_add(pairs >> 16) & 0x0000_ffff_0000_ffff;
    fours.wrapping_mul(10_000).wrapping_add(fours >> 32) & 0xffff_ffff
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_short_is_read_to_the_bit() {
        for text in [
            "1",
            "-1",
            "0",
            "-0",
            "00012",
            "1.",
            "1.5",
            "-1.288185",
            "0.066336",
            "9999999.99999999",
            "1234567.12345678",
            "0.100000000000000",
            "-0.000000000000001",
            "3.141592653589793",
            "0.12345678",
            "0.123456789",
        ] {
            for end in [",", "\n", " ", "\r\n", ";", "-"] {
                let line = format!("{text}{end}         ");
                let expected = text.parse::<f64>().map(|value| (value.to_bits(), text.len())).ok();
                let found = short(line.as_bytes()).map(|(value, length)| (value.to_bits(), length));
                assert_eq!(found, expected, "{line:?}");
            }
        }
    }

    #[test]
    fn every_number_of_digits_is_right_or_refused() {
        let digits = "98765432101234567890123456789012345";
        for whole in 0..12 {
            for decimals in 0..20 {
                let text = format!("{}.{}", &digits[..whole], &digits[whole..whole + decimals]);
                let Some((value, length)) = short(format!("{text},           ").as_bytes()) else {
                    assert!(!(1..8).contains(&whole) || whole + decimals > 15, "{text}");
                    continue;
                };
                assert_eq!((Ok(value), length), (text.parse::<f64>(), text.len()));
            }
        }
    }

    #[test]
    fn anything_else_is_left_to_others() {
        for text in [
            "",
            "1",
            "1.5",
            "nan          ",
            ".5          ",
            "+1          ",
            "--1         ",
            "12345678        ",
            "1.9007199254740993,         ",
            "1.23456789012345678        ",
            "\u{ff11}          ",
        ] {
            assert_eq!(short(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn no_byte_but_a_digit_is_one() {
        for byte in 0..=u8::MAX {
            for place in 1..8 {
                let mut text = *b"12345678";
                text[place] = byte;
                let count = text.iter().take_while(|byte| byte.is_ascii_digit()).count();
                let expected = text[..count].iter().fold(0, |sum, digit| 10 * sum + u64::from(digit - b'0'));
                assert_eq!(Word::of(&text).map(|word| word.leading()), Some((expected, count)), "{text:?}");
            }
        }
    }
}
