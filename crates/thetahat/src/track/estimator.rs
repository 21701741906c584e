//! The estimators of thetahat-core, with orders and policy known at run time.

use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::Dyn;
use thetahat_core::{
    ArmaxOrders, ArxOrders, Error, Innovation, InputOrders, Lags, RecursiveArmax, RecursiveArx,
    RecursiveLeastSquares, RecursiveNarx, Scaling,
};

use super::plan::{PerChannel, TrackPlan};
use crate::model::{Functions, Map, Orders};

/// Delay lines.
pub(super) type DelayLines = Lags<f64, Dyn, Dyn>;

/// An estimator of one of the kinds.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) enum Estimator {
    Arx(RecursiveArx<f64, Dyn, Dyn>),
    Armax(RecursiveArmax<f64, Dyn, Dyn>),
    Narx(RecursiveNarx<f64, Functions, Dyn, Dyn, Dyn>),
}

impl Estimator {
    /// The estimator of a plan that knows nothing yet: of the lags themselves, or of functions of them.
    pub(super) fn new(
        orders: &Orders,
        map: Option<&Map>,
        plan: &TrackPlan,
        scales: &PerChannel,
    ) -> Result<Self, Error> {
        let inputs: Vec<InputOrders> =
            orders.nb.iter().zip(&orders.nk).map(|(&nb, &nk)| InputOrders { nb, nk }).collect();
        let (na, nc, constant, forgetting) = (orders.na, orders.nc, plan.constant, plan.forgetting.0);
        let PerChannel { inputs: input_scales, output } = scales;
        if let Some(map) = map {
            // Offsets were taken off before.
            let scaling = |scale: &f64| Scaling { offset: 0.0, scale: *scale };
            let orders = ArxOrders { na, inputs: &inputs, constant: false };
            let functions = Functions::new(map.clone(), orders.parameters()).map_err(|_| Error::Length {
                argument: "map",
                expected: orders.parameters(),
                found: 0,
            })?;
            let scalings: Vec<Scaling<f64>> = input_scales.iter().map(scaling).collect();
            let estimator = RecursiveNarx::new(functions, &orders, scaling(output), &scalings, forgetting)?;
            let estimator = estimator.with_start(plan.start.0)?.with_dead_zone(plan.dead_zone)?;
            return Ok(Self::Narx(estimator.with_outliers(plan.outliers.0)?));
        }
        match plan.method.with_noise_model() {
            None => {
                let orders = ArxOrders { na, inputs: &inputs, constant };
                let estimator = RecursiveArx::new(&orders, *output, input_scales, forgetting)?;
                let estimator = estimator.with_start(plan.start.0)?.with_dead_zone(plan.dead_zone)?;
                Ok(Self::Arx(estimator.with_outliers(plan.outliers.0)?))
            }
            Some(method) => {
                let noise = plan.noise_scale.unwrap_or(output / 10.0);
                let orders = ArmaxOrders { na, inputs: &inputs, nc, constant };
                let estimator =
                    RecursiveArmax::new(&orders, method, *output, input_scales, noise, forgetting)?;
                let estimator = estimator.with_dead_zone(plan.dead_zone)?;
                Ok(Self::Armax(estimator.with_outliers(plan.outliers.0)?))
            }
        }
    }

    pub(super) fn log_row(&mut self, output: f64, inputs: &[f64]) -> Result<Innovation<f64>, Error> {
        match self {
            Self::Arx(arx) => arx.log_row(output, inputs),
            Self::Armax(armax) => armax.log_row(output, inputs),
            Self::Narx(narx) => narx.log_row(output, inputs),
        }
    }

    /// The outputs to come, computed in delay lines that are lost; NaN where they depend on a missing sample, or
    /// overflow.
    pub(super) fn predict(&self, workspace: &mut DelayLines, inputs: &[f64], outputs: &mut [f64]) {
        let predicted = match self {
            Self::Arx(arx) => arx.predict_in(workspace, inputs, outputs),
            Self::Armax(armax) => armax.predict_in(workspace, inputs, outputs),
            Self::Narx(narx) => narx.predict_in(workspace, inputs, outputs),
        };
        // After an overflow what is beyond it is NaN already; with inputs of another length nothing was written.
        if let Err(Error::Length { .. } | Error::Infinite { .. }) = predicted {
            outputs.fill(f64::NAN);
        }
    }

    pub(super) fn gap(&mut self) {
        match self {
            Self::Arx(arx) => arx.gap(),
            Self::Armax(armax) => armax.gap(),
            Self::Narx(narx) => narx.gap(),
        }
    }

    pub(super) fn lines(&self) -> &DelayLines {
        match self {
            Self::Arx(arx) => arx.lags(),
            Self::Armax(armax) => armax.lags(),
            Self::Narx(narx) => narx.model().lags(),
        }
    }

    pub(super) fn least_squares(&self) -> &RecursiveLeastSquares<f64, Dyn> {
        match self {
            Self::Arx(arx) => arx.estimator(),
            Self::Armax(armax) => armax.estimator(),
            Self::Narx(narx) => narx.estimator(),
        }
    }

    /// The variance of e, in squared units of the output.
    pub(super) fn noise_variance(&self) -> Option<f64> {
        match self {
            Self::Narx(narx) => narx.noise_variance(),
            _ => self.least_squares().noise_variance(),
        }
    }

    /// The functions of the lags; none where the lags are the regressor.
    fn map(&self) -> Option<&Map> {
        match self {
            Self::Narx(narx) => Some(narx.model().basis().map()),
            _ => None,
        }
    }

    /// Whether it has the orders and the policy of this one.
    pub(super) fn fits(&self, fresh: &Self) -> bool {
        let forgetting = |estimator: &Self| estimator.least_squares().forgetting();
        self.counts().eq(fresh.counts()) && forgetting(self) == forgetting(fresh) && self.map() == fresh.map()
    }

    /// How many coefficients there are of A, of C and of each B, with their leading ones and zeros; whether there is a
    /// constant, and how many parameters.
    fn counts(&self) -> impl Iterator<Item = usize> {
        let (outputs, noise, constant) = match self {
            Self::Arx(arx) => (arx.a().count(), 0, arx.constant()),
            Self::Armax(armax) => (armax.a().count(), armax.c().count(), armax.constant()),
            Self::Narx(narx) => (narx.model().regressors(), 0, None),
        };
        let inputs = (0..).map_while(|input| match self {
            Self::Arx(arx) => arx.b(input).map(Iterator::count),
            Self::Armax(armax) => armax.b(input).map(Iterator::count),
            Self::Narx(narx) => narx.model().lags_of(input),
        });
        [outputs, noise, usize::from(constant.is_some()), self.least_squares().parameters().len()]
            .into_iter()
            .chain(inputs)
    }
}
