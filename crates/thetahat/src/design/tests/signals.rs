use std::f64::consts::{PI, SQRT_2, TAU};

use crate::Error;
use crate::design::{SignalFigures, SignalKind, SignalPlan, TestSignal, Waveform};

fn plan(waveform: &str, length: usize) -> SignalPlan {
    let waveform: Waveform = waveform.parse().unwrap();
    SignalPlan { length, ..SignalPlan::new(waveform) }
}

fn values(plan: &SignalPlan) -> Vec<Vec<f64>> {
    TestSignal::new(plan).unwrap().values(plan.length)
}

fn crest(values: &[f64]) -> f64 {
    SignalFigures::of(values, 1.0).crest_factor.unwrap()
}

/// sum_t x(t) y(t + shift) over a period.
fn correlation(x: &[f64], y: &[f64], shift: usize) -> f64 {
    (0..x.len()).map(|t| x[t] * y[(t + shift) % y.len()]).sum()
}

#[test]
fn a_multisine_has_a_low_peak_and_the_power_of_its_lines() {
    // The upper end of the band as a fraction of half the sampling frequency, and the period.
    for (share, period) in [(0.2, 512), (0.5, 375), (0.06, 1024)] {
        for seed in 0..2 {
            let plan = SignalPlan { band: Some([0.0, share * PI]), seed, ..plan("multisine", period) };
            let signal = TestSignal::new(&plan).unwrap();
            let u = &signal.values(period)[0];
            let crest = crest(u);
            assert!(crest <= 1.43, "{period}: {crest}");
            // Flat: each line has the amplitude that the root mean square says, and nothing lies between.
            let rms = (u.iter().map(|u| u * u).sum::<f64>() / period as f64).sqrt();
            let lines = signal.frequencies();
            let amplitude = rms * (2.0 / lines.len() as f64).sqrt();
            let at = |frequency: f64| {
                let turn = |t: usize| frequency * t as f64;
                let re: f64 = u.iter().enumerate().map(|(t, u)| u * turn(t).cos()).sum();
                let im: f64 = u.iter().enumerate().map(|(t, u)| u * turn(t).sin()).sum();
                re.hypot(im) * 2.0 / period as f64
            };
            for line in lines.iter().step_by(lines.len() / 7) {
                assert!((at(*line) / amplitude - 1.0).abs() < 1e-9, "{line}");
            }
            assert!(at(lines[lines.len() - 1] + TAU / period as f64) < 1e-9 * amplitude);
        }
    }
}

#[test]
fn a_multisine_on_logarithmic_lines_has_a_low_peak_too() {
    for (points, period) in [(20, 1024), (40, 2048)] {
        let plan = SignalPlan { points: Some(points), ..plan("multisine", period) };
        let signal = TestSignal::new(&plan).unwrap();
        let crest = crest(&signal.values(period)[0]);
        assert!(crest <= 2.2, "{points}: {crest}");
        // Each the same factor above the one before, as far as whole lines can be, each of them once.
        let lines = signal.frequencies();
        assert!(lines.len() <= points && lines.windows(2).all(|pair| pair[0] < pair[1]));
    }
}

#[test]
fn channels_are_not_correlated() {
    for (waveform, length, most) in
        [("prbs", 1023, 1.0), ("prbs:3", 3 * 127, 3.0), ("multisine", 512, 1e-9), ("steps:16", 128, 0.0)]
    {
        let plan = SignalPlan { channels: 3, ..plan(waveform, length) };
        let all = values(&plan);
        assert_eq!((all.len(), all[0].len()), (3, length));
        for (one, other) in [(0, 1), (0, 2), (1, 2)] {
            let found = correlation(&all[one], &all[other], 0).abs();
            assert!(found <= most, "{waveform}: {found}");
        }
    }
    // At every lag below the shift of a PRBS, and at all lags of a multisine.
    let shifted = values(&SignalPlan { channels: 3, ..plan("prbs", 1023) });
    assert!((0..300).all(|lag| correlation(&shifted[1], &shifted[0], lag) == -1.0));
    let lines = values(&SignalPlan { channels: 2, ..plan("multisine", 512) });
    assert!((0..512).all(|lag| correlation(&lines[1], &lines[0], lag).abs() < 1e-9));
    // One channel of stepped sines at a time.
    let sines = values(&SignalPlan { channels: 2, ..plan("sines", 800) });
    assert!(sines[0].iter().zip(&sines[1]).all(|(one, other)| one * other == 0.0));
    // Independent ones: within five standard deviations.
    for waveform in ["white", "rbs"] {
        let all = values(&SignalPlan { channels: 2, ..plan(waveform, 10_000) });
        assert!(correlation(&all[0], &all[1], 0).abs() < 5.0 * 100.0);
    }
}

#[test]
fn orders_of_excitation_are_those_of_the_textbook() {
    let order = |values: &[f64]| {
        let figures = SignalFigures::of(values, 1.0);
        (figures.order, figures.highest)
    };
    let of = |value: &dyn Fn(f64) -> f64| (0..400).map(|t| value(f64::from(t))).collect::<Vec<f64>>();
    assert_eq!(order(&of(&|_| 1.0)), (1, 50));
    assert_eq!(order(&of(&|_| -1e9)), (1, 50));
    assert_eq!(order(&of(&|_| 0.0)), (0, 50));
    // Not whole cycles: the mean of the samples is not zero, and the order is 2 all the same.
    assert_eq!(order(&of(&|t| (0.1 * t).sin())), (2, 50));
    assert_eq!(order(&of(&|t| 1e6 + (0.1 * t).sin())), (3, 50));
    assert_eq!(order(&of(&|t| (0.1 * t).sin() + (1.1 * t).cos())), (4, 50));
    // A period of seven values, with their mean.
    assert_eq!(order(&values(&SignalPlan { period: Some(7), ..plan("prbs", 400) })[0]), (7, 50));
    for rich in ["prbs", "rbs", "white", "chirp", "multisine"] {
        assert_eq!(order(&values(&plan(rich, 400))[0]), (50, 50), "{rich}");
    }
    let two = SignalPlan { points: Some(2), ..plan("multisine", 400) };
    assert_eq!(order(&values(&two)[0]), (4, 50));
    assert_eq!(order(&values(&plan("steps", 400))[0]), (2, 50));
    assert_eq!(order(&[]), (0, 0));
}

#[test]
fn levels_are_met_to_the_bit_and_a_power_budget_to_rounding() {
    for kind in SignalKind::all() {
        let length = 1000;
        let peak = SignalPlan { range: [0.1, 0.7], ..plan(kind.word(), length) };
        let u = &values(&peak)[0];
        let (low, high) = u.iter().fold((f64::MAX, f64::MIN), |(low, high), u| (low.min(*u), high.max(*u)));
        assert!(low >= 0.1 && high <= 0.7, "{kind:?}: {low} {high}");
        if matches!(kind, SignalKind::Prbs | SignalKind::Rbs | SignalKind::Steps) {
            assert!(u.iter().all(|u| *u == 0.1 || *u == 0.7), "{kind:?}");
        }
        let power = SignalPlan { rms: Some(2.0), range: [9.0, 11.0], ..plan(kind.word(), length) };
        let u = &values(&power)[0];
        let rms = (u.iter().map(|u| (u - 10.0).powi(2)).sum::<f64>() / length as f64).sqrt();
        // Of white noise the power is what is expected: within five standard deviations.
        let tolerance = if kind == SignalKind::White { 5.0 * 0.45 / 1000_f64.sqrt() } else { 1e-2 };
        assert!((rms / 2.0 - 1.0).abs() < tolerance, "{kind:?}: {rms}");
    }
}

#[test]
fn a_longer_signal_begins_with_a_shorter_one_and_the_seed_says_which() {
    for kind in SignalKind::all() {
        let signal = |seed: u64| TestSignal::new(&SignalPlan { seed, ..plan(kind.word(), 300) }).unwrap();
        let (short, long) = (signal(0).values(300), signal(0).values(700));
        assert_eq!(short[0][..], long[0][..300], "{kind:?}");
        let drawn = !matches!(kind, SignalKind::Chirp | SignalKind::Sines | SignalKind::Steps);
        assert_eq!(signal(1).values(300) != short, drawn, "{kind:?}");
    }
}

#[test]
fn a_chirp_and_stepped_sines_have_the_frequencies_of_their_band() {
    let band = Some([0.1, 0.5]);
    let u = &values(&SignalPlan { band, ..plan("chirp", 4000) })[0];
    let figures = SignalFigures::of(u, 1.0);
    let [low, high] = figures.main_band().unwrap();
    assert!(low > 0.08 && low < 0.15 && high > 0.45 && high < 0.52, "{low} {high}");
    assert!((figures.rms * SQRT_2 - 1.0).abs() < 0.01);

    let sines = SignalPlan { band, points: Some(5), ..plan("sines", 1000) };
    let signal = TestSignal::new(&sines).unwrap();
    let u = &signal.values(1000)[0];
    for (block, frequency) in u.chunks(200).zip(signal.frequencies()) {
        // Cycles of whole samples, the later ones with the bits of the first: an order of 2, without a mean.
        let cycle = (TAU / frequency).round() as usize;
        assert!((TAU / frequency - cycle as f64).abs() < 1e-9);
        assert!(block.iter().zip(&block[cycle..]).all(|(first, second)| first.to_bits() == second.to_bits()));
        let whole = &block[..cycle * (200 / cycle)];
        assert!(whole.iter().sum::<f64>().abs() < 1e-9);
        assert_eq!(SignalFigures::of(whole, 1.0).order, 2);
    }
    assert!(signal.frequencies()[0] >= 0.094 && signal.frequencies()[4] <= 0.52);
}

#[test]
fn what_makes_no_sense_is_refused_in_one_sentence() {
    let base = |waveform: &str| plan(waveform, 100);
    let cases: Vec<(SignalPlan, &str, &str)> = vec![
        (SignalPlan { length: 0, ..base("prbs") }, "length", "at least one sample"),
        (SignalPlan { length: usize::MAX, ..base("rbs") }, "length", "more than 10000000 values"),
        (SignalPlan { length: 2, ..base("prbs") }, "length", "no period of a PRBS"),
        (SignalPlan { channels: 0, ..base("white") }, "channels", "at least one channel"),
        (SignalPlan { channels: 64, ..base("prbs") }, "channels", "more than the 63 shifts"),
        (SignalPlan { channels: 70, ..base("steps") }, "channels", "2^70 steps"),
        (SignalPlan { range: [1.0, 1.0], ..base("rbs") }, "range", "a higher one"),
        (SignalPlan { range: [0.0, f64::NAN], ..base("rbs") }, "range", "finite"),
        (SignalPlan { rms: Some(0.0), ..base("rbs") }, "rms", "not a positive number"),
        (SignalPlan { rms: Some(f64::MAX), ..base("white") }, "rms", "range of numbers"),
        (SignalPlan { sample_time: 0.0, ..base("rbs") }, "sample-time", "not a positive number of seconds"),
        (SignalPlan { period: Some(101), ..base("chirp") }, "period", "no more than the 100"),
        (SignalPlan { period: Some(1), ..base("white") }, "period", "at least 2"),
        (SignalPlan { period: Some(30), ..base("prbs") }, "period", "such as 15 samples"),
        (SignalPlan { period: Some(30), ..base("steps:10") }, "period", "2 times the 10"),
        (SignalPlan { band: Some([0.1, 3.2]), ..base("chirp") }, "band", "half the sampling frequency"),
        (SignalPlan { band: Some([1.0, 0.5]), ..base("chirp") }, "band", "a higher one"),
        (SignalPlan { band: Some([0.1, 1.0]), ..base("prbs") }, "band", "has no band"),
        (SignalPlan { band: Some([0.01, 0.02]), ..base("multisine") }, "band", "0 lines lie in it"),
        (SignalPlan { band: Some([0.01, 0.5]), ..base("sines") }, "band", "less than two cycles"),
        (SignalPlan { points: Some(3), ..base("prbs") }, "points", "no number of frequencies"),
        (SignalPlan { points: Some(1), ..base("sines") }, "points", "at least 2"),
        (SignalPlan { points: Some(usize::MAX), ..base("sines") }, "points", "too few"),
        (base("steps:100"), "signal", ": never"),
        (SignalPlan { length: 200_000, period: Some(200_000), ..base("multisine") }, "period", "at most"),
    ];
    for (plan, argument, part) in cases {
        match TestSignal::new(&plan) {
            Err(Error::Argument { argument: found, message }) => {
                assert_eq!(found, argument, "{plan:?}: {message}");
                assert!(message.contains(part), "{plan:?}: {message}");
            }
            other => panic!("{plan:?}: {other:?}"),
        }
    }
}
