//! The fixed-interval smoother: states given all measurements, earlier and later ones.

use alloc::vec::Vec;
use core::mem;

use nalgebra::{OMatrix, OVector};

use crate::around::Linearising;
use crate::state_space::{add_product, transpose};
use crate::triangle::{column, column_mut};
use crate::ud::{add_multiple, dot};
use crate::{
    Action, Covariance, Dimension, Error, ExtendedKalmanFilter, Innovation, Observation, Real, Transition,
    UnscentedKalmanFilter, ud,
};

/// A filter that remembers its steps, and then tells each state given all measurements, later ones too.
///
/// ```text
/// backwards, from λ = 0, Λ = 0 at the last sample:
/// at a sample          x_s = x̂ - P λ,      P_s = P - P Λ P          x̂, P: filtered, after its measurements
/// over a measurement   λ <- C'λ - H'S⁻¹e,  Λ <- C'Λ C + H'S⁻¹H,     C = I - K H
/// to the sample before λ <- F'λ,           Λ <- F'Λ F
/// ```
///
/// This is Bryson and Frazier's form. It inverts no covariance, so that P may be singular: states may be known, and
/// need not be driven by noise. Λ is kept factored, as P is. But what P is much larger than is lost: at a sample
/// where the filtered variances are still 10^d times what they become by a later measurement, d digits are. So start
/// with no larger variances than needed.
///
/// It is stepped as the filter is, with models that may vary in time, several sensors, missing elements, and a gate.
/// Around an [`ExtendedKalmanFilter`] it smooths with the linearisations that the filter made, and is as good as these;
/// with linear models the result is exact. Around an [`UnscentedKalmanFilter`] it is the unscented smoother: that
/// filter's F is cov(x(k), x(k+1))'P⁻¹, so that P F' is the cross covariance by which Särkkä (2008) goes back.
///
/// Units: those of the model. Memory: 2 n² + n numbers for each sample, and 2 n + 2 for each element measured.
///
/// Source: Bryson and Frazier, Smoothing for linear and nonlinear dynamic systems, 1963; Bierman, Fixed interval
/// smoothing with discrete measurements, 1973 (the modified form, with filtered estimates, and the factors); Särkkä,
/// Unscented Rauch-Tung-Striebel smoother, 2008.
///
/// ```
/// use thetahat_core::nalgebra::{Const, SVector, Vector1};
/// use thetahat_core::{
///     Covariance, Error, KalmanFilter, LinearObservation, LinearTransition, Smoother,
/// };
///
/// // A level that walks, and is measured before and after a gap.
/// let one: Covariance<f64, Const<1>> = Covariance::from_diagonal(&Vector1::new(1.0))?;
/// let walk = LinearTransition::new(Vector1::new(1.0), one.clone())?;
/// let sensor = LinearObservation::new(Vector1::new(1.0), Covariance::from_diagonal(&Vector1::new(1e-9))?)?;
/// let none = SVector::zeros();
///
/// let mut smoother = Smoother::new(KalmanFilter::new(Vector1::new(0.0), one)?);
/// for y in [2.0, f64::NAN, f64::NAN, f64::NAN, 6.0] {
///     smoother.predict(&walk, &none)?;
///     smoother.correct(&sensor, &none, &Vector1::new(y))?;
/// }
/// let smoothed = smoother.smooth()?;
/// // Between the two it is a line, and least known in the middle.
/// assert!((smoothed[3].state[0] - 4.0).abs() < 1e-6);
/// assert!((smoothed[3].covariance[0] - 1.0).abs() < 1e-6);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Smoother<T: Real, N: Dimension, F = ExtendedKalmanFilter<T, N>> {
    filter: F,
    /// Those before the present one.
    samples: Vec<Sample<T, N>>,
    /// The elements measured at the present sample.
    elements: Vec<Element<T, N>>,
}

/// What a filter did at one sample.
#[derive(Clone, Debug)]
struct Sample<T: Real, N: Dimension> {
    elements: Vec<Element<T, N>>,
    /// x̂ and P after its measurements.
    state: OVector<T, N>,
    covariance: Covariance<T, N>,
    /// F, to the next sample.
    state_matrix: OMatrix<T, N, N>,
}

/// How a filter used one element of a measurement, whitened: y = h'x + v.
#[derive(Clone, Debug)]
struct Element<T: Real, N: Dimension> {
    /// h.
    row: OVector<T, N>,
    /// K = P h / s.
    gain: OVector<T, N>,
    /// s = h'P h + var v.
    variance: T,
    /// e = y - h'x̂.
    error: T,
}

/// A state given all measurements.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix1, Vector1};
/// use thetahat_core::{Covariance, Error, KalmanFilter, LinearObservation, Smoother};
///
/// // One measurement of variance 1 and a prior of variance 1: half-way between, with half the variance.
/// let one: Covariance<f64, Const<1>> = Covariance::from_diagonal(&Vector1::new(1.0))?;
/// let gauge = LinearObservation::new(Matrix1::new(1.0), one.clone())?;
/// let mut smoother = Smoother::new(KalmanFilter::new(Vector1::new(0.0), one)?);
/// smoother.correct(&gauge, &Default::default(), &Vector1::new(4.0))?;
/// let smoothed = &smoother.smooth()?[0];
/// assert!((smoothed.state[0] - 2.0).abs() < 1e-14 && (smoothed.covariance[0] - 0.5).abs() < 1e-14);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Smoothed<T: Real, N: Dimension> {
    /// The mean.
    pub state: OVector<T, N>,
    /// The covariance: a matrix, n x n, symmetric to the bit, with no negative variance. It is positive semidefinite
    /// but for rounding: an eigenvalue may be some epsilons of the filtered variances below 0.
    pub covariance: OMatrix<T, N, N>,
}

impl<T: Real, N: Dimension> Smoother<T, N> {
    /// A smoother that starts where this filter stands: a [`KalmanFilter`](crate::KalmanFilter) or an
    /// [`ExtendedKalmanFilter`].
    pub fn new(filter: impl Into<ExtendedKalmanFilter<T, N>>) -> Self {
        Smoother { filter: filter.into(), samples: Vec::new(), elements: Vec::new() }
    }
}

impl<T: Real, N: Dimension> From<UnscentedKalmanFilter<T, N>>
    for Smoother<T, N, UnscentedKalmanFilter<T, N>>
{
    /// A smoother that starts where this filter stands.
    fn from(filter: UnscentedKalmanFilter<T, N>) -> Self {
        Smoother { filter, samples: Vec::new(), elements: Vec::new() }
    }
}

impl<T: Real, N: Dimension, F: Linearising<T, N>> Smoother<T, N, F> {
    /// The filter: its estimate takes account of the measurements so far.
    pub fn filter(&self) -> &F {
        &self.filter
    }

    /// The time update: see [`ExtendedKalmanFilter::predict`] or [`UnscentedKalmanFilter::predict`]. A new sample
    /// begins.
    ///
    /// Errors, after which nothing has changed: as there.
    pub fn predict<U: Dimension>(
        &mut self,
        transition: &impl Transition<T, N, U>,
        input: &OVector<T, U>,
    ) -> Result<(), Error> {
        let (state, covariance) = (self.filter.estimate().clone(), self.filter.uncertainty().clone());
        let state_matrix = self.filter.predict_told(transition, input)?;
        let elements = mem::take(&mut self.elements);
        self.samples.push(Sample { elements, state, covariance, state_matrix });
        Ok(())
    }

    /// The measurement update: see [`ExtendedKalmanFilter::correct`] or [`UnscentedKalmanFilter::correct`].
    ///
    /// Errors, after which nothing has changed: as there.
    pub fn correct<M: Dimension + Dimension<N>, U: Dimension>(
        &mut self,
        observation: &impl Observation<T, N, M, U>,
        input: &OVector<T, U>,
        measurement: &OVector<T, M>,
    ) -> Result<Innovation<T, OVector<T, M>>, Error>
    where
        N: Dimension<M>,
    {
        let size = self.filter.uncertainty().size();
        let (mut elements, mut last_iteration) = (Vec::new(), 0);
        let record = |iteration, row: &[T], covariance: &[T], variance, error| {
            if iteration > last_iteration {
                elements.clear();
                last_iteration = iteration;
            }
            let (mut h, mut gain) = (size.vector(T::zero()), size.vector(T::zero()));
            ud::copy(row, h.as_mut_slice());
            for (gain, &covariance) in gain.as_mut_slice().iter_mut().zip(covariance) {
                *gain = covariance / variance;
            }
            elements.push(Element { row: h, gain, variance, error });
        };
        let innovation = self.filter.correct_told(observation, input, measurement, record)?;
        if matches!(innovation.action, Action::Updated | Action::Released) {
            self.elements.append(&mut elements);
        }
        Ok(innovation)
    }

    /// The states at all samples, given all measurements: first the one from which the filter started, then one for
    /// each [`predict`](Smoother::predict).
    ///
    /// Errors: [`Error::Overflow`]. About 5 n³ multiply-adds for each sample, and 2 n³ for each element measured.
    pub fn smooth(&self) -> Result<Vec<Smoothed<T, N>>, Error> {
        let (state, covariance) = (self.filter.estimate(), self.filter.uncertainty());
        let mut future = Future::nothing(covariance.size());
        let mut smoothed = Vec::with_capacity(self.samples.len() + 1);
        smoothed.push(future.correct(state, covariance)?);
        future.absorb(&self.elements)?;
        for sample in self.samples.iter().rev() {
            future.transform(&transpose(&sample.state_matrix))?;
            smoothed.push(future.correct(&sample.state, &sample.covariance)?);
            future.absorb(&sample.elements)?;
        }
        smoothed.reverse();
        Ok(smoothed)
    }
}

/// What later measurements tell of a state: λ and Λ.
struct Future<T: Real, N: Dimension> {
    gradient: OVector<T, N>,
    curvature: Covariance<T, N>,
}

impl<T: Real, N: Dimension> Future<T, N> {
    fn nothing(size: N) -> Self {
        Future { gradient: size.vector(T::zero()), curvature: Covariance::zero(size) }
    }

    /// λ <- A λ, Λ <- A Λ A'.
    fn transform(&mut self, matrix: &OMatrix<T, N, N>) -> Result<(), Error> {
        let mut gradient = self.curvature.size().vector(T::zero());
        add_product(matrix.as_slice(), self.gradient.as_slice(), gradient.as_mut_slice());
        self.gradient = gradient;
        self.curvature = self.curvature.transformed(matrix)?;
        Ok(())
    }

    /// Back over the elements measured at a sample: λ <- C'λ - h e / s, Λ <- C'Λ C + h h'/ s, C = I - K h'.
    fn absorb(&mut self, elements: &[Element<T, N>]) -> Result<(), Error> {
        let size = self.curvature.size();
        for Element { row, gain, variance, error } in elements.iter().rev() {
            let mut rest = size.square(T::zero());
            for (index, &gain) in gain.as_slice().iter().enumerate() {
                let target = column_mut(rest.as_mut_slice(), size.value(), index);
                add_multiple(target, -gain, row.as_slice());
                if let Some(diagonal) = target.get_mut(index) {
                    *diagonal += T::one();
                }
            }
            self.transform(&rest)?;
            add_multiple(self.gradient.as_mut_slice(), -*error / *variance, row.as_slice());
            let mut row = row.clone();
            ud::add_dyad(self.curvature.as_mut_slice(), row.as_mut_slice(), T::one() / *variance);
        }
        Ok(())
    }

    /// x̂ - P λ and P - P Λ P, with P = U D U' and B = D^½ U' as U D^½ (I - B Λ B') D^½ U'.
    fn correct(&self, state: &OVector<T, N>, covariance: &Covariance<T, N>) -> Result<Smoothed<T, N>, Error> {
        let size = covariance.size();
        let n = size.value();
        let mut root = size.square(T::zero());
        for index in 0..n {
            let target = column_mut(root.as_mut_slice(), n, index);
            ud::unit_column(covariance.as_slice(), target, index);
            let deviation = ud::variance(covariance.as_slice(), n, index).sqrt();
            for entry in target {
                *entry *= deviation;
            }
        }
        let known = self.curvature.transformed(&transpose(&root))?.matrix();

        let mut smoothed = Smoothed { state: state.clone(), covariance: size.square(T::zero()) };
        for index in 0..n {
            let entries = column(root.as_slice(), n, index);
            add_multiple(smoothed.state.as_mut_slice(), -dot(entries, self.gradient.as_slice()), entries);
            // Column `index` of U D^½ (I - B Λ B').
            let mut left = size.vector(T::zero());
            for (k, &known) in column(known.as_slice(), n, index).iter().enumerate() {
                let weight = if k == index { T::one() - known } else { -known };
                add_multiple(left.as_mut_slice(), weight, column(root.as_slice(), n, k));
            }
            for (k, &entry) in entries.iter().enumerate() {
                add_multiple(column_mut(smoothed.covariance.as_mut_slice(), n, k), entry, left.as_slice());
            }
        }
        let mirrored = transpose(&smoothed.covariance);
        let half = nalgebra::convert::<f64, T>(0.5);
        for (index, (entry, &mirrored)) in
            smoothed.covariance.as_mut_slice().iter_mut().zip(mirrored.as_slice()).enumerate()
        {
            *entry = (*entry + mirrored) * half;
            if index % (n + 1) == 0 {
                *entry = entry.max(T::zero());
            }
        }
        let finite = smoothed.state.iter().chain(smoothed.covariance.iter()).all(T::is_finite);
        if finite { Ok(smoothed) } else { Err(Error::Overflow) }
    }
}

#[cfg(test)]
mod tests;
