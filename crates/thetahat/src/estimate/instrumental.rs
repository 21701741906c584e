//! Estimates by instrumental variables: signals that go with the regressors, but not with the noise.

use std::ops::Range;
use std::slice::from_ref;

use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};
use thetahat_numerics::optimize::{Deadline, Stopped};
use thetahat_numerics::regression::{Lagged, Presample, Taps};

use super::arx::{arx, resolved, rows, signals};
use super::start::noise::{Equation, Mixed, after};
use super::start::plant::{
    Equations, Group, Input, Plant, Point, add_delayed, divided, energy, inverse, multiplied,
};
use super::start::reduced::Reduced;
use super::start::{candidates, stable};
use super::uncertainty::{autoregression, backward_filtered_products, coloured, columns, restricted};
use super::{Estimate, Initial, Procedure};
use crate::Error;
use crate::data::Record;
use crate::model::Orders;

/// Corrections of a solution by its residuals.
const CORRECTIONS: usize = 2;
/// Steps of the refined method at most.
const ITERATIONS: usize = 100;
/// A step may be halved so often.
const HALVINGS: usize = 10;
/// The steps end where one is less than this fraction of the standard errors.
const TOLERANCE: f64 = 1e-5;

/// Fits A(q) y(t) = sum_j B_j(q) u_j(t) + v(t), v of any colour, by instrumental variables in four stages:
///
/// 1. A and B by least squares;
/// 2. x = (B/A) u instead of y in the instruments: theta = (sum z phi')^-1 sum z y;
/// 3. an autoregression L of order na + nb for w = A y - B u;
/// 4. stage 2 again, with x from its result and all signals filtered by L.
///
/// Consistent where the inputs do not depend on v, that is without feedback; least squares is so for white v only. The
/// covariance is that for coloured errors (see `uncertainty`).
///
/// Source: Söderström and Stoica, Instrumental Variable Methods for System Identification, 1983; Ljung, System
/// Identification, 2nd ed. 1999, section 15.3. Cost: O(N p).
///
/// # Errors
/// As for [`arx`](super::arx()); [`Error::Argument`] for a model with C, D or F, or without inputs.
pub(super) fn instrumental_variables(
    record: &Record<'_>,
    orders: &Orders,
    initial: Initial,
) -> Result<Estimate, Error> {
    if !orders.is_linear() {
        return Err(Error::argument(
            "method",
            "instrumental variables in four stages give A and B, whatever the noise; take C, D and F out of the orders, \
             or search for the least prediction error",
        ));
    }
    if orders.nb.iter().all(|&nb| nb == 0) {
        return Err(Error::argument(
            "method",
            "instrumental variables are made of inputs, and this model has none; fit it by least squares",
        ));
    }
    // Instruments begin with the segment, and so does all that is compared with them.
    let record = &Record { past: vec![0; record.segments.len()], ..record.clone() };
    let first = arx(record, orders, initial)?;
    let (initial, presample) = resolved(initial)?;
    let data = signals(record, orders)?;
    let undetermined = || undetermined(orders);

    let instrument =
        simulated(&data, &record.segments, orders, first.parameters()).ok_or_else(undetermined)?;
    let signals = [&data[..], &[&instrument]].concat();
    let stage = Stage { signals, orders, segments: &record.segments, skipped: 0, presample };
    let second = stage.solve().ok_or_else(undetermined)?;

    let filter = stage.noise_filter(&second.theta);
    let skipped = if presample == Presample::Drop { filter.len() - 1 } else { 0 };
    let instrument =
        simulated(&data, &record.segments, orders, second.theta.as_slice()).ok_or_else(undetermined)?;
    let filtered: Vec<Vec<f64>> = data
        .iter()
        .chain([&instrument.as_slice()])
        .map(|signal| multiplied(&filter, signal, &record.segments))
        .collect();
    let signals = filtered.iter().map(Vec::as_slice).collect();
    let last = Stage { signals, orders, segments: &record.segments, skipped, presample };
    let Solution { theta, inverse } = last.solve().ok_or_else(undetermined)?;

    let (parameters, samples) = (theta.len(), first.samples());
    let residuals = last.residuals(&theta);
    let colour = autoregression(&residuals, &last.counted(), parameters);
    let mut products = DMatrix::zeros(parameters, parameters);
    let instruments = last.instrument_taps(0);
    for (segment, counted) in record.segments.iter().zip(&last.counted()) {
        products += backward_filtered_products(
            &last.signals,
            &instruments,
            segment,
            from_ref(counted),
            None,
            &colour.monic,
        );
    }
    let errors = stage.residuals(&theta);
    let squares = energy(&errors, &record.segments);
    Ok(Estimate {
        parameters: theta.iter().copied().collect(),
        covariance: Some(rows(&coloured(&inverse, colour.variance, &products))),
        noise_variance: squares / (samples - parameters) as f64,
        samples,
        mse: squares / samples as f64,
        condition: Some(last.condition().ok_or_else(undetermined)?),
        initial,
        procedure: Procedure::InstrumentalVariables {
            filter_order: filter.len() - 1,
            residual_order: colour.order(),
        },
    })
}

/// The system sum z (y - phi' theta) = 0 for some signals y, u_1 …, and x in the place of y in z.
struct Stage<'s> {
    signals: Vec<&'s [f64]>,
    orders: &'s Orders,
    segments: &'s [Range<usize>],
    /// Samples at the beginning of a segment that a filter spoilt.
    skipped: usize,
    presample: Presample,
}

struct Solution {
    theta: DVector<f64>,
    /// (sum z phi')^-1.
    inverse: DMatrix<f64>,
}

impl Stage<'_> {
    fn input_taps(&self) -> impl Iterator<Item = Taps> {
        let inputs = self.orders.nb.iter().zip(&self.orders.nk).enumerate();
        inputs.map(|(j, (&count, &first))| Taps { signal: j + 1, first, count, sign: 1.0 })
    }

    /// z, or with `signal` 0 … those of phi, signals being `shift` further back in a list.
    fn instrument_taps(&self, shift: usize) -> Vec<Taps> {
        let x = self.signals.len() - 1;
        std::iter::once(Taps { signal: x, first: 1, count: self.orders.na, sign: -1.0 })
            .chain(self.input_taps())
            .map(|taps| Taps { signal: taps.signal + shift, ..taps })
            .collect()
    }

    /// The samples that count.
    fn counted(&self) -> Vec<Range<usize>> {
        match self.presample {
            Presample::Drop => after(self.segments, self.skipped + self.orders.maximum_lag()),
            Presample::Zero => self.segments.to_vec(),
        }
    }

    /// A y - sum_j B_j u_j for the samples that count, zero elsewhere.
    fn residuals(&self, theta: &DVector<f64>) -> Vec<f64> {
        let (equation, model) = equation(&self.signals, self.segments, self.orders, theta.as_slice());
        let from =
            if self.presample == Presample::Drop { self.skipped + self.orders.maximum_lag() } else { 0 };
        equation.errors(&model, from)
    }

    fn solve(&self) -> Option<Solution> {
        let na = self.orders.na;
        let later = after(self.segments, self.skipped);
        let segments = if self.presample == Presample::Drop { &later } else { self.segments };
        // [x | u | y]: the first two are z, the last two phi but for their order.
        let mut taps = self.instrument_taps(0);
        let size = taps.iter().map(|taps| taps.count).sum();
        taps.push(Taps { signal: 0, first: 1, count: na, sign: -1.0 });
        let (gram, right, _) = Lagged::new(&self.signals, taps, segments, self.presample).normal_equations();
        let phi = |k: usize| if k < na { size + k } else { k };
        let cross = DMatrix::from_fn(size, size, |i, j| gram[(i, phi(j))]);
        let square = |k: usize| gram[(k, k)];
        let squares: [Vec<f64>; 2] =
            [(0..size).map(square).collect(), (0..size).map(|j| square(phi(j))).collect()];
        let inverse = inverse(&cross, squares)?;
        let mut theta = &inverse * right.rows(0, size);
        // With true residuals, as rounding in the sums is of the size of y.
        for _ in 0..CORRECTIONS {
            let residuals = self.residuals(&theta);
            let signals: Vec<&[f64]> =
                std::iter::once(residuals.as_slice()).chain(self.signals.iter().copied()).collect();
            let (_, gradient, _) =
                Lagged::new(&signals, self.instrument_taps(1), segments, self.presample).normal_equations();
            theta += &inverse * gradient;
        }
        let finite = theta.iter().all(|value| value.is_finite());
        finite.then_some(Solution { theta, inverse })
    }

    /// The condition number of the instruments; none if some depend on others.
    fn condition(&self) -> Option<f64> {
        let later = after(self.segments, self.skipped);
        let segments = if self.presample == Presample::Drop { &later } else { self.segments };
        condition_of(
            &Lagged::new(&self.signals, self.instrument_taps(0), segments, self.presample).factor().ok()?,
        )
    }

    /// L, an autoregression of order na + nb for the residuals; less of short segments, and 1 if there is nothing left.
    fn noise_filter(&self, theta: &DVector<f64>) -> Vec<f64> {
        let residuals = self.residuals(theta);
        let counted = self.counted();
        let samples: usize = counted.iter().map(Range::len).sum();
        let most = theta.len();
        let left = |order: usize| after(&counted, order).iter().map(Range::len).sum::<usize>();
        let order = (1..=most).rev().find(|&order| 2 * left(order) >= samples && left(order) > 2 * most);
        let equation = |order| {
            Equation { output: &residuals, order, inputs: Vec::new(), segments: &counted }.least_squares()
        };
        order.and_then(equation).map_or_else(|| vec![1.0], |model| model.a)
    }
}

/// A y = B u and its polynomials.
fn equation<'e>(
    signals: &[&'e [f64]],
    segments: &'e [Range<usize>],
    orders: &Orders,
    theta: &[f64],
) -> (Equation<'e>, Mixed) {
    let inputs = (0..orders.inputs()).map(|j| Input {
        signal: signals[j + 1],
        first: orders.nk[j],
        count: orders.nb[j],
    });
    let equation = Equation { output: signals[0], order: orders.na, inputs: inputs.collect(), segments };
    let model = equation.polynomials(theta);
    (equation, model)
}

/// x = (B/A) u from rest, an unstable A being reflected: an instrument has to go with the inputs, not to fit.
fn simulated(
    signals: &[&[f64]],
    segments: &[Range<usize>],
    orders: &Orders,
    theta: &[f64],
) -> Option<Vec<f64>> {
    let (_, model) = equation(signals, segments, orders, theta);
    let mut driven = vec![0.0; signals[0].len()];
    for ((b, &first), signal) in model.b.iter().zip(&orders.nk).zip(&signals[1..]) {
        add_delayed(&mut driven, b, signal, first, segments);
    }
    let mut x = Vec::new();
    divided(&mut x, &driven, &stable(&model.a)?.0, segments);
    Some(x)
}

/// Fits y(t) = sum_j (B_j/F_j)(q) u_j(t) + v(t), v of any colour, by refined instrumental variables:
///
/// ```text
/// theta <- theta + (sum z phi')^-1 sum z e,   phi = [u_F(t - nk - i)  -y_F(t - i)],   z = [u_F(t - nk - i)  -x_F(t - i)]
/// ```
///
/// with F of the last theta in the filters, until a step is below 1e-5 standard errors; a step that does not lower sum
/// e^2 is halved. At the end sum z e = 0, which is the condition for the least output error. The covariance is that for
/// coloured errors, initial conditions taken out (see `uncertainty`).
///
/// Source: Young, Some observations on instrumental variable methods of time-series analysis, Int. J. Control 23, 1976;
/// Young and Jakeman, Refined instrumental variable methods of recursive time-series analysis, Int. J. Control 29, 1979
/// (several inputs: here their steps are taken together). Cost: O(N p) for each step.
///
/// # Errors
/// [`Error::Argument`] for a model with A, C or D, or without F, and for [`Initial::Drop`]; [`Error::Undetermined`] and
/// [`Error::Data`] as for [`arx`](super::arx()).
pub(super) fn refined_instrumental_variables(
    record: &Record<'_>,
    orders: &Orders,
    initial: Initial,
) -> Result<Estimate, Error> {
    if orders.na + orders.nc + orders.nd > 0 || orders.nf.iter().all(|&nf| nf == 0) {
        return Err(Error::argument(
            "method",
            "refined instrumental variables give B and F, whatever the noise; ask for an output-error model, or search for \
             the least prediction error",
        ));
    }
    if initial == Initial::Drop {
        return Err(Error::argument(
            "initial",
            "with F every sample depends on all before it: none can be left out; start from zero, estimate the start, or \
             let auto choose",
        ));
    }
    let starts: Vec<Vec<Vec<f64>>> = candidates(record, orders, Deadline::default())?
        .iter()
        .map(|candidate| {
            let mut rest = &candidate.parameters[orders.nb.iter().sum()..];
            let monic = orders.nf.iter().map(|&nf| {
                let (own, others) = rest.split_at(nf);
                rest = others;
                [&[1.0], own].concat()
            });
            monic.collect()
        })
        .collect();
    let estimate = |initial| refined_from(record, orders, initial, &starts);
    match initial {
        Initial::Estimate => estimate(Initial::Estimate),
        Initial::Zero | Initial::Drop => estimate(Initial::Zero),
        Initial::Auto => {
            let zero = estimate(Initial::Zero)?;
            let conditions = initial_conditions(record, orders) as f64;
            let Ok(free) = estimate(Initial::Estimate) else { return Ok(zero) };
            let samples = zero.samples as f64;
            let worth = zero.mse > 0.0 && samples * (zero.mse / free.mse).ln() > conditions * samples.ln();
            Ok(if worth { free } else { zero })
        }
    }
}

/// How many initial conditions a record has.
fn initial_conditions(record: &Record<'_>, orders: &Orders) -> usize {
    record.segments.len() * (0..orders.inputs()).map(|input| orders.free_responses(input)).sum::<usize>()
}

fn refined_from(
    record: &Record<'_>,
    orders: &Orders,
    initial: Initial,
    starts: &[Vec<Vec<f64>>],
) -> Result<Estimate, Error> {
    let undetermined = || undetermined(orders);
    let free = |input: usize| if initial == Initial::Estimate { orders.free_responses(input) } else { 0 };
    let groups = record.inputs.iter().enumerate().map(|(input, signal)| Group {
        order: orders.nf[input],
        free: free(input),
        inputs: vec![Input { signal, first: orders.nk[input], count: orders.nb[input] }],
    });
    let plant = Plant { output: record.output, groups: groups.collect(), segments: &record.segments };
    let conditions = if initial == Initial::Estimate { initial_conditions(record, orders) } else { 0 };
    let (parameters, samples) = (orders.parameters(), record.segments.iter().map(Range::len).sum::<usize>());
    if samples <= parameters + conditions {
        return Err(Error::undetermined(
            orders.names(),
            format!(
                "too few rows: {parameters} parameters and {conditions} initial conditions need more samples than \
                 {samples}; give more rows, lower the orders, or start from zero"
            ),
        ));
    }
    let mut point = Point::new(&plant);
    let mut cost_at =
        |denominators: &Vec<Vec<f64>>| point.move_to(denominators, None).unwrap_or(f64::INFINITY);
    let costs: Vec<f64> = starts.iter().map(&mut cost_at).collect();
    let best = (0..starts.len()).min_by(|&i, &j| costs[i].total_cmp(&costs[j])).ok_or_else(undetermined)?;
    point.move_to(&starts[best], None).ok_or_else(undetermined)?;

    let (iterations, stopped) = iterate(&mut point, samples);
    if point.undetermined() {
        return Err(undetermined());
    }
    point.filter_outputs(true);
    let (signals, taps) = point.sensitivities();
    let mut all = vec![point.errors.as_slice()];
    all.extend(&signals);
    let shifted: Vec<Taps> = taps.iter().map(|taps| Taps { signal: taps.signal + 1, ..*taps }).collect();
    let reduced = Reduced::new(&all, &shifted, &record.segments, &point.free).ok_or_else(undetermined)?;
    let factor = Reduced::factor(&all, &shifted, &record.segments, &point.free).ok_or_else(undetermined)?;
    let condition = condition_of(&factor).ok_or_else(undetermined)?;
    let unit = DMatrix::identity(parameters, parameters);
    let root = factor.factor().solve_upper_triangular(&unit).ok_or_else(undetermined)?;
    let left = &root * root.transpose();
    // Signals of a segment alone, so that those of the initial-condition responses stand beside them.
    let all_taps = [&taps[..], &point.free.taps(signals.len())].concat();
    let alone = |segment: &Range<usize>| -> Vec<Vec<f64>> {
        let own = signals.iter().map(|signal| signal[segment.clone()].to_vec());
        own.chain(point.free.padded(segment.len())).collect()
    };
    let each = || record.segments.iter().map(alone).enumerate();
    let psi = || {
        let mut psi = vec![vec![0.0; point.errors.len()]; parameters];
        for ((position, own), segment) in each().zip(&record.segments) {
            let views: Vec<&[f64]> = own.iter().map(Vec::as_slice).collect();
            let (rows, combination) = (0..segment.len(), reduced.combination(position));
            let found = columns(&views, &all_taps, &rows, &rows, combination.as_ref());
            psi.iter_mut().zip(found).for_each(|(all, own)| all[segment.clone()].copy_from_slice(&own));
        }
        psi
    };
    let taken = parameters + conditions;
    let colour = restricted(&point.errors, psi, &record.segments, taken);
    let mut products = DMatrix::zeros(parameters, parameters);
    for ((position, own), segment) in each().zip(&record.segments) {
        let views: Vec<&[f64]> = own.iter().map(Vec::as_slice).collect();
        let (rows, combination) = (0..segment.len(), reduced.combination(position));
        products += backward_filtered_products(
            &views,
            &all_taps,
            &rows,
            from_ref(&rows),
            combination.as_ref(),
            &colour.monic,
        );
    }
    let variance = colour.variance * colour.inflation(samples, taken);
    let f = point.denominators.iter().flat_map(|monic| &monic[1..]);
    Ok(Estimate {
        parameters: point.numerators.iter().flatten().chain(f).copied().collect(),
        covariance: Some(rows(&coloured(&left, variance, &products))),
        noise_variance: point.cost / (samples - parameters - conditions) as f64,
        samples,
        mse: point.cost / samples as f64,
        condition: Some(condition),
        initial,
        procedure: Procedure::RefinedInstrumentalVariables {
            iterations,
            stopped,
            initial_conditions: conditions,
            residual_order: colour.order(),
        },
    })
}

/// Steps from where the point is; how many, and why they ended.
fn iterate(point: &mut Point<'_, '_>, samples: usize) -> (usize, Stopped) {
    for iteration in 0..ITERATIONS {
        let (cost, from) = (point.cost, point.denominators.clone());
        let Some(step) = point.step(Equations::RefinedInstruments) else {
            return (iteration, Stopped::NoDescent);
        };
        let small = step.change * samples as f64 <= TOLERANCE * TOLERANCE * cost;
        let lower = (0..=HALVINGS).map(|halving| 0.5_f64.powi(halving as i32)).any(|length| {
            let along = |(from, to): (&Vec<f64>, &Vec<f64>)| -> Vec<f64> {
                from.iter().zip(to).map(|(from, to)| from + length * (to - from)).collect()
            };
            let next: Vec<Vec<f64>> = from.iter().zip(&step.denominators).map(along).collect();
            let reached =
                next.iter().all(|monic| stable(monic).is_some_and(|(_, modulus)| modulus.is_none()));
            reached && point.move_to(&next, None).is_some_and(|reached| reached <= cost)
        });
        if !lower {
            // Back to the lowest; it was a number before.
            let _ = point.move_to(&from, None);
            return (iteration, if small { Stopped::Converged } else { Stopped::NoDescent });
        }
        if small {
            return (iteration + 1, Stopped::Converged);
        }
    }
    (ITERATIONS, Stopped::MaxIterations)
}

/// The condition number of the columns after a factor, scaled to unit norm; none if some depend on others.
fn condition_of(factor: &LeastSquares<f64, Dyn>) -> Option<f64> {
    let independent = factor.rank().dependent().next().is_none();
    independent.then(|| factor.condition())
}

fn undetermined(orders: &Orders) -> Error {
    Error::undetermined(
        orders.names(),
        "the inputs do not determine the model by instrumental variables: they move the output too little, or not in enough \
         ways; excite the input more, or lower the orders",
    )
}

#[cfg(test)]
mod tests;
