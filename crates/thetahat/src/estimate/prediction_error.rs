//! The estimate of least squared prediction errors for the general family: search, initial conditions, covariance;
//! where the search begins is in `ranking`, and what it takes from smaller models in `nested`.

mod nested;
mod ranking;

use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use thetahat_numerics::optimize::{
    Deadline, Found, Monitor, Objective, Search, Stopped, best_free, predicted_decrease, search,
};
use thetahat_numerics::regression::{Taps, condition};

use super::arx::{arx, estimate_is_for_f, out_of_range, rows};
use super::experiment_data::{ExperimentData, PredictionErrors};
use super::outcome::{SearchOutcome, StartOutcome, search_outcome};
use super::polynomials::Unusable;
use super::predictor::{InitialCondition, Predictor};
use super::uncertainty::{autoregression, backward_filtered_products, coloured};
use super::{Estimate, Initial, Procedure};
use crate::Error;
use crate::data::Record;
use crate::model::{Orders, PolynomialModel, Structure, cancel, near_cancellation, polynomial::roots};
use crate::respond::{NOTHING_LEFT, are_worth};
pub(super) use ranking::TWIN;

/// A search from the best start has ended after so many iterations, where there is nothing to be found elsewhere.
const EASY_ITERATIONS: usize = 5;
/// Above this condition number the Gram matrix does not give the covariance to a thousandth.
const MAXIMUM_CONDITION: f64 = 5e6;
/// A root of C or F that is nearer to the unit circle is on it.
pub(super) const ON_CIRCLE: f64 = 1e-6;

pub(crate) fn drop_is_not_for_f() -> Error {
    Error::argument(
        "initial",
        "drop is for models without F, whose errors depend on few samples; use zero, estimate or auto",
    )
}

/// How the initial conditions are treated.
fn begins(
    data: &impl ExperimentData,
    orders: &Orders,
    initial: Initial,
) -> Result<(InitialCondition, bool), Error> {
    let filtered = orders.has_f();
    // In the middle of a log nothing is at rest.
    let measured = data.is_measured_before();
    match initial {
        Initial::Drop if filtered => Err(drop_is_not_for_f()),
        Initial::Zero => Ok((InitialCondition::Zero, false)),
        Initial::Estimate if !filtered => Err(estimate_is_for_f()),
        Initial::Drop | Initial::Estimate => Ok((InitialCondition::Unknown, false)),
        Initial::Auto => Ok((InitialCondition::Unknown, filtered && !measured)),
    }
}

/// Fits A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t - nk_j) + C(q)/D(q) e(t) by a search for the least sum of squared
/// prediction errors from several starts; an ARX model in one step.
pub(super) fn prediction_error<D: ExperimentData>(
    data: &D,
    orders: &Orders,
    initial: Initial,
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<Estimate, Error> {
    if let (true, Some(record)) = (orders.is_linear(), data.record()) {
        return arx(record, orders, initial);
    }
    options.check(&orders.names())?;
    data.check(orders)?;
    let (begin, choose) = begins(data, orders, initial)?;
    let mut predictor = data.errors(orders, begin);
    enough(&predictor, orders)?;
    let energy = data.energy();
    if !energy.is_normal() && energy != 0.0 {
        return Err(out_of_range());
    }
    let deadline = Deadline::after(options.time_limit);
    let job = Job { options, smallest: NOTHING_LEFT * energy, deadline, monitor };
    let mut beginning = job.beginning(data, orders, begin, &mut predictor)?;
    let mut reached = if choose {
        job.choose(data, orders, predictor, &mut beginning)?
    } else {
        let initial = match begin {
            InitialCondition::Zero => Initial::Zero,
            InitialCondition::Unknown | InitialCondition::UnknownInputs if orders.has_f() => {
                Initial::Estimate
            }
            InitialCondition::Unknown | InitialCondition::UnknownInputs => Initial::Drop,
        };
        let found = job.search_from(data, orders, begin, &mut predictor, &mut beginning)?;
        let found = found.ok_or_else(|| hopeless(orders))?;
        Reached { predictor, found, initial }
    };
    if begin != InitialCondition::Zero && data.has_unknown_inputs(orders) {
        reached = job.with_inputs(data, orders, reached, &beginning.parameters)?;
    }
    let Reached { predictor, found, initial } = reached;
    beginning.reached(found.cost() / predictor.samples() as f64);
    job.finish(orders, &predictor, found, beginning, initial)
}

/// Where a search has ended. The predictor stands there.
struct Reached<E> {
    predictor: E,
    found: Found,
    initial: Initial,
}

/// What a search on a record is for: the samples, the orders, and what stands before a segment.
#[derive(Clone, Copy)]
struct Problem<'p, 'r> {
    record: &'p Record<'r>,
    orders: &'p Orders,
    begin: InitialCondition,
}

impl<'r> Problem<'_, 'r> {
    fn predictor(&self) -> Predictor<'r> {
        Predictor::new(self.record, self.orders, self.begin)
    }
}

/// What all searches of an estimate share.
struct Job<'a> {
    options: &'a Search,
    smallest: f64,
    deadline: Deadline,
    monitor: Monitor<'a>,
}

impl Job<'_> {
    /// The best start for the search on the whole record.
    ///
    /// For a long record the starts are compared on segments that are spread over it, by short searches: their minimum
    /// is close to that of all samples, which then takes a few iterations.
    fn beginning<D: ExperimentData>(
        &self,
        data: &D,
        orders: &Orders,
        begin: InitialCondition,
        predictor: &mut impl PredictionErrors,
    ) -> Result<TrackStart, Error> {
        if let Some(thin) = data.thinned() {
            // In the middle of a log nothing is at rest.
            let thin = thin.record();
            let problem = Problem { record: &thin, orders, begin: InitialCondition::Unknown };
            let mut small = problem.predictor();
            let near = self.ranked(problem, &mut small).and_then(|mut beginning| {
                let found = self.search_from(&thin, orders, problem.begin, &mut small, &mut beginning)?;
                Ok(found.map(|found| (found, beginning)))
            });
            match near {
                Err(Error::Interrupted) => return Err(Error::Interrupted),
                Err(_) | Ok(None) => {}
                Ok(Some((found, TrackStart { mut starts, unstable_pole, .. }))) => {
                    starts[0].reached = Some(found.cost() / small.samples() as f64);
                    let parameters = found.parameters;
                    let samples = Some(small.samples());
                    return Ok(TrackStart {
                        parameters,
                        orthogonal: false,
                        starts,
                        unstable_pole,
                        samples,
                        compared: true,
                        found: None,
                    });
                }
            }
        }
        let record = data.record().ok_or_else(|| hopeless(orders))?;
        self.ranked(Problem { record, orders, begin }, predictor)
    }

    /// Searches from the beginning, if that was not done before. The predictor is left at what was found.
    ///
    /// A search that is not soon at its end may be on the way to a minimum of its own: then starts from nested models
    /// are compared with what it found, and always where these models are few and the record is not long.
    fn search_from(
        &self,
        data: &impl ExperimentData,
        orders: &Orders,
        begin: InitialCondition,
        predictor: &mut impl PredictionErrors,
        beginning: &mut TrackStart,
    ) -> Result<Option<Found>, Error> {
        let mut found = match &beginning.found {
            Some(found) => Some(found.clone()),
            None => self.search(predictor, &beginning.parameters, beginning.orthogonal)?.ok(),
        };
        let easy = |found: &Found| {
            let soon = found.stopped == Stopped::Converged && found.costs.len() <= EASY_ITERATIONS + 1;
            soon && !data.record().is_some_and(|record| nested::are_few(record, orders))
        };
        if !beginning.compared && !found.as_ref().is_some_and(easy) && !self.deadline.is_over() {
            beginning.compared = true;
            let nested = match data.record() {
                Some(record) => {
                    self.nested_below(Problem { record, orders, begin }, predictor, found.as_ref())?
                }
                None => None,
            };
            if let Some(start) = nested
                && let Ok(better) = self.search(predictor, &start.parameters, start.orthogonal)?
            {
                beginning.starts.insert(0, start.outcome);
                return Ok(Some(better));
            }
        } else if beginning.found.is_none() {
            return Ok(found);
        }
        if let Some(found) = &mut found {
            let _ = best_free(predictor, &found.parameters);
            let _ = predictor.linearize();
        }
        Ok(found)
    }

    /// Estimates the initial conditions where that is worth its parameters: N ln(V_zero/V_estimate) > n ln N.
    ///
    /// One of the two searches is done, where a step of the other predicts that it cannot change the answer.
    fn choose<'d, D: ExperimentData>(
        &self,
        data: &'d D,
        orders: &Orders,
        mut estimated: D::Errors<'d>,
        beginning: &mut TrackStart,
    ) -> Result<Reached<D::Errors<'d>>, Error> {
        let mut resting = data.errors(orders, InitialCondition::Zero);
        let samples = estimated.samples();
        let rows = resting.samples() as f64;
        let more = estimated.initial_conditions();
        // Costs of both kinds as means; an exact fit from rest needs no better one.
        let worth = |zero: f64, estimate: f64| {
            are_worth(samples, zero / rows, estimate / samples as f64, more, self.smallest / rows)
        };
        let start = beginning.parameters.clone();
        let costs = (best_free(&mut resting, &start), best_free(&mut estimated, &start));
        let at_rest_first =
            beginning.found.is_none() && matches!(costs, (Ok(zero), Ok(free)) if !worth(zero, free));
        let mut at_rest = None;
        if at_rest_first
            && let Some(found) =
                self.search_from(data, orders, InitialCondition::Zero, &mut resting, beginning)?
        {
            let predicted = best_free(&mut estimated, &found.parameters)
                .map_or(f64::INFINITY, |cost| cost - predicted_decrease(&mut estimated));
            if !worth(found.cost(), predicted) {
                return Ok(Reached { predictor: resting, found, initial: Initial::Zero });
            }
            at_rest = Some(found);
        }
        let free = self.search_from(data, orders, InitialCondition::Unknown, &mut estimated, beginning)?;
        let Some(free) = free else {
            let found = at_rest.ok_or_else(|| hopeless(orders))?;
            return Ok(Reached { predictor: resting, found, initial: Initial::Zero });
        };
        if at_rest.is_none() {
            let predicted = best_free(&mut resting, &free.parameters)
                .map_or(f64::INFINITY, |cost| cost - predicted_decrease(&mut resting));
            if !worth(predicted, free.cost()) {
                at_rest = self.search(&mut resting, &free.parameters, false)?.ok();
            }
        }
        if let Some(found) = at_rest.filter(|found| !worth(found.cost(), free.cost())) {
            return Ok(Reached { predictor: resting, found, initial: Initial::Zero });
        }
        Ok(Reached { predictor: estimated, found: free, initial: Initial::Estimate })
    }

    /// Estimates what inputs before the record have done where that is worth its parameters, beside the other initial
    /// conditions.
    ///
    /// No search is done where a step predicts that it cannot change the answer.
    fn with_inputs<'d, D: ExperimentData>(
        &self,
        data: &'d D,
        orders: &Orders,
        reached: Reached<D::Errors<'d>>,
        start: &[f64],
    ) -> Result<Reached<D::Errors<'d>>, Error> {
        let mut wide = data.errors(orders, InitialCondition::UnknownInputs);
        let samples = wide.samples();
        let mean = |cost: f64, predictor: &D::Errors<'d>| cost / predictor.samples() as f64;
        let (given, few) =
            (mean(reached.found.cost(), &reached.predictor), reached.predictor.initial_conditions());
        let unknown = wide.initial_conditions();
        let worth = |without: f64, with: f64, few: usize| {
            unknown > few
                && samples > orders.parameters() + unknown
                && are_worth(samples, without, with, unknown - few, self.smallest / samples as f64)
        };
        let mut best: Option<(f64, &[f64])> = None;
        for parameters in [&reached.found.parameters, start] {
            let predicted = best_free(&mut wide, parameters).map(|cost| cost - predicted_decrease(&mut wide));
            if let Ok(predicted) = predicted
                && best.is_none_or(|(least, _)| predicted < least)
            {
                best = Some((predicted, parameters));
            }
        }
        let Some((_, start)) = best.filter(|(predicted, _)| worth(given, mean(*predicted, &wide), few))
        else {
            return Ok(reached);
        };
        let Ok(found) = self.search(&mut wide, start, false)? else { return Ok(reached) };
        let with = mean(found.cost(), &wide);
        if !worth(given, with, few) {
            return Ok(reached);
        }
        // Not a better place alone.
        let mut narrow = data.errors(orders, InitialCondition::Unknown);
        let same_place = best_free(&mut narrow, &found.parameters);
        if let Ok(cost) = same_place
            && !worth(mean(cost, &narrow), with, narrow.initial_conditions())
            && let Ok(found) = self.search(&mut narrow, &found.parameters, false)?
        {
            return Ok(Reached { predictor: narrow, found, initial: Initial::Estimate });
        }
        Ok(Reached { predictor: wide, found, initial: Initial::Estimate })
    }

    fn search<E: PredictionErrors>(
        &self,
        predictor: &mut E,
        parameters: &[f64],
        orthogonal: bool,
    ) -> Result<Result<Found, Unusable>, Error> {
        self.search_with(predictor, parameters, &Search { orthogonal, ..self.options.clone() })
    }

    fn search_with<E: PredictionErrors>(
        &self,
        predictor: &mut E,
        parameters: &[f64],
        options: &Search,
    ) -> Result<Result<Found, Unusable>, Error> {
        search(predictor, parameters, options, self.smallest, self.deadline, self.monitor)
    }

    /// The estimate of a search.
    fn finish(
        &self,
        orders: &Orders,
        predictor: &impl PredictionErrors,
        found: Found,
        beginning: TrackStart,
        initial: Initial,
    ) -> Result<Estimate, Error> {
        let found = told(orders, found);
        let (size, samples) = (found.parameters.len(), predictor.samples());
        let cost = found.cost();
        let initial_conditions = predictor.initial_conditions();
        let noise_variance = cost / (samples - size - initial_conditions) as f64;
        let known = uncertainty(predictor, orders, noise_variance);
        // At a minimum only a flat cost has none; elsewhere, and at the boundary of stability, it may be a matter of
        // the place.
        let settled =
            matches!(found.stopped, Stopped::Converged | Stopped::NoDescent) && !found.stability_bound;
        if known.is_none() && settled {
            return Err(flat(orders, &found.parameters));
        }
        let (covariance, condition) = known.map(|known| (known.covariance, known.condition)).unzip();
        let outcome = SearchOutcome {
            start_samples: beginning.samples,
            unstable_pole: beginning.unstable_pole,
            ..search_outcome(self.options, &found, predictor, beginning.starts)
        };
        Ok(Estimate {
            parameters: found.parameters,
            covariance,
            noise_variance,
            samples,
            mse: cost / samples as f64,
            condition,
            initial,
            procedure: Procedure::PredictionError(outcome),
        })
    }
}

/// Where the search on the whole record begins.
struct TrackStart {
    parameters: Vec<f64>,
    /// Whether the search goes on from there in the coordinates of the objective.
    orthogonal: bool,
    /// All starts, the best first.
    starts: Vec<StartOutcome>,
    /// The largest modulus of a pole of theirs that had to be reflected.
    unstable_pole: Option<f64>,
    /// How many samples they were compared on, if not on all.
    samples: Option<usize>,
    /// Whether starts from nested models were evaluated, or are not worth their time.
    compared: bool,
    /// What a search on the whole record has found already.
    found: Option<Found>,
}

impl TrackStart {
    /// Notes the mean of e^2 that the search from the best start reached.
    fn reached(&mut self, cost: f64) {
        if let Some(start) = self.starts.first_mut() {
            start.reached = Some(cost);
        }
    }
}

/// The error of a record on which no start works.
fn hopeless(orders: &Orders) -> Error {
    Error::undetermined(
        orders.names(),
        "no start of the search has a finite cost; scale the channels towards one, or lower the orders",
    )
}

/// What was found, said to be at the boundary of stability where C or an F has a root on the unit circle: a search in
/// coordinates that have no boundary does not see it.
pub(super) fn told(orders: &Orders, found: Found) -> Found {
    let model = PolynomialModel::from_parameters(orders, &found.parameters, None, 0.0, 1.0);
    let is_on_circle = |polynomial: &Vec<f64>| {
        let roots = roots(polynomial).unwrap_or_default();
        roots.iter().any(|root| root.re.hypot(root.im) > 1.0 - ON_CIRCLE)
    };
    let at_boundary = model.is_ok_and(|model| std::iter::once(&model.c).chain(&model.f).any(is_on_circle));
    Found { stability_bound: found.stability_bound || at_boundary, ..found }
}

/// The covariance matrix of the parameters, and the condition number of psi.
struct Uncertainty {
    covariance: Vec<Vec<f64>>,
    condition: f64,
}

/// sigma^2 G^-1, or its form for coloured errors where there is no model of the noise; none where G is singular to
/// rounding.
fn uncertainty(
    predictor: &impl PredictionErrors,
    orders: &Orders,
    noise_variance: f64,
) -> Option<Uncertainty> {
    let (root, condition) = inverse_root(predictor)?;
    let covariance = if orders.structure() == Structure::Oe {
        let taken = orders.parameters() + predictor.initial_conditions();
        let colour = predictor.restricted_autoregression(taken)?;
        // On columns that are orthogonal: where parameters can hardly be told apart, the sums over psi itself would
        // lose them in rounding twice, and variances could come out negative.
        let products = predictor.backward_filtered_products(&root.transpose(), &colour.monic)?;
        coloured(&root, colour.variance * colour.inflation(predictor.samples(), taken), &products)
    } else {
        &root * root.transpose() * noise_variance
    };
    Some(Uncertainty { covariance: rows(&covariance), condition })
}

/// The covariance of all parameters of a model of which some were not estimated, those of a constant and a trend, if
/// they were, and the Gauss-Newton step to their estimate. None where they cannot be told from the others.
pub(super) fn beside(
    data: &impl ExperimentData,
    orders: &Orders,
    estimate: &Estimate,
    parameters: &[f64],
) -> Option<(Vec<Vec<f64>>, Vec<f64>)> {
    let mut predictor = predictor_of(data, orders, estimate);
    best_free(&mut predictor, parameters).ok()?;
    predictor.linearize().ok()?;
    let known = uncertainty(&predictor, orders, estimate.noise_variance())?;
    let (root, _) = inverse_root(&predictor)?;
    let step = &root * (root.transpose() * DVector::from_column_slice(predictor.right()));
    Some((known.covariance, step.as_slice().to_vec()))
}

/// The prediction errors of data with the initial conditions that an estimate from them has.
pub(super) fn predictor_of<'d, D: ExperimentData>(
    data: &'d D,
    orders: &Orders,
    estimate: &Estimate,
) -> D::Errors<'d> {
    let begin =
        if estimate.initial() == Initial::Zero { InitialCondition::Zero } else { InitialCondition::Unknown };
    let predictor = data.errors(orders, begin);
    if estimate.procedure().initial_conditions() > predictor.initial_conditions() {
        return data.errors(orders, InitialCondition::UnknownInputs);
    }
    predictor
}

/// The covariance of an estimate of least squares whose errors are coloured, whatever its structure: of `uncertainty`
/// with psi filtered backwards in time by an autoregression of the errors. None where it cannot be had.
pub(super) fn coloured_covariance(
    record: &Record<'_>,
    orders: &Orders,
    estimate: &Estimate,
) -> Option<Vec<Vec<f64>>> {
    let mut predictor = predictor_of(record, orders, estimate);
    best_free(&mut predictor, estimate.parameters()).ok()?;
    predictor.linearize();
    let (root, _) = inverse_root(&predictor)?;
    let (residuals, segments) = predictor.residuals();
    let taken = orders.parameters() + predictor.initial_conditions();
    let colour = autoregression(&residuals, &segments, taken);
    let products = backward_products(&predictor.columns(), &colour.monic);
    let products = root.transpose() * products * &root;
    Some(rows(&coloured(&root, colour.variance, &products)))
}

/// sum zeta zeta' over all segments, zeta being psi filtered backwards in time by 1/A(q^+1), A = `monic`.
pub(super) fn backward_products(segments: &[Vec<Vec<f64>>], monic: &[f64]) -> DMatrix<f64> {
    let size = segments.first().map_or(0, Vec::len);
    let taps: Vec<Taps> = (0..size).map(|signal| Taps { signal, first: 0, count: 1, sign: 1.0 }).collect();
    let mut sum = DMatrix::zeros(size, size);
    for columns in segments {
        let signals: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let all = 0..signals.first().map_or(0, |column| column.len());
        sum += backward_filtered_products(&signals, &taps, &all, std::slice::from_ref(&all), None, monic);
    }
    sum
}

/// Whether the errors tell the parameters apart, where the predictor stands.
pub(super) fn is_determined(predictor: &impl PredictionErrors) -> bool {
    inverse_root(predictor).is_some()
}

/// R^-1 with R'R = G, so that psi R^-1 has orthonormal columns, and the condition number of psi. By Cholesky of the
/// Gram matrix, or by QR where that is not exact enough: what is left of a column beside free responses that are nearly
/// the same has lost as many digits as a condition number would take.
pub(super) fn inverse_root(predictor: &impl PredictionErrors) -> Option<(DMatrix<f64>, f64)> {
    let size = predictor.right().len();
    let matrix = DMatrix::from_row_slice(size, size, predictor.matrix());
    let scales = matrix.diagonal().map(f64::sqrt);
    let unit = DMatrix::from_fn(size, size, |i, j| matrix[(i, j)] / scales[i] / scales[j]);
    // What the free responses leave of a column may be nothing but rounding, and its square negative.
    if scales.iter().all(|scale| *scale > 0.0)
        && let Some(factor) = Cholesky::new(unit)
        && let triangle = factor.l().transpose()
        && let Some(condition) = condition(&triangle, predictor.samples())
        && condition * predictor.cancellation() <= MAXIMUM_CONDITION
    {
        return Some((inverted(&triangle, &scales)?, condition));
    }
    root_of(&predictor.factor()?)
}

/// The same from the factor of psi; none where it tells that psi is singular.
pub(super) fn root_of(factor: &LeastSquares<f64, Dyn>) -> Option<(DMatrix<f64>, f64)> {
    if !factor.rank().is_full() {
        return None;
    }
    let mut triangle = factor.factor();
    let scales = DVector::from_iterator(triangle.ncols(), triangle.column_iter().map(|column| column.norm()));
    for (mut column, scale) in triangle.column_iter_mut().zip(&scales) {
        column.unscale_mut(*scale);
    }
    Some((inverted(&triangle, &scales)?, factor.condition()))
}

/// The inverse of a triangle of which the columns were divided by `scales`.
fn inverted(triangle: &DMatrix<f64>, scales: &DVector<f64>) -> Option<DMatrix<f64>> {
    let size = triangle.ncols();
    let mut inverse = triangle.solve_upper_triangular(&DMatrix::identity(size, size))?;
    inverse.column_iter_mut().for_each(|mut column| column.component_div_assign(scales));
    Some(inverse)
}

/// There must be more samples that count than parameters and initial conditions.
fn enough(predictor: &impl PredictionErrors, orders: &Orders) -> Result<(), Error> {
    let unknown = orders.parameters() + predictor.initial_conditions();
    if predictor.samples() > unknown {
        return Ok(());
    }
    Err(Error::undetermined(
        orders.names(),
        format!(
            "too few rows for the orders: {} parameters and {} initial conditions need more samples than that, and {} \
             count; give more rows, lower the orders, or start from zero",
            orders.parameters(),
            predictor.initial_conditions(),
            predictor.samples()
        ),
    ))
}

/// The error of a cost that does not depend on some combination of the parameters.
pub(super) fn flat(orders: &Orders, parameters: &[f64]) -> Error {
    let model = PolynomialModel::from_parameters(orders, parameters, None, 0.0, 1.0);
    let advice = model.ok().as_ref().and_then(near_cancellation).map_or_else(
        || "lower the orders, or excite the input more".to_owned(),
        |(pole, zero)| format!("{}; lower both orders by one", cancel(&pole, &zero)),
    );
    Error::undetermined(
        Vec::new(),
        format!("the cost is flat: other parameters fit as well, the data cannot tell them apart; {advice}"),
    )
}

#[cfg(test)]
mod tests;
