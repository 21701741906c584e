//! A map laid out to be evaluated.

use thetahat_core::{Activation, Basis, Local, Membership, Neighbours, Network, Polynomial, Radial, Spline};

use super::map::Map;

/// A map laid out to be evaluated along a log, with its parameters, by the functions of the core. Nothing of it
/// allocates.
#[derive(Debug, Clone)]
pub(crate) struct Evaluator {
    theta: Vec<f64>,
    kind: Kind,
}

#[derive(Debug, Clone)]
enum Kind {
    /// The factors of all terms one after the other, and where each term ends.
    Polynomial { factors: Vec<u16>, ends: Vec<u32> },
    /// The centres one after the other, 1/sigma, and its square.
    Radial { centres: Vec<f64>, inverses: Vec<f64>, inverse_squares: Vec<f64>, linear: bool },
    /// The regressor and the knots of each bend.
    Spline { bent: Vec<u16>, knots: Vec<[f64; 3]> },
    /// The weights and the biases of the units, one after the other.
    Network { activation: Activation, weights: Vec<f64>, biases: Vec<f64> },
    /// The boxes one after the other.
    Local { membership: Membership, planes: bool, sides: Vec<[f64; 2]>, domain: Vec<[f64; 2]> },
    /// The points one after the other.
    Neighbours { count: usize, planes: bool, points: Vec<f64> },
}

impl Evaluator {
    /// # Panics
    /// Never for a map that was checked.
    pub(crate) fn new(map: &Map, theta: Vec<f64>) -> Self {
        let kind = match map {
            Map::Polynomial { terms } => {
                let ends = terms.iter().scan(0, |end, term| {
                    *end += term.len() as u32;
                    Some(*end)
                });
                let factors = terms.iter().flatten().map(|factor| *factor as u16);
                Kind::Polynomial { factors: factors.collect(), ends: ends.collect() }
            }
            Map::Radial { centres, widths, linear } => Kind::Radial {
                centres: centres.concat(),
                inverses: widths.iter().map(|width| 1.0 / width).collect(),
                inverse_squares: widths.iter().map(|width| 1.0 / (width * width)).collect(),
                linear: *linear,
            },
            Map::Spline { regressors, knots } => {
                let bent = regressors.iter().map(|regressor| *regressor as u16);
                Kind::Spline { bent: bent.collect(), knots: knots.clone() }
            }
            Map::Network { activation, weights, biases } => Kind::Network {
                activation: activation.of_the_core(),
                weights: weights.concat(),
                biases: biases.clone(),
            },
            Map::Local { membership, planes, boxes, domain } => Kind::Local {
                membership: membership.of_the_core(),
                planes: *planes,
                sides: boxes.concat(),
                domain: domain.clone(),
            },
            Map::Neighbours { count, planes, points } => {
                Kind::Neighbours { count: *count, planes: *planes, points: points.concat() }
            }
        };
        Self { theta, kind }
    }

    /// Whether the value may depend on a regressor.
    pub(crate) fn reads(&self, regressor: usize) -> bool {
        match &self.kind {
            Kind::Polynomial { factors, .. } => {
                factors.iter().any(|factor| usize::from(*factor) == regressor)
            }
            _ => true,
        }
    }

    /// How many functions there are.
    pub(crate) fn parameters(&self) -> usize {
        self.theta.len()
    }

    /// g(z) = sum_j theta_j f_j(z).
    pub(crate) fn value(&self, z: &[f64]) -> f64 {
        // Most samples have no weight.
        if let Kind::Neighbours { count, planes, points } = &self.kind {
            return neighbours(z.len(), points, *count, *planes).value(&self.theta, z);
        }
        let mut sum = 0.0;
        self.each(z, |j, f| sum += self.theta[j] * f);
        sum
    }

    /// f_j(z) for each j.
    pub(crate) fn functions(&self, z: &[f64], into: &mut [f64]) {
        self.each(z, |j, f| into[j] = f);
    }

    /// Calls `take` with j and f_j(z), in the order of j.
    pub(crate) fn each(&self, z: &[f64], take: impl FnMut(usize, f64)) {
        match &self.kind {
            Kind::Polynomial { factors, ends } => Polynomial { factors, ends }.each(z, take),
            Kind::Radial { centres, inverse_squares, linear, .. } => {
                radial(z.len(), centres, inverse_squares, *linear).each(z, take);
            }
            Kind::Spline { bent, knots } => Spline { regressors: z.len(), bent, knots }.each(z, take),
            Kind::Network { activation, weights, biases } => {
                network(z.len(), *activation, weights, biases).each(z, take);
            }
            Kind::Local { membership, planes, sides, domain } => {
                Local { membership: *membership, planes: *planes, sides, domain }.each(z, take);
            }
            Kind::Neighbours { count, planes, points } => {
                neighbours(z.len(), points, *count, *planes).each(z, take);
            }
        }
    }

    /// Other parameters, and after them other numbers of the functions, in the order of [`Map::shape`].
    pub(crate) fn assign(&mut self, all: &[f64]) {
        let (theta, shape) = all.split_at(self.theta.len());
        self.theta.copy_from_slice(theta);
        let (points, last) = match &mut self.kind {
            Kind::Network { weights, biases, .. } => (weights, biases),
            Kind::Radial { centres, inverses, .. } => (centres, inverses),
            _ => return,
        };
        let regressors = points.len() / last.len().max(1);
        let each = shape.chunks_exact(regressors + 1).zip(points.chunks_exact_mut(regressors.max(1)));
        for ((shape, points), last) in each.zip(last) {
            points.copy_from_slice(&shape[..regressors]);
            *last = shape[regressors];
        }
        if let Kind::Radial { inverses, inverse_squares, .. } = &mut self.kind {
            inverse_squares
                .iter_mut()
                .zip(inverses)
                .for_each(|(square, inverse)| *square = *inverse * *inverse);
        }
    }

    /// dg/dtheta_j = f_j(z) for each j, and after them, where `into` goes on, the slope of g by each number of the
    /// functions.
    pub(crate) fn gradient(&self, z: &[f64], into: &mut [f64]) {
        let (functions, shape) = into.split_at_mut(self.theta.len());
        if shape.is_empty() {
            self.functions(z, functions);
            return;
        }
        let each = shape.chunks_exact_mut(z.len() + 1);
        match &self.kind {
            Kind::Network { activation, weights, biases } => {
                functions[0] = 1.0;
                functions[1..=z.len()].copy_from_slice(z);
                let outer = self.theta[z.len() + 1..].iter().zip(&mut functions[z.len() + 1..]);
                let units = weights.chunks_exact(z.len().max(1)).zip(biases).zip(outer);
                for (own, ((weights, bias), (outer, function))) in each.zip(units) {
                    let sum = weights.iter().zip(z).fold(*bias, |sum, (weight, z)| sum + weight * z);
                    let (value, slope) = activation.at(sum);
                    *function = value;
                    let slope = outer * slope;
                    own.iter_mut().zip(z).for_each(|(own, z)| *own = slope * z);
                    own[z.len()] = slope;
                }
            }
            Kind::Radial { centres, inverses, inverse_squares, linear } => {
                self.functions(z, functions);
                // f = exp(-|z - alpha|^2 b^2): df/dalpha = 2 f b^2 (z - alpha), df/db = -2 f b |z - alpha|^2.
                let before = if *linear { z.len() + 1 } else { 0 };
                let points = centres.chunks_exact(z.len().max(1)).zip(inverses.iter().zip(inverse_squares));
                let values = self.theta[before..].iter().zip(&functions[before..]);
                for (own, ((centre, (inverse, square_of)), (weight, value))) in each.zip(points.zip(values)) {
                    let (factor, mut square) = (2.0 * weight * value, 0.0);
                    for ((own, z), centre) in own.iter_mut().zip(z).zip(centre) {
                        *own = factor * square_of * (z - centre);
                        square += (z - centre) * (z - centre);
                    }
                    own[z.len()] = -factor * inverse * square;
                }
            }
            // Other maps have no such numbers.
            _ => {}
        }
    }

    /// dg/dz_i for each i, of the gradient at z where this has the slopes by the numbers of the functions: without f
    /// once more.
    pub(crate) fn slopes_of_gradient(&self, z: &[f64], gradient: &[f64], into: &mut [f64]) {
        let shape = &gradient[self.theta.len()..];
        let path = |into: &mut [f64]| into.copy_from_slice(&self.theta[1..=z.len()]);
        match &self.kind {
            Kind::Network { weights, .. } if !shape.is_empty() => {
                path(into);
                let units = weights.chunks_exact(z.len().max(1)).zip(shape.chunks_exact(z.len() + 1));
                for (weights, own) in units {
                    // The slope by the bias is that by the sum.
                    let by_sum = own[z.len()];
                    into.iter_mut().zip(weights).for_each(|(slope, weight)| *slope += by_sum * weight);
                }
            }
            Kind::Radial { linear, .. } if !shape.is_empty() => {
                if *linear {
                    path(into)
                } else {
                    into.fill(0.0)
                }
                for own in shape.chunks_exact(z.len() + 1) {
                    // A centre that goes with z leaves f as it is.
                    into.iter_mut().zip(own).for_each(|(slope, by_centre)| *slope -= by_centre);
                }
            }
            _ => self.slopes(z, into),
        }
    }

    /// dg/dz_i for each i.
    pub(crate) fn slopes(&self, z: &[f64], into: &mut [f64]) {
        into.fill(0.0);
        match &self.kind {
            Kind::Polynomial { factors, ends } => {
                Polynomial { factors, ends }.add_slopes(&self.theta, z, into)
            }
            Kind::Radial { centres, inverse_squares, linear, .. } => {
                radial(z.len(), centres, inverse_squares, *linear).add_slopes(&self.theta, z, into);
            }
            Kind::Spline { bent, knots } => {
                Spline { regressors: z.len(), bent, knots }.add_slopes(&self.theta, z, into);
            }
            Kind::Network { activation, weights, biases } => {
                network(z.len(), *activation, weights, biases).add_slopes(&self.theta, z, into);
            }
            Kind::Local { membership, planes, sides, domain } => {
                Local { membership: *membership, planes: *planes, sides, domain }.add_slopes(
                    &self.theta,
                    z,
                    into,
                );
            }
            Kind::Neighbours { count, planes, points } => {
                neighbours(z.len(), points, *count, *planes).add_slopes(&self.theta, z, into);
            }
        }
    }
}

fn network<'a>(
    regressors: usize,
    activation: Activation,
    weights: &'a [f64],
    biases: &'a [f64],
) -> Network<'a, f64> {
    Network { activation, regressors, weights, biases }
}

fn neighbours(regressors: usize, points: &[f64], count: usize, planes: bool) -> Neighbours<'_, f64> {
    Neighbours { regressors, points, count, planes }
}

fn radial<'a>(
    regressors: usize,
    centres: &'a [f64],
    inverse_squares: &'a [f64],
    linear: bool,
) -> Radial<'a, f64> {
    Radial { regressors, centres, inverse_squares, linear }
}
