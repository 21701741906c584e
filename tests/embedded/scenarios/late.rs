//! A Kalman filter whose second sensor is late: one step is a correction, at times a late one, and a prediction.

use thetahat_core::nalgebra::{Const, Matrix2, SVector, Vector2};
use thetahat_core::{
    Action, Covariance, Error, FilterHistory, Innovation, KalmanFilter, LinearObservation, LinearTransition,
    OutOfSequenceFilter,
};

use crate::record::sample;
use crate::{Case, Scenario};

const HISTORY: FilterHistory = FilterHistory { samples: 4, states: 2, outputs: 2, inputs: 0 };

/// Two states, two sensors; in the hard case each third sample of the second one comes four samples late.
pub(crate) struct Late {
    filter: OutOfSequenceFilter<f32, Const<2>, Const<2>, Const<0>, Const<{ HISTORY.numbers() }>>,
    transition: LinearTransition<f32, Const<2>>,
    observation: LinearObservation<f32, Const<2>, Const<2>>,
}

impl Scenario for Late {
    const NAME: &'static str = "OutOfSequenceFilter, 2 x 2, 4 late";
    const DETOUR: bool = true;
    type Input = (Vector2<f32>, Vector2<f32>);
    type Output = Innovation<f32, Vector2<f32>>;

    fn start(_: Case) -> Result<Self, Error> {
        let variances = |variance: f32| Covariance::from_diagonal(&Vector2::repeat(variance));
        let filter = KalmanFilter::new(Vector2::zeros(), variances(1.0)?)?;
        Ok(Late {
            filter: OutOfSequenceFilter::new(filter, Const, Const, HISTORY.samples)?,
            transition: LinearTransition::new(Matrix2::new(0.9, 0.1, -0.1, 0.8), variances(0.01)?)?,
            observation: LinearObservation::new(Matrix2::new(1.0, 0.1, 0.2, 1.0), variances(0.1)?)?,
        })
    }

    fn input(case: Case, k: usize) -> Self::Input {
        let (now, missing) = (Vector2::new(sample(case, k, 0).y, sample(case, k, 1).y), f32::NAN);
        let late = case == Case::Hard && k.is_multiple_of(3);
        let was_late = case == Case::Hard && k % 3 == 1 && k >= HISTORY.samples;
        let now = if late { Vector2::new(now.x, missing) } else { now };
        (now, Vector2::new(missing, if was_late { sample(case, k, 2).y } else { missing }))
    }

    #[inline(never)]
    fn step(&mut self, (now, late): &Self::Input) -> Result<Self::Output, Error> {
        let none = SVector::zeros();
        let innovation = self.filter.correct(&self.observation, &none, now)?;
        if !late.y.is_nan() {
            self.filter.correct_late(&self.transition, &self.observation, HISTORY.samples, late)?;
        }
        self.filter.predict(&self.transition, &none)?;
        Ok(innovation)
    }

    fn numbers(&self, innovation: &Self::Output, number: &mut impl FnMut(f32)) {
        number(innovation.nis);
        number(if innovation.action == Action::Updated { 1.0 } else { 0.0 });
        innovation.error.iter().chain(&innovation.variance).copied().for_each(&mut *number);
        self.filter.filter().state().iter().copied().for_each(&mut *number);
        self.filter.filter().covariance().matrix().iter().copied().for_each(number);
    }
}
