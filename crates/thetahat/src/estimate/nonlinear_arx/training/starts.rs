//! Where trainings start from.

use thetahat_numerics::random::Random;

use super::super::Samples;
use crate::model::{Activation, Map};

/// Functions of which the numbers are trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Units {
    /// Those of a network with one hidden layer.
    Network(Activation),
    /// Radial basis functions beside a linear path.
    Radial,
}

impl Units {
    /// How many numbers so many of them have, with those of the linear path.
    pub(super) fn numbers(self, regressors: usize, size: usize) -> usize {
        size * (regressors + 2) + regressors + 1
    }

    pub(super) fn word(self, size: usize) -> String {
        let plural = if size == 1 { "" } else { "s" };
        match self {
            Self::Network(activation) => format!("{} unit{plural}", activation.word()),
            Self::Radial => format!("centre{plural}"),
        }
    }

    /// Functions drawn for a start: each bends, or stands, at one of the samples, drawn evenly; the directions of units
    /// are drawn evenly, and their slopes are about those of the regressors. Radial basis functions are so wide that
    /// neighbours overlap.
    pub(crate) fn draw(self, samples: &Samples<'_>, size: usize, seed: u64, start: u64) -> Map {
        let mut random = Random::of(seed, start);
        let count = samples.rows.len();
        let points: Vec<Vec<f64>> = (0..size)
            .map(|_| {
                let place = ((random.uniform() * count as f64) as usize).min(count - 1);
                samples.point(samples.rows[place])
            })
            .collect();
        let regressors = samples.regressors();
        let root = (regressors as f64).sqrt();
        match self {
            Self::Network(activation) => {
                let weights: Vec<Vec<f64>> =
                    (0..size).map(|_| (0..regressors).map(|_| random.normal() / root).collect()).collect();
                let each = weights.iter().zip(&points);
                let biases = each
                    .map(|(weights, point)| -weights.iter().zip(point).map(|(w, z)| w * z).sum::<f64>())
                    .collect();
                Map::Network { activation, weights, biases }
            }
            // Points of unit variance in each direction are root(2 n) apart.
            Self::Radial => {
                let widths = (0..size).map(|_| root * (0.5 + random.uniform())).collect();
                Map::Radial { centres: points, widths, linear: true }
            }
        }
    }
}
