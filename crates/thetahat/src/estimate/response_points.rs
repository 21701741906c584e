//! What a measured frequency response says of one input.

use thetahat_core::nalgebra::DMatrix;

use crate::respond::Correlation;
use crate::respond::process::Points;

/// How many pairs of points at the highest frequencies tell a dead time.
const HIGHEST: usize = 7;

/// Measured points of the frequency response from one input.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ResponsePoints {
    /// In rad/s, and the points themselves.
    pub(crate) frequencies: Vec<f64>,
    pub(crate) values: Vec<[f64; 2]>,
    /// What each is multiplied by: one over its standard deviation, or over its size.
    pub(crate) weights: Vec<f64>,
    /// Whether the standard deviations are known.
    pub(crate) known: bool,
    /// Half the shortest period that could be seen, in seconds: a sample time where there are samples.
    pub(crate) sample_time: f64,
    /// Whether the input is held that long; else it is a sine in continuous time.
    pub(crate) held: bool,
    /// How the errors of the points are correlated.
    pub(crate) correlation: Correlation,
}

impl ResponsePoints {
    /// As a process takes them.
    pub(super) fn at(&self) -> Points<'_> {
        (&self.frequencies, self.held.then_some(self.sample_time))
    }

    /// -d phase/d omega in seconds over the highest frequencies, the median of some pairs of neighbours: there lags
    /// have turned the phase as far as they can, and a dead time alone turns it further. None where it does not fall.
    pub(super) fn group_delay(&self) -> Option<f64> {
        let pairs = self.frequencies.windows(2).zip(self.values.windows(2)).rev().take(HIGHEST);
        let slope = |(at, values): (&[f64], &[[f64; 2]])| {
            let [[a, b], [c, d]] = [values[0], values[1]];
            // The angle of the quotient of the two.
            -(d * a - c * b).atan2(c * a + d * b) / (at[1] - at[0])
        };
        let mut slopes: Vec<f64> = pairs.map(slope).filter(|slope| slope.is_finite()).collect();
        slopes.sort_by(f64::total_cmp);
        slopes.get(slopes.len() / 2).copied().filter(|slope| *slope > 0.0)
    }

    /// The sum of rho psi_k psi_l' over the points of each input, of columns of psi at the points of all inputs, one
    /// after the other ([`Correlation::spread`]).
    pub(super) fn spread(points: &[Self], psi: &[&Vec<f64>]) -> DMatrix<f64> {
        let size = psi.len();
        let mut sum = DMatrix::zeros(size, size);
        let mut first = 0;
        for own in points {
            let rows = (0..own.frequencies.len()).map(|row| first + 2 * row);
            let slopes: Vec<[f64; 2]> =
                rows.flat_map(|row| psi.iter().map(move |column| [column[row], column[row + 1]])).collect();
            let spread = own.correlation.spread(&own.frequencies, &slopes, size);
            sum += DMatrix::from_row_slice(size, size, &spread);
            first += 2 * own.frequencies.len();
        }
        sum
    }

    /// Real and imaginary parts, times their weights.
    pub(super) fn measured(&self) -> impl Iterator<Item = f64> {
        self.values.iter().zip(&self.weights).flat_map(|(value, weight)| value.map(|part| part * weight))
    }
}
