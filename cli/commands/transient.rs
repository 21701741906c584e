//! `thetahat step` of a model and `thetahat impulse`: what a stored model's output does after a step or an impulse of its inputs.

use std::path::Path;

use thetahat::Error;
use thetahat::model::{Model, PolynomialModel, Quantity};
use thetahat::report::{Transient, transient_page};
use thetahat::respond::{TransientResponse, impulse_response, step_response};

use super::stored;
use crate::args::TransientArguments;
use crate::failure::Failure;
use crate::output;

/// What happens at an input.
#[derive(Debug, Clone, Copy)]
pub(super) struct What {
    name: &'static str,
    article: &'static str,
    kind: Transient,
    respond: fn(&PolynomialModel, usize, Option<usize>) -> Result<TransientResponse, Error>,
}

pub(super) const STEP: What =
    What { name: "step", article: "a", kind: Transient::Step, respond: step_response };
pub(super) const IMPULSE: What =
    What { name: "impulse", article: "an", kind: Transient::Impulse, respond: impulse_response };

pub(crate) fn impulse(arguments: &TransientArguments, line: &str) -> Result<(), Failure> {
    let model = stored::model(&arguments.report)?;
    let samples = arguments.samples.map(|samples| samples as usize);
    respond(&IMPULSE, &arguments.report, &model, samples, &arguments.out, arguments.html.as_deref(), line)
}

/// Writes the responses from all inputs, one after the other, and their page.
pub(super) fn respond(
    what: &What,
    report: &Path,
    model: &Model,
    samples: Option<usize>,
    out: &Path,
    page: Option<&Path>,
    line: &str,
) -> Result<(), Failure> {
    let What { name, article, .. } = what;
    let models = stored::linear(report, model, &format!("{article} {name} response"))?;
    let shown = report.display();
    if model.inputs().is_empty() {
        return Err(Failure::data(format!(
            "{shown}: the model has no inputs, so it has no {name} response; bode says what it makes of its noise"
        )));
    }
    let mut responses = Vec::new();
    for model in &models {
        for input in 0..model.inputs.len() {
            let response = (what.respond)(model, input, samples);
            let response = response.map_err(|error| Failure::data(format!("{shown}: {error}")))?;
            responses.push((&model.output.name, response));
        }
    }
    if let Some(path) = page {
        let named: Vec<&PolynomialModel> = models.iter().map(|model| &**model).collect();
        output::page(path, &transient_page(&named, what.kind, samples, &shown.to_string(), line))?;
    }
    let several = models.len() > 1;
    output::write_csv(out, |csv| {
        let output = several.then_some("output").into_iter();
        csv.write_record(output.chain(["input", "time", "value", "standard_error"]))?;
        for (output, response) in &responses {
            let (output, name) = (several.then(|| output::cell(output)), output::cell(&response.input));
            for (time, Quantity { value, standard_error, .. }) in response.time.iter().zip(&response.values) {
                match &output {
                    Some(output) => csv.serialize((output, &name, time, value, standard_error))?,
                    None => csv.serialize((&name, time, value, standard_error))?,
                }
            }
        }
        Ok(())
    })
}
