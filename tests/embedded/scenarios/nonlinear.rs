//! Nonlinear ARX models, estimated and stored.

use thetahat_core::nalgebra::Const;
use thetahat_core::{
    Activation, ArxOrders, Basis, Error, Forgetting, Innovation, InputOrders, Local, Membership, Neighbours,
    Network, NonlinearArx, Polynomial, Radial, RecursiveNarx, Scaling, Spline,
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

/// The functions of a stored model, and its parameters.
pub(crate) trait StoredMap: Basis<f32> + 'static {
    const NAME: &'static str;
    const THETA: &'static [f32];

    fn map(case: Case) -> Self;
}

/// A stored model: its free run over three samples.
pub(crate) struct Stored<M: StoredMap>(NonlinearArx<f32, M, Const<3>>);

impl<M: StoredMap> Scenario for Stored<M> {
    const NAME: &'static str = M::NAME;
    type Input = Sample;
    type Output = [f32; 3];

    fn start(case: Case) -> Result<Self, Error> {
        NonlinearArx::new(M::map(case), &ORDERS, OUTPUT, &[INPUT]).map(Stored)
    }

    fn input(case: Case, k: usize) -> Sample {
        sample(case, k, 0)
    }

    #[inline(never)]
    fn step(&mut self, sample: &Sample) -> Result<[f32; 3], Error> {
        self.0.log_row(sample.y, &[sample.u])?;
        let mut ahead = [0.0; 3];
        self.0.predict(M::THETA, &[1.0, 0.0, -1.0], &mut ahead)?;
        Ok(ahead)
    }

    fn numbers(&self, ahead: &[f32; 3], number: &mut impl FnMut(f32)) {
        ahead.iter().copied().for_each(&mut *number);
        let mut slopes = [0.0; 3];
        if self.0.slopes_at(M::THETA, &[0.5, -0.25, 1.0], &mut slopes).is_ok() {
            slopes.into_iter().for_each(number);
        }
    }
}

/// All ten products.
impl StoredMap for Polynomial<'static> {
    const NAME: &'static str = "NonlinearArx, 10 terms";
    const THETA: &'static [f32] = &[0.05, 0.9, -0.3, 0.4, 0.04, -0.05, 0.03, -0.02, 0.06, 0.01];

    fn map(_: Case) -> Self {
        PRODUCTS
    }
}

/// Four radial functions and a linear path.
impl StoredMap for Radial<'static, f32> {
    const NAME: &'static str = "NonlinearArx, 4 centres";
    const THETA: &'static [f32] = &[0.05, 0.9, -0.3, 0.4, 0.6, -0.5, 0.3, -0.2];

    fn map(_: Case) -> Self {
        Radial {
            regressors: 3,
            centres: &[-0.8, -0.6, -1.0, 0.7, 0.4, 1.0, -0.2, 0.1, 0.9, 1.1, 0.8, -0.7],
            inverse_squares: &[0.25, 0.5, 0.4, 0.3],
            linear: true,
        }
    }
}

/// Four units and a linear path, as a fit on the command line found them: `thetahat fit tests/data/public/robot_arm.csv
/// --sample-time 1 --narx tanh --units 4 --ridge 0.1 --ny 2 --nu 1 --focus prediction`.
impl StoredMap for Network<'static, f32> {
    const NAME: &'static str = "NonlinearArx, 4 units";
    const THETA: &'static [f32] =
        &[0.00817375, 1.19032, -0.779992, -0.113058, -0.313913, 0.356209, -0.31298, 0.270718];

    fn map(_: Case) -> Self {
        Network {
            activation: Activation::Tanh,
            regressors: 3,
            weights: &[
                -0.185519, 0.182955, 0.0123917, 0.171539, -0.261067, 0.0376621, -0.185279, 0.181924,
                0.0137497, 0.211985, -0.0135819, 0.187176,
            ],
            biases: &[-0.00479655, -0.013676, -0.00478868, -0.0251885],
        }
    }
}

/// Four bends and a linear path.
impl StoredMap for Spline<'static, f32> {
    const NAME: &'static str = "NonlinearArx, 4 bends";
    const THETA: &'static [f32] = &[0.05, 0.9, -0.3, 0.4, 0.6, -0.5, 0.3, -0.2];

    fn map(_: Case) -> Self {
        const LOW: [f32; 3] = [-1.0, -0.3, 0.4];
        const HIGH: [f32; 3] = [-0.3, 0.4, 1.1];
        Spline { regressors: 3, bent: &[0, 0, 1, 2], knots: &[LOW, HIGH, LOW, HIGH] }
    }
}

/// Three planes: by Gaussians in the typical case, by trapezoids in the hard one.
impl StoredMap for Local<'static, f32> {
    const NAME: &'static str = "NonlinearArx, 3 planes";
    const THETA: &'static [f32] = &[0.05, 0.9, -0.3, 0.4, 0.1, 0.7, -0.2, 0.5, -0.1, 0.8, -0.1, 0.3];

    fn map(case: Case) -> Self {
        const ALL: [f32; 2] = [-1.5, 1.5];
        const LOW: [f32; 2] = [-1.5, 0.0];
        const HIGH: [f32; 2] = [0.0, 1.5];
        let membership = match case {
            Case::Typical => Membership::Gaussian,
            Case::Hard => Membership::Trapezoid,
        };
        Local {
            membership,
            planes: true,
            sides: &[LOW, ALL, ALL, HIGH, ALL, LOW, HIGH, ALL, HIGH],
            domain: &[ALL, ALL, ALL],
        }
    }
}

/// Twelve samples, of which five are asked for a plane.
impl StoredMap for Neighbours<'static, f32> {
    const NAME: &'static str = "NonlinearArx, 5 of 12 samples";
    const THETA: &'static [f32] = &[-0.9, 0.7, 0.3, 1.2, -0.4, 0.1, 0.8, -1.1, 0.6, -0.2, 0.5, -0.7];

    fn map(_: Case) -> Self {
        Neighbours {
            regressors: 3,
            points: &[
                -0.8, -0.6, -1.0, 0.7, 0.4, 1.0, -0.2, 0.1, 0.9, 1.1, 0.8, -0.7, -0.4, -0.9, 0.2, 0.1, 0.3,
                -0.5, 0.9, 0.2, 0.6, -1.2, -0.7, 0.4, 0.5, 1.0, -0.1, -0.1, -0.5, 0.7, 0.3, -0.2, 0.0, -0.6,
                0.2, -0.8,
            ],
            count: 5,
            planes: true,
        }
    }
}
