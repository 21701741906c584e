//! What can be wrong with an argument.

use core::fmt;

use crate::Real;

/// What is wrong, and with which argument.
///
/// Whatever returns an error has left its receiver as it was.
///
/// ```
/// use thetahat_core::Error;
///
/// let error = Error::NotFinite { argument: "output" };
/// assert_eq!(error.to_string(), "output is NaN or infinite: leave this sample out");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(all(feature = "defmt", target_os = "none"), derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum Error {
    /// A row of a regression holds NaN or infinity.
    NotFinite {
        /// The argument that does.
        argument: &'static str,
    },
    /// A sample is infinite. (NaN is a missing sample, and no error.)
    Infinite {
        /// The argument that is.
        argument: &'static str,
    },
    /// A finite number is so large that later sums could overflow.
    TooLarge {
        /// The argument that holds it.
        argument: &'static str,
    },
    /// A number that must not be negative is.
    Negative {
        /// The argument that is.
        argument: &'static str,
    },
    /// A vector or matrix has the wrong size.
    Length {
        /// The argument that has it.
        argument: &'static str,
        /// The size it should have.
        expected: usize,
        /// The size it has.
        found: usize,
    },
    /// The orders make another number of parameters than the type holds.
    Orders {
        /// The number of parameters the orders make: na plus every nb, plus nc, plus 1 with a constant.
        needed: usize,
        /// The number of parameters the type holds.
        available: usize,
    },
    /// The delays need more stored samples than the type holds.
    Delays {
        /// The number of samples the delays need: the nk of every input that has coefficients, added up.
        needed: usize,
        /// The number of samples the type holds.
        available: usize,
    },
    /// An input acts on the output of its own sample (nk = 0), so that u(k) must be known before y(k) is.
    InputFirst {
        /// The input, from 0.
        input: usize,
    },
    /// A covariance is not symmetric.
    NotSymmetric {
        /// The row of an entry that differs from its mirror image, from 0.
        row: usize,
        /// The column of that entry, from 0.
        column: usize,
    },
    /// A covariance has a negative variance, or correlations that no random vector can have.
    NotPositive {
        /// The argument that has.
        argument: &'static str,
        /// The element, from 0, whose variance is negative once others are known.
        index: usize,
    },
    /// A number lies outside its range.
    OutOfRange {
        /// The argument that does.
        argument: &'static str,
        /// The range it must lie in.
        range: &'static str,
    },
    /// An innovation has no variance: the measurement and what it measures are both known exactly.
    NoVariance {
        /// The element of the measurement, from 0.
        index: usize,
    },
    /// A triangular factor has a non-zero entry below its diagonal.
    NotTriangular {
        /// The row of the entry, from 0.
        row: usize,
        /// The column of the entry, from 0.
        column: usize,
    },
    /// There are fewer rows than the result needs.
    TooFewRows {
        /// The number of rows it needs.
        needed: usize,
        /// The number of rows there are.
        found: usize,
    },
    /// The number of rows no longer fits its counter.
    TooManyRows,
    /// The columns of the regression are linearly dependent.
    RankDeficient {
        /// The first column that depends on the others, from 0.
        /// [`LeastSquares::rank`](crate::LeastSquares::rank) names them all.
        column: usize,
    },
    /// Some states cannot be told from the outputs, so that an observer cannot place their poles.
    NotObservable {
        /// The number of states that can be.
        rank: usize,
        /// The number of states there are.
        states: usize,
    },
    /// An iteration did not settle within the steps it was given.
    NotConverged {
        /// That number of steps.
        steps: usize,
    },
    /// A result does not fit the scalar type.
    Overflow,
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Error::NotFinite { argument } => {
                write!(formatter, "{argument} is NaN or infinite: leave this sample out")
            }
            Error::Infinite { argument } => {
                write!(formatter, "{argument} is infinite: if the sample is missing, pass NaN")
            }
            Error::TooLarge { argument } => {
                write!(formatter, "{argument} is too large for sums without overflow: use a larger unit")
            }
            Error::Negative { argument } => {
                write!(formatter, "{argument} is negative: it must be 0 or more")
            }
            Error::Length { argument, expected, found } => {
                write!(formatter, "{argument} has size {found}: it must have size {expected}")
            }
            Error::Orders { needed, available } => write!(
                formatter,
                "the orders make {needed} parameters (na plus every nb, plus nc, plus 1 with a constant), but the type holds {available}: \
                 make the two equal"
            ),
            Error::Delays { needed, available } => write!(
                formatter,
                "the delays need {needed} stored samples (the nk of all inputs, added up), but the type holds \
                 {available}: make room for {needed}"
            ),
            Error::InputFirst { input } => write!(
                formatter,
                "input {input} acts on the output of its own sample (nk = 0), so that u(k) must be known before \
                 y(k) is: give both with log_row"
            ),
            Error::NotSymmetric { row, column } => write!(
                formatter,
                "the covariance is not symmetric: entries {row}, {column} and {column}, {row} must be equal"
            ),
            Error::NotPositive { argument, index } => write!(
                formatter,
                "{argument} is not positive semidefinite: the variance of element {index}, given others, is \
                 negative"
            ),
            Error::OutOfRange { argument, range } => {
                write!(formatter, "{argument} is out of range: it must be {range}")
            }
            Error::NoVariance { index } => write!(
                formatter,
                "element {index} of the measurement is known exactly before it is measured: give it a noise \
                 variance above 0"
            ),
            Error::NotTriangular { row, column } => {
                write!(formatter, "the factor is not upper triangular: row {row}, column {column} must be 0")
            }
            Error::TooFewRows { needed, found } => {
                write!(formatter, "there are {found} rows, but at least {needed} are needed: add more rows")
            }
            Error::TooManyRows => {
                write!(formatter, "the number of rows no longer fits its counter: start again")
            }
            Error::RankDeficient { column } => write!(
                formatter,
                "column {column} of the regression depends on the others: remove it, or excite the system more"
            ),
            Error::NotObservable { rank, states } => write!(
                formatter,
                "only {rank} of the {states} states can be told from the outputs: measure something else, or \
                 leave states out of the model"
            ),
            Error::NotConverged { steps } => write!(
                formatter,
                "not settled after {steps} steps: allow more, or check that all that is unstable is measured"
            ),
            Error::Overflow => {
                write!(
                    formatter,
                    "the result is too large for a number: use other units, or double precision"
                )
            }
        }
    }
}

impl core::error::Error for Error {}

/// That an argument has the size it must have, which a type guarantees but for `Dyn`.
pub(crate) fn check_length(argument: &'static str, expected: usize, found: usize) -> Result<(), Error> {
    if found == expected { Ok(()) } else { Err(Error::Length { argument, expected, found }) }
}

/// That no entry is NaN or infinite.
pub(crate) fn check_finite<T: Real>(argument: &'static str, entries: &[T]) -> Result<(), Error> {
    if entries.iter().all(T::is_finite) { Ok(()) } else { Err(Error::NotFinite { argument }) }
}

/// That an argument has its size and is finite.
pub(crate) fn check_entries<T: Real>(
    argument: &'static str,
    entries: &[T],
    expected: usize,
) -> Result<(), Error> {
    check_length(argument, expected, entries.len())?;
    check_finite(argument, entries)
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::string::{String, ToString};

    use super::Error;

    #[test]
    fn it_is_small_and_a_standard_error() {
        assert!(size_of::<Error>() <= 5 * size_of::<usize>());
        let error: &dyn core::error::Error = &Error::TooManyRows;
        assert!(error.source().is_none());
    }

    #[test]
    fn every_message_names_what_is_wrong_and_what_to_do() {
        let argument = "output";
        let (needed, available, found, expected) = (731, 732, 733, 734);
        let (row, column) = (735, 736);
        let cases: [(Error, &[&str]); 19] = [
            (Error::NotFinite { argument }, &["output", "leave"]),
            (Error::Infinite { argument }, &["output", "pass NaN"]),
            (Error::TooLarge { argument }, &["output", "unit"]),
            (Error::Negative { argument }, &["output", "0 or more"]),
            (Error::Length { argument, expected, found }, &["output", "733", "734"]),
            (Error::Orders { needed, available }, &["731", "732", "make the two equal"]),
            (Error::Delays { needed, available }, &["731", "732", "make room"]),
            (Error::InputFirst { input: 735 }, &["735", "nk = 0", "log_row"]),
            (Error::NotTriangular { row, column }, &["735", "736", "must be 0"]),
            (Error::TooFewRows { needed, found }, &["731", "733", "add more rows"]),
            (Error::TooManyRows, &["start again"]),
            (Error::RankDeficient { column }, &["736", "remove it"]),
            (Error::NotSymmetric { row, column }, &["735, 736", "736, 735", "equal"]),
            (Error::NotPositive { argument, index: row }, &["output", "735", "negative"]),
            (Error::OutOfRange { argument, range: "above 0" }, &["output", "must be above 0"]),
            (Error::NoVariance { index: row }, &["735", "noise variance above 0"]),
            (Error::NotObservable { rank: row, states: column }, &["735", "736", "measure"]),
            (Error::NotConverged { steps: needed }, &["731", "allow more"]),
            (Error::Overflow, &["double precision"]),
        ];
        for (error, parts) in cases {
            let message: String = error.to_string();
            for part in parts {
                assert!(message.contains(part), "{message:?} lacks {part:?}");
            }
        }
    }
}
