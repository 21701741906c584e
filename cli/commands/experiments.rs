//! The logs of a fit, read as one, and the columns that the model is about.

use std::path::{Path, PathBuf};

use thetahat::data::{Log, Source};
use thetahat::fit::FitDraft;

use crate::failure::Failure;
use crate::job::{FitJob, LogJob};
use crate::log::{self, Clocks, Joined};

/// All logs as one, where they came from, and the columns that the model is about.
pub(crate) struct Experiments {
    pub(crate) log: Log,
    pub(crate) sources: Vec<Source>,
    pub(crate) channels: Channels,
    /// What the reader should know, in plain words.
    pub(crate) warnings: Vec<String>,
}

/// The columns that the model is about.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Channels {
    pub(crate) inputs: Vec<String>,
    /// One at least.
    pub(crate) outputs: Vec<String>,
}

/// Which columns are wanted.
#[derive(Debug, Clone)]
pub(crate) struct Wanted {
    /// Named inputs; none: those called u, u1, u2, …
    pub(crate) inputs: Option<Vec<String>>,
    /// The named outputs; none: y.
    pub(crate) outputs: Vec<String>,
    /// Whether the model has inputs.
    pub(crate) driven: bool,
    /// What asks for a model without inputs.
    pub(crate) none: &'static str,
}

/// Reads all logs, one after the other, with any clock or with an even one.
pub(crate) fn experiments(job: &FitJob, any_clock: bool) -> Result<Experiments, Failure> {
    let draft = job.draft()?;
    let check = |inputs| draft.check_inputs(inputs).map_err(|error| Failure::option(&error));
    read(&job.paths, &job.log, &Wanted::of(&draft), any_clock, check)
}

impl Wanted {
    /// Those of a fit.
    pub(super) fn of(draft: &FitDraft) -> Self {
        Self {
            inputs: draft.options().inputs(),
            outputs: draft.options().outputs(),
            driven: draft.is_driven(),
            none: draft.asks_for_no_inputs(),
        }
    }
}

/// The same; `check` says whether the number of inputs goes with the rest.
pub(super) fn read(
    paths: &[PathBuf],
    log: &LogJob,
    wanted: &Wanted,
    any_clock: bool,
    check: impl Fn(usize) -> Result<(), Failure>,
) -> Result<Experiments, Failure> {
    let mut channels: Option<Channels> = None;
    let Joined { log, sources, warnings } =
        log::joined(paths, log, Clocks { any: any_clock, sample_time: None }, |path, header| {
            let own = Channels::same(wanted, path, header, &mut channels)?;
            check(own.inputs.len())?;
            Ok(own.inputs.into_iter().chain(own.outputs).collect())
        })?;
    Ok(Experiments { log, sources, channels: channels.unwrap_or_default(), warnings })
}

impl Channels {
    /// The inputs, and the output of a model that has one.
    pub(crate) fn single(mut self) -> (Vec<String>, String) {
        (self.inputs, self.outputs.pop().unwrap_or_default())
    }

    /// Those of a log, which are those of the logs before it.
    pub(super) fn same(
        wanted: &Wanted,
        path: &Path,
        header: &[String],
        known: &mut Option<Self>,
    ) -> Result<Self, Failure> {
        let bad = |message: String| Failure::data(format!("{}: {message}", path.display()));
        let own = Self::choose(wanted, header).map_err(bad)?;
        let first = known.get_or_insert_with(|| own.clone());
        if own != *first {
            return Err(bad(format!(
                "its inputs are {}, those of the first log {}; name with --input what all have",
                log::listed(&own.inputs),
                log::listed(&first.inputs)
            )));
        }
        Ok(own)
    }

    /// The named ones, or those called u, u1, u2, … and y.
    fn choose(wanted: &Wanted, header: &[String]) -> Result<Self, String> {
        let there_are = || format!("there are: {}", log::listed(header));
        let outputs = match &*wanted.outputs {
            [] if header.iter().any(|name| name == "y") => vec!["y".to_owned()],
            [] => {
                return Err(format!("no column is called y; name the output with --output; {}", there_are()));
            }
            named => named.to_vec(),
        };
        if !wanted.driven {
            return Ok(Self { inputs: Vec::new(), outputs });
        }
        if let Some(inputs) = &wanted.inputs {
            return Ok(Self { inputs: inputs.clone(), outputs });
        }
        let inputs = usual_inputs(header);
        if inputs.is_empty() {
            return Err(format!(
                "no column is called u, u1, u2, …; name the inputs with --input, or give {} for a model without; {}",
                wanted.none,
                there_are()
            ));
        }
        Ok(Self { inputs, outputs })
    }
}

/// The columns called u, u1, u2, … in this order.
pub(super) fn usual_inputs(header: &[String]) -> Vec<String> {
    let mut inputs: Vec<(Option<u32>, String)> = header
        .iter()
        .filter_map(|name| {
            let number = name.strip_prefix('u')?;
            let number = if number.is_empty() { None } else { Some(plain_number(number)?) };
            Some((number, name.clone()))
        })
        .collect();
    inputs.sort();
    inputs.into_iter().map(|(_, name)| name).collect()
}

/// 1, 2, …: digits without a leading zero.
fn plain_number(text: &str) -> Option<u32> {
    let number: u32 = text.parse().ok()?;
    (number > 0 && number.to_string() == text).then_some(number)
}
