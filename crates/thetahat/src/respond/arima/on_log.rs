//! A seasonal ARIMA model beside a log.

use std::ops::Range;
use std::sync::OnceLock;

use super::ArimaProcess;
use super::filter::Filter;
use crate::Error;
use crate::data::{Log, Record, Rows, measured};
use crate::model::{ArimaFactors, PolynomialModel, Signal};
use crate::respond::on_log::{OnLog, PolynomialOnLog, known_ahead};
use crate::respond::predict::check_steps;
use crate::respond::tested::{Tested, record_of};
use crate::respond::{Forecast, Horizon, InitialCondition, Innovations, Response};

/// A model of polynomials that are products of factors, beside a log of which its offsets were taken: what it expects
/// is exact from the first differences on, and through missing outputs. Free runs are those of its polynomials.
#[derive(Debug)]
pub(crate) struct ArimaOnLog<'l> {
    model: &'l PolynomialModel,
    process: ArimaProcess,
    record: Record<'l>,
    /// y less what the inputs do.
    noise: Vec<f64>,
    expected: Vec<Expected>,
    /// Innovations and their variances over that of e in the rows that count, one list for each of these, when they
    /// are first needed.
    innovations: OnceLock<Vec<(Vec<f64>, Vec<f64>)>>,
    free_runs: PolynomialOnLog<'l>,
}

/// What there is to expect in a segment.
#[derive(Debug, Clone)]
struct Expected {
    /// The first row before it that is known.
    first: usize,
    /// The rows that are gone through.
    rows: Range<usize>,
    /// Those of the segment among them: the last.
    counted: Range<usize>,
}

impl Expected {
    /// The rows that are gone through, from the first that is known.
    fn own(&self) -> Range<usize> {
        self.rows.start - self.first..self.rows.end - self.first
    }

    /// How many are before the segment.
    fn before(&self) -> usize {
        self.counted.start - self.rows.start
    }
}

impl<'l> ArimaOnLog<'l> {
    /// # Errors
    /// [`Error::Data`] for channels or rows that are not there; [`Error::Report`] if the factors are not stationary.
    pub(crate) fn new(
        model: &'l PolynomialModel,
        factors: &ArimaFactors,
        log: &'l Log,
        rows: &[Rows],
    ) -> Result<Self, Error> {
        let orders = &factors.orders;
        let own = factors.parameters.len() - orders.parameters();
        let values: Vec<f64> = factors.parameters[own..].iter().map(|parameter| parameter.value).collect();
        let process = ArimaProcess::new(orders, &values, false).ok_or_else(|| {
            Error::report("model.factors: they are not stationary; the report was edited or damaged")
        })?;
        let inputs: Vec<String> = model.inputs.iter().map(|input| input.name.clone()).collect();
        let record = log.driven_record(&inputs, &model.output.name, rows)?;
        let mut noise = record.output.to_vec();
        let mut expected = Vec::new();
        noise.iter_mut().enumerate().for_each(|(row, noise)| *noise -= driven(model, &record.inputs, row));
        for (segment, past) in record.segments.iter().zip(&record.past) {
            let first = (segment.start - past + delay(model)).min(segment.end);
            if let Some(rows) = ArimaProcess::expected(&noise[first..segment.end], orders.differences()) {
                let rows = first + rows.start..first + rows.end;
                let counted = rows.start.max(segment.start)..rows.end.max(segment.start);
                if !counted.is_empty() {
                    expected.push(Expected { first, rows, counted });
                }
            }
        }
        let free_runs = PolynomialOnLog::new(model, log, rows, None)?;
        Ok(Self { model, process, record, noise, expected, innovations: OnceLock::new(), free_runs })
    }

    fn innovations(&self) -> &[(Vec<f64>, Vec<f64>)] {
        self.innovations.get_or_init(|| {
            let of = |known: &Expected| {
                let values = &self.noise[known.first..known.rows.end];
                let found = self.process.scan(values, &[], known.own(), false);
                let counted = known.before()..;
                (found.errors[counted.clone()].to_vec(), found.variances[counted].to_vec())
            };
            self.expected.iter().map(of).collect()
        })
    }

    /// The filter of a segment that is about to see the first row with an expectation.
    fn filter(&self, known: &Expected) -> Filter {
        self.process.filter(&self.noise[known.first..known.rows.end], &[], known.own().start, false)
    }

    fn see(filter: &mut Filter, value: f64) {
        if value.is_nan() {
            filter.missing();
        } else {
            filter.measured(value, &[]);
        }
    }

    /// For each row with an expectation so many steps ahead: its prediction, and its variance over that of e.
    fn ahead(&self, steps: usize) -> Vec<(Range<usize>, Vec<f64>, Vec<f64>)> {
        let mut found = Vec::new();
        for (place, own) in self.expected.iter().enumerate() {
            let (rows, counted) = (&own.rows, &own.counted);
            let first = counted.start.max(rows.start + (steps - 1).min(rows.len()));
            let inside = first..counted.end.max(first);
            let (mut values, mut variances) = (Vec::new(), Vec::new());
            let missing = self.noise[rows.clone()].iter().any(|value| value.is_nan());
            if steps == 1 && !missing {
                let (errors, own) = &self.innovations()[place];
                let known = self.noise[counted.clone()].iter().zip(errors);
                values.extend(known.map(|(value, error)| value - error));
                variances.clone_from(own);
            } else {
                let mut filter = self.filter(own);
                let (seen, noise) = filter.ahead(steps);
                let unseen = steps - 1;
                for row in rows.start + unseen.min(rows.len())..rows.end {
                    if row >= first {
                        values.push(filter.seen(&seen));
                        variances.push(noise + filter.spread(&seen));
                    }
                    Self::see(&mut filter, self.noise[row - unseen]);
                }
            }
            found.push((inside, values, variances));
        }
        found
    }

    fn predicted(&self, steps: usize) -> Response {
        let mut response = Response { values: vec![f64::NAN; self.noise.len()], counted: Vec::new() };
        for (rows, values, _) in self.ahead(steps) {
            for (row, value) in rows.clone().zip(values) {
                response.values[row] = value + driven(self.model, &self.record.inputs, row);
            }
            response.counted.extend(measured(self.record.output, &rows));
        }
        response
    }
}

/// How many rows of a segment B reaches back.
fn delay(model: &PolynomialModel) -> usize {
    model.b.iter().map(|b| b.len().saturating_sub(1)).max().unwrap_or(0)
}

/// What the inputs do to the output in a row.
fn driven(model: &PolynomialModel, inputs: &[&[f64]], row: usize) -> f64 {
    let of = |(b, u): (&Vec<f64>, &&[f64])| -> f64 {
        let lags = b.iter().enumerate().take(row + 1).filter(|(_, b)| **b != 0.0);
        lags.map(|(lag, b)| b * u[row - lag]).sum()
    };
    model.b.iter().zip(inputs).map(of).sum()
}

impl OnLog for ArimaOnLog<'_> {
    fn outputs(&self) -> &[Signal] {
        std::slice::from_ref(&self.model.output)
    }

    fn is_driven(&self) -> bool {
        self.free_runs.is_driven()
    }

    fn natural_start(&self, horizon: Horizon) -> InitialCondition {
        match horizon {
            Horizon::Steps { .. } => InitialCondition::Drop,
            Horizon::FreeRun => self.free_runs.natural_start(horizon),
        }
    }

    fn measured(&self, _: usize) -> &[f64] {
        self.record.output
    }

    fn respond(&self, horizon: Horizon, start: InitialCondition) -> Result<Vec<Response>, Error> {
        match horizon {
            Horizon::FreeRun => self.free_runs.respond(horizon, start),
            Horizon::Steps { steps: 0 } => {
                Err(Error::argument("horizon", "a prediction looks at least one step ahead"))
            }
            Horizon::Steps { steps } => {
                check_steps("horizon", steps)?;
                Ok(vec![self.predicted(steps)])
            }
        }
    }

    fn deviations(&self, steps: usize, _: InitialCondition) -> Result<Vec<Vec<f64>>, Error> {
        let mut deviations = vec![f64::NAN; self.noise.len()];
        for (rows, _, variances) in self.ahead(steps) {
            for (row, variance) in rows.zip(variances) {
                deviations[row] = (self.model.noise_variance * variance).sqrt();
            }
        }
        Ok(vec![deviations])
    }

    fn quantile(&self, level: f64) -> f64 {
        self.model.quantile(level)
    }

    fn noise(&self, _: usize, mse: Option<f64>) -> (f64, Option<f64>) {
        let variance = self.model.noise_variance;
        let known = self.innovations().iter().flat_map(|(errors, variances)| errors.iter().zip(variances));
        let (mut count, mut expected, mut ratio) = (0.0, 0.0, 0.0);
        for (error, own) in known.filter(|(error, _)| !error.is_nan()) {
            count += 1.0;
            expected += variance * own;
            ratio += error * error / (variance * own);
        }
        if count == 0.0 { (variance, None) } else { (expected / count, mse.map(|_| ratio / count)) }
    }

    /// Errors are as many times smaller as their deviation is larger than that of e: those of all rows are then alike.
    fn tested(&self) -> Result<Vec<Tested<'_>>, Error> {
        let each = self.expected.iter().zip(self.innovations());
        let innovations = each.map(|(Expected { counted, .. }, (errors, variances))| {
            let scaled = errors.iter().zip(variances);
            let errors = scaled.map(|(v, f)| if v.is_nan() { 0.0 } else { v / f.sqrt() }).collect();
            Innovations::alone(counted.clone(), measured(self.record.output, counted), errors)
        });
        let innovations: Vec<Innovations> = innovations.collect();
        let segments = self.expected.iter().map(|own| own.counted.clone()).collect();
        let record = record_of(self.record.output, self.record.inputs.clone(), segments);
        Ok(vec![Tested::errors(&self.model.output, &self.model.inputs, record, innovations)])
    }

    fn forecast(
        &self,
        log: &Log,
        rows: &[Rows],
        steps: usize,
        _: InitialCondition,
    ) -> Result<Option<(usize, Vec<Forecast>)>, Error> {
        let Some(own) = self.expected.last() else { return Ok(None) };
        let first = own.rows.end;
        let driving: Vec<&str> = self.model.inputs.iter().map(|input| input.name.as_str()).collect();
        let known = known_ahead(log, rows, &driving, first, steps)?;
        if known == 0 {
            return Ok(None);
        }
        check_steps("horizon", known)?;
        let mut filter = self.filter(own);
        self.noise[own.rows.clone()].iter().for_each(|value| Self::see(&mut filter, *value));
        let (values, variances) = filter.forecast(known);
        let add =
            |(step, value): (usize, &f64)| value + driven(self.model, &self.record.inputs, first + step);
        let deviation = |variance: &f64| (self.model.noise_variance * variance).sqrt();
        Ok(Some((
            first,
            vec![Forecast {
                values: if driving.is_empty() {
                    values
                } else {
                    values.iter().enumerate().map(add).collect()
                },
                standard_deviations: variances.iter().map(deviation).collect(),
            }],
        )))
    }
}
