//! The inputs that stand for a constant and a trend, and what their coefficients say of the output.

use std::ops::Range;

use super::super::{Estimate, Procedure};
use super::{Fitted, OutputOffset};
use crate::Error;
use crate::data::{Log, Offset};
use crate::model::{OffsetCovariance, Orders, Quantity, is_covariance};

/// Of A(1) nothing but rounding is left below this fraction of the sum of |a_i|: there is no level.
const INTEGRATOR: f64 = 1e-9;

/// The constant and the trend that may be estimated beside the parameters of some rows.
#[derive(Debug, Clone)]
pub(crate) struct Beside {
    rows: usize,
    /// r, one value for each row, where there is a trend.
    pub(super) ramp: Option<Vec<f64>>,
    /// t_m and h, in seconds.
    middle: f64,
    half: f64,
    sample_time: f64,
}

impl Beside {
    /// # Errors
    /// [`Error::Argument`] for a trend through several logs.
    pub(crate) fn new(log: &Log, segments: &[Range<usize>], trend: bool) -> Result<Self, Error> {
        if trend && log.is_joined() {
            return Err(Error::argument(
                "trend",
                "several logs have no common clock for a line; leave it out, or fit one log",
            ));
        }
        let first = segments.first().map_or(0.0, |segment| log.elapsed(segment.start));
        let last = segments.last().map_or(0.0, |segment| log.elapsed(segment.end - 1));
        let (middle, half) = (f64::midpoint(first, last), 0.5 * (last - first));
        let half = if half > 0.0 { half } else { 1.0 };
        let at = |row: usize| (log.elapsed(row) - middle) / half;
        let ramp = trend.then(|| (0..log.rows()).map(at).collect());
        Ok(Self { rows: log.rows(), ramp, middle, half, sample_time: log.sample_time() })
    }

    /// A constant alone, for so many rows.
    pub(crate) fn constant(rows: usize, sample_time: f64) -> Self {
        Self { rows, ramp: None, middle: 0.0, half: 1.0, sample_time }
    }

    /// Whether there is a trend beside the constant.
    pub(super) fn has_trend(&self) -> bool {
        self.ramp.is_some()
    }

    /// How many inputs these are.
    pub(crate) fn count(&self) -> usize {
        1 + usize::from(self.ramp.is_some())
    }

    /// 1 and r.
    pub(crate) fn signals(&self) -> Vec<Vec<f64>> {
        std::iter::once(vec![1.0; self.rows]).chain(self.ramp.clone()).collect()
    }

    /// Where their coefficients stand among the parameters of a model of these orders with them.
    pub(super) fn places(&self, orders: &Orders) -> Range<usize> {
        let first = orders.na + orders.nb.iter().sum::<usize>();
        first..first + self.count()
    }

    /// The parameters of a model with them, of one without: both are zero.
    pub(super) fn with_zeros(&self, orders: &Orders, parameters: &[f64]) -> Vec<f64> {
        let (before, after) = parameters.split_at(self.places(orders).start);
        [before, &vec![0.0; self.count()], after].concat()
    }

    /// The parameters of a model without them, of one with them.
    pub(super) fn without(&self, orders: &Orders, parameters: &[f64]) -> Vec<f64> {
        let places = self.places(orders);
        [&parameters[..places.start], &parameters[places.end..]].concat()
    }

    /// The covariance of all parameters, and what they would change, as those of a line l(t) = level + slope (t - t_m)
    /// beside which nothing is left:
    ///
    /// ```text
    /// d kappa = dk - sum_i da_i (level - slope i T),   d mu = dm/h - slope sum_i da_i
    /// ```
    ///
    /// as A(q) (y - l) changes by them.
    pub(super) fn open(
        &self,
        orders: &Orders,
        rows: &[Vec<f64>],
        step: &[f64],
        [level, slope]: [f64; 2],
    ) -> Option<OffsetCovariance> {
        let places = self.places(orders);
        let own = (0..rows.len()).filter(|k| !places.contains(k)).map(|k| vec![(k, 1.0)]);
        let lags = || (0..orders.na).zip(1_u32..);
        let constant = lags().map(|(k, lag)| (k, f64::from(lag) * self.sample_time * slope - level));
        let constant: Vec<(usize, f64)> = constant.chain([(places.start, 1.0)]).collect();
        let trend =
            || lags().map(|(k, _)| (k, -slope)).chain([(places.start + 1, 1.0 / self.half)]).collect();
        let more = std::iter::once(constant).chain(self.ramp.is_some().then(trend));
        let gradients: Vec<Vec<(usize, f64)>> = own.chain(more).collect();
        let along = |gradient: &[(usize, f64)]| gradient.iter().map(|(k, g)| g * step[*k]).sum::<f64>();
        let entry = |left: &[(usize, f64)], right: &[(usize, f64)]| {
            let row = |row: &[f64]| right.iter().map(|(k, g)| g * row[*k]).sum::<f64>();
            left.iter().map(|(k, g)| g * row(&rows[*k])).sum::<f64>() + along(left) * along(right)
        };
        let line = |left: &Vec<(usize, f64)>| gradients.iter().map(|right| entry(left, right)).collect();
        let covariance: Vec<Vec<f64>> = gradients.iter().map(line).collect();
        let middle = self.ramp.is_some().then_some(self.middle);
        is_covariance(&covariance).then_some(OffsetCovariance { covariance, middle })
    }

    /// The model's own estimate of one with a constant, and the offset. None where there is no level.
    pub(super) fn apart(&self, orders: &Orders, all: Estimate) -> Option<Fitted> {
        let places = self.places(orders);
        let a = &all.parameters[..orders.na];
        let gain = 1.0 + a.iter().sum::<f64>();
        if gain.abs() <= INTEGRATOR * (1.0 + a.iter().map(|a| a.abs()).sum::<f64>()) {
            return None;
        }
        let delay: f64 = a.iter().zip(1_u32..).map(|(a, lag)| f64::from(lag) * a).sum();
        let (constant, ramp) = (all.parameters[places.start], self.ramp.is_some());
        // In units of the output over one sample.
        let trend = if ramp { all.parameters[places.start + 1] / self.half } else { 0.0 };
        let drift = self.sample_time * trend;
        let slope = trend / gain;
        let level = (constant + drift * delay / gain) / gain;
        let mut of_level = vec![0.0; all.parameters.len()];
        let mut of_slope = of_level.clone();
        for (lag, (level, slope)) in (1_u32..).zip(of_level.iter_mut().zip(&mut of_slope)).take(orders.na) {
            *level = (-constant + drift * (f64::from(lag) - 2.0 * delay / gain)) / (gain * gain);
            *slope = -trend / (gain * gain);
        }
        of_level[places.start] = 1.0 / gain;
        if ramp {
            of_level[places.start + 1] = self.sample_time * delay / (self.half * gain * gain);
            of_slope[places.start + 1] = 1.0 / (self.half * gain);
        }
        let error = |gradient: &[f64]| {
            let row = |row: &Vec<f64>| row.iter().zip(gradient).map(|(entry, g)| entry * g).sum::<f64>();
            let variance = |covariance: &[Vec<f64>]| {
                covariance.iter().zip(gradient).map(|(entries, g)| g * row(entries)).sum::<f64>()
            };
            all.covariance().map(variance).filter(|variance| *variance >= 0.0).map(f64::sqrt)
        };
        let level = Quantity::new(level, error(&of_level));
        let slope = ramp.then(|| Quantity::new(slope, error(&of_slope)));
        let rise = slope.map_or(0.0, |slope| slope.value);
        let offset = OutputOffset {
            offset: Offset { level: level.value - rise * self.middle, slope: rise },
            level,
            slope,
            middle: self.middle,
        };
        let finite = [offset.offset.level, offset.offset.slope].into_iter().all(f64::is_finite);
        let still = vec![0.0; all.parameters.len()];
        let open = all.covariance().and_then(|rows| self.open(orders, rows, &still, [level.value, rise]));
        let criteria = all.criteria();
        let own = |values: &Vec<f64>| self.without(orders, values);
        let covariance = all.covariance.as_ref().map(|rows| {
            let rows = rows.iter().enumerate().filter(|(row, _)| !places.contains(row));
            rows.map(|(_, row)| own(row)).collect()
        });
        let mut procedure = all.procedure.clone();
        if let Procedure::Constrained(outcome) = &mut procedure
            && let Some(extents) = &mut outcome.box_
        {
            extents.truncate(places.start);
        }
        let estimate = Estimate { parameters: own(&all.parameters), covariance, procedure, ..all };
        finite.then_some(Fitted { estimate, criteria, offset: Some(offset), open })
    }
}
