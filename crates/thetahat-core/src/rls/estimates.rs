//! What recursive least squares knows: parameters, their covariance and the variance of the noise.

use nalgebra::{Const, OMatrix, OVector};

use super::RecursiveLeastSquares;
use crate::error::check_length;
use crate::triangle::{column, diagonal_mut};
use crate::{Action, Covariance, Dimension, Error, Real, ud};

impl<T: Real, N: Dimension + Dimension<Const<1>>> RecursiveLeastSquares<T, N> {
    /// σ̂²: the variance of the noise, in the unit of y²; `None` until enough samples are in. See
    /// [How sure](RecursiveLeastSquares#how-sure).
    pub fn noise_variance(&self) -> Option<T> {
        self.residuals.variance(0, self.bounds.len())
    }

    /// The covariance of the parameters, n x n; `None` until the noise variance is known. See
    /// [How sure](RecursiveLeastSquares#how-sure).
    ///
    /// It is right for parameters that have not changed within the memory, and for noise that is white. `None` too
    /// where a variance does not fit `T`.
    pub fn parameter_covariance(&self) -> Option<Covariance<T, N>> {
        self.parameter_covariance_of(0)
    }

    /// The standard errors of the parameters, the square roots of the diagonal of
    /// [`parameter_covariance`](RecursiveLeastSquares::parameter_covariance), and `None` where that is.
    pub fn standard_errors(&self) -> Option<OVector<T, N>> {
        self.standard_errors_of(0)
    }

    /// Writes the [standard errors](RecursiveLeastSquares::standard_errors) into `target`, NaN where they are not
    /// known: with `Dyn` it does not allocate.
    ///
    /// Errors: [`Error::Length`] if it does not have n elements.
    pub fn write_standard_errors(&self, target: &mut [T]) -> Result<(), Error> {
        check_length("target", self.bounds.len(), target.len())?;
        if !self.fill_standard_errors(0, target) {
            target.fill(T::NAN);
        }
        Ok(())
    }
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension> RecursiveLeastSquares<T, N, M> {
    /// The parameters θ̂, n x m.
    pub fn parameters(&self) -> &OMatrix<T, N, M> {
        &self.parameters
    }

    /// The part of the innovation of an outlier that was not used; `None` of other samples, and of outliers right after
    /// others.
    #[inline(always)]
    pub(crate) fn unused(&self, nis: T, action: Action) -> Option<T> {
        self.outliers.unused(nis, action)
    }

    /// Takes back what is known of the noise, where the errors that corrected are not those of white noise.
    pub(crate) fn forget_noise(&mut self) {
        self.residuals.clear();
    }

    /// P: the covariance of the parameters in units of the noise variance, without regard to how forgetting weighs
    /// the noise. See [`parameter_covariance`](RecursiveLeastSquares::parameter_covariance).
    pub fn covariance(&self) -> &Covariance<T, N> {
        &self.covariance
    }

    /// How much the samples in the memory tell of the parameter they tell least of, in 0 … 1:
    ///
    /// ```text
    /// min over j of 1 - P_jj/p_j,         p_j = 100/scale_j²
    /// ```
    ///
    /// 0: of some parameter they tell nothing, as at the start, or after a silence longer than the memory. 0.5:
    /// as much as the prior, which is a hundredth of a sample of typical size. One sample of typical size is worth
    /// 0.99, and a memory full of them 0.9999. Below 0.5 or so, do not rely on the parameters.
    ///
    /// n²/2 multiply-adds, n divisions.
    pub fn excitation(&self) -> T {
        let n = self.bounds.len();
        let bounds = self.bounds.as_slice().iter().enumerate();
        bounds.fold(T::one(), |least, (index, &bound)| {
            let known = T::one() - ud::diagonal(self.covariance.as_slice(), n, index) / bound;
            least.min(known.max(T::zero()))
        })
    }

    /// σ̂² of every output, in the unit of y²; `None` until enough samples are in.
    pub fn noise_variances(&self) -> Option<OVector<T, M>> {
        let mut variances = self.residuals.mean_squares.clone();
        for (index, variance) in variances.as_mut_slice().iter_mut().enumerate() {
            *variance = self.residuals.variance(index, self.bounds.len())?;
        }
        Some(variances)
    }

    /// The covariance of the parameters of one output, from 0, n x n; `None` until the noise variance is known, if
    /// a variance does not fit `T`, or if there is no such output.
    pub fn parameter_covariance_of(&self, output: usize) -> Option<Covariance<T, N>> {
        let n = self.bounds.len();
        let mut covariance = self.covariance.clone();
        for index in 0..n {
            let scale = self.variance_scale(output, index)?;
            if let Some(variance) = diagonal_mut(covariance.as_mut_slice(), n, index) {
                *variance *= scale;
            }
        }
        let finite = (0..n).all(|index| ud::diagonal(covariance.as_slice(), n, index).is_finite());
        finite.then_some(covariance)
    }

    /// The standard errors of the parameters of one output, from 0: the square roots of the diagonal of
    /// [`parameter_covariance_of`](RecursiveLeastSquares::parameter_covariance_of), and `None` where that is. n²
    /// multiply-adds, n square roots.
    pub fn standard_errors_of(&self, output: usize) -> Option<OVector<T, N>> {
        let mut errors = self.bounds.shape_generic().0.vector(T::zero());
        self.fill_standard_errors(output, errors.as_mut_slice()).then_some(errors)
    }

    /// Writes the standard errors of one output; says whether they are known.
    fn fill_standard_errors(&self, output: usize, errors: &mut [T]) -> bool {
        errors.fill(T::zero());
        for index in 0..errors.len() {
            let Some(scale) = self.variance_scale(output, index) else { return false };
            ud::add_squares(self.covariance.as_slice(), scale, index, errors);
        }
        let known = errors.iter().all(T::is_finite);
        errors.iter_mut().for_each(|error| *error = error.sqrt());
        known
    }

    /// What makes P the covariance of the parameters of one output, in the direction of one column of U. Where nothing
    /// is forgotten the noise is at least that at which it was held: what fell silent since says nothing of it.
    fn variance_scale(&self, output: usize, index: usize) -> Option<T> {
        let (n, residuals) = (self.bounds.len(), &self.residuals);
        let noise = *residuals.mean_squares.as_slice().get(output)?;
        let kept = *column(self.noises.as_slice(), n, output).get(index)?;
        let held = self.held.as_slice().get(index).is_some_and(|held| *held);
        let share = match self.forgetting.walk() {
            None if !held => residuals.squared_weights / residuals.weights,
            _ => T::one(),
        };
        Some(residuals.variance_of(noise.max(kept), n)? * share)
    }
}
