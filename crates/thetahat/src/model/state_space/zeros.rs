//! The transfer function from one input to one output: its zeros, its poles and its gain.

use thetahat_core::nalgebra::{Complex, DMatrix, DVector};

use super::{StateSpace, eigen};
use crate::Error;

/// Sweeps over all states after which they are scaled as well as they can be.
const SWEEPS: usize = 100;

/// A transfer function as a product,
///
/// ```text
/// W(z) = gain (z - zeros_1) (z - zeros_2) … / ((z - poles_1) (z - poles_2) …)
/// ```
///
/// Zeros and poles come largest first; of a conjugate pair the positive imaginary part first.
#[derive(Debug, Clone, PartialEq)]
pub struct ZerosPolesGain {
    /// Where W is 0.
    pub zeros: Vec<Complex<f64>>,
    /// Where W is infinite.
    pub poles: Vec<Complex<f64>>,
    /// The first sample of the impulse response that is not zero; 0 where the input does nothing to the output.
    pub gain: f64,
}

impl ZerosPolesGain {
    /// The samples from an input to its first effect on the output: how many more poles than zeros there are.
    pub fn delay(&self) -> usize {
        self.poles.len().saturating_sub(self.zeros.len())
    }

    /// W at a point of the z plane: at 1 the static gain, at e^(i w T) the frequency response at w radians a second.
    pub fn at(&self, z: Complex<f64>) -> Complex<f64> {
        let product = |roots: &[Complex<f64>]| roots.iter().map(|root| z - root).product::<Complex<f64>>();
        product(&self.zeros) / product(&self.poles) * self.gain
    }
}

/// One channel of a model: F, a column of G, a row of H and an entry of D.
#[derive(Debug)]
struct Channel {
    f: DMatrix<f64>,
    g: DVector<f64>,
    h: DVector<f64>,
    d: f64,
}

impl StateSpace {
    /// The eigenvalues of F: poles of what is between inputs, innovations and outputs. Largest first; of a conjugate
    /// pair the positive imaginary part first. A pole of multiplicity k at 0 is k exact zeros. O(n^3), and as much
    /// again for each pole at 0.
    ///
    /// # Errors
    /// [`Error::Argument`] for matrices whose shapes do not fit, or that are not finite; [`Error::Undetermined`] where
    /// the eigenvalues do not converge.
    ///
    /// ```
    /// use thetahat::model::StateSpace;
    /// use thetahat::thetahat_core::nalgebra::DMatrix;
    ///
    /// // A pole at 0.8, and a delay that keeps one sample of the input.
    /// let model = StateSpace {
    ///     f: DMatrix::from_row_slice(2, 2, &[0.8, 1.0, 0.0, 0.0]),
    ///     g: DMatrix::from_row_slice(2, 1, &[0.0, 0.5]),
    ///     h: DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
    ///     d: DMatrix::zeros(1, 1),
    ///     k: DMatrix::zeros(2, 1),
    ///     noise_covariance: DMatrix::from_element(1, 1, 1.0),
    ///     sample_time: 1.0,
    /// };
    /// let poles = model.poles()?;
    /// assert!((poles[0].re - 0.8).abs() < 1e-15 && poles[1].re == 0.0);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn poles(&self) -> Result<Vec<Complex<f64>>, Error> {
        self.check()?;
        eigen::eigenvalues(&self.f)
    }

    /// The transfer function W(z) = h (z I - F)^-1 g + d from an input to an output, both counted from 0.
    ///
    /// States that this input does not reach, or this output does not see, are left out first, by reflections to
    /// Hessenberg form (Van Dooren, IEEE Trans. Automatic Control 26, 1981, "The generalized eigenstructure problem in
    /// linear system theory"), so that poles of other channels are not among its poles. Then, while d = 0, with
    /// coordinates in which h = [eta 0 … 0]:
    ///
    /// ```text
    /// y(t+1) = eta x_1(t+1) = eta (F_1 x(t) + g_1 u(t)),   x_1 = 0 as long as y is
    /// ```
    ///
    /// that is, W(z) (z - zeros) is eta times that of x_2, x_3, … with h = F_12, …, F_1n and d = g_1, which has the
    /// same zeros (Emami-Naeini and Van Dooren, Automatica 18, 1982). With d at last other than 0 they are the z at
    /// which [F - z I, g; h, d] loses rank: not eigenvalues of F - g h / d, which a small d would spoil, but of the
    /// pencil that is left when reflections take [h, d] to [0, delta]. A zero or pole of multiplicity k at 0 is k exact
    /// zeros. The states are first scaled by powers of two so that their rows and columns have about the same size
    /// (Parlett and Reinsch, Numerische Mathematik 13, 1969). O(n^3), and as much again for each zero or pole at 0.
    ///
    /// # Errors
    /// [`Error::Argument`] for an output or input that the model does not have, and for matrices whose shapes do not
    /// fit or that are not finite; [`Error::Undetermined`] where the eigenvalues do not converge.
    ///
    /// ```
    /// use thetahat::model::StateSpace;
    /// use thetahat::thetahat_core::nalgebra::DMatrix;
    ///
    /// // y(t) = 1.5 y(t-1) - 0.7 y(t-2) + 2 u(t-1) - u(t-2): W(z) = 2 (z - 0.5) / (z^2 - 1.5 z + 0.7).
    /// let model = StateSpace {
    ///     f: DMatrix::from_row_slice(2, 2, &[1.5, 1.0, -0.7, 0.0]),
    ///     g: DMatrix::from_row_slice(2, 1, &[2.0, -1.0]),
    ///     h: DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
    ///     d: DMatrix::zeros(1, 1),
    ///     k: DMatrix::zeros(2, 1),
    ///     noise_covariance: DMatrix::from_element(1, 1, 1.0),
    ///     sample_time: 1.0,
    /// };
    /// let transfer = model.transfer(0, 0)?;
    /// assert!((transfer.zeros[0].re - 0.5).abs() < 1e-14 && (transfer.gain - 2.0).abs() < 1e-14);
    /// assert_eq!((transfer.poles.len(), transfer.delay()), (2, 1));
    /// assert!((transfer.at(1.0.into()).re - 5.0).abs() < 1e-12);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn transfer(&self, output: usize, input: usize) -> Result<ZerosPolesGain, Error> {
        self.check()?;
        let outside = |name: &str, index: usize, count: usize| {
            Error::argument(name, format!("it is {index}; the model has {count}, counted from 0"))
        };
        if output >= self.h.nrows() {
            return Err(outside("output", output, self.h.nrows()));
        }
        if input >= self.g.ncols() {
            return Err(outside("input", input, self.g.ncols()));
        }
        let channel = Channel {
            f: self.f.clone(),
            g: self.g.column(input).into_owned(),
            h: self.h.row(output).transpose(),
            d: self.d[(output, input)],
        };
        let channel = channel.scaled().minimal();
        let poles = eigen::eigenvalues(&channel.f)?;
        let (zeros, gain) = channel.zeros()?;
        if gain == 0.0 {
            return Ok(ZerosPolesGain { zeros: Vec::new(), poles: Vec::new(), gain });
        }
        Ok(ZerosPolesGain { zeros, poles, gain })
    }
}

impl Channel {
    /// With each state in a unit, a power of two, in which what it does and what is done to it have about the same
    /// size.
    fn scaled(mut self) -> Self {
        let size = self.f.nrows();
        for _ in 0..SWEEPS {
            let mut changed = false;
            for state in 0..size {
                let others = || (0..size).filter(|other| *other != state);
                let mut does =
                    self.h[state].abs() + others().map(|row| self.f[(row, state)].abs()).sum::<f64>();
                let done =
                    self.g[state].abs() + others().map(|column| self.f[(state, column)].abs()).sum::<f64>();
                // Near the end of the range a sum, or what is compared below, is infinite: no unit is better.
                if does == 0.0 || done == 0.0 || !(2.0 * (does + done)).is_finite() {
                    continue;
                }
                let (before, mut unit) = (does + done, 1.0);
                while does < done / 2.0 {
                    (does, unit) = (does * 4.0, unit * 2.0);
                }
                while does >= done * 2.0 {
                    (does, unit) = (does / 4.0, unit / 2.0);
                }
                if (does + done) / unit < 0.95 * before {
                    changed = true;
                    self.f.column_mut(state).scale_mut(unit);
                    self.h[state] *= unit;
                    self.f.row_mut(state).unscale_mut(unit);
                    self.g[state] /= unit;
                }
            }
            if !changed {
                break;
            }
        }
        self
    }

    /// Without the states that the input does not reach, and without those that the output does not see.
    fn minimal(self) -> Self {
        self.reached().turned().reached().turned()
    }

    /// The same transfer function with g and h exchanged.
    fn turned(self) -> Self {
        Self { f: self.f.transpose(), g: self.h, h: self.g, d: self.d }
    }

    /// In coordinates in which g has one entry and F is an upper Hessenberg matrix: from the first zero below its
    /// diagonal on, no state is reached.
    fn reached(mut self) -> Self {
        let size = self.f.nrows();
        let (driven, moved) = (eigen::rounding(size) * self.g.norm(), eigen::rounding(size) * self.f.norm());
        for state in 0..size {
            let mut column = if state == 0 { self.g.clone() } else { self.f.column(state - 1).into_owned() };
            column.rows_mut(0, state).fill(0.0);
            let least = if state == 0 { driven } else { moved };
            let Some((axis, _)) = eigen::reflection(&column, state).filter(|_| column.norm() > least) else {
                return Self {
                    f: self.f.view((0, 0), (state, state)).into_owned(),
                    g: self.g.rows(0, state).into_owned(),
                    h: self.h.rows(0, state).into_owned(),
                    d: self.d,
                };
            };
            eigen::reflect_rows(&mut self.f, &axis);
            eigen::reflect_columns(&mut self.f, &axis);
            reflect(&mut self.g, &axis);
            reflect(&mut self.h, &axis);
        }
        self
    }

    /// The zeros of a channel without states to leave out, and its gain.
    fn zeros(mut self) -> Result<(Vec<Complex<f64>>, f64), Error> {
        let rounding = eigen::rounding(self.f.nrows());
        let (mut gain, mut least) = (1.0, rounding * self.h.norm() * self.g.norm());
        while self.d.abs() <= least {
            let size = self.f.nrows();
            let first = if size == 0 { None } else { eigen::reflection(&self.h, 0) };
            let Some((axis, entry)) = first else { return Ok((Vec::new(), 0.0)) };
            eigen::reflect_rows(&mut self.f, &axis);
            eigen::reflect_columns(&mut self.f, &axis);
            reflect(&mut self.g, &axis);
            gain *= entry;
            least = rounding * self.g.norm();
            self = Self {
                d: self.g[0],
                h: self.f.row(0).columns(1, size - 1).transpose(),
                g: self.g.rows(1, size - 1).into_owned(),
                f: self.f.view((1, 1), (size - 1, size - 1)).into_owned(),
            };
        }
        let size = self.f.nrows();
        let mut system = DMatrix::zeros(size, size + 1);
        system.columns_mut(0, size).copy_from(&self.f);
        system.set_column(size, &self.g);
        let mut identity = DMatrix::identity(size, size + 1);
        let last = self.h.insert_row(size, self.d);
        if let Some((axis, _)) = eigen::reflection(&last, size) {
            eigen::reflect_columns(&mut system, &axis);
            eigen::reflect_columns(&mut identity, &axis);
        }
        let pencil = |matrix: DMatrix<f64>| matrix.columns(0, size).into_owned();
        Ok((eigen::pencil(pencil(system), pencil(identity))?, gain * self.d))
    }
}

/// (I - 2 a a') v.
fn reflect(vector: &mut DVector<f64>, axis: &DVector<f64>) {
    let along = vector.dot(axis);
    vector.axpy(-2.0 * along, axis, 1.0);
}

#[cfg(test)]
mod tests;
