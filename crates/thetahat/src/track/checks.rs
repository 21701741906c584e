//! What a plan must be for a tracker to be made of it.

use super::collecting::{LARGEST, SMALLEST};
use super::plan::{PerChannel, TrackPlan};
use crate::Error;
use crate::model::{Map, Orders};

/// Functions at most: their covariance has this many squared numbers.
const MOST_FUNCTIONS: usize = 1000;

/// What is asked of functions of lags, and of a plan for them.
pub(super) fn check_map(orders: &Orders, map: &Map, names: &[String], plan: &TrackPlan) -> Result<(), Error> {
    let regressors = orders.parameters();
    if orders.nc > 0 || plan.method.with_noise_model().is_some() {
        return Err(Error::argument("method", "a nonlinear model is tracked by rls, and has no C"));
    }
    if plan.constant {
        return Err(Error::argument(
            "constant",
            "of a nonlinear model the constant is one of its functions; leave it out",
        ));
    }
    if let Map::Neighbours { .. } = map {
        return Err(Error::report(
            "the model keeps samples (nearest neighbours), and has no parameters to track; fit another map",
        ));
    }
    map.check(regressors).map_err(|message| Error::argument("map", message))?;
    let count = map.parameters(regressors);
    if count == 0 || count > MOST_FUNCTIONS {
        return Err(Error::argument(
            if matches!(map, Map::Polynomial { .. }) { "degree" } else { "map" },
            format!(
                "it has {count} functions, and 1 to {MOST_FUNCTIONS} can be tracked; take a lower degree or fewer lags"
            ),
        ));
    }
    if names.len() != count {
        return Err(Error::argument(
            "map",
            format!("there are {} names for its {count} functions", names.len()),
        ));
    }
    Ok(())
}

/// What a plan asks of orders, and all numbers that no estimator checks.
pub(super) fn check(orders: &Orders, plan: &TrackPlan) -> Result<(), Error> {
    let inputs = orders.inputs();
    // Orders are plain data: these may not be any that `Orders::new` made.
    Orders::new(orders.na, &orders.nb, orders.nc, orders.nd, &orders.nf, &orders.nk)?;
    if orders.nd > 0 || orders.nf.iter().any(|&nf| nf > 0) {
        let message = format!("{orders} has D or F; track AR, ARX, ARMA or ARMAX");
        return Err(Error::argument("orders", message));
    }
    match (plan.method.with_noise_model(), orders.nc) {
        (None, 1..) => {
            return Err(Error::argument("method", format!("rls has no C, {orders} has; use els or rpem")));
        }
        (Some(_), 0) => {
            let message = format!("{} is for models with C, {orders} has none; use rls", plan.method);
            return Err(Error::argument("method", message));
        }
        _ => {}
    }
    if orders.nc > 0 && plan.start.0 != thetahat_core::RlsStart::Standard {
        let message = format!("{orders} has only the standard start; leave out '{}'", plan.start);
        return Err(Error::argument("start", message));
    }
    let is_scale = |scale: f64| (SMALLEST..=LARGEST).contains(&scale);
    if let Some(scale) = plan.noise_scale.filter(|&scale| orders.nc > 0 && !is_scale(scale)) {
        let message =
            format!("{scale:?} is not in {SMALLEST:e} … {LARGEST:e}; give the typical magnitude of e");
        return Err(Error::argument("noise-scale", message));
    }
    if let Some(offsets) = &plan.offsets {
        check_channels(
            "offset",
            offsets,
            inputs,
            f64::is_finite,
            "is not finite; give what is to be taken off",
        )?;
    }
    if let Some(scales) = &plan.scales {
        let message = format!("is not in {SMALLEST:e} … {LARGEST:e}; give its typical magnitude");
        check_channels("scale", scales, inputs, is_scale, &message)?;
    }
    Ok(())
}

/// That each channel has a number that fits.
fn check_channels(
    argument: &str,
    given: &PerChannel,
    inputs: usize,
    fits: impl Fn(f64) -> bool,
    otherwise: &str,
) -> Result<(), Error> {
    if given.inputs.len() != inputs {
        let message =
            format!("there are {} values for {inputs} inputs; give one for each", given.inputs.len());
        return Err(Error::argument(argument, message));
    }
    let wrong = |channel: &str, value: f64| {
        Err(Error::argument(argument, format!("that of {channel}, {value:?}, {otherwise}")))
    };
    match given.inputs.iter().enumerate().find(|(_, value)| !fits(**value)) {
        Some((input, &value)) => wrong(&format!("input {}", input + 1), value),
        None if !fits(given.output) => wrong("the output", given.output),
        None => Ok(()),
    }
}

/// What the estimator does not take from a plan.
pub(super) fn refused(error: thetahat_core::Error) -> Error {
    match error {
        thetahat_core::Error::OutOfRange { argument: "width", range } => {
            Error::argument("dead-zone", format!("it must be {range}"))
        }
        // All else that has a range and was not checked above is a number of a policy.
        thetahat_core::Error::OutOfRange { argument, range } => {
            Error::argument("forgetting", format!("its {} must be {range}", argument.replace('_', " ")))
        }
        _ => Error::argument("orders", error.to_string()),
    }
}
