//! Linear systems at a complex frequency, in numbers that may have derivatives.

use thetahat_core::Number;

/// A complex number of such numbers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Complex<S> {
    pub(crate) re: S,
    pub(crate) im: S,
}

impl<S: Number<f64>> Complex<S> {
    pub(crate) fn new(re: f64, im: f64) -> Self {
        Self { re: re.into(), im: im.into() }
    }

    /// e^(j angle).
    pub(crate) fn turned(angle: S) -> Self {
        Self { re: angle.cos(), im: angle.sin() }
    }

    pub(crate) fn real(re: S) -> Self {
        Self { re, im: 0.0.into() }
    }

    pub(crate) fn plus(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }

    pub(crate) fn minus(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }

    pub(crate) fn times(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }

    pub(crate) fn over(self, other: Self) -> Self {
        let square = other.re * other.re + other.im * other.im;
        let product = self.times(Self { re: other.re, im: -other.im });
        Self { re: product.re / square, im: product.im / square }
    }

    fn size(self) -> f64 {
        self.re.value().hypot(self.im.value())
    }
}

/// x of (point I - A) x = b for A of n rows, by elimination with the largest pivot: O(n^3).
pub(crate) fn resolved<S: Number<f64>>(
    n: usize,
    point: Complex<S>,
    a: impl Fn(usize, usize) -> S,
    b: impl Fn(usize) -> S,
) -> Vec<Complex<S>> {
    let mut matrix: Vec<Vec<Complex<S>>> = (0..n)
        .map(|i| {
            let entry = |j: usize| {
                let point = if i == j { point } else { Complex::new(0.0, 0.0) };
                point.minus(Complex::real(a(i, j)))
            };
            (0..n).map(entry).chain([Complex::real(b(i))]).collect()
        })
        .collect();
    for step in 0..n {
        let pivot = (step..n).max_by(|&i, &j| matrix[i][step].size().total_cmp(&matrix[j][step].size()));
        matrix.swap(step, pivot.unwrap_or(step));
        let (above, below) = matrix.split_at_mut(step + 1);
        let own = &above[step];
        for row in below {
            let factor = row[step].over(own[step]);
            for (entry, own) in row.iter_mut().zip(own).skip(step) {
                *entry = entry.minus(factor.times(*own));
            }
        }
    }
    let mut found = vec![Complex::new(0.0, 0.0); n];
    for i in (0..n).rev() {
        let mut value = matrix[i][n];
        for j in i + 1..n {
            value = value.minus(matrix[i][j].times(found[j]));
        }
        found[i] = value.over(matrix[i][i]);
    }
    found
}
