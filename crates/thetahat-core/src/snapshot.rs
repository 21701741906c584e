//! How numbers, vectors and matrices are written and read, for the feature `serde`.
//!
//! A snapshot is exact: what is read back is what was written, to the bit. In text, where a format may have neither
//! NaN nor infinity (JSON has not), these are the words "NaN", "inf" and "-inf".
//!
//! Each type has a `Snapshot` of its own, in a file beside it: its fields without what follows from them, a
//! [`SnapshotVersion`] in front. `snapshot!` makes it of a list of them. What is read is made of it by the constructor,
//! or by the same checks.
//!
//! nalgebra's own implementations would ask for bounds that [`Dimension`] hides; the functions here ask for none.

use core::fmt;
use core::marker::PhantomData;

use nalgebra::{OMatrix, OVector, Scalar};
use serde::de::{DeserializeSeed, Error, SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::triangle::Sum;
use crate::{Dimension, Real};

/// The version of a snapshot, 1, as the first of its fields: it is read if it is the one that this release writes.
///
/// Every snapshot of this crate has it. A type that keeps estimators may start with it too.
///
/// ```
/// use thetahat_core::SnapshotVersion;
///
/// assert_eq!(serde_json::to_string(&SnapshotVersion).unwrap(), "1");
/// let error = serde_json::from_str::<SnapshotVersion>("2").unwrap_err();
/// assert!(error.to_string().starts_with("this snapshot is of version 2, and version 1 is understood"));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SnapshotVersion;

/// The version that is written.
const VERSION: u32 = 1;

impl Serialize for SnapshotVersion {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        VERSION.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for SnapshotVersion {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match u32::deserialize(deserializer)? {
            VERSION => Ok(SnapshotVersion),
            found => Err(D::Error::custom(format_args!(
                "this snapshot is of version {found}, and version {VERSION} is understood: read it with the release that \
                 wrote it"
            ))),
        }
    }
}

/// The snapshot of a type: its version, then these fields of the type, each as its attribute says. After an arrow
/// stands of which field another value is made, and how.
macro_rules! snapshot {
    (
        $snapshot:ident<$($argument:ident),+> of $type:ident<$($of:ident),+> where [$($bounds:tt)+] {
            $($(#[$how:meta])* $field:ident: $kind:ty $(=> $source:ident, $make:expr)?;)+
        }
    ) => {
        #[derive(serde::Serialize, serde::Deserialize)]
        #[serde(bound = "")]
        pub(super) struct $snapshot<$($bounds)+> {
            version: crate::SnapshotVersion,
            $($(#[$how])* $field: $kind,)+
        }

        impl<$($bounds)+> From<$type<$($of),+>> for $snapshot<$($argument),+> {
            fn from(of: $type<$($of),+>) -> Self {
                $snapshot {
                    version: crate::SnapshotVersion,
                    $($field: crate::snapshot::snapshot!(@ of $field $($source, $make)?),)+
                }
            }
        }
    };
    (@ $of:ident $field:ident) => { $of.$field };
    (@ $of:ident $field:ident $source:ident, $make:expr) => { $make(&$of.$source) };
}
pub(crate) use snapshot;

/// What stands in a vector or matrix.
pub(crate) trait Entry: Scalar + Copy {
    /// What stands there until it is read.
    const BLANK: Self;
    fn write<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error>;
    fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error>;
}

impl<T: Real> Entry for T {
    const BLANK: T = T::NAN;

    fn write<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.is_finite() || !serializer.is_human_readable() {
            self.serialize(serializer)
        } else if self.abs() == T::INFINITY {
            serializer.serialize_str(if *self > T::zero() { "inf" } else { "-inf" })
        } else {
            serializer.serialize_str("NaN")
        }
    }

    fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
        if deserializer.is_human_readable() {
            deserializer.deserialize_any(Number(PhantomData))
        } else {
            T::deserialize(deserializer)
        }
    }
}

impl Entry for bool {
    const BLANK: bool = false;

    fn write<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.serialize(serializer)
    }

    fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<bool, D::Error> {
        bool::deserialize(deserializer)
    }
}

/// Reads a number, or the word for one.
struct Number<T>(PhantomData<T>);

impl<T: Real> Entry for Sum<T> {
    const BLANK: Sum<T> = Sum { value: T::NAN, carry: T::NAN };

    fn write<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (Written(&self.value), Written(&self.carry)).serialize(serializer)
    }

    fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Sum<T>, D::Error> {
        let (Read(value), Read(carry)) = Deserialize::deserialize(deserializer)?;
        Ok(Sum { value, carry })
    }
}

impl<T: Real> Visitor<'_> for Number<T> {
    type Value = T;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a number, \"NaN\", \"inf\" or \"-inf\"")
    }

    /// What was written from an `f32` is one, so that this is exact.
    fn visit_f64<E: Error>(self, value: f64) -> Result<T, E> {
        Ok(nalgebra::convert(value))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<T, E> {
        self.visit_f64(value as f64)
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<T, E> {
        self.visit_f64(value as f64)
    }

    fn visit_str<E: Error>(self, word: &str) -> Result<T, E> {
        match word {
            "NaN" => Ok(T::NAN),
            "inf" => Ok(T::INFINITY),
            "-inf" => Ok(-T::INFINITY),
            _ => Err(E::invalid_value(Unexpected::Str(word), &self)),
        }
    }
}

/// Writes one entry.
struct Written<'a, E>(&'a E);

impl<E: Entry> Serialize for Written<'_, E> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.write(serializer)
    }
}

/// Reads one entry.
struct Read<E>(E);

impl<'de, E: Entry> Deserialize<'de> for Read<E> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        E::read(deserializer).map(Read)
    }
}

/// Writes the sizes and the entries, column by column.
fn write<E: Entry, S: Serializer>(
    rows: usize,
    columns: usize,
    entries: &[E],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    struct All<'a, E>(&'a [E]);

    impl<E: Entry> Serialize for All<'_, E> {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            serializer.collect_seq(self.0.iter().map(Written))
        }
    }

    (rows, columns, All(entries)).serialize(serializer)
}

/// Reads what [`write()`] writes, into the matrix that `make` makes for the sizes.
struct Matrix<M, E> {
    make: fn(usize, usize) -> Option<M>,
    entries: fn(&mut M) -> &mut [E],
}

impl<'de, M, E: Entry> Visitor<'de> for Matrix<M, E> {
    type Value = M;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("the rows, the columns and the entries of a matrix of the size of this type")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut parts: A) -> Result<M, A::Error> {
        let wrong = |index| A::Error::invalid_length(index, &self);
        let rows = parts.next_element::<usize>()?.ok_or_else(|| wrong(0))?;
        let columns = parts.next_element::<usize>()?.ok_or_else(|| wrong(1))?;
        let count = rows.checked_mul(columns).ok_or_else(|| wrong(rows))?;
        let make = || (self.make)(rows, columns).ok_or_else(|| wrong(rows));
        // What a snapshot claims asks for no memory before it is there.
        #[cfg(feature = "alloc")]
        {
            let mut found = alloc::vec::Vec::new();
            parts
                .next_element_seed(Entries { count, take: |entry| found.push(entry), kind: PhantomData })?
                .ok_or_else(|| wrong(2))?;
            let mut matrix = make()?;
            crate::ud::copy(&found, (self.entries)(&mut matrix));
            Ok(matrix)
        }
        // Without a heap the type says how large it is.
        #[cfg(not(feature = "alloc"))]
        {
            let mut matrix = make()?;
            let mut places = (self.entries)(&mut matrix).iter_mut();
            let take = |entry| {
                if let Some(place) = places.next() {
                    *place = entry;
                }
            };
            parts.next_element_seed(Entries { count, take, kind: PhantomData })?.ok_or_else(|| wrong(2))?;
            Ok(matrix)
        }
    }
}

/// Reads exactly `count` entries.
struct Entries<E, F> {
    count: usize,
    take: F,
    kind: PhantomData<E>,
}

impl<'de, E: Entry, F: FnMut(E)> DeserializeSeed<'de> for Entries<E, F> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de, E: Entry, F: FnMut(E)> Visitor<'de> for Entries<E, F> {
    type Value = ();

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} entries", self.count)
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut entries: A) -> Result<(), A::Error> {
        let wrong = |count| A::Error::invalid_length(count, &"as many entries as rows times columns");
        for index in 0..self.count {
            let Read(entry) = entries.next_element()?.ok_or_else(|| wrong(index))?;
            (self.take)(entry);
        }
        match entries.next_element::<Read<E>>()? {
            None => Ok(()),
            Some(_) => Err(wrong(self.count.saturating_add(1))),
        }
    }
}

/// For `#[serde(with)]` on a number that may be NaN or infinite.
pub(crate) mod number {
    use super::{Deserializer, Entry, Serializer};

    pub(crate) fn serialize<E: Entry, S: Serializer>(entry: &E, serializer: S) -> Result<S::Ok, S::Error> {
        entry.write(serializer)
    }

    pub(crate) fn deserialize<'de, E: Entry, D: Deserializer<'de>>(deserializer: D) -> Result<E, D::Error> {
        E::read(deserializer)
    }
}

/// For `#[serde(with)]` on a range whose ends may be infinite.
pub(crate) mod range {
    use core::ops::RangeInclusive;

    use serde::{Deserialize, Serialize};

    use super::{Deserializer, Entry, Read, Serializer, Written};

    pub(crate) fn serialize<E: Entry, S: Serializer>(
        range: &RangeInclusive<E>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        (Written(range.start()), Written(range.end())).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, E: Entry, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<RangeInclusive<E>, D::Error> {
        let (Read(start), Read(end)) = Deserialize::deserialize(deserializer)?;
        Ok(start..=end)
    }
}

/// For `#[serde(with)]` on a vector.
pub(crate) mod vector {
    use super::{Deserializer, Dimension, Entry, Matrix, OVector, Serializer, write};

    pub(crate) fn serialize<E: Entry, N: Dimension, S: Serializer>(
        vector: &OVector<E, N>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        write(vector.len(), 1, vector.as_slice(), serializer)
    }

    pub(crate) fn deserialize<'de, E: Entry, N: Dimension, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<OVector<E, N>, D::Error> {
        let visitor = Matrix {
            make: |rows, columns| {
                let size = if columns == 1 { N::exactly(rows).ok() } else { None };
                size.map(|size| size.vector(E::BLANK))
            },
            entries: |vector: &mut OVector<E, N>| vector.as_mut_slice(),
        };
        deserializer.deserialize_tuple(3, visitor)
    }
}

/// For `#[serde(with)]` on a square matrix.
pub(crate) mod square {
    use super::{Deserializer, Dimension, Entry, Matrix, OMatrix, Serializer, write};

    pub(crate) fn serialize<E: Entry, N: Dimension, S: Serializer>(
        matrix: &OMatrix<E, N, N>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        write(matrix.nrows(), matrix.ncols(), matrix.as_slice(), serializer)
    }

    pub(crate) fn deserialize<'de, E: Entry, N: Dimension, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<OMatrix<E, N, N>, D::Error> {
        let visitor = Matrix {
            make: |rows, columns| {
                let size = if rows == columns { N::exactly(rows).ok() } else { None };
                size.map(|size| size.square(E::BLANK))
            },
            entries: |matrix: &mut OMatrix<E, N, N>| matrix.as_mut_slice(),
        };
        deserializer.deserialize_tuple(3, visitor)
    }
}

/// For `#[serde(with)]` on any other matrix.
pub(crate) mod matrix {
    use super::{Deserializer, Dimension, Entry, Matrix, OMatrix, Serializer, write};

    pub(crate) fn serialize<E: Entry, R: Dimension<C>, C: Dimension, S: Serializer>(
        matrix: &OMatrix<E, R, C>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        write(matrix.nrows(), matrix.ncols(), matrix.as_slice(), serializer)
    }

    pub(crate) fn deserialize<'de, E: Entry, R: Dimension<C>, C: Dimension, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<OMatrix<E, R, C>, D::Error> {
        let visitor = Matrix {
            make: |rows, columns| Some(R::exactly(rows).ok()?.rows_by(C::exactly(columns).ok()?, E::BLANK)),
            entries: |matrix: &mut OMatrix<E, R, C>| matrix.as_mut_slice(),
        };
        deserializer.deserialize_tuple(3, visitor)
    }
}
