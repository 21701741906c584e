use thetahat_numerics::noise::Noise;

use super::*;
use crate::Document;
use crate::data::Channel;
use crate::estimate::Procedure;
use crate::model::Model;
use crate::report::{Requirement, ValidationPlan, validate};
use crate::respond::Horizon;
use crate::tests::{assert_refused, channel};

/// x(t+1) = F x + G u + K e, y = H x + e with two outputs that rest at 10 and -3, and the log's rows.
fn log(rows: usize, noise: f64) -> Log {
    let mut random = Noise(7);
    let mut x = [0.0, 0.0];
    let mut all: [Vec<f64>; 4] = Default::default();
    for _ in 0..rows {
        let u = [random.uniform(), random.uniform()];
        let e = [noise * random.uniform(), 0.5 * noise * random.uniform()];
        let y = [x[0] + e[0], 0.5 * x[0] + x[1] + e[1]];
        x = [
            0.7 * x[0] + 0.2 * x[1] + u[0] + 0.3 * e[0],
            -0.2 * x[0] + 0.6 * x[1] + 0.5 * u[0] - u[1] + 0.2 * e[1],
        ];
        for (values, value) in all.iter_mut().zip([u[0], u[1], 10.0 + y[0], -3.0 + y[1]]) {
            values.push(value);
        }
    }
    let names = ["u1", "u2", "y1", "y2"];
    let channels = names.into_iter().zip(all).map(|(name, values)| Channel { name: name.to_owned(), values });
    Log::new(channels.collect(), 0.5).unwrap()
}

fn plan() -> StateSpacePlan {
    StateSpacePlan::new(&["u1", "u2"], &["y1", "y2"])
}

fn model(report: &Report) -> &StateSpaceModel {
    let Model::StateSpace(model) = &report.model else { panic!("{:?}", report.model) };
    model
}

#[test]
fn the_model_that_made_a_log_is_found() {
    let report = fit_state_space(&log(2000, 0.3), &[], &plan()).unwrap();
    let found = model(&report);
    assert_eq!((found.order(), found.stable, found.free_parameters), (2, true, 12));
    // The eigenvalues of F are 0.65 +- 0.1937 i.
    assert!((found.poles[0].re - 0.65).abs() < 0.02 && (found.poles[0].im - 0.1937).abs() < 0.02);
    let exact = |output: usize, input: usize| {
        // H (I - F)^-1 G.
        let determinant = 0.3 * 0.4 + 0.2 * 0.2;
        let g = [[1.0, 0.0], [0.5, -1.0]];
        let x = [
            (0.4 * g[0][input] + 0.2 * g[1][input]) / determinant,
            (-0.2 * g[0][input] + 0.3 * g[1][input]) / determinant,
        ];
        [x[0], 0.5 * x[0] + x[1]][output]
    };
    for output in 0..2 {
        for input in 0..2 {
            let gain = found.dc_gain[output][input].unwrap().value;
            assert!((gain - exact(output, input)).abs() < 0.05, "{output} {input}: {gain}");
        }
    }
    assert!((found.outputs[0].offset.level - 10.0).abs() < 0.3);
    // Uniform errors of these bounds; one step ahead the same figures in a validation.
    for (output, bound) in [(0, 0.3_f64), (1, 0.15)] {
        let ratio = found.noise_covariance[output][output] / (bound * bound / 3.0);
        assert!((0.9..1.1).contains(&ratio), "{ratio}");
    }
    let stored = Report::from_json(&report.to_json().unwrap()).unwrap();
    assert_eq!(stored, report);
    let validated =
        validate(&stored, None, &log(2000, 0.3), &[], &ValidationPlan::default()).unwrap().validation;
    let figure = |fits: &[crate::validate::Fit], output: &str, horizon| {
        fits.iter().find(|fit| fit.output == output && fit.horizon == horizon).unwrap().percent.unwrap()
    };
    for output in ["y1", "y2"] {
        for horizon in [Horizon::Steps { steps: 1 }, Horizon::FreeRun] {
            let [fitted, again] = [&report.fit, &validated.fit].map(|fits| figure(fits, output, horizon));
            assert_eq!(fitted.to_bits(), again.to_bits());
        }
    }
    let met = |text: &str| text.parse::<Requirement>().unwrap().unmet(&validated, 0.01);
    for text in ["stable", "white", "independent", "fit[y1]>=60", "fit[y2]@1>=60", "coverage[y2]>=90"] {
        assert_eq!(met(text), None, "{text}");
    }
    assert!(met("fit[y2]>=99.9").unwrap().starts_with("fit[y2]>=99.9: the fit is "));
    assert_refused("fit[y3]>=1".parse::<Requirement>().unwrap().check(&report), "no output 'y3'");
}

#[test]
fn noise_free_logs_give_the_plant_itself() {
    let report = fit_state_space(&log(400, 0.0), &[], &plan()).unwrap();
    assert_eq!(model(&report).order(), 2);
    assert!(report.fit.iter().all(|fit| fit.percent.unwrap() > 99.9999), "{:?}", report.fit);
}

#[test]
fn a_series_has_no_inputs() {
    let plan = StateSpacePlan::new(&[], &["y1", "y2"]);
    let report = fit_state_space(&log(1500, 0.3), &[], &plan).unwrap();
    assert!(report.fit.iter().all(|fit| fit.horizon == Horizon::Steps { steps: 1 }));
    assert!(model(&report).dc_gain.iter().all(Vec::is_empty));
    assert!(report.fit[0].percent.unwrap() > 10.0);
}

/// In short segments the states that errors start from take much of the errors with them.
#[test]
fn errors_of_many_short_segments_are_as_large_as_those_of_one() -> Result<(), Error> {
    let whole = log(6000, 0.3);
    let mut channels = Vec::new();
    for name in ["u1", "u2", "y1", "y2"] {
        channels.push(whole.channel(name)?.clone());
    }
    channels[3].values.iter_mut().skip(10).step_by(11).for_each(|value| *value = f64::NAN);
    let report =
        fit_state_space(&Log::new(channels, 0.5)?, &[], &StateSpacePlan { orders: Some(2..=2), ..plan() })?;
    let found = model(&report);
    let (samples, segments) = (report.estimation.samples, 546);
    assert_eq!(samples, 6000 - 545);
    assert_eq!(found.degrees_of_freedom, Some(samples - (found.free_parameters + 2 * segments) / 2));
    for (output, bound) in [(0, 0.3_f64), (1, 0.15)] {
        let ratio = found.noise_covariance[output][output] / (bound * bound / 3.0);
        assert!((0.9..1.1).contains(&ratio), "{ratio}");
    }
    Ok(())
}

#[test]
fn delays_are_those_of_the_plan() {
    let log = log(1500, 0.1);
    let mut channels: Vec<Channel> =
        ["u1", "u2", "y1", "y2"].map(|name| log.channel(name).unwrap().clone()).to_vec();
    // The first input acts four samples later than it is written.
    channels[0].values.rotate_left(4);
    let late = Log::new(channels, 0.5).unwrap();
    let rows = vec!["1..1490".parse().unwrap()];
    let delayed = StateSpacePlan { delays: vec![4, 0], estimate: rows, ..plan() };
    let report = fit_state_space(&late, &[], &delayed).unwrap();
    assert_eq!((model(&report).order(), model(&report).f.len()), (2, 6));
    let step = report.model.linear("a step").unwrap()[0].step_response(0, Some(8)).unwrap();
    assert!(step.values[..5].iter().all(|value| value.value.abs() < 1e-12));
    assert!((step.values[5].value - 1.0).abs() < 0.05);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let log = log(300, 0.3);
    type Damage = fn(&mut StateSpacePlan);
    let cases: [(Damage, &str); 12] = [
        (|plan| plan.outputs.clear(), "there is none"),
        (|plan| plan.outputs.push("u1".to_owned()), "'u1' is there twice"),
        (|plan| plan.outputs.push("y9".to_owned()), "y9"),
        (|plan| plan.orders = Some(0..=3), "order"),
        (|plan| plan.orders = Some(500..=600), "the data tell of orders up to"),
        (|plan| plan.subspace.past = Some(0), "past"),
        (|plan| plan.subspace.past = Some(200), "more samples than signals"),
        (|plan| plan.delays = vec![1], "one for each"),
        (|plan| plan.delays = vec![1000, 0], "more rows"),
        (|plan| plan.offsets = vec![("x".to_owned(), 1.0)], "'x' is no input"),
        (|plan| plan.estimate = vec!["1..6".parse().unwrap()], "more rows"),
        (
            |plan| {
                plan.inputs.clear();
                plan.subspace.feedthrough = Some(true);
            },
            "feedthrough",
        ),
    ];
    for (change, words) in cases {
        let mut plan = plan();
        change(&mut plan);
        assert_refused(fit_state_space(&log, &[], &plan), words);
    }
    let constant = |name: &str| {
        let mut channels: Vec<Channel> =
            ["u1", "u2", "y1", "y2"].map(|name| log.channel(name).unwrap().clone()).to_vec();
        let own = channels.iter_mut().find(|channel| channel.name == name).unwrap();
        own.values.fill(4.0);
        let log = Log::new(channels, 0.5).unwrap();
        fit_state_space(&log, &[], &plan()).unwrap_err().to_string()
    };
    assert!(constant("u2").contains("'u2' is constant") && constant("y1").contains("'y1' is constant"));
}

#[test]
fn a_log_that_starts_at_rest_tells_where_outputs_stay() {
    // A step response: the mean is far from where the output stays without an input.
    let mut random = Noise(5);
    let mut x = [0.0, 0.0];
    let (mut u, mut y1, mut y2) = (Vec::new(), Vec::new(), Vec::new());
    for row in 0..600 {
        let input = if row < 60 { 0.0 } else { 1.0 + 0.2 * f64::from(row / 40 % 3) };
        u.push(input);
        y1.push(20.0 + x[0] + 0.02 * random.uniform());
        y2.push(-5.0 + x[0] + x[1] + 0.02 * random.uniform());
        x = [0.9 * x[0] + 0.1 * input, 0.8 * x[1] + 0.2 * x[0]];
    }
    let log = Log::new(vec![channel("u", u), channel("y1", y1), channel("y2", y2)], 1.0).unwrap();
    let plan = StateSpacePlan::new(&["u"], &["y1", "y2"]);
    let report = fit_state_space(&log, &[], &plan).unwrap();
    let found = model(&report);
    let Procedure::Subspace(outcome) = &report.estimation.procedure else {
        panic!("{:?}", report.estimation)
    };
    assert!(outcome.constant && found.order() == 2, "{outcome:?}");
    // Where it would stay at the input's offset.
    for (output, level, gain) in [(0, 20.0, 1.0), (1, -5.0, 2.0)] {
        let expected = level + gain * found.inputs[0].offset.level;
        assert!((found.outputs[output].offset.level - expected).abs() < 0.02, "{output}");
        assert!((found.dc_gain[output][0].unwrap().value - gain).abs() < 0.02);
    }
    assert!((found.poles[0].re - 0.9).abs() < 0.01 && (found.poles[1].re - 0.8).abs() < 0.03);
    // Without, a state stands for the level.
    let without =
        fit_state_space(&log, &[], &StateSpacePlan { constant: Constant::No, ..plan.clone() }).unwrap();
    assert!(model(&without).order() > 2);
    // What integrates has no level.
    let mut sum = 0.0;
    let (mut u, mut y) = (Vec::new(), Vec::new());
    for _ in 0..500 {
        u.push(random.uniform());
        y.push(sum + 0.01 * random.uniform());
        sum += u[u.len() - 1];
    }
    let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0).unwrap();
    let integrator = fit_state_space(&log, &[], &StateSpacePlan::new(&["u"], &["y"])).unwrap();
    assert!((model(&integrator).poles[0].re - 1.0).abs() < 0.01);
}
