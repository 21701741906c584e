use thetahat_core::RlsStart;

use super::*;

#[test]
fn what_is_written_is_read_back() {
    let policies = [
        Forgetting::None,
        Forgetting::Exponential { factor: 0.1 + 0.2 },
        Forgetting::Exponential { factor: 1.0 },
        Forgetting::Selective { factor: 0.98 },
        Forgetting::RandomWalk { variance: 1e-300 },
        Forgetting::RandomWalk { variance: 0.0 },
        Forgetting::Variable { factor: 0.99, minimum: 0.9, noise_variance: 2.5e-7 },
    ];
    for policy in policies.map(Policy) {
        assert_eq!(policy.to_string().parse::<Policy>(), Ok(policy));
    }
    for start in
        [RlsStart::Standard, RlsStart::Exact, RlsStart::Mixed { blend: 0 }, RlsStart::Mixed { blend: 65535 }]
    {
        assert_eq!(TrackStart(start).to_string().parse::<TrackStart>(), Ok(TrackStart(start)));
    }
    for (text, written) in [
        ("used", "used"),
        ("huber", "huber:3.0"),
        ("huber:2.5", "huber:2.5"),
        ("gate", "gate:25.0:20"),
        ("gate:16:0", "gate:16.0:0"),
    ] {
        let rule = text.parse::<TrackOutliers>().unwrap();
        assert_eq!(rule.to_string(), written);
        assert_eq!(written.parse::<TrackOutliers>(), Ok(rule));
    }
    for method in [TrackMethod::Rls, TrackMethod::Els, TrackMethod::Rpem] {
        assert_eq!(method.to_string().parse::<TrackMethod>(), Ok(method));
    }
    for (text, policy) in [
        ("1", Forgetting::None),
        ("1.0", Forgetting::None),
        ("0.99", Forgetting::Exponential { factor: 0.99 }),
        ("random-walk:1e-6", Forgetting::RandomWalk { variance: 1e-6 }),
    ] {
        assert_eq!(text.parse(), Ok(Policy(policy)));
    }
}

#[test]
fn words_that_mean_nothing_are_refused() {
    let message = |text: &str| text.parse::<Policy>().unwrap_err().to_string();
    for text in ["", "some", "exponential", "none:1", "0.9:0.8", "exponential:", "variable:0.99", "walk:1"] {
        assert!(
            message(text).contains(&format!("'{text}'")) && message(text).contains("write none"),
            "{text}"
        );
    }
    for text in ["nan", "inf", "exponential:nan", "selective:inf", "random-walk:x"] {
        assert!(message(text).contains("number"), "{}", message(text));
    }
    for text in ["0", "1.01", "-1", "exponential:0", "selective:1.5", "variable:2:1:1"] {
        assert!(message(text).contains("above 0 and at most 1"), "{}", message(text));
    }
    for text in ["random-walk:-1", "random-walk:101", "variable:0.9:0.95:1", "variable:0.9:0.8:0"] {
        assert!(text.parse::<Policy>().is_err(), "{text}");
    }
    for text in ["", "exact:1", "mixed:", "mixed:-1", "mixed:65536", "Standard"] {
        assert!(text.parse::<TrackStart>().is_err(), "{text}");
    }
    for text in [
        "",
        "used:1",
        "huber:0.5",
        "huber:nan",
        "huber:3:1",
        "gate:25:65536",
        "gate:25:-1",
        "gate:1e300",
        "Gate",
    ] {
        assert!(text.parse::<TrackOutliers>().is_err(), "{text}");
    }
    assert!("arx".parse::<TrackMethod>().is_err());
}

#[test]
fn plans_that_make_no_tracker_are_refused() {
    let argument = |orders: &Orders, plan: TrackPlan| match Tracker::new(orders, &plan) {
        Err(Error::Argument { argument, message }) => {
            assert!(!message.is_empty());
            argument
        }
        other => panic!("{other:?}"),
    };
    let (plain, channels) =
        (TrackPlan::default(), |output| Some(PerChannel { inputs: vec![1.0, 1.0], output }));
    let armax = Orders::armax(2, &[2, 1], 1, &[1, 0]).unwrap();
    let els = TrackPlan { method: TrackMethod::Els, ..plain.clone() };
    let with = |change: fn(&mut TrackPlan)| {
        let mut plan = TrackPlan::default();
        change(&mut plan);
        plan
    };
    assert_eq!(argument(&Orders::oe(&[1], &[1], &[1]).unwrap(), plain.clone()), "orders");
    assert_eq!(argument(&armax, plain.clone()), "method");
    assert_eq!(argument(&orders(), els.clone()), "method");
    assert_eq!(argument(&armax, TrackPlan { start: TrackStart(RlsStart::Exact), ..els.clone() }), "start");
    assert_eq!(argument(&orders(), with(|plan| plan.forgetting = "0.8".parse().unwrap())), "forgetting");
    assert_eq!(argument(&orders(), with(|plan| plan.dead_zone = f64::NAN)), "dead-zone");
    assert_eq!(argument(&orders(), with(|plan| plan.alarm_interval = Some(1.0))), "alarm");
    let short = Some(PerChannel { inputs: vec![1.0], output: 1.0 });
    assert_eq!(argument(&orders(), TrackPlan { offsets: short.clone(), ..plain.clone() }), "offset");
    assert_eq!(argument(&orders(), TrackPlan { scales: short, ..plain.clone() }), "scale");
    assert_eq!(argument(&orders(), TrackPlan { scales: channels(0.0), ..plain.clone() }), "scale");
    assert_eq!(argument(&orders(), TrackPlan { offsets: channels(f64::NAN), ..plain }), "offset");
    assert_eq!(argument(&armax, TrackPlan { noise_scale: Some(-1.0), ..els }), "noise-scale");
}

#[test]
fn a_number_of_a_channel_that_is_out_of_range_names_the_channel_and_the_range() {
    let message = |plan: TrackPlan| Tracker::new(&orders(), &plan).unwrap_err().to_string();
    let scales = |second, output| TrackPlan {
        scales: Some(PerChannel { inputs: vec![1.0, second], output }),
        ..TrackPlan::default()
    };
    let range = "is not in 1e-98 … 1e98; give its typical magnitude";
    for (second, written) in [(0.0, "0.0"), (-1.0, "-1.0"), (9e-99, "9e-99"), (f64::NAN, "NaN")] {
        assert_eq!(message(scales(second, 1.0)), format!("scale: that of input 2, {written}, {range}"));
    }
    assert_eq!(message(scales(1.0, 1.1e98)), format!("scale: that of the output, 1.1e98, {range}"));
    assert!(Tracker::new(&orders(), &scales(1e-98, 1e98)).is_ok());
    let offsets = Some(PerChannel { inputs: vec![f64::INFINITY, 0.0], output: 0.0 });
    let message = message(TrackPlan { offsets, ..TrackPlan::default() });
    assert!(message.starts_with("offset: that of input 1, inf, is not finite"), "{message}");
}
