//! With which period an input repeats itself, and where it begins to do so with another one.

use std::ops::Range;

use thetahat_numerics::fourier::{PairTransform, suitable};

use super::signals::Signals;

/// What repeats itself changes by no more than this fraction of its power.
pub(super) const REPEATS: f64 = 0.01;
/// A lag at which it changes by more is away from the first half period.
const AWAY: f64 = 0.5;
/// The first lag with a change of no more than this many times the least is the period, and with one that is rounding.
const LEAST: f64 = 4.0;
const ROUNDING: f64 = 1e-9;
/// The shortest beginning in which a period is looked for, in rows.
const SHORTEST: usize = 16;
/// Pieces of noise repeat themselves, too; they are not this fraction of a segment.
const MOST: f64 = 0.8;
/// A sine ends where it differs from the period before by more than this fraction of its amplitude; its end is where
/// the difference leaves this many times its root mean square.
const ENDS: f64 = 0.3;
const LEAVES: f64 = 4.0;

/// The pieces of a segment, each with its period.
pub(super) struct Pieces<'a> {
    signals: &'a Signals,
    /// What is left of the segment.
    left: Range<usize>,
}

impl<'a> Pieces<'a> {
    /// One piece if the inputs repeat themselves from end to end, else those that do, one after the other, if they are
    /// most of it.
    pub(super) fn of(signals: &'a Signals, segment: &Range<usize>) -> Vec<(Range<usize>, usize)> {
        match period(signals, segment) {
            Some(period) => vec![(segment.clone(), period)],
            None => {
                let pieces: Vec<_> = Self { signals, left: segment.clone() }.collect();
                let rows: usize = pieces.iter().map(|(piece, _)| piece.len()).sum();
                if rows as f64 > MOST * segment.len() as f64 { pieces } else { Vec::new() }
            }
        }
    }

    /// How much the inputs differ from the period before, in one row.
    fn change(&self, row: usize, period: usize) -> f64 {
        let inputs = &self.signals.channels[..self.signals.inputs()];
        inputs.iter().map(|input| (input[row] - input[row - period]).powi(2)).sum::<f64>().sqrt()
    }

    /// Where the piece that begins with the rest, and has this period, ends.
    fn end(&self, known: usize, period: usize) -> usize {
        let Range { start, end } = self.left;
        let inputs = &self.signals.channels[..self.signals.inputs()];
        let swing = |input: &Vec<f64>| {
            let own = &input[start..start + period];
            let (low, high) = own
                .iter()
                .fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(*value), high.max(*value)));
            0.5 * (high - low)
        };
        let amplitude = inputs.iter().map(|input| swing(input).powi(2)).sum::<f64>().sqrt();
        let Some(first) = (start + known..end).find(|&row| self.change(row, period) > ENDS * amplitude)
        else {
            return end;
        };
        let squares: f64 = (start + period..start + known).map(|row| self.change(row, period).powi(2)).sum();
        let usual = (squares / (known - period) as f64).sqrt().max(ROUNDING * amplitude);
        let lowest = start + known;
        (lowest..first)
            .rev()
            .find(|&row| self.change(row, period) <= LEAVES * usual)
            .map_or(lowest, |row| row + 1)
    }
}

impl Iterator for Pieces<'_> {
    type Item = (Range<usize>, usize);

    fn next(&mut self) -> Option<Self::Item> {
        // Rows at rest before a sine begins.
        let inputs = &self.signals.channels[..self.signals.inputs()];
        let rests = |row: &usize| inputs.iter().all(|input| input[*row] == input[*row + 1]);
        let rest = (self.left.start..self.left.end.saturating_sub(1)).take_while(rests).count();
        if rest > SHORTEST {
            self.left.start += rest + 1;
        }
        let start = self.left.start;
        let mut known = SHORTEST;
        while known <= self.left.len() {
            if let Some(period) = period(self.signals, &(start..start + known)) {
                let end = self.end(known, period);
                self.left.start = end;
                return Some((start..end, period));
            }
            known += known.div_ceil(4);
        }
        None
    }
}

/// The fraction of the power of the inputs that changes from one period to the next: sum (u(t + P) - u(t))^2 over the
/// power of the two.
pub(super) fn repeats(signals: &Signals, rows: &Range<usize>, period: usize) -> f64 {
    let (mut change, mut power) = (0.0, 0.0);
    for input in &signals.channels[..signals.inputs()] {
        let own = &input[rows.clone()];
        let mean = own.iter().sum::<f64>() / own.len() as f64;
        for (before, after) in own.iter().zip(&own[period.min(own.len())..]) {
            change += (after - before).powi(2);
            power += (before - mean).powi(2) + (after - mean).powi(2);
        }
    }
    if power > 0.0 { change / power } else { 0.0 }
}

/// The period of the inputs in some rows, if they repeat themselves at least once: the first lag at which the change of
/// [`repeats`] is about the least of all lags up to half the rows (de Cheveigné and Kawahara, JASA 111 (2002) 1917).
/// O(N log N).
fn period(signals: &Signals, rows: &Range<usize>) -> Option<usize> {
    let count = rows.len();
    if count < 4 {
        return None;
    }
    // One lag more tells whether the last one is at the bottom of a valley.
    let longest = count / 2 + 1;
    let (mut change, mut power) = (vec![0.0; longest + 1], vec![0.0; longest + 1]);
    let length = suitable(count + longest);
    let mut transform = PairTransform::new(length);
    for input in &signals.channels[..signals.inputs()] {
        let own = &input[rows.clone()];
        let mean = own.iter().sum::<f64>() / count as f64;
        let deviations: Vec<f64> = own.iter().map(|value| value - mean).collect();
        let found = transform.of(deviations.iter().map(|value| (*value, 0.0)));
        let powers: Vec<f64> = (0..length).map(|k| found.at(k).0.norm_sqr() / length as f64).collect();
        let found = transform.of(powers.into_iter().map(|power| (power, 0.0)));
        let whole: f64 = deviations.iter().map(|value| value * value).sum();
        let (mut head, mut tail) = (whole, whole);
        for lag in 0..=longest {
            if lag > 0 {
                head -= deviations[count - lag].powi(2);
                tail -= deviations[lag - 1].powi(2);
            }
            power[lag] += head + tail;
            change[lag] += (head + tail - 2.0 * found.at(lag).0.re).max(0.0);
        }
    }
    let of = |lag: usize| if power[lag] > 0.0 { change[lag] / power[lag] } else { f64::INFINITY };
    let away = (1..=longest).find(|&lag| of(lag) > AWAY)?;
    let least = (away..=longest).map(of).fold(f64::INFINITY, f64::min);
    if least > REPEATS {
        return None;
    }
    let bound = (LEAST * least).max(ROUNDING);
    let first = (away..=longest).find(|&lag| of(lag) <= bound)?;
    let valley = (first..=longest).take_while(|&lag| of(lag) <= bound);
    valley.min_by(|&a, &b| of(a).total_cmp(&of(b))).filter(|&lag| lag < longest)
}
