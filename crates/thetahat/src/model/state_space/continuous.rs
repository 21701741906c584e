//! Models in continuous time, and the way to and from sampled ones.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{Complex, DMatrix};

use super::logarithm::{integrals, logarithm};
use super::{StateSpace, eigen, fit_together};
use crate::{Error, figures};

/// What an input does between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Hold {
    /// It keeps its value until the next sample: a converter does so. `zoh`.
    #[default]
    #[serde(rename = "zoh")]
    Zero,
    /// It moves along a straight line to the next sample. `foh`.
    #[serde(rename = "foh")]
    First,
    /// Any: z = (1 + s T/2)/(1 - s T/2), which maps one stable half to the other but bends frequencies, w to 2/T tan(w
    /// T/2). `tustin`.
    Tustin,
}

/// All holds with their words.
const WORDS: [(Hold, &str); 3] = [(Hold::Zero, "zoh"), (Hold::First, "foh"), (Hold::Tustin, "tustin")];

impl Hold {
    /// Every hold.
    pub fn all() -> impl Iterator<Item = Self> {
        WORDS.iter().map(|(hold, _)| *hold)
    }

    /// Its word in options and documents.
    pub fn word(self) -> &'static str {
        WORDS.iter().find(|(hold, _)| *hold == self).map_or("", |(_, word)| word)
    }
}

impl fmt::Display for Hold {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

impl FromStr for Hold {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        Self::all()
            .find(|hold| hold.word() == text)
            .ok_or_else(|| Error::argument("hold", format!("'{text}' is none of zoh, foh and tustin")))
    }
}

/// A model in continuous time, x of n states, u of m inputs and y of l outputs:
///
/// ```text
/// dx/dt = A x + B u + K e
/// y     = C x + D u + e,   e white with the spectral density noise_intensity
/// ```
///
/// Time is in seconds. e is a mathematical fiction, as its variance is infinite; what has a meaning is its mean over a
/// time T, of the covariance noise_intensity / T (Åström, Introduction to Stochastic Control Theory, 1970, section
/// 3.10). Made by [`StateSpace::to_continuous`].
#[derive(Debug, Clone, PartialEq)]
pub struct ContinuousStateSpace {
    /// A, n x n, a second.
    pub a: DMatrix<f64>,
    /// B, n x m: what the inputs do to the rate of the state.
    pub b: DMatrix<f64>,
    /// C, l x n: the outputs of a state.
    pub c: DMatrix<f64>,
    /// D, l x m: what the inputs do to the outputs at once.
    pub d: DMatrix<f64>,
    /// K, n x l: what the innovations do to the rate of the state.
    pub k: DMatrix<f64>,
    /// The integral over time of the covariance of e, l x l, in units of the outputs squared times seconds.
    pub noise_intensity: DMatrix<f64>,
}

impl ContinuousStateSpace {
    /// The same matrices by the letters of a recursion, for what does not ask which time it is.
    pub(in crate::model) fn renamed(&self) -> StateSpace {
        let Self { a, b, c, d, k, noise_intensity } = self.clone();
        StateSpace { f: a, g: b, h: c, d, k, noise_covariance: noise_intensity, sample_time: 1.0 }
    }

    /// The matrices of [`renamed`](Self::renamed).
    pub(in crate::model) fn of_renamed(matrices: StateSpace) -> Self {
        let StateSpace { f, g, h, d, k, noise_covariance, .. } = matrices;
        Self { a: f, b: g, c: h, d, k, noise_intensity: noise_covariance }
    }
}

impl StateSpace {
    /// The model in continuous time that gives this one when it is sampled: [`ContinuousStateSpace::sampled`] has the
    /// equations, of which these are the inverse. With T the sample time, and phi_1 and phi_2 of A T as there:
    ///
    /// ```text
    /// zoh     A = log(F)/T,   B = (T phi_1)^-1 G,     C = H,   D = D
    /// foh     A = log(F)/T,   B = (T phi_1^2)^-1 G,   C = H,   D = D - T H phi_2 B
    /// tustin  A = 2/T (F - I)(F + I)^-1,   B = 2/T (F + I)^-1 G,   C = 2 H (F + I)^-1,   D = D - H (F + I)^-1 G
    /// ```
    ///
    /// log is the principal logarithm: a pole p becomes ln(p)/T, with an imaginary part between -pi/T and pi/T. Faster
    /// oscillations were seen as slower ones when they were sampled, and come back as those. O(n^3).
    ///
    /// # Errors
    /// With `zoh` and `foh` [`Error::Undetermined`] for poles at or left of 0, which it names: they have no real
    /// logarithm. One at 0 is a delay of a sample. With `tustin` the same for poles at -1, and where F - K H has an
    /// eigenvalue there. [`Error::Argument`] for matrices whose shapes do not fit or that are not finite.
    ///
    /// ```
    /// use thetahat::model::{Hold, StateSpace};
    /// use thetahat::thetahat_core::nalgebra::DMatrix;
    ///
    /// // dy/dt = -y + u, sampled every 0.1 s, has the pole e^-0.1.
    /// let pole = (-0.1_f64).exp();
    /// let model = StateSpace {
    ///     f: DMatrix::from_row_slice(1, 1, &[pole]),
    ///     g: DMatrix::from_row_slice(1, 1, &[1.0 - pole]),
    ///     h: DMatrix::from_row_slice(1, 1, &[1.0]),
    ///     d: DMatrix::zeros(1, 1),
    ///     k: DMatrix::zeros(1, 1),
    ///     noise_covariance: DMatrix::from_element(1, 1, 1.0),
    ///     sample_time: 0.1,
    /// };
    /// let continuous = model.to_continuous(Hold::Zero)?;
    /// assert!((continuous.a[(0, 0)] + 1.0).abs() < 1e-12 && (continuous.b[(0, 0)] - 1.0).abs() < 1e-12);
    ///
    /// let slower = continuous.sampled(0.5, Hold::Zero)?;
    /// assert!((slower.f[(0, 0)] - (-0.5_f64).exp()).abs() < 1e-12);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn to_continuous(&self, hold: Hold) -> Result<ContinuousStateSpace, Error> {
        self.check()?;
        let (seconds, n) = (self.sample_time, self.f.nrows());
        let noise_intensity = &self.noise_covariance * seconds;
        if hold == Hold::Tustin {
            let identity = DMatrix::<f64>::identity(n, n);
            let inverse = (&self.f + &identity).try_inverse();
            let inverse = inverse.filter(|inverse| is_accurate(inverse, &(&self.f + &identity)));
            let inverse = inverse.ok_or_else(|| at_minus_one("the model has a pole"))?;
            let seen = &self.h * &inverse;
            let noise = Noise { k: &inverse * &self.k * (2.0 / seconds), direct: -&seen * &self.k };
            let (k, noise_intensity) = noise
                .with_unit_gain(&noise_intensity)
                .ok_or_else(|| at_minus_one("the predictor F - K H has an eigenvalue"))?;
            return Ok(ContinuousStateSpace {
                a: (&self.f - &identity) * &inverse * (2.0 / seconds),
                b: &inverse * &self.g * (2.0 / seconds),
                d: &self.d - &seen * &self.g,
                c: seen * 2.0,
                k,
                noise_intensity,
            });
        }
        refuse_without_logarithm(&eigen::eigenvalues(&self.f)?)?;
        let logarithm = logarithm(&self.f).ok_or_else(|| {
            Error::undetermined(
                Vec::new(),
                "poles so near the negative real axis, or so near each other, have no accurate logarithm; `tustin` takes none",
            )
        })?;
        let lost = || Error::undetermined(Vec::new(), "what an input does in a sample cannot be inverted");
        let [_, first, second] = integrals(&logarithm).ok_or_else(lost)?;
        let within = first * seconds;
        let mut b = eigen::solved(within.clone(), &self.g).ok_or_else(lost)?;
        let k = eigen::solved(within.clone(), &self.k).ok_or_else(lost)?;
        let mut d = self.d.clone();
        if hold == Hold::First {
            b = eigen::solved(within, &(b * seconds)).ok_or_else(lost)?;
            d -= &self.h * second * &b * seconds;
        }
        Ok(ContinuousStateSpace { a: logarithm / seconds, b, c: self.h.clone(), d, k, noise_intensity })
    }

    /// The model with another sample time: in continuous time and sampled again, both with this hold. O(n^3).
    ///
    /// # Errors
    /// Those of [`StateSpace::to_continuous`] and [`ContinuousStateSpace::sampled`].
    pub fn resampled(&self, seconds: f64, hold: Hold) -> Result<Self, Error> {
        self.to_continuous(hold)?.sampled(seconds, hold)
    }
}

impl ContinuousStateSpace {
    /// The model as it looks at samples every T seconds, the inputs doing between them what `hold` says. With phi_0 =
    /// e^(A T), phi_1 = integral_0^1 e^(A T s) ds and phi_2 = integral_0^1 (1 - s) e^(A T s) ds:
    ///
    /// ```text
    /// zoh     F = phi_0,   G = T phi_1 B,     H = C,   D = D                    x at the samples
    /// foh     F = phi_0,   G = T phi_1^2 B,   H = C,   D = D + T C phi_2 B      x less T phi_2 B u
    /// tustin  F = P (I + A T/2),   G = T P B,   H = C P,   D = D + T/2 C P B,   P = (I - A T/2)^-1
    /// ```
    ///
    /// (Franklin, Powell and Workman, Digital Control of Dynamic Systems, 3rd ed. 1998, sections 4.3, 6.1 and 6.3.2;
    /// phi_1^2 is phi_1 + (phi_0 - I) phi_2.)
    ///
    /// The innovations are one more input. With `zoh` and `foh` they are held over a sample, K = T phi_1 K with the
    /// covariance noise_intensity / T: independent samples are not joined by lines. With `tustin` they are mapped as
    /// all inputs are, and then scaled so that they enter the outputs with I, E = I + T/2 C P K: K = T P K E^-1,
    /// covariance E noise_intensity E' / T. So `tustin` keeps a stable predictor stable; `zoh` and `foh` may not, where
    /// the noise has zeros much faster than the samples. O(n^3).
    ///
    /// # Errors
    /// [`Error::Argument`] for a time that is not above 0, matrices whose shapes do not fit or that are not finite;
    /// [`Error::Undetermined`] where e^(A T) leaves the range of numbers, and with `tustin` for a pole at 2/T or where
    /// A - K C has an eigenvalue there.
    ///
    /// ```
    /// use thetahat::model::{ContinuousStateSpace, Hold};
    /// use thetahat::thetahat_core::nalgebra::DMatrix;
    ///
    /// // A double integrator, d2y/dt2 = u, every 2 s.
    /// let model = ContinuousStateSpace {
    ///     a: DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]),
    ///     b: DMatrix::from_row_slice(2, 1, &[0.0, 1.0]),
    ///     c: DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
    ///     d: DMatrix::zeros(1, 1),
    ///     k: DMatrix::from_row_slice(2, 1, &[1.0, 0.0]),
    ///     noise_intensity: DMatrix::from_element(1, 1, 0.5),
    /// };
    /// let sampled = model.sampled(2.0, Hold::Zero)?;
    /// assert!((sampled.f - DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 0.0, 1.0])).amax() < 1e-14);
    /// assert!((sampled.g - DMatrix::from_row_slice(2, 1, &[2.0, 2.0])).amax() < 1e-14);
    /// assert!((sampled.k[(0, 0)] - 2.0).abs() < 1e-14 && sampled.noise_covariance[(0, 0)] == 0.25);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn sampled(&self, seconds: f64, hold: Hold) -> Result<StateSpace, Error> {
        if !(seconds > 0.0 && seconds.is_finite()) {
            return Err(Error::argument(
                "sample_time",
                format!("it is {seconds} s; it must be above 0 and finite"),
            ));
        }
        self.check()?;
        let noise_covariance = &self.noise_intensity / seconds;
        let scaled = &self.a * seconds;
        if hold == Hold::Tustin {
            let n = self.a.nrows();
            let identity = DMatrix::<f64>::identity(n, n);
            let system = &identity - &scaled * 0.5;
            let at_two = |what: &str| {
                Error::undetermined(
                    Vec::new(),
                    format!(
                        "{what} at 2/T = {} a second, which `tustin` maps to infinity; take another sample time",
                        figures::short(2.0 / seconds)
                    ),
                )
            };
            let inverse = system.clone().try_inverse().filter(|inverse| is_accurate(inverse, &system));
            let inverse = inverse.ok_or_else(|| at_two("the model has a pole"))?;
            let h = &self.c * &inverse;
            let noise = Noise { k: &inverse * &self.k * seconds, direct: &h * &self.k * (0.5 * seconds) };
            let (k, noise_covariance) = noise
                .with_unit_gain(&noise_covariance)
                .ok_or_else(|| at_two("the predictor A - K C has an eigenvalue"))?;
            return Ok(StateSpace {
                f: &inverse * (identity + scaled * 0.5),
                g: &inverse * &self.b * seconds,
                d: &self.d + &h * &self.b * (0.5 * seconds),
                h,
                k,
                noise_covariance,
                sample_time: seconds,
            });
        }
        let [f, first, second] = integrals(&scaled).ok_or_else(|| {
            Error::undetermined(
                Vec::new(),
                format!(
                    "over {} s the model grows, or decays, beyond the range of numbers; take a shorter sample time",
                    figures::short(seconds)
                ),
            )
        })?;
        let held = first * seconds;
        let k = &held * &self.k;
        let mut g = &held * &self.b;
        let mut d = self.d.clone();
        if hold == Hold::First {
            g = &held * g / seconds;
            d += &self.c * second * &self.b * seconds;
        }
        Ok(StateSpace { f, g, h: self.c.clone(), d, k, noise_covariance, sample_time: seconds })
    }

    /// The eigenvalues of A, in radians a second; of a conjugate pair the positive imaginary part first. Largest first.
    /// O(n^3).
    ///
    /// # Errors
    /// [`Error::Argument`] for matrices whose shapes do not fit or that are not finite; [`Error::Undetermined`] where
    /// they do not converge.
    pub fn poles(&self) -> Result<Vec<Complex<f64>>, Error> {
        self.check()?;
        eigen::eigenvalues(&self.a)
    }

    fn check(&self) -> Result<(), Error> {
        fit_together([
            ("A", &self.a),
            ("B", &self.b),
            ("C", &self.c),
            ("D", &self.d),
            ("K", &self.k),
            ("noise_intensity", &self.noise_intensity),
        ])
    }
}

/// Innovations that enter the outputs with I + direct.
struct Noise {
    k: DMatrix<f64>,
    direct: DMatrix<f64>,
}

impl Noise {
    /// The gain and the covariance of (I + direct) e, which enter them with I; none where that is singular.
    fn with_unit_gain(&self, covariance: &DMatrix<f64>) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        let size = self.direct.nrows();
        let gain = DMatrix::identity(size, size) + &self.direct;
        let inverse = gain.clone().try_inverse().filter(|inverse| is_accurate(inverse, &gain))?;
        let covariance = &gain * covariance * gain.transpose();
        Some((&self.k * inverse, (&covariance + covariance.transpose()) * 0.5))
    }
}

/// Whether an inverse has digits left.
fn is_accurate(inverse: &DMatrix<f64>, matrix: &DMatrix<f64>) -> bool {
    inverse.norm() * matrix.norm() < 1e14
}

fn at_minus_one(what: &str) -> Error {
    Error::undetermined(
        Vec::new(),
        format!("{what} at -1, which `tustin` maps to infinity: it alternates from sample to sample"),
    )
}

/// # Errors
/// [`Error::Undetermined`] for poles at or left of 0.
fn refuse_without_logarithm(poles: &[Complex<f64>]) -> Result<(), Error> {
    let at_zero = poles.iter().filter(|pole| pole.re == 0.0 && pole.im == 0.0).count();
    let negative = poles.iter().filter(|pole| pole.re < 0.0 && pole.im == 0.0);
    let negative: Vec<String> = negative.map(|pole| figures::short(pole.re)).collect();
    let mut wrong = Vec::new();
    if at_zero > 0 {
        let (poles, delay) =
            if at_zero == 1 { ("one pole", "a delay of one sample") } else { ("poles", "delays of samples") };
        let count = if at_zero == 1 { String::new() } else { format!("{at_zero} ") };
        wrong.push(format!(
            "it has {count}{poles} at 0, {delay}, which no finite state is in continuous time: strip the delay first"
        ));
    }
    if !negative.is_empty() {
        let (poles, have) = if negative.len() == 1 { ("pole", "has") } else { ("poles", "have") };
        wrong.push(format!(
            "the {poles} {} on the negative real axis {have} no real logarithm: take a shorter sample time, or a lower order",
            negative.join(", ")
        ));
    }
    if wrong.is_empty() {
        return Ok(());
    }
    Err(Error::undetermined(
        Vec::new(),
        format!(
            "the model has no counterpart in continuous time with a held input: {}; `tustin` takes any pole but -1",
            wrong.join("; ")
        ),
    ))
}

#[cfg(test)]
mod tests;
