//! What `filter` says at its end.

use crate::filter::{EstimatedNumber, FilterSummary, NoiseEstimate};
use crate::present::Layout;
use crate::respond::NisSummary;

use crate::figures::{fixed, number};

use super::tree::{Medium, Sections, columns, error, figure, word};

/// How consistent the innovations were (NIS), and where the state has come to.
pub fn filtered(summary: &FilterSummary, faults: &str, layout: Layout) -> String {
    let on = &mut Sections::new(Medium::Text);
    let estimator = match summary.estimator.as_str() {
        "kalman" => "Kalman filter",
        "ekf" => "extended Kalman filter",
        "iekf" => "iterated extended Kalman filter",
        "ukf" => "unscented Kalman filter",
        "bounded" => "set for bounded noise",
        _ => "Luenberger observer",
    };
    on.line(format!("{estimator}: {} rows{faults}, {} values measured", summary.rows, summary.measured));
    if let Some(sum) = summary.log_likelihood {
        on.line(format!("log-likelihood {}", number(sum)));
    }
    match summary.contradictions {
        None => {}
        Some(0) => on.line("every row is explained by a state within the bounds".to_owned()),
        Some(1) => on.line("1 row that no state within the bounds explains".to_owned()),
        Some(count) => on.line(format!("{count} rows that no state within the bounds explains")),
    }
    if let Some(nis) = &summary.nis {
        on.line(consistency(nis));
    }
    on.gap();
    for (title, estimates) in [("state", &summary.states), ("parameter", &summary.parameters)] {
        if !estimates.is_empty() {
            table(on, title, estimates);
        }
    }
    super::text::written(on, layout)
}

/// The noises of the largest likelihood.
pub fn noises(found: &NoiseEstimate, layout: Layout) -> String {
    let on = &mut Sections::new(Medium::Text);
    let iterations = found.search.iterations;
    on.line(format!(
        "noises of the largest likelihood: {} values measured, {iterations} iterations",
        found.measured
    ));
    let start = found.search.log_likelihoods.first().copied().unwrap_or(f64::NAN);
    on.line(format!(
        "log-likelihood {}, of the noises of the model {}",
        number(found.log_likelihood),
        number(start)
    ));
    on.gap();
    let mut table = columns("Noises", ["variance", "value", "standard error"]);
    for (name, value, standard_error) in found.variances() {
        let standard_error = (standard_error > 0.0).then_some(standard_error);
        table.row([word(name), figure(value, number), error(standard_error)]);
    }
    on.table(table.none("it is known"));
    super::text::written(on, layout)
}

fn table(on: &mut Sections, title: &str, estimates: &[EstimatedNumber]) {
    let bounded = estimates.iter().any(|estimate| estimate.change_of_variable.is_some());
    let is_set = estimates.iter().any(|estimate| estimate.bound.is_some());
    let certainty = if is_set { "at most" } else { "standard deviation" };
    let mut table = columns("Estimates", [title, "value", certainty, "estimated as"])
        .words(&[3])
        .none("an observer knows no standard deviations")
        .without(if bounded { &[] } else { &[3] });
    for estimate in estimates {
        table.row([
            word(&estimate.name),
            figure(estimate.value, number),
            error(estimate.standard_deviation.or(estimate.bound)),
            word(estimate.change_of_variable.clone().unwrap_or_default()),
        ]);
    }
    on.table(table);
}

/// How the normalised innovations squared lie.
pub(super) fn consistency(nis: &NisSummary) -> String {
    format!(
        "normalised innovation squared: mean {}, {} if the model is right; below its 95 % bounds {} %, above {} %, 2.5 % each if \
         it is right",
        fixed(nis.mean, 3),
        fixed(nis.expected, 3),
        fixed(100.0 * nis.below, 1),
        fixed(100.0 * nis.above, 1)
    )
}
