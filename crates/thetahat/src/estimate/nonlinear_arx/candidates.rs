//! The functions that a choice is made from, and the sums that it needs of them.

use faer::Mat;
use thetahat_numerics::regression::{Moments, Monomials};

use crate::model::Map;

/// Functions to choose from.
#[derive(Debug, Clone)]
pub(crate) enum Candidates {
    /// Products of regressors.
    Products(Monomials),
    /// The functions of a map; the first `always` are taken in any case.
    Functions { map: Map, always: usize },
}

impl Candidates {
    pub(crate) fn count(&self, regressors: usize) -> usize {
        match self {
            Self::Products(monomials) => monomials.count(),
            Self::Functions { map, .. } => map.parameters(regressors),
        }
    }

    /// How many numbers the sums of their products are.
    pub(super) fn sums(&self, regressors: usize) -> usize {
        match self {
            Self::Products(monomials) => monomials.moments(),
            Self::Functions { map, .. } => map.parameters(regressors).pow(2),
        }
    }

    /// How many are always there: the first ones.
    pub(super) fn always(&self) -> usize {
        match self {
            Self::Products(_) => 0,
            Self::Functions { always, .. } => *always,
        }
    }

    /// Places in the order in which a map has them: products have that of their choice.
    pub(super) fn ordered(&self, mut places: Vec<usize>) -> Vec<usize> {
        if let Self::Functions { .. } = self {
            places.sort_unstable();
        }
        places
    }

    /// What one is called, the names of the regressors being given.
    pub(super) fn name(&self, place: usize, regressors: &[String]) -> String {
        match self {
            Self::Products(_) => {
                self.map(&[place], regressors.len()).names(regressors).pop().unwrap_or_default()
            }
            Self::Functions { map, .. } => map.names(regressors).get(place).cloned().unwrap_or_default(),
        }
    }

    /// The map of some of them, in this order, for this many regressors.
    pub(super) fn map(&self, places: &[usize], regressors: usize) -> Map {
        match self {
            Self::Products(monomials) => {
                Map::Polynomial { terms: places.iter().map(|place| monomials.factors(*place)).collect() }
            }
            Self::Functions { map, .. } => map.some(places, regressors),
        }
    }

    /// A rank for each: of tied ones that of the lowest degree comes first, then that of the smallest lags.
    pub(super) fn preferred(&self, lags: &[usize]) -> Vec<usize> {
        let key = |place: usize| match self {
            Self::Products(monomials) => {
                let factors = monomials.factors(place);
                (factors.len(), factors.iter().map(|factor| lags[*factor]).sum::<usize>(), place)
            }
            Self::Functions { .. } => (0, 0, place),
        };
        let mut order: Vec<usize> = (0..self.count(lags.len())).collect();
        order.sort_by_key(|place| key(*place));
        let mut ranks = vec![0; order.len()];
        order.iter().enumerate().for_each(|(rank, place)| ranks[*place] = rank);
        ranks
    }
}

/// Sums of products of candidates, and of candidates and outputs.
#[derive(Debug, Clone)]
pub(super) enum Products {
    Moments(Moments),
    Gram { gram: Mat<f64>, cross: Vec<f64>, energy: f64, rows: usize },
}

impl Products {
    pub(super) fn merge(&mut self, other: &Self) {
        match (self, other) {
            (Self::Moments(own), Self::Moments(other)) => own.merge(other),
            (
                Self::Gram { gram, cross, energy, rows },
                Self::Gram { gram: others, cross: products, energy: more, rows: further },
            ) => {
                *gram += others;
                cross.iter_mut().zip(products).for_each(|(sum, value)| *sum += value);
                *energy += more;
                *rows += further;
            }
            // Sums of one set of candidates are of one kind.
            _ => {}
        }
    }

    pub(super) fn energy(&self) -> f64 {
        match self {
            Self::Moments(moments) => moments.energy,
            Self::Gram { energy, .. } => *energy,
        }
    }

    pub(super) fn rows(&self) -> usize {
        match self {
            Self::Moments(moments) => moments.rows,
            Self::Gram { rows, .. } => *rows,
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        match self {
            Self::Moments(moments) => moments.is_finite(),
            Self::Gram { gram, cross, energy, .. } => {
                energy.is_finite()
                    && cross.iter().all(|value| value.is_finite())
                    && gram.col_iter().all(|column| column.iter().all(|value| value.is_finite()))
            }
        }
    }
}
