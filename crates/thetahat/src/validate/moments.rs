//! The signals that tests of residuals are made of, and the sums of their products.
//!
//! ```text
//! psi(t) = -de(t)/dtheta:   a_i: -(D/C) q^-i y        b_ji: (D/(C F_j)) q^-i u_j     f_ji: -(D/(C F_j)) q^-i x_j
//!                           c_i:  (1/C) q^-i e         d_i: -(1/C) q^-i w
//! ```
//!
//! with x_j = (B_j/F_j) u_j and w = A y - sum_j x_j (Ljung, System Identification, 2nd ed. 1999, section 10.3). All filters
//! begin from rest at the first sample of a segment: what that leaves out dies away, and tests need psi to first order
//! only. Each signal is measured from its mean over the samples that count: an offset of the log is no matter of dynamics.
//! Every sum runs over these samples of every segment; what stands before a segment is zero.

use std::borrow::Cow;
use std::ops::Range;

use thetahat_core::nalgebra::{DMatrix, DVector, SymmetricEigen};
use thetahat_numerics::regression::{Products, Taps, add_filtered, divide, sum};

use crate::data::Record;
use crate::model::PolynomialModel;
use crate::respond::Innovations;

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

    /// `noise_free`: with (B/A) u in the place of y, as instruments have it; for models without C, D and F.
    pub(super) fn new(
        model: &PolynomialModel,
        record: &Record<'a>,
        innovations: &[Innovations],
        noise_free: bool,
    ) -> Self {
        let length = record.output.len();
        let mut error = vec![0.0; length];
        let mut segments = Vec::with_capacity(innovations.len());
        for found in innovations {
            for counted in &found.counted {
                let own = counted.start - found.rows.start..counted.end - found.rows.start;
                error[counted.clone()].copy_from_slice(&found.errors[own]);
            }
            segments.push(Segment { known: found.rows.clone(), counted: found.counted.clone() });
        }
        let inputs = record.inputs.iter().map(|input| Cow::Borrowed(*input));
        let signals = std::iter::once(Cow::Owned(error)).chain(inputs).collect();
        let mut traces = Self { signals, psi: Vec::new(), segments };
        let orders = &model.orders;
        let linear = orders.is_linear();
        let over = |of: &dyn Fn(&Innovations) -> Vec<f64>| {
            let mut signal = vec![0.0; length];
            innovations.iter().for_each(|found| signal[found.rows.clone()].copy_from_slice(&of(found)));
            Cow::Owned(signal)
        };
        // (D/(C F)) of a signal, from rest.
        let filtered = |signal: &[f64], denominator: &[f64]| {
            let mut values = product(&model.d, signal);
            divide(&model.c, &mut values);
            divide(denominator, &mut values);
            values
        };
        let driven = |found: &Innovations, input: usize| {
            let mut x = product(&model.b[input], &record.inputs[input][found.rows.clone()]);
            divide(&model.f[input], &mut x);
            x
        };
        let undriven = |found: &Innovations| {
            let mut sum = vec![0.0; found.rows.len()];
            for input in 0..orders.inputs() {
                sum.iter_mut().zip(driven(found, input)).for_each(|(sum, x)| *sum += x);
            }
            divide(&model.a, &mut sum);
            sum
        };

        if orders.na > 0 {
            let output: Cow<'a, [f64]> = if !linear {
                over(&|found| filtered(&record.output[found.rows.clone()], &[1.0]))
            } else if noise_free {
                over(&undriven)
            } else {
                Cow::Borrowed(record.output)
            };
            traces.add(output, 1, orders.na, -1.0);
        }
        for input in (0..orders.inputs()).filter(|&input| orders.nb[input] > 0) {
            let (first, count) = (orders.nk[input], orders.nb[input]);
            if linear {
                traces.psi.push(Taps { signal: Self::input(input), first, count, sign: 1.0 });
            } else {
                let of = |found: &Innovations| {
                    filtered(&record.inputs[input][found.rows.clone()], &model.f[input])
                };
                traces.add(over(&of), first, count, 1.0);
            }
        }
        let noise = |values: &[f64]| {
            let mut values = values.to_vec();
            divide(&model.c, &mut values);
            values
        };
        if orders.nc > 0 {
            traces.add(over(&|found| noise(&found.errors)), 1, orders.nc, 1.0);
        }
        if orders.nd > 0 {
            traces.add(over(&|found| noise(&found.disturbance)), 1, orders.nd, -1.0);
        }
        for input in (0..orders.inputs()).filter(|&input| orders.nf[input] > 0) {
            let of = |found: &Innovations| filtered(&driven(found, input), &model.f[input]);
            traces.add(over(&of), 1, orders.nf[input], -1.0);
        }
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

    fn add(&mut self, signal: Cow<'a, [f64]>, first: usize, count: usize, sign: f64) {
        self.psi.push(Taps { signal: self.signals.len(), first, count, sign });
        self.signals.push(signal);
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

/// P of a signal, from rest.
fn product(polynomial: &[f64], signal: &[f64]) -> Vec<f64> {
    let mut values = vec![0.0; signal.len()];
    add_filtered(&mut values, &(0..signal.len()), polynomial, signal, 0);
    values
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
