//! Nonlinear ARX models, estimated and stored.

use thetahat_core::nalgebra::Const;
use thetahat_core::{
    ArxOrders, Error, Forgetting, Innovation, InputOrders, NonlinearArx, Polynomial, Radial, RecursiveNarx,
    Scaling,
};

use crate::record::{Sample, sample};
use crate::recursive::recursive_numbers;
use crate::{Case, Scenario};

/// y(k-1), y(k-2), u(k-1).
const ORDERS: ArxOrders<'_> = ArxOrders { na: 2, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
/// All ten products of at most two of them.
const PRODUCTS: Polynomial<'_> = Polynomial {
    factors: &[0, 1, 2, 0, 0, 0, 1, 0, 2, 1, 1, 1, 2, 2, 2],
    ends: &[0, 1, 2, 3, 5, 7, 9, 11, 13, 15],
};
const OUTPUT: Scaling<f32> = Scaling { offset: 0.25, scale: 1.5 };
const INPUT: Scaling<f32> = Scaling { offset: 0.0, scale: 1.0 };

/// Ten terms of degree two, one sample in.
pub(crate) struct Narx(RecursiveNarx<f32, Polynomial<'static>, Const<3>, Const<10>>);

impl Scenario for Narx {
    const NAME: &'static str = "RecursiveNarx, 10 terms";
    const DETOUR: bool = true;
    type Input = Sample;
    type Output = Innovation<f32>;

    fn start(_: Case) -> Result<Self, Error> {
        let forgetting = Forgetting::Exponential { factor: 0.98 };
        RecursiveNarx::new(PRODUCTS, &ORDERS, OUTPUT, &[INPUT], forgetting).map(Narx)
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
            ahead.into_iter().for_each(&mut *number);
        }
        let mut slopes = [0.0; 3];
        let parameters = self.0.estimator().parameters().as_slice();
        if self.0.model().slopes_at(parameters, &[0.5, -0.25, 1.0], &mut slopes).is_ok() {
            slopes.into_iter().for_each(number);
        }
    }
}

const CENTRES: [f32; 12] = [-0.8, -0.6, -1.0, 0.7, 0.4, 1.0, -0.2, 0.1, 0.9, 1.1, 0.8, -0.7];
const INVERSE_SQUARES: [f32; 4] = [0.25, 0.5, 0.4, 0.3];
const THETA: [f32; 8] = [0.05, 0.9, -0.3, 0.4, 0.6, -0.5, 0.3, -0.2];

/// A stored model of four radial functions and a linear path: its free run over three samples.
pub(crate) struct Stored(NonlinearArx<f32, Radial<'static, f32>, Const<3>>);

impl Scenario for Stored {
    const NAME: &'static str = "NonlinearArx, 4 centres";
    type Input = Sample;
    type Output = [f32; 3];

    fn start(_: Case) -> Result<Self, Error> {
        let radial =
            Radial { regressors: 3, centres: &CENTRES, inverse_squares: &INVERSE_SQUARES, linear: true };
        NonlinearArx::new(radial, &ORDERS, OUTPUT, &[INPUT]).map(Stored)
    }

    fn input(case: Case, k: usize) -> Sample {
        sample(case, k, 0)
    }

    #[inline(never)]
    fn step(&mut self, sample: &Sample) -> Result<[f32; 3], Error> {
        self.0.log_row(sample.y, &[sample.u])?;
        let mut ahead = [0.0; 3];
        self.0.predict(&THETA, &[1.0, 0.0, -1.0], &mut ahead)?;
        Ok(ahead)
    }

    fn numbers(&self, ahead: &[f32; 3], number: &mut impl FnMut(f32)) {
        ahead.iter().copied().for_each(&mut *number);
        let mut slopes = [0.0; 3];
        if self.0.slopes_at(&THETA, &[0.5, -0.25, 1.0], &mut slopes).is_ok() {
            slopes.into_iter().for_each(number);
        }
    }
}
