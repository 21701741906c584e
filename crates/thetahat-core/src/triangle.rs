//! Kernels on an upper triangular factor R of n columns.
//!
//! R is a slice of n·n numbers, row after row, so that row i from its diagonal on is contiguous; what lies
//! below the diagonal is neither read nor written. Every access is total (`get`, slice patterns), and the
//! `else` branches that this leaves are never taken: with indexing instead, or with `step_by`, panics stay in
//! the firmware at opt-level z.

use crate::Real;

/// Steps of power and of inverse iteration. More gain nothing where singular values are well apart, and
/// little where they are close, as then any of them will do.
const ITERATIONS: usize = 20;

/// Row `index` from its diagonal on: n - index numbers.
pub(crate) fn row<T>(triangle: &[T], size: usize, index: usize) -> &[T] {
    triangle.get(index * size + index..(index + 1) * size).unwrap_or_default()
}

/// Row `index` from its diagonal on: n - index numbers.
fn row_mut<T>(triangle: &mut [T], size: usize, index: usize) -> &mut [T] {
    triangle.get_mut(index * size + index..(index + 1) * size).unwrap_or_default()
}

/// Column `index` of a square matrix stored column after column.
pub(crate) fn column<T>(columns: &[T], size: usize, index: usize) -> &[T] {
    columns.get(index * size..(index + 1) * size).unwrap_or_default()
}

/// Column `index` of a square matrix stored column after column.
pub(crate) fn column_mut<T>(columns: &mut [T], size: usize, index: usize) -> &mut [T] {
    columns.get_mut(index * size..(index + 1) * size).unwrap_or_default()
}

/// Entry (`index`, `index`) of a square matrix stored column after column.
pub(crate) fn diagonal_mut<T>(columns: &mut [T], size: usize, index: usize) -> Option<&mut T> {
    column_mut(columns, size, index).get_mut(index)
}

/// A sum that also keeps what rounding takes from it (Kahan 1965).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sum<T> {
    pub(crate) value: T,
    pub(crate) carry: T,
}

impl<T: Real> Sum<T> {
    pub(crate) fn new(value: T) -> Self {
        Sum { value, carry: T::zero() }
    }

    fn add(&mut self, term: T) {
        let term = term + self.carry;
        let value = self.value + term;
        self.carry = term - (value - self.value);
        self.value = value;
    }

    /// Replaces the sum a by sqrt(a² + b²), a not negative.
    pub(crate) fn lengthen(&mut self, b: T) {
        if !b.is_zero() {
            let rotation = Rotation::zeroing(self.value, b);
            self.add(b * rotation.half_tangent);
        }
    }
}

/// A plane rotation [c s; -s c], 0 <= c <= 1 (Givens), held as s and t = s / (1 + c): the sine, and the
/// tangent of half the angle.
///
/// Applied as it is written, (c a + s b, c b - s a), a long record goes wrong: after k rows c is about 1 -
/// 1/(2 k), its rounding does not average out, and the relative error of R grows as k times epsilon (1.6 %
/// after 10^6 rows in f32, measured). Rutishauser's form (1966), here as three shears, adds a small number to
/// a, with as many flops:
///
/// w = b - t a,   a' = a + s w,   b' = w - t a'
///
/// With a as a compensated sum, the error no longer grows with k at all.
struct Rotation<T> {
    sine: T,
    half_tangent: T,
}

impl<T: Real> Rotation<T> {
    /// The rotation that takes (a, b), b not 0, to (h, 0), where h = ±sqrt(a² + b²) has the sign of a.
    ///
    /// s = b / h, t = b / (a + h), and h = a + b t. Only ratios are squared (Golub and Van Loan, algorithm
    /// 5.1.3), so that nothing overflows that need not.
    fn zeroing(a: T, b: T) -> Self {
        let (larger, smaller) = (a.abs().max(b.abs()), a.abs().min(b.abs()));
        let ratio = smaller / larger;
        let length = larger * (T::one() + ratio * ratio).sqrt();
        let length = length.copysign(a);
        Rotation { sine: b / length, half_tangent: b / (a + length) }
    }

    fn apply(&self, a: &mut Sum<T>, b: &mut T) {
        let sheared = *b - self.half_tangent * a.value;
        a.add(self.sine * sheared);
        *b = sheared - self.half_tangent * a.value;
    }
}

/// Rotates a row, whose entries before `first` are 0, and its output into R and Q'y; returns what is left of
/// the output. The row is used up.
///
/// 5 (n - first)² flops, and for each entry a square root and three divisions.
pub(crate) fn fold_row<T: Real>(
    triangle: &mut [Sum<T>],
    rotated_output: &mut [Sum<T>],
    new_row: &mut [T],
    first: usize,
    mut output: T,
) -> T {
    let size = new_row.len();
    let targets = rotated_output.iter_mut().enumerate().skip(first);
    for (index, target) in targets {
        let [diagonal, rest @ ..] = row_mut(triangle, size, index) else {
            continue;
        };
        let Some([leading, new_rest @ ..]) = new_row.get_mut(index..) else {
            continue;
        };
        if leading.is_zero() {
            continue;
        }
        let rotation = Rotation::zeroing(diagonal.value, *leading);
        diagonal.add(*leading * rotation.half_tangent);
        for (a, b) in rest.iter_mut().zip(new_rest) {
            rotation.apply(a, b);
        }
        rotation.apply(target, &mut output);
    }
    output
}

/// The 2-norm, without overflow of the squares.
pub(crate) fn norm<'a, T: Real>(values: impl Iterator<Item = &'a T> + Clone) -> T {
    let largest = values.clone().fold(T::zero(), |largest, value| largest.max(value.abs()));
    if largest.is_zero() {
        return largest;
    }
    let sum = values.fold(T::zero(), |sum, &value| {
        let ratio = value / largest;
        sum + ratio * ratio
    });
    largest * sum.sqrt()
}

/// The sum of the products.
pub(crate) fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    a.iter().zip(b).fold(T::zero(), |sum, (&a, &b)| sum + a * b)
}

/// The norm of column `index`.
fn column_norm<T: Real>(triangle: &[T], size: usize, index: usize) -> T {
    norm((0..=index).filter_map(|row| triangle.get(row * size + index)))
}

/// x <- R x.
fn multiply<T: Real>(triangle: &[T], x: &mut [T]) {
    let size = x.len();
    for index in 0..size {
        let Some(tail) = x.get_mut(index..) else {
            return;
        };
        let product = dot(row(triangle, size, index), tail);
        if let [value, ..] = tail {
            *value = product;
        }
    }
}

/// x <- R' x.
fn multiply_transposed<T: Real>(triangle: &[T], x: &mut [T]) {
    let size = x.len();
    for index in (0..size).rev() {
        if let (Some([value, below @ ..]), [diagonal, rest @ ..]) =
            (x.get_mut(index..), row(triangle, size, index))
        {
            for (element, &entry) in below.iter_mut().zip(rest) {
                *element += entry * *value;
            }
            *value *= *diagonal;
        }
    }
}

/// What an entry of a triangle is worth.
pub(crate) trait Value<T>: Copy {
    fn value(self) -> T;
}

impl<T: Real> Value<T> for T {
    fn value(self) -> T {
        self
    }
}

impl<T: Real> Value<T> for Sum<T> {
    fn value(self) -> T {
        self.value
    }
}

/// The least share of a column's norm that is left once the columns before it are projected out: |r_jj| over the norm
/// of column j. 0 where a column is 0.
pub(crate) fn least_remainder<T: Real, E: Value<T>>(triangle: &[E], size: usize) -> T {
    (0..size).fold(T::one(), |least, index| {
        let column = (0..=index).filter_map(|row| triangle.get(row * size + index));
        let column = column.map(|entry| entry.value().abs());
        let largest = column.clone().fold(T::zero(), T::max);
        let diagonal = column.clone().last().unwrap_or(T::zero());
        if diagonal.is_zero() {
            return T::zero();
        }
        let sum = column.fold(T::zero(), |sum, entry| sum + (entry / largest) * (entry / largest));
        least.min(diagonal / largest / sum.sqrt())
    })
}

/// x <- R^-1 x, by back substitution: n² flops.
pub(crate) fn solve<T: Real, E: Value<T>>(triangle: &[E], x: &mut [T]) {
    let size = x.len();
    for index in (0..size).rev() {
        if let (Some([value, solved @ ..]), [diagonal, rest @ ..]) =
            (x.get_mut(index..), row(triangle, size, index))
        {
            let known = rest.iter().zip(&*solved).fold(T::zero(), |sum, (entry, &x)| sum + entry.value() * x);
            *value = (*value - known) / diagonal.value();
        }
    }
}

/// x <- R'^-1 x.
pub(crate) fn solve_transposed<T: Real, E: Value<T>>(triangle: &[E], x: &mut [T]) {
    let size = x.len();
    for index in 0..size {
        if let (Some([value, below @ ..]), [diagonal, rest @ ..]) =
            (x.get_mut(index..), row(triangle, size, index))
        {
            *value /= diagonal.value();
            for (element, entry) in below.iter_mut().zip(rest) {
                *element -= entry.value() * *value;
            }
        }
    }
}

/// Writes R^-1, upper triangular and row after row, into `inverse`, which holds zeros: n³/3 flops.
///
/// Row i of R^-1 is (e_i' - sum over k > i of r_ik times row k of R^-1) / r_ii.
pub(crate) fn invert<T: Real>(triangle: &[T], inverse: &mut [T], size: usize) {
    for index in (0..size).rev() {
        let Some((above, below)) = inverse.split_at_mut_checked((index + 1) * size) else {
            return;
        };
        let (target, [diagonal, rest @ ..]) = (row_mut(above, size, index), row(triangle, size, index))
        else {
            return;
        };
        if let [value, ..] = target {
            *value = T::one();
        }
        for (offset, &factor) in rest.iter().enumerate() {
            let Some(known) = below.get(offset * size + index + 1 + offset..(offset + 1) * size) else {
                return;
            };
            let shifted = target.get_mut(offset + 1..).unwrap_or_default();
            for (element, &entry) in shifted.iter_mut().zip(known) {
                *element -= factor * entry;
            }
        }
        for element in target {
            *element /= *diagonal;
        }
    }
}

/// Divides each column by its norm; a column of zeros stays.
pub(crate) fn equilibrate<T: Real>(triangle: &mut [T], size: usize) {
    for index in 0..size {
        let norm = column_norm(triangle, size, index);
        if norm.is_zero() {
            continue;
        }
        for row in 0..=index {
            if let Some(entry) = triangle.get_mut(row * size + index) {
                *entry /= norm;
            }
        }
    }
}

/// Marks a largest set of columns that are independent within `tolerance`, by triangularisation with column
/// pivoting (Businger and Golub 1965, with modified Gram-Schmidt in the place of reflections). `columns`
/// holds the n columns one after the other, each of unit norm or zero, and is used up.
///
/// At each step the column with the largest remainder is taken and its direction removed from those left,
/// until no remainder exceeds the tolerance. Of columns whose remainders are within one percent of the
/// largest, the first is taken, so that of two equal columns the later one is called dependent, whatever the
/// rounding. About 5 n³ flops.
pub(crate) fn mark_independent<T: Real>(
    columns: &mut [T],
    independent: &mut [bool],
    direction: &mut [T],
    tolerance: T,
) {
    let size = direction.len();
    let nearly = T::one() - T::one() / T::from_count(100);
    for _ in 0..size {
        let remainder = |&index: &usize| norm(column(columns, size, index).iter());
        let left = || (0..size).filter(|&index| independent.get(index) == Some(&false));
        let largest = left().fold(T::zero(), |largest, index| largest.max(remainder(&index)));
        if largest <= tolerance {
            return;
        }
        let Some(pivot) = left().find(|index| remainder(index) >= nearly * largest) else {
            return;
        };
        let length = remainder(&pivot);
        for (element, &entry) in direction.iter_mut().zip(column(columns, size, pivot)) {
            *element = entry / length;
        }
        if let Some(mark) = independent.get_mut(pivot) {
            *mark = true;
        }
        for (index, _) in independent.iter().enumerate().filter(|(_, taken)| !**taken) {
            let remaining = column_mut(columns, size, index);
            let share = dot(direction, remaining);
            for (entry, &element) in remaining.iter_mut().zip(&*direction) {
                *entry -= share * element;
            }
        }
    }
}

/// The condition number of R, by power iteration on R'R and inverse iteration with the triangle. `x` is
/// scratch.
pub(crate) fn condition<T: Real>(triangle: &[T], x: &mut [T]) -> T {
    let largest = growth(x, |x| multiply(triangle, x), |x| multiply_transposed(triangle, x));
    let inverse = growth(x, |x| solve_transposed(triangle, x), |x| solve(triangle, x));
    let product = largest * inverse;
    if product.is_finite() { product.max(T::one()) } else { T::INFINITY }
}

/// By how much a matrix lengthens the vector it lengthens most, from below: power iteration with the matrix
/// and its transpose. Infinity if that overflows.
fn growth<T: Real>(x: &mut [T], multiply: impl Fn(&mut [T]), multiply_transposed: impl Fn(&mut [T])) -> T {
    // An irregular start (the fractional parts of the multiples of the golden ratio, less 1/2): a regular one
    // may be orthogonal to the vector that is sought. That of (a, -a) is (1, -1).
    let golden = (T::from_count(5).sqrt() - T::one()) / T::from_count(2);
    let mut fraction = T::zero();
    for element in x.iter_mut() {
        fraction += golden;
        if fraction >= T::one() {
            fraction -= T::one();
        }
        *element = fraction - T::one() / T::from_count(2);
    }
    let mut longest = T::zero();
    for _ in 0..ITERATIONS {
        normalise(x);
        multiply(x);
        if !x.iter().all(T::is_finite) {
            return T::INFINITY;
        }
        longest = longest.max(normalise(x));
        multiply_transposed(x);
        if !x.iter().all(T::is_finite) {
            return T::INFINITY;
        }
    }
    longest
}

/// Scales `x` to unit norm, and returns the norm it had.
fn normalise<T: Real>(x: &mut [T]) -> T {
    let length = norm(x.iter());
    if !length.is_zero() {
        for element in x {
            *element /= length;
        }
    }
    length
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec;
    use std::vec::Vec;

    use super::{
        Rotation, Sum, column_norm, condition, equilibrate, fold_row, invert, mark_independent, multiply,
        multiply_transposed, norm, solve, solve_transposed,
    };
    use crate::noise::Noise;

    fn random_triangle(size: usize, noise: &mut Noise) -> Vec<f64> {
        let entry = |position| match (position / size, position % size) {
            (row, column) if row == column => 2.0 + noise.next(),
            (row, column) if row < column => noise.next(),
            _ => 0.0,
        };
        (0..size * size).map(entry).collect()
    }

    #[test]
    fn a_sum_keeps_what_rounding_takes() {
        let mut sum = Sum::new(1.0_f32);
        for _ in 0..1_000_000 {
            sum.add(1e-8);
        }
        assert!((sum.value - 1.01).abs() < 1e-7);
        for _ in 0..1_000_000 {
            sum.lengthen(1e-4);
        }
        assert!((sum.value - (1.01_f32 * 1.01 + 0.01).sqrt()).abs() < 2e-7);
    }

    #[test]
    fn a_length_neither_overflows_nor_vanishes() {
        for (a, b, expected) in [
            (4e30, -3e30, 5e30),
            (3e-30, 4e-30, 5e-30),
            (0.0, -2.0, 2.0),
            (2.0, 0.0, 2.0),
            (0.0, 0.0, 0.0_f32),
        ] {
            let mut sum = Sum::new(a);
            sum.lengthen(b);
            assert!((sum.value - expected).abs() <= expected * f32::EPSILON);
        }
    }

    #[test]
    fn a_rotation_zeroes_and_keeps_the_length() {
        let ends = [(3.0, 4.0), (3.0, -4.0), (-3.0, 4.0), (-3.0, -4.0), (4.0, 3.0)];
        for (a, b) in ends {
            for scale in [1e-300, 1.0, 1e300] {
                let rotation = Rotation::<f64>::zeroing(a * scale, b * scale);
                let (mut sum, mut rest) = (Sum::new(a * scale), b * scale);
                rotation.apply(&mut sum, &mut rest);
                assert!((sum.value / scale - 5.0_f64.copysign(a)).abs() < 2e-15);
                assert!((rest / scale).abs() < 2e-15);
            }
        }
    }

    #[test]
    fn the_first_row_is_copied_exactly() {
        let (mut triangle, mut rotated) = ([Sum::new(0.0); 9], [Sum::new(0.0); 3]);
        let rest = fold_row(&mut triangle, &mut rotated, &mut [-0.1, 0.7, 0.3], 0, 0.9);
        assert_eq!(triangle.map(|sum| sum.value), [0.1, -0.7, -0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!((rotated.map(|sum| sum.value), rest), ([-0.9, 0.0, 0.0], 0.0));
    }

    #[test]
    fn products_and_solves_undo_each_other() {
        let mut noise = Noise(1);
        for size in 0..9 {
            let triangle = random_triangle(size, &mut noise);
            let x: Vec<f64> = (0..size).map(|_| noise.next()).collect();
            let (mut there, mut back) = (x.clone(), x.clone());
            multiply(&triangle, &mut there);
            solve(&triangle, &mut there);
            multiply_transposed(&triangle, &mut back);
            solve_transposed(&triangle, &mut back);
            for (before, after) in x.iter().zip(there).chain(x.iter().zip(back)) {
                assert!((before - after).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn the_inverse_times_the_triangle_is_one() {
        let mut noise = Noise(2);
        for size in 0..9 {
            let triangle = random_triangle(size, &mut noise);
            let mut inverse = vec![0.0; size * size];
            invert(&triangle, &mut inverse, size);
            for i in 0..size {
                for j in 0..size {
                    let product: f64 =
                        (0..size).map(|k| triangle[i * size + k] * inverse[k * size + j]).sum();
                    let identity = if i == j { 1.0 } else { 0.0 };
                    assert!((product - identity).abs() < 1e-13);
                }
            }
        }
    }

    #[test]
    fn norms_neither_overflow_nor_vanish() {
        assert_eq!(norm([3e300, -4e300].iter()), 5e300);
        assert_eq!(norm([3e-300, 4e-300].iter()), 5e-300);
        assert_eq!(norm([0.0_f64; 3].iter()), 0.0);
        assert_eq!(norm([0.0_f64; 0].iter()), 0.0);
    }

    #[test]
    fn equilibrated_columns_have_unit_norm() {
        let mut triangle = random_triangle(5, &mut Noise(3));
        for (position, entry) in triangle.iter_mut().enumerate() {
            *entry *= [1e-200, 1.0, 0.0, 1e200, 7.0][position % 5];
        }
        equilibrate(&mut triangle, 5);
        for (index, expected) in [1.0, 1.0, 0.0, 1.0, 1.0].into_iter().enumerate() {
            assert!((column_norm(&triangle, 5, index) - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn of_equal_columns_the_first_is_kept() {
        let mut columns = [0.6, 0.8, 0.0, 0.6, 0.8, 0.0, 0.0, 0.0, 1.0];
        let mut independent = [false; 3];
        mark_independent(&mut columns, &mut independent, &mut [0.0; 3], 1e-15);
        assert_eq!(independent, [true, false, true]);
    }

    #[test]
    fn the_condition_is_the_ratio_of_the_singular_values() {
        let triangle = [8.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 2.0];
        assert!((condition(&triangle, &mut [0.0; 3]) - 16.0_f64).abs() < 1e-12);
        // Columns at an obtuse angle: (1, 1) is orthogonal to what is sought.
        let obtuse = [1.0, -0.6, 0.0, 0.8];
        assert!((condition(&obtuse, &mut [0.0; 2]) - 2.0_f64).abs() < 1e-12);
        let singular = [1.0, 1.0, 0.0, 0.0];
        assert_eq!(condition(&singular, &mut [0.0; 2]), f64::INFINITY);
        assert_eq!(condition::<f64>(&[], &mut []), 1.0);
    }
}
