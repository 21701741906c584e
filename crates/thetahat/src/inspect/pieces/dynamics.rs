//! Excitation, delay and feedback, in one pass.

use std::ops::Range;

use rayon::prelude::*;
use thetahat_numerics::regression::LaggedMoments;

use super::input::{InputTotals, Twins};
use super::part::Part;
use crate::Error;
use crate::data::{Channel, Finding, GAP, Log, Record, Rows};
use crate::inspect::{
    DelayEstimate, Feedback, Inspection, InspectionPlan, delay, findings, moments, spectrum,
};
use crate::select::delays_of;
use crate::validate::feedback::feedback;

/// The longest lag of all signals together: as far as delays are looked for.
const LONGEST: usize = 112;
/// At most this many signals: the matrix of their lags has to fit.
pub(super) const MOST_SIGNALS: usize = 8;
/// Feedback is looked for in this many of the first rows.
pub(super) const FIRST: usize = 100_000;

/// The sums of inputs and output so far.
pub(super) struct Dynamics {
    sample_time: f64,
    /// Powers of two by which the signals are near one or below: the inputs, then the output.
    scales: Vec<f64>,
    /// The last rows, and their times.
    tail: Vec<Channel>,
    tail_time: Vec<f64>,
    inputs: Vec<InputTotals>,
    twins: Vec<Twins>,
    joint: Option<LaggedMoments>,
    first: Log,
}

impl Dynamics {
    /// Of the first part: inputs, then the output if there is one, with the times and the median step.
    ///
    /// # Errors
    /// As for [`Log::new`].
    pub(super) fn new(
        channels: Vec<Channel>,
        time: &[f64],
        sample_time: f64,
        plan: &InspectionPlan,
    ) -> Result<Self, Error> {
        let there = |channel: &Channel| {
            moments::scale(channel.values.iter().copied().filter(|value| !value.is_nan()))
        };
        let scales: Vec<f64> = channels.iter().map(there).collect();
        let log = on_clock(channels, time, sample_time)?;
        let part = Part { log: &log, past: 0 };
        let inputs = (0..plan.inputs.len()).map(|input| InputTotals::new(&part, input, scales[input]));
        let signals = signals(&log);
        let joint =
            (plan.output.is_some() && !plan.inputs.is_empty() && signals.len() <= MOST_SIGNALS).then(|| {
                let segments = part.segments(&signals);
                let total = moments::samples(&segments);
                let full = |longest: usize| -> usize {
                    segments.iter().map(|segment| segment.len().saturating_sub(longest)).sum()
                };
                let longest = (1..=LONGEST).rev().find(|&longest| 2 * full(longest) >= total && total > 0);
                LaggedMoments::new(&signals, &[], longest.unwrap_or(LONGEST))
            });
        let mut dynamics = Self {
            sample_time,
            inputs: inputs.collect(),
            twins: Twins::all(plan.inputs.len()),
            joint,
            first: log.part(&names(&log), Rows::new(1, log.rows().min(FIRST))?)?,
            tail: Vec::new(),
            tail_time: Vec::new(),
            scales,
        };
        dynamics.sum(&part);
        dynamics.keep(log, time);
        Ok(dynamics)
    }

    /// Adds the next rows.
    ///
    /// # Errors
    /// As for [`Log::new`].
    pub(super) fn add(&mut self, channels: &[&Channel], time: &[f64]) -> Result<(), Error> {
        let past = self.tail.first().map_or(0, |channel| channel.values.len());
        let joined = self.tail.iter().zip(channels).map(|(before, channel)| Channel {
            name: channel.name.clone(),
            values: [before.values.as_slice(), &channel.values].concat(),
        });
        let time = [self.tail_time.as_slice(), time].concat();
        let log = on_clock(joined.collect(), &time, self.sample_time)?;
        self.sum(&Part { log: &log, past });
        self.keep(log, &time);
        Ok(())
    }

    fn sum(&mut self, part: &Part<'_>) {
        let signals = signals(part.log);
        self.inputs.par_iter_mut().zip(&signals).for_each(|(input, values)| input.add(part, values));
        self.twins.retain_mut(|twins| twins.add(part, &signals));
        if let Some(joint) = &mut self.joint {
            let longest = joint.longest();
            let segments = part.own(&part.segments(&signals), longest);
            let scaled: Vec<Vec<f64>> = signals
                .iter()
                .zip(&self.scales)
                .map(|(values, scale)| values.iter().map(|value| scale * value).collect())
                .collect();
            let scaled: Vec<&[f64]> = scaled.iter().map(Vec::as_slice).collect();
            joint.merge(&LaggedMoments::new(&scaled, &segments, longest));
        }
    }

    /// Keeps the last rows: as many as a window of the spectrum and all lags reach back to.
    fn keep(&mut self, log: Log, time: &[f64]) {
        let last = |values: &[f64]| values[values.len().saturating_sub(spectrum::LONGEST)..].to_vec();
        let channels = log.channels().iter();
        self.tail = channels
            .map(|channel| Channel { name: channel.name.clone(), values: last(&channel.values) })
            .collect();
        self.tail_time = last(time);
    }

    /// Says what there is to say of all rows, of which the channels of the inspection tell already.
    ///
    /// # Errors
    /// As for [`Log::new`].
    pub(super) fn finish(mut self, inspection: &mut Inspection, plan: &InspectionPlan) -> Result<(), Error> {
        let sample_time = inspection.clock.sample_time;
        let moves = |name: &String| {
            let own = inspection.channels.iter().find(|channel| channel.name == *name);
            let range = own.and_then(|channel| channel.minimum.zip(channel.maximum));
            range.is_some_and(|(low, high)| moments::moves(low, high))
        };
        let moving: Vec<bool> = plan.inputs.iter().map(moves).collect();
        let excitation = plan.inputs.iter().zip(&mut self.inputs).zip(&moving);
        inspection.excitation =
            excitation.map(|((name, input), moves)| input.excitation(name, *moves, sample_time)).collect();
        for twins in self.twins.iter().rev().filter(|twins| twins.are_the_same()) {
            inspection.excitation[twins.later].same_as = Some(plan.inputs[twins.earlier].clone());
        }
        let Some(output) = &plan.output else { return Ok(()) };
        if plan.inputs.is_empty() {
            return Ok(());
        }
        let stepped = moving.iter().zip(&self.inputs).filter(|(moves, _)| **moves);
        if stepped.clone().count() > 0 && stepped.clone().all(|(_, input)| input.steps()) {
            inspection.findings.push(Finding::left_out(
                "whether the log is a step test that begins at rest is left out, as that needs all of it at once",
            ));
        }
        let driven: Vec<usize> = (0..plan.inputs.len())
            .filter(|&input| moving[input] && inspection.excitation[input].same_as.is_none())
            .collect();
        let answers = moves(output);
        let first = self.first_deviations(plan, &driven);
        let follows = Self::loops(inspection, plan, &first);
        self.delays(inspection, plan, (&driven, &follows), answers)?;
        self.responses(inspection, &driven, &first);
        inspection.doubt_steps();
        inspection.share_delays();
        Ok(())
    }

    /// The delays, by the moments of all rows.
    fn delays(
        &self,
        inspection: &mut Inspection,
        plan: &InspectionPlan,
        (driven, follows): (&[usize], &[bool]),
        answers: bool,
    ) -> Result<(), Error> {
        let Some(joint) = &self.joint else {
            inspection.delays = plan.inputs.iter().map(|name| DelayEstimate::unknown(name)).collect();
            inspection.findings.push(Finding::left_out(format!(
                "delays are left out, as there are more than {} inputs: name some (-u)",
                MOST_SIGNALS - 1
            )));
            return Ok(());
        };
        let output = plan.inputs.len();
        let correlation = |(input, name): (usize, &String)| {
            if answers && driven.contains(&input) && joint.is_finite() {
                delay::correlation_of(name, joint, input, output)
            } else {
                DelayEstimate::unknown(name)
            }
        };
        inspection.delays = plan.inputs.iter().enumerate().map(correlation).collect();
        if !answers || driven.is_empty() {
            return Ok(());
        }
        let names: Vec<String> = driven.iter().map(|&input| plan.inputs[input].clone()).collect();
        let signals: Vec<usize> = std::iter::once(output).chain(driven.iter().copied()).collect();
        let follows: Vec<bool> = driven.iter().map(|&input| follows[input]).collect();
        match delays_of(joint, &signals, &names, &follows) {
            Ok(found) => {
                for (&input, delay) in driven.iter().zip(found) {
                    inspection.delays[input].confidence = delay.confidence;
                    inspection.delays[input].nk = delay.confidence.map(|_| delay.nk);
                }
            }
            Err(why) => inspection.findings.push(Finding::left_out(format!("delays are left out: {why}"))),
        }
        Ok(())
    }

    /// The deviations of the first rows, zero of what does not drive, and their segments.
    fn first_deviations(
        &self,
        plan: &InspectionPlan,
        driven: &[usize],
    ) -> (Vec<Vec<f64>>, Vec<Range<usize>>) {
        let values = signals(&self.first);
        let segments = Part { log: &self.first, past: 0 }.segments(&values);
        let of = |(signal, values): (usize, &&[f64])| {
            let drives = signal >= plan.inputs.len() || driven.contains(&signal);
            if drives { moments::deviations(values, &segments) } else { vec![0.0; values.len()] }
        };
        (values.iter().enumerate().map(of).collect(), segments)
    }

    /// Feedback, by the first rows; gives which inputs follow the output beyond doubt.
    fn loops(
        inspection: &mut Inspection,
        plan: &InspectionPlan,
        (deviations, segments): &(Vec<Vec<f64>>, Vec<Range<usize>>),
    ) -> Vec<bool> {
        let Some((output, inputs)) = deviations.split_last() else { return Vec::new() };
        let found = feedback(inputs, output, segments);
        let unstable =
            found.unstable().map(|seen| findings::of_unstable(format!("{seen}, in the first rows")));
        inspection.findings.extend(unstable);
        let certain = found.certain();
        inspection.feedback =
            plan.inputs.iter().zip(found.inputs).map(|(name, found)| Feedback::new(name, found)).collect();
        certain
    }

    /// Impulse responses, by the first rows.
    fn responses(
        &self,
        inspection: &mut Inspection,
        driven: &[usize],
        (deviations, segments): &(Vec<Vec<f64>>, Vec<Range<usize>>),
    ) {
        let Some((output, inputs)) = deviations.split_last() else { return };
        inspection.findings.push(Finding::left_out(format!(
            "impulse responses and feedback are those of the first {} rows",
            self.first.rows()
        )));
        let record = Record {
            output,
            inputs: driven.iter().map(|&input| inputs[input].as_slice()).collect(),
            past: vec![0; segments.len()],
            segments: segments.clone(),
        };
        if !segments.is_empty() {
            delay::respond(&mut inspection.delays, driven, &record);
        }
        let values = signals(&self.first);
        let unit = |signal: usize| moments::unit(values[signal], &deviations[signal], segments);
        let of_output = unit(inputs.len());
        for (input, delay) in inspection.delays.iter_mut().enumerate() {
            delay.scale(of_output.zip(unit(input)).map_or(f64::NAN, |(output, input)| output / input));
        }
    }
}

fn signals(log: &Log) -> Vec<&[f64]> {
    log.channels().iter().map(|channel| channel.values.as_slice()).collect()
}

fn names(log: &Log) -> Vec<&str> {
    log.channels().iter().map(|channel| channel.name.as_str()).collect()
}

/// A log with a gap wherever a step is longer than 1.5 of the median; no times: no gaps.
fn on_clock(channels: Vec<Channel>, time: &[f64], sample_time: f64) -> Result<Log, Error> {
    let gap =
        |(position, pair): (usize, &[f64])| (pair[1] - pair[0] > GAP * sample_time).then_some(position + 1);
    let starts = time.windows(2).enumerate().filter_map(gap).collect();
    Log::restored(channels, sample_time, None, starts, Vec::new(), 0.0)
}
