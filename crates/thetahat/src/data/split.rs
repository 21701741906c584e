use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;

/// Rows of a log, 1-based, both ends included: what a person writes as `1..300`.
///
/// ```
/// use thetahat::data::Rows;
///
/// let rows: Rows = "1..300".parse()?;
/// assert_eq!(rows.len(), 300);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "(usize, usize)", into = "(usize, usize)")]
pub struct Rows {
    first: usize,
    last: usize,
}

impl Rows {
    /// Rows `first` to `last`.
    ///
    /// # Errors
    /// [`Error::Argument`] if `first` is 0 or above `last`.
    pub fn new(first: usize, last: usize) -> Result<Self, Error> {
        if first == 0 {
            return Err(Error::argument("rows", format!("{first}..{last}: rows are counted from 1")));
        }
        if last < first {
            return Err(Error::argument(
                "rows",
                format!("{first}..{last}: the last row comes before the first; write {last}..{first}"),
            ));
        }
        Ok(Self { first, last })
    }

    /// The first row.
    pub fn first(&self) -> usize {
        self.first
    }

    /// The last row, included.
    pub fn last(&self) -> usize {
        self.last
    }

    /// The number of rows, at least 1.
    #[expect(clippy::len_without_is_empty, reason = "there is always a row")]
    pub fn len(&self) -> usize {
        self.last - self.first + 1
    }

    /// As 0-based positions.
    pub(crate) fn positions(&self) -> Range<usize> {
        self.first - 1..self.last
    }

    /// From 0-based positions that are not empty.
    pub(crate) fn from_positions(positions: &Range<usize>) -> Self {
        Self { first: positions.start + 1, last: positions.end }
    }
}

/// Shares of the rows for estimation, validation and test, in time order: what a person writes as `60/20/20`.
///
/// A share of 0 leaves a part out: `80/0/20` where no validation is needed, `75/25/0` where no test is wanted.
///
/// ```
/// use thetahat::data::Split;
///
/// assert!("60/20/20".parse::<Split>().is_ok());
/// assert!("60/20".parse::<Split>().is_err());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Split([f64; 3]);

impl Split {
    /// Three shares, of whatever sum. The first must be above 0.
    ///
    /// # Errors
    /// [`Error::Argument`] for shares that are negative, not finite or beyond 1e9, and for a first one of 0.
    pub fn new(estimation: f64, validation: f64, test: f64) -> Result<Self, Error> {
        let shares = [estimation, validation, test];
        if !shares.iter().all(|share| (0.0..=1e9).contains(share)) || estimation == 0.0 {
            return Err(Error::argument(
                "split",
                "the shares are not numbers from 0 on, the first above 0; write them as 60/20/20",
            ));
        }
        Ok(Self(shares))
    }

    /// Whether there is a validation part.
    pub fn validates(&self) -> bool {
        self.0[1] > 0.0
    }

    /// Cuts rows in their order into the three parts. What rounding leaves goes to the later one.
    ///
    /// # Errors
    /// [`Error::Argument`] if a part with a share gets no row.
    pub(crate) fn cut(&self, rows: &[Rows]) -> Result<[Vec<Rows>; 3], Error> {
        let [estimation, validation, test] = self.0;
        let total: usize = rows.iter().map(Rows::len).sum();
        let share = |sum: f64| {
            // At most the total, as the sum is at most the sum of all.
            (total as f64 * (sum / (estimation + validation + test))).floor() as usize
        };
        let first = share(estimation);
        let second = if test == 0.0 { total } else { share(estimation + validation) };
        let parts = [between(rows, 0, first), between(rows, first, second), between(rows, second, total)];
        let names = ["estimation", "validation", "test"];
        for ((share, part), name) in self.0.iter().zip(&parts).zip(names) {
            if *share > 0.0 && part.is_empty() {
                return Err(Error::argument(
                    "split",
                    format!("the {name} part of {total} rows has no row; give more rows, or another share"),
                ));
            }
        }
        Ok(parts)
    }
}

impl FromStr for Split {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let shares: Option<Vec<f64>> = text.split('/').map(|share| share.trim().parse().ok()).collect();
        match shares.as_deref() {
            Some(&[estimation, validation, test]) => Self::new(estimation, validation, test),
            _ => Err(Error::argument(
                "split",
                format!(
                    "'{text}' is not three shares; write estimation/validation/test as 60/20/20, 0 for a part that is not \
                     wanted"
                ),
            )),
        }
    }
}

impl fmt::Display for Split {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [estimation, validation, test] = self.0;
        write!(f, "{estimation}/{validation}/{test}")
    }
}

/// The rows from the position `first` up to `end` among all of some ranges.
pub(crate) fn between(rows: &[Rows], first: usize, end: usize) -> Vec<Rows> {
    let mut before = 0;
    let mut part = Vec::new();
    for range in rows {
        let own = first.max(before)..end.min(before + range.len());
        if !own.is_empty() {
            let at = |position: usize| range.first + position - before;
            part.push(Rows { first: at(own.start), last: at(own.end) - 1 });
        }
        before += range.len();
    }
    part
}

/// Checks that ranges lie inside a log of `rows` rows and do not overlap; gives them in rising order.
pub(crate) fn checked(argument: &str, ranges: &[Rows], rows: usize) -> Result<Vec<Rows>, Error> {
    let mut sorted = ranges.to_vec();
    sorted.sort_unstable();
    for range in &sorted {
        if range.last > rows {
            return Err(Error::data(format!(
                "`{argument}` {range}: the log has {rows} rows; name rows up to that"
            )));
        }
    }
    for pair in sorted.windows(2) {
        if let [a, b] = pair
            && b.first <= a.last
        {
            return Err(Error::argument(argument, format!("{a} and {b} overlap; name each row once")));
        }
    }
    Ok(sorted)
}

impl fmt::Display for Rows {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..{}", self.first, self.last)
    }
}

impl FromStr for Rows {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let wrong =
            || Error::argument("rows", format!("'{text}' is not a range of rows; write it as 1..300"));
        let (first, last) = text.split_once("..").ok_or_else(wrong)?;
        let number = |text: &str| text.trim().parse().map_err(|_| wrong());
        Self::new(number(first)?, number(last)?)
    }
}

impl TryFrom<(usize, usize)> for Rows {
    type Error = Error;

    fn try_from((first, last): (usize, usize)) -> Result<Self, Error> {
        Self::new(first, last)
    }
}

impl From<Rows> for (usize, usize) {
    fn from(rows: Rows) -> Self {
        (rows.first, rows.last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_read_and_refused() -> Result<(), Error> {
        assert_eq!("7..9".parse::<Rows>()?, Rows::new(7, 9)?);
        for wrong in ["", "7", "..", "0..3", "9..7", "a..b", "1..2..3", "-1..4", "1..99999999999999999999"] {
            assert!(wrong.parse::<Rows>().is_err(), "{wrong}");
        }
        Ok(())
    }

    #[test]
    fn rows_are_cut_in_their_order() -> Result<(), Error> {
        let rows = |text: &str| -> Result<Vec<Rows>, Error> { text.split(',').map(str::parse).collect() };
        let cut = |split: &str, of: &str| split.parse::<Split>()?.cut(&rows(of)?);
        assert_eq!(cut("60/20/20", "1..10")?, [rows("1..6")?, rows("7..8")?, rows("9..10")?]);
        assert_eq!(cut("1/1/1", "3..5,11..13,20..23")?, [rows("3..5")?, rows("11..13")?, rows("20..23")?]);
        assert_eq!(cut("50/0/50", "1..4,7..7")?, [rows("1..2")?, vec![], rows("3..4,7..7")?]);
        assert_eq!(cut("2/1/0", "1..10")?, [rows("1..6")?, rows("7..10")?, vec![]]);
        assert_eq!(cut("1/0/0", "1..7")?, [rows("1..7")?, vec![], vec![]]);
        assert!(
            matches!(cut("60/20/20", "1..2"), Err(Error::Argument { argument, .. }) if argument == "split")
        );
        for wrong in ["", "60", "60/40", "60/20/20/0", "a/b/c", "0/50/50", "-1/1/1", "nan/1/1", "inf/1/1"] {
            assert!(wrong.parse::<Split>().is_err(), "{wrong}");
        }
        assert_eq!("60/20/20".parse::<Split>()?.to_string(), "60/20/20");
        Ok(())
    }

    #[test]
    fn ranges_lie_inside_and_apart() -> Result<(), Error> {
        let rows = |text: &str| text.parse::<Rows>();
        assert_eq!(checked("estimate", &[rows("5..9")?, rows("1..4")?], 9)?, [rows("1..4")?, rows("5..9")?]);
        assert!(checked("estimate", &[rows("1..10")?], 9).is_err());
        assert!(checked("estimate", &[rows("1..4")?, rows("4..5")?], 9).is_err());
        Ok(())
    }
}
