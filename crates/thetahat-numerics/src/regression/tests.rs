//! The regression against its definition: the matrix row by row, and double-double arithmetic.

mod double;
mod extended;

use std::ops::Range;

use thetahat_core::nalgebra::{DMatrix, DVector};

use super::gram::gram;
use super::{
    Lagged, Presample, Regression, Solver, Taps, Unsolved, differences, squares_above, sum, sum_above,
};
use crate::noise::Noise;
use double::Double;

/// A regression that owns its signals.
struct Case {
    signals: Vec<Vec<f64>>,
    taps: Vec<Taps>,
    segments: Vec<Range<usize>>,
    initial: Presample,
}

/// phi of ARX(na, nb, nk).
fn taps(na: usize, inputs: &[(usize, usize)]) -> Vec<Taps> {
    let input = |(position, &(count, first))| Taps { signal: position + 1, first, count, sign: 1.0 };
    let output = Taps { signal: 0, first: 1, count: na, sign: -1.0 };
    std::iter::once(output).chain(inputs.iter().enumerate().map(input)).collect()
}

/// One segment.
fn whole(length: usize) -> Vec<Range<usize>> {
    std::iter::once(0..length).collect()
}

impl Case {
    fn lagged(&self) -> Lagged<'_> {
        let signals: Vec<&[f64]> = self.signals.iter().map(Vec::as_slice).collect();
        Lagged::new(&signals, self.taps.clone(), &self.segments, self.initial)
    }

    /// Each row of the regressor matrix, and after it the target.
    fn rows(&self) -> Vec<Vec<f64>> {
        let used = || self.taps.iter().filter(|taps| taps.count > 0);
        let lag = used().map(|taps| taps.first + taps.count - 1).max().unwrap_or(0);
        let mut rows = Vec::new();
        for segment in &self.segments {
            let sample = |signal: usize, row: usize, lag: usize| match row.checked_sub(lag) {
                Some(at) if at >= segment.start => self.signals[signal][at],
                _ => 0.0,
            };
            for row in segment.clone() {
                if self.initial == Presample::Drop && row < segment.start + lag {
                    continue;
                }
                let mut values: Vec<f64> = used()
                    .flat_map(|taps| {
                        (taps.first..taps.first + taps.count)
                            .map(move |lag| taps.sign * sample(taps.signal, row, lag))
                    })
                    .collect();
                values.push(self.signals[0][row]);
                rows.push(values);
            }
        }
        rows
    }
}

/// What double-double arithmetic makes of a regression.
struct Reference {
    /// theta times the column norms.
    scaled: DVector<f64>,
    norms: DVector<f64>,
    /// |y|.
    target: f64,
    /// |y - Phi theta|.
    residual: f64,
    condition: f64,
}

impl Reference {
    /// Cholesky on columns of unit norm: good for condition numbers up to 1e14.
    fn new(rows: &[Vec<f64>]) -> Self {
        let size = rows[0].len() - 1;
        // Powers of two keep the squares inside the range.
        let scale: Vec<f64> = (0..=size)
            .map(|c| rows.iter().fold(0.0_f64, |largest, row| largest.max(row[c].abs())))
            .map(|largest| (-largest.log2().round()).exp2())
            .collect();
        let inner = |a: usize, b: usize| {
            rows.iter().fold(Double::default(), |sum, row| {
                sum + Double::product(row[a] * scale[a], row[b] * scale[b])
            })
        };
        let mut triangle = vec![vec![Double::default(); size + 1]; size];
        let norms: Vec<Double> = (0..size).map(|c| inner(c, c).sqrt()).collect();
        // R' R = G column by column, with R' z = Phi' y as a last column.
        for c in 0..=size {
            for r in 0..size.min(c + 1) {
                let mut value = inner(r, c) / norms[r];
                if c < size {
                    value = value / norms[c];
                }
                for row in &triangle[..r] {
                    value = value - row[r] * row[c];
                }
                triangle[r][c] = if r == c { value.sqrt() } else { value / triangle[r][r] };
            }
        }
        let mut solution = vec![Double::default(); size];
        for r in (0..size).rev() {
            let rest = (r + 1..size).fold(triangle[r][size], |rest, k| rest - triangle[r][k] * solution[k]);
            solution[r] = rest / triangle[r][r];
        }
        let squares = rows.iter().fold(Double::default(), |sum, row| {
            let start = Double::from(row[size] * scale[size]);
            let residual = (0..size)
                .fold(start, |rest, c| rest - solution[c] / norms[c] * Double::from(row[c] * scale[c]));
            sum + residual * residual
        });
        let triangle = DMatrix::from_fn(size, size, |r, c| triangle[r][c].value());
        let singular = triangle.singular_values();
        Self {
            scaled: DVector::from_fn(size, |c, _| solution[c].value() / scale[size]),
            norms: DVector::from_fn(size, |c, _| norms[c].value() / scale[c]),
            target: inner(size, size).sqrt().value() / scale[size],
            residual: squares.sqrt().value() / scale[size],
            condition: singular.max() / singular.min(),
        }
    }

    fn error(&self, parameters: &DVector<f64>) -> f64 {
        (parameters.component_mul(&self.norms) - &self.scaled).norm() / self.scaled.norm()
    }
}

/// The largest difference between the Gram matrix from lagged products and its definition, in units of the norms of
/// the two columns.
fn gram_error(case: &Case) -> f64 {
    let rows = case.rows();
    let lagged = case.lagged();
    let (matrix, right, square) = gram(&lagged);
    let size = right.len();
    assert_eq!(rows.len(), lagged.rows());
    let inner = |a: usize, b: usize| {
        rows.iter().fold(Double::default(), |sum, row| sum + Double::product(row[a], row[b])).value()
    };
    let norms: Vec<f64> = (0..=size).map(|c| inner(c, c).sqrt().max(f64::MIN_POSITIVE)).collect();
    let mut worst = 0.0_f64;
    for a in 0..=size {
        for b in 0..=size {
            let found = match (a == size, b == size) {
                (true, true) => square,
                (true, false) => right[b],
                (false, true) => right[a],
                (false, false) => matrix[(a, b)],
            };
            worst = worst.max((found - inner(a, b)).abs() / norms[a] / norms[b]);
        }
    }
    worst
}

#[test]
fn the_gram_matrix_of_any_segments_is_that_of_the_rows() {
    let mut noise = Noise(1);
    // Lengths of segments with a sample between them; the maximum lag of the orders below is 0 to 12.
    let cuts: [&[usize]; 5] = [&[1], &[40], &[1, 2, 30, 3, 7, 8, 9, 25], &[12, 13, 14, 24, 25, 26], &[5; 12]];
    for lengths in cuts {
        let mut end = 0;
        let segments: Vec<Range<usize>> = lengths
            .iter()
            .map(|length| {
                end += length + 1;
                end - 1 - length..end - 1
            })
            .collect();
        for (na, inputs) in [
            (2, vec![(2, 1)]),
            (0, vec![(3, 0)]),
            (3, vec![(0, 1)]),
            (1, vec![(1, 7), (4, 0)]),
            (5, vec![(6, 7), (0, 3), (2, 1)]),
            (0, vec![(1, 0)]),
            (9, vec![(9, 1)]),
        ] {
            for initial in [Presample::Drop, Presample::Zero] {
                let signals = (0..=inputs.len()).map(|_| noise.take(end)).collect();
                let case = Case { signals, taps: taps(na, &inputs), segments: segments.clone(), initial };
                assert!(gram_error(&case) < 1e-15, "{lengths:?} {na} {inputs:?} {initial:?}");
            }
        }
    }
}

#[test]
fn the_gram_matrix_of_long_signals_is_that_of_the_rows() {
    let mut noise = Noise(2);
    // Around the boundaries of blocks of 8192 samples.
    for (length, cut) in [(8190, 0), (8192 + 9, 5), (20_000, 8192), (20_000, 19_990)] {
        let case = Case {
            signals: vec![noise.take(length), noise.take(length)],
            taps: taps(2, &[(3, 7)]),
            segments: vec![0..cut, cut..length],
            initial: Presample::Drop,
        };
        assert!(gram_error(&case) < 1e-15, "{length} {cut}");
    }
}

#[test]
fn no_digits_are_lost_when_signals_grow() {
    let mut noise = Noise(3);
    let signals = (0..2).map(|_| (0..900).map(|t| 1.05_f64.powi(t) * noise.uniform()).collect()).collect();
    for segments in [whole(900), vec![0..30, 30..55, 60..900]] {
        let case = Case {
            signals: Clone::clone(&signals),
            taps: taps(6, &[(5, 3)]),
            segments,
            initial: Presample::Zero,
        };
        assert!(gram_error(&case) < 1e-15);
    }
}

/// y of ARX with these poles and B(q) = 1 + 0.5 q^-1, nk = 1.
fn output(poles: &[f64], u: &[f64], mut e: impl FnMut() -> f64) -> Vec<f64> {
    let a = poles.iter().fold(vec![1.0], |a: Vec<f64>, pole| {
        let delayed = [0.0].iter().chain(&a);
        a.iter().chain(&[0.0]).zip(delayed).map(|(now, before)| now - pole * before).collect()
    });
    let mut y: Vec<f64> = Vec::new();
    for t in 0..u.len() {
        let driven: f64 =
            [(1, 1.0), (2, 0.5)].iter().filter(|(l, _)| *l <= t).map(|(l, b)| b * u[t - l]).sum();
        let past: f64 = a.iter().skip(1).zip(y.iter().rev()).map(|(a, y)| a * y).sum();
        y.push(driven - past + e());
    }
    y
}

/// Regressions of which the condition numbers range from 1 to 1e10, with residuals of relative size `residual`.
fn hard_cases(residual: f64, noise: &mut Noise) -> Vec<Case> {
    let length = 300;
    let mut cases = Vec::new();
    let mut add = |signals: Vec<Vec<f64>>, taps| {
        let segments = vec![0..100, 103..length];
        cases.push(Case { signals, taps, segments, initial: Presample::Drop });
    };
    // Orthogonal regressors.
    let u = noise.take(length);
    add(vec![output(&[], &u, || residual * noise.uniform()), u], taps(0, &[(2, 1)]));
    // Two inputs that differ by little.
    for exponent in 0..11 {
        let u = noise.take(length);
        let near = u.iter().map(|u| u + 0.1_f64.powi(exponent) * noise.uniform()).collect();
        let y = output(&[0.5], &u, || residual * noise.uniform());
        add(vec![y, u, near], taps(1, &[(2, 1), (1, 1)]));
    }
    // A smooth input and slow poles: sampled too fast.
    for order in 1..5 {
        let mut u = noise.take(length);
        (1..length).for_each(|t| u[t] += 0.999 * u[t - 1]);
        add(vec![output(&vec![0.98; order], &u, || residual * noise.uniform()), u], taps(order, &[(2, 1)]));
    }
    // Offsets, in units small and large.
    for (exponent, unit) in (0..8).zip([1.0, 1e-30, 1e60].into_iter().cycle()) {
        let offset = 10_f64.powi(exponent);
        let u = noise.take(length);
        let mut y = output(&[0.9, 0.3], &u, || residual * noise.uniform());
        y.iter_mut().for_each(|y| *y = unit * (*y + offset));
        let u = u.iter().map(|u| u + offset).collect();
        add(vec![y, u], taps(2, &[(2, 1)]));
    }
    cases
}

#[test]
fn errors_stay_below_the_bound_of_householder() {
    let mut noise = Noise(4);
    let mut solvers = Vec::new();
    let mut conditions = Vec::new();
    for residual in [0.0, 1e-10, 1e-5, 1.0] {
        for case in hard_cases(residual, &mut noise) {
            let reference = Reference::new(&case.rows());
            let kappa = reference.condition;
            let bound =
                4.0 * f64::EPSILON * (kappa + kappa * kappa * reference.residual / reference.scaled.norm());
            let lagged = case.lagged();
            let solved = lagged.solve().unwrap();
            let alone = Regression::from_factor(&lagged.factor().unwrap()).unwrap();
            for solved in [&solved, &alone] {
                assert!(reference.error(&solved.parameters) < bound, "{:?} at {kappa:e}", solved.solver);
                assert!((0.5..1.05).contains(&(solved.condition / kappa)), "{} {kappa}", solved.condition);
                // Rounding moves the residuals by epsilons of y and of the largest terms of Phi theta.
                let scale = reference.target + reference.scaled.norm();
                let moved = (solved.residual_norm - reference.residual).abs();
                assert!(
                    moved < 8.0 * f64::EPSILON * scale,
                    "{} {}",
                    solved.residual_norm,
                    reference.residual
                );
            }
            let expected = if solved.condition > 5e6 { Solver::Qr } else { Solver::NormalEquations };
            assert_eq!(solved.solver, expected, "{kappa:e}");
            solvers.push(solved.solver);
            conditions.push(kappa);
        }
    }
    // Both solvers were at work, and the cases are as hard as they are meant to be.
    assert!(solvers.iter().filter(|solver| **solver == Solver::Qr).count() > 20);
    assert!(solvers.iter().filter(|solver| **solver == Solver::NormalEquations).count() > 40);
    assert!(conditions.iter().any(|kappa| *kappa < 1.2) && conditions.iter().any(|kappa| *kappa > 1e10));
}

#[test]
fn the_error_does_not_grow_with_the_rows() {
    let mut noise = Noise(5);
    let u = noise.take(100_000);
    let y = output(&[], &u, || 0.0);
    let case = Case {
        signals: vec![y, u],
        taps: taps(0, &[(2, 1)]),
        segments: whole(100_000),
        initial: Presample::Drop,
    };
    let lagged = case.lagged();
    for solved in [lagged.solve().unwrap(), Regression::from_factor(&lagged.factor().unwrap()).unwrap()] {
        let error = (solved.parameters - DVector::from_column_slice(&[1.0, 0.5])).norm();
        assert!(error < 4.0 * f64::EPSILON, "{error:e}");
    }
}

#[test]
fn a_factor_of_few_rows_is_one_to_go_on_from() {
    let mut noise = Noise(6);
    let case = |length: usize, noise: &mut Noise| Case {
        // The input begins with zeros: the first columns of the factor are empty.
        signals: vec![noise.take(length), [vec![0.0; 5], noise.take(length - 5)].concat()],
        taps: taps(2, &[(3, 1)]),
        segments: whole(length),
        initial: Presample::Drop,
    };
    for length in 5..14 {
        let case = case(length, &mut noise);
        let factor = case.lagged().factor().unwrap();
        assert_eq!(factor.rows(), length - 3);
        let (rows, triangle) = (case.rows(), factor.factor());
        let product = triangle.transpose() * triangle;
        for a in 0..5 {
            for b in 0..5 {
                let inner: f64 = rows.iter().map(|row| row[a] * row[b]).sum();
                assert!((product[(a, b)] - inner).abs() < 1e-14, "{length}");
            }
        }
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let mut noise = Noise(7);
    let length = 150_000;
    let u = noise.take(length);
    let y = output(&[0.9, 0.5], &u, || noise.uniform());
    let case = Case {
        signals: vec![y, u],
        taps: taps(2, &[(2, 1)]),
        segments: vec![0..70_001, 70_002..length],
        initial: Presample::Drop,
    };
    let results: Vec<_> = [1, 3]
        .into_iter()
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let lagged = case.lagged();
                let solved = lagged.solve().unwrap();
                (
                    solved.parameters,
                    solved.covariance,
                    solved.residual_norm,
                    lagged.factor().unwrap().factor(),
                )
            })
        })
        .collect();
    assert_eq!(results[0], results[1]);
}

#[test]
fn dependent_columns_are_named() {
    let mut noise = Noise(8);
    let length = 200;
    let (u, zero, one) = (noise.take(length), vec![0.0; length], vec![1.0; length]);
    let y = output(&[0.5], &u, || noise.uniform());
    let v = noise.take(length);
    let sum: Vec<f64> = u.iter().zip(&v).map(|(u, v)| u - 3.0 * v).collect();
    let deficient = |signals: Vec<&Vec<f64>>, taps: Vec<Taps>| {
        let case = Case {
            signals: signals.into_iter().cloned().collect(),
            taps,
            segments: whole(length),
            initial: Presample::Drop,
        };
        case.lagged().solve().unwrap_err()
    };
    let none = |columns: &[usize]| Unsolved::Deficient(columns.to_vec());
    assert_eq!(deficient(vec![&y, &zero], taps(1, &[(2, 1)])), none(&[1, 2]));
    assert_eq!(deficient(vec![&zero, &u], taps(2, &[(1, 1)])), none(&[0, 1]));
    assert_eq!(deficient(vec![&y, &one], taps(1, &[(3, 0)])), none(&[2, 3]));
    assert_eq!(deficient(vec![&y, &u, &u], taps(1, &[(2, 1), (2, 1)])), none(&[3, 4]));
    assert_eq!(deficient(vec![&y, &u, &y], taps(1, &[(1, 1), (1, 1)])), none(&[2]));
    // Of three columns of which each is a combination of the others, one has to go.
    let Unsolved::Deficient(columns) = deficient(vec![&y, &u, &v, &sum], taps(1, &[(1, 1), (1, 1), (1, 1)]))
    else {
        panic!("the samples are within range");
    };
    assert!(columns.len() == 1 && columns[0] > 0, "{columns:?}");
}

#[test]
fn sums_over_slices_are_sums_to_the_bit() {
    let mut noise = Noise(3);
    for length in [0, 1, 7, 8, 9, 1001] {
        let (x, mut y) = (noise.take(length), noise.take(length));
        let base = 0.3;
        assert_eq!(sum_above(&x, base).to_bits(), sum(x.iter().map(|x| x - base)).to_bits());
        assert_eq!(squares_above(&x, base).to_bits(), sum(x.iter().map(|x| (x - base).powi(2))).to_bits());
        let sizes = || x.iter().zip(&y).map(|(x, y)| (x - y).abs());
        let expected = [sum(sizes().map(|size| size.powi(2))), sum(sizes()), sizes().fold(0.0, f64::max)];
        assert_eq!(differences(&x, &y).map(f64::to_bits), expected.map(f64::to_bits));
        if length > 0 {
            y[length / 2] = f64::NAN;
            assert!(differences(&x, &y).into_iter().all(f64::is_nan));
        }
    }
}
