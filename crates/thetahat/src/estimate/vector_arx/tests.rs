use thetahat_numerics::random::Random;

use super::*;
use crate::data::Record;
use crate::estimate::{Initial, arx};
use crate::model::Orders as PolynomialOrders;

const A: [[[f64; 2]; 2]; 2] = [[[-0.9, 0.3], [0.2, -0.5]], [[0.4, 0.0], [-0.1, 0.2]]];
const B: [[[f64; 1]; 2]; 2] = [[[1.0], [0.5]], [[-0.4], [0.8]]];

/// u, y1 and y2 of A(q) y = B(q) u(t-1) + e with levels of the outputs.
fn signals(rows: usize, noise: f64, levels: [f64; 2], seed: u64) -> [Vec<f64>; 3] {
    simulated(rows, noise, levels, seed, Coupling::Full)
}

/// The same where without coupling A is diagonal.
fn simulated(rows: usize, noise: f64, levels: [f64; 2], seed: u64, coupling: Coupling) -> [Vec<f64>; 3] {
    let mut random = Random::of(seed, 0);
    let (mut u, mut y): (Vec<f64>, [Vec<f64>; 2]) = (Vec::new(), [Vec::new(), Vec::new()]);
    for t in 0..rows {
        let mut next = [noise * random.normal(), noise * random.normal()];
        next[1] += 0.5 * next[0];
        for output in 0..2 {
            for lag in (1..=2).filter(|lag| *lag <= t) {
                let past = (0..2)
                    .filter(|other| coupling == Coupling::Full || *other == output)
                    .map(|other| A[lag - 1][output][other] * y[other][t - lag])
                    .sum::<f64>();
                next[output] += B[lag - 1][output][0] * u[t - lag] - past;
            }
        }
        u.push(random.normal());
        y[0].push(next[0]);
        y[1].push(next[1]);
    }
    let [mut first, mut second] = y;
    first.iter_mut().for_each(|value| *value += levels[0]);
    second.iter_mut().for_each(|value| *value += levels[1]);
    [u, first, second]
}

fn options(
    na: RangeInclusive<usize>,
    nb: RangeInclusive<usize>,
    coupling: Option<Coupling>,
) -> VectorArxOptions {
    VectorArxOptions {
        na,
        nb: VectorArxInputs::Alike(nb),
        coupling,
        delay: 0..=0,
        direct: false,
        constant: false,
    }
}

fn record([u, first, second]: &[Vec<f64>; 3]) -> Result<JointRecord<'_>, Error> {
    JointRecord::new(vec![u], vec![first, second])
}

#[test]
fn exact_data_give_the_coefficients() -> Result<(), Error> {
    let signals = signals(200, 0.0, [3.0, -2.0], 1);
    let asked = VectorArxOptions { constant: true, ..options(2..=2, 2..=2, Some(Coupling::Full)) };
    let found = vector_arx(&record(&signals)?, &asked, 1.0)?;
    for (lag, (a, b)) in A.iter().zip(&B).enumerate() {
        let rows = a.iter().flatten().zip(found.outcome.a[lag].iter().flatten());
        let inputs = b.iter().flatten().zip(&found.outcome.b[0][lag]);
        for (expected, quantity) in rows.chain(inputs) {
            assert!((quantity.value - expected).abs() < 1e-6, "{} {expected}", quantity.value);
        }
    }
    assert!(
        (found.levels[0] - 3.0).abs() < 1e-5 && (found.levels[1] + 2.0).abs() < 1e-5,
        "{:?}",
        found.levels
    );
    Ok(())
}

#[test]
fn the_state_space_predicts_as_the_regression_does() -> Result<(), Error> {
    let signals = signals(2000, 0.5, [0.0, 0.0], 2);
    let record = record(&signals)?;
    for direct in [false, true] {
        for coupling in Coupling::ALL {
            let asked = VectorArxOptions { direct, ..options(2..=2, 3..=3, Some(coupling)) };
            let found = vector_arx(&record, &asked, 1.0)?;
            let StateSpace { f, g, h, d, k, noise_covariance, .. } = &found.space;
            let VectorArxOutcome { a, b, .. } = &found.outcome;
            let first = usize::from(!direct);
            let (mut x, mut sum) = (DVector::zeros(f.nrows()), DMatrix::zeros(2, 2));
            for t in 0..2000 {
                let u = DVector::from_element(1, signals[0][t]);
                let y = DVector::from_column_slice(&[signals[1][t], signals[2][t]]);
                let e = &y - h * &x - d * &u;
                x = f * x + g * u + k * &e;
                // From where the regression begins the state of rest says as little as it does.
                if t < 3 - usize::from(direct) {
                    continue;
                }
                let of = |output: usize| {
                    let past = (1..=2).flat_map(|lag| (0..2).map(move |other| (lag, other)));
                    let past: f64 = past
                        .map(|(lag, other)| a[lag - 1][output][other].value * signals[1 + other][t - lag])
                        .sum();
                    let driven: f64 =
                        (0..3).map(|place| b[0][place][output].value * signals[0][t - first - place]).sum();
                    y[output] + past - driven
                };
                let own = DVector::from_column_slice(&[of(0), of(1)]);
                if t >= 200 {
                    assert!((&own - &e).norm() < 1e-9, "{direct} {coupling} {t}: {own} {e}");
                }
                sum += &own * own.transpose();
            }
            let mean = sum / (2000 - 3 + usize::from(direct)) as f64;
            assert!((&mean - noise_covariance).norm() < 1e-9 * mean.norm(), "{mean} {noise_covariance}");
            let others = found.space.f.shape();
            assert_eq!(others, if direct { (4, 4) } else { (6, 6) });
        }
    }
    Ok(())
}

#[test]
fn without_coupling_each_output_is_fitted_as_if_alone() -> Result<(), Error> {
    let signals = signals(500, 0.5, [0.0, 0.0], 3);
    let found = vector_arx(&record(&signals)?, &options(2..=2, 2..=2, Some(Coupling::None)), 1.0)?;
    for output in 0..2 {
        let alone = Record::new(&signals[1 + output], vec![&signals[0]])?;
        let alone = arx(&alone, &PolynomialOrders::arx(2, &[2], &[1])?, Initial::Drop)?;
        let covariance = alone.covariance().ok_or_else(|| Error::data("no covariance"))?;
        let outcome = &found.outcome;
        let own = (0..2).map(|lag| outcome.a[lag][output][output]);
        for (place, quantity) in own.chain((0..2).map(|lag| outcome.b[0][lag][output])).enumerate() {
            assert!((quantity.value - alone.parameters()[place]).abs() < 1e-9);
            let error = covariance[place][place].sqrt();
            assert!((quantity.standard_error.unwrap_or(0.0) / error - 1.0).abs() < 1e-6);
        }
        assert_eq!(outcome.a[0][output][1 - output].standard_error, None);
    }
    Ok(())
}

#[test]
fn the_least_mdl_has_the_orders_of_the_plant() -> Result<(), Error> {
    let signals = signals(3000, 0.5, [0.0, 0.0], 4);
    let record = record(&signals)?;
    let found = vector_arx(&record, &options(1..=5, 1..=5, None), 1.0)?;
    let VectorArxOutcome { na, nb, coupling, tried, .. } = &found.outcome;
    assert_eq!((*na, nb.as_slice(), *coupling, tried.len()), (2, [2].as_slice(), Coupling::Full, 50));
    // All on the same rows: those of the longest.
    let least = tried.iter().map(|score| score.mdl).fold(f64::INFINITY, f64::min);
    assert_eq!(least, found.mdl);
    Ok(())
}

/// A range of delays is searched on the products of the other models, and ends at the model of an input that was moved
/// before.
#[test]
fn the_least_mdl_has_the_delay_of_the_plant() -> Result<(), Error> {
    let mut signals = signals(2000, 0.5, [3.0, -2.0], 5);
    // The input in the log is three samples early.
    let late = signals[0].clone();
    signals[0].rotate_left(3);
    let length = late.len() - 3;
    signals.iter_mut().for_each(|signal| signal.truncate(length));
    for (direct, coupling) in [(false, Coupling::Full), (true, Coupling::None)] {
        let orders = options(1..=3, 1..=3, Some(coupling));
        let asked = VectorArxOptions { direct, delay: 0..=5, constant: true, ..orders };
        let found = vector_arx(&record(&signals)?, &asked, 1.0)?;
        let VectorArxOutcome { na, nb, nk, tried, .. } = &found.outcome;
        let first = usize::from(!direct);
        // Where an input may act at once it acts a sample later: four after the log has it.
        assert_eq!((found.delay + first, nk.as_slice()), (4, [4].as_slice()), "{direct} {na} {nb:?}");
        assert_eq!(tried.len(), 3 * 3 * 6);
        let least = tried.iter().min_by(|one, other| one.mdl.total_cmp(&other.mdl));
        assert!(least.is_some_and(|least| least.mdl == found.mdl && least.nk == [4]), "{least:?}");
        let moved = record(&signals)?.delayed(&[found.delay]);
        let asked = VectorArxOptions { delay: 0..=0, ..options(*na..=*na, nb[0]..=nb[0], Some(coupling)) };
        let alone = vector_arx(&moved, &VectorArxOptions { direct, constant: true, ..asked }, 1.0)?;
        assert_eq!((&alone.space, &alone.levels), (&found.space, &found.levels));
        assert_eq!(alone.samples, found.samples);
    }
    Ok(())
}

/// What the covariance of the entries says of a static gain is what happens to it.
#[test]
fn errors_are_those_of_many_runs() -> Result<(), Error> {
    for (direct, coupling) in [(false, Coupling::Full), (true, Coupling::Full), (false, Coupling::None)] {
        let gain = |seed: u64| -> Result<(f64, f64), Error> {
            // In units of very different sizes.
            let mut signals = simulated(400, 0.5, [0.0, 0.0], 100 + seed, coupling);
            for (signal, size) in signals.iter_mut().zip([1e3, 1e-6, 1e7]) {
                signal.iter_mut().for_each(|value| *value *= size);
            }
            let asked = VectorArxOptions { direct, ..options(2..=2, 2..=2, Some(coupling)) };
            let found = vector_arx(&record(&signals)?, &asked, 1.0)?;
            let signal = |name: &str| crate::model::Signal { name: name.to_owned(), ..Default::default() };
            let named = (vec![signal("u")], vec![signal("y1"), signal("y2")]);
            let model = crate::model::StateSpaceModel::new(named, vec![0], &found.space, 12, None)?;
            // All poles of the plant are inside.
            assert!(model.stable, "{:?}", model.poles);
            let covariance = found.covariance.ok_or_else(|| Error::data("no covariance"))?;
            let gain = model.with_covariance(covariance).dc_gain[1][0];
            let gain = gain.ok_or_else(|| Error::data("no gain"))?;
            Ok((gain.value, gain.standard_error.ok_or_else(|| Error::data("no error"))?))
        };
        let runs = (0..200).map(gain).collect::<Result<Vec<_>, Error>>()?;
        let mean = runs.iter().map(|run| run.0).sum::<f64>() / 200.0;
        let spread = (runs.iter().map(|run| (run.0 - mean).powi(2)).sum::<f64>() / 199.0).sqrt();
        let said = runs.iter().map(|run| run.1).sum::<f64>() / 200.0;
        // The deviation of 200 numbers is known to 5 %.
        assert!((said / spread - 1.0).abs() < 0.15, "{direct} {coupling}: {said} {spread}");
    }
    Ok(())
}

#[test]
fn what_cannot_be_solved_is_refused() -> Result<(), Error> {
    let [u, first, _] = signals(200, 0.5, [0.0, 0.0], 5);
    let doubled: Vec<f64> = first.iter().map(|value| 2.0 * value).collect();
    let dependent = [u.clone(), first.clone(), doubled];
    let refused = vector_arx(&record(&dependent)?, &options(1..=1, 1..=1, Some(Coupling::Full)), 1.0);
    assert!(
        refused.is_err_and(|error| error.to_string().contains("output 2(k-1) follows from the regressors"))
    );
    let short = [u[..8].to_vec(), first[..8].to_vec(), u[1..9].to_vec()];
    let refused = vector_arx(&record(&short)?, &options(2..=2, 2..=2, None), 1.0);
    assert!(refused.is_err_and(|error| error.to_string().contains("there must be more")));
    let refused = vector_arx(&record(&short)?, &options(0..=0, 0..=0, None), 1.0);
    assert!(refused.is_err_and(|error| error.to_string().contains("no coefficients")));
    Ok(())
}

#[test]
fn intervals_of_coefficients_cover_the_truth() -> Result<(), Error> {
    let (mut covered, mut all) = (0, 0);
    for seed in 0..100 {
        let signals = signals(400, 0.5, [0.0, 0.0], 500 + seed);
        let found = vector_arx(&record(&signals)?, &options(2..=2, 2..=2, Some(Coupling::Full)), 1.0)?;
        let own =
            found.outcome.a.iter().flatten().flatten().chain(found.outcome.b.iter().flatten().flatten());
        let truth = A.iter().flatten().flatten().chain(B.iter().flatten().flatten());
        for (quantity, truth) in own.zip(truth) {
            let error = quantity.standard_error.ok_or_else(|| Error::data("no error"))?;
            covered += usize::from((quantity.value - truth).abs() < 1.96 * error);
            all += 1;
        }
    }
    let fraction = f64::from(u32::try_from(covered).unwrap_or(0)) / f64::from(all);
    assert!((0.93..0.97).contains(&fraction), "{fraction}");
    Ok(())
}

#[test]
fn grids_that_take_too_long_are_refused() -> Result<(), Error> {
    let signals = signals(3000, 0.5, [0.0, 0.0], 6);
    let refused = vector_arx(&record(&signals)?, &options(1..=200, 1..=200, None), 1.0);
    assert!(refused.is_err_and(|error| error.to_string().contains("narrower ranges")));
    Ok(())
}
