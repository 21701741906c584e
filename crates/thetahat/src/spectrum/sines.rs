//! Periodic inputs.

use std::f64::consts::TAU;
use std::ops::Range;

use thetahat_core::nalgebra::Complex;
use thetahat_numerics::fourier::PairTransform;

use super::estimate::{Bands, Estimate, Line, LineEstimate};
use super::periods::{Pieces, repeats};
use super::plan::Method;
use super::signals::Signals;
use crate::Error;
use crate::figures::{fixed, short};

/// Lines with less than this fraction of the power of an input's largest are not of its sines.
const FAINT: f64 = 1e-4;
/// Nor are those whose mean over the periods has less than this many times its variance.
const STEADY: f64 = 25.0;
/// A period differs from the later ones by transients if it does so by this many times their own spread, or by this
/// fraction.
const SETTLED: f64 = 4.0;
const SETTLED_EXACTLY: f64 = 1e-12;

/// Amplitude and phase at each line of a periodic input, over the periods m in which the plant has settled:
///
/// ```text
/// U_m = sum_t u(t) exp(-i w t) over period m,   G = sum_m Y_m/sum_m U_m,   var G = sum_m |Y_m - G U_m|^2/(M (M - 1) |mean U|^2)
/// ```
///
/// at w = 2 pi l/P for each line l of the period of P rows at which exactly one input has power (Pintelon and Schoukens
/// 2012, sections 2.4 and 2.5). Pieces of a segment that repeat themselves with a period each, as steps of the
/// frequency do, are each their own experiment. Without a number, those first periods are left out that differ from the
/// second half of the periods by more than these from one another. Also gives the rows that count. O(N log N).
///
/// # Errors
/// [`Error::Data`] where an input does not repeat itself, a piece is shorter than what is left out, or two inputs share
/// a line.
pub(super) fn sines(
    signals: &Signals,
    names: &[String],
    period: Option<usize>,
    discard: Option<usize>,
    band: (f64, f64),
) -> Result<(Estimate, Vec<Range<usize>>), Error> {
    let mut pieces = Vec::new();
    for segment in &signals.segments {
        match period {
            Some(period) => pieces.push((checked(signals, segment, period)?, period)),
            None => pieces.extend(Pieces::of(signals, segment)),
        }
    }
    if pieces.is_empty() {
        let rows = &signals.segments[0];
        return Err(Error::data(format!(
            "the input does not repeat itself in rows {} to {}: sines need two whole periods at least; name the rows of each sine \
             (`rows`), or the rows of a period if there is only one (`period`)",
            rows.start + 1,
            rows.end
        )));
    }
    let (mut lines, mut rows, mut discarded, mut single) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for (piece, period) in &pieces {
        let settled = Periods::new(signals, piece, *period).settled(piece, discard)?;
        discarded.push(settled.discarded);
        single += usize::from(settled.count == 1);
        rows.push(piece.end - settled.count * period..piece.end);
        lines.extend(settled.lines(names)?);
    }
    lines.retain(|line| (band.0..=band.1).contains(&line.angle));
    lines.sort_by(|a, b| a.angle.total_cmp(&b.angle));
    let method = Method::Sines {
        period: common(pieces.iter().map(|(_, period)| *period)),
        discard: common(discarded.into_iter()),
    };
    let words = match single {
        0 => Vec::new(),
        _ => vec![format!(
            "{single} of {} sines or sets of sines have one period only after their transient: they have no band, and what is left of the \
             transient does not show; record more periods",
            pieces.len()
        )],
    };
    let bands = Bands::Honest("it is the spread between periods");
    Ok((Estimate { method, lines, bands, words }, rows))
}

/// The one value that all are.
fn common(mut all: impl Iterator<Item = usize>) -> Option<usize> {
    let first = all.next()?;
    all.all(|other| other == first).then_some(first)
}

/// The segment, if its inputs repeat themselves after a period.
fn checked(signals: &Signals, segment: &Range<usize>, period: usize) -> Result<Range<usize>, Error> {
    let (first, last) = (segment.start + 1, segment.end);
    if segment.len() < period {
        return Err(Error::data(format!(
            "rows {first} to {last} are less than one period of {period} rows: no whole period is there; record longer"
        )));
    }
    let off = repeats(signals, segment, period);
    if off > super::periods::REPEATS {
        return Err(Error::data(format!(
            "the input does not repeat itself after {period} rows in rows {first} to {last} ({} % of its power change): these are no \
             whole periods; give another `period`, or leave it out",
            fixed(100.0 * off, 1)
        )));
    }
    Ok(segment.clone())
}

/// The transforms of whole periods, the last of which ends with the piece.
struct Periods {
    period: usize,
    /// How many were left out at the beginning.
    discarded: usize,
    count: usize,
    /// Of each period, of each channel: lines 1 … P/2.
    spectra: Vec<Vec<Vec<Complex<f64>>>>,
}

impl Periods {
    fn new(signals: &Signals, piece: &Range<usize>, period: usize) -> Self {
        let count = piece.len() / period;
        let mut transform = PairTransform::new(period);
        let mut of = |number: usize| {
            let first = piece.end - (count - number) * period;
            let mut spectra = vec![Vec::new(); signals.channels.len()];
            for (one, other) in signals.pairs() {
                let [a, b] = [one, other].map(|channel| &signals.channels[channel][first..first + period]);
                let found = transform.of(a.iter().copied().zip(b.iter().copied()));
                let lines = (1..period.div_ceil(2)).map(|k| found.at(k));
                (spectra[one], spectra[other]) = lines.unzip();
            }
            spectra
        };
        Self { period, discarded: 0, count, spectra: (0..count).map(&mut of).collect() }
    }

    fn output(&self, number: usize) -> &[Complex<f64>] {
        self.spectra[number].last().map_or(&[], Vec::as_slice)
    }

    /// Those after the transient.
    fn settled(mut self, piece: &Range<usize>, discard: Option<usize>) -> Result<Self, Error> {
        let first = match discard {
            Some(discard) if discard >= self.count => {
                return Err(Error::data(format!(
                    "rows {} to {} are {} whole period{} of {} rows: none is left after {discard} (`discard`); leave out fewer, or record \
                     more",
                    piece.start + 1,
                    piece.end,
                    self.count,
                    if self.count == 1 { "" } else { "s" },
                    self.period
                )));
            }
            Some(discard) => discard,
            None => self.first_settled(),
        };
        self.discarded = first;
        self.spectra.drain(..first);
        self.count -= first;
        Ok(self)
    }

    fn first_settled(&self) -> usize {
        let late = self.count / 2..self.count;
        let lines = self.output(0).len();
        let weight = 1.0 / late.len() as f64;
        let mean: Vec<Complex<f64>> = (0..lines)
            .map(|k| late.clone().map(|number| self.output(number)[k]).sum::<Complex<f64>>().scale(weight))
            .collect();
        let distance = |number: usize| -> f64 {
            self.output(number).iter().zip(&mean).map(|(y, mean)| (y - mean).norm_sqr()).sum()
        };
        let spread = late.clone().map(distance).sum::<f64>() * weight;
        let size: f64 = mean.iter().map(|mean| mean.norm_sqr()).sum();
        let tolerance = SETTLED * spread + SETTLED_EXACTLY * size;
        (0..late.start).rev().find(|&number| distance(number) > tolerance).map_or(0, |last| last + 1)
    }

    fn lines(&self, names: &[String]) -> Result<Vec<Line>, Error> {
        let inputs = names.len();
        let count = self.count as f64;
        let mean = |channel: usize, line: usize| {
            self.spectra.iter().map(|of| of[channel][line]).sum::<Complex<f64>>().unscale(count)
        };
        let angle = |line: usize| TAU * (line + 1) as f64 / self.period as f64;
        let lines = self.output(0).len();
        let largest: Vec<f64> = (0..inputs)
            .map(|j| (0..lines).map(|line| mean(j, line).norm_sqr()).fold(0.0, f64::max))
            .collect();
        let top = largest.iter().copied().fold(0.0, f64::max);
        let excites = |j: usize, line: usize| {
            let u = mean(j, line);
            let spread: f64 = self.spectra.iter().map(|of| (of[j][line] - u).norm_sqr()).sum();
            let variance = spread / (count * (count - 1.0).max(1.0));
            let power = u.norm_sqr();
            power > FAINT * largest[j].max(FAINT * top) && power > STEADY * variance
        };
        let mut found = Vec::new();
        for line in 0..lines {
            let exciting: Vec<usize> = (0..inputs).filter(|&j| excites(j, line)).collect();
            let input = match exciting[..] {
                [] => continue,
                [input] => input,
                [one, other, ..] => {
                    return Err(Error::data(format!(
                        "at {} radians per row the inputs '{}' and '{}' both have power: sines cannot tell them apart; give each its own \
                         lines, or move one after the other, or take lpm",
                        short(angle(line)),
                        names[one],
                        names[other]
                    )));
                }
            };
            let (u, y) = (mean(input, line), mean(inputs, line));
            let response = y / u;
            let residual =
                |of: &Vec<Vec<Complex<f64>>>| (of[inputs][line] - response * of[input][line]).norm_sqr();
            // One period has no spread.
            let noise =
                (self.count > 1).then(|| self.spectra.iter().map(residual).sum::<f64>() / (count - 1.0));
            let explained = (response * u).norm_sqr();
            found.push(Line {
                angle: angle(line),
                found: Ok(LineEstimate {
                    first: input,
                    responses: vec![response],
                    variances: noise.map(|noise| vec![0.5 * noise / (count * u.norm_sqr())]),
                    degrees: 2 * (self.count - 1),
                    noise: noise.map(|noise| noise / self.period as f64),
                    coherence: noise.map(|noise| explained / (explained + noise)),
                }),
            });
        }
        Ok(found)
    }
}
