//! Logs: the channels that models are fitted to.

use std::ffi::OsString;
use std::sync::Arc;

use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use thetahat::Error;
use thetahat::data::{Channel, Interpolation, Resample, Resampling, Rows, Source};
use thetahat::fit::FitPlan;
use thetahat::plan::Fitted;

use crate::array::vector;
use crate::error;
use crate::plan::draft;
use crate::work::{awaited, interruptible};

/// Channels on a common clock, where they came from, and which of them are inputs and outputs.
#[pyclass(frozen, module = "thetahat._thetahat")]
pub(crate) struct Log {
    pub(crate) log: Arc<thetahat::data::Log>,
    pub(crate) sources: Vec<Source>,
    #[pyo3(get)]
    pub(crate) inputs: Vec<String>,
    /// At least one.
    #[pyo3(get)]
    pub(crate) outputs: Vec<String>,
}

impl Log {
    /// The fit of this log with the options of a plan in JSON.
    pub(crate) fn plan(&self, py: Python<'_>, plan: &str) -> PyResult<FitPlan> {
        let draft = draft(py, plan, Fitted::Log { several_outputs: self.outputs.len() > 1 })?;
        draft.plan(self.inputs.clone(), self.outputs.clone()).map_err(|error| match error {
            Error::Argument { argument, .. } if argument == "output" => self.several_outputs(),
            other => error::batch(py, other),
        })
    }

    /// There are several outputs, and a model has one.
    fn several_outputs(&self) -> PyErr {
        PyValueError::new_err(format!(
            "log: it has {} outputs ({}), and the model one; take it with log.select(output=...)",
            self.outputs.len(),
            self.outputs.join(", ")
        ))
    }
}

/// Channels by name.
type Named<'py> = Vec<(String, Bound<'py, PyAny>)>;

/// Times, how to resample, the first time as it was written, and what the times are called.
type Clock<'py> = (Bound<'py, PyAny>, Option<(f64, String, bool)>, Option<String>, String);

#[pymethods]
impl Log {
    /// Channels by name with a fixed sample time, or with a clock: the times, how to resample, (step, "hold" or
    /// "linear", whether to filter against aliasing), the first time as it was written, and what the times are called.
    /// Its steps may be uneven unless it has to be uniform.
    #[new]
    #[pyo3(signature = (channels, inputs, outputs, sample_time, clock=None, uniform=true))]
    fn new(
        py: Python<'_>,
        channels: Named<'_>,
        inputs: Vec<String>,
        outputs: Vec<String>,
        sample_time: f64,
        clock: Option<Clock<'_>>,
        uniform: bool,
    ) -> PyResult<Self> {
        let channels = read(channels)?;
        let (time, resample, start, called) = match clock {
            Some((time, resample, start, called)) => (Some(time), resample, start, Some(called)),
            None => (None, None, None, None),
        };
        let mut resampled = None;
        let log = match (time, resample) {
            (None, _) => thetahat::data::Log::new(channels, sample_time),
            (Some(time), None) => {
                let time = vector("time", &time, None)?.as_slice()?.to_vec();
                let of = if uniform { thetahat::data::Log::with_time } else { thetahat::data::Log::recorded };
                of(channels, time)
            }
            (Some(time), Some((step, how, anti_alias))) => {
                let time = vector("time", &time, None)?;
                let interpolation = match how.as_str() {
                    "hold" => Interpolation::Hold,
                    "linear" => Interpolation::Linear,
                    "auto" => Interpolation::Auto,
                    _ => {
                        return Err(PyValueError::new_err(format!(
                            "resample: '{how}' is none of 'hold', 'linear' and 'auto'"
                        )));
                    }
                };
                let (how, time) = (Resample { step, interpolation, anti_alias }, time.as_slice()?);
                resampled = Some(Resampling::new(&how, time).map_err(|error| error::batch(py, error))?);
                thetahat::data::Log::resampled(channels, time, &how)
            }
        };
        let log = log.map_err(|error| error::batch(py, error))?;
        let rows = Rows::new(1, log.rows()).map_err(|error| error::batch(py, error))?;
        let source = Source { file: Source::IN_MEMORY.to_owned(), rows, time: called, start, resampled };
        Ok(Self { log: Arc::new(log), sources: vec![source], inputs, outputs })
    }

    /// Reads files with the options of `thetahat fit`; also what the reader should know.
    #[staticmethod]
    fn read(py: Python<'_>, options: Vec<OsString>, uniform: bool) -> PyResult<(Self, Vec<String>)> {
        let opened = awaited(py, move |_| thetahat_cli::read(&options, uniform))?
            .map_err(|failure| error::program(py, &failure))?;
        let thetahat_cli::Opened { log, sources, inputs, outputs, warnings } = opened;
        let warnings = warnings.iter().map(|warning| error::in_python(warning)).collect();
        Ok((Self { log: Arc::new(log), sources, inputs, outputs }, warnings))
    }

    /// Several experiments as one log.
    #[staticmethod]
    fn join(py: Python<'_>, logs: Vec<PyRef<'_, Self>>) -> PyResult<Self> {
        let Some(first) = logs.first() else {
            return Err(PyValueError::new_err("logs: there is none; give at least one"));
        };
        let (mut sources, mut before) = (Vec::new(), 0);
        for log in &logs {
            for source in &log.sources {
                let rows = Rows::new(before + source.rows.first(), before + source.rows.last());
                sources
                    .push(Source { rows: rows.map_err(|error| error::batch(py, error))?, ..source.clone() });
            }
            before += log.log.rows();
        }
        let copies = logs.iter().map(|log| (*log.log).clone()).collect();
        let log = thetahat::data::Log::join(copies).map_err(|error| error::batch(py, error))?;
        Ok(Self { log: Arc::new(log), sources, inputs: first.inputs.clone(), outputs: first.outputs.clone() })
    }

    /// Some rows (1-based, inclusive) as a log of its own.
    fn part(&self, py: Python<'_>, first: usize, last: usize) -> PyResult<Self> {
        let rows = Rows::new(first, last).map_err(|error| error::batch(py, error))?;
        let whole = Arc::clone(&self.log);
        let log = interruptible(py, move |_| {
            let names: Vec<&str> = whole.channels().iter().map(|channel| channel.name.as_str()).collect();
            whole.part(&names, rows)
        })?;
        let mut sources = Vec::new();
        for source in &self.sources {
            let (begin, end) = (source.rows.first().max(first), source.rows.last().min(last));
            if begin > end {
                continue;
            }
            let own = |row: usize| row + 1 - source.rows.first();
            let file = match (begin, end) == (source.rows.first(), source.rows.last()) {
                true => source.file.clone(),
                false => format!("{} (rows {}..{})", source.file, own(begin), own(end)),
            };
            let rows =
                Rows::new(begin + 1 - first, end + 1 - first).map_err(|error| error::batch(py, error))?;
            sources.push(Source { file, rows, ..source.clone() });
        }
        Ok(Self { log: Arc::new(log), sources, inputs: self.inputs.clone(), outputs: self.outputs.clone() })
    }

    /// The same log under another name: that of the place from which its file was fetched.
    fn called(&self, file: String) -> Self {
        let sources = self.sources.iter().map(|source| Source { file: file.clone(), ..source.clone() });
        Self {
            log: Arc::clone(&self.log),
            sources: sources.collect(),
            inputs: self.inputs.clone(),
            outputs: self.outputs.clone(),
        }
    }

    /// The same log with other roles of its channels.
    fn select(&self, py: Python<'_>, inputs: Vec<String>, outputs: Vec<String>) -> PyResult<Self> {
        let names: Vec<&str> = inputs.iter().chain(&outputs).map(String::as_str).collect();
        let log = copy(&self.log, &names).map_err(|error| error::batch(py, error))?;
        Ok(Self { log: Arc::new(log), sources: self.sources.clone(), inputs, outputs })
    }

    #[getter]
    fn rows(&self) -> usize {
        self.log.rows()
    }

    #[getter]
    fn sample_time(&self) -> f64 {
        self.log.sample_time()
    }

    /// The clock in seconds, where the log has one.
    fn time<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.log.time().map(|time| PyArray1::from_slice(py, time))
    }

    /// Seconds from the first row of the log that this one was cut from.
    #[getter]
    fn before(&self) -> f64 {
        self.log.before()
    }

    /// What the times are called, and the first one as it was written, where they are dates.
    #[getter]
    fn clock(&self) -> (Option<String>, Option<String>) {
        self.sources.first().map_or((None, None), |source| (source.time.clone(), source.start.clone()))
    }

    /// The rows (from 0) before which no segment reaches back.
    #[getter]
    fn segment_starts(&self) -> Vec<usize> {
        self.log.segment_starts().to_vec()
    }

    /// Those of them (from 0) at which another experiment begins.
    #[getter]
    fn boundaries(&self) -> Vec<usize> {
        self.log.boundaries().to_vec()
    }

    /// A channel.
    fn values<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let channel = self.log.channel(name).map_err(|error| error::batch(py, error))?;
        Ok(PyArray1::from_slice(py, &channel.values))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, this) = (slf.py(), slf.get());
        let channels: Vec<_> = this
            .log
            .channels()
            .iter()
            .map(|channel| (channel.name.clone(), PyArray1::from_slice(py, &channel.values)))
            .collect();
        let sources =
            serde_json::to_string(&this.sources).map_err(|error| PyValueError::new_err(error.to_string()))?;
        let parts = (
            (channels, &this.inputs, &this.outputs, this.log.sample_time()),
            (this.time(py), this.log.segment_starts(), this.log.boundaries(), this.log.before(), sources),
        );
        let restore = slf.get_type().getattr("_restore")?;
        Ok((restore, parts.into_pyobject(py)?))
    }

    /// Makes the log again of what `__reduce__` gave.
    #[staticmethod]
    fn _restore(
        py: Python<'_>,
        data: (Named<'_>, Vec<String>, Vec<String>, f64),
        clock: (Option<Bound<'_, PyAny>>, Vec<usize>, Vec<usize>, f64, String),
    ) -> PyResult<Self> {
        let (channels, inputs, outputs, sample_time) = data;
        let (time, starts, boundaries, before, sources) = clock;
        let time =
            time.map(|time| PyResult::Ok(vector("time", &time, None)?.as_slice()?.to_vec())).transpose()?;
        let log =
            thetahat::data::Log::restored(read(channels)?, sample_time, time, starts, boundaries, before);
        let log = log.map_err(|error| error::batch(py, error))?;
        let sources =
            serde_json::from_str(&sources).map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok(Self { log: Arc::new(log), sources, inputs, outputs })
    }
}

/// A copy of some channels, for what uses them up.
pub(crate) fn copy(
    log: &thetahat::data::Log,
    names: &[&str],
) -> Result<thetahat::data::Log, thetahat::Error> {
    log.part(names, Rows::new(1, log.rows())?)
}

/// Copies the channels: from then on the log owns its data.
fn read(channels: Named<'_>) -> PyResult<Vec<Channel>> {
    let own = |(name, values): (String, Bound<'_, PyAny>)| {
        let values = vector(&name, &values, None)?.as_slice()?.to_vec();
        Ok(Channel { name, values })
    };
    channels.into_iter().map(own).collect()
}
