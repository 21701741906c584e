//! Steps by orthogonal transformations in the coordinates of the objective, for normal equations that have lost what
//! tells their columns apart, and for regions with a boundary.

use super::objective::Objective;

/// Always there: directions in which the columns are nothing but rounding predict no decrease.
const SMALLEST_DAMPING: f64 = 1e-26;

/// How far a coordinate that is no parameter moves in a step, and how far it goes at all: beyond, rounding decides on
/// which side of the boundary the parameters are.
const LONGEST: f64 = 2.0;
const FARTHEST: f64 = 12.0;

/// Sets of held coordinates that are tried for each coordinate there is.
const SETS: usize = 3;

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
    solved: Vec<f64>,
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
            solved: line(),
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

    /// The least squares of this damping within the limits, by active sets (Lawson and Hanson, Solving Least Squares
    /// Problems, 1974, chapter 23; Stark and Parker, Computational Statistics 10, 1995): a step goes as far as the
    /// first limit, that coordinate is held there, and is let go again where the others have changed what it wants.
    pub(super) fn solve_damped(&mut self, damping: f64, step: &mut [f64]) {
        let Self { size, triangle, work, limits, held, solved, .. } = self;
        let damping = damping.max(SMALLEST_DAMPING);
        held.fill(false);
        step.fill(0.0);
        for _ in 0..SETS * *size {
            solved.copy_from_slice(step);
            solve_damped(triangle, held, damping, work, solved);
            // Which part of the way to its limit is within it.
            let within = |place: usize, from: f64| {
                let to = solved[place];
                let limit = to.clamp(limits[place][0], limits[place][1]);
                if to == limit { 1.0 } else { ((limit - from) / (to - from)).max(0.0) }
            };
            let part = (0..*size).map(|place| within(place, step[place])).fold(1.0, f64::min);
            for (place, step) in step.iter_mut().enumerate() {
                if part < 1.0 && within(place, *step) == part {
                    (*step, held[place]) = (solved[place].clamp(limits[place][0], limits[place][1]), true);
                } else {
                    *step += part * (solved[place] - *step);
                }
            }
            if part < 1.0 {
                continue;
            }
            // Of what is held, what wants to come back most.
            let inward = |place: usize| {
                let rows = triangle.chunks_exact(*size + 1);
                let left = |row: &[f64]| row[*size] - product(&row[..*size], step);
                let slope = rows.map(|row| row[place] * left(row)).sum::<f64>() - damping * step[place];
                if step[place] >= limits[place][1] { -slope } else { slope }
            };
            let most = (0..*size).filter(|&place| held[place]).map(|place| (inward(place), place));
            match most.max_by(|(one, _), (other, _)| one.total_cmp(other)) {
                Some((inward, place)) if inward > 0.0 => held[place] = false,
                _ => return,
            }
        }
    }

    /// The decrease of the cost that a fraction of a step predicts: |c|² - |c - T s|².
    fn predicted(&self, fraction: f64, step: &[f64]) -> f64 {
        let size = self.size;
        let rows = self.triangle.chunks_exact(size + 1);
        rows.map(|row| {
            let moved = fraction * product(&row[..size], step);
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

fn product(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(one, other)| one * other).sum()
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
    fn a_step_within_limits_is_the_best_there_is() {
        let (size, mut random) = (3, Random::of(5, 1));
        for _ in 0..200 {
            let mut orthogonal = Orthogonal::new(size);
            for row in 0..size {
                // Columns that are far from orthogonal: what is held changes what the others want.
                (row..=size).for_each(|column| {
                    orthogonal.triangle[row * (size + 1) + column] = random.normal() / (1 + 9 * row) as f64;
                });
            }
            orthogonal.limits = (0..size).map(|_| [-random.normal().abs(), random.normal().abs()]).collect();
            // Every set of held coordinates at every limit, of which the best that is within.
            let (mut work, mut best) = (vec![0.0; 2 * size * (size + 1)], 0.0_f64);
            for set in 0..27_usize {
                let state = |place: usize| set / 3_usize.pow(place as u32) % 3;
                let held: Vec<bool> = (0..size).map(|place| state(place) < 2).collect();
                let limit = |place: usize| orthogonal.limits[place][state(place).min(1)];
                let mut step: Vec<f64> = (0..size).map(limit).collect();
                solve_damped(&orthogonal.triangle, &held, SMALLEST_DAMPING, &mut work, &mut step);
                let mut each = step.iter().zip(&orthogonal.limits);
                if each.all(|(step, [low, high])| (*low..=*high).contains(step)) {
                    best = best.max(orthogonal.predicted(1.0, &step));
                }
            }
            let mut step = vec![0.0; size];
            orthogonal.solve_damped(0.0, &mut step);
            let found = orthogonal.predicted(1.0, &step);
            assert!((found - best).abs() <= 1e-9 * best, "{found} {best} {step:?}");
        }
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
