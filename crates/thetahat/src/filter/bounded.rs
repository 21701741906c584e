//! Noise that is known by its bound alone: a set in which the state is.

use thetahat_core::nalgebra::{DVector, Dyn};
use thetahat_core::{LinearTransition, ZonotopeFilter};

use super::frame::Frame;
use super::kind::{Division, Kind, Motion, Sample};
use super::linear::Linear;
use super::row::{Row, Told};
use crate::Error;

pub(super) type StateSet = ZonotopeFilter<f64, Dyn, Dyn>;

/// How many generators a set has for each state: see [`ZonotopeFilter`].
const GENERATORS: usize = 10;

/// A set, and what bounds the noises where the model does not say it: so many of their standard deviations.
#[derive(Debug, Clone)]
pub(super) struct Bounded {
    pub(super) set: StateSet,
    deviations: Option<f64>,
}

impl Bounded {
    /// The set in which a model starts.
    ///
    /// # Errors
    /// [`Error::Argument`] if the model is not linear, or nothing says how large its noises are.
    pub(super) fn new(kind: &Kind, deviations: Option<f64>) -> Result<Self, Error> {
        let refused = |message: &str| Error::argument("estimator", message);
        let Kind::Sampled(frame, Motion::Linear(linear)) = kind else {
            return Err(refused(
                "bounded noise is for linear models, in matrices or a report of polynomials or state space: \
                 use the unscented Kalman filter (ukf)",
            ));
        };
        if let Some(wrong) = deviations.filter(|deviations| !(deviations.is_finite() && *deviations > 0.0)) {
            return Err(Error::argument("deviations", format!("{wrong} is no number above 0")));
        }
        match (&linear.bounds, deviations) {
            (None, None) => {
                return Err(refused(
                    "bounded needs bounds: write process_bound, measurement_bound and initial_bound in the model, or \
                     take so many standard deviations of its noises (deviations)",
                ));
            }
            (Some(_), Some(_)) => {
                return Err(Error::argument("deviations", "the model says its bounds itself; leave it out"));
            }
            (Some(_), None) if linear.is_correlated() => {
                return Err(refused("with S, bounds have no meaning of their own; leave S out"));
            }
            _ => {}
        }
        let start = match (&linear.bounds, deviations) {
            (Some(bounds), _) => bounds.initial.clone(),
            (None, deviations) => scaled(&frame.start_covariance.variances(), deviations.unwrap_or_default()),
        };
        let n = frame.start.len();
        let set = StateSet::new(frame.start.clone(), &start, Dyn(GENERATORS * n))
            .map_err(|error| Error::argument("start", error.to_string()))?;
        Ok(Self { set, deviations })
    }

    /// A row, over this step from the row before.
    pub(super) fn take(
        &mut self,
        (frame, linear): (&Frame, &Linear),
        from: Option<(&Sample, Division)>,
        sample: &Sample,
        row: &mut Row,
    ) -> Result<Told, thetahat_core::Error> {
        if let Some((from, (count, _))) = from {
            self.predict((frame, linear), from, count)?;
        }
        row.predicted.copy_from_slice(self.set.centre().as_slice());
        row.reaches(&self.set.reaches());
        let noise = match (&linear.bounds, self.deviations) {
            (Some(bounds), _) => bounds.measurement.clone(),
            (None, deviations) => scaled(&frame.output_noise.diagonal(), deviations.unwrap_or_default()),
        };
        let outputs =
            thetahat_core::Observation::output(&frame.observation, self.set.centre(), &sample.inputs);
        row.seen(&outputs, sample);
        let told = self.set.correct(&frame.observation, &noise, &sample.inputs, &sample.outputs)?;
        row.output_reaches(&told.bound);
        row.corrected(self.set.centre(), &self.set.reaches());
        Ok(Told::of_set(told.action, told.contradiction))
    }

    fn predict(
        &mut self,
        (frame, linear): (&Frame, &Linear),
        from: &Sample,
        count: usize,
    ) -> Result<(), thetahat_core::Error> {
        let there: Vec<bool> = from.outputs.iter().map(|output| !output.is_nan()).collect();
        let mut left = count;
        if let Some((transition, drives)) =
            linear.after(frame, &there)?.map(|transition| (transition, from.drives()))
        {
            let bounds = self.of(linear, &transition);
            self.set.predict(transition.as_ref(), &bounds, &drives)?;
            left -= 1;
        }
        let bounds = self.of(linear, &linear.transition);
        for _ in 0..left {
            self.set.predict(&linear.transition, &bounds, &from.inputs)?;
        }
        Ok(())
    }

    /// How large the noise of this transition is at most.
    fn of(&self, linear: &Linear, transition: &LinearTransition<f64, Dyn, Dyn>) -> DVector<f64> {
        match (&linear.bounds, self.deviations) {
            (Some(bounds), _) => bounds.process.clone(),
            (None, deviations) => scaled(&transition.noise().variances(), deviations.unwrap_or_default()),
        }
    }
}

/// So many standard deviations.
fn scaled(variances: &DVector<f64>, deviations: f64) -> DVector<f64> {
    variances.map(|variance| deviations * variance.max(0.0).sqrt())
}
