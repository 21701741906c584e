//! The figures of a fit.

use super::schema::Report;
use crate::Error;
use crate::respond::{Horizon, OnLog};
use crate::select::Focus;
use crate::validate::{Fit, Part};

/// Adds the figures of one part of the log: one step ahead, as many as the focus says on held-out rows, and driven by
/// the inputs alone where there are any.
pub(super) fn evaluate(report: &mut Report, on_log: &dyn OnLog, part: Part, focus: Focus) {
    let mut ahead = vec![Horizon::Steps { steps: 1 }];
    if let (Focus::Steps(steps @ 2..), Part::Validation | Part::Test) = (focus, part) {
        ahead.push(Horizon::Steps { steps });
    }
    let (rows, name) = match part {
        Part::Estimation => (report.data.estimation.clone(), "estimation"),
        Part::Validation => (report.data.validation.clone(), "validation"),
        Part::Test => (report.data.split.as_ref().map_or_else(Vec::new, |parts| parts.test.clone()), "test"),
    };
    let figures = |horizon| {
        let start = on_log.natural_start(horizon);
        let responses = on_log.respond(horizon, start)?;
        let fits = responses.iter().zip(on_log.outputs()).enumerate().map(|(index, (response, output))| {
            let measured = on_log.measured(index);
            let mut fit = Fit::new(&output.name, measured, response, &rows, Some(part), (horizon, start));
            fit.outside = on_log.outside(index, &responses, horizon);
            fit
        });
        Ok(fits.collect())
    };
    // Predictions share what is left one step ahead; the free run has nothing to do with it.
    let (ahead, free) = rayon::join(
        || ahead.into_iter().map(|horizon| (horizon, figures(horizon))).collect::<Vec<_>>(),
        || on_log.is_driven().then(|| (Horizon::FreeRun, figures(Horizon::FreeRun))),
    );
    for (horizon, figures) in ahead.into_iter().chain(free) {
        let fits: Vec<Fit> = match figures {
            Ok(fits) => fits,
            Err::<_, Error>(error) => {
                report.warnings.push(format!("no fit figure on the {name} rows, {horizon}: {error}"));
                continue;
            }
        };
        for fit in fits {
            if fit.percent.is_none() {
                let why = if fit.samples == 0 {
                    "its segments without a gap are too short"
                } else {
                    "the output is constant there, or the response overflows"
                };
                report.warnings.push(format!(
                    "no fit figure on the {name} rows{}, {horizon}: {why}",
                    of_output(on_log, &fit.output)
                ));
            }
            report.fit.push(fit);
        }
    }
}

/// Of which output, where there are several.
pub(super) fn of_output(on_log: &dyn OnLog, name: &str) -> String {
    if on_log.outputs().len() > 1 { format!(" of '{name}'") } else { String::new() }
}
