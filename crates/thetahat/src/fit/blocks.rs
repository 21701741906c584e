//! Models in blocks.

use std::borrow::Cow;
use std::sync::Arc;

use thetahat_numerics::optimize::Monitor;

use super::{Draft, KindPlan, equations};
use crate::Error;
use crate::data::{Log, Source};
use crate::estimate::{BlockStructure, CurveForm};
use crate::plan::{CurveWord, FitOptions, OrderOption};
use crate::report::{BlocksPlan, Report, fit_blocks};

/// A model in blocks of which the channels are open.
#[derive(Debug)]
pub(super) struct BlocksDraft {
    delays: Vec<usize>,
    plan: BlocksPlan,
}

impl BlocksDraft {
    pub(super) fn new(options: &FitOptions) -> Result<Self, Error> {
        let refused = |option: &str, message: &str| Err(Error::argument(option, message));
        let Some(structure) = options.blocks else {
            return refused("blocks", "name a structure, such as wiener");
        };
        let orders = match options.order {
            Some(OrderOption::Arima(_)) => {
                return refused(
                    "order",
                    "p,d,q is of `model` arima; write it as N or A..B, such as 2 or 1..4",
                );
            }
            Some(OrderOption::States(order)) => Some((order.first(), order.last())),
            None => None,
        };
        let curve = match (options.curve, options.knots, options.degree) {
            (None | Some(CurveWord::Lines), Some(knots), None) => Some(CurveForm::Lines(Some(knots))),
            (Some(CurveWord::Lines), None, None) => Some(CurveForm::Lines(None)),
            (None | Some(CurveWord::Poly), None, Some(degree)) => Some(CurveForm::Polynomial(degree)),
            (Some(CurveWord::Poly), None, None) => Some(CurveForm::Polynomial(3)),
            (None, None, None) => None,
            (_, Some(_), _) => return refused("knots", "they are of `curve` lines, which has no `degree`"),
            (_, None, Some(_)) => return refused("degree", "it is of `curve` poly; lines have `knots`"),
        };
        let delays = options.nk.iter().map(|nk| {
            nk.0.single().ok_or_else(|| {
                Error::argument(
                    "nk",
                    format!("{}: a model in blocks takes one delay for each input, or finds it", nk.0),
                )
            })
        });
        let delays: Vec<usize> = delays.collect::<Result<_, _>>()?;
        let plan = BlocksPlan {
            inputs: Vec::new(),
            output: String::new(),
            structure,
            orders,
            delays: None,
            curve,
            fit: equations(options)?,
        };
        if structure == BlockStructure::Feedback && options.curve == Some(CurveWord::Lines) {
            return refused("curve", "a feedback takes poly: lines and its poles say the same");
        }
        Ok(Self { delays, plan })
    }
}

impl Draft for BlocksDraft {
    fn plan(&self, inputs: Vec<String>, outputs: Vec<String>) -> Result<Arc<dyn KindPlan>, Error> {
        let [output] = &outputs[..] else {
            return Err(Error::argument(
                "output",
                "a model in blocks has one output; fit one after the other",
            ));
        };
        let delays = match &self.delays[..] {
            [] => None,
            [one] => Some(vec![*one; inputs.len()]),
            several => Some(several.to_vec()),
        };
        let plan = BlocksPlan { output: output.clone(), inputs, delays, ..self.plan.clone() };
        plan.check()?;
        Ok(Arc::new(plan))
    }
}

impl KindPlan for BlocksPlan {
    fn fit(&self, log: Cow<'_, Log>, sources: &[Source], monitor: Monitor<'_>) -> Result<Report, Error> {
        fit_blocks(&log, sources, self, monitor)
    }
}
