//! Models with C, D and F.

use std::ops::Range;

use thetahat_numerics::noise::Noise;

use super::{cut, difference, signals, views, with_poles};
use crate::Error;
use crate::data::Record;
use crate::estimate::{Initial, Method, estimate};
use crate::model::{
    Orders, PolynomialModel, Signal,
    polynomial::{inverse_series, product},
};
use crate::respond::{
    InitialCondition, innovations::innovations, predict, predict::deviations, prediction_deviation, simulate,
};

/// One input: nk, B after it, and F.
pub(super) type Input<'a> = (usize, &'a [f64], &'a [f64]);

/// A y = sum_j B_j/F_j u_j + C/D e.
pub(super) fn model(a: &[f64], inputs: &[Input<'_>], c: &[f64], d: &[f64]) -> PolynomialModel {
    let lengths = |of: fn(&Input<'_>) -> usize| inputs.iter().map(of).collect::<Vec<usize>>();
    let orders = Orders::new(
        a.len() - 1,
        &lengths(|input| input.1.len()),
        c.len() - 1,
        d.len() - 1,
        &lengths(|input| input.2.len() - 1),
        &lengths(|input| input.0),
    );
    let mut parameters = a[1..].to_vec();
    inputs.iter().for_each(|(_, b, _)| parameters.extend_from_slice(b));
    parameters.extend(c[1..].iter().chain(&d[1..]));
    inputs.iter().for_each(|(_, _, f)| parameters.extend_from_slice(&f[1..]));
    PolynomialModel::from_parameters(&orders.unwrap(), &parameters, None, 0.25, 1.0).unwrap()
}

pub(super) fn models() -> Vec<PolynomialModel> {
    let one: &[f64] = &[1.0];
    let (fast, slow) = (with_poles(&[0.5, -0.3]), with_poles(&[0.99, 0.8]));
    let wave = [1.0, -1.6, 0.95];
    vec![
        // ARMA, ARMAX, OE, BJ, and all of it.
        model(&fast, &[], &[1.0, 0.4, -0.3, 0.2], one),
        model(&slow, &[(1, &[1.0, 0.5], one)], &[1.0, -0.7], one),
        model(one, &[(1, &[1.0, 0.5], &fast)], one, one),
        model(one, &[(3, &[0.3, 0.5, 1.0], &wave)], one, one),
        model(one, &[(0, &[0.3, 0.5, 1.0], &slow)], &[1.0, 0.9, 0.3], one),
        model(
            one,
            &[(2, &[0.7], &wave), (0, &[1.0, 0.5, 0.2, 0.4], &fast)],
            &[1.0, -0.5],
            &with_poles(&[0.9]),
        ),
        model(
            &with_poles(&[0.9]),
            &[(1, &[1.0], &fast), (5, &[0.5, 1.0], one)],
            &[1.0, 0.5],
            &[1.0, 0.6, 0.2],
        ),
        model(&slow, &[(1, &[1.0], &slow), (4, &[0.5, 1.0], &fast)], one, &fast),
        model(&fast, &[], one, &with_poles(&[-0.8])),
        model(one, &[], &[1.0, -0.9], &with_poles(&[1.0])),
        // F and D with an integrator, an input without B, and F with a zero at its end.
        model(one, &[(1, &[1.0], &with_poles(&[1.0, 0.5]))], &[1.0, 0.2], &with_poles(&[1.0])),
        model(&fast, &[(1, &[], one), (1, &[1.0], &[1.0, -0.5, 0.0])], &[1.0, 0.2], one),
    ]
}

/// The recursions that define a model, from zeros before `begin`, written down sample by sample.
pub(super) struct Recursion<'a> {
    pub(super) model: &'a PolynomialModel,
    pub(super) inputs: &'a [&'a [f64]],
    pub(super) begin: usize,
    /// The first samples without e.
    pub(super) presample: usize,
    /// x_j, w and e before `begin`; none: zero.
    pub(super) x: Vec<Vec<f64>>,
}

/// sum_{i >= 1} p_i s(t - i), zeros before the first.
fn earlier(polynomial: &[f64], signal: &[f64], t: usize) -> f64 {
    (1..polynomial.len().min(t + 1)).map(|lag| polynomial[lag] * signal[t - lag]).sum()
}

impl<'a> Recursion<'a> {
    pub(super) fn new(
        model: &'a PolynomialModel,
        inputs: &'a [&'a [f64]],
        begin: usize,
        presample: usize,
    ) -> Self {
        Self { model, inputs, begin, presample, x: vec![Vec::new(); model.f.len()] }
    }

    /// Replaces y from sample `known` on by what the recursions give with e = 0; gives e.
    pub(super) fn run(&self, y: &mut [f64], known: usize) -> Vec<f64> {
        let (model, begin) = (self.model, self.begin);
        let length = y.len() - begin;
        let (mut w, mut e) = (vec![0.0; length], vec![0.0; length]);
        let mut sum = vec![0.0; length];
        for ((b, f), (u, before)) in model.b.iter().zip(&model.f).zip(self.inputs.iter().zip(&self.x)) {
            // The past of x in rising time, then x.
            let mut x = before.clone();
            for (t, sum) in sum.iter_mut().enumerate() {
                let driven: f64 = (0..b.len().min(t + 1)).map(|lag| b[lag] * u[begin + t - lag]).sum();
                let now = driven - earlier(f, &x, x.len());
                x.push(now);
                *sum += now;
            }
        }
        for t in 0..length {
            let (past_w, past_e) = (earlier(&model.d, &w, t), earlier(&model.c, &e, t));
            let past_y = earlier(&model.a, &y[begin..], t);
            if begin + t < known {
                w[t] = y[begin + t] + past_y - sum[t];
                e[t] = if t < self.presample { 0.0 } else { w[t] + past_w - past_e };
            } else {
                w[t] = past_e - past_w;
                y[begin + t] = sum[t] + w[t] - past_y;
            }
        }
        e
    }
}

#[test]
fn a_prediction_is_what_the_recursions_give_from_what_is_known() {
    let mut noise = Noise(1);
    for model in models() {
        let (u, y) = (signals(model.b.len(), 150, &mut noise), noise.take(150));
        let record = cut(&y, &u);
        let conditioned = model.orders.conditioned();
        for horizon in [1, 2, 5, 40] {
            for start in [InitialCondition::Zero, InitialCondition::Drop] {
                let (presample, skipped) = if start == InitialCondition::Zero {
                    (0, 0)
                } else {
                    (conditioned, conditioned + horizon - 1)
                };
                let mut expected = vec![f64::NAN; 150];
                let mut counted = Vec::new();
                for (segment, past) in record.segments.iter().zip(&record.past) {
                    let begin =
                        if start == InitialCondition::Zero { segment.start } else { segment.start - past };
                    let rows = segment.start.max(begin + skipped)..segment.end;
                    if rows.is_empty() {
                        continue;
                    }
                    counted.push(rows.clone());
                    for t in rows {
                        let mut known = y[..=t].to_vec();
                        let until = (t + 1).saturating_sub(horizon).max(begin);
                        Recursion::new(&model, &record.inputs, begin, presample).run(&mut known, until);
                        expected[t] = known[t];
                    }
                }
                let response = predict(&model, &record, horizon, start).unwrap();
                assert_eq!(response.counted, counted);
                // Of an output near 1, far predictions may be much smaller.
                for t in counted.into_iter().flatten() {
                    let error = (response.values[t] - expected[t]).abs();
                    let size = expected[t].abs().max(1.0);
                    assert!(error < 1e-12 * size, "{:?} {horizon} {start:?} {error}", model.structure);
                }
            }
        }
    }
}

#[test]
fn a_free_run_goes_on_from_what_is_known() {
    let mut noise = Noise(2);
    for model in models() {
        let (u, y) = (signals(model.b.len(), 150, &mut noise), noise.take(150));
        let record = cut(&y, &u);
        let conditioned = model.orders.conditioned();
        for start in [InitialCondition::Zero, InitialCondition::Drop] {
            let mut expected = vec![f64::NAN; 150];
            let mut counted = Vec::new();
            for (segment, past) in record.segments.iter().zip(&record.past) {
                let (begin, presample) = match start {
                    InitialCondition::Zero => (segment.start, 0),
                    _ => (segment.start - past, conditioned),
                };
                let rows = segment.start.max(begin + presample)..segment.end;
                if rows.is_empty() {
                    continue;
                }
                let mut run = y[..segment.end].to_vec();
                Recursion::new(&model, &record.inputs, begin, presample).run(&mut run, rows.start);
                expected[rows.clone()].copy_from_slice(&run[rows.clone()]);
                counted.push(rows);
            }
            let response = simulate(&model, &record, start).unwrap();
            assert_eq!(response.counted, counted);
            // Without inputs a run from zero is zero.
            let error = if model.b.is_empty() && start == InitialCondition::Zero {
                response.values.iter().filter(|value| value.is_finite()).fold(0.0, |a, b| b.abs().max(a))
            } else {
                difference(&response, &expected)
            };
            assert!(counted.is_empty() || error < 1e-12, "{:?} {start:?} {error}", model.structure);
        }
    }
}

/// The output to inputs and innovations, from zeros.
pub(super) fn output(model: &PolynomialModel, inputs: &[Vec<f64>], e: &[f64]) -> Vec<f64> {
    let length = e.len();
    // x = (B/F) u and (C/D) e as series.
    let filtered = |numerator: &[f64], denominator: &[f64], u: &[f64]| {
        let weights = product(numerator, &inverse_series(denominator, length));
        let at = |t: usize| (0..=t.min(weights.len() - 1)).map(|lag| weights[lag] * u[t - lag]).sum::<f64>();
        (0..length).map(at).collect::<Vec<f64>>()
    };
    let mut sum = filtered(&model.c, &model.d, e);
    for ((b, f), u) in model.b.iter().zip(&model.f).zip(inputs) {
        if b.iter().any(|b| *b != 0.0) {
            sum.iter_mut().zip(filtered(b, f, u)).for_each(|(sum, x)| *sum += x);
        }
    }
    filtered(&[1.0], &model.a, &sum)
}

#[test]
fn the_innovations_of_a_models_own_output_come_back() {
    let mut noise = Noise(3);
    for model in models() {
        let (u, e) = (signals(model.b.len(), 400, &mut noise), noise.take(400));
        let y = output(&model, &u, &e);
        let record = Record::new(&y, views(&u)).unwrap();
        let found = innovations(&model, &record, 1, InitialCondition::Zero).unwrap();
        assert_eq!(found[0].counted, std::slice::from_ref(&(0..400)));
        let worst = found[0].errors.iter().zip(&e).fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
        let largest = y.iter().fold(1.0_f64, |largest, y| largest.max(y.abs()));
        assert!(worst < 1e-12 * largest, "{:?} {worst}", model.structure);
    }
}

#[test]
fn innovations_are_the_residuals_of_the_estimate() {
    let mut noise = Noise(9);
    let one: &[f64] = &[1.0];
    let truth = model(one, &[(2, &[1.0, 0.5], &[1.0, -1.6, 0.8])], &[1.0, 0.5], &[1.0, -0.8]);
    let u = signals(1, 700, &mut noise);
    let y = output(&truth, &u, &noise.take(700));
    let record =
        Record { output: &y, inputs: views(&u), segments: vec![60..300, 310..660], past: vec![0, 10] };
    for orders in [
        Orders::arx(2, &[2], &[2]),
        Orders::armax(2, &[2], 2, &[2]),
        Orders::oe(&[2], &[2], &[2]),
        Orders::bj(&[2], 1, 1, &[2], &[2]),
        Orders::new(1, &[3], 1, 1, &[1], &[1]),
    ] {
        let orders = orders.unwrap();
        let dropped = if orders.is_linear() { InitialCondition::Drop } else { InitialCondition::Estimate };
        for (initial, start) in [
            (Initial::Zero, InitialCondition::Zero),
            (Initial::Drop, dropped),
            (Initial::Estimate, InitialCondition::Estimate),
        ] {
            let found = estimate(&record, &orders, &Method::default(), initial);
            assert_eq!(
                found.is_ok(),
                initial != if orders.has_f() { Initial::Drop } else { Initial::Estimate }
            );
            let Ok(found) = found else { continue };
            let signal = Signal::default;
            let model = found.to_model(&orders, 1.0, vec![signal()], signal()).unwrap();
            let (mut squares, mut samples) = (0.0, 0);
            for segment in innovations(&model, &record, 1, start).unwrap() {
                squares += segment.counted_errors().map(|e| e * e).sum::<f64>();
                samples += segment.counted_errors().count();
            }
            assert_eq!(samples, found.samples(), "{:?} {initial:?}", orders.structure());
            let ratio = squares / samples as f64 / found.mse();
            assert!((ratio - 1.0).abs() < 1e-9, "{:?} {initial:?} {ratio}", orders.structure());
        }
    }
}

/// (1/C) of -D x, of which the first samples are zero: what a change of x does to e.
fn effect(model: &PolynomialModel, x: &[f64], presample: usize) -> Vec<f64> {
    let mut e = vec![0.0; x.len()];
    for t in presample..x.len() {
        e[t] = -x[t] - earlier(&model.d, x, t) - earlier(&model.c, &e, t);
    }
    e
}

/// What each single value of x_j before a segment does to x.
fn effects_of_the_past(model: &PolynomialModel, length: usize) -> Vec<Vec<f64>> {
    let mut effects = Vec::new();
    for f in model.f.iter().filter(|f| f.len() > 1) {
        let respond = |pulse: &dyn Fn(usize) -> f64| {
            let mut x = vec![0.0; length];
            for t in 0..length {
                x[t] = pulse(t) - earlier(f, &x, t);
            }
            x
        };
        let after = |polynomial: &[f64], at: usize| polynomial.get(at).copied().unwrap_or(0.0);
        effects.extend((1..f.len()).map(|lag| respond(&|t| -after(f, t + lag))));
    }
    effects
}

/// What each single value of an input with F before a segment does to x, and how many more initial conditions it takes
/// to make up for all of them where x counts from sample `first` on.
fn effects_of_inputs(model: &PolynomialModel, length: usize, first: usize) -> (Vec<Vec<f64>>, usize) {
    let (mut effects, mut more) = (Vec::new(), 0);
    for (b, f) in model.b.iter().zip(&model.f).filter(|(_, f)| f.len() > 1) {
        let respond = |lag: usize| {
            let mut x = vec![0.0; length];
            for t in 0..length {
                x[t] = b.get(t + lag).copied().unwrap_or(0.0) - earlier(f, &x, t);
            }
            x
        };
        effects.extend((1..b.len()).map(respond));
        more += (b.len() - 1).saturating_sub(first).saturating_sub(f.len() - 1);
    }
    (effects, more)
}

/// The sum of squares that is left of a signal by the best combination of others: what is left of these is taken off in
/// turn, the largest first, as long as it is more than rounding.
fn left(signal: &[f64], others: &[Vec<f64>]) -> f64 {
    let inner = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut rest = signal.to_vec();
    let mut others = others.to_vec();
    let sizes: Vec<f64> = others.iter().map(|other| inner(other, other)).collect();
    let mut sizes: Vec<f64> = sizes.iter().map(|size| 1e-24 * size).collect();
    while let Some(largest) = (0..others.len())
        .max_by(|&i, &j| inner(&others[i], &others[i]).total_cmp(&inner(&others[j], &others[j])))
    {
        let (unit, rounding) = (others.swap_remove(largest), sizes.swap_remove(largest));
        let size = inner(&unit, &unit);
        if size <= rounding {
            continue;
        }
        for _ in 0..2 {
            for from in others.iter_mut().chain([&mut rest]) {
                let weight = inner(from, &unit) / size;
                from.iter_mut().zip(&unit).for_each(|(from, unit)| *from -= weight * unit);
            }
        }
    }
    inner(&rest, &rest)
}

#[test]
fn an_estimated_start_leaves_the_least_errors_that_any_past_can() {
    let mut noise = Noise(4);
    for model in models() {
        let (u, y) = (signals(model.b.len(), 300, &mut noise), noise.take(300));
        let record = Record {
            output: &y,
            inputs: views(&u),
            segments: vec![40..240, 245..252, 260..300],
            past: vec![0; 3],
        };
        let presample = model.orders.conditioned();
        let found = innovations(&model, &record, 1, InitialCondition::Estimate).unwrap();
        assert!(found.len() >= 2, "{:?}", model.structure);
        // With what earlier inputs do where that is worth it, in all segments that are long enough, or none.
        let first = presample - model.orders.nd;
        let lefts = found.iter().map(|found| {
            let segment = found.rows.clone();
            let mut known = y[..segment.end].to_vec();
            let from_rest =
                Recursion::new(&model, &record.inputs, segment.start, presample).run(&mut known, segment.end);
            let seen = |x: &Vec<f64>| effect(&model, x, presample);
            let mut effects: Vec<Vec<f64>> =
                effects_of_the_past(&model, segment.len()).iter().map(seen).collect();
            let narrow = left(&from_rest, &effects);
            let (inputs, more) = effects_of_inputs(&model, segment.len(), first);
            let all = model.orders.nf.iter().sum::<usize>() + more;
            let fits = segment.len() - presample > all;
            if fits {
                effects.extend(inputs.iter().map(seen));
            }
            (segment.len() - presample, narrow, left(&from_rest, &effects), if fits { more } else { 0 })
        });
        let lefts: Vec<_> = lefts.collect();
        let samples = lefts.iter().map(|left| left.0).sum::<usize>() as f64;
        let ratio =
            lefts.iter().map(|left| left.1).sum::<f64>() / lefts.iter().map(|left| left.2).sum::<f64>();
        let more = lefts.iter().map(|left| left.3).sum::<usize>();
        let wide = more > 0 && samples * ratio.ln() > more as f64 * samples.ln();
        for (found, (_, narrow, least, _)) in found.into_iter().zip(lefts) {
            if wide {
                let cost = found.errors.iter().map(|e| e * e).sum::<f64>();
                assert!((cost / least - 1.0).abs() < 1e-9, "{:?} {cost} {least}", model.structure);
                continue;
            }
            let segment = found.rows.clone();
            assert_eq!(found.counted, std::slice::from_ref(&(segment.start + presample..segment.end)));
            let mut known = y[..segment.end].to_vec();
            let from_rest =
                Recursion::new(&model, &record.inputs, segment.start, presample).run(&mut known, segment.end);
            let effects: Vec<Vec<f64>> = effects_of_the_past(&model, segment.len())
                .iter()
                .map(|x| effect(&model, x, presample))
                .collect();
            let cost = found.errors.iter().map(|e| e * e).sum::<f64>();
            assert!((cost / narrow - 1.0).abs() < 1e-9, "{:?} {cost} {narrow}", model.structure);
            // And it is one of these starts that leaves them.
            let change: Vec<f64> = found.errors.iter().zip(&from_rest).map(|(a, b)| a - b).collect();
            let size = from_rest.iter().map(|x| x * x).sum::<f64>();
            assert!(left(&change, &effects) <= 1e-22 * size, "{:?}", model.structure);
        }
    }
}

#[test]
fn an_estimated_start_makes_up_for_any_past() {
    let mut noise = Noise(5);
    for model in models() {
        let mut u = signals(model.b.len(), 500, &mut noise);
        // Inputs with F rest before each segment, as long as B reaches back.
        for (u, _) in u.iter_mut().zip(&model.f).filter(|(_, f)| f.len() > 1) {
            [50, 130, 200].iter().for_each(|start| u[start - 10..*start].fill(0.0));
        }
        let y = output(&model, &u, &[0.0; 500]);
        if y.iter().all(|y| *y == 0.0) {
            continue;
        }
        let record = Record {
            output: &y,
            inputs: views(&u),
            segments: vec![50..120, 130..160, 200..500],
            past: vec![0; 3],
        };
        let run = simulate(&model, &record, InitialCondition::Estimate).unwrap();
        assert_eq!(run.counted, record.segments);
        assert!(difference(&run, &y) < 1e-10, "{:?} {}", model.structure, difference(&run, &y));
        for horizon in [1, 7] {
            let response = predict(&model, &record, horizon, InitialCondition::Estimate).unwrap();
            let counts = |segment: &Range<usize>| {
                segment.start + model.orders.conditioned() + horizon - 1..segment.end
            };
            assert_eq!(response.counted, record.segments.iter().map(counts).collect::<Vec<_>>());
            let error = difference(&response, &y);
            assert!(error < 1e-9, "{:?} {horizon} {error}", model.structure);
        }
    }
}

#[test]
fn an_estimated_start_is_the_best_there_is_for_a_free_run() {
    let mut noise = Noise(6);
    for model in models() {
        let u = signals(model.b.len(), 300, &mut noise);
        let y = output(&model, &u, &noise.take(300));
        let segment = 40..240;
        let record = Record {
            output: &y,
            inputs: views(&u),
            segments: std::iter::once(segment.clone()).collect(),
            past: vec![0],
        };
        let values = &simulate(&model, &record, InitialCondition::Estimate).unwrap().values[segment.clone()];
        let errors: Vec<f64> = y[segment.clone()].iter().zip(values).map(|(y, x)| y - x).collect();
        let from_rest = simulate(&model, &record, InitialCondition::Zero).unwrap();
        let from_rest: Vec<f64> =
            y[segment.clone()].iter().zip(&from_rest.values[segment]).map(|(y, x)| y - x).collect();
        // What each single earlier value of y, u_j and x_j does.
        let mut effects = effects_of_the_past(&model, 200);
        for (b, _) in model.b.iter().zip(&model.f).filter(|(_, f)| f.len() == 1) {
            effects.extend(
                (1..b.len()).map(|lag| {
                    (0..200).map(|t| b.get(t + lag).copied().unwrap_or(0.0)).collect::<Vec<f64>>()
                }),
            );
        }
        let past = |lag: usize| (0..200).map(move |t| (t, lag));
        effects.extend((1..model.a.len()).map(|lag| {
            past(lag).map(|(t, lag)| -model.a.get(t + lag).copied().unwrap_or(0.0)).collect::<Vec<f64>>()
        }));
        let (mut inputs, more) = effects_of_inputs(&model, 200, 0);
        for effect in effects.iter_mut().chain(&mut inputs) {
            for t in 0..200 {
                effect[t] -= earlier(&model.a, effect, t);
            }
        }
        // The level of a noise that integrates.
        effects.extend(model.noise_integrates().then(|| vec![1.0; 200]));
        let cost = errors.iter().map(|e| e * e).sum::<f64>();
        let mut best = left(&from_rest, &effects);
        // With what earlier inputs do where that is worth it.
        let least = left(&from_rest, &[&effects[..], &inputs].concat());
        if more > 0 && 200.0 * (best / least).ln() > more as f64 * 200_f64.ln() {
            best = least;
            effects.extend(inputs);
        }
        assert!((cost / best - 1.0).abs() < 1e-9, "{:?} {cost} {best}", model.structure);
        let change: Vec<f64> = errors.iter().zip(&from_rest).map(|(a, b)| a - b).collect();
        let size = from_rest.iter().map(|x| x * x).sum::<f64>();
        assert!(left(&change, &effects) <= 1e-22 * size, "{:?}", model.structure);
    }
}

#[test]
fn measured_samples_warm_the_filters_up() {
    let mut noise = Noise(7);
    for model in models().iter().filter(|model| model.poles.iter().all(|p| p.re.hypot(p.im) < 0.99)) {
        let (u, e) = (signals(model.b.len(), 1500, &mut noise), noise.take(1500));
        let y = output(model, &u, &e);
        let record = Record {
            output: &y,
            inputs: views(&u),
            segments: std::iter::once(1400..1500).collect(),
            past: vec![1300],
        };
        let response = predict(model, &record, 1, InitialCondition::Drop).unwrap();
        let mut worst = 0.0_f64;
        (1400..1500).for_each(|t| worst = worst.max((y[t] - response.values[t] - e[t]).abs()));
        assert!(worst < 1e-9, "{:?} {worst}", model.structure);
    }
}

#[test]
fn the_deviation_of_predictions_is_that_of_many_runs() {
    let mut noise = Noise(8);
    for model in models() {
        let (u, length) = (signals(model.b.len(), 60, &mut noise), 60);
        let runs = 2000;
        for horizon in [1, 3, 10] {
            let mut sum = 0.0;
            for _ in 0..runs / 10 {
                // Uniform in -1 … 1: a variance of 1/3, where the model has 1/4.
                let e: Vec<f64> = noise.take(length).iter().map(|e| e * 0.75_f64.sqrt()).collect();
                let y = output(&model, &u, &e);
                let record = Record::new(&y, views(&u)).unwrap();
                let response = predict(&model, &record, horizon, InitialCondition::Zero).unwrap();
                // Ten samples apart they are independent.
                sum += (14..length).step_by(10).map(|t| (y[t] - response.values[t]).powi(2)).sum::<f64>();
            }
            let found = (sum / f64::from(runs / 10) / 5.0).sqrt();
            let expected = prediction_deviation(&model, horizon).unwrap();
            // 1000 squares; a relative error of the deviation of 1/sqrt(2000), a little less for uniform numbers.
            assert!(
                (found / expected - 1.0).abs() < 0.09,
                "{:?} {horizon} {found} {expected}",
                model.structure
            );
        }
    }
}

#[test]
fn deviations_have_a_limit_or_overflow() {
    let arma = deviations(&models()[0], 3);
    assert_eq!(arma[0], 0.5);
    assert_eq!(arma[2], prediction_deviation(&models()[0], 3).unwrap());
    assert!(deviations(&models()[0], 0).is_empty());
    // A random walk.
    let walk = model(&with_poles(&[1.0]), &[], &[1.0], &[1.0]);
    assert!((prediction_deviation(&walk, 100_000).unwrap() - 0.5 * 1e5_f64.sqrt()).abs() < 1e-8);
    let unstable = model(&with_poles(&[2.0]), &[], &[1.0], &[1.0]);
    assert_eq!(prediction_deviation(&unstable, 3000).unwrap(), f64::INFINITY);
    assert!(deviations(&unstable, 3000)[2999].is_infinite());
    for horizon in [0, 1_000_001, usize::MAX] {
        assert!(matches!(prediction_deviation(&walk, horizon), Err(Error::Argument { .. })));
    }
}

#[test]
fn what_does_not_fit_is_refused_or_left_out() {
    let models = models();
    let bj = &models[4];
    let (y, u) = (vec![1.0; 20], vec![1.0; 20]);
    let record = Record::new(&y, vec![&u]).unwrap();
    assert!(matches!(predict(bj, &record, 0, InitialCondition::Zero), Err(Error::Argument { .. })));
    let several = Record::new(&y, vec![&u, &u]).unwrap();
    for start in [InitialCondition::Zero, InitialCondition::Drop, InitialCondition::Estimate] {
        assert!(matches!(predict(bj, &several, 1, start), Err(Error::Argument { .. })));
        assert!(matches!(simulate(bj, &several, start), Err(Error::Argument { .. })));
        // One sample, and none.
        for segments in [vec![], std::iter::once(5..6).collect()] {
            let past = vec![0; segments.len()];
            let short = Record { output: &y, inputs: vec![&u], segments, past };
            for model in [bj, &models[3], &models[1]] {
                let count = predict(model, &short, 1, start).unwrap().counted.len();
                assert!(count <= short.segments.len());
                assert!(simulate(model, &short, start).unwrap().counted.len() <= short.segments.len());
            }
            assert!(predict(&models[3], &short, usize::MAX, start).is_ok());
        }
    }
    // An ARX model has no start to estimate for its predictions.
    let arx = super::models().remove(0);
    assert!(matches!(predict(&arx, &record, 1, InitialCondition::Estimate), Err(Error::Argument { .. })));
}

#[test]
fn what_overflows_is_an_error_or_infinite_and_never_a_panic() {
    let u = vec![1.0; 3000];
    let record = Record::new(&u, vec![&u]).unwrap();
    let one: &[f64] = &[1.0];
    for root in [2.0, -2.0, 1e200] {
        let grown = with_poles(&[root]);
        let models = [
            model(one, &[(1, &[1.0], &grown)], one, one),
            model(one, &[(1, &[1.0], &with_poles(&[0.5]))], &grown, one),
            model(one, &[(1, &[1.0], &with_poles(&[0.5]))], one, &grown),
        ];
        for (index, model) in models.iter().enumerate() {
            for start in [InitialCondition::Zero, InitialCondition::Drop] {
                assert_eq!(simulate(model, &record, start).unwrap().values.len(), 3000);
                assert_eq!(predict(model, &record, 2900, start).unwrap().values.len(), 3000);
            }
            // D does no harm by itself, as long as its products stay within range.
            let estimated = predict(model, &record, 5, InitialCondition::Estimate);
            assert_eq!(estimated.is_err(), index < 2 || root == 1e200, "{root} {index}");
            assert_eq!(simulate(model, &record, InitialCondition::Estimate).is_err(), index < 1);
        }
    }
}
