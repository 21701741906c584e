use serde_json::{Value, json};

use super::*;

/// What a tracker says of a sample, and everything that it is, to the bit: NaN has one name in both.
fn says(tracker: &mut Tracker, u: [f64; 2], y: f64) -> String {
    let tracked = tracker.log_row(y, &u).unwrap();
    format!("{tracked:?} {:?}", tracker.forecast(2).unwrap())
}

#[test]
fn what_is_written_goes_on_to_the_bit() {
    let (mut inputs, mut y) = log(120, 0.3, 0.6, 12);
    (y[3], y[60], inputs[4][1], inputs[61][0]) = (f64::NAN, f64::NAN, f64::NAN, f64::NAN);
    y[90] = 1e200;
    let armax = Orders::armax(2, &[2, 1], 1, &[1, 2]).unwrap();
    let plain = TrackPlan { alarm_interval: Some(100.0), ..TrackPlan::default() };
    let with = |orders: &Orders, method, forgetting: &str, start: &str| {
        let (forgetting, start) = (forgetting.parse().unwrap(), start.parse().unwrap());
        (orders.clone(), TrackPlan { method, forgetting, start, ..plain.clone() })
    };
    let (rls, els, rpem) = (TrackMethod::Rls, TrackMethod::Els, TrackMethod::Rpem);
    let mut plans = vec![
        with(&orders(), rls, "none", "exact"),
        with(&orders(), rls, "0.95", "standard"),
        with(&orders(), rls, "selective:0.95", "mixed:30"),
        with(&orders(), rls, "random-walk:1e-4", "mixed"),
        with(&orders(), rls, "variable:0.99:0.9:0.03", "exact"),
        with(&armax, els, "0.95", "standard"),
        with(&armax, rpem, "none", "standard"),
    ];
    let (orders, mut plan) = plans[1].clone();
    plan.constant = true;
    plan.dead_zone = 0.1;
    plan.outliers = "huber:1".parse().unwrap();
    plan.offsets = Some(PerChannel { inputs: vec![0.1, 0.2], output: 0.3 });
    plan.scales = Some(PerChannel { inputs: vec![3.0, 1.0], output: 9.0 });
    plans.push((orders, plan));
    for (orders, plan) in plans {
        let mut tracker = Tracker::new(&orders, &plan).unwrap();
        for t in 0..120 {
            if t == 6 || t == 70 {
                tracker.gap();
            }
            // While rows are collected, after a gap, at the start, with missing samples in the lines, and later.
            if [0, 1, 5, 6, 13, 14, 25, 62, 70, 91, 119].contains(&t) {
                let text = serde_json::to_string(&tracker).unwrap();
                let mut copy: Tracker = serde_json::from_str(&text).unwrap();
                assert_eq!(serde_json::to_string(&copy).unwrap(), text);
                assert_eq!(copy.plan(), &plan);
                let mut original = tracker.clone();
                assert_eq!(
                    format!("{:?}", copy.forecast(2).unwrap()),
                    format!("{:?}", original.forecast(2).unwrap())
                );
                for later in t..120 {
                    let said = says(&mut original, inputs[later], y[later]);
                    assert_eq!(says(&mut copy, inputs[later], y[later]), said, "{plan:?} {t} {later}");
                }
                let last = serde_json::to_string(&original).unwrap();
                assert_eq!(serde_json::to_string(&copy).unwrap(), last);
            }
            tracker.log_row(y[t], &inputs[t]).unwrap();
        }
    }
}

/// Every number of a state, one after the other, replaced: what is read all the same goes on.
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
    let (inputs, y) = log(120, 0.3, 0.6, 12);
    let orders = Orders::armax(2, &[2, 1], 1, &[1, 2]).unwrap();
    let method = TrackMethod::Rpem;
    let plan = TrackPlan { constant: true, method, ..TrackPlan::default() };
    let (mut refused, mut read) = (0, 0);
    // While rows are collected, and later.
    for rows in [5, 80] {
        let mut tracker = Tracker::new(&orders, &plan).unwrap();
        for t in 0..rows {
            tracker.log_row(y[t], &inputs[t]).unwrap();
        }
        let whole = serde_json::to_value(&tracker).unwrap();
        let mut paths = vec![];
        numbers(&whole, "", &mut paths);
        for path in &paths {
            for bad in
                [json!(-1), json!(7), json!(1.99), json!(6e200), json!(u64::MAX), json!("NaN"), json!("inf")]
            {
                let mut tampered = whole.clone();
                *tampered.pointer_mut(path).unwrap() = bad.clone();
                let Ok(mut tracker) = serde_json::from_str::<Tracker>(&tampered.to_string()) else {
                    refused += 1;
                    continue;
                };
                read += 1;
                for t in rows..120 {
                    if let Err(error) = tracker.log_row(y[t], &inputs[t]) {
                        panic!("{path} = {bad}: {error}");
                    }
                    tracker.forecast(3).unwrap();
                }
                assert!(tracker.noise_variance().is_none_or(|variance| variance >= 0.0), "{path} = {bad}");
                assert!(
                    tracker.score().mean_squared_error().is_none_or(|square| square >= 0.0),
                    "{path} = {bad}"
                );
            }
        }
    }
    assert!(refused > 500 && read > 100, "{refused} {read}");
    let text = serde_json::to_string(&Tracker::new(&orders, &plan).unwrap()).unwrap();
    let later = serde_json::from_str::<Tracker>(&text.replace("\"version\":1", "\"version\":2")).unwrap_err();
    assert!(later.to_string().starts_with("this snapshot is of version 2, and version 1 is understood"));
}

#[test]
fn nothing_grows_with_the_number_of_samples() {
    let (inputs, y) = log(400, 0.3, 0.0, 13);
    let mut tracker = Tracker::new(&orders(), &TrackPlan::default()).unwrap();
    let mut lengths = vec![];
    for _ in 0..30 {
        run(&mut tracker, &inputs, &y);
        lengths.push(serde_json::to_string(&tracker).unwrap().len());
    }
    // Numbers have up to 24 digits, or fewer.
    let (least, most) = (lengths.iter().min().unwrap(), lengths.iter().max().unwrap());
    assert!(most - least < 300, "{lengths:?}");
    // With a channel that stays 0 the rows wait, and no more than are needed.
    let mut waiting = Tracker::new(&orders(), &TrackPlan::default()).unwrap();
    let still: Vec<[f64; 2]> = inputs.iter().map(|u| [u[0], 0.0]).collect();
    run(&mut waiting, &still, &y);
    let before = serde_json::to_string(&waiting).unwrap().len();
    run(&mut waiting, &still, &y);
    assert!(serde_json::to_string(&waiting).unwrap().len().abs_diff(before) < 100);
}

#[test]
fn a_gap_while_rows_are_collected_is_kept_with_them() {
    let (inputs, y) = log(60, 0.3, 0.0, 14);
    let feed = |tracker: &mut Tracker, gaps: &[usize]| {
        for t in 0..60 {
            if gaps.contains(&t) {
                tracker.gap();
            }
            tracker.log_row(y[t], &inputs[t]).unwrap();
        }
    };
    for gap in [5, 12] {
        let mut tracker = Tracker::new(&orders(), &TrackPlan::default()).unwrap();
        feed(&mut tracker, &[gap]);
        let plan = TrackPlan { scales: tracker.scales().cloned(), ..TrackPlan::default() };
        let mut given = Tracker::new(&orders(), &plan).unwrap();
        feed(&mut given, &[gap]);
        assert_eq!(given.parameters(), tracker.parameters());
    }
}

/// The places of all numbers in a document.
fn numbers(value: &serde_json::Value, place: &str, found: &mut Vec<String>) {
    match value {
        serde_json::Value::Number(_) => found.push(place.to_owned()),
        serde_json::Value::Array(items) => {
            items
                .iter()
                .enumerate()
                .for_each(|(index, item)| numbers(item, &format!("{place}/{index}"), found));
        }
        serde_json::Value::Object(fields) => {
            fields.iter().for_each(|(name, field)| numbers(field, &format!("{place}/{name}"), found));
        }
        _ => {}
    }
}

#[test]
fn what_was_edited_is_no_tracker_or_goes_on_in_numbers() {
    let (inputs, y) = log(200, 0.3, 0.6, 12);
    let armax = Orders::armax(2, &[2, 1], 1, &[1, 2]).unwrap();
    let watched = TrackPlan { alarm_interval: Some(100.0), constant: true, ..TrackPlan::default() };
    let rpem = TrackPlan { method: TrackMethod::Rpem, ..watched.clone() };
    let mut tried = 0;
    // While rows are collected, and later; the estimators themselves are checked where they are made.
    for (orders, plan, rows) in [(&orders(), &watched, 9), (&orders(), &watched, 90), (&armax, &rpem, 120)] {
        let mut tracker = Tracker::new(orders, plan).unwrap();
        run(&mut tracker, &inputs[..rows], &y[..rows]);
        let whole = serde_json::to_value(&tracker).unwrap();
        let mut places = Vec::new();
        numbers(&whole, "", &mut places);
        places.retain(|place| !place.starts_with("/stage/Running"));
        for place in &places {
            for number in [-1.0_f64, 1e300, 0.0, 3.0] {
                let mut edited = whole.clone();
                let found = edited.pointer_mut(place).unwrap();
                // A count stays one.
                *found = match found.is_u64() {
                    true => (number.clamp(0.0, 1e15) as u64).into(),
                    false => number.into(),
                };
                let Ok(mut tracker) = serde_json::from_value::<Tracker>(edited) else { continue };
                // It takes two tables of run lengths.
                let is_figure = place.starts_with("/plan/alarm_interval");
                if is_figure || tracker.plan() != plan || !tracker.is_sound() {
                    continue;
                }
                tried += 1;
                let tracked = run(&mut tracker, &inputs[rows..], &y[rows..]);
                let score = tracker.score();
                let figures =
                    [score.mean_squared_error(), score.mean_nis(), score.fit(), score.log_likelihood()];
                assert!(
                    tracked.iter().all(|tracked| !(tracked.nis < 0.0 || tracked.variance < 0.0))
                        && figures.iter().flatten().all(|figure| figure.is_finite())
                        && [score.mean_squared_error(), score.mean_nis()]
                            .iter()
                            .flatten()
                            .all(|&square| square >= 0.0),
                    "{place} = {number}: {score:?}"
                );
            }
        }
    }
    assert!(tried > 20, "{tried}");
}
