//! Several inputs through one denominator: y = (sum_j B_j u_j)/A + v, sum v^2 least.
//!
//! These are the errors of y = sum_j B_j/F_j u_j + v with all F_j the same, so psi' psi and psi' e of A and B are sums
//! of entries of theirs: with theta = S (a, b) they are S'GS and S'g. All initial-condition responses are those of 1/A;
//! one input has them.

use std::ops::Range;

use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{Complex, ComplexField, DMatrix, DVector};
use thetahat_numerics::optimize::{
    Algorithm, Deadline, Found, Monitor, Objective, Search, best_free, best_linear, search,
};
use thetahat_numerics::regression::Folding;

use super::super::arx::{arx, rows};
use super::super::instrumental::instrumental_variables;
use super::super::outcome::{StartOutcome, search_outcome};
use super::super::polynomials::Unusable;
use super::super::prediction_error::{TWIN, flat, prediction_error, root_of};
use super::super::predictor::{InitialCondition, Predictor};
use super::super::reflection;
use super::super::stability_boundary::StabilityBoundary;
use super::super::thinning::{energy, filled};
use super::super::uncertainty::{coloured, restricted};
use super::super::{Estimate, Initial, Procedure, drop_is_not_for_f};
use crate::Error;
use crate::data::Record;
use crate::model::{
    Orders,
    polynomial::{multiply_out, roots},
};
use crate::respond::{NOTHING_LEFT, are_worth};

/// Starts have poles inside this circle.
const INSIDE: f64 = 0.99;

/// The errors v as a function of A and B.
struct Shared<'r> {
    predictor: Predictor<'r>,
    /// A and B.
    orders: Orders,
    /// Which of the parameters (a, b) each of theta is.
    own: Vec<usize>,
    theta: Vec<f64>,
    moved: Vec<f64>,
    matrix: Vec<f64>,
    right: Vec<f64>,
    stability_boundary: StabilityBoundary,
    /// Memory for the triangle of psi of theta, and of psi S.
    triangle: Vec<f64>,
    folding: Folding,
}

impl<'r> Shared<'r> {
    /// `plant` has the denominators of the inputs that share A.
    fn new(record: &Record<'r>, orders: &Orders, plant: &Orders, begin: InitialCondition) -> Self {
        let orders = Orders { nc: 0, ..orders.clone() };
        let (na, b) = (orders.na, orders.nb.iter().sum::<usize>());
        let denominators = plant.nf.iter().flat_map(|&nf| 0..nf);
        let own: Vec<usize> = (na..na + b).chain(denominators).collect();
        let (count, size) = (na + b, own.len());
        Self {
            predictor: Predictor::with_one_denominator(record, plant, begin),
            stability_boundary: StabilityBoundary::new(&orders, true),
            orders,
            theta: vec![0.0; size],
            moved: vec![0.0; size],
            own,
            matrix: vec![0.0; count * count],
            right: vec![0.0; count],
            triangle: vec![0.0; size * (size + 1)],
            folding: Folding::new(count + 1),
        }
    }

    /// S, with a row for each of theta.
    fn selection(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.own.len(), self.right.len(), |i, j| f64::from(u8::from(self.own[i] == j)))
    }
}

impl Objective for Shared<'_> {
    type Refusal = Unusable;

    fn samples(&self) -> usize {
        self.predictor.samples()
    }

    fn initial_conditions(&self) -> usize {
        self.predictor.initial_conditions()
    }

    fn linear(&self) -> Range<usize> {
        self.orders.na..self.right.len()
    }

    fn restart(&mut self) {
        self.predictor.restart();
    }

    fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Unusable> {
        self.theta.iter_mut().zip(&self.own).for_each(|(value, &own)| *value = parameters[own]);
        self.predictor.evaluate(&self.theta)
    }

    fn linearize(&mut self) -> Result<f64, Unusable> {
        let gain = self.predictor.linearize();
        let (count, size) = (self.right.len(), self.own.len());
        self.matrix.fill(0.0);
        self.right.fill(0.0);
        for (row, &own) in self.predictor.matrix.chunks_exact(size).zip(&self.own) {
            for (entry, &other) in row.iter().zip(&self.own) {
                self.matrix[own * count + other] += entry;
            }
        }
        for (entry, &own) in self.predictor.right.iter().zip(&self.own) {
            self.right[own] += entry;
        }
        Ok(gain)
    }

    fn try_free(&mut self, step: &[f64]) {
        if step.is_empty() {
            return self.predictor.try_free(step);
        }
        self.moved.iter_mut().zip(&self.own).for_each(|(value, &own)| *value = step[own]);
        self.predictor.try_free(&self.moved);
    }

    fn keep_free(&mut self) {
        self.predictor.keep_free();
    }

    fn matrix(&self) -> &[f64] {
        &self.matrix
    }

    fn right(&self) -> &[f64] {
        &self.right
    }

    /// That of psi S, from that of psi.
    fn triangle(&mut self, into: &mut [f64]) -> bool {
        let (count, size) = (self.right.len(), self.own.len());
        if !self.predictor.triangle(&mut self.triangle) {
            return false;
        }
        self.folding.clear();
        for block in self.triangle.chunks(Folding::ROWS * (size + 1)) {
            self.folding.fold(block.len() / (size + 1), |column, values| {
                for (value, row) in values.iter_mut().zip(block.chunks_exact(size + 1)) {
                    let own = row.iter().zip(&self.own).filter(|(_, own)| **own == column);
                    *value = if column == count { row[size] } else { own.map(|(entry, _)| entry).sum() };
                }
            });
        }
        for (place, value) in into.iter_mut().enumerate() {
            let (row, column) = (place / (count + 1), place % (count + 1));
            *value = if row <= column { self.folding.entry(row, column) } else { 0.0 };
        }
        true
    }

    /// A by its reflection coefficients, B as it is.
    fn coordinates(&mut self, parameters: &[f64], into: &mut [f64]) -> bool {
        let na = self.orders.na;
        into.copy_from_slice(parameters);
        reflection::coordinates(&parameters[..na], &mut into[..na])
    }

    fn is_curved(&self, place: usize) -> bool {
        place < self.orders.na
    }

    fn parameters(&mut self, coordinates: &[f64], into: &mut [f64], mut slopes: Option<&mut [f64]>) {
        let (na, size) = (self.orders.na, coordinates.len());
        into.copy_from_slice(coordinates);
        if let Some(slopes) = &mut slopes {
            slopes.fill(0.0);
            (na..size).for_each(|place| slopes[place * (size + 1)] = 1.0);
        }
        reflection::coefficients(&coordinates[..na], &mut into[..na], slopes.map(|slopes| (slopes, size)));
    }

    fn is_outside(refusal: &Unusable) -> bool {
        *refusal == Unusable::Unstable
    }

    fn draw_in(&mut self, from: &[f64], trial: &mut [f64]) -> bool {
        self.stability_boundary.draw_in(from, trial)
    }
}

/// The plant, its parameters in the order of A and B, with its free-run errors and their segments.
pub(super) fn plant(
    record: &Record<'_>,
    orders: &Orders,
    plant: &Orders,
    initial: Initial,
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<(Estimate, super::Errors), Error> {
    let deadline = Deadline::after(options.time_limit);
    let starts = starts(record, orders, options, monitor)?;
    let smallest = NOTHING_LEFT * energy(record);
    let from = |begin: InitialCondition| -> Result<Option<Reached<'_>>, Error> {
        let mut best: Option<Reached<'_>> = None;
        let mut outcomes = Vec::new();
        let mut winner = 0;
        // Each is followed in the coordinates without a boundary too, unless another algorithm is asked for.
        let turned = options.algorithm == Algorithm::LevenbergMarquardt;
        let turned = [false, true].into_iter().take(1 + usize::from(turned));
        let each =
            starts.iter().flat_map(|(name, start)| turned.clone().map(move |turned| (*name, start, turned)));
        for (number, (name, start, orthogonal)) in each.enumerate() {
            let mut shared = Shared::new(record, orders, plant, begin);
            if shared.samples() <= orders.parameters() + shared.initial_conditions() {
                return Ok(None);
            }
            let samples = shared.samples() as f64;
            let mut start = start.clone();
            // Those of the constant are beside A in a start, and the output's here.
            let _ = best_linear(&mut shared, &mut start);
            let options = Search { orthogonal, ..options.clone() };
            let found = search(&mut shared, &start, &options, smallest, deadline, monitor)?.ok();
            outcomes.push(StartOutcome {
                name: format!("{name}{}", if orthogonal { TWIN } else { "" }),
                cost: found.as_ref().map(|found| found.costs[0] / samples),
                reached: found.as_ref().map(|found| found.cost() / samples),
            });
            if let Some(found) = found
                && best.as_ref().is_none_or(|best| found.cost() < best.found.cost())
            {
                winner = number;
                best = Some(Reached { shared, found, starts: Vec::new(), begin });
            }
        }
        outcomes.swap(0, winner);
        Ok(best.map(|best| Reached { starts: outcomes, ..best }))
    };
    let widest = if Predictor::has_unknown_inputs(&record.past, plant) {
        InitialCondition::UnknownInputs
    } else {
        InitialCondition::Unknown
    };
    let measured = record.past.iter().any(|past| *past > 0);
    // Whether the second is worth its further unknowns.
    let better = |one: &Reached<'_>, other: &Reached<'_>| {
        let mean = |reached: &Reached<'_>| reached.found.cost() / reached.shared.samples() as f64;
        let count = |reached: &Reached<'_>| reached.shared.initial_conditions();
        let (samples, more) = (other.shared.samples(), count(other).saturating_sub(count(one)));
        more > 0 && are_worth(samples, mean(one), mean(other), more, smallest / samples as f64)
    };
    let mut begins = match initial {
        Initial::Drop => return Err(drop_is_not_for_f()),
        Initial::Zero => vec![InitialCondition::Zero],
        Initial::Auto if !measured => vec![InitialCondition::Zero, InitialCondition::Unknown, widest],
        Initial::Estimate | Initial::Auto => vec![InitialCondition::Unknown, widest],
    };
    begins.dedup();
    let mut reached: Option<Reached<'_>> = None;
    for begin in begins {
        if let Some(next) = from(begin)?
            && reached.as_ref().is_none_or(|reached| better(reached, &next))
        {
            reached = Some(next);
        }
    }
    let reached = reached.ok_or_else(|| {
        Error::undetermined(
            orders.names(),
            "no start of the search has a finite cost, or too few rows are left for the orders; give more rows, lower the \
             orders, or scale the channels towards one",
        )
    })?;
    finish(reached, orders, options)
}

/// Where a search has ended.
struct Reached<'r> {
    shared: Shared<'r>,
    found: Found,
    starts: Vec<StartOutcome>,
    begin: InitialCondition,
}

/// A and B by name: initial parameters that were given, and those of least squares, of instrumental variables and of
/// noise with a numerator.
fn starts(
    record: &Record<'_>,
    orders: &Orders,
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<Vec<(&'static str, Vec<f64>)>, Error> {
    let linear = Orders { nc: 0, ..orders.clone() };
    let noisy = Orders { nc: orders.na, ..orders.clone() };
    let count = linear.parameters();
    let mut starts = Vec::new();
    if let Some(initial) = options.initial_parameters.as_ref().filter(|initial| initial.len() >= count) {
        starts.push(("initial-parameters", initial.clone()));
    }
    let found = filled(record, |record| -> Result<_, Error> {
        let search = Search { plant_first: false, initial_parameters: None, ..options.clone() };
        let armax = match prediction_error(record, &noisy, Initial::Auto, &search, monitor) {
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            other => other,
        };
        let instruments = instrumental_variables(record, &linear, Initial::Auto);
        Ok([
            ("least-squares", arx(record, &linear, Initial::Auto)),
            ("instruments", instruments),
            ("armax", armax),
        ])
    })?;
    let mut refused = None;
    for (name, found) in found {
        match found {
            Ok(found) => starts.push((name, found.parameters().to_vec())),
            Err(error) => refused = refused.or(Some(error)),
        }
    }
    if starts.is_empty()
        && let Some(error) = refused
    {
        return Err(error);
    }
    for (_, start) in &mut starts {
        start.truncate(count);
        let monic: Vec<f64> = [&[1.0], &start[..orders.na]].concat();
        let Some(found) = roots(&monic) else { continue };
        let mut product = Vec::new();
        let drawn_in = |root: &Complex<f64>| *root * (INSIDE / root.modulus()).min(1.0);
        multiply_out(found.iter().map(drawn_in), &mut product);
        start.iter_mut().zip(&product[1..]).for_each(|(value, product)| *value = product.re);
    }
    Ok(starts)
}

/// The estimate of a search.
fn finish(
    reached: Reached<'_>,
    orders: &Orders,
    options: &Search,
) -> Result<(Estimate, super::Errors), Error> {
    let Reached { mut shared, found, starts, begin } = reached;
    let _ = best_free(&mut shared, &found.parameters);
    // It has normal equations.
    let _ = shared.linearize();
    let samples = shared.samples();
    let taken = found.parameters.len() + shared.initial_conditions();
    let selection = shared.selection();
    let predictor = &shared.predictor;
    let root = predictor.factor().ok().and_then(|factor| {
        // That of psi S.
        let triangle = (factor.factor() * &selection).qr().r();
        let zeros = DVector::zeros(triangle.ncols());
        root_of(&LeastSquares::from_factor(&triangle, &zeros, 0.0, samples).ok()?)
    });
    let Some((root, condition)) = root else { return Err(flat(orders, &found.parameters)) };
    let (residuals, segments) = predictor.residuals_by_section();
    let sensitivities = || {
        let all = predictor.sensitivities();
        let mut own = vec![vec![0.0; residuals.len()]; shared.right.len()];
        for (column, &to) in all.iter().zip(&shared.own) {
            own[to].iter_mut().zip(column).for_each(|(sum, value)| *sum += value);
        }
        own
    };
    let colour = restricted(&residuals, sensitivities, &segments, taken);
    let products = predictor.backward_filtered_products(&(&selection * &root).transpose(), &colour.monic);
    let covariance = coloured(&root, colour.variance * colour.inflation(samples, taken), &products);
    let cost = found.cost();
    let outcome = search_outcome(options, &found, &shared, starts);
    let estimate = Estimate {
        covariance: Some(rows(&covariance)),
        noise_variance: cost / (samples - taken) as f64,
        samples,
        mse: cost / samples as f64,
        condition: Some(condition),
        initial: if begin == InitialCondition::Zero { Initial::Zero } else { Initial::Estimate },
        procedure: Procedure::PredictionError(outcome),
        parameters: found.parameters,
    };
    Ok((estimate, predictor.residuals()))
}

#[cfg(test)]
mod tests {
    use thetahat_numerics::noise::Noise;

    use super::*;

    #[test]
    fn the_triangle_is_the_root_of_the_normal_equations_and_coordinates_lead_back() {
        let mut noise = Noise(4);
        let (u1, u2, y) = (noise.take(300), noise.take(300), noise.take(300));
        let record = Record::new(&y, vec![&u1, &u2]).unwrap();
        let orders = Orders::arx(3, &[2, 1], &[1, 1]).unwrap();
        let plant = Orders::oe(&[2, 1], &[3, 3], &[1, 1]).unwrap();
        let mut shared = Shared::new(&record, &orders, &plant, InitialCondition::Unknown);
        let at = [-1.2, 0.6, -0.1, 1.0, 0.3, -0.5];
        best_free(&mut shared, &at).unwrap();
        shared.linearize().unwrap();
        let count = at.len();
        let mut triangle = vec![0.0; count * (count + 1)];
        assert!(shared.triangle(&mut triangle));
        let column =
            |column: usize| triangle.iter().skip(column).step_by(count + 1).copied().collect::<Vec<f64>>();
        let dot = |a: Vec<f64>, b: Vec<f64>| a.iter().zip(&b).map(|(a, b)| a * b).sum::<f64>();
        for i in 0..count {
            let size = shared.matrix()[i * (count + 1)];
            for j in 0..count {
                let other = shared.matrix()[j * (count + 1)];
                let entry = shared.matrix()[i * count + j];
                assert!((dot(column(i), column(j)) - entry).abs() < 1e-11 * (size * other).sqrt());
            }
            let right = shared.right()[i];
            assert!((dot(column(i), column(count)) - right).abs() < 1e-9 * size.max(right.abs()));
        }

        let (mut coordinates, mut back) = ([0.0; 6], [0.0; 6]);
        let mut slopes = vec![0.0; count * count];
        assert!(shared.coordinates(&at, &mut coordinates));
        shared.parameters(&coordinates, &mut back, Some(&mut slopes));
        assert!(at.iter().zip(&back).all(|(at, back)| (at - back).abs() < 1e-12), "{back:?}");
        for place in 0..count {
            let (mut near, mut moved) = (coordinates, [0.0; 6]);
            near[place] += 1e-6;
            shared.parameters(&near, &mut moved, None);
            for row in 0..count {
                let slope = (moved[row] - back[row]) / 1e-6;
                assert!((slope - slopes[row * count + place]).abs() < 1e-4, "{row} {place}");
            }
        }
    }
}
