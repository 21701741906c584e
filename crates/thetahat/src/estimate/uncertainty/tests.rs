use thetahat_numerics::noise::Noise;
use thetahat_numerics::regression::divide;

use super::*;
use crate::model::polynomial::inverse_series;

/// sum zeta zeta' from the matrix of psi.
fn dense(
    signals: &[&[f64]],
    taps: &[Taps],
    segment: &Range<usize>,
    rows: &Range<usize>,
    combination: Option<&DMatrix<f64>>,
    monic: &[f64],
) -> DMatrix<f64> {
    let columns: Vec<(usize, usize, f64)> = taps
        .iter()
        .flat_map(|taps| (0..taps.count).map(|i| (taps.signal, taps.first + i, taps.sign)))
        .collect();
    let sample = |row: usize, (signal, lag, sign): (usize, usize, f64)| {
        if row < segment.start + lag { 0.0 } else { sign * signals[signal][row - lag] }
    };
    let psi =
        DMatrix::from_fn(rows.len(), columns.len(), |row, column| sample(rows.start + row, columns[column]));
    let psi = combination.map_or(psi.clone(), |combination| psi * combination.transpose());
    // zeta(t) = sum_k h_k psi(t + k).
    let series = inverse_series(monic, rows.len());
    let zeta = DMatrix::from_fn(psi.nrows(), psi.ncols(), |row, column| {
        (row..psi.nrows()).map(|later| series[later - row] * psi[(later, column)]).sum::<f64>()
    });
    zeta.transpose() * zeta
}

#[test]
fn products_of_backward_filtered_columns_are_those_of_the_matrix() {
    let mut noise = Noise(1);
    let signals: Vec<Vec<f64>> = (0..3).map(|_| noise.take(1300)).collect();
    let signals: Vec<&[f64]> = signals.iter().map(Vec::as_slice).collect();
    let taps = [
        Taps { signal: 0, first: 1, count: 2, sign: -1.0 },
        Taps { signal: 2, first: 0, count: 3, sign: 1.0 },
        Taps { signal: 1, first: 7, count: 1, sign: 1.0 },
    ];
    let combination = DMatrix::from_fn(4, 6, |_, _| noise.uniform());
    // Within a block, on its boundary, across, and shorter than any lag.
    for (segment, rows) in [
        (0..1300, 0..1300),
        (10..700, 10..700),
        (100..1124, 100..1124),
        (5..1290, 25..1101),
        (40..43, 40..43),
        (40..43, 43..43),
    ] {
        for monic in [&[1.0][..], &[1.0, -0.9], &[1.0, -1.6, 0.8, 0.1, -0.05]] {
            for combination in [None, Some(&combination)] {
                let found = backward_filtered_products(
                    &signals,
                    &taps,
                    &segment,
                    std::slice::from_ref(&rows),
                    combination,
                    monic,
                );
                let expected = dense(&signals, &taps, &segment, &rows, combination, monic);
                assert!(
                    (&found - &expected).amax() <= 1e-12 * expected.amax(),
                    "{segment:?} {rows:?} {monic:?}"
                );
            }
        }
    }
}

#[test]
fn the_colour_of_residuals_is_found() {
    let mut noise = Noise(2);
    let segments = [0..3000, 3001..3004, 3010..6000];
    let e = noise.take(6000);
    for monic in [&[1.0][..], &[1.0, -0.8], &[1.0, -1.2, 0.7]] {
        let mut v = e.clone();
        divide(monic, &mut v);
        let found = autoregression(&v, &segments, 4);
        // MDL takes more coefficients than there are in a few records of a hundred.
        assert_eq!(found.order(), monic.len() - 1, "{found:?}");
        assert!(
            found.monic.iter().zip(monic).all(|(found, given)| (found - given).abs() < 0.05),
            "{found:?}"
        );
        // The variance of uniform noise.
        assert!((found.variance * 3.0 - 1.0).abs() < 0.06, "{found:?}");
    }
}

#[test]
fn residuals_of_any_kind_have_a_colour() {
    let mut noise = Noise(3);
    let whole = 0..100;
    let all = std::slice::from_ref(&whole);
    assert_eq!(autoregression(&[0.0; 100], all, 2), Autoregression { monic: vec![1.0], variance: 0.0 });
    // A line is all but unstable.
    let line: Vec<f64> = (0..100).map(f64::from).collect();
    assert!(autoregression(&line, all, 2).variance.is_finite());
    let short: Vec<Range<usize>> = (0..20).map(|k| 5 * k..5 * k + 3).collect();
    let found = autoregression(&noise.take(100), &short, 2);
    assert!(found.order() <= 1 && found.variance > 0.0);
    assert!(autoregression(&noise.take(4), std::slice::from_ref(&(0..4)), 4).variance.is_finite());
}

#[test]
fn white_residuals_have_the_covariance_of_least_squares() {
    let mut noise = Noise(4);
    let x = noise.take(1500);
    let taps = [Taps { signal: 0, first: 0, count: 3, sign: 1.0 }];
    let whole = 0..1500;
    let products =
        backward_filtered_products(&[&x], &taps, &whole, std::slice::from_ref(&whole), None, &[1.0]);
    let left = products.clone().try_inverse().unwrap();
    assert!((coloured(&left, 0.3, &products) - &left * 0.3).amax() < 1e-12 * left.amax());
}

#[test]
fn the_colour_of_errors_is_found_behind_a_fit_that_took_some() {
    // Slow errors, and slow columns that explain a part of them: the residuals look too fast.
    let mut noise = Noise(3);
    let (mut residual, mut found) = (0.0, 0.0);
    let (samples, runs) = (50, 200);
    for _ in 0..runs {
        let mut v = noise.take(samples + 100);
        divide(&[1.0, -0.8], &mut v);
        let v = DVector::from_column_slice(&v[100..]);
        let mut psi: Vec<Vec<f64>> = (0..4).map(|_| noise.take(samples + 100)).collect();
        psi.iter_mut().for_each(|column| {
            divide(&[1.0, -0.8], column);
            column.drain(..100);
        });
        let matrix = DMatrix::from_fn(samples, 4, |t, k| psi[k][t]);
        let weights = (matrix.transpose() * &matrix).try_inverse().unwrap() * matrix.transpose() * &v;
        let left: Vec<f64> = (v - matrix * weights).iter().copied().collect();
        let whole = 0..samples;
        let segments = std::slice::from_ref(&whole);
        let pole = |colour: &Autoregression| -colour.monic.get(1).copied().unwrap_or(0.0);
        residual += pole(&autoregression(&left, segments, 4)) / f64::from(runs);
        found += pole(&restricted(&left, || psi.clone(), segments, 4)) / f64::from(runs);
        // Without parameters there is nothing to make up for.
        assert_eq!(
            restricted(&left, Vec::new, segments, 4).order(),
            autoregression(&left, segments, 0).order()
        );
    }
    assert!(residual < 0.7 && found > residual + 0.05 && found < 0.85, "{residual} {found}");
}

#[test]
fn coloured_errors_are_fewer_than_their_number() {
    let colour = |monic: &[f64]| Autoregression { monic: monic.to_vec(), variance: 1.0 };
    assert_eq!(colour(&[1.0]).inflation(50, 4), 1.0);
    // rho_k = a^|k|: (1 + a^2)/(1 - a^2) times fewer.
    let degrees = 200.0 * (1.0 - 0.64) / (1.0 + 0.64) - 4.0;
    let expected = degrees / (degrees - 2.0) * 194.0 / 196.0;
    assert!((colour(&[1.0, -0.8]).inflation(200, 4) - expected).abs() < 1e-12);
    assert!(
        (power(&[1.0, -1.2, 0.7])
            - inverse_series(&[1.0, -1.2, 0.7], 500).iter().map(|h| h * h).sum::<f64>())
        .abs()
            < 1e-9
    );
}
