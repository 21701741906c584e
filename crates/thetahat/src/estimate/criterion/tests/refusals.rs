//! What cannot be done, and what is said of it.

use super::*;

fn message(result: Result<Constrained, Error>) -> String {
    result.unwrap_err().to_string()
}

#[test]
fn options_that_make_no_sense_are_refused() {
    let mut noise = Noise(1);
    let (y, u) = data(50, &mut noise, 0.1, even);
    let orders = orders(1, 1);
    let bound = |parameter: &str, low, high| ConvexFit {
        bounds: vec![Bound { parameter: parameter.into(), low, high }],
        ..ConvexFit::default()
    };
    let gain = |input: Option<&str>, low, high| ConvexFit {
        dc_gain: vec![GainBound { input: input.map(str::to_owned), low, high }],
        ..ConvexFit::default()
    };
    let (nan, infinity) = (f64::NAN, f64::INFINITY);
    let cases = [
        (bound("b3", 0.0, 1.0), "bounds: b3=0..1: there is no parameter 'b3'; there are: a1, b1"),
        (bound("a1", 1.0, 0.0), "bounds: a1=1..0: the low end is above the high one; swap them"),
        (bound("a1", nan, 0.0), "bounds: a1=..0: an end is not a number"),
        (bound("a1", 0.0, nan), "bounds: a1=0..: an end is not a number"),
        (
            bound("a1", -infinity, infinity),
            "bounds: a1=..: both ends are open, so that it asks for nothing; leave it out",
        ),
        (bound("a1", infinity, infinity), "bounds: a1=inf: no finite value is in the range"),
        (gain(Some("v"), 0.0, 1.0), "dc-gain: dc-gain v=0..1: there is no input 'v'; there are: u"),
        (gain(None, 2.0, 1.0), "dc-gain: dc-gain 2..1: the low end is above the high one; swap them"),
        (
            ConvexFit { ridge: -1.0, ..ConvexFit::default() },
            "ridge: -1 is not a weight; give 0 or a positive number",
        ),
        (
            ConvexFit { ridge: nan, ..ConvexFit::default() },
            "ridge: NaN is not a weight; give 0 or a positive number",
        ),
        (
            ConvexFit { noise_bound: Some(-0.1), ..ConvexFit::default() },
            "noise-bound: -0.1 is not a size of e; give a positive number in units of the output",
        ),
        (
            ConvexFit { noise_bound: Some(infinity), ..ConvexFit::default() },
            "noise-bound: inf is not a size of e; give a positive number in units of the output",
        ),
    ];
    for (criterion, expected) in cases {
        let result = fit(&y, &u, &orders, &criterion);
        assert!(matches!(result, Err(Error::Argument { .. })));
        assert_eq!(message(result), expected);
    }
    // Two inputs, of which one has no B.
    let record = record(&y, &[&u, &u], &whole(50));
    let names = ["u".to_owned(), "v".to_owned()];
    let two = Orders::arx(1, &[1, 0], &[1, 1]).unwrap();
    let of = |criterion| message(constrained(&record, &names, &two, Presample::Drop, &criterion));
    let expected = "dc-gain: dc-gain 1: say of which input, as in u=1; there are: u, v";
    assert_eq!(of(gain(None, 1.0, 1.0)), expected);
    assert!(of(gain(Some("v"), 1.0, 1.0)).ends_with("input 'v' has no B (nb = 0), so that its gain is 0"));
    let three = [&names[..], &["w".to_owned()]].concat();
    let result = constrained(&record, &three, &two, Presample::Drop, &ConvexFit::default());
    assert_eq!(message(result), "inputs: there are 3 names for 2 inputs; give one for each");
    // Nothing is asked of an input without a name, whose coefficient comes last.
    let constant = Orders::arx(1, &[1, 1], &[1, 0]).unwrap();
    let of = |criterion| message(constrained(&record, &names[..1], &constant, Presample::Drop, &criterion));
    let bound = ConvexFit { bounds: vec!["b2_0=0..1".parse().unwrap()], ..ConvexFit::default() };
    assert!(of(bound).ends_with("there is no parameter 'b2_0'; there are: a1, b1"));
    // Models without an input, and those that are not linear in their parameters.
    let alone = super::record(&y, &[], &whole(50));
    let autoregression = Orders::arx(2, &[], &[]).unwrap();
    let result = constrained(&alone, &[], &autoregression, Presample::Drop, &gain(None, 1.0, 1.0));
    assert!(message(result).ends_with("the model has no input"));
    let result = fit(&y, &u, &Orders::oe(&[1], &[1], &[1]).unwrap(), &ConvexFit::default());
    assert!(matches!(result, Err(Error::Argument { .. })));
}

#[test]
fn words_that_make_no_sense_are_refused() {
    for words in [
        "",
        "a1",
        "=1",
        "a1=",
        "a1=x",
        "a1=1..x",
        "a1=2..1",
        "a1=..",
        "a1=nan",
        "a1=inf",
        "a1=1..2..3",
        "a1=1 .. 2",
    ] {
        assert!(matches!(words.parse::<Bound>(), Err(Error::Argument { .. })), "{words}");
    }
    for words in ["", "u=", "=2", "u=1..0", "..", "u", "-inf..inf"] {
        assert!(matches!(words.parse::<GainBound>(), Err(Error::Argument { .. })), "{words}");
    }
    for words in ["", "3", "Inf", "infinity"] {
        assert!(matches!(words.parse::<Norm>(), Err(Error::Argument { .. })), "{words}");
    }
    let error = "a1=0..y".parse::<Bound>().unwrap_err().to_string();
    assert_eq!(error, "bounds: 'a1=0..y': 'y' is not a number; write low..high");
}

#[test]
fn demands_that_clash_are_named() {
    let mut noise = Noise(2);
    let (y, u) = data(100, &mut noise, 0.1, even);
    let cases: [(usize, &[&str], &[&str], &str); 6] = [
        (1, &["a1=0..1", "b1=0..1", "a1=2..3"], &[], "a1=0..1 and a1=2..3 clash"),
        (1, &["a1=0..1", "a1=1..3", "a1=1.5"], &[], "a1=0..1 and a1=1.5 clash"),
        // B(1) = 5 A(1) is at least 5.
        (1, &["a1=0..1", "b1=..1"], &["u=5"], "a1=0..1, b1=..1 and dc-gain u=5 clash"),
        // Without the bounds both gains hold at A(1) = B(1) = 0.
        (
            2,
            &["a1=-0.9..", "a2=0.."],
            &["1..2", "3..4"],
            "a1=-0.9.., a2=0.., dc-gain 1..2 and dc-gain 3..4 clash",
        ),
        (
            2,
            &["a1=-0.9..", "a2=0..", "b1=0.."],
            &["2", "3"],
            "a1=-0.9.., a2=0.., dc-gain 2 and dc-gain 3 clash",
        ),
        (2, &["b1=1..2", "b2=0..", "a1=-1..1"], &["-3..-2"], "b1=1..2, b2=0.. and dc-gain -3..-2 clash"),
    ];
    for norm in ALL {
        for (order, bounds, gains, expected) in cases {
            let demands = criterion(norm, bounds, gains);
            for criterion in [ConvexFit { noise_bound: Some(1e9), ..demands.clone() }, demands] {
                let result = fit(&y, &u, &orders(order, order), &criterion);
                assert!(matches!(result, Err(Error::Data { .. })));
                let expected = format!("infeasible: {expected}; widen or leave out one of them");
                assert_eq!(message(result), expected);
            }
        }
        // Demands that meet in a point.
        let touching = criterion(norm, &["a1=-0.5..0", "b1=..1"], &["2.."]);
        assert_eq!(fit(&y, &u, &orders(1, 1), &touching).unwrap().parameters, [-0.5, 1.0]);
        let integrating = criterion(norm, &["b1=0.."], &["1..2", "3..4"]);
        let found = fit(&y, &u, &orders(2, 1), &integrating).unwrap();
        assert!((1.0 + found.parameters[0] + found.parameters[1]).abs() < 1e-9);
        assert_eq!(found.outcome.active, ["b1=0..", "dc-gain 1..2", "dc-gain 3..4"]);
    }
}

#[test]
fn a_noise_bound_that_is_too_small_comes_with_one_that_is_not() {
    let mut noise = Noise(3);
    let (y, u) = data(100, &mut noise, 0.1, even);
    let orders = orders(2, 2);
    for (bounds, gains, with) in [
        (&[][..], &[][..], ""),
        (&["a1=-1.3..-1.1", "b2=0..1"], &["u=1..5"], ""),
        (&["a1=-1..0", "b2=0..1"], &[], " with a1=-1..0"),
        (&["b2=-1..0.5"], &["u=1..2"], " with dc-gain u=1..2"),
    ] {
        for norm in ALL {
            let mut criterion = ConvexFit { noise_bound: Some(0.05), ..criterion(norm, bounds, gains) };
            if !with.is_empty() {
                criterion.noise_bound = Some(0.11);
            }
            let told = message(fit(&y, &u, &orders, &criterion));
            let start =
                format!("infeasible: no parameters keep |e| <= {}{with}: ", criterion.noise_bound.unwrap());
            assert!(told.starts_with(&start), "{told}");
            let (_, rest) = told.split_once("the smallest possible bound is ").unwrap();
            let bound: f64 = rest.split(';').next().unwrap().parse().unwrap();
            criterion.noise_bound = Some(bound);
            assert!(fit(&y, &u, &orders, &criterion).is_ok());
            criterion.noise_bound = Some(bound * 0.998);
            assert!(fit(&y, &u, &orders, &criterion).is_err());
        }
    }
}

#[test]
fn what_the_data_cannot_determine_is_named() {
    let mut noise = Noise(4);
    let (y, u) = data(100, &mut noise, 0.1, even);
    let (zero, one) = (vec![0.0; 100], vec![1.0; 100]);
    let undetermined =
        |u: &[f64], criterion: &ConvexFit| match fit(&y, u, &orders(2, 2), criterion).unwrap_err() {
            Error::Undetermined { parameters, message } => (parameters.join(" "), message),
            other => panic!("{other}"),
        };
    let ridge = |norm, ridge| ConvexFit { norm, ridge, ..ConvexFit::default() };
    for norm in ALL {
        for criterion in [criterion(norm, &[], &[]), criterion(norm, &["a1=-1..0"], &["0..9"])] {
            assert_eq!(undetermined(&zero, &criterion).0, "b1 b2");
            assert_eq!(undetermined(&one, &criterion).0, "b2");
        }
        // A ridge helps where there is a regressor, and if it is not lost in rounding.
        let (parameters, message) = undetermined(&zero, &ridge(norm, 1.0));
        assert_eq!(parameters, "b1 b2");
        assert!(message.contains("nor does a ridge of 1:"), "{message}");
        assert_eq!(undetermined(&one, &ridge(norm, 1e-40)).0, "b2");
        let found = fit(&y, &one, &orders(2, 2), &ridge(norm, 1.0)).unwrap();
        assert!((found.parameters[2] - found.parameters[3]).abs() < 1e-9);
        // The box has no end where only a ridge decides.
        let bounded = ConvexFit { noise_bound: Some(5.0), ..ridge(norm, 1.0) };
        assert_eq!(undetermined(&one, &bounded).0, "b2");
        // So does a value.
        let fixed = criterion(norm, &["b1=1", "b2=2"], &[]);
        assert_eq!(fit(&y, &zero, &orders(2, 2), &fixed).unwrap().parameters[2..], [1.0, 2.0]);
        // Too few rows, and numbers out of range.
        let bounds = criterion(norm, &["a1=-1..0"], &[]);
        let short = fit(&y[..6], &u[..6], &orders(2, 2), &bounds);
        assert!(matches!(&short, Err(Error::Undetermined { parameters, .. }) if parameters.len() == 4));
        assert!(fit(&y[..7], &u[..7], &orders(2, 2), &bounds).is_ok());
        for unit in [1e300, 1e-300] {
            let y: Vec<f64> = y.iter().map(|y| y * unit).collect();
            assert!(matches!(fit(&y, &u, &orders(2, 2), &bounds), Err(Error::Data { .. })));
        }
    }
}
