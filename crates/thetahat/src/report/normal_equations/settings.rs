//! What all pieces of a model have in common.

use std::fmt;
use std::ops::RangeInclusive;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::nonlinear_arx::{InputLags, MapPlan, NonlinearArxPlan};
use super::super::state_space::StateSpacePlan;
use super::Plan;
use super::nonlinear_arx::Products;
use crate::Error;
use crate::data::{Detrend, Rows, Split};
use crate::estimate::{
    Constant, Initial, Kernel, Method, SubspaceOptions, VectorArxInputs, VectorArxOptions,
};
use crate::model::Orders;
use crate::respond::Horizon;
use crate::select::{Choice, Select};

/// More rows than any model reaches back to.
const MOST_LAGS: usize = 100_000;

/// A model, and what is taken from its channels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub(super) struct Settings {
    pub(super) inputs: Vec<String>,
    #[serde(flatten)]
    pub(super) kind: Kind,
    /// `mean` or `none`.
    pub(super) detrend: String,
    /// Channels whose offset is set by hand.
    pub(super) offsets: Vec<(String, f64)>,
    pub(super) constant: Constant,
}

/// Which model, and its outputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum Kind {
    /// Of polynomials.
    Linear {
        output: String,
        orders: Orders,
        /// That of a regularised impulse response.
        kernel: Option<Kernel>,
    },
    /// Of polynomials with matrices for coefficients.
    VectorArx { outputs: Vec<String>, delays: Vec<usize>, arx: VectorArxOptions },
    /// Of the states that a subspace method finds.
    Subspace {
        outputs: Vec<String>,
        delays: Vec<usize>,
        subspace: SubspaceOptions,
        /// Those among which the least MDL chooses, if that is said.
        orders: Option<RangeInclusive<usize>>,
    },
    /// Of products of regressors.
    NonlinearArx {
        outputs: Vec<String>,
        output_lags: Vec<usize>,
        input_lags: Vec<InputLags>,
        expressions: Vec<String>,
        terms: Vec<String>,
        /// In place of these, those that are chosen.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        chosen: Option<ChosenProducts>,
        raw_terms: bool,
    },
}

/// Which products of those up to a degree forward regression takes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub(super) struct ChosenProducts {
    degree: usize,
    /// How many; none: as many as have the least of the criterion.
    terms: Option<usize>,
    criterion: Option<String>,
    /// How many functions are evaluated; none: the default.
    most: Option<usize>,
}

impl Settings {
    pub(super) fn of(plan: &Plan) -> Result<Self, Error> {
        plan.check()?;
        let Choice::Known(orders) = &plan.choice else {
            return Err(Error::argument("orders", "pieces of a log make one model; give its orders"));
        };
        if !orders.is_linear() {
            return Err(Error::argument(
                "orders",
                "a model with C, D or F is found by a search, which reads the data again and again; from pieces come models with A and B",
            ));
        }
        let kernel = match plan.method {
            Method::PredictionError(_) => None,
            Method::Regularised(kernel) => Some(kernel),
            _ => {
                return Err(Error::argument(
                    "method",
                    "normal equations give least squares; leave the other method or criterion out",
                ));
            }
        };
        check_rows(&plan.estimate, &plan.validate, plan.split)?;
        check_detrend(plan.detrend)?;
        refuse([
            (
                plan.prefilter.is_some(),
                "prefilter",
                "a filter reaches over the boundaries of pieces; filter the signals before",
            ),
            (
                plan.trend,
                "trend",
                "pieces have no common line; leave it out, or take the trend from the signals before",
            ),
            (
                matches!(plan.initial, Initial::Zero | Initial::Estimate),
                "initial",
                "rows without a full regressor are left out; give drop, or leave it out",
            ),
        ])?;
        Ok(Self {
            inputs: plan.inputs.clone(),
            kind: Kind::Linear { output: plan.output.clone(), orders: orders.clone(), kernel },
            detrend: plan.detrend.to_string(),
            offsets: plan.offsets.clone(),
            constant: plan.constant(),
        })
    }

    /// Of a model with several outputs.
    pub(super) fn of_states(plan: &StateSpacePlan) -> Result<Self, Error> {
        plan.check()?;
        check_rows(&plan.estimate, &plan.validate, plan.split)?;
        check_detrend(plan.detrend)?;
        refuse([
            (
                plan.refine.is_some(),
                "refine",
                "a search reads the log again and again; leave it out, and search on a part of the log",
            ),
            (
                plan.arx.as_ref().is_some_and(|arx| arx.delay != (0..=0)),
                "nk",
                "the rows of a model change with its delay, and the log is not read again; give one number for each input",
            ),
        ])?;
        let outputs = plan.outputs.clone();
        let delays = if plan.delays.is_empty() { vec![0; plan.inputs.len()] } else { plan.delays.clone() };
        let kind = match &plan.arx {
            Some(arx) => {
                let arx = VectorArxOptions { constant: false, ..arx.clone() };
                Kind::VectorArx { outputs, delays, arx }
            }
            None => {
                let subspace = SubspaceOptions { constant: false, ..plan.subspace };
                Kind::Subspace { outputs, delays, subspace, orders: plan.orders.clone() }
            }
        };
        let settings = Self {
            inputs: plan.inputs.clone(),
            kind,
            detrend: plan.detrend.to_string(),
            offsets: plan.offsets.clone(),
            constant: plan.resolved_constant(),
        };
        if settings.lags() > MOST_LAGS {
            let argument = if plan.arx.is_some() { "na" } else { "past" };
            return Err(Error::argument(
                argument,
                format!("lags above {MOST_LAGS} are not read; give lower orders"),
            ));
        }
        Ok(settings)
    }

    /// Of a nonlinear ARX model of products.
    pub(super) fn of_nonlinear_arx(plan: &NonlinearArxPlan) -> Result<Self, Error> {
        plan.check()?;
        let criterion = match plan.select {
            Some(Select::Criterion(criterion)) => Some(criterion.word().to_owned()),
            _ => None,
        };
        let (terms, chosen) = match &plan.map {
            MapPlan::Products { terms } => (terms.clone(), None),
            MapPlan::Polynomial { degree } if plan.terms.is_some() || criterion.is_some() => {
                let chosen =
                    ChosenProducts { degree: *degree, terms: plan.terms, criterion, most: plan.most };
                (Vec::new(), Some(chosen))
            }
            MapPlan::Polynomial { .. } => {
                return Err(Error::argument(
                    "select",
                    "free runs say how many products are taken, and the log is not read again; give an information criterion, such as mdl, \
                     give `terms`, or name the products",
                ));
            }
            _ => {
                return Err(Error::argument(
                    "narx",
                    "centres, knots, boxes and weights are found from the samples, which are not read again; from pieces come models of \
                     products",
                ));
            }
        };
        check_rows(&plan.estimate, &plan.validate, plan.split)?;
        check_detrend(plan.detrend)?;
        refuse([
            (
                plan.outputs.len() > 1,
                "output",
                "pieces make nonlinear models of one output; make one after the other, to which the other outputs are inputs",
            ),
            (
                plan.ridge.is_some_and(|ridge| ridge > 0.0),
                "ridge",
                "normal equations give least squares; leave it out",
            ),
            (
                plan.focus.is_some_and(|focus| focus != Horizon::ONE_STEP),
                "focus",
                "longer runs read the log again and again; leave it out, or take prediction",
            ),
        ])?;
        Ok(Self {
            inputs: plan.inputs.clone(),
            kind: Kind::NonlinearArx {
                outputs: plan.outputs.clone(),
                output_lags: plan.output_lags.clone(),
                input_lags: plan.input_lags.clone(),
                expressions: plan.expressions.clone(),
                terms,
                chosen,
                raw_terms: plan.raw_terms,
            },
            detrend: plan.detrend.to_string(),
            offsets: plan.offsets.clone(),
            constant: Constant::No,
        })
    }

    /// The plan that a nonlinear ARX model was made with.
    pub(super) fn nonlinear_plan(&self) -> Result<NonlinearArxPlan, Error> {
        let Kind::NonlinearArx { outputs, output_lags, input_lags, expressions, terms, chosen, raw_terms } =
            &self.kind
        else {
            return Err(Error::argument("map", "the model is not one of products"));
        };
        Ok(NonlinearArxPlan {
            inputs: self.inputs.clone(),
            outputs: outputs.clone(),
            expressions: expressions.clone(),
            detrend: self.detrend.parse()?,
            offsets: self.offsets.clone(),
            output_lags: output_lags.clone(),
            input_lags: input_lags.clone(),
            raw_terms: *raw_terms,
            ..match chosen {
                None => NonlinearArxPlan {
                    map: MapPlan::Products { terms: terms.clone() },
                    ..NonlinearArxPlan::new(&[], &[])
                },
                Some(ChosenProducts { degree, terms, criterion, most }) => NonlinearArxPlan {
                    map: MapPlan::Polynomial { degree: *degree },
                    terms: *terms,
                    select: criterion.as_ref().map(|word| word.parse().map(Select::Criterion)).transpose()?,
                    most: *most,
                    ..NonlinearArxPlan::new(&[], &[])
                },
            }
        })
    }

    /// How many rows the model reaches back to.
    pub(super) fn lags(&self) -> usize {
        match &self.kind {
            Kind::Linear { orders, .. } => orders.maximum_lag(),
            Kind::VectorArx { delays, arx, .. } => {
                let late = delays.iter().copied().max().unwrap_or(0);
                late.saturating_add(arx.longest(self.inputs.len()))
            }
            Kind::Subspace { delays, subspace, .. } => {
                let late = delays.iter().copied().max().unwrap_or(0);
                late.saturating_add(subspace.lags())
            }
            Kind::NonlinearArx { .. } => self.nonlinear_plan().map_or(0, |plan| plan.lags()),
        }
    }

    pub(super) fn outputs(&self) -> &[String] {
        match &self.kind {
            Kind::Linear { output, .. } => std::slice::from_ref(output),
            Kind::VectorArx { outputs, .. }
            | Kind::Subspace { outputs, .. }
            | Kind::NonlinearArx { outputs, .. } => outputs,
        }
    }

    /// The channels, the inputs first.
    pub(super) fn names(&self) -> Vec<&str> {
        self.inputs.iter().chain(self.outputs()).map(String::as_str).collect()
    }

    /// The channels, and the expressions of them that are read.
    pub(super) fn all_names(&self) -> Vec<&str> {
        let expressions = match &self.kind {
            Kind::NonlinearArx { expressions, .. } => expressions.as_slice(),
            _ => &[],
        };
        self.names().into_iter().chain(expressions.iter().map(String::as_str)).collect()
    }

    /// What is set by hand of a channel, or nothing at all; none: its mean.
    pub(super) fn told_offset(&self, name: &str) -> Option<f64> {
        let by_hand = self.offsets.iter().find(|(channel, _)| channel == name).map(|(_, level)| *level);
        by_hand.or((self.detrend == Detrend::None.to_string()).then_some(0.0))
    }

    pub(super) fn check_same(&self, other: &Self) -> Result<(), Error> {
        let differ = |message: String| Err(Error::argument("pieces", message));
        if self.names() != other.names() {
            return differ(format!(
                "the first ones have the channels {}, the second ones {}; make all of the same",
                self.names().join(", "),
                other.names().join(", ")
            ));
        }
        let (own, others) = (self.kind.to_string(), other.kind.to_string());
        if own != others {
            return differ(format!(
                "the first ones are of {own}, the second ones of {others}; make all with the same orders"
            ));
        }
        if self != other {
            return differ(
                "they were made with other offsets, another constant, another kernel or other products; make all with the same settings".to_owned(),
            );
        }
        Ok(())
    }

    /// Whether these can be those of sums over `size` columns. What indexes anything is checked here.
    pub(super) fn fits(&self, size: usize) -> bool {
        let inputs = self.inputs.len();
        let of_kind = match &self.kind {
            Kind::Linear { orders: own @ Orders { na, nb, nc, nd, nf, nk }, .. } => {
                Orders::new(*na, nb, *nc, *nd, nf, nk).is_ok()
                    && own.is_linear()
                    && own.inputs() == inputs
                    // One and y(t) beside the regressors.
                    && size == own.parameters() + 2
            }
            Kind::VectorArx { outputs, delays, arx } => {
                let signals = inputs + outputs.len();
                let columns = (arx.longest(inputs) as u128 + 1) * signals as u128 + 1;
                !outputs.is_empty()
                    && delays.len() == inputs
                    && arx.delay == (0..=0)
                    && !matches!(&arx.nb, VectorArxInputs::Each(each) if each.len() != inputs)
                    && self.lags() <= MOST_LAGS
                    && columns == size as u128
            }
            Kind::Subspace { outputs, delays, subspace, orders } => {
                let signals = inputs + outputs.len();
                let columns = (subspace.lags() as u128 + 1) * signals as u128 + 1;
                !outputs.is_empty()
                    && delays.len() == inputs
                    && orders.as_ref().is_none_or(|orders| *orders.start() > 0 && !orders.is_empty())
                    && self.lags() <= MOST_LAGS
                    && columns == size as u128
            }
            Kind::NonlinearArx { outputs, .. } => {
                outputs.len() == 1 && Products::of(self).is_ok_and(|products| products.columns() == size)
            }
        };
        of_kind
            && matches!(self.detrend.parse(), Ok(Detrend::Mean | Detrend::None))
            && self.offsets.iter().all(|(_, level)| level.is_finite())
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Linear { orders, .. } => write!(formatter, "{orders}"),
            Self::VectorArx { outputs, delays, arx } => {
                let range = |range: &std::ops::RangeInclusive<usize>| match (range.start(), range.end()) {
                    (first, last) if first == last => first.to_string(),
                    (first, last) => format!("{first}..{last}"),
                };
                let each = |values: &mut dyn Iterator<Item = usize>| {
                    let values: Vec<String> = values.map(|value| value.to_string()).collect();
                    format!("[{}]", values.join(" "))
                };
                let nb = match &arx.nb {
                    VectorArxInputs::Alike(nb) => range(nb),
                    VectorArxInputs::Each(nb) => each(&mut nb.iter().copied()),
                };
                let first = usize::from(!arx.direct);
                let nk = each(&mut delays.iter().map(|delay| delay + first));
                let inputs = if delays.is_empty() { String::new() } else { format!(", {nb}, {nk}") };
                write!(formatter, "ARX({}{inputs}) with {} outputs", range(&arx.na), outputs.len())
            }
            Self::Subspace { outputs, orders, .. } => {
                let order = match orders {
                    Some(orders) if orders.start() == orders.end() => format!(" of order {}", orders.start()),
                    Some(orders) => format!(" of order {}..{}", orders.start(), orders.end()),
                    None => String::new(),
                };
                let outputs = outputs.len();
                write!(
                    formatter,
                    "state space{order} with {outputs} output{}",
                    if outputs == 1 { "" } else { "s" }
                )
            }
            Self::NonlinearArx { chosen: Some(ChosenProducts { degree, .. }), .. } => {
                write!(formatter, "NARX polynomial of degree {degree}")
            }
            Self::NonlinearArx { terms, .. } => write!(formatter, "NARX polynomial, {} terms", terms.len()),
        }
    }
}

/// What is asked for and cannot be: whether it is, its argument, and why not.
fn refuse<const COUNT: usize>(refused: [(bool, &str, &str); COUNT]) -> Result<(), Error> {
    let first = refused.into_iter().find(|(asked, _, _)| *asked);
    first.map_or(Ok(()), |(_, argument, message)| Err(Error::argument(argument, message)))
}

fn check_rows(estimate: &[Rows], validate: &[Rows], split: Option<Split>) -> Result<(), Error> {
    if estimate.is_empty() && validate.is_empty() && split.is_none() {
        return Ok(());
    }
    Err(Error::argument(
        "rows",
        "all rows of a piece serve for the fit; cut the pieces, and validate the model on other ones",
    ))
}

fn check_detrend(detrend: Detrend) -> Result<(), Error> {
    if matches!(detrend, Detrend::Mean | Detrend::None) {
        return Ok(());
    }
    Err(Error::argument(
        "detrend",
        "what is taken from the channels of all pieces is their mean or nothing; give mean or none",
    ))
}
