//! Models in state space, and ARX models with several outputs.

use std::borrow::Cow;
use std::ops::RangeInclusive;
use std::sync::Arc;

use thetahat_numerics::optimize::Monitor;

use super::search::{self, within};
use super::{Common, Draft, KindPlan, common};
use crate::Error;
use crate::data::{Log, Source};
use crate::estimate::{Coupling, Initial, SubspaceOptions, VectorArxInputs, VectorArxOptions};
use crate::options::Kind;
use crate::plan::{CoupleWord, DelayRange, FeedthroughWord, FitOptions, OrderOption};
use crate::report::{
    NormalEquations, PendingEvaluation, Report, StateSpacePlan, fit_state_space_monitored,
    fit_states_to_response,
};
use crate::select::{Focus, OrderRange};
use crate::spectrum::MeasuredResponse;

/// The orders of an ARX model that are compared where none are given.
const CHOSEN_LAGS: RangeInclusive<usize> = 1..=8;
/// More lags than anybody has.
const MOST_LAGS: usize = 200;

/// A model in state space of which the channels are open.
#[derive(Debug)]
pub(super) struct StateSpaceDraft {
    /// Whether there are inputs at all.
    driven: bool,
    /// Samples that inputs wait: none, one for all or one for each.
    delays: Vec<RangeInclusive<usize>>,
    /// The rest of the plan.
    plan: StateSpacePlan,
}

impl StateSpaceDraft {
    /// A model of a subspace method or of a frequency response, or an ARX model with several outputs.
    pub(super) fn new(options: &FitOptions, kind: Kind) -> Result<Self, Error> {
        let (without_inputs, is_arx) = (options.is_without_inputs(), kind == Kind::VECTOR_ARX);
        check(options, kind)?;
        let Common { estimate, validate, split, detrend, offsets } = common(options)?;
        let order = match options.order {
            Some(OrderOption::Arima(_)) => {
                return Err(Error::argument(
                    "order",
                    "p,d,q is of `model` arima; write it as N or A..B, such as 4 or 1..10",
                ));
            }
            Some(OrderOption::States(order)) => Some(order.first()..=order.last()),
            None => None,
        };
        if order.as_ref().is_some_and(|order| *order.start() == 0) {
            return Err(Error::argument("order", "write it as N or A..B, from 1 on, such as 4 or 1..10"));
        }
        let plan = StateSpacePlan {
            estimate,
            validate,
            split,
            detrend,
            offsets,
            orders: order,
            subspace: SubspaceOptions {
                weighting: options.weighting.unwrap_or_default(),
                past: within("past", options.past, 1..=1000)?,
                future: within("future", options.future, 1..=1000)?,
                feedthrough: match options.feedthrough.unwrap_or_default() {
                    FeedthroughWord::Auto => None,
                    FeedthroughWord::Yes => Some(true),
                    FeedthroughWord::No => Some(false),
                },
                constant: false,
            },
            constant: options.constant.unwrap_or_default(),
            refine: options.refine,
            search: search::search(options)?,
            arx: if is_arx { Some(arx(options, without_inputs)?) } else { None },
            ..StateSpacePlan::new(&[], &[])
        };
        let delay = |DelayRange(delay): &DelayRange| {
            if !(is_arx && options.nk.len() == 1) && delay.single().is_none() {
                return Err(Error::argument(
                    "nk",
                    format!(
                        "{delay}: a range is for all inputs of an ARX model; give a number for each input, such as 3"
                    ),
                ));
            }
            if delay.single().is_none() && delay.last() > MOST_LAGS {
                let message =
                    format!("{delay}: a range of delays ends with {MOST_LAGS} at most, such as 0..10");
                return Err(Error::argument("nk", message));
            }
            Ok(delay.first()..=delay.last())
        };
        let delays = options.nk.iter().map(delay).collect::<Result<_, Error>>()?;
        Ok(Self { driven: !without_inputs, delays, plan })
    }
}

impl Draft for StateSpaceDraft {
    fn is_driven(&self) -> bool {
        self.driven
    }

    fn asks_for_no_inputs(&self) -> &'static str {
        "`nb` 0"
    }

    /// Without feedthrough an input acts one sample later by itself.
    fn plan(&self, inputs: Vec<String>, outputs: Vec<String>) -> Result<Arc<dyn KindPlan>, Error> {
        let count = inputs.len();
        let delays = match &*self.delays {
            [] => Vec::new(),
            [all] => vec![*all.start(); count],
            several if several.len() == count => several.iter().map(|delay| *delay.start()).collect(),
            several => {
                return Err(Error::argument(
                    "nk",
                    format!("{} numbers for {count} inputs; give one for all or one for each", several.len()),
                ));
            }
        };
        let mut plan = StateSpacePlan { inputs, outputs, ..self.plan.clone() };
        if let Some(arx) = &mut plan.arx {
            if let VectorArxInputs::Each(nb) = &arx.nb
                && nb.len() != count
            {
                return Err(Error::argument(
                    "nb",
                    format!("{} numbers for {count} inputs; give one for all or one for each", nb.len()),
                ));
            }
            arx.delay = self.delays.first().map_or(0..=0, |delays| 0..=delays.end() - delays.start());
            arx.direct = delays.contains(&0);
            plan.delays = delays.iter().map(|delay| delay - usize::from(!arx.direct)).collect();
        } else if !delays.is_empty() {
            // u(t - nk) acts on y(t): through D if some input acts at once, else through G.
            let at_once = delays.contains(&0) || plan.subspace.feedthrough == Some(true);
            if delays.contains(&0) && plan.subspace.feedthrough == Some(false) {
                return Err(Error::argument(
                    "nk",
                    "0 says that an input acts at once, and `feedthrough` no that none does; leave one out",
                ));
            }
            plan.subspace.feedthrough = Some(at_once);
            plan.delays = delays.iter().map(|delay| delay - usize::from(!at_once)).collect();
        }
        plan.check()?;
        Ok(Arc::new(plan))
    }
}

impl KindPlan for StateSpacePlan {
    fn fit(&self, log: Cow<'_, Log>, sources: &[Source], monitor: Monitor<'_>) -> Result<Report, Error> {
        fit_state_space_monitored(&log, sources, self, monitor)
    }

    fn fit_response(&self, response: &MeasuredResponse, monitor: Monitor<'_>) -> Result<Report, Error> {
        fit_states_to_response(response, self, monitor)
    }

    fn begin(
        &self,
        log: Cow<'_, Log>,
        sources: &[Source],
        monitor: Monitor<'_>,
    ) -> Result<PendingEvaluation, Error> {
        PendingEvaluation::of_states(&log, sources, self, monitor)
    }

    fn check_pieces(&self) -> Result<(), Error> {
        Ok(())
    }

    fn lags(&self) -> usize {
        self.lags()
    }

    fn pieces(&self, log: &Log, sources: &[Source], past: usize) -> Result<NormalEquations, Error> {
        NormalEquations::of_states(log, sources, self, past)
    }
}

/// Among which ARX models with several outputs the data choose.
fn arx(options: &FitOptions, without_inputs: bool) -> Result<VectorArxOptions, Error> {
    let lags = |option: &str, range: &OrderRange| {
        if range.last() > MOST_LAGS {
            let message = format!("{range}: write it as N or A..B, {MOST_LAGS} at most, such as 2 or 1..8");
            return Err(Error::argument(option, message));
        }
        Ok(range.first()..=range.last())
    };
    let nb = options.nb.iter().map(|range| lags("nb", range)).collect::<Result<Vec<_>, Error>>()?;
    let each =
        || nb.iter().map(|nb| (nb.start() == nb.end()).then_some(*nb.start())).collect::<Option<Vec<_>>>();
    let nb = match &*nb {
        _ if without_inputs => VectorArxInputs::Alike(0..=0),
        [] => VectorArxInputs::Alike(CHOSEN_LAGS),
        [one] => VectorArxInputs::Alike(one.clone()),
        _ => VectorArxInputs::Each(each().ok_or_else(|| {
            Error::argument("nb", "with several outputs give one range for all inputs, or a number for each")
        })?),
    };
    Ok(VectorArxOptions {
        na: options.na.as_ref().map_or(Ok(CHOSEN_LAGS), |range| lags("na", range))?,
        nb,
        coupling: match options.couple {
            None | Some(CoupleWord::Auto) => None,
            Some(CoupleWord::Full) => Some(Coupling::Full),
            Some(CoupleWord::None) => Some(Coupling::None),
        },
        delay: 0..=0,
        direct: false,
        constant: false,
    })
}

/// What the table of options does not say: options whose values go with some models alone.
fn check(options: &FitOptions, kind: Kind) -> Result<(), Error> {
    let refused = |option: &str, message: &str| Err(Error::argument(option, message));
    if options.refine.is_none()
        && kind != Kind::RESPONSE_STATES
        && let Some(option) = options.first_given(&search::OPTIONS)
    {
        return refused(&option, "it is for a search; give `refine` too");
    }
    if kind != Kind::VECTOR_ARX && !options.nb.is_empty() && !options.is_without_inputs() {
        return refused(
            "nb",
            "models in state space have no polynomials; leave it out, or give 0 for no inputs",
        );
    }
    if !matches!(options.initial.unwrap_or_default(), Initial::Auto | Initial::Estimate) {
        return refused("initial", "the state of models in state space is estimated; leave it out");
    }
    if !matches!(options.focus.unwrap_or_default(), Focus::Auto | Focus::Prediction) {
        return refused(
            "focus",
            "models in state space are of predictions; leave it out, or give `refine` simulation",
        );
    }
    if options.is_without_inputs() && !options.input.is_empty() {
        return refused("nb", "0 makes a model without inputs; leave out `input` or `nb`");
    }
    Ok(())
}
