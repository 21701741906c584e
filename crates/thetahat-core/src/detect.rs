//! Change detection: charts that watch the innovations of an estimator.

use nalgebra::OVector;

use crate::{Dimension, Innovation, Real};

/// What a chart watches.
///
/// ```
/// use thetahat_core::Chart;
///
/// assert_eq!(Chart::ALL.map(Chart::word), ["mean_up", "mean_down", "variance"]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(all(feature = "defmt", target_os = "none"), derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Chart {
    /// Whether the mean of the innovations has risen.
    MeanUp,
    /// Whether the mean of the innovations has fallen.
    MeanDown,
    /// Whether the innovations have become larger, in either direction.
    Variance,
}

impl Chart {
    /// All of them.
    pub const ALL: [Chart; 3] = [Chart::MeanUp, Chart::MeanDown, Chart::Variance];

    /// `mean_up`, `mean_down` or `variance`.
    pub const fn word(self) -> &'static str {
        match self {
            Chart::MeanUp => "mean_up",
            Chart::MeanDown => "mean_down",
            Chart::Variance => "variance",
        }
    }
}

/// What a chart says once it has passed its threshold.
///
/// ```
/// use thetahat_core::{Action, ChangeDetector, Chart, Error, Innovation};
///
/// let mut detector = ChangeDetector::<f64>::new(6.0, 6.0)?;
/// // All innovations are three standard deviations above 0.
/// let innovation = Innovation::new(3.0, 1.0, 9.0, Action::Updated);
/// let alarm = (0..10).find_map(|_| detector.update(&innovation)).expect("the mean has risen");
/// assert_eq!((alarm.chart, alarm.samples), (Chart::MeanUp, 3)); // 3 · (3 - 1/2) is above 6
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(all(feature = "defmt", target_os = "none"), derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Alarm<T> {
    /// The chart that passed its threshold; if several did at once, the one that is furthest beyond its own.
    pub chart: Chart,
    /// Its statistic, before it was set back to 0.
    pub statistic: T,
    /// Since how many samples it had been above 0, this one included: the maximum likelihood estimate of how long ago
    /// the change was. Only samples with an innovation of known variance are counted.
    pub samples: u32,
}

/// Watches innovations for a change: three CUSUM charts, two on the mean and one on the variance.
///
/// As long as a model is right, its normalised innovation z = e/√S is white, with mean 0 and variance 1. Each chart is
/// the cumulative sum of a log-likelihood ratio, for the change that it is to find, held above 0:
///
/// ```text
/// mean up       g <- max(0, g + z - 1/2)               a mean of 1 (in standard deviations) against 0
/// mean down     g <- max(0, g - z - 1/2)               a mean of -1 against 0
/// variance      g <- max(0, g + (z²/2 - ln 2)/2)       a variance of 2 against 1
/// ```
///
/// and an alarm is given where g exceeds its threshold. Each chart is the quickest for its change, in the worst case,
/// among those with the same mean time between false alarms (Lorden 1971; Moustakides 1986). It finds other changes
/// too, smaller ones later. After an alarm, what exceeded its threshold starts again from 0; the other charts go on.
///
/// An estimator that forgets follows a change after some time, and its innovations become white again: then the
/// charts fall back by themselves.
///
/// # Several outputs
///
/// The innovation of a filter with m outputs has no one direction: [`update_all`](ChangeDetector::update_all) watches
/// its normalised square alone, chi-square with as many degrees of freedom as elements were measured, mean m and
/// variance 2 m.
///
/// ```text
/// variance      g <- max(0, g + (nis/2 - m ln 2)/2)    a covariance of 2 S against S
/// ```
///
/// It finds a shift of the mean too, as that makes the square larger. With m = 1 all charts are as above, to the bit.
///
/// # Thresholds
///
/// They set the mean time between false alarms. For Gaussian innovations both mean charts together give one in 168
/// samples with the threshold 4, in 465 with 5, and roughly e times as many for each unit more. As each step is a
/// log-likelihood ratio, a chart with the threshold h gives at most one false alarm in exp(h) samples on average,
/// whatever m is, and whatever is missing. The crate `thetahat` computes the thresholds from the interval that is asked
/// for and m. Infinity turns a chart off.
///
/// # Cost
///
/// Plain data: five numbers and three counters. A square root, a division and some ten additions a sample.
///
/// Source: Page, Continuous inspection schemes, Biometrika 41, 1954; Basseville and Nikiforov, Detection of Abrupt
/// Changes, 1993, sections 2.2 and 2.6.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Vector1};
/// use thetahat_core::{Chart, ChangeDetector, Error, Forgetting, RecursiveLeastSquares};
///
/// // A constant with some noise, that jumps by two standard deviations of the noise at k = 500.
/// let mut mean: RecursiveLeastSquares<f64, Const<1>> =
///     RecursiveLeastSquares::new(&Vector1::new(1.0), Forgetting::None)?;
/// let mut detector = ChangeDetector::new(8.0, 12.0)?;
/// let mut alarm = None;
/// for k in 0..600_u32 {
///     let noise = (f64::from(k) * 0.754_877_666_246_692_7).fract() * 2.0 - 1.0;
///     let y = if k < 500 { noise } else { noise + 1.15 };
///     let innovation = mean.update(&Vector1::new(1.0), y)?;
///     if let Some(given) = detector.update(&innovation) {
///         alarm = alarm.or(Some((k, given)));
///     }
/// }
/// let (k, alarm) = alarm.expect("the jump was found");
/// assert!(k > 500 && k < 520 && alarm.chart == Chart::MeanUp);
/// assert!((i64::from(k + 1 - alarm.samples) - 500).abs() <= 3);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T>"))]
pub struct ChangeDetector<T: Real> {
    mean_threshold: T,
    variance_threshold: T,
    mean_up: Sum<T>,
    mean_down: Sum<T>,
    variance: Sum<T>,
}

/// A cumulative sum that is held above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
struct Sum<T: Real> {
    /// g, finite.
    statistic: T,
    /// Since how many samples it has been above 0.
    samples: u32,
}

impl<T: Real> Sum<T> {
    const fn new(zero: T) -> Self {
        Sum { statistic: zero, samples: 0 }
    }

    /// g <- max(0, g + increment).
    fn add(&mut self, increment: T) {
        // A chart that is turned off must not overflow.
        let sum = (self.statistic + increment).min(T::LARGEST_ENTRY);
        *self = if sum > T::zero() {
            Sum { statistic: sum, samples: self.samples.saturating_add(1) }
        } else {
            Sum::new(T::zero())
        };
    }
}

impl<T: Real> ChangeDetector<T> {
    /// Charts at 0, with the threshold of the two charts of the mean and that of the chart of the variance.
    ///
    /// Errors: [`Error::OutOfRange`](crate::Error::OutOfRange) if a threshold is not above 0. (Infinity is.)
    pub fn new(mean_threshold: T, variance_threshold: T) -> Result<Self, crate::Error> {
        for (argument, threshold) in
            [("mean_threshold", mean_threshold), ("variance_threshold", variance_threshold)]
        {
            let fits = threshold > T::zero();
            fits.then_some(()).ok_or(crate::Error::OutOfRange { argument, range: "above 0" })?;
        }
        let sum = Sum::new(T::zero());
        Ok(ChangeDetector { mean_threshold, variance_threshold, mean_up: sum, mean_down: sum, variance: sum })
    }

    /// Takes the innovation of a sample. One that is missing, or whose variance is not known, changes nothing.
    pub fn update(&mut self, innovation: &Innovation<T>) -> Option<Alarm<T>> {
        let Innovation { error, variance, .. } = *innovation;
        if !(error.is_finite() && variance.is_finite() && variance >= T::MIN_POSITIVE) {
            return None;
        }
        let half = T::one() / T::from_count(2);
        let z = (error / variance.sqrt()).clamp(-T::LARGEST_ENTRY, T::LARGEST_ENTRY);
        self.mean_up.add(z - half);
        self.mean_down.add(-z - half);
        self.variance.add((square(z) * half - T::ln_2()) * half);
        self.alarm()
    }

    /// Takes the innovation of a filter: of one output as [`update`](ChangeDetector::update) does, of several by its
    /// normalised square. A measurement that is missing changes nothing; one that is missing in part counts by the
    /// elements that are there. One that a gate kept out is taken all the same: so a filter that a gate has locked out
    /// is found.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Matrix1, Vector1};
    /// use thetahat_core::{ChangeDetector, Chart, Covariance, Error, KalmanFilter};
    /// use thetahat_core::{LinearObservation, LinearTransition};
    ///
    /// // A constant level, until it jumps.
    /// let variance = |value: f64| Covariance::<f64, Const<1>>::from_diagonal(&Vector1::new(value));
    /// let walk = LinearTransition::new(Matrix1::new(1.0), variance(1e-4)?)?;
    /// let gauge = LinearObservation::new(Matrix1::new(1.0), variance(1.0)?)?;
    /// let mut filter = KalmanFilter::new(Vector1::new(0.0), variance(1.0)?)?;
    /// let mut detector = ChangeDetector::new(8.0, 12.0)?;
    /// let mut alarm = None;
    /// for k in 0..340_u32 {
    ///     let noise = (f64::from(k) * 0.754_877_666_246_692_7).fract() * 2.0 - 1.0;
    ///     let y = if k < 300 { noise } else { noise + 3.0 };
    ///     let innovation = filter.correct(&gauge, &Default::default(), &Vector1::new(y))?;
    ///     alarm = alarm.or(detector.update_all(&innovation).map(|alarm| (k, alarm)));
    ///     filter.predict(&walk, &Default::default())?;
    /// }
    /// let (k, alarm) = alarm.expect("the jump was found");
    /// assert!((300..310).contains(&k) && alarm.chart == Chart::MeanUp);
    /// assert!((i64::from(k + 1 - alarm.samples) - 300).abs() <= 3);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn update_all<M: Dimension>(
        &mut self,
        innovation: &Innovation<T, OVector<T, M>>,
    ) -> Option<Alarm<T>> {
        let Innovation { ref error, ref variance, nis, action } = *innovation;
        if let ([error], [variance]) = (error.as_slice(), variance.as_slice()) {
            return self.update(&Innovation { error: *error, variance: *variance, nis, action });
        }
        let measured = variance.as_slice().iter().filter(|variance| variance.is_finite()).count();
        if measured == 0 || !nis.is_finite() {
            return None;
        }
        let half = T::one() / T::from_count(2);
        self.variance.add((nis.min(T::LARGEST_ENTRY) * half - T::from_count(measured) * T::ln_2()) * half);
        self.alarm()
    }

    /// The alarm of this sample, if a chart has passed its threshold.
    fn alarm(&mut self) -> Option<Alarm<T>> {
        let charts = [
            (Chart::MeanUp, &mut self.mean_up, self.mean_threshold),
            (Chart::MeanDown, &mut self.mean_down, self.mean_threshold),
            (Chart::Variance, &mut self.variance, self.variance_threshold),
        ];
        let (mut alarm, mut furthest) = (None, T::zero());
        for (chart, sum, threshold) in charts {
            let Sum { statistic, samples } = *sum;
            if statistic > threshold {
                *sum = Sum::new(T::zero());
                let excess = statistic / threshold;
                if excess > furthest {
                    (alarm, furthest) = (Some(Alarm { chart, statistic, samples }), excess);
                }
            }
        }
        alarm
    }

    /// Sets all charts back to 0, as after a change that is known.
    pub fn reset(&mut self) {
        let sum = Sum::new(T::zero());
        (self.mean_up, self.mean_down, self.variance) = (sum, sum, sum);
    }

    /// Where a chart stands: g.
    pub fn statistic(&self, chart: Chart) -> T {
        match chart {
            Chart::MeanUp => self.mean_up.statistic,
            Chart::MeanDown => self.mean_down.statistic,
            Chart::Variance => self.variance.statistic,
        }
    }

    /// The threshold of a chart.
    pub fn threshold(&self, chart: Chart) -> T {
        match chart {
            Chart::MeanUp | Chart::MeanDown => self.mean_threshold,
            Chart::Variance => self.variance_threshold,
        }
    }
}

/// z², at most the largest entry.
fn square<T: Real>(z: T) -> T {
    (z * z).min(T::LARGEST_ENTRY)
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
