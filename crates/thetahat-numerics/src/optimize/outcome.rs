//! What a search tells while it runs and when it ends.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// When to begin nothing more; never, unless there is a limit.
#[derive(Debug, Clone, Copy, Default)]
pub struct Deadline(Option<Instant>);

impl Deadline {
    /// So long from now. A limit beyond the end of the clock is none.
    pub fn after(limit: Option<Duration>) -> Self {
        Self(limit.and_then(|limit| Instant::now().checked_add(limit)))
    }

    /// The time that is left; none where there is no limit.
    pub fn left(self) -> Option<Duration> {
        self.0.map(|deadline| deadline.saturating_duration_since(Instant::now()))
    }

    /// Whether the time is used up.
    pub fn is_over(self) -> bool {
        self.0.is_some_and(|deadline| Instant::now() >= deadline)
    }
}

/// Why a search stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Stopped {
    /// The next step would lower the cost by less than the tolerance.
    Converged,
    /// No step, however short, lowers the cost further: the end of what rounding allows, or of what stability allows.
    NoDescent,
    /// The iterations were used up.
    MaxIterations,
    /// The time was used up.
    TimeLimit,
}

/// Where a search is, told before each iteration. An answer of [`ControlFlow::Break`] ends the estimation with
/// [`Error::Interrupted`](crate::Error::Interrupted).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Iterations done from this start.
    pub iteration: usize,
    /// The cost for each sample, as the mean of e^2; for a model in equations the negative logarithm of the likelihood,
    /// for one in state space ln det cov e.
    pub cost: f64,
    /// How many models a choice has searched for, and how many there are at most; none of a search alone.
    pub models: Option<(usize, usize)>,
}

/// A function that is called with the progress of a search, and may end it.
pub type Monitor<'a> = &'a (dyn Fn(Progress) -> ControlFlow<()> + Sync);

/// What one search found.
#[derive(Debug, Clone)]
pub struct Found {
    /// theta, where the cost is least.
    pub parameters: Vec<f64>,
    /// The costs at the start and after each iteration.
    pub costs: Vec<f64>,
    /// The norm of the gradient there, as the objective measures it.
    pub gradient_norm: f64,
    /// Why it stopped.
    pub stopped: Stopped,
    /// Whether only stability held the search back from a lower cost.
    pub stability_bound: bool,
    /// Steps that were refused as they would have left the stable region.
    pub unstable_steps: usize,
}

impl Found {
    /// The least cost; infinite where none was computed.
    pub fn cost(&self) -> f64 {
        self.costs.last().copied().unwrap_or(f64::INFINITY)
    }
}
