//! The errors of a state-space model along a record, and how they move with it.

use faer::linalg::matmul::{matmul, triangular};
use faer::{Accum, MatMut, MatRef, Par};
use thetahat_core::nalgebra::{Cholesky, DMatrix, DVector};
use thetahat_numerics::optimize::{Objective, normal};

use super::Refine;
use crate::data::JointRecord;
use crate::model::{StateSpace, is_stable};
use crate::respond::state_space::Recursion;

/// Rows whose sources are made at once.
const BLOCK: usize = 32;
/// What is left of a state that no longer matters, as a fraction of what was there.
const FORGOTTEN: f64 = 1e-15;
/// After so many doublings of time nothing is left of a stable mode.
const DOUBLINGS: usize = 60;

/// A model as a recursion that gives its errors, with z = u where it simulates, and z = [u; y - c] where it predicts:
///
/// ```text
/// x(t+1) = A x(t) + B z(t),   e(t) = y(t) - c - H x(t) - D u(t)
/// ```
///
/// A prediction has A = F - K H and B = [G - K D, K].
#[derive(Debug, Clone)]
pub(super) struct Form {
    pub(super) a: DMatrix<f64>,
    pub(super) b: DMatrix<f64>,
    pub(super) h: DMatrix<f64>,
    pub(super) d: DMatrix<f64>,
    pub(super) levels: DVector<f64>,
}

impl Form {
    pub(super) fn of(model: &StateSpace, refine: Refine) -> Self {
        let StateSpace { f, g, h, d, k, .. } = model;
        let (n, m) = g.shape();
        let l = h.nrows();
        let (a, b) = match refine {
            Refine::Simulation => (f.clone(), g.clone()),
            Refine::Prediction => {
                let mut b = DMatrix::zeros(n, m + l);
                b.columns_mut(0, m).copy_from(&(g - k * d));
                b.columns_mut(m, l).copy_from(k);
                (f - k * h, b)
            }
        };
        Self { a, b, h: h.clone(), d: d.clone(), levels: DVector::zeros(l) }
    }

    /// The model that has these errors, with a K of zero where it simulates, and errors of variance 1.
    pub(super) fn model(&self) -> StateSpace {
        let (l, m) = self.d.shape();
        let g = self.b.columns(0, m);
        let k = if self.b.ncols() > m {
            self.b.columns(m, l).into_owned()
        } else {
            DMatrix::zeros(self.a.nrows(), l)
        };
        StateSpace {
            f: &self.a + &k * &self.h,
            g: g + &k * &self.d,
            h: self.h.clone(),
            d: self.d.clone(),
            k,
            noise_covariance: DMatrix::identity(l, l),
            sample_time: 1.0,
        }
    }

    /// All entries, in the order of [`parts_mut`](Self::parts_mut).
    pub(super) fn flat(&self) -> DVector<f64> {
        let Self { a, b, h, d, levels } = self;
        let all = a.iter().chain(b.iter()).chain(h.iter()).chain(d.iter()).chain(levels.iter());
        DVector::from_iterator(a.len() + b.len() + h.len() + d.len() + levels.len(), all.copied())
    }

    /// The root mean squares of the states along a record; 1 for a state that stays at zero. None if the form has no
    /// errors there.
    pub(super) fn state_sizes(&self, record: &JointRecord<'_>, refine: Refine) -> Option<Vec<f64>> {
        let none = DMatrix::zeros(self.flat().len(), 0);
        let floor = DMatrix::identity(self.h.nrows(), self.h.nrows());
        let errors = Errors::new(record, refine, self.clone(), none, floor);
        if !is_stable(&self.a) {
            return None;
        }
        let mut squares = vec![0.0; self.a.nrows()];
        let mut recursion = errors.recursion();
        let shifted = errors.measured();
        let measured = errors.compared(shifted.as_deref());
        for segment in &record.segments {
            recursion.start_at_best(&errors.signals, &measured, segment.clone());
            for row in segment.clone() {
                squares.iter_mut().zip(recursion.state()).for_each(|(sum, state)| *sum += state * state);
                recursion.step(&errors.signals, row);
            }
        }
        let sizes = squares.iter().map(|sum| (sum / errors.samples as f64).sqrt());
        let sizes: Vec<f64> = sizes.map(|size| if size > 0.0 { size } else { 1.0 }).collect();
        sizes.iter().all(|size| size.is_finite()).then_some(sizes)
    }

    /// The same with states in other units: each divided by its size.
    pub(super) fn divide_states(&mut self, sizes: &[f64]) {
        for (state, size) in sizes.iter().enumerate() {
            self.a.row_mut(state).unscale_mut(*size);
            self.b.row_mut(state).unscale_mut(*size);
            self.a.column_mut(state).scale_mut(*size);
            self.h.column_mut(state).scale_mut(*size);
        }
    }

    fn parts_mut(&mut self) -> [&mut [f64]; 5] {
        let Self { a, b, h, d, levels } = self;
        [a.as_mut_slice(), b.as_mut_slice(), h.as_mut_slice(), d.as_mut_slice(), levels.as_mut_slice()]
    }

    /// The form that is so far away.
    pub(super) fn moved(&self, by: &DVector<f64>) -> Self {
        let mut moved = self.clone();
        let mut first = 0;
        for part in moved.parts_mut() {
            part.iter_mut().zip(&by.as_slice()[first..]).for_each(|(entry, by)| *entry += by);
            first += part.len();
        }
        moved
    }

    /// Entries as a form of their own: how a form varies.
    pub(super) fn like(&self, entries: &[f64]) -> Self {
        let mut like = self.clone();
        let mut first = 0;
        for part in like.parts_mut() {
            part.copy_from_slice(&entries[first..first + part.len()]);
            first += part.len();
        }
        like
    }
}

/// Why a form has no errors: it is unstable, or they leave the range of numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unstable;

/// N ln det cov e of the errors of a form, with its directions as parameters: J of [`Objective`].
///
/// With R = cov e and psi = -de/dtheta, G = sum psi' R^-1 psi and g = sum psi' R^-1 e (Ljung, System Identification,
/// 2nd ed. 1999, sections 7.4 and 10.2). The state that each segment starts from is, for any parameters, the one that
/// leaves the least errors; it is taken out of the normal equations.
pub(super) struct Errors<'r> {
    record: &'r JointRecord<'r>,
    signals: Vec<&'r [f64]>,
    refine: Refine,
    start: Form,
    /// The directions, a column for each.
    basis: DMatrix<f64>,
    /// What of errors is nothing.
    floor: DMatrix<f64>,
    current: Form,
    samples: usize,
    /// Of the errors at the current form.
    pub(super) covariance: DMatrix<f64>,
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl<'r> Errors<'r> {
    /// Of a record whose outputs are in units in which `floor` is nothing.
    pub(super) fn new(
        record: &'r JointRecord<'r>,
        refine: Refine,
        start: Form,
        basis: DMatrix<f64>,
        floor: DMatrix<f64>,
    ) -> Self {
        let size = basis.ncols();
        Self {
            signals: record.signals(),
            samples: record.segments.iter().map(std::ops::Range::len).sum(),
            record,
            refine,
            current: start.clone(),
            start,
            basis,
            covariance: floor.clone(),
            floor,
            matrix: vec![0.0; size * size],
            right: vec![0.0; size],
        }
    }

    pub(super) fn directions(&self) -> usize {
        self.basis.ncols()
    }

    /// The form of some parameters.
    pub(super) fn form(&self, parameters: &[f64]) -> Form {
        self.start.moved(&(&self.basis * DVector::from_column_slice(parameters)))
    }

    fn recursion(&self) -> Recursion {
        let model = self.current.model();
        match self.refine {
            Refine::Prediction => Recursion::predictor(&model).with_levels(self.current.levels.as_slice()),
            Refine::Simulation => Recursion::simulator(&model),
        }
    }

    /// Puts the errors of a row in the place of what a step gave.
    fn errors(&self, given: &[f64], row: usize, errors: &mut [f64]) {
        errors.copy_from_slice(given);
        if self.refine == Refine::Simulation {
            let measured = self.record.outputs.iter().zip(&self.current.levels);
            errors
                .iter_mut()
                .zip(measured)
                .for_each(|(error, (output, level))| *error = output[row] - level - *error);
        }
    }

    /// The outputs as a free run is compared with them.
    fn measured(&self) -> Option<Vec<Vec<f64>>> {
        let shifted =
            self.refine == Refine::Simulation && self.current.levels.iter().any(|level| *level != 0.0);
        let outputs = self.record.outputs.iter().zip(&self.current.levels);
        shifted.then(|| outputs.map(|(output, level)| output.iter().map(|y| y - level).collect()).collect())
    }

    /// The outputs that a start of a segment is to explain.
    fn compared<'s>(&'s self, shifted: Option<&'s [Vec<f64>]>) -> Vec<&'s [f64]> {
        match shifted {
            Some(shifted) => shifted.iter().map(Vec::as_slice).collect(),
            None => self.record.outputs.clone(),
        }
    }

    /// How the rows of [A; R^-1/2 H] and the entries of B, D and c move with each direction: for each of these n + l
    /// rows, by states, signals and one.
    fn sources(&self, root: &DMatrix<f64>) -> DMatrix<f64> {
        let (n, l) = (self.current.a.nrows(), self.current.h.nrows());
        let (q, m) = (self.current.b.ncols(), self.current.d.ncols());
        let mut sources = DMatrix::zeros((n + l) * self.basis.ncols(), n + q + 1);
        let fed_back = (q > m).then(|| self.current.b.columns(m, l));
        for (place, direction) in self.basis.column_iter().enumerate() {
            let moved = self.current.like(direction.as_slice());
            let first = place * (n + l);
            sources.view_mut((first, 0), (n, n)).copy_from(&moved.a);
            sources.view_mut((first, n), (n, q)).copy_from(&moved.b);
            sources.view_mut((first + n, 0), (l, n)).copy_from(&(root * &moved.h));
            sources.view_mut((first + n, n), (l, m)).copy_from(&(root * &moved.d));
            // z has y - c.
            if let Some(fed_back) = &fed_back {
                sources.view_mut((first, n + q), (n, 1)).copy_from(&-(fed_back * &moved.levels));
            }
            sources.view_mut((first + n, n + q), (l, 1)).copy_from(&(root * &moved.levels));
        }
        sources
    }

    /// Goes along the record at the current form: x of the model with it, and X of its slopes,
    ///
    /// ```text
    /// X(t+1) = A X(t) + dA x(t) + dB z(t),   psi(t) = H X(t) + dH x(t) + dD u(t) + dc
    /// ```
    ///
    /// for all directions at once.
    fn along(&self, mut see: impl FnMut(Seen<'_>)) -> Result<(), Unstable> {
        let (n, l) = (self.current.a.nrows(), self.current.h.nrows());
        let (q, size) = (self.current.b.ncols(), self.basis.ncols());
        let factor = Cholesky::new(self.covariance.clone()).ok_or(Unstable)?.unpack();
        let root = factor.solve_lower_triangular(&DMatrix::identity(l, l)).ok_or(Unstable)?;
        let sources = self.sources(&root);
        let mut through = DMatrix::zeros(n + l, n);
        through.rows_mut(0, n).copy_from(&self.current.a);
        through.rows_mut(n, l).copy_from(&(&root * &self.current.h));
        let mut recursion = self.recursion();
        let shifted = self.measured();
        let measured = self.compared(shifted.as_deref());
        let mut drives = DMatrix::zeros(n + q + 1, BLOCK);
        let mut driven = DMatrix::zeros((n + l) * size, BLOCK);
        let mut slopes = DMatrix::zeros(size, l * BLOCK);
        let mut errors = DVector::zeros(l * BLOCK);
        let (mut states, mut next) = (DMatrix::zeros(n, size), DMatrix::zeros(n + l, size));
        let mut error = DVector::zeros(l);
        for segment in &self.record.segments {
            recursion.start_at_best(&self.signals, &measured, segment.clone());
            states.fill(0.0);
            for first in segment.clone().step_by(BLOCK) {
                let rows = first..segment.end.min(first + BLOCK);
                let count = rows.len();
                for (place, row) in rows.enumerate() {
                    let mut drive = drives.column_mut(place);
                    drive.rows_mut(0, n).copy_from_slice(recursion.state());
                    let fed = self.signals[..q].iter().enumerate();
                    fed.for_each(|(signal, values)| drive[n + signal] = values[row]);
                    if self.refine == Refine::Prediction {
                        let mut outputs = drive.rows_mut(n + q - l, l);
                        outputs -= &self.current.levels;
                    }
                    drive[n + q] = 1.0;
                    self.errors(recursion.step(&self.signals, row), row, error.as_mut_slice());
                    errors.rows_mut(l * place, l).gemv(1.0, &root, &error, 0.0);
                }
                driven.columns_mut(0, count).gemm(1.0, &sources, &drives.columns(0, count), 0.0);
                for place in 0..count {
                    next.as_mut_slice().copy_from_slice(driven.column(place).as_slice());
                    next.gemm(1.0, &through, &states, 1.0);
                    states.copy_from(&next.rows(0, n));
                    slopes.columns_mut(l * place, l).tr_copy_from(&next.rows(n, l));
                }
                let (slopes, errors) =
                    (&slopes.as_slice()[..size * l * count], &errors.as_slice()[..l * count]);
                see(Seen::Rows { through: &through, slopes, errors });
            }
            see(Seen::End);
        }
        Ok(())
    }

    /// The covariance of g where the errors v are coloured, those of a free run of a model with noise. With w = R^-1
    /// psi, v's covariance Gamma_0 and Gamma_k = H F^(k-1) N,
    ///
    /// ```text
    /// cov g = sum_t w_t' Gamma_0 w_t + w_t' H xi_t + (w_t' H xi_t)',   xi_(t+1) = F xi_t + N w_t
    /// P = F P F' + K Re K',   Gamma_0 = H P H' + Re,   N = F P H' + K Re
    /// ```
    ///
    /// (Ljung, System Identification, 2nd ed. 1999, section 9.4, for weights of a filter). None where P has no
    /// solution. The starts of segments count as known.
    pub(super) fn covariance_of_right(&self, noise: &StateSpace) -> Option<Vec<f64>> {
        let StateSpace { f, h, k, noise_covariance, .. } = noise;
        let (n, l, size) = (f.nrows(), h.nrows(), self.basis.ncols());
        let states = state_covariance(f, &(k * noise_covariance * k.transpose()))?;
        let own = h * &states * h.transpose() + noise_covariance;
        let later = f * &states * h.transpose() + k * noise_covariance;
        // Slopes come times R^-1/2.
        let factor = Cholesky::new(self.covariance.clone())?.unpack();
        let root = factor.solve_lower_triangular(&DMatrix::identity(l, l))?;
        let (own, later, seen) = (&root * own * root.transpose(), later * root.transpose(), &root * h);
        let mut matrix = vec![0.0; size * size];
        let (mut xi, mut next) = (DMatrix::zeros(n, size), DMatrix::zeros(n, size));
        let mut weighted = DMatrix::zeros(size, l * BLOCK);
        let along = self.along(|found| match found {
            Seen::Rows { slopes, errors, .. } => {
                let count = errors.len() / l;
                let all = DMatrix::from_column_slice(size, l * count, slopes);
                for row in 0..count {
                    let slopes = all.columns(l * row, l);
                    // Half of what is symmetric; the other half is added at the end.
                    let mut half = weighted.columns_mut(l * row, l);
                    half.gemm(0.5, &slopes, &own, 0.0);
                    half += (&seen * &xi).transpose();
                    next.gemm(1.0, f, &xi, 0.0);
                    next.gemm(1.0, &later, &slopes.transpose(), 1.0);
                    std::mem::swap(&mut xi, &mut next);
                }
                add_all_products(&mut matrix, slopes, &weighted.as_slice()[..slopes.len()], size);
            }
            Seen::End => xi.fill(0.0),
        });
        along.ok()?;
        let mut sum = matrix.clone();
        for row in 0..size {
            for column in 0..size {
                sum[row * size + column] += matrix[column * size + row];
            }
        }
        Some(sum)
    }
}

/// P of P = F P F' + Q by doubling: P_(i+1) = P_i + A_i P_i A_i', A_(i+1) = A_i^2 (Smith, SIAM J. Applied Mathematics
/// 16, 1968). None where F is not stable.
fn state_covariance(f: &DMatrix<f64>, noise: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let (mut power, mut sum) = (f.clone(), noise.clone());
    for _ in 0..DOUBLINGS {
        let more = &power * &sum * power.transpose();
        if more.norm() <= f64::EPSILON * sum.norm() {
            return Some(sum);
        }
        sum += more;
        power = &power * &power;
        if !sum.norm().is_finite() {
            return None;
        }
    }
    None
}

impl Objective for Errors<'_> {
    type Refusal = Unstable;

    fn samples(&self) -> usize {
        self.samples
    }

    fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Unstable> {
        self.current = self.form(parameters);
        if !is_stable(&self.current.a) {
            return Err(Unstable);
        }
        let l = self.floor.nrows();
        let (mut sums, mut errors) = (vec![0.0; l * l], vec![0.0; l]);
        let mut recursion = self.recursion();
        let shifted = self.measured();
        let measured = self.compared(shifted.as_deref());
        for segment in &self.record.segments {
            recursion.start_at_best(&self.signals, &measured, segment.clone());
            for row in segment.clone() {
                self.errors(recursion.step(&self.signals, row), row, &mut errors);
                for (sums, left) in sums.chunks_exact_mut(l).zip(&errors) {
                    sums.iter_mut().zip(&errors).for_each(|(sum, right)| *sum += left * right);
                }
            }
        }
        self.covariance = DMatrix::from_column_slice(l, l, &sums) / self.samples as f64 + &self.floor;
        let factor = Cholesky::new(self.covariance.clone()).ok_or(Unstable)?;
        let logarithm = factor.l_dirty().diagonal().iter().map(|entry| 2.0 * entry.ln()).sum::<f64>();
        let cost = self.samples as f64 * logarithm;
        if cost.is_finite() { Ok(cost) } else { Err(Unstable) }
    }

    fn linearize(&mut self) -> Result<f64, Unstable> {
        let (n, l, size) = (self.current.a.nrows(), self.current.h.nrows(), self.basis.ncols());
        let (mut matrix, mut right) = (std::mem::take(&mut self.matrix), std::mem::take(&mut self.right));
        matrix.fill(0.0);
        right.fill(0.0);
        let mut start = Start::new(n, size);
        let seen = self.along(|seen| match seen {
            Seen::Rows { through, slopes, errors } => {
                start.add(through, (slopes, errors), l);
                add_products(&mut matrix, slopes, size);
                for (slope, error) in slopes.chunks_exact(size).zip(errors) {
                    right.iter_mut().zip(slope).for_each(|(sum, slope)| *sum += slope * error);
                }
            }
            Seen::End => std::mem::replace(&mut start, Start::new(n, size)).take_out(&mut matrix, &mut right),
        });
        fill_upper(&mut matrix, size);
        (self.matrix, self.right) = (matrix, right);
        seen.map(|()| 0.0)
    }

    fn matrix(&self) -> &[f64] {
        &self.matrix
    }

    fn right(&self) -> &[f64] {
        &self.right
    }

    fn scale(&self, _: f64) -> f64 {
        (self.samples * self.floor.nrows()) as f64
    }

    fn is_outside(_: &Unstable) -> bool {
        true
    }
}

/// What is seen along a record: R^-1/2 psi and R^-1/2 e of some rows, those of an output of a row standing together,
/// with the recursion's [A; R^-1/2 H]; or the end of a segment.
pub(super) enum Seen<'s> {
    Rows { through: &'s DMatrix<f64>, slopes: &'s [f64], errors: &'s [f64] },
    End,
}

/// Adds the products of rows of slopes, those of a row standing together, to a matrix.
fn add_all_products(matrix: &mut [f64], left: &[f64], right: &[f64], size: usize) {
    let rows = left.len() / size.max(1);
    let (left, right) = (
        MatRef::from_column_major_slice(left, size, rows),
        MatRef::from_column_major_slice(right, size, rows),
    );
    matmul(
        MatMut::from_row_major_slice_mut(matrix, size, size),
        Accum::Add,
        left,
        right.transpose(),
        1.0,
        Par::Seq,
    );
}

/// Adds the products of rows of slopes, those of a row standing together, to the lower triangle of a matrix.
fn add_products(matrix: &mut [f64], slopes: &[f64], size: usize) {
    let slopes = MatRef::from_column_major_slice(slopes, size, slopes.len() / size.max(1));
    triangular::matmul(
        MatMut::from_row_major_slice_mut(matrix, size, size),
        triangular::BlockStructure::TriangularLower,
        Accum::Add,
        slopes,
        triangular::BlockStructure::Rectangular,
        slopes.transpose(),
        triangular::BlockStructure::Rectangular,
        1.0,
        Par::Seq,
    );
}

fn fill_upper(matrix: &mut [f64], size: usize) {
    for row in 0..size {
        for column in 0..row {
            matrix[column * size + row] = matrix[row * size + column];
        }
    }
}

/// The state that a segment starts from, in its normal equations.
struct Start {
    /// What is left of it.
    left: DMatrix<f64>,
    /// Its products with itself, with the directions and with the errors.
    own: DMatrix<f64>,
    mixed: DMatrix<f64>,
    right: DVector<f64>,
    is_forgotten: bool,
}

impl Start {
    fn new(states: usize, directions: usize) -> Self {
        Self {
            left: DMatrix::identity(states, states),
            own: DMatrix::zeros(states, states),
            mixed: DMatrix::zeros(states, directions),
            right: DVector::zeros(states),
            is_forgotten: false,
        }
    }

    /// Some rows of slopes and errors, each of l outputs, of a recursion with [A; R^-1/2 H].
    fn add(&mut self, through: &DMatrix<f64>, (slopes, errors): (&[f64], &[f64]), l: usize) {
        let (n, size) = self.mixed.shape();
        for row in 0..errors.len() / l {
            if self.is_forgotten {
                return;
            }
            let after = through * &self.left;
            let seen = after.rows(n, l);
            self.own.gemm_tr(1.0, &seen, &seen, 1.0);
            for output in 0..l {
                let place = l * row + output;
                let seen = seen.row(output).transpose();
                let slopes = DVector::from_column_slice(&slopes[place * size..][..size]);
                self.mixed.ger(1.0, &seen, &slopes, 1.0);
                self.right.axpy(errors[place], &seen, 1.0);
            }
            self.left.copy_from(&after.rows(0, n));
            let norm = self.left.norm();
            self.is_forgotten = norm < FORGOTTEN || !norm.is_finite();
        }
    }

    /// Takes what the best start explains out of the lower triangle of a matrix and out of a right side.
    fn take_out(mut self, matrix: &mut [f64], right: &mut [f64]) {
        let (n, size) = self.mixed.shape();
        let mut factor = std::mem::take(&mut self.own).as_slice().to_vec();
        normal::factor(&mut factor, n);
        normal::solve(&factor, n, self.right.as_mut_slice());
        let mut explained = self.mixed.clone();
        explained.column_iter_mut().for_each(|mut column| normal::solve(&factor, n, column.as_mut_slice()));
        for row in 0..size {
            for column in 0..=row {
                matrix[row * size + column] -= self.mixed.column(row).dot(&explained.column(column));
            }
            right[row] -= self.mixed.column(row).dot(&self.right);
        }
    }
}
