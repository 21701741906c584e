//! Models of polynomials, and impulse responses.

use std::borrow::Cow;
use std::sync::Arc;

use thetahat_numerics::optimize::Monitor;

use super::method;
use super::orders::GivenOrders;
use super::{Common, Draft, KindPlan, common};
use crate::Error;
use crate::data::{Log, Source};
use crate::estimate::{Constant, Initial, Method};
use crate::plan::{FitOptions, LikelihoodWord};
use crate::report::{NormalEquations, PendingEvaluation, Plan, Report, identify_monitored};
use crate::select::{Automatic, Choice, Select};

/// A model of polynomials of which the channels are open.
#[derive(Debug)]
pub(super) struct PolynomialDraft {
    orders: GivenOrders,
    /// The rest of the plan.
    plan: Plan,
}

impl PolynomialDraft {
    pub(super) fn new(options: &FitOptions) -> Result<Self, Error> {
        let orders = GivenOrders::new(options)?;
        let Common { estimate, validate, split, detrend, offsets } = common(options)?;
        let draft = Self {
            plan: Plan {
                estimate,
                validate,
                split,
                detrend,
                offsets,
                prefilter: options.prefilter,
                select: select(options, &orders)?,
                focus: options.focus.unwrap_or_default(),
                method: method::method(options, &orders)?,
                initial: initial(options, &orders)?,
                constant: options.constant.unwrap_or_default(),
                trend: options.trend,
                uses_outliers: options.norm.is_some(),
                ..Plan::new(&[], "", Choice::Automatic(Automatic::default()))
            },
            orders,
        };
        let plan = &draft.plan;
        let validates = !plan.validate.is_empty() || plan.split.is_some_and(|split| split.validates());
        if plan.select == Select::Validation && !validates {
            return Err(Error::argument(
                "select",
                "validation needs rows for it: give `split` 60/20/20, or `estimate` and `validate`",
            ));
        }
        if plan.trend && plan.constant == Constant::No {
            return Err(Error::argument(
                "trend",
                "it is a line with a level, which is the constant; leave it or `constant` no out",
            ));
        }
        if let Some(inputs) = options.inputs() {
            if !draft.orders.has_inputs() {
                return Err(Error::argument(
                    "input",
                    "the orders make a model without inputs; leave it out, or give an `nb` above 0",
                ));
            }
            draft.orders.of(inputs.len())?;
        }
        if options.output.len() > 1 {
            return Err(several(None));
        }
        Ok(draft)
    }
}

impl Draft for PolynomialDraft {
    fn is_driven(&self) -> bool {
        self.orders.has_inputs()
    }

    fn asks_for_no_inputs(&self) -> &'static str {
        "`nb` 0"
    }

    fn is_one_step(&self) -> bool {
        let squares = matches!(self.plan.method, Method::PredictionError(_));
        self.orders.is_linear() && !self.orders.is_choice() && squares
    }

    fn check_inputs(&self, count: usize) -> Result<(), Error> {
        self.orders.of(count).map(|_| ())
    }

    fn plan(&self, inputs: Vec<String>, mut outputs: Vec<String>) -> Result<Arc<dyn KindPlan>, Error> {
        if outputs.len() > 1 {
            return Err(several(Some(&outputs)));
        }
        let output = outputs.pop().unwrap_or_default();
        if inputs.is_empty() && self.orders.has_inputs() && self.orders.is_given() {
            return Err(Error::argument(
                "nb",
                "the log has no inputs; give it some, or orders of a time series",
            ));
        }
        Ok(Arc::new(Plan { choice: self.orders.of(inputs.len())?, inputs, output, ..self.plan.clone() }))
    }
}

impl KindPlan for Plan {
    fn fit(&self, log: Cow<'_, Log>, sources: &[Source], monitor: Monitor<'_>) -> Result<Report, Error> {
        identify_monitored(log.into_owned(), sources, self, monitor)
    }

    fn begin(
        &self,
        log: Cow<'_, Log>,
        sources: &[Source],
        monitor: Monitor<'_>,
    ) -> Result<PendingEvaluation, Error> {
        PendingEvaluation::new(log.into_owned(), sources, self, monitor)
    }

    fn check_pieces(&self) -> Result<(), Error> {
        match &self.choice {
            Choice::Known(_) => Ok(()),
            Choice::Grid(_) | Choice::Automatic(_) => Err(Error::argument(
                "stream",
                "one pass over the log makes one model; give its orders, such as `na` 2 and `nb` 2",
            )),
        }
    }

    fn lags(&self) -> usize {
        if let Choice::Known(orders) = &self.choice { orders.maximum_lag() } else { 0 }
    }

    fn pieces(&self, log: &Log, sources: &[Source], past: usize) -> Result<NormalEquations, Error> {
        NormalEquations::new(log, sources, self, past)
    }

    fn polynomial(&self) -> Option<&Plan> {
        Some(self)
    }
}

/// There are several outputs.
fn several(outputs: Option<&[String]>) -> Error {
    let named = outputs.map_or(String::new(), |outputs| format!("there are {}: ", outputs.join(", ")));
    Error::argument(
        "output",
        format!(
            "{named}a polynomial model with C, D or F has one output; fit one after the other, or all at once with `model` arx, \
             `model` ss, `narx` or `grey`"
        ),
    )
}

fn select(options: &FitOptions, orders: &GivenOrders) -> Result<Select, Error> {
    if options.select.is_some() && !orders.is_choice() {
        return Err(Error::argument(
            "select",
            "chooses among several models, and the orders say one; give ranges such as `na` 1..10, or no orders",
        ));
    }
    Ok(options.select.unwrap_or_default())
}

fn initial(options: &FitOptions, orders: &GivenOrders) -> Result<Initial, Error> {
    let exact = options.likelihood == Some(LikelihoodWord::Exact);
    let initial = options.initial.unwrap_or_default();
    let refused = |message| Err(Error::argument("initial", message));
    match initial {
        Initial::Drop if exact => refused(
            "drop leaves samples out, and `likelihood` exact is that of all of them; use auto, zero or estimate",
        ),
        Initial::Estimate if exact && !orders.has_inputs() => refused(
            "estimate finds what inputs did before the first row, and this model has none; leave it out",
        ),
        Initial::Drop if orders.is_filtered() => refused(
            "drop is for models without F, whose errors depend on few samples; use zero, estimate or auto",
        ),
        Initial::Estimate if !exact && orders.is_never_filtered() => refused(
            "estimate is for models with F: without it, unknown samples reach no further than a few errors, which drop leaves \
             out; use drop, zero or auto",
        ),
        Initial::Auto | Initial::Drop | Initial::Zero | Initial::Estimate => Ok(initial),
    }
}
