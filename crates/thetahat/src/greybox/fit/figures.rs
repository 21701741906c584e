//! How well a fitted model predicts, and whether its noises are what it says.

use super::criterion::{Element, Failure, walk};
use super::document::{GreyFit, GreyOutput};
use super::experiment::Experiment;
use super::free_run::free_run;
use super::predictor::Predictor;
use crate::distribution::{chi_square_interval, chi_square_tail};
use crate::validate::{NisCount, closeness};
use crate::{GreyBox, NisSummary, Test};

/// Lags of the test of whiteness, as far as there are so many readings for each.
const LAGS: usize = 20;
const READINGS_PER_LAG: usize = 10;

/// What the filter made of the logs.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Figures {
    pub(super) outputs: Vec<GreyOutput>,
    /// For each log, the start of the free run.
    pub(super) starts: Vec<Option<Vec<f64>>>,
    pub(super) nis: Option<NisSummary>,
}

/// One element as it was predicted.
#[derive(Debug, Clone, Copy)]
struct Predicted {
    at: Element,
    measured: f64,
    prediction: f64,
    /// e/sqrt(S).
    standardised: f64,
}

impl Figures {
    /// O(N (n^3 + m n^2)) a few times.
    pub(super) fn of(model: &GreyBox, experiments: &[Experiment], z: &[f64]) -> Result<Self, Failure> {
        let channels = model.outputs();
        let mut predicted = Vec::new();
        walk(model, experiments, &mut Predictor::new(model), z, |at, prediction, innovation| {
            predicted.push(Predicted {
                at,
                measured: experiments[at.log].output(at.row)[at.output],
                prediction,
                standardised: innovation.error / innovation.variance.sqrt(),
            });
        })?;
        let runs: Vec<_> = experiments.iter().map(|experiment| free_run(model, experiment, z)).collect();
        let rows: usize = experiments.iter().map(Experiment::rows).sum();
        let outputs = channels.iter().enumerate().map(|(output, channel)| {
            let own: Vec<Predicted> =
                predicted.iter().filter(|one| one.at.output == output).copied().collect();
            let free: Option<Vec<(f64, f64)>> = own
                .iter()
                .map(|one| {
                    let run = runs[one.at.log].as_ref()?;
                    Some((one.measured, run.outputs[one.at.row * channels.len() + output]))
                })
                .collect();
            GreyOutput {
                channel: channel.clone(),
                readings: own.len(),
                missing: rows - own.len(),
                one_step: GreyFit::of(own.iter().map(|one| (one.measured, one.prediction))),
                free_run: free.and_then(|pairs| GreyFit::of(pairs.into_iter())),
                whiteness: whiteness(&own, experiments),
            }
        });
        Ok(Self {
            outputs: outputs.collect(),
            starts: runs.iter().map(|run| run.as_ref().map(|run| run.start.clone())).collect(),
            nis: nis(&predicted),
        })
    }
}

impl GreyFit {
    /// Of pairs of a measured value and what the model says; none for no pairs, or numbers out of range.
    fn of(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> Option<Self> {
        let (percent, rmse) = closeness(pairs);
        rmse.map(|rmse| Self { percent, rmse })
    }
}

/// Of each row with something measured, the sum of e^2/S: as the filter's elements come one after the other, each with the
/// variance that is left by those before, this is the normalised innovation squared of the row.
fn nis(predicted: &[Predicted]) -> Option<NisSummary> {
    let mut count = NisCount::default();
    for row in predicted.chunk_by(|one, next| (one.at.log, one.at.row) == (next.at.log, next.at.row)) {
        let nis = row.iter().map(|one| one.standardised * one.standardised).sum();
        if let Some(bounds) = chi_square_interval(row.len()) {
            count.add(nis, row.len(), bounds);
        }
    }
    count.summary()
}

/// Ljung and Box's test on the standardised innovations of one output: Q = N (N + 2) sum_k r_k^2/N_k over the N_k pairs that
/// are k rows apart in one log, chi-square with as many degrees of freedom as lags (Ljung and Box 1978). The parameters take
/// none: they do not enter the model of the noise. A row with a missing value takes its own pairs out and no others.
fn whiteness(own: &[Predicted], experiments: &[Experiment]) -> Option<Test> {
    let longest = experiments.iter().map(Experiment::rows).max().unwrap_or(0);
    let lags = LAGS.min(own.len() / READINGS_PER_LAG).min(longest.saturating_sub(1));
    if lags == 0 {
        return None;
    }
    let mut series: Vec<Vec<f64>> =
        experiments.iter().map(|experiment| vec![f64::NAN; experiment.rows()]).collect();
    own.iter().for_each(|one| series[one.at.log][one.at.row] = one.standardised);
    let square: f64 = own.iter().map(|one| one.standardised * one.standardised).sum();
    let count = own.len() as f64;
    let mut sum = 0.0;
    for lag in 1..=lags {
        let pairs = series.iter().flat_map(|values| values.iter().zip(values.iter().skip(lag)));
        let products = pairs.map(|(one, later)| one * later).filter(|product| !product.is_nan());
        let (pairs, total) =
            products.fold((0_usize, 0.0), |(pairs, total), product| (pairs + 1, total + product));
        if pairs > 0 {
            sum += (total / square).powi(2) / pairs as f64;
        }
    }
    let (statistic, degrees) = (count * (count + 2.0) * sum, lags as f64);
    let p_value = chi_square_tail(statistic, degrees);
    statistic.is_finite().then_some(Test { lags, statistic, degrees, p_value })
}
