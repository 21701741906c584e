//! `thetahat step` of a model and `thetahat impulse`: what a stored model's output does after a step or an impulse of
//! its inputs.

use std::path::Path;

use thetahat::model::{LinearModel, Model, Quantity};
use thetahat::present::{Transient, transient_page};

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
}

pub(super) const STEP: What = What { name: "step", article: "a", kind: Transient::Step };
pub(super) const IMPULSE: What = What { name: "impulse", article: "an", kind: Transient::Impulse };

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
        for input in 0..model.inputs().len() {
            let response = match what.kind {
                Transient::Step => model.step_response(input, samples),
                Transient::Impulse => model.impulse_response(input, samples),
            };
            let response = response.map_err(|error| Failure::data(format!("{shown}: {error}")))?;
            responses.push((&model.output().name, response));
        }
    }
    if let Some(path) = page {
        let named: Vec<&LinearModel<'_>> = models.iter().collect();
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
