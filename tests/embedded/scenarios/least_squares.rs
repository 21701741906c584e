//! The delay lines, and least squares row by row.

use thetahat_core::nalgebra::{Const, Vector4};
use thetahat_core::{
    Action, ArxOrders, Error, Innovation, InputOrders, Lags, LeastSquares, Window, WindowedLeastSquares,
};

use crate::record::{Sample, regressor, sample};
use crate::{Case, Scenario};

/// The delay lines of an ARX model: one sample in, the regressor out.
pub(crate) struct Lines(Lags<f32, Const<4>>);

impl Scenario for Lines {
    const NAME: &'static str = "Lags, ARX(2, 2)";
    type Input = Sample;
    type Output = Option<Vector4<f32>>;

    fn start(_: Case) -> Result<Self, Error> {
        Lags::new(&ArxOrders { na: 2, inputs: &[InputOrders { nb: 2, nk: 1 }], constant: false }).map(Lines)
    }

    fn input(case: Case, k: usize) -> Sample {
        sample(case, k, 0)
    }

    #[inline(never)]
    fn step(&mut self, sample: &Sample) -> Result<Option<Vector4<f32>>, Error> {
        self.0.push_inputs(&[sample.u])?;
        let regressor = self.0.regressor().copied();
        self.0.push_output(sample.y)?;
        Ok(regressor)
    }

    fn numbers(&self, regressor: &Option<Vector4<f32>>, number: &mut impl FnMut(f32)) {
        regressor.iter().flatten().copied().for_each(number);
    }
}

/// Least squares with four parameters: one row in.
pub(crate) struct Rows(LeastSquares<f32, Const<4>>);

impl Scenario for Rows {
    const NAME: &'static str = "LeastSquares, n = 4";
    type Input = (Vector4<f32>, f32);
    type Output = ();

    fn start(_: Case) -> Result<Self, Error> {
        Ok(Rows(LeastSquares::new()))
    }

    fn input(case: Case, k: usize) -> (Vector4<f32>, f32) {
        (regressor(case, k), sample(case, k, 0).y)
    }

    #[inline(never)]
    fn step(&mut self, (regressor, output): &(Vector4<f32>, f32)) -> Result<(), Error> {
        self.0.add(regressor, *output)
    }

    fn numbers(&self, (): &(), mut number: &mut impl FnMut(f32)) {
        self.0.factor().iter().copied().for_each(&mut number);
        self.0.rotated_output().iter().copied().for_each(&mut number);
        number(self.0.residual_norm());
        number(self.0.condition());
        if let Ok(solution) = self.0.solve() {
            solution.parameters().iter().copied().for_each(&mut number);
            solution.covariance().iter().flatten().copied().for_each(number);
        }
    }
}

/// 40 samples in 8 blocks.
const WINDOW: Window = Window { blocks: 8, block: 5 };

/// Least squares with four parameters on a window: one row in, and the oldest block out.
pub(crate) struct Windowed(WindowedLeastSquares<f32, Const<4>, Const<{ WINDOW.numbers(4) }>>);

impl Scenario for Windowed {
    const NAME: &'static str = "WindowedLeastSquares, n = 4";
    const DETOUR: bool = true;
    type Input = (Vector4<f32>, f32);
    type Output = Innovation<f32>;

    fn start(_: Case) -> Result<Self, Error> {
        WindowedLeastSquares::new(Const, WINDOW).map(Windowed)
    }

    fn input(case: Case, k: usize) -> Self::Input {
        (regressor(case, k), sample(case, k, 0).y)
    }

    #[inline(never)]
    fn step(&mut self, (regressor, output): &Self::Input) -> Result<Innovation<f32>, Error> {
        self.0.update(regressor, *output)
    }

    fn numbers(&self, innovation: &Innovation<f32>, number: &mut impl FnMut(f32)) {
        [innovation.error, innovation.variance, innovation.nis].into_iter().for_each(&mut *number);
        number(if innovation.action == Action::Collecting { 1.0 } else { 0.0 });
        self.0.parameters().iter().copied().for_each(&mut *number);
        number(self.0.noise_variance().unwrap_or(f32::NAN));
        if let Some(errors) = self.0.standard_errors() {
            errors.iter().copied().for_each(number);
        }
    }
}
