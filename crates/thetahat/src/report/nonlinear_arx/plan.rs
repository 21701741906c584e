//! What nonlinear ARX model to fit.

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_numerics::optimize::Search;
use thetahat_numerics::regression::Monomials;

use crate::Error;
use crate::data::{Detrend, Rows, Split};
use crate::estimate::nonlinear_arx::Units;
use crate::model::{Activation, ChannelExpression, Membership};
use crate::respond::Horizon;
use crate::select::Select;

/// The default number of functions that a choice evaluates.
const MOST: usize = 40;
/// The default number of local models that a choice evaluates.
const MOST_LOCAL: usize = 10;
/// Further starts of a training.
const STARTS: usize = 4;
/// Its iterations, at most.
const ITERATIONS: usize = 500;

/// Units of a network, or centres, at most.
const MOST_UNITS: usize = 2000;
/// Shares of the rows for estimation, validation and test where trained models are compared and nobody held out any.
const SPLIT: [f64; 3] = [70.0, 30.0, 0.0];

/// Which lags of an input a nonlinear ARX model reads: `lags` of them from `delay` on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct InputLags {
    /// How many.
    pub lags: usize,
    /// The shortest one; 0 where the input acts at once.
    pub delay: usize,
}

/// The functions that a nonlinear ARX model is made of.
#[derive(Debug, Clone, PartialEq)]
pub enum MapPlan {
    /// Products of regressors up to a degree, of which forward regression chooses.
    Polynomial {
        /// The largest number of factors.
        degree: usize,
    },
    /// Products of regressors that are known.
    Products {
        /// As a report writes them: 1, y(k-1), or y(k-1)^2*u(k-1).
        terms: Vec<String>,
    },
    /// Radial basis functions.
    Radial {
        /// Where they stand.
        centres: Centres,
        /// sigma of all of them, in units of the scaled regressors; none: so wide that neighbours overlap.
        width: Option<f64>,
        /// Whether a constant and the regressors themselves are functions too.
        linear: bool,
    },
    /// A natural cubic spline of each regressor: a constant and the regressors themselves, and bends of which forward
    /// regression chooses.
    Spline {
        /// Bends of each regressor, at knots that divide its range over the estimation rows evenly.
        units: usize,
    },
    /// Local models, grown by splitting boxes of the regressors in half where errors are largest.
    Local {
        /// What makes weights of boxes.
        membership: Membership,
        /// Whether each is a plane: else it is a constant.
        planes: bool,
        /// How many; none: chosen by `select`.
        units: Option<usize>,
    },
    /// A network with one hidden layer beside a linear path.
    Network {
        /// What its units make of their sums.
        activation: Activation,
        /// How many units; none: `select` says it, of 2, 4 and 8. Of units that are drawn, from how many forward
        /// regression chooses.
        units: Option<usize>,
        /// Whether the weights of the hidden layer are drawn, and forward regression chooses among the units: else all
        /// weights are trained. Steps, which have no slope, are always drawn.
        drawn: bool,
    },
    /// Radial basis functions beside a linear path, whose centres and widths are trained.
    FreeRadial {
        /// How many; none: `select` says it, of 2, 4 and 8.
        units: Option<usize>,
    },
    /// What has the best free run on rows held out: the linear model that the data choose, polynomials of degree 2 and
    /// 3, and networks of 2 and 4 units. The first whose error is no more than 1.1 times the least is the report: a
    /// linear model where it is about as good.
    Auto,
    /// The samples nearest to the regressors.
    Neighbours {
        /// Whether they give a plane: else their mean.
        planes: bool,
        /// How many; none: chosen by `select`.
        units: Option<usize>,
    },
}

impl MapPlan {
    /// The functions whose numbers are trained, and how many of them, if that is given; none where they are not.
    pub(super) fn trained(&self) -> Option<(Units, Option<usize>)> {
        match *self {
            Self::Network { activation, units, drawn } if !drawn && activation != Activation::Step => {
                Some((Units::Network(activation), units))
            }
            Self::FreeRadial { units } => Some((Units::Radial, units)),
            _ => None,
        }
    }
}

/// Where radial basis functions stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Centres {
    /// At samples of the estimation rows, of which forward regression chooses.
    Chosen,
    /// At the means of clusters of the estimation rows.
    Clusters {
        /// How many.
        count: usize,
        /// Which random start.
        seed: u64,
    },
    /// At a grid over the range of the estimation rows.
    Grid {
        /// How many in each direction.
        each: usize,
    },
    /// At pseudo-random points in that range.
    Random {
        /// How many.
        count: usize,
        /// Which points.
        seed: u64,
    },
}

/// What nonlinear ARX model to fit, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct NonlinearArxPlan {
    /// The input channels.
    pub inputs: Vec<String>,
    /// The output channels: a map for each, of the lags of all.
    pub outputs: Vec<String>,
    /// Expressions of these channels that are regressors too, such as sqrt(u), of their values in their own units. Each
    /// is read at the lags that all channels in it have: from the longest of their delays to the longest of their lags.
    pub expressions: Vec<String>,
    /// Rows to estimate on; none: all.
    pub estimate: Vec<Rows>,
    /// Rows to validate on.
    pub validate: Vec<Rows>,
    /// Cuts the rows to estimate on into parts: models are fitted to the first one and compared, the chosen one is
    /// fitted again to the first two, and evaluated on the third. None: where trained models are compared, and no rows
    /// are to validate on, 70/30/0.
    pub split: Option<Split>,
    /// What is taken from each channel.
    pub detrend: Detrend,
    /// Channels whose offset is set by hand.
    pub offsets: Vec<(String, f64)>,
    /// Past values that are read of each output: y(k-1), …, y(k-n).
    pub output_lags: Vec<usize>,
    /// The lags of each input.
    pub input_lags: Vec<InputLags>,
    /// Whether the lags of the chosen linear model are tried too, and used if the free run of the nonlinear model is
    /// then better on held-out rows.
    pub lags_chosen: bool,
    /// The functions.
    pub map: MapPlan,
    /// The number of functions in the model; none: chosen by `select`.
    pub terms: Option<usize>,
    /// How many functions a choice evaluates; none: 40, and 10 local models.
    pub most: Option<usize>,
    /// What makes one number of functions better than another; none: the free run on the validation rows where there
    /// are some, else that on five blocks of the estimation rows.
    pub select: Option<Select>,
    /// Keeps parameters small: weighs like this many more samples in which the output is 0. None: nothing, and of
    /// trained numbers 0.1 or 1, as `select` says.
    pub ridge: Option<f64>,
    /// Of which errors parameters are to be the least: one step ahead, so many, or of the free run. None: one step
    /// ahead, and of trained maps the free run where there are inputs.
    pub focus: Option<Horizon>,
    /// How to search, where more is to be found than one solution says.
    pub search: Search,
    /// Whether signals keep their own units: else each is divided by its standard deviation over the estimation rows.
    pub raw_terms: bool,
}

impl NonlinearArxPlan {
    /// All rows, means removed, products of at most two of two past values of each output and of each input; further
    /// settings as fields.
    pub fn new(inputs: &[&str], outputs: &[&str]) -> Self {
        let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        Self {
            inputs: owned(inputs),
            outputs: owned(outputs),
            expressions: Vec::new(),
            estimate: Vec::new(),
            validate: Vec::new(),
            split: None,
            detrend: Detrend::Mean,
            offsets: Vec::new(),
            output_lags: vec![2; outputs.len()],
            input_lags: vec![InputLags { lags: 2, delay: 1 }; inputs.len()],
            lags_chosen: false,
            map: MapPlan::Polynomial { degree: 2 },
            terms: None,
            most: None,
            select: None,
            ridge: None,
            focus: None,
            search: Search { starts: STARTS, max_iterations: ITERATIONS, ..Search::default() },
            raw_terms: false,
        }
    }

    /// How many products of a degree there are of the regressors.
    pub(in crate::report) fn products(&self, degree: usize) -> Result<usize, Error> {
        let inputs = self.input_lags.iter().map(|input| input.lags);
        let expressions = self.read_expressions()?;
        let expressions = expressions.iter().map(|expression| self.lags_of(expression).len());
        let regressors = self.output_lags.iter().copied().chain(inputs).chain(expressions).sum();
        Ok(Monomials::new(regressors, degree).map_or(usize::MAX, |all| all.count()))
    }

    /// How many rows before a row the model reads at most.
    pub fn lags(&self) -> usize {
        let of_inputs = self.input_lags.iter().filter(|input| input.lags > 0);
        let longest = of_inputs.map(|input| input.delay.saturating_add(input.lags - 1));
        longest.chain(self.output_lags.iter().copied()).max().unwrap_or(0)
    }

    /// Outputs, then inputs.
    pub(in crate::report) fn channels(&self) -> impl Iterator<Item = &str> {
        self.outputs.iter().chain(&self.inputs).map(String::as_str)
    }

    /// The expressions, of the channels in their order.
    pub(in crate::report) fn read_expressions(&self) -> Result<Vec<ChannelExpression>, Error> {
        let names: Vec<&str> = self.channels().collect();
        let wrong = |what: String| Error::argument("regressor", what);
        if let (Detrend::Linear, Some(text)) = (self.detrend, self.expressions.first()) {
            return Err(wrong(format!(
                "{text} is of values as they are, and a line that is taken from them changes with time; take another `detrend`"
            )));
        }
        for (position, text) in self.expressions.iter().enumerate() {
            if self.expressions[..position].contains(text) || names.contains(&text.as_str()) {
                return Err(wrong(format!("'{text}' is read already; name each once")));
            }
        }
        let read = |text: &String| ChannelExpression::read(text, &names).map_err(wrong);
        let expressions: Vec<ChannelExpression> =
            self.expressions.iter().map(read).collect::<Result<_, _>>()?;
        for (text, expression) in self.expressions.iter().zip(&expressions) {
            if self.lags_of(expression).is_empty() {
                return Err(wrong(format!(
                    "'{text}' is read at the lags that its channels have in common, and they have none; give them lags"
                )));
            }
        }
        Ok(expressions)
    }

    /// The lags at which an expression is read: from the longest delay of its channels to the longest of their lags.
    pub(super) fn lags_of(&self, expression: &ChannelExpression) -> Range<usize> {
        let of_outputs = self.output_lags.iter().map(|lags| 1..lags + 1);
        let of_inputs = self.input_lags.iter().map(|input| input.delay..input.delay + input.lags);
        let all: Vec<Range<usize>> = of_outputs.chain(of_inputs).collect();
        let own = || expression.channels().iter().filter_map(|channel| all.get(*channel));
        let first = own().map(|lags| lags.start).max().unwrap_or(0);
        first..own().map(|lags| lags.end).max().unwrap_or(0)
    }

    /// How many steps a choice takes at most.
    pub(in crate::report) fn steps(&self) -> usize {
        match self.map {
            MapPlan::Local { units, .. } => units.or(self.most).unwrap_or(MOST_LOCAL),
            MapPlan::Products { ref terms } => terms.len(),
            _ => self.terms.or(self.most).unwrap_or(MOST),
        }
    }

    /// How far the runs go whose errors are made small.
    pub(in crate::report) fn horizon(&self) -> Horizon {
        let driven = self.input_lags.iter().any(|input| input.lags > 0);
        let trains = self.map.trained().is_some() || self.map == MapPlan::Auto;
        self.focus.unwrap_or(if trains && driven { Horizon::FreeRun } else { Horizon::ONE_STEP })
    }

    /// Whether several models are trained of which rows held out say which is taken.
    fn compares_trained(&self) -> bool {
        match self.map.trained() {
            Some((_, units)) => units.is_none() || self.ridge.is_none(),
            None => self.map == MapPlan::Auto,
        }
    }

    /// The plan, where trained models are compared and no rows are held out with the last ones held out.
    ///
    /// # Errors
    /// None for a plan that was checked.
    pub(in crate::report) fn holding_out(&self) -> Result<Self, Error> {
        let [estimation, validation, test] = SPLIT;
        let needs = self.compares_trained() && self.validate.is_empty() && self.select.is_none();
        let split = match self.split {
            None if needs => Some(Split::new(estimation, validation, test)?),
            given => given,
        };
        Ok(Self { split, ..self.clone() })
    }

    fn check_training(&self) -> Result<(), Error> {
        self.search.check_numbers()?;
        if let Some(Horizon::Steps { steps }) = self.focus
            && !(1..=crate::model::LARGEST).contains(&steps)
        {
            return Err(Error::argument(
                "focus",
                format!("{steps} steps are not looked ahead; give from 1 to {}", crate::model::LARGEST),
            ));
        }
        let is_auto = self.map == MapPlan::Auto;
        if is_auto && self.outputs.len() > 1 {
            return Err(Error::argument(
                "output",
                "auto compares models of one output; fit each of them alone, the others being inputs",
            ));
        }
        if self.lags_chosen && !is_auto {
            return Err(Error::argument("lags_chosen", "lags are chosen with auto; give those of this map"));
        }
        let units = match self.map {
            MapPlan::Network { units, .. } | MapPlan::FreeRadial { units } => units,
            _ => None,
        };
        if units.is_some_and(|units| units == 0 || units > MOST_UNITS) {
            return Err(Error::argument("units", format!("give from 1 to {MOST_UNITS} units")));
        }
        if self.map.trained().is_none() && !is_auto {
            return Ok(());
        }
        if self.terms.is_some() || self.most.is_some() {
            return Err(Error::argument(
                "terms",
                "a trained map has a number of `units`, and auto says all by itself; leave it out",
            ));
        }
        if self.select == Some(Select::Cv) || is_auto && matches!(self.select, Some(Select::Criterion(_))) {
            return Err(Error::argument(
                "select",
                "trained maps are compared by their free runs on validation rows; give those, or leave it out: then the last rows of the \
                 estimation are held out",
            ));
        }
        if !self.compares_trained() && self.select.is_some() {
            return Err(Error::argument(
                "select",
                "`units` and `ridge` are given, and there is nothing to choose; leave one of them out",
            ));
        }
        Ok(())
    }

    /// Whether the plan makes sense, whatever the log.
    ///
    /// # Errors
    /// [`Error::Argument`] with the argument that does not.
    pub fn check(&self) -> Result<(), Error> {
        let names: Vec<&str> = self.channels().collect();
        for (position, name) in names.iter().enumerate() {
            if names[..position].contains(name) {
                return Err(Error::argument(
                    "channels",
                    format!("'{name}' is named twice; a channel has one role"),
                ));
            }
        }
        if self.outputs.is_empty() {
            return Err(Error::argument("output", "a model has one output at least"));
        }
        if let Some((name, _)) = self.offsets.iter().find(|(name, _)| !names.contains(&name.as_str())) {
            return Err(Error::argument("offset", format!("'{name}' is neither an input nor the output")));
        }
        if self.input_lags.len() != self.inputs.len() {
            return Err(Error::argument(
                "nu",
                format!(
                    "there are lags of {} inputs, and {} inputs",
                    self.input_lags.len(),
                    self.inputs.len()
                ),
            ));
        }
        if self.output_lags.len() != self.outputs.len() {
            let (lags, outputs) = (self.output_lags.len(), self.outputs.len());
            return Err(Error::argument(
                "ny",
                format!("there are lags of {lags} outputs, and {outputs} outputs"),
            ));
        }
        let longest = self.input_lags.iter().map(|input| ("nu", input.lags.saturating_add(input.delay)));
        for (argument, lag) in longest.chain(self.output_lags.iter().map(|lags| ("ny", *lags))) {
            if lag > crate::model::LARGEST {
                return Err(Error::argument(
                    argument,
                    format!("lags above {} are not read", crate::model::LARGEST),
                ));
            }
        }
        if self.output_lags.iter().all(|lags| *lags == 0)
            && self.input_lags.iter().all(|input| input.lags == 0)
        {
            return Err(Error::argument(
                "ny",
                "the model reads nothing; give lags of the output or of an input",
            ));
        }
        self.read_expressions()?;
        if let MapPlan::Products { terms } = &self.map {
            if terms.is_empty() {
                return Err(Error::argument("term", "a model has one function at least"));
            }
            if self.terms.is_some() || self.most.is_some() || self.select.is_some() {
                return Err(Error::argument(
                    "term",
                    "the products are given; leave out `terms`, `most-terms` and `select`, which choose",
                ));
            }
        }
        if let MapPlan::Local { units, .. } | MapPlan::Neighbours { units, .. } = self.map {
            if self.terms.is_some() {
                return Err(Error::argument(
                    "terms",
                    "local models and neighbours are numbers of `units`; leave it out, or give `units`",
                ));
            }
            if units == Some(0) {
                return Err(Error::argument(
                    "units",
                    "a model has one local model, or asks one neighbour, at least",
                ));
            }
            if units.is_some() && self.select.is_some() {
                return Err(Error::argument(
                    "select",
                    "the number of `units` is given; leave out one of the two",
                ));
            }
            if self.most.is_some() && matches!(self.map, MapPlan::Neighbours { .. }) {
                return Err(Error::argument("most-terms", "it is not of neighbours; leave it out"));
            }
        }
        if matches!(self.map, MapPlan::Neighbours { .. }) {
            if self.ridge.is_some_and(|ridge| ridge > 0.0) {
                return Err(Error::argument("ridge", "neighbours are not solved for; leave it out"));
            }
            if self.focus.is_some_and(|focus| focus != Horizon::ONE_STEP) {
                return Err(Error::argument(
                    "focus",
                    "neighbours are not trained for longer runs; leave it out",
                ));
            }
        }
        self.check_training()?;
        if self.terms == Some(0) || self.most == Some(0) {
            return Err(Error::argument("terms", "a model has one function at least"));
        }
        if let Some(ridge) = self.ridge.filter(|ridge| !(ridge.is_finite() && *ridge >= 0.0)) {
            return Err(Error::argument("ridge", format!("{ridge} is not a number from 0 on")));
        }
        if self.terms.is_some() && self.select.is_some() {
            return Err(Error::argument("select", "the number of terms is given; leave out one of the two"));
        }
        Ok(())
    }
}
