//! Reports of models with fewer states.

use super::Report;
use crate::Error;
use crate::estimate::Criteria;
use crate::figures::number;
use crate::model::{Signal, StateSpaceModel};

impl Report {
    /// The Hankel singular values of its model, falling: see
    /// [`StateSpace::hankel_singular_values`](crate::model::StateSpace::hankel_singular_values).
    ///
    /// # Errors
    /// [`Error::Argument`] for a model that is neither in state space nor of polynomials; as for
    /// [`StateSpace::hankel_singular_values`](crate::model::StateSpace::hankel_singular_values).
    pub fn hankel_singular_values(&self) -> Result<Vec<f64>, Error> {
        self.model.innovations_form()?.hankel_singular_values()
    }

    /// The report with a model of so many states by balanced truncation, and a bound of what that does to the frequency
    /// response: see [`StateSpace::reduced`](crate::model::StateSpace::reduced). It keeps what it says of the data, and
    /// has no figures of a fit: validate it.
    ///
    /// # Errors
    /// [`Error::Argument`] for a model that is neither in state space nor of polynomials; as for
    /// [`StateSpace::reduced`](crate::model::StateSpace::reduced).
    ///
    /// ```
    /// use thetahat::data::{Channel, Log};
    /// use thetahat::report::{StateSpacePlan, fit_state_space};
    ///
    /// // Poles at 0.9 and 0.1, of which the first does nearly all.
    /// let (mut u, mut y, mut x, mut random) = (vec![], vec![], [0.0, 0.0], 1_u32);
    /// for _ in 0..500 {
    ///     random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    ///     u.push(f64::from(random >> 16) / 32_768.0 - 1.0);
    ///     y.push(x[0] + 0.1 * x[1]);
    ///     x = [0.9 * x[0] + u[u.len() - 1], 0.1 * x[1] + u[u.len() - 1]];
    /// }
    /// let channel = |name: &str, values| Channel { name: name.into(), values };
    /// let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0)?;
    /// let plan = StateSpacePlan { orders: Some(2..=2), ..StateSpacePlan::new(&["u"], &["y"]) };
    /// let report = fit_state_space(&log, &[], &plan)?;
    /// let (reduced, bound) = report.reduced(1)?;
    /// assert_eq!(reduced.model.name(), "state space of order 1");
    /// assert!((bound / (2.0 * report.hankel_singular_values()?[1]) - 1.0).abs() < 1e-9);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn reduced(&self, order: usize) -> Result<(Self, f64), Error> {
        let space = self.model.innovations_form()?;
        let states = space.f.nrows();
        let found = space.reduced(order)?;
        let own = |signals: &[Signal]| signals.to_vec();
        let (inputs, outputs) = (own(self.model.inputs()), own(self.model.outputs()));
        let (m, l) = (inputs.len(), outputs.len());
        let direct = if found.model.d.iter().any(|entry| *entry != 0.0) { l * m } else { 0 };
        let degrees = self.model.degrees_of_freedom();
        let free = order * (m + 2 * l) + direct;
        let model = StateSpaceModel::new((inputs, outputs), vec![0; m], &found.model, free, degrees)?;
        let mut report = Self {
            model: model.into(),
            fit: Vec::new(),
            purpose: String::new(),
            selection: None,
            ..self.clone()
        };
        // They were those of another model.
        report.estimation.criteria = Criteria::new(f64::NAN, free, report.estimation.samples);
        report.warnings = vec![format!(
            "the model was reduced from {states} to {order} states: its frequency response is off by {} at most, the noise in units of its \
             deviation",
            number(found.error_bound)
        )];
        Ok((report, found.error_bound))
    }
}

#[cfg(test)]
mod tests;
