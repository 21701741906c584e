//! `thetahat step` and `thetahat impulse`: what a stored model's output does after a step or an impulse of its inputs.

use thetahat::Error;
use thetahat::model::{PolynomialModel, Quantity};
use thetahat::respond::{TransientResponse, impulse_response, step_response};

use super::stored;
use crate::args::TransientArguments;
use crate::failure::Failure;
use crate::output;

pub(crate) fn step(arguments: &TransientArguments) -> Result<(), Failure> {
    write(arguments, "step", step_response)
}

pub(crate) fn impulse(arguments: &TransientArguments) -> Result<(), Failure> {
    write(arguments, "impulse", impulse_response)
}

/// The responses from all inputs, one after the other.
fn write(
    arguments: &TransientArguments,
    what: &str,
    respond: impl Fn(&PolynomialModel, usize, Option<usize>) -> Result<TransientResponse, Error>,
) -> Result<(), Failure> {
    let model = stored::model(&arguments.report)?;
    let article = if what.starts_with('i') { "an" } else { "a" };
    let models = stored::linear(&arguments.report, &model, &format!("{article} {what} response"))?;
    let report = arguments.report.display();
    if model.inputs().is_empty() {
        return Err(Failure::data(format!(
            "{report}: the model has no inputs, so it has no {what} response; bode says what it makes of its noise"
        )));
    }
    let samples = arguments.samples.map(|samples| samples as usize);
    let mut responses = Vec::new();
    for model in &models {
        for input in 0..model.inputs.len() {
            let response = respond(model, input, samples);
            let response = response.map_err(|error| Failure::data(format!("{report}: {error}")))?;
            responses.push((&model.output.name, response));
        }
    }
    let several = models.len() > 1;
    output::write_csv(&arguments.out, |csv| {
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
