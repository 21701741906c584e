//! What is written and read back goes on as if nothing had happened: every estimator, in text and in binary.

#[path = "snapshot/control.rs"]
mod control;
#[path = "snapshot/past.rs"]
mod past;

use std::fmt::Debug;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use thetahat_core::nalgebra::{
    Const, DMatrix, DVector, Dyn, Matrix2, RowVector2, SVector, Vector1, Vector2, Vector3,
};
use thetahat_core::{
    Action, ArmaxMethod, ArmaxOrders, ArxOrders, Basis, ChangeDetector, Covariance, Error,
    ExtendedKalmanFilter, Forgetting, GainSchedule, Innovation, InputOrders, KalmanFilter, Lags,
    LeastSquares, LinearObservation, LinearTransition, LuenbergerObserver, OutputErrorMethod, RecursiveArmax,
    RecursiveArx, RecursiveLeastSquares, RecursiveNarx, RecursiveOutputError, RecursiveVectorArx, RlsStart,
    Scaling, UnscentedKalmanFilter, ZonotopeFilter,
};

const INPUTS: &[InputOrders] = &[InputOrders { nb: 1, nk: 2 }];

/// Some number between -1 and 1.
fn value(k: usize) -> f64 {
    (k as f64 * 0.7548776662466927).fract() * 2.0 - 1.0
}

/// Writes and reads in both kinds of format.
fn copies<E: Serialize + DeserializeOwned + Debug>(estimator: &E) -> [E; 2] {
    let text = serde_json::to_string(estimator).expect("text");
    let mut bytes = vec![];
    ciborium::into_writer(estimator, &mut bytes).expect("bytes");
    let from_text: E = serde_json::from_str(&text).expect("what was written");
    let from_bytes: E = ciborium::from_reader(&bytes[..]).expect("what was written");
    for copy in [&from_text, &from_bytes] {
        assert_eq!(serde_json::to_string(copy).expect("text"), text);
    }
    [from_text, from_bytes]
}

/// Steps an estimator, takes copies of it in the middle, and steps on: the answers must be the same to the bit.
fn check<E: Serialize + DeserializeOwned + Debug, A: Debug>(
    mut estimator: E,
    mut step: impl FnMut(&mut E, usize) -> A,
) {
    for k in 0..40 {
        // At the start, in the middle, and with a missing sample in the delay lines.
        if [0, 1, 7, 20].contains(&k) {
            for mut copy in copies(&estimator) {
                let [mut original, _] = copies(&estimator);
                for later in k..k + 30 {
                    let answers = (step(&mut original, later), step(&mut copy, later));
                    assert_eq!(format!("{:?}", answers.0), format!("{:?}", answers.1));
                }
            }
        }
        step(&mut estimator, k);
    }
}

/// A missing output at k = 6 and 19.
fn output(k: usize) -> f64 {
    if k == 6 || k == 19 { f64::NAN } else { 3.0 * value(5 * k + 2) }
}

#[test]
fn change_detector() {
    for (mean, variance) in [(2.0, 2.0), (f64::INFINITY, 1.5), (3.0, f64::INFINITY)] {
        check(ChangeDetector::new(mean, variance).expect("thresholds"), |detector, k| {
            let error = output(k);
            let innovation = Innovation::new(error, 0.7, error * error / 0.7, Action::Updated);
            detector.update(&innovation)
        });
    }
}

#[test]
fn recursive_least_squares() {
    let phi = |k| Vector3::new(value(k), value(3 * k), 1.0);
    for start in [RlsStart::Standard, RlsStart::Exact, RlsStart::Mixed { blend: 9 }] {
        for forgetting in [
            Forgetting::None,
            Forgetting::Exponential { factor: 0.9 },
            Forgetting::Selective { factor: 0.9 },
            Forgetting::RandomWalk { variance: 0.01 },
            Forgetting::Variable { factor: 0.95, minimum: 0.8, noise_variance: 0.1 },
        ] {
            let estimator = RecursiveLeastSquares::<f64, Const<3>>::new(&Vector3::repeat(1.0), forgetting)
                .unwrap()
                .with_start(start)
                .unwrap();
            check(estimator, |estimator, k| {
                (estimator.update(&phi(k), output(k)), *estimator.parameters(), estimator.noise_variance())
            });
        }
    }
    let dynamic =
        RecursiveLeastSquares::<f64, Dyn>::new(&DVector::repeat(3, 1.0), Forgetting::default()).unwrap();
    check(dynamic, |estimator, k| {
        let phi = DVector::from_column_slice(phi(k).as_slice());
        (estimator.update(&phi, output(k)), estimator.parameters().clone())
    });
}

#[test]
fn recursive_arx_and_armax() {
    let orders = ArxOrders { na: 1, inputs: INPUTS, constant: false };
    let arx: RecursiveArx<f32, Const<2>, Const<2>> =
        RecursiveArx::new(&orders, 1.0, &[1.0], Forgetting::default()).unwrap();
    check(arx, |arx, k| (arx.log_row(output(k) as f32, &[value(k) as f32]), *arx.estimator().parameters()));
    let several: RecursiveVectorArx<f64, Const<3>, Const<2>, Const<2>> =
        RecursiveVectorArx::new(&orders, &Vector2::new(1.0, 2.0), &[1.0], Forgetting::default()).unwrap();
    check(several, |several, k| {
        let outputs = Vector2::new(output(k), value(3 * k + 1));
        (several.log_row(&outputs, &[value(k)]), *several.estimator().parameters())
    });
    for method in [ArmaxMethod::ExtendedLeastSquares, ArmaxMethod::PredictionError] {
        let orders = ArmaxOrders { na: 1, inputs: INPUTS, nc: 1, constant: false };
        let armax: RecursiveArmax<f64, Const<3>, Const<2>> =
            RecursiveArmax::new(&orders, method, 1.0, &[1.0], 0.1, Forgetting::default()).unwrap();
        check(armax, |armax, k| (armax.log_row(output(k), &[value(k)]), *armax.estimator().parameters()));
    }
    for method in [OutputErrorMethod::PredictionError, OutputErrorMethod::Instruments] {
        let orders = ArxOrders { na: 1, inputs: INPUTS, constant: false };
        let model: RecursiveOutputError<f64, Const<2>, Const<2>> =
            RecursiveOutputError::new(&orders, method, 1.0, &[1.0], Forgetting::default()).unwrap();
        check(model, |model, k| (model.log_row(output(k), &[value(k)]), *model.estimator().parameters()));
    }
}

/// 1, z and z^2 of each regressor: functions of a user, without numbers of their own.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Squares;

impl Basis<f64> for Squares {
    fn functions(&self) -> usize {
        5
    }

    fn check(&self, regressors: usize) -> Result<(), thetahat_core::Error> {
        if regressors == 2 {
            return Ok(());
        }
        Err(thetahat_core::Error::Length { argument: "basis", expected: 2, found: regressors })
    }

    fn each(&self, z: &[f64], mut take: impl FnMut(usize, f64)) {
        take(0, 1.0);
        for (i, z) in z.iter().enumerate() {
            take(2 * i + 1, *z);
            take(2 * i + 2, z * z);
        }
    }

    fn add_slopes(&self, parameters: &[f64], z: &[f64], slopes: &mut [f64]) {
        for (i, (slope, z)) in slopes.iter_mut().zip(z).enumerate() {
            *slope += parameters[2 * i + 1] + 2.0 * parameters[2 * i + 2] * z;
        }
    }
}

#[test]
fn recursive_narx() {
    let orders = ArxOrders { na: 1, inputs: INPUTS, constant: false };
    let (level, valve) = (Scaling { offset: 0.5, scale: 2.0 }, Scaling { offset: 0.0, scale: 1.0 });
    for forgetting in [Forgetting::None, Forgetting::Exponential { factor: 0.95 }] {
        let fixed: RecursiveNarx<f64, Squares, Const<2>, Const<5>, Const<2>> =
            RecursiveNarx::new(Squares, &orders, level, &[valve], forgetting).expect("orders");
        check(fixed, |narx, k| narx.log_row(output(k), &[value(k)]).expect("a sample"));
        let open: RecursiveNarx<f64, Squares, Dyn, Dyn, Dyn> =
            RecursiveNarx::new(Squares, &orders, level, &[valve], forgetting).expect("orders");
        check(open.clone(), |narx, k| narx.log_row(output(k), &[value(k)]).expect("a sample"));
        refuses(
            &open,
            &[
                ("/output/1", &[json!(0.0), json!(-1.0), json!("NaN")]),
                ("/output/0", &[json!("inf")]),
                ("/inputs/2/0/1", &[json!(0.0), json!("inf")]),
                ("/lags/na", &[json!(2)]),
                ("/version", &[json!(2)]),
            ],
        );
    }
}

fn model() -> (LinearTransition<f64, Const<2>>, LinearObservation<f64, Const<2>, Const<1>>) {
    let noise = Covariance::from_diagonal(&Vector2::new(0.0, 0.1)).expect("a model");
    let sensor = Covariance::from_diagonal(&Vector1::new(0.3)).expect("a model");
    (
        LinearTransition::new(Matrix2::new(1.0, 0.1, 0.0, 0.9), noise).expect("a model"),
        LinearObservation::new(RowVector2::new(1.0, 0.2), sensor).expect("a model"),
    )
}

#[test]
fn filters_and_observers() {
    let (transition, observation) = model();
    let none = SVector::zeros();
    let prior = Covariance::new(&Matrix2::new(4.0, 1.0, 1.0, 2.0)).unwrap();
    let filter = KalmanFilter::new(Vector2::new(0.5, -1.0), prior).unwrap();
    let gated = filter.clone().with_gate(9.0).unwrap();
    for filter in [filter, gated] {
        let extended = ExtendedKalmanFilter::from(filter.clone()).with_iterations(2).unwrap();
        let unscented = UnscentedKalmanFilter::from(filter.clone()).with_spread(2.0).unwrap();
        check(unscented, |filter, k| {
            filter.predict(&transition, &none).unwrap();
            (filter.correct(&observation, &none, &Vector1::new(output(k))), *filter.state(), filter.spread())
        });
        check(filter, |filter, k| {
            filter.predict(&transition, &none).unwrap();
            let innovation = filter.correct(&observation, &none, &Vector1::new(output(k)));
            (innovation, *filter.state(), filter.covariance().matrix())
        });
        check(extended, |filter, k| {
            filter.predict(&transition, &none).unwrap();
            (filter.correct(&observation, &none, &Vector1::new(output(k))), *filter.state())
        });
    }
    let bounded: ZonotopeFilter<f64, Const<2>, Const<9>> =
        ZonotopeFilter::new(Vector2::zeros(), &Vector2::new(9.0, 3.0), Const).unwrap();
    check(bounded, |filter, k| {
        filter.predict(&transition, &Vector2::new(0.0, 0.1), &none).unwrap();
        let told = filter.correct(&observation, &Vector1::new(2.0), &none, &Vector1::new(output(k)));
        (told.map(|told| (told.contradiction, told.action)), *filter.centre(), filter.reaches())
    });
    let observer: LuenbergerObserver<f64, Const<2>, Const<1>> =
        LuenbergerObserver::new(Vector2::zeros(), Vector2::new(0.3, 0.1)).unwrap();
    check(observer, |observer, k| {
        (observer.update(&transition, &observation, &none, &Vector1::new(output(k))), *observer.state())
    });
}

#[test]
fn linear_models() {
    let (transition, observation) = model();
    for copy in copies(&transition) {
        assert_eq!(copy, transition);
    }
    for copy in copies(&observation) {
        assert_eq!(copy, observation);
    }
}

#[test]
fn least_squares_and_delay_lines() {
    check(LeastSquares::<f32, Const<2>>::new(), |problem, k| {
        let added = problem.add(&Vector2::new(value(k) as f32, 1.0), value(2 * k) as f32);
        (added, problem.solve())
    });
    let lags: Lags<f64, Dyn, Dyn> = Lags::new(&ArxOrders { na: 2, inputs: INPUTS, constant: false }).unwrap();
    check(lags, |lags, k| {
        lags.push_inputs(&[value(k)]).unwrap();
        let regressor = lags.regressor().cloned();
        lags.push_output(output(k)).unwrap();
        regressor
    });
}

#[test]
fn what_is_not_a_snapshot_is_refused() {
    let covariance: Covariance<f64, Const<2>> = Covariance::from_diagonal(&Vector2::new(1.0, 2.0)).unwrap();
    let text = serde_json::to_string(&covariance).unwrap();
    assert_eq!(text, r#"{"version":1,"factor":[2,2,[1.0,0.0,0.0,2.0]]}"#);
    let read =
        |text: &str| serde_json::from_str::<Covariance<f64, Const<2>>>(text).map_err(|e| e.to_string());
    assert!(read(&text).is_ok());
    for bad in [
        r#"{"version":1,"factor":[2,2,[1.0,0.0,0.0]]}"#,
        r#"{"version":1,"factor":[2,2,[1.0,0.0,0.0,2.0,3.0]]}"#,
        r#"{"version":1,"factor":[3,3,[1,0,0,0,1,0,0,0,1]]}"#,
        r#"{"version":1,"factor":[2,2,[1.0,0.0,0.0,"many"]]}"#,
        r#"{"version":1,"factor":[2,2,[-1.0,0.0,0.0,2.0]]}"#,
        r#"{"version":1,"factor":[2,2,["NaN",0.0,0.0,2.0]]}"#,
        r#"{"version":1,"factor":[2,2,[1.0,0.5,0.0,2.0]]}"#,
        r#"{"version":1,"factor":[2,2]}"#,
        r#"{"version":1,"factor":[]}"#,
        r#"{"version":1,"factor":[2,2,[1e308,0.0,1e308,2.0]]}"#,
        r#"{}"#,
    ] {
        assert!(read(bad).is_err(), "{bad}");
    }
    let huge = r#"{"version":1,"factor":[4000000000,4000000000,[]]}"#;
    assert!(serde_json::from_str::<Covariance<f64, Dyn>>(huge).is_err());
}

/// An estimator, the paths of fields in its snapshot, and numbers that they must not hold.
fn refuses<E: Serialize + DeserializeOwned + Debug>(estimator: &E, cases: &[(&str, &[Value])]) {
    let whole = serde_json::to_value(estimator).expect("a snapshot");
    let read =
        |value: &Value| serde_json::from_str::<E>(&value.to_string()).map_err(|error| error.to_string());
    assert!(read(&whole).is_ok());
    for (path, bad) in cases {
        for bad in *bad {
            let mut tampered = whole.clone();
            *tampered.pointer_mut(path).expect(path) = bad.clone();
            assert!(read(&tampered).is_err(), "{path} = {bad}");
        }
    }
    let mut later = whole.clone();
    later["version"] = json!(7);
    let message = read(&later).expect_err("a later version");
    assert!(message.contains("of version 7, and version 1 is understood"), "{message}");
    let mut without = whole.clone();
    without.as_object_mut().expect("fields").remove("version");
    assert!(read(&without).expect_err("no version").contains("version"));
}

#[test]
fn what_no_constructor_makes_is_refused() {
    let numbers = &[json!("NaN"), json!("inf"), json!("many")][..];
    let (negative, nothing) = (&[json!(-1.0), json!("NaN")][..], &[json!(0.0), json!("NaN")][..]);

    let mut estimator =
        RecursiveLeastSquares::<f32, Const<2>>::new(&Vector2::repeat(1.0), Forgetting::default()).unwrap();
    for k in 0..20 {
        estimator.update(&Vector2::new(value(k) as f32, 1.0), output(k) as f32).unwrap();
    }
    let entries = &[json!("NaN"), json!("inf"), json!(6e37)][..];
    refuses(
        &estimator,
        &[
            ("/forgetting/Exponential/factor", &[json!(1.99), json!(0.1), json!(null), json!("NaN")]),
            ("/parameters/2/1", entries),
            ("/parameters/0", &[json!(3)]),
            ("/covariance/factor/2/0", entries),
            ("/covariance/factor/2/2", entries),
            ("/covariance/factor/2/3", negative),
            ("/bounds/2/0", &[json!(0.0), json!(-1.0), json!(1e-30), json!(6e37), json!("NaN")]),
            ("/residuals/mean_squares/2/0", negative),
            ("/residuals/weights", negative),
            ("/residuals/squared_weights", &[json!(-1.0), json!(1e6)]),
            ("/dead_zone", &[json!(-1.0), json!(null)]),
            ("/turn", &[json!(2), json!(-1)]),
            ("/phase", &[json!("Resting"), json!("Blending"), json!("Waiting")]),
            ("/covariance/version", &[json!(2)]),
        ],
    );
    let variable = Forgetting::Variable { factor: 0.95, minimum: 0.8, noise_variance: 0.1 };
    let estimator = RecursiveLeastSquares::<f64, Dyn>::new(&DVector::repeat(3, 1.0), variable).unwrap();
    refuses(
        &estimator,
        &[
            ("/forgetting/Variable/minimum", &[json!(0.99), json!(0.1)]),
            ("/forgetting/Variable/noise_variance", &[json!(0.0), json!(-1.0)]),
            ("/bounds", &[json!([2, 1, [100.0, 100.0]])]),
            (
                "/parameters",
                &[json!([2, 1, [0.0, 0.0]]), json!([3, 1, [0.0, 0.0]]), json!([3, 2, [0, 0, 0, 0, 0, 0]])],
            ),
            (
                "/covariance/factor",
                &[json!([2, 2, [1.0, 0.0, 0.0, 1.0]]), json!([1u64 << 40, 1u64 << 40, [1.0]])],
            ),
            ("/residuals/mean_squares", &[json!([1u64 << 60, 1, [0.0]]), json!([0, 1, []])]),
        ],
    );

    let orders = ArmaxOrders { na: 1, inputs: INPUTS, nc: 1, constant: false };
    let method = ArmaxMethod::PredictionError;
    let armax: RecursiveArmax<f64, Dyn, Dyn> =
        RecursiveArmax::new(&orders, method, 1.0, &[1.0], 0.1, Forgetting::default()).unwrap();
    refuses(
        &armax,
        &[
            (
                "/lags/lines/2/0",
                &[json!([3, 1, 2]), json!([1, 1, 2]), json!([0, 2, 2]), json!([0, 1, 3]), json!([0, 0, 0])],
            ),
            ("/lags/lines/2/1", &[json!([2, 1, 1]), json!([1, 1, 0]), json!([1, u64::MAX, 0])]),
            ("/lags/na", &[json!(0), json!(2), json!(u64::MAX)]),
            ("/lags/inputs", &[json!(0), json!(2)]),
            ("/lags/regressor/2/0", &[json!("inf")]),
            ("/lags/delayed", &[json!([1, 1, [0.0]]), json!([2, 1, [0.0, "-inf"]])]),
            ("/estimator/parameters/2/2", &[json!(1.5), json!("NaN")]),
            ("/gradients/2/4", numbers),
            ("/gradients", &[json!([2, 2, [0.0, 0.0, 0.0, 0.0]])]),
            ("/residual", &[json!(null), json!("NaN")]),
            ("/nc", &[json!(0), json!(2), json!(u64::MAX)]),
        ],
    );
    let orders = ArxOrders { na: 1, inputs: INPUTS, constant: false };
    let arx: RecursiveArx<f64, Dyn, Dyn> =
        RecursiveArx::new(&orders, 1.0, &[1.0], Forgetting::default()).unwrap();
    let other = serde_json::to_value(&armax).unwrap();
    refuses(&arx, &[("/lags", &[other["lags"].clone()]), ("/estimator", &[other["estimator"].clone()])]);
    refuses(
        arx.lags(),
        &[("/regressor", &[json!([3, 1, [0.0, 0.0, 0.0]])]), ("/outputs", &[json!(0), json!(2)])],
    );
    let several: RecursiveVectorArx<f64, Dyn, Dyn, Dyn> =
        RecursiveVectorArx::new(&orders, &DVector::repeat(2, 1.0), &[1.0], Forgetting::default()).unwrap();
    refuses(&several, &[("/lags", &[serde_json::to_value(arx.lags()).unwrap()])]);

    let prior = Covariance::new(&Matrix2::new(4.0, 1.0, 1.0, 2.0)).unwrap();
    let filter: KalmanFilter<f64, Const<2>> = KalmanFilter::new(Vector2::zeros(), prior.clone()).unwrap();
    let covariance = ("/covariance/factor/2/3", negative);
    refuses(&filter, &[("/state/2/0", numbers), ("/gate", nothing), covariance]);
    let dynamic = filter.to_size(Dyn(2)).unwrap();
    refuses(&dynamic, &[("/state", &[json!([3, 1, [0.0, 0.0, 0.0]])])]);
    let unscented = UnscentedKalmanFilter::from(filter.clone());
    refuses(&unscented, &[("/spread", &[json!(0.5), json!("NaN")]), ("/linear/state/2/0", numbers)]);
    let extended = ExtendedKalmanFilter::from(filter);
    refuses(&extended, &[("/iterations", &[json!(0)]), ("/linear/state/2/0", numbers)]);
    let bounded: ZonotopeFilter<f64, Const<2>, Const<9>> =
        ZonotopeFilter::new(Vector2::zeros(), &Vector2::new(9.0, 3.0), Const).unwrap();
    refuses(&bounded, &[("/centre/2/0", numbers), ("/generators/2/0", numbers), ("/used", &[json!(10)])]);
    refuses(&GainSchedule::new(prior), &[("/covariance/factor/2/0", negative)]);
    let (transition, observation) = model();
    let transition = transition.to_size(Dyn(2)).unwrap();
    refuses(
        &transition,
        &[
            ("/state_matrix/2/0", numbers),
            ("/state_matrix", &[json!([3, 3, [1, 0, 0, 0, 1, 0, 0, 0, 1]])]),
            ("/input_matrix", &[json!([3, 0, []]), json!([2, 1, [0.0, 0.0]])]),
            ("/noise/factor/2/3", negative),
        ],
    );
    let observation = observation.to_size(Dyn(2), Dyn(1)).unwrap();
    refuses(
        &observation,
        &[
            ("/output_rows/2/0", numbers),
            ("/output_rows", &[json!([1, 2, [1.0, 1.0]])]),
            ("/noise/factor/2/0", negative),
        ],
    );
    let observer: LuenbergerObserver<f64, Dyn, Dyn> =
        LuenbergerObserver::new(DVector::zeros(2), DMatrix::zeros(2, 1)).unwrap();
    refuses(
        &observer,
        &[("/state/2/0", numbers), ("/gain/2/1", numbers), ("/gain", &[json!([3, 1, [0.0, 0.0, 0.0]])])],
    );

    let detector = ChangeDetector::new(2.0, 3.0).unwrap();
    refuses(
        &detector,
        &[
            ("/mean_threshold", nothing),
            ("/variance_threshold", nothing),
            ("/mean_up/statistic", &[json!(-1.0), json!(2.5), json!(1.0)]),
            ("/variance/samples", &[json!(-1), json!(5)]),
        ],
    );
    let mut problem = LeastSquares::<f64, Const<2>>::new();
    problem.add(&Vector2::new(1.0, 2.0), 3.0).unwrap();
    refuses(
        &problem,
        &[
            ("/factor_rows/2/0/0", &[json!("NaN"), json!(1e300)]),
            ("/factor_rows/2/0/1", &[json!("NaN"), json!(7.0)]),
            ("/factor_rows/2/2/0", &[json!(1.0)]),
            ("/rotated_output/2/0/0", numbers),
            ("/residual_norm/0", &[json!(-1.0), json!("inf")]),
            ("/rows", &[json!(0), json!(-1)]),
            ("/uncompensated_rows", &[json!(2)]),
        ],
    );
}

/// Every number of a snapshot, one after the other, replaced: what is still read must not panic, nor stay deaf.
#[test]
fn a_tampered_number_is_refused_or_overcome() {
    fn numbers(value: &Value, path: &str, found: &mut Vec<String>) {
        match value {
            Value::Number(_) => found.push(path.to_owned()),
            Value::Array(parts) => {
                parts.iter().enumerate().for_each(|(k, part)| numbers(part, &format!("{path}/{k}"), found));
            }
            Value::Object(parts) => {
                parts.iter().for_each(|(key, part)| numbers(part, &format!("{path}/{key}"), found));
            }
            _ => {}
        }
    }
    fn check<E: Serialize + DeserializeOwned>(
        mut model: E,
        mut log_row: impl FnMut(&mut E, f32, &[f32]) -> Result<Innovation<f32>, Error>,
    ) {
        let mut row = |model: &mut E, k| log_row(model, output(k) as f32, &[value(k) as f32]);
        for k in 20..50 {
            row(&mut model, k).unwrap();
        }
        let whole = serde_json::to_value(&model).unwrap();
        let mut paths = vec![];
        numbers(&whole, "", &mut paths);
        // Those are settings: a wide dead zone is a legal one, and so are inputs without coefficients.
        paths.retain(|path| path != "/estimator/dead_zone" && path != "/lags/inputs");
        assert!(paths.len() > 50);
        let bad = [
            json!(0),
            json!(1),
            json!(7),
            json!(-1),
            json!(1.99),
            json!(6e37),
            json!(-6e37),
            json!(u64::MAX),
        ];
        let bad = bad.into_iter().chain([json!(1e-40), json!("NaN"), json!("inf"), json!(1_u64 << 40)]);
        let mut overcome = 0;
        for bad in bad {
            for path in &paths {
                let mut tampered = whole.clone();
                *tampered.pointer_mut(path).unwrap() = bad.clone();
                let read: Result<E, _> = serde_json::from_str(&tampered.to_string());
                let Ok(mut model) = read else { continue };
                let mut last = Action::NotReady;
                for k in 50..3000 {
                    if let Ok(innovation) = row(&mut model, k) {
                        last = innovation.action;
                    }
                }
                let heard = matches!(last, Action::Updated | Action::Capped | Action::Projected);
                assert!(heard, "{path} = {bad}: {last:?}");
                overcome += 1;
            }
        }
        assert!(overcome > 100, "{overcome}");
    }
    let orders = ArmaxOrders { na: 2, inputs: INPUTS, nc: 1, constant: false };
    let method = ArmaxMethod::PredictionError;
    let armax: RecursiveArmax<f32, Dyn, Dyn> =
        RecursiveArmax::new(&orders, method, 1.0, &[1.0], 0.1, Forgetting::default()).unwrap();
    check(armax, |armax, y, u| armax.log_row(y, u));
    for method in [OutputErrorMethod::PredictionError, OutputErrorMethod::Instruments] {
        let orders = ArxOrders { na: 2, inputs: INPUTS, constant: true };
        let model: RecursiveOutputError<f32, Dyn, Dyn> =
            RecursiveOutputError::new(&orders, method, 1.0, &[1.0], Forgetting::default()).unwrap();
        check(model, |model, y, u| model.log_row(y, u));
    }
}

/// Everything there is to an estimator.
fn text(estimator: &impl Serialize) -> String {
    serde_json::to_string(estimator).expect("text")
}

#[test]
fn a_size_of_another_type_keeps_every_bit() {
    let phi = |k| Vector3::new(value(k), value(3 * k), 1.0);
    for start in [RlsStart::Standard, RlsStart::Exact, RlsStart::Mixed { blend: 9 }] {
        let scales = DVector::repeat(3, 1.0);
        let dynamic = RecursiveLeastSquares::<f64, Dyn>::new(&scales, Forgetting::default()).unwrap();
        let mut dynamic = dynamic.with_start(start).unwrap().with_dead_zone(0.01).unwrap();
        for k in 0..40 {
            let mut fixed = dynamic.to_size(Const::<3>).unwrap();
            assert_eq!(text(&fixed), text(&dynamic));
            let answer = fixed.update(&phi(k), output(k));
            let row = DVector::from_column_slice(phi(k).as_slice());
            assert_eq!(format!("{answer:?}"), format!("{:?}", dynamic.update(&row, output(k))));
            assert_eq!(text(&fixed), text(&dynamic));
            assert_eq!(text(&fixed.to_size(Dyn(3)).unwrap()), text(&dynamic));
            let covariance = dynamic.parameter_covariance();
            let errors = covariance.map(|covariance| covariance.variances().map(f64::sqrt));
            assert_eq!(dynamic.standard_errors(), errors);
            assert_eq!(
                fixed.standard_errors().map(|errors| errors.as_slice().to_vec()),
                errors.map(|errors| errors.as_slice().to_vec())
            );
        }
        assert!(dynamic.standard_errors().is_some() && dynamic.standard_errors_of(1).is_none());
        assert!(dynamic.to_size(Const::<2>).is_err());
        dynamic.set_adaptation(false);
        assert_eq!(text(&dynamic.to_size(Const::<3>).unwrap()), text(&dynamic));
    }

    let (transition, observation) = model();
    let prior = Covariance::new(&Matrix2::new(4.0, 1.0, 1.0, 2.0)).unwrap();
    let filter = KalmanFilter::new(Vector2::new(0.5, -1.0), prior).unwrap().with_gate(9.0).unwrap();
    assert_eq!(text(&filter.to_size(Dyn(2)).unwrap()), text(&filter));
    assert_eq!(filter.to_size(Dyn(2)).unwrap().to_size(Const::<2>).unwrap(), filter);
    assert_eq!(text(&transition.to_size(Dyn(2)).unwrap()), text(&transition));
    assert_eq!(text(&observation.to_size(Dyn(2), Dyn(1)).unwrap()), text(&observation));
    assert!(filter.to_size(Const::<3>).is_err() && transition.to_size(Dyn(1)).is_err());
    assert!(observation.to_size(Dyn(3), Dyn(1)).is_err() && observation.to_size(Dyn(2), Dyn(2)).is_err());
    let mut entries = [0.0; 5];
    assert!(filter.covariance().write_into(&mut entries).is_err());
    filter.covariance().write_into(&mut entries[..4]).unwrap();
    assert_eq!(&entries[..4], filter.covariance().matrix().as_slice());
}

#[test]
fn an_error_is_written_with_its_words() {
    let error = Error::Length { argument: "state", expected: 2, found: 3 };
    let written = serde_json::to_value(error).expect("a value");
    assert_eq!(written, json!({ "Length": { "argument": "state", "expected": 2, "found": 3 } }));
}
