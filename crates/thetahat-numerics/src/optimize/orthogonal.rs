//! Steps by orthogonal transformations in the coordinates of the objective, for normal equations that have lost what
//! tells their columns apart, and for regions with a border.

use super::objective::Objective;

/// Always there: directions in which the columns are nothing but rounding predict no decrease.
const SMALLEST_DAMPING: f64 = 1e-26;

/// How far a coordinate that is no parameter moves in a step, and how far it goes at all: beyond, rounding decides on
/// which side of the border the parameters are.
const LONGEST: f64 = 2.0;
const FARTHEST: f64 = 12.0;

/// The linearised errors in the coordinates of a search, as a triangle with columns of length one.
#[derive(Debug)]
pub(super) struct Orthogonal {
    size: usize,
    triangle: Vec<f64>,
    work: Vec<f64>,
    slopes: Vec<f64>,
    scales: Vec<f64>,
    coordinates: Vec<f64>,
    trial: Vec<f64>,
    /// The least and the largest step of each coordinate, in the units of `scales`, and whether it is held at one of
    /// them.
    limits: Vec<[f64; 2]>,
    held: Vec<bool>,
    /// Whether coordinates are others than the parameters.
    own: bool,
}

impl Orthogonal {
    pub(super) fn new(size: usize) -> Self {
        let line = || vec![0.0; size];
        Self {
            size,
            triangle: vec![0.0; size * (size + 1)],
            work: vec![0.0; 2 * size * (size + 1)],
            slopes: vec![0.0; size * size],
            scales: line(),
            coordinates: line(),
            trial: line(),
            limits: vec![[f64::NEG_INFINITY, f64::INFINITY]; size],
            held: vec![false; size],
            own: false,
        }
    }

    /// Takes the triangle at the current point, and solves. Gives the decrease of the cost that the solution predicts;
    /// none where the objective has no triangle.
    pub(super) fn scale(
        &mut self,
        objective: &mut impl Objective,
        parameters: &[f64],
        right: &mut [f64],
        step: &mut [f64],
    ) -> Option<f64> {
        let Self { size, triangle, work, slopes, scales, coordinates, trial, limits, own, .. } = self;
        let (size, width) = (*size, *size + 1);
        if !objective.triangle(triangle) {
            return None;
        }
        *own = objective.coordinates(parameters, coordinates);
        if *own {
            objective.parameters(coordinates, trial, Some(slopes));
            for (row, line) in triangle.chunks_exact(width).zip(work.chunks_exact_mut(width)) {
                for (column, value) in line[..size].iter_mut().enumerate() {
                    let slopes = slopes.iter().skip(column).step_by(size);
                    *value = row[..size].iter().zip(slopes).map(|(r, slope)| r * slope).sum();
                }
                line[size] = row[size];
            }
            triangle.copy_from_slice(&work[..size * width]);
        } else {
            coordinates.copy_from_slice(parameters);
        }
        for (column, scale) in scales.iter_mut().enumerate() {
            let entries = || (0..size).map(|row| row * width + column);
            let norm = entries().map(|place| triangle[place]).fold(0.0, f64::hypot);
            // A column of zeros stays one.
            *scale = if norm > 0.0 { norm } else { 1.0 };
            entries().for_each(|place| triangle[place] /= *scale);
        }
        triangularise(triangle, size, size);
        for (place, limits) in limits.iter_mut().enumerate() {
            *limits = [f64::NEG_INFINITY, f64::INFINITY];
            if *own && objective.is_curved(place) {
                let at =
                    |step: f64| (coordinates[place] + step).clamp(-FARTHEST, FARTHEST) - coordinates[place];
                *limits = [at(-LONGEST).min(0.0), at(LONGEST).max(0.0)].map(|step| step * scales[place]);
            }
        }
        for (column, right) in right.iter_mut().enumerate() {
            *right = triangle.chunks_exact(width).map(|row| row[column] * row[size]).sum();
        }
        self.solve_damped(SMALLEST_DAMPING, step);
        Some(self.predicted(1.0, step))
    }

    /// The step of this damping within the limits: coordinates that would leave these are held there, and the others
    /// solved for again.
    pub(super) fn solve_damped(&mut self, damping: f64, step: &mut [f64]) {
        let Self { size, triangle, work, limits, held, .. } = self;
        held.fill(false);
        loop {
            solve_damped(triangle, held, damping.max(SMALLEST_DAMPING), work, step);
            let mut left = false;
            for place in 0..*size {
                let within = step[place].clamp(limits[place][0], limits[place][1]);
                if !held[place] && within != step[place] {
                    (held[place], step[place], left) = (true, within, true);
                }
            }
            if !left {
                return;
            }
        }
    }

    /// The decrease of the cost that a fraction of a step predicts: |c|² - |c - T s|².
    fn predicted(&self, fraction: f64, step: &[f64]) -> f64 {
        let size = self.size;
        let rows = self.triangle.chunks_exact(size + 1);
        rows.map(|row| {
            let moved = fraction * row[..size].iter().zip(step).map(|(t, s)| t * s).sum::<f64>();
            moved * (2.0 * row[size] - moved)
        })
        .sum()
    }

    /// Where a fraction of the step leads, and the decrease of the cost that it predicts.
    pub(super) fn apply(
        &mut self,
        objective: &mut impl Objective,
        parameters: &[f64],
        fraction: f64,
        [step, trial, moved]: [&mut [f64]; 3],
    ) -> f64 {
        for (index, coordinate) in self.trial.iter_mut().enumerate() {
            *coordinate = self.coordinates[index] + fraction * step[index] / self.scales[index];
        }
        if self.own {
            objective.parameters(&self.trial, trial, None);
        } else {
            trial.copy_from_slice(&self.trial);
        }
        for ((moved, trial), from) in moved.iter_mut().zip(&*trial).zip(parameters) {
            *moved = trial - from;
        }
        self.predicted(fraction, step)
    }
}

/// Makes a matrix of `rows` rows of `columns` numbers and one more, the right-hand side, upper triangular by
/// Householder reflections (Golub and Van Loan, 4th ed. 2013, section 5.2.2). 2 rows columns² flops.
pub(super) fn triangularise(matrix: &mut [f64], rows: usize, columns: usize) {
    let width = columns + 1;
    for column in 0..columns.min(rows) {
        let norm = (column..rows).map(|row| matrix[row * width + column]).fold(0.0, f64::hypot);
        if norm == 0.0 {
            continue;
        }
        let head = matrix[column * width + column];
        // v = x + sign(x_1) |x| e_1, kept in the column that it makes zero; v'v = 2 |x| (|x| + |x_1|).
        let alpha = if head > 0.0 { -norm } else { norm };
        matrix[column * width + column] = head - alpha;
        let half = norm * (norm + head.abs());
        for other in column + 1..width {
            let product = |row: usize| matrix[row * width + column] * matrix[row * width + other];
            let share = (column..rows).map(product).sum::<f64>() / half;
            for row in column..rows {
                matrix[row * width + other] -= share * matrix[row * width + column];
            }
        }
        matrix[column * width + column] = alpha;
        (column + 1..rows).for_each(|row| matrix[row * width + column] = 0.0);
    }
}

/// The step of least |T step - right|² + damping |step|², T and its right-hand side standing in `triangle` as
/// [`triangularise`] leaves them; `work` holds two such. What is held stays, and what belongs to a column of zeros is
/// zero.
pub(super) fn solve_damped(
    triangle: &[f64],
    held: &[bool],
    damping: f64,
    work: &mut [f64],
    step: &mut [f64],
) {
    let size = held.len();
    let width = size + 1;
    let (own, below) = work.split_at_mut(size * width);
    for (line, row) in own.chunks_exact_mut(width).zip(triangle.chunks_exact(width)) {
        line.copy_from_slice(row);
        for place in (0..size).filter(|&place| held[place]) {
            line[size] -= line[place] * step[place];
            line[place] = 0.0;
        }
    }
    below.fill(0.0);
    (0..size).for_each(|row| below[row * width + row] = damping.sqrt());
    triangularise(work, 2 * size, size);
    for row in (0..size).rev().filter(|&row| !held[row]) {
        let line = &work[row * width..][..width];
        let others = (row + 1..size).filter(|&place| !held[place]);
        let known: f64 = others.map(|place| line[place] * step[place]).sum();
        let pivot = line[row];
        step[row] = if pivot == 0.0 { 0.0 } else { (line[size] - known) / pivot };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn it_is_least_squares_where_the_normal_equations_are_lost() {
        // Columns that differ by 1e-7 of them: squared, by less than rounding.
        let (rows, size) = (40, 4);
        let mut random = Random::of(3, 1);
        let truth = [1.0, -2.0, 3.0, -1.0];
        let mut matrix = Vec::new();
        for _ in 0..rows {
            let common = random.normal();
            let row: Vec<f64> =
                (0..size).map(|place| common + 1e-7 * place as f64 * random.normal()).collect();
            let output: f64 = row.iter().zip(truth).map(|(x, theta)| x * theta).sum();
            matrix.extend(row);
            matrix.push(output);
        }
        triangularise(&mut matrix, rows, size);
        let (mut work, mut step) = (vec![0.0; 2 * size * (size + 1)], vec![0.0; size]);
        solve_damped(&matrix[..size * (size + 1)], &vec![false; size], 0.0, &mut work, &mut step);
        for (found, truth) in step.iter().zip(truth) {
            assert!((found - truth).abs() < 1e-6, "{step:?}");
        }
        // Far more damping than there is in the columns: nothing moves.
        solve_damped(&matrix[..size * (size + 1)], &vec![false; size], 1e12, &mut work, &mut step);
        assert!(step.iter().all(|value| value.abs() < 1e-9), "{step:?}");
    }

    #[test]
    fn columns_of_zeros_have_no_step() {
        let mut matrix = vec![1.0, 0.0, 2.0, 0.0, 0.0, 0.0];
        triangularise(&mut matrix, 2, 2);
        let (mut work, mut step) = (vec![0.0; 12], vec![9.0; 2]);
        solve_damped(&matrix, &[false; 2], 0.0, &mut work, &mut step);
        assert_eq!(step[1], 0.0);
        assert!((step[0] - 2.0).abs() < 1e-15);
    }
}
