//! `thetahat step` and `thetahat impulse`: what a stored model's output does after a step or an impulse of its inputs.

use thetahat::{Error, PolynomialModel, TransientResponse, impulse_response, step_response};

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
    let model = stored::polynomials(&arguments.report, &model, &format!("{article} {what} response"))?;
    let report = arguments.report.display();
    if model.inputs.is_empty() {
        return Err(Failure::data(format!(
            "{report}: the model has no inputs, so it has no {what} response; bode says what it makes of its noise"
        )));
    }
    let samples = arguments.samples.map(|samples| samples as usize);
    let responses = (0..model.inputs.len()).map(|input| respond(model, input, samples));
    let responses = responses
        .collect::<Result<Vec<_>, _>>()
        .map_err(|error| Failure::data(format!("{report}: {error}")))?;
    output::write_csv(&arguments.out, |csv| {
        csv.write_record(["input", "time", "value", "standard_error"])?;
        for response in &responses {
            let name = output::cell(&response.input);
            for (time, quantity) in response.time.iter().zip(&response.values) {
                csv.serialize((&name, time, quantity.value, quantity.standard_error))?;
            }
        }
        Ok(())
    })
}
