//! Reduced equations of lagged signals, from which the initial-condition responses of each segment are taken out.

use std::ops::Range;

use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};
use thetahat_numerics::regression::{Lagged, Presample, Taps, divide_from};

/// Of a column as a fraction of its square: less than this is rounding, once the columns before it are taken out.
const ROUNDING: f64 = 1e-14;
/// Where a initial-condition response is below this fraction of its peak, it has died away.
const DIED_AWAY: f64 = 1e-10;
/// Samples of a response that are computed at once.
const PIECE: usize = 128;

/// L L' = G for a positive semidefinite G: a column that depends on those before it is left out, and its unknown is
/// zero.
#[derive(Debug, Clone)]
pub(in crate::estimate) struct Factor {
    /// A column left out is zero from the diagonal down.
    lower: DMatrix<f64>,
    /// Whether columns were left out.
    pub(in crate::estimate) deficient: bool,
}

impl Factor {
    /// None if an entry is not finite. p^3 / 3 flops.
    pub(in crate::estimate) fn new(matrix: &DMatrix<f64>) -> Option<Self> {
        if !matrix.iter().all(|entry| entry.is_finite()) {
            return None;
        }
        let size = matrix.ncols();
        let mut lower = matrix.clone();
        let mut deficient = false;
        for k in 0..size {
            let pivot = lower[(k, k)];
            if pivot <= ROUNDING * matrix[(k, k)] {
                lower.view_range_mut(k.., k).fill(0.0);
                deficient = true;
                continue;
            }
            lower.view_range_mut(k.., k).unscale_mut(pivot.sqrt());
            for j in k + 1..size {
                let weight = lower[(j, k)];
                for i in j..size {
                    lower[(i, j)] -= weight * lower[(i, k)];
                }
            }
        }
        Some(Self { lower, deficient })
    }

    /// L x = v, in place.
    pub(in crate::estimate) fn forward(&self, values: &mut [f64]) {
        for k in 0..values.len() {
            let pivot = self.lower[(k, k)];
            let value = if pivot == 0.0 { 0.0 } else { values[k] / pivot };
            values[k] = value;
            for (i, later) in values.iter_mut().enumerate().skip(k + 1) {
                *later -= self.lower[(i, k)] * value;
            }
        }
    }

    /// L' x = v, in place, for the first of the unknowns.
    pub(in crate::estimate) fn backward(&self, values: &mut [f64]) {
        for k in (0..values.len()).rev() {
            let pivot = self.lower[(k, k)];
            let later: f64 = (k + 1..values.len()).map(|i| self.lower[(i, k)] * values[i]).sum();
            values[k] = if pivot == 0.0 { 0.0 } else { (values[k] - later) / pivot };
        }
    }

    /// G x = v.
    pub(in crate::estimate) fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let mut solution = right.clone();
        self.forward(solution.as_mut_slice());
        self.backward(solution.as_mut_slice());
        solution
    }
}

/// Initial-condition responses h(t), h(t - 1), … of each of several 1/F, from the first sample of a segment on.
#[derive(Debug, Clone, Default)]
pub(in crate::estimate) struct Free {
    /// h of each F, as long as the slowest takes to die away.
    pub(in crate::estimate) responses: Vec<Vec<f64>>,
    /// How many delays of each.
    pub(in crate::estimate) counts: Vec<usize>,
}

impl Free {
    /// Those of 1/F for each F and its number of delays, in segments of at most `longest` samples.
    pub(in crate::estimate) fn new<'f>(
        denominators: impl Iterator<Item = (&'f [f64], usize)>,
        longest: usize,
    ) -> Self {
        let (mut responses, counts): (Vec<_>, Vec<_>) =
            denominators.map(|(monic, count)| (impulse_response(monic, count, longest), count)).unzip();
        let length = responses.iter().map(Vec::len).max().unwrap_or(0);
        responses.iter_mut().for_each(|response| response.resize(length, 0.0));
        Self { responses, counts }
    }

    pub(in crate::estimate) fn count(&self) -> usize {
        self.counts.iter().sum()
    }

    /// Taps of the responses, which are the signals from `first` on.
    pub(in crate::estimate) fn taps(&self, first: usize) -> Vec<Taps> {
        let counts = self.counts.iter().enumerate();
        counts.map(|(k, &count)| Taps { signal: first + k, first: 0, count, sign: 1.0 }).collect()
    }

    /// The responses over a segment of some length.
    pub(in crate::estimate) fn padded(&self, length: usize) -> Vec<Vec<f64>> {
        let mut responses = self.responses.clone();
        responses.iter_mut().for_each(|response| response.resize(length, 0.0));
        responses
    }
}

/// The impulse response of 1/F until it has died away, with room for `count` delays of it.
fn impulse_response(monic: &[f64], count: usize, longest: usize) -> Vec<f64> {
    let mut response: Vec<f64> = Vec::new();
    if count == 0 {
        return response;
    }
    let order = monic.len() - 1;
    let (mut peak, mut quiet): (f64, usize) = (0.0, 0);
    while response.len() < longest {
        // A piece at a time, driven by the one before; the first by an impulse.
        let known = response.len();
        let mut piece = vec![0.0; PIECE.min(longest - known)];
        if known == 0 {
            piece[0] = 1.0;
        }
        divide_from(&monic[1..], &response[known.saturating_sub(order)..], &mut piece);
        for value in piece {
            peak = peak.max(value.abs());
            quiet = if value.abs() > DIED_AWAY * peak { 0 } else { quiet + 1 };
            response.push(value);
            if quiet >= monic.len() + count {
                return response;
            }
        }
    }
    response
}

/// Reduced equations for parameters that all segments share, the initial-condition responses of each segment being
/// taken out:
///
/// ```text
/// G = sum_s (G_s - K_s' H_s K_s),   g = sum_s (g_s - K_s' h_s),   K_s = H_s^-1 X_s,
/// ```
///
/// H_s and h_s belonging to the initial-condition responses of segment s alone, X_s to both. O(N p), and O(n^3) for
/// each segment.
#[derive(Debug, Clone)]
pub(in crate::estimate) struct Reduced {
    pub(in crate::estimate) matrix: DMatrix<f64>,
    pub(in crate::estimate) right: DVector<f64>,
    /// For each segment.
    taken: Vec<Taken>,
}

/// What was taken out of one segment.
#[derive(Debug, Clone)]
struct Taken {
    /// H = L L'.
    factor: Factor,
    /// L^-1 X.
    cross: DMatrix<f64>,
    /// L^-1 h.
    right: DVector<f64>,
}

impl Reduced {
    /// None if squares leave the range of numbers. The target is `signals[0]`; before a segment all signals are zero.
    pub(in crate::estimate) fn new(
        signals: &[&[f64]],
        taps: &[Taps],
        segments: &[Range<usize>],
        free: &Free,
    ) -> Option<Self> {
        let (mut matrix, mut right, _) =
            Lagged::new(signals, taps.to_vec(), segments, Presample::Zero).normal_equations();
        let (size, count) = (right.len(), free.count());
        let mut taken = Vec::new();
        if count > 0 {
            let taps = [taps, &free.taps(signals.len())].concat();
            let length = free.responses.first().map_or(0, Vec::len);
            for segment in segments {
                // After the initial-condition responses there is nothing to take out.
                let head = 0..segment.len().min(length);
                let of_segment = signals.iter().map(|signal| &signal[segment.start..][..head.end]);
                let both: Vec<&[f64]> =
                    of_segment.chain(free.responses.iter().map(|response| &response[..head.end])).collect();
                let (gram, products, _) =
                    Lagged::new(&both, taps.clone(), std::slice::from_ref(&head), Presample::Zero)
                        .normal_equations();
                let factor = Factor::new(&gram.view((size, size), (count, count)).into_owned())?;
                let mut cross = gram.view((size, 0), (count, size)).into_owned();
                cross.column_iter_mut().for_each(|mut column| factor.forward(column.as_mut_slice()));
                let mut own = products.rows(size, count).into_owned();
                factor.forward(own.as_mut_slice());
                matrix.gemm_tr(-1.0, &cross, &cross, 1.0);
                right.gemv_tr(-1.0, &cross, &own, 1.0);
                taken.push(Taken { factor, cross, right: own });
            }
        }
        Some(Self { matrix, right, taken })
    }

    /// The initial conditions of each segment that go with some values of the parameters.
    pub(in crate::estimate) fn initial_conditions(&self, parameters: &DVector<f64>) -> Vec<DVector<f64>> {
        let of_segment = |taken: &Taken| {
            let mut values = &taken.right - &taken.cross * parameters;
            taken.factor.backward(values.as_mut_slice());
            values
        };
        self.taken.iter().map(of_segment).collect()
    }

    /// What takes the initial-condition responses of a segment out of its columns: `[I, -K']` for columns followed by
    /// initial-condition responses.
    pub(in crate::estimate) fn combination(&self, segment: usize) -> Option<DMatrix<f64>> {
        let taken = self.taken.get(segment)?;
        let (count, size) = taken.cross.shape();
        let mut projection = taken.cross.clone();
        projection.column_iter_mut().for_each(|mut column| taken.factor.backward(column.as_mut_slice()));
        Some(DMatrix::from_fn(size, size + count, |row, column| {
            if column < size { f64::from(u8::from(row == column)) } else { -projection[(column - size, row)] }
        }))
    }

    /// The triangular factor of the same columns, initial-condition responses taken out, as exact as Householder QR:
    /// good for condition numbers of which the square is beyond rounding. 2 N p^2 flops. None if a sample is out of
    /// range.
    pub(in crate::estimate) fn factor(
        signals: &[&[f64]],
        taps: &[Taps],
        segments: &[Range<usize>],
        free: &Free,
    ) -> Option<LeastSquares<f64, Dyn>> {
        let count = free.count();
        if count == 0 {
            return Lagged::new(signals, taps.to_vec(), segments, Presample::Zero).factor().ok();
        }
        let size: usize = taps.iter().map(|taps| taps.count).sum();
        let mut columns = free.taps(signals.len());
        columns.extend_from_slice(taps);
        let mut whole = LeastSquares::with_size(Dyn(size));
        for segment in segments {
            let own = 0..segment.len();
            let responses = free.padded(own.end);
            let of_segment = signals.iter().map(|signal| &signal[segment.clone()]);
            let of_segment: Vec<&[f64]> = of_segment.chain(responses.iter().map(Vec::as_slice)).collect();
            let lagged =
                Lagged::new(&of_segment, columns.clone(), std::slice::from_ref(&own), Presample::Zero);
            let factor = lagged.factor().ok()?;
            // What stands below the rows of the initial-condition responses.
            let rest = factor.factor().view((count, count), (size, size)).into_owned();
            let rotated = factor.rotated_output().rows(count, size).into_owned();
            let part = LeastSquares::from_factor(&rest, &rotated, factor.residual_norm(), own.end).ok()?;
            whole.merge(&part).ok()?;
        }
        Some(whole)
    }
}
