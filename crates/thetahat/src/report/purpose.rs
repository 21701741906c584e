//! What a model is good for, in one sentence.

use std::f64::consts::PI;

use super::schema::Report;
use crate::data::FindingKind;
use crate::figures::{fixed, three};
use crate::model::{LinearModel, Quantity};
use crate::respond::{Horizon, logarithmic_frequencies};
use crate::select::HeldOut;
use crate::validate::Part;
use thetahat_numerics::distribution::two_sided;

/// What fits less predicts nothing; a free run that fits less is no simulation. In percent.
const PREDICTS: f64 = 10.0;
const SIMULATES: f64 = 50.0;
/// A response is known where its magnitude is within this part of it, with a probability of 95 %.
const KNOWN: f64 = 0.3;
/// The number of frequencies that are evaluated, and the ratio of the lowest to the highest.
const FREQUENCIES: usize = 61;
const BELOW: f64 = 1e-4;

impl Report {
    /// The report with what its model is good for, from its figures.
    pub(super) fn with_purpose(mut self) -> Self {
        self.purpose = purpose(&self);
        self
    }
}

fn purpose(report: &Report) -> String {
    let has = |kind| report.decisions.iter().any(|decision| decision.kind == kind);
    let (drifts, driven) = (has(FindingKind::Drift), report.model.is_driven());
    let (mut good, mut limits) = (Vec::new(), Vec::new());
    match figure(report, Horizon::Steps { steps: 1 }) {
        Some((percent, rows)) if percent >= PREDICTS => {
            good.push(format!("prediction one step ahead ({} % {rows})", fixed(percent, 1)));
        }
        Some((percent, rows)) => {
            limits.push(format!("its predictions one step ahead fit {} % {rows}", fixed(percent, 1)));
        }
        None => {}
    }
    let run = if drifts { held_out(report) } else { None };
    match run.or_else(|| figure(report, Horizon::FreeRun)).filter(|_| driven) {
        Some((percent, rows)) if percent >= SIMULATES => {
            let what = if drifts { "simulation of changes" } else { "simulation" };
            let range = match report.model.ends_with_its_range() {
                true => ", within the range of the rows that it was fitted to",
                false => "",
            };
            good.push(format!("{what} ({} % {rows}{range})", fixed(percent, 1)));
        }
        Some((percent, rows)) => limits.push(format!("its free run fits {} % {rows}", fixed(percent, 1))),
        None => {}
    }
    if drifts {
        limits.push("the level of the output drifts".to_owned());
    }
    if let Ok(linear) = report.model.linear("what it is good for") {
        if driven && let Some(band) = band(&linear) {
            match band {
                Some(band) => good.push(format!(
                    "control design {band}, where its response is known within {} %",
                    fixed(100.0 * KNOWN, 0)
                )),
                None => limits.push(format!(
                    "no frequency has a response that is known within {} %",
                    fixed(100.0 * KNOWN, 0)
                )),
            }
        }
        limits.extend(unknown_gains(&linear));
    }
    let good = match good.split_last() {
        None => {
            return limits
                .first()
                .map_or_else(String::new, |_| format!("Good for little: {}.", limits.join("; ")));
        }
        Some((last, [])) => last.clone(),
        Some((last, others)) => format!("{} and {last}", others.join(", ")),
    };
    let limits: String = limits.iter().map(|limit| format!("; {limit}")).collect();
    format!("Good for {good}{limits}.")
}

/// The least fit of all outputs, and of which rows: of held-out ones where there are any.
fn figure(report: &Report, horizon: Horizon) -> Option<(f64, &'static str)> {
    let of = |part: Part| {
        let fits = report.fit.iter().filter(|fit| fit.part == Some(part) && fit.horizon == horizon);
        let percents = fits.map(|fit| fit.percent).collect::<Option<Vec<f64>>>()?;
        percents.into_iter().min_by(f64::total_cmp)
    };
    let rows = [(Part::Test, "on test rows"), (Part::Validation, "on validation rows")];
    let held = rows.into_iter().find_map(|(part, rows)| Some((of(part)?, rows)));
    let on_blocks = || if horizon == Horizon::FreeRun { held_out(report) } else { None };
    held.or_else(on_blocks).or_else(|| Some((of(Part::Estimation)?, "on the rows of the fit")))
}

/// The fit of free runs on the blocks that were held out while the model was chosen.
fn held_out(report: &Report) -> Option<(f64, &'static str)> {
    let selection = report.selection.as_ref()?;
    let seen = if report.model.as_state_space().is_some() {
        selection.state_space.as_ref()?.held_out
    } else if report.model.as_polynomial().is_some() && selection.focus.horizon() == Horizon::FreeRun {
        selection.chosen.held_out
    } else {
        None
    };
    seen.as_ref().map(HeldOut::percent).map(|percent| (percent, "on held-out blocks"))
}

/// In which band of frequencies the responses from all inputs to all outputs are known; none where no errors of
/// parameters are.
#[expect(clippy::option_option, reason = "no errors, and no frequency that is known, are two things")]
fn band(linear: &[LinearModel<'_>]) -> Option<Option<String>> {
    let highest = PI / linear.first()?.sample_time();
    let frequencies = logarithmic_frequencies(BELOW * highest, highest, FREQUENCIES).ok()?;
    let mut known = [true; FREQUENCIES];
    for model in linear {
        let responses = model.frequency_response(&frequencies).ok()?;
        for response in responses.iter().filter(|response| response.input.is_some()) {
            for (known, point) in known.iter_mut().zip(&response.points) {
                // Without a standard error at a zero of the response it is not known there.
                point.covariance?;
                let Quantity { value, standard_error, .. } = point.magnitude;
                *known &= standard_error.is_some_and(|error| two_sided(0.05) * error <= KNOWN * value);
            }
        }
    }
    let runs = known.chunk_by(|one, other| one == other);
    let mut first = 0;
    let runs = runs.map(|run| {
        let range = first..first + run.len();
        first = range.end;
        (run[0], range)
    });
    let longest = runs.filter(|(known, _)| *known).map(|(_, range)| range).max_by_key(|range| range.len());
    Some(longest.map(|range| match (range.start, range.end) {
        (0, FREQUENCIES) => "at all frequencies".to_owned(),
        (0, end) => format!("up to {} rad/s", three(frequencies[end - 1])),
        (start, FREQUENCIES) => format!("from {} rad/s on", three(frequencies[start])),
        (start, end) => {
            format!("from {} to {} rad/s", three(frequencies[start]), three(frequencies[end - 1]))
        }
    }))
}

/// What there is to say of static gains that are not known to half of them.
fn unknown_gains(linear: &[LinearModel<'_>]) -> Option<String> {
    let mut names: Vec<&str> = Vec::new();
    for model in linear {
        for (input, signal) in model.inputs().iter().enumerate() {
            let is_unknown = |gain: Quantity| {
                gain.interval.is_some_and(|interval| match (interval.lower, interval.upper) {
                    (Some(lower), Some(upper)) => upper - lower > gain.value.abs(),
                    _ => true,
                })
            };
            if model.dc_gain(input).is_some_and(is_unknown) && !names.contains(&signal.name.as_str()) {
                names.push(&signal.name);
            }
        }
    }
    match *names {
        [] => None,
        [name] => Some(format!("the static gain of {name} is not known")),
        _ => Some(format!("the static gains of {} are not known", names.join(", "))),
    }
}

#[cfg(test)]
mod tests {
    use thetahat_numerics::noise::Noise;

    use super::*;
    use crate::data::Log;
    use crate::model::{Interval, Model, Orders};
    use crate::report::{Plan, identify};
    use crate::tests::channel;

    /// y(t) = 0.9 y(t-1) + b u(t-1) + e(t).
    fn report(b: f64, inputs: &[&str]) -> Report {
        let (mut u, mut y, mut noise) = (vec![], vec![0.0], Noise(1));
        for t in 0..600 {
            u.push(noise.uniform());
            y.push(0.9 * y[t] + b * u[t] + 0.1 * noise.uniform());
        }
        y.pop();
        let log = Log::new(vec![channel("u", u), channel("y", y)], 0.5).unwrap();
        let one = vec![1; inputs.len()];
        identify(log, &[], &Plan::new(inputs, "y", Orders::arx(1, &one, &one).unwrap())).unwrap()
    }

    #[test]
    fn a_good_model_simulates_and_is_known_at_all_frequencies() {
        let report = report(1.0, &["u"]);
        let [one, free] = [0, 1].map(|place| fixed(report.fit[place].percent.unwrap(), 1));
        let expected = format!(
            "Good for prediction one step ahead ({one} % on the rows of the fit), simulation ({free} % on the rows of the fit) and \
             control design at all frequencies, where its response is known within 30 %."
        );
        assert_eq!(report.purpose, expected);
    }

    #[test]
    fn what_is_not_known_is_said() {
        let weak = report(0.01, &["u"]);
        assert!(weak.purpose.contains("its free run fits"), "{}", weak.purpose);
        assert!(
            weak.purpose
                .contains("no frequency has a response that is known within 30 %; the static gain of u"),
            "{}",
            weak.purpose
        );
        let nothing = report(0.0, &["u"]).purpose;
        assert!(!nothing.contains("simulation") && nothing.contains("its free run fits"), "{nothing}");
        let mut nothing = report(0.01, &["u"]);
        nothing.fit.iter_mut().for_each(|fit| fit.percent = Some(0.2));
        let nothing = nothing.with_purpose().purpose;
        assert!(
            nothing.starts_with("Good for little: its predictions one step ahead fit 0.2 % on the rows of the fit; its free run fits 0.2 %"),
            "{nothing}"
        );
        let series = report(1.0, &[]);
        assert!(series.purpose.starts_with("Good for prediction one step ahead ("), "{}", series.purpose);
        assert!(!series.purpose.contains("simulation") && !series.purpose.contains("control"));
        let mut open = report(1.0, &["u"]);
        let Model::Polynomial(model) = &mut open.model else { panic!("an ARX model") };
        model.dc_gain[0].as_mut().unwrap().interval = Some(Interval::OPEN);
        assert!(open.with_purpose().purpose.ends_with("; the static gain of u is not known."));
    }

    #[test]
    fn without_figures_and_errors_nothing_is_said() {
        let mut report = report(1.0, &["u"]);
        report.fit.clear();
        let Model::Polynomial(model) = &mut report.model else { panic!("an ARX model") };
        model.covariance = None;
        assert_eq!(report.with_purpose().purpose, "");
    }
}
