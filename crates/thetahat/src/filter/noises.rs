//! The noises of a model in matrices, from logs.

use std::fmt::Write;

use thetahat_core::Covariance;
use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::optimize::{Monitor, Search, Stopped};

use super::frame::Frame;
use super::kind::{Kind, Motion};
use super::linear::{Linear, Matrices};
use super::model::StateModel;
use crate::Error;
use crate::estimate::LikelihoodSearch;
use crate::estimate::noises::{Covariances, NoiseStructure, Plant, Rows, likeliest_noises, root};
use crate::figures::{self, number};
use crate::respond::equations::Failure;

/// A log of which the noises of a model are found.
#[derive(Debug, Clone, Copy)]
pub struct NoiseLog<'a> {
    /// The seconds from the row before to each row, NaN for one sample time; none if all are. That of the first row
    /// does not count.
    pub steps: Option<&'a [f64]>,
    /// The inputs, row after row. NaN: the last value, and before the first one 0.
    pub inputs: &'a [f64],
    /// The outputs, row after row. NaN is missing.
    pub outputs: &'a [f64],
}

/// The noises of a model, as logs say them.
#[derive(Debug, Clone)]
pub struct NoiseEstimate {
    /// The model with these noises.
    pub model: StateModel,
    /// Q.
    pub process: DMatrix<f64>,
    /// R.
    pub measurement: DMatrix<f64>,
    /// S.
    pub cross: DMatrix<f64>,
    /// The standard errors of the entries of Q: 0 of what is known, NaN of a variance that came out 0.
    pub process_errors: DMatrix<f64>,
    /// Those of R.
    pub measurement_errors: DMatrix<f64>,
    /// Those of S.
    pub cross_errors: DMatrix<f64>,
    /// The variances that came out 0, such as `Q[level]`, or `Q[level given the others]` where Q came out singular.
    pub vanishing: Vec<String>,
    /// The sum over all measured values of -1/2 (ln 2 pi S + e^2/S).
    pub log_likelihood: f64,
    /// How many values were measured.
    pub measured: usize,
    /// How the search went.
    pub search: LikelihoodSearch,
}

impl NoiseEstimate {
    /// The variances that were found, with their names and standard errors.
    pub fn variances(&self) -> impl Iterator<Item = (String, f64, f64)> {
        let kinds = [
            ("Q", self.model.states(), &self.process, &self.process_errors),
            ("R", self.model.outputs(), &self.measurement, &self.measurement_errors),
        ];
        kinds.into_iter().flat_map(|(letter, names, values, errors)| {
            let entry = move |(index, name): (usize, &String)| {
                (format!("{letter}[{name}]"), values[(index, index)], errors[(index, index)])
            };
            names.iter().enumerate().map(entry)
        })
    }

    /// What to know of the noises before relying on them, in plain words.
    pub fn warnings(&self) -> Vec<String> {
        let vanishing = self.vanishing.iter().map(|name| {
            format!(
                "the log shows no sign of {name}: the likelihood is largest without, where there is no standard error; a filter \
                 that knows of no noise stops learning, so that a small one may serve"
            )
        });
        let uncertain =
            self.variances().filter(|(_, value, error)| error > value).map(|(name, value, error)| {
                format!(
                    "{name} is hardly determined: {} with a standard error of {}; give a longer log",
                    number(value),
                    figures::error(error)
                )
            });
        let ended = matches!(self.search.stopped, Stopped::MaxIterations | Stopped::TimeLimit)
            .then(|| "the search ended before it converged: other noises may be more likely".to_owned());
        vanishing.chain(uncertain).chain(ended).collect()
    }
}

impl StateModel {
    /// The noises of a model in matrices with which logs are most likely: Q, R and, of
    /// [`NoiseStructure::Innovations`], S. All else is as the model says. Each log starts from x0 and P0 anew.
    ///
    /// The likelihood is that of the innovations of the Kalman filter (Schweppe, Evaluation of likelihood functions for
    /// Gaussian signals, IEEE Transactions on Information Theory 11, 1965), with exact derivatives by the factor of the
    /// joint covariance. The search begins at the noises of the model; standard errors are those of the Fisher
    /// information (Ljung, System Identification, 2nd ed. 1999, section 7.4).
    ///
    /// # Errors
    /// [`Error::Argument`] if the model is not in matrices, or its noises are not for this structure;
    /// [`Error::Undetermined`] with the names of the entries that the logs do not tell apart; [`Error::Data`] for an
    /// infinite value, a step that is no multiple of the sample time, and where the filter ceases to work;
    /// [`Error::Interrupted`].
    ///
    /// ```
    /// use std::ops::ControlFlow;
    /// use thetahat::estimate::NoiseStructure;
    /// use thetahat::filter::{NoiseLog, StateModel};
    /// use thetahat::optimize::Search;
    ///
    /// let level = StateModel::from_toml(
    ///     "sample_time = 1\noutputs = ['y']\nF = [[1]]\nH = [[1]]\nQ = [[1]]\nR = [[1]]\nP0 = [[100]]",
    /// )?;
    /// let outputs = [3.0, 5.0, 4.0, 7.0, 6.5, 9.0, 8.0, 11.0, 10.0, 9.5];
    /// let log = NoiseLog { steps: None, inputs: &[], outputs: &outputs };
    /// let none = |_| ControlFlow::Continue(());
    /// let found = level.fit_noise(&[log], NoiseStructure::Diagonal, &Search::default(), &none)?;
    /// assert!(found.process[(0, 0)] > 0.0 && found.measurement[(0, 0)] > 0.0);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn fit_noise(
        &self,
        logs: &[NoiseLog<'_>],
        structure: NoiseStructure,
        search: &Search,
        monitor: Monitor<'_>,
    ) -> Result<NoiseEstimate, Error> {
        let Kind::Sampled(frame, Motion::Linear(linear)) = &self.kind else {
            let message = "it is in equations: give a noise as { start = …, unknown = true } and fit the model to the log";
            return Err(Error::argument("model", message));
        };
        let Some(given) = linear.covariances(frame) else {
            return Err(Error::argument("model", "its noises were fitted already; give a model in matrices"));
        };
        let plant = Plant {
            f: linear.transition.state_matrix().clone(),
            g: linear.transition.input_matrix().clone(),
            h: frame.output_matrix.clone(),
            d: frame.observation.input_matrix().clone(),
            x0: frame.start.clone(),
            start: root(&frame.start_covariance.matrix()),
        };
        let rows = logs.iter().map(|log| self.rows(log)).collect::<Result<Vec<_>, Error>>()?;
        let names = (self.states(), self.outputs());
        let failed = |failure: Failure| {
            let of = if logs.len() > 1 { format!(" of log {}", failure.log + 1) } else { String::new() };
            Error::Data {
                channel: None,
                row: Some(failure.row + 1),
                message: format!(
                    "the Kalman filter leaves the range of numbers in row {}{of}; give an R above 0, or other noises to start from",
                    failure.row + 1
                ),
            }
        };
        let estimate =
            likeliest_noises(&plant, (&given, names), structure, &rows, failed, (search, monitor))?;
        let Covariances { q, r, s } = estimate.covariances;
        let model = self.with_noises((frame, linear), &q, &r, &s)?;
        Ok(NoiseEstimate {
            model,
            process: q,
            measurement: r,
            cross: s,
            process_errors: estimate.errors.q,
            measurement_errors: estimate.errors.r,
            cross_errors: estimate.errors.s,
            vanishing: estimate.vanishing,
            log_likelihood: -estimate.found.value,
            measured: estimate.found.samples,
            search: estimate.found.search,
        })
    }

    /// A log as it is gone through.
    fn rows(&self, log: &NoiseLog<'_>) -> Result<Rows, Error> {
        let (k, m) = (self.inputs().len(), self.outputs().len());
        let rows = log.outputs.len() / m;
        let fits = log.outputs.len() == rows * m
            && log.inputs.len() == rows * k
            && log.steps.is_none_or(|steps| steps.len() == rows);
        if !fits {
            return Err(Error::argument("logs", "inputs, outputs and steps are not of as many rows"));
        }
        let infinite = |values: &[f64], channels: &[String]| {
            let found = values.iter().position(|value| value.is_infinite())?;
            let (row, channel) = (found / channels.len() + 1, &channels[found % channels.len()]);
            Some(Error::in_channel(channel, Some(row), format!("'{channel}' is infinite in row {row}")))
        };
        if let Some(error) =
            infinite(log.inputs, self.inputs()).or_else(|| infinite(log.outputs, self.outputs()))
        {
            return Err(error);
        }
        let count = |row: usize| -> Result<usize, Error> {
            let seconds = log.steps.map_or(f64::NAN, |steps| steps[row]);
            if row == 0 || seconds.is_nan() {
                return Ok(1);
            }
            let division = self.kind.division(seconds).map_err(|error| match error {
                Error::Data { message, .. } => Error::Data { channel: None, row: Some(row + 1), message },
                other => other,
            });
            division.map(|(count, _)| count)
        };
        let mut inputs = log.inputs.to_vec();
        for index in 0..inputs.len() {
            if inputs[index].is_nan() {
                inputs[index] = index.checked_sub(k).map_or(0.0, |before| inputs[before]);
            }
        }
        Ok(Rows {
            steps: (0..rows).map(count).collect::<Result<_, Error>>()?,
            inputs,
            outputs: log.outputs.to_vec(),
            nothing: vec![f64::NAN; m],
        })
    }

    /// The same with other noises.
    fn with_noises(
        &self,
        (frame, linear): (&Frame, &Linear),
        q: &DMatrix<f64>,
        r: &DMatrix<f64>,
        s: &DMatrix<f64>,
    ) -> Result<Self, Error> {
        let made = || -> Result<Self, thetahat_core::Error> {
            let matrices = Matrices {
                f: linear.transition.state_matrix().clone(),
                g: linear.transition.input_matrix().clone(),
                h: frame.output_matrix.clone(),
                d: frame.observation.input_matrix().clone(),
                q: Covariance::new(q)?,
                r: Covariance::new(r)?,
                s: Some(s.clone()),
                x0: frame.start.clone(),
                p0: frame.start_covariance.clone(),
                bounds: linear.bounds.clone(),
            };
            Ok(Linear::of_matrices(frame.names.clone(), matrices, None)?.into())
        };
        made().map_err(|error| Error::data(format!("the noises that were found make no filter: {error}")))
    }

    /// The text of a model in matrices, as [`from_toml`](StateModel::from_toml) reads it; none of another model.
    ///
    /// ```
    /// use thetahat::filter::StateModel;
    ///
    /// let text = "sample_time = 1\noutputs = ['y']\nF = [[1]]\nH = [[1]]\nQ = [[0.1]]\nR = [[2]]\nP0 = [[1]]";
    /// let written = StateModel::from_toml(text)?.to_toml().expect("matrices");
    /// assert_eq!(StateModel::from_toml(&written)?.to_toml(), Some(written));
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn to_toml(&self) -> Option<String> {
        let Kind::Sampled(frame, Motion::Linear(linear)) = &self.kind else { return None };
        let given = linear.covariances(frame)?;
        let mut text = format!("sample_time = {:?}\n", frame.names.sample_time);
        let names = [
            ("states", &frame.names.states),
            ("inputs", &frame.names.inputs),
            ("outputs", &frame.names.outputs),
        ];
        for (key, names) in names {
            let names: Vec<String> = names.iter().map(|name| toml_text(name)).collect();
            let _ = writeln!(text, "{key} = [{}]", names.join(", "));
        }
        let matrices = [
            ("F", linear.transition.state_matrix()),
            ("G", linear.transition.input_matrix()),
            ("H", &frame.output_matrix),
            ("D", frame.observation.input_matrix()),
            ("Q", &given.q),
            ("R", &given.r),
            ("S", &given.s),
            ("P0", &frame.start_covariance.matrix()),
        ];
        let row = |values: Vec<f64>| {
            let values: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
            format!("[{}]", values.join(", "))
        };
        for (key, matrix) in matrices {
            let may_be_left_out = ["D", "S"].contains(&key);
            if matrix.is_empty() || (may_be_left_out && matrix.iter().all(|entry| *entry == 0.0)) {
                continue;
            }
            let rows: Vec<String> = matrix.row_iter().map(|own| row(own.iter().copied().collect())).collect();
            let _ = writeln!(text, "{key} = [{}]", rows.join(", "));
        }
        let bounds = linear.bounds.iter().flat_map(|bounds| {
            [
                ("process_bound", &bounds.process),
                ("measurement_bound", &bounds.measurement),
                ("initial_bound", &bounds.initial),
            ]
        });
        for (key, vector) in std::iter::once(("x0", &frame.start)).chain(bounds) {
            let _ = writeln!(text, "{key} = {}", row(vector.iter().copied().collect()));
        }
        Some(text)
    }
}

/// A text as TOML writes it.
fn toml_text(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}
