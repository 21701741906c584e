//! Inputs as functions of time, of which a log has samples.

/// The inputs of a model at one row, and from there to the next.
///
/// Between rows an input is held, or goes in a straight line to the next value where the model says so. Before the
/// first row it is as in that one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drive<'a> {
    /// Seconds of the rows.
    times: &'a [f64],
    /// Row after row.
    values: &'a [f64],
    width: usize,
    /// Which inputs go in straight lines; empty where none does.
    linear: &'a [bool],
    /// Where the model stands.
    row: usize,
}

impl<'a> Drive<'a> {
    /// Inputs that are always as they are now.
    pub(crate) fn held(values: &'a [f64]) -> Self {
        Self { times: &[], values, width: values.len(), linear: &[], row: 0 }
    }

    /// Those of a log, at one of its rows. `linear` says which go in straight lines, if any does.
    pub(crate) fn of_rows(
        (times, values): (&'a [f64], &'a [f64]),
        width: usize,
        linear: &'a [bool],
        row: usize,
    ) -> Self {
        Self { times, values, width, linear, row }
    }

    /// The value of an input at a time between this row and the next.
    #[inline]
    pub(super) fn value(&self, input: usize, time: f64) -> f64 {
        if self.is_linear(input) { self.on_line(self.row, input, time) } else { self.of_row(self.row, input) }
    }

    /// An input so many seconds ago, and how fast that value rises with the delay. One that is held is taken as its
    /// mean over a span that begins at one time and lasts for some seconds, so that a delay may be a part of a sample:
    ///
    /// ```text
    /// mean = (1/h) ∫ u(s - delay) ds from t to t + h,   d mean/d delay = (u(t - delay) - u(t + h - delay))/h
    /// ```
    ///
    /// Where an end of the span is that of a row, as with a delay of whole rows, the slope is that of a delay that
    /// grows: u is taken just before it.
    pub(super) fn delayed(
        &self,
        input: usize,
        time: f64,
        (begin, span): (f64, f64),
        delay: f64,
    ) -> (f64, f64) {
        if self.times.is_empty() {
            return (self.of_row(self.row, input), 0.0);
        }
        if self.is_linear(input) {
            let then = time - delay;
            let row = self.row_at(then);
            let (here, next) = (self.of_row(row, input), self.next(row, input));
            let slope = match self.times.get(row + 1) {
                Some(later) if then >= self.times[row] => -(next - here) / (later - self.times[row]),
                _ => 0.0,
            };
            return (self.on_line(row, input, then), slope);
        }
        let (from, to) = (begin - delay, begin - delay + span);
        let first = self.row_at(from);
        if span <= 0.0 {
            return (self.of_row(first, input), 0.0);
        }
        let (mut sum, mut at, mut row) = (0.0, from, first);
        while let Some(&later) = self.times.get(row + 1).filter(|later| **later < to) {
            sum += self.of_row(row, input) * (later - at).max(0.0);
            (at, row) = (at.max(later), row + 1);
        }
        let last = self.of_row(row, input);
        sum += last * (to - at);
        let before = if self.times[first] < from { first } else { first.saturating_sub(1) };
        (sum / span, (self.of_row(before, input) - last) / span)
    }

    fn is_linear(&self, input: usize) -> bool {
        self.linear.get(input).copied().unwrap_or(false)
    }

    fn of_row(&self, row: usize, input: usize) -> f64 {
        self.values[row * self.width + input]
    }

    /// The value in the row after, or in the last one.
    fn next(&self, row: usize, input: usize) -> f64 {
        let next = if row + 1 < self.times.len() { row + 1 } else { row };
        self.of_row(next, input)
    }

    /// On the line from a row to the next.
    fn on_line(&self, row: usize, input: usize, time: f64) -> f64 {
        let (here, next) = (self.of_row(row, input), self.next(row, input));
        let Some((from, to)) = self.times.get(row).zip(self.times.get(row + 1)) else { return here };
        here + (next - here) * ((time - from) / (to - from)).clamp(0.0, 1.0)
    }

    /// The last row that is not after a time; the first one before all. A delay is short beside a log: it is looked for
    /// in steps that double, from where the model stands.
    fn row_at(&self, time: f64) -> usize {
        let (mut high, mut reach) = ((self.row + 1).min(self.times.len()), 1);
        while high > reach && self.times[high - reach] > time {
            (high, reach) = (high - reach, reach * 2);
        }
        let low = high.saturating_sub(reach);
        (low + self.times[low..high].partition_point(|own| *own <= time)).saturating_sub(1)
    }
}

#[cfg(test)]
mod tests {
    use super::Drive;

    const TIMES: [f64; 5] = [0.0, 1.0, 2.0, 4.0, 5.0];
    const VALUES: [f64; 5] = [1.0, 3.0, -2.0, 5.0, 4.0];

    fn drive(linear: &'static [bool], row: usize) -> Drive<'static> {
        Drive::of_rows((&TIMES, &VALUES), 1, linear, row)
    }

    #[test]
    fn what_is_held_is_delayed_by_its_mean() {
        let at = |delay: f64| drive(&[], 3).delayed(0, 4.0, (4.0, 1.0), delay);
        assert_eq!(at(0.0).0, 5.0);
        // From 3 to 4, from 2.5 to 3.5, from 1.75 to 2.75.
        assert_eq!(at(1.0).0, -2.0);
        assert_eq!(at(1.5).0, -2.0);
        assert_eq!(at(2.25).0, 0.25 * 3.0 - 0.75 * 2.0);
        // From 3.5 to 4.5; before the first row.
        assert_eq!(at(0.5), (0.5 * -2.0 + 0.5 * 5.0, -2.0 - 5.0));
        assert_eq!(at(30.0), (1.0, 0.0));
        // From 2 to 3, where a longer delay lets more of the row before in; from 1 to 2.
        assert_eq!((at(2.0), at(3.0)), ((-2.0, 5.0), (3.0, -2.0)));
        // Over several rows at once.
        let long = drive(&[], 4).delayed(0, 4.0, (4.5, 4.0), 4.0).0;
        assert_eq!(long, (0.5 * 1.0 + 3.0 - 2.0 * 2.0 + 0.5 * 5.0) / 4.0);
        for delay in [0.2, 0.9, 1.3, 2.4, 3.7] {
            let slope = (at(delay + 1e-6).0 - at(delay - 1e-6).0) / 2e-6;
            assert!((at(delay).1 - slope).abs() < 1e-8, "{delay}: {} {slope}", at(delay).1);
        }
    }

    #[test]
    fn lines_lead_from_row_to_row() {
        let at = |time: f64| drive(&[true], 2).value(0, time);
        assert_eq!([at(2.0), at(3.0), at(4.0)], [-2.0, 1.5, 5.0]);
        assert_eq!(drive(&[true], 4).value(0, 5.5), 4.0);
        let ago = |delay: f64| drive(&[true], 4).delayed(0, 5.0, (5.0, 1.0), delay);
        assert_eq!(ago(0.5), (4.5, 1.0));
        assert_eq!(ago(2.0), (1.5, -3.5));
        assert_eq!(ago(9.0), (1.0, 0.0));
    }

    #[test]
    fn inputs_without_a_clock_are_as_they_are() {
        let held = Drive::held(&[2.0, 7.0]);
        assert_eq!((held.value(1, 3.0), held.delayed(0, 3.0, (3.0, 1.0), 0.4)), (7.0, (2.0, 0.0)));
    }
}
