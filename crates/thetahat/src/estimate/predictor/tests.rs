//! Errors, gradients and Gram matrices against their definitions.

use thetahat_numerics::noise::Noise;

use super::*;
use crate::model::polynomial::product;

/// A stable monic polynomial.
fn stable(order: usize, noise: &mut Noise) -> Vec<f64> {
    let mut monic = vec![1.0];
    while monic.len() + 1 < order + 1 {
        let (radius, angle) = (0.95 * noise.uniform().abs(), 3.0 * noise.uniform());
        monic = product(&monic, &[1.0, -2.0 * radius * angle.cos(), radius * radius]);
    }
    while monic.len() < order + 1 {
        monic = product(&monic, &[1.0, 0.9 * noise.uniform()]);
    }
    monic
}

/// Random orders with one to two inputs or none, and parameters.
fn random(noise: &mut Noise) -> (Orders, Vec<f64>) {
    let mut below = |count: usize| ((noise.uniform() + 1.0) / 2.0 * count as f64) as usize;
    let inputs = below(3);
    let (na, nc, nd) = (below(3), below(3), below(3));
    let nb: Vec<usize> = (0..inputs).map(|_| 1 + below(3)).collect();
    let nf: Vec<usize> = (0..inputs).map(|_| below(4)).collect();
    let nk: Vec<usize> = (0..inputs).map(|_| below(4)).collect();
    let Ok(orders) = Orders::new(na, &nb, nc, nd, &nf, &nk) else { return random(noise) };
    let mut parameters = stable(na, noise).split_off(1);
    parameters.extend(noise.take(nb.iter().sum()));
    parameters.extend(&stable(nc, noise)[1..]);
    parameters.extend(&stable(nd, noise)[1..]);
    nf.iter().for_each(|&nf| parameters.extend(&stable(nf, noise)[1..]));
    (orders, parameters)
}

fn record<'a>(output: &'a [f64], inputs: &'a [Vec<f64>]) -> Record<'a> {
    let segments = vec![0..60, 61..75, 80..140];
    Record { output, inputs: inputs.iter().map(Vec::as_slice).collect(), past: vec![0; 3], segments }
}

/// Predictors of models on common samples, and on all samples with what is known before their segments.
fn predictors<'a>(record: &Record<'a>, orders: &Orders) -> Vec<Predictor<'a>> {
    let common = [
        (InitialCondition::Zero, 0, 0),
        (InitialCondition::Zero, 0, 9),
        (InitialCondition::Unknown, 0, 0),
        (InitialCondition::Unknown, 0, 9),
        (InitialCondition::Unknown, 7, 9),
    ];
    // Models are compared on samples of which none is missing.
    let complete = record.output.iter().all(|y| !y.is_nan());
    let common = common.into_iter().filter(|_| complete);
    let common = common
        .map(|(begin, left_out, counted)| Predictor::counting(record, orders, begin, left_out, counted));
    let known = Record { past: vec![0, 1, 5], ..record.clone() };
    let own = [InitialCondition::Zero, InitialCondition::Unknown, InitialCondition::UnknownInputs]
        .map(|begin| Predictor::new(&known, orders, begin));
    common.chain(own).collect()
}

/// An output with some samples missing, if the model allows it.
fn output(orders: &Orders, noise: &mut Noise) -> Vec<f64> {
    let mut y = noise.take(140);
    if !orders.needs_past_outputs() {
        for t in [0, 1, 20, 40, 41, 45, 62, 100, 102, 139] {
            y[t] = f64::NAN;
        }
    }
    y
}

/// All errors that count, segment by segment, of parameters followed by the initial-condition responses' weights of
/// each segment.
fn errors(predictor: &mut Predictor<'_>, unknowns: &[f64]) -> Vec<f64> {
    let (parameters, mut weights) = unknowns.split_at(predictor.right.len());
    for section in &mut predictor.sections {
        let (own, rest) = weights.split_at(section.trial.len());
        section.trial.copy_from_slice(own);
        weights = rest;
    }
    predictor.set(parameters).unwrap();
    let Predictor { layouts, polynomials, negative, sections, .. } = &mut *predictor;
    sections.iter_mut().for_each(|section| section.evaluate(&layouts[section.layout], polynomials, negative));
    predictor.residuals().0
}

#[test]
fn errors_are_those_of_the_difference_equations() {
    let mut noise = Noise(1);
    let mut through = 0;
    for _ in 0..100 {
        let (orders, parameters) = random(&mut noise);
        let u: Vec<Vec<f64>> = (0..orders.inputs()).map(|_| noise.take(140)).collect();
        let y = output(&orders, &mut noise);
        through += usize::from(y[1].is_nan());
        let record = record(&y, &u);
        for mut predictor in predictors(&record, &orders) {
            let weights = noise.take(predictor.initial_conditions());
            let found = errors(&mut predictor, &[parameters.clone(), weights.clone()].concat());
            let Polynomials { a, b, c, d, f } = Polynomials::new(&orders, &parameters);
            let (mut expected, mut weights): (Vec<f64>, &[f64]) = (Vec::new(), &weights);
            for section in &predictor.sections {
                let Layout { conditioned, counted, origin, own_free, .. } =
                    &predictor.layouts[section.layout];
                // Before the section everything is zero.
                let at = |x: &[f64], t: usize, lag: usize| if t < lag { 0.0 } else { x[t - lag] };
                let past =
                    |p: &[f64], x: &[f64], t: usize| (1..p.len()).map(|i| p[i] * at(x, t, i)).sum::<f64>();
                let mut w: Vec<f64> = Vec::new();
                let (mut x, mut e) = (vec![Vec::new(); u.len()], Vec::new());
                let mut free = Vec::new();
                for count in own_free {
                    let (own, rest) = weights.split_at(*count);
                    free.push(own);
                    weights = rest;
                }
                for t in 0..section.output.len() {
                    let mut value = section.output[t] + past(&a, section.output, t);
                    for j in 0..u.len() {
                        let own = |i: usize| b[j][i] * at(section.inputs[j], t, orders.nk[j] + i);
                        let driven: f64 = (0..b[j].len()).map(own).sum();
                        let impulse = t.checked_sub(*origin).and_then(|i| free[j].get(i)).unwrap_or(&0.0);
                        let now = driven + impulse - past(&f[j], &x[j], t);
                        x[j].push(now);
                        value -= now;
                    }
                    w.push(value);
                    let error = value + past(&d, &w, t) - past(&c, &e, t);
                    e.push(if t < *conditioned { 0.0 } else { error });
                }
                expected.extend(e[*counted..].iter().filter(|e| !e.is_nan()));
            }
            assert_eq!(found.len(), expected.len());
            assert_eq!(found.len(), predictor.samples());
            let size = expected.iter().fold(0.0_f64, |size, e| size.max(e.abs()));
            assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-11 * size), "{orders:?}");
        }
    }
    assert!(through > 3);
}

#[test]
fn sections_begin_with_the_past_that_their_errors_reach_back_to() {
    let mut noise = Noise(5);
    let (u, y) = ([noise.take(140)], noise.take(140));
    // B reaches back 4 samples, D one more.
    let orders = Orders::bj(&[2], 1, 1, &[1], &[3]).unwrap();
    let record = Record { past: vec![0, 3, 5], ..record(&y, &u) };
    let of = |begin| {
        let predictor = Predictor::new(&record, &orders, begin);
        let each = predictor.sections.iter().map(|section| (section.output.len(), section.free.len()));
        (predictor.samples(), each.collect::<Vec<_>>())
    };
    assert_eq!(of(InitialCondition::Zero), (134, vec![(60, 0), (14, 0), (60, 0)]));
    // Without a past the first sample of D w is not there.
    assert_eq!(of(InitialCondition::Unknown), (133, vec![(60, 1), (17, 1), (65, 1)]));
    assert_eq!(of(InitialCondition::UnknownInputs), (133, vec![(60, 4), (17, 2), (65, 1)]));
    assert!(Predictor::has_unknown_inputs(&record.past, &orders));
    assert!(!Predictor::has_unknown_inputs(&[5; 3], &orders));
}

#[test]
fn what_was_before_a_segment_is_known_or_estimated() {
    let mut noise = Noise(6);
    let orders = Orders::oe(&[2], &[2], &[4]).unwrap();
    let parameters = [1.0, 0.5, -1.5, 0.7];
    let u = noise.take(200);
    let mut y = vec![0.0; 200];
    for t in 5..200 {
        y[t] = u[t - 4] + 0.5 * u[t - 5] + 1.5 * y[t - 1] - 0.7 * y[t - 2];
    }
    let whole = Record::new(&y, vec![&u]).unwrap();
    let of = |past: usize, begin| {
        let segments = std::iter::once(100..200).collect();
        let record = Record { segments, past: vec![past], ..whole.clone() };
        let mut predictor = Predictor::new(&record, &orders, begin);
        assert_eq!(predictor.samples(), 100);
        predictor.evaluate(&parameters).unwrap();
        predictor.linearize();
        predictor.try_free(&[]);
        predictor.evaluate(&parameters).unwrap()
    };
    assert!(of(5, InitialCondition::Unknown) < 1e-20 && of(100, InitialCondition::Unknown) < 1e-20);
    assert!(of(0, InitialCondition::UnknownInputs) < 1e-20 && of(3, InitialCondition::UnknownInputs) < 1e-20);
    assert!(of(0, InitialCondition::Unknown) > 1e-3 && of(2, InitialCondition::Unknown) > 1e-3);
}

#[test]
fn gradients_and_gram_matrices_are_those_of_central_differences() {
    let mut noise = Noise(2);
    for _ in 0..200 {
        let (orders, parameters) = random(&mut noise);
        let u: Vec<Vec<f64>> = (0..orders.inputs()).map(|_| noise.take(140)).collect();
        let y = output(&orders, &mut noise);
        let record = record(&y, &u);
        for mut predictor in predictors(&record, &orders) {
            let free = predictor.initial_conditions();
            let unknowns = [parameters.clone(), noise.take(free)].concat();
            let psi: Vec<Vec<f64>> = (0..unknowns.len())
                .map(|index| {
                    // Errors are linear in the weights.
                    let step = if index < parameters.len() { 1e-5 } else { 1.0 };
                    let mut moved = |by: f64| {
                        let mut unknowns = unknowns.clone();
                        unknowns[index] += by;
                        errors(&mut predictor, &unknowns)
                    };
                    let (low, high) = (moved(-step), moved(step));
                    low.iter().zip(high).map(|(low, high)| (low - high) / (2.0 * step)).collect()
                })
                .collect();
            let e = errors(&mut predictor, &unknowns);
            predictor.linearize();
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let norm = |a: &[f64]| dot(a, a).sqrt();
            let count = parameters.len();
            let (mut from, mut before) = (0, count);
            for section in &predictor.sections {
                let rows = from..from + section.runs.iter().map(Range::len).sum::<usize>();
                from = rows.end;
                // What the parameters and the weights of this section have, in the list of all unknowns.
                let place = |index: usize| if index < count { index } else { index - count + before };
                let all = count + section.free.len();
                for i in 0..all {
                    let left = &psi[place(i)][rows.clone()];
                    let length = norm(&e[rows.clone()]);
                    // Differences have rounding of some 1e-10.
                    let size = norm(left).max(1e-3) * length;
                    let right = dot(left, &e[rows.clone()]);
                    assert!((section.right[i] - right).abs() <= 1e-6 * size, "{orders:?} {i}");
                    for j in 0..all {
                        let other = &psi[place(j)][rows.clone()];
                        let difference = section.gram[i * all + j] - dot(left, other);
                        let rounding = 1e-3 * norm(left).max(norm(other)).max(1.0);
                        let size = (norm(left) * norm(other)).max(rounding);
                        assert!(difference.abs() <= 1e-6 * size, "{orders:?} {i} {j}");
                    }
                }
                before += section.free.len();
            }
        }
    }
}

#[test]
fn what_is_formed_of_a_and_b_alone_is_a_part_of_all() {
    let mut noise = Noise(5);
    for _ in 0..60 {
        let (orders, parameters) = random(&mut noise);
        let y = output(&orders, &mut noise);
        let u: Vec<Vec<f64>> = orders.nb.iter().map(|_| noise.take(140)).collect();
        let record = record(&y, &u);
        for (mut predictor, bound) in
            predictors(&record, &orders).into_iter().zip([None, Some(0.5)].into_iter().cycle())
        {
            predictor.count_linearly_from(bound);
            let Ok(cost) = predictor.evaluate(&parameters) else { continue };
            predictor.linearize();
            let (whole, gradient) = (predictor.matrix.clone(), predictor.right.clone());
            let (size, count) = (gradient.len(), orders.na + orders.nb.iter().sum::<usize>());
            let lengths: Vec<f64> =
                (0..size).map(|column| predictor.square_of(column).max(1.0).sqrt()).collect();
            let (mut matrix, mut right) = (vec![0.0; count * count], vec![0.0; count]);
            // The weights of the responses are those of the point, not those of a trial.
            predictor.keep_free();
            predictor.write_linear_equations(&mut matrix, &mut right);
            // What is left of responses that have faded is rounding; others may be nearly dependent.
            if predictor.layouts.iter().any(|layout| layout.faded) {
                continue;
            }
            let rounding = 1e-8;
            for row in 0..count {
                let difference = right[row] - gradient[row];
                assert!(
                    difference.abs() < rounding * lengths[row] * cost.max(1.0).sqrt(),
                    "{orders:?} {difference}"
                );
                for column in 0..count {
                    let difference = matrix[row * count + column] - whole[row * size + column];
                    let lengths = lengths[row] * lengths[column];
                    assert!(difference.abs() < rounding * lengths, "{orders:?} {difference} of {lengths}");
                }
            }
            // And the equations of all are what they were.
            predictor.linearize();
            assert_eq!((predictor.matrix, predictor.right), (whole, gradient));
        }
    }
}

#[test]
fn taking_out_the_free_responses_leaves_the_normal_equations_of_their_best_weights() {
    let mut noise = Noise(3);
    let orders = Orders::bj(&[2], 1, 1, &[2], &[1]).unwrap();
    let u = [noise.take(140)];
    let y = noise.take(140);
    let record = record(&y, &u);
    let mut predictor = Predictor::new(&record, &orders, InitialCondition::Unknown);
    let parameters = [0.5, -0.2, 0.3, -0.4, -1.2, 0.5];
    predictor.evaluate(&parameters).unwrap();
    predictor.linearize();
    predictor.try_free(&[]);
    let best = predictor.evaluate(&parameters).unwrap();
    // At the best weights nothing is left to gain, and any others cost more.
    assert!(predictor.linearize() < 1e-12 * best);
    for _ in 0..20 {
        predictor.keep_free();
        let section = &mut predictor.sections[1];
        section.trial.iter_mut().for_each(|weight| *weight += 0.1 * noise.uniform());
        assert!(predictor.evaluate(&parameters).unwrap() > best);
    }
}

#[test]
fn weights_of_responses_that_have_faded_are_the_best() {
    let mut noise = Noise(4);
    let orders = Orders::bj(&[2], 1, 1, &[2], &[1]).unwrap();
    let u = [noise.take(140)];
    let y = noise.take(140);
    let record = record(&y, &u);
    let mut predictor = Predictor::counting(&record, &orders, InitialCondition::Unknown, 3, 8);
    // Poles of modulus 0.7, and of 1e-6: of the latter there is nothing to see.
    for f in [[-1.2, 0.5], [0.0, -1e-12]] {
        let parameters = [0.5, -0.2, 0.3, -0.4, f[0], f[1]];
        let best = predictor.evaluate(&parameters).unwrap();
        let weights: Vec<f64> = predictor.sections.iter().flat_map(|section| section.trial.clone()).collect();
        let cost = |errors: Vec<f64>| errors.iter().map(|e| e * e).sum::<f64>();
        let again = cost(errors(&mut predictor, &[&parameters[..], &weights].concat()));
        assert!((again - best).abs() <= 1e-12 * best);
        assert!(predictor.linearize() < 1e-10 * best);
        let seen = f[0] != 0.0;
        assert!(weights.iter().all(|weight| (*weight != 0.0) == seen), "{weights:?}");
        for index in 0..weights.len() {
            let mut moved = [&parameters[..], &weights].concat();
            moved[parameters.len() + index] += 0.1;
            assert!(!seen || cost(errors(&mut predictor, &moved)) > best);
        }
    }
}
