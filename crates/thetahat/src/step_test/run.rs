//! From a log to the document.

use super::document::{FittedProcess, Shape, Step, StepFigure, StepMethod, StepSummary, StepTest};
use super::evaluate::{Section, evaluated};
use super::levels::{Jump, moves};
use super::process::fitted;
use crate::data::{Log, Rows, Source, checked};
use crate::document::GENERATOR;
use crate::figures::{error, short};
use crate::inspect::quantization;
use crate::model::Quantity;
use crate::{Document, Error};

/// What a process leaves is noise up to so many times its standard deviation.
const AS_NOISE: f64 = 1.3;
/// Gains that differ between steps by this many standard errors are not those of one linear plant.
const DIFFER: f64 = 4.0;
/// And by this fraction.
const APART: f64 = 0.02;

/// So many changes that are too slow for steps are told one by one.
const TOLD: usize = 3;

/// What to evaluate.
#[derive(Debug, Clone, PartialEq)]
pub struct StepTestPlan {
    /// The input channel.
    pub input: String,
    /// The output channel.
    pub output: String,
    /// The rows; none: all. Each range is for itself.
    pub rows: Vec<Rows>,
}

impl StepTestPlan {
    /// All rows of these channels.
    pub fn new(input: &str, output: &str) -> Self {
        Self { input: input.to_owned(), output: output.to_owned(), rows: Vec::new() }
    }
}

/// Finds the steps of an input and reads the figures of a step test off the response to each.
///
/// A step is a jump of the input from a level that it holds to another; noise on the input below the size of its steps
/// does not matter. The clock may be irregular. The response is s = (y - y0)/(y1 - y0) with y0 the mean before and y1
/// the mean in the final steady state. [`StepFigure`] and [`StepMethod`] list what is read off it, and how.
///
/// Standard errors are to first order in the noise: the standard deviation and the autocorrelation of the output about
/// its mean at rest, before the step and in the final steady state, go through the derivatives of each figure by each
/// row, and so do the errors of y0 and y1. They hold for the model that a way takes for granted; what a wrong one does
/// they do not say, and [`StepResponse::misfit`](super::StepResponse::misfit) does.
///
/// A step without a response that can be evaluated keeps its place, with the reason: the output is not at rest before
/// it, the final steady state is not reached, the change is lost in the noise, rows are too few.
///
/// Beside them stands the process with the least squared errors over all rows ([`FittedProcess`]): of first order with
/// a dead time, or of second order, as the responses look.
///
/// Cost: O(N) for each step, times the rows over which the noise is correlated.
///
/// # Errors
/// [`Error::Data`] for channels or rows that are not there, and an input without a step; [`Error::Argument`] for rows
/// that overlap; [`Error::Undetermined`] if no step has a response that can be evaluated.
///
/// ```
/// use thetahat::data::{Channel, Log};
/// use thetahat::step_test::{Shape, StepFigure, StepTestPlan, step_test};
///
/// // A damping of 0.5 and a natural frequency of 1 rad/s.
/// let at = |t: f64| 1.0 - (-0.5 * t).exp() * ((0.75_f64.sqrt() * t).cos() + (0.75_f64.sqrt() * t).sin() / 3_f64.sqrt());
/// let u = (0..500).map(|t| f64::from(t >= 50)).collect();
/// let y = (0..500).map(|t| at(0.1 * f64::from((t - 50).max(0)))).collect();
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
/// let found = step_test(&log, &[], &StepTestPlan::new("u", "y"))?;
/// let response = found.steps[0].response.as_ref().unwrap();
/// assert_eq!(response.shape, Shape::Underdamped);
/// assert!((response.trusted(StepFigure::Damping).unwrap().value.value - 0.5).abs() < 0.005);
/// assert!((response.trusted(StepFigure::NaturalFrequency).unwrap().value.value - 1.0).abs() < 0.01);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn step_test(log: &Log, sources: &[Source], plan: &StepTestPlan) -> Result<StepTest, Error> {
    if plan.input == plan.output {
        let name = &plan.input;
        return Err(Error::argument(
            "output",
            format!("'{name}' is the input too; each channel has one role"),
        ));
    }
    let sections = sections(log, plan)?;
    let mut steps = Vec::new();
    let mut warnings = Vec::new();
    for section in &sections {
        let found = moves(&section.input);
        warnings.extend(found.slow.iter().take(TOLD).map(|jump| too_slow(section, jump, plan)));
        if found.slow.len() > TOLD {
            warnings
                .push(format!("and {} more changes that are too slow for steps", found.slow.len() - TOLD));
        }
        for jump in found.steps {
            let number = steps.len() + 1;
            let (step, words) = evaluated(section, &jump)?;
            warnings.extend(words.into_iter().map(|word| format!("step {number}: {word}")));
            steps.push(step);
        }
    }
    if steps.is_empty() {
        return Err(Error::data(nothing(&sections, plan)));
    }
    if steps.iter().all(|step| step.response.is_none()) {
        return Err(Error::undetermined(Vec::new(), hopeless(&steps)));
    }
    for (number, step) in (1..).zip(&steps) {
        if let Some(why) = &step.refused {
            warnings.push(format!("step {number} is left out: {why}"));
        }
    }
    let mut summary = summary(&steps);
    let mut advice = advice(&steps);
    let process = match fitted(log, (&plan.input, &plan.output), &plan.rows, &steps) {
        Ok(process) => {
            summary.extend(process.summary(steps.len()));
            // Those of one figure stand together, whichever step has them.
            summary.sort_by_key(|of| of.figure);
            advice.push(beside(&process, &steps));
            Some(process)
        }
        Err(error) => {
            warnings.push(format!("no process of least squares: {error}"));
            None
        }
    };
    warnings.extend(nonlinear(&steps));
    Ok(StepTest {
        schema: StepTest::SCHEMA.to_owned(),
        generator: GENERATOR.to_owned(),
        logs: sources.to_vec(),
        input: plan.input.clone(),
        output: plan.output.clone(),
        advice,
        steps,
        summary,
        process,
        warnings,
    })
}

/// The parts of the log that are each for itself, scaled to the range of the output.
fn sections(log: &Log, plan: &StepTestPlan) -> Result<Vec<Section>, Error> {
    let input = &log.channel(&plan.input)?.values;
    let output = &log.channel(&plan.output)?.values;
    let ranges = match plan.rows.as_slice() {
        [] => vec![Rows::new(1, log.rows())?],
        rows => checked("rows", rows, log.rows())?,
    };
    let mut sections = Vec::new();
    for range in &ranges {
        let range = range.positions();
        for own in log.logs() {
            let own = own.start.max(range.start)..own.end.min(range.end);
            let rows: Vec<usize> =
                own.filter(|row| !(input[*row].is_nan() || output[*row].is_nan())).collect();
            if !rows.is_empty() {
                sections.push(rows);
            }
        }
    }
    let all = || sections.iter().flatten();
    if all().next().is_none() {
        return Err(Error::data("no row has a value of both channels: there is no step"));
    }
    let range = |values: &[f64]| {
        all().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), row| {
            (low.min(values[*row]), high.max(values[*row]))
        })
    };
    let (ends, levels) = (range(output), range(input));
    let unit = ends.1 - ends.0;
    let finite =
        |(low, high): (f64, f64)| (high - low).is_finite() && low.abs().max(high.abs()) < f64::MAX / 1e9;
    if !(finite(ends) && finite(levels)) {
        return Err(Error::data("the channels leave the range of numbers: give them in other units"));
    }
    let unit = if unit > 0.0 { unit } else { 1.0 };
    let mut distinct: Vec<f64> = all().map(|row| output[*row]).collect();
    distinct.sort_unstable_by(f64::total_cmp);
    distinct.dedup();
    let step = quantization(&distinct).unwrap_or(0.0) / unit;
    let section = |rows: Vec<usize>| Section {
        time: rows.iter().map(|row| log.elapsed(*row)).collect(),
        input: rows.iter().map(|row| input[*row]).collect(),
        output: rows.iter().map(|row| (output[*row] - ends.0) / unit).collect(),
        rows,
        lowest: ends.0,
        unit,
        step,
    };
    Ok(sections.into_iter().map(section).collect())
}

/// Why there is no step.
fn nothing(sections: &[Section], plan: &StepTestPlan) -> String {
    let name = &plan.input;
    let all = || sections.iter().flat_map(|section| &section.input);
    let first = all().next().copied().unwrap_or(0.0);
    if all().all(|value| *value == first) {
        return format!("there is no step: the input '{name}' is constant ({})", short(first));
    }
    format!(
        "there is no step: the input '{name}' does not jump from one level that it holds to another; spectrum and fit take other \
         signals, and step takes the document of spectrum by sines"
    )
}

/// Why a change of the input is no step.
fn too_slow(section: &Section, jump: &Jump, plan: &StepTestPlan) -> String {
    let Jump { from, to, taken } = jump;
    // The level after it begins where it does.
    let held = from.rows.len().min(to.rows.len() - taken);
    format!(
        "from row {} on '{}' goes from {} to {} in {taken} rows, which is slow beside a level of {held} rows: it is left out, and a process takes \
         it as it is (`structure` p1d of a fit)",
        section.rows[to.rows.start] + 1,
        plan.input,
        short(from.value),
        short(to.value)
    )
}

/// Why no step is evaluated: each reason once.
fn hopeless(steps: &[Step]) -> String {
    const MOST: usize = 3;
    let reasons: Vec<String> = (1..)
        .zip(steps)
        .filter_map(|(number, step)| {
            Some(format!("step {number} (row {}): {}", step.row, step.refused.as_ref()?))
        })
        .collect();
    let more = reasons.len().saturating_sub(MOST);
    let rest = if more > 0 { format!("; and {more} more") } else { String::new() };
    format!(
        "no step can be evaluated: {}{rest}; a fit of a process takes responses as far as they go",
        reasons[..reasons.len() - more].join("; ")
    )
}

/// Each figure by each method over the steps that have it, in the order of the steps.
fn summary(steps: &[Step]) -> Vec<StepSummary> {
    let estimates = || steps.iter().filter_map(|step| step.response.as_ref()).flat_map(|of| &of.estimates);
    let mut kinds: Vec<(StepFigure, StepMethod)> = Vec::new();
    for estimate in estimates() {
        let kind = (estimate.figure, estimate.method);
        if !kinds.contains(&kind) {
            kinds.push(kind);
        }
    }
    let mut all: Vec<StepSummary> = kinds
        .into_iter()
        .map(|(figure, method)| {
            let own = || estimates().filter(|of| (of.figure, of.method) == (figure, method));
            let count = own().count() as f64;
            let mean = own().map(|of| of.value.value).sum::<f64>() / count;
            let square: f64 = own().map(|of| (of.value.value - mean).powi(2)).sum();
            let spread = (count > 1.0).then(|| (square / (count - 1.0)).sqrt());
            let noise: Option<f64> = own().map(|of| of.value.standard_error.map(|error| error * error)).sum();
            let between = spread.map(|spread| spread / count.sqrt());
            let error = noise.map(|noise| (noise.sqrt() / count).max(between.unwrap_or(0.0)));
            StepSummary {
                figure,
                method,
                steps: own().count(),
                value: Quantity::new(mean, error),
                spread,
                trusted: own().filter(|of| of.trusted).count(),
            }
        })
        .collect();
    all.sort_by_key(|of| of.figure);
    all
}

/// What the process of least squares is worth beside what is read off.
fn beside(process: &FittedProcess, steps: &[Step]) -> String {
    let noise = steps.iter().filter_map(|step| step.response.as_ref()).map(|response| response.noise);
    let noise = noise.fold(0.0, f64::max);
    let structure = process.structure;
    if process.rmse <= AS_NOISE * noise {
        return format!(
            "the process {structure} of least squares leaves {}, about the noise: it uses every row and has the least spread of all, so \
             take its figures; a fit of this process makes a model of it",
            error(process.rmse)
        );
    }
    format!(
        "the process {structure} of least squares leaves {}, {} times the noise: it is not the whole truth over all rows; compare fits \
         of other processes",
        error(process.rmse),
        short((10.0 * process.rmse / noise).round() / 10.0)
    )
}

/// Says where the gains of the steps differ by more than noise.
fn nonlinear(steps: &[Step]) -> Option<String> {
    let gains = steps.iter().filter_map(|step| {
        let gain = step.response.as_ref()?.trusted(StepFigure::Gain)?.value;
        Some((gain.value, gain.standard_error.unwrap_or(0.0)))
    });
    let by_value = |a: &(f64, f64), b: &(f64, f64)| a.0.total_cmp(&b.0);
    let (least, largest) = (gains.clone().min_by(by_value)?, gains.max_by(by_value)?);
    let apart = largest.0 - least.0;
    let differ = apart > (DIFFER * least.1.hypot(largest.1)).max(APART * least.0.abs().max(largest.0.abs()));
    differ.then(|| {
        format!(
            "the gains of the steps differ by more than noise makes them ({} to {}): the plant is not linear over these levels, \
             something else moved the output, or a final steady state was not quite reached",
            short(least.0),
            short(largest.0)
        )
    })
}

/// Which figures to trust, and why, for the shapes that there are.
fn advice(steps: &[Step]) -> Vec<String> {
    let has = |shape| {
        steps.iter().filter_map(|step| step.response.as_ref()).any(|response| response.shape == shape)
    };
    [
        (
            Shape::FirstOrder,
            "first order: trust the weighted t-bar; it counts each sample by how little noise turns it, while the plain mean is drawn up \
             by samples near the final steady state, the tangent rests on a few rows, and 63.2 % on those around one level",
        ),
        (
            Shape::Overdamped,
            "no overshoot, but no first order either: trust the two points (28.3 % and 63.2 %), a first order with dead time that meets \
             the response there; t-bar and tangent take a shape for granted that it has not, and a model of second order (fit) fits it",
        ),
        (
            Shape::Underdamped,
            "overshoot: trust the parabola over the first peak; it averages the rows around it, where the largest value alone is drawn up \
             by noise; a second peak, where there is one, tells the frequency without the dead time",
        ),
    ]
    .into_iter()
    .filter(|(shape, _)| has(*shape))
    .map(|(_, words)| words.to_owned())
    .collect()
}
