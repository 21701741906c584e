//! A tracker of one of several outputs that goes on from an ARX model of all of them.

use thetahat_core::nalgebra::DMatrix;

use super::{offset_level, unusable};
use crate::Error;
use crate::estimate::{Coupling, VectorArxOutcome};
use crate::model::{Entry, Orders, Parameter, Quantity, StateSpace, StateSpaceMatrix, StateSpaceModel};
use crate::report::Report;
use crate::track::checks::check;
use crate::track::equation::{equation, names};
use crate::track::plan::{PerChannel, TrackPlan};
use crate::track::tracker::Tracker;

/// What entries of a model in state space may differ by from those that its coefficients make.
const ROUNDING: f64 = 1e-9;

/// A coefficient of an equation, and the entries that it is a sum of, with its slopes by them.
struct Coefficient {
    value: f64,
    slopes: Vec<(Entry, f64)>,
}

/// The equation of one output.
struct Equation {
    orders: Orders,
    /// The outputs whose past it has, where it is not its own alone.
    coupled: usize,
    /// In the order of the tracker's parameters.
    coefficients: Vec<Coefficient>,
}

impl Tracker {
    /// A tracker of one of several outputs, counted from 0, that starts from an ARX model of all of them: as
    /// [`from_report`](Tracker::from_report) does from a report of one output. Where its A is full it is one of
    /// [`coupled`](Tracker::coupled) trackers.
    ///
    /// # Errors
    /// Those of `from_report`; [`Error::Report`] if the report is of another kind of model, or its matrices are not
    /// those of its A and B, as after a reduction; [`Error::Argument`] if there is no such output.
    pub fn from_report_of(report: &Report, output: usize, plan: &TrackPlan) -> Result<Self, Error> {
        let own = report.model.as_state_space().filter(|model| model.outputs.len() > 1 || output > 0);
        let Some(model) = own else { return Self::from_report(report, plan) };
        super::check_start(plan)?;
        let Some(outcome) = report.estimation.procedure.vector_arx() else {
            return Err(Error::report("of several outputs only an ARX model can be tracked; fit one"));
        };
        model.check()?;
        if output >= model.outputs.len() {
            let message = format!("there is no output {}; there are {}", output + 1, model.outputs.len());
            return Err(Error::argument("output", message));
        }
        let variance = model.noise_covariance[output][output];
        let Equation { orders, coupled, coefficients } = Equation::of(model, outcome, output)?;
        let relative = relative(model, &coefficients, variance)?;
        let samples = report.estimation.samples;
        let mut plan = plan.clone();
        if plan.offsets.is_none() {
            let past = model.outputs.iter().take(coupled);
            plan.offsets = Some(PerChannel {
                inputs: past.chain(&model.inputs).map(offset_level).collect::<Result<_, _>>()?,
                output: offset_level(&model.outputs[output])?,
            });
        }
        let lines = equation(&orders, coupled);
        if plan.scales.is_none() {
            plan.scales = Some(super::scales(&lines, &relative, samples));
        }
        check(&lines, &plan).map_err(unusable)?;
        let known: Vec<Parameter> = names(&orders, coupled)
            .into_iter()
            .zip(&coefficients)
            .map(|(name, coefficient)| Parameter { name, value: coefficient.value, standard_error: None })
            .collect();
        let constant = plan.constant.then_some(known.len());
        let tracker = Self::of(&orders, coupled, None, &plan)?;
        tracker.with_parameters(&known, constant, &relative, variance, samples)
    }
}

impl Equation {
    /// That of an output. The state space is the block observer form, with the sizes s of the outputs in H,
    ///
    /// ```text
    /// K = -A_i / s,   G = (B_i - A_i B_0) / s,   D = B_0
    /// ```
    ///
    /// so that a coefficient of A is an entry of K, and one of B an entry of G, and others where an input acts at once.
    fn of(model: &StateSpaceModel, outcome: &VectorArxOutcome, output: usize) -> Result<Self, Error> {
        let edited = || {
            Error::report(
                "the matrices are not those of A and B, as after a reduction or at another sample time; fit again",
            )
        };
        let StateSpace { g, h, d, k, .. } = model.matrices();
        let l = model.outputs.len();
        let VectorArxOutcome { na, nb, nk, coupling, a, b, .. } = outcome;
        if nb.len() != model.inputs.len() || nk.len() != nb.len() || a.len() != *na {
            return Err(edited());
        }
        let coupled = if *coupling == Coupling::Full { l } else { 0 };
        let size = if h.ncols() > output { h[(output, output)] } else { 1.0 };
        let state = |lag: usize, row: usize| (lag - 1) * l + row;
        let value = |table: &[Vec<Vec<Quantity>>], lag: usize, row: usize, column: usize| {
            let found = table.get(lag).and_then(|rows| rows.get(row)?.get(column));
            found.map(|quantity| quantity.value).ok_or_else(edited)
        };
        let same = |entry: Option<&f64>, value: f64| {
            let near =
                |found: &&f64| (**found - value).abs() <= ROUNDING * (found.abs() + value.abs() + 1e-300);
            entry.filter(near).map(|_| ()).ok_or_else(edited)
        };
        let mut coefficients = Vec::new();
        let past = if coupled > 0 { 0..l } else { output..output + 1 };
        for column in past {
            for lag in 1..=*na {
                let (value, row) = (value(a, lag - 1, output, column)?, state(lag, output));
                same(k.get((row, column)), -value / size)?;
                let entry = Entry { matrix: StateSpaceMatrix::K, row, column };
                coefficients.push(Coefficient { value, slopes: vec![(entry, -size)] });
            }
        }
        for (input, (nb, nk)) in nb.iter().zip(nk).enumerate() {
            let delay = model.delays.get(input).copied().unwrap_or(0);
            let first = nk.checked_sub(delay).ok_or_else(edited)?;
            for place in 0..*nb {
                let (lag, own) = (first + place, value(b, input, place, output)?);
                let direct = Entry { matrix: StateSpaceMatrix::D, row: output, column: input };
                if lag == 0 {
                    same(d.get((output, input)), own)?;
                    coefficients.push(Coefficient { value: own, slopes: vec![(direct, 1.0)] });
                    continue;
                }
                // B_i = s G + A_i B_0.
                let row = state(lag, output);
                let mut slopes = vec![(Entry { matrix: StateSpaceMatrix::G, row, column: input }, size)];
                let mut through = 0.0;
                for other in 0..if lag <= *na { l } else { 0 } {
                    let feeds = value(a, lag - 1, output, other)?;
                    through += feeds * d[(other, input)];
                    let entry = |matrix, row, column| Entry { matrix, row, column };
                    slopes.push((entry(StateSpaceMatrix::K, row, other), -size * d[(other, input)]));
                    slopes.push((entry(StateSpaceMatrix::D, other, input), feeds));
                }
                same(g.get((row, input)), (own - through) / size)?;
                coefficients.push(Coefficient { value: own, slopes });
            }
        }
        Ok(Self { orders: Orders::arx(*na, nb, nk)?, coupled, coefficients })
    }
}

/// P of an equation: the covariance of its coefficients over the variance of its errors.
fn relative(
    model: &StateSpaceModel,
    coefficients: &[Coefficient],
    variance: f64,
) -> Result<DMatrix<f64>, Error> {
    let Some(known) = &model.covariance else {
        return Err(Error::report(
            "the report has no covariance, as that of a model of many coefficients, so that it does not say how sure its model is; start \
             without it",
        ));
    };
    super::check_variance(variance)?;
    // An entry that is not there does not vary.
    let of = |coefficient: &Coefficient| -> Vec<(usize, f64)> {
        let place = |entry: &Entry| known.entries.iter().position(|other| other == entry);
        coefficient.slopes.iter().filter_map(|(entry, slope)| Some((place(entry)?, *slope))).collect()
    };
    let each: Vec<Vec<(usize, f64)>> = coefficients.iter().map(of).collect();
    let value =
        |i: usize, j: usize| known.values.get(i).and_then(|row| row.get(j)).copied().unwrap_or(f64::NAN);
    let count = each.len();
    let mut relative = DMatrix::zeros(count, count);
    for row in 0..count {
        for column in 0..=row {
            let mut sum = 0.0;
            for (first, slope) in &each[row] {
                for (second, other) in &each[column] {
                    sum += slope * other * (value(*first, *second) / 2.0 + value(*second, *first) / 2.0);
                }
            }
            (relative[(row, column)], relative[(column, row)]) = (sum / variance, sum / variance);
        }
    }
    Ok(relative)
}
