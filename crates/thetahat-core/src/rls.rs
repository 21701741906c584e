//! Recursive least squares on a factored covariance.

use nalgebra::{Const, OMatrix, OVector};

use crate::dim::filled;
use crate::error::{check_entries, check_finite, check_length};
use crate::forgetting::{Forgetting, Phase, RlsStart};
use crate::outliers::Watch;
use crate::triangle::{column, column_mut};
use crate::ud::dot;
use crate::{Covariance, Dimension, Error, Innovation, Outliers, Real, Solution, ud};

mod after;
mod estimates;
mod limits;
mod residuals;
mod sample;
mod settings;
#[cfg(feature = "serde")]
mod snapshot;

use after::After;
pub(crate) use limits::check_limits;
use residuals::Residuals;
pub(crate) use sample::is_small;
pub(crate) use settings::{pass_on, pass_on_settings};

/// Recursive least squares: a regressor and an output in each sample, the parameters out at any time.
///
/// ```text
/// y(k) = φ(k)'θ + e(k)
///
/// e = y - φ'θ̂,     s = λ + φ'P φ
/// θ̂ <- θ̂ + P φ e / s,     P <- (P - P φ φ'P / s) / λ
/// ```
///
/// There is no offset and no sign convention: what φ means is the caller's. ([`RecursiveArx`](crate::RecursiveArx)
/// makes φ from inputs and outputs.) The formulas above are those of exponential forgetting; [`Forgetting`] lists
/// the others, what each is for, and how each stays bounded. [`RlsStart`] lists the ways to start.
///
/// P = U D U' is kept as its factors and updated by formulas that do not subtract variances: it never becomes
/// indefinite, in `f32` too. And it is bounded, so that neither silence nor a held input makes the estimate useless:
/// nothing is forgotten [where it is at its bound](Forgetting#the-bound). (Measured with λ = 0.99 and a silent input:
/// without the bound P was lost after 59,000 steps in `f32` and after 121,000 in `f64`, factored as it was.)
///
/// # Scales
///
/// The typical magnitude of each regressor is a required argument. It sets the prior and the bound, P_jj =
/// p_j = 100/scale_j²: one number for all would be wrong for regressors of different units. A factor of 3 does
/// not matter. With outputs much larger than the noise, the prior still weighs only as much as a hundredth of
/// one sample.
///
/// # How sure
///
/// P is the covariance of θ̂ in units of the noise variance σ², and σ² is estimated too, from the residuals:
///
/// ```text
/// W <- λ W + 1,   W₂ <- λ² W₂ + 1,   v <- v + (e²/(1 + φ'P⁻φ) - v)/W
/// σ̂² = v W/(W - n W₂/W),        cov θ̂ ≈ σ̂² P W₂/W        (W₂/W -> 1/(1 + λ))
/// ```
///
/// P⁻ is P after forgetting, P/λ here. E v = σ² (1 - n W₂/W²), as n parameters fit some of the noise. It is
/// unknown (`None`) until W²/W₂, the number of samples that count, exceeds n. A sample that tells more of the
/// parameters than of the noise, φ'P⁻φ > 10, enters as 0, as it would without prior. (Where the noise is below a
/// hundredth of the output, σ̂² starts too large all the same: the prior pulls at the first samples. The exact start
/// has no such error: where no prior is in, every sample counts, and without forgetting σ̂² is that of the batch.) With
/// selective forgetting λ is the `factor`; the random walk does not forget residuals, and its P is the covariance,
/// cov θ̂ = σ̂² P.
///
/// In the directions in which nothing is forgotten, as they are [at their bound](Forgetting#the-bound) or silent, the
/// noise variance of cov θ̂ is the largest since that began, and at the bound W₂/W is 1 there: a loop that has settled,
/// with samples that agree to the last digit, says nothing of what it does not excite. What the prior does not allow
/// for shows nowhere: of a plant without noise that never was excited, errors can be some ten standard errors.
///
/// # Several outputs
///
/// With M outputs θ is n x m, and y_i = φ'θ_i + e_i: all share φ, P and the work on P. A sample with one output
/// missing is missing.
///
/// # Units, size, cost
///
/// θ_j has the unit of y over that of φ_j. P_ij has one over the units of φ_i and φ_j.
///
/// Memory: n² + n (2 m + 1) + m + 7 numbers, n flags and a few counters: 164 bytes for n = 4 in `f32` on a 32-bit
/// machine. An update costs 1.5 n² + (6 + m) n multiply-adds and n divisions. No square root.
///
/// Source: Ljung, System Identification, 2nd ed., section 11.2; Bierman, Factorization Methods for Discrete
/// Sequential Estimation, 1977, chapter V (the factors).
///
/// ```
/// use thetahat_core::nalgebra::{Const, Vector2};
/// use thetahat_core::{Action, Error, Forgetting, RecursiveLeastSquares};
///
/// // A gain and an offset: y = 3 u + 20, u about 2. Later the gain is 1.
/// let scales = Vector2::new(2.0, 1.0);
/// let mut estimator: RecursiveLeastSquares<f32, Const<2>> =
///     RecursiveLeastSquares::new(&scales, Forgetting::Exponential { factor: 0.95 })?;
/// for k in 0..400 {
///     let u = if k % 5 < 2 { 2.0 } else { -2.0 };
///     let y = if k < 200 { 3.0 * u + 20.0 } else { u + 20.0 };
///     let innovation = estimator.update(&Vector2::new(u, 1.0), y)?;
///     assert_eq!(innovation.action, Action::Updated);
/// }
/// assert!((estimator.parameters() - Vector2::new(1.0, 20.0)).amax() < 1e-3);
///
/// // A missing output: nothing is corrected.
/// let innovation = estimator.update(&Vector2::new(2.0, 1.0), f32::NAN)?;
/// assert_eq!(innovation.action, Action::Missing);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N, M>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N, M>"))]
pub struct RecursiveLeastSquares<T: Real, N: Dimension + Dimension<M>, M: Dimension = Const<1>> {
    parameters: OMatrix<T, N, M>,
    covariance: Covariance<T, N>,
    /// p_j: the prior variances, and the largest that forgetting makes.
    bounds: OVector<T, N>,
    residuals: Residuals<T, M>,
    forgetting: Forgetting<T>,
    dead_zone: T,
    outliers: Watch<T>,
    /// Which columns of U are held, and how many.
    held: OVector<bool, N>,
    held_columns: u16,
    /// The largest v since a column was forgotten, for each output; 0 while it is.
    noises: OMatrix<T, N, M>,
    /// Whose variance is compared with its bound next.
    turn: u16,
    phase: Phase,
    /// In how many shares the start takes the prior out, and how many of them are still in.
    shares: u16,
    shares_left: u16,
    adapting: bool,
    after: After<Self>,
    scratch: N::Scratch<T>,
}

impl<T: Real, N: Dimension + Dimension<Const<1>>> RecursiveLeastSquares<T, N> {
    /// An estimator with one output that knows nothing yet: θ̂ = 0, P_jj = 100/scale_j².
    ///
    /// `scales` are the typical magnitudes of the regressors, see
    /// [Scales](RecursiveLeastSquares#scales).
    ///
    /// Errors: [`Error::NotFinite`]; [`Error::OutOfRange`] if a scale is not above 0 or its third power or that of
    /// its reciprocal exceeds [`Real::LARGEST_ENTRY`] (in `f32` they lie in 6e-10 … 1.7e9), or if a number of the
    /// forgetting policy is out of its range; [`Error::Length`] for more than 65,535 parameters.
    ///
    /// A policy that is a constant here, and a start that is one in [`with_start`](RecursiveLeastSquares::with_start),
    /// keep out of the program what others would need: of 4.3 kB on a Cortex-M4F, 1 kB more with the random walk or
    /// another start.
    #[inline]
    pub fn new(scales: &OVector<T, N>, forgetting: Forgetting<T>) -> Result<Self, Error> {
        Self::with_outputs(scales, Const, forgetting)
    }

    /// The same, started from a batch solution: its parameters, (R'R)⁻¹ as P, and its residual variance. The start
    /// is then [`RlsStart::Standard`].
    ///
    /// A log is fitted on a computer; the controller goes on from there.
    ///
    /// Errors: [`Error::Length`] (only with `Dyn`); [`Error::TooLarge`] if a variance exceeds what the largest
    /// prior can be; [`Error::Overflow`] if an entry of P, or the residual variance, does not fit `T`.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Vector1};
    /// use thetahat_core::{Error, Forgetting, LeastSquares, RecursiveLeastSquares};
    ///
    /// let mut batch = LeastSquares::<f64, Const<1>>::new();
    /// for y in [1.0, 2.0, 3.0, 6.0] {
    ///     batch.add(&Vector1::new(1.0), y)?;
    /// }
    /// let mut mean = RecursiveLeastSquares::new(&Vector1::new(1.0), Forgetting::None)?
    ///     .with_solution(&batch.solve()?)?;
    /// mean.update(&Vector1::new(1.0), 8.0)?;
    /// assert!((mean.parameters()[0] - 4.0).abs() < 1e-14);
    /// // (9 + 4 + 1 + 4 + 16) / (5 - 1)
    /// assert!((mean.noise_variance().unwrap() - 8.5).abs() < 1e-13);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn with_solution(self, solution: &Solution<T, N>) -> Result<Self, Error> {
        let n = self.bounds.len();
        check_length("solution", n, solution.parameters.len())?;
        let mut covariance = Covariance::independent(&self.bounds);
        // R⁻¹ R⁻¹' = U D U', with the columns of R⁻¹ divided by its diagonal.
        for index in 0..n {
            let inverse = |row: usize| {
                column(solution.inverse_rows.as_slice(), n, row).get(index).copied().unwrap_or(T::zero())
            };
            let pivot = inverse(index);
            for (row, entry) in
                column_mut(covariance.as_mut_slice(), n, index).iter_mut().take(index + 1).enumerate()
            {
                *entry = if row == index { pivot * pivot } else { inverse(row) / pivot };
            }
            if ud::variance(covariance.as_slice(), n, index) < T::MIN_POSITIVE {
                return Err(Error::Overflow);
            }
        }
        if !ud::is_finite(covariance.as_slice(), n) {
            return Err(Error::Overflow);
        }
        let rows = T::from_count(solution.rows);
        let mean_square = solution.residual_sum_of_squares() / rows;
        if !mean_square.is_finite() {
            return Err(Error::Overflow);
        }
        let mut this = self.with_parameters(solution.parameters.clone())?.with_covariance(covariance)?;
        this.residuals.mean_squares.fill(mean_square);
        (this.residuals.weights, this.residuals.squared_weights) = (rows, rows);
        this.phase = Phase::Free;
        Ok(this)
    }

    /// One sample: corrects the estimate by φ and y = φ'θ + e.
    ///
    /// NaN in either is a missing sample. The innovation is e with its variance σ̂² (1 + φ'P⁻φ), both from what was
    /// known before this sample. Until σ̂² is known the variance is NaN, and `nis` is 0; it is at most
    /// [`Real::LARGEST_ENTRY`].
    ///
    /// [`Action`](crate::Action) tells what was done: `Updated`; `Capped`, updated and a variance at its bound;
    /// `Collecting`, see [`RlsStart::Exact`]; `Missing`; `Skipped`, in the dead zone; `Frozen`.
    ///
    /// Errors, after which nothing has changed: [`Error::Infinite`]; [`Error::TooLarge`] for numbers whose products
    /// could overflow (about 7e13 in `f32`, for a scale of 1); [`Error::Length`] (only with `Dyn`).
    ///
    /// 1.5 n² + 7 n multiply-adds, n divisions.
    #[inline]
    pub fn update(&mut self, regressor: &OVector<T, N>, output: T) -> Result<Innovation<T>, Error> {
        self.take(regressor.as_slice(), output)
    }

    /// [`update`](RecursiveLeastSquares::update) with the regressor as a slice.
    #[inline(always)]
    pub(crate) fn take(&mut self, regressor: &[T], output: T) -> Result<Innovation<T>, Error> {
        let (mut error, mut variance) = ([T::NAN], [T::NAN]);
        let (nis, action) = self.step(regressor, &[output], &mut error, &mut variance)?;
        let ([error], [variance]) = (error, variance);
        Ok(Innovation { error, variance, nis, action })
    }

    /// The same with a noise variance that is known from this many earlier samples, as from a batch fit: σ̂² is
    /// `variance` until the next sample, and the earlier samples weigh as they would have if they had come in here,
    /// all alike. For [`with_parameters`](RecursiveLeastSquares::with_parameters) and
    /// [`with_covariance`](RecursiveLeastSquares::with_covariance), which say nothing of the noise.
    ///
    /// ```text
    /// W = W₂ = samples,     v = variance (samples - n)/samples
    /// ```
    ///
    /// Errors: [`Error::OutOfRange`] if the variance is not finite and at least 0; [`Error::TooFewRows`] if there are
    /// not more samples than parameters.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Vector2};
    /// use thetahat_core::{Error, Forgetting, RecursiveLeastSquares};
    ///
    /// let line: RecursiveLeastSquares<f64, Const<2>> =
    ///     RecursiveLeastSquares::new(&Vector2::new(1.0, 1.0), Forgetting::None)?.with_noise_variance(0.25, 100)?;
    /// assert!((line.noise_variance().unwrap() - 0.25).abs() < 1e-15);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn with_noise_variance(mut self, variance: T, samples: usize) -> Result<Self, Error> {
        self.set_noise_variance(variance, samples)?;
        Ok(self)
    }

    /// φ'θ̂: the output this regressor predicts, in the unit of y. n multiply-adds.
    ///
    /// Errors: [`Error::Length`] (only with `Dyn`); [`Error::NotFinite`] if the regressor holds NaN or infinity;
    /// [`Error::Overflow`] if the prediction does not fit `T`.
    pub fn predict(&self, regressor: &OVector<T, N>) -> Result<T, Error> {
        check_length("regressor", self.bounds.len(), regressor.len())?;
        self.prediction(regressor.as_slice(), 0)
    }
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension> RecursiveLeastSquares<T, N, M> {
    /// The same as [`new`](RecursiveLeastSquares::new) with several outputs, `Const::<2>` for instance, or `Dyn(2)`
    /// with the feature `alloc`.
    ///
    /// Errors: as for `new`.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Matrix2x3, Vector2, Vector3};
    /// use thetahat_core::{Error, Forgetting, RecursiveLeastSquares};
    ///
    /// let truth = Matrix2x3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0);
    /// let mut estimator: RecursiveLeastSquares<f64, Const<2>, Const<3>> =
    ///     RecursiveLeastSquares::with_outputs(&Vector2::new(1.0, 1.0), Const, Forgetting::None)?;
    /// for k in 0..200 {
    ///     let regressor = Vector2::new((k % 3) as f64, (k % 5) as f64);
    ///     estimator.update_all(&regressor, &truth.tr_mul(&regressor))?;
    /// }
    /// assert!((estimator.parameters() - truth).amax() < 1e-3);
    /// # Ok::<(), Error>(())
    /// ```
    #[inline]
    pub fn with_outputs(
        scales: &OVector<T, N>,
        outputs: M,
        forgetting: Forgetting<T>,
    ) -> Result<Self, Error> {
        let size = scales.shape_generic().0;
        // `turn` counts them.
        let most = usize::from(u16::MAX);
        if size.value() > most {
            return Err(Error::Length { argument: "scales", expected: most, found: size.value() });
        }
        forgetting.check(size.value())?;
        check_entries("scales", scales.as_slice(), size.value())?;
        let mut bounds = size.vector(T::zero());
        for (bound, &scale) in bounds.as_mut_slice().iter_mut().zip(scales.as_slice()) {
            let cube = scale * scale * scale;
            if !(cube * T::LARGEST_ENTRY >= T::one() && cube <= T::LARGEST_ENTRY) {
                let range = "from 1e-99 to 1e99 (in single precision from 6e-10 to 1.7e9): use other units";
                return Err(Error::OutOfRange { argument: "scales", range });
            }
            *bound = T::from_count(100) / (scale * scale);
        }
        Ok(RecursiveLeastSquares {
            parameters: size.rows_by(outputs, T::zero()),
            covariance: Covariance::independent(&bounds),
            bounds,
            residuals: Residuals::new(outputs),
            forgetting,
            dead_zone: T::zero(),
            outliers: Watch::new(Outliers::Used)?,
            held: size.vector(false),
            held_columns: 0,
            noises: size.rows_by(outputs, T::zero()),
            turn: 0,
            phase: Phase::Running,
            shares: 0,
            shares_left: 0,
            adapting: true,
            after: After::of(forgetting),
            scratch: size.scratch::<T, 2, 0>(),
        })
    }

    /// The same with another start, from the prior of [`new`](RecursiveLeastSquares::new): parameters, P and what is
    /// known of the noise are as there.
    ///
    /// Where parameters, P or a batch solution are given, before this call or after it, they are the start: it is the
    /// standard one, as there is no prior that the others could take out, and what is given stays.
    ///
    /// Errors: none that can occur.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Vector2};
    /// use thetahat_core::{Action, Error, Forgetting, RecursiveLeastSquares, RlsStart};
    ///
    /// let mut line: RecursiveLeastSquares<f64, Const<2>> =
    ///     RecursiveLeastSquares::new(&Vector2::new(1.0, 1.0), Forgetting::None)?.with_start(RlsStart::Exact)?;
    /// assert_eq!(line.update(&Vector2::new(0.0, 1.0), 2.0)?.action, Action::Collecting);
    /// // The second point fixes the line, and no prior pulls at it.
    /// assert_eq!(line.update(&Vector2::new(1.0, 1.0), 5.0)?.action, Action::Updated);
    /// assert!((line.parameters() - Vector2::new(3.0, 2.0)).amax() < 1e-12);
    /// # Ok::<(), Error>(())
    /// ```
    #[inline]
    pub fn with_start(mut self, start: RlsStart) -> Result<Self, Error> {
        // A start that is over leaves shares behind, a batch solution does not.
        if self.phase == Phase::Given || self.phase == Phase::Free && self.shares == 0 {
            return Ok(self);
        }
        (self.phase, self.shares) = match start {
            RlsStart::Standard => (Phase::Running, 0),
            RlsStart::Exact => (Phase::Collecting, 1),
            RlsStart::Mixed { blend } => (Phase::Waiting, blend.max(1)),
        };
        self.shares_left = self.shares;
        if !self.phase.is_running() {
            self.after = After::any();
        }
        let mut prior = self.bounds.clone();
        prior.as_mut_slice().iter_mut().for_each(|variance| *variance *= self.width());
        self.covariance = Covariance::independent(&prior);
        self.parameters.fill(T::zero());
        self.residuals.clear();
        self.turn = 0;
        self.hold_none();
        Ok(self)
    }

    /// No column of U is held.
    fn hold_none(&mut self) {
        self.held.fill(false);
        self.noises.fill(T::zero());
        self.held_columns = 0;
    }

    /// The same with these parameters, n x m, to start from: a warm start. The start is then [`RlsStart::Standard`],
    /// whatever [`with_start`](RecursiveLeastSquares::with_start) asks for before or after; if it still was collecting,
    /// P is that of [`new`](RecursiveLeastSquares::new).
    ///
    /// Errors: [`Error::Length`] (only with `Dyn`); [`Error::NotFinite`]; [`Error::TooLarge`] if a regressor of its
    /// scale would predict more than any output that can be absorbed (7e15 in `f32`).
    pub fn with_parameters(mut self, parameters: OMatrix<T, N, M>) -> Result<Self, Error> {
        self.set_parameters(parameters)?;
        Ok(self)
    }

    /// The same with this P, n x n, to start from, in units of the noise variance: how sure the parameters of
    /// [`with_parameters`](RecursiveLeastSquares::with_parameters) are. The start is then [`RlsStart::Standard`], as
    /// there.
    ///
    /// A variance of 0 holds a parameter at its value, with every policy. One above the bound does not grow.
    ///
    /// Errors: [`Error::Length`] (only with `Dyn`); [`Error::TooLarge`] if a variance exceeds what the largest
    /// prior can be (3e20 in `f32`).
    pub fn with_covariance(mut self, covariance: Covariance<T, N>) -> Result<Self, Error> {
        self.set_covariance(covariance)?;
        Ok(self)
    }

    /// The same with a dead zone: an innovation of at most this size, in the unit of y, corrects nothing, and makes
    /// nothing forgotten; [`Action::Skipped`](crate::Action::Skipped) tells. With several outputs all must be that
    /// small. The noise variance still counts them.
    ///
    /// For noise that is bounded rather than white, such as that of a coarse converter. 0 is no dead zone.
    ///
    /// Errors: [`Error::OutOfRange`] if it is not finite and at least 0.
    ///
    /// Source: Åström and Wittenmark, Adaptive Control, 2nd ed., section 11.4.
    pub fn with_dead_zone(mut self, width: T) -> Result<Self, Error> {
        self.set_dead_zone(width)?;
        Ok(self)
    }

    /// The same with a rule for outliers: see [`Outliers`].
    ///
    /// Errors: [`Error::OutOfRange`] if the threshold is not 1 or more.
    pub fn with_outliers(mut self, outliers: Outliers<T>) -> Result<Self, Error> {
        self.set_outliers(outliers)?;
        Ok(self)
    }

    /// The rule for outliers.
    pub fn outliers(&self) -> Outliers<T> {
        self.outliers.rule()
    }

    /// How many of the latest samples were outliers, since the last one that was none, at most 65,535; missing ones do
    /// not count. More than a few: what is taken for outliers is a change of the plant or of the noise.
    pub fn outliers_in_a_row(&self) -> u16 {
        self.outliers.in_a_row
    }

    /// Turns adaptation off, or on again. While it is off innovations are computed and nothing changes:
    /// [`Action::Frozen`](crate::Action::Frozen).
    pub fn set_adaptation(&mut self, on: bool) {
        self.adapting = on;
    }

    /// Whether adaptation is on. It is at first.
    pub fn is_adapting(&self) -> bool {
        self.adapting
    }

    /// One sample of all outputs: corrects the estimate by φ and y_i = φ'θ_i + e_i, i = 1 … m.
    ///
    /// As [`update`](RecursiveLeastSquares::update), whose actions and errors it has. NaN in φ or in any element of
    /// y is a missing sample, as the outputs share P. The variances are those of the elements by themselves, and
    /// `nis` is Σ e_i²/S_i: it takes the noises of the outputs for uncorrelated.
    ///
    /// 1.5 n² + (6 + m) n multiply-adds, n divisions.
    #[inline]
    pub fn update_all(
        &mut self,
        regressor: &OVector<T, N>,
        outputs: &OVector<T, M>,
    ) -> Result<Innovation<T, OVector<T, M>>, Error> {
        self.take_all(regressor.as_slice(), outputs)
    }

    /// The same with a regressor that is no vector of the caller.
    #[inline]
    pub(crate) fn take_all(
        &mut self,
        regressor: &[T],
        outputs: &OVector<T, M>,
    ) -> Result<Innovation<T, OVector<T, M>>, Error> {
        let size = self.parameters.shape_generic().1;
        let (mut error, mut variance) = (size.vector(T::NAN), size.vector(T::NAN));
        let (nis, action) =
            self.step(regressor, outputs.as_slice(), error.as_mut_slice(), variance.as_mut_slice())?;
        Ok(Innovation { error, variance, nis, action })
    }

    /// φ'θ̂_i for every output: what this regressor predicts. n m multiply-adds.
    ///
    /// Errors: as for [`predict`](RecursiveLeastSquares::predict).
    pub fn predict_all(&self, regressor: &OVector<T, N>) -> Result<OVector<T, M>, Error> {
        check_length("regressor", self.bounds.len(), regressor.len())?;
        let mut predicted = self.parameters.shape_generic().1.vector(T::zero());
        for (index, predicted) in predicted.as_mut_slice().iter_mut().enumerate() {
            *predicted = self.prediction(regressor.as_slice(), index)?;
        }
        Ok(predicted)
    }

    /// One sample without a measurement, which is what a NaN is. Only the random walk takes note of it, once the
    /// start is over and while adaptation is on; a variance that comes to its bound here is not reported.
    pub fn advance(&mut self) {
        if self.forgetting.walk().is_some() && self.phase.is_running() && self.adapting {
            self.after.call(self);
            self.hold();
        }
    }

    /// The same to the bit, with the number of parameters in another type, see [`Covariance::to_size`]: with `Const`
    /// steps take about half the time (measured).
    ///
    /// Errors: [`Error::Length`] if it has another number of parameters.
    pub fn to_size<K: Dimension + Dimension<M>>(
        &self,
        size: K,
    ) -> Result<RecursiveLeastSquares<T, K, M>, Error> {
        let outputs = self.parameters.shape_generic().1;
        Ok(RecursiveLeastSquares {
            covariance: self.covariance.to_size(size)?,
            parameters: filled(size.rows_by(outputs, T::zero()), self.parameters.as_slice()),
            bounds: filled(size.vector(T::zero()), self.bounds.as_slice()),
            residuals: self.residuals.clone(),
            forgetting: self.forgetting,
            dead_zone: self.dead_zone,
            outliers: self.outliers,
            held: filled(size.vector(false), self.held.as_slice()),
            held_columns: self.held_columns,
            noises: filled(size.rows_by(outputs, T::zero()), self.noises.as_slice()),
            turn: self.turn,
            phase: self.phase,
            shares: self.shares,
            shares_left: self.shares_left,
            adapting: self.adapting,
            after: After::any(),
            scratch: size.scratch::<T, 2, 0>(),
        })
    }

    /// The forgetting policy.
    pub fn forgetting(&self) -> Forgetting<T> {
        self.forgetting
    }

    /// φ'θ̂ of one output. A number that is not finite always shows in it.
    fn prediction(&self, regressor: &[T], output: usize) -> Result<T, Error> {
        let predicted = dot(regressor, self.of_output(output));
        if predicted.is_finite() {
            return Ok(predicted);
        }
        check_finite("regressor", regressor)?;
        Err(Error::Overflow)
    }

    fn of_output(&self, index: usize) -> &[T] {
        column(self.parameters.as_slice(), self.bounds.len(), index)
    }
}

#[cfg(test)]
mod tests;
