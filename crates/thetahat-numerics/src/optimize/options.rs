//! How to search.

use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;

/// How a search chooses its steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Algorithm {
    /// Levenberg and Marquardt: the Gauss-Newton matrix with a damped diagonal.
    #[default]
    #[serde(rename = "lm")]
    LevenbergMarquardt,
    /// Gauss and Newton, with a step that is halved until the cost falls.
    GaussNewton,
    /// Newton and Raphson: the full Hessian, made positive definite by a perturbed diagonal.
    Newton,
    /// Steepest descent, in parameters scaled by the diagonal of the Gauss-Newton matrix.
    Gradient,
    /// Simulated annealing, and from the best point that it met the way of Levenberg and Marquardt.
    Annealing,
}

/// The length of the steps of [`Algorithm::Gradient`]: `c1/(c2 + l)` in iteration l = 0, 1, …; `c1` if there is no
/// `c2`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Step {
    /// Above 0. 1 takes each parameter alone to its minimum.
    pub c1: f64,
    /// Above 0.
    pub c2: Option<f64>,
}

impl Default for Step {
    fn default() -> Self {
        Self { c1: 1.0, c2: None }
    }
}

/// How to search.
#[derive(Debug, Clone, PartialEq)]
pub struct Search {
    /// How steps are chosen.
    pub algorithm: Algorithm,
    /// Iterations at most, for each start.
    pub max_iterations: usize,
    /// The search stops when the next step would lower the cost by less than this fraction.
    pub tolerance: f64,
    /// The step length of steepest descent.
    pub step: Step,
    /// The number of further starts to search from: the other candidates, then random ones.
    pub starts: usize,
    /// The seed of the random starts.
    pub seed: u64,
    /// After this time no iteration begins, no further start is searched from, and none but the first is computed.
    pub time_limit: Option<Duration>,
    /// One more start: parameters in their order, such as those of a model that is known to be close.
    pub initial_parameters: Option<Vec<f64>>,
    /// Whether steps are made by orthogonal transformations in the coordinates of the objective from the beginning on,
    /// and not only where others end.
    pub orthogonal: bool,
    /// Whether the plant is found first, with the least errors of its free run, and the noise after it: for models that
    /// simulate. Else all parameters together have the least errors one step ahead.
    pub plant_first: bool,
}

impl Search {
    /// Checks the numbers, and that a start that is given has a value for each of the parameters, of these names.
    ///
    /// # Errors
    /// [`Error::Argument`] for a tolerance or step constant that is not positive, or initial parameters of another
    /// length.
    pub fn check(&self, names: &[String]) -> Result<(), Error> {
        if let Some(initial) = &self.initial_parameters
            && (initial.len() != names.len() || !initial.iter().all(|value| value.is_finite()))
        {
            return Err(Error::argument(
                "initial_parameters",
                format!(
                    "it has {} values; give {} finite ones: {}",
                    initial.len(),
                    names.len(),
                    names.join(", ")
                ),
            ));
        }
        self.check_numbers()
    }

    /// The same for what does not depend on the orders.
    pub fn check_numbers(&self) -> Result<(), Error> {
        let positive = |name: &str, value: f64| {
            if value.is_finite() && value > 0.0 {
                return Ok(());
            }
            Err(Error::argument(name, format!("{value} is not a positive number")))
        };
        positive("tolerance", self.tolerance)?;
        positive("step", self.step.c1)?;
        self.step.c2.map_or(Ok(()), |c2| positive("step", c2))
    }
}

impl Default for Search {
    fn default() -> Self {
        Self {
            algorithm: Algorithm::default(),
            max_iterations: 100,
            tolerance: 1e-8,
            step: Step::default(),
            starts: 0,
            seed: 0,
            time_limit: None,
            initial_parameters: None,
            orthogonal: false,
            plant_first: false,
        }
    }
}

impl Step {
    /// The step length of an iteration.
    pub(super) fn at(&self, iteration: usize) -> f64 {
        self.c2.map_or(self.c1, |c2| self.c1 / (c2 + iteration as f64))
    }
}
