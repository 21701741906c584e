//! Bias and spread of each way over many runs.

use super::*;

/// Bias, spread and mean standard error of an estimate over runs, as fractions of what it should be.
#[derive(Debug)]
struct Spread {
    bias: f64,
    deviation: f64,
    error: f64,
    runs: usize,
}

fn spread(found: &[StepTest], figure: StepFigure, method: StepMethod, right: f64) -> Spread {
    let all: Vec<(f64, f64)> = found
        .iter()
        .filter_map(|test| test.summary(figure, method))
        .map(|of| (of.value.value, of.value.standard_error.unwrap()))
        .collect();
    let count = all.len() as f64;
    let mean = all.iter().map(|of| of.0).sum::<f64>() / count;
    let square: f64 = all.iter().map(|of| (of.0 - mean).powi(2)).sum();
    let scale = if right == 0.0 { 1.0 } else { right };
    Spread {
        bias: (mean - right) / scale,
        deviation: (square / (count - 1.0)).sqrt() / scale,
        error: all.iter().map(|of| of.1).sum::<f64>() / count / scale,
        runs: all.len(),
    }
}

/// Runs with noise of this standard deviation, as a fraction of the step, and of this correlation from row to row: 100
/// rows before the step and 400 after it, 50 of them in a unit of time.
fn runs(count: u64, at: impl Fn(f64) -> f64, noise: f64, correlation: f64) -> Vec<StepTest> {
    let time = clock(500, 0.02);
    (0..count)
        .map(|run| {
            let mut random = Random::of(7, run);
            let mut last = random.normal();
            let coloured = || {
                last = correlation * last + (1.0 - correlation * correlation).sqrt() * random.normal();
                noise * last
            };
            found(&stepped(&time, &[2.0], &at, coloured))
        })
        .collect()
}

/// 1.96/sqrt(60) of a spread is 0.25 of it, and the spread itself is known to 0.18: bounds leave room for both.
const RUNS: u64 = 60;

#[test]
fn a_first_order_is_read_off_as_well_as_its_noise_lets_one() {
    use StepFigure::{Gain, RiseTime, TimeConstant};
    use StepMethod::{Crossings, Level, PlainAverage, Regime, Tangent, TwoPoints, WeightedAverage};
    // Over 500 runs: -0.3 ± 0.5 % by the weighted average, -0.2 ± 0.9 % by the level, 3.6 ± 3.6 % by the tangent at 1 %
    // noise; 0.7 ± 2.6 %, -0.2 ± 4.4 %, 6.6 ± 23 % at 5 %.
    for (noise, bounds) in [(0.01, [0.008, 0.012, 0.1]), (0.05, [0.04, 0.06, 0.45])] {
        let all = runs(RUNS, first_order(1.0, 0.0), noise, 0.0);
        for (method, bound) in [(WeightedAverage, bounds[0]), (Level, bounds[1]), (Tangent, bounds[2])] {
            let found = spread(&all, TimeConstant, method, 1.0);
            assert!(found.bias.hypot(found.deviation) < bound, "{noise} {method:?} {found:?}");
        }
        for (figure, method, right) in [
            (Gain, Regime, 2.0),
            (TimeConstant, Level, 1.0),
            (TimeConstant, TwoPoints, 1.0),
            (TimeConstant, PlainAverage, 1.0),
            (TimeConstant, WeightedAverage, 1.0),
            (RiseTime, Crossings, 9_f64.ln()),
        ] {
            let found = spread(&all, figure, method, right);
            assert!(
                found.runs > 30 && found.bias.abs() < found.deviation.max(0.003),
                "{noise} {method:?} {found:?}"
            );
            // Standard errors are those of the runs.
            assert!((0.65..1.5).contains(&(found.error / found.deviation)), "{noise} {method:?} {found:?}");
        }
    }
}

#[test]
fn a_dead_time_is_found_with_its_error() {
    let all = runs(RUNS, first_order(1.0, 0.4), 0.01, 0.0);
    let found = spread(&all, StepFigure::DeadTime, StepMethod::TwoPoints, 0.4);
    // Over 500 runs 0.2 ± 1.9 %, with standard errors of 1.8 %.
    assert!(found.bias.abs() < 0.01 && found.deviation < 0.03, "{found:?}");
    assert!((0.65..1.5).contains(&(found.error / found.deviation)), "{found:?}");
    // Where it leaves the noise is late, and the tangent is not.
    assert!(spread(&all, StepFigure::DeadTime, StepMethod::NoiseBand, 0.4).bias > 0.0);
    assert!(spread(&all, StepFigure::DeadTime, StepMethod::Tangent, 0.4).bias.abs() < 0.03);
}

#[test]
fn coloured_noise_makes_errors_larger_and_the_standard_errors_know() {
    let all = runs(RUNS, first_order(1.0, 0.0), 0.01, 0.6);
    let white = runs(RUNS, first_order(1.0, 0.0), 0.01, 0.0);
    for (figure, method, right) in [
        (StepFigure::Gain, StepMethod::Regime, 2.0),
        (StepFigure::TimeConstant, StepMethod::WeightedAverage, 1.0),
    ] {
        let found = spread(&all, figure, method, right);
        assert!((0.65..1.5).contains(&(found.error / found.deviation)), "{method:?} {found:?}");
        assert!(found.error > 1.5 * spread(&white, figure, method, right).error, "{method:?} {found:?}");
    }
}

#[test]
fn an_overshoot_tells_damping_and_frequency() {
    use StepFigure::{Damping, NaturalFrequency};
    let all = runs(RUNS, second_order(0.3, 4.0), 0.03, 0.0);
    // Over 500 runs: -0.1 ± 2.9 %, 0.4 ± 1.9 %.
    for (figure, right, bound) in [(Damping, 0.3, 0.05), (NaturalFrequency, 4.0, 0.03)] {
        let found = spread(&all, figure, StepMethod::Peak, right);
        assert!(found.bias.hypot(found.deviation) < bound, "{figure:?} {found:?}");
        assert!((0.6..1.5).contains(&(found.error / found.deviation)), "{figure:?} {found:?}");
    }
    let found = spread(&all, NaturalFrequency, StepMethod::TwoPeaks, 4.0);
    assert!(found.bias.hypot(found.deviation) < 0.08, "{found:?}");
}
