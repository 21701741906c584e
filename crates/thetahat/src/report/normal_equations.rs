//! One model from many pieces of the data.

mod border;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use faer::fx128;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Plan;
use super::fitted_rows::estimation_start;
use super::identify::{ROUNDING, channels, constant, estimation_of, estimation_rows};
use super::schema::{Data, Missing, Report};
use super::warnings::warnings;
use crate::data::{Detrend, Log, Offset, Rows, Source, digests};
use crate::estimate::{
    Constant, Fitted, Initial, Kernel, LinearProblem, Method, lagged_products, out_of_range, taps,
};
use crate::model::{Orders, Signal};
use crate::regression::{ExtendedGram, extended_sum};
use crate::respond::Horizon;
use crate::select::Choice;
use crate::validate::{Fit, Part};
use crate::{Document, Error};
use border::Border;

/// The normal equations of a model that is linear in its parameters: made from a piece of the data, added to those of other pieces,
/// solved at the end. The JSON document `thetahat.normal-equations/1`.
///
/// ```text
/// S = sum_t r(t) r(t)',   r(t) = [1, y(t) … y(t-na), u_1(t-nk) …]'
/// ```
///
/// and the sums of each channel hold all that a fit by least squares asks of the data: parameters and their covariance, the noise
/// variance, the offsets that are taken from the channels (means that are known at the end only), whether a constant is worth its
/// parameter, the fit one step ahead. So ARX and AR models, and impulse responses with a kernel or without, come out as
/// [`identify`](super::identify()) finds them on the joined log.
///
/// Sums are in twice the precision, 32 digits, of which a condition number kappa takes 2 log10(kappa): parameters are exact to
/// eps + 1e-29 kappa^2 (measured: 4e-16 up to kappa = 1e6), in whatever order pieces are merged. The difference to a fit in one pass is
/// what rounding does to that: at most 4 eps (kappa + kappa^2 |r|/|theta|), see [`arx`](crate::estimate::arx).
///
/// Pieces of one log overlap: a piece begins with as many rows of the one before it as the model reaches back to ([`lags`](Self::lags))
/// at least, which say nothing by themselves (`past`). They are compared with the rows that came before when pieces are merged.
/// Experiments have no past. Gaps in a piece, and missing samples, are gaps as in a log.
///
/// Cost: O(N p) time for N rows and p parameters; O(p^2) memory, and a few numbers for each piece and gap.
///
/// Source: Björck, Numerical Methods for Least Squares Problems, 1996, section 2.2; the precision is told in `regression::extended`.
///
/// ```
/// use thetahat::data::{Channel, Log, Rows};
/// use thetahat::model::Orders;
/// use thetahat::report::{NormalEquations, Plan, identify};
///
/// let u: Vec<f64> = (0..400_u32).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![20.0];
/// for t in 1..u.len() {
///     y.push(20.0 + 0.8 * (y[t - 1] - 20.0) + 0.5 * u[t - 1] + 0.01 * f64::from(t as u32 * 11 % 13));
/// }
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
/// let plan = Plan::new(&["u"], "y", Orders::arx(2, &[2], &[1])?);
///
/// // Rows 1 to 150, and from 151 on: the second piece begins with two rows of the first.
/// let mut first = NormalEquations::new(&log.part(&["u", "y"], Rows::new(1, 150)?)?, &[], &plan, 0)?;
/// let second = NormalEquations::new(&log.part(&["u", "y"], Rows::new(149, 400)?)?, &[], &plan, 2)?;
/// first.merge(&second)?;
/// let (merged, whole) = (first.solve()?, identify(log, &[], &plan)?);
/// for (one, other) in merged.model.parameters().iter().zip(whole.model.parameters()) {
///     assert!((one.value - other.value).abs() < 1e-12);
/// }
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NormalEquations {
    /// `thetahat.normal-equations/1`.
    schema: String,
    settings: Settings,
    /// Seconds from one row to the next.
    sample_time: f64,
    /// The sums of r r'.
    products: ExtendedGram,
    /// Of each channel, the inputs first.
    channels: Vec<Totals>,
    /// The rows of all pieces, those of the past among them; and which of them are no past.
    rows: usize,
    estimation: Vec<Rows>,
    segments: Vec<Rows>,
    time_gaps: usize,
    logs: Vec<Source>,
    digests: Vec<BTreeMap<String, String>>,
    border: Border,
}

/// What all pieces have in common.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
struct Settings {
    inputs: Vec<String>,
    output: String,
    orders: Orders,
    /// `mean` or `none`.
    detrend: String,
    /// Channels whose offset is set by hand.
    offsets: Vec<(String, f64)>,
    constant: Constant,
    /// That of a regularised impulse response.
    kernel: Option<Kernel>,
}

/// What is known of the values of a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
struct Totals {
    /// Samples that count for the mean; none of the past.
    rows: usize,
    /// Their sum, and what that number lacks.
    sum: [f64; 2],
    /// The least and the largest of them; none where there is none.
    range: Option<[f64; 2]>,
    missing: usize,
}

impl NormalEquations {
    /// Those of a piece of the data, of which the first `past` rows are of the piece before it.
    ///
    /// The plan says inputs, output, orders, offsets and constant as for [`identify`](super::identify()); it gives the method too, the
    /// default or [`Method::Regularised`].
    ///
    /// # Errors
    /// [`Error::Argument`] for a plan that asks for more than least squares on all rows, and a past that is shorter than
    /// [`lags`](Self::lags) or is the whole piece; [`Error::Data`] for a channel that is not there, and if squares leave the range of
    /// numbers.
    pub fn new(log: &Log, sources: &[Source], plan: &Plan, past: usize) -> Result<Self, Error> {
        let settings = Settings::of(plan)?;
        let names = channels(log, plan)?;
        log.check_uniform()?;
        let (orders, rows) = (&settings.orders, log.rows());
        let lags = orders.maximum_lag();
        if past > 0 && past < lags {
            return Err(Error::argument(
                "past",
                format!(
                    "{past} rows are fewer than the {lags} that the model reaches back to; let pieces overlap by {lags} rows, or give 0 for \
                     an experiment of its own"
                ),
            ));
        }
        if past >= rows {
            return Err(Error::argument(
                "past",
                format!(
                    "all {rows} rows of the piece are of the one before it: it has none of its own; cut longer pieces"
                ),
            ));
        }
        let estimation = vec![Rows::new(past + 1, rows)?];
        let segments = log.segments(&names, &estimation)?;
        let record = estimation_rows(log, plan, orders, &estimation)?;
        let products = lagged_products(&record, orders)?;
        let totals = names.iter().map(|name| {
            let values = &log.channel(name)?.values;
            let own = if *name == plan.output { &segments } else { &record.segments };
            let sums = own.iter().map(|rows| extended_sum(&values[rows.clone()]));
            let sum = sums.fold(fx128::ZERO, fx128::add_accurate);
            let each = || own.iter().flat_map(|rows| &values[rows.clone()]).copied();
            let range = each().fold(None, |range: Option<[f64; 2]>, value| {
                let [least, largest] = range.unwrap_or([value; 2]);
                Some([least.min(value), largest.max(value)])
            });
            let missing = values[past..].iter().filter(|value| value.is_nan()).count();
            Ok(Totals { rows: own.iter().map(|rows| rows.len()).sum(), sum: [sum.0, sum.1], range, missing })
        });
        Ok(Self {
            schema: Self::SCHEMA.to_owned(),
            sample_time: log.sample_time(),
            products,
            channels: totals.collect::<Result<_, Error>>()?,
            rows,
            segments: record.segments.iter().map(Rows::from_positions).collect(),
            time_gaps: log
                .segment_starts()
                .iter()
                .filter(|start| **start >= past && !log.boundaries().contains(start))
                .count(),
            logs: sources.to_vec(),
            digests: digests(log, &names, &estimation)?,
            border: Border::new(log, &names, past, lags)?,
            estimation,
            settings,
        })
    }

    /// Adds those of the pieces that come after these. O(p^2).
    ///
    /// # Errors
    /// After which nothing has changed. [`Error::Argument`] if they are of other channels, orders or settings; [`Error::Data`] if a
    /// piece is among both, the sample times differ by more than 1 %, the past of the others is not what these end with, or their
    /// clock goes back.
    pub fn merge(&mut self, other: &Self) -> Result<(), Error> {
        self.settings.check_same(&other.settings)?;
        if (other.sample_time / self.sample_time - 1.0).abs() > 0.01 {
            return Err(Error::data(format!(
                "the second pieces have a sample time of {} s, the first ones of {} s; resample one of them",
                other.sample_time, self.sample_time
            )));
        }
        let file = |of: &Self, place: usize| {
            let log = of.logs.get(place).filter(|_| of.logs.len() == of.digests.len());
            log.map(|log| log.file.clone())
        };
        // Under another name the same values are those of a plant that rests.
        let twice = |place: &usize| {
            let (digests, called) = (&other.digests[*place], file(other, *place));
            let known = |(own, known): (usize, &BTreeMap<String, String>)| {
                known == digests
                    && file(self, own).is_none_or(|own| called.as_ref().is_none_or(|file| *file == own))
            };
            !digests.is_empty() && self.digests.iter().enumerate().any(known)
        };
        if let Some(place) = (0..other.digests.len()).find(twice) {
            let called = file(other, place)
                .map_or_else(|| format!("number {}", place + 1), |file| format!("'{file}'"));
            return Err(Error::data(format!(
                "a piece is given twice: {called} of the second ones is among the first ones already; merge each piece once"
            )));
        }
        let lags = self.settings.orders.maximum_lag();
        let border = self.border.joined(&other.border, lags, &self.settings.names())?;
        let rows = self.rows.checked_add(other.rows).ok_or_else(|| Error::data("there are too many rows"))?;
        let later = |more: &[Rows]| -> Result<Vec<Rows>, Error> {
            more.iter().map(|more| Rows::new(more.first() + self.rows, more.last() + self.rows)).collect()
        };
        let (estimation, segments) = (later(&other.estimation)?, later(&other.segments)?);
        let logs = other.logs.iter().map(|log| {
            let rows = later(&[log.rows])?.remove(0);
            Ok(Source { rows, ..log.clone() })
        });
        let logs = logs.collect::<Result<Vec<_>, Error>>()?;
        // From here on nothing fails.
        self.products.merge(&other.products);
        self.channels.iter_mut().zip(&other.channels).for_each(|(own, more)| own.add(more));
        self.rows = rows;
        self.estimation.extend(estimation);
        self.segments.extend(segments);
        self.time_gaps += other.time_gaps;
        self.logs.extend(logs);
        self.digests.extend(other.digests.iter().cloned());
        self.border = border;
        Ok(())
    }

    /// The model, with the figures that need no second pass over the data: of its fit, that one step ahead on the rows of the fit.
    ///
    /// # Errors
    /// As for [`identify`](super::identify()): [`Error::Undetermined`] if the data cannot determine the parameters, which are named.
    pub fn solve(&self) -> Result<Report, Error> {
        let Settings { inputs, output, orders, kernel, .. } = &self.settings;
        let names = self.settings.names();
        let offsets =
            (0..names.len()).map(|channel| self.offset(channel)).collect::<Result<Vec<_>, Error>>()?;
        // y is the first signal of a regression.
        let (taken, of_inputs) = offsets.split_last().ok_or_else(|| Error::data("there is no output"))?;
        let of_signals: Vec<f64> = std::iter::once(taken).chain(of_inputs).copied().collect();
        let products = self.products.less(&taps(orders), &of_signals);
        if !products.is_in_range() {
            return Err(out_of_range());
        }
        let problem = LinearProblem { orders, sample_time: self.sample_time, kernel: *kernel, products };
        let mut fitted = problem.fit(self.settings.constant)?;
        if fitted.offset.is_none() && self.settings.takes_output_offset() {
            fitted.open = problem.left_open(&fitted.estimate);
        }
        let Fitted { estimate, offset, open, .. } = &fitted;
        let level = |level: f64| Offset { level, slope: 0.0 };
        let signal = |(name, offset): (&String, &f64)| Signal { name: name.clone(), offset: level(*offset) };
        let found = offset.map_or(0.0, |found| found.offset.level);
        let signals = inputs.iter().zip(of_inputs).map(signal).collect();
        let mut model = estimate.to_model(orders, self.sample_time, signals, signal((output, taken)))?;
        model.offset_covariance.clone_from(open);
        model.output.offset.level = taken + found;
        let missing = names.iter().zip(&self.channels);
        let mut report = Report {
            schema: Report::SCHEMA.to_owned(),
            generator: concat!("thetahat ", env!("CARGO_PKG_VERSION")).to_owned(),
            data: Data {
                logs: self.logs.clone(),
                digests: self.digests.clone(),
                rows: self.rows,
                sample_time: self.sample_time,
                detrend: self.settings.detrend.clone(),
                prefilter: None,
                estimation: self.estimation.clone(),
                validation: Vec::new(),
                split: None,
                segments: self.segments.clone(),
                missing: missing
                    .map(|(name, totals)| Missing { channel: (*name).to_owned(), rows: totals.missing })
                    .collect(),
                time_gaps: self.time_gaps,
            },
            selection: None,
            estimation: estimation_of(&fitted, level(*taken)),
            fit: Vec::new(),
            warnings: Vec::new(),
            model: model.clone().into(),
        };
        report.warnings = warnings(&report, &model);
        let finite = |figure: f64| Some(figure).filter(|figure| figure.is_finite());
        let (samples, mse) = (fitted.estimate.samples(), fitted.estimate.mse());
        report.fit.push(Fit {
            output: output.clone(),
            rows: self.estimation.clone(),
            part: Some(Part::Estimation),
            horizon: Horizon::Steps { steps: 1 },
            initial: estimation_start(&report, &model),
            samples,
            percent: finite(100.0 * (1.0 - (mse * samples as f64).sqrt() / problem.output_spread())),
            rmse: finite(mse.sqrt()),
            mean_absolute_error: None,
            largest_error: None,
            outside: None,
        });
        Ok(report)
    }

    /// How many rows a piece has to begin with that are of the piece before it: as many as the model reaches back to.
    pub fn lags(&self) -> usize {
        self.settings.orders.maximum_lag()
    }

    /// The rows of all pieces, without those of the past.
    pub fn rows(&self) -> usize {
        self.estimation.iter().map(Rows::len).sum()
    }

    /// N: the rows that have a full regressor.
    pub fn samples(&self) -> usize {
        self.products.rows()
    }

    /// The number of pieces.
    pub fn pieces(&self) -> usize {
        self.estimation.len()
    }

    /// The orders of the model.
    pub fn orders(&self) -> &Orders {
        &self.settings.orders
    }

    /// The names of the channels, the output last.
    pub fn channels(&self) -> Vec<&str> {
        self.settings.names()
    }

    /// What is taken from a channel.
    fn offset(&self, channel: usize) -> Result<f64, Error> {
        let (names, totals) = (self.settings.names(), &self.channels[channel]);
        let name = names[channel];
        let Some([least, largest]) = totals.range else {
            return Err(Error::data(
                "no row of the pieces has a value in every channel; give other pieces or channels",
            ));
        };
        let [sum, rest] = totals.sum;
        let by_hand = self.settings.offsets.iter().find(|(channel, _)| channel == name);
        let level = match by_hand {
            Some((_, level)) => *level,
            None if self.settings.detrend == Detrend::None.to_string() => 0.0,
            None => {
                let sum = fx128::from_f64(sum).add_accurate(fx128::from_f64(rest));
                (sum / fx128::from_f64(totals.rows as f64)).0
            }
        };
        let orders = &self.settings.orders;
        let input = (channel < orders.inputs()).then_some(channel);
        let used = input.is_none_or(|input| orders.nb[input] > 0);
        let size = |least: f64, largest: f64| least.abs().max(largest.abs());
        if used && size(least - level, largest - level) <= ROUNDING * size(least, largest) {
            return Err(constant(name, input, Some(orders), false));
        }
        Ok(level)
    }
}

impl Document for NormalEquations {
    const NAME: &'static str = "document of normal equations";
    const SCHEMA: &'static str = "thetahat.normal-equations/1";
    const REMEDY: &'static str = "give one that a piece was made into";

    fn check(&self) -> Result<(), Error> {
        let Settings { inputs, orders, detrend, offsets, .. } = &self.settings;
        // What indexes anything is checked here.
        let Orders { na, nb, nc, nd, nf, nk } = orders;
        let fits = Orders::new(*na, nb, *nc, *nd, nf, nk).is_ok()
            && orders.is_linear()
            && orders.inputs() == inputs.len()
            // One and y(t) beside the regressors.
            && self.products.size() == orders.parameters() + 2
            && self.channels.len() == inputs.len() + 1
            && self.channels.iter().all(|totals| totals.sum.iter().all(|value| value.is_finite()))
            && self.sample_time.is_finite()
            && self.sample_time > 0.0
            && !self.estimation.is_empty()
            && self.estimation.iter().chain(&self.segments).all(|rows| rows.last() <= self.rows)
            && matches!(detrend.parse(), Ok(Detrend::Mean | Detrend::None))
            && offsets.iter().all(|(_, level)| level.is_finite())
            && self.border.fits(inputs.len() + 1);
        if fits {
            Ok(())
        } else {
            Err(Error::report("the parts of these normal equations do not fit together; make them again"))
        }
    }
}

impl Totals {
    fn add(&mut self, other: &Self) {
        let whole = |[sum, rest]: [f64; 2]| fx128::from_f64(sum).add_accurate(fx128::from_f64(rest));
        let sum = whole(self.sum).add_accurate(whole(other.sum));
        self.sum = [sum.0, sum.1];
        self.rows += other.rows;
        self.missing += other.missing;
        self.range = match (self.range, other.range) {
            (Some([a, b]), Some([c, d])) => Some([a.min(c), b.max(d)]),
            (own, more) => own.or(more),
        };
    }
}

impl Settings {
    fn of(plan: &Plan) -> Result<Self, Error> {
        plan.check()?;
        let Choice::Known(orders) = &plan.choice else {
            return Err(Error::argument("orders", "pieces of a log make one model; give its orders"));
        };
        if !orders.is_linear() {
            return Err(Error::argument(
                "orders",
                "a model with C, D or F is found by a search, which reads the data again and again; from pieces come models with A and B",
            ));
        }
        let kernel = match plan.method {
            Method::PredictionError(_) => None,
            Method::Regularised(kernel) => Some(kernel),
            _ => {
                return Err(Error::argument(
                    "method",
                    "normal equations give least squares; leave the other method or criterion out",
                ));
            }
        };
        let parts = !(plan.estimate.is_empty() && plan.validate.is_empty()) || plan.split.is_some();
        let refused = [
            (
                parts,
                "rows",
                "all rows of a piece serve for the fit; cut the pieces, and validate the model on other ones",
            ),
            (
                plan.prefilter.is_some(),
                "prefilter",
                "a filter reaches over the borders of pieces; filter the signals before",
            ),
            (
                plan.trend,
                "trend",
                "pieces have no common line; leave it out, or take the trend from the signals before",
            ),
            (
                matches!(plan.initial, Initial::Zero | Initial::Estimate),
                "initial",
                "rows without a full regressor are left out; give drop, or leave it out",
            ),
            (
                !matches!(plan.detrend, Detrend::Mean | Detrend::None),
                "detrend",
                "what is taken from the channels of all pieces is their mean or nothing; give mean or none",
            ),
        ];
        if let Some((_, argument, message)) = refused.into_iter().find(|(refused, _, _)| *refused) {
            return Err(Error::argument(argument, message));
        }
        Ok(Self {
            inputs: plan.inputs.clone(),
            output: plan.output.clone(),
            orders: orders.clone(),
            detrend: plan.detrend.to_string(),
            offsets: plan.offsets.clone(),
            constant: plan.constant(),
            kernel,
        })
    }

    fn names(&self) -> Vec<&str> {
        self.inputs.iter().chain([&self.output]).map(String::as_str).collect()
    }

    fn takes_output_offset(&self) -> bool {
        self.detrend != Detrend::None.to_string()
            && !self.offsets.iter().any(|(name, _)| *name == self.output)
    }

    fn check_same(&self, other: &Self) -> Result<(), Error> {
        let differ = |message: String| Err(Error::argument("pieces", message));
        if self.names() != other.names() {
            return differ(format!(
                "the first ones have the channels {}, the second ones {}; make all of the same",
                self.names().join(", "),
                other.names().join(", ")
            ));
        }
        if self.orders != other.orders {
            return differ(format!(
                "the first ones are of {}, the second ones of {}; make all with the same orders",
                self.orders, other.orders
            ));
        }
        if self != other {
            return differ(
                "they were made with other offsets, another constant, or another kernel; make all with the same settings".to_owned(),
            );
        }
        Ok(())
    }
}
