//! The lines of `filter`.

use thetahat::filter::{Estimator, StateEstimate, StateModel, StateValues};

use crate::failure::Failure;
use crate::job::{Clock, FilterJob};
use crate::line_writer::{Cells, LineWriter};

/// The columns of a run.
pub(super) struct Columns {
    names: Vec<String>,
    has_time: bool,
    /// Whether there is no noise, and so neither a corrected state nor a standard deviation.
    observes: bool,
    /// Whether noise is bounded, so that there are intervals instead of standard deviations.
    bounded: bool,
    outputs: Vec<String>,
    inputs: Vec<String>,
}

impl Columns {
    /// # Errors
    /// That two columns would have the same name.
    pub(super) fn new(job: &FilterJob, model: &StateModel) -> Result<Self, Failure> {
        let has_time = matches!(job.log.clock, Clock::Column { .. });
        let smoothed: &[&str] = if job.smooth { &["_smoothed", "_smoothed_sd"] } else { &[] };
        let mut names = vec!["row".to_owned()];
        names.extend(has_time.then(|| "time".to_owned()));
        names.push("action".to_owned());
        let mut add = |name: &str, suffixes: &[&str]| {
            names.extend(suffixes.iter().chain(smoothed).map(|suffix| format!("{name}{suffix}")));
        };
        let observes = matches!(job.estimator(model), Estimator::Luenberger(_));
        let bounded = matches!(job.estimator(model), Estimator::Bounded { .. });
        if bounded {
            add("contradicts", &[""]);
        }
        let of_state: &[&str] = match (observes, bounded) {
            (true, _) => &["_predicted"],
            (_, true) => &["", "_low", "_high", "_predicted", "_predicted_low", "_predicted_high"],
            _ => &["", "_sd", "_predicted", "_predicted_sd"],
        };
        model.states().iter().for_each(|state| add(state, of_state));
        model.unknown().for_each(|parameter| add(parameter, &["", "_sd"]));
        for output in model.outputs() {
            let last = if bounded { "_bound" } else { "_sd" };
            let parts = [("measured", ""), ("predicted", ""), ("innovation", ""), ("innovation", last)];
            let parts = if observes { &parts[..3] } else { &parts[..] };
            names.extend(parts.iter().map(|(part, suffix)| format!("{part}_{output}{suffix}")));
        }
        if !observes && !bounded {
            names.extend(["nis", "nis_low", "nis_high", "log_likelihood"].map(str::to_owned));
        }
        names.extend((!model.inputs().is_empty()).then(|| "held".to_owned()));
        let twice = |(index, name): &(usize, &String)| names.iter().take(*index).any(|other| other == *name);
        if let Some((_, name)) = names.iter().enumerate().find(twice) {
            return Err(Failure::data(format!(
                "{}: the output would have two columns called '{name}'; rename a state or a parameter",
                job.model.display()
            )));
        }
        let (inputs, outputs) = (model.inputs().to_vec(), model.outputs().to_vec());
        Ok(Self { names, has_time, observes, bounded, inputs, outputs })
    }

    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// A line about a row, with its states and parameters given the whole log if there are any.
    pub(super) fn row(
        &self,
        lines: &mut LineWriter,
        row: u64,
        time: Option<f64>,
        measured: &[f64],
        estimate: &StateEstimate<'_>,
        smoothed: Option<(StateValues<'_>, StateValues<'_>)>,
    ) -> Result<(), Failure> {
        lines.add(|cells| {
            cells.count(row);
            if self.has_time {
                cells.number(time.unwrap_or(f64::NAN));
            }
            cells.word(estimate.action.word());
            if self.bounded {
                let output = estimate.contradiction.and_then(|output| self.outputs.get(output));
                cells.word(output.map_or("", String::as_str));
            }
            for index in 0..estimate.predicted.values.len() {
                if self.observes {
                    cells.number(at(estimate.predicted.values, index));
                    continue;
                }
                if self.bounded {
                    interval(cells, estimate.filtered.as_ref(), index);
                    interval(cells, Some(&estimate.predicted), index);
                    continue;
                }
                pair(cells, estimate.filtered.as_ref(), index);
                pair(cells, Some(&estimate.predicted), index);
                if let Some((states, _)) = &smoothed {
                    pair(cells, Some(states), index);
                }
            }
            for index in 0..estimate.parameters.values.len() {
                pair(cells, Some(&estimate.parameters), index);
                if let Some((_, parameters)) = &smoothed {
                    pair(cells, Some(parameters), index);
                }
            }
            for (index, &measured) in measured.iter().enumerate() {
                cells.number(measured);
                cells.number(at(estimate.outputs.values, index));
                cells.number(at(estimate.innovations, index));
                let StateValues { standard_deviations, bounds, .. } = estimate.outputs;
                if let Some(numbers) = standard_deviations.or(bounds) {
                    cells.number(at(numbers, index));
                }
            }
            if self.observes || self.bounded {
                return self.held(cells, estimate);
            }
            cells.number(estimate.nis.unwrap_or(f64::NAN));
            let (low, high) = estimate.nis_bounds.unwrap_or((f64::NAN, f64::NAN));
            cells.number(low);
            cells.number(high);
            cells.number(estimate.log_likelihood.unwrap_or(f64::NAN));
            self.held(cells, estimate);
        })
    }

    /// The inputs that are missing in this row.
    fn held(&self, cells: &mut Cells<'_>, estimate: &StateEstimate<'_>) {
        if estimate.held.contains(&true) {
            let held = self.inputs.iter().zip(estimate.held).filter(|(_, held)| **held);
            let held: Vec<&str> = held.map(|(name, _)| name.as_str()).collect();
            cells.word(&held.join(" "));
        }
    }
}

/// A value and its standard deviation.
fn pair(cells: &mut Cells<'_>, values: Option<&StateValues<'_>>, index: usize) {
    cells.number(at(values.map_or(&[], |values| values.values), index));
    cells.number(at(values.and_then(|values| values.standard_deviations).unwrap_or_default(), index));
}

/// A value, and between which numbers it is.
fn interval(cells: &mut Cells<'_>, values: Option<&StateValues<'_>>, index: usize) {
    let value = at(values.map_or(&[], |values| values.values), index);
    let bound = at(values.and_then(|values| values.bounds).unwrap_or_default(), index);
    [value, value - bound, value + bound].into_iter().for_each(|number| cells.number(number));
}

fn at(values: &[f64], index: usize) -> f64 {
    values.get(index).copied().unwrap_or(f64::NAN)
}
