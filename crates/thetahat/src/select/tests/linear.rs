use super::*;
use crate::estimate::{Criteria, InformationCriterion, arx, estimate};

/// Two inputs, an output that follows them, and three segments, of which one is too short for the larger models.
fn signals() -> ([Vec<f64>; 3], Vec<Range<usize>>) {
    let mut noise = Noise(12);
    let (u, v, e) = (noise.take(300), noise.take(300), noise.take(300));
    let driven = sum(&filtered(&[0.0, 0.0, 1.0, 0.5], &[1.0], &u), &filtered(&[0.0, -0.7], &[1.0], &v), 1.0);
    let y = filtered(&[1.0], &[1.0, -1.2, 0.5], &sum(&driven, &e, 0.2));
    ([y, u, v], vec![0..140, 150..156, 160..300])
}

fn grid_of_two() -> Grid {
    arx_grid(range(0, 3), &[range(0, 2), range(1, 3)], &[range(1, 3), range(0, 2)])
}

/// The mean of e^2 of one model on the samples after `first` of each segment.
fn mse(record: &Record<'_>, orders: &Orders, first: usize, initial: Initial) -> Option<f64> {
    let cut = if initial == Initial::Zero { 0 } else { first - orders.maximum_lag() };
    let long = record.segments.iter().filter(|segment| segment.len() > cut);
    let segments: Vec<_> = long.map(|segment| segment.start + cut..segment.end).collect();
    Some(arx(&super::record(record.output, &record.inputs, &segments), orders, initial).ok()?.mse())
}

#[test]
fn costs_of_a_grid_are_those_of_single_fits_on_common_samples() {
    let ([y, u, v], segments) = signals();
    let record = record(&y, &[&u, &v], &segments);
    for initial in [Initial::Auto, Initial::Drop, Initial::Zero] {
        let SelectedModel { selection, initial_parameters, .. } =
            chosen(&record, None, &Choice::Grid(grid_of_two()), Select::MDL, initial).unwrap();
        // The largest reaches back 4 samples; the short segment has two more.
        let samples = if initial == Initial::Zero { 286 } else { 274 };
        assert_eq!((selection.samples, selection.failed), (samples, 0));
        assert_eq!(selection.models, 4 * (1 + 2 * 3) * 3 * 3);
        assert_eq!(initial_parameters, None);
        for model in selection.best.iter().chain(&selection.of_size) {
            let expected = mse(&record, &model.orders, 4, initial).unwrap();
            assert!(close(model.mse, expected, 1e-9), "{model:?} {expected}");
            let criteria = Criteria::new(model.mse, model.parameters, samples);
            assert_eq!(model.score, criteria.of(InformationCriterion::MDL));
        }
        assert_eq!(selection.chosen.orders, Orders::arx(2, &[2, 1], &[2, 1]).unwrap());
        assert_eq!(selection.best.len(), 50);
        assert!(selection.best.windows(2).all(|pair| pair[0].score <= pair[1].score));
        assert_eq!(Some(&selection.best[1]), selection.second.as_ref());
        let sizes: Vec<usize> = selection.of_size.iter().map(|model| model.parameters).collect();
        assert_eq!(sizes, (1..=8).collect::<Vec<_>>());
    }
}

#[test]
fn each_criterion_ranks_by_itself() {
    let ([y, u, v], segments) = signals();
    let record = record(&y, &[&u, &v], &segments);
    for criterion in InformationCriterion::all() {
        let select = Select::Criterion(criterion);
        let found = chosen(&record, None, &Choice::Grid(grid_of_two()), select, Initial::Auto).unwrap();
        let chosen = found.selection.chosen;
        let criteria = Criteria::new(chosen.mse, chosen.parameters, 274);
        assert_eq!(chosen.score, criteria.of(criterion));
        assert_eq!(found.selection.least, None);
    }
}

/// Slow signals, of which the lagged copies are nearly alike: the triangle stands for the rows.
#[test]
fn costs_keep_their_digits_where_columns_are_nearly_dependent() {
    let mut noise = Noise(5);
    let slow = [1.0, -1.96, 0.9604];
    let u = filtered(&[1.0], &slow, &noise.take(400));
    let y = sum(&filtered(&[0.0, 1e-3], &slow, &u), &noise.take(400), 1e-4);
    let record = record(&y, &[&u], std::slice::from_ref(&(0..400)));
    let grid = arx_grid(range(1, 6), &[range(1, 6)], &[range(1, 2)]);
    let found = chosen(&record, None, &Choice::Grid(grid), Select::MDL, Initial::Auto).unwrap();
    assert_eq!(found.selection.failed, 0);
    for model in &found.selection.best {
        let expected = mse(&record, &model.orders, 7, Initial::Drop).unwrap();
        // Rounding is some 1e-16 |y|/|e|, and the least squares of 1e-6 show it.
        assert!(close(model.mse, expected, 1e-6), "{model:?} {expected}");
    }
}

#[test]
fn of_exact_models_the_smallest_is_chosen() {
    let mut noise = Noise(7);
    let u = noise.take(200);
    let y = filtered(&[0.0, 0.0, 1.0, -0.4], &[1.0, -1.1, 0.3], &u);
    let record = Record::new(&y, vec![&u]).unwrap();
    let grid = arx_grid(range(1, 5), &[range(1, 5)], &[range(1, 4)]);
    let all = ["mdl", "fpe", "aicc", "validation", "cv"];
    for select in all.map(|word| word.parse().unwrap()) {
        let found =
            chosen(&record, Some(&record), &Choice::Grid(grid.clone()), select, Initial::Auto).unwrap();
        let chosen = &found.selection.chosen;
        assert_eq!(chosen.orders, Orders::arx(2, &[2], &[2]).unwrap(), "{select:?}");
        assert_eq!(chosen.mse, 0.0);
        let undefined = matches!(select, Select::Criterion(criterion) if criterion.is_logarithmic());
        assert_eq!(chosen.score, if undefined { None } else { Some(0.0) });
        assert!(found.selection.steps.iter().all(|step| !step.contains("NaN") && !step.contains("inf")));
    }
}

#[test]
fn models_that_the_data_leave_open_are_counted_apart() {
    let mut noise = Noise(9);
    // Two samples that repeat: of three lags one depends on the others.
    let u: Vec<f64> = (0..100).map(|t| if t % 2 == 0 { 1.0 } else { -0.5 }).collect();
    let y = sum(&filtered(&[0.0, 1.0], &[1.0, -0.5], &u), &noise.take(100), 0.1);
    let record = Record::new(&y, vec![&u]).unwrap();
    let grid = arx_grid(1.into(), &[range(1, 5)], &[1.into()]);
    let selection =
        chosen(&record, None, &Choice::Grid(grid.clone()), Select::MDL, Initial::Auto).unwrap().selection;
    assert_eq!((selection.models, selection.failed), (2, 3));
    assert!(selection.steps.iter().any(|step| step.contains("3 models skipped: not identifiable")));
    // Nothing at all.
    let zero = vec![0.0; 100];
    let silent = Record::new(&y, vec![&zero]).unwrap();
    let refused = chosen(&silent, None, &Choice::Grid(grid), Select::MDL, Initial::Auto);
    assert!(matches!(refused, Err(Error::Undetermined { .. })));
}

#[test]
fn models_with_more_parameters_than_samples_are_left_out() {
    let mut noise = Noise(13);
    let y = noise.take(12);
    let record = Record::new(&y, vec![]).unwrap();
    let grid = arx_grid(range(1, 8), &[], &[]);
    let selection =
        chosen(&record, None, &Choice::Grid(grid), "aicc".parse().unwrap(), Initial::Auto).unwrap().selection;
    // Four samples have all eight before them.
    assert_eq!((selection.samples, selection.models, selection.failed), (4, 3, 5));
    assert!(selection.best.iter().all(|model| model.structure == Structure::Ar));
    // AICc needs two samples more than parameters: without it a model comes last.
    assert_eq!(selection.best[2].score, None);
    let expected = estimate(
        &super::record(&y, &[], std::slice::from_ref(&(6..12))),
        &Orders::arx(2, &[], &[]).unwrap(),
        &crate::estimate::Method::default(),
        Initial::Drop,
    );
    let own = selection.best.iter().find(|model| model.parameters == 2).unwrap();
    assert!(close(own.mse, expected.unwrap().mse(), 1e-9));
}

#[test]
fn one_model_alone_has_no_second() {
    let ([y, u, v], segments) = signals();
    let record = record(&y, &[&u, &v], &segments);
    let orders = Orders::arx(2, &[2, 1], &[2, 1]).unwrap();
    let selection =
        chosen(&record, None, &Choice::Known(orders.clone()), Select::MDL, Initial::Auto).unwrap().selection;
    assert_eq!((selection.chosen.orders, selection.second, selection.models), (orders, None, 1));
}

#[test]
fn of_equal_models_the_smaller_is_taken() {
    // y does not depend on u: with MDL they differ; on the validation rows a model of one parameter more has the same
    // cost where its coefficient is zero, as that input is silent there.
    let mut noise = Noise(17);
    let (u, e) = (noise.take(200), noise.take(200));
    let y = filtered(&[1.0], &[1.0, -0.8], &e);
    let zero = vec![0.0; 200];
    let grid = arx_grid(range(1, 2), &[range(0, 1)], &[1.into()]);
    let estimation = Record::new(&y, vec![&u]).unwrap();
    let validation = Record::new(&y, vec![&zero]).unwrap();
    let found =
        chosen(&estimation, Some(&validation), &Choice::Grid(grid), Select::Validation, Initial::Auto)
            .unwrap();
    assert_eq!(found.selection.chosen.parameters, 1);
}
