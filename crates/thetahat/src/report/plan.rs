use thetahat_numerics::optimize::Search;

use crate::Error;
use crate::data::{Detrend, Prefilter, Rows, Split};
use crate::estimate::{Constant, Initial, Method};
use crate::model::{Orders, Structure};
use crate::select::{Automatic, Choice, Focus, Select, Selection};

/// What to fit, and to which part of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The input channels, in the order of the orders.
    pub inputs: Vec<String>,
    /// The output channel.
    pub output: String,
    /// Rows to estimate on; none: all.
    pub estimate: Vec<Rows>,
    /// Rows to validate on.
    pub validate: Vec<Rows>,
    /// Cuts the rows to estimate on into parts: models are fitted to the first one and compared, the chosen one is
    /// fitted again to the first two, and evaluated on the third. None: all rows to estimate on serve for the fit.
    pub split: Option<Split>,
    /// What is taken from each channel.
    pub detrend: Detrend,
    /// Channels whose offset is set by hand.
    pub offsets: Vec<(String, f64)>,
    /// The band of frequencies whose errors the fit, and a choice, make small. The model describes the signals as they
    /// are, its figures and its noise variance are those of unfiltered errors. None: all frequencies.
    pub prefilter: Option<Prefilter>,
    /// The orders, which say the structure too; or among which to choose.
    pub choice: Choice,
    /// What makes one model better than another, where there is a choice.
    pub select: Select,
    /// What the model is for: it decides among several, and what a fit makes small.
    pub focus: Focus,
    /// How to estimate.
    pub method: Method,
    /// What stands for the samples before a segment.
    pub initial: Initial,
    /// Whether the level of the output is estimated with the parameters: where the output would stay if the inputs
    /// stayed at their offsets. A mean is not it where a log begins or ends far from there, as that of a step test.
    /// Auto leaves alone what was given: nothing is taken with [`Detrend::None`], and what is set by hand stays.
    pub constant: Constant,
    /// Whether a slope of the output is estimated with the parameters, and the level with it.
    pub trend: bool,
    /// Whether outliers of the output count as other values do. Where the data choose the orders they are taken for
    /// missing otherwise.
    pub uses_outliers: bool,
}

impl Plan {
    /// All rows, means removed, the default method; further settings as fields: `Plan { validate, ..Plan::new(…) }`.
    pub fn new(inputs: &[&str], output: &str, choice: impl Into<Choice>) -> Self {
        Self {
            inputs: inputs.iter().map(|input| (*input).to_owned()).collect(),
            output: output.to_owned(),
            estimate: Vec::new(),
            validate: Vec::new(),
            split: None,
            detrend: Detrend::Mean,
            offsets: Vec::new(),
            prefilter: None,
            choice: choice.into(),
            select: Select::default(),
            focus: Focus::default(),
            method: Method::default(),
            initial: Initial::default(),
            constant: Constant::default(),
            trend: false,
            uses_outliers: false,
        }
    }

    /// Whether the output's offset is found in the data before the fit.
    pub(super) fn takes_output_offset(&self) -> bool {
        self.detrend != Detrend::None && !self.offsets.iter().any(|(name, _)| *name == self.output)
    }

    /// Whether a constant is estimated: auto leaves alone the output of which the offset was given, as nothing or by
    /// hand, and one of which a band counts.
    pub(super) fn constant(&self) -> Constant {
        let given = !self.takes_output_offset() || self.prefilter.is_some();
        if self.constant == Constant::Auto && given { Constant::No } else { self.constant }
    }

    /// Whether the noise of a chosen model is estimated after the plant: that of an output-error model that was chosen
    /// for its free run.
    pub(super) fn estimates_noise_after_plant(&self, selection: &Selection) -> bool {
        let simulates = selection.winners.as_ref().is_some_and(|best| {
            selection.chosen.orders == best.simulation.orders
                && best.simulation.orders != best.prediction.orders
        });
        let free_run = matches!(self.focus, Focus::Auto | Focus::Simulation);
        simulates
            && free_run
            && selection.chosen.structure == Structure::Oe
            && matches!(&self.choice, Choice::Automatic(Automatic { structure: None, .. }))
    }

    /// Whether nothing is asked of the model, so that another kind than polynomials may be taken.
    pub(super) fn leaves_all_open(&self) -> bool {
        matches!(&self.choice, Choice::Automatic(Automatic { structure: None, nk: None, .. }))
            && matches!(self.method, Method::PredictionError(_))
            && self.select == Select::MDL
            && self.focus == Focus::Auto
            && self.initial == Initial::Auto
            && self.prefilter.is_none()
            && !self.trend
            && !self.inputs.is_empty()
    }

    /// The search for the least squares; none of other methods.
    pub(super) fn search(&self) -> Option<&Search> {
        match &self.method {
            Method::PredictionError(search) => Some(search),
            _ => None,
        }
    }

    /// Whether nonlinear models are left out.
    pub(super) fn is_linear(&self) -> bool {
        !matches!(&self.choice, Choice::Automatic(Automatic { linear: false, .. }))
    }

    /// Refuses a focus that does not go with orders or method.
    pub(super) fn check_focus(&self, orders: &Orders) -> Result<(), Error> {
        if !matches!(self.focus, Focus::Simulation | Focus::Steps(_)) {
            return Ok(());
        }
        if self.focus == Focus::Simulation && orders.nb.iter().all(|&nb| nb == 0) {
            return Err(Error::argument(
                "focus",
                "simulation needs inputs that drive the model; take prediction",
            ));
        }
        if self.focus == Focus::Simulation && !matches!(self.method, Method::PredictionError(_)) {
            return Err(Error::argument(
                "focus",
                "a fit for simulation minimises the squared errors of the free run; leave out the other method or criterion",
            ));
        }
        Ok(())
    }

    /// Refuses a constant or a trend that does not go with the rest, whatever the data.
    pub(super) fn check(&self) -> Result<(), Error> {
        if self.trend && self.constant == Constant::No {
            return Err(Error::argument(
                "trend",
                "it is a line with a slope and a level, which is the constant; leave out one of the two",
            ));
        }
        if self.prefilter.is_some() && matches!(self.method, Method::ExactLikelihood(_)) {
            return Err(Error::argument(
                "prefilter",
                "the exact likelihood is that of errors that are white, and those in a band are not; leave one of the two out",
            ));
        }
        if self.prefilter.is_some() && (self.trend || self.constant == Constant::Yes) {
            return Err(Error::argument(
                "constant",
                "a level is not in a band of frequencies: take either the band or the constant",
            ));
        }
        let mixed = match &self.choice {
            Choice::Known(_) => false,
            Choice::Grid(grid) => grid.na.last() > 0,
            Choice::Automatic(automatic) => {
                !matches!(automatic.structure, Some(Structure::Oe | Structure::Bj))
            }
        };
        if mixed && self.initial == Initial::Zero && (self.trend || self.constant == Constant::Yes) {
            return Err(Error::argument(
                "constant",
                "zeros before the first sample are not at the level that is to be found, and A of some of the models reaches \
                 back to them; take another initial condition, or leave the constant out",
            ));
        }
        Ok(())
    }
}
