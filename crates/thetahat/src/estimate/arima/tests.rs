use std::ops::ControlFlow;

use super::*;

fn monitor(_: thetahat_numerics::optimize::Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// White noise between -1 and 1.
fn noise(rows: usize) -> Vec<f64> {
    let mut random = 3_u32;
    let next = || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(random >> 8) / f64::from(1 << 23) - 1.0
    };
    std::iter::repeat_with(next).take(rows).collect()
}

/// A process with these parameters of the factors, from zeros.
fn process(orders: &ArimaOrders, parameters: &[f64], rows: usize) -> Vec<f64> {
    let expanded = orders.expanded(parameters, false);
    let d = crate::model::polynomial::product(&expanded.a, &orders.differencing());
    let e = noise(rows);
    let mut z = vec![0.0; rows];
    for t in 0..rows {
        let moving: f64 = expanded.c.iter().take(t + 1).enumerate().map(|(lag, c)| c * e[t - lag]).sum();
        z[t] = moving - (1..d.len().min(t + 1)).map(|lag| d[lag] * z[t - lag]).sum::<f64>();
    }
    z
}

fn data<'a>(output: &'a [f64], columns: Vec<Vec<f64>>, orders: &ArimaOrders) -> ArimaData<'a> {
    let nk = vec![0; columns.len()];
    let segments = std::iter::once(0..output.len()).collect();
    ArimaData { output, columns, segments, names: orders.all_names(false, false, &nk) }
}

fn found(data: &ArimaData<'_>, orders: &ArimaOrders) -> Result<ArimaEstimate, Error> {
    arima(data, orders, &Search::default(), &monitor)
}

#[test]
fn the_gradient_is_that_of_differences_of_the_cost() {
    let orders = ArimaOrders::new([1, 1, 1], Some([1, 0, 1, 4])).unwrap();
    let own = [0.5, 0.3, 0.4, -0.6];
    for missing in [false, true] {
        let mut y = process(&orders, &own, 120);
        let column = noise(130)[10..].to_vec();
        y.iter_mut().zip(&column).for_each(|(y, u)| *y += 2.0 * u);
        if missing {
            [7, 50, 51, 90].iter().for_each(|row| y[*row] = f64::NAN);
        }
        let data = data(&y, vec![column], &orders);
        let mut likelihood = Likelihood::new(&data, &orders);
        let at = [1.8, 0.4, 0.2, 0.3, -0.5];
        likelihood.evaluate(&at).unwrap();
        likelihood.linearize().unwrap();
        let right = likelihood.right().to_vec();
        for (place, right) in right.iter().enumerate() {
            let mut cost = |step: f64| {
                let mut moved = at;
                moved[place] += step;
                likelihood.evaluate(&moved).unwrap()
            };
            let slope = (cost(1e-5) - cost(-1e-5)) / 2e-5;
            assert!((slope + 2.0 * right).abs() < 1e-5 * (1.0 + slope.abs()), "{place}: {slope} {right}");
        }
    }
}

#[test]
fn parameters_of_a_simulated_process_are_found() {
    for (order, seasonal, own) in [
        ([1, 0, 1], None, vec![0.7, 0.4]),
        ([0, 1, 1], Some([0, 1, 1, 12]), vec![-0.4, -0.6]),
        ([1, 1, 1], Some([0, 1, 1, 4]), vec![0.6, 0.5, -0.5]),
        // More lags than a season has rows.
        ([3, 0, 0], Some([1, 0, 0, 2]), vec![0.3, 0.2, -0.4, 0.3]),
        // A season of which no matrix is made.
        ([0, 0, 1], Some([1, 0, 0, 168]), vec![0.5, 0.4]),
    ] {
        let orders = ArimaOrders::new(order, seasonal).unwrap();
        let y = process(&orders, &own, 2000);
        let found = found(&data(&y, Vec::new(), &orders), &orders).unwrap();
        let covariance = found.covariance.unwrap();
        assert_eq!(found.outcome.search.stopped, Stopped::Converged, "{orders}");
        assert!(!found.outcome.search.stability_bound, "{orders}");
        for (place, (value, truth)) in found.parameters.iter().zip(&own).enumerate() {
            let error = covariance[place][place].sqrt();
            assert!((value - truth).abs() < 4.0 * error, "{orders} {place}: {value} {truth} {error}");
        }
        assert!((found.noise_variance - 1.0 / 3.0).abs() < 0.03, "{orders}");
    }
}

#[test]
fn a_difference_too_many_is_told() {
    let orders = ArimaOrders::new([0, 1, 1], None).unwrap();
    // Of some series of white noise the likelihood is largest on the circle, of others near to it.
    let told = (0..10).filter(|part| {
        let y = noise(1500)[part * 150..(part + 1) * 150].to_vec();
        let found = found(&data(&y, Vec::new(), &orders), &orders).unwrap();
        assert_eq!(found.outcome.search.stopped, Stopped::Converged);
        assert!(found.parameters[0] < -0.9, "{:?}", found.parameters);
        assert_eq!(found.held, [found.outcome.search.stability_bound]);
        found.held[0] && found.parameters[0] < -0.999
    });
    assert!(told.count() >= 4);
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let refused = |y: &[f64], columns: Vec<Vec<f64>>, orders: &ArimaOrders| {
        found(&data(y, columns, orders), orders).unwrap_err().to_string()
    };
    let airline = ArimaOrders::new([0, 1, 1], Some([0, 1, 1, 12])).unwrap();
    let walk = ArimaOrders::new([1, 1, 0], None).unwrap();
    let few = refused(&noise(15), Vec::new(), &airline);
    assert!(few.contains("there are 2") && few.contains("takes the first 13"), "{few}");
    assert!(refused(&[5.0; 40], Vec::new(), &walk).contains("no noise to describe"));
    assert!(refused(&[f64::NAN; 40], Vec::new(), &walk).contains("too few rows"));
    assert!(refused(&noise(40), vec![vec![1.0; 40]], &walk).contains("differencing takes it"));
    let huge: Vec<f64> = noise(40).iter().map(|value| value * 1e300).collect();
    assert!(refused(&huge, Vec::new(), &walk).contains("scale"));
    // A random walk has no parameters, and a variance.
    let plain = ArimaOrders::new([0, 1, 0], None).unwrap();
    let y = process(&plain, &[], 300);
    let known = found(&data(&y, Vec::new(), &plain), &plain).unwrap();
    assert!(known.parameters.is_empty() && (known.noise_variance - 1.0 / 3.0).abs() < 0.05);
}
