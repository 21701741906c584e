//! Controllers.

use thetahat_core::nalgebra::Const;
use thetahat_core::{Error, RstController, WantedPoles};

use crate::record::{Sample, sample};
use crate::{Case, Scenario};

/// A controller with an integrator of a plant of second order, its poles placed at the start; one sample in.
pub(crate) struct Placed(RstController<f32, Const<4>>);

impl Scenario for Placed {
    const NAME: &'static str = "RstController, order 4";
    const DETOUR: bool = false;
    type Input = Sample;
    type Output = f32;

    fn start(_: Case) -> Result<Self, Error> {
        let wanted = WantedPoles {
            response: &[1.0, -1.2, 0.4],
            observer: &[1.0, -0.3],
            integrator: true,
            cancel_zeros: false,
        };
        RstController::pole_placement(&[1.0, -1.5, 0.7], &[0.0, 1.0, 0.5], &wanted)?
            .with_limits(-5.0..=5.0)
            .map(Placed)
    }

    fn input(case: Case, k: usize) -> Sample {
        sample(case, k, 0)
    }

    #[inline(never)]
    fn step(&mut self, sample: &Sample) -> Result<f32, Error> {
        Ok(self.0.control(sample.u, sample.y))
    }

    fn numbers(&self, input: &f32, number: &mut impl FnMut(f32)) {
        number(*input);
        self.0.r().iter().chain(self.0.s()).copied().for_each(number);
    }
}
