//! Transfer functions as matrices.

use thetahat_core::nalgebra::DMatrix;

use super::TransferFunction;
use crate::model::ContinuousStateSpace;

/// The highest power that a polynomial in falling powers has.
pub(super) fn degree(polynomial: &[f64]) -> usize {
    let leading = polynomial.iter().take_while(|value| **value == 0.0).count();
    polynomial.len().saturating_sub(leading + 1)
}

/// A controllable canonical form of each function, side by side; with d = b_0/a_0 and c_i = b_i - d a_i over a_0:
///
/// ```text
/// A = [ -a_1 … -a_n ]   B = [ 1 ]   C = [ c_1 … c_n ],   D = d
///     [   I      0  ]       [ 0 ]
/// ```
///
/// Source: Kailath, Linear Systems, 1980, section 2.1. Of a function with n poles n states: a model of several channels
/// need not be minimal.
pub(super) fn realised(functions: &[Vec<TransferFunction>]) -> ContinuousStateSpace {
    let (l, m) = (functions.len(), functions.first().map_or(0, Vec::len));
    let order = |function: &TransferFunction| function.denominator.len() - 1;
    let n: usize = functions.iter().flatten().map(order).sum();
    let mut model = ContinuousStateSpace {
        a: DMatrix::zeros(n, n),
        b: DMatrix::zeros(n, m),
        c: DMatrix::zeros(l, n),
        d: DMatrix::zeros(l, m),
        k: DMatrix::zeros(n, l),
        noise_intensity: DMatrix::zeros(l, l),
    };
    let mut first = 0;
    for (output, row) in functions.iter().enumerate() {
        for (input, function) in row.iter().enumerate() {
            let (count, leading) = (order(function), function.denominator[0]);
            let a: Vec<f64> = function.denominator.iter().map(|value| value / leading).collect();
            let own = &function.numerator[function.numerator.len() - 1 - degree(&function.numerator)..];
            // As long as the denominator.
            let mut b = vec![0.0; count + 1 - own.len()];
            b.extend(own.iter().map(|value| value / leading));
            model.d[(output, input)] = b[0];
            for place in 0..count {
                model.a[(first, first + place)] = -a[place + 1];
                model.c[(output, first + place)] = b[place + 1] - b[0] * a[place + 1];
                if place > 0 {
                    model.a[(first + place, first + place - 1)] = 1.0;
                }
            }
            if count > 0 {
                model.b[(first, input)] = 1.0;
            }
            first += count;
        }
    }
    model
}
