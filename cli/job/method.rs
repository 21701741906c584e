use thetahat::estimate::{ConvexFit, Kernel, Loss, Method, Norm, Robust};
use thetahat::optimize::Search;

use super::orders::OrderJob;
use super::{parsed, positive, search};
use crate::args::{
    CriterionArguments, FitArguments, KernelArgument, LikelihoodArgument, MethodArgument, ModelArgument,
    ModelArguments,
};
use crate::failure::Failure;

/// How to estimate a model of these orders.
pub(super) fn method(arguments: &FitArguments, orders: &OrderJob) -> Result<Method, Failure> {
    let FitArguments { search: of_search, criterion: of_criterion, .. } = arguments;
    let method = arguments.model.method;
    let refused = |option: &str, why: &str| Err(Failure::usage(format!("{option} {why}, so leave it out")));
    if let Some(kernel) = kernel(&arguments.model) {
        let exact = arguments.model.likelihood == LikelihoodArgument::Exact;
        let other = (method != MethodArgument::Pem)
            .then_some("--method")
            .or(of_criterion.norm.as_ref().map(|_| "--norm"))
            .or(given(of_criterion))
            .or(search::given(of_search))
            .or(exact.then_some("--likelihood"));
        return match other {
            Some(option) => {
                Err(Failure::usage(format!("{option} goes with --kernel none alone, so leave it out")))
            }
            None => Ok(Method::Regularised(kernel)),
        };
    }
    let norm = norm(of_criterion.norm.as_deref())?;
    let other_norm = (norm != Asked::Convex(Norm::Two)).then_some("--norm");
    let given = other_norm.or(given(of_criterion));
    let alone = (method != MethodArgument::Pem).then_some("--method").or(given);
    if let Some(option) = alone.filter(|_| orders.is_choice()) {
        return Err(Failure::usage(format!(
            "{option} is for one model, and there is a choice among several; give each order one value"
        )));
    }
    if arguments.model.likelihood == LikelihoodArgument::Exact {
        return exact(arguments, orders, alone);
    }
    let loss = match norm {
        Asked::Loss(loss) => Some(loss),
        Asked::Convex(Norm::One) if !orders.is_linear() => Some(Loss::Absolute),
        Asked::Convex(_) => None,
    };
    match (search::given(of_search), given) {
        (Some(option), _) if method != MethodArgument::Pem => refused(option, "is for --method pem"),
        (_, Some(option)) if method != MethodArgument::Pem => refused(option, "is for --method pem"),
        (Some(option), _) if orders.is_linear() && loss.is_none() => {
            refused(option, "is for models with C, D or F; this one is solved in one step")
        }
        _ => Ok(()),
    }?;
    match self::given(of_criterion) {
        Some(option) if !orders.is_linear() => {
            refused(option, "is for models without C, D and F; this one is not linear in its parameters")
        }
        Some(option) if loss.is_some() => refused(option, "goes with --norm 2, 1 and inf"),
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
            if let Some(loss) = loss {
                return Ok(Method::Robust(Robust { loss, search: search::search(of_search)? }));
            }
            let Asked::Convex(norm) = norm else { return wrong("--norm: give 2, 1, huber, huber:K or inf") };
            let criterion = criterion(of_criterion, norm)?;
            if criterion.is_plain() {
                return Ok(Method::PredictionError(search::search(of_search)?));
            }
            let search = if orders.is_linear() { Search::default() } else { search::search(of_search)? };
            Ok(Method::Constrained(ConvexFit { search, ..criterion }))
        }
    }
}

/// What is known of an impulse response before the data, if that is asked for.
fn kernel(arguments: &ModelArguments) -> Option<Kernel> {
    if arguments.model != Some(ModelArgument::Fir) {
        return None;
    }
    match arguments.kernel {
        None | Some(KernelArgument::Dc) => Some(Kernel::Dc),
        Some(KernelArgument::Tc) => Some(Kernel::Tc),
        Some(KernelArgument::None) => None,
    }
}

/// The largest exact likelihood; `other` is an option that asks for another method or criterion.
fn exact(arguments: &FitArguments, orders: &OrderJob, other: Option<&str>) -> Result<Method, Failure> {
    let wrong = |message: String| Err(Failure::usage(message));
    if let Some(option) = other {
        return wrong(format!(
            "{option} does not go with --likelihood exact, which is that of Gaussian errors and of nothing else; leave one of the \
             two out"
        ));
    }
    if orders.is_choice() {
        return wrong(
            "--likelihood exact is for one model, and there is a choice among several; give each order one value".to_owned(),
        );
    }
    if !orders.is_armax() {
        return wrong(
            "--likelihood exact is for ar, arma, arx and armax, A y = B u + C e, and not for models with D or F; leave it out"
                .to_owned(),
        );
    }
    if arguments.prefilter.is_some() {
        return wrong(
            "--prefilter does not go with --likelihood exact: errors in a band are not white; leave one of the two out".to_owned(),
        );
    }
    Ok(Method::ExactLikelihood(search::search(&arguments.search)?))
}

/// What to make small.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Asked {
    Convex(Norm),
    Loss(Loss),
}

/// 2, 1, inf, huber or huber:K.
fn norm(text: Option<&str>) -> Result<Asked, Failure> {
    let wrong = |text: &str| {
        Failure::usage(format!("--norm {text}: give 2, 1, huber, huber:K with K above 0, or inf"))
    };
    Ok(match text {
        None | Some("2") => Asked::Convex(Norm::Two),
        Some("1") => Asked::Convex(Norm::One),
        Some("inf") => Asked::Convex(Norm::Infinity),
        Some("huber") => Asked::Loss(Loss::Huber { k: Loss::K }),
        Some(text) => {
            let k = text.strip_prefix("huber:").and_then(|k| k.trim().parse().ok());
            let k = k.filter(|k: &f64| k.is_finite() && *k > 0.0).ok_or_else(|| wrong(text))?;
            Asked::Loss(Loss::Huber { k })
        }
    })
}

/// An option of the criterion beside its norm that was given.
fn given(arguments: &CriterionArguments) -> Option<&'static str> {
    let options = [
        ("--bound", !arguments.bound.is_empty()),
        ("--dc-gain", !arguments.dc_gain.is_empty()),
        ("--ridge", arguments.ridge.is_some()),
        ("--noise-bound", arguments.noise_bound.is_some()),
    ];
    options.into_iter().find_map(|(option, given)| given.then_some(option))
}

fn criterion(arguments: &CriterionArguments, norm: Norm) -> Result<ConvexFit, Failure> {
    let positive =
        |argument, value: Option<f64>| value.map(|value| positive(argument, value, "number")).transpose();
    let bounds = arguments.bound.iter().map(|text| parsed("--bound", text));
    let gains = arguments.dc_gain.iter().map(|text| parsed("--dc-gain", text));
    Ok(ConvexFit {
        norm,
        ridge: positive("--ridge", arguments.ridge)?.unwrap_or(0.0),
        bounds: bounds.collect::<Result<_, _>>()?,
        dc_gain: gains.collect::<Result<_, _>>()?,
        noise_bound: positive("--noise-bound", arguments.noise_bound)?,
        search: Search::default(),
    })
}
