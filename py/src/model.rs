//! Fitted models: the report of a fit, and what can be computed with it.

use std::borrow::Cow;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use numpy::{PyArray1, PyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use thetahat::Document;
use thetahat::data::Channel;
use thetahat::export::{Plan, export};
use thetahat::model::{KnownOptions, LinearModel, PolynomialModel, Quantity, StateSpace, ZerosPolesGain};
use thetahat::plan::Fitted;
use thetahat::present::tables;
use thetahat::report::{PendingEvaluation, Report, apply, sample};
use thetahat::respond::{Draws, Horizon, InitialCondition, TransientResponse, logarithmic_frequencies};
use thetahat::spectrum::MeasuredResponse;
use thetahat::thetahat_core::nalgebra::Complex;

use crate::array::{from_matrix, matrix, vector};
use crate::error;
use crate::grey_box::GreyBox;
use crate::log::{Log, copy};
use crate::plan::{draft, options};
use crate::work::interruptible;

/// Names of files, and what they hold.
type Files = Vec<(String, String)>;

/// Roots, each with its imaginary part.
type Roots = Vec<(f64, f64)>;

/// A fitted model: the document that `thetahat fit` writes.
///
/// Its figures are computed when somebody asks for the document: they take several times as long as least squares.
#[pyclass(frozen, module = "thetahat._thetahat")]
pub(crate) struct Model {
    model: Arc<thetahat::model::Model>,
    /// The report as far as it was known at once.
    known: Arc<Report>,
    report: OnceLock<Arc<Report>>,
    /// What the figures are computed of, as long as they are not.
    pending: Mutex<Option<(PendingEvaluation, Arc<thetahat::data::Log>)>>,
}

/// An array with one value for each row.
type Column<'py> = Bound<'py, PyArray1<f64>>;

/// Fits a model to a log with options of a fit, a plan in JSON.
#[pyfunction]
pub(crate) fn fit(py: Python<'_>, log: &Bound<'_, Log>, plan: &str) -> PyResult<Model> {
    let log = log.get();
    let plan = log.plan(py, plan)?;
    let (channels, sources) = (Arc::clone(&log.log), log.sources.clone());
    let pending = interruptible(py, move |monitor| {
        let names = plan.channels();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let own = if plan.polynomial().is_ok() {
            Cow::Owned(copy(&channels, &names)?)
        } else {
            Cow::Borrowed(&*channels)
        };
        plan.begin(own, &sources, monitor)
    })?;
    Ok(Model::waiting(pending, log))
}

/// Fits a model in equations to a log with options of a fit, a plan in JSON.
#[pyfunction]
pub(crate) fn fit_equations(
    py: Python<'_>,
    log: &Bound<'_, Log>,
    model: &Bound<'_, GreyBox>,
    plan: &str,
) -> PyResult<Model> {
    let draft = draft(py, plan, Fitted::Equations)?;
    let log = log.get();
    let (channels, sources, model) = (Arc::clone(&log.log), log.sources.clone(), model.get().0.clone());
    let report = interruptible(py, move |monitor| draft.fit_equations(&model, &channels, &sources, monitor))?;
    Ok(Model::of(report))
}

/// The same to the document of a frequency response.
#[pyfunction]
pub(crate) fn fit_equations_to_response(
    py: Python<'_>,
    response: &str,
    model: &Bound<'_, GreyBox>,
    plan: &str,
) -> PyResult<Model> {
    let draft = draft(py, plan, Fitted::Equations)?;
    let response = MeasuredResponse::from_json(response).map_err(|error| error::batch(py, error))?;
    let model = model.get().0.clone();
    let report =
        interruptible(py, move |monitor| draft.fit_equations_to_response(&model, &response, monitor))?;
    Ok(Model::of(report))
}

/// Fits a process to the document of a frequency response with options of a fit, a plan in JSON.
#[pyfunction]
pub(crate) fn fit_response(py: Python<'_>, response: &str, plan: &str) -> PyResult<Model> {
    let draft = draft(py, plan, Fitted::Response)?;
    let response = MeasuredResponse::from_json(response).map_err(|error| error::batch(py, error))?;
    let report = interruptible(py, move |monitor| draft.fit_response(&response, monitor))?;
    Ok(Model::of(report))
}

#[pymethods]
impl Model {
    /// Reads the document back.
    #[staticmethod]
    fn from_json(py: Python<'_>, text: &str) -> PyResult<Self> {
        let report = Report::from_json(text).map_err(|error| error::batch(py, error))?;
        Ok(Self::of(report))
    }

    /// One of numbers that are known, the options of a plan in JSON.
    #[staticmethod]
    fn known(py: Python<'_>, plan: &str) -> PyResult<Self> {
        let known: KnownOptions = options(py, plan)?;
        let model = known.model().map_err(|error| error::batch(py, error))?;
        Ok(Self::of(Report::of_known(model)))
    }

    /// The document.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        self.report(py)?.to_json().map_err(|error| error::batch(py, error))
    }

    /// What is known without the figures: the parts `model` and `estimation` of the document.
    fn parts(&self, py: Python<'_>) -> PyResult<(String, String)> {
        let known = self.pending.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let stored;
        let report = match &known {
            Some((pending, _)) => pending.report(),
            None => {
                stored = self.report(py)?;
                &*stored
            }
        };
        let malformed = |error: serde_json::Error| PyValueError::new_err(error.to_string());
        let model = serde_json::to_string(&*self.model).map_err(malformed)?;
        Ok((model, serde_json::to_string(&report.estimation).map_err(malformed)?))
    }

    /// Structure and orders, such as ARX(2, 2, 1), or what kind it is.
    fn name(&self) -> String {
        self.model.name()
    }

    /// The table that `thetahat fit` prints.
    fn table(&self, py: Python<'_>) -> PyResult<String> {
        Ok(tables::report(&*self.report(py)?, error::layout()))
    }

    /// What to warn of after a fit. Of least squares alone the figures wait: nothing to warn of hangs on them but how
    /// close it is.
    fn warnings(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let known = self.pending.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let waits =
            |report: &Report| report.selection.is_none() && report.estimation.procedure.search().is_none();
        let stored;
        let report = match &known {
            Some((pending, _)) if waits(pending.report()) => pending.report(),
            _ => {
                stored = self.report(py)?;
                &*stored
            }
        };
        Ok(report.warnings.iter().map(|warning| error::in_python(warning)).collect())
    }

    /// The page that `thetahat fit --html` writes, with a validation of a log if there is one.
    fn page(&self, py: Python<'_>, log: Option<&Bound<'_, Log>>, command: &str) -> PyResult<String> {
        let log = log.map(Bound::get).map(|log| (Arc::clone(&log.log), log.sources.clone()));
        let (report, command) = (self.report(py)?, command.to_owned());
        interruptible(py, move |_| {
            let plan = thetahat::report::ValidationPlan::default();
            let (mut validated, mut held_out) = (Vec::new(), Vec::new());
            if let Some((log, sources)) = log {
                let found = thetahat::report::validate(&report, None, &log, &sources, &plan)?;
                // Another log has not the rows of the choice.
                if found.validation.in_sample != thetahat::report::InSample::No {
                    held_out = thetahat::report::held_out_runs(&report, &log)?;
                }
                validated.push(found);
            }
            Ok(thetahat::present::fit_page(&report, &validated, &held_out, &command))
        })
    }

    /// Of each output, predictions this many steps ahead, or a free run, of all rows of a log.
    fn predict<'py>(
        &self,
        py: Python<'py>,
        log: &Bound<'py, Log>,
        horizon: Option<usize>,
        initial: &str,
    ) -> PyResult<Vec<Column<'py>>> {
        let horizon = horizon.map_or(Horizon::FreeRun, |steps| Horizon::Steps { steps });
        let start = self.start(initial, log.get(), horizon)?;
        let (known, log) = (Arc::clone(&self.known), Arc::clone(&log.get().log));
        let found = interruptible(py, move |_| known.predictions(&log, horizon, start))?;
        Ok(found.into_iter().map(|values| PyArray1::from_vec(py, values)).collect())
    }

    /// Of each output, the prediction of each row, and its standard deviations if there are steps.
    #[pyo3(signature = (log, horizon, initial))]
    fn predict_with_deviations<'py>(
        &self,
        py: Python<'py>,
        log: &Bound<'py, Log>,
        horizon: Option<usize>,
        initial: &str,
    ) -> PyResult<Vec<(Column<'py>, Option<Column<'py>>)>> {
        let horizon = horizon.map_or(Horizon::FreeRun, |steps| Horizon::Steps { steps });
        let start = self.start(initial, log.get(), horizon)?;
        let (known, log) = (Arc::clone(&self.known), Arc::clone(&log.get().log));
        let rows = log.rows();
        let applied = interruptible(py, move |_| known.apply(&log, &[], None, horizon, start))?;
        let column = |values: &[f64]| PyArray1::from_slice(py, &values[..rows.min(values.len())]);
        let each = applied.outputs.iter();
        let each = each.map(|one| (column(&one.predicted), one.standard_deviations.as_deref().map(column)));
        Ok(each.collect())
    }

    /// Of each output, the free run from rest on inputs, one column for each.
    fn simulate<'py>(&self, py: Python<'py>, inputs: &Bound<'py, PyAny>) -> PyResult<Vec<Column<'py>>> {
        let channels = self.driving(inputs)?;
        let model = Arc::clone(&self.model);
        let applied = interruptible(py, move |_| {
            let log = thetahat::data::Log::new(channels, model.sample_time())?;
            apply(&model, &log, &[], None, Horizon::FreeRun, InitialCondition::Zero)
        })?;
        Ok(applied.outputs.into_iter().map(|one| PyArray1::from_vec(py, one.predicted)).collect())
    }

    /// Of each output, the free run on a log, or from rest on inputs, kept within the range of the fit; and how many
    /// values were.
    #[pyo3(signature = (log, inputs, initial))]
    fn clamped_run<'py>(
        &self,
        py: Python<'py>,
        log: Option<&Bound<'py, Log>>,
        inputs: Option<&Bound<'py, PyAny>>,
        initial: &str,
    ) -> PyResult<(Vec<Column<'py>>, usize)> {
        let known = Arc::clone(&self.known);
        let (log, start) = self.driven(py, log, inputs, initial)?;
        let applied = interruptible(py, move |_| known.clamped_run(&log, &[], None, start))?;
        let columns = applied.outputs.into_iter().map(|one| PyArray1::from_vec(py, one.predicted));
        Ok((columns.collect(), applied.clamped.unwrap_or(0)))
    }

    /// Free runs drawn from what the estimate leaves open, on a log or on inputs, one column for each: a row for each
    /// draw. Also how often parameters were unstable, and whether they vary.
    #[pyo3(signature = (log, inputs, draws, seed, initial))]
    fn sample<'py>(
        &self,
        py: Python<'py>,
        log: Option<&Bound<'py, Log>>,
        inputs: Option<&Bound<'py, PyAny>>,
        draws: usize,
        seed: u64,
        initial: &str,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, usize, bool)> {
        let model = Arc::clone(&self.model);
        let (log, start) = self.driven(py, log, inputs, initial)?;
        let draws = Draws { count: draws, seed };
        let drawn = interruptible(py, move |_| sample(&model, &log, &[], None, start, &draws))?;
        let runs = PyArray2::from_vec2(py, &drawn.values)
            .map_err(|error| PyValueError::new_err(format!("draws: {error}")))?;
        Ok((runs, drawn.unstable, drawn.varied))
    }

    /// Of each output, what comes after the end of a log, and its standard deviations.
    #[pyo3(signature = (log, steps, inputs, initial))]
    fn forecast<'py>(
        &self,
        py: Python<'py>,
        log: &Bound<'py, Log>,
        steps: usize,
        inputs: Option<&Bound<'py, PyAny>>,
        initial: &str,
    ) -> PyResult<Vec<(Column<'py>, Column<'py>)>> {
        const MOST: usize = 1_000_000;
        if !(1..=MOST).contains(&steps) {
            return Err(PyValueError::new_err(format!("steps: {steps} is outside 1..{MOST}")));
        }
        let model = Arc::clone(&self.model);
        let driven = model.is_driven();
        let future = match inputs {
            Some(inputs) if driven => self.inputs_of("u", inputs, Some(steps))?,
            None if driven => {
                return Err(PyValueError::new_err(format!(
                    "u: the model has inputs; give their values in the next {steps} samples, one column for each"
                )));
            }
            Some(_) => return Err(PyValueError::new_err("u: the model has no inputs; leave it out")),
            None => Vec::new(),
        };
        let start = self.start(initial, log.get(), Horizon::Steps { steps })?;
        let log = Arc::clone(&log.get().log);
        let rows = log.rows();
        // From the last measured sample on: as many more steps as rows are missing at the end.
        let horizon = Horizon::Steps { steps: steps + missing_at_the_end(&model, &log) };
        let applied = interruptible(py, move |_| {
            let mut known = copy(&log, &channels(&model, &log))?;
            if driven {
                known = extended(&known, &future, steps)?;
            }
            apply(&model, &known, &[], None, horizon, start)
        })?;
        let end = rows + steps;
        let each = applied.outputs.iter().map(|output| {
            let ahead = output.predicted.get(rows..end);
            let deviations = output.standard_deviations.as_deref().and_then(|values| values.get(rows..end));
            match (ahead, deviations) {
                (Some(ahead), Some(deviations)) if ahead.iter().all(|value| !value.is_nan()) => {
                    Ok((PyArray1::from_slice(py, ahead), PyArray1::from_slice(py, deviations)))
                }
                _ => Err(PyValueError::new_err(
                    "log: it ends in missing samples, or in a segment too short to start from; give one that ends in more \
                     samples",
                )),
            }
        });
        each.collect()
    }

    /// For each input and the noise: its name, frequencies, real and imaginary parts, and magnitude and phase with
    /// their standard errors.
    #[pyo3(signature = (frequencies, points, output=0))]
    fn frequency_response<'py>(
        &self,
        py: Python<'py>,
        frequencies: Option<&Bound<'py, PyAny>>,
        points: usize,
        output: usize,
    ) -> PyResult<Vec<(Option<String>, [Column<'py>; 7])>> {
        let model = Arc::clone(&self.model);
        self.linear(py, "a frequency response", output)?;
        let frequencies = match frequencies {
            Some(frequencies) => vector("w", frequencies, None)?.as_slice()?.to_vec(),
            None => {
                let nyquist = std::f64::consts::PI / model.sample_time();
                logarithmic_frequencies(nyquist / 1000.0, nyquist, points)
                    .map_err(|error| error::batch(py, error))?
            }
        };
        let responses = interruptible(py, move |_| {
            model.linear("a frequency response")?[output].frequency_response(&frequencies)
        })?;
        let columns = responses.into_iter().map(|response| {
            let column = |of: &dyn Fn(&thetahat::respond::FrequencyPoint) -> f64| {
                PyArray1::from_vec(py, response.points.iter().map(of).collect())
            };
            let columns = [
                column(&|point| point.frequency),
                column(&|point| point.re),
                column(&|point| point.im),
                column(&|point| point.magnitude.value),
                column(&|point| or_nan(&point.magnitude)),
                column(&|point| point.phase.value),
                column(&|point| or_nan(&point.phase)),
            ];
            (response.input.clone(), columns)
        });
        Ok(columns.collect())
    }

    /// The response to a unit step of an input: its times, values and their standard errors.
    #[pyo3(signature = (input, samples, output=0))]
    fn step_response<'py>(
        &self,
        py: Python<'py>,
        input: usize,
        samples: Option<usize>,
        output: usize,
    ) -> PyResult<[Column<'py>; 3]> {
        self.transient(py, output, move |model| model.step_response(input, samples))
    }

    /// The same for an impulse.
    #[pyo3(signature = (input, samples, output=0))]
    fn impulse_response<'py>(
        &self,
        py: Python<'py>,
        input: usize,
        samples: Option<usize>,
        output: usize,
    ) -> PyResult<[Column<'py>; 3]> {
        self.transient(py, output, move |model| model.impulse_response(input, samples))
    }

    /// How much of its inputs each state passes on to the outputs.
    fn hankel_singular_values(&self, py: Python<'_>) -> PyResult<Vec<f64>> {
        self.report(py)?.hankel_singular_values().map_err(|error| error::batch(py, error))
    }

    /// Zeros, poles and gain from an input to an output, of a model in state space, sampled or not.
    fn transfer(&self, py: Python<'_>, output: usize, input: usize) -> PyResult<(Roots, Roots, f64)> {
        let found = self.model.transfer(output, input);
        let ZerosPolesGain { zeros, poles, gain } = found.map_err(|error| error::batch(py, error))?;
        let pairs = |roots: Vec<_>| roots.into_iter().map(|root: Complex<f64>| (root.re, root.im)).collect();
        Ok((pairs(zeros), pairs(poles), gain))
    }

    /// The model with fewer states.
    fn reduced(&self, py: Python<'_>, order: usize) -> PyResult<Self> {
        let (report, _) = self.report(py)?.reduced(order).map_err(|error| error::batch(py, error))?;
        Ok(Self::of(report))
    }

    /// The model in continuous time or at another sample time.
    #[pyo3(signature = (to, hold))]
    fn converted(&self, py: Python<'_>, to: &str, hold: Option<&str>) -> PyResult<Self> {
        let found = (to.parse::<thetahat::model::TimeBase>())
            .and_then(|to| Ok((to, hold.map(str::parse::<thetahat::model::Hold>).transpose()?)));
        let (to, hold) = found.map_err(|error| error::batch(py, error))?;
        let report = self.report(py)?.converted(to, hold).map_err(|error| error::batch(py, error))?;
        Ok(Self::of(report))
    }

    /// Source code for firmware: the names of files and what they hold, and what to warn of.
    #[pyo3(signature = (words, log))]
    fn exported(
        &self,
        py: Python<'_>,
        words: [String; 4],
        log: Option<&Bound<'_, Log>>,
    ) -> PyResult<(Files, Vec<String>)> {
        let [language, purpose, precision, name] = words;
        let plan = || -> Result<Plan, thetahat::Error> {
            let (language, purpose) = (language.parse()?, purpose.parse()?);
            Ok(Plan { language, purpose, precision: precision.parse()?, name })
        };
        let plan = plan().map_err(|error| error::batch(py, error))?;
        let (report, log) = (self.report(py)?, log.map(|log| Arc::clone(&log.get().log)));
        let found =
            interruptible(py, move |_| export(&report, &plan, log.as_deref().map(|log| (log, &[][..]))))?;
        let files = found.files.into_iter().map(|file| (file.name, file.text)).collect();
        Ok((files, found.warnings.iter().map(|warning| error::in_python(warning)).collect()))
    }

    /// F, G, H, D and K of the innovations form.
    fn state_space<'py>(&self, py: Python<'py>) -> PyResult<[Bound<'py, PyArray2<f64>>; 5]> {
        let StateSpace { f, g, h, d, k, .. } = match self.model.as_state_space() {
            Some(model) => model.matrices(),
            None => self.polynomials(py, "the innovations form")?.state_space(),
        };
        let array = |matrix| from_matrix(py, matrix);
        Ok([array(&f)?, array(&g)?, array(&h)?, array(&d)?, array(&k)?])
    }
}

impl Model {
    /// A fit whose figures wait.
    fn waiting(pending: PendingEvaluation, log: &Log) -> Self {
        Self {
            model: pending.report().model.clone().into(),
            known: pending.report().clone().into(),
            report: OnceLock::new(),
            pending: Mutex::new(Some((pending, Arc::clone(&log.log)))),
        }
    }

    pub(crate) fn of(report: Report) -> Self {
        let known = Arc::new(report);
        let model = known.model.clone().into();
        Self { model, report: Arc::clone(&known).into(), known, pending: Mutex::new(None) }
    }

    /// The polynomials, of which alone `what` is known.
    fn polynomials(&self, py: Python<'_>, what: &str) -> PyResult<&PolynomialModel> {
        self.model.polynomials(what).map_err(|error| error::batch(py, error))
    }

    /// Refuses a model that is not linear, or does not have this output.
    fn linear(&self, py: Python<'_>, what: &str, output: usize) -> PyResult<()> {
        let models = self.model.linear(what).map_err(|error| error::batch(py, error))?;
        let Some(own) = models.get(output) else {
            return Err(PyValueError::new_err(format!(
                "output: there is no output {output}; there are {}",
                models.len()
            )));
        };
        if own.inputs().is_empty() && !self.model.has_offsets() {
            return Err(PyValueError::new_err(format!("{what} needs inputs, and the model has none")));
        }
        Ok(())
    }

    /// The times, the values and their standard errors of a response to an input.
    fn transient<'py>(
        &self,
        py: Python<'py>,
        output: usize,
        respond: impl FnOnce(&LinearModel<'_>) -> Result<TransientResponse, thetahat::Error> + Send + 'static,
    ) -> PyResult<[Column<'py>; 3]> {
        let model = Arc::clone(&self.model);
        let what = "a step or impulse response";
        self.linear(py, what, output)?;
        let response = interruptible(py, move |_| {
            let models = model.linear(what)?;
            respond(&models[output])
        })?;
        let values = response.values.iter().map(|quantity| quantity.value).collect();
        let errors = response.values.iter().map(or_nan).collect();
        Ok([response.time, values, errors].map(|column| PyArray1::from_vec(py, column)))
    }

    /// The model itself.
    pub(crate) fn model(&self) -> &Arc<thetahat::model::Model> {
        &self.model
    }

    /// The whole report.
    pub(crate) fn report(&self, py: Python<'_>) -> PyResult<Arc<Report>> {
        // The lock is not held while others compute: they may wait for the interpreter, and its owner for the lock.
        let pending = self.pending.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some((pending, log)) = pending {
            let model = Arc::clone(&self.model);
            let report = interruptible(py, move |_| {
                let copied = copy(&log, &channels(&model, &log))?;
                pending.evaluate(copied)
            })?;
            // Whoever was faster found the same.
            let _ = self.report.set(Arc::new(report));
            *self.pending.lock().unwrap_or_else(PoisonError::into_inner) = None;
        }
        self.report.get().cloned().ok_or_else(|| PyRuntimeError::new_err("the model has no report"))
    }

    /// The start of this name, for a log that may have the output.
    fn start(&self, initial: &str, log: &Log, horizon: Horizon) -> PyResult<InitialCondition> {
        match initial {
            "auto" if !self.model.outputs().iter().all(|output| log.log.has(&output.name)) => {
                Ok(InitialCondition::Zero)
            }
            "auto" => Ok(self.model.natural_start(horizon)),
            "drop" => Ok(InitialCondition::Drop),
            "zero" => Ok(InitialCondition::Zero),
            "estimate" => Ok(InitialCondition::Estimate),
            other => Err(PyValueError::new_err(format!(
                "initial: '{other}' is none of 'auto', 'drop', 'zero', 'estimate'"
            ))),
        }
    }

    /// What a free run is on: a log, or inputs from rest.
    fn driven(
        &self,
        py: Python<'_>,
        log: Option<&Bound<'_, Log>>,
        inputs: Option<&Bound<'_, PyAny>>,
        initial: &str,
    ) -> PyResult<(Arc<thetahat::data::Log>, InitialCondition)> {
        match (log, inputs) {
            (Some(log), _) => {
                Ok((Arc::clone(&log.get().log), self.start(initial, log.get(), Horizon::FreeRun)?))
            }
            (None, Some(inputs)) => {
                let log = thetahat::data::Log::new(self.driving(inputs)?, self.model.sample_time());
                Ok((Arc::new(log.map_err(|error| error::batch(py, error))?), InitialCondition::Zero))
            }
            (None, None) => Err(PyValueError::new_err("u: give inputs, or a log")),
        }
    }

    /// The inputs of a free run, which misses none of them.
    fn driving(&self, inputs: &Bound<'_, PyAny>) -> PyResult<Vec<Channel>> {
        if self.model.inputs().is_empty() {
            return Err(PyValueError::new_err(
                "u: the model has no inputs, so there is nothing to simulate; forecast it",
            ));
        }
        let channels = self.inputs_of("u", inputs, None)?;
        match channels.iter().find(|channel| !channel.values.iter().all(|value| value.is_finite())) {
            Some(channel) => {
                Err(PyValueError::new_err(format!("u: input '{}' holds NaN or infinity", channel.name)))
            }
            None => Ok(channels),
        }
    }

    /// The inputs in an array of one dimension, or with a column for each.
    fn inputs_of(
        &self,
        argument: &str,
        values: &Bound<'_, PyAny>,
        rows: Option<usize>,
    ) -> PyResult<Vec<Channel>> {
        let names = self.model.inputs().iter().map(|input| input.name.clone());
        let count = names.len();
        let array = matrix(argument, values, [rows, Some(count)])?;
        let (entries, rows) = (array.as_slice()?, array.shape()[0]);
        let column = |index: usize| (0..rows).map(|row| entries[row * count + index]).collect();
        Ok(names.enumerate().map(|(index, name)| Channel { name, values: column(index) }).collect())
    }
}

/// The channels of a log that a model is about; it may lack outputs.
fn channels<'a>(model: &'a thetahat::model::Model, log: &thetahat::data::Log) -> Vec<&'a str> {
    let inputs = model.inputs().iter().map(|input| input.name.as_str());
    let outputs = model.outputs().iter().map(|output| output.name.as_str());
    inputs.chain(outputs.filter(|output| log.has(output))).collect()
}

/// How many rows at the end of a log miss a channel of the model.
fn missing_at_the_end(model: &thetahat::model::Model, log: &thetahat::data::Log) -> usize {
    let names = channels(model, log);
    let used: Vec<&[f64]> =
        names.iter().filter_map(|name| Some(&log.channel(name).ok()?.values[..])).collect();
    (0..log.rows()).rev().take_while(|&row| used.iter().any(|values| values[row].is_nan())).count()
}

/// A log that goes on with known inputs and no output.
fn extended(
    log: &thetahat::data::Log,
    future: &[Channel],
    steps: usize,
) -> Result<thetahat::data::Log, thetahat::Error> {
    let channels = log.channels().iter().map(|channel| {
        let mut values = channel.values.clone();
        match future.iter().find(|input| input.name == channel.name) {
            Some(input) => values.extend_from_slice(&input.values),
            None => values.resize(log.rows() + steps, f64::NAN),
        }
        Channel { name: channel.name.clone(), values }
    });
    let time = log.time().map(|time| {
        let last = time[time.len() - 1];
        let ahead = (1..=steps).map(|step| last + step as f64 * log.sample_time());
        time.iter().copied().chain(ahead).collect()
    });
    thetahat::data::Log::restored(
        channels.collect(),
        log.sample_time(),
        time,
        log.segment_starts().to_vec(),
        log.boundaries().to_vec(),
        log.before(),
    )
}

fn or_nan(quantity: &Quantity) -> f64 {
    quantity.standard_error.unwrap_or(f64::NAN)
}
