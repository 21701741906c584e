//! Local models and nearest neighbours.

use super::*;
use crate::model::Membership;

/// y(t) = 0.6 y(t-1) + |u(t-1)| + e(t): two planes, side by side.
fn folded(rows: usize, spread: f64) -> Log {
    let mut noise = Noise(11);
    let u = noise.take(rows);
    let mut y = vec![0.0];
    for t in 1..rows {
        let e: f64 = noise.take(12).iter().sum();
        y.push(0.6 * y[t - 1] + u[t - 1].abs() + 0.5 * spread * e);
    }
    Log::new(vec![channel("u", u), channel("y", y)], 1.0).unwrap()
}

fn local(membership: Membership, units: Option<usize>) -> NonlinearArxPlan {
    NonlinearArxPlan {
        map: MapPlan::Local { membership, planes: true, units },
        output_lags: vec![1],
        input_lags: vec![InputLags { lags: 1, delay: 1 }],
        detrend: Detrend::None,
        ..plan()
    }
}

/// Boxes are cut in half: with a symmetric range the first cut is the fold, and least squares finds both planes.
#[test]
fn a_fold_is_two_planes() {
    let mut log = folded(400, 0.0);
    // The range of u is -1 … 1.
    let mut channels = ["u", "y"].map(|name| log.channel(name).unwrap().clone()).to_vec();
    channels[0].values[5] = 1.0;
    channels[0].values[6] = -1.0;
    for t in 6..400 {
        channels[1].values[t] = 0.6 * channels[1].values[t - 1] + channels[0].values[t - 1].abs();
    }
    log = Log::new(channels, 1.0).unwrap();
    let report = fit_nonlinear_arx(&log, &[], &local(Membership::Rectangle, Some(2))).unwrap();
    let own = model(&report);
    let Map::Local { boxes, .. } = &own.maps[0].functions else { panic!("another map") };
    assert!(boxes[0][1][1].abs() < 1e-12 && boxes[1][1][0].abs() < 1e-12, "{boxes:?}");
    assert!(own.noise_covariance[0][0] < 1e-24, "{}", own.noise_covariance[0][0]);
    let slope = |place: usize| {
        let z = &own.regressors[1];
        own.parameters[place].value * own.maps[0].scale / z.scale
    };
    assert!((slope(2) + 1.0).abs() < 1e-10 && (slope(5) - 1.0).abs() < 1e-10);
    assert!(matches!(report.estimation.procedure, Procedure::Splits(_)));
    let outcome = &report.estimation.procedure.terms()[0];
    assert_eq!((outcome.taken, outcome.path.len()), (2, 2));
    assert_eq!(outcome.path[0].term, "plane");
    assert!(outcome.path[1].term.starts_with("split(u(k-1), "), "{}", outcome.path[1].term);
}

/// Each way to choose their number finds more than one local model, and MDL, which asks most of a parameter, fewer than
/// are looked at.
#[test]
fn their_number_is_chosen() {
    let log = folded(600, 0.2);
    for (select, validate) in [
        (None, vec![]),
        (None, vec![Rows::new(401, 600).unwrap()]),
        (Some(Select::Criterion(crate::estimate::InformationCriterion::MDL)), vec![]),
    ] {
        let estimate = if validate.is_empty() { vec![] } else { vec![Rows::new(1, 400).unwrap()] };
        for membership in [Membership::Rectangle, Membership::Trapezoid, Membership::Gaussian] {
            let plan = NonlinearArxPlan {
                select,
                validate: validate.clone(),
                estimate: estimate.clone(),
                ..local(membership, None)
            };
            let report = fit_nonlinear_arx(&log, &[], &plan).unwrap();
            let outcome = &report.estimation.procedure.terms()[0];
            let most = if select.is_some() { 9 } else { 10 };
            assert!((2..=most).contains(&outcome.taken), "{membership:?} {select:?}: {}", outcome.taken);
            assert_eq!(outcome.last().unwrap().parameters, report.model.parameters().len());
            assert!(report.model.parameters().iter().all(|one| one.standard_error.is_some()));
        }
    }
}

#[test]
fn neighbours_are_evaluated_without_themselves() {
    let log = folded(400, 0.1);
    for planes in [false, true] {
        let plan = NonlinearArxPlan {
            map: MapPlan::Neighbours { planes, units: None },
            estimate: vec![Rows::new(1, 300).unwrap()],
            validate: vec![Rows::new(301, 400).unwrap()],
            ..local(Membership::Gaussian, None)
        };
        let report = fit_nonlinear_arx(&log, &[], &plan).unwrap();
        assert!(matches!(report.estimation.procedure, Procedure::Neighbours(_)));
        let outcome = &report.estimation.procedure.terms()[0];
        let Map::Neighbours { count, points, .. } = &model(&report).maps[0].functions else {
            panic!("another map")
        };
        assert_eq!((points.len(), outcome.path.len()), (299, 10));
        assert_eq!(outcome.last().unwrap().term, format!("{count} neighbours"));
        // One neighbour would be the sample itself, were its block not left out.
        assert!(outcome.path[0].rmse > 0.1, "{:?}", outcome.path[0]);
        let best = outcome.last().unwrap().held_out.unwrap().rmse.unwrap();
        let each = outcome.path.iter().filter_map(|step| step.held_out.unwrap().rmse);
        assert!(each.fold(f64::INFINITY, f64::min) == best);
        let spread = model(&report).noise_covariance[0][0].sqrt();
        let fresh = report.fit.iter().find(|fit| fit.part == Some(Part::Validation)).unwrap().rmse.unwrap();
        assert!((spread / fresh - 1.0).abs() < 0.15, "{spread} {fresh}");
    }
}

#[test]
fn what_they_cannot_be_is_refused() {
    let log = folded(60, 0.1);
    let refused = |plan: NonlinearArxPlan, what: &str| {
        assert_refused(fit_nonlinear_arx(&log, &[], &plan), what);
    };
    let neighbours = |units, planes| NonlinearArxPlan {
        map: MapPlan::Neighbours { planes, units },
        ..local(Membership::Gaussian, None)
    };
    refused(neighbours(Some(0), true), "units");
    refused(neighbours(Some(59), true), "59 neighbours of 59 samples");
    refused(neighbours(Some(65), true), "from 1 to 58");
    refused(NonlinearArxPlan { ridge: Some(1.0), ..neighbours(None, true) }, "ridge");
    refused(NonlinearArxPlan { most: Some(3), ..neighbours(None, true) }, "most-terms");
    refused(NonlinearArxPlan { output_lags: vec![40], ..neighbours(None, true) }, "32 regressors");
    let criterion = Select::Criterion(crate::estimate::InformationCriterion::AIC);
    refused(NonlinearArxPlan { select: Some(criterion), ..neighbours(None, true) }, "information criteria");
    refused(NonlinearArxPlan { select: Some(criterion), ..neighbours(Some(3), true) }, "select");
    refused(local(Membership::Gaussian, Some(0)), "units");
    refused(local(Membership::Gaussian, Some(1000)), "1000 local models are asked for");
    refused(NonlinearArxPlan { terms: Some(3), ..local(Membership::Gaussian, None) }, "terms");
    refused(
        NonlinearArxPlan {
            output_lags: vec![25],
            estimate: vec![Rows::new(1, 40).unwrap()],
            ..local(Membership::Gaussian, None)
        },
        "one local model needs 28 samples",
    );
}
