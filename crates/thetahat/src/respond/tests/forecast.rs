//! Forecasts against the recursions, and against the mean of many futures.

use thetahat_numerics::noise::Noise;

use super::general::{Recursion, model, models, output};
use super::{signals, views, with_poles};
use crate::Error;
use crate::data::Record;
use crate::respond::{InitialCondition, forecast, predict, prediction_deviation};
use crate::tests::assert_refused;

#[test]
fn a_forecast_is_what_the_recursions_give_from_the_end() {
    let mut noise = Noise(1);
    for model in models() {
        let (u, y) = (signals(model.b.len(), 170, &mut noise), noise.take(170));
        let record =
            Record { output: &y, inputs: views(&u), segments: vec![0..50, 70..150], past: vec![0, 12] };
        let future: Vec<&[f64]> = u.iter().map(|u| &u[150..]).collect();
        for start in [InitialCondition::Zero, InitialCondition::Drop] {
            let presample = if start == InitialCondition::Zero { 0 } else { model.orders.conditioned() };
            let begin = if start == InitialCondition::Zero { 70 } else { 58 };
            let mut expected = y.clone();
            Recursion::new(&model, &views(&u), begin, presample).run(&mut expected, 150);
            let found = forecast(&model, &record, &future, 20, start).unwrap();
            assert_eq!(found.values.len(), 20);
            for (found, expected) in found.values.iter().zip(&expected[150..]) {
                assert!((found - expected).abs() < 1e-10 * expected.abs().max(1.0), "{:?}", model.structure);
            }
        }
    }
}

#[test]
fn a_forecast_is_the_prediction_of_samples_that_are_still_to_come() {
    let mut noise = Noise(2);
    for model in models() {
        let (u, e) = (signals(model.b.len(), 120, &mut noise), noise.take(120));
        let y = output(&model, &u, &e);
        let part = |end: usize| Record {
            output: &y,
            inputs: views(&u),
            segments: std::iter::once(30..end).collect(),
            past: vec![30],
        };
        let future: Vec<&[f64]> = u.iter().map(|u| &u[100..]).collect();
        let starts: &[InitialCondition] = if model.orders.is_linear() {
            &[InitialCondition::Drop]
        } else {
            &[InitialCondition::Drop, InitialCondition::Estimate]
        };
        for &start in starts {
            let found = forecast(&model, &part(100), &future, 20, start).unwrap();
            for steps in [1, 2, 20] {
                // Of a known model only what was before its first error makes it larger.
                let (deviation, known) =
                    (found.standard_deviations[steps - 1], prediction_deviation(&model, steps).unwrap());
                assert!(deviation == known || (deviation > known && !model.orders.is_linear()));
                // From an estimated start the later samples have a say in it.
                if start == InitialCondition::Drop {
                    let predicted = predict(&model, &part(120), steps, start).unwrap().values[99 + steps];
                    let error = (found.values[steps - 1] - predicted).abs();
                    assert!(
                        error < 1e-10 * predicted.abs().max(1.0),
                        "{:?} {steps} {error}",
                        model.structure
                    );
                }
            }
        }
    }
}

#[test]
fn a_forecast_is_the_mean_of_the_futures() {
    let mut noise = Noise(3);
    for model in models() {
        let u = signals(model.b.len(), 60, &mut noise);
        let mut e = noise.take(60);
        let y = output(&model, &u, &e);
        let past: Vec<Vec<f64>> = u.iter().map(|u| u[..50].to_vec()).collect();
        let record = Record::new(&y[..50], views(&past)).unwrap();
        let future: Vec<&[f64]> = u.iter().map(|u| &u[50..]).collect();
        let found = forecast(&model, &record, &future, 10, InitialCondition::Zero).unwrap();
        let (mut sums, mut squares) = ([0.0; 10], [0.0; 10]);
        let runs = 1000;
        for _ in 0..runs {
            e[50..].iter_mut().for_each(|e| *e = 0.75_f64.sqrt() * noise.uniform());
            let y = output(&model, &u, &e);
            for step in 0..10 {
                let error = y[50 + step] - found.values[step];
                sums[step] += error / f64::from(runs);
                squares[step] += error * error / f64::from(runs);
            }
        }
        for step in [0, 1, 4, 9] {
            let deviation = found.standard_deviations[step];
            // The mean has a deviation of 3 %, the deviation one of 2.
            assert!(sums[step].abs() < 0.12 * deviation, "{:?} {step}", model.structure);
            assert!((squares[step].sqrt() / deviation - 1.0).abs() < 0.08, "{:?} {step}", model.structure);
        }
    }
}

#[test]
fn an_estimated_start_forecasts_from_the_segment_alone() {
    let mut noise = Noise(4);
    for model in models() {
        let mut u = signals(model.b.len(), 400, &mut noise);
        // Inputs with F rest before the segment, as long as B reaches back.
        for (u, _) in u.iter_mut().zip(&model.f).filter(|(_, f)| f.len() > 1) {
            u[190..200].fill(0.0);
        }
        let y = output(&model, &u, &[0.0; 400]);
        if y.iter().all(|y| *y == 0.0) || model.orders.is_linear() {
            continue;
        }
        let record = Record {
            output: &y,
            inputs: views(&u),
            segments: std::iter::once(200..380).collect(),
            past: vec![0],
        };
        let future: Vec<&[f64]> = u.iter().map(|u| &u[380..]).collect();
        let found = forecast(&model, &record, &future, 20, InitialCondition::Estimate).unwrap();
        let largest = y.iter().fold(0.0_f64, |largest, y| largest.max(y.abs()));
        for (found, expected) in found.values.iter().zip(&y[380..]) {
            assert!((found - expected).abs() < 1e-9 * largest, "{:?} {found} {expected}", model.structure);
        }
    }
}

#[test]
fn a_forecast_needs_the_inputs_that_act_and_no_more() {
    let one: &[f64] = &[1.0];
    let model = model(&with_poles(&[0.5]), &[(3, &[1.0, 2.0], one), (1, &[], one)], &[1.0, 0.5], one);
    let (y, u) = (vec![1.0, -1.0, 2.0, 0.5, 1.5], [1.0, 2.0, 3.0, 4.0, 5.0]);
    let record = Record::new(&y, vec![&u, &u]).unwrap();
    let ahead = |future: &[&[f64]], steps| forecast(&model, &record, future, steps, InitialCondition::Zero);
    let expected = ahead(&[&[6.0, 7.0], &[]], 5).unwrap();
    // What comes too late to act is not read.
    assert_eq!(ahead(&[&[6.0, 7.0, 8.0, 9.0, 9.0, f64::NAN], &[]], 5).unwrap().values, expected.values);
    assert_refused(ahead(&[&[6.0], &[]], 5), "need 2 future values");
    assert!(ahead(&[&[], &[]], 3).is_ok());
    for wrong in [&[&[6.0][..], &[]][..], &[&[6.0, f64::NAN], &[]], &[&[6.0, 7.0]], &[]] {
        assert!(matches!(ahead(wrong, 5), Err(Error::Argument { .. })));
    }
    assert!(matches!(ahead(&[&[], &[]], 0), Ok(empty) if empty.values.is_empty()));
    assert!(matches!(ahead(&[&[], &[]], usize::MAX), Err(Error::Argument { .. })));
}

#[test]
fn there_is_no_forecast_from_too_few_samples() {
    let mut noise = Noise(5);
    for model in models().iter().filter(|model| model.orders.conditioned() > 0) {
        let (u, y) = (signals(model.b.len(), 40, &mut noise), noise.take(40));
        let future = views(&u);
        let end = 10 + model.orders.conditioned();
        for segments in [vec![], std::iter::once(10..end).collect()] {
            let record = Record { output: &y, inputs: views(&u), past: vec![0; segments.len()], segments };
            let found = forecast(model, &record, &future, 3, InitialCondition::Drop);
            assert!(matches!(found, Err(Error::Data { .. })), "{:?}", model.structure);
        }
    }
}
