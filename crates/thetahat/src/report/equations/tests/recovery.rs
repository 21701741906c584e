//! What the fit finds in simulated logs. How often its intervals cover the truth is in tests/monte_carlo.

use thetahat_numerics::optimize::Stopped;

use super::models::{Found, TRUTH, fitted, joined, log, pendulum, pendulum_text};
use crate::data::Recording;
use crate::model::GreyBox;
use crate::respond::{Horizon, InitialCondition};

fn found(model: &GreyBox, log: Recording) -> Found {
    fitted(model, &[log]).unwrap()
}

fn assert_near(found: &Found, deviations: f64) {
    for (index, truth) in TRUTH.iter().enumerate().take(found.model.parameters.len()) {
        let (value, error) = found.parameter(index);
        let away = (value - truth) / error;
        assert!(
            away.abs() < deviations,
            "{} is {away} standard errors off",
            found.model.parameters[index].name
        );
    }
}

#[test]
fn a_fit_leads_to_the_truth() {
    let model = pendulum(2, 5);
    let report = found(&model, log(&model, &TRUTH, 400, 100, 1.0));
    assert_near(&report, 3.0);
    assert_eq!(report.outcome.search.stopped, Stopped::Converged);
    let likelihoods = &report.outcome.search.log_likelihoods;
    assert!(likelihoods.is_sorted_by(|before, after| before < after));
    assert!(likelihoods.len() < 20, "{}", likelihoods.len());
}

#[test]
fn holes_in_the_log_do_no_harm() {
    let model = pendulum(2, 3);
    let mut log = log(&model, &TRUTH[..3], 600, 7, 1.0);
    for (channel, period) in [(1, 3), (2, 5)] {
        log.channels[channel].values.iter_mut().step_by(period).for_each(|value| *value = f64::NAN);
    }
    let report = found(&model, log);
    assert_eq!(report.report.estimation.samples, 1200 - 200 - 120);
    let missing: Vec<usize> = report.report.data.missing.iter().map(|missing| missing.rows).collect();
    assert_eq!(missing, [0, 200, 120]);
    // Every 15th row has nothing.
    let nis = report.outcome.nis.unwrap();
    assert_eq!((nis.rows, nis.expected), (560, 880.0 / 560.0));
    assert_near(&report, 3.0);
}

#[test]
fn a_row_that_is_predicted_from_the_start_alone_does_not_count_ahead() {
    // Nothing is measured in the first two rows: the third one is predicted from the start too.
    let model = pendulum(2, 2);
    let mut log = log(&model, &TRUTH[..2], 400, 100, 1.0);
    for channel in log.channels.iter_mut().skip(1) {
        channel.values[..2].fill(f64::NAN);
    }
    let found = found(&model, log.clone());
    let one = found.fit("y1", Horizon::Steps { steps: 1 });
    assert_eq!((one.samples, found.fit("y1", Horizon::FreeRun).samples), (397, 398));
    let ahead = |steps| {
        let horizon = Horizon::Steps { steps };
        let log = joined(std::slice::from_ref(&log)).unwrap();
        let applied = found.report.apply(&log, &[], None, horizon, InitialCondition::Estimate).unwrap();
        applied.outputs[0].fit.as_ref().unwrap().samples
    };
    assert_eq!([ahead(1), ahead(2), ahead(5)], [397, 396, 393]);
}

#[test]
fn figures_say_whether_the_noises_are_right() {
    let model = pendulum(1, 2);
    // The log has the noises that the model tells, twice as much, and half as much. The parts of e^2/S below 0.00098
    // and above 5.02 are those of normal e of this size.
    for (noise, mean, below, above) in
        [(1.0, 1.0, 0.025, 0.025), (2.0, 4.0, 0.013, 0.26), (0.5, 0.25, 0.05, 0.0)]
    {
        let nis = found(&model, log(&model, &TRUTH[..2], 1500, 11, noise)).outcome.nis.unwrap();
        assert_eq!((nis.rows, nis.expected), (1500, 1.0));
        // The standard deviation of the mean of 1500 is 4 %.
        assert!((nis.mean / mean - 1.0).abs() < 0.15, "{noise} {}", nis.mean);
        // Standard deviations of the parts: at most 0.012.
        assert!((nis.below - below).abs() < 0.03, "{noise} {}", nis.below);
        assert!((nis.above - above).abs() < 0.05, "{noise} {}", nis.above);
    }
}

#[test]
fn free_runs_start_where_they_fit_best() {
    // No noise inside: the free run is as close as the noise of the measurement allows.
    let model = GreyBox::from_toml(&pendulum_text(0.0, 1, 3)).unwrap();
    let report = found(&model, log(&model, &TRUTH[..3], 500, 5, 1.0));
    let error = |horizon| report.fit("y1", horizon).rmse.unwrap();
    // Standard deviation 3 %.
    assert!((error(Horizon::FreeRun) / 0.02 - 1.0).abs() < 0.12, "{report:?}");
    assert!(error(Horizon::FreeRun) <= error(Horizon::Steps { steps: 1 }));
    let start = report.outcome.starts[0][0].unwrap();
    assert!((start - 0.2).abs() > 1e-3 && (start - 0.2).abs() < 1.0);
}
