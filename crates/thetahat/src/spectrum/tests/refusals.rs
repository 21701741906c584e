//! What is refused or warned of, and how that is said.

use super::*;
use crate::tests::assert_refused;

fn refused(log: &Log, plan: &SpectrumPlan) -> Error {
    spectrum(log, &[], plan).unwrap_err()
}

/// White noise through [`SMOOTH`], a little of it in the output too.
fn plain(rows: usize) -> Log {
    let u = noise(20, rows);
    let y: Vec<f64> = SMOOTH.output(&u).iter().zip(noise(21, rows)).map(|(y, e)| y + 0.1 * e).collect();
    log(&[("u", &u), ("y", &y)])
}

#[test]
fn arguments_that_make_no_sense_are_named() {
    let log = plain(200);
    let at = |frequencies: Frequencies, method: Method| SpectrumPlan { frequencies, ..plan(method) };
    let band = |low: f64, high: f64| Frequencies::Between { low, high, points: None };
    let lpm = Method::default();
    for (plan, argument, says) in [
        (
            at(band(1.0, 7.0), lpm),
            "frequencies",
            "7 rad/s is above 6.28319 rad/s, half the sampling frequency",
        ),
        (at(band(2.0, 1.0), lpm), "frequencies", "from above 0 to a higher"),
        (at(band(0.0, 1.0), lpm), "frequencies", "from above 0"),
        (at(band(f64::NAN, 1.0), lpm), "frequencies", "from above 0"),
        (at(Frequencies::At(vec![1.0, 1.0]), lpm), "frequencies", "in rising order"),
        (at(Frequencies::At(vec![-1.0]), lpm), "frequencies", "above 0"),
        (at(Frequencies::At(vec![1.0]), WELCH), "frequencies", "welch has lines of its own"),
        (
            at(Frequencies::Between { low: 1.0, high: 2.0, points: Some(5) }, WELCH),
            "points",
            "leave the number out",
        ),
        (at(band(1.0, 1.0001), WELCH), "frequencies", "welch has no line in this band"),
        (
            plan(Method::Welch { window: Some(300), estimator: Estimator::H1 }),
            "window",
            "300 rows are more than",
        ),
        (plan(Method::Welch { window: Some(4), estimator: Estimator::H1 }), "window", "give 8 at least"),
        (plan(Method::Spa { lags: Some(200) }), "lags", "200 lags need a segment of more rows"),
        (plan(Method::Spa { lags: Some(0) }), "lags", "give 1 at least"),
        (plan(Method::Lpm { half_width: Some(2) }), "half-width", "the polynomials need 5 at least"),
        (plan(Method::Lpm { half_width: Some(90) }), "half-width", "has 49 at most"),
        (SpectrumPlan::new(&["u", "u"], "y"), "channels", "'u' is named twice"),
        (SpectrumPlan::new(&[], "y"), "channels", "there is no input"),
        (SpectrumPlan { method: Method::Etfe, ..SpectrumPlan::new(&["u", "v"], "y") }, "method", "one input"),
    ] {
        match refused(&log, &plan) {
            Error::Argument { argument: found, message } => {
                assert_eq!(found, argument, "{message}");
                assert!(message.contains(says), "{message}");
            }
            other => panic!("{other}"),
        }
    }
}

#[test]
fn logs_that_tell_nothing_are_refused() {
    let (u, y) = (noise(22, 300), noise(23, 300));
    let constant = vec![0.1; 300];
    let error = refused(&log(&[("u", &constant), ("y", &y)]), &SpectrumPlan::new(&["u"], "y"));
    assert!(
        matches!(&error, Error::Undetermined { message, .. } if message.starts_with("the input 'u' is constant (0.1)"))
    );
    let error = refused(&log(&[("u", &u), ("y", &constant)]), &SpectrumPlan::new(&["u"], "y"));
    assert!(
        matches!(&error, Error::Data { message, .. } if message.starts_with("the output 'y' is constant"))
    );
    let nothing = vec![f64::NAN; 300];
    let error = refused(&log(&[("u", &u), ("y", &nothing)]), &SpectrumPlan::new(&["u"], "y"));
    assert!(error.to_string().starts_with("no row has a value of every channel"), "{error}");
    let error = refused(&plain(22), &SpectrumPlan::new(&["u"], "y"));
    assert_eq!(
        error.to_string(),
        "lpm needs 23 rows without a gap for 1 input, the longest segment has 22: record more, or take spa"
    );
    assert!(spectrum(&plain(23), &[], &SpectrumPlan::new(&["u"], "y")).is_ok());
    for (rows, method) in [(2, Method::Etfe), (2, Method::Spa { lags: None }), (7, WELCH), (2, SINES)] {
        let error = refused(&plain(rows), &plan(method));
        assert!(matches!(error, Error::Data { .. }), "{method}: {error}");
    }
    assert!(matches!(refused(&plain(1), &plan(SINES)), Error::Undetermined { .. } | Error::Data { .. }));
    // A sine has power at one line.
    let sine: Vec<f64> = (0..300).map(|t| (TAU * f64::from(t) / 30.0).sin()).collect();
    let frequencies = Frequencies::Between { low: 2.0, high: 6.0, points: None };
    let error = refused(
        &log(&[("u", &sine), ("y", &y)]),
        &SpectrumPlan { frequencies, ..SpectrumPlan::new(&["u"], "y") },
    );
    assert!(
        matches!(&error, Error::Undetermined { message, .. } if message.starts_with("the input 'u' has")),
        "{error}"
    );
}

#[test]
fn sines_that_are_not_whole_periods_are_refused() {
    let sine = |rows: i32| (0..rows).map(|t| (TAU * f64::from(t) / 100.0).sin()).collect::<Vec<f64>>();
    let of = |u: Vec<f64>, period, discard| {
        let log = log(&[("u", &u), ("y", &SMOOTH.output(&u))]);
        spectrum(&log, &[], &plan(Method::Sines { period, discard }))
    };
    for (found, says) in [
        (of(sine(150), None, None), "the input does not repeat itself in rows 1 to 150"),
        (of(noise(24, 500), None, None), "the input does not repeat itself in rows 1 to 500"),
        (of(sine(90), Some(100), None), "rows 1 to 90 are less than one period of 100 rows"),
        (of(sine(500), Some(70), None), "the input does not repeat itself after 70 rows"),
        (of(sine(500), None, Some(5)), "rows 1 to 500 are 5 whole periods of 100 rows: none is left after 5"),
    ] {
        assert_refused(found, says);
    }
    let single = of(sine(100), Some(100), None).unwrap();
    assert!(single.responses[0].points[0].covariance.is_none());
    assert!(single.warnings[0].contains("one period only"), "{:?}", single.warnings);
}

#[test]
fn inputs_that_move_together_are_told() {
    let u = noise(25, 600);
    let twice: Vec<f64> = u.iter().map(|u| -2.0 * u).collect();
    let y = SMOOTH.output(&u);
    let log = log(&[("a", &u), ("b", &twice), ("y", &y)]);
    for method in [Method::default(), Method::Spa { lags: Some(20) }, WELCH] {
        let error = refused(&log, &SpectrumPlan { method, ..SpectrumPlan::new(&["a", "b"], "y") });
        assert!(error.to_string().starts_with("the inputs cannot be told apart at"), "{method}: {error}");
    }
}

#[test]
fn a_loop_is_warned_of() {
    // u(t) = r(t) - 0.8 y(t - 1), with coloured noise in y.
    let (r, e) = (noise(26, 3000), noise(27, 3000));
    let (mut u, mut y): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    for t in 0..3000 {
        let past = |of: &[f64]| if t == 0 { 0.0 } else { of[t - 1] };
        let (v, w) = (past(&y), past(&u));
        y.push(0.8 * v + 0.5 * w + e[t]);
        u.push(r[t] - 0.8 * v);
    }
    let found = spectrum(&log(&[("u", &u), ("y", &y)]), &[], &SpectrumPlan::new(&["u"], "y")).unwrap();
    assert!(
        found.warnings.iter().any(|warning| warning.contains("feedback is suspected")),
        "{:?}",
        found.warnings
    );
    let open = spectrum(&plain(3000), &[], &SpectrumPlan::new(&["u"], "y")).unwrap();
    assert!(open.warnings.is_empty(), "{:?}", open.warnings);
}

/// y(t) = 1.05 y(t-1) + u(t-1) + e(t), u(t) = r(t) - 0.4 y(t): the controller is driven by r and has little noise to
/// answer.
#[test]
fn an_unstable_plant_is_held_by_a_loop() {
    let (r, e) = (noise(31, 3000), noise(32, 3000));
    let (mut u, mut y): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    for t in 0..3000 {
        let past = |of: &[f64]| if t == 0 { 0.0 } else { of[t - 1] };
        y.push(1.05 * past(&y) + past(&u) + 0.01 * e[t]);
        u.push(r[t] - 0.4 * y[t]);
    }
    let found = spectrum(&log(&[("u", &u), ("y", &y)]), &[], &SpectrumPlan::new(&["u"], "y")).unwrap();
    let told = |warning: &String| warning.starts_with("the plant is unstable, with a pole of modulus 1.0");
    assert!(found.warnings.iter().any(told), "{:?}", found.warnings);
    // An integrator of an input that ends is none, nor is one without noise.
    for size in [0.0, 0.1] {
        let mut sum = 0.0;
        let add = |(u, e): (&f64, &f64)| {
            sum += u;
            sum + size * e
        };
        let y: Vec<f64> = r.iter().zip(&e).map(add).collect();
        let found = spectrum(&log(&[("u", &r), ("y", &y)]), &[], &SpectrumPlan::new(&["u"], "y")).unwrap();
        assert!(!found.warnings.iter().any(|warning| warning.contains("unstable")), "{:?}", found.warnings);
    }
}

#[test]
fn segments_too_short_beside_the_longest_are_told() {
    let u = noise(28, 1000);
    let mut y = SMOOTH.output(&u);
    y[20] = f64::NAN;
    y[400] = f64::NAN;
    let found = spectrum(&log(&[("u", &u), ("y", &y)]), &[], &SpectrumPlan::new(&["u"], "y")).unwrap();
    assert!(
        found.warnings[0].starts_with("segments with 20 of 998 rows are too short for lpm"),
        "{:?}",
        found.warnings
    );
}
