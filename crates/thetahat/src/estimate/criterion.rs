mod demands;
#[cfg(test)]
mod tests;

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::DVector;
use thetahat_numerics::optimize::Search;
use thetahat_numerics::regression::{
    Lagged, Presample, Unsolved,
    convex::{Failure, Fitting, Solved, peak},
    sum,
};

use super::arx::{linear, out_of_range, rows, signals, taps, unsolved, with_past};
use super::enough;
use super::outcome::ProgramsOutcome;
use crate::Error;
use crate::data::Record;
use crate::model::Orders;
use demands::Demands;
pub use thetahat_numerics::regression::convex::Norm;

/// A noise bound that the data meet to this is met.
const BOUND_ROUNDING: f64 = 1e-9;
/// z of a two-sided 95 % interval, for the bandwidth of the sparsity.
const NORMAL_QUANTILE: f64 = 1.959_963_984_540_054;

/// A range that a parameter has to stay in, in its own units. Equal ends set its value, infinite ones are open.
///
/// ```
/// use thetahat::estimate::Bound;
///
/// let bound: Bound = "a1=-1.9..0".parse()?;
/// assert_eq!((bound.parameter.as_str(), bound.low, bound.high), ("a1", -1.9, 0.0));
/// assert_eq!("b1=..2".parse::<Bound>()?.low, f64::NEG_INFINITY);
/// assert_eq!("a2=0.5".parse::<Bound>()?.to_string(), "a2=0.5");
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Bound {
    /// The parameter, by its name in [`Orders::names`].
    pub parameter: String,
    /// The least value, or minus infinity.
    pub low: f64,
    /// The largest value, or infinity.
    pub high: f64,
}

/// A range for the static gain B_j(1)/A(1) from an input to the output, in units of y over units of u. Equal ends set
/// it.
///
/// ```
/// use thetahat::estimate::GainBound;
///
/// let gain: GainBound = "u1=1..3".parse()?;
/// assert_eq!((gain.input.as_deref(), gain.low, gain.high), (Some("u1"), 1.0, 3.0));
/// assert_eq!("2.5".parse::<GainBound>()?.input, None);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct GainBound {
    /// The input channel; none where the model has one input.
    pub input: Option<String>,
    /// The least gain, or minus infinity.
    pub low: f64,
    /// The largest gain, or infinity.
    pub high: f64,
}

/// What a fit of a model that is linear in its parameters makes small, and what it has to respect. For models with C, D
/// or F there is the norm inf alone: max |e| is then made small by a sequence of linear programs.
///
/// With e(t) = y(t) - phi(t)'theta over N samples, theta-hat minimises
///
/// ```text
/// norm 2:    sum e^2   + k sum (r_i theta_i)^2
/// norm 1:    sum |e|   + k sum (r_i theta_i)^2 / r_y
/// norm inf:  N max |e| + k sum (r_i theta_i)^2 / r_y
/// ```
///
/// under low <= theta_i <= high for each [`Bound`], low A(1) <= B_j(1) <= high A(1) and A(1) >= 0 for each
/// [`GainBound`] (only B_j(1) = G A(1) where the ends are equal), and |e(t)| <= E for all t with a noise bound E. A(1)
/// is positive for every stable model, so that the gain is then in its range; at A(1) = 0 there is none, and the range
/// is reported as active.
///
/// The ridge k counts samples: r_i is the RMS of the regressor of theta_i and r_y that of y, so that k has no unit,
/// does not depend on the units of the channels, and k = 1 weighs as one more sample for each parameter, in which its
/// regressor stands alone at its RMS and y is 0. k has to be compared with N.
///
/// For linear models all these are convex: there is one smallest value, and it is found. Norm 1 does not follow single
/// wild samples (Bloomfield and Steiger, Least Absolute Deviations, 1983); norm inf, and the set of all theta
/// with |e(t)| <= E, suit errors of known bound, such as those of a coarse converter (Milanese and Belforte, IEEE
/// Transactions on Automatic Control 27 (1982), who also bound the set by a box).
///
/// ```
/// use thetahat::estimate::{ConvexFit, Norm};
///
/// assert!(ConvexFit::default().is_plain());
/// let criterion = ConvexFit { norm: Norm::One, bounds: vec!["a1=-1..0".parse()?], ..ConvexFit::default() };
/// assert!(!criterion.is_plain());
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ConvexFit {
    /// Which norm of e is made small.
    pub norm: Norm,
    /// k, the weight of the sum of squared parameters, in samples. 0: none.
    pub ridge: f64,
    /// Ranges of parameters.
    pub bounds: Vec<Bound>,
    /// Ranges of static gains.
    pub dc_gain: Vec<GainBound>,
    /// E, the largest |e(t)| that is allowed, in units of y.
    pub noise_bound: Option<f64>,
    /// How to search where the model has C, D or F.
    pub search: Search,
}

/// What came of a [`ConvexFit`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ConvexOutcome {
    /// Which norm of e was made small.
    pub norm: Norm,
    /// The sum of |e|, the sum of e^2, or the largest |e|, without the ridge: in units of y, or of y squared.
    pub objective: f64,
    /// The weight of the sum of squared parameters, in samples.
    pub ridge: f64,
    /// The bounds and static gains of which the parameters stand at an end: without these the fit would be closer.
    pub active: Vec<String>,
    /// E, the largest |e(t)| that was allowed, in units of y.
    pub noise_bound: Option<f64>,
    /// With a noise bound: the least and the largest value of each parameter among all parameter vectors that respect
    /// everything asked for, in the order of the parameters.
    #[serde(rename = "box")]
    pub box_: Option<Vec<[f64; 2]>>,
    /// Steps of the interior point method; 0 where least squares alone respects all demands.
    pub iterations: u32,
    /// The sequence of linear programs; none where one program is enough.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<ProgramsOutcome>,
}

/// A fit under a [`ConvexFit`].
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Constrained {
    /// theta-hat, in the order of [`Orders::names`].
    pub(crate) parameters: Vec<f64>,
    /// Its covariance, where there is a theory of it; see [`constrained`].
    pub(crate) covariance: Option<Vec<Vec<f64>>>,
    /// The sum of e^2.
    pub(crate) sum_of_squares: f64,
    /// N, the samples that count.
    pub(crate) samples: usize,
    /// The condition number of the regressors, and of the rows that a ridge and equations add to them, their columns
    /// scaled to unit norm.
    pub(crate) condition: f64,
    pub(crate) outcome: ConvexOutcome,
}

impl ConvexFit {
    /// Whether this is least squares and nothing else.
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}=", self.parameter)?;
        write_range(f, self.low, self.high)
    }
}

impl FromStr for Bound {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let (parameter, range) =
            text.split_once('=').filter(|(name, _)| !name.is_empty()).ok_or_else(|| {
                Error::argument("bounds", format!("'{text}' is not of the form a1=-1.9..0, b1=0.. or a2=0.5"))
            })?;
        let (low, high) = read_range("bounds", text, range)?;
        Ok(Self { parameter: parameter.to_owned(), low, high })
    }
}

impl fmt::Display for GainBound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(input) = &self.input {
            write!(f, "{input}=")?;
        }
        write_range(f, self.low, self.high)
    }
}

impl FromStr for GainBound {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        // A channel's name may hold an equals sign, a number does not.
        let (input, range) = match text.rsplit_once('=') {
            Some(("", _)) => {
                return Err(Error::argument("dc-gain", format!("'{text}': the input's name is missing")));
            }
            Some((input, range)) => (Some(input.to_owned()), range),
            None => (None, text),
        };
        let (low, high) = read_range("dc-gain", text, range)?;
        Ok(Self { input, low, high })
    }
}

fn write_range(f: &mut fmt::Formatter<'_>, low: f64, high: f64) -> fmt::Result {
    if low == high {
        return f.write_str(&number(low));
    }
    if low > f64::NEG_INFINITY {
        f.write_str(&number(low))?;
    }
    f.write_str("..")?;
    if high < f64::INFINITY {
        f.write_str(&number(high))?;
    }
    Ok(())
}

/// The shortest digits of a number, without a row of zeros.
fn number(value: f64) -> String {
    if value == 0.0 || (1e-4..1e9).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") }
}

/// `low..high`, either end left out, or one number.
fn read_range(argument: &str, text: &str, range: &str) -> Result<(f64, f64), Error> {
    let read = |part: &str| {
        part.parse::<f64>().map_err(|_| {
            Error::argument(argument, format!("'{text}': '{part}' is not a number; write low..high"))
        })
    };
    let (low, high) = match range.split_once("..") {
        Some((low, high)) => (
            if low.is_empty() { f64::NEG_INFINITY } else { read(low)? },
            if high.is_empty() { f64::INFINITY } else { read(high)? },
        ),
        None => (read(range)?, read(range)?),
    };
    check_range(argument, text, low, high)?;
    Ok((low, high))
}

fn check_range(argument: &str, words: &str, low: f64, high: f64) -> Result<(), Error> {
    let wrong = if low.is_nan() || high.is_nan() {
        "an end is not a number"
    } else if low > high {
        "the low end is above the high one; swap them"
    } else if low == high && low.is_infinite() || low == f64::INFINITY || high == f64::NEG_INFINITY {
        "no finite value is in the range"
    } else if low.is_infinite() && high.is_infinite() {
        "both ends are open, so that it asks for nothing; leave it out"
    } else {
        return Ok(());
    };
    Err(Error::argument(argument, format!("{words}: {wrong}")))
}

/// Fits A(q) y(t) = sum_j B_j(q) u_j(t - nk_j) + e(t) under a [`ConvexFit`]. `inputs` are the names of the channels;
/// nothing is asked of the last inputs if they have none.
///
/// The covariance is, with sigma^2 = sum e^2 / (N - q) and q the number of parameters that the data determine
/// (p less the active demands; with a ridge the trace of M G):
///
/// - norm 2: sigma^2 M G M, G = Phi'Phi, M the inverse of G and the ridge in the directions along which the active
///   demands do not change, taken as known equations. Without a ridge and active demands this is sigma^2 (Phi'Phi)^-1.
/// - norm 1 without a ridge and active demands: s^2/4 (Phi'Phi)^-1 with the sparsity s = 1/f(0), f being the density of
///   e (Koenker and Bassett, Regression quantiles, Econometrica 46 (1978), section 4). s is the difference quotient of
///   the residuals' quantiles at 1/2 - h and 1/2 + h, h after Hall and Sheather, Journal of the Royal Statistical
///   Society B 50 (1988), for 95 % intervals.
/// - else there is none: with norm inf and noise bounds the error is not near normal.
///
/// Parameters are exact to rounding where the active rows can be told; bounds hold to the last bit, gains to rounding.
/// The same input gives the same bits, whatever the number of threads.
///
/// Cost: norm 2 O(N p) where least squares respects the demands, else 2 N p^2 flops and a program in p variables. Norm
/// 1 programs of some (N p)^(2/3) samples, norm inf and noise bounds of some 10 p samples, and O(N p) to find these;
/// the box 2 p programs.
///
/// # Errors
/// As for [`arx`](crate::estimate::arx); [`Error::Argument`] if an option makes no sense, or names what is not there;
/// [`Error::Data`] if the demands cannot hold together: it names as few of them as clash, and for a noise bound the
/// smallest that is possible.
pub(crate) fn constrained(
    record: &Record<'_>,
    inputs: &[String],
    orders: &Orders,
    presample: Presample,
    criterion: &ConvexFit,
) -> Result<Constrained, Error> {
    linear(orders)?;
    let signals = signals(record, orders)?;
    if inputs.len() > orders.inputs() {
        return Err(Error::argument(
            "inputs",
            format!("there are {} names for {} inputs; give one for each", inputs.len(), orders.inputs()),
        ));
    }
    let demands = Demands::new(criterion, inputs, orders)?;
    let segments = with_past(record, orders, presample);
    let lagged = Lagged::new(&signals, taps(orders), &segments, presample);
    enough(lagged.rows(), orders)?;
    let samples = lagged.rows();

    if criterion.norm == Norm::Two && criterion.ridge == 0.0 && criterion.noise_bound.is_none() {
        // Least squares may respect all that is asked for.
        let solved = lagged.solve();
        if let Ok(solved) = &solved
            && demands.hold(&solved.parameters)
        {
            let sum_of_squares = solved.residual_norm * solved.residual_norm;
            return Constrained {
                parameters: solved.parameters.iter().copied().collect(),
                covariance: Some(rows(&solved.covariance)),
                sum_of_squares,
                samples,
                condition: solved.condition,
                outcome: criterion.outcome(sum_of_squares),
            }
            .checked(solved.residual_norm);
        }
        if let (Err(why), []) = (solved, demands.limits.as_slice()) {
            return Err(unsolved(why, orders));
        }
    }

    let fitting = Fitting::new(&lagged, &demands.limits, criterion.ridge)
        .map_err(|why| open(why, criterion.ridge, orders))?;
    let contradictory = |some: &[usize]| {
        let limits = demands.limits_of(some);
        let infeasible = |fitting: Fitting<'_>| matches!(fitting.least_squares(), Err(Failure::Infeasible));
        !fitting.possible(&limits).unwrap_or(true)
            || Fitting::new(&lagged, &limits, criterion.ridge).is_ok_and(infeasible)
    };
    if !fitting.possible(&demands.limits).map_err(failed)?
        || matches!(fitting.least_squares(), Err(Failure::Infeasible))
    {
        let clash = demands.clash(contradictory);
        return Err(Error::data(format!(
            "infeasible: {} {}; widen or leave out one of them",
            demands.words_of(&clash),
            if clash.len() == 1 { "cannot hold" } else { "clash" }
        )));
    }
    // The set of a noise bound is one of the data alone.
    let bare = match criterion.noise_bound {
        Some(_) if criterion.ridge > 0.0 => {
            Some(Fitting::new(&lagged, &demands.limits, 0.0).map_err(|why| open(why, 0.0, orders))?)
        }
        _ => None,
    };
    let bare = bare.as_ref().unwrap_or(&fitting);
    let center = criterion.noise_bound.map(|bound| center(bare, &lagged, &demands, bound)).transpose()?;
    let within = center.as_ref().map(|center| (center.bound, &center.parameters));
    let Solved { mut parameters, mut iterations } = fitting.fit(criterion.norm, within).map_err(failed)?;

    let unit = (squares(&fitting.residuals(&parameters)) / samples as f64).sqrt();
    let active = demands.settle(&fitting, unit, &mut parameters);
    let residuals = fitting.residuals(&parameters);
    let sum_of_squares = squares(&residuals);
    let mut outcome = criterion.outcome(match criterion.norm {
        Norm::One => sum(residuals.iter().map(|e| e.abs())),
        Norm::Two => sum_of_squares,
        Norm::Infinity => peak(&residuals),
    });
    if let Some(center) = center {
        let (mut extents, steps) = bare.extents(center.bound, center.parameters).map_err(failed)?;
        demands.clamp(&mut extents);
        iterations += center.iterations + steps;
        outcome.box_ = Some(extents);
    }
    outcome.iterations = iterations;
    outcome.active = demands.words_at(&active);

    let plain = criterion.ridge == 0.0 && active.is_empty();
    let covariance = match criterion.norm {
        _ if criterion.noise_bound.is_some() => None,
        Norm::Two => {
            let (spread, determined) = fitting.spread_within(&active);
            Some(spread * (sum_of_squares / (samples as f64 - determined)))
        }
        Norm::One if plain => sparsity(&residuals, orders.parameters())
            .map(|sparsity| fitting.spread_within(&[]).0 * (sparsity * sparsity / 4.0)),
        Norm::One | Norm::Infinity => None,
    };
    Constrained {
        parameters: parameters.iter().copied().collect(),
        covariance: covariance.as_ref().map(rows),
        sum_of_squares,
        samples,
        condition: fitting.condition(),
        outcome,
    }
    .checked(peak(&residuals))
}

impl ConvexFit {
    /// An outcome in which nothing is active.
    pub(super) fn outcome(&self, objective: f64) -> ConvexOutcome {
        ConvexOutcome {
            norm: self.norm,
            objective,
            ridge: self.ridge,
            active: Vec::new(),
            noise_bound: self.noise_bound,
            box_: None,
            iterations: 0,
            search: None,
        }
    }
}

impl Constrained {
    /// Itself, unless the sum of squares or a variance has left the range of numbers.
    fn checked(self, largest: f64) -> Result<Self, Error> {
        let finite = |covariance: &Vec<Vec<f64>>| covariance.iter().flatten().all(|entry| entry.is_finite());
        let normal = largest == 0.0 || self.sum_of_squares.is_normal();
        if normal
            && self.covariance.as_ref().is_none_or(finite)
            && self.parameters.iter().all(|p| p.is_finite())
        {
            return Ok(self);
        }
        Err(out_of_range())
    }
}

/// Parameters that keep |e| as small as possible.
struct Center {
    parameters: DVector<f64>,
    /// The noise bound, raised to what is possible where rounding alone is between the two.
    bound: f64,
    iterations: u32,
}

/// The parameters of the smallest |e|, which has to be within `bound`.
fn center(
    fitting: &Fitting<'_>,
    lagged: &Lagged<'_>,
    demands: &Demands,
    bound: f64,
) -> Result<Center, Error> {
    let smallest = |fitting: &Fitting<'_>| -> Result<(Solved, f64, bool), Failure> {
        let fit = fitting.fit(Norm::Infinity, None)?;
        let least = peak(&fitting.residuals(&fit.parameters));
        let possible = least <= bound * (1.0 + BOUND_ROUNDING) + fitting.rounding(&fit.parameters);
        Ok((fit, least, possible))
    };
    let (Solved { parameters, iterations }, least, possible) = smallest(fitting).map_err(failed)?;
    if possible {
        return Ok(Center { parameters, bound: bound.max(least), iterations });
    }
    // What cannot be solved without a demand does not prove that the rest is impossible.
    let clash = demands.clash(|some| {
        let limits = demands.limits_of(some);
        let solved = Fitting::new(lagged, &limits, 0.0).ok().and_then(|fitting| smallest(&fitting).ok());
        solved.is_some_and(|(_, _, possible)| !possible)
    });
    let (with, change) = if clash.is_empty() {
        (String::new(), "")
    } else {
        (format!(" with {}", demands.words_of(&clash)), ", or widen these")
    };
    Err(Error::data(format!(
        "infeasible: no parameters keep |e| <= {}{with}: the smallest possible bound is {}; allow that much{change}",
        number(bound),
        rounded_up(least)
    )))
}

/// Four digits of a positive number, not below it.
fn rounded_up(value: f64) -> String {
    let exponent = value.log10().floor();
    let text = |digits: f64| {
        let rounded = format!("{digits:.0}e{}", exponent - 3.0).parse::<f64>().unwrap_or(value);
        number(rounded)
    };
    let digits = (value / 10_f64.powf(exponent - 3.0)).ceil();
    let shown = text(digits);
    // The quotient may have been rounded down.
    if shown.parse::<f64>().is_ok_and(|shown| shown < value) { text(digits + 1.0) } else { shown }
}

fn squares(residuals: &[f64]) -> f64 {
    sum(residuals.iter().map(|e| e * e))
}

/// s = 1/f(0) of the residuals, p of which are zero: the quotient of the difference of two quantiles and that of their
/// levels. None if more residuals are zero than between these levels.
pub(super) fn sparsity(residuals: &[f64], parameters: usize) -> Option<f64> {
    let count = residuals.len() as f64;
    let density = 1.5 / (2.0 * std::f64::consts::PI);
    let bandwidth = count.powf(-1.0 / 3.0) * NORMAL_QUANTILE.powf(2.0 / 3.0) * density.cbrt();
    let bandwidth = bandwidth.max((parameters + 1) as f64 / count).min(0.5);
    let mut sorted = residuals.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let quantile = |level: f64| {
        let position = level * (count - 1.0);
        let low = position.floor();
        let high = sorted[position.ceil() as usize];
        sorted[low as usize] + (position - low) * (high - sorted[low as usize])
    };
    let sparsity = (quantile(0.5 + bandwidth) - quantile(0.5 - bandwidth)) / (2.0 * bandwidth);
    (sparsity > 0.0).then_some(sparsity)
}

/// Why parameters stay open, where a ridge should have helped.
fn open(why: Unsolved, ridge: f64, orders: &Orders) -> Error {
    match unsolved(why, orders) {
        Error::Undetermined { parameters, .. } if ridge > 0.0 => {
            let message = format!(
                "the data cannot tell {} from the other parameters, nor does a ridge of {}: their regressors are \
                 zero, or it is too small to be seen; excite the input, lower the orders, or raise it",
                parameters.join(", "),
                number(ridge)
            );
            Error::undetermined(parameters, message)
        }
        error => error,
    }
}

fn failed(failure: Failure) -> Error {
    match failure {
        Failure::Infeasible => Error::data(
            "infeasible: what is asked of the parameters cannot hold together; widen the bounds by a little more than rounding",
        ),
        Failure::Unsolved(word) => Error::data(format!(
            "the convex program was not solved ({word}); scale the channels towards one, or loosen the bounds"
        )),
    }
}
