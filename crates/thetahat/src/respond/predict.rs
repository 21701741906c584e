use std::ops::Range;

use super::{Response, Start, add_filtered, check_inputs, from_measured};
use crate::data::Record;
use crate::model::polynomial::{inverse_series, product};
use crate::{Error, Model};

/// The k-step prediction of a model: y(t) from the outputs up to t - k and the inputs up to t.
///
/// For A y = B u + e, with the division 1 = A E + q^-k F, E of k terms:
///
/// ```text
/// y^(t | t-k) = sum_j (E B_j)(q) u_j(t) + F(q) y(t - k)
/// ```
///
/// which equals running the difference equation k steps from measured samples (Ljung, System Identification, 2nd
/// ed. 1999, section 3.2; Åström, Introduction to Stochastic Control Theory, 1970, chapter 6).
/// [`Start::Measured`] leaves out the samples that do not have all of them; [`Start::Zero`] takes zeros before each segment.
///
/// Signals are deviations from the model's offsets. Cost: O(N (na + nb + k)).
///
/// # Errors
/// [`Error::Argument`] if `horizon` is 0, the record does not have the model's inputs, or the start is
/// [`Start::Estimated`], which a prediction of an ARX model does not need.
pub fn predict(model: &Model, record: &Record<'_>, horizon: usize, start: Start) -> Result<Response, Error> {
    if horizon == 0 {
        return Err(Error::argument("horizon", "a prediction looks at least one step ahead"));
    }
    check_inputs(model, record)?;
    if start == Start::Estimated {
        return Err(Error::argument(
            "initial",
            "predictions start from measured samples or from zero; only a free run estimates its start",
        ));
    }
    // Farther than from before the first sample to the last there is nothing to look from.
    let longest = record.segments.iter().zip(&record.past).map(|(segment, past)| past + segment.len()).max();
    let horizon = horizon.min(longest.unwrap_or(0) + 1);
    let reach = model.orders.reach() + horizon - 1;
    let mut response = Response::empty(record.output.len());
    let spans: Vec<(usize, Range<usize>)> = record
        .segments
        .iter()
        .zip(&record.past)
        .map(|(segment, past)| match start {
            Start::Measured => from_measured(segment, *past, reach),
            _ => (segment.start, segment.clone()),
        })
        .filter(|(_, counted)| !counted.is_empty())
        .collect();
    if spans.is_empty() {
        return Ok(response);
    }
    let quotient = inverse_series(&model.a, horizon);
    // A E = 1 - q^-k F: what stands behind the first k terms is -F.
    let past: Vec<f64> = product(&model.a, &quotient)
        .iter()
        .enumerate()
        .map(|(power, value)| if power < horizon { 0.0 } else { -value })
        .collect();
    let inputs: Vec<Vec<f64>> = model.b.iter().map(|b| product(&quotient, b)).collect();
    for (history, counted) in spans {
        let values = &mut response.values[counted.clone()];
        values.fill(0.0);
        add_filtered(values, &counted, &past, record.output, history);
        for (weights, u) in inputs.iter().zip(&record.inputs) {
            add_filtered(values, &counted, weights, u, history);
        }
        response.counted.push(counted);
    }
    Ok(response)
}
