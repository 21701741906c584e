//! The best linear approximation of a log.

use std::ops::Range;

use super::Levels;
use crate::Error;
use crate::data::Record;
use crate::estimate::{Estimate, Initial, Method, estimate};
use crate::model::Orders;

/// x(k+1) = A x + B u(k - delay + 1), y = x_1 + D u, with -f in the first column of A and ones above its diagonal.
#[derive(Debug, Clone)]
pub(super) struct Linear {
    pub(super) f: Vec<f64>,
    /// Of each input.
    pub(super) b: Vec<Vec<f64>>,
    pub(super) d: Vec<f64>,
}

impl Linear {
    /// An output-error fit of deviations for one input; for several, which share the poles, least squares. None where
    /// there is none.
    pub(super) fn found(
        record: &Record<'_>,
        means: &Levels,
        (n, delays): (usize, &[usize]),
        most: usize,
    ) -> Result<Option<Self>, Error> {
        let less =
            |signal: &[f64], mean: f64| -> Vec<f64> { signal.iter().map(|value| value - mean).collect() };
        let y = less(record.output, means.output);
        let u: Vec<Vec<f64>> =
            record.inputs.iter().zip(&means.inputs).map(|(signal, mean)| less(signal, *mean)).collect();
        let mut left = most;
        let mut segments = Vec::new();
        for segment in &record.segments {
            let end = segment.end.min(segment.start.saturating_add(left));
            left -= end - segment.start;
            // Runs of rows in which the output is there.
            let mut start = segment.start;
            for (row, value) in (segment.start..end).zip(&y[segment.start..end]) {
                if !value.is_finite() {
                    segments.push(start..row);
                    start = row + 1;
                }
            }
            segments.push(start..end);
        }
        segments.retain(|rows: &Range<usize>| !rows.is_empty());
        let deviations = Record {
            output: &y,
            inputs: u.iter().map(Vec::as_slice).collect(),
            past: vec![0; segments.len()],
            segments,
        };
        let nb: Vec<usize> = delays.iter().map(|delay| n + usize::from(*delay == 0)).collect();
        let of = |orders: Result<Orders, Error>| -> Result<Option<Estimate>, Error> {
            match estimate(&deviations, &orders?, &Method::default(), Initial::Auto) {
                Ok(found) => Ok(Some(found)),
                Err(Error::Undetermined { .. } | Error::Data { .. }) => Ok(None),
                Err(other) => Err(other),
            }
        };
        let output_error = if delays.len() == 1 { of(Orders::oe(&nb, &[n], delays))? } else { None };
        let (f, b) = match output_error {
            Some(found) => {
                let (b, f) = found.parameters().split_at(nb[0]);
                (f.to_vec(), b.to_vec())
            }
            None => {
                let Some(found) = of(Orders::arx(n, &nb, delays))? else { return Ok(None) };
                let (f, b) = found.parameters().split_at(n);
                (f.to_vec(), b.to_vec())
            }
        };
        let mut linear = Self { f, b: Vec::new(), d: Vec::new() };
        let mut rest = &b[..];
        for count in nb {
            let (own, others) = rest.split_at(count);
            rest = others;
            let (d, own) = if count > n { (own[0], &own[1..]) } else { (0.0, own) };
            linear.b.push(own.iter().zip(&linear.f).map(|(b, f)| b - f * d).collect());
            linear.d.push(d);
        }
        let all = linear.f.iter().chain(linear.b.iter().flatten()).chain(&linear.d);
        Ok(all.copied().all(f64::is_finite).then_some(linear))
    }

    /// 1 + f_1 + … + f_n.
    pub(super) fn denominator(&self) -> f64 {
        1.0 + self.f.iter().sum::<f64>()
    }

    /// The gain at rest from an input.
    pub(super) fn gain(&self, input: usize) -> f64 {
        self.b[input].iter().sum::<f64>() / self.denominator() + self.d[input]
    }
}
