//! Against statsmodels, against Gaussian densities written out, and what is refused.

use std::ops::ControlFlow;

use thetahat_core::nalgebra::{Cholesky, DMatrix, DVector};
use thetahat_numerics::noise::Noise;
use thetahat_numerics::optimize::Algorithm;

use super::*;
use crate::data::{Detrend, Log};
use crate::estimate::{Constant, Method};
use crate::report::{Plan, identify};
use crate::tests::{channel, filtered};

/// An ARMA model of a log as statsmodels has it.
struct Case {
    log: &'static str,
    /// Those of A and C.
    orders: [usize; 2],
    holes: bool,
    /// a and c.
    parameters: &'static [f64],
    variance: f64,
    log_likelihood: f64,
}

const fn case(
    log: &'static str,
    orders: [usize; 2],
    holes: bool,
    parameters: &'static [f64],
    variance: f64,
    log_likelihood: f64,
) -> Case {
    Case { log, orders, holes, parameters, variance, log_likelihood }
}

/// What `tests/data/public/sarimax_cases.py` printed with statsmodels 0.15.0.
const SARIMAX: [Case; 8] = [
    case(
        "nile",
        [1, 1],
        false,
        &[-0.860_935_292_829_1, -0.517_490_383_223_7],
        19_891.888_166_929_44,
        -637.039_199_959_443_5,
    ),
    case(
        "nile",
        [1, 1],
        true,
        &[-0.944_722_466_010_3, -0.718_614_298_320_3],
        20_643.449_096_555_31,
        -442.348_277_698_196_5,
    ),
    case(
        "sunspots",
        [1, 1],
        false,
        &[-0.735_451_821_450_4, 0.519_459_743_721_3],
        369.202_699_634_996_5,
        -1_352.624_970_862_919,
    ),
    case(
        "sunspots",
        [1, 1],
        true,
        &[-0.679_479_986_162_1, 0.712_392_178_151_1],
        352.204_517_591_383_3,
        -992.701_761_807_823_1,
    ),
    case(
        "sunspots",
        [2, 0],
        false,
        &[-1.390_664_126_748_9, 0.688_587_594_735_4],
        274.761_064_672_391_1,
        -1_307.318_597_983_280_4,
    ),
    case(
        "sunspots",
        [2, 0],
        true,
        &[-1.410_593_022_318_3, 0.713_242_735_280_2],
        258.231_741_997_478_3,
        -956.571_069_090_845_6,
    ),
    case(
        "sunspots",
        [2, 1],
        false,
        &[-1.470_739_028_354_8, 0.755_121_770_394_5, -0.153_691_978_463_7],
        270.878_330_439_649_4,
        -1_305.138_596_317_573_3,
    ),
    case(
        "sunspots",
        [2, 1],
        true,
        &[-1.472_485_840_269_8, 0.762_016_626_492_8, -0.151_343_801_231_3],
        267.365_824_990_753_6,
        -955.085_166_676_459_5,
    ),
];

/// The same with a line through the middle of the log: its level and slope.
const LINES: [([f64; 2], Case); 2] = [
    (
        [49.804_930_112_835_2, 0.099_955_790_661_8],
        case(
            "sunspots",
            [2, 1],
            false,
            &[-1.485_861_343_399_9, 0.782_494_127_399_5, -0.204_604_715_489_3],
            261.026_086_555_700_1,
            -1_299.431_815_758_897_8,
        ),
    ),
    (
        [49.739_049_274_651_5, 0.097_413_278_219_0],
        case(
            "sunspots",
            [2, 1],
            true,
            &[-1.488_832_385_940_4, 0.789_431_270_281_1, -0.206_165_293_662_6],
            258.440_351_454_752_5,
            -949.557_175_899_266_2,
        ),
    ),
];

/// The output of a log of tests/data/public, as in the program.
fn public(name: &str, holes: bool) -> Log {
    let path = format!("{}/../../tests/data/public/{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let values = text.lines().skip(1).map(|line| line.split_once(',').unwrap().1.parse().unwrap());
    let mut y: Vec<f64> = values.collect();
    if holes {
        (0..y.len()).filter(|t| 7 * t * t * t % 23 < 7).for_each(|t| y[t] = f64::NAN);
    }
    Log::new(vec![channel("y", y)], 1.0).unwrap()
}

/// Newton's method, as the information is not the Hessian where the model is not true.
fn tight() -> Search {
    Search { tolerance: 1e-15, algorithm: Algorithm::Newton, ..Search::default() }
}

fn outcome(procedure: &Procedure) -> &LikelihoodOutcome {
    match procedure {
        Procedure::ExactLikelihood(outcome) => outcome,
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_optimum_is_that_of_statsmodels() {
    for Case { log, orders: [na, nc], holes, parameters, variance, log_likelihood } in SARIMAX {
        let orders = Orders::armax(na, &[], nc, &[]).unwrap();
        let method = Method::ExactLikelihood(tight());
        let plan = Plan { method, constant: Constant::No, ..Plan::new(&[], "y", orders) };
        let report = identify(public(log, holes), &[], &plan).unwrap();
        let found = &report.estimation;
        let case = format!("{log} {na} {nc} {holes}");
        for (parameter, expected) in report.polynomials().parameters.iter().zip(parameters) {
            let error = (parameter.value - expected).abs();
            assert!(error < 1e-7, "{case}: {} off by {error:e}", parameter.name);
        }
        assert!((found.mse / variance - 1.0).abs() < 1e-7, "{case}: {}", found.mse);
        let own = outcome(&found.procedure).log_likelihood.unwrap();
        assert!((own - log_likelihood).abs() < 1e-8, "{case}: {own}");
        // AIC as statsmodels counts it, with the variance as a parameter.
        let (samples, count) = (found.samples as f64, (na + nc) as f64);
        let aic = samples
            * (found.criteria.of(crate::estimate::InformationCriterion::AIC).unwrap()
                + std::f64::consts::TAU.ln()
                + 1.0)
            + 2.0;
        assert!((aic - 2.0 * (count + 1.0 - log_likelihood)).abs() < 1e-7, "{case}: {aic}");
    }
}

#[test]
fn a_line_is_that_of_statsmodels() {
    for ([level, slope], Case { log, orders: [na, nc], holes, parameters, variance, log_likelihood }) in LINES
    {
        let orders = Orders::armax(na, &[], nc, &[]).unwrap();
        let method = Method::ExactLikelihood(tight());
        let plan = Plan { method, trend: true, ..Plan::new(&[], "y", orders) };
        let report = identify(public(log, holes), &[], &plan).unwrap();
        let found = &report.estimation;
        for (parameter, expected) in report.polynomials().parameters.iter().zip(parameters) {
            assert!((parameter.value - expected).abs() < 1e-7, "{holes}: {}", parameter.name);
        }
        let offset = report.polynomials().output.offset;
        let middle = offset.level + 154.0 * offset.slope;
        assert!((middle - level).abs() < 1e-6 && (offset.slope - slope).abs() < 1e-8, "{middle} {offset:?}");
        assert!((found.mse / variance - 1.0).abs() < 1e-7, "{}", found.mse);
        let own = outcome(&found.procedure).log_likelihood.unwrap();
        assert!((own - log_likelihood).abs() < 1e-8, "{own}");
    }
}

/// ARMAX(2, 2, 1) data with inputs from the start on, a third of the outputs missing, at first too.
struct Experiment {
    u: Vec<f64>,
    y: Vec<f64>,
}

const TRUTH: [f64; 5] = [-1.2, 0.6, 0.7, 0.4, 0.5];

impl Experiment {
    fn new(samples: usize, seed: u64) -> Self {
        let mut noise = Noise(seed);
        let (u, e) = (noise.take(samples + 100), noise.take(samples + 100));
        let mut y = vec![0.0; samples + 100];
        let [a1, a2, b1, b2, c1] = TRUTH;
        for t in 2..y.len() {
            y[t] = -a1 * y[t - 1] - a2 * y[t - 2] + b1 * u[t - 1] + b2 * u[t - 2] + e[t] + c1 * e[t - 1];
        }
        // In the middle of a run.
        let mut y = y.split_off(100);
        (0..samples).filter(|t| 7 * t * t * t % 23 < 7).for_each(|t| y[t] = f64::NAN);
        Self { u: u[100..].to_vec(), y }
    }

    fn record(&self, past: usize) -> Record<'_> {
        let segments = std::iter::once(past..self.y.len()).collect();
        Record { output: &self.y, inputs: vec![&self.u], segments, past: vec![past] }
    }
}

fn orders() -> Orders {
    Orders::armax(2, &[2], 1, &[1]).unwrap()
}

fn impulse(length: usize) -> Vec<f64> {
    (0..length).map(|t| if t == 0 { 1.0 } else { 0.0 }).collect()
}

/// S exp(sum ln f/N) from the covariance matrix of the measured outputs after `first`, of which the last `free` impulse
/// responses of 1/A are taken by generalised least squares; and N.
fn dense(experiment: &Experiment, first: usize, rest: bool, free: usize, theta: &[f64]) -> (f64, usize) {
    let [a1, a2, b1, b2, c1] = theta else { panic!("five parameters") };
    let (a, c) = ([1.0, *a1, *a2], [1.0, *c1]);
    // Autocovariances from 2000 samples of the impulse response of C/A.
    let response = filtered(&c, &a, &impulse(2000));
    let covariance = |lag: usize| (lag..2000).map(|t| response[t] * response[t - lag]).sum::<f64>();
    let covariances: Vec<f64> = (0..experiment.y.len()).map(covariance).collect();
    let rows: Vec<usize> = (first..experiment.y.len()).filter(|t| !experiment.y[*t].is_nan()).collect();
    let size = rows.len();
    let matrix = DMatrix::from_fn(size, size, |i, j| covariances[rows[i].abs_diff(rows[j])]);
    let factor = Cholesky::new(matrix).unwrap().l();
    let mut u = experiment.u.clone();
    if rest {
        u[..first].fill(0.0);
    }
    let x = filtered(&[0.0, *b1, *b2], &a, &u);
    let z = DVector::from_iterator(size, rows.iter().map(|t| experiment.y[*t] - x[*t]));
    let white = factor.solve_lower_triangular(&z).unwrap();
    let impulses = filtered(&[1.0], &a, &impulse(experiment.y.len()));
    let regressors = DMatrix::from_fn(size, free, |i, k| {
        rows[i].checked_sub(first + k).map_or(0.0, |since| impulses[since])
    });
    let white = if free > 0 {
        let regressors = factor.solve_lower_triangular(&regressors).unwrap();
        let weights = regressors.clone().svd(true, true).solve(&white, 0.0).unwrap();
        white - regressors * weights
    } else {
        white
    };
    let logarithms: f64 = factor.diagonal().iter().map(|d| 2.0 * d.ln()).sum();
    (white.norm_squared() * (logarithms / size as f64).exp(), size)
}

#[test]
fn it_is_the_gaussian_density() {
    let experiment = Experiment::new(60, 3);
    for theta in
        [TRUTH, [-0.3, -0.4, 1.0, 0.0, -0.8], [0.5, 0.9, -0.2, 0.3, 0.95], [-1.9, 0.95, 0.1, 0.2, 0.1]]
    {
        // The past, and how many impulses there are: max(na, nb + nk - 1 - past).
        for (past, begin, free) in [
            (0, InitialCondition::Rest, 0),
            (0, InitialCondition::Free, 2),
            (1, InitialCondition::Free, 2),
            (7, InitialCondition::Free, 2),
            (7, InitialCondition::Rest, 0),
        ] {
            let record = experiment.record(past);
            let mut likelihood = Likelihood::new(&record, &orders(), 0, begin);
            assert_eq!(likelihood.initial_conditions(), free);
            let cost = best_free(&mut likelihood, &theta).unwrap();
            let (expected, samples) = dense(&experiment, past, begin == InitialCondition::Rest, free, &theta);
            assert_eq!(likelihood.samples(), samples);
            assert!((cost / expected - 1.0).abs() < 1e-9, "{theta:?} {past} {begin:?}: {cost} {expected}");
        }
    }
}

#[test]
fn the_gradient_is_that_of_differences() {
    let experiment = Experiment::new(200, 5);
    let ones = vec![1.0; 200];
    let ramp: Vec<f64> = (0..200).map(|t| f64::from(t) / 100.0 - 1.0).collect();
    let mut record = experiment.record(0);
    record.inputs.extend([ones.as_slice(), &ramp]);
    record.segments = vec![0..90, 100..200];
    record.past = vec![0, 3];
    let orders = Orders::armax(2, &[2, 1, 1], 3, &[1, 0, 0]).unwrap();
    let theta = [-1.1, 0.5, 0.6, 0.5, 0.3, -0.2, 0.4, 0.2, -0.3];
    for begin in [InitialCondition::Rest, InitialCondition::Free] {
        let mut likelihood = Likelihood::new(&record, &orders, 2, begin);
        let cost = best_free(&mut likelihood, &theta).unwrap();
        likelihood.linearize().unwrap();
        let right = likelihood.right().to_vec();
        for (place, own) in right.iter().enumerate() {
            let at = |step: f64| {
                let mut near = theta;
                near[place] += step;
                best_free(&mut Likelihood::new(&record, &orders, 2, begin), &near).unwrap()
            };
            let (near, far) = (at(1e-3) - at(-1e-3), at(2e-3) - at(-2e-3));
            let slope = (8.0 * near - far) / 12e-3;
            assert!((slope + 2.0 * own).abs() < 1e-7 * cost, "{begin:?} {place}: {slope} {}", -2.0 * own);
        }
    }
}

#[test]
fn standard_errors_are_as_large_as_the_errors() {
    let (runs, mut squares, mut at_the_boundary) = (100, [0.0; 5], 0);
    for seed in 0..runs {
        let experiment = Experiment::new(250, 100 + seed);
        let record = experiment.record(0);
        let found = fit(&record, &orders(), Initial::Auto).unwrap();
        let Some(covariance) = found.covariance() else {
            // The likelihood is largest at a root of C on the unit circle, as in some short logs: a search from the
            // truth ends there too.
            let from_truth = Search { initial_parameters: Some(TRUTH.to_vec()), ..Search::default() };
            let other =
                exact(&record, 0, &orders(), Initial::Auto, &from_truth, &|_| ControlFlow::Continue(()))
                    .unwrap();
            let [found, other] = [&found, &other].map(|found| outcome(found.procedure()));
            assert!(found.search.stability_bound);
            let difference = other.log_likelihood.unwrap() - found.log_likelihood.unwrap();
            assert!(difference.abs() < 1e-5, "{seed}: {difference}");
            at_the_boundary += 1;
            continue;
        };
        for (place, square) in squares.iter_mut().enumerate() {
            let error = found.parameters()[place] - TRUTH[place];
            *square += error * error / covariance[place][place] / runs as f64;
        }
    }
    assert!(at_the_boundary <= 6, "{at_the_boundary}");
    // chi-square of 100 degrees over 100 has a deviation of 0.14.
    assert!(squares.iter().all(|square| (0.6..1.5).contains(square)), "{squares:?}");
}

fn fit(record: &Record<'_>, orders: &Orders, initial: Initial) -> Result<Estimate, Error> {
    exact(record, 0, orders, initial, &Search::default(), &|_| ControlFlow::Continue(()))
}

#[test]
fn without_holes_and_with_many_samples_it_is_the_conditional_estimate() {
    let mut experiment = Experiment::new(40_000, 9);
    let whole = filtered(&[0.0, 0.7, 0.4], &[1.0, -1.2, 0.6], &experiment.u);
    let e = Noise(10).take(40_000);
    let v = filtered(&[1.0, 0.5], &[1.0, -1.2, 0.6], &e);
    experiment.y = whole.iter().zip(&v).map(|(x, v)| x + v).collect();
    let record = experiment.record(0);
    let ours = fit(&record, &orders(), Initial::Auto).unwrap();
    let other = prediction_error(&record, &orders(), Initial::Auto, &Search::default(), &|_| {
        ControlFlow::Continue(())
    })
    .unwrap();
    let covariance = other.covariance().unwrap();
    for (place, (one, other)) in ours.parameters().iter().zip(other.parameters()).enumerate() {
        assert!((one - other).abs() < 0.05 * covariance[place][place].sqrt(), "{place} {one} {other}");
    }
    let deviation = |estimate: &Estimate, place: usize| estimate.covariance().unwrap()[place][place].sqrt();
    assert!((0..5).all(|place| (deviation(&ours, place) / deviation(&other, place) - 1.0).abs() < 0.01));
    // It began at rest.
    assert_eq!(ours.initial(), Initial::Zero);
}

#[test]
fn a_state_is_estimated_where_it_is_worth_it() {
    // A slow plant that begins far from rest.
    let mut noise = Noise(12);
    let u = noise.take(300);
    let mut x = vec![20.0];
    (1..300).for_each(|t| x.push(0.95 * x[t - 1] + 0.5 * u[t - 1]));
    let v = filtered(&[1.0, 0.5], &[1.0, -0.95], &noise.take(300));
    let y: Vec<f64> = x.iter().zip(&v).map(|(x, v)| x + 0.1 * v).collect();
    let record = Record::new(&y, vec![&u]).unwrap();
    let orders = Orders::armax(1, &[1], 1, &[1]).unwrap();
    let auto = fit(&record, &orders, Initial::Auto).unwrap();
    assert_eq!((auto.initial(), outcome(auto.procedure()).search.initial_conditions), (Initial::Estimate, 1));
    assert!((auto.parameters()[0] + 0.95).abs() < 0.01);
    let estimated = fit(&record, &orders, Initial::Estimate).unwrap();
    assert!((auto.cost() / estimated.cost() - 1.0).abs() < 1e-7);
    let rest = fit(&record, &orders, Initial::Zero).unwrap();
    assert!(rest.cost() > 1.2 * auto.cost());
}

#[test]
fn every_other_output_is_enough() {
    let mut noise = Noise(15);
    let mut y = filtered(&[1.0], &[1.0, -0.8], &noise.take(2000));
    y.iter_mut().skip(1).step_by(2).for_each(|y| *y = f64::NAN);
    let record = Record {
        output: &y,
        inputs: Vec::new(),
        segments: std::iter::once(0..2000).collect(),
        past: vec![0],
    };
    let found = fit(&record, &Orders::arx(1, &[], &[]).unwrap(), Initial::Auto).unwrap();
    // a^2 is all that such outputs tell: its sign is that of the start.
    assert!((found.parameters()[0].abs() - 0.8).abs() < 0.05, "{:?}", found.parameters());
}

#[test]
fn a_walk_comes_out_as_a_slow_pole_and_what_has_no_likelihood_is_refused() {
    let walk = filtered(&[1.0], &[1.0, -1.0], &Noise(17).take(500));
    let record = Record::new(&walk, vec![]).unwrap();
    let found = fit(&record, &Orders::arx(1, &[], &[]).unwrap(), Initial::Auto).unwrap();
    assert!((-1.0..-0.97).contains(&found.parameters()[0]), "{:?}", found.parameters());
    let mut likelihood =
        Likelihood::new(&record, &Orders::arx(1, &[], &[]).unwrap(), 0, InitialCondition::Rest);
    for root in [-1.0, -1.1, f64::NAN] {
        assert!(likelihood.evaluate(&[root]).is_err());
    }
    let u = Noise(18).take(500);
    let driven = Record::new(&walk, vec![&u]).unwrap();
    let argument = |record: &Record<'_>, orders: &Orders, initial| match fit(record, orders, initial) {
        Err(Error::Argument { argument, .. }) => argument,
        other => panic!("{other:?}"),
    };
    for orders in
        [Orders::oe(&[1], &[1], &[1]), Orders::bj(&[1], 1, 1, &[1], &[1]), Orders::bj(&[1], 1, 1, &[0], &[1])]
    {
        assert_eq!(argument(&driven, &orders.unwrap(), Initial::Auto), "likelihood");
    }
    let (arma, armax) = (Orders::armax(1, &[], 1, &[]).unwrap(), Orders::armax(1, &[1], 1, &[1]).unwrap());
    assert_eq!(argument(&record, &arma, Initial::Drop), "initial");
    assert_eq!(argument(&record, &arma, Initial::Estimate), "initial");
    assert_eq!(argument(&record, &armax, Initial::Auto), "orders");
    let few = Record::new(&walk[..3], vec![&u[..3]]).unwrap();
    assert!(matches!(fit(&few, &armax, Initial::Auto), Err(Error::Undetermined { .. })));
    let zeros = vec![0.0; 500];
    let silent = Record::new(&walk, vec![&zeros]).unwrap();
    assert!(matches!(fit(&silent, &armax, Initial::Auto), Err(Error::Undetermined { .. })));
}

#[test]
fn the_report_is_that_of_its_log_and_criteria_decide_about_a_level() {
    let mut noise = Noise(21);
    let mut y = filtered(&[1.0, 0.4], &[1.0, -0.7], &noise.take(400));
    y.iter_mut().for_each(|y| *y += 30.0);
    (0..400).filter(|t| t % 9 == 4).for_each(|t| y[t] = f64::NAN);
    let log = Log::new(vec![channel("y", y)], 1.0).unwrap();
    let method = Method::ExactLikelihood(Search::default());
    let plan = Plan { method, ..Plan::new(&[], "y", Orders::armax(1, &[], 1, &[]).unwrap()) };
    let report = identify(log.clone(), &[], &plan).unwrap();
    assert_eq!(report.estimation.samples, 400 - 44);
    assert_eq!(report.data.segments.len(), 1);
    let validation =
        crate::report::validate(&report, None, &log, &[], &crate::report::ValidationPlan::default());
    assert_eq!(validation.unwrap().validation.in_sample, crate::report::InSample::Yes);
    // What the mean leaves open of the level: as much as the error of a level that is estimated.
    assert!(report.polynomials().offset_covariance.is_some());
    // The mean is the level but for its error.
    assert_eq!(report.estimation.level, None);
    let raw = Plan { detrend: Detrend::None, constant: Constant::Auto, ..plan.clone() };
    assert_eq!(identify(log.clone(), &[], &raw).unwrap().estimation.level, None);
    let early = Plan { detrend: Detrend::Start(1), ..plan };
    let level = identify(log, &[], &early).unwrap().estimation.level.unwrap();
    assert!((level.value - 30.0).abs() < 4.0 * level.standard_error.unwrap(), "{level:?}");
}
