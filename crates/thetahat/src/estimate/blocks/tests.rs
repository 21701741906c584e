use super::curve::{Curve, knots};
use super::free_run::FreeRunErrors;
use super::machine::Run;
use super::shape::Shape;
use super::*;
use crate::tests::congruential;
use thetahat_numerics::optimize::Objective;

fn options(structure: BlockStructure, curve: CurveForm) -> BlocksOptions {
    BlocksOptions { structure, orders: (1, 3), delays: None, curve, search: Search::default() }
}

fn silent(_: thetahat_numerics::optimize::Progress) -> std::ops::ControlFlow<()> {
    std::ops::ControlFlow::Continue(())
}

/// An input that is held for some rows.
fn steps(seed: u32, rows: usize, size: f64) -> Vec<f64> {
    congruential(seed, rows / 8 + 1).into_iter().flat_map(|u| [size * u; 8]).take(rows).collect()
}

/// x(k) = f x(k-1) + (1 - f) u(k-1).
fn lag(pole: f64, u: &[f64]) -> Vec<f64> {
    let mut x = 0.0;
    let next = |u: &f64| {
        let now = x;
        x = pole * x + (1.0 - pole) * u;
        now
    };
    u.iter().map(next).collect()
}

#[test]
fn slopes_are_those_of_the_free_run() {
    let u = steps(1, 60, 2.0);
    let run = |inputs: Vec<f64>| Run { inputs, output: lag(0.7, &u) };
    let one = vec![run(u.clone()), run(u.iter().map(|u| 1.0 - u).collect())];
    let two = vec![run(u.iter().flat_map(|u| [*u, u * u]).collect())];
    for (structure, delays, runs) in [
        (BlockStructure::Hammerstein, vec![1], &one),
        (BlockStructure::Hammerstein, vec![0, 2], &two),
        (BlockStructure::Wiener, vec![1, 1], &two),
        (BlockStructure::WienerHammerstein, vec![1], &one),
        (BlockStructure::Feedback, vec![0], &one),
    ] {
        for (form, size) in [(CurveForm::Lines(None), 5), (CurveForm::Polynomial(3), 3)] {
            if (structure, form) == (BlockStructure::Feedback, CurveForm::Lines(None)) {
                continue;
            }
            let is_general = structure == BlockStructure::Feedback;
            let shape = Shape { structure, order: 2, delays: delays.clone(), form, size, is_general };
            let linear = Linear {
                f: vec![-1.1, 0.3],
                b: vec![vec![0.12, 0.08]; delays.len()],
                d: vec![0.05; delays.len()],
            };
            let means = Levels { inputs: vec![0.1; delays.len()], output: 0.2 };
            let start = shape.starts(&linear, runs, (&means, &means)).pop().unwrap();
            let machine = start.machine;
            let mut theta = start.theta;
            theta.extend(vec![0.1; machine.states * runs.len()]);
            // Off the places where a curve bends.
            let shaken = congruential(7, theta.len());
            theta.iter_mut().zip(shaken).for_each(|(theta, shake)| *theta += 0.013 * shake);
            let mut errors = FreeRunErrors::new(&machine, runs);
            let cost = errors.evaluate(&theta).ok().unwrap();
            errors.linearize().ok().unwrap();
            assert!(cost > 0.0);
            for index in 0..theta.len() {
                let at = |step: f64| {
                    let mut other = theta.clone();
                    other[index] += step;
                    FreeRunErrors::new(&machine, runs).evaluate(&other).ok().unwrap()
                };
                let step = 1e-6;
                let slope = -(at(step) - at(-step)) / (4.0 * step);
                let own = errors.right()[index];
                assert!(
                    (own - slope).abs() < 1e-5 * (1.0 + own.abs()),
                    "{structure:?} {form:?} {index}: {own} {slope}"
                );
            }
        }
    }
}

#[test]
fn knots_cover_what_was_seen() {
    let values: Vec<f64> = (0..1000).map(|k| f64::from(k * k) / 1e6).collect();
    let found = knots(values, 9).unwrap();
    assert!(found[0] == 0.0 && (found[found.len() - 1] - 0.998_001).abs() < 1e-12, "{found:?}");
    assert!(found.windows(2).all(|pair| pair[1] > pair[0]) && found.len() > 5, "{found:?}");
    // Two levels say two points, and one none.
    let two = (0..100).map(|k| f64::from(k % 2)).collect();
    assert_eq!(knots(two, 9).unwrap(), [0.0, 1.0]);
    assert!(knots(vec![3.0; 50], 9).is_none() && knots(Vec::new(), 9).is_none());
}

#[test]
fn a_curve_of_lines_goes_on_beyond_its_ends_and_is_held_then() {
    let curve = Curve::Lines { knots: vec![0.0, 1.0, 3.0], pinned: Some(1) };
    let mut basis = Vec::new();
    // Through (0, 2), (1, 0), (3, 4).
    let numbers = [2.0, 4.0];
    for (z, value, slope) in [
        (-9.0, 3.5, 0.0),
        (-0.5, 3.0, -2.0),
        (0.5, 1.0, -2.0),
        (2.0, 2.0, 2.0),
        (3.5, 5.0, 2.0),
        (9.0, 5.5, 0.0),
    ] {
        assert_eq!(curve.evaluate(z, &numbers, &mut basis), (value, slope), "{z}");
    }
    assert_eq!(curve.like(|z| z - 1.0), [-1.0, 2.0]);
}

/// The model of signals that are made by these.
fn text(structure: BlockStructure, curve: CurveForm, inputs: &[&[f64]], y: &[f64]) -> Result<String, Error> {
    let record = Record::new(y, inputs.to_vec()).unwrap();
    let names: Vec<String> = (1..=inputs.len()).map(|input| format!("u{input}")).collect();
    blocks((&record, &names, "y"), 1.0, &options(structure, curve), &silent)
}

/// The start value of a parameter in a text.
#[track_caller]
fn start(text: &str, name: &str) -> f64 {
    let line = text.lines().find(|line| line.starts_with(&format!("{name} = {{ start = "))).expect(text);
    let value = line.split("start = ").nth(1).and_then(|rest| rest.split(',').next()).expect("a value");
    value.parse().expect("a number")
}

#[test]
fn two_inputs_have_a_curve_each() {
    let (a, b) = (steps(3, 1500, 2.0), steps(5, 1500, 2.0));
    let sum: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a.max(0.0) + b.clamp(-1.0, 1.0)).collect();
    let y = lag(0.8, &sum);
    let text = text(BlockStructure::Hammerstein, CurveForm::Lines(None), &[&a, &b], &y).unwrap();
    assert!((start(&text, "f1") + 0.8).abs() < 2e-3, "{text}");
    assert!(text.contains("w1 = \"lines(z1; ") && text.contains("w2 = \"lines(z2; "), "{text}");
    crate::model::GreyBox::from_toml(&text).unwrap();
}

#[test]
fn a_sensor_that_falls_has_rising_knots() {
    let u = steps(9, 1500, 3.0);
    let y: Vec<f64> = lag(0.8, &u).into_iter().map(|x| 1.0 - x.tanh()).collect();
    let text = text(BlockStructure::Wiener, CurveForm::Lines(None), &[&u], &y).unwrap();
    assert!((start(&text, "f1") + 0.8).abs() < 5e-3, "{text}");
    // The knots stand for the input at rest, and the values fall.
    let first = start(&text, "w_1");
    assert!((first - 1.95).abs() < 0.1, "{text}");
}

#[test]
fn an_integrator_behind_a_valve_is_one() {
    let u = steps(11, 2000, 2.0);
    let (mut level, mut noise) = (0.0, congruential(12, 2000).into_iter());
    let y: Vec<f64> = u
        .iter()
        .map(|u| {
            let now = level + 0.02 * noise.next().unwrap();
            level += 0.05 * if u.abs() < 0.5 { 0.0 } else { u - 0.5 * u.signum() };
            now
        })
        .collect();
    let text = text(BlockStructure::Hammerstein, CurveForm::Lines(None), &[&u], &y).unwrap();
    assert!((start(&text, "f1") + 1.0).abs() < 1e-4, "{text}");
}

#[test]
fn what_does_not_move_says_nothing() {
    let (still, u) = (vec![1.0; 300], steps(13, 300, 1.0));
    for (inputs, y) in [(&still, &u), (&u, &still)] {
        let refused = text(BlockStructure::Wiener, CurveForm::Lines(None), &[inputs], y).unwrap_err();
        assert!(refused.to_string().contains("does not move in these rows"), "{refused}");
    }
}
