//! Parameters to start from, in two regressions.
//!
//! Columns are fitted to the differences by least squares. Of what is left, w, a long autoregression gives errors e,
//! and a regression of w(t) on w and e at the lags of the factors gives their parameters, products of these left out
//! (Hannan and Rissanen, Biometrika 69 (1982)). A missing difference counts as zero there.

use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::optimize::Objective;

use super::ArimaData;
use super::likelihood::Likelihood;
use crate::Error;
use crate::model::{ArimaOrders, Factor, polynomial::multiply_out, polynomial::roots};
use thetahat_core::nalgebra::ComplexField;

/// Roots of a start are inside this circle.
const INSIDE: f64 = 0.95;
/// A column of which less than this fraction of its norm is left by those before it depends on them.
const DEPENDENT: f64 = 1e-8;
/// The parameters of an autoregression and of a moving average that are not told apart at 0.
const SMALL: f64 = 0.1;

/// The start for searches from the others that went astray.
pub(super) const SPARE: &str = "small";

/// Where a search begins.
pub(super) struct Begin {
    /// The sum of squares of the differences that the columns leave.
    pub(super) energy: f64,
    pub(super) starts: Vec<(&'static str, Vec<f64>)>,
}

/// # Errors
/// [`Error::Undetermined`] for columns whose differences depend on one another, which are named.
pub(super) fn begin(likelihood: &Likelihood<'_>, data: &ArimaData<'_>) -> Result<Begin, Error> {
    let orders = likelihood.orders();
    let mut sections = likelihood.differenced();
    let weights = regression(&sections, data, orders)?;
    for (values, columns) in &mut sections {
        for (column, weight) in columns.iter().zip(&weights) {
            values.iter_mut().zip(column).for_each(|(value, column)| *value -= weight * column);
        }
    }
    let left: Vec<Vec<f64>> = sections.into_iter().map(|(values, _)| values).collect();
    let whole = |values: &[f64]| {
        values.iter().filter(|value| !value.is_nan()).map(|value| value * value).sum::<f64>()
    };
    let energy: f64 = left.iter().map(|values| whole(values)).sum();
    let size = |values: &Vec<f64>| values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let level: f64 =
        data.output.iter().filter(|value| !value.is_nan()).fold(0.0, |most, value| most.max(value.abs()));
    // What rounding leaves of a constant.
    let rounding = 64.0 * f64::EPSILON * level;
    let energy = if left.iter().map(size).fold(0.0, f64::max) <= rounding { 0.0 } else { energy };
    let mut starts = Vec::new();
    let mut add = |name: &'static str, mut own: Vec<f64>| {
        inside(orders, &mut own);
        starts.push((name, [&weights[..], &own].concat()));
    };
    let filled: Vec<Vec<f64>> = left
        .iter()
        .map(|values| values.iter().map(|value| if value.is_nan() { 0.0 } else { *value }).collect())
        .collect();
    if orders.parameters() > 0
        && let Some(own) = hannan_rissanen(&filled, orders, likelihood.samples())
    {
        let mirrored = mirrored(orders, &own);
        add("hannan-rissanen", own);
        mirrored.into_iter().for_each(|own| add("mirrored", own));
    }
    add(
        SPARE,
        Factor::ALL
            .iter()
            .flat_map(|factor| {
                let value = if factor.is_autoregressive() { SMALL } else { -SMALL / 2.0 };
                std::iter::repeat_n(value, orders.factor(*factor).0)
            })
            .collect(),
    );
    Ok(Begin { energy, starts })
}

/// Where there is an autoregression beside a moving average, these may nearly cancel in one of two places: the start
/// with the signs of both changed. None of other models.
fn mirrored(orders: &ArimaOrders, parameters: &[f64]) -> Option<Vec<f64>> {
    let [ar, ma, seasonal_ar, seasonal_ma] = Factor::ALL.map(|factor| orders.factor(factor).0);
    let both = [ar.min(ma), ar.min(ma), seasonal_ar.min(seasonal_ma), seasonal_ar.min(seasonal_ma)];
    let signs = [ar, ma, seasonal_ar, seasonal_ma]
        .into_iter()
        .zip(both)
        .flat_map(|(count, both)| std::iter::repeat_n(if both > 0 { -1.0 } else { 1.0 }, count));
    let any = both.iter().any(|both| *both > 0);
    any.then(|| parameters.iter().zip(signs).map(|(value, sign)| sign * value).collect())
}

/// The columns' weights of least squares, by the modified Gram-Schmidt process.
fn regression(
    sections: &[(Vec<f64>, Vec<Vec<f64>>)],
    data: &ArimaData<'_>,
    orders: &ArimaOrders,
) -> Result<Vec<f64>, Error> {
    let count = data.columns.len();
    if count == 0 {
        return Ok(Vec::new());
    }
    let rows = || {
        sections.iter().flat_map(|(values, columns)| {
            (0..values.len()).filter(|t| !values[*t].is_nan()).map(move |t| (values[t], columns, t))
        })
    };
    let target = DVector::from_iterator(rows().count(), rows().map(|(value, ..)| value));
    let matrix = DMatrix::from_row_iterator(
        target.len(),
        count,
        rows().flat_map(|(_, columns, t)| columns.iter().map(move |column| column[t])),
    );
    let mut left = matrix.clone();
    for j in 0..count {
        let norm = left.column(j).norm();
        // What differencing leaves of a column that is large and hardly changes is rounding.
        let level = data.columns[j]
            .iter()
            .filter(|value| !value.is_nan())
            .fold(0.0_f64, |most, value| most.max(value.abs()));
        let rounding = 64.0 * f64::EPSILON * level * (target.len() as f64).sqrt();
        if norm.is_nan() || norm <= rounding.max(DEPENDENT * matrix.column(j).norm()) {
            let why = match orders.integrations() {
                0 => "it does not change, or follows from the others",
                _ => "differencing takes it, or it follows from the others",
            };
            return Err(Error::undetermined(
                vec![data.names[j].clone()],
                format!("{why}; leave its input out, or difference less"),
            ));
        }
        let unit = left.column(j) / norm;
        for k in j + 1..count {
            let part = unit.dot(&left.column(k));
            left.column_mut(k).axpy(-part, &unit, 1.0);
        }
    }
    let solved = matrix.qr();
    let mut right = target;
    solved.q_tr_mul(&mut right);
    let triangle = solved.r();
    let weights = triangle.solve_upper_triangular(&right.rows(0, count).into_owned());
    Ok(weights.map(|weights| weights.as_slice().to_vec()).unwrap_or_else(|| vec![0.0; count]))
}

/// The parameters of the factors; none where the second regression has no solution.
fn hannan_rissanen(sections: &[Vec<f64>], orders: &ArimaOrders, samples: usize) -> Option<Vec<f64>> {
    let lags = |factor: Factor| {
        let (count, rows) = orders.factor(factor);
        (1..=count).map(move |lag| lag * rows)
    };
    let longest = Factor::ALL.into_iter().flat_map(lags).max().unwrap_or(1);
    let moving =
        Factor::ALL.into_iter().any(|factor| !factor.is_autoregressive() && orders.factor(factor).0 > 0);
    let order = if moving { (longest + longest.max(8)).min(samples / 4).max(1) } else { 0 };
    let errors = autoregressive_errors(sections, order);
    let all: Vec<(bool, usize)> = Factor::ALL
        .into_iter()
        .flat_map(|factor| lags(factor).map(move |lag| (factor.is_autoregressive(), lag)))
        .collect();
    let size = all.len();
    let mut gram = DMatrix::zeros(size, size);
    let mut right = DVector::zeros(size);
    let mut regressor = vec![0.0; size];
    for (w, e) in sections.iter().zip(&errors) {
        for t in order.min(w.len() / 2).max(1)..w.len() {
            for (value, (of_output, lag)) in regressor.iter_mut().zip(&all) {
                *value = t.checked_sub(*lag).map_or(0.0, |row| if *of_output { w[row] } else { e[row] });
            }
            for i in 0..size {
                right[i] += regressor[i] * w[t];
                for j in 0..=i {
                    gram[(i, j)] += regressor[i] * regressor[j];
                }
            }
        }
    }
    let ridge: f64 = (0..size).map(|i| gram[(i, i)]).fold(0.0, f64::max);
    for i in 0..size {
        gram[(i, i)] += 1e-6 * ridge;
        for j in 0..i {
            gram[(j, i)] = gram[(i, j)];
        }
    }
    let solved = gram.cholesky()?.solve(&right);
    solved.iter().all(|value| value.is_finite()).then(|| solved.as_slice().to_vec())
}

/// The errors of an autoregression of some order, by the equations of Yule and Walker.
fn autoregressive_errors(sections: &[Vec<f64>], order: usize) -> Vec<Vec<f64>> {
    let product = |lag: usize| -> f64 {
        sections
            .iter()
            .filter(|w| w.len() > lag)
            .map(|w| w.iter().zip(&w[lag..]).map(|(a, b)| a * b).sum::<f64>())
            .sum()
    };
    let r: Vec<f64> = (0..=order).map(product).collect();
    // Levinson and Durbin.
    let (mut a, mut variance) = (vec![1.0], r[0]);
    for n in 1..=order {
        if variance.is_nan() || variance <= 1e-12 * r[0] {
            break;
        }
        let k = -a.iter().zip(r[1..=n].iter().rev()).map(|(a, r)| a * r).sum::<f64>() / variance;
        a.push(0.0);
        let reversed: Vec<f64> = a.iter().rev().copied().collect();
        a.iter_mut().zip(&reversed).for_each(|(a, other)| *a += k * other);
        variance *= 1.0 - k * k;
    }
    let errors = |w: &Vec<f64>| {
        (0..w.len()).map(|t| a.iter().take(t + 1).enumerate().map(|(lag, a)| a * w[t - lag]).sum()).collect()
    };
    sections.iter().map(errors).collect()
}

/// Moves the roots of all factors inside a circle.
pub(super) fn inside(orders: &ArimaOrders, parameters: &mut [f64]) {
    let factors = orders.factors(parameters);
    let mut place = 0;
    let mut product = Vec::new();
    for (factor, monic) in Factor::ALL.into_iter().zip(&factors) {
        let count = monic.len() - 1;
        let own = &mut parameters[place..place + count];
        match roots(monic) {
            Some(found) if found.iter().any(|root| root.modulus() > INSIDE) => {
                multiply_out(
                    found.iter().map(|root| *root * (INSIDE / root.modulus()).min(1.0)),
                    &mut product,
                );
                let sign = if factor.is_autoregressive() { -1.0 } else { 1.0 };
                own.iter_mut().zip(&product[1..]).for_each(|(value, product)| *value = sign * product.re);
            }
            Some(_) => {}
            None => own.fill(0.0),
        }
        place += count;
    }
}
