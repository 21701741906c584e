extern crate std;
use std::format;
use std::vec::Vec;

use nalgebra::{Const, SVector, Vector2, Vector3};

use crate::noise::Noise;
use crate::{
    Action, Error, Forgetting, LeastSquares, RecursiveLeastSquares, RlsStart, Window, WindowedLeastSquares,
};

type Windowed<T> = WindowedLeastSquares<T, Const<3>, Const<200>>;

fn row(noise: &mut Noise) -> (Vector3<f64>, f64) {
    let regressor = Vector3::new(noise.next(), 30.0 * noise.next(), 1.0);
    (regressor, regressor.dot(&Vector3::new(1.0, -0.2, 4.0)) + 0.1 * noise.next())
}

/// The least squares solution of these rows.
fn batch(rows: &[(Vector3<f64>, f64)]) -> LeastSquares<f64, Const<3>> {
    let mut batch = LeastSquares::new();
    rows.iter().for_each(|(regressor, output)| batch.add(regressor, *output).unwrap());
    batch
}

#[test]
fn it_is_the_batch_solution_of_the_window() {
    for window in [(20, 1), (2, 3), (5, 4), (4, 7), (3, 2)].map(|(blocks, block)| Window { blocks, block }) {
        let mut noise = Noise(1);
        let mut windowed = Windowed::<f64>::new(Const, window).unwrap();
        let mut rows = Vec::new();
        for k in 0..150_usize {
            let (regressor, output) = row(&mut noise);
            rows.push((regressor, output));
            windowed.update(&regressor, output).unwrap();
            // What is in it: all but the blocks that have left.
            let complete = (k / window.block + 1).saturating_sub(window.blocks);
            let inside = &rows[complete * window.block..];
            assert_eq!(windowed.rows(), inside.len(), "{window:?} {k}");
            assert!(inside.len() > window.samples() - window.block || k < window.samples());
            let batch = batch(inside);
            assert_eq!(windowed.is_determined(), inside.len() >= 3);
            if let Ok(solution) = batch.solve() {
                assert!((windowed.parameters() - solution.parameters()).amax() < 1e-11, "{window:?} {k}");
                let errors = windowed.standard_errors().zip(solution.standard_errors());
                assert!(errors.is_none_or(|(found, expected)| (found - expected).amax() < 1e-11));
                assert_eq!(windowed.noise_variance().is_some(), inside.len() > 3);
            }
        }
    }
}

#[test]
fn a_window_of_all_samples_is_recursive_least_squares_without_forgetting() {
    let mut noise = Noise(2);
    let mut windowed = Windowed::<f64>::new(Const, Window { blocks: 20, block: 100 }).unwrap();
    let mut recursive =
        RecursiveLeastSquares::<f64, Const<3>>::new(&Vector3::new(1.0, 30.0, 1.0), Forgetting::None)
            .unwrap()
            .with_start(RlsStart::Exact)
            .unwrap();
    for k in 0..1500 {
        let (regressor, output) = row(&mut noise);
        let found = windowed.update(&regressor, output).unwrap();
        let expected = recursive.update(&regressor, output).unwrap();
        if k > 20 {
            assert!((windowed.parameters() - recursive.parameters()).amax() < 1e-9, "{k}");
            assert!((found.error - expected.error).abs() < 1e-9);
            assert!((found.variance / expected.variance - 1.0).abs() < 1e-6, "{k}: {found:?} {expected:?}");
            assert!((found.nis - expected.nis).abs() < 1e-6 * (1.0 + expected.nis));
        }
    }
}

#[test]
fn what_is_not_excited_is_kept_and_said() {
    let mut windowed = Windowed::<f32>::new(Const, Window { blocks: 10, block: 1 }).unwrap();
    let mut noise = Noise(3);
    let truth = Vector3::new(1.0, -0.2, 4.0_f32);
    let take = |windowed: &mut Windowed<f32>, regressor: Vector3<f32>| {
        windowed.update(&regressor, regressor.dot(&truth)).unwrap().action
    };
    assert_eq!(take(&mut windowed, Vector3::new(1.0, 2.0, 1.0)), Action::Collecting);
    assert_eq!(windowed.parameters(), &Vector3::zeros());
    assert!(matches!(windowed.solution(), Err(Error::TooFewRows { needed: 3, found: 1 })));
    for _ in 0..20 {
        take(&mut windowed, Vector3::new(noise.next() as f32, 30.0 * noise.next() as f32, 1.0));
    }
    assert!(windowed.is_determined());
    for regressor in [Vector3::zeros(), Vector3::new(0.3, 7.0, 1.0)] {
        let actions: Vec<Action> = (0..12).map(|_| take(&mut windowed, regressor)).collect();
        assert_eq!(actions[11], Action::Collecting, "{regressor}");
        assert!((windowed.parameters() - truth).amax() < 1e-3, "{}", windowed.parameters());
        assert!(windowed.noise_variance().is_none() && windowed.standard_errors().is_none());
        assert!(matches!(windowed.solution(), Err(Error::RankDeficient { .. })));
    }
    windowed.clear();
    assert_eq!((windowed.rows(), windowed.is_determined()), (0, false));
    assert!((windowed.parameters() - truth).amax() < 1e-3);
}

#[test]
fn missing_and_wrong_samples_change_nothing() {
    let mut windowed = Windowed::<f32>::new(Const, Window { blocks: 4, block: 2 }).unwrap();
    let mut noise = Noise(4);
    for _ in 0..13 {
        let (regressor, output) = row(&mut noise);
        windowed.update(&regressor.cast(), output as f32).unwrap();
    }
    let before = format!("{windowed:?}");
    let missing = windowed.update(&Vector3::new(1.0, f32::NAN, 1.0), 1.0).unwrap();
    assert_eq!((missing.action, missing.nis), (Action::Missing, 0.0));
    assert_eq!(windowed.update(&Vector3::repeat(1.0), f32::NAN).unwrap().action, Action::Missing);
    for (regressor, output, error) in [
        (f32::INFINITY, 1.0, Error::Infinite { argument: "regressor" }),
        (1.0, -f32::INFINITY, Error::Infinite { argument: "output" }),
        (1e30, 1.0, Error::TooLarge { argument: "regressor" }),
        (1.0, 1e30, Error::TooLarge { argument: "output" }),
    ] {
        assert_eq!(windowed.update(&Vector3::repeat(regressor), output).unwrap_err(), error);
    }
    assert!(matches!(windowed.predict(&Vector3::repeat(f32::NAN)), Err(Error::NotFinite { .. })));
    assert_eq!(format!("{windowed:?}"), before);
}

#[test]
fn a_window_that_cannot_be_is_refused() {
    let new = |blocks, block| Windowed::<f64>::new(Const, Window { blocks, block }).map(|_| ());
    for (blocks, block) in [(0, 1), (1, 100), (3, 1), (2, 2), (5, 0), (usize::MAX, 2), (2, usize::MAX)] {
        assert!(
            matches!(new(blocks, block), Err(Error::OutOfRange { argument: "window", .. })),
            "{blocks} {block}"
        );
    }
    assert_eq!(new(21, 1), Err(Error::Length { argument: "B", expected: 210, found: 200 }));
    assert_eq!(new(4, 1), Ok(()));
}

#[test]
fn large_and_tiny_samples_leave_without_trace() {
    let mut windowed: WindowedLeastSquares<f32, Const<2>, Const<60>> =
        WindowedLeastSquares::new(Const, Window { blocks: 10, block: 2 }).unwrap();
    let mut noise = Noise(5);
    for scale in [1.0, 1e6, 1e-6, 1e12, 1e-12, 1.0_f32] {
        for k in 0..40 {
            let regressor: SVector<f32, 2> = scale * Vector2::new(noise.next() as f32, noise.next() as f32);
            let output = regressor.x - 2.0 * regressor.y;
            windowed.update(&regressor, output).unwrap();
            if k >= 20 {
                let off = (windowed.parameters() - Vector2::new(1.0, -2.0)).amax();
                assert!(off < 3e-6, "{scale:e} {k}: {off:e}");
            }
        }
    }
}

#[cfg(feature = "alloc")]
#[test]
fn run_time_sizes_give_the_same_bits() {
    use nalgebra::{DVector, Dyn};

    let window = Window { blocks: 5, block: 3 };
    let mut fixed = Windowed::<f64>::new(Const, window).unwrap();
    let mut dynamic: WindowedLeastSquares<f64, Dyn, Dyn> = WindowedLeastSquares::new(Dyn(3), window).unwrap();
    let mut noise = Noise(6);
    for _ in 0..60 {
        let (regressor, output) = row(&mut noise);
        let answer = fixed.update(&regressor, output);
        let row = DVector::from_column_slice(regressor.as_slice());
        assert_eq!(format!("{answer:?}"), format!("{:?}", dynamic.update(&row, output)));
        assert_eq!(fixed.parameters().as_slice(), dynamic.parameters().as_slice());
    }
    let short = dynamic.update(&DVector::zeros(2), 1.0).unwrap_err();
    assert_eq!(short, Error::Length { argument: "regressor", expected: 3, found: 2 });
}
