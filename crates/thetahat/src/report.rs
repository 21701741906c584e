//! The document that a fit leaves behind, and the way there.

mod apply;
mod equations;
mod held_out_runs;
#[cfg(feature = "html")]
mod html;
mod identify;
mod judge;
mod nonlinear_arx;
mod requirement;
mod sample;
mod schema;
mod seen;
mod shares;
mod suited;
#[cfg(test)]
mod tests;
mod validation;
mod warnings;

pub use apply::{Applied, AppliedOutput, apply};
pub use equations::{EquationsPlan, fit_equations};
pub use held_out_runs::held_out_runs;
#[cfg(feature = "html")]
pub use html::{comparison_page, fit_page, inspection_page, validation_page};
pub use identify::{Plan, Unjudged, identify, identify_monitored};
pub use nonlinear_arx::{Centres, InputLags, MapPlan, NonlinearArxPlan, fit_nonlinear_arx};
pub use requirement::Requirement;
pub use sample::sample;
pub use schema::{Data, Estimation, Missing, Parts, Report};
pub use validation::{
    Comparison, Coverage, NoiseLevel, OutputSignals, Seen, Signals, Validated, Validation, ValidationPlan,
    compare, validate,
};
