//! Trackers of several outputs.

use thetahat_core::nalgebra::{Dyn, Vector2};
use thetahat_core::{ArxOrders, InputOrders, RecursiveVectorArx};

use super::*;

type Rows = Vec<(Vector2<f64>, f64)>;

/// A log of two outputs that feed each other, and an input with a delay of 2; e uniform in -size … size.
fn rows(count: usize, size: f64) -> Rows {
    let mut noise = Noise(41);
    let mut rows: Rows = Vec::new();
    for t in 0..count {
        let y = |lag: usize| t.checked_sub(lag).map_or(Vector2::zeros(), |at| rows[at].0);
        let u = |lag: usize| t.checked_sub(lag).map_or(0.0, |at| rows[at].1);
        let (first, second) = (y(1), y(2));
        let next = Vector2::new(
            1.2 * first[0] - 0.5 * second[0] - 0.1 * first[1] + 0.4 * u(2) + size * noise.uniform(),
            0.2 * first[0] - 0.1 * second[0] + 0.9 * first[1] - 0.3 * second[1] - 0.2 * u(3)
                + size * noise.uniform(),
        );
        rows.push((next, 2.0 * noise.uniform()));
    }
    rows
}

fn orders() -> Result<Orders, Error> {
    Orders::arx(2, &[2], &[2])
}

fn pair(plan: &TrackPlan) -> Result<[Tracker; 2], Error> {
    Ok([Tracker::coupled(&orders()?, 2, plan)?, Tracker::coupled(&orders()?, 2, plan)?])
}

fn take(trackers: &mut [Tracker], (y, u): &(Vector2<f64>, f64)) -> Result<Vec<Tracked>, Error> {
    let each = trackers.iter_mut().enumerate();
    each.map(|(place, tracker)| tracker.log_row_of(place, y.as_slice(), &[*u])).collect()
}

/// Where nothing is missing, it is the estimator of all outputs in one, whose equations share P.
#[test]
fn it_is_the_recursion_of_all_outputs() -> Result<(), Error> {
    let scales = PerChannel { inputs: vec![3.0, 2.0, 2.0], output: 3.0 };
    let plan = TrackPlan { scales: Some(scales), forgetting: "0.98".parse()?, ..TrackPlan::default() };
    let mut trackers = pair(&plan)?;
    let orders = ArxOrders { na: 2, inputs: &[InputOrders { nb: 2, nk: 2 }], constant: false };
    let refused = |error: thetahat_core::Error| Error::data(error.to_string());
    let mut all: RecursiveVectorArx<f64, Dyn, Dyn, Dyn> = RecursiveVectorArx::new(
        &orders,
        &thetahat_core::nalgebra::DVector::from_column_slice(&[3.0, 2.0]),
        &[2.0],
        plan.forgetting.0,
    )
    .map_err(refused)?;
    for (t, row) in rows(300, 0.2).iter().enumerate() {
        let tracked = take(&mut trackers, row)?;
        let both = thetahat_core::nalgebra::DVector::from_column_slice(row.0.as_slice());
        let innovation = all.log_row(&both, &[row.1]).map_err(refused)?;
        for (tracked, error) in tracked.iter().zip(&innovation.error) {
            assert!((tracked.error - error).abs() < 1e-9 || t < 4, "{t}: {} {error}", tracked.error);
        }
    }
    assert_eq!(trackers[1].names(), ["a1_1", "a1_2", "a2_1", "a2_2", "b2", "b3"]);
    for (place, tracker) in trackers.iter().enumerate() {
        let found = tracker.parameters().unwrap_or_default();
        let column = all.estimator().parameters().column(place).into_owned();
        assert!(found.iter().zip(&column).all(|(a, b)| (a - b).abs() < 1e-10), "{found:?} {column}");
    }
    let mut ahead = [0.0; 10];
    let held = trackers[0].inputs[2];
    all.predict(&[held; 5], &mut ahead).map_err(refused)?;
    for steps in 1..=5 {
        let forecast = forecasts(&mut trackers, steps)?;
        let expected = &ahead[2 * steps - 2..2 * steps];
        assert!(forecast.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{steps}");
    }
    Ok(())
}

/// Exact data: the plant, in the units of the log, with offsets, and with samples missing of one output alone.
#[test]
fn offsets_and_missing_outputs() -> Result<(), Error> {
    let offsets = |output| PerChannel { inputs: vec![10.0, -20.0, 5.0], output };
    let mut trackers = [10.0, -20.0].map(|output| {
        let plan = TrackPlan { offsets: Some(offsets(output)), ..exactly(&TrackPlan::default()) };
        Tracker::coupled(&orders()?, 2, &plan)
    });
    let [Ok(first), Ok(second)] = &mut trackers else { return Err(Error::data("no trackers")) };
    let mut trackers = [first.clone(), second.clone()];
    let log = rows(200, 0.0);
    let mut learnt = [0, 0];
    for (t, (y, u)) in log[..180].iter().enumerate() {
        let mut y = y + Vector2::new(10.0, -20.0);
        if t % 30 == 20 {
            y[1] = f64::NAN;
        }
        for (count, tracked) in learnt.iter_mut().zip(take(&mut trackers, &(y, u + 5.0))?) {
            *count += usize::from(t > 40 && tracked.action == Action::Updated);
        }
    }
    // The first learns from rows of which only the second is missing; both wait while it is in the regressor.
    assert_eq!(learnt[0], learnt[1] + 5);
    let truth = [[-1.2, 0.5, 0.1, 0.0, 0.4, 0.0], [-0.2, 0.1, -0.9, 0.3, 0.0, -0.2]];
    for (tracker, truth) in trackers.iter().zip(truth) {
        let found = tracker.parameters().unwrap_or_default();
        assert!(found.iter().zip(truth).all(|(a, b)| (a - b).abs() < 1e-8), "{found:?}");
    }
    // The input acts two samples later: it is known for the first two.
    for (steps, row) in log[180..182].iter().enumerate() {
        let ahead = forecasts(&mut trackers, steps + 1)?;
        let y = row.0 + Vector2::new(10.0, -20.0);
        assert!((ahead[0] - y[0]).abs() + (ahead[1] - y[1]).abs() < 1e-7, "{steps} {ahead:?} {y}");
    }
    trackers[1].gap();
    assert!(forecasts(&mut trackers, 1)?.iter().all(|ahead| ahead.is_nan()));
    Ok(())
}

#[test]
fn what_is_written_goes_on_to_the_bit() -> Result<(), Error> {
    let mut log = rows(120, 0.3);
    (log[60].0[0], log[90].0[1]) = (f64::NAN, 1e200);
    let plan = TrackPlan { alarm_interval: Some(100.0), constant: true, ..TrackPlan::default() };
    let mut trackers = pair(&plan)?;
    for (t, row) in log.iter().enumerate() {
        if t == 70 {
            trackers.iter_mut().for_each(Tracker::gap);
        }
        if [0, 9, 61, 91].contains(&t) {
            let written =
                serde_json::to_string(&trackers[1]).map_err(|error| Error::data(error.to_string()))?;
            let mut copy: Tracker =
                serde_json::from_str(&written).map_err(|error| Error::data(error.to_string()))?;
            let mut original = trackers[1].clone();
            for (y, u) in &log[t..] {
                let said = original.log_row_of(1, y.as_slice(), &[*u])?;
                assert_eq!(format!("{:?}", copy.log_row_of(1, y.as_slice(), &[*u])?), format!("{said:?}"));
            }
            assert_eq!(serde_json::to_string(&copy).ok(), serde_json::to_string(&original).ok());
            // What no run makes is refused.
            for outputs in if t == 9 { 0..=3 } else { 1..=1 } {
                let edited = written.replace("\"outputs\":2", &format!("\"outputs\":{outputs}"));
                assert!(outputs == 2 || serde_json::from_str::<Tracker>(&edited).is_err(), "{outputs}");
            }
        }
        take(&mut trackers, row)?;
    }
    assert_eq!(trackers[0].names().last().map(String::as_str), Some("constant"));
    let summary = trackers[0].summary(0);
    assert_eq!((summary.coupled, summary.offsets.len(), summary.parameters.len()), (Some(2), 2, 7));
    Ok(())
}

#[test]
fn what_does_not_fit_is_refused() -> Result<(), Error> {
    let plan = TrackPlan::default();
    for outputs in [0, 1] {
        assert!(Tracker::coupled(&orders()?, outputs, &plan).is_err());
    }
    assert!(Tracker::coupled(&Orders::armax(1, &[1], 1, &[1])?, 2, &plan).is_err());
    // A number for each channel: the outputs, the inputs, its own.
    let scales = PerChannel { inputs: vec![1.0], output: 1.0 };
    assert!(Tracker::coupled(&orders()?, 2, &TrackPlan { scales: Some(scales), ..plan.clone() }).is_err());

    let mut trackers = pair(&plan)?;
    let before = serde_json::to_string(&trackers[0]).ok();
    let tracker = &mut trackers[0];
    assert!(tracker.log_row(1.0, &[1.0]).is_err());
    assert!(tracker.log_row_of(0, &[1.0], &[1.0]).is_err());
    assert!(tracker.log_row_of(2, &[1.0, 1.0], &[1.0]).is_err());
    assert!(tracker.log_row_of(0, &[1.0, 1.0], &[]).is_err());
    let infinite = tracker.log_row_of(0, &[1.0, f64::INFINITY], &[1.0]).map(|_| ());
    assert!(infinite.is_err_and(|error| error.to_string().contains("output 2")));
    assert!(tracker.forecast(1).is_err());
    assert_eq!(serde_json::to_string(tracker).ok(), before);
    assert!(forecasts(&mut trackers[..1], 1).is_err() && forecasts(&mut trackers, 0).is_err());
    Ok(())
}
