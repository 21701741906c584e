//! Matrices from a record, or from sums over parts of one: by a subspace method, with a search behind it, or as an ARX
//! model.

use std::ops::RangeInclusive;

use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::optimize::{Monitor, Search};

use super::StateSpacePlan;
use crate::Error;
use crate::data::{JointRecord, Log, Record};
use crate::estimate::{
    Constant, Initial, Method, Ordered, Procedure, Refine, Refinement, RefinementOutcome, RefinementStart,
    Subspace, SubspaceErrors, SubspaceOptions, SubspaceOutcome, SubspaceSums, VectorArxEstimate,
    VectorArxOptions, Weighting, estimate_monitored, products_of_innovations, refined, subspace, vector_arx,
    with_levels,
};
use crate::model::{EntryCovariance, Orders, PolynomialModel, Signal, StateSpace};

/// Singular values that a report keeps.
const MOST_VALUES: usize = 40;

/// What was estimated from a record.
pub(in crate::report) struct Estimated {
    pub(in crate::report) matrices: StateSpace,
    pub(in crate::report) levels: Vec<f64>,
    /// Whether these were estimated.
    pub(in crate::report) has_levels: bool,
    pub(in crate::report) covariance: Option<EntryCovariance>,
    pub(in crate::report) procedure: Procedure,
    /// The free parameters, and the degrees of freedom of the errors.
    pub(in crate::report) free: usize,
    pub(in crate::report) degrees: usize,
    /// The samples that have errors, and the mean products of these.
    pub(in crate::report) samples: usize,
    pub(in crate::report) mean: DMatrix<f64>,
    /// By how many samples more than asked all inputs are late.
    pub(in crate::report) delay: usize,
    /// The orders that the data offered to choose among.
    pub(in crate::report) offered: RangeInclusive<usize>,
}

/// N - p/l; a search for starts counts their states in p.
fn degrees(what: &str, free: usize, samples: usize, outputs: usize) -> Result<usize, Error> {
    let degrees = samples.checked_sub(free.div_ceil(outputs)).filter(|degrees| *degrees > 0);
    degrees.ok_or_else(|| {
        Error::undetermined(
            Vec::new(),
            format!(
                "{what} has {free} free parameters, and {samples} samples of {outputs} outputs are too few for them; give more rows, or \
                 ask for a lower order"
            ),
        )
    })
}

/// The model with errors of this mean square.
fn with_noise(matrices: StateSpace, mean: &DMatrix<f64>, samples: usize, degrees: usize) -> StateSpace {
    let mut noise_covariance = mean * (samples as f64 / degrees as f64);
    // A covariance is symmetric to the bit.
    noise_covariance.fill_lower_triangle_with_upper_triangle();
    StateSpace { noise_covariance, ..matrices }
}

fn integrates() -> Error {
    Error::undetermined(
        Vec::new(),
        "outputs that integrate have no level: leave the constant out (`constant` no)",
    )
}

/// An ARX model with several outputs.
pub(super) fn by_arx(
    record: &JointRecord<'_>,
    (options, delays): (&VectorArxOptions, &[usize]),
    constant: Constant,
    log: &Log,
) -> Result<Estimated, Error> {
    let find = |constant: bool| {
        vector_arx(record, &VectorArxOptions { constant, ..options.clone() }, log.sample_time())
    };
    let exact = |found: &VectorArxEstimate| {
        // What lagged products cannot tell from nothing.
        let record = record.clone().delayed(&vec![found.delay; delays.len()]);
        let products =
            products_of_innovations(&found.space, &record, &found.levels).ok_or_else(out_of_range)?;
        let all = record.segments.iter().map(std::ops::Range::len).sum::<usize>();
        Ok(products / all as f64)
    };
    of_arx(find, exact, delays, constant)
}

/// The same that `find` finds with a constant or without, whose errors `exact` says where products of signals do not
/// tell them from none.
pub(in crate::report) fn of_arx(
    find: impl Fn(bool) -> Result<VectorArxEstimate, Error>,
    exact: impl Fn(&VectorArxEstimate) -> Result<DMatrix<f64>, Error>,
    delays: &[usize],
    constant: Constant,
) -> Result<Estimated, Error> {
    let find = |constant: bool| {
        let found = find(constant)?;
        if found.levels.iter().all(|level| level.is_finite()) { Ok(found) } else { Err(integrates()) }
    };
    let mut found = with_levels(constant, find, |found| found.mdl)?;
    found.outcome.nk.iter_mut().zip(delays).for_each(|(nk, delay)| *nk += delay);
    let (samples, mut mean) = (found.samples, found.space.noise_covariance.clone());
    if mean.diagonal().iter().any(|variance| *variance == 0.0) {
        mean = exact(&found)?;
    }
    let degrees = degrees("the model", found.free_parameters, samples, mean.nrows())?;
    Ok(Estimated {
        matrices: with_noise(found.space, &mean, samples, degrees),
        levels: found.levels,
        has_levels: found.outcome.constant,
        covariance: found.covariance,
        procedure: Procedure::from(found.outcome),
        free: found.free_parameters,
        degrees,
        samples,
        mean,
        delay: found.delay,
        offered: 0..=0,
    })
}

/// The states of a record, and a search from there if one is asked for.
pub(super) fn by_subspace(
    record: &JointRecord<'_>,
    plan: &StateSpacePlan,
    constant: Constant,
    (log, monitor): (&Log, Monitor<'_>),
) -> Result<Estimated, Error> {
    let found = Ordered::new(record, &plan.subspace, plan.orders.as_ref(), constant)?;
    let (order, subspace) = (found.order, &found.subspace);
    let mut levels = subspace.levels(order).ok_or_else(integrates)?;
    let mut matrices = subspace.state_space(order, log.sample_time())?;
    let samples = record.segments.iter().map(std::ops::Range::len).sum::<usize>();
    let outputs = record.outputs.len();
    // Each segment has errors from a state of its own, which is found with them.
    let starts = record.segments.iter().map(|segment| order.min(segment.len() * outputs)).sum::<usize>();
    let degrees = degrees_of_order(&found, starts, (samples, outputs))?;
    let (mut covariance, mut refinement) = (None, None);
    if let Some(refine) = plan.refine {
        let start = RefinementStart { name: subspace.weighting().to_string(), model: matrices, levels };
        let mut starts: Vec<RefinementStart> =
            std::iter::once(start).chain(other_start(record, subspace, order, log)).collect();
        starts.extend(polynomial_start(record, plan, (order, &starts[0]), log, monitor)?);
        let what = Refinement {
            refine,
            feedthrough: subspace.feedthrough(),
            constant: subspace.has_constant(),
            degrees_of_freedom: degrees,
        };
        let found = refined(record, &starts, what, &plan.search, monitor)?;
        refinement = Some(RefinementOutcome { errors: refine, search: found.search });
        (matrices, levels, covariance) = (found.model, found.levels, found.covariance);
    }
    let products = products_of_innovations(&matrices, record, &levels).ok_or_else(out_of_range)?;
    let mean = products / samples as f64;
    let searched = (covariance, refinement);
    Ok(of_order(found, &plan.subspace, (matrices, levels), searched, (samples, degrees, mean)))
}

/// The states that sums over parts of a record tell of, and the norm of each output about its mean over the samples
/// that have errors.
pub(in crate::report) fn by_sums(
    sums: &SubspaceSums<'_>,
    (options, orders): (&SubspaceOptions, Option<&RangeInclusive<usize>>),
    constant: Constant,
    sample_time: f64,
) -> Result<(Estimated, Vec<f64>), Error> {
    let found = Ordered::new(sums, options, orders, constant)?;
    let levels = found.subspace.levels(found.order).ok_or_else(integrates)?;
    let matrices = found.subspace.state_space(found.order, sample_time)?;
    let errors = sums.errors(&found.subspace, found.order).ok_or_else(out_of_range)?;
    let SubspaceErrors { mean, samples, spreads } = errors;
    let degrees = degrees_of_order(&found, 0, (samples, mean.nrows()))?;
    let found = of_order(found, options, (matrices, levels), (None, None), (samples, degrees, mean));
    Ok((found, spreads))
}

fn out_of_range() -> Error {
    Error::data("the errors one step ahead leave the range of numbers")
}

/// Those of so many samples and outputs, with so many states at which errors start.
fn degrees_of_order(
    Ordered { subspace, order, .. }: &Ordered,
    starts: usize,
    (samples, outputs): (usize, usize),
) -> Result<usize, Error> {
    let free = subspace.free_parameters(*order) + starts;
    degrees(&format!("a model of order {order}"), free, samples, outputs)
}

/// The model of an order with these matrices and levels, whose errors have this mean over so many samples, with so many
/// degrees of freedom.
fn of_order(
    Ordered { subspace: found, order, scores, .. }: Ordered,
    options: &SubspaceOptions,
    (matrices, levels): (StateSpace, Vec<f64>),
    (covariance, refinement): (Option<EntryCovariance>, Option<RefinementOutcome>),
    (samples, degrees, mean): (usize, usize, DMatrix<f64>),
) -> Estimated {
    Estimated {
        matrices: with_noise(matrices, &mean, samples, degrees),
        levels,
        has_levels: found.has_constant(),
        covariance,
        procedure: Procedure::from(SubspaceOutcome {
            weighting: found.weighting(),
            past: found.past(),
            future: found.future(),
            feedthrough: found.feedthrough(),
            feedthrough_given: options.feedthrough.is_some(),
            constant: found.has_constant(),
            singular_values: found.singular_values().iter().copied().take(MOST_VALUES).collect(),
            orders: scores,
            refinement,
        }),
        free: found.free_parameters(order),
        degrees,
        samples,
        mean,
        delay: 0,
        offered: found.orders(),
    }
}

/// A model of another weighting to start from: what is near the one minimum may be far from another. None where it has
/// no such model.
fn other_start(
    record: &JointRecord<'_>,
    found: &Subspace,
    order: usize,
    log: &Log,
) -> Option<RefinementStart> {
    let weighting = if found.weighting() == Weighting::Ssarx { Weighting::Cva } else { Weighting::Ssarx };
    let options = SubspaceOptions {
        weighting,
        past: Some(found.past()),
        future: None,
        feedthrough: Some(found.feedthrough()),
        constant: found.has_constant(),
    };
    let other = subspace(record, &options).ok()?;
    let (model, levels) = (other.state_space(order, log.sample_time()).ok()?, other.levels(order)?);
    Some(RefinementStart { name: weighting.to_string(), model, levels })
}

/// The model of one output in polynomials whose errors are least, of the free run or one step ahead: what a subspace
/// method finds may be far from it. None of several outputs, of no input, or where the search fails. Its level is that
/// of another start.
///
/// # Errors
/// [`Error::Interrupted`].
fn polynomial_start(
    record: &JointRecord<'_>,
    plan: &StateSpacePlan,
    (order, other): (usize, &RefinementStart),
    log: &Log,
    monitor: Monitor<'_>,
) -> Result<Option<RefinementStart>, Error> {
    let ([output], Some(refine), false) = (&record.outputs[..], plan.refine, record.inputs.is_empty()) else {
        return Ok(None);
    };
    let inputs = record.inputs.len();
    // A feedthrough is a coefficient of B without a delay.
    let first = usize::from(other.model.d.iter().all(|entry| *entry == 0.0));
    let (nb, nk) = (vec![order + 1 - first; inputs], vec![first; inputs]);
    let plant_first = refine == Refine::Simulation;
    let orders =
        if plant_first { Orders::arx(order, &nb, &nk) } else { Orders::armax(order, &nb, order, &nk) };
    let Ok(orders) = orders else { return Ok(None) };
    let above: Vec<f64> = output.iter().map(|y| y - other.levels[0]).collect();
    let own = Record {
        output: &above,
        inputs: record.inputs.clone(),
        segments: record.segments.clone(),
        past: vec![0; record.segments.len()],
    };
    let method = Method::PredictionError(Search { plant_first, ..plan.search.clone() });
    let found = match estimate_monitored(&own, &orders, &method, Initial::Auto, monitor) {
        Err(Error::Interrupted) => return Err(Error::Interrupted),
        other => other,
    };
    let model = found.and_then(|found| {
        let signals = vec![Signal::default(); inputs];
        found.to_model(&orders, log.sample_time(), signals, Signal::default())
    });
    let start = |model: PolynomialModel| RefinementStart {
        name: if plant_first { "output-error" } else { "armax" }.to_owned(),
        model: model.state_space(),
        levels: other.levels.clone(),
    };
    Ok(model.ok().map(start).filter(|start| start.model.f.nrows() == order))
}
