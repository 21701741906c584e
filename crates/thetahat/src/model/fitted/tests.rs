use thetahat_numerics::noise::Noise;

use super::*;
use crate::data::{Offset, Record};
use crate::estimate::{Initial, arx};

/// The model fitted to data that ARX with these parameters made without noise.
fn fitted(a: &[f64], b: &[f64]) -> PolynomialModel {
    let mut noise = Noise(1);
    let u = noise.take(100);
    let mut y = vec![0.0; 100];
    for t in 0..100 {
        let past: f64 = (1..=t).zip(a).map(|(lag, a)| a * y[t - lag]).sum();
        y[t] = (1..=t).zip(b).map(|(lag, b)| b * u[t - lag]).sum::<f64>() - past;
    }
    let orders = Orders::arx(a.len(), &[b.len()], &[1]).unwrap();
    let estimate = arx(&Record::new(&y, vec![&u]).unwrap(), &orders, Initial::Drop).unwrap();
    let signal = |name: &str| Signal { name: name.to_owned(), offset: Offset::default() };
    estimate.to_model(&orders, 0.5, vec![signal("u")], signal("y")).unwrap()
}

#[test]
fn poles_zeros_and_gains_are_those_of_the_polynomials() {
    // (1 - 0.8 q^-1)(1 - 0.5 q^-1) and 2 q^-1 (1 + 3 q^-1).
    let model = fitted(&[-1.3, 0.4], &[2.0, 6.0]);
    let near = |found: f64, expected: f64| (found - expected).abs() < 1e-12;
    assert_eq!((model.a.len(), model.b[0].len(), model.b[0][0]), (3, 3, 0.0));
    assert!(near(model.poles[0].re, 0.8) && near(model.poles[1].re, 0.5) && model.stable);
    assert!(model.zeros[0].len() == 1 && near(model.zeros[0][0].re, -3.0));
    assert!(near(model.dc_gain[0].unwrap().value, 80.0));
    assert!(near(model.time_constants[0].unwrap().value, -0.5 / 0.8_f64.ln()));
}

#[test]
fn an_integrator_has_no_gain_and_an_unstable_pole_no_time_constant() {
    assert_eq!(fitted(&[-1.0], &[1.0]).dc_gain, [None]);
    let unstable = fitted(&[-1.3], &[1.0]);
    assert!(!unstable.stable && unstable.time_constants == [None]);
}

#[test]
fn a_covariance_that_cannot_be_is_unknown() {
    let orders = Orders::arx(1, &[1], &[1]).unwrap();
    let model = |covariance: [[f64; 2]; 2]| {
        let rows = covariance.map(Vec::from).to_vec();
        PolynomialModel::from_parameters(&orders, &[-0.5, 1.0], Some(&rows), 1.0, 1.0).unwrap()
    };
    let errors = |model: &PolynomialModel| {
        let quantities = model.dc_gain.iter().chain(&model.time_constants).flatten();
        let derived = quantities.map(|quantity| quantity.standard_error);
        let roots = model.poles.iter().map(|root| root.covariance.map(|rows| rows[0][0]));
        let own = model.parameters.iter().map(|parameter| parameter.standard_error);
        own.chain(derived).chain(roots).collect::<Vec<_>>()
    };
    // A variance below zero, none at all, and a correlation above 1.
    for wrong in [[[-1e-9, 0.0], [0.0, 1.0]], [[f64::NAN, 0.0], [0.0, 1.0]], [[1.0, 1.1], [1.1, 1.0]]] {
        let model = model(wrong);
        assert_eq!(model.covariance, None);
        assert!(errors(&model).iter().all(Option::is_none), "{model:?}");
    }
    // Two that move together, and one that is certain.
    for right in [[[1.0, 1.0], [1.0, 1.0]], [[0.0, 0.0], [0.0, 1.0]]] {
        let model = model(right);
        assert!(model.covariance.is_some() && errors(&model).iter().all(Option::is_some), "{model:?}");
    }
}

#[test]
fn a_damaged_model_is_refused() {
    let good = fitted(&[-0.5], &[1.0, 2.0]);
    assert!(good.check().is_ok());
    let open = |model: &mut PolynomialModel, rows: usize| {
        let covariance = vec![vec![1.0; rows]; rows];
        model.offset_covariance = Some(OffsetCovariance { covariance, middle: None });
    };
    let mut right = good.clone();
    open(&mut right, 4);
    assert!(right.check().is_ok());
    open(&mut right, 3);
    assert!(right.check().is_err());
    let damages: [fn(&mut PolynomialModel); 13] = [
        |model| model.orders.na = usize::MAX,
        |model| model.orders.nk = vec![usize::MAX],
        |model| model.orders.nc = usize::MAX,
        |model| model.orders.nb = vec![1, 1],
        |model| model.a = vec![2.0, 0.5],
        |model| model.b[0][1] = f64::NAN,
        |model| model.f = vec![],
        |model| model.b[0][0] = 1.0,
        |model| model.output.name = "u".to_owned(),
        |model| model.sample_time = 0.0,
        |model| model.noise_variance = -1.0,
        |model| model.covariance = Some(vec![]),
        |model| model.covariance.iter_mut().flatten().for_each(|row| row.truncate(2)),
    ];
    for damage in damages {
        let mut model = good.clone();
        damage(&mut model);
        assert!(matches!(model.check(), Err(Error::Report { .. })));
    }
}
