//! What a sample told.

use core::ffi::{CStr, c_char};

use thetahat_core::Innovation as CoreInnovation;
use thetahat_core::nalgebra::{Const, SVector};

use crate::Number;

/// The most outputs that a filter or observer has.
pub const THETAHAT_MOST_OUTPUTS: usize = 3;

/// What was done with a sample.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// The estimate was corrected.
    Updated = 0,
    /// It was corrected, and a variance is at its bound: nothing is forgotten in its direction.
    Capped = 1,
    /// It was corrected by less than the innovation asks for, so that C(q) stays stable.
    Projected = 2,
    /// The measurement is missing (NaN): time went on, nothing was corrected.
    Missing = 3,
    /// The delay lines are not filled yet: time went on, nothing was corrected.
    NotReady = 4,
    /// Regressors are collected until they have full rank: there is no estimate yet.
    Collecting = 5,
    /// Adaptation is off: nothing was corrected.
    Frozen = 6,
    /// The innovation lies in the dead zone: nothing was corrected.
    Skipped = 7,
    /// The normalised innovation squared is above the gate: the measurement was not used.
    Gated = 8,
    /// It is above the gate, as were those before it, so many in a row that the measurement was used.
    Released = 9,
    /// It was corrected by less than the innovation asks for, which is an outlier.
    Bounded = 10,
    /// Another action of the core.
    Other = 11,
}

static WORDS: [&CStr; 12] = [
    c"updated",
    c"capped",
    c"projected",
    c"missing",
    c"not ready",
    c"collecting",
    c"frozen",
    c"skipped",
    c"gated",
    c"released",
    c"bounded",
    c"other",
];

impl From<thetahat_core::Action> for Action {
    fn from(action: thetahat_core::Action) -> Self {
        use thetahat_core::Action as Core;
        match action {
            Core::Updated => Action::Updated,
            Core::Capped => Action::Capped,
            Core::Projected => Action::Projected,
            Core::Missing => Action::Missing,
            Core::NotReady => Action::NotReady,
            Core::Collecting => Action::Collecting,
            Core::Frozen => Action::Frozen,
            Core::Skipped => Action::Skipped,
            Core::Gated => Action::Gated,
            Core::Released => Action::Released,
            Core::Bounded => Action::Bounded,
            _ => Action::Other,
        }
    }
}

/// The innovation of a sample: the part of the measurement that was not predicted.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Innovation {
    /// The measurement less its prediction, element by element, in the unit of the measurement. NaN where it is
    /// missing.
    pub error: [Number; THETAHAT_MOST_OUTPUTS],
    /// The variance of each, given those after it in the same measurement. NaN where it is missing or not known.
    pub variance: [Number; THETAHAT_MOST_OUTPUTS],
    /// The normalised innovation squared: chi-square with one degree of freedom for each element that was measured, if
    /// the model is right. 0 if nothing was measured, or no variance is known.
    pub nis: Number,
    /// The number of elements of a measurement.
    pub outputs: u32,
    /// What was done with it, a `thetahat_action`.
    pub action: i32,
}

impl Innovation {
    fn new(errors: &[Number], variances: &[Number], nis: Number, action: thetahat_core::Action) -> Self {
        let elements = |values: &[Number]| {
            let mut elements = [Number::NAN; THETAHAT_MOST_OUTPUTS];
            elements.iter_mut().zip(values).for_each(|(element, value)| *element = *value);
            elements
        };
        Innovation {
            error: elements(errors),
            variance: elements(variances),
            nis,
            outputs: errors.len() as u32,
            action: Action::from(action) as i32,
        }
    }

    /// The same for the core, of one element and of all.
    pub(crate) fn core(&self) -> (CoreInnovation<Number>, CoreInnovation<Number, Elements>) {
        let &Innovation { error, variance, nis, .. } = self;
        // A detector does not ask what was done.
        let action = thetahat_core::Action::Updated;
        let ([first, ..], [of_first, ..]) = (error, variance);
        let one = CoreInnovation::new(first, of_first, nis, action);
        (one, CoreInnovation::new(error.into(), variance.into(), nis, action))
    }
}

type Elements = SVector<Number, THETAHAT_MOST_OUTPUTS>;

impl From<CoreInnovation<Number>> for Innovation {
    fn from(innovation: CoreInnovation<Number>) -> Self {
        let CoreInnovation { error, variance, nis, action, .. } = innovation;
        Innovation::new(&[error], &[variance], nis, action)
    }
}

impl<const M: usize> From<CoreInnovation<Number, SVector<Number, M>>> for Innovation
where
    Const<M>: thetahat_core::Dimension,
{
    fn from(innovation: CoreInnovation<Number, SVector<Number, M>>) -> Self {
        let CoreInnovation { error, variance, nis, action, .. } = innovation;
        Innovation::new(error.as_slice(), variance.as_slice(), nis, action)
    }
}

/// An action in a word or two, such as `not ready`; `other` for what is none. It lives for ever.
#[unsafe(no_mangle)]
pub extern "C" fn thetahat_action_word(action: i32) -> *const c_char {
    let known = usize::try_from(action).ok().and_then(|action| WORDS.get(action));
    known.copied().unwrap_or(c"other").as_ptr()
}
