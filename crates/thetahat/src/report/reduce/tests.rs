use thetahat_numerics::noise::Noise;

use crate::data::Log;
use crate::model::Orders;
use crate::report::{Plan, Report, ValidationPlan, identify, validate};
use crate::tests::channel;
use crate::{Document, Error};

#[test]
fn a_reduced_report_goes_on_as_others_do() {
    let mut noise = Noise(2);
    let (mut u, mut y) = (Vec::new(), vec![0.0, 0.0]);
    for t in 0..400 {
        u.push(noise.uniform());
        if t > 1 {
            y.push(1.3 * y[t - 1] - 0.4 * y[t - 2] + u[t - 1] + 0.1 * noise.uniform());
        }
    }
    let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0).unwrap();
    let plan = Plan::new(&["u"], "y", Orders::arx(4, &[4], &[1]).unwrap());
    let report = identify(log.clone(), &[], &plan).unwrap();
    let values = report.hankel_singular_values().unwrap();
    assert!(values.len() == 4 && values.is_sorted_by(|a, b| a >= b));
    let (reduced, bound) = report.reduced(2).unwrap();
    assert!((bound - 2.0 * (values[2] + values[3])).abs() < 1e-9 * bound);
    let stored = Report::from_json(&reduced.to_json().unwrap()).unwrap();
    let percent = |report: &Report| {
        let found = validate(report, None, &log, &[], &ValidationPlan::default()).unwrap().validation;
        found.fit.iter().map(|fit| fit.percent.unwrap()).collect::<Vec<f64>>()
    };
    for (whole, less) in percent(&report).into_iter().zip(percent(&stored)) {
        assert!(less > whole - 5.0, "{whole} {less}");
    }
    assert!(reduced.warnings[0].contains("from 4 to 2 states"));
    assert!(matches!(report.reduced(9), Err(Error::Argument { .. })));
}
