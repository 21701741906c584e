//! Errors, gradients and Gram matrices against their definitions.

use super::*;
use crate::model::polynomial::product;
use crate::regression::noise::Noise;

/// A stable monic polynomial.
fn stable(order: usize, noise: &mut Noise) -> Vec<f64> {
    let mut monic = vec![1.0];
    while monic.len() + 1 < order + 1 {
        let (radius, angle) = (0.95 * noise.next().abs(), 3.0 * noise.next());
        monic = product(&monic, &[1.0, -2.0 * radius * angle.cos(), radius * radius]);
    }
    while monic.len() < order + 1 {
        monic = product(&monic, &[1.0, 0.9 * noise.next()]);
    }
    monic
}

/// Random orders with one to two inputs or none, and parameters.
fn random(noise: &mut Noise) -> (Orders, Vec<f64>) {
    let mut below = |count: usize| ((noise.next() + 1.0) / 2.0 * count as f64) as usize;
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

/// Beginnings of segments, and in how many first samples e = 0, and how many do not count, whatever the model.
const BEGINNINGS: [(Begin, usize, usize); 5] = [
    (Begin::Zero, 0, 0),
    (Begin::Zero, 0, 9),
    (Begin::Unknown, 0, 0),
    (Begin::Unknown, 0, 9),
    (Begin::Unknown, 7, 9),
];

/// All errors that count, segment by segment, of parameters followed by the free responses' weights of each segment.
fn errors(predictor: &mut Predictor<'_>, unknowns: &[f64]) -> Vec<f64> {
    let (parameters, mut weights) = unknowns.split_at(predictor.layout.parameters);
    for section in &mut predictor.sections {
        let (own, rest) = weights.split_at(section.trial.len());
        section.trial.copy_from_slice(own);
        weights = rest;
    }
    predictor.set(parameters).unwrap();
    let Predictor { layout, polynomials, negative, sections, .. } = &mut *predictor;
    sections.iter_mut().for_each(|section| section.evaluate(layout, polynomials, negative));
    predictor.residuals().0
}

#[test]
fn errors_are_those_of_the_difference_equations() {
    let mut noise = Noise(1);
    for _ in 0..100 {
        let (orders, parameters) = random(&mut noise);
        let u: Vec<Vec<f64>> = (0..orders.inputs()).map(|_| noise.take(140)).collect();
        let y = noise.take(140);
        let record = record(&y, &u);
        for (begin, silent, counted) in BEGINNINGS {
            let mut predictor = Predictor::counting(&record, &orders, begin, silent, counted);
            let unknowns = predictor.layout.parameters + predictor.initial_conditions();
            let weights = noise.take(unknowns - parameters.len());
            let found = errors(&mut predictor, &[parameters.clone(), weights.clone()].concat());
            let Polynomials { a, b, c, d, f } = Polynomials::new(&orders, &parameters);
            let Layout { masked, counted, free, .. } = predictor.layout;
            let (mut expected, mut weights) = (Vec::new(), weights.as_slice());
            for segment in record.segments.iter().filter(|s| s.len() > counted.max(free)) {
                // Before the segment everything is zero.
                let at = |x: &[f64], t: usize, lag: usize| if t < lag { 0.0 } else { x[t - lag] };
                let past =
                    |p: &[f64], x: &[f64], t: usize| (1..p.len()).map(|i| p[i] * at(x, t, i)).sum::<f64>();
                let mut w: Vec<f64> = Vec::new();
                let (mut x, mut e) = (vec![Vec::new(); u.len()], Vec::new());
                let mut free = Vec::new();
                for j in 0..u.len() {
                    let count = if begin == Begin::Zero { 0 } else { orders.free_responses(j) };
                    let (own, rest) = weights.split_at(count);
                    free.push(own);
                    weights = rest;
                }
                for t in 0..segment.len() {
                    let y = &y[segment.clone()];
                    let mut value = y[t] + past(&a, y, t);
                    for j in 0..u.len() {
                        let u = &u[j][segment.clone()];
                        let driven: f64 =
                            b[j].iter().enumerate().map(|(i, b)| b * at(u, t, orders.nk[j] + i)).sum();
                        let now = driven + free[j].get(t).unwrap_or(&0.0) - past(&f[j], &x[j], t);
                        x[j].push(now);
                        value -= now;
                    }
                    w.push(value);
                    let error = value + past(&d, &w, t) - past(&c, &e, t);
                    e.push(if t < masked { 0.0 } else { error });
                }
                expected.extend_from_slice(&e[counted..]);
            }
            assert_eq!(found.len(), expected.len());
            let size = expected.iter().fold(0.0_f64, |size, e| size.max(e.abs()));
            assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-11 * size), "{orders:?}");
        }
    }
}

#[test]
fn gradients_and_gram_matrices_are_those_of_central_differences() {
    let mut noise = Noise(2);
    for _ in 0..200 {
        let (orders, parameters) = random(&mut noise);
        let u: Vec<Vec<f64>> = (0..orders.inputs()).map(|_| noise.take(140)).collect();
        let y = noise.take(140);
        let record = record(&y, &u);
        for (begin, silent, counted) in BEGINNINGS {
            let mut predictor = Predictor::counting(&record, &orders, begin, silent, counted);
            let free = predictor.initial_conditions();
            let unknowns = [parameters.clone(), noise.take(free)].concat();
            let step = 1e-5;
            let psi: Vec<Vec<f64>> = (0..unknowns.len())
                .map(|index| {
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
            // What the parameters and the weights of one segment have, in the list of all unknowns.
            let own = predictor.layout.free;
            let place = |section: usize, index: usize| {
                if index < count { index } else { index + section * own }
            };
            let all = count + own;
            let counted = predictor.layout.counted;
            let lengths = predictor.sections.iter().map(|section| section.output.len() - counted);
            let lengths: Vec<usize> = lengths.collect();
            let mut from = 0;
            for (number, section) in predictor.sections.iter().enumerate() {
                let rows = from..from + lengths[number];
                from = rows.end;
                for i in 0..all {
                    let left = &psi[place(number, i)][rows.clone()];
                    let length = norm(&e[rows.clone()]);
                    // Differences have rounding of some 1e-10.
                    let size = norm(left).max(1e-3) * length;
                    let right = dot(left, &e[rows.clone()]);
                    assert!((section.right[i] - right).abs() <= 1e-6 * size, "{orders:?} {begin:?} {i}");
                    for j in 0..all {
                        let other = &psi[place(number, j)][rows.clone()];
                        let difference = section.gram[i * all + j] - dot(left, other);
                        let rounding = 1e-3 * norm(left).max(norm(other)).max(1.0);
                        let size = (norm(left) * norm(other)).max(rounding);
                        assert!(difference.abs() <= 1e-6 * size, "{orders:?} {begin:?} {counted} {i} {j}");
                    }
                }
            }
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
    let mut predictor = Predictor::new(&record, &orders, Begin::Unknown);
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
        section.trial.iter_mut().for_each(|weight| *weight += 0.1 * noise.next());
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
    let mut predictor = Predictor::counting(&record, &orders, Begin::Unknown, 3, 8);
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
