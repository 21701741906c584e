//! A Kalman filter whose measurements may come late.

use nalgebra::OVector;

use crate::error::check_length;
use crate::kalman::{is_missing, stored_numbers};
use crate::ud::copy;
use crate::{Dimension, Error, ExtendedKalmanFilter, Innovation, Observation, Real, Transition};

/// How much an [`OutOfSequenceFilter`] keeps of the past.
///
/// ```
/// use thetahat_core::FilterHistory;
///
/// // A measurement may be 8 samples late; two states, two sensors, one input: 9 samples of 9 numbers.
/// const HISTORY: FilterHistory = FilterHistory { samples: 8, states: 2, outputs: 2, inputs: 1 };
/// assert_eq!(HISTORY.numbers(), 81);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FilterHistory {
    /// How late a measurement may be, in samples: 1 or more.
    pub samples: usize,
    /// The number of states, n.
    pub states: usize,
    /// The number of elements of a measurement, those of all sensors together, m.
    pub outputs: usize,
    /// The number of inputs.
    pub inputs: usize,
}

impl FilterHistory {
    /// How many numbers are kept: of each sample n (n + 3)/2 + 1 for the filter before it was corrected, the
    /// measurement and the input.
    pub const fn numbers(&self) -> usize {
        self.samples.saturating_add(1).saturating_mul(self.each())
    }

    /// Those of one sample.
    const fn each(&self) -> usize {
        stored_numbers(self.states).saturating_add(self.outputs).saturating_add(self.inputs)
    }
}

/// A Kalman filter, extended or not, that takes a measurement of some samples ago.
///
/// An analysis in a laboratory, a camera, a sensor behind a slow bus: what they tell is of an earlier sample, while
/// other sensors have corrected the filter since. It keeps the last samples in a ring: the filter before it was
/// corrected, the input and the measurement, of which elements may still be missing. A late element is put in its
/// place, and the filter runs again from there:
///
/// ```text
/// x̂(j), P(j) from the ring,     j = k - age
/// correct by y(j);   predict with u(j);   …;   correct by y(k)
/// ```
///
/// These are the steps that the filter would have taken if the measurement had come in time: the result is the same to
/// the bit, gate and all. The models are arguments, as in [`KalmanFilter`](crate::KalmanFilter) and
/// [`ExtendedKalmanFilter`]; for a late measurement they must be those of all the samples since. One observation has
/// the elements of all sensors; what is not there, or not yet, is NaN.
///
/// The other exact way, to make past states a part of the state, takes n (d + 1) states for a delay of d samples, and
/// about 1.2 n³ (d + 1)³ multiply-adds in every sample: for two states and d = 4 some 125 times those of the filter.
/// Here a sample costs a copy of n (n + 3)/2 numbers more than without, and a late measurement as much as the d + 1
/// samples that run again. Rules that correct by the late element at once, that of Larsen and others for instance, cost
/// less then, and are exact only where nothing else has corrected the filter meanwhile, or with a gain that follows all
/// that did.
///
/// # Sizes
///
/// `B` is the buffer of the ring, at least [`FilterHistory::numbers`]. Memory: that, the filter's own, and some
/// counters. A late measurement takes as much again on the stack: it works on a copy, so that an error leaves all as it
/// was.
///
/// Source: Larsen, Andersen, Ravn and Poulsen, Incorporation of time delayed measurements in a discrete-time Kalman
/// filter, 1998 (ways and their costs); Bar-Shalom, Update with out-of-sequence measurements in tracking: exact
/// solution, 2002.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix1, SVector, Vector1, Vector2};
/// use thetahat_core::{
///     Covariance, Error, ExtendedKalmanFilter, FilterHistory, LinearObservation, LinearTransition, OutOfSequenceFilter,
/// };
///
/// // A concentration that drifts: a coarse probe each sample, and an analysis that takes three samples.
/// const HISTORY: FilterHistory = FilterHistory { samples: 4, states: 1, outputs: 2, inputs: 0 };
/// type Tank = OutOfSequenceFilter<f64, Const<1>, Const<2>, Const<0>, Const<{ HISTORY.numbers() }>>;
///
/// let one = |value: f64| Covariance::<f64, Const<1>>::from_diagonal(&Vector1::new(value));
/// let drift = LinearTransition::new(Matrix1::new(1.0), one(0.01)?)?;
/// let both = LinearObservation::new(Vector2::new(1.0, 1.0), Covariance::from_diagonal(&Vector2::new(1.0, 0.01))?)?;
/// let mut tank = Tank::new(ExtendedKalmanFilter::new(Vector1::new(0.0), one(100.0)?)?, Const, Const, HISTORY.samples)?;
///
/// let none = SVector::zeros();
/// for k in 0..20 {
///     let probe = if k % 2 == 0 { 6.0 } else { 4.0 };
///     tank.correct(&both, &none, &Vector2::new(probe, f64::NAN))?;
///     if k == 15 {
///         // The analysis of the sample that was taken at k = 12.
///         tank.correct_late(&drift, &both, 3, &Vector2::new(f64::NAN, 5.0))?;
///     }
///     tank.predict(&drift, &none)?;
/// }
/// assert!((tank.filter().state()[0] - 5.0).abs() < 0.1);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N, M, U, B>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N, M, U, B>"))]
pub struct OutOfSequenceFilter<T: Real, N: Dimension, M: Dimension, U: Dimension, B: Dimension> {
    filter: ExtendedKalmanFilter<T, N>,
    /// The samples of the ring one after the other: of each the filter before it was corrected, the measurement and the
    /// input, NaN where there is none yet.
    ring: OVector<T, B>,
    outputs: M,
    inputs: U,
    history: FilterHistory,
    /// Where the sample of now is.
    newest: usize,
    /// How many samples before it are there.
    kept: usize,
}

impl<T: Real, N: Dimension, M: Dimension, U: Dimension, B: Dimension> OutOfSequenceFilter<T, N, M, U, B> {
    /// Around a filter as it is before its first measurement ([`KalmanFilter`](crate::KalmanFilter) becomes one by
    /// `into`), for measurements that are at most `samples` late.
    ///
    /// `outputs` and `inputs` are their numbers: `Const`, or `Dyn(2)` with the feature `alloc`.
    ///
    /// Errors: [`Error::OutOfRange`] if `samples` is 0, or a number does not fit; [`Error::Length`] if `B` is too
    /// small.
    pub fn new(
        filter: impl Into<ExtendedKalmanFilter<T, N>>,
        outputs: M,
        inputs: U,
        samples: usize,
    ) -> Result<Self, Error> {
        let filter = filter.into();
        let states = filter.state().len();
        let history = FilterHistory { samples, states, outputs: outputs.value(), inputs: inputs.value() };
        let expected = history.numbers();
        if samples == 0 || expected == usize::MAX {
            return Err(Error::OutOfRange {
                argument: "samples",
                range: "1 or more, as many as memory holds",
            });
        }
        let buffer =
            B::at_least(expected).map_err(|found| Error::Length { argument: "B", expected, found })?;
        let ring = buffer.vector(T::NAN);
        let mut this = OutOfSequenceFilter { filter, ring, outputs, inputs, history, newest: 0, kept: 0 };
        this.begin();
        Ok(this)
    }

    /// The measurement update of now, with y(k) and u(k): see [`ExtendedKalmanFilter::correct`], whose errors it has.
    /// NaN is an element that is missing, or that will come late. It may be called again for others of the same sample.
    ///
    /// Errors, after which nothing has changed: also [`Error::OutOfRange`] if an element has come before.
    pub fn correct(
        &mut self,
        observation: &impl Observation<T, N, M, U>,
        input: &OVector<T, U>,
        measurement: &OVector<T, M>,
    ) -> Result<Innovation<T, OVector<T, M>>, Error>
    where
        M: Dimension<N>,
        N: Dimension<M>,
    {
        check_length("input", self.history.inputs, input.len())?;
        let whole = self.completed(self.newest, measurement)?;
        let mut filter = self.filter.clone();
        filter.linear_mut().load(self.part(self.newest, Part::Filter));
        let innovation = filter.correct(observation, input, &whole)?;
        self.filter = filter;
        copy(whole.as_slice(), self.part_mut(self.newest, Part::Measurement));
        copy(input.as_slice(), self.part_mut(self.newest, Part::Input));
        Ok(innovation)
    }

    /// The time update: one sample ahead, with the input u(k), the one that [`correct`](OutOfSequenceFilter::correct)
    /// had. See [`ExtendedKalmanFilter::predict`], whose errors it has.
    pub fn predict(
        &mut self,
        transition: &impl Transition<T, N, U>,
        input: &OVector<T, U>,
    ) -> Result<(), Error> {
        check_length("input", self.history.inputs, input.len())?;
        self.filter.predict(transition, input)?;
        copy(input.as_slice(), self.part_mut(self.newest, Part::Input));
        self.newest = self.after(self.newest);
        self.kept = self.history.samples.min(self.kept + 1);
        self.begin();
        Ok(())
    }

    /// A measurement of `age` samples ago: the elements of y(k - age) that had not come yet; the others are NaN.
    ///
    /// The innovation is that of all elements of that sample, as [`correct`](OutOfSequenceFilter::correct) would have
    /// given it then. If all are NaN, nothing changes.
    ///
    /// Errors, after which nothing has changed: [`Error::OutOfRange`] if `age` is not 1 …
    /// [`kept`](OutOfSequenceFilter::kept): it is too late, or of a time before the first sample (a measurement of now
    /// is for `correct`, and there is none of the future); also if an element has come before; and those of
    /// [`ExtendedKalmanFilter::correct`] and [`predict`](ExtendedKalmanFilter::predict). `age` + 1 corrections and
    /// `age` predictions.
    pub fn correct_late(
        &mut self,
        transition: &impl Transition<T, N, U>,
        observation: &impl Observation<T, N, M, U>,
        age: usize,
        measurement: &OVector<T, M>,
    ) -> Result<Innovation<T, OVector<T, M>>, Error>
    where
        M: Dimension<N>,
        N: Dimension<M>,
    {
        if age == 0 || age > self.kept {
            let range = "1 to the number of samples that are kept";
            return Err(Error::OutOfRange { argument: "age", range });
        }
        let mut next = self.clone();
        let mut index = self.before(age);
        let whole = self.completed(index, measurement)?;
        copy(whole.as_slice(), next.part_mut(index, Part::Measurement));
        next.filter.linear_mut().load(self.part(index, Part::Filter));
        let innovation = next.correct_again(observation, index)?;
        while index != self.newest {
            let input = next.input(index);
            next.filter.predict(transition, &input)?;
            index = self.after(index);
            next.begin_at(index);
            // Before `correct` the sample of now has neither.
            if next.part(index, Part::Measurement).iter().any(|element| !is_missing(element)) {
                next.correct_again(observation, index)?;
            }
        }
        *self = next;
        Ok(innovation)
    }

    /// Corrects by what the ring has of a sample.
    fn correct_again(
        &mut self,
        observation: &impl Observation<T, N, M, U>,
        index: usize,
    ) -> Result<Innovation<T, OVector<T, M>>, Error>
    where
        M: Dimension<N>,
        N: Dimension<M>,
    {
        let (input, mut measurement) = (self.input(index), self.outputs.vector(T::NAN));
        copy(self.part(index, Part::Measurement), measurement.as_mut_slice());
        self.filter.correct(observation, &input, &measurement)
    }

    /// Changes the filter of now, by [`set_state`](ExtendedKalmanFilter::set_state),
    /// [`widen`](ExtendedKalmanFilter::widen) and the like. What is kept of the past ends here: measurements of samples
    /// before are too late, as they would undo the change.
    ///
    /// Errors, after which nothing has changed: what `change` answers; [`Error::Length`] (only with `Dyn`) if it leaves
    /// a filter of another size.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Vector1};
    /// use thetahat_core::{Covariance, Error, ExtendedKalmanFilter, OutOfSequenceFilter};
    ///
    /// let prior: Covariance<f64, Const<1>> = Covariance::from_diagonal(&Vector1::new(4.0))?;
    /// let filter = ExtendedKalmanFilter::new(Vector1::new(0.0), prior)?;
    /// let mut tank: OutOfSequenceFilter<f64, _, Const<1>, Const<0>, Const<16>> =
    ///     OutOfSequenceFilter::new(filter, Const, Const, 2)?;
    /// tank.change(|filter| filter.set_state(Vector1::new(20.0)))?; // it was filled
    /// assert_eq!((tank.filter().state()[0], tank.kept()), (20.0, 0));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn change(
        &mut self,
        change: impl FnOnce(&mut ExtendedKalmanFilter<T, N>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let mut filter = self.filter.clone();
        change(&mut filter)?;
        check_length("state", self.history.states, filter.state().len())?;
        (self.filter, self.kept) = (filter, 0);
        self.begin();
        Ok(())
    }

    /// The filter as it is now.
    pub fn filter(&self) -> &ExtendedKalmanFilter<T, N> {
        &self.filter
    }

    /// How late a measurement may be now: less than the ring holds while it is not full.
    pub fn kept(&self) -> usize {
        self.kept
    }

    /// How much is kept.
    pub fn history(&self) -> FilterHistory {
        self.history
    }

    /// What a measurement makes of that of a sample in the ring.
    fn completed(&self, index: usize, measurement: &OVector<T, M>) -> Result<OVector<T, M>, Error> {
        check_length("measurement", self.history.outputs, measurement.len())?;
        let mut whole = measurement.clone();
        for (element, &known) in whole.as_mut_slice().iter_mut().zip(self.part(index, Part::Measurement)) {
            if is_missing(&known) {
                continue;
            }
            if !is_missing(element) {
                let range = "NaN in each element that has come before";
                return Err(Error::OutOfRange { argument: "measurement", range });
            }
            *element = known;
        }
        Ok(whole)
    }

    /// A new sample: the filter has been moved on to it.
    fn begin(&mut self) {
        let newest = self.newest;
        self.begin_at(newest);
        self.part_mut(newest, Part::Measurement).fill(T::NAN);
        self.part_mut(newest, Part::Input).fill(T::NAN);
    }

    /// Keeps the filter as the one before a sample is corrected.
    fn begin_at(&mut self, index: usize) {
        let OutOfSequenceFilter { filter, ring, history, .. } = self;
        filter.linear().store(Part::Filter.of_mut(ring.as_mut_slice(), *history, index));
    }

    fn input(&self, index: usize) -> OVector<T, U> {
        let mut input = self.inputs.vector(T::zero());
        copy(self.part(index, Part::Input), input.as_mut_slice());
        input
    }

    fn part(&self, index: usize, part: Part) -> &[T] {
        self.ring.as_slice().get(part.range(self.history, index)).unwrap_or_default()
    }

    fn part_mut(&mut self, index: usize, part: Part) -> &mut [T] {
        part.of_mut(self.ring.as_mut_slice(), self.history, index)
    }

    /// The place after this one.
    fn after(&self, index: usize) -> usize {
        if index < self.history.samples { index + 1 } else { 0 }
    }

    /// The place of a sample so long ago.
    fn before(&self, age: usize) -> usize {
        let turn = if age > self.newest { self.history.samples + 1 } else { 0 };
        (self.newest + turn).saturating_sub(age)
    }

    /// That what is kept of the past is what a filter can have been.
    #[cfg(feature = "serde")]
    fn check(&self) -> Result<(), Error> {
        use crate::error::check_finite;

        for age in 0..=self.kept {
            let index = self.before(age);
            check_finite("ring", self.part(index, Part::Filter))?;
            let mut filter = self.filter.linear().clone();
            filter.load(self.part(index, Part::Filter));
            crate::Covariance::from_factor(filter.covariance().factor())?;
            let (measurement, input) = (self.part(index, Part::Measurement), self.part(index, Part::Input));
            if measurement.iter().chain(input).any(crate::lags::is_infinite) {
                return Err(Error::Infinite { argument: "ring" });
            }
            if age > 0 {
                check_finite("ring", input)?;
            }
        }
        Ok(())
    }
}

/// What is kept of a sample.
#[derive(Clone, Copy)]
enum Part {
    Filter,
    Measurement,
    Input,
}

impl Part {
    fn range(self, history: FilterHistory, index: usize) -> core::ops::Range<usize> {
        let (filter, FilterHistory { outputs, inputs, .. }) = (stored_numbers(history.states), history);
        let start = index * history.each();
        match self {
            Part::Filter => start..start + filter,
            Part::Measurement => start + filter..start + filter + outputs,
            Part::Input => start + filter + outputs..start + filter + outputs + inputs,
        }
    }

    fn of_mut<T>(self, ring: &mut [T], history: FilterHistory, index: usize) -> &mut [T] {
        ring.get_mut(self.range(history, index)).unwrap_or_default()
    }
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
