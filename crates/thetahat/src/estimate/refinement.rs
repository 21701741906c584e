//! State-space models of the least errors, found by a search from those of a subspace method.

mod errors;
#[cfg(test)]
mod tests;

use std::fmt;
use std::str::FromStr;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::optimize::{Deadline, Found, Monitor, Objective, Progress, Search, Stopped, search};

use super::outcome::{SearchOutcome, StartOutcome, search_outcome};
use crate::Error;
use crate::data::JointRecord;
use crate::model::{
    EntryCovariance, Sizes, StateSpace, across_coordinates, flat, is_stable, symmetric_eigen,
};
use errors::{Errors, Form, Unstable};

/// The variance of errors, in squares of the outputs, below which nothing is left of them.
const NOTHING_LEFT: f64 = 1e-16;
/// Errors of such a variance are rounding, and no search makes them smaller.
const EXACT: f64 = 1e-12;
/// Iterations along the directions of one point.
const ROUND: usize = 10;
/// A direction whose information is below this fraction of that of the others, each direction by itself having 1, is
/// not determined.
const UNDETERMINED: f64 = 1e-12;

/// Whose errors a refinement makes small.
///
/// ```
/// use thetahat::estimate::Refine;
///
/// assert_eq!("simulation".parse::<Refine>()?, Refine::Simulation);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Refine {
    /// Those of predictions one step ahead: F, G, H, D and K together.
    Prediction,
    /// Those of the free run: F, G, H and D; K then predicts best with these.
    Simulation,
}

impl Refine {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Prediction, Self::Simulation];

    /// The word for it in options and documents.
    pub fn word(self) -> &'static str {
        match self {
            Self::Prediction => "prediction",
            Self::Simulation => "simulation",
        }
    }

    /// What the errors are of, in a sentence.
    pub fn of(self) -> &'static str {
        match self {
            Self::Prediction => "predictions one step ahead",
            Self::Simulation => "the free run",
        }
    }
}

impl fmt::Display for Refine {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(self.word())
    }
}

impl FromStr for Refine {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        Self::ALL.into_iter().find(|refine| refine.word() == text).ok_or_else(|| {
            Error::argument(
                "refine",
                format!("'{text}' is neither prediction nor simulation; take one of these"),
            )
        })
    }
}

/// How a model was refined.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RefinementOutcome {
    /// Whose errors were made small.
    pub errors: Refine,
    /// How the search went; its costs are ln det cov e, e in units in which the first start's errors have covariance I.
    pub search: SearchOutcome,
}

/// A model to start from, and the levels of its outputs.
#[derive(Debug, Clone)]
pub(crate) struct RefinementStart {
    pub(crate) name: String,
    pub(crate) model: StateSpace,
    pub(crate) levels: Vec<f64>,
}

/// What is looked for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Refinement {
    pub(crate) refine: Refine,
    /// Whether D is free.
    pub(crate) feedthrough: bool,
    /// Whether the levels of the outputs are.
    pub(crate) constant: bool,
    /// The degrees of freedom of the errors.
    pub(crate) degrees_of_freedom: usize,
}

/// What was found.
#[derive(Debug, Clone)]
pub(crate) struct Refined {
    pub(crate) model: StateSpace,
    pub(crate) levels: Vec<f64>,
    /// None where the record does not see all directions.
    pub(crate) covariance: Option<EntryCovariance>,
    pub(crate) search: SearchOutcome,
}

/// Searches for the model of the least ln det cov e, e being errors one step ahead or of the free run, each segment
/// from the state that fits it best.
///
/// A step moves all entries of the matrices but along changes of coordinates, in which nothing changes: the directions
/// are an orthonormal basis of what is orthogonal to these, taken anew after some iterations (McKelvey, Helmersson and
/// Ribarits, Data driven local coordinates, Automatica 40, 2004). Signals and states are in units in which they are of
/// size one, errors in those in which the start's have covariance I. One search from each start, side by side; the
/// least errors win, and the first of equal ones.
///
/// With prediction errors the covariance of the entries is the inverse of the information,
///
/// ```text
/// (sum psi' R^-1 psi)^-1 N/(N - p/l),   psi = -de/dtheta,   R = cov e
/// ```
///
/// (Ljung, System Identification, 2nd ed. 1999, section 9.3). Errors of a free run are coloured: with G that sum and g
/// that of psi' R^-1 e it is G^-1 (cov g) G^-1, cov g being that of the noise of the model that was found (section 9.4
/// there); K has the errors that it has where the plant is known.
///
/// Cost: O(N (n + l) r (n + m + l)) an iteration for r = n (m + 2 l) directions.
///
/// # Errors
/// [`Error::Interrupted`]; [`Error::Undetermined`] where no start has errors.
pub(crate) fn refined(
    record: &JointRecord<'_>,
    starts: &[RefinementStart],
    what: Refinement,
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<Refined, Error> {
    options.check_numbers()?;
    // Those of the first that has errors: a subspace method may find an unstable model.
    let units =
        |start| Units::of(record, start, what).transpose().map(|units| units.map(|units| (start, units)));
    let (first, units) = starts.iter().find_map(units).ok_or_else(no_errors)??;
    let scaled = units.record(record, &first.levels);
    let record = JointRecord {
        inputs: scaled.inputs.iter().map(Vec::as_slice).collect(),
        outputs: scaled.outputs.iter().map(Vec::as_slice).collect(),
        segments: record.segments.clone(),
    };
    let deadline = Deadline::after(options.time_limit);
    let search_from = |start: &RefinementStart| -> Result<Option<Searched>, Error> {
        let levels = start.levels.iter().zip(&first.levels).map(|(own, first)| own - first);
        let levels = &units.root * DVector::from_iterator(first.levels.len(), levels);
        let model = units.to_units(&start.model);
        let form = Form { levels, ..Form::of(&model, what.refine) };
        searched(&record, (form, model.k), what, &units.floor, options, (deadline, monitor))
    };
    let searched = starts.par_iter().map(search_from).collect::<Result<Vec<_>, Error>>()?;
    let mean = |cost: f64| cost / samples(&record);
    let outcome = |(start, searched): (&RefinementStart, &Option<Searched>)| StartOutcome {
        name: start.name.clone(),
        cost: searched.as_ref().and_then(|searched| searched.found.costs.first()).map(|cost| mean(*cost)),
        reached: searched.as_ref().map(|searched| mean(searched.found.cost())),
    };
    let outcomes: Vec<StartOutcome> = starts.iter().zip(&searched).map(outcome).collect();
    let number = |(number, searched): (usize, Option<Searched>)| Some((number, searched?));
    let mut searched: Vec<(usize, Searched)> = searched.into_iter().enumerate().filter_map(number).collect();
    searched.sort_by(|(_, one), (_, other)| one.found.cost().total_cmp(&other.found.cost()));
    // At the boundary of stability the least errors may have no model: then the next.
    let mut refusal = None;
    for (best, searched) in searched {
        let mut outcomes = outcomes.clone();
        outcomes.swap(0, best);
        let scale = (&units, first, what);
        match finished(&record, searched, outcomes, scale, options, (deadline, monitor)) {
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(error) => refusal = refusal.or(Some(error)),
            found => return found,
        }
    }
    Err(refusal.unwrap_or_else(no_errors))
}

/// The model of what a search led to, in the units of the signals. `first` is the start that these units are of.
///
/// # Errors
/// [`Error::Interrupted`]; [`Error::Undetermined`] where its states, its directions or its errors are not finite.
fn finished(
    record: &JointRecord<'_>,
    Searched { mut form, mut k, found }: Searched,
    outcomes: Vec<StartOutcome>,
    (units, first, what): (&Units, &RefinementStart, Refinement),
    options: &Search,
    (deadline, monitor): (Deadline, Monitor<'_>),
) -> Result<Refined, Error> {
    // The covariance in coordinates and directions of what was found.
    let sizes = form.state_sizes(record, what.refine).ok_or_else(no_errors)?;
    form.divide_states(&sizes);
    k.row_iter_mut().zip(&sizes).for_each(|(mut row, size)| row /= *size);
    let basis = directions(&form, what).ok_or_else(no_errors)?;
    let own = Linearized::at(record, what.refine, form.clone(), basis, &units.floor)?;
    let search = search_outcome(options, &found, &own.errors, outcomes);
    let widened = samples(record) / what.degrees_of_freedom as f64;
    let (mut model, factors) = match what.refine {
        Refine::Prediction => (own.model(), vec![own.variations(None)]),
        Refine::Simulation => {
            let predictor = best_predictor(record, &form, k, &units.floor, options, (deadline, monitor))?;
            let model = predictor.model();
            let scores = own.errors.covariance_of_right(&model);
            let plant = scores.and_then(|scores| own.variations(Some(&scores)));
            (model, vec![plant, predictor.variations(None)])
        }
    };
    model.sample_time = first.model.sample_time;
    let model = units.without_units(&model);
    let factors: Option<Vec<Vec<StateSpace>>> = factors.into_iter().collect();
    let covariance = factors.and_then(|factors| {
        let columns = factors.iter().flatten();
        let varied: Vec<DVector<f64>> =
            columns.map(|varied| flat(&units.without_units(varied)) * widened.sqrt()).collect();
        EntryCovariance::new(
            &model,
            what.feedthrough,
            &units.sizes(model.f.nrows()),
            &DMatrix::from_columns(&varied),
        )
    });
    let moved = &units.back * &form.levels;
    let levels = first.levels.iter().zip(moved.iter()).map(|(first, moved)| first + moved).collect();
    Ok(Refined { model, levels, covariance, search })
}

/// What a search from a start led to.
struct Searched {
    form: Form,
    /// K of the start in its coordinates.
    k: DMatrix<f64>,
    found: Found,
}

/// A search in rounds: after each the states are in units in which they are of size one, and the directions those of
/// where it stands. None if the start has no errors.
fn searched(
    record: &JointRecord<'_>,
    (mut form, mut k): (Form, DMatrix<f64>),
    what: Refinement,
    floor: &DMatrix<f64>,
    options: &Search,
    (deadline, monitor): (Deadline, Monitor<'_>),
) -> Result<Option<Searched>, Error> {
    let mut all: Option<Searched> = None;
    loop {
        let Some(sizes) = form.state_sizes(record, what.refine) else { return Ok(all) };
        form.divide_states(&sizes);
        k.row_iter_mut().zip(&sizes).for_each(|(mut row, size)| row /= *size);
        let Some(basis) = directions(&form, what) else { return Ok(all) };
        let mut errors = Errors::new(record, what.refine, form, basis, floor.clone());
        let zeros = vec![0.0; errors.directions()];
        let done = all.as_ref().map_or(0, |all| all.found.costs.len() - 1);
        let left = options.max_iterations.saturating_sub(done);
        let round = Search { max_iterations: left.min(ROUND), ..options.clone() };
        let told = |now: Progress| monitor(Progress { iteration: now.iteration + done, ..now });
        let Ok(mut found) = search(&mut errors, &zeros, &round, f64::NEG_INFINITY, deadline, &told)? else {
            return Ok(all);
        };
        form = errors.form(&found.parameters);
        // Along the directions of where it stands there may be a descent again.
        let goes_on = match found.stopped {
            Stopped::MaxIterations => left > ROUND,
            Stopped::NoDescent => found.costs.len() > 1 && left > 0,
            Stopped::Converged | Stopped::TimeLimit => false,
        };
        if let Some(before) = all.take() {
            found.costs.splice(..1, before.found.costs);
            found.unstable_steps += before.found.unstable_steps;
        }
        all = Some(Searched { form: form.clone(), k: k.clone(), found });
        if !goes_on {
            return Ok(all);
        }
    }
}

/// K of the least errors one step ahead of a plant that is known: found from one that may predict, else from zero.
fn best_predictor<'r>(
    record: &'r JointRecord<'r>,
    plant: &Form,
    k: DMatrix<f64>,
    floor: &DMatrix<f64>,
    options: &Search,
    (deadline, monitor): (Deadline, Monitor<'_>),
) -> Result<Linearized<'r>, Error> {
    let with = |k: &DMatrix<f64>| {
        let model = StateSpace { k: k.clone(), ..plant.model() };
        Form { levels: plant.levels.clone(), ..Form::of(&model, Refine::Prediction) }
    };
    // dA = -dK H, dB = [-dK D, dK].
    let none = with(&DMatrix::zeros(k.nrows(), k.ncols()));
    let mut basis = DMatrix::zeros(none.flat().len(), k.len());
    for (place, mut direction) in basis.column_iter_mut().enumerate() {
        let mut one = DMatrix::zeros(k.nrows(), k.ncols());
        one[place] = 1.0;
        direction.copy_from(&(with(&one).flat() - none.flat()));
    }
    let mut form = with(&k);
    if !is_stable(&form.a) {
        form = none;
    }
    let mut errors = Errors::new(record, Refine::Prediction, form, basis.clone(), floor.clone());
    let zeros = vec![0.0; errors.directions()];
    let found = search(&mut errors, &zeros, options, f64::NEG_INFINITY, deadline, monitor)?;
    let found = found.map_err(|Unstable| no_errors())?;
    Linearized::at(record, Refine::Prediction, errors.form(&found.parameters), basis, floor)
}

/// Directions in which errors may become smaller: across all changes of coordinates, then D and the levels as far as
/// they are free. None where singular values do not converge.
fn directions(form: &Form, what: Refinement) -> Option<DMatrix<f64>> {
    let across = across_coordinates(&form.a, &[&form.b], &form.h)?;
    let direct = if what.feedthrough { form.d.len() } else { 0 };
    let levels = if what.constant { form.levels.len() } else { 0 };
    let mut basis = DMatrix::zeros(form.flat().len(), across.ncols() + direct + levels);
    let (rows, columns) = across.shape();
    basis.view_mut((0, 0), (rows, columns)).copy_from(&across);
    (0..direct).for_each(|entry| basis[(rows + entry, columns + entry)] = 1.0);
    let first = rows + form.d.len();
    (0..levels).for_each(|level| basis[(first + level, columns + direct + level)] = 1.0);
    Some(basis)
}

/// Errors with their normal equations.
struct Linearized<'r> {
    errors: Errors<'r>,
    form: Form,
    basis: DMatrix<f64>,
}

impl<'r> Linearized<'r> {
    fn at(
        record: &'r JointRecord<'r>,
        refine: Refine,
        form: Form,
        basis: DMatrix<f64>,
        floor: &DMatrix<f64>,
    ) -> Result<Self, Error> {
        let mut errors = Errors::new(record, refine, form.clone(), basis.clone(), floor.clone());
        let zeros = vec![0.0; errors.directions()];
        errors.evaluate(&zeros).map_err(|Unstable| no_errors())?;
        errors.linearize().map_err(|Unstable| no_errors())?;
        Ok(Self { errors, form, basis })
    }

    /// The model, with the covariance of these errors.
    fn model(&self) -> StateSpace {
        StateSpace { noise_covariance: self.errors.covariance.clone(), ..self.form.model() }
    }

    /// How the matrices of the model vary: as many independent variations of variance 1 as there are directions. Their
    /// covariance is G^-1, or G^-1 (cov g) G^-1 where that is another one. None where a direction is not determined.
    fn variations(&self, scores: Option<&[f64]>) -> Option<Vec<StateSpace>> {
        let size = self.basis.ncols();
        let matrix = DMatrix::from_row_slice(size, size, self.errors.matrix());
        let scales: Vec<f64> = matrix.diagonal().iter().map(|entry| entry.sqrt()).collect();
        let scaled = |matrix: &DMatrix<f64>| {
            DMatrix::from_fn(size, size, |row, column| matrix[(row, column)] / scales[row] / scales[column])
        };
        let (values, vectors) = symmetric_eigen(&scaled(&matrix))?;
        let largest = values.iter().copied().fold(0.0, f64::max);
        if !values.iter().all(|value| *value > UNDETERMINED * largest) {
            return None;
        }
        let root = DMatrix::from_diagonal(&values.map(|value| 1.0 / value.sqrt()));
        let mut factor = &vectors * root;
        if let Some(scores) = scores {
            let (found, own) = symmetric_eigen(&scaled(&DMatrix::from_row_slice(size, size, scores)))?;
            let root = DMatrix::from_diagonal(&found.map(|value| value.max(0.0).sqrt()));
            factor = &factor * factor.transpose() * own * root;
        }
        factor.row_iter_mut().zip(&scales).for_each(|(mut row, scale)| row /= *scale);
        Some(
            factor
                .column_iter()
                .map(|column| self.variation(&self.form.like((&self.basis * column).as_slice())))
                .collect(),
        )
    }

    /// dF = dA + dK H + K dH and dG = dB + dK D + K dD, with K and dK where there are any.
    fn variation(&self, moved: &Form) -> StateSpace {
        let (own, by) = (self.form.model(), moved.model());
        let m = moved.d.ncols();
        StateSpace {
            f: &moved.a + &by.k * &own.h + &own.k * &moved.h,
            g: moved.b.columns(0, m) + &by.k * &own.d + &own.k * &moved.d,
            ..by
        }
    }
}

/// The units of a search: inputs of root mean square 1, outputs in which the errors of a start have covariance I.
struct Units {
    inputs: Vec<f64>,
    outputs: Vec<f64>,
    /// From deviations of outputs to these units, and back.
    root: DMatrix<f64>,
    back: DMatrix<f64>,
    /// What of errors is nothing, in these units.
    floor: DMatrix<f64>,
}

/// Outputs and inputs in these units.
struct Scaled {
    inputs: Vec<Vec<f64>>,
    outputs: Vec<Vec<f64>>,
}

impl Units {
    /// None where the start is unstable.
    ///
    /// # Errors
    /// [`Error::Undetermined`] if nothing is left of an output.
    fn of(
        record: &JointRecord<'_>,
        start: &RefinementStart,
        what: Refinement,
    ) -> Result<Option<Self>, Error> {
        let rows = || record.segments.iter().cloned().flatten();
        let size = |signal: &[f64], level: f64| {
            let mean = rows().map(|row| (signal[row] - level).powi(2)).sum::<f64>() / samples(record);
            if mean > 0.0 { mean.sqrt() } else { 1.0 }
        };
        let inputs = record.inputs.iter().map(|input| size(input, 0.0)).collect();
        let outputs: Vec<f64> =
            record.outputs.iter().zip(&start.levels).map(|(output, level)| size(output, *level)).collect();
        let sizes = DMatrix::from_diagonal(&DVector::from_column_slice(&outputs));
        let floor = &sizes * &sizes * NOTHING_LEFT;
        let form =
            Form { levels: DVector::from_column_slice(&start.levels), ..Form::of(&start.model, what.refine) };
        let none = DMatrix::zeros(form.flat().len(), 0);
        let mut errors = Errors::new(record, what.refine, form, none, floor.clone());
        if errors.evaluate(&[]).is_err() {
            return Ok(None);
        }
        let exact = |place: &usize| errors.covariance[(*place, *place)] <= EXACT * outputs[*place].powi(2);
        if let Some(place) = (0..outputs.len()).find(exact) {
            return Err(Error::undetermined(
                Vec::new(),
                format!(
                    "nothing is left of output {} that could be made smaller: the model explains it exactly; leave `refine` out",
                    place + 1
                ),
            ));
        }
        let factor = errors.covariance.clone().cholesky().ok_or_else(no_errors)?;
        let l = outputs.len();
        let back = factor.l();
        let root = back.solve_lower_triangular(&DMatrix::identity(l, l)).ok_or_else(no_errors)?;
        Ok(Some(Self { inputs, outputs, floor: &root * floor * root.transpose(), root, back }))
    }

    fn record(&self, record: &JointRecord<'_>, levels: &[f64]) -> Scaled {
        let inputs = record.inputs.iter().zip(&self.inputs);
        let rows = record.outputs.first().map_or(0, |output| output.len());
        let output = |row: &[f64]| -> Vec<f64> {
            let each = || row.iter().zip(&record.outputs).zip(levels);
            let sum = |t: usize| each().map(|((weight, output), level)| weight * (output[t] - level)).sum();
            (0..rows).map(sum).collect()
        };
        let weights: Vec<Vec<f64>> = self.root.row_iter().map(|row| row.iter().copied().collect()).collect();
        Scaled {
            inputs: inputs.map(|(input, size)| input.iter().map(|value| value / size).collect()).collect(),
            outputs: weights.iter().map(|row| output(row)).collect(),
        }
    }

    /// A model of the signals in these units.
    fn to_units(&self, model: &StateSpace) -> StateSpace {
        changed(model, &self.root, &self.back, self.inputs.iter().copied())
    }

    /// A model of the signals in their own units, of one in these.
    fn without_units(&self, model: &StateSpace) -> StateSpace {
        changed(model, &self.back, &self.root, self.inputs.iter().map(|size| 1.0 / size))
    }

    /// How large signals are outside of these units, and states.
    fn sizes(&self, states: usize) -> Sizes {
        Sizes { inputs: self.inputs.clone(), outputs: self.outputs.clone(), states: vec![1.0; states] }
    }
}

/// A model of outputs that `to` makes of others and `back` makes these again of, and of inputs in units of these sizes.
fn changed(
    model: &StateSpace,
    to: &DMatrix<f64>,
    back: &DMatrix<f64>,
    sizes: impl ExactSizeIterator<Item = f64>,
) -> StateSpace {
    let sizes = DMatrix::from_diagonal(&DVector::from_iterator(sizes.len(), sizes));
    let StateSpace { f, g, h, d, k, noise_covariance, sample_time } = model;
    StateSpace {
        f: f.clone(),
        g: g * &sizes,
        h: to * h,
        d: to * d * &sizes,
        k: k * back,
        noise_covariance: to * noise_covariance * to.transpose(),
        sample_time: *sample_time,
    }
}

fn samples(record: &JointRecord<'_>) -> f64 {
    record.segments.iter().map(std::ops::Range::len).sum::<usize>() as f64
}

fn no_errors() -> Error {
    Error::undetermined(
        Vec::new(),
        "no model to start from has errors that can be made smaller: it is unstable, or nothing is left of an output; leave `refine` out, \
         or take another order",
    )
}
