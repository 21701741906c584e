use thetahat::{Criterion, Method, Norm};

use super::orders::OrderJob;
use super::{parsed, positive, search};
use crate::args::{CriterionArguments, FitArguments, MethodArgument, NormArgument};
use crate::failure::Failure;

/// How to estimate a model of these orders.
pub(super) fn method(arguments: &FitArguments, orders: &OrderJob) -> Result<Method, Failure> {
    let FitArguments { search: of_search, criterion: of_criterion, .. } = arguments;
    let method = arguments.model.method;
    let refused = |option: &str, why: &str| Err(Failure::usage(format!("{option} {why}, so leave it out")));
    let alone = (method != MethodArgument::Pem).then_some("--method").or(given(of_criterion));
    if let Some(option) = alone.filter(|_| orders.is_choice()) {
        return Err(Failure::usage(format!(
            "{option} is for one model, and there is a choice among several; give each order one value"
        )));
    }
    match (search::given(of_search), given(of_criterion)) {
        (Some(option), _) if method != MethodArgument::Pem => refused(option, "is for --method pem"),
        (_, Some(option)) if method != MethodArgument::Pem => refused(option, "is for --method pem"),
        (Some(option), _) if orders.is_linear() => {
            refused(option, "is for models with C, D or F; this one is solved in one step")
        }
        (_, Some(option)) if !orders.is_linear() => {
            refused(option, "is for models without C, D and F; this one is not linear in its parameters")
        }
        _ => Ok(()),
    }?;
    let wrong = |message: &str| Err(Failure::usage(message));
    match method {
        MethodArgument::Iv if !orders.is_linear() || !orders.has_inputs() => {
            wrong("--method iv gives A and B of a model with inputs; give --na and --nb, or leave it out")
        }
        MethodArgument::Iv => Ok(Method::InstrumentalVariables),
        MethodArgument::Sriv if !orders.is_output_error() => {
            wrong("--method sriv gives B and F; give --model oe, or leave it out")
        }
        MethodArgument::Sriv => Ok(Method::RefinedInstrumentalVariables),
        MethodArgument::Pem => {
            let criterion = criterion(of_criterion)?;
            if criterion.is_plain() {
                return Ok(Method::PredictionError(search::search(of_search)?));
            }
            Ok(Method::Constrained(criterion))
        }
    }
}

/// An option of the criterion that was given and is not what all models have.
fn given(arguments: &CriterionArguments) -> Option<&'static str> {
    let options = [
        ("--norm", arguments.norm.is_some_and(|norm| norm != NormArgument::Two)),
        ("--bound", !arguments.bound.is_empty()),
        ("--dc-gain", !arguments.dc_gain.is_empty()),
        ("--ridge", arguments.ridge.is_some()),
        ("--noise-bound", arguments.noise_bound.is_some()),
    ];
    options.into_iter().find_map(|(option, given)| given.then_some(option))
}

fn criterion(arguments: &CriterionArguments) -> Result<Criterion, Failure> {
    let positive =
        |argument, value: Option<f64>| value.map(|value| positive(argument, value, "number")).transpose();
    let bounds = arguments.bound.iter().map(|text| parsed("--bound", text));
    let gains = arguments.dc_gain.iter().map(|text| parsed("--dc-gain", text));
    Ok(Criterion {
        norm: match arguments.norm {
            None | Some(NormArgument::Two) => Norm::Two,
            Some(NormArgument::One) => Norm::One,
            Some(NormArgument::Infinity) => Norm::Infinity,
        },
        ridge: positive("--ridge", arguments.ridge)?.unwrap_or(0.0),
        bounds: bounds.collect::<Result<_, _>>()?,
        dc_gain: gains.collect::<Result<_, _>>()?,
        noise_bound: positive("--noise-bound", arguments.noise_bound)?,
    })
}
