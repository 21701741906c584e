//! What is written, and how it is checked when it is read back.

use super::Sum;
use crate::snapshot::{number, snapshot};
use crate::{ChangeDetector, Error, Real};

snapshot! {
    Snapshot<T> of ChangeDetector<T> where [T: Real] {
        #[serde(with = "number")]
        mean_threshold: T;
        #[serde(with = "number")]
        variance_threshold: T;
        mean_up: Sum<T>;
        mean_down: Sum<T>;
        variance: Sum<T>;
    }
}

impl<T: Real> TryFrom<Snapshot<T>> for ChangeDetector<T> {
    type Error = Error;

    fn try_from(read: Snapshot<T>) -> Result<Self, Error> {
        let detector = ChangeDetector::new(read.mean_threshold, read.variance_threshold)?;
        for (sum, threshold) in [
            (&read.mean_up, read.mean_threshold),
            (&read.mean_down, read.mean_threshold),
            (&read.variance, read.variance_threshold),
        ] {
            let fits = sum.statistic >= T::zero()
                && sum.statistic <= threshold.min(T::LARGEST_ENTRY)
                && (sum.statistic > T::zero()) == (sum.samples > 0);
            let range = "0 to its threshold, and above 0 as long as it says";
            fits.then_some(()).ok_or(Error::OutOfRange { argument: "statistic", range })?;
        }
        let Snapshot { mean_up, mean_down, variance, .. } = read;
        Ok(ChangeDetector { mean_up, mean_down, variance, ..detector })
    }
}
