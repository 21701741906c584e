//! Products of regressors from their sums alone: the rows are gone.

use super::candidates::Candidates;
use super::{Solved, TermStep, TermsOutcome, is_dependent, too_few};
use crate::Error;
use crate::model::{Map, NonlinearArxModel, OutputMap, Parameter};
use crate::regression::{Column, DividedMonomials, ExtendedGram, Unsolved, forward};

/// The least-squares solution of the products of `head`, a model of one output but its parameters, from sums of deviations in the signals'
/// own units; and the part that each product has in it.
///
/// The model's regressors and its output are divided by their scales: a parameter is one of the signals as they are, times the scales of
/// its factors, over that of the output.
///
/// # Errors
/// [`Error::Undetermined`] if there are not more samples than products, or these depend on one another; [`Error::Data`] if sums leave
/// the range of numbers.
pub(crate) fn of_sums(
    head: &NonlinearArxModel,
    monomials: &DividedMonomials,
    sums: &ExtendedGram,
) -> Result<(Solved, TermsOutcome), Error> {
    let no_products = || Error::argument("map", "it has no products; name some");
    let Some(OutputMap { functions: map @ Map::Polynomial { terms }, scale, .. }) = head.maps.first() else {
        return Err(no_products());
    };
    let regressors: Vec<String> = head.regressors.iter().map(|one| one.name()).collect();
    let (names, count, samples) = (map.names(&regressors), terms.len(), sums.rows());
    if samples <= count {
        return Err(too_few(count, samples));
    }
    let column = |term: &Vec<usize>| monomials.place(term).map(|place| (place, 1.0));
    let columns: Vec<Column> = terms.iter().map(column).collect::<Option<_>>().ok_or_else(no_products)?;
    let target = DividedMonomials::TARGET;
    let out_of_range = || {
        Error::data(
            "sums of products of the regressors leave the range of numbers; take products of fewer factors, or scale the channels towards \
             one",
        )
    };
    if !sums.is_in_range() {
        return Err(out_of_range());
    }
    let solved = sums.solve(&columns, target).map_err(|why| match why {
        Unsolved::Deficient(columns) => {
            is_dependent(columns.first().map_or("a product", |column| &names[*column]))
        }
        Unsolved::Range => out_of_range(),
    })?;
    let squares = solved.residual_norm * solved.residual_norm;
    let variance = squares / (samples - count) as f64;

    // In the order in which they are given.
    let (gram, cross, energy) = sums.plain(&columns, target);
    let given: Vec<usize> = (0..count).collect();
    let path = forward(|one, other| gram[(one, other)], cross.as_slice(), energy, &given, &given, count);
    let candidates = Candidates::Functions { map: map.clone(), always: count };
    let step = |(at, chosen)| {
        let left = path.left(at + 1) * energy / samples as f64;
        TermStep::of(&candidates, &regressors, chosen, at + 1, left)
    };
    let path: Vec<TermStep> = path.chosen.iter().enumerate().map(step).collect();
    let outcome = TermsOutcome {
        candidates: count,
        selected_by: "given".to_owned(),
        ridge: None,
        taken: path.len(),
        path,
        training: None,
    };

    let units: Vec<f64> = terms
        .iter()
        .map(|term| term.iter().map(|factor| head.regressors[*factor].scale).product::<f64>() / scale)
        .collect();
    let entry = |i: usize, j: usize| solved.covariance[(i, j)] * units[i] * units[j];
    let each = names.into_iter().enumerate().map(|(place, name)| Parameter {
        name,
        value: solved.parameters[place] * units[place],
        standard_error: (variance > 0.0).then(|| entry(place, place).sqrt()),
    });
    let row = |i: usize| (0..count).map(|j| entry(i, j)).collect();
    let model = NonlinearArxModel {
        noise_covariance: vec![vec![variance]],
        degrees_of_freedom: Some(samples - count),
        parameters: each.collect(),
        covariance: (variance > 0.0).then(|| (0..count).map(row).collect()),
        ..head.clone()
    };
    let condition = Some(solved.condition).filter(|condition| condition.is_finite());
    Ok((Solved { model, mse: squares / samples as f64, condition }, outcome))
}
