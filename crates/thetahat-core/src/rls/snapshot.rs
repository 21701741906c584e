//! What is written, and how it is checked when it is read back.

use nalgebra::{OMatrix, OVector};

use super::after::After;
use super::residuals::Residuals;
use super::settings::{check_parameters, is_prior};
use crate::error::{check_finite, check_length};
use crate::forgetting::{Forgetting, Phase};
use crate::outliers::Watch;
use crate::snapshot::{matrix, snapshot, vector};
use crate::{Covariance, Dimension, Error, Outliers, Real, RecursiveLeastSquares};

snapshot! {
    Snapshot<T, N, M> of RecursiveLeastSquares<T, N, M>
    where [T: Real, N: Dimension + Dimension<M>, M: Dimension] {
        #[serde(with = "matrix")]
        parameters: OMatrix<T, N, M>;
        covariance: Covariance<T, N>;
        #[serde(with = "vector")]
        bounds: OVector<T, N>;
        residuals: Residuals<T, M>;
        forgetting: Forgetting<T>;
        dead_zone: T;
        outliers: Outliers<T> => outliers, Watch::rule;
        outliers_in_a_row: u16 => outliers, |watch: &Watch<T>| watch.in_a_row;
        #[serde(with = "vector")]
        held: OVector<bool, N>;
        #[serde(with = "matrix")]
        noises: OMatrix<T, N, M>;
        turn: u16;
        phase: Phase;
        shares: u16;
        shares_left: u16;
        adapting: bool;
    }
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension> TryFrom<Snapshot<T, N, M>>
    for RecursiveLeastSquares<T, N, M>
{
    type Error = Error;

    fn try_from(read: Snapshot<T, N, M>) -> Result<Self, Error> {
        let Snapshot { parameters, covariance, bounds, residuals, .. } = read;
        let (size, outputs) = parameters.shape_generic();
        check_length("bounds", size.value(), bounds.len())?;
        check_length("mean_squares", outputs.value(), residuals.mean_squares.len())?;
        let n = size.value();
        check_length("covariance", n, covariance.size().value())?;
        read.forgetting.check(n)?;
        let mut outliers = Watch::new(read.outliers)?;
        outliers.in_a_row = read.outliers_in_a_row;
        let in_range =
            |argument, fits: bool, range| fits.then_some(()).ok_or(Error::OutOfRange { argument, range });
        let of_scales = |&bound: &T| is_prior(bound) && is_prior(T::from_count(10_000) / bound);
        in_range("bounds", bounds.iter().all(of_scales), "those of scales that a new estimator takes")?;
        check_parameters(parameters.as_slice(), bounds.as_slice())?;
        // An exact start without forgetting has variances 10⁴ times as wide, and each column of U adds up to the bound.
        let most = T::from_count(40_000);
        let known = covariance.variances().iter().all(|&variance| is_prior(variance / most));
        known.then_some(()).ok_or(Error::TooLarge { argument: "covariance" })?;
        in_range(
            "dead_zone",
            read.dead_zone >= T::zero() && read.dead_zone.is_finite(),
            "finite, 0 or more",
        )?;
        check_finite("mean_squares", residuals.mean_squares.as_slice())?;
        let squares = residuals.mean_squares.iter().all(|&square| square >= T::zero());
        in_range("mean_squares", squares, "0 or more")?;
        let Residuals { weights, squared_weights, .. } = residuals;
        // Every weight is at most 1; twice that, for the rounding.
        let weighed = (weights * weights * T::from_count(n)).is_finite()
            && squared_weights >= T::zero()
            && squared_weights <= weights + weights;
        in_range("weights", weighed, "what samples make, and no less than their squares")?;
        in_range("turn", usize::from(read.turn) < n.max(1), "below the number of parameters")?;
        let shared = read.phase.is_running() || 0 < read.shares_left && read.shares_left <= read.shares;
        in_range("shares_left", shared, "such that a share of the prior is left")?;
        let Snapshot {
            forgetting, dead_zone, held, noises, turn, phase, shares, shares_left, adapting, ..
        } = read;
        let held_columns = held.iter().fold(0, |count: u16, &held| count.saturating_add(held.into()));
        let scratch = size.scratch::<T, 2, 0>();
        Ok(RecursiveLeastSquares {
            parameters,
            covariance,
            bounds,
            residuals,
            forgetting,
            dead_zone,
            outliers,
            held,
            held_columns,
            noises,
            turn,
            phase,
            shares,
            shares_left,
            adapting,
            after: After::any(),
            scratch,
        })
    }
}
