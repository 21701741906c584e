//! Impulse responses by regularised least squares.
//!
//! y = Phi g + e, y(t) = sum_j sum_i g_ji u_j(t - nk_j - i) + e(t): least squares alone makes the g of many taps as
//! noisy as the data. A prior of smooth, decaying responses, g_j ~ N(0, sigma^2 P_j), with the kernels
//!
//! ```text
//! DC (diagonal and correlated):  P_ik = c lambda^((i+k)/2) rho^|i-k|,     TC (tuned and correlated):  rho = sqrt(lambda)
//! ```
//!
//! (Chen, Ohlsson and Ljung, Automatica 48, 2012) gives the estimate and its covariance
//!
//! ```text
//! g = (G + P^-1)^-1 d,   cov g = sigma^2 (G + P^-1)^-1,   G = Phi' Phi, d = Phi' y,
//! ```
//!
//! and c, lambda and rho of each input are those of the largest marginal likelihood, sigma^2 = rss/N being taken out:
//!
//! ```text
//! -2 ln L = N ln(rss/N) + ln det(I + P G),   rss = y'y - d' g
//! ```
//!
//! With D = diag(sqrt(c) lambda^(i/2)) and the correlations K_ik = rho^|i-k|, P = D K D. K is that of an autoregression
//! of order 1, so that its inverse T is tridiagonal and det K = (1 - rho^2)^(n-1); then
//!
//! ```text
//! ln det(I + P G) = (n - 1) ln(1 - rho^2) + ln det(T + D G D),   g = D h,   h = (T + D G D)^-1 D d
//! ```
//!
//! is computed from numbers of one size, whatever the decay (Chen and Ljung, Automatica 49, 2013). With S = (T + D G
//! D)^-1 and W_ik = S_ik + (N/rss) h_i h_k the slopes are sums over the tridiagonal:
//!
//! ```text
//! d/d ln c      = n - sum T_ik W_ik,
//! d/d ln lambda = sum i - sum (i+k)/2 T_ik W_ik,
//! d/d rho       = sum dT_ik/drho W_ik - 2 (n - 1) rho/(1 - rho^2)
//! ```
//!
//! G comes from lagged products (see `regression`), so that N samples are read once; an evaluation is one Cholesky
//! factor and its inverse.

#[cfg(test)]
mod tests;

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt;
use faer::{Mat, Par, Spec};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::optimize::least;
use thetahat_numerics::regression::{Lagged, gram};

use super::arx::{enough, linear, out_of_range, resolved, signals, taps, with_past};
use super::{Estimate, Initial, Procedure};
use crate::Error;
use crate::data::Record;
use crate::model::Orders;

/// The search for the largest likelihood ends where -2 ln L would fall by less than this.
const TOLERANCE: f64 = 1e-7;
const ITERATIONS: usize = 200;
/// Where it begins: the best of these decays, correlations, and ratios of the response's power to that of the noise.
const DECAYS: [f64; 4] = [0.7, 0.9, 0.97, 0.99];
const CORRELATIONS: [f64; 2] = [0.6, 0.97];
const POWERS: [f64; 3] = [0.1, 1.0, 10.0];

/// What is known of an impulse response before the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Kernel {
    /// Diagonal and correlated: decay and smoothness each have a number of their own.
    Dc,
    /// Tuned and correlated: one number for both, rho = sqrt(lambda).
    Tc,
}

impl Kernel {
    /// DC or TC.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dc => "DC",
            Self::Tc => "TC",
        }
    }
}

/// The estimated parameters of the kernel of an input.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct KernelParameters {
    /// c, in units of the noise variance.
    pub scale: f64,
    /// lambda, the decay of the variance from tap to tap.
    pub decay: f64,
    /// rho, the correlation of a tap with the next one.
    pub correlation: f64,
}

/// How a regularised impulse response was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RegularisedOutcome {
    /// The kernel.
    pub kernel: Kernel,
    /// Its parameters for each input.
    pub inputs: Vec<KernelParameters>,
    /// N ln(rss/N) + ln det(I + P G), which is -2 ln L but for N (1 + ln 2 pi).
    pub minus_two_log_likelihood: f64,
    /// The parameters that the data determine: the trace of (G + P^-1)^-1 G.
    pub effective_parameters: f64,
}

/// The impulse responses of all inputs. The last inputs may have none of the kernel: a constant and a trend.
pub(super) fn impulse_response(
    record: &Record<'_>,
    inputs: usize,
    orders: &Orders,
    initial: Initial,
    kernel: Kernel,
) -> Result<Estimate, Error> {
    linear(orders)?;
    if orders.na > 0 {
        return Err(Error::argument("na", "an impulse response reads inputs alone; leave A out"));
    }
    let signals = signals(record, orders)?;
    let (initial, presample) = resolved(initial)?;
    let segments = with_past(record, orders, presample);
    let lagged = Lagged::new(&signals, taps(orders), &segments, presample);
    enough(lagged.rows(), orders)?;
    of_products(gram(&lagged), lagged.rows(), inputs, orders, initial, kernel)
}

/// The same from Phi' Phi, Phi' y and y' y of so many samples.
pub(super) fn of_products(
    (gram, cross, energy): (DMatrix<f64>, DVector<f64>, f64),
    samples: usize,
    inputs: usize,
    orders: &Orders,
    initial: Initial,
    kernel: Kernel,
) -> Result<Estimate, Error> {
    if !(energy.is_normal() && gram.iter().chain(cross.iter()).all(|value| value.is_finite())) {
        return Err(out_of_range());
    }
    if let Some(input) = (0..inputs).find(|input| {
        let place = orders.nb[..*input].iter().sum::<usize>();
        orders.nb[*input] > 0 && gram[(place, place)] <= 0.0
    }) {
        let name = orders.names().get(orders.nb[..input].iter().sum::<usize>()).cloned();
        return Err(Error::undetermined(
            name.into_iter().collect(),
            format!(
                "input {} is zero in all rows: it has no response; leave it out, or name other rows",
                input + 1
            ),
        ));
    }
    let gram = Mat::from_fn(cross.len(), cross.len(), |i, j| gram[(i, j)]);
    let mut evidence = Evidence::new(gram, cross.as_slice(), energy, samples, &orders.nb[..inputs], kernel);
    let start = evidence.start();
    let (found, value) =
        least(&start, TOLERANCE, ITERATIONS, |x, slopes| evidence.value(x, Some(slopes)).unwrap_or(f64::NAN));
    if evidence.value(&found, None).is_none() {
        return Err(Error::undetermined(
            orders.names(),
            "the data do not determine the response, whatever the kernel: an input repeats another, or the signals differ too much in \
             size; leave one out, or scale the channels towards one",
        ));
    }
    let parameters = evidence.response();
    let own = evidence.inverse();
    let effective = evidence.effective_parameters(&own);
    let sum_of_squares = evidence.sum_of_squares(&parameters);
    let noise_variance = sum_of_squares / (samples as f64 - effective).max(1.0);
    if sum_of_squares != 0.0 && !noise_variance.is_normal() {
        return Err(out_of_range());
    }
    let covariance =
        (0..own.nrows()).map(|i| (0..own.ncols()).map(|j| noise_variance * own[(i, j)]).collect()).collect();
    Ok(Estimate {
        parameters,
        covariance: Some(covariance),
        noise_variance,
        samples,
        mse: sum_of_squares / samples as f64,
        condition: None,
        initial,
        procedure: Procedure::Regularised(RegularisedOutcome {
            kernel,
            inputs: evidence.kernels(&found),
            minus_two_log_likelihood: value,
            effective_parameters: effective,
        }),
    })
}

/// The marginal likelihood, and all that an evaluation works in: nothing of it allocates.
struct Evidence<'d> {
    gram: Mat<f64>,
    cross: &'d [f64],
    energy: f64,
    samples: usize,
    /// For each input with taps where its own stand.
    blocks: Vec<std::ops::Range<usize>>,
    kernel: Kernel,
    /// D, and the diagonal of T and what stands beside it: 0 where there is no kernel.
    scales: Vec<f64>,
    diagonal: Vec<f64>,
    beside: Vec<f64>,
    /// h, the Cholesky factor, and S.
    solution: Mat<f64>,
    factor: Mat<f64>,
    inverse: Mat<f64>,
    buffer: MemBuffer,
}

impl<'d> Evidence<'d> {
    fn new(
        gram: Mat<f64>,
        cross: &'d [f64],
        energy: f64,
        samples: usize,
        taps: &[usize],
        kernel: Kernel,
    ) -> Self {
        let size = cross.len();
        let blocks = taps.iter().scan(0, |end, taps| {
            *end += taps;
            Some(*end - taps..*end)
        });
        let scales = (0..size).map(|i| gram[(i, i)].sqrt().recip()).collect();
        let request = StackReq::any_of(&[
            llt::factor::cholesky_in_place_scratch::<f64>(size, Par::Seq, Spec::default()),
            llt::inverse::inverse_scratch::<f64>(size, Par::Seq),
        ]);
        Self {
            blocks: blocks.filter(|block| !block.is_empty()).collect(),
            gram,
            cross,
            energy,
            samples,
            kernel,
            scales,
            diagonal: vec![0.0; size],
            beside: vec![0.0; size],
            solution: Mat::zeros(size, 1),
            factor: Mat::zeros(size, size),
            inverse: Mat::zeros(size, size),
            buffer: MemBuffer::new(request),
        }
    }

    /// The variables of an input: ln c, ln(lambda/(1 - lambda)) and of DC artanh rho.
    fn variables(&self) -> usize {
        match self.kernel {
            Kernel::Dc => 3,
            Kernel::Tc => 2,
        }
    }

    fn kernel_at(&self, x: &[f64]) -> KernelParameters {
        let decay = 1.0 / (1.0 + (-x[1]).exp());
        let correlation = x.get(2).map_or(decay.sqrt(), |x| x.tanh());
        KernelParameters { scale: x[0].exp(), decay, correlation }
    }

    fn kernels(&self, x: &[f64]) -> Vec<KernelParameters> {
        x.chunks_exact(self.variables()).map(|x| self.kernel_at(x)).collect()
    }

    /// -2 ln L but for a constant, and its slopes; none where it cannot be computed.
    fn value(&mut self, x: &[f64], slopes: Option<&mut [f64]>) -> Option<f64> {
        let mut value = 0.0;
        for (block, x) in self.blocks.iter().zip(x.chunks_exact(self.variables())) {
            let KernelParameters { decay, correlation: rho, .. } = self.kernel_at(x);
            let (half, count) = (decay.ln() / 2.0, block.len());
            let alone = 1.0 / (1.0 - rho * rho);
            for (i, place) in block.clone().enumerate() {
                self.scales[place] = (x[0] / 2.0 + half * i as f64).exp();
                let inner = i > 0 && i + 1 < count;
                self.diagonal[place] = match count {
                    1 => 1.0,
                    _ if inner => (1.0 + rho * rho) * alone,
                    _ => alone,
                };
                self.beside[place] = if i + 1 < count { -rho * alone } else { 0.0 };
            }
            value += (count - 1) as f64 * (1.0 - rho * rho).ln();
        }
        let size = self.cross.len();
        for j in 0..size {
            for i in j..size {
                self.factor[(i, j)] = self.scales[i] * self.gram[(i, j)] * self.scales[j];
            }
            self.factor[(j, j)] += self.diagonal[j];
            if j + 1 < size {
                self.factor[(j + 1, j)] += self.beside[j];
            }
        }
        let stack = MemStack::new(&mut self.buffer);
        llt::factor::cholesky_in_place(
            self.factor.as_mut(),
            llt::factor::LltRegularization::default(),
            Par::Seq,
            stack,
            Spec::default(),
        )
        .ok()?;
        for (i, (scale, cross)) in self.scales.iter().zip(self.cross).enumerate() {
            self.solution[(i, 0)] = scale * cross;
            value += 2.0 * self.factor[(i, i)].ln();
        }
        llt::solve::solve_in_place(
            self.factor.as_ref(),
            self.solution.as_mut(),
            Par::Seq,
            MemStack::new(&mut self.buffer),
        );
        let explained: f64 = (0..size).map(|i| self.solution[(i, 0)] * self.scales[i] * self.cross[i]).sum();
        // What rounding leaves of an exact fit.
        let rss = (self.energy - explained).max(f64::EPSILON * self.energy);
        value += self.samples as f64 * (rss / self.samples as f64).ln();
        if let Some(slopes) = slopes {
            let stack = MemStack::new(&mut self.buffer);
            llt::inverse::inverse(self.inverse.as_mut(), self.factor.as_ref(), Par::Seq, stack);
            self.slopes(x, self.samples as f64 / rss, slopes);
        }
        value.is_finite().then_some(value)
    }

    fn slopes(&self, x: &[f64], weight: f64, slopes: &mut [f64]) {
        // Only the lower triangle of S is computed.
        let w = |i: usize, j: usize| {
            self.inverse[(i.max(j), i.min(j))] + weight * self.solution[(i, 0)] * self.solution[(j, 0)]
        };
        let count = self.variables();
        for ((block, x), slopes) in
            self.blocks.iter().zip(x.chunks_exact(count)).zip(slopes.chunks_exact_mut(count))
        {
            let KernelParameters { decay, correlation: rho, .. } = self.kernel_at(x);
            let taps = block.len();
            let alone = 1.0 / (1.0 - rho * rho);
            let steeper = 2.0 * rho * alone * alone;
            let (mut by_scale, mut by_decay, mut by_correlation) = (0.0, 0.0, 0.0);
            for (i, place) in block.clone().enumerate() {
                let own = w(place, place);
                by_scale += self.diagonal[place] * own;
                by_decay += i as f64 * self.diagonal[place] * own;
                let inner = i > 0 && i + 1 < taps;
                by_correlation += own
                    * match taps {
                        1 => 0.0,
                        _ if inner => 2.0 * rho * alone + (1.0 + rho * rho) * steeper,
                        _ => steeper,
                    };
                if i + 1 < taps {
                    let next = w(place, place + 1);
                    by_scale += 2.0 * self.beside[place] * next;
                    by_decay += (2 * i + 1) as f64 * self.beside[place] * next;
                    by_correlation -= 2.0 * (alone + rho * steeper) * next;
                }
            }
            let all = (taps * (taps - 1) / 2) as f64;
            let (by_scale, by_decay) = (taps as f64 - by_scale, all - by_decay);
            let by_correlation = by_correlation - 2.0 * (taps - 1) as f64 * rho * alone;
            slopes[0] = by_scale;
            // d ln lambda/dx = 1 - lambda, d rho/d ln lambda = rho/2 for TC, d rho/dx = 1 - rho^2.
            match self.kernel {
                Kernel::Dc => {
                    slopes[1] = by_decay * (1.0 - decay);
                    slopes[2] = by_correlation * (1.0 - rho * rho);
                }
                Kernel::Tc => slopes[1] = (by_decay + by_correlation * rho / 2.0) * (1.0 - decay),
            }
        }
    }

    /// The best of a few kernels, the same for all inputs but for their size.
    fn start(&mut self) -> Vec<f64> {
        let (mut best, mut least) = (Vec::new(), f64::INFINITY);
        let correlations: &[f64] = if self.kernel == Kernel::Dc { &CORRELATIONS } else { &[0.0] };
        for decay in DECAYS {
            for correlation in correlations {
                for power in POWERS {
                    let mut x = Vec::new();
                    for block in &self.blocks {
                        // c sum lambda^i var u = power: what the input explains, in units of the noise.
                        let gain = (1.0 - decay.powi(block.len() as i32)) / (1.0 - decay);
                        let size = self.gram[(block.start, block.start)] / self.samples as f64;
                        x.push((power / (gain * size)).ln());
                        x.push((decay / (1.0 - decay)).ln());
                        if self.kernel == Kernel::Dc {
                            x.push(correlation.atanh());
                        }
                    }
                    let value = self.value(&x, None).unwrap_or(f64::INFINITY);
                    if value < least || best.is_empty() {
                        (best, least) = (x, value);
                    }
                }
            }
        }
        best
    }

    /// g.
    fn response(&self) -> Vec<f64> {
        self.scales.iter().enumerate().map(|(i, scale)| scale * self.solution[(i, 0)]).collect()
    }

    /// |y - Phi g|^2, from what rounding leaves of an exact fit on.
    fn sum_of_squares(&self, response: &[f64]) -> f64 {
        let size = response.len();
        let of_fit = |i: usize| (0..size).map(|j| self.gram[(i, j)] * response[j]).sum::<f64>();
        let each = (0..size).map(|i| response[i] * (of_fit(i) - 2.0 * self.cross[i]));
        (self.energy + each.sum::<f64>()).max(f64::EPSILON * self.energy)
    }

    /// (G + P^-1)^-1.
    fn inverse(&mut self) -> Mat<f64> {
        let stack = MemStack::new(&mut self.buffer);
        llt::inverse::inverse(self.inverse.as_mut(), self.factor.as_ref(), Par::Seq, stack);
        let size = self.scales.len();
        Mat::from_fn(size, size, |i, j| self.scales[i] * self.inverse[(i.max(j), i.min(j))] * self.scales[j])
    }

    fn effective_parameters(&self, inverse: &Mat<f64>) -> f64 {
        let size = self.scales.len();
        let row = |i: usize| (0..size).map(|j| inverse[(i, j)] * self.gram[(j, i)]).sum::<f64>();
        (0..size).map(row).sum()
    }
}
