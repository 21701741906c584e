//! Products of regressors from their sums alone: the rows are gone.

use thetahat_numerics::regression::{Column, DividedMonomials, ExtendedGram, Unsolved, forward};

use super::candidates::Candidates;
use super::{Count, Solved, TermStep, TermsOutcome, check, is_dependent, too_few};
use crate::Error;
use crate::model::{Map, NonlinearArxModel, OutputMap, Parameter};

/// The least-squares solution of products of the regressors of `head`, a model of one output but its functions, from
/// sums of deviations in the signals' own units; and how the products were chosen among `candidates`: of `most` steps
/// as many as `count` says.
///
/// The model's regressors and its output are divided by their scales: a parameter is one of the signals as they are,
/// times the scales of its factors, over that of the output.
///
/// # Errors
/// [`Error::Undetermined`] if there are not more samples than products, these depend on one another, or fewer than
/// asked for can be told apart; [`Error::Data`] if sums leave the range of numbers.
pub(crate) fn of_sums(
    head: &NonlinearArxModel,
    (candidates, most, count): (&Candidates, usize, &Count),
    monomials: &DividedMonomials,
    sums: &ExtendedGram,
) -> Result<(Solved, TermsOutcome), Error> {
    let no_products = || Error::argument("map", "it has no products; name some");
    let (regressors, scale) = (&head.regressors, head.maps.first().map_or(1.0, |map| map.scale));
    let names: Vec<String> = regressors.iter().map(|one| one.name()).collect();
    let columns = |map: &Map| -> Option<Vec<Column>> {
        let Map::Polynomial { terms } = map else { return None };
        terms.iter().map(|term| monomials.place(term).map(|place| (place, 1.0))).collect()
    };
    let (target, samples, always) = (DividedMonomials::TARGET, sums.rows(), candidates.always());
    if samples <= always.max(1) {
        return Err(too_few(always.max(1), samples));
    }
    let out_of_range = || {
        Error::data(
            "sums of products of the regressors leave the range of numbers; take products of fewer factors, or scale the channels towards \
             one",
        )
    };
    if !sums.is_in_range() {
        return Err(out_of_range());
    }
    let every: Vec<usize> = (0..candidates.count(regressors.len())).collect();
    let all = columns(&candidates.map(&every, regressors.len())).ok_or_else(no_products)?;
    let (gram, cross, energy) = sums.plain(&all, target);
    let lags: Vec<usize> = regressors.iter().map(|one| one.lag).collect();
    let (first, preferred) = (&every[..always], candidates.preferred(&lags));
    let most = most.max(always).min(samples - 1);
    let gram = |one: usize, other: usize| gram[(one, other)];
    let path = forward(gram, cross.as_slice(), energy, first, &preferred, most);
    check(candidates, &names, samples, &path, count)?;
    let step = |(at, chosen)| {
        let left = path.left(at + 1) * energy / samples as f64;
        TermStep::of(candidates, &names, chosen, at + 1, left)
    };
    let steps: Vec<TermStep> = path.chosen.iter().enumerate().map(step).collect();
    let taken = count.best(&steps, always.clamp(1, steps.len()), samples);
    let places = candidates.ordered(path.places(taken));
    let map = candidates.map(&places, regressors.len());
    let outcome = TermsOutcome {
        candidates: every.len(),
        selected_by: match count {
            Count::Least(criterion) => criterion.word().to_owned(),
            Count::Given(_) | Count::HeldOut(_) | Count::Blocks => "given".to_owned(),
        },
        ridge: None,
        taken,
        path: steps,
        training: None,
    };

    let (terms, names) = (columns(&map).ok_or_else(no_products)?, map.names(&names));
    let solved = sums.solve(&terms, target).map_err(|why| match why {
        Unsolved::Deficient(terms) => is_dependent(terms.first().map_or("a product", |term| &names[*term])),
        Unsolved::Range => out_of_range(),
    })?;
    let (count, squares) = (terms.len(), solved.residual_norm * solved.residual_norm);
    let variance = squares / (samples - count) as f64;
    let Map::Polynomial { terms } = &map else { return Err(no_products()) };
    let units: Vec<f64> = terms
        .iter()
        .map(|term| term.iter().map(|factor| regressors[*factor].scale).product::<f64>() / scale)
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
        maps: head.maps.iter().map(|own| OutputMap { functions: map.clone(), ..own.clone() }).collect(),
        ..head.clone()
    };
    let condition = Some(solved.condition).filter(|condition| condition.is_finite());
    Ok((Solved { model, mse: squares / samples as f64, condition }, outcome))
}
