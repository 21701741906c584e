extern crate std;
use std::vec;
use std::vec::Vec;

use core::cmp::Ordering;

use super::{add_dyad, expand, project, update, variance};
use crate::Real;
use crate::noise::Noise;

/// P = U D U' from the factors in one square.
fn product<T: Real>(factor: &[T], n: usize) -> Vec<T> {
    let mut matrix = vec![T::zero(); n * n];
    expand(factor, &mut matrix, n);
    matrix
}

/// Random factors, D between 10^-`decades` and 1.
fn random_factor(noise: &mut Noise, n: usize, decades: f64) -> Vec<f64> {
    let mut factor = vec![0.0; n * n];
    for j in 0..n {
        for i in 0..=j {
            factor[j * n + i] =
                if i == j { 10_f64.powf(noise.next().abs() * -decades) } else { noise.next() };
        }
    }
    factor
}

fn random(noise: &mut Noise, count: usize) -> Vec<f64> {
    (0..count).map(|_| noise.next()).collect()
}

fn narrowed(numbers: &[f64]) -> Vec<f32> {
    numbers.iter().map(|&number| number as f32).collect()
}

fn widened<T: Real + Into<f64>>(numbers: &[T]) -> Vec<f64> {
    numbers.iter().map(|&number| number.into()).collect()
}

/// The largest difference of two covariance matrices, beside the variances of the two elements.
fn difference(a: &[f64], b: &[f64], n: usize) -> f64 {
    let mut largest = 0.0_f64;
    for j in 0..n {
        for i in 0..n {
            let scale = (b[i * n + i] * b[j * n + j]).sqrt();
            let change = (a[j * n + i] - b[j * n + i]).abs();
            if change > 0.0 {
                largest = largest.max(change / scale);
            }
        }
    }
    largest
}

fn update_by<T: Real>(factor: &mut [T], row: &[T], noise: T) -> (T, Vec<T>) {
    let (mut f, mut v) = (vec![T::zero(); row.len()], vec![T::zero(); row.len()]);
    let variance = project(factor, row, &mut f, &mut v, noise);
    update(factor, &mut f, &mut v, noise, T::one());
    (variance, v)
}

#[test]
fn a_scalar_update_is_the_textbook_formula() {
    let mut noise = Noise(1);
    for n in [1, 2, 3, 5, 8, 9] {
        for measurement_noise in [0.0, 1e-3, 1.0, 1e3] {
            let mut factor = random_factor(&mut noise, n, 2.0);
            let row = random(&mut noise, n);
            let given = product(&factor, n);
            let cross: Vec<f64> = (0..n).map(|i| (0..n).map(|j| given[j * n + i] * row[j]).sum()).collect();
            let expected: f64 =
                measurement_noise + row.iter().zip(&cross).map(|(row, cross)| row * cross).sum::<f64>();
            let (variance, gain) = update_by(&mut factor, &row, measurement_noise);
            assert!((variance - expected).abs() < 1e-14 * expected);
            let updated = product(&factor, n);
            for j in 0..n {
                assert!((gain[j] - cross[j]).abs() < 1e-14 * given.iter().fold(1.0, |a: f64, &b| a.max(b)));
                for i in 0..n {
                    let entry = given[j * n + i] - cross[i] * cross[j] / expected;
                    assert!((updated[j * n + i] - entry).abs() < 1e-13 * given[i * n + i].max(1.0));
                }
            }
        }
    }
}

#[test]
fn an_exact_measurement_leaves_no_variance_and_a_second_one_says_nothing() {
    let mut factor = vec![2.0_f64, 0.0, 0.0, 0.5, 3.0, 0.0, -0.3, 0.2, 1.0];
    let row = [0.0, 1.0, 0.0];
    let (first, _) = update_by(&mut factor, &row, 0.0);
    assert!(first > 3.0);
    let (second, gain) = update_by(&mut factor.clone(), &row, 0.0);
    assert!(second.abs() < 1e-30);
    assert!(gain.iter().all(|gain| gain.abs() < 1e-15));

    // Nothing is known less for being measured again, and what is known exactly stays so.
    let mut known = vec![0.0_f64; 4];
    let (variance, gain) = update_by(&mut known, &[1.0, 2.0], 0.0);
    assert_eq!((variance, gain), (0.0, vec![0.0; 2]));
    let (variance, gain) = update_by(&mut known, &[1.0, 2.0], 0.5);
    assert_eq!((variance, gain), (0.5, vec![0.0; 2]));
    assert_eq!(known, vec![0.0; 4]);
}

/// The factors of P + c v v' the slow way: the columns of U and v side by side, made orthogonal by modified weighted
/// Gram-Schmidt, as Thornton (1976) and Bierman (1977, section VI.4) print it.
fn add_dyad_slowly<T: Real>(factor: &[T], v: &[T], weight: T, n: usize) -> Vec<T> {
    let mut rows: Vec<Vec<T>> = v.iter().map(|&v| vec![v]).collect();
    let mut weights = vec![weight];
    for j in 0..n {
        for (i, row) in rows.iter_mut().enumerate() {
            row.push(match i.cmp(&j) {
                Ordering::Less => factor[j * n + i],
                Ordering::Equal => T::one(),
                Ordering::Greater => T::zero(),
            });
        }
        weights.push(variance(factor, n, j));
    }
    let mut sum = vec![T::zero(); n * n];
    for j in (0..n).rev() {
        let product = |a: &[T], b: &[T]| {
            a.iter().zip(b).zip(&weights).fold(T::zero(), |sum, ((&a, &b), &weight)| sum + a * weight * b)
        };
        let pivot = rows[j].clone();
        let norm = product(&pivot, &pivot);
        sum[j * n + j] = norm;
        for i in 0..j {
            let share = product(&rows[i], &pivot) / norm;
            sum[j * n + i] = share;
            for (entry, &pivot) in rows[i].iter_mut().zip(&pivot) {
                *entry -= share * pivot;
            }
        }
    }
    sum
}

#[test]
fn a_dyad_is_added() {
    let mut noise = Noise(5);
    for n in [1, 2, 4, 9] {
        let mut factor = random_factor(&mut noise, n, 3.0);
        let (v, given) = (random(&mut noise, n), product(&factor, n));
        add_dyad(&mut factor, &mut v.clone(), 0.7);
        let sum = product(&factor, n);
        for j in 0..n {
            for i in 0..n {
                assert!((sum[j * n + i] - (given[j * n + i] + 0.7 * v[i] * v[j])).abs() < 1e-14);
            }
        }
    }
    // Nothing is added: to the bit.
    let factor = random_factor(&mut noise, 3, 3.0);
    let mut same = factor.clone();
    add_dyad(&mut same, &mut [1.0, 2.0, 3.0], 0.0);
    assert_eq!(same, factor);
    add_dyad(&mut same, &mut [0.0; 3], 5.0);
    assert_eq!(same, factor);
}

#[test]
fn a_dyad_may_be_larger_than_all_there_is_by_any_factor() {
    // Pivots that grow by up to 10^24, under entries of U up to 10^6: where U_ij + s v' forgets the small pivots.
    let mut noise = Noise(6);
    let mut worst = [0.0_f64; 2];
    for case in 0..500 {
        let n = 2 + case % 6;
        let mut factor = random_factor(&mut noise, n, 18.0);
        for j in 0..n {
            for i in 0..j {
                factor[j * n + i] *= 10_f64.powf(3.0 + 3.0 * noise.next());
            }
        }
        let (mut factor, v) = (narrowed(&factor), narrowed(&random(&mut noise, n)));
        let exact = product(&add_dyad_slowly(&widened(&factor), &widened(&v), 1e6, n), n);
        let slow = add_dyad_slowly(&factor, &v, 1e6, n);
        add_dyad(&mut factor, &mut v.clone(), 1e6);
        assert!((0..n).all(|j| variance(&factor, n, j) > 0.0));
        for (worst, found) in worst.iter_mut().zip([&factor, &slow]) {
            *worst = worst.max(difference(&product(&widened(found), n), &exact, n));
        }
    }
    // Beside the variances, in epsilons of 1.2e-7: the slow way, in single precision too, is no better.
    std::println!("{worst:?}");
    assert!(worst[0] < 3e-6, "{worst:?}");
}
