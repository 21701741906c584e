//! What `fit --grey` found, as a table for people.

use thetahat::figures::{chance, error, fixed, number, short};
use thetahat::{GreyFit, GreyReport, Stopped};

use super::filtered::surprise;
use super::stopped;
use super::text::{Text, columns, or_dash};

/// The main figures of a fit of a model in equations.
pub(crate) fn grey(report: &GreyReport, width: usize) -> String {
    let mut text = Text::new(width);
    let mut parameters =
        columns(&["parameter", "value", "standard error", "start", "estimated as"]).words(&[4]);
    for parameter in &report.parameters {
        parameters.row([
            parameter.name.clone(),
            number(parameter.value),
            error(parameter.standard_error),
            short(parameter.start),
            parameter.change_of_variable.clone().unwrap_or_default(),
        ]);
    }
    text.table(parameters);
    let search = &report.search;
    let why: Stopped = search.stopped;
    text.line(&format!(
        "{} rows, {} readings, log-likelihood {}",
        report.rows,
        report.readings,
        number(report.log_likelihood)
    ));
    text.line(&format!("prediction error, {} iterations, {}", search.iterations, stopped(why)));
    if let Some(nis) = &report.nis {
        text.line(&surprise(nis));
    }
    text.line("");
    let percent = |fit: Option<GreyFit>| {
        or_dash(fit.and_then(|fit| fit.percent), |percent| format!("{} %", fixed(percent, 2)))
    };
    let rmse = |fit: Option<GreyFit>| or_dash(fit.map(|fit| fit.rmse), number);
    let mut outputs = columns(&["output", "1 step", "rmse", "free run", "rmse", "missing", "white (p)"])
        .none("nothing was measured, it is constant, or the free run overflows");
    for output in &report.outputs {
        outputs.row([
            output.channel.clone(),
            percent(output.one_step),
            rmse(output.one_step),
            percent(output.free_run),
            rmse(output.free_run),
            output.missing.to_string(),
            or_dash(output.whiteness.as_ref().and_then(|test| test.p_value), chance),
        ]);
    }
    text.table(outputs);
    text.finish()
}
