//! The unscented Kalman filter: models are seen at points around the estimate, and need no Jacobians.

use nalgebra::{OMatrix, OVector};

use crate::around::around_kalman_filter;
use crate::error::{check_entries, check_finite, check_length};
use crate::kalman::prediction_error;
use crate::state_space::transpose;
use crate::triangle::{column, column_mut};
use crate::ud::{self, add_multiple};
use crate::{Covariance, Dimension, Error, Innovation, KalmanFilter, Observation, Real, Transition};

/// A mean and a covariance.
type Moments<T, N> = (OVector<T, N>, Covariance<T, N>);

/// The unscented Kalman filter.
///
/// It keeps an estimate x̂ of the state and a covariance P = U D U' of its error, as [`KalmanFilter`] does, for models
/// that are not linear. It evaluates [`Transition::next`] and [`Observation::output`] at 2 n + 1 points and never asks
/// for a Jacobian: a model for this filter alone may leave its Jacobians out.
///
/// With u_j column j of U, and g either of the two functions, of x ~ (x̂, P):
///
/// ```text
/// points       x̂,   x̂ + c √D_j u_j,   x̂ - c √D_j u_j                 g_0,  g_j+,  g_j-
/// slopes       s_j = (g_j+ - g_j-) / 2c                               along column j, times √D_j
/// bends        b_j = (g_j+ + g_j-) / 2 - g_0
/// mean         ḡ = g_0 + Σ b_j / c²
/// covariance   Σ s_j s_j' + (c² - 1)/c⁴ Σ b_j b_j'                    cov(x, g) = Σ √D_j u_j s_j'
/// ```
///
/// No weight is negative, for any number of states and any c >= 1. That is why the covariance stands in slopes and
/// bends: in the usual sum over the points (Julier and Uhlmann 2004) the centre has the weight 1 - n/3 where c² = 3,
/// negative from four states on, so that the covariance may become indefinite, and the square-root form (Van der
/// Merwe and Wan 2001) has to subtract it from a factor. Points and mean are the same as there, and with one state the
/// covariance too. The cubature choice, c² = n, has no negative weight either, but its points move away as n grows.
///
/// The slopes are those of a linear model, s_j = G √D_j u_j, and the bends its noise. So the updates are those of the
/// Kalman filter on the factors, and P stays positive in single precision by the same argument:
///
/// ```text
/// predict:   P <- F P F' + Q + (c² - 1)/c⁴ Σ b_j b_j'
/// correct:   e = y - ȳ,   S = H P H' + R + (c² - 1)/c⁴ Σ b_j b_j',   K = P H' S⁻¹,   P <- P - K S K'
/// ```
///
/// With c² = 3, which is the default, mean and covariance are exact for a Gaussian x where g is a sum of quadratic
/// functions of one factored coordinate each. With a linear model it is the Kalman filter, to rounding.
///
/// Q and R are taken at x̂. A point is never nearer to x̂ than √ε |x_j|, which single precision resolves; the slope and
/// the bend along it are scaled to the deviation.
///
/// **It is an approximation**, as the [`ExtendedKalmanFilter`](crate::ExtendedKalmanFilter) is. It knows of the bend of
/// a function, so that P is honest where that filter promises too much; not of what happens between the columns of U,
/// nor of a second maximum. An angle that is measured jumps by 2π: add to the measurement the multiple of 2π that
/// brings it nearest to `observation.output(filter.state(), &input)`, and let `output` not jump within the points.
///
/// Units: those of the model. Memory: as [`KalmanFilter`], and a number. On the stack, `predict` takes 2 n² + 5 n
/// numbers more than it, `correct` n m + m² + 4 n + 5 m; with `Dyn` these are allocated.
///
/// Source: Julier and Uhlmann, Unscented filtering and nonlinear estimation, 2004 (points and mean); Nørgaard, Poulsen
/// and Ravn, New developments in state estimation for nonlinear systems, 2000, section 4; Ito and Xiong, Gaussian
/// filters for nonlinear filtering problems, 2000 (the covariance); Van der Merwe, Sigma-point Kalman filters, 2004,
/// chapter 3 (how they are one family).
///
/// ```
/// use thetahat_core::nalgebra::{Const, SVector, Vector1, Vector2};
/// use thetahat_core::{Covariance, Error, Observation, Transition, UnscentedKalmanFilter};
///
/// /// A pendulum, its angle in rad and its rate in rad/s, seen by the sideways position of its end in m.
/// struct Pendulum;
/// const T: f64 = 0.02;
///
/// impl Transition<f64, Const<2>> for Pendulum {
///     fn next(&self, x: &Vector2<f64>, _: &SVector<f64, 0>) -> Vector2<f64> {
///         Vector2::new(x[0] + T * x[1], x[1] - T * 9.81 * x[0].sin())
///     }
///     fn process_noise(&self, _: &Vector2<f64>, _: &SVector<f64, 0>) -> Covariance<f64, Const<2>> {
///         Covariance::zero(Const)
///     }
/// }
///
/// impl Observation<f64, Const<2>, Const<1>> for Pendulum {
///     fn output(&self, x: &Vector2<f64>, _: &SVector<f64, 0>) -> Vector1<f64> {
///         Vector1::new(x[0].sin())
///     }
///     fn measurement_noise(&self, _: &Vector2<f64>, _: &SVector<f64, 0>) -> Covariance<f64, Const<1>> {
///         Covariance::from_diagonal(&Vector1::new(1e-4)).unwrap_or(Covariance::zero(Const))
///     }
/// }
///
/// let none = SVector::zeros(); // no inputs
/// let mut truth = Vector2::new(0.8, 0.0);
/// let prior = Covariance::from_diagonal(&Vector2::new(0.1, 0.1))?;
/// let mut filter = UnscentedKalmanFilter::new(Vector2::new(0.5, 0.3), prior)?;
/// for _ in 0..200 {
///     truth = Pendulum.next(&truth, &none);
///     filter.predict(&Pendulum, &none)?;
///     filter.correct(&Pendulum, &none, &Vector1::new(truth[0].sin()))?;
/// }
/// assert!((filter.state() - truth).amax() < 2e-3);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N>"))]
pub struct UnscentedKalmanFilter<T: Real, N: Dimension> {
    linear: KalmanFilter<T, N>,
    spread: T,
}

/// √3.
const SPREAD: f64 = 1.732_050_807_568_877_2;

impl<T: Real, N: Dimension> From<KalmanFilter<T, N>> for UnscentedKalmanFilter<T, N> {
    /// The same filter, for models that need not be linear.
    fn from(linear: KalmanFilter<T, N>) -> Self {
        UnscentedKalmanFilter { linear, spread: nalgebra::convert(SPREAD) }
    }
}

around_kalman_filter!(UnscentedKalmanFilter);

impl<T: Real, N: Dimension> UnscentedKalmanFilter<T, N> {
    /// A filter that starts from this estimate of the state and the covariance of its error.
    ///
    /// Errors: [`Error::NotFinite`]; [`Error::Length`] (only with `Dyn`).
    pub fn new(state: OVector<T, N>, covariance: Covariance<T, N>) -> Result<Self, Error> {
        Ok(KalmanFilter::new(state, covariance)?.into())
    }

    /// The same with points at c standard deviations, √3 at first. Smaller: for functions that are not defined far
    /// away, or bend otherwise there. With 1 the covariance knows nothing of bends.
    ///
    /// Errors: [`Error::OutOfRange`] if c is not in 1 … 10.
    pub fn with_spread(mut self, spread: T) -> Result<Self, Error> {
        self.set_spread(spread)?;
        Ok(self)
    }

    /// Sets how far the points are: see [`with_spread`](UnscentedKalmanFilter::with_spread), whose errors it has.
    pub fn set_spread(&mut self, spread: T) -> Result<(), Error> {
        if !(spread >= T::one() && spread <= nalgebra::convert(10.0)) {
            return Err(Error::OutOfRange { argument: "spread", range: "1 to 10" });
        }
        self.spread = spread;
        Ok(())
    }

    /// How many standard deviations the points are from the estimate, c.
    pub fn spread(&self) -> T {
        self.spread
    }

    /// The time update: one sample ahead, with the input u(k).
    ///
    /// Errors, after which nothing has changed: [`Error::NotFinite`] if an input, or the next state of one of the
    /// points is NaN or infinite; [`Error::Overflow`]; [`Error::Length`] (only with `Dyn`). 2 n + 1 times the model's
    /// function, and about 4 n³ multiply-adds.
    #[inline]
    pub fn predict<U: Dimension>(
        &mut self,
        transition: &impl Transition<T, N, U>,
        input: &OVector<T, U>,
    ) -> Result<(), Error> {
        self.predict_recorded(transition, input).map(|_| ())
    }

    /// The time update; returns F.
    #[inline(always)]
    pub(crate) fn predict_recorded<U: Dimension>(
        &mut self,
        transition: &impl Transition<T, N, U>,
        input: &OVector<T, U>,
    ) -> Result<OMatrix<T, N, N>, Error> {
        check_finite("input", input.as_slice())?;
        let state = self.linear.state();
        let noise = transition.process_noise(state, input);
        let next = transition.next(state, input);
        check_entries("next state", next.as_slice(), state.len())?;
        noise.check("transition noise", state.len())?;
        let points = At(transition, input);
        let (Seen { mean, matrix, mut noise }, mut bends) = self.seen(next, noise, "next state", &points)?;
        let (n, weight, mut noise_matrix) = (mean.len(), self.weight(), noise.matrix());
        for index in 0..n {
            let bend = column(bends.as_slice(), n, index);
            for (k, &entry) in bend.iter().enumerate() {
                add_multiple(column_mut(noise_matrix.as_mut_slice(), n, k), weight * entry, bend);
            }
        }
        self.linear.propagate(&points, mean, &matrix, &noise_matrix, || {
            add_bends(&mut noise, &mut bends, weight);
            &noise
        })?;
        Ok(matrix)
    }

    /// The measurement that is expected now, ȳ, and the covariance S of its innovation.
    ///
    /// Errors: as [`correct`](UnscentedKalmanFilter::correct), and [`Error::Overflow`].
    pub fn expected<M: Dimension + Dimension<N>, U: Dimension>(
        &self,
        observation: &impl Observation<T, N, M, U>,
        input: &OVector<T, U>,
    ) -> Result<Moments<T, M>, Error>
    where
        N: Dimension<M>,
    {
        let Seen { mean, matrix, noise } = self.observed(observation, input)?;
        let covariance = self.linear.covariance().transformed(&matrix)?.plus(&noise)?;
        Ok((mean, covariance))
    }

    /// The measurement update, with y(k) and u(k).
    ///
    /// A NaN in the measurement is a missing element: it is skipped alone, and the others are used. The innovation
    /// tells what was new.
    ///
    /// Errors, after which nothing has changed: [`Error::Infinite`] if the measurement is; [`Error::NotFinite`] if an
    /// input, or the measurement predicted at one of the points is NaN or infinite; [`Error::NoVariance`];
    /// [`Error::TooLarge`] if the measurement makes numbers overflow; [`Error::Length`] (only with `Dyn`). 2 n + 1
    /// times the model's function, and about m (2 n² + 2 n m + 6 n) multiply-adds.
    #[inline]
    pub fn correct<M: Dimension + Dimension<N>, U: Dimension>(
        &mut self,
        observation: &impl Observation<T, N, M, U>,
        input: &OVector<T, U>,
        measurement: &OVector<T, M>,
    ) -> Result<Innovation<T, OVector<T, M>>, Error>
    where
        N: Dimension<M>,
    {
        self.correct_recorded(observation, input, measurement, |_, _, _, _, _| ())
    }

    /// The measurement update. `record` is told of each element that is used, as in [`KalmanFilter::absorb`].
    #[inline(always)]
    pub(crate) fn correct_recorded<M: Dimension + Dimension<N>, U: Dimension>(
        &mut self,
        observation: &impl Observation<T, N, M, U>,
        input: &OVector<T, U>,
        measurement: &OVector<T, M>,
        mut record: impl FnMut(usize, &[T], &[T], T, T),
    ) -> Result<Innovation<T, OVector<T, M>>, Error>
    where
        N: Dimension<M>,
    {
        let Seen { mean, matrix, noise } = self.observed(observation, input)?;
        let error = prediction_error(measurement, mean)?;
        self.linear.absorb(transpose(&matrix), error, &noise, |h, v, s, e| record(0, h, v, s, e))
    }

    /// The observation as the points see it, its bends among its noise.
    #[inline(always)]
    fn observed<M: Dimension + Dimension<N>, U: Dimension>(
        &self,
        observation: &impl Observation<T, N, M, U>,
        input: &OVector<T, U>,
    ) -> Result<Seen<T, N, M>, Error>
    where
        N: Dimension<M>,
    {
        check_finite("input", input.as_slice())?;
        let state = self.linear.state();
        let noise = observation.measurement_noise(state, input);
        let output = observation.output(state, input);
        check_finite("predicted measurement", output.as_slice())?;
        noise.check("observation noise", output.len())?;
        let (mut seen, mut bends) =
            self.seen(output, noise, "predicted measurement", &Of(observation, input))?;
        add_bends(&mut seen.noise, &mut bends, self.weight());
        seen.noise.check("predicted measurement", seen.mean.len())?;
        Ok(seen)
    }

    /// A function as the points see it, given its value at the centre and the noise that is added to it.
    #[inline(always)]
    fn seen<R: Dimension + Dimension<N>>(
        &self,
        centre: OVector<T, R>,
        noise: Covariance<T, R>,
        argument: &'static str,
        function: &impl Function<T, N, R>,
    ) -> Result<Bent<T, N, R>, Error>
    where
        N: Dimension<R>,
    {
        let (state, factor) = (self.linear.state(), self.linear.covariance());
        let (size, n, outputs) = (factor.size(), state.len(), centre.len());
        let (half, finest) = (nalgebra::convert::<f64, T>(0.5), T::SQRT_EPSILON);
        let mean_weight = T::one() / (self.spread * self.spread);
        let mut matrix = noise.size().rows_by(size, T::zero());
        let mut bends = matrix.clone();
        let mut mean = centre.clone();
        for (index, x) in state.as_slice().iter().enumerate() {
            let deviation = ud::variance(factor.as_slice(), n, index).sqrt();
            let reach = deviation.max(finest * x.abs());
            if reach.is_zero() {
                continue;
            }
            let mut direction = size.vector(T::zero());
            ud::unit_column(factor.as_slice(), direction.as_mut_slice(), index);
            let step = self.spread * reach;
            let value = |step: T| {
                let mut point = state.clone();
                add_multiple(point.as_mut_slice(), step, direction.as_slice());
                function.value(&point)
            };
            // What is not finite shows in a slope or a bend.
            let (ahead, behind) = (value(step), value(-step));
            check_length(argument, outputs, ahead.len())?;
            check_length(argument, outputs, behind.len())?;
            let scale = half / step;
            let share = if reach > deviation { deviation / reach } else { T::one() };
            let slope = column_mut(matrix.as_mut_slice(), outputs, index);
            let bend = column_mut(bends.as_mut_slice(), outputs, index);
            let values = ahead.as_slice().iter().zip(behind.as_slice()).zip(centre.as_slice());
            for ((slope, bend), ((&ahead, &behind), &centre)) in slope.iter_mut().zip(&mut *bend).zip(values)
            {
                // Differences first: where these are small beside the values, their sum keeps its digits.
                *slope = (ahead - behind) * scale;
                *bend = ((ahead - centre) + (behind - centre)) * half * share * share;
            }
            add_multiple(mean.as_mut_slice(), mean_weight, bend);
        }
        // So far it is G U, from which G is solved from the left.
        for index in 1..n {
            let (known, rest) =
                matrix.as_mut_slice().split_at_mut_checked(index * outputs).unwrap_or_default();
            let target = column_mut(rest, outputs, 0);
            for i in 0..index {
                let entry = ud::entry(factor.as_slice(), n, i, index);
                add_multiple(target, -entry, column(known, outputs, i));
            }
        }
        check_finite(argument, mean.as_slice())?;
        check_finite(argument, matrix.as_slice())?;
        check_finite(argument, bends.as_slice())?;
        Ok((Seen { mean, matrix, noise }, bends))
    }

    /// (c² - 1)/c⁴, the weight of the bends in a covariance.
    fn weight(&self) -> T {
        let square = self.spread * self.spread;
        (square - T::one()) / (square * square)
    }
}

/// A function of the state. (A closure that returns a vector would ask for the bounds that `Dimension` hides.)
trait Function<T: Real, N: Dimension<R>, R: Dimension<N>> {
    fn value(&self, point: &OVector<T, N>) -> OVector<T, R>;
}

/// The next state, with these inputs.
struct At<'a, M, V>(&'a M, &'a V);

impl<T: Real, N: Dimension, U: Dimension, M: Transition<T, N, U>> Function<T, N, N>
    for At<'_, M, OVector<T, U>>
{
    fn value(&self, point: &OVector<T, N>) -> OVector<T, N> {
        self.0.next(point, self.1)
    }
}

/// The output, with these inputs.
struct Of<'a, M, V>(&'a M, &'a V);

impl<
    T: Real,
    N: Dimension + Dimension<R>,
    R: Dimension + Dimension<N>,
    U: Dimension,
    M: Observation<T, N, R, U>,
> Function<T, N, R> for Of<'_, M, OVector<T, U>>
{
    fn value(&self, point: &OVector<T, N>) -> OVector<T, R> {
        self.0.output(point, self.1)
    }
}

/// A function as the points see it: linear, with noise.
struct Seen<T: Real, N: Dimension, R: Dimension + Dimension<N>> {
    /// ḡ.
    mean: OVector<T, R>,
    /// G.
    matrix: OMatrix<T, R, N>,
    /// The noise that is added.
    noise: Covariance<T, R>,
}

/// The same, and the bends apart, b_j in column j.
type Bent<T, N, R> = (Seen<T, N, R>, OMatrix<T, R, N>);

/// Adds the noise of the bends, which are columns and are used up. n times 2 m² multiply-adds and m divisions.
fn add_bends<T: Real, N: Dimension, R: Dimension + Dimension<N>>(
    noise: &mut Covariance<T, R>,
    bends: &mut OMatrix<T, R, N>,
    weight: T,
) {
    let outputs = bends.nrows();
    for bend in bends.as_mut_slice().chunks_exact_mut(outputs.max(1)) {
        ud::add_dyad(noise.as_mut_slice(), bend, weight);
    }
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
