//! Models of numbers that are known, which nobody estimated.

mod options;
mod realisation;
#[cfg(test)]
mod tests;

use thetahat_core::nalgebra::{Complex, DMatrix};

use super::state_space::Head;
use super::{
    ContinuousStateSpace, ContinuousStateSpaceModel, Hold, Model, Orders, Parameter, PolynomialModel,
    ProcessModel, ProcessStructure, Signal, StateSpace, StateSpaceModel, TimeBase,
};
use crate::Error;
pub use options::{Coefficients, KnownOptions, Matrix};
use realisation::{degree, realised};

/// Of a model in continuous time the sample time that responses and filters take where nobody says one is this part of
/// the shortest time constant.
const STEP: f64 = 0.1;
/// A pole nearer to the real axis, or to 0, than this part of the largest one lies on it.
const AT_ZERO: f64 = 1e-9;

/// Polynomials in rising powers of q^-1: A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t) + C(q)/D(q) e(t). Zeros at the
/// beginning of B are samples that the input waits.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Polynomials {
    /// A, monic; empty: 1.
    pub a: Vec<f64>,
    /// B, one for each input.
    pub b: Vec<Vec<f64>>,
    /// C, monic; empty: 1.
    pub c: Vec<f64>,
    /// D, monic; empty: 1.
    pub d: Vec<f64>,
    /// F, monic, one for each input, or one for all; empty: 1.
    pub f: Vec<Vec<f64>>,
}

/// A ratio of polynomials in falling powers of z or s.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferFunction {
    /// Of no higher degree than the denominator.
    pub numerator: Vec<f64>,
    /// Its first coefficient is not zero.
    pub denominator: Vec<f64>,
    /// The dead time in seconds; of a sampled model whole samples.
    pub delay: f64,
}

/// Channels by name.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelNames {
    /// The inputs, in their order.
    pub inputs: Vec<String>,
    /// The outputs, in their order.
    pub outputs: Vec<String>,
}

impl ChannelNames {
    fn signals(&self) -> Result<(Vec<Signal>, Vec<Signal>), Error> {
        let names: Vec<&String> = self.inputs.iter().chain(&self.outputs).collect();
        if let Some(twice) = (1..names.len()).find(|&place| names[..place].contains(&names[place])) {
            let message = format!("'{}' is named twice; a channel has one role", names[twice]);
            return Err(Error::argument("output", message));
        }
        let each = |names: &[String]| {
            names.iter().map(|name| Signal { name: name.clone(), ..Signal::default() }).collect()
        };
        Ok((each(&self.inputs), each(&self.outputs)))
    }

    /// That there are so many of them.
    fn check(&self, inputs: usize, outputs: usize) -> Result<(), Error> {
        for (option, names, count) in [("input", &self.inputs, inputs), ("output", &self.outputs, outputs)] {
            if names.len() != count {
                let message =
                    format!("there are {} names for {count} channels; give one for each", names.len());
                return Err(Error::argument(option, message));
            }
        }
        Ok(())
    }
}

impl Model {
    /// A model of polynomials.
    ///
    /// # Errors
    /// [`Error::Argument`] for polynomials that are not monic or not finite, numbers of channels that do not fit, a
    /// variance below 0 and a sample time that is not above 0.
    ///
    /// ```
    /// use thetahat::model::{ChannelNames, Model, Polynomials};
    ///
    /// // y(t) = 0.9 y(t-1) + 0.5 u(t-2) + e(t)
    /// let known = Polynomials { a: vec![1.0, -0.9], b: vec![vec![0.0, 0.0, 0.5]], ..Polynomials::default() };
    /// let channels = ChannelNames { inputs: vec!["u".into()], outputs: vec!["y".into()] };
    /// let model = Model::from_polynomials(&known, &channels, 0.01, 1.0)?;
    /// assert_eq!(model.name(), "ARX(1, 1, 2)");
    /// assert!((model.static_gains().unwrap()[0][0].unwrap().value - 5.0).abs() < 1e-12);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn from_polynomials(
        known: &Polynomials,
        channels: &ChannelNames,
        noise_variance: f64,
        sample_time: f64,
    ) -> Result<Self, Error> {
        let count = known.b.len();
        channels.check(count, 1)?;
        check_time(sample_time)?;
        check_variance(noise_variance)?;
        let one = vec![1.0];
        let f: Vec<&Vec<f64>> = match known.f.as_slice() {
            [] => vec![&one; count],
            [all] => vec![all; count],
            several if several.len() == count => several.iter().collect(),
            several => {
                let message = format!(
                    "there are {} for {count} inputs; give one for each, or one for all",
                    several.len()
                );
                return Err(Error::argument("f", message));
            }
        };
        let [a, c, d] =
            [("a", &known.a), ("c", &known.c), ("d", &known.d)].map(|(name, values)| monic(name, values));
        let (a, c, d) = (a?, c?, d?);
        let f: Vec<&[f64]> = f.into_iter().map(|values| monic("f", values)).collect::<Result<_, _>>()?;
        known.b.iter().try_for_each(|b| finite("b", b))?;
        let waits = |b: &Vec<f64>| b.iter().take_while(|value| **value == 0.0).count();
        if known.b.iter().any(|b| waits(b) == b.len()) {
            return Err(Error::argument(
                "b",
                "all of its coefficients are zero: the input does nothing; leave it out",
            ));
        }
        let nk: Vec<usize> = known.b.iter().map(waits).collect();
        let nb: Vec<usize> = known.b.iter().zip(&nk).map(|(b, nk)| b.len() - nk).collect();
        let nf: Vec<usize> = f.iter().map(|f| f.len()).collect();
        let orders = Orders::new(a.len(), &nb, c.len(), d.len(), &nf, &nk)?;
        let b = known.b.iter().zip(&nk).flat_map(|(b, nk)| &b[*nk..]);
        // In the order of the names of parameters.
        let values: Vec<f64> =
            a.iter().chain(b).chain(c).chain(d).chain(f.iter().copied().flatten()).copied().collect();
        let mut model =
            PolynomialModel::from_parameters(&orders, &values, None, noise_variance, sample_time)?;
        let (inputs, mut outputs) = channels.signals()?;
        model.inputs = inputs;
        model.output = outputs.pop().unwrap_or_default();
        Ok(model.into())
    }

    /// A model in state space, x(t+1) = F x + G u + K e, y = H x + D u + e.
    ///
    /// # Errors
    /// [`Error::Argument`] for matrices that do not fit together or are not finite, and for names that do not fit.
    pub fn from_state_space(matrices: &StateSpace, channels: &ChannelNames) -> Result<Self, Error> {
        channels.check(matrices.g.ncols(), matrices.h.nrows())?;
        check_time(matrices.sample_time)?;
        matrices.check()?;
        check_covariance(&matrices.noise_covariance)?;
        let inputs = channels.inputs.len();
        StateSpaceModel::new(channels.signals()?, vec![0; inputs], matrices, 0, None).map(Self::from)
    }

    /// A model in continuous time, dx/dt = A x + B u + K e, y = C x + D u + e, whose inputs wait so many seconds.
    /// Without a `sample_time` responses and filters take a tenth of the shortest time constant.
    ///
    /// # Errors
    /// As for [`from_state_space`](Self::from_state_space); [`Error::Argument`] for a delay below 0.
    pub fn from_continuous_state_space(
        matrices: &ContinuousStateSpace,
        channels: &ChannelNames,
        delays: &[f64],
        (sample_time, hold): (Option<f64>, Hold),
    ) -> Result<Self, Error> {
        let inputs = matrices.b.ncols();
        channels.check(inputs, matrices.c.nrows())?;
        matrices.renamed().check()?;
        check_covariance(&matrices.noise_intensity)?;
        if delays.len() != inputs || !delays.iter().all(|delay| *delay >= 0.0 && delay.is_finite()) {
            return Err(Error::argument("delay", "give one for each input, 0 or more seconds"));
        }
        let seconds = match sample_time {
            Some(seconds) => seconds,
            None => step(matrices)?,
        };
        check_time(seconds)?;
        let (inputs, outputs) = channels.signals()?;
        let head = Head {
            inputs,
            outputs,
            delays: delays.to_vec(),
            sample_time: seconds,
            hold,
            free_parameters: 0,
            degrees_of_freedom: None,
        };
        ContinuousStateSpaceModel::new(head, matrices).map(Self::from)
    }

    /// A model of transfer functions, for each output one from each input: of one output and sampled polynomials B/F,
    /// else a state for each pole.
    ///
    /// `noise` is the covariance of e in samples, a matrix of zeros without it.
    ///
    /// # Errors
    /// [`Error::Argument`] for a denominator that begins with zero, a numerator of a higher degree, numbers that are
    /// not finite, and delays that differ between the outputs in continuous time; as for the other constructors.
    ///
    /// ```
    /// use thetahat::model::{ChannelNames, Hold, Model, TimeBase, TransferFunction};
    ///
    /// // 3 e^(-0.5 s)/(1 + 2 s)
    /// let known = TransferFunction { numerator: vec![3.0], denominator: vec![2.0, 1.0], delay: 0.5 };
    /// let channels = ChannelNames { inputs: vec!["u".into()], outputs: vec!["y".into()] };
    /// let time = (TimeBase::Continuous, Hold::Zero);
    /// let model = Model::from_transfer_functions(&[vec![known]], &channels, None, time)?;
    /// assert_eq!(model.stability(), Some(true));
    /// assert!((model.sample_time() - 0.2).abs() < 1e-12);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn from_transfer_functions(
        functions: &[Vec<TransferFunction>],
        channels: &ChannelNames,
        noise: Option<&DMatrix<f64>>,
        (time, hold): (TimeBase, Hold),
    ) -> Result<Self, Error> {
        let (outputs, inputs) = (functions.len(), functions.first().map_or(0, Vec::len));
        channels.check(inputs, outputs)?;
        if functions.iter().any(|row| row.len() != inputs) {
            return Err(Error::argument("num", "give a transfer function from each input to each output"));
        }
        functions.iter().flatten().try_for_each(TransferFunction::check)?;
        let none = DMatrix::zeros(outputs, outputs);
        let noise = noise.unwrap_or(&none);
        match time {
            TimeBase::Sampled(seconds) => {
                check_time(seconds)?;
                let whole = |function: &TransferFunction| {
                    let samples = function.delay / seconds;
                    let rounded = samples.round();
                    if (samples - rounded).abs() > 1e-9 * rounded.max(1.0) || rounded > super::LARGEST as f64
                    {
                        let message = format!(
                            "{} s are not whole samples of {seconds} s, {} at most",
                            function.delay,
                            super::LARGEST
                        );
                        return Err(Error::argument("delay", message));
                    }
                    // A sample is a pole at 0.
                    let mut delayed = function.clone();
                    delayed.denominator.extend(vec![0.0; rounded as usize]);
                    Ok(delayed)
                };
                let functions: Vec<Vec<TransferFunction>> = functions
                    .iter()
                    .map(|row| row.iter().map(whole).collect::<Result<_, _>>())
                    .collect::<Result<_, Error>>()?;
                if let [row] = functions.as_slice() {
                    let known = Polynomials {
                        b: row.iter().map(TransferFunction::b).collect(),
                        f: row.iter().map(TransferFunction::f).collect(),
                        ..Polynomials::default()
                    };
                    return Self::from_polynomials(&known, channels, noise[(0, 0)], seconds);
                }
                let ContinuousStateSpace { a, b, c, d, k, .. } = realised(&functions);
                let matrices = StateSpace {
                    f: a,
                    g: b,
                    h: c,
                    d,
                    k,
                    noise_covariance: noise.clone(),
                    sample_time: seconds,
                };
                Self::from_state_space(&matrices, channels)
            }
            TimeBase::Continuous => {
                let first = &functions[0];
                let same = |row: &Vec<TransferFunction>| {
                    row.iter().zip(first).all(|(one, other)| one.delay == other.delay)
                };
                if !functions.iter().all(same) {
                    return Err(Error::argument(
                        "delay",
                        "an input waits as long for every output; give models of one output each, or one delay",
                    ));
                }
                let delays: Vec<f64> = first.iter().map(|function| function.delay).collect();
                let mut matrices = realised(functions);
                let seconds = step(&matrices)?;
                matrices.noise_intensity = noise * seconds;
                Self::from_continuous_state_space(&matrices, channels, &delays, (Some(seconds), hold))
            }
        }
    }
}

impl ContinuousStateSpaceModel {
    /// Gain, lags and dead time, where it is a process: of one input and one output, with real poles, an integrator at
    /// most among them, and no zeros. Without errors of its parameters.
    pub(super) fn as_process(&self) -> Option<ProcessModel> {
        let ([input], [output], [delay]) = (&*self.inputs, &*self.outputs, &*self.delays) else {
            return None;
        };
        let transfer = self.transfer(0, 0).ok()?;
        let size = transfer.poles.iter().map(|pole| pole.re.hypot(pole.im)).fold(0.0, f64::max);
        let near = |value: f64| value.abs() <= AT_ZERO * size;
        if !transfer.zeros.is_empty()
            || !transfer.poles.iter().all(|pole| near(pole.im) && pole.re <= AT_ZERO * size)
        {
            return None;
        }
        let (integrators, lags): (Vec<Complex<f64>>, Vec<Complex<f64>>) =
            transfer.poles.iter().copied().partition(|pole| near(pole.re));
        let mut taus: Vec<f64> = lags.iter().map(|pole| -1.0 / pole.re).collect();
        taus.sort_unstable_by(|one, other| other.total_cmp(one));
        if integrators.len() > 1 {
            return None;
        }
        let letters = [("i", !integrators.is_empty()), ("d", *delay > 0.0)];
        let letters: String = letters.iter().filter(|(_, has)| *has).map(|(letter, _)| *letter).collect();
        let structure: ProcessStructure = format!("p{}{letters}", taus.len()).parse().ok()?;
        let gain = transfer.gain * taus.iter().product::<f64>();
        let values = std::iter::once(gain).chain(taus).chain((*delay > 0.0).then_some(*delay));
        let parameters = structure.names().into_iter().zip(values);
        let parameter = |(name, value)| Parameter { name, value, standard_error: None };
        Some(ProcessModel {
            structures: vec![structure],
            sample_time: self.sample_time,
            inputs: vec![input.clone()],
            output: output.clone(),
            parameters: parameters.map(parameter).collect(),
            covariance: None,
            offset_covariance: None,
            noise_variance: self
                .noise_intensity
                .first()
                .and_then(|row| row.first())
                .map_or(0.0, |own| own / self.sample_time),
            degrees_of_freedom: None,
            free_start: false,
        })
    }
}

impl TransferFunction {
    fn check(&self) -> Result<(), Error> {
        finite("num", &self.numerator)?;
        finite("den", &self.denominator)?;
        match self.denominator.first() {
            None | Some(0.0) => {
                return Err(Error::argument(
                    "den",
                    "its first coefficient, of the highest power, must not be zero",
                ));
            }
            Some(_) => {}
        }
        if self.numerator.iter().all(|value| *value == 0.0) {
            return Err(Error::argument("num", "all of its coefficients are zero; leave the input out"));
        }
        if degree(&self.numerator) > self.denominator.len() - 1 {
            return Err(Error::argument(
                "num",
                "its degree is above that of the denominator: such a model would know the future",
            ));
        }
        if !(self.delay >= 0.0 && self.delay.is_finite()) {
            return Err(Error::argument("delay", format!("it is {}; give 0 or more seconds", self.delay)));
        }
        Ok(())
    }

    /// The numerator in rising powers of q^-1, for a monic denominator.
    fn b(&self) -> Vec<f64> {
        let waits = self.denominator.len() - 1 - degree(&self.numerator);
        let own = self.numerator.iter().skip(self.numerator.len() - 1 - degree(&self.numerator));
        let mut b: Vec<f64> =
            std::iter::repeat_n(0.0, waits).chain(own.map(|value| value / self.denominator[0])).collect();
        while b.last() == Some(&0.0) {
            b.pop();
        }
        b
    }

    /// The monic denominator in rising powers of q^-1.
    fn f(&self) -> Vec<f64> {
        let mut f: Vec<f64> = self.denominator.iter().map(|value| value / self.denominator[0]).collect();
        while f.last() == Some(&0.0) {
            f.pop();
        }
        f
    }
}

/// A monic polynomial without its leading 1.
fn monic<'v>(option: &str, values: &'v [f64]) -> Result<&'v [f64], Error> {
    finite(option, values)?;
    match values {
        [] => Ok(&[]),
        [first, others @ ..] if *first == 1.0 => Ok(others),
        [first, ..] => Err(Error::argument(
            option,
            format!("it begins with {first}, and must begin with 1; divide all coefficients by that"),
        )),
    }
}

fn finite(option: &str, values: &[f64]) -> Result<(), Error> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(value) => Err(Error::argument(option, format!("it has {value}; give finite numbers"))),
        None => Ok(()),
    }
}

fn check_time(seconds: f64) -> Result<(), Error> {
    if seconds > 0.0 && seconds.is_finite() {
        return Ok(());
    }
    Err(Error::argument("sample-time", format!("it is {seconds} s; give one above 0")))
}

fn check_variance(variance: f64) -> Result<(), Error> {
    if variance >= 0.0 && variance.is_finite() {
        return Ok(());
    }
    Err(Error::argument("noise-covariance", format!("it is {variance}; give 0 or more")))
}

/// That it is one of a noise.
fn check_covariance(covariance: &DMatrix<f64>) -> Result<(), Error> {
    let rows: Vec<Vec<f64>> = covariance.row_iter().map(|row| row.iter().copied().collect()).collect();
    let zero = covariance.iter().all(|value| *value == 0.0);
    let symmetric = *covariance == covariance.transpose();
    if zero || (symmetric && super::is_covariance(&rows)) {
        return Ok(());
    }
    Err(Error::argument(
        "noise-covariance",
        "it is no covariance: symmetric, with variances above 0 on its diagonal",
    ))
}

/// The step that responses take of a model in continuous time: a part of its shortest time constant; 1 s without one.
fn step(matrices: &ContinuousStateSpace) -> Result<f64, Error> {
    let fastest = matrices.poles()?.iter().map(|pole| pole.re.hypot(pole.im)).fold(0.0, f64::max);
    Ok(if fastest > 0.0 { STEP / fastest } else { 1.0 })
}
