//! Models of the form A y = sum_j B_j u_j + C e, by way of a long ARX model of the same data.
//!
//! Source: Hannan and Rissanen, Recursive estimation of mixed autoregressive-moving average order, Biometrika 69, 1982;
//! Hannan and Kavalieris, Multivariate linear time series models, Advances in Applied Probability 16, 1984 (the third
//! stage).

use std::ops::Range;

use thetahat_core::nalgebra::Cholesky;
use thetahat_numerics::regression::{Lagged, Presample, Taps};

use super::plant::{Input, add_delayed, divided, energy, multiplied};
use super::stable;

/// What is added to the diagonal of long regressions, as a fraction: then data without noise have a solution too, the
/// shortest, of which the superfluous poles are inside the unit circle (Kumaresan and Tufts 1982).
const RIDGE: f64 = 1e-12;
/// Below this fraction of sum y^2, what a long model leaves is rounding.
const EXACT: f64 = 1e-20;

/// A y = sum_j B_j u_j + C e, A having `order` coefficients.
#[derive(Debug, Clone)]
pub(in crate::estimate) struct Equation<'a> {
    pub(in crate::estimate) output: &'a [f64],
    pub(in crate::estimate) order: usize,
    pub(in crate::estimate) inputs: Vec<Input<'a>>,
    pub(in crate::estimate) segments: &'a [Range<usize>],
}

/// Its polynomials.
#[derive(Debug, Clone)]
pub(in crate::estimate) struct Mixed {
    /// Monic.
    pub(in crate::estimate) a: Vec<f64>,
    /// b of each input.
    pub(in crate::estimate) b: Vec<Vec<f64>>,
    /// Monic and stable.
    pub(in crate::estimate) c: Vec<f64>,
}

impl Equation<'_> {
    /// How many samples before the present one it needs.
    fn maximum_lag(&self) -> usize {
        self.inputs
            .iter()
            .filter(|input| input.count > 0)
            .map(|input| input.first + input.count - 1)
            .fold(self.order, usize::max)
    }

    /// The same for a model of this many coefficients of A and each B.
    fn maximum_lag_of(&self, order: usize) -> usize {
        self.inputs
            .iter()
            .filter(|input| input.count > 0)
            .map(|input| input.first + order - 1)
            .fold(order, usize::max)
    }

    /// How many samples have `past` others before them in their segment.
    fn left(&self, past: usize) -> usize {
        self.segments.iter().map(|segment| segment.len().saturating_sub(past)).sum()
    }

    fn signals(&self) -> Vec<&[f64]> {
        std::iter::once(self.output).chain(self.inputs.iter().map(|input| input.signal)).collect()
    }

    fn taps(&self) -> Vec<Taps> {
        let inputs = self.inputs.iter().enumerate();
        std::iter::once(Taps { signal: 0, first: 1, count: self.order, sign: -1.0 })
            .chain(inputs.map(|(j, input)| Taps {
                signal: j + 1,
                first: input.first,
                count: input.count,
                sign: 1.0,
            }))
            .collect()
    }

    fn parameters(&self) -> usize {
        self.order + self.inputs.iter().map(|input| input.count).sum::<usize>()
    }

    /// theta as polynomials.
    pub(in crate::estimate) fn polynomials(&self, theta: &[f64]) -> Mixed {
        let (a, mut rest) = theta.split_at(self.order.min(theta.len()));
        let mut b = Vec::new();
        for input in &self.inputs {
            let (own, others) = rest.split_at(input.count);
            b.push(own.to_vec());
            rest = others;
        }
        let monic = |values: &[f64]| std::iter::once(1.0).chain(values.iter().copied()).collect();
        Mixed { a: monic(a), b, c: monic(rest) }
    }

    /// A y - sum_j B_j u_j for the samples that have a past of `from`; zero before. O(N p).
    pub(in crate::estimate) fn errors(&self, model: &Mixed, from: usize) -> Vec<f64> {
        let mut errors = multiplied(&model.a, self.output, self.segments);
        for (input, b) in self.inputs.iter().zip(&model.b) {
            let weights: Vec<f64> = b.iter().map(|b| -b).collect();
            add_delayed(&mut errors, &weights, input.signal, input.first, self.segments);
        }
        for segment in self.segments {
            errors[segment.start..segment.end.min(segment.start + from)].fill(0.0);
        }
        errors
    }

    /// Least squares with C = 1 on the samples with a full regressor: exact where columns nearly depend on one another.
    pub(in crate::estimate) fn least_squares(&self) -> Option<Mixed> {
        let lagged = Lagged::new(&self.signals(), self.taps(), self.segments, Presample::Drop);
        if self.parameters() == 0 {
            return Some(self.polynomials(&[]));
        }
        if lagged.rows() <= self.parameters() {
            return None;
        }
        Some(self.polynomials(lagged.solve().ok()?.parameters.as_slice()))
    }

    /// The long ARX model: `order` coefficients of A and of each B. Of short segments, or few samples, fewer.
    pub(in crate::estimate) fn long(&self, order: usize) -> Option<(Mixed, usize)> {
        let samples: usize = self.segments.iter().map(Range::len).sum();
        let mut order = order.min(samples / (5 * (1 + self.inputs.len()))).max(1);
        while order > 1 && 2 * self.left(self.maximum_lag_of(order)) < samples {
            order /= 2;
        }
        // Inputs without B say nothing.
        let input = |own: &Input<'_>| if own.count == 0 { 0 } else { order };
        let inputs = self.inputs.iter().map(|own| Input { count: input(own), ..own.clone() });
        let long = Equation { order, inputs: inputs.collect(), ..*self };
        let lagged = Lagged::new(&long.signals(), long.taps(), self.segments, Presample::Drop);
        if lagged.rows() <= long.parameters() {
            return None;
        }
        let (mut gram, right, _) = lagged.normal_equations();
        let norm = |square: f64| if square > 0.0 { square.sqrt() } else { 1.0 };
        let norms = gram.diagonal().map(norm);
        for (k, mut column) in gram.column_iter_mut().enumerate() {
            column.component_div_assign(&norms);
            column.unscale_mut(norms[k]);
            column[k] = 1.0 + RIDGE * norms.len() as f64;
        }
        let theta = Cholesky::new(gram)?.solve(&right.component_div(&norms)).component_div(&norms);
        let finite = theta.iter().all(|value| value.is_finite());
        finite.then(|| (long.polynomials(theta.as_slice()), order))
    }

    /// The estimate of Hannan and Rissanen with `nc` coefficients of C:
    ///
    /// 1. the residuals e^ of an ARX model of order 10 log10 N;
    /// 2. least squares on y, u and the lagged e^;
    /// 3. one step of Gauss and Newton, on y/C, u/C and e/C, kept if it lowers the cost.
    ///
    /// An unstable C is reflected; of segments too short for that, C = 1. O(N (log N + p)). None where A and B are
    /// undetermined.
    pub(in crate::estimate) fn hannan_rissanen(&self, nc: usize) -> Option<Mixed> {
        if nc == 0 {
            return self.least_squares();
        }
        let samples: usize = self.segments.iter().map(Range::len).sum();
        let mut order = (10.0 * (samples as f64).log10()) as usize;
        // Of short segments a long past leaves too little.
        let left = |order: usize| self.left(self.maximum_lag_of(order) + self.maximum_lag().max(nc));
        // Residuals of a model no longer than this one are combinations of its regressors.
        let least = self.inputs.iter().map(|input| input.count).fold(self.order, usize::max) + 1;
        while order > least && 2 * left(order) < samples {
            order = least.max(order / 2);
        }
        let plain = || {
            let mut model = self.least_squares()?;
            model.c.resize(nc + 1, 0.0);
            Some(model)
        };
        let Some((long, order)) = self.long(order) else { return plain() };
        let lag = self.maximum_lag_of(order);
        let residuals = self.errors(&long, lag);
        let total = energy(self.output, self.segments);
        let left = energy(&residuals, self.segments);
        if left <= EXACT * total {
            // Nothing to see of C.
            return plain();
        }
        let after = after(self.segments, lag);
        let mut signals = self.signals();
        let mut taps = self.taps();
        taps.push(Taps { signal: signals.len(), first: 1, count: nc, sign: 1.0 });
        signals.push(&residuals);
        let second = Lagged::new(&signals, taps, &after, Presample::Drop);
        if second.rows() <= self.parameters() + nc {
            return plain();
        }
        let Ok(solved) = second.solve() else { return plain() };
        let mut model = self.polynomials(solved.parameters.as_slice());
        model.c = stable(&model.c)?.0;
        Some(self.refined(&model).unwrap_or(model))
    }

    /// e = (A y - sum_j B_j u_j)/C, zero where no full regressor is, and its sum of squares.
    fn prediction_errors(&self, model: &Mixed) -> (Vec<f64>, f64) {
        let equation_errors = self.errors(model, self.maximum_lag());
        let mut errors = Vec::new();
        divided(&mut errors, &equation_errors, &model.c, self.segments);
        let cost = energy(&errors, self.segments);
        (errors, cost)
    }

    /// One step of Gauss and Newton, or half of it; none if neither lowers the cost.
    fn refined(&self, model: &Mixed) -> Option<Mixed> {
        let (errors, cost) = self.prediction_errors(model);
        let nc = model.c.len() - 1;
        let mut filtered: Vec<Vec<f64>> = vec![Vec::new(); self.inputs.len() + 2];
        let sources = self.signals().into_iter().chain([errors.as_slice()]);
        for (into, signal) in filtered.iter_mut().zip(sources) {
            divided(into, signal, &model.c, self.segments);
        }
        let mut signals: Vec<&[f64]> = vec![&errors];
        signals.extend(filtered.iter().map(Vec::as_slice));
        let mut taps = self.taps();
        taps.iter_mut().for_each(|taps| taps.signal += 1);
        taps.push(Taps { signal: filtered.len(), first: 1, count: nc, sign: 1.0 });
        let after = after(self.segments, self.maximum_lag());
        let step = Lagged::new(&signals, taps, &after, Presample::Drop);
        if step.rows() <= self.parameters() + nc {
            return None;
        }
        let step = step.solve().ok()?.parameters;
        [1.0, 0.5].into_iter().find_map(|length| {
            let theta = model.a[1..].iter().chain(model.b.iter().flatten()).chain(&model.c[1..]);
            let theta: Vec<f64> = theta.zip(step.iter()).map(|(value, step)| value + length * step).collect();
            let mut next = self.polynomials(&theta);
            next.c = stable(&next.c)?.0;
            (self.prediction_errors(&next).1 < cost).then_some(next)
        })
    }
}

/// Segments without their first samples.
pub(in crate::estimate) fn after(segments: &[Range<usize>], samples: usize) -> Vec<Range<usize>> {
    segments.iter().map(|segment| (segment.start + samples).min(segment.end)..segment.end).collect()
}
