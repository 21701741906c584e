//! Fits of models in blocks.

#[cfg(test)]
mod tests;

use thetahat_numerics::optimize::Monitor;

use super::equations::{EquationsPlan, fit_equations};
use super::schema::Report;
use crate::Error;
use crate::data::{Log, Source};
use crate::estimate::{BlockStructure, BlocksOptions, CurveForm, blocks};
use crate::model::GreyBox;

/// What model in blocks to fit to what, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct BlocksPlan {
    /// The channels of the inputs.
    pub inputs: Vec<String>,
    /// The channel of the output.
    pub output: String,
    /// How linear systems and curves follow one another.
    pub structure: BlockStructure,
    /// States, of which the number with the least MDL is chosen: the first and the last; none: 1 to 3, of two linear
    /// systems 2 to 4.
    pub orders: Option<(usize, usize)>,
    /// Samples from each input to its first effect; none: those with the least MDL.
    pub delays: Option<Vec<usize>>,
    /// The form of the curves; none: lines, of a feedback a polynomial of degree 3.
    pub curve: Option<CurveForm>,
    /// Which rows, and how to search.
    pub fit: EquationsPlan,
}

impl BlocksPlan {
    /// That it makes sense.
    ///
    /// # Errors
    /// [`Error::Argument`] for channels, orders, delays or curves that do not go together.
    pub fn check(&self) -> Result<(), Error> {
        let refused = |argument: &str, message: &str| Err(Error::argument(argument, message));
        let (first, last) = self.orders();
        let is_of_two = self.structure == BlockStructure::WienerHammerstein;
        if self.inputs.is_empty() {
            return refused("input", "a model in blocks has an input at least");
        }
        if self.inputs.contains(&self.output) {
            return refused("output", "it is an input too; name another");
        }
        if first < if is_of_two { 2 } else { 1 } || first > last || last > 10 {
            let lowest = if is_of_two { "2, one for each linear system" } else { "1" };
            return refused(
                "order",
                &format!("write it as N or A..B, from {lowest} to 10, such as 2 or 1..4"),
            );
        }
        match (self.curve(), self.structure) {
            (CurveForm::Lines(_), BlockStructure::Feedback) => {
                return refused(
                    "curve",
                    "lines of a feedback and its poles say the same; a feedback takes poly",
                );
            }
            (CurveForm::Lines(Some(knots)), _) if !(3..=100).contains(&knots) => {
                return refused("knots", "give 3 to 100");
            }
            (CurveForm::Polynomial(degree), _) if !(2..=15).contains(&degree) => {
                return refused("degree", "of a curve it is 2 to 15; a straight line makes a linear model");
            }
            _ => {}
        }
        match &self.delays {
            Some(delays) if delays.len() != self.inputs.len() => {
                let message = format!(
                    "{} numbers for {} inputs; give one for all or one for each",
                    delays.len(),
                    self.inputs.len()
                );
                refused("nk", &message)
            }
            Some(delays) if delays.iter().any(|delay| *delay > 1000) => {
                refused("nk", "a delay is 1000 samples at most")
            }
            _ => Ok(()),
        }
    }

    fn orders(&self) -> (usize, usize) {
        let two = self.structure == BlockStructure::WienerHammerstein;
        self.orders.unwrap_or(if two { (2, 4) } else { (1, 3) })
    }

    fn curve(&self) -> CurveForm {
        let own = match self.structure {
            BlockStructure::Feedback => CurveForm::Polynomial(3),
            _ => CurveForm::Lines(None),
        };
        self.curve.unwrap_or(own)
    }
}

/// Fits a model in blocks to a log and reports on it: as equations, with their standard errors.
///
/// Training is for the least errors of the free run, from a state of its own in each stretch of rows without a missing
/// input; [`fit_equations`] goes on from there with the states that a filter finds, so that all verbs know the model.
///
/// An iteration of the training costs O(N p (n + q)^2 + N p^2) for n states, q curves and p parameters; an iteration
/// after it as much as one of a model in equations.
///
/// # Errors
/// [`Error::Argument`] as for [`BlocksPlan::check`], and for rows that are not there; [`Error::Data`] if a channel is
/// not there or the clock is not regular; [`Error::Undetermined`] if a channel does not move, no linear model follows
/// the output, or the log leaves a parameter open; [`Error::Interrupted`] if the monitor says so.
///
/// ```
/// use std::ops::ControlFlow;
/// use thetahat::data::{Channel, Log};
/// use thetahat::estimate::BlockStructure;
/// use thetahat::report::{BlocksPlan, EquationsPlan, fit_blocks};
///
/// // A valve that opens from 3 on, and a lag after it.
/// let valve: Vec<f64> = (0..600_u32).map(|k| f64::from(k / 5 * 7919 % 11)).collect();
/// let mut level = vec![0.0];
/// for k in 1..600 {
///     level.push(0.8 * level[k - 1] + 0.2 * (valve[k - 1] - 3.0).max(0.0));
/// }
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("valve", valve), channel("level", level)], 1.0)?;
/// let plan = BlocksPlan {
///     inputs: vec!["valve".into()],
///     output: "level".into(),
///     structure: BlockStructure::Hammerstein,
///     orders: Some((1, 1)),
///     delays: None,
///     curve: None,
///     fit: EquationsPlan::default(),
/// };
/// let report = fit_blocks(&log, &[], &plan, &|_| ControlFlow::Continue(()))?;
/// let f1 = &report.model.parameters()[0];
/// assert!(f1.name == "f1" && (f1.value + 0.8).abs() < 1e-3);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn fit_blocks(
    log: &Log,
    sources: &[Source],
    plan: &BlocksPlan,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    plan.check()?;
    let rows = plan.fit.fitted_rows(log.rows())?;
    let record = log.driven_record(&plan.inputs, &plan.output, &rows)?;
    let options = BlocksOptions {
        structure: plan.structure,
        orders: plan.orders(),
        delays: plan.delays.clone(),
        curve: plan.curve(),
        search: plan.fit.search.clone(),
    };
    let text = blocks((&record, &plan.inputs, &plan.output), log.sample_time(), &options, monitor)?;
    fit_equations(&GreyBox::from_toml(&text)?, log, sources, &plan.fit, monitor)
}
