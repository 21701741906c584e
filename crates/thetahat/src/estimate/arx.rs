use std::borrow::Cow;
use std::ops::Range;

use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{DMatrix, Dyn};
use thetahat_numerics::regression::{ExtendedGram, Lagged, Presample, Regression, Taps, Unsolved};

use crate::Error;
use crate::data::{Record, measured};
use crate::estimate::{Estimate, Initial, Procedure};
use crate::model::Orders;

impl Estimate {
    /// The estimate that a triangular factor holds, such as [`arx_factor`] gives or several of them merged.
    ///
    /// # Errors
    /// [`Error::Argument`] if the factor is not one of these orders; and as for [`arx`].
    pub fn from_factor(factor: &LeastSquares<f64, Dyn>, orders: &Orders) -> Result<Self, Error> {
        let columns = factor.rotated_output().len();
        if columns != orders.parameters() {
            return Err(Error::argument(
                "orders",
                format!("they have {} parameters, the factor has {columns}", orders.parameters()),
            ));
        }
        enough(factor.rows(), orders)?;
        let solved = Regression::from_factor(factor).map_err(|why| unsolved(why, orders))?;
        Self::of_regression(solved, factor.rows(), Initial::Drop)
    }

    pub(super) fn of_regression(solved: Regression, samples: usize, initial: Initial) -> Result<Self, Error> {
        let parameters = solved.parameters.len();
        let sum_of_squares = solved.residual_norm * solved.residual_norm;
        let noise_variance = sum_of_squares / (samples - parameters) as f64;
        // Beyond the range of numbers a variance would be infinite, or zero: then the model seems to be certain.
        let normal = noise_variance.is_normal() && solved.covariance.diagonal().iter().all(|v| v.is_normal());
        if solved.residual_norm != 0.0 && !normal {
            return Err(out_of_range());
        }
        Ok(Self {
            parameters: solved.parameters.iter().copied().collect(),
            covariance: Some(rows(&solved.covariance)),
            noise_variance,
            samples,
            mse: sum_of_squares / samples as f64,
            condition: Some(solved.condition),
            initial,
            procedure: Procedure::LeastSquares { solver: solved.solver },
        })
    }
}

/// Fits A(q) y(t) = sum_j B_j(q) u_j(t - nk_j) + e(t) by least squares.
///
/// The parameters are a1 … a_na, then b of each input. Offsets should be removed before: an offset of c standard
/// deviations makes the condition number 20 c. The error stays below 4 eps (kappa + kappa^2 |r|/|theta|) relative
/// to |theta| on columns of unit norm, kappa being the condition number: the bound of Householder QR.
///
/// Cost: O(N p) flops for N samples and p parameters; O(N p^2) where kappa is above 5e6. No copy of the data.
///
/// # Errors
/// [`Error::Argument`] if the record does not have the orders' inputs; [`Error::Undetermined`] if there are not more
/// samples than parameters, or columns depend on one another: the parameters concerned are named; [`Error::Data`] if
/// squares of the signals leave the range of `f64` (beyond about 1e150, or below 1e-150).
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::estimate::{Initial, arx};
/// use thetahat::model::Orders;
///
/// // y(t) = 0.5 y(t-1) + 2 u(t-1), without noise.
/// let u = [1.0, -1.0, 2.0, 0.0, 1.0, 3.0, -2.0, 1.0];
/// let mut y = vec![0.0];
/// for t in 1..u.len() {
///     y.push(0.5 * y[t - 1] + 2.0 * u[t - 1]);
/// }
/// let estimate = arx(&Record::new(&y, vec![&u])?, &Orders::arx(1, &[1], &[1])?, Initial::Drop)?;
/// assert!((estimate.parameters()[0] + 0.5).abs() < 1e-12); // a1
/// assert!((estimate.parameters()[1] - 2.0).abs() < 1e-12); // b1
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn arx(record: &Record<'_>, orders: &Orders, initial: Initial) -> Result<Estimate, Error> {
    linear(orders)?;
    let signals = signals(record, orders)?;
    let (initial, presample) = resolved(initial)?;
    let segments = with_past(record, orders, presample);
    let lagged = Lagged::new(&signals, taps(orders), &segments, presample);
    enough(lagged.rows(), orders)?;
    let solved = lagged.solve().map_err(|why| unsolved(why, orders))?;
    Estimate::of_regression(solved, lagged.rows(), initial)
}

/// The triangular factor of an ARX regression: factors of several logs or machines merge into one estimate.
///
/// The rows of Phi are folded block by block by Householder reflections. Cost: 2 N p^2 flops, O(p^2) memory.
///
/// # Errors
/// [`Error::Argument`] if the record does not have the orders' inputs; [`Error::Data`] if a sample is not finite.
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::estimate::{Estimate, Initial, arx_factor};
/// use thetahat::model::Orders;
///
/// let (u, y) = ([1.0, -1.0, 2.0, 0.0, 1.0, 3.0], [0.0, 2.0, -1.0, 3.5, 1.75, 2.9]);
/// let orders = Orders::arx(1, &[1], &[1])?;
/// let mut first = arx_factor(&Record::new(&y, vec![&u])?, &orders, Initial::Drop)?;
/// let second = arx_factor(&Record::new(&y, vec![&u])?, &orders, Initial::Drop)?;
/// first.merge(&second)?;
/// assert_eq!(Estimate::from_factor(&first, &orders)?.samples(), 10);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn arx_factor(
    record: &Record<'_>,
    orders: &Orders,
    initial: Initial,
) -> Result<LeastSquares<f64, Dyn>, Error> {
    linear(orders)?;
    let signals = signals(record, orders)?;
    let (_, presample) = resolved(initial)?;
    Lagged::new(&signals, taps(orders), &with_past(record, orders, presample), presample)
        .factor()
        .map_err(|error| Error::data(format!("the record cannot be factored: {error}")))
}

/// The sums of products of a regression in twice the precision, for normal equations that are solved without the
/// record.
pub(crate) fn lagged_products(record: &Record<'_>, orders: &Orders) -> Result<ExtendedGram, Error> {
    linear(orders)?;
    let signals = signals(record, orders)?;
    let segments = with_past(record, orders, Presample::Drop);
    let gram = ExtendedGram::of(&Lagged::new(&signals, taps(orders), &segments, Presample::Drop));
    if gram.is_in_range() { Ok(gram) } else { Err(out_of_range()) }
}

/// Least squares needs a predictor that is linear in the parameters.
pub(super) fn linear(orders: &Orders) -> Result<(), Error> {
    if orders.is_linear() {
        return Ok(());
    }
    Err(Error::argument(
        "orders",
        "a model with C, D or F is not linear in its parameters; it needs a search",
    ))
}

/// What an initial condition means for a model without F.
pub(super) fn resolved(initial: Initial) -> Result<(Initial, Presample), Error> {
    match initial {
        Initial::Zero => Ok((Initial::Zero, Presample::Zero)),
        Initial::Auto | Initial::Drop => Ok((Initial::Drop, Presample::Drop)),
        Initial::Estimate => Err(estimate_is_for_f()),
    }
}

pub(crate) fn estimate_is_for_f() -> Error {
    Error::argument(
        "initial",
        "estimate is for models with F: without it, unknown samples reach no further than a few errors, which drop leaves \
         out; use drop, zero or auto",
    )
}

/// The segments with as many of the measured samples before them as a regressor reaches back to: their first row with a
/// full regressor is then the segment's own first, if so many are there.
///
/// Without A a row needs no past output, and a segment ends where an output is missing only to go on after it.
pub(super) fn with_past<'r>(
    record: &'r Record<'_>,
    orders: &Orders,
    presample: Presample,
) -> Cow<'r, [Range<usize>]> {
    let known = presample == Presample::Drop && record.past.iter().any(|past| *past > 0);
    let pieces = |segment: &Range<usize>| {
        if orders.na > 0 { vec![segment.clone()] } else { measured(record.output, segment) }
    };
    if orders.na > 0 && !known {
        return Cow::Borrowed(&record.segments);
    }
    let lag = if presample == Presample::Drop { orders.maximum_lag() } else { 0 };
    let each = record.segments.iter().zip(&record.past).flat_map(|(segment, past)| {
        let first = segment.start - past;
        pieces(segment).into_iter().map(move |piece| piece.start - lag.min(piece.start - first)..piece.end)
    });
    Cow::Owned(each.collect())
}

/// A matrix, row by row.
pub(super) fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

/// The output and the inputs, checked against the orders.
pub(super) fn signals<'a>(record: &Record<'a>, orders: &Orders) -> Result<Vec<&'a [f64]>, Error> {
    if record.inputs.len() != orders.inputs() {
        return Err(Error::argument(
            "orders",
            format!("they are for {} inputs, the record has {}", orders.inputs(), record.inputs.len()),
        ));
    }
    Ok(std::iter::once(record.output).chain(record.inputs.iter().copied()).collect())
}

/// phi(t) = [-y(t-1) … -y(t-na), u1(t-nk1) … u1(t-nk1-nb1+1), …].
pub(crate) fn taps(orders: &Orders) -> Vec<Taps> {
    let output = Taps { signal: 0, first: 1, count: orders.na, sign: -1.0 };
    let inputs = orders.nb.iter().zip(&orders.nk).enumerate();
    std::iter::once(output)
        .chain(inputs.map(|(j, (&count, &first))| Taps { signal: j + 1, first, count, sign: 1.0 }))
        .collect()
}

/// There must be more samples with a full regressor than parameters.
pub(crate) fn enough(samples: usize, orders: &Orders) -> Result<(), Error> {
    let parameters = orders.parameters();
    if samples > parameters {
        return Ok(());
    }
    Err(Error::undetermined(
        orders.names(),
        format!(
            "too few rows for the orders: {parameters} parameters need more samples than that, and {samples} have a full \
             regressor (reaching back {}); give more rows or lower the orders",
            orders.maximum_lag()
        ),
    ))
}

pub(super) fn unsolved(why: Unsolved, orders: &Orders) -> Error {
    let Unsolved::Deficient(columns) = why else { return out_of_range() };
    let names = orders.names();
    let concerned: Vec<String> = columns.iter().filter_map(|&column| names.get(column).cloned()).collect();
    let message = format!(
        "the data cannot tell {} from the other parameters: their regressors are zero or combinations of the others; \
         excite the input more, or lower the orders",
        concerned.join(", ")
    );
    Error::undetermined(concerned, message)
}

pub(crate) fn out_of_range() -> Error {
    Error::data("squares of the signals leave the range of numbers; scale the channels towards one")
}
