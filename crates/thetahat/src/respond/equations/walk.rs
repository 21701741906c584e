//! The filter along experiments, and the predictions that start from its estimates.

use thetahat_core::Number;

use super::experiment::Experiment;
use super::predictor::{Innovation, Predictor};
use crate::Error;
use crate::model::{GreyBox, equations::Drive};

/// Where the filter ceased to work: a number overflowed, or is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Failure {
    /// Which experiment.
    pub(crate) log: usize,
    /// The 0-based row of it.
    pub(crate) row: usize,
}

impl Failure {
    /// In words, with the row of the whole log.
    pub(crate) fn error(self, experiments: &[Experiment]) -> Error {
        let row = experiments[self.log].first + self.row + 1;
        let message = format!(
            "the filter leaves the range of numbers in row {row}; give start values that are closer, shorter integration steps \
             (substeps), or larger noises"
        );
        Error::Data { channel: None, row: Some(row), message }
    }
}

/// An element of a measurement.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Element {
    pub(crate) log: usize,
    pub(crate) row: usize,
    pub(crate) output: usize,
}

/// Takes the filter to a row, and linearises its measurement.
pub(crate) fn reach<S: Number<f64>>(
    model: &GreyBox,
    experiment: &Experiment,
    predictor: &mut Predictor<S>,
    z: &[S],
    row: usize,
) {
    for (time, step) in experiment.steps(row) {
        predictor.predict(model, z, experiment.drive(row - 1), time, step);
    }
    predictor.observe(model, z, experiment.drive(row), experiment.times[row]);
}

/// Takes the filter to a row and through what was measured in it. `told` hears of each element: which output, the
/// prediction h(x^), and e and S. Where the filter ceases to work in rows before those that count, it begins there
/// again from the model's start.
pub(crate) fn step<S: Number<f64>>(
    model: &GreyBox,
    experiment: &Experiment,
    predictor: &mut Predictor<S>,
    z: &[S],
    row: usize,
    mut told: impl FnMut(usize, S, Innovation<S>),
) -> Option<()> {
    let is_alike = |other: usize| experiment.is_alike(row, other);
    predictor.begin(is_alike);
    reach(model, experiment, predictor, z, row);
    let found = absorb(experiment, predictor, row, &mut told);
    predictor.end(row, is_alike);
    if found.is_some() || !experiment.warms(row) {
        return found;
    }
    predictor.restart(model, z);
    predictor.observe(model, z, experiment.drive(row), experiment.times[row]);
    absorb(experiment, predictor, row, &mut told)
}

fn absorb<S: Number<f64>>(
    experiment: &Experiment,
    predictor: &mut Predictor<S>,
    row: usize,
    told: &mut impl FnMut(usize, S, Innovation<S>),
) -> Option<()> {
    for (output, &measured) in experiment.output(row).iter().enumerate() {
        if !measured.is_nan() {
            let innovation = predictor.absorb(output, measured)?;
            told(output, predictor.output[output], innovation);
        }
    }
    predictor.is_finite().then_some(())
}

/// The filter over all logs. `told` hears of each element that was measured in a row that counts: where it is, the
/// prediction h(x^), and e and S.
pub(crate) fn walk(
    model: &GreyBox,
    experiments: &[Experiment],
    predictor: &mut Predictor<f64>,
    z: &[f64],
    mut told: impl FnMut(Element, f64, Innovation<f64>),
) -> Result<(), Failure> {
    for (log, experiment) in experiments.iter().enumerate() {
        predictor.restart(model, z);
        for row in 0..experiment.rows() {
            let counts = experiment.counts(row);
            step(model, experiment, predictor, z, row, |output, prediction, innovation| {
                if counts {
                    told(Element { log, row, output }, prediction, innovation);
                }
            })
            .ok_or(Failure { log, row })?;
        }
    }
    Ok(())
}

/// What was expected of one output in one row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Predicted<S> {
    /// h(x^).
    pub(crate) value: S,
    /// The variance of y - h(x^), the noise of the measurement in it.
    pub(crate) variance: S,
}

/// The outputs of each row of an experiment as they were expected `horizon` steps before, from all that was measured up
/// to then: x^ and P of that row go on through the model. Nearer to the first row than that they go on from the model's
/// start. One entry for each row and output, row after row; not a number in rows that do not count, and where the model
/// leaves the range of numbers. O(N k (n^3 + m n^2)) for k steps.
///
/// # Errors
/// The row in which the filter ceases to work.
pub(crate) fn ahead<S: Number<f64>>(
    model: &GreyBox,
    experiment: &Experiment,
    z: &[S],
    horizon: usize,
) -> Result<Vec<Predicted<S>>, usize> {
    let (outputs, rows) = (model.outputs().len(), experiment.rows());
    let mut filter = Predictor::new(model);
    filter.restart(model, z);
    let mut predicted = Vec::with_capacity(rows * outputs);
    let mut distant = filter.clone();
    // From the start, as long as no measurement is `horizon` rows back.
    for row in 0..rows.min(horizon) {
        reach(model, experiment, &mut distant, z, row);
        say(&distant, &mut predicted);
    }
    for base in 0..rows.saturating_sub(horizon) {
        step(model, experiment, &mut filter, z, base, |_, _, _| {}).ok_or(base)?;
        let target = base + horizon;
        if !experiment.counts(target) {
            let nothing = S::from(f64::NAN);
            predicted.extend((0..outputs).map(|_| Predicted { value: nothing, variance: nothing }));
            continue;
        }
        distant.copy_from(&filter);
        for row in base + 1..target {
            for (time, step) in experiment.steps(row) {
                distant.predict(model, z, experiment.drive(row - 1), time, step);
            }
        }
        reach(model, experiment, &mut distant, z, target);
        say(&distant, &mut predicted);
    }
    Ok(predicted)
}

/// The outputs of the `steps` rows after row `base` as they are expected from all that was measured up to it. After the
/// end of the experiment the model goes on in its own sample time, which is for models without inputs. One entry for
/// each row and output.
///
/// # Errors
/// As for [`ahead`].
pub(crate) fn beyond<S: Number<f64>>(
    model: &GreyBox,
    experiment: &Experiment,
    z: &[S],
    base: usize,
    steps: usize,
) -> Result<Vec<Predicted<S>>, usize> {
    let mut filter = Predictor::new(model);
    filter.restart(model, z);
    for row in 0..=base {
        step(model, experiment, &mut filter, z, row, |_, _, _| {}).ok_or(row)?;
    }
    let own = model.sample_time();
    let last = experiment.rows() - 1;
    let mut predicted = Vec::with_capacity(steps * model.outputs().len());
    for row in base + 1..=base + steps {
        if row <= last {
            reach(model, experiment, &mut filter, z, row);
        } else {
            let before = experiment.times[last] + (row - 1 - last) as f64 * own;
            filter.predict(model, z, Drive::held(&[]), before, own);
            filter.observe(model, z, Drive::held(&[]), before + own);
        }
        say(&filter, &mut predicted);
    }
    Ok(predicted)
}

/// What a predictor expects of each output.
fn say<S: Number<f64>>(predictor: &Predictor<S>, predicted: &mut Vec<Predicted<S>>) {
    let each = predictor.output.iter().enumerate();
    predicted.extend(each.map(|(output, &value)| Predicted { value, variance: predictor.variance(output) }));
}
