//! What a criterion asks of the parameters, as linear limits that keep the words of the person who asked.

use std::ops::Range;

use thetahat_core::nalgebra::DVector;
use thetahat_numerics::regression::convex::{Fitting, Limit};

use super::{ConvexFit, GainBound, check_range};
use crate::Error;
use crate::model::Orders;

/// An end of a limit is active if a move of the predictions by this part of the residuals' RMS could reach it.
const ACTIVE: f64 = 1e-8;
/// And if rounding explains the distance, in units of the terms of the limit.
const ACTIVE_ROUNDING: f64 = 1e-14;

/// Something that was asked for, in words and as limits of the parameters.
struct Demand {
    words: String,
    /// The indices of its limits.
    limits: Range<usize>,
    /// The parameter that it bounds, and nothing else.
    parameter: Option<usize>,
}

/// What a criterion asks of the parameters of given orders.
pub(super) struct Demands {
    demands: Vec<Demand>,
    pub(super) limits: Vec<Limit>,
}

impl Demands {
    /// # Errors
    /// [`Error::Argument`] for whatever makes no sense, with the names that do.
    pub(super) fn new(criterion: &ConvexFit, inputs: &[String], orders: &Orders) -> Result<Self, Error> {
        let ridge = criterion.ridge;
        if !(ridge.is_finite() && ridge >= 0.0) {
            return Err(Error::argument(
                "ridge",
                format!("{ridge} is not a weight; give 0 or a positive number"),
            ));
        }
        if let Some(bound) = criterion.noise_bound.filter(|bound| !(bound.is_finite() && *bound >= 0.0)) {
            return Err(Error::argument(
                "noise-bound",
                format!("{bound} is not a size of e; give a positive number in units of the output"),
            ));
        }
        let named = inputs.len();
        let (nb, nk) = (orders.nb[..named].to_vec(), orders.nk[..named].to_vec());
        let named = Orders { nb, nk, nf: vec![0; named], ..orders.clone() };
        // The others have their parameters after these.
        let (names, size) = (named.names(), orders.parameters());
        let mut demands = Self { demands: Vec::new(), limits: Vec::new() };
        for bound in &criterion.bounds {
            let words = bound.to_string();
            check_range("bounds", &words, bound.low, bound.high)?;
            let parameter = names.iter().position(|name| *name == bound.parameter).ok_or_else(|| {
                Error::argument(
                    "bounds",
                    format!(
                        "{words}: there is no parameter '{}'; there are: {}",
                        bound.parameter,
                        names.join(", ")
                    ),
                )
            })?;
            let mut coefficients = DVector::zeros(size);
            coefficients[parameter] = 1.0;
            let limit = Limit { coefficients, low: bound.low, high: bound.high };
            demands.add(words, [limit], Some(parameter));
        }
        for gain in &criterion.dc_gain {
            let words = format!("dc-gain {gain}");
            check_range("dc-gain", &words, gain.low, gain.high)?;
            let input = gained(gain, &words, inputs, orders)?;
            demands.add(words, gain_limits(gain, input, orders), None);
        }
        Ok(demands)
    }

    fn add(&mut self, words: String, limits: impl IntoIterator<Item = Limit>, parameter: Option<usize>) {
        let first = self.limits.len();
        self.limits.extend(limits);
        self.demands.push(Demand { words, limits: first..self.limits.len(), parameter });
    }

    /// The limits of some of the demands.
    pub(super) fn limits_of(&self, some: &[usize]) -> Vec<Limit> {
        some.iter().flat_map(|&demand| self.limits[self.demands[demand].limits.clone()].to_vec()).collect()
    }

    /// The words of some of the demands.
    pub(super) fn words_of(&self, some: &[usize]) -> String {
        let words: Vec<&str> = some.iter().map(|&demand| self.demands[demand].words.as_str()).collect();
        match words.as_slice() {
            [all @ .., last] if !all.is_empty() => format!("{} and {last}", all.join(", ")),
            _ => words.concat(),
        }
    }

    /// Whether all hold strictly.
    pub(super) fn hold(&self, parameters: &DVector<f64>) -> bool {
        self.limits.iter().all(|limit| {
            let value = limit.coefficients.dot(parameters);
            limit.low < value && value < limit.high
        })
    }

    /// Of the demands as few as cannot hold together: each is left out in turn, and stays out if the rest still cannot
    /// (the deletion filter of Chinneck and Dravnieks, ORSA Journal on Computing 3 (1991)).
    pub(super) fn clash(&self, mut impossible: impl FnMut(&[usize]) -> bool) -> Vec<usize> {
        let mut clash: Vec<usize> = (0..self.demands.len()).collect();
        for demand in 0..self.demands.len() {
            let without: Vec<usize> = clash.iter().copied().filter(|other| *other != demand).collect();
            if impossible(&without) {
                clash = without;
            }
        }
        clash
    }

    /// Puts parameters that are at an end of their bound on it, and the others inside; the indices of active limits.
    pub(super) fn settle(
        &self,
        fitting: &Fitting<'_>,
        unit: f64,
        parameters: &mut DVector<f64>,
    ) -> Vec<usize> {
        let mut active = Vec::new();
        for demand in &self.demands {
            for index in demand.limits.clone() {
                let Limit { coefficients, low, high } = &self.limits[index];
                let value = coefficients.dot(parameters);
                let terms = coefficients.component_mul(parameters).lp_norm(1);
                let far = |end: &f64| (value - end).abs();
                let nearest = if far(low) <= far(high) { low } else { high };
                let rounding = ACTIVE_ROUNDING * (terms + nearest.abs());
                let is_near = far(nearest) <= ACTIVE * fitting.reach(index, unit) + rounding;
                let end = (low == high || nearest.is_finite() && is_near).then_some(nearest);
                active.extend(end.map(|_| index));
                if let Some(parameter) = demand.parameter {
                    parameters[parameter] = end.copied().unwrap_or(parameters[parameter]).clamp(*low, *high);
                }
            }
        }
        active
    }

    /// Puts the ends of the parameters' extents inside their bounds.
    pub(super) fn clamp(&self, extents: &mut [[f64; 2]]) {
        for demand in &self.demands {
            if let Some(parameter) = demand.parameter {
                for limit in &self.limits[demand.limits.clone()] {
                    extents[parameter] = extents[parameter].map(|end| end.clamp(limit.low, limit.high));
                }
            }
        }
    }

    /// The words of the demands to which limits of these indices belong.
    pub(super) fn words_at(&self, limits: &[usize]) -> Vec<String> {
        let at = |demand: &&Demand| limits.iter().any(|index| demand.limits.contains(index));
        self.demands.iter().filter(at).map(|demand| demand.words.clone()).collect()
    }
}

/// The input that a gain is asked of.
fn gained(gain: &GainBound, words: &str, inputs: &[String], orders: &Orders) -> Result<usize, Error> {
    let wrong = |message: String| Error::argument("dc-gain", format!("{words}: {message}"));
    let input = match (&gain.input, inputs) {
        (_, []) => return Err(wrong("the model has no input".to_owned())),
        (None, [_]) => 0,
        (None, _) => {
            return Err(wrong(format!(
                "say of which input, as in {}={gain}; there are: {}",
                inputs[0],
                inputs.join(", ")
            )));
        }
        (Some(name), _) => inputs
            .iter()
            .position(|input| input == name)
            .ok_or_else(|| wrong(format!("there is no input '{name}'; there are: {}", inputs.join(", "))))?,
    };
    if orders.nb[input] == 0 {
        return Err(wrong(format!("input '{}' has no B (nb = 0), so that its gain is 0", inputs[input])));
    }
    Ok(input)
}

/// `low A(1) <= B_j(1) <= high A(1)` and, unless that is an equation, `A(1) >= 0`.
fn gain_limits(gain: &GainBound, input: usize, orders: &Orders) -> Vec<Limit> {
    let size = orders.parameters();
    let first = orders.na + orders.nb[..input].iter().sum::<usize>();
    let own = first..first + orders.nb[input];
    // B(1) - g A(1) is the sum of b, less g times the sum of a, less g.
    let against = |weight: f64| {
        DVector::from_fn(size, |index, _| {
            if index < orders.na { -weight } else { f64::from(u8::from(own.contains(&index))) }
        })
    };
    if gain.low == gain.high {
        return vec![Limit { coefficients: against(gain.low), low: gain.low, high: gain.low }];
    }
    let mut limits = Vec::new();
    if gain.low.is_finite() {
        limits.push(Limit { coefficients: against(gain.low), low: gain.low, high: f64::INFINITY });
    }
    if gain.high.is_finite() {
        limits.push(Limit { coefficients: against(gain.high), low: f64::NEG_INFINITY, high: gain.high });
    }
    if orders.na > 0 {
        let a = DVector::from_fn(size, |index, _| f64::from(u8::from(index < orders.na)));
        limits.push(Limit { coefficients: a, low: -1.0, high: f64::INFINITY });
    }
    limits
}
