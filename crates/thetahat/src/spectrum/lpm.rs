//! Local polynomials.

use std::f64::consts::TAU;

use rayon::prelude::*;
use thetahat_core::nalgebra::{Complex, DMatrix, DVector};
use thetahat_numerics::fourier::PairTransform;

use super::estimate::{Bands, EMPTY, Empty, Estimate, Line, LineEstimate};
use super::plan::Method;
use super::signals::Signals;
use crate::Error;

/// Coefficients of each polynomial: those of degree 2.
const TERMS: usize = 3;
/// Complex degrees of freedom that are left where the half-width is chosen, if the log has as many lines, and at least.
const LEFT: usize = 19;
const LEAST_LEFT: usize = 3;
/// Columns of which less than this fraction is orthogonal to those before depend on them.
const DEPENDENT: f64 = 1e-6;
/// An input of which the transient's polynomials leave no more than this fraction has no power of its own.
const LEAKED: f64 = 0.01;

/// The transforms of one segment, X_k/sqrt(N) for 0 < k < N/2.
struct Segment {
    length: usize,
    /// Of each channel, from k = 1 on.
    spectra: Vec<Vec<Complex<f64>>>,
    /// Lines on either side.
    half_width: usize,
}

/// The local polynomial method (Pintelon, Schoukens, Vandersteen and Barbe, Mechanical Systems and Signal Processing 24
/// (2010) 573; Pintelon and Schoukens, System Identification: A Frequency Domain Approach, 2nd ed. 2012, chapter 7).
/// Around each frequency w, with x = (w_k - w)/b over the lines k of each segment's transform within the half-width b:
///
/// ```text
/// Y_k = sum_j (G_j + g_j1 x + g_j2 x^2) U_jk + t_0 + t_1 x + t_2 x^2 + V_k
/// ```
///
/// by least squares. The second polynomial is what a segment's ends leave: its transient, one for each segment.
/// sum |V_k|^2 over its degrees of freedom is the noise, and what the polynomials miss is in it too. Beyond 0 and half
/// the sampling frequency lines are the conjugates of those before.
///
/// Cost: O(N log N), and O(n p^2) for each frequency, with 2 n + 1 lines and p polynomials.
///
/// # Errors
/// [`Error::Argument`] for a half-width that is too small for the polynomials; [`Error::Data`] if no segment has lines
/// enough.
pub(super) fn lpm(signals: &Signals, half_width: Option<usize>, angles: &[f64]) -> Result<Estimate, Error> {
    let (inputs, longest) = (signals.inputs(), signals.longest());
    let unknown = TERMS * (inputs + 1);
    let least = (unknown + LEAST_LEFT).div_ceil(2);
    // 2 n + 1 lines of the (N - 1)/2 that there are.
    let most = (longest.saturating_sub(1) / 2).saturating_sub(1) / 2;
    if most < least {
        return Err(Error::data(format!(
            "lpm needs {} rows without a gap for {} input{}, the longest segment has {longest}: record more, or take spa",
            4 * least + 3,
            inputs,
            if inputs == 1 { "" } else { "s" },
        )));
    }
    if let Some(given) = half_width.filter(|given| !(least..=most).contains(given)) {
        return Err(Error::argument(
            "half-width",
            format!(
                "{given} lines: the polynomials need {least} at least, and the longest segment has {most} at most"
            ),
        ));
    }
    let half_width = half_width.unwrap_or(((unknown + LEFT) / 2).min(most));
    let mut left_out = 0;
    let mut segments = Vec::new();
    for rows in &signals.segments {
        let length = rows.len();
        let own = (half_width * length + longest / 2) / longest;
        // One line more than the transient takes.
        if 2 * own < TERMS || (length - 1) / 2 < 2 * own + 1 {
            left_out += length;
            continue;
        }
        let mut transform = PairTransform::new(length);
        let weight = 1.0 / (length as f64).sqrt();
        let mut spectra = vec![Vec::new(); inputs + 1];
        for (first, second) in signals.pairs() {
            let [a, b] = [first, second].map(|channel| &signals.channels[channel][rows.clone()]);
            let found = transform.of(a.iter().copied().zip(b.iter().copied()));
            let lines = (1..length.div_ceil(2)).map(|k| found.at(k));
            let (of_first, of_second): (Vec<_>, Vec<_>) =
                lines.map(|(a, b)| (a.scale(weight), b.scale(weight))).unzip();
            spectra[first] = of_first;
            spectra[second] = of_second;
        }
        segments.push(Segment { length, spectra, half_width: own });
    }
    let largest: Vec<f64> = (0..inputs)
        .map(|j| {
            segments.iter().flat_map(|segment| &segment.spectra[j]).map(|u| u.norm_sqr()).fold(0.0, f64::max)
        })
        .collect();
    let width = half_width as f64 * TAU / longest as f64;
    let line = |&angle: &f64| Line { angle, found: local(&segments, angle, width, &largest) };
    let lines = angles.par_iter().map(line).collect();
    let words = if left_out > 0 {
        vec![format!(
            "segments with {left_out} of {} rows are too short for lpm beside the longest one and are left out; spa uses them",
            signals.samples()
        )]
    } else {
        Vec::new()
    };
    let bands = Bands::Honest("what local polynomials miss counts as noise");
    Ok(Estimate { method: Method::Lpm { half_width: Some(half_width) }, lines, bands, words })
}

/// The lines of a segment around the nearest to an angle: those below 0 are the conjugates of those above it, and those
/// beyond half the sampling frequency of those before. Those two themselves are left out: means are taken off, and the
/// second is real.
fn around(segment: &Segment, angle: f64) -> impl Iterator<Item = (isize, usize, bool)> {
    let (length, lines) = (segment.length as isize, segment.spectra[0].len() as isize);
    let nearest = (angle * segment.length as f64 / TAU).round() as isize;
    let half_width = segment.half_width as isize;
    (nearest - half_width..=nearest + half_width).filter_map(move |k| {
        let folded = k.rem_euclid(length);
        let turned = folded > lines;
        let own = if turned { length - folded } else { folded };
        (1..=lines).contains(&own).then(|| (k, own as usize - 1, turned))
    })
}

/// The regression around one frequency. Each segment's transient is taken out of the other columns first.
fn local(segments: &[Segment], angle: f64, width: f64, largest: &[f64]) -> Result<LineEstimate, Empty> {
    let inputs = largest.len();
    let columns = TERMS * inputs;
    let lines: Vec<Vec<(isize, usize, bool)>> =
        segments.iter().map(|segment| around(segment, angle).collect()).collect();
    let rows: usize = lines.iter().map(Vec::len).sum();
    // The output is the last column.
    let mut matrix = DMatrix::<Complex<f64>>::zeros(rows, columns + 1);
    let mut power = DMatrix::<Complex<f64>>::zeros(inputs, inputs);
    let (mut before, mut twins) = (0, Vec::new());
    for (segment, own) in segments.iter().zip(&lines) {
        let step = TAU / segment.length as f64;
        let x = |row: usize| (own[row].0 as f64 * step - angle) / width;
        for (row, (_, line, turned)) in own.iter().enumerate() {
            let of = |channel: usize| {
                let value: Complex<f64> = segment.spectra[channel][*line];
                if *turned { value.conj() } else { value }
            };
            for j in 0..inputs {
                let u = of(j);
                (0..TERMS).for_each(|s| matrix[(before + row, TERMS * j + s)] = u * x(row).powi(s as i32));
                (0..inputs).for_each(|k| power[(j, k)] += u * of(k).conj());
            }
            matrix[(before + row, columns)] = of(inputs);
            let twin = own[..row].iter().position(|(_, other, unlike)| other == line && unlike != turned);
            twins.extend(twin.map(|twin| (before + twin, before + row)));
        }
        let transient = DMatrix::from_fn(own.len(), TERMS, |row, s| x(row).powi(s as i32)).qr().q();
        let transient = transient.map(|value| Complex::new(value, 0.0));
        let mut block = matrix.rows_mut(before, own.len());
        let along = transient.adjoint() * &block;
        block -= &transient * along;
        before += own.len();
    }
    // What a transient may be tells nothing of the input: power that leaks from other lines is as smooth.
    let leaks = |j: usize| matrix.column(TERMS * j).norm_squared() <= LEAKED * power[(j, j)].re;
    let empty = |j: &usize| power[(*j, *j)].re <= EMPTY * largest[*j] * rows as f64 || leaks(*j);
    if let Some(empty) = (0..inputs).find(empty) {
        return Err(Empty::Input(empty));
    }
    power.unscale_mut(rows as f64);
    let output = DVector::from_column_slice(matrix.column(columns).as_slice());
    let mut regressors = matrix.remove_column(columns);
    // Powers of x are of one size; those of inputs are not.
    let units: Vec<f64> = regressors.column_iter().map(|column| column.norm()).collect();
    for (mut column, unit) in regressors.column_iter_mut().zip(&units) {
        column.unscale_mut(if *unit > 0.0 { *unit } else { 1.0 });
    }
    let qr = regressors.qr();
    let (q, r) = (qr.q(), qr.r());
    if !r.diagonal().iter().all(|pivot| pivot.norm() > DEPENDENT) {
        return Err(Empty::Together);
    }
    let along = q.adjoint() * &output;
    let inverse = r.solve_upper_triangular(&DMatrix::identity(columns, columns)).ok_or(Empty::Together)?;
    let solution = &inverse * &along;
    let left = output - &q * along;
    let degrees = rows - TERMS * segments.len() - columns;
    let noise = left.norm_squared() / degrees as f64;
    let of = |j: usize| solution[TERMS * j].unscale(units[TERMS * j]);
    let responses: Vec<Complex<f64>> = (0..inputs).map(of).collect();
    let explained: Complex<f64> = (0..inputs)
        .flat_map(|j| (0..inputs).map(move |k| (j, k)))
        .map(|(j, k)| responses[j] * power[(j, k)] * responses[k].conj())
        .sum();
    // G = a'Y, of which conjugate lines have conjugate noise: E |dG|^2 = sum |a_k|^2 v, E dG^2 = 2 sum a_k a_-k v. The
    // variance is that of the direction in which it is largest.
    let variance = |j: usize| {
        let row = TERMS * j;
        let weights = inverse.row(row) * q.adjoint();
        let both: Complex<f64> = twins.iter().map(|(one, other)| weights[*one] * weights[*other]).sum();
        0.5 * noise * (weights.norm_squared() + 2.0 * both.norm()) / (units[row] * units[row])
    };
    let whole = explained.re + noise;
    Ok(LineEstimate {
        first: 0,
        variances: Some((0..inputs).map(variance).collect()),
        responses,
        // Conjugate lines are one.
        degrees: 2 * degrees.saturating_sub(twins.len()).max(1),
        noise: Some(noise),
        coherence: Some(if whole > 0.0 { (explained.re / whole).clamp(0.0, 1.0) } else { 0.0 }),
    })
}
