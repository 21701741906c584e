//! Kernels on a factored covariance P = U D U', U unit upper triangular, D diagonal and not negative.
//!
//! Both live in one square, column after column: D on the diagonal, U above it; what lies below is neither
//! read nor written. D stays not negative by construction, in single precision too, where P itself, updated
//! as P - K H P or in Joseph's form, becomes indefinite (Bierman 1977, chapters V and VI).
//!
//! Every access is total (`get`), and the `else` branches that this leaves are never taken.

use crate::Real;
use crate::triangle::{column, column_mut};

/// Element `index`, which exists.
fn at<T: Real>(values: &[T], index: usize) -> T {
    values.get(index).copied().unwrap_or(T::zero())
}

/// D_jj.
pub(crate) fn variance<T: Real>(factor: &[T], size: usize, index: usize) -> T {
    at(factor, index * size + index)
}

/// U_ij, i < j.
pub(crate) fn entry<T: Real>(factor: &[T], size: usize, row: usize, index: usize) -> T {
    at(factor, index * size + row)
}

/// Whether U is the identity.
pub(crate) fn is_diagonal<T: Real>(factor: &[T], size: usize) -> bool {
    (1..size).all(|index| above(factor, size, index).iter().all(T::is_zero))
}

/// The column of U above its diagonal.
fn above<T: Real>(factor: &[T], size: usize, index: usize) -> &[T] {
    factor.get(index * size..index * size + index).unwrap_or_default()
}

/// Σ a_i b_i over the shorter of the two.
#[inline(always)]
pub(crate) fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    a.iter().zip(b).fold(T::zero(), |sum, (&a, &b)| sum + a * b)
}

/// Σ a_i b_i over the shorter of the two, as two sums, so that neither addition waits for the other. That is
/// quicker from about eight elements on.
#[inline(always)]
fn dot_in_pairs<T: Real>(a: &[T], b: &[T]) -> T {
    let length = a.len().min(b.len());
    let (a_pairs, a_rest) = a.get(..length).unwrap_or_default().as_chunks::<2>();
    let (b_pairs, b_rest) = b.get(..length).unwrap_or_default().as_chunks::<2>();
    let mut sums = [T::zero(); 2];
    for (a, b) in a_pairs.iter().zip(b_pairs) {
        for (sum, (&a, &b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    let [even, odd] = sums;
    even + odd + dot(a_rest, b_rest)
}

/// y <- y + factor x, over the shorter of the two.
pub(crate) fn add_multiple<T: Real>(y: &mut [T], factor: T, x: &[T]) {
    for (y, &x) in y.iter_mut().zip(x) {
        *y += factor * x;
    }
}

pub(crate) fn copy<T: Copy>(from: &[T], into: &mut [T]) {
    for (to, &from) in into.iter_mut().zip(from) {
        *to = from;
    }
}

/// Phase one of the update by a scalar measurement y = h'x + v, var v = `noise`: writes
///
/// ```text
/// f = U'h,   v = D f
/// ```
///
/// and returns the innovation variance h'P h + `noise`. Nothing of the filter changes, so that a sample that
/// is not finite can still be refused: it always shows in the returned variance, or in the innovation.
///
/// n²/2 + 3 n/2 multiply-adds.
#[inline(always)]
pub(crate) fn project<T: Real>(factor: &[T], row: &[T], f: &mut [T], v: &mut [T], noise: T) -> T {
    let size = row.len();
    let mut variance = noise;
    for (index, ((f, v), &h)) in f.iter_mut().zip(v).zip(row).enumerate() {
        let entries = column(factor, size, index);
        let known = entries.get(..index).unwrap_or_default();
        *f = h + if size < 8 { dot(known, row) } else { dot_in_pairs(known, row) };
        *v = at(entries, index) * *f;
        variance += *f * *v;
    }
    variance
}

/// Phase two: P <- `growth` (P - P h h'P / (h'P h + `noise`)); returns 1 / (h'P h + `noise`). Takes the f and v of
/// phase one; v becomes b, the gain times the innovation variance, so that x <- x + b e / (h'P h + `noise`). f is used
/// up.
///
/// ```text
/// a_0 = noise;   a_j = a_(j-1) + f_j v_j,   d_j <- d_j a_(j-1) / a_j,   p_j = -f_j / a_(j-1)
/// for i < j:   t = U_ij,   U_ij <- t + b_i p_j,   b_i <- b_i + t v_j;   b_j = v_j
/// ```
///
/// While a_j is 0 (an exact measurement of what is known) nothing is learnt. Where only a_(j-1) is 0, all b_i are 0, so
/// that p_j does not matter. What is next to 0 counts as 0, see [`clear_negligible`].
///
/// Row by row: the b of four rows stay in registers, where column by column each is loaded and stored n times. That
/// takes three quarters of the time from eight states on (measured).
///
/// n² + 5 n multiply-adds, n divisions.
///
/// Source: Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, section V.3.
#[inline(always)]
pub(crate) fn update<T: Real>(factor: &mut [T], f: &mut [T], v: &mut [T], noise: T, growth: T) -> T {
    const ROWS: usize = 4;
    let size = f.len();
    let least =
        if noise < nalgebra::convert(1e-12) { clear_negligible(f, v, noise) } else { T::MIN_POSITIVE };
    let (mut before, mut inverse) = (noise, reciprocal(noise, least));
    // D, and f becomes p.
    for (index, (f, &gain)) in f.iter_mut().zip(&*v).enumerate() {
        let after = before + *f * gain;
        *f = -*f * inverse;
        inverse = reciprocal(after, least);
        if let Some(diagonal) = column_mut(factor, size, index).get_mut(index) {
            *diagonal *= growth;
            if after > before {
                *diagonal *= before * inverse;
            }
        }
        before = after;
    }
    let whole = size - size % ROWS;
    for first in (0..size / ROWS).map(|block| block * ROWS) {
        update_rows::<T, ROWS>(factor, f, v, first);
    }
    for first in whole..size {
        update_rows::<T, 1>(factor, f, v, first);
    }
    inverse
}

/// For [`update`] with little noise: returns the least a_j that it can use, and clears f_j and v_j as long as a_j is
/// below it. Then all b_i are 0 at the first a_j that is not, so that p_j does not matter there.
///
/// That is MIN_POSITIVE max(1, f²). Below it, p_j may overflow, or d_j of a large f_j vanish beside a large U_ij,
/// and the variance of element i with them. What is cleared changes no variance by more than MIN_POSITIVE.
#[inline(never)]
fn clear_negligible<T: Real>(f: &mut [T], v: &mut [T], noise: T) -> T {
    let mut largest = T::one();
    for (f, v) in f.iter_mut().zip(&*v) {
        if v.is_zero() {
            *f = T::zero();
        }
        if f.abs() > largest {
            largest = f.abs();
        }
    }
    let least = T::MIN_POSITIVE * largest * largest;
    let mut sum = noise;
    for (f, v) in f.iter_mut().zip(v) {
        sum += *f * *v;
        if sum >= least {
            break;
        }
        (*f, *v) = (T::zero(), T::zero());
    }
    least
}

/// The entries of U in `ROWS` rows from `first` on, and their b, for [`update`]. What v holds for the rows
/// after them is still v.
#[inline(always)]
fn update_rows<T: Real, const ROWS: usize>(factor: &mut [T], p: &[T], v: &mut [T], first: usize) {
    let size = p.len();
    let mut b = [T::zero(); ROWS];
    for (k, b) in b.iter_mut().enumerate() {
        *b = at(v, first + k);
    }
    // The corner above the diagonal, then whole columns of the rows.
    for index in first + 1..first + ROWS {
        let (p, gain) = (at(p, index), at(v, index));
        if let Some(entries) = column_mut(factor, size, index).get_mut(first..index) {
            exchange(entries, &mut b, p, gain);
        }
    }
    for index in first + ROWS..size {
        let (p, gain) = (at(p, index), at(v, index));
        let entries =
            column_mut(factor, size, index).get_mut(first..).and_then(|rest| rest.first_chunk_mut::<ROWS>());
        if let Some(entries) = entries {
            exchange(entries, &mut b, p, gain);
        }
    }
    if let Some(target) = v.get_mut(first..).and_then(|rest| rest.first_chunk_mut::<ROWS>()) {
        *target = b;
    }
}

/// U_ij <- t + b_i p_j, b_i <- b_i + t v_j, where t is the old U_ij, for some rows i of one column j.
#[inline(always)]
fn exchange<T: Real>(entries: &mut [T], b: &mut [T], p: T, v: T) {
    for (entry, b) in entries.iter_mut().zip(b) {
        let given = *entry;
        *entry = given + *b * p;
        *b += given * v;
    }
}

/// 1 / x, or 0 below `least`, which is at least MIN_POSITIVE.
#[inline(always)]
fn reciprocal<T: Real>(x: T, least: T) -> T {
    if x >= least { T::one() / x } else { T::zero() }
}

/// P <- P + `weight` v v', `weight` not negative. `v` is used up. n² to 2 n² multiply-adds, n divisions.
///
/// ```text
/// for j = n … 1:   d_j' = d_j + c v_j²,   s = c v_j / d_j';
///                  for i < j:   v_i' = v_i - v_j U_ij,   U_ij <- U_ij + s v_i',
///                               or, the same, U_ij <- U_ij d_j / d_j' + s v_i;   c <- c d_j / d_j'
/// ```
///
/// The second form serves where d_j grows much: the first would add and subtract the old U_ij, which may be
/// large if d_j was small. So no row of the result is off by more than rounding in that row.
///
/// Source: Agee and Turner, Triangular decomposition of a positive definite matrix plus a symmetric dyad with
/// applications to Kalman filtering, 1972; Gill, Golub, Murray and Saunders, Methods for modifying matrix
/// factorizations, 1974, method C1 (the two forms).
#[inline(never)]
pub(crate) fn add_dyad<T: Real>(factor: &mut [T], v: &mut [T], mut weight: T) {
    let size = v.len();
    for index in (0..size).rev() {
        let Some((v, [pivot, ..])) = v.split_at_mut_checked(index) else {
            return;
        };
        let Some((entries, [diagonal, ..])) = column_mut(factor, size, index).split_at_mut_checked(index)
        else {
            return;
        };
        let after = *diagonal + weight * *pivot * *pivot;
        if after < T::MIN_POSITIVE {
            continue;
        }
        let inverse = reciprocal(after, T::MIN_POSITIVE);
        let (scale, kept) = (weight * *pivot * inverse, *diagonal * inverse);
        if kept < nalgebra::convert(0.25) {
            for (entry, v) in entries.iter_mut().zip(v) {
                let given = *v;
                *v -= *pivot * *entry;
                *entry = kept * *entry + scale * given;
            }
        } else {
            for (entry, v) in entries.iter_mut().zip(v) {
                *v -= *pivot * *entry;
                *entry += scale * *v;
            }
        }
        weight *= kept;
        *diagonal = after;
    }
}

/// Writes column `index` of A U into `target`: A has as many rows as `target`, U is `size` x `size`.
#[inline(always)]
pub(crate) fn multiply_column<T: Real>(
    matrix: &[T],
    factor: &[T],
    target: &mut [T],
    size: usize,
    index: usize,
) {
    let rows = target.len();
    copy(column(matrix, rows, index), target);
    for (i, &entry) in above(factor, size, index).iter().enumerate() {
        add_multiple(target, entry, column(matrix, rows, i));
    }
}

/// P_jj = Σ over k >= j of D_k U_jk².
pub(crate) fn diagonal<T: Real>(factor: &[T], size: usize, index: usize) -> T {
    (index + 1..size).fold(variance(factor, size, index), |sum, k| {
        let entry = at(column(factor, size, k), index);
        sum + variance(factor, size, k) * entry * entry
    })
}

/// Writes `scale` P_jj for every j into `target`: the same sums, column by column. n² multiply-adds.
#[inline(always)]
pub(crate) fn diagonals<T: Real>(factor: &[T], scale: T, target: &mut [T]) {
    target.fill(T::zero());
    for k in 0..target.len() {
        add_squares(factor, scale, k, target);
    }
}

/// Adds what column k of U makes of `scale` P_jj, for every j.
#[inline(always)]
pub(crate) fn add_squares<T: Real>(factor: &[T], scale: T, k: usize, target: &mut [T]) {
    let size = target.len();
    let weight = variance(factor, size, k) * scale;
    let Some((before, [diagonal, ..])) = target.split_at_mut_checked(k) else { return };
    for (sum, &entry) in before.iter_mut().zip(above(factor, size, k)) {
        *sum += weight * entry * entry;
    }
    *diagonal += weight;
}

/// Writes P into `matrix`: the upper half column by column, then its mirror image. n³/6 multiply-adds; from four states
/// on none for a column of U that is 0 above its diagonal.
///
/// ```text
/// P_ij = Σ over k >= j of D_k U_jk U_ik,   i <= j
/// ```
#[inline(always)]
pub(crate) fn expand<T: Real>(factor: &[T], matrix: &mut [T], size: usize) {
    matrix.fill(T::zero());
    for k in 0..size {
        let (weight, entries) = (variance(factor, size, k), above(factor, size, k));
        // Up to three states, to look costs more than it saves.
        if size <= 3 || !entries.iter().all(T::is_zero) {
            for (index, &entry) in entries.iter().enumerate() {
                add_multiple(upper_mut(matrix, size, index), weight * entry, entries);
            }
            add_multiple(upper_mut(matrix, size, k), weight, entries);
        }
        if let Some(diagonal) = matrix.get_mut(k * size + k) {
            *diagonal += weight;
        }
    }
    for index in 1..size {
        for row in 0..index {
            let value = entry(matrix, size, row, index);
            if let Some(target) = matrix.get_mut(row * size + index) {
                *target = value;
            }
        }
    }
}

/// Whether U, D and the variances, the diagonal of P, are finite. (What is not among U and D shows in the variances, as
/// nothing in those sums is negative.)
#[inline(never)]
pub(crate) fn has_finite_variances<T: Real>(factor: &[T], size: usize) -> bool {
    (0..size).all(|index| diagonal(factor, size, index).is_finite())
}

/// Whether U and D are finite.
pub(crate) fn is_finite<T: Real>(factor: &[T], size: usize) -> bool {
    (0..size).all(|index| upper(factor, size, index).iter().all(T::is_finite))
}

/// The time update P <- F P F' + Q, the quick way: F U D U'F' + Q is formed and factored. False, with `factor`
/// unchanged, if a pivot falls below a thousandth of its variance, or P is next to overflow: what cancels there would
/// cost definiteness, at the first step after a bad prior. Then [`propagate_by_columns`] does it.
///
/// `columns` and `work`, n x n each, `sum` and `given`, n each, are scratch. Each column is added up in `sum`,
/// which a compiler can keep in registers: that halves the time. 3/2 n³ multiply-adds and n divisions.
#[inline(always)]
pub(crate) fn propagate<T: Real>(
    factor: &mut [T],
    state_matrix: &[T],
    noise_matrix: &[T],
    [columns, work]: [&mut [T]; 2],
    [sum, given]: [&mut [T]; 2],
) -> bool {
    let size = sum.len();
    for index in 0..size {
        multiply_column(state_matrix, factor, sum, size, index);
        copy(sum, column_mut(columns, size, index));
    }
    // Of the left half of P the upper half will do.
    let half = (size.div_ceil(4) * 2).min(size);
    let upper_half = sum.get_mut(..half).unwrap_or_default();
    propagate_columns(factor, noise_matrix, columns, work, upper_half, size, 0..half);
    propagate_columns(factor, noise_matrix, columns, work, sum, size, half..size);
    let accepted = decompose(work, given, size, nalgebra::convert(1e-3));
    if accepted {
        copy(work, factor);
    }
    accepted
}

/// Of `propagate`: as many entries of the columns `range` of Q + Σ D_k (F U)_k (F U)_k' as `sum` has.
#[inline(always)]
fn propagate_columns<T: Real>(
    factor: &[T],
    noise_matrix: &[T],
    columns: &[T],
    work: &mut [T],
    sum: &mut [T],
    size: usize,
    range: core::ops::Range<usize>,
) {
    for index in range {
        copy(column(noise_matrix, size, index), sum);
        for k in 0..size {
            let entries = column(columns, size, k);
            add_multiple(sum, variance(factor, size, k) * at(entries, index), entries);
        }
        copy(sum, column_mut(work, size, index));
    }
}

/// The time update P <- F P F' + Q = Q + Σ D_k (F U)_k (F U)_k', the safe way: the columns of F U are added to
/// the factor of Q one by one. Nothing is subtracted from a variance, so that nothing cancels. False, with
/// `factor` unchanged, if P is not finite.
///
/// `work`, n x n, and `product`, n, are scratch. 3/2 n³ multiply-adds and n² divisions. (The usual way is
/// Thornton's Gram-Schmidt orthogonalisation, 1976, which takes twice the work.)
#[cold]
#[inline(never)]
pub(crate) fn propagate_by_columns<T: Real>(
    factor: &mut [T],
    state_matrix: &[T],
    noise_factor: &[T],
    work: &mut [T],
    product: &mut [T],
) -> bool {
    let size = product.len();
    copy(noise_factor, work);
    for index in 0..size {
        multiply_column(state_matrix, factor, product, size, index);
        add_dyad(work, product, variance(factor, size, index));
    }
    let finite = has_finite_variances(work, size);
    if finite {
        copy(work, factor);
    }
    finite
}

/// The column of U above its diagonal.
#[inline(always)]
fn above_mut<T>(factor: &mut [T], size: usize, index: usize) -> &mut [T] {
    factor.get_mut(index * size..index * size + index).unwrap_or_default()
}

/// Column `index` of an upper half, the diagonal included.
#[inline(always)]
fn upper<T>(matrix: &[T], size: usize, index: usize) -> &[T] {
    matrix.get(index * size..=index * size + index).unwrap_or_default()
}

/// Column `index` of an upper half, the diagonal included.
#[inline(always)]
fn upper_mut<T>(matrix: &mut [T], size: usize, index: usize) -> &mut [T] {
    matrix.get_mut(index * size..=index * size + index).unwrap_or_default()
}

/// Factors the symmetric matrix whose upper half is in `matrix`, in place. False as soon as a pivot is not
/// above `least` times its diagonal entry, or that is next to overflow: `matrix` is then of no use. `given` has room
/// for the diagonal.
///
/// ```text
/// for j = n … 1:   d_j = P_jj;   for k < j:   P_ik <- P_ik - P_ij P_kj / d_j,   i <= k;   U_ij = P_ij / d_j
/// ```
///
/// n³/6 multiply-adds, n divisions.
///
/// Source: Bierman 1977, section III.3 (the Cholesky decomposition without square roots, upper triangular).
#[inline(always)]
pub(crate) fn decompose<T: Real>(matrix: &mut [T], given: &mut [T], size: usize, least: T) -> bool {
    for (index, given) in given.iter_mut().enumerate() {
        *given = variance(matrix, size, index);
    }
    for done in 0..size {
        let index = size - 1 - done;
        let (pivot, given) = (variance(matrix, size, index), at(given, index));
        if !(pivot > least * given && pivot >= T::MIN_POSITIVE && given + given < T::INFINITY) {
            return false;
        }
        let inverse = T::one() / pivot;
        let Some((before, rest)) = matrix.split_at_mut_checked(index * size) else {
            return false;
        };
        let current = column(rest, size, 0);
        for k in 0..index {
            add_multiple(upper_mut(before, size, k), -(at(current, k) * inverse), current);
        }
        scale_column(matrix, size, index, inverse);
    }
    true
}

/// Multiplies column `index` above its diagonal.
#[inline(always)]
fn scale_column<T: Real>(matrix: &mut [T], size: usize, index: usize, factor: T) {
    for entry in above_mut(matrix, size, index) {
        *entry *= factor;
    }
}

/// Writes column `index` of U, its diagonal of ones included, into `target`, which holds zeros.
pub(crate) fn unit_column<T: Real>(factor: &[T], target: &mut [T], index: usize) {
    copy(above(factor, target.len(), index), target);
    if let Some(diagonal) = target.get_mut(index) {
        *diagonal = T::one();
    }
}

#[cfg(test)]
mod tests;
