use super::*;
use crate::data::{Log, Record, Rows};
use crate::respond::process::held_logs;
use crate::tests::channel;

#[test]
fn a_step_test_has_few_steps_and_waits_for_what_they_do() {
    let steps = |levels: &[f64], rows: usize| -> Vec<f64> {
        levels.iter().flat_map(|level| std::iter::repeat_n(*level, rows)).collect()
    };
    let one = steps(&[0.0, 1.0], 40);
    assert!(is_step_test(&[&one]));
    let mut missing = one.clone();
    missing[50..60].fill(f64::NAN);
    assert!(is_step_test(&[&missing]));
    assert!(is_step_test(&[&one, &steps(&[3.0, 3.0, 2.0, 2.0], 20)]));
    // A constant, no rows, no time to wait, many steps, and no input.
    assert!(!is_step_test(&[&one, &[1.0; 80]]));
    assert!(!is_step_test(&[&[]]));
    assert!(!is_step_test(&[&steps(&[0.0, 1.0], 9)]));
    let many: Vec<f64> = (0..50).map(|k| f64::from(k % 2)).collect();
    assert!(!is_step_test(&[&steps(&many, 100)]));
    assert!(!is_step_test(&[]));
}

#[test]
fn of_a_long_log_every_so_many_rows_are_seen_and_all_steps() {
    let u: Vec<f64> = (0..9001).map(|t| if t < 3001 { 0.0 } else { 1.0 }).collect();
    let y: Vec<f64> = (0..9001).map(f64::from).collect();
    let log = Log::new(vec![channel("u", &u), channel("y", &y)], 0.5).unwrap();
    let held = held_logs(&log, &["u"], &[Rows::new(1, 6000).unwrap()]).unwrap();
    let record = Record { segments: held[0].counted.clone(), ..Record::new(&y, vec![&u]).unwrap() };
    let folds = Folds::new(&record, BLOCKS);
    let seen = Excerpt::new(&held, &y, &folds);
    let [part] = &*seen.held else { unreachable!("one log") };
    assert_eq!((part.rows.clone(), part.times.len()), (0..2001, 2001));
    let step = part.inputs[0].iter().position(|u| *u == 1.0).unwrap();
    // Row 3001 is none of the third ones.
    assert_eq!((part.times[step], seen.output[step], part.times[step - 1]), (1500.5, 3001.0, 1500.0));
    let blocks = |block: usize| seen.block.iter().filter(|own| **own == Some(block)).count();
    // The step stands in the second one.
    assert_eq!([0, 1, 2].map(blocks), [667, 668, 666]);
}
