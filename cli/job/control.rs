//! What is asked for of a controller.

use thetahat::control::{ControlPlan, Design};
use thetahat::thetahat_core::nalgebra::Complex;

use super::{pole, range};
use crate::args::{ControlArguments, IntegratorArgument};
use crate::failure::Failure;

/// The plan that the options make.
pub(crate) fn control_plan(arguments: &ControlArguments) -> Result<ControlPlan, Failure> {
    let each = |option: &'static str, texts: &[String]| {
        texts.iter().map(|text| pole(option, text)).collect::<Result<Vec<Complex<f64>>, _>>()
    };
    let design = match (arguments.lqr, arguments.minimum_variance) {
        (Some(input_weight), _) => Design::Quadratic { input_weight },
        (None, Some(input_weight)) => Design::MinimumVariance { input_weight },
        (None, None) => Design::Poles(each("--poles", &arguments.poles)?),
    };
    let observer = Some(&arguments.observer).filter(|poles| !poles.is_empty());
    let [lowest, highest] = (arguments.limits.as_deref())
        .map_or(Ok([f64::NEG_INFINITY, f64::INFINITY]), |text| range("--limits", text))?;
    Ok(ControlPlan {
        input: arguments.input.clone(),
        output: arguments.output.clone(),
        observer: observer.map(|poles| each("--observer", poles)).transpose()?,
        integrator: arguments.integrator == IntegratorArgument::Yes,
        cancel_zeros: arguments.cancel_zeros,
        limits: lowest..=highest,
        draws: arguments.draws,
        ..ControlPlan::new(design)
    })
}
