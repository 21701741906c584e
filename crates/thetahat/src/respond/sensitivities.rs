//! What the uncertainty of the parameters and of the initial states does to predictions.
//!
//! A prediction y^(theta) from estimated parameters misses by what the noise does after the samples that it looks from,
//! and by what the parameters are off; to first order, the two being independent on samples that are not those of the
//! fit,
//!
//! ```text
//! var(y - y^) = sigma^2 sum_{i<k} h_i^2 + g' P g,   g = dy^/dtheta
//! ```
//!
//! (Ljung, System Identification, 2nd ed. 1999, section 9.4; Box and Jenkins, Time Series Analysis, 1976, appendix
//! A7.3). With P = sum_i l_i l_i', g'P g is the sum of (g'l_i)^2: one derivative along each l_i, exact, by the
//! equations of the model differentiated. Along a change (dA, dB, dC, dD, dF)
//!
//! ```text
//! F dx = dB u - dF x + ddelta,   dw = dA y - dx,   C de = D dw + dD w - dC e
//! ```
//!
//! where ddelta are the initial conditions that fit best at the changed parameters, if they are estimated, and k steps
//! ahead
//!
//! ```text
//! dy^(t | t-k) = - sum_{i<k} (h_i de(t-i) + dh_i e(t-i)),   A D dh = dC - (dA D + A dD) h
//! ```
//!
//! Initial states add directions of their own. Before the first e that is known, C has others of variance sigma^2.
//! Estimated impulses into 1/F have the covariance sigma^2 (Phi'Phi)^-1 of a regression; that counts in forecasts. On
//! the samples they were estimated from errors are smaller for it, not larger, and nothing is added.
//!
//! The output's offset is an estimate as well. Its uncertainty is a constant k and a trend m on the right side of
//! the equation, two more inputs whose coefficients are zero and uncertain: their directions are among the l_i (see
//! [`OffsetCovariance`](crate::model::OffsetCovariance)).
//!
//! With sigma^2 estimated with nu degrees of freedom, the error over its scale is Student's t, whose standard deviation
//! is sqrt(nu/(nu - 2)) of the scale.

use thetahat_core::nalgebra::{DMatrix, SymmetricEigen};
use thetahat_numerics::regression::{add_filtered, divide, divide_from, product};

use super::innovations::{Basis, Impulses, Innovations, best, free_columns, innovations};
use super::predict::{accumulated, disturbance_response, longest};
use super::{InitialCondition, check_inputs};
use crate::Error;
use crate::data::Record;
use crate::model::PolynomialModel;

/// A combination of initial conditions whose part of the Gram matrix is below this fraction of the largest is
/// not determined.
const UNDETERMINED: f64 = 1e-20;

/// A change of the polynomials, in powers of q^-1 as these are; what is fixed in them does not change.
#[derive(Debug)]
struct Change {
    a: Vec<f64>,
    b: Vec<Vec<f64>>,
    c: Vec<f64>,
    d: Vec<f64>,
    /// -dF.
    negative_f: Vec<Vec<f64>>,
}

impl Change {
    fn none(model: &PolynomialModel) -> Self {
        let zeros = |p: &Vec<f64>| vec![0.0; p.len()];
        Self {
            a: zeros(&model.a),
            b: model.b.iter().map(zeros).collect(),
            c: zeros(&model.c),
            d: zeros(&model.d),
            negative_f: model.f.iter().map(zeros).collect(),
        }
    }

    /// Of the parameters, in their order.
    fn of(model: &PolynomialModel, mut parameters: impl Iterator<Item = f64>) -> Self {
        let mut change = Self::none(model);
        let mut fill = |values: &mut [f64]| values.iter_mut().zip(&mut parameters).for_each(|(v, p)| *v = p);
        fill(&mut change.a[1..]);
        for (b, &nk) in change.b.iter_mut().zip(&model.orders.nk) {
            fill(&mut b[nk..]);
        }
        fill(&mut change.c[1..]);
        fill(&mut change.d[1..]);
        for f in &mut change.negative_f {
            fill(&mut f[1..]);
            f.iter_mut().for_each(|f| *f = -*f);
        }
        change
    }
}

/// l_1, l_2, … of the parameters; none where their covariance is not known.
fn changes(model: &PolynomialModel) -> Vec<Change> {
    let Some(rows) = &model.covariance else { return Vec::new() };
    let scales: Vec<f64> = (0..rows.len()).map(|i| rows[i][i].sqrt()).collect();
    let entry = |i: usize, j: usize| {
        if scales[i] * scales[j] > 0.0 { rows[i][j] / scales[i] / scales[j] } else { 0.0 }
    };
    let correlation = DMatrix::from_fn(rows.len(), rows.len(), entry);
    let of = |(size, vector): (f64, Vec<f64>)| {
        Change::of(model, vector.iter().zip(&scales).map(|(value, scale)| size * value * scale))
    };
    roots(correlation).into_iter().map(of).collect()
}

/// The square roots of the eigenvalues of a symmetric matrix that are above zero, with their eigenvectors.
fn roots(matrix: DMatrix<f64>) -> Vec<(f64, Vec<f64>)> {
    if matrix.is_empty() || !matrix.iter().all(|value| value.is_finite()) {
        return Vec::new();
    }
    let most = 100 * (matrix.nrows() + 1);
    let Some(found) = SymmetricEigen::try_new(matrix, f64::EPSILON, most) else { return Vec::new() };
    let each = found.eigenvalues.iter().zip(found.eigenvectors.column_iter());
    each.filter(|(value, _)| **value > 0.0)
        .map(|(value, vector)| (value.sqrt(), vector.iter().copied().collect()))
        .collect()
}

/// The signals of a segment, of which the first `known` samples are measured and others may follow.
#[derive(Debug)]
pub(super) struct Paths {
    pub(super) known: usize,
    pub(super) presample: usize,
    basis: Basis,
    pub(super) inputs: Vec<Vec<f64>>,
    pub(super) output: Vec<f64>,
    pub(super) disturbance: Vec<f64>,
    pub(super) errors: Vec<f64>,
    /// x_j, where there is an F.
    responses: Vec<Vec<f64>>,
}

/// What a change does to the signals.
#[derive(Debug)]
struct Moved {
    /// x, as long as the inputs.
    x: Vec<f64>,
    /// w and e, as far as they are known.
    disturbance: Vec<f64>,
    errors: Vec<f64>,
}

impl Paths {
    /// `inputs`, `output`, `disturbance` and `errors` go as far as they are used.
    pub(super) fn new(
        model: &PolynomialModel,
        found: &Innovations,
        inputs: Vec<Vec<f64>>,
        output: Vec<f64>,
        disturbance: Vec<f64>,
        errors: Vec<f64>,
    ) -> Self {
        let response = |input: usize| {
            let (u, f) = (&inputs[input], &model.f[input]);
            let length = if f.len() > 1 { u.len() } else { 0 };
            let mut own = vec![0.0; length];
            add_filtered(&mut own, &(0..length), &model.b[input], u, 0);
            let impulses = &found.impulses;
            let begin = own.iter_mut().skip(impulses.first);
            begin.zip(&impulses.weights[input]).for_each(|(x, impulse)| *x += impulse);
            divide(f, &mut own);
            own
        };
        let responses = (0..inputs.len()).map(response).collect();
        // Where the output is missing, A is 1.
        let output = output.into_iter().map(|y| if y.is_nan() { 0.0 } else { y }).collect();
        let (known, presample, basis) = (found.rows.len(), found.presample, found.basis.clone());
        Self { known, presample, basis, inputs, output, disturbance, errors, responses }
    }

    /// The derivative along a change, of impulses into 1/F, and of the errors before the first that is known: of the
    /// one `earlier` samples before it.
    fn moved(&self, model: &PolynomialModel, change: &Change, impulses: &Impulses, earlier: usize) -> Moved {
        let mut x = vec![0.0; self.output.len()];
        let all = 0..x.len();
        for (j, (u, own)) in self.inputs.iter().zip(&self.responses).enumerate() {
            let mut response = vec![0.0; x.len()];
            add_filtered(&mut response, &all, &change.b[j], u, 0);
            if model.f[j].len() > 1 {
                add_filtered(&mut response, &all, &change.negative_f[j], own, 0);
                let begin = response.iter_mut().skip(impulses.first);
                begin.zip(&impulses.weights[j]).for_each(|(x, impulse)| *x += impulse);
                divide(&model.f[j], &mut response);
            }
            x.iter_mut().zip(&response).for_each(|(sum, value)| *sum += value);
        }
        let known = 0..self.known;
        let mut disturbance: Vec<f64> = x[known.clone()].iter().map(|x| -x).collect();
        add_filtered(&mut disturbance, &known, &change.a, &self.output, 0);
        let mut errors = vec![0.0; self.known];
        add_filtered(&mut errors, &known, &model.d, &disturbance, 0);
        add_filtered(&mut errors, &known, &change.d, &self.disturbance, 0);
        let presample = self.presample.min(self.known);
        errors[..presample].fill(0.0);
        let mut noise = vec![0.0; self.known - presample];
        add_filtered(&mut noise, &(presample..self.known), &change.c, &self.errors, 0);
        if earlier > 0 {
            noise.iter_mut().zip(&model.c[earlier..]).for_each(|(sum, c)| *sum += c);
        }
        errors[presample..].iter_mut().zip(&noise).for_each(|(error, noise)| *error -= noise);
        divide(&model.c, &mut errors[presample..]);
        if let Some(before) = presample.checked_sub(earlier).filter(|before| *before < presample) {
            errors[before] = 1.0;
        }
        Moved { x, disturbance, errors }
    }

    /// The same along a change of the parameters, initial conditions moving with them where they are estimated.
    fn moved_by_parameters(
        &self,
        model: &PolynomialModel,
        change: &Change,
        estimated: bool,
    ) -> Result<Moved, Error> {
        let none = Impulses::none(model);
        let moved = self.moved(model, change, &none, 0);
        if !estimated {
            return Ok(moved);
        }
        let impulses = best(model, &moved.errors, &self.basis)?;
        Ok(self.moved(model, change, &impulses, 0))
    }

    /// What a change does to the samples after the known ones.
    fn continued(&self, model: &PolynomialModel, change: &Change, moved: &Moved) -> Vec<f64> {
        let future = self.known..self.output.len();
        let mut disturbance = vec![0.0; future.len()];
        let mut errors = moved.errors.clone();
        errors.resize(future.end, 0.0);
        let negative = |values: &[f64]| -> Vec<f64> { values.iter().map(|value| -value).collect() };
        add_filtered(&mut disturbance, &future, &model.c, &errors, 0);
        add_filtered(&mut disturbance, &future, &change.c, &self.errors, 0);
        add_filtered(&mut disturbance, &future, &negative(&change.d), &self.disturbance, 0);
        divide_from(&model.d[1..], &moved.disturbance, &mut disturbance);
        add_filtered(&mut disturbance, &future, &negative(&change.a), &self.output, 0);
        disturbance.iter_mut().zip(&moved.x[future]).for_each(|(sum, x)| *sum += x);
        divide_from(&model.a[1..], &[], &mut disturbance);
        disturbance
    }

    /// The variances of a forecast's values that come from parameters and initial states; none where the start has no
    /// estimated ones.
    pub(super) fn of_forecast(
        &self,
        model: &PolynomialModel,
        start: InitialCondition,
    ) -> Result<Vec<f64>, Error> {
        let estimated = start == InitialCondition::Estimate;
        let mut variances = vec![0.0; self.output.len() - self.known];
        let mut add = |change: &Change, moved: &Moved, scale: f64| {
            let values = self.continued(model, change, moved);
            variances.iter_mut().zip(&values).for_each(|(sum, value)| *sum += scale * value * value);
        };
        for change in changes(model) {
            add(&change, &self.moved_by_parameters(model, &change, estimated)?, 1.0);
        }
        let (fixed, none) = (Change::none(model), Impulses::none(model));
        for earlier in self.earlier_errors(model, start) {
            add(&fixed, &self.moved(model, &fixed, &none, earlier), model.noise_variance);
        }
        if estimated {
            for impulses in self.uncertain_impulses(model) {
                add(&fixed, &self.moved(model, &fixed, &impulses, 0), model.noise_variance);
            }
        }
        Ok(variances)
    }

    /// How many samples before the first known error there are others that C looks back to.
    fn earlier_errors(
        &self,
        model: &PolynomialModel,
        start: InitialCondition,
    ) -> std::ops::RangeInclusive<usize> {
        1..=if start == InitialCondition::Zero { 0 } else { model.orders.nc }
    }

    /// Impulses whose outer products sum to (Phi'Phi)^-1.
    fn uncertain_impulses(&self, model: &PolynomialModel) -> Vec<Impulses> {
        let (_, columns) = free_columns(model, self.known, &self.basis);
        let scales: Vec<f64> =
            columns.iter().map(|column| product(&column.values, &column.values).sqrt()).collect();
        let entry = |i: usize, j: usize| {
            let scale = scales[i] * scales[j];
            let seen = scales[i] > columns[i].rounding && scales[j] > columns[j].rounding;
            if seen { product(&columns[i].values, &columns[j].values) / scale } else { 0.0 }
        };
        let gram = DMatrix::from_fn(columns.len(), columns.len(), entry);
        let found = roots(gram);
        let largest = found.iter().fold(0.0_f64, |largest, (size, _)| largest.max(*size));
        let Basis { first, counts, .. } = &self.basis;
        found
            .iter()
            .filter(|(size, _)| size * size > UNDETERMINED * largest * largest)
            .map(|(size, vector)| {
                let each = vector.iter().zip(&scales);
                let mut each = each.map(|(v, scale)| if *v == 0.0 { 0.0 } else { v / size / scale });
                let weights = counts.iter().map(|&count| each.by_ref().take(count).collect()).collect();
                Impulses { first: *first, weights }
            })
            .collect()
    }
}

/// The standard deviation of an error whose variance is a sum of squares, as many degrees of freedom being behind the
/// noise variance.
pub(super) fn student(model: &PolynomialModel, noise: f64, other: f64) -> f64 {
    let deviation = noise.hypot(other.sqrt()) * model.student_factor();
    if deviation.is_nan() { f64::INFINITY } else { deviation }
}

/// The standard deviations of the errors of k-step predictions of a record, one for each sample, in units of y: what
/// the noise does, and what the uncertainty of the parameters, of the output's offset and of the first errors adds.
///
/// ```text
/// sigma^2 sum_{i<k} h_i^2 + g' P g,   g = dy^(t | t-k)/dtheta
/// ```
///
/// The first part is [`prediction_deviation`](crate::respond::prediction_deviation) squared; the second depends on the
/// signals. Where the noise variance was estimated with nu degrees of freedom, they are those of Student's
/// distribution, a factor sqrt(nu/(nu - 2)). They are right for samples that the model was not fitted to; on those of
/// the fit they are a little too large. NaN where [`predict`](crate::respond::predict) has no prediction. `horizon` and
/// `start` are as there.
///
/// Cost: p + 1 times that of the prediction for p parameters.
///
/// # Errors
/// As for [`predict`](crate::respond::predict).
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::estimate::{Initial, arx};
/// use thetahat::model::{Orders, PolynomialModel, Signal};
/// use thetahat::respond::{InitialCondition, prediction_deviation, prediction_deviations};
///
/// let mut y: Vec<f64> = vec![0.0, 1.0];
/// for t in 2..100 {
///     y.push(0.8 * y[t - 1] + f64::from(t as u32 * 7 % 11) - 5.0);
/// }
/// let record = Record::new(&y, vec![])?;
/// let orders = Orders::arx(1, &[], &[])?;
/// let estimate = arx(&record, &orders, Initial::Drop)?;
/// let model = estimate.to_model(&orders, 1.0, vec![], Signal::default())?;
/// let found = prediction_deviations(&model, &record, 1, InitialCondition::Drop)?;
/// // y^(t) = -a y(t - 1): its error has the variance sigma^2 + y(t - 1)^2 var a, with N - 1 degrees of freedom.
/// let (variance, degrees) = (model.parameters[0].standard_error.unwrap().powi(2), 99.0 - 1.0);
/// let expected = (model.noise_variance + y[49] * y[49] * variance) * degrees / (degrees - 2.0);
/// assert!((found[50] - expected.sqrt()).abs() < 1e-12);
/// assert!(found[0].is_nan() && found[50] > prediction_deviation(&model, 1)?);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn prediction_deviations(
    model: &PolynomialModel,
    record: &Record<'_>,
    horizon: usize,
    start: InitialCondition,
) -> Result<Vec<f64>, Error> {
    check_inputs(model, record)?;
    if let Some((model, signals)) = model.with_open_offset(record.output.len()) {
        return prediction_deviations(&model, &record.with_inputs(&signals), horizon, start);
    }
    let horizon = horizon.min(longest(record) + 1);
    deviations_of(model, record, horizon, start, &innovations(model, record, horizon, start)?)
}

/// The same from the innovations of the samples that have a prediction.
pub(super) fn deviations_of(
    model: &PolynomialModel,
    record: &Record<'_>,
    horizon: usize,
    start: InitialCondition,
    innovations: &[Innovations],
) -> Result<Vec<f64>, Error> {
    let response = disturbance_response(model, horizon);
    let sigma = model.noise_variance.sqrt();
    let sizes = accumulated(&response, horizon);
    let changes = changes(model);
    let moved_responses: Vec<Vec<f64>> =
        changes.iter().map(|change| moved_response(model, change, &response)).collect();
    let mut deviations = vec![f64::NAN; record.output.len()];
    for found in innovations {
        let rows = found.rows.clone();
        let inputs = record.inputs.iter().map(|u| u[rows.clone()].to_vec()).collect();
        let output = record.output[rows.clone()].to_vec();
        let (disturbance, errors) = (found.disturbance.clone(), found.errors.clone());
        let paths = Paths::new(model, found, inputs, output, disturbance, errors);
        // Where the output is missing there is a prediction too, if no past one is needed.
        let counted = found.span.start - rows.start..found.span.end - rows.start;
        let mut variances = vec![0.0; counted.len()];
        let mut add = |moved: &Moved, response_moved: &[f64], scale: f64| {
            let mut values = vec![0.0; counted.len()];
            add_filtered(&mut values, &counted, &response, &moved.errors, 0);
            add_filtered(&mut values, &counted, response_moved, &paths.errors, 0);
            variances.iter_mut().zip(&values).for_each(|(sum, value)| *sum += scale * value * value);
        };
        let estimated = start == InitialCondition::Estimate && !found.impulses.is_empty();
        for (change, response_moved) in changes.iter().zip(&moved_responses) {
            add(&paths.moved_by_parameters(model, change, estimated)?, response_moved, 1.0);
        }
        let (fixed, none) = (Change::none(model), Impulses::none(model));
        for earlier in paths.earlier_errors(model, start) {
            add(&paths.moved(model, &fixed, &none, earlier), &[], model.noise_variance);
        }
        for (position, (row, variance)) in found.span.clone().zip(&variances).enumerate() {
            // From zero the first samples look fewer steps ahead.
            let ahead = if start == InitialCondition::Zero { horizon.min(position + 1) } else { horizon };
            deviations[row] = student(model, sigma * sizes[ahead - 1], *variance);
        }
    }
    Ok(deviations)
}

/// dh, as long as h.
fn moved_response(model: &PolynomialModel, change: &Change, response: &[f64]) -> Vec<f64> {
    let rows = 0..response.len();
    let mut moved = vec![0.0; response.len()];
    moved.iter_mut().zip(&change.c).for_each(|(sum, c)| *sum += c);
    divide(&model.a, &mut moved);
    divide(&model.d, &mut moved);
    for (monic, change) in [(&model.a, &change.a), (&model.d, &change.d)] {
        let mut part = vec![0.0; response.len()];
        add_filtered(&mut part, &rows, change, response, 0);
        divide(monic, &mut part);
        moved.iter_mut().zip(&part).for_each(|(sum, part)| *sum -= part);
    }
    moved
}
