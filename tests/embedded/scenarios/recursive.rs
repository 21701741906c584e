//! Recursive least squares, alone and fed by delay lines.

use thetahat_core::nalgebra::{Const, SVector, Vector2};
use thetahat_core::{
    Action, ArmaxMethod, ArmaxOrders, ArxOrders, Error, Forgetting, Innovation, InputOrders,
    OutputErrorMethod, RecursiveArmax, RecursiveArx, RecursiveLeastSquares, RecursiveOutputError,
    RecursiveVectorArx,
};

use crate::record::{Sample, regressor, sample};
use crate::{Case, Scenario};

const FORGETTING: Forgetting<f32> = Forgetting::Exponential { factor: 0.98 };
const INPUTS: &[InputOrders] = &[InputOrders { nb: 2, nk: 1 }];

/// Recursive least squares with N parameters, exponential forgetting and its cap.
pub(crate) struct Recursive<const N: usize>(RecursiveLeastSquares<f32, Const<N>>);

impl<const N: usize> Scenario for Recursive<N> {
    const NAME: &'static str = match N {
        4 => "RecursiveLeastSquares, n = 4",
        8 => "RecursiveLeastSquares, n = 8",
        _ => "RecursiveLeastSquares, n = 16",
    };
    const DETOUR: bool = true;
    type Input = (SVector<f32, N>, f32);
    type Output = Innovation<f32>;

    fn start(_: Case) -> Result<Self, Error> {
        RecursiveLeastSquares::new(&SVector::repeat(1.0), FORGETTING).map(Recursive)
    }

    fn input(case: Case, k: usize) -> Self::Input {
        (regressor(case, k), sample(case, k, 0).y)
    }

    #[inline(never)]
    fn step(&mut self, (regressor, output): &Self::Input) -> Result<Innovation<f32>, Error> {
        self.0.update(regressor, *output)
    }

    fn numbers(&self, innovation: &Innovation<f32>, number: &mut impl FnMut(f32)) {
        recursive_numbers(&self.0, innovation, number);
    }
}

/// An ARX(2, 2) model, one sample in.
pub(crate) struct Arx(RecursiveArx<f32, Const<4>>);

impl Scenario for Arx {
    const NAME: &'static str = "RecursiveArx, ARX(2, 2)";
    const DETOUR: bool = true;
    type Input = Sample;
    type Output = Innovation<f32>;

    fn start(_: Case) -> Result<Self, Error> {
        RecursiveArx::new(&ArxOrders { na: 2, inputs: INPUTS, constant: false }, 1.0, &[1.0], FORGETTING)
            .map(Arx)
    }

    fn input(case: Case, k: usize) -> Sample {
        sample(case, k, 0)
    }

    #[inline(never)]
    fn step(&mut self, sample: &Sample) -> Result<Innovation<f32>, Error> {
        self.0.log_row(sample.y, &[sample.u])
    }

    fn numbers(&self, innovation: &Innovation<f32>, number: &mut impl FnMut(f32)) {
        recursive_numbers(self.0.estimator(), innovation, number);
        let mut ahead = [0.0; 3];
        if self.0.predict(&[1.0, 0.0, 0.0], &mut ahead).is_ok() {
            ahead.into_iter().for_each(number);
        }
    }
}

/// An ARX(2, 2) model with two outputs, one sample in: the plant's, and that of five samples later in the record.
pub(crate) struct VectorArx(RecursiveVectorArx<f32, Const<6>, Const<2>>);

impl Scenario for VectorArx {
    const NAME: &'static str = "RecursiveVectorArx, 2 outputs";
    const DETOUR: bool = true;
    type Input = (Vector2<f32>, f32);
    type Output = Innovation<f32, Vector2<f32>>;

    fn start(_: Case) -> Result<Self, Error> {
        let orders = ArxOrders { na: 2, inputs: INPUTS, constant: false };
        RecursiveVectorArx::new(&orders, &Vector2::new(1.0, 1.0), &[1.0], FORGETTING).map(VectorArx)
    }

    fn input(case: Case, k: usize) -> Self::Input {
        let first = sample(case, k, 0);
        (Vector2::new(first.y, sample(case, k, 5).y), first.u)
    }

    #[inline(never)]
    fn step(&mut self, (outputs, input): &Self::Input) -> Result<Self::Output, Error> {
        self.0.log_row(outputs, &[*input])
    }

    fn numbers(&self, innovation: &Self::Output, number: &mut impl FnMut(f32)) {
        let estimator = self.0.estimator();
        estimator.parameters().iter().copied().for_each(&mut *number);
        innovation.error.iter().chain(&innovation.variance).copied().for_each(&mut *number);
        number(innovation.nis);
        number(estimator.excitation());
        let mut ahead = [0.0; 4];
        if self.0.predict(&[1.0, 0.0], &mut ahead).is_ok() {
            ahead.into_iter().for_each(number);
        }
    }
}

/// An ARMAX(2, 2, 1) model by recursive prediction error, one sample in.
pub(crate) struct Armax(RecursiveArmax<f32, Const<5>>);

impl Scenario for Armax {
    const NAME: &'static str = "RecursiveArmax, (2, 2, 1)";
    const DETOUR: bool = true;
    type Input = Sample;
    type Output = Innovation<f32>;

    fn start(_: Case) -> Result<Self, Error> {
        let orders = ArmaxOrders { na: 2, inputs: INPUTS, nc: 1, constant: false };
        RecursiveArmax::new(&orders, ArmaxMethod::PredictionError, 1.0, &[1.0], 0.1, FORGETTING).map(Armax)
    }

    fn input(case: Case, k: usize) -> Sample {
        sample(case, k, 0)
    }

    #[inline(never)]
    fn step(&mut self, sample: &Sample) -> Result<Innovation<f32>, Error> {
        self.0.log_row(sample.y, &[sample.u])
    }

    fn numbers(&self, innovation: &Innovation<f32>, number: &mut impl FnMut(f32)) {
        recursive_numbers(self.0.estimator(), innovation, number);
        let mut ahead = [0.0; 3];
        if self.0.predict(&[1.0, 0.0, 0.0], &mut ahead).is_ok() {
            ahead.into_iter().for_each(number);
        }
    }
}

/// An output-error model of order 2 by recursive prediction error, one sample in.
pub(crate) struct OutputError(RecursiveOutputError<f32, Const<4>>);

impl Scenario for OutputError {
    const NAME: &'static str = "RecursiveOutputError, OE(2, 2)";
    const DETOUR: bool = true;
    type Input = Sample;
    type Output = Innovation<f32>;

    fn start(case: Case) -> Result<Self, Error> {
        let orders = ArxOrders { na: 2, inputs: INPUTS, constant: false };
        let method = match case {
            Case::Typical => OutputErrorMethod::PredictionError,
            Case::Hard => OutputErrorMethod::Instruments,
        };
        RecursiveOutputError::new(&orders, method, 1.0, &[1.0], FORGETTING).map(OutputError)
    }

    fn input(case: Case, k: usize) -> Sample {
        sample(case, k, 0)
    }

    #[inline(never)]
    fn step(&mut self, sample: &Sample) -> Result<Innovation<f32>, Error> {
        self.0.log_row(sample.y, &[sample.u])
    }

    fn numbers(&self, innovation: &Innovation<f32>, number: &mut impl FnMut(f32)) {
        recursive_numbers(self.0.estimator(), innovation, number);
        let mut ahead = [0.0; 3];
        if self.0.predict(&[1.0, 0.0, 0.0], &mut ahead).is_ok() {
            ahead.into_iter().for_each(number);
        }
    }
}

pub(crate) fn recursive_numbers<const N: usize>(
    estimator: &RecursiveLeastSquares<f32, Const<N>>,
    innovation: &Innovation<f32>,
    mut number: &mut impl FnMut(f32),
) {
    [innovation.error, innovation.variance, innovation.nis].into_iter().for_each(&mut number);
    number(if innovation.action == Action::Capped { 1.0 } else { 0.0 });
    number(estimator.excitation());
    number(estimator.noise_variance().unwrap_or(f32::NAN));
    estimator.parameters().iter().copied().for_each(&mut number);
    estimator.covariance().matrix().iter().copied().for_each(number);
}
