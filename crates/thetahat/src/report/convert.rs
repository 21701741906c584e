//! Reports of models at other sample times and in continuous time.

use super::Report;
use crate::Error;
use crate::estimate::Criteria;
use crate::model::{Hold, Model, TimeBase};

impl Report {
    /// The report with its model in continuous time or at another sample time: see [`Model::to_continuous`] and
    /// [`Model::at_sample_time`]. Without a `hold` that of a model in continuous time, and `zoh` for others. It keeps
    /// what it says of the data, and has no figures of a fit: validate it.
    ///
    /// # Errors
    /// Those of [`Model::to_continuous`] and [`Model::at_sample_time`].
    ///
    /// ```
    /// use thetahat::data::{Channel, Log};
    /// use thetahat::model::{Model, TimeBase};
    /// use thetahat::report::{StateSpacePlan, fit_state_space};
    ///
    /// let (mut u, mut y, mut x, mut random) = (vec![], vec![], 0.0, 1_u32);
    /// for _ in 0..500 {
    ///     random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    ///     u.push(f64::from(random >> 16) / 32_768.0 - 1.0);
    ///     y.push(x);
    ///     x = 0.9 * x + u[u.len() - 1];
    /// }
    /// let channel = |name: &str, values| Channel { name: name.into(), values };
    /// let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
    /// let plan = StateSpacePlan { orders: Some(1..=1), ..StateSpacePlan::new(&["u"], &["y"]) };
    /// let report = fit_state_space(&log, &[], &plan)?;
    ///
    /// let continuous = report.converted(TimeBase::Continuous, None)?;
    /// assert_eq!(continuous.model.name(), "continuous state space of order 1");
    /// let slower = report.converted(TimeBase::Sampled(0.5), None)?;
    /// assert_eq!((slower.model.sample_time(), slower.fit.len()), (0.5, 0));
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn converted(&self, to: TimeBase, hold: Option<Hold>) -> Result<Self, Error> {
        let hold = hold.or(self.model.own_hold()).unwrap_or_default();
        let model: Model = match to {
            TimeBase::Continuous => self.model.to_continuous(hold)?.into(),
            TimeBase::Sampled(seconds) => self.model.at_sample_time(seconds, Some(hold))?.into(),
        };
        let free = model.free_parameters();
        let mut report =
            Self { model, fit: Vec::new(), purpose: String::new(), selection: None, ..self.clone() };
        // They were those of another model.
        report.estimation.criteria = Criteria::new(f64::NAN, free, report.estimation.samples);
        let from = match self.model.is_continuous() {
            true => TimeBase::Continuous,
            false => TimeBase::Sampled(self.model.sample_time()),
        };
        let errors = if report.model.has_standard_errors() { "" } else { " and no standard errors" };
        let how = match (self.model.as_process(), to) {
            (Some(_), TimeBase::Continuous) => "the process was put into state space".to_owned(),
            _ => format!("the model was converted from {from} to {to} with {hold}"),
        };
        report.warnings = vec![format!("{how}: it has no figures of a fit{errors}")];
        Ok(report)
    }
}

#[cfg(test)]
mod tests;
