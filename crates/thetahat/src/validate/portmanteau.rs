//! Whether the residuals of several outputs are white together.

use std::ops::Range;

use thetahat_core::nalgebra::{Cholesky, DMatrix};
use thetahat_numerics::distribution::chi_square_tail;
use thetahat_numerics::regression::sum;

use super::verdict::Test;
use super::whiteness::pairs;
use crate::respond::Innovations;

/// The portmanteau test of the residuals e of l outputs: with C_h = 1/N sum e(t) e(t-h)', e less their means,
///
/// ```text
/// Q = N^2 sum_{0 < h <= L} tr(C_h' C_0^-1 C_h C_0^-1)/N_h
/// ```
///
/// is chi-square with l^2 L degrees of freedom where they are white, N_h being how many pairs are h samples apart
/// (Hosking, J. American Statistical Association 75, 1980), less `fitted` for as many parameters of the noise that were
/// fitted to these samples. It sees what tests of single outputs do not: that one output's error is known from
/// another's past.
///
/// `outputs` has the innovations of each output, in the same segments; samples count in which all outputs were
/// measured. None for fewer than two, segments of their own, or outputs of which nothing is left. O(N l^2 L).
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
mod tests;
