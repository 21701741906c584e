//! Whether the residuals of several outputs are white together.

use std::ops::Range;

use thetahat_core::nalgebra::{Cholesky, DMatrix};

use super::verdict::Test;
use super::whiteness::pairs;
use crate::distribution::chi_square_tail;
use crate::regression::sum;
use crate::respond::Innovations;

/// The portmanteau test of the residuals e of l outputs: with C_h = 1/N sum e(t) e(t-h)', e less their means,
///
/// ```text
/// Q = N^2 sum_{0 < h <= L} tr(C_h' C_0^-1 C_h C_0^-1)/N_h
/// ```
///
/// is chi-square with l^2 L degrees of freedom where they are white, N_h being how many pairs are h samples apart (Hosking, J. American
/// Statistical Association 75, 1980), less `fitted` for as many parameters of the noise that were fitted to these samples. It sees what
/// tests of single outputs do not: that one output's error is known from another's past.
///
/// `outputs` has the innovations of each output, in the same segments; samples count in which all outputs were measured. None for fewer than
/// two, segments of their own, or outputs of which nothing is left. O(N l^2 L).
pub(crate) fn portmanteau(outputs: &[&[Innovations]], lags: usize, fitted: usize) -> Option<Test> {
    let (first, others) = outputs.split_first().filter(|(_, others)| !others.is_empty())?;
    let same = |other: &&[Innovations]| {
        other.len() == first.len()
            && other
                .iter()
                .zip(*first)
                .all(|(other, own)| other.rows == own.rows || other.counted == own.counted)
    };
    if !others.iter().all(same) {
        return None;
    }
    // The runs of each segment in which all outputs count.
    let segments = first.iter().enumerate().map(|(place, own)| {
        others.iter().fold(own.counted.clone(), |runs, other| shared(&runs, &other[place].counted))
    });
    let segments: Vec<Vec<Range<usize>>> = segments.collect();
    let samples: usize = segments.iter().flatten().map(Range::len).sum();
    // Of each output the errors that count, less their mean; zero between the runs.
    let centred = outputs.iter().map(|output| {
        let counted = segments.iter().zip(*output).flat_map(|(runs, own)| {
            let at = own.rows.start;
            runs.iter().flat_map(move |rows| &own.errors[rows.start - at..rows.end - at])
        });
        let mean = sum(counted.copied()) / samples as f64;
        let each = segments.iter().zip(*output).filter_map(|(runs, own)| {
            let (at, from) = (own.rows.start, runs.first()?.start);
            let mut errors = vec![0.0; runs.last()?.end - from];
            for row in runs.iter().cloned().flatten() {
                errors[row - from] = own.errors[row - at] - mean;
            }
            Some(errors)
        });
        each.collect::<Vec<_>>()
    });
    let centred: Vec<Vec<Vec<f64>>> = centred.collect();
    let runs: Vec<&[Range<usize>]> = segments.iter().map(Vec::as_slice).collect();
    let size = outputs.len();
    let products = |lag: usize| {
        let entry = |i: usize, j: usize| {
            let runs = centred[i].iter().zip(&centred[j]).filter(|(run, _)| run.len() > lag);
            let each = runs.map(|(now, before)| {
                now[lag..].iter().zip(before).map(|(now, before)| now * before).sum::<f64>()
            });
            each.sum::<f64>() / samples as f64
        };
        DMatrix::from_fn(size, size, entry)
    };
    let degrees = (size * size * lags) as f64 - fitted as f64;
    let whole = Cholesky::new(products(0)).filter(|_| degrees > 0.0)?;
    let mut statistic = 0.0;
    for lag in 1..=lags {
        let pairs = pairs(&runs, lag);
        if pairs == 0 {
            return None;
        }
        let lagged = products(lag);
        let trace = (whole.solve(&lagged.transpose()) * whole.solve(&lagged)).trace();
        statistic += (samples * samples) as f64 * trace / pairs as f64;
    }
    let p_value = chi_square_tail(statistic, degrees);
    statistic.is_finite().then_some(Test { lags, statistic, degrees, p_value })
}

/// The runs of samples that two lists share, both rising.
fn shared(one: &[Range<usize>], other: &[Range<usize>]) -> Vec<Range<usize>> {
    let (mut found, mut first) = (Vec::new(), 0);
    for run in one {
        while other.get(first).is_some_and(|next| next.end <= run.start) {
            first += 1;
        }
        let near = other[first..].iter().take_while(|next| next.start < run.end);
        found.extend(near.map(|next| run.start.max(next.start)..run.end.min(next.end)));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regression::noise::Noise;

    fn innovations(errors: Vec<f64>) -> Vec<Innovations> {
        let rows = 0..errors.len();
        vec![Innovations::alone(rows.clone(), std::iter::once(rows).collect(), errors)]
    }

    #[test]
    fn white_errors_pass_as_often_as_they_should() {
        let mut noise = Noise(3);
        let mut rejected = 0;
        for _ in 0..400 {
            let all: Vec<(f64, f64)> = (0..300).map(|_| (noise.next(), noise.next())).collect();
            // Correlated in the same sample, and nowhere else.
            let first = innovations(all.iter().map(|(a, _)| 5.0 + a).collect());
            let second = innovations(all.iter().map(|(a, b)| a + 0.5 * b).collect());
            let found = portmanteau(&[&first, &second], 10, 0).unwrap();
            assert_eq!((found.lags, found.degrees), (10, 40.0));
            rejected += usize::from(found.p_value.unwrap() < 0.05);
        }
        assert!((8..=34).contains(&rejected), "{rejected} of 400 at 5 %");
    }

    #[test]
    fn it_sees_what_one_output_knows_of_another() {
        let mut noise = Noise(4);
        let all: Vec<f64> = (0..1001).map(|_| noise.next()).collect();
        let second: Vec<f64> = (1..1001).map(|t| 0.3 * all[t - 1] + noise.next()).collect();
        let (first, second) = (innovations(all[1..].to_vec()), innovations(second));
        assert!(portmanteau(&[&first, &second], 10, 0).unwrap().p_value.unwrap() < 1e-6);
        // In numbers: of one lag with C_0 = I it is N^2/(N - 1) times the sum of the squares of C_1.
        let plain: [Vec<f64>; 2] = [vec![1.0, 1.0, -1.0, -1.0], vec![1.0, -1.0, -1.0, 1.0]];
        let [first, second] = plain.map(innovations);
        let found = portmanteau(&[&first, &second], 1, 1).unwrap();
        // C_1 = [[1, 3], [-3, -1]]/4 with e(t) e(t-1)'.
        assert!(
            (found.statistic - 16.0 / 3.0 * 20.0 / 16.0).abs() < 1e-12 && found.degrees == 3.0,
            "{found:?}"
        );
    }

    #[test]
    fn rows_count_in_which_all_outputs_do() {
        let mut noise = Noise(6);
        let mut rejected = 0;
        for _ in 0..400 {
            // One row in five misses the second output: runs are short, pairs are not few.
            let mut counted: Vec<Range<usize>> = Vec::new();
            let mut all: [Vec<f64>; 2] = Default::default();
            for row in 0..400 {
                let there = noise.next() > -0.6;
                let first = noise.next();
                all[0].push(first);
                all[1].push(if there { first + noise.next() } else { 0.0 });
                match counted.last_mut().filter(|last| there && last.end == row) {
                    Some(last) => last.end = row + 1,
                    None if there => counted.push(row..row + 1),
                    None => {}
                }
            }
            let [first, second] = all;
            let second = vec![Innovations::alone(0..400, counted, second)];
            let found = portmanteau(&[&innovations(first), &second], 10, 0);
            rejected += usize::from(found.and_then(|test| test.p_value).is_none_or(|p| p < 0.05));
        }
        assert!((8..=34).contains(&rejected), "{rejected} of 400 at 5 %");
        assert_eq!(shared(&[0..5, 7..9], &[1..2, 3..8, 8..12]), [1..2, 3..5, 7..8, 8..9]);
    }

    #[test]
    fn what_cannot_be_tested_is_none() {
        let (one, short) = (innovations(vec![1.0, -1.0, 2.0]), innovations(vec![1.0, -1.0]));
        assert_eq!(portmanteau(&[&one], 1, 0), None);
        assert_eq!(portmanteau(&[&one, &short], 1, 0), None);
        assert_eq!(portmanteau(&[&one, &one], 1, 0), None);
        assert_eq!(portmanteau(&[&one, &innovations(vec![0.5, 1.0, 0.0])], 3, 0), None);
        assert_eq!(portmanteau(&[&one, &innovations(vec![0.5, 1.0, 0.0])], 1, 4), None);
    }
}
