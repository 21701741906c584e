//! Models of fewer states by balanced truncation.

use thetahat_core::nalgebra::{Cholesky, ComplexField, DMatrix, SymmetricEigen};

use super::{StateSpace, eigen};
use crate::{Error, figures};

/// Poles of larger modulus are kept: they last for 10^5 samples, or grow.
const LASTING: f64 = 1.0 - 1e-5;
/// Doublings after which a sum that exists has converged.
const DOUBLINGS: usize = 60;
/// Newton steps after which the sign of a matrix is known.
const STEPS: usize = 100;

/// A model of fewer states, and what that costs.
#[derive(Debug, Clone, PartialEq)]
pub struct Reduced {
    /// The model. Its states are balanced, the most important first, after those of poles that are kept.
    pub model: StateSpace,
    /// An upper bound of what the truncation does to the frequency response from [u; e], e in units of its deviation,
    /// to y: of the largest singular value of the difference at any frequency, in the units of y by those of u. It is
    /// twice the sum of the Hankel singular values that are left out. No model with so many states has a difference
    /// below the first of them.
    pub error_bound: f64,
}

/// Coordinates x = `right` z, z = `left` x.
struct Coordinates {
    right: DMatrix<f64>,
    left: DMatrix<f64>,
}

/// Balanced coordinates of a model.
struct Balance {
    /// Those of the poles that are kept.
    lasting: Coordinates,
    /// Those of the others.
    decaying: Coordinates,
    /// Of the others, falling; one for each state.
    singular_values: Vec<f64>,
}

impl StateSpace {
    /// The Hankel singular values of the model, falling: how much of its inputs each state in balanced coordinates
    /// passes on to its outputs. Infinity for each pole that is kept; zero, or rounding, for states that are not
    /// needed.
    ///
    /// [`StateSpace::reduced`] has the equations. O(n^3).
    ///
    /// # Errors
    /// [`Error::Argument`] for matrices whose shapes do not fit, or that are not finite; [`Error::Undetermined`] where
    /// a decomposition does not converge.
    ///
    /// ```
    /// use thetahat::model::StateSpace;
    /// use thetahat::thetahat_core::nalgebra::DMatrix;
    ///
    /// // A pole at 0.9, and one at 0.5 that nothing moves.
    /// let model = StateSpace {
    ///     f: DMatrix::from_row_slice(2, 2, &[0.9, 0.0, 0.0, 0.5]),
    ///     g: DMatrix::from_row_slice(2, 1, &[1.0, 0.0]),
    ///     h: DMatrix::from_row_slice(1, 2, &[1.0, 1.0]),
    ///     d: DMatrix::zeros(1, 1),
    ///     k: DMatrix::zeros(2, 1),
    ///     noise_covariance: DMatrix::from_element(1, 1, 1.0),
    ///     sample_time: 1.0,
    /// };
    /// let values = model.hankel_singular_values()?;
    /// assert!(values[0] > 1.0 && values[1] < 1e-12);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn hankel_singular_values(&self) -> Result<Vec<f64>, Error> {
        let balance = self.balance()?;
        let mut values = vec![f64::INFINITY; balance.lasting.left.nrows()];
        values.extend(balance.singular_values);
        Ok(values)
    }

    /// The same model in balanced coordinates, without the states that are not needed: both its Gramians are the
    /// diagonal matrix of its Hankel singular values. O(n^3).
    ///
    /// # Errors
    /// Those of [`StateSpace::reduced`].
    pub fn balanced(&self) -> Result<Self, Error> {
        let balance = self.balance()?;
        let needed = balance.needed();
        self.truncated(&balance, needed)
    }

    /// The model with so many states by balanced truncation.
    ///
    /// The inputs are u and e together, e in units of its deviation, W(z) = H (z I - F)^-1 B + [D, L] with B = [G, K L]
    /// and L L' = noise_covariance: a state that predictions need is as important as one that the inputs move. The
    /// Gramians
    ///
    /// ```text
    /// P = F P F' + B B'   (how far inputs of unit energy move a state),   Q = F' Q F + H' H   (the energy of the outputs of a state)
    /// ```
    ///
    /// are computed as roots, P = S S' and Q = R R', by doubling with a QR decomposition each time, so that the small
    /// ones keep their digits:
    ///
    /// ```text
    /// S_{i+1} = [S_i, F_i S_i],   F_{i+1} = F_i^2,   S_0 = B
    /// ```
    ///
    /// (Smith, SIAM J. Applied Math. 16, 1968; Penzl, SIAM J. Sci. Comput. 21, 2000). With R' S = U Sigma V' and the
    /// first r columns of each, x = S V Sigma^-½ z and z = Sigma^-½ U' R' x: both Gramians of z are Sigma, the Hankel
    /// singular values (Moore, IEEE Trans. Automatic Control 26, 1981; Tombs and Postlethwaite, Int. J. Control 46,
    /// 1987). What is left out changes W by no more than twice their sum (Enns 1984; Glover, Int. J. Control 39, 1984;
    /// for samples Al-Saggaf and Franklin, IEEE Trans. Automatic Control 32, 1987), and what is left is stable (Pernebo
    /// and Silverman, IEEE Trans. Automatic Control 27, 1982). The part of u alone obeys the same bound. The static
    /// gain changes within it too.
    ///
    /// Integrators, unstable poles, and poles of a modulus above 1 - 10^-5 have no Gramians: they are kept as they are,
    /// split from the others by the sign of a matrix (Roberts, Int. J. Control 32, 1980), and count among the states.
    ///
    /// Where truncation leaves an unstable predictor F - K H, K and noise_covariance are replaced by those of the
    /// stable one whose noise has the same spectrum. With A = F - K H, and A_u and H_u what A and H are on its unstable
    /// subspace V:
    ///
    /// ```text
    /// A_u' Y A_u = Y + H_u' R^-1 H_u,   P = V Y^-1 V',   innovations of cov M = H P H' + R,   K + A P H' M^-1,   R = noise_covariance
    /// ```
    ///
    /// (Anderson and Moore, Optimal Filtering, 1979, section 9.3: P is the stabilising solution of the Riccati equation
    /// of the filter.) The bound is that of the noise before. O(n^3).
    ///
    /// # Errors
    /// [`Error::Argument`] for an order below the number of poles that are kept or above that of the states that are
    /// needed, matrices whose shapes do not fit or that are not finite; [`Error::Undetermined`] where a decomposition
    /// does not converge, or no predictor is stable.
    ///
    /// ```
    /// use thetahat::model::StateSpace;
    /// use thetahat::thetahat_core::nalgebra::DMatrix;
    ///
    /// // Poles at 0.9 and 0.1, of which the first does nearly all.
    /// let model = StateSpace {
    ///     f: DMatrix::from_row_slice(2, 2, &[0.9, 0.0, 0.0, 0.1]),
    ///     g: DMatrix::from_row_slice(2, 1, &[1.0, 1.0]),
    ///     h: DMatrix::from_row_slice(1, 2, &[1.0, 0.1]),
    ///     d: DMatrix::zeros(1, 1),
    ///     k: DMatrix::zeros(2, 1),
    ///     noise_covariance: DMatrix::from_element(1, 1, 0.01),
    ///     sample_time: 1.0,
    /// };
    /// let reduced = model.reduced(1)?;
    /// assert!((reduced.model.f[(0, 0)] - 0.9).abs() < 0.01);
    /// let gain = |space: &StateSpace| Ok::<f64, thetahat::Error>(space.transfer(0, 0)?.at(1.0.into()).re);
    /// assert!((gain(&reduced.model)? - gain(&model)?).abs() < reduced.error_bound);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn reduced(&self, order: usize) -> Result<Reduced, Error> {
        let balance = self.balance()?;
        let (kept, needed) = (balance.lasting.left.nrows(), balance.needed());
        if order < kept {
            let poles = eigen::eigenvalues(&self.f)?;
            let lasting = poles.iter().filter(|pole| pole.modulus() > LASTING);
            let names: Vec<String> = lasting.map(|pole| eigen::named(*pole)).collect();
            return Err(Error::argument(
                "order",
                format!(
                    "it is {order}; the poles {} do not decay and are kept, so that it must be {kept} at least",
                    names.join(", ")
                ),
            ));
        }
        if order > needed {
            return Err(Error::argument(
                "order",
                format!("it is {order}; the model needs {needed} of its {} states", self.f.nrows()),
            ));
        }
        let error_bound = 2.0 * balance.singular_values[order - kept..].iter().rev().sum::<f64>();
        Ok(Reduced { model: self.truncated(&balance, order)?, error_bound })
    }

    fn balance(&self) -> Result<Balance, Error> {
        self.check()?;
        let Parts { inside, outside } = split(&self.f, LASTING)?;
        let size = inside.left.nrows();
        let f = &inside.left * &self.f * &inside.right;
        let (m, l) = (self.g.ncols(), self.h.nrows());
        let mut b = DMatrix::zeros(size, m + l);
        b.columns_mut(0, m).copy_from(&(&inside.left * &self.g));
        b.columns_mut(m, l).copy_from(&(&inside.left * &self.k * root(&self.noise_covariance)));
        let reached = gramian(f.clone(), b)?;
        let seen = gramian(f.transpose(), (&self.h * &inside.right).transpose())?;
        let product = seen.tr_mul(&reached);
        let mut singular_values = Vec::<f64>::new();
        let (mut right, mut left) = (DMatrix::zeros(size, 0), DMatrix::zeros(0, size));
        if !product.is_empty() {
            let decomposed = eigen::faer_of(&product)
                .thin_svd()
                .map_err(|_| Error::undetermined(Vec::new(), "the Hankel singular values do not converge"))?;
            singular_values.extend(decomposed.S().column_vector().iter());
            let largest = singular_values.first().copied().unwrap_or(0.0);
            let needed = singular_values.iter().take_while(|value| **value > eigen::rounding(size) * largest);
            let needed = needed.count();
            let of = |factor: DMatrix<f64>, vectors: faer::MatRef<'_, f64>| {
                let mut directions = factor * eigen::nalgebra_of(vectors.subcols(0, needed));
                let scaled = directions.column_iter_mut().zip(&singular_values);
                scaled.for_each(|(mut column, value)| column.unscale_mut(value.sqrt()));
                directions
            };
            right = of(reached, decomposed.V());
            left = of(seen, decomposed.U()).transpose();
        }
        singular_values.resize(size, 0.0);
        let decaying = Coordinates { right: &inside.right * right, left: left * &inside.left };
        Ok(Balance { lasting: outside, decaying, singular_values })
    }

    /// In balanced coordinates, the first `order` of them.
    fn truncated(&self, balance: &Balance, order: usize) -> Result<Self, Error> {
        let kept = balance.lasting.left.nrows();
        let states = order - kept;
        let n = self.f.nrows();
        let mut right = DMatrix::zeros(n, order);
        right.columns_mut(0, kept).copy_from(&balance.lasting.right);
        right.columns_mut(kept, states).copy_from(&balance.decaying.right.columns(0, states));
        let mut left = DMatrix::zeros(order, n);
        left.rows_mut(0, kept).copy_from(&balance.lasting.left);
        left.rows_mut(kept, states).copy_from(&balance.decaying.left.rows(0, states));
        let mut f = &left * &self.f * &right;
        // The two parts know nothing of each other.
        f.view_mut((0, kept), (kept, states)).fill(0.0);
        f.view_mut((kept, 0), (states, kept)).fill(0.0);
        let model = Self { f, g: &left * &self.g, h: &self.h * right, k: left * &self.k, ..self.clone() };
        model.with_stable_predictor()
    }

    /// The same model of y with innovations of which F - K H is stable.
    ///
    /// # Errors
    /// [`Error::Undetermined`] where there are none.
    pub(super) fn with_stable_predictor(self) -> Result<Self, Error> {
        let between = &self.f - &self.k * &self.h;
        let stable = |matrix: &DMatrix<f64>| {
            let largest = eigen::eigenvalues(matrix)?.first().map_or(0.0, |value| value.modulus());
            Ok::<bool, Error>(largest < 1.0)
        };
        if stable(&between)? {
            return Ok(self);
        }
        let without =
            || Error::undetermined(Vec::new(), "no gain gives a stable predictor; take another order");
        let unstable = split(&between, 1.0)?.outside;
        let inverse = (&unstable.left * &between * &unstable.right).try_inverse().ok_or_else(without)?;
        let seen = &self.h * &unstable.right * &inverse;
        let noise = &self.noise_covariance;
        let weighted = Cholesky::new(noise.clone()).ok_or_else(without)?;
        let whitened = weighted.l().solve_lower_triangular(&seen).ok_or_else(without)?;
        // Y = sum over k of A_u^-k' H_u' R^-1 H_u A_u^-k.
        let factor = gramian(inverse.transpose(), whitened.transpose()).map_err(|_| without())?;
        let information = &factor * factor.transpose();
        let covariance = Cholesky::new(information).ok_or_else(without)?.solve(&unstable.right.transpose());
        let covariance = &unstable.right * covariance;
        let innovation = &self.h * &covariance * self.h.transpose() + noise;
        let innovation = (&innovation + innovation.transpose()) * 0.5;
        let gain = Cholesky::new(innovation.clone()).ok_or_else(without)?;
        let gain = gain.solve(&(&self.h * covariance.transpose() * between.transpose())).transpose();
        let found = Self { k: &self.k + gain, noise_covariance: innovation, ..self };
        if stable(&(&found.f - &found.k * &found.h))? { Ok(found) } else { Err(without()) }
    }
}

impl Balance {
    /// The poles that are kept, and the states of the others that inputs reach and outputs see.
    fn needed(&self) -> usize {
        self.lasting.left.nrows() + self.decaying.left.nrows()
    }
}

/// S of X = S S', X = F X F' + B B' for a stable F.
fn gramian(mut f: DMatrix<f64>, b: DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
    let mut root = compressed(b);
    for _ in 0..DOUBLINGS {
        let further = &f * &root;
        let (size, before) = (further.norm(), root.norm());
        if !(size + before).is_finite() {
            break;
        }
        if size <= f64::EPSILON * f64::EPSILON * before {
            return Ok(root);
        }
        let mut both = DMatrix::zeros(root.nrows(), root.ncols() + further.ncols());
        both.columns_mut(0, root.ncols()).copy_from(&root);
        both.columns_mut(root.ncols(), further.ncols()).copy_from(&further);
        root = compressed(both);
        f = &f * &f;
    }
    Err(Error::undetermined(
        Vec::new(),
        "the Gramian of a state does not converge: the model is near unstable",
    ))
}

/// S with S S' as it is, and no more columns than rows.
fn compressed(factor: DMatrix<f64>) -> DMatrix<f64> {
    if factor.ncols() <= factor.nrows() || factor.is_empty() {
        factor
    } else {
        factor.transpose().qr().unpack_r().transpose()
    }
}

/// L of L L', for a covariance that may be singular.
fn root(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    if covariance.is_empty() {
        return covariance.clone();
    }
    let symmetric = (covariance + covariance.transpose()) * 0.5;
    let SymmetricEigen { mut eigenvectors, eigenvalues } = SymmetricEigen::new(symmetric);
    for (mut column, value) in eigenvectors.column_iter_mut().zip(eigenvalues.iter()) {
        column.scale_mut(value.max(0.0).sqrt());
    }
    eigenvectors
}

/// The invariant subspaces of a matrix.
struct Parts {
    /// Of eigenvalues inside a circle.
    inside: Coordinates,
    /// Of those on it and outside.
    outside: Coordinates,
}

/// The invariant subspaces of the eigenvalues inside a circle and of the others. With r between the two, the sign of
/// (F/r - I)(F/r + I)^-1 is -I on the one and I on the other (Roberts 1980), by Newton's X <- (X + X^-1)/2 with scaled
/// determinants (Higham, Functions of Matrices, 2008, section 5.5).
fn split(matrix: &DMatrix<f64>, radius: f64) -> Result<Parts, Error> {
    let n = matrix.nrows();
    let identity = DMatrix::<f64>::identity(n, n);
    let none = || Coordinates { right: DMatrix::zeros(n, 0), left: DMatrix::zeros(0, n) };
    let all = || Coordinates { right: identity.clone(), left: identity.clone() };
    let moduli: Vec<f64> = eigen::eigenvalues(matrix)?.iter().map(|value| value.modulus()).collect();
    let outside = moduli.iter().filter(|modulus| **modulus >= radius).count();
    if outside == 0 {
        return Ok(Parts { inside: all(), outside: none() });
    }
    if outside == n {
        return Ok(Parts { inside: none(), outside: all() });
    }
    let failed = || {
        Error::undetermined(
            Vec::new(),
            format!(
                "poles of modulus {} and {} cannot be told apart",
                figures::short(moduli[outside - 1]),
                figures::short(moduli[outside])
            ),
        )
    };
    // Poles at 0 have no geometric mean.
    let between = (moduli[outside - 1] * moduli[outside]).sqrt().max(0.5 * moduli[outside - 1]);
    let scaled = matrix / between;
    let inverse = (&scaled + &identity).try_inverse().ok_or_else(failed)?;
    let mut sign = (scaled - &identity) * inverse;
    let mut known = false;
    for _ in 0..STEPS {
        let factors = sign.clone().lu();
        let exponent = -1.0 / n as f64;
        // The product of powers, as the determinant itself may overflow.
        let scale: f64 = factors.u().diagonal().iter().map(|pivot| pivot.abs().powf(exponent)).product();
        let inverse = factors.try_inverse().ok_or_else(failed)?;
        let next = (&sign * scale + inverse / scale) * 0.5;
        let (step, size) = ((&next - &sign).norm(), next.norm());
        sign = next;
        if !size.is_finite() {
            return Err(failed());
        }
        // Each step doubles the digits.
        if step <= 1e-8 * size {
            known = true;
            break;
        }
    }
    // The projections on the two, and bases of what they project on.
    let basis = |projection: DMatrix<f64>, count: usize| {
        let decomposed = eigen::faer_of(&projection).svd().map_err(|_| failed())?;
        Ok::<_, Error>(eigen::nalgebra_of(decomposed.U().subcols(0, count)))
    };
    if !known || ((sign.trace() - (2 * outside) as f64 + n as f64).abs() > 0.5) {
        return Err(failed());
    }
    let first = basis((&identity + &sign) * 0.5, outside)?;
    let last = basis((&identity - &sign) * 0.5, n - outside)?;
    let mut right = DMatrix::zeros(n, n);
    right.columns_mut(0, outside).copy_from(&first);
    right.columns_mut(outside, n - outside).copy_from(&last);
    let left = right.try_inverse().ok_or_else(failed)?;
    Ok(Parts {
        outside: Coordinates { right: first, left: left.rows(0, outside).into_owned() },
        inside: Coordinates { right: last, left: left.rows(outside, n - outside).into_owned() },
    })
}

#[cfg(test)]
mod tests;
