//! Which uniform clock goes with an irregular one. Whoever advises one asks here, so that all advise the same.

use std::fmt;

use crate::figures::short;

/// At most this many rows of a resampled log stand for each recorded one: with more, hardly anything in it was
/// measured.
const MOST_GROWTH: f64 = 10.0;
/// The step has the fewest digits within this fraction of the median.
const ROUND_STEP: f64 = 0.02;

/// What to do with a log whose clock is irregular.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Regular {
    /// Seconds: about the median step.
    pub(crate) step: f64,
    /// The rows at that step.
    rows: f64,
    /// The rows that were recorded.
    recorded: usize,
}

impl Regular {
    /// For times that run forward, with this median step.
    pub(crate) fn of(time: &[f64], median: f64) -> Self {
        Self::new(time.last().zip(time.first()).map_or(0.0, |(last, first)| last - first), time.len(), median)
    }

    /// For this many rows over a span of seconds, which run forward, with this median step.
    pub(crate) fn new(span: f64, recorded: usize, median: f64) -> Self {
        let step = shortest(median, ROUND_STEP * median);
        Self { step, rows: (span / step).floor() + 1.0, recorded }
    }

    /// Whether enough of the resampled log was measured.
    pub(crate) fn is_worth(&self) -> bool {
        self.rows <= MOST_GROWTH * self.recorded as f64
    }
}

/// What to do, in words.
impl fmt::Display for Regular {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { step, rows, recorded } = self;
        if self.is_worth() {
            return write!(f, "resample it every {step} s (`resample` {step}:linear)");
        }
        write!(
            f,
            "resampled every {step} s it would have {} rows, of which {recorded} were recorded; cut it at its pauses into several \
             logs, or resample it more slowly (`resample`)",
            if *rows < 1e9 { format!("{rows}") } else { short(*rows) }
        )
    }
}

/// The shortest step that one in twenty has and that does not make too many rows of a log: none where there is none.
/// The steps are sorted.
pub(crate) fn coarser(time: &[f64], steps: &mut [f64]) -> Option<f64> {
    steps.sort_unstable_by(f64::total_cmp);
    let span = time.last()? - time.first()?;
    let alike = steps.chunk_by(|a, b| b - a <= ROUND_STEP * a);
    let often = alike.filter(|group| 20 * group.len() >= steps.len()).map(|group| group[group.len() / 2]);
    let rounded = often.map(|step| shortest(step, ROUND_STEP * step));
    rounded.into_iter().find(|step| *step > 0.0 && span / step < MOST_GROWTH * time.len() as f64)
}

/// The number of fewest digits within `tolerance`: differences of times such as 0.3 and 0.29 have rounding at their
/// end, which is not the clock's.
pub(crate) fn shortest(value: f64, tolerance: f64) -> f64 {
    (0..17)
        .filter_map(|digits| format!("{value:.digits$e}").parse().ok())
        .find(|rounded: &f64| (rounded - value).abs() <= tolerance)
        .unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_of_a_few_pauses_is_resampled_at_its_median_step() {
        let time: Vec<f64> = (0..100).map(|k| f64::from(k) + if k < 50 { 0.0 } else { 800.0 }).collect();
        let regular = Regular::of(&time, 1.003);
        assert!(regular.is_worth() && regular.step == 1.0);
        assert_eq!(regular.to_string(), "resample it every 1 s (`resample` 1:linear)");
    }

    #[test]
    fn a_log_of_long_pauses_is_not() {
        // As of a cell that is logged every second under load and every minute at rest.
        let mut time: Vec<f64> = (0..1200).map(f64::from).collect();
        time.extend((1..=1080).map(|k| 1199.0 + 60.0 * f64::from(k)));
        let regular = Regular::of(&time, 1.0);
        assert!(!regular.is_worth());
        let words = regular.to_string();
        assert!(words.contains("66000 rows, of which 2280 were recorded; cut it at its pauses"), "{words}");
        assert!(!words.contains("`resample` 1"), "{words}");
    }
}
