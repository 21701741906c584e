//! Controllers.

use thetahat_core::nalgebra::Const;
use thetahat_core::{
    DirectOrders, DirectSelfTuner, Error, Forgetting, IndirectSelfTuner, ResponseWanted, RstController,
    TunerOrders, TunerSettings, WantedPoles,
};

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
        let wanted = WantedPoles::new(&[1.0, -1.2, 0.4], &[1.0, -0.3]).with_integrator(true);
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

const FORGETTING: Forgetting<f32> = Forgetting::Exponential { factor: 0.99 };

fn settings() -> TunerSettings<f32> {
    let response = ResponseWanted { frequency: 0.4, damping: 0.8, observer: 0.3 };
    TunerSettings::new(response, -5.0..=5.0, 1.0)
}

/// A tuner of a plant of second order with a design in each step, while a hand applies what was recorded.
pub(crate) struct Tuned(IndirectSelfTuner<f32, Const<{ TUNED.parameters() }>, Const<{ TUNED.size() }>>);

const TUNED: TunerOrders = TunerOrders { na: 2, nb: 2, nc: 0, constant: true, integrator: true };

impl Scenario for Tuned {
    const NAME: &'static str = "IndirectSelfTuner, (2, 2)";
    const DETOUR: bool = false;
    type Input = Sample;
    type Output = f32;

    fn start(_: Case) -> Result<Self, Error> {
        IndirectSelfTuner::new(&TUNED, &settings(), 3.0, 1.0, FORGETTING).map(Tuned)
    }

    fn input(case: Case, k: usize) -> Sample {
        sample(case, k, 0)
    }

    #[inline(never)]
    fn step(&mut self, sample: &Sample) -> Result<f32, Error> {
        let input = self.0.control(0.5, sample.y);
        self.0.applied(sample.u);
        Ok(input)
    }

    fn numbers(&self, input: &f32, number: &mut impl FnMut(f32)) {
        number(*input);
        self.0.plant().estimator().parameters().iter().copied().for_each(&mut *number);
        if let Some(controller) = self.0.controller() {
            controller.r().iter().chain(controller.s()).copied().for_each(number);
        }
    }
}

/// The same with the coefficients of the controller estimated.
pub(crate) struct Direct(Straight);

const DIRECT: DirectOrders = DirectOrders { na: 2, nb: 2, delay: 1, constant: true };
type Straight = DirectSelfTuner<
    f32,
    Const<{ DIRECT.parameters() }>,
    Const<{ DIRECT.size() }>,
    Const<{ DIRECT.delays() }>,
>;

impl Scenario for Direct {
    const NAME: &'static str = "DirectSelfTuner, (2, 2)";
    const DETOUR: bool = false;
    type Input = Sample;
    type Output = f32;

    fn start(_: Case) -> Result<Self, Error> {
        Straight::new(&DIRECT, &settings(), 3.0, 1.0, FORGETTING).map(Direct)
    }

    fn input(case: Case, k: usize) -> Sample {
        sample(case, k, 0)
    }

    #[inline(never)]
    fn step(&mut self, sample: &Sample) -> Result<f32, Error> {
        let input = self.0.control(0.5, sample.y);
        self.0.applied(sample.u);
        Ok(input)
    }

    fn numbers(&self, input: &f32, number: &mut impl FnMut(f32)) {
        number(*input);
        self.0.parameters().iter().copied().for_each(number);
    }
}
