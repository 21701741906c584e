//! One model from many pieces of the data.

mod boundary;
mod linear;
mod nonlinear_arx;
mod settings;
mod states;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_numerics::regression::ExtendedGram;

use super::Plan;
use super::from_sums::one_step;
use super::identify::{channels, estimation_rows};
use super::nonlinear_arx::NonlinearArxPlan;
use super::schema::{Data, Missing, Report};
use super::state_space::StateSpacePlan;
use super::totals::Totals;
use crate::data::{Log, Record, Rows, Source, digests};
use crate::document::document_methods;
use crate::estimate::{SegmentStart, joint_products, joint_taps, lagged_products};
use crate::respond::InitialCondition;
use crate::validate::Fit;
use crate::{Document, Error};
use boundary::Boundary;
use nonlinear_arx::{Centred, Products, Summed, summed};
use settings::{Kind, Settings};

/// The normal equations of a model that is linear in its parameters: made from a piece of the data, added to those of
/// other pieces, solved at the end. The JSON document `thetahat.normal-equations/1`.
///
/// ```text
/// S = sum_t r(t) r(t)',   r(t) = [1, y(t) … y(t-na), u_1(t-nk) …]'
/// ```
///
/// and the sums of each channel hold all that a fit by least squares asks of the data: parameters and their covariance,
/// the noise variance, the offsets that are taken from the channels (means that are known at the end only), whether a
/// constant is worth its parameter, the fit one step ahead. So ARX and AR models, and impulse responses with a kernel
/// or without, come out as [`identify`](super::identify()) finds them on the joined log. ARX models with several
/// outputs and state-space models ([`of_states`](Self::of_states)), and nonlinear ARX models of products
/// ([`of_nonlinear_arx`](Self::of_nonlinear_arx)) have sums of the same kind.
///
/// Sums are in twice the precision, 32 digits, of which a condition number kappa takes 2 log10(kappa): parameters are
/// exact to eps + 1e-29 kappa^2 (measured: 4e-16 up to kappa = 1e6), in whatever order pieces are merged. The
/// difference to a fit in one pass is what rounding does to that: at most 4 eps (kappa + kappa^2 |r|/|theta|), see
/// [`arx`](crate::estimate::arx).
///
/// Pieces of one log overlap: a piece begins with as many rows of the one before it as the model reaches back to
/// ([`lags`](Self::lags)) at least, which say nothing by themselves (`past`). They are compared with the rows that came
/// before when pieces are merged. Experiments have no past. Gaps in a piece, and missing samples, are gaps as in a log.
///
/// Cost: O(N p) time for N rows and p parameters; O(p^2) memory, and a few numbers for each piece and gap.
///
/// Source: Björck, Numerical Methods for Least Squares Problems, 1996, section 2.2; the precision is told in
/// `regression::extended`.
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
    /// What these are about, where products are not of two signals alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    centred: Option<Centred>,
    /// The first samples of segments, of models whose lags the data choose.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    starts: Vec<SegmentStart>,
    /// Of each channel, the inputs first, expressions last.
    channels: Vec<Totals>,
    /// The rows of all pieces, those of the past among them; and which of them are no past.
    rows: usize,
    estimation: Vec<Rows>,
    segments: Vec<Rows>,
    time_gaps: usize,
    logs: Vec<Source>,
    digests: Vec<BTreeMap<String, String>>,
    border: Boundary,
}

/// A part of the data, of which the first `past` rows are of the part before it.
struct Piece<'l> {
    log: &'l Log,
    sources: &'l [Source],
    past: usize,
    /// The rows of its own.
    own: Vec<Rows>,
}

impl<'l> Piece<'l> {
    /// Of a model that reaches back to so many rows.
    fn new(log: &'l Log, sources: &'l [Source], past: usize, lags: usize) -> Result<Self, Error> {
        log.check_uniform()?;
        if past > 0 && past < lags {
            return Err(Error::argument(
                "past",
                format!(
                    "{past} rows are fewer than the {lags} that the model reaches back to; let pieces overlap by {lags} rows, or give 0 for \
                     an experiment of its own"
                ),
            ));
        }
        let rows = log.rows();
        if past >= rows {
            return Err(Error::argument(
                "past",
                format!(
                    "all {rows} rows of the piece are of the one before it: it has none of its own; cut longer pieces"
                ),
            ));
        }
        Ok(Self { log, sources, past, own: vec![Rows::new(past + 1, rows)?] })
    }

    /// The rows of its own in which all channels have a value, each segment with as many such rows before it as `lags`.
    fn with_past(record: &Record<'_>, lags: usize) -> Vec<Range<usize>> {
        let each = record.segments.iter().zip(&record.past);
        each.map(|(rows, past)| rows.start - lags.min(*past)..rows.end).collect()
    }

    /// The first `lags` samples of segments of which some are its own.
    fn starts(record: &Record<'_>, signals: &[&[f64]], lags: usize) -> Vec<SegmentStart> {
        let each = record.segments.iter().zip(&record.past).filter(|(_, past)| **past < lags);
        each.map(|(rows, past)| {
            let samples = rows.start - past..rows.end.min(rows.start - past + lags);
            let signals = signals.iter().map(|signal| signal[samples.clone()].to_vec()).collect();
            SegmentStart { past: *past, signals }
        })
        .collect()
    }
}

impl NormalEquations {
    /// Those of a piece of the data, of which the first `past` rows are of the piece before it.
    ///
    /// The plan says inputs, output, orders, offsets and constant as for [`identify`](super::identify()); it gives the
    /// method too, the default or [`Method::Regularised`](crate::estimate::Method::Regularised).
    ///
    /// # Errors
    /// [`Error::Argument`] for a plan that asks for more than least squares on all rows, and a past that is shorter
    /// than [`lags`](Self::lags) or is the whole piece; [`Error::Data`] for a channel that is not there, and if squares
    /// leave the range of numbers.
    pub fn new(log: &Log, sources: &[Source], plan: &Plan, past: usize) -> Result<Self, Error> {
        let settings = Settings::of(plan)?;
        let Kind::Linear { orders, .. } = &settings.kind else {
            return Err(Error::argument("orders", "they are not those of a model with one output"));
        };
        let names = channels(log, plan)?;
        let piece = Piece::new(log, sources, past, settings.lags())?;
        let measured = log.segments(&names, &piece.own)?;
        let record = estimation_rows(log, plan, orders, &piece.own)?;
        let products = lagged_products(&record, orders)?;
        let totals = Self::totals(&settings, &piece, (&record.segments, &measured))?;
        Self::made(settings, &piece, (products, None), totals, &record.segments)
    }

    /// Those of a state-space model, or an ARX model, with several outputs.
    ///
    /// The plan says the channels, [`arx`](StateSpacePlan::arx) or the options of a subspace method, delays, offsets
    /// and constant as for [`fit_state_space`](super::fit_state_space()). Products of all lags of all signals are the
    /// normal equations of every order: orders and coupling may be ranges, of which the least MDL chooses when the
    /// model is solved for. That is done as in a fit to the whole, in 16 digits: to eps kappa^2.
    ///
    /// The matrices of a subspace method are those of the whole too, the past that the least AIC chooses among them:
    /// the first samples of each segment are kept, as many as there are lags. What is not the same are its errors: they
    /// are those of samples that have its past and 10 more before them, and their predictor starts at the states that
    /// this past says, where the fit to the whole runs along each segment from the state that explains it best. So the
    /// noise covariance differs by some errors at the starts of segments, and the order of the least MDL may, where two
    /// are nearly as good. A search behind it would read the data again.
    ///
    /// # Errors
    /// As for [`new`](Self::new); [`Error::Argument`] for a search behind a subspace method, and a range of delays of
    /// an ARX model, whose models are of other rows.
    ///
    /// ```
    /// use thetahat::data::{Channel, Log, Rows};
    /// use thetahat::estimate::{VectorArxInputs, VectorArxOptions};
    /// use thetahat::report::{NormalEquations, StateSpacePlan, fit_state_space};
    ///
    /// let u: Vec<f64> = (0..400_u32).map(|t| f64::from(t * t % 7)).collect();
    /// let (mut y, mut z) = (vec![0.0; 400], vec![0.0; 400]);
    /// for t in 1..400 {
    ///     let noise = 0.01 * f64::from(t as u32 * 11 % 13);
    ///     y[t] = 0.8 * y[t - 1] + 0.5 * u[t - 1] + noise;
    ///     z[t] = 0.5 * z[t - 1] - 0.3 * y[t - 1] + noise * noise;
    /// }
    /// let channel = |name: &str, values| Channel { name: name.into(), values };
    /// let log = Log::new(vec![channel("u", u), channel("y", y), channel("z", z)], 0.1)?;
    /// let nb = VectorArxInputs::Alike(1..=2);
    /// let arx = VectorArxOptions { na: 1..=2, nb, coupling: None, delay: 0..=0, direct: false, constant: false };
    /// let plan = StateSpacePlan { arx: Some(arx), ..StateSpacePlan::new(&["u"], &["y", "z"]) };
    /// let (names, lags) = (["u", "y", "z"], plan.lags());
    /// let first = log.part(&names, Rows::new(1, 200)?)?;
    /// let second = log.part(&names, Rows::new(201 - lags, 400)?)?;
    /// let mut sums = NormalEquations::of_states(&first, &[], &plan, 0)?;
    /// sums.merge(&NormalEquations::of_states(&second, &[], &plan, lags)?)?;
    /// let (merged, whole) = (sums.solve()?.estimation, fit_state_space(&log, &[], &plan)?.estimation);
    /// assert!((merged.mse / whole.mse - 1.0).abs() < 1e-9 && merged.samples == whole.samples);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn of_states(
        log: &Log,
        sources: &[Source],
        plan: &StateSpacePlan,
        past: usize,
    ) -> Result<Self, Error> {
        let settings = Settings::of_states(plan)?;
        let (outputs, delays, lags) = match &settings.kind {
            Kind::VectorArx { outputs, delays, arx } => (outputs, delays, arx.longest(delays.len())),
            Kind::Subspace { outputs, delays, subspace, .. } => (outputs, delays, subspace.lags()),
            _ => return Err(Error::argument("arx", "the plan is of another model")),
        };
        let piece = Piece::new(log, sources, past, settings.lags())?;
        let [first, others @ ..] = outputs.as_slice() else {
            return Err(Error::argument("output", "there is none; name at least one"));
        };
        // Whatever is measured has to be there.
        let read: Vec<String> = others.iter().chain(&settings.inputs).cloned().collect();
        let record = log.record(&read, first, &piece.own)?;
        let signals: Vec<&[f64]> =
            std::iter::once(record.output).chain(record.inputs.iter().copied()).collect();
        let taps = joint_taps(delays, outputs.len(), lags);
        let segments = Piece::with_past(&record, settings.lags());
        let products = joint_products(&signals, taps, &segments)?;
        let totals = Self::totals(&settings, &piece, (&record.segments, &record.segments))?;
        let starts = match &settings.kind {
            Kind::Subspace { .. } => Piece::starts(&record, &signals, settings.lags()),
            _ => Vec::new(),
        };
        let made = Self::made(settings, &piece, (products, None), totals, &record.segments)?;
        Ok(Self { starts, ..made })
    }

    /// Those of a nonlinear ARX model of products with one output: those that are named,
    /// [`MapPlan::Products`](super::MapPlan::Products), or as many as are asked for, or have the least of an
    /// information criterion, of those up to a degree, [`MapPlan::Polynomial`](super::MapPlan::Polynomial). Forward
    /// regression needs no more than their sums.
    ///
    /// The plan says channels, lags, expressions, products, offsets and units as for
    /// [`fit_nonlinear_arx`](super::fit_nonlinear_arx()). The sums are of the products and of all parts of them about
    /// the means of the piece: so they can be moved to those of all pieces, which are known at the end, as are the
    /// standard deviations that signals are divided by. A product of a row is rounded as it is in a fit to the whole:
    /// parameters are exact to eps kappa. O(N M^2) time for M products and parts, 1000 at most.
    ///
    /// # Errors
    /// As for [`new`](Self::new); [`Error::Argument`] for functions whose centres, knots or weights are found from the
    /// samples, for products of which free runs say how many, and for several outputs.
    ///
    /// ```
    /// use thetahat::data::{Channel, Log, Rows};
    /// use thetahat::report::{MapPlan, NonlinearArxPlan, NormalEquations};
    ///
    /// // y(t) = 0.5 y(t-1) + u(t-1)^2, without noise.
    /// let u: Vec<f64> = (0..200_u32).map(|t| f64::from(t * t % 11) - 4.0).collect();
    /// let mut y = vec![0.0];
    /// for t in 1..u.len() {
    ///     y.push(0.5 * y[t - 1] + u[t - 1] * u[t - 1]);
    /// }
    /// let channel = |name: &str, values| Channel { name: name.into(), values };
    /// let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0)?;
    /// let terms = ["1", "y(k-1)", "u(k-1)", "u(k-1)^2"].map(str::to_owned).to_vec();
    /// let map = MapPlan::Products { terms };
    /// let plan = NonlinearArxPlan { map, raw_terms: true, ..NonlinearArxPlan::new(&["u"], &["y"]) };
    /// let first = log.part(&["u", "y"], Rows::new(1, 100)?)?;
    /// let second = log.part(&["u", "y"], Rows::new(101 - plan.lags(), 200)?)?;
    /// let mut sums = NormalEquations::of_nonlinear_arx(&first, &[], &plan, 0)?;
    /// sums.merge(&NormalEquations::of_nonlinear_arx(&second, &[], &plan, plan.lags())?)?;
    /// let report = sums.solve()?;
    /// let [_, past, _, square] = report.model.parameters() else { panic!("four terms") };
    /// assert!((past.value - 0.5).abs() < 1e-12 && (square.value - 1.0).abs() < 1e-12);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn of_nonlinear_arx(
        log: &Log,
        sources: &[Source],
        plan: &NonlinearArxPlan,
        past: usize,
    ) -> Result<Self, Error> {
        let settings = Settings::of_nonlinear_arx(plan)?;
        let products = Products::of(&settings)?;
        let piece = Piece::new(log, sources, past, settings.lags())?;
        let Summed { products, centred, totals, segments } = summed(&settings, &piece, &products)?;
        Self::made(settings, &piece, (products, Some(centred)), totals, &segments)
    }

    /// Of each channel, where the samples of these segments count for the offsets of inputs, and of outputs.
    fn totals(
        settings: &Settings,
        piece: &Piece<'_>,
        (of_inputs, of_outputs): (&[Range<usize>], &[Range<usize>]),
    ) -> Result<Vec<Totals>, Error> {
        let totals = settings.names().into_iter().enumerate().map(|(channel, name)| {
            let segments = if channel < settings.inputs.len() { of_inputs } else { of_outputs };
            Ok(Totals::of(&piece.log.channel(name)?.values, piece.past, segments))
        });
        totals.collect()
    }

    /// Of a piece with these segments.
    fn made(
        settings: Settings,
        piece: &Piece<'_>,
        (products, centred): (ExtendedGram, Option<Centred>),
        channels: Vec<Totals>,
        segments: &[Range<usize>],
    ) -> Result<Self, Error> {
        let Piece { log, sources, past, ref own } = *piece;
        let names = settings.names();
        Ok(Self {
            schema: Self::SCHEMA.to_owned(),
            sample_time: log.sample_time(),
            products,
            centred,
            starts: Vec::new(),
            channels,
            rows: log.rows(),
            segments: segments.iter().map(Rows::from_positions).collect(),
            time_gaps: log
                .segment_starts()
                .iter()
                .filter(|start| **start >= past && !log.boundaries().contains(start))
                .count(),
            logs: sources.to_vec(),
            digests: digests(log, &names, own)?,
            border: Boundary::new(log, &names, past, settings.lags())?,
            estimation: own.clone(),
            settings,
        })
    }

    /// Adds those of the pieces that come after these. O(p^2).
    ///
    /// # Errors
    /// After which nothing has changed. [`Error::Argument`] if they are of other channels, orders or settings;
    /// [`Error::Data`] if a piece is among both, the sample times differ by more than 1 %, the past of the others is
    /// not what these end with, or their clock goes back.
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
        let lags = self.lags();
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
        let about = match (&self.centred, &other.centred) {
            (Some(own), Some(others)) => {
                let sums = (&self.products, &other.products);
                Some(own.joined(others, &Products::of(&self.settings)?, sums))
            }
            _ => None,
        };
        // From here on nothing fails.
        match about {
            Some((centred, products)) => (self.centred, self.products) = (Some(centred), products),
            None => self.products.merge(&other.products),
        }
        self.channels.iter_mut().zip(&other.channels).for_each(|(own, more)| own.add(more));
        self.rows = rows;
        self.estimation.extend(estimation);
        self.segments.extend(segments);
        self.time_gaps += other.time_gaps;
        self.logs.extend(logs);
        self.digests.extend(other.digests.iter().cloned());
        self.starts.extend(other.starts.iter().cloned());
        self.border = border;
        Ok(())
    }

    /// The model, with the figures that need no second pass over the data: of its fit, that one step ahead on the rows
    /// of the fit.
    ///
    /// # Errors
    /// As for [`identify`](super::identify()) and [`fit_state_space`](super::fit_state_space()):
    /// [`Error::Undetermined`] if the data cannot determine the parameters, which are named.
    pub fn solve(&self) -> Result<Report, Error> {
        match &self.settings.kind {
            Kind::Linear { orders, kernel, .. } => linear::solve(self, orders, *kernel),
            Kind::VectorArx { delays, arx, .. } => states::arx(self, delays, arx),
            Kind::Subspace { delays, subspace, orders, .. } => {
                states::subspace(self, delays, subspace, orders.as_ref())
            }
            Kind::NonlinearArx { .. } => {
                let centred = self.centred.as_ref().ok_or_else(Self::damaged)?;
                nonlinear_arx::solve(self, centred)
            }
        }
    }

    /// How many rows a piece has to begin with that are of the piece before it: as many as the model reaches back to.
    pub fn lags(&self) -> usize {
        self.settings.lags()
    }

    /// The rows of all pieces, without those of the past.
    pub fn rows(&self) -> usize {
        self.estimation.iter().map(Rows::len).sum()
    }

    /// N: the rows that have a full regressor.
    pub fn samples(&self) -> usize {
        self.products.rows()
    }

    /// The number of pieces. Neighbours with the name of one file are one.
    pub fn pieces(&self) -> usize {
        let named = self.logs.len() == self.estimation.len();
        let same = |pair: &&[Source]| pair[0].file == pair[1].file && pair[0].file != Source::IN_MEMORY;
        self.estimation.len() - if named { self.logs.windows(2).filter(same).count() } else { 0 }
    }

    /// The model and its orders, such as ARX(2, 2, 1).
    pub fn name(&self) -> String {
        self.settings.kind.to_string()
    }

    /// The names of the outputs.
    pub fn outputs(&self) -> &[String] {
        self.settings.outputs()
    }

    /// The names of the channels, the outputs last.
    pub fn channels(&self) -> Vec<&str> {
        self.settings.names()
    }

    /// The least and the largest value of a channel.
    fn range(&self, channel: usize) -> Result<[f64; 2], Error> {
        self.channels[channel].range.ok_or_else(|| {
            Error::data("no row of the pieces has a value in every channel; give other pieces or channels")
        })
    }

    fn damaged() -> Error {
        Error::report("the parts of these normal equations do not fit together; make them again")
    }

    /// What is taken from a channel.
    fn offset(&self, channel: usize) -> Result<f64, Error> {
        self.range(channel)?;
        let told = self.settings.told_offset(self.settings.names()[channel]);
        Ok(told.unwrap_or_else(|| self.channels[channel].mean()))
    }

    /// What the model is fitted to.
    fn data(&self) -> Data {
        let missing = self.settings.names().into_iter().zip(&self.channels);
        Data {
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
                .map(|(name, totals)| Missing { channel: name.to_owned(), rows: totals.missing })
                .collect(),
            time_gaps: self.time_gaps,
        }
    }

    /// The figures one step ahead of an output with this norm about its mean, of errors with this mean square.
    fn one_step(
        &self,
        output: &str,
        (samples, mse): (usize, f64),
        spread: f64,
        initial: InitialCondition,
    ) -> Fit {
        one_step(output, &self.estimation, (samples, mse), spread, initial)
    }
}

impl Document for NormalEquations {
    const NAME: &'static str = "document of normal equations";
    const SCHEMA: &'static str = "thetahat.normal-equations/1";
    const REMEDY: &'static str = "give one that a piece was made into";

    document_methods!();

    fn check(&self) -> Result<(), Error> {
        let channels = self.settings.names().len();
        let centred = match (&self.settings.kind, &self.centred) {
            (Kind::NonlinearArx { .. }, Some(centred)) => {
                let of = |products: Products| centred.fits(self.channels.len(), &products);
                Products::of(&self.settings).is_ok_and(of)
            }
            (Kind::NonlinearArx { .. }, None) => false,
            (_, centred) => centred.is_none(),
        };
        let starts = match self.settings.kind {
            Kind::Subspace { .. } => self.starts.iter().all(|start| start.fits(channels, self.lags())),
            _ => self.starts.is_empty(),
        };
        let fits = self.settings.fits(self.products.size())
            && centred
            && starts
            && self.channels.len() == self.settings.all_names().len()
            && self.channels.iter().all(Totals::is_finite)
            && self.sample_time.is_finite()
            && self.sample_time > 0.0
            && !self.estimation.is_empty()
            && self.estimation.iter().chain(&self.segments).all(|rows| rows.last() <= self.rows)
            && self.border.fits(channels);
        if fits { Ok(()) } else { Err(Self::damaged()) }
    }
}
