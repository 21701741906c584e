use thetahat_core::nalgebra::Dyn;
use thetahat_core::{Smoothed, Smoother};

use super::StateFilter;
use super::estimate::StateValues;
use super::estimator::Engine;
use super::kind::{Division, Kind, Recursion, Sample, Unscented};
use super::linearization::Work;
use crate::Error;

/// The states of a record, each given all of its rows, later ones too.
#[derive(Debug, Clone, PartialEq)]
pub struct SmoothedStates {
    states: usize,
    parameters: usize,
    /// Of each row, the states and then the parameters.
    values: Vec<f64>,
    deviations: Vec<f64>,
}

impl SmoothedStates {
    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.values.len() / (self.states + self.parameters).max(1)
    }

    /// The state in a row, counted from 1, and the unknown parameters as they were there, in their own units; none for
    /// row 0 and after the last one. Parameters that do not walk are the same in all rows.
    pub fn row(&self, row: usize) -> Option<(StateValues<'_>, StateValues<'_>)> {
        let size = self.states + self.parameters;
        let start = row.checked_sub(1)?.checked_mul(size)?;
        let (states, parameters) = self.values.get(start..start.checked_add(size)?)?.split_at(self.states);
        let (deviations, others) = self.deviations.get(start..start + size)?.split_at(self.states);
        let values =
            |values, deviations| StateValues { values, standard_deviations: Some(deviations), bounds: None };
        (row <= self.rows()).then_some((values(states, deviations), values(parameters, others)))
    }
}

impl StateFilter {
    /// The states of all rows since [`recording`](StateFilter::recording), each given all of them.
    ///
    /// The rows are filtered once more by a fixed-interval smoother, see [`Smoother`]. With a model that is not linear
    /// it smooths with the filter's linearisations. Memory: 2 N² + N numbers for each sample, N being the number of
    /// states and unknown parameters.
    ///
    /// # Errors
    /// [`Error::Argument`] if the rows were not recorded from the first one on, or the estimator is an observer;
    /// [`Error::Data`] if numbers overflow.
    ///
    /// ```
    /// use thetahat::filter::{Estimator, StateFilter, StateModel};
    ///
    /// let text = "sample_time = 1\noutputs = ['y']\nF = [[1]]\nH = [[1]]\nQ = [[1]]\nR = [[1e-9]]\nP0 = [[1]]";
    /// let mut filter = StateFilter::new(StateModel::from_toml(text)?, Estimator::Kalman)?.recording();
    /// for y in [2.0, f64::NAN, f64::NAN, f64::NAN, 6.0] {
    ///     filter.step(None, &[], &[y])?;
    /// }
    /// // Between two measurements a walk is a line, and least known in the middle.
    /// let smoothed = filter.smooth()?;
    /// let (state, _) = smoothed.row(3).unwrap();
    /// assert!((state.values[0] - 4.0).abs() < 1e-6);
    /// assert!((state.standard_deviations.unwrap()[0] - 1.0).abs() < 1e-6);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn smooth(&self) -> Result<SmoothedStates, Error> {
        if !self.is_gaussian() {
            let reason = match self.engine {
                Engine::Bounded(_) => "a set for bounded noise has no covariance, so it does not smooth",
                _ => "an observer knows no noises, so it does not smooth",
            };
            return Err(Error::argument("estimator", format!("{reason}: use a Kalman filter")));
        }
        let Some(history) = self.history().filter(|history| history.len() == self.totals().rows) else {
            return Err(Error::argument("recording", "the rows were not recorded from the first one on"));
        };
        let kind = &self.model().kind;
        let overflow =
            |error: thetahat_core::Error| Error::data(format!("the states cannot be smoothed: {error}"));
        let started = kind.started().map_err(overflow)?;
        let smoothed = match &self.engine {
            Engine::Unscented(_) => {
                let unscented = Unscented::new(started.state().clone(), started.covariance().clone());
                smoothed(kind, Smoother::from(unscented.map_err(overflow)?), history, Smoother::smooth)
            }
            Engine::Filter(filter) => {
                let iterated = started.with_iterations(filter.iterations()).map_err(overflow)?;
                smoothed(kind, Smoother::new(iterated), history, Smoother::smooth)
            }
            // Refused above.
            Engine::Bounded(_) | Engine::Observer { .. } => Ok(Vec::new()),
        };
        let smoothed = smoothed.map_err(overflow)?;

        let (states, parameters) = (self.model().states().len(), self.model().unknown().len());
        let (mut values, mut deviations) = (Vec::new(), Vec::new());
        for sample in &smoothed {
            values.extend_from_slice(sample.state.as_slice());
            deviations.extend(sample.covariance.diagonal().iter().map(|variance| variance.sqrt()));
        }
        if let Kind::Grey(grey) = kind {
            let size = states + parameters;
            for (values, deviations) in values.chunks_exact_mut(size).zip(deviations.chunks_exact_mut(size)) {
                let each = values.iter_mut().zip(deviations).skip(states).zip(grey.parameters());
                for ((value, deviation), parameter) in each {
                    *deviation *= parameter.scale.slope(*value).abs();
                    *value = parameter.scale.value(*value);
                }
            }
        }
        Ok(SmoothedStates { states, parameters, values, deviations })
    }
}

/// The states of rows, each with the step before it.
fn smoothed<S: Recursion>(
    kind: &Kind,
    mut smoother: S,
    history: &[(Option<Division>, Sample)],
    smooth: impl FnOnce(&S) -> Result<Vec<Smoothed<f64, Dyn>>, thetahat_core::Error>,
) -> Result<Vec<Smoothed<f64, Dyn>>, thetahat_core::Error> {
    let (mut past, mut work) = (kind.past(), Work::new());
    // Which of the smoother's samples a row is.
    let (mut place, mut places) = (0, Vec::with_capacity(history.len()));
    let mut previous = None;
    for (division, sample) in history {
        past.push(sample);
        if let Some((previous, division)) = previous.zip(*division) {
            kind.predict(&mut smoother, previous, sample, division, (&past, &mut work))?;
            place += division.0;
        }
        kind.correct(&mut smoother, sample, (&past, &mut work), |_| ())?;
        places.push(place);
        previous = Some(sample);
    }
    let all = smooth(&smoother)?;
    Ok(places.into_iter().filter_map(|place| all.get(place).cloned()).collect())
}
