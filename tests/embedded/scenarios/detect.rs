//! Change detection on innovations.

use thetahat_core::{Action, Alarm, ChangeDetector, Chart, Error, Innovation};

use crate::record::sample;
use crate::{Case, Scenario};

/// What the innovations of the true plant are, with the variance of the noise of the record: where the plant is
/// another, where there is none, and where a sample is missing or out of scale, the charts rise, give alarms, or wait.
pub(crate) struct Detector(ChangeDetector<f32>);

impl Scenario for Detector {
    const NAME: &'static str = "ChangeDetector";
    type Input = Innovation<f32>;
    type Output = Option<Alarm<f32>>;

    fn start(_: Case) -> Result<Self, Error> {
        ChangeDetector::new(5.0, 5.0).map(Detector)
    }

    fn input(case: Case, k: usize) -> Innovation<f32> {
        let past = |lag| sample(case, k, lag);
        let predicted = 1.5 * past(1).y - 0.7 * past(2).y + past(1).u + 0.5 * past(2).u;
        let (error, variance) = (past(0).y - predicted, 0.0125);
        Innovation::new(error, variance, error * error / variance, Action::Frozen)
    }

    #[inline(never)]
    fn step(&mut self, innovation: &Innovation<f32>) -> Result<Option<Alarm<f32>>, Error> {
        Ok(self.0.update(innovation))
    }

    fn numbers(&self, alarm: &Option<Alarm<f32>>, number: &mut impl FnMut(f32)) {
        for chart in [Chart::MeanUp, Chart::MeanDown, Chart::Variance] {
            number(self.0.statistic(chart));
            number(match alarm {
                Some(alarm) if alarm.chart == chart => alarm.statistic,
                _ => 0.0,
            });
        }
        number(alarm.map_or(0.0, |alarm| alarm.samples as f32));
    }
}
