//! Figures with what each row of the response does to them.

use thetahat_core::nalgebra::{Matrix3, Vector3};

/// A figure, and its derivatives by the rows of the response: what its spread follows from, and that of sums and
/// differences of figures, which share rows.
#[derive(Debug, Clone)]
pub(super) struct Influence {
    pub(super) value: f64,
    /// One for each row of the response.
    pub(super) weights: Vec<f64>,
}

impl Influence {
    /// A number that is known.
    pub(super) fn known(value: f64, rows: usize) -> Self {
        Self { value, weights: vec![0.0; rows] }
    }

    /// a x + b y.
    pub(super) fn combined(a: f64, x: &Self, b: f64, y: &Self) -> Self {
        let weights = x.weights.iter().zip(&y.weights).map(|(x, y)| a * x + b * y).collect();
        Self { value: a * x.value + b * y.value, weights }
    }

    /// A function of it: its value, and its slope there.
    pub(super) fn mapped(&self, value: f64, slope: f64) -> Self {
        Self { value, weights: self.weights.iter().map(|weight| slope * weight).collect() }
    }
}

/// The parabola a + b x + c x^2 of least squares through some rows, with x = (t - centre)/half; c = 0 for a straight
/// line.
#[derive(Debug)]
pub(super) struct Local {
    pub(super) coefficients: [f64; 3],
    /// The first of the rows, and the derivatives of each coefficient by them.
    first: usize,
    weights: Vec<[f64; 3]>,
    rows: usize,
}

impl Local {
    /// Through the rows with times in centre - half … centre + half: a straight line through two to four rows, else a
    /// parabola. None for fewer rows.
    pub(super) fn fit(time: &[f64], values: &[f64], centre: f64, half: f64) -> Option<Self> {
        let first = time.partition_point(|t| *t < centre - half);
        let end = time.partition_point(|t| *t <= centre + half);
        let count = end.checked_sub(first).filter(|count| *count >= 2)?;
        let row = |t: f64| {
            let x = (t - centre) / half;
            Vector3::new(1.0, x, if count > 4 { x * x } else { 0.0 })
        };
        let mut gram = Matrix3::zeros();
        for t in &time[first..end] {
            let x = row(*t);
            gram += x * x.transpose();
        }
        if count <= 4 {
            gram[(2, 2)] = 1.0;
        }
        let inverse = gram.try_inverse()?;
        let weights: Vec<[f64; 3]> = time[first..end].iter().map(|t| (inverse * row(*t)).into()).collect();
        let mut coefficients = [0.0; 3];
        for (weights, value) in weights.iter().zip(&values[first..end]) {
            coefficients.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += weight * value);
        }
        coefficients.iter().all(|value| value.is_finite()).then_some(Self {
            coefficients,
            first,
            weights,
            rows: time.len(),
        })
    }

    /// A figure whose derivatives by the coefficients are these.
    pub(super) fn figure(&self, value: f64, slopes: [f64; 3]) -> Influence {
        let mut weights = vec![0.0; self.rows];
        for (weight, own) in weights[self.first..].iter_mut().zip(&self.weights) {
            *weight = own.iter().zip(slopes).map(|(own, slope)| own * slope).sum();
        }
        Influence { value, weights }
    }
}
