//! The signals that tests of residuals are made of, and the sums of their products.
//!
//! These are e, the inputs, and psi as the model has it (`respond::regressors`). Each signal is measured from its mean
//! over the samples that count: an offset of the log is no matter of dynamics. Every sum runs over these samples of
//! every segment; what stands before a segment is zero.

use std::borrow::Cow;
use std::ops::Range;

use thetahat_core::nalgebra::{DMatrix, DVector, SymmetricEigen};
use thetahat_numerics::regression::{Products, Taps, sum};

use crate::data::Record;
use crate::respond::{Innovations, Regressor, RegressorSignal};

/// A signal that is this close to its mean, as a fraction of it, is constant up to rounding.
const CONSTANT: f64 = 1e-12;
/// Eigenvalues below this fraction of the largest are rounding.
const ROUNDING: f64 = 1e-12;

/// A lagged signal: `sign * s(t - lag)`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Column {
    pub(super) signal: usize,
    pub(super) lag: usize,
    pub(super) sign: f64,
}

/// Samples that follow one another: those known, and of them those that count.
#[derive(Debug, Clone)]
pub(super) struct Segment {
    pub(super) known: Range<usize>,
    /// One range, but where outputs are missing.
    pub(super) counted: Vec<Range<usize>>,
}

/// e, the inputs, and the signals of psi, as long as the record.
#[derive(Debug)]
pub(super) struct Traces<'a> {
    signals: Vec<Cow<'a, [f64]>>,
    /// psi, in the order of the parameters.
    pub(super) psi: Vec<Taps>,
    pub(super) segments: Vec<Segment>,
}

impl<'a> Traces<'a> {
    /// e from its mean, zero where it does not count.
    pub(super) const ERROR: usize = 0;

    /// Those of what is tested, with psi where somebody knows it and it is asked for.
    pub(super) fn new(record: &Record<'a>, innovations: &[Innovations], psi: Vec<Regressor<'a>>) -> Self {
        let mut error = vec![0.0; record.output.len()];
        let mut segments = Vec::with_capacity(innovations.len());
        for found in innovations {
            for counted in &found.counted {
                let own = counted.start - found.rows.start..counted.end - found.rows.start;
                error[counted.clone()].copy_from_slice(&found.errors[own]);
            }
            segments.push(Segment { known: found.rows.clone(), counted: found.counted.clone() });
        }
        let inputs = record.inputs.iter().map(|input| Cow::Borrowed(*input));
        let mut signals: Vec<Cow<'a, [f64]>> = std::iter::once(Cow::Owned(error)).chain(inputs).collect();
        let psi = psi.into_iter().map(|Regressor { signal, first, count, sign }| {
            let signal = match signal {
                RegressorSignal::Input(input) => Self::input(input),
                RegressorSignal::Own(values) => {
                    signals.push(values);
                    signals.len() - 1
                }
            };
            Taps { signal, first, count, sign }
        });
        let psi = psi.collect();
        let mut traces = Self { signals, psi, segments };
        traces.center();
        traces
    }

    /// Takes from each signal its mean over the samples that count.
    fn center(&mut self) {
        let counted = self.counted();
        let samples: usize = counted.iter().map(Range::len).sum();
        for (index, signal) in self.signals.iter_mut().enumerate() {
            let rows = || counted.iter().cloned().flatten();
            let mean = sum(rows().map(|t| signal[t])) / samples.max(1) as f64;
            let spread = sum(rows().map(|t| (signal[t] - mean).powi(2)));
            let values = signal.to_mut();
            if spread.sqrt() <= CONSTANT * mean.abs() * (samples as f64).sqrt() {
                values.fill(0.0);
                continue;
            }
            if index == Self::ERROR {
                // It stays zero where it does not count.
                counted.iter().for_each(|rows| values[rows.clone()].iter_mut().for_each(|e| *e -= mean));
            } else {
                values.iter_mut().for_each(|value| *value -= mean);
            }
        }
    }

    /// Which signal an input is.
    pub(super) fn input(input: usize) -> usize {
        1 + input
    }

    pub(super) fn signal(&self, signal: usize) -> &[f64] {
        &self.signals[signal]
    }

    pub(super) fn signals(&self) -> Vec<&[f64]> {
        self.signals.iter().map(AsRef::as_ref).collect()
    }

    /// The samples that count.
    pub(super) fn counted(&self) -> Vec<Range<usize>> {
        self.segments.iter().flat_map(|segment| segment.counted.iter().cloned()).collect()
    }

    /// The same, segment by segment.
    pub(super) fn segments(&self) -> Vec<&[Range<usize>]> {
        self.segments.iter().map(|segment| segment.counted.as_slice()).collect()
    }

    /// The samples of each segment from the first to the last that counts.
    pub(super) fn spans(&self) -> Vec<Range<usize>> {
        let span = |segment: &Segment| Some(segment.counted.first()?.start..segment.counted.last()?.end);
        self.segments.iter().filter_map(span).collect()
    }
}

/// The columns of taps.
pub(super) fn columns(taps: &[Taps]) -> Vec<Column> {
    let each = taps.iter().flat_map(|taps| {
        (0..taps.count).map(move |i| Column { signal: taps.signal, lag: taps.first + i, sign: taps.sign })
    });
    each.collect()
}

/// The sums of products of lagged signals. O(N p) time for p lags in all.
#[derive(Debug)]
pub(super) struct Moments {
    products: Products,
    entries: Vec<f64>,
}

impl Moments {
    /// Those of all columns of the taps, and of e.
    pub(super) fn new(traces: &Traces<'_>, taps: &[Taps]) -> Self {
        let products = Products::new(taps);
        let signals = traces.signals();
        let size = products.size();
        let mut entries = vec![0.0; size * size];
        for segment in &traces.segments {
            for counted in &segment.counted {
                products.add_ends(&signals, segment.known.start, counted, &mut entries);
            }
        }
        let counted = traces
            .segments
            .iter()
            .flat_map(|segment| segment.counted.iter().map(|counted| (segment.known.start, counted.clone())));
        let mut interior = products.interior(counted);
        products.add_interior(&signals, &vec![usize::MAX; signals.len()], &mut interior, &mut entries);
        Self { products, entries }
    }

    /// sum left right.
    fn of(&self, left: &Column, right: &Column) -> f64 {
        let place = |column: &Column| self.products.position(column.signal, column.lag);
        let (left_place, right_place) = (place(left), place(right));
        let (low, high) = (left_place.min(right_place), left_place.max(right_place));
        left.sign * right.sign * self.entries[low * self.products.size() + high]
    }

    /// sum left right'.
    pub(super) fn matrix(&self, left: &[Column], right: &[Column]) -> DMatrix<f64> {
        DMatrix::from_fn(left.len(), right.len(), |i, j| self.of(&left[i], &right[j]))
    }

    /// sum columns e.
    pub(super) fn with_error(&self, columns: &[Column]) -> DVector<f64> {
        let error = Column { signal: Traces::ERROR, lag: 0, sign: 1.0 };
        DVector::from_iterator(columns.len(), columns.iter().map(|column| self.of(column, &error)))
    }
}

/// The eigenvalues and eigenvectors of a symmetric matrix; none if an entry is not finite.
pub(super) fn eigen(matrix: DMatrix<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    if matrix.is_empty() {
        return Some((DVector::zeros(0), matrix));
    }
    if !matrix.iter().all(|value| value.is_finite()) {
        return None;
    }
    let most = 100 * (matrix.nrows() + 1);
    let found = SymmetricEigen::try_new(matrix, f64::EPSILON, most)?;
    Some((found.eigenvalues, found.eigenvectors))
}

/// The inverse of a Gram matrix, of which dependent columns have one inverse among others (Moore and Penrose, columns
/// scaled to unit norm).
pub(super) fn pseudo_inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scales = matrix.diagonal().map(|square| if square > 0.0 { square.sqrt() } else { 1.0 });
    let unit =
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)] / scales[i] / scales[j]);
    let (values, vectors) = eigen(unit)?;
    let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(*value));
    let mut inverse = DMatrix::zeros(matrix.nrows(), matrix.ncols());
    for (value, vector) in values.iter().zip(vectors.column_iter()) {
        if *value > ROUNDING * largest {
            let vector = vector.component_div(&scales);
            inverse.ger(1.0 / value, &vector, &vector, 1.0);
        }
    }
    Some(inverse)
}
