//! Models at other sample times and in continuous time.

use std::fmt;
use std::str::FromStr;

use thetahat_core::nalgebra::{DMatrix, DVector};

use super::process::MOST_STATES;
use super::state_space::{Head, STEP, Steps, independent};
use super::{
    ContinuousStateSpace, ContinuousStateSpaceModel, EntryCovariance, Hold, Model, Parts, PolynomialModel,
    ProcessModel, StateSpace, StateSpaceModel,
};
use crate::{Error, figures};

/// Sample times closer than this fraction are the same.
const SAME: f64 = 1e-9;
/// More samples than this in the place of one are counted by no power of F.
const MOST_STEPS: f64 = 1e9;

/// Which time a model goes by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TimeBase {
    /// Continuous time.
    Continuous,
    /// Samples every so many seconds.
    Sampled(f64),
}

impl FromStr for TimeBase {
    type Err = Error;

    /// The word `continuous`, or seconds.
    fn from_str(text: &str) -> Result<Self, Error> {
        if text.trim() == "continuous" {
            return Ok(Self::Continuous);
        }
        let seconds = text.trim().parse::<f64>().ok().filter(|seconds| *seconds > 0.0 && seconds.is_finite());
        seconds.map(Self::Sampled).ok_or_else(|| {
            Error::argument(
                "to",
                format!(
                    "'{text}' is neither the word continuous nor a number of seconds above 0, such as 0.05"
                ),
            )
        })
    }
}

impl fmt::Display for TimeBase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Continuous => f.write_str("continuous time"),
            Self::Sampled(seconds) => write!(f, "a sample time of {} s", figures::short(*seconds)),
        }
    }
}

/// A sampled model whose delays are taken off.
struct Plant {
    matrices: StateSpace,
    /// Samples.
    delays: Vec<usize>,
    free_parameters: usize,
    degrees_of_freedom: Option<usize>,
}

impl Model {
    /// The model in continuous time whose samples are this one, its inputs doing between samples what `hold` says: see
    /// [`StateSpace::to_continuous`]. Delays of samples are taken off before and are delays in seconds. A process is in
    /// continuous time as it is. Errors of parameters go through to first order (the delta method), by differences to
    /// either side along each direction in which they vary; those of a process do not.
    ///
    /// # Errors
    /// [`Error::Argument`] for models that are not linear, or written in equations, and one in continuous time already;
    /// those of [`StateSpace::to_continuous`].
    ///
    /// ```
    /// use thetahat::data::Record;
    /// use thetahat::estimate::{Initial, arx};
    /// use thetahat::model::{Hold, Model, Orders, Signal};
    ///
    /// // y(t) = 0.8 y(t-1) + 0.5 u(t-3) every 0.1 s: a pole at ln 0.8/0.1 a second, and a delay of two samples.
    /// let u: Vec<f64> = (0..100_u32).map(|t| f64::from(t * t % 7)).collect();
    /// let mut y = vec![0.0; 3];
    /// for t in 3..u.len() {
    ///     y.push(0.8 * y[t - 1] + 0.5 * u[t - 3]);
    /// }
    /// let orders = Orders::arx(1, &[1], &[3])?;
    /// let estimate = arx(&Record::new(&y, vec![&u])?, &orders, Initial::Drop)?;
    /// let signal = |name: &str| Signal { name: name.into(), ..Signal::default() };
    /// let model = Model::from(estimate.to_model(&orders, 0.1, vec![signal("u")], signal("y"))?);
    ///
    /// let continuous = model.to_continuous(Hold::Zero)?;
    /// assert!((continuous.poles[0].re - 0.8_f64.ln() / 0.1).abs() < 1e-8);
    /// assert!((continuous.delays[0] - 0.2).abs() < 1e-12);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn to_continuous(&self, hold: Hold) -> Result<ContinuousStateSpaceModel, Error> {
        match self {
            Self::Process(model) => model.in_state_space(hold),
            Self::ContinuousStateSpace(_) => {
                Err(Error::argument("to", "the model is in continuous time already; give a sample time"))
            }
            Self::Polynomial(_) | Self::StateSpace(_) | Self::Equations(_) | Self::NonlinearArx(_) => {
                let plant = self.plant()?;
                let seconds = plant.matrices.sample_time;
                let head = Head {
                    inputs: self.inputs().to_vec(),
                    outputs: self.outputs().to_vec(),
                    delays: plant.delays.iter().map(|delay| *delay as f64 * seconds).collect(),
                    sample_time: seconds,
                    hold,
                    free_parameters: plant.free_parameters,
                    degrees_of_freedom: plant.degrees_of_freedom,
                };
                let matrices = plant.matrices.to_continuous(hold)?;
                let model = ContinuousStateSpaceModel::new(head, &matrices)?;
                let known = self.varied().and_then(|pairs| {
                    let converted = |moved: &StateSpace| Some(moved.to_continuous(hold).ok()?.renamed());
                    let pairs = pairs.iter().map(|[plus, minus]| Some([converted(plus)?, converted(minus)?]));
                    EntryCovariance::of_pairs(&matrices.renamed(), &pairs.collect::<Option<Vec<_>>>()?)
                });
                Ok(match known {
                    Some(known) => model.with_covariance(known),
                    None => model,
                })
            }
        }
    }

    /// The model as samples every so many seconds see it, by continuous time: see
    /// [`ContinuousStateSpaceModel::sampled`]. Without a `hold` that of a model in continuous time, and `zoh` for
    /// others. With `zoh` and whole multiples of the own sample time poles that have no logarithm need none: so many
    /// steps are one.
    ///
    /// # Errors
    /// Those of [`Model::to_continuous`] and [`ContinuousStateSpaceModel::sampled`].
    pub fn at_sample_time(&self, seconds: f64, hold: Option<Hold>) -> Result<StateSpaceModel, Error> {
        if !(seconds > 0.0 && seconds.is_finite()) {
            return Err(Error::argument("to", format!("it is {seconds} s; it must be above 0 and finite")));
        }
        let hold = match self {
            Self::ContinuousStateSpace(model) => return model.sampled(seconds, hold.unwrap_or(model.hold)),
            Self::Process(model) => {
                let hold = hold.unwrap_or_default();
                return model.in_state_space(hold)?.sampled(seconds, hold);
            }
            Self::Polynomial(_) | Self::StateSpace(_) | Self::Equations(_) | Self::NonlinearArx(_) => {
                hold.unwrap_or_default()
            }
        };
        let Plant { matrices, delays, free_parameters, degrees_of_freedom } = self.plant()?;
        let signals = || (self.inputs().to_vec(), self.outputs().to_vec());
        let ratio = seconds / matrices.sample_time;
        if (ratio - 1.0).abs() <= SAME {
            let model =
                StateSpaceModel::new(signals(), delays, &matrices, free_parameters, degrees_of_freedom)?;
            let known = self.varied().and_then(|pairs| EntryCovariance::of_pairs(&matrices, &pairs));
            return Ok(match known {
                Some(known) => model.with_covariance(known),
                None => model,
            });
        }
        match self.to_continuous(hold) {
            Ok(model) => model.sampled(seconds, hold),
            Err(Error::Undetermined { .. })
                if hold == Hold::Zero
                    && ratio < MOST_STEPS
                    && ratio > 1.0
                    && (ratio - ratio.round()).abs() <= SAME * ratio =>
            {
                let slower = matrices.delayed(&delays).every(ratio.round() as u64, seconds)?;
                let none = vec![0; delays.len()];
                StateSpaceModel::new(signals(), none, &slower, free_parameters, degrees_of_freedom)
            }
            Err(error) => Err(error),
        }
    }

    /// The recursion to either side along each direction in which the model varies, without the samples that inputs
    /// wait; none where its errors are not known.
    fn varied(&self) -> Option<Vec<[StateSpace; 2]>> {
        match self {
            Self::Polynomial(model) => {
                let moved = |direction: &DVector<f64>, sign: f64| {
                    let values = model.parameters.iter().zip(direction);
                    let values: Vec<f64> =
                        values.map(|(parameter, by)| parameter.value + sign * STEP * by).collect();
                    let PolynomialModel { orders, noise_variance, sample_time, .. } = &**model;
                    let moved = PolynomialModel::from_parameters(
                        orders,
                        &values,
                        None,
                        *noise_variance,
                        *sample_time,
                    );
                    Some(moved.ok()?.without_delays().0)
                };
                let directions = independent(model.covariance.as_deref()?)?;
                directions.iter().map(|one| Some([moved(one, 1.0)?, moved(one, -1.0)?])).collect()
            }
            Self::StateSpace(model) => {
                let pairs = model.covariance.as_ref()?.varied(&model.matrices())?;
                let plant = |whole: StateSpace| stripped(whole, &model.delays).0;
                Some(pairs.into_iter().map(|pair| pair.map(plant)).collect())
            }
            Self::Process(_) | Self::ContinuousStateSpace(_) | Self::Equations(_) | Self::NonlinearArx(_) => {
                None
            }
        }
    }

    /// The recursion, without the samples that inputs wait.
    fn plant(&self) -> Result<Plant, Error> {
        let (matrices, delays, free_parameters, degrees_of_freedom) = if let Some(model) =
            self.as_polynomial()
        {
            let (matrices, delays) = model.without_delays();
            (matrices, delays, model.parameters.len(), model.degrees_of_freedom)
        } else if let Some(model) = self.as_state_space() {
            let (matrices, delays) = model.without_delays();
            (matrices, delays, model.free_parameters, model.degrees_of_freedom)
        } else {
            return Err(Error::argument(
                "model",
                format!(
                    "models of polynomials, in state space and of processes are converted to other sample times, and this one is {}; fit \
                         one of these, or resample the log",
                    self.name()
                ),
            ));
        };
        Ok(Plant { matrices, delays, free_parameters, degrees_of_freedom })
    }
}

impl StateSpace {
    /// The model as every `count`-th sample sees it, its inputs held in between: powers of F, and the noise of single
    /// measurements.
    fn every(&self, count: u64, seconds: f64) -> Result<Self, Error> {
        let one = Steps::one(self);
        let before = Steps::repeated(&one, count - 1);
        // What e does at first lasts until the next sample.
        let k = &before.f * &self.k;
        let Steps { f, g, covariance } = before.then(&one);
        let slower = Self {
            f,
            g,
            h: self.h.clone(),
            d: self.d.clone(),
            k,
            noise_covariance: self.noise_covariance.clone(),
            sample_time: seconds,
        };
        slower.innovations_form(&covariance)
    }
}

impl StateSpaceModel {
    fn without_delays(&self) -> (StateSpace, Vec<usize>) {
        stripped(self.matrices(), &self.delays)
    }
}

/// The matrices without the states that wait, and how many wait of each input; of a model whose last states are no
/// samples that wait, all of them.
fn stripped(whole: StateSpace, delays: &[usize]) -> (StateSpace, Vec<usize>) {
    let n = whole.f.nrows().saturating_sub(delays.iter().sum());
    let mut plant = StateSpace {
        f: whole.f.view((0, 0), (n, n)).into_owned(),
        g: whole.g.rows(0, n).into_owned(),
        h: whole.h.columns(0, n).into_owned(),
        k: whole.k.rows(0, n).into_owned(),
        ..whole.clone()
    };
    let mut first = n;
    for (input, &delay) in delays.iter().enumerate().filter(|(_, delay)| **delay > 0) {
        let seen = first + delay - 1;
        plant.g.set_column(input, &whole.f.column(seen).rows(0, n));
        plant.d.set_column(input, &whole.h.column(seen));
        first += delay;
    }
    if plant.delayed(delays) == whole { (plant, delays.to_vec()) } else { (whole, vec![0; delays.len()]) }
}

impl PolynomialModel {
    /// The recursion without the samples that inputs wait, beyond the one that a held input has by itself, and how many
    /// these are.
    fn without_delays(&self) -> (StateSpace, Vec<usize>) {
        let mut own = self.clone();
        let mut delays = vec![0; own.b.len()];
        for ((b, nk), delay) in own.b.iter_mut().zip(&mut own.orders.nk).zip(&mut delays) {
            *delay = nk.saturating_sub(1).min(b.len());
            *nk -= *delay;
            b.drain(..*delay);
        }
        (own.state_space(), delays)
    }
}

impl ProcessModel {
    /// A, B, C and D, and the dead times as delays, with the errors that follow from those of the parameters; delays
    /// have none. Errors are white from sample to sample.
    pub(super) fn in_state_space(&self, hold: Hold) -> Result<ContinuousStateSpaceModel, Error> {
        let matrices = self.matrices_of(&self.parts());
        let head = Head {
            inputs: self.inputs.clone(),
            outputs: vec![self.output.clone()],
            delays: self.parts().iter().map(|parts| parts.dead_time).collect(),
            sample_time: self.sample_time,
            hold,
            free_parameters: self.parameters.len(),
            degrees_of_freedom: self.degrees_of_freedom,
        };
        let model = ContinuousStateSpaceModel::new(head, &matrices)?;
        let known = self.covariance.as_deref().and_then(|covariance| {
            let moved = |direction: &DVector<f64>, sign: f64| {
                let mut own = self.clone();
                for (parameter, by) in own.parameters.iter_mut().zip(direction.iter()) {
                    parameter.value += sign * STEP * by;
                }
                own.matrices_of(&own.parts()).renamed()
            };
            let pairs: Vec<[StateSpace; 2]> = independent(covariance)?
                .iter()
                .map(|direction| [1.0, -1.0].map(|sign| moved(direction, sign)))
                .collect();
            EntryCovariance::of_pairs(&matrices.renamed(), &pairs)
        });
        Ok(match known {
            Some(known) => model.with_covariance(known),
            None => model,
        })
    }

    /// Block by block, that of one input after the other.
    fn matrices_of(&self, parts: &[Parts<f64>]) -> ContinuousStateSpace {
        let chains: Vec<_> = self
            .structures
            .iter()
            .zip(parts)
            .map(|(structure, parts)| structure.chain(&parts.shape))
            .collect();
        let (n, m) = (chains.iter().map(|chain| chain.states()).sum::<usize>(), self.inputs.len());
        let mut matrices = ContinuousStateSpace {
            a: DMatrix::zeros(n, n),
            b: DMatrix::zeros(n, m),
            c: DMatrix::zeros(1, n),
            d: DMatrix::zeros(1, m),
            k: DMatrix::zeros(n, 1),
            noise_intensity: DMatrix::from_element(1, 1, self.noise_variance * self.sample_time),
        };
        let mut first = 0;
        for (input, (chain, parts)) in chains.iter().zip(parts).enumerate() {
            let states = chain.states();
            let seen = |state: &[f64; MOST_STATES], u: f64| -> f64 {
                let columns = chain.columns(state, u);
                parts.weights.iter().zip(columns).map(|(weight, column)| weight * column).sum()
            };
            for column in 0..states {
                let mut unit = [0.0; MOST_STATES];
                unit[column] = 1.0;
                let slope = chain.slope(&unit, 0.0);
                (0..states).for_each(|row| matrices.a[(first + row, first + column)] = slope[row]);
                matrices.c[(0, first + column)] = seen(&unit, 0.0);
            }
            let none = [0.0; MOST_STATES];
            let slope = chain.slope(&none, 1.0);
            (0..states).for_each(|row| matrices.b[(first + row, input)] = slope[row]);
            matrices.d[(0, input)] = seen(&none, 1.0);
            first += states;
        }
        matrices
    }
}

#[cfg(test)]
mod tests;
