//! The syntax of the command line, a file a verb, and nothing else. `job` says what it means.

mod closed_loop;
mod control;
mod convert;
mod design;
mod each;
mod export;
mod files;
mod filter;
mod fit;
mod inspect;
mod lines;
mod log;
mod model;
mod options;
mod reduce;
mod respond;
mod spectrum;
mod step;
mod templates;
mod track;
mod tune;
mod validate;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

pub(crate) use closed_loop::ClosedLoopArguments;
pub(crate) use control::{ControlArguments, IntegratorArgument};
pub(crate) use convert::ConvertArguments;
pub(crate) use design::DesignArguments;
pub(crate) use each::EachArguments;
pub(crate) use export::ExportArguments;
pub(crate) use files::template_name;
pub(crate) use filter::{EstimatorArgument, FilterArguments, FilterStartArgument, NoiseArgument};
pub(crate) use fit::FitArguments;
pub(crate) use inspect::InspectArguments;
pub(crate) use lines::{LineArguments, LineFormatArgument};
pub(crate) use log::{ClockArguments, LiveClockArguments, LogArguments, Names};
pub(crate) use model::ModelArguments;
pub(crate) use options::OptionArguments;
pub(crate) use reduce::ReduceArguments;
pub(crate) use respond::{
    BodeArguments, PredictArguments, RespondArguments, SimulateArguments, StartArgument, TransientArguments,
};
pub(crate) use spectrum::{ResponseFormatArgument, SpectrumArguments};
pub(crate) use step::StepArguments;
pub(crate) use templates::{TemplateOptionArguments, TemplatesArguments};
pub(crate) use track::{ResumeArgument, TrackArguments};
pub(crate) use tune::{ControllerArgument, TuneArguments};
pub(crate) use validate::{CompareArguments, EvaluationArguments, ValidateArguments};

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
    /// Fits A(q) y(t) = B(q)/F(q) u(t - nk) + C(q)/D(q) e(t): by least squares where that is linear in the parameters,
    /// else by an iterative search for the least sum of squared prediction errors. Without orders, delay, structure and
    /// orders are chosen from the data; orders may also be ranges. Prints a table and writes a JSON report. Several
    /// logs are several experiments with one plant: rows are numbered through all logs, and lags do not cross from one
    /// log into the next.
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
  thetahat fit --grey template:room log.csv --columns temperature=y,heater=u
  thetahat fit log.csv --na 2 --nb 2 --norm 1 --bound a1=-1.9..0 --dc-gain 1..20
  thetahat fit log.csv --model oe --nb 2 --nf 2 --norm huber")]
    Fit(Box<FitArguments>),
    /// Check a log before a fit
    ///
    /// Prints for each channel its range, mean and trend, missing and repeated values, rounding, saturation and
    /// outliers; for the clock its step and jitter; for each input its excitation, its delay and whether it follows the
    /// output (feedback). Ends with warnings and a command line of thetahat fit that suits the log. Without -u and -y
    /// it inspects all columns of numbers.
    #[command(after_help = "\
Examples:
  thetahat inspect log.csv --sample-time 0.08
  thetahat inspect log.csv --time t -u heater -y temperature --format json -o inspection.json")]
    Inspect(Box<InspectArguments>),
    /// Estimate the frequency response from a log, without a model
    ///
    /// From each input to the output, with coherence, the spectrum of the noise and 95 % bands: by local polynomials,
    /// by windowed covariances (Blackman and Tukey), by averages over windows (Welch), as the plain ratio of the
    /// transforms, or for sines by correlation over whole periods. Warns where the bands cannot be trusted, where an
    /// input has no power, and if an input follows the output. Several logs are several experiments with one plant.
    #[command(after_help = "\
Examples:
  thetahat spectrum log.csv --sample-time 0.08
  thetahat spectrum log.csv --method spa --lags 30 --frequencies 0.1..3 --format csv > response.csv
  thetahat spectrum log.csv --format json -o response.json --html response.html")]
    Spectrum(Box<SpectrumArguments>),
    /// Predict a log some steps ahead with a fitted model
    ///
    /// Writes CSV: time or row, measured, predicted and the standard deviation of its error, that of the parameters
    /// included, in the log's own units. The fit figures go to standard error. Rows at the end that have inputs but no
    /// output are forecast, each as many steps ahead as it lies after the last measured one; a series without inputs is
    /// forecast beyond the end of the log.
    #[command(after_help = "\
Examples:
  thetahat predict model.json log.csv --horizon 5 > predicted.csv
  thetahat predict model.json log.csv --rows 900..1000 --horizon 20 -o forecast.csv")]
    Predict(PredictArguments),
    /// Simulate a fitted model on a log's inputs (free run)
    ///
    /// Writes CSV: time or row, measured, predicted, in the log's own units. The fit figures go to standard error.
    /// Without the output column, the run starts from zero. With --draws there are three more columns: mean,
    /// quantile_0.025 and quantile_0.975 of runs with noise and with parameters drawn from their covariance.
    #[command(after_help = "\
Examples:
  thetahat simulate model.json log.csv --rows 501..1000 > simulated.csv
  thetahat simulate model.json log.csv --draws 1000 --seed 1 > bands.csv")]
    Simulate(SimulateArguments),
    /// Validate a model on a log and test its residuals
    ///
    /// Prints the fit 1 step ahead, some steps ahead and of a free run; tests the residuals for whiteness (Ljung and
    /// Box, Anderson) and for independence of past inputs, and warns of feedback; compares the noise with that of the
    /// model, and the coverage of the prediction intervals with their level. With --require the exit code is 6 if the
    /// model does not meet the requirements.
    #[command(after_help = "\
Examples:
  thetahat validate model.json log.csv --rows 501..1000
  thetahat validate model.json log.csv --require 'independent,stable,fit>=50,fit@5>=50'
  thetahat validate model.json log.csv --format json --horizon 1,10 --lags 40 > validation.json")]
    Validate(ValidateArguments),
    /// Compare several fitted models on a log
    ///
    /// Prints the figures of validate, a column for each model, and the smallest alpha at which a fraction alpha of the
    /// correlations, or more, lies outside the band of that level (Anderson): it ranks models by the whiteness of their
    /// residuals, but is no test.
    #[command(after_help = "\
Example:
  thetahat compare model.json model.json log.csv --rows 501..1000")]
    Compare(CompareArguments),
    /// Identify a plant while it runs: a line for each sample of a log or a live pipe
    ///
    /// Recursive least squares for A(q) y(t) = B(q) u(t - nk) + e(t), and its extension by C(q) e(t). Each line has the
    /// one-step prediction made before the sample, its innovation, and the parameters after it. Ends with a table on
    /// standard error. Runs until the log or the pipe ends, or until Ctrl-C or SIGTERM; memory does not grow.
    #[command(after_help = "\
Examples:
  thetahat track log.csv --na 2 --nb 2 --nk 3 --format csv > parameters.csv
  tail -n +1 -F log.csv | thetahat track - --na 2 --nb 2 --alarm 10000 --state track.json
  thetahat track log.csv --na 2 --nb 2 --forgetting 1,0.99,0.95 --every 100
  thetahat track log.csv --warm model.json --horizon 5")]
    Track(Box<TrackArguments>),
    /// Estimate the state of a model along a log or a live pipe
    ///
    /// MODEL is a report of fit, or a text file (TOML) with the matrices F, G, H, Q, R, or with the equations of a
    /// plant, of which unknown parameters are estimated together with the state. Each line has the states as predicted
    /// from the rows before and as corrected by this one, with standard deviations (_sd); each output as measured and
    /// as predicted, and the innovation; the normalised innovation squared (nis) and the bounds between which it lies
    /// in 95 % of the rows; and held, the inputs that are missing in this row. An observer has predicted states only.
    /// Ends with a table on standard error.
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
since the first row) and, in [next], dt (seconds of this step); limits sat(x, low, high) and dead zones dead(x, low, high);
tables table(x; 0:1, 2:5, 3:6), by monotone cubics, and lines(x; 0:1, 2:5), by straight lines, held beyond the ends, whose
values may be parameters; branches if a > b then c else d, with and, or, not between comparisons. 'within' makes a branch or a
limit smooth over a width: if a > b within 0.1 then c else d, sat(x, 0, 1 within 0.1). The process noise grows with the
square root of dt.")]
    Filter(Box<FilterArguments>),
    /// The frequency response of a fitted model
    ///
    /// Writes CSV with a row for each input and frequency, and for the noise (input "noise"): input, frequency [rad/s],
    /// magnitude [units of the output per unit of the input] and its standard error, phase [degrees] and its standard
    /// error. With --over the models are compared with a measured response: at each of its points its magnitude and
    /// phase, those of the model, and whether the model lies outside of the 95 % region of their difference.
    #[command(after_help = "\
Examples:
  thetahat bode model.json --frequencies 0.01..3 --points 200 > bode.csv
  thetahat bode model.json --over response.json --html bode.html > over.csv")]
    Bode(BodeArguments),
    /// Evaluate a step test, or compute the step response of a fitted model
    ///
    /// In a log it finds the steps of the input and reads off each response the figures of a step test, each with its
    /// standard error: gain, dead time, time constant (tangent, 63.2 %, two points, t-bar plain and weighted), rise and
    /// settling time, and for an overshoot damping, period and natural frequency. Marks those to trust. From the
    /// document of spectrum it takes the time constant at the frequency where the phase is -45 degrees. For a report it
    /// writes CSV with a row for each input and time: input, time [s], value [units of the output per unit of the
    /// input] and its standard error; the input is 1 from time 0 on, and all is at rest before.
    #[command(after_help = "\
Examples:
  thetahat step steps.csv --time t -u heater -y temperature
  thetahat step model.json --samples 200 > step.csv
  thetahat step model.json --impulse --html impulse.html > impulse.csv")]
    Step(Box<StepArguments>),
    /// The impulse response of a fitted model
    ///
    /// Writes CSV with a row for each input and time: input, time [s], value [units of the output per unit of the
    /// input] and its standard error. The input is 1 in the sample at time 0 and 0 afterwards; all is at rest before.
    /// The values are the coefficients g_i of B(q)/(A(q) F(q)) = g_0 + g_1 q^-1 + …
    #[command(after_help = "\
Example:
  thetahat impulse model.json --samples 50 > impulse.csv")]
    Impulse(TransientArguments),
    /// Reduce the order of a fitted model
    ///
    /// By balanced truncation. Without --order it prints the Hankel singular values, which say how much each state
    /// contributes from the inputs to the outputs, and for each number of states a bound of the error of the frequency
    /// response if only these states are kept. With --order it writes the report of the reduced model, which all verbs
    /// accept.
    #[command(after_help = "\
Examples:
  thetahat reduce model.json
  thetahat reduce model.json --order 1 -o reduced.json")]
    Reduce(ReduceArguments),
    /// A fitted model at another sample time, or in continuous time
    ///
    /// With zoh and foh by the logarithm of the transition matrix, so that the response of the model at its sample
    /// times does not change; tustin maps any poles but warps frequencies. Poles at 0 or negative real ones have no
    /// counterpart in continuous time: they are named, and only whole multiples of the sample time are possible. Delays
    /// are removed before the conversion, and with zoh they may be any fraction of a sample. Models of polynomials, in
    /// state space and of processes become models in state space. A model in continuous time works with any log: the
    /// verbs sample it at the times of the log.
    #[command(after_help = "\
Examples:
  thetahat convert model.json --to continuous
  thetahat convert model.json --to 0.5 -o slower.json
  thetahat convert model.json --to continuous --hold tustin -o continuous.json")]
    Convert(ConvertArguments),
    /// A model whose numbers are known, as a report that all verbs take
    ///
    /// Of polynomials in rising powers of q^-1 (zeros at the beginning of B are samples that the input waits), of
    /// transfer functions in falling powers of z or s, or of matrices. Nothing is estimated: there are no standard
    /// errors and no figures of a fit. predict, simulate, validate, compare, filter, step, bode, reduce, convert,
    /// control and export take the report as they take that of fit.
    #[command(after_help = "\
Examples:
  thetahat model --b 0,1 --f 1,-0.9 --sample-time 1 --report model.json
  thetahat model --num 3 --den 10,1 --delay 2 -u heater -y temperature --report model.json
  thetahat model --state-matrix '0.9,0.1;0,0.8' --input-matrix '0;1' --output-matrix 1,0 --sample-time 0.1")]
    Model(Box<ModelArguments>),
    /// PI and PID settings for a fitted process, and the closed loop that they give
    ///
    /// By SIMC (Skogestad 2003) and by lambda tuning, from a process that fit --structure found. Prints the settings
    /// and the figures of the loop with the fitted process: steps of the set point and of the load, Ms, gain and phase
    /// margin, and the worst Ms within the 95 % intervals of the parameters.
    #[command(after_help = "\
Examples:
  thetahat tune heater.json
  thetahat tune heater.json --lambda 30 --controller pi --html loop.html --responses loop.csv")]
    Tune(TuneArguments),
    /// A controller for a fitted model, and the closed loop that it gives
    ///
    /// R u = T u_c - S y with placed poles (--poles), by a linear-quadratic measure (--lqr) or of minimum variance, for
    /// one input and one output of any linear model. Prints the coefficients and the figures of the loop with the
    /// model: its poles, a step of the set point, Ms, margins, the standard deviations of output and input caused by
    /// the noise of the model, and how many models drawn from the covariance of the parameters give a stable loop.
    #[command(after_help = "\
Examples:
  thetahat control model.json --poles 0.8,0.7
  thetahat control model.json --lqr 0.1 --limits 0..100 --document controller.json
  thetahat control model.json --minimum-variance --integrator no")]
    Control(Box<ControlArguments>),
    /// A fitted model as source code for firmware: Rust, or C99
    ///
    /// The code needs no heap and no further data: it includes offsets and scales, so that signals are in the units of
    /// the log. It starts at rest at the offsets. With a log it comes with a test vector: a CSV of inputs, outputs and
    /// expected results, and a program that runs along it. If a model cannot be exported as --what says, the message
    /// names what is possible.
    #[command(after_help = "\
Examples:
  thetahat export model.json log.csv --to c --what predictor -o firmware
  thetahat export model.json --to rust --what simulator --precision f64 --name motor")]
    Export(Box<ExportArguments>),
    /// Design a test signal for an experiment, or compare signals for a model, and how long they have to be
    ///
    /// Writes CSV: time and the input, or the inputs u1, u2, …. The figures of the signal go to standard error: its
    /// period, mean, crest factor, order of persistent excitation (a constant has 1, a sinusoid 2) and the band of its
    /// power. With --for it compares signals: the standard errors of the model's figures that each would give, if model
    /// and noise are right, and how many samples are needed for the standard errors of --want.
    #[command(after_help = "\
Examples:
  thetahat design --signal prbs:4 --length 2000 --range 20..60 > input.csv
  thetahat design --signal multisine --band 0.1..10 --sample-time 0.08 --length 1024 -o input.csv
  thetahat design --for model.json --want 'dc-gain:2%,a1:0.01'
  thetahat design --for model.json --signal prbs,prbs:4,steps --length 500")]
    Design(Box<DesignArguments>),
    /// Plants that are ready for fit --grey template:NAME: what each wants and finds
    ///
    /// Without a name it lists them; with one it prints the columns that it wants, with their units, the numbers that
    /// it takes as known and the parameters that it finds. With logs it writes the model as a text (TOML), with start
    /// values that are found from them: change it, and fit it with --grey.
    #[command(after_help = "\
Examples:
  thetahat templates
  thetahat templates battery
  thetahat templates room log.csv --columns temperature=y,heater=u > room.toml")]
    Templates(Box<TemplatesArguments>),
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
        /// The document: what fit, validate, compare, inspect, spectrum, step, tune, control, track, filter or design
        /// writes, or the normal equations of a piece of the data
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
pub(crate) struct DemoArguments {
    /// The folder to write to
    #[arg(default_value = "thetahat-demo")]
    pub(crate) folder: PathBuf,
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
    /// What inspect writes of a log of topics without names of columns
    Topics,
    /// What spectrum writes
    Response,
    /// What step writes of a log
    Step,
    /// What tune writes
    Tuning,
    /// What control writes
    Control,
    /// What track writes at its end
    Track,
    /// What filter writes at its end
    Filter,
    /// What design writes for a model
    Design,
    /// The options of a fit, as --plan reads them
    Plan,
    /// What normal equations are written as, in Python and in the crate
    NormalEquations,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatArgument {
    Table,
    Json,
}
