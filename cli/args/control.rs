//! The arguments of control.

use std::path::PathBuf;

use clap::{ArgGroup, Args, ValueEnum};

use super::ClosedLoopArguments;

#[derive(Debug, Args)]
#[command(group(ArgGroup::new("design").required(true).args(["poles", "lqr", "minimum_variance"])))]
pub(crate) struct ControlArguments {
    /// The report that fit wrote (- for standard input)
    #[arg(value_name = "REPORT")]
    pub(crate) report: PathBuf,
    /// The input that the controller moves [default: the only one]
    #[arg(short = 'u', long, value_name = "NAME")]
    pub(crate) input: Option<String>,
    /// The output that it holds [default: the only one]
    #[arg(short = 'y', long, value_name = "NAME")]
    pub(crate) output: Option<String>,
    /// The poles of the response to the set point in the z plane, such as 0.8,0.7 or 0.6+0.2i,0.6-0.2i
    #[arg(
        long,
        value_name = "POLE[,POLE…]",
        value_delimiter = ',',
        allow_hyphen_values = true,
        help_heading = "Design"
    )]
    pub(crate) poles: Vec<String>,
    /// The least sum of y² + WEIGHT u², with an integrator of the changes of u
    #[arg(long, value_name = "WEIGHT", allow_hyphen_values = true, help_heading = "Design")]
    pub(crate) lqr: Option<f64>,
    /// The least variance of y, and of WEIGHT u² beside it (with an integrator of the changes of u)
    #[arg(
        long,
        value_name = "WEIGHT",
        num_args = 0..=1,
        default_missing_value = "0",
        require_equals = true,
        allow_hyphen_values = true,
        help_heading = "Design"
    )]
    pub(crate) minimum_variance: Option<f64>,
    /// The poles of the observer, which set how fast noise and errors decay [default: the zeros of the noise model]
    #[arg(
        long,
        value_name = "POLE[,POLE…]",
        value_delimiter = ',',
        allow_hyphen_values = true,
        help_heading = "Design"
    )]
    pub(crate) observer: Vec<String>,
    /// Whether the controller integrates, so that constant loads leave no error
    #[arg(long, value_enum, value_name = "yes|no", default_value = "yes", help_heading = "Design")]
    pub(crate) integrator: IntegratorArgument,
    /// Cancel the zeros of the model, which must be inside the unit circle
    #[arg(long, help_heading = "Design")]
    pub(crate) cancel_zeros: bool,
    /// The range of the actuator, in the unit of the input
    #[arg(long, value_name = "LOW..HIGH", allow_hyphen_values = true, help_heading = "Design")]
    pub(crate) limits: Option<String>,
    /// How many models are drawn from the covariance of the parameters
    #[arg(long, value_name = "N", default_value_t = 500, help_heading = "Design")]
    pub(crate) draws: usize,
    #[command(flatten)]
    pub(crate) outputs: ClosedLoopArguments,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum IntegratorArgument {
    Yes,
    No,
}
