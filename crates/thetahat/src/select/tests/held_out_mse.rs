use super::*;
use crate::estimate::arx;

fn grid() -> Grid {
    arx_grid(range(1, 3), &[range(1, 3)], &[range(1, 2)])
}

fn signals() -> (Vec<f64>, Vec<f64>) {
    let mut noise = Noise(23);
    let (u, e) = (noise.take(400), noise.take(400));
    (filtered(&[1.0], &[1.0, -1.3, 0.6], &sum(&filtered(&[0.0, 1.0, 0.5], &[1.0], &u), &e, 0.3)), u)
}

/// sum e^2 of ARX parameters over some samples that have a full regressor.
fn cost(y: &[f64], u: &[f64], orders: &Orders, theta: &[f64], rows: impl Iterator<Item = usize>) -> f64 {
    let error = |t: usize| {
        let past: f64 = (0..orders.na).map(|i| theta[i] * y[t - 1 - i]).sum();
        let driven: f64 = (0..orders.nb[0]).map(|i| theta[orders.na + i] * u[t - orders.nk[0] - i]).sum();
        y[t] + past - driven
    };
    rows.map(|t| error(t) * error(t)).sum()
}

/// The pieces without the samples that a model of this grid does not need.
fn cut(pieces: &[Range<usize>], orders: &Orders) -> Vec<Range<usize>> {
    pieces.iter().map(|piece| piece.start + 4 - orders.maximum_lag()..piece.end).collect()
}

#[test]
fn validation_is_a_loop_of_single_fits() {
    let (y, u) = signals();
    let estimation = record(&y, &[&u], &[0..150, 160..250]);
    let validation = record(&y, &[&u], &[250..300, 310..400]);
    let selection =
        chosen(&estimation, Some(&validation), &Choice::Grid(grid()), Select::Validation, Initial::Auto)
            .unwrap()
            .selection;
    assert_eq!(selection.best.len(), 18);
    for model in &selection.best {
        let orders = &model.orders;
        let found =
            arx(&record(&y, &[&u], &cut(&estimation.segments, orders)), orders, Initial::Drop).unwrap();
        let expected = cost(&y, &u, orders, found.parameters(), (254..300).chain(314..400)) / 132.0;
        assert!(close(model.held_out_mse.unwrap(), expected, 1e-9), "{model:?} {expected}");
        assert_eq!(model.score, model.held_out_mse);
    }
    evaluated(&selection);
}

/// The least comes first, and the smallest within 1 % of it is chosen.
fn evaluated(selection: &Selection) {
    let least = selection.least.as_ref().unwrap();
    assert_eq!(least, &selection.best[0]);
    let limit = 1.01 * least.held_out_mse.unwrap();
    assert!(selection.chosen.held_out_mse.unwrap() <= limit);
    let smaller = |model: &&Candidate| model.parameters < selection.chosen.parameters;
    assert!(selection.best.iter().filter(smaller).all(|model| model.held_out_mse.unwrap() > limit));
    assert_ne!(selection.second.as_ref().unwrap().orders, selection.chosen.orders);
}

#[test]
fn cross_validation_is_a_loop_over_blocks_in_time() {
    let (y, u) = signals();
    let all = record(&y, &[&u], &[0..150, 150..250, 260..400]);
    let selection = chosen(&all, None, &Choice::Grid(grid()), Select::Cv, Initial::Auto).unwrap().selection;
    // 390 samples in fifths of 78; the clock has a gap at 150.
    let one = std::slice::from_ref::<Range<usize>>;
    let blocks =
        [one(&(0..78)), &[78..150, 150..156], one(&(156..234)), &[234..250, 260..322], one(&(322..400))];
    for model in &selection.best {
        let orders = &model.orders;
        let (mut sum, mut count) = (0.0, 0);
        for left_out in 0..5 {
            let others = (0..5).filter(|k| *k != left_out).flat_map(|k| cut(blocks[k], orders));
            let found = arx(&record(&y, &[&u], &others.collect::<Vec<_>>()), orders, Initial::Drop).unwrap();
            let rows = || blocks[left_out].iter().flat_map(|piece| piece.start + 4..piece.end);
            sum += cost(&y, &u, orders, found.parameters(), rows());
            count += rows().count();
        }
        assert!(close(model.held_out_mse.unwrap(), sum / count as f64, 1e-9), "{model:?}");
    }
    evaluated(&selection);
}

#[test]
fn models_that_need_a_search_are_validated_too() {
    let mut noise = Noise(30);
    let (u, e) = (noise.take(1000), noise.take(1000));
    let y = sum(&filtered(&[0.0, 1.0], &[1.0, -0.8], &u), &e, 0.3);
    let oe = Grid {
        na: 0.into(),
        nb: vec![range(1, 2)],
        nk: vec![1.into()],
        nc: 0.into(),
        nd: 0.into(),
        nf: vec![range(1, 2)],
        path: Path::All,
    };
    let estimation = record(&y, &[&u], std::slice::from_ref(&(0..500)));
    let validation = record(&y, &[&u], std::slice::from_ref(&(500..1000)));
    for select in [Select::Validation, Select::Cv] {
        for initial in [Initial::Auto, Initial::Zero] {
            let found =
                chosen(&estimation, Some(&validation), &Choice::Grid(oe.clone()), select, initial).unwrap();
            let selection = found.selection;
            assert_eq!(
                selection.chosen.orders,
                Orders::oe(&[1], &[1], &[1]).unwrap(),
                "{select:?} {initial:?} {selection:?}"
            );
            // e has a variance of 0.03.
            assert!(
                selection.best.iter().all(|model| close(model.held_out_mse.unwrap(), 0.03, 0.1)),
                "{selection:?}"
            );
            evaluated(&selection);
        }
    }
}

#[test]
fn what_cannot_be_validated_is_said() {
    let (y, u) = signals();
    let all = record(&y, &[&u], std::slice::from_ref(&(0..400)));
    let refused =
        |validation, select| match chosen(&all, validation, &Choice::Grid(grid()), select, Initial::Auto)
            .unwrap_err()
        {
            Error::Argument { argument, message } => format!("{argument}: {message}"),
            other => other.to_string(),
        };
    assert!(refused(None, Select::Validation).starts_with("select: "));
    let short = record(&y, &[&u], &[0..3, 5..9]);
    assert!(refused(Some(&short), Select::Validation).contains("longer than the 4 samples"));
    let without = record(&y, &[], std::slice::from_ref(&(0..400)));
    assert!(refused(Some(&without), Select::Validation).starts_with("validation: "));
    let pieces: Vec<Range<usize>> = (0..40).map(|k| 10 * k..10 * k + 4).collect();
    let many = record(&y, &[&u], &pieces);
    assert!(chosen(&many, None, &Choice::Grid(grid()), Select::Cv, Initial::Auto).is_err());
}
