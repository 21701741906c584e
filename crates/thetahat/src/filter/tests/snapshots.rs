use thetahat_core::nalgebra::Complex;

use super::{FLOW, NILE, filter};
use crate::filter::{Estimator, FilterSnapshot, ObserverGain, StateFilter};
use crate::model::equations::tests::CART;

/// The same through JSON.
fn kept(filter: &StateFilter) -> FilterSnapshot {
    serde_json::from_str(&serde_json::to_string(&filter.snapshot()).unwrap()).unwrap()
}

#[test]
fn a_filter_that_resumes_goes_on_to_the_bit() {
    let observer = || Estimator::Luenberger(ObserverGain::Poles(vec![Complex::new(0.5, 0.0)]));
    for estimator in [Estimator::Kalman, Estimator::Extended, observer()] {
        let mut whole = filter(NILE, estimator.clone());
        for (row, flow) in FLOW.into_iter().enumerate() {
            let mut resumed = filter(NILE, estimator.clone()).resumed(kept(&whole)).unwrap();
            assert_eq!(format!("{:?}", resumed.latest()), format!("{:?}", whole.latest()));
            let flow = if row == 3 { f64::NAN } else { flow };
            let step = if row == 7 { Some(3.0) } else { None };
            let again = format!("{:?}", resumed.step(step, &[], &[flow]).unwrap());
            assert_eq!(again, format!("{:?}", whole.step(step, &[], &[flow]).unwrap()));
            assert_eq!(resumed.summary(), whole.summary());
        }
    }
}

#[test]
fn unknown_parameters_go_on_too() {
    let mut whole = filter(CART, Estimator::Extended);
    let inputs = vec![0.5; whole.model().inputs().len()];
    let outputs = vec![0.1; whole.model().outputs().len()];
    whole.step(None, &inputs, &outputs).unwrap();
    let mut resumed = filter(CART, Estimator::Extended).resumed(kept(&whole)).unwrap();
    let again = format!("{:?}", resumed.step(None, &inputs, &outputs).unwrap());
    assert_eq!(again, format!("{:?}", whole.step(None, &inputs, &outputs).unwrap()));
}

#[test]
fn a_snapshot_of_another_filter_is_refused() {
    let mut nile = filter(NILE, Estimator::Kalman);
    nile.step(None, &[], &[1.0]).unwrap();
    assert!(filter(CART, Estimator::Extended).resumed(nile.snapshot()).is_err());
    assert!(filter(NILE, Estimator::Extended).resumed(nile.snapshot()).is_err());
    let damaged = serde_json::to_string(&nile.snapshot()).unwrap().replace("\"rows\":1", "\"rows\":0");
    let damaged: FilterSnapshot = serde_json::from_str(&damaged).unwrap();
    assert!(filter(NILE, Estimator::Kalman).resumed(damaged).is_err());
}
