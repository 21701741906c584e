//! Numbers as they stand in messages: little-endian.

/// How a number is written.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F16,
    F32,
    F64,
    /// A byte: everything but zero is true.
    Bool,
}

impl Number {
    /// How many bytes it takes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 | Self::Bool => 1,
            Self::I16 | Self::U16 | Self::F16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Whether it may be a whole number beyond 2^53.
    pub(super) fn is_long(self) -> bool {
        matches!(self, Self::I64 | Self::U64)
    }

    /// The number at a place; none where the bytes end before it does.
    pub(super) fn read(self, bytes: &[u8], at: usize) -> Option<f64> {
        Some(match self {
            Self::I8 => f64::from(i8::from_le_bytes(array(bytes, at)?)),
            Self::U8 => f64::from(u8::from_le_bytes(array(bytes, at)?)),
            Self::I16 => f64::from(i16::from_le_bytes(array(bytes, at)?)),
            Self::U16 => f64::from(u16::from_le_bytes(array(bytes, at)?)),
            Self::I32 => f64::from(i32::from_le_bytes(array(bytes, at)?)),
            Self::U32 => f64::from(u32::from_le_bytes(array(bytes, at)?)),
            Self::I64 => i64::from_le_bytes(array(bytes, at)?) as f64,
            Self::U64 => u64::from_le_bytes(array(bytes, at)?) as f64,
            Self::F16 => half(u16::from_le_bytes(array(bytes, at)?)),
            Self::F32 => f64::from(f32::from_le_bytes(array(bytes, at)?)),
            Self::F64 => f64::from_le_bytes(array(bytes, at)?),
            Self::Bool => f64::from(u8::from(u8::from_le_bytes(array(bytes, at)?) != 0)),
        })
    }
}

/// So many bytes at a place; none where there are not as many.
pub(super) fn array<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..at.checked_add(N)?)?.try_into().ok()
}

/// A number of 16 bits: sign, 5 bits of exponent, 10 of fraction.
fn half(bits: u16) -> f64 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff) / 1024.0);
    match exponent {
        0 => sign * fraction * 2_f64.powi(-14),
        31 if fraction == 0.0 => sign * f64::INFINITY,
        31 => f64::NAN,
        _ => sign * (1.0 + fraction) * 2_f64.powi(exponent - 15),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_where_they_stand() {
        let bytes = [9, 0xfe, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff];
        for (number, value) in [
            (Number::I8, -2.0),
            (Number::U8, 254.0),
            (Number::I16, -2.0),
            (Number::U16, 65_534.0),
            (Number::I32, -2.0),
            (Number::U32, 4_294_967_294.0),
            (Number::I64, -2.0),
            (Number::U64, 18_446_744_073_709_551_614.0),
            (Number::Bool, 1.0),
        ] {
            assert_eq!(number.read(&bytes, 1), Some(value), "{number:?}");
            assert_eq!(number.read(&bytes[..number.size()], 1), None, "{number:?}");
            assert_eq!(number.read(&bytes, usize::MAX), None, "{number:?}");
        }
        assert_eq!(Number::F32.read(&1.5_f32.to_le_bytes(), 0), Some(1.5));
        assert_eq!(Number::F64.read(&(-0.1_f64).to_le_bytes(), 0), Some(-0.1));
    }

    #[test]
    fn halves_are_read() {
        for (bits, value) in [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65_504.0),
            (0x0001, 2_f64.powi(-24)),
            (0x3555, 0.333_251_953_125),
            (0x7c00, f64::INFINITY),
            (0x8000, 0.0),
        ] {
            assert_eq!(half(bits), value, "{bits:#x}");
        }
        assert!(half(0x7e00).is_nan());
    }
}
