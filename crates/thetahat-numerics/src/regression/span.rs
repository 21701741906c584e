//! Few long columns and what they leave of others.

use thetahat_core::nalgebra::DMatrix;

use super::kernel::{product, sum_of_squares};

/// What is left of a column below this fraction of it is rounding: it depends on those before it.
const DEPENDENT: f64 = 1e-10;

/// An orthonormal basis of columns, each taken out of what comes after it twice (Gram and Schmidt; Björck, Numerical
/// Methods for Least Squares Problems, 1996, section 2.4.5). A column that depends on those before it is left out.
#[derive(Debug, Clone, Default)]
pub struct Span {
    basis: Vec<Vec<f64>>,
    /// For each column what it has of the basis; none for one that was left out.
    columns: Vec<Option<Vec<f64>>>,
}

impl Span {
    /// Adds a column. Says whether it did not depend on those before it.
    pub fn add(&mut self, mut column: Vec<f64>) -> bool {
        let size = sum_of_squares(&column).sqrt();
        let mut has = self.take_from(&mut column);
        let left = sum_of_squares(&column).sqrt();
        if !(left > DEPENDENT * size && left.is_normal()) {
            self.columns.push(None);
            return false;
        }
        column.iter_mut().for_each(|value| *value /= left);
        has.push(left);
        self.basis.push(column);
        self.columns.push(Some(has));
        true
    }

    /// Leaves of values what is orthogonal to all columns; gives what they had of the basis.
    pub fn take_from(&self, values: &mut [f64]) -> Vec<f64> {
        let mut has = vec![0.0; self.basis.len()];
        for _ in 0..2 {
            for (own, has) in self.basis.iter().zip(&mut has) {
                let weight = product(own, values);
                values.iter_mut().zip(own).for_each(|(value, own)| *value -= weight * own);
                *has += weight;
            }
        }
        has
    }

    /// The weights of the columns that make up so much of the basis; 0 for those that were left out.
    pub fn weights(&self, has: &[f64]) -> Vec<f64> {
        let mut rest = has.to_vec();
        let mut weights = vec![0.0; self.columns.len()];
        for (column, weight) in self.columns.iter().zip(&mut weights).rev() {
            let Some((last, before)) = column.as_deref().and_then(<[f64]>::split_last) else { continue };
            *weight = rest.get(before.len()).copied().unwrap_or(0.0) / last;
            rest.iter_mut().zip(before).for_each(|(rest, own)| *rest -= *weight * own);
        }
        weights
    }

    /// R of columns Q R, of those that were not left out.
    pub fn triangle(&self) -> DMatrix<f64> {
        let size = self.basis.len();
        let mut triangle = DMatrix::zeros(size, size);
        for (position, column) in self.columns.iter().flatten().enumerate() {
            column.iter().enumerate().for_each(|(row, value)| triangle[(row, position)] = *value);
        }
        triangle
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Noise;

    #[test]
    fn weights_are_those_of_least_squares_and_dependent_columns_have_none() {
        let mut noise = Noise(3);
        let (a, b) = (noise.take(50), noise.take(50));
        let twice: Vec<f64> = a.iter().map(|value| 2.0 * value).collect();
        let mut span = Span::default();
        assert!(span.add(a.clone()) && !span.add(twice) && span.add(b.clone()));
        let mut y: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 3.0 * a - 0.5 * b).collect();
        let has = span.take_from(&mut y);
        let weights = span.weights(&has);
        assert!((weights[0] - 3.0).abs() < 1e-13 && weights[1] == 0.0 && (weights[2] + 0.5).abs() < 1e-13);
        assert!(sum_of_squares(&y) < 1e-26);
        let triangle = span.triangle();
        let gram = triangle.transpose() * &triangle;
        assert!(
            (gram[(0, 1)] - product(&a, &b)).abs() < 1e-12
                && (gram[(1, 1)] - sum_of_squares(&b)).abs() < 1e-12
        );
        assert!(!span.add(vec![f64::NAN; 50]) && !span.add(vec![0.0; 50]));
    }
}
