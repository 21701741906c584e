use thetahat_numerics::noise::Noise;

use crate::data::{Log, Rows};
use crate::model::{Hold, Model, Orders, TimeBase};
use crate::report::{Plan, Report, StateSpacePlan, ValidationPlan, fit_state_space, identify, validate};
use crate::respond::{Horizon, InitialCondition};
use crate::tests::channel;
use crate::{Document, Error};

/// A plant with poles at 0.95 and 0.8 whose input changes every fifth sample, with noise of its state and its sensor,
/// every `step`-th row.
fn log(step: usize) -> Result<Log, Error> {
    let mut noise = Noise(4);
    let (mut u, mut y, mut x, mut held) = (Vec::new(), Vec::new(), [0.0, 0.0], 0.0);
    for t in 0..10_000 {
        if t % 5 == 0 {
            held = noise.uniform();
        }
        u.push(held);
        y.push(3.0 + x[0] + 0.3 * noise.uniform());
        x = [0.95 * x[0] + x[1] + 0.1 * noise.uniform(), 0.8 * x[1] + 0.2 * held];
    }
    let channel =
        |name: &str, values: &[f64]| channel(name, values.iter().copied().step_by(step).collect::<Vec<_>>());
    Log::new(vec![channel("u", &u), channel("y", &y)], 0.01 * step as f64)
}

fn fitted(log: &Log) -> Result<Report, Error> {
    let plan = StateSpacePlan { orders: Some(2..=2), ..StateSpacePlan::new(&["u"], &["y"]) };
    fit_state_space(log, &[], &plan)
}

#[test]
fn a_model_of_one_clock_holds_at_another() -> Result<(), Error> {
    let slow = log(5)?;
    let (own, fast) = (fitted(&slow)?, fitted(&log(1)?)?);
    let continuous = fast.converted(TimeBase::Continuous, None)?;
    let continuous = Report::from_json(&continuous.to_json()?)?;
    let converted = fast.converted(TimeBase::Sampled(0.05), None)?;
    let validated = |report: &Report| validate(report, None, &slow, &[], &ValidationPlan::default());
    let known = validated(&own)?.validation;
    for report in [&continuous, &converted] {
        let found = validated(report)?.validation;
        for (one, other) in found.fit.iter().zip(&known.fit) {
            assert!(
                (one.percent.unwrap_or(0.0) - other.percent.unwrap_or(100.0)).abs() < 0.5,
                "{one:?} {other:?}"
            );
        }
        // The intervals are as right: the noise is that of single measurements.
        assert!(!found.coverage.is_empty());
        for (one, other) in found.coverage.iter().zip(&known.coverage) {
            let apart = one.actual.zip(other.actual).map_or(1.0, |(one, other)| (one - other).abs());
            assert!(apart < 0.02, "{one:?} {other:?}");
        }
        assert_eq!(found.stable, Some(true));
    }
    // As the log is sampled, so is the model.
    let steps = Horizon::Steps { steps: 3 };
    let rows: [Rows; 0] = [];
    let one = continuous.apply(&slow, &rows, None, steps, InitialCondition::Estimate)?;
    let other = converted.apply(&slow, &rows, None, steps, InitialCondition::Estimate)?;
    let differences = one.outputs[0].predicted.iter().zip(&other.outputs[0].predicted);
    assert!(differences.filter(|(one, _)| one.is_finite()).all(|(one, other)| (one - other).abs() < 1e-8));
    assert!(fast.apply(&slow, &rows, None, steps, InitialCondition::Estimate).is_err());
    // What cannot be sampled so is the log's fault, not an option's.
    let mut late = continuous.clone();
    if let Model::ContinuousStateSpace(model) = &mut late.model {
        model.delays = vec![0.06];
    }
    assert!(late.apply(&slow, &rows, None, steps, InitialCondition::Estimate).is_ok());
    if let Model::ContinuousStateSpace(model) = &mut late.model {
        model.delays = vec![1e3];
    }
    let error = late.apply(&slow, &rows, None, steps, InitialCondition::Estimate);
    assert!(
        matches!(error, Err(Error::Data { message, .. }) if message.contains("is more than 1000 samples"))
    );
    Ok(())
}

#[test]
fn a_converted_report_says_what_became_of_it() -> Result<(), Error> {
    let report = identify(log(1)?, &[], &Plan::new(&["u"], "y", Orders::arx(2, &[2], &[1])?))?;
    let there = report.converted(TimeBase::Continuous, Some(Hold::First))?;
    assert!(there.warnings[0].starts_with(
        "the model was converted from a sample time of 0.01 s to continuous time with foh: it has no figures of a fit"
    ));
    assert_eq!((there.fit.len(), there.model.parameters().len(), there.model.free_parameters()), (0, 0, 4));
    // Back with the hold that it was made with.
    let back = there.converted(TimeBase::Sampled(0.01), None)?;
    assert!(back.warnings[0].contains("from continuous time to a sample time of 0.01 s with foh"));
    let one = report.model.linear("a response")?[0].frequency_response(&[1.0, 100.0])?;
    let other = back.model.linear("a response")?[0].frequency_response(&[1.0, 100.0])?;
    for (one, other) in one[0].points.iter().zip(&other[0].points) {
        assert!((one.re - other.re).hypot(one.im - other.im) < 1e-10);
    }
    assert!(matches!(there.reduced(1), Err(Error::Argument { argument, .. }) if argument == "model"));
    assert!(matches!(&there.model, Model::ContinuousStateSpace(model) if model.hold == Hold::First));
    let mut damaged = there.to_json()?;
    damaged = damaged.replacen("\"delays\": [\n      0.0\n", "\"delays\": [\n      -1.0\n", 1);
    assert!(Report::from_json(&damaged).is_err_and(|error| error.to_string().contains("delays are not one")));
    Ok(())
}

/// The errors of what does not depend on how time goes stay; those of poles change as poles do.
#[test]
fn errors_go_through_conversions() -> Result<(), Error> {
    let none = || Error::data("no error is known");
    let polynomial = identify(log(1)?, &[], &Plan::new(&["u"], "y", Orders::oe(&[1], &[2], &[2])?))?;
    let plan = StateSpacePlan {
        orders: Some(2..=2),
        refine: Some(crate::estimate::Refine::Prediction),
        delays: vec![1],
        ..StateSpacePlan::new(&["u"], &["y"])
    };
    let refined = fit_state_space(&log(1)?, &[], &plan)?;
    for report in [&polynomial, &refined] {
        let (poles, gain) = match &report.model {
            Model::Polynomial(model) => (model.poles.clone(), model.dc_gain[0]),
            Model::StateSpace(model) => (model.poles.clone(), model.dc_gain[0][0]),
            _ => return Err(none()),
        };
        let continuous = report.converted(TimeBase::Continuous, None)?;
        assert!(continuous.warnings[0].ends_with("figures of a fit"), "{:?}", continuous.warnings);
        let continuous = Report::from_json(&continuous.to_json()?)?;
        let Model::ContinuousStateSpace(model) = &continuous.model else { return Err(none()) };
        let error =
            |gain: Option<crate::model::Quantity>| gain.and_then(|gain| gain.standard_error).ok_or_else(none);
        let apart = error(model.dc_gain[0][0])? / error(gain)? - 1.0;
        assert!(apart.abs() < 1e-5, "{apart}");
        // s = ln z/T.
        for pole in poles.iter().filter(|pole| pole.re > 0.5) {
            let own = model.poles.iter().min_by(|a, b| {
                let far = |root: &crate::model::Root| (root.re - pole.re.ln() / 0.01).abs();
                far(a).total_cmp(&far(b))
            });
            let variance =
                |root: &crate::model::Root| root.covariance.map(|rows| rows[0][0]).ok_or_else(none);
            let slope = 1.0 / (pole.re * 0.01);
            let apart = variance(own.ok_or_else(none)?)?.sqrt() / (variance(pole)?.sqrt() * slope) - 1.0;
            assert!(apart.abs() < 1e-4, "{apart}");
        }
        let back = continuous.converted(TimeBase::Sampled(0.01), None)?;
        let (own, known) = (report.model.linear("a response")?, back.model.linear("a response")?);
        let (own_steps, steps) = (own[0].step_response(0, Some(60))?, known[0].step_response(0, Some(60))?);
        for (one, other) in own_steps.values.iter().zip(&steps.values).skip(6) {
            let apart = error(Some(*other))? / error(Some(*one))? - 1.0;
            assert!(apart.abs() < 1e-4, "{one:?} {other:?}");
        }
        let frequencies = [1.0, 20.0, 200.0];
        let (own, known) =
            (own[0].frequency_response(&frequencies)?, known[0].frequency_response(&frequencies)?);
        for (one, other) in own[0].points.iter().zip(&known[0].points) {
            let (one, other) = (one.covariance.ok_or_else(none)?, other.covariance.ok_or_else(none)?);
            assert!((one[0][0] - other[0][0]).abs() < 1e-4 * one[0][0], "{one:?} {other:?}");
        }
        let seen = continuous.model.linear("a response")?[0].frequency_response(&frequencies)?;
        assert!(seen[0].points.iter().all(|point| point.magnitude.standard_error > Some(0.0)));
        // At the same sample time nothing changes.
        let same = report.converted(TimeBase::Sampled(0.01), None)?;
        let Model::StateSpace(model) = &same.model else { return Err(none()) };
        assert!((error(model.dc_gain[0][0])? / error(gain)? - 1.0).abs() < 1e-5);
    }
    Ok(())
}
