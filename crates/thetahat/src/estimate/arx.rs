use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::Dyn;

use crate::data::Record;
use crate::regression::{Initial, Lagged, Regression, Solver, Taps, Unsolved};
use crate::{Criteria, Error, Orders};

/// Estimated parameters and what is known about them.
///
/// With the regression y = Phi theta + e over N samples and p parameters:
/// theta-hat minimises |y - Phi theta|^2, sigma^2 = |y - Phi theta-hat|^2 / (N - p), cov = sigma^2 (Phi' Phi)^-1
/// (Ljung, System Identification, 2nd ed. 1999, sections 7.3 and 9.3).
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    parameters: Vec<f64>,
    covariance: Vec<Vec<f64>>,
    noise_variance: f64,
    samples: usize,
    mse: f64,
    condition: f64,
    solver: Solver,
}

impl Estimate {
    /// theta-hat, in the order of [`Orders::names`].
    pub fn parameters(&self) -> &[f64] {
        &self.parameters
    }

    /// The covariance matrix of theta-hat, row by row.
    pub fn covariance(&self) -> &[Vec<f64>] {
        &self.covariance
    }

    /// sigma^2, in the units of y squared.
    pub fn noise_variance(&self) -> f64 {
        self.noise_variance
    }

    /// N, the samples that count.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// The mean of e^2 over these samples.
    pub fn mse(&self) -> f64 {
        self.mse
    }

    /// The condition number of Phi, its columns scaled to unit norm.
    pub fn condition(&self) -> f64 {
        self.condition
    }

    /// How the regression was solved.
    pub fn solver(&self) -> Solver {
        self.solver
    }

    /// FPE, AIC, AICc and MDL.
    pub fn criteria(&self) -> Criteria {
        Criteria::new(self.mse, self.parameters.len(), self.samples)
    }

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
        Self::new(solved, factor.rows())
    }

    fn new(solved: Regression, samples: usize) -> Result<Self, Error> {
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
            covariance: solved.covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
            noise_variance,
            samples,
            mse: sum_of_squares / samples as f64,
            condition: solved.condition,
            solver: solved.solver,
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
/// use thetahat::{Initial, Orders, Record, arx};
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
    let signals = signals(record, orders)?;
    let lagged = Lagged::new(&signals, taps(orders), &record.segments, initial);
    enough(lagged.rows(), orders)?;
    let solved = lagged.solve().map_err(|why| unsolved(why, orders))?;
    Estimate::new(solved, lagged.rows())
}

/// The triangular factor of an ARX regression: factors of several logs or machines merge into one estimate.
///
/// The rows of Phi are folded block by block by Householder reflections. Cost: 2 N p^2 flops, O(p^2) memory.
///
/// # Errors
/// [`Error::Argument`] if the record does not have the orders' inputs; [`Error::Data`] if a sample is not finite.
///
/// ```
/// use thetahat::{Estimate, Initial, Orders, Record, arx_factor};
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
    let signals = signals(record, orders)?;
    Lagged::new(&signals, taps(orders), &record.segments, initial)
        .factor()
        .map_err(|error| Error::data(format!("the record cannot be factored: {error}")))
}

/// The output and the inputs, checked against the orders.
fn signals<'a>(record: &Record<'a>, orders: &Orders) -> Result<Vec<&'a [f64]>, Error> {
    if record.inputs.len() != orders.inputs() {
        return Err(Error::argument(
            "orders",
            format!("they are for {} inputs, the record has {}", orders.inputs(), record.inputs.len()),
        ));
    }
    Ok(std::iter::once(record.output).chain(record.inputs.iter().copied()).collect())
}

/// phi(t) = [-y(t-1) … -y(t-na), u1(t-nk1) … u1(t-nk1-nb1+1), …].
fn taps(orders: &Orders) -> Vec<Taps> {
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
            orders.reach()
        ),
    ))
}

fn unsolved(why: Unsolved, orders: &Orders) -> Error {
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

fn out_of_range() -> Error {
    Error::data("squares of the signals leave the range of numbers; scale the channels towards one")
}
