//! The exact step of linear equations in continuous time, whatever its length.
//!
//! For dx/dt = A x + b + w with white noise w of the intensities q, diagonal, over a step of h seconds in which b goes
//! in a straight line from b(0) to b(h):
//!
//! ```text
//! x(h) = x + Psi f(x, 0) + X (b(h) - b(0))/h + noise of the covariance Q,   f(x, 0) = A x + b(0)
//! Phi = e^(A h),   Psi = ∫ e^(A s) ds,   X = ∫ Psi(s) ds,   Q = ∫ e^(A s) diag(q) e^(A' s) ds        from 0 to h
//! ```
//!
//! by their series over a part h/2^k of the step in which A h/2^k is small, and then k doublings:
//!
//! ```text
//! X(2h) = X + h Psi + Phi X,   Psi(2h) = Psi + Phi Psi,   Q(2h) = Q + Phi Q Phi',   Phi(2h) = Phi Phi
//! ```
//!
//! Sources: Van Loan, Computing integrals involving the matrix exponential, IEEE Transactions on Automatic Control 23,
//! 1978; Moler and Van Loan, Nineteen dubious ways to compute the exponential of a matrix, twenty-five years later,
//! SIAM Review 45, 2003, method 3.

use thetahat_core::Number;

/// Terms of the series: with A h of at most 1/2 in norm the next one of Q, the slowest, is below 1e-17 of the first.
const TERMS: usize = 19;
/// The most doublings: beyond 2^60 times what the series reaches nothing is left but stationary values.
const DOUBLINGS: i32 = 60;

/// A step of one length. Matrices are n x n, column after column.
#[derive(Debug, Clone)]
pub(super) struct ExactStep<S> {
    pub(super) transition: Vec<S>,
    pub(super) integral: Vec<S>,
    pub(super) second_integral: Vec<S>,
    /// Q = U diag(d) U': U, unit upper triangular, and d.
    pub(super) noise_factor: Vec<S>,
    pub(super) noise_variances: Vec<S>,
}

impl<S: Number<f64>> ExactStep<S> {
    /// From A, the intensities q and h. About (15 + 6 k) n^3 multiply-adds.
    pub(super) fn new(a: &[S], intensities: &[S], h: f64) -> Self {
        let n = intensities.len();
        let (zero, one) = (S::from(0.0), S::from(1.0));
        let norm = (0..n)
            .map(|row| (0..n).map(|column| a[column * n + row].value().abs()).sum::<f64>() * h)
            .fold(0.0, f64::max);
        let doublings = if norm > 0.5 { ((2.0 * norm).log2().ceil() as i32).min(DOUBLINGS) } else { 0 };
        let mut h = h / 2.0_f64.powi(doublings);

        let mut power = vec![zero; n * n];
        power.iter_mut().step_by(n + 1).for_each(|own| *own = one);
        let (mut transition, mut integral, mut second) =
            (power.clone(), scaled(&power, h), scaled(&power, h * h / 2.0));
        // q, A q + q A' … and the weights h^(k+1)/(k+1)!.
        let mut term = vec![zero; n * n];
        term.iter_mut().step_by(n + 1).zip(intensities).for_each(|(own, &q)| *own = q);
        let mut noise = scaled(&term, h);
        // (A h)^k, and 1/k!.
        let mut weight = 1.0;
        for k in 1..TERMS {
            let order = k as f64;
            weight /= order;
            power = scaled(&product(a, &power, n), h);
            add(&mut transition, &power, weight);
            add(&mut integral, &power, weight * h / (order + 1.0));
            add(&mut second, &power, weight * h * h / ((order + 1.0) * (order + 2.0)));
            let half = product(a, &term, n);
            for column in 0..n {
                for row in 0..n {
                    term[column * n + row] = (half[column * n + row] + half[row * n + column]) * h;
                }
            }
            add(&mut noise, &term, weight * h / (order + 1.0));
        }
        for _ in 0..doublings {
            let moved = product(&transition, &second, n);
            add(&mut second, &moved, 1.0);
            add(&mut second, &integral, h);
            let moved = product(&transition, &integral, n);
            add(&mut integral, &moved, 1.0);
            let moved = product(&transition, &noise, n);
            for column in 0..n {
                for row in 0..n {
                    let sum =
                        (0..n).fold(zero, |sum, k| sum + moved[k * n + row] * transition[k * n + column]);
                    noise[column * n + row] += sum;
                }
            }
            transition = product(&transition, &transition, n);
            h *= 2.0;
        }
        let (noise_factor, noise_variances) = factored(noise, n);
        Self { transition, integral, second_integral: second, noise_factor, noise_variances }
    }
}

/// U and d of a positive semidefinite U diag(d) U' (Bierman, Factorization Methods for Discrete Sequential Estimation,
/// 1977, section III.4). What is left of a variance is rounding below some 1e-15 of it: then it is 0.
fn factored<S: Number<f64>>(mut matrix: Vec<S>, n: usize) -> (Vec<S>, Vec<S>) {
    let (zero, mut variances) = (S::from(0.0), vec![S::from(0.0); n]);
    let sizes: Vec<f64> = matrix.iter().step_by(n + 1).map(|own| own.value()).collect();
    let mut factor = vec![zero; n * n];
    for column in (0..n).rev() {
        factor[column * n + column] = 1.0.into();
        let pivot = matrix[column * n + column];
        let is_more_than_rounding = pivot.value() > 4.0 * f64::EPSILON * n as f64 * sizes[column];
        if !is_more_than_rounding {
            continue;
        }
        variances[column] = pivot;
        for row in 0..column {
            factor[column * n + row] = matrix[column * n + row] / pivot;
        }
        for other in 0..column {
            for row in 0..=other {
                let taken = factor[column * n + row] * pivot * factor[column * n + other];
                matrix[other * n + row] -= taken;
            }
        }
    }
    (factor, variances)
}

fn scaled<S: Number<f64>>(matrix: &[S], factor: f64) -> Vec<S> {
    matrix.iter().map(|&entry| entry * factor).collect()
}

fn add<S: Number<f64>>(sum: &mut [S], more: &[S], factor: f64) {
    sum.iter_mut().zip(more).for_each(|(sum, &more)| *sum += more * factor);
}

fn product<S: Number<f64>>(left: &[S], right: &[S], n: usize) -> Vec<S> {
    let mut product = vec![S::from(0.0); n * n];
    for column in 0..n {
        for k in 0..n {
            let weight = right[column * n + k];
            for row in 0..n {
                product[column * n + row] += left[k * n + row] * weight;
            }
        }
    }
    product
}

#[cfg(test)]
mod tests;
