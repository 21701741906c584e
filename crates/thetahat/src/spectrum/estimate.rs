//! What methods find at each frequency, in the units of [`Signals`](super::signals::Signals).

use thetahat_core::nalgebra::{Cholesky, Complex, DMatrix, DVector, Dyn};

use super::plan::{Estimator, Method};

/// Power below this fraction of an input's largest is none.
pub(super) const EMPTY: f64 = 1e-12;
/// Inputs of which less than this fraction of the power is their own cannot be told apart.
const OWN: f64 = 1e-10;
/// A spectrum of the noise below zero by this fraction of the output's is rounding.
const ROUNDING: f64 = 1e-9;

/// What a method found.
pub(super) struct Estimate {
    /// The method, its sizes known.
    pub(super) method: Method,
    /// One for each frequency, in rising order.
    pub(super) lines: Vec<Line>,
    /// What is known of the bands.
    pub(super) bands: Bands,
    /// What the reader should know, in plain words.
    pub(super) words: Vec<String>,
}

/// Whether the bands hold what they say.
pub(super) enum Bands {
    /// There are none.
    None(&'static str),
    /// They do: the method counts its own bias.
    Honest(&'static str),
    /// The same estimate with twice the resolution: where it lies too far away, the bands leave the bias out.
    Against(Vec<Line>),
    /// There are too few rows for twice the resolution.
    Unknown(&'static str),
}

/// One frequency.
pub(super) struct Line {
    /// In radians per sample.
    pub(super) angle: f64,
    /// What is there.
    pub(super) found: Result<LineEstimate, Empty>,
}

/// The estimate at one line of the spectrum.
pub(super) struct LineEstimate {
    /// The first of the inputs that responses are from.
    pub(super) first: usize,
    /// From each input, or from one of them.
    pub(super) responses: Vec<Complex<f64>>,
    /// The variances of their real parts, and of their imaginary parts, which are independent; none where there is no
    /// spread to tell.
    pub(super) variances: Option<Vec<f64>>,
    /// Degrees of freedom of the variances.
    pub(super) degrees: usize,
    /// The spectrum of the noise for each sample: its mean over -pi … pi is the variance.
    pub(super) noise: Option<f64>,
    /// The multiple coherence of all inputs with the output.
    pub(super) coherence: Option<f64>,
}

impl LineEstimate {
    /// The response from an input and the variance of its real part, where they are known.
    pub(super) fn of(&self, input: usize) -> Option<(Complex<f64>, Option<f64>)> {
        let at = input.checked_sub(self.first)?;
        let variance = self.variances.as_ref().and_then(|all| all.get(at).copied());
        Some((*self.responses.get(at)?, variance))
    }
}

/// Why a line tells nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Empty {
    /// An input has no power there.
    Input(usize),
    /// The inputs move together there.
    Together,
}

/// Spectra of all channels, the output last, at some frequencies.
pub(super) struct CrossSpectra {
    pub(super) channels: usize,
    /// In radians per sample.
    pub(super) angles: Vec<f64>,
    /// For each frequency S_ab = E a conj(b), a <= b, row by row.
    pub(super) values: Vec<Complex<f64>>,
    /// How many independent periodograms they are the mean of.
    pub(super) averages: f64,
}

/// How many pairs of channels there are.
pub(super) fn pairs(channels: usize) -> usize {
    channels * (channels + 1) / 2
}

impl CrossSpectra {
    fn value(&self, line: usize, a: usize, b: usize) -> Complex<f64> {
        let at = |a: usize, b: usize| {
            self.values[line * pairs(self.channels) + a * self.channels - a * a.saturating_sub(1) / 2 + b - a]
        };
        if a <= b { at(a, b) } else { at(b, a).conj() }
    }

    /// With S_uu the spectra of the inputs and s those of the output with each of them, n averages and p inputs:
    ///
    /// ```text
    /// G S_uu = s,   S_v = S_yy - G s^H,   gamma^2 = 1 - S_v/S_yy,   var G_j = S_v [S_uu^-1]_jj/(n - p)
    /// ```
    ///
    /// For one input that is |G|^2 (1 - gamma^2)/((n - 1) gamma^2), half of it in the real and half in the imaginary
    /// part (Bendat and Piersol, Random Data, 4th ed. 2010, section 9.2, with n - 1 for n as S_v is estimated too). The
    /// same holds of H2.
    pub(super) fn lines(&self, estimator: Estimator) -> Vec<Line> {
        let inputs = self.channels - 1;
        let powers = |j: usize| (0..self.angles.len()).map(move |line| self.value(line, j, j).re);
        let largest: Vec<f64> = (0..inputs).map(|j| powers(j).fold(0.0, f64::max)).collect();
        let lines = self.angles.iter().enumerate();
        lines.map(|(line, &angle)| Line { angle, found: self.line(line, &largest, estimator) }).collect()
    }

    fn line(&self, line: usize, largest: &[f64], estimator: Estimator) -> Result<LineEstimate, Empty> {
        let inputs = self.channels - 1;
        let power = |j: usize| self.value(line, j, j).re;
        if let Some(empty) = (0..inputs).find(|&j| power(j) <= EMPTY * largest[j]) {
            return Err(Empty::Input(empty));
        }
        // Scaled to a unit diagonal: pivots are then the parts of each input that are its own.
        let unit: Vec<f64> = (0..inputs).map(|j| power(j).sqrt()).collect();
        let matrix =
            DMatrix::from_fn(inputs, inputs, |j, k| self.value(line, k, j).unscale(unit[j] * unit[k]));
        let cross = DVector::from_fn(inputs, |j, _| self.value(line, inputs, j).unscale(unit[j]));
        let factor: Cholesky<Complex<f64>, Dyn> = Cholesky::new(matrix).ok_or(Empty::Together)?;
        if factor.l_dirty().diagonal().iter().any(|pivot| pivot.re * pivot.re < OWN) {
            return Err(Empty::Together);
        }
        let scaled = factor.solve(&cross);
        let output = power(inputs);
        let explained: f64 = scaled.iter().zip(&cross).map(|(g, s)| (g * s.conj()).re).sum();
        let noise = (output - explained).max(0.0);
        // A lag window may take more from a spectrum than there is: what is left of it then tells nothing.
        let is_spectrum = output - explained >= -ROUNDING * explained;
        let coherence = if output > 0.0 { (explained / output).clamp(0.0, 1.0) } else { 0.0 };
        let ratio = match estimator {
            Estimator::H1 => 1.0,
            Estimator::H2 if coherence > 0.0 => 1.0 / coherence,
            Estimator::H2 => return Err(Empty::Input(0)),
        };
        let left = self.averages - inputs as f64;
        let spread = |inverse: &DMatrix<Complex<f64>>, j: usize| {
            0.5 * noise * inverse[(j, j)].re / (left * unit[j] * unit[j]) * ratio * ratio
        };
        let variances = (left >= 1.0 && is_spectrum).then(|| {
            let inverse = factor.inverse();
            (0..inputs).map(|j| spread(&inverse, j)).collect()
        });
        Ok(LineEstimate {
            first: 0,
            responses: scaled.iter().zip(&unit).map(|(g, unit)| g.unscale(*unit).scale(ratio)).collect(),
            variances,
            degrees: (2.0 * left).max(1.0) as usize,
            noise: is_spectrum.then_some(noise),
            coherence: is_spectrum.then_some(coherence),
        })
    }
}
