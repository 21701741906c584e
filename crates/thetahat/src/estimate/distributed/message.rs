//! What goes between a search and those who hold its data.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::Error;
use crate::estimate::equations::Slopes;
use crate::estimate::predictor::InitialCondition;
use crate::estimate::uncertainty::ErrorProducts;
use crate::model::Orders;

/// What is asked of the experiments that somebody holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Question(pub(super) Asked);

/// The answer to a [`Question`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Answer(pub(super) Found);

impl Question {
    /// As bytes, for another process that runs the same version.
    ///
    /// # Errors
    /// [`Error::Data`] if it cannot be written.
    pub fn to_bytes(&self) -> Result<Vec<u8>, Error> {
        written(self)
    }

    /// # Errors
    /// [`Error::Data`] if these are no question, or another version's.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        read(bytes)
    }
}

impl Answer {
    /// As bytes, for another process that runs the same version.
    ///
    /// # Errors
    /// [`Error::Data`] if it cannot be written.
    pub fn to_bytes(&self) -> Result<Vec<u8>, Error> {
        written(self)
    }

    /// # Errors
    /// [`Error::Data`] if these are no answer, or another version's.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        read(bytes)
    }
}

fn written(message: &impl Serialize) -> Result<Vec<u8>, Error> {
    postcard::to_stdvec(message).map_err(|error| Error::data(format!("a message cannot be written: {error}")))
}

fn read<'m, M: Deserialize<'m>>(bytes: &'m [u8]) -> Result<M, Error> {
    postcard::from_bytes(bytes).map_err(|error| {
        Error::data(format!(
            "a message between processes cannot be read ({error}); run the same version of thetahat in all of them"
        ))
    })
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum Asked {
    /// Some rows of the channels, and the energy of the output in all.
    Rows(Vec<Range<usize>>),
    /// Of the errors of a model.
    Errors(ModelErrors, AboutErrors),
    /// Of the likelihood of a model in equations: its value, and its slopes if these are wanted.
    Likelihood { z: Vec<f64>, slopes: bool },
}

/// The errors of a model as a function of the parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct ModelErrors {
    pub(super) orders: Orders,
    pub(super) begin: InitialCondition,
    /// How many of the last inputs are ones.
    pub(super) constants: usize,
}

/// Parameters, and the weights of the initial-condition responses one experiment after the other.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Point {
    pub(super) parameters: Vec<f64>,
    pub(super) free: Vec<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum AboutErrors {
    /// How many count, and how many initial conditions there are.
    Size,
    /// J and the normal equations.
    Sums(Point),
    /// The factor of psi.
    Factor(Point),
    /// What an autoregression of this order needs.
    Autoregression(Point, usize),
    /// The products of combinations of psi, filtered.
    Filtered { at: Point, weights: Vec<Vec<f64>>, monic: Vec<f64> },
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum Found {
    Rows {
        channels: Vec<Vec<f64>>,
        energy: f64,
    },
    /// The samples that count; the sum of their outputs, and that of the squares.
    Size {
        samples: usize,
        free: Vec<usize>,
        output: [f64; 2],
    },
    /// None where the errors overflow.
    Sums(Option<Sums>),
    Factor(Option<Factor>),
    Autoregression(Option<ErrorProducts>),
    Filtered(Option<Vec<Vec<f64>>>),
    Likelihood(LikelihoodSums),
}

/// J and the normal equations at a point, the initial-condition responses taken out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Sums {
    pub(super) cost: f64,
    pub(super) matrix: Vec<f64>,
    pub(super) right: Vec<f64>,
    /// The diagonal of the Gram matrix before they were taken out.
    pub(super) diagonal: Vec<f64>,
    pub(super) free_gain: f64,
    /// For each experiment, the step of its weights for no change of the parameters, then for each of them.
    pub(super) free_steps: Vec<f64>,
}

/// A triangular factor and what belongs to it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Factor {
    pub(super) triangle: Vec<f64>,
    pub(super) rotated: Vec<f64>,
    pub(super) residual_norm: f64,
    pub(super) rows: usize,
}

/// What the experiments of one holder say of a point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum LikelihoodSums {
    Value(f64),
    Slopes(Slopes),
    /// The experiment, counted from the holder's first one, and its row in which the filter does not work.
    Failure {
        log: usize,
        row: usize,
    },
}
