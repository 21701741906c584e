//! Exponentials and logarithms of matrices.

use thetahat_core::nalgebra::{Complex, ComplexField, DMatrix, DVector};

use super::eigen;

/// Norms up to this leave powers of a matrix, as its exponential needs them, in the range of numbers.
const LARGEST_NORM: f64 = 1e10;
/// Square roots after which a matrix that can come near I has done so.
const ROOTS: usize = 100;
/// So near I the quadrature below has all digits (Higham, Functions of Matrices, 2008, table 11.1).
const NEAR: f64 = 0.264;
/// Nodes and weights of Gauss and Legendre on 0 … 1.
const QUADRATURE: [(f64, f64); 7] = [
    (0.0254460438286207, 0.06474248308443487),
    (0.12923440720030277, 0.13985269574463843),
    (0.2970774243113014, 0.19091502525255935),
    (0.5, 0.20897959183673465),
    (0.7029225756886985, 0.19091502525255935),
    (0.8707655927996972, 0.13985269574463843),
    (0.9745539561713793, 0.06474248308443487),
];
/// What may be lost of a matrix that a logarithm is taken of, at most.
const LOST: f64 = 1e-9;
/// Padé's approximation of degree 13 has all digits to norms of powers of this (Al-Mohy and Higham 2009, table 3.1).
const PADE_NORM: f64 = 4.25;
/// Its coefficients from the power 0 on.
const PADE: [f64; 14] = [
    64764752532480000.0,
    32382376266240000.0,
    7771770303897600.0,
    1187353796428800.0,
    129060195264000.0,
    10559470521600.0,
    670442572800.0,
    33522128640.0,
    1323241920.0,
    40840800.0,
    960960.0,
    16380.0,
    182.0,
    1.0,
];
/// 27! (26 over 13), by which the first power that it misses is divided.
const FIRST_MISSED: f64 = 1.0888869450418352e28 * 10400600.0;
/// QR steps for each eigenvalue of a matrix.
const STEPS: usize = 60;

/// e^M and its integrals over a unit of time,
///
/// ```text
/// phi_0 = e^M,   phi_1 = sum M^k/(k+1)! = integral_0^1 e^(M s) ds,   phi_2 = sum M^k/(k+2)! = integral_0^1 (1 - s) e^(M s) ds
/// ```
///
/// which for X = M/2^s are the first row of blocks of exp [X I 0; 0 0 I; 0 0 0] (Van Loan, IEEE Trans. Automatic
/// Control 23, 1978), and from there on s times
///
/// ```text
/// phi_2(2X) = (phi_1(X)^2 + 2 phi_2(X))/4,   phi_1(2X) = (phi_0(X) + I) phi_1(X)/2,   phi_0(2X) = phi_0(X)^2
/// ```
///
/// (Higham, Functions of Matrices, 2008, section 10.7.4): squares of the blocks themselves would lose the integrals of
/// fast poles beside slow ones. None where they leave the range of numbers. O(n^3).
pub(super) fn integrals(matrix: &DMatrix<f64>) -> Option<[DMatrix<f64>; 3]> {
    let n = matrix.nrows();
    // The norm does not count what is not a number.
    if norm(matrix) > LARGEST_NORM || !matrix.iter().all(|value| value.is_finite()) {
        return None;
    }
    if n == 0 {
        return Some([matrix.clone(), matrix.clone(), matrix.clone()]);
    }
    // Once more, as the blocks beside X add to its norm.
    let halvings = halvings(matrix) + 1;
    let mut blocks = DMatrix::zeros(3 * n, 3 * n);
    blocks.view_mut((0, 0), (n, n)).copy_from(&(matrix * (-f64::from(halvings)).exp2()));
    blocks.view_mut((0, n), (n, n)).fill_with_identity();
    blocks.view_mut((n, 2 * n), (n, n)).fill_with_identity();
    let whole = pade(&blocks)?;
    let block = |index: usize| whole.view((0, index * n), (n, n)).into_owned();
    let [mut zero, mut first, mut second] = [block(0), block(1), block(2)];
    let identity = DMatrix::<f64>::identity(n, n);
    for _ in 0..halvings {
        second = (&first * &first + second * 2.0) * 0.25;
        first = (&zero + &identity) * first * 0.5;
        zero = &zero * &zero;
    }
    let found = [zero, first, second];
    found.iter().flat_map(|block| block.iter()).all(|value| value.is_finite()).then_some(found)
}

/// The largest sum of the moduli of a column.
fn norm<T: ComplexField<RealField = f64>>(matrix: &DMatrix<T>) -> f64 {
    let sums = matrix.column_iter().map(|column| column.iter().map(|value| value.clone().modulus()).sum());
    sums.fold(0.0, f64::max)
}

/// How often a matrix must be halved for [`pade`] to have all digits: no more than norms of its powers say (Al-Mohy and
/// Higham, SIAM J. Matrix Anal. Appl. 31, 2009, algorithm 5.1).
fn halvings(matrix: &DMatrix<f64>) -> u32 {
    let second = matrix * matrix;
    let fourth = &second * &second;
    let sixth = &second * &fourth;
    let root = |product: &DMatrix<f64>, power: f64| norm(product).powf(1.0 / power);
    let eighth = root(&(&fourth * &fourth), 8.0);
    let size = root(&sixth, 6.0).max(eighth).min(eighth.max(root(&(&fourth * &sixth), 10.0)));
    let halvings = (size / PADE_NORM).log2().ceil().max(0.0);
    // Where powers are small because entries cancel, those of the moduli say what rounding does.
    let moduli = matrix.abs() * (-halvings).exp2();
    let mut sums = DVector::from_element(matrix.nrows(), 1.0);
    (0..27).for_each(|_| sums = moduli.tr_mul(&sums));
    let missed = sums.max() / (FIRST_MISSED * norm(&moduli));
    let further =
        if missed > 0.0 { ((missed / (0.5 * f64::EPSILON)).log2() / 26.0).ceil().max(0.0) } else { 0.0 };
    (halvings + further) as u32
}

/// e^M of a small matrix by Padé's approximation of degree 13; none where it leaves the range of numbers.
fn pade(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let second = matrix * matrix;
    let fourth = &second * &second;
    let sixth = &second * &fourth;
    let identity = DMatrix::<f64>::identity(matrix.nrows(), matrix.nrows());
    let every_other = |first: usize| {
        let high = &sixth * PADE[first + 12] + &fourth * PADE[first + 10] + &second * PADE[first + 8];
        &sixth * high
            + &sixth * PADE[first + 6]
            + &fourth * PADE[first + 4]
            + &second * PADE[first + 2]
            + &identity * PADE[first]
    };
    let (odd, even) = (matrix * every_other(1), every_other(0));
    eigen::solved(&even - &odd, &(even + odd))
}

/// The principal logarithm of a matrix without eigenvalues at or left of 0: that with the imaginary parts of its
/// eigenvalues between -pi and pi.
///
/// By inverse scaling and squaring of the Schur form: roots are taken until T is near I, and then with X = T - I
///
/// ```text
/// log(I + X) = integral_0^1 X (I + s X)^-1 ds
/// ```
///
/// by Gauss and Legendre, which is Padé's approximation (Higham, Functions of Matrices, 2008, algorithm 11.9; roots of
/// triangular matrices by Björck and Hammarling, section 6.2). The diagonal is that of exact logarithms. None where the
/// exponential of what is found is not the matrix, as with eigenvalues that are almost negative. O(n^3) for each root,
/// of which 10 are common.
pub(super) fn logarithm(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = matrix.nrows();
    if n == 0 {
        return Some(matrix.clone());
    }
    // Turned first: QR steps from some matrices, permutations among them, lead back to them.
    let along = DVector::from_fn(n, |row, _| 1.0 + 0.37 * ((row * row + 3 * row) % 11) as f64);
    let (axis, _) = eigen::reflection(&along, 0)?;
    let mut turned = matrix.clone();
    eigen::reflect_rows(&mut turned, &axis);
    eigen::reflect_columns(&mut turned, &axis);
    let (q, triangle) =
        turned.map(|value| Complex::new(value, 0.0)).try_schur(f64::EPSILON, STEPS * n)?.unpack();
    let mut root = triangle.upper_triangle();
    let identity = DMatrix::<Complex<f64>>::identity(n, n);
    let mut squared = 1.0;
    for taken in 0.. {
        let apart = &root - &identity;
        if norm(&apart) <= NEAR {
            break;
        }
        if taken == ROOTS {
            return None;
        }
        root = square_root(&root);
        squared *= 2.0;
    }
    let apart = &root - &identity;
    let mut found = DMatrix::<Complex<f64>>::zeros(n, n);
    for (node, weight) in QUADRATURE {
        let system = &identity + &apart * Complex::new(node, 0.0);
        found += system.solve_upper_triangular(&apart)? * Complex::new(weight * squared, 0.0);
    }
    for index in 0..n {
        found[(index, index)] = ComplexField::ln(triangle[(index, index)]);
    }
    let mut found = (&q * found * q.adjoint()).map(|value| value.re);
    eigen::reflect_rows(&mut found, &axis);
    eigen::reflect_columns(&mut found, &axis);
    let [back, ..] = integrals(&found)?;
    ((back - matrix).norm() <= LOST * matrix.norm()).then_some(found)
}

/// The principal square root of an upper triangular matrix.
fn square_root(matrix: &DMatrix<Complex<f64>>) -> DMatrix<Complex<f64>> {
    let n = matrix.nrows();
    let mut root = DMatrix::zeros(n, n);
    for column in 0..n {
        root[(column, column)] = ComplexField::sqrt(matrix[(column, column)]);
        for row in (0..column).rev() {
            let between: Complex<f64> = (row + 1..column).map(|k| root[(row, k)] * root[(k, column)]).sum();
            root[(row, column)] =
                (matrix[(row, column)] - between) / (root[(row, row)] + root[(column, column)]);
        }
    }
    root
}

#[cfg(test)]
mod tests;
