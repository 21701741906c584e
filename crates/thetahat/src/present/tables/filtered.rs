//! What `filter` says at its end.

use crate::filter::{EstimatedNumber, FilterSummary};
use crate::present::Layout;
use crate::respond::NisSummary;

use crate::figures::{error, fixed, number};

use super::text::{Text, columns, or_dash};

/// How consistent the innovations were (NIS), and where the state has come to.
pub fn filtered(summary: &FilterSummary, faults: &str, layout: Layout) -> String {
    let mut text = Text::new(layout);
    let estimator = match summary.estimator.as_str() {
        "kalman" => "Kalman filter",
        "ekf" => "extended Kalman filter",
        _ => "Luenberger observer",
    };
    text.line(&format!("{estimator}: {} rows{faults}, {} values measured", summary.rows, summary.measured));
    if let Some(sum) = summary.log_likelihood {
        text.line(&format!("log-likelihood {}", number(sum)));
    }
    if let Some(nis) = &summary.nis {
        text.line(&surprise(nis));
    }
    text.line("");
    for (title, estimates) in [("state", &summary.states), ("parameter", &summary.parameters)] {
        if !estimates.is_empty() {
            table(&mut text, title, estimates);
        }
    }
    text.finish()
}

fn table(text: &mut Text, title: &str, estimates: &[EstimatedNumber]) {
    let bounded = estimates.iter().any(|estimate| estimate.change_of_variable.is_some());
    let mut titles = vec![title, "value", "standard deviation"];
    titles.extend(bounded.then_some("estimated as"));
    let mut table = columns(&titles).words(&[3]).none("an observer knows no standard deviations");
    for estimate in estimates {
        let mut row =
            vec![estimate.name.clone(), number(estimate.value), or_dash(estimate.standard_deviation, error)];
        row.extend(bounded.then(|| estimate.change_of_variable.clone().unwrap_or_default()));
        table.row(row);
    }
    text.table(table);
}

/// How the normalised innovations squared lie.
pub(super) fn surprise(nis: &NisSummary) -> String {
    format!(
        "normalised innovation squared: mean {}, {} if the model is right; below its 95 % bounds {} %, above {} %, 2.5 % each if \
         it is right",
        fixed(nis.mean, 3),
        fixed(nis.expected, 3),
        fixed(100.0 * nis.below, 1),
        fixed(100.0 * nis.above, 1)
    )
}
