//! Whether samples come at the pace of the model.

use serde::{Deserialize, Serialize};

/// The clock of a log that is followed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Pace {
    /// Seconds from one sample to the next: as given, or the first step.
    sample_time: Option<f64>,
    /// The latest time.
    last: Option<f64>,
}

/// What a row's time says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// It follows the row before it.
    Regular,
    /// The step is less than half or more than one and a half of what it should be, or back.
    Gap,
}

impl Pace {
    pub(super) fn new(sample_time: Option<f64>) -> Self {
        Self { sample_time, last: None }
    }

    /// Whether its numbers fit together.
    pub(super) fn is_sound(&self) -> bool {
        self.sample_time.is_none_or(|step| step.is_finite() && step > 0.0)
            && self.last.is_none_or(f64::is_finite)
    }

    /// Seconds from one sample to the next, if they are known yet.
    pub(super) fn sample_time(&self) -> Option<f64> {
        self.sample_time
    }

    /// The latest time.
    pub(super) fn last(&self) -> Option<f64> {
        self.last
    }

    /// Goes on to the time of the next row.
    pub(super) fn step(&mut self, time: f64) -> Step {
        let Some(last) = self.last.replace(time) else { return Step::Regular };
        let step = time - last;
        if step <= 0.0 {
            return Step::Gap;
        }
        let sample_time = *self.sample_time.get_or_insert(step);
        if (0.5 * sample_time..=1.5 * sample_time).contains(&step) { Step::Regular } else { Step::Gap }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_compared_with_the_first_or_the_given_one() {
        let steps = |sample_time, times: &[f64]| -> Vec<Step> {
            let mut pace = Pace::new(sample_time);
            times.iter().map(|&time| pace.step(time)).collect()
        };
        use Step::{Gap, Regular};
        assert_eq!(steps(None, &[5.0, 5.1, 5.24, 5.38, 5.6]), [Regular, Regular, Regular, Regular, Gap]);
        assert_eq!(steps(Some(1.0), &[0.0, 3.0, 4.0, 4.2, 4.0]), [Regular, Gap, Regular, Gap, Gap]);
        assert_eq!(steps(None, &[1.0, 1.0, 2.0]), [Regular, Gap, Regular]);
    }
}
