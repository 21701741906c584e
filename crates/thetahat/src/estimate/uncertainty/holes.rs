//! Errors that are not known, as outputs are missing, given those that are.
//!
//! With v = e/A the log-likelihood of a segment is -|A v|^2/(2 sigma^2), A being a lower triangular matrix with the
//! monic polynomial in its columns. So the missing samples m have, given the others, the mean that makes |A v| least
//! and the covariance sigma^2 (A'A)_mm^-1, and what is left of |A v|^2 is v'R^-1 v of the known ones (Jones,
//! Technometrics 22 (1980); here by a banded Cholesky factor). What expectation and maximisation needs of the
//! covariance are the entries within n samples of the diagonal: with (A'A)_mm = L L' and Z its inverse
//!
//! ```text
//! Z_jj = 1/L_jj^2 - sum_{k>j} L_kj Z_kj/L_jj,   Z_ij = -sum_{k>j} L_kj Z_ki/L_jj   for i > j
//! ```
//!
//! (Takahashi, Fagan and Chin, Proc. 8th PICA Conference 1973), which stay in the band of L. O(m n^2).

use std::ops::Range;

use thetahat_core::nalgebra::DMatrix;

/// The missing samples of some segments, up to n lags being of interest.
#[derive(Debug)]
pub(super) struct Holes {
    /// The segments, and the samples that miss in each.
    segments: Vec<(Range<usize>, Vec<usize>)>,
    highest: usize,
    /// The sums over t of cov(v(t - k), v(t - l))/sigma^2, over all t of which n earlier samples are in the segment.
    spread: DMatrix<f64>,
}

impl Holes {
    pub(super) fn new(values: &[f64], segments: &[Range<usize>], highest: usize) -> Self {
        let missing = |segment: &Range<usize>| {
            let rows = segment.clone().filter(|row| values[*row].is_nan()).collect::<Vec<usize>>();
            (segment.clone(), rows)
        };
        let segments = segments.iter().map(missing).filter(|(_, rows)| !rows.is_empty()).collect();
        Self { segments, highest, spread: DMatrix::zeros(highest + 1, highest + 1) }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.segments.is_empty()
    }

    pub(super) fn spread(&self) -> &DMatrix<f64> {
        &self.spread
    }

    /// Puts the expected values into the holes of signals, of an autoregression whose order is n at most.
    pub(super) fn fill(&mut self, signals: &mut [Vec<f64>], monic: &[f64]) {
        let Self { segments, highest, spread } = self;
        spread.fill(0.0);
        for (segment, missing) in &*segments {
            let factor = Banded::new(missing, segment.end, monic, *highest);
            for signal in &mut *signals {
                missing.iter().for_each(|row| signal[*row] = 0.0);
                let errors: Vec<f64> =
                    segment.clone().map(|row| filtered(signal, segment.start, row, monic)).collect();
                let against = |row: &usize| {
                    let later = &errors[row - segment.start..];
                    -monic.iter().zip(later).map(|(a, e)| a * e).sum::<f64>()
                };
                let mut values: Vec<f64> = missing.iter().map(against).collect();
                factor.solve(&mut values);
                missing.iter().zip(values).for_each(|(row, value)| signal[*row] = value);
            }
            let inverse = factor.inverse();
            for (j, &early) in missing.iter().enumerate() {
                for (row, value) in missing[j..].iter().zip(&inverse[j]) {
                    let apart = row - early;
                    // v(t - k) is the later one, v(t - l) the earlier.
                    for k in 0..=highest.saturating_sub(apart) {
                        if apart <= *highest && (segment.start + *highest..segment.end).contains(&(row + k)) {
                            spread[(k, k + apart)] += value;
                        }
                    }
                }
            }
        }
        spread.fill_lower_triangle_with_upper_triangle();
    }
}

/// (A v)(t), v being zero before the segment.
fn filtered(signal: &[f64], start: usize, row: usize, monic: &[f64]) -> f64 {
    let known = (row + 1 - start).min(monic.len());
    monic[..known].iter().zip(signal[row + 1 - known..=row].iter().rev()).map(|(a, v)| a * v).sum()
}

/// The factor of (A'A)_mm.
struct Banded {
    /// Row j: L_jj, L_j,j-1, … L_j,j-n.
    rows: Vec<Vec<f64>>,
}

impl Banded {
    fn new(missing: &[usize], end: usize, monic: &[f64], width: usize) -> Self {
        let entry = |late: usize, early: usize| -> f64 {
            let later = monic.get(late - early..).unwrap_or(&[]);
            // As far as the segment goes.
            later.iter().zip(monic).take(end - late).map(|(b, a)| a * b).sum()
        };
        let mut rows: Vec<Vec<f64>> = Vec::with_capacity(missing.len());
        for (j, &late) in missing.iter().enumerate() {
            let mut row = vec![0.0; width.min(j) + 1];
            for back in (0..row.len()).rev() {
                // L_ji with i = j - back.
                let i = j - back;
                let mut value = entry(late, missing[i]);
                // L_jk L_ik of the columns before both.
                for k in back + 1..row.len() {
                    value -= row[k] * if back == 0 { row[k] } else { rows[i][k - back] };
                }
                row[back] = if back == 0 { value.sqrt() } else { value / rows[i][0] };
            }
            rows.push(row);
        }
        Self { rows }
    }

    /// (A'A)_mm x = v, in place.
    fn solve(&self, values: &mut [f64]) {
        for j in 0..values.len() {
            let row = &self.rows[j];
            let taken: f64 = (1..row.len()).map(|back| row[back] * values[j - back]).sum();
            values[j] = (values[j] - taken) / row[0];
        }
        for j in (0..values.len()).rev() {
            let row = &self.rows[j];
            values[j] /= row[0];
            let value = values[j];
            (1..row.len()).for_each(|back| values[j - back] -= row[back] * value);
        }
    }

    /// Z_jj, Z_j+1,j, … as far as the band goes, for each j.
    fn inverse(&self) -> Vec<Vec<f64>> {
        let count = self.rows.len();
        let below = |j: usize, k: usize| self.rows[k].get(k - j).copied().unwrap_or(0.0);
        let last = |j: usize| (j + 1..count).take_while(|&k| k - j < self.rows[k].len()).last().unwrap_or(j);
        let mut inverse: Vec<Vec<f64>> = vec![Vec::new(); count];
        for j in (0..count).rev() {
            let (pivot, last) = (self.rows[j][0], last(j));
            let at = |inverse: &[Vec<f64>], i: usize, k: usize| inverse[i.min(k)][i.abs_diff(k)];
            let mut own = vec![0.0; last - j + 1];
            for i in j + 1..=last {
                let sum: f64 = (j + 1..=last).map(|k| below(j, k) * at(&inverse, i, k)).sum();
                own[i - j] = -sum / pivot;
            }
            let sum: f64 = (j + 1..=last).map(|k| below(j, k) * own[k - j]).sum();
            own[0] = (1.0 / pivot - sum) / pivot;
            inverse[j] = own;
        }
        inverse
    }
}

#[cfg(test)]
mod tests;
