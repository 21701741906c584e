mod balance;
mod continuous;
mod eigen;
mod fitted;
mod in_seconds;
mod logarithm;
pub(crate) mod riccati;
mod spot_noise;
mod uncertainty;
mod zeros;

use thetahat_core::nalgebra::DMatrix;

use crate::Error;
use crate::model::PolynomialModel;
pub use balance::Reduced;
pub use continuous::{ContinuousStateSpace, Hold};
pub(crate) use eigen::{eigenvalues, is_stable, symmetric_eigen};
pub use fitted::StateSpaceModel;
pub use in_seconds::ContinuousStateSpaceModel;
pub(super) use in_seconds::Head;
pub(super) use spot_noise::Steps;
pub use uncertainty::{Entry, EntryCovariance, StateSpaceMatrix};
pub(crate) use uncertainty::{Path, Sizes, across_coordinates, flat};
pub(in crate::model) use uncertainty::{STEP, independent};
pub use zeros::ZerosPolesGain;

/// A model in innovations form, x of n states, u of m inputs and y of l outputs:
///
/// ```text
/// x(t+1) = F x(t) + G u(t) + K e(t)
/// y(t)   = H x(t) + D u(t) + e(t),   cov e = noise_covariance
/// ```
///
/// (Ljung, System Identification, 2nd ed. 1999, section 4.3). y and u are deviations from the model's offsets, so that
/// the state at rest is zero. F and D here are matrices, not the polynomials of these letters. Made by
/// [`PolynomialModel::state_space`], and from signals by [`subspace`](crate::estimate::subspace()).
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    /// F, n x n: what becomes of the state.
    pub f: DMatrix<f64>,
    /// G, n x m: what the inputs do to the state.
    pub g: DMatrix<f64>,
    /// H, l x n: the outputs of a state.
    pub h: DMatrix<f64>,
    /// D, l x m: what the inputs do to the outputs at once. Zero for an input with nk above 0.
    pub d: DMatrix<f64>,
    /// K, n x l: what the innovations do to the state.
    pub k: DMatrix<f64>,
    /// The covariance of e, l x l.
    pub noise_covariance: DMatrix<f64>,
    /// Seconds from one sample to the next.
    pub sample_time: f64,
}

impl StateSpace {
    /// # Errors
    /// [`Error::Argument`] for matrices whose shapes do not fit or that are not finite, and a sample time that is not
    /// above 0.
    pub(in crate::model) fn check(&self) -> Result<(), Error> {
        fit_together([
            ("F", &self.f),
            ("G", &self.g),
            ("H", &self.h),
            ("D", &self.d),
            ("K", &self.k),
            ("noise_covariance", &self.noise_covariance),
        ])?;
        if self.sample_time > 0.0 && self.sample_time.is_finite() {
            return Ok(());
        }
        let message = format!("the sample time is {} s; it must be above 0 and finite", self.sample_time);
        Err(Error::argument("model", message))
    }
}

/// # Errors
/// [`Error::Argument`] if the matrices of a model, those of [`StateSpace`] in their order, are not finite or not of
/// shapes that fit.
fn fit_together(matrices: [(&str, &DMatrix<f64>); 6]) -> Result<(), Error> {
    let [(state, transition), _, _, (direct, feedthrough), _, _] = matrices;
    let (n, l, m) = (transition.nrows(), feedthrough.nrows(), feedthrough.ncols());
    let shapes = [(n, n), (n, m), (l, n), (l, m), (n, l), (l, l)];
    for ((name, matrix), (rows, columns)) in matrices.into_iter().zip(shapes) {
        if matrix.shape() != (rows, columns) {
            let (found, across) = matrix.shape();
            return Err(Error::argument(
                "model",
                format!(
                    "{name} is {found} x {across}, not {rows} x {columns}: {state} has {n} rows, and {direct} is {l} x {m}"
                ),
            ));
        }
        if !matrix.iter().all(|value| value.is_finite()) {
            return Err(Error::argument("model", format!("{name} has an entry that is not a finite number")));
        }
    }
    Ok(())
}

/// What drives a model, an input or e: its numerator, and the denominator that it has beside A, empty without one.
type Source<'a> = (&'a [f64], &'a [f64]);

impl PolynomialModel {
    /// The same model as a recursion of first order for a state.
    ///
    /// A quotient of polynomials of order n, v = N/P s, is a block of n states in observer canonical form:
    ///
    /// ```text
    /// v(t)     = x_1(t) + n_0 s(t)
    /// x_i(t+1) = x_{i+1}(t) - p_i x_1(t) + (n_i - p_i n_0) s(t),   i = 1 … n,   x_{n+1} = 0
    /// ```
    ///
    /// One block with the denominator A is shared. B_j u_j where F_j is 1, and C e where D is 1, are numerators of it.
    /// B_j/F_j u_j and C/D e of all others have blocks of their own, in series before it. The number of states is
    ///
    /// ```text
    /// max(na, nb_j + nk_j - 1 of the inputs without F, nc if nd = 0)
    ///     + sum max(nf_j, nb_j + nk_j - 1) over the inputs with F
    ///     + max(nc, nd) if nd > 0
    /// ```
    ///
    /// and the eigenvalues of F are the roots of A, of each F_j and of D; those that are left are 0. An input without B
    /// has no state. Fewer states would do only where two blocks have an eigenvalue in common, which may be the 0 of a
    /// B that is longer than its denominator, or where a numerator and a denominator have a root in common. For the
    /// form see Kailath, Linear Systems, 1980, section 2.1.
    ///
    /// A Kalman filter takes it with w = K e and v = e: Q = K K' var e, S = K var e, R = var e. In the long run its
    /// gain is K where all roots of C and of each F_j lie inside the unit circle.
    ///
    /// Cost: O(n (n + m)) to write the matrices.
    ///
    /// ```
    /// use thetahat::data::Record;
    /// use thetahat::estimate::{Initial, arx};
    /// use thetahat::model::{Orders, PolynomialModel, Signal};
    ///
    /// let u: Vec<f64> = (0..100_u32).map(|t| f64::from(t * t % 7)).collect();
    /// let mut y = vec![0.0, 0.0];
    /// for t in 2..u.len() {
    ///     y.push(0.8 * y[t - 1] + 0.5 * u[t - 1] + 0.3 * u[t - 2]);
    /// }
    /// let orders = Orders::arx(1, &[2], &[1])?;
    /// let estimate = arx(&Record::new(&y, vec![&u])?, &orders, Initial::Drop)?;
    /// let model = estimate.to_model(&orders, 1.0, vec![Signal::default()], Signal::default())?;
    ///
    /// let space = model.state_space();
    /// // x_1(t+1) = 0.8 x_1(t) + x_2(t) + 0.5 u(t), x_2(t+1) = 0.3 u(t), y(t) = x_1(t).
    /// assert_eq!((space.f.shape(), space.h[(0, 0)], space.h[(0, 1)]), ((2, 2), 1.0, 0.0));
    /// assert!((space.f[(0, 0)] - 0.8).abs() < 1e-9 && space.f[(0, 1)] == 1.0);
    /// assert!((space.g[(0, 0)] - 0.5).abs() < 1e-9 && (space.g[(1, 0)] - 0.3).abs() < 1e-9);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn state_space(&self) -> StateSpace {
        let none: &[f64] = &[];
        let inputs = self.b.iter().enumerate().map(|(input, b)| {
            // B without coefficients may still have the zeros of its delay.
            let used = self.orders.nb.get(input).is_some_and(|&nb| nb > 0);
            let f = self.f.get(input).map_or(none, Vec::as_slice);
            if used { (b.as_slice(), f) } else { (none, none) }
        });
        let sources: Vec<Source<'_>> = inputs.chain([(self.c.as_slice(), self.d.as_slice())]).collect();
        let alone = |source: &Source<'_>| order(source.1) > 0;
        let shared = sources.iter().filter(|source| !alone(source)).map(|source| order(source.0));
        let shared = shared.fold(order(&self.a), usize::max);
        let own = |source: &Source<'_>| if alone(source) { order(source.0).max(order(source.1)) } else { 0 };
        let states = shared + sources.iter().map(own).sum::<usize>();

        let mut f = DMatrix::zeros(states, states);
        let mut h = DMatrix::zeros(1, states);
        // One column for each source, that of e last.
        let mut gains = DMatrix::zeros(states, sources.len());
        let mut direct = DMatrix::zeros(1, sources.len());
        block(&mut f, &mut h, 0, shared, &self.a);
        let mut first = shared;
        for (column, source) in sources.iter().enumerate() {
            let (numerator, denominator) = *source;
            let now = coefficient(numerator, 0);
            direct[(0, column)] = now;
            if !alone(source) {
                let enters = (1..=shared).map(|i| coefficient(numerator, i) - coefficient(&self.a, i) * now);
                enters.enumerate().for_each(|(row, gain)| gains[(row, column)] = gain);
                continue;
            }
            let size = own(source);
            block(&mut f, &mut h, first, size, denominator);
            for i in 1..=size {
                gains[(first + i - 1, column)] =
                    coefficient(numerator, i) - coefficient(denominator, i) * now;
            }
            // What comes out of it, x_first(t) + n_0 s(t), is a signal of the shared block with the numerator 1.
            for i in 1..=shared {
                f[(i - 1, first)] = -coefficient(&self.a, i);
                gains[(i - 1, column)] = -coefficient(&self.a, i) * now;
            }
            first += size;
        }
        let inputs = self.b.len();
        StateSpace {
            f,
            g: gains.columns(0, inputs).into_owned(),
            h,
            d: direct.columns(0, inputs).into_owned(),
            k: gains.columns(inputs, 1).into_owned(),
            noise_covariance: DMatrix::from_element(1, 1, self.noise_variance),
            sample_time: self.sample_time,
        }
    }
}

/// Writes what a block does by itself: its states begin at `first`, and its first one is a part of the output.
fn block(f: &mut DMatrix<f64>, h: &mut DMatrix<f64>, first: usize, size: usize, denominator: &[f64]) {
    for i in 1..=size {
        f[(first + i - 1, first)] = -coefficient(denominator, i);
        if i < size {
            f[(first + i - 1, first + i)] = 1.0;
        }
    }
    if size > 0 {
        h[(0, first)] = 1.0;
    }
}

fn order(polynomial: &[f64]) -> usize {
    polynomial.len().saturating_sub(1)
}

/// Zero after the last.
fn coefficient(polynomial: &[f64], power: usize) -> f64 {
    polynomial.get(power).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests;
