use thetahat_core::nalgebra::DMatrix;

use super::arma::Arma;
use super::*;

/// The autocovariances of A w = C e, from its impulse response.
fn covariances(orders: &ArimaOrders, parameters: &[f64], lags: usize) -> Vec<f64> {
    let expanded = orders.expanded(parameters, false);
    let mut h = vec![0.0; 4000];
    for t in 0..h.len() {
        let past = (1..expanded.a.len().min(t + 1)).map(|lag| expanded.a[lag] * h[t - lag]).sum::<f64>();
        h[t] = expanded.c.get(t).copied().unwrap_or(0.0) - past;
    }
    (0..lags).map(|lag| h.iter().zip(&h[lag..]).map(|(one, other)| one * other).sum()).collect()
}

/// ln L of the measured values of differences with var e = 1, by their covariance matrix.
fn dense(orders: &ArimaOrders, parameters: &[f64], w: &[(usize, f64)]) -> f64 {
    let r = covariances(orders, parameters, w.iter().map(|(row, _)| row + 1).max().unwrap());
    let matrix = DMatrix::from_fn(w.len(), w.len(), |i, j| r[w[i].0.abs_diff(w[j].0)]);
    let factor = matrix.cholesky().unwrap();
    let values = DMatrix::from_iterator(w.len(), 1, w.iter().map(|(_, value)| *value));
    let solved = factor.l().solve_lower_triangular(&values).unwrap();
    let logarithms: f64 = factor.l().diagonal().iter().map(|l| 2.0 * l.ln()).sum();
    -0.5 * (w.len() as f64 * std::f64::consts::TAU.ln() + logarithms + solved.norm_squared())
}

/// The same of innovations.
fn filtered(found: &Scanned) -> f64 {
    let known = || found.errors.iter().zip(&found.variances).filter(|(v, _)| !v.is_nan());
    let sum: f64 = known().map(|(v, f)| v * v / f + f.ln()).sum();
    -0.5 * (known().count() as f64 * std::f64::consts::TAU.ln() + sum)
}

fn values(rows: usize) -> Vec<f64> {
    let mut random = 7_u32;
    let next = || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(random >> 8) / f64::from(1 << 23) - 1.0
    };
    std::iter::repeat_with(next).take(rows).collect()
}

/// (p, d, q), (P, D, Q, s) and the parameters.
type Case = ([usize; 3], Option<[usize; 4]>, &'static [f64]);

const CASES: [Case; 7] = [
    ([1, 0, 0], None, &[0.7]),
    ([0, 0, 1], None, &[0.9]),
    ([2, 0, 1], None, &[0.6, -0.3, 0.5]),
    ([0, 1, 1], Some([0, 1, 1, 12]), &[-0.4, -0.55]),
    ([1, 1, 1], Some([1, 0, 1, 4]), &[0.5, 0.3, 0.6, -0.4]),
    ([3, 0, 0], Some([1, 0, 0, 2]), &[0.2, 0.1, 0.3, -0.5]),
    ([0, 2, 0], None, &[]),
];

#[test]
fn the_likelihood_is_that_of_the_covariance_matrix_of_the_differences() {
    for (order, seasonal, parameters) in CASES {
        let orders = ArimaOrders::new(order, seasonal).unwrap();
        let y = values(90);
        let process = ArimaProcess::new(&orders, parameters, false).unwrap();
        let rows = ArimaProcess::expected(&y, orders.differences()).unwrap();
        assert_eq!(rows, orders.differences()..90);
        let w: Vec<(usize, f64)> = process.differenced(&y, &rows).into_iter().enumerate().collect();
        let expected = dense(&orders, parameters, &w);
        let found = filtered(&process.scan(&y, &[], rows.clone(), false));
        assert!((found - expected).abs() < 1e-9 * expected.abs(), "{orders}: {found} {expected}");
        // The filter of missing values is the same where none is.
        let mut longer = y.clone();
        longer.extend([f64::NAN, 0.3]);
        let all = process.scan(&longer, &[], rows.start..92, false);
        let whole = process.scan(&y, &[], rows, false);
        let close = |one: &f64, other: &f64| (one - other).abs() < 1e-10 * (1.0 + one.abs());
        assert!(whole.errors.iter().zip(&all.errors).all(|(one, other)| close(one, other)), "{orders}");
        assert!(whole.variances.iter().zip(&all.variances).all(|(one, other)| close(one, other)), "{orders}");
    }
}

#[test]
fn without_differences_missing_values_leave_the_likelihood_of_the_others() {
    for (order, seasonal, parameters) in CASES.into_iter().filter(|(order, _, _)| order[1] == 0) {
        let seasonal = seasonal.map(|[p, _, q, s]| [p, 0, q, s]);
        let orders = ArimaOrders::new(order, seasonal).unwrap();
        let mut y = values(60);
        (0..60).filter(|row| row % 7 == 0 || row % 5 == 1).for_each(|row| y[row] = f64::NAN);
        let rows = ArimaProcess::expected(&y, 0).unwrap();
        let process = ArimaProcess::new(&orders, parameters, false).unwrap();
        let known: Vec<(usize, f64)> = y.iter().copied().enumerate().filter(|(_, y)| !y.is_nan()).collect();
        let expected = dense(&orders, parameters, &known);
        let found = filtered(&process.scan(&y, &[], rows, false));
        assert!((found - expected).abs() < 1e-9 * expected.abs(), "{orders}: {found} {expected}");
    }
}

/// Through missing values of z: those of all z given the first ones, missing ones integrated over.
#[test]
fn with_differences_missing_values_are_integrated_over() {
    for (order, seasonal, parameters) in CASES.into_iter().filter(|(order, _, _)| order[1] > 0) {
        let orders = ArimaOrders::new(order, seasonal).unwrap();
        let n = orders.differences();
        let rows = n + 40;
        let full = values(rows);
        let holes = [n + 3, n + 4, n + 17, n + 30];
        let mut y = full.clone();
        holes.iter().for_each(|row| y[*row] = f64::NAN);
        let process = ArimaProcess::new(&orders, parameters, false).unwrap();
        let expected = ArimaProcess::expected(&y, n).unwrap();
        let found = filtered(&process.scan(&y, &[], expected, false));
        // z after the first n is L^-1 (w - what the first n do), with Delta = L on the others.
        let delta = &process.difference;
        let lower =
            DMatrix::from_fn(
                40,
                40,
                |i, j| {
                    if i >= j { delta.get(i - j).copied().unwrap_or(0.0) } else { 0.0 }
                },
            );
        let r = covariances(&orders, parameters, 40);
        let inverse = lower.clone().try_inverse().unwrap();
        let covariance = &inverse * DMatrix::from_fn(40, 40, |i, j| r[i.abs_diff(j)]) * inverse.transpose();
        let start = DMatrix::from_fn(40, 1, |i, _| {
            let lags = (i + 1..delta.len()).filter(|lag| *lag <= n + i);
            lags.map(|lag| -delta[lag] * full[n + i - lag]).sum::<f64>()
        });
        let mean = &inverse * start;
        let known: Vec<usize> = (0..40).filter(|row| !y[n + row].is_nan()).collect();
        let own = DMatrix::from_fn(known.len(), known.len(), |i, j| covariance[(known[i], known[j])]);
        let left = DMatrix::from_fn(known.len(), 1, |i, _| y[n + known[i]] - mean[(known[i], 0)]);
        let factor = own.cholesky().unwrap();
        let solved = factor.l().solve_lower_triangular(&left).unwrap();
        let logarithms: f64 = factor.l().diagonal().iter().map(|l| 2.0 * l.ln()).sum();
        let reference =
            -0.5 * (known.len() as f64 * std::f64::consts::TAU.ln() + logarithms + solved.norm_squared());
        assert!((found - reference).abs() < 1e-8 * reference.abs(), "{orders}: {found} {reference}");
    }
}

#[test]
fn derivatives_are_those_of_differences() {
    for (order, seasonal, parameters) in CASES {
        let orders = ArimaOrders::new(order, seasonal).unwrap();
        let column: Vec<f64> = values(150).iter().rev().copied().collect();
        for missing in [false, true] {
            let mut y = values(150);
            if missing {
                [20, 21, 60, 61, 62, 100].iter().for_each(|row| y[*row] = f64::NAN);
            }
            let rows = ArimaProcess::expected(&y, orders.differences()).unwrap();
            let at = |parameters: &[f64], slopes: bool| {
                let process = ArimaProcess::new(&orders, parameters, slopes).unwrap();
                process.scan(&y, &[&column], rows.clone(), slopes)
            };
            let found = at(parameters, true);
            for place in 0..parameters.len() {
                let moved = |step: f64| {
                    let mut moved = parameters.to_vec();
                    moved[place] += step;
                    at(&moved, false)
                };
                let (up, down) = (moved(1e-6), moved(-1e-6));
                for t in (0..rows.len()).filter(|t| !found.errors[*t].is_nan()) {
                    let check = |name: &str, own: f64, up: f64, down: f64| {
                        let difference = (up - down) / 2e-6;
                        let close = (own - difference).abs() < 1e-6 * (1.0 + own.abs());
                        assert!(close, "{orders} {missing} {name} {place} {t}: {own} {difference}");
                    };
                    check("v", found.error_slopes[place][t], up.errors[t], down.errors[t]);
                    check("f", found.variance_slopes[place][t], up.variances[t], down.variances[t]);
                }
            }
            // v is linear in the values: what is taken of the column from them is taken from it.
            let less: Vec<f64> = y.iter().zip(&column).map(|(y, u)| y - 2.0 * u).collect();
            let process = ArimaProcess::new(&orders, parameters, false).unwrap();
            let other = process.scan(&less, &[], rows.clone(), false);
            for t in (0..rows.len()).filter(|t| !found.errors[*t].is_nan()) {
                let expected = found.errors[t] - 2.0 * found.columns[0][t];
                assert!((other.errors[t] - expected).abs() < 1e-9, "{orders} {missing} {t}");
            }
        }
    }
}

#[test]
fn a_process_on_the_boundary_has_no_covariance() {
    let orders = ArimaOrders::new([1, 0, 0], Some([1, 0, 0, 4])).unwrap();
    assert!(ArimaProcess::new(&orders, &[0.5, 1.0], false).is_none());
    assert!(ArimaProcess::new(&orders, &[-1.2, 0.3], false).is_none());
    let known = Arma::new(&orders.expanded(&[0.5, 0.3], false)).unwrap();
    // The covariance that the recursion gives has the first column that it was made of.
    let covariance = known.covariance();
    for (row, value) in known.column.iter().enumerate() {
        assert!((covariance[row * known.order] - value).abs() < 1e-12);
    }
}
