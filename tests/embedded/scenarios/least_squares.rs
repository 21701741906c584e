//! The delay lines, and least squares row by row.

use thetahat_core::nalgebra::{Const, Vector4};
use thetahat_core::{ArxOrders, Error, InputOrders, Lags, LeastSquares};

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
