//! One model of experiments that other processes hold.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use thetahat::Error;
use thetahat::estimate::{Answer, Ask, Question};
use thetahat::optimize::Monitor;
use thetahat::plan::Fitted;
use thetahat::report::{self, Experiments as Described, Plan};

use crate::error;
use crate::grey_box::GreyBox;
use crate::log::Log;
use crate::model::Model;
use crate::plan::draft;
use crate::work::{interruptible, interruptible_apart};

/// Experiments that others hold, as one model of all of them sees them.
#[pyclass(frozen, module = "thetahat._thetahat")]
pub(crate) struct Experiments(Arc<Described>);

#[pymethods]
impl Experiments {
    /// The fit asks for all rows of fewer than these.
    #[classattr]
    const FETCHED_BELOW: usize = Described::FETCHED_BELOW;

    /// Those of a log, with the options of a plan in JSON.
    #[new]
    fn new(py: Python<'_>, log: &Bound<'_, Log>, plan: &str) -> PyResult<Self> {
        let log = log.get();
        let plan = plan_of(py, log, plan)?;
        let (channels, sources) = (Arc::clone(&log.log), log.sources.clone());
        let made = interruptible(py, move |_| Described::new(&channels, &sources, &plan))?;
        Ok(Self(Arc::new(made)))
    }

    /// Reads the description back.
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        let read = serde_json::from_str(text);
        Ok(Self(Arc::new(read.map_err(|error| pyo3::exceptions::PyValueError::new_err(error.to_string()))?)))
    }

    fn to_json(&self) -> PyResult<String> {
        serde_json::to_string(&*self.0)
            .map_err(|error| pyo3::exceptions::PyValueError::new_err(error.to_string()))
    }

    /// These and others after them.
    fn merged(&self, py: Python<'_>, others: Vec<PyRef<'_, Self>>) -> PyResult<Self> {
        let mut all = (*self.0).clone();
        for other in others {
            all.merge(&other.0).map_err(|error| error::batch(py, error))?;
        }
        Ok(Self(Arc::new(all)))
    }

    /// The same in one hand, joined in their order.
    fn joined(&self) -> Self {
        Self(Arc::new((*self.0).clone().joined()))
    }

    /// What is to be taken from each channel, the inputs first.
    fn offsets(&self, py: Python<'_>, plan: &str) -> PyResult<Vec<f64>> {
        let plan = self.plan(py, plan)?;
        self.0.offsets(&plan).map_err(|error| error::batch(py, error))
    }

    /// The model, see [`asking`].
    fn fit(&self, py: Python<'_>, plan: &str, ask: Py<PyAny>) -> PyResult<Model> {
        let plan = self.plan(py, plan)?;
        let all = Arc::clone(&self.0);
        asking(py, ask, move |ask, monitor| all.fit(&plan, ask, monitor)).map(Model::of)
    }

    /// The names of the channels, the output last.
    #[getter]
    fn channels(&self) -> Vec<&str> {
        self.0.channels()
    }

    /// Whether the fit asks for all rows, as there are few.
    #[getter]
    fn are_fetched(&self) -> bool {
        self.0.are_fetched()
    }
}

impl Experiments {
    fn plan(&self, py: Python<'_>, plan: &str) -> PyResult<Plan> {
        let mut inputs: Vec<String> = self.0.channels().into_iter().map(str::to_owned).collect();
        let output = inputs.pop().unwrap_or_default();
        let draft = draft(py, plan, Fitted::Log { several_outputs: false })?;
        let plan = draft.plan(inputs, vec![output]).map_err(|error| error::batch(py, error))?;
        plan.polynomial().cloned().map_err(|error| error::batch(py, error))
    }
}

/// A search that asks a function of Python: it has a list of questions, one for each holder, and gives their answers.
/// What it raises is raised.
fn asking<T: Send + 'static>(
    py: Python<'_>,
    ask: Py<PyAny>,
    search: impl FnOnce(Ask<'_>, Monitor<'_>) -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    let raised: Arc<Mutex<Option<PyErr>>> = Arc::default();
    let kept = Arc::clone(&raised);
    let found = interruptible_apart(py, move |monitor| {
        let ask = |questions: &[Question]| {
            let answers = Python::try_attach(|py| {
                asked(py, &ask, questions).map_err(|error| {
                    *kept.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                    Error::Interrupted
                })
            });
            // At the interpreter's end nobody listens.
            answers.unwrap_or(Err(Error::Interrupted))
        };
        search(&ask, monitor)
    });
    let raised = raised.lock().unwrap_or_else(PoisonError::into_inner).take();
    raised.map_or(found, Err)
}

fn asked(py: Python<'_>, ask: &Py<PyAny>, questions: &[Question]) -> PyResult<Vec<Answer>> {
    let failed = |error| error::batch(py, error);
    let bytes = |question: &Question| Ok(PyBytes::new(py, &question.to_bytes().map_err(failed)?));
    let questions: Vec<Bound<'_, PyBytes>> = questions.iter().map(bytes).collect::<PyResult<_>>()?;
    let answers: Vec<Bound<'_, PyBytes>> = ask.bind(py).call1((questions,))?.extract()?;
    answers.iter().map(|answer| Answer::from_bytes(answer.as_bytes()).map_err(failed)).collect()
}

fn plan_of(py: Python<'_>, log: &Log, plan: &str) -> PyResult<Plan> {
    log.plan(py, plan)?.polynomial().cloned().map_err(|error| error::batch(py, error))
}

/// A log without the offsets of its channels.
#[pyfunction]
pub(crate) fn deviations(
    py: Python<'_>,
    log: &Bound<'_, Log>,
    plan: &str,
    offsets: Vec<f64>,
) -> PyResult<Log> {
    let log = log.get();
    let plan = plan_of(py, log, plan)?;
    let channels = Arc::clone(&log.log);
    let taken = interruptible(py, move |_| Described::deviations(&channels, &plan, &offsets))?;
    let (inputs, outputs) = (log.inputs.clone(), log.outputs.clone());
    Ok(Log { log: Arc::new(taken), sources: log.sources.clone(), inputs, outputs })
}

/// What the deviations of some experiments answer.
#[pyfunction]
pub(crate) fn answer<'py>(
    py: Python<'py>,
    log: &Bound<'py, Log>,
    plan: &str,
    question: &[u8],
) -> PyResult<Bound<'py, PyBytes>> {
    let log = log.get();
    let plan = plan_of(py, log, plan)?;
    let channels = Arc::clone(&log.log);
    let question = Question::from_bytes(question).map_err(|error| error::batch(py, error))?;
    let answer = interruptible(py, move |_| Described::answer(&channels, &plan, &question)?.to_bytes())?;
    Ok(PyBytes::new(py, &answer))
}

/// What some experiments that a model in equations describes answer.
#[pyfunction]
pub(crate) fn answer_equations<'py>(
    py: Python<'py>,
    log: &Bound<'py, Log>,
    model: &Bound<'py, GreyBox>,
    question: &[u8],
) -> PyResult<Bound<'py, PyBytes>> {
    let (channels, model) = (Arc::clone(&log.get().log), model.get().0.clone());
    let question = Question::from_bytes(question).map_err(|error| error::batch(py, error))?;
    let answer =
        interruptible(py, move |_| report::answer_equations(&model, &channels, &question)?.to_bytes())?;
    Ok(PyBytes::new(py, &answer))
}

/// Fits a model in equations to logs of which others have some each, with the options of a plan, see
/// [`asking`].
#[pyfunction]
pub(crate) fn fit_equations_distributed(
    py: Python<'_>,
    log: &Bound<'_, Log>,
    model: &Bound<'_, GreyBox>,
    plan: &str,
    counts: Vec<usize>,
    ask: Py<PyAny>,
) -> PyResult<Model> {
    let draft = draft(py, plan, Fitted::Equations)?;
    let plan = draft.equations_plan().map_err(|error| error::batch(py, error))?.clone();
    let log = log.get();
    let (channels, sources, model) = (Arc::clone(&log.log), log.sources.clone(), model.get().0.clone());
    let found = asking(py, ask, move |ask, monitor| {
        report::fit_equations_distributed(&model, (&channels, &sources), &plan, &counts, ask, monitor)
    });
    found.map(Model::of)
}
