use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::estimate::{Common, Point};
use crate::select::candidates::{Samples, Trial};
use crate::select::grid::key;
use crate::select::search::Family;

fn signals(seed: u64, length: usize) -> (Vec<f64>, Vec<f64>) {
    let mut noise = Noise(seed);
    let (u, e) = (noise.take(length), noise.take(length));
    let f = [1.0, -1.5, 0.7];
    (sum(&filtered(&[0.0, 1.0, 0.5], &f, &u), &filtered(&[1.0, -0.9, 0.4], &f, &e), 0.3), u)
}

fn grid(na: OrderRange, nb: OrderRange, nc: OrderRange, nd: OrderRange, nf: OrderRange) -> Grid {
    Grid { na, nb: vec![nb], nc, nd, nf: vec![nf], nk: vec![1.into()], path: Path::All }
}

/// All models of a grid, fitted to the same samples.
fn fitted(record: &Record<'_>, grid: &Grid) -> (Vec<Trial>, usize) {
    let (tried, counted, hopeless) = family(record, grid, |_| None);
    assert_eq!(hopeless, 0);
    (tried, counted)
}

/// A criterion of a thousand samples.
fn score(orders: &Orders, cost: f64, _: f64) -> f64 {
    cost.ln() + 7e-3 * orders.parameters() as f64
}

/// The same, or besides some only those that may have the least score, and how many were not fitted.
fn family(
    record: &Record<'_>,
    grid: &Grid,
    essential: impl Fn(&[Trial]) -> Option<BTreeSet<Vec<usize>>>,
) -> (Vec<Trial>, usize, usize) {
    let models = grid.orders(1).unwrap();
    let samples = Samples::new(record, Initial::Auto, &models).unwrap();
    let common = Common::new(record, true, samples.window, &Search::default(), Deadline::default(), &|_| {
        ControlFlow::Continue(())
    })
    .unwrap();
    let mut tried: Vec<Trial> =
        models.iter().map(|orders| Trial { orders: orders.clone(), point: None }).collect();
    let essential = essential(&tried);
    let essential = essential.as_ref().map(|essential| (essential, 1000));
    let hopeless = Family::new(&tried, 1).fit(&common, &mut tried, &score, essential).unwrap();
    (tried, samples.window.counted, hopeless)
}

#[test]
fn who_cannot_be_the_best_is_not_fitted_and_the_best_are_the_same() {
    let (y, u) = signals(31, 500);
    let record = record(&y, &[&u], &[0..300, 310..500]);
    let grid = grid(0.into(), range(1, 3), range(0, 2), range(0, 2), range(1, 3));
    let (all, ..) = family(&record, &grid, |_| None);
    let oe = |tried: &[Trial]| -> BTreeSet<Vec<usize>> {
        let without_noise = tried.iter().filter(|one| one.orders.nc + one.orders.nd == 0);
        without_noise.map(|one| key(&one.orders)).collect()
    };
    let (some, _, hopeless) = family(&record, &grid, |tried| Some(oe(tried)));
    let is_there = |one: &&Trial| one.point.is_some();
    assert_eq!(some.iter().filter(is_there).count() + hopeless, all.iter().filter(is_there).count());
    assert!(hopeless > 20, "{hopeless}");
    let scored = |tried: &[Trial]| {
        let of = |one: &Trial| Some((score(&one.orders, one.point.as_ref()?.cost, 0.0), key(&one.orders)));
        let mut scored: Vec<(f64, Vec<usize>)> = tried.iter().filter_map(of).collect();
        scored.sort_by(|a, b| a.0.total_cmp(&b.0));
        scored
    };
    let (all, some) = (scored(&all), scored(&some));
    let ((least, orders), (other, same)) = (&all[0], &some[0]);
    assert!(orders == same && (least - other).abs() < 1e-6, "{orders:?} {least} {same:?} {other}");
    let fitted: Vec<&Vec<usize>> = some.iter().map(|(_, orders)| orders).collect();
    assert!(all.iter().all(|(score, orders)| fitted.contains(&orders) || score - least > 20.0 / 1000.0));
    // What has to be fitted is.
    assert_eq!(some.iter().filter(|(_, orders)| orders[2] + orders[3] == 0).count(), 9);
}

#[test]
fn no_model_costs_more_than_one_that_it_contains() {
    let (y, u) = signals(31, 500);
    let record = record(&y, &[&u], &[0..300, 310..500]);
    for grid in [
        grid(range(1, 3), range(1, 3), range(1, 3), 0.into(), 0.into()),
        grid(0.into(), range(1, 2), range(0, 2), range(0, 2), range(1, 3)),
    ] {
        let (tried, _) = fitted(&record, &grid);
        for one in &tried {
            for other in &tried {
                let within = |a: &[usize], b: &[usize]| a.iter().zip(b).all(|(a, b)| a <= b);
                let (a, b) = (&one.orders, &other.orders);
                let contained =
                    within(&[a.na, a.nc, a.nd, a.nb[0], a.nf[0]], &[b.na, b.nc, b.nd, b.nb[0], b.nf[0]]);
                if contained && let (Some(small), Some(large)) = (&one.point, &other.point) {
                    assert!(
                        large.cost <= small.cost * (1.0 + 1e-6),
                        "{a:?} {b:?} {} {}",
                        small.cost,
                        large.cost
                    );
                }
            }
        }
    }
}

/// C makes e from v = A y - B u, which begins as early as each model can; all count from the same sample on.
#[test]
fn costs_are_sums_over_the_common_samples_and_least() {
    let (y, u) = signals(37, 400);
    let record = record(&y, &[&u], std::slice::from_ref(&(0..400)));
    let (tried, first) = fitted(&record, &grid(range(1, 2), range(1, 2), range(1, 2), 0.into(), 0.into()));
    // Two samples are reached back; then what C makes of the beginning fades in a twentieth of the segment.
    assert_eq!(first, 2 + 400 / 20);
    for Trial { orders, point } in tried {
        let Point { parameters, cost, .. } = point.unwrap();
        let of = |theta: &[f64]| {
            let (a, rest) = theta.split_at(orders.na);
            let (b, c) = rest.split_at(orders.nb[0]);
            let mut e = vec![0.0; 400];
            // The longest model reaches back two samples.
            for t in 2..400 {
                let lagged = |weights: &[f64], x: &[f64]| -> f64 {
                    weights.iter().zip(1..).map(|(w, i)| if t >= i { w * x[t - i] } else { 0.0 }).sum()
                };
                e[t] = y[t] + lagged(a, &y) - lagged(b, &u) - lagged(c, &e);
            }
            e[first..].iter().map(|e| e * e).sum::<f64>()
        };
        assert!(close(cost, of(&parameters), 1e-12), "{orders:?}");
        for index in 0..parameters.len() {
            for by in [-0.02, 0.02] {
                let mut moved = parameters.clone();
                moved[index] += by;
                assert!(of(&moved) > cost, "{orders:?} {index}");
            }
        }
    }
}

#[test]
fn a_search_for_each_finds_nothing_lower_among_the_best() {
    let (y, u) = signals(41, 600);
    let record = record(&y, &[&u], std::slice::from_ref(&(0..600)));
    let choice = Choice::Grid(grid(range(1, 3), range(1, 3), range(0, 3), 0.into(), 0.into()));
    let SelectedModel { selection, initial_parameters, .. } =
        chosen(&record, None, &choice, Select::MDL, Initial::Auto).unwrap();
    assert_eq!(selection.chosen.orders, Orders::armax(2, &[2], 2, &[1]).unwrap());
    assert_eq!(initial_parameters.unwrap().len(), 6);
    // ARX models stand in the same table, on the same samples.
    assert_eq!((selection.models, selection.samples), (36, 600 - 3 - 30));
    let Choice::Grid(grid) = choice else { panic!("a grid") };
    let window = Samples::new(&record, Initial::Auto, &grid.orders(1).unwrap()).unwrap().window;
    assert_eq!(window.counted, 33);
    let common = Common::new(&record, true, window, &Search::default(), Deadline::default(), &|_| {
        ControlFlow::Continue(())
    })
    .unwrap();
    for model in selection.best.iter().take(5).filter(|model| model.orders.nc > 0) {
        let alone = common.fit(&model.orders, &[], true).unwrap().unwrap();
        assert!(model.mse <= alone.cost / 567.0 * (1.0 + 1e-6), "{model:?}");
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let (y, u) = signals(43, 300);
    let record = record(&y, &[&u], &[0..120, 130..300]);
    let grids = [
        Choice::Grid(grid(range(1, 2), range(1, 2), range(0, 2), 0.into(), 0.into())),
        Choice::Grid(grid(0.into(), range(1, 2), range(0, 1), range(0, 1), range(1, 2))),
    ];
    for (choice, select) in grids.iter().zip([Select::MDL, Select::Cv]) {
        let by = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| chosen(&record, None, choice, select, Initial::Auto).unwrap())
        };
        assert_eq!(by(1), by(4));
    }
}

#[test]
fn whoever_watches_can_end_it() {
    let (y, u) = signals(47, 200);
    let record = record(&y, &[&u], std::slice::from_ref(&(0..200)));
    let choice = Choice::Grid(grid(range(1, 2), range(1, 2), range(1, 2), 0.into(), 0.into()));
    let seen = AtomicUsize::new(0);
    let monitor: Monitor<'_> = &|_| {
        if seen.fetch_add(1, Ordering::Relaxed) < 3 {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    };
    let (inputs, search) = (names(&record), Search::default());
    let task = Task { focus: Focus::Prediction, monitor, ..task(&record, &inputs, &search) };
    assert_eq!(choose(&task, &choice), Err(Error::Interrupted));
    let search = Search { tolerance: -1.0, ..Search::default() };
    assert!(matches!(choose(&Task { search: &search, ..task }, &choice), Err(Error::Argument { .. })));
}

#[test]
fn dropped_samples_are_not_for_models_with_f() {
    let (y, u) = signals(53, 200);
    let record = record(&y, &[&u], std::slice::from_ref(&(0..200)));
    let choice = Choice::Grid(grid(0.into(), range(1, 2), 0.into(), 0.into(), range(0, 1)));
    let refused = chosen(&record, None, &choice, Select::MDL, Initial::Drop);
    assert!(matches!(refused, Err(Error::Argument { argument, .. }) if argument == "initial"));
    assert!(chosen(&record, None, &choice, Select::MDL, Initial::Zero).is_ok());
}

/// A plant with slow poles that is not at rest at first: without its initial state no model with F would explain the
/// log.
#[test]
fn models_with_f_need_not_begin_at_rest() {
    let mut noise = Noise(59);
    let (u, e) = (noise.take(1400), noise.take(1400));
    let y = sum(&filtered(&[0.0, 1.0], &[1.0, -0.99], &u), &e, 0.3);
    let record = record(&y, &[&u], std::slice::from_ref(&(1000..1400)));
    let choice = Choice::Grid(grid(0.into(), range(1, 2), 0.into(), 0.into(), range(1, 2)));
    let found = chosen(&record, None, &choice, Select::MDL, Initial::Auto).unwrap();
    assert_eq!(found.selection.chosen.orders, Orders::oe(&[1], &[1], &[1]).unwrap());
    assert!(close(found.selection.chosen.mse, 0.03, 0.2));
}

#[test]
fn long_records_are_compared_on_segments() {
    let (y, u) = signals(61, (1 << 16) + 2);
    let record = record(&y, &[&u], std::slice::from_ref(&(0..(1 << 16) + 2)));
    let small = |nc: OrderRange| Choice::Grid(grid(2.into(), 2.into(), nc, 0.into(), 0.into()));
    let of = |choice: &Choice| chosen(&record, None, choice, Select::MDL, Initial::Auto).unwrap().selection;
    let searched = of(&small(2.into()));
    assert_eq!(searched.samples, 16 * (2048 - 2 - 50));
    assert!(searched.steps[0].contains("16 segments"), "{:?}", searched.steps);
    // Linear models see them all.
    assert_eq!(of(&small(0.into())).samples, 1 << 16);
}
