//! The syntax of the command line, and nothing else. `job` says what it means.

mod files;

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::table;

const EXIT_CODES: &str = "\
Exit codes:
  0  done
  2  usage: the command line does not make sense
  3  bad data: the log or the report does not hold what was asked of it
  4  the data cannot determine the model
  5  input/output: a file cannot be read or written
  6  the model does not meet what --require asks
  7  track ended at an alarm, as --stop-on-alarm asks
  130  interrupted (Ctrl-C); nothing is left half written
  143  terminated (SIGTERM), likewise";

/// Identifies dynamic systems from logged data.
#[derive(Debug, Parser)]
#[command(name = "thetahat", version, about, after_help = EXIT_CODES, arg_required_else_help = true)]
#[command(help_template = "{about-with-newline}\n{usage-heading} {usage}\n\n{all-args}{after-help}\n")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Fit a model to one or several logs
    ///
    /// Fits A(q) y(t) = B(q)/F(q) u(t - nk) + C(q)/D(q) e(t): by least squares where that is linear in the parameters, else by
    /// a search for the least sum of squared prediction errors. Without orders, delay, structure and orders are chosen from the
    /// data; orders may also be ranges. Prints a table and writes a JSON report. Several logs are several experiments with one
    /// plant: their rows are counted through, and nothing reaches from one into the next.
    #[command(after_help = "\
Examples:
  thetahat fit log.csv --sample-time 0.08
  thetahat fit log.csv --na 1..10 --nb 1..10 --nk 0..5 --split 60/20/20 --select validation
  thetahat fit log.csv --sample-time 0.08 --na 2 --nb 2 --nk 3 --report model.json
  thetahat fit log.csv --time t -u heater -y temperature --validate 501..1000 --na 2 --nb 2
  thetahat fit log.csv --model bj --nb 2 --nc 1 --nd 1 --nf 2 --starts 5
  thetahat fit monday.csv tuesday.csv --model oe --nb 2 --nf 2 --report model.json
  thetahat fit sunspots.csv -y count --model arma --na 2 --nc 1
  thetahat fit --grey spring.toml log.csv --report spring.json
  thetahat fit log.csv --na 2 --nb 2 --norm 1 --bound a1=-1.9..0 --dc-gain 1..20
  thetahat fit log.csv --model oe --nb 2 --nf 2 --norm huber")]
    Fit(Box<FitArguments>),
    /// Look at a log before any fit
    ///
    /// Says of each channel its range, mean and trend, missing and repeated values, rounding, saturation and outliers; of the
    /// clock its step and jitter; of each input how much it excites, its delay and whether it follows the output. Ends
    /// with warnings and the line of thetahat fit that goes with the log. Without -u and -y it looks at all columns of
    /// numbers.
    #[command(after_help = "\
Examples:
  thetahat inspect log.csv --sample-time 0.08
  thetahat inspect log.csv --time t -u heater -y temperature --format json -o inspection.json")]
    Inspect(Box<InspectArguments>),
    /// Predict a log some steps ahead with a fitted model
    ///
    /// Writes CSV: time or row, measured, predicted and the standard deviation of its error, that of the parameters included, in the
    /// log's own units. The fit figures go to standard error. Rows at the end that have inputs but no output are forecast, each as many steps ahead as
    /// it lies behind the last measured one; a series without inputs is forecast beyond the end of the log.
    #[command(after_help = "\
Examples:
  thetahat predict model.json log.csv --horizon 5 > predicted.csv
  thetahat predict model.json log.csv --rows 900..1000 --horizon 20 -o forecast.csv")]
    Predict(PredictArguments),
    /// Simulate a fitted model on a log's inputs (free run)
    ///
    /// Writes CSV: time or row, measured, predicted, in the log's own units. The fit figures go to standard error.
    /// Without the output column, the run starts from zero. With --draws there are three more columns: mean, quantile_0.025 and
    /// quantile_0.975 of runs with noise and with parameters drawn from their covariance.
    #[command(after_help = "\
Examples:
  thetahat simulate model.json log.csv --rows 501..1000 > simulated.csv
  thetahat simulate model.json log.csv --draws 1000 --seed 1 > bands.csv")]
    Simulate(SimulateArguments),
    /// Say how a fitted model does on a log, and whether anything is left in its residuals
    ///
    /// Fits 1 step ahead, some steps ahead and in a free run; whiteness of the residuals by Ljung and Box's test and by
    /// Anderson's, whose count decides by its p-value; their independence of past inputs, and a word on feedback; the noise beside the model's own; how often its
    /// prediction intervals hold. With --require it is a gate: exit code 6 if the model does not meet it.
    #[command(after_help = "\
Examples:
  thetahat validate model.json log.csv --rows 501..1000
  thetahat validate model.json log.csv --require 'independent,stable,fit>=50,fit@5>=50'
  thetahat validate model.json log.csv --format json --horizon 1,10 --lags 40 > validation.json")]
    Validate(ValidateArguments),
    /// Put several fitted models side by side on a log
    ///
    /// The figures of validate, a column for each model, and the alpha from which on a fraction alpha of the correlations, or
    /// more, lies outside the band of that level (Anderson): it orders models by how white they are, and is no verdict.
    #[command(after_help = "\
Example:
  thetahat compare model.json model.json log.csv --rows 501..1000")]
    Compare(CompareArguments),
    /// Identify a plant while it runs: a line for each sample of a log or a live pipe
    ///
    /// Recursive least squares for A(q) y(t) = B(q) u(t - nk) + e(t), and its extension by C(q) e(t). Each line has the
    /// one-step prediction made before the sample, what the sample told, and the parameters after it. Ends with a table on
    /// standard error. Runs until the log or the pipe ends, or Ctrl-C or SIGTERM end it; memory does not grow.
    #[command(after_help = "\
Examples:
  thetahat track log.csv --na 2 --nb 2 --nk 3 --format csv > parameters.csv
  tail -n +1 -F log.csv | thetahat track - --na 2 --nb 2 --alarm 10000 --state track.json
  thetahat track log.csv --na 2 --nb 2 --forgetting 1,0.99,0.95 --every 100
  thetahat track log.csv --warm model.json --horizon 5")]
    Track(Box<TrackArguments>),
    /// Estimate the state of a model along a log or a live pipe
    ///
    /// MODEL is a report of fit, or a text file (TOML) with the matrices F, G, H, Q, R, or with the equations of a plant, of
    /// which unknown parameters are estimated together with the state. Each line has the states as predicted from the rows
    /// before and as corrected by this one, with standard deviations (_sd); what was measured and predicted of each output,
    /// and the innovation; the normalised innovation squared (nis) and between which bounds it lies in 95 % of the rows; and
    /// held, the inputs that are missing in this row. An observer has predicted states only. Ends with a table on standard
    /// error.
    #[command(after_help = "\
Examples:
  thetahat filter spring.toml log.csv --format csv > states.csv
  thetahat filter model.json log.csv --estimator kalman -o states.jsonl
  tail -n +1 -F log.csv | thetahat filter cell.toml - --estimator ekf --time t
  thetahat filter level.toml log.csv --smooth

A model in matrices, and one in equations:
  sample_time = 1                 # seconds        sample_time = 0.1
  states = ['x', 'v']             # names          [states]
  inputs = ['u']                  # channels       x = { start = 0, sd = 1 }
  outputs = ['y']                 # channels       [inputs]
  F = [[1, 1], [0, 1]]                             force = 'u'             # a channel
  G = [[0], [1]]                                   [parameters]
  H = [[1, 0]]                                     k = { start = 2, sd = 1, unknown = true, min = 0 }
  Q = [[0, 0], [0, 0.1]]          # variances      [next]                  # or [derivative]
  R = [[1]]                       # variances      x = 'x + dt * (force - k * x)'
  x0 = [0, 0]                                      [outputs]
  P0 = [[9, 0], [0, 9]]           # variances      y = 'x'                 # a channel
                                                   [noise]                 # standard deviations
                                                   process = { x = 0.01 }  # added in one sample_time
                                                   measurement = { y = 0.1 }
Equations have + - * / ^, sin cos tan asin acos atan atan2 sinh cosh tanh exp ln log10 sqrt abs sign min max, pi, t (seconds
since the first row) and, in [next], dt (seconds of this step). The process noise grows with the square root of dt.")]
    Filter(Box<FilterArguments>),
    /// The frequency response of a fitted model
    ///
    /// Writes CSV with a row for each input and frequency, and for the noise (input "noise"): input, frequency [rad/s],
    /// magnitude [units of the output per unit of the input] and its standard error, phase [degrees] and its standard error.
    #[command(after_help = "\
Example:
  thetahat bode model.json --frequencies 0.01..3 --points 200 > bode.csv")]
    Bode(BodeArguments),
    /// The step response of a fitted model
    ///
    /// Writes CSV with a row for each input and time: input, time [s], value [units of the output per unit of the input] and its
    /// standard error. The input is 1 from time 0 on; all is at rest before.
    #[command(after_help = "\
Example:
  thetahat step model.json --samples 200 > step.csv")]
    Step(TransientArguments),
    /// The impulse response of a fitted model
    ///
    /// Writes CSV with a row for each input and time: input, time [s], value [units of the output per unit of the input] and its
    /// standard error. The input is 1 in the sample at time 0 and 0 afterwards; all is at rest before. The values are the
    /// coefficients g_i of B(q)/(A(q) F(q)) = g_0 + g_1 q^-1 + …
    #[command(after_help = "\
Example:
  thetahat impulse model.json --samples 50 > impulse.csv")]
    Impulse(TransientArguments),
    /// Fit a sample log of a DC motor, carried inside the program
    ///
    /// Writes the log and the report of its fit into a folder and prints the table.
    #[command(after_help = "\
Example:
  thetahat demo")]
    Demo(DemoArguments),
    /// Print the JSON Schema of a document
    #[command(after_help = "\
Example:
  thetahat schema > thetahat.report.schema.json")]
    Schema {
        /// The document: what fit, validate, compare, inspect, fit --grey, track or filter writes
        #[arg(value_enum, default_value = "report")]
        document: DocumentArgument,
    },
    /// Print shell completions
    #[command(after_help = "\
Example:
  thetahat completions bash > ~/.local/share/bash-completion/completions/thetahat")]
    Completions {
        /// The shell to complete in
        shell: clap_complete::Shell,
    },
    /// Print the manual page of thetahat, or of one verb
    #[command(after_help = "\
Example:
  thetahat man fit | man -l -")]
    Man {
        /// The verb
        verb: Option<String>,
    },
}

#[derive(Debug, Args)]
pub(crate) struct FitArguments {
    /// The logs: CSV files, gzip-compressed or not (- for standard input)
    #[arg(value_name = "LOG", required = true)]
    pub(crate) logs: Vec<PathBuf>,

    /// Input columns; a name that holds a comma stands between double quotes, as in CSV [default: u, u1, u2, …]
    #[arg(short = 'u', long, value_name = "NAME[,NAME…]", help_heading = "Channels")]
    pub(crate) input: Vec<Names>,
    /// Output column [default: y]
    #[arg(short = 'y', long, value_name = "NAME", help_heading = "Channels")]
    pub(crate) output: Option<String>,
    /// Rows to estimate on, 1-based and inclusive, counted through all logs [default: all]
    #[arg(long, value_name = "A..B[,C..D]", value_delimiter = ',', help_heading = "Channels")]
    pub(crate) estimate: Vec<String>,
    /// Rows to validate on
    #[arg(long, value_name = "A..B[,C..D]", value_delimiter = ',', help_heading = "Channels")]
    pub(crate) validate: Vec<String>,
    /// What to take from each channel before the fit: none, mean, linear, or start:K (the mean of the first K rows); what is
    /// left of the output's level and slope --constant and --trend estimate
    #[arg(long, default_value = "mean", value_name = "WHAT", help_heading = "Channels")]
    pub(crate) detrend: String,
    /// Set a channel's offset by hand
    #[arg(long, value_name = "NAME=VALUE", help_heading = "Channels")]
    pub(crate) offset: Vec<String>,
    /// Fit in a band of frequencies in Hz, either end of which may be left out: inputs and output go through one Butterworth
    /// filter; the model and its figures are of the signals as they are
    #[arg(long, value_name = "LOW..HIGH", allow_hyphen_values = true, help_heading = "Channels")]
    pub(crate) prefilter: Option<String>,

    /// Fit the unknown parameters of a model in equations (TOML, see filter) by prediction error; channels go by name
    #[arg(
        long,
        value_name = "MODEL",
        help_heading = "Model",
        conflicts_with_all = [
            "ModelArguments", "ChoiceArguments", "SearchArguments", "CriterionArguments", "input", "output", "validate",
            "detrend", "offset", "prefilter", "html", "resample",
        ]
    )]
    pub(crate) grey: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) model: ModelArguments,
    #[command(flatten)]
    pub(crate) choice: ChoiceArguments,
    #[command(flatten)]
    pub(crate) search: SearchArguments,
    #[command(flatten)]
    pub(crate) criterion: CriterionArguments,

    /// Write a page with charts to a file: one file of HTML that needs nothing else (- for standard output)
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(crate) html: Option<PathBuf>,
    /// Write the JSON report to a file (- for standard output, instead of the table)
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(crate) report: Option<PathBuf>,
    /// What to print: a table for people, or the JSON report
    #[arg(long, value_enum, default_value = "table", help_heading = "Output")]
    pub(crate) format: FormatArgument,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

#[derive(Debug, Args)]
pub(crate) struct InspectArguments {
    /// The log: a CSV file, gzip-compressed or not (- for standard input)
    #[arg(value_name = "LOG")]
    pub(crate) path: PathBuf,

    /// Input columns; a name that holds a comma stands between double quotes, as in CSV [default: u, u1, u2, …, if they are there]
    #[arg(short = 'u', long, value_name = "NAME[,NAME…]", help_heading = "Channels")]
    pub(crate) input: Vec<Names>,
    /// Output column [default: y, if it is there]
    #[arg(short = 'y', long, value_name = "NAME", help_heading = "Channels")]
    pub(crate) output: Option<String>,

    /// What to write: a table for people, or the JSON document
    #[arg(long, value_enum, default_value = "table", help_heading = "Output")]
    pub(crate) format: FormatArgument,
    /// Write it to a file instead of standard output
    #[arg(
        short = 'o',
        long,
        value_name = "FILE",
        default_value = "-",
        hide_default_value = true,
        help_heading = "Output"
    )]
    pub(crate) out: PathBuf,
    /// Write a page with charts to a file too
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(crate) html: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

/// Which model, and what its estimate starts from.
#[derive(Debug, Args)]
pub(crate) struct ModelArguments {
    /// The model structure [default: arx; without orders the data choose]
    #[arg(long, value_enum, help_heading = "Model")]
    pub(crate) model: Option<ModelArgument>,
    /// Coefficients of A: past outputs
    #[arg(long, value_name = "N|A..B", help_heading = "Model")]
    pub(crate) na: Option<String>,
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
    /// Samples from input to first effect, one value for each input or one for all; 0: the input acts at once [default: 1;
    /// without orders the data choose]
    #[arg(long, value_name = "N|A..B[,…]", value_delimiter = ',', help_heading = "Model")]
    pub(crate) nk: Vec<String>,
    /// How to estimate
    #[arg(long, value_enum, default_value = "pem", help_heading = "Model")]
    pub(crate) method: MethodArgument,
    /// What stands before the first sample of a stretch
    #[arg(long, value_enum, default_value = "auto", help_heading = "Model")]
    pub(crate) initial: InitialArgument,
    /// Estimate the level of the output with the parameters, beside the mean that is taken off: for step tests and other logs
    /// of which the mean is not where the plant rests
    #[arg(long, value_enum, default_value = "auto", help_heading = "Model")]
    pub(crate) constant: ConstantArgument,
    /// Estimate a slope of the output with the parameters too, and its level with it: for drift
    #[arg(long, help_heading = "Model")]
    pub(crate) trend: bool,
}

/// How to choose, where orders are ranges or are not given.
#[derive(Debug, Args)]
#[command(next_help_heading = "Choice (orders that are ranges, or not given)")]
pub(crate) struct ChoiceArguments {
    /// Which models of the ranges are tried [default: all]
    #[arg(long, value_enum)]
    pub(crate) path: Option<PathArgument>,
    /// What makes one model better than another [default: mdl]
    #[arg(long, value_enum, value_name = "CRITERION")]
    pub(crate) select: Option<SelectArgument>,
    /// Cut the rows in time order into parts: models are fitted to the first and compared, the chosen one is fitted again to
    /// the first two and judged on the third; 0 for a part that is not wanted
    #[arg(long, value_name = "E/V/T", conflicts_with = "validate", allow_hyphen_values = true)]
    pub(crate) split: Option<String>,
}

/// How to search, where the model is not linear in its parameters.
#[derive(Debug, Args)]
#[command(next_help_heading = "Search (models with C, D or F)")]
pub(crate) struct SearchArguments {
    /// How steps are chosen [default: lm]
    #[arg(long, value_enum, value_name = "HOW")]
    pub(crate) search: Option<SearchArgument>,
    /// Iterations at most, from each start [default: 100]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) max_iterations: Option<u32>,
    /// Stop where the next step would lower the cost by less than this fraction [default: 1e-8]
    #[arg(long, value_name = "FRACTION", allow_hyphen_values = true)]
    pub(crate) tolerance: Option<f64>,
    /// Step length of the gradient search: C1, or C1/(C2 + l) in iteration l [default: 1]
    #[arg(long, value_name = "C1[,C2]", allow_hyphen_values = true)]
    pub(crate) step: Option<String>,
    /// Search from so many further starts [default: 0]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(..=10_000))]
    pub(crate) starts: Option<u32>,
    /// Which random starts [default: 0]
    #[arg(long, value_name = "S", requires = "starts")]
    pub(crate) seed: Option<u64>,
    /// After so long begin no iteration, and look for no further start
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    pub(crate) time_limit: Option<f64>,
}

/// What to make small; and what to respect, where the model is linear in its parameters.
#[derive(Debug, Args)]
#[command(next_help_heading = "Criterion (all but --norm for models without C, D and F)")]
pub(crate) struct CriterionArguments {
    /// What to make small: 2, the sum of squared errors; 1, of absolute ones, which wild samples do not rule; huber[:K], of squares
    /// up to K times the scale of the errors and of absolute values beyond (K = 1.345 if not said); inf, the largest error, for
    /// models without C, D and F [default: 2]
    #[arg(long, value_name = "2|1|huber[:K]|inf", allow_hyphen_values = true)]
    pub(crate) norm: Option<String>,
    /// Keep a parameter in a range, either end of which may be left out, or at a value (a1=0.5)
    #[arg(long, value_name = "NAME=LOW..HIGH")]
    pub(crate) bound: Vec<String>,
    /// Keep the static gain from an input in a range, or at a value
    #[arg(long, value_name = "[INPUT=]G|LOW..HIGH", allow_hyphen_values = true)]
    pub(crate) dc_gain: Vec<String>,
    /// Keep parameters small: weighs like so many more samples in which the output is 0 [default: 0]
    #[arg(long, value_name = "SAMPLES", allow_hyphen_values = true)]
    pub(crate) ridge: Option<f64>,
    /// Let no error exceed this, in units of the output, and find the box of all parameters that keep to it
    #[arg(long, value_name = "E", allow_hyphen_values = true)]
    pub(crate) noise_bound: Option<f64>,
}

#[derive(Debug, Args)]
pub(crate) struct PredictArguments {
    /// Steps ahead; inf for a free run, like simulate
    #[arg(long, value_name = "K", default_value = "1", allow_hyphen_values = true)]
    pub(crate) horizon: String,
    /// What stands before the first sample of a stretch
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) initial: StartArgument,
    #[command(flatten)]
    pub(crate) respond: RespondArguments,
}

#[derive(Debug, Args)]
pub(crate) struct SimulateArguments {
    /// Draw so many runs of what the model leaves open: its noise, and its parameters within their covariance
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) draws: Option<u32>,
    /// Which draws [default: 0]
    #[arg(long, value_name = "S", requires = "draws")]
    pub(crate) seed: Option<u64>,
    /// Write the drawn runs themselves to a file: CSV with a row for each row of the log, and a column for each draw
    #[arg(long, value_name = "FILE", requires = "draws")]
    pub(crate) draws_file: Option<PathBuf>,
    /// What stands before the first sample of a stretch
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) initial: StartArgument,
    #[command(flatten)]
    pub(crate) respond: RespondArguments,
}

#[derive(Debug, Args)]
pub(crate) struct ValidateArguments {
    /// The report that fit wrote (- for standard input)
    #[arg(value_name = "REPORT")]
    pub(crate) report: PathBuf,
    /// The log: a CSV file, gzip-compressed or not (- for standard input)
    #[arg(value_name = "LOG")]
    pub(crate) path: PathBuf,
    /// What the model must be or do: white, independent, stable, fit>=P (percent, free run), fit@K>=P (K steps ahead),
    /// mean-error<=E and largest-error<=E (of |e| in units of the output, free run), mean-error@K<=E, largest-error@K<=E,
    /// coverage>=P (of the 95 % intervals); exit code 6 if it does not
    #[arg(long, value_name = "WHAT[,WHAT…]", value_delimiter = ',', help_heading = "Tests")]
    pub(crate) require: Vec<String>,
    #[command(flatten)]
    pub(crate) look: LookArguments,
}

#[derive(Debug, Args)]
pub(crate) struct CompareArguments {
    /// The reports that fit wrote (- for standard input)
    #[arg(value_name = "REPORT", required = true, num_args = 1..)]
    pub(crate) reports: Vec<PathBuf>,
    /// The log: a CSV file, gzip-compressed or not (- for standard input)
    #[arg(value_name = "LOG", required = true)]
    pub(crate) path: PathBuf,
    #[command(flatten)]
    pub(crate) look: LookArguments,
}

/// What validate and compare share.
#[derive(Debug, Args)]
pub(crate) struct LookArguments {
    /// Rows to look at, 1-based and inclusive [default: all]
    #[arg(long, value_name = "A..B[,C..D]", value_delimiter = ',')]
    pub(crate) rows: Vec<String>,
    /// Offsets: the model's own, or none, mean, linear, start:K of the rows looked at
    #[arg(long, default_value = "model", value_name = "WHAT")]
    pub(crate) detrend: String,
    /// How many steps ahead to look besides 1
    #[arg(
        long,
        value_name = "K[,K…]",
        default_value = "5",
        value_delimiter = ',',
        allow_hyphen_values = true
    )]
    pub(crate) horizon: Vec<String>,
    /// Lags of the tests of residuals; short logs have fewer
    #[arg(long, value_name = "L", default_value_t = 25, help_heading = "Tests")]
    pub(crate) lags: usize,
    /// Reject where less than this chance is left
    #[arg(
        long,
        value_name = "LEVEL",
        default_value_t = 0.05,
        allow_hyphen_values = true,
        help_heading = "Tests"
    )]
    pub(crate) alpha: f64,
    /// The levels of the bands of which Anderson's test counts what lies outside
    #[arg(
        long,
        value_name = "LEVEL[,LEVEL…]",
        value_delimiter = ',',
        default_value = "0.01,0.02,0.05,0.1,0.2",
        allow_hyphen_values = true,
        help_heading = "Tests"
    )]
    pub(crate) alphas: Vec<f64>,
    /// What to print: a table for people, or the JSON document
    #[arg(long, value_enum, default_value = "table", help_heading = "Output")]
    pub(crate) format: FormatArgument,
    /// Write the JSON document to a file (- for standard output, instead of the table)
    #[arg(short = 'o', long, value_name = "FILE", help_heading = "Output")]
    pub(crate) out: Option<PathBuf>,
    /// Write a page with charts to a file
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(crate) html: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

#[derive(Debug, Args)]
pub(crate) struct TrackArguments {
    /// The log: a CSV file, gzip-compressed or not (- for standard input)
    #[arg(value_name = "LOG")]
    pub(crate) path: PathBuf,

    /// Input columns; a name that holds a comma stands between double quotes, as in CSV [default: u, u1, u2, …; those of --warm]
    #[arg(short = 'u', long, value_name = "NAME[,NAME…]", help_heading = "Channels")]
    pub(crate) input: Vec<Names>,
    /// Output column [default: y; that of --warm]
    #[arg(short = 'y', long, value_name = "NAME", help_heading = "Channels")]
    pub(crate) output: Option<String>,
    /// Subtract this from a channel [default: 0; the offsets of --warm]
    #[arg(long, value_name = "NAME=VALUE", help_heading = "Channels")]
    pub(crate) offset: Vec<String>,
    /// The typical magnitude of a channel; a factor of 3 does not matter [default: the largest of the first rows, from which
    /// then nothing is predicted]
    #[arg(long, value_name = "NAME=VALUE", help_heading = "Channels")]
    pub(crate) scale: Vec<String>,

    /// The model structure [default: arx; that of --warm]
    #[arg(long, value_enum, help_heading = "Model")]
    pub(crate) model: Option<TrackModelArgument>,
    /// Coefficients of A: past outputs
    #[arg(long, value_name = "N", help_heading = "Model")]
    pub(crate) na: Option<usize>,
    /// Coefficients of B: inputs; one value for each input or one for all, 0 for a model without inputs
    #[arg(long, value_name = "N[,…]", value_delimiter = ',', help_heading = "Model")]
    pub(crate) nb: Vec<usize>,
    /// Coefficients of C: past disturbances
    #[arg(long, value_name = "N", help_heading = "Model")]
    pub(crate) nc: Option<usize>,
    /// Samples from input to first effect, one value for each input or one for all [default: 1]
    #[arg(long, value_name = "N[,…]", value_delimiter = ',', help_heading = "Model")]
    pub(crate) nk: Vec<usize>,
    /// Estimate a constant too, for channels of which the offsets are not known; without --offset the first value of each is
    /// taken off
    #[arg(long, help_heading = "Model")]
    pub(crate) constant: bool,

    /// How to estimate [default: rls; with C rpem]
    #[arg(long, value_enum, help_heading = "Adaptation")]
    pub(crate) method: Option<TrackMethodArgument>,
    /// What is forgotten, several side by side: none, LAMBDA or exponential:LAMBDA, selective:LAMBDA,
    /// random-walk:VARIANCE, variable:LAMBDA:MINIMUM:NOISE
    #[arg(
        long,
        value_name = "HOW[,HOW…]",
        value_delimiter = ',',
        default_value = "exponential:0.99",
        help_heading = "Adaptation"
    )]
    pub(crate) forgetting: Vec<String>,
    /// How to start: standard (from a wide prior), exact (without prior, once the samples determine the parameters), or
    /// mixed[:SAMPLES] (standard, then blended into exact)
    #[arg(long, value_name = "HOW", help_heading = "Adaptation")]
    pub(crate) start: Option<String>,
    /// Start from a batch fit: the report's orders, parameters, covariance, noise and offsets
    #[arg(
        long,
        value_name = "REPORT",
        conflicts_with_all = ["model", "na", "nb", "nc", "nk"],
        help_heading = "Adaptation"
    )]
    pub(crate) warm: Option<PathBuf>,
    /// Do not adapt where the innovation is smaller than this, in units of the output
    #[arg(long, value_name = "WIDTH", allow_hyphen_values = true, help_heading = "Adaptation")]
    pub(crate) dead_zone: Option<f64>,

    /// Add to each row a forecast of the output so many rows later, inputs held at their last value
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u32).range(1..=10_000), help_heading = "Watch")]
    pub(crate) horizon: Option<u32>,
    /// Watch the innovations for changes of their mean and variance (CUSUM), with so many samples between two false alarms on
    /// average
    #[arg(long, value_name = "SAMPLES", allow_hyphen_values = true, help_heading = "Watch")]
    pub(crate) alarm: Option<f64>,
    /// End at the first alarm, with exit code 7
    #[arg(long, requires = "alarm", help_heading = "Watch")]
    pub(crate) stop_on_alarm: bool,
    #[command(flatten)]
    pub(crate) lines: LineArguments,

    /// Keep the estimator's whole state in a file, and go on from it if it is there
    #[arg(long, value_name = "FILE", help_heading = "State")]
    pub(crate) state: Option<PathBuf>,
    /// Write the state every so many rows, besides at the end, and within 10 s where rows are slow to come
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = clap::value_parser!(u64).range(1..),
        requires = "state", help_heading = "State")]
    pub(crate) save_every: u64,
    /// Where the log stands when the state is taken up again
    #[arg(long, value_enum, default_value = "auto", requires = "state", help_heading = "State")]
    pub(crate) resume: ResumeArgument,

    #[command(flatten)]
    pub(crate) clock: LiveClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

#[derive(Debug, Args)]
pub(crate) struct FilterArguments {
    /// The model: a report of fit, or a TOML file with matrices or equations (- for standard input)
    #[arg(value_name = "MODEL")]
    pub(crate) model: PathBuf,
    /// The log: a CSV file, gzip-compressed or not (- for standard input)
    #[arg(value_name = "LOG")]
    pub(crate) path: PathBuf,

    /// How to estimate [default: kalman for a linear model, else ekf]
    #[arg(long, value_enum, help_heading = "Estimator")]
    pub(crate) estimator: Option<EstimatorArgument>,
    /// Where the model of a report starts [default: unknown]
    #[arg(long, value_enum, value_name = "START", help_heading = "Estimator")]
    pub(crate) initial: Option<FilterStartArgument>,
    /// Where the error of the observer is to have its poles in the z plane, such as 0.4+0.3i,0.4-0.3i
    #[arg(
        long,
        value_name = "POLE[,POLE…]",
        value_delimiter = ',',
        allow_hyphen_values = true,
        conflicts_with = "gain",
        help_heading = "Estimator"
    )]
    pub(crate) poles: Vec<String>,
    /// The gain of the observer: a row for each state, a column for each output, such as 0.5,0;0.1,0.2
    #[arg(long, value_name = "ROW[;ROW…]", allow_hyphen_values = true, help_heading = "Estimator")]
    pub(crate) gain: Option<String>,
    /// Rows to go through, 1-based and inclusive [default: all]
    #[arg(long, value_name = "A..B", help_heading = "Channels")]
    pub(crate) rows: Option<String>,
    /// Add each state given the whole log, later rows too: nothing is written before the log ends, or if Ctrl-C comes first
    #[arg(long, help_heading = "Output")]
    pub(crate) smooth: bool,

    #[command(flatten)]
    pub(crate) lines: LineArguments,
    #[command(flatten)]
    pub(crate) clock: LiveClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

/// Output that grows line by line.
#[derive(Debug, Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct LineArguments {
    /// Write a line for each N-th row only; alarms and gaps of track always have theirs
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) every: u64,
    /// What a line is
    #[arg(long, value_enum, default_value = "jsonl")]
    pub(crate) format: LineFormatArgument,
    /// Write to a file instead of standard output
    #[arg(short = 'o', long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub(crate) out: PathBuf,
    /// A line that is no row of numbers ends the run; without it, it counts as a row of missing values
    #[arg(long)]
    pub(crate) strict: bool,
    /// Write what stands at the end to a file, as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) summary: Option<PathBuf>,
    /// No table at the end
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

/// The clock of a log that is read as it comes.
#[derive(Debug, Args)]
#[command(next_help_heading = "Clock")]
pub(crate) struct LiveClockArguments {
    /// The column of times: seconds, or ISO 8601 dates
    #[arg(long, value_name = "NAME")]
    pub(crate) time: Option<String>,
    /// How times are written, in the manner of strptime, such as %d.%m.%Y %H:%M:%S
    #[arg(long, value_name = "FORMAT", requires = "time")]
    pub(crate) time_format: Option<String>,
    /// Seconds from one row to the next [default: that of the model; for track with --time, the first step]
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    pub(crate) sample_time: Option<f64>,
}

#[derive(Debug, Args)]
pub(crate) struct BodeArguments {
    /// The report that fit wrote (- for standard input)
    #[arg(value_name = "REPORT")]
    pub(crate) report: PathBuf,
    /// Frequencies in radians per second [default: from a thousandth of half the sampling frequency to half of it]
    #[arg(long, value_name = "LOW..HIGH", allow_hyphen_values = true)]
    pub(crate) frequencies: Option<String>,
    /// How many frequencies, each the same factor above the one before
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    pub(crate) points: u32,
    /// Write the CSV to a file instead of standard output
    #[arg(short = 'o', long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub(crate) out: PathBuf,
}

/// What step and impulse share.
#[derive(Debug, Args)]
pub(crate) struct TransientArguments {
    /// The report that fit wrote (- for standard input)
    #[arg(value_name = "REPORT")]
    pub(crate) report: PathBuf,
    /// How many samples, the one at time 0 included [default: until it has settled]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) samples: Option<u32>,
    /// Write the CSV to a file instead of standard output
    #[arg(short = 'o', long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub(crate) out: PathBuf,
}

/// What predict and simulate share.
#[derive(Debug, Args)]
pub(crate) struct RespondArguments {
    /// The report that fit wrote (- for standard input)
    #[arg(value_name = "REPORT")]
    pub(crate) report: PathBuf,
    /// The log: a CSV file, gzip-compressed or not (- for standard input)
    #[arg(value_name = "LOG")]
    pub(crate) path: PathBuf,
    /// Rows to respond to, 1-based and inclusive [default: all]
    #[arg(long, value_name = "A..B[,C..D]", value_delimiter = ',')]
    pub(crate) rows: Vec<String>,
    /// Offsets: the model's own, or none, mean, linear, start:K of the rows responded to
    #[arg(long, default_value = "model", value_name = "WHAT")]
    pub(crate) detrend: String,
    /// Write the CSV to a file instead of standard output
    #[arg(short = 'o', long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub(crate) out: PathBuf,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

#[derive(Debug, Args)]
pub(crate) struct DemoArguments {
    /// The folder to write to
    #[arg(default_value = "thetahat-demo")]
    pub(crate) folder: PathBuf,
}

/// A list of names, written as the header of a CSV with commas is.
#[derive(Debug, Clone)]
pub(crate) struct Names(Vec<String>);

impl FromStr for Names {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        table::names(text).map(Self)
    }
}

impl Names {
    /// The names of all lists; none if there is no list.
    pub(crate) fn all(lists: &[Self]) -> Option<Vec<String>> {
        (!lists.is_empty()).then(|| lists.iter().flat_map(|Self(names)| names).cloned().collect())
    }
}

/// How a log is written.
#[derive(Debug, Args)]
pub(crate) struct LogArguments {
    /// What separates fields: a character, or tab [default: recognised among comma, semicolon and tab]
    #[arg(long, value_name = "CHAR", help_heading = "Log format")]
    pub(crate) delimiter: Option<String>,
    /// Numbers have a decimal comma
    #[arg(long, help_heading = "Log format")]
    pub(crate) decimal_comma: bool,
    /// The first row is data; columns are called 1, 2, …
    #[arg(long, help_heading = "Log format")]
    pub(crate) no_header: bool,
    /// Leave out so many rows below the header, such as a row of units
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        hide_default_value = true,
        help_heading = "Log format"
    )]
    pub(crate) skip_rows: usize,
    /// Lines that start with this character are comments
    #[arg(long, value_name = "CHAR", help_heading = "Log format")]
    pub(crate) comment: Option<String>,
    /// One more word that stands for a missing value, besides empty fields, NaN, NA, N/A and null
    #[arg(long, value_name = "TOKEN", allow_hyphen_values = true, help_heading = "Log format")]
    pub(crate) missing: Vec<String>,
    /// The text's encoding, such as latin1 [default: UTF-8, or what a byte-order mark says]
    #[arg(long, value_name = "NAME", help_heading = "Log format")]
    pub(crate) encoding: Option<String>,
}

/// The log's clock.
#[derive(Debug, Args)]
pub(crate) struct ClockArguments {
    /// The column of times: seconds, or ISO 8601 dates
    #[arg(long, value_name = "NAME", conflicts_with = "sample_time", help_heading = "Clock")]
    pub(crate) time: Option<String>,
    /// How times are written, in the manner of strptime, such as %d.%m.%Y %H:%M:%S
    #[arg(long, value_name = "FORMAT", help_heading = "Clock")]
    pub(crate) time_format: Option<String>,
    /// Seconds from one row to the next [default: 1, so that times count rows]
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, help_heading = "Clock")]
    pub(crate) sample_time: Option<f64>,
    /// Put a log on another clock: a step in seconds, and how values between samples are read. A step of two recorded ones or
    /// more is filtered against aliasing first, unless :unfiltered is added or the clock is irregular
    #[arg(
        long,
        value_name = "STEP:hold|linear[:unfiltered]",
        allow_hyphen_values = true,
        help_heading = "Clock"
    )]
    pub(crate) resample: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum DocumentArgument {
    /// What fit writes
    Report,
    /// What validate writes
    Validation,
    /// What compare writes
    Comparison,
    /// What inspect writes
    Inspection,
    /// What track writes at its end
    Track,
    /// What filter writes at its end
    Filter,
    /// What fit --grey writes
    Greybox,
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
    Pem,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PathArgument {
    /// Every combination of orders
    All,
    /// One order up at a time, each in its turn
    Alternate,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SelectArgument {
    /// Rissanen's minimum description length
    Mdl,
    /// Akaike's information criterion
    Aic,
    /// The same, corrected for few samples
    Aicc,
    /// Akaike's final prediction error
    Fpe,
    /// The smallest model within 1 % of the least cost on the validation rows
    Validation,
    /// The same by cross-validation over five blocks in time
    Cv,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum InitialArgument {
    /// drop without F; with F estimate where rows stand before, or it is worth its parameters, else zero
    Auto,
    /// What was measured before; where nothing was, samples without a full regressor are left out (models without F)
    Drop,
    /// Zeros
    Zero,
    /// What was measured before, and what fits best, found with the parameters (models with F)
    Estimate,
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
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum StartArgument {
    /// What the model needs: drop where that is all, else estimate; zero where the log has no output
    Auto,
    /// Nothing: measured samples before the rows, or the first rows, which then do not count
    Drop,
    /// Zeros before the first sample
    Zero,
    /// The initial condition that fits best
    Estimate,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TrackModelArgument {
    /// A y = B u + e
    Arx,
    /// A y = B u + C e
    Armax,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TrackMethodArgument {
    /// Recursive least squares (arx)
    Rls,
    /// Extended least squares (armax): quick, and not always right
    Els,
    /// Recursive prediction error method (armax)
    Rpem,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FilterStartArgument {
    /// At rest: the channels are at their offsets
    Zero,
    /// Anywhere: the first rows tell
    Unknown,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum EstimatorArgument {
    /// The Kalman filter (linear models)
    Kalman,
    /// The extended Kalman filter; unknown parameters are estimated with the state
    Ekf,
    /// The Luenberger observer, with --poles or --gain
    Luenberger,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LineFormatArgument {
    /// JSON Lines: an object a line
    Jsonl,
    /// CSV: a row a line, below a header
    Csv,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ResumeArgument {
    /// A file from its start; standard input from its start if its first row is the first one of the state, else now
    Auto,
    /// From the start: rows that the state has absorbed are skipped
    Start,
    /// A live pipe that has moved on: what came in between is a gap
    Now,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatArgument {
    Table,
    Json,
}
