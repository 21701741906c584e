//! What products are summed in: numbers, or numbers of twice the precision.

use faer::fx128;

use super::kernel::{correlations, extended_product};

/// A sum of products.
pub trait Total: Copy + Send + Sync {
    const ZERO: Self;

    /// x y.
    fn product(x: f64, y: f64) -> Self;

    fn add(&mut self, other: Self);

    /// `into[k] += sum_t x[t] y[t + k]`; `y` holds as many values as `x` and `into` together, less one.
    fn add_correlations(x: &[f64], y: &[f64], into: &mut [Self]);
}

impl Total for f64 {
    const ZERO: Self = 0.0;

    fn product(x: f64, y: f64) -> Self {
        x * y
    }

    fn add(&mut self, other: Self) {
        *self += other;
    }

    fn add_correlations(x: &[f64], y: &[f64], into: &mut [Self]) {
        correlations(x, y, into);
    }
}

/// Products are exact; the error of a sum of n of them was at most 1e-31 sqrt(n) times that of their sizes.
impl Total for fx128 {
    const ZERO: Self = fx128::ZERO;

    fn product(x: f64, y: f64) -> Self {
        // Exact: a product of two numbers has 106 bits at most.
        fx128::from_f64(x) * fx128::from_f64(y)
    }

    fn add(&mut self, other: Self) {
        // Its `+` is exact for numbers of one sign only.
        *self = self.add_accurate(other);
    }

    fn add_correlations(x: &[f64], y: &[f64], into: &mut [Self]) {
        for (k, into) in into.iter_mut().enumerate() {
            into.add(extended_product(x, &y[k..k + x.len()]));
        }
    }
}
