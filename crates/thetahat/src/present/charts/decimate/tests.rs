use super::*;

fn seconds(rows: usize) -> Vec<f64> {
    (0..rows).map(|row| row as f64).collect()
}

#[test]
fn short_signals_stay_as_they_are() {
    let curve = decimate(&seconds(4), &[1.0, -2.0, 0.5, 0.5], 4, 1.5);
    assert_eq!(curve, Curve { x: seconds(4), y: vec![1.0, -2.0, 0.5, 0.5] });
    assert_eq!(decimate(&[], &[], 4, 1.5), Curve::default());
    assert_eq!(decimate(&seconds(2), &[f64::NAN; 2], 4, 1.5), Curve::default());
    assert_eq!(decimate(&[3.0], &[7.0], 0, 1.5), Curve { x: vec![3.0], y: vec![7.0] });
}

#[test]
fn peaks_the_first_and_the_last_value_stay_in_their_order() {
    let rows = 100_000;
    let mut values: Vec<f64> = (0..rows).map(|row| (row as f64 * 0.01).sin()).collect();
    (values[31_007], values[31_011], values[77_777]) = (50.0, -60.0, 40.0);
    let curve = decimate(&seconds(rows), &values, 2000, 1.5);
    assert!((1900..=2010).contains(&curve.x.len()), "{}", curve.x.len());
    assert!(curve.x.is_sorted());
    assert_eq!((curve.x[0], curve.x[curve.x.len() - 1]), (0.0, 99_999.0));
    let peak = |value: f64| curve.y.iter().position(|y| *y == value).map(|at| curve.x[at]);
    assert_eq!((peak(50.0), peak(-60.0), peak(40.0)), (Some(31_007.0), Some(31_011.0), Some(77_777.0)));
    // Every point is one of the signal, to the digits shown.
    let close = |(x, y): (&f64, &f64)| (values[*x as usize] - y).abs() < 1e-5;
    assert!(curve.x.iter().zip(&curve.y).all(close));
}

#[test]
fn gaps_stay_gaps() {
    let mut values = vec![1.0; 10_000];
    values[0] = f64::NAN;
    values[5000] = f64::NAN;
    values[7000..9000].fill(f64::NAN);
    let curve = decimate(&seconds(10_000), &values, 100, 1.5);
    assert_eq!(curve.y.iter().filter(|y| y.is_nan()).count(), 2);
    assert!(!curve.y[0].is_nan() && curve.x[0] == 1.0);
    let around = |row: f64| {
        let after = curve.x.iter().position(|x| *x > row).unwrap();
        curve.y[after - 1].is_nan() || curve.y[after].is_nan()
    };
    assert!(around(5000.0) && around(8000.0) && !around(3000.0));

    // A short signal, and a clock that jumps forward or back.
    let curve = decimate(&[0.0, 1.0, 2.0], &[1.0, f64::NAN, 1.0], 10, 1.5);
    assert!(curve.x == [0.0, 2.0, 2.0] && curve.y[1].is_nan());
    let curve = decimate(&[0.0, 1.0, 5.0, 6.0, 0.0, 1.0], &[1.0; 6], 10, 1.5);
    assert_eq!(curve.x, [0.0, 1.0, 5.0, 5.0, 6.0, 0.0, 0.0, 1.0]);
    assert_eq!(curve.y.iter().filter(|y| y.is_nan()).count(), 2);
}

#[test]
fn digits_are_those_that_change() {
    assert_eq!(rounded(&[1.0 / 3.0, -1.0]), [0.333_333_3, -1.0]);
    // Two of the eight digits before the point never change.
    assert_eq!(rounded(&[101_325.123_456_789, 101_326.0]), [101_325.123_456_8, 101_326.0]);
    assert_eq!(rounded(&[0.1 + 0.2, f64::MAX]), [0.3, 1.797_693e308]);
    assert!(rounded(&[f64::NAN])[0].is_nan());
}
