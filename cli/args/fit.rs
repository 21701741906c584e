//! The arguments of fit.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{ArgGroup, Args, ValueEnum};
use thetahat::select::Select;

use super::{ClockArguments, EachArguments, FormatArgument, LogArguments, Names};

#[derive(Debug, Clone, Args)]
pub(crate) struct FitArguments {
    /// The logs: CSV files, gzip-compressed or not, Parquet or Arrow files, or logs of flights (- for standard input)
    #[arg(value_name = "LOG", required_unless_present_any = ["from", "list"])]
    pub(crate) logs: Vec<PathBuf>,
    /// Fit a process to a frequency response instead of logs: the document that spectrum wrote (- for standard input);
    /// with --structure or --np
    #[arg(
        long,
        value_name = "RESPONSE",
        requires = "continuous",
        conflicts_with_all = ["logs", "each", "output", "estimate", "validate", "split", "offset", "trend", "initial", "html", "ClockArguments", "LogArguments"]
    )]
    pub(crate) from: Option<PathBuf>,

    /// Input columns; a name that holds a comma stands between double quotes, as in CSV [default: u, u1, u2, …]
    #[arg(short = 'u', long, value_name = "NAME[,NAME…]", help_heading = "Channels")]
    pub(crate) input: Vec<Names>,
    /// Output column; with --model ss, --model arx and --narx one or more [default: y]
    #[arg(short = 'y', long, value_name = "NAME[,NAME…]", help_heading = "Channels")]
    pub(crate) output: Vec<Names>,
    /// Rows to estimate on, 1-based and inclusive, counted through all logs [default: all]
    #[arg(long, value_name = "A..B[,C..D]", value_delimiter = ',', help_heading = "Channels")]
    pub(crate) estimate: Vec<String>,
    /// Rows to validate on
    #[arg(long, value_name = "A..B[,C..D]", value_delimiter = ',', help_heading = "Channels")]
    pub(crate) validate: Vec<String>,
    /// What to take from each channel before the fit: none, mean, linear, or start:K (the mean of the first K rows);
    /// what is left of the output's level and slope --constant and --trend estimate
    #[arg(long, default_value = "mean", value_name = "WHAT", help_heading = "Channels")]
    pub(crate) detrend: String,
    /// Set a channel's offset by hand
    #[arg(long, value_name = "NAME=VALUE", help_heading = "Channels")]
    pub(crate) offset: Vec<String>,
    /// Fit in a band of frequencies in Hz, either end of which may be left out: inputs and output go through one
    /// Butterworth filter; the model and its figures are of the signals as they are
    #[arg(long, value_name = "LOW..HIGH", allow_hyphen_values = true, help_heading = "Channels")]
    pub(crate) prefilter: Option<String>,

    /// Fit the unknown parameters of a model in equations (TOML, see filter) by the largest likelihood; channels go by
    /// name, the clock may be irregular
    #[arg(
        long,
        value_name = "MODEL",
        help_heading = "Model",
        conflicts_with_all = [
            "ModelArguments", "path", "select", "CriterionArguments", "input", "output", "detrend", "offset",
            "prefilter", "NarxArguments",
        ]
    )]
    pub(crate) grey: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) model: ModelArguments,
    #[command(flatten)]
    pub(crate) states: StateSpaceArguments,
    #[command(flatten)]
    pub(crate) narx: NarxArguments,
    #[command(flatten)]
    pub(crate) choice: ChoiceArguments,
    #[command(flatten)]
    pub(crate) search: SearchArguments,
    #[command(flatten)]
    pub(crate) criterion: CriterionArguments,

    /// Write a page with charts to a file: one file of HTML that needs nothing else (- for standard output)
    #[arg(long, value_name = "FILE", help_heading = "Output", conflicts_with = "each")]
    pub(crate) html: Option<PathBuf>,
    /// Write the JSON report to a file (- for standard output, instead of the table)
    #[arg(long, value_name = "FILE", help_heading = "Output", conflicts_with = "each")]
    pub(crate) report: Option<PathBuf>,
    /// What to print: a table for people, or the JSON report
    #[arg(long, value_enum, default_value = "table", help_heading = "Output", conflicts_with = "each")]
    pub(crate) format: FormatArgument,
    /// Read the logs once, part by part, in memory that does not grow with their rows: the same parameters, of an ARX
    /// or AR model of given orders, an impulse response, a state-space model without --refine, or a nonlinear ARX model
    /// of products (--narx poly with --term, --terms or --select mdl). With several outputs orders may be ranges.
    /// Figures that need the log again, of free runs and of held-out rows, are left out
    #[arg(long, help_heading = "Output", conflicts_with_all = ["html", "grey", "from", "continuous", "resample"])]
    pub(crate) stream: bool,
    #[command(flatten)]
    pub(crate) each: EachArguments,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

/// Which model, and what its estimate starts from.
#[derive(Debug, Clone, Args)]
#[command(group(
    ArgGroup::new("continuous").conflicts_with_all([
        "na", "nb", "nc", "nd", "nf", "nk", "taps", "kernel", "method", "likelihood", "focus", "constant", "detrend", "prefilter", "path",
        "select", "seed", "CriterionArguments", "NarxArguments",
    ])
))]
pub(crate) struct ModelArguments {
    /// The model structure [default: arx; without orders the data choose; with several outputs and no orders ss]
    #[arg(long, value_enum, help_heading = "Model")]
    pub(crate) model: Option<ModelArgument>,
    /// Coefficients of A: past outputs
    #[arg(long, value_name = "N|A..B", help_heading = "Model")]
    pub(crate) na: Option<String>,
    /// Which past outputs an output depends on, where an ARX model has several: full, those of all; none, its own;
    /// auto, what has the least MDL [default: auto]
    #[arg(long, value_name = "full|none|auto", help_heading = "Model")]
    pub(crate) couple: Option<String>,
    /// Coefficients of B: inputs; one value for each input or one for all, 0 for a model without inputs
    #[arg(long, value_name = "N|A..B[,…]", value_delimiter = ',', help_heading = "Model")]
    pub(crate) nb: Vec<String>,
    /// Coefficients of C: past disturbances
    #[arg(long, value_name = "N|A..B", help_heading = "Model")]
    pub(crate) nc: Option<String>,
    /// Coefficients of D, the denominator of the noise
    #[arg(long, value_name = "N|A..B", help_heading = "Model")]
    pub(crate) nd: Option<String>,
    /// Coefficients of F, the denominator from an input alone; one value for each input or one for all
    #[arg(long, value_name = "N|A..B[,…]", value_delimiter = ',', help_heading = "Model")]
    pub(crate) nf: Vec<String>,
    /// Samples from input to first effect, one value for each input or one for all; 0: the input acts at once [default:
    /// 1; without orders the data choose]
    #[arg(long, value_name = "N|A..B[,…]", value_delimiter = ',', help_heading = "Model")]
    pub(crate) nk: Vec<String>,
    /// Taps of an impulse response (--model fir): g(nk), g(nk+1), …; one value for each input or one for all
    #[arg(long, value_name = "N[,…]", value_delimiter = ',', help_heading = "Model")]
    pub(crate) taps: Vec<usize>,
    /// What is known of an impulse response before the data (--model fir): that it decays and is smooth [default: dc]
    #[arg(long, value_enum, help_heading = "Model")]
    pub(crate) kernel: Option<KernelArgument>,
    /// What a process in continuous time has (--model process): p, how many lags, then d for a dead time, z a zero, i
    /// an integrator, u two lags that may be underdamped; or rc1, rc2, rc3 for lags side by side with a direct term, as
    /// batteries have them. One for each input or one for all; the clock may be irregular
    #[arg(
        long,
        value_name = "p1d|p2du|rc2|…[,…]",
        value_delimiter = ',',
        help_heading = "Model",
        group = "continuous"
    )]
    pub(crate) structure: Vec<String>,
    /// Poles of a transfer function in continuous time (--model tf), 1 to 6; one number for each input or one for all;
    /// the clock may be irregular
    #[arg(long, value_name = "N[,…]", value_delimiter = ',', help_heading = "Model", group = "continuous")]
    pub(crate) np: Vec<usize>,
    /// Its zeros, no more than poles; one number for each input or one for all [default: one less than poles]
    #[arg(long, value_name = "N[,…]", value_delimiter = ',', help_heading = "Model", requires = "np")]
    pub(crate) nz: Vec<usize>,
    /// Search for a dead time of each input too
    #[arg(long, help_heading = "Model", requires = "np")]
    pub(crate) delay: bool,
    /// How to estimate
    #[arg(long, value_enum, default_value = "pem", help_heading = "Model")]
    pub(crate) method: MethodArgument,
    /// Which likelihood to make large, given the first samples or of all of them: exact goes on through missing outputs
    /// (models without D and F)
    #[arg(long, value_enum, default_value = "conditional", help_heading = "Model")]
    pub(crate) likelihood: LikelihoodArgument,
    /// What stands before the first sample of a segment
    #[arg(long, value_enum, default_value = "auto", help_heading = "Model")]
    pub(crate) initial: InitialArgument,
    /// What the model is for: prediction (errors one step ahead), simulation (free runs, driven by the inputs alone),
    /// or a number of steps ahead. auto: prediction, unless without orders another model simulates rows held out from
    /// it clearly better; of networks and rbf-free simulation where there are inputs
    #[arg(long, value_name = "auto|prediction|simulation|K", default_value = "auto", help_heading = "Model")]
    pub(crate) focus: String,
    /// Estimate the level of the output with the parameters, beside the mean that is taken off: for step tests and
    /// other logs of which the mean is not where the plant rests
    #[arg(long, value_enum, default_value = "auto", help_heading = "Model")]
    pub(crate) constant: ConstantArgument,
    /// Estimate a slope of the output with the parameters too, and its level with it: for drift
    #[arg(long, help_heading = "Model")]
    pub(crate) trend: bool,
}

/// A state-space model.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "State space (--model ss)")]
pub(crate) struct StateSpaceArguments {
    /// States, or a range among which the least MDL chooses [default: 1..20]
    #[arg(long, value_name = "N|A..B")]
    pub(crate) order: Option<String>,
    /// Past samples that the states are made of [default: those of the least AIC, 40 at most]
    #[arg(long, value_name = "P", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) past: Option<u32>,
    /// Future samples that the states are to tell of [default: as many as past ones]
    #[arg(long, value_name = "S", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) future: Option<u32>,
    /// Which subspace method: ssarx, right in closed loop too; or moesp, n4sid, cva, which project on future inputs
    /// [default: ssarx]
    #[arg(long, value_name = "METHOD")]
    pub(crate) weighting: Option<String>,
    /// Whether inputs act on the outputs in the same sample. auto: where that lowers MDL and no controller is seen that
    /// feeds outputs back to the inputs [default: auto]
    #[arg(long, value_enum)]
    pub(crate) feedthrough: Option<FeedthroughArgument>,
    /// Search from there for the least errors one step ahead (prediction) or of the free run (simulation): poles, gains
    /// and responses then have standard errors
    #[arg(long, value_name = "prediction|simulation")]
    pub(crate) refine: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FeedthroughArgument {
    /// The data say it
    Auto,
    /// They do: D is estimated
    Yes,
    /// They do not: D is zero
    No,
}

/// A nonlinear ARX model.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Nonlinear ARX")]
pub(crate) struct NarxArguments {
    /// Fit y(k) = g(past outputs and inputs) + e(k): with functions that are chosen one by one, that which explains
    /// most of what is left comes next, or with a network or radial basis functions that are trained
    #[arg(
        long,
        value_enum,
        value_name = "MAP",
        conflicts_with_all = [
            "model", "na", "nb", "nc", "nd", "nf", "taps", "kernel", "structure", "np", "method", "likelihood", "initial", "constant", "trend", "path",
            "norm",
            "bound", "dc_gain", "noise_bound", "prefilter",
        ]
    )]
    pub(crate) narx: Option<MapArgument>,
    /// Past outputs that g reads: y(k-1), …, y(k-N); one number for each output or one for all [default: 2; with auto
    /// also as the linear model that the data choose]
    #[arg(long, value_name = "N[,…]", value_delimiter = ',', requires = "narx")]
    pub(crate) ny: Vec<usize>,
    /// Values of each input that g reads, from --nk on: u(k-nk), …; one number for each input or one for all [default:
    /// 2]
    #[arg(long, value_name = "N[,…]", value_delimiter = ',', requires = "narx")]
    pub(crate) nu: Vec<usize>,
    /// An expression of the channels that g reads too, such as 'sqrt(u)', at the lags of the channels in it; once for
    /// each
    #[arg(long, value_name = "EXPRESSION", requires = "narx", allow_hyphen_values = true)]
    pub(crate) regressor: Vec<String>,
    /// Factors of a product at most (poly) [default: 2]
    #[arg(long, value_name = "D", requires = "narx")]
    pub(crate) degree: Option<usize>,
    /// How many functions to take [default: --select says it, by the free run on validation rows, or on blocks of the
    /// estimation rows]
    #[arg(long, value_name = "N", requires = "narx", conflicts_with = "select")]
    pub(crate) terms: Option<usize>,
    /// A product to take, as a report writes it (poly): 1, y(k-1) or 'y(k-1)^2*u(k-1)'; once for each. Without it they
    /// are chosen
    #[arg(long, value_name = "PRODUCT", requires = "narx", conflicts_with_all = ["terms", "most_terms", "select", "degree"])]
    pub(crate) term: Vec<String>,
    /// How many functions to look at [default: 40, and 10 local models]
    #[arg(long, value_name = "N", requires = "narx", conflicts_with = "terms")]
    pub(crate) most_terms: Option<usize>,
    /// Where radial basis functions stand (rbf): chosen among the samples, at the means of N clusters, at a grid of N
    /// in each direction, or at N pseudo-random points [default: chosen]
    #[arg(long, value_name = "chosen|kmeans:N|grid:N|random:N", requires = "narx")]
    pub(crate) centres: Option<String>,
    /// sigma of radial basis functions exp(-|z - centre|^2/sigma^2), z in standard deviations [default: so that
    /// neighbours overlap]
    #[arg(long, value_name = "SIGMA", requires = "narx", allow_hyphen_values = true)]
    pub(crate) width: Option<f64>,
    /// Leave out the constant and the regressors themselves beside radial basis functions (rbf); constants in place of
    /// planes (local), or means (knn)
    #[arg(long, requires = "narx")]
    pub(crate) no_linear: bool,
    /// How local models share the space of the regressors (local) [default: gaussian]
    #[arg(long, value_enum, value_name = "SHAPE", requires = "narx")]
    pub(crate) membership: Option<MembershipArgument>,
    /// Units of a network (tanh, logistic, relu), centres (rbf-free), local models (local) or neighbours (knn)
    /// [default: chosen]; bends of each regressor (spline) [default: 5]; units that are drawn (step, --drawn) [default:
    /// 100]
    #[arg(long, value_name = "N", requires = "narx")]
    pub(crate) units: Option<usize>,
    /// Draw the weights of the hidden layer of a network, and choose among its units (tanh, logistic, relu); else they
    /// are trained. Those of step are always drawn
    #[arg(long, requires = "narx")]
    pub(crate) drawn: bool,
    /// Leave signals in their own units: else each is divided by its standard deviation
    #[arg(long, requires = "narx")]
    pub(crate) raw_terms: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MapArgument {
    /// Products of regressors up to a degree
    Poly,
    /// Radial basis functions
    Rbf,
    /// A natural cubic spline of each regressor
    Spline,
    /// Local linear models, grown by splitting the space of the regressors
    Local,
    /// The nearest samples of the fit
    Knn,
    /// A network with one hidden layer of hyperbolic tangents
    Tanh,
    /// A network of logistic functions
    Logistic,
    /// A network of ramps, max(0, a); beside a linear path they are hinges
    #[value(alias = "hinge")]
    Relu,
    /// A network of steps, whose hidden weights are drawn
    Step,
    /// Radial basis functions whose centres and widths are trained
    RbfFree,
    /// Of polynomials and networks the one with the best free run on rows held out
    Auto,
    /// A linear model, where the data choose
    None,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MembershipArgument {
    /// Each in its box alone
    Rectangle,
    /// Sloping edges, which overlap
    Trapezoid,
    /// Gaussians, over their sum
    Gaussian,
}

impl MapArgument {
    /// The functions, unless there are to be none.
    pub(crate) fn asked(given: Option<Self>) -> Option<Self> {
        given.filter(|map| *map != Self::None)
    }

    /// As it is written on the command line.
    pub(crate) fn word(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// All of them, as they are written.
    pub(crate) fn words() -> String {
        Self::value_variants().iter().map(|map| map.word()).collect::<Vec<_>>().join(", ")
    }
}

/// How to choose, where orders are ranges or are not given.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Choice (orders that are ranges, or not given)")]
pub(crate) struct ChoiceArguments {
    /// Which models of the ranges are tried [default: all]
    #[arg(long, value_enum)]
    pub(crate) path: Option<PathArgument>,
    /// What makes one model better than another [default: mdl]
    #[arg(long, value_name = "CRITERION", value_parser = selects())]
    pub(crate) select: Option<Select>,
    /// Cut the rows in time order into parts: models are fitted to the first and compared, the chosen one is fitted
    /// again to the first two and evaluated on the third; 0 for a part that is not wanted
    #[arg(long, value_name = "E/V/T", conflicts_with = "validate", allow_hyphen_values = true)]
    pub(crate) split: Option<String>,
}

/// How to search, where the model is not linear in its parameters.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Search (models with C, D or F, in equations, and trained)")]
pub(crate) struct SearchArguments {
    /// How steps are chosen [default: lm]
    #[arg(long, value_enum, value_name = "HOW")]
    pub(crate) search: Option<SearchArgument>,
    /// Iterations at most, from each start [default: 100, with --narx 500]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) max_iterations: Option<u32>,
    /// Stop where the next step would lower the cost by less than this fraction [default: 1e-8]
    #[arg(long, value_name = "FRACTION", allow_hyphen_values = true)]
    pub(crate) tolerance: Option<f64>,
    /// Step length of the gradient search: C1, or C1/(C2 + l) in iteration l [default: 1]
    #[arg(long, value_name = "C1[,C2]", allow_hyphen_values = true)]
    pub(crate) step: Option<String>,
    /// Search from this many further starts [default: 0, with --narx 4]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(..=10_000))]
    pub(crate) starts: Option<u32>,
    /// Which random starts, or which random centres [default: 0]
    #[arg(long, value_name = "S")]
    pub(crate) seed: Option<u64>,
    /// After so long begin no iteration, and look for no further start
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    pub(crate) time_limit: Option<f64>,
}

/// What to make small; and what to respect, where the model is linear in its parameters.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Criterion (all but --norm for models without C, D and F)")]
pub(crate) struct CriterionArguments {
    /// What to make small: 2, the sum of squared errors; 1, of absolute ones, which wild samples do not rule;
    /// huber[:K], of squares up to K times the scale of the errors and of absolute values beyond (K = 1.345 if not
    /// said); inf, the largest error [default: 2]
    #[arg(long, value_name = "2|1|huber[:K]|inf", allow_hyphen_values = true)]
    pub(crate) norm: Option<String>,
    /// Keep a parameter in a range, either end of which may be left out, or at a value (a1=0.5)
    #[arg(long, value_name = "NAME=LOW..HIGH")]
    pub(crate) bound: Vec<String>,
    /// Keep the static gain from an input in a range, or at a value
    #[arg(long, value_name = "[INPUT=]G|LOW..HIGH", allow_hyphen_values = true)]
    pub(crate) dc_gain: Vec<String>,
    /// Keep parameters small: weighs like this many more samples in which the output is 0 [default: 0]
    #[arg(long, value_name = "SAMPLES", allow_hyphen_values = true)]
    pub(crate) ridge: Option<f64>,
    /// Let no error exceed this, in units of the output, and find the box of all parameters that keep to it
    #[arg(long, value_name = "E", allow_hyphen_values = true)]
    pub(crate) noise_bound: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ModelArgument {
    /// A y = B u + e
    Arx,
    /// A y = B u + C e
    Armax,
    /// A y = C e: a time series
    Arma,
    /// A y = e: a time series
    Ar,
    /// Output error: y = B/F u + e
    Oe,
    /// Box and Jenkins: y = B/F u + C/D e
    Bj,
    /// A y = B/F u + C/D e, with any of them
    General,
    /// An impulse response: y = B u + e of many taps, with --taps
    Fir,
    /// A process in continuous time: gain, lags, dead time, with --structure
    Process,
    /// Transfer functions in continuous time, with --np and --nz
    Tf,
    /// State space: x(t+1) = F x + G u + K e, y = H x + D u + e, with any number of outputs
    Ss,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum KernelArgument {
    /// Decay and smoothness each have a number of their own, which the likelihood says
    Dc,
    /// One number for both
    Tc,
    /// Nothing: least squares
    None,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PathArgument {
    /// Every combination of orders
    All,
    /// One order up at a time, each in its turn
    Alternate,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum InitialArgument {
    /// drop without F; with F estimate where rows stand before, or it is worth its parameters, else zero
    Auto,
    /// What was measured before; where nothing was, samples without a full regressor are left out (models without F)
    Drop,
    /// Zeros
    Zero,
    /// What was measured before, and what fits best, found with the parameters (models with F, processes, or
    /// --likelihood exact with inputs)
    Estimate,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LikelihoodArgument {
    /// Given the samples that the first error needs: least squared prediction errors
    Conditional,
    /// Of all measured outputs, by the Kalman filter (ar, arma, arx, armax)
    Exact,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ConstantArgument {
    /// Where it lowers MDL, unless the output's offset is given (--detrend none, --offset)
    Auto,
    /// Always
    Yes,
    /// Never
    No,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodArgument {
    /// Least squared prediction errors: in one step where that is least squares, else by a search
    Pem,
    /// Instrumental variables in four stages: A and B of an arx model, whatever the noise
    Iv,
    /// Refined instrumental variables: B and F of an oe model, whatever the noise
    Sriv,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SearchArgument {
    /// Levenberg and Marquardt
    Lm,
    /// Gauss and Newton, the step halved until the cost falls
    GaussNewton,
    /// Newton and Raphson with the full Hessian
    Newton,
    /// Steepest descent
    Gradient,
    /// Simulated annealing, then lm from the best point that it met
    Annealing,
}

/// What a choice may select by, each with what it is.
fn selects() -> impl TypedValueParser<Value = Select> {
    let values = Select::all().map(|select| PossibleValue::new(select.word()).help(select.says()));
    PossibleValuesParser::new(values).try_map(|word| word.parse::<Select>())
}
