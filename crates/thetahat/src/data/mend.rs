//! Clocks that stand still or go back, and what is certain of them.
//!
//! | pattern | cause | remedy |
//! |---|---|---|
//! | the same time in as many rows each time | rows are written in bursts, or the clock is coarse | the rows are spread evenly |
//! | an hour back, at night on a Sunday of a changing month | clocks are set back | an hour is added from there on |
//! | an hour more than a step, at such a time | clocks are set forward | an hour is taken off from there on |
//! | a day back | the times of day pass midnight | a day is added from there on |
//! | back to the first time, of a clock without dates | the recorder was started again | another experiment begins |
//!
//! Everything else is an error that says what was seen.

use super::steps::runs_forward;
use crate::Error;
use crate::figures::short;

const HOUR: f64 = 3600.0;
const DAY: f64 = 86_400.0;
/// So many steps of each hundred stand still where rows come in bursts, at least.
const BURSTS: f64 = 0.3;
/// The lengths of bursts differ from their median by no more than this part, or by one row.
const UNEVEN: f64 = 0.25;
/// A step that passes an hour or a day differs from a usual one by no more than this many.
const NEAR: f64 = 1.0;
/// The longest pause after midnight, in usual steps.
const PAUSE: f64 = 100.0;
/// Days from the beginning of 1970, a Thursday, to its first Sunday.
const FIRST_SUNDAY: i64 = 3;

/// Times that rise, and what was done so that they do.
#[derive(Debug, Clone, PartialEq)]
pub struct Mended {
    /// Seconds, one for each row. They rise but where another experiment begins.
    pub time: Vec<f64>,
    /// The rows (0-based) at which another experiment begins.
    pub restarts: Vec<usize>,
    /// What was done, in plain words.
    pub words: Vec<String>,
}

/// What the times of a log are, besides seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Calendar {
    /// Numbers.
    None,
    /// Times of day, of any day.
    TimesOfDay,
    /// Dates as the clocks on a wall show them; the first one is so many seconds after 1970.
    Wall {
        /// Seconds from 1970 to the first time.
        first: f64,
    },
    /// Instants: their clock is not set.
    Instants,
}

/// A clock of which the rows come in order, made to rise where it is certain how.
///
/// # Errors
/// [`Error::Data`] with the row at which the time stands still or goes back, and what may be the cause.
///
/// ```
/// use thetahat::data::{Calendar, mended};
///
/// // Two rows for each second, with the time in whole seconds.
/// let clock = mended(vec![0.0, 0.0, 1.0, 1.0, 2.0, 2.0], Calendar::None)?;
/// assert_eq!(clock.time, [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]);
/// assert!(clock.words[0].contains("2 rows have the same time"));
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn mended(time: Vec<f64>, calendar: Calendar) -> Result<Mended, Error> {
    let mut clock = Mended { time, restarts: Vec::new(), words: Vec::new() };
    let forward = runs_forward(&clock.time);
    if !forward && clock.time.iter().any(|time| !time.is_finite()) {
        // Who makes a log of it says so.
        return Ok(clock);
    }
    let changes = match calendar {
        Calendar::Wall { first } => changes_forward(&clock.time, first),
        _ => Vec::new(),
    };
    if changes.is_empty() && forward {
        return Ok(clock);
    }
    clock.spread_bursts();
    let Some(usual) = usual_step(&clock.time) else { return Ok(clock) };
    clock.shift(usual, calendar, &changes)?;
    Ok(clock)
}

/// The median of the steps forward.
fn usual_step(time: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> =
        time.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    let middle = steps.len() / 2;
    (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Whether clocks may be set at so many seconds after 1970: before five in the morning on a Sunday of a month in which
/// some country sets them.
fn is_change(wall: f64) -> bool {
    let days = (wall / DAY).floor() as i64;
    let of_year = (days as f64).rem_euclid(365.2425) / 30.44;
    let months = [1.7..=4.2, 8.7..=11.2];
    (days - FIRST_SUNDAY).rem_euclid(7) == 0
        && wall.rem_euclid(DAY) < 5.0 * HOUR
        && months.iter().any(|month| month.contains(&of_year))
}

/// The rows at which clocks were set forward, where the first time is so many seconds after 1970.
fn changes_forward(time: &[f64], first: f64) -> Vec<usize> {
    let Some(usual) = usual_step(time) else { return Vec::new() };
    let near = |pair: &[f64]| (pair[1] - pair[0] - HOUR - usual).abs() <= 0.1 * usual;
    let set = |row: &usize| is_change(first + time[*row] - time[0]);
    if usual > HOUR / 4.0 {
        return Vec::new();
    }
    (1..time.len()).filter(|row| near(&time[row - 1..=*row])).filter(set).collect()
}

impl Mended {
    /// Spreads rows that share a time evenly up to the next time.
    fn spread_bursts(&mut self) {
        let time = &self.time;
        let still = time.windows(2).filter(|pair| pair[1] == pair[0]).count();
        if (still as f64) < BURSTS * (time.len() - 1) as f64 {
            return;
        }
        let runs: Vec<&[f64]> = time.chunk_by(|a, b| a == b).collect();
        // The first and the last may be cut.
        let [_, inner @ .., _] = runs.as_slice() else { return };
        let mut lengths: Vec<usize> = inner.iter().map(|run| run.len()).collect();
        lengths.sort_unstable();
        let Some(&median) = lengths.get(lengths.len() / 2) else { return self.spread(&[], 0) };
        let even = |length: usize| length.abs_diff(median) as f64 <= (UNEVEN * median as f64).max(1.0);
        let uneven = lengths.iter().filter(|length| !even(**length)).count();
        if median > 1 && 20 * uneven <= lengths.len() {
            let counts: Vec<usize> = runs.iter().map(|run| run.len()).collect();
            self.spread(&counts, median);
        }
    }

    /// Spreads runs of so many rows.
    fn spread(&mut self, counts: &[usize], median: usize) {
        let mut spread = Vec::with_capacity(self.time.len());
        let mut first = 0;
        for (run, &count) in counts.iter().enumerate() {
            let now = self.time[first];
            let next = self.time.get(first + count).filter(|next| **next > now);
            let before = first.checked_sub(1).map(|row| self.time[row]);
            // The last run has no end, nor has one before the time goes back: its rows are as far apart as those
            // before.
            let step = match (next, before) {
                (Some(next), _) if run > 0 || count >= median => (next - now) / count as f64,
                (Some(next), _) => (next - now) / median as f64,
                (None, Some(before)) => (now - before) / median as f64,
                (None, None) => 0.0,
            };
            // The first run may have begun before the log.
            let missed = if run == 0 { median.saturating_sub(count) } else { 0 };
            spread.extend((0..count).map(|row| now + (missed + row) as f64 * step));
            first += count;
        }
        if spread.len() == self.time.len() {
            self.words.push(format!(
                "{median} rows have the same time, again and again: they are spread evenly up to the next time"
            ));
            self.time = spread;
        }
    }

    /// Moves what is after a clock that was set, after midnight, or of another experiment.
    fn shift(&mut self, usual: f64, calendar: Calendar, changes: &[usize]) -> Result<(), Error> {
        let recorded = self.time.clone();
        let at = |row: usize| match calendar {
            Calendar::Wall { first } => is_change(first + recorded[row] - recorded[0]),
            _ => false,
        };
        let mut ahead = 0.0;
        for row in 1..recorded.len() {
            let step = recorded[row] - recorded[row - 1];
            let near = |wanted: f64| (step - wanted).abs() <= NEAR * usual;
            if changes.contains(&row) {
                ahead -= HOUR;
                self.words.push(format!(
                    "in row {} the clock is an hour ahead, as where it is set for summer: an hour is taken off from there on; \
                     `time-zone` says which zone it is, and UTC that it is none",
                    row + 1
                ));
            } else if step <= 0.0 {
                if near(usual - HOUR) && at(row) {
                    ahead += HOUR;
                    self.words.push(format!(
                        "in row {} the clock goes back by an hour, as where summer time ends: an hour is added from there on; \
                         `time-zone` says which zone it is",
                        row + 1
                    ));
                } else if is_midnight(step, usual, &recorded, calendar) {
                    ahead += DAY;
                    self.words.push(format!(
                        "in row {} the times of day pass midnight: a day is added from there on",
                        row + 1
                    ));
                } else if is_restart(recorded[row], recorded[0], usual, calendar) && step < -usual {
                    self.restarts.push(row);
                    ahead = 0.0;
                    self.words.push(format!(
                        "in row {} the clock begins again: another experiment is taken to begin there",
                        row + 1
                    ));
                } else {
                    return Err(trouble(&recorded, row, usual));
                }
            }
            self.time[row] += ahead;
        }
        Ok(())
    }
}

/// Whether a step back is that of times of day at midnight.
fn is_midnight(step: f64, usual: f64, time: &[f64], calendar: Calendar) -> bool {
    let passes = step + DAY > 0.0 && step + DAY <= PAUSE * usual;
    let within_a_day = || time.iter().all(|time| (0.0..=DAY).contains(time));
    match calendar {
        Calendar::TimesOfDay => step < 0.0 && passes,
        Calendar::None => passes && step + DAY <= 2.0 * usual && within_a_day(),
        _ => false,
    }
}

/// Whether a clock without dates begins again.
fn is_restart(now: f64, first: f64, usual: f64, calendar: Calendar) -> bool {
    matches!(calendar, Calendar::None) && (now - first).abs() <= 2.0 * usual
}

/// That a time stands still or goes back, and what may be the cause.
fn trouble(time: &[f64], row: usize, usual: f64) -> Error {
    let (before, now) = (time[row - 1], time[row]);
    let count = |wrong: fn(&[f64]) -> bool| match time.windows(2).filter(|pair| wrong(pair)).count() {
        1 => "once".to_owned(),
        times => format!("{times} times"),
    };
    let message = if now == before {
        format!(
            "time repeats (at {now} s; {} in all); keep one row for each time, or give `sample-time` if rows are evenly apart",
            count(|pair| pair[1] == pair[0])
        )
    } else if (before - now - HOUR).abs() <= 2.0 * usual {
        format!(
            "time goes back by an hour (from {before} s to {now} s): if the clock was set, name its zone (`time-zone`)"
        )
    } else {
        format!(
            "time goes back (from {before} s to {now} s, by {} s; {} in all); sort the log by time, or cut it there into two logs \
             if the recorder was started again",
            short(before - now),
            count(|pair| pair[1] < pair[0])
        )
    };
    Error::Data { channel: None, row: Some(row + 1), message }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::assert_refused;

    /// 2024-10-27T00:00:00, the day on which summer time ended in Europe.
    const SUNDAY: f64 = 1_729_987_200.0;

    fn clock(rows: usize, step: f64) -> Vec<f64> {
        (0..rows).map(|row| row as f64 * step).collect()
    }

    #[test]
    fn a_clock_that_rises_is_left_alone() {
        for calendar in
            [Calendar::None, Calendar::TimesOfDay, Calendar::Instants, Calendar::Wall { first: SUNDAY }]
        {
            let time = clock(100, 0.3);
            assert_eq!(mended(time.clone(), calendar), Ok(Mended { time, restarts: vec![], words: vec![] }));
        }
        assert!(mended(vec![], Calendar::None).is_ok());
        assert!(mended(vec![1.0], Calendar::None).is_ok());
        assert!(mended(vec![1.0, f64::NAN], Calendar::None).is_ok());
    }

    #[test]
    fn bursts_are_spread() {
        // Four rows a second; the first and the last second are cut.
        let exact: Vec<f64> = (2..103).map(|row| f64::from(row) * 0.25).collect();
        let coarse: Vec<f64> = exact.iter().map(|time| time.floor()).collect();
        let found = mended(coarse, Calendar::None).unwrap();
        assert!(found.time.iter().zip(&exact).all(|(found, exact)| (found - exact).abs() < 1e-12));
        assert_eq!(found.words.len(), 1);
        // One repeated row is none.
        let mut time = clock(50, 1.0);
        time[7] = 6.0;
        assert_refused(mended(time, Calendar::None), "time repeats (at 6 s; once in all)");
    }

    #[test]
    fn clocks_that_are_set_go_on() {
        // From 01:30 on, every 10 s: from row 541 on an hour less.
        let exact = clock(1000, 10.0);
        let wall: Vec<f64> =
            exact.iter().map(|time| time - if *time >= 5400.0 { HOUR } else { 0.0 }).collect();
        let first = SUNDAY + 1.5 * HOUR;
        let found = mended(wall.clone(), Calendar::Wall { first }).unwrap();
        assert_eq!(found.time, exact);
        assert!(found.words[0].starts_with("in row 541 the clock goes back by an hour"), "{:?}", found.words);
        // On another day, and of instants, it is a mistake.
        for calendar in [Calendar::Wall { first: first - 2.0 * DAY }, Calendar::Instants, Calendar::None] {
            assert_refused(mended(wall.clone(), calendar), "name its zone (`time-zone`)");
        }
        // 2024-03-31T00:00:00, the day on which it began.
        let wall: Vec<f64> =
            exact.iter().map(|time| time + if *time >= 5400.0 { HOUR } else { 0.0 }).collect();
        let found = mended(wall.clone(), Calendar::Wall { first: 1_711_843_200.0 + 0.5 * HOUR }).unwrap();
        assert_eq!(found.time, exact);
        // A pause of an hour on another day is one.
        assert_eq!(
            mended(wall.clone(), Calendar::Wall { first: 1_711_843_200.0 - 2.0 * DAY }).unwrap().time,
            wall
        );
    }

    #[test]
    fn midnight_is_passed() {
        let exact = clock(500, 600.0);
        let day: Vec<f64> = exact.iter().map(|time| (time + 80_000.0) % DAY).collect();
        for (calendar, time) in [
            (Calendar::None, day.clone()),
            (Calendar::TimesOfDay, day.iter().map(|time| time - 80_000.0).collect()),
        ] {
            let found = mended(time, calendar).unwrap();
            let steps = found.time.windows(2).map(|pair| pair[1] - pair[0]);
            assert!(steps.into_iter().all(|step| (step - 600.0).abs() < 1e-9), "{calendar:?}");
            assert_eq!(found.words.len(), 4, "{calendar:?}");
        }
    }

    #[test]
    fn another_experiment_begins_where_the_clock_does() {
        let time: Vec<f64> = clock(30, 0.1).into_iter().chain(clock(20, 0.1)).collect();
        let found = mended(time.clone(), Calendar::None).unwrap();
        assert_eq!((found.time, found.restarts), (time, vec![30]));
        // A log that is not sorted is none.
        assert_refused(
            mended(vec![0.0, 1.0, 2.0, 5.0, 3.0, 4.0, 6.0], Calendar::None),
            "time goes back (from 5 s to 3 s, by 2 s; once in all); sort the log",
        );
    }
}
