use std::collections::{HashMap, HashSet};

use rayon::prelude::*;

use super::clock::Ticks;
use super::inspection::{ChannelQuality, Feedback, Inspection};
use super::plan::InspectionPlan;
use super::{channel, delay, excitation, findings, moments, rest};
use crate::data::{
    Channel, Finding, Interpolation, Log, Recording, Regular, Resample, Resampling, Rows, Source, Times,
    check,
};
use crate::document::GENERATOR;
use crate::validate::feedback::feedback;
use crate::{Document, Error};

/// Why there is nothing to say of the dynamics.
pub(super) const NO_ROLES: &str =
    "no column is an input or the output: name them (-u, -y) to learn of excitation, delay and feedback";
pub(super) const BACKWARD: &str =
    "excitation, delay and feedback are left out, as the time does not run forward";
pub(super) const IRREGULAR: &str = "excitation, delay and feedback are left out, as the log is not uniform";

/// Checks a log before a fit: its clock, the quality of each channel, how rich the inputs are, their
/// delays, and whether they follow the output.
///
/// Clock and quality are those of the rows as they are. Excitation, delay and feedback are of the log as a fit would
/// see it: resampled where its clock is irregular, and cut where a value is missing. What cannot be said is left out,
/// and the findings say why; [`Inspection::command`] is left to whoever knows the command line.
///
/// Cost: O(N log N) for each channel, about a second for 10^6 rows of three channels.
///
/// # Errors
/// [`Error::Data`] if there are no rows, channels differ in length, share a name or hold an infinity, if a channel of
/// the plan is not there, or the times are not finite or never advance; [`Error::Argument`] for a sample time or a step
/// that is not positive, or a channel with two roles.
///
/// ```
/// use thetahat::data::{Channel, Recording, Rows, Source, Times};
/// use thetahat::inspect::{InspectionPlan, inspect};
///
/// let u: Vec<f64> = (0..200).map(|t| f64::from(t * t * t % 1009)).collect();
/// let y = [vec![0.0; 3], u[..197].to_vec()].concat();
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let recording =
///     Recording { channels: vec![channel("u", u), channel("y", y)], times: Times::Uniform(0.1) };
/// let source =
///     Source { file: "log.csv".into(), rows: Rows::new(1, 200)?, time: None, start: None, resampled: None };
/// let plan = InspectionPlan { inputs: vec!["u".into()], output: Some("y".into()), resample: None };
/// let inspection = inspect(recording, &source, &plan)?;
/// assert_eq!(inspection.delays[0].nk, Some(3));
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn inspect(recording: Recording, source: &Source, plan: &InspectionPlan) -> Result<Inspection, Error> {
    let Recording { channels, times } = recording;
    let roles = roles(&channels, plan)?;
    let ticks = Ticks::new(&times, check(&channels)?)?;
    let mut inspection = of_the_rows(&channels, &times, &ticks, &roles, source, plan)?;
    match uniform(channels, times, &ticks, &roles, plan)? {
        Ok((log, resampled)) => {
            inspection.log.rows = Rows::new(1, log.rows())?;
            inspection.log.resampled = resampled;
            dynamics(&mut inspection, &log, plan)?;
        }
        Err(why) => inspection.findings.push(Finding::left_out(why)),
    }
    let of_the_dynamics = findings::of_the_dynamics(&inspection, plan);
    inspection.findings.extend(of_the_dynamics);
    Ok(inspection)
}

/// The same of a log, of one experiment or several: nothing reaches from one into the next, and gaps are those of their
/// own clocks.
///
/// # Errors
/// As for [`inspect`].
///
/// ```
/// use thetahat::data::{Channel, Log, Rows, Source};
/// use thetahat::inspect::{InspectionPlan, inspect_log};
///
/// let day = |times: Vec<f64>| {
///     let y = times.iter().map(|time| (7.0 * time).sin()).collect();
///     Log::with_time(vec![Channel { name: "y".into(), values: y }], times)
/// };
/// let log = Log::join(vec![day(vec![0.0, 1.0, 2.0, 9.0])?, day(vec![0.0, 1.0, 2.0, 3.0])?])?;
/// let source =
///     Source { file: "days".into(), rows: Rows::new(1, 8)?, time: None, start: None, resampled: None };
/// let plan = InspectionPlan { inputs: vec![], output: Some("y".into()), resample: None };
/// let inspection = inspect_log(&log, &source, &plan)?;
/// assert_eq!((inspection.experiments, inspection.clock.gaps), (2, 1));
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn inspect_log(log: &Log, source: &Source, plan: &InspectionPlan) -> Result<Inspection, Error> {
    let times = match log.time() {
        Some(time) if !log.is_joined() => Times::Measured(time.to_vec()),
        // Several experiments have no common clock.
        _ => Times::Uniform(log.sample_time()),
    };
    let ticks = match log.time() {
        Some(time) if log.is_joined() => {
            let ends = log.boundaries().iter().copied().chain([log.rows()]);
            let mut begin = 0;
            Ticks::joined(ends.map(|end| &time[std::mem::replace(&mut begin, end)..end]), log.sample_time())?
        }
        _ => Ticks::new(&times, log.rows())?,
    };
    let roles = roles(log.channels(), plan)?;
    let mut inspection = of_the_rows(log.channels(), &times, &ticks, &roles, source, plan)?;
    inspection.experiments = log.boundaries().len() + 1;
    dynamics(&mut inspection, log, plan)?;
    let of_the_dynamics = findings::of_the_dynamics(&inspection, plan);
    inspection.findings.extend(of_the_dynamics);
    Ok(inspection)
}

/// What there is to say of the rows as they are.
fn of_the_rows(
    channels: &[Channel],
    times: &Times,
    ticks: &Ticks,
    roles: &HashMap<&str, &'static str>,
    source: &Source,
    plan: &InspectionPlan,
) -> Result<Inspection, Error> {
    let rows = check(channels)?;
    let (mut quality, far): (Vec<ChannelQuality>, Vec<Vec<usize>>) = channels
        .par_iter()
        .map(|channel| channel::quality(channel, roles.get(channel.name.as_str()).copied(), times))
        .unzip();
    if far.iter().any(|rows| !rows.is_empty()) {
        let jumps: Vec<Vec<usize>> =
            channels.par_iter().map(|channel| channel::jumps(&channel.values)).collect();
        for (place, (own, far)) in
            quality.iter_mut().zip(&far).enumerate().filter(|(_, (_, far))| !far.is_empty())
        {
            let others = jumps.iter().enumerate().filter(|(other, _)| *other != place);
            let mut others: Vec<usize> = others.flat_map(|(_, rows)| rows.iter().copied()).collect();
            others.sort_unstable();
            channel::explain(own, far, &others, rows);
        }
    }
    described(quality, rows, ticks, source, plan)
}

/// The document of what there is to say of the rows as they are.
pub(super) fn described(
    channels: Vec<ChannelQuality>,
    rows: usize,
    ticks: &Ticks,
    source: &Source,
    plan: &InspectionPlan,
) -> Result<Inspection, Error> {
    let mut inspection = Inspection {
        schema: Inspection::SCHEMA.to_owned(),
        generator: GENERATOR.to_owned(),
        log: Source { rows: Rows::new(1, rows)?, resampled: None, ..source.clone() },
        rows,
        experiments: 1,
        clock: ticks.clock.clone(),
        channels,
        excitation: Vec::new(),
        delays: Vec::new(),
        feedback: Vec::new(),
        rest: None,
        command: None,
        findings: Vec::new(),
    };
    inspection.findings = findings::of_the_rows(&inspection, ticks, plan);
    Ok(inspection)
}

/// What each channel of the plan is in it. All are there, and have one role.
pub(super) fn roles<'a>(
    channels: &[Channel],
    plan: &'a InspectionPlan,
) -> Result<HashMap<&'a str, &'static str>, Error> {
    let there: HashSet<&str> = channels.iter().map(|channel| channel.name.as_str()).collect();
    let inputs = plan.inputs.iter().map(|input| (input.as_str(), "input"));
    let mut roles = HashMap::new();
    for (name, role) in inputs.chain(plan.output.as_deref().map(|output| (output, "output"))) {
        if !there.contains(name) {
            return Err(Error::in_channel(name, None, format!("there is no channel '{name}'")));
        }
        if roles.insert(name, role).is_some() {
            let message = format!("'{name}' is named twice; a channel has one role");
            return Err(Error::argument("inputs", message));
        }
    }
    Ok(roles)
}

/// The channels of the plan as a fit would see them, and how they were resampled; or why there is no such log.
fn uniform(
    mut channels: Vec<Channel>,
    times: Times,
    ticks: &Ticks,
    roles: &HashMap<&str, &'static str>,
    plan: &InspectionPlan,
) -> Result<Result<(Log, Option<Resampling>), String>, Error> {
    channels.retain(|channel| roles.contains_key(channel.name.as_str()));
    if channels.is_empty() {
        return Ok(Err(NO_ROLES.to_owned()));
    }
    let time = match times {
        Times::Uniform(step) => return Ok(Ok((Log::new(channels, step)?, None))),
        Times::Measured(time) => time,
    };
    if ticks.backward > 0 {
        return Ok(Err(BACKWARD.to_owned()));
    }
    let asked = plan.resample;
    if asked.is_none() && !ticks.clock.irregular {
        return Ok(Ok((Log::with_time(channels, time)?, None)));
    }
    let regular = Regular::of(&time, ticks.clock.sample_time);
    if asked.is_none() && ticks.rates.is_none() && !regular.is_worth() {
        return Ok(Err(IRREGULAR.to_owned()));
    }
    let how = asked.or(ticks.rates).unwrap_or_else(|| Resample::new(regular.step, Interpolation::Linear));
    let log = Log::resampled(channels, &time, &how)?;
    Ok(Ok((log, Some(Resampling::new(&how, &time)?))))
}

/// Excitation, delay and feedback of each input.
fn dynamics(inspection: &mut Inspection, log: &Log, plan: &InspectionPlan) -> Result<(), Error> {
    let all = [Rows::new(1, log.rows())?];
    let names: Vec<&str> = plan.inputs.iter().chain(&plan.output).map(String::as_str).collect();
    inspection.findings.extend(log.padding(&names)?.map(|padding| findings::of_padding(&padding)));
    let values = |name: &str| Ok(log.channel(name)?.values.as_slice());
    let inputs: Vec<&[f64]> = plan.inputs.iter().map(|name| values(name)).collect::<Result<_, Error>>()?;
    let of_input = |(name, input): (&String, &&[f64])| {
        excitation::excitation(name, input, &log.segments_of(&[input], &all), log.sample_time())
    };
    inspection.excitation = plan.inputs.par_iter().zip(&inputs).map(of_input).collect();
    for (later, earlier) in excitation::copies(&inputs, |signals| log.segments_of(signals, &all)) {
        inspection.excitation[later].same_as = Some(plan.inputs[earlier].clone());
    }
    let Some(output) = &plan.output else { return Ok(()) };
    let output = values(output)?;
    let of_input = |(name, input): (&String, &&[f64])| {
        let segments = log.segments_of(&[input, output], &all);
        let (input, output) = (moments::deviations(input, &segments), moments::deviations(output, &segments));
        delay::correlation(name, &input, &output, &segments)
    };
    inspection.delays = plan.inputs.par_iter().zip(&inputs).map(of_input).collect();
    let signals: Vec<&[f64]> = inputs.iter().copied().chain([output]).collect();
    let segments = log.segments_of(&signals, &all);
    inspection.rest = rest::rest(&inputs, output, &segments);
    let (raw, measured) = (inputs, output);
    let mut signals: Vec<Vec<f64>> =
        signals.iter().map(|values| moments::deviations(values, &segments)).collect();
    // One that repeats another would leave the model open.
    let excitations = inspection.excitation.iter();
    for (signal, _) in signals.iter_mut().zip(excitations).filter(|(_, of)| of.same_as.is_some()) {
        signal.fill(0.0);
    }
    if let Some((output, inputs)) = signals.split_last() {
        let found = feedback(inputs, output, &segments);
        delay::estimate(&mut inspection.delays, inputs, output, &segments, &found.certain())?;
        let unit = |values: &[f64], own: &[f64]| moments::unit(values, own, &segments);
        let of_output = unit(measured, output);
        for ((delay, values), own) in inspection.delays.iter_mut().zip(&raw).zip(inputs) {
            delay.scale(of_output.zip(unit(values, own)).map_or(f64::NAN, |(output, input)| output / input));
        }
        let unstable = found.unstable();
        let verdicts = plan.inputs.iter().zip(found.inputs);
        inspection.feedback = verdicts.map(|(input, found)| Feedback::new(input, found)).collect();
        inspection.findings.extend(unstable.map(findings::of_unstable));
    }
    inspection.doubt_steps();
    inspection.share_delays();
    Ok(())
}
