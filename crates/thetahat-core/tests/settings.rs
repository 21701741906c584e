//! What is set while an estimator or a filter runs, behind a `&mut`, as from a static or a task of RTIC.

use std::sync::Mutex;

use thetahat_core::nalgebra::{Const, Matrix1, Matrix2, SVector, Vector1, Vector2, Vector3};
use thetahat_core::{
    Action, ArmaxMethod, ArmaxOrders, ArxOrders, ConstantOrders, Covariance, Error, ExtendedKalmanFilter,
    Forgetting, InputOrders, KalmanFilter, LinearObservation, LinearTransition, LuenbergerObserver,
    OutOfSequenceFilter, OutputErrorMethod, RecursiveArmax, RecursiveArx, RecursiveLeastSquares,
    RecursiveOutputError, RecursiveVectorArx, RlsStart,
};

const ORDERS: ArxOrders = ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };

type Plant = RecursiveArx<f32, Const<2>>;

fn plant() -> Result<Plant, Error> {
    Plant::new(&ORDERS, 1.0, &[1.0], Forgetting::None)
}

/// Goes on from the last output and input; returns these.
fn drive(
    plant: &mut Plant,
    (mut y, mut u): (f32, f32),
    gain: f32,
    samples: usize,
) -> Result<(f32, f32), Error> {
    for k in 0..samples {
        y = 0.8 * y + gain * u;
        plant.measured(y)?;
        u = if k % 7 < 3 { 1.0 } else { -1.0 };
        plant.applied(&[u])?;
    }
    Ok((y, u))
}

struct Shared {
    arx: Plant,
    filter: KalmanFilter<f32, Const<2>>,
}

fn repaired(shared: &mut Shared) -> Result<(), Error> {
    shared.arx.set_covariance(Covariance::from_diagonal(&Vector2::new(100.0, 100.0))?)?;
    shared.filter.set_state(Vector2::new(1.0, 0.0))?;
    shared.filter.set_covariance(Covariance::from_diagonal(&Vector2::new(0.01, 0.0))?)?;
    shared.filter.set_gate(9.0)
}

#[test]
fn a_repaired_plant_is_learnt_again_behind_a_reference() -> Result<(), Error> {
    let prior = Covariance::from_diagonal(&Vector2::new(9.0, 9.0))?;
    let mut shared = Shared { arx: plant()?, filter: KalmanFilter::new(Vector2::zeros(), prior)? };
    let last = drive(&mut shared.arx, (0.0, 0.0), 0.5, 2000)?;
    let untouched = shared.arx.clone();
    repaired(&mut shared)?;
    assert_eq!(*shared.filter.state(), Vector2::new(1.0, 0.0));
    assert_eq!(shared.filter.covariance().variances(), Vector2::new(0.01, 0.0));
    assert_eq!(shared.filter.gate(), 9.0);
    // The repaired plant has another gain.
    let error = |mut arx: Plant| -> Result<f32, Error> {
        drive(&mut arx, last, 0.9, 30)?;
        Ok((arx.estimator().parameters()[1] - 0.9).abs())
    };
    assert!(error(untouched)? > 0.3);
    assert!(error(shared.arx)? < 1e-3);
    Ok(())
}

#[test]
fn what_is_set_is_what_is_built() -> Result<(), Error> {
    let parameters = Vector2::new(-0.8, 0.5);
    let covariance = Covariance::<f32, Const<2>>::new(&Matrix2::new(0.25, 0.125, 0.125, 0.5))?;
    let built = plant()?
        .with_parameters(parameters)?
        .with_covariance(covariance.clone())?
        .with_noise_variance(0.5, 40)?
        .with_dead_zone(0.125)?;
    let mut set = plant()?;
    set.set_parameters(parameters)?;
    set.set_covariance(covariance.clone())?;
    set.set_noise_variance(0.5, 40)?;
    set.set_dead_zone(0.125)?;
    assert_eq!(format!("{built:?}"), format!("{set:?}"));

    let filter = KalmanFilter::new(parameters, covariance.clone())?;
    let mut set = ExtendedKalmanFilter::new(Vector2::zeros(), Covariance::zero(Const))?;
    set.set_state(parameters)?;
    set.set_covariance(covariance)?;
    set.set_gate(4.0)?;
    set.set_release(3);
    set.set_iterations(2)?;
    let built = ExtendedKalmanFilter::from(filter.with_gate(4.0)?.with_release(3)).with_iterations(2)?;
    assert_eq!(set, built);
    Ok(())
}

#[test]
fn widening_shrinks_nothing() -> Result<(), Error> {
    let given = Matrix2::new(4.0, 1.0, 1.0, 2.0);
    let prior = Covariance::<f64, Const<2>>::new(&given)?;
    let held = Covariance::from_diagonal(&Vector2::new(0.0, 3.0))?;
    let mut filter = KalmanFilter::new(Vector2::zeros(), prior)?;
    filter.widen(1.0)?;
    assert!((filter.covariance().matrix() - given).amax() < 1e-15);
    filter.widen(10.0)?;
    assert!((filter.covariance().matrix() - 10.0 * given).amax() < 1e-14);
    filter.widen_by(&held)?;
    assert!((filter.covariance().matrix() - Matrix2::new(40.0, 10.0, 10.0, 23.0)).amax() < 1e-14);

    let new = || RecursiveLeastSquares::<f64, Const<2>>::new(&Vector2::new(1.0, 1.0), Forgetting::None);
    let mut estimator = new()?.with_covariance(held.clone())?;
    estimator.widen(7.0)?;
    assert_eq!(estimator.covariance().variances(), Vector2::new(0.0, 21.0));
    estimator.widen_by(&held)?;
    assert_eq!(estimator.covariance().variances(), Vector2::new(0.0, 24.0));

    // With an exact start the prior is still in P: it ends there, and the estimate goes on from what it is.
    let mut estimator = new()?.with_start(RlsStart::Exact)?;
    estimator.update(&Vector2::new(0.0, 1.0), 2.0)?;
    estimator.widen(2.0)?;
    for k in 0..20 {
        let u = f64::from(k % 3);
        let innovation = estimator.update(&Vector2::new(u, 1.0), 3.0 * u + 2.0)?;
        assert_eq!(innovation.action, Action::Updated);
    }
    assert!((estimator.parameters() - Vector2::new(3.0, 2.0)).amax() < 1e-5);
    Ok(())
}

#[test]
fn what_is_refused_changes_nothing() -> Result<(), Error> {
    let mut arx = plant()?;
    drive(&mut arx, (0.0, 0.0), 0.5, 50)?;
    let before = format!("{arx:?}");
    assert!(matches!(
        arx.set_parameters(Vector2::new(f32::NAN, 0.0)),
        Err(Error::NotFinite { argument: "parameters" })
    ));
    let huge = Covariance::from_diagonal(&Vector2::new(1e30, 1.0))?;
    assert!(matches!(arx.set_covariance(huge.clone()), Err(Error::TooLarge { argument: "covariance" })));
    assert!(matches!(arx.widen_by(&huge), Err(Error::TooLarge { argument: "covariance" })));
    assert!(matches!(arx.widen(1e30), Err(Error::TooLarge { argument: "covariance" })));
    for factor in [0.99, -1.0, f32::NAN, f32::INFINITY] {
        assert!(matches!(arx.widen(factor), Err(Error::OutOfRange { argument: "factor", .. })));
    }
    assert!(matches!(arx.set_noise_variance(1.0, 2), Err(Error::TooFewRows { .. })));
    assert!(matches!(arx.set_dead_zone(-1.0), Err(Error::OutOfRange { argument: "width", .. })));
    assert_eq!(format!("{arx:?}"), before);

    let mut filter = ExtendedKalmanFilter::new(Vector1::new(1.0f32), Covariance::zero(Const))?;
    filter.set_covariance(Covariance::from_diagonal(&Vector1::new(1e30))?)?;
    let before = filter.clone();
    assert!(matches!(filter.set_state(Vector1::new(f32::NAN)), Err(Error::NotFinite { argument: "state" })));
    assert!(matches!(filter.set_gate(0.0), Err(Error::OutOfRange { argument: "gate", .. })));
    assert!(matches!(filter.set_gate(f32::NAN), Err(Error::OutOfRange { argument: "gate", .. })));
    assert!(matches!(filter.set_iterations(0), Err(Error::OutOfRange { argument: "iterations", .. })));
    assert_eq!(filter.widen(1e30), Err(Error::Overflow));
    assert!(matches!(filter.widen(0.5), Err(Error::OutOfRange { argument: "factor", .. })));
    assert_eq!(filter, before);
    Ok(())
}

#[test]
fn unstable_parameters_are_refused_whole() -> Result<(), Error> {
    let orders = ArmaxOrders { na: 1, inputs: ORDERS.inputs, nc: 1, constant: false };
    let mut armax: RecursiveArmax<f64, Const<3>> =
        RecursiveArmax::new(&orders, ArmaxMethod::PredictionError, 1.0, &[1.0], 0.1, Forgetting::default())?;
    let before = format!("{armax:?}");
    let unstable = armax.set_parameters(Vector3::new(-0.8, 0.5, 1.5));
    assert!(matches!(unstable, Err(Error::OutOfRange { argument: "parameters", .. })));
    assert_eq!(format!("{armax:?}"), before);
    armax.set_parameters(Vector3::new(-0.8, 0.5, 0.5))?;

    let mut model: RecursiveOutputError<f64, Const<2>> = RecursiveOutputError::new(
        &ORDERS,
        OutputErrorMethod::PredictionError,
        1.0,
        &[1.0],
        Forgetting::default(),
    )?;
    let before = format!("{model:?}");
    let unstable = model.set_parameters(Vector2::new(-1.5, 0.5));
    assert!(matches!(unstable, Err(Error::OutOfRange { argument: "parameters", .. })));
    assert_eq!(format!("{model:?}"), before);
    model.set_parameters(Vector2::new(-0.5, 0.5))?;
    Ok(())
}

#[test]
fn a_state_that_is_set_lets_the_gate_begin_anew() -> Result<(), Error> {
    let one = |value: f64| Covariance::<f64, Const<1>>::from_diagonal(&Vector1::new(value));
    let gauge = LinearObservation::new(Matrix1::new(1.0), one(1.0)?)?;
    let none = SVector::zeros();
    let mut filter = KalmanFilter::new(Vector1::new(0.0), one(1.0)?)?.with_gate(9.0)?.with_release(2);
    for _ in 0..2 {
        assert_eq!(filter.correct(&gauge, &none, &Vector1::new(100.0))?.action, Action::Gated);
    }
    filter.set_state(Vector1::new(99.0))?;
    assert_eq!(filter.gated_in_a_row(), 0);
    assert_eq!(filter.correct(&gauge, &none, &Vector1::new(100.0))?.action, Action::Updated);
    Ok(())
}

#[test]
fn a_late_measurement_does_not_undo_a_change() -> Result<(), Error> {
    let one = |value: f64| Covariance::<f64, Const<1>>::from_diagonal(&Vector1::new(value));
    let drift = LinearTransition::new(Matrix1::new(1.0), one(0.01)?)?;
    let both =
        LinearObservation::new(Vector2::new(1.0, 1.0), Covariance::from_diagonal(&Vector2::new(1.0, 0.01))?)?;
    let filter = ExtendedKalmanFilter::new(Vector1::new(0.0), one(4.0)?)?;
    let mut tank: OutOfSequenceFilter<f64, _, Const<2>, Const<0>, Const<20>> =
        OutOfSequenceFilter::new(filter, Const, Const, 3)?;
    let none = SVector::zeros();
    for _ in 0..3 {
        tank.correct(&both, &none, &Vector2::new(1.0, f64::NAN))?;
        tank.predict(&drift, &none)?;
    }
    let before = format!("{tank:?}");
    let refused = tank.change(|filter| {
        filter.set_state(Vector1::new(20.0))?;
        filter.set_gate(-1.0)
    });
    assert!(matches!(refused, Err(Error::OutOfRange { argument: "gate", .. })));
    assert_eq!(format!("{tank:?}"), before);

    tank.change(|filter| filter.set_state(Vector1::new(20.0)))?;
    let late = tank.correct_late(&drift, &both, 1, &Vector2::new(f64::NAN, 1.0));
    assert!(matches!(late, Err(Error::OutOfRange { argument: "age", .. })));
    // From here it is as a new one around the changed filter.
    let mut new: OutOfSequenceFilter<f64, _, Const<2>, Const<0>, Const<20>> =
        OutOfSequenceFilter::new(tank.filter().clone(), Const, Const, 3)?;
    for tank in [&mut tank, &mut new] {
        tank.correct(&both, &none, &Vector2::new(20.5, f64::NAN))?;
        tank.predict(&drift, &none)?;
        tank.correct_late(&drift, &both, 1, &Vector2::new(f64::NAN, 20.1))?;
    }
    assert_eq!(tank.filter(), new.filter());
    Ok(())
}

#[test]
fn an_observer_is_set_and_refuses_whole() -> Result<(), Error> {
    let mut observer =
        LuenbergerObserver::<f64, Const<2>, Const<1>>::new(Vector2::zeros(), Vector2::zeros())?;
    observer.set_state(Vector2::new(1.0, 2.0))?;
    observer.set_gain(Vector2::new(0.5, 0.25))?;
    assert_eq!(observer, LuenbergerObserver::new(Vector2::new(1.0, 2.0), Vector2::new(0.5, 0.25))?);
    let before = observer.clone();
    assert!(observer.set_state(Vector2::new(f64::INFINITY, 0.0)).is_err());
    assert!(observer.set_gain(Vector2::new(f64::NAN, 0.0)).is_err());
    assert_eq!(observer, before);
    Ok(())
}

#[cfg(feature = "alloc")]
#[test]
fn a_wrong_size_is_refused_whole() -> Result<(), Error> {
    use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};
    let mut filter = KalmanFilter::new(DVector::from_element(2, 0.0), Covariance::<f64, Dyn>::zero(Dyn(2)))?;
    let before = filter.clone();
    let length = |result: Result<(), Error>| matches!(result, Err(Error::Length { .. }));
    assert!(length(filter.set_state(DVector::from_element(3, 0.0))));
    assert!(length(filter.set_covariance(Covariance::zero(Dyn(3)))));
    assert!(length(filter.widen_by(&Covariance::zero(Dyn(1)))));
    assert_eq!(filter, before);
    let mut estimator: RecursiveLeastSquares<f64, Dyn> =
        RecursiveLeastSquares::new(&DVector::from_element(2, 1.0), Forgetting::None)?;
    assert!(length(estimator.set_parameters(DVector::from_element(1, 0.0))));
    assert!(length(estimator.set_covariance(Covariance::zero(Dyn(1)))));
    assert!(length(estimator.widen_by(&Covariance::zero(Dyn(1)))));
    let mut observer =
        LuenbergerObserver::<f64, Dyn, Dyn>::new(DVector::from_element(2, 0.0), DMatrix::zeros(2, 1))?;
    assert!(length(observer.set_state(DVector::from_element(1, 0.0))));
    assert!(length(observer.set_gain(DMatrix::zeros(1, 2))));
    Ok(())
}

const NOTHING: [Result<Covariance<f32, Const<1>>, Error>; 2] =
    [Covariance::<f32, _>::constant([-1.0]), Covariance::<f32, _>::constant([f32::INFINITY])];

const TANK: Result<KalmanFilter<f64, Const<2>>, Error> = match Covariance::<f64, _>::constant([4.0, 0.0]) {
    Ok(prior) => KalmanFilter::<f64, _>::constant([20.0, 1.0], prior),
    Err(error) => Err(error),
};

#[test]
fn a_constant_is_what_is_built_at_run_time() -> Result<(), Error> {
    assert_eq!(NOTHING[0], Err(Error::Negative { argument: "variances" }));
    assert_eq!(NOTHING[1], Err(Error::NotFinite { argument: "variances" }));
    let prior = Covariance::from_diagonal(&Vector2::new(4.0, 0.0))?;
    assert_eq!(TANK?, KalmanFilter::new(Vector2::new(20.0, 1.0), prior.clone())?);
    let refused = KalmanFilter::<f64, _>::constant([f64::NAN, 0.0], prior);
    assert_eq!(refused, Err(Error::NotFinite { argument: "state" }));
    static EXTENDED: Mutex<Option<ExtendedKalmanFilter<f64, Const<2>>>> = Mutex::new(match TANK {
        Ok(tank) => Some(ExtendedKalmanFilter::around(tank)),
        Err(_) => None,
    });
    let mut extended = EXTENDED.lock().expect("no thread has panicked");
    extended.as_mut().expect("a filter").set_state(Vector2::new(21.0, 0.0))
}

struct Orders;

impl ConstantOrders for Orders {
    const ORDERS: ArxOrders<'static> = ORDERS;
}

impl ConstantOrders<ArmaxOrders<'static>> for Orders {
    const ORDERS: ArmaxOrders<'static> = ArmaxOrders { na: 1, inputs: ORDERS.inputs, nc: 1, constant: false };
}

#[test]
fn constant_orders_make_what_orders_at_run_time_make() -> Result<(), Error> {
    let policy = Forgetting::default();
    let made: Plant = RecursiveArx::of::<Orders>(5.0, &[2.0], policy)?;
    assert_eq!(format!("{made:?}"), format!("{:?}", Plant::new(&ORDERS, 5.0, &[2.0], policy)?));
    let method = ArmaxMethod::PredictionError;
    let armax: RecursiveArmax<f32, Const<3>> =
        RecursiveArmax::of::<Orders>(method, 5.0, &[2.0], 0.1, policy)?;
    assert_eq!(armax.c().count(), 2);
    let method = OutputErrorMethod::PredictionError;
    let model: RecursiveOutputError<f32, Const<2>> =
        RecursiveOutputError::of::<Orders>(method, 5.0, &[2.0], policy)?;
    assert_eq!(model.f().count(), 2);
    let outputs: RecursiveVectorArx<f32, Const<3>, Const<2>> =
        RecursiveVectorArx::of::<Orders>(&Vector2::new(5.0, 1.0), &[2.0], policy)?;
    assert_eq!(outputs.estimator().parameters().shape(), (3, 2));
    // What is no constant is checked when it runs.
    assert!(Plant::of::<Orders>(5.0, &[], policy).is_err());
    Ok(())
}
