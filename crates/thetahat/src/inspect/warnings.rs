//! What a careful reader should know, in plain words.

use super::clock::Ticks;
use super::inspection::{FEW_CHANGES, UNSURE};
use super::{ChannelQuality, Inspection, InspectionPlan};
use crate::data::Interpolation;
use crate::figures::{fixed, short};

/// A trend that explains this much of an output is worth a warning.
const TREND: f64 = 0.25;
/// A rounding step that is this fraction of the standard deviation is coarse.
const COARSE: f64 = 0.25;
/// An input that excites no more than this many orders limits the model.
const POOR: usize = 10;
/// Rows that a sentence lists.
const LISTED: usize = 5;
/// Rows from which a fit has a chance.
const FEW_ROWS: usize = 50;

/// What is to be said of the rows as they are.
pub(super) fn of_the_rows(inspection: &Inspection, ticks: &Ticks, plan: &InspectionPlan) -> Vec<String> {
    let mut words = clock(inspection, ticks, plan);
    if inspection.rows < FEW_ROWS {
        words.push(format!(
            "the log has {} row{} only: record more",
            inspection.rows,
            plural(inspection.rows)
        ));
    }
    for channel in &inspection.channels {
        words.extend(of_channel(channel, inspection.rows));
    }
    words
}

fn clock(inspection: &Inspection, ticks: &Ticks, plan: &InspectionPlan) -> Vec<String> {
    let clock = &inspection.clock;
    let mut words = Vec::new();
    if let Some(row) = ticks.first_backward {
        let how = if ticks.repeats { "repeats" } else { "goes back" };
        words.push(format!(
            "the time {how} at row {row} ({} such rows): sort the log by time and remove repeated rows",
            ticks.backward
        ));
    } else if let (None, Some(how)) = (plan.resample, ticks.rates) {
        words.push(format!(
            "the clock has two rates (steps from {} s to {} s, median {} s): models in continuous time and in equations take it as it is, \
             for others a fit resamples it every {} s",
            short(clock.steps.0),
            short(clock.steps.1),
            short(clock.sample_time),
            how.step
        ));
    } else if let (true, None, Some(regular)) = (clock.irregular, plan.resample, ticks.regular) {
        words.push(format!(
            "the clock is irregular (steps from {} s to {} s, median {} s), which a fit does not take: {}",
            short(clock.steps.0),
            short(clock.steps.1),
            short(clock.sample_time),
            regular
        ));
    }
    if clock.gaps > 0 && !clock.irregular {
        words.push(format!(
            "the clock has {} gap{} (steps over 1.5 medians): a fit cuts the log there",
            clock.gaps,
            plural(clock.gaps)
        ));
    }
    words
}

fn of_channel(channel: &ChannelQuality, rows: usize) -> Vec<String> {
    let mut words = Vec::new();
    let mut say = |text: String| words.push(format!("channel '{}' {text}", channel.name));
    if channel.missing == rows {
        say("has no values: leave it out".to_owned());
    } else if channel.missing > 0 {
        let simulated = channel.role.as_deref() == Some("output");
        let but = if simulated { ", but for an output-error model" } else { "" };
        say(format!("misses {} of {rows} values: a fit cuts the log there{but}", channel.missing));
    }
    if channel.minimum.is_some() && channel.minimum == channel.maximum {
        say("is constant: it tells nothing".to_owned());
    }
    if channel.outlier_count > 0 {
        let listed: Vec<String> = channel.outliers.iter().take(LISTED).map(ToString::to_string).collect();
        let more = if channel.outlier_count > LISTED {
            format!(", … ({} in all)", channel.outlier_count)
        } else {
            String::new()
        };
        say(format!(
            "has values far from their neighbours at row{} {}{more}: where they are wrong, empty their fields, or fit with \
             `norm` 1",
            plural(channel.outlier_count),
            listed.join(", ")
        ));
    }
    if let Some(stuck) = channel.stuck {
        say(format!(
            "stands still in rows {}..{}, as nowhere else: where the sensor was stuck, empty these fields",
            stuck.first(),
            stuck.last()
        ));
    }
    if let Some(saturation) = channel.saturation {
        for (rows, which) in [(saturation.low, "smallest"), (saturation.high, "largest")] {
            if rows > 0 {
                say(format!(
                    "rests at its {which} value in {rows} rows: if it is clipped there, a linear model does not hold on them"
                ));
            }
        }
    }
    let coarse = channel.quantization.zip(channel.standard_deviation);
    if let Some((step, _)) = coarse.filter(|(step, deviation)| *step > COARSE * deviation) {
        say(format!(
            "is rounded to multiples of {}, which is coarse for a standard deviation of {}: that rounding is noise",
            short(step),
            short(channel.standard_deviation.unwrap_or(0.0))
        ));
    }
    words
}

/// What is to be said of inputs and output together.
pub(super) fn of_the_dynamics(inspection: &Inspection, plan: &InspectionPlan) -> Vec<String> {
    let mut words = Vec::new();
    if let Some(resampled) = inspection.log.resampled.as_ref().filter(|_| plan.resample.is_none()) {
        words.push(format!(
            "excitation, delay and feedback are those of the log resampled every {} s{}",
            resampled.step,
            if resampled.interpolation == Interpolation::Linear { " by straight lines" } else { "" }
        ));
    }
    for excitation in &inspection.excitation {
        let name = &excitation.input;
        let changes = inspection.changes(name);
        if excitation.highest == 0 {
            words.push(format!("input '{name}' has too few rows in a segment to tell what it excites"));
        } else if excitation.order == 0 {
            words.push(format!(
                "input '{name}' excites nothing: leave it out, or record a log in which it changes"
            ));
        } else if changes <= FEW_CHANGES {
            words.push(format!(
                "input '{name}' changes {changes:.0} time{} only: what a step shows is seen once and not averaged, and whether the \
                 input follows the output cannot be told",
                plural(changes.round() as usize)
            ));
        } else if excitation.order <= POOR.min(excitation.highest) && excitation.order < excitation.highest {
            words.push(format!(
                "input '{name}' excites order {0} only: a model can have {0} parameter{1} from it at most",
                excitation.order,
                plural(excitation.order)
            ));
        }
    }
    for (excitation, other) in inspection.excitation.iter().filter_map(|of| Some((of, of.same_as.as_ref()?)))
    {
        words.push(format!(
            "inputs '{other}' and '{}' are the same but for scale and offset: no fit can tell them apart; leave one out",
            excitation.input
        ));
    }
    let trends = inspection.channels.iter().filter(|channel| channel.role.as_deref() == Some("output"));
    for (channel, share) in trends.filter_map(|channel| Some((channel, channel.trend_share?))) {
        // The answer to steps has one by itself.
        if share >= TREND && inspection.rest.is_none() {
            words.push(format!(
                "channel '{}' has a trend that explains {} % of it: if that is drift and no answer to an input, fit with \
                 `detrend` linear",
                channel.name,
                fixed(100.0 * share, 0)
            ));
        }
    }
    if let Some(rest) = inspection.rest {
        words.push(format!(
            "the log is a step test that begins at rest for {rest} rows: its means are no level of the plant; take the offsets \
             from there (`detrend` start:{rest}), and estimate the output's slope with the parameters if it drifts (`trend`)"
        ));
    }
    if plan.output.is_none() && !plan.inputs.is_empty() {
        words.push("there is no output (y): name it with -y to learn of delay and feedback".to_owned());
    }
    if plan.inputs.is_empty() && plan.output.is_some() {
        words.push("there is no input: only a time series model can be fitted".to_owned());
    }
    for delay in inspection.delays.iter().filter(|delay| delay.nk.is_none()) {
        if inspection.changes(&delay.input) <= FEW_CHANGES {
            continue;
        }
        // Of an input that excites nothing that was said.
        if inspection.excitation.iter().any(|of| of.input == delay.input && of.order > 0) {
            words.push(format!(
                "no effect of input '{}' is seen, and so no delay: it is small, slow or lost in noise, or there are too few rows to \
                 tell",
                delay.input
            ));
        }
    }
    for feedback in inspection.feedback.iter().filter(|feedback| feedback.found) {
        words.push(format!(
            "input '{}' follows past errors of the output: feedback is suspected; fit a model with noise (arx, armax, bj), \
             as oe and `method` iv or sriv are biased in a closed loop",
            feedback.input
        ));
    }
    for delay in inspection.delays.iter().filter(|delay| delay.nk.is_some()) {
        if let Some(confidence) = delay.confidence.filter(|confidence| *confidence < UNSURE) {
            words.push(format!(
                "the delay of input '{}' is uncertain: {} has {} %; try others (`nk`), or excite it faster",
                delay.input,
                delay.nk.unwrap_or(0),
                fixed((100.0 * confidence).floor(), 0)
            ));
        }
    }
    let suspected =
        |input: &str| inspection.feedback.iter().any(|feedback| feedback.found && feedback.input == input);
    for delay in inspection.delays.iter().filter(|delay| delay.nk == Some(0)) {
        words.push(format!(
            "the output follows input '{}' within the same row: it acts at once (a fit takes `nk` 0), its rows are shifted, or it \
             is computed from the output{}",
            delay.input,
            if suspected(&delay.input) { "; as feedback is suspected, `nk` 1 keeps that out" } else { "" }
        ));
    }
    words
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}
