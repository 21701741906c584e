use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{Complex, ComplexField};
use thetahat_numerics::regression::{add_filtered, divide};

use crate::Error;
use crate::model::{Block, Blocks, Gradient, PolynomialModel, Quantity, covariance};

/// What is left of the slowest mode at the end of a response.
const LEFT: f64 = 0.005;
/// How much an unstable mode grows until the end of a response.
const GROWN: f64 = 100.0;
/// ln|p| this close to zero is that of a mode that lasts.
const LASTING: f64 = 1e-9;
/// The fewest and the most samples that are chosen.
const SAMPLES: [usize; 2] = [20, 20_000];

/// What a model's output does, from rest, after something that happens at one input at time 0: a step or an impulse.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TransientResponse {
    /// The input's name.
    pub input: String,
    /// Seconds since it happened: 0, T, 2 T, …
    pub time: Vec<f64>,
    /// The output at these times in units of y per unit of u, with its standard error.
    pub values: Vec<Quantity>,
}

/// The response of a model to a unit step of one of its inputs, counted from 0.
///
/// With v the input, here 1 from time 0 on, and s = 1/(A F_j) v:
///
/// ```text
/// y = B_j s,   dy/db_k = q^-k s,   dy/da_k = -q^-k (1/A) y,   dy/df_k = -q^-k (1/F_j) y
/// ```
///
/// and J P J' is the variance, P being the covariance matrix of the parameters (Ljung, System Identification, 2nd ed.
/// 1999, section 9.4). There is no standard error where P is unknown.
///
/// Without `samples` the response lasts until 0.5 % of its slowest mode are left, an unstable mode has grown a
/// hundredfold, or, where a mode lasts (an integrator), three times as long as all others need; at least 20 samples and
/// at most 20000. It ends before a value that is not finite.
///
/// Cost: O(p^2) for each sample.
///
/// # Errors
/// [`Error::Argument`] if the model has no such input, or no sample is asked for; [`Error::Data`] if the roots of a
/// polynomial do not converge.
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::estimate::{Initial, arx};
/// use thetahat::model::{Orders, PolynomialModel, Signal};
/// use thetahat::respond::step_response;
///
/// let u: Vec<f64> = (0..100).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![1.0];
/// for t in 1..u.len() {
///     y.push(0.8 * y[t - 1] + 0.5 * u[t - 1]);
/// }
/// let orders = Orders::arx(1, &[1], &[1])?;
/// let estimate = arx(&Record::new(&y, vec![&u])?, &orders, Initial::Drop)?;
/// let model = estimate.to_model(&orders, 0.1, vec![Signal::default()], Signal::default())?;
/// let step = step_response(&model, 0, Some(4))?;
/// // 0.5, then 0.5 + 0.8 * 0.5, …
/// assert!((step.values[1].value - 0.5).abs() < 1e-9 && (step.values[2].value - 0.9).abs() < 1e-9);
/// assert!((step.time[3] - 0.3).abs() < 1e-15);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn step_response(
    model: &PolynomialModel,
    input: usize,
    samples: Option<usize>,
) -> Result<TransientResponse, Error> {
    response(model, input, samples, |v| v.fill(1.0))
}

/// The impulse response of a model from one of its inputs, counted from 0: the coefficients g_i of
/// B_j/(A F_j) = sum_i g_i q^-i (Ljung, System Identification, 2nd ed. 1999, section 2.1).
///
/// It is the response to an input of 1 at time 0 and 0 afterwards, in units of y per unit of u; the input holds for one
/// sample, so g_i over the sample time tends to the impulse response in continuous time. Its sums are the
/// [step response](step_response), whose equations for values and standard errors, length, cost and errors are its own
/// too: only v is 1 at time 0 alone.
///
/// # Errors
/// As for [`step_response`].
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::estimate::{Initial, arx};
/// use thetahat::model::{Orders, PolynomialModel, Signal};
/// use thetahat::respond::impulse_response;
///
/// let u: Vec<f64> = (0..100).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![1.0];
/// for t in 1..u.len() {
///     y.push(0.8 * y[t - 1] + 0.5 * u[t - 1]);
/// }
/// let orders = Orders::arx(1, &[1], &[1])?;
/// let estimate = arx(&Record::new(&y, vec![&u])?, &orders, Initial::Drop)?;
/// let model = estimate.to_model(&orders, 0.1, vec![Signal::default()], Signal::default())?;
/// let impulse = impulse_response(&model, 0, Some(4))?;
/// for (g, expected) in impulse.values.iter().zip([0.0, 0.5, 0.5 * 0.8, 0.5 * 0.64]) {
///     assert!((g.value - expected).abs() < 1e-9);
/// }
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn impulse_response(
    model: &PolynomialModel,
    input: usize,
    samples: Option<usize>,
) -> Result<TransientResponse, Error> {
    response(model, input, samples, |v| v[0] = 1.0)
}

/// The response to what `happens` at an input that is zero otherwise.
fn response(
    model: &PolynomialModel,
    input: usize,
    samples: Option<usize>,
    happens: impl FnOnce(&mut [f64]),
) -> Result<TransientResponse, Error> {
    let blocks = Blocks::of(model);
    let (Some(signal), Some(b), Some(f)) =
        (model.inputs.get(input), blocks.b.get(input), blocks.f.get(input))
    else {
        let inputs = model.inputs.len();
        return Err(Error::argument("input", format!("there is no input {input}: the model has {inputs}")));
    };
    if samples == Some(0) {
        return Err(Error::argument("samples", "a response has at least one sample"));
    }
    let samples = match samples {
        Some(samples) => samples,
        None => lasting(b.coefficients.len(), &[blocks.a.zeros()?, f.zeros()?].concat()),
    };

    let mut source = vec![0.0; samples];
    happens(&mut source);
    divide(&model.a, &mut source);
    divide(f.coefficients, &mut source);
    let mut values = vec![0.0; samples];
    add_filtered(&mut values, &(0..samples), b.coefficients, &source, 0);
    let divided = |monic: &[f64]| {
        let mut signal = values.clone();
        divide(monic, &mut signal);
        signal
    };
    let columns =
        [(b, 1.0, source), (&blocks.a, -1.0, divided(&model.a)), (f, -1.0, divided(f.coefficients))];
    let parameters = model.covariance.as_deref();
    let finite = values.iter().take_while(|value| value.is_finite()).count();
    let quantity = |t: usize| {
        let variance = parameters.and_then(|parameters| covariance(parameters, &gradient(&columns, t)));
        Quantity::new(values[t], variance.map(|[[variance, _], _]| variance.sqrt()))
    };
    Ok(TransientResponse {
        input: signal.name.clone(),
        time: (0..finite).map(|t| t as f64 * model.sample_time).collect(),
        values: (0..finite).map(quantity).collect(),
    })
}

/// The derivatives at one time: each polynomial with the sign and the signal that its coefficients shift.
fn gradient(columns: &[(&Block<'_>, f64, Vec<f64>)], t: usize) -> Gradient {
    let of = |(block, sign, signal): &(&Block<'_>, f64, Vec<f64>)| -> Gradient {
        let shifted = |power: usize| t.checked_sub(power).map_or(0.0, |earlier| sign * signal[earlier]);
        block.gradient(|power| Complex::new(shifted(power), 0.0)).collect()
    };
    columns.iter().flat_map(of).collect()
}

/// How many samples a response takes, from the number of coefficients of its B and its poles.
pub(super) fn lasting(coefficients: usize, poles: &[Complex<f64>]) -> usize {
    let (mut settling, mut growing, mut lasts) = (0.0_f64, f64::INFINITY, false);
    for pole in poles {
        let rate = pole.modulus().ln();
        if rate < -LASTING {
            settling = settling.max(LEFT.ln() / rate);
        } else if rate > LASTING {
            growing = growing.min(GROWN.ln() / rate);
        } else {
            lasts = true;
        }
    }
    let modes = match (growing.is_finite(), lasts) {
        (true, _) => growing,
        (false, true) => 3.0 * settling,
        (false, false) => settling,
    };
    // A conversion that saturates.
    (modes.ceil() as usize).saturating_add(coefficients + 1).clamp(SAMPLES[0], SAMPLES[1])
}
