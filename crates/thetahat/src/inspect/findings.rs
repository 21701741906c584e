//! What a careful reader should know.

use super::clock::Ticks;
use super::inspection::{FEW_CHANGES, UNSURE};
use super::{ChannelQuality, Clock, Inspection, InspectionPlan};
use crate::data::{Finding, FindingKind, Interpolation, Padding, Rows};
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
pub(super) fn of_the_rows(inspection: &Inspection, ticks: &Ticks, plan: &InspectionPlan) -> Vec<Finding> {
    let rows = inspection.rows;
    let mut findings: Vec<Finding> = steps(&inspection.clock, ticks, plan).into_iter().collect();
    findings.extend(gaps(&inspection.clock));
    if rows < FEW_ROWS {
        let seen = format!("the log has {rows} row{} only", plural(rows));
        findings.push(Finding::new(FindingKind::FewRows, seen, "record more"));
    }
    for channel in &inspection.channels {
        findings.extend(of_channel(channel, rows).into_iter().map(|finding| finding.of(&channel.name)));
    }
    findings
}

/// What is wrong with the steps of the clock.
fn steps(clock: &Clock, ticks: &Ticks, plan: &InspectionPlan) -> Option<Finding> {
    let range = || {
        let [shortest, longest, median] = [clock.steps.0, clock.steps.1, clock.sample_time].map(short);
        format!("(steps from {shortest} s to {longest} s, median {median} s)")
    };
    if let Some(row) = ticks.first_backward {
        let how = if ticks.repeats { "repeats" } else { "goes back" };
        let seen = format!("the time {how} at row {row} ({} such rows)", ticks.backward);
        let advice = "sort the log by time and remove repeated rows";
        return Some(Finding::new(FindingKind::TimeGoesBack, seen, advice).at(single(&[row])));
    }
    if plan.resample.is_some() {
        return None;
    }
    if let Some(how) = ticks.rates {
        let advice = format!(
            "models in continuous time and in equations take it as it is, for others a fit resamples it every {} s",
            how.step
        );
        let seen = format!("the clock has two rates {}", range());
        return Some(Finding::new(FindingKind::TwoRates, seen, advice));
    }
    let regular = ticks.regular.as_ref().filter(|_| clock.irregular)?;
    let seen = format!(
        "the clock is irregular {}; polynomial fits need an even clock, `structure` and `grey` do not",
        range()
    );
    Some(Finding::new(FindingKind::IrregularClock, seen, regular.to_string()))
}

fn gaps(clock: &Clock) -> Option<Finding> {
    let seen = format!("the clock has {} gap{} (steps over 1.5 medians)", clock.gaps, plural(clock.gaps));
    let finding =
        Finding::new(FindingKind::Gaps, seen, "a fit cuts the log there").at(single(&clock.gap_rows));
    (clock.gaps > 0 && !clock.irregular).then_some(finding)
}

fn of_channel(channel: &ChannelQuality, rows: usize) -> Vec<Finding> {
    let say = |kind, seen: String, advice: &str| {
        Finding::new(kind, format!("channel '{}' {seen}", channel.name), advice)
    };
    let mut findings = Vec::new();
    if channel.missing == rows {
        findings.push(say(FindingKind::NoValues, "has no values".to_owned(), "leave it out"));
    } else if channel.missing > 0 {
        let simulated = channel.role.as_deref() == Some("output");
        let but = if simulated { ", but for an output-error model" } else { "" };
        let seen = format!("misses {} of {rows} values", channel.missing);
        let finding = say(FindingKind::Missing, seen, &format!("a fit cuts the log there{but}"));
        findings.push(finding.at(channel.missing_rows.clone()));
    }
    if channel.minimum.is_some() && channel.minimum == channel.maximum {
        findings.push(say(FindingKind::Constant, "is constant".to_owned(), "it tells nothing"));
    }
    if channel.outlier_count > 0 {
        let listed: Vec<String> = channel.outliers.iter().take(LISTED).map(ToString::to_string).collect();
        let more = if channel.outlier_count > LISTED {
            format!(", … ({} in all)", channel.outlier_count)
        } else {
            String::new()
        };
        let seen = format!(
            "has values far from their neighbours at row{} {}{more}",
            plural(channel.outlier_count),
            listed.join(", ")
        );
        let advice = match channel.role.as_deref() {
            Some("output") => {
                "a fit without orders takes them for missing; where they are wrong, empty their fields, or fit with `norm` 1"
            }
            _ => "where they are wrong, empty their fields, or fit with `norm` 1",
        };
        findings.push(say(FindingKind::Outliers, seen, advice).at(single(&channel.outliers)));
    }
    if let Some(stuck) = channel.stuck {
        let seen = format!("stands still in rows {}..{}, as nowhere else", stuck.first(), stuck.last());
        let advice = "where the sensor was stuck, empty these fields";
        findings.push(say(FindingKind::Stuck, seen, advice).at(vec![stuck]));
    }
    if let Some(limits) = &channel.saturation {
        for (count, which, rows) in
            [(limits.low, "smallest", &limits.low_rows), (limits.high, "largest", &limits.high_rows)]
        {
            if count > 0 {
                let seen = format!("rests at its {which} value in {count} rows");
                let advice = "if it is clipped there, a linear model does not hold on them";
                findings.push(say(FindingKind::Saturation, seen, advice).at(rows.clone()));
            }
        }
    }
    if let Some((step, deviation)) = channel.quantization.zip(channel.standard_deviation)
        && step > COARSE * deviation
    {
        let seen = format!(
            "is rounded to multiples of {}, which is coarse for a standard deviation of {}",
            short(step),
            short(deviation)
        );
        findings.push(say(FindingKind::Coarse, seen, "that rounding is noise"));
    }
    findings
}

/// What is to be said of rows at the end in which nothing changes.
pub(super) fn of_padding(padding: &Padding) -> Finding {
    Finding::new(FindingKind::Padding, padding.seen(), padding.advice()).at(vec![padding.rows])
}

/// What is to be said of a plant that is unstable.
pub(super) fn of_unstable(seen: String) -> Finding {
    let advice = "fit a model with noise that may be unstable (arx, armax), as oe and `method` iv or sriv are biased in a closed loop";
    Finding::new(FindingKind::Unstable, seen, advice)
}

/// What is to be said of inputs and output together.
pub(super) fn of_the_dynamics(inspection: &Inspection, plan: &InspectionPlan) -> Vec<Finding> {
    let mut findings = Vec::new();
    if let Some(resampled) = inspection.log.resampled.as_ref().filter(|_| plan.resample.is_none()) {
        findings.push(Finding::new(
            FindingKind::Resampled,
            "the log has no uniform clock",
            format!(
                "excitation, delay and feedback are those of the log resampled every {} s{}",
                resampled.step,
                if resampled.interpolation == Interpolation::Linear { " by straight lines" } else { "" }
            ),
        ));
    }
    findings.extend(excitation(inspection));
    findings.extend(levels(inspection));
    if plan.output.is_none() && !plan.inputs.is_empty() {
        let advice = "name it with -y to learn of delay and feedback";
        findings.push(Finding::new(FindingKind::NoOutput, "there is no output (y)", advice));
    }
    if plan.inputs.is_empty() && plan.output.is_some() {
        let advice = "only a time series model can be fitted";
        findings.push(Finding::new(FindingKind::NoInput, "there is no input", advice));
    }
    findings.extend(effects(inspection));
    findings
}

/// What the inputs excite.
fn excitation(inspection: &Inspection) -> Vec<Finding> {
    let mut findings = Vec::new();
    for excitation in &inspection.excitation {
        let name = &excitation.input;
        let changes = inspection.changes(name);
        let mut say = |kind, seen: String, advice: &str| {
            findings.push(Finding::new(kind, format!("input '{name}' {seen}"), advice).of(name));
        };
        if excitation.highest == 0 {
            let seen = "has too few rows in a segment to tell what it excites".to_owned();
            say(FindingKind::FewRows, seen, "record more rows without a gap");
        } else if excitation.order == 0 {
            let advice = "leave it out, or record a log in which it changes";
            say(FindingKind::NoExcitation, "excites nothing".to_owned(), advice);
        } else if changes <= FEW_CHANGES {
            say(
                FindingKind::FewChanges,
                format!("changes {changes:.0} time{} only", plural(changes.round() as usize)),
                "what a step shows is seen once and not averaged, and whether the input follows the output cannot be told",
            );
        } else if excitation.order <= POOR.min(excitation.highest) && excitation.order < excitation.highest {
            say(
                FindingKind::LowExcitation,
                format!("excites order {} only", excitation.order),
                &format!(
                    "a model can have {0} parameter{1} from it at most",
                    excitation.order,
                    plural(excitation.order)
                ),
            );
        }
    }
    for (excitation, other) in inspection.excitation.iter().filter_map(|of| Some((of, of.same_as.as_ref()?)))
    {
        let seen =
            format!("inputs '{other}' and '{}' are the same but for scale and offset", excitation.input);
        let advice = "no fit can tell them apart; leave one out";
        findings.push(Finding::new(FindingKind::SameInputs, seen, advice).of(other).of(&excitation.input));
    }
    findings
}

/// What the output does by itself, and where a step test begins.
fn levels(inspection: &Inspection) -> Vec<Finding> {
    let mut findings = Vec::new();
    let outputs = inspection.channels.iter().filter(|channel| channel.role.as_deref() == Some("output"));
    for (channel, share) in outputs.filter_map(|channel| Some((channel, channel.trend_share?))) {
        // The answer to steps has one by itself.
        if share >= TREND && inspection.rest.is_none() {
            let percent = fixed(100.0 * share, 0);
            let seen = format!("channel '{}' has a trend that explains {percent} % of it", channel.name);
            let advice = "a fit that chooses the orders looks for noise that drifts; if it is a straight line and no answer to an \
                          input, fit with `detrend` linear";
            findings.push(Finding::new(FindingKind::Trend, seen, advice).of(&channel.name));
        }
    }
    if let Some(rest) = inspection.rest {
        let advice = format!(
            "its means are no level of the plant; in a fit that chooses the orders processes from rest compete; with orders of your own \
             take the offsets from there (`detrend` start:{rest}), and estimate the output's slope with the parameters if it drifts (`trend`)"
        );
        let seen = format!("the log is a step test that begins at rest for {rest} rows");
        let rows = Rows::from_positions(&(0..rest));
        findings.push(Finding::new(FindingKind::Rest, seen, advice).at(vec![rows]));
    }
    findings
}

/// How the output answers each input, and whether that follows the output.
fn effects(inspection: &Inspection) -> Vec<Finding> {
    let mut findings = Vec::new();
    let excites = |input: &str| inspection.excitation.iter().any(|of| of.input == input && of.order > 0);
    for delay in inspection.delays.iter().filter(|delay| delay.nk.is_none()) {
        // Of an input that excites nothing that was said.
        if inspection.changes(&delay.input) > FEW_CHANGES && excites(&delay.input) {
            let seen = format!("no effect of input '{}' is seen, and so no delay", delay.input);
            let advice = "it is small, slow or lost in noise, or there are too few rows to tell";
            findings.push(Finding::new(FindingKind::NoEffect, seen, advice).of(&delay.input));
        }
    }
    for feedback in inspection.feedback.iter().filter(|feedback| feedback.found) {
        let seen = format!("input '{}' follows past errors of the output", feedback.input);
        let advice = if feedback.certain {
            "that is feedback, and a fit that chooses the orders takes a model with noise (arx, armax, bj) by its errors one step \
             ahead, as oe and `method` iv or sriv are biased in a closed loop"
        } else {
            "feedback is suspected; fit a model with noise (arx, armax, bj), as oe and `method` iv or sriv are biased in a closed loop"
        };
        findings.push(Finding::new(FindingKind::Feedback, seen, advice).of(&feedback.input));
    }
    for delay in &inspection.delays {
        let unsure = delay.confidence.filter(|confidence| *confidence < UNSURE);
        if let Some((nk, confidence)) = delay.nk.zip(unsure) {
            let percent = fixed((100.0 * confidence).floor(), 0);
            let seen = format!("the delay of input '{}' is uncertain", delay.input);
            let advice = format!("{nk} has {percent} %; try others (`nk`), or excite it faster");
            findings.push(Finding::new(FindingKind::UncertainDelay, seen, advice).of(&delay.input));
        }
    }
    let suspected =
        |input: &str| inspection.feedback.iter().any(|feedback| feedback.found && feedback.input == input);
    for delay in inspection.delays.iter().filter(|delay| delay.nk == Some(0)) {
        let seen = format!("the output follows input '{}' within the same row", delay.input);
        let advice = format!(
            "it acts at once (a fit takes `nk` 0), its rows are shifted, or it is computed from the output{}",
            if suspected(&delay.input) { "; as feedback is suspected, `nk` 1 keeps that out" } else { "" }
        );
        findings.push(Finding::new(FindingKind::SameRow, seen, advice).of(&delay.input));
    }
    findings
}

/// These rows (1-based), one by one.
fn single(rows: &[usize]) -> Vec<Rows> {
    rows.iter().filter(|row| **row > 0).map(|row| Rows::from_positions(&(row - 1..*row))).collect()
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}
