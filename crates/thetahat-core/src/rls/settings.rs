//! What can be set while an estimator runs, behind a `&mut`: the builders are these too.

use nalgebra::{Const, OMatrix};

use crate::error::{check_finite, check_length};
use crate::forgetting::Phase;
use crate::outliers::Watch;
use crate::{Covariance, Dimension, Error, Outliers, Real, RecursiveLeastSquares};

impl<T: Real, N: Dimension + Dimension<Const<1>>> RecursiveLeastSquares<T, N> {
    /// Sets the noise variance: see [`with_noise_variance`](RecursiveLeastSquares::with_noise_variance), whose errors
    /// it has.
    pub fn set_noise_variance(&mut self, variance: T, samples: usize) -> Result<(), Error> {
        if !(variance >= T::zero() && variance.is_finite()) {
            return Err(Error::OutOfRange { argument: "variance", range: "finite and at least 0" });
        }
        let n = self.bounds.len();
        if samples <= n {
            return Err(Error::TooFewRows { needed: n.saturating_add(1), found: samples });
        }
        let share = T::from_count(samples - n) / T::from_count(samples);
        self.residuals.mean_squares.fill(variance * share);
        let samples = T::from_count(samples);
        (self.residuals.weights, self.residuals.squared_weights) = (samples, samples);
        Ok(())
    }
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension> RecursiveLeastSquares<T, N, M> {
    /// Sets the parameters: see [`with_parameters`](RecursiveLeastSquares::with_parameters), whose errors it has. P and
    /// the noise variance stay.
    pub fn set_parameters(&mut self, parameters: OMatrix<T, N, M>) -> Result<(), Error> {
        self.check_parameters(&parameters)?;
        self.parameters = parameters;
        if self.phase == Phase::Collecting {
            self.covariance = Covariance::independent(&self.bounds);
        }
        self.give();
        Ok(())
    }

    /// What [`set_parameters`](RecursiveLeastSquares::set_parameters) checks.
    pub(crate) fn check_parameters(&self, parameters: &OMatrix<T, N, M>) -> Result<(), Error> {
        check_length("parameters", self.parameters.nrows(), parameters.nrows())?;
        check_length("parameters", self.parameters.ncols(), parameters.ncols())?;
        check_parameters(parameters.as_slice(), self.bounds.as_slice())
    }

    /// Sets P: see [`with_covariance`](RecursiveLeastSquares::with_covariance), whose errors it has. Parameters and the
    /// noise variance stay.
    pub fn set_covariance(&mut self, covariance: Covariance<T, N>) -> Result<(), Error> {
        check_length("covariance", self.bounds.len(), covariance.size().value())?;
        let fits = covariance.variances().iter().all(|&variance| is_prior(variance));
        fits.then_some(()).ok_or(Error::TooLarge { argument: "covariance" })?;
        self.covariance = covariance;
        self.hold_none();
        self.give();
        Ok(())
    }

    /// Takes P for larger by a factor: what was learnt counts that much less, and the next samples more. For a plant
    /// that has changed, as after a repair: parameters and the noise variance stay.
    ///
    /// ```text
    /// P <- factor P,     factor >= 1
    /// ```
    ///
    /// No variance shrinks here, and one of 0 stays 0. One above the bound does not grow by forgetting. A start that is
    /// not over ends.
    ///
    /// Errors, after which nothing has changed: [`Error::OutOfRange`] if the factor is not finite and at least 1;
    /// [`Error::TooLarge`] or [`Error::Overflow`] if a variance exceeds what the largest prior can be (3e20 in `f32`).
    /// n multiplications and n²/2 multiply-adds.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Vector1};
    /// use thetahat_core::{Error, Forgetting, RecursiveLeastSquares};
    ///
    /// // In a `static` or a task only a `&mut` is there.
    /// fn repaired(gain: &mut RecursiveLeastSquares<f32, Const<1>>) -> Result<(), Error> {
    ///     gain.widen(1e4)
    /// }
    ///
    /// let mut gain = RecursiveLeastSquares::new(&Vector1::new(1.0), Forgetting::None)?;
    /// for _ in 0..1000 {
    ///     gain.update(&Vector1::new(1.0), 2.0)?;
    /// }
    /// repaired(&mut gain)?;
    /// gain.update(&Vector1::new(1.0), 3.0)?; // one sample of the repaired plant
    /// assert!((gain.parameters()[0] - 2.909).abs() < 1e-3); // it counts ten times as much as the 1000
    /// # Ok::<(), Error>(())
    /// ```
    pub fn widen(&mut self, factor: T) -> Result<(), Error> {
        self.set_covariance(self.covariance.widened(factor)?)
    }

    /// The same by a sum, P <- P + Q: where some parameters have changed and others have not. Q is in units of the
    /// noise variance. One whose variance was 0 is free again if that of Q is not.
    ///
    /// Errors, after which nothing has changed: [`Error::Length`] (only with `Dyn`); [`Error::TooLarge`] or
    /// [`Error::Overflow`], as for [`widen`](RecursiveLeastSquares::widen). 1.5 n³ multiply-adds.
    pub fn widen_by(&mut self, covariance: &Covariance<T, N>) -> Result<(), Error> {
        self.set_covariance(self.covariance.plus(covariance)?)
    }

    /// Sets the rule for outliers: see [`with_outliers`](RecursiveLeastSquares::with_outliers), whose errors it has.
    /// They are counted anew.
    pub fn set_outliers(&mut self, outliers: Outliers<T>) -> Result<(), Error> {
        self.outliers = Watch::new(outliers)?;
        Ok(())
    }

    /// Sets the dead zone: see [`with_dead_zone`](RecursiveLeastSquares::with_dead_zone), whose errors it has.
    pub fn set_dead_zone(&mut self, width: T) -> Result<(), Error> {
        if !(width >= T::zero() && width.is_finite()) {
            return Err(Error::OutOfRange { argument: "width", range: "finite and at least 0" });
        }
        self.dead_zone = width;
        Ok(())
    }

    /// What is in the estimate was given.
    fn give(&mut self) {
        (self.phase, self.shares, self.shares_left) = (Phase::Given, 0, 0);
    }
}

/// Whether a variance is none that exceeds that of the smallest scale.
pub(super) fn is_prior<T: Real>(variance: T) -> bool {
    let reciprocal_scale = (variance / T::from_count(100)).sqrt();
    // Twice the limit, for the rounding.
    reciprocal_scale * reciprocal_scale * reciprocal_scale <= T::LARGEST_ENTRY * T::from_count(2)
}

/// That parameters are finite, and what they predict of regressors of their scales can be absorbed.
pub(super) fn check_parameters<T: Real>(parameters: &[T], bounds: &[T]) -> Result<(), Error> {
    check_finite("parameters", parameters)?;
    let fits = |(&parameter, &bound): (&T, &T)| {
        // The square of a hundredth of what is predicted: what was absorbed may have made more of it than can be
        // absorbed again.
        parameter / bound * parameter / T::from_count(100) <= T::LARGEST_ENTRY
    };
    let fit = parameters.iter().zip(bounds.iter().cycle()).all(fits);
    fit.then_some(()).ok_or(Error::TooLarge { argument: "parameters" })
}

/// The settings that an estimator with delay lines passes on to its least squares, of this type and with these
/// parameters. It has a `set_parameters` of its own, where what it asks of parameters is checked; `$allows` says
/// whether it can have this rule for outliers.
macro_rules! pass_on_settings {
    ($parameters:ty, $estimator:ty) => {
        pass_on_settings!($parameters, $estimator, |_, _| Ok(()));
    };
    ($parameters:ty, $estimator:ty, $allows:expr) => {
        /// The same with these parameters to start from: see [`set_parameters`](Self::set_parameters), whose errors it
        /// has.
        pub fn with_parameters(mut self, parameters: $parameters) -> Result<Self, crate::Error> {
            self.set_parameters(parameters)?;
            Ok(self)
        }

        /// The same with this P to start from: see [`set_covariance`](Self::set_covariance), whose errors it has.
        pub fn with_covariance(mut self, covariance: crate::Covariance<T, N>) -> Result<Self, crate::Error> {
            self.set_covariance(covariance)?;
            Ok(self)
        }

        /// The same with a rule for outliers: see [`set_outliers`](Self::set_outliers), whose errors it has.
        pub fn with_outliers(mut self, outliers: crate::Outliers<T>) -> Result<Self, crate::Error> {
            self.set_outliers(outliers)?;
            Ok(self)
        }

        /// Sets P: see [`RecursiveLeastSquares::set_covariance`](crate::RecursiveLeastSquares::set_covariance), whose
        /// errors it has.
        pub fn set_covariance(&mut self, covariance: crate::Covariance<T, N>) -> Result<(), crate::Error> {
            self.estimator.set_covariance(covariance)
        }

        /// Takes P for larger by a factor: see [`RecursiveLeastSquares::widen`](crate::RecursiveLeastSquares::widen),
        /// whose errors it has.
        pub fn widen(&mut self, factor: T) -> Result<(), crate::Error> {
            self.estimator.widen(factor)
        }

        /// Takes P for larger by a sum: see
        /// [`RecursiveLeastSquares::widen_by`](crate::RecursiveLeastSquares::widen_by), whose errors it has.
        pub fn widen_by(&mut self, covariance: &crate::Covariance<T, N>) -> Result<(), crate::Error> {
            self.estimator.widen_by(covariance)
        }

        /// Sets the rule for outliers: see
        /// [`RecursiveLeastSquares::set_outliers`](crate::RecursiveLeastSquares::set_outliers), whose errors it has.
        pub fn set_outliers(&mut self, outliers: crate::Outliers<T>) -> Result<(), crate::Error> {
            let allows: fn(&Self, crate::Outliers<T>) -> Result<(), crate::Error> = $allows;
            allows(self, outliers)?;
            self.estimator.set_outliers(outliers)
        }

        /// Turns adaptation off, or on again: see
        /// [`RecursiveLeastSquares::set_adaptation`](crate::RecursiveLeastSquares::set_adaptation). Samples are still
        /// taken in, so that predictions go on.
        pub fn set_adaptation(&mut self, on: bool) {
            self.estimator.set_adaptation(on);
        }

        /// The least squares estimator: parameters, covariance, noise variance, excitation. That of a nonlinear ARX
        /// model is on functions of scaled signals.
        pub fn estimator(&self) -> &$estimator {
            &self.estimator
        }
    };
}
pub(crate) use pass_on_settings;

/// What some of the estimators with delay lines pass on to their least squares too, each by its name.
macro_rules! pass_on {
    ($($what:ident),+) => {
        $(pass_on!(@ $what);)+
    };
    (@ start) => {
        /// The same with another start. See
        /// [`RecursiveLeastSquares::with_start`](crate::RecursiveLeastSquares::with_start).
        ///
        /// Errors: none that can occur.
        pub fn with_start(self, start: crate::RlsStart) -> Result<Self, crate::Error> {
            Ok(Self { estimator: self.estimator.with_start(start)?, ..self })
        }
    };
    (@ solution) => {
        /// The same started from a batch solution on the regressors. See
        /// [`RecursiveLeastSquares::with_solution`](crate::RecursiveLeastSquares::with_solution), whose errors it has.
        pub fn with_solution(self, solution: &crate::Solution<T, N>) -> Result<Self, crate::Error> {
            Ok(Self { estimator: self.estimator.with_solution(solution)?, ..self })
        }
    };
    (@ noise_variance) => {
        /// The same with a noise variance that is known from earlier samples. See
        /// [`RecursiveLeastSquares::with_noise_variance`](crate::RecursiveLeastSquares::with_noise_variance), whose
        /// errors it has.
        pub fn with_noise_variance(mut self, variance: T, samples: usize) -> Result<Self, crate::Error> {
            self.set_noise_variance(variance, samples)?;
            Ok(self)
        }

        /// Sets the noise variance: see
        /// [`RecursiveLeastSquares::set_noise_variance`](crate::RecursiveLeastSquares::set_noise_variance), whose
        /// errors it has.
        pub fn set_noise_variance(&mut self, variance: T, samples: usize) -> Result<(), crate::Error> {
            self.estimator.set_noise_variance(variance, samples)
        }
    };
    (@ dead_zone) => {
        /// The same with a dead zone, which is compared with the error that corrects. See
        /// [`RecursiveLeastSquares::with_dead_zone`](crate::RecursiveLeastSquares::with_dead_zone), whose errors it
        /// has.
        pub fn with_dead_zone(mut self, width: T) -> Result<Self, crate::Error> {
            self.set_dead_zone(width)?;
            Ok(self)
        }

        /// Sets the dead zone: see
        /// [`RecursiveLeastSquares::set_dead_zone`](crate::RecursiveLeastSquares::set_dead_zone), whose errors it has.
        pub fn set_dead_zone(&mut self, width: T) -> Result<(), crate::Error> {
            self.estimator.set_dead_zone(width)
        }
    };
}
pub(crate) use pass_on;
