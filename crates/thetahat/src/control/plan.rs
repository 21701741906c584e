//! From a model to a controller.

use std::ops::RangeInclusive;

use rayon::prelude::*;
use thetahat_core::nalgebra::{Complex, DMatrix, DVector, Dyn};
use thetahat_core::{
    Covariance, LinearQuadratic, MinimumVariance, PlacementOrders, RstController, WantedPoles,
};
use thetahat_numerics::random::Random;

use super::closed_loop::{Closed, closed_loop};
use super::document::{Control, Polynomials, Robustness};
use super::plant::{Plant, monic, trimmed};
use crate::data::Offset;
use crate::document::GENERATOR;
use crate::figures::short;
use crate::model::polynomial::{is_stable, product, roots};
use crate::model::{LinearModel, Model, PolynomialModel};
use crate::respond::Spread;
use crate::{Document, Error};

/// The most draws.
const MOST_DRAWS: usize = 100_000;
/// Steps of the Riccati equation, at most.
const STEPS: usize = 100_000;
/// Ms above this is worth a warning, and a share of unstable draws.
const LARGEST_SENSITIVITY: f64 = 2.0;
const LARGEST_UNSTABLE_SHARE: f64 = 0.01;

/// What a controller is designed for.
#[derive(Debug, Clone, PartialEq)]
pub enum Design {
    /// The poles of the response to the set point, in the z plane, with their conjugates. At most as many as the plant
    /// has; those that are not given are at 0.
    Poles(Vec<Complex<f64>>),
    /// The least sum of y² + ρ u² (with an integrator of u's changes), by the Riccati equation.
    Quadratic {
        /// ρ, above 0.
        input_weight: f64,
    },
    /// The least variance of y, and of ρ u² (with an integrator of u's changes) beside it.
    MinimumVariance {
        /// ρ, 0 or more.
        input_weight: f64,
    },
}

/// Which controller.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlPlan {
    /// The design.
    pub design: Design,
    /// The input that the controller moves; none: the only one.
    pub input: Option<String>,
    /// The output that it holds; none: the only one.
    pub output: Option<String>,
    /// The roots of A_o, how errors and noise are forgotten. None: the zeros of the noise model, which is what a Kalman
    /// filter of the model has, the slowest of them where there are more than the controller can place. Minimum
    /// variance has no other.
    pub observer: Option<Vec<Complex<f64>>>,
    /// Whether the controller integrates, so that loads and errors of the gain leave no error.
    pub integrator: bool,
    /// Whether the zeros of the plant are cancelled; of placed poles only.
    pub cancel_zeros: bool,
    /// The limits of the input, in its own unit.
    pub limits: RangeInclusive<f64>,
    /// How many models are drawn from the covariance of the parameters.
    pub draws: usize,
}

impl ControlPlan {
    /// This design with an integrator and without limits, for the only input and output, with 500 draws.
    pub fn new(design: Design) -> Self {
        let limits = f64::NEG_INFINITY..=f64::INFINITY;
        let (input, output, observer) = (None, None, None);
        Self { design, input, output, observer, integrator: true, cancel_zeros: false, limits, draws: 500 }
    }
}

/// A controller for an input and an output of a linear model, and the loop that it gives:
///
/// ```text
/// A(q) y = B(q) u + C(q)/D(q) e,     R u = T u_c - S y
///
/// poles               A R + B S = A_m A_o
/// linear-quadratic    the same, A_m being A + K of the best state feedback u = -K x in the controllable form
/// minimum variance    C = A D F + q^-d G,  R = B' F + rho/b_0 C/D,  S = G,  T = C
/// ```
///
/// A model in state space gives A, B and C by its poles and zeros, a process held from sample to sample its transfer
/// function. Of what says nothing of its noise the measurements are taken for noisy: C = A.
///
/// Parameters are drawn from the normal distribution of the estimate, the model of each with the same controller: the
/// share of stable loops says whether the log was enough for this design.
///
/// Source: Åström and Wittenmark, Computer-Controlled Systems, 3rd ed. 1997, chapters 5, 11 and 12.
///
/// # Errors
/// [`Error::Argument`] for a model that is not linear or in continuous time, channels that are not there, poles outside
/// of the unit circle or without their conjugates, weights and limits out of their range, and designs that the model
/// does not allow: factors that A and B share, zeros outside of the unit circle to be cancelled, an input that acts at
/// once.
///
/// ```
/// use thetahat::control::{ControlPlan, Design, control};
/// use thetahat::data::Record;
/// use thetahat::estimate::{Initial, arx};
/// use thetahat::model::{Model, Orders, Signal};
///
/// let u: Vec<f64> = (0..200).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![1.0];
/// for t in 1..200 {
///     y.push(0.8 * y[t - 1] + 0.5 * u[t - 1] + 0.01 * f64::from((t * t * t) as u32 % 11));
/// }
/// let orders = Orders::arx(1, &[1], &[1])?;
/// let model = arx(&Record::new(&y, vec![&u])?, &orders, Initial::Drop)?;
/// let model = Model::from(model.to_model(&orders, 1.0, vec![Signal::default()], Signal::default())?);
///
/// let found = control(&model, &ControlPlan::new(Design::Poles(vec![0.6.into()])))?;
/// assert!(found.closed_loop.stable && (found.closed_loop.static_gain - 1.0).abs() < 1e-12);
/// assert!(found.robustness.unwrap().stable_share == 1.0);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn control(model: &Model, plan: &ControlPlan) -> Result<Control, Error> {
    check(plan)?;
    let outputs = model.linear("a controller")?;
    let output_names: Vec<&str> = outputs.iter().map(|each| each.output().name.as_str()).collect();
    let output = chosen("output", &output_names, plan.output.as_deref())?;
    let linear = &outputs[output];
    let names: Vec<&str> = linear.inputs().iter().map(|signal| signal.name.as_str()).collect();
    let input = chosen("input", &names, plan.input.as_deref())?;
    let plant = Plant::of(linear, input)?;
    let (of_input, of_output) = (linear.inputs()[input].clone(), linear.output().clone());
    let level = |offset: &Offset| offset.at(0.0);
    let working = level(&of_input.offset);
    let limits = plan.limits.start() - working..=plan.limits.end() - working;
    let mut warnings = Vec::new();
    let designed = Designed::of(&plant, plan, &mut warnings)?;
    let controller = designed.controller.with_limits(limits).map_err(|error| refused(&error, plan))?;
    let closed = closed_loop(&controller, &plant, linear.sample_time())?;
    if !closed.stable {
        warnings.push("the loop is not stable with the model".into());
    } else if closed.peak_sensitivity > LARGEST_SENSITIVITY {
        warnings.push(format!(
            "Ms is {}: the loop bears little error of the model; ask for slower poles, or a slower observer",
            short(closed.peak_sensitivity)
        ));
    }
    if let (low, high) = controller.limits()
        && !(low..=high).contains(&0.0)
    {
        warnings.push(format!(
            "the working point of the model, {} = {}, is outside of the limits",
            of_input.name,
            short(working)
        ));
    }
    if (closed.static_gain - 1.0).abs() > 1e-6 {
        warnings.push(format!(
            "a set point that stays is followed with a gain of {}, as the controller does not integrate",
            short(closed.static_gain)
        ));
    }
    let robustness = match linear {
        LinearModel::Polynomial(polynomials) => robustness(&controller, polynomials, input, plan.draws)?,
        LinearModel::Transfer(polynomials) => robustness(&controller, polynomials, input, plan.draws)?,
        _ => None,
    };
    if let Some(found) = robustness.as_ref().filter(|found| 1.0 - found.stable_share > LARGEST_UNSTABLE_SHARE)
    {
        warnings.push(format!(
            "{} % of the models within the covariance of the parameters make an unstable loop: fit more rows, or ask for less",
            short(100.0 * (1.0 - found.stable_share))
        ));
    }
    let whole = |rest: &DVector<f64>| trimmed(std::iter::once(1.0).chain(rest.iter().copied()).collect());
    let (lowest, highest) = controller.limits();
    let observer = whole(controller.observer());
    Ok(Control {
        schema: Control::SCHEMA.into(),
        generator: GENERATOR.to_owned(),
        model: model.name(),
        design: designed.words,
        input: of_input,
        output: of_output,
        sample_time: linear.sample_time(),
        controller: Polynomials {
            r: whole(controller.r()),
            s: trimmed(controller.s().as_slice().to_vec()),
            t: observer.iter().map(|value| value * controller.gain()).collect(),
            observer,
            gain: controller.gain(),
            lowest: Some(lowest).filter(|limit| limit.is_finite()),
            highest: Some(highest).filter(|limit| limit.is_finite()),
        },
        state_feedback: designed.feedback,
        closed_loop: closed,
        robustness,
        warnings,
    })
}

fn check(plan: &ControlPlan) -> Result<(), Error> {
    let (lowest, highest) = (*plan.limits.start(), *plan.limits.end());
    if plan.limits.is_empty() || lowest == f64::INFINITY || highest == f64::NEG_INFINITY {
        return Err(Error::argument(
            "limits",
            format!("{lowest}..{highest} is no range: give the lower one first"),
        ));
    }
    if !(1..=MOST_DRAWS).contains(&plan.draws) {
        return Err(Error::argument("draws", format!("{} is outside 1..{MOST_DRAWS}", plan.draws)));
    }
    match plan.design {
        Design::Poles(ref poles) => check_roots("poles", poles),
        Design::Quadratic { input_weight } if !(input_weight > 0.0 && input_weight.is_finite()) => {
            Err(Error::argument("lqr", format!("the weight {input_weight} is not a positive number")))
        }
        Design::MinimumVariance { input_weight } if !(input_weight >= 0.0 && input_weight.is_finite()) => {
            Err(Error::argument("minimum-variance", format!("the weight {input_weight} is not 0 or more")))
        }
        _ => Ok(()),
    }?;
    plan.observer.as_deref().map_or(Ok(()), |poles| check_roots("observer", poles))?;
    if plan.cancel_zeros && !matches!(plan.design, Design::Poles(_)) {
        return Err(Error::argument(
            "cancel-zeros",
            "only placed poles leave a choice: minimum variance cancels them all",
        ));
    }
    if plan.observer.is_some() && matches!(plan.design, Design::MinimumVariance { .. }) {
        return Err(Error::argument(
            "observer",
            "minimum variance has that of the noise model, and leaves no choice",
        ));
    }
    Ok(())
}

/// That roots are inside the unit circle and come with their conjugates.
fn check_roots(argument: &str, poles: &[Complex<f64>]) -> Result<(), Error> {
    for pole in poles {
        let of = |what: &str| Err(Error::argument(argument, format!("{}: {what}", written(pole))));
        if !(pole.re.is_finite() && pole.im.is_finite()) {
            return of("it is not a number");
        }
        if pole.norm() >= 1.0 {
            return of("it is not inside the unit circle");
        }
        let count = |wanted: Complex<f64>| poles.iter().filter(|other| **other == wanted).count();
        if count(*pole) != count(pole.conj()) {
            return of("its conjugate is missing");
        }
    }
    Ok(())
}

fn written(pole: &Complex<f64>) -> String {
    match pole.im {
        0.0 => short(pole.re),
        im => format!("{}{}{}i", short(pole.re), if im > 0.0 { "+" } else { "-" }, short(im.abs())),
    }
}

/// The place of a channel by its name, or of the only one.
fn chosen(what: &str, names: &[&str], wanted: Option<&str>) -> Result<usize, Error> {
    let there = || names.join(", ");
    match wanted {
        Some(wanted) => names.iter().position(|name| *name == wanted).ok_or_else(|| {
            Error::argument(what, format!("the model has none called '{wanted}'; it has: {}", there()))
        }),
        None if names.len() == 1 => Ok(0),
        None if names.is_empty() => Err(Error::argument("model", format!("it has no {what}"))),
        None => Err(Error::argument(what, format!("the model has several: name one of {}", there()))),
    }
}

/// What a design comes to.
struct Designed {
    controller: RstController<f64, Dyn>,
    words: String,
    feedback: Option<Vec<f64>>,
}

impl Designed {
    fn of(plant: &Plant, plan: &ControlPlan, warnings: &mut Vec<String>) -> Result<Self, Error> {
        let integrator = plan.integrator;
        let ending = if integrator { ", with an integrator" } else { "" };
        let (response, words, feedback) = match &plan.design {
            Design::MinimumVariance { input_weight } => {
                let (a, b) = (product(&plant.a, &plant.d), product(&plant.b, &plant.d));
                let wanted = MinimumVariance::new(*input_weight).with_integrator(integrator);
                let controller = RstController::minimum_variance(&a, &b, &plant.c, &wanted)
                    .map_err(|error| refused(&error, plan))?;
                let words = format!("minimum variance, input weight {}{ending}", short(*input_weight));
                return Ok(Self { controller, words, feedback: None });
            }
            Design::Poles(poles) => {
                let each: Vec<String> = poles.iter().map(written).collect();
                (monic(poles), format!("poles at {}{ending}", each.join(", ")), None)
            }
            Design::Quadratic { input_weight } => {
                let feedback = state_feedback(plant, *input_weight, integrator)?;
                let moved = if integrator { product(&plant.a, &[1.0, -1.0]) } else { plant.a.clone() };
                let at = |place: usize| moved.get(place).copied().unwrap_or(0.0);
                let rest = feedback.iter().enumerate().map(|(place, gain)| at(place + 1) + gain);
                let response = std::iter::once(1.0).chain(rest).collect();
                let words = format!("linear-quadratic, input weight {}{ending}", short(*input_weight));
                (response, words, Some(feedback))
            }
        };
        let (na, nb) = (plant.a.len() - 1, plant.b.len() - 1);
        let response = trimmed(response);
        // A R + B S has so many coefficients after its first, fewer where zeros are cancelled.
        let delay = plant.b.iter().take_while(|value| **value == 0.0).count();
        let last = if plan.cancel_zeros { delay } else { nb };
        let room = (last + na + usize::from(integrator)).saturating_sub(1);
        let left = room.checked_sub(response.len() - 1).ok_or_else(|| {
            Error::argument(
                "poles",
                format!("{} are more than the {room} that this model lets one place", response.len() - 1),
            )
        })?;
        let observer = match &plan.observer {
            Some(poles) if poles.len() > left => {
                let message = format!(
                    "{} poles are more than the {left} that are left beside the response",
                    poles.len()
                );
                return Err(Error::argument("observer", message));
            }
            Some(poles) => monic(poles),
            None => noise_zeros(&plant.c, left, warnings),
        };
        let orders = PlacementOrders { na, nb, integrator };
        debug_assert!(orders.size() >= room);
        let wanted = WantedPoles::new(&response, &observer)
            .with_integrator(integrator)
            .with_cancelled_zeros(plan.cancel_zeros);
        let controller = RstController::pole_placement(&plant.a, &plant.b, &wanted)
            .map_err(|error| refused(&error, plan))?;
        Ok(Self { controller, words, feedback })
    }
}

/// The observer that the noise model stands for: C, or the slowest of its zeros.
fn noise_zeros(c: &[f64], left: usize, warnings: &mut Vec<String>) -> Vec<f64> {
    let stable = is_stable(c, &mut Vec::new());
    if c.len() - 1 <= left && stable {
        return c.to_vec();
    }
    // Zeros on the unit circle, as of a model at the boundary, are taken a little inside.
    const LARGEST: f64 = 0.98;
    let zeros = roots(c).unwrap_or_default();
    let inside =
        zeros.iter().map(|zero| if zero.norm() > LARGEST { zero * (LARGEST / zero.norm()) } else { *zero });
    let mut kept: Vec<Complex<f64>> = inside.take(left).collect();
    // A pair stays together.
    if kept.last().is_some_and(|last| last.im > 0.0) {
        kept.pop();
    }
    if kept.len() < zeros.len() {
        warnings.push(format!(
            "the observer has the {} slowest of {} zeros of the noise model: the controller has no place for more",
            kept.len(),
            zeros.len()
        ));
    }
    monic(&kept)
}

/// K of u = -K x with the least sum of y² + ρ u², or ρ (Δu)².
fn state_feedback(plant: &Plant, input_weight: f64, integrator: bool) -> Result<Vec<f64>, Error> {
    let a = if integrator { product(&plant.a, &[1.0, -1.0]) } else { plant.a.clone() };
    let size = (a.len() - 1).max(plant.b.len() - 1).max(1);
    let at = |values: &[f64], place: usize| values.get(place).copied().unwrap_or(0.0);
    let state = DMatrix::from_fn(size, size, |row, column| match row {
        0 => -at(&a, column + 1),
        _ => f64::from(u8::from(row == column + 1)),
    });
    let input = DMatrix::from_fn(size, 1, |row, _| f64::from(u8::from(row == 0)));
    let output = DMatrix::from_fn(size, 1, |row, _| at(&plant.b, row + 1));
    let one = Covariance::from_diagonal(&DVector::from_element(1, 1.0));
    let price = Covariance::from_diagonal(&DVector::from_element(1, input_weight));
    let found = one.and_then(|one| {
        let weight = one.transformed(&output)?;
        let price = price?;
        LinearQuadratic::<f64, Dyn, Dyn>::solve(&state, &input, weight, price, STEPS)
    });
    let found = found.map_err(|error| {
        Error::argument("lqr", format!("the Riccati equation of this model has no solution: {error}"))
    })?;
    Ok(found.gain.iter().copied().collect())
}

/// What the core says of a design, in the words of the model.
fn refused(error: &thetahat_core::Error, plan: &ControlPlan) -> Error {
    let at_least = |what: &str| Error::argument("model", what.to_owned());
    match *error {
        thetahat_core::Error::OutOfRange { argument: "b", range } if range.contains("factor in common") => {
            at_least(
                "its poles and zeros have one in common, nearly, which no controller can move: fit it with lower orders",
            )
        }
        thetahat_core::Error::OutOfRange { argument: "b", range }
            if range.contains("inside the unit circle") =>
        {
            at_least("it has zeros outside of the unit circle, which cannot be cancelled")
        }
        thetahat_core::Error::OutOfRange { argument: "b", range } if range.contains("begins with 0") => {
            at_least(
                "its input acts at once, or not at all: a controller needs a delay of a sample (nk of 1 or more)",
            )
        }
        thetahat_core::Error::OutOfRange { argument: "b", .. } => {
            at_least("its static gain is 0: no set point can be held")
        }
        thetahat_core::Error::OutOfRange { argument: "c", .. } => at_least(
            "its noise has zeros on the unit circle: minimum variance would trust a measurement for ever",
        ),
        thetahat_core::Error::OutOfRange { argument: "input_weight", .. } => Error::argument(
            "minimum-variance",
            "the loop would be unstable, or nearly: 0 is for models with zeros inside the unit circle, others need a weight; larger ones need a \
             plant that is stable without a controller",
        ),
        thetahat_core::Error::OutOfRange { argument: "limits", .. } => {
            Error::argument("limits", format!("{}..{} is no range", plan.limits.start(), plan.limits.end()))
        }
        ref other => at_least(&format!("no controller can be computed for it: {other}")),
    }
}

/// The same controller with drawn models.
fn robustness(
    controller: &RstController<f64, Dyn>,
    model: &PolynomialModel,
    input: usize,
    draws: usize,
) -> Result<Option<Robustness>, Error> {
    let spread = Spread::of(model);
    let peaks = (0..draws).into_par_iter().map(|number| {
        let drawn = spread.any(model, &mut Random::of(1, number as u64))?;
        Ok(drawn.map(|drawn| {
            let closed = Closed::new(controller, &Plant::of_polynomials(&drawn, input, true));
            if closed.is_stable() { closed.peaks().0 } else { f64::INFINITY }
        }))
    });
    let Some(mut peaks) = peaks.collect::<Result<Option<Vec<f64>>, Error>>()? else { return Ok(None) };
    peaks.sort_by(f64::total_cmp);
    let stable = peaks.iter().filter(|peak| peak.is_finite()).count();
    let place = ((0.95 * draws as f64).ceil() as usize).clamp(1, draws) - 1;
    Ok(Some(Robustness {
        draws,
        stable_share: stable as f64 / draws as f64,
        peak_sensitivity_95: peaks.get(place).copied().filter(|peak| peak.is_finite()),
    }))
}
