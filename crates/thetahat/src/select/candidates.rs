//! The models of a choice, and the samples that all of them are compared on.

use thetahat_numerics::regression::{Presample, sum_of_squares};

use super::Candidate;
use super::linear::{Columns, Kept, Rows};
use crate::Error;
use crate::data::Record;
use crate::estimate::{Initial, Point, Window, drop_is_not_for_f, estimate_is_for_f};
use crate::model::Orders;

/// At most this many inputs: a Gram matrix of all their lags has to fit.
pub(super) const MOST_INPUTS: usize = 100;
/// At least this many samples for each parameter.
pub(super) const SAMPLES: usize = 4;
/// Samples skipped after the maximum lag, so that transients of 1/C die away: they would be tens of times the price of
/// a parameter.
const FADING: usize = 50;
/// Of a segment of mean length not more than this part is given to that.
const LEAST_OF_PIECE: usize = 20;

/// A root of C that is nearer to the unit circle is on it.
const ON_CIRCLE: f64 = 1e-4;

/// A model on the common samples.
#[derive(Debug, Clone)]
pub(super) struct Trial {
    pub(super) orders: Orders,
    pub(super) point: Option<Point>,
}

/// A model that was compared.
#[derive(Debug, Clone)]
pub(super) struct Compared {
    pub(super) scored: Candidate,
    /// The parameters, if they were searched for.
    pub(super) initial_parameters: Option<Vec<f64>>,
    /// The largest modulus of a pole of the plant; infinite where that is not known.
    pub(super) radius: f64,
    /// The same of C.
    pub(super) noise_radius: f64,
    /// What its held-out figure is made of.
    pub(super) parts: Option<Vec<f64>>,
}

impl Compared {
    /// Whether the search for C has ended on the unit circle. Its errors one step ahead are then least for this log, by
    /// what stands before it, and a root there says of the noise that it has no part at a frequency (Davidson 1981).
    pub(super) fn has_ended_on_circle(&self) -> bool {
        self.noise_radius >= 1.0 - ON_CIRCLE
    }
}

/// What all models share.
pub(super) struct Samples {
    pub(super) window: Window,
    pub(super) presample: Presample,
}

impl Samples {
    /// # Errors
    /// [`Error::Argument`] if samples are to be dropped and a model has F, or the other way round.
    pub(super) fn new(record: &Record<'_>, initial: Initial, models: &[Orders]) -> Result<Self, Error> {
        if initial == Initial::Drop && models.iter().any(Orders::has_f) {
            return Err(drop_is_not_for_f());
        }
        if initial == Initial::Estimate && !models.iter().all(Orders::has_f) {
            return Err(estimate_is_for_f());
        }
        if initial == Initial::Zero {
            return Ok(Self { window: Window::default(), presample: Presample::Zero });
        }
        Ok(Self::unknown(record, models.iter()))
    }

    /// The samples after the maximum lag of all models.
    pub(super) fn unknown<'m>(record: &Record<'_>, models: impl Iterator<Item = &'m Orders> + Clone) -> Self {
        // Segments that are too short for the initial-condition responses of one model are so for all.
        let lag = |orders: &Orders| orders.conditioned().max(orders.nf.iter().sum());
        let left_out = models.clone().map(lag).max().unwrap_or(0);
        let coloured = models.filter(|orders| orders.nc > 0).count() > 0;
        let most = total(record) / record.segments.len().max(1) / LEAST_OF_PIECE;
        let counted = left_out + if coloured { FADING.min(most) } else { 0 };
        Self { window: Window { left_out, counted }, presample: Presample::Drop }
    }

    /// How many samples of a record count.
    pub(super) fn count(&self, record: &Record<'_>) -> usize {
        record.segments.iter().map(|segment| segment.len().saturating_sub(self.window.counted)).sum()
    }
}

/// The rows of a record, kept so that costs are exact.
pub(super) fn rows(record: &Record<'_>, columns: &Columns, samples: &Samples) -> Result<Rows, Error> {
    let products = Rows::new(record, columns, samples.presample, samples.window.counted, Kept::Products)?;
    if products.are_exact() {
        return Ok(products);
    }
    Rows::new(record, columns, samples.presample, samples.window.counted, Kept::Factor)
}

/// All samples of a record.
pub(super) fn total(record: &Record<'_>) -> usize {
    record.segments.iter().map(std::ops::Range::len).sum()
}

/// The sum of squares of the output.
pub(super) fn energy(record: &Record<'_>) -> f64 {
    record.segments.iter().map(|segment| sum_of_squares(&record.output[segment.clone()])).sum()
}

/// Whether a record has enough samples for this many parameters, and does not lose more than half of them to the start
/// of its segments.
pub(super) fn are_enough(record: &Record<'_>, parameters: usize, left_out: usize) -> bool {
    let left = |segment: &std::ops::Range<usize>| segment.len().saturating_sub(left_out);
    let count: usize = record.segments.iter().map(left).sum();
    count >= SAMPLES * parameters && 2 * count >= total(record)
}
