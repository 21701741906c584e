//! What becomes of the noise of a model at another sample time.

use thetahat_core::nalgebra::DMatrix;

use super::StateSpace;
use super::eigen::{is_stable, rounding};
use super::riccati::stationary;
use crate::Error;

/// Parts of a sample below this are none.
pub(super) const WHOLE: f64 = 1e-9;

/// Sums of what happens from step to step: what is left of a state after all of them, what a held input has done, the
/// covariance that noise gave the state.
#[derive(Debug, Clone)]
pub(in crate::model) struct Steps {
    pub(in crate::model) f: DMatrix<f64>,
    pub(in crate::model) g: DMatrix<f64>,
    pub(in crate::model) covariance: DMatrix<f64>,
}

impl Steps {
    /// One step of a model.
    pub(in crate::model) fn one(model: &StateSpace) -> Self {
        let covariance = &model.k * &model.noise_covariance * model.k.transpose();
        Self { f: model.f.clone(), g: model.g.clone(), covariance }
    }

    /// These steps, then others.
    pub(in crate::model) fn then(&self, after: &Self) -> Self {
        Self {
            f: &after.f * &self.f,
            g: &after.f * &self.g + &after.g,
            covariance: &after.f * &self.covariance * after.f.transpose() + &after.covariance,
        }
    }

    /// So many of one step, by squaring: O(n^3 log count). None of them leaves a state as it is.
    pub(in crate::model) fn repeated(one: &Self, mut count: u64) -> Self {
        let (n, m) = one.g.shape();
        let mut all =
            Self { f: DMatrix::identity(n, n), g: DMatrix::zeros(n, m), covariance: DMatrix::zeros(n, n) };
        let mut power = one.clone();
        while count > 0 {
            if count % 2 == 1 {
                all = all.then(&power);
            }
            count /= 2;
            if count > 0 {
                power = power.then(&power);
            }
        }
        all
    }
}

impl StateSpace {
    /// The model with innovations of which F - K H is stable, for a state that noise of the covariance W, `moved`,
    /// moves from sample to sample and outputs that see a noise of the covariance R: the model holds R as
    /// `noise_covariance` and S R^-1 as `k`, S being the covariance of the two.
    ///
    /// K and the covariance of the innovations are those of the stationary Kalman filter (Anderson and Moore, Optimal
    /// Filtering, 1979, section 9.3), so that the spectrum of the noise is the same. O(n^3).
    ///
    /// # Errors
    /// [`Error::Undetermined`] where no gain gives a stable predictor, or numbers leave their range.
    pub(in crate::model) fn innovations_form(self, moved: &DMatrix<f64>) -> Result<Self, Error> {
        let model = self;
        if model.f.is_empty() {
            return Ok(model);
        }
        let seen = &model.k * &model.noise_covariance * model.k.transpose();
        let rest = moved - &seen;
        let rest = (&rest + rest.transpose()) * 0.5;
        if ![&model.f, &model.g, &model.k, &rest]
            .iter()
            .all(|matrix| matrix.iter().all(|value| value.is_finite()))
        {
            return Err(Error::undetermined(
                Vec::new(),
                "over a sample the model grows beyond the range of numbers; take a shorter sample time",
            ));
        }
        if rest.norm() <= 1e3 * rounding(rest.nrows()) * seen.norm() {
            return model.with_stable_predictor();
        }
        let found = stationary(&model, &rest)
            .filter(|found| {
                found.k.iter().chain(found.noise_covariance.iter()).all(|value| value.is_finite())
            })
            .filter(|found| is_stable(&(&found.f - &found.k * &found.h)));
        let mut found = found.ok_or_else(|| {
        Error::undetermined(
            Vec::new(),
            "at this sample time no gain gives a stable predictor: the noise moves a state that does not decay, or outputs have none; \
             take another sample time",
        )
    })?;
        // A covariance is symmetric to the bit.
        found.noise_covariance = (&found.noise_covariance + found.noise_covariance.transpose()) * 0.5;
        Ok(found)
    }
}
