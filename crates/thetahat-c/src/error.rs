//! Codes of errors, their names and texts.

use core::ffi::{CStr, c_char};

/// What a function answers: 0 if all is well. A call that answers anything else has changed nothing.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// All is well.
    None = 0,
    /// A pointer that is needed is NULL.
    NullPointer = 1,
    /// A pointer is not aligned for what it points to.
    Misaligned = 2,
    /// There are fewer bytes of memory than the object needs.
    MemoryTooSmall = 3,
    /// The object was not initialised, or is of another kind.
    NotInitialised = 4,
    /// A function of the user has called back with the object that called it.
    Busy = 5,
    /// The object has no model yet: set it first.
    NoModel = 6,
    /// A row of a regression, a model, or a setting holds NaN or infinity.
    NotFinite = 7,
    /// A sample is infinite. (NaN is a missing sample, and no error.)
    Infinite = 8,
    /// A finite number is so large that later sums could overflow.
    TooLarge = 9,
    /// A number that must not be negative is.
    Negative = 10,
    /// An array has the wrong number of values.
    Length = 11,
    /// The orders make another number of parameters than the size has.
    Orders = 12,
    /// The delays need more stored samples than the size has.
    Delays = 13,
    /// An input acts on the output of its own sample (nk = 0): give both with `log_row`.
    InputFirst = 14,
    /// A covariance is not symmetric.
    NotSymmetric = 15,
    /// A covariance has a negative variance, or correlations that no random vector can have.
    NotPositive = 16,
    /// A number lies outside its range.
    OutOfRange = 17,
    /// An innovation has no variance: the measurement and what it measures are both known exactly.
    NoVariance = 18,
    /// Some states cannot be told from the outputs, so that an observer cannot place their poles.
    NotObservable = 19,
    /// A result does not fit the number type.
    Overflow = 20,
    /// Another error of the core.
    Other = 21,
    /// An observation has a D that does not belong to the inputs of the transition: set the transition first.
    Inputs = 22,
}

/// Name and text of each error, in the order of the codes.
static TEXTS: [(&CStr, &CStr); 23] = [
    (c"NONE", c"all is well"),
    (c"NULL_POINTER", c"a pointer is NULL: pass an array or object"),
    (c"MISALIGNED", c"a pointer is not aligned: declare memory as thetahat_word, numbers as thetahat_number"),
    (
        c"MEMORY_TOO_SMALL",
        c"the memory is too small: take the macro THETAHAT_..._WORDS of this kind and size",
    ),
    (c"NOT_INITIALISED", c"the object is not initialised, or of another kind: call its init function first"),
    (c"BUSY", c"the object is in use: a function of a model must not call with the filter that called it"),
    (c"NO_MODEL", c"the model is not set: set transition and observation first"),
    (c"NOT_FINITE", c"a number is NaN or infinite where it must be finite"),
    (c"INFINITE", c"a sample is infinite: if it is missing, pass NaN"),
    (c"TOO_LARGE", c"a number is too large for sums without overflow: use a larger unit"),
    (c"NEGATIVE", c"a number is negative: it must be 0 or more"),
    (c"LENGTH", c"an array has the wrong number of values, or there are more than the size allows"),
    (
        c"ORDERS",
        c"the orders make another number of parameters than the size has: take the size of their sum",
    ),
    (c"DELAYS", c"the delays need more stored samples than THETAHAT_MOST_DELAYS: delay the input before"),
    (
        c"INPUT_FIRST",
        c"an input acts at once (nk = 0), so that u(k) must be known before y(k) is: use log_row",
    ),
    (c"NOT_SYMMETRIC", c"a covariance is not symmetric: make entries i, j and j, i equal"),
    (c"NOT_POSITIVE", c"a covariance is not positive semidefinite"),
    (c"OUT_OF_RANGE", c"a number is out of range: its documentation has the range"),
    (c"NO_VARIANCE", c"a measurement is known exactly before it is made: give its noise a variance above 0"),
    (
        c"NOT_OBSERVABLE",
        c"some states cannot be told from the outputs: measure something else, or leave them out",
    ),
    (c"OVERFLOW", c"a result is too large for a number: use other units, or double precision"),
    (c"OTHER", c"an error without a code of its own"),
    (
        c"INPUTS",
        c"D does not fit the inputs of the transition: set the transition first, then the observation with its D; \
          before the number of inputs changes, set the observation without D",
    ),
];

impl From<thetahat_core::Error> for Error {
    fn from(error: thetahat_core::Error) -> Self {
        use thetahat_core::Error as Core;
        match error {
            Core::NotFinite { .. } => Error::NotFinite,
            Core::Infinite { .. } => Error::Infinite,
            Core::TooLarge { .. } => Error::TooLarge,
            Core::Negative { .. } => Error::Negative,
            Core::Length { .. } => Error::Length,
            Core::Orders { .. } => Error::Orders,
            Core::Delays { .. } => Error::Delays,
            Core::InputFirst { .. } => Error::InputFirst,
            Core::NotSymmetric { .. } => Error::NotSymmetric,
            Core::NotPositive { .. } => Error::NotPositive,
            Core::OutOfRange { .. } | Core::NotTriangular { .. } | Core::TooFewRows { .. } => {
                Error::OutOfRange
            }
            Core::NoVariance { .. } => Error::NoVariance,
            Core::NotObservable { .. } => Error::NotObservable,
            Core::Overflow => Error::Overflow,
            _ => Error::Other,
        }
    }
}

/// The code of a result.
pub(crate) fn code(work: impl FnOnce() -> Result<(), Error>) -> Error {
    match work() {
        Ok(()) => Error::None,
        Err(error) => error,
    }
}

fn entry(code: i32) -> (&'static CStr, &'static CStr) {
    let known = usize::try_from(code).ok().and_then(|code| TEXTS.get(code));
    known.copied().unwrap_or((c"UNKNOWN", c"no such error"))
}

/// The name of an error: `NOT_FINITE` for `THETAHAT_ERROR_NOT_FINITE`; `UNKNOWN` for what is none. It lives for ever.
#[unsafe(no_mangle)]
pub extern "C" fn thetahat_error_name(code: i32) -> *const c_char {
    entry(code).0.as_ptr()
}

/// What is wrong and what to do, in a sentence. It lives for ever.
#[unsafe(no_mangle)]
pub extern "C" fn thetahat_error_text(code: i32) -> *const c_char {
    entry(code).1.as_ptr()
}
