//! The table of the options of a fit.

use thetahat_numerics::optimize::Algorithm;

use super::words::{
    CoupleWord, CurveWord, DelayRange, FeedthroughWord, KernelWord, LikelihoodWord, MapWord, MethodWord,
    ModelWord, NormOption, OrderOption, SeasonalOption, StepOption,
};
use crate::data::{Detrend, Prefilter, Rows, Split};
use crate::estimate::{BlockStructure, Bound, Constant, GainBound, Initial, Refine, Weighting};
use crate::model::{Membership, ProcessStructure};
use crate::options::{ColumnName, Kind, NamedValue, Options, options};
use crate::select::{Focus, OrderRange, Path, Select};

const CHANNELS: &str = "Channels";
const MODEL: &str = "Model";
const SEASONS: &str = "Seasonal ARIMA (`model` arima)";
const STATES: &str = "State space (`model` ss)";
const NARX: &str = "Nonlinear ARX";
const BLOCKS: &str = "Blocks";
const CHOICE: &str = "Choice (orders that are ranges, or not given)";
const SEARCH: &str = "Search (models with C, D or F, in equations, and trained)";
const CRITERION: &str = "Criterion (all but `norm` for models without C, D and F)";

const A: Kind = Kind::ARIMA;
const P: Kind = Kind::POLYNOMIAL;
const I: Kind = Kind::IMPULSE_RESPONSE;
const S: Kind = Kind::STATE_SPACE;
const V: Kind = Kind::VECTOR_ARX;
const C: Kind = Kind::PROCESS;
const N: Kind = Kind::NONLINEAR_ARX;
const B: Kind = Kind::BLOCKS;
const E: Kind = Kind::EQUATIONS;
const R: Kind = Kind::RESPONSE;
const Q: Kind = Kind::RESPONSE_STATES;

options! {
    /// The options of a fit, as they were given: a plan.
    ///
    /// It is written as a JSON object of those that were given. A reader takes numbers and texts, lists of them, and
    /// objects where values have names.
    ///
    /// ```
    /// use thetahat::plan::FitOptions;
    ///
    /// let plan: FitOptions = serde_json::from_str(r#"{"model": "arx", "na": 2, "nb": "1..3", "offset": {"u": 4.5}}"#)?;
    /// assert_eq!(plan.na.unwrap().single(), Some(2));
    /// assert_eq!(serde_json::to_string(&plan)?, r#"{"offset":{"u":4.5},"model":"arx","na":2,"nb":["1..3"]}"#);
    ///
    /// let wrong = serde_json::from_str::<FitOptions>(r#"{"detrned": "mean"}"#).unwrap_err();
    /// assert!(wrong.to_string().contains("did you mean 'detrend'?"));
    /// # Ok::<(), serde_json::Error>(())
    /// ```
    FitOptions of "a fit" {
        /// Input columns; a name that holds a comma stands between double quotes, as in CSV
        input: Vec<ColumnName>, "NAME[,NAME…]", "u, u1, u2, …", CHANNELS, [P I S V C N B R A Q];
        /// Output column; with `model` ss, `model` arx and `narx` one or more
        output: Vec<ColumnName>, "NAME[,NAME…]", "y", CHANNELS, [P I S V C N B A R Q];
        /// Rows to estimate on, 1-based and inclusive, counted through all logs
        estimate: Vec<Rows>, "A..B[,C..D]", "all", CHANNELS, [P I S V C N B E A];
        /// Rows to validate on
        validate: Vec<Rows>, "A..B[,C..D]", "", CHANNELS, [P I S V C N B E A];
        /// What to subtract from each channel before the fit: none, mean, linear, or start:K (the mean of the first K
        /// rows); `constant` and `trend` estimate the remaining level and slope of the output
        detrend: Option<Detrend>, "WHAT", "mean", CHANNELS, [P I S V N];
        /// Set a channel's offset by hand
        offset: Vec<NamedValue>, "NAME=VALUE", "", CHANNELS, [P I S V C N];
        /// Fit in a band of frequencies in Hz, either end of which may be left out: inputs and output go through the
        /// same Butterworth filter; the model and its figures are those of the unfiltered signals
        prefilter: Option<Prefilter>, "LOW..HIGH", "", CHANNELS, [P I];
        /// The model structure
        model: Option<ModelWord>, "MODEL", "arx; without orders the data choose; with several outputs and no orders ss", MODEL,
            [P I S V C R A Q];
        /// Coefficients of A: past outputs
        na: Option<OrderRange>, "N|A..B", "", MODEL, [P V];
        /// Which past outputs each output of an ARX model depends on: full, those of all outputs; none, its own; auto,
        /// those with the least MDL
        couple: Option<CoupleWord>, "COUPLE", "auto", MODEL, [V];
        /// Coefficients of B: inputs; one value for each input or one for all, 0 for a model without inputs
        nb: Vec<OrderRange>, "N|A..B[,…]", "", MODEL, [P S V];
        /// Coefficients of C: past disturbances
        nc: Option<OrderRange>, "N|A..B", "", MODEL, [P];
        /// Coefficients of D, the denominator of the noise
        nd: Option<OrderRange>, "N|A..B", "", MODEL, [P];
        /// Coefficients of F, the denominator from an input alone; one value for each input or one for all
        nf: Vec<OrderRange>, "N|A..B[,…]", "", MODEL, [P];
        /// The delay in samples from the input to its first effect, one value for each input or one for all; 0: the
        /// input acts in the same sample
        nk: Vec<DelayRange>, "N|A..B[,…]", "1, arima 0; without orders the data choose", MODEL, [P I S V N B A Q];
        /// Taps of an impulse response (`model` fir): g(nk), g(nk+1), …; one value for each input or one for all
        taps: Vec<usize>, "N[,…]", "", MODEL, [I];
        /// The prior of an impulse response (`model` fir): that it decays and is smooth
        kernel: Option<KernelWord>, "KERNEL", "dc", MODEL, [I];
        /// The structure of a process in continuous time (`model` process): p and the number of lags, then d for a dead
        /// time, z for a zero, i for an integrator, u for two lags that may be underdamped; or rc1, rc2, rc3 for
        /// parallel lags with a direct term, as in batteries. One for each input or one for all; the clock may be
        /// irregular
        structure: Vec<ProcessStructure>, "p1d|p2du|rc2|…[,…]", "", MODEL, [C R];
        /// Poles of a transfer function in continuous time (`model` tf), 1 to 6; one number for each input or one for
        /// all; the clock may be irregular
        np: Vec<usize>, "N[,…]", "", MODEL, [C R];
        /// Zeros of the transfer function, no more than poles; one number for each input or one for all
        nz: Vec<usize>, "N[,…]", "one less than poles", MODEL, [C R];
        /// Estimate a dead time of each input too
        delay: bool, "", "", MODEL, [C R];
        /// The estimation method
        method: Option<MethodWord>, "METHOD", "pem", MODEL, [P I];
        /// The likelihood to maximise, conditional on the first samples or that of all samples (exact), which continues
        /// through missing outputs (models without D and F)
        likelihood: Option<LikelihoodWord>, "LIKELIHOOD", "conditional", MODEL, [P I];
        /// The initial condition of each segment
        initial: Option<Initial>, "INITIAL", "auto", MODEL, [P I S V C];
        /// What the model is for: prediction (errors one step ahead), simulation (free runs, driven by the inputs
        /// alone), or a number of steps ahead. auto: prediction; without orders simulation if a model for it has a
        /// clearly better free run on held-out rows; for networks and rbf-free simulation where there are inputs
        focus: Option<Focus>, "auto|prediction|simulation|K", "auto", MODEL, [P I S V N];
        /// Estimate the level of the output with the parameters, in addition to the mean that is subtracted: for step
        /// tests and other logs whose mean is not the operating point of the plant. Of arima, which subtracts no mean:
        /// auto is yes without differences, and no with them
        constant: Option<Constant>, "CONSTANT", "auto", MODEL, [P I S V A];
        /// Estimate a slope and the level of the output with the parameters: for drift; of arima with one difference
        /// the drift alone
        trend: bool, "", "", MODEL, [P I C A];
        /// p,d,q of a seasonal ARIMA model (`model` arima): autoregressive parameters, differences and parameters of
        /// the moving average. The number of states (`model` ss), or a range, from which the least MDL is chosen
        order: Option<OrderOption>, "p,d,q|N|A..B", "of states 1..20, with `blocks` 1..3", SEASONS, [S A Q B];
        /// The same over seasons, and the rows that a season has: P,D,Q,s. Inputs, if `input` names any, act on the
        /// output in the same row unless `nk` says otherwise, and all else is the noise
        seasonal: Option<SeasonalOption>, "P,D,Q,s", "no seasons", SEASONS, [A];
        /// Past samples from which the states are computed
        past: Option<usize>, "P", "the number with the least AIC, 40 at most", STATES, [S];
        /// Future samples that the states predict
        future: Option<usize>, "S", "as many as past ones", STATES, [S];
        /// The subspace method: ssarx, which is consistent in closed loop too; or moesp, n4sid, cva, which project on
        /// future inputs
        weighting: Option<Weighting>, "METHOD", "ssarx", STATES, [S];
        /// Whether inputs act on the outputs in the same sample. auto: if that lowers MDL and no feedback from the
        /// outputs to the inputs is found
        feedthrough: Option<FeedthroughWord>, "FEEDTHROUGH", "auto", STATES, [S Q];
        /// Refine the model of the subspace method by a search for the least errors one step ahead (prediction) or of
        /// the free run (simulation): poles, gains and responses then have standard errors
        refine: Option<Refine>, "prediction|simulation", "", STATES, [S];
        /// Fit y(k) = g(past outputs and inputs) + e(k): with functions that are chosen one by one, each as the one
        /// that explains most of the remaining errors, or with a network or radial basis functions that are trained
        narx: Option<MapWord>, "MAP", "", NARX, [P N];
        /// Past outputs that g reads: y(k-1), …, y(k-N); one number for each output or one for all
        ny: Vec<usize>, "N[,…]", "2; with auto also as the linear model that the data choose", NARX, [N];
        /// Values of each input that g reads, from `nk` on: u(k-nk), …; one number for each input or one for all
        nu: Vec<usize>, "N[,…]", "2", NARX, [N];
        /// A further argument of g, an expression of channels such as 'sqrt(u)', at the lags of the channels in it; may
        /// be repeated
        regressor: Vec<String>, "EXPRESSION", "", NARX, [N];
        /// The largest number of factors of a product (poly), or the degree of curves (`curve` poly)
        degree: Option<usize>, "D", "2, of curves 3", NARX, [N B];
        /// The number of functions in the model
        terms: Option<usize>, "N",
            "as `select` says, by the free run on validation rows, or on blocks of the estimation rows", NARX, [N];
        /// A product of the model, as a report writes it (poly): 1, y(k-1) or 'y(k-1)^2*u(k-1)'; may be repeated.
        /// Without it products are chosen
        term: Vec<String>, "PRODUCT", "", NARX, [N];
        /// How many functions to evaluate
        most_terms: Option<usize>, "N", "40, and 10 local models", NARX, [N];
        /// The centres of radial basis functions (rbf): chosen among the samples, at the means of N clusters, at a grid
        /// of N in each direction, or at N pseudo-random points
        centres: Option<String>, "chosen|kmeans:N|grid:N|random:N", "chosen", NARX, [N];
        /// sigma of radial basis functions exp(-|z - centre|^2/sigma^2), z in standard deviations
        width: Option<f64>, "SIGMA", "so that neighbours overlap", NARX, [N];
        /// Leave out the constant and the regressors themselves beside radial basis functions (rbf); constants in place
        /// of planes (local), or means (knn)
        no_linear: bool, "", "", NARX, [N];
        /// How local models share the space of the regressors (local)
        membership: Option<Membership>, "SHAPE", "gaussian", NARX, [N];
        /// Units of a network (tanh, logistic, relu), centres (rbf-free), local models (local) or neighbours (knn);
        /// bends of each regressor (spline), 5 if not said; units that are drawn (step, `drawn`), 100 if not said
        units: Option<usize>, "N", "chosen", NARX, [N];
        /// Draw the weights of the hidden layer of a network, and choose among its units (tanh, logistic, relu); else
        /// they are trained. Those of step are always drawn
        drawn: bool, "", "", NARX, [N];
        /// Keep signals in their own units; without it each is divided by its standard deviation
        raw_terms: bool, "", "", NARX, [N];
        /// Fit linear systems and static curves that follow one another, for the least errors of the free run; the
        /// report is one of a model in equations
        blocks: Option<BlockStructure>, "STRUCTURE", "", BLOCKS, [B];
        /// The form of static curves
        curve: Option<CurveWord>, "FORM", "lines, of a feedback poly", BLOCKS, [B];
        /// Knots of curves of lines
        knots: Option<usize>, "N", "chosen", BLOCKS, [B];
        /// Which models of the ranges are compared
        path: Option<Path>, "PATH", "all", CHOICE, [P];
        /// The criterion of the choice
        select: Option<Select>, "CRITERION", "mdl", CHOICE, [P N];
        /// Cut the rows in time order into parts: models are fitted to the first and compared, the chosen one is fitted
        /// again to the first two and evaluated on the third; 0 for no such part
        split: Option<Split>, "E/V/T", "", CHOICE, [P I S V C N B E A];
        /// The search algorithm
        search: Option<Algorithm>, "HOW", "lm", SEARCH, [P S C N B E R A Q];
        /// The largest number of iterations from each start
        max_iterations: Option<usize>, "N", "100, with `narx` 500", SEARCH, [P S C N B E R A Q];
        /// Stop where the next step would lower the cost by less than this fraction
        tolerance: Option<f64>, "FRACTION", "1e-8", SEARCH, [P S C N B E R A Q];
        /// Step length of the gradient search: C1, or C1/(C2 + l) in iteration l
        step: Option<StepOption>, "C1[,C2]", "1", SEARCH, [P S C N B E R Q];
        /// Search from this many further starts
        starts: Option<usize>, "K", "0, with `narx` 4, with `grey` some where the first one fails", SEARCH, [P C N E R];
        /// Add intervals of 95 % by profile likelihood, which know bounds and curvature; some twenty searches for each
        /// parameter
        profile: bool, "", "", SEARCH, [E];
        /// The seed of random starts and of random centres
        seed: Option<u64>, "S", "0", SEARCH, [P N E];
        /// After this time begin no iteration and no search from a further start
        time_limit: Option<f64>, "SECONDS", "", SEARCH, [P S C N B E R A Q];
        /// The norm of the errors to minimise: 2, the sum of squares; 1, the sum of absolute values, which is robust to
        /// outliers; huber or huber:K, squares up to K times the scale of the errors and absolute values beyond (K =
        /// 1.345 by default); inf, the largest error
        norm: Option<NormOption>, "2|1|huber[:K]|inf", "2", CRITERION, [P I];
        /// Keep a parameter in a range, either end of which may be left out, or at a value (a1=0.5)
        bound: Vec<Bound>, "NAME=LOW..HIGH", "", CRITERION, [P I];
        /// Keep the static gain from an input in a range, or at a value
        dc_gain: Vec<GainBound>, "[INPUT=]G|LOW..HIGH", "", CRITERION, [P I];
        /// Ridge regression, which keeps parameters small: its weight, as a number of further samples with output 0
        ridge: Option<f64>, "SAMPLES", "0", CRITERION, [P I N];
        /// A bound that no error may exceed, in units of the output; finds the box of all parameters that satisfy it
        noise_bound: Option<f64>, "E", "", CRITERION, [P I];
    }
}

impl FitOptions {
    /// The names of input channels that were given, if any were.
    pub fn inputs(&self) -> Option<Vec<String>> {
        ColumnName::all(&self.input)
    }

    /// The names of output channels that were given.
    pub fn outputs(&self) -> Vec<String> {
        self.output.iter().map(|name| name.0.clone()).collect()
    }

    /// The first of some options that was given, by its field.
    pub(crate) fn first_given(&self, fields: &[&str]) -> Option<String> {
        let given = self.given();
        given.iter().find(|(option, _)| fields.contains(&option.field)).map(|(option, _)| option.name())
    }
}
