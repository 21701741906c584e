//! How the errors of a model one step ahead depend on its parameters: psi(t) = -de(t)/dtheta, as lagged signals.
//!
//! ```text
//! psi(t):   a_i: -(D/C) q^-i y        b_ji: (D/(C F_j)) q^-i u_j     f_ji: -(D/(C F_j)) q^-i x_j
//!           c_i:  (1/C) q^-i e         d_i: -(1/C) q^-i w
//! ```
//!
//! with x_j = (B_j/F_j) u_j and w = A y - sum_j x_j (Ljung, System Identification, 2nd ed. 1999, section 10.3). All
//! filters begin from rest at the first sample of a segment: what that leaves out dies away, and tests need psi to
//! first order only.

use std::borrow::Cow;
use std::fmt::Debug;

use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::regression::{add_filtered, divide};

use super::Innovations;
use crate::data::Record;
use crate::model::{PolynomialModel, polynomial::is_stable};

/// `sign * s(t - lag)` for `count` lags from the first on.
#[derive(Debug, Clone)]
pub(crate) struct Regressor<'a> {
    pub(crate) signal: RegressorSignal<'a>,
    pub(crate) first: usize,
    pub(crate) count: usize,
    pub(crate) sign: f64,
}

/// What is lagged.
#[derive(Debug, Clone)]
pub(crate) enum RegressorSignal<'a> {
    /// An input of the record.
    Input(usize),
    /// Another signal, as long as the record.
    Own(Cow<'a, [f64]>),
}

/// A model that knows psi.
pub(crate) trait Regressors: Debug + Sync {
    /// How many parameters it has.
    fn parameters(&self) -> usize;

    /// Their covariance; none where it is not known.
    fn covariance(&self) -> Option<&[Vec<f64>]>;

    /// psi over a record, in the order of the parameters. `noise_free`: with (B/A) u in the place of y, as instruments
    /// have it; for models without C, D and F.
    fn regressors<'a>(
        &self,
        record: &Record<'a>,
        innovations: &[Innovations],
        noise_free: bool,
    ) -> Vec<Regressor<'a>>;

    /// X_k = E psi(t) e(t - k)/var e, a row for each lag 1 … L and a column for each parameter: past e is in psi by
    /// -1/A for a, 1/C for c and -1/D for d, each delayed by the coefficient's number, and not at all for B and F. Zero
    /// for an unstable A or D, which has no such response.
    fn past_errors(&self, lags: usize) -> DMatrix<f64>;
}

impl Regressors for PolynomialModel {
    fn parameters(&self) -> usize {
        self.orders.parameters()
    }

    fn covariance(&self) -> Option<&[Vec<f64>]> {
        self.covariance.as_deref()
    }

    fn regressors<'a>(
        &self,
        record: &Record<'a>,
        innovations: &[Innovations],
        noise_free: bool,
    ) -> Vec<Regressor<'a>> {
        let orders = &self.orders;
        let linear = orders.is_linear();
        let over = |of: &dyn Fn(&Innovations) -> Vec<f64>| {
            let mut signal = vec![0.0; record.output.len()];
            innovations.iter().for_each(|found| signal[found.rows.clone()].copy_from_slice(&of(found)));
            RegressorSignal::Own(Cow::Owned(signal))
        };
        // (D/(C F)) of a signal, from rest.
        let filtered = |signal: &[f64], denominator: &[f64]| {
            let mut values = product(&self.d, signal);
            divide(&self.c, &mut values);
            divide(denominator, &mut values);
            values
        };
        let driven = |found: &Innovations, input: usize| {
            let mut x = product(&self.b[input], &record.inputs[input][found.rows.clone()]);
            divide(&self.f[input], &mut x);
            x
        };
        let undriven = |found: &Innovations| {
            let mut sum = vec![0.0; found.rows.len()];
            for input in 0..orders.inputs() {
                sum.iter_mut().zip(driven(found, input)).for_each(|(sum, x)| *sum += x);
            }
            divide(&self.a, &mut sum);
            sum
        };
        let noise = |values: &[f64]| {
            let mut values = values.to_vec();
            divide(&self.c, &mut values);
            values
        };

        let mut psi = Vec::new();
        let mut add = |signal: RegressorSignal<'a>, first: usize, count: usize, sign: f64| {
            psi.push(Regressor { signal, first, count, sign });
        };
        if orders.na > 0 {
            let output = if !linear {
                over(&|found| filtered(&record.output[found.rows.clone()], &[1.0]))
            } else if noise_free {
                over(&undriven)
            } else {
                RegressorSignal::Own(Cow::Borrowed(record.output))
            };
            add(output, 1, orders.na, -1.0);
        }
        for input in (0..orders.inputs()).filter(|&input| orders.nb[input] > 0) {
            let signal = if linear {
                RegressorSignal::Input(input)
            } else {
                over(&|found| filtered(&record.inputs[input][found.rows.clone()], &self.f[input]))
            };
            add(signal, orders.nk[input], orders.nb[input], 1.0);
        }
        if orders.nc > 0 {
            add(over(&|found| noise(&found.errors)), 1, orders.nc, 1.0);
        }
        if orders.nd > 0 {
            add(over(&|found| noise(&found.disturbance)), 1, orders.nd, -1.0);
        }
        for input in (0..orders.inputs()).filter(|&input| orders.nf[input] > 0) {
            let of = |found: &Innovations| filtered(&driven(found, input), &self.f[input]);
            add(over(&of), 1, orders.nf[input], -1.0);
        }
        psi
    }

    fn past_errors(&self, lags: usize) -> DMatrix<f64> {
        let orders = &self.orders;
        let response = |monic: &[f64]| {
            let mut response = vec![0.0; lags];
            if is_stable(monic, &mut Vec::new()) {
                response.iter_mut().take(1).for_each(|first| *first = 1.0);
                divide(monic, &mut response);
            }
            response
        };
        let inputs: usize = orders.nb.iter().sum();
        let mut matrix = DMatrix::zeros(lags, orders.parameters());
        let (c, d) = (orders.na + inputs, orders.na + inputs + orders.nc);
        for (first, count, sign, monic) in
            [(0, orders.na, -1.0, &self.a), (c, orders.nc, 1.0, &self.c), (d, orders.nd, -1.0, &self.d)]
        {
            let response = response(monic);
            for delay in 0..count {
                // q^-1 for the first coefficient: from lag 1 on, which is row 0.
                for (row, value) in (delay..lags).zip(&response) {
                    matrix[(row, first + delay)] = sign * value;
                }
            }
        }
        matrix
    }
}

/// P of a signal, from rest.
fn product(polynomial: &[f64], signal: &[f64]) -> Vec<f64> {
    let mut values = vec![0.0; signal.len()];
    add_filtered(&mut values, &(0..signal.len()), polynomial, signal, 0);
    values
}
