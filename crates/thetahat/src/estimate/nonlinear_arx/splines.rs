//! Where the knots of splines stand.

use crate::model::Map;

/// `units` bends of each regressor, with knots that divide its range evenly and stand at both of its ends; a regressor
/// that does not change has none.
pub(crate) fn map(ranges: &[[f64; 2]], units: usize) -> Map {
    let (mut regressors, mut knots) = (Vec::new(), Vec::new());
    for (regressor, [low, high]) in ranges.iter().enumerate() {
        let knot = |place: usize| low + (high - low) * place as f64 / (units + 1) as f64;
        for place in 1..=units {
            let own = [knot(place - 1), knot(place), knot(place + 1)];
            if own[0] < own[1] && own[1] < own[2] {
                regressors.push(regressor);
                knots.push(own);
            }
        }
    }
    Map::Spline { regressors, knots }
}

#[cfg(test)]
mod tests;
