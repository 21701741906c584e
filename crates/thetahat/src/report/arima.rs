//! Fits of seasonal ARIMA models.

#[cfg(test)]
mod tests;

use thetahat_numerics::optimize::{Monitor, Search};

use super::evaluate::evaluate;
use super::schema::{Estimation, Report};
use super::shares::Shares;
use super::warnings::warnings;
use crate::Error;
use crate::data::{Log, Offset, Record, Rows, Source, Split};
use crate::estimate::{ArimaData, ArimaEstimate, Constant, Criteria, Procedure, arima};
use crate::model::{
    ArimaFactors, ArimaOrders, Orders, Parameter, PolynomialModel, Signal, polynomial::product,
};
use crate::respond::arima::ArimaOnLog;
use crate::select::Focus;
use crate::validate::Part;

/// The covariance matrix of more coefficients than this would be most of a report, and is left out: that of the
/// parameters says the same.
const MOST: usize = 200;

/// What seasonal ARIMA model to fit, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct ArimaPlan {
    /// The inputs, if there are any.
    pub inputs: Vec<String>,
    /// The output.
    pub output: String,
    /// (p, d, q)(P, D, Q, s).
    pub orders: ArimaOrders,
    /// The delay of each input in samples; 0: it acts in the same row.
    pub delays: Vec<usize>,
    /// Rows to estimate on; none: all.
    pub estimate: Vec<Rows>,
    /// Rows to validate on.
    pub validate: Vec<Rows>,
    /// Cuts the rows to estimate on into parts: the fit is to the first two, and evaluated on the third.
    pub split: Option<Split>,
    /// Whether the output has a level that is estimated: auto if it is not differenced.
    pub constant: Constant,
    /// Whether the output has a slope that is estimated.
    pub trend: bool,
    /// How to search; `starts` and `plant_first` do not apply.
    pub search: Search,
}

impl ArimaPlan {
    /// A plan for all rows, with the other choices at their defaults.
    pub fn new(inputs: &[&str], output: &str, orders: ArimaOrders) -> Self {
        Self {
            inputs: inputs.iter().map(|&name| name.to_owned()).collect(),
            output: output.to_owned(),
            orders,
            delays: vec![0; inputs.len()],
            estimate: Vec::new(),
            validate: Vec::new(),
            split: None,
            constant: Constant::Auto,
            trend: false,
            search: Search::default(),
        }
    }

    /// Whether the plan makes sense, whatever the log.
    ///
    /// # Errors
    /// [`Error::Argument`] for a constant or a trend that differencing takes, delays that are not one for each input,
    /// and a model without any parameter of its noise or its inputs.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let integrations = self.orders.integrations();
        if self.constant == Constant::Yes && integrations > 0 {
            return Err(Error::argument(
                "constant",
                "differencing takes it; leave it out, or give `trend` for the drift of an output that is differenced once",
            ));
        }
        if self.trend && integrations > 1 {
            return Err(Error::argument(
                "trend",
                "differencing more than once takes it; leave it out, or lower d or D",
            ));
        }
        if !self.delays.is_empty() && self.delays.len() != self.inputs.len() {
            return Err(Error::argument(
                "nk",
                format!(
                    "{} numbers for {} inputs; give one for all or one for each",
                    self.delays.len(),
                    self.inputs.len()
                ),
            ));
        }
        if self.inputs.is_empty() && self.orders.parameters() == 0 && integrations == 0 {
            return Err(Error::argument(
                "order",
                "0,0,0 is white noise about a constant: there is no model to fit; raise p, d or q, or name `input`",
            ));
        }
        Ok(())
    }

    fn has_constant(&self) -> bool {
        self.orders.integrations() == 0 && self.constant != Constant::No
    }

    /// The output with a column for each weight, in the rows in which all of these have values.
    fn data<'l>(&self, log: &Log, record: &Record<'l>) -> ArimaData<'l> {
        let rows = record.output.len();
        let mut columns = Vec::new();
        if self.has_constant() {
            columns.push(vec![1.0; rows]);
        }
        if self.trend {
            columns.push(log.logs().flat_map(|log| (0..log.len()).map(|row| row as f64)).collect());
        }
        let longest = self.delays.iter().copied().max().unwrap_or(0);
        for (input, delay) in record.inputs.iter().zip(&self.delays) {
            let mut column = vec![f64::NAN; (*delay).min(rows)];
            column.extend_from_slice(&input[..rows - column.len()]);
            columns.push(column);
        }
        let after = record.segments.iter().zip(&record.past).map(|(segment, past)| {
            (segment.start + longest.saturating_sub(*past)).min(segment.end)..segment.end
        });
        let segments = after.filter(|segment| !segment.is_empty()).collect();
        let names = self.orders.all_names(self.has_constant(), self.trend, &self.delays);
        ArimaData { output: record.output, columns, segments, names }
    }
}

/// Finds a seasonal ARIMA model of an output by its exact likelihood, and reports on it.
///
/// ```text
/// y(t) = c + m t + sum_j b_j u_j(t - nk_j) + z(t)
/// phi(q) Phi(q^s) (1 - q^-1)^d (1 - q^-s)^D z(t) = theta(q) Theta(q^s) e(t)
///
/// phi(q) = 1 - ar1 q^-1 - …,   theta(q) = 1 + ma1 q^-1 + …,   Phi and Theta alike in q^-s
/// ```
///
/// The signs are those of Box and Jenkins for phi and of most programs today for theta. t counts rows from the first of
/// each log. Without differences c is estimated, the level in row 0; m, the drift for each row, where a trend is asked
/// for. With one difference m alone can be, and with two neither (as statsmodels' `ARIMA` has it).
///
/// The likelihood is that of the differences, which begin with their stationary covariance; it goes on through missing
/// outputs, once there have been d + s D measured ones in a row. The model is one of polynomials, y = B u + C/D e, of
/// which C and D are products; report and model name the parameters of their factors. Its noise variance is that of
/// largest likelihood, S/N, and its forecasts count what e does, not what parameters that are estimates do.
///
/// An iteration costs O(N m) for m = max(p + P s, q + Q s) where no output is missing, and O(N (m + d + s D)^2) in the
/// rows after a missing one until what was unknown has died away.
///
/// Source: Box and Jenkins, Time Series Analysis: Forecasting and Control, 1970, chapter 9; Harvey, Forecasting,
/// Structural Time Series Models and the Kalman Filter, 1989, sections 3.3 and 3.4; Pearlman, Biometrika 67 (1980).
///
/// # Errors
/// [`Error::Argument`] for options that do not go together, and rows that are not there; [`Error::Data`] if a channel
/// is not there or squares leave the range of numbers; [`Error::Undetermined`] for too few values, parameters that the
/// log does not determine, and an output without noise; [`Error::Interrupted`] if the monitor says so.
///
/// ```
/// use std::ops::ControlFlow;
/// use thetahat::data::{Channel, Log};
/// use thetahat::model::ArimaOrders;
/// use thetahat::report::{ArimaPlan, fit_arima};
///
/// // y(t) = y(t-1) + e(t) - 0.5 e(t-1)
/// let (mut random, mut before, mut level) = (1_u32, 0.0, 20.0);
/// let y = (0..400).map(|_| {
///     random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
///     let e = f64::from(random >> 8) / f64::from(1 << 23) - 1.0;
///     level += e - 0.5 * before;
///     before = e;
///     level
/// });
/// let log = Log::new(vec![Channel { name: "y".into(), values: y.collect() }], 1.0)?;
/// let plan = ArimaPlan::new(&[], "y", ArimaOrders::new([0, 1, 1], None)?);
/// let report = fit_arima(&log, &[], &plan, &|_| ControlFlow::Continue(()))?;
/// let [ma1] = report.model.parameters() else { panic!() };
/// assert_eq!(ma1.name, "ma1");
/// assert!((ma1.value + 0.5).abs() < 0.1);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn fit_arima(
    log: &Log,
    sources: &[Source],
    plan: &ArimaPlan,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    plan.check()?;
    let names: Vec<&str> = plan.inputs.iter().chain([&plan.output]).map(String::as_str).collect();
    names.iter().try_for_each(|name| log.channel(name).map(|_| ()))?;
    let shares = Shares::of(&plan.estimate, &plan.validate, plan.split, log.rows())?;
    let record = log.driven_record(&plan.inputs, &plan.output, &shares.estimation)?;
    let data = plan.data(log, &record);
    let found = arima(&data, &plan.orders, &plan.search, monitor)?;
    let model = model(plan, log.sample_time(), &data.names, &found)?;
    let segments = data.segments.iter().map(Rows::from_positions).collect();
    let data = shares.into_data((log, sources), &names, "none".to_owned(), segments)?;
    let mean = found.outcome.cost().unwrap_or(found.noise_variance);
    let estimation = Estimation {
        initial: None,
        level: None,
        slope: None,
        samples: found.samples,
        mse: found.noise_variance,
        criteria: Criteria::new(mean, found.parameters.len(), found.samples),
        condition: found.condition,
        procedure: Procedure::ExactLikelihood(found.outcome),
    };
    let mut report = Report::new(data, model.clone(), estimation);
    report.warnings = warnings(&report, &model);
    let own = log.deviations(
        model.inputs.iter().chain([&model.output]).map(|signal| (signal.name.as_str(), signal.offset)),
    )?;
    let Some(factors) = &model.factors else { return Ok(report) };
    let on_log = |rows: &[Rows]| ArimaOnLog::new(&model, factors, &own, rows);
    let fitted = on_log(&report.data.estimation)?;
    evaluate(&mut report, &fitted, Part::Estimation, Focus::Auto);
    for (part, rows) in report.data.held_out() {
        evaluate(&mut report, &on_log(&rows)?, part, Focus::Auto);
    }
    Ok(report.with_purpose())
}

/// The model of what was found: its factors multiplied out.
fn model(
    plan: &ArimaPlan,
    sample_time: f64,
    names: &[String],
    found: &ArimaEstimate,
) -> Result<PolynomialModel, Error> {
    let (orders, inputs) = (&plan.orders, plan.inputs.len());
    let lines = usize::from(plan.has_constant()) + usize::from(plan.trend);
    let (weights, own) = found.parameters.split_at(lines + inputs);
    let expanded = orders.expanded(own, true);
    let difference = orders.differencing();
    let d = product(&expanded.a, &difference);
    let of =
        Orders::new(0, &vec![1; inputs], expanded.c.len() - 1, d.len() - 1, &vec![0; inputs], &plan.delays)?;
    let values = [&weights[lines..], &expanded.c[1..], &d[1..]].concat();
    // How these follow from the parameters: inputs as they are, C and D to first order.
    let slope = |place: usize| -> Vec<f64> {
        let mut slope = vec![0.0; values.len()];
        match place.checked_sub(lines + inputs) {
            None => slope[place - lines] = 1.0,
            Some(place) => {
                let (a, c) = &expanded.slopes[place];
                let d = product(a, &difference);
                slope[inputs..inputs + c.len() - 1].copy_from_slice(&c[1..]);
                slope[inputs + c.len() - 1..].copy_from_slice(&d[1..]);
            }
        }
        slope
    };
    let covariance = found.covariance.as_ref().filter(|_| values.len() <= MOST).map(|covariance| {
        let slopes: Vec<Vec<f64>> = (lines..found.parameters.len()).map(slope).collect();
        let mut expanded = vec![vec![0.0; values.len()]; values.len()];
        for (i, left) in slopes.iter().enumerate() {
            for (j, right) in slopes.iter().enumerate() {
                let weight = covariance[lines + i][lines + j];
                for (row, left) in expanded.iter_mut().zip(left).filter(|(_, left)| **left != 0.0) {
                    row.iter_mut().zip(right).for_each(|(sum, right)| *sum += weight * left * right);
                }
            }
        }
        expanded
    });
    let model = PolynomialModel::from_parameters(
        &of,
        &values,
        covariance.as_deref(),
        found.noise_variance,
        sample_time,
    )?;
    let error = |place: usize| {
        found.covariance.as_ref().filter(|_| !found.held[place]).map(|rows| rows[place][place].sqrt())
    };
    let parameters = names
        .iter()
        .zip(&found.parameters)
        .enumerate()
        .map(|(place, (name, &value))| Parameter { name: name.clone(), value, standard_error: error(place) });
    let constant = if plan.has_constant() { weights[0] } else { 0.0 };
    let drift = if plan.trend { weights[lines - 1] } else { 0.0 };
    let signal = |name: &String, offset| Signal { name: name.clone(), offset };
    let model = PolynomialModel {
        inputs: plan.inputs.iter().map(|name| signal(name, Offset::default())).collect(),
        output: signal(&plan.output, Offset { level: constant, slope: drift / sample_time }),
        factors: Some(ArimaFactors {
            orders: *orders,
            parameters: parameters.collect(),
            covariance: found.covariance.clone(),
        }),
        ..model
    };
    model.check()?;
    Ok(model)
}
