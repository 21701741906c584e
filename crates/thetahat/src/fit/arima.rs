//! Seasonal ARIMA models.

use std::borrow::Cow;
use std::sync::Arc;

use thetahat_numerics::optimize::Monitor;

use super::{Common, Draft, KindPlan, common, search};
use crate::Error;
use crate::data::{Log, Source};
use crate::estimate::Constant;
use crate::model::ArimaOrders;
use crate::plan::{FitOptions, OrderOption};
use crate::report::{ArimaPlan, Report, fit_arima};

/// A seasonal ARIMA model of which the channels are open.
#[derive(Debug)]
pub(super) struct ArimaDraft {
    driven: bool,
    delays: Vec<usize>,
    plan: ArimaPlan,
}

impl ArimaDraft {
    pub(super) fn new(options: &FitOptions) -> Result<Self, Error> {
        let order = match options.order {
            Some(OrderOption::Arima(order)) => order,
            Some(OrderOption::States(_)) | None => {
                return Err(Error::argument("order", "arima needs p,d,q, such as 1,1,1: three numbers"));
            }
        };
        if options.output.len() > 1 {
            return Err(Error::argument("output", "an ARIMA model has one output; fit one after the other"));
        }
        let single = |nk: &crate::plan::DelayRange| {
            nk.0.single().ok_or_else(|| {
                Error::argument("nk", "`model` arima is one model: give one value for each input")
            })
        };
        let delays: Vec<usize> = options.nk.iter().map(single).collect::<Result<_, _>>()?;
        let inputs = options.inputs();
        let driven = inputs.is_some();
        if !driven && !delays.is_empty() {
            return Err(Error::argument("nk", "it is the delay of an input, and `input` names none"));
        }
        let Common { estimate, validate, split, .. } = common(options)?;
        let plan = ArimaPlan {
            inputs: inputs.unwrap_or_default(),
            output: String::new(),
            orders: ArimaOrders::new(order, options.seasonal.map(|seasonal| seasonal.0))?,
            delays: Vec::new(),
            estimate,
            validate,
            split,
            constant: options.constant.unwrap_or(Constant::Auto),
            trend: options.trend,
            search: search::search(options)?,
        };
        plan.check()?;
        Ok(Self { driven, delays, plan })
    }
}

impl Draft for ArimaDraft {
    fn is_driven(&self) -> bool {
        self.driven
    }

    fn asks_for_no_inputs(&self) -> &'static str {
        "no `input`"
    }

    fn plan(&self, inputs: Vec<String>, mut outputs: Vec<String>) -> Result<Arc<dyn KindPlan>, Error> {
        let delays = match &*self.delays {
            [] => vec![0; inputs.len()],
            [one] => vec![*one; inputs.len()],
            several => several.to_vec(),
        };
        let output = outputs.pop().unwrap_or_default();
        let plan = ArimaPlan { inputs, output, delays, ..self.plan.clone() };
        plan.check()?;
        Ok(Arc::new(plan))
    }
}

impl KindPlan for ArimaPlan {
    fn fit(&self, log: Cow<'_, Log>, sources: &[Source], monitor: Monitor<'_>) -> Result<Report, Error> {
        fit_arima(&log, sources, self, monitor)
    }
}
