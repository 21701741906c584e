use thetahat_numerics::noise::Noise;

use super::*;
use crate::tests::channel;

const STEP: f64 = 0.01;

fn band(text: &str) -> Prefilter {
    text.parse().unwrap()
}

/// The gain at a frequency in Hz.
fn gain(band: &Prefilter, hertz: f64) -> f64 {
    let (sine, cosine) = (2.0 * PI * hertz * STEP).sin_cos();
    let sections = band.filter(STEP).unwrap().sections;
    sections.iter().map(|section| section.gain(Complex::new(cosine, sine))).product()
}

#[test]
fn gains_are_those_of_butterworth() {
    // |L|^2 = 1/(1 + x^8), x = tan(pi f T)/tan(pi f_h T) for the low-pass, its inverse for the high-pass, and for the band-pass
    // x = (w^2 - w_l w_h)/(w (w_h - w_l)) with w = tan(pi f T).
    let warped = |f: f64| (PI * f * STEP).tan();
    for f in [0.001, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 49.0] {
        let expected = |x: f64| 1.0 / (1.0 + x.powi(8)).sqrt();
        let w = warped(f);
        let (low, high) = (warped(2.0), warped(10.0));
        let cases =
            [("..10", w / high), ("2..", low / w), ("2..10", (w * w - low * high) / (w * (high - low)))];
        for (text, x) in cases {
            let found = gain(&band(text), f);
            assert!((found - expected(x)).abs() < 1e-9, "{text} at {f} Hz: {found} {}", expected(x));
        }
    }
    for (text, end) in [("..10", 10.0), ("2..", 2.0), ("2..10", 2.0), ("2..10", 10.0)] {
        assert!((gain(&band(text), end) - 0.5_f64.sqrt()).abs() < 1e-9);
    }
}

#[test]
fn bands_are_read_and_refused() {
    assert_eq!(band(" 0.1 .. 5 "), Prefilter { low: Some(0.1), high: Some(5.0) });
    assert_eq!([band("..5"), band("1e-3..")].map(|band| band.to_string()), ["..5", "0.001.."]);
    for wrong in ["", "..", "5", "5..5", "5..1", "-1..5", "0..5", "nan..5", "1..inf", "a..b", "1...5"] {
        let error = wrong.parse::<Prefilter>().unwrap_err();
        assert!(matches!(&error, Error::Argument { argument, .. } if argument == "prefilter"), "{wrong}");
    }
    assert!(band("..50").filter(STEP).is_err() && band("50..").filter(STEP).is_err());
    assert!(band("1..49").filter(STEP).is_ok());
}

fn log(u: Vec<f64>, y: Vec<f64>) -> Log {
    Log::new(vec![channel("u", u), channel("y", y)], STEP).unwrap()
}

fn all(log: &Log) -> [Rows; 1] {
    [Rows::new(1, log.rows()).unwrap()]
}

#[test]
fn a_constant_is_settled_from_the_first_row_on() {
    let log = log(vec![3.0; 500], vec![-2.0; 500]);
    for (text, left) in [("..10", 1.0), ("2..", 0.0), ("2..10", 0.0)] {
        let seen = Prefiltered::new(&band(text), &log, &["u".into()], "y").unwrap();
        let record = seen.record(&all(&log)).unwrap();
        assert!(record.inputs[0].iter().all(|u| (u - 3.0 * left).abs() < 1e-12), "{text}");
        assert!(record.output.iter().all(|y| (y + 2.0 * left).abs() < 1e-12), "{text}");
    }
}

#[test]
fn the_equation_of_a_plant_holds_for_what_is_left() {
    // y(t) = 0.9 y(t - 1) + 0.5 u(t - 1), not at rest, with a hole.
    let u = Noise(1).take(3000);
    let mut y = vec![5.0];
    (1..3000).for_each(|t| y.push(0.9 * y[t - 1] + 0.5 * u[t - 1]));
    y[1500] = f64::NAN;
    let log = log(u, y);
    let seen = Prefiltered::new(&band("1..10"), &log, &["u".into()], "y").unwrap();
    let settling = band("1..10").filter(STEP).unwrap().settling;
    assert!((100..300).contains(&settling), "{settling}");
    let record = seen.record(&all(&log)).unwrap();
    assert_eq!(record.segments, [settling..1500, 1501 + settling..3000]);
    assert_eq!(record.past, [settling, settling]);
    assert_eq!(seen.warning(&all(&log)).unwrap(), None);
    let size = record.segments.iter().cloned().flatten().map(|t| record.output[t].abs()).fold(0.0, f64::max);
    for t in record.segments.iter().cloned().flatten() {
        let error = record.output[t] - 0.9 * record.output[t - 1] - 0.5 * record.inputs[0][t - 1];
        // 1 % of the slowest mode is left at the first row.
        assert!(error.abs() < 0.01 * size, "{t}: {error}");
    }
    // Rows that begin later have the rows before them to settle in.
    let late = seen.record(&["801..1400".parse().unwrap()]).unwrap();
    assert!(late.segments.iter().eq([&(800..1400)]) && late.past == [800]);
    // A band that settles too slowly for the log is told.
    let slow = Prefiltered::new(&band("0.1.."), &log, &["u".into()], "y").unwrap();
    assert_eq!(slow.record(&all(&log)).unwrap().segments, [375..1500, 1501 + 374..3000]);
    assert!(slow.warning(&all(&log)).unwrap().unwrap().contains("settles in 1"));
}
