use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::data::{Decision, Prefilter, Rows, Source};
use crate::document::{GENERATOR, document_methods};
use crate::estimate::{Criteria, Initial, Procedure};
use crate::model::{Model, Quantity};
use crate::plan::FitOptions;
use crate::select::Selection;
use crate::validate::{Fit, Part};
use crate::{Document, Error, text};

/// What a fit found: data provenance, the model, its figures. The JSON document `thetahat.report/1`.
///
/// Readers ignore fields that they do not know, and refuse another major version. The same input gives the same bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// `thetahat.report/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// The options of the fit, with which it can be repeated; none where it was not made of any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plan: Option<FitOptions>,
    /// What the model was fitted to.
    pub data: Data,
    /// How the model was chosen among others, if it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub selection: Option<Selection>,
    /// What the fit did by itself because of what it found in the log.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub decisions: Vec<Decision>,
    /// The model.
    pub model: Model,
    /// How it was estimated.
    pub estimation: Estimation,
    /// How well it fits, one entry for each part of the log and horizon.
    pub fit: Vec<Fit>,
    /// What the model is good for, in one sentence; empty where nothing was evaluated.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub purpose: String,
    /// What a careful reader should know, in plain words.
    pub warnings: Vec<String>,
}

/// Where the data came from and what was done to them. Rows are 1-based and inclusive.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Data {
    /// The logs in their order, with the rows that each has among all of them. A log is a segment of its own at least.
    pub logs: Vec<Source>,
    /// Of each log, a digest of the values of each of the model's channels in the rows asked for to estimate on, and of
    /// where they stand in it: 32 hexadecimal digits of XXH3. Empty for a log that has none of these rows. By them the
    /// rows of a fit are recognised.
    pub digests: Vec<BTreeMap<String, String>>,
    /// The number of rows of all logs, after resampling.
    pub rows: usize,
    /// Seconds from one row to the next.
    pub sample_time: f64,
    /// How the offsets were found: `none`, `mean`, `linear` or `start:K`.
    pub detrend: String,
    /// The band of frequencies in which the model was fitted: errors that the estimation counts are filtered ones, by a
    /// Butterworth filter of order 4 at each end. None: no filter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prefilter: Option<Prefilter>,
    /// The rows asked for to estimate on.
    pub estimation: Vec<Rows>,
    /// The rows asked for to validate on.
    pub validation: Vec<Rows>,
    /// How the rows were cut in time order, if they were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub split: Option<Parts>,
    /// The segments of estimation rows without a gap; a missing output is none to models that go on through it.
    pub segments: Vec<Rows>,
    /// How many values each channel misses.
    pub missing: Vec<Missing>,
    /// How many gaps the clock has.
    pub time_gaps: usize,
}

/// The parts that rows were cut into, in time order, and what each served for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Parts {
    /// Models were fitted to these, to compare them. The chosen one was fitted again, to these and the validation part.
    pub estimation: Vec<Rows>,
    /// Models were compared on these, where validation was asked for.
    pub validation: Vec<Rows>,
    /// Untouched until the end: the honest figures.
    pub test: Vec<Rows>,
}

/// How many values a channel misses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Missing {
    /// The channel.
    pub channel: String,
    /// The number of its rows without a value.
    pub rows: usize,
}

/// How a model was estimated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Estimation {
    /// How the estimate was found.
    #[serde(flatten)]
    pub procedure: Procedure,
    /// What stood for the samples before the first of a segment; none for models in equations, which say themselves
    /// what is known of their states there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial: Option<Initial>,
    /// The output's level in its own units where the inputs are at their offsets, if it was estimated with the
    /// parameters; with a trend that in the middle of the estimation rows. It is part of the model's offset of the
    /// output, and one of the parameters that the criteria count.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub level: Option<Quantity>,
    /// The output's slope in its units per second, if it was estimated with the parameters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slope: Option<Quantity>,
    /// N, the samples that count.
    pub samples: usize,
    /// The mean of e^2 over these samples; for exact likelihood that of v^2/f, with f the variances of innovations over
    /// var e; for models in equations that over all values of all outputs.
    pub mse: f64,
    /// Information criteria, those that are logarithms for each sample; for a largest likelihood of that.
    #[serde(flatten)]
    pub criteria: Criteria,
    /// The condition number of the regressors, scaled to unit norm; for a search that of psi. None where they are
    /// dependent.
    pub condition: Option<f64>,
}

impl Report {
    /// A report without figures and purpose, with what there is to warn of in the rows.
    pub(super) fn new(data: Data, model: impl Into<Model>, estimation: Estimation) -> Self {
        Self {
            schema: Self::SCHEMA.to_owned(),
            generator: GENERATOR.to_owned(),
            plan: None,
            warnings: data.overlap().into_iter().collect(),
            data,
            selection: None,
            decisions: Vec::new(),
            model: model.into(),
            estimation,
            fit: Vec::new(),
            purpose: String::new(),
        }
    }
}

impl Data {
    /// Warns of rows that the model was both fitted to and validated on.
    pub(super) fn overlap(&self) -> Option<String> {
        let overlaps = |v: &Rows, e: &Rows| v.first() <= e.last() && e.first() <= v.last();
        let any = self.validation.iter().any(|v| self.estimation.iter().any(|e| overlaps(v, e)));
        any.then(|| "validation rows overlap estimation rows: their figures flatter the model".to_owned())
    }

    /// The rows that were held out of the fit, and what they served for.
    pub(crate) fn held_out(&self) -> Vec<(Part, Vec<Rows>)> {
        let test = self.split.as_ref().map_or_else(Vec::new, |parts| parts.test.clone());
        [(Part::Validation, self.validation.clone()), (Part::Test, test)]
            .into_iter()
            .filter(|(_, rows)| !rows.is_empty())
            .collect()
    }
}

impl Document for Report {
    const NAME: &'static str = "report";
    const SCHEMA: &'static str = "thetahat.report/1";
    const REMEDY: &'static str = "give a file that fit wrote";

    document_methods!();

    fn check(&self) -> Result<(), Error> {
        self.model.check()
    }

    fn refusal(schema: &str) -> String {
        let own = Self::SCHEMA;
        format!("its schema is '{}', this version reads '{own}'; fit the log again", text::brief(schema, 40))
    }
}
