//! What an experiment would tell of a model, before it is made.
//!
//! With e of variance sigma^2 and psi = -de/dtheta, the covariance of a prediction error estimate with this noise is,
//! for many samples,
//!
//! ```text
//! P = (M/sigma^2)^-1,   M = sum_t E psi(t) psi(t)'
//! ```
//!
//! (Ljung, System Identification, 2nd ed. 1999, sections 9.3 and 13.3; Goodwin and Payne, Dynamic System
//! Identification, 1977, chapter 6). psi is what the input does to it plus what the noise does, and as the two are
//! independent in open loop, so is M:
//!
//! ```text
//! of the input, with x_j = B_j/F_j v_j, y = 1/A sum x_j:      of the noise:
//! a_i: -(D/C) q^-i y                                          -(1/A) q^-i e
//! b_ji: (D/(C F_j)) q^-i v_j                                  0
//! c_i: 0                                                      (1/C) q^-i e
//! d_i: 0                                                      -(1/D) q^-i e
//! f_ji: -(D/(C F_j)) q^-i x_j                                 0
//! level: D(1)/C(1)                                            0
//! ```
//!
//! The part of the input is a simulation of the model; that of the noise is N times a covariance, which sums of
//! products of the impulse responses of 1/A, 1/C and 1/D give exactly, without any draw. The last row is the output's
//! level: fits find it together with the parameters, or take it off before, and what a constant input tells goes into
//! it.
//!
//! Before the first sample the plant is at rest at the first value of the signal: v(t) = u(t) - u(0). With the level
//! unknown no other value would change anything. Samples that a fit needs for its first regressors do not count.

use std::slice;

use thetahat_core::nalgebra::{Cholesky, DMatrix};
use thetahat_numerics::regression::{Lagged, Presample, Taps, add_filtered, divide};

use crate::Error;
use crate::model::{Orders, PolynomialModel};
use crate::respond::until_negligible;

/// Of a column's square, what the columns before it leave below this fraction is rounding.
const DEPENDENT: f64 = 1e-12;
/// The longest impulse response of the noise, in samples.
const LONGEST: usize = 10_000_000;

/// What the columns of psi are shifts of: positions among some signals.
struct Sources {
    a: usize,
    b: Vec<usize>,
    c: usize,
    d: usize,
    f: Vec<usize>,
}

impl Sources {
    /// The columns in the order of the parameters, then one more.
    fn taps(&self, orders: &Orders, last: usize) -> Vec<Taps> {
        let monic = |signal: usize, count: usize, sign: f64| Taps { signal, first: 1, count, sign };
        let mut taps = vec![monic(self.a, orders.na, -1.0)];
        let b = self.b.iter().zip(orders.nk.iter().zip(&orders.nb));
        taps.extend(b.map(|(&signal, (&first, &count))| Taps { signal, first, count, sign: 1.0 }));
        taps.push(monic(self.c, orders.nc, 1.0));
        taps.push(monic(self.d, orders.nd, -1.0));
        taps.extend(self.f.iter().zip(&orders.nf).map(|(&signal, &count)| monic(signal, count, -1.0)));
        taps.push(Taps { signal: last, first: 0, count: 1, sign: 1.0 });
        taps
    }
}

/// A model as it would be known after an experiment with these inputs, one for each of its own, as long as one another:
/// the same parameters, with the standard errors of an estimate from as many samples, and with those of all that
/// follows from them, poles, gains and time constants. The structure, the parameters and the noise are taken to be
/// right; so is a linear plant.
///
/// Cost: O(N p + p^3) for N samples and p parameters.
///
/// # Errors
/// [`Error::Argument`] if there is not one input for each of the model's, or the inputs differ in length;
/// [`Error::Data`] if the model is not stable, has no inputs, no noise, or noise that never dies away, or a signal
/// leaves the range of numbers; [`Error::Undetermined`] if the inputs leave the parameters open.
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::design::{SignalKind, SignalPlan, TestSignal, planned};
/// use thetahat::estimate::{Initial, arx};
/// use thetahat::model::{Orders, Signal};
///
/// let u: Vec<f64> = (0..200).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![1.0];
/// for t in 1..u.len() {
///     y.push(0.8 * y[t - 1] + 0.5 * u[t - 1] + 0.1 * f64::from((t * t * t) as u32 % 11));
/// }
/// let orders = Orders::arx(1, &[1], &[1])?;
/// let estimate = arx(&Record::new(&y, vec![&u])?, &orders, Initial::Drop)?;
/// let model = estimate.to_model(&orders, 1.0, vec![Signal::default()], Signal::default())?;
///
/// // Four times as many samples of white noise halve the errors.
/// let error = |length: usize| -> Result<f64, thetahat::Error> {
///     let signal = TestSignal::new(&SignalPlan { length, ..SignalPlan::new(SignalKind::Rbs) })?;
///     Ok(planned(&model, &signal.values(length))?.parameters[0].standard_error.unwrap_or(f64::NAN))
/// };
/// assert!((error(1000)? / error(4000)? - 2.0).abs() < 0.1);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn planned(model: &PolynomialModel, inputs: &[Vec<f64>]) -> Result<PolynomialModel, Error> {
    Prior::new(model)?.planned(inputs)
}

/// A model that an experiment is planned with, and what its noise tells in a sample.
#[derive(Debug)]
pub(super) struct Prior<'a> {
    model: &'a PolynomialModel,
    /// E psi psi' of the noise over sigma^2, without the level.
    noise: DMatrix<f64>,
}

impl<'a> Prior<'a> {
    pub(super) fn new(model: &'a PolynomialModel) -> Result<Self, Error> {
        if !model.orders.nb.iter().any(|&nb| nb > 0) {
            return Err(Error::data("the model has no inputs: there is no experiment to plan for it"));
        }
        if !model.stable {
            return Err(Error::data(
                "the model is not stable: in open loop its output runs away, and this plans experiments in open loop",
            ));
        }
        if model.noise_variance <= 0.0 {
            return Err(Error::data(
                "the model has no noise: as far as it knows, any experiment that excites all parameters is exact",
            ));
        }
        let lasting =
            model.noise_poles.iter().chain(&model.noise_zeros).find(|root| root.re.hypot(root.im) >= 1.0);
        if let Some(root) = lasting {
            return Err(Error::data(format!(
                "{} of the noise model has a root on the unit circle or outside: how sure an estimate of it is has no theory",
                root.polynomial.to_uppercase()
            )));
        }
        Ok(Self { model, noise: noise(model) })
    }

    pub(super) fn model(&self) -> &PolynomialModel {
        self.model
    }

    /// See [`planned`].
    pub(super) fn planned(&self, inputs: &[Vec<f64>]) -> Result<PolynomialModel, Error> {
        let model = self.model;
        let count = model.inputs.len();
        if inputs.len() != count {
            return Err(Error::argument(
                "channels",
                format!(
                    "there are {} for the inputs of the model, of which there are {count}; give one for each",
                    inputs.len()
                ),
            ));
        }
        let length = inputs.first().map_or(0, Vec::len);
        if inputs.iter().any(|input| input.len() != length) {
            return Err(Error::argument("inputs", "they differ in length; give as many samples of each"));
        }
        let parameters = model.parameters.len();
        let counted = length.saturating_sub(model.orders.conditioned());
        let degrees = counted.checked_sub(parameters + 1).filter(|degrees| *degrees > 0).ok_or_else(|| {
            Error::undetermined(
                Vec::new(),
                format!(
                    "{length} samples are too few for {parameters} parameters and a level; ask for more (`length`)"
                ),
            )
        })?;
        let mut information = self.driven(inputs)? / model.noise_variance;
        for (entry, noise) in
            information.view_mut((0, 0), (parameters, parameters)).iter_mut().zip(&self.noise)
        {
            *entry += counted as f64 * noise;
        }
        let covariance = self.inverse(&information)?;
        let values: Vec<f64> = model.parameters.iter().map(|parameter| parameter.value).collect();
        let known = PolynomialModel::from_parameters(
            &model.orders,
            &values,
            Some(&covariance),
            model.noise_variance,
            model.sample_time,
        )?;
        let known = known.with_degrees_of_freedom(Some(degrees))?;
        Ok(PolynomialModel { inputs: model.inputs.clone(), output: model.output.clone(), ..known })
    }

    /// sum_t psi psi' of the input, with the level.
    fn driven(&self, inputs: &[Vec<f64>]) -> Result<DMatrix<f64>, Error> {
        let model = self.model;
        let orders = &model.orders;
        // Zeros in front, so that all lags are there: what is at rest.
        let lags = orders.nf.iter().copied().fold(orders.maximum_lag(), usize::max);
        let length = lags + inputs.first().map_or(0, Vec::len);
        let all = 0..length;
        let filtered = |numerator: &[f64], signal: &[f64], denominator: &[f64]| {
            let mut values = vec![0.0; length];
            add_filtered(&mut values, &all, numerator, signal, 0);
            divide(denominator, &mut values);
            values
        };
        let from_rest = |input: &Vec<f64>| -> Vec<f64> {
            let first = input.first().copied().unwrap_or(0.0);
            std::iter::repeat_n(0.0, lags).chain(input.iter().map(|value| value - first)).collect()
        };
        let whitened = |signal: &[f64]| filtered(&model.d, signal, &model.c);
        let mut signals = Vec::new();
        let mut put = |signal: Vec<f64>| {
            signals.push(signal);
            signals.len() - 1
        };
        let skipped = lags + orders.conditioned();
        let one: f64 = model.d.iter().sum::<f64>() / model.c.iter().sum::<f64>();
        let level = put((0..length).map(|t| if t < skipped { 0.0 } else { one }).collect());
        let rest = put(vec![0.0; length]);
        let (mut output, mut b, mut f) = (vec![0.0; length], Vec::new(), Vec::new());
        for (input, (numerator, denominator)) in inputs.iter().zip(model.b.iter().zip(&model.f)) {
            let v = from_rest(input);
            let x = filtered(numerator, &v, denominator);
            output.iter_mut().zip(&x).for_each(|(sum, x)| *sum += x);
            b.push(put(filtered(&[1.0], &whitened(&v), denominator)));
            f.push(if denominator.len() > 1 {
                put(filtered(&[1.0], &whitened(&x), denominator))
            } else {
                rest
            });
        }
        divide(&model.a, &mut output);
        let a = put(whitened(&output));
        let taps = Sources { a, b, c: rest, d: rest, f }.taps(orders, level);
        let products = products(&signals, taps, skipped);
        if products.iter().all(|value| value.is_finite()) {
            return Ok(products);
        }
        Err(Error::data(
            "the response to the signal leaves the range of numbers; scale the range towards one",
        ))
    }

    /// The covariance of the parameters from the information of all; rows of numbers.
    fn inverse(&self, information: &DMatrix<f64>) -> Result<Vec<Vec<f64>>, Error> {
        let size = information.nrows();
        let scales: Vec<f64> = (0..size).map(|k| information[(k, k)].sqrt()).collect();
        // The level may have no information of its own: with D(1) = 0 it does not show.
        let kept: Vec<usize> = (0..size).filter(|&k| k + 1 < size || scales[k] > 0.0).collect();
        let names = self.model.parameters.iter().map(|parameter| parameter.name.clone());
        let open = |k: usize| {
            let open: Vec<String> = names.clone().skip(k).take(1).collect();
            let which = open.first().map_or("the parameters".to_owned(), Clone::clone);
            Error::undetermined(
                open,
                format!("the inputs leave {which} open: they do not excite the model enough"),
            )
        };
        if let Some(k) = (0..size - 1).find(|&k| scales[k].is_nan() || scales[k] <= 0.0) {
            return Err(open(k));
        }
        let entry = |i: usize, j: usize| information[(kept[i], kept[j])] / scales[kept[i]] / scales[kept[j]];
        let scaled = DMatrix::from_fn(kept.len(), kept.len(), entry);
        // The level first: what a constant tells is its own.
        let turned =
            DMatrix::from_fn(kept.len(), kept.len(), |i, j| scaled[(kept.len() - 1 - i, kept.len() - 1 - j)]);
        let factor = Cholesky::new(turned).ok_or_else(|| open(size))?;
        let pivots = factor.l_dirty().diagonal();
        if let Some(k) = pivots.iter().position(|pivot| pivot * pivot < DEPENDENT) {
            return Err(open(kept.len() - 1 - k));
        }
        let inverse = factor.inverse();
        let last = kept.len() - 1;
        let row =
            |i: usize| (0..size - 1).map(|j| inverse[(last - i, last - j)] / scales[i] / scales[j]).collect();
        Ok((0..size - 1).map(row).collect())
    }
}

/// E psi psi' of the noise over sigma^2.
fn noise(model: &PolynomialModel) -> DMatrix<f64> {
    let orders = &model.orders;
    let response = |monic: &[f64]| {
        let compute = |length: usize| {
            let mut response = vec![0.0; length];
            response.iter_mut().take(1).for_each(|first| *first = 1.0);
            divide(monic, &mut response);
            response
        };
        if monic.len() == 1 { Vec::new() } else { until_negligible(LONGEST, monic.len(), compute) }
    };
    let mut signals = vec![response(&model.a), response(&model.c), response(&model.d), Vec::new()];
    // Shifts of all of them from the first to the last value.
    let lags = orders
        .na
        .max(orders.nc)
        .max(orders.nd)
        .max(orders.maximum_lag())
        .max(orders.nf.iter().copied().max().unwrap_or(0));
    let longest = signals.iter().map(Vec::len).max().unwrap_or(0);
    for signal in &mut signals {
        signal.splice(0..0, std::iter::repeat_n(0.0, lags));
        signal.resize(longest + 2 * lags, 0.0);
    }
    let none = vec![3; orders.inputs()];
    let sources = Sources { a: 0, b: none.clone(), c: 1, d: 2, f: none };
    let all = products(&signals, sources.taps(orders, 3), lags);
    let size = all.nrows() - 1;
    all.view((0, 0), (size, size)).into_owned()
}

/// The sums of products of all columns from a sample on.
fn products(signals: &[Vec<f64>], taps: Vec<Taps>, first: usize) -> DMatrix<f64> {
    let views: Vec<&[f64]> = signals.iter().map(Vec::as_slice).collect();
    let all = 0..views.first().map_or(0, |signal| signal.len());
    Lagged::new(&views, taps, slice::from_ref(&all), Presample::Drop).after(first).normal_equations().0
}
