//! The values of an array as numbers, texts or times, whatever its type.

use std::collections::TryReserveError;

use arrow_array::cast::AsArray;
use arrow_array::types::*;
use arrow_array::{Array, ArrowPrimitiveType};
use arrow_schema::{DataType, TimeUnit};

/// The largest number up to which `f64` holds every whole one.
const EXACT: u64 = 1 << 53;

/// What a column holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Numbers,
    Texts,
    /// Instants or dates: so many nanoseconds a unit since 1970, and where they were written.
    Instants(i64, Zone),
    /// Durations, or times of day: so many nanoseconds a unit.
    Durations(i64),
    /// Anything else.
    Others,
}

/// Where instants were written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Zone {
    /// Only the day is known.
    Day,
    /// Nobody says; it is taken for UTC.
    Unknown,
    /// In this zone, or at this offset from UTC.
    Named(String),
}

impl Kind {
    /// That of a type.
    pub(super) fn of(data_type: &DataType) -> Self {
        match data_type {
            DataType::Null | DataType::Boolean => Self::Numbers,
            numeric if numeric.is_numeric() => Self::Numbers,
            DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View => Self::Texts,
            DataType::Dictionary(_, values) => match Self::of(values) {
                // A time that comes from a dictionary is nothing that a log has.
                Self::Instants(..) | Self::Durations(_) => Self::Others,
                kind => kind,
            },
            DataType::Timestamp(unit, zone) => Self::Instants(
                nanoseconds(*unit),
                zone.as_ref().map_or(Zone::Unknown, |zone| Zone::Named(zone.to_string())),
            ),
            DataType::Date32 => Self::Instants(86_400_000_000_000, Zone::Day),
            DataType::Date64 => Self::Instants(1_000_000, Zone::Unknown),
            DataType::Time32(unit) | DataType::Time64(unit) | DataType::Duration(unit) => {
                Self::Durations(nanoseconds(*unit))
            }
            _ => Self::Others,
        }
    }

    /// What it holds, in a message.
    pub(super) fn said(&self) -> &'static str {
        match self {
            Self::Numbers => "numbers",
            Self::Texts => "texts",
            Self::Instants(..) => "instants",
            Self::Durations(_) => "durations",
            Self::Others => "something else",
        }
    }
}

fn nanoseconds(unit: TimeUnit) -> i64 {
    match unit {
        TimeUnit::Second => 1_000_000_000,
        TimeUnit::Millisecond => 1_000_000,
        TimeUnit::Microsecond => 1_000,
        TimeUnit::Nanosecond => 1,
    }
}

/// Appends numbers; what is null is NaN. Says whether one was rounded, since it is a whole number beyond 2^53.
///
/// # Errors
/// That there is no memory for as many: nulls take none in a file.
pub(super) fn numbers(array: &dyn Array, out: &mut Vec<f64>) -> Result<bool, TryReserveError> {
    out.try_reserve(array.len())?;
    match array.data_type() {
        DataType::Float64 => append::<Float64Type>(array, out, |value| value),
        DataType::Float32 => append::<Float32Type>(array, out, f64::from),
        DataType::Float16 => append::<Float16Type>(array, out, f64::from),
        DataType::Int8 => append::<Int8Type>(array, out, f64::from),
        DataType::Int16 => append::<Int16Type>(array, out, f64::from),
        DataType::Int32 => append::<Int32Type>(array, out, f64::from),
        DataType::UInt8 => append::<UInt8Type>(array, out, f64::from),
        DataType::UInt16 => append::<UInt16Type>(array, out, f64::from),
        DataType::UInt32 => append::<UInt32Type>(array, out, f64::from),
        DataType::Int64 => {
            append::<Int64Type>(array, out, |value| value as f64);
            return Ok(any::<Int64Type>(array, |value| value.unsigned_abs() > EXACT));
        }
        DataType::UInt64 => {
            append::<UInt64Type>(array, out, |value| value as f64);
            return Ok(any::<UInt64Type>(array, |value| value > EXACT));
        }
        DataType::Decimal32(_, scale) => {
            append::<Decimal32Type>(array, out, |digits| decimal(i128::from(digits), *scale));
        }
        DataType::Decimal64(_, scale) => {
            append::<Decimal64Type>(array, out, |digits| decimal(i128::from(digits), *scale));
        }
        DataType::Decimal128(_, scale) => {
            append::<Decimal128Type>(array, out, |digits| decimal(digits, *scale));
        }
        DataType::Decimal256(_, scale) => {
            append::<Decimal256Type>(array, out, |digits| match digits.to_i128() {
                Some(digits) => decimal(digits, *scale),
                None => written(digits, *scale),
            });
        }
        DataType::Boolean => {
            let values = array.as_boolean_opt();
            let number = |value: Option<bool>| value.map_or(f64::NAN, |value| f64::from(u8::from(value)));
            out.extend(values.into_iter().flat_map(|values| values.iter().map(number)));
        }
        DataType::Dictionary(..) => {
            let Some(dictionary) = array.as_any_dictionary_opt() else { return Ok(false) };
            let mut values = Vec::new();
            let rounded = numbers(dictionary.values().as_ref(), &mut values)?;
            let value = |key: Option<usize>| key.and_then(|key| values.get(key).copied()).unwrap_or(f64::NAN);
            out.extend(keys(array).into_iter().map(value));
            return Ok(rounded);
        }
        // A column of nulls.
        _ => out.resize(out.len() + array.len(), f64::NAN),
    }
    Ok(false)
}

/// The texts of an array; None for what is null.
pub(super) fn texts(array: &dyn Array) -> Vec<Option<&str>> {
    if let Some(texts) = array.as_string_opt::<i32>() {
        texts.iter().collect()
    } else if let Some(texts) = array.as_string_opt::<i64>() {
        texts.iter().collect()
    } else if let Some(texts) = array.as_string_view_opt() {
        texts.iter().collect()
    } else if let Some(dictionary) = array.as_any_dictionary_opt() {
        let values = texts(dictionary.values().as_ref());
        keys(array).into_iter().map(|key| values.get(key?).copied().flatten()).collect()
    } else {
        vec![None; array.len()]
    }
}

/// The times of an array in its own unit; None for what is null.
pub(super) fn times(array: &dyn Array) -> Vec<Option<i64>> {
    match array.data_type() {
        DataType::Timestamp(TimeUnit::Second, _) => whole::<TimestampSecondType>(array),
        DataType::Timestamp(TimeUnit::Millisecond, _) => whole::<TimestampMillisecondType>(array),
        DataType::Timestamp(TimeUnit::Microsecond, _) => whole::<TimestampMicrosecondType>(array),
        DataType::Timestamp(TimeUnit::Nanosecond, _) => whole::<TimestampNanosecondType>(array),
        DataType::Date32 => whole::<Date32Type>(array),
        DataType::Date64 => whole::<Date64Type>(array),
        DataType::Time32(TimeUnit::Second) => whole::<Time32SecondType>(array),
        DataType::Time32(_) => whole::<Time32MillisecondType>(array),
        DataType::Time64(TimeUnit::Microsecond) => whole::<Time64MicrosecondType>(array),
        DataType::Time64(_) => whole::<Time64NanosecondType>(array),
        DataType::Duration(TimeUnit::Second) => whole::<DurationSecondType>(array),
        DataType::Duration(TimeUnit::Millisecond) => whole::<DurationMillisecondType>(array),
        DataType::Duration(TimeUnit::Microsecond) => whole::<DurationMicrosecondType>(array),
        DataType::Duration(TimeUnit::Nanosecond) => whole::<DurationNanosecondType>(array),
        _ => vec![None; array.len()],
    }
}

/// Appends the values of an array of one type, each by `number`; NaN where it is null.
fn append<T: ArrowPrimitiveType>(array: &dyn Array, out: &mut Vec<f64>, number: impl Fn(T::Native) -> f64) {
    let Some(values) = array.as_primitive_opt::<T>() else { return };
    let start = out.len();
    out.extend(values.values().iter().map(|&value| number(value)));
    if let Some(nulls) = values.nulls().filter(|nulls| nulls.null_count() > 0) {
        let rows = out.get_mut(start..).unwrap_or_default();
        rows.iter_mut().zip(nulls).filter(|(_, is_there)| !is_there).for_each(|(value, _)| *value = f64::NAN);
    }
}

/// Whether any value that is there is such.
fn any<T: ArrowPrimitiveType>(array: &dyn Array, is_such: impl Fn(T::Native) -> bool) -> bool {
    array.as_primitive_opt::<T>().is_some_and(|values| values.iter().flatten().any(is_such))
}

fn whole<T: ArrowPrimitiveType<Native: Into<i64>>>(array: &dyn Array) -> Vec<Option<i64>> {
    let values = array.as_primitive_opt::<T>();
    values.into_iter().flat_map(|values| values.iter().map(|value| value.map(Into::into))).collect()
}

/// Where the values of the rows stand in a dictionary; None for what is null.
fn keys(array: &dyn Array) -> Vec<Option<usize>> {
    let Some(dictionary) = array.as_any_dictionary_opt() else { return Vec::new() };
    if dictionary.values().is_empty() {
        return vec![None; array.len()];
    }
    let keys = dictionary.normalized_keys().into_iter().enumerate();
    keys.map(|(row, key)| dictionary.keys().is_valid(row).then_some(key)).collect()
}

/// digits / 10^scale, rounded once: both are exact in `f64` (Clinger, How to read floating point numbers accurately,
/// 1990, section 2), or the number is read from its text.
fn decimal(digits: i128, scale: i8) -> f64 {
    const POWERS: i8 = 22;
    if digits.unsigned_abs() <= u128::from(EXACT) && (0..=POWERS).contains(&scale) {
        // Each of the products is a power of ten that f64 holds.
        digits as f64 / (0..scale).fold(1.0, |power, _| power * 10.0)
    } else {
        written(digits, scale)
    }
}

fn written(digits: impl std::fmt::Display, scale: i8) -> f64 {
    format!("{digits}e{}", -i16::from(scale)).parse().unwrap_or(f64::NAN)
}
