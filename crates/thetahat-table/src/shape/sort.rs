//! What a field holds: a number, a date, a word.

use crate::number::Numbers;
use crate::words::{self, States};

/// What is in a field.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Sort {
    Missing,
    Status,
    Number,
    Date,
    State,
    Word,
}

impl Sort {
    pub(super) fn of(field: &[u8], numbers: &Numbers) -> Self {
        if numbers.is_missing(field) {
            Self::Missing
        } else if numbers.value(field).is_some() || numbers.is_nearly(field) {
            Self::Number
        } else if is_date(field) {
            Self::Date
        } else if States::of(field).next().is_some() {
            Self::State
        } else if words::status(field).is_some() {
            Self::Status
        } else {
            Self::Word
        }
    }

    pub(super) fn is_missing(self) -> bool {
        matches!(self, Self::Missing | Self::Status)
    }

    /// Whether it is written in digits: a number or a date.
    pub(super) fn is_value(self) -> bool {
        matches!(self, Self::Number | Self::Date)
    }
}

/// Whether a field looks like a date or a time of day.
fn is_date(field: &[u8]) -> bool {
    const MONTHS: [&[u8]; 12] =
        [b"Jan", b"Feb", b"Mar", b"Apr", b"May", b"Jun", b"Jul", b"Aug", b"Sep", b"Oct", b"Nov", b"Dec"];
    let allowed = |byte: &u8| byte.is_ascii_digit() || b" -/:.,TZ+apmAPM[]_".contains(byte);
    // As in 10-Jan-2024.
    if let [_, b'-', rest @ ..] | [_, _, b'-', rest @ ..] = field
        && let Some((month, rest)) = rest.split_at_checked(3)
        && MONTHS.iter().any(|known| known.eq_ignore_ascii_case(month))
    {
        return rest.first() == Some(&b'-') && rest[1..].iter().all(allowed);
    }
    let digits = field.iter().filter(|byte| byte.is_ascii_digit()).count();
    let zone = field.iter().position(|&byte| byte == b'[').unwrap_or(field.len());
    field.first().is_some_and(u8::is_ascii_digit)
        && digits >= 3
        && field[..zone].iter().all(allowed)
        && field.iter().any(|byte| b"-/:.".contains(byte))
}
