//! The values of the options of a fit: words, each with what it means, and what has a notation of its own.

use thetahat_numerics::optimize::Algorithm;

use crate::data::{Prefilter, Split};
use crate::estimate::{BlockStructure, Bound, Constant, GainBound, Initial, Loss, Refine, Weighting};
use crate::model::{Membership, ProcessStructure};
use crate::options::{Form, Kind, OptionText, Word, none_of, texts, words};
use crate::select::{Focus, OrderRange, Path, Select};

/// The structure of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ModelWord {
    /// A y = B u + e.
    Arx,
    /// A y = B u + C e.
    Armax,
    /// A y = C e.
    Arma,
    /// A y = e.
    Ar,
    /// y = B/F u + e.
    Oe,
    /// y = B/F u + C/D e.
    Bj,
    /// A y = B/F u + C/D e.
    General,
    /// An impulse response.
    Fir,
    /// A process in continuous time.
    Process,
    /// Transfer functions in continuous time.
    Tf,
    /// State space.
    Ss,
    /// Seasonal ARIMA.
    Arima,
}

words! { ModelWord {
    Arx "arx" "A y = B u + e",
    Armax "armax" "A y = B u + C e",
    Arma "arma" "A y = C e: a time series",
    Ar "ar" "A y = e: a time series",
    Oe "oe" "Output error: y = B/F u + e",
    Bj "bj" "Box and Jenkins: y = B/F u + C/D e",
    General "general" "A y = B/F u + C/D e, with any of them",
    Fir "fir" "An impulse response: y = B u + e of many taps, with `taps`",
    Process "process" "A process in continuous time: gain, lags, dead time, with `structure`",
    Tf "tf" "Transfer functions in continuous time, with `np` and `nz`",
    Ss "ss" "State space: x(t+1) = F x + G u + K e, y = H x + D u + e, with any number of outputs",
    Arima "arima" "Seasonal ARIMA: a time series, with differences, seasons and inputs, with `order` and `seasonal`",
}}

impl ModelWord {
    /// The kind of model that it asks for; an ARX model of several outputs is another one.
    pub(super) fn kind(self) -> Kind {
        match self {
            Self::Arx | Self::Armax | Self::Arma | Self::Ar | Self::Oe | Self::Bj | Self::General => {
                Kind::POLYNOMIAL
            }
            Self::Fir => Kind::IMPULSE_RESPONSE,
            Self::Process | Self::Tf => Kind::PROCESS,
            Self::Ss => Kind::STATE_SPACE,
            Self::Arima => Kind::ARIMA,
        }
    }
}

/// The kinds of model, each with what asks for it.
impl Kind {
    /// Polynomials, A y = B/F u + C/D e.
    pub const POLYNOMIAL: Self = Self::new("models of polynomials");
    /// Seasonal ARIMA.
    pub const ARIMA: Self = Self::new("`model` arima");
    /// An impulse response.
    pub const IMPULSE_RESPONSE: Self = Self::new("`model` fir");
    /// State space.
    pub const STATE_SPACE: Self = Self::new("`model` ss");
    /// An ARX model with several outputs.
    pub const VECTOR_ARX: Self = Self::new("`model` arx with several outputs");
    /// A process in continuous time.
    pub const PROCESS: Self = Self::new("`structure` and `np`");
    /// A model in blocks.
    pub const BLOCKS: Self = Self::new("`blocks`");
    /// A nonlinear ARX model.
    pub const NONLINEAR_ARX: Self = Self::new("`narx`");
    /// A model in equations.
    pub const EQUATIONS: Self = Self::new("`grey`");
    /// A process in continuous time of a measured frequency response.
    pub const RESPONSE: Self = Self::new("`from`");
    /// State space of a measured frequency response.
    pub const RESPONSE_STATES: Self = Self::new("`from` with `model` ss");
}

/// Which past outputs an output depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CoupleWord {
    /// Those of all.
    Full,
    /// Its own.
    None,
    /// Decided from the data.
    Auto,
}

words! { of CoupleWord {
    Full "full" "Those of all outputs",
    None "none" "Its own",
    Auto "auto" "Those with the least MDL",
}}

/// What is known of an impulse response before the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KernelWord {
    /// Decay and smoothness.
    Dc,
    /// One number for both.
    Tc,
    /// Nothing.
    None,
}

words! { of KernelWord {
    Dc "dc" "A parameter each for decay and smoothness, both of maximum likelihood",
    Tc "tc" "One parameter for both",
    None "none" "No prior: least squares",
}}

/// How to estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MethodWord {
    /// Prediction errors.
    #[default]
    Pem,
    /// Instrumental variables.
    Iv,
    /// Refined instrumental variables.
    Sriv,
}

words! { of MethodWord {
    Pem "pem" "Least squared prediction errors: in one step where that is least squares, else by a search",
    Iv "iv" "Instrumental variables in four stages: A and B of an arx model, whatever the noise",
    Sriv "sriv" "Refined instrumental variables: B and F of an oe model, whatever the noise",
}}

/// Which likelihood is made large.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LikelihoodWord {
    /// Given the first samples.
    #[default]
    Conditional,
    /// Of all outputs.
    Exact,
}

words! { of LikelihoodWord {
    Conditional "conditional" "Given the samples that the first error needs: least squared prediction errors",
    Exact "exact" "Of all measured outputs, by the Kalman filter (ar, arma, arx, armax)",
}}

words! { of Initial {
    Auto "auto" "drop without F; with F estimate if there are rows before, or if it is worth its parameters, else zero",
    Drop "drop" "Measured samples before; without them, samples without a full regressor are left out (models without F)",
    Zero "zero" "Zeros",
    Estimate "estimate" "Measured samples before, and initial conditions estimated with the parameters (models with F, processes, \
        or `likelihood` exact with inputs)",
}}

words! { of Constant {
    Auto "auto" "If it lowers MDL, unless the output's offset is given (`detrend` none, `offset`)",
    Yes "yes" "Always",
    No "no" "Never",
}}

/// Whether inputs act at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FeedthroughWord {
    /// Decided from the data.
    #[default]
    Auto,
    /// They do.
    Yes,
    /// They do not.
    No,
}

words! { of FeedthroughWord {
    Auto "auto" "Decided from the data",
    Yes "yes" "D is estimated",
    No "no" "D is zero",
}}

words! { of BlockStructure {
    Hammerstein "hammerstein" "A curve of each input, then a linear system: a valve, a pump, a heater that saturates",
    Wiener "wiener" "A linear system, then a curve: a sensor",
    WienerHammerstein "wiener-hammerstein" | "wh" "A curve between two linear systems",
    Feedback "feedback" | "lfr" "A linear system around a curve: a spring, friction, an outflow",
}}

/// The form of static curves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CurveWord {
    /// Straight lines between knots.
    Lines,
    /// Powers.
    Poly,
}

words! { of CurveWord {
    Lines "lines" "Straight lines from knot to knot",
    Poly "poly" "A polynomial, of degree 3 unless `degree` says otherwise",
}}

/// The functions of a nonlinear ARX model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapWord {
    /// Products.
    Poly,
    /// Radial basis functions.
    Rbf,
    /// Splines.
    Spline,
    /// Local linear models.
    Local,
    /// Nearest samples.
    Knn,
    /// Hyperbolic tangents.
    Tanh,
    /// Logistic functions.
    Logistic,
    /// Ramps.
    Relu,
    /// Steps.
    Step,
    /// Radial basis functions that are trained.
    RbfFree,
    /// Decided from the data.
    Auto,
    /// A linear model.
    None,
}

words! { MapWord {
    Poly "poly" "Products of regressors up to a degree",
    Rbf "rbf" "Radial basis functions",
    Spline "spline" "A natural cubic spline of each regressor",
    Local "local" "Local linear models, grown by splitting the space of the regressors",
    Knn "knn" "The nearest samples of the fit",
    Tanh "tanh" "A network with one hidden layer of hyperbolic tangents",
    Logistic "logistic" "A network of logistic functions",
    Relu "relu" | "hinge" "A network of ramps, max(0, a); beside a linear path they are hinges",
    Step "step" "A network of steps, whose hidden weights are drawn",
    RbfFree "rbf-free" "Radial basis functions whose centres and widths are trained",
    Auto "auto" "Of polynomials and networks the one with the best free run on held-out rows",
    None "none" "A linear model",
}}

words! { of Membership {
    Rectangle "rectangle" "Each in its box alone",
    Trapezoid "trapezoid" "Sloping edges, which overlap",
    Gaussian "gaussian" "Gaussians, over their sum",
}}

words! { of Path {
    All "all" "Every combination of orders",
    Alternate "alternate" "Increase one order at a time, in turn",
}}

words! { of Algorithm {
    LevenbergMarquardt "lm" "Levenberg and Marquardt",
    GaussNewton "gauss-newton" "Gauss and Newton; the step is halved until the cost falls",
    Newton "newton" "Newton and Raphson with the full Hessian",
    Gradient "gradient" "Steepest descent",
    Annealing "annealing" "Simulated annealing, then lm from the best point found",
}}

/// What is made small.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NormOption {
    /// The sum of squares.
    Two,
    /// The sum of absolute values.
    One,
    /// The largest absolute value.
    Infinity,
    /// Squares up to k times the scale of the errors, absolute values beyond.
    Huber {
        /// k, above 0.
        k: f64,
    },
}

impl OptionText for NormOption {
    const PYTHON: &'static str = "Union[float, Literal[\"huber\", \"inf\"], str]";
    const SIGNED: bool = true;

    fn of(text: &str) -> Result<Self, String> {
        let k = |text: &str| text.trim().parse().ok().filter(|k: &f64| k.is_finite() && *k > 0.0);
        match (text, text.strip_prefix("huber:").map(k)) {
            ("2", _) => Ok(Self::Two),
            ("1", _) => Ok(Self::One),
            ("inf", _) => Ok(Self::Infinity),
            ("huber", _) => Ok(Self::Huber { k: Loss::K }),
            (_, Some(Some(k))) => Ok(Self::Huber { k }),
            _ => Err(format!("'{text}': give 2, 1, huber, huber:K with K above 0, or inf")),
        }
    }

    fn text(&self) -> String {
        match self {
            Self::Two => "2".to_owned(),
            Self::One => "1".to_owned(),
            Self::Infinity => "inf".to_owned(),
            Self::Huber { k } => format!("huber:{k}"),
        }
    }
}

/// The number of states of a model, or a range; or p,d,q of an ARIMA model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OrderOption {
    /// N or A..B.
    States(OrderRange),
    /// p,d,q.
    Arima([usize; 3]),
}

impl OptionText for OrderOption {
    const PYTHON: &'static str = "Union[Order, tuple[int, int, int]]";

    fn of(text: &str) -> Result<Self, String> {
        if !text.contains(',') {
            return OrderRange::of(text).map(Self::States);
        }
        let found = whole_numbers(text).and_then(|numbers| <[usize; 3]>::try_from(numbers).ok());
        found.map(Self::Arima).ok_or_else(|| {
            format!("'{text}': write p,d,q, three whole numbers that are not negative, such as 0,1,1")
        })
    }

    fn text(&self) -> String {
        match self {
            Self::States(range) => range.text(),
            Self::Arima([p, d, q]) => format!("{p},{d},{q}"),
        }
    }
}

/// P,D,Q,s of a seasonal ARIMA model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SeasonalOption(pub [usize; 4]);

impl OptionText for SeasonalOption {
    const PYTHON: &'static str = "tuple[int, int, int, int]";

    fn of(text: &str) -> Result<Self, String> {
        let found = whole_numbers(text).and_then(|numbers| <[usize; 4]>::try_from(numbers).ok());
        found.map(Self).ok_or_else(|| {
            format!("'{text}': write P,D,Q,s, four whole numbers that are not negative, such as 0,1,1,12")
        })
    }

    fn text(&self) -> String {
        let [p, d, q, season] = self.0;
        format!("{p},{d},{q},{season}")
    }
}

fn whole_numbers(text: &str) -> Option<Vec<usize>> {
    text.split(',').map(|number| number.trim().parse().ok()).collect()
}

/// C1 or C1,C2: the length of the steps of a gradient search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepOption {
    /// Above 0.
    pub c1: f64,
    /// Above 0.
    pub c2: Option<f64>,
}

impl OptionText for StepOption {
    const PYTHON: &'static str = "Union[float, tuple[float, float]]";
    const SIGNED: bool = true;

    fn of(text: &str) -> Result<Self, String> {
        let number =
            |text: &str| text.trim().parse().ok().filter(|value: &f64| value.is_finite() && *value > 0.0);
        let constants = match text.split_once(',') {
            None => number(text).map(|c1| Self { c1, c2: None }),
            Some((c1, c2)) => number(c1).zip(number(c2)).map(|(c1, c2)| Self { c1, c2: Some(c2) }),
        };
        constants
            .ok_or_else(|| format!("'{text}': write it as C1 or C1,C2, positive numbers, such as 0.5 or 1,2"))
    }

    fn text(&self) -> String {
        self.c2.map_or_else(|| self.c1.to_string(), |c2| format!("{},{c2}", self.c1))
    }
}

/// The delay of an input in samples, or a range of delays: unlike a number of coefficients it may be large.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DelayRange(pub OrderRange);

impl OptionText for DelayRange {
    const LIST: Form = Form::List;
    const PYTHON: &'static str = "Order";
    const PYTHON_LIST: &'static str = "Orders";

    fn of(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<usize>().ok();
        let ends = match text.split_once("..") {
            Some((first, last)) => number(first).zip(number(last)),
            None => number(text).map(|delay| (delay, delay)),
        };
        let range = ends.and_then(|(first, last)| OrderRange::new(first, last).ok());
        range.map(Self).ok_or_else(|| format!("'{text}' is no delay; write 2, or a range as 0..10"))
    }

    fn text(&self) -> String {
        self.0.to_string()
    }
}

texts! {
    Bound, Repeated, "str", "Mapping[str, Bound]";
    Focus, Repeated, "Union[int, Literal[\"auto\", \"prediction\", \"simulation\"]]", "Sequence[str]";
    GainBound, Repeated, "str", "Union[Bound, Mapping[str, Bound]]", signed;
    OrderRange, List, "Order", "Orders";
    Prefilter, Repeated, "Band", "Sequence[str]", signed;
    ProcessStructure, List, "str", "Union[str, Sequence[str]]";
    Refine, Repeated, "Literal[\"prediction\", \"simulation\"]", "Sequence[str]";
    Split, Repeated, "Union[str, tuple[float, float, float]]", "Sequence[str]", signed;
    Weighting, Repeated, "Literal[\"ssarx\", \"moesp\", \"n4sid\", \"cva\"]", "Sequence[str]";
}

impl OptionText for Select {
    const PYTHON: &'static str = "";

    fn words() -> Vec<Word> {
        Self::all().map(|select| Word { word: select.word(), alias: None, help: select.says() }).collect()
    }

    fn of(text: &str) -> Result<Self, String> {
        Self::all().find(|select| select.word() == text).ok_or_else(|| none_of(text, &Self::words()))
    }

    fn text(&self) -> String {
        self.word().to_owned()
    }
}
