//! How a model of polynomials is estimated.

use thetahat_numerics::optimize::Search;

use super::orders::GivenOrders;
use super::search::{self, positive};
use crate::Error;
use crate::estimate::{ConvexFit, Kernel, Loss, Method, Norm, Robust};
use crate::plan::{FitOptions, KernelWord, LikelihoodWord, MethodWord, ModelWord, NormOption};

/// What the criterion has beside its norm.
const CRITERION: [&str; 4] = ["bound", "dc_gain", "ridge", "noise_bound"];

/// How to estimate a model of these orders.
pub(super) fn method(options: &FitOptions, orders: &GivenOrders) -> Result<Method, Error> {
    let method = options.method.unwrap_or_default();
    let is_exact = options.likelihood == Some(LikelihoodWord::Exact);
    let refusal = |option: &str, why: &str| Error::argument(option, format!("it {why}, so leave it out"));
    if let Some(kernel) = kernel(options) {
        let other =
            options.first_given(&["method", "likelihood", "norm"]).or(options.first_given(&CRITERION));
        return match other {
            Some(option) => Err(refusal(&option, "goes with `kernel` none alone")),
            None => Ok(Method::Regularised(kernel)),
        };
    }
    let norm = options.norm.unwrap_or(NormOption::Two);
    let of_criterion = options.first_given(&CRITERION);
    let given = (norm != NormOption::Two).then(|| "norm".to_owned()).or(of_criterion.clone());
    let alone = (method != MethodWord::Pem).then(|| "method".to_owned()).or(given.clone());
    if let Some(option) = alone.as_ref().filter(|_| orders.is_choice()) {
        return Err(Error::argument(
            option,
            "it is for one model, and there is a choice among several; give each order one value",
        ));
    }
    if is_exact {
        return exact(options, orders, alone.as_deref());
    }
    let loss = match norm {
        NormOption::Huber { k } => Some(Loss::Huber { k }),
        NormOption::One if !orders.is_linear() => Some(Loss::Absolute),
        NormOption::Two | NormOption::One | NormOption::Infinity => None,
    };
    let searched = options.first_given(&search::OPTIONS);
    if let Some(option) = searched.as_ref().or(given.as_ref()).filter(|_| method != MethodWord::Pem) {
        return Err(refusal(option, "is for `method` pem"));
    }
    if let Some(option) = searched.filter(|_| orders.is_linear() && loss.is_none()) {
        return Err(refusal(&option, "is for models with C, D or F; this one is solved in one step"));
    }
    match of_criterion {
        Some(option) if !orders.is_linear() => {
            let why = "is for models without C, D and F; this one is not linear in its parameters";
            return Err(refusal(&option, why));
        }
        Some(option) if loss.is_some() => return Err(refusal(&option, "goes with `norm` 2, 1 and inf")),
        _ => {}
    }
    let wrong = |message: &str| Err(Error::argument("method", message));
    match method {
        MethodWord::Iv if !orders.is_linear() || !orders.has_inputs() => {
            wrong("iv gives A and B of a model with inputs; give `na` and `nb`, or leave it out")
        }
        MethodWord::Iv => Ok(Method::InstrumentalVariables),
        MethodWord::Sriv if !orders.is_output_error() => {
            wrong("sriv gives B and F; give `model` oe, or leave it out")
        }
        MethodWord::Sriv => Ok(Method::RefinedInstrumentalVariables),
        MethodWord::Pem => {
            if let Some(loss) = loss {
                return Ok(Method::Robust(Robust { loss, search: search::search(options)? }));
            }
            let criterion = criterion(options, norm)?;
            if criterion.is_plain() {
                return Ok(Method::PredictionError(search::search(options)?));
            }
            let search = if orders.is_linear() { Search::default() } else { search::search(options)? };
            Ok(Method::Constrained(ConvexFit { search, ..criterion }))
        }
    }
}

/// What is known of an impulse response before the data, if that is asked for.
fn kernel(options: &FitOptions) -> Option<Kernel> {
    if options.model != Some(ModelWord::Fir) {
        return None;
    }
    match options.kernel {
        None | Some(KernelWord::Dc) => Some(Kernel::Dc),
        Some(KernelWord::Tc) => Some(Kernel::Tc),
        Some(KernelWord::None) => None,
    }
}

/// The largest exact likelihood; `other` is an option that asks for another method or criterion.
fn exact(options: &FitOptions, orders: &GivenOrders, other: Option<&str>) -> Result<Method, Error> {
    let wrong = |option: &str, message: &str| Err(Error::argument(option, message));
    if let Some(option) = other {
        return wrong(
            option,
            "does not go with `likelihood` exact, which is that of Gaussian errors and of nothing else; leave one of the two out",
        );
    }
    if orders.is_choice() {
        return wrong(
            "likelihood",
            "exact is for one model, and there is a choice among several; give each order one value",
        );
    }
    if !orders.is_armax() {
        return wrong(
            "likelihood",
            "exact is for ar, arma, arx and armax, A y = B u + C e, and not for models with D or F; leave it out",
        );
    }
    if options.prefilter.is_some() {
        return wrong(
            "prefilter",
            "does not go with `likelihood` exact: errors in a band are not white; leave one of the two out",
        );
    }
    Ok(Method::ExactLikelihood(search::search(options)?))
}

fn criterion(options: &FitOptions, norm: NormOption) -> Result<ConvexFit, Error> {
    let positive =
        |option, value: Option<f64>| value.map(|value| positive(option, value, "number")).transpose();
    Ok(ConvexFit {
        norm: match norm {
            NormOption::One => Norm::One,
            NormOption::Infinity => Norm::Infinity,
            NormOption::Two | NormOption::Huber { .. } => Norm::Two,
        },
        ridge: positive("ridge", options.ridge)?.unwrap_or(0.0),
        bounds: options.bound.clone(),
        dc_gain: options.dc_gain.clone(),
        noise_bound: positive("noise-bound", options.noise_bound)?,
        search: Search::default(),
    })
}
