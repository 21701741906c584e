use super::models::experiment;
use crate::Error;
use crate::data::{Log, Recording, Times};
use crate::model::GreyBox;
use crate::respond::equations::experiments;
use crate::tests::channel;

fn recording(times: Vec<f64>) -> Recording {
    Recording {
        channels: vec![
            channel("y", [1.0, f64::NAN, 3.0, 4.0]),
            channel("u", [f64::NAN, 5.0, f64::NAN, 6.0]),
            channel("w", [7.0, 8.0, 9.0, 10.0]),
        ],
        times: Times::Measured(times),
    }
}

/// A model of which the steps are half a second, with these inputs.
fn model(inputs: &str) -> GreyBox {
    let text = format!(
        "sample_time = 0.5
         [states]
         x = {{ start = 0, sd = 1 }}
         [inputs]
         {inputs}
         [next]
         x = '0.9 * x'
         [outputs]
         y = 'x'
         [noise]
         measurement = {{ y = 1 }}"
    );
    GreyBox::from_toml(&text).unwrap()
}

#[test]
fn rows_are_in_the_order_of_the_model() {
    let recording = recording(vec![10.0, 11.0, 13.0, 13.5]);
    let found = experiment(&model("a = 'w'\nb = 'u'"), &recording);
    assert_eq!(found.rows(), 4);
    let inputs: Vec<&[f64]> = (0..4).map(|row| found.input(row)).collect();
    assert_eq!(inputs, [[7.0, 0.0], [8.0, 5.0], [9.0, 5.0], [10.0, 6.0]]);
    assert_eq!(found.held, [0, 2]);
    assert!(found.output(1)[0].is_nan() && found.output(2) == [3.0]);
    assert_eq!(found.measurements(0), 3);
    let steps: Vec<Vec<(f64, f64)>> = (0..4).map(|row| found.steps(row).collect()).collect();
    let halves = |times: &[f64]| times.iter().map(|time| (*time, 0.5)).collect::<Vec<_>>();
    assert_eq!(steps, [vec![], halves(&[0.0, 0.5]), halves(&[1.0, 1.5, 2.0, 2.5]), halves(&[3.0])]);
    // Without inputs.
    assert_eq!(experiment(&model(""), &recording).input(2), [0.0; 0]);
}

#[test]
fn rows_before_those_asked_for_do_not_count() {
    let log = Log::recorded(recording(vec![0.0; 4]).channels, vec![0.0, 1.0, 2.0, 3.0]).unwrap();
    let both = Log::join(vec![log.clone(), log]).unwrap();
    let found =
        experiments(&model(""), &both, &["3..3".parse().unwrap(), "7..8".parse().unwrap()], &[]).unwrap();
    let first: Vec<usize> = found.iter().map(|experiment| experiment.first).collect();
    assert_eq!(first, [0, 4]);
    let counted = |index: usize| found[index].counted().iter().cloned().flatten().collect::<Vec<_>>();
    assert_eq!((found[0].rows(), counted(0)), (3, vec![2]));
    assert_eq!((found[1].rows(), counted(1)), (4, vec![2, 3]));
    assert!(found[0].counts(2) && !found[0].counts(1));
    // A log of which no row is asked for is none.
    assert_eq!(experiments(&model(""), &both, &["5..8".parse().unwrap()], &[]).unwrap().len(), 1);
    // The start is that of the rows of the fit, if they stand before.
    let from = |fitted: &str| {
        let (rows, fitted) = (["3..4".parse().unwrap()], [fitted.parse().unwrap()]);
        experiments(&model(""), &both, &rows, &fitted).unwrap()[0].first
    };
    assert_eq!((from("2..4"), from("3..3"), from("4..4"), from("6..7")), (1, 2, 0, 0));
}

#[test]
fn a_step_that_the_model_cannot_take_is_one_of_a_row() {
    let log = Log::recorded(recording(vec![]).channels, vec![0.0, 0.5, 0.75, 1.25]).unwrap();
    let refused = experiments(&model(""), &log, &["1..4".parse().unwrap()], &[]);
    let Err(Error::Data { row: Some(3), message, .. }) = refused else { panic!("{refused:?}") };
    assert!(message.starts_with("row 3: "), "{message}");
}

#[test]
fn steps_that_differ_by_rounding_are_equal() {
    let text = "sample_time = 0.1
         [states]
         x = { start = 0, sd = 1 }
         [derivative]
         x = '-x'
         [outputs]
         y = 'x'
         [noise]
         measurement = { y = 1 }";
    let times: Vec<f64> =
        (0..100).map(|row| 1.7e9 + 0.1 * f64::from(row) + f64::from(row / 50) * 0.02).collect();
    let recording = Recording {
        channels: vec![channel("y", (0..100).map(f64::from).collect::<Vec<f64>>())],
        times: Times::Measured(times),
    };
    let found = experiment(&GreyBox::from_toml(text).unwrap(), &recording);
    let alike: Vec<usize> = (1..100).filter(|row| !found.is_alike(*row, 1)).collect();
    assert_eq!(alike, [50]);
}
