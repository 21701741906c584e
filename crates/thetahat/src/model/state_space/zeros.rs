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
    /// The eigenvalues of F: poles of what is between inputs, innovations and outputs. Largest first; of a conjugate pair the positive
    /// imaginary part first. A pole of multiplicity k at 0 is k exact zeros. O(n^3), and as much again for each pole at 0.
    ///
    /// # Errors
    /// [`Error::Argument`] for matrices whose shapes do not fit, or that are not finite; [`Error::Undetermined`] where the eigenvalues do not
    /// converge.
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
    /// States that this input does not reach, or this output does not see, are left out first, by reflections to Hessenberg form
    /// (Van Dooren, IEEE Trans. Automatic Control 26, 1981, "The generalized eigenstructure problem in linear system theory"), so that
    /// poles of other channels are not among its poles. Then, while d = 0, with coordinates in which h = [eta 0 … 0]:
    ///
    /// ```text
    /// y(t+1) = eta x_1(t+1) = eta (F_1 x(t) + g_1 u(t)),   x_1 = 0 as long as y is
    /// ```
    ///
    /// that is, W(z) (z - zeros) is eta times that of x_2, x_3, … with h = F_12, …, F_1n and d = g_1, which has the same zeros
    /// (Emami-Naeini and Van Dooren, Automatica 18, 1982). With d at last other than 0 they are the z at which [F - z I, g; h, d] loses
    /// rank: not eigenvalues of F - g h / d, which a small d would spoil, but of the pencil that is left when reflections take [h, d] to
    /// [0, delta]. A zero or pole of multiplicity k at 0 is k exact zeros. The states are first scaled by powers of two so that their rows
    /// and columns have about the same size (Parlett and Reinsch, Numerische Mathematik 13, 1969). O(n^3), and as much again for each zero
    /// or pole at 0.
    ///
    /// # Errors
    /// [`Error::Argument`] for an output or input that the model does not have, and for matrices whose shapes do not fit or that are
    /// not finite; [`Error::Undetermined`] where the eigenvalues do not converge.
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
    /// With each state in a unit, a power of two, in which what it does and what is done to it have about the same size.
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
                if does == 0.0 || done == 0.0 {
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

    /// In coordinates in which g has one entry and F is an upper Hessenberg matrix: from the first zero below its diagonal on, no state is
    /// reached.
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
mod tests {
    use thetahat_core::nalgebra::ComplexField;

    use super::*;
    use crate::model::{Orders, PolynomialModel};

    /// The largest difference of two lists of the same length, in order, as a fraction of the value if that is above 1.
    fn apart(found: &[Complex<f64>], expected: &[Complex<f64>]) -> f64 {
        assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
        let pairs = found.iter().zip(expected);
        pairs.map(|(one, other)| (one - other).modulus() / other.modulus().max(1.0)).fold(0.0, f64::max)
    }

    fn complex(values: &[(f64, f64)]) -> Vec<Complex<f64>> {
        values.iter().map(|(re, im)| Complex::new(*re, *im)).collect()
    }

    fn two_by_two() -> StateSpace {
        StateSpace {
            f: DMatrix::from_row_slice(3, 3, &[0.5, 0.2, 0.0, -0.3, 0.6, 0.1, 0.1, 0.0, 0.8]),
            g: DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 0.5, -1.0, 0.2, 0.7]),
            h: DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 2.0, 0.0, 1.0, -1.0]),
            d: DMatrix::from_row_slice(2, 2, &[0.0, 0.3, 0.001, 0.0]),
            k: DMatrix::zeros(3, 2),
            noise_covariance: DMatrix::identity(2, 2),
            sample_time: 1.0,
        }
    }

    #[test]
    fn channels_are_those_of_scipy() {
        // scipy 1.17.1: scipy.signal.ss2zpk(F, G[:, [i]], H[[o]], D[[o]][:, [i]]).
        let model = two_by_two();
        let (middle, wave) = (0.5421907452681753, 0.2481684523550721);
        let poles = complex(&[(0.815618509463651, 0.0), (middle, wave), (middle, -wave)]);
        let expected = [
            (0, 0, complex(&[(0.55, 0.13228756555322993), (0.55, -0.13228756555322993)]), 1.4),
            (
                0,
                1,
                complex(&[
                    (-4.016002723581594, 0.0),
                    (0.6246680284574646, 0.2590885205139561),
                    (0.6246680284574646, -0.2590885205139561),
                ]),
                0.3,
            ),
            (
                1,
                0,
                complex(&[(-300.7933728179224, 0.0), (1.9985070320965412, 0.0), (0.6948657858270146, 0.0)]),
                0.001,
            ),
            (1, 1, complex(&[(0.6911064028335405, 0.0), (0.567717126578224, 0.0)]), -1.7),
        ];
        for (output, input, zeros, gain) in expected {
            let found = model.transfer(output, input).unwrap();
            assert!(apart(&found.poles, &poles) < 1e-13, "{output} {input}");
            // scipy's own zeros, of a polynomial, have fewer digits.
            assert!(apart(&found.zeros, &zeros) < 1e-11, "{output} {input} {:?}", found.zeros);
            assert!(
                (found.gain - gain).abs() < 1e-14 * gain.abs().max(1.0),
                "{output} {input} {}",
                found.gain
            );
        }
    }

    #[test]
    fn it_is_the_response_of_the_state_space() {
        let model = two_by_two();
        for (output, input) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let transfer = model.transfer(output, input).unwrap();
            for z in complex(&[(1.0, 0.0), (0.3, 0.9), (-1.0, 0.0), (40.0, -3.0)]) {
                let resolvent = DMatrix::identity(3, 3) * z - model.f.map(|value| Complex::new(value, 0.0));
                let state = resolvent
                    .lu()
                    .solve(&model.g.column(input).map(|value| Complex::new(value, 0.0)))
                    .unwrap();
                let expected = (model.h.row(output).map(|value| Complex::new(value, 0.0)) * state)[0]
                    + model.d[(output, input)];
                let apart = (transfer.at(z) - expected).modulus() / expected.modulus();
                assert!(apart < 1e-12, "{output} {input} {z}: {apart}");
            }
        }
    }

    /// A model of two inputs, of which the first has nk delays and zeros at 0 too.
    fn box_jenkins() -> PolynomialModel {
        let orders = Orders::new(1, &[2, 1], 1, 1, &[4, 2], &[3, 0]).unwrap();
        let parameters = [-0.9, 1.0, -0.4, 2.0, 0.5, -0.7, -1.0, 0.41, -0.02, -0.03, -1.2, 0.72];
        PolynomialModel::from_parameters(&orders, &parameters, None, 1.0, 1.0).unwrap()
    }

    #[test]
    fn polynomials_keep_their_roots() {
        let model = box_jenkins();
        let space = model.state_space();
        for input in 0..2 {
            let found = space.transfer(0, input).unwrap();
            let nk = [3, 0][input];
            let b = &model.b[input][nk..];
            let denominator = crate::model::polynomial::product(&model.a, &model.f[input]);
            let mut poles = crate::model::polynomial::roots(&denominator).unwrap();
            let mut zeros = crate::model::polynomial::roots(b).unwrap();
            // b_0 z^-nk + … over z^-n … is z^(n - nk - nb + 1) (b_0 z^(nb-1) + …): roots at 0 above or below.
            let shift = denominator.len() as isize - 1 - (nk + b.len() - 1) as isize;
            let at_zero = vec![Complex::new(0.0, 0.0); shift.unsigned_abs()];
            if shift > 0 {
                zeros.extend(at_zero)
            } else {
                poles.extend(at_zero)
            }
            assert!(apart(&found.poles, &poles) < 1e-12, "{:?} {poles:?}", found.poles);
            assert!(apart(&found.zeros, &zeros) < 1e-12, "{:?} {zeros:?}", found.zeros);
            assert_eq!(found.delay(), nk);
            assert!((found.gain - b[0]).abs() < 1e-13);
        }
    }

    #[test]
    fn a_finite_impulse_response_has_its_poles_at_zero() {
        let orders = Orders::arx(0, &[3], &[2]).unwrap();
        let model = PolynomialModel::from_parameters(&orders, &[2.0, -3.0, 1.0], None, 1.0, 1.0).unwrap();
        let found = model.state_space().transfer(0, 0).unwrap();
        // 2 z^-2 - 3 z^-3 + z^-4 = (2 z^2 - 3 z + 1) / z^4.
        assert_eq!(found.poles, vec![Complex::new(0.0, 0.0); 4]);
        assert!(apart(&found.zeros, &complex(&[(1.0, 0.0), (0.5, 0.0)])) < 1e-14);
        assert_eq!((found.delay(), (found.gain - 2.0).abs() < 1e-14), (2, true));
    }

    #[test]
    fn other_coordinates_and_units_change_nothing() {
        let space = box_jenkins().state_space();
        let size = space.f.nrows();
        let expected = space.transfer(0, 0).unwrap();
        let change = DMatrix::from_fn(size, size, |row, column| {
            let entry = ((3 * row + 5 * column) % 7) as f64 - 3.0;
            if row == column { 9.0 + entry } else { entry }
        });
        let inverse = change.clone().try_inverse().unwrap();
        let turned = StateSpace {
            f: &change * &space.f * &inverse,
            g: &change * &space.g,
            h: &space.h * &inverse,
            ..space.clone()
        };
        let found = turned.transfer(0, 0).unwrap();
        assert!(apart(&found.poles, &expected.poles) < 1e-10, "{:?}", found.poles);
        assert!(apart(&found.zeros, &expected.zeros) < 1e-10, "{:?}", found.zeros);
        let units =
            DMatrix::from_fn(
                size,
                size,
                |row, column| {
                    if row == column { 1e4_f64.powi(row as i32 % 3) } else { 0.0 }
                },
            );
        let inverse = units.clone().try_inverse().unwrap();
        let scaled = StateSpace {
            f: &units * &space.f * &inverse,
            g: &units * &space.g,
            h: &space.h * &inverse,
            ..space
        };
        let found = scaled.transfer(0, 0).unwrap();
        assert!(apart(&found.poles, &expected.poles) < 1e-12, "{:?}", found.poles);
        assert!(apart(&found.zeros, &expected.zeros) < 1e-12, "{:?}", found.zeros);
    }

    #[test]
    fn an_input_that_does_nothing_has_no_transfer() {
        let orders = Orders::arx(1, &[1, 0], &[1, 1]).unwrap();
        let model = PolynomialModel::from_parameters(&orders, &[-0.5, 2.0], None, 1.0, 1.0).unwrap();
        let found = model.state_space().transfer(0, 1).unwrap();
        assert_eq!(found, ZerosPolesGain { zeros: vec![], poles: vec![], gain: 0.0 });
        // A gain alone.
        let orders = Orders::arx(0, &[1], &[0]).unwrap();
        let model = PolynomialModel::from_parameters(&orders, &[2.0], None, 1.0, 1.0).unwrap();
        let found = model.state_space().transfer(0, 0).unwrap();
        assert_eq!(found, ZerosPolesGain { zeros: vec![], poles: vec![], gain: 2.0 });
    }

    #[test]
    fn channels_that_are_not_there_are_refused() {
        let model = two_by_two();
        assert_eq!(
            model.transfer(2, 0).unwrap_err().to_string(),
            "output: it is 2; the model has 2, counted from 0"
        );
        assert!(model.transfer(0, 2).unwrap_err().to_string().starts_with("input: it is 2"));
        let odd = StateSpace { g: DMatrix::zeros(2, 2), ..two_by_two() };
        assert_eq!(
            odd.poles().unwrap_err().to_string(),
            "model: G is 2 x 2, not 3 x 2: F has 3 rows, and D is 2 x 2"
        );
        let endless = StateSpace { d: DMatrix::from_element(2, 2, f64::INFINITY), ..two_by_two() };
        assert_eq!(
            endless.poles().unwrap_err().to_string(),
            "model: D has an entry that is not a finite number"
        );
    }
}
