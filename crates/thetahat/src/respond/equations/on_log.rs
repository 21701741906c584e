//! A model in equations beside a log.

use std::ops::Range;
use std::sync::OnceLock;

use thetahat_core::Dual;
use thetahat_numerics::distribution::two_sided;

use super::experiment::{Experiment, experiments};
use super::free_run::{FreeRun, InitialState, free_run};
use super::predictor::Predictor;
use super::walk::{Failure, Predicted, ahead, beyond, walk};
use crate::Error;
use crate::data::{Log, Rows, measured};
use crate::model::{EquationsModel, GreyBox, Signal};
use crate::respond::{
    Forecast, Horizon, InitialCondition, Innovations, Response, check_steps,
    on_log::OnLog,
    tested::{Tested, record_of},
};

/// Derivatives that are computed together.
const LANE: usize = 4;

/// A model in equations beside a log. Its offsets are zero, so deviations are the signals themselves.
#[derive(Debug)]
pub(crate) struct EquationsOnLog<'l> {
    stored: &'l EquationsModel,
    model: GreyBox,
    /// The values of its unknown parameters after the change of variable, and their covariance, row by row.
    z: Vec<f64>,
    spread: Option<Vec<Vec<f64>>>,
    experiments: Vec<Experiment>,
    /// For each output, as long as the log: what counts, what was measured.
    counted: Vec<Vec<Range<usize>>>,
    measured: Vec<Vec<f64>>,
    /// The inputs, a missing value held.
    inputs: Vec<Vec<f64>>,
    rows: usize,
    /// What the filter says of each output.
    filtered: OnceLock<Vec<Filtered>>,
}

/// The innovations of an output, as long as the log; NaN where nothing was measured.
#[derive(Debug, Clone)]
struct Filtered {
    /// e, S, and e/sqrt(S).
    errors: Vec<f64>,
    variances: Vec<f64>,
    standardised: Vec<f64>,
}

impl<'l> EquationsOnLog<'l> {
    /// A model beside some rows of a log, of which it was fitted to some.
    pub(crate) fn new(
        stored: &'l EquationsModel,
        log: &'l Log,
        rows: &[Rows],
        fitted: &[Rows],
    ) -> Result<Self, Error> {
        let (model, z) = stored.with_variables()?;
        let experiments = experiments(&model, log, rows, fitted)?;
        let length = log.rows();
        let (height, width) = (stored.outputs.len(), stored.inputs.len());
        let mut outputs = vec![vec![f64::NAN; length]; height];
        let mut inputs = vec![vec![0.0; length]; width];
        for experiment in &experiments {
            for row in 0..experiment.rows() {
                let into = |signals: &mut [Vec<f64>], values: &[f64]| {
                    for (signal, value) in signals.iter_mut().zip(values) {
                        signal[experiment.first + row] = *value;
                    }
                };
                into(&mut outputs, experiment.output(row));
                into(&mut inputs, experiment.input(row));
            }
        }
        let segments: Vec<Range<usize>> = experiments.iter().flat_map(segments).collect();
        let counted =
            outputs.iter().map(|output| segments.iter().flat_map(|rows| measured(output, rows)).collect());
        let spread = stored.covariance.as_ref().map(|rows| {
            let slopes: Vec<f64> =
                model.parameters().iter().zip(&z).map(|(unknown, z)| unknown.scale.slope(*z)).collect();
            let entry = |i: usize, j: usize| match slopes[i] * slopes[j] {
                // A noise that vanishes: nothing that is predicted depends on it.
                0.0 => 0.0,
                slope => rows[i][j] / slope,
            };
            (0..z.len()).map(|i| (0..z.len()).map(|j| entry(i, j)).collect()).collect()
        });
        Ok(Self {
            counted: counted.collect(),
            measured: outputs,
            inputs,
            rows: length,
            stored,
            model,
            z,
            spread,
            experiments,
            filtered: OnceLock::new(),
        })
    }

    /// The filter along all experiments, once.
    fn filtered(&self) -> Result<&[Filtered], Error> {
        if let Some(found) = self.filtered.get() {
            return Ok(found);
        }
        let nothing = || vec![f64::NAN; self.rows];
        let mut found: Vec<Filtered> = (0..self.stored.outputs.len())
            .map(|_| Filtered { errors: nothing(), variances: nothing(), standardised: nothing() })
            .collect();
        let mut predictor = Predictor::new(&self.model);
        walk(&self.model, &self.experiments, &mut predictor, &self.z, |at, _, innovation| {
            let row = self.experiments[at.log].first + at.row;
            found[at.output].errors[row] = innovation.error;
            found[at.output].variances[row] = innovation.variance;
            found[at.output].standardised[row] = innovation.error / innovation.variance.sqrt();
        })
        .map_err(|failure| failure.error(&self.experiments))?;
        Ok(self.filtered.get_or_init(|| found))
    }

    /// Signals of the whole log from what is said of each experiment's rows that count.
    fn spread_out<T>(&self, said: &[Vec<T>], of: impl Fn(&T) -> f64) -> Vec<Vec<f64>> {
        let height = self.stored.outputs.len();
        let mut signals = vec![vec![f64::NAN; self.rows]; height];
        for (experiment, said) in self.experiments.iter().zip(said) {
            for row in experiment.counted().iter().cloned().flatten() {
                for (output, signal) in signals.iter_mut().enumerate() {
                    signal[experiment.first + row] = of(&said[row * height + output]);
                }
            }
        }
        signals
    }

    /// The rows that count so many steps ahead, for each output: those that a measurement stands as many rows before.
    /// The others are predicted from the state that the model begins with, which is no prediction from data. An output
    /// of which no other row is left keeps them.
    fn predicted_from_measurements(&self, steps: usize) -> Vec<Vec<Range<usize>>> {
        let first = |experiment: &Experiment| -> Option<(Range<usize>, usize)> {
            let is_measured = |row: &usize| experiment.output(*row).iter().any(|value| !value.is_nan());
            let measured = (0..experiment.rows()).find(is_measured)?;
            let own = experiment.first..experiment.first + experiment.rows();
            Some((own, experiment.first + measured + steps))
        };
        let first: Vec<(Range<usize>, usize)> = self.experiments.iter().filter_map(first).collect();
        let later = |rows: &Range<usize>| {
            let (_, first) = first.iter().find(|(own, _)| own.contains(&rows.start))?;
            Some(rows.start.max(*first)..rows.end).filter(|rows| !rows.is_empty())
        };
        let of_output = |counted: &Vec<Range<usize>>| {
            let left: Vec<Range<usize>> = counted.iter().filter_map(later).collect();
            if left.is_empty() { counted.clone() } else { left }
        };
        self.counted.iter().map(of_output).collect()
    }

    /// The predictions of each experiment, `steps` ahead.
    fn ahead(&self, steps: usize) -> Result<Vec<Vec<Predicted<f64>>>, Error> {
        let each = self.experiments.iter().enumerate().map(|(log, experiment)| {
            ahead(&self.model, experiment, &self.z, steps)
                .map_err(|row| Failure { log, row }.error(&self.experiments))
        });
        each.collect()
    }

    /// Where each state starts in the free runs, with an entry for each run; none where it grows out of range.
    pub(crate) fn starts(&self) -> Vec<Vec<Option<f64>>> {
        let runs: Vec<Option<Vec<f64>>> = self
            .experiments
            .iter()
            .flat_map(|experiment| {
                match free_run(&self.model, experiment, &self.z, InitialState::Estimated) {
                    Some(runs) => runs.into_iter().map(|run| Some(run.start)).collect(),
                    None => vec![None; experiment.counted().len()],
                }
            })
            .collect();
        let of_state =
            |state: usize| runs.iter().map(|start| start.as_ref().map(|start| start[state])).collect();
        (0..self.stored.states.len()).map(of_state).collect()
    }

    /// The free runs of all experiments.
    fn free_runs(&self, begin: InitialState) -> Result<Vec<Vec<FreeRun>>, Error> {
        let each = self.experiments.iter().map(|experiment| {
            free_run(&self.model, experiment, &self.z, begin)
                .ok_or_else(|| Error::data("the free run grows out of the range of numbers"))
        });
        each.collect()
    }

    /// The predictions of an experiment with these parameters; their variances include the uncertainty of the
    /// parameters, g' P g, where g are the derivatives of the predictions with respect to the parameters.
    fn with_open_parameters<P, D>(&self, log: usize, plain: P, dual: D) -> Result<Vec<Predicted<f64>>, Error>
    where
        P: Fn(&[f64]) -> Result<Vec<Predicted<f64>>, usize>,
        D: Fn(&[Dual<f64, LANE>]) -> Result<Vec<Predicted<Dual<f64, LANE>>>, usize>,
    {
        let failed = |row| Failure { log, row }.error(&self.experiments);
        let Some(spread) = &self.spread else { return plain(&self.z).map_err(failed) };
        let size = self.z.len();
        let mut said: Vec<Predicted<f64>> = Vec::new();
        let mut slopes: Vec<f64> = Vec::new();
        for lane in 0..size.div_ceil(LANE) {
            let mut variables: Vec<Dual<f64, LANE>> = self.z.iter().map(|z| Dual::from(*z)).collect();
            let own = lane * LANE..size.min((lane + 1) * LANE);
            for (place, index) in own.clone().enumerate() {
                variables[index].derivatives[place] = 1.0;
            }
            let found = dual(&variables).map_err(failed)?;
            if lane == 0 {
                slopes = vec![0.0; found.len() * size];
                let values = found.iter();
                said = values
                    .map(|one| Predicted { value: one.value.value, variance: one.variance.value })
                    .collect();
            }
            for (one, slopes) in found.iter().zip(slopes.chunks_exact_mut(size)) {
                slopes[own.clone()].copy_from_slice(&one.value.derivatives[..own.len()]);
            }
        }
        for (one, slopes) in said.iter_mut().zip(slopes.chunks_exact(size)) {
            let mut sum = 0.0;
            for (row, slope) in spread.iter().zip(slopes) {
                sum += slope * row.iter().zip(slopes).map(|(entry, slope)| entry * slope).sum::<f64>();
            }
            one.variance += sum.max(0.0);
        }
        Ok(said)
    }
}

fn responses(signals: Vec<Vec<f64>>, counted: Vec<Vec<Range<usize>>>) -> Vec<Response> {
    let each = signals.into_iter().zip(counted);
    each.map(|(values, counted)| Response { values, counted }).collect()
}

/// The rows of a log that count in an experiment.
fn segments(experiment: &Experiment) -> impl Iterator<Item = Range<usize>> {
    let first = experiment.first;
    experiment.counted().iter().map(move |rows| first + rows.start..first + rows.end)
}

impl OnLog for EquationsOnLog<'_> {
    fn outputs(&self) -> &[Signal] {
        &self.stored.outputs
    }

    fn is_driven(&self) -> bool {
        !self.stored.inputs.is_empty()
    }

    fn natural_start(&self, _: Horizon) -> InitialCondition {
        InitialCondition::Estimate
    }

    fn measured(&self, output: usize) -> &[f64] {
        &self.measured[output]
    }

    fn respond(&self, horizon: Horizon, start: InitialCondition) -> Result<Vec<Response>, Error> {
        if start == InitialCondition::Drop {
            return Err(Error::argument(
                "initial",
                "models in equations start from what they know of their states, and leave out no rows; take zero, which is what the \
                 model says, or estimate",
            ));
        }
        match horizon {
            Horizon::Steps { steps } => {
                let said = self.ahead(steps)?;
                let signals = self.spread_out(&said, |one| one.value);
                Ok(responses(signals, self.predicted_from_measurements(steps)))
            }
            Horizon::FreeRun => {
                let begin = if start == InitialCondition::Zero {
                    InitialState::Given
                } else {
                    InitialState::Estimated
                };
                let height = self.stored.outputs.len();
                let mut signals = vec![vec![f64::NAN; self.rows]; height];
                for (experiment, runs) in self.experiments.iter().zip(self.free_runs(begin)?) {
                    for run in runs {
                        for (row, values) in run.rows.zip(run.outputs.chunks_exact(height)) {
                            for (signal, value) in signals.iter_mut().zip(values) {
                                signal[experiment.first + row] = *value;
                            }
                        }
                    }
                }
                Ok(responses(signals, self.counted.clone()))
            }
        }
    }

    fn deviations(&self, steps: usize, _: InitialCondition) -> Result<Vec<Vec<f64>>, Error> {
        let each = self.experiments.iter().enumerate().map(|(log, experiment)| {
            self.with_open_parameters(
                log,
                |z| ahead(&self.model, experiment, z, steps),
                |z| ahead(&self.model, experiment, z, steps),
            )
        });
        let said = each.collect::<Result<Vec<_>, Error>>()?;
        Ok(self.spread_out(&said, |one| one.variance.sqrt()))
    }

    fn quantile(&self, level: f64) -> f64 {
        two_sided(1.0 - level)
    }

    fn noise(&self, output: usize, _: Option<f64>) -> (f64, Option<f64>) {
        let own = self.stored.noise_covariance[output][output];
        let Ok(filtered) = self.filtered() else { return (own, None) };
        let Filtered { errors, variances, .. } = &filtered[output];
        let (mut count, mut variance, mut ratio) = (0.0, 0.0, 0.0);
        for (e, s) in errors.iter().zip(variances).filter(|(_, s)| !s.is_nan()) {
            count += 1.0;
            variance += s;
            ratio += e * e / s;
        }
        if count == 0.0 { (own, None) } else { (variance / count, Some(ratio / count)) }
    }

    fn forecast(
        &self,
        log: &Log,
        _: &[Rows],
        steps: usize,
        _: InitialCondition,
    ) -> Result<Option<(usize, Vec<Forecast>)>, Error> {
        let Some(last) = self.experiments.len().checked_sub(1) else { return Ok(None) };
        let experiment = &self.experiments[last];
        let is_measured = |row: &usize| experiment.output(*row).iter().any(|value| !value.is_nan());
        let Some(base) = (0..experiment.rows()).rev().find(is_measured) else { return Ok(None) };
        let inside = experiment.rows() - 1 - base;
        let goes_on = self.inputs.is_empty() && experiment.first + experiment.rows() == log.rows();
        let steps = if goes_on { steps } else { steps.min(inside) };
        if steps == 0 {
            return Ok(None);
        }
        check_steps("horizon", steps)?;
        let said = self.with_open_parameters(
            last,
            |z| beyond(&self.model, experiment, z, base, steps),
            |z| beyond(&self.model, experiment, z, base, steps),
        )?;
        let height = self.stored.outputs.len();
        let of_output = |output: usize| {
            let own = || said.iter().skip(output).step_by(height);
            Forecast {
                values: own().map(|one| one.value).collect(),
                standard_deviations: own().map(|one| one.variance.sqrt()).collect(),
            }
        };
        Ok(Some((experiment.first + base + 1, (0..height).map(of_output).collect())))
    }

    /// The innovations, each divided by its standard deviation.
    fn tested(&self) -> Result<Vec<Tested<'_>>, Error> {
        let filtered = self.filtered()?;
        let each = filtered.iter().zip(&self.counted).zip(&self.stored.outputs);
        let each = each.map(|((filtered, counted), output)| {
            let standardised = &filtered.standardised;
            let innovations = self.experiments.iter().flat_map(segments).map(|rows| {
                let own: Vec<f64> =
                    standardised[rows.clone()].iter().map(|e| if e.is_nan() { 0.0 } else { *e }).collect();
                let inside = |one: &&Range<usize>| rows.start <= one.start && one.end <= rows.end;
                let counted = counted.iter().filter(inside).cloned().collect();
                Innovations::alone(rows, counted, own)
            });
            let inputs = self.inputs.iter().map(Vec::as_slice).collect();
            let record =
                record_of(standardised, inputs, self.experiments.iter().flat_map(segments).collect());
            Tested::errors(output, &self.stored.inputs, record, innovations.collect())
        });
        Ok(each.collect())
    }
}
